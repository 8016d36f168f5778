//! Protocols of serial lines and dialects of CAN lines, as a person types them.

use crate::error::Error;
use crate::job::servo::Protocol;
use clap::ValueEnum;
use gaitway_profiles::Dialect;

/// Protocols as they are typed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ProtocolName {
    /// DYNAMIXEL Protocol 1.0
    #[value(name = "dynamixel-1.0")]
    Dynamixel1,
    /// DYNAMIXEL Protocol 2.0
    #[value(name = "dynamixel-2.0")]
    Dynamixel2,
    /// FEETECH STS and SMS
    #[value(name = "feetech-sts")]
    FeetechSts,
    /// FEETECH SCS
    #[value(name = "feetech-scs")]
    FeetechScs,
    /// Damiao DM, CAN
    #[value(name = "damiao")]
    Damiao,
    /// CyberGear and RobStride in the makers' own protocol, CAN
    #[value(name = "robstride")]
    Robstride,
    /// ODrive, CAN Simple
    #[value(name = "odrive")]
    Odrive,
    /// mjbots moteus, CAN FD
    #[value(name = "moteus")]
    Moteus,
    /// CubeMars (T-Motor) AK in MIT mode, CAN
    #[value(name = "cubemars-mit")]
    CubemarsMit,
    /// CubeMars (T-Motor) AK in servo mode, CAN
    #[value(name = "cubemars-servo")]
    CubemarsServo,
    /// Recoil, of Berkeley Humanoid Lite, CAN
    #[value(name = "recoil")]
    Recoil,
}

impl ProtocolName {
    /// The protocol of a serial line, if it is one.
    #[must_use]
    pub const fn serial(self) -> Option<Protocol> {
        Some(match self {
            Self::Dynamixel1 => Protocol::Dynamixel1,
            Self::Dynamixel2 => Protocol::Dynamixel2,
            Self::FeetechSts => Protocol::FeetechSts,
            Self::FeetechScs => Protocol::FeetechScs,
            _ => return None,
        })
    }

    /// The dialect of a CAN line, if it is one.
    #[must_use]
    pub const fn dialect(self) -> Option<Dialect> {
        Some(match self {
            Self::Damiao => Dialect::Damiao,
            Self::Robstride => Dialect::Robstride,
            Self::Odrive => Dialect::Odrive,
            Self::Moteus => Dialect::Moteus,
            Self::CubemarsMit => Dialect::CubemarsMit,
            Self::CubemarsServo => Dialect::CubemarsServo,
            Self::Recoil => Dialect::Recoil,
            _ => return None,
        })
    }
}

/// The serial protocol that was asked for, if any was.
///
/// # Errors
/// A dialect of CAN lines, on a serial line.
pub fn serial_protocol(
    name: Option<ProtocolName>,
    place: &dyn std::fmt::Display,
) -> Result<Option<Protocol>, Error> {
    let Some(name) = name else { return Ok(None) };
    name.serial().map(Some).ok_or_else(|| {
        Error::new("this protocol is for CAN lines only")
            .at(place.to_string())
            .got(name.to_possible_value().map_or_else(String::new, |v| v.get_name().to_owned()))
            .allowed("dynamixel-1.0, dynamixel-2.0, feetech-sts, feetech-scs")
            .remedy("a CAN line is can:can0, or sim with a robot on CAN")
    })
}

/// The dialect that was asked for, if any was.
///
/// # Errors
/// A protocol of serial lines, on a CAN line.
pub fn can_dialect(
    name: Option<ProtocolName>,
    place: &dyn std::fmt::Display,
) -> Result<Option<Dialect>, Error> {
    let Some(name) = name else { return Ok(None) };
    name.dialect().map(Some).ok_or_else(|| {
        Error::new("this protocol is for serial lines only")
            .at(place.to_string())
            .got(name.to_possible_value().map_or_else(String::new, |v| v.get_name().to_owned()))
            .allowed("damiao, robstride, odrive, moteus, cubemars-mit, cubemars-servo, recoil")
    })
}
