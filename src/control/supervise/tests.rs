//! The whole way, from arming to how the robot is left, and what becomes of it when the program
//! breaks on it.

use super::*;
use crate::control::testing::{Bench, Said, Standing, TORQUE, World};
use crate::control::{Sample, StopCode};

struct Count(u32);

impl Sink for Count {
    fn take(&mut self, _sample: &Sample<'_>) {
        self.0 += 1;
    }
}

struct Played {
    bench: Bench,
    said: Result<Performance, Error>,
    cycles: u32,
    /// The calling thread had something to do meanwhile, and saw the end.
    meanwhile: bool,
}

fn performed(held: bool, setup: impl FnOnce(&Bench), asked: &(dyn Fn() -> bool + Sync)) -> Played {
    let mut bench = Bench::new(&[0, 0]);
    if held {
        for joint in 0..2 {
            bench.change(joint, |servo| {
                servo.set(TORQUE, 1);
                servo.set_word(crate::control::testing::GOAL, 2048);
            });
        }
    }
    let found = bench.checked();
    bench.forget_log();
    setup(&bench);
    let (mut sink, mut meanwhile) = (Count(0), false);
    let said = perform(
        &mut bench.link,
        &found,
        &mut Standing,
        Settings::at_rate(50.0),
        &mut sink,
        asked,
        &mut |is_over| {
            while !is_over() {
                std::thread::yield_now();
            }
            meanwhile = true;
        },
    );
    Played { bench, said, cycles: sink.0, meanwhile }
}

#[test]
fn a_robot_is_armed_played_and_left_holding() {
    let played = performed(false, |_| {}, &|| false);
    let Ok(Performance::Ran(run)) = played.said else { panic!("{:?}", played.said) };
    assert_eq!(run.stop, None);
    assert_eq!(run.left.holding, ["joint0", "joint1"]);
    assert_eq!(played.bench.torque(), [1, 1]);
    assert!(played.meanwhile && played.cycles == 3, "{}", played.cycles);
}

#[test]
fn a_wish_to_stop_before_torque_leaves_the_robot_limp() {
    let played = performed(false, |_| {}, &|| true);
    assert!(matches!(played.said, Ok(Performance::Stopped)), "{:?}", played.said);
    assert_eq!((played.bench.torque(), played.cycles), (vec![0, 0], 0));
}

#[test]
fn a_wish_to_stop_reaches_the_cycle() {
    use std::sync::atomic::{AtomicBool, Ordering};
    let asked = AtomicBool::new(false);
    let wish = std::sync::Arc::new(asked);
    let seen = std::sync::Arc::clone(&wish);
    let mut armed = false;
    let setup = |bench: &Bench| {
        bench.world.at_each(move |_: &mut World, said: &Said| {
            // The goals after torque are those of the first cycle.
            armed |= said.is_torque(true);
            if armed && said.is_goals() {
                wish.store(true, Ordering::Relaxed);
            }
        });
    };
    let played = performed(false, setup, &move || seen.load(Ordering::Relaxed));
    let Ok(Performance::Ran(run)) = played.said else { panic!("{:?}", played.said) };
    assert_eq!(run.stop.map(|stop| stop.code()), Some(StopCode::Asked));
}

#[test]
fn arming_that_fails_is_told() {
    let setup = |bench: &Bench| bench.change(1, |servo| servo.silent = true);
    let played = performed(false, setup, &|| false);
    assert_eq!(played.said.expect_err("refused").what, "a servo does not answer");
}

/// The program breaks as it is asked whether to stop, once torque is on.
fn broken(held: bool, silent: bool) -> Played {
    let on = std::sync::Arc::new(std::sync::atomic::AtomicBool::new(false));
    let seen = std::sync::Arc::clone(&on);
    let setup = |bench: &Bench| {
        bench.world.at_each(move |world: &mut World, said: &Said| {
            if said.is_torque(true) {
                on.store(true, std::sync::atomic::Ordering::Relaxed);
            }
            if silent && said.is_torque(false) {
                world.servos[1].silent = true;
            }
        });
    };
    performed(held, setup, &move || {
        assert!(!seen.load(std::sync::atomic::Ordering::Relaxed), "on purpose");
        false
    })
}

#[test]
fn a_program_that_breaks_while_arming_has_torque_off_again() {
    let played = broken(false, false);
    let error = played.said.expect_err("broken");
    assert_eq!(error.what, "the program broke while the robot was armed");
    assert_eq!(error.got.as_deref(), Some("on purpose"));
    assert_eq!(error.remedy.as_deref(), Some("please report this; torque was switched off again"));
    assert_eq!(played.bench.torque(), [0, 0]);
}

#[test]
fn a_program_that_breaks_while_arming_names_who_may_still_drive() {
    let played = broken(false, true);
    let error = played.said.expect_err("broken");
    let remedy = "torque may still be on; no confirmation from joint1";
    assert_eq!(error.remedy.as_deref(), Some(remedy));
}

#[test]
fn a_program_that_breaks_while_arming_leaves_a_held_robot_held() {
    let played = broken(true, false);
    let error = played.said.expect_err("broken");
    let remedy = "please report this; the robot is held as it was";
    assert_eq!(error.remedy.as_deref(), Some(remedy));
    assert_eq!(played.bench.torque(), [1, 1]);
}
