//! A reduced model as text: the `[body]` of a robot file, and a draft of a whole one.

use super::PublicModel;
use super::onto::{OwnJoint, Reduced, ReducedLink};
use crate::error::counted;
use crate::rigid::Volume;
use gaitway_profiles::{Anatomy, BaseKind, Yielding};
use glam::{DQuat, DVec3};
use serde::Serialize;
use std::fmt::Write;

/// Of a joint whose limits the model does not say, rad.
const NARROW_RAD: f64 = 0.5;
/// Of one whose speed it does not say, rad/s.
const SLOW_RAD_S: f64 = 1.0;
/// Full speed is reached in this time, s.
const RAMP_S: f64 = 0.2;

/// Where a model says how servos hold joints.
const SERVO_SOURCE: &str =
    "the same model: its position actuators, and what its joints say of themselves";

/// What a model does not say of itself.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Provenance {
    /// Where it is from.
    pub source: String,
    /// Its licence.
    pub licence: String,
    /// Where capsules and boxes come from.
    pub shape_source: String,
}

/// The most of a joint that a draft needs and no model says.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DraftServo {
    /// Profile of the servo; none: to be named by a person.
    pub name: Option<String>,
    /// Fastest it can turn, rad/s.
    pub fastest_rad_s: Option<f64>,
    /// Speed of its line.
    pub baud_bps: u32,
}

/// A part of a robot file.
#[derive(Serialize)]
struct Part {
    anatomy: Anatomy,
}

/// Seven digits: more than any model's numbers are good for.
fn number(value: f64) -> String {
    if value.abs() < 1e-12 {
        return "0.0".to_owned();
    }
    let text = format!("{:.6e}", value);
    let rounded: f64 = text.parse().unwrap_or(value);
    let plain = format!("{rounded:?}");
    if plain.contains('e') && !plain.contains('.') {
        return plain.replacen('e', ".0e", 1);
    }
    plain
}

/// Words of a stranger's: not all of them are written alike in Rust and in TOML.
fn quoted(text: &str) -> String {
    toml::Value::from(text).to_string()
}

/// Lengths, to a tenth of a micrometre.
fn lengths(of: DVec3) -> String {
    let values = of.to_array().map(|value| number((value * 1e7).round() / 1e7));
    format!("[{}]", values.join(", "))
}

/// The `[body]` part of a robot file.
pub(super) fn body(model: &PublicModel, reduced: &Reduced, words: &Provenance) -> String {
    let mut out = String::new();
    let base = match model.base {
        BaseKind::Free => "free",
        BaseKind::Fixed => "fixed",
    };
    let _ = writeln!(
        out,
        "[body]\nbase = {base:?}\nsource = {}\nlicence = {}\nshape_source = {}",
        quoted(&words.source),
        quoted(&words.licence),
        quoted(&words.shape_source)
    );
    out.push_str(&servos(&reduced.joints).unwrap_or_default());
    for joint in reduced.joints.iter().filter(|joint| !joint.follows.is_empty()) {
        let _ = writeln!(out, "\n[[body.coupled]]\nname = {:?}", joint.name);
        let terms = joint.follows.iter().map(|&(of, ratio)| {
            let other = &reduced.joints[of].name;
            format!("{{ joint = {other:?}, ratio = {} }}", number(ratio))
        });
        let _ = writeln!(out, "of = [{}]", terms.collect::<Vec<_>>().join(", "));
        if joint.offset_rad != 0.0 {
            let _ = writeln!(out, "offset_rad = {}", number(joint.offset_rad));
        }
        mounted(&mut out, joint, &reduced.joints);
    }
    for of in &reduced.links {
        link(&mut out, of, &reduced.joints);
    }
    out
}

/// How servos hold joints, if the model says so of all that are driven: what most have, and then all others.
fn servos(joints: &[OwnJoint]) -> Option<String> {
    let driven = joints.iter().filter(|joint| joint.follows.is_empty());
    let mut kinds: Vec<(Yielding, Vec<&str>)> = Vec::new();
    for joint in driven {
        let holds = joint.holds?;
        match kinds.iter_mut().find(|(kind, _)| *kind == holds) {
            Some((_, names)) => names.push(&joint.name),
            None => kinds.push((holds, vec![&joint.name])),
        }
    }
    // Of kinds that are as many the first: the sort is stable.
    kinds.sort_by_key(|(_, names)| std::cmp::Reverse(names.len()));
    let numbers = |of: &Yielding| {
        let friction = match of.friction_nm {
            0.0 => String::new(),
            friction_nm => format!("friction_nm = {}\n", number(friction_nm)),
        };
        format!(
            "stiffness_nm_rad = {}\ndamping_nm_s_rad = {}\narmature_kg_m2 = {}\n{friction}torque_nm = {}\n",
            number(of.stiffness_nm_rad),
            number(of.damping_nm_s_rad),
            number(of.armature_kg_m2),
            number(of.torque_nm)
        )
    };
    let ((usual, _), others) = kinds.split_first()?;
    let mut out = format!("\n[body.servos]\n{}source = {SERVO_SOURCE:?}\n", numbers(usual));
    for (holds, names) in others {
        let names: Vec<String> = names.iter().map(|name| format!("{name:?}")).collect();
        let (names, numbers) = (names.join(", "), numbers(holds));
        let _ = write!(out, "\n[[body.servos.other]]\njoints = [{names}]\n{numbers}");
    }
    Some(out)
}

fn mounted(out: &mut String, joint: &OwnJoint, joints: &[OwnJoint]) {
    let from = joint.parent.map_or(DVec3::ZERO, |parent| joints[parent].at_m);
    if let Some(parent) = joint.parent {
        let _ = writeln!(out, "parent = {:?}", joints[parent].name);
    }
    let axis = joint.axis.to_array().map(|value| number((value * 1e9).round() / 1e9));
    let _ =
        writeln!(out, "origin_m = {}\naxis = [{}]", lengths(joint.at_m - from), axis.join(", "));
}

/// How something is turned, unless it is not.
fn turned(by: DQuat) -> String {
    if by.w.abs() > 1.0 - 1e-12 {
        return String::new();
    }
    let parts = [by.w, by.x, by.y, by.z].map(|part| number((part * 1e9).round() / 1e9));
    format!(", turn = [{}]", parts.join(", "))
}

fn link(out: &mut String, link: &ReducedLink, joints: &[OwnJoint]) {
    let _ = writeln!(out, "\n[[body.link]]");
    if let Some(joint) = link.joint {
        let _ = writeln!(out, "joint = {:?}", joints[joint].name);
    }
    let inertia = link.mass.inertia_kg_m2;
    let six = [
        inertia.x_axis.x,
        inertia.y_axis.y,
        inertia.z_axis.z,
        inertia.x_axis.y,
        inertia.x_axis.z,
        inertia.y_axis.z,
    ];
    let _ = writeln!(
        out,
        "mass_kg = {}\ncentre_m = {}\ninertia_kg_m2 = [{}]",
        number(link.mass.mass_kg),
        lengths(link.mass.centre_m),
        six.map(number).join(", ")
    );
    let (mut capsules, mut boxes) = (Vec::new(), Vec::new());
    for volume in &link.volumes {
        match volume {
            Volume::Capsule(of) => capsules.push(format!(
                "{{ from_m = {}, to_m = {}, radius_m = {} }}",
                lengths(of.from_m),
                lengths(of.to_m),
                number(of.radius_m)
            )),
            Volume::Cuboid(of) => {
                boxes.push(format!(
                    "{{ centre_m = {}, half_m = {}{} }}",
                    lengths(of.centre_m),
                    lengths(of.half_m),
                    turned(of.turn)
                ));
            }
        }
    }
    let meshes = link.looks.iter().map(|of| {
        let scale = match of.scale {
            DVec3::ONE => String::new(),
            of => format!(", scale = [{}]", of.to_array().map(number).join(", ")),
        };
        let at = lengths(of.at.at_m);
        let file = quoted(&of.file);
        format!("{{ file = {file}{scale}, at_m = {at}{} }}", turned(of.at.turn))
    });
    for (key, list) in [("capsules", capsules), ("boxes", boxes), ("meshes", meshes.collect())] {
        if !list.is_empty() {
            let _ = writeln!(out, "{key} = [\n    {},\n]", list.join(",\n    "));
        }
    }
    if !link.sole_m.is_empty() {
        let corners: Vec<String> = link.sole_m.iter().map(|corner| lengths(*corner)).collect();
        let _ = writeln!(out, "sole_m = [\n    {},\n]", corners.join(",\n    "));
    }
}

/// A whole robot file, in which everything is marked that the model cannot say.
pub(super) fn draft(
    model: &PublicModel,
    reduced: &Reduced,
    words: &Provenance,
    name: &str,
    servo: &DraftServo,
) -> String {
    let mut out = String::new();
    let driven = reduced.joints.iter().filter(|joint| joint.follows.is_empty());
    let _ = writeln!(
        out,
        "# Read from the {} model {:?} by `gaitway robot import`. A model does not say how a robot is\n\
         # driven: line, baud_bps, id, servo, direction and offset_rad are placeholders. Look at each\n\
         # before this file drives anything.\n\
         schema = 1\nname = {name:?}\ndescription = {}\nsource = {}\n\
         acceleration_source = \"assumed: full speed reached in 0.2 s; the model gives no figure\"\n\n\
         [[line]]\nname = \"body\"\nbaud_bps = {}",
        model.format,
        model.name,
        quoted(&format!(
            "{}, {}, from its public model",
            model.name,
            counted(driven.clone().count(), "joint")
        )),
        quoted(&words.source),
        servo.baud_bps
    );
    for (index, joint) in driven.enumerate() {
        let _ = writeln!(
            out,
            "\n[[joint]]\nname = {:?}\nline = \"body\"\nid = {}\nservo = {:?}",
            joint.name,
            index + 1,
            servo.name.as_deref().unwrap_or("name-of-a-profile")
        );
        let (lower, upper) = match joint.range {
            Some(range) => range,
            None => {
                let _ = writeln!(out, "# Narrow on purpose: the model has no limits here.");
                (-NARROW_RAD, NARROW_RAD)
            }
        };
        let told = joint.velocity_rad_s.unwrap_or(SLOW_RAD_S);
        let speed = servo.fastest_rad_s.map_or(told, |fastest| told.min(fastest));
        let initial = 0.0_f64.clamp(lower, upper);
        let _ = writeln!(
            out,
            "lower_rad = {}\nupper_rad = {}\nvelocity_rad_s = {}\nacceleration_rad_s2 = {}\n\
             initial_rad = {}",
            number(lower),
            number(upper),
            number(speed),
            number(speed / RAMP_S),
            number(initial)
        );
        mounted(&mut out, joint, &reduced.joints);
    }
    // Numbers and names alone: nothing in it cannot be written.
    if let Ok(anatomy) = model.anatomy(reduced)
        && let Ok(part) = toml::to_string(&Part { anatomy })
    {
        let _ = write!(out, "\n{part}");
    }
    let _ = write!(out, "\n{}", body(model, reduced, words));
    out
}

/// The file of a robot with this body in place of its own, of which it keeps what no model says: its servos, sensor,
/// balance, and what it does when it has fallen. Nothing if what stands behind its own is no part of it.
pub(super) fn instead(text: &str, body: &str) -> Option<String> {
    let starts = |line: &str| line.trim_start().starts_with("[body]");
    let kept: Vec<&str> = text.lines().take_while(|line| !starts(line)).collect();
    let (mut fallen, mut own) = (None, String::new());
    let mut is_kept = false;
    for line in text.lines().skip(kept.len()) {
        // Lists of numbers begin lines with a bracket too, but further in.
        let is_header = line.starts_with('[') && line.len() > 2;
        if is_header {
            let name = line.trim_start_matches('[');
            is_kept = name.starts_with("body.")
                && !["body.link]", "body.coupled]"].iter().any(|of| name.starts_with(of));
            if !is_kept && !name.starts_with("body") {
                return None;
            }
            if is_kept {
                own.push('\n');
            }
        }
        if line.starts_with("when_fallen") {
            fallen = Some(line);
        } else if is_kept && !line.trim().is_empty() {
            own.push_str(line);
            own.push('\n');
        }
    }
    let kept = kept.join("\n");
    let body = match fallen {
        Some(fallen) => body.replacen("[body]\n", &format!("[body]\n{fallen}\n"), 1),
        None => body.to_owned(),
    };
    Some(format!("{}\n\n{body}{own}", kept.trim_end()))
}
