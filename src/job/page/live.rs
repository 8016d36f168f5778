//! The page of a robot while it moves.

use super::{drawable, finite, look};
use crate::body::{Dof, Proportions};
use crate::error::Error;
use crate::robot::Robot;
use crate::view::robot::still;
use crate::view::scene::ViewScene;
use crate::view::series::Coded;
use crate::view::session::person;
use crate::view::tracks::{JointTrack, JointTracks, SampleClock};
use crate::view::{ANGLE_RAD, ViewPage};

/// Somebody whom nobody measured is drawn as tall as this, and the camera is as far away as they need, m.
pub(in crate::job) const DRAWN_FOR_M: f64 = 1.75;
/// Poses of somebody per second that whoever looks on is told, at most.
pub(in crate::job) const TOLD_HZ: f64 = 25.0;

/// A page of a session, to which what is to be done comes, how sensors are heard, and what whoever wears them does.
///
/// # Errors
/// None that the person it is drawn for could have.
pub fn session_page(folder: &str) -> Result<ViewPage, Error> {
    // Who wears the sensors is not known yet; places come as they are.
    let somebody = person(&Proportions::of_stature(DRAWN_FOR_M)?);
    let other = Some(somebody.clone());
    let scene = ViewScene {
        is_live: true,
        is_session: true,
        hears: true,
        person: Some(somebody),
        other,
        ..ViewScene::default()
    };
    let title = format!("Session {folder}");
    Ok(ViewPage { title, scene, ..ViewPage::default() })
}

/// What a page shows besides a robot's joints.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Shows {
    /// How sensors are heard.
    pub sensors: bool,
    /// Whoever wears them.
    pub person: bool,
}

/// A page to which what happens comes while it is looked at: of a robot, by name or path of its file, and of whoever
/// wears sensors.
///
/// # Errors
/// A robot that is not known, or a body no tree can be made of.
pub fn page(robot: Option<&str>, what: &str, shows: Shows) -> Result<ViewPage, Error> {
    let robot = robot.map(Robot::load).transpose()?;
    let mut scene = match &robot {
        Some(robot) => scene(robot, 0)?,
        None => ViewScene::default(),
    };
    (scene.is_live, scene.hears) = (true, shows.sensors);
    if shows.person {
        scene.person = Some(person(&Proportions::of_stature(DRAWN_FOR_M)?));
        scene.angles = Dof::ALL.map(Dof::name).to_vec();
    }
    let title = robot.map_or_else(|| what.to_owned(), |robot| format!("{}: {what}", robot.name));
    Ok(ViewPage { title, notes: notes(&scene), scene, ..ViewPage::default() })
}

/// A page of this robot, by name or path of its file, on which key frames are made.
///
/// # Errors
/// As [`page`].
pub fn editor(robot: &str) -> Result<ViewPage, Error> {
    let robot = Robot::load(robot)?;
    let mut scene = scene(&robot, 1)?;
    // Nothing is measured.
    scene.joints.iter_mut().flat_map(|of| &mut of.joints).for_each(|joint| joint.present = None);
    let title = format!("{}: key frames", robot.name);
    Ok(ViewPage { title, notes: notes(&scene), scene, ..ViewPage::default() })
}

fn notes(scene: &ViewScene) -> Vec<String> {
    let note = "where the robot is in the room is not known: it is drawn upright, its lowest sole on the floor";
    scene.robot.iter().map(|_| note.to_owned()).collect()
}

/// A robot of which key frames can be made, with so many samples of where it is at first.
fn scene(robot: &Robot, count: usize) -> Result<ViewScene, Error> {
    let body = drawable(robot)?;
    let start_rad: Vec<f64> = robot.joints.iter().map(|joint| joint.initial_rad).collect();
    let joints = robot.joints.iter().map(|joint| {
        let samples = || Some(Coded::of(std::iter::repeat_n(joint.initial_rad, count), ANGLE_RAD));
        JointTrack {
            name: joint.name.clone(),
            goal: samples(),
            present: samples(),
            initial_rad: Some(joint.initial_rad),
            range_rad: Some([joint.limits.lower_rad(), joint.limits.upper_rad()]),
            velocity_limit_rad_s: finite(joint.limits.velocity_rad_s()),
            acceleration_limit_rad_s2: finite(joint.limits.acceleration_rad_s2()),
            ..JointTrack::default()
        }
    });
    let clock = SampleClock::Even { rate_hz: robot.file.rate_hz, count };
    Ok(ViewScene {
        can_edit: true,
        robot: body.as_ref().map(|body| look::drawn(robot, body, &still(body, &start_rad))),
        joints: Some(JointTracks { clock, joints: joints.collect() }),
        ..ViewScene::default()
    })
}
