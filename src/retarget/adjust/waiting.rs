//! A whole clip moved pose by pose, whose clock waits while weight goes from foot to foot.
//!
//! What a plan over the whole clip cannot keep on its feet at any pace can often be done as [`Adjuster`] does what comes next:
//! feet go straight up and straight down, each once the weight is over the other. Nobody has to hurry here: while a foot is
//! about to leave the floor or to come down, the person waits.

use super::{Adjustable, Adjuster, Lifts, Solver};
use crate::body::root::spread;
use crate::error::Error;
use crate::motion::{End, Spline};
use crate::retarget::Footfall;
use crate::retarget::footfall;
use glam::DVec3;

/// Length of a step, s.
const STEP_S: f64 = 0.01;
/// The clock stops and goes on over this time, s.
const STOPS_S: f64 = 0.1;
/// So long a foot is waited for that does not come to leave the floor or to stand, and the robot at either end, s.
const LONGEST_S: f64 = 3.0;
/// Angles are averaged over this time, standard deviation, s: pose by pose a foot begins to stand or to go from one to the next.
const SPREAD_S: f64 = 0.05;

/// What feet may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FeetMay {
    /// Leave the floor one by one.
    Step,
    /// Stay where they are.
    Stay,
}

/// A clip that was moved.
#[derive(Clone, Debug, PartialEq)]
pub struct Waited {
    /// `[joint][pose]`, rad: from the pose the robot starts in, to rest on both feet.
    pub angles_rad: Vec<Vec<f64>>,
    /// What its feet do, pose by pose.
    pub footfalls: Vec<Footfall>,
    /// Of each pose the time of the clip, in poses of it.
    pub clock: Vec<f64>,
    /// How often feet were lifted.
    pub lifts: Lifts,
    /// The part of the poses in which links are in one another.
    pub touching_share: f64,
}

/// Moves `angles_rad[joint][pose]`, poses of a clip that follow at `rate_hz` and are played `speed` times as fast; joints turn by
/// `velocity_rad_s` at most. None of a robot that does not stand on two soles.
///
/// # Errors
/// None that is known: of a spline through what is there.
pub fn waited(
    of: Adjustable<'_>,
    velocity_rad_s: &[f64],
    angles_rad: &[Vec<f64>],
    footfalls: &[Footfall],
    [rate_hz, speed]: [f64; 2],
    feet_may: FeetMay,
) -> Result<Option<Waited>, Error> {
    let Some(last) = footfalls.len().checked_sub(1).filter(|last| *last > 1) else {
        return Ok(None);
    };
    let splines: Vec<Spline> = angles_rad
        .iter()
        .map(|series| Spline::through(series.clone(), 1.0, End::Free, End::Free))
        .collect::<Result<_, _>>()?;
    let mut adjuster = Adjuster::new(of, velocity_rad_s, of.start_rad, true);
    if adjuster.lifts().is_none() {
        return Ok(None);
    }
    if feet_may == FeetMay::Stay {
        adjuster = adjuster.kept_down();
    }
    // Samples of the clip in a step at its own pace.
    let whole = STEP_S * speed * rate_hz;
    let (mut along, mut pace) = (0.0_f64, 0.0_f64);
    let (mut waits_s, mut after_s) = (0.0, 0.0);
    let mut poses = vec![of.start_rad.to_vec()];
    let mut feet = Vec::new();
    let mut clock = vec![0.0];
    loop {
        let (before, share) = (along as usize, along.fract());
        let said = footfalls[before].towards(&footfalls[(before + 1).min(last)], share);
        let is_over = along >= last as f64;
        // Whoever ends on one foot is given the other one back.
        let pose: Vec<f64> = if is_over && adjuster.is_stepping() {
            of.start_rad.to_vec()
        } else {
            splines.iter().map(|spline| spline.sample(along)[0]).collect()
        };
        let pose = adjuster.place(&pose, said.up, STEP_S, false);
        feet.push(adjuster.feet(said.up));
        if feet.len() == 1 {
            feet.push(feet[0]);
        }
        poses.push(pose);
        let is_waited_for = adjuster.is_arriving() || adjuster.hands_over();
        waits_s = if is_waited_for { waits_s + STEP_S } else { 0.0 };
        let goal = if is_waited_for && waits_s < LONGEST_S { 0.0 } else { whole };
        pace += (goal - pace) * (STEP_S / STOPS_S);
        along = (along + pace).min(last as f64);
        clock.push(along);
        if is_over {
            after_s += STEP_S;
            let is_there = !adjuster.is_stepping() && !adjuster.is_late();
            if is_there || after_s > 2.0 * LONGEST_S {
                break;
            }
        }
    }
    let count = ((poses.len() - 1) as f64 * whole) as usize + 1;
    let times: Vec<f64> = (0..count).map(|at| at as f64 / whole).collect();
    let mut moved = Vec::with_capacity(angles_rad.len());
    for joint in 0..angles_rad.len() {
        let mut way: Vec<DVec3> = poses.iter().map(|pose| DVec3::X * pose[joint]).collect();
        spread(&mut way, 1.0 / STEP_S, SPREAD_S);
        let series = way.iter().map(|angle| angle.x).collect();
        let spline = Spline::through(series, 1.0, End::Free, End::Free)?;
        moved.push(times.iter().map(|time| spline.sample(*time)[0]).collect());
    }
    let solver = Solver::new(of);
    let touches = |at: &usize| {
        let pose: Vec<f64> = moved.iter().map(|series: &Vec<f64>| series[*at]).collect();
        solver.touches(&pose)
    };
    let touching = (0..count).filter(touches).count();
    let at = |time: &f64| (time.round() as usize).min(poses.len() - 1);
    let when = |time: &f64| {
        let before = (*time as usize).min(poses.len() - 1);
        let after = clock[(before + 1).min(poses.len() - 1)];
        clock[before] + (after - clock[before]) * time.fract()
    };
    let stands: Vec<_> = times.iter().map(|time| feet[at(time)]).collect();
    Ok(Some(Waited {
        angles_rad: moved,
        footfalls: footfall::of_soles(&stands, rate_hz * speed),
        clock: times.iter().map(when).collect(),
        lifts: adjuster.lifts().unwrap_or_default(),
        touching_share: touching as f64 / count as f64,
    }))
}

#[cfg(test)]
mod tests;
