//! `live`: a robot does now what a body does. The whole job, in order.

use super::calibrated::CalibrationArg;
use super::duration::duration;
use super::operator::Operator;
use super::play;
use super::signals::Signals;
use super::{Deed, Output, Remarks};
use crate::body::worn::Movement;
use crate::control::{self, Input, Mirror, Settings, inject, net};
use crate::error::Error;
use crate::job::model::robot_model;
use crate::job::observer::Meter;
use crate::job::play::describe_virtual;
use crate::job::recorder::RunRecorder;
use crate::job::report::{JointReport, Outcome, PlayReport};
use crate::job::source;
use crate::mocap::retarget::{self, Online};
use crate::motion::Trend;
use crate::rig::Address;
use crate::rig::{Connection, connect};
use crate::robot::preflight::{Accept, Preflight, preflight};
use crate::time::{Duration, Instant};
use clap::{Args, ValueEnum};
use std::path::{Path, PathBuf};

mod performer;
mod report;
mod table;
mod worn;

use performer::Performer;
pub use report::{BodyReport, LiveJoint, LiveReport, MountReport};

/// Arguments of `live`.
#[derive(Clone, Debug, Args)]
#[command(after_help = "\
SOURCE is one of:
  SEGMENT=imu:PROFILE@serial:/dev/ttyUSB0   a sensor on a segment of the body; as many as are worn
  imu:slimevr@udp:0.0.0.0:6969              SlimeVR trackers of the network; --wear says which is
                                            where, and only those are heard
  replay:FILE.mcap                          sensors that were recorded, as if they spoke now
  file:MOTION                               a capture (.bvh) or actions, as if somebody did them now
SEGMENT: pelvis, torso, head, left_upper_arm, left_forearm, left_thigh, left_shank, left_foot, and
right_ ones. What is not worn is at rest, and its joints of the robot stay where they are.

Sensors are calibrated first, in words at the terminal: N pose, T pose, and the movements of --moves.
The robot then goes to the body's pose at 30 % of its speed, and follows. Ctrl-C, or q and Enter,
brings it to rest; it holds there. r and Enter, in N pose, mends headings that drifted.

Examples:
  gaitway live --from file:walk --robot op3 --bus sim --for 10
  gaitway live --from right_upper_arm=imu:bno08x-rvc@/dev/ttyUSB0 \\
    right_forearm=imu:bno08x-rvc@/dev/ttyUSB1 --robot op3 --bus serial:/dev/ttyUSB2
  gaitway live --wear /tmp/body/wear.toml --dry-run     # joint angles, no robot")]
pub struct LiveArgs {
    /// Whom to follow
    #[arg(long, value_name = "SOURCE", num_args = 1.., required_unless_present = "wear")]
    from: Vec<String>,
    /// Which segment wears which sensor: SEGMENT=SENSOR, or a file of those
    #[arg(long, value_name = "SEGMENT=SENSOR|FILE.toml", num_args = 1..)]
    wear: Vec<String>,
    /// Robot by name, or path of its file (see `gaitway profile list`)
    #[arg(long, required_unless_present = "dry_run")]
    robot: Option<String>,
    /// Where the robot is, as for `play`
    #[arg(long, value_name = "BUS", required_unless_present = "dry_run")]
    bus: Vec<Address>,
    /// Cycles per second [default: the robot file's]
    #[arg(long, value_name = "HZ", value_parser = play::rate, allow_negative_numbers = true)]
    rate: Option<f64>,
    /// Follow for this time, then come to rest
    #[arg(long = "for", value_name = "TIME", value_parser = follow_time, allow_negative_numbers = true)]
    time: Option<Duration>,
    /// Calibration of the body: taken up if the file is there (N pose finds the headings), else
    /// made and kept there
    #[arg(long, value_name = "FILE.toml")]
    calibration_body: Option<PathBuf>,
    /// Make the calibration of the body anew, and replace the file
    #[arg(long, requires = "calibration_body")]
    recalibrate: bool,
    /// Who wears the sensors; kept with the calibration of the body
    #[arg(long, value_name = "NAME", default_value = "", hide_default_value = true)]
    subject: String,
    /// Begin N pose after this time, instead of with Enter [without a terminal: 3s]
    #[arg(long, value_name = "TIME", value_parser = duration)]
    n_pose_after: Option<Duration>,
    /// Do not ask for T pose
    #[arg(long)]
    no_t_pose: bool,
    /// Movements that tell headings better than straps do
    #[arg(long, value_name = "MOVES", value_delimiter = ',')]
    moves: Vec<MoveArg>,
    /// Tell headings from the magnetic field where there is one (indoors rather not)
    #[arg(long)]
    magnetometer: bool,
    /// Record goals, measured states and the samples of all sensors to this file
    #[arg(long, value_name = "FILE.mcap")]
    record: Option<PathBuf>,
    /// Move servos whose firmware the profile was not checked against
    #[arg(long)]
    accept_firmware: bool,
    /// Write nothing to the robot. With sensors: show the joint angles of the body, with or
    /// without a robot
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

/// Movements as they are typed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum MoveArg {
    /// Bow: pelvis, torso, head
    Bow,
    /// Sit down and stand up: thighs
    Sit,
    /// March, elbows bending: forearms, shanks, feet
    March,
    /// Raise both arms: upper arms
    Raise,
}

impl From<MoveArg> for Movement {
    fn from(typed: MoveArg) -> Self {
        match typed {
            MoveArg::Bow => Self::Bow,
            MoveArg::Sit => Self::SitToStand,
            MoveArg::March => Self::Bend,
            MoveArg::Raise => Self::RaiseArms,
        }
    }
}

/// Reads `--for`: from a tenth of a second to a day.
fn follow_time(text: &str) -> Result<Duration, String> {
    let time = duration(text)?;
    let allowed = Duration::from_millis(100)..=Duration::from_secs(86_400);
    if allowed.contains(&time) { Ok(time) } else { Err("0.1 to 86400 s".to_owned()) }
}

impl LiveArgs {
    /// Whom to follow, as it was typed.
    fn motion(&self) -> String {
        let typed = self.from.iter().chain(&self.wear).map(String::as_str);
        typed.collect::<Vec<_>>().join(" ")
    }

    /// Fails if what is followed would be written over, also by a report of a refusal.
    fn check_read_files(&self) -> Result<(), Error> {
        let recording: Vec<&Path> = self.record.as_deref().into_iter().collect();
        let read = self
            .from
            .iter()
            .filter_map(|from| from.strip_prefix("replay:").or_else(|| from.strip_prefix("file:")));
        read.map(Path::new).try_for_each(|file| self.output.check_apart(file, &recording))
    }
}

/// What the whole command shares.
struct Job<'a> {
    args: &'a LiveArgs,
    remarks: Remarks,
    operator: &'a Operator,
    report: LiveReport,
}

/// Runs `live`; the exit code.
///
/// # Errors
/// A report file that cannot be written, or an output that is what is followed. A refusal is a report, not an error.
pub fn run(args: &LiveArgs, remarks: Remarks) -> Result<i32, Error> {
    args.check_read_files()?;
    let signals = Signals::listen().map_err(|e| Error::new(format!("no signals: {e}")))?;
    let mut report = LiveReport::new(PlayReport::new(
        &args.motion(),
        args.robot.as_deref().unwrap_or("no robot"),
        args.bus.iter().map(ToString::to_string).collect(),
    ));
    report.run.dry_run = args.dry_run;
    let operator = Operator::listen(signals.clone());
    let mut job = Job { args, remarks, operator: &operator, report };
    match net::catch(|| job.live()) {
        Ok(Ok(())) => {}
        Ok(Err(error)) => {
            job.report.run.outcome = Outcome::Refused;
            job.report.run.stop_reason = Some(error.to_string());
        }
        Err(words) => job.report.run.describe_broken(&words),
    }
    let report = &job.report;
    let code = report.run.exit_code(signals.first());
    let deed = if args.dry_run { Deed::Look } else { Deed::Motion };
    Ok(args.output.conclude(report, &report.text(remarks.quiet), deed, code))
}

/// A robot that was looked at and not touched.
struct Ready {
    connection: Connection,
    found: Preflight,
    settings: Settings,
}

impl Job<'_> {
    fn live(&mut self) -> Result<(), Error> {
        let args = self.args;
        args.output.check_files(&[&args.record])?;
        match args.from.as_slice() {
            [one] if one.starts_with("file:") => self.perform(one.trim_start_matches("file:")),
            _ => self.follow_sensors(),
        }
    }

    /// Connects to the robot and looks at it; `None` if none was named.
    fn robot(&mut self) -> Result<Option<Ready>, Error> {
        let args = self.args;
        let run = &mut self.report.run;
        let Some(name) = &args.robot else { return Ok(None) };
        let (robot, calibration) = args.calibration.load(name, &args.bus)?;
        run.calibration = calibration.map(|path| path.display().to_string());
        run.robot.clone_from(&robot.name);
        if args.bus.is_empty() {
            return Ok(None);
        }
        let rate_hz = args.rate.unwrap_or(robot.file.rate_hz);
        run.cycle_hz = rate_hz;
        let settings = Settings::at_rate(rate_hz);
        let mut connection = connect(robot, &args.bus, args.seed)?;
        let found = look(args, &mut connection, settings)?;
        run.wire_limit_hz = Some(found.wire_limit_hz);
        run.bus_load = found.bus_load;
        run.notes.extend(found.lines.iter().map(ToString::to_string));
        run.notes.extend(found.notes.iter().cloned());
        Ok(Some(Ready { connection, found, settings }))
    }

    /// Follows a capture or actions that somebody performs now.
    fn perform(&mut self, motion: &str) -> Result<(), Error> {
        let (capture, origin) = source::body_motion(motion, None)?;
        self.report.run.source = origin;
        self.report.run.notes.extend(capture.notes.iter().cloned());
        self.report.worn = capture.tracked;
        let Some(mut ready) = self.robot()? else {
            return Err(Error::new("which robot, and where?")
                .remedy("add --robot and --bus; only sensors are shown without"));
        };
        let robot = ready.connection.link.robot().clone();
        let model = robot_model(&robot.file, &robot);
        let settings = retarget::Settings::default();
        let mut online = Online::new(&model, &capture.tracked, &ready.found.start_rad, &settings)?;
        self.report.run.notes.extend(online.notes().iter().cloned());
        if self.args.dry_run {
            self.report.run.outcome = Outcome::Done;
            return Ok(());
        }
        let longest_s = self.args.time.map(|time| time.as_secs_f64());
        let mut performer = Performer::new(capture, longest_s);
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
        let recorder = self.recorder(&ready.connection)?;
        let recorder = self.mirror(&mut ready, &mut newest, recorder)?;
        if let Some(mut recorder) = recorder {
            recorder.finish(&mut self.report.run, &ready.connection);
        }
        Ok(())
    }

    /// Once torque is on, nothing may keep the loop from its first cycle: the file comes before.
    fn recorder(&self, connection: &Connection) -> Result<RunRecorder, Error> {
        let (path, force) = (self.args.record.as_deref(), self.args.output.force());
        RunRecorder::begin(path, force, false, connection, &self.args.motion())
    }

    /// The same, with room for the samples of many sensors.
    fn recorder_for_sensors(&self, connection: &Connection) -> Result<RunRecorder, Error> {
        let (path, force) = (self.args.record.as_deref(), self.args.output.force());
        RunRecorder::begin_with_sensors(path, force, connection, &self.args.motion())
    }

    /// Lets the robot follow until the source ends or somebody stops it. The recorder is given back
    /// unless nothing was played.
    fn mirror(
        &mut self,
        ready: &mut Ready,
        newest: &mut control::mirror::Source<'_>,
        mut recorder: RunRecorder,
    ) -> Result<Option<RunRecorder>, Error> {
        let Ready { connection, found, settings } = ready;
        let limits = connection.link.robot().limits();
        let mut mirror = Mirror::new(newest, &found.start_rad, limits);
        let remarks = self.remarks;
        let performed = control::perform(
            &mut connection.link,
            found,
            &mut mirror,
            *settings,
            &mut recorder.metered(Meter::default()),
            &|| self.operator.wants_to_stop(),
            &mut |_| remarks.say("following; Ctrl-C, or q and Enter, brings the robot to rest"),
        );
        let performed = match performed {
            Ok(performed) => performed,
            Err(error) => {
                recorder.discard();
                return Err(error);
            }
        };
        describe_joints(&mut self.report, connection, &mirror);
        self.report.describe(&mirror, *settings);
        if !self.report.run.describe_performance(&performed) {
            self.report.run.joints.clear();
            recorder.discard();
            return Ok(None);
        }
        describe_virtual(&mut self.report.run, connection);
        Ok(Some(recorder))
    }
}

/// Looks at every servo, writes nothing.
fn look(
    args: &LiveArgs,
    connection: &mut Connection,
    settings: Settings,
) -> Result<Preflight, Error> {
    inject::point("preflight", 0);
    let accept = Accept { firmware: args.accept_firmware, eeprom: false };
    preflight(&mut connection.link, settings.period, accept)
}

fn describe_joints(report: &mut LiveReport, connection: &Connection, mirror: &Mirror<'_>) {
    let (velocity, acceleration) = mirror.peaks();
    for (index, joint) in connection.link.robot().joints.iter().enumerate() {
        report.run.joints.push(JointReport {
            peak_velocity_rad_s: velocity[index],
            peak_acceleration_rad_s2: acceleration[index],
            ..JointReport::of(joint)
        });
        let limited_samples = mirror.tally().limited_samples[index];
        report.limited.push(LiveJoint { name: joint.name.clone(), limited_samples });
    }
}
