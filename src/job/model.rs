//! A robot's file as retargeting sees it.

use crate::body::Segment;
use crate::error::Error;
use crate::mocap::retarget::{ModelJoint, RobotModel, SegmentLink};
use crate::robot::Robot;
use gaitway_profiles as profiles;
use glam::DVec3;

/// The robot as retargeting sees it.
///
/// # Errors
/// A robot whose file does not say what it is in a person.
pub fn robot_model(robot: &Robot) -> Result<RobotModel, Error> {
    let file = &robot.file;
    let anatomy = file.anatomy.as_ref().ok_or_else(|| {
        Error::new("the robot's file does not say which part of a body each link is")
            .at(format!("robot {}", robot.name))
            .got("no [anatomy]")
            .allowed("motions in joints: a table (.csv), a recording (.mcap), a hand (`record`)")
            .remedy(
                "to follow a body (captures, actions, live mirroring) add [anatomy], and origin_m \
                 and axis of each joint",
            )
    })?;
    let index = |name: &str| file.joints.iter().position(|joint| joint.name == name);
    let mut joints = Vec::with_capacity(file.joints.len());
    for (joint, resolved) in file.joints.iter().zip(&robot.joints) {
        let (origin_m, axis) = joint.mounting().ok_or_else(|| {
            Error::new("the robot's file does not say where a joint sits")
                .at(format!("robot {}, joint {}", robot.name, joint.name))
                .allowed("origin_m and axis")
        })?;
        joints.push(ModelJoint {
            name: joint.name.clone(),
            parent: joint.parent.as_deref().and_then(index),
            origin_m: DVec3::from_array(origin_m),
            // Files round their numbers; a turn needs a length of exactly one.
            axis: DVec3::from_array(axis).normalize_or_zero(),
            lower_rad: resolved.limits.lower_rad(),
            upper_rad: resolved.limits.upper_rad(),
        });
    }
    let n_pose = |joint: &profiles::Joint| anatomy.n_pose_rad.get(&joint.name).copied();
    let links = anatomy.segments.iter().filter_map(|link| {
        Some(SegmentLink {
            segment: segment(link.segment),
            joint: index(&link.joint)?,
            direction_weight: link.direction_weight,
            twist_weight: link.twist_weight,
        })
    });
    Ok(RobotModel {
        joints,
        base: anatomy.base.iter().copied().map(segment).collect(),
        n_pose_rad: file.joints.iter().map(|joint| n_pose(joint).unwrap_or(0.0)).collect(),
        links: links.collect(),
        hands: Vec::new(),
    })
}

pub(super) const fn segment(segment: profiles::Segment) -> Segment {
    match segment {
        profiles::Segment::Pelvis => Segment::Pelvis,
        profiles::Segment::Torso => Segment::Torso,
        profiles::Segment::Head => Segment::Head,
        profiles::Segment::LeftUpperArm => Segment::LeftUpperArm,
        profiles::Segment::LeftForearm => Segment::LeftForearm,
        profiles::Segment::RightUpperArm => Segment::RightUpperArm,
        profiles::Segment::RightForearm => Segment::RightForearm,
        profiles::Segment::LeftThigh => Segment::LeftThigh,
        profiles::Segment::LeftShank => Segment::LeftShank,
        profiles::Segment::LeftFoot => Segment::LeftFoot,
        profiles::Segment::RightThigh => Segment::RightThigh,
        profiles::Segment::RightShank => Segment::RightShank,
        profiles::Segment::RightFoot => Segment::RightFoot,
    }
}
