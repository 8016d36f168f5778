//! All poses of a clip at once: segments, limits, and how the joints move between poses.
//!
//! Two penalties couple the poses. One is on velocity, alike everywhere. The other is on
//! acceleration, and weighs the more the worse the best fit of a pose is: an arm that cannot turn
//! about itself, or a leg at its limit, is far from the person's whatever it does, and what cannot
//! be followed need not be chased. Where a robot can do what the person does, it weighs nothing.

use super::banded::Banded;
use super::group::{Group, Normal, Room, Target};
use crate::motion::smooth::Rests;
use nalgebra::DVector;

/// Weight of velocity, s: an angle that a segment settles fully follows up to 1 / (2 pi 0.006 s) =
/// 27 Hz, one that counts for a tenth up to 2.7 Hz.
const VELOCITY_WEIGHT_S: f64 = 0.006;
/// Speed, rad/s, beyond which velocity weighs more, and its weight there, s. A fast kick reaches
/// this speed; what is faster is a change of fits or a slip of the capture.
const FAST_RAD_S: f64 = 12.0;
const FAST_WEIGHT_S: f64 = 0.1;
/// Weight of acceleration where a pose cannot be followed at all, s^2: an angle of normal weight is
/// then filtered as by two passes of a Butterworth filter at 1 / (2 pi 0.1 s) = 1.6 Hz.
const UNFOLLOWED_WEIGHT_S2: f64 = 0.01;
/// The same for a limb that lacks no joint, and is stopped by its limits only.
const STOPPED_WEIGHT_S2: f64 = 0.003;
/// Cost of a fit at which half of that applies: one direction off by 18 degrees.
const UNFOLLOWED_COST: f64 = 0.1;
/// That weight is the mean over so many seconds before and after: a limb that arrives where it
/// cannot go on has to slow down first.
const UNFOLLOWED_REACH_S: f64 = 0.3;
const STEPS: usize = 100;
/// A step shorter than this, rad, ends the iteration.
const FINE_STEP_RAD: f64 = 1e-4;

/// Refines angles of all poses from those of the first pass. An end where the body rests is one where
/// the motion turns back as it came: the joints rest there, too.
pub fn together(
    group: &Group<'_>,
    targets: &[Vec<Target>],
    mut angles: Vec<DVector<f64>>,
    rate_hz: f64,
    rests: Rests,
) -> Vec<DVector<f64>> {
    let mut room = Room::default();
    let mut fit = |angles: &[DVector<f64>], normals: &mut [Normal]| {
        for ((normal, angles), targets) in normals.iter_mut().zip(angles).zip(targets) {
            group.normal(angles, targets, normal, &mut room);
        }
    };
    let mut normals: Vec<Normal> =
        targets.iter().map(|_| Normal::new(group.joints().len())).collect();
    fit(&angles, &mut normals);
    // Every segment points in a direction of two angles.
    let lacks_joints = group.joints().len() < 2 * group.links().len();
    let weight_s2 = if lacks_joints { UNFOLLOWED_WEIGHT_S2 } else { STOPPED_WEIGHT_S2 };
    let calm =
        calm(weight_s2, &normals.iter().map(|normal| normal.cost).collect::<Vec<_>>(), rate_hz);
    let pace = Pace { rate_hz, calm, rests };
    let cost = |normals: &[Normal], angles: &[DVector<f64>]| {
        normals.iter().map(|normal| normal.cost).sum::<f64>()
            + pace.changes(angles).map(|change| change.penalty.cost).sum::<f64>()
    };
    let mut here = cost(&normals, &angles);
    let mut damping = 1e-4;
    for _ in 0..STEPS {
        let Some(steps) = coupled_step(&normals, &angles, &pace, damping) else { break };
        let next: Vec<DVector<f64>> = angles.iter().zip(&steps).map(|(a, step)| a + step).collect();
        let longest = steps.iter().map(|step| step.amax()).fold(0.0, f64::max);
        fit(&next, &mut normals);
        let there = cost(&normals, &next);
        if there < here {
            (angles, here) = (next, there);
            damping = (damping * 0.3).max(1e-6);
        } else {
            damping *= 10.0;
            fit(&angles, &mut normals);
        }
        if longest < FINE_STEP_RAD {
            break;
        }
    }
    angles
}

/// Weight of acceleration by pose, s^4, from the costs of their fits in the first pass.
fn calm(weight_s2: f64, costs: &[f64], rate_hz: f64) -> Vec<f64> {
    let weight = |cost: &f64| {
        let square = cost * cost;
        weight_s2.powi(2) * square / (square + UNFOLLOWED_COST.powi(2))
    };
    let weights: Vec<f64> = costs.iter().map(weight).collect();
    let reach = (UNFOLLOWED_REACH_S * rate_hz) as usize;
    let around = |at: usize| {
        let near = &weights[at.saturating_sub(reach)..(at + reach + 1).min(weights.len())];
        near.iter().sum::<f64>() / near.len() as f64
    };
    (0..weights.len()).map(around).collect()
}

/// What couples the poses.
struct Pace {
    rate_hz: f64,
    /// Weight of acceleration, s^4, by pose.
    calm: Vec<f64>,
    rests: Rests,
}

/// A penalty on how one joint moves: on a sum of successive angles, each times its part.
struct Change {
    /// The first of the poses, and the joint.
    at: usize,
    row: usize,
    parts: &'static [f64],
    penalty: Penalty,
}

/// A penalty on a value, `weight * value^2`.
struct Penalty {
    cost: f64,
    /// Half the first and half the second derivative of the cost by the sum of angles.
    slope: f64,
    curvature: f64,
}

impl Penalty {
    /// For a value that is a sum of angles times `scale`.
    fn new(value: f64, weight: f64, scale: f64) -> Self {
        let slope = weight * value * scale;
        Self { cost: weight * value * value, slope, curvature: weight * scale * scale }
    }

    /// Adds one on what a value is beyond a bound.
    fn beyond(mut self, value: f64, bound: f64, weight: f64, scale: f64) -> Self {
        let beyond = value - value.clamp(-bound, bound);
        if beyond != 0.0 {
            let more = Self::new(beyond, weight, scale);
            self.cost += more.cost;
            self.slope += more.slope;
            self.curvature += more.curvature;
        }
        self
    }
}

impl Pace {
    /// All penalties on how the joints move.
    fn changes(&self, angles: &[DVector<f64>]) -> impl Iterator<Item = Change> {
        let size = angles.first().map_or(0, DVector::len);
        let velocities =
            angles.windows(2).enumerate().flat_map(move |(at, poses)| {
                (0..size).map(move |row| {
                    let value = (poses[1][row] - poses[0][row]) * self.rate_hz;
                    let penalty = Penalty::new(value, VELOCITY_WEIGHT_S.powi(2), self.rate_hz)
                        .beyond(value, FAST_RAD_S, FAST_WEIGHT_S.powi(2), self.rate_hz);
                    Change { at, row, parts: &[-1.0, 1.0], penalty }
                })
            });
        let square = self.rate_hz.powi(2);
        let accelerations = angles.windows(3).enumerate().flat_map(move |(at, poses)| {
            (0..size).map(move |row| {
                let value = (poses[2][row] - 2.0 * poses[1][row] + poses[0][row]) * square;
                let penalty = Penalty::new(value, self.calm[at + 1], square);
                Change { at, row, parts: &[1.0, -2.0, 1.0], penalty }
            })
        });
        // At a rest, half of the mirrored acceleration.
        let last = angles.len().saturating_sub(1);
        let ends = [(self.rests.start, 0, 0), (self.rests.end, last, last.saturating_sub(1))];
        let rests = ends.into_iter().filter(move |(rests, ..)| *rests && last > 0);
        let turns = rests.flat_map(move |(_, pose, at)| {
            (0..size).map(move |row| {
                let value = (angles[at + 1][row] - angles[at][row]) * 2.0 * square;
                let penalty = Penalty::new(value, self.calm[pose] / 2.0, 2.0 * square);
                Change { at, row, parts: &[-1.0, 1.0], penalty }
            })
        });
        velocities.chain(accelerations).chain(turns)
    }
}

/// The Gauss-Newton step of all poses: a banded system, since no penalty reaches further than two
/// poses.
fn coupled_step(
    normals: &[Normal],
    angles: &[DVector<f64>],
    pace: &Pace,
    damping: f64,
) -> Option<Vec<DVector<f64>>> {
    let size = angles[0].len();
    let mut system = Banded::new(normals.len() * size, 2 * size);
    for (at, normal) in normals.iter().enumerate() {
        for row in 0..size {
            let i = at * size + row;
            system.side[i] -= normal.gradient[row];
            for column in 0..=row {
                *system.entry(i, at * size + column) += normal.hessian[(row, column)];
            }
            *system.entry(i, i) += damping;
        }
    }
    for Change { at, row, parts, penalty } in pace.changes(angles) {
        for (later, part) in parts.iter().enumerate() {
            let i = (at + later) * size + row;
            system.side[i] -= part * penalty.slope;
            for (sooner, other) in parts.iter().enumerate().take(later + 1) {
                *system.entry(i, (at + sooner) * size + row) += part * other * penalty.curvature;
            }
        }
    }
    let steps = system.solve()?;
    Some(steps.chunks(size).map(DVector::from_column_slice).collect())
}
