//! Tables without titles of a humanoid in motion, as Unitree published LAFAN1 on its robots (`LAFAN1_Retargeting_Dataset`):
//! where the base is, how it is turned, and its joints.

/// Columns before the joints: x y z, qx qy qz qw.
pub const BASE_COLUMNS: usize = 7;
/// Rows a second.
pub const RATE_HZ: f64 = 30.0;

/// The joints of a G1 of 29, in the order of that data set's columns; `_joint` follows in its models.
const UNITREE: [&str; 29] = [
    "left_hip_pitch",
    "left_hip_roll",
    "left_hip_yaw",
    "left_knee",
    "left_ankle_pitch",
    "left_ankle_roll",
    "right_hip_pitch",
    "right_hip_roll",
    "right_hip_yaw",
    "right_knee",
    "right_ankle_pitch",
    "right_ankle_roll",
    "waist_yaw",
    "waist_roll",
    "waist_pitch",
    "left_shoulder_pitch",
    "left_shoulder_roll",
    "left_shoulder_yaw",
    "left_elbow",
    "left_wrist_roll",
    "left_wrist_pitch",
    "left_wrist_yaw",
    "right_shoulder_pitch",
    "right_shoulder_roll",
    "right_shoulder_yaw",
    "right_elbow",
    "right_wrist_roll",
    "right_wrist_pitch",
    "right_wrist_yaw",
];

/// Of the joints of a robot's file those that are all of these, in this order and by their own names. None of another
/// robot.
#[must_use]
pub fn unitree_order(names: &[String]) -> Option<Vec<String>> {
    let own = |wanted: &&str| {
        names.iter().find(|name| name.strip_suffix("_joint").unwrap_or(name.as_str()) == *wanted)
    };
    UNITREE.iter().map(|wanted| own(wanted).cloned()).collect()
}

/// The first of those joints that a robot has not.
#[must_use]
pub fn first_missing(names: &[String]) -> Option<&'static str> {
    UNITREE.into_iter().find(|wanted| {
        !names.iter().any(|name| name.strip_suffix("_joint").unwrap_or(name.as_str()) == *wanted)
    })
}
