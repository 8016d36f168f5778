//! A robot calibrated by a program instead of a person at a terminal.

mod aloud;
mod desk;
mod priority;
mod program;

use desk::Desk;
use gaitway::calibration::Calibration;
use gaitway::error::Error;
use gaitway::job::calibrate::{
    Answer, CalibrateOrder, Consent, JointTask, Person, Seen, calibrate,
};
use gaitway::job::{Nobody, report::Outcome};

/// Turns a joint of the robot on the desk.
struct Machine<'a> {
    desk: &'a Desk,
    joint: &'a str,
    at_rad: f64,
    told: Vec<Seen>,
    tasks: usize,
    /// Ends after so many tasks.
    most_tasks: usize,
}

impl<'a> Machine<'a> {
    fn at(desk: &'a Desk, joint: &'a str, most_tasks: usize) -> Self {
        let at_rad = desk.world().joint_position_rad(joint).expect("a joint");
        Self { desk, joint, at_rad, told: Vec::new(), tasks: 0, most_tasks }
    }

    fn go(&mut self, to_rad: f64, look: Look<'_>) -> Result<(), Error> {
        while (to_rad - self.at_rad).abs() > 1e-9 {
            self.at_rad += (to_rad - self.at_rad).clamp(-0.05, 0.05);
            self.desk.world().place_joint(self.joint, self.at_rad);
            let seen = look()?;
            self.told.extend(seen);
        }
        Ok(())
    }
}

type Look<'a> = &'a mut dyn FnMut() -> Result<Option<Seen>, Error>;

/// Where the joint's zero is, by the angles of the robot's file, and how far it goes from there.
const ZERO_RAD: f64 = 0.2;
const ENDS_RAD: (f64, f64) = (-0.4, 0.9);

impl Person for Machine<'_> {
    fn ask(&mut self, task: JointTask<'_>, look: Look<'_>) -> Result<Answer<()>, Error> {
        if self.tasks == self.most_tasks {
            return Ok(Answer::Stop);
        }
        self.tasks += 1;
        match task {
            JointTask::Zero { joint, .. } => {
                assert_eq!(joint, self.joint);
                self.go(ZERO_RAD, look)?;
            }
            JointTask::Positive => self.go(ZERO_RAD + 0.3, look)?,
            JointTask::Range => {
                self.go(ZERO_RAD + ENDS_RAD.0, look)?;
                self.go(ZERO_RAD + ENDS_RAD.1, look)?;
            }
        }
        Ok(Answer::Go(()))
    }

    fn tell(&mut self, seen: Seen) {
        self.told.push(seen);
    }

    fn consent(&mut self, _robot: &str) -> Consent {
        Consent::Yes
    }

    fn wants_to_stop(&self) -> bool {
        false
    }
}

fn order(desk: &Desk, joint: &str, folder: &std::path::Path) -> CalibrateOrder {
    CalibrateOrder {
        robot: "so101".to_owned(),
        buses: vec![desk.bus().parse().expect("an address")],
        only: vec![joint.to_owned()],
        calibration: Some(folder.join("so101.toml")),
        ..CalibrateOrder::default()
    }
}

#[test]
fn a_program_that_turns_the_joint_gets_its_zero_direction_and_range() {
    let desk = Desk::with("so101");
    let folder = program::folder("calibrate-job");
    let joint = "elbow_flex";
    let mut machine = Machine::at(&desk, joint, 9);
    let order = order(&desk, joint, &folder);
    let report = calibrate(&order, &mut machine, &Nobody).expect("a calibration");
    assert_eq!(report.outcome, Outcome::Done);
    let [measured] = &report.joints[..] else { panic!("{report:?}") };
    // Both ends are drawn in by 0.02 rad, and a count is 0.0015 rad.
    let ends = (measured.lower_rad.expect("a range"), measured.upper_rad.expect("a range"));
    assert!((ends.0 - ENDS_RAD.0 - 0.02).abs() < 0.004, "{ends:?}");
    assert!((ends.1 - ENDS_RAD.1 + 0.02).abs() < 0.004, "{ends:?}");
    let file = gaitway_profiles::robot("so101").expect("a shipped robot");
    assert_eq!(measured.direction, file.joint(joint).expect("a joint").direction);
    let kept = Calibration::read(&folder.join("so101.toml")).expect("the file");
    assert_eq!(kept.joints.len(), 1);
    assert!(matches!(machine.told[0], Seen::Joint { number: 1, total: 1 }), "{:?}", machine.told);
    // Said whenever the joint has moved, the last with both ends; lines on paper only now and then.
    let ranges = machine.told.iter().filter_map(|seen| match *seen {
        Seen::Range { lower_rad, upper_rad, now_rad, has_grown } => {
            assert!((lower_rad..=upper_rad).contains(&now_rad), "{seen:?}");
            Some((lower_rad, upper_rad, has_grown))
        }
        _ => None,
    });
    let ranges: Vec<_> = ranges.collect();
    let (lower_rad, upper_rad, _) = *ranges.last().expect("a range");
    assert!((lower_rad - ENDS_RAD.0).abs() < 0.004 && (upper_rad - ENDS_RAD.1).abs() < 0.004);
    let grown = ranges.iter().filter(|(.., has_grown)| *has_grown).count();
    assert!(grown > 0 && grown < ranges.len(), "{grown} of {}", ranges.len());
}

#[test]
fn a_program_that_stops_keeps_what_was_measured_for_the_next_time() {
    let desk = Desk::with("so101");
    let folder = program::folder("calibrate-job-stopped");
    let joint = "elbow_flex";
    let mut machine = Machine::at(&desk, joint, 2);
    let report = calibrate(&order(&desk, joint, &folder), &mut machine, &Nobody).expect("a stop");
    assert_eq!(report.outcome, Outcome::Stopped);
    assert!(!report.changed_nothing(), "torque is off");
    assert!(report.calibration.ends_with("so101.toml.partial") && report.calibration.exists());
    assert!(!folder.join("so101.toml").exists(), "half a calibration is none");
    machine.most_tasks = 9;
    let again = CalibrateOrder { resume: true, ..order(&desk, joint, &folder) };
    let report = calibrate(&again, &mut machine, &Nobody).expect("a calibration");
    assert_eq!((report.outcome, report.joints.len()), (Outcome::Done, 1));
}
