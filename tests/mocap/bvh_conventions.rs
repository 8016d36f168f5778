//! One motion written in several conventions: what reaches the robot must not depend on them.

use crate::common;
use crate::common::puppet::{self, Convention};
use crate::common::{op3, op3_initial_rad};
use gaitway::body::Segment;
use gaitway::mocap::anatomy::{self, Capture};
use gaitway::mocap::bvh::{Axis, Bvh};
use gaitway::mocap::clip::Clip;
use gaitway::mocap::mapping::MappingFile;
use gaitway::mocap::retarget::{Retargeted, retarget};
use glam::{DQuat, DVec3, EulerRot};
use std::f64::consts::FRAC_PI_2;

fn mixamo(segment: Segment) -> &'static str {
    match segment {
        Segment::Pelvis => "mixamorig:Hips",
        Segment::Torso => "mixamorig:Spine2",
        Segment::Head => "mixamorig:Head",
        Segment::LeftUpperArm => "mixamorig:LeftArm",
        Segment::LeftForearm => "mixamorig:LeftForeArm",
        Segment::RightUpperArm => "mixamorig:RightArm",
        Segment::RightForearm => "mixamorig:RightForeArm",
        Segment::LeftThigh => "mixamorig:LeftUpLeg",
        Segment::LeftShank => "mixamorig:LeftLeg",
        Segment::LeftFoot => "mixamorig:LeftFoot",
        Segment::RightThigh => "mixamorig:RightUpLeg",
        Segment::RightShank => "mixamorig:RightLeg",
        Segment::RightFoot => "mixamorig:RightFoot",
    }
}

fn unreal(segment: Segment) -> &'static str {
    match segment {
        Segment::Pelvis => "pelvis",
        Segment::Torso => "spine_03",
        Segment::Head => "head",
        Segment::LeftUpperArm => "upperarm_l",
        Segment::LeftForearm => "lowerarm_l",
        Segment::RightUpperArm => "upperarm_r",
        Segment::RightForearm => "lowerarm_r",
        Segment::LeftThigh => "thigh_l",
        Segment::LeftShank => "calf_l",
        Segment::LeftFoot => "foot_l",
        Segment::RightThigh => "thigh_r",
        Segment::RightShank => "calf_r",
        Segment::RightFoot => "foot_r",
    }
}

fn nameless(segment: Segment) -> &'static str {
    const NAMES: [&str; 13] =
        ["j0", "j1", "j2", "j3", "j4", "j5", "j6", "j7", "j8", "j9", "j10", "j11", "j12"];
    NAMES[segment.index()]
}

/// World (Z up, X forward) to Y up, Z forward.
fn y_up() -> DQuat {
    DQuat::from_rotation_y(-FRAC_PI_2) * DQuat::from_rotation_x(-FRAC_PI_2)
}

fn y_up_cm_zxy_t_pose() -> Convention {
    Convention {
        to_file: y_up(),
        units_per_m: 100.0,
        order: ([Axis::Z, Axis::X, Axis::Y], EulerRot::ZXY),
        bone: puppet::drawn_as_t,
        name: mixamo,
    }
}

fn z_up_inch_xyz_n_pose() -> Convention {
    Convention {
        to_file: DQuat::from_rotation_z(2.0),
        units_per_m: 1.0 / 0.0254,
        order: ([Axis::X, Axis::Y, Axis::Z], EulerRot::XYZ),
        bone: puppet::drawn_as_n,
        name: unreal,
    }
}

fn y_up_metre_yzx_along_x() -> Convention {
    Convention {
        to_file: DQuat::from_rotation_y(1.0) * y_up(),
        units_per_m: 1.0,
        order: ([Axis::Y, Axis::Z, Axis::X], EulerRot::YZX),
        bone: puppet::drawn_along_x,
        name: mixamo,
    }
}

fn conventions() -> [(&'static str, Convention); 5] {
    [
        ("Y up, cm, ZXY, T pose", y_up_cm_zxy_t_pose()),
        ("Z up, inch, XYZ, N pose", z_up_inch_xyz_n_pose()),
        ("Y up, m, YZX, bones along X", y_up_metre_yzx_along_x()),
        ("CMU unit", Convention { units_per_m: 0.45 / 0.0254, ..y_up_cm_zxy_t_pose() }),
        ("no names", Convention { name: nameless, ..z_up_inch_xyz_n_pose() }),
    ]
}

fn read(bvh: Bvh) -> Capture {
    // Through the text, as a user's file comes.
    let text = gaitway::mocap::bvh::write(&bvh);
    let bvh = gaitway::mocap::bvh::parse(text.as_bytes()).unwrap();
    anatomy::capture(&Clip::new(bvh, None).unwrap()).unwrap()
}

fn on_op3(capture: &Capture) -> Retargeted {
    retarget(capture, &op3(), &op3_initial_rad(), &Default::default()).unwrap()
}

#[test]
fn segments_come_back_as_they_were_in_every_convention() {
    let (poses, rate_hz) = puppet::exercise();
    for (name, convention) in conventions() {
        let capture = read(puppet::write(&poses, rate_hz, &convention));
        assert_eq!(capture.tracked, [true; 13], "{name}");
        assert!((capture.stature_m - 1.75).abs() < 0.01, "{name}: {}", capture.stature_m);
        for segment in Segment::ALL {
            let worst = capture.poses.iter().zip(&poses).map(|(found, true_pose)| {
                let at = segment.index();
                found.orientation[at].angle_between(true_pose.orientation[at]).to_degrees()
            });
            let worst = worst.fold(0.0, f64::max);
            assert!(worst < 2.0, "{name}: {segment:?} is off by {worst:.2} deg");
        }
        for (found, true_pose) in capture.poses.iter().zip(&poses) {
            assert!((found.root_m - true_pose.root_m).length() < 0.01, "{name}");
        }
    }
}

#[test]
fn the_robot_moves_alike_whatever_the_convention() {
    let (poses, rate_hz) = puppet::exercise();
    let expected = on_op3(&puppet::truth(poses.clone(), rate_hz));
    for (name, convention) in conventions() {
        let found = on_op3(&read(puppet::write(&poses, rate_hz, &convention)));
        for (joint, (a, b)) in found.positions_rad.iter().zip(&expected.positions_rad).enumerate() {
            let worst =
                a.iter().zip(b).map(|(a, b)| (a - b).abs().to_degrees()).fold(0.0, f64::max);
            assert!(worst < 2.0, "{name}: {} is off by {worst:.2} deg", found.joints[joint]);
        }
    }
}

#[test]
fn a_rest_pose_before_the_motion_is_dropped_and_said() {
    let (poses, rate_hz) = puppet::exercise();
    let convention = y_up_metre_yzx_along_x();
    let moving = &poses[100..];
    let mut with_rest = moving.to_vec();
    with_rest.insert(0, poses[0].clone());
    let plain = read(puppet::write(moving, rate_hz, &convention));
    let found = read(puppet::write(&with_rest, rate_hz, &convention));
    assert_eq!(found.poses.len(), plain.poses.len());
    assert!(found.notes.iter().any(|note| note.contains("1 rest pose")), "{:?}", found.notes);
    // Without it, and without a rest pose drawn by the OFFSETs, nothing is dropped.
    assert!(!plain.notes.iter().any(|note| note.contains("dropped")), "{:?}", plain.notes);
}

#[test]
fn world_coordinates_in_position_channels_below_the_root_are_ignored() {
    let (poses, rate_hz) = puppet::exercise();
    let walking: Vec<_> = poses
        .iter()
        .enumerate()
        .map(|(at, pose)| {
            let mut pose = pose.clone();
            pose.root_m.x += 0.02 * at as f64;
            pose
        })
        .collect();
    let plain = puppet::write(&walking, rate_hz, &z_up_inch_xyz_n_pose());
    let torso = plain.joints.iter().position(|joint| joint.name == "spine_03").unwrap();
    let place = |pose: usize| {
        let skeleton = gaitway::mocap::skeleton::Skeleton::new(&plain);
        let mut placed = Default::default();
        skeleton.place(plain.pose(pose), &mut placed);
        placed.position[torso]
    };
    let offset = plain.joints[torso].offset;
    type Meaning<'a> = (&'a str, Box<dyn Fn(usize) -> DVec3 + 'a>);
    let meanings: [Meaning<'_>; 3] = [
        ("world", Box::new(place)),
        ("repeated", Box::new(move |_| offset)),
        ("added", Box::new(|_| DVec3::ZERO)),
    ];
    let expected = read(plain.clone());
    for (name, meaning) in meanings {
        let found = read(with_positions(&plain, torso, meaning));
        let far = found.poses.iter().zip(&expected.poses).map(|(a, b)| {
            (0..13).map(|at| a.orientation[at].angle_between(b.orientation[at])).fold(0.0, f64::max)
        });
        let far = far.fold(0.0, f64::max);
        assert!(far < 1e-3, "{name}: off by {far} rad");
        let said = found.notes.iter().any(|note| note.contains("world coordinates"));
        assert_eq!(said, name == "world", "{name}: {:?}", found.notes);
    }
}

/// The same file with position channels on one more joint.
fn with_positions(bvh: &Bvh, joint: usize, position: impl Fn(usize) -> DVec3) -> Bvh {
    use gaitway::mocap::bvh::Channel;
    let mut joints = bvh.joints.clone();
    let at = joints[joint].first_channel;
    let channels = [Axis::X, Axis::Y, Axis::Z].map(Channel::Position);
    joints[joint].channels.splice(0..0, channels);
    for later in &mut joints[joint + 1..] {
        later.first_channel += 3;
    }
    let values = (0..bvh.pose_count()).flat_map(|pose| {
        let mut values = bvh.pose(pose).to_vec();
        values.splice(at..at, position(pose).to_array());
        values
    });
    Bvh { joints, time_step_s: bvh.time_step_s, values: values.collect() }
}

/// The pelvis hangs below a root that stays at the origin, and is drawn metres away from it.
fn pelvis_drawn_far_away(plain: &Bvh) -> Bvh {
    let mut carried = plain.clone();
    for joint in &mut carried.joints {
        joint.parent = Some(joint.parent.map_or(0, |parent| parent + 1));
    }
    carried.joints.insert(
        0,
        gaitway::mocap::bvh::Joint {
            name: "root".to_owned(),
            parent: None,
            offset: DVec3::ZERO,
            channels: Vec::new(),
            first_channel: 0,
            ends: Vec::new(),
        },
    );
    carried.joints[1].offset = DVec3::new(3.0, 95.0, -452.0);
    carried
}

#[test]
fn a_pelvis_carried_below_a_fixed_root_moves() {
    let (poses, rate_hz) = puppet::exercise();
    let step_m = DVec3::new(0.02, 0.0, 0.0);
    for (name, start_m, step_m) in [
        ("walks high up", DVec3::Z, step_m),
        // Less far from the origin than a quarter of what its OFFSET says.
        ("stays in place", DVec3::ZERO, DVec3::ZERO),
    ] {
        let mut poses = poses.clone();
        for (at, pose) in poses.iter_mut().enumerate() {
            pose.root_m += start_m + step_m * at as f64;
        }
        let plain = puppet::write(&poses, rate_hz, &y_up_cm_zxy_t_pose());
        let (found, expected) = (read(pelvis_drawn_far_away(&plain)), read(plain));
        for (a, b) in found.poses.iter().zip(&expected.poses) {
            assert!((a.root_m - b.root_m).length() < 1e-6, "{name}: {} not {}", a.root_m, b.root_m);
        }
    }
}

#[test]
fn a_mapping_file_overrules_and_is_checked() {
    let (poses, rate_hz) = puppet::exercise();
    let bvh = puppet::write(&poses, rate_hz, &y_up_cm_zxy_t_pose());
    let try_file = |text: &str| Clip::new(bvh.clone(), Some(&MappingFile::parse(text).unwrap()));
    let clip = try_file("[segments]\nhead = \"mixamorig:Spine2\"\n").unwrap();
    let head = clip.mapping().part(Segment::Head).unwrap().joint;
    assert_eq!(bvh.joints[head].name, "mixamorig:Spine2");
    let error = try_file("[segments]\nhead = \"Kopf\"\n").unwrap_err().to_string();
    assert!(error.contains("Kopf") && error.contains("mixamorig:LeftForeArm"), "{error}");
    let error = try_file("[segments]\nelbow = \"Kopf\"\n").unwrap_err().to_string();
    assert!(error.contains("elbow") && error.contains("left_upper_arm"), "{error}");
    let wrong = "[segments]\nleft_shank = \"mixamorig:RightLeg\"\n";
    let error = try_file(wrong).unwrap_err().to_string();
    assert!(error.contains("does not hang below"), "{error}");
    assert!(MappingFile::parse("[joints]\n").is_err());
}

#[test]
fn a_mirrored_file_is_noticed_by_its_toes() {
    let (poses, rate_hz) = puppet::exercise();
    let mut bvh = puppet::write(&poses, rate_hz, &y_up_cm_zxy_t_pose());
    for joint in &mut bvh.joints {
        joint.name = match joint.name.contains("Left") {
            true => joint.name.replace("Left", "Right"),
            false => joint.name.replace("Right", "Left"),
        };
    }
    let found = read(bvh);
    assert!(found.notes.iter().any(|note| note.contains("mirrored")), "{:?}", found.notes);
    let expected = on_op3(&puppet::truth(poses, rate_hz));
    let knee = common::op3_joint("l_knee");
    for (a, b) in on_op3(&found).positions_rad[knee].iter().zip(&expected.positions_rad[knee]) {
        assert!((a - b).abs() < 0.04);
    }
}

#[test]
fn what_is_no_person_is_refused_with_the_cause() {
    let chain = "HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\nCHANNELS 3 Xrotation Yrotation Zrotation
        JOINT b\n{\nOFFSET 0 1 0\nCHANNELS 3 Xrotation Yrotation Zrotation\n}\n}
        MOTION\nFrames: 2\nFrame Time: 0.1\n0 0 0 0 0 0\n0 0 0 0 0 0\n";
    let bvh = gaitway::mocap::bvh::parse(chain.as_bytes()).unwrap();
    let error = Clip::new(bvh, None).unwrap_err().to_string();
    assert!(error.contains("no legs and no arms") && error.contains("joints a, b"), "{error}");
    let (poses, rate_hz) = puppet::exercise();
    let still = puppet::write(&poses[..1], rate_hz, &y_up_cm_zxy_t_pose());
    let error = Clip::new(still, None).unwrap_err().to_string();
    assert!(error.contains("no motion") && error.contains("at least 2 poses"), "{error}");
}

#[test]
fn a_robot_without_arms_takes_a_person_without_arms_and_others_do_not() {
    let (poses, rate_hz) = puppet::exercise();
    let mut bvh = puppet::write(&poses, rate_hz, &y_up_cm_zxy_t_pose());
    for joint in &mut bvh.joints {
        if joint.name.contains("Arm") {
            joint.name = "Prop".to_owned();
            joint.offset = DVec3::new(1.0, 1.0, 0.0);
            joint.ends.clear();
        }
    }
    let capture = read(bvh);
    assert!(!capture.tracked[Segment::LeftUpperArm.index()], "{:?}", capture.notes);
    let error = retarget(&capture, &op3(), &op3_initial_rad(), &Default::default()).unwrap_err();
    assert!(error.to_string().contains("right_upper_arm"), "{error}");
    let mut legs_only = op3();
    legs_only.links.retain(|link| !format!("{:?}", link.segment).contains("arm"));
    legs_only.links.retain(|link| !format!("{:?}", link.segment).contains("Arm"));
    let initial = op3_initial_rad();
    let result = retarget(&capture, &legs_only, &initial, &Default::default()).unwrap();
    let elbow = common::op3_joint("r_el");
    assert!(result.positions_rad[elbow].iter().all(|angle| *angle == initial[elbow]));
}

proptest::proptest! {
    #![proptest_config(proptest::prelude::ProptestConfig {
        cases: 40,
        failure_persistence: None,
        ..Default::default()
    })]

    /// Numbers no person makes: whatever is found must be finite, and nothing may panic.
    #[test]
    fn wild_numbers_give_finite_angles_or_an_error(
        seed in proptest::prelude::any::<u64>(),
        exponent in -9i32..=8,
        poses in 2usize..12,
        flat in proptest::prelude::any::<bool>(),
    ) {
        let (moving, rate_hz) = puppet::exercise();
        let mut bvh = puppet::write(&moving[..poses], rate_hz, &y_up_cm_zxy_t_pose());
        let mut state = seed;
        let mut wild = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            ((state >> 33) as f64 / f64::from(1u32 << 30) - 1.0) * 10f64.powi(exponent)
        };
        for joint in &mut bvh.joints {
            joint.offset = if flat { DVec3::ZERO } else { DVec3::new(wild(), wild(), wild()) };
        }
        bvh.values.iter_mut().for_each(|value| *value = wild());
        if let Ok(capture) = Clip::new(bvh, None).and_then(|clip| anatomy::capture(&clip)) {
            for pose in &capture.poses {
                proptest::prop_assert!(pose.root_m.is_finite());
                let mut turned = pose.orientation.iter();
                proptest::prop_assert!(turned.all(|turned| turned.is_normalized()));
            }
            let result = retarget(&capture, &op3(), &op3_initial_rad(), &Default::default());
            if let Ok(result) = result {
                let all = result.positions_rad.iter().flatten();
                proptest::prop_assert!(all.copied().all(f64::is_finite));
            }
        }
    }
}
