//! A bench: servos without a robot around them.

use crate::scene::instruction;
use gaitway_profiles::{self as profiles, Protocol, Role};
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

/// A DYNAMIXEL write of Protocol 2.0 (e-Manual, "Write").
fn write(id: u8, address: u16, value: i64, bytes: u8) -> Vec<u8> {
    let mut parameters = address.to_le_bytes().to_vec();
    parameters.extend(&value.to_le_bytes()[..usize::from(bytes)]);
    instruction(id, 3, &parameters)
}

/// A motor without a gear, rad/s without load: friction holds its shaft short of so near a goal.
const BARE_RAD_S: f64 = 100.0;

/// Goals of a tenth of a turn, whatever the resolution, the gains' units and where the counts begin.
#[test]
fn every_dynamixel_of_protocol_2_goes_where_it_is_told_and_reads_as_far() {
    let (mut gone, mut bare) = (0, Vec::new());
    for name in profiles::servo_names() {
        let profile = profiles::servo(name).unwrap();
        if profile.protocol != Protocol::Dynamixel2 {
            continue;
        }
        if profile.motor.no_load_speed_rad_s > BARE_RAD_S {
            bare.push(name);
            continue;
        }
        let robot = bench(&[of(&format!("{name}:7"))], None).unwrap();
        let baud_bps = robot.lines[0].baud_bps().unwrap();
        let mut world = World::new(&robot, Options::default()).unwrap();
        let item = |role| profile.register(role).and_then(|register| register.item(0)).unwrap();
        let (torque, goal) = (item(Role::TorqueEnable), item(Role::GoalPosition));
        let present = item(Role::PresentPosition).name();
        let turn = i64::from(profile.position.counts) * 360 / i64::from(profile.position.degrees);
        let start = world.register("joint_7", &present).unwrap();
        let target = start + turn / 10;
        world.transmit(0, &write(7, torque.address, 1, 1), baud_bps);
        world.run_until(world.now_ns() + 50_000_000);
        world.transmit(0, &write(7, goal.address, target, goal.register.bytes), baud_bps);
        world.run_until(world.now_ns() + 5_000_000_000);
        let reached = world.register("joint_7", &present).unwrap();
        assert!((reached - target).abs() <= turn / 200, "{name}: {start} to {target}: {reached}");
        let turned_rad = world.joint_position_rad("joint_7").unwrap();
        let wanted_rad = target - i64::from(profile.position.zero_count);
        let wanted_rad = wanted_rad as f64 * profile.radians_per_count();
        assert!((turned_rad - wanted_rad).abs() < 0.04, "{name}: {turned_rad}, {wanted_rad}");
        gone += 1;
    }
    assert_eq!(bare.len(), 4, "of the Y series: {bare:?}");
    assert!(gone + bare.len() >= 61, "{gone}");
}

/// P, PRO and Y count either way from mid travel: what was a little below 0 before a reboot is so after it.
#[test]
fn a_servo_that_counts_either_way_is_still_below_zero_after_a_reboot() {
    for (name, low) in [("ph54-200-s500", -100_000), ("ym070-210-r051", -50_000)] {
        let robot = bench(&[of(&format!("{name}:1"))], None).unwrap();
        let baud_bps = robot.lines[0].baud_bps().unwrap();
        let mut world = World::new(&robot, Options::default()).unwrap();
        let profile = profiles::servo(name).unwrap();
        let angle_rad = f64::from(low) * profile.radians_per_count();
        assert!(world.place_joint("joint_1", angle_rad));
        let read = |world: &World| world.register("joint_1", "Present Position").unwrap();
        assert_eq!(read(&world), i64::from(low), "{name}");
        world.transmit(0, &instruction(1, 8, &[]), baud_bps);
        world.run_until(world.now_ns() + 2_000_000_000);
        assert_eq!(read(&world), i64::from(low), "{name}");
    }
}

/// e-Manual, YM070-210-M001-RH, Error Code(153): 4 is the motor's heat, 2 low voltage, 1 too much of it.
#[test]
fn a_servo_with_error_codes_tells_the_code_and_no_bits() {
    for (register, raw, code) in [
        ("Present Motor Temperature", 90, 4),
        ("Present Input Voltage", 1200, 2),
        ("Present Input Voltage", 3500, 1),
    ] {
        let robot = bench(&[of("ym070-210-m001:1")], None).unwrap();
        let mut world = World::new(&robot, Options::default()).unwrap();
        assert!(world.set_register("joint_1", register, raw));
        world.run_until(world.now_ns() + 1_000_000_000);
        assert_eq!(world.register("joint_1", "Error Code"), Some(code), "{register} {raw}");
    }
}
