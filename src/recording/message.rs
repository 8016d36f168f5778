//! The messages of a recording as JSON: one definition for writing and for reading.

use std::borrow::Cow;
use std::collections::BTreeMap;

use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};

use super::bounded;
use super::sample::{BaseRecord, CycleRecord, JointRecord, RecordedJoint, RunEnd, RunStart};

/// The channels, in the order in which they are registered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Topic {
    Goal,
    Present,
    Cycle,
    Health,
    Run,
}

impl Topic {
    pub(super) const ALL: [Self; 5] =
        [Self::Goal, Self::Present, Self::Cycle, Self::Health, Self::Run];

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Goal => "/joints/goal",
            Self::Present => "/joints/present",
            Self::Cycle => "/cycle",
            Self::Health => "/health",
            Self::Run => "/run",
        }
    }

    pub(super) fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|topic| topic.name() == name)
    }

    pub(super) fn schema_name(self) -> &'static str {
        match self {
            Self::Goal | Self::Present => "foxglove.JointStates",
            Self::Cycle => "gaitway.Cycle",
            Self::Health => "gaitway.Health",
            Self::Run => "gaitway.Run",
        }
    }

    pub(super) fn schema(self) -> &'static str {
        match self {
            Self::Goal | Self::Present => include_str!("schema/joint_states.json"),
            Self::Cycle => include_str!("schema/cycle.json"),
            Self::Health => include_str!("schema/health.json"),
            Self::Run => include_str!("schema/run.json"),
        }
    }
}

/// No message of ours is larger: 512 joints of 300 bytes each, and room to spare.
const MESSAGE_BYTES: usize = 256 << 10;

/// A message of ours; `None` if it is none.
pub(super) fn parse<'a, T: Deserialize<'a>>(body: &'a [u8]) -> Option<T> {
    if body.len() > MESSAGE_BYTES {
        return None;
    }
    serde_json::from_slice(body).ok()
}

/// Wall clock, as every tool that knows Foxglove's schemas reads it.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct Stamp {
    sec: u64,
    nsec: u32,
}

impl Stamp {
    /// Seconds, and nanoseconds beside them.
    pub(super) const fn parts(self) -> (u64, u32) {
        (self.sec, self.nsec)
    }

    pub(super) fn from_nanos(nanos: u64) -> Self {
        Self { sec: nanos / 1_000_000_000, nsec: (nanos % 1_000_000_000) as u32 }
    }
}

/// The fields every per-cycle message begins with.
#[derive(Clone, Copy, Serialize, Deserialize)]
pub(super) struct Moment {
    pub(super) timestamp: Stamp,
    pub(super) cycle: u64,
    pub(super) host_monotonic_ns: u64,
}

/// `/joints/goal` and `/joints/present`.
#[derive(Serialize, Deserialize)]
pub(super) struct JointStates<'a> {
    #[serde(flatten)]
    pub(super) moment: Moment,
    #[serde(borrow, deserialize_with = "bounded::joints")]
    pub(super) joints: Vec<JointState<'a>>,
}

/// One joint of [`JointStates`]; a value that was not read is left out.
#[derive(Default, Serialize, Deserialize)]
#[serde(default)]
pub(super) struct JointState<'a> {
    #[serde(borrow)]
    pub(super) name: Cow<'a, str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) position: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) velocity: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) current_a: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) load_ratio: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) device_clock_ticks: Option<u32>,
}

/// `/health`.
#[derive(Serialize, Deserialize)]
pub(super) struct Health<'a> {
    #[serde(flatten)]
    pub(super) moment: Moment,
    #[serde(borrow, deserialize_with = "bounded::joints")]
    pub(super) joints: Vec<JointHealth<'a>>,
}

/// One joint of [`Health`].
#[derive(Default, Serialize, Deserialize)]
#[serde(default)]
pub(super) struct JointHealth<'a> {
    #[serde(borrow)]
    pub(super) name: Cow<'a, str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) temperature_c: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) voltage_v: Option<f64>,
}

/// `/cycle`.
#[derive(Serialize, Deserialize)]
pub(super) struct Cycle<'a> {
    #[serde(flatten)]
    pub(super) moment: Moment,
    /// Cycles the full queue dropped just before this one.
    #[serde(default)]
    pub(super) dropped_before: u64,
    #[serde(borrow, deserialize_with = "bounded::joints")]
    pub(super) missed: Vec<Missed<'a>>,
    /// Where the base was meant to be.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) base: Option<Base>,
}

/// Where a robot's base is meant to be, and which of its feet stand; m, and a quaternion.
#[derive(Clone, Copy, Serialize, Deserialize)]
pub(super) struct Base {
    base_x_m: f64,
    base_y_m: f64,
    base_z_m: f64,
    base_qw: f64,
    base_qx: f64,
    base_qy: f64,
    base_qz: f64,
    contact_left: bool,
    contact_right: bool,
}

impl From<&BaseRecord> for Base {
    fn from(base: &BaseRecord) -> Self {
        let [base_x_m, base_y_m, base_z_m] = base.at_m.to_array();
        let [base_qx, base_qy, base_qz, base_qw] = base.turn.to_array();
        let [contact_left, contact_right] = base.contacts;
        Self {
            base_x_m,
            base_y_m,
            base_z_m,
            base_qw,
            base_qx,
            base_qy,
            base_qz,
            contact_left,
            contact_right,
        }
    }
}

impl From<Base> for BaseRecord {
    fn from(base: Base) -> Self {
        Self {
            at_m: DVec3::new(base.base_x_m, base.base_y_m, base.base_z_m),
            turn: DQuat::from_xyzw(base.base_qx, base.base_qy, base.base_qz, base.base_qw),
            contacts: [base.contact_left, base.contact_right],
        }
    }
}

/// A joint without a reading in this cycle, and why.
#[derive(Serialize, Deserialize)]
pub(super) struct Missed<'a> {
    #[serde(borrow)]
    pub(super) name: Cow<'a, str>,
    #[serde(borrow)]
    pub(super) reason: Cow<'a, str>,
}

/// `/run`: exactly one of start and end is there.
#[derive(Serialize, Deserialize)]
pub(super) struct Run {
    pub(super) timestamp: Stamp,
    /// Cycles the full queue dropped just before this.
    #[serde(default)]
    pub(super) dropped_before: u64,
    /// Samples and lines of sources it dropped since the last ones that were stored.
    #[serde(
        default,
        skip_serializing_if = "BTreeMap::is_empty",
        deserialize_with = "bounded::entries"
    )]
    pub(super) dropped_by_source: BTreeMap<String, u64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) start: Option<RunStart>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) end: Option<RunEnd>,
}

/// The messages one cycle becomes, as JSON, in the order of [`topics`].
pub(super) fn of_cycle(
    joints: &[RecordedJoint],
    record: &CycleRecord,
    wall_ns: u64,
    dropped_before: u64,
) -> serde_json::Result<Vec<(Topic, Vec<u8>)>> {
    let moment = Moment {
        timestamp: Stamp::from_nanos(wall_ns),
        cycle: record.cycle,
        host_monotonic_ns: record.at.as_nanos(),
    };
    let named = || joints.iter().map(|joint| Cow::from(joint.name.as_str())).zip(&record.joints);
    let mut messages = Vec::with_capacity(4);
    if has_goal(record) {
        let joints = named().map(|(name, joint)| goal(name, joint)).collect();
        messages.push((Topic::Goal, serde_json::to_vec(&JointStates { moment, joints })?));
    }
    if has_present(record) {
        let joints = named().map(|(name, joint)| present(name, joint)).collect();
        messages.push((Topic::Present, serde_json::to_vec(&JointStates { moment, joints })?));
    }
    if has_health(record) {
        let joints = named().map(|(name, joint)| health(name, joint)).collect();
        messages.push((Topic::Health, serde_json::to_vec(&Health { moment, joints })?));
    }
    let missed = named().filter_map(|(name, joint)| missed(name, joint)).collect();
    let is_number = |base: &&BaseRecord| base.at_m.is_finite() && base.turn.is_finite();
    let base = record.base.as_deref().filter(is_number).map(Base::from);
    let cycle = Cycle { moment, dropped_before, missed, base };
    messages.push((Topic::Cycle, serde_json::to_vec(&cycle)?));
    Ok(messages)
}

/// The topics one cycle has a message for.
pub(super) fn topics(record: &CycleRecord) -> impl Iterator<Item = Topic> {
    let goal = has_goal(record).then_some(Topic::Goal);
    let health = has_health(record).then_some(Topic::Health);
    let present = has_present(record).then_some(Topic::Present);
    [goal, present, health, Some(Topic::Cycle)].into_iter().flatten()
}

/// Nothing was asked of the joints of a motion that is only planned; a read that was missed was.
fn has_present(record: &CycleRecord) -> bool {
    let plain = JointRecord::default();
    record.joints.iter().any(|joint| {
        let unasked = JointRecord { goal_rad: joint.goal_rad, ..plain.clone() };
        *joint != unasked
    })
}

fn has_goal(record: &CycleRecord) -> bool {
    record.joints.iter().any(|joint| joint.goal_rad.is_some())
}

fn has_health(record: &CycleRecord) -> bool {
    record.joints.iter().any(|joint| joint.temperature_c.is_some() || joint.voltage_v.is_some())
}

/// JSON has no word for NaN or infinity: such a value is left out.
fn finite(value: Option<f64>) -> Option<f64> {
    value.filter(|value| value.is_finite())
}

fn goal<'a>(name: Cow<'a, str>, joint: &JointRecord) -> JointState<'a> {
    JointState { name, position: finite(joint.goal_rad), ..JointState::default() }
}

fn present<'a>(name: Cow<'a, str>, joint: &JointRecord) -> JointState<'a> {
    JointState {
        name,
        position: finite(joint.present_position_rad),
        velocity: finite(joint.present_velocity_rad_s),
        current_a: finite(joint.present_current_a),
        load_ratio: finite(joint.present_load_ratio),
        device_clock_ticks: joint.device_clock,
    }
}

fn health<'a>(name: Cow<'a, str>, joint: &JointRecord) -> JointHealth<'a> {
    let (temperature_c, voltage_v) = (finite(joint.temperature_c), finite(joint.voltage_v));
    JointHealth { name, temperature_c, voltage_v }
}

/// A joint is missed when it says so, and when a reading of it cannot be written down.
fn missed<'a>(name: Cow<'a, str>, joint: &'a JointRecord) -> Option<Missed<'a>> {
    let readings = [
        joint.goal_rad,
        joint.present_position_rad,
        joint.present_velocity_rad_s,
        joint.present_current_a,
        joint.present_load_ratio,
        joint.temperature_c,
        joint.voltage_v,
    ];
    let unwritable = readings.into_iter().flatten().any(|value| !value.is_finite());
    let reason = match &joint.missed {
        Some(reason) => Cow::from(reason.as_ref()),
        None if unwritable => Cow::from("not a finite number"),
        None => return None,
    };
    Some(Missed { name, reason })
}
