//! Motions that are in a robot's own joints already: recordings, taught by hand or of goals, tables as `retarget` writes
//! them, and tables without titles as others do.

use super::{Source, untitled};
use crate::actionlet::key_frames;
use crate::error::{Error, ErrorKind, counted};
use crate::job::table_text::text_up_to;
use crate::mocap::retarget::{Retargeted, Settings};
use crate::motion::{low_pass, saturate};
use crate::recording::{self, BaseRecord};
use crate::retarget::{Footfall, footfall};
use crate::robot::{Joint, Robot};
use crate::table::{self, Row};
use glam::DQuat;
use std::collections::BTreeMap;
use std::path::Path;

/// Largest table read, bytes: a minute of 20 joints at 200 Hz, with its base, is 9 MB.
const MAX_TABLE_BYTES: u64 = 12 << 20;
/// Longest time without a position of a joint that is bridged by a straight line, s.
const GAP_S: f64 = key_frames::APART_S;
/// Angles this far beyond a limit are rounding, rad.
const ROUNDING_RAD: f64 = 1e-4;
/// So far inside its limits a joint is kept that a motion takes to them, rad.
const HAIR_RAD: f64 = 1e-9;
/// Rotations this far from the length 1 are rounded.
const TURN_ROUNDING: f64 = 1e-3;
/// A sample counts as clipped if a limit moved it by more than this, rad.
const CLIPPED_RAD: f64 = 0.01;

/// Positions of one joint: times in s, rising, and angles in rad.
struct Series {
    joint: String,
    points: Vec<(f64, f64)>,
}

/// Titles of where the base is and which feet stand, behind the joints.
pub const BASE_TITLES: [&str; 9] = [
    "base_x_m",
    "base_y_m",
    "base_z_m",
    "base_qw",
    "base_qx",
    "base_qy",
    "base_qz",
    "contact_left",
    "contact_right",
];

/// A motion as it was read.
pub struct JointMotion {
    format: &'static str,
    series: Vec<Series>,
    /// The base and the feet, if it says anything of them: times in s, and values by [`BASE_TITLES`].
    base: Vec<(f64, [f64; 9])>,
    /// Guided by hand: a person's motion, with the noise of measuring.
    pub taught: bool,
}

/// Reads a recording (.mcap) or a table (.csv) for a robot with these joints, in the order of its file; none if `path` ends otherwise.
///
/// # Errors
/// A file that cannot be read or holds no positions of joints.
pub fn read(path: &Path, joints: &[String]) -> Result<Option<JointMotion>, Error> {
    let ending = path.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase();
    match ending.as_str() {
        "mcap" => of_recording(path).map(Some),
        "csv" => {
            let text = text_up_to(path, MAX_TABLE_BYTES)?;
            let motion = if is_untitled(&text) { of_rows(&text, joints) } else { of_table(&text) };
            motion.map(Some).map_err(|e| e.at(path.display().to_string()))
        }
        _ => Ok(None),
    }
}

/// Goals if there are any, else what was measured.
fn of_recording(path: &Path) -> Result<JointMotion, Error> {
    let recording = recording::read(path)?;
    let taught = recording.cycles.iter().flat_map(|c| &c.joints).all(|j| j.goal_rad.is_none());
    let first = recording.cycles.first().map(|cycle| cycle.at);
    let series = recording.joint_names.iter().enumerate().map(|(index, joint)| {
        let point = |cycle: &recording::CycleRecord| {
            let joint = cycle.joints.get(index)?;
            let angle_rad = if taught { joint.present_position_rad } else { joint.goal_rad };
            Some((cycle.at.seconds_since(first?), angle_rad?))
        };
        let mut points: Vec<(f64, f64)> = recording.cycles.iter().filter_map(point).collect();
        points.dedup_by(|later, before| later.0 <= before.0);
        Series { joint: joint.clone(), points }
    });
    let series: Vec<Series> = series.collect();
    once_each(series.iter().map(|series| series.joint.as_str()), "joint")
        .map_err(|e| e.at(path.display().to_string()))?;
    let series: Vec<Series> = series.into_iter().filter(|series| series.points.len() > 1).collect();
    if series.is_empty() {
        return Err(Error::new("the recording holds no positions of a robot's joints")
            .at(path.display().to_string())
            .remedy("record some with `gaitway record servos:ROBOT@BUS --limp -o FILE.mcap`"));
    }
    let base = recording.cycles.iter().filter_map(|cycle| {
        let BaseRecord { at_m, turn, contacts } = **cycle.base.as_ref()?;
        let [x, y, z, w] = turn.to_array();
        let [left, right] = contacts.map(|stands| f64::from(u8::from(stands)));
        let place = [at_m.x, at_m.y, at_m.z, w, x, y, z, left, right];
        is_turn(turn).then_some((cycle.at.seconds_since(first?), place))
    });
    let mut base: Vec<(f64, [f64; 9])> = base.collect();
    base.dedup_by(|later, before| later.0 <= before.0);
    let format = if taught { "taught" } else { "recording" };
    Ok(JointMotion { format, series, base, taught })
}

/// What a robot was told and what it did, at even times.
pub struct PlayedJoints {
    /// Where each joint was told to be, row by row, rad.
    pub goal_rad: Vec<Vec<f64>>,
    /// Where it was, rad.
    pub present_rad: Vec<Vec<f64>>,
}

/// Goals and measured angles of all joints of a robot, out of a recording of something that was played.
///
/// # Errors
/// A file that cannot be read, a joint without goals or without readings, a gap.
pub fn played(path: &Path, robot: &Robot, rate_hz: f64) -> Result<PlayedJoints, Error> {
    let recording = recording::read(path)?;
    let first = recording.cycles.first().map(|cycle| cycle.at);
    let series = |joint: &str, of: fn(&recording::JointRecord) -> Option<f64>, what: &str| {
        let index = recording.joint_names.iter().position(|name| name == joint);
        let point = |cycle: &recording::CycleRecord| {
            Some((cycle.at.seconds_since(first?), of(cycle.joints.get(index?)?)?))
        };
        let mut points: Vec<(f64, f64)> = recording.cycles.iter().filter_map(point).collect();
        points.dedup_by(|later, before| later.0 <= before.0);
        let series = Series { joint: joint.to_owned(), points };
        if series.points.len() < 2 {
            return Err(Error::new(format!("the recording holds no {what} of a joint"))
                .at(joint.to_owned())
                .allowed("a recording of a robot that was played: `gaitway play FILE --robot ROBOT --record FILE.mcap`"));
        }
        series.check_gaps().map(|()| series)
    };
    let (mut goals, mut presents) = (Vec::new(), Vec::new());
    for joint in robot.joint_names() {
        goals.push(series(&joint, |of| of.goal_rad, "goals")?);
        presents.push(series(&joint, |of| of.present_position_rad, "measured angles")?);
    }
    let all = || goals.iter().chain(&presents);
    let begin_s = all().filter_map(|of| of.points.first()).map(|of| of.0).fold(0.0, f64::max);
    let end_s = all().filter_map(|of| of.points.last()).map(|of| of.0).fold(f64::MAX, f64::min);
    let count = ((end_s - begin_s) * rate_hz + 1e-6).floor();
    if !(count >= 1.0) {
        return Err(
            Error::new("the recording is too short").got(format!("{:.2} s", end_s - begin_s))
        );
    }
    let rows = |all: &[Series]| -> Vec<Vec<f64>> {
        let row = |at: usize| {
            all.iter().map(|of| of.at(begin_s + at as f64 / rate_hz)).collect::<Vec<f64>>()
        };
        (0..=count as usize).map(row).collect()
    };
    Ok(PlayedJoints { goal_rad: rows(&goals), present_rad: rows(&presents) })
}

/// `time_s`, then a column per joint, rad.
fn of_table(text: &str) -> Result<JointMotion, Error> {
    let shape = "time_s, then a column JOINT_rad for each joint, and where the base is, as `gaitway \
                 retarget` writes it";
    let mut rows = table::rows(text);
    let titles = rows.next().transpose()?;
    let mut titles = titles.iter().flat_map(Row::cells);
    let first = titles.next().unwrap_or_default();
    if first != "time_s" {
        let refused = Error::of(ErrorKind::Malformed, "not a table of joint angles").allowed(shape);
        let begins: String = first.chars().take(40).collect();
        let refused = refused.got(format!("a first column {begins:?}"));
        return Err(match first {
            "cycle" => {
                refused.remedy("this table was made of a recording: play the recording (.mcap)")
            }
            _ => refused,
        });
    }
    // Before anything is built of them.
    let joints = titles.clone().map(|title| title.strip_suffix("_rad").unwrap_or(title));
    once_each(joints, "column")?;
    let (mut series, mut columns) = (Vec::new(), Vec::new());
    for title in titles {
        if let Some(place) = BASE_TITLES.iter().position(|known| *known == title) {
            columns.push(Column::Base(place));
            continue;
        }
        let unlabelled = || {
            Error::new("a column does not say that it is an angle in rad").got(title).allowed(shape)
        };
        let joint = title.strip_suffix("_rad").ok_or_else(unlabelled)?.to_owned();
        columns.push(Column::Joint(series.len()));
        series.push(Series { joint, points: Vec::new() });
    }
    let of_base = columns.iter().filter(|column| matches!(column, Column::Base(_))).count();
    let mut base: Vec<(f64, [f64; 9])> = Vec::new();
    let mut before_s = f64::NEG_INFINITY;
    for row in rows {
        let row = row?;
        let wrong = |what: &str, got: &str| {
            Error::new(what.to_owned()).got(format!("line {}: {got}", row.line)).allowed(shape)
        };
        let (count, titled) = (row.width(), columns.len() + 1);
        if count != titled {
            let got = format!(
                "{count}, {titled}",
                titled = counted(titled, "column"),
                count = counted(count, "cell")
            );
            return Err(wrong("a row has not one number per column", &got));
        }
        let mut values = Vec::with_capacity(count);
        for cell in row.cells() {
            let value = cell.parse().ok().filter(|value: &f64| value.is_finite());
            values.push(value.ok_or_else(|| wrong("a cell is no number", cell))?);
        }
        if !(values[0] > before_s) {
            return Err(wrong("time does not go on", &values[0].to_string()));
        }
        before_s = values[0];
        let mut place = [0.0; 9];
        for (column, &value) in columns.iter().zip(&values[1..]) {
            match *column {
                Column::Joint(index) => series[index].points.push((before_s, value)),
                Column::Base(index) => place[index] = value,
            }
        }
        if of_base == BASE_TITLES.len() {
            let [_, _, _, w, x, y, z, ..] = place;
            let turn = DQuat::from_xyzw(x, y, z, w);
            if !is_turn(turn) {
                let got = format!("base_qw, base_qx, base_qy, base_qz of {}", turn.length());
                return Err(wrong("a rotation has not the length 1", &got));
            }
            base.push((before_s, place));
        }
    }
    if series.first().is_none_or(|series| series.points.len() < 2) {
        return Err(Error::new("a table of joint angles needs two rows at least").allowed(shape));
    }
    let times_s: Vec<f64> = series[0].points.iter().map(|point| point.0).collect();
    let keys = match base.is_empty() {
        true => key_frames::between(&times_s, series.len())?,
        false => None,
    };
    let Some((_, instants)) = keys else {
        return Ok(JointMotion { format: "table", series, base, taught: false });
    };
    for series in &mut series {
        let keys: Vec<f64> = series.points.iter().map(|point| point.1).collect();
        let point = |instant: &key_frames::InBetween| {
            instant.of(&keys).map(|angle_rad| (times_s[0] + instant.time_s, angle_rad))
        };
        series.points = instants.iter().filter_map(point).collect();
    }
    Ok(JointMotion { format: "key frames", series, base, taught: false })
}

/// True of a table whose first row is numbers: it has no titles.
fn is_untitled(text: &str) -> bool {
    let first = table::rows(text).next().and_then(Result::ok);
    first.is_some_and(|row| row.width() > 1 && row.cells().all(|cell| cell.parse::<f64>().is_ok()))
}

/// Rows without titles: where the base is (x y z, qx qy qz qw), then the joints, 30 times a second. By Unitree's names if
/// the robot has those, else in the order of its file.
fn of_rows(text: &str, joints: &[String]) -> Result<JointMotion, Error> {
    let order = match untitled::unitree_order(joints) {
        Some(order) => order,
        None => joints.to_vec(),
    };
    let width = untitled::BASE_COLUMNS + order.len();
    let shape = format!(
        "{width} in a row, for this robot: base x y z (m), qx qy qz qw, then {} (rad), 30 rows a second",
        counted(order.len(), "joint"),
        width = counted(width, "number")
    );
    let mut series: Vec<Series> =
        order.into_iter().map(|joint| Series { joint, points: Vec::new() }).collect();
    let mut time_s = 0.0;
    for (at, row) in table::rows(text).enumerate() {
        let row = row?;
        let wrong = |what: &str, got: &str| {
            Error::of(ErrorKind::Malformed, what.to_owned())
                .got(format!("line {}: {got}", row.line))
                .allowed(shape.clone())
        };
        if row.width() != width {
            let got = counted(row.width(), "cell");
            return Err(wrong("a table without titles that is not of this robot", &got));
        }
        let mut values = Vec::with_capacity(width);
        for cell in row.cells() {
            let value = cell.parse().ok().filter(|value: &f64| value.is_finite());
            values.push(value.ok_or_else(|| wrong("a cell is no number", cell))?);
        }
        let turn = DQuat::from_xyzw(values[3], values[4], values[5], values[6]);
        // Six places are written of each part.
        if !is_turn(turn) {
            let got = format!("qx, qy, qz, qw of {}", turn.length());
            return Err(wrong("a rotation has not the length 1", &got));
        }
        time_s = at as f64 / untitled::RATE_HZ;
        for (series, value) in series.iter_mut().zip(&values[untitled::BASE_COLUMNS..]) {
            series.points.push((time_s, *value));
        }
    }
    if !(time_s > 0.0) {
        return Err(Error::new("a table of joint angles needs two rows at least").allowed(shape));
    }
    // Which feet stand is not said in it.
    Ok(JointMotion { format: "table", series, base: Vec::new(), taught: false })
}

/// A rotation, whose length is 1.
fn is_turn(turn: DQuat) -> bool {
    (turn.length() - 1.0).abs() <= TURN_ROUNDING
}

/// What a column of a table is of.
enum Column {
    Joint(usize),
    /// Index in [`BASE_TITLES`].
    Base(usize),
}

/// Nobody could say which of two motions of one joint is meant.
fn once_each<'a>(joints: impl IntoIterator<Item = &'a str>, place: &str) -> Result<(), Error> {
    // The first column of a table is time.
    let number = |index: usize| index + if place == "column" { 2 } else { 1 };
    let mut known = BTreeMap::new();
    for (index, joint) in joints.into_iter().enumerate() {
        if let Some(first) = known.insert(joint, index) {
            return Err(Error::of(ErrorKind::Malformed, "a joint is named twice")
                .got(format!("{joint}: {place} {} and {place} {}", number(first), number(index)))
                .allowed("each joint once"));
        }
    }
    Ok(())
}

impl JointMotion {
    /// Angles of joints, `rate_hz` times a second, row by row; `taught` if a hand led them.
    #[must_use]
    pub fn even(
        format: &'static str,
        joints: &[String],
        rows_rad: &[Vec<f64>],
        rate_hz: f64,
        taught: bool,
    ) -> Self {
        let series = joints.iter().enumerate().map(|(index, joint)| {
            let point =
                |(at, row): (usize, &Vec<f64>)| Some((at as f64 / rate_hz, *row.get(index)?));
            Series {
                joint: joint.clone(),
                points: rows_rad.iter().enumerate().filter_map(point).collect(),
            }
        });
        Self { format, series: series.collect(), base: Vec::new(), taught }
    }

    /// On `robot`, at even times, from `from_s` to `to_s` of it if they are given.
    ///
    /// # Errors
    /// A joint the robot has not, a gap, a section that is empty; an angle beyond the robot's limits,
    /// unless it was taught: then it is bent and counted as in a capture.
    pub fn on(
        &self,
        robot: &Robot,
        from_s: Option<f64>,
        to_s: Option<f64>,
    ) -> Result<(Retargeted, Vec<Footfall>, Source), Error> {
        let ends = |of: fn(&Series) -> Option<&(f64, f64)>| {
            self.series.iter().filter_map(of).map(|point| point.0)
        };
        let begin_s = ends(|series| series.points.first()).fold(f64::NEG_INFINITY, f64::max);
        let end_s = ends(|series| series.points.last()).fold(f64::INFINITY, f64::min);
        let (from_s, to_s) = (from_s.unwrap_or(0.0), to_s.unwrap_or(end_s - begin_s));
        if !(from_s >= 0.0 && from_s < to_s && begin_s + to_s <= end_s + 1e-9) {
            return Err(Error::new("no such section in the motion")
                .at("--from, --to")
                .got(format!("{from_s} to {to_s} s"))
                .allowed(format!("0 to {:.3} s, the end after the beginning", end_s - begin_s)));
        }
        let rate_hz = self.rate_hz();
        let last = ((to_s - from_s) * rate_hz).round().max(1.0) as usize;
        let step_s = (to_s - from_s) / last as f64;
        let even_hz = 1.0 / step_s;
        let count = self.series.len();
        let mut motion = Retargeted {
            joints: Vec::with_capacity(count),
            rate_hz: even_hz,
            wanted_rad: Vec::with_capacity(count),
            positions_rad: Vec::with_capacity(count),
            clipped_samples: Vec::with_capacity(count),
            clipped_share: Vec::with_capacity(count),
            at_limit_share: vec![0.0; count],
            fit_error_deg: Vec::new(),
            trunk_lean_lost: None,
            notes: Vec::new(),
        };
        for series in &self.series {
            let joint = known(robot, &series.joint)?;
            series.check_gaps()?;
            let at = |index: usize| series.at(begin_s + from_s + index as f64 * step_s);
            let mut wanted: Vec<f64> = (0..=last).map(at).collect();
            let held = if self.taught {
                let settings = Settings::default();
                wanted = low_pass(&wanted, even_hz, settings.cutoff_hz.min(0.4 * even_hz))?;
                let (lower, upper) = (joint.limits.lower_rad(), joint.limits.upper_rad());
                wanted.iter().map(|&x| saturate(x, lower, upper, settings.margin_rad)).collect()
            } else {
                inside(joint, &wanted, step_s)?
            };
            let clipped = wanted.iter().zip(&held).filter(|(w, h)| (**w - **h).abs() > CLIPPED_RAD);
            let clipped = clipped.count();
            motion.joints.push(series.joint.clone());
            motion.clipped_samples.push(clipped);
            motion.clipped_share.push(clipped as f64 / (last + 1) as f64);
            motion.wanted_rad.push(wanted);
            motion.positions_rad.push(held);
        }
        let source = Source {
            format: self.format.to_owned(),
            frames: last + 1,
            rate_hz: even_hz,
            duration_s: to_s - from_s,
            ..Source::default()
        };
        let said: Vec<([bool; 2], DQuat)> = match self.base.is_empty() {
            true => Vec::new(),
            false => {
                (0..=last).map(|at| self.stance(begin_s + from_s + at as f64 * step_s)).collect()
            }
        };
        Ok((motion, footfall::of_contacts(&said, even_hz), source))
    }

    /// Which feet stood at a time, and how the base was turned.
    fn stance(&self, time_s: f64) -> ([bool; 2], DQuat) {
        let after = self.base.partition_point(|(at_s, _)| *at_s < time_s);
        let (_, [_, _, _, w, x, y, z, left, right]) = self.base[after.min(self.base.len() - 1)];
        ([left >= 0.5, right >= 0.5], DQuat::from_xyzw(x, y, z, w).normalize())
    }

    /// The usual rate of the joint that was told or read most often.
    fn rate_hz(&self) -> f64 {
        let most = self.series.iter().max_by_key(|series| series.points.len());
        let mut steps: Vec<f64> =
            most.iter().flat_map(|s| s.points.windows(2)).map(|two| two[1].0 - two[0].0).collect();
        steps.sort_by(f64::total_cmp);
        1.0 / steps.get(steps.len() / 2).copied().unwrap_or(1.0).max(1e-3)
    }
}

impl Series {
    fn check_gaps(&self) -> Result<(), Error> {
        let gap = self.points.windows(2).find(|two| !(two[1].0 - two[0].0 <= GAP_S));
        match gap {
            None => Ok(()),
            Some(two) => Err(Error::new("the motion has a gap")
                .at(format!("joint {}, {:.2} s", self.joint, two[0].0))
                .got(format!("{:.2} s without a position", two[1].0 - two[0].0))
                .allowed(format!("{GAP_S} s"))
                .remedy(
                    "give a position at least that often, or less often in all of it (key frames); or play a section \
                     without the gap, with --from and --to",
                )),
        }
    }

    /// The angle at `time_s`, on the straight line between the points around it.
    fn at(&self, time_s: f64) -> f64 {
        let after = self.points.partition_point(|point| point.0 < time_s);
        let (before, after) = (after.saturating_sub(1), after.min(self.points.len() - 1));
        let ((t0, a), (t1, b)) = (self.points[before], self.points[after]);
        if t1 > t0 { a + (b - a) * ((time_s - t0) / (t1 - t0)).clamp(0.0, 1.0) } else { b }
    }
}

fn known<'a>(robot: &'a Robot, name: &str) -> Result<&'a Joint, Error> {
    robot.joints.iter().find(|joint| joint.name == name).ok_or_else(|| {
        Error::of(ErrorKind::Unknown, "the motion names a joint that the robot does not have")
            .at(format!("robot {}", robot.name))
            .none_of(name, robot.joint_names(), "name it as the robot's file does")
    })
}

/// The angles, which nobody may bend. Those that reach beyond the limits and not beyond the range, less than a count of the
/// drive further, are drawn in about the middle of the range, all by one factor: it stays as smooth as it is.
fn inside(joint: &Joint, angles_rad: &[f64], step_s: f64) -> Result<Vec<f64>, Error> {
    let (lower, upper) = (joint.limits.lower_rad(), joint.limits.upper_rad());
    let (middle, half) = (0.5 * (lower + upper), 0.5 * (upper - lower));
    let reach = angles_rad.iter().map(|angle| (angle - middle).abs()).fold(0.0, f64::max);
    // A curve through angles that rest at a limit would be beyond it by the rounding of its arithmetic.
    let factor = if reach > half - HAIR_RAD { (half - HAIR_RAD).max(0.0) / reach } else { 1.0 };
    let held = |angle: &f64| if factor < 1.0 { middle + (angle - middle) * factor } else { *angle };
    let [from_rad, to_rad] = joint.range_rad;
    let range_rad = from_rad.min(lower) - ROUNDING_RAD..=to_rad.max(upper) + ROUNDING_RAD;
    match angles_rad.iter().position(|angle| !range_rad.contains(angle)) {
        None => Ok(angles_rad.iter().map(held).collect()),
        Some(index) => {
            Err(Error::of(ErrorKind::OutsideLimits, "the motion leaves a joint's limits")
                .at(format!("joint {}, {:.2} s", joint.name, index as f64 * step_s))
                .got(format!("{:.3} deg", angles_rad[index].to_degrees()))
                .allowed(format!("{:.3} to {:.3} deg", from_rad.to_degrees(), to_rad.to_degrees()))
                .remedy("slowing down does not mend this: change the motion"))
        }
    }
}
