//! Servos that are not the newest: Protocol 1.0 without group reads or a mode register, SCS with
//! its words the other way round, and families mixed on one line.

use super::scene::{Scene, assert_clean, mixed_robot, protocol1_robot};
use super::{mentions, refused};
use gaitway::control::StopReason;
use gaitway::robot::Robot;
use gaitway_sim::{Fault, Options};

fn protocol1() -> Scene {
    Scene::with_robot(protocol1_robot(), Options::default())
}

#[test]
fn a_protocol_1_robot_is_read_in_bulk_where_its_servos_can_and_one_by_one_where_not() {
    let mut scene = protocol1();
    let found = scene.preflight().expect("a robot that is ready");
    let words = &found.lines[0].method;
    assert!(words.contains("bulk read of 6 bytes from 18 servos"), "{words}");
    assert!(words.contains("single reads of 6 bytes from 2 servos"), "{words}");
    for (joint, start) in scene.link.robot().joints.iter().zip(&found.start_rad) {
        // One count of an AX-12A is 0.0051 rad.
        assert!((joint.initial_rad - start).abs() < 0.006, "{}", joint.name);
    }
}

#[test]
fn robots_of_any_family_play_without_a_missed_read_or_a_broken_rule() {
    for robot in [protocol1_robot(), mixed_robot()] {
        let name = robot.name.clone();
        let mut scene = Scene::with_robot(robot, Options::default());
        let played = scene.play_until(0.2, 3, &|| false);
        assert_eq!(played.run.stop, None, "{name}");
        assert_eq!(played.run.tally.missed_cycles, 0, "{name}");
        assert_clean(&played.verdict);
        let last = played.samples.0.last().expect("samples");
        for (joint, (goal, present)) in played.trajectory.end_rad().iter().zip(last).enumerate() {
            let off = (goal - present.expect("a last read")).abs();
            assert!(off < 0.04, "{name}, joint {joint}: {off} rad from its goal at the end");
        }
    }
}

#[test]
fn every_family_on_a_mixed_line_is_asked_in_its_own_way() {
    let mut scene = Scene::with_robot(mixed_robot(), Options::default());
    let found = scene.preflight().expect("a robot that is ready");
    let words = &found.lines[0].method;
    for part in [
        "fast sync read of 10 bytes from 12 servos",
        "sync read of 15 bytes from 6 servos",
        "single reads of 15 bytes from 2 servos",
    ] {
        assert!(words.contains(part), "{part:?} is missing in {words}");
    }
}

// Torque alone would turn such a joint: the speed that arming allows is what it then goes at.
#[test]
fn a_file_that_expects_a_wheel_is_refused_before_torque() {
    for (robot, joint, mode, words) in [
        ("so101", "wrist_roll", 1, ["wrist_roll", "1 (Velocity)", "0 (Position)"]),
        ("op3", "head_pan", 16, ["head_pan", "16 (Pwm)", "3 (Position), 4 (ExtendedPosition)"]),
    ] {
        let mut robot = gaitway_profiles::robot(robot).expect("a shipped robot");
        let of = robot.joints.iter().find(|of| of.name == joint).expect("a joint");
        let mut setup = robot.setups.iter().find(|s| s.servo == of.servo).expect("one").clone();
        setup.joints = Some(vec![joint.to_owned()]);
        setup.registers = [("Operating Mode".to_owned(), mode)].into();
        robot.setups.push(setup);
        let robot = Robot::new(robot).expect("a robot");
        mentions(&refused(Scene::with_robot(robot, Options::default())), &words);
    }
}

#[test]
fn wheel_mode_is_refused_with_how_to_mend_it() {
    for joint in ["r_knee", "head_pan"] {
        let scene = protocol1();
        for register in ["CW Angle Limit", "CCW Angle Limit"] {
            assert!(scene.world.lock().set_register(joint, register, 0));
        }
        let error = refused(scene);
        mentions(&error, &["wheel mode", joint, "CW Angle Limit and CCW Angle Limit both 0"]);
    }
}

#[test]
fn angle_limits_other_than_the_files_are_refused_with_both_values() {
    let scene = protocol1();
    assert!(scene.world.lock().set_register("l_el", "CCW Angle Limit", 3000));
    mentions(&refused(scene), &["l_el", "CCW Angle Limit", "3000 (raw)", "4095 (raw)"]);
}

#[test]
fn the_speed_limit_of_a_protocol_1_servo_is_never_zero_which_would_be_none() {
    let mut robot = protocol1_robot();
    // So slow that the nearest count of Moving Speed would be 0.
    let slow = robot.file.joints.iter_mut().find(|joint| joint.name == "head_pan");
    slow.expect("a joint").velocity_rad_s = 0.004;
    robot = gaitway::robot::Robot::new(robot.file).expect("a robot");
    let mut scene = Scene::with_robot(robot, Options::default());
    let found = scene.preflight().expect("a robot that is ready");
    super::scene::arm(&mut scene.link, &found).expect("torque");
    let world = scene.world.lock();
    assert_eq!(world.register("head_pan", "Moving Speed"), Some(1));
    // 4.796165 rad/s are 45.8 rev/min: 402 counts of 0.114 rev/min.
    assert_eq!(world.register("r_knee", "Moving Speed"), Some(402));
}

#[test]
fn a_protocol_1_servo_that_reports_an_error_is_refused() {
    // It has no error register; what is wrong comes with every answer.
    let scene = protocol1();
    assert!(scene.world.lock().set_register("r_knee", "Present Temperature", 85));
    let error = refused(scene).to_string();
    assert!(error.contains("r_knee"), "{error}");
}

#[test]
fn a_protocol_1_servo_that_shut_itself_down_is_refused() {
    let scene = protocol1();
    assert!(scene.world.lock().set_register("r_knee", "Torque Limit", 0));
    mentions(&refused(scene), &["gives no torque", "r_knee", "Torque Limit"]);
}

#[test]
fn an_overload_of_any_family_stops_the_motion_and_names_the_joint() {
    for (robot, joint) in [
        (protocol1_robot(), "r_knee"),
        (protocol1_robot(), "head_pan"),
        (mixed_robot(), "r_el"),
        (mixed_robot(), "head_tilt"),
    ] {
        let fault = Fault::Overload { joint: joint.into(), at_ns: 2_500_000_000 };
        let options = Options { faults: vec![fault], ..Options::default() };
        let played = Scene::with_robot(robot, options).play(0.2, 5);
        let Some(StopReason::ServoFault { joint: named, .. }) = &played.run.stop else {
            panic!("{joint}: {:?}", played.run.stop);
        };
        assert_eq!(named, joint);
        assert_clean(&played.verdict);
    }
}
