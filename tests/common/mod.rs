//! What several capture tests share: the robot, the capture folder, small kinematics.

#![allow(dead_code, reason = "each test file uses a part")]

#[path = "../captured/mod.rs"]
pub mod captured;

pub mod puppet;

#[allow(unused_imports, reason = "each test file uses a part")]
pub use captured::{bvh_files, capture_file, captures};

use gaitway::body::Segment;
use gaitway::mocap::retarget::{ModelJoint, RobotModel, SegmentLink};
use glam::DVec3;
use std::f64::consts::PI;

/// Servo speed and acceleration of ROBOTIS OP3 as used for the stretch factor.
pub const OP3_VELOCITY_RAD_S: f64 = 4.796;
/// See [`OP3_VELOCITY_RAD_S`].
pub const OP3_ACCELERATION_RAD_S2: f64 = 23.98;

/// ROBOTIS OP3: joints, origins, axes and limits from `op3_kinematics_dynamics.cpp` in
/// ROBOTIS-GIT/ROBOTIS-OP3, `parent` 0 being the pelvis.
pub fn op3() -> RobotModel {
    #[rustfmt::skip]
    type Row = (&'static str, usize, [f64; 3], [f64; 3], f64, f64);
    let table: [Row; 20] = [
        ("r_sho_pitch", 0, [-0.001, -0.06, 0.111], [0.0, -1.0, 0.0], -0.5, 0.5),
        ("l_sho_pitch", 0, [-0.001, 0.06, 0.111], [0.0, 1.0, 0.0], -0.5, 0.5),
        ("r_sho_roll", 1, [0.019, -0.0285, -0.01], [-1.0, 0.0, 0.0], -0.5, 0.3),
        ("l_sho_roll", 2, [0.019, 0.0285, -0.01], [-1.0, 0.0, 0.0], -0.3, 0.5),
        ("r_el", 3, [0.0, -0.0904, -0.0001], [1.0, 0.0, 0.0], -0.5, 0.5),
        ("l_el", 4, [0.0, 0.0904, -0.0001], [1.0, 0.0, 0.0], -0.5, 0.5),
        ("r_hip_yaw", 0, [0.0, -0.035, 0.0], [0.0, 0.0, -1.0], -0.45, 0.45),
        ("l_hip_yaw", 0, [0.0, 0.035, 0.0], [0.0, 0.0, -1.0], -0.45, 0.45),
        ("r_hip_roll", 7, [-0.024, 0.0, -0.0285], [-1.0, 0.0, 0.0], -0.3, 0.3),
        ("l_hip_roll", 8, [-0.024, 0.0, -0.0285], [-1.0, 0.0, 0.0], -0.3, 0.3),
        ("r_hip_pitch", 9, [0.0241, -0.019, 0.0], [0.0, -1.0, 0.0], -0.4, 0.4),
        ("l_hip_pitch", 10, [0.0241, 0.019, 0.0], [0.0, 1.0, 0.0], -0.4, 0.4),
        ("r_knee", 11, [0.0001, 0.0, -0.11015], [0.0, -1.0, 0.0], -0.7, 0.1),
        ("l_knee", 12, [0.0001, 0.0, -0.11015], [0.0, 1.0, 0.0], -0.1, 0.7),
        ("r_ank_pitch", 13, [0.0, 0.0, -0.11], [0.0, 1.0, 0.0], -0.45, 0.45),
        ("l_ank_pitch", 14, [0.0, 0.0, -0.11], [0.0, -1.0, 0.0], -0.45, 0.45),
        ("r_ank_roll", 15, [-0.0241, 0.019, 0.0], [1.0, 0.0, 0.0], -0.45, 0.45),
        ("l_ank_roll", 16, [-0.0241, -0.019, 0.0], [1.0, 0.0, 0.0], -0.45, 0.45),
        ("head_pan", 0, [-0.001, 0.0, 0.1365], [0.0, 0.0, 1.0], -0.5, 0.5),
        ("head_tilt", 19, [0.01, 0.019, 0.0285], [0.0, -1.0, 0.0], -0.5, 0.5),
    ];
    let joints: Vec<ModelJoint> = table
        .iter()
        .map(|(name, parent, origin, axis, lower, upper)| ModelJoint {
            name: (*name).to_owned(),
            parent: parent.checked_sub(1),
            origin_m: DVec3::from_array(*origin),
            axis: DVec3::from_array(*axis),
            lower_rad: lower * PI,
            upper_rad: upper * PI,
        })
        .collect();
    let mut n_pose_rad = vec![0.0; 20];
    (n_pose_rad[2], n_pose_rad[3]) = (-PI / 2.0, PI / 2.0);
    let link = |segment, joint, direction_weight, twist_weight| SegmentLink {
        segment,
        joint,
        direction_weight,
        twist_weight,
    };
    let links = vec![
        link(Segment::Head, 19, 1.0, 1.0),
        link(Segment::RightUpperArm, 2, 1.0, 0.0),
        link(Segment::LeftUpperArm, 3, 1.0, 0.0),
        link(Segment::RightForearm, 4, 1.0, 0.0),
        link(Segment::LeftForearm, 5, 1.0, 0.0),
        link(Segment::RightThigh, 10, 1.0, 0.3),
        link(Segment::LeftThigh, 11, 1.0, 0.3),
        link(Segment::RightShank, 12, 1.0, 0.1),
        link(Segment::LeftShank, 13, 1.0, 0.1),
        link(Segment::RightFoot, 16, 0.5, 0.3),
        link(Segment::LeftFoot, 17, 0.5, 0.3),
    ];
    RobotModel {
        joints,
        base: vec![Segment::Pelvis, Segment::Torso],
        n_pose_rad,
        links,
        hands: Vec::new(),
    }
}

/// Index of a joint of [`op3`].
pub fn op3_joint(name: &str) -> usize {
    op3().joints.iter().position(|joint| joint.name == name).expect("a joint of OP3")
}

/// Starting pose of OP3, rad (`ini_pose.yaml` of the same repository).
pub fn op3_initial_rad() -> Vec<f64> {
    let degrees = [
        15.0, -15.0, -45.0, 45.0, 45.0, -45.0, 0.0, 0.0, 0.0, 0.0, 70.0, -70.0, -142.0, 142.0,
        -70.0, 70.0, 0.0, 0.0, 0.0, -10.0,
    ];
    degrees.iter().map(|angle: &f64| angle.to_radians()).collect()
}

/// How much slower a motion must be played: the larger of peak speed over the servo's and the root
/// of peak acceleration over the servo's, by central differences.
pub fn stretch(positions: &[f64], rate_hz: f64) -> (f64, f64) {
    let (mut speed, mut acceleration) = (0.0_f64, 0.0_f64);
    for three in positions.windows(3) {
        speed = speed.max((three[2] - three[0]).abs() * rate_hz / 2.0);
        acceleration =
            acceleration.max((three[2] - 2.0 * three[1] + three[0]).abs() * rate_hz * rate_hz);
    }
    (speed / OP3_VELOCITY_RAD_S, (acceleration / OP3_ACCELERATION_RAD_S2).sqrt())
}
