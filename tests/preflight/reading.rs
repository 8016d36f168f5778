//! How lines are read, and what rate they carry.

use super::scene::{self, Scene, assert_clean, assert_excused, excuse_unreached};
use super::{mentions, refused};
use gaitway::control::{self, Settings};
use gaitway::robot::Robot;
use gaitway::robot::preflight::{Accept, preflight};
use gaitway::time::Duration;
use gaitway_sim::Options;

const RETURN_DELAY: &str = "Return Delay Time";

/// OP3 cut down to its first joints, at another line speed.
fn op3_with(joints: usize, baud_bps: u32, baud_index: i64) -> Robot {
    let mut file = gaitway_profiles::robot("op3").expect("a shipped robot");
    file.joints.truncate(joints);
    file.lines[0].kind = gaitway_profiles::LineKind::Serial { baud_bps };
    for setup in &mut file.setups {
        setup.registers.insert("Baud Rate".into(), baud_index);
    }
    Robot::new(file).expect("a robot")
}

/// Bytes by the manual's packet layout (e-Manual, DYNAMIXEL Protocol 2.0): a sync write of 4 bytes
/// is 14 + 5 N, a (fast) sync read 14 + N, a status 11 + L, a merged status 8 + N (L + 4), a read
/// 14. A byte takes ten bits. Return delay 2 us for each status; for a merged one once.
fn goals_and_states_s(devices: usize, bytes_each: usize, fast: bool, baud_bps: f64) -> f64 {
    let (answers, delays) = if fast {
        (8 + devices * (bytes_each + 4), 1)
    } else {
        (devices * (11 + bytes_each), devices)
    };
    let bytes = 14 + 5 * devices + 14 + devices + answers;
    bytes as f64 * 10.0 / baud_bps + delays as f64 * 2e-6
}

#[test]
fn planned_line_times_are_those_of_the_manuals_packets() {
    // Worked out beforehand from the packet layouts, ms: 12 and 20 servos, 10 bytes each.
    for (devices, baud_bps, index, sync_ms, fast_ms) in [
        (12, 1_000_000, 3, 3.54, 2.76),
        (12, 2_000_000, 4, 1.78, 1.38),
        (12, 4_000_000, 6, 0.90, 0.69),
        (20, 1_000_000, 3, 5.72, 4.36),
        (20, 2_000_000, 4, 2.88, 2.18),
        (20, 4_000_000, 6, 1.46, 1.09),
    ] {
        for (fast, expected_ms) in [(false, sync_ms), (true, fast_ms)] {
            let by_hand_s = goals_and_states_s(devices, 10, fast, f64::from(baud_bps));
            assert!((by_hand_s * 1e3 - expected_ms).abs() < 0.005, "{by_hand_s}");
            let robot = op3_with(devices, baud_bps, index);
            let mut scene = Scene::with_robot(robot, Options::default());
            let firmware = vec![if fast { 45 } else { 44 }; devices];
            let plans = scene.link.plan_reads(&firmware, Duration::from_millis(10));
            // One slow read besides: voltage and temperature, 14 bytes out and 14 back.
            let slow_s = 28.0 * 10.0 / f64::from(baud_bps) + 2e-6;
            let planned_s = plans[0].cycle_time_s - slow_s;
            assert!((planned_s - by_hand_s).abs() < 1e-9, "{devices} at {baud_bps}: {planned_s}");
            assert!((plans[0].limit_hz * plans[0].cycle_time_s - 1.0).abs() < 1e-12);
        }
    }
}

#[test]
fn the_virtual_line_takes_as_long_as_was_planned() {
    for robot in ["op3", "open-duck-mini-v2"] {
        let mut scene = Scene::of(robot, Options::default());
        let found = scene.preflight().expect("a robot that is ready");
        let clock = std::sync::Arc::clone(scene.link.clock());
        let began = clock.now();
        let states = scene.link.states(began + Duration::from_millis(50)).expect("a line");
        let took_s = clock.now().since(began).as_secs_f64();
        assert!(states.iter().all(Result::is_ok));
        // What is planned holds the goals and one slow read too; states are most of it.
        let planned_s = found.lines[0].cycle_time_s;
        assert!(took_s < planned_s, "{robot}: {took_s} s of {planned_s} s");
        let joints = states.len();
        let rest_s = if robot == "op3" {
            (14 + 5 * joints + 28) as f64 * 5e-6 + 2e-6
        } else {
            // Feetech: sync write 8 + 3 N; a read 8 and its status 7, at 1 Mbps. The planner grants
            // 200 us before each answer, of which the virtual servo takes 50.
            (8 + 3 * joints + 15) as f64 * 1e-5 + 200e-6 + 150e-6 * joints as f64
        };
        let states_s = planned_s - rest_s;
        assert!((took_s - states_s).abs() < 0.02 * states_s, "{took_s} s, not {states_s} s");
    }
}

#[test]
fn a_person_is_told_how_the_lines_are_read() {
    let found = Scene::op3().preflight().expect("a robot that is ready");
    let words = found.lines[0].to_string();
    // 2.18 ms of goals and states, and 0.14 ms for a slow read.
    let expected = "line body: fast sync read of 10 bytes from 20 servos; 2.3 ms of 10.0 ms";
    assert_eq!(words, expected);
    assert!((found.bus_load - 0.2323).abs() < 0.001, "{}", found.bus_load);
}

#[test]
fn what_does_not_fit_one_cycle_is_spread_over_several_and_played() {
    // Goals, a slow read and whole states take 2.3 ms; 80 % of a cycle must hold what is read.
    for (rate_hz, turns, words) in [
        (340.0, 1, "fast sync read of 10 bytes from 20 servos"),
        (370.0, 2, "every position in every cycle, the rest every 2 cycles"),
        (480.0, 2, "each joint every 2 cycles"),
    ] {
        let mut scene = Scene::op3();
        scene.settings = Settings::at_rate(rate_hz);
        let played = scene.play_until(0.2, 2, &|| false);
        assert_eq!(played.run.stop, None, "{rate_hz} Hz");
        assert_eq!(played.run.tally.missed_cycles, 0, "{rate_hz} Hz");
        assert_clean(&played.verdict);
        let found = scene.preflight().expect("a robot that is ready");
        let plan = &found.lines[0];
        assert_eq!(plan.turns, turns, "{rate_hz} Hz: {plan}");
        assert!(plan.to_string().contains(words), "{rate_hz} Hz: {plan}");
        assert!(plan.load() <= 0.8);
    }
}

#[test]
fn a_silent_joint_stops_a_motion_that_is_read_in_turns() {
    let joint = "r_el".to_string();
    let fault = gaitway_sim::Fault::Silent {
        joint: joint.clone(),
        from_ns: 2_000_000_000,
        until_ns: u64::MAX,
    };
    let mut scene = Scene::with_faults("op3", vec![fault]);
    scene.settings = Settings::at_rate(480.0);
    let played = scene.play_until(0.2, 4, &|| false);
    let stop = played.run.stop.as_ref().expect("a stop").to_string();
    assert!(stop.contains("r_el gave no feedback for 5 cycles"), "{stop}");
}

#[test]
fn joints_that_are_silent_in_one_turn_do_not_make_the_robot_deserted() {
    // Three turns of two joints: in the first nobody answers, the other four joints are there.
    let silent = ["shoulder_pan", "wrist_flex"];
    let faults = silent.iter().map(|joint| gaitway_sim::Fault::Silent {
        joint: (*joint).to_owned(),
        from_ns: 3_200_000_000,
        until_ns: u64::MAX,
    });
    let mut scene = Scene::with_faults("so101", faults.collect());
    scene.settings = Settings::at_rate(500.0);
    let found = scene.preflight().expect("a robot that is ready");
    assert_eq!(found.lines[0].turns, 3, "{}", found.lines[0]);
    let mut played = scene.play_until(0.5, 4, &|| false);
    let stop = played.run.stop.as_ref().expect("a stop").to_string();
    assert!(stop.contains("gave no feedback for 5 cycles"), "{stop}");
    // Those two are deaf as well and never hear their last goals.
    assert_eq!(excuse_unreached(&mut played.verdict, &silent.map(str::to_owned)), [2, 2]);
    // While the others are asked whether they drive they are told nothing, and that is said.
    assert_excused(&played, &scene.link);
    // The others were led to rest and not left at a goal in full flight.
    let present = played.samples.0.iter().rev().filter_map(|row| row[1]);
    let last: Vec<f64> = present.take(10).collect();
    assert!((last[0] - last[9]).abs() < 0.005, "still on its way: {last:?}");
}

/// OP3 whose servos answer as late as they leave the factory, 250 x 2 us, and each for itself:
/// servos with two axes in one case take no part in merged answers.
fn slow_op3() -> Scene {
    let mut file = gaitway_profiles::robot("op3").expect("a shipped robot");
    for setup in &mut file.setups {
        setup.registers.insert(RETURN_DELAY.into(), 250);
    }
    for joint in &mut file.joints {
        joint.shares_case_with = Some(joint.name.clone());
    }
    Scene::with_robot(Robot::new(file).expect("a robot"), Options::default())
}

#[test]
fn a_return_delay_that_makes_the_line_too_slow_is_named_with_what_it_costs() {
    let mut scene = slow_op3();
    // In quarters, 5 x 500 us and goals are more than 80 % of 2.5 ms; without the wait it fits.
    scene.settings = Settings::at_rate(400.0);
    let error = refused(scene);
    mentions(&error, &["too slow", "500 us", "Return Delay Time", "--permit-eeprom", "--rate"]);
    // At 100 Hz joints can be read in turns; that it need not be so is said.
    let found = slow_op3().preflight().expect("read in turns");
    // 20 x 500 us alone are 10 ms; a third of them and all else fit 8 ms.
    assert_eq!(found.lines[0].turns, 2, "{}", found.lines[0]);
    assert!(found.lines[0].method.starts_with("sync read"), "{}", found.lines[0]);
    let said = found.notes.iter().any(|note| note.contains("--permit-eeprom"));
    assert!(said, "{:?}", found.notes);
}

#[test]
fn with_a_permit_the_return_delay_is_lowered_and_how_to_undo_it_said() {
    let permit = Accept { firmware: false, eeprom: true };
    let mut scene = slow_op3();
    scene.world.lock().permit_eeprom(true);
    let period = scene.settings.period;
    let found = preflight(&mut scene.link, period, permit).expect("mended by the permit");
    assert_eq!(found.lines[0].turns, 1, "{}", found.lines[0]);
    let undo = found.notes.iter().filter(|note| note.contains("to undo, write 250 to register 9"));
    assert_eq!(undo.count(), 20, "{:?}", found.notes);
    let delays = |scene: &Scene| {
        let world = scene.world.lock();
        let delay = |joint: &String| world.register(joint, RETURN_DELAY).expect("one");
        world.joint_names().iter().map(delay).collect::<Vec<_>>()
    };
    assert_eq!(delays(&scene), [250; 20], "preflight wrote");
    let trajectory = scene.swing(&found.start_rad, 0.2, 1);
    let armed = scene::arm(&mut scene.link, &found).expect("torque");
    assert_eq!(delays(&scene), [0; 20]);
    let mut samples = scene::Samples::default();
    let settings = scene.settings;
    let run = control::run(&mut scene.link, armed, &trajectory, settings, &mut samples, &|| false)
        .expect("its own joints");
    assert_eq!((run.stop, run.tally.missed_cycles), (None, 0));
    assert_clean(&scene.world.lock().verdict());
    // The next start needs no permit any more, although the robot file still says 250.
    let found = scene.preflight().expect("a robot that is ready");
    assert!(found.eeprom.is_empty());
    assert!(found.notes.iter().any(|note| note.contains("not 250")), "{:?}", found.notes);
}

#[test]
fn a_permit_that_is_not_needed_writes_nothing() {
    let permit = Accept { firmware: false, eeprom: true };
    let mut scene = Scene::op3();
    let period = scene.settings.period;
    let found = preflight(&mut scene.link, period, permit).expect("a robot that is ready");
    assert!(found.eeprom.is_empty());
}

#[test]
fn b16_an_adapter_that_holds_bytes_back_is_found_out_by_measuring() {
    for (latency_ms, fits) in [(1, true), (16, false)] {
        let adapter_latency_ns = latency_ms * 1_000_000;
        let options = Options { adapter_latency_ns, ..Options::default() };
        let mut scene = Scene::of("op3", options.clone());
        assert_eq!(scene.preflight().is_ok(), fits, "{latency_ms} ms");
        if !fits {
            // 16 ms and the answer itself, in 80 % of a cycle: 45 Hz or so.
            let error = refused(Scene::of("op3", options));
            mentions(&error, &["too slowly", "latency_timer", "udev", "--rate 4"]);
        }
    }
}
