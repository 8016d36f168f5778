//! `hold`: torque on where the robot stands. Nothing moves.

use super::calibrated::CalibrationArg;
use super::signals::Signals;
use super::terminal::Terminal;
use super::{Deed, Outcome, Output, Remarks};
use crate::error::Error;
use crate::job::hold::{HoldOrder, hold};
use crate::rig::Address;
use clap::Args;
use std::fmt::Write;
use std::path::Path;

/// Arguments of `hold`.
#[derive(Debug, Args)]
#[command(after_help = "Example: gaitway hold op3 --bus serial:/dev/ttyUSB0\n\
    `gaitway limp` lets go again.")]
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
    let order = HoldOrder {
        robot: args.robot.clone(),
        buses: args.bus.clone(),
        calibration: args.calibration.path().map(Path::to_owned),
        accept_firmware: args.accept_firmware,
        dry_run: args.dry_run,
    };
    let mut report = hold(&order, &Terminal::new(remarks, &signals))?;
    if report.outcome == Outcome::Stopped {
        let text = format!("stopped before anything changed: {}\n", report.notes.join("; "));
        let code = signals.first().map_or(report.outcome.exit_code(), |number| 128 + number);
        return Ok(args.output.conclude(&report, &text, Deed::Motion, code));
    }
    let what = if args.dry_run { "would be held" } else { "is held, torque on" };
    let mut text = format!("{} {what}\n", report.robot);
    for joint in &report.joints {
        let _ = writeln!(text, "  {:<18} {:>7.1} deg", joint.name, joint.held_rad.to_degrees());
    }
    report.notes.iter().for_each(|note| remarks.say(note));
    if !args.dry_run {
        report.notes.push(format!("gaitway limp {} --bus ... lets go", report.robot));
    }
    let deed = if args.dry_run { Deed::Look } else { Deed::Motion };
    Ok(args.output.conclude(&report, &text, deed, 0))
}
