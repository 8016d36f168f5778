//! Servos that lie, share an ID, restart or are not what they should be; on robots of every family.

use super::scene::{Samples, Scene, assert_clean, assert_excused};
use super::{MID_NS, ROBOTS, SWING_RAD, first_joint};
use gaitway::control::{self, Sample, Sink, StopReason};
use gaitway::port::sim::SharedWorld;
use gaitway::robot::preflight::{Accept, preflight};
use gaitway::time::Instant;
use gaitway_sim::{Damage, Fault, Options};
use std::cell::Cell;

/// The byte of a status that holds the high bits of a position: which of the parameters.
fn position_byte(robot: &str, joint: &str) -> usize {
    let scene = Scene::of(robot, Options::default());
    let joint = scene.link.robot().joints.iter().find(|j| j.name == joint).expect("a joint");
    match joint.model().expect("a servo").profile().name.as_str() {
        // Current (2), velocity (4), then the position's four bytes, low first.
        "xm430-w350" => 7,
        // Position first: low byte, high byte.
        _ => 1,
    }
}

/// Every status of `joint` in the window says that it is elsewhere, with a right checksum.
fn lie(robot: &str, joint: &str, until_ns: u64) -> Fault {
    // Bit 2 of the high byte is 1024 counts: a quarter turn, beyond what a cycle can do.
    let damage = Damage::Lie { at: position_byte(robot, joint), xor: 0x04 };
    let of = Some(joint.to_owned());
    Fault::Statuses { of, from_ns: MID_NS, until_ns, probability: 1.0, damage }
}

#[test]
fn b03_a_lie_with_a_sound_checksum_is_not_believed() {
    for robot in ROBOTS {
        let joint = first_joint(robot);
        let scene = Scene::of(robot, Options::default());
        let period_ns = scene.settings.period.as_nanos() as u64;
        let index = scene.link.robot().joints.iter().position(|j| j.name == joint).expect("one");
        // Two cycles of lies are bridged; no reading is a quarter turn off.
        let fault = lie(robot, &joint, MID_NS + 2 * period_ns);
        let played = Scene::with_faults(robot, vec![fault]).play(SWING_RAD, 4);
        assert_eq!(played.run.stop, None, "{robot}");
        assert_clean(&played.verdict);
        let missed = played.run.tally.joints[index].missed;
        assert!((1..=3).contains(&missed), "{robot}: {missed} readings were not believed");
        let start_rad = played.trajectory.start_rad()[index];
        for position_rad in played.samples.0.iter().filter_map(|positions| positions[index]) {
            assert!((position_rad - start_rad).abs() < 0.5, "{robot}: {position_rad} was believed");
        }
        // Lies without end stop the motion after five.
        let fault = lie(robot, &joint, u64::MAX);
        let mut scene = Scene::with_faults(robot, vec![fault]);
        let played = scene.play_until(SWING_RAD, 4, &|| false);
        let Some(StopReason::Silent { joint: named, cycles: 5, miss }) = &played.run.stop else {
            panic!("{robot}: {:?}", played.run.stop);
        };
        assert_eq!((named, miss.as_str()), (&joint, "a position the joint cannot have reached"));
        assert_excused(&played, &scene.link);
    }
}

#[test]
fn b07_two_servos_with_one_id_are_refused_before_torque() {
    for robot in ROBOTS {
        for joint in [first_joint(robot), Scene::of(robot, Options::default()).last_joint()] {
            let mut scene = Scene::of(robot, Options::default());
            // Two that answer in the same words are one to everybody; they must stand apart.
            assert!(scene.world.lock().duplicate(&joint, 0.3));
            let error = scene.preflight().expect_err("two servos with one ID").to_string();
            assert!(error.contains(&joint), "{robot}: {error}");
            assert!(error.contains("two servos with this ID"), "{robot}: {error}");
            assert_untouched(&scene, robot);
        }
    }
}

fn assert_untouched(scene: &Scene, what: &str) {
    let world = scene.world.lock();
    assert_eq!(world.verdict().goals, 0, "{what}: a goal was written");
    for joint in world.joint_names() {
        assert_eq!(world.register(&joint, "Torque Enable"), Some(0), "{what}: {joint} has torque");
    }
}

#[test]
fn b09_false_lengths_and_bodies_without_end_cost_a_cycle_at_most() {
    for robot in ROBOTS {
        let joint = first_joint(robot);
        let short = !matches!(robot, "op3");
        // Where the length of a status lies, and values that are none.
        let lengths: &[(usize, u8)] = if short {
            &[(3, 0x00), (3, 0x01), (3, 0xFF)]
        } else {
            &[(5, 0x00), (6, 0xFF), (5, 0xFF)]
        };
        for &(at, value) in lengths {
            for bit in 0..8 {
                if value >> bit & 1 == 0 {
                    continue;
                }
                let damage = Damage::FlipBit { bit: Some(8 * at + bit) };
                let fault = Fault::Status { joint: joint.clone(), nth: 160, damage };
                let played = Scene::with_faults(robot, vec![fault]).play(SWING_RAD, 3);
                assert_eq!(played.run.stop, None, "{robot}, byte {at}, bit {bit}");
                assert!(played.run.tally.missed_cycles <= 2, "{robot}, byte {at}, bit {bit}");
                assert_clean(&played.verdict);
            }
        }
        // A status whose checksum is right for a length that no answer has.
        for length in [0, 1, 2, 3, 0xFF, 0xFFFF] {
            let damage = Damage::Length { length };
            let fault = Fault::Status { joint: joint.clone(), nth: 160, damage };
            let mut scene = Scene::with_faults(robot, vec![fault]);
            let played = scene.play_until(SWING_RAD, 3, &|| false);
            assert_eq!(played.run.stop, None, "{robot}, length {length}");
            assert_eq!(scene.world.lock().struck_count(), 1, "{robot}, length {length}");
            assert!(played.run.tally.missed_cycles <= 2, "{robot}, length {length}");
            assert_clean(&played.verdict);
        }
        // A line that babbles: 4 KiB of noise before a status.
        let damage = Damage::Garbage { length: 4_096 };
        let fault = Fault::Status { joint, nth: 160, damage };
        let played = Scene::with_faults(robot, vec![fault]).play(SWING_RAD, 3);
        assert_eq!(played.run.stop, None, "{robot}: noise");
        assert_clean(&played.verdict);
    }
}

#[test]
fn b11_a_restart_on_any_robot_is_seen_and_torque_never_comes_back_by_itself() {
    for robot in ROBOTS {
        let joint = first_joint(robot);
        let fault = Fault::Reboot { joint: joint.clone(), at_ns: MID_NS };
        let mut scene = Scene::with_faults(robot, vec![fault]);
        let played = scene.play_until(SWING_RAD, 8, &|| false);
        assert_excused(&played, &scene.link);
        let stop = played.run.stop.expect("the restart went unnoticed").to_string();
        assert!(stop.contains(&joint), "{robot}: {stop}");
        assert_eq!(scene.world.lock().register(&joint, "Torque Enable"), Some(0), "{robot}");
    }
}

#[test]
fn b11_a_servo_that_a_goal_would_wake_is_told_none_while_it_may_have_restarted() {
    for robot in ["protocol-1", "poppy-humanoid"] {
        let joints = Scene::with_faults(robot, Vec::new()).link.robot().joint_names();
        for (joint, name) in joints.iter().enumerate() {
            // Now before its turn to be read, now after it; it boots for 0.3 s.
            for late_ms in [0, 7, 19, 41, 88, 133] {
                let at_ns = MID_NS + (late_ms + 3 * joint as u64) * 1_000_000;
                let fault = Fault::Reboot { joint: name.clone(), at_ns };
                let mut scene = Scene::with_faults(robot, vec![fault]);
                let played = scene.play_until(SWING_RAD, 8, &|| false);
                assert_excused(&played, &scene.link);
                let on = scene.world.lock().register(name, "Torque Enable");
                assert_eq!(on, Some(0), "{robot}, {name}, {late_ms} ms: it was woken");
            }
        }
    }
}

/// When the cycle began in which the alert of `joint` was read, ns.
struct FirstAlert {
    joint: usize,
    at_ns: Option<u64>,
}

impl Sink for FirstAlert {
    fn take(&mut self, sample: &Sample<'_>) {
        if matches!(sample.states[self.joint], Ok((_, true))) {
            self.at_ns.get_or_insert(sample.at.as_nanos());
        }
    }
}

fn first_alert_ns(robot: &str, joint: &str, fault: Fault) -> u64 {
    let mut scene = Scene::with_faults(robot, vec![fault]);
    let index = scene.link.robot().joints.iter().position(|of| of.name == joint).expect("one");
    let found = scene.preflight().expect("a robot that is ready");
    let trajectory = scene.swing(&found.start_rad, SWING_RAD, 4);
    let armed = super::scene::arm(&mut scene.link, &found).expect("torque");
    let mut seen = FirstAlert { joint: index, at_ns: None };
    let settings = scene.settings;
    control::run(&mut scene.link, armed, &trajectory, settings, &mut seen, &|| false)
        .expect("its own joints");
    seen.at_ns.unwrap_or_else(|| panic!("{robot}: no alert was read"))
}

fn overload_at(joint: &str, at_ns: u64) -> Fault {
    Fault::Overload { joint: joint.to_owned(), at_ns }
}

#[test]
fn b12_an_overload_on_any_robot_stops_the_motion_and_the_others_hold() {
    for robot in ROBOTS {
        let joint = first_joint(robot);
        let mut scene = Scene::with_faults(robot, vec![overload_at(&joint, MID_NS)]);
        let played = scene.play_until(SWING_RAD, 4, &|| false);
        let Some(StopReason::ServoFault { joint: named, .. }) = &played.run.stop else {
            panic!("{robot}: {:?}", played.run.stop);
        };
        assert_eq!(named, &joint);
        // It let go in the middle of its ramp, and is told nothing more.
        assert_excused(&played, &scene.link);
        let seen_at_ns = first_alert_ns(robot, &joint, overload_at(&joint, MID_NS));
        // The cycle may have begun before the fault.
        let late_ns = seen_at_ns.saturating_sub(MID_NS);
        assert!(
            late_ns <= 2 * scene.settings.period.as_nanos() as u64,
            "{robot}: the alert was seen after {late_ns} ns"
        );
        // The others hold; nothing was cleared or restarted.
        for name in scene.link.robot().joint_names() {
            let torque = scene.world.lock().register(&name, "Torque Enable");
            let expected = i64::from(name != joint);
            // A Protocol 1.0 servo lets go by its torque limit and leaves this bit alone.
            assert!(torque == Some(expected) || name == joint, "{robot}: {name} {torque:?}");
        }
    }
}

/// Time of the last cycle, and how many goals the servos had taken when one answered again.
struct GoalsTaken {
    world: SharedWorld,
    last_ns: u64,
    silent: bool,
    at_first_answer: Option<u64>,
}

impl Sink for GoalsTaken {
    fn take(&mut self, sample: &Sample<'_>) {
        let world = self.world.lock();
        self.last_ns = world.now_ns();
        let answered = sample.states.iter().any(Result::is_ok);
        self.silent |= !answered && world.now_ns() > MID_NS;
        if self.silent && answered {
            self.at_first_answer.get_or_insert(world.verdict().goals);
        }
    }
}

#[test]
fn b13_servos_that_come_back_from_a_brown_out_get_no_goal_and_no_torque() {
    // While the motion is run down blindly, as it ends, and long after.
    let mut came_back = 0;
    for (robot, length_ms) in
        ROBOTS.iter().flat_map(|robot| [1, 320, 350, 380, 900].map(|ms| (robot, ms)))
    {
        let until_ns = MID_NS + length_ms * 1_000_000;
        let fault = Fault::Brownout { from_ns: MID_NS, until_ns };
        let mut scene = Scene::with_faults(robot, vec![fault]);
        let found = scene.preflight().expect("a robot that is ready");
        let trajectory = scene.swing(&found.start_rad, SWING_RAD, 8);
        let armed = super::scene::arm(&mut scene.link, &found).expect("torque");
        let world = scene.world.clone();
        let mut goals = GoalsTaken { world, last_ns: 0, silent: false, at_first_answer: None };
        let settings = scene.settings;
        let run =
            control::run(&mut scene.link, armed, &trajectory, settings, &mut goals, &|| false)
                .expect("its own joints");
        let what = format!("{robot}, {length_ms} ms: {:?}", run.stop);
        assert!(
            matches!(run.stop, Some(StopReason::Silent { .. } | StopReason::CameBackLimp { .. })),
            "{what}"
        );
        let world = scene.world.lock();
        let after_answer =
            goals.at_first_answer.map(|at_first_answer| world.verdict().goals - at_first_answer);
        assert!(after_answer.unwrap_or(0) == 0, "{what}: {after_answer:?} goals after an answer");
        came_back += usize::from(after_answer.is_some());
        let limits = scene.link.robot().limits();
        let most_s = control::cycle::longest_stop_s(&limits, settings.period)
            + 7.0 * settings.period.as_secs_f64();
        let after_s = goals.last_ns.saturating_sub(MID_NS) as f64 * 1e-9;
        assert!(after_s <= most_s, "{what}: it went on for {after_s} s of {most_s} s");
        for joint in scene.link.robot().joint_names() {
            assert_eq!(world.register(&joint, "Torque Enable"), Some(0), "{what}: {joint}");
        }
    }
    assert!(came_back >= 2 * ROBOTS.len(), "servos came back in {came_back} scenes");
}

/// When a joint was first further than the bound from where the motion wanted it, and the last cycle.
struct FirstFar {
    joint: usize,
    first: Option<Instant>,
    last: Instant,
}

impl Sink for FirstFar {
    fn take(&mut self, sample: &Sample<'_>) {
        self.last = sample.at;
        if let Ok((state, _)) = sample.states[self.joint]
            && (sample.wanted_rad[self.joint] - state.position_rad).abs() > 0.35
        {
            self.first.get_or_insert(sample.at);
        }
    }
}

#[test]
fn b14_a_blocked_joint_on_any_robot_stops_the_motion_in_time() {
    for robot in ROBOTS {
        let joint = first_joint(robot);
        let fault =
            Fault::StuckPosition { joint: joint.clone(), from_ns: MID_NS, until_ns: u64::MAX };
        let mut scene = Scene::with_faults(robot, vec![fault]);
        let names = scene.link.robot().joint_names();
        let index = names.iter().position(|name| *name == joint).expect("a joint");
        let found = scene.preflight().expect("a robot that is ready");
        let trajectory = scene.swing(&found.start_rad, 0.9, 8);
        let armed = super::scene::arm(&mut scene.link, &found).expect("torque");
        let mut seen = FirstFar { joint: index, first: None, last: Instant::ZERO };
        let settings = scene.settings;
        let run = control::run(&mut scene.link, armed, &trajectory, settings, &mut seen, &|| false)
            .expect("its own joints");
        let stop = run.stop_data.expect("a stop");
        assert_eq!(stop.joint.as_ref(), Some(&joint), "{robot}");
        // A servo that trips over its own overload protection may speak first.
        let first = seen.first.unwrap_or(seen.last);
        let limits = scene.link.robot().limits();
        let period_s = settings.period.as_secs_f64();
        // 0.3 s of doubt, the ramp, half a second for the joints to settle, and three cycles.
        let most_s = 0.3
            + control::cycle::longest_stop_s(&limits, settings.period)
            + settings.settle.as_secs_f64()
            + 3.0 * period_s;
        let took_s = seen.last.since(first).as_secs_f64();
        assert!(took_s <= most_s, "{robot}: it went on for {took_s} s of {most_s} s");
        assert_clean(&scene.world.lock().verdict());
    }
    super::forty::ran(
        "b14_a_blocked_joint_on_any_robot_stops_the_motion_in_time",
        ROBOTS.len() as u64,
    );
}

#[test]
fn b14_an_encoder_that_jumps_a_turn_moves_no_goal_and_stops_the_motion() {
    for robot in ROBOTS {
        let joint = first_joint(robot);
        for counts in [-1024, 700, 4096] {
            let fault = Fault::PositionJump { joint: joint.clone(), at_ns: MID_NS, counts };
            let mut scene = Scene::with_faults(robot, vec![fault]);
            let played = scene.play_until(SWING_RAD, 5, &|| false);
            let wraps = counts == 4096 && played.run.stop.is_none();
            // A turn that the register does not show changes nothing; any other is a stop.
            if !wraps {
                let stop = played
                    .run
                    .stop
                    .unwrap_or_else(|| panic!("{robot}, {counts}: the jump went unnoticed"))
                    .to_string();
                assert!(stop.contains(&joint), "{robot}, {counts} counts: {stop}");
            }
            assert_clean(&played.verdict);
        }
    }
}

#[test]
fn b15_a_servo_that_is_not_what_the_file_says_is_refused_with_both_values() {
    let model = |robot: &str| if robot == "open-duck-mini-v2" { "Model" } else { "Model Number" };
    for robot in ROBOTS {
        let scene = Scene::of(robot, Options::default());
        let joint = scene.link.robot().joints[3].clone();
        let profile = joint.model().expect("a servo").profile();
        let named = |role| joint.register(role).map(|r| r.name.clone());
        use gaitway_profiles::Role::{MinPositionLimit, ModelNumber};
        let model_register = named(ModelNumber).unwrap_or_else(|| model(robot).into());
        let limit_register = named(MinPositionLimit).expect("a limit");
        for (register, raw, expected) in
            [(model_register, 4_321, i64::from(profile.model_number)), (limit_register, 77, 0)]
        {
            for accept_firmware in [false, true] {
                let mut scene = Scene::of(robot, Options::default());
                assert!(scene.world.lock().set_register(&joint.name, &register, raw), "{register}");
                let accept = Accept { firmware: accept_firmware, eeprom: false };
                let period = scene.settings.period;
                let error = preflight(&mut scene.link, period, accept).expect_err("a refusal");
                let text = error.to_string();
                for word in [joint.name.clone(), raw.to_string(), expected.to_string()] {
                    assert!(text.contains(&word), "{robot}, {register}: {word} is not in:\n{text}");
                }
                assert_untouched(&scene, robot);
            }
        }
    }
}

#[test]
fn x25_a_first_read_that_fails_at_any_joint_and_any_try_means_no_goal_and_no_torque() {
    for robot in ROBOTS {
        for joint in Scene::of(robot, Options::default()).link.robot().joint_names() {
            // Dead from some moment of preflight on: at the start, in the middle, near its end.
            let mut refusals = 0;
            for from_ms in [0, 40, 90, 150, 230, 290] {
                let from_ns = from_ms * 1_000_000;
                let of = Some(joint.clone());
                let damage = Damage::Mute;
                let until_ns = u64::MAX;
                let fault = Fault::Statuses { of, from_ns, until_ns, probability: 1.0, damage };
                let mut scene = Scene::with_faults(robot, vec![fault]);
                if let Err(error) = scene.preflight() {
                    refusals += 1;
                    let text = error.to_string();
                    assert!(text.contains(&joint), "{robot}, from {from_ms} ms: {text}");
                    assert_untouched(&scene, robot);
                }
            }
            assert!(refusals >= 3, "{robot}, {joint}: refused {refusals} times");
        }
    }
}

#[test]
fn x26_a_wish_to_stop_at_any_of_fifty_points_ends_in_a_hold_and_a_second_changes_nothing() {
    for robot in ROBOTS {
        let twin = Scene::of(robot, Options::default()).play(SWING_RAD, 2);
        assert_eq!(twin.run.stop, None);
        let cycles = twin.run.tally.cycles;
        for point in 0..50 {
            let after = point * cycles / 50;
            let goals = |again: bool| {
                let mut scene = Scene::of(robot, Options::default());
                let calls = Cell::new(0);
                let asked = || {
                    calls.set(calls.get() + 1);
                    let call = calls.get() - 1;
                    call == after || again && call > after && call.is_multiple_of(3)
                };
                let played = scene.play_until(SWING_RAD, 2, &asked);
                assert_eq!(played.run.stop, Some(StopReason::Asked), "{robot}, cycle {after}");
                assert_clean(&played.verdict);
                let period_s = scene.settings.period.as_secs_f64();
                // T_stop = 1.6 max(v/a) + 2 T, and half a second for the servos to settle.
                let limits = scene.link.robot().limits();
                let ramp =
                    |l: &gaitway::motion::JointLimits| l.velocity_rad_s() / l.acceleration_rad_s2();
                let stop_s = 1.6 * limits.iter().map(ramp).fold(0.0, f64::max);
                let most_s = (after as f64 + 4.0) * period_s + stop_s + 0.5;
                let took_s = played.run.duration_s;
                assert!(took_s <= most_s, "{robot}, cycle {after}: {took_s} s");
                for joint in scene.link.robot().joint_names() {
                    let torque = scene.world.lock().register(&joint, "Torque Enable");
                    assert_eq!(torque, Some(1), "{robot}: {joint} does not hold");
                }
                played.samples.0
            };
            let once = goals(false);
            if point % 10 == 3 {
                assert_eq!(once, goals(true), "{robot}: a second wish changed the ramp");
            }
        }
    }
}

#[test]
fn b04_and_random_damage_still_leave_a_family_playable() {
    // One seed of each family with damage of every kind at once.
    for robot in ROBOTS {
        let faults = [
            Damage::FlipBit { bit: None },
            Damage::DropByte { at: None },
            Damage::Duplicate,
            Damage::Garbage { length: 9 },
            Damage::Mute,
        ];
        let fault = |damage| Fault::Statuses {
            of: None,
            from_ns: MID_NS,
            until_ns: u64::MAX,
            probability: 0.002,
            damage,
        };
        let faults = faults.into_iter().map(fault).collect();
        let mut scene = Scene::with_faults(robot, faults);
        let found = scene.preflight().expect("a robot that is ready");
        let trajectory = scene.swing(&found.start_rad, SWING_RAD, 4);
        let armed = super::scene::arm(&mut scene.link, &found).expect("torque");
        let mut samples = Samples::default();
        let settings = scene.settings;
        let run =
            control::run(&mut scene.link, armed, &trajectory, settings, &mut samples, &|| false)
                .expect("its own joints");
        assert_eq!(run.stop, None, "{robot}");
        assert!(scene.world.lock().struck_count() > 5, "{robot}: nothing struck");
        assert_clean(&scene.world.lock().verdict());
    }
}
