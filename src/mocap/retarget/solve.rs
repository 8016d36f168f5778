//! The angles of a group of joints over a whole clip.
//!
//! A pose has several local best fits: an arm can be raised forwards or sideways, and a limit may
//! make the one better that is not next to the pose before. So, first, some ways are followed
//! side by side, each pose from the one before, with new starts every twentieth of a second, and
//! the cheapest sequence of ways is chosen (dynamic programming; changing ways costs the time it
//! takes). Then all poses are refined together, Gauss-Newton on a block tridiagonal system, with
//! the penalty on velocity, which makes the result the same read forwards or backwards.

use super::group::{Group, Normal, Target};
use crate::mocap::anatomy::Capture;
use nalgebra::{Cholesky, DMatrix, DVector};

/// Pull towards the pose before, in the first pass only.
const STEADY_WEIGHT: f64 = 0.05;
/// Time from one look for new ways to the next, s.
const LOOK_S: f64 = 0.05;
/// In larger groups the ends of only one joint's range are tried at a look, for time.
const MANY_JOINTS: usize = 8;
/// Ways followed side by side.
const WAYS: usize = 4;
/// Ways closer than this, rad, are one.
const SAME_RAD: f64 = 0.05;
/// Speed of changing from one way to another, rad/s, for its cost: as long as it lasts, the links
/// are off by about a radian.
const CHANGE_RAD_S: f64 = 8.0;
/// Weight of velocity, s: an angle that a segment settles fully follows up to 1 / (2 pi 0.006 s) =
/// 27 Hz, one that counts for a tenth up to 2.7 Hz.
const VELOCITY_WEIGHT_S: f64 = 0.006;
/// Speed, rad/s, beyond which velocity weighs more, and its weight there, s. A fast kick reaches
/// this speed; what is faster is a change of ways or a slip of the capture.
const FAST_RAD_S: f64 = 12.0;
const FAST_WEIGHT_S: f64 = 0.1;
/// Iterations from a cold start, from the pose before, and over the whole clip.
const COLD_STEPS: usize = 40;
const WARM_STEPS: usize = 6;
const CLIP_STEPS: usize = 20;
/// A step shorter than this, rad, ends the iteration.
const SHORT_STEP_RAD: f64 = 1e-5;

/// Solves a clip: angles by pose, each in the order of [`Group::joints`].
pub fn clip(group: &Group<'_>, capture: &Capture, initial_rad: &[f64]) -> Vec<DVector<f64>> {
    let targets: Vec<Vec<Target>> = capture.poses.iter().map(|pose| group.targets(pose)).collect();
    if targets.is_empty() {
        return Vec::new();
    }
    let angles = cheapest_ways(group, &targets, capture.rate_hz, initial_rad);
    together(group, &targets, angles, capture.rate_hz)
}

/// A way of fitting a stretch of poses.
struct Way {
    angles: Vec<DVector<f64>>,
    cost: f64,
    /// Least cost of all poses up to the end of this stretch, and the way before that gives it.
    total: f64,
    before: usize,
}

/// Follows ways through the clip, stretch by stretch, and picks the cheapest sequence.
fn cheapest_ways(
    group: &Group<'_>,
    targets: &[Vec<Target>],
    rate_hz: f64,
    initial_rad: &[f64],
) -> Vec<DVector<f64>> {
    let length = ((LOOK_S * rate_hz).round() as usize).max(1);
    let mut stretches: Vec<Vec<Way>> = Vec::new();
    for (number, stretch) in targets.chunks(length).enumerate() {
        let before = stretches.last().map_or(&[][..], Vec::as_slice);
        let mut ways: Vec<Way> = starts(group, &stretch[0], before, number, initial_rad)
            .into_iter()
            .map(|start| follow(group, stretch, start))
            .collect();
        for way in &mut ways {
            let reach = |(at, from): (usize, &Way)| {
                let jump = (&way.angles[0] - &from.angles[from.angles.len() - 1]).amax();
                (from.total + jump / CHANGE_RAD_S * rate_hz, at)
            };
            let cheapest = before.iter().enumerate().map(reach).min_by(|a, b| a.0.total_cmp(&b.0));
            let (total, from) = cheapest.unwrap_or((0.0, 0));
            (way.total, way.before) = (total + way.cost, from);
        }
        stretches.push(ways);
    }
    let mut chosen = Vec::new();
    let mut next: Option<usize> = None;
    while let Some(mut ways) = stretches.pop() {
        let cheapest = || (0..ways.len()).min_by(|a, b| ways[*a].total.total_cmp(&ways[*b].total));
        let Some(at) = next.or_else(cheapest) else { break };
        let way = ways.swap_remove(at);
        next = Some(way.before);
        chosen.extend(way.angles.into_iter().rev());
    }
    chosen.reverse();
    chosen
}

/// Distinct fits of the first pose of a stretch, the best few: from the ways before, from the
/// middle of the ranges, the initial pose, and the ends of one joint's range after another's.
fn starts(
    group: &Group<'_>,
    targets: &[Target],
    before: &[Way],
    number: usize,
    initial_rad: &[f64],
) -> Vec<DVector<f64>> {
    let size = group.joints().len();
    let middle = group.middles();
    let mut found: Vec<(DVector<f64>, f64)> = Vec::new();
    for way in before {
        let last = &way.angles[way.angles.len() - 1];
        found.push(descend(group, targets, last.clone(), Some(last), WARM_STEPS));
    }
    let initial = group.joints().iter().map(|joint| initial_rad[*joint]);
    let mut cold = vec![middle.clone(), DVector::from_iterator(size, initial)];
    let all = before.is_empty() || size <= MANY_JOINTS;
    let rows = if all { 0..size } else { number % size..number % size + 1 };
    for row in rows {
        let (lower, upper) = group.limits(row);
        for part in [0.1, 0.9] {
            let mut start = middle.clone();
            start[row] = lower + part * (upper - lower);
            cold.push(start);
        }
    }
    found.extend(cold.into_iter().map(|start| descend(group, targets, start, None, COLD_STEPS)));
    found.sort_by(|a, b| a.1.total_cmp(&b.1));
    let mut distinct: Vec<DVector<f64>> = Vec::new();
    for (angles, _) in found {
        if distinct.len() < WAYS && distinct.iter().all(|d| (d - &angles).amax() > SAME_RAD) {
            distinct.push(angles);
        }
    }
    distinct
}

/// Fits a stretch, each pose from the one before.
fn follow(group: &Group<'_>, stretch: &[Vec<Target>], start: DVector<f64>) -> Way {
    let mut normal = Normal::new(start.len());
    group.normal(&start, &stretch[0], &mut normal);
    let mut way = Way { angles: vec![start], cost: normal.cost, total: 0.0, before: 0 };
    for targets in &stretch[1..] {
        let last = &way.angles[way.angles.len() - 1];
        let (next, cost) = descend(group, targets, last.clone(), Some(last), WARM_STEPS);
        way.angles.push(next);
        way.cost += cost;
    }
    way
}

/// Levenberg-Marquardt descent on one pose: angles and cost.
fn descend(
    group: &Group<'_>,
    targets: &[Target],
    start: DVector<f64>,
    before: Option<&DVector<f64>>,
    steps: usize,
) -> (DVector<f64>, f64) {
    let size = start.len();
    let evaluate = |angles: &DVector<f64>, normal: &mut Normal| {
        group.normal(angles, targets, normal);
        if let Some(before) = before {
            for row in 0..size {
                normal.add_single(row, angles[row] - before[row], STEADY_WEIGHT.powi(2));
            }
        }
    };
    let mut angles = start;
    let mut here = Normal::new(size);
    let mut there = Normal::new(size);
    let mut damping = 1e-4;
    evaluate(&angles, &mut here);
    for _ in 0..steps {
        let mut damped = here.hessian.clone();
        for row in 0..size {
            damped[(row, row)] += damping;
        }
        let Some(factors) = Cholesky::new(damped) else { break };
        let step = -factors.solve(&here.gradient);
        let next = &angles + &step;
        evaluate(&next, &mut there);
        if there.cost < here.cost {
            angles = next;
            std::mem::swap(&mut here, &mut there);
            damping = (damping * 0.3).max(1e-6);
        } else {
            damping *= 10.0;
        }
        if step.amax() < SHORT_STEP_RAD {
            break;
        }
    }
    (angles, here.cost)
}

/// Refines all poses at once, with the penalty on velocity.
fn together(
    group: &Group<'_>,
    targets: &[Vec<Target>],
    mut angles: Vec<DVector<f64>>,
    rate_hz: f64,
) -> Vec<DVector<f64>> {
    let size = group.joints().len();
    let evaluate = |angles: &[DVector<f64>], normals: &mut [Normal]| {
        let mut cost = 0.0;
        for (at, normal) in normals.iter_mut().enumerate() {
            group.normal(&angles[at], &targets[at], normal);
            cost += normal.cost;
        }
        let moves = angles.windows(2).flat_map(|pair| (&pair[1] - &pair[0]).data.as_vec().clone());
        cost + moves.map(|change| velocity(change, rate_hz).cost).sum::<f64>()
    };
    let mut normals: Vec<Normal> = targets.iter().map(|_| Normal::new(size)).collect();
    let mut cost = evaluate(&angles, &mut normals);
    let mut damping = 1e-4;
    for _ in 0..CLIP_STEPS {
        let Some(steps) = chained_step(&normals, &angles, rate_hz, damping) else { break };
        let next: Vec<DVector<f64>> = angles.iter().zip(&steps).map(|(a, step)| a + step).collect();
        let next_cost = evaluate(&next, &mut normals);
        let longest = steps.iter().map(|step| step.amax()).fold(0.0, f64::max);
        if next_cost < cost {
            (angles, cost) = (next, next_cost);
            damping = (damping * 0.3).max(1e-6);
        } else {
            damping *= 10.0;
            evaluate(&angles, &mut normals);
        }
        if longest < 10.0 * SHORT_STEP_RAD {
            break;
        }
    }
    angles
}

/// The penalty on one joint's change from a pose to the next.
struct Velocity {
    cost: f64,
    /// Half the first and half the second derivative of the cost by the change.
    slope: f64,
    curvature: f64,
}

fn velocity(change: f64, rate_hz: f64) -> Velocity {
    let weight = (VELOCITY_WEIGHT_S * rate_hz).powi(2);
    let mut penalty =
        Velocity { cost: weight * change * change, slope: weight * change, curvature: weight };
    let beyond = change - change.clamp(-FAST_RAD_S / rate_hz, FAST_RAD_S / rate_hz);
    if beyond != 0.0 {
        let weight = (FAST_WEIGHT_S * rate_hz).powi(2);
        penalty.cost += weight * beyond * beyond;
        penalty.slope += weight * beyond;
        penalty.curvature += weight;
    }
    penalty
}

/// The Gauss-Newton step of all poses, coupled by velocity: block tridiagonal, by elimination
/// forwards and substitution backwards. The blocks off the diagonal are diagonal.
fn chained_step(
    normals: &[Normal],
    angles: &[DVector<f64>],
    rate_hz: f64,
    damping: f64,
) -> Option<Vec<DVector<f64>>> {
    let size = angles[0].len();
    let mut inverses: Vec<DMatrix<f64>> = Vec::with_capacity(normals.len());
    let mut sides: Vec<DVector<f64>> = Vec::with_capacity(normals.len());
    let mut couplings: Vec<DVector<f64>> = Vec::with_capacity(normals.len());
    for (at, normal) in normals.iter().enumerate() {
        let mut block = normal.hessian.clone();
        let mut side = -&normal.gradient;
        let mut coupling = DVector::zeros(size);
        for row in 0..size {
            block[(row, row)] += damping;
            if at > 0 {
                let penalty = velocity(angles[at][row] - angles[at - 1][row], rate_hz);
                side[row] -= penalty.slope;
                block[(row, row)] += penalty.curvature;
            }
            if let Some(next) = angles.get(at + 1) {
                let penalty = velocity(next[row] - angles[at][row], rate_hz);
                side[row] += penalty.slope;
                block[(row, row)] += penalty.curvature;
                coupling[row] = penalty.curvature;
            }
        }
        if let (Some(inverse), Some(before), Some(coupled)) =
            (inverses.last(), sides.last(), couplings.last())
        {
            side += (inverse * before).component_mul(coupled);
            let coupled = DMatrix::from_diagonal(coupled);
            block -= &coupled * inverse * &coupled;
        }
        inverses.push(Cholesky::new(block)?.inverse());
        sides.push(side);
        couplings.push(coupling);
    }
    let mut steps = vec![DVector::zeros(size); normals.len()];
    for at in (0..normals.len()).rev() {
        if at + 1 < normals.len() {
            sides[at] += steps[at + 1].component_mul(&couplings[at]);
        }
        steps[at] = &inverses[at] * &sides[at];
    }
    Some(steps)
}
