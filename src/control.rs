//! The loop: state in, checked command out, at a steady rate, until the motion is at rest.

pub mod arm;
pub mod cycle;
pub mod health;
pub mod mirror;
pub mod plausible;
pub mod tally;
pub mod watchdog;

pub use cycle::{Motion, Run, Settings, run, stream};
pub use health::StopReason;
pub use mirror::{Input, Mirror};
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
