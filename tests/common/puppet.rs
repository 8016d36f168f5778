//! A puppet whose segments turn as told, written as BVH in any convention.

use gaitway::body::{Segment, SegmentPose};
use gaitway::mocap::anatomy::Capture;
use gaitway::mocap::bvh::{Axis, Bvh, Channel, Joint};
use glam::{DQuat, DVec3, EulerRot};

/// How a file is written.
pub struct Convention {
    /// Axes of the file: world (Z up, X forward) to file.
    pub to_file: DQuat,
    /// File units per metre.
    pub units_per_m: f64,
    /// Rotation channels in order, and the same for glam.
    pub order: ([Axis; 3], EulerRot),
    /// Bone frame of a segment in its anatomical frame: what the file's zero pose looks like.
    pub bone: fn(Segment, &Convention) -> DQuat,
    /// Joint name of a segment; tips get `End` behind.
    pub name: fn(Segment) -> &'static str,
}

/// Bone frames equal to the file's axes while the body stands in T pose.
pub fn drawn_as_t(segment: Segment, convention: &Convention) -> DQuat {
    let in_t = match segment {
        Segment::LeftUpperArm | Segment::LeftForearm => DQuat::from_rotation_x(90f64.to_radians()),
        Segment::RightUpperArm | Segment::RightForearm => {
            DQuat::from_rotation_x(-90f64.to_radians())
        }
        _ => DQuat::IDENTITY,
    };
    (convention.to_file * in_t).inverse()
}

/// Bone frames equal to the file's axes while the body stands in N pose.
pub fn drawn_as_n(_: Segment, convention: &Convention) -> DQuat {
    convention.to_file.inverse()
}

/// Every bone along +X of its own frame, with a twist of its own: the zero pose means nothing.
pub fn drawn_along_x(segment: Segment, _: &Convention) -> DQuat {
    let along = DQuat::from_rotation_arc(DVec3::X, segment.long_axis());
    along * DQuat::from_rotation_x(0.4 * segment.index() as f64)
}

/// Place of a segment's joint in its parent's anatomical frame, m. Proportions after Winter,
/// fig. 4.1, for a stature of 1.75 m; a model, so nothing leans.
fn offset(segment: Segment) -> DVec3 {
    let side = if format!("{segment:?}").starts_with("Left") { 1.0 } else { -1.0 };
    match segment {
        Segment::Pelvis => DVec3::ZERO,
        Segment::Torso => DVec3::new(0.0, 0.0, 0.18),
        Segment::Head => DVec3::new(0.0, 0.0, 0.40),
        Segment::LeftUpperArm | Segment::RightUpperArm => DVec3::new(0.0, 0.19 * side, 0.30),
        Segment::LeftForearm | Segment::RightForearm => DVec3::new(0.0, 0.0, -0.326),
        Segment::LeftThigh | Segment::RightThigh => DVec3::new(0.0, 0.09 * side, 0.0),
        Segment::LeftShank | Segment::RightShank => DVec3::new(0.0, 0.0, -0.429),
        Segment::LeftFoot | Segment::RightFoot => DVec3::new(0.0, 0.0, -0.430),
    }
}

/// Far end of a last segment, m.
fn tip(segment: Segment) -> Option<DVec3> {
    match segment {
        Segment::Head => Some(DVec3::new(0.0, 0.0, 0.2)),
        Segment::LeftForearm | Segment::RightForearm => Some(DVec3::new(0.0, 0.0, -0.255)),
        Segment::LeftFoot | Segment::RightFoot => Some(DVec3::new(0.14, 0.0, -0.048)),
        _ => None,
    }
}

/// Writes poses as a BVH file. The order of [`Segment::ALL`] has parents before children, but BVH
/// wants each joint's children next to it: depth first.
pub fn write(poses: &[SegmentPose], rate_hz: f64, convention: &Convention) -> Bvh {
    let mut order = Vec::new();
    let mut stack = vec![Segment::Pelvis];
    while let Some(segment) = stack.pop() {
        order.push(segment);
        stack.extend(Segment::ALL.iter().rev().filter(|child| child.parent() == Some(segment)));
    }
    let mut joints: Vec<Joint> = Vec::new();
    let mut values_of: Vec<Segment> = Vec::new();
    let bone = |segment| (convention.bone)(segment, convention);
    for segment in &order {
        let parent = segment.parent();
        let position = [Axis::X, Axis::Y, Axis::Z].map(Channel::Position);
        let mut channels = if parent.is_none() { position.to_vec() } else { Vec::new() };
        channels.extend(convention.order.0.map(Channel::Rotation));
        let in_parent =
            |segment: Segment, place| bone(segment).inverse() * place * convention.units_per_m;
        joints.push(Joint {
            name: (convention.name)(*segment).to_owned(),
            parent: parent.and_then(|parent| order.iter().position(|s| *s == parent)),
            offset: parent.map_or(DVec3::ZERO, |parent| in_parent(parent, offset(*segment))),
            first_channel: joints.last().map_or(0, |j| j.first_channel + j.channels.len()),
            channels,
            ends: tip(*segment).map(|tip| in_parent(*segment, tip)).into_iter().collect(),
        });
        values_of.push(*segment);
    }
    let mut values = Vec::new();
    for pose in poses {
        let turned = |segment: Segment| {
            convention.to_file * pose.orientation[segment.index()] * bone(segment)
        };
        for segment in &order {
            let local = match segment.parent() {
                Some(parent) => turned(parent).inverse() * turned(*segment),
                None => {
                    let root = convention.to_file * pose.root_m * convention.units_per_m;
                    values.extend(root.to_array());
                    turned(*segment)
                }
            };
            let (a, b, c) = local.to_euler(convention.order.1);
            values.extend([a, b, c].map(f64::to_degrees));
        }
    }
    Bvh { joints, time_step_s: 1.0 / rate_hz, values }
}

/// The poses themselves, as a reader without any doubt would give them.
pub fn truth(poses: Vec<SegmentPose>, rate_hz: f64) -> Capture {
    Capture {
        rate_hz,
        poses,
        tracked: [true; 13],
        stature_m: 1.75,
        is_made: true,
        notes: Vec::new(),
    }
}

/// Four seconds at 60 Hz: stands, then walks on the spot while turning the trunk, swinging and
/// bending the arms, raising the left one sideways, and looking about.
pub fn exercise() -> (Vec<SegmentPose>, f64) {
    let rate_hz = 60.0;
    let poses = (0..240).map(|sample| {
        let t = f64::from(sample) / rate_hz;
        let ease = ((t - 0.5) / 0.5).clamp(0.0, 1.0);
        let swell = ease * ease * (3.0 - 2.0 * ease);
        exercise_pose(t, swell)
    });
    (poses.collect(), rate_hz)
}

fn exercise_pose(t: f64, swell: f64) -> SegmentPose {
    let wave = |hz: f64, phase: f64| (std::f64::consts::TAU * (hz * t + phase)).sin();
    let x = |angle: f64| DQuat::from_rotation_x(angle * swell);
    let y = |angle: f64| DQuat::from_rotation_y(angle * swell);
    let z = |angle: f64| DQuat::from_rotation_z(angle * swell);
    let mut local = [DQuat::IDENTITY; 13];
    let mut set = |segment: Segment, turn: DQuat| local[segment.index()] = turn;
    set(Segment::Pelvis, z(0.3 * wave(0.4, 0.0)) * x(0.05 * wave(0.9, 0.2)));
    set(Segment::Torso, z(0.25 * wave(0.5, 0.3)) * y(0.1 + 0.1 * wave(0.6, 0.0)));
    // To both sides alike: without a rest pose, what is straight ahead is known by the average.
    set(Segment::Head, z(0.5 * wave(1.0, 0.0)) * y(0.2 * wave(2.0 / 3.0, 0.0)));
    for (phase, side, [thigh, shank, foot], [upper, lower]) in [
        (0.0, 1.0, LEFT_LEG, [Segment::LeftUpperArm, Segment::LeftForearm]),
        (0.5, -1.0, RIGHT_LEG, [Segment::RightUpperArm, Segment::RightForearm]),
    ] {
        let lift = 0.5 + 0.5 * wave(0.9, phase);
        set(thigh, y(-0.8 * lift) * x(0.1 * side * lift) * z(0.1 * side * lift));
        set(shank, y(1.2 * lift));
        set(foot, y(-0.3 * lift) * x(0.05 * side * lift));
        let raised = if side > 0.0 { 0.6 + 0.5 * wave(0.5, 0.0) } else { 0.2 };
        set(upper, y(-0.4 * wave(0.9, phase + 0.5)) * x(side * raised));
        set(lower, y(-0.5 - 0.4 * wave(0.9, phase)));
    }
    let mut orientation = local;
    for segment in Segment::ALL {
        if let Some(parent) = segment.parent() {
            orientation[segment.index()] = orientation[parent.index()] * local[segment.index()];
        }
    }
    // The lower foot stays on the floor.
    let height = [LEFT_LEG, RIGHT_LEG].map(|leg| {
        let [hip, knee, ankle] = leg.map(|segment| {
            let parent = segment.parent().expect("legs hang on the pelvis");
            orientation[parent.index()] * offset(segment)
        });
        -(hip + knee + ankle).z + 0.07
    });
    SegmentPose { root_m: DVec3::new(0.0, 0.0, height[0].max(height[1])), orientation }
}

const LEFT_LEG: [Segment; 3] = [Segment::LeftThigh, Segment::LeftShank, Segment::LeftFoot];
const RIGHT_LEG: [Segment; 3] = [Segment::RightThigh, Segment::RightShank, Segment::RightFoot];
