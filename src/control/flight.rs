//! The last cycles of a run, for whoever asks what happened.

use super::Sample;
use crate::bus::Miss;
use crate::device::JointState;
use std::collections::VecDeque;

/// Cycles that are kept.
const KEPT: usize = 50;

/// One cycle as it was: goals and readings of all joints, in the robot's order.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct FlightCycle {
    /// Cycle number from 0.
    pub cycle: u64,
    /// Time of the cycle on the link's clock, s.
    pub at_s: f64,
    /// Goals in effect, rad.
    pub goal_rad: Vec<f64>,
    /// Where the motion wanted the joints, rad; differs from the goal where that was held back.
    pub wanted_rad: Vec<f64>,
    /// Measured angles, rad; null where none was read.
    pub present_rad: Vec<Option<f64>>,
    /// Why there is none, by joint, where it was asked.
    pub missed: Vec<Option<String>>,
}

/// The newest cycles of a run.
#[derive(Debug, Default)]
pub struct Flight(VecDeque<FlightCycle>);

impl Flight {
    /// Adds a cycle; the oldest beyond fifty goes.
    pub fn take(&mut self, sample: &Sample<'_>) {
        if self.0.len() == KEPT {
            self.0.pop_front();
        }
        let present = |state: &Result<(JointState, bool), Miss>| {
            state.as_ref().ok().map(|(state, _)| state.position_rad)
        };
        let missed = |state: &Result<(JointState, bool), Miss>| {
            let miss = state.as_ref().err().filter(|miss| **miss != Miss::NotAsked);
            miss.map(ToString::to_string)
        };
        self.0.push_back(FlightCycle {
            cycle: sample.cycle,
            at_s: sample.at.as_nanos() as f64 * 1e-9,
            goal_rad: sample.goal_rad.to_vec(),
            wanted_rad: sample.wanted_rad.to_vec(),
            present_rad: sample.states.iter().map(present).collect(),
            missed: sample.states.iter().map(missed).collect(),
        });
    }

    /// The cycles, oldest first.
    #[must_use]
    pub fn into_cycles(self) -> Vec<FlightCycle> {
        self.0.into()
    }
}
