//! A motion as one HTML page that draws it, without any network.

use crate::body::{End, Joint, Proportions, SegmentPose};
use glam::DVec3;
use std::fmt::Write;

/// Poses per second the page draws at most.
const MOST_HZ: f64 = 60.0;

/// Lines drawn, between points: joints by their number, ends after the 15 joints.
const LINES: [(usize, usize); 22] = {
    const fn j(joint: Joint) -> usize {
        joint.index()
    }
    const fn e(end: End) -> usize {
        Joint::ALL.len() + end as usize
    }
    [
        (j(Joint::Pelvis), j(Joint::Torso)),
        (j(Joint::Torso), j(Joint::Neck)),
        (j(Joint::Neck), e(End::HeadTop)),
        (j(Joint::LeftShoulder), j(Joint::RightShoulder)),
        (j(Joint::LeftHip), j(Joint::RightHip)),
        (j(Joint::Torso), j(Joint::LeftHip)),
        (j(Joint::Torso), j(Joint::RightHip)),
        (j(Joint::LeftShoulder), j(Joint::LeftElbow)),
        (j(Joint::LeftElbow), j(Joint::LeftWrist)),
        (j(Joint::LeftWrist), e(End::LeftFingertip)),
        (j(Joint::RightShoulder), j(Joint::RightElbow)),
        (j(Joint::RightElbow), j(Joint::RightWrist)),
        (j(Joint::RightWrist), e(End::RightFingertip)),
        (j(Joint::LeftHip), j(Joint::LeftKnee)),
        (j(Joint::LeftKnee), j(Joint::LeftAnkle)),
        (j(Joint::LeftAnkle), e(End::LeftHeel)),
        (e(End::LeftHeel), e(End::LeftToe)),
        (j(Joint::RightHip), j(Joint::RightKnee)),
        (j(Joint::RightKnee), j(Joint::RightAnkle)),
        (j(Joint::RightAnkle), e(End::RightHeel)),
        (e(End::RightHeel), e(End::RightToe)),
        (e(End::LeftToe), j(Joint::LeftAnkle)),
    ]
};

/// The page: `poses` of a body with these proportions, at `rate_hz`. Points are written in mm, X
/// forward, Y left, Z up.
#[must_use]
pub fn page_of(title: &str, poses: &[SegmentPose], body: &Proportions, rate_hz: f64) -> String {
    let every = (rate_hz / MOST_HZ).ceil().max(1.0) as usize;
    let mut points = String::new();
    for pose in poses.iter().step_by(every) {
        let at = body.positions(pose);
        for point in at.joints_m.iter().chain(&at.ends_m) {
            let DVec3 { x, y, z } = *point * 1e3;
            let _ = write!(points, "{x:.0},{y:.0},{z:.0},");
        }
    }
    let lines: Vec<String> = LINES.iter().map(|(a, b)| format!("[{a},{b}]")).collect();
    let title = title.replace('&', "&amp;").replace('<', "&lt;");
    include_str!("page/body.html")
        .replace("{{TITLE}}", &title)
        .replace("{{RATE}}", &format!("{}", rate_hz / every as f64))
        .replace("{{COUNT}}", &(Joint::ALL.len() + End::ALL.len()).to_string())
        .replace("{{LINES}}", &lines.join(","))
        .replace("{{POINTS}}", points.trim_end_matches(','))
}
