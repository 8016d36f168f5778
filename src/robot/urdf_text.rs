//! A robot's body as URDF (<https://wiki.ros.org/urdf/XML>), for simulators and viewers that read no other file.

use super::body::RobotBody;
use crate::motion::limits::JointLimits;
use crate::rigid::{Capsule, Coupling, Cuboid, Mass, TreeLink, Volume};
use glam::{DQuat, DVec3, EulerRot};
use std::fmt::Write as _;

/// The body of a robot with this name, whose joints, in the file's order, have these limits. Links have the names of
/// the joints they hang on, the first is `base`. Shapes are both seen and felt; a capsule, which URDF has not, is a
/// cylinder between two spheres. What one joint alone turns with is `mimic`; of joints that turn with several URDF
/// knows nothing: they are free in it.
#[must_use]
pub fn urdf(name: &str, body: &RobotBody, limits: &[JointLimits]) -> String {
    let mut out = String::from("<?xml version=\"1.0\"?>\n");
    let _ = writeln!(out, "<robot name=\"{}\">", escaped(name));
    let links = body.tree.links();
    for (link, volumes) in links.iter().zip(&body.volumes) {
        let _ = writeln!(out, "  <link name=\"{}\">", escaped(&link.name));
        inertial(&mut out, &link.mass);
        for element in ["visual", "collision"] {
            for volume in volumes {
                shapes(&mut out, element, volume);
            }
        }
        out.push_str("  </link>\n");
    }
    for (index, link) in links.iter().enumerate() {
        let Some(parent) = link.parent.and_then(|parent| links.get(parent)) else { continue };
        let coupling = body.tree.couplings().iter().find(|coupling| coupling.link == index);
        let limits = limits.get(index - 1).filter(|_| coupling.is_none());
        // Of servos that the file says nothing of, nobody knows the torque: readers want a number.
        let drive = body.drives.as_ref().and_then(|drives| drives.get(index - 1));
        joint(&mut out, link, parent, limits, drive.map_or(0.0, |drive| drive.torque_nm));
        if let Some(Coupling { of, offset, .. }) = coupling
            && let [(leader, ratio)] = of.as_slice()
        {
            let leader = escaped(&links[*leader].name);
            let _ = writeln!(
                out,
                "    <mimic joint=\"{leader}\" multiplier=\"{ratio}\" offset=\"{offset}\"/>"
            );
        }
        out.push_str("  </joint>\n");
    }
    out.push_str("</robot>\n");
    out
}

fn joint(
    out: &mut String,
    link: &TreeLink,
    parent: &TreeLink,
    limits: Option<&JointLimits>,
    effort_nm: f64,
) {
    let kind = if limits.is_some() { "revolute" } else { "continuous" };
    let _ = writeln!(out, "  <joint name=\"{}\" type=\"{kind}\">", escaped(&link.name));
    let _ = writeln!(out, "    <parent link=\"{}\"/>", escaped(&parent.name));
    let _ = writeln!(out, "    <child link=\"{}\"/>", escaped(&link.name));
    let _ = writeln!(out, "    {}", origin(link.origin.at_m, link.origin.turn));
    let _ = writeln!(out, "    <axis xyz=\"{}\"/>", triple(link.axis));
    if let Some(limits) = limits {
        let _ = writeln!(
            out,
            "    <limit lower=\"{}\" upper=\"{}\" velocity=\"{}\" effort=\"{effort_nm}\"/>",
            limits.lower_rad(),
            limits.upper_rad(),
            limits.velocity_rad_s()
        );
    }
}

fn inertial(out: &mut String, mass: &Mass) {
    if !(mass.mass_kg > 0.0) {
        return;
    }
    let [x, y, z] = [0, 1, 2].map(|column| mass.inertia_kg_m2.col(column));
    let _ = writeln!(
        out,
        "    <inertial>\n      {}\n      <mass value=\"{}\"/>\n      <inertia ixx=\"{}\" ixy=\"{}\" ixz=\"{}\" \
         iyy=\"{}\" iyz=\"{}\" izz=\"{}\"/>\n    </inertial>",
        origin(mass.centre_m, DQuat::IDENTITY),
        mass.mass_kg,
        x.x,
        y.x,
        z.x,
        y.y,
        z.y,
        z.z
    );
}

fn shapes(out: &mut String, element: &str, volume: &Volume) {
    let mut shape = |at_m: DVec3, turn: DQuat, geometry: String| {
        let _ = writeln!(
            out,
            "    <{element}>\n      {}\n      <geometry><{geometry}/></geometry>\n    </{element}>",
            origin(at_m, turn)
        );
    };
    match volume {
        Volume::Cuboid(Cuboid { centre_m, half_m, turn }) => {
            shape(*centre_m, *turn, format!("box size=\"{}\"", triple(*half_m * 2.0)));
        }
        Volume::Capsule(Capsule { from_m, to_m, radius_m }) => {
            let ball = format!("sphere radius=\"{radius_m}\"");
            shape(*from_m, DQuat::IDENTITY, ball.clone());
            let along_m = *to_m - *from_m;
            let Some(direction) = along_m.try_normalize() else { return };
            shape(*to_m, DQuat::IDENTITY, ball);
            let turn = DQuat::from_rotation_arc(DVec3::Z, direction);
            let length_m = along_m.length();
            let rod = format!("cylinder radius=\"{radius_m}\" length=\"{length_m}\"");
            shape((*from_m + *to_m) / 2.0, turn, rod);
        }
    }
}

/// Roll, pitch and yaw turn about the axes that stay, one after the other.
fn origin(at_m: DVec3, turn: DQuat) -> String {
    let (yaw, pitch, roll) = turn.to_euler(EulerRot::ZYX);
    format!("<origin xyz=\"{}\" rpy=\"{}\"/>", triple(at_m), triple(DVec3::new(roll, pitch, yaw)))
}

fn triple(of: DVec3) -> String {
    // A zero that rounding made negative is a zero.
    let [x, y, z] = (of + 0.0).to_array();
    format!("{x} {y} {z}")
}

fn escaped(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '"' => escaped.push_str("&quot;"),
            other => escaped.push(other),
        }
    }
    escaped
}
