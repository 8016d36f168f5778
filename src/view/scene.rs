//! What a page draws, as data. Lengths in m, angles in rad, times in s; Z up, the floor at z = 0.

use super::ViewPage;
use super::person::PersonTrack;
use super::robot::RobotTrack;
use super::tracks::{JointTracks, MarkerTracks, PlateTracks, ViewSpan};
use crate::error::Error;
use crate::mocap::scene::{DrawnFeet, Scene};
use serde::Serialize;

/// What is drawn, over one time.
#[derive(Clone, Debug, Default, Serialize)]
pub struct ViewScene {
    /// From 0 to here, s.
    pub duration_s: f64,
    /// Joints come while it is looked at: see [`super::live`].
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub is_live: bool,
    /// What comes is a session that somebody leads: see [`super::session`].
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub is_session: bool,
    /// Key frames of the robot can be made: each joint says where it is at first.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub can_edit: bool,
    /// A robot.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub robot: Option<RobotTrack>,
    /// What its joints were asked and did.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub joints: Option<JointTracks>,
    /// A person: alone, or beside the robot that does the same.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub person: Option<PersonTrack>,
    /// Another in the same room.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub other: Option<PersonTrack>,
    /// Names of the angles that come of the person, in order.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub angles: Vec<&'static str>,
    /// How sensors are heard comes while it is looked at.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub hears: bool,
    /// Points.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub markers: Option<MarkerTracks>,
    /// Force plates.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plates: Option<PlateTracks>,
    /// What took how long.
    pub spans: Vec<ViewSpan>,
}

/// A page with nothing but a person on it.
///
/// # Errors
/// As [`ViewPage::html`].
pub fn page_of(scene: &Scene<'_>) -> Result<String, Error> {
    let mut notes = Vec::new();
    if scene.feet == DrawnFeet::DrawnOn {
        notes.push("feet were not captured: what carries is not told".to_owned());
    }
    let drawn = ViewScene {
        duration_s: scene.poses.len().saturating_sub(1) as f64 / scene.rate_hz,
        person: Some(PersonTrack::of(scene)),
        ..ViewScene::default()
    };
    let title = scene.title.to_owned();
    ViewPage { title, notes, scene: drawn, ..ViewPage::default() }.html()
}
