//! A reach of the right hand, both feet flat on the floor.
//!
//! Hips, knees and ankles go together in one proportion, so that soles stay flat all the way. Trunk, arm and legs share
//! the way there; the weight stays over the feet.

use glam::{DVec2, DVec3};

use super::course::Course;
use super::posing::{Free, Poser, Standing, free};
use super::{Made, Mark, Marked, origin_m};
use crate::action::Motion;
use crate::body::contact::Footing;
use crate::body::{Dof, End, JointAngles, Proportions};
use crate::error::Error;

/// How long the hand stays.
pub(super) const STAYS_S: f64 = 0.3;
/// Greatest speed of the hand on its way if nobody says one, m/s.
const SPEED_M_S: f64 = 1.8;
/// The way back is slower.
const BACK: f64 = 1.2;
/// Where nobody says how fast it goes slower, this many times and so often, until the zero-moment point stays over the feet.
const SLOWER: f64 = 1.2;
const SLOWER_TIMES: usize = 8;
const LOOKS_HZ: f64 = 60.0;
/// No way takes less, or more, s.
const SHORTEST_S: f64 = 0.2;
const LONGEST_S: f64 = 6.0;
/// The weight stays between these parts of the foot, from the heel.
const OVER: (f64, f64) = (0.2, 0.7);
/// Shoulder flexion, abduction, rotation and elbow with which a reach is begun to be looked for, deg.
const BEGINS_DEG: [[f64; 4]; 5] = [
    [60.0, 10.0, 0.0, 60.0],
    [20.0, 60.0, 0.0, 50.0],
    [110.0, 10.0, 0.0, 50.0],
    [60.0, -20.0, 40.0, 70.0],
    [-20.0, 20.0, 0.0, 30.0],
];

const HIPS: [Dof; 2] = [Dof::LeftHipFlexion, Dof::RightHipFlexion];
const KNEES: [Dof; 2] = [Dof::LeftKneeFlexion, Dof::RightKneeFlexion];
const ANKLES: [Dof; 2] = [Dof::LeftAnkleDorsiflexion, Dof::RightAnkleDorsiflexion];

/// Legs alike; ankles follow.
pub(super) const LEGS: [Free; 2] = [free(&HIPS, 2.0), free(&KNEES, 2.0)];

/// The angles with ankles that keep the soles flat.
pub(super) fn flat(mut angles: JointAngles) -> JointAngles {
    for side in 0..2 {
        angles[ANKLES[side]] = angles[KNEES[side]] - angles[HIPS[side]];
    }
    angles
}

/// Two places of a foot that stands, parts of its length from the heel, m ahead.
pub(super) fn base_m(standing: &Standing, from: f64, to: f64) -> (f64, f64) {
    let (heel_m, toe_m) = (standing.sole_m(2).x, standing.sole_m(3).x);
    let at_m = |part: f64| heel_m + part * (toe_m - heel_m);
    (at_m(from), at_m(to))
}

/// Pushes what ankles miss that would have to bend too far.
pub(super) fn push_ankles(angles: &JointAngles, off: &mut Vec<f64>) {
    let (lower, upper) = ANKLES[1].range_rad();
    let ankle = angles[KNEES[1]] - angles[HIPS[1]];
    off.push(((ankle - upper).max(0.0) - (lower - ankle).max(0.0)) / 0.001);
}

fn pose(poser: &Poser, target_m: DVec3) -> JointAngles {
    const ARM: [Free; 4] = [
        free(&[Dof::RightShoulderFlexion], 0.4),
        free(&[Dof::RightShoulderAbduction], 0.6),
        free(&[Dof::RightShoulderRotation], 0.8),
        free(&[Dof::RightElbowFlexion], 0.5),
    ];
    const TRUNK: [Free; 3] = [
        free(&[Dof::TorsoFlexion], 1.5),
        free(&[Dof::TorsoLateralBend], 2.0),
        free(&[Dof::TorsoAxial], 1.2),
    ];
    let all: Vec<Free> = ARM.into_iter().chain(TRUNK).chain(LEGS).collect();
    let wishes = |standing: &Standing, angles: &JointAngles, off: &mut Vec<f64>| {
        standing.push_point(End::RightFingertip, target_m, off);
        standing.push_weight(DVec2::X, base_m(standing, OVER.0, OVER.1), off);
        let feet_m = (standing.sole_m(0).y, standing.sole_m(2).y);
        standing.push_weight(DVec2::Y, (feet_m.1, feet_m.0), off);
        push_ankles(angles, off);
    };
    let mut best: Option<(f64, JointAngles)> = None;
    for begin_deg in BEGINS_DEG {
        let mut begin = JointAngles::default();
        for (free, deg) in ARM.iter().zip(begin_deg) {
            begin[free.dofs[0]] = deg.to_radians();
        }
        let anchor = (None, feet_m(poser));
        // Ankles are told by the others: wishes look at the body with them.
        let found = poser.pose(&begin, &all, anchor, |_, angles, off| {
            wishes(&poser.stand(&flat(*angles), None, anchor.1), angles, off);
        });
        let found = flat(found);
        let standing = poser.stand(&found, None, anchor.1);
        let away_m = standing.at.end_m(End::RightFingertip).distance(target_m);
        let effort: f64 = Dof::ALL.iter().map(|dof| found[*dof] * found[*dof]).sum();
        let worth = away_m / 0.001 + effort;
        if best.as_ref().is_none_or(|(least, _)| worth < *least) {
            best = Some((worth, found));
        }
    }
    best.map_or_else(JointAngles::default, |(_, angles)| angles)
}

/// Where the middle of the feet is in a body whose root stands above the origin.
pub(super) fn feet_m(poser: &Poser) -> DVec2 {
    let toe_m = poser.body.end_offset_m(End::LeftToe).1;
    let heel_m = poser.body.end_offset_m(End::LeftHeel).1;
    DVec2::new(f64::midpoint(toe_m.x, heel_m.x), 0.0)
}

/// Greatest speed of an end in a motion, m/s, in a span of time.
pub(super) fn speed_m_s(
    made: &Motion,
    body: &Proportions,
    end: End,
    (from_s, to_s): (f64, f64),
) -> Result<f64, Error> {
    const HZ: f64 = 240.0;
    let poses = made.poses(body, HZ)?;
    let at_m: Vec<DVec3> = poses.iter().map(|pose| body.positions(pose).end_m(end)).collect();
    let pairs = at_m.windows(2).enumerate();
    let within = pairs.filter(|(at, _)| (from_s..=to_s).contains(&(*at as f64 / HZ)));
    Ok(within.map(|(_, two)| two[0].distance(two[1]) * HZ).fold(0.0, f64::max))
}

/// Whether the zero-moment point stays over the soles all the time.
fn is_in_balance(body: &Proportions, motion: &Motion) -> Result<bool, Error> {
    let footing = Footing::of(body, &motion.poses(body, LOOKS_HZ)?, LOOKS_HZ)?;
    Ok(footing.margins_m().iter().flatten().all(|margin_m| *margin_m > 0.0))
}

pub(super) fn made(body: &Proportions, target_m: DVec3, speed: Option<f64>) -> Result<Made, Error> {
    let target_m = target_m + origin_m(body);
    let poser = Poser::of(*body);
    let mut there = pose(&poser, target_m);
    // The head looks where the hand goes.
    let head_m = body.stature_m() * 0.93;
    let away_m = target_m.truncate().length().max(0.2);
    let looks = ((head_m - target_m.z) / away_m).atan() - there[Dof::TorsoFlexion];
    there[Dof::NeckFlexion] = (0.6 * looks).clamp(-0.5, 0.6);
    let course = |goes_s: f64| {
        let mut course = Course::default();
        course.go(there, goes_s);
        course.go(there, STAYS_S);
        course.go(JointAngles::default(), goes_s.max(0.5) * BACK);
        course
    };
    // All degrees of freedom go together: the speed of the hand is as the time is short.
    let at_one = speed_m_s(&course(1.0).motion()?, body, End::RightFingertip, (0.0, 1.0))?;
    let asked = speed.unwrap_or(SPEED_M_S);
    let mut goes_s = (at_one / asked).clamp(SHORTEST_S, LONGEST_S);
    let mut motion = course(goes_s).motion()?;
    for _ in 0..SLOWER_TIMES {
        if speed.is_some() || is_in_balance(body, &motion)? {
            break;
        }
        goes_s = (goes_s * SLOWER).min(LONGEST_S);
        motion = course(goes_s).motion()?;
    }
    let at_s = goes_s + STAYS_S / 2.0;
    let mark = Mark { of: Marked::End(End::RightFingertip), at_s, at_m: target_m };
    Ok(Made { speed_m_s: Some(at_one / goes_s), ..Made::of(motion, vec![mark]) })
}
