//! A robot, or a line, opened wherever it is: real, in virtual time, or behind a terminal of this
//! process; and who answers there. Knows no motion.

mod address;
mod calibrated;
mod can_line;
mod connect;
mod identify;
mod own_profiles;
mod same_device;
mod serial_line;
mod slcan;
mod virtual_robot;
mod wire;

pub use address::{Address, BusKind};
pub use calibrated::calibrated;
pub use can_line::{OpenCanLine, is_can, open_can};
#[cfg(test)]
pub use connect::mounted_otherwise;
pub use connect::{Connection, connect, patience_words};
pub use identify::{
    CanIdentity, Identity, all_servos, ask_error, board_of, can_ask_error, describe, dialect_name,
    dialect_of, identify, is_likely, profile_of, protocol_name,
};
pub use own_profiles::own_profiles;
pub use same_device::SameDevice;
pub use serial_line::{OpenLine, USUAL_BAUD_BPS, open_bus};
pub use wire::open_stream;
