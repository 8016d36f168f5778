//! Whether a robot falls whose servos give way: it is let go in the first pose of a motion, on a floor, and its joints are
//! pulled along.

use crate::retarget::base::{BasePath, StandingSole};
use crate::rigid::ground::GRAVITY_M_S2;
use crate::rigid::{Drive, Moving};
use crate::robot::RobotBody;
use glam::DVec3;

/// Length of a step, s.
const STEP_S: f64 = 0.002;
/// So long after the end it must still stand, s.
const AFTER_S: f64 = 1.0;
/// A trunk that is turned this far from where it should be is lost, rad.
const LOST_RAD: f64 = 0.7;
/// Whose weight is lower than this part of where it should be is lost.
const LOW: f64 = 0.6;

/// Servos that are soft are so many times as stiff: as with a body that weighs a fifth more, and less of a charge.
const SOFT: f64 = 0.7;

/// A motion on a floor.
#[derive(Clone, Copy, Debug)]
pub struct OnFloor<'a> {
    /// The robot.
    pub body: &'a RobotBody,
    /// What it stands on.
    pub soles: &'a [StandingSole],
    /// How its servos pull.
    pub drives: &'a [Drive],
    /// How many times as stiff as that they are.
    pub stiffness: f64,
    /// Of soles on the floor.
    pub friction: f64,
    /// Angles of its joints, rad.
    pub poses: &'a [Vec<f64>],
    /// Where its base goes if all goes well.
    pub path: &'a BasePath,
}

impl OnFloor<'_> {
    /// The same with soft servos.
    #[must_use]
    pub const fn softly(self) -> Self {
        Self { stiffness: SOFT, ..self }
    }

    /// In which pose it is lost, if in any.
    #[must_use]
    pub fn lost_at(&self) -> Option<usize> {
        let OnFloor { body, soles, drives, stiffness, friction, poses, path } = *self;
        let drive = |of: &Drive| Drive { stiffness_nm_rad: of.stiffness_nm_rad * stiffness, ..*of };
        let drives: Vec<Drive> = drives.iter().map(drive).collect();
        let (first, place) = (poses.first()?, *path.places.first()?);
        let corners =
            soles.iter().flat_map(|sole| sole.corners_m.iter().map(|at_m| (sole.link, *at_m)));
        let angles = body.angles(first);
        let mut moving =
            Moving::at_rest(&body.tree, friction, GRAVITY_M_S2, corners, place, &angles);
        let last = poses.len() - 1;
        let end_s = last as f64 / path.rate_hz + AFTER_S;
        let mut goals = angles;
        let (mut looked, mut wanted_m) = (None, 0.0);
        for step in 1..=(end_s / STEP_S) as usize {
            let along = (step as f64 * STEP_S * path.rate_hz).min(last as f64);
            let (before, share) = (along as usize, along.fract());
            let (from, to) = (&poses[before], &poses[(before + 1).min(last)]);
            for (goal, (from, to)) in goals.iter_mut().zip(from.iter().zip(to)) {
                *goal = from + (to - from) * share;
            }
            let wanted = path.places[before];
            if looked != Some(before) {
                let placed = body.tree.place(wanted, &body.angles(&poses[before]));
                wanted_m = body.tree.centre_of_mass_m(&placed).z;
                looked = Some(before);
            }
            let is_up = moving.drive(&drives, &goals, STEP_S) && {
                let is_m = body.tree.centre_of_mass_m(&moving.placed()).z;
                let turn = moving.base().turn;
                let off_rad = (turn * DVec3::Z).angle_between(wanted.turn * DVec3::Z);
                // Of its weight and not of its base, which may lie on the floor.
                off_rad < LOST_RAD && is_m > LOW * wanted_m
            };
            if !is_up {
                return Some(before);
            }
        }
        None
    }
}
