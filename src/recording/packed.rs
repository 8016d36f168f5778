//! Samples of sensors in few bytes: a message of protobuf. What it is is in `schema/imu.proto`, of which the compiled
//! description goes into each file, so that others read it too.

use prost::Message;

/// The name of this encoding in MCAP files, of schemas and of messages.
pub(super) const ENCODING: &str = "protobuf";

/// No sample is larger: names and numbers of some ten bytes each.
const MESSAGE_BYTES: usize = 64 << 10;

/// A message as bytes.
pub(super) fn written(message: &impl Message) -> Vec<u8> {
    message.encode_to_vec()
}

/// A message of ours; `None` if it is none.
pub(super) fn read<T: Message + Default>(body: &[u8]) -> Option<T> {
    if body.len() > MESSAGE_BYTES {
        return None;
    }
    T::decode(body).ok()
}

/// Time since 1970.
#[derive(Clone, Copy, PartialEq, Eq, Message)]
pub(super) struct PackedStamp {
    #[prost(int64, tag = "1")]
    pub(super) seconds: i64,
    #[prost(int32, tag = "2")]
    pub(super) nanos: i32,
}

/// A reading along three axes.
#[derive(Clone, Copy, PartialEq, Message)]
pub(super) struct PackedVector {
    #[prost(float, tag = "1")]
    pub(super) x: f32,
    #[prost(float, tag = "2")]
    pub(super) y: f32,
    #[prost(float, tag = "3")]
    pub(super) z: f32,
}

/// A rotation that a device told.
#[derive(Clone, Copy, PartialEq, Message)]
pub(super) struct PackedRotation {
    #[prost(float, tag = "1")]
    pub(super) x: f32,
    #[prost(float, tag = "2")]
    pub(super) y: f32,
    #[prost(float, tag = "3")]
    pub(super) z: f32,
    #[prost(float, tag = "4")]
    pub(super) w: f32,
}

/// `gaitway.Imu`.
#[derive(Clone, Copy, PartialEq, Message)]
pub(super) struct PackedImu {
    #[prost(message, optional, tag = "1")]
    pub(super) timestamp: Option<PackedStamp>,
    #[prost(uint64, tag = "2")]
    pub(super) host_monotonic_ns: u64,
    #[prost(uint64, tag = "3")]
    pub(super) number: u64,
    #[prost(int32, tag = "4")]
    pub(super) order: i32,
    #[prost(uint64, tag = "5")]
    pub(super) missed_before: u64,
    #[prost(uint64, tag = "6")]
    pub(super) estimated_before: u64,
    #[prost(uint64, tag = "7")]
    pub(super) dropped_before: u64,
    #[prost(uint64, optional, tag = "8")]
    pub(super) device_counter: Option<u64>,
    #[prost(uint64, optional, tag = "9")]
    pub(super) device_ticks: Option<u64>,
    #[prost(message, optional, tag = "10")]
    pub(super) angular_velocity: Option<PackedVector>,
    #[prost(message, optional, tag = "11")]
    pub(super) linear_acceleration: Option<PackedVector>,
    #[prost(message, optional, tag = "12")]
    pub(super) acceleration_without_gravity: Option<PackedVector>,
    #[prost(message, optional, tag = "13")]
    pub(super) magnetic_field: Option<PackedVector>,
    #[prost(message, optional, tag = "14")]
    pub(super) orientation: Option<PackedRotation>,
    #[prost(float, optional, tag = "15")]
    pub(super) temperature_c: Option<f32>,
    #[prost(bool, tag = "16")]
    pub(super) implausible: bool,
    #[prost(message, optional, tag = "17")]
    pub(super) fused: Option<PackedRotation>,
    #[prost(bool, tag = "18")]
    pub(super) settled: bool,
    #[prost(message, optional, tag = "19")]
    pub(super) bias_rad_s: Option<PackedVector>,
    #[prost(bool, optional, tag = "20")]
    pub(super) at_rest: Option<bool>,
    #[prost(bool, optional, tag = "21")]
    pub(super) magnetically_disturbed: Option<bool>,
}
