//! A person's angles copied, joint by joint: what scripts do that know nothing of a robot's links. A plain baseline
//! for what the fit is worth.

use super::{
    Capture, Error, Retargeted, RobotModel, Settings, judged, low_pass_between, rests, usable_links,
};
use glam::{DQuat, DVec3, EulerRot};

/// The joints of a robot with the angles of the person's: each that leads to a link takes the turn of the link's
/// segment against the segment before it, about that axis of the body which its own is nearest to. Of two joints
/// about the same axis the first takes it. Filtered and bent into the limits as what is fitted is.
///
/// # Errors
/// As [`super::retarget`].
pub fn copied(
    capture: &Capture,
    model: &RobotModel,
    initial_rad: &[f64],
) -> Result<Retargeted, Error> {
    model.check(initial_rad)?;
    let settings = Settings::default();
    let mut notes = capture.notes.clone();
    let links = usable_links(capture, model, &mut notes)?;
    let is_end = |joint: usize| model.links.iter().any(|link| link.joint == joint);
    let mut wanted_rad: Vec<Vec<f64>> =
        initial_rad.iter().map(|angle| vec![*angle; capture.poses.len()]).collect();
    for link in &links {
        let above = std::iter::successors(Some(link.joint), |at| model.joints[*at].parent);
        let mut joints: Vec<usize> =
            above.take_while(|at| *at == link.joint || !is_end(*at)).collect();
        joints.reverse();
        let Some(before) = link.segment.parent() else { continue };
        let mut taken = [false; 3];
        for joint in joints {
            let (axis, sign) = body_axis(model, joint);
            if std::mem::replace(&mut taken[axis], true) {
                continue;
            }
            let copied = capture.poses.iter().map(|pose| {
                let [before, own] = [before, link.segment].map(|of| pose.orientation[of.index()]);
                model.n_pose_rad[joint] + sign * turns(before.inverse() * own)[axis]
            });
            wanted_rad[joint] = copied.collect();
        }
    }
    let cutoff_hz = settings.cutoff_hz.min(0.4 * capture.rate_hz);
    for series in &mut wanted_rad {
        *series = low_pass_between(series, capture.rate_hz, cutoff_hz, rests(capture))?;
    }
    judged(capture, model, wanted_rad, settings.margin_rad, notes)
}

/// Turns about X, Y and Z: about Y first, then about X as it is turned, then about Z, as the body's angles are told.
fn turns(turn: DQuat) -> DVec3 {
    let (y, x, z) = turn.to_euler(EulerRot::YXZ);
    DVec3::new(x, y, z)
}

/// Which axis of the body a joint's is nearest to while the robot stands as a person does, and which way round.
fn body_axis(model: &RobotModel, joint: usize) -> (usize, f64) {
    let before = model.joints[joint].parent;
    let turned = before.map_or(DQuat::IDENTITY, |at| model.link_orientation(at, &model.n_pose_rad));
    let axis = turned * model.joints[joint].axis;
    let nearest = axis.abs().max_position();
    (nearest, axis[nearest].signum())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::{Dof, JointAngles, Segment};
    use crate::mocap::retarget::{ModelJoint, SegmentLink};

    fn arm(axes: &[DVec3], ends: &[(Segment, usize)]) -> RobotModel {
        let joint = |(at, axis): (usize, &DVec3)| ModelJoint {
            name: format!("j{at}"),
            parent: at.checked_sub(1),
            origin_m: DVec3::ZERO,
            axis: *axis,
            lower_rad: -3.0,
            upper_rad: 3.0,
        };
        let link = |(segment, joint): &(Segment, usize)| SegmentLink {
            segment: *segment,
            joint: *joint,
            direction_weight: 1.0,
            twist_weight: 1.0,
        };
        RobotModel {
            joints: axes.iter().enumerate().map(joint).collect(),
            base: vec![Segment::Pelvis, Segment::Torso],
            n_pose_rad: vec![0.0; axes.len()],
            links: ends.iter().map(link).collect(),
            hands: Vec::new(),
        }
    }

    fn still(dof: Dof, angle_rad: f64) -> Capture {
        let mut angles = JointAngles::default();
        angles[dof] = angle_rad;
        let poses = vec![angles.to_pose(DVec3::ZERO, DQuat::IDENTITY); 60];
        let (tracked, notes) = ([true; 13], Vec::new());
        Capture { rate_hz: 60.0, poses, tracked, stature_m: 1.7, is_made: false, notes }
    }

    #[test]
    fn a_joint_takes_the_turn_about_the_axis_that_is_nearest_to_its_own_and_the_first_of_two_takes_it()
     {
        // Elbow flexion turns a forearm about -Y: a joint about +Y takes it with the other sign.
        let ends = [(Segment::LeftUpperArm, 1), (Segment::LeftForearm, 3)];
        let aslant = DVec3::new(0.1, 0.99, 0.0).normalize();
        let model = arm(&[DVec3::X, DVec3::Z, aslant, DVec3::Y], &ends);
        let found = copied(&still(Dof::LeftElbowFlexion, 1.0), &model, &[0.0; 4]).expect("angles");
        let at = |joint: usize| found.positions_rad[joint][30];
        assert!((at(2) + 1.0).abs() < 1e-9, "{}", at(2));
        assert_eq!([at(0), at(1), at(3)], [0.0; 3]);
    }

    #[test]
    fn copied_angles_are_the_fitted_ones_where_a_robot_is_built_as_the_body_is() {
        let model = arm(&[DVec3::Y, DVec3::X, DVec3::Z], &[(Segment::RightUpperArm, 2)]);
        for dof in [Dof::RightShoulderFlexion, Dof::RightShoulderAbduction] {
            let capture = still(dof, 0.7);
            let copied = copied(&capture, &model, &[0.0; 3]).expect("angles");
            let fitted = super::super::retarget(&capture, &model, &[0.0; 3], &Settings::default());
            let fitted = fitted.expect("angles");
            for (one, other) in copied.positions_rad.iter().zip(&fitted.positions_rad) {
                assert!((one[30] - other[30]).abs() < 0.02, "{dof:?}: {} {}", one[30], other[30]);
            }
        }
    }
}
