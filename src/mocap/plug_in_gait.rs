//! The bones that Plug-in Gait leaves in a file: segments that a laboratory's model computed from markers.
//!
//! Each bone has four points: `O`, its origin, and `A`, `L`, `P`, one bone's length from it along its three axes
//! (Vicon, "Plug-in Gait Reference Guide", chapter on the outputs of the model). Which way an axis goes differs from
//! bone to bone: A of a thigh is in front of it, A of an upper arm behind it. Here all are turned to the axes of
//! [`crate::body`]: X forward, Y left, Z up when the person stands in N pose.
//!
//! Origins and ends are joint centres: `LFEP` is the hip, `LFEO` the knee, `LTIO` the ankle, `LCLO` the shoulder,
//! `LHUO` the elbow, `LRAO` the wrist, `PELO` the middle between the hips. `LTIP` and `LRAP` are not: they stand off by
//! a fifth of the width of knee or elbow, so that bones drawn on a screen do not touch.

use crate::body::{Joint, Segment};
use crate::mocap::markers::{Head, PointSample};
use glam::{DMat3, DQuat, DVec3};

/// The letters behind a bone's name.
const LETTERS: [char; 4] = ['O', 'A', 'L', 'P'];

/// A bone of the model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[allow(missing_docs)]
pub enum GaitBone {
    Pelvis,
    Thorax,
    Head,
    LeftClavicle,
    RightClavicle,
    LeftHumerus,
    RightHumerus,
    LeftRadius,
    RightRadius,
    LeftHand,
    RightHand,
    LeftFemur,
    RightFemur,
    LeftTibia,
    RightTibia,
    LeftFoot,
    RightFoot,
}

impl GaitBone {
    /// All of them; the order is that of [`GaitBones::all`].
    pub const ALL: [Self; 17] = [
        Self::Pelvis,
        Self::Thorax,
        Self::Head,
        Self::LeftClavicle,
        Self::RightClavicle,
        Self::LeftHumerus,
        Self::RightHumerus,
        Self::LeftRadius,
        Self::RightRadius,
        Self::LeftHand,
        Self::RightHand,
        Self::LeftFemur,
        Self::RightFemur,
        Self::LeftTibia,
        Self::RightTibia,
        Self::LeftFoot,
        Self::RightFoot,
    ];

    /// What the labels of its points begin with.
    #[must_use]
    pub const fn label(self) -> &'static str {
        match self {
            Self::Pelvis => "PEL",
            Self::Thorax => "TRX",
            Self::Head => "HED",
            Self::LeftClavicle => "LCL",
            Self::RightClavicle => "RCL",
            Self::LeftHumerus => "LHU",
            Self::RightHumerus => "RHU",
            Self::LeftRadius => "LRA",
            Self::RightRadius => "RRA",
            Self::LeftHand => "LHN",
            Self::RightHand => "RHN",
            Self::LeftFemur => "LFE",
            Self::RightFemur => "RFE",
            Self::LeftTibia => "LTI",
            Self::RightTibia => "RTI",
            Self::LeftFoot => "LFO",
            Self::RightFoot => "RFO",
        }
    }

    /// The bone of a segment of the body.
    #[must_use]
    pub const fn of(segment: Segment) -> Self {
        match segment {
            Segment::Pelvis => Self::Pelvis,
            Segment::Torso => Self::Thorax,
            Segment::Head => Self::Head,
            Segment::LeftUpperArm => Self::LeftHumerus,
            Segment::LeftForearm => Self::LeftRadius,
            Segment::RightUpperArm => Self::RightHumerus,
            Segment::RightForearm => Self::RightRadius,
            Segment::LeftThigh => Self::LeftFemur,
            Segment::LeftShank => Self::LeftTibia,
            Segment::LeftFoot => Self::LeftFoot,
            Segment::RightThigh => Self::RightFemur,
            Segment::RightShank => Self::RightTibia,
            Segment::RightFoot => Self::RightFoot,
        }
    }

    /// The bone whose origin or upper end is at a joint, and true of the upper end; none for joints that the model
    /// does not have.
    #[must_use]
    const fn at(joint: Joint) -> Option<(Self, bool)> {
        match joint {
            Joint::Pelvis => Some((Self::Pelvis, false)),
            Joint::LeftShoulder => Some((Self::LeftClavicle, false)),
            Joint::RightShoulder => Some((Self::RightClavicle, false)),
            Joint::LeftElbow => Some((Self::LeftHumerus, false)),
            Joint::RightElbow => Some((Self::RightHumerus, false)),
            Joint::LeftWrist => Some((Self::LeftRadius, false)),
            Joint::RightWrist => Some((Self::RightRadius, false)),
            Joint::LeftHip => Some((Self::LeftFemur, true)),
            Joint::RightHip => Some((Self::RightFemur, true)),
            Joint::LeftKnee => Some((Self::LeftFemur, false)),
            Joint::RightKnee => Some((Self::RightFemur, false)),
            Joint::LeftAnkle => Some((Self::LeftTibia, false)),
            Joint::RightAnkle => Some((Self::RightTibia, false)),
            Joint::Torso | Joint::Neck => None,
        }
    }

    /// The axes of the body, of the bone's A, L and P.
    const fn turned(self, a: DVec3, l: DVec3, p: DVec3) -> [DVec3; 3] {
        match self {
            // P points down the trunk, L to the right.
            Self::Thorax => [a, neg(l), neg(p)],
            // A points backwards, L to the right: as arms that hang are seen from behind.
            Self::LeftHumerus
            | Self::RightHumerus
            | Self::LeftRadius
            | Self::RightRadius
            | Self::LeftHand
            | Self::RightHand => [neg(a), neg(l), p],
            // P points from the toes to the heel, A up.
            Self::LeftFoot | Self::RightFoot => [neg(p), l, a],
            // The P of a clavicle points from the shoulder inwards; the L of the left one points up.
            Self::LeftClavicle => [a, neg(p), l],
            Self::RightClavicle => [a, p, neg(l)],
            _ => [a, l, p],
        }
    }
}

const fn neg(v: DVec3) -> DVec3 {
    DVec3::new(-v.x, -v.y, -v.z)
}

/// One bone in one frame, in the axes of the file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GaitBoneFrame {
    /// The model's origin of the bone, m: the joint at its lower end, of a pelvis the middle between the hips.
    pub origin_m: DVec3,
    /// The point at the end of its own Z, m: of a thigh the hip.
    pub end_m: DVec3,
    /// From the segment's anatomical frame to the axes of the file.
    pub orientation: DQuat,
}

/// Where a file keeps the bones of one person.
#[derive(Clone, Debug, PartialEq)]
pub struct GaitBones {
    /// By the order of [`GaitBone::ALL`]: indices of the points O, A, L, P.
    points: [Option<[usize; 4]>; 17],
    metres_per_unit: f64,
}

impl GaitBones {
    /// Finds the bones of a person among the points of a file. `subject` is what labels begin with, before a colon;
    /// empty where they begin with none. `None` if there are none, or the file does not say its unit of length.
    #[must_use]
    pub fn of(head: &Head, subject: &str) -> Option<Self> {
        let index = |label: &str| {
            head.points.iter().position(|point| match point.label.rsplit_once(':') {
                Some((prefix, name)) => prefix == subject && name == label,
                None => subject.is_empty() && point.label == label,
            })
        };
        let points = GaitBone::ALL.map(|bone| {
            let [o, a, l, p] = LETTERS.map(|letter| index(&format!("{}{letter}", bone.label())));
            Some([o?, a?, l?, p?])
        });
        let metres_per_unit = head.metres_per_unit()?;
        points.iter().any(Option::is_some).then_some(Self { points, metres_per_unit })
    }

    /// A bone in a frame, whose points are `seen`; `None` if the file does not have it there.
    #[must_use]
    pub fn bone(&self, seen: &[Option<PointSample>], bone: GaitBone) -> Option<GaitBoneFrame> {
        let points = self.points[bone as usize]?;
        let mut places = [DVec3::ZERO; 4];
        for (place, at) in places.iter_mut().zip(points) {
            let sample = seen.get(at).copied().flatten()?;
            *place = DVec3::from_array(sample.position.map(f64::from)) * self.metres_per_unit;
        }
        let [origin_m, a, l, end_m] = places;
        let axis = |tip: DVec3| (tip - origin_m).try_normalize();
        let [x, y, z] = bone.turned(axis(a)?, axis(l)?, axis(end_m)?);
        // Stored in 32 bits, and by some programs in 16: what is left of Y is made square to Z.
        let y = (y - z * y.dot(z)).try_normalize()?;
        let square = DMat3::from_cols(y.cross(z), y, z);
        let is_right_handed = square.x_axis.dot(x) > 0.9;
        let orientation = DQuat::from_mat3(&square).normalize();
        is_right_handed.then_some(GaitBoneFrame { origin_m, end_m, orientation })
    }

    /// All bones of a frame.
    #[must_use]
    pub fn all(&self, seen: &[Option<PointSample>]) -> [Option<GaitBoneFrame>; 17] {
        GaitBone::ALL.map(|bone| self.bone(seen, bone))
    }

    /// Where a joint is in a frame, m; `None` for one that the model or the frame does not have.
    #[must_use]
    pub fn joint_m(&self, seen: &[Option<PointSample>], joint: Joint) -> Option<DVec3> {
        let (bone, is_end) = GaitBone::at(joint)?;
        let bone = self.bone(seen, bone)?;
        Some(if is_end { bone.end_m } else { bone.origin_m })
    }

    /// How a segment of the body is turned in a frame: from its anatomical frame to the axes of the file.
    #[must_use]
    pub fn orientation(&self, seen: &[Option<PointSample>], segment: Segment) -> Option<DQuat> {
        Some(self.bone(seen, GaitBone::of(segment))?.orientation)
    }
}
