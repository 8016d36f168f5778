//! Robots on CAN lines, and on CAN and serial lines together, played in virtual time.

#[path = "can_robot/robots.rs"]
mod robots;
#[path = "scene/mod.rs"]
mod scene;

use gaitway::robot::Robot;
use gaitway_sim::Options;
use robots::{CUBEMARS, CUBEMARS_SERVO, DAMIAO, Kind, MOTEUS, ODRIVE, RECOIL, ROBSTRIDE};
use scene::{Played, Scene, assert_clean};

fn robot(text: &str, name: &str) -> Robot {
    let file = gaitway_profiles::parse_robot(&format!("{name}.toml"), text);
    Robot::new(file.unwrap_or_else(|e| panic!("{e}"))).expect("a robot")
}

fn legs(kind: Kind, rate_hz: f64) -> Scene {
    Scene::with_robot(robot(&robots::legs(kind, rate_hz), "legs"), Options::default())
}

fn few(kind: Kind, count: usize, rate_hz: f64) -> Scene {
    Scene::with_robot(robot(&robots::few(kind, count, rate_hz), "few"), Options::default())
}

/// It moved as far as it was told and stands still at the end.
fn assert_played(played: &Played, swing_rad: f64) {
    assert_eq!(played.run.stop, None, "{:?}", played.run.notes);
    assert_clean(&played.verdict);
    for (index, joint) in played.run.tally.joints.iter().enumerate() {
        let moved = joint.highest_rad - joint.lowest_rad;
        assert!((moved - swing_rad).abs() < 0.1, "joint {index} moved by {moved}");
    }
}

#[test]
fn twelve_actuators_on_one_line_play_at_200_hz() {
    let scene = legs(DAMIAO, 200.0);
    let played = scene.play(0.5, 2);
    println!("{:?}", played.run);
    assert_played(&played, 0.5);
}

#[test]
fn every_dialect_plays() {
    for kind in [DAMIAO, CUBEMARS, ROBSTRIDE, ODRIVE, MOTEUS, RECOIL, CUBEMARS_SERVO] {
        println!("{}", kind.servo);
        let played = few(kind, 3, 100.0).play(0.5, 2);
        assert_played(&played, 0.5);
    }
}
