//! Whether a person stands, moves and wears sensors as was asked for.

use super::calibrate::{self, CONSISTENT, Calibration, Moved, Movement, STILL_RAD, WornSensor};
use crate::body::dof::Dof;
use crate::body::{JointAngles, Segment};
use crate::error::Error;
use core::f64::consts::{FRAC_PI_2, PI};
use glam::{DQuat, DVec3};

/// In T pose, a segment that is further than this from where it belongs is worth a look, rad.
pub const T_POSE_WARN_RAD: f64 = 8.0 * PI / 180.0;
/// In T pose, a segment that is further than this from where it belongs makes the calibration
/// useless, rad.
pub const T_POSE_FAIL_RAD: f64 = 20.0 * PI / 180.0;
/// Two ways to tell a heading that differ by more than this contradict each other, rad.
const OPPOSITE_RAD: f64 = 2.0 * PI / 3.0;
/// Sensors on neighbouring segments move alike by this much more than sensors that are strangers.
const ALIKE: f64 = 0.3;
/// Of two neighbours of a limb the one that is to turn more in a movement is turned less by this factor, and the other one by this
/// angle, rad: they are each other's.
const TURNS_LESS: f64 = 1.5;
const TURNS_FAR_RAD: f64 = 0.7;
/// A movement has begun once a segment that is to turn has turned so far, rad ...
const BEGUN_RAD: f64 = 0.35;
/// ... or its neighbour so far: where their sensors are swapped, it is the one that does.
const SURELY_RAD: f64 = 0.8;
/// Pairs of segments that mirror each other, left first.
pub const PAIRS: [[Segment; 2]; 5] = [
    [Segment::LeftUpperArm, Segment::RightUpperArm],
    [Segment::LeftForearm, Segment::RightForearm],
    [Segment::LeftThigh, Segment::RightThigh],
    [Segment::LeftShank, Segment::RightShank],
    [Segment::LeftFoot, Segment::RightFoot],
];

/// The sensor that moved most in a pose that was to be held, and by how much, rad root mean square;
/// `None` if all were still. One without a sample counts as restless without end.
#[must_use]
pub fn restless(series: &[Vec<DQuat>]) -> Option<(usize, f64)> {
    let spread = |said: &Vec<DQuat>| calibrate::mean(said).map_or(f64::INFINITY, |(_, rad)| rad);
    let spreads = series.iter().map(spread).enumerate();
    let worst = spreads.max_by(|a, b| a.1.total_cmp(&b.1))?;
    (!(worst.1 <= STILL_RAD)).then_some(worst)
}

/// How far a sensor is turned from its mean orientation in `standing`, rad.
#[must_use]
pub fn turned_rad(standing: &[DQuat], now: DQuat) -> Option<f64> {
    let (mean, _) = calibrate::mean(standing)?;
    Some(mean.angle_between(if mean.dot(now) < 0.0 { -now } else { now }))
}

/// The pose of the body in T pose: arms straight out to the sides.
#[must_use]
pub fn t_pose() -> JointAngles {
    let mut angles = JointAngles::default();
    angles[Dof::LeftShoulderAbduction] = FRAC_PI_2;
    angles[Dof::RightShoulderAbduction] = FRAC_PI_2;
    angles
}

/// By sensor: how far its segment is from where it belongs in T pose, rad. Of arms the direction
/// counts, and not how they are turned about themselves: palms may face down or forward.
///
/// # Errors
/// A sensor that moved or said nothing, lists that do not fit.
pub fn off_t_pose(
    calibration: &Calibration,
    said: &[Vec<DQuat>],
) -> Result<Vec<(Segment, f64)>, Error> {
    let wanted = t_pose().to_pose(DVec3::ZERO, DQuat::IDENTITY);
    let pairs = calibration.mounts.iter().zip(said);
    let off = |(mount, said): (&calibrate::Mount, &Vec<DQuat>)| {
        let name = format!("sensor on the {}", calibrate::words(mount.segment));
        let (mean, _) = calibrate::mean(said)
            .ok_or_else(|| Error::new("a sensor said nothing in T pose").at(name))?;
        let is = mount.segment_in_world(mean);
        let wanted = wanted.orientation[mount.segment.index()];
        let is_arm = PAIRS[..2].iter().flatten().any(|arm| *arm == mount.segment);
        let axis = mount.segment.long_axis();
        let off_rad = match is_arm {
            true => (is * axis).angle_between(wanted * axis),
            false => wanted.angle_between(if wanted.dot(is) < 0.0 { -is } else { is }),
        };
        Ok((mount.segment, off_rad))
    };
    pairs.map(off).collect()
}

/// In a movement, the segments that are to turn more than their neighbours, and these; `None` of one in which both are to turn.
const fn more_and_less(movement: Movement) -> Option<[[Segment; 2]; 2]> {
    match movement {
        Movement::SitToStand => Some([PAIRS[2], PAIRS[3]]),
        Movement::Bend => Some([PAIRS[1], PAIRS[0]]),
        Movement::Bow | Movement::RaiseArms => None,
    }
}

/// True if somebody whose segment is turned so far from N pose has begun a movement.
#[must_use]
pub fn has_begun(movement: Movement, segment: Segment, turned_rad: f64) -> bool {
    let turns = movement.turns().iter().any(|(of, _)| *of == segment);
    let is_beside = more_and_less(movement).is_some_and(|[_, less]| less.contains(&segment));
    (turns && turned_rad > BEGUN_RAD) || (is_beside && turned_rad > SURELY_RAD)
}

/// Sensors that seem to be on another segment than was said, a line each.
///
/// Arms: from N to T pose the left one turns about +X and the right one about -X; a sensor that says
/// the opposite of what its strapping or a movement says is on the other side. Limbs: where a
/// movement is not the same on both sides, such as marching, neighbouring segments of a limb move
/// together. Whoever sits down turns the thighs, and not the shanks; whoever bends the elbows the forearms, and not the upper arms.
#[must_use]
pub fn doubts(
    sensors: &[WornSensor],
    n_pose: &[Vec<DQuat>],
    t_pose: Option<&[Vec<DQuat>]>,
    moves: &[Moved],
) -> Vec<String> {
    let mut doubts = Vec::new();
    let at = |segment: Segment| sensors.iter().position(|sensor| sensor.segment == segment);
    let spread = |segment: Segment| -> Option<bool> {
        let index = at(segment)?;
        let said = (sensors[index], n_pose.get(index)?.as_slice(), t_pose?.get(index)?.as_slice());
        contradicts_t_pose(said.0, said.1, said.2, moves, index)
    };
    for [left, right] in &PAIRS[..2] {
        let name = calibrate::words(*left);
        let limb = name.trim_start_matches("left ");
        match (spread(*left), spread(*right)) {
            (Some(true), Some(true)) => doubts.push(format!(
                "the sensors of the left and the right {limb} seem to be swapped: in T pose each \
                 turns the other way"
            )),
            (Some(true), _) => doubts.push(format!(
                "the sensor of the left {limb} seems to be on the right one, or back to front"
            )),
            (_, Some(true)) => doubts.push(format!(
                "the sensor of the right {limb} seems to be on the left one, or back to front"
            )),
            _ => {}
        }
    }
    let mut upside_down = Vec::new();
    for moved in moves {
        let greatest_rad = |segment: Segment| {
            let index = at(segment)?;
            let turned = moved.orientation.get(index)?.iter();
            let turned = turned.filter_map(|now| turned_rad(n_pose.get(index)?, *now));
            turned.reduce(f64::max)
        };
        let Some([more, less]) = more_and_less(moved.movement) else { continue };
        for (more, less) in more.into_iter().zip(less) {
            let (Some(more_rad), Some(less_rad)) = (greatest_rad(more), greatest_rad(less)) else {
                continue;
            };
            if less_rad > TURNS_FAR_RAD && less_rad > TURNS_LESS * more_rad {
                upside_down.extend([more, less]);
                doubts.push(format!(
                    "the sensors of the {more} and the {less} seem to be swapped: to {} the {less} turned by {less_deg:.0} deg, the \
                     {more} by {more_deg:.0}",
                    match moved.movement {
                        Movement::SitToStand => "sit down",
                        _ => "bend the elbows",
                    },
                    more = calibrate::words(more),
                    less = calibrate::words(less),
                    more_deg = more_rad.to_degrees(),
                    less_deg = less_rad.to_degrees(),
                ));
            }
        }
    }
    for moved in moves {
        for (upper, lower) in [(PAIRS[0], PAIRS[1]), (PAIRS[2], PAIRS[3]), (PAIRS[3], PAIRS[4])] {
            // Beside a limb whose own sensors are swapped those of the other side look as if they were.
            if upper.iter().chain(&lower).any(|segment| upside_down.contains(segment)) {
                continue;
            }
            let speed = |segment: Segment| Some(speeds(moved.orientation.get(at(segment)?)?));
            let [Some(lu), Some(ru), Some(ll), Some(rl)] =
                [speed(upper[0]), speed(upper[1]), speed(lower[0]), speed(lower[1])]
            else {
                continue;
            };
            let own = alike(&lu, &ll) + alike(&ru, &rl);
            let crossed = alike(&lu, &rl) + alike(&ru, &ll);
            if crossed - own > 2.0 * ALIKE {
                doubts.push(format!(
                    "the {} moves with the {}, and the {} with the {}: two of these sensors seem to \
                     be swapped",
                    calibrate::words(upper[0]),
                    calibrate::words(lower[1]),
                    calibrate::words(upper[1]),
                    calibrate::words(lower[0])
                ));
            }
        }
    }
    doubts
}

/// True if T pose says the opposite of strapping and movements about an arm's heading; `None` if
/// one of them says nothing.
fn contradicts_t_pose(
    sensor: WornSensor,
    n_pose: &[DQuat],
    t_pose: &[DQuat],
    moves: &[Moved],
    index: usize,
) -> Option<bool> {
    let name = calibrate::words(sensor.segment);
    let (standing, spread) = (calibrate::mean(n_pose)?.0, calibrate::mean(t_pose)?.0);
    let mut unsaid = Vec::new();
    let by_t = calibrate::by_t_pose(sensor.segment, standing, spread, &name, &mut unsaid)?;
    let moved = moves.iter().filter_map(|moved| {
        Some((moved.movement, moved.orientation.get(index).map(Vec::as_slice)?))
    });
    let other = calibrate::by_movement(sensor.segment, standing, moved, &name, &mut unsaid)
        .filter(|(_, consistency)| *consistency < CONSISTENT)
        .map(|(heading, _)| heading)
        .or_else(|| calibrate::by_strapping(standing, sensor.forward?));
    Some(crate::units::wrap_rad(by_t - other?).abs() > OPPOSITE_RAD)
}

/// Angles from sample to sample.
fn speeds(said: &[DQuat]) -> Vec<f64> {
    let step = |pair: &[DQuat]| 2.0 * pair[0].dot(pair[1]).abs().min(1.0).acos();
    said.windows(2).map(step).collect()
}

/// Correlation (Pearson's) of two series; zero if one does not change.
pub(super) fn alike(one: &[f64], other: &[f64]) -> f64 {
    let count = one.len().min(other.len());
    let mean = |series: &[f64]| series[..count].iter().sum::<f64>() / count.max(1) as f64;
    let (mean_one, mean_other) = (mean(one), mean(other));
    let (mut both, mut of_one, mut of_other) = (0.0, 0.0, 0.0);
    for (a, b) in one.iter().zip(other) {
        let (a, b) = (a - mean_one, b - mean_other);
        both += a * b;
        of_one += a * a;
        of_other += b * b;
    }
    let scale = (of_one * of_other).sqrt();
    if scale > 1e-12 { both / scale } else { 0.0 }
}
