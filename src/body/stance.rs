//! How the pelvis and the feet of a body turn while it stands and walks, from its joint angles.
//!
//! The 22 degrees of freedom say nothing of the pelvis in the world, and their ankles do not tip sideways.
//! Both follow from the foot that stands: it neither turns on the floor nor tips over, so the pelvis turns
//! about the vertical against it, takes its share of what the standing hip turns sideways, and the ankle
//! takes what keeps the sole flat.

use glam::{DQuat, DVec3};

use crate::body::root::{SOLES, spread};
use crate::body::{Dof, JointAngles, PelvisAngles, Proportions, Segment, SegmentPose};

/// Of a standing hip's abduction so much lists the pelvis; the rest leans the leg, and carries the body
/// over the foot. Walking people list their pelvis by 5 deg to either side and sway by 2 to 2.5 cm, with
/// hips that turn sideways by 6 to 7 deg (Saunders, Inman, Eberhart, "The major determinants in normal and
/// pathological gait", Journal of Bone and Joint Surgery 35-A, 1953; Kadaba et al., "Measurement of lower
/// extremity kinematics during level walking", Journal of Orthopaedic Research 8, 1990): 0.9 m of leg
/// leaning by 0.3 of 6.5 deg carry it by 3 cm.
const LISTS: f64 = 0.7;
/// The pelvis lists at most so far, rad: beyond it the leg leans.
const MOST_LIST_RAD: f64 = 12.0 * core::f64::consts::PI / 180.0;
/// A foot that is so much higher than the other stands e times less, m.
const STANDS_M: f64 = 0.02;
/// Over this time the weight goes from foot to foot, standard deviation, s.
const SHIFTS_S: f64 = 0.04;
/// An ankle tips at most so far to the side, rad: eversion (American Academy of Orthopaedic Surgeons,
/// "Joint Motion: Method of Measuring and Recording", 1965: 15 to 20 deg).
const MOST_INVERSION_RAD: f64 = 20.0 * core::f64::consts::PI / 180.0;
/// Cosines of the sole's tilt between which an ankle begins to keep it flat: a foot that points up or
/// down stands on nothing.
const STEEP: [f64; 2] = [0.1, 0.95];

const FEET: [Segment; 2] = [Segment::LeftFoot, Segment::RightFoot];

/// What of a pose does not hang on how its pelvis is turned.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Upright {
    /// The part of the weight on the left foot.
    left: f64,
    /// Where the left and the right foot's front points, rad.
    headings_rad: [f64; 2],
}

impl Upright {
    pub(crate) fn of(body: &Proportions, angles: &JointAngles) -> Self {
        let upright = angles.to_pose(DVec3::ZERO, DQuat::IDENTITY);
        let at = body.positions(&upright);
        let [left_m, right_m] =
            [0, 2].map(|first| at.end_m(SOLES[first]).z.min(at.end_m(SOLES[first + 1]).z));
        let headings_rad = FEET.map(|foot| {
            let front = upright.orientation[foot.index()] * DVec3::X;
            front.y.atan2(front.x)
        });
        Self { left: 1.0 / (1.0 + ((left_m - right_m) / STANDS_M).exp()), headings_rad }
    }
}

/// How the pelvis is turned by the feet that stand, from facing +X, while the body has these angles, which follow at `rate_hz`.
pub(crate) fn pelvises(
    angles: &[JointAngles],
    uprights: &[Upright],
    rate_hz: f64,
) -> Vec<PelvisAngles> {
    let mut left: Vec<DVec3> =
        uprights.iter().map(|upright| DVec3::new(upright.left, 0.0, 0.0)).collect();
    spread(&mut left, rate_hz, SHIFTS_S);
    let mut rotation_rad = 0.0;
    let mut found = Vec::with_capacity(angles.len());
    for (at, (angles, part)) in angles.iter().zip(&left).enumerate() {
        if let Some(before) = at.checked_sub(1) {
            let [before, now] = [before, at].map(|at| uprights[at].headings_rad);
            let turned = |foot: usize| crate::units::wrap_rad(now[foot] - before[foot]);
            rotation_rad -= part.x * turned(0) + (1.0 - part.x) * turned(1);
        }
        let asked = LISTS
            * ((1.0 - part.x) * angles[Dof::RightHipAbduction]
                - part.x * angles[Dof::LeftHipAbduction]);
        let obliquity_rad = MOST_LIST_RAD * (asked / MOST_LIST_RAD).tanh();
        found.push(PelvisAngles { rotation_rad, obliquity_rad, tilt_rad: 0.0 });
    }
    found
}

/// Poses of a body with these angles, which follow at `rate_hz`, its root at the origin: the pelvis turned
/// by the feet that stand, from facing +X, and soles as flat sideways as ankles make them.
#[must_use]
pub fn poses(body: &Proportions, angles: &[JointAngles], rate_hz: f64) -> Vec<SegmentPose> {
    let uprights: Vec<Upright> = angles.iter().map(|angles| Upright::of(body, angles)).collect();
    let pelvises = pelvises(angles, &uprights, rate_hz);
    let posed = angles.iter().zip(pelvises);
    posed
        .map(|(angles, pelvis)| on_flat_soles(angles, DVec3::ZERO, pelvis.to_orientation()))
        .collect()
}

/// The pose of these angles with its pelvis there, and with its ankles tipped sideways so that the soles
/// are level.
#[must_use]
pub fn on_flat_soles(angles: &JointAngles, root_m: DVec3, pelvis: DQuat) -> SegmentPose {
    let mut pose = angles.to_pose(root_m, pelvis);
    for foot in FEET {
        let turned = &mut pose.orientation[foot.index()];
        *turned = (*turned * DQuat::from_rotation_x(inversion_rad(*turned))).normalize();
    }
    pose
}

/// How far about its own long axis a foot is turned by an ankle that keeps its sole level.
fn inversion_rad(foot: DQuat) -> f64 {
    let (aside, up) = (foot * DVec3::Y, foot * DVec3::Z);
    let tipped = -aside.z.atan2(up.z);
    let part = ((up.z - STEEP[0]) / (STEEP[1] - STEEP[0])).clamp(0.0, 1.0);
    let part = part * part * (3.0 - 2.0 * part);
    part * MOST_INVERSION_RAD * (tipped / MOST_INVERSION_RAD).tanh()
}

#[cfg(test)]
mod tests {
    use super::*;

    const RATE_HZ: f64 = 240.0;

    fn body() -> Proportions {
        Proportions::of_stature(1.75).unwrap()
    }

    /// From rest into `set` with part 1, over a second.
    fn going_into(set: impl Fn(&mut JointAngles, f64)) -> Vec<SegmentPose> {
        let angles: Vec<JointAngles> = (0..300)
            .map(|i| {
                let part = f64::from((i - 30).clamp(0, 240)) / 240.0;
                let mut angles = JointAngles::default();
                set(&mut angles, (1.0 - (part * core::f64::consts::PI).cos()) / 2.0);
                angles
            })
            .collect();
        poses(&body(), &angles, RATE_HZ)
    }

    fn pelvis(pose: &SegmentPose) -> PelvisAngles {
        PelvisAngles::of(pose.orientation[Segment::Pelvis.index()])
    }

    #[test]
    fn both_feet_apart_leave_the_pelvis_as_it_is_and_the_soles_flat() {
        let apart = going_into(|angles, part| {
            angles[Dof::LeftHipAbduction] = 0.15 * part;
            angles[Dof::RightHipAbduction] = 0.15 * part;
        });
        let last = apart.last().unwrap();
        assert!(pelvis(last).to_array().iter().all(|angle| angle.abs() < 1e-9));
        for foot in FEET {
            let aside = last.orientation[foot.index()] * DVec3::Y;
            assert!(aside.z.abs() < 0.03, "{aside}");
        }
    }

    #[test]
    fn a_pelvis_turns_against_the_foot_that_stands() {
        // The right knee goes up; then the left hip turns inwards, so its foot would point to the right.
        let turned = going_into(|angles, part| {
            let (first, then) = ((2.0 * part).min(1.0), (2.0 * part - 1.0).max(0.0));
            angles[Dof::RightHipFlexion] = first;
            angles[Dof::RightKneeFlexion] = 1.5 * first;
            angles[Dof::LeftHipRotation] = 0.3 * then;
        });
        let last = turned.last().unwrap();
        assert!((pelvis(last).rotation_rad - 0.3).abs() < 0.02, "{:?}", pelvis(last));
        let front = last.orientation[Segment::LeftFoot.index()] * DVec3::X;
        assert!(front.y.abs() < 0.02, "{front}");
    }

    #[test]
    fn a_pelvis_drops_on_the_side_that_swings() {
        let listing = going_into(|angles, part| {
            angles[Dof::RightHipFlexion] = part;
            angles[Dof::RightKneeFlexion] = 1.5 * part;
            angles[Dof::LeftHipAbduction] = -0.1 * part;
        });
        let got = pelvis(listing.last().unwrap());
        assert!((got.obliquity_rad - 0.07).abs() < 0.003, "{got:?}");
    }

    #[test]
    fn a_leg_lifted_sideways_does_not_break_its_ankle() {
        for degrees in [0, 20, 45, 90, 140] {
            let raised = going_into(|angles, part| {
                angles[Dof::RightHipAbduction] = f64::from(degrees).to_radians() * part;
                angles[Dof::RightKneeFlexion] = 0.3 * part;
            });
            for pose in raised {
                let [shank, foot] = [Segment::RightShank, Segment::RightFoot]
                    .map(|segment| pose.orientation[segment.index()]);
                let between = (shank.inverse() * foot).to_scaled_axis().length();
                assert!(between <= MOST_INVERSION_RAD + 1e-9, "{degrees} deg: {between}");
            }
        }
    }

    #[test]
    fn nothing_has_no_poses() {
        assert!(poses(&body(), &[], RATE_HZ).is_empty());
    }
}
