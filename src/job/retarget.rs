//! The trajectory a robot would play, as a file, and its figures.

mod bvh;
mod learners;

use super::bodily::{self, Laid};
use super::model::robot_model;
use super::observer::Observer;
use super::page::{RobotScene, page};
use super::pending::unless_stopped;
use super::play::describe_plan;
use super::recorder::{Series, recorded_joint};
use super::report::{Outcome, OwnProfile, PlayReport};
use super::source::joints::BASE_TITLES;
use super::source::{self, MotionOrder, Source};
use crate::draft;
use crate::error::{Error, ErrorKind};
use crate::mocap;
use crate::mocap::anatomy::Capture;
use crate::motion::{Plan, PlanOptions, Setpoint};
use crate::port::{Clock, MonotonicClock};
use crate::recording::{BaseRecord, CycleRecord, JointRecord, Recorder, RunEnd, RunStart};
use crate::retarget::BodyFigures;
use crate::retarget::base::BasePath;
use crate::rigid::Placement;
use crate::robot::Robot;
use crate::table::TableWriter;
use crate::time::Duration;
use std::path::{Path, PathBuf};

pub use learners::LearnerFile;

/// Which motion becomes which file.
#[derive(Clone, Debug, PartialEq)]
pub struct RetargetOrder {
    /// The motion.
    pub motion: MotionOrder,
    /// The robot, by name or path of its file.
    pub robot: String,
    /// Playing speed.
    pub speed: f64,
    /// Slow it until the robot can follow, or refuse it; `None`: slow what a person did.
    pub retime: Option<bool>,
    /// Rows per second; `None`: the robot's rate.
    pub rate_hz: Option<f64>,
    /// The file.
    pub file: PathBuf,
    /// What is written.
    pub kind: TrajectoryFile,
    /// It may replace one that is there.
    pub replace: bool,
    /// The robot hangs on a stand.
    pub hangs: bool,
    /// Nothing is said of a fall that is predicted, but in the figures.
    pub allow_fall: bool,
    /// A page that shows it.
    pub html: Option<PathBuf>,
}

/// From the robot's initial pose through the motion, as it would be played.
///
/// # Errors
/// As for a motion that is played, before a bus is looked for; a wish to stop; a file that cannot be written.
pub fn retarget(order: &RetargetOrder, observer: &dyn Observer) -> Result<PlayReport, Error> {
    let of = order.clone();
    let Retargeted { robot, planned, base, bytes, report, page } =
        unless_stopped(observer, move || Retargeted::of(&of))?;
    match bytes {
        Some(bytes) => draft::write_file(&order.file, order.replace, &bytes)?,
        None => {
            let rate_hz = order.rate_hz.unwrap_or(robot.file.rate_hz);
            record(order, &robot, &planned, base.as_ref(), rate_hz)?;
        }
    }
    if let (Some(path), Some(page)) = (&order.html, page) {
        draft::write_file(path, order.replace, page.as_bytes())?;
    }
    Ok(report)
}

/// A motion on a robot's joints, timed, and what is to be written of it.
struct Retargeted {
    robot: Robot,
    planned: Plan,
    base: Option<BasePath>,
    /// The file; none where it is a recording.
    bytes: Option<Vec<u8>>,
    report: PlayReport,
    page: Option<String>,
}

impl Retargeted {
    fn of(order: &RetargetOrder) -> Result<Self, Error> {
        let robot = Robot::load(&order.robot)?;
        let hung = MotionOrder {
            hangs: order.hangs,
            balanced_at: (order.retime != Some(false)).then_some(order.speed),
            ..order.motion.clone()
        };
        let loaded = source::load(&hung, &robot)?;
        let start_rad: Vec<f64> = robot.joints.iter().map(|joint| joint.initial_rad).collect();
        let options = PlanOptions {
            speed: order.speed,
            retime: order.retime.unwrap_or(loaded.of_person),
            ..PlanOptions::default()
        };
        let laid = bodily::laid(&robot, &start_rad, &loaded, options, order.hangs)?;
        let calm_note = laid.calm_note();
        let Laid { planned, base, figures: metrics, .. } = laid;
        let rate_hz = order.rate_hz.unwrap_or(robot.file.rate_hz);
        let bytes = match order.kind {
            TrajectoryFile::Csv => Some(csv(&planned, base.as_ref(), rate_hz)?),
            TrajectoryFile::Bvh => {
                let model = robot_model(&robot)?;
                let place =
                    |time_s| base.as_ref().map_or(Placement::IDENTITY, |base| base.at(time_s).0);
                let poses: Vec<(Placement, Vec<f64>)> =
                    planned.rows(rate_hz).map(|(time_s, pose)| (place(time_s), pose)).collect();
                Some(mocap::bvh::write(&bvh::of_robot(&model, &poses, rate_hz)).into_bytes())
            }
            TrajectoryFile::Mcap => None,
            TrajectoryFile::Learner(file) => {
                let rate_hz = order.rate_hz.unwrap_or(file.rate_hz());
                let clip = RobotClip::of(&planned, base.as_ref(), &metrics, rate_hz);
                Some(file.bytes(&robot, &clip, rate_hz)?)
            }
        };
        let mut report = PlayReport::new(&loaded.name, &robot.name, Vec::new());
        report.outcome = Outcome::Done;
        report.profiles = OwnProfile::of(&robot);
        report.describe_motion(&loaded);
        let scene = order.html.as_ref().map(|_| {
            let series = Series::planned(&planned, rate_hz);
            let (robot, speed, base) = (&robot, order.speed, base.as_ref());
            let (motion, planned, metrics, series) = (&loaded, &planned, &metrics, &series);
            RobotScene { robot, motion, planned, speed, base, metrics, series }.view()
        });
        report.notes.extend(calm_note);
        report.notes.extend(bodily::fall_note(&metrics).filter(|_| !order.allow_fall));
        report.notes.extend(bodily::soft_note(&metrics));
        report.notes.extend(bodily::weak_note(&metrics));
        report.metrics = Some(metrics);
        report.duration_s = planned.trajectory.duration_s();
        describe_plan(&mut report, &robot, &planned, &loaded);
        let begins_s =
            format!("{:.2} s of transition from the robot's initial pose", report.approach_s);
        report.notes.push(match order.kind {
            TrajectoryFile::Learner(_) => {
                format!("the file has the motion alone, without {begins_s}")
            }
            _ => format!("the file begins with {begins_s}"),
        });
        report.html = order.html.as_ref().map(|path| path.display().to_string());
        let page = scene.map(|scene| page(&report, scene?)).transpose()?;
        Ok(Self { robot, planned, base, bytes, report, page })
    }
}

/// A motion on a robot from its first pose to its last, without the way there.
pub(super) struct RobotClip {
    /// Row by row: where the base is, and the angle of each joint, rad.
    pub rows: Vec<(Placement, Vec<f64>)>,
    /// False if nobody knows where the base goes: it stays where it is.
    pub has_base: bool,
    /// How much slower it is than the person was, at most.
    pub retime_factor: f64,
    /// When the robot would fall, s after the first row.
    pub falls_s: Option<f64>,
}

/// What a person does, as a robot would do it at `rate_hz`.
///
/// # Errors
/// A motion that cannot be transferred.
pub(super) fn robot_clip(
    robot: &Robot,
    name: &str,
    capture: Capture,
    rate_hz: f64,
) -> Result<RobotClip, Error> {
    let order = MotionOrder { balanced_at: Some(1.0), may_fall: true, ..MotionOrder::of(name) };
    let loaded = source::of_person(&order, robot, capture, Source::default(), false)?;
    let start_rad: Vec<f64> = robot.joints.iter().map(|joint| joint.initial_rad).collect();
    let options = PlanOptions { retime: true, ..PlanOptions::default() };
    let Laid { planned, base, figures, .. } =
        bodily::laid(robot, &start_rad, &loaded, options, false)?;
    Ok(RobotClip::of(&planned, base.as_ref(), &figures, rate_hz))
}

impl RobotClip {
    fn of(planned: &Plan, base: Option<&BasePath>, metrics: &BodyFigures, rate_hz: f64) -> Self {
        let (from_s, to_s) = (planned.clip_start_s, planned.clip_start_s + planned.clip_s);
        let count = ((to_s - from_s) * rate_hz).floor() as usize;
        let mut setpoints = vec![Setpoint::default(); planned.trajectory.joints().len()];
        let row = |row: usize| {
            let time_s = from_s + row as f64 / rate_hz;
            planned.trajectory.sample(time_s, &mut setpoints);
            let at = base.map_or(Placement::IDENTITY, |base| base.at(time_s).0);
            (at, setpoints.iter().map(|setpoint| setpoint.position_rad).collect())
        };
        Self {
            rows: (0..=count).map(row).collect(),
            has_base: base.is_some(),
            retime_factor: planned.stretch,
            falls_s: metrics.predicted_fall_s.map(|at_s| (at_s - from_s).max(0.0)),
        }
    }
}

/// What is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TrajectoryFile {
    /// A table.
    Csv,
    /// The robot's own joint tree in motion.
    Bvh,
    /// A recording of goals.
    Mcap,
    /// The motion alone, for those who learn from it.
    Learner(LearnerFile),
}

impl TrajectoryFile {
    /// What a name asks for, and a format if one is named beside it.
    ///
    /// # Errors
    /// Another ending; a format of another ending, or none that there is.
    pub fn of(path: &Path, format: Option<&str>) -> Result<Self, Error> {
        let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
        if let Some(word) = format {
            let known = LearnerFile::ALL.into_iter().find(|file| file.word() == word);
            let file = known.ok_or_else(|| {
                Error::of(ErrorKind::Unknown, "there is no such format").at("--format").none_of(
                    word,
                    LearnerFile::ALL.map(LearnerFile::word),
                    "take one of these",
                )
            })?;
            if ending != file.ending() {
                return Err(Error::new(format!("{word} goes into files of another ending"))
                    .at("-o")
                    .got(path.display().to_string())
                    .allowed(format!("a name that ends in .{}", file.ending())));
            }
            return Ok(Self::Learner(file));
        }
        match ending {
            "csv" => Ok(Self::Csv),
            "bvh" => Ok(Self::Bvh),
            "mcap" => Ok(Self::Mcap),
            "npz" => Ok(Self::Learner(LearnerFile::RobotNpz)),
            _ => Err(Error::of(ErrorKind::Unknown, "this kind of file cannot be written")
                .at("-o")
                .got(path.display().to_string())
                .allowed("a name that ends in .csv, .mcap, .bvh or .npz")),
        }
    }
}

fn csv(planned: &Plan, base: Option<&BasePath>, rate_hz: f64) -> Result<Vec<u8>, Error> {
    let mut out = TableWriter::new(Vec::new());
    let titles = planned.trajectory.joints().iter().map(|joint| format!("{joint}_rad"));
    let of_base = base.iter().flat_map(|_| BASE_TITLES.map(str::to_owned));
    out.row(std::iter::once("time_s".to_owned()).chain(titles).chain(of_base))?;
    for (time_s, pose) in planned.rows(rate_hz) {
        let angles = pose.into_iter().map(|angle_rad| format!("{angle_rad:.9}"));
        let place = base.iter().flat_map(|base| base_cells(base, time_s));
        out.row(std::iter::once(format!("{time_s:.6}")).chain(angles).chain(place))?;
    }
    out.finish()
}

/// Where the base is and which feet stand, in the order of [`BASE_TITLES`].
fn base_cells(base: &BasePath, time_s: f64) -> [String; 9] {
    let (Placement { at_m, turn }, contacts) = base.at(time_s);
    let [x, y, z] = at_m.to_array().map(|metres| format!("{metres:.9}"));
    let [qx, qy, qz, qw] = turn.to_array().map(|part| format!("{part:.9}"));
    let [left, right] = contacts.map(|stands| u8::from(stands).to_string());
    [x, y, z, qw, qx, qy, qz, left, right]
}

/// A recording of goals that nobody was given yet.
fn record(
    order: &RetargetOrder,
    robot: &Robot,
    planned: &Plan,
    base: Option<&BasePath>,
    rate_hz: f64,
) -> Result<(), Error> {
    let start = MonotonicClock.now();
    let run = RunStart {
        robot: robot.name.clone(),
        motion: order.motion.motion.clone(),
        joints: robot.joints.iter().map(recorded_joint).collect(),
        wall_clock_start: std::time::SystemTime::now(),
        monotonic_start: start,
        gaitway_version: env!("CARGO_PKG_VERSION").to_owned(),
        metadata: [("planned".to_owned(), "goals only; nothing was played".to_owned())].into(),
    };
    let recorder = Recorder::create_whole(&order.file, order.replace, run)?;
    let mut end = start;
    for (cycle, (time_s, pose)) in (0..).zip(planned.rows(rate_hz)) {
        end = start + Duration::from_secs_f64(time_s);
        let goal = |goal_rad: f64| JointRecord { goal_rad: Some(goal_rad), ..Default::default() };
        let joints = pose.into_iter().map(goal).collect();
        let base = base.map(|base| {
            let (Placement { at_m, turn }, contacts) = base.at(time_s);
            Box::new(BaseRecord { at_m, turn, contacts })
        });
        recorder.take_patiently(CycleRecord { cycle, at: end, joints, base });
    }
    let (outcome, metadata) = ("done".to_owned(), Default::default());
    let stored = recorder.finish(RunEnd { outcome, stop_reason: None, at: end, metadata });
    match stored.poisoned {
        None => Ok(()),
        Some(cause) => Err(Error::of(ErrorKind::Io, "cannot write the file")
            .at(order.file.display().to_string())
            .got(cause)),
    }
}
