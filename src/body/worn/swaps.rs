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
use glam::DVec3;

/// It is looked at so long a stretch, s, and at the next this much later.
const STRETCH_S: f64 = 4.0;
const NEXT_S: f64 = 1.0;
/// A shorter one tells nothing, s.
const LEAST_S: f64 = 2.4;
/// Time between two looks, s.
const STEP_S: f64 = 0.04;
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

/// How far a segment leans about its own side, rad: backward at the far end of a leg is positive, wherever the body faces.
fn pitch_rad(pose: &SegmentPose, segment: Segment) -> f64 {
    let q = pose.orientation[segment.index()];
    (-(q * DVec3::X).z).atan2((q * DVec3::Z).z)
}

/// What a stretch of a leg shows: how its thigh and its shank turn, and where its knee is.
struct Leg {
    thigh_rad_s: Vec<f64>,
    shank_rad_s: Vec<f64>,
    least_rad: f64,
    most_rad: f64,
}

impl Leg {
    fn of(poses: &[&SegmentPose], thigh: Segment, shank: Segment) -> Self {
        let pitch =
            |segment| -> Vec<f64> { poses.iter().map(|pose| pitch_rad(pose, segment)).collect() };
        let (thigh, shank) = (pitch(thigh), pitch(shank));
        let rates = |pitch: &[f64]| -> Vec<f64> {
            let step = |pair: &[f64]| crate::units::wrap_rad(pair[1] - pair[0]) / STEP_S;
            pitch.windows(2).map(step).collect()
        };
        let knee = || thigh.iter().zip(&shank).map(|(t, s)| crate::units::wrap_rad(s - t));
        Self {
            thigh_rad_s: rates(&thigh),
            shank_rad_s: rates(&shank),
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

/// Sensors of thighs and shanks that seem to be on another segment than was said, a line each: of poses at a rate, of each of
/// which it is known which segments were measured. Half of all stretches that can tell have to say so.
#[must_use]
pub fn swaps_in_legs(poses: &[SegmentPose], measured: &[[bool; 13]], rate_hz: f64) -> Vec<String> {
    let ([left_thigh, right_thigh], [left_shank, right_shank]) = (PAIRS[2], PAIRS[3]);
    let is_said = |now: &[bool; 13], segments: &[Segment]| {
        segments.iter().all(|segment| now[segment.index()])
    };
    let each = (rate_hz * STEP_S).max(1.0);
    let looks = (poses.len() as f64 / each) as usize;
    let at = |look: usize| ((look as f64 * each) as usize).min(poses.len().saturating_sub(1));
    let (long, least) = ((STRETCH_S / STEP_S) as usize, (LEAST_S / STEP_S) as usize);
    let (mut crossed, mut upside_down) = ([0_u32; 2], [[0_u32; 2]; 2]);
    for first in (0..looks).step_by((NEXT_S / STEP_S) as usize) {
        let stretch: Vec<usize> = (first..(first + long).min(looks)).map(at).collect();
        if stretch.len() < least || (first > 0 && stretch.len() < long) {
            break;
        }
        let leg = |thigh, shank| {
            let is_whole = stretch.iter().all(|n| is_said(&measured[*n], &[thigh, shank]));
            let poses: Vec<&SegmentPose> = stretch.iter().map(|n| &poses[*n]).collect();
            is_whole.then(|| Leg::of(&poses, thigh, shank)).filter(Leg::moves)
        };
        let legs = [leg(left_thigh, left_shank), leg(right_thigh, right_shank)];
        for (leg, told) in legs.iter().zip(&mut upside_down) {
            if let Some(leg) = leg {
                told[usize::from(leg.is_upside_down())] += 1;
            }
        }
        if let [Some(left), Some(right)] = &legs
            && let Some(are_crossed) = are_crossed(left, right)
        {
            crossed[usize::from(are_crossed)] += 1;
        }
    }
    let says = |[no, yes]: [u32; 2]| yes > 0 && yes >= no;
    let mut found = Vec::new();
    for (thigh, shank, told) in
        [(left_thigh, left_shank, upside_down[0]), (right_thigh, right_shank, upside_down[1])]
    {
        if says(told) {
            let (thigh, shank) = (words(thigh), words(shank));
            found.push(format!(
                "the sensors of the {thigh} and the {shank} seem to be swapped: the knee bends the wrong way only"
            ));
        }
    }
    if says(crossed) {
        found.push(
            "the left thigh swings with the right shank, and the right thigh with the left shank: two of these sensors seem to be \
             swapped"
                .to_owned(),
        );
    }
    found
}
