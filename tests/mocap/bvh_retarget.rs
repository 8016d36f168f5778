//! From segments to joints: known motions come back, and captures suit a real robot.

use crate::common;
use crate::common::{bvh_files, captures, op3, op3_initial_rad, op3_joint, stretch};
use gaitway::body::{Segment, SegmentPose};
use gaitway::mocap::anatomy::Capture;
use gaitway::mocap::retarget::{ModelJoint, RobotModel, SegmentLink, retarget, wanted};
use gaitway::mocap::{anatomy, bvh, clip::Clip};
use glam::{DQuat, DVec3};
use proptest::prelude::*;
use std::f64::consts::PI;

/// How segments lie when a robot stands at given angles: each link as turned from its N pose.
fn played(model: &RobotModel, angles: &[f64]) -> SegmentPose {
    let mut orientation = [DQuat::IDENTITY; 13];
    for link in &model.links {
        let from_n_pose = model.link_orientation(link.joint, &model.n_pose_rad).inverse();
        orientation[link.segment.index()] =
            model.link_orientation(link.joint, angles) * from_n_pose;
    }
    SegmentPose { root_m: DVec3::ZERO, orientation }
}

fn capture_of(poses: Vec<SegmentPose>, rate_hz: f64) -> Capture {
    Capture {
        rate_hz,
        poses,
        tracked: [true; 13],
        stature_m: 1.7,
        is_made: true,
        notes: Vec::new(),
    }
}

/// Smooth motion of every joint about the middle of its range.
fn sway(model: &RobotModel, seed: u64, samples: usize, rate_hz: f64) -> Vec<Vec<f64>> {
    (0..samples)
        .map(|sample| {
            let t = sample as f64 / rate_hz;
            let angle = |(at, joint): (usize, &ModelJoint)| {
                let phase = (seed as f64 * 0.7 + at as f64 * 1.9) % (2.0 * PI);
                let half = (joint.upper_rad - joint.lower_rad) / 2.0;
                let middle = joint.lower_rad + half;
                middle + 0.5 * half * (2.0 * PI * (0.2 + 0.03 * at as f64) * t + phase).sin()
            };
            model.joints.iter().enumerate().map(angle).collect()
        })
        .collect()
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 12,
        failure_persistence: None,
        ..Default::default()
    })]

    #[test]
    fn a_motion_the_robot_can_do_comes_back(seed in 0u64..1000) {
        let model = op3();
        let rate_hz = 60.0;
        let angles = sway(&model, seed, 240, rate_hz);
        let poses = angles.iter().map(|angles| played(&model, angles)).collect();
        let capture = capture_of(poses, rate_hz);
        let found = wanted(&capture, &model, &op3_initial_rad(), &mut Vec::new()).unwrap();
        for (joint, series) in found.iter().enumerate() {
            let name = &model.joints[joint].name;
            for sample in ENDS..series.len() - ENDS {
                if name.contains("sho_pitch") && is_in_t_pose(&angles[sample], name) {
                    continue;
                }
                let off = (series[sample] - angles[sample][joint]).abs().to_degrees();
                prop_assert!(off < 3.0, "{name} at {sample}: {off:.2} deg");
            }
        }
    }
}

/// Samples at either end where the penalty on velocity still flattens the motion.
const ENDS: usize = 12;

/// True if an arm of OP3 lies along the axis of its shoulder pitch, which then turns nothing.
fn is_in_t_pose(angles: &[f64], name: &str) -> bool {
    let [roll, elbow] = match name.starts_with('r') {
        true => ["r_sho_roll", "r_el"].map(op3_joint),
        false => ["l_sho_roll", "l_el"].map(op3_joint),
    };
    let upper: f64 = angles[roll];
    let lower = upper - angles[elbow];
    upper.sin().abs() < 0.3 && lower.sin().abs() < 0.3
}

/// A robot built like a person: three joints at hip, shoulder, waist and neck, two at the ankle.
fn like_a_person() -> RobotModel {
    let mut joints: Vec<ModelJoint> = Vec::new();
    let mut links = Vec::new();
    let mut chain = |segment: Segment, parent: Option<usize>, axes: &[DVec3]| {
        let mut parent = parent;
        for axis in axes {
            joints.push(ModelJoint {
                name: format!("{segment:?} {axis}"),
                parent,
                origin_m: DVec3::ZERO,
                axis: *axis,
                lower_rad: -3.0,
                upper_rad: 3.0,
            });
            parent = Some(joints.len() - 1);
        }
        let joint = joints.len() - 1;
        links.push(SegmentLink { segment, joint, direction_weight: 1.0, twist_weight: 0.5 });
        Some(joint)
    };
    let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
    let torso = chain(Segment::Torso, None, &[z, x, y]);
    chain(Segment::Head, torso, &[z, y, x]);
    for (upper, lower) in [
        (Segment::LeftUpperArm, Segment::LeftForearm),
        (Segment::RightUpperArm, Segment::RightForearm),
    ] {
        let elbow = chain(upper, torso, &[y, x, z]);
        chain(lower, elbow, &[y, z]);
    }
    for (thigh, shank, foot) in [
        (Segment::LeftThigh, Segment::LeftShank, Segment::LeftFoot),
        (Segment::RightThigh, Segment::RightShank, Segment::RightFoot),
    ] {
        let knee = chain(thigh, None, &[z, x, y]);
        let ankle = chain(shank, knee, &[y]);
        chain(foot, ankle, &[y, x]);
    }
    let n_pose_rad = vec![0.0; joints.len()];
    RobotModel { joints, base: vec![Segment::Pelvis], n_pose_rad, links, hands: Vec::new() }
}

#[test]
fn a_robot_built_like_a_person_does_what_the_person_does() {
    let (poses, rate_hz) = common::puppet::exercise();
    let model = like_a_person();
    let capture = capture_of(poses, rate_hz);
    let initial = vec![0.0; model.joints.len()];
    let found = wanted(&capture, &model, &initial, &mut Vec::new()).unwrap();
    for (sample, pose) in
        capture.poses.iter().enumerate().take(capture.poses.len() - ENDS).skip(ENDS)
    {
        let angles: Vec<f64> = found.iter().map(|series| series[sample]).collect();
        let pelvis = pose.orientation[Segment::Pelvis.index()];
        for link in &model.links {
            let link_turned = pelvis * model.link_orientation(link.joint, &angles);
            let segment = pose.orientation[link.segment.index()];
            let off = link_turned.angle_between(segment).to_degrees();
            assert!(off < 1.5, "{:?} at {sample} is off by {off:.2} deg", link.segment);
        }
    }
}

#[test]
fn the_waist_of_a_robot_without_one_does_not_turn_its_arms() {
    // The torso turns and carries the arms along: against the torso nothing moves.
    let pose = |angle: f64| {
        let turn = DQuat::from_rotation_z(angle);
        let mut pose = SegmentPose { root_m: DVec3::ZERO, orientation: [turn; 13] };
        for segment in [Segment::Pelvis, Segment::LeftThigh, Segment::RightThigh] {
            pose.orientation[segment.index()] = DQuat::IDENTITY;
        }
        pose
    };
    let poses = (0..60).map(|at| pose(0.01 * f64::from(at))).collect();
    let found = wanted(&capture_of(poses, 30.0), &op3(), &op3_initial_rad(), &mut Vec::new());
    let found = found.unwrap();
    for name in ["r_sho_pitch", "l_sho_pitch", "r_sho_roll", "head_pan"] {
        let series = &found[op3_joint(name)];
        let range = series
            .iter()
            .fold((f64::MAX, f64::MIN), |(low, high), angle| (low.min(*angle), high.max(*angle)));
        assert!(range.1 - range.0 < 0.01, "{name}: {range:?}");
    }
}

#[test]
fn a_models_contradictions_are_refused() {
    let (poses, rate_hz) = common::puppet::exercise();
    let capture = capture_of(poses, rate_hz);
    let refusal = |change: fn(&mut RobotModel)| {
        let mut model = op3();
        change(&mut model);
        let error = retarget(&capture, &model, &op3_initial_rad(), &Default::default());
        error.expect_err("the model contradicts itself").to_string()
    };
    assert!(refusal(|model| model.joints[3].axis *= 2.0).contains("l_sho_roll"));
    assert!(refusal(|model| model.joints[3].lower_rad = 9.0).contains("l_sho_roll"));
    assert!(refusal(|model| model.joints[0].parent = Some(4)).contains("circle"));
    assert!(refusal(|model| model.joints[0].parent = Some(99)).contains("r_sho_pitch"));
    assert!(refusal(|model| model.links[0].joint = 20).contains("head"));
    assert!(refusal(|model| model.base.clear()).contains("base"));
    assert!(refusal(|model| model.n_pose_rad.clear()).contains("n_pose_rad"));
    let error = retarget(&capture, &op3(), &[0.0], &Default::default()).unwrap_err();
    assert!(error.to_string().contains("initial_rad"), "{error}");
}

fn read(path: &std::path::Path) -> Option<Capture> {
    let clip = Clip::new(bvh::read(path).ok()?, None).ok()?;
    Some(anatomy::capture(&clip).expect("a clip with limbs has a trunk"))
}

#[test]
fn the_result_does_not_depend_on_where_a_clip_starts() {
    let Some(folder) = captures() else { return };
    let on_robot = |capture: &Capture| {
        retarget(capture, &op3(), &op3_initial_rad(), &Default::default()).unwrap().positions_rad
    };
    for path in bvh_files(&folder) {
        let Some(whole) = read(&path) else { continue };
        let spinning = path.ends_with("cmu_1006_twirl.bvh");
        // Half a second in, the filter's end is forgotten.
        let settled = (whole.rate_hz / 2.0) as usize;
        if whole.poses.len() < settled + 20 || (whole.poses.len() > 400 && !spinning) {
            continue;
        }
        let mut later = whole.clone();
        later.poses.drain(..5);
        let (whole, later) = (on_robot(&whole), on_robot(&later));
        for (joint, (a, b)) in op3().joints.iter().zip(whole.iter().zip(&later)) {
            let pairs = a[settled + 5..].iter().zip(&b[settled..]);
            let off = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(off < 0.1, "{}: {} by {off:.3} rad", path.display(), joint.name);
        }
    }
}

/// Over all usable captures: how much slower OP3 must play them, how much its limits cut off.
#[test]
fn captures_suit_the_robot() {
    let Some(folder) = captures() else { return };
    let (mut seen, mut slow, mut clipped) = (0, 0, 0);
    println!("stretch: by the joint that needs most; clipped, at limit: the joint with most");
    println!("fit: mean error of arms, legs, head, degrees");
    println!(
        "{:44} {:>5} {:>20} {:>18} {:>18}  fit",
        "", "poses", "stretch", "clipped", "at limit"
    );
    for path in bvh_files(&folder) {
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let Some(capture) = read(&path) else {
            println!("{name:44} refused");
            continue;
        };
        let result = retarget(&capture, &op3(), &op3_initial_rad(), &Default::default()).unwrap();
        for (series, joint) in result.positions_rad.iter().zip(&op3().joints) {
            assert!(series.iter().all(|a| *a >= joint.lower_rad && *a <= joint.upper_rad));
        }
        let needed = result.positions_rad.iter().map(|series| stretch(series, result.rate_hz));
        let (needed, slowest) = most(&needed.map(|(v, a)| v.max(a)).collect::<Vec<_>>());
        let (cut, cut_joint) = most(&result.clipped_share);
        let (held, held_joint) = most(&result.at_limit_share);
        let fit = |parts: &[&str]| {
            let of = |segment: &Segment| parts.iter().any(|p| format!("{segment:?}").contains(p));
            let errors = result.fit_error_deg.iter().filter(|(segment, _)| of(segment));
            let errors: Vec<f64> = errors.map(|(_, error)| *error).collect();
            errors.iter().sum::<f64>() / errors.len() as f64
        };
        println!(
            "{name:44} {:5} {needed:6.2} {:13} {:3.0}% {:13} {:3.0}% {:13}  {:2.0} {:2.0} {:2.0}",
            capture.poses.len(),
            result.joints[slowest],
            cut * 100.0,
            result.joints[cut_joint],
            held * 100.0,
            result.joints[held_joint],
            fit(&["Arm", "arm"]),
            fit(&["Thigh", "Shank", "Foot"]),
            fit(&["Head"]),
        );
        seen += 1;
        slow += usize::from(!(needed <= 5.0));
        clipped += usize::from(!(cut <= 0.2));
    }
    println!("{seen} captures; stretch above 5: {slow}; a joint clipped above 20 %: {clipped}");
    assert!(seen > 0, "no usable capture under {}", folder.display());
    assert!(10 * slow <= seen, "{slow} of {seen} captures need a stretch above 5");
    assert!(10 * clipped <= seen, "{clipped} of {seen} captures are clipped above 20 %");
}

fn most(values: &[f64]) -> (f64, usize) {
    let at = (0..values.len()).max_by(|a, b| values[*a].total_cmp(&values[*b])).unwrap_or(0);
    (values[at], at)
}
