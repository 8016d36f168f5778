//! What a job that moved joints tells: one set of figures, for text, JSON and pages alike.

use super::source::{RobotMotion, Source};
use super::weight::{Fall, Meeting, Witness};
use crate::control::{BalanceFigures, FlightCycle, Left, Performance, Run, StopReason};
pub use crate::error::counted;
use crate::error::{Error, ErrorKind};
use crate::mocap::retarget::TrunkLean;
use crate::motion::{Because, Retimed};
use crate::recording::crc32;
use crate::robot::preflight::Preflight;
use crate::robot::{Joint, Robot};
use serde::Serialize;
use std::collections::BTreeSet;
use std::fmt;
use std::path::Path;

pub use crate::control::{Exception, Stop, StopCode};
pub use crate::retarget::BodyFigures;
pub use crate::robot::preflight::LINE_SHARE;

/// How a command ended; its exit code.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// All of it.
    Done,
    /// All of it, but something received was not stored, or a tolerance is missed.
    DoneWithLoss,
    /// Nothing moved: the answer was no.
    Refused,
    /// Stopped before its end.
    Stopped,
    /// Something broke.
    Failed,
}

impl Outcome {
    /// How a motion ended that was streamed.
    #[must_use]
    pub const fn of(stop: Option<&StopReason>) -> Self {
        match stop {
            None => Self::Done,
            // The program's own mistakes.
            Some(StopReason::Refused { .. } | StopReason::Broke { .. }) => Self::Failed,
            Some(_) => Self::Stopped,
        }
    }

    /// As a person reads it.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Done => "done",
            Self::DoneWithLoss => "done, with loss",
            Self::Refused => "refused",
            Self::Stopped => "stopped",
            Self::Failed => "failed",
        }
    }
}

/// What is told of a job that came to nothing.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CameToNothing {
    /// Stopped, failed if the program broke, else refused.
    pub outcome: Outcome,
    /// Why, as a person reads it.
    pub stop_reason: String,
    /// Why, for a program, if it was refused.
    pub refusal: Option<ErrorKind>,
}

impl CameToNothing {
    /// Because of this.
    #[must_use]
    pub fn of(error: &Error) -> Self {
        let outcome = match error.kind {
            ErrorKind::Stopped => Outcome::Stopped,
            ErrorKind::Broke => Outcome::Failed,
            _ => Outcome::Refused,
        };
        let refusal = (outcome == Outcome::Refused).then_some(error.kind);
        Self { outcome, stop_reason: error.to_string(), refusal }
    }
}

/// One joint of a played motion.
#[derive(Clone, Debug, Serialize)]
pub struct JointReport {
    /// Joint name.
    pub name: String,
    /// Lowest and highest measured angle, rad.
    pub range_rad: Option<[f64; 2]>,
    /// Commanded, rad/s.
    pub peak_velocity_rad_s: f64,
    /// Commanded, rad/s².
    pub peak_acceleration_rad_s2: f64,
    /// Commanded, rad/s³; reported, not limited.
    pub peak_jerk_rad_s3: f64,
    /// The robot's limit, rad/s.
    pub limit_velocity_rad_s: f64,
    /// The robot's limit, rad/s².
    pub limit_acceleration_rad_s2: f64,
    /// Root mean square of goal minus present at the same read, rad.
    pub tracking_rms_rad: Option<f64>,
    /// Commanded speed at the first moment, rad/s.
    pub start_velocity_rad_s: f64,
    /// Commanded speed at the last moment, rad/s.
    pub end_velocity_rad_s: f64,
    /// Poses that saturation moved by more than 0.01 rad.
    pub clipped_samples: usize,
    /// The same as a share of all poses.
    pub clipped_share: f64,
    /// Share of poses in which the fit holds the joint at its limit: what the person does lies
    /// beyond it, and other joints make up for it as well as they can.
    pub at_limit_share: f64,
    /// Cycles without feedback.
    pub missed_reads: u64,
}

impl JointReport {
    /// A joint of which nothing is known yet but its limits.
    #[must_use]
    pub fn of(joint: &Joint) -> Self {
        Self {
            name: joint.name.clone(),
            range_rad: None,
            peak_velocity_rad_s: 0.0,
            peak_acceleration_rad_s2: 0.0,
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
        }
    }
}

impl JointReport {
    /// Takes up a later performance; of so many cycles were this and that.
    fn take_up(&mut self, later: &Self, [cycles, more]: [u64; 2]) {
        self.range_rad = match (self.range_rad, later.range_rad) {
            (Some([low, high]), Some([lower, higher])) => Some([low.min(lower), high.max(higher)]),
            (one, other) => one.or(other),
        };
        let all = (cycles + more) as f64;
        self.tracking_rms_rad = match (self.tracking_rms_rad, later.tracking_rms_rad) {
            (Some(one), Some(other)) if all > 0.0 => {
                Some(((one * one * cycles as f64 + other * other * more as f64) / all).sqrt())
            }
            (one, other) => one.or(other),
        };
        self.peak_velocity_rad_s = self.peak_velocity_rad_s.max(later.peak_velocity_rad_s);
        self.peak_acceleration_rad_s2 =
            self.peak_acceleration_rad_s2.max(later.peak_acceleration_rad_s2);
        self.missed_reads += later.missed_reads;
    }
}

/// What the virtual robot's referee saw.
#[derive(Clone, Debug, Serialize)]
pub struct RefereeReport {
    /// Broken rules, in words; empty is right.
    pub violations: Vec<String>,
    /// What the rules say that were broken.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub rules: Vec<String>,
}

/// A profile of the user's own that a robot is made of.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct OwnProfile {
    /// Its name.
    pub name: String,
    /// Its file.
    pub file: String,
    /// CRC-32 of the file, in hexadecimal digits: whether two runs used the same.
    pub crc32: String,
}

impl OwnProfile {
    /// Those that a robot is made of, its own file among them.
    #[must_use]
    pub fn of(robot: &Robot) -> Vec<Self> {
        let file = robot
            .file
            .origin
            .as_ref()
            .map(|origin| Self::new(&robot.name, &origin.path, &origin.text));
        let mut own = Self::named(robot.file.joints.iter().map(|joint| joint.servo.as_str()));
        own.extend(file);
        own
    }

    /// Those of these names, each once; shipped ones are left out.
    #[must_use]
    pub fn named<'a>(names: impl IntoIterator<Item = &'a str>) -> Vec<Self> {
        let names: BTreeSet<&str> = names.into_iter().collect();
        let own = names.into_iter().filter_map(gaitway_profiles::own_file);
        own.map(|own| Self::new(own.name(), own.path(), own.text().unwrap_or_default())).collect()
    }

    fn new(name: &str, path: &Path, text: &str) -> Self {
        Self {
            name: name.to_owned(),
            file: path.display().to_string(),
            crc32: format!("{:08x}", crc32(text.as_bytes())),
        }
    }
}

impl fmt::Display for OwnProfile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {} (CRC-32 {})", self.name, self.file, self.crc32)
    }
}

/// Everything `play` reports.
#[derive(Clone, Debug, Serialize)]
pub struct PlayReport {
    /// How it ended.
    pub outcome: Outcome,
    /// Why, unless done.
    pub stop_reason: Option<String>,
    /// What kind of refusal it was; null unless nothing was moved because of one.
    pub refusal: Option<ErrorKind>,
    /// The same as data; null for a motion that was refused, or done.
    pub stop: Option<Stop>,
    /// Where goals could not be led to rest along the checked path.
    pub exceptions: Vec<Exception>,
    /// How the robot was left, as far as it said; null if nothing was commanded.
    pub left: Option<Left>,
    /// The last cycles before a stop, at most fifty.
    pub flight: Vec<FlightCycle>,
    /// Motion as asked for.
    pub motion: String,
    /// Robot name.
    pub robot: String,
    /// Buses as asked for.
    pub bus: Vec<String>,
    /// True if nothing was written.
    pub dry_run: bool,
    /// Cycles run.
    pub cycles: u64,
    /// Cycles skipped or with feedback of a joint missing.
    pub missed_cycles: u64,
    /// Cycles that began late.
    pub late_cycles: u64,
    /// Rate asked for, Hz.
    pub cycle_hz: f64,
    /// Highest rate the line carries, by computation, Hz.
    pub wire_limit_hz: Option<f64>,
    /// Share of the time the busiest line was busy.
    pub bus_load: f64,
    /// From the first to the last cycle, s; of several performances the sum.
    pub duration_s: f64,
    /// The motion was stretched in time by this factor.
    pub retime_factor: f64,
    /// Joint that asked for it.
    pub retime_joint: Option<String>,
    /// Which limit of that joint: `velocity` or `acceleration`.
    pub retime_limit: Option<String>,
    /// The clip's clock ran from 0 to 1 in this time, s.
    pub ease_in_s: f64,
    /// The clip's clock ran from 1 to 0 in this time, s.
    pub ease_out_s: f64,
    /// Transition from where the robot stood, s.
    pub approach_s: f64,
    /// Per joint, in the robot's order.
    pub joints: Vec<JointReport>,
    /// Highest over all joints, rad/s.
    pub max_start_velocity_rad_s: f64,
    /// Highest over all joints, rad/s.
    pub max_end_velocity_rad_s: f64,
    /// Degrees Celsius.
    pub max_temperature_c: Option<f64>,
    /// V.
    pub min_voltage_v: Option<f64>,
    /// A.
    pub max_current_a: Option<f64>,
    /// Recording written.
    pub recording: Option<String>,
    /// Samples that did not reach the recording.
    pub recording_lost: u64,
    /// Page written.
    pub html: Option<String>,
    /// Calibration used; null: the robot file's own zeros.
    pub calibration: Option<String>,
    /// Profiles of the user's own that the robot is made of.
    pub profiles: Vec<OwnProfile>,
    /// The motion as it came in.
    pub source: Source,
    /// How the motion's trunk leans against its pelvis, which the robot cannot show; null if it has a
    /// waist, or the motion is in its joints already.
    pub trunk_lean_lost: Option<TrunkLean>,
    /// What the motion does to all of the robot; null if nothing was planned.
    pub metrics: Option<BodyFigures>,
    /// Only with a virtual robot of this process.
    pub referee: Option<RefereeReport>,
    /// Only of a virtual robot with weight.
    #[serde(flatten)]
    pub physics: Option<PhysicsReport>,
    /// What balancing came to; null if nobody asked for it.
    pub balance: Option<BalanceFigures>,
    /// Choices made on the way that a person should know.
    pub notes: Vec<String>,
}

/// What became of a virtual robot with weight.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PhysicsReport {
    /// When it fell, s since torque was on; null if it stayed up.
    pub fell_at_s: Option<f64>,
    /// What touched the floor then that should not; null if nothing did.
    pub fell_on: Option<String>,
    /// Which links met one another until then.
    pub met: Vec<Meeting>,
    /// The page shows where the weight took it, and not where it was to be.
    #[serde(skip)]
    pub is_drawn: bool,
    /// The fall itself.
    #[serde(skip)]
    pub fall: Option<Fall>,
}

impl PhysicsReport {
    /// What a witness saw.
    #[must_use]
    pub fn of(witness: &Witness) -> Self {
        let (fall, met) = (witness.fall(), witness.meetings());
        let (fell_at_s, fell_on) =
            fall.as_ref().map(|fall| (fall.at_s, fall.touched.clone())).unzip();
        Self { fell_at_s, fell_on: fell_on.flatten(), met, is_drawn: false, fall }
    }
}

impl PlayReport {
    /// A report of nothing yet.
    #[must_use]
    pub fn new(motion: &str, robot: &str, bus: Vec<String>) -> Self {
        Self {
            outcome: Outcome::Refused,
            stop_reason: None,
            refusal: None,
            stop: None,
            exceptions: Vec::new(),
            left: None,
            flight: Vec::new(),
            motion: motion.to_owned(),
            robot: robot.to_owned(),
            bus,
            dry_run: false,
            cycles: 0,
            missed_cycles: 0,
            late_cycles: 0,
            cycle_hz: 0.0,
            wire_limit_hz: None,
            bus_load: 0.0,
            duration_s: 0.0,
            retime_factor: 1.0,
            retime_joint: None,
            retime_limit: None,
            ease_in_s: 0.0,
            ease_out_s: 0.0,
            approach_s: 0.0,
            joints: Vec::new(),
            max_start_velocity_rad_s: 0.0,
            max_end_velocity_rad_s: 0.0,
            max_temperature_c: None,
            min_voltage_v: None,
            max_current_a: None,
            recording: None,
            recording_lost: 0,
            html: None,
            calibration: None,
            profiles: Vec::new(),
            source: Source::default(),
            trunk_lean_lost: None,
            metrics: None,
            physics: None,
            balance: None,
            referee: None,
            notes: Vec::new(),
        }
    }

    /// What came of it, in one line.
    #[must_use]
    pub fn headline(&self) -> String {
        let dry = if self.dry_run { " (dry run: nothing was written)" } else { "" };
        let over = if self.bus.is_empty() { "" } else { " over " };
        let (outcome, buses) = (self.outcome.word(), self.bus.join(", "));
        format!("{outcome}{dry}: {} on {}{over}{buses}", self.motion, self.robot)
    }

    /// Says which motion came in.
    pub(super) fn describe_motion(&mut self, motion: &RobotMotion) {
        self.source = motion.source.clone();
        self.trunk_lean_lost = motion.trunk_lean_lost();
        self.notes.extend(motion.notes.iter().cloned());
    }

    /// Says what was found on the lines before anything was written.
    pub(super) fn describe_preflight(&mut self, found: &Preflight) {
        self.wire_limit_hz = Some(found.wire_limit_hz);
        self.bus_load = found.bus_load;
        self.notes.extend(found.lines.iter().map(ToString::to_string));
        self.notes.extend(found.notes.iter().cloned());
    }

    /// Says why nothing was moved: what was refused, or that somebody wanted to stop.
    pub fn describe_refused(&mut self, error: &Error) {
        if error.kind == ErrorKind::Stopped {
            return self.describe_stopped();
        }
        self.outcome = Outcome::Refused;
        self.refusal = Some(error.kind);
        self.stop_reason = Some(error.to_string());
    }

    /// There is no page, and why; all else is as it was.
    pub fn describe_no_page(&mut self, error: &Error) {
        self.html = None;
        self.notes.push(format!("no page was written: {error}"));
        if self.outcome == Outcome::Done {
            self.outcome = Outcome::DoneWithLoss;
        }
    }

    /// Says that the operator stopped it before torque came on.
    pub fn describe_stopped(&mut self) {
        self.outcome = Outcome::Stopped;
        self.stop_reason = Some(StopReason::Asked.to_string());
        self.stop = Some(Stop::of(StopCode::Asked));
        self.notes.push("stopped before torque came on; nothing moved".to_owned());
    }

    /// Says what came of a performance; true if anything was streamed.
    pub fn describe_performance(&mut self, performance: &Performance) -> bool {
        match performance {
            Performance::Stopped => {
                self.describe_stopped();
                false
            }
            Performance::Ran(run) => {
                self.describe_run(run);
                true
            }
            Performance::Broke { words, notes } => {
                self.outcome = Outcome::Failed;
                let broke = StopReason::Broke { words: words.clone() };
                self.stop_reason = Some(format!("{broke}; the servos hold their last goal"));
                self.stop = Some(Stop::of(StopCode::Broke));
                self.notes.extend(notes.iter().cloned());
                true
            }
        }
    }

    fn describe_run(&mut self, run: &Run) {
        self.outcome = Outcome::of(run.stop.as_ref());
        self.stop_reason = run.stop.as_ref().map(ToString::to_string);
        self.stop.clone_from(&run.stop_data);
        self.exceptions.clone_from(&run.exceptions);
        self.left = Some(run.left.clone());
        if run.stop.is_some() {
            self.flight.clone_from(&run.flight);
        }
        self.cycles = run.tally.cycles;
        self.missed_cycles = run.tally.missed_cycles;
        self.late_cycles = run.tally.late_cycles;
        self.duration_s = run.duration_s;
        self.bus_load = run.bus_load;
        self.notes.extend(run.notes.iter().cloned());
        self.max_temperature_c = run.tally.max_temperature_c;
        self.min_voltage_v = run.tally.min_voltage_v;
        self.max_current_a = run.tally.max_current_a;
        for (joint, tally) in self.joints.iter_mut().zip(&run.tally.joints) {
            let measured = tally.samples > 0;
            joint.range_rad = measured.then_some([tally.lowest_rad, tally.highest_rad]);
            joint.tracking_rms_rad = tally.tracking_rms_rad();
            joint.missed_reads = tally.missed;
        }
    }

    /// Takes up what came of a later performance of the same run: how it ended is how the run ended.
    pub fn take_up(&mut self, later: Self) {
        let greater =
            |one: Option<f64>, other: Option<f64>| one.into_iter().chain(other).reduce(f64::max);
        let least =
            |one: Option<f64>, other: Option<f64>| one.into_iter().chain(other).reduce(f64::min);
        for (joint, other) in self.joints.iter_mut().zip(&later.joints) {
            joint.take_up(other, [self.cycles, later.cycles]);
        }
        self.outcome = later.outcome;
        self.stop_reason = later.stop_reason;
        self.stop = later.stop;
        self.exceptions.extend(later.exceptions);
        self.left = later.left.or(self.left.take());
        self.flight = later.flight;
        self.cycles += later.cycles;
        self.missed_cycles += later.missed_cycles;
        self.late_cycles += later.late_cycles;
        self.duration_s += later.duration_s;
        self.bus_load = self.bus_load.max(later.bus_load);
        self.max_temperature_c = greater(self.max_temperature_c, later.max_temperature_c);
        self.max_current_a = greater(self.max_current_a, later.max_current_a);
        self.min_voltage_v = least(self.min_voltage_v, later.min_voltage_v);
        self.referee = later.referee.or(self.referee.take());
        self.balance = match (self.balance.take(), later.balance) {
            (Some(mut all), Some(later)) => {
                all.take_up(&later);
                Some(all)
            }
            (one, other) => one.or(other),
        };
        let new: Vec<String> =
            later.notes.into_iter().filter(|note| !self.notes.contains(note)).collect();
        self.notes.extend(new);
    }

    /// Says why a run that has moved joints goes no further. They hold.
    pub fn describe_no_further(&mut self, why: impl Into<String>) {
        self.outcome = Outcome::Stopped;
        self.stop_reason = Some(why.into());
    }

    /// Says that the program broke before the loop, or after it.
    pub fn describe_broken(&mut self, words: &str) {
        self.outcome = Outcome::Failed;
        self.stop_reason = Some(format!("the program broke: {words}"));
        self.stop = Some(Stop::of(StopCode::Broke));
    }

    /// Says what was done to the motion's time.
    pub fn describe_retiming(&mut self, retimed: &Retimed) {
        self.retime_factor = retimed.factor;
        let limit = match retimed.because {
            Because::Nothing => return,
            Because::Velocity => "velocity",
            Because::Acceleration => "acceleration",
        };
        self.retime_joint = Some(retimed.joint.1.clone());
        self.retime_limit = Some(limit.to_owned());
    }
}
