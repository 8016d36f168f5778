//! One device of a CAN line, by how it is spoken to: questions for its numbered settings, and what
//! its answers hold.

use crate::wire::can::moteus::{self, Message, Part, Resolution, Route};
use crate::wire::can::{CanFrame, Number, cubemars, damiao, odrive, recoil, robstride};
use std::fmt;

/// A device, its dialect, and its place in that.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Peer {
    /// Damiao.
    Damiao {
        /// The id it listens to.
        id: damiao::Id,
        /// The identifier it answers under.
        answer_id: u16,
    },
    /// CyberGear or RobStride, the makers' own protocol.
    Robstride {
        /// Its id.
        id: robstride::Id,
        /// The host it answers.
        host: robstride::Id,
    },
    /// ODrive. A setting is half a message: `message << 1 | half`.
    Odrive {
        /// Its node.
        id: odrive::Id,
    },
    /// moteus.
    Moteus {
        /// Its id.
        id: moteus::Id,
        /// The host it answers.
        host: moteus::Id,
    },
    /// Recoil.
    Recoil {
        /// Its id.
        id: recoil::Id,
    },
    /// CubeMars in MIT mode: it has no settings.
    CubemarsMit {
        /// Its id.
        id: cubemars::Id,
    },
    /// CubeMars in servo mode: it has no settings.
    CubemarsServo {
        /// Its id.
        id: cubemars::Id,
    },
}

/// How a setting travels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// A whole number.
    Whole,
    /// An `f32`.
    Float,
}

/// The device has no such setting, and says so.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NoSuchSetting;

impl Peer {
    /// Its id.
    #[must_use]
    pub const fn id(&self) -> u8 {
        match self {
            Self::Damiao { id, .. } => id.get(),
            Self::Robstride { id, .. } => id.get(),
            Self::Odrive { id } => id.get(),
            Self::Moteus { id, .. } => id.get(),
            Self::Recoil { id } => id.get(),
            Self::CubemarsMit { id } | Self::CubemarsServo { id } => id.get(),
        }
    }

    /// The question for setting `number`. None if the dialect has none for it.
    #[must_use]
    pub fn ask(&self, number: u16, form: Form) -> Option<CanFrame> {
        Some(match *self {
            Self::Damiao { id, .. } => {
                damiao::request(id, damiao::Request::Read(u8::try_from(number).ok()?))
            }
            Self::Robstride { id, host } => {
                robstride::command(host, id, robstride::Command::Read(number))
            }
            Self::Odrive { id } => odrive::question(id, u8::try_from(number >> 1).ok()?),
            Self::Moteus { id, host } => {
                let resolution = match form {
                    Form::Whole => Resolution::Int32,
                    Form::Float => Resolution::Float,
                };
                let mut message = Message::default();
                message.read(resolution, number, 1).ok()?;
                message.frame(Route { source: host, destination: id, reply: true, fast: true })
            }
            Self::Recoil { id } => recoil::command(id, recoil::Command::Read(number)),
            Self::CubemarsMit { .. } | Self::CubemarsServo { .. } => return None,
        })
    }

    /// The bits of setting `number` if `frame` is this device's answer to the question for it.
    #[must_use]
    pub fn value(&self, number: u16, frame: &CanFrame) -> Option<Result<u32, NoSuchSetting>> {
        match *self {
            Self::Damiao { id, answer_id } => {
                let register = u8::try_from(number).ok()?;
                damiao::register_value(id, answer_id, register, frame).map(Ok)
            }
            Self::Robstride { id, .. } => match robstride::message(frame)? {
                (from, robstride::Message::Parameter(index, bits)) => {
                    (from == id && index == number).then_some(Ok(bits))
                }
                (from, robstride::Message::NoParameter(index)) => {
                    (from == id && index == number).then_some(Err(NoSuchSetting))
                }
                _ => None,
            },
            Self::Odrive { id } => {
                let words = odrive::words(id, u8::try_from(number >> 1).ok()?, frame)?;
                Some(Ok(words[usize::from(number & 1)]))
            }
            Self::Moteus { id, host } => moteus_value(id, host, number, frame),
            Self::Recoil { id } => match recoil::message(frame)? {
                (from, recoil::Message::Parameter(bits)) => (from == id).then_some(Ok(bits)),
                _ => None,
            },
            Self::CubemarsMit { .. } | Self::CubemarsServo { .. } => None,
        }
    }

    /// The frame that writes a setting until power-off. None where settings are not written so: all
    /// that moteus takes over the line are goals. Only the table of
    /// settings in `device`, which knows which numbers are goals, may ask for it.
    pub(crate) fn write(&self, number: u16, bits: u32) -> Option<CanFrame> {
        Some(match *self {
            Self::Damiao { id, .. } => {
                damiao::request(id, damiao::Request::Write(u8::try_from(number).ok()?, bits))
            }
            Self::Robstride { id, host } => {
                robstride::command(host, id, robstride::Command::Write(number, bits))
            }
            Self::Recoil { id } => recoil::command(id, recoil::Command::Write(number, bits)),
            Self::Odrive { .. }
            | Self::Moteus { .. }
            | Self::CubemarsMit { .. }
            | Self::CubemarsServo { .. } => return None,
        })
    }

    /// The frame after which it keeps its settings over power-off, if its dialect has one.
    #[must_use]
    pub fn save(&self) -> Option<CanFrame> {
        match *self {
            Self::Damiao { id, .. } => Some(damiao::request(id, damiao::Request::Save)),
            Self::Robstride { id, host } => {
                Some(robstride::command(host, id, robstride::Command::Save))
            }
            Self::Recoil { id } => Some(recoil::command(id, recoil::Command::Save)),
            _ => None,
        }
    }
}

fn moteus_value(
    id: moteus::Id,
    host: moteus::Id,
    number: u16,
    frame: &CanFrame,
) -> Option<Result<u32, NoSuchSetting>> {
    if moteus::ends(frame)? != (id, host) {
        return None;
    }
    moteus::parts(frame.payload()).find_map(|part| match part {
        Part::Value(register, value) if register == u32::from(number) => match value {
            Some(Number::Steps(steps)) => Some(Ok(steps.cast_unsigned())),
            Some(Number::Value(value)) => Some(Ok(value.to_bits())),
            // The smallest whole number: it has none to tell.
            Some(Number::Code { .. }) | None => Some(Ok(f32::NAN.to_bits())),
        },
        Part::Refused(register, _) if register == u32::from(number) => Some(Err(NoSuchSetting)),
        _ => None,
    })
}

impl fmt::Display for Peer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "ID {}", self.id())?;
        match self {
            Self::Damiao { answer_id, .. } => write!(f, ", answers under 0x{answer_id:X}"),
            _ => Ok(()),
        }
    }
}
