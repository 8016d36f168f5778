//! From a motion as somebody names it to a path over the robot's joints.

pub mod angles_table;
pub mod joints;
pub(super) mod lerobot;
mod opensim;
pub(super) mod recorded;
mod standing;
pub(super) mod untitled;

pub use crate::mocap::files::CaptureOptions;

use super::composition::{GaitChangeReport, InsertReport, compose};
use super::model::robot_model;
use crate::action::{Fits, Inserts, Join, Motion, phrase, vocabulary};
use crate::body::{Proportions, Segment, segment_name};
use crate::clean::artefact::ArtefactKind;
use crate::clean::joints::artefacts;
use crate::error::{Error, ErrorKind, counted};
use crate::mocap::anatomy::Capture;
use crate::mocap::files::{self, CaptureFormat};
use crate::mocap::fit::{self, FitSettings, Fitted};
use crate::mocap::mapping::MappingFile;
use crate::mocap::marker_files;
use crate::mocap::opensim as mocap_opensim;
use crate::mocap::retarget::{self, Retargeted, TrunkLean};
use crate::mocap::siblings::{self, SegmentFrames};
use crate::motion::Path as JointPath;
use crate::retarget::adjust::{self, Adjustable, Adjusting, adjust, touches_itself};
use crate::retarget::limbs::RobotLimbs;
use crate::retarget::toe::Toe;
use crate::retarget::{Footfall, footfall};
use crate::robot::{Joint, Robot, RobotBody};
use gaitway_profiles::{self as profiles, BaseKind};
use serde::Serialize;
use standing::{Asked, balanced};
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

/// Poses per second of an action that somebody performs.
const ACTION_HZ: f64 = 120.0;
/// Fewest and most poses per second of an action that a robot does itself.
const EXACT_HZ: RangeInclusive<f64> = 240.0..=2000.0;
/// How far the spline through these poses may be from the action in between, rad: 0.01 degrees.
const EXACT_RAD: f64 = 1.75e-4;
/// A cubic spline through samples `h` apart of a curve whose jerk is at most `J` and may step is
/// nowhere further from it than this part of `J h^3`. Ours; of a smooth curve it is `5 h^4 / 384`
/// times the fourth derivative (Hall and Meyer, "Optimal error bounds for cubic spline
/// interpolation", 1976).
const SPLINE_ERROR: f64 = 1.0 / 30.0;
/// Stature of the body that performs actions, m.
const ACTION_STATURE_M: f64 = 1.75;

/// Links that give way to one another by more than this are said to do so, rad.
const NOTED_RAD: f64 = 0.02;

/// What a file is by its ending, and a table by its titles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileKind {
    /// Points without bones.
    Markers,
    /// A skeleton in motion that says all of itself.
    Bvh,
    /// A skeleton in motion whose skeleton and rate stand elsewhere.
    Amc,
    /// A table of OpenSim's: joint angles, orientations, forces.
    OpenSim,
    /// A table of joint angles of the body.
    Angles,
    /// Anything else.
    Other,
}

/// What kind of file it is.
#[must_use]
pub fn file_kind(path: &Path) -> FileKind {
    if marker_files::format_of(path).is_some() {
        return FileKind::Markers;
    }
    if mocap_opensim::is_named(path) {
        return FileKind::OpenSim;
    }
    if angles_table::is_named(path) {
        return FileKind::Angles;
    }
    match files::format_of(path) {
        Some(CaptureFormat::Bvh) => FileKind::Bvh,
        Some(CaptureFormat::Amc) => FileKind::Amc,
        None => FileKind::Other,
    }
}

/// Which motion, and how much of it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MotionOrder {
    /// A capture (.bvh, .amc, .mot, .sto), a shipped action, an action file (.toml), several actions
    /// (`walk:6s,wave-r,bow`), a recording (.mcap), a table (.csv: `time_s`, `JOINT_rad`, or Unitree's without titles) or an
    /// episode of a LeRobot dataset (`FOLDER#3`).
    pub motion: String,
    /// Pieces of other actions that are pasted into actions.
    pub inserts: Inserts,
    /// File that says which joint of the capture is which body segment.
    pub mapping: Option<PathBuf>,
    /// What the capture does not say itself.
    pub reading: CaptureOptions,
    /// From this time of the motion, s.
    pub from_s: Option<f64>,
    /// To this time of the motion, s.
    pub to_s: Option<f64>,
    /// Only these joints move; empty: all.
    pub only: Vec<String>,
    /// Left and right are swapped.
    pub mirror: bool,
    /// The robot hangs on a stand: its feet need not stand on anything.
    pub hangs: bool,
    /// How fast it will be played, if it may be moved, out of itself and for a robot's balance, and slowed.
    pub balanced_at: Option<f64>,
    /// A fall is accepted: rather that than a motion whose person waits for the robot's feet.
    pub may_fall: bool,
}

impl MotionOrder {
    /// All of a motion, as it is.
    #[must_use]
    pub fn of(motion: &str) -> Self {
        Self { motion: motion.to_owned(), ..Self::default() }
    }
}

/// The motion as it came in.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Source {
    /// `bvh`, `amc`, `action`, ...
    pub format: String,
    /// Poses read.
    pub frames: usize,
    /// Poses per second.
    pub rate_hz: f64,
    /// Length, s.
    pub duration_s: f64,
    /// What the frames of the body's segments were found from; null unless it is a capture.
    pub segment_frames: Option<SegmentFrames>,
    /// Of actions: changes of gait without a stop.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub changes: Vec<GaitChangeReport>,
    /// Of actions: what was inserted.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub inserts: Vec<InsertReport>,
}

/// A motion on a robot's joints, before it is timed.
#[derive(Clone, Debug)]
pub struct RobotMotion {
    /// What was asked for.
    pub name: String,
    /// The motion as it came in.
    pub source: Source,
    /// Choices made on the way.
    pub notes: Vec<String>,
    only: Vec<String>,
    retargeted: Retargeted,
    /// The person, if it is one whose segments are known.
    person: Option<Capture>,
    /// What the motion says of the robot's feet, at the rate of its samples.
    footfalls: Vec<Footfall>,
    /// Of each sample the time of the motion as it came in, in samples of it; empty if it has its own pace.
    clock: Vec<f64>,
    /// True if a person did it: it is slowed to what the robot can do, unless that is refused. A
    /// trajectory that was made for the robot is slowed only if that is asked for.
    pub of_person: bool,
}

/// Reads the motion and transfers it to the robot's joints.
///
/// # Errors
/// An unreadable or malformed file, a skeleton that is no person, unknown joints in `--only`, a
/// section that is empty.
pub fn load(order: &MotionOrder, robot: &Robot) -> Result<RobotMotion, Error> {
    only(robot, &order.only)?;
    check_inserts(order)?;
    let path = Path::new(&order.motion);
    if let Some(motion) = lerobot::read(&order.motion, robot)? {
        return in_joints(order, robot, &motion);
    }
    let is_markers = !phrase::is_phrase(&order.motion) && marker_files::format_of(path).is_some();
    let is_of_person = is_markers || angles_table::is_named(path);
    if !is_of_person && let Some(motion) = joints::read(path, &robot.joint_names())? {
        return in_joints(order, robot, &motion);
    }
    let exact = phrase::is_phrase(&order.motion);
    let (mut capture, source) = if exact {
        no_mapping(&order.motion, order.mapping.as_deref())?;
        performed(&order.motion, &order.inserts, exact_rate_hz)?
    } else {
        body_motion(&order.motion, order.mapping.as_deref(), &order.reading)?
    };
    if order.mirror {
        capture.mirror();
    }
    cut(&mut capture, order.from_s, order.to_s)?;
    of_person(order, robot, capture, source, exact)
}

/// Transfers what a person does to the robot's joints. `exact` if it was made, and is done as it was made.
///
/// # Errors
/// A motion that cannot be transferred.
pub(super) fn of_person(
    order: &MotionOrder,
    robot: &Robot,
    capture: Capture,
    source: Source,
    exact: bool,
) -> Result<RobotMotion, Error> {
    let mut model = robot_model(robot)?;
    let body = RobotBody::of(&robot.file)?;
    // What was made, and not measured, is done as it was made.
    if let Some(body) = body.as_ref().filter(|_| !exact) {
        let lengths = Proportions::of_stature(capture.stature_m)?;
        model.hands = RobotLimbs::of(&model, body).hands(body, &lengths);
    }
    let initial_rad: Vec<f64> = robot.joints.iter().map(|joint| joint.initial_rad).collect();
    let settings = retarget::Settings { exact, ..retarget::Settings::default() };
    let mut retargeted = retarget::retarget(&capture, &model, &initial_rad, &settings)?;
    let (name, only) = (order.motion.clone(), order.only.clone());
    let pelvis = model.base.iter().find(|segment| **segment == Segment::Pelvis);
    let base = pelvis.or(model.base.first()).copied().unwrap_or(Segment::Pelvis);
    let Capture { poses, tracked, stature_m, rate_hz, .. } = &capture;
    let mut footfalls = footfall::of_person(poses, tracked, *stature_m, *rate_hz, base)?;
    let mut clock = Vec::new();
    if let Some(body) = &body {
        let placed = Placed::of(robot, body, order, exact);
        let stands = !order.hangs && order.only.is_empty();
        let mut found = None;
        if let Some(speed) = order.balanced_at.filter(|_| stands && body.base == BaseKind::Free) {
            let asked = Asked { speed, may_fall: order.may_fall };
            found = balanced(robot, &placed, &capture, &footfalls, asked, &mut retargeted)?;
        }
        if let Some(standing) = found {
            retargeted.notes.push(standing.note);
            (footfalls, clock) = (standing.footfalls, standing.clock);
        } else if !exact
            || order.balanced_at.is_some()
                && touches_itself(&placed.adjusting(*rate_hz, None), &retargeted.positions_rad)
        {
            if stands {
                let lengths = Proportions::of_stature(capture.stature_m)?;
                let toes = Toe::both(&capture.poses, capture.rate_hz, &lengths);
                footfall::plant(&mut footfalls, &toes, capture.rate_hz);
            }
            fit_in(robot, &placed, stands.then_some(&footfalls), &mut retargeted)?;
            let floor = stands && body.base == BaseKind::Free;
            if let Some(speed) = order.balanced_at.filter(|_| !floor && !exact)
                && let Some(times) = standing::in_parts(robot, speed, &mut retargeted)?
            {
                footfalls = footfall::at_times(&footfalls, &times, retargeted.rate_hz);
                clock = times;
            }
        }
    }
    let notes = retargeted.notes.clone();
    let person = Some(capture);
    let of_person = true;
    Ok(RobotMotion { name, source, notes, only, retargeted, person, footfalls, clock, of_person })
}

/// What a person does with the angles of the body copied, joint by joint: what the fit is measured by.
///
/// # Errors
/// As [`of_person`].
pub(super) fn copied(robot: &Robot, name: &str, capture: Capture) -> Result<RobotMotion, Error> {
    let model = robot_model(robot)?;
    let initial_rad: Vec<f64> = robot.joints.iter().map(|joint| joint.initial_rad).collect();
    let mut retargeted = retarget::copied(&capture, &model, &initial_rad)?;
    let limits_rad: Vec<(f64, f64)> =
        model.joints.iter().map(|joint| (joint.lower_rad, joint.upper_rad)).collect();
    adjust::drawn_in(&limits_rad, &mut retargeted.positions_rad)?;
    let Capture { poses, tracked, stature_m, rate_hz, .. } = &capture;
    let base = model.base.first().copied().unwrap_or(Segment::Pelvis);
    let footfalls = footfall::of_person(poses, tracked, *stature_m, *rate_hz, base)?;
    Ok(RobotMotion {
        name: name.to_owned(),
        source: Source::default(),
        notes: retargeted.notes.clone(),
        only: Vec::new(),
        retargeted,
        person: Some(capture),
        footfalls,
        clock: Vec::new(),
        of_person: true,
    })
}

/// What is moved.
struct Placed<'a> {
    body: &'a RobotBody,
    start_rad: Vec<f64>,
    limits_rad: Vec<(f64, f64)>,
    free: Vec<bool>,
    /// It was made, and not measured.
    exact: bool,
}

impl<'a> Placed<'a> {
    fn of(robot: &Robot, body: &'a RobotBody, order: &MotionOrder, exact: bool) -> Self {
        let limits = |joint: &Joint| (joint.limits.lower_rad(), joint.limits.upper_rad());
        let is_free = |joint: &Joint| order.only.is_empty() || order.only.contains(&joint.name);
        Self {
            body,
            start_rad: robot.joints.iter().map(|joint| joint.initial_rad).collect(),
            limits_rad: robot.joints.iter().map(limits).collect(),
            free: robot.joints.iter().map(is_free).collect(),
            exact,
        }
    }

    fn adjusting(&self, rate_hz: f64, slower: Option<f64>) -> Adjusting<'_> {
        Adjusting {
            robot: Adjustable {
                body: self.body,
                start_rad: &self.start_rad,
                limits_rad: &self.limits_rad,
                free: &self.free,
            },
            rate_hz,
            footfalls: None,
            slower,
        }
    }
}

/// Moves joints until links of the robot are not in one another and, given what its feet do, these stand.
fn fit_in(
    robot: &Robot,
    placed: &Placed<'_>,
    footfalls: Option<&Vec<Footfall>>,
    retargeted: &mut Retargeted,
) -> Result<(), Error> {
    let adjusting = Adjusting {
        footfalls: footfalls.map(Vec::as_slice),
        ..placed.adjusting(retargeted.rate_hz, None)
    };
    let told = adjust(&adjusting, &mut retargeted.positions_rad)?;
    let furthest = told.moved_rad.iter().zip(&robot.joints).max_by(|a, b| a.0.total_cmp(b.0));
    if let Some((moved_rad, joint)) = furthest.filter(|(moved_rad, _)| **moved_rad > NOTED_RAD) {
        retargeted.notes.push(format!(
            "moved so that the robot is not in itself{} ({:.0} % of the poses were, {:.0} % are): {} \
             by up to {:.0} deg",
            if footfalls.is_some() { " and its feet stand" } else { "" },
            told.before_share * 100.0,
            told.after_share * 100.0,
            joint.name,
            moved_rad.to_degrees()
        ));
    }
    Ok(())
}

/// Which joints `--only` names.
///
/// # Errors
/// A joint the robot does not have, or one that is named twice.
pub fn only(robot: &Robot, names: &[String]) -> Result<Vec<usize>, Error> {
    let mut joints = Vec::with_capacity(names.len());
    for (at, name) in names.iter().enumerate() {
        let joint = robot.joints.iter().position(|joint| joint.name == *name).ok_or_else(|| {
            Error::of(ErrorKind::Unknown, "the robot has no such joint").at("--only").none_of(
                name,
                robot.joint_names(),
                "take one of these",
            )
        })?;
        if let Some(first) = joints.iter().position(|&other| other == joint) {
            return Err(Error::of(ErrorKind::Malformed, "a joint is named twice")
                .at("--only")
                .got(format!("{name}: name {} and name {}", first + 1, at + 1))
                .allowed("each joint once"));
        }
        joints.push(joint);
    }
    Ok(joints)
}

/// A motion that is in the robot's joints already.
fn in_joints(
    order: &MotionOrder,
    robot: &Robot,
    motion: &joints::JointMotion,
) -> Result<RobotMotion, Error> {
    let options = [
        ("--mirror", order.mirror),
        ("--mapping", order.mapping.is_some()),
        ("--skeleton", order.reading.skeleton.is_some()),
        ("--capture-rate", order.reading.rate_hz.is_some()),
    ];
    if let Some((option, _)) = options.iter().find(|(_, given)| *given) {
        return Err(Error::new("this motion is in the robot's joints already")
            .at(order.motion.clone())
            .got(*option)
            .allowed("a capture or an action"));
    }
    let (retargeted, footfalls, source) = motion.on(robot, order.from_s, order.to_s)?;
    let (name, only, notes) = (order.motion.clone(), order.only.clone(), Vec::new());
    // What a hand did is a person's motion too.
    let of_person = motion.taught;
    let (person, clock) = (None, Vec::new());
    Ok(RobotMotion { name, source, notes, only, retargeted, person, footfalls, clock, of_person })
}

/// Reads a capture or a recording, or performs actions, as a motion of body segments. `reading` says what the capture does
/// not.
///
/// # Errors
/// An unreadable or malformed file, a skeleton that is no person, an unknown action.
pub fn body_motion(
    motion: &str,
    mapping: Option<&Path>,
    reading: &CaptureOptions,
) -> Result<(Capture, Source), Error> {
    if phrase::is_phrase(motion) {
        no_mapping(motion, mapping)?;
        if reading != &CaptureOptions::default() {
            return Err(Error::new("an action needs no skeleton and no rate")
                .at(motion)
                .allowed("--skeleton and a rate for captures in AMC files"));
        }
        return performed(motion, &Inserts::default(), |_| ACTION_HZ);
    }
    let path = Path::new(motion);
    if let Some(format) = marker_files::format_of(path) {
        return of_markers(path, format.word(), mapping, reading);
    }
    if mocap_opensim::is_named(path) {
        if mapping.is_some() || reading != &CaptureOptions::default() {
            return Err(Error::new("a table of joint angles needs no mapping, skeleton or rate")
                .at(motion)
                .allowed("these are for captures with a skeleton"));
        }
        return opensim::capture(path);
    }
    if angles_table::is_named(path) {
        if mapping.is_some() || reading != &CaptureOptions::default() {
            return Err(Error::new("a table of joint angles needs no mapping, skeleton or rate")
                .at(motion)
                .allowed("these are for captures with a skeleton"));
        }
        return angles_table::capture(path);
    }
    if path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("mcap")) {
        if mapping.is_some() || reading != &CaptureOptions::default() {
            return Err(Error::new("a recording needs no mapping, skeleton or rate")
                .at(motion)
                .allowed("these are for captures with a skeleton"));
        }
        return recorded::capture(path);
    }
    if lerobot::is_named(motion) {
        return Err(Error::new("a dataset moves the joints of a robot, and no body")
            .at(motion)
            .allowed("`play` and `retarget` with --robot for it"));
    }
    let Some(format) = files::format_of(path) else {
        marker_files::check_commas(path)?;
        let shipped: Vec<&str> = vocabulary::names().collect();
        return Err(Error::of(ErrorKind::Unknown, "not a motion that can be read")
            .at("MOTION")
            .got(motion)
            .allowed(format!(
                "a file that ends in .bvh, .amc, .c3d, .trc, .csm, .mot, .sto or .mcap, a table (.csv) of markers or joint angles, an action file (.toml), an episode of a LeRobot dataset (FOLDER#3), or a shipped action: {}",
                shipped.join(", ")
            ))
            .remedy(profiles::advice(motion, &shipped, "take one of these, or check the path")));
    };
    let mapping = mapping.map(read_mapping).transpose()?;
    let file = siblings::read(path, mapping.as_ref(), reading)?;
    let (rate_hz, frames) = (file.clip.rate_hz(), file.clip.dropped() + file.clip.pose_count());
    let source = Source {
        format: format.word().to_owned(),
        frames,
        rate_hz,
        duration_s: frames.saturating_sub(1) as f64 / rate_hz,
        segment_frames: Some(file.frames.clone()),
        ..Source::default()
    };
    let mut capture = file.capture();
    capture.notes.extend(wrong_joints(&capture, motion));
    Ok((capture, source))
}

/// What of the joints of a capture is no motion of a person, in words. It is told and not mended.
fn wrong_joints(capture: &Capture, name: &str) -> Option<String> {
    let found = artefacts(&capture.poses, &capture.tracked, capture.rate_hz);
    let first = found.iter().min_by_key(|artefact| artefact.frames.start)?;
    let what = match first.kind {
        ArtefactKind::Stuck => "sticks",
        _ => "jumps",
    };
    let at_s = first.frames.start as f64 / capture.rate_hz;
    let more = match found.len() - 1 {
        0 => String::new(),
        more => format!(", and {more} more like it"),
    };
    Some(format!(
        "no person moves so: {} {what} at {at_s:.2} s ({}){more}; it is played as it is (gaitway clean --check {name})",
        segment_name(first.segment),
        counted(first.frames.len(), "frame")
    ))
}

/// Markers, fitted with the usual settings.
fn of_markers(
    path: &Path,
    format: &str,
    mapping: Option<&Path>,
    reading: &CaptureOptions,
) -> Result<(Capture, Source), Error> {
    let misplaced = [("--mapping", mapping.is_some()), ("--skeleton", reading.skeleton.is_some())];
    if let Some((option, _)) = misplaced.iter().find(|(_, given)| *given) {
        return Err(Error::new("markers have no skeleton")
            .at(path.display().to_string())
            .got(*option)
            .allowed("--static, and a rate where the file says none"));
    }
    let settings = FitSettings::default();
    let fitted = fit_markers(path, reading.static_trial.as_deref(), reading.rate_hz, &settings)?;
    let source = Source {
        format: format.to_owned(),
        frames: fitted.poses.len(),
        rate_hz: fitted.rate_hz,
        duration_s: fitted.poses.len().saturating_sub(1) as f64 / fitted.rate_hz,
        ..Source::default()
    };
    Ok((fitted.capture(), source))
}

/// Reads a trial of markers and its static trial, and fits a body to it.
///
/// # Errors
/// As [`fit::fit`], and of files that cannot be read.
pub fn fit_markers(
    trial: &Path,
    static_trial: Option<&Path>,
    rate_hz: Option<f64>,
    settings: &FitSettings,
) -> Result<Fitted, Error> {
    let stands = static_trial.map(|path| marker_files::read_places(path, None)).transpose()?;
    let markers = marker_files::read_places(trial, rate_hz)?;
    fit::fit(stands.as_ref(), &markers, settings).map_err(|error| error.in_file(trial))
}

/// Fails if an action is given a mapping, which it would not heed.
fn no_mapping(motion: &str, mapping: Option<&Path>) -> Result<(), Error> {
    mapping.map_or(Ok(()), |file| {
        Err(Error::new("an action needs no mapping")
            .at(motion)
            .got(file.display().to_string())
            .allowed("a mapping for captures with a skeleton"))
    })
}

/// Fails if there is nothing that could be inserted into.
fn check_inserts(order: &MotionOrder) -> Result<(), Error> {
    let insert = order.inserts.list.first().filter(|_| !phrase::is_phrase(&order.motion));
    insert.map_or(Ok(()), |insert| {
        Err(Error::new("actions are inserted into actions only")
            .at("--insert")
            .got(format!("{insert} into {}", order.motion))
            .allowed("a motion that is a shipped action, an action file (.toml), or several")
            .remedy("`gaitway actionlets` makes an action file of a capture"))
    })
}

/// Actions, performed by a body of usual stature, in so many poses per second.
fn performed(
    text: &str,
    inserts: &Inserts,
    rate_hz: impl FnOnce(&Motion) -> f64,
) -> Result<(Capture, Source), Error> {
    let composed = compose(&phrase::load(text)?, Join::Transition, inserts, &mut Fits::usual()?)?;
    let (notes, motion) = (composed.notes(), composed.motion);
    let rate_hz = rate_hz(&motion);
    let poses = motion.poses(&Proportions::of_stature(ACTION_STATURE_M)?, rate_hz)?;
    let source = Source {
        format: "action".to_owned(),
        frames: poses.len(),
        rate_hz,
        duration_s: motion.duration_s(),
        segment_frames: None,
        changes: composed.changes,
        inserts: composed.inserts,
    };
    let (tracked, stature_m) = ([true; 13], ACTION_STATURE_M);
    let capture = Capture { rate_hz, poses, tracked, stature_m, is_made: true, notes };
    Ok((capture, source))
}

/// Poses per second with which a spline through an action is the action itself to within
/// [`EXACT_RAD`], in every degree of freedom; and the last pose is the end. Slowing the whole
/// stretches the spline and changes nothing of that.
fn exact_rate_hz(motion: &Motion) -> f64 {
    let jerk = motion.moving().map(|(_, piece)| piece.peaks().jerk_rad_s3).fold(0.0, f64::max);
    let enough_hz = (jerk * SPLINE_ERROR / EXACT_RAD).cbrt();
    let enough_hz = enough_hz.clamp(*EXACT_HZ.start(), *EXACT_HZ.end());
    let steps = (motion.duration_s() * enough_hz).ceil().max(1.0);
    steps / motion.duration_s()
}

fn read_mapping(path: &Path) -> Result<MappingFile, Error> {
    let text = profiles::read_text(path)?;
    MappingFile::parse(&text).map_err(|e| e.at(path.display().to_string()))
}

/// Keeps the poses from `from` to `to`, s.
fn cut(capture: &mut Capture, from: Option<f64>, to: Option<f64>) -> Result<(), Error> {
    if from.is_none() && to.is_none() {
        return Ok(());
    }
    let last = capture.poses.len().saturating_sub(1);
    let end_s = last as f64 / capture.rate_hz;
    let (from_s, to_s) = (from.unwrap_or(0.0), to.unwrap_or(end_s));
    if !(from_s >= 0.0 && from_s < to_s && to_s <= end_s + 0.5 / capture.rate_hz) {
        return Err(Error::new("no such section in the capture")
            .at("--from, --to")
            .got(format!("{from_s} to {to_s} s"))
            .allowed(format!("0 to {end_s:.3} s, the end after the beginning")));
    }
    let index = |time_s: f64| ((time_s * capture.rate_hz).round() as usize).min(last);
    let (first, end) = (index(from_s), index(to_s));
    capture.poses.truncate(end + 1);
    capture.poses.drain(..first);
    Ok(())
}

impl RobotMotion {
    /// The path over all joints; those the motion does not drive stay at `start_rad`.
    ///
    /// # Errors
    /// As [`JointPath::new`].
    pub fn path_from(&self, robot: &Robot, start_rad: &[f64]) -> Result<JointPath, Error> {
        let samples = self.samples();
        let rows = robot.joints.iter().zip(start_rad).map(|(joint, &start)| {
            match self.series(&joint.name) {
                Some(series) => series.clone(),
                None => vec![start; samples],
            }
        });
        JointPath::new(robot.joint_names(), self.retargeted.rate_hz, rows.collect())
    }

    /// Angles of a joint the motion drives.
    fn series(&self, joint: &str) -> Option<&Vec<f64>> {
        if !self.only.is_empty() && !self.only.iter().any(|name| name == joint) {
            return None;
        }
        let index = self.retargeted.joints.iter().position(|name| name == joint)?;
        self.retargeted.positions_rad.get(index)
    }

    /// Poses of the motion.
    #[must_use]
    pub fn samples(&self) -> usize {
        self.retargeted.positions_rad.first().map_or(0, Vec::len)
    }

    fn of_joint<T: Copy + Default>(&self, joint: &str, values: &[T]) -> T {
        let index = self.retargeted.joints.iter().position(|name| name == joint);
        index.and_then(|index| values.get(index).copied()).unwrap_or_default()
    }

    /// Poses per second of the motion as it came in.
    #[must_use]
    pub const fn rate_hz(&self) -> f64 {
        self.retargeted.rate_hz
    }

    /// The person whose motion it is, pose by pose; none of a motion that is in the robot's joints.
    #[must_use]
    pub const fn person(&self) -> Option<&Capture> {
        self.person.as_ref()
    }

    /// The time of the motion as it came in, s, that is done at a time of it on the robot, s: elsewhere where it was
    /// slowed in parts.
    #[must_use]
    pub fn source_time_s(&self, time_s: f64) -> f64 {
        let along = time_s * self.retargeted.rate_hz;
        standing::through(&self.clock, &[along])[0] / self.retargeted.rate_hz
    }

    /// What it says of the robot's feet, pose by pose; empty if it says nothing.
    #[must_use]
    pub fn footfalls(&self) -> &[Footfall] {
        &self.footfalls
    }

    /// Poses in which saturation moved a joint.
    #[must_use]
    pub fn clipped_samples(&self, joint: &str) -> usize {
        self.of_joint(joint, &self.retargeted.clipped_samples)
    }

    /// What the robot cannot show of how the trunk leans, for lack of a waist; `None` if it has one.
    #[must_use]
    pub const fn trunk_lean_lost(&self) -> Option<TrunkLean> {
        self.retargeted.trunk_lean_lost
    }

    /// Share of poses in which the fit holds a joint at its limit.
    #[must_use]
    pub fn at_limit_share(&self, joint: &str) -> f64 {
        self.of_joint(joint, &self.retargeted.at_limit_share)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::Dof;
    use crate::motion::{End, Spline};

    #[test]
    fn a_spline_through_the_poses_of_an_action_is_the_action() {
        for text in ["run", "walk:x1", "hop-l", "kick-r,bow", "box-l@10", "run:x2@10", "bow@0.1"] {
            let motion = phrase::perform(&phrase::load(text).unwrap(), Join::Transition).unwrap();
            let rate_hz = exact_rate_hz(&motion);
            let poses = motion.sampled(rate_hz).unwrap();
            let last_s = (poses.len() - 1) as f64 / rate_hz;
            assert!((last_s - motion.duration_s()).abs() < 1e-9, "{text} ends at {last_s} s");
            for dof in Dof::ALL {
                let row: Vec<f64> = poses.iter().map(|pose| pose[dof]).collect();
                let rest = End::Velocity(0.0);
                let spline = Spline::through(row, 1.0 / rate_hz, rest, rest).unwrap();
                for part in 0..5 * poses.len() {
                    let time_s = part as f64 / rate_hz / 5.0;
                    let off = spline.sample(time_s)[0] - motion.at(dof, time_s).position_rad;
                    assert!(off.abs() <= EXACT_RAD, "{text} {} {time_s}: {off}", dof.name());
                }
            }
        }
    }
}
