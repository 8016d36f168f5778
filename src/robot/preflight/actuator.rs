//! What is checked of CAN actuators: that they answer, mean the same by their numbers as the profile
//! does, and let go when their host dies.

use super::{Preflight, ask, place, positions};
use crate::device::actuator::{HostWatch, Setting, Wanted};
use crate::error::{Error, ErrorKind};
use crate::robot::Link;
use crate::time::Duration;
use crate::wire::can::Faults;
use std::collections::BTreeMap;

/// Cycles that must fit into the silence an actuator allows: one may be lost, and one late.
const CYCLES_OF_SILENCE: u32 = 3;

/// Longest wait for what actuators tell of themselves unasked, ten times a second.
const UNASKED: Duration = Duration::from_millis(150);

/// Runs the checks of this page on every joint with an actuator.
pub(super) fn check(link: &mut Link, found: &mut Preflight) -> Result<(), Error> {
    let joints: Vec<usize> = (0..link.robot().joints.len())
        .filter(|&joint| link.robot().joints[joint].actuator().is_some())
        .collect();
    if joints.is_empty() {
        return Ok(());
    }
    for &joint in &joints {
        check_watch(link, joint, found)?;
    }
    note_gains(link, &joints, found);
    let mut told = BTreeMap::new();
    for &joint in &joints {
        check_settings(link, joint, found, &mut told)?;
    }
    found
        .notes
        .extend(told.into_iter().map(|(told, names)| format!("{told}: {}", names.join(", "))));
    // What actuators tell with their positions, or unasked, comes before anybody looks at it.
    positions(link)?;
    let clock = std::sync::Arc::clone(link.clock());
    clock.sleep_until(clock.now() + UNASKED);
    positions(link).map(|_| ())
}

/// A drive that is told its gains goes on pulling when nobody tells it otherwise.
fn check_watch(link: &Link, joint: usize, found: &mut Preflight) -> Result<(), Error> {
    let Some(actuator) = link.robot().joints[joint].actuator() else { return Ok(()) };
    let timeout = &actuator.profile().timeout;
    let pulls = actuator.gains().is_some();
    match actuator.watch() {
        HostWatch::Never | HostWatch::Unsaid if pulls => {
            let never = actuator.watch() == HostWatch::Never;
            let refusal =
                Error::of(ErrorKind::NotReady, "an actuator may go on pulling when the host dies")
                    .at(place(link, joint))
                    .got(format!("{}: {}", actuator.profile().model, timeout.action))
                    .allowed("a drive told its gains only if it lets go of itself after a silence");
            Err(if never {
                refusal.remedy("take an actuator with a timeout")
            } else {
                refusal.remedy(
                    "set its timeout with the maker's tool, then say so in the robot file: \
                     timeout_configured_s",
                )
            })
        }
        HostWatch::Never | HostWatch::Unsaid => {
            found.notes.push(format!(
                "{}: nobody says that it lets go when the host falls silent; it would stay at its \
                 last goal",
                place(link, joint)
            ));
            Ok(())
        }
        HostWatch::Said(said_s) => {
            let needed_s = found.period.as_secs_f64() * f64::from(CYCLES_OF_SILENCE);
            if said_s >= needed_s {
                return Ok(());
            }
            Err(Error::of(ErrorKind::NotReady, "an actuator would let go between two goals")
                .at(place(link, joint))
                .got(format!("timeout_configured_s {said_s}"))
                .allowed(format!("at least {needed_s:.3} s, {CYCLES_OF_SILENCE} cycles"))
                .remedy("ask for a higher --rate, or set a longer timeout"))
        }
        HostWatch::Setting { .. } | HostWatch::InGoals => Ok(()),
    }
}

/// The gains the robot file states, for whoever stands by.
fn note_gains(link: &Link, joints: &[usize], found: &mut Preflight) {
    let mut policies: BTreeMap<String, Vec<&str>> = BTreeMap::new();
    for &joint in joints {
        let of = &link.robot().joints[joint];
        if let Some((kp, kd)) = of.actuator().and_then(|actuator| actuator.gains()) {
            let policy = format!("kp {kp} N m/rad, kd {kd} N m s/rad");
            policies.entry(policy).or_default().push(&of.name);
        }
    }
    for (policy, names) in policies {
        found.notes.push(format!("gains as the robot file states: {policy}: {}", names.join(", ")));
    }
}

/// `told`: what devices say of themselves, with the joints that say the same.
fn check_settings(
    link: &mut Link,
    joint: usize,
    found: &mut Preflight,
    told: &mut BTreeMap<String, Vec<String>>,
) -> Result<(), Error> {
    let Some(actuator) = link.robot().joints[joint].actuator() else { return Ok(()) };
    let (model, of) = (actuator.profile().model.clone(), link.robot().joints[joint].name.clone());
    for Setting { number, name, wanted } in actuator.settings() {
        let bits = ask(link, joint, |link, limit| link.read_setting(joint, number, limit))?;
        let at = || format!("{}, {name}", place(link, joint));
        match wanted {
            Wanted::Told => {
                told.entry(format!("{name} {}", wanted.words(bits))).or_default().push(of.clone());
            }
            _ if wanted.holds(bits) => {}
            Wanted::Written(wanted) => {
                found.notes.push(format!("{} is {bits}, set to {wanted} until power-off", at()));
                found.settings.push((joint, number, wanted));
            }
            Wanted::Near(expected) => {
                return Err(Error::of(
                    ErrorKind::NotReady,
                    "an actuator means something else by its numbers",
                )
                .at(at())
                .got(wanted.words(bits))
                .allowed(format!("{expected}, the range in the profile of {model}"))
                .remedy("correct the robot file's servo, or set the range with the maker's tool"));
            }
            Wanted::Exactly(expected) => {
                return Err(Error::of(
                    ErrorKind::NotReady,
                    "an actuator is not set up as the robot file says",
                )
                .at(at())
                .got(bits.to_string())
                .allowed(expected.to_string())
                .remedy("set it with the maker's tool, or correct the robot file"));
            }
        }
    }
    Ok(())
}

/// A fault that is not an earlier host's silence; that one is forgotten when the robot is armed.
pub(super) fn serious(link: &Link, joint: usize, bits: u16, found: &mut Preflight) -> bool {
    if link.robot().joints[joint].actuator().is_none() {
        return true;
    }
    if bits != Faults::SILENCE.bits() {
        return true;
    }
    found.notes.push(format!(
        "{}: it had let go when its host fell silent; that is forgotten",
        place(link, joint)
    ));
    false
}
