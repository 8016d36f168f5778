//! What servos must be set to so that arming and goals mean what is meant by them.

use super::{Bench, PING, READ, Robot, Said, T, World, drive, robot, with_profile};
use crate::error::Error;
use crate::robot::preflight::{Accept, Preflight, preflight};
use crate::time::Duration;
use gaitway_profiles::Role;

const MS: Duration = Duration::from_millis(1);
/// A register that no STS servo has: an ID to which it listens besides its own.
const SECOND_ID: u8 = 99;
/// Response Status Level.
const ANSWERS: u8 = 8;
const MIN_POSITION: u8 = 9;
const MAX_POSITION: u8 = 11;
const TORQUE_LIMIT: u8 = 48;
const JOINT1: &str = "joint joint1, ID 21, line line0";

fn checked(bench: &mut Bench) -> Result<Preflight, Error> {
    preflight(&mut bench.link, T, Accept { firmware: false, eeprom: false })
}

/// The servo of joint 1 has a second ID.
fn with_second_id(mut robot: Robot) -> Robot {
    with_profile(&mut robot, 1, |profile| {
        let torque = profile.registers.iter().find(|r| r.role == Some(Role::TorqueEnable));
        let mut second = torque.expect("there").clone();
        second.name = "Secondary ID".to_owned();
        second.role = Some(Role::SecondaryId);
        second.address = u16::from(SECOND_ID);
        (second.min, second.max, second.initial) = (Some(0), Some(255), Some(255));
        profile.registers.push(second);
    });
    robot
}

/// The servo of joint 1 has no register for its mode.
fn without_mode(mut robot: Robot) -> Robot {
    with_profile(&mut robot, 1, |profile| {
        profile.registers.retain(|register| register.role != Some(Role::OperatingMode));
    });
    drive(&mut robot, 1).setup.remove("Operating Mode");
    robot
}

/// What preflight says if these registers of joint 1 read so, and only so often.
fn reading(robot: Robot, registers: &'static [(u8, i64)], times: usize) -> (Bench, Option<Error>) {
    let mut bench = Bench::of(robot);
    let true_ones: Vec<(u8, i64)> = {
        let servo = &bench.world.lock().servos[1];
        registers.iter().map(|&(address, _)| (address, servo.word(address))).collect()
    };
    let mut asked = vec![0; registers.len()];
    bench.world.at_each(move |world: &mut World, said: &Said| {
        for (k, &(address, value)) in registers.iter().enumerate() {
            if said.id == 21 && said.is(READ, address) {
                asked[k] += 1;
                let shown = if asked[k] <= times { value } else { true_ones[k].1 };
                world.servos[1].set_word(address, shown);
            }
        }
    });
    let said = checked(&mut bench).err();
    (bench, said)
}

fn reads(bench: &Bench, address: u8) -> usize {
    bench.log().iter().filter(|said| said.id == 21 && said.is(READ, address)).count()
}

const ALWAYS: usize = 99;

/// What it is refused for, at joint 1.
#[track_caller]
fn what(said: Option<Error>) -> String {
    let error = said.expect("refused");
    let place = error.place.unwrap_or_default();
    assert!(place.starts_with(JOINT1), "{place}");
    error.what
}

#[test]
fn a_servo_that_is_as_it_should_be_is_asked_each_thing_once() {
    let mut bench = Bench::of(with_second_id(robot(&[0, 0])));
    assert!(checked(&mut bench).is_ok());
    // What the robot file states besides is compared as a whole.
    for (address, times) in [(ANSWERS, 2), (SECOND_ID, 1), (TORQUE_LIMIT, 1)] {
        assert_eq!(reads(&bench, address), times, "{address}");
    }
}

#[test]
fn a_servo_that_does_not_answer_writes_is_refused() {
    // The next register is Min Position Limit: 0, as it is.
    let (_, said) = reading(robot(&[0, 0]), &[(ANSWERS, 0)], ALWAYS);
    assert_eq!(what(said), "a servo does not answer when it is written to");
    let (bench, said) = reading(robot(&[0, 0]), &[(ANSWERS, 0)], 1);
    assert_eq!((said, reads(&bench, ANSWERS)), (None, 3), "it was an answer to something else");
}

#[test]
fn a_servo_that_listens_to_the_id_of_another_joint_of_its_line_is_refused() {
    let three = || with_second_id(robot(&[0, 0, 1]));
    let (_, said) = reading(three(), &[(SECOND_ID, 20)], ALWAYS);
    let error = said.expect("refused");
    assert_eq!(error.what, "a servo obeys another joint's goals as well");
    assert_eq!(error.got.as_deref(), Some("20, the ID of joint joint0"));
    assert_eq!(reading(three(), &[(SECOND_ID, 20)], 1).1, None, "an answer to something else");
    // Its own, of one on the other line, of nobody.
    for registers in [&[(SECOND_ID, 21)], &[(SECOND_ID, 22)], &[(SECOND_ID, 23)]] {
        let (bench, said) = reading(three(), registers, ALWAYS);
        assert_eq!((said, reads(&bench, SECOND_ID)), (None, 1), "{registers:?}");
    }
}

#[test]
fn a_servo_without_a_mode_register_whose_limits_are_both_0_would_turn_without_end() {
    const BOTH: &[(u8, i64)] = &[(MIN_POSITION, 0), (MAX_POSITION, 0)];
    let (bench, said) = reading(without_mode(robot(&[0, 0])), BOTH, ALWAYS);
    assert_eq!(what(said), "a servo is in wheel mode: it would turn without end");
    assert_eq!(reads(&bench, MAX_POSITION), 2, "that is believed when it is read once more");
    // Once, the answers were to something else; the third reading is that of the setup.
    let (bench, said) = reading(without_mode(robot(&[0, 0])), BOTH, 1);
    assert_eq!((said, reads(&bench, MAX_POSITION)), (None, 3));
    // One of them is 0 as it should be.
    let (bench, said) = reading(without_mode(robot(&[0, 0])), &[], 0);
    assert_eq!((said, reads(&bench, MIN_POSITION)), (None, 2));
    // The other alone is no wheel either.
    let (_, said) =
        reading(without_mode(robot(&[0, 0])), &[(MIN_POSITION, 5), (MAX_POSITION, 0)], ALWAYS);
    assert_eq!(what(said), "a servo is not configured as the robot file says");
    // Where there is a register for the mode, the limits say nothing about it.
    let (_, said) = reading(robot(&[0, 0]), BOTH, ALWAYS);
    assert_eq!(what(said), "a servo is not configured as the robot file says");
}

#[test]
fn a_servo_without_torque_is_refused() {
    let (_, said) = reading(robot(&[0, 0]), &[(TORQUE_LIMIT, 0)], ALWAYS);
    assert_eq!(what(said), "a servo gives no torque: it shut itself down, or is told to");
    let (_, said) = reading(robot(&[0, 0]), &[(TORQUE_LIMIT, 0)], 1);
    assert_eq!(said, None, "an answer to something else");
    let (_, said) = reading(robot(&[0, 0]), &[(TORQUE_LIMIT, 1)], ALWAYS);
    assert_eq!(said, None, "it gives some");
}

/// A servo that answers pings, and nothing that is asked of its identity.
fn answers_pings_only() -> Bench {
    let bench = Bench::new(&[0, 0]);
    bench.change(1, |servo| servo.mute_about.extend([0, 3]));
    bench
}

#[test]
fn a_servo_that_answers_pings_and_no_reads_is_said_to() {
    let only_pings = "a servo answers pings and nothing else";
    let mut bench = answers_pings_only();
    assert_eq!(what(checked(&mut bench).err()), only_pings);
    // That this host was late earlier is no excuse.
    let mut bench = answers_pings_only();
    let mut said_to = 0;
    bench.world.at_each(move |world: &mut World, said: &Said| {
        said_to += usize::from(said.id == 20);
        if said_to == 1 {
            world.stall(30 * MS);
            said_to += 1;
        }
    });
    assert_eq!(what(checked(&mut bench).err()), only_pings);
    assert!(bench.link.host_late() > Duration::ZERO);
}

#[test]
fn a_servo_is_not_said_to_answer_pings_only_by_a_host_that_was_late_meanwhile() {
    let mut bench = answers_pings_only();
    let mut asked = 0;
    bench.world.at_each(move |world: &mut World, said: &Said| {
        asked += usize::from(said.id == 21);
        if asked == 1 {
            world.stall(30 * MS);
            asked += 1;
        }
    });
    assert_eq!(what(checked(&mut bench).err()), "this host is too late to hear the answers");
}

#[test]
fn a_port_that_vanishes_after_a_ping_was_answered_is_told_as_such() {
    let mut bench = answers_pings_only();
    // Each try begins with a ping; one that is followed by another was to see whether it is there.
    let mut pings = 0;
    bench.world.at_each(move |world: &mut World, said: &Said| match said.instruction {
        PING => pings += 1,
        _ if pings == 2 => world.unplug(0),
        _ => pings = 0,
    });
    assert_eq!(what(checked(&mut bench).err()), "the port vanished");
    let log = bench.log();
    assert!(log.iter().filter(|said| said.id == 21 && said.instruction == PING).count() > 2);
}
