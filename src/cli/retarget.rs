//! `retarget`: the trajectory a robot would play, as a file, and its figures.

use super::play::describe_plan;
use super::report::{Outcome, PlayReport};
use super::source::{self, MotionArgs};
use super::{Output, Remarks};
use crate::error::Error;
use crate::motion::{Plan, PlanOptions, Setpoint, plan};
use crate::robot::Robot;
use clap::Args;
use std::fmt::Write;
use std::path::PathBuf;

/// Arguments of `retarget`.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Example: gaitway retarget dance.bvh --robot op3 -o dance.csv")]
pub struct RetargetArgs {
    #[command(flatten)]
    motion: MotionArgs,
    /// File to write: time_s, then one column per joint, rad
    #[arg(short, long, value_name = "OUT.csv")]
    output_file: PathBuf,
    /// Rows per second [default: the robot file's rate]
    #[arg(long, value_name = "HZ", value_parser = super::play::rate, allow_negative_numbers = true)]
    rate: Option<f64>,
    #[command(flatten)]
    output: Output,
}

/// Runs `retarget`: from the robot's initial pose through the motion, as `play` would.
///
/// # Errors
/// As `play`, before it looks for a bus.
pub fn run(args: &RetargetArgs, remarks: Remarks) -> Result<i32, Error> {
    let output = &args.output;
    if args.output_file.extension().is_none_or(|e| e != "csv") {
        return Err(Error::new("not a kind of file I can write")
            .at("-o")
            .got(args.output_file.display().to_string())
            .allowed("a name that ends in .csv"));
    }
    output.check_files(&[&Some(args.output_file.clone())])?;
    let robot = Robot::load(args.motion.robot())?;
    let loaded = source::load(&args.motion, &robot)?;
    let start_rad: Vec<f64> = robot.joints.iter().map(|joint| joint.initial_rad).collect();
    let options = PlanOptions {
        speed: args.motion.speed(),
        retime: args.motion.retimes(),
        ..PlanOptions::default()
    };
    let path = loaded.path_from(&robot, &start_rad)?;
    let planned = plan(&start_rad, &path, &robot.limits(), options)?;
    let rate_hz = args.rate.unwrap_or(robot.file.rate_hz);
    output.write_file(&args.output_file, csv(&planned, rate_hz).as_bytes())?;
    let mut report = PlayReport::new(args.motion.motion(), &robot.name, Vec::new());
    report.outcome = Outcome::Done;
    report.source = loaded.source.clone();
    report.notes.extend(loaded.notes.iter().cloned());
    report.duration_s = planned.trajectory.duration_s();
    describe_plan(&mut report, &robot, &planned, &loaded);
    report.notes.push(format!(
        "the table begins with {:.2} s of transition from the robot's initial pose",
        report.approach_s
    ));
    let written = format!("written   {}\n", args.output_file.display());
    output.report(&report, &(report.text(remarks.quiet) + &written))?;
    Ok(0)
}

fn csv(planned: &Plan, rate_hz: f64) -> String {
    let trajectory = &planned.trajectory;
    let mut out = String::from("time_s");
    for joint in trajectory.joints() {
        let _ = write!(out, ",{joint}_rad");
    }
    out.push('\n');
    let rows = (trajectory.duration_s() * rate_hz).ceil() as usize;
    let mut setpoints = vec![Setpoint::default(); trajectory.joints().len()];
    for row in 0..=rows {
        // The last row is the end itself, wherever it falls on the grid.
        let time_s = (row as f64 / rate_hz).min(trajectory.duration_s());
        trajectory.sample(time_s, &mut setpoints);
        let _ = write!(out, "{time_s:.6}");
        for setpoint in &setpoints {
            let _ = write!(out, ",{:.9}", setpoint.position_rad);
        }
        out.push('\n');
    }
    out
}
