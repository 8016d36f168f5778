//! `retarget`, as it is typed.

use super::signals::Signals;
use super::source::MotionArgs;
use super::terminal::Terminal;
use super::{Deed, Output, Remarks};
use crate::error::Error;
use crate::job::retarget::{RetargetOrder, TrajectoryFile, retarget};
use clap::Args;
use std::path::PathBuf;

/// Arguments of `retarget`.
#[derive(Clone, Debug, Args)]
#[command(after_help = include_str!("help/retarget.txt"))]
pub struct RetargetArgs {
    #[command(flatten)]
    motion: MotionArgs,
    /// File to write: .csv, .mcap, .bvh or .npz
    #[arg(short, long, value_name = "OUT")]
    output_file: PathBuf,
    /// What goes into a .csv or .npz for those who learn from it: robot-csv, unitree-csv or robot-npz
    #[arg(long, value_name = "FORMAT")]
    format: Option<String>,
    /// Rows per second [default: the robot file's rate; for learners 30, in .npz 50]
    #[arg(long, value_name = "HZ", value_parser = super::play::rate, allow_negative_numbers = true)]
    rate: Option<f64>,
    /// Write a page that shows it to this file
    #[arg(long, value_name = "FILE.html")]
    html: Option<PathBuf>,
    #[command(flatten)]
    output: Output,
}

/// Runs `retarget`: from the robot's initial pose through the motion, as `play` would.
///
/// # Errors
/// As `play`, before it looks for a bus.
pub fn run(args: &RetargetArgs, remarks: Remarks) -> Result<i32, Error> {
    let kind = TrajectoryFile::of(&args.output_file, args.format.as_deref())?;
    args.output.check_files(&[&Some(args.output_file.clone()), &args.html])?;
    let order = RetargetOrder {
        motion: args.motion.order(),
        robot: args.motion.robot().to_owned(),
        speed: args.motion.speed(),
        retime: args.motion.retime(),
        rate_hz: args.rate,
        file: args.output_file.clone(),
        kind,
        replace: args.output.force(),
        hangs: args.motion.hangs(),
        allow_fall: args.motion.allows_fall(),
        html: args.html.clone(),
    };
    let signals = Signals::listened()?;
    let report = retarget(&order, &Terminal::new(remarks, &signals))?;
    let written = format!("written   {}\n", args.output_file.display());
    let text = report.text(remarks.quiet) + &written;
    Ok(args.output.conclude(&report, &text, Deed::Work, 0))
}
