//! A kick of the right foot through a point ahead, at a speed there.
//!
//! From behind, all of the swinging leg goes at once, so that its foot passes through the point with the angles that were
//! found for it there, about where it is fastest, and goes on a little further. The leg that stands keeps its angles.

use glam::DVec3;

use super::course::{Course, Stretch};
use super::posing::{Free, Side, free};
use super::step::Steps;
use super::{Made, Mark, Marked, origin_m};
use crate::actionlet::Shape;
use crate::body::{Dof, End, JointAngles};
use crate::error::Error;

const LIFT_S: f64 = 0.3;
const BACK_S: f64 = 0.4;
const RETURN_S: f64 = 0.5;
const DOWN_S: f64 = 0.4;
/// The foot passes through the point after this part of the time.
const PASSES_AT: f64 = 0.68;
/// The instant at which it does is one that all usual rates look at, s.
const GRID_S: f64 = 1.0 / 30.0;
/// A kick takes no less, or more, s.
const SHORTEST_S: f64 = 0.1;
const LONGEST_S: f64 = 3.0;

const LEG: [Free; 5] = [
    free(&[Dof::RightHipFlexion], 1.0),
    free(&[Dof::RightHipAbduction], 1.0),
    free(&[Dof::RightHipRotation], 2.0),
    free(&[Dof::RightKneeFlexion], 1.5),
    free(&[Dof::RightAnkleDorsiflexion], 2.0),
];
/// Angles behind, deg.
const BEHIND_DEG: [(Dof, f64); 4] = [
    (Dof::RightHipFlexion, 0.0),
    (Dof::RightHipAbduction, 15.0),
    (Dof::RightKneeFlexion, 108.0),
    (Dof::RightAnkleDorsiflexion, 15.0),
];
/// A hip is fastest early, a knee late: so the foot keeps clear of the floor.
const HIP_PEAK: f64 = 0.35;
/// Arms and trunk go against the leg: behind, and ahead, deg.
const AGAINST_DEG: [(Dof, f64, f64); 7] = [
    (Dof::TorsoAxial, -12.0, 12.0),
    (Dof::LeftShoulderFlexion, -25.0, 40.0),
    (Dof::LeftShoulderAbduction, 30.0, 22.0),
    (Dof::LeftElbowFlexion, 20.0, 35.0),
    (Dof::RightShoulderFlexion, 25.0, -30.0),
    (Dof::RightShoulderAbduction, 15.0, 25.0),
    (Dof::RightElbowFlexion, 35.0, 20.0),
];

fn peak(dof: Dof) -> f64 {
    if dof == Dof::RightHipFlexion { HIP_PEAK } else { 0.5 }
}

/// The part of its way that a degree of freedom has gone after a part of the time.
fn progress(dof: Dof, u: f64) -> f64 {
    // Peaks are inside their range.
    Shape::half_sine(peak(dof)).unwrap_or_default().progress(u)[0]
}

/// Where what goes from behind through an angle comes to rest.
fn beyond(dof: Dof, behind_rad: f64, hits_rad: f64) -> f64 {
    behind_rad + (hits_rad - behind_rad) / progress(dof, PASSES_AT)
}

pub(super) fn made(steps: &Steps, target_m: DVec3, speed_m_s: f64) -> Result<Made, Error> {
    let poser = steps.poser();
    let body = &poser.body;
    let target_m = target_m + origin_m(body);
    let (left_m, right_m) = (steps.home_m(Side::Left), steps.home_m(Side::Right));
    let shift = steps.shift(Side::Left);
    let stands = shift.to;
    let up_m = DVec3::Z * (0.07 * body.stature_m());
    let lifted = steps.on_one(&stands, Side::Left, left_m, (right_m + up_m, true));
    let mut behind = lifted;
    for (dof, deg) in BEHIND_DEG {
        behind[dof] = deg.to_radians();
    }
    let mut near = behind;
    near[Dof::RightHipFlexion] = 0.6;
    near[Dof::RightKneeFlexion] = 0.7;
    for (dof, back_deg, ahead_deg) in AGAINST_DEG {
        behind[dof] = back_deg.to_radians();
        near[dof] = ahead_deg.to_radians();
    }
    let (anchor, toe) = ((Some(Side::Left), left_m.truncate()), End::RightToe);
    let hits = poser.pose(&near, &LEG, anchor, |standing, angles, off| {
        standing.push_point(toe, target_m, off);
        // It goes on beyond, inside its ranges: what is ahead of a straight knee cannot be gone through.
        for free in LEG {
            let dof = free.dofs[0];
            let (lower, upper) = dof.range_rad();
            let lower = if dof == Dof::RightKneeFlexion { 0.0 } else { lower };
            let goes = beyond(dof, behind[dof], angles[dof]);
            off.push(((goes - upper).max(0.0) - (lower - goes).max(0.0)) / 0.001);
        }
    });
    let ends = JointAngles(Dof::ALL.map(|dof| beyond(dof, behind[dof], hits[dof])));
    let mut kick = Stretch::even(behind, ends, 1.0);
    for dof in Dof::ALL {
        kick.timings[dof.index()].peak_at = peak(dof);
    }
    // The foot's speed is as the time is short.
    let step = 1e-4;
    let at = |u: f64| {
        let gone = |dof: Dof| behind[dof] + (ends[dof] - behind[dof]) * progress(dof, u);
        poser.stand(&JointAngles(Dof::ALL.map(gone)), anchor.0, anchor.1).at.end_m(toe)
    };
    let at_one_m_s = at(PASSES_AT + step).distance(at(PASSES_AT - step)) / (2.0 * step);
    kick.duration_s = (at_one_m_s / speed_m_s).clamp(SHORTEST_S, LONGEST_S);
    let kick_s = kick.duration_s;
    let mut course = Course::default();
    course.then(shift.clone());
    course.go(lifted, LIFT_S);
    let hit_s = course.duration_s() + BACK_S + PASSES_AT * kick_s;
    let late_s = (hit_s / GRID_S).ceil() * GRID_S - hit_s;
    course.go(behind, BACK_S + late_s);
    course.then(kick.clone());
    course.then(Stretch { duration_s: RETURN_S, ..kick.reversed() });
    course.go(lifted, BACK_S);
    course.go(stands, DOWN_S);
    course.then(shift.reversed());
    let mark = Mark { of: Marked::End(toe), at_s: hit_s + late_s, at_m: target_m };
    Ok(Made { speed_m_s: Some(at_one_m_s / kick_s), ..Made::of(course.motion()?, vec![mark]) })
}
