//! Faults on the line and in the servos, in virtual time, with the referee watching. Each scene has
//! a twin without the fault that ends done.

mod aloud;
#[path = "faults/attack_table.rs"]
mod attack_table;
#[path = "faults/attacks.rs"]
mod attacks;
#[path = "faults/broken.rs"]
mod broken;
#[allow(dead_code)]
#[path = "recording/disk.rs"]
mod disk;
#[path = "faults/doors.rs"]
mod doors;
#[path = "faults/forty.rs"]
mod forty;
#[path = "faults/host.rs"]
mod host;
#[path = "faults/mixed.rs"]
mod mixed;
#[path = "faults/motions.rs"]
mod motions;
mod program;
mod scene;
#[path = "faults/sent.rs"]
mod sent;
#[path = "faults/servos.rs"]
mod servos;
#[path = "faults/table.rs"]
mod table;
#[allow(dead_code)]
#[path = "matrix/wire.rs"]
mod wire;

use aloud::aloud;
use gaitway::control::{self, StopReason};
use gaitway::device::JointState;
use gaitway::time::Duration;
use gaitway_profiles::Role;
use gaitway_sim::{Damage, Fault, Options};
use scene::{Scene, assert_clean, assert_excused, excuse_unreached};
use std::collections::BTreeSet;

/// Two seconds into the motion: preflight and arming are over by then.
const MID_NS: u64 = 2_500_000_000;
const SWING_RAD: f64 = 0.2;
/// One robot of each kind: Dynamixel 2.0, Feetech STS, Dynamixel 1.0 (bulk and single reads), and
/// three protocols on one line, SCS among them; and one with two lines.
const ROBOTS: [&str; 5] = ["op3", "open-duck-mini-v2", "protocol-1", "mixed", "poppy-humanoid"];

fn first_joint(robot: &str) -> String {
    Scene::of(robot, Options::default()).link.robot().joints[3].name.clone()
}

/// Damage to one status of one joint: the motion ends done, and only reads are missed.
fn one_status(robot: &str, nth: u64, damage: Damage) -> scene::Played {
    let fault = Fault::Status { joint: first_joint(robot), nth, damage };
    let played = Scene::with_faults(robot, vec![fault]).play(SWING_RAD, 3);
    assert_eq!(played.run.stop, None, "{robot}, {damage:?}: stopped");
    assert_clean(&played.verdict);
    played
}

#[test]
fn without_a_fault_the_motion_ends_done_with_every_read() {
    for robot in ROBOTS {
        let played = Scene::of(robot, Options::default()).play(SWING_RAD, 3);
        assert_eq!(played.run.stop, None);
        assert_eq!(played.run.tally.missed_cycles, 0);
        assert_clean(&played.verdict);
        let last = played.samples.0.last().expect("samples");
        for (joint, (goal, present)) in played.trajectory.end_rad().iter().zip(last).enumerate() {
            let off = (goal - present.expect("a last read")).abs();
            assert!(off < 0.03, "{robot}, joint {joint}: {off} rad from its goal at the end");
        }
    }
}

#[test]
fn b01_a_byte_lost_from_a_status_costs_at_most_that_cycle() {
    let mut cases = 0;
    for robot in ROBOTS {
        for at in 0..12 {
            let played = one_status(robot, 150, Damage::DropByte { at: Some(at) });
            assert!(played.run.tally.missed_cycles <= 1, "{robot}, byte {at}");
            cases += 1;
        }
    }
    forty::ran("b01_a_byte_lost_from_a_status_costs_at_most_that_cycle", cases);
}

/// A motion in which one joint stands still while the others swing.
fn beside_a_still_joint(robot: &str, faults: Vec<Fault>) -> (scene::Readings, usize, u64) {
    let still = first_joint(robot);
    let mut scene = Scene::with_faults(robot, faults);
    let index = scene.link.robot().joint_names().iter().position(|name| *name == still);
    let index = index.expect("a joint");
    let found = scene.preflight().expect("a robot that is ready");
    let trajectory = scene.swing_but(&found.start_rad, SWING_RAD, 3, index);
    let armed = scene::arm(&mut scene.link, &found).expect("torque");
    let mut readings = scene::Readings::default();
    let settings = scene.settings;
    let run = control::run(&mut scene.link, armed, &trajectory, settings, &mut readings, &|| false)
        .expect("its own joints");
    assert_eq!(run.stop, None, "{robot}");
    let world = scene.world.lock();
    assert_clean(&world.verdict());
    (readings, index, world.struck_count())
}

/// Every reading is one that the undisturbed twin has: of the joint whose statuses are damaged, and
/// which stands still, exactly that of the same cycle; of all others, which move, one that the twin
/// had within a cycle of it. The cycles in which there are less readings than the twin has.
fn missing_beside_twin(
    what: &str,
    twin: &scene::Readings,
    seen: &scene::Readings,
    still: usize,
) -> BTreeSet<usize> {
    /// The step of the coarsest encoder there is, rad.
    const COUNT_RAD: f64 = 0.0052;
    let mut missing = BTreeSet::new();
    assert!(seen.states.len().abs_diff(twin.states.len()) <= 2, "{what}: another length");
    for (cycle, states) in seen.states.iter().enumerate().take(twin.states.len()) {
        for (joint, state) in states.iter().enumerate() {
            let near = &twin.states[cycle.saturating_sub(1)..(cycle + 2).min(twin.states.len())];
            let Some(theirs) = twin.states[cycle][joint] else { continue };
            let Some(state) = state else {
                missing.insert(cycle);
                continue;
            };
            if joint == still {
                let figures =
                    |s: &JointState| (s.position_rad, s.velocity_rad_s, s.current_a, s.load_ratio);
                assert_eq!(figures(state), figures(&theirs), "{what}: cycle {cycle}");
                continue;
            }
            let near = near.iter().filter_map(|states| states[joint]).map(|s| s.position_rad);
            let (low, high) = near.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), rad| {
                (low.min(rad - COUNT_RAD), high.max(rad + COUNT_RAD))
            });
            let is = state.position_rad;
            let there = is >= low && is <= high;
            assert!(there, "{what}: joint {joint}, cycle {cycle}: {is} is not in {low}..{high}");
        }
    }
    missing
}

/// The cases of damage to one status of a joint that stands still, beside the twin without: it costs
/// readings of at most so many cycles.
fn beside_twin(robot: &str, damages: impl IntoIterator<Item = Damage>, most_cycles: usize) -> u64 {
    let (twin, still, _) = beside_a_still_joint(robot, Vec::new());
    let mut cases = 0;
    for damage in damages {
        let fault = Fault::Status { joint: first_joint(robot), nth: 150, damage };
        let (seen, _, struck) = beside_a_still_joint(robot, vec![fault]);
        let what = format!("{robot}, {damage:?}");
        assert_eq!(struck, 1, "{what}: it never struck");
        let missing = missing_beside_twin(&what, &twin, &seen, still);
        assert!(missing.len() <= most_cycles, "{what}: readings are missing in {missing:?}");
        cases += 1;
    }
    cases
}

#[test]
fn b02_no_flipped_bit_is_ever_taken_for_a_value() {
    let bits = || (0..8 * 15).map(|bit| Damage::FlipBit { bit: Some(bit) });
    let cases = ROBOTS.iter().map(|robot| beside_twin(robot, bits(), 1)).sum();
    forty::ran("b02_no_flipped_bit_is_ever_taken_for_a_value", cases);
}

#[test]
fn b04_a_status_that_arrives_twice_shifts_nothing() {
    let cases = ROBOTS.iter().map(|robot| beside_twin(robot, [Damage::Duplicate], 1)).sum();
    forty::ran("b04_a_status_that_arrives_twice_shifts_nothing", cases);
}

#[test]
fn b05_a_stale_reply_is_never_the_next_answer() {
    // It may be missed in its own cycle, and be in the way of an answer of the next.
    let late = || (0..21_u64).map(|k| Damage::StaleReply { by_ns: 200_000 + k * 495_000 });
    let cases = ROBOTS.iter().map(|robot| beside_twin(robot, late(), 2)).sum();
    forty::ran("b05_a_stale_reply_is_never_the_next_answer", cases);
}

#[test]
fn b06_an_answer_under_a_wrong_id_is_not_assigned() {
    let wrong = || [Damage::WrongId { id: 77 }];
    let cases = ROBOTS.iter().map(|robot| beside_twin(robot, wrong(), 1)).sum();
    forty::ran("b06_an_answer_under_a_wrong_id_is_not_assigned", cases);
}

#[test]
fn b06_five_answers_in_a_row_under_a_wrong_id_stop_the_motion_and_the_id_is_named() {
    for robot in ROBOTS {
        let joint = first_joint(robot);
        let damage = Damage::WrongId { id: 77 };
        let (of, until_ns) = (Some(joint.clone()), u64::MAX);
        let fault = Fault::Statuses { of, from_ns: MID_NS, until_ns, probability: 1.0, damage };
        let mut scene = Scene::with_faults(robot, vec![fault]);
        let played = scene.play_until(SWING_RAD, 4, &|| false);
        let Some(StopReason::Silent { joint: named, cycles: 5, miss }) = &played.run.stop else {
            panic!("{robot}: {:?}", played.run.stop);
        };
        let id = scene.link.robot().joints.iter().find(|of| of.name == joint).expect("one").id;
        assert_eq!((named, miss), (&joint, &format!("asked ID {id}, ID 77 answered")), "{robot}");
        assert_excused(&played, &scene.link);
    }
    forty::ran(
        "b06_five_answers_in_a_row_under_a_wrong_id_stop_the_motion_and_the_id_is_named",
        ROBOTS.len() as u64,
    );
}

#[test]
fn b08_garbage_before_a_status_costs_at_most_one_cycle() {
    let mut cases = 0;
    for robot in ROBOTS {
        let noise = [1, 7, 40].map(|length| Damage::Garbage { length });
        for damage in noise.into_iter().chain([Damage::FalseHeader, Damage::Echo]) {
            let played = one_status(robot, 150, damage);
            assert!(played.run.tally.missed_cycles <= 1, "{robot}, {damage:?}");
            cases += 1;
        }
    }
    forty::ran("b08_garbage_before_a_status_costs_at_most_one_cycle", cases);
}

#[test]
fn b10_a_servo_silent_for_four_cycles_is_bridged_and_five_stop_the_motion() {
    let mut cases = 0;
    for robot in ROBOTS {
        let joint = first_joint(robot);
        let period_ns = Scene::of(robot, Options::default()).settings.period.as_nanos() as u64;
        let silent = |cycles: u64| {
            let until_ns = MID_NS + cycles * period_ns - period_ns / 2;
            let fault = Fault::Silent { joint: joint.clone(), from_ns: MID_NS, until_ns };
            Scene::with_faults(robot, vec![fault]).play(SWING_RAD, 4)
        };
        for cycles in 1..=4 {
            let played = silent(cycles);
            assert_eq!(played.run.stop, None, "{robot}, {cycles} cycles");
            assert_clean(&played.verdict);
        }
        cases += 5;
        let mut played = silent(1000);
        let Some(StopReason::Silent { joint: named, cycles: 5, .. }) = &played.run.stop else {
            panic!("{robot}: {:?}", played.run.stop);
        };
        assert_eq!(named, &joint);
        // A deaf servo cannot hear its last goals; every other rule and joint counts.
        let excused = excuse_unreached(&mut played.verdict, std::slice::from_ref(&joint));
        assert!(excused.iter().all(|&count| count <= 1), "{robot}: {excused:?}");
        assert_clean(&played.verdict);
    }
    forty::ran("b10_a_servo_silent_for_four_cycles_is_bridged_and_five_stop_the_motion", cases);
}

#[test]
fn b10_the_joints_behind_a_silent_one_keep_answering() {
    let joint = "r_sho_roll"; // third in the chain of twenty
    let fault =
        Fault::Silent { joint: joint.into(), from_ns: MID_NS, until_ns: MID_NS + 35_000_000 };
    let played = Scene::with_faults("op3", vec![fault]).play(SWING_RAD, 4);
    let missed: Vec<u64> = played.run.tally.joints.iter().map(|joint| joint.missed).collect();
    assert!(missed[2] >= 3, "the silent joint missed {} reads", missed[2]);
    for (index, &missed) in missed.iter().enumerate().filter(|&(index, _)| index != 2) {
        assert!(missed <= 1, "joint {index} missed {missed} reads because of another");
    }
}

#[test]
fn b11_a_servo_that_restarts_stops_the_motion_and_is_not_torqued_again() {
    let fault = Fault::Reboot { joint: "l_hip_pitch".into(), at_ns: MID_NS };
    let mut scene = Scene::with_faults("op3", vec![fault]);
    let played = scene.play_until(SWING_RAD, 8, &|| false);
    assert!(played.run.stop.is_some(), "the restart went unnoticed");
    let torque = scene.world.lock().register("l_hip_pitch", "Torque Enable");
    assert_eq!(torque, Some(0), "torque came back by itself");
}

#[test]
fn b12_an_overload_stops_the_motion_and_names_the_joint() {
    let fault = Fault::Overload { joint: "r_knee".into(), at_ns: MID_NS };
    let played = Scene::with_faults("op3", vec![fault]).play(SWING_RAD, 4);
    let Some(StopReason::ServoFault { joint, .. }) = &played.run.stop else {
        panic!("{:?}", played.run.stop);
    };
    assert_eq!(joint, "r_knee");
    assert_clean(&played.verdict);
}

#[test]
fn b14_a_stuck_joint_stops_the_motion_once_it_is_far_from_its_goal() {
    let fault =
        Fault::StuckPosition { joint: "head_pan".into(), from_ns: MID_NS, until_ns: u64::MAX };
    let played = Scene::with_faults("op3", vec![fault]).play(1.0, 8);
    let Some(StopReason::NotFollowing { joint, .. }) = &played.run.stop else {
        panic!("{:?}", played.run.stop);
    };
    assert_eq!(joint, "head_pan");
    assert_clean(&played.verdict);
}

#[test]
fn a_stop_decelerates_along_the_path_and_rests_in_time() {
    for stop_after in [1, 40, 77, 120, 200] {
        let mut scene = Scene::op3();
        let calls = std::cell::Cell::new(0);
        let asked = || {
            calls.set(calls.get() + 1);
            calls.get() > stop_after
        };
        let played = scene.play_until(SWING_RAD, 4, &asked);
        assert_eq!(played.run.stop, Some(StopReason::Asked));
        assert_clean(&played.verdict);
        // T_stop = 1.6 max(v/a) + 2 T, and half a second for the servos to settle.
        let most_s = stop_after as f64 / 100.0 + 1.6 * 0.2 + 0.02 + 0.5 + 0.02;
        assert!(played.run.duration_s <= most_s, "{} s after {stop_after}", played.run.duration_s);
        let fastest =
            |joint: &String| scene.world.lock().joint_velocity_rad_s(joint).expect("a joint").abs();
        let joints = scene.link.robot().joint_names();
        let worst = joints.iter().map(fastest).fold(0.0, f64::max);
        assert!(worst < 0.05, "a joint still turns with {worst} rad/s");
    }
}

#[test]
fn the_same_seed_gives_the_same_bytes() {
    let play = |seed| {
        let fault = Fault::AnyStatus { probability: 0.002, damage: Damage::FlipBit { bit: None } };
        let options = Options { seed, faults: vec![fault], ..Options::default() };
        Scene::of("op3", options).play(SWING_RAD, 3)
    };
    let (one, same, other) = (play(7), play(7), play(8));
    assert_eq!(one.samples.0, same.samples.0);
    assert_eq!(one.run.stop, same.run.stop);
    assert!(one.samples.0 != other.samples.0, "the seed changes nothing");
}

/// Plays a swing with a host that stalls after its cycles.
fn with_slow_host(
    rounds: usize,
    stall: impl Fn(u64) -> Duration + 'static,
) -> (gaitway::control::Run, gaitway_sim::Verdict, Vec<Vec<f64>>) {
    let mut scene = Scene::op3();
    let found = scene.preflight().expect("a robot that is ready");
    let trajectory = scene.swing(&found.start_rad, 0.5, rounds);
    let armed = scene::arm(&mut scene.link, &found).expect("torque");
    let (world, stall) = (scene.world.clone(), Box::new(stall));
    let mut sink = scene::SlowHost { world, stall, goals_rad: Vec::new() };
    let settings = scene.settings;
    let run =
        gaitway::control::run(&mut scene.link, armed, &trajectory, settings, &mut sink, &|| false)
            .expect("its own joints");
    let verdict = scene.world.lock().verdict();
    (run, verdict, sink.goals_rad)
}

#[test]
fn c22_c24_a_short_stall_is_bridged_and_a_long_one_stops_without_a_jump() {
    let once = |millis| move |cycle| Duration::from_millis(if cycle == 60 { millis } else { 0 });
    let (run, verdict, _) = with_slow_host(3, once(50));
    assert_eq!(run.stop, None);
    assert_clean(&verdict);
    let joints = Scene::op3().link.robot().joint_names();
    // The last is a machine that slept (C24): its clock goes on meanwhile.
    for millis in [150, 300, 2_000, 10_000] {
        let (run, mut verdict, goals_rad) = with_slow_host(3, once(millis));
        assert!(matches!(run.stop, Some(StopReason::Stalled { .. })), "{:?}", run.stop);
        if millis > 200 {
            // The servos' watchdogs have bitten by then, and no further goal is obeyed.
            assert_eq!(excuse_unreached(&mut verdict, &joints), [20, 20], "{millis} ms");
        }
        assert_clean(&verdict);
        // Nothing moves any more: not even the goal that was to be written when the stall was over.
        let after = &goals_rad[61..];
        assert!(!after.is_empty(), "{millis} ms: the loop ended at once");
        assert!(after.iter().all(|goals| *goals == goals_rad[60]), "{millis} ms: a jump");
    }
}

#[test]
fn c23_a_host_that_is_always_too_slow_is_stopped_within_ten_cycles() {
    for millis in [10, 15, 60, 88] {
        let (run, _, _) = with_slow_host(3, move |_| Duration::from_millis(millis));
        assert!(matches!(run.stop, Some(StopReason::Late { .. })), "{millis} ms: {:?}", run.stop);
        assert!(run.tally.late_cycles >= 5, "{millis} ms: {} late", run.tally.late_cycles);
        let ramp_cycles = 40;
        assert!(run.tally.cycles <= 10 + ramp_cycles, "{millis} ms: {} cycles", run.tally.cycles);
    }
}

#[test]
fn a_joint_that_rests_exactly_on_its_limit_may_stay_there() {
    for robot in ROBOTS {
        let names = Scene::of(robot, Options::default()).link.robot().joint_names();
        for (index, name) in names.iter().enumerate() {
            for upper in [false, true] {
                let scene = Scene::of(robot, Options::default());
                let limits = scene.link.robot().joints[index].limits;
                let limit = if upper { limits.upper_rad() } else { limits.lower_rad() };
                assert!(scene.world.lock().place_joint(name, limit));
                let mut scene = scene;
                let found = scene.preflight().unwrap_or_else(|e| panic!("{robot} {name}: {e}"));
                let trajectory = scene.swing_but(&found.start_rad, 0.05, 1, index);
                let armed = scene::arm(&mut scene.link, &found).expect("torque");
                let mut samples = scene::Samples::default();
                let settings = scene.settings;
                let run = gaitway::control::run(
                    &mut scene.link,
                    armed,
                    &trajectory,
                    settings,
                    &mut samples,
                    &|| false,
                )
                .expect("its own joints");
                assert_eq!(run.stop, None, "{robot} {name}, upper {upper}");
            }
        }
    }
}

#[test]
fn a_slow_adapter_breaks_no_rule_when_a_servo_falls_silent() {
    for (rate_hz, latency_ms) in [(20.0, 16), (25.0, 16), (50.0, 5)] {
        // Preflight and arming take 3.5 s where each answer comes 16 ms late.
        for from_ms in (4_000_u64..5_600).step_by(29) {
            let from_ns = from_ms * 1_000_000;
            let until_ns = from_ns + 15_000_000;
            let fault = Fault::Silent { joint: "r_el".into(), from_ns, until_ns };
            let adapter_latency_ns = latency_ms * 1_000_000;
            let options = Options { faults: vec![fault], adapter_latency_ns, ..Options::default() };
            let mut scene = Scene::of("op3", options);
            scene.settings = gaitway::control::Settings::at_rate(rate_hz);
            // As fast as the joints may: no goal can be late and still be within a step.
            let played = scene.play(1.5, 4);
            assert_eq!(played.run.stop, None, "silent from {from_ms} ms at {rate_hz} Hz");
            assert_clean(&played.verdict);
        }
    }
}

#[test]
fn a_robot_on_two_lines_plays_at_the_rate_of_the_slower_one() {
    let robot = scene::op3_on_two_lines();
    let mut scene = Scene::with_robot(robot, Options::default());
    // One line of twenty carries 366 Hz at 80 %; twelve on the longer of two carry more.
    scene.settings = gaitway::control::Settings::at_rate(500.0);
    let played = scene.play(SWING_RAD, 2);
    assert_eq!(played.run.stop, None);
    assert_eq!(played.run.tally.missed_cycles, 0);
    assert_clean(&played.verdict);
}

#[test]
fn arming_that_fails_half_way_leaves_torque_off_or_says_where_it_may_be_on() {
    let mut deaf_under_torque = 0;
    for millis in (230..420).step_by(2) {
        let from_ns = millis * 1_000_000;
        let fault = Fault::Silent { joint: "l_knee".into(), from_ns, until_ns: u64::MAX };
        let mut scene = Scene::with_faults("op3", vec![fault]);
        let Ok(found) = scene.preflight() else { continue };
        let Err(error) = scene::arm(&mut scene.link, &found) else { continue };
        for joint in scene.link.robot().joint_names() {
            if scene.world.lock().register(&joint, "Torque Enable") == Some(0) {
                let watchdog = scene.world.lock().register(&joint, "Bus Watchdog");
                assert!(joint == "l_knee" || watchdog == Some(0), "{millis} ms, {joint}");
                continue;
            }
            deaf_under_torque += 1;
            let text = error.to_string();
            assert!(text.contains("torque may still be on"), "{millis} ms, {joint}:\n{text}");
            assert!(text.contains(&joint), "{millis} ms:\n{text}");
        }
    }
    assert!(deaf_under_torque > 0, "the case never came up");
}

/// Plays with the registers of every joint set in the middle of the motion, as `set` says by role for
/// each joint. `None` for a robot whose servos lack one of them.
fn with_registers_set(
    robot: &str,
    set: impl Fn(&gaitway::robot::Joint) -> Option<[(Role, f64); 2]>,
) -> Option<scene::Played> {
    let mut scene = Scene::of(robot, Options::default());
    let mut writes = Vec::new();
    for joint in &scene.link.robot().joints {
        let model = joint.model().expect("a servo");
        for (role, si) in set(joint)? {
            let register = joint.register(role)?;
            let raw = model.raw_from_si(register, si).expect("a value");
            writes.push((joint.name.clone(), register.name.clone(), raw));
        }
    }
    let world = scene.world.clone();
    let calls = std::cell::Cell::new(0);
    // Not a wish to stop: the hook is where the scene changes the world in the middle of the motion.
    let change = || {
        calls.set(calls.get() + 1);
        if calls.get() == 60 {
            for (joint, register, raw) in &writes {
                assert!(world.lock().set_register(joint, register, *raw), "{joint}: {register}");
            }
        }
        false
    };
    Some(scene.play_until(SWING_RAD, 6, &change))
}

/// The robot in a heat `by_c` above its servos' limits. Their own protection is moved out of the way:
/// ours must speak.
fn in_heat(robot: &str, by_c: f64) -> Option<scene::Played> {
    with_registers_set(robot, |joint| {
        let limit_c = joint.configured(Role::TemperatureLimit)?;
        Some([(Role::TemperatureLimit, limit_c + 15.0), (Role::PresentTemperature, limit_c + by_c)])
    })
}

/// The same with a supply `by_v` above the servos' minimum.
fn on_a_supply(robot: &str, by_v: f64) -> Option<scene::Played> {
    with_registers_set(robot, |joint| {
        let minimum_v = joint.configured(Role::MinVoltageLimit)?;
        Some([(Role::MinVoltageLimit, minimum_v - 1.5), (Role::PresentVoltage, minimum_v + by_v)])
    })
}

#[test]
fn a_low_supply_and_a_hot_servo_stop_the_motion_each_by_its_own_rule() {
    let mut seen = 0;
    for robot in ROBOTS {
        // The twins are as near to the limit on the other side of it.
        if let (Some(hot), Some(warm)) = (in_heat(robot, 3.0), in_heat(robot, -3.0)) {
            let stop = hot.run.stop.expect("a stop");
            assert!(matches!(stop, StopReason::Hot { .. }), "{robot}: {stop:?}");
            assert_clean(&hot.verdict);
            assert_eq!(warm.run.stop, None, "{robot}");
            seen += 1;
        }
        if let (Some(low), Some(enough)) = (on_a_supply(robot, -0.5), on_a_supply(robot, 0.5)) {
            let stop = low.run.stop.expect("a stop");
            assert!(matches!(stop, StopReason::LowVoltage { .. }), "{robot}: {stop:?}");
            assert_clean(&low.verdict);
            assert_eq!(enough.run.stop, None, "{robot}");
            seen += 1;
        }
    }
    assert!(seen >= 6, "only {seen} of {} rules were seen", 2 * ROBOTS.len());
}
