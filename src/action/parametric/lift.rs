//! Something lifted with both hands from near the floor to the waist.
//!
//! What it weighs is in the balance and in the force of the floor: the weight of body and load stays over the feet, so
//! a heavy load is lifted by a body that leans back further.

use glam::{DVec2, DVec3};

use super::course::Course;
use super::posing::{Free, Poser, Standing, free};
use super::reach::{LEGS, base_m, feet_m, flat, push_ankles};
use super::{Made, Mark, Marked, origin_m};
use crate::body::{Dof, End, JointAngles, Proportions};
use crate::error::Error;

const DOWN_S: f64 = 1.4;
const GRIPS_S: f64 = 0.4;
const UP_S: f64 = 1.8;
const HOLDS_S: f64 = 0.5;
/// Where the fingertips are below, and at the waist, parts of the stature: ahead, aside, high.
const BELOW: DVec3 = DVec3::new(0.23, 0.09, 0.09);
const WAIST: DVec3 = DVec3::new(0.22, 0.09, 0.58);
/// The weight of body and load lies over this part of the foot, from the heel.
const OVER: f64 = 0.45;
/// Most that is lifted, as a part of the body's mass.
const MOST_LOAD: f64 = 0.5;

const ARMS: [Free; 4] = [
    free(&[Dof::LeftShoulderFlexion, Dof::RightShoulderFlexion], 0.4),
    free(&[Dof::LeftShoulderAbduction, Dof::RightShoulderAbduction], 0.8),
    free(&[Dof::LeftShoulderRotation, Dof::RightShoulderRotation], 0.8),
    free(&[Dof::LeftElbowFlexion, Dof::RightElbowFlexion], 0.5),
];

fn pose(poser: &Poser, begin: &JointAngles, at_m: DVec3) -> JointAngles {
    let all: Vec<Free> =
        ARMS.into_iter().chain([free(&[Dof::TorsoFlexion], 0.7)]).chain(LEGS).collect();
    let anchor = (None, feet_m(poser));
    let found = poser.pose(begin, &all, anchor, |_, angles, off| {
        let standing: Standing = poser.stand(&flat(*angles), None, anchor.1);
        standing.push_point(End::RightFingertip, at_m, off);
        standing.push_weight(DVec2::X, base_m(&standing, OVER, OVER), off);
        push_ankles(angles, off);
    });
    flat(found)
}

pub(super) fn made(body: &Proportions, load_kg: f64) -> Result<Made, Error> {
    let most_kg = MOST_LOAD * body.mass_kg();
    if !(0.0..=most_kg).contains(&load_kg) {
        return Err(Error::new("nobody lifts a load like this")
            .got(format!("{load_kg} kg"))
            .allowed(format!("0 to {most_kg:.0} kg, half of the body's mass")));
    }
    let origin_m = origin_m(body);
    let place = |part: DVec3| part * DVec3::new(1.0, -1.0, 1.0) * body.stature_m() + origin_m;
    let mut begin = JointAngles::default();
    for (dofs, deg) in [
        (ARMS[0].dofs, 60.0_f64),
        (ARMS[3].dofs, 15.0),
        (LEGS[0].dofs, 80.0),
        (LEGS[1].dofs, 90.0),
        (&[Dof::TorsoFlexion], 40.0),
    ] {
        dofs.iter().for_each(|dof| begin[*dof] = deg.to_radians());
    }
    // Down without the load, up with it.
    let below = pose(&Poser::of(*body), &begin, place(BELOW));
    let poser = Poser { load_kg, ..Poser::of(*body) };
    let grips = pose(&poser, &below, place(BELOW));
    let mut upright = JointAngles::default();
    ARMS[0].dofs.iter().for_each(|dof| upright[*dof] = 0.3);
    ARMS[3].dofs.iter().for_each(|dof| upright[*dof] = 1.4);
    let holds = pose(&poser, &upright, place(WAIST));
    let mut course = Course::default();
    course.go(below, DOWN_S);
    course.go(grips, GRIPS_S);
    let gripped_s = course.duration_s();
    course.go(holds, UP_S);
    let at_s = course.duration_s() + HOLDS_S / 2.0;
    course.go(holds, HOLDS_S);
    let marks = vec![
        Mark { of: Marked::End(End::RightFingertip), at_s: gripped_s, at_m: place(BELOW) },
        Mark { of: Marked::End(End::RightFingertip), at_s, at_m: place(WAIST) },
    ];
    Ok(Made { load: Some((load_kg, gripped_s)), ..Made::of(course.motion()?, marks) })
}
