//! A group of connected joints, and how well given angles fit a pose.

use super::{Hand, RobotModel, SegmentLink};
use crate::body::SegmentPose;
use glam::{DQuat, DVec3};
use nalgebra::{DMatrix, DVector};

/// Weight of the pull to the middle of the range, at its ends; 1 is as strong as a direction.
const MIDDLE_WEIGHT: f64 = 0.02;
/// Weight of a hand that is as far off as its arm is long; 1 is as much as a direction that is off by a radian.
const HAND_WEIGHT: f64 = 1.4;
/// Weight of an angle beyond its limit.
const LIMIT_WEIGHT: f64 = 6.0;
/// Distance from a limit at which that begins, rad: the room in which angles are bent later.
const LIMIT_MARGIN_RAD: f64 = 0.05;

/// A joint of a group.
struct Member {
    origin_m: DVec3,
    axis: DVec3,
    parent: Option<usize>,
    lower_rad: f64,
    upper_rad: f64,
}

impl Member {
    /// How far an angle is from the middle of the range, and half the range, rad.
    fn off_middle(&self, angle_rad: f64) -> (f64, f64) {
        let half_range = (self.upper_rad - self.lower_rad) / 2.0;
        (angle_rad - (self.lower_rad + half_range), half_range)
    }
}

/// A link of a group.
struct Player {
    link: SegmentLink,
    /// Index in the group of the last joint before the link, and those above it.
    chain: Vec<usize>,
    /// Inverse of the link's orientation in N pose.
    from_n_pose: DQuat,
}

/// A hand of a group.
struct Reacher {
    hand: Hand,
    /// Indices in the group of the last joints before shoulder and hand, and of those that move them.
    shoulder: usize,
    last: usize,
    shoulder_chain: Vec<usize>,
    chain: Vec<usize>,
    /// Indices of the links that play upper arm and forearm.
    links: [usize; 2],
}

/// Where a joint's link is: its orientation, its axis and its joint, base frame.
#[derive(Clone, Copy)]
struct Place {
    turn: DQuat,
    axis: DVec3,
    at_m: DVec3,
}

impl Place {
    fn point(&self, point_m: DVec3) -> DVec3 {
        self.at_m + self.turn * point_m
    }
}

/// Joints that share a root joint, as far as they move a link that plays a segment.
pub struct Group<'a> {
    model: &'a RobotModel,
    joints: Vec<usize>,
    members: Vec<Member>,
    players: Vec<Player>,
    reachers: Vec<Reacher>,
    links: Vec<SegmentLink>,
}

/// What a pose asks of a link: long axis and an axis across it, base frame.
#[derive(Clone, Copy, Debug)]
pub struct Target {
    along: DVec3,
    across: DVec3,
}

/// Normal equations of one pose: `hessian * step = -gradient`.
pub struct Normal {
    /// Half the second derivative of the cost, Gauss-Newton.
    pub hessian: DMatrix<f64>,
    /// Half its first derivative.
    pub gradient: DVector<f64>,
    /// The cost: sum of weighted squares.
    pub cost: f64,
}

/// Room for kinematics, kept from call to call.
#[derive(Default)]
pub struct Room {
    placed: Vec<Place>,
    columns: Vec<DVec3>,
}

impl<'a> Group<'a> {
    /// All groups of a robot that the given links call for.
    pub fn all(model: &'a RobotModel, links: &[SegmentLink]) -> Vec<Self> {
        let chain = |joint: usize| {
            let mut chain: Vec<usize> =
                std::iter::successors(Some(joint), |at| model.joints[*at].parent).collect();
            chain.reverse();
            chain
        };
        let mut roots: Vec<usize> = links.iter().map(|link| chain(link.joint)[0]).collect();
        roots.sort_unstable();
        roots.dedup();
        roots
            .into_iter()
            .map(|root| {
                let links: Vec<SegmentLink> =
                    links.iter().filter(|link| chain(link.joint)[0] == root).copied().collect();
                let mut joints: Vec<usize> = Vec::new();
                for joint in links.iter().flat_map(|link| chain(link.joint)) {
                    if !joints.contains(&joint) {
                        joints.push(joint);
                    }
                }
                Self::new(model, joints, links, chain)
            })
            .collect()
    }

    fn new(
        model: &'a RobotModel,
        joints: Vec<usize>,
        links: Vec<SegmentLink>,
        chain: impl Fn(usize) -> Vec<usize>,
    ) -> Self {
        let place = |joint: usize| joints.iter().position(|at| *at == joint);
        let members = joints
            .iter()
            .map(|joint| {
                let joint = &model.joints[*joint];
                Member {
                    origin_m: joint.origin_m,
                    axis: joint.axis,
                    parent: joint.parent.and_then(place),
                    lower_rad: joint.lower_rad,
                    upper_rad: joint.upper_rad,
                }
            })
            .collect();
        let players = links
            .iter()
            .map(|link| Player {
                link: *link,
                chain: chain(link.joint).into_iter().filter_map(place).collect(),
                from_n_pose: model.link_orientation(link.joint, &model.n_pose_rad).inverse(),
            })
            .collect();
        let reacher = |hand: &Hand| {
            let player = |segment| links.iter().position(|link| link.segment == segment);
            let inside =
                |joint: usize| chain(joint).into_iter().map(place).collect::<Option<Vec<usize>>>();
            Some(Reacher {
                hand: *hand,
                shoulder: place(hand.shoulder.0)?,
                last: place(hand.hand.0)?,
                shoulder_chain: inside(hand.shoulder.0)?,
                chain: inside(hand.hand.0)?,
                links: [player(hand.segments[0])?, player(hand.segments[1])?],
            })
        };
        let reachers = model.hands.iter().filter_map(reacher).collect();
        Self { model, joints, members, players, reachers, links }
    }

    /// Indices of the group's joints in the model; the order of every list of angles here.
    pub fn joints(&self) -> &[usize] {
        &self.joints
    }

    /// The links of the group.
    pub fn links(&self) -> &[SegmentLink] {
        &self.links
    }

    /// Middle of the range of each joint, rad.
    pub fn middles(&self) -> DVector<f64> {
        let middles = self.members.iter().map(|joint| (joint.lower_rad + joint.upper_rad) / 2.0);
        DVector::from_iterator(self.members.len(), middles)
    }

    /// Limits of a joint of the group, rad.
    pub fn limits(&self, row: usize) -> (f64, f64) {
        (self.members[row].lower_rad, self.members[row].upper_rad)
    }

    /// What a pose asks of the group's links.
    pub fn targets(&self, pose: &SegmentPose) -> Vec<Target> {
        let target = |link: &SegmentLink| {
            let turned = self.model.target(link.segment, pose);
            let (along, across) = axes(link);
            Target { along: turned * along, across: turned * across }
        };
        self.links.iter().map(target).collect()
    }

    /// Orientation of each joint's link and its axis, base frame.
    fn place(&self, angles: &DVector<f64>, placed: &mut Vec<Place>) {
        placed.clear();
        let base = Place { turn: DQuat::IDENTITY, axis: DVec3::ZERO, at_m: DVec3::ZERO };
        for (member, angle) in self.members.iter().zip(angles.iter()) {
            let carrier = member.parent.map_or(base, |parent| placed[parent]);
            placed.push(Place {
                turn: carrier.turn * DQuat::from_axis_angle(member.axis, *angle),
                axis: carrier.turn * member.axis,
                at_m: carrier.point(member.origin_m),
            });
        }
    }

    /// Angles between the long axes of links and segments, rad.
    pub fn direction_errors_rad(&self, angles: &[f64], pose: &SegmentPose) -> Vec<f64> {
        let mut placed = Vec::with_capacity(self.members.len());
        self.place(&DVector::from_column_slice(angles), &mut placed);
        let targets = self.targets(pose);
        let error = |(player, target): (&Player, &Target)| {
            let last = player.chain[player.chain.len() - 1];
            let turned = placed[last].turn * player.from_n_pose;
            (turned * axes(&player.link).0).angle_between(target.along)
        };
        self.players.iter().zip(&targets).map(error).collect()
    }

    /// The cost of angles against targets, with its derivatives: segments, hands, limits, and the
    /// faint pull to the middle of the ranges.
    pub fn normal(
        &self,
        angles: &DVector<f64>,
        targets: &[Target],
        normal: &mut Normal,
        room: &mut Room,
    ) {
        self.normal_without_middle(angles, targets, normal, room);
        let Room { placed, columns } = room;
        for of in &self.reachers {
            let Hand { shoulder, hand, lengths_m, .. } = of.hand;
            let shoulder_m = placed[of.shoulder].point(shoulder.1);
            let hand_m = placed[of.last].point(hand.1);
            let scale = 1.0 / (lengths_m[0] + lengths_m[1]);
            let wanted_m: DVec3 =
                of.links.iter().zip(lengths_m).map(|(at, m)| targets[*at].along * m).sum();
            columns.clear();
            columns.extend(of.chain.iter().map(|at| {
                let joint = &placed[*at];
                let from_m = if of.shoulder_chain.contains(at) { shoulder_m } else { joint.at_m };
                joint.axis.cross(hand_m - from_m) * scale
            }));
            let off = (hand_m - shoulder_m - wanted_m) * scale;
            normal.add(&of.chain, columns, off, HAND_WEIGHT.powi(2));
        }
        for (row, (member, angle)) in self.members.iter().zip(angles.iter()).enumerate() {
            let (off_middle, half_range) = member.off_middle(*angle);
            normal.add_single(row, off_middle, (MIDDLE_WEIGHT / half_range).powi(2));
        }
    }

    /// The same of segments and limits alone: zero where the robot does what the body does.
    ///
    /// Direction: the chord between the two unit vectors. Twist: the chord between the link's
    /// across axis and the segment's, after the latter has been swung the shortest way onto the
    /// link's long axis; to first order only the turn about the long axis changes it.
    pub fn normal_without_middle(
        &self,
        angles: &DVector<f64>,
        targets: &[Target],
        normal: &mut Normal,
        room: &mut Room,
    ) {
        let Room { placed, columns } = room;
        self.place(angles, placed);
        normal.hessian.fill(0.0);
        normal.gradient.fill(0.0);
        normal.cost = 0.0;
        for (player, target) in self.players.iter().zip(targets) {
            let last = player.chain[player.chain.len() - 1];
            let turned = placed[last].turn * player.from_n_pose;
            let (along, across) = axes(&player.link);
            let (along, across) = (turned * along, turned * across);
            columns.clear();
            columns.extend(player.chain.iter().map(|at| placed[*at].axis.cross(along)));
            let weight = player.link.direction_weight.powi(2);
            normal.add(&player.chain, columns, along - target.along, weight);
            if player.link.twist_weight > 0.0 {
                let swung = DQuat::from_rotation_arc(target.along, along) * target.across;
                let turn = along.cross(across);
                columns.clear();
                columns.extend(player.chain.iter().map(|at| turn * placed[*at].axis.dot(along)));
                let weight = player.link.twist_weight.powi(2);
                normal.add(&player.chain, columns, across - swung, weight);
            }
        }
        for (row, (member, angle)) in self.members.iter().zip(angles.iter()).enumerate() {
            let (off_middle, half_range) = member.off_middle(*angle);
            let beyond =
                (off_middle.abs() - half_range + LIMIT_MARGIN_RAD).max(0.0) * off_middle.signum();
            if beyond != 0.0 {
                normal.add_single(row, beyond, LIMIT_WEIGHT.powi(2));
            }
        }
    }
}

impl Normal {
    /// Room for a group.
    pub fn new(size: usize) -> Self {
        Self { hessian: DMatrix::zeros(size, size), gradient: DVector::zeros(size), cost: 0.0 }
    }

    fn add(&mut self, rows: &[usize], columns: &[DVec3], residual: DVec3, weight: f64) {
        self.cost += weight * residual.length_squared();
        for (row, column) in rows.iter().zip(columns) {
            self.gradient[*row] += weight * column.dot(residual);
            for (other, other_column) in rows.iter().zip(columns) {
                self.hessian[(*row, *other)] += weight * column.dot(*other_column);
            }
        }
    }

    /// Adds a term in one angle alone, of slope one.
    pub fn add_single(&mut self, row: usize, residual: f64, weight: f64) {
        self.cost += weight * residual * residual;
        self.gradient[row] += weight * residual;
        self.hessian[(row, row)] += weight;
    }
}

/// Long axis of a link's segment and an axis across it, anatomical frame.
fn axes(link: &SegmentLink) -> (DVec3, DVec3) {
    (link.segment.long_axis(), DVec3::Y)
}
