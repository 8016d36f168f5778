//! `hold`: torque on where the robot stands. Nothing moves.

use super::calibrated::CalibrationArg;
use super::signals::Signals;
use super::{Deed, Outcome, Output, Remarks};
use crate::control::left::leave;
use crate::control::{Arming, Stop, StopCode, StopReason, arm_safely, inject, net};
use crate::error::{Error, ErrorKind};
use crate::rig::Address;
use crate::rig::connect;
use crate::robot::preflight::{Accept, budget, exchange_error, preflight};
use crate::time::Duration;
use clap::Args;
use serde_json::json;
use std::fmt::Write;

/// Arguments of `hold`.
#[derive(Debug, Args)]
#[command(after_help = "Example: gaitway hold op3 --bus serial:/dev/ttyUSB0\n\
    gaitway limp lets go again.")]
pub struct HoldArgs {
    /// Robot by name or path of its file
    robot: String,
    /// Where the robot is: sim, sim:pty, serial:PATH[?baud=N], tcp:HOST:PORT, can:INTERFACE; LINE=BUS
    /// for each line of a robot with several
    #[arg(long, value_name = "BUS", required = true)]
    bus: Vec<Address>,
    /// Hold servos whose firmware the profile was not checked against
    #[arg(long)]
    accept_firmware: bool,
    /// Check everything, write nothing
    #[arg(long)]
    dry_run: bool,
    #[command(flatten)]
    calibration: CalibrationArg,
    #[command(flatten)]
    output: Output,
}

/// Runs `hold`.
///
/// # Errors
/// Anything preflight or arming has against it; torque is off then, or the joints are named.
pub fn run(args: &HoldArgs, remarks: Remarks) -> Result<i32, Error> {
    args.output.check_files(&[])?;
    let signals = Signals::listen().map_err(|e| Error::new(format!("no signals: {e}")))?;
    let (robot, calibration) = args.calibration.load(&args.robot, &args.bus)?;
    let period = Duration::from_secs_f64(1.0 / robot.file.rate_hz);
    let mut connection = connect(robot, &args.bus, 0)?;
    let link = &mut connection.link;
    inject::point("preflight", 0);
    let accept = Accept { firmware: args.accept_firmware, eeprom: false };
    let found = preflight(link, period, accept)?;
    let mut notes = found.notes.clone();
    let mut left = None;
    if !args.dry_run {
        let armed = match arm_safely(link, &found, &|| signals.first().is_some())? {
            Arming::Done(armed) => armed,
            Arming::Stopped => return Ok(stopped(args, signals.first(), found.held)),
        };
        // Whatever ends at rest ends with two equal goals, so that a lost one changes nothing.
        let limit = budget(link);
        let written = net::catch(|| link.write_goals(armed.command(), limit));
        // Nobody speaks to the servos from here on, and they shall hold all the same.
        let (how, words) = match net::catch(|| leave(link)) {
            Ok(told) => told,
            Err(words) => {
                // Once more without whatever broke.
                let (_, notes) = leave(link);
                notes.iter().for_each(|note| remarks.say(note));
                return Err(broke(words));
            }
        };
        if let Some(error) = match written {
            Ok(written) => written.err().map(|e| exchange_error(link, None, &e)),
            Err(words) => Some(broke(words)),
        } {
            words.iter().for_each(|note| remarks.say(note));
            return Err(error);
        }
        notes.extend(words);
        left = Some(how);
    }
    let robot = link.robot();
    let what = if args.dry_run { "would be held" } else { "is held, torque on" };
    let mut text = format!("{} {what}\n", robot.name);
    let joints: Vec<_> = robot.joints.iter().zip(&found.start_rad).collect();
    for (joint, at_rad) in &joints {
        let _ = writeln!(text, "  {:<18} {:>7.1} deg", joint.name, at_rad.to_degrees());
    }
    let joints = joints.iter().map(|(joint, at)| json!({ "name": joint.name, "held_rad": at }));
    notes.iter().for_each(|note| remarks.say(note));
    if !args.dry_run {
        notes.push(format!("gaitway limp {} --bus ... lets go", robot.name));
    }
    let report = json!({
        "outcome": "done", "robot": robot.name, "dry_run": args.dry_run,
        "calibration": calibration, "joints": joints.collect::<Vec<_>>(), "left": left,
        "notes": notes,
    });
    let deed = if args.dry_run { Deed::Look } else { Deed::Motion };
    Ok(args.output.conclude(&report, &text, deed, 0))
}

fn broke(words: String) -> Error {
    Error::of(ErrorKind::Broke, "the program broke once the robot held")
        .got(words)
        .remedy("please report this")
}

/// Says that a wish to stop came before torque.
fn stopped(args: &HoldArgs, signal: Option<i32>, held: bool) -> i32 {
    let outcome = Outcome::Stopped;
    let how = if held { "it was held before, and still is" } else { "torque stayed off" };
    let report = json!({
        "outcome": outcome, "stop_reason": StopReason::Asked.to_string(),
        "stop": Stop::of(StopCode::Asked), "robot": args.robot, "notes": [how],
    });
    let text = format!("stopped before anything changed: {how}\n");
    let code = signal.map_or(outcome.exit_code(), |number| 128 + number);
    args.output.conclude(&report, &text, Deed::Motion, code)
}
