//! Who is on a line: virtual robots as they should be, and with IDs given twice.

#[path = "wire_bus/mod.rs"]
mod line;

use gaitway::bus::Protocol::{self, Dynamixel1, Dynamixel2, FeetechScs, FeetechSts};
use gaitway::bus::scan::{Found, Reading, Reason, Scan, scan, scan_while};
use gaitway::device::Model;
use gaitway::time::Duration;
use gaitway_profiles::Robot;
use gaitway_sim::{Damage, Fault, Options};
use line::{ScriptedLine, at_s, in_s, mixed_robot, op3, sts_robot, virtual_bus};

/// Registers in which two servos of a model differ: from the clock to Present Position.
fn unlike_others(found: &Found) -> Vec<(u16, u16)> {
    match found.protocol {
        Dynamixel2 => vec![(120, 16)],
        _ => vec![(56, 2)],
    }
}

fn nothing(_: &Found) -> Vec<(u16, u16)> {
    Vec::new()
}

fn ids(scan: &Scan) -> Vec<u8> {
    scan.found.iter().map(|found| found.id).collect()
}

fn ids_of(robot: &Robot) -> Vec<u8> {
    let mut ids: Vec<u8> = robot.joints.iter().map(|joint| joint.id).collect();
    ids.sort_unstable();
    ids
}

fn scanned(robot: &Robot, protocols: &[Protocol], options: Options) -> (Scan, f64) {
    let (world, mut bus) = virtual_bus(robot, options);
    let scan = scan(&mut bus, protocols, unlike_others, in_s(&world, 10.0)).expect("a line");
    let took_s = world.lock().now_ns() as f64 / 1e9;
    (scan, took_s)
}

#[test]
fn twenty_servos_are_found_and_named_in_less_than_a_second_of_line_time() {
    for latency_ns in [0, 1_000_000] {
        let options = Options { adapter_latency_ns: latency_ns, ..Options::default() };
        let (scan, took_s) = scanned(&op3(), &[Dynamixel2], options);
        assert_eq!(ids(&scan), ids_of(&op3()));
        assert_eq!((scan.collisions, scan.complete), (vec![], true));
        // XM430-W350, by the maker's table of models.
        let model = Reading { protocol: Dynamixel2, model_number: 1020, firmware: 45 };
        for found in &scan.found {
            let Reading { firmware, .. } = found.readings[0];
            assert_eq!(found.readings, [Reading { firmware, ..model }]);
        }
        assert!(took_s < 1.0, "{took_s} s with {latency_ns} ns of latency");
    }
}

#[test]
fn twenty_feetech_servos_are_found_by_a_ping_of_all_and_one_by_one() {
    // 777: the model word of an STS3215, major 9 and minor 3.
    let sts = Reading { protocol: FeetechSts, model_number: 777, firmware: 0x0309 };
    let (scan, took_s) = scanned(&sts_robot(), &[FeetechSts], Options::default());
    assert_eq!(ids(&scan), ids_of(&sts_robot()));
    assert!(scan.found.iter().all(|found| found.readings == [sts]), "{:?}", scan.found);
    assert!(took_s < 1.0, "{took_s} s at once");

    let family = [Dynamixel1, FeetechSts, FeetechScs];
    let (scan, took_s) = scanned(&sts_robot(), &family, Options::default());
    assert_eq!((ids(&scan), scan.collisions), (ids_of(&sts_robot()), vec![]));
    assert!(scan.found.iter().all(|found| found.readings.contains(&sts)), "{:?}", scan.found);
    assert!(took_s < 1.0, "{took_s} s one by one");
}

#[test]
fn servos_of_all_four_families_on_one_line_are_found_and_named() {
    let robot = mixed_robot();
    let (world, mut bus) = virtual_bus(&robot, Options::default());
    let all = [Dynamixel2, Dynamixel1, FeetechSts, FeetechScs];
    let found = scan(&mut bus, &all, nothing, in_s(&world, 10.0)).expect("a line");
    assert_eq!(found.collisions, []);
    assert_eq!(found.found.len(), robot.joints.len());
    for joint in &robot.joints {
        let servo = gaitway_profiles::servo(&joint.servo).expect("a shipped servo");
        let protocol = Model::new(servo).protocol();
        let found = found.found.iter().find(|found| found.id == joint.id).expect("found");
        let same = |r: &&Reading| r.protocol == protocol && r.model_number == servo.model_number;
        assert!(found.readings.iter().any(|r| same(&r)), "{}: {found:?}", joint.servo);
    }
}

#[test]
fn a_scan_finds_nothing_in_a_protocol_nobody_speaks() {
    let (scan, _) = scanned(&op3(), &[Dynamixel1], Options::default());
    assert_eq!(scan, Scan { complete: true, ..Scan::default() });
    let (scan, _) = scanned(&sts_robot(), &[Dynamixel2], Options::default());
    assert_eq!(scan, Scan { complete: true, ..Scan::default() });
}

/// The robot with its second servo set to the ID of the first.
fn with_twins(mut robot: Robot) -> (Robot, u8) {
    let id = robot.joints[0].id;
    robot.joints[1].id = id;
    (robot, id)
}

#[track_caller]
fn assert_one_collision(robot: &Robot, scan: &Scan, id: u8, reason: Reason) {
    let mut others = ids_of(robot);
    others.retain(|&other| other != id);
    assert_eq!(ids(scan), others);
    let [collision] = scan.collisions[..] else { panic!("{:?}", scan.collisions) };
    assert_eq!((collision.id, collision.reason), (id, reason));
}

#[test]
fn twins_whose_pings_are_the_same_are_told_apart_by_their_positions() {
    for (robot, protocol) in [(op3(), Dynamixel2), (sts_robot(), FeetechSts)] {
        let (robot, id) = with_twins(robot);
        let (world, mut bus) = virtual_bus(&robot, Options::default());
        assert!(world.lock().set_register(&robot.joints[1].name, "Present Position", 1234));
        let soon = in_s(&world, 10.0);
        let found = scan(&mut bus, &[protocol], unlike_others, soon).expect("a line");
        assert_one_collision(&robot, &found, id, Reason::Garbled);

        // Nothing else is unlike: with nothing compared they look like one, as is documented.
        let soon = in_s(&world, 10.0);
        let found = scan(&mut bus, &[protocol], nothing, soon).expect("a line");
        assert_eq!(found.collisions, []);
        assert!(ids(&found).contains(&id));
    }
}

#[test]
fn twins_of_two_models_collide_in_their_pings_and_all_others_are_found() {
    let (mut robot, id) = with_twins(op3());
    robot.joints[1].servo = "xl430-w250".to_owned();
    let mut setup = robot.setups[0].clone();
    setup.servo = "xl430-w250".to_owned();
    setup.joints = None;
    setup.registers.retain(|name, _| ["Baud Rate", "Return Delay Time"].contains(&name.as_str()));
    robot.setups.push(setup);
    let (scan, _) = scanned(&robot, &[Dynamixel2], Options::default());
    assert_one_collision(&robot, &scan, id, Reason::Garbled);
}

#[test]
fn twins_that_answer_at_different_times_are_heard_twice_or_garbled() {
    for (protocol, robot) in [(Dynamixel2, op3()), (FeetechSts, sts_robot())] {
        // In counts of 2 us: far enough apart for whole answers, and so close that they overlap.
        for (delay, reason) in [(250, Reason::Twice), (110, Reason::Garbled)] {
            let (robot, id) = with_twins(robot.clone());
            let (world, mut bus) = virtual_bus(&robot, Options::default());
            for (joint, raw) in [(0, 100), (1, delay)] {
                let name = &robot.joints[joint].name;
                assert!(world.lock().set_register(name, "Return Delay Time", raw));
            }
            let soon = in_s(&world, 10.0);
            let found = scan(&mut bus, &[protocol], nothing, soon).expect("a line");
            assert_one_collision(&robot, &found, id, reason);
        }
    }
}

#[test]
fn a_damaged_answer_now_and_then_is_no_collision() {
    let robot = op3();
    let fault = |joint: usize, nth, damage| Fault::Status {
        joint: robot.joints[joint].name.clone(),
        nth,
        damage,
    };
    let faults = vec![
        fault(2, 0, Damage::FlipBit { bit: Some(60) }),
        fault(4, 1, Damage::DropByte { at: Some(3) }),
        fault(6, 2, Damage::FlipBit { bit: Some(80) }),
        fault(8, 1, Damage::Mute),
        fault(10, 3, Damage::Garbage { length: 3 }),
    ];
    let (scan, _) = scanned(&robot, &[Dynamixel2], Options { faults, ..Options::default() });
    assert_eq!((ids(&scan), scan.collisions), (ids_of(&robot), vec![]));
}

#[test]
fn a_servo_whose_answer_was_lost_is_asked_again_and_found() {
    let family = [Dynamixel1, FeetechSts, FeetechScs];
    for (robot, protocols) in
        [(op3(), &[Dynamixel2][..]), (sts_robot(), &[FeetechSts][..]), (sts_robot(), &family[..])]
    {
        let all = ids_of(&robot);
        // The first and the last in the row, and two in the middle, do not say their first word.
        let silent = [all[0], all[7], all[8], all[19]];
        let mute = |joint: &gaitway_profiles::Joint| {
            silent.contains(&joint.id).then(|| Fault::Status {
                joint: joint.name.clone(),
                nth: 0,
                damage: Damage::Mute,
            })
        };
        let faults = robot.joints.iter().filter_map(mute).collect();
        let (scan, took_s) = scanned(&robot, protocols, Options { faults, ..Options::default() });
        assert_eq!((ids(&scan), scan.collisions), (all, vec![]), "{protocols:?}");
        assert!(took_s < 1.0, "{took_s} s");
    }
}

#[test]
fn scraps_in_place_of_an_answer_are_asked_about_at_once() {
    let soon = Duration::from_micros(300);
    let line = ScriptedLine::default();
    // Of a packet of six bytes two arrive, and then all of it; no other ID is near. Sums by the rule.
    line.on("FF FF C8 02 01 34", &[(soon, "02 00")])
        .on("FF FF C8 02 01 34", &[(soon, "FF FF C8 02 00 35")]);
    let mut bus = line.bus();
    let found = scan(&mut bus, &[Dynamixel1], nothing, at_s(10.0)).expect("a line");
    assert_eq!((ids(&found), found.collisions), (vec![200], vec![]));
}

#[test]
fn asking_again_takes_a_quarter_of_a_scan_at_most() {
    // One servo; six in a row; twenty, as far apart as can be.
    let apart = |count: u8, step: u8| {
        let mut robot = sts_robot();
        robot.joints.truncate(count.into());
        for (joint, n) in robot.joints.iter_mut().zip(0..) {
            joint.id = 1 + n * step;
        }
        robot
    };
    for (robot, most) in [(apart(1, 1), 9), (apart(6, 1), 9), (apart(20, 12), 63)] {
        let (world, mut bus) = virtual_bus(&robot, Options::default());
        let family = [Dynamixel1, FeetechSts, FeetechScs];
        let found = scan(&mut bus, &family, nothing, in_s(&world, 10.0)).expect("a line");
        assert_eq!(ids(&found), ids_of(&robot));
        // A ping for each ID, one more and a read for each that is there.
        let plain = 254 + robot.joints.len() as u64;
        let asked = bus.stats().asked;
        assert!((plain..=plain + most).contains(&asked), "{asked} questions, {plain} without");
    }
    // Where nobody answers, only the ID that servos leave the factory with.
    let (world, mut bus) = virtual_bus(&op3(), Options::default());
    let found = scan(&mut bus, &[Dynamixel1], nothing, in_s(&world, 10.0)).expect("a line");
    assert_eq!((found.found.len(), bus.stats().asked), (0, 255));
}

#[test]
fn servos_of_scs_are_all_found_where_only_sts_is_asked_for() {
    // They are deaf to the question to all, and answer that to one.
    let robot = gaitway_profiles::robot("hope-jr-hand").expect("a shipped robot");
    let (all, _) = scanned(&robot, &[FeetechSts], Options::default());
    assert_eq!((ids(&all).len(), ids(&all)), (16, ids_of(&robot)));
    // Nobody is asked one by one where all answer at once.
    let (world, mut bus) = virtual_bus(&sts_robot(), Options::default());
    let found = scan(&mut bus, &[FeetechSts], nothing, in_s(&world, 10.0)).expect("a line");
    assert_eq!(ids(&found), ids_of(&sts_robot()));
    assert!(bus.stats().asked < 100, "{} questions", bus.stats().asked);
}

#[test]
fn a_servo_that_answers_pings_only_is_found() {
    let robot = op3();
    let (world, mut bus) = virtual_bus(&robot, Options::default());
    assert!(world.lock().set_register(&robot.joints[0].name, "Status Return Level", 0));
    let soon = in_s(&world, 10.0);
    let found = scan(&mut bus, &[Dynamixel2], unlike_others, soon).expect("a line");
    assert_eq!((ids(&found), found.collisions), (ids_of(&robot), vec![]));
}

#[test]
fn a_scan_that_nobody_wants_to_go_on_ends_with_what_it_has_found() {
    let (world, mut bus) = virtual_bus(&op3(), Options::default());
    let soon = in_s(&world, 10.0);
    let asked = std::cell::Cell::new(0);
    let goes_on = || asked.replace(asked.get() + 1) < 7;
    let found = scan_while(&mut bus, &[Dynamixel2], unlike_others, soon, &goes_on).expect("a line");
    assert_eq!((ids(&found), found.complete), (ids_of(&op3())[..7].to_vec(), false));
}

#[test]
fn a_scan_out_of_time_says_so() {
    let (world, mut bus) = virtual_bus(&op3(), Options::default());
    let soon = in_s(&world, 0.01);
    let found = scan(&mut bus, &[Dynamixel2], unlike_others, soon).expect("a line");
    assert!(!found.complete && found.found.len() < 20);
}

#[test]
fn devices_that_share_a_packet_come_with_a_reading_in_each_protocol() {
    let soon = Duration::from_micros(500);
    let line = ScriptedLine::default();
    // By hand, sums by the rule: an AX-12A (model 12, firmware 24, ID 1, baud 1) and an SCS0009
    // (firmware 1.2, model 5.4, high byte first: 1284) with ID 2.
    line.on("FF FF 01 02 01 FB", &[(soon, "FF FF 01 02 00 FC")])
        .on("FF FF 01 04 02 00 05 F3", &[(soon, "FF FF 01 07 00 0C 00 18 01 01 D1")])
        .on("FF FF 02 02 01 FA", &[(soon, "FF FF 02 02 00 FB")])
        .on("FF FF 02 04 02 00 05 F2", &[(soon, "FF FF 02 07 00 01 02 01 05 04 E9")]);
    let mut bus = line.bus();
    let family = [Dynamixel1, FeetechSts, FeetechScs];
    let scan = scan(&mut bus, &family, nothing, at_s(10.0)).expect("a line");
    assert_eq!((ids(&scan), &scan.collisions[..]), (vec![1, 2], &[][..]));
    let said = |protocol, model_number, firmware| Reading { protocol, model_number, firmware };
    assert!(scan.found[0].readings.contains(&said(Dynamixel1, 12, 24)));
    assert!(scan.found[1].readings.contains(&said(FeetechScs, 1284, 0x0102)));
    assert!(scan.found.iter().all(|found| found.readings.len() == 3));
    // IDs 0 and 3 to 10 are near those two.
    let asked = line.asked().len();
    assert_eq!(asked, 254 + 2 + 9, "each ID, two devices for their registers, and nine again");
}
