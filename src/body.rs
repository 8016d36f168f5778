//! The human body model: 13 rigid segments, 15 joints, 22 degrees of freedom.
//!
//! Anatomical frame of every segment: X forward, Y left, Z up when the person stands in N pose
//! (upright, arms down at the sides, palms inwards, feet forward). In N pose all segment
//! orientations are therefore equal; a segment's long axis is -Z for limbs, +Z for torso and head,
//! +X for feet.
//!
//! A pose can be said in two ways: as a [`SegmentPose`], an orientation per segment, or as
//! [`JointAngles`], 22 numbers plus where the pelvis is. [`Proportions`] give segments a length and
//! turn a pose into points in space.

pub mod angles;
pub mod anthropometry;
pub mod carrying;
pub mod contact;
pub mod dof;
pub mod mass;
pub mod pelvis;
pub mod proportions;
pub mod root;
pub mod stance;
pub mod worn;

mod mirror;
mod segment_names;
mod sex;

use glam::{DQuat, DVec3};

pub use angles::{AngleSeries, JointAngles, Measured, NearSingular};
pub use dof::{Dof, Joint};
pub use pelvis::PelvisAngles;
pub use proportions::{BodyFigure, End, JointPositions, Proportions};
pub use segment_names::{segment_name, segment_named};
pub use sex::Sex;

/// A rigid segment of the body.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[allow(missing_docs)]
pub enum Segment {
    Pelvis,
    Torso,
    Head,
    LeftUpperArm,
    LeftForearm,
    RightUpperArm,
    RightForearm,
    LeftThigh,
    LeftShank,
    LeftFoot,
    RightThigh,
    RightShank,
    RightFoot,
}

impl Segment {
    /// All segments; the order is the index order of [`SegmentPose::orientation`].
    pub const ALL: [Self; 13] = [
        Self::Pelvis,
        Self::Torso,
        Self::Head,
        Self::LeftUpperArm,
        Self::LeftForearm,
        Self::RightUpperArm,
        Self::RightForearm,
        Self::LeftThigh,
        Self::LeftShank,
        Self::LeftFoot,
        Self::RightThigh,
        Self::RightShank,
        Self::RightFoot,
    ];

    /// The segment that carries this one; the pelvis has none.
    #[must_use]
    pub const fn parent(self) -> Option<Self> {
        match self {
            Self::Pelvis => None,
            Self::Torso | Self::LeftThigh | Self::RightThigh => Some(Self::Pelvis),
            Self::Head | Self::LeftUpperArm | Self::RightUpperArm => Some(Self::Torso),
            Self::LeftForearm => Some(Self::LeftUpperArm),
            Self::RightForearm => Some(Self::RightUpperArm),
            Self::LeftShank => Some(Self::LeftThigh),
            Self::LeftFoot => Some(Self::LeftShank),
            Self::RightShank => Some(Self::RightThigh),
            Self::RightFoot => Some(Self::RightShank),
        }
    }

    /// Direction of the segment's long axis in its anatomical frame.
    #[must_use]
    pub const fn long_axis(self) -> DVec3 {
        match self {
            Self::Pelvis | Self::Torso | Self::Head => DVec3::Z,
            Self::LeftFoot | Self::RightFoot => DVec3::X,
            _ => DVec3::NEG_Z,
        }
    }

    /// Position in [`Segment::ALL`].
    #[must_use]
    pub const fn index(self) -> usize {
        self as usize
    }
}

/// Where the body is and how each segment is turned.
#[derive(Clone, Debug, PartialEq)]
pub struct SegmentPose {
    /// Midpoint between the hip joints, world frame, m.
    pub root_m: DVec3,
    /// Orientation of each segment's anatomical frame in the world, by [`Segment::index`].
    pub orientation: [DQuat; 13],
}

impl SegmentPose {
    /// How far the torso leans against the pelvis: the angle between their long axes, rad.
    #[must_use]
    pub fn torso_lean_rad(&self) -> f64 {
        self.long_axis(Segment::Torso).angle_between(self.long_axis(Segment::Pelvis))
    }

    /// How far the pelvis leans against the vertical, rad.
    #[must_use]
    pub fn pelvis_lean_rad(&self) -> f64 {
        self.long_axis(Segment::Pelvis).angle_between(DVec3::Z)
    }

    /// Direction of a segment's long axis in the world.
    fn long_axis(&self, segment: Segment) -> DVec3 {
        self.orientation[segment.index()] * segment.long_axis()
    }

    /// The pose on the way to another: `share` 0 is this one, 1 the other.
    #[must_use]
    pub fn towards(&self, other: &Self, share: f64) -> Self {
        Self {
            root_m: self.root_m.lerp(other.root_m, share),
            orientation: std::array::from_fn(|at| {
                self.orientation[at].slerp(other.orientation[at], share)
            }),
        }
    }
}
