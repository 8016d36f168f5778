//! Walking, jogging, hops and jumps that go somewhere.
//!
//! The shipped actions say how legs push off and land. Where they come down is asked for here: the seams of the legs (angles,
//! times, peaks) are moved, as little as goes, until feet come down there, stand still where they stand, and the root is
//! accelerated about as it was: damped least squares, in steps from where the action goes by itself. Backwards is forwards
//! in another direction of time: people who walk backwards do about that (Winter, Pluck, Yang, "Backward walking: a simple
//! reversal of forward walking?", Journal of Motor Behavior 21, 1989).

use core::f64::consts::{PI, TAU};
use core::ops::Range;
use glam::{DQuat, DVec3};
use nalgebra::{DMatrix, DVector};

use super::damped;
use super::reach::feet_m;
use super::{Made, Mark, Marked, Performer, way};
use crate::action::feet::{Feet, FootingBounds};
use crate::action::fit::Fits;
use crate::action::motion::then_until;
use crate::action::{Motion, vocabulary};
use crate::actionlet::shape::PEAK_AT;
use crate::actionlet::{Sequence, Shape};
use crate::body::contact::ON_FLOOR_M;
use crate::body::{Dof, Proportions, root, stance};
use crate::error::Error;

const LOOKS_HZ: f64 = 125.0;
/// Moved as a matter of course: rad, s, T.
const USUAL_RAD: f64 = 0.12;
const USUAL_S: f64 = 0.015;
const USUAL_T: f64 = 0.1;
/// What is moved as a matter of course counts so much.
const PRIOR: f64 = 0.15;
/// As bad as one another: soles, m, for so long, s; the root, m/s^2; where feet end, m.
const HOLDS_M: f64 = 0.000_7;
const HOLDS_FOR_S: f64 = 0.05;
const ROOT_HOLDS_M_S2: f64 = 5.0;
const AWAY_M: f64 = 0.000_5;
/// Of all that were tried the best is taken: with feet that end as near as this, m, where they are to be.
const MOST_AWAY_M: f64 = 0.015;
/// A sole that swings keeps so high, m.
const CLEAR_M: f64 = 0.009;
/// The way there is gone in steps of so much, m.
const STEP_M: f64 = 0.06;
const NUDGE: f64 = 0.05;
/// Regressions at each step, and at the last.
const TRIES: usize = 5;
const LAST_TRIES: usize = 25;
/// The last at which they still gain this part.
const ENOUGH: f64 = 0.01;
const LAST_ENOUGH: f64 = 0.001;
const DAMPINGS: [f64; 6] = [0.01, 0.1, 1.0, 10.0, 100.0, 1e4];
/// Seams of a chain stay so far apart, s.
const APART_S: f64 = 0.02;
/// Joints that let a leg go sideways move when its hip does.
const ASIDE: [(Dof, [Dof; 2]); 2] = [
    (Dof::LeftHipFlexion, [Dof::LeftHipAbduction, Dof::LeftHipRotation]),
    (Dof::RightHipFlexion, [Dof::RightHipAbduction, Dof::RightHipRotation]),
];
/// Nobody goes further in two hops or a jump, parts of the stature.
const MOST_GONE: f64 = 0.25;
/// Rounds of a walk, a jog and hops.
const WALKS: u32 = 2;
const JOGS: u32 = 2;
const HOPS: u32 = 2;
/// Walks in other directions are so many steps of this length, parts of the stature.
const STEPS: usize = 3;
const STEP: f64 = 0.17;

/// A chain of a leg, as it may be moved.
#[derive(Clone, Debug)]
struct Line {
    dof: Dof,
    from_rad: f64,
    /// When, at which angle, and where the speed has its peak.
    seams: Vec<(f64, f64, f64)>,
}

impl Line {
    fn of(motion: &Motion, dof: Dof) -> Self {
        let track = motion.track(dof);
        let peak = |shape: &Shape| match shape {
            Shape::HalfSine(peak_at) => peak_at.value(),
            _ => 0.5,
        };
        let seam = |piece: &crate::actionlet::Actionlet| {
            (piece.end_s(), piece.to_rad(), peak(piece.shape()))
        };
        let seams = track.actionlets().iter().map(seam).collect();
        Self { dof, from_rad: track.from_rad(), seams }
    }

    /// Figures that may be moved: the last angle and time stay.
    fn figures(&self) -> usize {
        (3 * self.seams.len()).saturating_sub(2)
    }

    fn moved(&self, x: &[f64]) -> Option<Self> {
        let mut line = self.clone();
        let last = line.seams.len() - 1;
        let (lower, upper) = line.dof.range_rad();
        let mut x = x.iter();
        let mut next = |usual: f64| x.next().map_or(0.0, |x| x * usual);
        for (at, seam) in line.seams.iter_mut().enumerate() {
            seam.2 = (seam.2 + next(USUAL_T)).clamp(*PEAK_AT.start(), *PEAK_AT.end());
            if at < last {
                seam.0 += next(USUAL_S);
                let rad = seam.1 + next(USUAL_RAD);
                seam.1 = rad.clamp(lower.min(seam.1), upper.max(seam.1));
            }
        }
        let mut before_s = 0.0;
        for (at_s, ..) in &line.seams {
            if at_s - before_s < APART_S {
                return None;
            }
            before_s = *at_s;
        }
        Some(line)
    }

    fn chain(&self) -> Result<Sequence, Error> {
        let start = Sequence::starting_at(0.0, self.from_rad)?;
        self.seams.iter().try_fold(start, |chain, (at_s, rad, peak)| {
            then_until(chain, *at_s, *rad, Shape::half_sine(*peak)?)
        })
    }
}

struct Travel<'a> {
    body: &'a Proportions,
    given: Motion,
    lines: Vec<Line>,
    feet: Feet,
    contacts: Vec<(usize, Range<usize>)>,
}

impl<'a> Travel<'a> {
    fn of(body: &'a Proportions, given: Motion, aside: bool) -> Result<Self, Error> {
        let mut lines: Vec<Line> = Dof::ALL
            .into_iter()
            .filter(|dof| dof.is_of_leg())
            .map(|dof| Line::of(&given, dof))
            .collect();
        // Seams at which a leg may go sideways, where it does not yet.
        for (hip, others) in ASIDE {
            let seams = lines.iter().find(|line| line.dof == hip).map(|line| line.seams.clone());
            for line in lines.iter_mut().filter(|line| others.contains(&line.dof)) {
                let rests = line.seams.iter().all(|(_, rad, _)| *rad == line.from_rad);
                if rests && aside {
                    let own = seams.iter().flatten();
                    line.seams = own.map(|(at_s, ..)| (*at_s, line.from_rad, 0.5)).collect();
                }
            }
        }
        lines.retain(|line| aside || line.seams.iter().any(|(_, rad, _)| *rad != line.from_rad));
        let feet = feet(body, &given)?;
        let contacts = feet.contacts();
        Ok(Self { body, given, lines, feet, contacts })
    }

    fn motion(&self, x: &DVector<f64>) -> Result<Option<Motion>, Error> {
        let mut tracks = self.given.clone().into_tracks();
        let mut at = 0;
        for line in &self.lines {
            let range = at..at + line.figures();
            at = range.end;
            let Some(moved) = line.moved(&x.as_slice()[range]) else { return Ok(None) };
            tracks[line.dof.index()] = moved.chain()?;
        }
        Motion::new(tracks).map(Some)
    }

    fn off(&self, x: &DVector<f64>, goes_m: DVec3) -> Result<Option<DVector<f64>>, Error> {
        let Some(motion) = self.motion(x)? else { return Ok(None) };
        let now = feet(self.body, &motion)?;
        let own = &self.feet;
        let last = now.soles_m.len() - 1;
        let part = (1.0 / (LOOKS_HZ * HOLDS_FOR_S)).sqrt();
        let mut off: Vec<f64> = x.iter().map(|x| x * PRIOR).collect();
        let mut stands = vec![[false; 4]; own.soles_m.len()];
        for (sole, range) in &self.contacts {
            let mean_m = |soles_m: &[[DVec3; 4]], sole: usize| {
                range.clone().map(|look| soles_m[look.min(last)][sole]).sum::<DVec3>()
                    / range.len() as f64
            };
            let (mean_now_m, mean_own_m) =
                (mean_m(&now.soles_m, *sole), mean_m(&own.soles_m, *sole));
            for look in range.clone() {
                stands[look][*sole] = true;
                let (now_m, own_m) = (now.soles_m[look.min(last)][*sole], own.soles_m[look][*sole]);
                let slid_m = (now_m - mean_now_m) - (own_m - mean_own_m) * 0.7;
                let slid_m = slid_m.with_z(now_m.z - own_m.z);
                off.extend((slid_m * (part / HOLDS_M)).to_array());
            }
            // Feet point where they did.
            let other = sole ^ 1;
            let along = |soles_m| mean_m(soles_m, *sole).y - mean_m(soles_m, other).y;
            off.push((along(&now.soles_m) - along(&own.soles_m)) / 0.003);
        }
        for (look, stands) in stands.iter().enumerate() {
            for sole in (0..4).filter(|sole| !stands[*sole]) {
                let height_m = own.soles_m[look][sole].z;
                if height_m < 6.0 * ON_FLOOR_M {
                    let low_m =
                        (now.soles_m[look.min(last)][sole].z - height_m.min(CLEAR_M)).min(0.0);
                    off.push(low_m * part / HOLDS_M);
                }
            }
        }
        let mut bends_m = now.bends_m();
        for own_m in own.bends_m() {
            let bend_m = bends_m.next().unwrap_or(own_m);
            let scale = LOOKS_HZ * LOOKS_HZ * part / ROOT_HOLDS_M_S2;
            off.extend(((bend_m - own_m) * scale).to_array());
        }
        off.extend(((now.away_m() - goes_m) / AWAY_M).to_array());
        Ok(Some(DVector::from_vec(off)))
    }

    /// The motion that goes there.
    fn going(&self, goes_m: DVec3) -> Result<Motion, Error> {
        let by_itself_m = self.feet.away_m();
        let steps = ((goes_m - by_itself_m).length() / STEP_M).ceil().max(1.0) as usize;
        let mut x = DVector::zeros(self.lines.iter().map(Line::figures).sum());
        let mut best: Option<(f64, Motion)> = None;
        for step in 1..=steps {
            let at_m = by_itself_m + (goes_m - by_itself_m) * (step as f64 / steps as f64);
            let last = step == steps;
            let (tries, enough) = if last { (LAST_TRIES, LAST_ENOUGH) } else { (TRIES, ENOUGH) };
            for _ in 0..tries {
                let (next, gained) = self.regressed(x, at_m)?;
                x = next;
                if last && let Some(motion) = self.motion(&x)? {
                    let away_m = (feet(self.body, &motion)?.away_m() - goes_m).length();
                    let share = FootingBounds::default().share(&motion, self.body)?;
                    let worth = share.max(away_m / MOST_AWAY_M);
                    if best.as_ref().is_none_or(|(least, _)| worth < *least) {
                        best = Some((worth, motion));
                    }
                }
                if gained < enough {
                    break;
                }
            }
        }
        Ok(best.map_or_else(|| self.given.clone(), |(_, motion)| motion))
    }

    fn regressed(&self, x: DVector<f64>, goes_m: DVec3) -> Result<(DVector<f64>, f64), Error> {
        let Some(now) = self.off(&x, goes_m)? else { return Ok((x, 0.0)) };
        let mut answers = DMatrix::zeros(now.len(), x.len());
        for index in 0..x.len() {
            let mut nudged = x.clone();
            nudged[index] += NUDGE;
            if let Some(off) = self.off(&nudged, goes_m)? {
                answers.set_column(index, &((off - &now) / NUDGE));
            }
        }
        let then =
            |next: DVector<f64>| Ok::<_, Error>(self.off(&next, goes_m)?.map(|off| (next, off)));
        let step = damped::step(&x, (&now, &answers), &DAMPINGS, then)?;
        Ok(step.map_or((x, 0.0), |step| (step.at, step.gained)))
    }
}

fn feet(body: &Proportions, motion: &Motion) -> Result<Feet, Error> {
    let mut angles = motion.sampled(LOOKS_HZ)?;
    angles.push(motion.angles_at(motion.duration_s()));
    let mut poses = stance::poses(body, &angles, LOOKS_HZ);
    let roots_m = root::path_m(body, &poses, LOOKS_HZ);
    for (pose, root_m) in poses.iter_mut().zip(roots_m) {
        pose.root_m = root_m;
    }
    Ok(Feet::of(body, &poses))
}

/// A shipped action as a body does it.
fn shipped(body: &Proportions, name: &str, rounds: u32) -> Result<Motion, Error> {
    let action = Fits::of(*body).fit(&vocabulary::find(name)?)?;
    action.perform_rounds(rounds)
}

/// The same motion backwards in time: every chain of actionlets is one.
pub(super) fn backwards(motion: &Motion) -> Result<Motion, Error> {
    let end_s = motion.duration_s();
    let turned = |dof: Dof| {
        let track = motion.track(dof);
        let start = Sequence::starting_at(0.0, track.to_rad())?;
        track.actionlets().iter().rev().try_fold(start, |chain, piece| {
            let shape = match piece.shape() {
                Shape::HalfSine(peak_at) => {
                    let peak_at = (1.0 - peak_at.value()).clamp(*PEAK_AT.start(), *PEAK_AT.end());
                    Shape::half_sine(peak_at)?
                }
                other => other.clone(),
            };
            then_until(chain, end_s - piece.begin_s(), piece.from_rad(), shape)
        })
    };
    Motion::new(Dof::ALL.into_iter().map(turned).collect::<Result<_, Error>>()?)
}

/// Where the feet end.
fn arrived(body: &Proportions, motion: Motion, goes_m: Option<DVec3>) -> Result<Made, Error> {
    let away_m = feet(body, &motion)?.away_m();
    let poser = super::posing::Poser::of(*body);
    let at_m = feet_m(&poser).extend(0.0) + goes_m.unwrap_or(away_m);
    let mark = Mark { of: Marked::Feet, at_s: motion.duration_s(), at_m };
    Ok(Made::of(motion, vec![mark]))
}

/// Whether a direction is forward (1), backward (-1), or another.
fn straight(direction_rad: f64) -> i32 {
    let near = |to: f64| ((direction_rad - to + PI).rem_euclid(TAU) - PI).abs() < 1e-6;
    i32::from(near(0.0)) - i32::from(near(PI))
}

fn there_or_back(body: &Proportions, motion: Motion, straight: i32) -> Result<Made, Error> {
    let motion = if straight < 0 { backwards(&motion)? } else { motion };
    arrived(body, motion, None)
}

pub(super) fn walk(performer: &mut Performer, direction_rad: f64) -> Result<Made, Error> {
    let body = *performer.body();
    match straight(direction_rad) {
        0 => {
            let step = (direction_rad, STEP * body.stature_m());
            performer.steps()?.made(&[step; STEPS])
        }
        straight => there_or_back(&body, shipped(&body, "walk", WALKS)?, straight),
    }
}

pub(super) fn jog(performer: &mut Performer, direction_rad: f64) -> Result<Made, Error> {
    let body = *performer.body();
    // Who jogs faces where they go.
    let made = arrived(&body, shipped(&body, "run", JOGS)?, None)?;
    let turn = DQuat::from_rotation_z(-direction_rad);
    let marks = made.marks.iter().map(|mark| Mark { at_m: turn * mark.at_m, ..*mark }).collect();
    Ok(Made::of(made.motion.facing(-direction_rad), marks))
}

fn gone(
    body: &Proportions,
    motion: Motion,
    direction_rad: f64,
    length_m: f64,
) -> Result<Made, Error> {
    let most_m = MOST_GONE * body.stature_m();
    if !(0.0..=most_m).contains(&length_m) {
        return Err(Error::new("nobody hops or jumps so far here")
            .got(format!("{length_m} m"))
            .allowed(format!("0 to {most_m:.2} m, {MOST_GONE} times the stature")));
    }
    let goes_m = way(direction_rad) * length_m;
    // To the left as to the right, seen in a mirror.
    let is_left = goes_m.y > 1e-9;
    let seen_m = goes_m * DVec3::new(1.0, if is_left { -1.0 } else { 1.0 }, 1.0);
    let travel = Travel::of(body, motion, goes_m.y.abs() > 1e-9)?;
    let found = travel.going(seen_m)?;
    arrived(body, if is_left { mirrored(&found)? } else { found }, Some(goes_m))
}

/// The same motion seen in a mirror.
fn mirrored(motion: &Motion) -> Result<Motion, Error> {
    let turned = |dof: Dof| {
        let (twin, sign) = dof.mirrored();
        let track = motion.track(twin);
        let start = Sequence::starting_at(0.0, sign * track.from_rad())?;
        track.actionlets().iter().try_fold(start, |chain, piece| {
            chain.then(piece.duration_s(), sign * piece.to_rad(), piece.shape().clone())
        })
    };
    Motion::new(Dof::ALL.into_iter().map(turned).collect::<Result<_, Error>>()?)
}

pub(super) fn hop(
    performer: &mut Performer,
    direction_rad: f64,
    length_m: f64,
) -> Result<Made, Error> {
    let body = *performer.body();
    gone(&body, shipped(&body, "hop", HOPS)?, direction_rad, length_m)
}

pub(super) fn jump(
    performer: &mut Performer,
    direction_rad: f64,
    length_m: f64,
) -> Result<Made, Error> {
    let body = *performer.body();
    gone(&body, shipped(&body, "jump", 1)?, direction_rad, length_m)
}
