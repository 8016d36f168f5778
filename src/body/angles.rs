//! Joint angles and segment orientations, both ways.
//!
//! A joint with three degrees of freedom turns intrinsically about flexion, abduction, rotation
//! (for the torso flexion, lateral bend, axial), that is about Y, then the new X, then the new Z.
//! The order is singular at 90 deg of abduction, where flexion and rotation turn about the same
//! axis and only their sum is known; T pose is such a pose. This is not the ISB convention, which
//! has other signs and turns Y-X-Y at the shoulder.

use core::f64::consts::PI;
use core::ops::{Index, IndexMut};

use glam::{DMat3, DQuat, DVec3};

use crate::body::dof::{Dof, Joint};
use crate::body::{Segment, SegmentPose};
use crate::units::wrap_rad;

mod series;

pub use series::{AngleSeries, NearSingular};

/// Nearer than this to the singular abduction, flexion and rotation are poorly determined: an error
/// of the orientation is amplified more than eleven times.
pub const SINGULAR_WITHIN_RAD: f64 = 5.0 * PI / 180.0;

/// Where flexion and rotation cannot be told apart by arithmetic.
const DEGENERATE: f64 = 1e-7;

/// The 22 angles of a pose, rad, by [`Dof`]. Where the pelvis is and how it is turned is not among
/// them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JointAngles(pub [f64; 22]);

impl Index<Dof> for JointAngles {
    type Output = f64;

    fn index(&self, dof: Dof) -> &f64 {
        &self.0[dof.index()]
    }
}

impl IndexMut<Dof> for JointAngles {
    fn index_mut(&mut self, dof: Dof) -> &mut f64 {
        &mut self.0[dof.index()]
    }
}

/// Joint angles read from segment orientations, and what they do not say.
#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    /// The angles.
    pub angles: JointAngles,
    /// Joints within [`SINGULAR_WITHIN_RAD`] of their singularity: their flexion and rotation are
    /// poorly determined, their sum or difference is not.
    pub near_singular: Vec<Joint>,
    /// By [`Segment::index`], rotation of a segment against its parent that its joint does not
    /// have, for example the turning of the forearm, rad; 0 for joints with three degrees of
    /// freedom.
    pub unmodelled_rad: [f64; 13],
}

/// A joint with three degrees of freedom: signs turn named directions into rotations about Y, X, Z.
struct Ball {
    segment: Segment,
    dofs: [Dof; 3],
    signs: [f64; 3],
}

/// A joint that turns about Y alone.
struct Hinge {
    segment: Segment,
    dof: Dof,
    sign: f64,
}

/// Rotation about Y takes +Z to +X: up leans forward (flexion of torso, neck, knee), hanging limbs
/// go back (so shoulder, elbow, hip flexion and dorsiflexion are negative). About X it takes +Y to
/// +Z: the hanging left limb goes left. About Z it takes +X to +Y: the front turns to the left.
const BALLS: [Ball; 5] = [
    Ball {
        segment: Segment::Torso,
        dofs: [Dof::TorsoFlexion, Dof::TorsoLateralBend, Dof::TorsoAxial],
        signs: [1.0, -1.0, 1.0],
    },
    Ball {
        segment: Segment::LeftUpperArm,
        dofs: [Dof::LeftShoulderFlexion, Dof::LeftShoulderAbduction, Dof::LeftShoulderRotation],
        signs: [-1.0, 1.0, -1.0],
    },
    Ball {
        segment: Segment::RightUpperArm,
        dofs: [Dof::RightShoulderFlexion, Dof::RightShoulderAbduction, Dof::RightShoulderRotation],
        signs: [-1.0, -1.0, 1.0],
    },
    Ball {
        segment: Segment::LeftThigh,
        dofs: [Dof::LeftHipFlexion, Dof::LeftHipAbduction, Dof::LeftHipRotation],
        signs: [-1.0, 1.0, -1.0],
    },
    Ball {
        segment: Segment::RightThigh,
        dofs: [Dof::RightHipFlexion, Dof::RightHipAbduction, Dof::RightHipRotation],
        signs: [-1.0, -1.0, 1.0],
    },
];

const HINGES: [Hinge; 7] = [
    Hinge { segment: Segment::Head, dof: Dof::NeckFlexion, sign: 1.0 },
    Hinge { segment: Segment::LeftForearm, dof: Dof::LeftElbowFlexion, sign: -1.0 },
    Hinge { segment: Segment::RightForearm, dof: Dof::RightElbowFlexion, sign: -1.0 },
    Hinge { segment: Segment::LeftShank, dof: Dof::LeftKneeFlexion, sign: 1.0 },
    Hinge { segment: Segment::RightShank, dof: Dof::RightKneeFlexion, sign: 1.0 },
    Hinge { segment: Segment::LeftFoot, dof: Dof::LeftAnkleDorsiflexion, sign: -1.0 },
    Hinge { segment: Segment::RightFoot, dof: Dof::RightAnkleDorsiflexion, sign: -1.0 },
];

impl JointAngles {
    /// Segment orientations of these angles with the pelvis at `root_m`, turned by
    /// `root_orientation`, both in the world.
    #[must_use]
    pub fn to_pose(&self, root_m: DVec3, root_orientation: DQuat) -> SegmentPose {
        let mut orientation = [root_orientation; 13];
        // Parents come before children in `Segment::ALL`.
        for segment in Segment::ALL {
            if let Some(parent) = segment.parent() {
                let turned = orientation[parent.index()] * self.against_parent(segment);
                orientation[segment.index()] = turned.normalize();
            }
        }
        SegmentPose { root_m, orientation }
    }

    /// How a segment is turned against its parent; the pelvis has none and is not turned.
    pub(super) fn against_parent(&self, segment: Segment) -> DQuat {
        if let Some(ball) = BALLS.iter().find(|ball| ball.segment == segment) {
            let [y, x, z] = [0, 1, 2].map(|axis| ball.signs[axis] * self[ball.dofs[axis]]);
            return DQuat::from_rotation_y(y)
                * DQuat::from_rotation_x(x)
                * DQuat::from_rotation_z(z);
        }
        let hinge = HINGES.iter().find(|hinge| hinge.segment == segment);
        hinge.map_or(DQuat::IDENTITY, |hinge| DQuat::from_rotation_y(hinge.sign * self[hinge.dof]))
    }

    /// Angles of a pose on its own. Of the two ways to say each three-angle joint, the one nearer
    /// its anatomical range is taken; in a singular pose flexion is taken as zero.
    #[must_use]
    pub fn of_pose(pose: &SegmentPose) -> Measured {
        measure(pose, None)
    }

    /// Angles of a pose that follows another: of equivalent angles those nearest `before`, without
    /// wrapping, so a series through a singularity stays continuous as far as it can.
    #[must_use]
    pub fn of_pose_after(pose: &SegmentPose, before: &Self) -> Measured {
        measure(pose, Some(before))
    }
}

fn measure(pose: &SegmentPose, before: Option<&JointAngles>) -> Measured {
    let mut found = Measured {
        angles: JointAngles::default(),
        near_singular: Vec::new(),
        unmodelled_rad: [0.0; 13],
    };
    for ball in &BALLS {
        let before = before.map(|before| ball.dofs.map(|dof| before[dof]));
        let (angles, singular) = ball.angles(relative(pose, ball.segment), before);
        for (dof, angle) in ball.dofs.into_iter().zip(angles) {
            found.angles[dof] = angle;
        }
        if singular {
            found.near_singular.push(ball.dofs[0].joint());
        }
    }
    for hinge in &HINGES {
        let (angle, left_rad) = hinge.angle(relative(pose, hinge.segment));
        found.unmodelled_rad[hinge.segment.index()] = left_rad;
        found.angles[hinge.dof] = near(angle, before.map(|before| before[hinge.dof]));
    }
    found
}

impl Ball {
    /// The three angles, and whether the joint is near its singularity.
    fn angles(&self, turned: DQuat, before: Option<[f64; 3]>) -> ([f64; 3], bool) {
        let if_unknown = before.map_or(0.0, |before| self.signs[0] * before[0]);
        let ([y, x, z], cosine) = turns(turned, if_unknown);
        let say = |turn: [f64; 3]| {
            [0, 1, 2].map(|axis| {
                let angle = self.signs[axis] * wrap_rad(turn[axis]);
                near(angle, before.map(|before| before[axis]))
            })
        };
        let (one, other) = (say([y, x, z]), say([y + PI, PI - x, z + PI]));
        let near_singular = !(cosine > SINGULAR_WITHIN_RAD.sin());
        let better = self.oddness(one, before) <= self.oddness(other, before);
        (if better { one } else { other }, near_singular)
    }

    /// The angles of turns about Y, X and Z.
    fn named(&self, turns: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|axis| self.signs[axis] * turns[axis])
    }

    /// How far three angles are from those before or, without any, from their anatomical range;
    /// among several inside their range, the smaller ones.
    fn oddness(&self, angles: [f64; 3], before: Option<[f64; 3]>) -> f64 {
        if let Some(before) = before {
            return angles.iter().zip(before).map(|(angle, before)| (angle - before).abs()).sum();
        }
        let outside = |angle: f64, dof: Dof| {
            let (lower, upper) = dof.range_rad();
            (lower - angle).max(angle - upper).max(0.0)
        };
        angles.iter().zip(self.dofs).map(|(a, dof)| 1e3 * outside(*a, dof) + a.abs()).sum()
    }
}

impl Hinge {
    /// The angle, within half a turn of zero, and the rotation that the joint does not have, rad.
    fn angle(&self, turned: DQuat) -> (f64, f64) {
        // The rotation about Y nearest to `turned` (swing-twist), and what it leaves.
        let about_y = 2.0 * turned.y.atan2(turned.w);
        let left = DQuat::from_rotation_y(-about_y) * turned;
        let left_rad = 2.0 * left.xyz().length().atan2(left.w.abs());
        (self.sign * wrap_rad(about_y), left_rad)
    }
}

/// How a segment is turned against the one that carries it.
fn relative(pose: &SegmentPose, segment: Segment) -> DQuat {
    let parent = segment.parent().map_or(0, Segment::index);
    (pose.orientation[parent].inverse() * pose.orientation[segment.index()]).normalize()
}

/// Turns about Y, the new X and the new Z that make an orientation, that about X within a quarter
/// turn, rad, and the cosine of that. Where Y and Z cannot be told apart, Y is what is given.
fn turns(turned: DQuat, y_if_unknown: f64) -> ([f64; 3], f64) {
    let matrix = DMat3::from_quat(turned);
    // R = Ry(y) Rx(x) Rz(z); `at(row, column)`.
    let at = |row: usize, column: usize| matrix.col(column)[row];
    let cosine = at(1, 0).hypot(at(1, 1));
    let x = (-at(1, 2)).atan2(cosine);
    if cosine > DEGENERATE {
        return ([at(0, 2).atan2(at(2, 2)), x, at(1, 0).atan2(at(1, 1))], cosine);
    }
    // Only y - z (x = +90 deg) or y + z (x = -90 deg) is in the matrix.
    let sum = at(0, 1).atan2(at(0, 0));
    let y = y_if_unknown;
    ([y, x, if x > 0.0 { y - sum } else { -y - sum }], cosine)
}

/// The angle equivalent to `angle` that is nearest to the one before.
fn near(angle: f64, before: Option<f64>) -> f64 {
    before.map_or(angle, |before| before + wrap_rad(angle - before))
}

#[cfg(test)]
mod tests;
