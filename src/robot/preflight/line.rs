//! Whether the lines carry the rate asked for: by computation, and by trying.

use super::{Accept, Preflight, QUESTION, ask, exchange_error, host_late, place};
use crate::bus::Protocol;
use crate::error::{Error, ErrorKind};
use crate::robot::Link;
use crate::robot::reading::{LINE_SHARE, LinePlan};
use crate::time::Duration;
use gaitway_profiles::{Register, Role};

/// Whole rounds of reading that are timed; the shortest counts, since a busy host makes some long.
const TRIES: usize = 5;
/// So many at most, if none fits and this host was late meanwhile.
const MOST_TRIES: usize = 20;
/// What an answer may take beyond the computed time before the adapter is suspected.
const ADAPTER_MARGIN: Duration = Duration::from_millis(2);

/// A configuration register that is written for good, with the user's permit.
#[derive(Clone, Debug)]
pub struct EepromWrite {
    /// Index of the joint.
    pub joint: usize,
    /// What is written.
    pub register: &'static Register,
    /// Raw value found.
    pub from: i64,
    /// Raw value written.
    pub to: i64,
}

/// The return delay register of a joint.
fn return_delay(link: &Link, joint: usize) -> Option<&'static Register> {
    link.robot().joints[joint].register(Role::ReturnDelay)
}

/// Reads how long each servo waits before it answers; the longest on a line counts.
pub(super) fn check_return_delays(link: &mut Link, found: &mut Preflight) -> Result<(), Error> {
    found.return_delay_raw = vec![0; link.robot().joints.len()];
    let mut longest_s = vec![0.0_f64; link.robot().lines.len()];
    for joint in 0..link.robot().joints.len() {
        let Some(register) = return_delay(link, joint) else { continue };
        let raw = ask(link, joint, |link, limit| link.read_register(joint, register, limit))?;
        let of = &link.robot().joints[joint];
        let Some(servo) = of.servo() else { continue };
        if let Some(&stated) = servo.setup.get(&register.name).filter(|&&stated| stated != raw) {
            let name = &register.name;
            found.notes.push(format!(
                "{}: {name} is {raw}, not {stated} as in the robot file; the line is timed by it",
                place(link, joint)
            ));
        }
        found.return_delay_raw[joint] = raw;
        let longest_s = &mut longest_s[of.line];
        *longest_s = longest_s.max(servo.model.si_from_raw(register, raw));
    }
    for (line, longest_s) in longest_s.into_iter().enumerate() {
        link.set_return_delay(line, Duration::from_secs_f64(longest_s.clamp(0.0, 1.0)));
    }
    Ok(())
}

/// Plans the reads and refuses a rate that some line cannot carry.
pub(super) fn check_line_speed(
    link: &mut Link,
    period: Duration,
    accept: Accept,
    found: &mut Preflight,
) -> Result<(), Error> {
    let mut plans = link.plan_reads(&found.firmware, period);
    let fit = plans.iter().all(|plan| plan.fits);
    if !fit || plans.iter().any(|plan| plan.turns > 1) {
        let delays = link.return_delays();
        let lowered = plans_without_delay(link, &found.firmware, period);
        let mends = lowered.iter().all(|plan| plan.fits)
            && plans.iter().zip(&lowered).any(|(now, then)| !now.fits || then.turns < now.turns);
        if mends && accept.eeprom && !found.held {
            plan_delay_writes(link, &plans, found);
            plans = lowered;
        } else if !fit {
            let each = plans.iter().zip(&lowered).zip(delays);
            let slowest = each.max_by(|((a, _), _), ((b, _), _)| slower(a, b));
            return slowest.map_or(Ok(()), |((plan, lowered), delay)| {
                Err(too_slow(plan, lowered, delay, found.held))
            });
        } else if mends {
            found.notes.push(
                "if the servos did not wait before they answer (Return Delay Time), every joint \
                 could be read more often; --permit-eeprom has that written"
                    .to_owned(),
            );
        }
    }
    if let Some(slowest) = plans.iter().max_by(|a, b| slower(a, b)) {
        found.wire_limit_hz = slowest.limit_hz;
        found.bus_load = slowest.load();
    }
    found.lines = plans;
    Ok(())
}

fn slower(a: &LinePlan, b: &LinePlan) -> std::cmp::Ordering {
    a.cycle_time_s.total_cmp(&b.cycle_time_s)
}

/// The plans as they would be if no servo waited before it answers. Leaves the link as it was.
fn plans_without_delay(link: &mut Link, firmware: &[u16], period: Duration) -> Vec<LinePlan> {
    let now = link.return_delays();
    (0..now.len()).for_each(|line| link.set_return_delay(line, Duration::ZERO));
    let plans = link.plan_reads(firmware, period);
    now.into_iter().enumerate().for_each(|(line, delay)| link.set_return_delay(line, delay));
    link.plan_reads(firmware, period);
    plans
}

/// Notes the return delays that arming will lower on lines that are too slow.
fn plan_delay_writes(link: &Link, plans: &[LinePlan], found: &mut Preflight) {
    for joint in 0..link.robot().joints.len() {
        let from = found.return_delay_raw[joint];
        let Some(register) = return_delay(link, joint) else { continue };
        let to = register.min.unwrap_or(0);
        let of = &link.robot().joints[joint];
        let plan = &plans[of.line];
        // Feetech's register is said to do nothing, and its EEPROM is locked besides.
        let protocol = of.servo().map(|servo| servo.model.protocol());
        let dynamixel = matches!(protocol, Some(Protocol::Dynamixel1 | Protocol::Dynamixel2));
        if plan.fits && plan.turns == 1 || from <= to || !dynamixel {
            continue;
        }
        found.eeprom.push(EepromWrite { joint, register, from, to });
        found.notes.push(format!(
            "{}: {} is lowered from {from} to {to} in EEPROM as permitted; to undo, write {from} \
             to register {} of ID {}",
            place(link, joint),
            register.name,
            register.address,
            of.id
        ));
    }
}

fn too_slow(plan: &LinePlan, lowered: &LinePlan, delay: Duration, held: bool) -> Error {
    let rate = |plan: &LinePlan| (LINE_SHARE * plan.limit_hz).floor();
    let mut remedy = format!("ask for at most --rate {:.0}, or raise the line speed", rate(plan));
    let gain_s = plan.cycle_time_s - lowered.cycle_time_s;
    if rate(lowered) > rate(plan) {
        remedy.push_str(&format!(
            "; the servos wait {:.0} us before each answer (Return Delay Time): without that wait \
             a cycle takes {:.2} ms less and up to {:.0} Hz fit",
            delay.as_secs_f64() * 1e6,
            gain_s * 1e3,
            rate(lowered)
        ));
        if lowered.fits {
            remedy.push_str("; add --permit-eeprom to have it written into the servos");
        }
        if lowered.fits && held {
            remedy.push_str(", which needs torque off: `gaitway limp` first");
        }
    }
    Error::of(ErrorKind::TooSlow, "the line is too slow for this rate")
        .at(format!("line {}, {}", plan.line, plan.method))
        .got(format!("{:.2} ms of line time per cycle", plan.cycle_time_s * 1e3))
        .allowed(allowed(plan.period_s))
        .remedy(remedy)
}

fn allowed(period_s: f64) -> String {
    format!(
        "{:.2} ms ({:.0} % of a cycle at {:.0} Hz)",
        LINE_SHARE * period_s * 1e3,
        LINE_SHARE * 100.0,
        1.0 / period_s
    )
}

/// Times real reads: adapters hold bytes back for reasons no computation knows.
pub(super) fn check_measured(link: &mut Link, found: &Preflight) -> Result<(), Error> {
    if !found.eeprom.is_empty() {
        return Ok(()); // the servos are still as slow as they were
    }
    let (period, plans) = (found.period, &found.lines);
    let clock = std::sync::Arc::clone(link.clock());
    let turns = plans.iter().map(|plan| plan.turns).max().unwrap_or(1);
    let mut best = vec![Duration::MAX; turns];
    let late_before = link.host_late();
    let period_s = period.as_secs_f64();
    let fits = |measured: Duration| measured.as_secs_f64() <= LINE_SHARE * period_s;
    for turn in 0..MOST_TRIES {
        let late_so_far = link.host_late() - late_before;
        let measured = best.iter().max().copied().unwrap_or_default();
        // A host that was late has not measured the line.
        if turn >= TRIES && (fits(measured) || late_so_far == Duration::ZERO) {
            break;
        }
        for best in &mut best {
            let began = clock.now();
            link.states(began + QUESTION).map_err(|e| exchange_error(link, None, &e))?;
            *best = clock.now().since(began).min(*best);
        }
    }
    let measured = best.into_iter().max().unwrap_or_default();
    if fits(measured) {
        return Ok(());
    }
    let late = link.host_late() - late_before;
    if late > Duration::ZERO {
        return Err(host_late(link.robot().name.clone(), late));
    }
    let computed_s = plans.iter().map(|plan| plan.cycle_time_s).fold(0.0, f64::max);
    let rate_hz = (LINE_SHARE / measured.as_secs_f64()).floor();
    let mut remedy = format!("ask for at most --rate {rate_hz:.0}");
    if measured > Duration::from_secs_f64(computed_s) + ADAPTER_MARGIN {
        remedy.push_str(
            "; an FTDI adapter (U2D2) holds bytes back for 16 ms unless its latency timer is set: \
             install the rules in udev/, or this one: ACTION==\"add\", \
             SUBSYSTEM==\"usb-serial\", DRIVER==\"ftdi_sio\", ATTR{latency_timer}=\"1\"",
        );
    }
    Err(Error::of(ErrorKind::TooSlow, "the robot answers too slowly for this rate")
        .at(link.robot().name.clone())
        .got(format!(
            "{:.1} ms to read all joints (best of {TRIES}); {:.1} ms by computation",
            measured.as_secs_f64() * 1e3,
            computed_s * 1e3
        ))
        .allowed(allowed(period_s))
        .remedy(remedy))
}

#[cfg(test)]
mod tests;
