//! Arming, over servos that do what they are told, or do not.

use super::*;
use crate::control::testing::damiao::{
    CTRL_MODE, Damiao, ENABLE, HOW_IT_IS, REGISTERS, with_actuators,
};
use crate::control::testing::{
    Bench, GOAL, PRESENT, READ, SPEED, SYNC_READ, SYNC_WRITE, Said, TORQUE, WATCHDOG, WRITE, World,
    out_of_reach, robot, watched,
};
use crate::robot::preflight::EepromWrite;
use crate::wire::can::CanFrame;
use std::sync::atomic::{AtomicUsize, Ordering};

const MS: Duration = Duration::from_millis(1);

fn never() -> bool {
    false
}

/// Where each servo stands, counts.
const STANDS: [i64; 3] = [2000, 2148, 2048];

/// A bench after all checks, with what was found, and nothing said yet.
fn checked(joints: usize) -> (Bench, Preflight) {
    checked_on(&vec![0; joints])
}

fn checked_on(line_of: &[usize]) -> (Bench, Preflight) {
    let mut bench = Bench::new(line_of);
    for (joint, &stands) in STANDS[..line_of.len()].iter().enumerate() {
        bench.change(joint, |servo| servo.put_at(stands));
    }
    let found = bench.checked();
    bench.forget_log();
    (bench, found)
}

fn place(log: &[Said], wanted: impl Fn(&Said) -> bool) -> usize {
    log.iter().position(wanted).unwrap_or_else(|| panic!("not said in {log:?}"))
}

#[test]
fn a_robot_is_armed_in_order_and_everything_is_read_back() {
    let (mut bench, found) = checked(2);
    let armed = arm(&mut bench.link, &found, &never).and_then(Arming::done).expect("armed");
    assert_eq!(armed.command().goal_rad(), found.start_rad);
    let log = bench.log();
    for id in [20, 21] {
        let of = |instruction, address| {
            place(&log, |said| said.id == id && said.is(instruction, address))
        };
        assert!(of(WRITE, SPEED) < of(READ, SPEED));
        assert!(of(READ, SPEED) < place(&log, Said::is_goals));
        assert!(place(&log, Said::is_goals) < of(READ, GOAL));
        assert!(of(READ, GOAL) < place(&log, |said| said.is_torque(true)));
        assert!(place(&log, |said| said.is_torque(true)) < of(READ, TORQUE));
    }
    // Looked at before the goals, again as the last thing before torque, and once torque is on.
    let looks: Vec<usize> = (0..log.len()).filter(|&k| log[k].instruction == SYNC_READ).collect();
    let torque = place(&log, |said| said.is_torque(true));
    assert!(looks[0] < place(&log, Said::is_goals), "{looks:?}");
    assert_eq!(looks[1], torque - 1);
    assert_eq!(looks[2..], [log.len() - 1]);
    // One word to all, and one goal: where each stands. Torque comes on once.
    assert_eq!(log[torque].instruction, SYNC_WRITE);
    assert_eq!(log.iter().filter(|said| said.is_torque(true)).count(), 1);
    let goals: Vec<&Said> = log.iter().filter(|said| said.is_goals()).collect();
    assert_eq!(goals.len(), 1);
    assert_eq!(goals[0].goals(), [(20, 2000), (21, 2148)]);
    assert_eq!(bench.torque(), [1, 1]);
    // 5.4454 rad/s are 3549.8 counts per second.
    assert_eq!(bench.world.lock().servos[1].word(SPEED), 3550);
}

/// What arming says if `what` happens first, with the bench as it left it.
fn armed_after(what: impl FnOnce(&Bench, &mut Preflight)) -> (Bench, Result<Arming, Error>) {
    let (mut bench, mut found) = checked(2);
    what(&bench, &mut found);
    let said = arm(&mut bench.link, &found, &never);
    (bench, said)
}

fn refused(said: Result<Arming, Error>) -> Error {
    match said {
        Err(error) => error,
        Ok(done) => panic!("armed: {done:?}"),
    }
}

fn never_on(bench: &Bench) {
    assert!(!bench.log().iter().any(|said| said.is_torque(true)));
}

#[test]
fn a_register_that_keeps_another_value_ends_arming_before_torque() {
    for (register, name) in [(SPEED, "Goal Velocity"), (21, "P Coefficient")] {
        let (bench, said) = armed_after(|bench, found| {
            let model = bench.link.robot().joints[1].model().expect("a servo");
            let mut registers = model.profile().registers.iter();
            let p = registers.find(|register| register.name == "P Coefficient").expect("there");
            found.to_write.push((1, p, 31));
            bench.change(1, |servo| servo.forgets.push(register));
        });
        let error = refused(said);
        assert_eq!(error.what, "a servo did not keep what was written");
        assert_eq!(error.place.as_deref(), Some(&*format!("joint joint1, register {name}")));
        never_on(&bench);
        assert!(!bench.log().iter().any(Said::is_goals));
    }
}

#[test]
fn what_preflight_found_is_written_to_ram_and_read_back() {
    let (bench, said) = armed_after(|bench, found| {
        let model = bench.link.robot().joints[1].model().expect("a servo");
        let register = model.register(Role::TorqueLimit).expect("there");
        found.to_write.push((1, register, 500));
    });
    assert!(said.is_ok());
    assert_eq!(bench.world.lock().servos[1].word(48), 500);
    let log = bench.log();
    assert!(place(&log, |said| said.is(WRITE, 48)) < place(&log, |said| said.is(READ, 48)));
    assert!(place(&log, |said| said.is(READ, 48)) < place(&log, Said::is_goals));
}

/// How many registers of how many joints the link asks in a cycle after arming at this period, with
/// the return delay of joint 1 lowered or not.
/// While a watchdog has stopped a servo no goal can be written, and nobody knows what the servo does with
/// its old one when it is cleared.
#[test]
fn a_servo_that_its_watchdog_has_stopped_is_slow_when_cleared_and_told_to_stay_in_the_next_word() {
    let mut bench = Bench::of(watched(robot(&[0, 0]), &[1]));
    bench.change(1, |servo| servo.set(WATCHDOG, 255));
    let found = bench.checked();
    bench.forget_log();
    arm(&mut bench.link, &found, &never).and_then(Arming::done).expect("armed");
    let log = bench.log();
    let to = |said: &Said, register| said.id == 21 && said.is(WRITE, register);
    let cleared = place(&log, |said| to(said, WATCHDOG));
    assert_eq!(log[cleared].params[1], 0, "cleared before it is set");
    let speed = log[..cleared].iter().rfind(|said| to(said, SPEED)).expect("a speed");
    let speed = u16::from_le_bytes([speed.params[1], speed.params[2]]);
    assert!((1..100).contains(&speed), "{speed} counts per second, of 3,550");
    assert!(log[cleared + 1].is_goals(), "{:?}", log[cleared + 1]);
    assert!(cleared < place(&log, |said| said.is_torque(true)));
    assert_eq!(bench.world.lock().servos[1].word(SPEED), 3550, "as fast as it may again");
}

fn asked_after(period: Duration, lowers: bool) -> (Bench, Vec<(u8, usize)>) {
    let (mut bench, mut found) = checked(3);
    found.period = period;
    if lowers {
        let model = bench.link.robot().joints[1].model().expect("a servo");
        let register = model.register(Role::ReturnDelay).expect("there");
        found.eeprom.push(EepromWrite { joint: 1, register, from: 0, to: 10 });
    }
    arm(&mut bench.link, &found, &never).expect("armed");
    let log = bench.log().len();
    let limit = budget(&bench.link);
    bench.link.states(limit).expect("a line");
    let said = bench.log().into_iter().skip(log);
    let asked = said.map(|said| (said.params[1], said.params.len() - 2)).collect();
    (bench, asked)
}

#[test]
fn return_delays_are_lowered_first_and_the_reads_planned_anew() {
    let (bench, asked) = asked_after(Duration::from_micros(1500), true);
    let log = bench.log();
    let written = place(&log, |said| said.id == 21 && said.is(WRITE, 7));
    assert!(written < place(&log, |said| said.id == 21 && said.is(READ, 7)));
    assert!(written < place(&log, |said| said.is(WRITE, SPEED)));
    assert_eq!(bench.world.lock().servos[1].get(7), 10);
    assert_eq!(bench.link.return_delays(), [Duration::from_micros(20)]);
    // Three joints do not fit into so short a cycle as a whole.
    assert_ne!(asked, asked_after(20 * MS, true).1, "planned for the period");
    // Nothing is lowered: the plan of the checks holds.
    let (bench, asked) = asked_after(Duration::from_micros(1500), false);
    assert_eq!(asked, asked_after(20 * MS, false).1);
    assert_eq!(bench.link.return_delays(), [Duration::ZERO]);
}

#[test]
fn a_return_delay_that_is_not_kept_ends_arming() {
    let (bench, said) = armed_after(|bench, found| {
        let model = bench.link.robot().joints[1].model().expect("a servo");
        let register = model.register(Role::ReturnDelay).expect("there");
        found.eeprom.push(EepromWrite { joint: 1, register, from: 0, to: 10 });
        bench.change(1, |servo| servo.forgets.push(7));
    });
    let error = refused(said);
    assert_eq!(error.place.as_deref(), Some("joint joint1, register Return Delay Time"));
    never_on(&bench);
}

#[test]
fn no_line_is_silent_for_long_while_the_servos_of_another_are_prepared() {
    let longest = |registers: usize| {
        let (mut bench, mut found) = checked_on(&[0, 0, 1]);
        let model = bench.link.robot().joints[0].model().expect("a servo");
        let register = model.register(Role::TorqueLimit).expect("there");
        found.to_write = vec![(0, register, 500); registers];
        bench.world.at_each(|world: &mut World, said: &Said| {
            if said.line == 0 && said.instruction != SYNC_READ && !said.is_torque(true) {
                world.stall(30 * MS);
            }
        });
        // The third joint is on the other line: it is spoken to last.
        let mut heard = vec![bench.link.clock().now()];
        arm(&mut bench.link, &found, &never).expect("armed");
        heard.extend(bench.log().iter().filter(|said| said.line == 1).map(|said| said.at));
        heard.windows(2).map(|two| two[1].since(two[0])).max()
    };
    // Looked at after each word of 30 ms: the second finds it silent for more than 50 ms.
    assert!(longest(0) < Some(80 * MS), "{:?}", longest(0));
    // Looked at between writing and reading back: every 60 ms.
    assert!(longest(5) < Some(110 * MS), "{:?}", longest(5));
}

#[test]
fn a_goal_that_is_not_kept_ends_arming_before_torque() {
    let (bench, said) = armed_after(|bench, _| bench.change(1, |servo| servo.forgets.push(GOAL)));
    let error = refused(said);
    assert_eq!(error.what, "a servo did not keep its goal; torque stays off");
    assert_eq!(error.place.as_deref(), Some("joint joint1"));
    never_on(&bench);
}

#[test]
fn a_goal_within_0_02_rad_of_where_it_was_told_is_kept() {
    // 13 counts are 0.01994 rad, 14 are 0.02148 rad.
    for (counts, kept) in [(13, true), (-13, true), (14, false), (-14, false)] {
        let (_, said) = armed_after(|bench, _| {
            bench.change(1, |servo| {
                servo.forgets.push(GOAL);
                servo.set_word(GOAL, STANDS[1] + counts);
            });
        });
        assert_eq!(said.is_ok(), kept, "{counts}");
    }
}

#[test]
fn a_joint_that_moved_by_more_than_0_02_rad_since_it_was_checked_is_not_armed() {
    for (counts, armed) in [(13, true), (-13, true), (14, false), (-14, false)] {
        let (bench, said) = armed_after(|bench, _| {
            bench.change(0, |servo| servo.put_at(STANDS[0] + counts));
        });
        assert_eq!(said.is_ok(), armed, "{counts}");
        if let Err(error) = said {
            assert_eq!(error.what, "a joint moved before torque came on; torque stays off");
            assert_eq!(error.place.as_deref(), Some("joint joint0"));
            assert!(!bench.log().iter().any(Said::is_goals), "not even a goal is told");
            never_on(&bench);
        }
    }
}

#[test]
fn a_joint_that_moves_after_its_goal_was_told_gets_no_torque() {
    let (bench, said) = armed_after(|bench, _| {
        bench.world.at_each(|world: &mut World, said: &Said| {
            if said.is_goals() {
                world.servos[1].put_at(2200);
            }
        });
    });
    let error = refused(said);
    assert_eq!(error.what, "a joint moved before torque came on; torque stays off");
    assert_eq!(error.place.as_deref(), Some("joint joint1"));
    never_on(&bench);
}

/// Stalls of the host as looks at the joints are asked for, one after the other.
fn stalling_looks(bench: &Bench, stalls_ms: &'static [u32]) {
    let mut look = 0;
    bench.world.at_each(move |world: &mut World, said: &Said| {
        if said.instruction == SYNC_READ {
            world.stall(MS * stalls_ms.get(look).copied().unwrap_or(0));
            look += 1;
        }
    });
}

fn looks(bench: &Bench) -> usize {
    bench.log().iter().filter(|said| said.instruction == SYNC_READ).count()
}

#[test]
fn a_look_during_which_the_host_stalled_is_repeated() {
    for (stalls_ms, wanted) in [
        (&[0][..], 3),
        (&[45], 3),
        (&[60], 4),
        (&[110, 190, 60], 5),
        (&[0, 60], 4),
        (&[60, 0, 70], 5),
        // Where every look takes long it is the line that does: about the same time twice is believed.
        (&[80, 80, 80, 80], 5),
        (&[80, 118, 80, 118], 5),
        (&[80, 126, 118], 5),
        (&[118, 80, 126, 0], 5),
    ] {
        let (bench, said) = armed_after(|bench, _| stalling_looks(bench, stalls_ms));
        assert!(said.is_ok(), "{stalls_ms:?}: {said:?}");
        assert_eq!(looks(&bench), wanted, "{stalls_ms:?}");
    }
}

#[test]
fn a_host_that_stalls_at_every_look_but_never_for_as_long_as_at_its_best_is_refused() {
    let (bench, said) = armed_after(|bench, _| {
        stalling_looks(bench, &[55, 100, 110, 120, 100, 110, 120, 100]);
    });
    let error = refused(said);
    assert_eq!(error.what, "the host stalls; torque stays off");
    assert_eq!(looks(&bench), 8);
    never_on(&bench);
}

/// Arming with a stall of the host as torque is switched on, of a robot that was held before or not.
fn stalled_at_torque(stall_ms: u32, held: bool) -> (Bench, Result<Arming, Error>) {
    armed_after(|bench, found| {
        found.held = held;
        bench.world.at_each(move |world: &mut World, said: &Said| {
            if said.is_torque(true) {
                world.stall(MS * stall_ms);
            }
        });
    })
}

#[test]
fn a_host_that_stalls_between_its_last_look_and_torque_has_torque_off_again() {
    assert!(stalled_at_torque(50, false).1.is_ok());
    let (bench, said) = stalled_at_torque(51, false);
    let error = refused(said);
    assert_eq!(error.what, "the host stalled as torque came on; torque is off again");
    assert_eq!(bench.torque(), [0, 0]);
    let log = bench.log();
    assert!(place(&log, |said| said.is_torque(true)) < place(&log, |said| said.is_torque(false)));
    // Held all the while, it cannot have sunk.
    assert!(stalled_at_torque(500, true).1.is_ok());
}

#[test]
fn a_joint_that_is_turned_as_torque_comes_on_has_torque_off_again() {
    // A count is 1.5 mrad.
    for (counts, off) in [(12, false), (-12, false), (15, true), (-15, true)] {
        let (bench, said) = armed_after(|bench, _| {
            bench.world.at_each(move |world: &mut World, said: &Said| {
                if said.is_torque(true) {
                    let stands = world.servos[1].word(PRESENT);
                    world.servos[1].put_at(stands + counts);
                }
            });
        });
        assert_eq!(bench.torque(), if off { [0, 0] } else { [1, 1] }, "{counts}");
        if off {
            let error = refused(said);
            assert_eq!(error.what, "a joint moved as torque came on; torque is off again");
            assert_eq!(error.place.as_deref(), Some("joint joint1"));
        }
    }
}

#[test]
fn a_servo_that_does_not_take_torque_has_the_others_let_go_again() {
    let (bench, said) = armed_after(|bench, _| {
        bench.change(1, |servo| servo.forgets.push(TORQUE));
    });
    let error = refused(said);
    assert_eq!(error.what, "a servo did not keep what was written");
    assert_eq!(error.place.as_deref(), Some("joint joint1, register Torque Enable"));
    assert_eq!((error.got.as_deref(), error.allowed.as_deref()), (Some("0"), Some("1")));
    assert_eq!(bench.torque(), [0, 0]);
}

#[test]
fn a_joint_that_does_not_confirm_that_it_let_go_is_named() {
    let (bench, said) = armed_after(|bench, _| {
        bench.world.at_each(|world: &mut World, said: &Said| {
            if said.is_torque(true) {
                world.servos[0].set(TORQUE, 1);
                world.servos[0].silent = true;
            }
        });
    });
    let error = refused(said);
    assert_eq!(error.what, "a servo does not answer");
    let remedy = error.remedy.expect("what to do");
    assert_eq!(&*remedy, "torque may still be on; no confirmation from joint0");
    assert_eq!(bench.torque(), [1, 0]);
}

#[test]
fn a_robot_that_was_held_is_left_held_when_arming_fails() {
    let mut bench = Bench::new(&[0, 0]);
    for joint in 0..2 {
        bench.change(joint, |servo| {
            servo.set(TORQUE, 1);
            servo.set_word(GOAL, 2048);
        });
    }
    let found = bench.checked();
    assert!(found.held);
    bench.change(1, |servo| servo.forgets.push(SPEED));
    let error = refused(arm(&mut bench.link, &found, &never));
    assert_eq!(error.what, "a servo did not keep what was written");
    assert_eq!(bench.torque(), [1, 1]);
    assert!(!bench.log().iter().any(|said| said.is_torque(false)));
}

#[test]
fn a_wish_to_stop_is_looked_at_before_each_word_and_leaves_a_limp_robot_limp() {
    let (mut bench, found) = checked(2);
    let asked = AtomicUsize::new(0);
    let count = || {
        asked.fetch_add(1, Ordering::Relaxed);
        false
    };
    arm(&mut bench.link, &found, &count).expect("armed");
    let times = asked.load(Ordering::Relaxed);
    // At the start; at each joint's speed; before the goals; at each goal; before torque; at each
    // joint's torque; at the end.
    assert_eq!(times, 1 + 2 + 1 + 2 + 1 + 2 + 1);
    for wish in 1..=times {
        let (mut bench, found) = checked(2);
        let left = AtomicUsize::new(wish);
        let asks = || left.fetch_sub(1, Ordering::Relaxed) == 1;
        let said = arm(&mut bench.link, &found, &asks).expect("no error");
        assert!(matches!(said, Arming::Stopped), "{wish}");
        let error = said.done().expect_err("stopped");
        assert_eq!(error.what, "stopped before torque came on; nothing moved");
        assert_eq!(bench.torque(), [0, 0], "{wish}");
        let on = bench.log().iter().any(|said| said.is_torque(true));
        assert_eq!(on, wish > 7, "{wish}: torque has been on");
        assert_eq!(bench.log().iter().any(Said::is_goals), wish > 4, "{wish}");
    }
}

#[test]
fn a_wish_to_stop_is_looked_at_before_each_register_that_is_written() {
    let (mut bench, mut found) = checked(2);
    let model = bench.link.robot().joints[1].model().expect("a servo");
    let register = model.register(Role::TorqueLimit).expect("there");
    found.to_write = vec![(0, register, 500), (1, register, 500)];
    let left = AtomicUsize::new(3);
    let asks = || left.fetch_sub(1, Ordering::Relaxed) == 1;
    let said = arm(&mut bench.link, &found, &asks).expect("no error");
    assert!(matches!(said, Arming::Stopped));
    let world = bench.world.lock();
    assert_eq!((world.servos[0].word(48), world.servos[1].word(48)), (500, 1000));
}

#[test]
fn a_wish_to_stop_that_not_all_confirm_is_said() {
    let (mut bench, found) = checked(2);
    let left = AtomicUsize::new(8);
    let world = bench.world.clone();
    let asks = || {
        let wish = left.fetch_sub(1, Ordering::Relaxed) == 1;
        if wish {
            world.lock().servos[1].silent = true;
        }
        wish
    };
    let error = refused(arm(&mut bench.link, &found, &asks));
    assert_eq!(error.what, "torque may still be on");
    assert_eq!(error.got.as_deref(), Some("no confirmation from joint1"));
}

#[test]
fn a_start_outside_the_limits_is_refused_before_anything_is_said() {
    let (bench, said) = armed_after(|_, found| found.start_rad[1] = 3.0);
    let error = refused(said);
    assert_eq!(error.what, "the guard refuses the start pose");
    assert_eq!(error.place.as_deref(), Some("joint joint1"));
    assert!(bench.log().is_empty());
}

#[test]
fn disarming_switches_every_joint_off_whatever_the_others_say() {
    let (mut bench, found) = checked(3);
    arm(&mut bench.link, &found, &never).expect("armed");
    bench.change(1, |servo| servo.silent = true);
    let error = disarm(&mut bench.link).expect_err("one is silent");
    assert_eq!(error.got.as_deref(), Some("no confirmation from joint1"));
    assert_eq!(bench.torque(), [0, 1, 0]);
    bench.change(1, |servo| {
        servo.silent = false;
        servo.forgets.push(TORQUE);
    });
    let error = disarm(&mut bench.link).expect_err("one keeps driving");
    assert_eq!(error.got.as_deref(), Some("no confirmation from joint1"));
    bench.change(1, |servo| servo.forgets.clear());
    disarm(&mut bench.link).expect("all confirm");
    assert_eq!(bench.torque(), [0, 0, 0]);
}

#[test]
fn an_actuator_that_is_out_of_reach_confirms_nothing() {
    let mut link = out_of_reach("dm4310", [None, None]);
    let what = "the joint hangs on no CAN line";
    assert_eq!(expect_torque(&mut link, 0).expect_err("nobody").what, what);
    assert_eq!(write_setting(&mut link, 0, 9, 0).expect_err("nobody").what, what);
    let error = disarm(&mut link).expect_err("nobody");
    assert_eq!(error.got.as_deref(), Some("no confirmation from joint0, joint1"));
}

/// One servo, and so many actuators on a CAN line, after all checks and with nothing said yet.
fn with_can(actuators: u8) -> (Bench, Preflight) {
    let mut bench = Bench::of(with_actuators(robot(&[0]), actuators));
    let found = bench.checked();
    bench.forget_log();
    (bench, found)
}

fn of(bench: &Bench, actuator: usize) -> Damiao {
    bench.world.lock().actuators[actuator].clone()
}

fn is_order(frame: &CanFrame, id: u8, order: u8) -> bool {
    let to_it = frame.id().number() == u32::from(id);
    to_it && frame.payload() == [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, order]
}

#[test]
fn an_actuator_is_told_where_it_stands_and_then_to_drive() {
    let (mut bench, mut found) = with_can(2);
    bench.world.lock().actuators[1].position = 0x8100;
    // Of 12.5 rad to either side in 65535 steps.
    found.start_rad[2] = 25.0 * f64::from(0x8100) / 65535.0 - 12.5;
    arm(&mut bench.link, &found, &never).and_then(Arming::done).expect("armed");
    for (actuator, id, position) in [(0, 1, 0x7FFF_u16), (1, 2, 0x8100)] {
        let Damiao { state, position: stands, .. } = of(&bench, actuator);
        assert_eq!((state, stands.abs_diff(position) <= 1), (1, true), "{stands:#X}");
        let frames = bench.world.lock().frames.clone();
        let orders = frames.iter().filter(|(_, frame)| is_order(frame, id, ENABLE)).count();
        assert_eq!(orders, 1);
        let last = frames.iter().rfind(|(_, frame)| frame.id().number() == u32::from(id));
        let told = last.expect("told").1.payload()[..2].to_vec();
        assert!(u16::from_be_bytes([told[0], told[1]]).abs_diff(position) <= 1, "{told:02X?}");
    }
}

#[test]
fn an_actuator_that_does_not_keep_a_setting_ends_arming_before_torque() {
    let written = |forgets: &[u8]| {
        let (mut bench, mut found) = with_can(2);
        {
            let actuator = &mut bench.world.lock().actuators[1];
            actuator.registers[usize::from(CTRL_MODE)] = 2;
            actuator.forgets = forgets.to_vec();
        }
        found.settings.push((2, CTRL_MODE.into(), 1));
        let said = arm(&mut bench.link, &found, &never).and_then(Arming::done);
        (bench, said)
    };
    let (bench, said) = written(&[]);
    said.expect("armed");
    assert_eq!((of(&bench, 1).register(CTRL_MODE), of(&bench, 1).state), (1, 1));
    let (bench, said) = written(&[CTRL_MODE]);
    let error = said.expect_err("not kept");
    assert_eq!(error.what, "an actuator did not keep what was written");
    assert_eq!(error.place.as_deref(), Some("joint joint2, setting 10"));
    assert_eq!((error.got.as_deref(), error.allowed.as_deref()), (Some("2"), Some("1")));
    never_on(&bench);
    let frames = bench.world.lock().frames.clone();
    assert!(!frames.iter().any(|(_, frame)| is_order(frame, 2, ENABLE)));
}

#[test]
fn an_actuator_that_does_not_switch_on_says_why_and_the_others_let_go_again() {
    // What it says: that it is off, or that its power stage is too hot.
    for (state, words) in [(0, "it says that it is off"), (0xB, "it says: too hot")] {
        let (mut bench, found) = with_can(2);
        {
            let actuator = &mut bench.world.lock().actuators[1];
            (actuator.state, actuator.stays_off) = (state, true);
        }
        let error = refused(arm(&mut bench.link, &found, &never));
        assert_eq!(error.what, "an actuator does not switch on");
        assert_eq!(error.place.as_deref(), Some("joint joint2, ID 2"));
        assert_eq!(error.got.as_deref(), Some(words));
        assert_eq!((bench.torque(), of(&bench, 0).state), (vec![0], 0));
        let frames = bench.world.lock().frames.clone();
        assert!(frames.iter().any(|(_, frame)| is_order(frame, 1, ENABLE)), "it was on");
    }
}

#[test]
fn a_line_of_servos_is_not_silent_for_long_while_actuators_are_asked_whether_they_drive() {
    let (mut bench, found) = with_can(6);
    bench.world.at_each(|world: &mut World, said: &Said| {
        if said.is_torque(true) {
            let only_asked = |actuator: &mut Damiao| actuator.unheard_until_asked = true;
            world.actuators.iter_mut().for_each(only_asked);
            world.slow = Some((HOW_IT_IS, 30 * MS));
        }
    });
    arm(&mut bench.link, &found, &never).expect("armed");
    let on = bench.log().iter().find(|said| said.is_torque(true)).expect("on").at;
    let frames = bench.world.lock().frames.clone();
    let asked = frames.iter().filter(|(at, of)| *at > on && of.id().number() == REGISTERS);
    assert_eq!(asked.count(), 6);
    let spoken = bench.log().into_iter().map(|said| said.at).filter(|&at| at >= on);
    let spoken: Vec<Instant> = spoken.chain([bench.link.clock().now()]).collect();
    let longest = spoken.windows(2).map(|two| two[1].since(two[0])).max();
    // Found silent for more than 50 ms after the second question.
    assert!(longest < Some(90 * MS), "{longest:?}");
}
