//! The driver as it is in production on real interfaces, with virtual actuators behind them.

#[path = "../scene/mod.rs"]
mod scene;

use super::robots::{
    self, CUBEMARS, CUBEMARS_SERVO, DAMIAO, Kind, MOTEUS, ODRIVE, RECOIL, ROBSTRIDE,
};
use gaitway::control::Settings;
use gaitway::port::can_bridge::CanBridge;
use gaitway::port::sim::SharedWorld;
use gaitway::rig::Address;
use gaitway::rig::connect;
use gaitway::robot::Robot;
use gaitway_sim::{Options, World};
use scene::Scene;

fn robot(kind: Kind) -> Robot {
    let text = robots::few(kind, 3, 100.0);
    let file = gaitway_profiles::parse_robot("few.toml", &text).expect("a robot file");
    Robot::new(file).expect("a robot")
}

fn address(interface: &str) -> Address {
    format!("can:{interface}").parse().expect("an address")
}

/// Plays a motion in real time; how it ended.
fn played(kind: Kind, interface: &str) -> Option<String> {
    let robot = robot(kind);
    let world = World::new(&robot.file, Options::default()).expect("a virtual robot");
    let world = SharedWorld::new(world);
    let _bridge = CanBridge::open(world.inner(), 0, interface).expect("a bridge");
    let connection = connect(robot, &[address(interface)], 0).expect("an interface that is up");
    assert!(connection.real_time && connection.world.is_none());
    let settings = Settings::at_rate(100.0);
    let host = scene::Host::new(&world);
    let mut scene = Scene { world, link: connection.link, settings, host };
    let played = scene.play_until(0.3, 1, &|| false);
    if played.run.stop.is_none() {
        for (index, joint) in played.run.tally.joints.iter().enumerate() {
            let moved = joint.highest_rad - joint.lowest_rad;
            assert!((moved - 0.3).abs() < 0.1, "joint {index} moved by {moved}");
        }
        assert!(played.run.bus_load > 0.0 && played.run.bus_load < 0.8, "{}", played.run.bus_load);
    }
    played.run.stop.map(|stop| stop.to_string())
}

#[test]
#[ignore = "needs CAN interfaces"]
fn a_robot_plays_over_real_interfaces() {
    // vcan1 is classic, vcan0 carries FD. A machine that stalls may end a motion, and rightly so.
    let classic = [DAMIAO, CUBEMARS, ROBSTRIDE, ODRIVE, RECOIL, CUBEMARS_SERVO];
    let classic = classic.map(|kind| (kind, "vcan1"));
    for (kind, interface) in classic.into_iter().chain([(MOTEUS, "vcan0")]) {
        let ends: Vec<String> = (0..5).map_while(|_| played(kind, interface)).collect();
        assert!(ends.len() < 5, "{}: never to its end: {ends:#?}", kind.servo);
    }
}

#[test]
#[ignore = "needs CAN interfaces"]
fn an_interface_that_cannot_carry_the_robot_is_refused_in_words() {
    for (kind, interface, words) in [
        (DAMIAO, "vcan2", "the CAN interface is down"),
        (MOTEUS, "vcan1", "carries no CAN FD"),
        (DAMIAO, "nocan7", "there is no such CAN interface"),
    ] {
        let Err(error) = connect(robot(kind), &[address(interface)], 0) else {
            panic!("{interface} was taken for a {}", kind.servo)
        };
        assert!(error.to_string().contains(words), "{error}");
    }
}
