//! Which links of a robot play which limb of a person, and how far they are off.
//!
//! Hands and feet are compared from shoulder and hip on, in the axes of the segment that the robot's base
//! plays, the person's as long as the robot's: what a robot of these lengths should reach.

use crate::body::{Joint, Proportions, Segment, SegmentPose};
use crate::mocap::retarget::{Hand, RobotModel};
use crate::rigid::Placement;
use crate::robot::RobotBody;
use glam::{DQuat, DVec3};

/// Proximal and distal segment of every limb: arms first.
const CHAINS: [[Segment; 2]; 4] = [
    [Segment::LeftUpperArm, Segment::LeftForearm],
    [Segment::RightUpperArm, Segment::RightForearm],
    [Segment::LeftThigh, Segment::LeftShank],
    [Segment::RightThigh, Segment::RightShank],
];

/// A link that plays a segment.
#[derive(Clone, Copy, Debug)]
struct Player {
    segment: Segment,
    link: usize,
    /// From the segment's axes to the link's.
    turn: DQuat,
}

/// An arm or a leg.
#[derive(Clone, Copy, Debug)]
struct Chain {
    segments: [Segment; 2],
    /// The first link, and where shoulder or hip is in its axes, m.
    root: (usize, DVec3),
    /// The last, and where the tip is in its axes, m.
    tip: (usize, DVec3),
    /// From the one to the other with the limb stretched, m.
    length_m: f64,
}

/// An arm of fewer joints than this cannot point both its links anywhere.
const WHOLE_ARM: usize = 4;

impl Chain {
    fn is_arm(&self) -> bool {
        matches!(self.segments[0], Segment::LeftUpperArm | Segment::RightUpperArm)
    }
}

/// The limbs of a robot.
#[derive(Clone, Debug)]
pub struct RobotLimbs {
    base: Vec<Segment>,
    players: Vec<Player>,
    chains: Vec<Chain>,
}

/// How far a robot is off a person in one pose.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LimbErrors {
    /// Angles between the long axes of segment and link, rad.
    pub directions_rad: Vec<(Segment, f64)>,
    /// Hands from where they should be, m.
    pub hands_m: Vec<f64>,
    /// Ankles from where they should be, m.
    pub feet_m: Vec<f64>,
    /// How much more or less than the person's the robot's trunk leans against the vertical, rad.
    pub trunk_lean_rad: Option<f64>,
}

impl RobotLimbs {
    /// Of a robot whose file says which links play what.
    #[must_use]
    pub fn of(model: &RobotModel, body: &RobotBody) -> Self {
        let placed = body.tree.place(Placement::IDENTITY, &body.angles(&model.n_pose_rad));
        let link_of = |segment: Segment| {
            let link = model.links.iter().find(|link| link.segment == segment)?;
            Some(link.joint + 1)
        };
        let player = |segment: Segment| {
            let link = link_of(segment)?;
            Some(Player { segment, link, turn: placed[link].turn.inverse() })
        };
        let chain = |segments: [Segment; 2]| {
            let [root, middle] = [link_of(segments[0])?, link_of(segments[1])?];
            let foot = match segments[1] {
                Segment::LeftShank => Some(Segment::LeftFoot),
                Segment::RightShank => Some(Segment::RightFoot),
                _ => None,
            };
            let tip_m = match foot.and_then(link_of) {
                Some(foot) => placed[foot].at_m,
                None => {
                    let along = segments[1].long_axis();
                    let reach_m = reach_m(body, &placed, middle, along);
                    placed[middle].at_m + along * reach_m
                }
            };
            // Joints lie beside the limb's line: shoulder and hip are where that line begins.
            let along = segments[1].long_axis();
            let length_m = (tip_m - placed[root].at_m).dot(along);
            let root_m = tip_m - along * length_m;
            let own = |link: usize, point_m: DVec3| (link, placed[link].inverse().point(point_m));
            let sound = length_m > 0.0;
            sound.then(|| Chain {
                segments,
                root: own(root, root_m),
                tip: own(middle, tip_m),
                length_m,
            })
        };
        Self {
            base: model.base.clone(),
            players: Segment::ALL.into_iter().filter_map(player).collect(),
            chains: CHAINS.into_iter().filter_map(chain).collect(),
        }
    }

    /// The segment that the base plays and that carries `segment`.
    fn reference(&self, segment: Segment) -> Segment {
        let mut carriers = std::iter::successors(Some(segment), |segment| segment.parent());
        let base = self.base.first().copied().unwrap_or(Segment::Pelvis);
        carriers.find(|carrier| self.base.contains(carrier)).unwrap_or(base)
    }

    /// How long the robot's legs are, hip to ankle, m, if it has legs.
    #[must_use]
    pub fn leg_m(&self) -> Option<f64> {
        let leg = self.chains.iter().find(|chain| chain.segments[0] == Segment::LeftThigh);
        leg.map(|leg| leg.length_m)
    }

    /// Hands of arms that lack an axis, and where a person's of these proportions would be.
    #[must_use]
    pub fn hands(&self, body: &RobotBody, lengths: &Proportions) -> Vec<Hand> {
        let arms: Vec<&Chain> = self.chains.iter().filter(|chain| chain.is_arm()).collect();
        let links = body.tree.links();
        let above = |link: usize| {
            let mut all: Vec<usize> =
                std::iter::successors(Some(link), |of| links[*of].parent).collect();
            all.retain(|link| *link != 0);
            all
        };
        let lacks = |arm: &&&Chain| {
            // What moves every arm is a waist.
            let shared = |link: &usize| {
                arms.len() > 1 && arms.iter().all(|other| above(other.tip.0).contains(link))
            };
            above(arm.tip.0).iter().filter(|link| !shared(link)).count() < WHOLE_ARM
        };
        let hand = |arm: &&Chain| {
            let parts = arm.segments.map(|segment| length_m(lengths, segment));
            let scale = arm.length_m / (parts[0] + parts[1]);
            let own = |(link, at_m): (usize, DVec3)| (link - 1, at_m);
            Hand {
                segments: arm.segments,
                shoulder: own(arm.root),
                hand: own(arm.tip),
                lengths_m: parts.map(|part| part * scale),
            }
        };
        arms.iter().filter(lacks).map(hand).collect()
    }

    /// How far a robot whose links are placed so is off a person in this pose.
    #[must_use]
    pub fn errors(
        &self,
        placed: &[Placement],
        person: &SegmentPose,
        lengths: &Proportions,
        tracked: &[bool; 13],
    ) -> LimbErrors {
        let base = placed[0];
        let back = base.turn.inverse();
        let turned = |segment: Segment| {
            let reference = person.orientation[self.reference(segment).index()];
            reference.inverse() * person.orientation[segment.index()] * segment.long_axis()
        };
        let mut errors = LimbErrors::default();
        for player in self.players.iter().filter(|player| tracked[player.segment.index()]) {
            let link = back * placed[player.link].turn * player.turn;
            let off_rad = (link * player.segment.long_axis()).angle_between(turned(player.segment));
            errors.directions_rad.push((player.segment, off_rad));
        }
        for chain in &self.chains {
            if chain.segments.iter().any(|segment| !tracked[segment.index()]) {
                continue;
            }
            let parts = chain.segments.map(|segment| length_m(lengths, segment));
            let scale = chain.length_m / (parts[0] + parts[1]);
            let wanted_m: DVec3 =
                [0, 1].map(|i| turned(chain.segments[i]) * parts[i] * scale).into_iter().sum();
            let tip_m = placed[chain.tip.0].point(chain.tip.1);
            let root_m = placed[chain.root.0].point(chain.root.1);
            let reached_m = back * (tip_m - root_m);
            let errors_m = if chain.is_arm() { &mut errors.hands_m } else { &mut errors.feet_m };
            errors_m.push(reached_m.distance(wanted_m));
        }
        errors.trunk_lean_rad =
            self.trunk(placed).filter(|_| tracked[Segment::Torso.index()]).map(|up| {
                let persons = person.orientation[Segment::Torso.index()] * DVec3::Z;
                (up.angle_between(DVec3::Z) - persons.angle_between(DVec3::Z)).abs()
            });
        errors
    }

    /// What the robot's base plays: the pelvis, if it plays more.
    #[must_use]
    pub fn base(&self) -> Segment {
        if self.base.contains(&Segment::Pelvis) { Segment::Pelvis } else { Segment::Torso }
    }

    /// Up along the robot's trunk, in the world.
    fn trunk(&self, placed: &[Placement]) -> Option<DVec3> {
        if self.base.contains(&Segment::Torso) {
            return Some(placed[0].turn * DVec3::Z);
        }
        let player = self.players.iter().find(|player| player.segment == Segment::Torso)?;
        Some(placed[player.link].turn * player.turn * DVec3::Z)
    }
}

/// How far a link and those it carries reach in a direction of the N pose, from its joint, m.
fn reach_m(body: &RobotBody, placed: &[Placement], link: usize, along: DVec3) -> f64 {
    let links = body.tree.links();
    let above = |of: usize| links[of].parent;
    let is_on = |of: usize| std::iter::successors(Some(of), |of| above(*of)).any(|of| of == link);
    let volumes = (link..links.len()).filter(|of| is_on(*of)).flat_map(|of| {
        body.volumes[of].iter().map(move |volume| volume.placed(placed[of]).reach_m(along))
    });
    let from_m = placed[link].at_m.dot(along);
    volumes.map(|reach_m| reach_m - from_m).fold(0.0, f64::max)
}

/// Length of a segment of a person, joint to joint, m.
fn length_m(lengths: &Proportions, segment: Segment) -> f64 {
    let joint = match segment {
        Segment::LeftUpperArm | Segment::RightUpperArm => Joint::LeftElbow,
        Segment::LeftForearm | Segment::RightForearm => Joint::LeftWrist,
        Segment::LeftThigh | Segment::RightThigh => Joint::LeftKnee,
        _ => Joint::LeftAnkle,
    };
    lengths.joint_offset_m(joint).map_or(0.0, |(_, offset_m)| offset_m.length())
}
