//! The servos' own watch over their host: a servo that hears no instruction for 200 ms stops where
//! it is and obeys no goal until it is told to.
//!
//! (DYNAMIXEL e-Manual, Bus Watchdog: it counts while torque is on, and any instruction on the line
//! feeds it, whomever it is for. So every line must be spoken on while watchdogs are set.)

use super::arm::expect_raw;
use crate::error::Error;
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
        .filter_map(|(index, joint)| Some((index, joint.model.register(Role::BusWatchdog).ok()?)))
        .collect()
}

fn set(link: &mut Link, joint: usize, register: &'static Register, raw: i64) -> Result<(), Error> {
    link.break_silence(SILENCE / 4);
    let limit = budget(link);
    let written = link.write_raw(joint, register, raw, limit);
    written.map_err(|e| exchange_error(link, Some(joint), &e))?;
    expect_raw(link, joint, register, raw)
}

/// Sets the watchdog of every servo that has one, and reads it back.
///
/// # Errors
/// A servo that does not take or keep it.
pub(super) fn arm(link: &mut Link) -> Result<(), Error> {
    for (joint, register) in watched(link) {
        let raw = link.robot().joints[joint].model.raw_from_si(register, SILENCE.as_secs_f64());
        let raw = raw.map_err(|e| Error::new(e.to_string()))?;
        set(link, joint, register, raw)?;
    }
    Ok(())
}

/// Switches every watchdog off, so that a robot that is left holding goes on holding. What a
/// person should know of it, in words.
pub fn release(link: &mut Link) -> Vec<String> {
    link.set_retries(PATIENT_RETRIES);
    let watched = watched(link);
    let mut unsure = Vec::new();
    for &(joint, register) in &watched {
        if set(link, joint, register, 0).is_err() {
            unsure.push(link.robot().joints[joint].name.clone());
        }
    }
    if watched.is_empty() {
        return Vec::new();
    }
    if unsure.is_empty() {
        let (joints, millis) = (watched.len(), SILENCE.as_millis());
        return vec![format!(
            "while it moved, {joints} servos would have stopped by themselves {millis} ms after \
             the host's last word; that watch is off again"
        )];
    }
    vec![format!(
        "the bus watchdog may still be on in {}: such a servo stands still and obeys no goal; the \
         next start switches it off",
        unsure.join(", ")
    )]
}
