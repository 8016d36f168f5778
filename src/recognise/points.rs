//! What the recogniser sees of a body: eleven joints and two toes in space, and the lengths between them.
//! The joints are those of Salamah and Brunnett, "Multiphase Action Representation for Online
//! Classification of Motion Capture Data", 2016, Sec. 3; the toes are ours.

use crate::body::{End, Joint, Proportions, Segment, SegmentPose};
use glam::DVec3;

/// A point of the body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum BodyPoint {
    Root,
    Chest,
    Head,
    LeftHand,
    RightHand,
    LeftHip,
    RightHip,
    LeftKnee,
    RightKnee,
    /// The ankle: "foot" as the paper has it.
    LeftFoot,
    RightFoot,
    LeftToe,
    RightToe,
}

impl BodyPoint {
    /// All of them; the order is the index order of [`Points`].
    pub const ALL: [Self; 13] = [
        Self::Root,
        Self::Chest,
        Self::Head,
        Self::LeftHand,
        Self::RightHand,
        Self::LeftHip,
        Self::RightHip,
        Self::LeftKnee,
        Self::RightKnee,
        Self::LeftFoot,
        Self::RightFoot,
        Self::LeftToe,
        Self::RightToe,
    ];

    /// The segments that must be known for the point to be.
    const fn needs(self) -> &'static [Segment] {
        match self {
            Self::Root | Self::LeftHip | Self::RightHip => &[Segment::Pelvis],
            Self::Chest => &[Segment::Torso],
            Self::Head => &[Segment::Torso, Segment::Head],
            Self::LeftHand => &[Segment::Torso, Segment::LeftUpperArm, Segment::LeftForearm],
            Self::RightHand => &[Segment::Torso, Segment::RightUpperArm, Segment::RightForearm],
            Self::LeftKnee => &[Segment::LeftThigh],
            Self::RightKnee => &[Segment::RightThigh],
            Self::LeftFoot => &[Segment::LeftThigh, Segment::LeftShank],
            Self::RightFoot => &[Segment::RightThigh, Segment::RightShank],
            Self::LeftToe => &[Segment::LeftThigh, Segment::LeftShank, Segment::LeftFoot],
            Self::RightToe => &[Segment::RightThigh, Segment::RightShank, Segment::RightFoot],
        }
    }
}

/// Where the points are, m, Z up; a point that the source does not show is not a number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Points(pub [DVec3; 13]);

impl core::ops::Index<BodyPoint> for Points {
    type Output = DVec3;

    fn index(&self, place: BodyPoint) -> &DVec3 {
        &self.0[place as usize]
    }
}

impl core::ops::IndexMut<BodyPoint> for Points {
    fn index_mut(&mut self, place: BodyPoint) -> &mut DVec3 {
        &mut self.0[place as usize]
    }
}

impl Points {
    /// The points of a posed body; segments that are not `tracked` leave theirs unknown.
    #[must_use]
    pub fn of(body: &Proportions, pose: &SegmentPose, tracked: &[bool; 13]) -> Self {
        let at = body.positions(pose);
        let point = |place: BodyPoint| {
            if place.needs().iter().any(|segment| !tracked[segment.index()]) {
                return DVec3::NAN;
            }
            match place {
                BodyPoint::Root => at.joint_m(Joint::Pelvis),
                BodyPoint::Chest => at.joint_m(Joint::Neck),
                BodyPoint::Head => at.end_m(End::HeadTop),
                BodyPoint::LeftHand => at.joint_m(Joint::LeftWrist),
                BodyPoint::RightHand => at.joint_m(Joint::RightWrist),
                BodyPoint::LeftHip => at.joint_m(Joint::LeftHip),
                BodyPoint::RightHip => at.joint_m(Joint::RightHip),
                BodyPoint::LeftKnee => at.joint_m(Joint::LeftKnee),
                BodyPoint::RightKnee => at.joint_m(Joint::RightKnee),
                BodyPoint::LeftFoot => at.joint_m(Joint::LeftAnkle),
                BodyPoint::RightFoot => at.joint_m(Joint::RightAnkle),
                BodyPoint::LeftToe => at.end_m(End::LeftToe),
                BodyPoint::RightToe => at.end_m(End::RightToe),
            }
        };
        Self(BodyPoint::ALL.map(point))
    }
}

/// Lengths of a body, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lengths {
    /// Hip to knee.
    pub femur_m: f64,
    /// Knee to ankle.
    pub tibia_m: f64,
    /// Shoulder to wrist.
    pub arm_m: f64,
    /// Hip joint to hip joint.
    pub hips_m: f64,
}

impl Lengths {
    /// Of a body that stands in N pose.
    #[must_use]
    pub fn of(body: &Proportions) -> Self {
        let length = |joint: Joint| {
            body.joint_offset_m(joint).map_or(0.0, |(_, offset_m)| offset_m.length())
        };
        Self {
            femur_m: length(Joint::LeftKnee),
            tibia_m: length(Joint::LeftAnkle),
            arm_m: length(Joint::LeftElbow) + length(Joint::LeftWrist),
            hips_m: 2.0 * length(Joint::LeftHip),
        }
    }

    /// Thigh and shank: what motions of root, torso and feet are measured against.
    #[must_use]
    pub const fn leg_m(&self) -> f64 {
        self.femur_m + self.tibia_m
    }
}

/// The directions of a body (the paper's Sec. 3): s to the left, h up along the trunk, f forward.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axes {
    /// Forward.
    pub forward: DVec3,
    /// Up.
    pub up: DVec3,
    /// Left.
    pub left: DVec3,
}

impl Axes {
    /// Of a body's points; not numbers where hips, root or chest are unknown or fall together.
    #[must_use]
    pub fn of(points: &Points) -> Self {
        let unit = |v: DVec3| v.try_normalize().unwrap_or(DVec3::NAN);
        let left = unit(points[BodyPoint::LeftHip] - points[BodyPoint::RightHip]);
        let trunk = points[BodyPoint::Chest] - points[BodyPoint::Root];
        let up = unit(trunk - left * trunk.dot(left));
        Self { forward: left.cross(up), up, left }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::{BodyFigure, Dof, JointAngles};
    use glam::DQuat;

    #[test]
    fn a_person_who_faces_left_has_forward_there_however_it_leans() {
        let body = Proportions::of_figure(BodyFigure::DrillisContini, 1.8).expect("a body");
        let mut angles = JointAngles::default();
        angles[Dof::TorsoFlexion] = 0.3;
        let pose = angles.to_pose(DVec3::ZERO, DQuat::from_rotation_z(90f64.to_radians()));
        let axes = Axes::of(&Points::of(&body, &pose, &[true; 13]));
        assert!((axes.left - DVec3::NEG_X).length() < 1e-9, "{axes:?}");
        assert!(axes.forward.y > 0.9 && axes.forward.dot(axes.up).abs() < 1e-12, "{axes:?}");
    }

    #[test]
    fn what_a_source_does_not_show_is_not_a_number() {
        let body = Proportions::of_figure(BodyFigure::DrillisContini, 1.8).expect("a body");
        let pose = JointAngles::default().to_pose(DVec3::ZERO, DQuat::IDENTITY);
        let mut tracked = [true; 13];
        tracked[Segment::LeftShank.index()] = false;
        let points = Points::of(&body, &pose, &tracked);
        assert!(points[BodyPoint::LeftFoot].is_nan() && points[BodyPoint::LeftToe].is_nan());
        assert!(!points[BodyPoint::LeftKnee].is_nan() && !points[BodyPoint::RightFoot].is_nan());
    }
}
