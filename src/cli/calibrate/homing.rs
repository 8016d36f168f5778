//! A joint's zero in its servo's own offset register, so that the robot file's zero is the true one.

use super::measure::{Measured, reading};
use crate::bus::Protocol;
use crate::calibration::{HomingSign, homing_offset};
use crate::control::{inject, net};
use crate::error::Error;
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

/// Offsets beyond this are ignored in position mode (DYNAMIXEL e-Manual, Homing Offset(20)).
const DYNAMIXEL_EFFECTIVE: i64 = 1024;
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
        (lowest, highest) = (lowest.max(-DYNAMIXEL_EFFECTIVE), highest.min(DYNAMIXEL_EFFECTIVE));
    } else if !(lowest..=highest).contains(&new) {
        // A Feetech reads modulo one turn: a turn more or less is the same.
        let turn = i64::from(model.profile().position.counts);
        new -= turn * new.signum();
    }
    if !(lowest..=highest).contains(&new) {
        return Err(Error::new("the servo's offset does not reach so far")
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
/// A servo that does not take it.
pub fn write(link: &mut Link, joint: usize, change: &Change) -> Result<(), Error> {
    let of = link.robot().joints[joint].clone();
    let before = reading(link, joint)?;
    let model = of.model()?;
    let lock = model.eeprom_lock();
    let mut put = |register: &Register, raw: i64| -> Result<i64, Error> {
        let limit = budget(link);
        let written = link.write_raw(joint, register, raw, limit);
        written.map_err(|e| exchange_error(link, Some(joint), &e))?;
        let limit = budget(link);
        let kept = link.read_register(joint, register, limit);
        kept.map_err(|e| exchange_error(link, Some(joint), &e))
    };
    let Some(lock) = lock else {
        let kept = put(change.register, change.new)?;
        return check(link, joint, change, before, kept);
    };
    let kept = net::catch(|| {
        if put(lock, 0)? != 0 {
            return Err(Error::new("the servo did not open its lock; nothing was written")
                .at(format!("joint {}, register {}", of.name, lock.name)));
        }
        inject::point("offset", 0);
        put(change.register, change.new)
    });
    // It is closed again whatever happened, even if its opening was not confirmed.
    let closed = put(lock, 1);
    let kept = kept.unwrap_or_else(|words| {
        Err(Error::new("the program broke as the offset was written")
            .at(format!("joint {}, register {}", of.name, change.register.name))
            .got(words)
            .remedy(format!("please report this; before, it was {}", change.old)))
    });
    match (kept, closed) {
        (Ok(kept), Ok(1)) => check(link, joint, change, before, kept),
        (Err(error), Ok(1)) => Err(error),
        (kept, closed) => {
            let error = Error::new("the servo's EEPROM may still be open")
                .at(format!("joint {}, register {}", of.name, lock.name))
                .got(closed.map_or_else(|error| error.to_string(), |raw| raw.to_string()))
                .allowed("1")
                .remedy("switch its power off and on: that closes it");
            Err(kept.err().map_or(error.clone(), |first| first.remedy(error.to_string())))
        }
    }
}

/// Sees that the servo kept its offset and that its reading follows.
fn check(
    link: &mut Link,
    joint: usize,
    change: &Change,
    before: i64,
    kept: i64,
) -> Result<(), Error> {
    let of = link.robot().joints[joint].clone();
    let after = reading(link, joint)?;
    let turn = i64::from(of.model()?.profile().position.counts);
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
