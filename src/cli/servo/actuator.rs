//! `servo` for an actuator of a CAN line.

mod change;
mod settings;

pub use change::{reboot, refuse, set_id};
pub use settings::{get, info, set};
