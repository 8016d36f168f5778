//! Settings under which a servo would not do what arming and goals mean by it.

use super::{ask, budget, exchange_error, host_late, place, read_surely, wait_for_late_answers};
use crate::bus::{AskError, Miss, Protocol};
use crate::error::{Error, ErrorKind};
use crate::robot::Link;
use crate::time::Duration;
use gaitway_profiles::{Mode, Register, Role};

/// Drive Mode(10), bit 2: Profile Velocity is the duration of a move in ms and limits no speed
/// (DYNAMIXEL e-Manual, X series).
const TIME_BASED: i64 = 0x04;
/// Drive Mode(10), bit 3: a goal switches torque on.
const TORQUE_BY_GOAL: i64 = 0x08;

/// Runs the checks of this page on every joint.
pub(super) fn check_modes(link: &mut Link) -> Result<(), Error> {
    for joint in 0..link.robot().joints.len() {
        check_answers(link, joint)?;
        check_second_id(link, joint)?;
        check_drive_mode(link, joint)?;
        check_joint_mode(link, joint)?;
        check_torque_limit(link, joint)?;
    }
    Ok(())
}

/// Model number and firmware of a servo.
///
/// If it answers pings and no reads, its status return level is doubted; never while this host is late.
pub(super) fn identity(link: &mut Link, joint: usize) -> Result<(u16, u16), Error> {
    let late_before = link.host_late();
    let refused = match ask(link, joint, |link, limit| link.identity(joint, limit)) {
        Ok(identity) => return Ok(identity),
        Err(refused) => refused,
    };
    let limit = budget(link);
    if link.ping(joint, limit).is_err() {
        return Err(refused);
    }
    // It is there, so its reads alone were not answered: the last of them tells why.
    let limit = budget(link);
    match link.identity(joint, limit) {
        Ok(identity) => return Ok(identity),
        Err(failed) if failed.error != AskError::Miss(Miss::Silent) => {
            return Err(exchange_error(link, Some(joint), &failed));
        }
        Err(_) => {}
    }
    let late = link.host_late() - late_before;
    if late > Duration::ZERO {
        return Err(host_late(place(link, joint), late));
    }
    Err(Error::of(ErrorKind::NotReady, "a servo answers pings and nothing else")
        .at(place(link, joint))
        .got("no answer to a read; its status return level may be 0")
        .allowed("a servo that answers every instruction")
        .remedy("set its status return level to \"all\" with the maker's tool"))
}

/// The register of `joint` for `role`, if it has one.
fn known(link: &Link, joint: usize, role: Role) -> Option<&'static Register> {
    link.robot().joints[joint].register(role)
}

/// What is written is believed only with the servo's yes.
fn check_answers(link: &mut Link, joint: usize) -> Result<(), Error> {
    let Some(register) = known(link, joint, Role::StatusReturnLevel) else { return Ok(()) };
    let Some(all) = register.max else { return Ok(()) };
    let raw = read_surely(link, joint, register, |raw| raw == all)?;
    if raw == all {
        return Ok(());
    }
    let (name, id) = (&register.name, link.robot().joints[joint].id);
    Err(Error::of(ErrorKind::Silent, "a servo does not answer when it is written to")
        .at(format!("{}, register {name} ({})", place(link, joint), register.address))
        .got(format!("{raw} (raw)"))
        .allowed(format!("{all} (raw): it answers every instruction"))
        .remedy(format!("gaitway servo set BUS {id} '{name}' --raw {all} (--permit-eeprom)")))
}

/// A servo carries out what is told to its second ID, in silence (e-Manual, Secondary ID(12)): it
/// must not be that of another joint, whose goals it would take for its own.
fn check_second_id(link: &mut Link, joint: usize) -> Result<(), Error> {
    let Some(register) = known(link, joint, Role::SecondaryId) else { return Ok(()) };
    let line = link.robot().joints[joint].line;
    let others = link.robot().joints.iter().enumerate();
    let others = others.filter(|&(index, other)| index != joint && other.line == line);
    let others: Vec<(i64, String)> =
        others.map(|(_, other)| (other.id.into(), other.name.clone())).collect();
    let other = |raw| others.iter().find(|(id, _)| *id == raw).map(|(_, name)| name);
    let raw = read_surely(link, joint, register, |raw| other(raw).is_none())?;
    let Some(other) = other(raw) else { return Ok(()) };
    let joints = &link.robot().joints;
    let (name, id, off) = (&register.name, joints[joint].id, register.initial.unwrap_or(255));
    Err(Error::of(ErrorKind::NotReady, "a servo obeys another joint's goals as well")
        .at(format!("{}, register {name} ({})", place(link, joint), register.address))
        .got(format!("{raw}, the ID of joint {other}"))
        .allowed(format!("{off}: no second ID"))
        .remedy(format!("gaitway servo set BUS {id} '{name}' --raw {off} --permit-eeprom")))
}

/// Arming limits each servo's speed by Profile Velocity, and writes a goal while torque is off.
fn check_drive_mode(link: &mut Link, joint: usize) -> Result<(), Error> {
    let Some(register) = known(link, joint, Role::DriveMode) else { return Ok(()) };
    let protocol = link.robot().joints[joint].servo().map(|servo| servo.model.protocol());
    if protocol != Some(Protocol::Dynamixel2) {
        return Ok(());
    }
    let fine = |raw| raw & (TIME_BASED | TORQUE_BY_GOAL) == 0;
    let raw = read_surely(link, joint, register, fine)?;
    let refused = |what: &str, bit: i64| {
        Err(Error::new(what)
            .at(format!(
                "{}, register {} ({})",
                place(link, joint),
                register.name,
                register.address
            ))
            .got(format!("{raw} (raw)"))
            .allowed(format!("bit 0x{bit:02X} clear, as it leaves the factory"))
            .remedy(format!(
                "gaitway servo set BUS {} '{}' --raw {} --permit-eeprom",
                link.robot().joints[joint].id,
                register.name,
                raw & !bit
            )))
    };
    if raw & TIME_BASED != 0 {
        return refused("a servo times its moves: no register limits its speed", TIME_BASED);
    }
    if raw & TORQUE_BY_GOAL != 0 {
        return refused("a servo switches its torque on by itself with a goal", TORQUE_BY_GOAL);
    }
    Ok(())
}

/// In another mode than those of position torque alone sets a joint going. Whether the servo is in the mode that its file
/// expects is compared with the rest of its setup.
fn check_expected_mode(link: &Link, joint: usize, register: &Register) -> Result<(), Error> {
    let Some(servo) = link.robot().joints[joint].servo() else { return Ok(()) };
    let Some(expected) = servo.setup.get(&register.name).copied().or(register.initial) else {
        return Ok(());
    };
    let to_angles =
        |mode| matches!(mode, Mode::Position | Mode::ExtendedPosition | Mode::CurrentBasedPosition);
    let modes = &servo.model.profile().operating_modes;
    let Some(mode) = modes.iter().find(|mode| i64::from(mode.value) == expected) else {
        return Ok(());
    };
    if to_angles(mode.mode) {
        return Ok(());
    }
    let allowed = modes.iter().filter(|mode| to_angles(mode.mode));
    let allowed: Vec<_> = allowed.map(|mode| format!("{} ({:?})", mode.value, mode.mode)).collect();
    let (name, id) = (&register.name, link.robot().joints[joint].id);
    Err(Error::of(ErrorKind::NotReady, "the robot's file expects a mode without angles to go to")
        .at(format!("{}, register {name} ({})", place(link, joint), register.address))
        .got(format!("{expected} ({:?})", mode.mode))
        .allowed(allowed.join(", "))
        .remedy(format!(
            "another number in the file, and gaitway servo set BUS {id} '{name}' --raw N --permit-eeprom"
        )))
}

/// Servos without a mode register turn endlessly when both their angle limits are zero.
fn check_joint_mode(link: &mut Link, joint: usize) -> Result<(), Error> {
    if let Some(register) = known(link, joint, Role::OperatingMode) {
        return check_expected_mode(link, joint, register);
    }
    let limits = [Role::MinPositionLimit, Role::MaxPositionLimit];
    let [Some(low), Some(high)] = limits.map(|role| known(link, joint, role)) else {
        return Ok(());
    };
    // One of them is often 0. That both are is believed when they are read once more.
    let turns = |link: &mut Link| -> Result<bool, Error> {
        for limit in [low, high] {
            if ask(link, joint, |link, by| link.read_register(joint, limit, by))? != 0 {
                return Ok(false);
            }
        }
        Ok(true)
    };
    if !turns(link)? {
        return Ok(());
    }
    wait_for_late_answers(link);
    if !turns(link)? {
        return Ok(());
    }
    let (low, high) = (&low.name, &high.name);
    Err(Error::of(ErrorKind::NotReady, "a servo is in wheel mode: it would turn without end")
        .at(place(link, joint))
        .got(format!("{low} and {high} both 0"))
        .allowed("joint mode: limits that are not both 0")
        .remedy(format!("set {low} and {high} with the maker's tool")))
}

/// A Dynamixel of Protocol 1.0 that shut itself down has no torque left until its power goes off
/// (e-Manual, Torque Limit(34)), whatever Torque Enable says.
fn check_torque_limit(link: &mut Link, joint: usize) -> Result<(), Error> {
    let Some(register) = known(link, joint, Role::TorqueLimit) else { return Ok(()) };
    if read_surely(link, joint, register, |raw| raw != 0)? != 0 {
        return Ok(());
    }
    Err(Error::of(
        ErrorKind::NotReady,
        "a servo gives no torque: it shut itself down, or is told to",
    )
    .at(format!("{}, register {} ({})", place(link, joint), register.name, register.address))
    .got("0 (raw)")
    .allowed("more than 0")
    .remedy("find the cause, then switch its power off and on"))
}

#[cfg(test)]
mod tests;
