//! What the segments of a body weigh, and where.
//!
//! Masses, centres and radii of gyration: de Leva, "Adjustments to Zatsiorsky-Seluyanov's segment
//! inertia parameters", Journal of Biomechanics 29, 1996, Table 4; of 100 men and 15 women, young and
//! fit. Where the sex is not known the mean of both is taken. Our pelvis is its lower part of the
//! trunk and our torso the two others, our forearm carries the hand.

use glam::DVec3;

use crate::body::proportions::{Proportions, proximal_joint};
use crate::body::{End, Joint, Segment, SegmentPose, Sex};
use crate::rigid::mass::{Mass, Posed, centre_m};

/// A row of the table, women first: part of the body's mass; where its centre lies between its ends,
/// part of its length; radii of gyration about its axes forward, sideways and along, parts of its
/// length.
struct Row {
    mass: [f64; 2],
    centre: [f64; 2],
    x: [f64; 2],
    y: [f64; 2],
    z: [f64; 2],
}

const fn row(mass: [f64; 2], centre: [f64; 2], x: [f64; 2], y: [f64; 2], z: [f64; 2]) -> Row {
    Row { mass, centre, x, y, z }
}

// From the vertex down to the 7th cervical vertebra.
const HEAD: Row =
    row([0.0668, 0.0694], [0.4841, 0.5002], [0.271, 0.303], [0.295, 0.315], [0.261, 0.261]);
// From the notch of the breastbone down to its lower end.
const UPPER_TRUNK: Row =
    row([0.1545, 0.1596], [0.2077, 0.2999], [0.746, 0.716], [0.502, 0.454], [0.718, 0.659]);
// From there down to the navel.
const MIDDLE_TRUNK: Row =
    row([0.1465, 0.1633], [0.4512, 0.4502], [0.433, 0.482], [0.354, 0.383], [0.415, 0.468]);
// From the navel down to the middle between the hip joints.
const LOWER_TRUNK: Row =
    row([0.1247, 0.1117], [0.4920, 0.6115], [0.433, 0.615], [0.402, 0.551], [0.444, 0.587]);
// From joint to joint, as all that follow.
const UPPER_ARM: Row =
    row([0.0255, 0.0271], [0.5754, 0.5772], [0.278, 0.285], [0.260, 0.269], [0.148, 0.158]);
const FOREARM: Row =
    row([0.0138, 0.0162], [0.4559, 0.4574], [0.261, 0.276], [0.257, 0.265], [0.094, 0.121]);
// From the wrist to the knuckle of the middle finger.
const HAND: Row =
    row([0.0056, 0.0061], [0.7474, 0.7900], [0.531, 0.628], [0.454, 0.513], [0.335, 0.401]);
const THIGH: Row =
    row([0.1478, 0.1416], [0.3612, 0.4095], [0.369, 0.329], [0.364, 0.329], [0.162, 0.149]);
const SHANK: Row =
    row([0.0481, 0.0433], [0.4352, 0.4395], [0.267, 0.251], [0.263, 0.246], [0.092, 0.102]);
// From the heel to the tip of the toes; its long axis points forward.
const FOOT: Row =
    row([0.0129, 0.0137], [0.4014, 0.4415], [0.139, 0.124], [0.279, 0.245], [0.299, 0.257]);

/// Lengths of the parts of the trunk and of the hand to the knuckle, parts of the stature, women
/// (1.735 m) first, men (1.741 m) second.
const UPPER_TRUNK_LENGTH: [f64; 2] = [0.1425 / 1.735, 0.1707 / 1.741];
const MIDDLE_TRUNK_LENGTH: [f64; 2] = [0.2053 / 1.735, 0.2155 / 1.741];
const LOWER_TRUNK_LENGTH: [f64; 2] = [0.1815 / 1.735, 0.1457 / 1.741];
const HAND_LENGTH: [f64; 2] = [0.0780 / 1.735, 0.0862 / 1.741];

/// By [`Segment::index`], what each segment of a body weighs, in its anatomical frame, from its
/// proximal joint.
pub type SegmentMasses = [Mass; 13];

/// The masses of a body.
#[must_use]
pub fn segment_masses(body: &Proportions) -> SegmentMasses {
    let of = |pair: [f64; 2]| Sex::of(body.sex(), pair);
    let stature_m = body.stature_m();
    // A part whose upper or rear end lies at `from_m` and that goes on for `length_m` along an axis.
    let part = |row: &Row, from_m: DVec3, along: DVec3, length_m: f64| {
        let centre_m = from_m + along * (of(row.centre) * length_m);
        let radii = DVec3::new(of(row.x), of(row.y), of(row.z));
        Mass::of_radii(of(row.mass) * body.mass_kg(), centre_m, radii * length_m)
    };
    let joint_m = |joint| body.joint_offset_m(joint).map_or(DVec3::ZERO, |(_, at_m)| at_m);
    let down = DVec3::NEG_Z;
    let lower_m = of(LOWER_TRUNK_LENGTH) * stature_m;
    let middle_m = of(MIDDLE_TRUNK_LENGTH) * stature_m;
    let upper_m = of(UPPER_TRUNK_LENGTH) * stature_m;
    // Heights above the hip joints, then above the joint between pelvis and torso.
    let lumbar_m = joint_m(Joint::Torso).z;
    let above = |height_m: f64| DVec3::Z * (height_m - lumbar_m);
    let pelvis = part(&LOWER_TRUNK, DVec3::Z * lower_m, down, lower_m);
    let torso = part(&MIDDLE_TRUNK, above(lower_m + middle_m), down, middle_m).with(&part(
        &UPPER_TRUNK,
        notch_m(body),
        down,
        upper_m,
    ));
    let head_m = body.end_offset_m(End::HeadTop).1;
    let head = part(&HEAD, head_m, down, head_m.z);
    let limb = |row: &Row, end: Joint| part(row, DVec3::ZERO, down, -joint_m(end).z);
    let upper_arm = limb(&UPPER_ARM, Joint::LeftElbow);
    let forearm = limb(&FOREARM, Joint::LeftWrist).with(&part(
        &HAND,
        joint_m(Joint::LeftWrist),
        down,
        of(HAND_LENGTH) * stature_m,
    ));
    let (thigh, shank) = (limb(&THIGH, Joint::LeftKnee), limb(&SHANK, Joint::LeftAnkle));
    let heel_m = body.end_offset_m(End::LeftHeel).1;
    let toe_m = body.end_offset_m(End::LeftToe).1;
    // The foot's own line lies halfway up to the ankle (ours).
    let rear_m = DVec3::new(heel_m.x, 0.0, heel_m.z / 2.0);
    let foot = part(&FOOT, rear_m, DVec3::X, toe_m.x - heel_m.x);
    Segment::ALL.map(|segment| match segment {
        Segment::Pelvis => pelvis,
        Segment::Torso => torso,
        Segment::Head => head,
        Segment::LeftUpperArm | Segment::RightUpperArm => upper_arm,
        Segment::LeftForearm | Segment::RightForearm => forearm,
        Segment::LeftThigh | Segment::RightThigh => thigh,
        Segment::LeftShank | Segment::RightShank => shank,
        Segment::LeftFoot | Segment::RightFoot => foot,
    })
}

/// Where the trunk of the table ends in front, the notch of the breastbone: in the frame of the torso, from
/// its joint with the pelvis, m. The table says how high it is, not how far in front.
#[must_use]
pub fn notch_m(body: &Proportions) -> DVec3 {
    let of = |pair: [f64; 2]| Sex::of(body.sex(), pair);
    let lengths = [LOWER_TRUNK_LENGTH, MIDDLE_TRUNK_LENGTH, UPPER_TRUNK_LENGTH];
    let above_hips_m = lengths.into_iter().map(of).sum::<f64>() * body.stature_m();
    let lumbar_m = body.joint_offset_m(Joint::Torso).map_or(0.0, |(_, at_m)| at_m.z);
    DVec3::Z * (above_hips_m - lumbar_m)
}

/// The segments of a posed body with their masses, by [`Segment::index`].
#[must_use]
pub fn posed(body: &Proportions, masses: &SegmentMasses, pose: &SegmentPose) -> [Posed; 13] {
    let at = body.positions(pose);
    Segment::ALL.map(|segment| Posed {
        mass: masses[segment.index()],
        origin_m: at.joint_m(proximal_joint(segment)),
        turned: pose.orientation[segment.index()],
    })
}

/// Where the centre of mass of a posed body is, m.
#[must_use]
pub fn centre_of_mass_m(body: &Proportions, masses: &SegmentMasses, pose: &SegmentPose) -> DVec3 {
    centre_m(&posed(body, masses, pose))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::JointAngles;
    use glam::DQuat;

    fn standing(sex: Option<Sex>) -> (Proportions, f64) {
        let body = Proportions::of_stature(1.75).unwrap().of_sex(sex);
        let root_m = DVec3::new(0.0, 0.0, body.root_height_m());
        let pose = JointAngles::default().to_pose(root_m, DQuat::IDENTITY);
        (body, centre_of_mass_m(&body, &segment_masses(&body), &pose).z)
    }

    #[test]
    fn the_segments_weigh_what_the_body_weighs() {
        for sex in [None, Some(Sex::Female), Some(Sex::Male)] {
            let (body, _) = standing(sex);
            let total_kg: f64 = segment_masses(&body).iter().map(|mass| mass.mass_kg).sum();
            // The table's parts of the mass add up to 0.9999 and 1.0000.
            assert!((total_kg / body.mass_kg() - 1.0).abs() < 5e-4, "{total_kg}");
        }
    }

    /// Standing men have it at 56 %, women at 55 % of the stature, with a scatter of 1 % (Hay, "The
    /// Biomechanics of Sports Techniques", 4th ed., 1993, after Palmer and others).
    #[test]
    fn a_standing_body_has_its_centre_of_mass_where_people_have_it() {
        for (sex, expected) in [(Sex::Male, 0.56), (Sex::Female, 0.55)] {
            let (body, height_m) = standing(Some(sex));
            let share = height_m / body.stature_m();
            assert!((share - expected).abs() < 0.02, "{sex:?}: {share}");
        }
    }

    /// The three parts of the trunk of a man of 1.741 m are 0.1707, 0.2155 and 0.1457 m long.
    #[test]
    fn the_notch_of_the_breastbone_is_as_high_above_the_hips_as_the_trunk_is_long() {
        let body = Proportions::of_stature(1.741).unwrap().of_sex(Some(Sex::Male));
        let (_, lumbar_m) = body.joint_offset_m(Joint::Torso).unwrap();
        let height_m = (lumbar_m + notch_m(&body)).z;
        assert!((height_m - (0.1707 + 0.2155 + 0.1457)).abs() < 1e-12, "{height_m}");
    }

    #[test]
    fn a_raised_arm_raises_the_centre_of_mass_by_its_share() {
        let body = Proportions::of_stature(1.75).unwrap();
        let masses = segment_masses(&body);
        let pose = |flexion: f64| {
            let mut angles = JointAngles::default();
            angles[crate::body::Dof::LeftShoulderFlexion] = flexion;
            angles.to_pose(DVec3::ZERO, DQuat::IDENTITY)
        };
        let at = |flexion| centre_of_mass_m(&body, &masses, &pose(flexion)).z;
        let arm = [Segment::LeftUpperArm, Segment::LeftForearm].map(|segment| {
            let origin_m = if segment == Segment::LeftForearm {
                body.joint_offset_m(Joint::LeftElbow).unwrap().1.z
            } else {
                0.0
            };
            let mass = masses[segment.index()];
            mass.mass_kg * (origin_m + mass.centre_m.z)
        });
        let expected =
            -2.0 * arm.iter().sum::<f64>() / masses.iter().map(|m| m.mass_kg).sum::<f64>();
        let got = at(core::f64::consts::PI) - at(0.0);
        assert!((got - expected).abs() < 1e-9, "{got} {expected}");
    }
}
