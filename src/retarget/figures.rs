//! The figures of a motion on a robot's body: what a person should know before the robot moves.
//!
//! Named as the field names them: penetration, floating, skating (slip) and joint violation after PHUMA
//! (arXiv 2510.26236), tracking and self-collision as the evaluations of GMR (arXiv 2510.02252) and
//! OmniRetarget (arXiv 2509.26633) have them. A foot of a person is in contact where its toe is slower over the
//! floor than [`CONTACT_M_S`](crate::retarget::toe::CONTACT_M_S) and no higher than
//! [`CONTACT_M`](crate::retarget::toe::CONTACT_M) above where it is in the lowest twentieth of the motion.

use crate::body::{Proportions, Segment, SegmentPose};
use crate::error::Error;
use crate::mocap::retarget::RobotModel;
use crate::retarget::Footfall;
use crate::retarget::balance::{Balance, FloorLoad};
use crate::retarget::base::{self, BasePath, Held, StandingSole};
use crate::retarget::collision::{Overlap, SelfContact, TOUCHES_M, lowest_m};
use crate::retarget::effort::{self, Exertion, PeakEffort};
use crate::retarget::fall::OnFloor;
use crate::retarget::footfall::looking_rad;
use crate::retarget::limbs::RobotLimbs;
use crate::retarget::toe::{Toe, quantile};
use crate::rigid::Placement;
use crate::robot::{MotorCurve, RobotBody};
use glam::{DQuat, DVec2, DVec3};
use serde::Serialize;
use std::ops::Range;

/// Deeper in the floor than this is penetration, m.
pub const PENETRATES_M: f64 = 0.005;
/// Spans of time that are no further apart are one, s.
const TOGETHER_S: f64 = 0.1;
/// Most spans that are listed; the longest are kept.
const SPANS: usize = 100;

/// Start and end, s from the start of the trajectory.
pub type TimeSpan = [f64; 2];

/// Mean angles between the long axes of segments and of the links that play them, rad.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct DirectionErrors {
    /// Of both upper arms.
    pub upper_arm: Option<f64>,
    /// Of both forearms.
    pub forearm: Option<f64>,
    /// Of both thighs.
    pub thigh: Option<f64>,
    /// Of both shanks.
    pub shank: Option<f64>,
}

/// A stretch of a motion that is too fast for a robot.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SlowStretch {
    /// From this time of the motion as it came in, s.
    pub start_s: f64,
    /// To this one.
    pub end_s: f64,
    /// How many times as long it has to take at its worst instant.
    pub factor: f64,
    /// The joint that asks for it.
    pub joint: String,
}

/// So long a robot is watched that stands still, s.
const STILL_S: f64 = 3.0;

/// How much slower each instant of a motion would have to be, by itself, for the robot's velocity and
/// acceleration limits.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct PaceNeed {
    /// Of half the instants, at most so much.
    pub median: f64,
    /// The worst instant's.
    pub worst: f64,
    /// Where more than 1 is needed, in the order of time.
    pub local: Vec<SlowStretch>,
}

/// The figures. What does not apply is null, and `missing` says why.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct BodyFigures {
    /// Share of the clip in which two links are deeper than 1 mm in one another. Links at most two
    /// joints apart are left out.
    pub self_collision_share: Option<f64>,
    /// How deep at most, approach included, m.
    pub self_collision_depth_m: Option<f64>,
    /// The two links of that.
    pub self_collision_links: Option<[String; 2]>,
    /// Share of the clip in which something is more than 5 mm below the floor.
    pub penetration_share: Option<f64>,
    /// How fast feet in contact slide, m per second of the clip as it came in.
    pub slip_m_s: Option<f64>,
    /// The same of the person's toes, as if the person's legs were as long as the robot's.
    pub slip_source_m_s: Option<f64>,
    /// Of the tilts of soles in contact 95 % are at most this, rad.
    pub sole_tilt_p95_rad: Option<f64>,
    /// Of the heights of soles in contact above the floor 95 % are at most this, m.
    pub float_p95_m: Option<f64>,
    /// Mean distance of a hand from where it should be, from the shoulder on, m.
    pub hand_error_m: Option<f64>,
    /// The same of ankles, from the hip on.
    pub foot_error_m: Option<f64>,
    /// How links point.
    pub direction_error_rad: DirectionErrors,
    /// Mean difference of how trunks lean against the vertical, rad.
    pub trunk_lean_error_rad: Option<f64>,
    /// How far it has turned at the end, to the left, rad: what the way of its feet over the floor makes of it.
    pub turned_rad: Option<f64>,
    /// The same of the person.
    pub turned_source_rad: Option<f64>,
    /// Least distance of the zero-moment point inside the support, m; outside if negative.
    pub balance_margin_m: Option<f64>,
    /// Share of the trajectory in which it is outside.
    pub unbalanced_share: Option<f64>,
    /// When it is outside.
    pub unbalanced: Vec<TimeSpan>,
    /// When two links are in one another.
    pub colliding: Vec<TimeSpan>,
    /// When a robot on its own feet would be lost; null if never.
    pub predicted_fall_s: Option<f64>,
    /// The same with servos that are softer by a third; null if never, or if its file does not say how they give way.
    pub soft_fall_s: Option<f64>,
    /// Of a motion in which it would be lost, when it would be so standing still in the pose it starts in; null if it stands, or
    /// if its file does not say how its servos give way.
    pub still_fall_s: Option<f64>,
    /// The most torque a servo has to give, as part of its stall torque.
    pub peak_torque: Option<PeakEffort>,
    /// The most voltage it needs for its torque and speed, as part of the one that its figures hold for.
    pub peak_voltage: Option<PeakEffort>,
    /// Root mean square of the jerk of all joints in the clip, rad/s³.
    pub jerk_rms_rad_s3: Option<f64>,
    /// How much slower the motion would have to be, instant by instant.
    pub retime: Option<PaceNeed>,
    /// Why figures are missing, a line each.
    pub missing: Vec<String>,
}

/// A person whose motion it is.
#[derive(Clone, Copy, Debug)]
pub struct Original<'a> {
    /// Poses that follow at `rate_hz`.
    pub poses: &'a [SegmentPose],
    /// Per second.
    pub rate_hz: f64,
    /// Which segments are known.
    pub tracked: &'a [bool; 13],
    /// m.
    pub stature_m: f64,
    /// What of the robot plays what.
    pub model: &'a RobotModel,
}

/// What is looked at.
#[derive(Clone, Copy, Debug)]
pub struct BodyMotion<'a> {
    /// The robot.
    pub body: &'a RobotBody,
    /// The pose it starts in by its file, rad.
    pub start_rad: &'a [f64],
    /// Angles of its joints, rad, at even times from the start of the trajectory.
    pub poses: &'a [Vec<f64>],
    /// Of those per second.
    pub rate_hz: f64,
    /// Of each the time of the motion on the robot that it plays, s.
    pub path_times_s: &'a [f64],
    /// The same of the motion as it came in.
    pub source_times_s: &'a [f64],
    /// Those of the clip, without the way to it.
    pub clip: &'a Range<usize>,
    /// What the motion says of the feet, if it does, and how often in a second of the motion on the robot.
    pub footfalls: Option<(&'a [Footfall], f64)>,
    /// Whose motion it is, if it is somebody's.
    pub original: Option<Original<'a>>,
    /// It hangs on a stand.
    pub hangs: bool,
    /// What turns each of its joints, where that is known.
    pub motors: &'a [Option<MotorCurve>],
}

/// How fast points go over the floor while they are in contact.
#[derive(Default)]
struct Slip {
    way_m: f64,
    time_s: f64,
}

impl Slip {
    fn add(&mut self, from_m: DVec2, to_m: DVec2, time_s: f64) {
        self.way_m += from_m.distance(to_m);
        self.time_s += time_s;
    }

    fn mean_m_s(&self) -> Option<f64> {
        (self.time_s > 0.0).then(|| self.way_m / self.time_s)
    }
}

/// Sums for means.
#[derive(Clone, Copy, Default)]
struct Mean(f64, usize);

impl Mean {
    fn add(&mut self, value: f64) {
        self.0 += value;
        self.1 += 1;
    }

    fn value(self) -> Option<f64> {
        (self.1 > 0).then(|| self.0 / self.1 as f64)
    }
}

/// How far something has turned about the vertical, without jumps of a turn.
#[derive(Clone, Copy, Default)]
struct Turned {
    /// Where it looked first, and last.
    looks_rad: Option<[f64; 2]>,
}

impl Turned {
    fn add(&mut self, turn: DQuat) {
        let before_rad = self.looks_rad.map_or(0.0, |[_, now_rad]| now_rad);
        let now_rad = looking_rad(turn, before_rad);
        self.looks_rad =
            Some([self.looks_rad.map_or(now_rad, |[first_rad, _]| first_rad), now_rad]);
    }

    fn value(self) -> Option<f64> {
        self.looks_rad.map(|[first_rad, last_rad]| last_rad - first_rad)
    }
}

/// Where the base goes, and all figures but those of time.
///
/// # Errors
/// A stature nobody has, a rate too low for anything to be filtered.
pub fn figures(of: &BodyMotion<'_>) -> Result<(BasePath, BodyFigures), Error> {
    let soles = StandingSole::all(of.body);
    let held = Held::of(of.body, &soles, of.hangs);
    let said = |at: usize| of.footfall(at);
    let path = base::path(of.body, &soles, held, of.poses, of.rate_hz, said);
    let figures = of.look(&soles, held, &path)?;
    Ok((path, figures))
}

impl BodyMotion<'_> {
    /// What the motion says of the feet at an instant: on the way to the clip, from two feet to what they do
    /// in its first pose.
    fn footfall(&self, at: usize) -> Option<Footfall> {
        let (footfalls, rate_hz) = self.footfalls?;
        let along = self.path_times_s[at] * rate_hz;
        let last = footfalls.len().checked_sub(1)?;
        let before = (along.max(0.0) as usize).min(last);
        let share = (along - before as f64).clamp(0.0, 1.0);
        let found = footfalls[before].towards(&footfalls[(before + 1).min(last)], share);
        if at >= self.clip.start {
            return Some(found);
        }
        let part = at as f64 / self.clip.start as f64;
        let part = part * part * (3.0 - 2.0 * part);
        let touches = None;
        Some(Footfall { touches, ..Footfall::STANDING.towards(&found, part) })
    }

    fn look(
        &self,
        soles: &[StandingSole],
        held: Held,
        path: &BasePath,
    ) -> Result<BodyFigures, Error> {
        let mut look = Look::new(self, soles, held)?;
        for (at, (pose, place)) in self.poses.iter().zip(&path.places).enumerate() {
            let placed = self.body.tree.place(*place, &self.body.angles(pose));
            look.next(at, &placed, path.contacts[at]);
        }
        let mut figures = look.finish()?;
        figures.jerk_rms_rad_s3 =
            effort::jerk_rms_rad_s3(&self.poses[self.clip.clone()], self.rate_hz);
        self.exert(soles, held, path, &mut figures)?;
        if let Some(drives) = self.body.drives.as_ref().filter(|_| held == Held::Standing) {
            let (body, poses) = (self.body, self.poses);
            let on = OnFloor { body, soles, drives, stiffness: 1.0, friction: 1.0, poses, path };
            let lost_s = |on: OnFloor<'_>| on.lost_at().map(|at| at as f64 / self.rate_hz);
            figures.predicted_fall_s = lost_s(on);
            figures.soft_fall_s = figures.predicted_fall_s.or_else(|| lost_s(on.softly()));
            if figures.predicted_fall_s.is_some() {
                let still = vec![self.poses[0].clone(); (STILL_S * self.rate_hz) as usize + 1];
                let path = &base::path(body, soles, held, &still, self.rate_hz, |_| None);
                figures.still_fall_s = lost_s(OnFloor { poses: &still, path, ..on });
            }
        }
        Ok(figures)
    }
}

impl BodyMotion<'_> {
    /// What it takes of its servos.
    fn exert(
        &self,
        soles: &[StandingSole],
        held: Held,
        path: &BasePath,
        figures: &mut BodyFigures,
    ) -> Result<(), Error> {
        if self.motors.iter().all(Option::is_none) || self.body.tree.mass_kg() <= 0.0 {
            figures
                .missing
                .push("what its motors can do is not known: nothing of torque".to_owned());
            return Ok(());
        }
        let soles = if held == Held::Standing { soles } else { &[] };
        let exertion = Exertion { body: self.body, soles, poses: self.poses, path };
        let torques_nm = exertion.torques_nm()?;
        let links = self.body.tree.links();
        let names: Vec<&str> = links.iter().skip(1).map(|link| link.name.as_str()).collect();
        [figures.peak_torque, figures.peak_voltage] =
            effort::peaks(&torques_nm, self.poses, self.rate_hz, self.motors, &names);
        Ok(())
    }
}

/// Everything that is gathered pose by pose.
struct Look<'a> {
    of: &'a BodyMotion<'a>,
    soles: &'a [StandingSole],
    held: Held,
    original: Option<(Original<'a>, Proportions, RobotLimbs, [Toe; 2])>,
    inside: SelfContact,
    footing: Option<FloorLoad<'a>>,
    deepest: Option<Overlap>,
    colliding: Vec<bool>,
    penetrating: usize,
    /// Where the link of each sole was in the pose before, if it was in contact, m.
    stood_m: Vec<Option<DVec2>>,
    slip: Slip,
    tilts_rad: Vec<f64>,
    floats_m: Vec<f64>,
    directions: [Mean; 4],
    hands: Mean,
    feet: Mean,
    trunk: Mean,
    /// The robot, and the person.
    turned: [Turned; 2],
}

impl<'a> Look<'a> {
    fn new(of: &'a BodyMotion<'a>, soles: &'a [StandingSole], held: Held) -> Result<Self, Error> {
        let original = of.original.map(|original| {
            let lengths = Proportions::of_stature(original.stature_m)?;
            let toes = Toe::both(original.poses, original.rate_hz, &lengths);
            Ok::<_, Error>((original, lengths, RobotLimbs::of(original.model, of.body), toes))
        });
        let stands = held == Held::Standing;
        Ok(Self {
            of,
            soles,
            held,
            original: original.transpose()?,
            inside: SelfContact::of(of.body, of.start_rad),
            footing: stands.then(|| FloorLoad::new(of.body, soles, of.rate_hz)),
            deepest: None,
            colliding: Vec::with_capacity(of.poses.len()),
            penetrating: 0,
            stood_m: vec![None; soles.len()],
            slip: Slip::default(),
            tilts_rad: Vec::new(),
            floats_m: Vec::new(),
            directions: [Mean::default(); 4],
            hands: Mean::default(),
            feet: Mean::default(),
            trunk: Mean::default(),
            turned: [Turned::default(); 2],
        })
    }

    fn next(&mut self, at: usize, placed: &[Placement], stands: [bool; 2]) {
        let overlap = self.inside.deepest(placed);
        self.colliding.push(overlap.is_some_and(|overlap| overlap.depth_m > TOUCHES_M));
        if overlap.map_or(0.0, |of| of.depth_m) > self.deepest.map_or(0.0, |of| of.depth_m) {
            self.deepest = overlap;
        }
        if let Some(footing) = &mut self.footing {
            footing.next(placed);
        }
        if !self.of.clip.contains(&at) {
            return;
        }
        let pose = self.original.as_ref().map(|(original, ..)| {
            let along = self.of.source_times_s[at] * original.rate_hz;
            (along.round().max(0.0) as usize).min(original.poses.len().saturating_sub(1))
        });
        if self.held == Held::Standing {
            self.penetrating += usize::from(lowest_m(self.of.body, placed) < -PENETRATES_M);
            let contact = match (&self.original, pose) {
                (Some((.., toes)), Some(pose)) => {
                    [0, 1].map(|side| toes[side].contact.get(pose) == Some(&true))
                }
                _ => stands,
            };
            self.look_at_soles(at, placed, contact);
            self.turned[0].add(placed[0].turn);
        }
        if let (Some((original, lengths, limbs, _)), Some(pose)) = (&self.original, pose)
            && let Some(person) = original.poses.get(pose)
        {
            let errors = limbs.errors(placed, person, lengths, original.tracked);
            for (segment, off_rad) in errors.directions_rad {
                if let Some(kind) = kind_of(segment) {
                    self.directions[kind].add(off_rad);
                }
            }
            errors.hands_m.into_iter().for_each(|off_m| self.hands.add(off_m));
            errors.feet_m.into_iter().for_each(|off_m| self.feet.add(off_m));
            errors.trunk_lean_rad.into_iter().for_each(|off_rad| self.trunk.add(off_rad));
            let base = limbs.base();
            if self.held == Held::Standing && original.tracked[base.index()] {
                self.turned[1].add(person.orientation[base.index()]);
            }
        }
    }

    fn look_at_soles(&mut self, at: usize, placed: &[Placement], contact: [bool; 2]) {
        let step_s = match at.checked_sub(1) {
            Some(before) => self.of.source_times_s[at] - self.of.source_times_s[before],
            None => 0.0,
        };
        for (sole, stood_m) in self.soles.iter().zip(&mut self.stood_m) {
            let before_m = stood_m.take();
            if !contact[sole.side] {
                continue;
            }
            let place = placed[sole.link];
            let here_m = place.at_m.truncate();
            if let Some(before_m) = before_m {
                self.slip.add(before_m, here_m, step_s);
            }
            *stood_m = Some(here_m);
            self.tilts_rad.push((place.turn * sole.normal).angle_between(DVec3::Z));
            let heights = sole.corners_m.iter().map(|corner| place.point(*corner).z);
            self.floats_m.push(heights.fold(f64::INFINITY, f64::min).max(0.0));
        }
    }

    fn finish(self) -> Result<BodyFigures, Error> {
        let (of, links) = (self.of, self.of.body.tree.links());
        let step_s = 1.0 / of.rate_hz;
        let clip = of.clip.len().max(1) as f64;
        let stands = self.held == Held::Standing;
        let balance = self.footing.map(FloorLoad::finish).transpose()?;
        let mut missing = Vec::new();
        match self.held {
            Held::Standing => {}
            Held::Hanging => missing.push("it hangs: nothing of floor and balance".to_owned()),
            Held::Fixed => missing
                .push("its base is fixed or has no soles: nothing of floor and balance".to_owned()),
        }
        if self.original.is_none() {
            missing.push("no person's motion: nothing to be near to".to_owned());
        }
        missing.extend(self.inside.overlarge().iter().map(|&(one, two)| {
            let [one, two] = [one, two].map(|link| links[link].name.as_str());
            format!(
                "shapes too large: {one} and {two} are in one another from the start, and left out"
            )
        }));
        let colliding = self.colliding[of.clip.clone()].iter().filter(|is| **is).count();
        let outside = |margin: &Option<f64>| margin.is_some_and(|margin_m| margin_m < 0.0);
        let unbalanced: Vec<bool> =
            balance.iter().flat_map(|balance| balance.margins_m.iter().map(outside)).collect();
        let least_m =
            |balance: &Balance| balance.margins_m.iter().flatten().copied().reduce(f64::min);
        let slip_source_m_s = self.original.as_ref().filter(|_| stands).and_then(
            |(original, lengths, limbs, toes)| {
                let mut slip = Slip::default();
                for toe in toes {
                    for (two, contact) in toe.at_m.windows(2).zip(toe.contact.windows(2)) {
                        if contact[0] && contact[1] {
                            let [from_m, to_m] = [two[0], two[1]].map(DVec3::truncate);
                            slip.add(from_m, to_m, 1.0 / original.rate_hz);
                        }
                    }
                }
                let leg = |joint| lengths.joint_offset_m(joint).map(|(_, at_m)| at_m.length());
                let leg_m =
                    leg(crate::body::Joint::LeftKnee)? + leg(crate::body::Joint::LeftAnkle)?;
                Some(slip.mean_m_s()? * limbs.leg_m()? / leg_m)
            },
        );
        let [upper_arm, forearm, thigh, shank] = self.directions.map(Mean::value);
        Ok(BodyFigures {
            self_collision_share: Some(colliding as f64 / clip),
            self_collision_depth_m: Some(self.deepest.map_or(0.0, |deepest| deepest.depth_m)),
            self_collision_links: self
                .deepest
                .map(|Overlap { links: (a, b), .. }| [a, b].map(|link| links[link].name.clone())),
            penetration_share: stands.then(|| self.penetrating as f64 / clip),
            slip_m_s: self.slip.mean_m_s(),
            slip_source_m_s,
            sole_tilt_p95_rad: quantile(self.tilts_rad, 0.95),
            float_p95_m: quantile(self.floats_m, 0.95),
            hand_error_m: self.hands.value(),
            foot_error_m: self.feet.value(),
            direction_error_rad: DirectionErrors { upper_arm, forearm, thigh, shank },
            trunk_lean_error_rad: self.trunk.value(),
            turned_rad: self.turned[0].value(),
            turned_source_rad: self.turned[1].value(),
            balance_margin_m: balance.as_ref().and_then(least_m),
            unbalanced_share: balance.as_ref().map(|_| {
                let count = unbalanced.iter().filter(|is| **is).count();
                count as f64 / unbalanced.len().max(1) as f64
            }),
            unbalanced: spans(&unbalanced, step_s),
            colliding: spans(&self.colliding, step_s),
            predicted_fall_s: balance
                .and_then(|balance| balance.falls_at)
                .map(|at| at as f64 * step_s),
            soft_fall_s: None,
            still_fall_s: None,
            peak_torque: None,
            peak_voltage: None,
            jerk_rms_rad_s3: None,
            retime: None,
            missing,
        })
    }
}

const fn kind_of(segment: Segment) -> Option<usize> {
    match segment {
        Segment::LeftUpperArm | Segment::RightUpperArm => Some(0),
        Segment::LeftForearm | Segment::RightForearm => Some(1),
        Segment::LeftThigh | Segment::RightThigh => Some(2),
        Segment::LeftShank | Segment::RightShank => Some(3),
        _ => None,
    }
}

/// When something is so, s.
fn spans(is_so: &[bool], step_s: f64) -> Vec<TimeSpan> {
    let mut spans: Vec<TimeSpan> = Vec::new();
    for at in (0..is_so.len()).filter(|at| is_so[*at]) {
        let time_s = at as f64 * step_s;
        match spans.last_mut() {
            Some(last) if time_s - last[1] <= TOGETHER_S => last[1] = time_s,
            _ => spans.push([time_s, time_s]),
        }
    }
    if spans.len() > SPANS {
        spans.sort_by(|a, b| (b[1] - b[0]).total_cmp(&(a[1] - a[0])));
        spans.truncate(SPANS);
        spans.sort_by(|a, b| a[0].total_cmp(&b[0]));
    }
    spans
}

#[cfg(test)]
mod tests;
