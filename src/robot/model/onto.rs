//! A model's links on a robot's joints: what hangs together between two of them is one link.
//!
//! Everything is looked at with all joints at zero and written in axes parallel to the base's, which
//! is how a robot file has its origins. So neither the model's own frames nor the signs of its joints
//! matter, only where the axes are.

use super::{LinkMesh, MovingJoint, PublicModel, shown, some};
use crate::error::{Error, ErrorKind, counted};
use crate::rigid::{JointKind, Mass, Placement, Volume};
use gaitway_profiles::{BaseKind, Robot, Yielding};
use glam::{DQuat, DVec3};

/// How far apart two axes may lie that are the same joint's, m.
const SAME_LINE_M: f64 = 1e-3;
/// How far their directions may be apart: the sine of it.
const SAME_WAY: f64 = 2e-3;
/// Most joints of one line.
const IDS_MAX: usize = 250;
/// What is at most so far above the lowest point stands on the floor, m.
const SOLE_M: f64 = 3e-3;

/// A joint of the robot and the link of the model that hangs on it.
#[derive(Clone, Debug, PartialEq)]
pub struct OwnJoint {
    /// Its name in the robot file.
    pub name: String,
    /// The model's link.
    pub link: usize,
    /// The joint of the robot that carries it.
    pub parent: Option<usize>,
    /// Where it is with everything at zero, from the base, m.
    pub at_m: DVec3,
    /// What it turns about.
    pub axis: DVec3,
    /// Its range, rad, and speed, rad/s, as far as the model says.
    pub range: Option<(f64, f64)>,
    /// Highest speed, rad/s.
    pub velocity_rad_s: Option<f64>,
    /// Other joints it follows, by index, with their ratios; empty: it is driven.
    pub follows: Vec<(usize, f64)>,
    /// Its angle with those at zero, rad.
    pub offset_rad: f64,
    /// How its servo holds it, if the model says so.
    pub holds: Option<Yielding>,
}

/// What moves with one joint of the robot, in axes parallel to the base's at zero, from that joint.
#[derive(Clone, Debug)]
pub struct ReducedLink {
    /// The joint, by index; nothing: the base.
    pub joint: Option<usize>,
    /// What it weighs.
    pub mass: Mass,
    /// What it takes up.
    pub volumes: Vec<Volume>,
    /// What it looks like.
    pub looks: Vec<LinkMesh>,
    /// Corners it stands on; none if it does not.
    pub sole_m: Vec<DVec3>,
}

/// A model, told in a robot's own joints.
#[derive(Clone, Debug)]
pub struct Reduced {
    /// Joints, each after the one that carries it; driven ones first.
    pub joints: Vec<OwnJoint>,
    /// Links, the base first.
    pub links: Vec<ReducedLink>,
    /// Joints of the model that are held at zero.
    pub held: Vec<String>,
    /// From the axes of the model's base to those of the robot's.
    pub turn: DQuat,
    /// What a person should know.
    pub notes: Vec<String>,
}

/// An axis in the base's axes with all joints at zero.
#[derive(Clone, Copy)]
struct Line {
    at_m: DVec3,
    along: DVec3,
}

impl PublicModel {
    fn zero(&self) -> Vec<Placement> {
        self.tree.place(Placement::IDENTITY, &vec![0.0; self.tree.moving()])
    }

    fn line(&self, joint: &MovingJoint, placed: &[Placement]) -> Line {
        let link = &self.tree.links()[joint.link];
        let placement = placed[joint.link];
        Line { at_m: placement.point(link.anchor_m), along: placement.turn * link.axis }
    }

    /// On joints of its own: those that something drives, and those that follow them.
    ///
    /// # Errors
    /// A chain that is closed and moves something a tree would leave limp, names that are the same.
    pub fn on_its_own(&self) -> Result<Reduced, Error> {
        let tree = &self.tree;
        let coupling = |link: usize| tree.couplings().iter().find(|of| of.link == link);
        let hinge = |joint: &&MovingJoint| tree.links()[joint.link].kind == JointKind::Hinge;
        let any_driven = self.joints.iter().any(|joint| joint.driven);
        let is_driven = |joint: &&MovingJoint| {
            hinge(joint) && coupling(joint.link).is_none() && (joint.driven || !any_driven)
        };
        let driven: Vec<&MovingJoint> = self.joints.iter().filter(is_driven).collect();
        let follows = |joint: &&MovingJoint| {
            let of = coupling(joint.link);
            let known = |(link, _): &(usize, f64)| driven.iter().any(|one| one.link == *link);
            hinge(joint) && of.is_some_and(|of| of.of.iter().all(known))
        };
        let followers = self.joints.iter().filter(follows);
        let taken: Vec<&MovingJoint> = driven.iter().copied().chain(followers).collect();
        if driven.len() > IDS_MAX {
            return Err(Error::of(ErrorKind::Malformed, "a line does not have this many IDs")
                .got(counted(driven.len(), "driven joint"))
                .allowed(format!("at most {IDS_MAX}")));
        }
        self.refuse_limp(&taken)?;
        let placed = self.zero();
        let owner = |link: usize| taken.iter().position(|joint| joint.link == link);
        let mut joints: Vec<OwnJoint> = Vec::with_capacity(taken.len());
        for joint in &taken {
            let line = self.line(joint, &placed);
            let above = tree.links()[joint.link].parent;
            let of = coupling(joint.link);
            let terms = of.map(|of| of.of.as_slice()).unwrap_or_default();
            joints.push(OwnJoint {
                name: usable_name(&joint.name),
                link: joint.link,
                parent: above.and_then(|link| self.owner_of(link, &owner)),
                at_m: line.at_m,
                axis: line.along,
                range: joint.range,
                velocity_rad_s: joint.velocity_rad_s,
                follows: terms.iter().filter_map(|&(l, r)| Some((owner(l)?, r))).collect(),
                offset_rad: of.map_or(0.0, |of| of.offset),
                holds: joint.holds,
            });
        }
        for (index, joint) in joints.iter().enumerate() {
            if joints[..index].iter().any(|earlier| earlier.name == joint.name) {
                return Err(Error::of(ErrorKind::Malformed, "two joints would have the same name")
                    .got(joint.name.clone()));
            }
            if let Some(parent) = joint.parent.filter(|parent| *parent >= index)
                && !joints[parent].follows.is_empty()
            {
                return Err(Error::new("a driven joint hangs on one that follows others")
                    .at(format!("joint {}", shown(&joint.name)))
                    .got(format!("carried by {}", shown(&joints[parent].name)))
                    .remedy("name a robot whose file has these joints as its own: --robot ROBOT"));
            }
        }
        Ok(self.reduced(joints, &placed))
    }

    /// In a closed chain a joint that nothing drives is moved by the chain: held still it would be
    /// wrong, so it must carry nothing that is driven.
    fn refuse_limp(&self, taken: &[&MovingJoint]) -> Result<(), Error> {
        if self.loops.is_empty() {
            return Ok(());
        }
        let is_taken = |link: usize| taken.iter().any(|joint| joint.link == link);
        let limp = self.joints.iter().find(|joint| {
            !is_taken(joint.link)
                && self.tree.coordinate(joint.link).is_some()
                && taken.iter().any(|below| self.above(below.link).any(|link| link == joint.link))
        });
        match limp {
            None => Ok(()),
            Some(joint) => Err(Error::new("a closed chain moves a joint that carries others")
                .at(format!("joint {}", shown(&joint.name)))
                .got(format!("closed by {}", some(&self.loops)))
                .remedy("name a robot whose file has that joint as its own: --robot ROBOT")),
        }
    }

    /// A link and all that carry it.
    fn above(&self, link: usize) -> impl Iterator<Item = usize> {
        std::iter::successors(Some(link), |link| self.tree.links()[*link].parent)
    }

    fn owner_of(&self, link: usize, owner: &dyn Fn(usize) -> Option<usize>) -> Option<usize> {
        self.above(link).find_map(owner)
    }

    /// Angles of all joints of the model: zero, but for those that are named, rad.
    ///
    /// # Errors
    /// A joint that the model does not have.
    pub fn posture(&self, named: &[(String, f64)]) -> Result<Vec<f64>, Error> {
        let mut angles = vec![0.0; self.tree.moving()];
        for (name, angle) in named {
            let at = self.joints.iter().position(|joint| joint.name == *name).ok_or_else(|| {
                let names: Vec<String> = self.joints.iter().map(|of| of.name.clone()).collect();
                Error::of(ErrorKind::Unknown, "the model has no joint of this name")
                    .got(shown(name))
                    .allowed(some(&names))
            })?;
            angles[at] = *angle;
        }
        Ok(angles)
    }

    /// On the joints of a robot file: each is the joint of the model with the same axis, once the model
    /// stands in `zero`, the posture in which the robot's joints are at zero.
    ///
    /// # Panics
    /// If `zero` is not as long as joints that move.
    ///
    /// # Errors
    /// A joint of the robot without a place, or with none of the model's on its axis, or several; one
    /// that hangs on another joint than in the model.
    pub fn onto(&self, robot: &Robot, zero: &[f64]) -> Result<Reduced, Error> {
        assert_eq!(zero.len(), self.tree.moving(), "an angle for every joint of the model");
        // Some models look along Y, or backwards: a quarter turn or two puts them right.
        let mut furthest: Option<(usize, Error)> = None;
        for quarters in 0..4_u32 {
            let angle = f64::from(quarters) * std::f64::consts::FRAC_PI_2;
            match self.turned_onto(robot, zero, DQuat::from_rotation_z(angle)) {
                Ok(mut found) => {
                    if quarters > 0 {
                        let turn = counted(90 * quarters, "degree");
                        found.notes.push(format!("the model is turned by {turn} about Z"));
                    }
                    return Ok(found);
                }
                Err((joints, refusal)) => {
                    if furthest.as_ref().is_none_or(|(most, _)| joints > *most) {
                        furthest = Some((joints, refusal));
                    }
                }
            }
        }
        Err(furthest.map_or_else(|| Error::new("the model does not fit"), |(_, refusal)| refusal))
    }

    /// As [`PublicModel::onto`] with the model turned; a refusal with the joints that fitted before.
    fn turned_onto(
        &self,
        robot: &Robot,
        zero: &[f64],
        turn: DQuat,
    ) -> Result<Reduced, (usize, Error)> {
        let base = Placement { at_m: DVec3::ZERO, turn };
        let placed = self.tree.place(base, zero);
        let mut joints: Vec<OwnJoint> = Vec::with_capacity(robot.joints.len());
        let mut mirrored = Vec::new();
        for joint in &robot.joints {
            let place = || format!("robot {}, joint {}", robot.name, joint.name);
            let (Some(origin_m), Some(axis)) = (joint.origin_m, joint.axis) else {
                let refusal =
                    Error::of(ErrorKind::Malformed, "the joint has no place in the robot");
                return Err((joints.len(), refusal.at(place()).allowed("origin_m and axis")));
            };
            let named = |name: &String| robot.joints.iter().position(|of| of.name == *name);
            let parent = joint.parent.as_ref().and_then(named).filter(|at| *at < joints.len());
            let from = parent.map_or(DVec3::ZERO, |at| joints[at].at_m);
            let line = Line { at_m: from + DVec3::from(origin_m), along: DVec3::from(axis) };
            let found = self.on_line(&joint.name, line, &placed);
            let found = found.map_err(|refusal| (joints.len(), refusal.at(place())))?;
            if self.line(found, &placed).along.dot(line.along) < 0.0 {
                mirrored.push(joint.name.clone());
            }
            joints.push(OwnJoint {
                name: joint.name.clone(),
                link: found.link,
                parent,
                at_m: line.at_m,
                axis: line.along,
                range: None,
                velocity_rad_s: None,
                follows: Vec::new(),
                offset_rad: 0.0,
                holds: found.holds,
            });
        }
        for (index, joint) in joints.iter().enumerate() {
            let owner = |link: usize| joints.iter().position(|of| of.link == link);
            let above = self.tree.links()[joint.link].parent;
            let carried = above.and_then(|link| self.owner_of(link, &owner));
            let called = |at: Option<usize>| at.map_or("the base", |at| joints[at].name.as_str());
            if carried != joints[index].parent {
                let refusal = Error::new("the joint hangs elsewhere in the model")
                    .at(format!("robot {}, joint {}", robot.name, joint.name))
                    .got(format!("on {}", called(carried)))
                    .allowed(format!("on {}", called(joint.parent)));
                return Err((joints.len() + index, refusal));
            }
        }
        let mut reduced = self.reduced(joints, &placed);
        if !mirrored.is_empty() {
            reduced.notes.push(format!("turn the other way in the model: {}", some(&mirrored)));
        }
        Ok(reduced)
    }

    fn on_line(&self, name: &str, line: Line, placed: &[Placement]) -> Result<&MovingJoint, Error> {
        let same = |joint: &&MovingJoint| {
            let other = self.line(joint, placed);
            self.tree.links()[joint.link].kind == JointKind::Hinge
                && other.along.cross(line.along).length() < SAME_WAY
                && (other.at_m - line.at_m).reject_from(line.along).length() < SAME_LINE_M
        };
        let here: Vec<&MovingJoint> = self.joints.iter().filter(same).collect();
        let alike = |joint: &&&MovingJoint| usable_name(&joint.name).contains(name);
        let exact = here.iter().find(|joint| joint.name == name);
        let alike: Vec<&&MovingJoint> = here.iter().filter(alike).collect();
        match (exact, alike.as_slice(), here.as_slice()) {
            (Some(joint), _, _) => Ok(joint),
            (None, [joint], _) => Ok(joint),
            // One of another name, unless the one of this name is elsewhere.
            (None, [], [joint]) if self.joint(name).is_none() => Ok(joint),
            (None, [], _) => Err(Error::new("the model has no joint on this axis")
                .got(match self.joint(name) {
                    Some(other) => {
                        let is = self.line(other, placed);
                        format!("{} at {:.4} about {:.4}", shown(name), is.at_m, is.along)
                    }
                    None => "no joint of this name either".to_owned(),
                })
                .allowed(format!("at {:.4} about {:.4}", line.at_m, line.along))
                .remedy("say in which posture the robot's joints are at zero: --zero JOINT=DEG")),
            _ => {
                let names: Vec<String> = here.iter().map(|joint| joint.name.clone()).collect();
                Err(Error::new("several joints of the model lie on this axis").got(some(&names)))
            }
        }
    }

    fn reduced(&self, joints: Vec<OwnJoint>, placed: &[Placement]) -> Reduced {
        let owner = |link: usize| joints.iter().position(|joint| joint.link == link);
        let base = ReducedLink {
            joint: None,
            mass: Mass::NONE,
            volumes: Vec::new(),
            looks: Vec::new(),
            sole_m: Vec::new(),
        };
        let mut links = vec![base.clone()];
        links.extend((0..joints.len()).map(|at| ReducedLink { joint: Some(at), ..base.clone() }));
        for (index, link) in self.tree.links().iter().enumerate() {
            let of = self.owner_of(index, &owner);
            let to = &mut links[of.map_or(0, |of| of + 1)];
            let from = of.map_or(DVec3::ZERO, |of| joints[of].at_m);
            let placement = Placement { at_m: placed[index].at_m - from, ..placed[index] };
            to.mass = to.mass.with(&link.mass.placed(placement));
            to.volumes.extend(self.volumes[index].iter().map(|volume| volume.placed(placement)));
            to.looks.extend(
                self.looks[index]
                    .iter()
                    .map(|of| LinkMesh { at: placement.then(of.at), ..of.clone() }),
            );
        }
        let is_taken = |joint: &&MovingJoint| owner(joint.link).is_none();
        let held: Vec<String> =
            self.joints.iter().filter(is_taken).map(|joint| joint.name.clone()).collect();
        let mut notes = self.notes.clone();
        if !held.is_empty() {
            notes.push(format!("held at zero, their links ride along: {}", some(&held)));
        }
        if !self.loops.is_empty() {
            let loops = some(&self.loops);
            notes.push(format!(
                "closed chains are opened, masses of their rods ride along: {loops}"
            ));
        }
        if self.base == BaseKind::Free {
            stand(&mut links, &joints);
        }
        Reduced { joints, links, held, turn: placed[0].turn, notes }
    }
}

/// Gives soles to the links that reach the floor with everything at zero.
fn stand(links: &mut [ReducedLink], joints: &[OwnJoint]) {
    let height = |link: &ReducedLink| link.joint.map_or(DVec3::ZERO, |at| joints[at].at_m);
    let lowest_of = |link: &ReducedLink| {
        let down = link.volumes.iter().map(|volume| volume.reach_m(-DVec3::Z));
        height(link).z - down.fold(f64::NEG_INFINITY, f64::max)
    };
    let lowest = links.iter().map(lowest_of).fold(f64::INFINITY, f64::min);
    for link in links {
        let floor = lowest + SOLE_M - height(link).z;
        let corners = link.volumes.iter().flat_map(|volume| volume.corners_m(-DVec3::Z));
        let mut sole: Vec<DVec3> = corners.filter(|corner| corner.z <= floor).collect();
        sole.dedup_by(|one, other| one.distance(*other) < 1e-6);
        if sole.len() >= 3 {
            link.sole_m = sole;
        }
    }
}

/// A name as a robot file has them: `[a-z0-9_]+`.
fn usable_name(name: &str) -> String {
    let usable = |c: char| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '_' };
    let name: String = name.chars().take(100).map(usable).collect();
    if name.is_empty() { "joint".to_owned() } else { name }
}
