//! The steps of a person: which foot is lifted when, and where it comes down beside the one that stands.
//!
//! A foot stands while it carries, heel or toe ([`crate::retarget::footfall`]), at where its toe is then. Only a motion in which each foot is
//! lifted over a standing one, and not high, is one of steps: who kicks or hops does something else.

use crate::retarget::toe::Toe;
use glam::{DQuat, DVec2, DVec3};

/// A foot that leaves the floor for a shorter time does not, s.
const BLINK_S: f64 = 0.1;
/// So much of a step may pass while the other foot is in the air as well: somebody runs.
const FLIGHT: f64 = 0.5;
/// A toe that is lifted higher than this part of a leg does not step.
const HIGH: f64 = 0.45;
/// A person looks where the trunk does on average over this time, s: at each step it turns to and fro.
const HEADING_S: f64 = 1.0;

/// A step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Which foot is lifted; 0 is left.
    pub side: usize,
    /// When it is lifted, s.
    pub lifted_s: f64,
    /// When it comes down, s.
    pub planted_s: f64,
    /// How far before the standing foot it comes down, m.
    pub ahead_m: f64,
    /// How far beside it, to its own side, m.
    pub aside_m: f64,
    /// How much whoever steps turns meanwhile, to the left, rad.
    pub turn_rad: f64,
}

/// The steps of a person with legs of `leg_m` whose feet carry and whose pelvis is turned so, pose by pose, at `rate_hz`, in
/// their order; none if the motion is none of steps.
#[must_use]
pub fn of_person(
    toes: &[Toe; 2],
    carries: &[[bool; 2]],
    pelvis: &[DQuat],
    leg_m: f64,
    rate_hz: f64,
) -> Option<Vec<Step>> {
    let count = pelvis.len().min(carries.len());
    let planted: [Vec<Stand>; 2] = [0, 1].map(|side| {
        let carries: Vec<bool> = carries[..count].iter().map(|of| of[side]).collect();
        stands(&toes[side], &carries, rate_hz)
    });
    let headings = headings(pelvis, rate_hz);
    let mut steps = Vec::new();
    for (side, stands) in planted.iter().enumerate() {
        for two in stands.windows(2) {
            let (from, to) = (two[0].to, two[1].from);
            let rise_m = (from..to).map(|at| toes[side].at_m[at].z).fold(0.0, f64::max);
            let floor_m = two[0].height_m.min(two[1].height_m);
            if rise_m - floor_m > HIGH * leg_m {
                return None;
            }
            let middle = (from + to) / 2;
            let beside = nearest(&planted[1 - side], middle)?;
            let heading = DVec2::from_angle(-headings[to.min(count - 1)]);
            let away = heading.rotate(two[1].at_m - beside.at_m);
            let outward = if side == 0 { away.y } else { -away.y };
            steps.push((
                middle,
                Step {
                    side,
                    lifted_s: from as f64 / rate_hz,
                    planted_s: to as f64 / rate_hz,
                    ahead_m: away.x,
                    aside_m: outward,
                    turn_rad: 0.0,
                },
            ));
        }
    }
    steps.sort_by_key(|(middle, _)| *middle);
    let mut steps: Vec<Step> = steps.into_iter().map(|(_, step)| step).collect();
    let together = |one: &Step, two: &Step| {
        let both_s = one.planted_s.min(two.planted_s) - one.lifted_s.max(two.lifted_s);
        let shorter_s = (one.planted_s - one.lifted_s).min(two.planted_s - two.lifted_s);
        both_s > FLIGHT * shorter_s
    };
    if steps.windows(2).any(|two| together(&two[0], &two[1])) {
        return None;
    }
    let heading_at = |time_s: f64| headings[((time_s * rate_hz) as usize).min(count - 1)];
    let mut before = headings.first().copied().unwrap_or(0.0);
    for step in &mut steps {
        let now = heading_at(step.planted_s);
        step.turn_rad = now - before;
        before = now;
    }
    Some(steps)
}

/// A foot on the floor.
struct Stand {
    from: usize,
    to: usize,
    at_m: DVec2,
    height_m: f64,
}

fn stands(toe: &Toe, carries: &[bool], rate_hz: f64) -> Vec<Stand> {
    let blink = (BLINK_S * rate_hz) as usize;
    let mut found: Vec<(usize, usize)> = Vec::new();
    for at in (0..carries.len()).filter(|at| carries[*at]) {
        match found.last_mut() {
            Some((_, to)) if at - *to <= blink => *to = at + 1,
            _ => found.push((at, at + 1)),
        }
    }
    let stand = |(from, to): (usize, usize)| {
        // A toe that still comes or already goes is not where the foot stands.
        let still: Vec<DVec3> =
            (from..to).filter(|at| toe.contact[*at]).map(|at| toe.at_m[at]).collect();
        let at_m = if still.is_empty() { &toe.at_m[from..to] } else { &still };
        let mean = at_m.iter().sum::<DVec3>() / at_m.len() as f64;
        Stand { from, to, at_m: mean.truncate(), height_m: mean.z }
    };
    found.into_iter().map(stand).collect()
}

/// What stands then, or else next to then.
fn nearest(stands: &[Stand], at: usize) -> Option<&Stand> {
    let off = |stand: &&Stand| stand.from.saturating_sub(at).max(at.saturating_sub(stand.to));
    stands.iter().min_by_key(off)
}

/// Where somebody looks on average around each pose, rad, without jumps of a turn.
fn headings(pelvis: &[DQuat], rate_hz: f64) -> Vec<f64> {
    let mut last = 0.0;
    let mut sums = vec![0.0];
    for turned in pelvis {
        let forward = (*turned * DVec3::X).truncate();
        if forward.length_squared() > 1e-6 {
            last += crate::units::wrap_rad(forward.to_angle() - last);
        }
        sums.push(sums[sums.len() - 1] + last);
    }
    let half = (HEADING_S / 2.0 * rate_hz) as usize;
    (0..pelvis.len())
        .map(|at| {
            let (from, to) = (at.saturating_sub(half), (at + half + 1).min(pelvis.len()));
            (sums[to] - sums[from]) / (to - from) as f64
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two toes at 100 Hz: each is lifted where it is said to be, and comes down so much further on.
    fn toes(lifts: [&[(usize, usize, f64)]; 2], rise_m: f64) -> [Toe; 2] {
        [0.1, -0.1].map(|y| {
            let lifts = lifts[usize::from(y < 0.0)];
            let mut toe = Toe { at_m: Vec::new(), contact: Vec::new() };
            let mut x = 0.0;
            for at in 0..400 {
                let swing = lifts.iter().find(|(from, to, _)| (*from..*to).contains(&at));
                let z = swing.map_or(0.0, |_| rise_m);
                x += swing.map_or(0.0, |(from, to, far)| far / (to - from) as f64);
                toe.at_m.push(DVec3::new(x, y, z));
                toe.contact.push(swing.is_none());
            }
            toe
        })
    }

    fn steps(toes: &[Toe; 2], pelvis: &[DQuat]) -> Option<Vec<Step>> {
        let carries: Vec<[bool; 2]> =
            (0..400).map(|at| [toes[0].contact[at], toes[1].contact[at]]).collect();
        of_person(toes, &carries, pelvis, 0.8, 100.0)
    }

    const STRAIGHT: [DQuat; 400] = [DQuat::IDENTITY; 400];

    #[test]
    fn who_walks_takes_steps_one_after_the_other_each_before_the_foot_that_stands() {
        let walk =
            toes([&[(50, 90, 0.4), (150, 190, 0.8)], &[(100, 140, 0.8), (200, 240, 0.4)]], 0.08);
        let found = steps(&walk, &STRAIGHT).expect("steps");
        let said: Vec<(usize, f64, f64)> =
            found.iter().map(|step| (step.side, step.lifted_s, step.planted_s)).collect();
        assert_eq!(said, [(0, 0.5, 0.9), (1, 1.0, 1.4), (0, 1.5, 1.9), (1, 2.0, 2.4)]);
        for (step, ahead) in found.iter().zip([0.4, 0.4, 0.4, 0.0]) {
            assert!(
                (step.ahead_m - ahead).abs() < 1e-9 && (step.aside_m - 0.2).abs() < 1e-9,
                "{step:?}"
            );
        }
    }

    #[test]
    fn who_looks_elsewhere_steps_there_and_turns() {
        let walk = toes([&[(50, 90, 0.4)], &[(100, 140, 0.4)]], 0.08);
        let pelvis: Vec<DQuat> =
            (0..400).map(|at| DQuat::from_rotation_z(if at < 160 { 0.0 } else { 1.0 })).collect();
        let found = steps(&walk, &pelvis).expect("steps");
        assert!(found[0].turn_rad.abs() < 1e-9);
        assert!(found[1].turn_rad > 0.1, "{found:?}");
        let sideways = [DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2); 400];
        let found = steps(&walk, &sideways).expect("steps");
        // Forward of the room is to the right then.
        assert!((found[0].ahead_m - 0.2).abs() < 1e-9 && (found[0].aside_m + 0.4).abs() < 1e-9);
    }

    #[test]
    fn kicks_jumps_and_hops_are_no_steps() {
        let kick = toes([&[(50, 90, 0.0)], &[]], 0.6);
        assert_eq!(steps(&kick, &STRAIGHT), None);
        let jump = toes([&[(50, 90, 0.0)], &[(50, 90, 0.0)]], 0.1);
        assert_eq!(steps(&jump, &STRAIGHT), None);
        let hop = toes([&[(50, 300, 0.0)], &[(100, 140, 0.3)]], 0.1);
        assert_eq!(steps(&hop, &STRAIGHT), None);
        assert_eq!(steps(&toes([&[], &[]], 0.0), &STRAIGHT), Some(Vec::new()));
    }
}
