//! The page of a robot while it moves.

use super::{drawable, finite};
use crate::body::Proportions;
use crate::error::Error;
use crate::robot::Robot;
use crate::view::ViewPage;
use crate::view::robot::{RobotTrack, still};
use crate::view::scene::ViewScene;
use crate::view::series::Coded;
use crate::view::session::person;
use crate::view::tracks::{JointTrack, JointTracks, SampleClock};

/// The camera of a session is as far away as somebody of this stature needs, m.
const DRAWN_FOR_M: f64 = 1.75;

/// A page of a session, to which what is to be done comes, how sensors are heard, and what whoever wears them does.
///
/// # Errors
/// None that the person it is drawn for could have.
pub fn session_page(folder: &str) -> Result<ViewPage, Error> {
    // Who wears the sensors is not known yet; places come as they are.
    let somebody = person(&Proportions::of_stature(DRAWN_FOR_M)?);
    let (is_live, is_session) = (true, true);
    let scene = ViewScene { is_live, is_session, person: Some(somebody), ..ViewScene::default() };
    let title = format!("Session {folder}");
    Ok(ViewPage { title, scene, ..ViewPage::default() })
}

/// A page of this robot, by name or path of its file, to which its joints come while it is looked at.
///
/// # Errors
/// A robot that is not known, or a body no tree can be made of.
pub fn page(robot: &str, what: &str) -> Result<ViewPage, Error> {
    let robot = Robot::load(robot)?;
    let body = drawable(&robot)?;
    let start_rad: Vec<f64> = robot.joints.iter().map(|joint| joint.initial_rad).collect();
    let joints = robot.joints.iter().map(|joint| JointTrack {
        name: joint.name.clone(),
        goal: Some(Coded::default()),
        present: Some(Coded::default()),
        range_rad: Some([joint.limits.lower_rad(), joint.limits.upper_rad()]),
        velocity_limit_rad_s: finite(joint.limits.velocity_rad_s()),
        acceleration_limit_rad_s2: finite(joint.limits.acceleration_rad_s2()),
        ..JointTrack::default()
    });
    let clock = SampleClock::Even { rate_hz: robot.file.rate_hz, count: 0 };
    let scene = ViewScene {
        is_live: true,
        robot: body
            .as_ref()
            .map(|body| RobotTrack::of(&robot.name, body, &still(body, &start_rad))),
        joints: Some(JointTracks { clock, joints: joints.collect() }),
        ..ViewScene::default()
    };
    let mut notes = Vec::new();
    if scene.robot.is_some() {
        notes.push(
            "where the robot is in the room is not known: it is drawn upright, its lowest sole on the floor"
                .to_owned(),
        );
    }
    let title = format!("{}: {what}", robot.name);
    Ok(ViewPage { title, notes, scene, ..ViewPage::default() })
}
