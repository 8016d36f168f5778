//! Sensor samples as messages: what `gaitway record` writes and `gaitway convert` reads.

use super::imu_message::{FUSED, Imu, Rotation, SampleEncoding, Transform, Vector, packed};
use super::marker::{self, Marker};
use super::message::Stamp;
use super::messages::Schema;
use crate::capture::{Captured, Order};
use crate::time::Instant;
use glam::DVec3;
use serde::{Deserialize, Serialize};

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

/// A channel of a source.
pub(super) struct SourceChannel {
    pub(super) topic: String,
    pub(super) schema: Schema<'static>,
}

impl SourceKind {
    /// Topics of a source with this name.
    pub(super) fn channels(self, name: &str, samples: SampleEncoding) -> Vec<SourceChannel> {
        let json = |topic: String, name, text: &'static str| SourceChannel {
            topic,
            schema: Schema {
                name,
                encoding: "jsonschema",
                data: text.as_bytes(),
                messages: SampleEncoding::Json.name(),
            },
        };
        let (imu, transform) = ("gaitway.Imu", "foxglove.FrameTransform");
        let (sample, orientation) =
            (format!("/imu/{name}/sample"), format!("/imu/{name}/orientation"));
        match (self, samples) {
            (Self::Imu, SampleEncoding::Json) => vec![
                json(sample, imu, include_str!("schema/imu.json")),
                json(orientation, transform, include_str!("schema/frame_transform.json")),
            ],
            (Self::Imu, SampleEncoding::Protobuf) => {
                let encoding = SampleEncoding::Protobuf.name();
                let data = include_bytes!("schema/imu.bin").as_slice();
                let schema = Schema { name: imu, encoding, data, messages: encoding };
                vec![SourceChannel { topic: sample, schema }]
            }
            (Self::Lines, _) => {
                let topic = format!("/lines/{name}");
                vec![json(topic, "gaitway.Line", include_str!("schema/line.json"))]
            }
            (Self::Marks, _) => {
                vec![json(
                    marker::TOPIC.to_owned(),
                    "foxglove.Log",
                    include_str!("schema/log.json"),
                )]
            }
        }
    }
}

/// `/lines/NAME`.
#[derive(Debug, Serialize, Deserialize)]
struct Line<'a> {
    timestamp: Stamp,
    host_monotonic_ns: u64,
    dropped_before: u64,
    text: &'a str,
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

/// The messages of a record as (channel of the source, bytes).
pub(super) fn messages(
    name: &str,
    record: &SourceRecord,
    samples: SampleEncoding,
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
    let transform = transform(name, captured, timestamp);
    if samples == SampleEncoding::Protobuf {
        return Ok(vec![(0, packed(&imu, transform.as_ref()))]);
    }
    let mut out = vec![(0, serde_json::to_vec(&imu)?)];
    if let Some(transform) = transform {
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
        source: if fused.is_some() { FUSED } else { "device" }.into(),
        settled: fused.is_none_or(|fused| fused.settled),
        bias_rad_s: fused.map(|fused| fused.bias_rad_s.into()),
        at_rest: fused.map(|fused| fused.at_rest),
        magnetically_disturbed: fused.map(|fused| fused.magnetically_disturbed),
    })
}

/// How many messages a record becomes: one on each of its source's first channels.
pub(super) fn message_count(record: &SourceRecord, samples: SampleEncoding) -> usize {
    match record {
        SourceRecord::Sample(captured) if samples == SampleEncoding::Json => {
            1 + usize::from(captured.orientation().is_some())
        }
        _ => 1,
    }
}
