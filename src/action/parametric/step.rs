//! Steps of one foot and the other beside it, and weight that goes from foot to foot.
//!
//! A body shifts its weight over one foot, and stands on it while the other swings; once that is down the weight goes
//! over it. While both feet stand the stretch is settled; while one stands it carries, and nothing can slide.

use glam::{DVec2, DVec3};

use super::course::{Course, Stretch, mirrored};
use super::posing::{Free, Poser, Side, Standing, free};
use super::reach::feet_m;
use super::settle::settled;
use super::{Made, Mark, Marked, way};
use crate::body::{Dof, End, Joint, JointAngles, Proportions};
use crate::error::Error;

/// How long the weight goes over a foot, the other goes up or down, and swings.
pub(super) const SHIFT_S: f64 = 1.0;
pub(super) const LIFT_S: f64 = 0.25;
pub(super) const SWING_S: f64 = 0.45;
const ACROSS_S: f64 = 0.9;
/// A foot swings so high, parts of the stature.
const SWINGS: f64 = 0.05;
/// The weight lies so far to the inner side of the ankle that stands, parts of the stature.
const INWARD: f64 = 0.014;
/// It may go so near to the toe, or the heel, of the foot that stands: parts of the foot.
const FORWARD: f64 = 0.8;
const BACKWARD: f64 = 0.12;
/// A knee of a leg that stands is bent a little, rad.
const KNEE_RAD: f64 = 0.2;
/// Legs lean aside by about so much, rad, where a pose is begun to be looked for.
const LEANS_RAD: f64 = 0.2;
/// A leg that is lifted bends by about so much, rad.
const BENT_RAD: f64 = 0.7;
/// A step that goes less far ahead, or back, goes aside, m.
const ASIDE_M: f64 = 0.02;
/// Longest step, parts of the stature.
const LONGEST: f64 = 0.4;

const LEGS: [Free; 12] = [
    free(&[Dof::LeftHipFlexion], 1.0),
    free(&[Dof::LeftHipAbduction], 1.0),
    free(&[Dof::LeftHipRotation], 2.0),
    free(&[Dof::LeftKneeFlexion], 1.0),
    free(&[Dof::LeftAnkleDorsiflexion], 1.0),
    free(&[Dof::RightHipFlexion], 1.0),
    free(&[Dof::RightHipAbduction], 1.0),
    free(&[Dof::RightHipRotation], 2.0),
    free(&[Dof::RightKneeFlexion], 1.0),
    free(&[Dof::RightAnkleDorsiflexion], 1.0),
    free(&[Dof::TorsoLateralBend], 3.0),
    free(&[Dof::TorsoFlexion], 3.0),
];

/// What all steps of a body begin with.
#[derive(Debug)]
pub struct Steps {
    poser: Poser,
    /// The weight goes over the left foot.
    shift: Stretch,
}

impl Steps {
    /// Of a body.
    ///
    /// # Errors
    /// As of chains of actionlets.
    pub fn of(body: Proportions) -> Result<Self, Error> {
        let poser = Poser::of(body);
        let stands = JointAngles::default();
        let mut near = stands;
        // The side of the leg that is free drops: it is bent further.
        for (dof, rad) in [
            (Dof::LeftKneeFlexion, KNEE_RAD),
            (Dof::LeftHipFlexion, KNEE_RAD / 2.0),
            (Dof::LeftAnkleDorsiflexion, KNEE_RAD / 2.0),
            (Dof::LeftHipAbduction, -LEANS_RAD),
            (Dof::RightKneeFlexion, 3.0 * KNEE_RAD),
            (Dof::RightHipFlexion, 1.5 * KNEE_RAD),
            (Dof::RightAnkleDorsiflexion, 1.5 * KNEE_RAD),
            (Dof::RightHipAbduction, LEANS_RAD),
        ] {
            near[dof] = rad;
        }
        let mut steps = Self { poser, shift: Stretch::even(stands, stands, SHIFT_S) };
        let (left_m, right_m) = (steps.home_m(Side::Left), steps.home_m(Side::Right));
        let to = steps.both(&near, Side::Left, [left_m, right_m], true);
        let even = Stretch::even(stands, to, SHIFT_S);
        steps.shift = settled(&body, &even, [true; 4])?;
        Ok(steps)
    }

    /// The body.
    pub(super) const fn poser(&self) -> &Poser {
        &self.poser
    }

    /// The weight goes over a foot, of a body that stands.
    pub(super) fn shift(&self, onto: Side) -> Stretch {
        match onto {
            Side::Left => self.shift.clone(),
            Side::Right => self.shift.mirrored(),
        }
    }

    /// Where the middle of a foot is in a body that stands.
    pub(super) fn home_m(&self, side: Side) -> DVec3 {
        let hip = self.poser.body.joint_offset_m(Joint::LeftHip).map_or(0.0, |(_, at_m)| at_m.y);
        let aside_m = if side == Side::Left { hip } else { -hip };
        feet_m(&self.poser).extend(0.0).with_y(aside_m)
    }

    /// Pushes where the weight is to be over a foot that stands.
    pub(super) fn push_over(&self, standing: &Standing, side: Side, off: &mut Vec<f64>) {
        let [heel, toe] = side.soles();
        let (heel_m, toe_m) = (standing.sole_m(heel), standing.sole_m(toe));
        let along_m = toe_m.x - heel_m.x;
        let span_m = (heel_m.x + BACKWARD * along_m, heel_m.x + FORWARD * along_m);
        standing.push_weight(DVec2::X, span_m, off);
        let inward_m = INWARD * self.poser.body.stature_m();
        let middle_m = f64::midpoint(heel_m.y, toe_m.y);
        let at_m = if side == Side::Left { middle_m - inward_m } else { middle_m + inward_m };
        standing.push_weight(DVec2::Y, (at_m, at_m), off);
    }

    /// Both feet down at places, the weight over one of them; the other with all of its sole or with its toes.
    fn both(
        &self,
        near: &JointAngles,
        over: Side,
        feet_m: [DVec3; 2],
        is_flat: bool,
    ) -> JointAngles {
        let (own_m, other_m, other) = match over {
            Side::Left => (feet_m[0], feet_m[1], Side::Right),
            Side::Right => (feet_m[1], feet_m[0], Side::Left),
        };
        let toe_m = self.toe_m();
        self.poser.pose(near, &LEGS, (Some(over), own_m.truncate()), |standing, _, off| {
            standing.push_flat(over, off);
            standing.push_foot(over, own_m, off);
            self.push_over(standing, over, off);
            if is_flat {
                standing.push_flat(other, off);
                standing.push_foot(other, other_m, off);
            } else {
                standing.push_toe(other, other_m + toe_m, off);
            }
        })
    }

    /// From the middle of a foot to its toe.
    fn toe_m(&self) -> DVec3 {
        let body = &self.poser.body;
        let length_m = body.end_offset_m(End::LeftToe).1.x - body.end_offset_m(End::LeftHeel).1.x;
        DVec3::X * (length_m / 2.0)
    }

    /// On a leg that keeps its angles, the other foot somewhere: its middle, or its toe where that would be.
    pub(super) fn on_one(
        &self,
        near: &JointAngles,
        on: Side,
        own_m: DVec3,
        (other_m, is_flat): (DVec3, bool),
    ) -> JointAngles {
        let other = if on == Side::Left { Side::Right } else { Side::Left };
        let moves = |of: &Free| {
            let stands = match on {
                Side::Left => of.dofs[0].name().starts_with("left"),
                Side::Right => of.dofs[0].name().starts_with("right"),
            };
            !stands && of.dofs[0].is_of_leg()
        };
        let free: Vec<Free> = LEGS.into_iter().filter(moves).collect();
        let toe_m = self.toe_m();
        self.poser.pose(near, &free, (Some(on), own_m.truncate()), |standing, _, off| {
            if is_flat {
                standing.push_flat(other, off);
                standing.push_foot(other, other_m, off);
            } else {
                standing.push_toe(other, other_m + toe_m, off);
            }
        })
    }

    /// Steps one after the other, each a way and a length, the other foot beside it each time.
    ///
    /// # Errors
    /// A step that is too long.
    pub(super) fn made(&self, ways: &[(f64, f64)]) -> Result<Made, Error> {
        let body = &self.poser.body;
        let longest_m = LONGEST * body.stature_m();
        let mut course = Course::default();
        let mut marks = Vec::new();
        let mut gone_m = DVec3::ZERO;
        for (direction_rad, length_m) in ways {
            if !(0.02..=longest_m).contains(length_m) {
                return Err(Error::new("a step of this length is not one")
                    .got(format!("{length_m} m"))
                    .allowed(format!(
                        "0.02 to {longest_m:.2} m, which is {LONGEST} times the stature"
                    )));
            }
            let goes_m = way(*direction_rad) * *length_m;
            // The foot of that side goes first.
            let first = if goes_m.y > 1e-9 { Side::Left } else { Side::Right };
            let seen_m =
                if first == Side::Left { goes_m * DVec3::new(1.0, -1.0, 1.0) } else { goes_m };
            let stretches = self.to_the_right(seen_m)?;
            let landed = course.duration_s() + SHIFT_S + SWING_S + 2.0 * LIFT_S + ACROSS_S;
            for stretch in stretches {
                course.then(if first == Side::Left { stretch.mirrored() } else { stretch });
            }
            let home_m = self.home_m(first) + gone_m;
            marks.push(Mark { of: Marked::Foot(first), at_s: landed, at_m: home_m + goes_m });
            gone_m += goes_m;
        }
        let at_s = course.duration_s();
        let middle_m = feet_m(&self.poser).extend(0.0) + gone_m;
        marks.push(Mark { of: Marked::Feet, at_s, at_m: middle_m });
        Ok(Made::of(course.motion()?, marks))
    }

    /// A step of the right foot.
    fn to_the_right(&self, goes_m: DVec3) -> Result<Vec<Stretch>, Error> {
        let body = &self.poser.body;
        let up_m = DVec3::Z * (SWINGS * body.stature_m());
        let (left_m, right_m) = (self.home_m(Side::Left), self.home_m(Side::Right));
        let shift = self.shift(Side::Left);
        let mut course = vec![shift.clone()];
        let go = |course: &mut Vec<Stretch>, to: JointAngles, duration_s: f64| {
            let from = course.last().map_or_else(JointAngles::default, |of| of.to);
            course.push(Stretch::even(from, to, duration_s));
        };
        // Up, over and down: what is near the floor goes straight up or down.
        let there_m = right_m + goes_m;
        let lifted = self.on_one(&shift.to, Side::Left, left_m, (right_m + up_m, true));
        go(&mut course, lifted, LIFT_S);
        // A foot that comes down behind does so on its toes, and one that is left behind leaves from them.
        let (back, ahead) = (goes_m.x < -ASIDE_M, goes_m.x > ASIDE_M);
        let lands = self.both(&lifted, Side::Left, [left_m, there_m], !back);
        let over = self.on_one(&lands, Side::Left, left_m, (there_m + up_m, !back));
        go(&mut course, over, SWING_S);
        go(&mut course, lands, LIFT_S);
        let across = self.both(&lands, Side::Right, [left_m, there_m], !ahead);
        let even = Stretch::even(lands, across, ACROSS_S);
        course.push(settled(body, &even, [!ahead, true, !back, true])?);
        // What is lifted bends: looked for from there.
        let mut bent = across;
        bent[Dof::LeftHipFlexion] += BENT_RAD / 2.0;
        bent[Dof::LeftKneeFlexion] += BENT_RAD;
        let follows = self.on_one(&bent, Side::Right, there_m, (left_m + up_m, !ahead));
        go(&mut course, follows, LIFT_S);
        go(&mut course, mirrored(&lifted), SWING_S);
        go(&mut course, mirrored(&shift.to), LIFT_S);
        course.push(self.shift(Side::Right).reversed());
        Ok(course)
    }
}
