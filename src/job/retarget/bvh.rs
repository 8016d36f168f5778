//! A robot's own joint tree as a BVH file: centimetres, Y up, facing +Z, standing in its zero pose at
//! zero. The base goes where it is told to go.

use crate::mocap::bvh::{Axis, Bvh, Channel, Joint};
use crate::mocap::retarget::RobotModel;
use crate::rigid::Placement;
use glam::{DQuat, DVec3, EulerRot};

const CM_PER_M: f64 = 100.0;
/// Length of the last link of a limb, whose end the robot's file does not tell.
const LAST_LINK_M: f64 = 0.03;
const ROTATIONS: [Channel; 3] =
    [Channel::Rotation(Axis::Z), Channel::Rotation(Axis::X), Channel::Rotation(Axis::Y)];
const POSITIONS: [Channel; 3] =
    [Channel::Position(Axis::X), Channel::Position(Axis::Y), Channel::Position(Axis::Z)];

/// From X forward, Y left, Z up to X left, Y up, Z forward.
const fn turned(v: DVec3) -> DVec3 {
    DVec3::new(v.y, v.z, v.x)
}

/// `poses` of a robot at `rate_hz`: where its base is, and angles in rad, in the order of the model's
/// joints.
pub fn of_robot(model: &RobotModel, poses: &[(Placement, Vec<f64>)], rate_hz: f64) -> Bvh {
    let order = order(model);
    let base = Joint {
        name: "base".to_owned(),
        parent: None,
        offset: DVec3::ZERO,
        channels: POSITIONS.into_iter().chain(ROTATIONS).collect(),
        first_channel: 0,
        ends: Vec::new(),
    };
    let joints = order.iter().enumerate().map(|(place, &index)| {
        let joint = &model.joints[index];
        let carrier = |carrier: usize| order.iter().position(|&index| index == carrier);
        let last = !model.joints.iter().any(|other| other.parent == Some(index));
        let along = turned(joint.origin_m).try_normalize().unwrap_or(DVec3::NEG_Y);
        Joint {
            name: joint.name.clone(),
            parent: Some(joint.parent.and_then(carrier).map_or(0, |place| place + 1)),
            offset: turned(joint.origin_m) * CM_PER_M,
            channels: ROTATIONS.to_vec(),
            first_channel: 6 + 3 * place,
            ends: last.then_some(along * LAST_LINK_M * CM_PER_M).into_iter().collect(),
        }
    });
    let joints = std::iter::once(base).chain(joints).collect();
    let mut values = Vec::with_capacity((6 + 3 * order.len()) * poses.len());
    for (base, pose) in poses {
        values.extend((turned(base.at_m) * CM_PER_M).to_array());
        let own = base.turn;
        let turn = DQuat::from_xyzw(own.y, own.z, own.x, own.w);
        let (z, x, y) = turn.to_euler(EulerRot::ZXY);
        values.extend([z, x, y].map(f64::to_degrees));
        for &index in &order {
            let turn = DQuat::from_axis_angle(turned(model.joints[index].axis), pose[index]);
            let (z, x, y) = turn.to_euler(EulerRot::ZXY);
            values.extend([z, x, y].map(f64::to_degrees));
        }
    }
    Bvh { joints, time_step_s: 1.0 / rate_hz, values }
}

/// The joints as the file lists them: each limb to its end before the next.
fn order(model: &RobotModel) -> Vec<usize> {
    let children = |parent: Option<usize>| {
        let of = move |index: &usize| model.joints[*index].parent == parent;
        (0..model.joints.len()).rev().filter(of)
    };
    let mut open: Vec<usize> = children(None).collect();
    let mut order = Vec::new();
    while let Some(index) = open.pop() {
        order.push(index);
        open.extend(children(Some(index)));
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::model::robot_model;
    use crate::mocap::bvh;
    use crate::mocap::skeleton::{Placed, Skeleton};
    use crate::robot::Robot;

    /// Where a joint stands and how it is turned, by the robot's own tree, in the file's axes.
    fn truth(
        model: &RobotModel,
        base: (DVec3, DQuat),
        pose: &[f64],
        index: usize,
    ) -> (DVec3, DQuat) {
        let joint = &model.joints[index];
        let (at, turn) = joint.parent.map_or(base, |parent| truth(model, base, pose, parent));
        let own = DQuat::from_axis_angle(turned(joint.axis), pose[index]);
        (at + turn * turned(joint.origin_m), turn * own)
    }

    #[test]
    fn every_joint_of_every_robot_stands_where_its_own_tree_puts_it() {
        for name in gaitway_profiles::robot_names() {
            let robot = Robot::load(name).expect("shipped");
            if robot.file.anatomy.is_none() {
                continue;
            }
            let model = robot_model(&robot).expect("an anatomy");
            let pose: Vec<f64> =
                (0..model.joints.len()).map(|n| 0.9 * (1.3 * n as f64).sin()).collect();
            let (at_m, axis) = (DVec3::new(0.3, -0.2, 0.5), DVec3::new(0.6, 0.8, 0.0));
            let base = Placement { at_m, turn: DQuat::from_axis_angle(axis, 0.9) };
            let seen = (turned(at_m), DQuat::from_axis_angle(turned(axis), 0.9));
            let text = bvh::write(&of_robot(&model, &[(base, pose.clone())], 100.0));
            let read = bvh::parse(text.as_bytes()).expect("a BVH file");
            assert_eq!(read.joints.len(), model.joints.len() + 1, "{name}");
            let skeleton = Skeleton::new(&read);
            let mut placed = Placed::default();
            skeleton.place(read.pose(0), &mut placed);
            for (place, joint) in read.joints.iter().enumerate().skip(1) {
                let index = model.joints.iter().position(|j| j.name == joint.name);
                let (at, turn) = truth(&model, seen, &pose, index.expect("a joint of the robot"));
                assert!((placed.position[place] / CM_PER_M - at).length() < 1e-9, "{}", joint.name);
                assert!(placed.rotation[place].angle_between(turn) < 1e-6, "{}", joint.name);
            }
        }
    }
}
