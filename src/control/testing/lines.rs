//! Rates that lines carry by computation, and the answers come too late for.

use super::{Bench, READ, SYNC_READ, Said, World, robot};
use crate::error::Error;
use crate::robot::preflight::{Accept, preflight};
use crate::time::Duration;

const MS: Duration = Duration::from_millis(1);
const NS: Duration = Duration::from_nanos(1);
const BYTE: Duration = Duration::from_micros(10);
/// A cycle of which 1.6 ms may be used.
const SHORT: Duration = Duration::from_millis(2);
/// Before the answers are timed the joint is looked at twice, whether it stands still.
const LOOKS: usize = 2;

fn said(bench: &mut Bench, period: Duration) -> Option<Error> {
    preflight(&mut bench.link, period, Accept { firmware: false, eeprom: false }).err()
}

fn reads(bench: &Bench) -> usize {
    bench.log().iter().filter(|said| said.instruction == SYNC_READ).count()
}

/// One servo that answers such that a read of it takes so long; its line could do it in a quarter.
fn taking(whole: Duration, latency: Duration) -> Bench {
    let mut bench = Bench::behind(robot(&[0]), latency);
    // How long it takes if nothing is held back: the question, 50 us, and the answer.
    let limit = bench.link.clock().now() + 100 * MS;
    bench.link.states(limit).expect("a line");
    let asked = bench.log().pop().expect("asked");
    let bytes = asked.params.len() + 6 + usize::from(asked.params[1]) + 6;
    let at_least = BYTE * u32::try_from(bytes).expect("few") + 50 * Duration::from_micros(1);
    assert!(at_least * 4 < whole, "{at_least:?}");
    bench.world.lock().answers_later = whole - at_least;
    bench.forget_log();
    bench
}

#[test]
fn answers_that_take_just_the_share_of_a_cycle_that_a_line_has_are_in_time() {
    let mut bench = taking(1600 * Duration::from_micros(1), MS);
    assert_eq!(said(&mut bench, SHORT), None);
    assert_eq!(reads(&bench), LOOKS + 5);
}

#[test]
fn answers_that_take_longer_than_that_refuse_the_rate() {
    let mut bench = taking(1600 * Duration::from_micros(1) + NS, MS);
    let error = said(&mut bench, SHORT).expect("refused");
    assert_eq!(error.what, "the robot answers too slowly for this rate");
    // 0.8 / 1.600001 ms, rounded down.
    assert_eq!(error.remedy.as_deref(), Some("ask for at most --rate 499"));
    assert_eq!(error.allowed.as_deref(), Some("1.60 ms (80 % of a cycle at 500 Hz)"));
    assert!(
        error.got.is_some_and(|got| got.starts_with("1.6 ms to read all joints (best of 5); "))
    );
    assert_eq!(reads(&bench), LOOKS + 5);
}

#[test]
fn an_adapter_is_suspected_of_what_takes_two_milliseconds_longer_than_computed() {
    let computed = {
        let mut bench = Bench::new(&[0]);
        let plans = bench.link.plan_reads(&[778], SHORT);
        Duration::from_secs_f64(plans[0].cycle_time_s)
    };
    let remedy = |whole: Duration| {
        let error = said(&mut taking(whole, 16 * MS), SHORT).expect("refused");
        assert_eq!(error.what, "the robot answers too slowly for this rate");
        error.remedy.expect("what to do")
    };
    for whole in [computed + MS, computed + 2 * MS] {
        assert!(!remedy(whole).contains("latency"), "{whole:?}");
    }
    for whole in [computed + 2 * MS + NS, computed + 10 * MS] {
        assert!(remedy(whole).contains("an FTDI adapter (U2D2) holds bytes back"), "{whole:?}");
    }
}

/// One servo, and a host that stands still at these of the reads that are timed.
fn late_at(tries: std::ops::Range<usize>) -> (Option<Error>, usize) {
    let mut bench = Bench::new(&[0]);
    let mut asked = 0;
    bench.world.at_each(move |world: &mut World, said: &Said| {
        if said.instruction == SYNC_READ {
            if asked >= LOOKS && tries.contains(&(asked - LOOKS)) {
                world.stall(30 * MS);
            }
            asked += 1;
        }
    });
    let said = said(&mut bench, 5 * MS);
    (said, reads(&bench) - LOOKS)
}

#[test]
fn a_host_that_was_late_times_the_line_anew() {
    assert_eq!(late_at(0..0), (None, 5));
    assert_eq!(late_at(0..4), (None, 5), "the best counts");
    assert_eq!(late_at(0..7), (None, 8));
    assert_eq!(late_at(0..19), (None, 20));
    let (said, tries) = late_at(0..99);
    let error = said.expect("refused");
    assert_eq!((error.what.as_str(), tries), ("this host is too late to hear the answers", 20));
}

#[test]
fn a_host_that_was_late_before_the_line_was_timed_does_not_excuse_it() {
    let mut bench = taking(1700 * Duration::from_micros(1), MS);
    let mut asked = 0;
    bench.world.at_each(move |world: &mut World, said: &Said| {
        asked += usize::from(said.instruction == READ);
        if asked == 1 {
            world.stall(30 * MS);
            asked += 1;
        }
    });
    let error = said(&mut bench, SHORT).expect("refused");
    assert!(bench.link.host_late() > Duration::ZERO);
    assert_eq!(error.what, "the robot answers too slowly for this rate");
    assert_eq!(reads(&bench), LOOKS + 5);
}
