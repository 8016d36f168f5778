//! The angles of a group of joints over a whole clip.
//!
//! A pose has several local best fits: an arm can be raised forwards or sideways, and a limit may
//! make the one better that is not next to the pose before. So, first, each pose is fitted from
//! the fits of the pose before and from some fixed starts, and the cheapest way from fit to fit
//! through the clip is chosen (dynamic programming; a change of fits costs the time it takes).
//! Then all poses are refined together (`refine`). As nothing but poses decides, the result does
//! not hang on where a clip begins.

use super::group::{Group, Normal, Room, Target};
use super::refine;
use crate::mocap::anatomy::Capture;
use crate::motion::smooth::Rests;
use nalgebra::{Cholesky, DVector};

/// Pull towards the pose before, in the first pass only.
const STEADY_WEIGHT: f64 = 0.05;
/// Fits kept per pose.
const FITS: usize = 4;
/// A fit this cheap, some 6 degrees off in one direction, needs no better one looked for.
pub(super) const GOOD_COST: f64 = 0.01;
/// Fits closer than this, rad, are one.
pub(super) const SAME_RAD: f64 = 0.05;
/// In larger groups of joints the ends of their ranges are not tried as starts, for time.
const MANY_JOINTS: usize = 8;
/// Speed of changing from one fit to another, rad/s, for its cost: as long as it lasts, the links
/// are off by about a radian.
pub(super) const CHANGE_RAD_S: f64 = 8.0;
/// Iterations from a fixed start, and from the pose before.
pub(super) const COLD_STEPS: usize = 30;
pub(super) const WARM_STEPS: usize = 6;
/// A step shorter than this, rad, ends the iteration.
const ROUGH_STEP_RAD: f64 = 1e-3;

/// Solves a clip: angles by pose, each in the order of [`Group::joints`].
pub fn clip(
    group: &Group<'_>,
    capture: &Capture,
    rests: Rests,
    initial_rad: &[f64],
) -> Vec<DVector<f64>> {
    let targets: Vec<Vec<Target>> = capture.poses.iter().map(|pose| group.targets(pose)).collect();
    if targets.is_empty() {
        return Vec::new();
    }
    let angles = cheapest_way(group, &targets, capture.rate_hz, initial_rad);
    refine::together(group, &targets, angles, capture.rate_hz, rests)
}

/// A local best fit of a pose.
struct Fit {
    angles: DVector<f64>,
    cost: f64,
    /// Least cost of all poses up to this one, and the fit of the pose before that gives it.
    total: f64,
    before: usize,
}

/// Fits every pose in some ways and picks the cheapest sequence.
fn cheapest_way(
    group: &Group<'_>,
    targets: &[Vec<Target>],
    rate_hz: f64,
    initial_rad: &[f64],
) -> Vec<DVector<f64>> {
    let starts = fixed_starts(group, initial_rad);
    let mut poses: Vec<Vec<Fit>> = Vec::with_capacity(targets.len());
    for target in targets {
        let before = poses.last().map_or(&[][..], Vec::as_slice);
        let mut fits = fits(group, target, before, &starts);
        for fit in &mut fits {
            let reach = |(at, from): (usize, &Fit)| {
                let jump = (&fit.angles - &from.angles).amax();
                (from.total + jump / CHANGE_RAD_S * rate_hz, at)
            };
            let cheapest = before.iter().enumerate().map(reach).min_by(|a, b| a.0.total_cmp(&b.0));
            let (total, from) = cheapest.unwrap_or((0.0, 0));
            (fit.total, fit.before) = (total + fit.cost, from);
        }
        poses.push(fits);
    }
    let mut chosen = Vec::with_capacity(targets.len());
    let mut next: Option<usize> = None;
    while let Some(mut fits) = poses.pop() {
        let cheapest = || (0..fits.len()).min_by(|a, b| fits[*a].total.total_cmp(&fits[*b].total));
        let Some(at) = next.or_else(cheapest) else { break };
        let fit = fits.swap_remove(at);
        next = Some(fit.before);
        chosen.push(fit.angles);
    }
    chosen.reverse();
    chosen
}

/// Where fits start beside the pose before: middle of the ranges, initial pose, and one joint
/// after another near either end of its range.
pub(super) fn fixed_starts(group: &Group<'_>, initial_rad: &[f64]) -> Vec<DVector<f64>> {
    let size = group.joints().len();
    let middle = group.middles();
    let initial = group.joints().iter().map(|joint| initial_rad[*joint]);
    let mut starts = vec![middle.clone(), DVector::from_iterator(size, initial)];
    if size <= MANY_JOINTS {
        for row in 0..size {
            let (lower, upper) = group.limits(row);
            for part in [0.1, 0.9] {
                let mut start = middle.clone();
                start[row] = lower + part * (upper - lower);
                starts.push(start);
            }
        }
    }
    starts
}

/// Distinct fits of a pose, the best few.
fn fits(
    group: &Group<'_>,
    targets: &[Target],
    before: &[Fit],
    starts: &[DVector<f64>],
) -> Vec<Fit> {
    let warm = before
        .iter()
        .map(|fit| descend(group, targets, fit.angles.clone(), Some(&fit.angles), WARM_STEPS));
    let mut found: Vec<(DVector<f64>, f64)> = warm.collect();
    if found.iter().all(|(_, cost)| *cost > GOOD_COST) {
        let cold = starts.iter();
        found.extend(cold.map(|start| descend(group, targets, start.clone(), None, COLD_STEPS)));
    }
    found.sort_by(|a, b| a.1.total_cmp(&b.1));
    let mut distinct: Vec<Fit> = Vec::with_capacity(FITS);
    for (angles, cost) in found {
        let is_new = distinct.iter().all(|fit| (&fit.angles - &angles).amax() > SAME_RAD);
        if is_new && distinct.len() < FITS {
            distinct.push(Fit { angles, cost, total: 0.0, before: 0 });
        }
    }
    distinct
}

/// Levenberg-Marquardt descent on one pose: angles and cost.
pub(super) fn descend(
    group: &Group<'_>,
    targets: &[Target],
    start: DVector<f64>,
    before: Option<&DVector<f64>>,
    steps: usize,
) -> (DVector<f64>, f64) {
    let size = start.len();
    let mut room = Room::default();
    let mut evaluate = |angles: &DVector<f64>, normal: &mut Normal| {
        group.normal(angles, targets, normal, &mut room);
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
        if step.amax() < ROUGH_STEP_RAD {
            break;
        }
    }
    (angles, here.cost)
}
