//! The 22 degrees of freedom of the body: y0 to y21.
//!
//! The number of joints (15) and degrees of freedom (22) and the places of y3-y5 (left shoulder)
//! and y7 (left elbow) are those of Zheng et al., "Human Motion Simulation and Action Corpus",
//! 2007, Fig. 1a; the rest of the order is ours. Angles are rad, zero in N pose, positive in the
//! direction named. Rotation is positive inwards (internal), lateral bend and axial rotation to the
//! left; mirrored limbs have equal signs.

/// A joint of the body. The pelvis is the root and the wrists are rigid: they have no degree of
/// freedom.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[allow(missing_docs)]
pub enum Joint {
    Pelvis,
    Torso,
    Neck,
    LeftShoulder,
    RightShoulder,
    LeftElbow,
    RightElbow,
    LeftWrist,
    RightWrist,
    LeftHip,
    RightHip,
    LeftKnee,
    RightKnee,
    LeftAnkle,
    RightAnkle,
}

impl Joint {
    /// The joint it hangs on; the pelvis hangs on none.
    #[must_use]
    pub const fn parent(self) -> Option<Self> {
        match self {
            Self::Pelvis => None,
            Self::Torso | Self::LeftHip | Self::RightHip => Some(Self::Pelvis),
            Self::Neck | Self::LeftShoulder | Self::RightShoulder => Some(Self::Torso),
            Self::LeftElbow => Some(Self::LeftShoulder),
            Self::RightElbow => Some(Self::RightShoulder),
            Self::LeftWrist => Some(Self::LeftElbow),
            Self::RightWrist => Some(Self::RightElbow),
            Self::LeftKnee => Some(Self::LeftHip),
            Self::RightKnee => Some(Self::RightHip),
            Self::LeftAnkle => Some(Self::LeftKnee),
            Self::RightAnkle => Some(Self::RightKnee),
        }
    }

    /// Name in reports: what the names of its degrees of freedom begin with.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Pelvis => "pelvis",
            Self::Torso => "torso",
            Self::Neck => "neck",
            Self::LeftShoulder => "left_shoulder",
            Self::RightShoulder => "right_shoulder",
            Self::LeftElbow => "left_elbow",
            Self::RightElbow => "right_elbow",
            Self::LeftWrist => "left_wrist",
            Self::RightWrist => "right_wrist",
            Self::LeftHip => "left_hip",
            Self::RightHip => "right_hip",
            Self::LeftKnee => "left_knee",
            Self::RightKnee => "right_knee",
            Self::LeftAnkle => "left_ankle",
            Self::RightAnkle => "right_ankle",
        }
    }

    /// All joints; the order is the index order of joint positions.
    pub const ALL: [Self; 15] = [
        Self::Pelvis,
        Self::Torso,
        Self::Neck,
        Self::LeftShoulder,
        Self::RightShoulder,
        Self::LeftElbow,
        Self::RightElbow,
        Self::LeftWrist,
        Self::RightWrist,
        Self::LeftHip,
        Self::RightHip,
        Self::LeftKnee,
        Self::RightKnee,
        Self::LeftAnkle,
        Self::RightAnkle,
    ];

    /// Position in [`Joint::ALL`].
    #[must_use]
    pub const fn index(self) -> usize {
        self as usize
    }
}

/// A degree of freedom; the discriminant is the n of y_n.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[allow(missing_docs)]
pub enum Dof {
    TorsoFlexion,
    TorsoLateralBend,
    TorsoAxial,
    LeftShoulderFlexion,
    LeftShoulderAbduction,
    LeftShoulderRotation,
    NeckFlexion,
    LeftElbowFlexion,
    RightShoulderFlexion,
    RightShoulderAbduction,
    RightShoulderRotation,
    RightElbowFlexion,
    LeftHipFlexion,
    LeftHipAbduction,
    LeftHipRotation,
    LeftKneeFlexion,
    LeftAnkleDorsiflexion,
    RightHipFlexion,
    RightHipAbduction,
    RightHipRotation,
    RightKneeFlexion,
    RightAnkleDorsiflexion,
}

impl Dof {
    /// All degrees of freedom, y0 to y21.
    pub const ALL: [Self; 22] = [
        Self::TorsoFlexion,
        Self::TorsoLateralBend,
        Self::TorsoAxial,
        Self::LeftShoulderFlexion,
        Self::LeftShoulderAbduction,
        Self::LeftShoulderRotation,
        Self::NeckFlexion,
        Self::LeftElbowFlexion,
        Self::RightShoulderFlexion,
        Self::RightShoulderAbduction,
        Self::RightShoulderRotation,
        Self::RightElbowFlexion,
        Self::LeftHipFlexion,
        Self::LeftHipAbduction,
        Self::LeftHipRotation,
        Self::LeftKneeFlexion,
        Self::LeftAnkleDorsiflexion,
        Self::RightHipFlexion,
        Self::RightHipAbduction,
        Self::RightHipRotation,
        Self::RightKneeFlexion,
        Self::RightAnkleDorsiflexion,
    ];

    /// The n of y_n.
    #[must_use]
    pub const fn index(self) -> usize {
        self as usize
    }

    /// Name in files and reports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        TABLE[self.index()].name
    }

    /// The degree of freedom of a name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|dof| dof.name() == name)
    }

    /// The joint it belongs to.
    #[must_use]
    pub const fn joint(self) -> Joint {
        TABLE[self.index()].joint
    }

    /// Whether a foot hangs on it.
    #[must_use]
    pub const fn is_of_leg(self) -> bool {
        self.index() >= Self::LeftHipFlexion.index()
    }

    /// The same movement seen in a mirror: the degree of freedom of the other side, and the sign it
    /// takes. Limbs share signs; the torso's bend and axial rotation are to the left.
    #[must_use]
    pub const fn mirrored(self) -> (Self, f64) {
        match self {
            Self::TorsoFlexion | Self::NeckFlexion => (self, 1.0),
            Self::TorsoLateralBend | Self::TorsoAxial => (self, -1.0),
            Self::LeftShoulderFlexion => (Self::RightShoulderFlexion, 1.0),
            Self::LeftShoulderAbduction => (Self::RightShoulderAbduction, 1.0),
            Self::LeftShoulderRotation => (Self::RightShoulderRotation, 1.0),
            Self::LeftElbowFlexion => (Self::RightElbowFlexion, 1.0),
            Self::RightShoulderFlexion => (Self::LeftShoulderFlexion, 1.0),
            Self::RightShoulderAbduction => (Self::LeftShoulderAbduction, 1.0),
            Self::RightShoulderRotation => (Self::LeftShoulderRotation, 1.0),
            Self::RightElbowFlexion => (Self::LeftElbowFlexion, 1.0),
            Self::LeftHipFlexion => (Self::RightHipFlexion, 1.0),
            Self::LeftHipAbduction => (Self::RightHipAbduction, 1.0),
            Self::LeftHipRotation => (Self::RightHipRotation, 1.0),
            Self::LeftKneeFlexion => (Self::RightKneeFlexion, 1.0),
            Self::LeftAnkleDorsiflexion => (Self::RightAnkleDorsiflexion, 1.0),
            Self::RightHipFlexion => (Self::LeftHipFlexion, 1.0),
            Self::RightHipAbduction => (Self::LeftHipAbduction, 1.0),
            Self::RightHipRotation => (Self::LeftHipRotation, 1.0),
            Self::RightKneeFlexion => (Self::LeftKneeFlexion, 1.0),
            Self::RightAnkleDorsiflexion => (Self::LeftAnkleDorsiflexion, 1.0),
        }
    }

    /// Anatomical range of a healthy adult, least and greatest, rad. Nothing here enforces it.
    #[must_use]
    pub const fn range_rad(self) -> (f64, f64) {
        let row = &TABLE[self.index()];
        (row.lower_deg.to_radians(), row.upper_deg.to_radians())
    }

    /// Where the range was published.
    #[must_use]
    pub const fn range_source(self) -> &'static str {
        TABLE[self.index()].source
    }
}

/// Also in Norkin and White, "Measurement of Joint Motion", as normative values. Knee and elbow
/// include its ten degrees of hyperextension; torso is its thoracolumbar spine, neck its cervical.
const AAOS: &str = "American Academy of Orthopaedic Surgeons, Joint Motion: Method of Measuring \
                    and Recording, 1965";
/// The arm across the body; the AAOS gives abduction from the side only.
const HOPPENFELD: &str = "Hoppenfeld, Physical Examination of the Spine and Extremities, 1976";

struct Row {
    name: &'static str,
    joint: Joint,
    lower_deg: f64,
    upper_deg: f64,
    source: &'static str,
}

const fn row(
    name: &'static str,
    joint: Joint,
    lower_deg: f64,
    upper_deg: f64,
    source: &'static str,
) -> Row {
    Row { name, joint, lower_deg, upper_deg, source }
}

#[rustfmt::skip]
const TABLE: [Row; 22] = [
    row("torso_flexion", Joint::Torso, -25.0, 80.0, AAOS),
    row("torso_lateral_bend", Joint::Torso, -35.0, 35.0, AAOS),
    row("torso_axial", Joint::Torso, -45.0, 45.0, AAOS),
    row("left_shoulder_flexion", Joint::LeftShoulder, -60.0, 180.0, AAOS),
    row("left_shoulder_abduction", Joint::LeftShoulder, -45.0, 180.0, HOPPENFELD),
    row("left_shoulder_rotation", Joint::LeftShoulder, -90.0, 70.0, AAOS),
    row("neck_flexion", Joint::Neck, -45.0, 45.0, AAOS),
    row("left_elbow_flexion", Joint::LeftElbow, -10.0, 150.0, AAOS),
    row("right_shoulder_flexion", Joint::RightShoulder, -60.0, 180.0, AAOS),
    row("right_shoulder_abduction", Joint::RightShoulder, -45.0, 180.0, HOPPENFELD),
    row("right_shoulder_rotation", Joint::RightShoulder, -90.0, 70.0, AAOS),
    row("right_elbow_flexion", Joint::RightElbow, -10.0, 150.0, AAOS),
    row("left_hip_flexion", Joint::LeftHip, -30.0, 120.0, AAOS),
    row("left_hip_abduction", Joint::LeftHip, -30.0, 45.0, AAOS),
    row("left_hip_rotation", Joint::LeftHip, -45.0, 45.0, AAOS),
    row("left_knee_flexion", Joint::LeftKnee, -10.0, 135.0, AAOS),
    row("left_ankle_dorsiflexion", Joint::LeftAnkle, -50.0, 20.0, AAOS),
    row("right_hip_flexion", Joint::RightHip, -30.0, 120.0, AAOS),
    row("right_hip_abduction", Joint::RightHip, -30.0, 45.0, AAOS),
    row("right_hip_rotation", Joint::RightHip, -45.0, 45.0, AAOS),
    row("right_knee_flexion", Joint::RightKnee, -10.0, 135.0, AAOS),
    row("right_ankle_dorsiflexion", Joint::RightAnkle, -50.0, 20.0, AAOS),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_order_is_that_of_the_published_model_where_it_is_published() {
        let y = |n: usize| Dof::ALL[n].name();
        assert_eq!([y(3), y(4), y(5)].map(|name| &name[..13]), ["left_shoulder"; 3]);
        assert_eq!(y(7), "left_elbow_flexion");
        assert_eq!(
            (y(0), y(6), y(21)),
            ("torso_flexion", "neck_flexion", "right_ankle_dorsiflexion")
        );
        for (n, dof) in Dof::ALL.into_iter().enumerate() {
            assert_eq!(dof.index(), n);
            assert_eq!(Dof::named(dof.name()), Some(dof));
            assert!(dof.name().starts_with(dof.joint().name()), "{}", dof.name());
        }
        assert_eq!(Dof::named("left_knee"), None);
    }

    #[test]
    fn mirrored_limbs_have_equal_ranges_and_every_range_holds_the_n_pose() {
        for dof in Dof::ALL {
            let (lower, upper) = dof.range_rad();
            assert!(lower < 0.0 && 0.0 < upper, "{}", dof.name());
            if let Some(rest) = dof.name().strip_prefix("left_") {
                let twin = Dof::named(&format!("right_{rest}")).unwrap();
                assert_eq!(twin.range_rad(), dof.range_rad());
                assert_ne!(twin.joint(), dof.joint());
                assert_eq!(dof.mirrored(), (twin, 1.0));
                assert_eq!(twin.mirrored(), (dof, 1.0));
            }
        }
    }
}
