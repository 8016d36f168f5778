//! URDF (Unified Robot Description Format): links and joints side by side, tied by name.
//! <https://wiki.ros.org/urdf/XML>.

use super::xml::{child, children, number, place, vector, wrong};
use super::{LinkMesh, Meshes, MovingJoint, PublicModel, meant, mesh, shown};
use crate::error::{Error, ErrorKind, counted};
use crate::rigid::{Capsule, Coupling, Cuboid, JointKind, Mass, Placement, Tree, TreeLink, Volume};
use gaitway_profiles::BaseKind;
use glam::{DMat3, DQuat, DVec3};
use roxmltree::{Document, Node};
use std::collections::BTreeMap;

/// Most links, before anything is made of them.
const LINKS_MAX: usize = crate::rigid::tree::LINKS_MAX;

/// Reads the model in a parsed text.
pub(super) fn read(document: &Document<'_>, meshes: &mut Meshes<'_>) -> Result<PublicModel, Error> {
    let robot = document.root_element();
    let refuse = |what: &str| Error::of(ErrorKind::Malformed, what);
    let links: Vec<Node> = children(robot, "link").collect();
    let joints: Vec<Node> = children(robot, "joint").collect();
    if links.len() > LINKS_MAX {
        return Err(refuse("this many links are no robot")
            .got(links.len().to_string())
            .allowed(format!("at most {LINKS_MAX}")));
    }
    let (order, floats) = order(&links, &joints)?;
    let mut notes = Vec::new();
    let (mut tree, mut moving) = (Vec::new(), Vec::new());
    let (mut volumes, mut looks) = (Vec::new(), Vec::new());
    let mut index_of: BTreeMap<&str, usize> = BTreeMap::new();
    let mut link_of_joint: BTreeMap<&str, usize> = BTreeMap::new();
    let mut shapeless = Vec::new();
    for (link, joint) in &order {
        let index = tree.len();
        let name = named(*link, "name")?;
        index_of.insert(name, index);
        let parent =
            joint.map(|joint| of(joint, "parent").map(|name| index_of[name])).transpose()?;
        let hung = joint.map_or(Ok(Hung::BASE), Hung::read)?;
        if let Some(joint) = *joint {
            let joint_name = named(joint, "name")?;
            if link_of_joint.insert(joint_name, index).is_some() {
                return Err(refuse("two joints have the same name").at(place(joint)));
            }
            if hung.kind != JointKind::Fixed {
                moving.push(hung.joint(joint, joint_name, index)?);
            }
        }
        let mass = mass(*link)?;
        volumes.push(take_up(*link, meshes, &mut shapeless)?);
        looks.push(looks_like(*link)?);
        tree.push(TreeLink {
            name: name.to_owned(),
            parent,
            kind: hung.kind,
            origin: hung.origin,
            axis: hung.axis,
            anchor_m: DVec3::ZERO,
            mass,
        });
    }
    let couplings = couplings(&joints, &link_of_joint, &mut moving)?;
    if !shapeless.is_empty() {
        notes.push(format!("meshes that cannot be read: {}", super::some(&shapeless)));
    }
    let name = robot.attribute("name").unwrap_or("robot");
    let tree = Tree::new(tree, couplings)?;
    let base =
        if floats || tree.links()[0].mass.mass_kg > 0.0 { BaseKind::Free } else { BaseKind::Fixed };
    if !floats {
        let word = "URDF does not say whether the base is free: taken as free if it has mass";
        notes.push(word.to_owned());
    }
    Ok(PublicModel {
        name: shown(name),
        format: "URDF",
        tree,
        base,
        joints: moving,
        volumes,
        looks,
        loops: Vec::new(),
        notes,
    })
}

fn named<'a>(node: Node<'a, '_>, key: &str) -> Result<&'a str, Error> {
    node.attribute(key).filter(|name| !name.is_empty() && name.len() <= 200).ok_or_else(|| {
        Error::of(ErrorKind::Malformed, "an element needs a name").at(place(node)).allowed(key)
    })
}

/// The name in `<parent link="..."/>` or `<child link="..."/>`.
fn of<'a>(joint: Node<'a, '_>, end: &str) -> Result<&'a str, Error> {
    let end = child(joint, end).ok_or_else(|| {
        Error::of(ErrorKind::Malformed, "a joint needs a parent and a child").at(place(joint))
    })?;
    named(end, "link")
}

/// Every link after its parent, with the joint it hangs on; with it, whether the first floats.
type Order<'a, 'i> = Vec<(Node<'a, 'i>, Option<Node<'a, 'i>>)>;

fn order<'a, 'i>(
    links: &[Node<'a, 'i>],
    joints: &[Node<'a, 'i>],
) -> Result<(Order<'a, 'i>, bool), Error> {
    let refuse = |what: &str| Error::of(ErrorKind::Malformed, what);
    let mut by_name = BTreeMap::new();
    for link in links {
        if by_name.insert(named(*link, "name")?, *link).is_some() {
            return Err(refuse("two links have the same name").at(place(*link)));
        }
    }
    let mut hung: BTreeMap<&str, Node> = BTreeMap::new();
    let mut carried: BTreeMap<&str, Vec<(&str, Node)>> = BTreeMap::new();
    for joint in joints {
        let (parent, below) = (of(*joint, "parent")?, of(*joint, "child")?);
        for name in [parent, below] {
            if !by_name.contains_key(name) {
                return Err(refuse("a joint names a link that is not there")
                    .at(place(*joint))
                    .got(shown(name)));
            }
        }
        if hung.insert(below, *joint).is_some() {
            return Err(refuse("a link hangs on two joints: a closed chain is no tree")
                .at(place(*joint))
                .got(shown(below)));
        }
        carried.entry(parent).or_default().push((below, *joint));
    }
    let roots: Vec<&str> =
        by_name.keys().copied().filter(|name| !hung.contains_key(name)).collect();
    let [root] = roots.as_slice() else {
        return Err(refuse("a robot has one link that hangs on nothing")
            .got(counted(roots.len(), "such link"))
            .allowed("1; with none the joints go round in a circle"));
    };
    // What floats against a root without mass is the robot, and free.
    let mut root = *root;
    let floats = |joint: &Node| joint.attribute("type") == Some("floating");
    let mut left_out = 0;
    if let Some([(below, joint)]) = carried.get(root).map(Vec::as_slice)
        && floats(joint)
        && child(by_name[root], "inertial").is_none()
    {
        (root, left_out) = (below, 1);
    }
    let mut order = vec![(by_name[root], None)];
    let mut next = 0;
    while let Some((link, _)) = order.get(next) {
        let name = link.attribute("name").unwrap_or_default();
        for (below, joint) in carried.remove(name).unwrap_or_default() {
            order.push((by_name[below], Some(joint)));
        }
        next += 1;
    }
    if order.len() + left_out < links.len() {
        return Err(refuse("some links hang on one another in a circle").got(format!(
            "{} of {} reached",
            order.len(),
            counted(links.len(), "link")
        )));
    }
    Ok((order, left_out > 0))
}

/// How a link hangs.
struct Hung {
    kind: JointKind,
    origin: Placement,
    axis: DVec3,
}

impl Hung {
    const BASE: Self =
        Self { kind: JointKind::Fixed, origin: Placement::IDENTITY, axis: DVec3::ZERO };

    fn read(joint: Node<'_, '_>) -> Result<Self, Error> {
        let kind = match joint.attribute("type") {
            Some("fixed") => JointKind::Fixed,
            Some("revolute" | "continuous") => JointKind::Hinge,
            Some("prismatic") => JointKind::Slide,
            other => {
                let got = other.unwrap_or_default();
                let allowed = "fixed, revolute, continuous or prismatic";
                return Err(wrong(joint, "type", got, allowed));
            }
        };
        let axis = match child(joint, "axis").and_then(|of| Some((of, of.attribute("xyz")?))) {
            Some((of, text)) => {
                let axis = vector(of, "xyz", text)?;
                match axis.try_normalize() {
                    Some(axis) => axis,
                    None if kind == JointKind::Fixed => DVec3::ZERO,
                    None => return Err(wrong(of, "xyz", text, "a direction")),
                }
            }
            None => DVec3::X,
        };
        Ok(Self { kind, origin: origin(joint)?, axis })
    }

    fn joint(&self, node: Node<'_, '_>, name: &str, link: usize) -> Result<MovingJoint, Error> {
        let limit = child(node, "limit");
        let value = |key: &str| -> Result<Option<f64>, Error> {
            let found = limit.and_then(|limit| Some((limit, limit.attribute(key)?)));
            found.map(|(limit, text)| number(limit, key, text)).transpose()
        };
        let is_endless = node.attribute("type") == Some("continuous");
        let range = match (value("lower")?, value("upper")?) {
            (Some(lower), Some(upper)) if !is_endless => meant(lower, upper, self.kind),
            _ => None,
        };
        let velocity_rad_s = value("velocity")?.filter(|speed| *speed > 0.0);
        let (name, driven, holds) = (name.to_owned(), true, None);
        Ok(MovingJoint { name, link, range, velocity_rad_s, driven, holds })
    }
}

/// `<origin xyz="" rpy=""/>`: turned about the fixed axes X, then Y, then Z.
fn origin(node: Node<'_, '_>) -> Result<Placement, Error> {
    let Some(origin) = child(node, "origin") else { return Ok(Placement::IDENTITY) };
    let get = |key: &str| -> Result<DVec3, Error> {
        origin.attribute(key).map_or(Ok(DVec3::ZERO), |text| vector(origin, key, text))
    };
    let rpy = get("rpy")?;
    let turn = DQuat::from_rotation_z(rpy.z)
        * DQuat::from_rotation_y(rpy.y)
        * DQuat::from_rotation_x(rpy.x);
    Ok(Placement { at_m: get("xyz")?, turn: turn.normalize() })
}

fn mass(link: Node<'_, '_>) -> Result<Mass, Error> {
    let Some(inertial) = child(link, "inertial") else { return Ok(Mass::NONE) };
    let value = |element: Node<'_, '_>, key: &str| -> Result<f64, Error> {
        element.attribute(key).map_or(Ok(0.0), |text| number(element, key, text))
    };
    let mass_kg = child(inertial, "mass").map_or(Ok(0.0), |mass| value(mass, "value"))?;
    let origin = origin(inertial)?;
    let inertia = match child(inertial, "inertia") {
        Some(of) => {
            let get = |key: &str| value(of, key);
            let (xx, yy, zz) = (get("ixx")?, get("iyy")?, get("izz")?);
            let (xy, xz, yz) = (get("ixy")?, get("ixz")?, get("iyz")?);
            DMat3::from_cols(DVec3::new(xx, xy, xz), DVec3::new(xy, yy, yz), DVec3::new(xz, yz, zz))
        }
        None => DMat3::ZERO,
    };
    let own = Mass { mass_kg, centre_m: DVec3::ZERO, inertia_kg_m2: inertia };
    Ok(own.placed(origin))
}

/// What the link's collision elements take up.
fn take_up(
    link: Node<'_, '_>,
    meshes: &mut Meshes<'_>,
    unread: &mut Vec<String>,
) -> Result<Vec<Volume>, Error> {
    let mut found = Vec::new();
    for collision in children(link, "collision") {
        let Some(geometry) = child(collision, "geometry") else { continue };
        let Some(form) = geometry.children().find(Node::is_element) else { continue };
        let origin = origin(collision)?;
        let positive = |key: &str| -> Result<f64, Error> {
            let text = form.attribute(key).unwrap_or_default();
            number(form, key, text)
                .ok()
                .filter(|value| *value > 0.0)
                .ok_or_else(|| wrong(form, key, text, "a number above 0"))
        };
        let volume = match form.tag_name().name() {
            "box" => {
                let size = vector(form, "size", form.attribute("size").unwrap_or_default())?;
                Some(Volume::Cuboid(Cuboid {
                    centre_m: DVec3::ZERO,
                    turn: DQuat::IDENTITY,
                    half_m: (size / 2.0).abs(),
                }))
            }
            "cylinder" => {
                Some(super::mesh::cylinder(positive("radius")?, positive("length")? / 2.0))
            }
            "sphere" => Some(Volume::Capsule(Capsule {
                from_m: DVec3::ZERO,
                to_m: DVec3::ZERO,
                radius_m: positive("radius")?,
            })),
            "mesh" => {
                let file = named(form, "filename")?;
                let volume = mesh::fitted(file, scale(form)?, meshes);
                if volume.is_none() {
                    unread.push(shown(file));
                }
                volume
            }
            _ => None,
        };
        found.extend(volume.map(|volume| volume.placed(origin)));
    }
    Ok(found)
}

/// The meshes of the link's visual elements.
fn looks_like(link: Node<'_, '_>) -> Result<Vec<LinkMesh>, Error> {
    let mut found = Vec::new();
    for visual in children(link, "visual") {
        let mesh = child(visual, "geometry").and_then(|geometry| child(geometry, "mesh"));
        let Some(mesh) = mesh else { continue };
        let file = named(mesh, "filename")?.to_owned();
        found.push(LinkMesh { file, scale: scale(mesh)?, at: origin(visual)? });
    }
    Ok(found)
}

fn scale(mesh: Node<'_, '_>) -> Result<DVec3, Error> {
    mesh.attribute("scale").map_or(Ok(DVec3::ONE), |text| vector(mesh, "scale", text))
}

fn couplings(
    joints: &[Node<'_, '_>],
    link_of: &BTreeMap<&str, usize>,
    moving: &mut [MovingJoint],
) -> Result<Vec<Coupling>, Error> {
    let mut found = Vec::new();
    for joint in joints {
        let Some(mimic) = child(*joint, "mimic") else { continue };
        let other = named(mimic, "joint")?;
        let value = |key: &str, usual: f64| -> Result<f64, Error> {
            mimic.attribute(key).map_or(Ok(usual), |text| number(mimic, key, text))
        };
        let &of = link_of.get(other).ok_or_else(|| {
            Error::of(ErrorKind::Malformed, "a joint follows one that is not there")
                .at(place(*joint))
                .got(shown(other))
        })?;
        let link = link_of[named(*joint, "name")?];
        if let Some(joint) = moving.iter_mut().find(|joint| joint.link == link) {
            joint.driven = false;
        }
        let (ratio, offset) = (value("multiplier", 1.0)?, value("offset", 0.0)?);
        found.push(Coupling { link, of: vec![(of, ratio)], offset });
    }
    Ok(found)
}
