//! A motion of the body model as a BVH file (centimetres, Y up, facing +Z, standing in N pose at
//! zero, one joint per segment) and as markers on its joints and ends (millimetres, X forward, Z up).

use super::bvh::{Axis, Bvh, Channel, Joint};
use super::markers::{Frame, Head, MarkerFormat, MarkerPoint, Markers, PointKind, PointSample};
use crate::body::proportions::proximal_joint;
use crate::body::{self, End, Proportions, Segment, SegmentPose};
use crate::error::Error;
use glam::{DQuat, DVec3, EulerRot};

const CM_PER_M: f64 = 100.0;
const MM_PER_M: f64 = 1000.0;
/// Values are rounded to this many parts of a degree or centimetre.
const PARTS: f64 = 1e4;

/// The name of a segment's joint, as most programs call it.
const fn joint_name(segment: Segment) -> &'static str {
    match segment {
        Segment::Pelvis => "Hips",
        Segment::Torso => "Spine",
        Segment::Head => "Head",
        Segment::LeftUpperArm => "LeftArm",
        Segment::LeftForearm => "LeftForeArm",
        Segment::RightUpperArm => "RightArm",
        Segment::RightForearm => "RightForeArm",
        Segment::LeftThigh => "LeftUpLeg",
        Segment::LeftShank => "LeftLeg",
        Segment::LeftFoot => "LeftFoot",
        Segment::RightThigh => "RightUpLeg",
        Segment::RightShank => "RightLeg",
        Segment::RightFoot => "RightFoot",
    }
}

const fn end_name(end: End) -> &'static str {
    match end {
        End::HeadTop => "head_top",
        End::LeftFingertip => "left_fingertip",
        End::RightFingertip => "right_fingertip",
        End::LeftHeel => "left_heel",
        End::LeftToe => "left_toe",
        End::RightHeel => "right_heel",
        End::RightToe => "right_toe",
    }
}

/// Joints and ends of a body in motion, as points that a model computed.
///
/// # Errors
/// Too many for the memory.
pub fn markers_of(
    poses: &[SegmentPose],
    body: &Proportions,
    rate_hz: f64,
) -> Result<Markers, Error> {
    let names = body::Joint::ALL.map(body::Joint::name).into_iter().chain(End::ALL.map(end_name));
    let mut head = Head::new(MarkerFormat::C3d);
    head.points = names
        .map(|name| MarkerPoint {
            label: name.to_owned(),
            description: "of the body model".to_owned(),
            kind: PointKind::Modelled,
            unit: String::new(),
        })
        .collect();
    head.unit = "mm".to_owned();
    head.screen = ["+X".to_owned(), "+Z".to_owned()];
    head.frames = poses.len();
    head.set_rate(rate_hz);
    let mut markers = Markers::with_room(head)?;
    for pose in poses {
        let at = body.positions(pose);
        let seen = |at_m: &DVec3| {
            let position = (*at_m * MM_PER_M).as_vec3().to_array();
            Some(PointSample { position, residual: 0.0, cameras: 0 })
        };
        let points = at.joints_m.iter().chain(&at.ends_m).map(seen).collect();
        markers.push(&Frame { points, analog: Vec::new() });
    }
    Ok(markers)
}

const fn end_of(segment: Segment) -> Option<End> {
    match segment {
        Segment::Head => Some(End::HeadTop),
        Segment::LeftForearm => Some(End::LeftFingertip),
        Segment::RightForearm => Some(End::RightFingertip),
        Segment::LeftFoot => Some(End::LeftToe),
        Segment::RightFoot => Some(End::RightToe),
        _ => None,
    }
}

/// From X forward, Y left, Z up to X left, Y up, Z forward.
const fn turned(v: DVec3) -> DVec3 {
    DVec3::new(v.y, v.z, v.x)
}

fn rounded(value: f64) -> f64 {
    // Adding zero makes of -0 a plain 0.
    (value * PARTS).round() / PARTS + 0.0
}

fn in_cm(v_m: DVec3) -> DVec3 {
    let v = turned(v_m) * CM_PER_M;
    DVec3::new(rounded(v.x), rounded(v.y), rounded(v.z))
}

/// Where segments begin on those that carry them, and where the last ones end; m, N pose.
#[derive(Clone, Debug, PartialEq)]
pub struct BodyOffsets {
    /// By [`Segment::index`].
    pub begins_m: [DVec3; 13],
    /// The same; none of those that carry another.
    pub ends_m: [Option<DVec3>; 13],
}

impl BodyOffsets {
    /// Of a body with these proportions.
    #[must_use]
    pub fn of(body: &Proportions) -> Self {
        let begins = |segment| body.joint_offset_m(proximal_joint(segment));
        let ends = |segment| end_of(segment).map(|end| body.end_offset_m(end).1);
        Self {
            begins_m: Segment::ALL.map(|segment| begins(segment).map_or(DVec3::ZERO, |(_, o)| o)),
            ends_m: Segment::ALL.map(ends),
        }
    }
}

/// Writes `poses` of a body with these proportions, at `rate_hz`.
#[must_use]
pub fn bvh_of(poses: &[SegmentPose], body: &Proportions, rate_hz: f64) -> Bvh {
    bvh_with(poses, &BodyOffsets::of(body), rate_hz)
}

/// Writes `poses` of a body with these bones, at `rate_hz`.
#[must_use]
pub fn bvh_with(poses: &[SegmentPose], body: &BodyOffsets, rate_hz: f64) -> Bvh {
    let joints = joints(body);
    let channels = joints.iter().map(|joint| joint.channels.len()).sum::<usize>();
    let mut values = Vec::with_capacity(channels * poses.len());
    for pose in poses {
        values.extend(in_cm(pose.root_m).to_array());
        for segment in Segment::ALL {
            let own = pose.orientation[segment.index()];
            let carrier = segment.parent().map_or(DQuat::IDENTITY, |p| pose.orientation[p.index()]);
            let local = carrier.inverse() * own;
            let axis = turned(DVec3::new(local.x, local.y, local.z));
            let turned = DQuat::from_xyzw(axis.x, axis.y, axis.z, local.w);
            let (z, x, y) = turned.to_euler(EulerRot::ZXY);
            values.extend([z, x, y].map(|angle| rounded(angle.to_degrees())));
        }
    }
    Bvh { joints, time_step_s: 1.0 / rate_hz, values }
}

fn joints(body: &BodyOffsets) -> Vec<Joint> {
    let rotations = [Axis::Z, Axis::X, Axis::Y].map(Channel::Rotation);
    let positions = [Axis::X, Axis::Y, Axis::Z].map(Channel::Position);
    let mut first_channel = 0;
    let mut joints = Vec::with_capacity(Segment::ALL.len());
    for segment in Segment::ALL {
        let mut channels = Vec::new();
        if segment.parent().is_none() {
            channels.extend(positions);
        }
        channels.extend(rotations);
        let offset = body.begins_m[segment.index()];
        let ends = body.ends_m[segment.index()].map(in_cm);
        joints.push(Joint {
            name: joint_name(segment).to_owned(),
            parent: segment.parent().map(Segment::index),
            offset: in_cm(offset),
            first_channel,
            ends: ends.into_iter().collect(),
            channels: channels.clone(),
        });
        first_channel += channels.len();
    }
    joints
}
