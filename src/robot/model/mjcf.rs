//! MJCF, the models of MuJoCo: bodies in one another, with defaults by class.
//! <https://mujoco.readthedocs.io/en/stable/XMLreference.html>.

use super::xml::{child, children, number, numbers, place, vector, wrong};
use super::{LinkMesh, Meshes, MovingJoint, PublicModel, meant, mesh, shown, some};
use crate::error::{Error, ErrorKind, counted};
use crate::rigid::{Capsule, Coupling, Cuboid, JointKind, Mass, Placement, Tree, TreeLink, Volume};
use gaitway_profiles::BaseKind;
use glam::{DMat3, DQuat, DVec3};
use roxmltree::{Document, Node};
use std::collections::BTreeMap;

mod servos;

/// Density of a geom that does not say, kg/m³.
const DENSITY_KG_M3: f64 = 1000.0;
/// A tendon held this near to zero, rad, ties its joints together.
const TIED_RAD: f64 = 0.05;
/// Joints of one body, at most: more say nothing more of how it can move.
const JOINTS_MAX: usize = 6;
/// Classes of defaults in one another, and elements of a tag in one, at most.
const CLASSES_MAX: usize = 64;

/// Reads the model in a parsed text.
pub(super) fn read(document: &Document<'_>, meshes: &mut Meshes<'_>) -> Result<PublicModel, Error> {
    let root = document.root_element();
    refuse_what_unfolds(root)?;
    let compiler = Compiler::read(root)?;
    let mut reader = Reader {
        defaults: Defaults::read(root)?,
        assets: assets(root, &compiler.mesh_folder)?,
        compiler,
        meshes,
        tree: Vec::new(),
        joints: Vec::new(),
        volumes: Vec::new(),
        looks: Vec::new(),
        unread: Vec::new(),
        weightless: Vec::new(),
    };
    let mut notes = Vec::new();
    let body = the_robot(root, &mut notes)?;
    let base = reader.bodies(body)?;
    reader.mark_driven(root);
    let (couplings, loops) = reader.ties(root, &mut notes)?;
    if !reader.unread.is_empty() {
        notes.push(format!("meshes that cannot be read: {}", some(&reader.unread)));
    }
    if !reader.weightless.is_empty() {
        let names = some(&reader.weightless);
        notes.push(format!("no mass is written for {names}: it would come from meshes"));
    }
    let name = root.attribute("model").unwrap_or("robot");
    let servos = reader.servos(root);
    let tree = Tree::new(reader.tree, couplings)?;
    servos.onto(&mut reader.joints, &tree, base);
    Ok(PublicModel {
        name: shown(name),
        format: "MJCF",
        tree,
        base,
        joints: reader.joints,
        volumes: reader.volumes,
        looks: reader.looks,
        loops,
        notes,
    })
}

/// Elements that MuJoCo unfolds into others when it compiles a model.
fn refuse_what_unfolds(root: Node<'_, '_>) -> Result<(), Error> {
    let unfolds = ["include", "replicate", "attach", "frame", "composite", "flexcomp"];
    let found = root.descendants().find(|node| unfolds.contains(&node.tag_name().name()));
    match found {
        None => Ok(()),
        Some(node) => Err(Error::of(ErrorKind::Malformed, "the model is not unfolded")
            .at(place(node))
            .allowed("a model without <include>, <replicate>, <attach> and <frame>")
            .remedy(
                "let MuJoCo write it in one piece: mujoco.mj_saveLastXML(\"whole.xml\", model)",
            )),
    }
}

/// The body that is the robot: free, or the one with most bodies in it.
fn the_robot<'a, 'i>(root: Node<'a, 'i>, notes: &mut Vec<String>) -> Result<Node<'a, 'i>, Error> {
    let bodies: Vec<Node> = children(root, "worldbody").flat_map(|w| children(w, "body")).collect();
    let size = |body: &Node| body.descendants().filter(|node| node.has_tag_name("body")).count();
    let found = bodies.iter().max_by_key(|body| (is_free(**body), size(body))).copied();
    if bodies.len() > 1 {
        notes.push(format!("{} of the world left out", counted(bodies.len() - 1, "other body")));
    }
    found.ok_or_else(|| {
        Error::of(ErrorKind::Malformed, "the model has no body")
            .at("<worldbody>")
            .allowed("a robot")
    })
}

fn is_free(body: Node<'_, '_>) -> bool {
    let is_free_joint = |joint: Node<'_, '_>| joint.attribute("type") == Some("free");
    child(body, "freejoint").is_some() || children(body, "joint").any(is_free_joint)
}

/// How the model writes its numbers.
struct Compiler {
    radians: bool,
    autolimits: bool,
    /// Order of Euler angles: capital letters turn about fixed axes.
    euler: String,
    mass_from_geoms: bool,
    mesh_folder: String,
}

impl Compiler {
    fn read(root: Node<'_, '_>) -> Result<Self, Error> {
        let get = |key: &str| {
            children(root, "compiler").filter_map(|compiler| compiler.attribute(key)).last()
        };
        let euler = get("eulerseq").unwrap_or("xyz");
        let is_order = euler.len() == 3 && euler.bytes().all(|c| b"xyzXYZ".contains(&c));
        for (key, harmless) in [("settotalmass", "-1"), ("coordinate", "local")] {
            if let Some(text) = get(key).filter(|text| *text != harmless) {
                return Err(wrong(root, key, text, harmless));
            }
        }
        if !is_order {
            return Err(wrong(root, "eulerseq", euler, "three of xyzXYZ"));
        }
        let folder = get("meshdir").or_else(|| get("assetdir")).unwrap_or_default();
        Ok(Self {
            radians: get("angle") == Some("radian"),
            autolimits: get("autolimits") != Some("false"),
            euler: euler.to_owned(),
            mass_from_geoms: get("inertiafromgeom") == Some("true"),
            mesh_folder: folder.trim_end_matches('/').to_owned(),
        })
    }

    fn angle(&self, value: f64) -> f64 {
        if self.radians { value } else { value.to_radians() }
    }
}

/// The file of a mesh and how it is scaled.
struct Asset {
    file: String,
    scale: DVec3,
}

/// Attributes by class and tag, as far as nothing nearer says otherwise.
struct Defaults<'a, 'i> {
    /// Index of each class by name; "main" is the outermost.
    class_of: BTreeMap<&'a str, usize>,
    /// The class around each.
    around: Vec<Option<usize>>,
    /// Elements that set attributes of a tag, in the order of the file.
    sets: BTreeMap<(usize, &'a str), Vec<Node<'a, 'i>>>,
}

impl<'a, 'i> Defaults<'a, 'i> {
    fn read(root: Node<'a, 'i>) -> Result<Self, Error> {
        let mut found = Self {
            class_of: BTreeMap::from([("main", 0)]),
            around: vec![None],
            sets: BTreeMap::new(),
        };
        let mut open: Vec<(Node, Option<usize>)> =
            children(root, "default").map(|node| (node, None)).collect();
        open.reverse();
        while let Some((node, around)) = open.pop() {
            let class = match (node.attribute("class"), around) {
                (None, None) => 0,
                (Some("main"), None) => 0,
                (Some(name), around) => {
                    let next = found.around.len();
                    let class = *found.class_of.entry(name).or_insert(next);
                    if class == next {
                        found.around.push(Some(around.unwrap_or(0)));
                    }
                    class
                }
                (None, Some(_)) => {
                    return Err(Error::of(
                        ErrorKind::Malformed,
                        "a class of defaults needs a name",
                    )
                    .at(place(node))
                    .allowed("class"));
                }
            };
            if found.chain(class).count() > CLASSES_MAX {
                return Err(Error::of(
                    ErrorKind::Malformed,
                    "classes stand too deep in one another",
                )
                .at(place(node))
                .allowed(format!("{CLASSES_MAX}")));
            }
            for element in node.children().filter(Node::is_element) {
                match element.tag_name().name() {
                    "default" => open.push((element, Some(class))),
                    tag => {
                        let sets = found.sets.entry((class, tag)).or_default();
                        sets.push(element);
                        if sets.len() > CLASSES_MAX {
                            let what = "a class sets the same element again and again";
                            return Err(Error::of(ErrorKind::Malformed, what).at(place(element)));
                        }
                    }
                }
            }
        }
        Ok(found)
    }

    /// A class and those around it; a circle, which a redefinition might make, ends.
    fn chain(&self, class: usize) -> impl Iterator<Item = usize> {
        std::iter::successors(Some(class), |class| self.around[*class]).take(CLASSES_MAX + 1)
    }

    /// What an element's attribute is: its own, its class's, or that of its surroundings.
    fn get(&self, node: Node<'a, 'i>, surroundings: usize, key: &str) -> Option<&'a str> {
        if let Some(own) = node.attribute(key) {
            return Some(own);
        }
        let class = node.attribute("class").and_then(|name| self.class_of.get(name).copied());
        let tag = node.tag_name().name();
        self.chain(class.unwrap_or(surroundings)).find_map(|class| {
            let sets = self.sets.get(&(class, tag))?;
            sets.iter().rev().find_map(|set| set.attribute(key))
        })
    }
}

/// What has been read so far.
struct Reader<'a, 'i, 'm> {
    defaults: Defaults<'a, 'i>,
    compiler: Compiler,
    assets: BTreeMap<String, Asset>,
    meshes: &'m mut Meshes<'m>,
    tree: Vec<TreeLink>,
    joints: Vec<MovingJoint>,
    volumes: Vec<Vec<Volume>>,
    looks: Vec<Vec<LinkMesh>>,
    unread: Vec<String>,
    weightless: Vec<String>,
}

/// A form with its place in its body.
struct Geom {
    at: Placement,
    form: Form,
    /// Nothing touches it.
    visual: bool,
}

enum Form {
    Ball(f64),
    /// Radius and half its length along Z, without the round ends.
    Capsule(f64, f64),
    Cylinder(f64, f64),
    Ellipsoid(DVec3),
    Box(DVec3),
    Mesh(String),
    /// A plane, a height field: the world's, not a robot's.
    Other,
}

impl<'a, 'i> Reader<'a, 'i, '_> {
    /// All bodies from this one on, each after the one it is in; how the first is held.
    fn bodies(&mut self, robot: Node<'a, 'i>) -> Result<BaseKind, Error> {
        let free = is_free(robot);
        let held = !free && child(robot, "joint").is_some();
        let mut parent = None;
        if held {
            // Its own joint moves it against what it is screwed to.
            self.push("world".to_owned(), None, Placement::IDENTITY, Mass::NONE);
            parent = Some(0);
        }
        let mut open = vec![(robot, parent, 0)];
        while let Some((body, parent, surroundings)) = open.pop() {
            let surroundings = match body.attribute("childclass") {
                Some(name) => self.class(body, name)?,
                None => surroundings,
            };
            let link = self.body(body, parent, surroundings)?;
            let inner: Vec<Node> = children(body, "body").collect();
            open.extend(inner.into_iter().rev().map(|inner| (inner, Some(link), surroundings)));
            if self.tree.len() > crate::rigid::tree::LINKS_MAX {
                return Err(Error::of(ErrorKind::Malformed, "this many bodies are no robot")
                    .allowed(format!("at most {}", crate::rigid::tree::LINKS_MAX)));
            }
        }
        Ok(if free { BaseKind::Free } else { BaseKind::Fixed })
    }

    fn class(&self, node: Node<'_, '_>, name: &str) -> Result<usize, Error> {
        self.defaults.class_of.get(name).copied().ok_or_else(|| {
            Error::of(ErrorKind::Malformed, "there is no such class of defaults")
                .at(place(node))
                .got(shown(name))
        })
    }

    fn push(&mut self, name: String, parent: Option<usize>, origin: Placement, mass: Mass) {
        self.tree.push(TreeLink {
            name,
            parent,
            kind: JointKind::Fixed,
            origin,
            axis: DVec3::ZERO,
            anchor_m: DVec3::ZERO,
            mass,
        });
        self.volumes.push(Vec::new());
        self.looks.push(Vec::new());
    }

    /// A body as one link for each of its joints, the last with what it weighs; the index of that.
    fn body(
        &mut self,
        body: Node<'a, 'i>,
        parent: Option<usize>,
        surroundings: usize,
    ) -> Result<usize, Error> {
        let name = match body.attribute("name") {
            Some(name) if self.tree.iter().any(|link| link.name == name) => {
                return Err(Error::of(ErrorKind::Malformed, "two bodies have the same name")
                    .at(place(body)));
            }
            Some(name) => name.to_owned(),
            None => format!("body{}", self.tree.len()),
        };
        let origin = match parent {
            // Where a free or a fixed base stands is not the robot's matter.
            None => Placement::IDENTITY,
            Some(_) => self.placement(body, surroundings, &["pos"])?,
        };
        let geoms = self.geoms(body, surroundings)?;
        let mass = self.mass(body, &name, &geoms)?;
        let mut joints: Vec<Node> = children(body, "joint").collect();
        joints.retain(|joint| joint.attribute("type") != Some("free"));
        if joints.len() > JOINTS_MAX {
            return Err(Error::of(ErrorKind::Malformed, "a body cannot have this many joints")
                .at(place(body))
                .got(joints.len().to_string())
                .allowed(format!("{JOINTS_MAX}")));
        }
        let (mut parent, mut origin) = (parent, origin);
        for (index, joint) in joints.iter().enumerate() {
            let is_last = index + 1 == joints.len();
            let own = if is_last { name.clone() } else { format!("{name} before {index}") };
            let link = self.tree.len();
            self.push(own, parent, origin, if is_last { mass } else { Mass::NONE });
            self.joint(*joint, surroundings, link)?;
            (parent, origin) = (Some(link), Placement::IDENTITY);
        }
        if joints.is_empty() {
            self.push(name, parent, origin, mass);
        }
        let link = self.tree.len() - 1;
        self.looks[link] = self.looks_like(&geoms);
        let touching: Vec<Geom> = geoms.into_iter().filter(|geom| !geom.visual).collect();
        for geom in touching {
            let volume = self.volume(&geom);
            self.volumes[link].extend(volume);
        }
        Ok(link)
    }

    fn get(&self, node: Node<'a, 'i>, surroundings: usize, key: &str) -> Option<&'a str> {
        self.defaults.get(node, surroundings, key)
    }

    fn vector(
        &self,
        node: Node<'a, 'i>,
        surroundings: usize,
        key: &str,
        usual: DVec3,
    ) -> Result<DVec3, Error> {
        self.get(node, surroundings, key).map_or(Ok(usual), |text| vector(node, key, text))
    }

    fn joint(&mut self, node: Node<'a, 'i>, surroundings: usize, link: usize) -> Result<(), Error> {
        let get = |key: &str| self.get(node, surroundings, key);
        let kind = match get("type").unwrap_or("hinge") {
            "hinge" => JointKind::Hinge,
            "slide" => JointKind::Slide,
            other => return Err(wrong(node, "type", other, "hinge or slide")),
        };
        let axis = self.vector(node, surroundings, "axis", DVec3::Z)?;
        let axis = axis
            .try_normalize()
            .ok_or_else(|| wrong(node, "axis", get("axis").unwrap_or_default(), "a direction"))?;
        let anchor_m = self.vector(node, surroundings, "pos", DVec3::ZERO)?;
        if let Some(text) = get("ref")
            && number(node, "ref", text)? != 0.0
        {
            return Err(wrong(node, "ref", text, "0: a joint at zero where the model draws it"));
        }
        let limited = match get("limited").unwrap_or("auto") {
            "true" => true,
            "false" => false,
            _ => self.compiler.autolimits,
        };
        let range = match get("range").map(|text| numbers(node, "range", text, 2)).transpose()? {
            Some(range) if limited => match range.as_slice() {
                [lower, upper] if kind == JointKind::Hinge => {
                    meant(self.compiler.angle(*lower), self.compiler.angle(*upper), kind)
                }
                [lower, upper] => meant(*lower, *upper, kind),
                _ => None,
            },
            _ => None,
        };
        let name = match node.attribute("name") {
            Some(name) if self.joints.iter().any(|joint| joint.name == name) => {
                return Err(Error::of(ErrorKind::Malformed, "two joints have the same name")
                    .at(place(node)));
            }
            Some(name) => name.to_owned(),
            None => format!("joint{}", self.joints.len()),
        };
        let of = &mut self.tree[link];
        (of.kind, of.axis, of.anchor_m) = (kind, axis, anchor_m);
        let (velocity_rad_s, driven, holds) = (None, false, None);
        self.joints.push(MovingJoint { name, link, range, velocity_rad_s, driven, holds });
        Ok(())
    }

    /// Where an element is: its position and whatever says how it is turned.
    fn placement(
        &self,
        node: Node<'a, 'i>,
        surroundings: usize,
        position: &[&str],
    ) -> Result<Placement, Error> {
        let mut at_m = DVec3::ZERO;
        for key in position {
            at_m = self.vector(node, surroundings, key, at_m)?;
        }
        let get = |key: &str| self.get(node, surroundings, key);
        let many = |key: &str, count: usize| -> Result<Option<Vec<f64>>, Error> {
            let Some(text) = get(key) else { return Ok(None) };
            let values = numbers(node, key, text, count)?;
            if values.len() == count {
                return Ok(Some(values));
            }
            Err(wrong(node, key, text, &counted(count, "number")))
        };
        let direction = |key: &str, of: DVec3| {
            of.try_normalize()
                .ok_or_else(|| wrong(node, key, get(key).unwrap_or_default(), "a direction"))
        };
        let turn = if let Some(q) = many("quat", 4)? {
            let length = q.iter().map(|value| value * value).sum::<f64>().sqrt();
            if length < 1e-9 {
                return Err(wrong(node, "quat", get("quat").unwrap_or_default(), "a quaternion"));
            }
            DQuat::from_xyzw(q[1] / length, q[2] / length, q[3] / length, q[0] / length)
        } else if let Some(a) = many("axisangle", 4)? {
            let axis = direction("axisangle", DVec3::new(a[0], a[1], a[2]))?;
            DQuat::from_axis_angle(axis, self.compiler.angle(a[3]))
        } else if let Some(e) = many("euler", 3)? {
            self.euler(&e)
        } else if let Some(a) = many("xyaxes", 6)? {
            let x = direction("xyaxes", DVec3::new(a[0], a[1], a[2]))?;
            let y = DVec3::new(a[3], a[4], a[5]);
            let y = direction("xyaxes", y - x * x.dot(y))?;
            DQuat::from_mat3(&DMat3::from_cols(x, y, x.cross(y)))
        } else if let Some(z) = many("zaxis", 3)? {
            let z = direction("zaxis", DVec3::new(z[0], z[1], z[2]))?;
            DQuat::from_rotation_arc(DVec3::Z, z)
        } else {
            DQuat::IDENTITY
        };
        Ok(Placement { at_m, turn: turn.normalize() })
    }

    fn euler(&self, angles: &[f64]) -> DQuat {
        let about = |order: u8, angle: f64| match order.to_ascii_lowercase() {
            b'x' => DQuat::from_rotation_x(angle),
            b'y' => DQuat::from_rotation_y(angle),
            _ => DQuat::from_rotation_z(angle),
        };
        let steps = self.compiler.euler.bytes().zip(angles);
        steps.fold(DQuat::IDENTITY, |turn, (order, angle)| {
            let step = about(order, self.compiler.angle(*angle));
            if order.is_ascii_uppercase() { step * turn } else { turn * step }
        })
    }

    fn geoms(&mut self, body: Node<'a, 'i>, surroundings: usize) -> Result<Vec<Geom>, Error> {
        children(body, "geom").map(|geom| self.geom(geom, surroundings)).collect()
    }

    fn geom(&self, node: Node<'a, 'i>, surroundings: usize) -> Result<Geom, Error> {
        let get = |key: &str| self.get(node, surroundings, key);
        let is_zero = |key: &str| get(key) == Some("0");
        let visual = is_zero("contype") && is_zero("conaffinity");
        let mut at = self.placement(node, surroundings, &["pos"])?;
        let mut size = get("size").map_or(Ok(Vec::new()), |text| numbers(node, "size", text, 3))?;
        let mesh = get("mesh");
        let kind = get("type").unwrap_or(if mesh.is_some() { "mesh" } else { "sphere" });
        if let Some(text) = get("fromto") {
            let ends = numbers(node, "fromto", text, 6)?;
            let [a, b, c, d, e, f] = ends[..] else {
                return Err(wrong(node, "fromto", text, "6 numbers"));
            };
            let (from, to) = (DVec3::new(a, b, c), DVec3::new(d, e, f));
            let along = (to - from)
                .try_normalize()
                .ok_or_else(|| wrong(node, "fromto", text, "two points"))?;
            at = Placement {
                at_m: (from + to) / 2.0,
                turn: DQuat::from_rotation_arc(DVec3::Z, along),
            };
            let half = from.distance(to) / 2.0;
            match (kind, size.as_slice()) {
                ("capsule" | "cylinder", [radius, ..]) => size = vec![*radius, half],
                ("box" | "ellipsoid", [x, y, ..]) => size = vec![*x, *y, half],
                ("box" | "ellipsoid", [x]) => size = vec![*x, *x, half],
                _ => return Err(wrong(node, "fromto", text, "a size beside it")),
            }
        }
        let sized = |count: usize| {
            let sound = size.len() >= count && size[..count].iter().all(|value| *value > 0.0);
            let text = get("size").unwrap_or_default();
            sound.then_some(()).ok_or_else(|| {
                wrong(
                    node,
                    "size",
                    text,
                    &format!("{count} above 0", count = counted(count, "number")),
                )
            })
        };
        let form = match kind {
            "sphere" => {
                sized(1)?;
                Form::Ball(size[0])
            }
            "capsule" => {
                sized(2)?;
                Form::Capsule(size[0], size[1])
            }
            "cylinder" => {
                sized(2)?;
                Form::Cylinder(size[0], size[1])
            }
            "ellipsoid" => {
                sized(3)?;
                Form::Ellipsoid(DVec3::new(size[0], size[1], size[2]))
            }
            "box" => {
                sized(3)?;
                Form::Box(DVec3::new(size[0], size[1], size[2]))
            }
            "mesh" | "sdf" => Form::Mesh(mesh.unwrap_or_default().to_owned()),
            _ => Form::Other,
        };
        Ok(Geom { at, form, visual })
    }

    /// The meshes that are only seen, or, of a body that has none, those that touch.
    fn looks_like(&self, geoms: &[Geom]) -> Vec<LinkMesh> {
        let of = |visual: bool| {
            let of = geoms.iter().filter(move |geom| geom.visual == visual);
            of.filter_map(|geom| match &geom.form {
                Form::Mesh(name) => {
                    let Asset { file, scale } = self.assets.get(name)?;
                    Some(LinkMesh { file: file.clone(), scale: *scale, at: geom.at })
                }
                _ => None,
            })
        };
        let seen: Vec<LinkMesh> = of(true).collect();
        if seen.is_empty() { of(false).collect() } else { seen }
    }

    fn volume(&mut self, geom: &Geom) -> Option<Volume> {
        let ball = |radius_m: f64, half: f64| {
            let end = DVec3::Z * half;
            Volume::Capsule(Capsule { from_m: -end, to_m: end, radius_m })
        };
        let of_box = |half_m: DVec3| {
            let (centre_m, turn) = (DVec3::ZERO, DQuat::IDENTITY);
            Volume::Cuboid(Cuboid { centre_m, turn, half_m })
        };
        let volume = match &geom.form {
            Form::Ball(radius_m) => ball(*radius_m, 0.0),
            Form::Capsule(radius_m, half) => ball(*radius_m, *half),
            Form::Cylinder(radius_m, half) => mesh::cylinder(*radius_m, *half),
            Form::Ellipsoid(half_m) | Form::Box(half_m) => of_box(*half_m),
            Form::Mesh(name) => {
                let asset = self.assets.get(name);
                let found = asset
                    .and_then(|asset| mesh::fitted(&asset.file, asset.scale, &mut *self.meshes));
                if found.is_none() {
                    self.unread.push(shown(name));
                }
                found?
            }
            Form::Other => return None,
        };
        Some(volume.placed(geom.at))
    }

    fn mass(&mut self, body: Node<'a, 'i>, name: &str, geoms: &[Geom]) -> Result<Mass, Error> {
        if let Some(inertial) = child(body, "inertial")
            && !self.compiler.mass_from_geoms
        {
            let at = self.placement(inertial, 0, &["pos"])?;
            let text = inertial.attribute("mass").unwrap_or_default();
            let mass_kg = number(inertial, "mass", text)?;
            let six = |key: &str, count: usize| -> Result<Option<Vec<f64>>, Error> {
                let Some(text) = inertial.attribute(key) else { return Ok(None) };
                let values = numbers(inertial, key, text, count)?;
                let sound = values.len() == count;
                sound
                    .then_some(Some(values))
                    .ok_or_else(|| wrong(inertial, key, text, &counted(count, "number")))
            };
            let inertia_kg_m2 = if let Some(of) = six("fullinertia", 6)? {
                DMat3::from_cols(
                    DVec3::new(of[0], of[3], of[4]),
                    DVec3::new(of[3], of[1], of[5]),
                    DVec3::new(of[4], of[5], of[2]),
                )
            } else {
                let of = six("diaginertia", 3)?.unwrap_or_else(|| vec![0.0; 3]);
                DMat3::from_diagonal(DVec3::new(of[0], of[1], of[2]))
            };
            let own = Mass { mass_kg, centre_m: DVec3::ZERO, inertia_kg_m2 };
            return Ok(own.placed(at));
        }
        let mut whole = Mass::NONE;
        let mut unknown = false;
        for (geom, node) in geoms.iter().zip(children(body, "geom")) {
            match self.geom_mass(geom, node)? {
                Some(mass) => whole = whole.with(&mass),
                None => unknown = true,
            }
        }
        if unknown && whole.mass_kg == 0.0 {
            self.weightless.push(shown(name));
        }
        Ok(whole)
    }

    /// What a geom weighs; nothing if only its mesh could tell.
    fn geom_mass(&self, geom: &Geom, node: Node<'a, 'i>) -> Result<Option<Mass>, Error> {
        // Classes set masses of geoms too.
        let value = |key: &str| -> Result<Option<f64>, Error> {
            self.get(node, self.class_around(node), key).map(|t| number(node, key, t)).transpose()
        };
        let given = value("mass")?;
        let density = value("density")?.unwrap_or(DENSITY_KG_M3);
        let pi = std::f64::consts::PI;
        // Volume, and moments of inertia of 1 kg.
        let of_box = |h: DVec3, share: f64| {
            let square = h * h * share;
            DVec3::new(square.y + square.z, square.x + square.z, square.x + square.y)
        };
        let (volume, moments) = match geom.form {
            Form::Ball(r) => (4.0 / 3.0 * pi * r.powi(3), DVec3::splat(0.4 * r * r)),
            Form::Ellipsoid(h) => (4.0 / 3.0 * pi * h.x * h.y * h.z, of_box(h, 0.2)),
            Form::Box(h) => (8.0 * h.x * h.y * h.z, of_box(h, 1.0 / 3.0)),
            Form::Cylinder(r, h) => {
                let across = (3.0 * r * r + 4.0 * h * h) / 12.0;
                (2.0 * pi * r * r * h, DVec3::new(across, across, r * r / 2.0))
            }
            Form::Capsule(r, h) => {
                let (rod, ends) = (2.0 * pi * r * r * h, 4.0 / 3.0 * pi * r.powi(3));
                let (rod_share, ends_share) = (rod / (rod + ends), ends / (rod + ends));
                // Two half balls, their centres of mass 3 r / 8 beyond the rod's ends.
                let across = rod_share * (3.0 * r * r + 4.0 * h * h) / 12.0
                    + ends_share * (0.4 * r * r + h * h + 0.75 * h * r);
                let along = rod_share * r * r / 2.0 + ends_share * 0.4 * r * r;
                (rod + ends, DVec3::new(across, across, along))
            }
            Form::Mesh(_) => {
                return Ok(given.filter(|mass| *mass == 0.0).map(|_| Mass::NONE));
            }
            Form::Other => return Ok(Some(Mass::NONE)),
        };
        let mass_kg = given.unwrap_or(volume * density);
        if mass_kg == 0.0 {
            return Ok(Some(Mass::NONE));
        }
        let inertia_kg_m2 = DMat3::from_diagonal(moments * mass_kg);
        let own = Mass { mass_kg, centre_m: DVec3::ZERO, inertia_kg_m2 };
        Ok(Some(own.placed(geom.at)))
    }

    /// The class that the bodies around an element give it.
    fn class_around(&self, node: Node<'a, 'i>) -> usize {
        let named = node.ancestors().find_map(|around| around.attribute("childclass"));
        named.and_then(|name| self.defaults.class_of.get(name).copied()).unwrap_or(0)
    }

    /// What actuators pull at.
    fn mark_driven(&mut self, root: Node<'_, '_>) {
        let actuators = children(root, "actuator").flat_map(|all| all.children());
        let driven: Vec<&str> = actuators.filter_map(|one| one.attribute("joint")).collect();
        for joint in &mut self.joints {
            joint.driven = driven.contains(&joint.name.as_str());
        }
    }

    /// Joints tied to joints; what ties bodies to bodies is a closed chain.
    fn ties(
        &self,
        root: Node<'_, '_>,
        notes: &mut Vec<String>,
    ) -> Result<(Vec<Coupling>, Vec<String>), Error> {
        let link = |name: Option<&str>| {
            let joint = self.joints.iter().find(|joint| Some(joint.name.as_str()) == name)?;
            Some((joint.link, joint.driven))
        };
        let (mut couplings, mut loops): (Vec<Coupling>, Vec<String>) = (Vec::new(), Vec::new());
        let ends = |node: &Node<'_, '_>, one: &str, two: &str| {
            let name = |key: &str| shown(node.attribute(key).unwrap_or("the world"));
            format!("{} to {}", name(one), name(two))
        };
        for tie in children(root, "equality").flat_map(|all| all.children()) {
            if !tie.is_element() || tie.attribute("active") == Some("false") {
                continue;
            }
            match tie.tag_name().name() {
                "joint" => {
                    let text = tie.attribute("polycoef").unwrap_or("0 1 0 0 0");
                    let terms = numbers(tie, "polycoef", text, 5)?;
                    let straight = terms.iter().skip(2).all(|term| *term == 0.0);
                    let (one, two) = (link(tie.attribute("joint1")), link(tie.attribute("joint2")));
                    let (Some((one, _)), Some((two, _)), true) = (one, two, straight) else {
                        let between = ends(&tie, "joint1", "joint2");
                        notes.push(format!("a tie that is no ratio was left out: {between}"));
                        continue;
                    };
                    let offset = terms.first().copied().unwrap_or(0.0);
                    let ratio = terms.get(1).copied().unwrap_or(1.0);
                    couplings.push(Coupling { link: one, of: vec![(two, ratio)], offset });
                }
                "connect" | "weld" => {
                    let keys = if tie.has_attribute("body1") {
                        ["body1", "body2"]
                    } else {
                        ["site1", "site2"]
                    };
                    loops.push(ends(&tie, keys[0], keys[1]));
                }
                other => notes.push(format!("a tie of kind {} was left out", shown(other))),
            }
        }
        for tendon in children(root, "tendon").flat_map(|all| children(all, "fixed")) {
            let range = tendon.attribute("range").map(|text| numbers(tendon, "range", text, 2));
            let range = range.transpose()?.unwrap_or_default();
            if !matches!(range.as_slice(), [low, high] if low.abs().max(high.abs()) <= TIED_RAD) {
                continue;
            }
            let mut terms = Vec::new();
            for joint in children(tendon, "joint") {
                let text = joint.attribute("coef").unwrap_or("1");
                let coef = number(joint, "coef", text)?;
                terms.extend(link(joint.attribute("joint")).map(|found| (found, coef)));
            }
            // The one joint that nothing drives gives way.
            let passive: Vec<_> = terms.iter().filter(|((_, driven), _)| !driven).collect();
            let [((follows, _), own)] = passive.as_slice() else { continue };
            if *own == 0.0 || terms.len() < 2 {
                continue;
            }
            let of = terms.iter().filter(|((_, driven), _)| *driven);
            let of = of.map(|((link, _), coef)| (*link, -coef / own)).collect();
            couplings.push(Coupling { link: *follows, of, offset: 0.0 });
        }
        Ok((couplings, loops))
    }
}

/// Files and scales of meshes, by name.
fn assets(root: Node<'_, '_>, folder: &str) -> Result<BTreeMap<String, Asset>, Error> {
    let mut found = BTreeMap::new();
    let scale_of_all = children(root, "default")
        .flat_map(|defaults| children(defaults, "mesh"))
        .find_map(|mesh| Some((mesh, mesh.attribute("scale")?)));
    let usual = scale_of_all.map(|(mesh, text)| vector(mesh, "scale", text)).transpose()?;
    for mesh in children(root, "asset").flat_map(|all| children(all, "mesh")) {
        let Some(file) = mesh.attribute("file") else { continue };
        let stem = file.rsplit('/').next().unwrap_or(file);
        let stem = stem.rsplit_once('.').map_or(stem, |(stem, _)| stem);
        let name = mesh.attribute("name").unwrap_or(stem).to_owned();
        let scale = match mesh.attribute("scale") {
            Some(text) => vector(mesh, "scale", text)?,
            None => usual.unwrap_or(DVec3::ONE),
        };
        let file = if folder.is_empty() { file.to_owned() } else { format!("{folder}/{file}") };
        found.insert(name, Asset { file, scale });
    }
    Ok(found)
}
