//! What goes on over time: joints, points, and what took how long. Lengths in m, angles in rad, times in s.

use super::series::Coded;
use serde::Serialize;

/// When samples were taken.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum SampleClock {
    /// At even times from 0 on.
    Even {
        /// Samples per second.
        rate_hz: f64,
        /// How many.
        count: usize,
    },
    /// At these times.
    Uneven {
        /// Each, s, rising.
        times_s: Coded,
    },
}

impl SampleClock {
    /// A clock with these times, s.
    #[must_use]
    pub fn of(times_s: &[f64]) -> Self {
        Self::Uneven { times_s: Coded::of(times_s.iter().copied(), 1e-4) }
    }

    /// Its times, s.
    #[must_use]
    pub fn times_s(&self) -> Vec<f64> {
        match self {
            Self::Even { rate_hz, count } => (0..*count).map(|n| n as f64 / rate_hz).collect(),
            Self::Uneven { times_s } => times_s.values(),
        }
    }
}

/// The joints of a robot.
#[derive(Clone, Debug, Serialize)]
pub struct JointTracks {
    /// When all of them were looked at.
    pub clock: SampleClock,
    /// In the robot's order.
    pub joints: Vec<JointTrack>,
}

/// One joint. What was not looked at is absent.
#[derive(Clone, Debug, Default, Serialize)]
pub struct JointTrack {
    /// Its name.
    pub name: String,
    /// What it was asked, rad.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub goal: Option<Coded>,
    /// Where it was, rad.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub present: Option<Coded>,
    /// Other quantities.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub others: Vec<Quantity>,
    /// Where it is before anything moves, rad.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub initial_rad: Option<f64>,
    /// Its range, rad.
    pub range_rad: Option<[f64; 2]>,
    /// Its limit, rad/s.
    pub velocity_limit_rad_s: Option<f64>,
    /// Its limit, rad/s².
    pub acceleration_limit_rad_s2: Option<f64>,
}

/// A quantity that has no place of its own.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Quantity {
    /// What it is called.
    pub name: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// When it was read.
    pub clock: SampleClock,
    /// Its values.
    pub values: Coded,
}

/// Points in space, with gaps.
#[derive(Clone, Debug, Serialize)]
pub struct MarkerTracks {
    /// When they were looked at.
    pub clock: SampleClock,
    /// Each.
    pub points: Vec<MarkerTrack>,
}

/// One point.
#[derive(Clone, Debug, Serialize)]
pub struct MarkerTrack {
    /// Its label.
    pub name: String,
    /// Whether it has a name.
    pub labelled: bool,
    /// Where it is.
    pub at: [Coded; 3],
    /// Where it was before it was mended; absent if nothing was.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub before: Option<[Coded; 3]>,
}

/// Force plates.
#[derive(Clone, Debug, Serialize)]
pub struct PlateTracks {
    /// When they were looked at.
    pub clock: SampleClock,
    /// Each.
    pub plates: Vec<PlateTrack>,
}

/// One force plate.
#[derive(Clone, Debug, Serialize)]
pub struct PlateTrack {
    /// What it is called.
    pub name: String,
    /// Its corners, one after the other.
    pub corners_m: [[f64; 3]; 4],
    /// The force on whoever stands there, N.
    pub force: [Coded; 3],
    /// Where it acts; not a number while nobody presses.
    pub at: [Coded; 3],
}

/// What a span of time is about: its colour, and how it is told.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum SpanKind {
    /// A part of the motion: approach, clip, ramp.
    Part,
    /// Something that was recognised, or labelled.
    Event,
    /// A part of that.
    Phase,
    /// Something that was mended.
    Mended,
    /// Something to look at.
    Doubt,
    /// Something that is wrong.
    Wrong,
}

/// A span of time on the time line.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ViewSpan {
    /// What it is about.
    pub kind: SpanKind,
    /// The line it stands in.
    pub row: String,
    /// What it says.
    pub label: String,
    /// From here, s.
    pub start_s: f64,
    /// To here.
    pub end_s: f64,
    /// Links of the robot that it is about.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub links: Vec<usize>,
}

impl ViewSpan {
    /// A span of a kind, in a row, with what it says.
    #[must_use]
    pub fn new(kind: SpanKind, row: &str, label: &str, start_s: f64, end_s: f64) -> Self {
        let (row, label, links) = (row.to_owned(), label.to_owned(), Vec::new());
        Self { kind, row, label, start_s, end_s, links }
    }
}
