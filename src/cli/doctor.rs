//! `doctor`: what on this machine stands between a robot and a smooth cycle. Looks, says, and
//! changes nothing; with --directions it moves joints a little.

use super::calibrate::Answers;
use super::calibrated::CalibrationArg;
use super::output::{Untold, prompt};
use super::signals::Signals;
use super::terminal::Terminal;
use super::{Deed, Output, Remarks};
use crate::error::Error;
use crate::job::directions::{
    DirectionAnswer, DirectionFound, DirectionOrder, answered, directions, question,
};
use crate::job::doctor::{User, findings, measured};
use crate::job::finding::Level;
use crate::job::ports::{self, Machine};
use crate::job::report::Outcome;
use crate::rig::Address;
use clap::Args;
use std::path::{Path, PathBuf};

/// Arguments of `doctor`.
#[derive(Debug, Args)]
#[command(after_help = include_str!("help/doctor.txt"))]
pub struct DoctorArgs {
    /// Print the udev rules and nothing else
    #[arg(long)]
    rules: bool,
    /// End with exit code 1 if something is not as it should be
    #[arg(long)]
    strict: bool,
    /// Measure how long answers take on this line: serial:PATH[?baud=N], tcp:HOST:PORT; or open can:INTERFACE, can:slcan:PATH; again for other lines
    #[arg(long, value_name = "BUS")]
    bus: Vec<Address>,
    /// Robot whose line --bus is: says the line speed, and which robot a virtual one is
    #[arg(long, value_name = "ROBOT")]
    robot: Option<String>,
    /// Move each joint of --robot a little and back, and ask whether it turned the right way; it must be supported
    #[arg(long, requires = "robot", requires = "bus")]
    directions: bool,
    #[command(flatten)]
    moving: MovingArgs,
    /// Look below this folder instead of /
    #[arg(long, value_name = "DIR", hide = true, default_value = "/")]
    root: PathBuf,
    #[command(flatten)]
    output: Output,
}

/// How joints are moved for a look.
#[derive(Debug, Args)]
struct MovingArgs {
    /// With --directions: only this joint, again for others
    #[arg(long, value_name = "JOINT", requires = "directions")]
    joint: Vec<String>,
    /// With --directions: how far each goes, degrees
    #[arg(long, value_name = "DEG", default_value_t = 5.0, requires = "directions")]
    by: f64,
    /// With --directions: write a calibration in which what turns the wrong way is turned round
    #[arg(long, value_name = "FILE.toml", requires = "directions")]
    save: Option<PathBuf>,
    /// With --directions: switch torque off at the end
    #[arg(long, requires = "directions")]
    limp: bool,
    /// With --directions: check everything, say what would move, write nothing
    #[arg(long, requires = "directions")]
    dry_run: bool,
    /// With --directions: move servos whose firmware the profile was not checked against
    #[arg(long, requires = "directions")]
    accept_firmware: bool,
    #[command(flatten)]
    calibration: CalibrationArg,
}

/// Runs `doctor`.
///
/// # Errors
/// What stands against moving joints; a report file that exists or cannot be written.
pub fn run(args: &DoctorArgs, remarks: Remarks) -> Result<i32, Error> {
    if args.rules {
        return match super::print(ports::RULES) {
            Ok(()) | Err(Untold::Unwanted) => Ok(0),
            Err(failed) => Err(failed.into()),
        };
    }
    args.output.check_files(&[&args.moving.save])?;
    if let Some(robot) = args.robot.as_ref().filter(|_| args.directions) {
        return turn(args, robot, remarks);
    }
    let machine = Machine::at(&args.root);
    let mut found = ports::survey(&machine);
    found.findings.extend(findings(&machine, &User::current(&machine)));
    for address in &args.bus {
        found.findings.push(measured(address, args.robot.as_deref()));
    }
    let unwell = found.findings.iter().any(|finding| finding.level > Level::Ok);
    let code = i32::from(args.strict && unwell);
    Ok(args.output.conclude(&found, &found.text(), Deed::Look, code))
}

/// Moves joints and asks about them.
fn turn(args: &DoctorArgs, robot: &str, remarks: Remarks) -> Result<i32, Error> {
    let moving = &args.moving;
    let signals = Signals::listened()?;
    let order = DirectionOrder {
        robot: robot.to_owned(),
        buses: args.bus.clone(),
        calibration: moving.calibration.path().map(Path::to_owned),
        joints: moving.joint.clone(),
        by_rad: moving.by.to_radians(),
        accept_firmware: moving.accept_firmware,
        limp: moving.limp,
        save: moving.save.clone(),
        dry_run: moving.dry_run,
    };
    let mut answers = Answers::listen(signals.clone())?;
    let mut ask = |found: &DirectionFound| loop {
        let _ = prompt(&question(found));
        match answers.line().map(|line| answered(&line)) {
            Some(Some(answer)) => return answer,
            Some(None) => {}
            None => return DirectionAnswer::Stop,
        }
    };
    let report = directions(&order, &Terminal::new(remarks, &signals), &mut ask)?;
    let code = match (signals.first(), report.outcome) {
        (Some(number), Outcome::Stopped) => 128 + number,
        (_, outcome) => outcome.exit_code(),
    };
    let deed = if order.dry_run { Deed::Look } else { Deed::Motion };
    Ok(args.output.conclude(&report, &report.text(), deed, code))
}
