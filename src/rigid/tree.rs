//! A tree of links: where they are, what a point of them does when a joint turns, and which forces a
//! motion takes (recursive Newton-Euler; R. Featherstone, Rigid Body Dynamics Algorithms, 2008, chapter
//! 5, written out in world coordinates).

use crate::error::{Error, ErrorKind};
use crate::rigid::mass::Mass;
use glam::{DMat3, DQuat, DVec3};
use nalgebra::Matrix6xX;

/// Most links of a tree.
pub const LINKS_MAX: usize = 1000;
/// How far the length of an axis or of a quaternion may be from 1.
const UNIT_TOLERANCE: f64 = 1e-6;
/// How far below zero rounding may take a moment of inertia, as a share of the largest.
const ROUNDING: f64 = 1e-9;

/// Where something is and how it is turned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Its origin, m.
    pub at_m: DVec3,
    /// From its own axes to those it is placed in.
    pub turn: DQuat,
}

impl Placement {
    /// At the origin, unturned.
    pub const IDENTITY: Self = Self { at_m: DVec3::ZERO, turn: DQuat::IDENTITY };

    /// At this point, unturned.
    #[must_use]
    pub const fn at(at_m: DVec3) -> Self {
        Self { at_m, turn: DQuat::IDENTITY }
    }

    /// What is placed in this one, in the axes this one is placed in.
    #[must_use]
    pub fn then(self, inner: Self) -> Self {
        Self { at_m: self.point(inner.at_m), turn: self.turn * inner.turn }
    }

    /// A point of this one's own, outside.
    #[must_use]
    pub fn point(self, point_m: DVec3) -> DVec3 {
        self.at_m + self.turn * point_m
    }

    /// The way back.
    #[must_use]
    pub fn inverse(self) -> Self {
        let turn = self.turn.inverse();
        Self { at_m: -(turn * self.at_m), turn }
    }
}

/// How a link hangs on its parent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JointKind {
    /// It does not move there.
    Fixed,
    /// It turns about an axis, rad.
    Hinge,
    /// It slides along an axis, m.
    Slide,
}

impl Mass {
    /// The same mass, seen from the axes its link is placed in.
    #[must_use]
    pub fn placed(&self, placement: Placement) -> Self {
        let turn = DMat3::from_quat(placement.turn);
        Self {
            mass_kg: self.mass_kg,
            centre_m: placement.point(self.centre_m),
            inertia_kg_m2: turn * self.inertia_kg_m2 * turn.transpose(),
        }
    }

    fn check(&self) -> Result<(), Error> {
        let refuse = |what: &str| Error::of(ErrorKind::Malformed, what);
        if !(self.mass_kg.is_finite() && self.mass_kg >= 0.0) {
            return Err(refuse("this cannot be a mass")
                .got(format!("{} kg", self.mass_kg))
                .allowed("0 or more"));
        }
        if !(self.centre_m.is_finite() && self.inertia_kg_m2.is_finite()) {
            return Err(refuse("a centre of mass or an inertia is not a number")
                .got(format!("{}, {}", self.centre_m, self.inertia_kg_m2))
                .allowed("finite numbers"));
        }
        let matrix = self.inertia_kg_m2;
        let largest = matrix.to_cols_array().into_iter().fold(0.0, |a: f64, b| a.max(b.abs()));
        let skew = matrix - matrix.transpose();
        let skewed = skew.to_cols_array().into_iter().fold(0.0, |a: f64, b| a.max(b.abs()));
        if skewed > ROUNDING * largest {
            return Err(refuse("the inertia is not symmetric").got(matrix.to_string()));
        }
        let [least, ..] = self.moments_kg_m2();
        if !(least >= -ROUNDING * largest) {
            return Err(refuse("a body cannot have a negative moment of inertia")
                .got(format!("{least} kg m²"))
                .allowed("0 or more about every axis"));
        }
        if self.mass_kg == 0.0 && largest > 0.0 {
            return Err(refuse("a body without mass cannot have inertia")
                .got(format!("0 kg, {largest} kg m²")));
        }
        Ok(())
    }
}

/// A link and the joint it hangs on.
#[derive(Clone, Debug, PartialEq)]
pub struct TreeLink {
    /// What it is called.
    pub name: String,
    /// An earlier link; of the first link alone there is none.
    pub parent: Option<usize>,
    /// How it hangs there.
    pub kind: JointKind,
    /// Where it is in its parent with the joint at zero.
    pub origin: Placement,
    /// What it turns about or slides along: of unit length, in its own axes.
    pub axis: DVec3,
    /// A point of that axis in its own axes, m.
    pub anchor_m: DVec3,
    /// What it weighs.
    pub mass: Mass,
}

/// A joint that others move: its angle is the sum of theirs, each times its ratio, and the offset.
#[derive(Clone, Debug, PartialEq)]
pub struct Coupling {
    /// Index of the link that hangs on it.
    pub link: usize,
    /// The links whose joints move it, and its angle for one radian of each.
    pub of: Vec<(usize, f64)>,
    /// Its angle when those are at zero.
    pub offset: f64,
}

/// A tree of links that hold together: finite, each after its parent.
#[derive(Clone, Debug, PartialEq)]
pub struct Tree {
    links: Vec<TreeLink>,
    couplings: Vec<Coupling>,
    /// Place of each link's joint among those that move; nothing for a fixed one.
    coordinate: Vec<Option<usize>>,
    moving: usize,
}

/// A moment of a motion: where the base is, what it does, and what every joint does (rad or m).
#[derive(Clone, Debug, PartialEq)]
pub struct TreeMotion {
    /// Where the first link is in the world.
    pub base: Placement,
    /// Velocity of its origin in the world, m/s.
    pub velocity_m_s: DVec3,
    /// How fast it turns, in the world's axes, rad/s.
    pub spin_rad_s: DVec3,
    /// Acceleration of its origin, m/s².
    pub acceleration_m_s2: DVec3,
    /// How fast its spin changes, rad/s².
    pub spin_rate_rad_s2: DVec3,
    /// Angle of every joint that moves, in the order of links.
    pub angles: Vec<f64>,
    /// First derivative of the angles.
    pub rates: Vec<f64>,
    /// Second derivative.
    pub accelerations: Vec<f64>,
}

impl TreeMotion {
    /// At rest in the world with these angles.
    #[must_use]
    pub fn at_rest(base: Placement, angles: Vec<f64>) -> Self {
        let still = vec![0.0; angles.len()];
        Self {
            base,
            velocity_m_s: DVec3::ZERO,
            spin_rad_s: DVec3::ZERO,
            acceleration_m_s2: DVec3::ZERO,
            spin_rate_rad_s2: DVec3::ZERO,
            angles,
            rates: still.clone(),
            accelerations: still,
        }
    }
}

/// What a motion takes.
#[derive(Clone, Debug, PartialEq)]
pub struct Efforts {
    /// Force on the base from outside, in the world, N: what a stand, or the floor, has to give.
    pub base_force_n: DVec3,
    /// Torque on it about its origin, N m.
    pub base_torque_nm: DVec3,
    /// Torque (N m) or force (N) in every joint that moves.
    pub joints: Vec<f64>,
}

impl Tree {
    /// Takes links, each after its parent.
    ///
    /// # Errors
    /// No links or more than [`LINKS_MAX`], a link before its parent or a second one without, an axis
    /// that is not of unit length, numbers that are not finite, a mass or an inertia that no body has, a
    /// coupling of joints that do not move or are coupled themselves.
    pub fn new(links: Vec<TreeLink>, couplings: Vec<Coupling>) -> Result<Self, Error> {
        if links.is_empty() || links.len() > LINKS_MAX {
            return Err(Error::of(ErrorKind::Malformed, "this many links are no body")
                .got(links.len().to_string())
                .allowed(format!("1..{LINKS_MAX}")));
        }
        for (index, link) in links.iter().enumerate() {
            check(index, link).map_err(|e| e.at(format!("link {}", link.name)))?;
        }
        let mut moving = 0;
        let mut coordinate = Vec::with_capacity(links.len());
        for link in &links {
            coordinate.push((link.kind != JointKind::Fixed).then_some(moving));
            moving += usize::from(link.kind != JointKind::Fixed);
        }
        let tree = Self { links, couplings, coordinate, moving };
        tree.check_couplings()?;
        Ok(tree)
    }

    fn check_couplings(&self) -> Result<(), Error> {
        let moves = |link: usize| self.coordinate.get(link).copied().flatten().is_some();
        let mut coupled = vec![false; self.links.len()];
        for coupling in &self.couplings {
            let sound = moves(coupling.link)
                && coupling.offset.is_finite()
                && !coupling.of.is_empty()
                && coupling.of.iter().all(|&(of, ratio)| moves(of) && ratio.is_finite());
            if !sound || std::mem::replace(&mut coupled[coupling.link], true) {
                return Err(Error::of(ErrorKind::Malformed, "these joints cannot be coupled")
                    .got(format!("{coupling:?}"))
                    .allowed("a joint that moves, coupled once, to others that move"));
            }
        }
        let chained = |coupling: &Coupling| coupling.of.iter().any(|&(of, _)| coupled[of]);
        if let Some(coupling) = self.couplings.iter().find(|coupling| chained(coupling)) {
            return Err(Error::of(ErrorKind::Malformed, "a joint follows one that follows itself")
                .at(format!("link {}", self.links[coupling.link].name))
                .allowed("joints that are moved, not coupled"));
        }
        Ok(())
    }

    /// The links, each after its parent.
    #[must_use]
    pub fn links(&self) -> &[TreeLink] {
        &self.links
    }

    /// Joints that others move.
    #[must_use]
    pub fn couplings(&self) -> &[Coupling] {
        &self.couplings
    }

    /// Index of the link of this name.
    #[must_use]
    pub fn link(&self, name: &str) -> Option<usize> {
        self.links.iter().position(|link| link.name == name)
    }

    /// How many joints move.
    #[must_use]
    pub const fn moving(&self) -> usize {
        self.moving
    }

    /// Place of a link's joint in lists of angles; nothing if it does not move.
    #[must_use]
    pub fn coordinate(&self, link: usize) -> Option<usize> {
        self.coordinate.get(link).copied().flatten()
    }

    /// The same angles with every coupled joint where its own joints take it.
    ///
    /// # Panics
    /// If `angles` are not as many as joints that move.
    #[must_use]
    pub fn coupled(&self, angles: &[f64]) -> Vec<f64> {
        self.follow(angles, 1.0)
    }

    /// As [`Tree::coupled`] for first or second derivatives.
    ///
    /// # Panics
    /// If `rates` are not as many as joints that move.
    #[must_use]
    pub fn coupled_rates(&self, rates: &[f64]) -> Vec<f64> {
        self.follow(rates, 0.0)
    }

    fn follow(&self, values: &[f64], offsets: f64) -> Vec<f64> {
        assert_eq!(values.len(), self.moving, "a value for every joint that moves");
        let mut all = values.to_vec();
        for coupling in &self.couplings {
            let follows: f64 =
                coupling.of.iter().map(|&(of, ratio)| ratio * self.value(of, values)).sum();
            if let Some(at) = self.coordinate[coupling.link] {
                all[at] = follows + offsets * coupling.offset;
            }
        }
        all
    }

    /// What the joints that move others have to give for all: efforts of coupled joints, each times its
    /// ratio, added to theirs, and nothing left in the coupled ones.
    ///
    /// # Panics
    /// If `efforts` are not as many as joints that move.
    #[must_use]
    pub fn gathered(&self, efforts: &[f64]) -> Vec<f64> {
        assert_eq!(efforts.len(), self.moving, "a value for every joint that moves");
        let mut all = efforts.to_vec();
        for coupling in &self.couplings {
            let effort = self.value(coupling.link, efforts);
            for &(of, ratio) in &coupling.of {
                if let Some(at) = self.coordinate[of] {
                    all[at] += ratio * effort;
                }
            }
            if let Some(at) = self.coordinate[coupling.link] {
                all[at] = 0.0;
            }
        }
        all
    }

    fn value(&self, link: usize, values: &[f64]) -> f64 {
        self.coordinate[link].map_or(0.0, |at| values[at])
    }

    /// Where every link is.
    ///
    /// # Panics
    /// If `angles` are not as many as joints that move.
    #[must_use]
    pub fn place(&self, base: Placement, angles: &[f64]) -> Vec<Placement> {
        assert_eq!(angles.len(), self.moving, "an angle for every joint that moves");
        let mut placed: Vec<Placement> = Vec::with_capacity(self.links.len());
        for (index, link) in self.links.iter().enumerate() {
            let origin = link.parent.map_or(base, |parent| placed[parent]).then(link.origin);
            placed.push(match link.kind {
                JointKind::Fixed => origin,
                JointKind::Slide => {
                    origin.then(Placement::at(link.axis * self.value(index, angles)))
                }
                JointKind::Hinge => {
                    let turn = DQuat::from_axis_angle(link.axis, self.value(index, angles));
                    let at_m = link.anchor_m - turn * link.anchor_m;
                    origin.then(Placement { at_m, turn })
                }
            });
        }
        placed
    }

    /// What a point of a link does for every joint that moves: the first three rows its velocity, the
    /// others the link's spin, in the world, for a rate of 1. `point_m` is in the world.
    ///
    /// A base that moves adds its velocity, its spin, and spin × (point − base).
    ///
    /// # Panics
    /// If `placed` is not from [`Tree::place`] or there is no such link.
    #[must_use]
    pub fn jacobian(&self, placed: &[Placement], link: usize, point_m: DVec3) -> Matrix6xX<f64> {
        let mut found = Matrix6xX::zeros(self.moving);
        let mut next = Some(link);
        while let Some(index) = next {
            let of = &self.links[index];
            if let Some(at) = self.coordinate[index] {
                // The axis does not move with its own joint.
                let axis = placed[index].turn * of.axis;
                let (velocity, spin) = match of.kind {
                    JointKind::Hinge => {
                        (axis.cross(point_m - placed[index].point(of.anchor_m)), axis)
                    }
                    JointKind::Slide | JointKind::Fixed => (axis, DVec3::ZERO),
                };
                let column = [velocity.x, velocity.y, velocity.z, spin.x, spin.y, spin.z];
                found.set_column(at, &nalgebra::Vector6::from(column));
            }
            next = of.parent;
        }
        found
    }

    /// What everything weighs, kg.
    #[must_use]
    pub fn mass_kg(&self) -> f64 {
        self.links.iter().map(|link| link.mass.mass_kg).sum()
    }

    /// Centre of mass of all links in the world, m; the base's origin if they weigh nothing.
    ///
    /// # Panics
    /// If `placed` is not from [`Tree::place`].
    #[must_use]
    pub fn centre_of_mass_m(&self, placed: &[Placement]) -> DVec3 {
        let mass_kg = self.mass_kg();
        if mass_kg <= 0.0 {
            return placed[0].at_m;
        }
        let moments = self.links.iter().zip(placed);
        let moment: DVec3 = moments
            .map(|(link, placement)| placement.point(link.mass.centre_m) * link.mass.mass_kg)
            .sum();
        moment / mass_kg
    }

    /// The forces that make this motion, under this gravity (m/s²; (0, 0, -9.81) with Z up).
    ///
    /// # Panics
    /// If the motion's lists are not as long as joints that move.
    #[must_use]
    pub fn inverse_dynamics(&self, motion: &TreeMotion, gravity_m_s2: DVec3) -> Efforts {
        assert_eq!(motion.rates.len(), self.moving, "a rate for every joint that moves");
        assert_eq!(motion.accelerations.len(), self.moving, "an acceleration for every joint");
        let placed = self.place(motion.base, &motion.angles);
        let moved = self.outward(motion, gravity_m_s2, &placed);
        // Inward: what each link passes on to its parent, about its own origin.
        let mut carried = vec![(DVec3::ZERO, DVec3::ZERO); self.links.len()];
        let mut joints = vec![0.0; self.moving];
        for (index, link) in self.links.iter().enumerate().rev() {
            let (placement, state) = (placed[index], &moved[index]);
            let (own_force, own_torque) = weight(link, placement, state);
            let (children_force, children_torque) = carried[index];
            let (force, torque) = (own_force + children_force, own_torque + children_torque);
            carried[index] = (force, torque);
            let axis = placement.turn * link.axis;
            if let Some(at) = self.coordinate[index] {
                let arm = placement.at_m - placement.point(link.anchor_m);
                joints[at] = match link.kind {
                    JointKind::Hinge => axis.dot(torque + arm.cross(force)),
                    JointKind::Slide | JointKind::Fixed => axis.dot(force),
                };
            }
            if let Some(parent) = link.parent {
                let arm = placement.at_m - placed[parent].at_m;
                carried[parent].0 += force;
                carried[parent].1 += torque + arm.cross(force);
            }
        }
        let (force, torque) = carried[0];
        let arm = placed[0].at_m - motion.base.at_m;
        Efforts { base_force_n: force, base_torque_nm: torque + arm.cross(force), joints }
    }

    /// Spins and accelerations of all links, from the base outward.
    fn outward(
        &self,
        motion: &TreeMotion,
        gravity_m_s2: DVec3,
        placed: &[Placement],
    ) -> Vec<Moved> {
        let base = Moved {
            spin: motion.spin_rad_s,
            spin_rate: motion.spin_rate_rad_s2,
            // A body that is held against gravity is one that is accelerated upwards without.
            acceleration: motion.acceleration_m_s2 - gravity_m_s2,
        };
        let mut moved: Vec<Moved> = Vec::with_capacity(self.links.len());
        for (index, link) in self.links.iter().enumerate() {
            let (parent, from) = match link.parent {
                Some(parent) => (moved[parent], placed[parent].at_m),
                None => (base, motion.base.at_m),
            };
            let placement = placed[index];
            let axis = placement.turn * link.axis;
            let rate = self.value(index, &motion.rates);
            let acceleration = self.value(index, &motion.accelerations);
            moved.push(match link.kind {
                JointKind::Fixed => parent.at(placement.at_m - from),
                JointKind::Slide => {
                    let carried = parent.at(placement.at_m - from);
                    let own = 2.0 * rate * parent.spin.cross(axis) + axis * acceleration;
                    Moved { acceleration: carried.acceleration + own, ..carried }
                }
                JointKind::Hinge => {
                    let anchor = placement.point(link.anchor_m);
                    let at_anchor = parent.at(anchor - from);
                    let turned = Moved {
                        spin: parent.spin + axis * rate,
                        spin_rate: parent.spin_rate
                            + parent.spin.cross(axis) * rate
                            + axis * acceleration,
                        ..at_anchor
                    };
                    turned.at(placement.at_m - anchor)
                }
            });
        }
        moved
    }
}

/// How a link moves, in the world.
#[derive(Clone, Copy)]
struct Moved {
    spin: DVec3,
    spin_rate: DVec3,
    /// Of its origin.
    acceleration: DVec3,
}

impl Moved {
    /// The same body at a point of it that is `arm` away.
    fn at(self, arm: DVec3) -> Self {
        let acceleration =
            self.acceleration + self.spin_rate.cross(arm) + self.spin.cross(self.spin.cross(arm));
        Self { acceleration, ..self }
    }
}

/// Force and torque, about its origin, that move one link alone.
fn weight(link: &TreeLink, placement: Placement, state: &Moved) -> (DVec3, DVec3) {
    let arm = placement.turn * link.mass.centre_m;
    let force = state.at(arm).acceleration * link.mass.mass_kg;
    let turn = DMat3::from_quat(placement.turn);
    let inertia = turn * link.mass.inertia_kg_m2 * turn.transpose();
    let torque = inertia * state.spin_rate + state.spin.cross(inertia * state.spin);
    (force, torque + arm.cross(force))
}

fn check(index: usize, link: &TreeLink) -> Result<(), Error> {
    let refuse = |what: &str| Error::of(ErrorKind::Malformed, what);
    if link.parent.is_none() != (index == 0) || link.parent.is_some_and(|of| of >= index) {
        return Err(refuse("a link must come after its parent, and only the first has none")
            .got(format!("link {index}, parent {:?}", link.parent)));
    }
    if link.parent.is_none() && link.kind != JointKind::Fixed {
        return Err(refuse("the first link hangs on nothing and cannot have a joint"));
    }
    let finite = link.origin.at_m.is_finite()
        && link.origin.turn.is_finite()
        && link.axis.is_finite()
        && link.anchor_m.is_finite();
    let is_unit = |length: f64| (length - 1.0).abs() <= UNIT_TOLERANCE;
    let has_axis = link.kind == JointKind::Fixed || is_unit(link.axis.length());
    if !(finite && is_unit(link.origin.turn.length()) && has_axis) {
        return Err(refuse("the place of a joint, its turn or its axis is not usable")
            .got(format!("{}, {}, axis {}", link.origin.at_m, link.origin.turn, link.axis))
            .allowed("finite numbers; turn and axis of length 1"));
    }
    link.mass.check()
}

#[cfg(test)]
mod tests;
