//! What a motion on a robot's joints does to all of the robot: where its base goes while its soles stand,
//! whether it touches itself, stays on its feet, and how near it is to the person it follows.
//!
//! The joints come from elsewhere ([`crate::mocap::retarget`], a table, a recording). Everything here is
//! geometry and mechanics of the body in the robot's file. Only [`adjust`] moves joints: as little as a robot needs
//! that is not to be in itself, whose feet are to stand and whose weight is to be over them.

pub mod adjust;
pub mod balance;
pub mod base;
pub mod collision;
pub mod effort;
pub mod fall;
pub mod figures;
pub mod footfall;
pub mod gait;
pub mod limbs;
pub mod steps;
pub mod toe;

pub use effort::PeakEffort;
pub use figures::{BodyFigures, DirectionErrors, PaceNeed, SlowStretch, TimeSpan};
pub use footfall::Footfall;
