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

use crate::body::mass::notch_m;
use crate::body::proportions::proximal_joint;
use crate::body::{Joint, Proportions, Segment};
use crate::mocap::markers::{Head, PointSample};
use crate::rigid::mass::{Mass, Posed};
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

    /// What a person weighs, laid on the bones of a frame: by [`Segment::index`], in the axes of the file and m.
    /// `masses` are those of [`crate::body::mass::segment_masses`] of `body`. Segments begin at the stored joint
    /// centres. The model has no joint between pelvis and torso, nor one of the neck: its thorax begins at the
    /// notch of the breastbone, so the torso hangs there, and the head sits on the torso. `None` where a bone is
    /// missing.
    #[must_use]
    pub fn posed(
        &self,
        seen: &[Option<PointSample>],
        body: &Proportions,
        masses: &[Mass; 13],
    ) -> Option<[Posed; 13]> {
        let thorax = self.bone(seen, GaitBone::Thorax)?;
        let torso_m = thorax.origin_m - thorax.orientation * notch_m(body);
        let (_, neck_m) = body.joint_offset_m(Joint::Neck)?;
        let mut posed =
            [Posed { mass: Mass::NONE, origin_m: DVec3::ZERO, turned: DQuat::IDENTITY }; 13];
        for segment in Segment::ALL {
            let origin_m = match proximal_joint(segment) {
                Joint::Torso => torso_m,
                Joint::Neck => torso_m + thorax.orientation * neck_m,
                joint => self.joint_m(seen, joint)?,
            };
            let turned = self.orientation(seen, segment)?;
            posed[segment.index()] = Posed { mass: masses[segment.index()], origin_m, turned };
        }
        Some(posed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::JointAngles;
    use crate::body::mass::{centre_of_mass_m, segment_masses};
    use crate::mocap::markers::{MarkerFormat, MarkerPoint, PointKind};
    use crate::rigid::mass::centre_m;

    /// The four points of a bone as Plug-in Gait stores them, mm, from its axes forward, left and up: by hand from
    /// the guide's figures, which way A and L of each bone point.
    fn points(bone: GaitBone, origin_m: DVec3, end_m: DVec3, turned: DQuat) -> [DVec3; 4] {
        use GaitBone as B;
        let length_m = (end_m - origin_m).length();
        let [x, y, z] = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| turned * axis * length_m);
        let (a, l, p) = match bone {
            B::Thorax => (x, -y, -z),
            B::LeftFoot | B::RightFoot => (z, y, -x),
            B::LeftClavicle => (x, z, -y),
            B::RightClavicle => (x, -z, y),
            B::Pelvis | B::Head | B::LeftFemur | B::RightFemur | B::LeftTibia | B::RightTibia => {
                (x, y, z)
            }
            _ => (-x, -y, z),
        };
        [DVec3::ZERO, a, l, p].map(|tip| (origin_m + tip) * 1e3)
    }

    /// A body in a pose, stored as Plug-in Gait stores bones.
    fn stored(body: &Proportions, angles: &JointAngles) -> (Head, Vec<Option<PointSample>>, DVec3) {
        let root_m = DVec3::new(0.3, -0.2, body.root_height_m());
        let pose = angles.to_pose(root_m, DQuat::from_rotation_z(0.7));
        let at = body.positions(&pose);
        let turned = |segment: Segment| pose.orientation[segment.index()];
        let mut head = Head::new(MarkerFormat::C3d);
        head.unit = "mm".to_owned();
        let mut seen = Vec::new();
        for bone in GaitBone::ALL {
            use GaitBone as B;
            let segment = Segment::ALL.into_iter().find(|segment| B::of(*segment) == bone);
            let turned = turned(segment.unwrap_or(Segment::Torso));
            let up_m = |from: Joint, to: Joint| (at.joint_m(from), at.joint_m(to));
            let (origin_m, end_m) = match bone {
                B::Thorax => {
                    let notch_m = at.joint_m(Joint::Torso) + turned * notch_m(body);
                    (notch_m, notch_m + turned * DVec3::Z)
                }
                B::LeftClavicle => up_m(Joint::LeftShoulder, Joint::RightShoulder),
                B::RightClavicle => up_m(Joint::RightShoulder, Joint::LeftShoulder),
                B::LeftHumerus => up_m(Joint::LeftElbow, Joint::LeftShoulder),
                B::RightHumerus => up_m(Joint::RightElbow, Joint::RightShoulder),
                B::LeftRadius => up_m(Joint::LeftWrist, Joint::LeftElbow),
                B::RightRadius => up_m(Joint::RightWrist, Joint::RightElbow),
                B::LeftFemur => up_m(Joint::LeftKnee, Joint::LeftHip),
                B::RightFemur => up_m(Joint::RightKnee, Joint::RightHip),
                B::LeftTibia => up_m(Joint::LeftAnkle, Joint::LeftKnee),
                B::RightTibia => up_m(Joint::RightAnkle, Joint::RightKnee),
                _ => (at.joint_m(Joint::Pelvis), at.joint_m(Joint::Pelvis) + DVec3::Z),
            };
            for (letter, point) in LETTERS.into_iter().zip(points(bone, origin_m, end_m, turned)) {
                head.points.push(MarkerPoint {
                    label: format!("{}{letter}", bone.label()),
                    description: String::new(),
                    kind: PointKind::Modelled,
                    unit: String::new(),
                });
                let position = point.to_array().map(|number| number as f32);
                seen.push(Some(PointSample { position, residual: 0.0, cameras: 0 }));
            }
        }
        (head, seen, centre_of_mass_m(body, &segment_masses(body), &pose))
    }

    #[test]
    fn a_body_stored_as_bones_has_its_centre_of_mass_where_the_body_has_it() {
        let body = Proportions::of_stature(1.75).unwrap();
        let bent = JointAngles(core::array::from_fn(|dof| 0.03 * dof as f64 - 0.2));
        for angles in [JointAngles::default(), bent] {
            let (head, mut seen, expected_m) = stored(&body, &angles);
            let bones = GaitBones::of(&head, "").expect("bones");
            let posed = bones.posed(&seen, &body, &segment_masses(&body)).expect("all bones");
            let got_m = centre_m(&posed);
            assert!((got_m - expected_m).length() < 1e-6, "{got_m} {expected_m}");
            // A shank that was not seen has no place.
            let knee = head.points.iter().position(|point| point.label == "LTIA").unwrap();
            seen[knee] = None;
            assert_eq!(bones.posed(&seen, &body, &segment_masses(&body)), None);
        }
    }
}
