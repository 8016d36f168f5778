//! What a robot weighs, takes up and stands on, from its file.

use super::robot_model::base_word;
use crate::error::Error;
use crate::rigid::Placement;
use crate::robot::{Robot, RobotBody};
use glam::DVec3;
use serde::Serialize;

/// A robot as its file has it.
#[derive(Clone, Debug, Serialize)]
pub struct RobotInfo {
    /// Its name.
    pub name: String,
    /// What its file says of itself.
    pub description: String,
    /// Names of its joints.
    pub joints: Vec<String>,
    /// What it weighs and takes up; null if nobody said.
    pub body: Option<BodyInfo>,
}

/// What it weighs and takes up, in the pose it starts in.
#[derive(Clone, Debug, Serialize)]
pub struct BodyInfo {
    /// `free` or `fixed`.
    pub base: &'static str,
    /// Mass, kg.
    pub mass_kg: f64,
    /// From its lowest to its highest point, m; null without shapes.
    pub height_m: Option<f64>,
    /// Centre of mass above its lowest point, m; null without shapes.
    pub centre_height_m: Option<f64>,
    /// Centre of mass from the base's origin, m.
    pub centre_m: [f64; 3],
    /// Links, the base first.
    pub links: Vec<LinkInfo>,
    /// What it stands on.
    pub soles: Vec<SoleInfo>,
    /// Pairs of links that are in one another in this pose, neighbours apart, with their depth, m.
    pub touching: Vec<(String, String, f64)>,
    /// Where the masses come from.
    pub source: String,
    /// Licence of that source.
    pub licence: String,
    /// Where the shapes come from.
    pub shape_source: String,
}

/// A link.
#[derive(Clone, Debug, Serialize)]
pub struct LinkInfo {
    /// The joint it hangs on, or `base`.
    pub name: String,
    /// Mass, kg.
    pub mass_kg: f64,
    /// Capsules and boxes.
    pub shapes: usize,
}

/// What a link stands on.
#[derive(Clone, Debug, Serialize)]
pub struct SoleInfo {
    /// The link.
    pub link: String,
    /// From heel to toe, m.
    pub length_m: f64,
    /// From side to side, m.
    pub width_m: f64,
}

/// Looks a robot up.
///
/// # Errors
/// A robot nobody knows, or a file that is wrong.
pub fn robot_info(name_or_path: &str) -> Result<RobotInfo, Error> {
    let robot = Robot::load(name_or_path)?;
    let body = RobotBody::of(&robot.file)?;
    Ok(RobotInfo {
        name: robot.name.clone(),
        description: robot.file.description.clone(),
        joints: robot.joint_names(),
        body: body.map(|body| told(&robot, &body)),
    })
}

fn told(robot: &Robot, body: &RobotBody) -> BodyInfo {
    let start: Vec<f64> = robot.joints.iter().map(|joint| joint.initial_rad).collect();
    let placed = body.tree.place(Placement::IDENTITY, &body.angles(&start));
    let centre = body.tree.centre_of_mass_m(&placed);
    let shapes: Vec<Vec<_>> = body
        .volumes
        .iter()
        .zip(&placed)
        .map(|(volumes, at)| volumes.iter().map(|volume| volume.placed(*at)).collect())
        .collect();
    let reach = |way: DVec3| {
        let all = shapes.iter().flatten().map(|volume| volume.reach_m(way));
        all.reduce(f64::max)
    };
    let (top, bottom) = (reach(DVec3::Z), reach(-DVec3::Z));
    let links = body.tree.links();
    let link = |index: usize| LinkInfo {
        name: links[index].name.clone(),
        mass_kg: links[index].mass.mass_kg,
        shapes: body.volumes[index].len(),
    };
    let sole = |of: &crate::robot::Sole| {
        let along = |axis: DVec3| {
            let at = of.corners_m.iter().map(|corner| corner.dot(axis));
            at.clone().fold(f64::NEG_INFINITY, f64::max) - at.fold(f64::INFINITY, f64::min)
        };
        let name = links[of.link].name.clone();
        SoleInfo { link: name, length_m: along(DVec3::X), width_m: along(DVec3::Y) }
    };
    let mut touching = Vec::new();
    for (one, here) in shapes.iter().enumerate() {
        for (two, there) in shapes.iter().enumerate().skip(one + 1) {
            if body.are_neighbours(one, two) {
                continue;
            }
            let pairs = here.iter().flat_map(|a| there.iter().map(move |b| a.distance_m(b)));
            let depth_m = -pairs.fold(f64::INFINITY, f64::min);
            if depth_m > 0.0 {
                touching.push((links[one].name.clone(), links[two].name.clone(), depth_m));
            }
        }
    }
    let file = robot.file.body.as_ref();
    let text =
        |of: fn(&gaitway_profiles::Body) -> &String| file.map(of).cloned().unwrap_or_default();
    BodyInfo {
        base: base_word(body.base),
        mass_kg: body.tree.mass_kg(),
        height_m: top.zip(bottom).map(|(top, bottom)| top + bottom),
        centre_height_m: bottom.map(|bottom| centre.z + bottom),
        centre_m: centre.to_array(),
        links: (0..links.len()).map(link).collect(),
        soles: body.soles.iter().map(sole).collect(),
        touching,
        source: text(|body| &body.source),
        licence: text(|body| &body.licence),
        shape_source: text(|body| &body.shape_source),
    }
}
