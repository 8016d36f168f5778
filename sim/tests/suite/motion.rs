//! How goals become motion.

use crate::scene::{Scene, dynamixels, feetech, feetechs, sync_read, sync_write_goals, write};
use std::f64::consts::{PI, TAU};

const RADIANS_PER_COUNT: f64 = PI / 2048.0;

fn moving_scene() -> Scene {
    let mut scene = Scene::new(&dynamixels(&[1]));
    assert_eq!(scene.error(&write(1, 64, &[1])), 0);
    scene
}

fn goal(scene: &mut Scene, raw: i32) {
    assert_eq!(scene.error(&write(1, 116, &raw.to_le_bytes())), 0);
}

/// Milliseconds until the goal generator is at its goal.
fn generator_ms(scene: &mut Scene, raw: i64) -> u64 {
    let start_ns = scene.world.now_ns();
    while scene.get("j1", "Position Trajectory") != raw
        || scene.get("j1", "Velocity Trajectory") != 0
    {
        scene.wait_ms(1);
        assert!(scene.world.now_ns() < start_ns + 60_000_000_000);
    }
    (scene.world.now_ns() - start_ns) / 1_000_000
}

#[test]
fn a_velocity_profile_takes_64_v_over_a_plus_64_distance_over_v_ms() {
    // e-Manual, Profile Velocity(112): t1 = 64 V / A, t2 = 64 distance / V, t3 = t1 + t2.
    let mut scene = moving_scene();
    scene.ask(&write(1, 108, &20_u32.to_le_bytes()));
    scene.ask(&write(1, 112, &100_u32.to_le_bytes()));
    let start_ns = scene.world.now_ns();
    goal(&mut scene, 2048 + 900);
    let asking_ms = (scene.world.now_ns() - start_ns) / 1_000_000;
    assert_eq!(scene.get("j1", "Moving Status") & 0x32, 0x32);
    let took_ms = asking_ms + generator_ms(&mut scene, 2948);
    let expected_ms = 64 * 100 / 20 + 64 * 900 / 100;
    assert!(took_ms.abs_diff(expected_ms) <= 3, "{took_ms} {expected_ms}");
}

#[test]
fn without_acceleration_the_profile_is_a_rectangle() {
    let mut scene = moving_scene();
    scene.ask(&write(1, 112, &100_u32.to_le_bytes()));
    let start_ns = scene.world.now_ns();
    goal(&mut scene, 2048 - 800);
    assert_eq!(scene.get("j1", "Velocity Trajectory"), -100);
    let asking_ms = (scene.world.now_ns() - start_ns) / 1_000_000;
    let took_ms = asking_ms + generator_ms(&mut scene, 1248);
    assert!(took_ms.abs_diff(64 * 800 / 100) <= 3, "{took_ms}");
}

#[test]
fn a_time_based_profile_takes_the_time_it_says() {
    let mut scene = Scene::new(&dynamixels(&[1]));
    scene.set("j1", "Drive Mode", 0x04);
    scene.ask(&write(1, 64, &[1]));
    scene.ask(&write(1, 108, &300_u32.to_le_bytes()));
    scene.ask(&write(1, 112, &1000_u32.to_le_bytes()));
    let start_ns = scene.world.now_ns();
    goal(&mut scene, 2500);
    let asking_ms = (scene.world.now_ns() - start_ns) / 1_000_000;
    let took_ms = asking_ms + generator_ms(&mut scene, 2500);
    // Rounding to counts hides the last few milliseconds of braking.
    assert!(took_ms.abs_diff(1000) <= 5, "{took_ms}");
}

#[test]
fn without_torque_a_goal_moves_nothing() {
    let mut scene = Scene::new(&dynamixels(&[1]));
    goal(&mut scene, 2300);
    scene.wait_ms(500);
    assert_eq!(scene.get("j1", "Present Position"), 2048);
}

#[test]
fn goal_and_present_differ_as_the_shaft_lags_behind_a_sine() {
    let mut scene = moving_scene();
    let mut worst = 0.0_f64;
    for cycle in 0..200 {
        let angle = 30_f64.to_radians() * (TAU * f64::from(cycle) * 0.01).sin();
        let behind = angle - scene.world.joint_position_rad("j1").unwrap();
        worst = worst.max(behind.abs());
        let raw = 2048 + (angle / RADIANS_PER_COUNT).round() as i32;
        scene.world.transmit(0, &sync_write_goals(&[(1, raw)]), 1_000_000);
        scene.wait_ms(10);
    }
    let worst = worst.to_degrees();
    assert!((1.0..=4.5).contains(&worst), "{worst}");
}

#[test]
fn a_goal_current_limits_the_torque_in_current_based_position_mode() {
    let mut scene = Scene::new(&dynamixels(&[1]));
    scene.ask(&write(1, 11, &[5]));
    scene.ask(&write(1, 64, &[1]));
    scene.ask(&write(1, 102, &100_i16.to_le_bytes()));
    goal(&mut scene, 2900);
    let mut highest = 0;
    for _ in 0..100 {
        scene.wait_ms(2);
        highest = highest.max(scene.get("j1", "Present Current").abs());
    }
    assert!((95..=100).contains(&highest), "{highest}");
}

#[test]
fn a_servo_that_works_reports_current_voltage_and_temperature() {
    let mut scene = moving_scene();
    let rest = scene.get("j1", "Present Input Voltage");
    scene.world.transmit(0, &sync_write_goals(&[(1, 3000)]), 1_000_000);
    scene.wait_ms(2);
    assert!(scene.get("j1", "Present Current") > 100);
    assert!(scene.get("j1", "Present Input Voltage") < rest);
    assert!(scene.get("j1", "Present Velocity") > 0);
    assert_eq!(scene.get("j1", "Moving"), 1);
    scene.wait_ms(2_000);
    assert_eq!(scene.get("j1", "Moving"), 0);
    assert!((25..40).contains(&scene.get("j1", "Present Temperature")));
}

#[test]
fn a_feetech_goal_speed_is_kept() {
    let mut scene = Scene::new(&feetechs(&[1]));
    scene.ask(&feetech(1, 3, &[40, 1]));
    // Acceleration 0, goal 3048, time 0, speed 500 steps/s: two seconds.
    scene.ask(&feetech(1, 3, &[41, 0, 0xE8, 0x0B, 0, 0, 0xF4, 0x01]));
    scene.wait_ms(1_000 - 20);
    let half = scene.get("j1", "Present Position");
    assert!((2530..=2548).contains(&half), "{half}");
    assert!((scene.get("j1", "Present Velocity") - 500).abs() <= 5);
    scene.wait_ms(1_500);
    let end = scene.get("j1", "Present Position");
    assert!((3045..=3048).contains(&end), "{end}");
}

#[test]
fn a_feetech_goal_beyond_the_angle_limits_stops_at_the_limit() {
    let mut scene = Scene::new(&feetechs(&[1]));
    scene.set("j1", "Max Position Limit", 2300);
    scene.ask(&feetech(1, 3, &[40, 1]));
    scene.ask(&feetech(1, 3, &[42, 0xC4, 0x09]));
    assert_eq!(scene.get("j1", "Goal Position"), 2500);
    scene.wait_ms(1_000);
    assert!((2296..=2300).contains(&scene.get("j1", "Present Position")));
}

#[test]
fn joint_angles_follow_direction_and_offset() {
    let mut robot = dynamixels(&[1]);
    robot.joints[0].direction = -1;
    robot.joints[0].offset_rad = 0.25;
    robot.joints[0].initial = Some(0.5);
    let mut scene = Scene::new(&robot);
    assert_eq!(scene.world.joint_position_rad("j1"), Some(0.5));
    // servo angle = direction * (joint angle + offset).
    let raw = scene.get("j1", "Present Position");
    assert_eq!(raw, 2048 - (0.75 / RADIANS_PER_COUNT).round() as i64);
    assert!(scene.world.place_joint("j1", -0.1));
    assert!((scene.world.joint_position_rad("j1").unwrap() + 0.1).abs() < 1e-12);
    let raw = scene.get("j1", "Present Position");
    assert_eq!(raw, 2048 - (0.15 / RADIANS_PER_COUNT).round() as i64);
}

#[test]
fn the_shipped_robots_stand_in_their_initial_pose() {
    for name in ["op3", "open-duck-mini-v2"] {
        let robot = gaitway_profiles::robot(name).unwrap();
        let mut scene = Scene::new(&robot);
        assert_eq!(scene.world.joint_names().len(), robot.joints.len());
        scene.wait_ms(1_000);
        for joint in &robot.joints {
            let angle = scene.world.joint_position_rad(&joint.name).unwrap();
            assert!((angle - joint.initial_rad()).abs() < 1e-9, "{name} {}", joint.name);
            assert_eq!(scene.world.joint_velocity_rad_s(&joint.name), Some(0.0));
        }
        assert!(scene.world.verdict().is_clean());
    }
}

#[test]
fn all_of_op3_answers_one_fast_sync_read() {
    let robot = gaitway_profiles::robot("op3").unwrap();
    let ids: Vec<u8> = robot.joints.iter().map(|joint| joint.id).collect();
    let mut scene = Scene::new(&robot);
    assert_eq!(scene.ask(&sync_read(0x8A, 132, 4, &ids)).len(), 8 + 20 * 8);
}
