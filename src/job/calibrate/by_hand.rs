//! A robot calibrated by hand: torque off, joint by joint, where zero is, which way is positive, how far
//! it goes. What is measured goes into a file; into the servos only with a permit.

use super::homing::Change;
use super::measure::measure;
use super::person::{Answer, Consent, Person, Seen};
use super::{Files, check_models, drives, finish, save, settle};
use crate::calibration::{Calibration, JointCalibration, usual_path};
use crate::control::{Stop, StopCode, StopReason, arm, inject, net};
use crate::error::{Error, ErrorKind};
use crate::job::report::Outcome;
use crate::job::{Event, Observer, source};
use crate::rig::{Address, connect};
use crate::robot::preflight::PATIENT_RETRIES;
use crate::robot::{Link, Robot};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Which robot is calibrated, and how.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CalibrateOrder {
    /// Robot by name, or path of its file.
    pub robot: String,
    /// Where its lines are.
    pub buses: Vec<Address>,
    /// Only these joints; empty: all. Others stay as they were calibrated.
    pub only: Vec<String>,
    /// The file; `None`: the usual one of this robot.
    pub calibration: Option<PathBuf>,
    /// Go on with a calibration that was stopped.
    pub resume: bool,
    /// Zero offsets go into the servos, which keep them at power-off, instead of the file.
    pub permit_eeprom: bool,
    /// Torque may go off without asking: the robot is supported.
    pub supported: bool,
    /// Measure, write nothing.
    pub dry_run: bool,
    /// A robot that is calibrated already is calibrated again.
    pub replace: bool,
}

/// What was measured of one joint.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct JointMeasured {
    /// Its name.
    pub name: String,
    /// +1 if it turns with its servo, -1 if against it.
    pub direction: i8,
    /// Offset that makes its angle zero at its zero, rad.
    pub offset_rad: f64,
    /// Where its servo stood there, rad.
    pub zero_servo_rad: f64,
    /// Lowest angle that was reached, rad; absent: it was hardly moved.
    pub lower_rad: Option<f64>,
    /// Highest angle that was reached, rad.
    pub upper_rad: Option<f64>,
    /// The servo's own offset, raw, where it has one.
    pub homing_offset_raw: Option<i64>,
}

/// What came of it.
#[derive(Clone, Debug, Serialize)]
pub struct CalibrateReport {
    /// Done, or stopped.
    pub outcome: Outcome,
    /// Why it ended before anything changed, if it did.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stop_reason: Option<String>,
    /// The same as data.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stop: Option<Stop>,
    /// The robot's name.
    pub robot: String,
    /// Nothing was written.
    pub dry_run: bool,
    /// Where the calibration is: of one that was stopped, what was measured so far.
    pub calibration: PathBuf,
    /// What was measured.
    pub joints: Vec<JointMeasured>,
    /// How what was written is undone: commands.
    pub undo: Vec<String>,
}

impl CalibrateReport {
    /// True if it was stopped before torque went off: nothing changed.
    #[must_use]
    pub const fn changed_nothing(&self) -> bool {
        self.stop.is_some()
    }
}

/// Leads `person` through the joints.
///
/// # Errors
/// A calibration that is already there, a robot that is not limp, a joint that does not answer.
pub fn calibrate(
    order: &CalibrateOrder,
    person: &mut dyn Person,
    observer: &dyn Observer,
) -> Result<CalibrateReport, Error> {
    let robot = Robot::load(&order.robot)?;
    let joints = selected(&robot, &order.only)?;
    let actuator = joints.iter().find(|&&joint| robot.joints[joint].actuator().is_some());
    if let Some(&joint) = actuator.filter(|_| order.permit_eeprom) {
        return Err(Error::new("a CAN actuator's own zero is not set here")
            .at(format!("joint {}", robot.joints[joint].name))
            .got("--permit-eeprom")
            .remedy("leave it out: the offset goes into the calibration file"));
    }
    let usual = || usual_path(&robot.name);
    not_in_the_real_ones_place(order, &robot)?;
    let file = order.calibration.clone().or_else(usual).ok_or_else(|| {
        Error::new("no place for the calibration").remedy("name one with --calibration FILE.toml")
    })?;
    let files = Files::of(file);
    let mut known = begin(order, &robot, &joints, &files)?;
    let done = measured_before(order, &files)?;
    let mut report = CalibrateReport {
        outcome: Outcome::Done,
        stop_reason: None,
        stop: None,
        robot: robot.name.clone(),
        dry_run: order.dry_run,
        calibration: files.file.clone(),
        joints: Vec::new(),
        undo: Vec::new(),
    };
    let mut connection = connect(robot, &order.buses, 0)?;
    let link = &mut connection.link;
    link.set_retries(PATIENT_RETRIES);
    inject::point("preflight", 0);
    check_models(link, &joints)?;
    if make_limp(link, &joints, order, person)? == Consent::Stop {
        report.outcome = Outcome::Stopped;
        report.stop_reason = Some(StopReason::Asked.to_string());
        report.stop = Some(Stop::of(StopCode::Asked));
        return Ok(report);
    }
    if !order.dry_run {
        save(&files.partial, &known)?;
    }
    let left: Vec<usize> = joints
        .into_iter()
        .filter(|&joint| !done.contains(&link.robot().joints[joint].name))
        .collect();
    let finished = net::catch(|| {
        by_hand(link, &left, order, &files, &mut known, person, &mut report)?;
        if report.outcome == Outcome::Done && !order.dry_run {
            if known.joints.is_empty() {
                return Err(nothing_measured(&files));
            }
            report.undo.push(finish(&files, &known)?);
        }
        Ok(())
    });
    // What was written into servos is said, whatever came after it.
    for line in &report.undo {
        observer.hear(Event::Note(&format!("to undo: {line}")));
    }
    let finished = finished.unwrap_or_else(|words| {
        Err(Error::of(ErrorKind::Broke, "the program broke")
            .got(words)
            .remedy("please report this; --resume goes on"))
    });
    if finished.is_err() && !order.dry_run && files.partial.exists() {
        let place = files.partial.display();
        observer.hear(Event::Note(&format!(
            "what was measured is in {place}; to go on: the same command with --resume"
        )));
    }
    finished?;
    if report.outcome == Outcome::Stopped {
        report.calibration.clone_from(&files.partial);
        if !order.dry_run {
            observer.hear(Event::Note("to go on: the same command with --resume"));
        }
    }
    Ok(report)
}

/// A calibration of no joint would later be taken for one.
fn nothing_measured(files: &Files) -> Error {
    // What was to hold the joints holds none.
    let _ = std::fs::remove_file(&files.partial);
    Error::new("no joint was measured: there is nothing to write")
        .at(files.file.display().to_string())
        .got("all joints skipped")
        .remedy("do it again and go through one joint at least; whatever was there is as it was")
}

/// What is measured on a virtual robot must not be laid over the one on the desk.
fn not_in_the_real_ones_place(order: &CalibrateOrder, robot: &Robot) -> Result<(), Error> {
    let real = order.buses.iter().any(|address| !address.bus.is_virtual());
    if real || order.dry_run || order.calibration.is_some() {
        return Ok(());
    }
    let place = usual_path(&robot.name).map_or_else(String::new, |path| path.display().to_string());
    Err(Error::new("the calibration of a virtual robot would later be taken for the real robot's")
        .at(place)
        .remedy("add --dry-run, or name another file with --calibration FILE.toml"))
}

/// Measures one joint after the other; what is known is saved after each.
fn by_hand(
    link: &mut Link,
    joints: &[usize],
    order: &CalibrateOrder,
    files: &Files,
    known: &mut Calibration,
    person: &mut dyn Person,
    report: &mut CalibrateReport,
) -> Result<(), Error> {
    for (turn, &joint) in joints.iter().enumerate() {
        person.tell(Seen::Joint { number: turn + 1, total: joints.len() });
        match measure(link, joint, person)? {
            Answer::Go(measured) => {
                let (calibrated, change) =
                    settle(link, joint, &measured, order.permit_eeprom, order.dry_run)?;
                report.undo.extend(change.map(|change| undo(link, joint, &change, order)));
                report.joints.push(JointMeasured {
                    name: calibrated.name.clone(),
                    direction: calibrated.direction,
                    offset_rad: calibrated.offset_rad,
                    zero_servo_rad: measured.zero_servo_rad,
                    lower_rad: calibrated.lower_rad,
                    upper_rad: calibrated.upper_rad,
                    homing_offset_raw: calibrated.homing_offset_raw,
                });
                known.put(calibrated);
                if !order.dry_run {
                    save(&files.partial, known)?;
                }
            }
            Answer::Skip => {}
            Answer::Stop => {
                report.outcome = Outcome::Stopped;
                break;
            }
        }
    }
    Ok(())
}

fn selected(robot: &Robot, only: &[String]) -> Result<Vec<usize>, Error> {
    if only.is_empty() {
        return Ok((0..robot.joints.len()).collect());
    }
    source::only(robot, only)
}

/// What is known before the first joint is measured, and is not measured again.
fn begin(
    order: &CalibrateOrder,
    robot: &Robot,
    joints: &[usize],
    files: &Files,
) -> Result<Calibration, Error> {
    let mut known = found(order, robot, files)?;
    if !order.resume {
        let again = |joint: &JointCalibration| {
            joints.iter().any(|&index| robot.joints[index].name == joint.name)
        };
        known.joints.retain(|joint| !again(joint));
    }
    Ok(known)
}

/// What was measured before.
fn found(order: &CalibrateOrder, robot: &Robot, files: &Files) -> Result<Calibration, Error> {
    let own = |path: &Path| -> Result<Calibration, Error> {
        let calibration = Calibration::read(path)?;
        // Laying it over the robot proves that it is this robot's.
        calibration.apply(&mut robot.file.clone())?;
        Ok(calibration)
    };
    if order.resume {
        return own(&files.partial);
    }
    if order.dry_run {
        return Ok(Calibration::of(&robot.name));
    }
    if files.partial.exists() {
        return Err(Error::new("a calibration was begun and not finished")
            .at(files.partial.display().to_string())
            .remedy("add --resume to go on with it, or remove the file"));
    }
    if !files.file.exists() {
        return Ok(Calibration::of(&robot.name));
    }
    if !order.replace {
        return Err(Error::of(ErrorKind::Exists, "the robot is calibrated already")
            .at(files.file.display().to_string())
            .remedy("add --force to do it again; what is there is kept beside it"));
    }
    // With --only, the other joints stay as they were.
    if order.only.is_empty() { Ok(Calibration::of(&robot.name)) } else { own(&files.file) }
}

fn measured_before(order: &CalibrateOrder, files: &Files) -> Result<Vec<String>, Error> {
    if !order.resume {
        return Ok(Vec::new());
    }
    let partial = Calibration::read(&files.partial)?;
    Ok(partial.joints.into_iter().map(|joint| joint.name).collect())
}

/// Joints are moved by hand: torque must be off.
///
/// A wish to stop leaves torque as it is.
fn make_limp(
    link: &mut Link,
    joints: &[usize],
    order: &CalibrateOrder,
    person: &mut dyn Person,
) -> Result<Consent, Error> {
    let mut held = false;
    for &joint in joints {
        // Who does not say so is told to let go, unless nothing is to be written.
        held |= drives(link, joint)?.unwrap_or(!order.dry_run);
    }
    if person.wants_to_stop() {
        return Ok(Consent::Stop);
    }
    if !held {
        return Ok(Consent::Yes);
    }
    let refused = || Error::new("the robot is held; to be calibrated it must be limp");
    if order.dry_run {
        return Err(refused().remedy("support it, then gaitway limp ROBOT --bus BUS"));
    }
    if !order.supported {
        match person.consent(&link.robot().name) {
            Consent::Yes => {}
            Consent::Stop => return Ok(Consent::Stop),
            Consent::No => {
                return Err(refused().remedy("support the robot, then answer yes or add --yes"));
            }
        }
    }
    // It goes on to the last joint, whatever is asked meanwhile: half a limp robot is worse.
    arm::disarm(link).map(|()| Consent::Yes)
}

/// The command that writes the offset again that a servo had before.
fn undo(link: &Link, joint: usize, change: &Change, order: &CalibrateOrder) -> String {
    let of = &link.robot().joints[joint];
    let line = &link.robot().lines[of.line].name;
    let own = order.buses.iter().find(|bus| bus.line.as_ref() == Some(line));
    let bus = own.or(order.buses.first()).map(ToString::to_string).unwrap_or_default();
    format!(
        "gaitway servo set {bus} {} '{}' --raw --permit-eeprom --robot {} -- {}",
        of.id, change.register.name, order.robot, change.old
    )
}
