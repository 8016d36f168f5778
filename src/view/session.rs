//! What a page tells of a recording session while it is led. Lengths in m, times in s.

use super::person::{DrawnSensor, PersonTrack};
use super::tracks::SampleClock;
use crate::body::{Proportions, Segment, SegmentPose, segment_name};
use crate::mocap::scene::{DrawnFeet, Scene};
use glam::{DQuat, DVec3};
use serde::Serialize;

/// What is told at one time.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct SessionFrame {
    /// Since the page was opened, s.
    pub time_s: f64,
    /// What there is to be done, and how it goes.
    pub session: SessionPanel,
    /// By subject, whoever wears the sensors; without places while nobody knows where they are.
    pub persons: Vec<PersonNow>,
}

/// Somebody who wears sensors, as they are now.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct PersonNow {
    /// Where joints and ends are, as in [`PersonTrack`], m.
    pub places_m: Vec<[f64; 3]>,
    /// How the sensor of each segment is turned (w, x, y, z); null: it is not worn, or says nothing.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub sensors: Vec<Option<[f64; 4]>>,
}

impl PersonNow {
    /// Somebody of this body in a pose, the lowest of them on the floor, with sensors that are turned so; mm are enough.
    #[must_use]
    pub fn of(body: &Proportions, pose: &SegmentPose, sensors: &[Option<DQuat>; 13]) -> Self {
        let at = body.positions(pose);
        let all: Vec<DVec3> = at.joints_m.iter().chain(&at.ends_m).copied().collect();
        let low_m = all.iter().map(|point_m| point_m.z).fold(f64::INFINITY, f64::min);
        let over_floor = |point_m: &DVec3| {
            (*point_m - DVec3::Z * low_m).to_array().map(|part_m| (part_m * 1e3).round() / 1e3)
        };
        let turned = |by: DQuat| [by.w, by.x, by.y, by.z].map(|part| (part * 1e3).round() / 1e3);
        Self {
            places_m: all.iter().map(over_floor).collect(),
            sensors: sensors.iter().map(|sensor| sensor.map(turned)).collect(),
        }
    }
}

/// What the operator sees.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct SessionPanel {
    /// What is to be done now.
    pub instruction: String,
    /// What is asked at the terminal, with what may be answered; empty: nothing.
    pub asked: String,
    /// What was said last besides.
    pub remark: String,
    /// How long it takes; absent: as long as it takes.
    pub holds: Option<HoldTime>,
    /// For so long a trial has been recorded, s; absent: none is.
    pub recorded_s: Option<f64>,
    /// The trial.
    pub trial: Option<TrialPlace>,
    /// What comes after that, the next first.
    pub next: Vec<String>,
    /// What became of what was done last; absent: nothing yet.
    pub verdict: Option<SettledWords>,
    /// The sensors.
    pub sensors: Vec<SensorRow>,
}

/// A time that runs down.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct HoldTime {
    /// All of it, s.
    pub lasts_s: f64,
    /// What is left of it, s.
    pub left_s: f64,
}

/// Where in the plan a trial is.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TrialPlace {
    /// Name of the action.
    pub action: String,
    /// Who does it.
    pub subjects: String,
    /// Number of the action in the plan, from 1.
    pub number: usize,
    /// Actions in the plan.
    pub total: usize,
    /// Good repetitions that are kept.
    pub good: u32,
    /// Good repetitions wanted.
    pub wanted: u32,
    /// Good ones marked in what is recorded now.
    pub marked_good: u32,
    /// Bad ones.
    pub marked_bad: u32,
}

/// What became of something.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct SettledWords {
    /// Whether it is used.
    pub kept: bool,
    /// What, and why.
    pub words: String,
}

/// A sensor.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct SensorRow {
    /// Its name.
    pub name: String,
    /// Samples per second now.
    pub rate_hz: f64,
    /// Samples per second by its profile; 0: nobody knows.
    pub usual_rate_hz: f64,
    /// Samples that came.
    pub samples: u64,
    /// Samples that are missing.
    pub missed: u64,
    /// Why nothing can be expected of it; empty: it speaks.
    pub silent: String,
}

/// Somebody who is drawn as they come, with what may be worn on each segment.
#[must_use]
pub fn person(body: &Proportions) -> PersonTrack {
    let (poses, rate_hz, floor_m, feet) = (&[], 1.0, 0.0, DrawnFeet::DrawnOn);
    let scene = Scene { title: "", poses, body, rate_hz, floor_m, feet };
    let sensors = Segment::ALL.map(|segment| DrawnSensor {
        name: segment_name(segment).to_owned(),
        segment,
        turns: Vec::new(),
    });
    let somebody = PersonTrack::drawn(&scene, SampleClock::Even { rate_hz, count: 0 }, &[], None);
    somebody.wearing(sensors.into(), rate_hz)
}
