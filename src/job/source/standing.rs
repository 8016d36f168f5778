//! A motion on a robot that stands on its own feet: moved, and slowed where it must be, until it keeps its balance.

use super::Placed;
use crate::body::Proportions;
use crate::error::Error;
use crate::mocap::anatomy::Capture;
use crate::mocap::retarget::Retargeted;
use crate::motion::retime::retime;
use crate::motion::{End, Path, Spline};
use crate::retarget::Footfall;
use crate::retarget::adjust::{Adjusting, Pace, adjust, drawn_in, is_steady, pace, steady};
use crate::retarget::footfall;
use crate::retarget::toe::Toe;
use crate::robot::Robot;

/// How often the plan is made again because legs that go elsewhere need another tempo.
const ROUNDS: usize = 3;
/// A tempo that differs by less is the same.
const SAME: f64 = 0.1;

/// A motion that keeps its balance.
pub(super) struct Standing {
    /// What its feet do, pose by pose.
    pub footfalls: Vec<Footfall>,
    /// Of each pose the time of the motion as it came in, in poses; empty if it has its own pace.
    pub clock: Vec<f64>,
    /// What was done.
    pub note: String,
}

/// Moves and slows what can be done without a fall; nothing is changed if it cannot be, or need not be: `exact`
/// motions that stay well on their feet as they are.
///
/// # Errors
/// As of a path that is planned.
pub(super) fn balanced(
    robot: &Robot,
    placed: &Placed<'_>,
    capture: &Capture,
    footfalls: &[Footfall],
    speed: f64,
    retargeted: &mut Retargeted,
) -> Result<Option<Standing>, Error> {
    let rate_hz = retargeted.rate_hz;
    let lengths = Proportions::of_stature(capture.stature_m)?;
    let toes = Toe::both(&capture.poses, rate_hz, &lengths);
    let mut said = footfalls.to_vec();
    footfall::plant(&mut said, &toes, rate_hz);
    footfall::hand_over(&mut said, rate_hz);
    let tempo = |angles_rad: &[Vec<f64>]| -> Result<f64, Error> {
        let path = Path::new(robot.joint_names(), rate_hz, angles_rad.to_vec())?;
        Ok(retime(&path.stretched(1.0 / speed), &robot.limits())?.factor / speed)
    };
    let mut slower = tempo(&retargeted.positions_rad)?;
    let of = |slower: f64| placed.adjusting(rate_hz, Some(slower));
    if placed.exact
        && is_steady(
            &Adjusting { footfalls: Some(&said), ..of(slower) },
            &retargeted.positions_rad,
        )?
    {
        return Ok(None);
    }
    let mut found = None;
    for _ in 0..ROUNDS {
        let mut angles_rad = retargeted.positions_rad.clone();
        let mut times: Vec<f64> = Vec::new();
        let mut here = said.clone();
        let of = Adjusting { footfalls: Some(&said), ..of(slower) };
        match pace(&of, &angles_rad) {
            Pace::Hopeless => return Ok(None),
            Pace::Even => {}
            Pace::Slowed(asked) => {
                angles_rad = at_times(angles_rad, &asked)?;
                here = footfall::at_times(&said, &asked, rate_hz);
                times = asked;
            }
        }
        let of = Adjusting { footfalls: Some(&here), ..of };
        let told = adjust(&of, &mut angles_rad)?;
        match steady(&of, &angles_rad)? {
            Pace::Hopeless => return Ok(None),
            Pace::Even => {}
            Pace::Slowed(asked) => {
                angles_rad = at_times(angles_rad, &asked)?;
                here = footfall::at_times(&here, &asked, rate_hz);
                times = if times.is_empty() { asked } else { through(&times, &asked) };
            }
        }
        drawn_in(&placed.limits_rad, &mut angles_rad)?;
        let needed = tempo(&angles_rad)?;
        let is_same = (needed / slower - 1.0).abs() < SAME;
        slower = needed;
        found = Some((angles_rad, here, times, told));
        if is_same {
            break;
        }
    }
    let Some((angles_rad, footfalls, clock, told)) = found else { return Ok(None) };
    let furthest = told.moved_rad.iter().zip(&robot.joints);
    let furthest = furthest.max_by(|a, b| a.0.total_cmp(b.0));
    let moved = furthest.map_or_else(String::new, |(moved_rad, joint)| {
        format!("{} by up to {:.0} deg", joint.name, moved_rad.to_degrees())
    });
    let longer = clock.len() as f64 / retargeted.positions_rad[0].len().max(1) as f64;
    let note = format!(
        "moved so that the robot stands and keeps its balance: {moved}{}",
        if clock.is_empty() {
            String::new()
        } else {
            format!("; slower in parts, {longer:.2} times as long for balance alone")
        }
    );
    retargeted.positions_rad = angles_rad;
    Ok(Some(Standing { footfalls, clock, note }))
}

/// Series at other times, in samples.
fn at_times(series: Vec<Vec<f64>>, times: &[f64]) -> Result<Vec<Vec<f64>>, Error> {
    let one = |series: Vec<f64>| {
        let spline = Spline::through(series, 1.0, End::Free, End::Free)?;
        Ok(times.iter().map(|time| spline.sample(*time)[0]).collect())
    };
    series.into_iter().map(one).collect()
}

/// What a clock says at other times of its own, in samples.
pub(super) fn through(clock: &[f64], times: &[f64]) -> Vec<f64> {
    let Some(last) = clock.len().checked_sub(1) else { return times.to_vec() };
    let at = |time: &f64| {
        let along = time.clamp(0.0, last as f64);
        let before = along as usize;
        let next = clock[(before + 1).min(last)];
        clock[before] + (next - clock[before]) * along.fract()
    };
    times.iter().map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clock_of_a_clock_tells_the_time_of_the_first() {
        let first = [0.0, 0.5, 1.0, 2.0, 3.0];
        assert_eq!(through(&first, &[0.0, 1.0, 2.5, 4.0]), [0.0, 0.5, 1.5, 3.0]);
    }
}
