//! Sensors of arms and legs that are on another segment than was said, as a walk shows it.
//!
//! Who walks swings the thighs against one another, each shank with its own thigh and each foot with its own shank, and each arm
//! against the leg of its side. With the sensors of both shanks swapped (or of both thighs) each shank swings with the other thigh,
//! and at every heel strike the knees are bent the wrong way; with those of the feet each foot turns with the other shank. With those
//! of the upper arms, or the forearms, they swing with the leg of their own side. With those of thigh and shank, or of upper arm and
//! forearm, swapped a knee or an elbow is bent the wrong way only. None of that happens to a person: in no stretch of 323 captures
//! (of two collections) in which legs move is a knee bent by more than 7 degrees the wrong way, do a foot and the shank above it
//! move less alike than a foot and the other shank, or arms that swing against one another swing with the legs of their own side. Marching
//! on the spot, where each thigh rises as its shank falls, tells nothing of shanks, nor do legs that do not swing against one another.

use super::calibrate::words;
use super::check::{PAIRS, alike};
use crate::body::{Segment, SegmentPose};
use crate::units::wrap_rad;
use glam::{DQuat, DVec3};
use std::collections::VecDeque;

/// Time between two looks, s.
const STEP_S: f64 = 0.04;
/// So many looks are a stretch (4 s), and the next begins so many later (1 s).
const LONG: usize = 100;
const NEXT: usize = 25;
/// A shorter one tells nothing (2.4 s).
const LEAST: usize = 60;
/// Between moments further apart nobody knows what was done, s.
const LONGEST_STEP_S: f64 = 0.1;
/// A leg moves that turns so fast, and an arm, rad/s root mean square.
const LEG_MOVES_RAD_S: f64 = 0.5;
const ARM_MOVES_RAD_S: f64 = 0.3;
/// Two limbs swing against one another, if they are so unlike (Pearson's correlation of their rates).
const AGAINST: f64 = -0.3;
/// Crossed legs are more alike than one's own by so much, and so are a shank and the other foot.
const CROSSED: f64 = 0.3;
/// Both arms are more like the leg of their side than like the other one by so much together. As worn, the other one is the one they
/// are more alike, by 0.2 to 2.8.
const ARMS_CROSSED: f64 = 1.0;
/// A knee is bent the wrong way, rad.
const WRONG_RAD: f64 = -0.26;
/// A knee that is only bent the wrong way is so, rad, and an elbow, and the other way no further than this.
const ONLY_WRONG_RAD: f64 = -0.52;
const ELBOW_WRONG_RAD: f64 = -0.45;
const HARDLY_RAD: f64 = 0.17;
/// Cosine of how far a segment may lean, either end up, that is upright: 30 degrees.
const UPRIGHT: f64 = 0.866;

/// What of one side of the body is looked at: how its segments lean, in the order of [`PAIRS`], and how its elbow is bent.
const SEEN: usize = 6;
const UPPER_ARM: usize = 0;
const FOREARM: usize = 1;
const THIGH: usize = 2;
const SHANK: usize = 3;
const FOOT: usize = 4;
const ELBOW: usize = 5;

/// How far a segment leans about its own side, rad: backward at the far end of a limb is positive, wherever the body faces.
fn pitch_rad(pose: &SegmentPose, segment: Segment) -> f64 {
    let q = pose.orientation[segment.index()];
    (-(q * DVec3::X).z).atan2((q * DVec3::Z).z)
}

/// How far an elbow is bent forwards, rad; `None` where neither segment is upright, because headings that are a little off bend
/// the elbow of an arm that is held out.
fn elbow_rad(pose: &SegmentPose, upper: Segment, lower: Segment) -> Option<f64> {
    let [upper, turned] = [upper, lower].map(|of| pose.orientation[of.index()]);
    let is_upright = |of: DQuat| (of * DVec3::Z).z.abs() > UPRIGHT;
    let along = upper.inverse() * turned * lower.long_axis();
    (is_upright(upper) || is_upright(turned)).then(|| along.x.atan2(-along.z))
}

/// A moment, rad: by side, the left one first; `None` of what was not measured.
type Look = [[Option<f64>; SEEN]; 2];

fn look(pose: &SegmentPose, measured: &[bool; 13]) -> Look {
    [0, 1].map(|side| {
        let is_said = |of: usize| measured[PAIRS[of][side].index()];
        let mut seen = [None; SEEN];
        for of in (UPPER_ARM..=FOOT).filter(|of| is_said(*of)) {
            seen[of] = Some(pitch_rad(pose, PAIRS[of][side]));
        }
        if is_said(UPPER_ARM) && is_said(FOREARM) {
            seen[ELBOW] = elbow_rad(pose, PAIRS[UPPER_ARM][side], PAIRS[FOREARM][side]);
        }
        seen
    })
}

/// What a stretch shows.
struct Stretch<'a>(&'a [Look]);

impl Stretch<'_> {
    /// What was seen of a side all along; `None` if it was not measured all along.
    fn seen(&self, side: usize, of: usize) -> Option<Vec<f64>> {
        self.0.iter().map(|look| look[side][of]).collect()
    }

    /// How fast a segment turns from look to look, rad/s; `None` if it hardly does.
    fn turns_rad_s(&self, side: usize, of: usize) -> Option<Vec<f64>> {
        let seen = self.seen(side, of)?;
        let step = |pair: &[f64]| wrap_rad(pair[1] - pair[0]) / STEP_S;
        let rates: Vec<f64> = seen.windows(2).map(step).collect();
        let sum: f64 = rates.iter().map(|rate| rate * rate).sum();
        let least_rad_s = if of <= FOREARM { ARM_MOVES_RAD_S } else { LEG_MOVES_RAD_S };
        ((sum / rates.len().max(1) as f64).sqrt() > least_rad_s).then_some(rates)
    }

    /// The same of both sides.
    fn both_rad_s(&self, of: usize) -> Option<[Vec<f64>; 2]> {
        Some([self.turns_rad_s(0, of)?, self.turns_rad_s(1, of)?])
    }

    /// The same of two limbs that swing against one another.
    fn swing_rad_s(&self, of: usize) -> Option<[Vec<f64>; 2]> {
        self.both_rad_s(of).filter(|[left, right]| alike(left, right) < AGAINST)
    }

    /// How a knee is bent, least and most, rad.
    fn knee_rad(&self, side: usize) -> Option<(f64, f64)> {
        let (thigh, shank) = (self.seen(side, THIGH)?, self.seen(side, SHANK)?);
        Some(range(thigh.iter().zip(&shank).map(|(thigh, shank)| wrap_rad(shank - thigh))))
    }

    /// Thigh and shank are each other's; `None` of a leg that does not move.
    fn has_leg_upside_down(&self, side: usize) -> Option<bool> {
        self.turns_rad_s(side, THIGH)?;
        self.turns_rad_s(side, SHANK)?;
        let (least_rad, most_rad) = self.knee_rad(side)?;
        Some(least_rad < ONLY_WRONG_RAD && most_rad < HARDLY_RAD)
    }

    /// Upper arm and forearm are each other's; `None` of an arm that does not move, or is held out most of the time.
    fn has_arm_upside_down(&self, side: usize) -> Option<bool> {
        self.turns_rad_s(side, UPPER_ARM)?;
        self.turns_rad_s(side, FOREARM)?;
        let bent_rad: Vec<f64> = self.0.iter().filter_map(|look| look[side][ELBOW]).collect();
        if 2 * bent_rad.len() < self.0.len() {
            return None;
        }
        let (least_rad, most_rad) = range(bent_rad.into_iter());
        Some(least_rad < ELBOW_WRONG_RAD && most_rad < HARDLY_RAD)
    }

    /// Shanks seem to swing with the other thigh; `None` of legs that do not walk.
    fn has_shanks_crossed(&self) -> Option<bool> {
        let (thighs, shanks) = (self.swing_rad_s(THIGH)?, self.both_rad_s(SHANK)?);
        let (left, right) = (self.knee_rad(0)?, self.knee_rad(1)?);
        let bend_wrongly = left.0 < WRONG_RAD && right.0 < WRONG_RAD;
        Some(bend_wrongly && crossed(&thighs, &shanks) > CROSSED)
    }

    /// Feet seem to turn with the other shank. `None` also where that may be because of the shanks, but does not have to.
    fn has_feet_crossed(&self) -> Option<bool> {
        let (thighs, shanks) = (self.swing_rad_s(THIGH)?, self.both_rad_s(SHANK)?);
        let is_crossed = crossed(&shanks, &self.both_rad_s(FOOT)?) > CROSSED;
        let is_told =
            self.has_shanks_crossed()? || crossed(&thighs, &shanks) < -CROSSED || !is_crossed;
        is_told.then_some(is_crossed)
    }

    /// Arms, told by their upper or their lower segments, swing with the leg of their own side; `None` if they do not swing.
    fn has_arms_crossed(&self, of: usize) -> Option<bool> {
        Some(crossed(&self.swing_rad_s(THIGH)?, &self.swing_rad_s(of)?) < -ARMS_CROSSED)
    }
}

fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), value| {
        (least.min(value), most.max(value))
    })
}

/// By how much each of two limbs is more like the other side's of `lower` than like that of its own side, both together.
fn crossed([left, right]: &[Vec<f64>; 2], lower: &[Vec<f64>; 2]) -> f64 {
    alike(left, &lower[1]) + alike(right, &lower[0])
        - alike(left, &lower[0])
        - alike(right, &lower[1])
}

/// How many stretches say no, and yes.
#[derive(Clone, Copy, Debug, Default)]
struct Votes([u32; 2]);

impl Votes {
    fn knows(self) -> bool {
        self.0 != [0, 0]
    }

    fn take(&mut self, says: Option<bool>) {
        if let Some(says) = says {
            self.0[usize::from(says)] += 1;
        }
    }
}

/// What stretches say.
#[derive(Clone, Copy, Debug, Default)]
struct Told {
    shanks: Votes,
    feet: Votes,
    /// Upper arms, and forearms.
    arms: [Votes; 2],
    legs_upside_down: [Votes; 2],
    arms_upside_down: [Votes; 2],
}

impl Told {
    /// Takes what a stretch shows.
    fn take(&mut self, stretch: &[Look]) {
        let stretch = Stretch(stretch);
        for side in [0, 1] {
            self.legs_upside_down[side].take(stretch.has_leg_upside_down(side));
            self.arms_upside_down[side].take(stretch.has_arm_upside_down(side));
        }
        let shanks = stretch.has_shanks_crossed();
        self.shanks.take(shanks);
        self.feet.take(stretch.has_feet_crossed());
        // Beside thighs that may be each other's arms tell nothing.
        if shanks != Some(true) {
            for (of, told) in self.arms.iter_mut().enumerate() {
                told.take(stretch.has_arms_crossed(of));
            }
        }
    }

    /// What is named where the votes say so, a line each.
    fn named(&self, says: impl Fn(Votes) -> bool) -> Vec<String> {
        let mut found = Vec::new();
        let upside_down = |upper: usize, side: usize, joint: &str| {
            let [upper, lower] = [upper, upper + 1].map(|of| words(PAIRS[of][side]));
            format!(
                "the sensors of the {upper} and the {lower} seem to be swapped: the {joint} bends the wrong way only"
            )
        };
        for side in [0, 1].into_iter().filter(|side| says(self.legs_upside_down[*side])) {
            found.push(upside_down(THIGH, side, "knee"));
        }
        match (says(self.shanks), says(self.feet)) {
            (true, true) => found.push(
                "the shanks swing with the thigh and the foot of the other side: the sensors of the two shanks seem to be swapped"
                    .to_owned(),
            ),
            (true, false) => {
                let only = if self.feet.knows() { "the two thighs" } else { "the two thighs, or of the two shanks," };
                found.push(format!(
                    "the left thigh swings with the right shank, and the right thigh with the left shank: the sensors of {only} seem \
                     to be swapped"
                ));
            }
            (false, true) => found.push(
                "the left foot turns with the right shank, and the right foot with the left shank: the sensors of the two feet seem to \
                 be swapped"
                    .to_owned(),
            ),
            (false, false) => {}
        }
        let [upper, lower] = self.arms.map(&says);
        let [upper_knows, lower_knows] = self.arms.map(Votes::knows);
        let which = match (upper, lower) {
            (true, true) => Some(("arms", "both arms, or of the legs,")),
            (true, false) if lower_knows => Some(("upper arms", "the two upper arms")),
            (false, true) if upper_knows => Some(("forearms", "the two forearms")),
            (true, false) => Some(("upper arms", "both arms, or of the legs,")),
            (false, true) => Some(("forearms", "both arms, or of the legs,")),
            (false, false) => None,
        };
        if let Some((arms, which)) = which {
            found.push(format!(
                "the {arms} swing with the legs of their own side: the sensors of {which} seem to be swapped"
            ));
            // A forearm beside the other upper arm bends any way.
            return found;
        }
        for side in [0, 1].into_iter().filter(|side| says(self.arms_upside_down[*side])) {
            found.push(upside_down(UPPER_ARM, side, "elbow"));
        }
        found
    }
}

/// Sensors of arms and legs that seem to be on another segment than was said, a line each: of poses at a rate, of each of
/// which it is known which segments were measured. Half of all stretches that can tell have to say so.
#[must_use]
pub fn swaps_in_walk(poses: &[SegmentPose], measured: &[[bool; 13]], rate_hz: f64) -> Vec<String> {
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
            let between = |(one, other): (Option<f64>, Option<f64>)| {
                one.zip(other).map(|(one, other)| one + part * wrap_rad(other - one))
            };
            self.looks.push_back(
                [0, 1].map(|side| {
                    std::array::from_fn(|of| between((before[side][of], now[side][of])))
                }),
            );
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
