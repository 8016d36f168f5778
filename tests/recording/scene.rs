//! A small run to record: two joints, one of them with missed reads.

use std::collections::BTreeMap;
use std::time::{Duration, UNIX_EPOCH};

use gaitway::recording::{CycleRecord, JointRecord, RecordedJoint, RunEnd, RunStart};
use gaitway::time::Instant;

/// 2024-01-02T03:04:05Z, far from the clock of any machine that runs this.
pub const WALL_START_S: u64 = 1_704_164_645;
pub const MONOTONIC_START: Instant = Instant::from_nanos(5_000_000_000);

pub fn start() -> RunStart {
    let joint = |name: &str| RecordedJoint {
        name: name.into(),
        lower_rad: Some(-1.5),
        upper_rad: Some(1.5),
        velocity_limit_rad_s: Some(4.0),
        acceleration_limit_rad_s2: None,
    };
    RunStart {
        robot: "op3".into(),
        motion: "wave-r".into(),
        joints: vec![joint("r_sho_pitch"), joint("r_el")],
        wall_clock_start: UNIX_EPOCH + Duration::from_secs(WALL_START_S),
        monotonic_start: MONOTONIC_START,
        gaitway_version: "0.1.0".into(),
        metadata: BTreeMap::from([("calibration".into(), "none".into())]),
    }
}

/// Cycle `n` of a 100 Hz run. All values have few binary digits, so that they survive any
/// correct JSON reader exactly. Every third cycle misses the second joint.
pub fn cycle(n: u64) -> CycleRecord {
    let position_rad = n as f64 / 1024.0;
    let first = JointRecord {
        goal_rad: Some(position_rad),
        present_position_rad: Some(position_rad - 0.125),
        present_velocity_rad_s: Some(0.5),
        present_current_a: Some(0.25),
        present_load_ratio: Some(-0.5),
        temperature_c: (n.is_multiple_of(4)).then_some(41.0),
        voltage_v: (n.is_multiple_of(4)).then_some(11.5),
        missed: None,
        device_clock: Some(n as u32 * 10),
    };
    let missed = JointRecord {
        goal_rad: Some(-position_rad),
        missed: Some("timed out".into()),
        ..JointRecord::default()
    };
    let read = JointRecord { goal_rad: Some(-position_rad), ..first.clone() };
    CycleRecord {
        cycle: n,
        at: MONOTONIC_START + Duration::from_millis(10 * n),
        joints: vec![first, if n.is_multiple_of(3) { missed } else { read }],
        base: None,
    }
}

pub fn end(cycles: u64) -> RunEnd {
    RunEnd {
        outcome: "done".into(),
        stop_reason: None,
        at: MONOTONIC_START + Duration::from_millis(10 * cycles),
        metadata: BTreeMap::new(),
    }
}

/// Messages that [`cycle`] becomes: goal, present and cycle, and health where it was read.
pub fn messages(n: u64) -> u64 {
    if n.is_multiple_of(4) { 4 } else { 3 }
}
