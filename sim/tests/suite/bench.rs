//! A bench: servos without a robot around them.

use crate::scene::instruction;
use gaitway_profiles::{self as profiles, Protocol};
use gaitway_sim::{BenchError, BenchServos, Options, World, bench};

fn of(text: &str) -> BenchServos {
    text.parse().unwrap()
}

/// A ping of Protocol 1.0 (e-Manual, "Ping"), which FEETECH's is too.
fn short_ping(id: u8) -> Vec<u8> {
    vec![0xFF, 0xFF, id, 2, 1, !(id + 3)]
}

#[test]
fn every_servo_that_ships_answers_a_ping_at_the_speed_it_left_the_factory_with() {
    let mut asked = 0;
    for name in profiles::servo_names() {
        let robot = bench(&[of(&format!("{name}:7"))], None).unwrap();
        let baud_bps = robot.lines[0].baud_bps().unwrap();
        let mut world = World::new(&robot, Options::default()).unwrap();
        let ping = match profiles::servo(name).unwrap().protocol {
            Protocol::Dynamixel2 => instruction(7, 1, &[]),
            _ => short_ping(7),
        };
        world.transmit(0, &ping, baud_bps);
        let mut answer = [0; 64];
        let count = world.receive(0, &mut answer, 100_000_000);
        assert!(count >= 6, "{name} says {count} bytes");
        assert!(world.joint_position_rad("joint_7").is_some(), "{name}");
        asked += 1;
    }
    assert!(asked > 30, "{asked}");
}

#[test]
fn every_actuator_that_ships_hangs_on_a_can_line() {
    for name in profiles::actuator_names() {
        let robot = bench(&[of(&format!("{name}:3"))], None).unwrap();
        let world = World::new(&robot, Options::default()).unwrap();
        assert!(world.actuator("joint_3").is_some(), "{name}");
    }
}

#[test]
fn families_share_the_line_and_actuators_have_their_own() {
    let servos = [of("XM430_W350:1,2"), of("sts3215:3-4"), of("dm4310:1")];
    let robot = bench(&servos, Some(1_000_000)).unwrap();
    let names: Vec<&str> = robot.joints.iter().map(|joint| joint.name.as_str()).collect();
    assert_eq!(names, ["bus_1", "bus_2", "bus_3", "bus_4", "can_1"]);
    assert_eq!(robot.lines.len(), 2);
    World::new(&robot, Options::default()).unwrap();
}

#[test]
fn a_bench_that_cannot_be_is_refused_with_what_is_wrong() {
    let refused = |servos: &[&str], baud_bps| {
        let servos: Vec<_> = servos.iter().map(|text| of(text)).collect();
        bench(&servos, baud_bps).unwrap_err()
    };
    // X servos leave the factory with 57,600 bit/s, STS with 1,000,000 (their makers' tables).
    let BenchError::WhichSpeed(each) = refused(&["xm430-w350:1", "sts3215:3"], None) else {
        panic!("a speed was chosen")
    };
    assert!(each.contains("xm430-w350 at 57600") && each.contains("sts3215 at 1000000"), "{each}");
    assert_eq!(refused(&["xm430-w350:1,2", "sts3215:2"], Some(1_000_000)), BenchError::SameId(2));
    let BenchError::UnknownModel { advice, .. } = refused(&["xm430-w35:1"], None) else {
        panic!("it is known")
    };
    assert!(advice.contains("xm430-w350"), "{advice}");
    assert!(matches!(refused(&["sts3215:1"], Some(9600)), BenchError::Speed { .. }));
    assert!(matches!(refused(&["xl430-w250:253"], None), BenchError::Id { id: 253, .. }));
    assert!(matches!(refused(&["dm4310:1", "moteus-r4:2"], None), BenchError::Apart(..)));
    assert_eq!(bench(&[], None).unwrap_err(), BenchError::Empty);
}

#[test]
fn what_names_no_servos_is_no_bench() {
    for text in ["", "xm430-w350", "xm430-w350:", ":1", "a:1,", "a:x", "a:3-1", "a:256", "a:-1"] {
        assert!(text.parse::<BenchServos>().is_err(), "{text:?}");
    }
    // No list is longer than there are IDs, however often they are named.
    let long = format!("a:{}", vec!["0-255"; 1000].join(","));
    assert!(long.parse::<BenchServos>().is_err());
    assert_eq!(of("a:1,3-5").ids, [1, 3, 4, 5]);
}
