//! A robot as frames and what hangs on them.

use super::super::robot::{LinkShape, RobotTrack, Shape};
use super::super::scene::ViewScene;
use super::super::tracks::{JointTracks, ViewSpan};
use super::messages::{
    Block, Colour, FrameTransform, FrameTransforms, JointState, JointStates, LineKind, Pose,
    SceneEntity, SceneUpdate, Timestamp,
};
use super::{Between, Channel, GOOD, LINE_M, MASS, Stage, WORLD, WRONG, update};
use crate::body::contact::ON_FLOOR_M;
use crate::rigid::Placement;
use crate::rigid::ground::SupportPolygon;
use glam::{DQuat, DVec2, DVec3};
use std::collections::BTreeSet;
use std::io::{self, Write};

const BODY: Colour = Colour::new([0.55, 0.6, 0.66, 1.0]);
const GHOST: Colour = Colour::new([0.2, 0.5, 0.9, 0.3]);
/// Joints of robots without shapes, and what connects them, m.
const BALL_M: f64 = 0.01;
const ROD_M: f64 = 0.004;

/// Angles of a joint, rad, where they were looked at.
#[derive(Default)]
struct Angles {
    name: String,
    goal: Option<Vec<f64>>,
    present: Option<Vec<f64>>,
}

/// What is asked and what is.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Which {
    Present,
    Goal,
}

/// A robot on its stage.
pub(super) struct Actor<'a> {
    track: &'a RobotTrack,
    base_times_s: Vec<f64>,
    at: [Vec<f64>; 3],
    turn: [Vec<f64>; 4],
    joint_times_s: Vec<f64>,
    angles: Vec<Angles>,
    /// Times in which links are in one another.
    wrong: Vec<&'a ViewSpan>,
    /// Links that are drawn as wrong.
    red: BTreeSet<usize>,
    frames: Channel<FrameTransforms>,
    links: Channel<SceneUpdate>,
    balance: Channel<SceneUpdate>,
    present: Option<Channel<JointStates>>,
    goal: Option<Channel<JointStates>>,
    /// It is shown beside what it was asked.
    has_ghost: bool,
}

impl<'a> Actor<'a> {
    /// Tells what its links are made of.
    pub(super) fn new<W: Write>(
        stage: &mut Stage<W>,
        track: &'a RobotTrack,
        scene: &'a ViewScene,
    ) -> io::Result<Self> {
        let decoded = |joints: &JointTracks| -> Vec<Angles> {
            let of = |joint: &super::super::tracks::JointTrack| Angles {
                name: joint.name.clone(),
                goal: joint.goal.as_ref().map(|goal| goal.values()),
                present: joint.present.as_ref().map(|present| present.values()),
            };
            joints.joints.iter().map(of).collect()
        };
        let joints = scene.joints.as_ref();
        let angles = joints.map(decoded).unwrap_or_default();
        let has_goal = angles.iter().any(|angles| angles.goal.is_some());
        let has_present = angles.iter().any(|angles| angles.present.is_some());
        let mut told = |is: bool, topic: &str| is.then(|| stage.channel(topic)).transpose();
        let present = told(has_present, "/joints/present")?;
        let goal = told(has_goal, "/joints/goal")?;
        let mut actor = Self {
            track,
            base_times_s: track.clock.times_s(),
            at: [0, 1, 2].map(|axis| track.at[axis].values()),
            turn: [0, 1, 2, 3].map(|part| track.turn[part].values()),
            joint_times_s: joints.map(|joints| joints.clock.times_s()).unwrap_or_default(),
            angles,
            wrong: scene.spans.iter().filter(|span| !span.links.is_empty()).collect(),
            red: BTreeSet::new(),
            frames: stage.channel("/transforms")?,
            links: stage.channel("/scene/robot")?,
            balance: stage.channel("/scene/balance")?,
            present,
            goal,
            has_ghost: has_goal && has_present,
        };
        actor.red = actor.red_at(0.0);
        let every = |link: usize| actor.entity(link, Which::Present, stage.start_ns);
        let entities = (0..track.links.len()).map(every).collect();
        stage.tell(actor.links, 0.0, |_| SceneUpdate { entities })?;
        if actor.has_ghost {
            let goal = stage.channel::<SceneUpdate>("/scene/goal")?;
            let every = |link: usize| actor.entity(link, Which::Goal, stage.start_ns);
            let entities = (0..track.links.len()).map(every).collect();
            stage.tell(goal, 0.0, |_| SceneUpdate { entities })?;
        }
        Ok(actor)
    }

    fn frame(&self, link: usize, which: Which) -> String {
        let prefix = if which == Which::Goal { "goal/" } else { "" };
        format!("{prefix}{}", self.track.links[link].name)
    }

    /// Links that are in one another.
    fn red_at(&self, at_s: f64) -> BTreeSet<usize> {
        let now = self.wrong.iter().filter(|span| span.start_s <= at_s && at_s < span.end_s);
        now.flat_map(|span| span.links.iter().copied()).collect()
    }

    /// What a link is made of, in its frame.
    fn entity(&self, link: usize, which: Which, time_ns: u64) -> SceneEntity {
        let colour = match which {
            Which::Goal => GHOST,
            Which::Present if self.red.contains(&link) => WRONG,
            Which::Present => BODY,
        };
        let name = self.frame(link, which);
        let mut entity = SceneEntity::of(time_ns, &name, &name);
        for shape in &self.track.links[link].shapes {
            match shape {
                Shape::Capsule { from_m, to_m, radius_m } => {
                    entity.capsule([DVec3::from(*from_m), DVec3::from(*to_m)], *radius_m, colour);
                }
                Shape::Cuboid { centre_m, half_m, turn } => entity.cubes.push(Block {
                    pose: Pose::of(DVec3::from(*centre_m), quaternion(*turn)),
                    size: Some((DVec3::from(*half_m) * 2.0).into()),
                    color: Some(colour),
                }),
            }
        }
        // Joints without shapes are balls, with rods to the joints that hang on them.
        let is_bare = self.track.links.iter().all(|link| link.shapes.is_empty());
        if is_bare {
            entity.ball(DVec3::ZERO, BALL_M, colour);
            let children = self.track.links.iter().filter(|other| other.parent == Some(link));
            let ends_m = children.map(|child| DVec3::from(child.origin_m));
            ends_m.for_each(|end_m| entity.capsule([DVec3::ZERO, end_m], ROD_M, colour));
        }
        entity
    }

    /// Of each link the angle of its joint, rad.
    fn link_angles(&self, at: Between, which: Which) -> Vec<f64> {
        let mut angles_rad = vec![0.0; self.track.links.len()];
        for (joint, link) in self.angles.iter().zip(angles_rad.iter_mut().skip(1)) {
            let read = |series: &Option<Vec<f64>>| {
                let value = at.mixed(series.as_deref()?);
                value.is_finite().then_some(value)
            };
            let wanted = match which {
                Which::Present => read(&joint.present).or_else(|| read(&joint.goal)),
                Which::Goal => read(&joint.goal),
            };
            *link = wanted.unwrap_or(0.0);
        }
        for follows in &self.track.couplings {
            let sum = follows.of.iter().map(|(link, ratio)| angles_rad[*link] * ratio).sum::<f64>();
            angles_rad[follows.link] = sum + follows.offset_rad;
        }
        angles_rad
    }

    /// Of each link where it is in its parent, the base in the world.
    fn in_parents(&self, at_s: f64, which: Which) -> Vec<Placement> {
        let at = Between::of(&self.base_times_s, at_s);
        let part = |values: &Vec<f64>| at.mixed(values);
        let [x, y, z] = self.at.each_ref().map(part);
        let base = Placement {
            at_m: DVec3::new(x, y, z),
            turn: quaternion(self.turn.each_ref().map(part)),
        };
        let angles_rad = self.link_angles(Between::of(&self.joint_times_s, at_s), which);
        let of = |(link, angle_rad): (&LinkShape, f64)| {
            let axis = DVec3::from(link.axis);
            let turn = match axis.try_normalize() {
                Some(axis) => DQuat::from_axis_angle(axis, angle_rad),
                None => DQuat::IDENTITY,
            };
            Placement { at_m: DVec3::from(link.origin_m), turn }
        };
        let mut placed: Vec<Placement> = self.track.links.iter().zip(angles_rad).map(of).collect();
        for (link, placement) in self.track.links.iter().zip(&mut placed) {
            if link.parent.is_none() {
                *placement = base.then(*placement);
            }
        }
        placed
    }

    /// Tells where it is.
    pub(super) fn put<W: Write>(&mut self, stage: &mut Stage<W>, at_s: f64) -> io::Result<()> {
        let red = self.red_at(at_s);
        let changed: Vec<usize> = red.symmetric_difference(&self.red).copied().collect();
        if !changed.is_empty() {
            self.red = red;
            stage.tell(self.links, at_s, |ns| SceneUpdate {
                entities: changed
                    .into_iter()
                    .map(|link| self.entity(link, Which::Present, ns))
                    .collect(),
            })?;
        }
        let present = self.in_parents(at_s, Which::Present);
        stage.tell(self.frames, at_s, |ns| {
            let mut transforms = self.transforms(&present, Which::Present, ns);
            if self.has_ghost {
                let goal = self.in_parents(at_s, Which::Goal);
                transforms.extend(self.transforms(&goal, Which::Goal, ns));
            }
            FrameTransforms { transforms }
        })?;
        let at = Between::of(&self.joint_times_s, at_s);
        let states = |ns: u64, of: &dyn Fn(&Angles) -> Option<f64>| JointStates {
            timestamp: Some(Timestamp::of(ns)),
            joints: self
                .angles
                .iter()
                .map(|joint| JointState { name: joint.name.clone(), position: of(joint) })
                .collect(),
        };
        let read = |series: &Option<Vec<f64>>| {
            Some(at.mixed(series.as_deref()?)).filter(|value| value.is_finite())
        };
        if let Some(channel) = self.present {
            stage.tell(channel, at_s, |ns| states(ns, &|joint| read(&joint.present)))?;
        }
        if let Some(channel) = self.goal {
            stage.tell(channel, at_s, |ns| states(ns, &|joint| read(&joint.goal)))?;
        }
        stage.tell(self.balance, at_s, |ns| update(self.balanced(&present, ns)))
    }

    fn transforms(&self, placed: &[Placement], which: Which, time_ns: u64) -> Vec<FrameTransform> {
        let of = |(index, placement): (usize, &Placement)| FrameTransform {
            timestamp: Some(Timestamp::of(time_ns)),
            parent_frame_id: match self.track.links[index].parent {
                Some(parent) => self.frame(parent, which),
                None => WORLD.to_owned(),
            },
            child_frame_id: self.frame(index, which),
            translation: Some(placement.at_m.into()),
            rotation: Some(placement.turn.into()),
        };
        placed.iter().enumerate().map(of).collect()
    }

    /// Its centre of mass with a plumb line, and what the soles on the floor span.
    fn balanced(&self, in_parents: &[Placement], time_ns: u64) -> SceneEntity {
        let mut placed: Vec<Placement> = Vec::with_capacity(in_parents.len());
        for (link, placement) in self.track.links.iter().zip(in_parents) {
            let on = link.parent.and_then(|parent| placed.get(parent));
            placed.push(on.map_or(*placement, |on| on.then(*placement)));
        }
        let mut entity = SceneEntity::of(time_ns, WORLD, "balance");
        let links = || self.track.links.iter().zip(&placed);
        let mass_kg: f64 = links().map(|(link, _)| link.mass_kg).sum();
        if mass_kg > 0.0 {
            let moment =
                links().map(|(link, on)| on.point(DVec3::from(link.centre_m)) * link.mass_kg);
            let centre_m = moment.sum::<DVec3>() / mass_kg;
            entity.ball(centre_m, 2.0 * BALL_M, MASS);
            let ends_m = [centre_m, centre_m.with_z(0.0)];
            entity.line(LineKind::Strip, ends_m, LINE_M, MASS);
        }
        let corners = self.track.soles.iter().flat_map(|(link, corners_m)| {
            corners_m.iter().map(|corner_m| placed[*link].point(DVec3::from(*corner_m)))
        });
        let down: Vec<DVec2> = corners
            .filter(|corner_m| corner_m.z < ON_FLOOR_M)
            .map(|corner_m| corner_m.truncate())
            .collect();
        if !down.is_empty() {
            let support = SupportPolygon::of(&down);
            let corners_m = support.corners_m().iter().map(|corner_m| corner_m.extend(0.001));
            entity.line(LineKind::Loop, corners_m, LINE_M, GOOD);
        }
        entity
    }
}

/// A turn out of w, x, y, z as they were rounded.
fn quaternion([w, x, y, z]: [f64; 4]) -> DQuat {
    let turn = DQuat::from_xyzw(x, y, z, w);
    if turn.length_squared() > 1e-9 { turn.normalize() } else { DQuat::IDENTITY }
}
