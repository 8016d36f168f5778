//! The servos' watch over their host, over servos that have one.

use super::*;
use crate::control::testing::damiao::{self, TIMEOUT, with_actuators};
use crate::control::testing::{
    Bench, PING, READ, Said, Servo, WATCHDOG, WRITE, World, out_of_reach, robot, watched,
};

/// A servo with a watchdog at each of these joints of a robot on these lines.
fn bench(line_of: &[usize], joints: &[usize]) -> Bench {
    Bench::of(watched(robot(line_of), joints))
}

fn watchdogs(bench: &Bench) -> Vec<u8> {
    bench.world.lock().servos.iter().map(|servo| servo.get(WATCHDOG)).collect()
}

fn set_all(bench: &Bench, raw: u8) {
    bench.world.lock().servos.iter_mut().for_each(|servo| servo.set(WATCHDOG, raw));
}

fn names(joints: &[&str]) -> Vec<String> {
    joints.iter().map(|&name| name.to_owned()).collect()
}

#[test]
fn a_watchdog_is_set_to_200_ms_and_read_back_where_there_is_one() {
    let mut bench = bench(&[0, 0, 0], &[0, 2]);
    arm(&mut bench.link).expect("armed");
    assert_eq!(watchdogs(&bench), [10, 0, 10]);
    let log = bench.log();
    for id in [20, 22] {
        let of = |instruction| {
            log.iter().position(|said| said.id == id && said.is(instruction, WATCHDOG))
        };
        assert!(of(WRITE).is_some() && of(WRITE) < of(READ));
    }
    assert!(!log.iter().any(|said| said.id == 21));
}

#[test]
fn a_watchdog_that_is_not_kept_is_refused() {
    let mut bench = bench(&[0, 0], &[0, 1]);
    bench.change(1, |servo| servo.forgets.push(WATCHDOG));
    let error = arm(&mut bench.link).expect_err("refused");
    assert_eq!(error.what, "a servo did not keep what was written");
    assert_eq!(error.place.as_deref(), Some("joint joint1, register Bus Watchdog"));
}

#[test]
fn every_watchdog_is_switched_off_again() {
    let mut bench = bench(&[0, 0], &[0, 1]);
    set_all(&bench, 10);
    bench.change(1, |servo| servo.set(WATCHDOG, 0));
    let released = release(&mut bench.link);
    assert_eq!(released.off, names(&["joint0", "joint1"]));
    assert_eq!((released.unsure.len(), released.bitten.len()), (0, 0));
    assert_eq!(watchdogs(&bench), [0, 0]);
    // Off already: nothing is written.
    assert!(!bench.log().iter().any(|said| said.id == 21 && said.instruction == WRITE));
    let words = released.words(&bench.link);
    assert_eq!(words.len(), 1);
    assert!(words[0].starts_with("2 servos would have stopped by themselves 200 ms"), "{words:?}");
}

#[test]
fn a_watchdog_that_has_bitten_is_left_as_it_is_and_named() {
    let mut bench = bench(&[0, 0, 0], &[0, 1, 2]);
    set_all(&bench, 10);
    // The highest it can be set to is no bite.
    bench.change(0, |servo| servo.set(WATCHDOG, 127));
    bench.change(1, |servo| servo.set(WATCHDOG, 255));
    bench.change(2, |servo| servo.set(WATCHDOG, 128));
    let released = release(&mut bench.link);
    assert_eq!(released.bitten, names(&["joint1", "joint2"]));
    assert_eq!(released.off, names(&["joint0"]));
    assert_eq!(watchdogs(&bench), [0, 255, 128]);
    let words = released.words(&bench.link);
    let said = "the bus watchdog has stopped joint1, joint2: the next start clears it";
    assert_eq!((words.len(), words[1].as_str()), (2, said));
}

#[test]
fn who_does_not_confirm_is_named() {
    let mut bench = bench(&[0, 0, 0], &[0, 1, 2]);
    set_all(&bench, 10);
    bench.change(0, |servo| servo.silent = true);
    bench.change(1, |servo| servo.forgets.push(WATCHDOG));
    let released = release(&mut bench.link);
    assert_eq!(released.unsure, names(&["joint0", "joint1"]));
    assert_eq!(released.off, names(&["joint2"]));
    let words = released.words(&bench.link);
    assert!(words[1].starts_with("the bus watchdog may still be on in joint0, joint1:"));
    assert_eq!(words.len(), 2);
}

#[test]
fn nothing_is_said_of_watchdogs_nobody_has() {
    let mut bench = Bench::new(&[0, 0]);
    arm(&mut bench.link).expect("armed");
    let released = release(&mut bench.link);
    assert_eq!(released, Released::default());
    assert_eq!(released.words(&bench.link), [""; 0]);
    assert!(bench.log().is_empty());
}

#[test]
fn a_line_on_which_three_in_a_row_are_silent_is_asked_no_more() {
    let six = [0, 1, 2, 3, 4, 5];
    let asked = |silent: &[usize]| {
        let mut bench = bench(&[0; 6], &six);
        set_all(&bench, 10);
        for &joint in silent {
            bench.change(joint, |servo| servo.silent = true);
        }
        let released = release(&mut bench.link);
        let log = bench.log();
        let of = |joint: &usize| {
            log.iter().any(|s| usize::from(s.id) == 20 + joint && s.is(READ, WATCHDOG))
        };
        (six.into_iter().filter(of).collect::<Vec<usize>>(), released)
    };
    let (who, released) = asked(&[1, 2, 3, 4]);
    assert_eq!(who, [0, 1, 2, 3]);
    assert_eq!(released.unsure.len(), 5, "who was not asked is not known either");
    assert_eq!(released.off, names(&["joint0"]));
    // Two in a row, twice, are not three.
    let (who, released) = asked(&[0, 1, 3, 4]);
    assert_eq!(who, six);
    assert_eq!(released.off, names(&["joint2", "joint5"]));
}

#[test]
fn a_silent_line_does_not_keep_another_from_being_asked() {
    let mut bench = bench(&[0, 0, 0, 1], &[0, 1, 2, 3]);
    set_all(&bench, 10);
    (0..3).for_each(|joint| bench.change(joint, |servo: &mut Servo| servo.silent = true));
    let released = release(&mut bench.link);
    assert_eq!(released.off, names(&["joint3"]));
    assert_eq!(released.unsure.len(), 3);
}

#[test]
fn watchdogs_on_a_line_that_is_lost_may_still_be_on() {
    let mut bench = bench(&[0, 1, 1], &[0, 1]);
    set_all(&bench, 10);
    bench.link.give_up(1);
    let released = release(&mut bench.link);
    assert_eq!(released.off, names(&["joint0"]));
    assert_eq!(released.unsure, names(&["joint1"]), "joint2 has none");
    assert!(bench.log().iter().all(|said| said.line == 0));
    let log = bench.log().len();
    arm(&mut bench.link).expect("the line that is there");
    assert!(bench.log()[log..].iter().all(|said| said.line == 0));
}

/// The longest time for which a line heard nothing while the servos of another, whose watchdogs read
/// this and who take 30 ms for each word, were spoken to.
fn longest_silence(raw: u8, of: impl FnOnce(&mut Link)) -> Option<Duration> {
    let mut bench = bench(&[0, 0, 0, 0, 1], &[0, 1, 2, 3, 4]);
    set_all(&bench, raw);
    bench.world.at_each(|world: &mut World, said: &Said| {
        if said.line == 0 {
            world.stall(Duration::from_millis(30));
        }
    });
    let mut heard = vec![bench.link.clock().now()];
    of(&mut bench.link);
    let log = bench.log();
    assert!(log.iter().any(|said| said.line == 1 && said.instruction == PING));
    heard.extend(log.iter().filter(|said| said.line == 1).map(|said| said.at));
    heard.windows(2).map(|two| two[1].since(two[0])).max()
}

#[test]
fn no_line_is_silent_for_long_while_watchdogs_are_set_or_switched_off() {
    // Looked at before each word of 30 ms: the second finds it silent for more than 50 ms.
    let longest = Some(Duration::from_millis(80));
    assert!(longest_silence(0, |link| arm(link).expect("armed")) < longest);
    for raw in [0, 10] {
        assert!(longest_silence(raw, |link| drop(release(link))) < longest, "{raw}");
    }
}

#[test]
fn actuators_whose_watch_is_set_over_the_line_are_told_so_and_named_if_they_do_not_confirm() {
    let mut link = out_of_reach("dm4310", [None, None]);
    let error = arm(&mut link).expect_err("nobody hears it");
    assert_eq!(error.what, "the joint hangs on no CAN line");
    let released = release(&mut link);
    assert_eq!(released.unsure, names(&["joint0", "joint1"]));
    assert_eq!((released.off.len(), released.bitten.len()), (0, 0));
    // On a line that is lost nobody is told anything.
    let lost = link.robot().joints[0].line;
    link.give_up(lost);
    (0..link.robot().lines.len()).for_each(|line| drop(link.give_up(line)));
    arm(&mut link).expect("nobody to be told");
    assert_eq!(release(&mut link), Released::default());
}

#[test]
fn actuators_that_let_go_by_themselves_are_said_to_with_the_shortest_silence() {
    let link = out_of_reach("recoil-5010", [Some(1.0), Some(0.5)]);
    let words = Released::default().words(&link);
    let said = "let go 0.5 s after the host's last word, as set with the maker's tool, and are not \
                held from then on: joint0, joint1";
    assert_eq!(words, [said]);
    let link = out_of_reach("dm4310", [None, None]);
    assert_eq!(Released::default().words(&link), [""; 0]);
}

fn timeouts(bench: &Bench) -> Vec<u32> {
    bench.world.lock().actuators.iter().map(|actuator| actuator.register(TIMEOUT)).collect()
}

#[test]
fn the_watch_of_actuators_is_set_to_200_ms_and_then_to_what_it_was() {
    let mut bench = Bench::of(with_actuators(robot(&[0]), 2));
    bench.world.lock().actuators[1].registers[usize::from(TIMEOUT)] = 9000;
    arm(&mut bench.link).expect("armed");
    // In steps of 50 us.
    assert_eq!(timeouts(&bench), [4000, 4000]);
    let released = release(&mut bench.link);
    assert_eq!(released.off, names(&["joint1", "joint2"]));
    assert_eq!(timeouts(&bench), [0, 9000]);
}

#[test]
fn an_actuator_that_does_not_keep_its_watch_is_refused_and_one_that_does_not_end_it_named() {
    let mut bench = Bench::of(with_actuators(robot(&[0]), 2));
    bench.world.lock().actuators[1].forgets.push(TIMEOUT);
    let error = arm(&mut bench.link).expect_err("refused");
    assert_eq!(error.what, "its timeout (setting 9) is 0, not 4000 as written");
    bench.world.lock().actuators[1].forgets.clear();
    arm(&mut bench.link).expect("armed");
    bench.world.lock().actuators[0].forgets.push(TIMEOUT);
    let released = release(&mut bench.link);
    assert_eq!((released.unsure, released.off), (names(&["joint1"]), names(&["joint2"])));
}

#[test]
fn a_line_of_servos_is_not_silent_for_long_while_actuators_are_told_their_watch() {
    let mut bench = Bench::of(with_actuators(robot(&[0]), 4));
    bench.world.lock().slow = Some((damiao::READ, Duration::from_millis(30)));
    let mut heard = vec![bench.link.clock().now()];
    arm(&mut bench.link).expect("armed");
    release(&mut bench.link);
    heard.extend(bench.log().iter().map(|said| said.at));
    heard.push(bench.link.clock().now());
    let longest = heard.windows(2).map(|two| two[1].since(two[0])).max();
    // Looked at before each watch, which is read twice as it is set and once as it is ended: the
    // next but one at the latest finds the line silent for more than 50 ms.
    assert!(longest < Some(Duration::from_millis(80)), "{longest:?}");
}
