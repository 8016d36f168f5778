//! A joint's zero in its servo's own offset register, so that the robot file's zero is the true one.

use super::reading::{Measured, reading};
use crate::bus::Protocol;
use crate::calibration::{HomingSign, homing_offset};
use crate::control::{inject, net};
use crate::error::{Error, ErrorKind};
use crate::robot::Link;
use crate::robot::preflight::{budget, exchange_error};
use gaitway_profiles::{Register, Role};

/// What is to be written.
pub struct Change {
    /// The offset register.
    pub register: &'static Register,
    /// Before, raw.
    pub old: i64,
    /// After, raw.
    pub new: i64,
    /// What every reading changes by.
    pub shift: i64,
    /// The joint's offset that goes with it, rad.
    pub offset_rad: f64,
}

/// So often it is tried to close a lock.
const LOCK_ROUNDS: usize = 3;
/// The reading may change by a little between two looks, counts.
const STILL_COUNTS: i64 = 12;

/// The offset in the servo, raw, if it is another than the robot file says: what is measured holds
/// only as long as it stays there.
///
/// # Errors
/// A servo that does not answer.
pub fn in_force(link: &mut Link, joint: usize) -> Result<Option<i64>, Error> {
    let of = &link.robot().joints[joint];
    let Some(register) = of.register(Role::HomingOffset) else { return Ok(None) };
    let stated = of.servo().and_then(|servo| servo.setup.get(&register.name).copied());
    let stated = stated.or(register.initial);
    let limit = budget(link);
    let raw = link.read_register(joint, register, limit);
    let raw = raw.map_err(|e| exchange_error(link, Some(joint), &e))?;
    Ok(Some(raw).filter(|_| stated != Some(raw)))
}

/// What offset makes the servo read at the measured zero what the robot file expects there.
///
/// # Errors
/// A servo without offset, or with one that does not reach so far.
pub fn plan(link: &mut Link, joint: usize, measured: &Measured) -> Result<Change, Error> {
    let of = link.robot().joints[joint].clone();
    let place = || format!("joint {}, ID {}", of.name, of.id);
    let wrong = |e: crate::device::RegisterError| Error::new(e.to_string()).at(place());
    let model = of.model()?;
    let register = model.register(Role::HomingOffset).map_err(wrong)?;
    let position = model.register(Role::PresentPosition).map_err(wrong)?;
    let file = link.robot().file.joint(&of.name).cloned();
    let (offset_rad, gear) = file.map_or((0.0, 1.0), |file| (file.offset_rad, file.gear));
    let wanted_rad = offset_rad / (f64::from(measured.direction) * gear);
    let wanted = model.raw_from_si(position, wanted_rad).map_err(wrong)?;
    let limit = budget(link);
    let old = link.read_register(joint, register, limit);
    let old = old.map_err(|e| exchange_error(link, Some(joint), &e))?;
    let dynamixel = matches!(model.protocol(), Protocol::Dynamixel1 | Protocol::Dynamixel2);
    let sign = if dynamixel { HomingSign::Added } else { HomingSign::Subtracted };
    let mut new = homing_offset(sign, measured.zero, old, wanted);
    let (mut lowest, mut highest) = register.range();
    if dynamixel {
        // Offsets beyond a quarter turn are ignored in position mode (e-Manual, Homing Offset(20)).
        let effective = i64::from(model.profile().position.counts / 4);
        (lowest, highest) = (lowest.max(-effective), highest.min(effective));
    } else if !(lowest..=highest).contains(&new) {
        // A Feetech reads modulo one turn: a turn more or less is the same.
        let turn = i64::from(model.profile().position.counts);
        new -= turn * new.signum();
    }
    if !(lowest..=highest).contains(&new) {
        return Err(Error::new("the servo's offset register does not reach that far")
            .at(place())
            .got(new.to_string())
            .allowed(format!("{lowest} to {highest} (raw)"))
            .remedy("mount the horn nearer to the middle, or calibrate without --permit-eeprom"));
    }
    Ok(Change { register, old, new, shift: wanted - measured.zero, offset_rad })
}

/// Writes the offset through the servo's lock, reads it back, and sees that the reading follows.
///
/// # Errors
/// A servo that does not take it. Its lock is closed again then too, or said to be open.
pub fn write(link: &mut Link, joint: usize, change: &Change) -> Result<(), Error> {
    let of = link.robot().joints[joint].clone();
    let before = reading(link, joint)?;
    let model = of.model()?;
    let kept = match model.eeprom_lock() {
        None => put(link, joint, change.register, change.new)?,
        Some(lock) => through(link, joint, lock, change)?,
    };
    let after = reading(link, joint)?;
    let turn = i64::from(model.profile().position.counts);
    let off = (after - before - change.shift + turn / 2).rem_euclid(turn) - turn / 2;
    if kept == change.new && off.abs() <= STILL_COUNTS {
        return Ok(());
    }
    Err(Error::new("the servo did not take its offset")
        .at(format!("joint {}, register {}", of.name, change.register.name))
        .got(format!("{kept} (raw), its reading went from {before} to {after}"))
        .allowed(format!("{} (raw), a change of {}", change.new, change.shift))
        .remedy(format!("before, it was {}", change.old)))
}

/// Writes a register; what it holds then.
fn put(link: &mut Link, joint: usize, register: &Register, raw: i64) -> Result<i64, Error> {
    let limit = budget(link);
    let written = link.write_raw(joint, register, raw, limit);
    written.map_err(|e| exchange_error(link, Some(joint), &e))?;
    let limit = budget(link);
    let kept = link.read_register(joint, register, limit);
    kept.map_err(|e| exchange_error(link, Some(joint), &e))
}

/// Opens the lock, writes, and closes it again whatever comes of that.
fn through(link: &mut Link, joint: usize, lock: &Register, change: &Change) -> Result<i64, Error> {
    let place = {
        let of = &link.robot().joints[joint];
        format!("joint {}, ID {}, register {}", of.name, of.id, lock.name)
    };
    let done = match put(link, joint, lock, 0) {
        Ok(0) => net::catch(|| {
            inject::point("offset", 0);
            put(link, joint, change.register, change.new)
        })
        .unwrap_or_else(|words| {
            Err(Error::of(ErrorKind::Broke, "the program broke as the offset was written")
                .at(&place)
                .got(words)
                .remedy(format!("please report this; before, it was {}", change.old)))
        }),
        Ok(_) => Err(Error::new("the servo did not open its lock; nothing was written").at(&place)),
        Err(error) => Err(error),
    };
    if (0..LOCK_ROUNDS).any(|_| put(link, joint, lock, 1).is_ok_and(|kept| kept == 1)) {
        return done;
    }
    let open = "its EEPROM lock may be open, and it keeps what is written to it: close it with \
                `gaitway servo set BUS ID Lock 1`, or switch its power off and on";
    let error = done.err().unwrap_or_else(|| {
        Error::new("the servo does not confirm that its EEPROM lock is closed again").at(place)
    });
    let remedy = error.remedy.clone().map_or(open.to_owned(), |first| format!("{first}; {open}"));
    Err(error.remedy(remedy))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::port::BytePort;
    use crate::port::sim::{SharedWorld, VirtualClock, VirtualLine};
    use crate::robot::Robot;
    use crate::robot::preflight::PATIENT_RETRIES;
    use crate::time::Duration;
    use gaitway_sim::{Damage, Fault, Options, World};
    use std::sync::Arc;

    const JOINT: &str = "gripper";

    /// Writes an offset while `faults` strike: what came of it, the lock afterwards, and when, ns.
    fn come_of(faults: Vec<Fault>) -> (Result<i64, String>, i64, u64) {
        let robot = Robot::load("so101").expect("a shipped robot");
        let joint = robot.joints.iter().position(|joint| joint.name == JOINT).expect("a joint");
        let baud_bps = robot.file.lines[0].baud_bps().expect("a serial line");
        let options = Options { faults, permit_eeprom: true, ..Options::default() };
        let world = SharedWorld::new(World::new(&robot.file, options).expect("a world"));
        let line: Box<dyn BytePort> = Box::new(VirtualLine::new(world.clone(), 0, baud_bps));
        let clock = Arc::new(VirtualClock(world.clone()));
        let mut link = Link::new(robot, vec![(line, Duration::ZERO)], clock);
        link.set_retries(PATIENT_RETRIES);
        let model = link.robot().joints[joint].model().expect("a servo");
        let register = model.register(Role::HomingOffset).expect("a register");
        let lock = model.eeprom_lock().expect("a lock");
        let change = Change { register, old: 0, new: 17, shift: -17, offset_rad: 0.0 };
        let done = through(&mut link, joint, lock, &change).map_err(|error| error.to_string());
        let world = world.lock();
        (done, world.register(JOINT, "Lock").expect("a register"), world.now_ns())
    }

    #[test]
    fn whatever_is_lost_while_an_offset_is_written_the_lock_is_closed_or_said_to_be_open() {
        let (done, lock, whole_ns) = come_of(Vec::new());
        assert_eq!((done, lock), (Ok(17), 1));
        let (mut failed, mut open) = (0, 0);
        for from_ns in (0..whole_ns).step_by(60_000) {
            for for_ns in [2_000_000, 40_000_000, u64::MAX - from_ns] {
                let until_ns = from_ns + for_ns;
                let mute = Fault::Statuses {
                    of: Some(JOINT.to_owned()),
                    from_ns,
                    until_ns,
                    probability: 1.0,
                    damage: Damage::Mute,
                };
                let (done, lock, _) = come_of(vec![mute]);
                assert_eq!(lock, 1, "all was heard, from {from_ns} ns for {for_ns} ns: {done:?}");
                failed += u32::from(done.is_err());
                let deaf = Fault::Silent { joint: JOINT.to_owned(), from_ns, until_ns };
                let (done, lock, _) = come_of(vec![deaf]);
                if lock != 1 {
                    let said = done.expect_err("it may be open");
                    assert!(said.contains("EEPROM lock may be open"), "{said}");
                    open += 1;
                }
            }
        }
        assert!(failed > 5 && open > 5, "{failed} failed, {open} were left open");
    }
}
