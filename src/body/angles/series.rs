//! Joint angles of a whole clip, each on the branch that is canonical for it.
//!
//! A joint with three degrees of freedom can be said in two ways (flexion and rotation half a turn
//! further, abduction mirrored at the singularity), each up to whole turns. Away from the singularity
//! a motion stays on one of the two; where it passes near it, the way may change and turns may be
//! taken back. So a clip falls into *runs* between the poses near the singularity, and of all ways to
//! say the runs that one is taken which is out of the anatomical ranges the least, in angle times
//! time, and gives up the least between them (dynamic programming over the runs; time and memory grow
//! with the length of the clip). What comes of it does not depend on where the clip begins, unless
//! the joint is on the wrong side of its range for most of a run.
//!
//! Near the singularity flexion and rotation cannot be told apart, only their sum or difference can.
//! There flexion is drawn smoothly from the run before to the run after, unless what the pose says is
//! near that; abduction and rotation are then the ones that come nearest to the pose. A little
//! further away the poses are said exactly, unless it pays to draw over them: a joint that circles
//! there would wind.

use core::f64::consts::{PI, TAU};
use core::ops::Range;

use glam::DQuat;

use super::{BALLS, Ball, HINGES, JointAngles, SINGULAR_WITHIN_RAD, near, relative, turns};
use crate::body::SegmentPose;
use crate::body::dof::{Dof, Joint};
use crate::units::wrap_rad;

/// Poses this near to the singularity may be drawn over, rad; those within [`SINGULAR_WITHIN_RAD`] are.
const DRAWN_WITHIN_RAD: f64 = 15.0 * PI / 180.0;
/// Being off the pose for a time is worse than being outside the range by that angle, so many times ...
const OFF: f64 = 2.0;
/// ... and is taken to last longer by this, s.
const DRAWN_FOR_S: f64 = 0.5;
/// Ways to say a clip that are kept up to the end of a run.
const MOST_REACHED: usize = 24;
/// Turning flexion, abduction and rotation by an angle near the singularity costs as much as being
/// outside the range by that angle for so long, s.
const TURN_S: f64 = 0.1;
/// The same for what is known near the singularity, the sum or difference of flexion and rotation.
const BREAK_S: f64 = 100.0;
/// Of two ways inside the range the smaller angles are taken: what an angle costs by itself, as a
/// part of what it would cost outside.
const NEUTRAL: f64 = 1e-3;
/// No joint turns this far from pose to pose: a capture that does is broken there, rad.
const LEAP_RAD: f64 = 1.0;
/// Nearer to the singularity than this a pose says nothing about flexion, rad.
const SILENT_WITHIN_RAD: f64 = 0.5 * PI / 180.0;
/// What poses near the singularity say of flexion is used as long as it strays less than this from
/// the straight way through, rad.
const STRAY_RAD: f64 = 10.0 * PI / 180.0;

/// The angles of a clip, pose by pose.
#[derive(Clone, Debug, PartialEq)]
pub struct AngleSeries {
    /// The angles; of joints with three degrees of freedom continuous, but for broken captures.
    pub angles: Vec<JointAngles>,
    /// Each joint with three degrees of freedom: torso, shoulders, hips.
    pub near_singular: Vec<NearSingular>,
}

/// How much of a clip a joint spends where its flexion and rotation are poorly determined.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NearSingular {
    /// The joint.
    pub joint: Joint,
    /// Share of the poses within [`SINGULAR_WITHIN_RAD`] of the singularity, 0 to 1.
    pub share: f64,
    /// How far the angles are from a pose at most, rad: where flexion is drawn smoothly, there or, if
    /// it would wind otherwise, within 15 deg.
    pub off_rad: f64,
}

impl JointAngles {
    /// Angles of a clip at `rate_hz` poses per second: inside the anatomical ranges where the poses
    /// allow it, and without jumps. Joints with one degree of freedom are taken within half a turn of
    /// the middle of their range.
    #[must_use]
    pub fn of_clip(poses: &[SegmentPose], rate_hz: f64) -> AngleSeries {
        let mut angles = vec![Self::default(); poses.len()];
        let mut near_singular = Vec::with_capacity(BALLS.len());
        for ball in &BALLS {
            let turned: Vec<DQuat> =
                poses.iter().map(|pose| relative(pose, ball.segment)).collect();
            let clip = BallClip::of(ball, &turned, rate_hz);
            let (said, off_rad) = clip.said(&clip.ways(rate_hz));
            for (pose, said) in angles.iter_mut().zip(said) {
                for (dof, angle_rad) in ball.dofs.into_iter().zip(ball.named(said)) {
                    pose[dof] = angle_rad;
                }
            }
            let joint = ball.dofs[0].joint();
            near_singular.push(NearSingular { joint, share: clip.share_near(), off_rad });
        }
        for hinge in &HINGES {
            let middle_rad = middle_rad(hinge.dof);
            for (angles, pose) in angles.iter_mut().zip(poses) {
                let (angle_rad, _) = hinge.angle(relative(pose, hinge.segment));
                angles[hinge.dof] = near(angle_rad, Some(middle_rad));
            }
        }
        AngleSeries { angles, near_singular }
    }
}

fn middle_rad(dof: Dof) -> f64 {
    let (lower, upper) = dof.range_rad();
    f64::midpoint(lower, upper)
}

/// One joint over a clip.
struct BallClip<'a> {
    ball: &'a Ball,
    turned: &'a [DQuat],
    /// Turns about Y, the new X and the new Z, rad: that about X within a quarter turn, the others
    /// without jumps within a run.
    turns: Vec<[f64; 3]>,
    /// Cosine of the turn about X: the sine of the distance from the singularity.
    cosines: Vec<f64>,
    runs: Vec<Run>,
}

/// Poses in a row, away from the singularity, that are all said in one way or all drawn over.
#[derive(Clone, Copy, Debug)]
struct Run {
    first: usize,
    last: usize,
    after: After,
    /// What it costs to draw over its poses, rad s; none if it is too far from the singularity.
    to_draw: Option<f64>,
}

/// What a run begins after.
#[derive(Clone, Copy, Debug, PartialEq)]
enum After {
    /// The singularity, or nothing at all.
    Singularity,
    /// A leap of the capture.
    Leap,
    /// The run before it.
    Run,
}

/// One way to say the turns of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Way {
    /// The turn about X goes on through the quarter turn.
    flipped: bool,
    /// Whole turns that are added.
    whole: [f64; 3],
}

impl Way {
    fn said(self, [y, x, z]: [f64; 3]) -> [f64; 3] {
        let own = if self.flipped { [y + PI, PI - x, z + PI] } else { [y, x, z] };
        [0, 1, 2].map(|axis| own[axis] + TAU * self.whole[axis])
    }
}

/// A way to say the clip up to the end of a run, and the best that leads there.
#[derive(Clone, Copy)]
struct Reached {
    /// How the last poses are said that are not drawn over.
    way: Way,
    /// The last of them.
    pose: usize,
    /// The run is drawn over.
    is_drawn: bool,
    cost: f64,
    /// Which of those that end at the run before.
    from: usize,
}

/// What lies between two poses.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Between {
    Nothing,
    Singularity,
    Leap,
}

impl Between {
    fn of(one: DQuat, other: DQuat) -> Self {
        let angle_rad = one.angle_between(other);
        if angle_rad > LEAP_RAD {
            return Self::Leap;
        }
        let away_rad = |turned: DQuat| turns(turned, 0.0).1.min(1.0).asin();
        if (away_rad(one) + away_rad(other) - angle_rad) / 2.0 > SINGULAR_WITHIN_RAD {
            return Self::Nothing;
        }
        let parts = (2.0 * angle_rad / SINGULAR_WITHIN_RAD).ceil() as usize;
        let between = |part: usize| one.slerp(other, part as f64 / parts as f64);
        let passes = (1..parts).any(|part| away_rad(between(part)) <= SINGULAR_WITHIN_RAD);
        if passes { Self::Singularity } else { Self::Nothing }
    }
}

impl<'a> BallClip<'a> {
    fn of(ball: &'a Ball, turned: &'a [DQuat], rate_hz: f64) -> Self {
        let mut clip = Self {
            ball,
            turned,
            turns: Vec::with_capacity(turned.len()),
            cosines: Vec::with_capacity(turned.len()),
            runs: Vec::new(),
        };
        for (at, now) in turned.iter().enumerate() {
            let (mut own, cosine) = turns(*now, 0.0);
            if is_away(cosine) {
                let adjoins = clip.runs.last().is_some_and(|run| run.last + 1 == at);
                let between =
                    if adjoins { Between::of(turned[at - 1], *now) } else { Between::Singularity };
                match clip.runs.last_mut().filter(|_| between == Between::Nothing) {
                    Some(run) => {
                        run.last = at;
                        for axis in [0, 2] {
                            own[axis] = near(own[axis], Some(clip.turns[at - 1][axis]));
                        }
                    }
                    None => {
                        let is_leap = between == Between::Leap;
                        let after = if is_leap { After::Leap } else { After::Singularity };
                        clip.runs.push(Run { first: at, last: at, after, to_draw: None });
                    }
                }
            }
            clip.turns.push(own);
            clip.cosines.push(cosine);
        }
        clip.runs = clip.runs.iter().flat_map(|run| clip.parts(run, rate_hz)).collect();
        clip
    }

    /// A run parted into those that are so near to the singularity that they may be drawn over, and
    /// the others.
    fn parts(&self, run: &Run, rate_hz: f64) -> Vec<Run> {
        let is_low = |at: usize| self.cosines[at] < DRAWN_WITHIN_RAD.sin();
        let mut parts = Vec::new();
        let (mut first, mut after) = (run.first, run.after);
        while first <= run.last {
            let end = (first..=run.last).find(|at| is_low(*at) != is_low(first));
            let end = end.unwrap_or(run.last + 1);
            let away_rad = || self.cosines[first..end].iter().map(|cosine| cosine.min(1.0).asin());
            let to_draw = is_low(first).then(|| {
                let nearest_rad = away_rad().fold(f64::MAX, f64::min);
                OFF * (DRAWN_FOR_S * nearest_rad + away_rad().sum::<f64>() / rate_hz)
            });
            parts.push(Run { first, last: end - 1, after, to_draw });
            (first, after) = (end, After::Run);
        }
        parts
    }

    fn share_near(&self) -> f64 {
        let count = self.cosines.iter().filter(|cosine| !is_away(**cosine)).count();
        count as f64 / self.cosines.len().max(1) as f64
    }

    /// The best way to say each run; none for those that are drawn over.
    fn ways(&self, rate_hz: f64) -> Vec<Option<Way>> {
        let mut reached: Vec<Vec<Reached>> = Vec::with_capacity(self.runs.len());
        for run in &self.runs {
            let earlier = reached.last().map_or(&[][..], Vec::as_slice);
            let mut here = Vec::new();
            for way in self.candidates(run, earlier) {
                let before = earlier.iter().enumerate();
                let costs = before.filter_map(|(from, before)| {
                    Some((before.cost + self.cost_between(before, run, way)?, from))
                });
                let least = costs.min_by(|a, b| a.0.total_cmp(&b.0));
                let Some((before, from)) = least.or(earlier.is_empty().then_some((0.0, 0))) else {
                    continue;
                };
                let cost = before + self.outside(run, way) / rate_hz;
                here.push(Reached { way, pose: run.last, is_drawn: false, cost, from });
            }
            for (from, before) in earlier.iter().enumerate() {
                let drawn = run.to_draw.map(|cost| before.cost + cost);
                here.extend(drawn.map(|cost| Reached { is_drawn: true, cost, from, ..*before }));
            }
            here.sort_by(|a, b| a.cost.total_cmp(&b.cost));
            here.truncate(MOST_REACHED);
            reached.push(here);
        }
        let mut at = 0;
        let mut ways: Vec<Option<Way>> = Vec::with_capacity(reached.len());
        for here in reached.iter().rev() {
            ways.push((!here[at].is_drawn).then_some(here[at].way));
            at = here[at].from;
        }
        ways.reverse();
        ways
    }

    /// Both ways to say a run, with the whole turns that bring it nearest to its range, one more and
    /// one less; and, if it goes on from poses before it, as these are said.
    fn candidates(&self, run: &Run, earlier: &[Reached]) -> Vec<Way> {
        let turns = &self.turns[run.first..=run.last];
        let sum = turns.iter().fold([0.0; 3], |sum, turn| [0, 1, 2].map(|i| sum[i] + turn[i]));
        let mean = sum.map(|sum| sum / turns.len() as f64);
        let mut ways = Vec::with_capacity(18 + earlier.len());
        for flipped in [false, true] {
            let own = Way { flipped, whole: [0.0; 3] }.said(mean);
            let home = [0, 1, 2].map(|axis| {
                let middle = self.ball.signs[axis] * middle_rad(self.ball.dofs[axis]);
                ((middle - own[axis]) / TAU).round()
            });
            for y in [0.0, -1.0, 1.0] {
                for z in [0.0, -1.0, 1.0] {
                    ways.push(Way { flipped, whole: [home[0] + y, home[1], home[2] + z] });
                }
            }
        }
        for before in earlier.iter().filter(|_| run.after == After::Run) {
            if !ways.contains(&before.way) {
                ways.push(before.way);
            }
        }
        ways
    }

    /// By how much a run said so is outside the anatomical ranges, summed over its poses, rad.
    fn outside(&self, run: &Run, way: Way) -> f64 {
        let ranges = self.ball.dofs.map(Dof::range_rad);
        let turns = self.turns[run.first..=run.last].iter();
        turns
            .flat_map(|turns| self.ball.named(way.said(*turns)).into_iter().zip(ranges))
            .map(|(angle, (lower, upper))| {
                (lower - angle).max(angle - upper).max(0.0) + NEUTRAL * angle.abs()
            })
            .sum()
    }

    /// What it costs to go on to a run said so, rad s; none if the poses do not allow it.
    fn cost_between(&self, before: &Reached, run: &Run, way: Way) -> Option<f64> {
        if run.after == After::Run && !before.is_drawn {
            return (before.way == way).then_some(0.0);
        }
        let one = before.way.said(self.turns[before.pose]);
        let other = way.said(self.turns[run.first]);
        let turned: f64 = one.iter().zip(other).map(|(one, other)| (other - one).abs()).sum();
        if run.after == After::Leap {
            return Some(TURN_S * turned);
        }
        // At a quarter turn about X only y - z is known, at minus a quarter turn y + z.
        let sign = if self.turns[before.pose][1] > 0.0 { -1.0 } else { 1.0 };
        let known = |turns: [f64; 3]| turns[0] + sign * turns[2];
        Some(TURN_S * turned + BREAK_S * (known(other) - known(one)).abs())
    }

    /// The turns of every pose, runs said in these ways, and how far those between are from the poses
    /// at most, rad.
    fn said(&self, ways: &[Option<Way>]) -> (Vec<[f64; 3]>, f64) {
        let mut said = self.turns.clone();
        let runs = self.runs.iter().zip(ways).filter_map(|(run, way)| Some((run, (*way)?)));
        for (run, way) in runs.clone() {
            for turns in &mut said[run.first..=run.last] {
                *turns = way.said(*turns);
            }
        }
        let mut off_rad = 0.0f64;
        let mut from = 0;
        for (run, _) in runs {
            off_rad = off_rad.max(self.draw(&mut said, from..run.first));
            from = run.last + 1;
        }
        off_rad = off_rad.max(self.draw(&mut said, from..self.turned.len()));
        (said, off_rad)
    }

    /// Fills in poses near the singularity between two runs, or beyond the first or last; how far they
    /// are from what was captured at most, rad.
    fn draw(&self, said: &mut [[f64; 3]], poses: Range<usize>) -> f64 {
        let before = poses.start.checked_sub(1).map(|at| (at, said[at]));
        let after = said.get(poses.end).map(|turns| (poses.end, *turns));
        let flexion: Vec<f64> = self.flexion(
            &poses,
            before.map(|(at, turns)| (at, turns[0])),
            after.map(|(at, turns)| (at, turns[0])),
        );
        let mut off_rad = 0.0f64;
        // From the side where something is known, so that whole turns are counted from there.
        let mut neighbour = before.or(after).map_or([0.0; 3], |(_, turns)| turns);
        let mut fill = |at: usize| {
            let y = flexion[at - poses.start];
            let (x, z, off) = beside(self.turned[at], y);
            neighbour = [y, near(x, Some(neighbour[1])), near(z, Some(neighbour[2]))];
            said[at] = neighbour;
            off_rad = off_rad.max(off);
        };
        if before.is_some() {
            poses.clone().for_each(&mut fill);
        } else {
            poses.clone().rev().for_each(&mut fill);
        }
        off_rad
    }

    /// Turns about Y of poses near the singularity, from one end, if there is one, to the other.
    fn flexion(
        &self,
        poses: &Range<usize>,
        before: Option<(usize, f64)>,
        after: Option<(usize, f64)>,
    ) -> Vec<f64> {
        let ends = match (before, after) {
            (Some(before), Some(after)) => [before, after],
            (Some((_, y)), None) | (None, Some((_, y))) => [(poses.start, y), (poses.end, y)],
            (None, None) => [(poses.start, 0.0), (poses.end, 0.0)],
        };
        let straight = |at: usize| {
            let [(from, one), (to, other)] = ends;
            one + (other - one) * (at - from) as f64 / (to - from) as f64
        };
        // Either way of saying the pose will do: they are half a turn apart.
        let told = |at: usize| {
            let own = self.turns[at][0];
            own + PI * ((straight(at) - own) / PI).round()
        };
        let telling = || poses.clone().filter(|at| self.cosines[*at] > SILENT_WITHIN_RAD.sin());
        let is_straight = telling().all(|at| (told(at) - straight(at)).abs() <= STRAY_RAD);
        let mut knots = vec![ends[0]];
        if is_straight {
            knots.extend(telling().map(|at| (at, told(at))));
        }
        knots.push(ends[1]);
        let mut next = 0;
        let between = poses.clone().map(|at| {
            while next + 1 < knots.len() && knots[next].0 <= at {
                next += 1;
            }
            let ((to, other), (from, one)) = (knots[next], knots[next.saturating_sub(1)]);
            let part = if to > from { (at - from) as f64 / (to - from) as f64 } else { 0.0 };
            one + (other - one) * part * part * (3.0 - 2.0 * part)
        });
        between.collect()
    }
}

/// True of a pose that tells flexion from rotation.
fn is_away(cosine: f64) -> bool {
    cosine > SINGULAR_WITHIN_RAD.sin()
}

/// The turns about X and Z that, after one about Y, come nearest to an orientation, and how far they
/// are from it, rad: what is left to do is a bilinear form in the half angles, whose greatest singular
/// value and vectors have a closed form.
fn beside(turned: DQuat, y: f64) -> (f64, f64, f64) {
    let left = DQuat::from_rotation_y(-y) * turned;
    let (sum, difference) =
        ((left.x + left.z).atan2(left.w + left.y), (left.x - left.z).atan2(left.w - left.y));
    let (x, z) = (wrap_rad(sum + difference), wrap_rad(sum - difference));
    let said = DQuat::from_rotation_x(x) * DQuat::from_rotation_z(z);
    (x, z, said.angle_between(left.normalize()))
}

#[cfg(test)]
mod tests;
