//! Whether each joint turns the way the robot's file says: moved a little, one after the other, through everything a motion
//! goes through, while somebody looks.

use super::calibrate::{homing, save};
use super::observer::{Event, Observer};
use super::report::{Outcome, PlayReport};
use crate::calibration::{Calibration, JointCalibration};
use crate::control::{self, Planned, Sample, Settings, Sink, Stop, StopCode, StopReason, inject};
use crate::error::{Error, ErrorKind};
use crate::motion::{Path as MotionPath, PlanOptions, plan};
use crate::rig::{Address, Connection, calibrated, connect};
use crate::robot::Joint;
use crate::robot::preflight::{Accept, preflight};
use serde::Serialize;
use std::fmt::Write;
use std::path::PathBuf;

/// Samples per second of the way out and back.
const RATE_HZ: f64 = 50.0;
/// Out takes so long, and back, s; in between the joint rests, so that nobody mistakes one for the other.
const WAY_S: f64 = 1.0;
const REST_S: f64 = 0.5;
/// How far a joint may be told to go, rad: 1 to 20 deg.
const LEAST_RAD: f64 = 0.0174;
const MOST_RAD: f64 = 0.35;
/// A joint that was seen to go less than this share of its way has not shown which way it turns.
const SEEN_SHARE: f64 = 0.5;

/// Which robot, and how far its joints go.
#[derive(Clone, Debug, PartialEq)]
pub struct DirectionOrder {
    /// Robot by name, or path of its file.
    pub robot: String,
    /// Where its lines are.
    pub buses: Vec<Address>,
    /// Calibration of this robot; `None`: the one that was kept, if there is one.
    pub calibration: Option<PathBuf>,
    /// Only these joints; none: all.
    pub joints: Vec<String>,
    /// How far each goes, rad.
    pub by_rad: f64,
    /// Servos whose firmware the profile was not checked against are moved too.
    pub accept_firmware: bool,
    /// Torque goes off at the end.
    pub limp: bool,
    /// Write a calibration in which what turns the wrong way is turned round, to this file.
    pub save: Option<PathBuf>,
    /// Everything is checked and said, nothing written.
    pub dry_run: bool,
}

/// What somebody who looks on says of a joint that has moved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DirectionAnswer {
    /// It moved as was said.
    Right,
    /// It moved the other way.
    Wrong,
    /// Once more, please.
    Again,
    /// Nobody could tell.
    Skip,
    /// That is enough.
    Stop,
}

/// How a joint turns.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Turns {
    /// As the file says.
    Right,
    /// The other way.
    Wrong,
    /// It was told to move and did not.
    DoesNotMove,
    /// Nobody could tell, or nobody was asked.
    Unknown,
}

/// A joint, what it was to do, and what came of it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DirectionFound {
    /// Its name.
    pub name: String,
    /// Where it stood, rad.
    pub start_rad: f64,
    /// How far it was to go, rad: up, unless the end of its range is near.
    pub by_rad: f64,
    /// Which way that is, in words.
    pub which_way: String,
    /// How far it was seen to go by its own servo, rad; null if it was not moved.
    pub moved_rad: Option<f64>,
    /// Which way it turns.
    pub turns: Turns,
}

/// What came of all joints.
#[derive(Clone, Debug, Serialize)]
pub struct DirectionReport {
    /// `done`, `done_with_loss` if a joint turns the wrong way or does not move, `stopped`.
    pub outcome: Outcome,
    /// Why it ended early.
    pub stop_reason: Option<String>,
    /// The same as data.
    pub stop: Option<Stop>,
    /// The robot's name.
    pub robot: String,
    /// Nothing was written.
    pub dry_run: bool,
    /// The calibration that was used.
    pub calibration: Option<PathBuf>,
    /// Joint by joint.
    pub joints: Vec<DirectionFound>,
    /// The calibration that was written.
    pub saved: Option<PathBuf>,
    /// What else a person should know.
    pub notes: Vec<String>,
}

/// Moves each joint a little and asks `look` which way that was.
///
/// # Errors
/// Anything preflight, planning or arming has against it; a calibration that cannot be written.
pub fn directions(
    order: &DirectionOrder,
    observer: &dyn Observer,
    look: &mut dyn FnMut(&DirectionFound) -> DirectionAnswer,
) -> Result<DirectionReport, Error> {
    if !(LEAST_RAD..=MOST_RAD).contains(&order.by_rad) {
        return Err(Error::of(ErrorKind::OutsideLimits, "nobody moves a joint so far for a look")
            .at("--by")
            .got(format!("{:.2} deg", order.by_rad.to_degrees()))
            .allowed("1 to 20 deg"));
    }
    let (robot, calibration) =
        calibrated(&order.robot, &order.buses, order.calibration.as_deref())?;
    let mut connection = connect(robot, &order.buses, 0)?;
    on(&mut connection, order, calibration, observer, look)
}

/// The same on a robot that is open.
fn on(
    connection: &mut Connection,
    order: &DirectionOrder,
    calibration: Option<PathBuf>,
    observer: &dyn Observer,
    look: &mut dyn FnMut(&DirectionFound) -> DirectionAnswer,
) -> Result<DirectionReport, Error> {
    let which = chosen(&connection.link.robot().joint_names(), &order.joints)?;
    let mut report = DirectionReport {
        outcome: Outcome::Done,
        stop_reason: None,
        stop: None,
        robot: connection.link.robot().name.clone(),
        dry_run: order.dry_run,
        calibration,
        joints: Vec::new(),
        saved: None,
        notes: Vec::new(),
    };
    for joint in which {
        match one(connection, joint, order, observer, look, &mut report) {
            Ok(true) => {}
            Ok(false) => break,
            // What was found before stays told: a servo that is gone, a robot that may not be moved any more.
            Err(error) if !report.joints.is_empty() => {
                report.outcome = Outcome::Failed;
                report.stop_reason = Some(error.to_string());
                let held =
                    "joints hold where they stand, those that answer: gaitway limp lets them go";
                report.notes.push(held.to_owned());
                break;
            }
            Err(error) => return Err(error),
        }
    }
    let is_done = report.outcome == Outcome::Done;
    if order.limp && !order.dry_run && report.stop.as_ref().is_none_or(is_asked) {
        report.notes.push(match control::arm::disarm(&mut connection.link) {
            Ok(()) => "torque is off on every joint".to_owned(),
            Err(error) if report.outcome == Outcome::Failed => error.to_string(),
            Err(error) => return Err(error),
        });
    }
    if let Some(file) = order.save.as_ref().filter(|_| is_done && !order.dry_run) {
        let turned = turned_round(connection, &report)?;
        save(file, &turned)?;
        report.saved = Some(file.clone());
    }
    let unwell = |of: &DirectionFound| matches!(of.turns, Turns::Wrong | Turns::DoesNotMove);
    if is_done && report.joints.iter().any(unwell) {
        report.outcome = Outcome::DoneWithLoss;
    }
    Ok(report)
}

fn is_asked(stop: &Stop) -> bool {
    stop.code == StopCode::Asked
}

/// Indices of the joints that are meant.
fn chosen(names: &[String], wanted: &[String]) -> Result<Vec<usize>, Error> {
    if wanted.is_empty() {
        return Ok((0..names.len()).collect());
    }
    let index = |wanted: &String| {
        names.iter().position(|name| name == wanted).ok_or_else(|| {
            Error::of(ErrorKind::Unknown, "the robot has no such joint").at("--joint").none_of(
                wanted,
                names,
                "take one of these",
            )
        })
    };
    wanted.iter().map(index).collect()
}

/// Moves one joint until somebody has told which way it turns; false if that is the end of it all.
fn one(
    connection: &mut Connection,
    joint: usize,
    order: &DirectionOrder,
    observer: &dyn Observer,
    look: &mut dyn FnMut(&DirectionFound) -> DirectionAnswer,
    report: &mut DirectionReport,
) -> Result<bool, Error> {
    let number = report.joints.len();
    loop {
        if observer.wants_to_stop() {
            return Ok(ended(report));
        }
        let Some(found) = moved(connection, joint, order, observer, report)? else {
            return Ok(false);
        };
        report.joints.truncate(number);
        report.joints.push(found);
        let found = &mut report.joints[number];
        if order.dry_run || found.by_rad == 0.0 {
            return Ok(true);
        }
        if !(found.moved_rad.unwrap_or(0.0).abs() >= SEEN_SHARE * found.by_rad.abs()) {
            found.turns = Turns::DoesNotMove;
            return Ok(true);
        }
        match look(found) {
            DirectionAnswer::Right => found.turns = Turns::Right,
            DirectionAnswer::Wrong => found.turns = Turns::Wrong,
            DirectionAnswer::Skip => {}
            DirectionAnswer::Again => continue,
            DirectionAnswer::Stop => return Ok(ended(report)),
        }
        return Ok(true);
    }
}

/// Somebody has had enough.
fn ended(report: &mut DirectionReport) -> bool {
    report.outcome = Outcome::Stopped;
    report.stop_reason = Some(StopReason::Asked.to_string());
    report.stop = Some(Stop::of(StopCode::Asked));
    false
}

/// The joint goes out and back; nothing if a stop ended that.
fn moved(
    connection: &mut Connection,
    joint: usize,
    order: &DirectionOrder,
    observer: &dyn Observer,
    report: &mut DirectionReport,
) -> Result<Option<DirectionFound>, Error> {
    let link = &mut connection.link;
    let settings = Settings::at_rate(link.robot().file.rate_hz);
    inject::point("preflight", 0);
    let accept = Accept { firmware: order.accept_firmware, eeprom: false };
    let preflight = preflight(link, settings.period, accept)?;
    let start_rad = preflight.start_rad[joint];
    let of = &link.robot().joints[joint];
    let by_rad = way_rad(of, start_rad, order.by_rad);
    let found = DirectionFound {
        name: of.name.clone(),
        start_rad,
        by_rad,
        which_way: which_way(&link.robot().file, &of.name, by_rad),
        moved_rad: None,
        turns: Turns::Unknown,
    };
    let rows: Vec<Vec<f64>> = preflight
        .start_rad
        .iter()
        .enumerate()
        .map(|(index, &rad)| match index == joint {
            true => out_and_back().map(|share| rad + share * by_rad).collect(),
            false => vec![rad; out_and_back().count()],
        })
        .collect();
    let path = MotionPath::new(link.robot().joint_names(), RATE_HZ, rows)?;
    let planned =
        plan(&preflight.start_rad, &path, &link.robot().limits(), PlanOptions::default())?;
    if order.dry_run || by_rad == 0.0 {
        return Ok(Some(found));
    }
    observer.hear(Event::Note(&format!(
        "{} turns by {:+.1} deg and back: {}",
        found.name,
        by_rad.to_degrees(),
        found.which_way
    )));
    let mut farthest = Farthest { joint, start_rad, rad: 0.0 };
    let mut motion = Planned::new(&planned.trajectory, link.robot())?;
    let performed = control::perform(
        link,
        &preflight,
        &mut motion,
        settings,
        &mut farthest,
        &|| observer.wants_to_stop(),
        &mut |_| {},
    )?;
    let mut told = PlayReport::new("doctor", &report.robot, Vec::new());
    told.describe_performance(&performed);
    if told.outcome != Outcome::Done {
        (report.outcome, report.stop_reason, report.stop) =
            (told.outcome, told.stop_reason, told.stop);
        report.notes.extend(told.notes);
        return Ok(None);
    }
    Ok(Some(DirectionFound { moved_rad: Some(farthest.rad), ..found }))
}

/// From 0 to 1, a rest, and to 0 again; smooth, so that nothing has to be slowed.
fn out_and_back() -> impl Iterator<Item = f64> {
    let at = |n: usize| n as f64 / RATE_HZ;
    let smooth = |share: f64| share.powi(3) * (10.0 - 15.0 * share + 6.0 * share * share);
    let count = ((2.0 * WAY_S + REST_S) * RATE_HZ) as usize + 1;
    (0..count).map(at).map(move |s| {
        let back_s = s - WAY_S - REST_S;
        match back_s > 0.0 {
            true => 1.0 - smooth((back_s / WAY_S).min(1.0)),
            false => smooth((s / WAY_S).min(1.0)),
        }
    })
}

/// Up, unless the range ends there; zero where there is no room either way.
fn way_rad(joint: &Joint, start_rad: f64, by_rad: f64) -> f64 {
    let within = |rad: f64| rad >= joint.limits.lower_rad() && rad <= joint.limits.upper_rad();
    [by_rad, -by_rad].into_iter().find(|by_rad| within(start_rad + by_rad)).unwrap_or(0.0)
}

/// How a joint that turns by this much is seen to turn, as the robot's file has it.
fn which_way(robot: &gaitway_profiles::Robot, name: &str, by_rad: f64) -> String {
    let up = by_rad > 0.0;
    let end = if up { "the upper end of its range" } else { "the lower end of its range" };
    let joint = robot.joints.iter().find(|joint| joint.name == name);
    let Some(axis) = joint.and_then(|joint| joint.axis) else { return format!("towards {end}") };
    // In the zero pose: x forwards, y to the robot's left, z up.
    let ways = [("forwards", "backwards"), ("to its left", "to its right"), ("up", "down")];
    let (most, part) = axis.iter().enumerate().fold((0, 0.0_f64), |best, (index, part)| {
        if part.abs() > best.1.abs() { (index, *part) } else { best }
    });
    let (with, against) = ways[most];
    let thumb = if (part > 0.0) == up { with } else { against };
    format!(
        "as the fingers of a right hand curl whose thumb points {thumb} (robot in its zero pose)"
    )
}

/// How far a joint was from where it started.
struct Farthest {
    joint: usize,
    start_rad: f64,
    rad: f64,
}

impl Sink for Farthest {
    fn take(&mut self, sample: &Sample<'_>) {
        if let Some(Ok((state, _))) = sample.states.get(self.joint) {
            let off_rad = state.position_rad - self.start_rad;
            if off_rad.abs() > self.rad.abs() {
                self.rad = off_rad;
            }
        }
    }
}

/// The calibration in force, with every joint turned round that turns the wrong way. Its zero stays where it is.
fn turned_round(
    connection: &mut Connection,
    report: &DirectionReport,
) -> Result<Calibration, Error> {
    let link = &mut connection.link;
    let mut turned = match &report.calibration {
        Some(path) => Calibration::read(path)?,
        None => Calibration::of(&report.robot),
    };
    for found in report.joints.iter().filter(|of| of.turns == Turns::Wrong) {
        let index = link.robot().joints.iter().position(|joint| joint.name == found.name);
        let Some(index) = index else { continue };
        let in_force = homing::in_force(link, index)?;
        let known = turned.joint(&found.name).cloned();
        let file = link.robot().file.joints.iter().find(|joint| joint.name == found.name);
        let Some(file) = file else { continue };
        turned.put(JointCalibration {
            name: found.name.clone(),
            direction: -file.direction,
            offset_rad: 0.0 - file.offset_rad,
            lower_rad: known.as_ref().and_then(|of| of.upper_rad).map(|rad| -rad),
            upper_rad: known.as_ref().and_then(|of| of.lower_rad).map(|rad| -rad),
            homing_offset_raw: known.map_or(in_force, |of| of.homing_offset_raw),
        });
    }
    Ok(turned)
}

impl DirectionReport {
    /// As a person reads it.
    #[must_use]
    pub fn text(&self) -> String {
        let mut text = String::new();
        for found in &self.joints {
            let (by, from) = (found.by_rad.to_degrees(), found.start_rad.to_degrees());
            let what = match (found.turns, found.moved_rad) {
                (_, None) if found.by_rad == 0.0 => {
                    format!(
                        "has no room from {from:.1} deg to show which way it turns: take a smaller --by"
                    )
                }
                (_, None) => format!("would turn by {by:+.1} deg from {from:.1} deg and back"),
                (Turns::Right, _) => "turns the right way".to_owned(),
                (Turns::Wrong, _) => "turns THE WRONG WAY".to_owned(),
                (Turns::DoesNotMove, Some(moved_rad)) => format!(
                    "does not move: {:+.1} of {by:+.1} deg; check its horn, its load and its torque limit",
                    moved_rad.to_degrees()
                ),
                (Turns::Unknown, _) => "was moved; nobody told which way".to_owned(),
            };
            let _ = writeln!(text, "{:18} {what}", found.name);
        }
        for note in &self.notes {
            let _ = writeln!(text, "note      {note}");
        }
        if let Some(reason) = &self.stop_reason {
            let _ = writeln!(text, "stopped   {reason}");
        }
        let wrong = self.joints.iter().any(|found| found.turns == Turns::Wrong);
        match &self.saved {
            Some(file) => {
                let _ = writeln!(text, "saved     {}: use it with --calibration", file.display());
            }
            None if wrong => text.push_str(
                "to do     --save FILE.toml writes a calibration that turns these round; or measure them: gaitway calibrate\n",
            ),
            None => {}
        }
        text
    }
}

/// What is asked of who looks on.
#[must_use]
pub fn question(found: &DirectionFound) -> String {
    format!(
        "  did {} turn that way? y yes, n the other way, a again, s cannot tell, q quit: ",
        found.name
    )
}

/// What was answered, if that is an answer.
#[must_use]
pub fn answered(line: &str) -> Option<DirectionAnswer> {
    Some(match line.trim().to_ascii_lowercase().as_str() {
        "y" | "yes" => DirectionAnswer::Right,
        "n" | "no" => DirectionAnswer::Wrong,
        "a" => DirectionAnswer::Again,
        "s" => DirectionAnswer::Skip,
        "q" => DirectionAnswer::Stop,
        _ => return None,
    })
}

#[cfg(test)]
mod tests;
