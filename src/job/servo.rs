//! One servo of a serial line, or one actuator of a CAN line: its registers, what it is found by, and one
//! movement.

pub mod actuator;
pub mod change;
pub mod device;
#[cfg(test)]
mod lock_tests;
pub mod register;
pub mod set_up;
pub mod travel;
pub mod value;

use crate::error::Error;
use crate::rig::{Address, is_can};
use gaitway_profiles::{Dialect, Role};

pub use crate::bus::Protocol;

/// Where nothing moves, a lost answer costs nothing but time.
pub const RETRIES: u32 = 5;

/// What decides where a goal leads, and what preflight is asked to look at, as it is now in a servo.
pub const DECIDING: [Role; 8] = [
    Role::DriveMode,
    Role::HomingOffset,
    Role::OperatingMode,
    Role::MinPositionLimit,
    Role::MaxPositionLimit,
    Role::ReturnDelay,
    Role::TemperatureLimit,
    Role::MinVoltageLimit,
];

/// Which servo is meant, and how it is spoken to.
#[derive(Clone, Debug, PartialEq)]
pub struct Which {
    /// Where its line is.
    pub bus: Address,
    /// Its ID.
    pub id: u8,
    /// The robot whose line this is: says the line speed, and which robot a virtual one is.
    pub robot: Option<String>,
    /// Its model, whatever it says; `None`: by its model number.
    pub model: Option<String>,
    /// The protocol of its serial line; `None`: all are tried.
    pub protocol: Option<Protocol>,
    /// What it speaks on its CAN line; `None`: all are tried that move nothing.
    pub dialect: Option<Dialect>,
}

impl Which {
    /// What else has to be typed to reach the same line again.
    #[must_use]
    pub fn again(&self) -> String {
        self.robot.as_ref().map(|robot| format!(" --robot {robot}")).unwrap_or_default()
    }

    /// True if the line is a CAN line.
    ///
    /// # Errors
    /// An unknown robot.
    pub fn is_can(&self) -> Result<bool, Error> {
        is_can(&self.bus, self.robot.as_deref())
    }
}
