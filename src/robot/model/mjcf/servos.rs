//! How a model's servos hold its joints: actuators that pull to a position, and what keeps joints from being turned.
//! <https://mujoco.readthedocs.io/en/stable/XMLreference.html#actuator-position>.

use super::super::xml::{children, numbers};
use super::Reader;
use crate::rigid::{JointKind, Placement, Tree};
use gaitway_profiles::Yielding;
use roxmltree::Node;
use std::collections::BTreeMap;

/// Numbers in one attribute, at most.
const PARAMETERS: usize = 10;

/// What pulls at a joint, as the model says it.
pub(super) struct Servo {
    /// Index among the model's joints.
    pub(super) joint: usize,
    /// But for what is told as a part of critical damping.
    holds: Yielding,
    /// Damping beside that, as a part of the critical one.
    critical: f64,
}

impl<'a, 'i> Reader<'a, 'i, '_> {
    /// Servos that pull to a position, and no harder than something. Joints that more than one actuator pulls at have none.
    pub(super) fn servos(&self, root: Node<'a, 'i>) -> Vec<Servo> {
        let named = |of: Node<'a, 'i>| Some((of.attribute("name")?, of));
        let is_joint = |of: &Node<'_, '_>| of.has_tag_name("joint") && !of.has_attribute("joint1");
        let joints: BTreeMap<&str, Node<'a, 'i>> =
            root.descendants().filter(is_joint).filter_map(named).collect();
        let mut pulls: BTreeMap<&str, Vec<Node<'a, 'i>>> = BTreeMap::new();
        for actuator in children(root, "actuator").flat_map(|all| all.children()) {
            if let Some(joint) = actuator.attribute("joint") {
                pulls.entry(joint).or_default().push(actuator);
            }
        }
        let servo = |(at, name): (usize, &str)| match pulls.get(name)?.as_slice() {
            [one] => self.servo(at, *one, *joints.get(name)?),
            _ => None,
        };
        let names = self.joints.iter().map(|joint| joint.name.as_str());
        names.enumerate().filter_map(servo).collect()
    }

    fn servo(&self, at: usize, node: Node<'a, 'i>, joint: Node<'a, 'i>) -> Option<Servo> {
        let around = self.class_around(joint);
        let of_joint = |key: &str| self.first_of(joint, around, key, 0.0);
        let (stiffness, damping, critical) = self.pulls_to_a_position(node)?;
        let gear = self.first_of(node, 0, "gear", 1.0)?.abs();
        let most = self.most(node, 0, ["forcerange", "forcelimited"]).map(|most| most * gear);
        let of_all = self.most(joint, around, ["actuatorfrcrange", "actuatorfrclimited"]);
        let torque_nm = match (most, of_all) {
            (Some(one), Some(two)) => one.min(two),
            (one, two) => one.or(two)?,
        };
        let holds = Yielding {
            stiffness_nm_rad: stiffness * gear * gear,
            damping_nm_s_rad: damping * gear * gear + of_joint("damping")?,
            armature_kg_m2: of_joint("armature")?,
            friction_nm: of_joint("frictionloss")?,
            torque_nm,
        };
        let sound = [holds.damping_nm_s_rad, holds.armature_kg_m2, holds.friction_nm, critical];
        let is_sound = sound.iter().all(|value| value.is_finite() && *value >= 0.0);
        let pulls =
            [holds.stiffness_nm_rad, torque_nm].iter().all(|of| of.is_finite() && *of > 0.0);
        (is_sound && pulls).then_some(Servo { joint: at, holds, critical })
    }

    /// Stiffness, damping, and damping as a part of the critical one, of an actuator whose force is a spring's and a damper's.
    fn pulls_to_a_position(&self, node: Node<'a, 'i>) -> Option<(f64, f64, f64)> {
        match node.tag_name().name() {
            "position" => Some((
                self.first_of(node, 0, "kp", 1.0)?,
                self.first_of(node, 0, "kv", 0.0)?,
                self.first_of(node, 0, "dampratio", 0.0)?,
            )),
            "general" => {
                let get = |key: &str| self.get(node, 0, key);
                let is_spring = get("biastype") == Some("affine")
                    && get("gaintype").unwrap_or("fixed") == "fixed"
                    && get("dyntype").unwrap_or("none") == "none";
                let stiffness = self.first_of(node, 0, "gainprm", 1.0)?;
                let bias = numbers(node, "biasprm", get("biasprm")?, PARAMETERS).ok()?;
                let pull = *bias.get(1)?;
                let damping = -bias.get(2).copied().unwrap_or(0.0);
                // To the last digit: a model may have rounded either.
                let is_held = (stiffness + pull).abs() <= 1e-6 * stiffness;
                (is_spring && is_held).then_some((stiffness, damping, 0.0))
            }
            _ => None,
        }
    }

    /// The first number of an attribute; nothing if it is none, or if others follow that count.
    fn first_of(&self, node: Node<'a, 'i>, around: usize, key: &str, usual: f64) -> Option<f64> {
        let Some(text) = self.get(node, around, key) else { return Some(usual) };
        let all = numbers(node, key, text, PARAMETERS).ok()?;
        let (first, rest) = all.split_first()?;
        rest.iter().all(|value| *value == 0.0).then_some(*first)
    }

    /// What a range from minus something to something has at most, if it is one.
    fn most(&self, node: Node<'a, 'i>, around: usize, [range, limited]: [&str; 2]) -> Option<f64> {
        let text = self.get(node, around, range)?;
        let is_limited = match self.get(node, around, limited).unwrap_or("auto") {
            "true" => true,
            "false" => false,
            _ => self.compiler.autolimits,
        };
        let ends = numbers(node, range, text, 2).ok().filter(|_| is_limited)?;
        ends.iter().map(|end| end.abs()).reduce(f64::min)
    }
}

impl Servo {
    /// How it holds its joint, whose damping may follow from what it carries, at the model's zero.
    pub(super) fn holds(&self, tree: &Tree, link: usize) -> Yielding {
        let stiffness_nm_rad = self.holds.stiffness_nm_rad;
        let inertia_kg_m2 = carried_kg_m2(tree, link) + self.holds.armature_kg_m2;
        let critical_nm_s_rad = 2.0 * (stiffness_nm_rad * inertia_kg_m2).sqrt();
        let damping_nm_s_rad = self.holds.damping_nm_s_rad + self.critical * critical_nm_s_rad;
        Yielding { damping_nm_s_rad, ..self.holds }
    }
}

/// The moment of inertia about a hinge of all it carries, at zero.
fn carried_kg_m2(tree: &Tree, link: usize) -> f64 {
    let placed = tree.place(Placement::IDENTITY, &vec![0.0; tree.moving()]);
    let of = &tree.links()[link];
    let (axis, anchor_m) = (placed[link].turn * of.axis, placed[link].point(of.anchor_m));
    let is_carried = |other: usize| {
        let mut above = std::iter::successors(Some(other), |at| tree.links()[*at].parent);
        above.any(|at| at == link)
    };
    let all = tree.links().iter().enumerate().filter(|(other, _)| is_carried(*other));
    let about = all.map(|(other, carried)| {
        let arm_m = axis.cross(placed[other].point(carried.mass.centre_m) - anchor_m);
        let own = placed[other].turn.inverse() * axis;
        own.dot(carried.mass.inertia_kg_m2 * own) + carried.mass.mass_kg * arm_m.length_squared()
    });
    if of.kind == JointKind::Hinge { about.sum() } else { 0.0 }
}
