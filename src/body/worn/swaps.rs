//! Sensors of legs that are on another segment than was said, as a walk shows it.
//!
//! Who walks swings the thighs against one another, and each shank with its own thigh. With the sensors of both shanks swapped
//! (or of both thighs) each shank swings with the other thigh, and at every heel strike the knees are bent the wrong way. With
//! those of thigh and shank swapped a knee is bent the wrong way only. Neither happens to a person: in no stretch of 84 captures
//! (543 s) in which legs move is a knee bent by more than 7 degrees the wrong way. Marching on the spot, where each thigh rises
//! as its shank falls, tells nothing of the first kind, nor do legs that do not swing against one another.

use super::calibrate::words;
use super::check::{PAIRS, alike};
use crate::body::{Segment, SegmentPose};
use crate::units::wrap_rad;
use glam::DVec3;
use std::collections::VecDeque;

/// Time between two looks, s.
const STEP_S: f64 = 0.04;
/// So many looks are a stretch (4 s), and the next begins so many later (1 s).
const LONG: usize = 100;
const NEXT: usize = 25;
/// A shorter one tells nothing (2.4 s).
const LEAST: usize = 60;
/// Between moments further apart nobody knows what legs did, s.
const LONGEST_STEP_S: f64 = 0.1;
/// A leg moves that turns so fast, rad/s root mean square.
const MOVES_RAD_S: f64 = 0.5;
/// Thighs swing against one another, if they are so unlike (Pearson's correlation of their rates).
const AGAINST: f64 = -0.3;
/// Crossed legs are more alike than one's own by so much.
const CROSSED: f64 = 0.3;
/// A knee is bent the wrong way, rad.
const WRONG_RAD: f64 = -0.26;
/// A knee that is only bent the wrong way is so, rad, and the other way no further than this.
const ONLY_WRONG_RAD: f64 = -0.52;
const HARDLY_RAD: f64 = 0.17;

/// Of a leg, its thigh and its shank; the left one first.
const LEGS: [[Segment; 2]; 2] = [[PAIRS[2][0], PAIRS[3][0]], [PAIRS[2][1], PAIRS[3][1]]];

/// How far a segment leans about its own side, rad: backward at the far end of a leg is positive, wherever the body faces.
fn pitch_rad(pose: &SegmentPose, segment: Segment) -> f64 {
    let q = pose.orientation[segment.index()];
    (-(q * DVec3::X).z).atan2((q * DVec3::Z).z)
}

/// How thighs and shanks lean at a moment, rad, as in [`LEGS`]; `None` of a leg that was not measured.
type Look = [Option<[f64; 2]>; 2];

fn look(pose: &SegmentPose, measured: &[bool; 13]) -> Look {
    LEGS.map(|leg| {
        let is_said = leg.iter().all(|segment| measured[segment.index()]);
        is_said.then(|| leg.map(|segment| pitch_rad(pose, segment)))
    })
}

/// What a stretch of a leg shows: how its thigh and its shank turn, and where its knee is.
struct Leg {
    thigh_rad_s: Vec<f64>,
    shank_rad_s: Vec<f64>,
    least_rad: f64,
    most_rad: f64,
}

impl Leg {
    /// Of looks at one leg, one after the other.
    fn of(looks: &[[f64; 2]]) -> Self {
        let rates = |which: usize| -> Vec<f64> {
            let step = |pair: &[[f64; 2]]| wrap_rad(pair[1][which] - pair[0][which]) / STEP_S;
            looks.windows(2).map(step).collect()
        };
        let knee = || looks.iter().map(|[thigh, shank]| wrap_rad(shank - thigh));
        Self {
            thigh_rad_s: rates(0),
            shank_rad_s: rates(1),
            least_rad: knee().fold(f64::INFINITY, f64::min),
            most_rad: knee().fold(f64::NEG_INFINITY, f64::max),
        }
    }

    fn moves(&self) -> bool {
        let moves = |rates: &[f64]| {
            let sum: f64 = rates.iter().map(|rate| rate * rate).sum();
            (sum / rates.len().max(1) as f64).sqrt() > MOVES_RAD_S
        };
        moves(&self.thigh_rad_s) && moves(&self.shank_rad_s)
    }

    /// Thigh and shank are each other's.
    fn is_upside_down(&self) -> bool {
        self.least_rad < ONLY_WRONG_RAD && self.most_rad < HARDLY_RAD
    }
}

/// True if the lower ends of two legs seem to be the other's; `None` of legs that do not walk.
fn are_crossed(left: &Leg, right: &Leg) -> Option<bool> {
    if !(left.moves() && right.moves() && alike(&left.thigh_rad_s, &right.thigh_rad_s) < AGAINST) {
        return None;
    }
    let own =
        alike(&left.thigh_rad_s, &left.shank_rad_s) + alike(&right.thigh_rad_s, &right.shank_rad_s);
    let crossed =
        alike(&left.thigh_rad_s, &right.shank_rad_s) + alike(&right.thigh_rad_s, &left.shank_rad_s);
    let bend_wrongly = left.least_rad < WRONG_RAD && right.least_rad < WRONG_RAD;
    Some(bend_wrongly && crossed - own > CROSSED)
}

/// How many stretches say no, and yes.
#[derive(Clone, Copy, Debug, Default)]
struct Votes([u32; 2]);

impl Votes {
    fn take(&mut self, says: Option<bool>) {
        if let Some(says) = says {
            self.0[usize::from(says)] += 1;
        }
    }
}

/// What stretches say of the legs.
#[derive(Clone, Copy, Debug, Default)]
struct Told {
    crossed: Votes,
    upside_down: [Votes; 2],
}

impl Told {
    /// Takes what a stretch shows.
    fn take(&mut self, stretch: &[Look]) {
        let leg = |which: usize| {
            let looks: Option<Vec<[f64; 2]>> = stretch.iter().map(|look| look[which]).collect();
            looks.map(|looks| Leg::of(&looks)).filter(Leg::moves)
        };
        let legs = [leg(0), leg(1)];
        for (leg, told) in legs.iter().zip(&mut self.upside_down) {
            told.take(leg.as_ref().map(Leg::is_upside_down));
        }
        if let [Some(left), Some(right)] = &legs {
            self.crossed.take(are_crossed(left, right));
        }
    }

    /// What is named where the votes say so, a line each.
    fn named(&self, says: impl Fn(Votes) -> bool) -> Vec<String> {
        let mut found = Vec::new();
        for ([thigh, shank], told) in LEGS.into_iter().zip(self.upside_down) {
            if says(told) {
                let (thigh, shank) = (words(thigh), words(shank));
                found.push(format!(
                    "the sensors of the {thigh} and the {shank} seem to be swapped: the knee bends the wrong way only"
                ));
            }
        }
        if says(self.crossed) {
            found.push(
                "the left thigh swings with the right shank, and the right thigh with the left shank: two of these sensors seem to be \
                 swapped"
                    .to_owned(),
            );
        }
        found
    }
}

/// Sensors of thighs and shanks that seem to be on another segment than was said, a line each: of poses at a rate, of each of
/// which it is known which segments were measured. Half of all stretches that can tell have to say so.
#[must_use]
pub fn swaps_in_legs(poses: &[SegmentPose], measured: &[[bool; 13]], rate_hz: f64) -> Vec<String> {
    let each = (rate_hz * STEP_S).max(1.0);
    let looks = (poses.len() as f64 / each) as usize;
    let at = |look: usize| ((look as f64 * each) as usize).min(poses.len().saturating_sub(1));
    let looks: Vec<Look> = (0..looks).map(at).map(|n| look(&poses[n], &measured[n])).collect();
    let mut told = Told::default();
    for first in (0..looks.len()).step_by(NEXT) {
        let stretch = &looks[first..(first + LONG).min(looks.len())];
        if stretch.len() < LEAST || (first > 0 && stretch.len() < LONG) {
            break;
        }
        told.take(stretch);
    }
    told.named(|Votes([no, yes])| yes > 0 && yes >= no)
}

/// The same as somebody walks, moment by moment.
#[derive(Clone, Debug, Default)]
pub struct SwapWatch {
    looks: VecDeque<Look>,
    before: Option<Look>,
    /// Since the last look, s, and how many looks there were since the last stretch.
    since_s: f64,
    fresh: usize,
    told: Told,
    named: bool,
}

impl SwapWatch {
    /// Takes where the sensors put the body `dt_s` after the moment before, and which segments were measured; what is named from now
    /// on, a line each. It is named once: by two stretches, and by more than deny it.
    pub fn take(&mut self, pose: &SegmentPose, measured: &[bool; 13], dt_s: f64) -> Vec<String> {
        if self.named {
            return Vec::new();
        }
        let now = look(pose, measured);
        let Some(before) =
            self.before.replace(now).filter(|_| dt_s > 0.0 && dt_s <= LONGEST_STEP_S)
        else {
            (self.since_s, self.fresh) = (0.0, 0);
            self.looks.clear();
            return Vec::new();
        };
        self.since_s += dt_s;
        while self.since_s >= STEP_S {
            self.since_s -= STEP_S;
            // Looks are evenly spaced, whenever moments are.
            let part = ((dt_s - self.since_s) / dt_s).clamp(0.0, 1.0);
            let between = |(one, other): (Option<[f64; 2]>, Option<[f64; 2]>)| {
                let (one, other) = one.zip(other)?;
                Some([0, 1].map(|which| one[which] + part * wrap_rad(other[which] - one[which])))
            };
            self.looks.push_back([0, 1].map(|leg| between((before[leg], now[leg]))));
            self.fresh += 1;
        }
        while self.looks.len() > LONG {
            self.looks.pop_front();
        }
        if self.looks.len() < LONG || self.fresh < NEXT {
            return Vec::new();
        }
        self.fresh = 0;
        self.told.take(self.looks.make_contiguous());
        let named = self.told.named(|Votes([no, yes])| yes >= 2 && yes > no);
        self.named = !named.is_empty();
        named
    }
}
