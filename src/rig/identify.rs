//! Which device answers at an ID: protocol, model and firmware, by asking and by the profiles.

mod can;

pub use can::{CanIdentity, can_ask_error, describe, dialect_of, is_likely};

use super::serial_line::OpenLine;
use crate::bus::{AskError, Miss, Protocol};
use crate::device::Model;
use crate::error::{Error, ErrorKind};
use crate::robot::preflight::host_late;
use crate::time::Duration;
use gaitway_profiles::{self as profiles, Board, Dialect, Servo};

/// What one device said of itself.
#[derive(Clone, Copy, Debug)]
pub struct Identity {
    /// Bus ID.
    pub id: u8,
    /// What it speaks.
    pub protocol: Protocol,
    /// What it calls its model.
    pub model_number: u16,
    /// Firmware; Feetech's `major.minor` as `major * 256 + minor`.
    pub firmware: u16,
    /// Its profile, if there is one.
    pub profile: Option<&'static Servo>,
}

/// The name of a dialect as it is typed and written in profiles.
#[must_use]
pub const fn dialect_name(dialect: Dialect) -> &'static str {
    match dialect {
        Dialect::Damiao => "damiao",
        Dialect::Robstride => "robstride",
        Dialect::Odrive => "odrive",
        Dialect::Moteus => "moteus",
        Dialect::CubemarsMit => "cubemars-mit",
        Dialect::CubemarsServo => "cubemars-servo",
        Dialect::Recoil => "recoil",
    }
}

/// The name of a protocol as it is typed and written in profiles.
#[must_use]
pub fn protocol_name(protocol: Protocol) -> &'static str {
    match protocol {
        Protocol::Dynamixel1 => "dynamixel-1.0",
        Protocol::Dynamixel2 => "dynamixel-2.0",
        Protocol::FeetechSts => "feetech-sts",
        Protocol::FeetechScs => "feetech-scs",
    }
}

/// Every shipped servo profile.
pub fn all_servos() -> impl Iterator<Item = &'static Servo> {
    profiles::servo_names().filter_map(|name| profiles::servo(name).ok())
}

/// The board with this model number, if one is known.
#[must_use]
pub fn board_of(protocol: Protocol, model_number: u16) -> Option<Board> {
    let known = |name| profiles::board(name).ok();
    let of = |board: &Board| {
        // No board speaks anything else: see the validator.
        board.model_number == model_number && protocol == Protocol::Dynamixel2
    };
    profiles::board_names().filter_map(known).find(of)
}

/// The profile of a model.
#[must_use]
pub fn profile_of(protocol: Protocol, model_number: u16) -> Option<&'static Servo> {
    all_servos().find(|servo| {
        servo.model_number == model_number && Model::new(servo).protocol() == protocol
    })
}

/// The first 6 bytes of a control table of the 1.0 packet: who and what.
const WHO: u16 = 6;

/// Asks who is at `id`, in `wanted` or in every protocol. Nothing is written.
///
/// # Errors
/// A line that failed, or answers that nobody can read: damaged ones, another ID's.
pub fn identify(
    line: &mut OpenLine,
    id: u8,
    wanted: Option<Protocol>,
) -> Result<Option<Identity>, AskError> {
    if wanted.is_none_or(|wanted| wanted == Protocol::Dynamixel2)
        && let Some(identity) = identify_dynamixel2(line, id)?
    {
        return Ok(Some(identity));
    }
    if wanted == Some(Protocol::Dynamixel2) {
        return Ok(None);
    }
    // All others share one packet; the control tables tell them apart.
    let budget = line.budget();
    let asked = line.bus.read(Protocol::Dynamixel1, id, 0, WHO, budget);
    let Some(reply) = heard(asked)? else { return Ok(None) };
    let identity = from_table(id, &reply);
    Ok(identity.filter(|found| wanted.is_none_or(|wanted| wanted == found.protocol)))
}

fn identify_dynamixel2(line: &mut OpenLine, id: u8) -> Result<Option<Identity>, AskError> {
    let protocol = Protocol::Dynamixel2;
    if id > profiles::Protocol::Dynamixel2.highest_id() {
        return Ok(None);
    }
    let budget = line.budget();
    let Some(said) = heard(line.bus.ping(protocol, id, budget))? else { return Ok(None) };
    let [low, high, firmware] = said[..] else { return Ok(None) };
    let model_number = u16::from_le_bytes([low, high]);
    let profile = profile_of(protocol, model_number);
    Ok(Some(Identity { id, protocol, model_number, firmware: firmware.into(), profile }))
}

/// The bytes of an answer; nothing if nobody answered.
fn heard(asked: Result<crate::bus::Reply, AskError>) -> Result<Option<Vec<u8>>, AskError> {
    match asked {
        Ok(reply) => Ok(Some(reply.bytes)),
        Err(AskError::Miss(Miss::Silent)) => Ok(None),
        Err(error) => Err(error),
    }
}

/// The table begins with model, firmware, ID (Dynamixel), or with firmware, byte order, model, ID
/// (Feetech). A known model number decides; else the place where the ID stands.
fn from_table(id: u8, table: &[u8]) -> Option<Identity> {
    let &[b0, b1, b2, b3, b4, b5] = table else { return None };
    let of = |protocol, model_number, firmware| Identity {
        id,
        protocol,
        model_number,
        firmware,
        profile: profile_of(protocol, model_number),
    };
    let version = u16::from_be_bytes([b0, b1]);
    let sts = of(Protocol::FeetechSts, u16::from_le_bytes([b3, b4]), version);
    let scs = of(Protocol::FeetechScs, u16::from_be_bytes([b3, b4]), version);
    let dynamixel = of(Protocol::Dynamixel1, u16::from_le_bytes([b0, b1]), b2.into());
    let by_place = [(b5 == id, sts), (b5 == id, scs), (b3 == id, dynamixel)];
    let mut likely = by_place.iter().filter(|(at_its_place, _)| *at_its_place).map(|(_, of)| *of);
    let known = likely.clone().find(|identity| identity.profile.is_some());
    // Byte 2 of a Feetech servo says its byte order; 0 is little-endian.
    known.or_else(|| likely.find(|of| of.protocol != Protocol::FeetechSts || b2 == 0))
}

/// Words for a question that was not answered by the device at `id`.
#[must_use]
pub fn ask_error(place: String, error: &AskError) -> Error {
    match error {
        AskError::Miss(Miss::Silent) => Error::of(ErrorKind::Silent, "no device answers")
            .at(place)
            .got("nothing")
            .remedy("check power, cable and ID; `gaitway scan BUS --baud all` looks everywhere"),
        AskError::Miss(Miss::Garbled) => Error::of(ErrorKind::Damaged, "the answers are damaged")
            .at(place)
            .got("packets that fail their checksum")
            .remedy("two devices may have this ID, or the line speed is wrong: unplug all but one"),
        AskError::Miss(Miss::Refused(why)) => {
            Error::of(ErrorKind::Damaged, "the device refused").at(place).got(why.clone())
        }
        AskError::Miss(Miss::HostLate { by_ms }) => host_late(place, Duration::from_millis(*by_ms)),
        AskError::Miss(miss) => {
            Error::of(ErrorKind::Damaged, "a wrong answer").at(place).got(miss.to_string())
        }
        AskError::Port(error) => {
            Error::of(ErrorKind::Damaged, "the line failed").at(place).got(error.to_string())
        }
        AskError::Unsayable(text) => Error::new(text.clone()).at(place),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_three_kinds_of_tables_are_told_apart() {
        // STS3215: firmware 3.10, little-endian, model bytes 9 and 3, ID (lerobot, tables.py).
        let sts = from_table(20, &[3, 10, 0, 9, 3, 20]).expect("a servo");
        assert_eq!((sts.protocol, sts.model_number), (Protocol::FeetechSts, 777));
        assert_eq!(sts.firmware, 3 * 256 + 10);
        assert_eq!(sts.profile.map(|p| p.name.as_str()), Some("sts3215"));
        // AX-12A: model 12, firmware 24, ID, 1 Mbit/s, 500 us (ROBOTIS e-manual).
        let ax = from_table(7, &[12, 0, 24, 7, 1, 250]).expect("a servo");
        assert_eq!((ax.protocol, ax.model_number, ax.firmware), (Protocol::Dynamixel1, 12, 24));
        // SCS0009 sends words big-endian: bytes 5 and 4 are model 1284.
        let scs = from_table(1, &[5, 4, 1, 5, 4, 1]).expect("a servo");
        assert_eq!((scs.protocol, scs.model_number), (Protocol::FeetechScs, 1284));
    }

    #[test]
    fn a_host_that_was_late_is_named_and_no_device() {
        let late = AskError::Miss(Miss::HostLate { by_ms: 2100 });
        let said = ask_error("ID 3 on sim".to_owned(), &late).to_string();
        assert!(said.contains("this host is too late") && said.contains("2100 ms"), "{said}");
        assert!(!said.contains("device") && !said.contains("cable"), "{said}");
    }

    #[test]
    fn a_table_without_the_id_is_nobody() {
        assert!(from_table(3, &[0; 6]).is_none());
        assert!(from_table(3, &[3, 10, 0]).is_none());
    }
}
