//! Segment lengths from stature, and where the joints are in space.
//!
//! Two figures are published ([`BodyFigure`]). The drawing is that of Drillis and Contini, "Body Segment
//! Parameters", New York University, 1966, in Winter, "Biomechanics and Motor Control of Human
//! Movement", 4th ed., 2009, Fig. 4.1. Neither has a joint between pelvis and torso or a heel; those
//! two places are ours.

use glam::DVec3;

use crate::body::dof::Joint;
use crate::body::{Segment, SegmentPose, Sex};
use crate::error::Error;

/// Which published figure a body is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BodyFigure {
    /// Joint centres as de Leva gives them ("Adjustments to Zatsiorsky-Seluyanov's segment inertia
    /// parameters", Journal of Biomechanics 29, 1996, Table 4: 15 women of 1.735 m, 100 men of 1.741 m).
    /// It has no breadths and no height of the ankle. A hip joint is 8 mm and 8.6 % of the leg's length
    /// off the middle (Hara et al., "Predicting the location of the hip joint centres, impact of age
    /// group and sex", Scientific Reports 6:37707, 2016); shoulders and ankles are the drawing's.
    #[default]
    DeLeva,
    /// Drillis and Contini's drawing, whose breadths are those of the body and not of its joints.
    DrillisContini,
}

/// Lengths of a figure, parts of the stature.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Lengths {
    shank: f64,
    thigh: f64,
    /// From between the hip joints up to the shoulders.
    shoulders: f64,
    /// From there up to the joint of neck and torso.
    neck: f64,
    upper_arm: f64,
    forearm: f64,
    half_hips: f64,
    foot: f64,
}

/// Length of a leg of the figure from the front of the hip bone to the inner ankle, for its breadth at the
/// hips: 0.966 m at 1.741 m, from [`Proportions::with_leg_length_m`] turned round.
const LEG: f64 = 0.966 / 1.741;
const HAND: f64 = 0.108;
const HALF_SHOULDERS: f64 = 0.129;
const ANKLE_HEIGHT: f64 = 0.039;
/// Height of the joint between pelvis and torso (about L5/S1) above the hip joints: ours.
const PELVIS: f64 = 0.060;
/// Part of the foot's length behind the ankle: ours.
const HEEL_PART: f64 = 0.25;

impl Lengths {
    const DRAWING: Self = Self {
        shank: 0.285 - 0.039,
        thigh: 0.530 - 0.285,
        shoulders: 0.818 - 0.530,
        neck: 0.0,
        upper_arm: 0.186,
        forearm: 0.146,
        half_hips: 0.191 / 2.0,
        foot: 0.152,
    };

    fn of(figure: BodyFigure, sex: Option<Sex>) -> Self {
        if figure == BodyFigure::DrillisContini {
            return Self::DRAWING;
        }
        // Women first; m, of a stature of 1.735 and 1.741 m.
        let of = |female_m: f64, male_m: f64| Sex::of(sex, [female_m / 1.735, male_m / 1.741]);
        let shoulders = of(0.4979, 0.5155);
        Self {
            shank: of(0.4386, 0.4403),
            thigh: of(0.3685, 0.4222),
            shoulders,
            neck: of(0.6148, 0.6033) - shoulders,
            upper_arm: of(0.2751, 0.2817),
            forearm: of(0.2643, 0.2689),
            half_hips: 0.008 / 1.741 + 0.086 * LEG,
            foot: of(0.2283, 0.2581),
        }
    }
}

/// A tip of the body beyond its last joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[allow(missing_docs)]
pub enum End {
    HeadTop,
    LeftFingertip,
    RightFingertip,
    LeftHeel,
    LeftToe,
    RightHeel,
    RightToe,
}

impl End {
    /// All ends; the order is the index order of end positions.
    pub const ALL: [Self; 7] = [
        Self::HeadTop,
        Self::LeftFingertip,
        Self::RightFingertip,
        Self::LeftHeel,
        Self::LeftToe,
        Self::RightHeel,
        Self::RightToe,
    ];

    /// The segment whose tip it is.
    #[must_use]
    pub const fn segment(self) -> Segment {
        match self {
            Self::HeadTop => Segment::Head,
            Self::LeftFingertip => Segment::LeftForearm,
            Self::RightFingertip => Segment::RightForearm,
            Self::LeftHeel | Self::LeftToe => Segment::LeftFoot,
            Self::RightHeel | Self::RightToe => Segment::RightFoot,
        }
    }
}

/// A body of a certain stature.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Proportions {
    stature_m: f64,
    mass_kg: f64,
    figure: BodyFigure,
    sex: Option<Sex>,
    lengths: Lengths,
    /// Thighs and shanks as a multiple of what the stature says.
    legs: f64,
}

/// Points of a posed body in the world, m.
#[derive(Clone, Debug, PartialEq)]
pub struct JointPositions {
    /// By [`Joint::index`].
    pub joints_m: [DVec3; 15],
    /// In the order of [`End::ALL`].
    pub ends_m: [DVec3; 7],
}

impl JointPositions {
    /// Where a joint is, m.
    #[must_use]
    pub const fn joint_m(&self, joint: Joint) -> DVec3 {
        self.joints_m[joint.index()]
    }

    /// Where an end is, m.
    #[must_use]
    pub const fn end_m(&self, end: End) -> DVec3 {
        self.ends_m[end as usize]
    }
}

impl Proportions {
    /// An adult-proportioned body, as heavy as those who were measured.
    ///
    /// # Errors
    /// If the stature is not between 0.3 and 3 m.
    pub fn of_stature(stature_m: f64) -> Result<Self, Error> {
        Self::of_figure(BodyFigure::default(), stature_m)
    }

    /// The same of a figure that is not the usual one.
    ///
    /// # Errors
    /// If the stature is not between 0.3 and 3 m.
    pub fn of_figure(figure: BodyFigure, stature_m: f64) -> Result<Self, Error> {
        if !(0.3..=3.0).contains(&stature_m) {
            return Err(Error::new("a person's stature is out of range")
                .got(format!("{stature_m} m"))
                .allowed("0.3 to 3 m"));
        }
        Ok(Self {
            stature_m,
            mass_kg: Sex::usual_mass_kg(None, stature_m),
            figure,
            sex: None,
            lengths: Lengths::of(figure, None),
            legs: 1.0,
        })
    }

    /// The same stature and figure with the lengths and the mass of women, of men, or of both.
    #[must_use]
    pub fn of_sex(self, sex: Option<Sex>) -> Self {
        Self {
            mass_kg: Sex::usual_mass_kg(sex, self.stature_m),
            sex,
            lengths: Lengths::of(self.figure, sex),
            ..self
        }
    }

    /// The same body with a mass of its own, kg.
    ///
    /// # Errors
    /// If it is not between 2 and 400 kg.
    pub fn with_mass_kg(self, mass_kg: f64) -> Result<Self, Error> {
        if !(2.0..=400.0).contains(&mass_kg) {
            return Err(Error::new("a person's mass is out of range")
                .got(format!("{mass_kg} kg"))
                .allowed("2 to 400 kg"));
        }
        Ok(Self { mass_kg, ..self })
    }

    /// The same body with legs of a measured length, m: from the front of the hip bone to the inner
    /// ankle. How far below that bone the hip joint lies follows from the length (Davis et al., "A gait
    /// analysis data collection and reduction technique", Human Movement Science 10, 1991, Eqs. 2-4,
    /// without markers). The trunk stays as the stature says.
    ///
    /// # Errors
    /// If the length does not go with the stature.
    pub fn with_leg_length_m(self, length_m: f64) -> Result<Self, Error> {
        let (beta, theta) = (18.0_f64.to_radians(), 28.4_f64.to_radians());
        // How far the hip joint is below the bone: behind it 0.1288 of the length less 48.56 mm, inwards 0.115 of it
        // less 15.3 mm.
        let aside = theta.cos() * beta.cos();
        let (part, less_m) =
            (0.1288 * beta.sin() + 0.115 * aside, 0.048_56 * beta.sin() + 0.0153 * aside);
        let below_m = part * length_m - less_m;
        let usual_m = (self.lengths.thigh + self.lengths.shank) * self.stature_m;
        let legs = (length_m - below_m) / usual_m;
        let length_of_m = |legs: f64| (legs * usual_m - less_m) / (1.0 - part);
        if !(0.4..=1.6).contains(&legs) {
            return Err(Error::new("leg length and stature do not fit one person")
                .got(format!("{length_m} m of {} m", self.stature_m))
                .allowed(format!("{:.2} to {:.2} m", length_of_m(0.4), length_of_m(1.6))));
        }
        Ok(Self { legs, ..self })
    }

    /// The same figure in another size, with the mass of its square: people's mass goes with the square
    /// of their stature (Quetelet, "Sur l'homme et le développement de ses facultés", 1835).
    ///
    /// # Errors
    /// If the stature is not between 0.3 and 3 m.
    pub fn of_other_stature(&self, stature_m: f64) -> Result<Self, Error> {
        let size = stature_m / self.stature_m;
        let mass_kg = self.mass_kg * size * size;
        let checked = Self::of_figure(self.figure, stature_m)?;
        Ok(Self { stature_m: checked.stature_m, mass_kg, ..*self })
    }

    /// How unlike the lengths of another body are, the greatest of what they differ by as parts of its own: zero
    /// for one with the same bones, however heavy.
    #[must_use]
    pub fn unlike(&self, other: &Self) -> f64 {
        let sizes = |body: &Self| {
            let Lengths { shank, thigh, shoulders, neck, upper_arm, forearm, half_hips, foot } =
                body.lengths;
            let legs = [shank * body.legs, thigh * body.legs];
            let rest = [shoulders, shoulders + neck, upper_arm, forearm, half_hips, foot];
            [legs[0], legs[1], rest[0], rest[1], rest[2], rest[3], rest[4], rest[5], 1.0]
                .map(|part| part * body.stature_m)
        };
        let (own, others) = (sizes(self), sizes(other));
        own.iter().zip(others).map(|(own, other)| (own / other - 1.0).abs()).fold(0.0, f64::max)
    }

    /// A body between this one and another, at a part of the way: as it is built, in every length.
    #[must_use]
    pub fn towards(&self, other: &Self, part: f64) -> Self {
        let mix = |own: f64, other: f64| own + (other - own) * part;
        let of = |get: fn(&Lengths) -> f64| mix(get(&self.lengths), get(&other.lengths));
        Self {
            stature_m: mix(self.stature_m, other.stature_m),
            mass_kg: mix(self.mass_kg, other.mass_kg),
            lengths: Lengths {
                shank: of(|lengths| lengths.shank),
                thigh: of(|lengths| lengths.thigh),
                shoulders: of(|lengths| lengths.shoulders),
                neck: of(|lengths| lengths.neck),
                upper_arm: of(|lengths| lengths.upper_arm),
                forearm: of(|lengths| lengths.forearm),
                half_hips: of(|lengths| lengths.half_hips),
                foot: of(|lengths| lengths.foot),
            },
            legs: mix(self.legs, other.legs),
            ..*other
        }
    }

    /// Body height, m.
    #[must_use]
    pub const fn stature_m(&self) -> f64 {
        self.stature_m
    }

    /// Body mass, kg.
    #[must_use]
    pub const fn mass_kg(&self) -> f64 {
        self.mass_kg
    }

    /// Whose figures it has; both, if none.
    #[must_use]
    pub const fn sex(&self) -> Option<Sex> {
        self.sex
    }

    /// Height of the root (between the hip joints) in N pose on the ground, m.
    #[must_use]
    pub fn root_height_m(&self) -> f64 {
        ((self.lengths.thigh + self.lengths.shank) * self.legs + ANKLE_HEIGHT) * self.stature_m
    }

    /// Place of a joint in the anatomical frame of the segment that carries it: that segment, and
    /// the vector from the segment's own proximal joint, m. None for the pelvis, the root.
    #[must_use]
    pub fn joint_offset_m(&self, joint: Joint) -> Option<(Segment, DVec3)> {
        let lengths = &self.lengths;
        let trunk = lengths.shoulders - PELVIS;
        let (segment, x, y, z) = match joint {
            Joint::Pelvis => return None,
            Joint::Torso => (Segment::Pelvis, 0.0, 0.0, PELVIS),
            Joint::Neck => (Segment::Torso, 0.0, 0.0, trunk + lengths.neck),
            Joint::LeftShoulder => (Segment::Torso, 0.0, HALF_SHOULDERS, trunk),
            Joint::RightShoulder => (Segment::Torso, 0.0, -HALF_SHOULDERS, trunk),
            Joint::LeftElbow => (Segment::LeftUpperArm, 0.0, 0.0, -lengths.upper_arm),
            Joint::RightElbow => (Segment::RightUpperArm, 0.0, 0.0, -lengths.upper_arm),
            Joint::LeftWrist => (Segment::LeftForearm, 0.0, 0.0, -lengths.forearm),
            Joint::RightWrist => (Segment::RightForearm, 0.0, 0.0, -lengths.forearm),
            Joint::LeftHip => (Segment::Pelvis, 0.0, lengths.half_hips, 0.0),
            Joint::RightHip => (Segment::Pelvis, 0.0, -lengths.half_hips, 0.0),
            Joint::LeftKnee => (Segment::LeftThigh, 0.0, 0.0, -lengths.thigh * self.legs),
            Joint::RightKnee => (Segment::RightThigh, 0.0, 0.0, -lengths.thigh * self.legs),
            Joint::LeftAnkle => (Segment::LeftShank, 0.0, 0.0, -lengths.shank * self.legs),
            Joint::RightAnkle => (Segment::RightShank, 0.0, 0.0, -lengths.shank * self.legs),
        };
        Some((segment, DVec3::new(x, y, z) * self.stature_m))
    }

    /// Place of an end in the anatomical frame of its segment, from the segment's proximal joint,
    /// m.
    #[must_use]
    pub fn end_offset_m(&self, end: End) -> (Segment, DVec3) {
        let lengths = &self.lengths;
        let fingertip = DVec3::new(0.0, 0.0, -lengths.forearm - HAND);
        let heel = DVec3::new(-HEEL_PART * lengths.foot, 0.0, -ANKLE_HEIGHT);
        let toe = DVec3::new((1.0 - HEEL_PART) * lengths.foot, 0.0, -ANKLE_HEIGHT);
        // What the trunk and the legs of the stature leave.
        let legs = lengths.thigh + lengths.shank + ANKLE_HEIGHT;
        let head = 1.0 - legs - lengths.shoulders - lengths.neck;
        let offset = match end {
            End::HeadTop => DVec3::new(0.0, 0.0, head),
            End::LeftFingertip | End::RightFingertip => fingertip,
            End::LeftHeel | End::RightHeel => heel,
            End::LeftToe | End::RightToe => toe,
        };
        (end.segment(), offset * self.stature_m)
    }

    /// Forward kinematics: where the joints and ends of a posed body are.
    #[must_use]
    pub fn positions(&self, pose: &SegmentPose) -> JointPositions {
        let mut joints_m = [pose.root_m; 15];
        let place = |joints_m: &[DVec3; 15], (segment, offset): (Segment, DVec3)| {
            let proximal = joints_m[proximal_joint(segment).index()];
            proximal + pose.orientation[segment.index()] * offset
        };
        // `Joint::ALL` names every joint after the joint it hangs on.
        for joint in Joint::ALL {
            if let Some(offset) = self.joint_offset_m(joint) {
                joints_m[joint.index()] = place(&joints_m, offset);
            }
        }
        let ends_m = End::ALL.map(|end| place(&joints_m, self.end_offset_m(end)));
        JointPositions { joints_m, ends_m }
    }
}

/// The joint at which a segment begins.
#[must_use]
pub const fn proximal_joint(segment: Segment) -> Joint {
    match segment {
        Segment::Pelvis => Joint::Pelvis,
        Segment::Torso => Joint::Torso,
        Segment::Head => Joint::Neck,
        Segment::LeftUpperArm => Joint::LeftShoulder,
        Segment::RightUpperArm => Joint::RightShoulder,
        Segment::LeftForearm => Joint::LeftElbow,
        Segment::RightForearm => Joint::RightElbow,
        Segment::LeftThigh => Joint::LeftHip,
        Segment::RightThigh => Joint::RightHip,
        Segment::LeftShank => Joint::LeftKnee,
        Segment::RightShank => Joint::RightKnee,
        Segment::LeftFoot => Joint::LeftAnkle,
        Segment::RightFoot => Joint::RightAnkle,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::{Dof, JointAngles};
    use glam::DQuat;
    use proptest::prelude::*;

    fn standing(stature_m: f64) -> (Proportions, JointPositions) {
        stands(Proportions::of_stature(stature_m).unwrap())
    }

    fn stands(body: Proportions) -> (Proportions, JointPositions) {
        let root_m = DVec3::new(0.0, 0.0, body.root_height_m());
        let pose = JointAngles::default().to_pose(root_m, DQuat::IDENTITY);
        (body, body.positions(&pose))
    }

    #[test]
    fn standing_joints_have_the_heights_of_the_published_drawing() {
        let (_, at) = stands(Proportions::of_figure(BodyFigure::DrillisContini, 2.0).unwrap());
        for (joint, fraction) in [
            (Joint::LeftAnkle, 0.039),
            (Joint::RightKnee, 0.285),
            (Joint::LeftHip, 0.530),
            (Joint::RightShoulder, 0.818),
        ] {
            assert!((at.joint_m(joint).z - 2.0 * fraction).abs() < 1e-12, "{joint:?}");
        }
        assert!((at.end_m(End::HeadTop).z - 2.0).abs() < 1e-12);
        assert!((at.end_m(End::LeftHeel).z).abs() < 1e-12);
        let width = at.joint_m(Joint::LeftHip).y - at.joint_m(Joint::RightHip).y;
        assert!((width - 2.0 * 0.191).abs() < 1e-12);
        let foot = at.end_m(End::LeftToe) - at.end_m(End::LeftHeel);
        assert!((foot - DVec3::new(2.0 * 0.152, 0.0, 0.0)).length() < 1e-12);
    }

    #[test]
    fn a_man_has_the_lengths_that_were_measured_between_joint_centres() {
        let (_, at) = stands(Proportions::of_stature(1.741).unwrap().of_sex(Some(Sex::Male)));
        for (from, to, length_m) in [
            (Joint::LeftHip, Joint::LeftKnee, 0.4222),
            (Joint::LeftKnee, Joint::LeftAnkle, 0.4403),
            (Joint::Pelvis, Joint::Neck, 0.6033),
            (Joint::LeftShoulder, Joint::LeftElbow, 0.2817),
            (Joint::RightElbow, Joint::RightWrist, 0.2689),
        ] {
            let got_m = (at.joint_m(to) - at.joint_m(from)).length();
            assert!((got_m - length_m).abs() < 1e-9, "{from:?} to {to:?}: {got_m}");
        }
        let hips_m = at.joint_m(Joint::LeftHip).y - at.joint_m(Joint::RightHip).y;
        assert!((0.16..0.19).contains(&hips_m), "{hips_m}");
        assert!((at.end_m(End::HeadTop).z - 1.741).abs() < 1e-12);
        let foot_m = (at.end_m(End::LeftToe) - at.end_m(End::LeftHeel)).length();
        assert!((foot_m - 0.2581).abs() < 1e-9, "{foot_m}");
    }

    #[test]
    fn unlikely_masses_are_refused() {
        let body = Proportions::of_stature(1.75).unwrap();
        for mass_kg in [0.0, -70.0, 1.9, 401.0, f64::NAN] {
            assert!(body.with_mass_kg(mass_kg).is_err(), "{mass_kg}");
        }
        assert_eq!(body.with_mass_kg(70.0).unwrap().mass_kg(), 70.0);
    }

    /// 0.92 m: the joint lies 0.0699 m behind, and so 0.0216 + 0.0757 m below, the bone.
    #[test]
    fn measured_legs_are_as_long_as_they_were_measured() {
        let body = Proportions::of_stature(1.75).unwrap().with_leg_length_m(0.92).unwrap();
        let root_m = DVec3::new(0.0, 0.0, body.root_height_m());
        let at = body.positions(&JointAngles::default().to_pose(root_m, DQuat::IDENTITY));
        let hip_to_ankle = at.joint_m(Joint::LeftHip).z - at.joint_m(Joint::LeftAnkle).z;
        assert!((hip_to_ankle - 0.8227).abs() < 1e-4, "{hip_to_ankle}");
        assert!(at.end_m(End::RightToe).z.abs() < 1e-12, "it stands on the ground");
        let trunk = at.joint_m(Joint::Neck).z - root_m.z;
        let usual = standing(1.75).1;
        let usual = usual.joint_m(Joint::Neck).z - usual.joint_m(Joint::Pelvis).z;
        assert!((trunk - usual).abs() < 1e-12, "the trunk is the stature's");
        for length_m in [0.0, 0.3, 1.6, f64::NAN] {
            assert!(body.with_leg_length_m(length_m).is_err(), "{length_m}");
        }
    }

    #[test]
    fn a_raised_arm_reaches_forward_by_its_length() {
        let body = Proportions::of_figure(BodyFigure::DrillisContini, 1.0).unwrap();
        let mut angles = JointAngles::default();
        angles[Dof::LeftShoulderFlexion] = core::f64::consts::FRAC_PI_2;
        let at = body.positions(&angles.to_pose(DVec3::ZERO, DQuat::IDENTITY));
        let reach = at.end_m(End::LeftFingertip) - at.joint_m(Joint::LeftShoulder);
        assert!((reach - DVec3::new(0.186 + 0.146 + 0.108, 0.0, 0.0)).length() < 1e-12);
    }

    #[test]
    fn unlikely_statures_are_refused() {
        for stature_m in [0.0, -1.7, 0.29, 3.1, 175.0, f64::NAN, f64::INFINITY] {
            assert!(Proportions::of_stature(stature_m).is_err(), "{stature_m}");
        }
    }

    proptest! {
        #[test]
        fn bones_keep_their_length_in_every_pose(
            angles in prop::array::uniform22(-1.5..1.5),
            turn in -3.0..3.0,
        ) {
            let (body, still) = standing(1.75);
            let root = DQuat::from_rotation_z(turn) * DQuat::from_rotation_x(turn / 2.0);
            let moved = body.positions(&JointAngles(angles).to_pose(DVec3::ONE, root));
            for joint in Joint::ALL {
                if let Some((segment, offset)) = body.joint_offset_m(joint) {
                    let from = proximal_joint(segment);
                    let bone = moved.joint_m(joint) - moved.joint_m(from);
                    prop_assert!((bone.length() - offset.length()).abs() < 1e-12);
                    let before = still.joint_m(joint) - still.joint_m(from);
                    prop_assert!((before - offset).length() < 1e-12);
                }
            }
        }
    }
}
