//! Every check before torque, over servos that are as their robot file says but for one thing.

use super::damiao::{
    self, CTRL_MODE, Damiao, HOW_IT_IS, PMAX, REGISTERS, with_actuators, with_others,
};
use super::{
    Bench, PRESENT, READ, STATUS, SYNC_READ, Said, Servo, Shared, T, TORQUE, WATCHDOG, World,
    drive, robot, watched, with_profile,
};
use crate::bus::{AskError, Miss};
use crate::error::Error;
use crate::port::PortError;
use crate::robot::preflight::{Accept, Preflight, budget, exchange_error, positions, preflight};
use crate::robot::{LinePort, Link, LinkError, Robot};
use crate::time::{Duration, Instant};
use std::sync::Arc;

const MS: Duration = Duration::from_millis(1);
const STRICT: Accept = Accept { firmware: false, eeprom: false };

fn checked(bench: &mut Bench) -> Result<Preflight, Error> {
    preflight(&mut bench.link, T, STRICT)
}

/// What preflight says if joint 1 of two is like that.
fn with(change: impl FnOnce(&mut Servo)) -> Result<Preflight, Error> {
    let mut bench = Bench::new(&[0, 0]);
    bench.change(1, change);
    checked(&mut bench)
}

const JOINT1: &str = "joint joint1, ID 21, line line0";

/// It was refused for this, at joint 1.
#[track_caller]
fn refused(said: Result<Preflight, Error>, what: &str) -> Error {
    let error = said.expect_err("refused");
    assert_eq!(error.what, what);
    let place = error.place.clone().unwrap_or_default();
    assert!(place.starts_with(JOINT1), "{place}");
    error
}

#[test]
fn a_robot_as_its_file_says_passes_and_nothing_is_written() {
    let mut bench = Bench::new(&[0, 0]);
    bench.change(1, |servo| servo.put_at(2048 + 100));
    let found = checked(&mut bench).expect("passes");
    assert_eq!(found.start_rad.len(), 2);
    // 100 counts are 0.1534 rad; which way is the robot file's.
    assert_eq!(found.start_rad[0], 0.0);
    assert!((found.start_rad[1].abs() - 0.153_398_078_8).abs() < 1e-9, "{:?}", found.start_rad);
    assert_eq!((found.firmware, found.period, found.held), (vec![778, 778], T, false));
    assert_eq!(found.notes, [""; 0]);
    assert!(found.to_write.is_empty() && found.eeprom.is_empty() && found.settings.is_empty());
    assert!(found.wire_limit_hz > 100.0 && (0.0..0.8).contains(&found.bus_load));
    let writes = bench.log().iter().filter(|said| said.instruction != READ).count();
    let asks = bench.log().iter().filter(|s| s.instruction == SYNC_READ).count();
    let pings = bench.log().iter().filter(|said| said.instruction == super::PING).count();
    assert_eq!(writes, asks + pings);
}

#[test]
fn another_model_is_refused() {
    let error = refused(
        with(|servo| servo.set_word(3, 778)),
        "the servo is not the model that the robot file says",
    );
    assert_eq!(error.got.as_deref(), Some("model number 778"));
}

/// What is said of this firmware, of a profile that was checked for 3.0 to 3.20.
fn of_firmware(major: u8, minor: u8, accept: bool) -> Result<Preflight, Error> {
    let mut robot = robot(&[0, 0]);
    with_profile(&mut robot, 1, |profile| profile.firmware.max = Some(3 * 256 + 20));
    let mut bench = Bench::of(robot);
    bench.change(1, |servo| {
        servo.set(0, major);
        servo.set(1, minor);
    });
    preflight(&mut bench.link, T, Accept { firmware: accept, eeprom: false })
}

#[test]
fn a_firmware_outside_the_profiles_range_is_refused_unless_it_is_accepted() {
    for (major, minor) in [(3, 0), (3, 20)] {
        let found = of_firmware(major, minor, false).expect("inside");
        assert_eq!(found.notes, [""; 0]);
        assert_eq!(of_firmware(major, minor, true).expect("inside").notes, [""; 0]);
    }
    for (major, minor) in [(2, 255), (3, 21)] {
        let what = "the servo's profile was not checked against this firmware";
        let error = refused(of_firmware(major, minor, false), what);
        assert_eq!(error.allowed.as_deref(), Some("768 to 788"));
        let found = of_firmware(major, minor, true).expect("accepted");
        let firmware = u16::from(major) * 256 + u16::from(minor);
        assert_eq!(found.firmware, [778, firmware]);
        assert_eq!(found.notes, [format!("{JOINT1}: firmware {firmware} accepted as asked")]);
    }
}

#[test]
fn a_register_in_eeprom_that_differs_is_refused() {
    // Operating Mode; P Coefficient; Homing Offset.
    for (address, value) in [(33, 1), (21, 31), (31, 5)] {
        let what = "a servo is not configured as the robot file says";
        let error = refused(with(|servo| servo.set(address, value)), what);
        assert_eq!(error.got.as_deref(), Some(&*format!("{value} (raw)")));
    }
}

#[test]
fn a_register_that_decides_is_compared_although_the_robot_file_is_silent() {
    let mut robot = robot(&[0, 0]);
    for name in ["Operating Mode", "Homing Offset", "Min Position Limit", "Max Position Limit"] {
        drive(&mut robot, 1).setup.remove(name);
    }
    assert!(checked(&mut Bench::of(robot.clone())).is_ok());
    for address in [33, 31, 9, 11, 30] {
        let mut bench = Bench::of(robot.clone());
        bench.change(1, |servo| servo.set(address, servo.get(address).wrapping_add(2)));
        refused(checked(&mut bench), "a servo is not configured as the robot file says");
    }
}

#[test]
fn a_register_that_neither_decides_nor_is_stated_may_be_as_it_is() {
    // LED Alarm Condition; Protection Time.
    assert!(with(|servo| servo.set(20, 1)).is_ok());
    assert!(with(|servo| servo.set(35, 1)).is_ok());
}

#[test]
fn a_stated_register_of_no_role_is_compared_as_well() {
    let mut robot = robot(&[0, 0]);
    drive(&mut robot, 1).setup.insert("DTs".to_owned(), 7);
    assert!(checked(&mut Bench::of(robot.clone())).is_ok());
    let mut bench = Bench::of(robot);
    bench.change(1, |servo| servo.set(81, 8));
    refused(checked(&mut bench), "a servo is not configured as the robot file says");
}

#[test]
fn a_line_speed_in_the_register_is_not_compared_since_the_servo_answers() {
    assert!(with(|servo| servo.set(6, 3)).is_ok());
}

#[test]
fn a_return_delay_other_than_stated_is_told_and_the_line_timed_by_it() {
    let found = with(|servo| servo.set(7, 10)).expect("passes");
    let said = format!(
        "{JOINT1}: Return Delay Time is 10, not 0 as in the robot file; the line is timed by it"
    );
    assert_eq!(found.notes, [said]);
}

#[test]
fn a_register_in_ram_that_differs_is_written_when_the_robot_is_armed() {
    // Goal Time.
    let found = with(|servo| servo.set_word(44, 5)).expect("passes");
    let [(1, register, 0)] = found.to_write[..] else { panic!("{:?}", found.to_write) };
    assert_eq!(register.name, "Goal Time");
    assert_eq!(found.notes, [format!("{JOINT1}: Goal Time is 5, set to 0 as the robot file says")]);
}

#[test]
fn torque_that_the_robot_file_states_is_never_written_so() {
    let mut robot = robot(&[0, 0]);
    drive(&mut robot, 1).setup.insert("Torque Enable".to_owned(), 0);
    let mut bench = Bench::of(robot);
    bench.change(1, |servo| servo.set(TORQUE, 1));
    refused(checked(&mut bench), "a servo is not configured as the robot file says");
}

#[test]
fn a_register_that_reads_wrong_once_is_asked_again_in_silence() {
    let mut bench = Bench::new(&[0, 0]);
    let mut asked: Vec<Instant> = Vec::new();
    let times = Arc::new(std::sync::Mutex::new(Vec::new()));
    let seen = Arc::clone(&times);
    bench.world.at_each(move |world: &mut World, said: &Said| {
        if said.id == 21 && said.is(READ, 33) {
            asked.push(said.at);
            world.servos[1].set(33, u8::from(asked.len() == 1));
            seen.lock().expect("one thread").push(said.at);
        }
    });
    checked(&mut bench).expect("the second answer is right");
    let times = times.lock().expect("one thread");
    assert_eq!(times.len(), 2);
    let apart = times[1].since(times[0]);
    assert!((200 * MS..203 * MS).contains(&apart), "{apart:?}");
}

/// What preflight says of a watchdog that reads this.
fn watchdog(raw: u8) -> Preflight {
    let mut bench = Bench::of(watched(robot(&[0, 0]), &[1]));
    bench.change(1, |servo| servo.set(WATCHDOG, raw));
    checked(&mut bench).expect("passes")
}

#[test]
fn a_watchdog_that_was_left_on_or_has_bitten_is_cleared_and_said() {
    assert!(watchdog(0).to_write.is_empty() && watchdog(0).notes.is_empty());
    let on = "the bus watchdog was left on; it is switched off first";
    let bitten = "the bus watchdog had stopped this servo when its host fell silent; it is cleared";
    for (raw, words) in [(1, on), (127, on), (128, bitten), (255, bitten)] {
        let found = watchdog(raw);
        // One that has bitten is cleared with care, when the robot is armed.
        let register = match (&found.to_write[..], &found.latched[..]) {
            ([(1, register, 0)], []) if words == on => register,
            ([], [(1, register)]) if words == bitten => register,
            other => panic!("{other:?}"),
        };
        assert_eq!(register.name, "Bus Watchdog");
        assert_eq!(found.notes, [format!("{JOINT1}: {words}")]);
    }
}

#[test]
fn a_watchdog_is_believed_to_be_on_when_it_was_read_so_twice() {
    // What it reads, time and again; how often it is asked, and whether it is to be switched off.
    for (reads, times, written) in [(&[0][..], 1, 0), (&[10, 0], 2, 0), (&[10, 10], 2, 1)] {
        let mut bench = Bench::of(watched(robot(&[0, 0]), &[1]));
        let mut asked = 0;
        bench.world.at_each(move |world: &mut World, said: &Said| {
            if said.is(READ, WATCHDOG) {
                world.servos[1].set(WATCHDOG, reads[asked]);
                asked += 1;
            }
        });
        assert_eq!(checked(&mut bench).expect("passes").to_write.len(), written, "{reads:?}");
        let asked = bench.log().iter().filter(|said| said.is(READ, WATCHDOG)).count();
        assert_eq!(asked, times, "{reads:?}");
    }
}

#[test]
fn a_servo_that_reports_an_error_is_refused_with_its_words() {
    let error = refused(with(|servo| servo.set(STATUS, 0x24)), "a servo reports a hardware error");
    assert_eq!(error.got.as_deref(), Some("overheating, overload"));
}

#[test]
fn torque_that_is_on_makes_it_a_robot_that_is_held() {
    let found = with(|servo| {
        servo.set(TORQUE, 1);
        servo.set_word(super::GOAL, 2048);
    });
    let found = found.expect("passes");
    assert!(found.held);
    let note = "torque was already on: the robot is taken over where it stands";
    assert_eq!(found.notes, [note]);
    // Whichever joint it is.
    let mut bench = Bench::new(&[0, 0]);
    bench.change(0, |servo| servo.set(TORQUE, 1));
    assert!(checked(&mut bench).expect("passes").held);
}

#[test]
fn a_supply_below_the_servos_minimum_is_refused() {
    // Min Voltage Limit: 4.0 V.
    assert!(with(|servo| servo.set(62, 40)).is_ok());
    let error = refused(with(|servo| servo.set(62, 39)), "the supply voltage is too low");
    assert_eq!(error.got.as_deref(), Some("3.9 V"));
    assert_eq!(error.allowed.as_deref(), Some("at least 4.0 V"));
}

#[test]
fn a_servo_less_than_five_degrees_below_its_limit_is_refused() {
    // Max Temperature Limit: 70 degrees.
    assert!(with(|servo| servo.set(63, 65)).is_ok());
    let error = refused(with(|servo| servo.set(63, 66)), "a servo is too hot to start");
    assert_eq!(error.got.as_deref(), Some("66 deg C"));
    assert_eq!(error.allowed.as_deref(), Some("at most 65 deg C"));
}

/// What preflight says of a joint that moves by so many counts while it is looked whether it does.
fn moved(counts: i64) -> (Result<Preflight, Error>, Duration) {
    let mut bench = Bench::new(&[0, 0]);
    let looks = Arc::new(std::sync::Mutex::new(Vec::new()));
    let seen = Arc::clone(&looks);
    bench.world.at_each(move |world: &mut World, said: &Said| {
        if said.is(SYNC_READ, PRESENT) {
            let mut looks = seen.lock().expect("one thread");
            looks.push(said.at);
            if looks.len() == 2 {
                world.servos[1].put_at(2048 + counts);
            }
        }
    });
    let said = checked(&mut bench);
    let looks = looks.lock().expect("one thread");
    (said, looks[1].since(looks[0]))
}

#[test]
fn a_joint_that_moves_by_more_than_0_01_rad_in_200_ms_is_refused() {
    // 6 counts are 0.0092 rad, 7 are 0.0107 rad.
    for counts in [6, -6] {
        let (said, apart) = moved(counts);
        let found = said.expect("still");
        assert!((200 * MS..203 * MS).contains(&apart), "{apart:?}");
        assert!((found.start_rad[1].abs() - 0.009_203_9).abs() < 1e-6, "where it was seen last");
    }
    for counts in [7, -7] {
        let error = refused(moved(counts).0, "a joint moves before the start");
        assert!(error.got.is_some_and(|got| got.ends_with("0.62 deg in 0.2 s")));
        assert_eq!(error.allowed.as_deref(), Some("0.57 deg"));
    }
}

#[test]
fn a_joint_outside_its_limits_is_refused() {
    let robot = robot(&[0, 0]);
    let limits = robot.joints[1].limits;
    // 24.96 degrees either way, as its servo can be told: 284 counts.
    for (counts, inside) in [(284, true), (-284, true), (285, false), (-285, false)] {
        let said = with(|servo| servo.put_at(2048 + counts));
        assert_eq!(said.is_ok(), inside, "{counts} {limits:?}");
        if !inside {
            let error = refused(said, "a joint stands outside its limits");
            assert_eq!(error.allowed.as_deref(), Some("-25.0 to 25.0 deg"));
        }
    }
}

#[test]
fn a_servo_that_raises_its_alert_flag_is_refused() {
    let mut bench = Bench::new(&[0, 0]);
    bench.change(1, |servo| servo.alert = 1);
    let error = positions(&mut bench.link).expect_err("refused");
    assert_eq!(error.what, "a servo raises its alert flag");
    assert_eq!(error.place.as_deref(), Some(JOINT1));
}

/// What a look at all joints says if joint 1 answers no more than these of the questions to all, and
/// those to it alone or not; and how often all were asked.
fn looked(answers: std::ops::Range<usize>, alone: bool) -> (Result<Vec<f64>, Error>, usize) {
    let mut bench = Bench::new(&[0, 0]);
    bench.link.set_retries(0);
    let mut asked = 0;
    bench.world.at_each(move |world: &mut World, said: &Said| {
        let group = said.instruction == SYNC_READ;
        world.servos[1].silent = if group { !answers.contains(&asked) } else { !alone };
        asked += usize::from(group);
    });
    let said = positions(&mut bench.link);
    let asked = bench.log().iter().filter(|said| said.instruction == SYNC_READ).count();
    (said, asked)
}

#[test]
fn a_look_is_repeated_ten_times_before_a_joint_is_called_silent() {
    // Each look asks a second time itself: eleven looks are 22 questions.
    assert_eq!(looked(0..99, true), (Ok(vec![0.0, 0.0]), 1));
    assert_eq!(looked(3..99, true), (Ok(vec![0.0, 0.0]), 4));
    assert_eq!(looked(21..99, true), (Ok(vec![0.0, 0.0]), 22));
    for alone in [false, true] {
        let (said, asked) = looked(22..99, alone);
        let error = said.expect_err("silent");
        assert_eq!((error.what.as_str(), asked), ("a servo does not answer", 22), "{alone}");
        assert_eq!(error.place.as_deref(), Some(JOINT1));
    }
}

#[test]
fn a_host_that_was_late_blames_no_servo() {
    let mut bench = Bench::new(&[0, 0]);
    bench.world.at_each(|world: &mut World, said: &Said| {
        let group = said.instruction == SYNC_READ;
        world.servos[1].silent = group;
        if group {
            world.stall(30 * MS);
        }
    });
    let error = positions(&mut bench.link).expect_err("late");
    assert_eq!(error.what, "this host is too late to hear the answers");
    assert_eq!(error.place.as_deref(), Some(JOINT1));
}

#[test]
fn a_servo_that_answers_alone_and_not_in_the_group_of_a_host_that_is_in_time_is_silent() {
    // This host was late before, and is not now.
    let mut bench = Bench::new(&[0, 0]);
    let mut asked = 0;
    bench.world.at_each(move |world: &mut World, said: &Said| {
        asked += 1;
        if asked == 1 {
            world.stall(30 * MS);
        }
        world.servos[1].silent = asked > 1 && said.instruction == SYNC_READ;
    });
    positions(&mut bench.link).expect("late, and heard");
    assert!(bench.link.host_late() > Duration::ZERO);
    let error = positions(&mut bench.link).expect_err("silent in the group");
    assert_eq!(error.what, "a servo does not answer");
}

#[test]
fn a_servo_that_is_not_there_is_named() {
    let error = refused(with(|servo| servo.silent = true), "a servo does not answer");
    assert_eq!(error.got.as_deref(), Some("nothing"));
}

#[test]
fn a_question_outside_the_cycle_has_100_ms() {
    let bench = Bench::new(&[0]);
    assert_eq!(budget(&bench.link), bench.link.clock().now() + 100 * MS);
}

#[test]
fn each_way_in_which_an_exchange_fails_has_words_of_its_own() {
    let bench = Bench::new(&[0, 0]);
    let of = |joint: Option<usize>, error: AskError| {
        let failed = LinkError { line: 0, place: "line line0".to_owned(), error };
        exchange_error(&bench.link, joint, &failed)
    };
    let said = |error: AskError| of(Some(1), error).what;
    let gone = || PortError::Gone("pulled out".to_owned());
    assert_eq!(said(gone().into()), "the port vanished");
    assert_eq!(said(PortError::TimedOut.into()), "the line failed");
    assert_eq!(said(Miss::Silent.into()), "a servo does not answer");
    assert_eq!(said(Miss::Garbled.into()), "a servo's answers are damaged");
    assert_eq!(said(Miss::Implausible.into()), "a servo answers wrongly");
    assert_eq!(said(AskError::Unsayable("not said".to_owned())), "not said");
    let late = of(Some(1), Miss::HostLate { by_ms: 40 }.into());
    assert_eq!(late.what, "this host is too late to hear the answers");
    assert_eq!(late.got.as_deref(), Some("40 ms late while it waited"));
    assert_eq!(late.place.as_deref(), Some(JOINT1));
    assert_eq!(of(None, gone().into()).place.as_deref(), Some("line line0"));
}

#[test]
fn a_silent_actuator_is_no_silent_servo() {
    let file = gaitway_profiles::robot_names().find_map(|name| {
        let robot = Robot::load(name).ok()?;
        robot.joints.iter().any(|joint| joint.actuator().is_some()).then_some(robot)
    });
    let robot = file.expect("a robot on CAN is shipped");
    let joint = robot.joints.iter().position(|joint| joint.actuator().is_some()).expect("one");
    let link = Link::new(robot, Vec::<(LinePort, Duration)>::new(), Arc::new(Shared::default()));
    let failed = LinkError { line: 0, place: String::new(), error: Miss::Silent.into() };
    let error = exchange_error(&link, Some(joint), &failed);
    assert_eq!(error.what, "an actuator does not answer");
    assert_eq!(exchange_error(&link, None, &failed).what, "a servo does not answer");
}

/// What preflight says if the second of two actuators, beside a servo, is like that.
fn with_actuator(change: impl FnOnce(&mut Damiao)) -> (Result<Preflight, Error>, Bench) {
    let mut bench = Bench::of(with_actuators(robot(&[0]), 2));
    change(&mut bench.world.lock().actuators[1]);
    (checked(&mut bench), bench)
}

const GAINS: &str =
    "gains as the robot file states: kp 40 N m/rad, kd 1.5 N m s/rad: joint1, joint2";
const JOINT2: &str = "joint joint2, ID 2, line can";

#[test]
fn actuators_as_the_robot_file_says_pass_and_are_only_asked() {
    let (found, bench) = with_actuator(|_| {});
    let found = found.expect("passes");
    assert_eq!(found.notes, [GAINS]);
    assert!(found.settings.is_empty() && !found.held);
    assert_eq!(found.start_rad.len(), 3);
    let frames = bench.world.lock().frames.clone();
    assert!(!frames.is_empty());
    for (_, frame) in frames {
        assert_eq!(frame.id().number(), REGISTERS, "{frame:?}");
        assert!([HOW_IT_IS, damiao::READ].contains(&frame.payload()[2]), "{frame:?}");
    }
}

#[test]
fn what_actuators_tell_unasked_is_waited_for_before_anybody_looks_at_it() {
    let (found, bench) = with_actuator(|_| {});
    found.expect("passes");
    let frames = bench.world.lock().frames.clone();
    let asked = frames.iter().filter(|(_, frame)| frame.payload()[..3] == [1, 0, HOW_IT_IS]);
    let asked: Vec<Instant> = asked.map(|(at, _)| *at).collect();
    let apart = asked[1].since(asked[0]);
    assert!((150 * MS..155 * MS).contains(&apart), "{apart:?}");
}

#[test]
fn an_actuator_in_another_mode_is_to_be_told_the_right_one_when_it_is_armed() {
    let (found, bench) = with_actuator(|of| of.registers[usize::from(CTRL_MODE)] = 2);
    let found = found.expect("passes");
    assert_eq!(found.settings, [(2, u16::from(CTRL_MODE), 1)]);
    let said = format!("{JOINT2}, CTRL_MODE is 2, set to 1 until power-off");
    assert_eq!(found.notes, [GAINS.to_owned(), said]);
    assert_eq!(bench.world.lock().actuators[1].register(CTRL_MODE), 2, "not before");
}

#[test]
fn an_actuator_whose_numbers_mean_something_else_is_refused() {
    let of_end = |end: f32| with_actuator(|of| of.registers[usize::from(PMAX)] = end.to_bits()).0;
    // They travel as f32: one part in 10,000 may be off.
    assert!(of_end(12.501).is_ok());
    for end in [12.502, 12.498, 3.0, f32::NAN] {
        let error = of_end(end).expect_err("refused");
        assert_eq!(error.what, "an actuator means something else by its numbers");
        assert_eq!(error.place.as_deref(), Some(&*format!("{JOINT2}, PMAX")));
        assert_eq!(error.got.as_deref(), Some(&*end.to_string()));
    }
}

#[test]
fn an_actuator_that_let_go_when_its_host_fell_silent_may_be_armed_and_one_with_a_fault_may_not() {
    let found = with_actuator(|of| of.state = 0xD).0.expect("passes");
    let said = format!("{JOINT2}: it had let go when its host fell silent; that is forgotten");
    assert_eq!(found.notes, [GAINS.to_owned(), said]);
    let error = with_actuator(|of| of.state = 0xB).0.expect_err("refused");
    assert_eq!(error.what, "a servo reports a hardware error");
    assert_eq!((error.place.as_deref(), error.got.as_deref()), (Some(JOINT2), Some("too hot")));
}

#[test]
fn an_actuator_that_drives_makes_it_a_robot_that_is_held() {
    assert!(with_actuator(|of| of.state = 1).0.expect("passes").held);
}

/// Why two such actuators, which let go after this silence, are refused in cycles of 20 ms. They
/// are silent: who is not refused for that is asked next, in vain.
fn refused_for_its_watch(actuator: &str, timeout_s: Option<f64>) -> Option<Error> {
    let mut bench = Bench::of(with_others(robot(&[0]), 2, actuator, timeout_s));
    bench.world.lock().actuators.iter_mut().for_each(|actuator| actuator.silent = true);
    let error = checked(&mut bench).expect_err("nobody answers");
    (error.what != "an actuator does not answer").then_some(error)
}

#[test]
fn an_actuator_that_might_go_on_pulling_without_a_host_is_refused() {
    let error = refused_for_its_watch("ak80-9", None).expect("refused");
    assert_eq!(error.what, "an actuator may go on pulling when the host dies");
    let remedy = error.remedy.expect("what to do");
    assert!(remedy.starts_with("set its timeout with the maker's tool"), "{remedy}");
    assert_eq!(refused_for_its_watch("ak80-9", Some(0.2)), None);
    // Its watch is set when it is armed.
    assert_eq!(refused_for_its_watch("dm4310", None), None);
    // It keeps its own gains, and would stay at its last goal.
    assert_eq!(refused_for_its_watch("odrive-s1", None), None);
}

#[test]
fn an_actuator_that_would_let_go_within_three_cycles_is_refused() {
    let error = refused_for_its_watch("ak80-9", Some(0.0599)).expect("refused");
    assert_eq!(error.what, "an actuator would let go between two goals");
    assert_eq!(error.allowed.as_deref(), Some("at least 0.060 s, 3 cycles"));
    assert_eq!(refused_for_its_watch("ak80-9", Some(0.06)), None);
}
