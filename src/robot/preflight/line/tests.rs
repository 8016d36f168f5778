//! Which rates lines carry, by computation, over lines on which nothing is said.

use super::*;
use crate::port::{BytePort, Closed, MonotonicClock};
use crate::robot::Robot;
use std::sync::Arc;

const STRICT: Accept = Accept { firmware: false, eeprom: false };
const PERMIT: Accept = Accept { firmware: false, eeprom: true };
/// What an XM430 leaves the factory with, in steps of 2 us.
const FACTORY: i64 = 250;
const WAITS: Duration = Duration::from_micros(500);

/// Twenty XM430 at 2 Mbit/s, of which the last one is on a line of its own.
fn two_lines() -> Robot {
    let mut file = Robot::load("op3").expect("shipped").file;
    let mut line = file.lines[0].clone();
    line.name = "other".to_owned();
    file.lines.push(line);
    file.joints.last_mut().expect("twenty").line = "other".to_owned();
    Robot::new(file).expect("a robot")
}

/// Their lines, on which every servo waits so long before it answers, and what was found of them.
fn waiting(robot: Robot, raw: i64, delay: Duration) -> (Link, Preflight) {
    let closed = || (Box::new(Closed) as Box<dyn BytePort>, Duration::ZERO);
    let ports = robot.lines.iter().map(|_| closed()).collect();
    let joints = robot.joints.len();
    let lines = robot.lines.len();
    let mut link = Link::new(robot, ports, Arc::new(MonotonicClock));
    (0..lines).for_each(|line| link.set_return_delay(line, delay));
    // None that knows the fast instructions, to which all answer without a pause in between.
    let firmware = vec![1; joints];
    (
        link,
        Preflight { return_delay_raw: vec![raw; joints], firmware, ..Preflight::of("", hz(100.0)) },
    )
}

fn hz(rate: f64) -> Duration {
    Duration::from_secs_f64(1.0 / rate)
}

/// What is planned at this rate if the servos wait so long or not, without any check.
fn plans(delay: Duration, rate_hz: f64) -> Vec<LinePlan> {
    let (mut link, found) = waiting(two_lines(), 0, delay);
    link.plan_reads(&found.firmware, hz(rate_hz))
}

/// Of each line, whether it carries the rate, and in how many turns joints are read.
fn carries(delay: Duration, rate_hz: f64) -> Vec<(bool, usize)> {
    plans(delay, rate_hz).iter().map(|plan| (plan.fits, plan.turns)).collect()
}

/// At these rates the first line reads all joints in each cycle, some, and is too slow, as the
/// servos leave the factory; too slow also for servos that do not wait.
const EASY: f64 = 40.0;
const IN_TURNS: f64 = 120.0;
const TOO_FAST: f64 = 300.0;
const HOPELESS: f64 = 3000.0;

#[test]
fn the_rates_of_these_tests_are_what_they_are_called() {
    assert_eq!(carries(WAITS, EASY), [(true, 1), (true, 1)]);
    let at = carries(WAITS, IN_TURNS);
    assert!(at[0].0 && at[0].1 > 1 && at[1] == (true, 1), "{at:?}");
    assert_eq!(carries(Duration::ZERO, IN_TURNS), [(true, 1), (true, 1)]);
    assert!(!carries(WAITS, TOO_FAST)[0].0 && carries(WAITS, TOO_FAST)[1] == (true, 1));
    assert!(carries(Duration::ZERO, TOO_FAST).iter().all(|(fits, _)| *fits));
    assert!(!carries(Duration::ZERO, HOPELESS)[0].0);
}

/// What is said of this rate, with the link as it was left.
fn at(
    rate_hz: f64,
    delay: Duration,
    accept: Accept,
    held: bool,
) -> (Result<(), Error>, Preflight, Link) {
    let (mut link, mut found) = waiting(two_lines(), FACTORY, delay);
    found.held = held;
    let said = check_line_speed(&mut link, hz(rate_hz), accept, &mut found);
    (said, found, link)
}

/// The rate a plan leaves room for, with the fifth that is kept free.
fn room(plan: &LinePlan) -> f64 {
    (0.8 / plan.cycle_time_s).floor()
}

#[test]
fn a_rate_that_all_lines_carry_is_told_with_the_slowest() {
    for accept in [STRICT, PERMIT] {
        let (said, found, link) = at(EASY, WAITS, accept, false);
        said.expect("it fits");
        let plans = plans(WAITS, EASY);
        assert_eq!(found.lines, plans);
        assert!(plans[0].cycle_time_s > 2.0 * plans[1].cycle_time_s);
        assert_eq!((found.wire_limit_hz, found.bus_load), (plans[0].limit_hz, plans[0].load()));
        assert_eq!((found.notes.len(), found.eeprom.len()), (0, 0));
        assert_eq!(link.return_delays(), [WAITS; 2]);
    }
}

const OFTEN: &str = "if the servos did not wait before they answer (Return Delay Time), every joint \
                     could be read more often; --permit-eeprom has that written";

#[test]
fn joints_that_are_read_in_turns_since_servos_wait_are_a_note() {
    // A robot that is held cannot be written to.
    for (accept, held) in [(STRICT, false), (STRICT, true), (PERMIT, true)] {
        let (said, found, link) = at(IN_TURNS, WAITS, accept, held);
        said.expect("it fits");
        assert_eq!((found.notes, found.eeprom.len()), (vec![OFTEN.to_owned()], 0));
        assert_eq!(found.lines, plans(WAITS, IN_TURNS));
        assert_eq!(link.return_delays(), [WAITS; 2], "as it was");
    }
    // The same on the only line of a robot.
    let (mut link, mut found) = waiting(Robot::load("op3").expect("shipped"), FACTORY, WAITS);
    check_line_speed(&mut link, hz(IN_TURNS), STRICT, &mut found).expect("it fits");
    assert_eq!(found.notes, [OFTEN]);
}

#[test]
fn joints_that_are_read_in_turns_although_nobody_waits_are_no_note() {
    // Too much for one turn of a line on which nobody waits.
    let rate_hz = (200..1000)
        .step_by(20)
        .map(f64::from)
        .find(|&rate_hz| matches!(carries(Duration::ZERO, rate_hz)[..], [(true, 2..), (true, _)]));
    for accept in [STRICT, PERMIT] {
        let (said, found, _) = at(rate_hz.expect("one"), Duration::ZERO, accept, false);
        said.expect("it fits");
        assert_eq!((found.notes.len(), found.eeprom.len()), (0, 0));
    }
}

#[test]
fn where_it_is_permitted_the_servos_of_a_slow_line_are_to_be_told_to_wait_no_more() {
    for rate_hz in [IN_TURNS, TOO_FAST] {
        let (mut link, mut found) = waiting(two_lines(), FACTORY, WAITS);
        found.return_delay_raw[3] = 0;
        check_line_speed(&mut link, hz(rate_hz), PERMIT, &mut found).expect("it will fit");
        // Not the one that does not wait, nor the one on a line that is fast enough.
        let joints: Vec<usize> = found.eeprom.iter().map(|write| write.joint).collect();
        assert_eq!(joints, (0..19).filter(|&joint| joint != 3).collect::<Vec<usize>>());
        for EepromWrite { register, from, to, .. } in &found.eeprom {
            assert_eq!((&*register.name, *from, *to), ("Return Delay Time", FACTORY, 0));
        }
        assert_eq!(found.notes.len(), 18);
        assert!(found.notes[0].contains("is lowered from 250 to 0 in EEPROM as permitted"));
        assert_eq!(found.lines, plans(Duration::ZERO, rate_hz));
    }
}

#[test]
fn a_servo_whose_register_is_said_to_do_nothing_is_not_written_to() {
    let robot = Robot::load("open-duck-mini-v2").expect("shipped");
    let (mut link, mut found) = waiting(robot, FACTORY, WAITS);
    let rate_hz = (20..400).map(f64::from).find(|&rate_hz| {
        link.plan_reads(&found.firmware, hz(rate_hz)).iter().any(|plan| plan.turns > 1)
    });
    let rate_hz = rate_hz.expect("one");
    check_line_speed(&mut link, hz(rate_hz), PERMIT, &mut found).expect("it fits");
    assert!(found.eeprom.is_empty());
}

/// Why this rate is refused.
fn refused(rate_hz: f64, delay: Duration, accept: Accept, held: bool) -> Error {
    let (said, found, _) = at(rate_hz, delay, accept, held);
    assert!(found.eeprom.is_empty());
    let error = said.expect_err("refused");
    assert_eq!(error.what, "the line is too slow for this rate");
    let place = error.place.clone().unwrap_or_default();
    assert!(place.starts_with("line body, "), "the slowest: {place}");
    error
}

#[test]
fn a_rate_that_a_line_does_not_carry_is_refused_with_what_would_help() {
    let (now, then) = (&plans(WAITS, TOO_FAST)[0], &plans(Duration::ZERO, TOO_FAST)[0]);
    let less_ms = (now.cycle_time_s - then.cycle_time_s) * 1e3;
    let lower = format!(
        "ask for at most --rate {:.0}, or raise the line speed; the servos wait 500 us before each \
         answer (Return Delay Time): without that wait a cycle takes {less_ms:.2} ms less and up to \
         {:.0} Hz fit; add --permit-eeprom to have it written into the servos",
        room(now),
        room(then)
    );
    let error = refused(TOO_FAST, WAITS, STRICT, false);
    assert_eq!(error.remedy.as_deref(), Some(&*lower));
    // 0.8 / 300 s.
    assert_eq!(error.allowed.as_deref(), Some("2.67 ms (80 % of a cycle at 300 Hz)"));
    let limp = format!("{lower}, which needs torque off: `gaitway limp` first");
    for accept in [STRICT, PERMIT] {
        assert_eq!(refused(TOO_FAST, WAITS, accept, true).remedy.as_deref(), Some(&*limp));
    }
}

#[test]
fn a_rate_that_lines_would_not_carry_either_if_nobody_waited_writes_nothing() {
    for (accept, held) in [(STRICT, false), (PERMIT, false), (PERMIT, true)] {
        let remedy = refused(HOPELESS, WAITS, accept, held).remedy.expect("what to do");
        assert!(remedy.contains("without that wait") && remedy.ends_with(" Hz fit"), "{remedy}");
    }
    // Nobody waits, or not for so long that it would help.
    for delay in [Duration::ZERO, Duration::from_nanos(1)] {
        let (now, then) = (&plans(delay, HOPELESS)[0], &plans(Duration::ZERO, HOPELESS)[0]);
        assert_eq!(room(now), room(then));
        let said = format!("ask for at most --rate {:.0}, or raise the line speed", room(now));
        assert_eq!(refused(HOPELESS, delay, STRICT, false).remedy.as_deref(), Some(&*said));
    }
}

#[test]
fn a_can_line_that_does_not_carry_the_rate_is_refused() {
    let robot = Robot::load("berkeley-humanoid-lite").expect("shipped");
    let lines = robot.lines.len();
    let quiet = crate::port::sim::SharedWorld::new(
        gaitway_sim::World::new(&robot.file, gaitway_sim::Options::default()).expect("virtual"),
    );
    let port = |line| -> Box<dyn crate::port::FramePort> {
        Box::new(crate::port::sim::VirtualCanLine::new(quiet.clone(), line))
    };
    let ports = (0..lines).map(|line| (port(line), Duration::ZERO)).collect();
    let mut link = Link::new(robot, ports, Arc::new(MonotonicClock));
    let said = |link: &mut Link, rate_hz| {
        check_line_speed(link, hz(rate_hz), STRICT, &mut Preflight::of("", hz(rate_hz)))
    };
    assert_eq!(said(&mut link, 200.0), Ok(()));
    let error = said(&mut link, 5000.0).expect_err("refused");
    assert_eq!(error.what, "the line is too slow for this rate");
}
