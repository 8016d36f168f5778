//! The loop: state in, checked command out, at a steady rate, until the motion is at rest.

pub mod arm;
pub mod balance;
pub mod cycle;
pub mod flight;
pub mod health;
pub(crate) mod inject;
pub mod leash;
pub mod left;
pub mod mirror;
pub mod net;
pub mod plausible;
pub mod silence;
pub mod supervise;
pub mod tally;
#[cfg(test)]
mod testing;
pub mod watchdog;

pub use arm::{Armed, Arming};
pub use balance::{BalanceFigures, Balanced, Balancer};
pub use cycle::{Exception, Motion, Planned, Run, Settings, run, stream};
pub use flight::FlightCycle;
pub use health::{Stop, StopCode, StopReason};
pub use left::Left;
pub use mirror::{Input, Mirror};
pub use supervise::{Performance, arm_safely, perform};
pub use tally::{JointTally, Tally};

use crate::bus::Miss;
use crate::device::{Health, JointState};
use crate::time::Instant;

/// What one cycle commanded and measured, handed to whoever records.
#[derive(Clone, Debug)]
pub struct Sample<'a> {
    /// Cycle number from 0.
    pub cycle: u64,
    /// When the states were read, on the link's clock.
    pub at: Instant,
    /// Goal in effect while the states were read, joint angles, rad.
    pub goal_rad: &'a [f64],
    /// Where the motion wanted the joints then, rad: elsewhere only while a goal is held back near a
    /// joint that does not follow.
    pub wanted_rad: &'a [f64],
    /// Speed of those goals along the motion, rad/s.
    pub goal_velocity_rad_s: &'a [f64],
    /// Measured states, or why there is none.
    pub states: &'a [Result<(JointState, bool), Miss>],
    /// Slow facts read in this cycle: joint index and what was read.
    pub health: Option<(usize, Health)>,
}

/// Takes what each cycle commanded and measured. Must never wait.
pub trait Sink {
    /// One cycle.
    fn take(&mut self, sample: &Sample<'_>);
}
