//! `live`: a robot does now what a body does. The whole job, in order.

use super::address::Address;
use super::calibrated::CalibrationArg;
use super::connect::{Connection, connect};
use super::play::{self, RunRecorder};
use super::report::{JointReport, Outcome, PlayReport, RefereeReport};
use super::signals::Signals;
use super::source::{self, robot_model};
use super::{Output, Remarks};
use crate::control::{self, Input, Mirror, Settings, StopReason};
use crate::error::Error;
use crate::mocap::retarget::{self, Online};
use crate::motion::Trend;
use crate::robot::preflight::{Accept, Preflight, preflight};
use crate::time::Instant;
use clap::Args;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

mod performer;
mod report;

use performer::Performer;
pub use report::{LiveJoint, LiveReport};

/// Arguments of `live`.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Example:\n  \
    gaitway live --from file:walk --robot op3 --bus sim --for 10\n\n\
    The robot first goes to the first pose at 30 % of its speed; then it follows. Ctrl-C, or q and \
    Enter, brings it to rest; it holds there.")]
pub struct LiveArgs {
    /// Whom to follow: file:MOTION, a capture (.bvh) or action performed as if somebody did it now
    #[arg(long, value_name = "SOURCE")]
    from: String,
    /// Robot by name, or path of its file (see `gaitway profile list`)
    #[arg(long)]
    robot: String,
    /// Where the robot is, as for `play`
    #[arg(long, value_name = "BUS", required = true)]
    bus: Vec<Address>,
    /// Cycles per second [default: the robot file's]
    #[arg(long, value_name = "HZ", value_parser = play::rate, allow_negative_numbers = true)]
    rate: Option<f64>,
    /// Follow for this time, then come to rest, s
    #[arg(long = "for", value_name = "S", value_parser = seconds, allow_negative_numbers = true)]
    duration_s: Option<f64>,
    /// Record goals and measured states to this file
    #[arg(long, value_name = "FILE.mcap")]
    record: Option<PathBuf>,
    /// Move servos whose firmware the profile was not checked against
    #[arg(long)]
    accept_firmware: bool,
    /// Check everything, write nothing
    #[arg(long)]
    dry_run: bool,
    /// Seed of the virtual robot
    #[arg(long, default_value_t = 0)]
    seed: u64,
    #[command(flatten)]
    calibration: CalibrationArg,
    #[command(flatten)]
    output: Output,
}

/// Reads `--for`: `10` or `10s`.
fn seconds(text: &str) -> Result<f64, String> {
    let number = text.strip_suffix('s').unwrap_or(text);
    let seconds: f64 = number.parse().map_err(|_| "not a number of seconds".to_owned())?;
    if (0.1..=86_400.0).contains(&seconds) { Ok(seconds) } else { Err("0.1 to 86400 s".to_owned()) }
}

/// Runs `live`; the exit code.
///
/// # Errors
/// A report file that cannot be written. A refusal is a report, not an error.
pub fn run(args: &LiveArgs, remarks: Remarks) -> Result<i32, Error> {
    let signals = Signals::listen().map_err(|e| Error::new(format!("no signals: {e}")))?;
    let mut report = LiveReport::new(PlayReport::new(
        &args.from,
        &args.robot,
        args.bus.iter().map(ToString::to_string).collect(),
    ));
    report.run.dry_run = args.dry_run;
    if let Err(error) = live_into(args, remarks, &signals, &mut report) {
        report.run.outcome = Outcome::Refused;
        report.run.stop_reason = Some(error.to_string());
    }
    args.output.report(&report, &report.text(remarks.quiet))?;
    let asked = report.run.stop_reason.as_deref() == Some(StopReason::Asked.to_string().as_str());
    Ok(match signals.first() {
        Some(number) if asked => 128 + number,
        _ => report.run.outcome.exit_code(),
    })
}

fn live_into(
    args: &LiveArgs,
    remarks: Remarks,
    signals: &Signals,
    report: &mut LiveReport,
) -> Result<(), Error> {
    args.output.check_files(&[&args.record])?;
    let (robot, calibration) = args.calibration.load(&args.robot, &args.bus)?;
    let run = &mut report.run;
    run.calibration = calibration.map(|path| path.display().to_string());
    run.robot.clone_from(&robot.name);
    let Some(motion) = args.from.strip_prefix("file:") else {
        return Err(Error::new("not a source I can follow")
            .at("--from")
            .got(args.from.clone())
            .allowed("file:MOTION, e.g. file:walk or file:dance.bvh"));
    };
    let (capture, origin) = source::body_motion(motion, None)?;
    run.source = origin;
    run.notes.extend(capture.notes.iter().cloned());
    report.worn = capture.tracked;
    let rate_hz = args.rate.unwrap_or(robot.file.rate_hz);
    run.cycle_hz = rate_hz;
    let settings = Settings::at_rate(rate_hz);
    let model = robot_model(&robot.file, &robot);
    let mut connection = connect(robot, &args.bus, args.seed)?;
    let accept = Accept { firmware: args.accept_firmware, eeprom: false };
    let found = preflight(&mut connection.link, settings.period, accept)?;
    run.wire_limit_hz = Some(found.wire_limit_hz);
    run.bus_load = found.bus_load;
    run.notes.extend(found.lines.iter().map(ToString::to_string));
    run.notes.extend(found.notes.iter().cloned());
    let tracked = capture.tracked;
    let retargeting = retarget::Settings::default();
    let mut online = Online::new(&model, &tracked, &found.start_rad, &retargeting)?;
    run.notes.extend(online.notes().iter().cloned());
    if args.dry_run {
        run.outcome = Outcome::Done;
        return Ok(());
    }
    if play::stopped_before_torque(signals, run) {
        return Ok(());
    }
    let mut performer = Performer::new(capture, args.duration_s);
    let mut trend = Trend::default();
    let mut began: Option<Instant> = None;
    let mut before_s: Option<f64> = None;
    let mut newest = move |now: Instant, approaching: bool| {
        let now_s = now.seconds_since(*began.get_or_insert(now));
        let Some(pose) = performer.pose(now_s, approaching) else { return Input::End };
        let dt_s = before_s.map_or(0.0, |before_s| now_s - before_s);
        before_s = Some(now_s);
        trend.push(now_s, online.pose(&pose, dt_s));
        trend.target(now_s).map_or(Input::Nothing, Input::Pose)
    };
    mirror(args, remarks, signals, report, &mut connection, &found, settings, &mut newest)
}

#[allow(clippy::too_many_arguments)]
fn mirror(
    args: &LiveArgs,
    remarks: Remarks,
    signals: &Signals,
    report: &mut LiveReport,
    connection: &mut Connection,
    found: &Preflight,
    settings: Settings,
    newest: &mut control::mirror::Source<'_>,
) -> Result<(), Error> {
    // Once torque is on, nothing may keep the loop from its first cycle: the file comes before.
    let force = args.output.force();
    let mut recorder =
        RunRecorder::begin(args.record.as_deref(), force, false, connection, &args.from)?;
    let armed = match control::arm::arm(&mut connection.link, found) {
        Ok(armed) => armed,
        Err(error) => {
            recorder.discard();
            return Err(error);
        }
    };
    let quit = said_q();
    remarks.say("following; Ctrl-C, or q and Enter, brings the robot to rest");
    let limits = connection.link.robot().limits();
    let mut mirror = Mirror::new(newest, &found.start_rad, limits);
    let asked = || signals.first().is_some() || quit.load(Ordering::Relaxed);
    let meter = super::progress::Meter::default();
    let sink = &mut recorder.metered(meter);
    let run = control::stream(&mut connection.link, armed, &mut mirror, settings, sink, &asked);
    describe_joints(report, connection, &mirror);
    report.describe(&mirror, settings);
    play::describe_run(&mut report.run, &run);
    report.run.notes.push("torque stays on: the joints hold where they are".to_owned());
    recorder.finish(&mut report.run, connection);
    if let Some(world) = &connection.world {
        let verdict = world.lock().verdict();
        let violations = verdict.violations.iter().map(ToString::to_string).collect();
        report.run.referee = Some(RefereeReport { violations });
    }
    Ok(())
}

/// True once somebody typed q at the terminal.
fn said_q() -> Arc<AtomicBool> {
    let said = Arc::new(AtomicBool::new(false));
    if rustix::termios::isatty(rustix::stdio::stdin()) {
        let flag = Arc::clone(&said);
        // The thread waits for a line until the process ends; nothing depends on it.
        std::thread::spawn(move || {
            let lines = std::io::stdin().lines().map_while(Result::ok);
            if lines.into_iter().any(|line| line.trim().eq_ignore_ascii_case("q")) {
                flag.store(true, Ordering::Relaxed);
            }
        });
    }
    said
}

fn describe_joints(report: &mut LiveReport, connection: &Connection, mirror: &Mirror<'_>) {
    let (velocity, acceleration) = mirror.peaks();
    for (index, joint) in connection.link.robot().joints.iter().enumerate() {
        report.run.joints.push(JointReport {
            name: joint.name.clone(),
            range_rad: None,
            peak_velocity_rad_s: velocity[index],
            peak_acceleration_rad_s2: acceleration[index],
            peak_jerk_rad_s3: 0.0,
            limit_velocity_rad_s: joint.limits.velocity_rad_s(),
            limit_acceleration_rad_s2: joint.limits.acceleration_rad_s2(),
            tracking_rms_rad: None,
            start_velocity_rad_s: 0.0,
            end_velocity_rad_s: 0.0,
            clipped_samples: 0,
            clipped_share: 0.0,
            at_limit_share: 0.0,
            missed_reads: 0,
        });
        let limited_samples = mirror.tally().limited_samples[index];
        report.limited.push(LiveJoint { name: joint.name.clone(), limited_samples });
    }
}
