//! `calibrate`: torque off, by hand, joint by joint: where zero is, which way is positive, how far
//! it goes. What is measured goes into a file; into the servos only with a permit.

use super::signals::Signals;
use super::{Deed, Outcome, Output, Remarks, limp};
use crate::calibration::{Calibration, JointCalibration, usual_path};
use crate::control::{Stop, StopCode, StopReason, arm, inject, net};
use crate::error::{Error, ErrorKind};
use crate::job::calibrate::homing::Change;
use crate::job::calibrate::reading::Measured;
use crate::job::calibrate::{Files, check_models, drives, finish, save, settle};
use crate::job::source;
use crate::rig::Address;
use crate::rig::connect;
use crate::robot::preflight::PATIENT_RETRIES;
use crate::robot::{Link, Robot};
use answers::{Answer, Answered, Answers};
use clap::Args;
use measure::measure;
use serde_json::{Value, json};
use std::fmt::Write;
use std::path::{Path, PathBuf};

mod answers;
mod measure;

/// Arguments of `calibrate`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    gaitway calibrate so101 --bus serial:/dev/ttyACM0\n  \
    gaitway calibrate op3 --bus serial:/dev/ttyUSB0 --only head_pan,head_tilt --force\n\n\
    Answers come from standard input, one line each: Enter goes on, s skips a joint, q stops; \
    --resume goes on later.")]
pub struct CalibrateArgs {
    /// Robot by name or path of its file
    robot: String,
    /// Where the robot is: sim, sim:pty, serial:PATH[?baud=N], tcp:HOST:PORT; LINE=BUS for each line
    /// of a robot with several
    #[arg(long, value_name = "BUS", required = true)]
    bus: Vec<Address>,
    /// Only these joints, separated by commas; others stay as they were calibrated
    #[arg(long, value_name = "JOINTS", value_delimiter = ',')]
    only: Vec<String>,
    /// Write this file [default: gaitway/calibration/ROBOT.toml in $XDG_CONFIG_HOME]
    #[arg(long, value_name = "FILE.toml")]
    calibration: Option<PathBuf>,
    /// Go on with a calibration that was stopped
    #[arg(long)]
    resume: bool,
    /// Write zero offsets into the servos (kept at power-off) instead of the file
    #[arg(long)]
    permit_eeprom: bool,
    /// Torque may go off without asking: the robot is supported
    #[arg(long)]
    yes: bool,
    /// Measure and report, write nothing
    #[arg(long)]
    dry_run: bool,
    #[command(flatten)]
    output: Output,
}

/// Runs `calibrate`; exit code 4 if it was stopped.
///
/// # Errors
/// A calibration that is already there, a robot that is not limp, a joint that does not answer.
pub fn run(args: &CalibrateArgs, remarks: Remarks) -> Result<i32, Error> {
    args.output.check_files(&[])?;
    let signals = Signals::listen().map_err(|e| Error::new(format!("no signals: {e}")))?;
    let robot = Robot::load(&args.robot)?;
    let joints = selected(&robot, &args.only)?;
    let actuator = joints.iter().find(|&&joint| robot.joints[joint].actuator().is_some());
    if let Some(&joint) = actuator.filter(|_| args.permit_eeprom) {
        return Err(Error::new("a CAN actuator's own zero is not set here")
            .at(format!("joint {}", robot.joints[joint].name))
            .got("--permit-eeprom")
            .remedy("leave it out: the offset goes into the calibration file"));
    }
    let usual = || usual_path(&robot.name);
    not_in_the_real_ones_place(args, &robot)?;
    let file = args.calibration.clone().or_else(usual).ok_or_else(|| {
        Error::new("no place for the calibration").remedy("name one with --calibration FILE.toml")
    })?;
    let files = Files::of(file);
    let mut known = begin(args, &robot, &joints, &files)?;
    let done = measured_before(args, &files)?;
    let name = robot.name.clone();
    let mut connection = connect(robot, &args.bus, 0)?;
    let link = &mut connection.link;
    link.set_retries(PATIENT_RETRIES);
    inject::point("preflight", 0);
    check_models(link, &joints)?;
    let mut answers = Answers::listen(signals.clone())?;
    if make_limp(link, &joints, args, &mut answers)? == Answered::Stop {
        return Ok(stopped_before(args, &name, signals.first()));
    }
    if !args.dry_run {
        save(&files.partial, &known)?;
    }
    let left: Vec<usize> = joints
        .into_iter()
        .filter(|&joint| !done.contains(&link.robot().joints[joint].name))
        .collect();
    let mut done = ByHand::default();
    let finished = net::catch(|| {
        by_hand(link, &left, args, &files, &mut known, &mut answers, &mut done)?;
        if !done.stopped && !args.dry_run {
            done.undo.push(finish(&files, &known)?);
        }
        Ok(())
    });
    let ByHand { reports, undo, stopped } = done;
    // What was written into servos is said, whatever came after it.
    undo.iter().for_each(|line| remarks.say(&format!("to undo: {line}")));
    finished.unwrap_or_else(|words| {
        Err(Error::of(ErrorKind::Broke, "the program broke")
            .got(words)
            .remedy("please report this; --resume goes on"))
    })?;
    if stopped && !args.dry_run {
        remarks.say("to go on: the same command with --resume");
    }
    let report = json!({
        "outcome": if stopped { "stopped" } else { "done" },
        "robot": name, "dry_run": args.dry_run,
        "calibration": if stopped { &files.partial } else { &files.file },
        "joints": reports, "undo": undo,
    });
    let code = match (stopped, signals.first()) {
        (true, Some(number)) => 128 + number,
        (true, None) => Outcome::Stopped.exit_code(),
        (false, _) => 0,
    };
    Ok(args.output.conclude(&report, &text(&report), Deed::Work, code))
}

/// Says that a wish to stop came before torque went off.
fn stopped_before(args: &CalibrateArgs, robot: &str, signal: Option<i32>) -> i32 {
    let report = json!({
        "outcome": Outcome::Stopped, "stop_reason": StopReason::Asked.to_string(),
        "stop": Stop::of(StopCode::Asked), "robot": robot, "dry_run": args.dry_run,
    });
    let text = "stopped before anything changed: torque is as it was\n";
    let code = signal.map_or(Outcome::Stopped.exit_code(), |number| 128 + number);
    args.output.conclude(&report, text, Deed::Look, code)
}

/// What is measured on a virtual robot must not be laid over the one on the desk.
fn not_in_the_real_ones_place(args: &CalibrateArgs, robot: &Robot) -> Result<(), Error> {
    let real = args.bus.iter().any(|address| !address.bus.is_virtual());
    if real || args.dry_run || args.calibration.is_some() {
        return Ok(());
    }
    let place = usual_path(&robot.name).map_or_else(String::new, |path| path.display().to_string());
    Err(Error::new("the calibration of a virtual robot would later be taken for the real robot's")
        .at(place)
        .remedy("add --dry-run, or name another file with --calibration FILE.toml"))
}

/// What came of the joints that were asked for.
#[derive(Default)]
struct ByHand {
    reports: Vec<Value>,
    undo: Vec<String>,
    stopped: bool,
}

/// Measures one joint after the other; what is known is saved after each.
fn by_hand(
    link: &mut Link,
    joints: &[usize],
    args: &CalibrateArgs,
    files: &Files,
    known: &mut Calibration,
    answers: &mut Answers,
    done: &mut ByHand,
) -> Result<(), Error> {
    for (turn, &joint) in joints.iter().enumerate() {
        super::say(&format!("[{}/{}]", turn + 1, joints.len()));
        match measure(link, joint, answers)? {
            Answer::Go(measured) => {
                let (calibrated, change) =
                    settle(link, joint, &measured, args.permit_eeprom, args.dry_run)?;
                done.undo.extend(change.map(|change| undo(link, joint, &change, args)));
                done.reports.push(described(&calibrated, &measured));
                known.put(calibrated);
                if !args.dry_run {
                    save(&files.partial, known)?;
                }
            }
            Answer::Skip => {}
            Answer::Stop => {
                done.stopped = true;
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
    args: &CalibrateArgs,
    robot: &Robot,
    joints: &[usize],
    files: &Files,
) -> Result<Calibration, Error> {
    let mut known = found(args, robot, files)?;
    if !args.resume {
        let again = |joint: &JointCalibration| {
            joints.iter().any(|&index| robot.joints[index].name == joint.name)
        };
        known.joints.retain(|joint| !again(joint));
    }
    Ok(known)
}

/// What was measured before.
fn found(args: &CalibrateArgs, robot: &Robot, files: &Files) -> Result<Calibration, Error> {
    let own = |path: &Path| -> Result<Calibration, Error> {
        let calibration = Calibration::read(path)?;
        // Laying it over the robot proves that it is this robot's.
        calibration.apply(&mut robot.file.clone())?;
        Ok(calibration)
    };
    if args.resume {
        return own(&files.partial);
    }
    if args.dry_run {
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
    if !args.output.force() {
        return Err(Error::of(ErrorKind::Exists, "the robot is calibrated already")
            .at(files.file.display().to_string())
            .remedy("add --force to do it again; what is there is kept beside it"));
    }
    // With --only, the other joints stay as they were.
    if args.only.is_empty() { Ok(Calibration::of(&robot.name)) } else { own(&files.file) }
}

fn measured_before(args: &CalibrateArgs, files: &Files) -> Result<Vec<String>, Error> {
    if !args.resume {
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
    args: &CalibrateArgs,
    answers: &mut Answers,
) -> Result<Answered, Error> {
    let mut held = false;
    for &joint in joints {
        // Who does not say so is told to let go, unless nothing is to be written.
        held |= drives(link, joint)?.unwrap_or(!args.dry_run);
    }
    if answers.are_to_end() {
        return Ok(Answered::Stop);
    }
    if !held {
        return Ok(Answered::Yes);
    }
    let refused = || Error::new("the robot is held; to be calibrated it must be limp");
    if args.dry_run {
        return Err(refused().remedy("support it, then gaitway limp ROBOT --bus BUS"));
    }
    if !args.yes {
        let question = limp::question(&link.robot().name);
        match answers.consent(&question) {
            Answered::Yes => {}
            Answered::Stop => return Ok(Answered::Stop),
            Answered::No => {
                return Err(refused().remedy("support the robot, then answer yes or add --yes"));
            }
        }
    }
    // It goes on to the last joint, whatever is asked meanwhile: half a limp robot is worse.
    arm::disarm(link).map(|()| Answered::Yes)
}

/// The command that writes the offset again that a servo had before.
fn undo(link: &Link, joint: usize, change: &Change, args: &CalibrateArgs) -> String {
    let of = &link.robot().joints[joint];
    let line = &link.robot().lines[of.line].name;
    let own = args.bus.iter().find(|bus| bus.line.as_ref() == Some(line));
    let bus = own.or(args.bus.first()).map(ToString::to_string).unwrap_or_default();
    format!(
        "gaitway servo set {bus} {} '{}' --raw --permit-eeprom --robot {} -- {}",
        of.id, change.register.name, args.robot, change.old
    )
}

fn described(calibrated: &JointCalibration, measured: &Measured) -> Value {
    json!({
        "name": calibrated.name, "direction": calibrated.direction,
        "offset_rad": calibrated.offset_rad, "zero_servo_rad": measured.zero_servo_rad,
        "lower_rad": calibrated.lower_rad, "upper_rad": calibrated.upper_rad,
        "homing_offset_raw": calibrated.homing_offset_raw,
    })
}

fn text(report: &Value) -> String {
    let degrees = |value: &Value| {
        value.as_f64().map_or_else(|| "-".to_owned(), |rad| format!("{:.1}", rad.to_degrees()))
    };
    let mut out =
        format!("{:<18} {:>9} {:>12} {:>18}\n", "joint", "direction", "offset, deg", "range, deg");
    for joint in report["joints"].as_array().into_iter().flatten() {
        let range = format!("{} to {}", degrees(&joint["lower_rad"]), degrees(&joint["upper_rad"]));
        let _ = writeln!(
            out,
            "{:<18} {:>9} {:>12} {range:>18}",
            joint["name"].as_str().unwrap_or_default(),
            joint["direction"],
            degrees(&joint["offset_rad"]),
        );
    }
    let place = report["calibration"].as_str().unwrap_or_default();
    let _ = match (report["dry_run"].as_bool(), report["outcome"].as_str()) {
        (Some(true), _) => writeln!(out, "nothing was written; it would go to {place}"),
        (_, Some("stopped")) => writeln!(out, "stopped; what was measured is in {place}"),
        _ => writeln!(out, "written to {place}"),
    };
    out
}
