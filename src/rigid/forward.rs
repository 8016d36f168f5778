//! What a tree of links on a level floor does while its joints are pulled to where they should be: forward dynamics, step by
//! step.
//!
//! Masses by composite bodies, what moves by itself by inverse dynamics (Featherstone, Rigid Body Dynamics Algorithms, 2008, 6.2
//! and 5.3). Joints are springs with dampers between goal and link, the floor is one under each corner that is below it, with
//! Coulomb's friction. All of them are taken at the end of a step (linearly implicit Euler), so that stiff ones do not shake.

use super::shape::WayOut;
use super::tree::{JointKind, Placement, Tree, TreeMotion};
use glam::{DMat3, DQuat, DVec3};
use nalgebra::{DMatrix, DVector};

/// How deep a body at rest is in the floor with a quarter of its weight on a corner, m.
const SINKS_M: f64 = 0.0001;
/// The floor's damping, as a part of its stiffness, s.
const FLOOR_S: f64 = 0.004;
/// How often a step is solved again because a corner leaves the floor or slips.
const PASSES: usize = 4;
/// A joint that turns more slowly sticks, as far as its friction can tell, rad/s.
const STICKS_RAD_S: f64 = 0.002;

/// How joints pull.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drive {
    /// Torque for a radian between goal and joint, N m/rad.
    pub stiffness_nm_rad: f64,
    /// Torque against a speed of a radian a second, N m s/rad.
    pub damping_nm_s_rad: f64,
    /// What turns with the motor, seen from the joint, kg m².
    pub armature_kg_m2: f64,
    /// Torque against any motion, however slow, N m.
    pub friction_nm: f64,
    /// Most torque, N m.
    pub torque_nm: f64,
}

/// What is done to a joint in a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pull {
    /// Torque while it stands still, N m.
    pub torque_nm: f64,
    /// How much less it is for a speed of a radian a second, N m s/rad.
    pub gives_nm_s_rad: f64,
    /// What turns with the motor, seen from the joint, kg m².
    pub armature_kg_m2: f64,
}

/// A corner of a link that may lie on the floor.
#[derive(Clone, Debug)]
struct Corner {
    link: usize,
    at_m: DVec3,
    /// Where it sticks to the floor, while it is below it.
    sticks_m: Option<DVec3>,
}

/// How a corner meets the floor in a step.
#[derive(Clone, Copy, PartialEq)]
enum Meets {
    Not,
    Sticks,
    /// With this force along the floor.
    Slips(DVec3),
}

/// Two links of a tree that are in one another, and may press.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinkContact {
    /// Which.
    pub links: (usize, usize),
    /// Where, and how the second gets out of the first.
    pub way: WayOut,
    /// How hard they pressed in the last step, N.
    pub force_n: f64,
}

/// A tree that moves.
#[derive(Clone, Debug)]
pub struct Moving {
    tree: Tree,
    /// Its first link is screwed down.
    is_fixed: bool,
    friction: f64,
    gravity_m_s2: f64,
    /// Down, of length 1: on a slope not straight into the floor.
    down: DVec3,
    /// Forces from outside, each at the centre of mass of a link, N.
    forces_n: Vec<(usize, DVec3)>,
    corners: Vec<Corner>,
    contacts: Vec<LinkContact>,
    /// Joints that move by themselves, and how each that moves follows them: `[coordinate][own]`.
    own: Vec<usize>,
    follows: DMatrix<f64>,
    motion: TreeMotion,
}

/// Mass of a link and all it carries, about the base's origin.
#[derive(Clone, Copy, Default)]
struct Composite {
    mass_kg: f64,
    moment: DVec3,
    inertia: DMat3,
}

impl Composite {
    fn add(&mut self, other: &Self) {
        self.mass_kg += other.mass_kg;
        self.moment += other.moment;
        self.inertia += other.inertia;
    }

    /// Momentum and angular momentum of a motion: velocity at the base's origin, and spin.
    fn momentum(&self, (velocity, spin): (DVec3, DVec3)) -> (DVec3, DVec3) {
        (
            velocity * self.mass_kg + spin.cross(self.moment),
            self.moment.cross(velocity) + self.inertia * spin,
        )
    }
}

impl Moving {
    /// A tree at rest: where its first link is, its angles (coupled ones follow), and the corners it may stand on, each with its link.
    ///
    /// # Panics
    /// If `angles` are not as many as joints that move.
    #[must_use]
    pub fn at_rest(
        tree: &Tree,
        friction: f64,
        gravity_m_s2: f64,
        corners: impl IntoIterator<Item = (usize, DVec3)>,
        base: Placement,
        angles: &[f64],
    ) -> Self {
        let coupled: Vec<usize> =
            tree.couplings().iter().filter_map(|of| tree.coordinate(of.link)).collect();
        let own: Vec<usize> = (0..tree.moving()).filter(|at| !coupled.contains(at)).collect();
        let mut follows = DMatrix::zeros(tree.moving(), own.len());
        for (column, at) in own.iter().enumerate() {
            let mut rates = vec![0.0; tree.moving()];
            rates[*at] = 1.0;
            follows.set_column(column, &DVector::from_vec(tree.coupled_rates(&rates)));
        }
        let corners = corners.into_iter();
        Self {
            tree: tree.clone(),
            is_fixed: false,
            friction,
            gravity_m_s2,
            down: DVec3::NEG_Z,
            forces_n: Vec::new(),
            corners: corners.map(|(link, at_m)| Corner { link, at_m, sticks_m: None }).collect(),
            contacts: Vec::new(),
            own,
            follows,
            motion: TreeMotion::at_rest(base, tree.coupled(angles)),
        }
    }

    /// The same with its first link screwed down where it is.
    #[must_use]
    pub fn fixed(self) -> Self {
        Self { is_fixed: true, ..self }
    }

    /// What inertia a torque on each joint feels that moves by itself, all else free to move, kg m²; nothing of others, or if that has no
    /// answer. `armature_kg_m2` turns with each joint that moves.
    #[must_use]
    pub fn felt_kg_m2(&self, armature_kg_m2: &[f64]) -> Vec<Option<f64>> {
        let mut mass = self.masses(&self.placed());
        for (row, at) in self.own.iter().enumerate() {
            mass[(6 + row, 6 + row)] += armature_kg_m2[*at];
        }
        let mut felt = vec![None; self.tree.moving()];
        if self.is_fixed {
            hold_base(&mut mass, &mut DVector::zeros(6 + self.own.len()));
        }
        if let Some(factor) = mass.cholesky() {
            let inverse = factor.inverse();
            for (row, at) in self.own.iter().enumerate() {
                felt[*at] = Some(1.0 / inverse[(6 + row, 6 + row)]);
            }
        }
        felt
    }

    /// What is done from outside in the steps to come: forces at the centres of mass of links, N, and how much the floor
    /// falls along its X and Y axis, rad, less than a right angle. Axes are those of the floor.
    pub fn disturb(&mut self, forces_n: Vec<(usize, DVec3)>, slope_rad: [f64; 2]) {
        let [x, y] = slope_rad.map(f64::tan);
        self.down = DVec3::new(x, y, -1.0).normalize_or(DVec3::NEG_Z);
        self.forces_n = forces_n;
    }

    /// Which links are in one another now, and how they get out: they press on one another in the next step, smooth as they
    /// are, and as stiff as the floor.
    pub fn meet(&mut self, links: impl IntoIterator<Item = ((usize, usize), WayOut)>) {
        let contact = |(links, way)| LinkContact { links, way, force_n: 0.0 };
        self.contacts = links.into_iter().map(contact).collect();
    }

    /// Which links pressed on one another in the last step.
    pub fn pressed(&self) -> impl Iterator<Item = &LinkContact> {
        self.contacts.iter().filter(|contact| contact.force_n > 0.0)
    }

    /// Links with a corner on the floor.
    pub fn on_floor(&self) -> impl Iterator<Item = usize> + '_ {
        self.corners.iter().filter(|corner| corner.sticks_m.is_some()).map(|corner| corner.link)
    }

    /// Where the first link is.
    #[must_use]
    pub const fn base(&self) -> Placement {
        self.motion.base
    }

    /// Which way is down, of length 1: on a slope not straight into the floor.
    #[must_use]
    pub const fn down(&self) -> DVec3 {
        self.down
    }

    /// How fast the origin of its first link moves, m/s.
    #[must_use]
    pub const fn velocity_m_s(&self) -> DVec3 {
        self.motion.velocity_m_s
    }

    /// How its first link turns, in the world, rad/s.
    #[must_use]
    pub const fn spin_rad_s(&self) -> DVec3 {
        self.motion.spin_rad_s
    }

    /// Angles of all joints that move.
    #[must_use]
    pub fn angles(&self) -> &[f64] {
        &self.motion.angles
    }

    /// How fast all joints that move do so.
    #[must_use]
    pub fn rates(&self) -> &[f64] {
        &self.motion.rates
    }

    /// Where all links are.
    #[must_use]
    pub fn placed(&self) -> Vec<Placement> {
        self.tree.place(self.motion.base, &self.motion.angles)
    }

    /// One step on, each joint driven to its goal (as many as joints that move; those that follow others need no drive).
    /// False if that has no answer.
    pub fn drive(&mut self, drives: &[Drive], goals: &[f64], step_s: f64) -> bool {
        let pull = |(at, drive): (usize, &Drive)| {
            let Drive { stiffness_nm_rad, torque_nm, .. } = *drive;
            let pull = stiffness_nm_rad * (goals[at] - self.motion.angles[at]);
            let yields = if pull.abs() < torque_nm { stiffness_nm_rad * step_s } else { 0.0 };
            // As strong as it was at the step's beginning, against where the joint turns at its end.
            let rubs = drive.friction_nm / self.motion.rates[at].abs().max(STICKS_RAD_S);
            Pull {
                torque_nm: pull.clamp(-torque_nm, torque_nm),
                gives_nm_s_rad: drive.damping_nm_s_rad + yields + rubs,
                armature_kg_m2: drive.armature_kg_m2,
            }
        };
        let mut pulls: Vec<Pull> = drives.iter().enumerate().map(pull).collect();
        pulls.resize(goals.len(), Pull::default());
        self.step(&pulls, step_s)
    }

    /// One step on, with what is done to each joint that moves. False, and nothing moves, if that has no answer.
    pub fn step(&mut self, pulls: &[Pull], step_s: f64) -> bool {
        let placed = self.placed();
        let size = 6 + self.own.len();
        let mass = self.masses(&placed);
        let efforts = self.tree.inverse_dynamics(&self.motion, self.down * self.gravity_m_s2);
        let mut velocity = DVector::zeros(size);
        put(&mut velocity, 0, self.motion.velocity_m_s);
        put(&mut velocity, 3, self.motion.spin_rad_s);
        let bias = self.follows.transpose() * DVector::from_column_slice(&efforts.joints);
        let mut push = DVector::zeros(size);
        put(&mut push, 0, -efforts.base_force_n);
        put(&mut push, 3, -efforts.base_torque_nm);
        let mut system = mass.clone();
        for (row, at) in self.own.iter().enumerate() {
            velocity[6 + row] = self.motion.rates[*at];
            let Pull { torque_nm, gives_nm_s_rad, armature_kg_m2 } = pulls[*at];
            push[6 + row] = torque_nm - bias[row];
            system[(6 + row, 6 + row)] += armature_kg_m2 + step_s * gives_nm_s_rad;
        }
        let mut side = &mass * &velocity + push * step_s;
        for (row, at) in self.own.iter().enumerate() {
            side[6 + row] += pulls[*at].armature_kg_m2 * velocity[6 + row];
        }
        for (link, force_n) in &self.forces_n {
            let at_m = placed[*link].point(self.tree.links()[*link].mass.centre_m);
            let way = self.way(&placed, *link, at_m);
            side.gemv_tr(step_s, &way, &DVector::from_column_slice(&force_n.to_array()), 1.0);
        }
        let stiffness = self.tree.mass_kg() * self.gravity_m_s2 / (4.0 * SINKS_M);
        let damping = stiffness * FLOOR_S;
        let points: Vec<DVec3> =
            self.corners.iter().map(|corner| placed[corner.link].point(corner.at_m)).collect();
        let low: Vec<usize> = (0..points.len()).filter(|at| points[*at].z < 0.0).collect();
        let ways: Vec<DMatrix<f64>> =
            low.iter().map(|at| self.way(&placed, self.corners[*at].link, points[*at])).collect();
        let mut meets = vec![Meets::Sticks; low.len()];
        let parting: Vec<DVector<f64>> = self
            .contacts
            .iter()
            .map(|LinkContact { links: (one, two), way, .. }| {
                let apart = self.way(&placed, *two, way.at_m) - self.way(&placed, *one, way.at_m);
                apart.tr_mul(&DVector::from_column_slice(&way.normal.to_array()))
            })
            .collect();
        let pressed_n = |contact: &LinkContact, parting: &DVector<f64>, solved: &DVector<f64>| {
            let gives = (stiffness * step_s + damping) * parting.dot(solved);
            stiffness * contact.way.depth_m - gives
        };
        let mut presses = vec![true; parting.len()];
        let sticks = |corner: &Corner, point: DVec3| {
            let at = corner.sticks_m.unwrap_or(point);
            DVec3::new(at.x, at.y, 0.0)
        };
        let mut solved = velocity.clone();
        for pass in 0..=PASSES {
            let (mut system, mut side) = (system.clone(), side.clone());
            for ((at, way), meets) in low.iter().zip(&ways).zip(&meets) {
                let mut held = (sticks(&self.corners[*at], points[*at]) - points[*at]) * stiffness;
                let yields = step_s * (stiffness * step_s + damping);
                let mut by = DVec3::splat(yields);
                match meets {
                    Meets::Not => continue,
                    Meets::Sticks => {}
                    Meets::Slips(force) => {
                        held = DVec3::new(force.x, force.y, held.z);
                        by = DVec3::new(0.0, 0.0, yields);
                    }
                }
                let weighed = DMatrix::from_fn(3, size, |row, column| by[row] * way[(row, column)]);
                system.gemm_tr(1.0, way, &weighed, 1.0);
                side.gemv_tr(step_s, way, &DVector::from_column_slice(&held.to_array()), 1.0);
            }
            let pressing = self.contacts.iter().zip(&parting).zip(&presses);
            for ((contact, parting), _) in pressing.filter(|(_, presses)| **presses) {
                system.ger(step_s * (stiffness * step_s + damping), parting, parting, 1.0);
                side.axpy(step_s * stiffness * contact.way.depth_m, parting, 1.0);
            }
            if self.is_fixed {
                hold_base(&mut system, &mut side);
            }
            let Some(factors) = system.cholesky() else { return false };
            solved = factors.solve(&side);
            if pass == PASSES {
                break;
            }
            let mut changed = false;
            for ((contact, parting), presses) in
                self.contacts.iter().zip(&parting).zip(&mut presses)
            {
                let still = *presses && pressed_n(contact, parting, &solved) > 0.0;
                changed |= still != *presses;
                *presses = still;
            }
            for ((at, way), meets) in low.iter().zip(&ways).zip(&mut meets) {
                let moves = way * &solved;
                let moves = DVec3::new(moves[0], moves[1], moves[2]);
                let away = sticks(&self.corners[*at], points[*at]) - points[*at];
                let force = away * stiffness - moves * (stiffness * step_s + damping);
                let along = DVec3::new(force.x, force.y, 0.0);
                let most = self.friction * force.z;
                let next = if force.z < 0.0 || *meets == Meets::Not {
                    Meets::Not
                } else if let Meets::Slips(before) = *meets {
                    Meets::Slips(before.normalize_or_zero() * most)
                } else if along.length() > most {
                    Meets::Slips(along.normalize_or_zero() * most)
                } else {
                    Meets::Sticks
                };
                changed |= std::mem::discriminant(&next) != std::mem::discriminant(meets);
                *meets = next;
            }
            if !changed {
                break;
            }
        }
        if !solved.iter().all(|value| value.is_finite()) {
            return false;
        }
        for ((contact, parting), presses) in self.contacts.iter_mut().zip(&parting).zip(presses) {
            let force_n = if presses { pressed_n(contact, parting, &solved) } else { 0.0 };
            contact.force_n = force_n.max(0.0);
        }
        for (corner, point) in self.corners.iter_mut().zip(&points) {
            if point.z >= 0.0 {
                corner.sticks_m = None;
            }
        }
        for ((at, way), meets) in low.iter().zip(&ways).zip(&meets) {
            let moves = way * &solved;
            let there = points[*at] + DVec3::new(moves[0], moves[1], 0.0) * step_s;
            let corner = &mut self.corners[*at];
            corner.sticks_m = match meets {
                Meets::Not => None,
                Meets::Sticks => Some(corner.sticks_m.unwrap_or(points[*at])),
                Meets::Slips(force) => Some(there + *force / stiffness),
            };
        }
        self.go_on(&solved, step_s);
        true
    }

    fn go_on(&mut self, velocity: &DVector<f64>, step_s: f64) {
        let take = |at: usize| DVec3::new(velocity[at], velocity[at + 1], velocity[at + 2]);
        let motion = &mut self.motion;
        (motion.velocity_m_s, motion.spin_rad_s) = (take(0), take(3));
        motion.base.at_m += motion.velocity_m_s * step_s;
        let turn = DQuat::from_scaled_axis(motion.spin_rad_s * step_s);
        motion.base.turn = (turn * motion.base.turn).normalize();
        let rates = &self.follows * velocity.rows(6, self.own.len());
        for ((angle, rate), to) in motion.angles.iter_mut().zip(&mut motion.rates).zip(rates.iter())
        {
            *rate = *to;
            *angle += to * step_s;
        }
    }

    /// How a joint moves what it carries: velocity at the base's origin, and spin.
    fn screw(&self, placed: &[Placement], link: usize) -> (DVec3, DVec3) {
        let of = &self.tree.links()[link];
        let axis = placed[link].turn * of.axis;
        match of.kind {
            JointKind::Hinge => {
                (axis.cross(self.motion.base.at_m - placed[link].point(of.anchor_m)), axis)
            }
            JointKind::Slide | JointKind::Fixed => (axis, DVec3::ZERO),
        }
    }

    /// How fast a point goes for the base and for each joint that moves by itself.
    fn way(&self, placed: &[Placement], link: usize, point_m: DVec3) -> DMatrix<f64> {
        let arm = point_m - self.motion.base.at_m;
        let mut way = DMatrix::zeros(3, 6 + self.own.len());
        for (axis, unit) in [DVec3::X, DVec3::Y, DVec3::Z].into_iter().enumerate() {
            way[(axis, axis)] = 1.0;
            let turned = unit.cross(arm);
            (0..3).for_each(|row| way[(row, 3 + axis)] = turned[row]);
        }
        let mut next = Some(link);
        while let Some(index) = next {
            if let Some(at) = self.tree.coordinate(index) {
                let (velocity, spin) = self.screw(placed, index);
                let moves = velocity + spin.cross(arm);
                for own in 0..self.own.len() {
                    let ratio = self.follows[(at, own)];
                    (0..3).for_each(|row| way[(row, 6 + own)] += ratio * moves[row]);
                }
            }
            next = self.tree.links()[index].parent;
        }
        way
    }

    /// The mass matrix: of the base, and of each joint that moves by itself.
    fn masses(&self, placed: &[Placement]) -> DMatrix<f64> {
        let (links, origin_m) = (self.tree.links(), self.motion.base.at_m);
        let mut all: Vec<Composite> = links
            .iter()
            .zip(placed)
            .map(|(link, place)| {
                let arm = place.point(link.mass.centre_m) - origin_m;
                let turn = DMat3::from_quat(place.turn);
                let outer = DMat3::from_cols(arm * arm.x, arm * arm.y, arm * arm.z);
                let about = DMat3::from_diagonal(DVec3::splat(arm.length_squared())) - outer;
                Composite {
                    mass_kg: link.mass.mass_kg,
                    moment: arm * link.mass.mass_kg,
                    inertia: turn * link.mass.inertia_kg_m2 * turn.transpose()
                        + about * link.mass.mass_kg,
                }
            })
            .collect();
        for index in (1..links.len()).rev() {
            if let Some(parent) = links[index].parent {
                let carried = all[index];
                all[parent].add(&carried);
            }
        }
        let moving = self.tree.moving();
        let mut full = DMatrix::zeros(6 + moving, 6 + moving);
        let axes = [DVec3::X, DVec3::Y, DVec3::Z];
        for (column, unit) in axes.into_iter().enumerate() {
            for (at, motion) in [(column, (unit, DVec3::ZERO)), (3 + column, (DVec3::ZERO, unit))] {
                let (force, torque) = all[0].momentum(motion);
                (0..3).for_each(|row| full[(row, at)] = force[row]);
                (0..3).for_each(|row| full[(3 + row, at)] = torque[row]);
            }
        }
        for (index, carried) in all.iter().enumerate() {
            let Some(at) = self.tree.coordinate(index) else { continue };
            let (force, torque) = carried.momentum(self.screw(placed, index));
            for row in 0..3 {
                full[(row, 6 + at)] = force[row];
                full[(3 + row, 6 + at)] = torque[row];
                full[(6 + at, row)] = force[row];
                full[(6 + at, 3 + row)] = torque[row];
            }
            let mut next = Some(index);
            while let Some(above) = next {
                if let Some(other) = self.tree.coordinate(above) {
                    let (velocity, spin) = self.screw(placed, above);
                    let value = velocity.dot(force) + spin.dot(torque);
                    full[(6 + at, 6 + other)] = value;
                    full[(6 + other, 6 + at)] = value;
                }
                next = links[above].parent;
            }
        }
        if self.own.len() == moving {
            return full;
        }
        let mut reduced = DMatrix::zeros(6 + moving, 6 + self.own.len());
        (0..6).for_each(|at| reduced[(at, at)] = 1.0);
        reduced.view_mut((6, 6), (moving, self.own.len())).copy_from(&self.follows);
        reduced.transpose() * full * reduced
    }
}

/// The base does not move, whatever is done to it.
fn hold_base(system: &mut DMatrix<f64>, side: &mut DVector<f64>) {
    for at in 0..6 {
        system.row_mut(at).fill(0.0);
        system.column_mut(at).fill(0.0);
        system[(at, at)] = 1.0;
        side[at] = 0.0;
    }
}

fn put(into: &mut DVector<f64>, first: usize, value: DVec3) {
    for (at, part) in value.to_array().into_iter().enumerate() {
        into[first + at] = part;
    }
}

#[cfg(test)]
mod tests;
