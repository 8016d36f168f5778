//! Motions without noise: what a limb can do it does exactly.
//!
//! The fit of a whole clip weighs velocity and acceleration, and a filter follows it. That takes
//! noise away, and rounds the corners where a robot comes to the edge of what it can do; but
//! everything else is bent a little, too. An action is smooth by itself. So each pose of a limb is
//! fitted once more, by itself and with segments and limits alone, and these angles are kept
//! wherever the robot then does what the body does. The smooth angles stay where it cannot: in a
//! limb that lacks a joint or stands at a limit, or stretched so that its angles are not settled by
//! where its segments point. One goes over into the other within 0.3 s.
//!
//! A limb that ends with smooth angles rests there, but not without acceleration: the filter takes
//! the motion beyond a rest for a mirror image of that before it. The acceleration is taken out
//! ([`land`]), so that every joint ends as an actionlet does.

use super::group::{Group, Normal, Room, Target};
use crate::mocap::anatomy::Capture;
use crate::motion::smooth::Rests;
use core::f64::consts::PI;
use nalgebra::{Cholesky, DMatrix, DVector};

/// Curvature added to that of the segments, so that angles which they leave open stay where they
/// are. Small beside [`SETTLED`]: each step takes 97 % of the error or more.
const DAMPING: f64 = 1e-3;
const STEPS: usize = 8;
/// Cost of a pose that is followed: one direction off by 0.006 degrees.
const FOLLOWED_COST: f64 = 1e-8;
/// Least curvature of a pose that is settled; 1 is that of a direction of normal weight. What counts
/// for less (a forearm's twist, a shoulder near its singularity) would move a joint six times as far
/// as the body moves and more.
const SETTLED: f64 = 0.03;
/// Half the time in which poses come back to their exact angles from one that is not followed, s:
/// what the filter and the fit make of a corner reaches about as far.
const REACH_S: f64 = 0.15;

/// Lays the exact angles of a group over its smooth ones, `smooth_rad[joint][pose]` with joints as
/// in the model; other joints are left alone.
pub fn lay_over(group: &Group<'_>, capture: &Capture, rests: Rests, smooth_rad: &mut [Vec<f64>]) {
    let mut room = Room::default();
    let joints = group.joints();
    let mut exact: Vec<Option<DVector<f64>>> = Vec::with_capacity(capture.poses.len());
    for (at, pose) in capture.poses.iter().enumerate() {
        let targets = group.targets(pose);
        let smooth = joints.iter().map(|joint| smooth_rad[*joint][at]);
        let smooth = DVector::from_iterator(joints.len(), smooth);
        let found = settled(group, &targets, smooth, &mut room);
        // What is very quick is far from its smooth angles, but near to the pose before.
        let before = exact.last().cloned().flatten();
        exact.push(found.or_else(|| settled(group, &targets, before?, &mut room)));
    }
    let followed: Vec<bool> = exact.iter().map(Option::is_some).collect();
    let reach = ((REACH_S * capture.rate_hz).ceil() as usize).max(1);
    let shares = shares(&followed, reach);
    let lands = |rests: bool, share: Option<&f64>| rests && share == Some(&0.0);
    let (lands_at_start, lands_at_end) =
        (lands(rests.start, shares.first()), lands(rests.end, shares.last()));
    for (row, joint) in joints.iter().enumerate() {
        let series = &mut smooth_rad[*joint];
        if lands_at_start {
            series.reverse();
            land(series, reach);
            series.reverse();
        }
        if lands_at_end {
            land(series, reach);
        }
        for ((angle, exact), share) in series.iter_mut().zip(&exact).zip(&shares) {
            if let Some(exact) = exact {
                *angle += share * (exact[row] - *angle);
            }
        }
    }
}

/// The angles in which a group does what its targets ask, from angles nearby; none if it cannot, or
/// if the targets leave angles open.
fn settled(
    group: &Group<'_>,
    targets: &[Target],
    start: DVector<f64>,
    room: &mut Room,
) -> Option<DVector<f64>> {
    let size = start.len();
    let (mut here, mut there) = (Normal::new(size), Normal::new(size));
    let mut angles = start;
    group.normal_without_middle(&angles, targets, &mut here, room);
    for _ in 0..STEPS {
        let damped = &here.hessian + DMatrix::identity(size, size) * DAMPING;
        let next = &angles - Cholesky::new(damped)?.solve(&here.gradient);
        group.normal_without_middle(&next, targets, &mut there, room);
        if !(there.cost < here.cost) {
            break;
        }
        angles = next;
        std::mem::swap(&mut here, &mut there);
    }
    // Positive definite still: no direction has less curvature.
    let left = &here.hessian - DMatrix::identity(size, size) * SETTLED;
    (here.cost <= FOLLOWED_COST && Cholesky::new(left).is_some()).then_some(angles)
}

/// How much of its exact angles each pose gets, 0 to 1: one that is not followed nothing, others
/// the more the further they are from it, and all of it beyond `2 reach` poses. The last `reach`
/// poses at either end get the same, so that no end is accelerated by a change of the share.
fn shares(followed: &[bool], reach: usize) -> Vec<f64> {
    let count = followed.len();
    let mut clear = vec![true; count];
    for (at, _) in followed.iter().enumerate().filter(|(_, followed)| !**followed) {
        clear[at.saturating_sub(reach)..(at + reach + 1).min(count)].fill(false);
    }
    let end = (2 * reach + 1).min(count);
    // The first once more: in a short clip the last may reach into it.
    for range in [0..end, count - end..count, 0..end] {
        if clear[range.clone()].contains(&false) {
            clear[range].fill(false);
        }
    }
    let weight = |distance: usize| 1.0 + (PI * distance as f64 / (reach + 1) as f64).cos();
    let weights: Vec<f64> = (0..=2 * reach).map(|at| weight(at.abs_diff(reach))).collect();
    (0..count)
        .map(|at| {
            let near = at.saturating_sub(reach)..(at + reach + 1).min(count);
            let weights = &weights[near.start + reach - at..];
            let (mut all, mut of_clear) = (0.0, 0.0);
            for (weight, clear) in weights.iter().zip(&clear[near]) {
                all += weight;
                of_clear += if *clear { *weight } else { 0.0 };
            }
            of_clear / all
        })
        .collect()
}

/// Takes its acceleration out of the end of a series that is even about it: half the second
/// difference there is the last difference. Nothing changes further than `reach` samples from the
/// end, nor the end's value and slope; in between acceleration grows by up to 37 % of what is
/// taken.
fn land(series: &mut [f64], reach: usize) {
    let [.., before, last] = *series else { return };
    let reach = reach.min((series.len() - 1) / 2);
    let (end, bend) = (series.len() - 1, 2.0 * (before - last) * (reach * reach) as f64);
    for (at, angle) in series[end - reach..].iter_mut().enumerate().skip(1) {
        // x^3 (1 - x)^2 / 2 has a second derivative of 0 at x = 0 and of 1 at x = 1, and no value
        // nor slope at either.
        let x = at as f64 / reach as f64;
        *angle -= bend * x.powi(3) * (1.0 - x).powi(2) / 2.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Second difference of the last three samples, and the last first difference.
    fn last_bends(series: &[f64]) -> [f64; 2] {
        let [.., a, b, c] = *series else { panic!("three samples") };
        [a - 2.0 * b + c, b - c]
    }

    #[test]
    fn an_end_at_rest_loses_its_acceleration_and_keeps_its_value() {
        let count = 200;
        for (size, reach) in [(0.3, 36), (-1.2, 18), (0.3, 500)] {
            let mut series: Vec<f64> =
                (0..=count).map(|at| size * (0.02 * f64::from(count - at)).cos()).collect();
            let before = series.clone();
            land(&mut series, reach);
            let kept = before.len() - 1 - reach.min(100);
            assert_eq!(series[..=kept], before[..=kept]);
            assert_eq!(series.last(), before.last());
            let ([_, had], [next, has]) = (last_bends(&before), last_bends(&series));
            // What is left in the last step is that of an acceleration that grows from zero.
            let over = reach.min(100) as f64;
            assert!(has.abs() < 3.01 / over * had.abs(), "{has} of {had}");
            assert!(next.abs() < 20.0 / over * had.abs(), "{next} of {had}");
            let sharpest = |series: &[f64]| {
                series.windows(3).map(|w| (w[0] - 2.0 * w[1] + w[2]).abs()).fold(0.0, f64::max)
            };
            assert!(sharpest(&series) < 1.45 * sharpest(&before));
        }
        for short in [vec![], vec![1.0], vec![1.0, 2.0]] {
            let mut series = short.clone();
            land(&mut series, 9);
            assert_eq!(series, short);
        }
    }

    #[test]
    fn what_is_followed_throughout_is_exact_throughout_and_what_is_never_followed_never() {
        for count in [1, 2, 7, 300] {
            assert!(shares(&vec![true; count], 36).iter().all(|share| *share == 1.0));
            assert!(shares(&vec![false; count], 36).iter().all(|share| *share == 0.0));
        }
        assert!(shares(&[], 36).is_empty());
    }

    #[test]
    fn a_pose_that_is_not_followed_takes_its_neighbours_with_it_smoothly() {
        let mut followed = vec![true; 400];
        followed[200] = false;
        let shares = shares(&followed, 20);
        assert!(shares[180..=220].iter().all(|share| *share < 0.6), "{:?}", &shares[180..=220]);
        assert_eq!(shares[200], 0.0);
        assert!(shares[..=159].iter().chain(&shares[241..]).all(|share| *share == 1.0));
        for pair in shares[160..=200].windows(2) {
            assert!(pair[1] <= pair[0] && pair[0] - pair[1] < 0.06, "{pair:?}");
        }
    }

    #[test]
    fn near_an_end_it_is_all_or_nothing() {
        for (at, share) in [(0, 0.0), (30, 0.0), (399 - 30, 1.0), (200, 1.0)] {
            let mut followed = vec![true; 400];
            followed[at] = false;
            let found = shares(&followed, 20);
            assert!(found[..=20].iter().all(|found| *found == share), "{at}: {:?}", &found[..=20]);
            followed.reverse();
            let found = shares(&followed, 20);
            assert!(found[379..].iter().all(|found| *found == share), "{at}");
        }
        // Too short for two ends: one of them decides for both.
        let mut followed = vec![true; 50];
        followed[3] = false;
        assert!(shares(&followed, 20).iter().all(|share| *share == 0.0));
    }
}
