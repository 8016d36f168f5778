//! Down onto a seat and up again.

use glam::DVec3;

use super::course::{Course, Stretch};
use super::posing::Poser;
use super::reach::flat;
use super::{Made, Mark, Marked};
use crate::body::{Dof, End, Joint, JointAngles, Proportions};
use crate::error::Error;

/// From a seat up to the hip joints, parts of the stature: ours.
const SEAT_TO_HIPS: f64 = 0.05;
/// Shanks lean forward by so much, rad, where a person sits: they have pulled their feet back.
const SHANK_RAD: f64 = 14.0 * core::f64::consts::PI / 180.0;
const DOWN_S: f64 = 1.7;
const STAYS_S: f64 = 0.6;
const UP_S: f64 = 1.5;
/// How far a trunk leans on the way, rad.
const LEANS_RAD: f64 = 48.0 * core::f64::consts::PI / 180.0;
/// It leans furthest at this part of the way down.
const LEANS_AT: f64 = 0.6;

pub(super) fn made(body: &Proportions, height_m: f64) -> Result<Made, Error> {
    let root_m = height_m + SEAT_TO_HIPS * body.stature_m();
    let length_m = |joint| body.joint_offset_m(joint).map_or(0.0, |(_, at_m): (_, DVec3)| -at_m.z);
    let (thigh_m, shank_m) = (length_m(Joint::LeftKnee), length_m(Joint::LeftAnkle));
    let ankle_m = -body.end_offset_m(End::LeftHeel).1.z;
    let up = (root_m - ankle_m - shank_m * SHANK_RAD.cos()) / thigh_m;
    let (_, most_rad) = Dof::LeftHipFlexion.range_rad();
    if !(most_rad.cos()..=0.97).contains(&up) {
        let least_m = most_rad.cos() * thigh_m + ankle_m + shank_m * SHANK_RAD.cos();
        let seat_m = |root_m: f64| root_m - SEAT_TO_HIPS * body.stature_m();
        return Err(Error::new("nobody sits down on a seat of this height")
            .got(format!("{height_m} m"))
            .allowed(format!(
                "{:.2} to {:.2} m",
                seat_m(least_m),
                seat_m(least_m + (0.97 - most_rad.cos()) * thigh_m)
            )));
    }
    let thigh_rad = up.acos();
    let mut seated = JointAngles::default();
    for (hip, knee) in
        [(Dof::LeftHipFlexion, Dof::LeftKneeFlexion), (Dof::RightHipFlexion, Dof::RightKneeFlexion)]
    {
        seated[hip] = thigh_rad;
        seated[knee] = thigh_rad + SHANK_RAD;
    }
    let mut seated = flat(seated);
    let (shoulders, elbows) = (
        [Dof::LeftShoulderFlexion, Dof::RightShoulderFlexion],
        [Dof::LeftElbowFlexion, Dof::RightElbowFlexion],
    );
    shoulders.into_iter().for_each(|dof| seated[dof] = 22.0_f64.to_radians());
    elbows.into_iter().for_each(|dof| seated[dof] = 58.0_f64.to_radians());
    seated[Dof::TorsoFlexion] = 4.0_f64.to_radians();
    // Legs go all the way at once; the trunk leans and straightens again on it.
    let leaning = |from: JointAngles, to: JointAngles, duration_s: f64, at: f64| {
        let turns =
            vec![(Dof::TorsoFlexion, at, LEANS_RAD), (Dof::NeckFlexion, at, -LEANS_RAD / 2.0)];
        Stretch { turns, ..Stretch::even(from, to, duration_s) }
    };
    let mut course = Course::default();
    course.then(leaning(JointAngles::default(), seated, DOWN_S, LEANS_AT));
    course.go(seated, STAYS_S);
    course.then(leaning(seated, JointAngles::default(), UP_S, 1.0 - LEANS_AT));
    let poser = Poser::of(*body);
    let root_there_m = poser.stand(&seated, None, glam::DVec2::ZERO).pose.root_m.z;
    let mark = Mark {
        of: Marked::RootHeight,
        at_s: DOWN_S + STAYS_S / 2.0,
        at_m: DVec3::Z * root_there_m.min(root_m),
    };
    let mut made = Made::of(course.motion()?, vec![mark]);
    made.seated_s = Some((0.8 * DOWN_S, DOWN_S + STAYS_S + 0.25 * UP_S));
    Ok(made)
}
