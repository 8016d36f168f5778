//! `retarget`: the trajectory a robot would play, as a file, and its figures.

mod bvh;

use super::source::MotionArgs;
use super::{Deed, Output, Remarks};
use crate::error::Error;
use crate::job::model::robot_model;
use crate::job::play::describe_plan;
use crate::job::report::{Outcome, PlayReport};
use crate::job::source;
use crate::mocap;
use crate::motion::{Plan, PlanOptions, Setpoint, plan};
use crate::port::{Clock, MonotonicClock};
use crate::recording::{CycleRecord, JointRecord, RecordedJoint, Recorder, RunEnd, RunStart};
use crate::robot::Robot;
use crate::time::Duration;
use clap::Args;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Arguments of `retarget`.
#[derive(Clone, Debug, Args)]
#[command(after_help = "\
The file's ending says what is written, all of it in the robot's joints and at the robot's pace:
  .csv   a table: time_s, then one column per joint, rad
  .mcap  a recording of goals, as `play --record` makes it, for Foxglove, PlotJuggler, `convert`
  .bvh   the robot's own joint tree in motion, its base fixed, for Blender and other animation tools

Example: gaitway retarget dance.bvh --robot op3 -o dance.csv")]
pub struct RetargetArgs {
    #[command(flatten)]
    motion: MotionArgs,
    /// File to write: .csv, .mcap or .bvh
    #[arg(short, long, value_name = "OUT")]
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
    let kind = Kind::of(&args.output_file)?;
    output.check_files(&[&Some(args.output_file.clone())])?;
    let robot = Robot::load(args.motion.robot())?;
    let loaded = source::load(&args.motion.order(), &robot)?;
    let start_rad: Vec<f64> = robot.joints.iter().map(|joint| joint.initial_rad).collect();
    let options = PlanOptions {
        speed: args.motion.speed(),
        retime: args.motion.retime().unwrap_or(loaded.of_person),
        ..PlanOptions::default()
    };
    let path = loaded.path_from(&robot, &start_rad)?;
    let planned = plan(&start_rad, &path, &robot.limits(), options)?;
    let rate_hz = args.rate.unwrap_or(robot.file.rate_hz);
    match kind {
        Kind::Csv => output.write_file(&args.output_file, csv(&planned, rate_hz).as_bytes())?,
        Kind::Bvh => {
            let model = robot_model(&robot.file, &robot);
            let poses: Vec<Vec<f64>> = rows(&planned, rate_hz).map(|(_, pose)| pose).collect();
            let text = mocap::bvh::write(&bvh::of_robot(&model, &poses, rate_hz));
            output.write_file(&args.output_file, text.as_bytes())?;
        }
        Kind::Mcap => record(args, &robot, &planned, rate_hz)?,
    }
    let mut report = PlayReport::new(&loaded.name, &robot.name, Vec::new());
    report.outcome = Outcome::Done;
    report.source = loaded.source.clone();
    report.notes.extend(loaded.notes.iter().cloned());
    report.duration_s = planned.trajectory.duration_s();
    describe_plan(&mut report, &robot, &planned, &loaded);
    report.notes.push(format!(
        "the file begins with {:.2} s of transition from the robot's initial pose",
        report.approach_s
    ));
    let written = format!("written   {}\n", args.output_file.display());
    let text = report.text(remarks.quiet) + &written;
    Ok(output.conclude(&report, &text, Deed::Work, 0))
}

/// What is written.
enum Kind {
    Csv,
    Bvh,
    Mcap,
}

impl Kind {
    fn of(path: &Path) -> Result<Self, Error> {
        match path.extension().and_then(|ending| ending.to_str()) {
            Some("csv") => Ok(Self::Csv),
            Some("bvh") => Ok(Self::Bvh),
            Some("mcap") => Ok(Self::Mcap),
            _ => Err(Error::new("not a kind of file I can write")
                .at("-o")
                .got(path.display().to_string())
                .allowed("a name that ends in .csv, .mcap or .bvh")),
        }
    }
}

/// Times in s and angles in rad, in the order of the trajectory's joints. The last row is the end
/// itself, wherever it falls on the grid.
fn rows(planned: &Plan, rate_hz: f64) -> impl Iterator<Item = (f64, Vec<f64>)> {
    let trajectory = &planned.trajectory;
    let last = (trajectory.duration_s() * rate_hz).ceil() as usize;
    let mut setpoints = vec![Setpoint::default(); trajectory.joints().len()];
    (0..=last).map(move |row| {
        let time_s = (row as f64 / rate_hz).min(trajectory.duration_s());
        trajectory.sample(time_s, &mut setpoints);
        (time_s, setpoints.iter().map(|setpoint| setpoint.position_rad).collect())
    })
}

fn csv(planned: &Plan, rate_hz: f64) -> String {
    let mut out = String::from("time_s");
    for joint in planned.trajectory.joints() {
        let _ = write!(out, ",{joint}_rad");
    }
    out.push('\n');
    for (time_s, pose) in rows(planned, rate_hz) {
        let _ = write!(out, "{time_s:.6}");
        for angle_rad in pose {
            let _ = write!(out, ",{angle_rad:.9}");
        }
        out.push('\n');
    }
    out
}

/// A recording of goals that nobody was given yet.
fn record(args: &RetargetArgs, robot: &Robot, planned: &Plan, rate_hz: f64) -> Result<(), Error> {
    let joint = |joint: &crate::robot::Joint| RecordedJoint {
        name: joint.name.clone(),
        lower_rad: Some(joint.limits.lower_rad()),
        upper_rad: Some(joint.limits.upper_rad()),
        velocity_limit_rad_s: Some(joint.limits.velocity_rad_s()),
        acceleration_limit_rad_s2: Some(joint.limits.acceleration_rad_s2()),
    };
    let start = MonotonicClock.now();
    let run = RunStart {
        robot: robot.name.clone(),
        motion: args.motion.order().motion,
        joints: robot.joints.iter().map(joint).collect(),
        wall_clock_start: std::time::SystemTime::now(),
        monotonic_start: start,
        gaitway_version: env!("CARGO_PKG_VERSION").to_owned(),
        metadata: [("planned".to_owned(), "goals only; nothing was played".to_owned())].into(),
    };
    let recorder = Recorder::create_whole(&args.output_file, args.output.force(), run)?;
    let mut end = start;
    for (cycle, (time_s, pose)) in (0..).zip(rows(planned, rate_hz)) {
        end = start + Duration::from_secs_f64(time_s);
        let goal = |goal_rad: f64| JointRecord { goal_rad: Some(goal_rad), ..Default::default() };
        let joints = pose.into_iter().map(goal).collect();
        recorder.take_patiently(CycleRecord { cycle, at: end, joints });
    }
    let (outcome, metadata) = ("done".to_owned(), Default::default());
    let stored = recorder.finish(RunEnd { outcome, stop_reason: None, at: end, metadata });
    match stored.poisoned {
        None => Ok(()),
        Some(cause) => Err(Error::new("cannot write the file")
            .at(args.output_file.display().to_string())
            .got(cause)),
    }
}
