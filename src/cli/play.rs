//! `play`: from a motion file to a moving robot, and what came of it. The whole job, in order.

use super::calibrated::CalibrationArg;
use super::progress::Progress;
use super::report::{JointReport, Outcome, PlayReport, RefereeReport};
use super::signals::Signals;
use super::source::{self, Loaded, MotionArgs};
use super::{Deed, Output, Remarks, plots};
use crate::control::{self, Left, Performance, Planned, Settings, inject, net};
use crate::error::Error;
use crate::motion::{Plan, PlanOptions, plan};
use crate::rig::Address;
use crate::rig::{Connection, connect, patience_words};
use crate::robot::Robot;
use crate::robot::preflight::{Accept, Preflight, preflight};
use clap::{Args, ValueEnum};
use std::path::PathBuf;

mod recorder;

pub use recorder::RunRecorder;

/// Arguments of `play`.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Examples:\n  \
    gaitway play walk --robot op3 --bus sim --html walk.html\n  \
    gaitway play dance.bvh --robot op3 --bus serial:/dev/ttyUSB0 --speed 0.5 --record dance.mcap")]
pub struct PlayArgs {
    #[command(flatten)]
    motion: MotionArgs,
    /// Where the robot is: sim, sim:pty, serial:PATH[?baud=N], tcp:HOST:PORT, can:INTERFACE; LINE=BUS
    /// for each line of a robot with several
    #[arg(long, value_name = "BUS", required = true)]
    bus: Vec<Address>,
    /// Cycles per second [default: the robot file's]
    #[arg(long, value_name = "HZ", value_parser = rate, allow_negative_numbers = true)]
    rate: Option<f64>,
    /// Play it N times, with a transition in between
    #[arg(long = "loop", value_name = "N", default_value_t = 1,
          value_parser = clap::value_parser!(u32).range(1..=10_000))]
    repeat: u32,
    /// What the joints do after the motion
    #[arg(long, value_enum, default_value_t = EndState::Hold)]
    end: EndState,
    /// Record goals and measured states to this file
    #[arg(long, value_name = "FILE.mcap")]
    record: Option<PathBuf>,
    /// Refuse a motion that starts away from where the robot stands, instead of moving there first
    #[arg(long)]
    no_approach: bool,
    /// Play on servos whose firmware the profile was not checked against
    #[arg(long)]
    accept_firmware: bool,
    /// Lower the servos' return delay (EEPROM) if the rate needs it; how to undo it is said
    #[arg(long)]
    permit_eeprom: bool,
    /// Check everything, write nothing
    #[arg(long)]
    dry_run: bool,
    /// Write a page with plots of every joint
    #[arg(long, value_name = "FILE.html")]
    html: Option<PathBuf>,
    /// Seed of the virtual robot
    #[arg(long, default_value_t = 0)]
    seed: u64,
    #[command(flatten)]
    calibration: CalibrationArg,
    #[command(flatten)]
    output: Output,
}

/// What the joints do when the motion is over.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum EndState {
    /// Stay where they are, torque on
    Hold,
    /// Torque off: a standing robot falls
    Limp,
}

/// Runs `play`; the exit code.
///
/// # Errors
/// A report file that cannot be written. A refused motion is a report, not an error.
pub fn run(args: &PlayArgs, remarks: Remarks) -> Result<i32, Error> {
    let signals = Signals::listen().map_err(|e| Error::new(format!("no signals: {e}")))?;
    let report = play(args, remarks, &signals);
    let code = report.exit_code(signals.first());
    let deed = if args.dry_run { Deed::Look } else { Deed::Motion };
    Ok(args.output.conclude(&report, &report.text(remarks.quiet), deed, code))
}

/// Plays and reports; whatever goes wrong is in the report.
#[must_use]
pub fn play(args: &PlayArgs, remarks: Remarks, signals: &Signals) -> PlayReport {
    let mut report = PlayReport::new(
        args.motion.motion(),
        args.motion.robot(),
        args.bus.iter().map(ToString::to_string).collect(),
    );
    report.dry_run = args.dry_run;
    match net::catch(|| play_into(args, remarks, signals, &mut report)) {
        Ok(Ok(())) => {}
        Ok(Err(error)) => {
            report.outcome = Outcome::Refused;
            report.stop_reason = Some(error.to_string());
        }
        Err(words) => report.describe_broken(&words),
    }
    report
}

fn play_into(
    args: &PlayArgs,
    remarks: Remarks,
    signals: &Signals,
    report: &mut PlayReport,
) -> Result<(), Error> {
    args.output.check_files(&[&args.record, &args.html])?;
    let (robot, calibration) = args.calibration.load(args.motion.robot(), &args.bus)?;
    report.calibration = calibration.map(|path| path.display().to_string());
    report.robot.clone_from(&robot.name);
    let loaded = source::load(&args.motion, &robot)?;
    report.source = loaded.source.clone();
    report.notes.extend(loaded.notes.iter().cloned());
    let rate_hz = args.rate.unwrap_or(robot.file.rate_hz);
    report.cycle_hz = rate_hz;
    if robot.file.acceleration_source.starts_with("assumed") {
        report.notes.push(format!("acceleration limits {}", robot.file.acceleration_source));
    }
    let settings = Settings::at_rate(rate_hz);
    if stopped_before_torque(signals, report) {
        return Ok(());
    }
    let mut connection = connect(robot, &args.bus, args.seed)?;
    inject::point("preflight", 0);
    let accept = Accept { firmware: args.accept_firmware, eeprom: args.permit_eeprom };
    let found = preflight(&mut connection.link, settings.period, accept)?;
    report.wire_limit_hz = Some(found.wire_limit_hz);
    report.bus_load = found.bus_load;
    report.notes.extend(found.lines.iter().map(ToString::to_string));
    report.notes.extend(found.notes.iter().cloned());
    let planned = plan_from(args, &connection, &found, &loaded)?;
    describe_plan(report, connection.link.robot(), &planned, &loaded);
    if args.dry_run {
        report.outcome = Outcome::Done;
        return Ok(());
    }
    if stopped_before_torque(signals, report) {
        return Ok(());
    }
    perform(args, remarks, signals, report, &mut connection, &found, &planned, settings)
}

/// A wish to stop that comes before torque is on is fulfilled by never switching it on.
pub(super) fn stopped_before_torque(signals: &Signals, report: &mut PlayReport) -> bool {
    let asked = signals.first().is_some();
    if asked {
        report.describe_stopped();
    }
    asked
}

/// Reads `--rate`: below 20 Hz goals would be too far apart to be watched.
pub(super) fn rate(text: &str) -> Result<f64, String> {
    let rate_hz: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    if (20.0..=1000.0).contains(&rate_hz) {
        Ok(rate_hz)
    } else {
        Err("allowed: 20 to 1000 Hz".to_owned())
    }
}

/// Lays the loaded path from where the robot stands. Joints the motion does not drive stay there.
fn plan_from(
    args: &PlayArgs,
    connection: &Connection,
    found: &Preflight,
    loaded: &Loaded,
) -> Result<Plan, Error> {
    let robot = connection.link.robot();
    let path = loaded.path_from(robot, &found.start_rad)?;
    let options = PlanOptions {
        speed: args.motion.speed(),
        retime: loaded.retime,
        approach: !args.no_approach,
        rounds: args.repeat,
    };
    plan(&found.start_rad, &path, &robot.limits(), options)
}

pub(super) fn describe_plan(
    report: &mut PlayReport,
    robot: &Robot,
    planned: &Plan,
    loaded: &Loaded,
) {
    report.describe_retiming(&planned.retimed);
    report.ease_in_s = planned.ease_in_s;
    report.ease_out_s = planned.ease_out_s;
    report.approach_s = planned.approach_s;
    if planned.ease_in_s > 0.0 || planned.ease_out_s > 0.0 {
        report.notes.push(format!(
            "the clip does not {} at rest; its clock is eased along its own path",
            match (planned.ease_in_s > 0.0, planned.ease_out_s > 0.0) {
                (true, true) => "start and end",
                (true, false) => "start",
                _ => "end",
            }
        ));
    }
    let trajectory = &planned.trajectory;
    let duration_s = trajectory.duration_s();
    let at_end = |time_s: f64| {
        let mut setpoints = vec![crate::motion::Setpoint::default(); robot.joints.len()];
        trajectory.sample(time_s, &mut setpoints);
        setpoints
    };
    let (first, last) = (at_end(0.0), at_end(duration_s));
    let velocity = trajectory.peak_velocity_rad_s();
    let acceleration = trajectory.peak_acceleration_rad_s2();
    let jerk = trajectory.peak_jerk_rad_s3();
    for (index, joint) in robot.joints.iter().enumerate() {
        let clipped_samples = loaded.clipped_samples(&joint.name);
        report.joints.push(JointReport {
            name: joint.name.clone(),
            range_rad: None,
            peak_velocity_rad_s: velocity[index],
            peak_acceleration_rad_s2: acceleration[index],
            peak_jerk_rad_s3: jerk[index],
            limit_velocity_rad_s: joint.limits.velocity_rad_s(),
            limit_acceleration_rad_s2: joint.limits.acceleration_rad_s2(),
            tracking_rms_rad: None,
            start_velocity_rad_s: first[index].velocity_rad_s,
            end_velocity_rad_s: last[index].velocity_rad_s,
            clipped_samples,
            clipped_share: clipped_samples as f64 / loaded.samples().max(1) as f64,
            at_limit_share: loaded.at_limit_share(&joint.name),
            missed_reads: 0,
        });
    }
    let fastest = |setpoints: &[crate::motion::Setpoint]| {
        setpoints.iter().map(|s| s.velocity_rad_s.abs()).fold(0.0, f64::max)
    };
    report.max_start_velocity_rad_s = fastest(&first);
    report.max_end_velocity_rad_s = fastest(&last);
}

#[allow(clippy::too_many_arguments)]
fn perform(
    args: &PlayArgs,
    remarks: Remarks,
    signals: &Signals,
    report: &mut PlayReport,
    connection: &mut Connection,
    found: &Preflight,
    planned: &Plan,
    settings: Settings,
) -> Result<(), Error> {
    // Once torque is on, nothing may keep the loop from its first cycle: the file comes before.
    let mut recorder = RunRecorder::begin(
        args.record.as_deref(),
        args.output.force(),
        args.html.is_some(),
        connection,
        args.motion.motion(),
    )?;
    let progress = Progress::over(planned.trajectory.duration_s(), remarks);
    let limits = connection.link.robot().limits();
    let performed = control::perform(
        &mut connection.link,
        found,
        &mut Planned::new(&planned.trajectory, &limits),
        settings,
        &mut recorder.metered(progress.meter()),
        &|| signals.first().is_some(),
        &mut |is_over| progress.show_until(is_over),
    );
    let performed = match performed {
        Ok(performed) if report.describe_performance(&performed) => performed,
        other => {
            recorder.discard();
            return other.map(|_| ());
        }
    };
    if args.end == EndState::Limp
        && matches!(performed, Performance::Ran(run) if run.stop.is_none())
    {
        go_limp(report, connection);
    }
    recorder.finish(report, connection);
    conclude(args, report, connection, &recorder);
    Ok(())
}

/// Switches torque off after a motion that came to its end.
fn go_limp(report: &mut PlayReport, connection: &mut Connection) {
    match control::arm::disarm(&mut connection.link) {
        Ok(()) => {
            report.left =
                Some(Left { limp: connection.link.robot().joint_names(), ..Left::default() });
            let holds = Left::default().words();
            report.notes.retain(|note| *note != holds);
            report.notes.push("torque is off on every joint".to_owned());
        }
        Err(error) => {
            report.outcome = Outcome::Failed;
            report.stop_reason = Some(error.to_string());
        }
    }
}

/// What the referee saw, and the page with plots.
fn conclude(
    args: &PlayArgs,
    report: &mut PlayReport,
    connection: &Connection,
    recorder: &RunRecorder,
) {
    report.notes.extend(patience_words(connection.patience.as_ref()));
    if let Some(world) = &connection.world {
        let verdict = world.lock().verdict();
        let violations = verdict.violations.iter().map(ToString::to_string).collect();
        report.referee = Some(RefereeReport { violations });
    }
    if let Some(path) = &args.html {
        report.html = Some(path.display().to_string());
        let page = plots::page(report, recorder, connection.link.robot());
        if let Err(error) = args.output.write_file(path, page.as_bytes()) {
            report.html = None;
            report.notes.push(error.to_string());
            if report.outcome == Outcome::Done {
                report.outcome = Outcome::DoneWithLoss;
            }
        }
    }
}
