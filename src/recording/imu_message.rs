//! What one sample of a sensor is in a recording: as JSON, or in fewer bytes ([`super::packed`]). One definition for writing
//! and for reading.

use super::message::{Stamp, parse};
use super::packed::{self, PackedImu, PackedRotation, PackedStamp, PackedVector};
use crate::error::{Error, ErrorKind};
use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::str::FromStr;

/// How samples are written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SampleEncoding {
    /// As text that anything reads.
    #[default]
    Json,
    /// As protobuf, whose description is in the file, in one message a sample: fewer than half of the bytes. Numbers have 24 bits.
    Protobuf,
}

impl SampleEncoding {
    /// Its name in MCAP files (<https://mcap.dev/spec/registry>).
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Json => "json",
            Self::Protobuf => packed::ENCODING,
        }
    }
}

impl FromStr for SampleEncoding {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        match text {
            "json" => Ok(Self::Json),
            "protobuf" => Ok(Self::Protobuf),
            _ => Err(Error::of(ErrorKind::Unknown, "samples are not written so")
                .got(text)
                .allowed("json, protobuf")),
        }
    }
}

/// How a sample comes after the one before.
const ORDERS: [&str; 6] = ["next", "gap", "duplicate", "late", "reset", "doubted"];

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

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks so")]
const fn is_zero(count: &u64) -> bool {
    *count == 0
}

/// How a sensor was turned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Turned {
    pub(super) rotation: Rotation,
    /// By a filter; else by the device itself.
    pub(super) is_fused: bool,
    pub(super) settled: bool,
}

/// A message of a sensor.
#[derive(Debug)]
pub(super) enum SensorMessage {
    /// A sample; how the sensor was turned then, if that is in the same message.
    Sample(Box<Imu>, Option<Turned>),
    /// How the sensor was turned at the sample before it.
    Turned(Turned),
}

impl SensorMessage {
    /// A message of the channel `/imu/NAME/part` with this encoding; `None` if it is none.
    pub(super) fn read(encoding: &str, part: &str, body: &[u8]) -> Option<Self> {
        match part {
            "sample" if encoding == packed::ENCODING => {
                let message = packed::read(body)?;
                let turned = turned(&message);
                Some(Self::Sample(Box::new(message.into()), turned))
            }
            "sample" => Some(Self::Sample(Box::new(parse(body)?), None)),
            "orientation" => {
                let Transform { rotation, source, settled, .. } = parse(body)?;
                Some(Self::Turned(Turned { rotation, is_fused: source == FUSED, settled }))
            }
            _ => None,
        }
    }
}

/// What an orientation comes from that a filter found.
pub(super) const FUSED: &str = "vqf";

fn turned(message: &PackedImu) -> Option<Turned> {
    let of = |rotation: PackedRotation, is_fused, settled| Turned {
        rotation: rotation.into(),
        is_fused,
        settled,
    };
    match (message.fused, message.orientation) {
        (Some(fused), _) => Some(of(fused, true, message.settled)),
        (None, Some(own)) => Some(of(own, false, true)),
        (None, None) => None,
    }
}

/// A sample, and what a filter made of it, in one message.
pub(super) fn packed(imu: &Imu, transform: Option<&Transform<'_>>) -> Vec<u8> {
    let fused = transform.filter(|transform| transform.source == FUSED);
    packed::written(&PackedImu {
        fused: fused.map(|fused| fused.rotation.into()),
        settled: fused.is_some_and(|fused| fused.settled),
        bias_rad_s: fused.and_then(|fused| fused.bias_rad_s).map(PackedVector::from),
        at_rest: fused.and_then(|fused| fused.at_rest),
        magnetically_disturbed: fused.and_then(|fused| fused.magnetically_disturbed),
        ..PackedImu::from(imu)
    })
}

impl From<Stamp> for PackedStamp {
    fn from(from: Stamp) -> Self {
        let (seconds, nanos) = from.parts();
        Self { seconds: i64::try_from(seconds).unwrap_or(i64::MAX), nanos: nanos as i32 }
    }
}

impl From<PackedStamp> for Stamp {
    fn from(from: PackedStamp) -> Self {
        let seconds = u64::try_from(from.seconds).unwrap_or(0);
        Self::from_nanos(
            seconds
                .saturating_mul(1_000_000_000)
                .saturating_add(u64::try_from(from.nanos).unwrap_or(0)),
        )
    }
}

impl From<Vector> for PackedVector {
    fn from(from: Vector) -> Self {
        Self { x: from.x as f32, y: from.y as f32, z: from.z as f32 }
    }
}

impl From<PackedVector> for Vector {
    fn from(from: PackedVector) -> Self {
        Self { x: from.x.into(), y: from.y.into(), z: from.z.into() }
    }
}

impl From<Rotation> for PackedRotation {
    fn from(from: Rotation) -> Self {
        Self { x: from.x as f32, y: from.y as f32, z: from.z as f32, w: from.w as f32 }
    }
}

impl From<PackedRotation> for Rotation {
    fn from(from: PackedRotation) -> Self {
        Self { x: from.x.into(), y: from.y.into(), z: from.z.into(), w: from.w.into() }
    }
}

impl From<&Imu> for PackedImu {
    fn from(from: &Imu) -> Self {
        let order = ORDERS.iter().position(|order| *order == from.order).unwrap_or(0);
        Self {
            timestamp: Some(from.timestamp.into()),
            host_monotonic_ns: from.host_monotonic_ns,
            number: from.number,
            order: order as i32,
            missed_before: from.missed_before,
            estimated_before: from.estimated_before,
            dropped_before: from.dropped_before,
            device_counter: from.device_counter,
            device_ticks: from.device_ticks,
            angular_velocity: from.angular_velocity.map(PackedVector::from),
            linear_acceleration: from.linear_acceleration.map(PackedVector::from),
            acceleration_without_gravity: from.acceleration_without_gravity.map(PackedVector::from),
            magnetic_field: from.magnetic_field.map(PackedVector::from),
            orientation: from.orientation.map(PackedRotation::from),
            temperature_c: from.temperature_c.map(|celsius| celsius as f32),
            implausible: from.implausible,
            ..Self::default()
        }
    }
}

impl From<PackedImu> for Imu {
    fn from(from: PackedImu) -> Self {
        let order = usize::try_from(from.order).ok().and_then(|at| ORDERS.get(at));
        Self {
            timestamp: from.timestamp.unwrap_or_default().into(),
            host_monotonic_ns: from.host_monotonic_ns,
            number: from.number,
            order: (*order.unwrap_or(&ORDERS[0])).into(),
            missed_before: from.missed_before,
            estimated_before: from.estimated_before,
            dropped_before: from.dropped_before,
            device_counter: from.device_counter,
            device_ticks: from.device_ticks,
            angular_velocity: from.angular_velocity.map(Vector::from),
            linear_acceleration: from.linear_acceleration.map(Vector::from),
            acceleration_without_gravity: from.acceleration_without_gravity.map(Vector::from),
            magnetic_field: from.magnetic_field.map(Vector::from),
            orientation: from.orientation.map(Rotation::from),
            temperature_c: from.temperature_c.map(f64::from),
            implausible: from.implausible,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn any_bytes_are_a_sample_or_none(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
            for (encoding, part) in [("json", "sample"), ("protobuf", "sample"), ("json", "orientation"), ("cbor", "sample")] {
                // What was read can be written, and is then read as itself.
                if let Some(SensorMessage::Sample(sample, _)) = SensorMessage::read(encoding, part, &bytes) {
                    let written = packed(&sample, None);
                    let Some(SensorMessage::Sample(again, _)) = SensorMessage::read("protobuf", "sample", &written) else {
                        panic!("{sample:?}")
                    };
                    prop_assert_eq!(packed(&again, None), written);
                }
            }
        }
    }
}
