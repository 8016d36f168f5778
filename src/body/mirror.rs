//! Left and right exchanged.

use super::{Segment, SegmentPose};
use glam::{DQuat, DVec3};

impl Segment {
    /// The segment on the other side; those in the middle are their own.
    #[must_use]
    pub const fn mirrored(self) -> Self {
        match self {
            Self::Pelvis | Self::Torso | Self::Head => self,
            Self::LeftUpperArm => Self::RightUpperArm,
            Self::LeftForearm => Self::RightForearm,
            Self::RightUpperArm => Self::LeftUpperArm,
            Self::RightForearm => Self::LeftForearm,
            Self::LeftThigh => Self::RightThigh,
            Self::LeftShank => Self::RightShank,
            Self::LeftFoot => Self::RightFoot,
            Self::RightThigh => Self::LeftThigh,
            Self::RightShank => Self::LeftShank,
            Self::RightFoot => Self::LeftFoot,
        }
    }
}

impl SegmentPose {
    /// The pose seen in a mirror that stands in the world's X-Z plane: Y changes sign, and what
    /// the left side did the right side does.
    #[must_use]
    pub fn mirrored(&self) -> Self {
        let DVec3 { x, y, z } = self.root_m;
        let mut orientation = self.orientation;
        for segment in Segment::ALL {
            let turned = self.orientation[segment.mirrored().index()];
            // A reflection keeps the part of a rotation about Y and reverses those about X and Z.
            orientation[segment.index()] =
                DQuat::from_xyzw(-turned.x, turned.y, -turned.z, turned.w);
        }
        Self { root_m: DVec3::new(x, -y, z), orientation }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_arm_raised_to_the_left_becomes_the_other_arm_raised_to_the_right() {
        let mut pose =
            SegmentPose { root_m: DVec3::new(1.0, 2.0, 3.0), orientation: Default::default() };
        pose.orientation[Segment::LeftUpperArm.index()] = DQuat::from_rotation_x(1.0);
        let axis = |pose: &SegmentPose, of: Segment| pose.orientation[of.index()] * of.long_axis();
        let left = axis(&pose, Segment::LeftUpperArm);
        assert!(left.y > 0.5, "the test's own arm points left: {left}");
        let mirrored = pose.mirrored();
        let right = axis(&mirrored, Segment::RightUpperArm);
        assert!((right - DVec3::new(left.x, -left.y, left.z)).length() < 1e-12);
        assert_eq!(axis(&mirrored, Segment::LeftUpperArm), DVec3::NEG_Z);
        assert_eq!(mirrored.root_m, DVec3::new(1.0, -2.0, 3.0));
        assert_eq!(mirrored.mirrored(), pose);
    }
}
