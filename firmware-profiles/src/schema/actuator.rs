//! The types of an actuator's file: a motor with its own drive on a CAN line.

use serde::Deserialize;

/// One actuator model: which dialect it speaks and what its numbers mean.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Actuator {
    /// Version of this file format; 1.
    pub schema: u32,
    /// The file's own name, `[a-z0-9-]+`.
    pub name: String,
    /// The name on the label, e.g. `DM-J4310-2EC`.
    pub model: String,
    /// Who makes it.
    pub maker: String,
    /// The language it speaks.
    pub dialect: Dialect,
    /// Bit rates and identifiers.
    pub line: CanLine,
    /// What its coded numbers stand for. Present for exactly the dialects that code numbers.
    #[serde(default)]
    pub ranges: Option<Ranges>,
    /// What it does when the host falls silent.
    pub timeout: Timeout,
    /// Motor and gear, where known.
    #[serde(default)]
    pub gear: Option<Gear>,
    /// Where the file's facts are written, but for those with a source of their own.
    pub source: String,
}

/// Languages of CAN actuators.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Hash)]
#[serde(rename_all = "kebab-case")]
pub enum Dialect {
    /// CubeMars (T-Motor) AK in MIT mode.
    CubemarsMit,
    /// CubeMars (T-Motor) AK in servo mode.
    CubemarsServo,
    /// Damiao DM.
    Damiao,
    /// CyberGear and RobStride, the makers' own protocol.
    Robstride,
    /// ODrive, CAN Simple.
    Odrive,
    /// mjbots moteus, CAN FD.
    Moteus,
    /// Recoil, the motor controller of Berkeley Humanoid Lite.
    Recoil,
}

impl Dialect {
    /// True if numbers travel as steps on a range that belongs to the model.
    #[must_use]
    pub const fn codes_numbers(self) -> bool {
        matches!(self, Self::CubemarsMit | Self::Damiao | Self::Robstride)
    }

    /// True if its frames are those of CAN FD.
    #[must_use]
    pub const fn is_fd(self) -> bool {
        matches!(self, Self::Moteus)
    }

    /// True if its frames have identifiers of 11 bits, or may have (moteus); else they have 29. A
    /// dialect with identifiers of the same kind on the line would take some of them for its own.
    #[must_use]
    pub const fn has_short_ids(self) -> bool {
        !matches!(self, Self::CubemarsServo | Self::Robstride)
    }

    /// The largest id the dialect has room for.
    #[must_use]
    pub const fn last_id(self) -> u8 {
        match self {
            Self::CubemarsMit | Self::CubemarsServo | Self::Damiao => 255,
            Self::Robstride => 254,
            Self::Odrive => 63,
            Self::Moteus | Self::Recoil => 127,
        }
    }

    /// True if speeds are electrical, so that they mean something with the pole pairs only.
    #[must_use]
    pub const fn electrical_speed(self) -> bool {
        matches!(self, Self::CubemarsServo)
    }
}

/// How an actuator sits on a line.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CanLine {
    /// Bit rates it can be set to, bit/s; as it leaves the factory first.
    pub bitrates_bps: Vec<u32>,
    /// Bit rates of the payload of CAN FD frames, likewise; empty without CAN FD.
    #[serde(default)]
    pub data_bitrates_bps: Vec<u32>,
    /// Lowest id to be given.
    pub first_id: u8,
    /// Highest id to be given.
    pub last_id: u8,
    /// The id it leaves the factory with, where known.
    #[serde(default)]
    pub factory_id: Option<u8>,
}

/// What the ends of coded numbers stand for. Position, velocity and torque reach as far below zero
/// as above it; gains begin at zero.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ranges {
    /// Position, rad.
    pub position_rad: f64,
    /// Velocity, rad/s.
    pub velocity_rad_s: f64,
    /// Torque, N m.
    pub torque_nm: f64,
    /// Gain on the error of position, N m/rad.
    pub kp_nm_rad: f64,
    /// Gain on the error of velocity, N m s/rad.
    pub kd_nm_s_rad: f64,
    /// The device keeps position, velocity and torque in registers, which tell the truth.
    #[serde(default)]
    pub readable: bool,
    /// Where it is written.
    pub source: String,
}

/// What an actuator does when the host falls silent.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Timeout {
    /// How it is set.
    pub kind: TimeoutKind,
    /// What one step of the setting is, s. Present for a register of whole numbers.
    #[serde(default)]
    pub step_s: Option<f64>,
    /// The silence it allows as it leaves the factory, s; absent if it allows any.
    #[serde(default)]
    pub factory_s: Option<f64>,
    /// What it does then, and where it is set, for a person.
    pub action: String,
    /// Where it is written.
    pub source: String,
}

/// How a silent host is told of.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Hash)]
#[serde(rename_all = "kebab-case")]
pub enum TimeoutKind {
    /// A setting in the device, which the driver can write over the line.
    Register,
    /// A setting in the device, to be made beforehand with the maker's tool.
    Configured,
    /// None that is known: a motion of torque or gains must not be played.
    None,
}

/// Motor and gear.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Gear {
    /// Turns of the rotor in one of the output.
    pub ratio: f64,
    /// Electrical turns in one of the rotor. Present for exactly the dialects that tell electrical
    /// speeds.
    #[serde(default)]
    pub pole_pairs: Option<u8>,
    /// Where it is written.
    pub source: String,
}
