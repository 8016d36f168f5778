//! Figures over a whole motion, for the report.

use super::Sample;
use crate::bus::Miss;

/// What was measured of one joint.
#[derive(Clone, Copy, Debug)]
pub struct JointTally {
    /// Lowest measured angle, rad.
    pub lowest_rad: f64,
    /// Highest measured angle, rad.
    pub highest_rad: f64,
    /// Sum of squared tracking errors, rad².
    pub squared_error_rad2: f64,
    /// Samples behind it.
    pub samples: u64,
    /// Cycles without feedback.
    pub missed: u64,
}

impl Default for JointTally {
    fn default() -> Self {
        Self {
            lowest_rad: f64::INFINITY,
            highest_rad: f64::NEG_INFINITY,
            squared_error_rad2: 0.0,
            samples: 0,
            missed: 0,
        }
    }
}

impl JointTally {
    /// Root mean square of goal minus present, rad; `None` before the first sample.
    #[must_use]
    pub fn tracking_rms_rad(&self) -> Option<f64> {
        (self.samples > 0).then(|| (self.squared_error_rad2 / self.samples as f64).sqrt())
    }
}

/// What was measured of the whole robot.
#[derive(Clone, Debug, Default)]
pub struct Tally {
    /// Per joint, in the robot's order.
    pub joints: Vec<JointTally>,
    /// Cycles run.
    pub cycles: u64,
    /// Cycles in which the feedback of a joint was missing, or that were skipped altogether.
    pub missed_cycles: u64,
    /// Cycles that began late or took longer than the period.
    pub late_cycles: u64,
    /// Highest temperature, degrees Celsius.
    pub max_temperature_c: Option<f64>,
    /// Lowest supply voltage, V.
    pub min_voltage_v: Option<f64>,
    /// Highest current of a servo, A.
    pub max_current_a: Option<f64>,
}

fn widen(slot: &mut Option<f64>, value: Option<f64>, choose: fn(f64, f64) -> f64) {
    if let Some(value) = value {
        *slot = Some(slot.map_or(value, |old| choose(old, value)));
    }
}

impl Tally {
    /// An empty tally for `joints` joints.
    #[must_use]
    pub fn new(joints: usize) -> Self {
        Self { joints: vec![JointTally::default(); joints], ..Self::default() }
    }

    /// Adds a cycle.
    pub fn add(&mut self, sample: &Sample<'_>) {
        self.cycles += 1;
        let mut complete = true;
        for (index, (joint, state)) in self.joints.iter_mut().zip(sample.states).enumerate() {
            let state = match state {
                Ok((state, _)) => state,
                Err(Miss::NotAsked) => continue,
                Err(_) => {
                    joint.missed += 1;
                    complete = false;
                    continue;
                }
            };
            joint.lowest_rad = joint.lowest_rad.min(state.position_rad);
            joint.highest_rad = joint.highest_rad.max(state.position_rad);
            joint.squared_error_rad2 += (sample.goal_rad[index] - state.position_rad).powi(2);
            joint.samples += 1;
            widen(&mut self.max_current_a, state.current_a.map(f64::abs), f64::max);
            widen(&mut self.max_temperature_c, state.temperature_c, f64::max);
            widen(&mut self.min_voltage_v, state.voltage_v, f64::min);
        }
        if let Some((_, health)) = &sample.health {
            widen(&mut self.max_temperature_c, health.temperature_c, f64::max);
            widen(&mut self.min_voltage_v, health.voltage_v, f64::min);
        }
        self.missed_cycles += u64::from(!complete);
    }
}
