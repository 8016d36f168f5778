//! A host that stands still in the middle of preflight: whatever it misses by that is not held
//! against a servo.

use super::mentions;
use crate::scene::{STRICT, Scene, Side, StallPlan};
use gaitway::error::Error;
use gaitway::robot::preflight::preflight;
use gaitway::time::Duration;
use gaitway_sim::Fault;

/// A robot on a host that stalls.
fn scene(robot: &str, faults: Vec<Fault>, stalls: StallPlan) -> Scene {
    let scene = Scene::with_faults(robot, faults);
    scene.host.stall_by(stalls);
    scene
}

fn look(scene: &mut Scene) -> Result<(), Error> {
    preflight(&mut scene.link, scene.settings.period, STRICT).map(|_| ())
}

const ROBOTS: [&str; 4] = ["op3", "open-duck-mini-v2", "protocol-1", "mixed"];
const MILLIS: [u64; 6] = [20, 50, 101, 150, 250, 500];

/// Calls of an undisturbed preflight.
fn calls_of(robot: &str) -> u64 {
    let mut scene = scene(robot, Vec::new(), Box::new(|_| None));
    look(&mut scene).expect("a healthy robot");
    scene.host.steps()
}

#[test]
fn one_stall_wherever_it_comes_keeps_no_healthy_robot_from_passing() {
    for robot in ROBOTS {
        let calls = calls_of(robot);
        assert!(calls > 100, "{robot}: {calls} calls");
        // Every place in turn would take minutes; a prime step meets all kinds of calls.
        for (turn, at) in (0..calls).step_by(13).enumerate() {
            let time = Duration::from_millis(MILLIS[turn % MILLIS.len()]);
            for side in [Side::Before, Side::After] {
                let stall = Box::new(move |number| (number == at).then_some((side, time)));
                let mut scene = scene(robot, Vec::new(), stall);
                if let Err(error) = look(&mut scene) {
                    panic!("{robot}, {time:?} {side:?} call {at} of {calls}:\n{error}");
                }
            }
        }
    }
}

/// A word that blames a servo, or advises to change it.
fn blames_a_servo(error: &Error) -> bool {
    let text = error.to_string();
    let named = ["does not answer", "status return level", "damaged", "nothing else", "adapter"];
    named.iter().any(|word| text.contains(word))
}

#[test]
fn a_host_that_stalls_again_and_again_passes_or_is_named_itself() {
    let mut passed = 0;
    for robot in ROBOTS {
        for millis in MILLIS {
            for side in [Side::Before, Side::After] {
                // In every call, or in one of so many, so that the kinds take turns.
                for every in [1, 2, 3, 5, 7, 397] {
                    let time = Duration::from_millis(millis);
                    let stall =
                        Box::new(move |n: u64| n.is_multiple_of(every).then_some((side, time)));
                    let mut scene = scene(robot, Vec::new(), stall);
                    match look(&mut scene) {
                        Ok(()) => passed += 1,
                        Err(error) => {
                            let place = format!("{robot}, {time:?} {side:?} each {every}th call");
                            assert!(!blames_a_servo(&error), "{place}:\n{error}");
                            assert!(error.to_string().contains("this host"), "{place}:\n{error}");
                        }
                    }
                }
            }
        }
    }
    assert!(passed > 0, "no robot passed at all");
}

#[test]
fn a_servo_that_is_not_there_is_still_named_on_a_host_that_stalled() {
    let calls = calls_of("op3");
    for at in (0..calls).step_by(97) {
        let stall =
            Box::new(move |n| (n == at).then_some((Side::After, Duration::from_millis(250))));
        let mut scene = scene("op3", Vec::new(), stall);
        scene.world.lock().unplug("l_knee").expect("a joint");
        let error = look(&mut scene).expect_err("a servo is missing");
        mentions(&error, &["a servo does not answer", "l_knee", "ID 14"]);
    }
}

#[test]
fn nobody_is_told_to_write_eeprom_while_the_host_was_late() {
    let mute = || {
        vec![Fault::Register {
            joint: "l_knee".into(),
            register: "Status Return Level".into(),
            raw: 0,
            at_ns: 0,
        }]
    };
    // On time, what such a servo needs is said.
    let mut on_time = scene("op3", mute(), Box::new(|_| None));
    let error = look(&mut on_time).expect_err("it answers pings only");
    mentions(&error, &["answers pings and nothing else", "l_knee", "status return level"]);
    // Its questions come after those of some others; one stall in the middle of its own.
    let stall = |n: u64| (n % 40 == 39).then_some((Side::After, Duration::from_millis(30)));
    let mut late = scene("op3", mute(), Box::new(stall));
    let error = look(&mut late).expect_err("it answers pings only");
    mentions(&error, &["this host is too late", "l_knee", "ms late", "end other programs"]);
    assert!(!error.to_string().contains("status return level"), "{error}");
}
