//! Nothing moves before identity, configuration, health, start pose and line speed are proven.

#[path = "preflight/families.rs"]
mod families;
#[path = "preflight/late_host.rs"]
mod late_host;
#[path = "preflight/reading.rs"]
mod reading;
mod scene;
#[path = "preflight/shipped.rs"]
mod shipped;

use gaitway::error::Error;
use gaitway::time::Duration;
use scene::Scene;

/// Preflight must refuse, and no goal and no torque may have been written.
fn refused(mut scene: Scene) -> Error {
    let error = scene.preflight().expect_err("a refusal");
    let verdict = scene.world.lock().verdict();
    assert_eq!(verdict.goals, 0, "a goal was written before the refusal");
    for joint in &scene.link.robot().joint_names() {
        let torque = scene.world.lock().register(joint, "Torque Enable");
        assert_eq!(torque, Some(0), "{joint} has torque on after the refusal");
    }
    error
}

fn mentions(error: &Error, words: &[&str]) {
    let text = error.to_string();
    for word in words {
        assert!(text.contains(word), "{word:?} is missing in:\n{text}");
    }
}

#[test]
fn a_healthy_robot_passes_and_stands_where_its_file_says() {
    for robot in ["op3", "open-duck-mini-v2"] {
        let mut scene = Scene::of(robot, Default::default());
        let found = scene.preflight().unwrap_or_else(|e| panic!("{robot}: {e}"));
        for (joint, start) in scene.link.robot().joints.iter().zip(&found.start_rad) {
            // One count of a 4096-count encoder is 0.0015 rad.
            assert!((joint.initial_rad - start).abs() < 0.0016, "{robot} {}", joint.name);
        }
        assert!(found.wire_limit_hz > 140.0, "{robot}: {} Hz", found.wire_limit_hz);
    }
}

#[test]
fn a_missing_servo_is_named() {
    let scene = Scene::op3();
    scene.world.lock().unplug("l_knee").expect("a joint");
    mentions(&refused(scene), &["does not answer", "l_knee", "ID 14"]);
}

#[test]
fn another_model_is_refused_with_both_numbers() {
    let scene = Scene::op3();
    assert!(scene.world.lock().set_register("r_el", "Model Number", 1060));
    mentions(&refused(scene), &["r_el", "1060", "1020", "XM430-W350"]);
}

#[test]
fn unknown_firmware_is_refused_unless_accepted() {
    let scene = Scene::op3();
    assert!(scene.world.lock().set_register("head_pan", "Firmware Version", 3));
    mentions(&refused(scene), &["head_pan", "firmware 3", "--accept-firmware"]);

    let mut scene = Scene::op3();
    assert!(scene.world.lock().set_register("head_pan", "Firmware Version", 3));
    let accept = gaitway::robot::preflight::Accept { firmware: true, eeprom: false };
    let period = scene.settings.period;
    let found = gaitway::robot::preflight::preflight(&mut scene.link, period, accept);
    let found = found.expect("accepted as asked");
    assert!(found.notes.iter().any(|note| note.contains("firmware 3")), "{:?}", found.notes);
}

#[test]
fn a_servo_configured_otherwise_is_refused_with_register_and_both_values() {
    let scene = Scene::op3();
    assert!(scene.world.lock().set_register("r_hip_yaw", "Operating Mode", 4));
    mentions(&refused(scene), &["r_hip_yaw", "Operating Mode", "4 (raw)", "3 (raw)"]);
}

#[test]
fn a_servo_that_would_take_the_speed_limit_for_a_time_or_torque_from_a_goal_is_refused() {
    for (raw, words) in [(4, "times its moves"), (8, "torque on by itself"), (5, "times its moves")]
    {
        // Also where the robot file itself says so.
        for stated in [false, true] {
            let mut file = gaitway_profiles::robot("op3").expect("a shipped robot");
            if stated {
                file.setups.iter_mut().for_each(|setup| {
                    setup.registers.insert("Drive Mode".into(), raw);
                });
            }
            let robot = gaitway::robot::Robot::new(file).expect("a robot");
            let scene = Scene::with_robot(robot, Default::default());
            assert!(scene.world.lock().set_register("l_knee", "Drive Mode", raw));
            mentions(&refused(scene), &[words, "Drive Mode", "'Drive Mode' --raw"]);
        }
    }
}

#[test]
fn a_servo_whose_second_id_is_another_joints_is_refused() {
    let second = "Secondary(Shadow) ID";
    let scene = Scene::op3();
    assert!(scene.world.lock().set_register("l_knee", second, 13));
    mentions(&refused(scene), &["another joint's goals", "l_knee", "r_knee", second]);
    // An ID that no joint has does no harm.
    let mut scene = Scene::op3();
    assert!(scene.world.lock().set_register("l_knee", second, 200));
    scene.preflight().expect("a robot that is ready");
}

#[test]
fn a_servo_that_does_not_answer_every_instruction_is_refused_in_those_words() {
    for (robot, joint, register, level, words) in [
        ("op3", "l_knee", "Status Return Level", 1, "does not answer when it is written to"),
        ("op3", "l_knee", "Status Return Level", 0, "answers pings and nothing else"),
        ("so101", "gripper", "Response Status Level", 0, "does not answer when it is written to"),
    ] {
        let scene = Scene::of(robot, Default::default());
        assert!(scene.world.lock().set_register(joint, register, level));
        mentions(&refused(scene), &[words, joint]);
    }
}

#[test]
fn a_gain_in_ram_is_put_right_and_said() {
    let mut scene = Scene::op3();
    assert!(scene.world.lock().set_register("r_knee", "Position P Gain", 100));
    let found = scene.preflight().expect("a gain is no reason to refuse");
    assert!(found.notes.iter().any(|n| n.contains("Position P Gain is 100")), "{:?}", found.notes);
    scene::arm(&mut scene.link, &found).expect("torque");
    assert_eq!(scene.world.lock().register("r_knee", "Position P Gain"), Some(800));
}

#[test]
fn a_hot_servo_and_a_flat_battery_are_refused() {
    let scene = Scene::op3();
    assert!(scene.world.lock().set_register("l_hip_pitch", "Present Temperature", 79));
    mentions(&refused(scene), &["too hot", "l_hip_pitch", "79", "75"]);
    let scene = Scene::op3();
    assert!(scene.world.lock().set_register("r_sho_pitch", "Present Input Voltage", 90));
    mentions(&refused(scene), &["voltage", "r_sho_pitch"]);
}

#[test]
fn a_hardware_error_is_refused_in_words() {
    let scene = Scene::op3();
    assert!(scene.world.lock().set_register("l_el", "Hardware Error Status", 0x20));
    mentions(&refused(scene), &["hardware error", "l_el", "verload"]);
}

#[test]
fn a_joint_outside_its_limits_is_refused_with_its_range() {
    let scene = Scene::op3();
    assert!(scene.world.lock().place_joint("head_tilt", 2.0));
    mentions(
        &refused(scene),
        &["outside its limits", "head_tilt", "114.6 deg", "-89.9 to 89.9 deg"],
    );
}

#[test]
fn a_rate_the_line_cannot_carry_is_refused_with_the_highest_it_can() {
    let mut scene = Scene::op3();
    scene.settings.period = Duration::from_millis(1);
    let error = refused(scene);
    mentions(&error, &["too slow", "ms of line time", "--rate"]);
}

#[test]
fn a_robot_that_holds_is_taken_over_where_it_stands() {
    let mut scene = Scene::op3();
    for joint in scene.link.robot().joint_names() {
        assert!(scene.world.lock().set_register(&joint, "Torque Enable", 1));
    }
    let found = scene.preflight().expect("a robot that is ready");
    assert!(found.held);
    assert!(found.notes.iter().any(|note| note.contains("torque was already on")));
    let played = scene.play(0.1, 1);
    assert_eq!(played.run.stop, None);
    scene::assert_clean(&played.verdict);
}

#[test]
fn a_failed_first_read_of_any_joint_means_no_goal_and_no_torque() {
    use gaitway_sim::{Damage, Fault};
    let mut twin = Scene::op3();
    twin.preflight().expect("a robot that is ready");
    /// Answers that are only timed, after all positions were read.
    const TIMED: u64 = 5;
    let mut refusals = 0;
    for joint in twin.link.robot().joint_names() {
        // How often this joint answers in a preflight that nothing disturbs: positions come last.
        let answers = twin.world.lock().statuses(&joint).expect("a joint");
        let wanted = answers - TIMED;
        for nth in 0..=answers {
            let mute =
                |k: u64| Fault::Status { joint: joint.clone(), nth: nth + k, damage: Damage::Mute };
            let faults = (0..200).map(mute).collect();
            let mut scene = Scene::with_faults("op3", faults);
            let refused = scene.preflight();
            assert_eq!(refused.is_err(), nth < wanted, "{joint}, status {nth} of {answers}");
            let Err(error) = refused else { continue };
            refusals += 1;
            assert!(error.to_string().contains(&joint), "{joint}, status {nth}: {error}");
            let verdict = scene.world.lock().verdict();
            assert_eq!(verdict.goals, 0, "{joint}, status {nth}");
            let torque = scene.world.lock().register(&joint, "Torque Enable");
            assert_eq!(torque, Some(0), "{joint}, status {nth}");
        }
    }
    assert!(refusals > 20 * 10, "{refusals} refusals");
}
