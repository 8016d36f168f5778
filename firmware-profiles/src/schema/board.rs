//! Boards that answer on a serial line among servos and turn nothing.

use super::{Baud, FirmwareRange, Protocol, Register};
use serde::Deserialize;

/// A board with a control table and an inertial sensor in it.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Board {
    /// Version of this file format; 1.
    pub schema: u32,
    /// The file's own name.
    pub name: String,
    /// What is printed on it, and what it runs.
    pub model: String,
    /// Who makes it.
    pub maker: String,
    /// The protocol it speaks.
    pub protocol: Protocol,
    /// What it answers when asked for its model.
    pub model_number: u16,
    /// The firmware range this file was checked against.
    pub firmware: FirmwareRange,
    /// Address of the maker's manual.
    pub manual: String,
    /// Line speeds by the value of the baud register.
    pub baud: Vec<Baud>,
    /// Where its inertial sensor is in the table.
    pub imu: BoardImu,
    /// The control table, complete, in order of address.
    #[serde(rename = "register")]
    pub registers: Vec<Register>,
}

/// A gyroscope and an accelerometer in a control table: three signed words each, X, Y and Z, one after the other.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BoardImu {
    /// Address of the angular velocity about X.
    pub gyroscope: u16,
    /// One count of it, deg/s.
    pub gyroscope_deg_s: f64,
    /// Address of the acceleration along X: what lies still has one g upwards.
    pub accelerometer: u16,
    /// One count of it, g.
    pub accelerometer_g: f64,
    /// Where it is written.
    pub source: String,
}

impl Board {
    /// Length of the control table in bytes.
    #[must_use]
    pub fn table_len(&self) -> u16 {
        let ends = self.registers.iter().map(|of| of.address + u16::from(of.bytes));
        ends.max().unwrap_or(0)
    }
}
