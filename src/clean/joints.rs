//! What is wrong with the joints of a skeleton in motion: joints that jump, and joints that stand still to the last bit
//! while the others go on. How a segment lies on the one that carries it is looked at as a rotation, so that no
//! singularity of angles is taken for a jump, and how a skeleton draws its rest pose makes no difference.

use super::artefact::ArtefactKind;
use crate::body::{Segment, SegmentPose};
use glam::DQuat;
use std::ops::Range;

/// The least jump, rad: 15 degrees.
const JUMP_RAD: f64 = 0.26;
/// What no joint of a person is accelerated by, rad/s². Ours; kicks and throws have up to about 600.
const MOST_RAD_S2: f64 = 800.0;
/// A jump is so many times what is usual for its joint in this trial.
const UNUSUAL: f64 = 8.0;
/// Where two jumps of a joint are no farther apart, what is between them is wrong, s.
const BACK_S: f64 = 1.0;
/// Least time that a joint sticks, s, and least frames.
const STUCK_S: f64 = 0.1;
const STUCK_FRAMES: usize = 4;
/// What is no motion, rad: less than the last digit of what files write.
const STILL_RAD: f64 = 1e-8;
/// How fast a joint turns before or after it sticks, rad/s.
const GOES_ON_RAD_S: f64 = 0.5;
/// Frames over which that is looked at.
const BESIDE: usize = 3;

/// One thing that is wrong with one joint.
#[derive(Clone, Debug, PartialEq)]
pub struct JointArtefact {
    /// What: a jump, or stuck.
    pub kind: ArtefactKind,
    /// The segment that hangs on the joint.
    pub segment: Segment,
    /// Indices of the frames.
    pub frames: Range<usize>,
}

/// The segments whose joints are looked at: those that hang on another and are tracked.
pub fn jointed(tracked: &[bool; 13]) -> impl Iterator<Item = (Segment, Segment)> + '_ {
    Segment::ALL.into_iter().filter_map(|segment| {
        let parent = segment.parent()?;
        (tracked[segment.index()] && tracked[parent.index()]).then_some((segment, parent))
    })
}

/// What is wrong with the joints of poses, by segment and time. `rate_hz` is positive.
#[must_use]
pub fn artefacts(poses: &[SegmentPose], tracked: &[bool; 13], rate_hz: f64) -> Vec<JointArtefact> {
    let joints: Vec<(Segment, Vec<DQuat>)> = jointed(tracked)
        .map(|(segment, parent)| {
            let turn = |pose: &SegmentPose| {
                pose.orientation[parent.index()].inverse() * pose.orientation[segment.index()]
            };
            (segment, poses.iter().map(turn).collect())
        })
        .collect();
    let steps: Vec<Vec<f64>> = joints
        .iter()
        .map(|(_, turns)| turns.windows(2).map(|pair| angle(pair[0], pair[1])).collect())
        .collect();
    let mut found = Vec::new();
    for (at, (segment, turns)) in joints.iter().enumerate() {
        for frames in jumps(turns, rate_hz) {
            found.push(JointArtefact { kind: ArtefactKind::Jump, segment: *segment, frames });
        }
        let others: Vec<&[f64]> =
            (0..steps.len()).filter(|of| *of != at).map(|of| steps[of].as_slice()).collect();
        for frames in stuck(&steps[at], &others, rate_hz) {
            found.push(JointArtefact { kind: ArtefactKind::Stuck, segment: *segment, frames });
        }
    }
    found
}

/// The angle between two rotations, exact also where it is small.
fn angle(a: DQuat, b: DQuat) -> f64 {
    let between = a.inverse() * b;
    2.0 * between.xyz().length().atan2(between.w.abs())
}

/// Frames between steps that neither what was before nor what comes after leads to.
fn jumps(turns: &[DQuat], rate_hz: f64) -> Vec<Range<usize>> {
    // By how much a joint is elsewhere than where the two poses before it lead, and the two after it.
    let ahead = |a: DQuat, b: DQuat, c: DQuat| angle(b * (a.inverse() * b), c);
    let off: Vec<f64> = turns
        .windows(4)
        .map(|four| ahead(four[0], four[1], four[2]).min(ahead(four[3], four[2], four[1])))
        .collect();
    let mut sorted = off.clone();
    sorted.sort_by(f64::total_cmp);
    let usual = sorted.get(sorted.len() / 2).copied().unwrap_or(0.0);
    let least = JUMP_RAD.max(MOST_RAD_S2 / (rate_hz * rate_hz)).max(UNUSUAL * usual);
    // The step is that from the second of four to the third.
    let breaks: Vec<usize> =
        (0..off.len()).filter(|at| off[*at] > least).map(|at| at + 2).collect();
    let most = (BACK_S * rate_hz) as usize;
    let mut found: Vec<Range<usize>> = Vec::new();
    let mut rest = breaks.as_slice();
    while let Some((from, after)) = rest.split_first() {
        match after.split_first() {
            Some((to, beyond)) if to - from <= most => {
                found.push(*from..*to);
                rest = beyond;
            }
            _ => {
                found.push(*from..from + 1);
                rest = after;
            }
        }
    }
    found
}

/// Frames in which a joint repeats its pose while it moves before or after, and most others do all the time.
fn stuck(steps: &[f64], others: &[&[f64]], rate_hz: f64) -> Vec<Range<usize>> {
    let least = ((STUCK_S * rate_hz).round() as usize).max(STUCK_FRAMES) - 1;
    let mean = |of: &[f64]| of.iter().sum::<f64>() / of.len().max(1) as f64;
    let is_stuck = |run: &Range<usize>| {
        let before = &steps[run.start.saturating_sub(BESIDE)..run.start];
        let after = &steps[run.end..(run.end + BESIDE).min(steps.len())];
        let goes_on = mean(before).max(mean(after)) * rate_hz > GOES_ON_RAD_S;
        let moves = |other: &&&[f64]| {
            let of_run = other.get(run.clone()).unwrap_or_default();
            of_run.iter().filter(|step| **step > STILL_RAD).count() * 2 > of_run.len()
        };
        run.len() >= least && goes_on && others.iter().filter(moves).count() * 2 >= others.len()
    };
    let still = super::trial::runs(steps.len(), |at| steps[at] <= STILL_RAD);
    // Both ends of each step are of it.
    still.into_iter().filter(is_stuck).map(|run| run.start..run.end + 1).collect()
}
