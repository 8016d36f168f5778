//! Pages of what a file holds: a capture, markers, a robot's recording.

use super::{NamedLimits, drawable, joint_tracks, look, sampled};
use crate::body::SegmentPose;
use crate::bus::Miss;
use crate::error::{Error, ErrorKind};
use crate::job::clean_check::cut_off;
use crate::job::recorder::Series;
use crate::job::source;
use crate::mocap::files::{self, CaptureOptions};
use crate::mocap::markers::Frames;
use crate::mocap::{marker_files, opensim};
use crate::recording::{self, CycleRecord, JointRecord, RecordedJoint, Recording};
use crate::retarget::base::{self, BasePath, Held, StandingSole};
use crate::robot::Robot;
use crate::session::angles::WornMotion;
use crate::view::ViewPage;
use crate::view::person::DrawnSensor;
use crate::view::robot::{collisions, still};
use crate::view::scene::ViewScene;
use crate::view::tracks::{SpanKind, ViewSpan};
use std::path::Path;
use std::time::UNIX_EPOCH;

/// Poses per second of somebody who wore sensors.
const WORN_HZ: f64 = 60.0;
/// Instants per second in which a base is looked for, at most.
const MOST_HZ: f64 = 100.0;

/// What is drawn of a file.
pub(in crate::job) struct Shown {
    /// It, and what is to be said of it.
    pub(in crate::job) page: ViewPage,
    /// The robot in it.
    pub(in crate::job) robot: Option<Robot>,
    /// When it begins by the wall clock, ns since 1970; zero: nobody knows.
    pub(in crate::job) start_ns: u64,
}

/// The page of a file: of a capture the person, of markers the points, of a recording the robot.
///
/// # Errors
/// A file that cannot be read, or shows none of these.
pub fn page(path: &Path, options: &CaptureOptions) -> Result<String, Error> {
    shown(path, options)?.page.html()
}

/// The page of two captures in one room: both begin at the same moment, and each is where its file says.
///
/// # Errors
/// As [`page`]; a file that shows no person.
pub fn page_of_two(path: &Path, other: &Path, options: &CaptureOptions) -> Result<String, Error> {
    let mut one = shown(path, options)?.page;
    let two = shown(other, &CaptureOptions::default())?.page;
    for (scene, path) in [(&one.scene, path), (&two.scene, other)] {
        if scene.person.is_none() {
            return Err(Error::new("there is nobody in it to be shown beside somebody")
                .at(path.display().to_string())
                .allowed(
                    "two captures of a person each, or recordings of sensors that were worn",
                ));
        }
    }
    one.title = format!("{} and {}", one.title, two.title);
    one.warnings.extend(two.warnings);
    one.notes.extend(two.notes.iter().map(|note| format!("{}: {note}", two.title)));
    one.summary_rows.extend(two.summary_rows.into_iter().map(|(_, of)| ("the other's".into(), of)));
    one.scene.duration_s = one.scene.duration_s.max(two.scene.duration_s);
    one.scene.other = two.scene.person;
    one.scene.spans.extend(two.scene.spans.into_iter().map(|span| {
        let row = format!("the other: {}", span.row);
        ViewSpan { row, ..span }
    }));
    one.html()
}

/// What is drawn of a file.
///
/// # Errors
/// As [`page`].
pub(in crate::job) fn shown(path: &Path, options: &CaptureOptions) -> Result<Shown, Error> {
    let (mut robot, mut start_ns) = (None, 0);
    let mut page = ViewPage { title: path.display().to_string(), ..ViewPage::default() };
    if marker_files::format_of(path).is_some() {
        let mut reader = marker_files::open(path)?;
        if let Some(rate_hz) = options.rate_hz {
            reader.take_rate(rate_hz)?;
        }
        page.warnings.extend(cut_off(reader.head().lost_frames));
        page.scene = super::body::markers(&mut reader, None)?;
    } else if files::format_of(path).is_some()
        || opensim::is_named(path)
        || source::angles_table::is_named(path)
    {
        let (capture, _) = source::body_motion(&page.title, None, options)?;
        page.scene = super::body::person(&capture)?;
        page.notes = capture.notes;
    } else {
        let of_robot = recording::run_start(path)?.is_some_and(|start| !start.joints.is_empty());
        let recording = of_robot.then(|| recording::read(path)).transpose()?;
        start_ns = recording.as_ref().map_or(0, began_ns);
        let person = worn(path, start_ns, &mut page.notes)?;
        let shows_robot = person.is_none() || start_ns > 0;
        if shows_robot {
            let recording = recording.map_or_else(|| recording::read(path), Ok)?;
            (page.scene, robot) = recorded(&recording, &mut page.notes)
                .map_err(|error| error.at(path.display().to_string()))?;
        }
        match person {
            // Whom the robot followed stands beside it, in its time.
            Some(person) if shows_robot => {
                page.scene.person = person.person;
                page.scene.spans.extend(person.spans);
            }
            Some(person) => page.scene = person,
            None => {}
        }
    }
    let duration = format!("{:.2} s", page.scene.duration_s);
    page.summary_rows.push(("duration".to_owned(), duration));
    Ok(Shown { page, robot, start_ns })
}

/// When the first cycle of a recording was, by the wall clock, ns since 1970.
fn began_ns(recording: &Recording) -> u64 {
    let Some((start, first)) = recording.start.as_ref().zip(recording.cycles.first()) else {
        return 0;
    };
    let since_s = first.at.seconds_since(start.monotonic_start);
    let began = start.wall_clock_start.duration_since(UNIX_EPOCH).unwrap_or_default();
    (began.as_nanos() as u64).saturating_add((since_s.max(0.0) * 1e9) as u64)
}

/// The person who wore the sensors of a recording that knows how they were worn, from this wall clock on, ns since 1970;
/// zero: from their first pose on.
fn worn(path: &Path, from_ns: u64, notes: &mut Vec<String>) -> Result<Option<ViewScene>, Error> {
    let Some((motion, series, kept)) = source::recorded::worn(path, WORN_HZ)? else {
        return Ok(None);
    };
    let not_worn = motion.not_worn();
    if !not_worn.is_empty() {
        notes.push(format!("not worn, and therefore at rest: {}", not_worn.join(", ")));
    }
    let WornMotion { body, poses, rate_hz, worn, measured, start_ns, .. } = &motion;
    let from_ns = if from_ns > 0 { from_ns } else { *start_ns };
    let before = (from_ns.saturating_sub(*start_ns) as f64 * 1e-9 * rate_hz).ceil() as usize;
    let (poses, measured) = (poses.get(before..), measured.get(before..));
    let Some((poses, measured)) = poses.zip(measured).filter(|(poses, _)| !poses.is_empty()) else {
        return Ok(None);
    };
    let mut scene = super::body::in_poses(body, poses, *rate_hz, worn, false);
    let sensors = kept.calibration.mounts.iter().zip(&kept.sensors).map(|(mount, name)| {
        let segment_from_sensor = mount.sensor_from_segment.inverse();
        let at = mount.segment.index();
        let turn = |(pose, said): (&SegmentPose, &[bool; 13])| {
            said[at].then(|| pose.orientation[at] * segment_from_sensor)
        };
        DrawnSensor {
            name: name.clone(),
            segment: mount.segment,
            turns: poses.iter().zip(measured).map(turn).collect(),
        }
    });
    let sensors: Vec<DrawnSensor> = sensors.collect();
    let late_s = start_ns.saturating_sub(from_ns) as f64 * 1e-9;
    scene.person = scene.person.map(|person| person.wearing(sensors, *rate_hz).from(late_s));
    scene.duration_s += late_s;
    let began = series.start.as_ref().map(|start| start.monotonic_start).unwrap_or_default();
    let since_start_s = (from_ns as f64 - series.start_ns() as f64) * 1e-9;
    scene.spans.extend(series.markers.iter().map(|mark| {
        let at_s = mark.at.seconds_since(began) - since_start_s;
        ViewSpan::new(SpanKind::Event, "marked", &mark.text, at_s, at_s)
    }));
    Ok(Some(scene))
}

/// What a robot did.
fn recorded(
    recording: &Recording,
    notes: &mut Vec<String>,
) -> Result<(ViewScene, Option<Robot>), Error> {
    let nothing = || {
        Error::of(ErrorKind::Absent, "the recording has no joints of a robot to show")
            .remedy("`gaitway convert` makes a motion of worn sensors, which a page can show")
    };
    let start = recording.start.as_ref().ok_or_else(nothing)?;
    let first = recording.cycles.first().filter(|_| !start.joints.is_empty());
    let first = first.ok_or_else(nothing)?.at;
    let series = series(&recording.cycles, start.joints.len(), first);
    let duration_s = series.time_s.last().copied().unwrap_or(0.0);
    let limits: Vec<NamedLimits> = start
        .joints
        .iter()
        .map(|of: &RecordedJoint| NamedLimits {
            name: of.name.clone(),
            range_rad: of.lower_rad.zip(of.upper_rad).map(|(low, high)| [low, high]),
            velocity_rad_s: of.velocity_limit_rad_s,
            acceleration_rad_s2: of.acceleration_limit_rad_s2,
        })
        .collect();
    let mut scene = ViewScene {
        duration_s,
        joints: Some(joint_tracks(&series, limits)),
        ..ViewScene::default()
    };
    let robot = Robot::load(&start.robot).ok().filter(|robot| {
        robot.joints.len() == start.joints.len()
            && robot.joints.iter().zip(&start.joints).all(|(one, two)| one.name == two.name)
    });
    let Some(robot) = robot else {
        notes.push(format!("{} is not known here as it was recorded: not drawn", start.robot));
        return Ok((scene, None));
    };
    let Some(body) = drawable(&robot)? else { return Ok((scene, None)) };
    let start_rad: Vec<f64> = robot.joints.iter().map(|joint| joint.initial_rad).collect();
    let mean_hz = series.time_s.len() as f64 / duration_s.max(1e-3);
    let rate_hz = mean_hz.min(robot.file.rate_hz).clamp(1.0, MOST_HZ);
    let count = (duration_s * rate_hz) as usize + 1;
    let has_goals = series.goal_rad.iter().any(|goal| goal.iter().any(|goal| goal.is_finite()));
    let told = if has_goals { &series.goal_rad } else { &series.present_rad };
    let poses = sampled(&series.time_s, told, rate_hz, count, &start_rad);
    let soles = StandingSole::all(&body);
    let held = Held::of(&body, &soles, false);
    let base = said(&recording.cycles, duration_s).unwrap_or_else(|| {
        if held == Held::Fixed {
            return still(&body, &start_rad);
        }
        notes.push("where the base was is worked out from joints and soles".to_owned());
        base::path(&body, &soles, held, &poses, rate_hz, |_| None)
    });
    scene.robot = Some(look::drawn(&robot, &body, &base));
    scene.spans = collisions(&body, &start_rad, &poses, rate_hz);
    Ok((scene, Some(robot)))
}

/// Where the base was meant to be, if every cycle says so.
fn said(cycles: &[CycleRecord], duration_s: f64) -> Option<BasePath> {
    let of = |cycle: &CycleRecord| cycle.base.as_deref().copied();
    let all: Vec<recording::BaseRecord> = cycles.iter().map(of).collect::<Option<_>>()?;
    let places =
        all.iter().map(|base| crate::rigid::Placement { at_m: base.at_m, turn: base.turn });
    Some(BasePath {
        rate_hz: all.len().saturating_sub(1).max(1) as f64 / duration_s.max(1e-3),
        places: places.collect(),
        contacts: all.iter().map(|base| base.contacts).collect(),
    })
}

/// Where a joint was asked and gave no reading. Until version 0.2.0 a recording said of a joint whose turn it was not that
/// it was missed, and why.
fn missed(cycles: &[CycleRecord], joints: usize) -> Vec<Vec<bool>> {
    let not_asked = Miss::NotAsked.to_string();
    let of = |joint: usize| {
        let why = |cycle: &CycleRecord| {
            cycle.joints.get(joint)?.missed.as_deref().map(|why| why != not_asked)
        };
        cycles.iter().map(|cycle| why(cycle).unwrap_or(false)).collect()
    };
    (0..joints).map(of).collect()
}

/// The cycles as series.
fn series(cycles: &[CycleRecord], joints: usize, first: crate::time::Instant) -> Series {
    let by_joint = |value: &dyn Fn(&JointRecord) -> Option<f64>| -> Vec<Vec<f64>> {
        let of = |joint: usize| {
            let read = |cycle: &CycleRecord| value(cycle.joints.get(joint)?);
            cycles.iter().map(|cycle| read(cycle).unwrap_or(f64::NAN)).collect()
        };
        (0..joints).map(of).collect()
    };
    Series {
        began: Some(first),
        time_s: cycles.iter().map(|cycle| cycle.at.seconds_since(first)).collect(),
        goal_rad: by_joint(&|of| of.goal_rad),
        goal_velocity_rad_s: Vec::new(),
        present_rad: by_joint(&|of| of.present_position_rad),
        missed: missed(cycles, joints),
        velocity_rad_s: by_joint(&|of| of.present_velocity_rad_s),
        current_a: by_joint(&|of| of.present_current_a),
        load_ratio: by_joint(&|of| of.present_load_ratio),
        temperature_c: by_joint(&|of| of.temperature_c),
        voltage_v: by_joint(&|of| of.voltage_v),
    }
}
