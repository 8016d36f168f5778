//! Who a CAN actuator is: model, firmware and serial number, as far as it says.

use crate::bus::can::scan::Found;
use crate::bus::can::{Form, Peer};
use crate::bus::{AskError, Miss};
use crate::error::{Error, ErrorKind};
use crate::port::PortError;
use crate::rig::OpenCanLine;
use crate::time::Duration;
use crate::wire::can::Faults;
use gaitway_profiles::{self as profiles, Actuator, Dialect};

/// What one actuator said of itself.
#[derive(Clone, Debug)]
pub struct CanIdentity {
    /// Its place on the line.
    pub peer: Peer,
    /// It was heard without being asked.
    pub unasked: bool,
    /// Profiles it may be of, by what it says; empty if it says nothing of that.
    pub candidates: Vec<Actuator>,
    /// Its hardware, as it calls it.
    pub hardware: Option<String>,
    /// Its firmware, as it calls it.
    pub firmware: Option<String>,
    /// Its serial number, or its processor's.
    pub serial: Option<String>,
    /// Whether it drives, if it says so.
    pub torque_on: Option<bool>,
    /// What is wrong with it, if it says so.
    pub faults: Option<Faults>,
}

impl CanIdentity {
    /// Its model in words.
    #[must_use]
    pub fn model(&self) -> Option<String> {
        let models: Vec<&str> = self.candidates.iter().map(|of| of.model.as_str()).collect();
        (!models.is_empty() && models.len() <= 3).then(|| models.join(" or "))
    }
}

/// The dialect of a device.
#[must_use]
pub const fn dialect_of(peer: &Peer) -> Dialect {
    match peer {
        Peer::Damiao { .. } => Dialect::Damiao,
        Peer::Robstride { .. } => Dialect::Robstride,
        Peer::Odrive { .. } => Dialect::Odrive,
        Peer::Moteus { .. } => Dialect::Moteus,
        Peer::Recoil { .. } => Dialect::Recoil,
        Peer::CubemarsMit { .. } => Dialect::CubemarsMit,
        Peer::CubemarsServo { .. } => Dialect::CubemarsServo,
    }
}

/// Every shipped actuator profile of a dialect.
fn actuators(dialect: Dialect) -> impl Iterator<Item = Actuator> {
    let all = profiles::actuator_names().filter_map(|name| profiles::actuator(name).ok());
    all.filter(move |of| of.dialect == dialect)
}

/// Longest wait for what an ODrive tells ten times a second.
const HEARTBEAT: Duration = Duration::from_millis(250);

/// Damiao's registers that tell who it is, and the ends of its ranges.
const DAMIAO: [u16; 7] = [13, 14, 15, 20, 21, 22, 23];
/// RobStride's timeout, which CyberGear has not.
const CAN_TIMEOUT: u16 = 0x7028;
/// ODrive's version, two words.
const VERSION: [u16; 2] = [0, 1];
/// moteus: model, firmware, three words of serial number.
const MOTEUS: [u16; 5] = [0x100, 0x101, 0x120, 0x121, 0x122];
/// Recoil: date of the firmware.
const RECOIL_FIRMWARE: u16 = 0x004;

/// Asks a device that was found who it is. Nothing is written.
///
/// # Errors
/// A line that failed. A question that is not answered leaves a fact unknown.
pub fn describe(line: &mut OpenCanLine, found: &Found) -> Result<CanIdentity, AskError> {
    let peer = found.peer;
    let mut identity = CanIdentity {
        peer,
        unasked: found.unasked,
        candidates: Vec::new(),
        hardware: None,
        firmware: None,
        serial: found.serial.map(|serial| format!("{serial:016X}")),
        torque_on: None,
        faults: None,
    };
    match peer {
        Peer::Damiao { .. } => damiao(line, &mut identity)?,
        Peer::Robstride { .. } => {
            let budget = line.budget();
            let asked = line.bus.read_setting(&peer, CAN_TIMEOUT, Form::Whole, budget);
            if let Err(AskError::Unsayable(_)) = asked {
                identity.candidates =
                    actuators(Dialect::Robstride).filter(|of| of.name == "cybergear").collect();
            } else {
                said(asked)?;
            }
        }
        Peer::Odrive { .. } => odrive(line, &mut identity)?,
        Peer::Moteus { .. } => {
            let [model, firmware, s1, s2, s3] = facts(line, &peer, MOTEUS)?;
            identity.hardware = model.map(|model| format!("model {model}"));
            identity.firmware = firmware.map(|version| format!("0x{version:X}"));
            let whole = s1.zip(s2).zip(s3);
            identity.serial = whole.map(|((s1, s2), s3)| format!("{s1:08X}{s2:08X}{s3:08X}"));
        }
        Peer::Recoil { .. } => {
            let [firmware] = facts(line, &peer, [RECOIL_FIRMWARE])?;
            identity.firmware = firmware.map(|date| format!("{date:08X}"));
        }
        Peer::CubemarsMit { .. } | Peer::CubemarsServo { .. } => {}
    }
    if let Some((torque_on, faults)) = said(line.bus.state_of(&peer, HEARTBEAT))?.flatten() {
        (identity.torque_on, identity.faults) = (Some(torque_on), Some(faults));
    }
    Ok(identity)
}

/// Nothing, if the device did not answer or has no such thing.
fn said<T>(asked: Result<T, AskError>) -> Result<Option<T>, AskError> {
    match asked {
        Ok(value) => Ok(Some(value)),
        Err(AskError::Port(error)) => Err(AskError::Port(error)),
        Err(_) => Ok(None),
    }
}

fn facts<const N: usize>(
    line: &mut OpenCanLine,
    peer: &Peer,
    numbers: [u16; N],
) -> Result<[Option<u32>; N], AskError> {
    let mut found = [None; N];
    for (fact, number) in found.iter_mut().zip(numbers) {
        let budget = line.budget();
        *fact = said(line.bus.read_setting(peer, number, Form::Whole, budget))?;
    }
    Ok(found)
}

fn damiao(line: &mut OpenCanLine, identity: &mut CanIdentity) -> Result<(), AskError> {
    let [hardware, software, serial, gear, pmax, vmax, tmax] = facts(line, &identity.peer, DAMIAO)?;
    // A register that older firmware has not is zero.
    let told = |fact: Option<u32>| fact.filter(|value| *value != 0);
    identity.hardware = told(hardware).map(|version| version.to_string());
    identity.firmware = told(software).map(|version| version.to_string());
    identity.serial = told(serial).map(|serial| format!("{serial:08X}"));
    let float = |fact: Option<u32>| fact.map(|bits| f64::from(f32::from_bits(bits)));
    let ends = [float(pmax), float(vmax), float(tmax)];
    let gear = float(told(gear));
    identity.candidates =
        actuators(Dialect::Damiao).filter(|of| is_likely(of, ends, gear)).collect();
    Ok(())
}

/// True if a profile's ranges end where the device says, and its gear is as the device says, if it
/// does. Ranges are position, rad; velocity, rad/s; torque, N m.
#[must_use]
pub fn is_likely(profile: &Actuator, ends: [Option<f64>; 3], gear: Option<f64>) -> bool {
    const TOLERANCE: f64 = 1e-4;
    let near = |own: f64, told: f64| (own - told).abs() <= TOLERANCE * own.abs();
    let Some(ranges) = &profile.ranges else { return false };
    let own = [ranges.position_rad, ranges.velocity_rad_s, ranges.torque_nm];
    let same = own.iter().zip(ends).all(|(own, told)| told.is_some_and(|told| near(*own, told)));
    let gears = profile.gear.as_ref().map(|gear| gear.ratio).zip(gear);
    same && gears.is_none_or(|(own, told)| near(own, told))
}

fn odrive(line: &mut OpenCanLine, identity: &mut CanIdentity) -> Result<(), AskError> {
    // Firmware 0.5 has no such message.
    let [first, second] = facts(line, &identity.peer, VERSION)?;
    let Some((first, second)) = first.zip(second) else { return Ok(()) };
    let [_protocol, major, minor, variant] = first.to_le_bytes();
    let [fw_major, fw_minor, revision, unreleased] = second.to_le_bytes();
    identity.hardware = Some(format!("{major}.{minor}.{variant}"));
    let dev = if unreleased == 0 { "" } else { "-dev" };
    identity.firmware = Some(format!("{fw_major}.{fw_minor}.{revision}{dev}"));
    let name = match major {
        3 => "odrive-v3",
        5 => "odrive-s1",
        _ => return Ok(()),
    };
    identity.candidates = actuators(Dialect::Odrive).filter(|of| of.name == name).collect();
    Ok(())
}

/// Words for a question that was not answered by a device of a CAN line.
#[must_use]
pub fn can_ask_error(line: &OpenCanLine, place: String, error: &AskError) -> Error {
    match error {
        AskError::Port(PortError::TimedOut) => Error::of(
            ErrorKind::Absent,
            "no device acknowledges what is sent on the line",
        )
        .at(place)
        .got(line.bus.troubles().unwrap_or_else(|| "a send queue that stays full".to_owned()))
        .remedy(
            "switch the actuators on; check CAN_H, CAN_L and ground, a resistor of 120 ohm at \
                 each end, and that all have the bit rate of the interface",
        ),
        AskError::Port(error) => {
            let said =
                Error::of(ErrorKind::Damaged, "the line failed").at(place).got(error.to_string());
            said.remedy("`gaitway ports` says how the interface stands")
        }
        AskError::Miss(Miss::Silent) => Error::of(ErrorKind::Silent, "no device answers")
            .at(place)
            .got(line.bus.troubles().unwrap_or_else(|| "nothing".to_owned()))
            .remedy("check power, cable and ID; `gaitway scan BUS` asks every ID"),
        AskError::Miss(Miss::HostLate { .. }) => super::ask_error(place, error),
        AskError::Miss(miss) => {
            Error::of(ErrorKind::Damaged, "a wrong answer").at(place).got(miss.to_string())
        }
        AskError::Unsayable(text) => Error::new(text.clone()).at(place),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_damiao_is_known_by_the_ends_of_its_ranges_and_by_its_gear() {
        let dm4310 = profiles::actuator("dm4310").expect("shipped");
        // Seeed Studio wiki, Damiao Series Motors: 12.5 rad, 30 rad/s, 10 N m, gear 10.
        let ends = [12.5, 30.0, 10.0].map(Some);
        assert!(is_likely(&dm4310, ends, None));
        assert!(is_likely(&dm4310, ends, Some(10.0)));
        assert!(!is_likely(&dm4310, ends, Some(40.0)));
        assert!(!is_likely(&dm4310, [Some(12.5), Some(8.0), Some(28.0)], None));
        assert!(!is_likely(&dm4310, [Some(12.5), Some(f64::NAN), Some(10.0)], None));
        assert!(!is_likely(&dm4310, [None, None, None], None), "who says nothing is nobody");
    }
}
