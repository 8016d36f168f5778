//! From limp to holding: goal = present before torque, read back at every step.

use super::{inject, watchdog};
use crate::error::{Error, ErrorKind};
use crate::guard::{Command, Guard};
use crate::robot::Link;
use crate::robot::preflight::{PATIENT_RETRIES, Preflight, budget, exchange_error, positions};
use crate::time::{Duration, Instant};
use gaitway_profiles::Role;

/// Largest distance between goal and present when torque comes on, rad.
const HOLD_RAD: f64 = 0.02;
/// How old a look at the joints may be when something is written on the strength of it.
const FRESH: Duration = Duration::from_millis(50);
/// Raw value of the lowest speed a servo's register holds.
const SLOWEST: i64 = 1;
/// Looks after which a host that stalls again and again is refused.
const MOST_LOOKS: u32 = 8;

/// A robot that holds, torque on, and the guard that knows where.
#[derive(Debug)]
pub struct Armed {
    guard: Guard,
    command: Command,
}

impl Armed {
    /// The guard, and the command in force.
    pub(super) fn into_parts(self) -> (Guard, Command) {
        (self.guard, self.command)
    }

    /// The command in force: where the joints stand.
    #[must_use]
    pub const fn command(&self) -> &Command {
        &self.command
    }
}

/// Why arming ended before it was done.
enum Halt {
    /// The operator asked.
    Asked,
    /// Something is wrong.
    Failed(Error),
}

impl From<Error> for Halt {
    fn from(error: Error) -> Self {
        Self::Failed(error)
    }
}

/// What arming came to.
#[derive(Debug)]
pub enum Arming {
    /// The robot holds.
    Done(Armed),
    /// A wish to stop came first: torque is as it was found.
    Stopped,
}

impl Arming {
    /// The armed robot.
    ///
    /// # Errors
    /// Somebody asked to stop.
    pub fn done(self) -> Result<Armed, Error> {
        match self {
            Self::Done(armed) => Ok(armed),
            Self::Stopped => {
                Err(Error::of(ErrorKind::Stopped, "stopped before torque came on; nothing moved"))
            }
        }
    }
}

/// Switches torque on with every joint told to stay where it is.
///
/// Also writes what the robot file wants in RAM, the servos' own speed limit, so that a servo whose
/// host dies never moves faster than its joint may, and their watchdog, where they have one: from
/// here on no line may be silent for longer than [`watchdog::SILENCE`].
///
/// `asked_to_stop` is looked at before everything that is written. A wish to stop leaves a limp robot
/// limp and a held one held.
///
/// # Errors
/// A servo that does not take or keep what is written; a host that stalled after the last look at
/// the joints. Torque is switched off again then, and joints that do not confirm it are named; a
/// robot that was held before is left as it is, since it may be standing.
pub fn arm(
    link: &mut Link,
    preflight: &Preflight,
    asked_to_stop: &dyn Fn() -> bool,
) -> Result<Arming, Error> {
    if preflight.robot != link.robot().name {
        return Err(Error::new("the robot to be armed is not the one that was checked")
            .at(format!("robot {}", link.robot().name))
            .got(preflight.robot.clone()));
    }
    let limits = link.robot().limits();
    link.forget_doubts();
    let now = link.clock().now();
    let (guard, command) =
        Guard::standing_at(&preflight.start_rad, limits, now).map_err(|refusal| {
            Error::of(ErrorKind::OutsideLimits, "the guard refuses the start pose")
                .at(format!("joint {}", link.robot().joints[refusal.joint].name))
                .got(refusal.reason.to_string())
        })?;
    let halt = match switch_on(link, preflight, &command, asked_to_stop) {
        Ok(()) => return Ok(Arming::Done(Armed { guard, command })),
        Err(halt) => halt,
    };
    let undone = if preflight.held {
        watchdog::release(link);
        Ok(())
    } else {
        // Nothing has moved yet, so limp is where the robot already was.
        disarm(link)
    };
    match (halt, undone) {
        (Halt::Asked, Ok(())) => Ok(Arming::Stopped),
        (Halt::Asked, Err(still_on)) => Err(still_on),
        (Halt::Failed(error), Ok(())) => Err(error),
        (Halt::Failed(error), Err(still_on)) => {
            let remedy = format!("{}; {}", still_on.what, still_on.got.unwrap_or_default());
            Err(error.remedy(remedy))
        }
    }
}

fn switch_on(
    link: &mut Link,
    preflight: &Preflight,
    command: &Command,
    asked_to_stop: &dyn Fn() -> bool,
) -> Result<(), Halt> {
    let wanted = || if asked_to_stop() { Err(Halt::Asked) } else { Ok(()) };
    wanted()?;
    inject::point("arm-registers", 0);
    write_eeprom(link, preflight)?;
    for &(joint, register, raw) in &preflight.to_write {
        wanted()?;
        let limit = budget(link);
        let written = link.write_raw(joint, register, raw, limit);
        written.map_err(|e| exchange_error(link, Some(joint), &e))?;
        watchdog::expect_raw(link, joint, register, raw)?;
    }
    for &(joint, number, bits) in &preflight.settings {
        wanted()?;
        write_setting(link, joint, number, bits)?;
    }
    for joint in 0..link.robot().joints.len() {
        wanted()?;
        set_speed(link, joint, None)?;
        link.break_silence(watchdog::SILENCE / 4);
        let limit = budget(link);
        link.prepare(joint, limit).map_err(|e| exchange_error(link, Some(joint), &e))?;
    }
    // Where torque is on already, or comes with a goal, a goal moves the joint.
    look(link, command)?;
    wanted()?;
    clear_watchdogs(link, preflight, command)?;
    inject::point("arm-goals", 0);
    let limit = budget(link);
    link.write_goals(command, limit).map_err(|e| exchange_error(link, None, &e))?;
    for joint in 0..link.robot().joints.len() {
        wanted()?;
        expect_goal(link, joint, command)?;
    }
    watchdog::arm(link)?;
    let looked_at = look(link, command)?;
    wanted()?;
    inject::point("arm-torque", 0);
    set_torque_on(link, looked_at, preflight.held, &wanted)?;
    look_again(link, command)?;
    // The last word before the first cycle.
    wanted()
}

/// Clears the watchdogs that have stopped a servo.
///
/// While a servo is stopped its goals cannot be written, and the maker does not say what it does with
/// the old one when it is cleared (unconfirmed). So it is made as slow as it can be first, and the
/// goal to stay where it is is the very next word.
fn clear_watchdogs(link: &mut Link, preflight: &Preflight, command: &Command) -> Result<(), Error> {
    for &(joint, register) in &preflight.latched {
        set_speed(link, joint, Some(SLOWEST))?;
        let limit = budget(link);
        let cleared = link.write_raw(joint, register, 0, limit);
        let limit = budget(link);
        let told = link.write_goals(command, limit);
        cleared.map_err(|e| exchange_error(link, Some(joint), &e))?;
        told.map_err(|e| exchange_error(link, None, &e))?;
        watchdog::expect_raw(link, joint, register, 0)?;
        expect_goal(link, joint, command)?;
        set_speed(link, joint, None)?;
    }
    Ok(())
}

/// The goal of a servo is where it was told to stay.
fn expect_goal(link: &mut Link, joint: usize, command: &Command) -> Result<(), Error> {
    // An actuator tells no goal: that it still stands where it was is seen by a look.
    let Some(register) = link.robot().joints[joint].register(Role::GoalPosition) else {
        return Ok(());
    };
    let limit = budget(link);
    let raw = link.read_register(joint, register, limit);
    let raw = raw.map_err(|e| exchange_error(link, Some(joint), &e))?;
    let of = &link.robot().joints[joint];
    let goal_rad = of.model()?.si_from_raw(register, raw);
    let wanted_rad = of.servo_rad(command.goal_rad()[joint]);
    if (goal_rad - wanted_rad).abs() <= HOLD_RAD {
        return Ok(());
    }
    Err(Error::new("a servo did not keep its goal; torque stays off")
        .at(format!("joint {}", of.name))
        .got(format!("{:.2} deg", goal_rad.to_degrees()))
        .allowed(format!("{:.2} deg", wanted_rad.to_degrees())))
}

/// Lowers return delays as permitted, and reads as fast as the line then is.
fn write_eeprom(link: &mut Link, preflight: &Preflight) -> Result<(), Error> {
    for write in &preflight.eeprom {
        let limit = budget(link);
        let written = link.write_raw(write.joint, write.register, write.to, limit);
        written.map_err(|e| exchange_error(link, Some(write.joint), &e))?;
        watchdog::expect_raw(link, write.joint, write.register, write.to)?;
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

/// Torque moves a joint to its goal: it must still be there, as seen by a look that is not older
/// than [`FRESH`], or than the line takes. When its answers were there.
///
/// A host that stalls while it waits for the answers sees where the joints were before the stall; it
/// looks again.
fn look(link: &mut Link, command: &Command) -> Result<Instant, Error> {
    let mut quickest = Duration::MAX;
    for _ in 0..MOST_LOOKS {
        let asked_at = link.clock().now();
        check_where_it_was(link, command)?;
        let took = link.clock().now().since(asked_at);
        // Where every look takes long it is the line that does.
        if took <= FRESH || took <= quickest.saturating_mul(3) / 2 && quickest != Duration::MAX {
            return Ok(asked_at + took);
        }
        quickest = quickest.min(took);
    }
    Err(Error::of(ErrorKind::HostLate, "the host stalls; torque stays off")
        .got(format!("{MOST_LOOKS} looks at the joints, the quickest in {quickest:.0?}"))
        .allowed(format!("{FRESH:.0?}, or the same time twice"))
        .remedy("stop what else keeps this machine busy, then start again"))
}

fn check_where_it_was(link: &mut Link, command: &Command) -> Result<(), Error> {
    let present_rad = positions(link)?;
    for (index, (present, goal)) in present_rad.iter().zip(command.goal_rad()).enumerate() {
        let off_rad = (present - goal).abs();
        if !(off_rad <= HOLD_RAD) {
            let what = "a joint moved before torque came on; torque stays off";
            return Err(moved(what, &link.robot().joints[index].name, off_rad));
        }
    }
    Ok(())
}

/// Nobody can keep a hand from turning a joint, or an encoder from jumping, between the last look and
/// torque; that it did is seen now, and torque goes off again. (An actuator on a CAN line is looked at
/// by the answer to its first goal.)
fn look_again(link: &mut Link, command: &Command) -> Result<(), Error> {
    let has = |joint: &usize| link.robot().joints[*joint].register(Role::PresentPosition).is_some();
    let servos: Vec<usize> = (0..link.robot().joints.len()).filter(has).collect();
    let limit = budget(link);
    let told = link.registers(Role::PresentPosition, &servos, limit);
    for (joint, raw) in servos.into_iter().zip(told) {
        let Some(register) = link.robot().joints[joint].register(Role::PresentPosition) else {
            continue;
        };
        let raw = match raw {
            Some(raw) => raw,
            None => {
                let limit = budget(link);
                let asked = link.read_register(joint, register, limit);
                asked.map_err(|e| exchange_error(link, Some(joint), &e))?
            }
        };
        let of = &link.robot().joints[joint];
        let present_rad = of.model()?.si_from_raw(register, raw);
        let off_rad = (present_rad - of.servo_rad(command.goal_rad()[joint])).abs();
        if !(off_rad <= HOLD_RAD) {
            let what = "a joint moved as torque came on; torque is off again";
            return Err(moved(what, &of.name, off_rad));
        }
    }
    Ok(())
}

fn moved(what: &str, joint: &str, off_rad: f64) -> Error {
    Error::new(what)
        .at(format!("joint {joint}"))
        .got(format!("{:.1} deg from where it was", off_rad.to_degrees()))
        .allowed(format!("{:.1} deg", HOLD_RAD.to_degrees()))
        .remedy("hold the robot still, or support it, and start again")
}

/// Tells a servo that has a speed register for position moves not to exceed `raw`, or its joint's
/// limit.
fn set_speed(link: &mut Link, joint: usize, raw: Option<i64>) -> Result<(), Error> {
    let of = &link.robot().joints[joint];
    // A Dynamixel's Goal Velocity acts in velocity mode only; its moves obey Profile Velocity.
    let register = of.register(Role::ProfileVelocity).or_else(|| of.register(Role::GoalVelocity));
    let Some(register) = register else { return Ok(()) };
    let highest = of
        .model()?
        .raw_from_si(register, of.servo_speed_rad_s(of.limits.velocity_rad_s()))
        .map_err(|e| Error::new(e.to_string()).at(format!("joint {}", of.name)))?;
    // Zero is no limit at all in these registers; a servo that cannot be as fast is limited enough.
    let raw = raw.unwrap_or(highest).clamp(1, register.max.unwrap_or(i64::MAX).max(1));
    let limit = budget(link);
    let written = link.write_raw(joint, register, raw, limit);
    written.map_err(|e| exchange_error(link, Some(joint), &e))?;
    watchdog::expect_raw(link, joint, register, raw)?;
    link.remember_speed(joint, raw);
    Ok(())
}

/// Switches torque on on every joint at once, and reads it back. `looked_at`: when the joints were
/// last seen where they shall stay.
///
/// Nobody can keep a host from stalling between its last look and the word that switches torque on.
/// That it did is seen by the clock as soon as the word has left, and torque goes off again.
fn set_torque_on(
    link: &mut Link,
    looked_at: Instant,
    held: bool,
    wanted: &dyn Fn() -> Result<(), Halt>,
) -> Result<(), Halt> {
    let limit = budget(link);
    link.switch_on(limit).map_err(|e| exchange_error(link, None, &e))?;
    inject::point("arm-read-back", 0);
    let since = link.clock().now().since(looked_at);
    // A robot that was held stood under torque all the while.
    if since > FRESH && !held {
        return Err(Error::of(
            ErrorKind::HostLate,
            "the host stalled as torque came on; torque is off again",
        )
        .got(format!("{since:.0?} after the last look at the joints"))
        .allowed(format!("{FRESH:.0?}"))
        .remedy("look where the robot stands, and start again")
        .into());
    }
    for joint in 0..link.robot().joints.len() {
        wanted()?;
        link.break_silence(watchdog::SILENCE / 4);
        match torque_register(link, joint) {
            Some(register) => watchdog::expect_raw(link, joint, register, 1)?,
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
    inject::point("limp", 0);
    let mut unsure = Vec::new();
    for joint in 0..link.robot().joints.len() {
        let confirmed = match torque_register(link, joint) {
            Some(register) => {
                let limit = budget(link);
                link.write_raw(joint, register, 0, limit).is_ok()
                    && watchdog::expect_raw(link, joint, register, 0).is_ok()
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

#[cfg(test)]
mod tests;
