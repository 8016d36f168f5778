//! The servos' own watch over their host: a servo that hears no instruction for 200 ms stops where
//! it is and obeys no goal until it is told to.
//!
//! (DYNAMIXEL e-Manual, Bus Watchdog: it counts while torque is on, and any instruction on the line
//! feeds it, whomever it is for. So every line must be spoken on while watchdogs are set.)

use crate::device::Actuator;
use crate::device::actuator::HostWatch;
use crate::error::{Error, counted, either};
use crate::robot::Link;
use crate::robot::preflight::{PATIENT_RETRIES, budget, exchange_error};
use crate::time::Duration;
use gaitway_profiles::{Register, Role};

/// Silence after which a servo stops by itself.
pub const SILENCE: Duration = Duration::from_millis(200);

/// The joints whose servos have a watchdog, on lines that are still there.
fn watched(link: &Link) -> Vec<(usize, &'static Register)> {
    let joints = link.robot().joints.iter().enumerate();
    let registers = joints.filter(|(_, joint)| !link.is_lost(joint.line));
    registers
        .filter_map(|(index, joint)| Some((index, joint.register(Role::BusWatchdog)?)))
        .collect()
}

fn set(link: &mut Link, joint: usize, register: &'static Register, raw: i64) -> Result<(), Error> {
    link.break_silence(SILENCE / 4);
    let limit = budget(link);
    let written = link.write_raw(joint, register, raw, limit);
    written.map_err(|e| exchange_error(link, Some(joint), &e))?;
    expect_raw(link, joint, register, raw)
}

/// Reads back what was written; the other lines are spoken on meanwhile.
pub(super) fn expect_raw(
    link: &mut Link,
    joint: usize,
    register: &Register,
    wanted: i64,
) -> Result<(), Error> {
    link.break_silence(SILENCE / 4);
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

/// Sets the watchdog of every servo that has one, and reads it back.
///
/// # Errors
/// A servo that does not take or keep it.
pub(super) fn arm(link: &mut Link) -> Result<(), Error> {
    for (joint, register) in watched(link) {
        let model = link.robot().joints[joint].model()?;
        let raw = model.raw_from_si(register, SILENCE.as_secs_f64());
        let raw = raw.map_err(|e| Error::new(e.to_string()))?;
        set(link, joint, register, raw)?;
    }
    for joint in actuators(link) {
        watch(link, joint, Some(SILENCE))?;
    }
    Ok(())
}

/// The joints with an actuator, on lines that are still there.
fn actuators(link: &Link) -> Vec<usize> {
    let joints = link.robot().joints.iter().enumerate();
    let there = joints.filter(|(_, of)| of.actuator().is_some() && !link.is_lost(of.line));
    there.map(|(joint, _)| joint).collect()
}

fn watch(link: &mut Link, joint: usize, silence: Option<Duration>) -> Result<(), Error> {
    link.break_silence(SILENCE / 4);
    let limit = budget(link);
    let set = link.watch_host(joint, silence, limit);
    set.map_err(|e| exchange_error(link, Some(joint), &e))
}

/// Joints whose actuators let go by themselves, after what silence, s, since nothing on the line
/// can change it.
fn lets_go(link: &Link) -> Vec<(&str, f64)> {
    let joints = actuators(link).into_iter().map(|joint| &link.robot().joints[joint]);
    let said = joints.filter_map(|of| match of.actuator()?.watch() {
        HostWatch::Said(said_s) => Some((of.name.as_str(), said_s)),
        _ => None,
    });
    said.collect()
}

/// What became of the watchdogs.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Released {
    /// Joints whose watchdog is off again.
    pub off: Vec<String>,
    /// Joints that did not confirm it: their servos may stop where they are.
    pub unsure: Vec<String>,
    /// Joints whose watchdog has stopped the servo already. It is left so: what such a servo does
    /// with its old goal when it is cleared is not known.
    pub bitten: Vec<String>,
}

/// Questions in a row that a line may leave unanswered before the rest of it is not asked any more.
const SILENT_JOINTS: usize = 3;

/// Switches every watchdog off, so that a robot that is left holding goes on holding.
pub fn release(link: &mut Link) -> Released {
    link.set_retries(PATIENT_RETRIES);
    let mut released = Released::default();
    let mut silent = vec![0; link.robot().lines.len()];
    for (joint, register) in watched(link) {
        let of = &link.robot().joints[joint];
        let (name, line) = (of.name.clone(), of.line);
        if silent[line] >= SILENT_JOINTS {
            released.unsure.push(name);
            continue;
        }
        link.break_silence(SILENCE / 4);
        let limit = budget(link);
        let found = link.read_register(joint, register, limit);
        let latched = |raw: i64| register.max.is_some_and(|max| raw > max);
        match found {
            Ok(raw) if latched(raw) => released.bitten.push(name),
            Ok(0) => released.off.push(name),
            Ok(_) if set(link, joint, register, 0).is_ok() => released.off.push(name),
            Ok(_) => released.unsure.push(name),
            Err(_) => {
                silent[line] += 1;
                released.unsure.push(name);
                continue;
            }
        }
        silent[line] = 0;
    }
    for joint in actuators(link) {
        let of = link.robot().joints[joint].actuator().map(Actuator::watch);
        if matches!(of, Some(HostWatch::Setting { .. } | HostWatch::InGoals)) {
            let name = link.robot().joints[joint].name.clone();
            match watch(link, joint, None) {
                Ok(()) => released.off.push(name),
                Err(_) => released.unsure.push(name),
            }
        }
    }
    released.unsure.extend(on_lost_lines(link));
    released
}

/// Joints with a watchdog on lines that are lost.
fn on_lost_lines(link: &Link) -> Vec<String> {
    let joints = link.robot().joints.iter().filter(|joint| link.is_lost(joint.line));
    let watched = joints.filter(|joint| joint.register(Role::BusWatchdog).is_some());
    watched.map(|joint| joint.name.clone()).collect()
}

impl Released {
    /// What a person should know of it.
    #[must_use]
    pub fn words(&self, link: &Link) -> Vec<String> {
        let millis = SILENCE.as_millis();
        let mut notes = Vec::new();
        let by_themselves = lets_go(link);
        if let Some((_, shortest_s)) =
            by_themselves.iter().min_by(|(_, a), (_, b)| a.total_cmp(b)).copied()
        {
            let names: Vec<&str> = by_themselves.iter().map(|(name, _)| *name).collect();
            notes.push(format!(
                "let go {shortest_s} s after the host's last word, as set with the maker's tool, \
                 and are not held from then on: {}",
                names.join(", ")
            ));
        }
        if !self.off.is_empty() {
            let servos = counted(self.off.len(), "servo");
            notes.push(format!(
                "{servos} would have stopped by {} {millis} ms after the host's last \
                 word; now that nothing moves, that watch is off again",
                either(self.off.len(), "itself", "themselves")
            ));
        }
        if !self.unsure.is_empty() {
            notes.push(format!(
                "the bus watchdog may still be on in {}: such a servo stops {millis} ms after the \
                 host's last word and obeys no goal; the next start switches it off",
                self.unsure.join(", ")
            ));
        }
        if !self.bitten.is_empty() {
            notes.push(format!(
                "the bus watchdog has stopped {}: the next start clears it",
                self.bitten.join(", ")
            ));
        }
        notes
    }
}

#[cfg(test)]
mod tests;
