//! A pose that does what is asked of it: a hand or a foot somewhere, feet that stand, weight over them.
//!
//! Damped least squares (Levenberg, Marquardt) over some degrees of freedom inside their ranges, drawn a little
//! towards where they were. The pelvis is turned as it is in a motion ([`stance`]), so that what holds for the pose
//! holds when the body comes to rest in it.

use core::convert::Infallible;
use glam::{DVec2, DVec3};
use nalgebra::{DMatrix, DVector};

use super::damped;
use crate::body::mass::{centre_of_mass_m, segment_masses};
use crate::body::root::SOLES;
use crate::body::{Dof, End, JointAngles, JointPositions, Proportions, SegmentPose, stance};

/// As bad as one another: a point so far from where it is to be, m ...
const POINT_M: f64 = 0.001;
/// ... and a weight so far beyond what carries it, m.
const WEIGHT_M: f64 = 0.05;
/// How far a degree of freedom is moved to tell how the body answers, rad.
const NUDGE_RAD: f64 = 1e-5;
/// Steps at most, and what is added to how well degrees of freedom are known.
const STEPS: usize = 120;
const DAMPINGS: [f64; 7] = [1e-6, 1e-3, 0.1, 10.0, 1e3, 1e5, 1e7];
/// A step that makes it better by less than this part is the last.
const ENOUGH: f64 = 1e-9;
/// Angles stay so far inside their ranges, rad.
const INSIDE_RAD: f64 = 0.5 * core::f64::consts::PI / 180.0;

/// Left or right.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The left.
    Left,
    /// The right.
    Right,
}

impl Side {
    /// Heel and toe, as places in [`SOLES`].
    pub(super) const fn soles(self) -> [usize; 2] {
        match self {
            Self::Left => [0, 1],
            Self::Right => [2, 3],
        }
    }
}

/// Some degrees of freedom that move alike, and how strongly they are drawn to where they were.
#[derive(Clone, Copy, Debug)]
pub(super) struct Free {
    pub(super) dofs: &'static [Dof],
    pub(super) stiffness: f64,
}

/// Degrees of freedom, each for itself.
pub(super) const fn free(dofs: &'static [Dof], stiffness: f64) -> Free {
    Free { dofs, stiffness }
}

/// A body that stands with some angles.
#[derive(Clone, Debug)]
pub(super) struct Standing {
    pub(super) pose: SegmentPose,
    pub(super) at: JointPositions,
    /// Centre of mass with what is carried, over the floor, m.
    pub(super) weight_m: DVec2,
}

impl Standing {
    /// An end of a sole, as [`SOLES`] counts them.
    pub(super) fn sole_m(&self, sole: usize) -> DVec3 {
        self.at.end_m(SOLES[sole])
    }

    /// The middle of a foot's sole.
    pub(super) fn foot_m(&self, side: Side) -> DVec3 {
        let [heel, toe] = side.soles();
        (self.sole_m(heel) + self.sole_m(toe)) / 2.0
    }

    /// Pushes what a foot that stands flat on the floor and points ahead leaves to be wished.
    pub(super) fn push_flat(&self, side: Side, off: &mut Vec<f64>) {
        let [heel, toe] = side.soles();
        let along_m = self.sole_m(toe) - self.sole_m(heel);
        off.extend([along_m.z, along_m.y].map(|m| m / POINT_M));
    }

    /// Pushes how far a point is from where it is to be.
    pub(super) fn push_point(&self, end: End, at_m: DVec3, off: &mut Vec<f64>) {
        off.extend(((self.at.end_m(end) - at_m) / POINT_M).to_array());
    }

    /// Pushes how far the middle of a foot is from where it is to be.
    pub(super) fn push_foot(&self, side: Side, at_m: DVec3, off: &mut Vec<f64>) {
        off.extend(((self.foot_m(side) - at_m) / POINT_M).to_array());
    }

    /// Pushes how far a toe is from where it is to be, with its heel no lower and behind it.
    pub(super) fn push_toe(&self, side: Side, at_m: DVec3, off: &mut Vec<f64>) {
        let [heel, toe] = side.soles();
        off.extend(((self.sole_m(toe) - at_m) / POINT_M).to_array());
        let along_m = self.sole_m(toe) - self.sole_m(heel);
        off.extend([along_m.z.max(0.0), along_m.y].map(|m| m / POINT_M));
    }

    /// Pushes how far the weight lies outside a span along an axis.
    pub(super) fn push_weight(&self, axis: DVec2, (from_m, to_m): (f64, f64), off: &mut Vec<f64>) {
        let at_m = self.weight_m.dot(axis);
        off.push(((at_m - to_m).max(0.0) - (from_m - at_m).max(0.0)) / WEIGHT_M);
    }
}

/// Who poses: a body, and what it carries in its hands.
#[derive(Clone, Copy, Debug)]
pub(super) struct Poser {
    pub(super) body: Proportions,
    pub(super) load_kg: f64,
}

impl Poser {
    pub(super) const fn of(body: Proportions) -> Self {
        Self { body, load_kg: 0.0 }
    }

    /// The body with these angles, its lowest sole on the floor and the middle of one foot, or of both, at a place over the floor.
    pub(super) fn stand(
        &self,
        angles: &JointAngles,
        anchor: Option<Side>,
        at_m: DVec2,
    ) -> Standing {
        let body = &self.body;
        // One pose of one instant; without one, the body as it hangs.
        let mut pose = stance::poses(body, std::slice::from_ref(angles), 100.0)
            .pop()
            .unwrap_or_else(|| angles.to_pose(DVec3::ZERO, glam::DQuat::IDENTITY));
        let at = body.positions(&pose);
        let lowest_m = SOLES.map(|end| at.end_m(end).z).into_iter().fold(f64::MAX, f64::min);
        let soles: &[usize] = match anchor {
            Some(Side::Left) => &[0, 1],
            Some(Side::Right) => &[2, 3],
            None => &[0, 1, 2, 3],
        };
        let middle = soles.iter().map(|sole| at.end_m(SOLES[*sole])).sum::<DVec3>();
        let middle = middle.truncate() / soles.len() as f64;
        pose.root_m = (at_m - middle).extend(-lowest_m);
        let at = body.positions(&pose);
        let masses = segment_masses(body);
        let own_m = centre_of_mass_m(body, &masses, &pose).truncate();
        let hands_m = (at.end_m(End::LeftFingertip) + at.end_m(End::RightFingertip)) / 2.0;
        let weight_m = (own_m * body.mass_kg() + hands_m.truncate() * self.load_kg)
            / (body.mass_kg() + self.load_kg);
        Standing { pose, at, weight_m }
    }

    /// The angles, near those that are given, that leave least to be wished.
    pub(super) fn pose(
        &self,
        near: &JointAngles,
        free: &[Free],
        anchor: (Option<Side>, DVec2),
        wishes: impl Fn(&Standing, &JointAngles, &mut Vec<f64>),
    ) -> JointAngles {
        let laid = |x: &DVector<f64>| {
            let mut angles = *near;
            for (free, value) in free.iter().zip(x.iter()) {
                free.dofs.iter().for_each(|dof| angles[*dof] = *value);
            }
            angles
        };
        let rest = DVector::from_iterator(free.len(), free.iter().map(|of| near[of.dofs[0]]));
        let off = |x: &DVector<f64>| {
            let angles = laid(x);
            let mut off = Vec::with_capacity(32);
            wishes(&self.stand(&angles, anchor.0, anchor.1), &angles, &mut off);
            let drawn = free.iter().zip(x.iter()).zip(rest.iter());
            off.extend(drawn.map(|((free, x), rest)| (x - rest) * free.stiffness));
            DVector::from_vec(off)
        };
        let range = |free: &Free| {
            let (lower, upper) = free.dofs[0].range_rad();
            (lower + INSIDE_RAD, upper - INSIDE_RAD)
        };
        let clamp = |x: &mut DVector<f64>| {
            for (x, free) in x.iter_mut().zip(free) {
                let (lower, upper) = range(free);
                *x = x.clamp(lower, upper);
            }
        };
        let mut x = rest.clone();
        clamp(&mut x);
        let mut now = off(&x);
        for _ in 0..STEPS {
            let mut answers = DMatrix::zeros(now.len(), x.len());
            for index in 0..x.len() {
                let mut nudged = x.clone();
                nudged[index] += NUDGE_RAD;
                answers.set_column(index, &((off(&nudged) - &now) / NUDGE_RAD));
            }
            let slope = answers.transpose() * &now;
            // What is at the end of its range and would leave it stays.
            for (index, free) in free.iter().enumerate() {
                let (lower, upper) = range(free);
                let stuck = (x[index] <= lower && slope[index] > 0.0)
                    || (x[index] >= upper && slope[index] < 0.0);
                if stuck {
                    answers.column_mut(index).fill(0.0);
                }
            }
            let then = |mut next: DVector<f64>| {
                clamp(&mut next);
                let off = off(&next);
                Ok::<_, Infallible>(Some((next, off)))
            };
            let Ok(step) = damped::step(&x, (&now, &answers), &DAMPINGS, then);
            let Some(step) = step else { break };
            (x, now) = (step.at, step.off);
            if step.gained < ENOUGH {
                break;
            }
        }
        laid(&x)
    }
}
