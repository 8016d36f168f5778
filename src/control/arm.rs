//! From limp to holding: goal = present before torque, read back at every step.

use super::watchdog;
use crate::error::Error;
use crate::guard::{Command, Guard};
use crate::robot::Link;
use crate::robot::preflight::{PATIENT_RETRIES, Preflight, budget, exchange_error, positions};
use crate::time::Duration;
use gaitway_profiles::Role;

/// Largest distance between goal and present when torque comes on, rad.
const HOLD_RAD: f64 = 0.02;

/// Switches torque on with every joint told to stay where it is.
///
/// Also writes what the robot file wants in RAM, the servos' own speed limit, so that a servo whose
/// host dies never moves faster than its joint may, and their watchdog, where they have one: from
/// here on no line may be silent for longer than [`watchdog::SILENCE`].
///
/// # Errors
/// A servo that does not take or keep what is written. Torque is switched off again then, and joints
/// that do not confirm it are named; a robot that was held before is left as it is, since it may be
/// standing.
pub fn arm(link: &mut Link, preflight: &Preflight) -> Result<(Guard, Command), Error> {
    let limits = link.robot().limits();
    let now = link.clock().now();
    let (guard, command) =
        Guard::standing_at(&preflight.start_rad, limits, now).map_err(|refusal| {
            Error::new("the guard refuses the start pose")
                .at(format!("joint {}", link.robot().joints[refusal.joint].name))
                .got(refusal.reason.to_string())
        })?;
    match switch_on(link, preflight, &command) {
        Ok(()) => Ok((guard, command)),
        Err(error) if preflight.held => {
            watchdog::release(link);
            Err(error)
        }
        // Nothing has moved yet, so limp is where the robot already was.
        Err(error) => Err(match disarm(link) {
            Ok(()) => error,
            Err(still_on) => {
                let remedy = format!("{}; {}", still_on.what, still_on.got.unwrap_or_default());
                error.remedy(remedy)
            }
        }),
    }
}

fn switch_on(link: &mut Link, preflight: &Preflight, command: &Command) -> Result<(), Error> {
    write_eeprom(link, preflight)?;
    for &(joint, register, raw) in &preflight.to_write {
        let limit = budget(link);
        let written = link.write_raw(joint, register, raw, limit);
        written.map_err(|e| exchange_error(link, Some(joint), &e))?;
        expect_raw(link, joint, register, raw)?;
    }
    for &(joint, number, bits) in &preflight.settings {
        write_setting(link, joint, number, bits)?;
    }
    for joint in 0..link.robot().joints.len() {
        limit_speed(link, joint)?;
        link.break_silence(watchdog::SILENCE / 4);
        let limit = budget(link);
        link.prepare(joint, limit).map_err(|e| exchange_error(link, Some(joint), &e))?;
    }
    // Where torque is on already, a goal moves the joint.
    check_where_it_was(link, command)?;
    let limit = budget(link);
    link.write_goals(command, limit).map_err(|e| exchange_error(link, None, &e))?;
    for joint in 0..link.robot().joints.len() {
        // An actuator tells no goal: that it still stands where it was is seen below.
        let Some(register) = link.robot().joints[joint].register(Role::GoalPosition) else {
            continue;
        };
        let limit = budget(link);
        let raw = link.read_register(joint, register, limit);
        let raw = raw.map_err(|e| exchange_error(link, Some(joint), &e))?;
        let of = &link.robot().joints[joint];
        let goal_rad = of.model()?.si_from_raw(register, raw);
        let wanted_rad = of.servo_rad(command.goal_rad()[joint]);
        if !((goal_rad - wanted_rad).abs() <= HOLD_RAD) {
            return Err(Error::new("a servo did not keep its goal; torque stays off")
                .at(format!("joint {}", of.name))
                .got(format!("{:.2} deg", goal_rad.to_degrees()))
                .allowed(format!("{:.2} deg", wanted_rad.to_degrees())));
        }
    }
    watchdog::arm(link)?;
    check_where_it_was(link, command)?;
    set_torque_on(link)
}

/// Lowers return delays as permitted, and reads as fast as the line then is.
fn write_eeprom(link: &mut Link, preflight: &Preflight) -> Result<(), Error> {
    for write in &preflight.eeprom {
        let limit = budget(link);
        let written = link.write_raw(write.joint, write.register, write.to, limit);
        written.map_err(|e| exchange_error(link, Some(write.joint), &e))?;
        expect_raw(link, write.joint, write.register, write.to)?;
    }
    for write in &preflight.eeprom {
        let joint = &link.robot().joints[write.joint];
        let delay_s = joint.model()?.si_from_raw(write.register, write.to);
        link.set_return_delay(joint.line, Duration::from_secs_f64(delay_s.clamp(0.0, 1.0)));
    }
    if !preflight.eeprom.is_empty() {
        link.plan_reads(&preflight.firmware, preflight.period);
    }
    Ok(())
}

/// Torque moves a joint to its goal: it must still be there.
fn check_where_it_was(link: &mut Link, command: &Command) -> Result<(), Error> {
    let present_rad = positions(link)?;
    for (index, (present, goal)) in present_rad.iter().zip(command.goal_rad()).enumerate() {
        let off_rad = (present - goal).abs();
        if !(off_rad <= HOLD_RAD) {
            return Err(Error::new("a joint moved before torque came on; torque stays off")
                .at(format!("joint {}", link.robot().joints[index].name))
                .got(format!("{:.1} deg from where it was", off_rad.to_degrees()))
                .allowed(format!("{:.1} deg", HOLD_RAD.to_degrees()))
                .remedy("hold the robot still, or support it, and start again"));
        }
    }
    Ok(())
}

/// Tells a servo that has a speed register for position moves not to exceed the joint's limit.
fn limit_speed(link: &mut Link, joint: usize) -> Result<(), Error> {
    let of = &link.robot().joints[joint];
    // A Dynamixel's Goal Velocity acts in velocity mode only; its moves obey Profile Velocity.
    let register = of.register(Role::ProfileVelocity).or_else(|| of.register(Role::GoalVelocity));
    let Some(register) = register else { return Ok(()) };
    let raw = of
        .model()?
        .raw_from_si(register, of.servo_speed_rad_s(of.limits.velocity_rad_s()))
        .map_err(|e| Error::new(e.to_string()).at(format!("joint {}", of.name)))?;
    // Zero is no limit at all in these registers; a servo that cannot be as fast is limited enough.
    let raw = raw.clamp(1, register.max.unwrap_or(i64::MAX).max(1));
    let limit = budget(link);
    let written = link.write_raw(joint, register, raw, limit);
    written.map_err(|e| exchange_error(link, Some(joint), &e))?;
    expect_raw(link, joint, register, raw)
}

pub(super) fn expect_raw(
    link: &mut Link,
    joint: usize,
    register: &gaitway_profiles::Register,
    wanted: i64,
) -> Result<(), Error> {
    link.break_silence(watchdog::SILENCE / 4);
    let limit = budget(link);
    let raw = link.read_register(joint, register, limit);
    let raw = raw.map_err(|e| exchange_error(link, Some(joint), &e))?;
    if raw == wanted {
        return Ok(());
    }
    Err(Error::new("a servo did not keep what was written")
        .at(format!("joint {}, register {}", link.robot().joints[joint].name, register.name))
        .got(raw.to_string())
        .allowed(wanted.to_string()))
}

/// Switches torque on on every joint at once, and reads it back.
fn set_torque_on(link: &mut Link) -> Result<(), Error> {
    let limit = budget(link);
    link.switch_on(limit).map_err(|e| exchange_error(link, None, &e))?;
    for joint in 0..link.robot().joints.len() {
        link.break_silence(watchdog::SILENCE / 4);
        match torque_register(link, joint) {
            Some(register) => expect_raw(link, joint, register, 1)?,
            None => expect_torque(link, joint)?,
        }
    }
    Ok(())
}

/// An actuator says whether it drives.
fn expect_torque(link: &mut Link, joint: usize) -> Result<(), Error> {
    let on = link.torque_is(joint, true);
    if on.map_err(|e| exchange_error(link, Some(joint), &e))? {
        return Ok(());
    }
    let limit = budget(link);
    let bits = link.health(joint, 0, limit).ok().and_then(|health| health.error_bits);
    let faults = bits.filter(|&bits| bits != 0).map(|bits| link.error_words(joint, bits));
    let of = &link.robot().joints[joint];
    Err(Error::new("an actuator does not switch on")
        .at(format!("joint {}, ID {}", of.name, of.id))
        .got(
            faults.map_or("it says that it is off".to_owned(), |words| format!("it says: {words}")),
        )
        .allowed("it drives once it is told to")
        .remedy("find the cause, then switch its power off and on"))
}

/// Writes a setting of an actuator, which must then read so.
fn write_setting(link: &mut Link, joint: usize, number: u16, bits: u32) -> Result<(), Error> {
    let limit = budget(link);
    let kept = link.write_setting(joint, number, bits, limit);
    let kept = kept.map_err(|e| exchange_error(link, Some(joint), &e))?;
    if kept == bits {
        return Ok(());
    }
    Err(Error::new("an actuator did not keep what was written")
        .at(format!("joint {}, setting {number}", link.robot().joints[joint].name))
        .got(kept.to_string())
        .allowed(bits.to_string())
        .remedy("set it with the maker's tool"))
}

/// The torque switch of a servo; an actuator has an order for it.
fn torque_register(link: &Link, joint: usize) -> Option<&'static gaitway_profiles::Register> {
    link.robot().joints[joint].register(Role::TorqueEnable)
}

/// Switches torque off on every joint, one after the other and whatever the others say: the robot
/// goes limp. Watchdogs go off as well: whoever switches torque on next may know nothing of them.
///
/// # Errors
/// The joints that did not confirm.
pub fn disarm(link: &mut Link) -> Result<(), Error> {
    link.set_retries(PATIENT_RETRIES);
    // Whoever does not confirm must not keep the others driving while he is asked again.
    link.let_go();
    let mut unsure = Vec::new();
    for joint in 0..link.robot().joints.len() {
        let confirmed = match torque_register(link, joint) {
            Some(register) => {
                let limit = budget(link);
                link.write_raw(joint, register, 0, limit).is_ok()
                    && expect_raw(link, joint, register, 0).is_ok()
            }
            None => link.limp(joint).is_ok(),
        };
        if !confirmed {
            unsure.push(link.robot().joints[joint].name.clone());
        }
    }
    watchdog::release(link);
    if unsure.is_empty() {
        return Ok(());
    }
    Err(Error::new("torque may still be on")
        .got(format!("no confirmation from {}", unsure.join(", ")))
        .remedy("switch the robot's power off before you touch it"))
}
