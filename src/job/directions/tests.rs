//! Arms in virtual time, of which a joint is mounted the wrong way round, and somebody who sees which way they turn.

use super::*;
use crate::job::observer::Nobody;
use crate::rig::mounted_otherwise;
use crate::robot::Robot;
use std::sync::Mutex;

/// SO-101, one joint of it turned round.
fn mounted(turned: Option<&str>) -> Connection {
    let robot = Robot::load("so101").expect("shipped");
    let mut file = robot.file.clone();
    for joint in file.joints.iter_mut().filter(|joint| Some(joint.name.as_str()) == turned) {
        joint.direction = -joint.direction;
        joint.offset_rad = -joint.offset_rad;
    }
    let mounted = Robot::new(file).expect("sound");
    mounted_otherwise(robot, &mounted).expect("virtual")
}

fn order() -> DirectionOrder {
    DirectionOrder {
        robot: "so101".to_owned(),
        buses: vec!["sim".parse().expect("an address")],
        calibration: None,
        joints: Vec::new(),
        by_rad: 0.1,
        accept_firmware: false,
        limp: false,
        save: None,
        dry_run: false,
    }
}

/// Who stands beside the arm: it keeps where each joint is while the arm moves, which is whenever it may be stopped.
struct Onlooker {
    world: crate::port::sim::SharedWorld,
    names: Vec<String>,
    start_rad: Vec<f64>,
    /// How far each was from where it stood.
    farthest_rad: Mutex<Vec<f64>>,
}

impl Onlooker {
    fn beside(connection: &Connection) -> Self {
        let world = connection.world.clone().expect("virtual");
        let names = connection.link.robot().joint_names();
        let place = |name: &String| world.lock().joint_position_rad(name).expect("a joint");
        let start_rad: Vec<f64> = names.iter().map(place).collect();
        let farthest_rad = Mutex::new(vec![0.0; names.len()]);
        Self { world: world.clone(), names, start_rad, farthest_rad }
    }

    fn look(&self) {
        let world = self.world.lock();
        let each = self.names.iter().zip(&self.start_rad);
        for ((name, start_rad), farthest) in
            each.zip(self.farthest_rad.lock().expect("nobody panics").iter_mut())
        {
            let off_rad = world.joint_position_rad(name).expect("a joint") - start_rad;
            if off_rad.abs() > f64::abs(*farthest) {
                *farthest = off_rad;
            }
        }
    }

    /// What it answers; whoever was not asked about must have stood.
    fn answer(&self, found: &DirectionFound) -> DirectionAnswer {
        let farthest = std::mem::replace(
            &mut *self.farthest_rad.lock().expect("nobody panics"),
            vec![0.0; self.names.len()],
        );
        let mut answer = DirectionAnswer::Skip;
        for (name, off_rad) in self.names.iter().zip(farthest) {
            if *name != found.name {
                assert!(off_rad.abs() < 0.01, "{name} moved by {off_rad} rad for {}", found.name);
            } else if off_rad * found.by_rad > 0.0 {
                answer = DirectionAnswer::Right;
            } else if off_rad * found.by_rad < 0.0 {
                answer = DirectionAnswer::Wrong;
            }
        }
        answer
    }
}

impl Observer for Onlooker {
    fn hear(&self, _: Event<'_>) {}

    fn wants_to_stop(&self) -> bool {
        self.look();
        false
    }
}

fn tested(connection: &mut Connection, order: &DirectionOrder) -> DirectionReport {
    let onlooker = Onlooker::beside(connection);
    let mut look = |found: &DirectionFound| onlooker.answer(found);
    on(connection, order, None, &onlooker, &mut look).expect("it moves")
}

fn turns(report: &DirectionReport) -> Vec<(&str, Turns)> {
    report.joints.iter().map(|of| (of.name.as_str(), of.turns)).collect()
}

#[test]
fn a_joint_that_is_mounted_the_wrong_way_round_is_found_and_turned_round_in_the_calibration() {
    let folder = std::env::temp_dir().join(format!("gaitway-directions-{}", std::process::id()));
    let save = folder.join("so101.toml");
    let mut connection = mounted(Some("elbow_flex"));
    let order = DirectionOrder { save: Some(save.clone()), limp: true, ..order() };
    let report = tested(&mut connection, &order);
    for (name, turns) in turns(&report) {
        let expected = if name == "elbow_flex" { Turns::Wrong } else { Turns::Right };
        assert_eq!(turns, expected, "{name}");
    }
    assert_eq!((report.outcome, report.joints.len()), (Outcome::DoneWithLoss, 6));
    let world = connection.world.clone().expect("virtual");
    assert!(world.lock().verdict().violations.is_empty());
    for joint in connection.link.robot().joint_names() {
        assert_eq!(world.lock().read_register(&joint, "Torque Enable").expect("a register"), 0);
    }
    // With the calibration that was written the same arm turns as its file says.
    let calibration = Calibration::read(&save).expect("written");
    assert_eq!(calibration.joints.len(), 1, "{calibration:?}");
    let robot = Robot::load("so101").expect("shipped");
    let mut file = robot.file.clone();
    let flipped = file.joints.iter_mut().find(|joint| joint.name == "elbow_flex").expect("it");
    flipped.direction = -flipped.direction;
    flipped.offset_rad = -flipped.offset_rad;
    let calibrated = robot.with_calibration(&calibration).expect("its own");
    let mut connection =
        mounted_otherwise(calibrated, &Robot::new(file).expect("sound")).expect("virtual");
    let again = tested(&mut connection, &DirectionOrder { save: None, ..order });
    assert_eq!(again.outcome, Outcome::Done, "{:?}", turns(&again));
    let _ = std::fs::remove_dir_all(folder);
}

#[test]
fn one_that_is_mounted_as_its_file_says_is_well_and_comes_back_to_where_it_stood() {
    let mut connection = mounted(None);
    let report = tested(&mut connection, &order());
    assert_eq!(report.outcome, Outcome::Done, "{:?}", turns(&report));
    let world = connection.world.clone().expect("virtual");
    for found in &report.joints {
        let now_rad = world.lock().joint_position_rad(&found.name).expect("a joint");
        assert!((now_rad - found.start_rad).abs() < 0.01, "{}: {now_rad}", found.name);
        assert!((found.moved_rad.expect("moved") - found.by_rad).abs() < 0.03, "{found:?}");
    }
}

#[test]
fn a_dry_run_says_what_would_move_and_writes_nothing() {
    let mut connection = mounted(None);
    let world = connection.world.clone().expect("virtual");
    world.lock().keep_journal(true);
    let report = tested(&mut connection, &DirectionOrder { dry_run: true, ..order() });
    assert_eq!((report.outcome, report.joints.len()), (Outcome::Done, 6));
    assert!(report.joints.iter().all(|of| of.moved_rad.is_none() && of.by_rad != 0.0));
    let world = world.lock();
    let written = world.journal().since(0).filter(|entry| match &entry.what {
        gaitway_sim::Happening::Asked(asked) => asked.instruction().contains("write"),
        _ => false,
    });
    assert_eq!(written.count(), 0);
    assert!(report.text().contains("would turn by +5.7 deg"), "{}", report.text());
}

#[test]
fn a_joint_that_is_stuck_does_not_move_and_one_at_the_end_of_its_range_goes_the_other_way() {
    let mut connection = mounted(None);
    let upper_rad = connection.link.robot().joints[5].limits.upper_rad();
    {
        let world = connection.world.clone().expect("virtual");
        let mut world = world.lock();
        let joint = "wrist_flex".to_owned();
        let stuck = gaitway_sim::Fault::StuckPosition { joint, from_ns: 0, until_ns: u64::MAX };
        world.begin(&[stuck]).expect("a fault");
        world.place_joint("gripper", upper_rad - 0.02);
    }
    let joints = vec!["wrist_flex".to_owned(), "gripper".to_owned()];
    let report = tested(&mut connection, &DirectionOrder { joints, ..order() });
    let [wrist, gripper] = report.joints.as_slice() else { panic!("{report:?}") };
    assert_eq!(wrist.turns, Turns::DoesNotMove);
    assert!(gripper.by_rad < 0.0 && gripper.turns == Turns::Right, "{gripper:?}");
    assert!(report.text().contains("does not move"), "{}", report.text());
}

/// Pulls a servo out when it has moved, or when the joint before it was looked at.
struct Puller<'a> {
    onlooker: Onlooker,
    servo: &'a str,
    moved_rad: f64,
}

impl Observer for Puller<'_> {
    fn hear(&self, _: Event<'_>) {}

    fn wants_to_stop(&self) -> bool {
        self.onlooker.look();
        let index = self.onlooker.names.iter().position(|name| name == self.servo);
        let farthest = self.onlooker.farthest_rad.lock().expect("nobody panics");
        if farthest[index.expect("a joint")].abs() > self.moved_rad {
            self.onlooker.world.lock().unplug(self.servo).expect("a servo");
        }
        false
    }
}

#[test]
fn a_servo_that_vanishes_ends_it_at_rest_and_what_was_found_before_is_told() {
    // In the middle of its own way, and between two joints.
    for (moved_rad, before) in [(0.05, 1), (f64::INFINITY, 1)] {
        let mut connection = mounted(None);
        let world = connection.world.clone().expect("virtual");
        let onlooker = Onlooker::beside(&connection);
        let puller = Puller { onlooker, servo: "shoulder_lift", moved_rad };
        let mut look = |found: &DirectionFound| {
            if moved_rad.is_infinite() {
                world.lock().unplug("shoulder_lift").expect("a servo");
            }
            puller.onlooker.answer(found)
        };
        let report = on(&mut connection, &order(), None, &puller, &mut look).expect("a report");
        assert!(matches!(report.outcome, Outcome::Failed | Outcome::Stopped), "{report:?}");
        assert_eq!(report.joints.len(), before, "{report:?}");
        assert_eq!(report.joints[0].turns, Turns::Right);
        let reason = report.stop_reason.as_deref().unwrap_or_default();
        assert!(reason.contains("shoulder_lift"), "{reason}");
        assert!(report.text().contains("shoulder_lift"), "{}", report.text());
        let world = world.lock();
        let others = |of: &&gaitway_sim::Violation| of.joint.as_deref() != Some("shoulder_lift");
        assert_eq!(world.verdict().violations.iter().find(others), None);
        for name in
            connection.link.robot().joint_names().iter().filter(|of| **of != "shoulder_lift")
        {
            let speed = world.joint_velocity_rad_s(name).expect("a joint");
            assert!(speed.abs() < 0.01, "{name}: {speed} rad/s");
        }
    }
}

/// A host that stands still once, when it looks for the so manieth time whether somebody wants to stop.
struct Stall {
    onlooker: Onlooker,
    at: usize,
    lasts_ns: u64,
    looks: Mutex<usize>,
}

impl Observer for Stall {
    fn hear(&self, _: Event<'_>) {}

    fn wants_to_stop(&self) -> bool {
        self.onlooker.look();
        let mut looks = self.looks.lock().expect("nobody panics");
        *looks += 1;
        if *looks == self.at {
            let mut world = self.onlooker.world.lock();
            let until_ns = world.now_ns() + self.lasts_ns;
            world.run_until(until_ns);
        }
        false
    }
}

#[test]
fn a_host_that_stands_still_at_any_step_leaves_every_joint_at_rest_and_is_told() {
    let (mut stopped, mut told) = (0, 0);
    for at in (1..150).step_by(7) {
        for lasts_ns in [30_000_000, 400_000_000] {
            let mut connection = mounted(None);
            let onlooker = Onlooker::beside(&connection);
            let stall = Stall { onlooker, at, lasts_ns, looks: Mutex::new(0) };
            let joints = vec!["shoulder_pan".to_owned()];
            let order = DirectionOrder { joints, ..order() };
            let mut look = |found: &DirectionFound| stall.onlooker.answer(found);
            let report = on(&mut connection, &order, None, &stall, &mut look).expect("a report");
            assert!(*stall.looks.lock().expect("nobody panics") >= at, "it looked {at} times");
            if report.outcome != Outcome::Done {
                stopped += 1;
                let reason = report.stop_reason.as_deref().unwrap_or_default();
                told += usize::from(reason.contains("host"));
            }
            let world = connection.world.clone().expect("virtual");
            let mut world = world.lock();
            let after_ns = world.now_ns() + 1_000_000_000;
            world.run_until(after_ns);
            for name in connection.link.robot().joint_names() {
                let speed = world.joint_velocity_rad_s(&name).expect("a joint");
                assert!(speed.abs() < 0.01, "{at}, {lasts_ns} ns: {name} at {speed} rad/s");
            }
        }
    }
    assert!(stopped > 5 && told == stopped, "{stopped} stopped, {told} named the host");
}

#[test]
fn somebody_who_has_seen_enough_is_heard_and_distances_are_bounded() {
    let mut connection = mounted(None);
    let mut asked = Vec::new();
    let mut look = |found: &DirectionFound| {
        asked.push(found.name.clone());
        match asked.len() {
            1 => DirectionAnswer::Again,
            2 => DirectionAnswer::Right,
            _ => DirectionAnswer::Stop,
        }
    };
    let report = on(&mut connection, &order(), None, &Nobody, &mut look).expect("it moves");
    assert_eq!(asked, ["shoulder_pan", "shoulder_pan", "shoulder_lift"]);
    assert_eq!(report.outcome, Outcome::Stopped);
    for by_rad in [0.0, 0.5, f64::NAN] {
        let far = DirectionOrder { by_rad, ..order() };
        let refused = directions(&far, &Nobody, &mut |_| DirectionAnswer::Right);
        assert!(refused.expect_err("too far").to_string().contains("1 to 20 deg"));
    }
    let nobody = DirectionOrder { joints: vec!["nose".to_owned()], ..order() };
    let refused = directions(&nobody, &Nobody, &mut |_| DirectionAnswer::Right);
    assert!(refused.expect_err("no joint").to_string().contains("shoulder_pan"));
    assert_eq!(answered(" Y\n"), Some(DirectionAnswer::Right));
    assert_eq!(answered("perhaps"), None);
}
