//! How a model's servos hold its joints: actuators that pull to a position, and what keeps joints from being turned.
//! <https://mujoco.readthedocs.io/en/stable/XMLreference.html#actuator-position>.

use super::super::MovingJoint;
use super::super::xml::{children, numbers};
use super::Reader;
use crate::rigid::{Moving, Placement, Tree};
use gaitway_profiles::{BaseKind, Yielding};
use roxmltree::Node;
use std::collections::BTreeMap;

/// Numbers in one attribute, at most.
const PARAMETERS: usize = 10;

/// Elements that are actuators: a model's defaults of one are those of all.
const ACTUATORS: [&str; 9] = [
    "general",
    "motor",
    "position",
    "velocity",
    "intvelocity",
    "damper",
    "cylinder",
    "muscle",
    "adhesion",
];
/// What defaults of another element may say that would count here, too.
const SHARED: [&str; 11] = [
    "gear",
    "kp",
    "kv",
    "dampratio",
    "gainprm",
    "biasprm",
    "forcerange",
    "forcelimited",
    "armature",
    "damping",
    "timeconst",
];

/// The servos of a model.
pub(super) struct Servos {
    /// Those that are known.
    known: Vec<Servo>,
    /// Of each of the model's joints what turns with it, kg m².
    armature_kg_m2: Vec<f64>,
}

/// What pulls at a joint, as the model says it.
struct Servo {
    /// Index among the model's joints.
    joint: usize,
    /// But for what is told as a part of critical damping.
    holds: Yielding,
    /// Damping beside that, as a part of the critical one.
    critical: f64,
}

impl<'a, 'i> Reader<'a, 'i, '_> {
    /// Servos that pull to a position, and no harder than something. Joints that more than one actuator pulls at have none, and
    /// no joint has one if tendons or joints' parents are pulled at.
    pub(super) fn servos(&self, root: Node<'a, 'i>) -> Servos {
        let named = |of: Node<'a, 'i>| Some((of.attribute("name")?, of));
        let is_joint = |of: &Node<'_, '_>| of.has_tag_name("joint") && !of.has_attribute("joint1");
        let joints: BTreeMap<&str, Node<'a, 'i>> =
            root.descendants().filter(is_joint).filter_map(named).collect();
        let mut pulls: BTreeMap<&str, Vec<Node<'a, 'i>>> = BTreeMap::new();
        let mut is_plain = true;
        for actuator in children(root, "actuator").flat_map(|all| all.children()) {
            if let Some(joint) = actuator.attribute("joint") {
                pulls.entry(joint).or_default().push(actuator);
            }
            let elsewhere = ["tendon", "jointinparent"];
            is_plain &= !elsewhere.iter().any(|key| actuator.has_attribute(*key));
        }
        let servo = |(at, name): (usize, &str)| match pulls.get(name)?.as_slice() {
            [one] if is_plain => self.servo(at, *one, *joints.get(name)?),
            _ => None,
        };
        let names = || self.joints.iter().map(|joint| joint.name.as_str());
        let known: Vec<Servo> = names().enumerate().filter_map(servo).collect();
        let armature_kg_m2 = names().map(|name| {
            let own = joints.get(name).and_then(|joint| {
                self.first_of(*joint, self.class_around(*joint), "armature", 0.0)
            });
            own.unwrap_or(0.0)
        });
        let mut armature_kg_m2: Vec<f64> = armature_kg_m2.collect();
        known.iter().for_each(|of| armature_kg_m2[of.joint] = of.holds.armature_kg_m2);
        Servos { known, armature_kg_m2 }
    }

    fn servo(&self, at: usize, node: Node<'a, 'i>, joint: Node<'a, 'i>) -> Option<Servo> {
        // It pulls at once, and has nothing of its own that a spring and a damper have not.
        let more = ["timeconst", "delay", "damping"];
        let is_plain = more.iter().all(|key| self.first_of(node, 0, key, 0.0) == Some(0.0));
        if !is_plain || !self.is_alone_in_defaults(node) {
            return None;
        }
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
            armature_kg_m2: of_joint("armature")?
                + self.first_of(node, 0, "armature", 0.0)? * gear * gear,
            friction_nm: of_joint("frictionloss")?,
            torque_nm,
        };
        let sound = [holds.damping_nm_s_rad, holds.armature_kg_m2, holds.friction_nm, critical];
        let is_sound = sound.iter().all(|value| value.is_finite() && *value >= 0.0);
        let pulls =
            [holds.stiffness_nm_rad, torque_nm].iter().all(|of| of.is_finite() && *of > 0.0);
        (is_sound && pulls).then_some(Servo { joint: at, holds, critical })
    }

    /// Whether the defaults of this actuator's class say nothing of it by another element: those count for all actuators.
    fn is_alone_in_defaults(&self, node: Node<'a, 'i>) -> bool {
        let class = match node.attribute("class") {
            Some(name) => match self.defaults.class_of.get(name) {
                Some(class) => *class,
                None => return false,
            },
            None => 0,
        };
        let own = node.tag_name().name();
        let others = || ACTUATORS.into_iter().filter(|tag| *tag != own);
        let sets =
            |class: usize| others().filter_map(move |tag| self.defaults.sets.get(&(class, tag)));
        let says = |set: &Node<'_, '_>| SHARED.iter().any(|key| set.has_attribute(*key));
        !self.defaults.chain(class).any(|class| sets(class).flatten().any(says))
    }

    /// Stiffness, damping, and damping as a part of the critical one, of an actuator whose force is a spring's and a damper's.
    fn pulls_to_a_position(&self, node: Node<'a, 'i>) -> Option<(f64, f64, f64)> {
        match node.tag_name().name() {
            "position" => {
                let [kv, ratio] = ["kv", "dampratio"].map(|key| self.first_of(node, 0, key, 0.0));
                let is_one = kv? == 0.0 || ratio? == 0.0;
                is_one.then_some((self.first_of(node, 0, "kp", 1.0)?, kv?, ratio?))
            }
            "general" => {
                let get = |key: &str| self.get(node, 0, key);
                let is_spring = get("biastype") == Some("affine")
                    && get("gaintype").unwrap_or("fixed") == "fixed"
                    && get("dyntype").unwrap_or("none") == "none";
                let stiffness = self.first_of(node, 0, "gainprm", 1.0)?;
                let bias = numbers(node, "biasprm", get("biasprm")?, PARAMETERS).ok()?;
                let (rest, pull) = (bias[0], *bias.get(1)?);
                let damping = -bias.get(2).copied().unwrap_or(0.0);
                // To the last digit: a model may have rounded either.
                let is_held = (stiffness + pull).abs() <= 1e-6 * stiffness;
                (is_spring && is_held && rest == 0.0).then_some((stiffness, damping, 0.0))
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
        // Both ways.
        let [lower, upper] = *ends.as_slice() else { return None };
        (lower < 0.0 && upper > 0.0).then(|| upper.min(-lower))
    }
}

impl Servos {
    /// Says of joints how they are held, at the model's zero: damping may follow from what moves with a joint.
    pub(super) fn onto(&self, joints: &mut [MovingJoint], tree: &Tree, base: BaseKind) {
        let mut armature_kg_m2 = vec![0.0; tree.moving()];
        for (joint, own) in joints.iter().zip(&self.armature_kg_m2) {
            if let Some(at) = tree.coordinate(joint.link) {
                armature_kg_m2[at] = *own;
            }
        }
        let felt = self.known.iter().any(|of| of.critical > 0.0).then(|| {
            let zeros = vec![0.0; tree.moving()];
            let still = Moving::at_rest(tree, 0.0, 0.0, [], Placement::IDENTITY, &zeros);
            let held = if base == BaseKind::Fixed { still.fixed() } else { still };
            held.felt_kg_m2(&armature_kg_m2)
        });
        for servo in &self.known {
            let joint = &mut joints[servo.joint];
            let felt = felt.as_ref().and_then(|felt| *felt.get(tree.coordinate(joint.link)?)?);
            joint.holds = match (servo.critical, felt) {
                (0.0, _) => Some(servo.holds),
                (critical, Some(felt_kg_m2)) => {
                    let of = servo.holds;
                    let added = 2.0 * critical * (of.stiffness_nm_rad * felt_kg_m2).sqrt();
                    let damping_nm_s_rad = of.damping_nm_s_rad + added;
                    Some(Yielding { damping_nm_s_rad, ..of }).filter(|_| added.is_finite())
                }
                (_, None) => None,
            };
        }
    }
}
