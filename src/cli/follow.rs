//! `follow`, as it is typed.

use super::calibrated::CalibrationArg;
use super::signals::Signals;
use super::terminal::Terminal;
use super::viewing::{ViewArg, Viewing};
use super::{Deed, Output, Remarks, play, say};
use crate::error::Error;
use crate::job::leader::{LeadOrder, follow_leader};
use crate::job::page::live::Shows;
use crate::rig::Address;
use crate::time::{Duration, listening_time};
use clap::Args;
use std::path::{Path, PathBuf};

/// Arguments of `follow`.
#[derive(Clone, Debug, Args)]
#[command(after_help = include_str!("help/follow.txt"))]
pub struct FollowArgs {
    /// Who leads: servos:ROBOT@BUS, a robot whose torque is off
    leader: String,
    /// Who follows: robot by name, or path of its file
    #[arg(long)]
    robot: String,
    /// Where it is, as for `play`
    #[arg(long, value_name = "BUS", required = true)]
    bus: Vec<Address>,
    /// Joints led by the share of the leader's range instead of by its angle: a trigger that opens a wider gripper
    #[arg(long, value_name = "JOINTS", value_delimiter = ',')]
    by_range: Vec<String>,
    /// Follow at this share of the joints' limits of velocity and acceleration, 0.05 to 1
    #[arg(long, value_name = "SHARE", default_value_t = 1.0, allow_negative_numbers = true)]
    pace: f64,
    /// Cycles per second [default: the robot file's]
    #[arg(long, value_name = "HZ", value_parser = play::rate, allow_negative_numbers = true)]
    rate: Option<f64>,
    /// Follow for this time, then come to rest [default: until Ctrl-C]
    #[arg(long = "for", value_name = "TIME", value_parser = listening_time, allow_negative_numbers = true)]
    time: Option<Duration>,
    /// Switch the leader's torque off first: it falls unless it is supported
    #[arg(long)]
    limp: bool,
    /// Calibration of the leader [default: as for --calibration]
    #[arg(long, value_name = "FILE")]
    leader_calibration: Option<PathBuf>,
    /// Record goals and measured states of the robot that follows to this file
    #[arg(long, value_name = "FILE.mcap")]
    record: Option<PathBuf>,
    /// Move servos whose firmware the profile was not checked against
    #[arg(long)]
    accept_firmware: bool,
    /// Look at both robots, write nothing
    #[arg(long)]
    dry_run: bool,
    #[command(flatten)]
    view: ViewArg,
    /// Seed of virtual robots
    #[arg(long, default_value_t = 0)]
    seed: u64,
    #[command(flatten)]
    calibration: CalibrationArg,
    #[command(flatten)]
    output: Output,
}

/// Runs `follow`; the exit code.
///
/// # Errors
/// No signals can be heard, or a file is there. A refusal is a report, not an error.
pub fn run(args: &FollowArgs, remarks: Remarks) -> Result<i32, Error> {
    args.output.check_files(&[&args.record])?;
    let signals = Signals::listen().map_err(|e| Error::new(format!("no signals: {e}")))?;
    let order = LeadOrder {
        leader: args.leader.clone(),
        leader_calibration: args.leader_calibration.clone(),
        limp: args.limp,
        by_range: args.by_range.clone(),
        robot: args.robot.clone(),
        buses: args.bus.clone(),
        calibration: args.calibration.path().map(Path::to_owned),
        seed: args.seed,
        rate_hz: args.rate,
        pace: args.pace,
        time: args.time,
        record: args.record.clone(),
        replace: args.output.force(),
        accept_firmware: args.accept_firmware,
        dry_run: args.dry_run,
    };
    let view = args.view.open(
        Some(&args.robot),
        &args.bus,
        &format!("follows {}", args.leader),
        Shows::default(),
    )?;
    if !remarks.quiet && !args.dry_run {
        say("Ctrl-C brings the robot to rest");
    }
    let terminal = Terminal::new(remarks, &signals);
    let report = follow_leader(&order, &Viewing::new(&terminal, view.as_ref()));
    let code = report.run.exit_code(signals.first());
    let deed = if args.dry_run { Deed::Look } else { Deed::Motion };
    Ok(args.output.conclude(&report, &report.text(remarks.quiet), deed, code))
}
