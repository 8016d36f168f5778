//! A motion as one HTML page that draws it, without any network: the body, the floor, what of the feet
//! carries, the centre of mass, and how hard the floor pushes. `page/body.js` draws.

use crate::body::contact::{self, Footing};
use crate::body::mass::{centre_of_mass_m, segment_masses};
use crate::body::root::SOLES;
use crate::body::{End, Joint, SegmentPose};
use crate::mocap::scene::Scene;
use glam::DVec3;
use std::fmt::Write;

/// Poses per second the page draws at most.
const MOST_HZ: f64 = 60.0;

/// The number of a joint's point, and of an end's: joints first.
const fn joint(joint: Joint) -> usize {
    joint.index()
}

const fn end(end: End) -> usize {
    Joint::ALL.len() + end as usize
}

/// Lines drawn, between points: of the middle, of the left side, of the right.
const LINES: [&[(usize, usize)]; 3] = [
    &[
        (joint(Joint::Pelvis), joint(Joint::Torso)),
        (joint(Joint::Torso), joint(Joint::Neck)),
        (joint(Joint::LeftShoulder), joint(Joint::RightShoulder)),
        (joint(Joint::LeftHip), joint(Joint::RightHip)),
        (joint(Joint::Torso), joint(Joint::LeftHip)),
        (joint(Joint::Torso), joint(Joint::RightHip)),
    ],
    &[
        (joint(Joint::LeftShoulder), joint(Joint::LeftElbow)),
        (joint(Joint::LeftElbow), joint(Joint::LeftWrist)),
        (joint(Joint::LeftWrist), end(End::LeftFingertip)),
        (joint(Joint::LeftHip), joint(Joint::LeftKnee)),
        (joint(Joint::LeftKnee), joint(Joint::LeftAnkle)),
        (joint(Joint::LeftAnkle), end(End::LeftHeel)),
        (end(End::LeftHeel), end(End::LeftToe)),
        (end(End::LeftToe), joint(Joint::LeftAnkle)),
    ],
    &[
        (joint(Joint::RightShoulder), joint(Joint::RightElbow)),
        (joint(Joint::RightElbow), joint(Joint::RightWrist)),
        (joint(Joint::RightWrist), end(End::RightFingertip)),
        (joint(Joint::RightHip), joint(Joint::RightKnee)),
        (joint(Joint::RightKnee), joint(Joint::RightAnkle)),
        (joint(Joint::RightAnkle), end(End::RightHeel)),
        (end(End::RightHeel), end(End::RightToe)),
        (end(End::RightToe), joint(Joint::RightAnkle)),
    ],
];

/// The page.
#[must_use]
pub fn page_of(scene: &Scene<'_>) -> String {
    // The title last: it may hold whatever a file is called.
    let title = scene.title.replace('&', "&amp;").replace('<', "&lt;");
    include_str!("page/body.html")
        .replace("{{SCRIPT}}", include_str!("page/body.js"))
        .replace("{{MOTION}}", &motion(scene))
        .replace("{{TITLE}}", &title)
}

/// What the page draws, as JSON: places in mm above the floor (X forward, Y left, Z up), forces in body
/// weights. Contacts are sums of 1 (left heel), 2 (left toe), 4 (right heel) and 8 (right toe).
fn motion(scene: &Scene<'_>) -> String {
    // Rates of captures are a little off what they are meant to be: a frame takes 0.008333 s.
    let every = (scene.rate_hz / MOST_HZ - 0.01).ceil().max(1.0) as usize;
    let masses = segment_masses(scene.body);
    let over_floor = |pose: &SegmentPose| {
        let root_m = pose.root_m - DVec3::Z * scene.floor_m;
        SegmentPose { root_m, ..pose.clone() }
    };
    let poses: Vec<SegmentPose> = scene.poses.iter().map(over_floor).collect();
    let mut points = String::new();
    let (mut centres, mut contacts, mut support) = (String::new(), String::new(), String::new());
    for pose in poses.iter().step_by(every) {
        let at = scene.body.positions(pose);
        for point_m in at.joints_m.iter().chain(&at.ends_m) {
            place(&mut points, *point_m);
        }
        place(&mut centres, centre_of_mass_m(scene.body, &masses, pose));
        if scene.has_feet {
            let on_floor = contact::on_floor(&SOLES.map(|end| at.end_m(end)));
            let sum: u8 =
                on_floor.iter().zip([1, 2, 4, 8]).map(|(on, bit)| u8::from(*on) * bit).sum();
            let _ = write!(contacts, "{sum},");
            let corners: Vec<String> = contact::support(scene.body, pose)
                .corners_m()
                .iter()
                .map(|corner_m| format!("{:.0},{:.0}", corner_m.x * 1e3, corner_m.y * 1e3))
                .collect();
            let _ = write!(support, "[{}],", corners.join(","));
        }
    }
    let forces = forces(scene, &poses, every);
    let lines: Vec<String> = LINES.iter().map(|lines| listed(lines)).collect();
    let room = scene.room();
    let mm = |height_m: f64| (height_m - scene.floor_m) * 1e3;
    format!(
        "{{\"rate_hz\":{},\"count\":{},\"lines\":[{}],\"head\":[{},{}],\"soles\":[{}],\"middle_mm\":{:.0},\"ball_mm\":{:.0},\
         \"contacts\":[{}],\"force_body_weights\":[{}],\"centre_mm\":[{}],\"support_mm\":[{}],\
         \"points_mm\":[{}]}}",
        scene.rate_hz / every as f64,
        Joint::ALL.len() + End::ALL.len(),
        lines.join(","),
        joint(Joint::Neck),
        end(End::HeadTop),
        SOLES.map(|sole| end(sole).to_string()).join(","),
        mm(room.middle_m()),
        room.ball_m() * 1e3,
        contacts.trim_end_matches(','),
        forces.join(","),
        centres.trim_end_matches(','),
        support.trim_end_matches(','),
        points.trim_end_matches(',')
    )
}

fn place(out: &mut String, place_m: DVec3) {
    let DVec3 { x, y, z } = place_m * 1e3;
    let _ = write!(out, "{x:.0},{y:.0},{z:.0},");
}

fn listed(lines: &[(usize, usize)]) -> String {
    let pairs: Vec<String> = lines.iter().map(|(from, to)| format!("[{from},{to}]")).collect();
    format!("[{}]", pairs.join(","))
}

/// How hard the floor pushes in every pose that is drawn; nothing where poses are too far apart to tell.
fn forces(scene: &Scene<'_>, poses: &[SegmentPose], every: usize) -> Vec<String> {
    let Ok(footing) = Footing::of(scene.body, poses, scene.rate_hz) else { return Vec::new() };
    let drawn = footing.force_body_weights().iter().step_by(every);
    drawn.map(|force| format!("{force:.3}")).collect()
}
