//! `calibrate`, as it is typed.

use super::signals::Signals;
use super::terminal::Terminal;
use super::{Deed, Outcome, Output, Remarks};
use crate::corpus::store::check_outside;
use crate::error::Error;
use crate::job::calibrate::{CalibrateOrder, CalibrateReport, calibrate};
use crate::job::calibrate::{LerobotOrder, LerobotWay, carry_over};
use crate::rig::Address;
pub use answers::Answers;
use clap::Args;
use std::fmt::Write;
use std::path::PathBuf;

mod answers;

/// Arguments of `calibrate`.
#[derive(Debug, Args)]
#[command(after_help = include_str!("help/calibrate.txt"))]
pub struct CalibrateArgs {
    /// Robot by name or path of its file
    robot: String,
    /// Where the robot is: sim, sim:pty, serial:PATH[?baud=N], tcp:HOST:PORT; LINE=BUS for each line
    /// of a robot with several
    #[arg(long, value_name = "BUS", required_unless_present_any = ["from_lerobot", "to_lerobot"])]
    bus: Vec<Address>,
    /// Make the calibration of a file that LeRobot wrote (FILE.json), instead of measuring
    #[arg(long, value_name = "FILE.json", conflicts_with_all = ["bus", "to_lerobot", "only", "resume", "permit_eeprom"])]
    from_lerobot: Option<PathBuf>,
    /// Write the calibration as LeRobot reads it
    #[arg(long, value_name = "FILE.json", conflicts_with_all = ["bus", "only", "resume", "permit_eeprom"])]
    to_lerobot: Option<PathBuf>,
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
/// As [`calibrate`].
pub fn run(args: &CalibrateArgs, remarks: Remarks) -> Result<i32, Error> {
    args.output.check_files(&[&args.to_lerobot])?;
    args.calibration.as_deref().map_or(Ok(()), check_outside)?;
    let way = args.from_lerobot.clone().map(LerobotWay::From);
    if let Some(way) = way.or_else(|| args.to_lerobot.clone().map(LerobotWay::To)) {
        let (robot, calibration) = (args.robot.clone(), args.calibration.clone());
        let (replace, dry_run) = (args.output.force(), args.dry_run);
        let order = LerobotOrder { robot, way, calibration, replace, dry_run };
        let report = carry_over(&order, &Terminal::unheard(remarks))?;
        return Ok(args.output.conclude(&report, &text(&report), Deed::Work, 0));
    }
    let signals = Signals::listen().map_err(|e| Error::new(format!("no signals: {e}")))?;
    let order = CalibrateOrder {
        robot: args.robot.clone(),
        buses: args.bus.clone(),
        only: args.only.clone(),
        calibration: args.calibration.clone(),
        resume: args.resume,
        permit_eeprom: args.permit_eeprom,
        supported: args.yes,
        dry_run: args.dry_run,
        replace: args.output.force(),
    };
    let mut answers = Answers::listen(signals.clone())?;
    let report = calibrate(&order, &mut answers, &Terminal::unheard(remarks))?;
    let code = match (report.outcome, signals.first()) {
        (Outcome::Stopped, Some(number)) => 128 + number,
        (outcome, _) => outcome.exit_code(),
    };
    if report.changed_nothing() {
        let text = "stopped before anything changed: torque is as it was\n";
        return Ok(args.output.conclude(&report, text, Deed::Look, code));
    }
    Ok(args.output.conclude(&report, &text(&report), Deed::Work, code))
}

fn text(report: &CalibrateReport) -> String {
    let degrees = |rad: Option<f64>| {
        rad.map_or_else(|| "-".to_owned(), |rad| format!("{:.1}", rad.to_degrees()))
    };
    let mut out =
        format!("{:<18} {:>9} {:>12} {:>18}\n", "joint", "direction", "offset, deg", "range, deg");
    for joint in &report.joints {
        let range = format!("{} to {}", degrees(joint.lower_rad), degrees(joint.upper_rad));
        let _ = writeln!(
            out,
            "{:<18} {:>9} {:>12} {range:>18}",
            joint.name,
            joint.direction,
            degrees(Some(joint.offset_rad)),
        );
    }
    let place = report.calibration.display();
    let _ = match report.outcome {
        _ if report.dry_run => writeln!(out, "nothing was written; it would go to {place}"),
        Outcome::Stopped => writeln!(out, "stopped; what was measured is in {place}"),
        _ => writeln!(out, "written to {place}"),
    };
    out
}
