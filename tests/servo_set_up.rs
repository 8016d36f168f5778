//! A whole arm's servos set up one after the other as they come out of their boxes, behind a pseudo-terminal. Time is real here; none of
//! it is judged.

use gaitway::job::observer::Nobody;
use gaitway::job::report::Outcome;
use gaitway::job::servo::set_up::{
    SetUpAnswer, SetUpOrder, SetUpReport, SetUpState, SetUpTask, set_up,
};
use gaitway_sim::{BenchServos, Door, Options, World, bench};
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

const JOINTS: [&str; 6] =
    ["gripper", "wrist_roll", "wrist_flex", "elbow_flex", "shoulder_lift", "shoulder_pan"];

/// Six servos as they leave the factory, none of them plugged in.
struct Boxes(Arc<Mutex<World>>, Door);

impl Boxes {
    fn new() -> Self {
        let servos: BenchServos = "sts3215:1-6".parse().expect("servos");
        let mut world =
            World::new(&bench(&[servos], None).expect("a bench"), Options::default()).expect("it");
        for n in 1..=6 {
            let servo = format!("joint_{n}");
            world.preset(&servo, "ID", 1).expect("a register");
            // Nobody has turned two of them to the same place: so they are told apart although both have ID 1.
            world.place_joint(&servo, 0.2 * f64::from(n));
            world.unplug(&servo).expect("a servo");
        }
        // One has been used before, at 115,200 bit/s.
        world.preset("joint_3", "Baud Rate", 4).expect("a register");
        let world = Arc::new(Mutex::new(world));
        let door = Door::open(Arc::clone(&world), 0, None).expect("a door");
        Self(world, door)
    }

    fn world(&self) -> MutexGuard<'_, World> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn order(&self) -> SetUpOrder {
        let path: &Path = self.1.path();
        SetUpOrder {
            bus: format!("serial:{}", path.display()).parse().expect("an address"),
            robot: "so101".to_owned(),
            joints: Vec::new(),
            permit_eeprom: true,
            dry_run: false,
        }
    }

    fn register(&self, n: usize, name: &str) -> i64 {
        self.world().read_register(&format!("joint_{n}"), name).expect("a register")
    }

    /// All registers but those that are set up and those that are measured.
    fn kept(&self, n: usize) -> Vec<(String, i64)> {
        let all = self.world().registers(&format!("joint_{n}")).expect("a servo");
        let is_set_up =
            |name: &str| ["ID", "Baud Rate", "Lock"].contains(&name) || name.starts_with("Present");
        all.into_iter().filter(|(name, _)| !is_set_up(name)).collect()
    }
}

fn run(
    order: &SetUpOrder,
    mut ask: impl FnMut(SetUpTask<'_>) -> SetUpAnswer,
) -> Result<SetUpReport, gaitway::error::Error> {
    let mut asked = 0;
    let mut ask = |task: SetUpTask<'_>| {
        asked += 1;
        assert!(asked < 20, "{} again and again: {:?}", task.joint, task.wrong);
        ask(task)
    };
    set_up(order, &Nobody, &mut ask)
}

fn states(report: &SetUpReport) -> Vec<(&str, SetUpState)> {
    report.joints.iter().map(|joint| (joint.name.as_str(), joint.state)).collect()
}

#[test]
fn an_arm_is_set_up_servo_by_servo_goes_on_after_a_break_and_nothing_else_is_written() {
    let boxes = Boxes::new();
    let order = boxes.order();
    let before: Vec<_> = (1..=6).map(|n| boxes.kept(n)).collect();
    let plug = |n: usize| boxes.world().plug(&format!("joint_{n}")).expect("a servo");
    let mut wrongs = Vec::new();
    let mut plugged = 0;
    // Two from one box at once, then one of them, then a second; somebody rings at the door.
    let first = run(&order, |task| {
        wrongs.extend(task.wrong.map(ToString::to_string));
        match (task.joint, task.wrong.is_some()) {
            ("gripper", false) => {
                plug(1);
                plug(2);
            }
            ("gripper", true) => boxes.world().unplug("joint_2").expect("a servo"),
            ("wrist_roll", _) => plug(2),
            _ => return SetUpAnswer::Stop,
        }
        SetUpAnswer::Go
    })
    .expect("set up");
    assert_eq!(first.outcome, Outcome::Stopped);
    assert_eq!(states(&first), [("gripper", SetUpState::Done), ("wrist_roll", SetUpState::Done)]);
    assert!(wrongs.iter().any(|wrong| wrong.contains("two servos answer at once")), "{wrongs:?}");
    // Later, with those two plugged in.
    let second = run(&order, |task| {
        assert!(!["gripper", "wrist_roll"].contains(&task.joint), "{} again", task.joint);
        plugged += 1;
        plug(plugged + 2);
        SetUpAnswer::Go
    })
    .expect("set up");
    assert_eq!(second.outcome, Outcome::Done, "{:?}", states(&second));
    let names: Vec<&str> = second.joints.iter().map(|joint| joint.name.as_str()).collect();
    assert_eq!(names, JOINTS);
    assert_eq!(second.joints[0].state, SetUpState::WasDone);
    // Past the line: who has which ID now, at which speed.
    for n in 1..=6 {
        assert_eq!(boxes.register(n, "ID"), 7 - n as i64, "servo {n}");
        assert_eq!(boxes.register(n, "Baud Rate"), 0, "1,000,000 bit/s, servo {n}");
        assert_eq!(boxes.register(n, "Lock"), 1, "servo {n}");
        assert_eq!(boxes.kept(n), before[n - 1], "servo {n}");
    }
    let slow = &second.joints[2];
    assert_eq!((slow.id_before, slow.baud_bps_before), (Some(1), Some(115_200)), "{slow:?}");
    assert_eq!(slow.undo.len(), 2, "{slow:?}");
    // Once more, all there: nothing to do but for the one whose ID a newcomer could have.
    let third = run(&order, |task| {
        assert_eq!(task.joint, "shoulder_pan");
        SetUpAnswer::Go
    })
    .expect("set up");
    assert!(
        third.joints.iter().all(|joint| joint.state == SetUpState::WasDone),
        "{:?}",
        states(&third)
    );
}

#[test]
fn a_servo_that_is_pulled_out_while_it_is_set_up_is_asked_for_again_and_those_before_stay_done() {
    let boxes = Boxes::new();
    let world = Arc::clone(&boxes.0);
    let plug = |n: usize| boxes.world().plug(&format!("joint_{n}")).expect("a servo");
    // It is unlocked to be written, and gone.
    let puller = std::thread::spawn(move || {
        loop {
            let mut world = world.lock().unwrap_or_else(PoisonError::into_inner);
            if world.read_register("joint_2", "Lock").ok() == Some(0) {
                return world.unplug("joint_2").expect("a servo");
            }
            drop(world);
            std::thread::sleep(std::time::Duration::from_micros(50));
        }
    });
    let mut wrongs = Vec::new();
    let report = run(&boxes.order(), |task| {
        wrongs.extend(task.wrong.map(ToString::to_string));
        match (task.joint, task.wrong.is_some()) {
            ("gripper", _) => plug(1),
            ("wrist_roll", _) => plug(2),
            _ => return SetUpAnswer::Stop,
        }
        SetUpAnswer::Go
    })
    .expect("what was done");
    puller.join().expect("it was pulled out");
    assert_eq!(states(&report)[0], ("gripper", SetUpState::Done), "{wrongs:?}");
    assert_eq!(report.joints.len(), 2, "{wrongs:?}");
    assert!(wrongs.iter().any(|wrong| wrong.contains("plug it in again")), "{wrongs:?}");
    assert_eq!((boxes.register(1, "ID"), boxes.register(2, "ID")), (6, 5));
    assert_eq!(boxes.register(2, "Lock"), 1, "locked again");
}

#[test]
fn nothing_is_written_without_a_permit_nor_in_a_dry_run_and_other_models_are_named() {
    let boxes = Boxes::new();
    let order = boxes.order();
    let refused = run(&SetUpOrder { permit_eeprom: false, ..order.clone() }, |_| SetUpAnswer::Go);
    assert!(refused.expect_err("no permit").to_string().contains("--permit-eeprom"));
    boxes.world().plug("joint_1").expect("a servo");
    let dry = SetUpOrder {
        permit_eeprom: false,
        dry_run: true,
        joints: vec!["gripper".to_owned()],
        ..order.clone()
    };
    let report = run(&dry, |_| SetUpAnswer::Go).expect("looked at");
    assert_eq!(states(&report), [("gripper", SetUpState::WouldBeDone)]);
    assert_eq!(boxes.register(1, "ID"), 1);
    // An STS3250 says 2825 (FEETECH's list of models), an STS3215 777.
    boxes.world().preset("joint_1", "Model Number", 2825).expect("a register");
    let mut wrong = None;
    let report = run(&dry, |task| {
        wrong = task.wrong.map(ToString::to_string);
        if wrong.is_some() { SetUpAnswer::Skip } else { SetUpAnswer::Go }
    })
    .expect("looked at");
    let wrong = wrong.expect("it is said");
    assert!(wrong.contains("2825") && wrong.contains("777"), "{wrong}");
    assert_eq!(
        (report.outcome, states(&report)),
        (Outcome::DoneWithLoss, vec![("gripper", SetUpState::Skipped)])
    );
    let nobody = SetUpOrder { joints: vec!["nose".to_owned()], ..order };
    let refused = run(&nobody, |_| SetUpAnswer::Go).expect_err("no such joint");
    assert!(refused.to_string().contains("shoulder_pan"), "{refused}");
}
