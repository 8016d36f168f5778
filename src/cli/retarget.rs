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
#[command(after_help = "\
The file's ending says what is written, all of it in the robot's joints and at the robot's pace:
  .csv   a table: time_s, then one column per joint, rad; then where the base is (base_x_m, base_y_m,
         base_z_m, base_qw, base_qx, base_qy, base_qz; Z up, floor at 0) and which foot stands
         (contact_left, contact_right), if the robot's file has a body
  .mcap  a recording of goals, as `play --record` makes it, for Foxglove, PlotJuggler, `convert`
  .bvh   the robot's own joint tree in motion, for Blender and other animation tools

--html writes a page as well: robot and person beside each other, joints, where the robot touches itself,
tips or was too fast.

Example: gaitway retarget dance.bvh --robot op3 -o dance.csv --html dance.html")]
pub struct RetargetArgs {
    #[command(flatten)]
    motion: MotionArgs,
    /// File to write: .csv, .mcap or .bvh
    #[arg(short, long, value_name = "OUT")]
    output_file: PathBuf,
    /// Rows per second [default: the robot file's rate]
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
    TrajectoryFile::of(&args.output_file)?;
    args.output.check_files(&[&Some(args.output_file.clone()), &args.html])?;
    let order = RetargetOrder {
        motion: args.motion.order(),
        robot: args.motion.robot().to_owned(),
        speed: args.motion.speed(),
        retime: args.motion.retime(),
        rate_hz: args.rate,
        file: args.output_file.clone(),
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
