//! Real captures against one another, against their labels, and against plain geometry.

use crate::common;
use crate::common::{bvh_files, capture_file, captures, op3, op3_initial_rad};
use gaitway::body::Segment;
use gaitway::mocap::anatomy::{self, Capture};
use gaitway::mocap::clip::Clip;
use gaitway::mocap::retarget::{Retargeted, retarget};
use gaitway::mocap::skeleton::Placed;
use gaitway::mocap::{bvh, read_bvh};
use glam::DVec3;
use std::path::Path;

fn clip(path: &Path) -> Clip {
    Clip::new(bvh::read(path).unwrap(), None).unwrap()
}

fn on_op3(capture: &Capture) -> Retargeted {
    retarget(capture, &op3(), &op3_initial_rad(), &Default::default()).unwrap()
}

/// Places of hands and feet by pose.
fn ends(clip: &Clip) -> Vec<[DVec3; 4]> {
    let mut placed = Placed::default();
    (0..clip.pose_count())
        .map(|index| {
            clip.place(index, &mut placed);
            let body = clip.landmarks(&placed);
            let wrist = |arm| body.joint(arm).unwrap() + body.bone(arm).unwrap();
            let ankle = |foot| body.joint(foot).unwrap();
            [
                wrist(Segment::LeftForearm),
                wrist(Segment::RightForearm),
                ankle(Segment::LeftFoot),
                ankle(Segment::RightFoot),
            ]
        })
        .collect()
}

fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let (ma, mb) = (mean(a), mean(b));
    let (mut ab, mut aa, mut bb) = (0.0, 0.0, 0.0);
    for (a, b) in a.iter().zip(b) {
        ab += (a - ma) * (b - mb);
        aa += (a - ma).powi(2);
        bb += (b - mb).powi(2);
    }
    ab / (aa * bb).sqrt()
}

/// Index pairs of poses of two files that show the same instant; `late` is by how many poses the
/// second file is late.
fn same_instants(one: &Clip, other: &Clip, late: usize) -> Vec<(usize, usize)> {
    (0..one.pose_count())
        .filter_map(|at| Some((at, (at + one.dropped() + late).checked_sub(other.dropped())?)))
        .filter(|(_, at)| *at < other.pose_count())
        .collect()
}

/// The same karate take with world coordinates in the position channels of thorax and head
/// (Acclaim style, Z up, inch) and in Poser's skeleton (Y up, cm).
#[test]
fn a_take_in_two_skeletons_moves_its_limbs_alike() {
    let Some(folder) = captures() else { return };
    let (Some(a), Some(b)) = (
        capture_file(&folder, "cmu_new2_frontkick001.bvh"),
        capture_file(&folder, "martial_04.bvh"),
    ) else {
        return;
    };
    let (one, other) = (clip(&a), clip(&b));
    let (ends_one, ends_other) = (ends(&one), ends(&other));
    let pairs = same_instants(&one, &other, 1);
    assert!(pairs.len() > 1300);
    for i in 0..4 {
        for j in 0..i {
            let a: Vec<f64> = pairs
                .iter()
                .map(|(at, _)| (ends_one[*at][i] - ends_one[*at][j]).length())
                .collect();
            let b: Vec<f64> = pairs
                .iter()
                .map(|(_, at)| (ends_other[*at][i] - ends_other[*at][j]).length())
                .collect();
            let correlation = correlation(&a, &b);
            assert!(correlation > 0.95, "ends {i} and {j}: {correlation:.3}");
        }
    }
}

/// CMU 01_01 by two converters: other names, other channel orders, one with a rest pose in front.
#[test]
fn a_take_by_two_converters_is_one_motion_on_the_robot() {
    let Some(folder) = captures() else { return };
    let (Some(a), Some(b)) = (
        capture_file(&folder, "cmu_01_01_first1000.bvh"),
        capture_file(&folder, "fairmotion_01_01.bvh"),
    ) else {
        return;
    };
    let (one, other) = (clip(&a), clip(&b));
    assert_eq!((one.dropped(), other.dropped()), (0, 1));
    let pairs = same_instants(&one, &other, 1);
    let (a, b) =
        (on_op3(&anatomy::capture(&one).unwrap()), on_op3(&anatomy::capture(&other).unwrap()));
    for (joint, name) in a.joints.iter().enumerate() {
        // The files differ in length: leave the filter's end out.
        let pairs = pairs[..pairs.len() - 60].iter();
        let off =
            pairs.map(|(at, bt)| (a.positions_rad[joint][*at] - b.positions_rad[joint][*bt]).abs());
        let off = off.fold(0.0, f64::max).to_degrees();
        assert!(off < 4.0, "{name}: {off:.2} deg");
    }
}

/// The hand that a file is named after goes up: in the capture, and on the robot.
#[test]
fn left_is_left_and_right_is_right() {
    let Some(folder) = captures() else { return };
    let mut seen = 0;
    for path in bvh_files(&folder) {
        let name = path.file_stem().unwrap_or_default().to_string_lossy().replace('-', "_");
        let raises = ["hand_wave", "raise_up", "wave_", "hand_on_head"];
        let one_hand = name.contains("left_hand") != name.contains("right_hand");
        if !one_hand || !raises.iter().any(|word| name.contains(word)) {
            continue;
        }
        let left = name.contains("left_hand");
        let clip = clip(&path);
        let highest = |side: usize| ends(&clip).iter().map(|e| e[side].z).fold(f64::MIN, f64::max);
        let (mine, other) = if left { (0, 1) } else { (1, 0) };
        assert!(highest(mine) > highest(other) + 0.2, "{name}: the wrong wrist goes up");
        let result = on_op3(&anatomy::capture(&clip).unwrap());
        let model = op3();
        let highest = |segment: Segment| {
            let link = model.links.iter().find(|link| link.segment == segment).unwrap();
            let from_n_pose = model.link_orientation(link.joint, &model.n_pose_rad).inverse();
            let heights = (0..clip.pose_count()).map(|at| {
                let angles: Vec<f64> =
                    result.positions_rad.iter().map(|series| series[at]).collect();
                (model.link_orientation(link.joint, &angles) * from_n_pose * DVec3::NEG_Z).z
            });
            heights.fold(f64::MIN, f64::max)
        };
        let (left_arm, right_arm) = (highest(Segment::LeftForearm), highest(Segment::RightForearm));
        assert_eq!(left_arm > right_arm, left, "{name}: the robot raises the wrong arm");
        seen += 1;
    }
    assert!(seen > 0, "no file under {} is named after a raised hand", folder.display());
}

/// Knees bend backwards, elbows forwards, and the robot's knee bends as far as the person's while
/// the hip can follow; the person's bend is measured between joint positions, without any
/// anatomical frame.
#[test]
fn knees_and_elbows_bend_the_way_they_do() {
    let Some(folder) = captures() else { return };
    let model = op3();
    for path in bvh_files(&folder) {
        let Ok(clip) = bvh::read(&path).and_then(|bvh| Clip::new(bvh, None)) else { continue };
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let capture = anatomy::capture(&clip).unwrap();
        let result = on_op3(&capture);
        let mut placed = Placed::default();
        let mut off = Vec::new();
        let (mut knees, mut elbows) = (Vec::new(), Vec::new());
        for at in 0..clip.pose_count() {
            clip.place(at, &mut placed);
            let body = clip.landmarks(&placed);
            let bend = |upper, lower| {
                let between = body.direction(upper)?.angle_between(body.direction(lower)?);
                let turned = |segment: Segment| capture.poses[at].orientation[segment.index()];
                let lower_z = turned(upper).inverse() * turned(lower) * DVec3::NEG_Z;
                // Positive X is forwards in the upper segment's frame.
                Some((between, lower_z.x))
            };
            let angles: Vec<f64> = result.positions_rad.iter().map(|series| series[at]).collect();
            for (thigh, shank, hip, knee) in [
                (Segment::LeftThigh, Segment::LeftShank, "l_hip_pitch", "l_knee"),
                (Segment::RightThigh, Segment::RightShank, "r_hip_pitch", "r_knee"),
            ] {
                let (between, forwards) = bend(thigh, shank).unwrap();
                if between > 0.5 {
                    knees.push(forwards);
                }
                if angles[common::op3_joint(hip)].abs() > 1.1 {
                    continue;
                }
                let robot = angles[common::op3_joint(knee)].abs();
                off.push((robot - between).abs().to_degrees());
                if between > 0.7 {
                    // By kinematics: the robot's shank points behind its thigh.
                    let turned = |segment: Segment| {
                        let link = model.links.iter().find(|l| l.segment == segment).unwrap();
                        let n_pose = model.link_orientation(link.joint, &model.n_pose_rad);
                        model.link_orientation(link.joint, &angles) * n_pose.inverse()
                    };
                    let shank_in_thigh = turned(thigh).inverse() * turned(shank) * DVec3::NEG_Z;
                    assert!(shank_in_thigh.x < 0.0, "{name}: {knee} bends forwards at {at}");
                }
            }
            for (upper, lower) in [
                (Segment::LeftUpperArm, Segment::LeftForearm),
                (Segment::RightUpperArm, Segment::RightForearm),
            ] {
                let (between, forwards) = bend(upper, lower).unwrap();
                if between > 0.5 {
                    elbows.push(forwards);
                }
            }
        }
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
        assert!(mean(&knees) <= 0.0, "{name}: knees bend forwards");
        assert!(mean(&elbows) >= 0.0, "{name}: elbows bend backwards");
        assert!(mean(&off) < 8.0, "{name}: the robot's knees are off by {:.1} deg", mean(&off));
    }
}

/// Every capture is a person of plausible size standing on the ground in most of its poses.
#[test]
fn captures_are_people_in_metres_with_z_up() {
    let Some(folder) = captures() else { return };
    let mut seen = 0;
    for path in bvh_files(&folder) {
        let Ok(capture) = read_bvh(&path, None) else { continue };
        let name = path.display();
        assert!((0.9..=2.1).contains(&capture.stature_m), "{name}: {} m", capture.stature_m);
        let first = &capture.poses[0];
        let forward = first.orientation[Segment::Pelvis.index()] * DVec3::X;
        assert!(forward.y.abs() < 1e-9 && forward.x > 0.0, "{name} starts facing {forward}");
        assert!(first.root_m.truncate().length() < 1e-9, "{name} starts at {}", first.root_m);
        seen += 1;
    }
    assert!(seen > 0, "no usable capture under {}", folder.display());
}

/// The unit and the up axis of each kind of file, as its makers chose them.
#[test]
fn units_and_axes_are_those_of_the_makers() {
    let Some(folder) = captures() else { return };
    let cm = 0.01;
    let inch = 0.0254;
    for (name, unit, up) in [
        ("cmu_new2_frontkick001.bvh", inch, DVec3::Z),
        ("sst_walk_circle.bvh", cm, DVec3::Y),
        ("dataset-1_bow_normal_001.bvh", cm, DVec3::Y),
        ("cmu_01_01_first1000.bvh", inch / 0.45, DVec3::Y),
        ("8yr_old_dab__9f567a.bvh", inch, DVec3::Z),
        ("cmu_1006_walking.bvh", inch, DVec3::Z),
        ("bvh_test3.bvh", inch, DVec3::Z),
        ("test_freebvh.bvh", cm, DVec3::Y),
        ("martial_04.bvh", cm, DVec3::Y),
        ("jesse_dance.bvh", cm, DVec3::Y),
        ("boxing.bvh", cm, DVec3::Y),
    ] {
        let Some(path) = capture_file(&folder, name) else { continue };
        let clip = clip(&path);
        assert_eq!(clip.metres_per_unit(), unit, "{name}");
        assert!((clip.file_up() - up).length() < 1e-9, "{name}: {}", clip.file_up());
    }
}
