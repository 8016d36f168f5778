//! How a robot is left: only what was read is said.

use super::*;
use crate::control::testing::{Bench, READ, SYNC_READ, TORQUE, World, robot, watched};

fn names(joints: &[&str]) -> Vec<String> {
    joints.iter().map(|&name| name.to_owned()).collect()
}

/// Servos whose torque registers read this.
fn bench(torque: &[u8]) -> Bench {
    let bench = Bench::new(&vec![0; torque.len()]);
    for (joint, &raw) in torque.iter().enumerate() {
        bench.change(joint, |servo| servo.set(TORQUE, raw));
    }
    bench
}

#[test]
fn joints_are_told_apart_by_what_their_servos_say() {
    let mut bench = bench(&[1, 0, 1, 0]);
    bench.change(2, |servo| servo.silent = true);
    let (left, notes) = leave(&mut bench.link);
    let expected = Left {
        holding: names(&["joint0"]),
        limp: names(&["joint1", "joint3"]),
        unknown: names(&["joint2"]),
        stopped_by_watchdog: Vec::new(),
    };
    assert_eq!(left, expected);
    let words = "torque is on, read back: joint0; torque is off: joint1, joint3; \
                 whether torque is on was not to be learnt: joint2";
    assert_eq!(notes, [words]);
}

#[test]
fn a_robot_that_holds_as_a_whole_is_said_to_hold() {
    let mut bench = bench(&[1, 1]);
    let (left, notes) = leave(&mut bench.link);
    assert_eq!(left.holding, names(&["joint0", "joint1"]));
    assert_eq!(notes, ["torque stays on: the joints hold where they are"]);
    // Asked once, together.
    let log = bench.log();
    assert_eq!(log.len(), 1);
    assert!(log[0].is(SYNC_READ, TORQUE));
}

#[test]
fn what_is_not_said_together_is_asked_for_alone() {
    let mut bench = bench(&[1, 0]);
    // In a group nobody hears this one.
    bench.world.at_each(|world: &mut World, said| {
        world.servos[1].silent = said.instruction == SYNC_READ;
    });
    let (left, _) = leave(&mut bench.link);
    assert_eq!(left.limp, names(&["joint1"]));
    assert!(bench.log().iter().any(|said| said.id == 21 && said.is(READ, TORQUE)));
    assert!(!bench.log().iter().any(|said| said.id == 20 && said.is(READ, TORQUE)));
}

#[test]
fn a_line_that_is_lost_is_asked_nothing() {
    let mut bench = Bench::new(&[0, 1]);
    bench.change(0, |servo| servo.set(TORQUE, 1));
    bench.change(1, |servo| servo.set(TORQUE, 1));
    bench.link.give_up(1);
    let (left, _) = leave(&mut bench.link);
    assert_eq!((left.holding, left.unknown), (names(&["joint0"]), names(&["joint1"])));
    assert!(bench.log().iter().all(|said| said.line == 0));
}

#[test]
fn who_was_silent_about_its_watchdog_is_not_asked_again() {
    let mut bench = Bench::of(watched(robot(&[0, 0]), &[0, 1]));
    bench.change(0, |servo| servo.set(TORQUE, 1));
    bench.change(1, |servo| servo.silent = true);
    let (left, notes) = leave(&mut bench.link);
    assert_eq!((left.holding, left.unknown), (names(&["joint0"]), names(&["joint1"])));
    assert_eq!(notes.len(), 3, "{notes:?}");
    let torque = bench.log().into_iter().filter(|said| said.is(READ, TORQUE));
    assert!(torque.into_iter().all(|said| said.id == 20));
}

#[test]
fn words_name_only_what_there_is() {
    let words = |holding: &[&str], limp: &[&str], unknown: &[&str]| {
        let (holding, limp, unknown) = (names(holding), names(limp), names(unknown));
        Left { holding, limp, unknown, stopped_by_watchdog: Vec::new() }.words()
    };
    assert_eq!(words(&[], &["a", "b"], &[]), "torque is off: a, b");
    assert_eq!(words(&[], &[], &["a"]), "whether torque is on was not to be learnt: a");
    assert_eq!(words(&["a"], &["b"], &[]), "torque is on, read back: a; torque is off: b");
}
