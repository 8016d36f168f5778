//! Joints that stand in for one degree of freedom of the body, found in a robot's file by where
//! their axes lie, without the retargeter.

use crate::forms;
use gaitway::action::Motion;
use gaitway::body::{Dof, Segment};
use gaitway::mocap::retarget::RobotModel;

/// Nearer to a limit than this, rad, angles are bent.
const MARGIN_RAD: f64 = 0.0501;
/// A limb that comes to a limit leaves its own curves so long before and after, s, and at an end of
/// the motion for so long from there.
const AROUND_S: f64 = 0.31;
const AT_END_S: f64 = 0.61;

/// A joint and the degree of freedom it stands in for: turned by `sign` times its angle from the N
/// pose; one without stays there.
pub struct Played {
    pub joint: usize,
    pub dof: Option<(Dof, f64)>,
    n_pose_rad: f64,
}

/// Joints from the base to a limb's last segment.
pub struct Limb {
    pub joints: Vec<Played>,
    /// Times at which a joint stands at a limit, s.
    touches_s: Vec<f64>,
    duration_s: f64,
}

impl Played {
    /// Where the joint is when the body does the action, rad.
    pub fn angle_rad(&self, motion: &Motion, time_s: f64) -> f64 {
        let turned = self.dof.map(|(dof, sign)| sign * forms::angle_rad(motion, dof, time_s));
        self.n_pose_rad + turned.unwrap_or(0.0)
    }
}

/// Legs whose thighs move straight ahead only, and the head, as far as one joint each turns them
/// about the axis from right to left.
pub fn limbs(model: &RobotModel, motion: &Motion) -> Vec<Limb> {
    let still = |dof: Dof| motion.track(dof).actionlets().iter().all(|piece| piece.is_rest());
    // A hip that turns sideways tips the pelvis, and ankles keep both soles flat.
    let upright = still(Dof::LeftHipAbduction) && still(Dof::RightHipAbduction);
    let mut found = Vec::new();
    for (segments, [flexion, rotation, knee, ankle]) in [
        (
            [Segment::LeftThigh, Segment::LeftShank, Segment::LeftFoot],
            [
                Dof::LeftHipFlexion,
                Dof::LeftHipRotation,
                Dof::LeftKneeFlexion,
                Dof::LeftAnkleDorsiflexion,
            ],
        ),
        (
            [Segment::RightThigh, Segment::RightShank, Segment::RightFoot],
            [
                Dof::RightHipFlexion,
                Dof::RightHipRotation,
                Dof::RightKneeFlexion,
                Dof::RightAnkleDorsiflexion,
            ],
        ),
    ] {
        if upright && still(rotation) && model.base.contains(&Segment::Pelvis) {
            // About +Y a thigh or a foot turns down and back, a shank back: it flexes.
            let [thigh, shank, foot] = segments;
            let parts = [(thigh, flexion, -1.0), (shank, knee, 1.0), (foot, ankle, -1.0)];
            found.extend(limb(model, motion, &parts));
        }
    }
    if model.base.contains(&Segment::Torso) {
        found.extend(limb(model, motion, &[(Segment::Head, Dof::NeckFlexion, 1.0)]));
    }
    found
}

/// The chain of joints to the last of some segments, each with the one degree of freedom against
/// the segment before and its sense about +Y; none unless one joint each has that axis.
fn limb(model: &RobotModel, motion: &Motion, parts: &[(Segment, Dof, f64)]) -> Option<Limb> {
    let mut joints: Vec<Played> = Vec::new();
    for &(segment, dof, sense) in parts {
        let last = model.links.iter().find(|link| link.segment == segment)?.joint;
        let mut chain: Vec<usize> =
            std::iter::successors(Some(last), |at| model.joints[*at].parent).collect();
        chain.reverse();
        chain.retain(|joint| joints.iter().all(|played| played.joint != *joint));
        let across = |joint: &usize| model.joints[*joint].axis.y.abs() > 0.999;
        if chain.iter().filter(|&joint| across(joint)).count() != 1 {
            return None;
        }
        joints.extend(chain.into_iter().map(|joint| Played {
            joint,
            dof: across(&joint).then(|| (dof, sense * model.joints[joint].axis.y.signum())),
            n_pose_rad: model.n_pose_rad[joint],
        }));
    }
    let touches = |time_s: &f64| {
        joints.iter().any(|played| {
            let (angle_rad, of) = (played.angle_rad(motion, *time_s), &model.joints[played.joint]);
            angle_rad < of.lower_rad + MARGIN_RAD || angle_rad > of.upper_rad - MARGIN_RAD
        })
    };
    let duration_s = motion.duration_s();
    let times = (0..=(duration_s * 1000.0).ceil() as u32).map(|ms| f64::from(ms) / 1000.0);
    let touches_s = times.filter(touches).collect();
    Some(Limb { joints, touches_s, duration_s })
}

impl Limb {
    /// True if no limit has to do with where the limb is at a time of the action, s.
    pub fn is_free(&self, time_s: f64) -> bool {
        let (mut from_s, mut to_s) = (time_s - AROUND_S, time_s + AROUND_S);
        if time_s < AT_END_S {
            (from_s, to_s) = (0.0, to_s.max(AT_END_S));
        }
        if time_s > self.duration_s - AT_END_S {
            (from_s, to_s) = (from_s.min(self.duration_s - AT_END_S), self.duration_s + AROUND_S);
        }
        !self.touches_s.iter().any(|touch_s| (from_s..=to_s).contains(touch_s))
    }
}
