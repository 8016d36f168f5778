//! A BVH skeleton at work: what its position channels mean, and forward kinematics.
//!
//! Rotation channels are plain: each joint turns about its listed axes in their order, each axis
//! as turned by those before. Position channels of joints below the root are not: exporters use
//! them in four ways, and nothing in the file says which. The evidence is in the numbers:
//!
//! 1. The channels stay close to OFFSET (within a tenth of the body's size): they repeat it, or
//!    let the bone stretch a little. They replace OFFSET.
//! 2. OFFSET is a bone's length (no longer than the body), the channels stay close to zero: they are
//!    added to OFFSET.
//! 3. The channels wander far, together with the place where OFFSET alone would put the joint in
//!    the world: they are world coordinates written by mistake. They are ignored.
//! 4. The channels wander far on their own: the joint is carried by them, as a pelvis below a
//!    root that stays at the origin. They replace OFFSET.
//!
//! Position channels of a root replace its OFFSET.

use crate::mocap::bvh::{Axis, Bvh, Channel};
use glam::{DQuat, DVec3};

/// How far from OFFSET the channels may stray and still mean the same bone, in body sizes.
const CLOSE: f64 = 0.1;
/// Poses looked at for the evidence.
const SAMPLES: usize = 200;

/// What carries a joint from its parent's origin to its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Translation {
    /// OFFSET alone; position channels, if any, are ignored.
    Offset,
    /// The position channels in place of OFFSET.
    Channels,
    /// OFFSET plus the position channels.
    Sum,
}

/// A joint ready for forward kinematics.
#[derive(Clone, Debug)]
struct Joint {
    parent: Option<usize>,
    offset: DVec3,
    rotations: Vec<(usize, Axis)>,
    positions: Vec<(usize, Axis)>,
    translation: Translation,
}

/// The joints of a file, with the meaning of every channel settled.
#[derive(Clone, Debug)]
pub struct Skeleton {
    joints: Vec<Joint>,
    notes: Vec<String>,
}

/// Where every joint is, by joint index. In the file's axes and unit, unless said otherwise.
#[derive(Clone, Debug, Default)]
pub struct Placed {
    /// Orientation of each joint's frame.
    pub rotation: Vec<DQuat>,
    /// Origin of each joint's frame.
    pub position: Vec<DVec3>,
}

/// A point fixed in a joint's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// The joint.
    pub joint: usize,
    /// Place in the joint's frame, file units.
    pub offset: DVec3,
}

impl Point {
    /// The joint's own origin.
    #[must_use]
    pub const fn origin(joint: usize) -> Self {
        Self { joint, offset: DVec3::ZERO }
    }
}

impl Placed {
    /// Where a point of the skeleton is; `unit` is the length of one file unit here.
    #[must_use]
    pub fn point(&self, point: Point, unit: f64) -> DVec3 {
        self.position[point.joint] + self.rotation[point.joint] * (point.offset * unit)
    }
}

impl Skeleton {
    /// Settles what the channels of a file mean.
    #[must_use]
    pub fn new(bvh: &Bvh) -> Self {
        let joints = bvh.joints.iter().map(|joint| {
            let numbered = || joint.channels.iter().zip(joint.first_channel..);
            Joint {
                parent: joint.parent,
                offset: joint.offset,
                rotations: numbered()
                    .filter_map(|(channel, at)| match channel {
                        Channel::Rotation(axis) => Some((at, *axis)),
                        Channel::Position(_) => None,
                    })
                    .collect(),
                positions: numbered()
                    .filter_map(|(channel, at)| match channel {
                        Channel::Position(axis) => Some((at, *axis)),
                        Channel::Rotation(_) => None,
                    })
                    .collect(),
                translation: Translation::Channels,
            }
        });
        let mut skeleton = Self { joints: joints.collect(), notes: Vec::new() };
        let size = skeleton.size();
        for at in 0..skeleton.joints.len() {
            let joint = &skeleton.joints[at];
            if joint.positions.is_empty() {
                skeleton.joints[at].translation = Translation::Offset;
            } else if joint.parent.is_some() {
                let meaning = skeleton.meaning(bvh, at, size);
                skeleton.joints[at].translation = meaning;
                if meaning == Translation::Offset {
                    skeleton.notes.push(format!(
                        "position channels of joint {} hold world coordinates: ignored",
                        bvh.joints[at].name
                    ));
                }
            }
        }
        skeleton
    }

    /// What was found out, for the person who asked.
    #[must_use]
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// What carries a joint from its parent.
    #[must_use]
    pub fn translation(&self, joint: usize) -> Translation {
        self.joints[joint].translation
    }

    /// Length of the longest chain of bones. The first two joints from the root are left out: their
    /// OFFSET may be a place in the world.
    fn size(&self) -> f64 {
        let mut depth_and_reach: Vec<(usize, f64)> = Vec::with_capacity(self.joints.len());
        let mut longest: f64 = 0.0;
        for joint in &self.joints {
            let (depth, reach) = joint.parent.map_or((0, 0.0), |parent| {
                let (depth, reach) = depth_and_reach[parent];
                (depth + 1, reach + if depth >= 1 { joint.offset.length() } else { 0.0 })
            });
            longest = longest.max(reach);
            depth_and_reach.push((depth, reach));
        }
        if longest > 0.0 { longest } else { 1.0 }
    }

    /// The rules at the head of this module, for one joint below the root; those above it are
    /// settled.
    fn meaning(&self, bvh: &Bvh, at: usize, size: f64) -> Translation {
        let joint = &self.joints[at];
        let count = bvh.pose_count();
        let samples: Vec<usize> = (0..count).step_by(count.div_ceil(SAMPLES).max(1)).collect();
        let given = |pose: usize| self.channel_position(joint, bvh.pose(pose));
        let farthest = |from: DVec3| {
            samples.iter().map(|pose| (given(*pose) - from).length()).fold(0.0, f64::max)
        };
        let length = joint.offset.length();
        let is_bone = length > 0.02 * size && length <= size;
        if is_bone && farthest(DVec3::ZERO) < 0.25 * length {
            return Translation::Sum;
        }
        if farthest(joint.offset) <= CLOSE * size {
            return Translation::Channels;
        }
        let mut alone = self.clone();
        alone.joints[at].translation = Translation::Offset;
        let mut placed = Placed::default();
        let (mut from_world, mut from_offset) = (0.0, 0.0);
        for pose in &samples {
            alone.place(bvh.pose(*pose), &mut placed);
            from_world += (given(*pose) - placed.position[at]).length_squared();
            from_offset += (given(*pose) - joint.offset).length_squared();
        }
        let near_world = (from_world / samples.len() as f64).sqrt() < 2.0 * CLOSE * size;
        if near_world && from_world < 0.1 * from_offset {
            Translation::Offset
        } else {
            Translation::Channels
        }
    }

    /// The position channels of a joint; axes without a channel are taken from OFFSET.
    fn channel_position(&self, joint: &Joint, values: &[f64]) -> DVec3 {
        let mut position = joint.offset;
        for (at, axis) in &joint.positions {
            match axis {
                Axis::X => position.x = values[*at],
                Axis::Y => position.y = values[*at],
                Axis::Z => position.z = values[*at],
            }
        }
        position
    }

    /// Forward kinematics of one pose of the file.
    pub fn place(&self, values: &[f64], placed: &mut Placed) {
        placed.rotation.clear();
        placed.position.clear();
        for joint in &self.joints {
            let mut turn = DQuat::IDENTITY;
            for (at, axis) in &joint.rotations {
                turn *= DQuat::from_axis_angle(axis.unit(), values[*at].to_radians());
            }
            let shift = match joint.translation {
                Translation::Offset => joint.offset,
                Translation::Channels => self.channel_position(joint, values),
                Translation::Sum => {
                    let sum = |(at, axis): &(usize, Axis)| axis.unit() * values[*at];
                    joint.offset + joint.positions.iter().map(sum).sum::<DVec3>()
                }
            };
            let (rotation, position) = match joint.parent {
                None => (turn, shift),
                Some(parent) => {
                    let carried = placed.rotation[parent];
                    ((carried * turn).normalize(), placed.position[parent] + carried * shift)
                }
            };
            placed.rotation.push(rotation);
            placed.position.push(position);
        }
    }

    /// The skeleton as its OFFSETs alone draw it: all rotations zero, no position channels.
    pub fn place_at_zero(&self, placed: &mut Placed) {
        placed.rotation.clear();
        placed.position.clear();
        for joint in &self.joints {
            let from = joint.parent.map_or(DVec3::ZERO, |parent| placed.position[parent]);
            placed.rotation.push(DQuat::IDENTITY);
            placed.position.push(from + joint.offset);
        }
    }
}
