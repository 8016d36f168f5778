//! What goes into a recording: plain values, no hardware types.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::time::SystemTime;

use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};

use super::bounded;
use crate::time::Instant;

/// One control cycle: every joint's goal and what was read back.
#[derive(Clone, Debug, PartialEq)]
pub struct CycleRecord {
    /// Cycle number, counted from the start of the run.
    pub cycle: u64,
    /// The cycle's instant on the host's monotonic clock.
    pub at: Instant,
    /// One record per joint, in the order of [`RunStart::joints`].
    pub joints: Vec<JointRecord>,
    /// Where the robot's base was meant to be; `None` is "nobody said".
    pub base: Option<Box<BaseRecord>>,
}

/// Where a robot's base is meant to be in one cycle, and which of its feet stand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BaseRecord {
    /// Its origin in the world, m; the floor is at z = 0.
    pub at_m: DVec3,
    /// Turns its own axes into the world's.
    pub turn: DQuat,
    /// Whether the left and the right foot are on the floor.
    pub contacts: [bool; 2],
}

/// One joint in one cycle. `None` is "not written" or "not read", never a default.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct JointRecord {
    /// Goal position written in this cycle, radians.
    pub goal_rad: Option<f64>,
    /// Measured position, radians.
    pub present_position_rad: Option<f64>,
    /// Measured velocity, rad/s.
    pub present_velocity_rad_s: Option<f64>,
    /// Measured current, amperes.
    pub present_current_a: Option<f64>,
    /// Measured load, a ratio of the most the servo can give, -1 to 1.
    pub present_load_ratio: Option<f64>,
    /// Temperature, degrees Celsius.
    pub temperature_c: Option<f64>,
    /// Supply voltage, volts.
    pub voltage_v: Option<f64>,
    /// Why this cycle has no reading of the joint.
    pub missed: Option<Cow<'static, str>>,
    /// The device's own clock at the sample, raw ticks.
    pub device_clock: Option<u32>,
}

/// What a run is, known before its first cycle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunStart {
    /// The robot's name.
    pub robot: String,
    /// The motion's name or path.
    pub motion: String,
    /// The joints and their limits; their order is the order of every record.
    #[serde(deserialize_with = "bounded::joints")]
    pub joints: Vec<RecordedJoint>,
    /// The wall clock at `monotonic_start`; read once, never again during the run.
    #[serde(with = "wall_nanos", rename = "wall_clock_start_ns")]
    pub wall_clock_start: SystemTime,
    /// The host's monotonic clock at the same moment.
    #[serde(with = "monotonic_nanos", rename = "monotonic_start_ns")]
    pub monotonic_start: Instant,
    /// Version of the program that wrote the recording.
    pub gaitway_version: String,
    /// Anything else worth keeping: calibration file, command line, notes.
    #[serde(deserialize_with = "bounded::entries")]
    pub metadata: BTreeMap<String, String>,
}

/// A joint's name and the limits it was played under; `None` is "no limit known".
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RecordedJoint {
    /// The joint's name.
    pub name: String,
    /// Lower position limit, radians.
    pub lower_rad: Option<f64>,
    /// Upper position limit, radians.
    pub upper_rad: Option<f64>,
    /// Velocity limit, rad/s.
    pub velocity_limit_rad_s: Option<f64>,
    /// Acceleration limit, rad/s^2.
    pub acceleration_limit_rad_s2: Option<f64>,
}

/// How a run ended.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunEnd {
    /// `done`, `done_with_loss`, `refused`, `stopped` or `failed`.
    pub outcome: String,
    /// Why the motion ended early, if it did.
    pub stop_reason: Option<String>,
    /// The end on the host's monotonic clock.
    #[serde(with = "monotonic_nanos", rename = "monotonic_end_ns")]
    pub at: Instant,
    /// Anything else worth keeping: counts, extremes.
    #[serde(deserialize_with = "bounded::entries")]
    pub metadata: BTreeMap<String, String>,
}

impl RunStart {
    /// Wall-clock nanoseconds since 1970 of a monotonic instant: the start's wall clock plus the
    /// monotonic time since, whatever the wall clock did meanwhile.
    #[must_use]
    pub fn wall_nanos(&self, at: Instant) -> u64 {
        let start = i128::from(wall_nanos::since_epoch(self.wall_clock_start));
        let since = i128::from(at.as_nanos()) - i128::from(self.monotonic_start.as_nanos());
        u64::try_from((start + since).clamp(0, i128::from(u64::MAX))).unwrap_or(u64::MAX)
    }
}

/// Serialises a wall clock as nanoseconds since 1970.
mod wall_nanos {
    use std::time::{Duration, SystemTime, UNIX_EPOCH};

    use serde::{Deserialize, Deserializer, Serializer};

    pub fn since_epoch(time: SystemTime) -> u64 {
        let since = time.duration_since(UNIX_EPOCH).unwrap_or_default();
        u64::try_from(since.as_nanos()).unwrap_or(u64::MAX)
    }

    pub fn serialize<S: Serializer>(time: &SystemTime, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_u64(since_epoch(*time))
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<SystemTime, D::Error> {
        let nanos = u64::deserialize(from)?;
        // u64 nanoseconds end in the year 2554, well inside SystemTime on Linux.
        Ok(UNIX_EPOCH.checked_add(Duration::from_nanos(nanos)).unwrap_or(UNIX_EPOCH))
    }
}

/// Serialises a monotonic instant as nanoseconds.
mod monotonic_nanos {
    use serde::{Deserialize, Deserializer, Serializer};

    use crate::time::Instant;

    pub fn serialize<S: Serializer>(at: &Instant, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_u64(at.as_nanos())
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Instant, D::Error> {
        u64::deserialize(from).map(Instant::from_nanos)
    }
}
