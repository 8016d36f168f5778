//! Sensor samples as messages: what `gaitway record` writes and `gaitway convert` reads.

use super::marker::{self, Marker};
use super::message::Stamp;
use crate::capture::{Captured, Order};
use crate::time::Instant;
use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;

/// A source whose channels are added while a recording runs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecordedSource {
    /// Its name, which is part of its topics.
    pub name: String,
    /// What it is: the profile's name, the address, its settings.
    pub metadata: std::collections::BTreeMap<String, String>,
    /// What it sends.
    pub kind: SourceKind,
}

/// Kinds of added sources.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SourceKind {
    /// Samples of an inertial sensor.
    Imu,
    /// Lines of text, kept as they are.
    Lines,
    /// Marks that somebody sets; there is one of these, whatever it is called.
    Marks,
}

/// Number of a source in a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SourceId(pub(super) usize);

/// What a source sends.
#[derive(Clone, Debug, PartialEq)]
pub enum SourceRecord {
    /// A sample.
    Sample(Box<Captured>),
    /// A line of text and when it was read.
    Line(Instant, String),
    /// A mark.
    Mark(Marker),
}

impl SourceRecord {
    /// When it was read, and when it was true.
    pub(super) fn moments(&self) -> (Instant, Instant) {
        match self {
            Self::Sample(captured) => (captured.stamp.arrival, captured.stamp.taken),
            Self::Line(at, _) => (*at, *at),
            Self::Mark(mark) => (mark.at, mark.at),
        }
    }
}

impl SourceKind {
    /// Topics of a source with this name, with schema names and schemas.
    pub(super) fn channels(self, name: &str) -> Vec<(String, &'static str, &'static str)> {
        match self {
            Self::Imu => vec![
                (format!("/imu/{name}/sample"), "gaitway.Imu", include_str!("schema/imu.json")),
                (
                    format!("/imu/{name}/orientation"),
                    "foxglove.FrameTransform",
                    include_str!("schema/frame_transform.json"),
                ),
            ],
            Self::Lines => {
                vec![(format!("/lines/{name}"), "gaitway.Line", include_str!("schema/line.json"))]
            }
            Self::Marks => {
                vec![(marker::TOPIC.to_owned(), "foxglove.Log", include_str!("schema/log.json"))]
            }
        }
    }
}

/// Three numbers, as Foxglove's schemas name them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Vector {
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) z: f64,
}

impl From<DVec3> for Vector {
    fn from(v: DVec3) -> Self {
        Self { x: v.x, y: v.y, z: v.z }
    }
}

impl From<Vector> for DVec3 {
    fn from(v: Vector) -> Self {
        Self::new(v.x, v.y, v.z)
    }
}

/// A rotation, as Foxglove's schemas name it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Rotation {
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) z: f64,
    pub(super) w: f64,
}

impl From<DQuat> for Rotation {
    fn from(q: DQuat) -> Self {
        Self { x: q.x, y: q.y, z: q.z, w: q.w }
    }
}

impl From<Rotation> for DQuat {
    fn from(q: Rotation) -> Self {
        Self::from_xyzw(q.x, q.y, q.z, q.w)
    }
}

/// `/imu/NAME/sample`. What was not measured is left out.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Imu {
    pub(super) timestamp: Stamp,
    pub(super) host_monotonic_ns: u64,
    pub(super) number: u64,
    pub(super) order: Cow<'static, str>,
    /// Samples the sensor or the line lost before this one.
    #[serde(default)]
    pub(super) missed_before: u64,
    #[serde(default, skip_serializing_if = "is_zero")]
    pub(super) estimated_before: u64,
    /// Samples the full queue dropped before this one.
    #[serde(default)]
    pub(super) dropped_before: u64,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) device_counter: Option<u64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) device_ticks: Option<u64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) angular_velocity: Option<Vector>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) linear_acceleration: Option<Vector>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) acceleration_without_gravity: Option<Vector>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) magnetic_field: Option<Vector>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) orientation: Option<Rotation>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) temperature_c: Option<f64>,
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub(super) implausible: bool,
}

/// `/imu/NAME/orientation`, the fused one, or the device's own where nothing was fused.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Transform<'a> {
    pub(super) timestamp: Stamp,
    #[serde(borrow)]
    pub(super) parent_frame_id: Cow<'a, str>,
    #[serde(borrow)]
    pub(super) child_frame_id: Cow<'a, str>,
    pub(super) translation: Vector,
    pub(super) rotation: Rotation,
    #[serde(borrow)]
    pub(super) source: Cow<'a, str>,
    pub(super) settled: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) bias_rad_s: Option<Vector>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) at_rest: Option<bool>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) magnetically_disturbed: Option<bool>,
}

/// `/lines/NAME`.
#[derive(Debug, Serialize, Deserialize)]
struct Line<'a> {
    timestamp: Stamp,
    host_monotonic_ns: u64,
    dropped_before: u64,
    text: &'a str,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks so")]
const fn is_zero(count: &u64) -> bool {
    *count == 0
}

fn word(order: Order) -> &'static str {
    match order {
        Order::Next => "next",
        Order::Gap => "gap",
        Order::Duplicate => "duplicate",
        Order::Late => "late",
        Order::Reset => "reset",
        Order::Doubted => "doubted",
    }
}

/// The messages of a record as (channel of the source, JSON).
pub(super) fn messages(
    name: &str,
    record: &SourceRecord,
    taken_wall_ns: u64,
    dropped_before: u64,
) -> serde_json::Result<Vec<(usize, Vec<u8>)>> {
    let timestamp = Stamp::from_nanos(taken_wall_ns);
    let captured = match record {
        SourceRecord::Line(at, text) => {
            let host_monotonic_ns = at.as_nanos();
            let line = Line { timestamp, host_monotonic_ns, dropped_before, text };
            return Ok(vec![(0, serde_json::to_vec(&line)?)]);
        }
        SourceRecord::Mark(mark) => return Ok(vec![(0, mark.message(taken_wall_ns)?)]),
        SourceRecord::Sample(captured) => captured,
    };
    let (sample, stamp) = (&captured.sample, &captured.stamp);
    let imu = Imu {
        timestamp,
        host_monotonic_ns: stamp.arrival.as_nanos(),
        number: stamp.number,
        order: word(stamp.order).into(),
        missed_before: stamp.missed,
        estimated_before: stamp.estimated,
        dropped_before,
        device_counter: sample.counter,
        device_ticks: sample.ticks,
        angular_velocity: sample.angular_rate_rad_s.map(Vector::from),
        linear_acceleration: sample.acceleration_m_s2.map(Vector::from),
        acceleration_without_gravity: sample.linear_acceleration_m_s2.map(Vector::from),
        magnetic_field: sample.magnetic_field_t.map(Vector::from),
        orientation: sample.orientation.map(Rotation::from),
        temperature_c: sample.temperature_c,
        implausible: sample.implausible,
    };
    let mut out = vec![(0, serde_json::to_vec(&imu)?)];
    if let Some(transform) = transform(name, captured, timestamp) {
        out.push((1, serde_json::to_vec(&transform)?));
    }
    Ok(out)
}

fn transform<'a>(name: &'a str, captured: &Captured, timestamp: Stamp) -> Option<Transform<'a>> {
    let fused = captured.fused;
    let rotation = captured.orientation()?;
    Some(Transform {
        timestamp,
        parent_frame_id: "world".into(),
        child_frame_id: name.into(),
        translation: DVec3::ZERO.into(),
        rotation: rotation.into(),
        source: if fused.is_some() { "vqf" } else { "device" }.into(),
        settled: fused.is_none_or(|fused| fused.settled),
        bias_rad_s: fused.map(|fused| fused.bias_rad_s.into()),
        at_rest: fused.map(|fused| fused.at_rest),
        magnetically_disturbed: fused.map(|fused| fused.magnetically_disturbed),
    })
}

/// How many messages a record becomes: one on each of its source's first channels.
pub(super) fn message_count(record: &SourceRecord) -> usize {
    match record {
        SourceRecord::Line(..) | SourceRecord::Mark(_) => 1,
        SourceRecord::Sample(captured) => 1 + usize::from(captured.orientation().is_some()),
    }
}
