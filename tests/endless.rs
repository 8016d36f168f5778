//! A motion that is played again and again until it is stopped, in virtual time.

mod program;

use gaitway::job::observer::Observer;
use gaitway::job::play::{Options, PlayOrder, Rounds, play};
use gaitway::job::report::{Outcome, PlayReport};
use gaitway::job::source::MotionOrder;
use gaitway::recording;
use gaitway::robot::Robot;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

/// Wants it to end once it was asked so often; it is asked in every cycle.
struct After {
    cycles: u64,
    asked: AtomicU64,
}

impl Observer for After {
    fn wants_to_stop(&self) -> bool {
        self.asked.fetch_add(1, Ordering::Relaxed) >= self.cycles
    }
}

fn played(motion: &str, rounds: Rounds, cycles: u64, record: &Path) -> PlayReport {
    let order = PlayOrder {
        motion: MotionOrder::of(motion),
        robot: "op3".to_owned(),
        buses: vec!["sim".parse().expect("an address")],
        calibration: None,
        seed: 1,
        options: Options {
            rounds,
            record: Some(record.to_owned()),
            replace: true,
            hangs: true,
            ..Options::default()
        },
    };
    play(&order, &After { cycles, asked: AtomicU64::new(0) }).report
}

/// Goals of a recording, `[cycle][joint]`, rad.
fn goals(record: &Path) -> Vec<Vec<f64>> {
    let cycles = recording::read(record).expect("a recording").cycles;
    let goal = |cycle: &recording::CycleRecord| {
        cycle.joints.iter().map(|joint| joint.goal_rad.unwrap_or(f64::NAN)).collect()
    };
    cycles.iter().map(goal).collect()
}

#[test]
fn a_motion_without_end_is_the_same_in_every_round_joins_without_a_jump_and_ends_at_rest() {
    let folder = program::folder("endless");
    let limits = Robot::load("op3").expect("shipped").limits();
    for motion in ["wave-r", "bow", "walk"] {
        let file = folder.join(format!("{motion}.mcap"));
        let once = played(motion, Rounds::Times(1), u64::MAX, &file);
        assert_eq!(once.outcome, Outcome::Done, "{:?}", once.stop_reason);
        let round_s = once.duration_s - once.approach_s;
        // Five rounds and a part of the next.
        let rate_hz = once.cycle_hz;
        let wanted = ((once.duration_s + 4.4 * round_s) * rate_hz) as u64;
        let report = played(motion, Rounds::Endless, wanted, &file);
        assert_eq!(report.outcome, Outcome::Stopped);
        assert_eq!(report.stop_reason.as_deref(), Some("stopped as asked"));
        let broken = report.referee.map(|referee| referee.violations);
        assert_eq!(broken.map(|broken| broken.len()), Some(0), "{motion}");
        assert!(report.duration_s > once.duration_s + 3.0 * round_s, "{motion}");
        let goals = goals(&file);
        let (first, last) = (&goals[0], &goals[goals.len() - 1]);
        assert_eq!((&goals[1], &goals[goals.len() - 2]), (first, last), "{motion}: at rest");
        // From cycle to cycle no goal asks more than a stop may (twice the limit), seams among them.
        for window in goals.windows(3) {
            for (joint, limits) in limits.iter().enumerate() {
                let [one, two, three] = [0, 1, 2].map(|at: usize| window[at][joint]);
                let asked = (three - 2.0 * two + one).abs() * rate_hz * rate_hz;
                let most = 2.0 * limits.acceleration_rad_s2();
                assert!(asked <= most * 1.01, "{motion}, joint {joint}: {asked} of {most}");
            }
        }
        // A later round is an earlier one, some whole number of cycles apart, to a cycle's rounding.
        let fastest = limits.iter().map(|of| of.velocity_rad_s()).fold(0.0, f64::max);
        let at = |s: f64| (s * rate_hz).round() as usize;
        let from = at(once.duration_s);
        let period = (1..at(2.0 * round_s) + 2).min_by(|one, two| {
            let apart = |by: usize| -> f64 {
                let pairs = (from..from + at(round_s)).map(|n| (&goals[n], &goals[n + by]));
                pairs.flat_map(|(a, b)| a.iter().zip(b)).map(|(a, b)| (a - b).abs()).sum()
            };
            let least = at(0.9 * round_s);
            let of = |by: &usize| if *by < least { f64::INFINITY } else { apart(*by) };
            of(one).total_cmp(&of(two))
        });
        let period = period.expect("a period");
        for n in from..goals.len().saturating_sub(period + at(1.0)) {
            for (one, other) in goals[n].iter().zip(&goals[n + period]) {
                let off = (one - other).abs();
                assert!(off <= fastest / rate_hz, "{motion}: {off} rad after {period} cycles");
            }
        }
    }
}

#[test]
fn a_page_of_a_motion_without_end_is_refused() {
    let output = program::gaitway()
        .args(["play", "bow", "--robot", "op3", "--bus", "sim", "--loop", "--html", "x.html"])
        .output()
        .expect("runs");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(String::from_utf8_lossy(&output.stdout).contains("without end"), "{output:?}");
}

#[test]
fn a_motion_without_end_does_not_go_limp_at_its_end() {
    let output = program::gaitway()
        .args("play bow --robot op3 --bus sim --loop --end limp".split(' '))
        .output()
        .expect("runs");
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert_eq!(output.status.code(), Some(1), "{said}");
    for words in ["--end limp", "--loop N", "gaitway limp"] {
        assert!(said.contains(words), "{said}");
    }
    // One that ends goes limp at its end, however often it is played.
    let output = program::gaitway()
        .args("play bow --robot op3 --bus sim --loop 2 --end limp --json".split(' '))
        .output()
        .expect("runs");
    assert_eq!(output.status.code(), Some(0), "{output:?}");
}
