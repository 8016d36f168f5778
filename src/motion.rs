//! Time-stamped joint motion: mathematics only. No clock, no device, no file.
//!
//! The way of a motion through this module: a [`Path`] is joint positions over time as a person or
//! a file gave them. [`plan()`] stretches it in time until the robot's [`JointLimits`] hold
//! ([`retime`]), leads up to it from where the robot stands, eases it in and out, and returns a
//! [`Trajectory`]. A [`Trajectory`] that exists is valid: finite, inside its limits everywhere (not
//! only at samples), twice continuously differentiable, at rest at both ends. While it plays, a
//! [`Clock`] can be told to stop: the motion then slows down along its own path.
//!
//! Angles are rad, times s. A joint is a row: positions are indexed `[joint][sample]`.

pub mod ease;
pub mod follow;
pub mod limits;
pub mod path;
pub mod plan;
pub mod retime;
pub mod saturate;
pub mod smooth;
pub mod spline;
pub mod stop;
pub mod tempo;
pub mod trajectory;
pub mod trend;

pub use follow::{Chase, FollowTally, Follower, Target};
pub use limits::JointLimits;
pub use path::Path;
pub use plan::{Plan, PlanOptions, plan};
pub use retime::{Because, Retimed};
pub use saturate::saturate;
pub use smooth::low_pass;
pub use spline::{End, Extreme, Extremes, Spline};
pub use stop::Clock;
pub use trajectory::{Setpoint, Trajectory};
pub use trend::Trend;
