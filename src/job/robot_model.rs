//! A robot file, or its body, from a public model.

use super::model::segment;
use crate::body::segment_name;
use crate::error::{Error, ErrorKind, counted};
use crate::robot::model::surface::Surface;
use crate::robot::model::{self, DraftServo, LinkMesh, OwnJoint, Provenance, PublicModel, Reduced};
use gaitway_profiles::{self as profiles, BaseKind};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
use std::path::{Component, Path, PathBuf};

/// Largest model that is read, bytes.
const FILE_BYTES_MAX: u64 = 8 << 20;
/// Largest mesh, bytes.
pub(in crate::job) const MESH_BYTES_MAX: u64 = 64 << 20;
/// Why nothing is made of a file.
pub(in crate::job) const NO_MESH: &str = "neither STL nor OBJ, or its corners are no finite places";
/// A model's own files are this many folders above it at most: `../meshes`.
const FOLDERS_ABOVE: i64 = 2;
/// Of a servo's speed without load: what a draft lets a joint have.
const SPEED_SHARE: f64 = 0.5;

/// Where profiles of servos are listed.
const SERVOS: &str = "`gaitway profile list` has them";

/// What to read, and onto what.
#[derive(Clone, Debug, PartialEq)]
pub struct ImportOrder {
    /// The model, URDF or MJCF.
    pub model: PathBuf,
    /// The file that is to be written: meshes are named as they are seen from there.
    pub file: PathBuf,
    /// What the new robot is to be called.
    pub name: String,
    /// A robot whose file gets the body; `None`: a draft of a robot of its own.
    pub robot: Option<String>,
    /// Joints of the model that are not at zero where the robot's are, rad.
    pub zero: Vec<(String, f64)>,
    /// Profile of the servos of a draft.
    pub servo: Option<String>,
    /// Where the model is from; `None`: its file's name.
    pub source: Option<String>,
    /// The model's licence.
    pub licence: Option<String>,
    /// The model's own shapes are put aside for capsules and boxes from lengths and masses.
    pub plain_shapes: bool,
}

/// What came of it.
#[derive(Clone, Debug, Serialize)]
pub struct Imported {
    /// What the robot is called.
    pub name: String,
    /// `URDF` or `MJCF`.
    pub format: &'static str,
    /// `free` or `fixed`.
    pub base: &'static str,
    /// What it weighs, kg.
    pub mass_kg: f64,
    /// Links that are told apart.
    pub links: usize,
    /// Joints a servo turns.
    pub joints: Vec<String>,
    /// Joints that follow those.
    pub coupled: Vec<String>,
    /// Joints of the model that are held at zero.
    pub held: Vec<String>,
    /// Joints whose limits are not the model's: it has none, or placeholders.
    pub without_limits: Vec<String>,
    /// Capsules and boxes.
    pub shapes: usize,
    /// Files of meshes that pages show it by.
    pub meshes: usize,
    /// Links that it stands on.
    pub soles: Vec<String>,
    /// Of a draft: the joint before each part of a body, guessed from where joints are.
    pub anatomy: BTreeMap<&'static str, String>,
    /// What a person should know.
    pub notes: Vec<String>,
    /// What is still wrong with the file, if anything.
    pub faults: Option<String>,
    /// The file.
    #[serde(skip)]
    pub text: String,
}

/// Reads a model and writes down a robot; nothing is written to a disk.
///
/// # Errors
/// A file that cannot be read or is no model, one that does not fit the robot, a servo nobody knows.
pub fn import(order: &ImportOrder) -> Result<Imported, Error> {
    let in_file = |error: Error| error.in_file(&order.model);
    let bytes = bytes_of(&order.model, FILE_BYTES_MAX).map_err(|cause| {
        Error::of(ErrorKind::from(&cause), "the model cannot be read")
            .at(order.model.display().to_string())
            .got(cause.to_string())
    })?;
    let text = String::from_utf8(bytes)
        .map_err(|_| in_file(Error::of(ErrorKind::Malformed, "the model is not UTF-8 text")))?;
    let folder = folder_of(&order.model);
    let mut found = model::read(&text, &mut |name| mesh(folder, name)).map_err(in_file)?;
    let own = found.volumes.iter().map(Vec::len).sum::<usize>();
    let filled = found.fill(order.plain_shapes);
    let words = words(order, filled, if order.plain_shapes { 0 } else { own });
    let reduced = match &order.robot {
        Some(robot) => {
            let zero = found.posture(&order.zero).map_err(in_file)?;
            found.onto(&profiles::robot(robot)?, &zero)
        }
        None => found.on_its_own(),
    };
    let mut reduced = reduced.map_err(in_file)?;
    find_looks(&mut reduced, folder, &order.file);
    let own = order.robot.as_ref().map(|robot| profiles::robot_text(robot)).transpose()?;
    let keeps = own.is_some_and(|text| text.contains("\n[body.servos]"));
    let told = |joint: &&OwnJoint| joint.follows.is_empty() && joint.holds.is_some();
    let untold = reduced.joints.iter().find(|of| of.follows.is_empty() && of.holds.is_none());
    match (reduced.joints.iter().filter(told).count(), untold) {
        // Whoever wrote them down knows the servos better than a model does.
        _ if keeps => reduced.joints.iter_mut().for_each(|joint| joint.holds = None),
        (0, _) => {}
        (_, None) => {
            let note = "how its servos give way is the model's ([body.servos])";
            reduced.notes.push(note.to_owned());
        }
        (_, Some(joint)) => {
            let note = format!(
                "how servos give way is left out, since the model does not say it of {}: a spring, and its most torque",
                joint.name
            );
            reduced.notes.push(note);
        }
    }
    let text = match &order.robot {
        Some(robot) => {
            let body = found.body_text(&reduced, &words);
            model::with_body(&profiles::robot_text(robot)?, &body).ok_or_else(|| {
                Error::new("the robot's file has a body that is not its last part")
                    .at(format!("robot {robot}"))
                    .remedy("move [body] and its links to the end of the file")
            })?
        }
        None => found.draft_text(&reduced, &words, &order.name, &servo(order)?),
    };
    Ok(report(order, &found, &reduced, text))
}

fn report(order: &ImportOrder, found: &PublicModel, reduced: &Reduced, text: String) -> Imported {
    let faults = if order.robot.is_none() && order.servo.is_none() {
        Some(format!(
            "no joint has a servo yet: name it by --servo ({SERVOS}), or each in the file"
        ))
    } else {
        profiles::parse_robot("the new file", &text).err().map(|e| Error::from(e).to_string())
    };
    let names = |follow: bool| {
        let of = reduced.joints.iter().filter(move |joint| joint.follows.is_empty() != follow);
        of.map(|joint| joint.name.clone()).collect::<Vec<_>>()
    };
    let driven = reduced.joints.iter().filter(|joint| joint.follows.is_empty());
    let without = driven.filter(|joint| joint.range.is_none() && order.robot.is_none());
    let called = |joint: Option<usize>| {
        joint.map_or("base".to_owned(), |at| reduced.joints[at].name.clone())
    };
    let standing = reduced.links.iter().filter(|link| !link.sole_m.is_empty());
    let guessed = order.robot.is_none().then(|| found.anatomy(reduced));
    let mut notes = reduced.notes.clone();
    if let Some(Err(reason)) = guessed {
        notes.push(format!("no [anatomy], by which it would follow a person: {reason}"));
    }
    if found.base == BaseKind::Free && standing.clone().next().is_none() {
        let note = "nothing of it lies flat on the floor with all joints at zero: nothing is told of floor, balance and falls \
                    until a link has sole_m";
        notes.push(note.to_owned());
    }
    let played = |of: profiles::SegmentLink| (segment_name(segment(of.segment)), of.joint);
    Imported {
        name: order.robot.clone().unwrap_or_else(|| order.name.clone()),
        format: found.format,
        base: base_word(found.base),
        mass_kg: reduced.links.iter().map(|link| link.mass.mass_kg).sum(),
        links: reduced.links.len(),
        joints: names(false),
        coupled: names(true),
        held: reduced.held.clone(),
        without_limits: without.map(|joint| joint.name.clone()).collect(),
        shapes: reduced.links.iter().map(|link| link.volumes.len()).sum(),
        meshes: reduced.links.iter().map(|link| link.looks.len()).sum(),
        anatomy: guessed.into_iter().flatten().flat_map(|of| of.segments).map(played).collect(),
        soles: standing.map(|link| called(link.joint)).collect(),
        notes,
        faults,
        text,
    }
}

/// `free` or `fixed`.
#[must_use]
pub const fn base_word(base: BaseKind) -> &'static str {
    match base {
        BaseKind::Free => "free",
        BaseKind::Fixed => "fixed",
    }
}

fn words(order: &ImportOrder, filled: usize, own: usize) -> Provenance {
    let file = order.model.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let made =
        format!("{filled} made here: capsules along links, boxes with a link's moments of inertia");
    let shape_source = match (own, filled) {
        (_, 0) => format!(
            "{own} of the model's collision shapes, meshes as capsules or boxes around them"
        ),
        (0, _) => made,
        _ => format!("{own} of the model's collision shapes, {made}"),
    };
    Provenance {
        source: order.source.clone().unwrap_or_else(|| format!("unconfirmed: {file}")),
        licence: order.licence.clone().unwrap_or_else(|| "unconfirmed".to_owned()),
        shape_source,
    }
}

fn servo(order: &ImportOrder) -> Result<DraftServo, Error> {
    let Some(name) = &order.servo else {
        return Ok(DraftServo { name: None, fastest_rad_s: None, baud_bps: 1_000_000 });
    };
    let profile = profiles::servo(name)?;
    let usual = profile.baud.iter().map(|baud| baud.bps).find(|bps| *bps == 1_000_000);
    let baud_bps = usual.or_else(|| Some(profile.baud.first()?.bps)).unwrap_or(1_000_000);
    let fastest_rad_s = Some(profile.motor.no_load_speed_rad_s * SPEED_SHARE);
    Ok(DraftServo { name: Some(name.clone()), fastest_rad_s, baud_bps })
}

/// The bytes of a file, if they are not more than that.
///
/// # Errors
/// A file that cannot be read, is no regular one, or is larger.
pub(in crate::job) fn bytes_of(path: &Path, most: u64) -> std::io::Result<Vec<u8>> {
    // Asked before opening: opening a FIFO would wait for a writer.
    let meta = std::fs::metadata(path)?;
    if !meta.is_file() {
        return Err(std::io::Error::other("this is not a regular file"));
    }
    // What the system makes up as it is read has no length, and some of it waits for ever.
    if meta.len() == 0 {
        return Err(std::io::Error::other("it is empty"));
    }
    let mut bytes = Vec::new();
    File::open(path)?.take(most + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most {
        return Err(std::io::Error::other(format!("more than {}", counted(most, "byte"))));
    }
    Ok(bytes)
}

/// The bytes of a mesh that a model in this folder names.
fn mesh(folder: &Path, name: &str) -> Result<Vec<u8>, String> {
    bytes_of(&mesh_path(folder, name)?, MESH_BYTES_MAX).map_err(|cause| cause.to_string())
}

/// The folder of a file; of one that is named alone the one that is worked in.
fn folder_of(file: &Path) -> &Path {
    file.parent().filter(|folder| *folder != Path::new("")).unwrap_or(Path::new("."))
}

/// Where a mesh is that a model in this folder names. What a package of ROS has lies in the folder of that name above
/// the model, or else under the model's own; a path that leads further up is not followed,
/// but for one from the root.
fn mesh_path(folder: &Path, name: &str) -> Result<PathBuf, String> {
    let name = name.strip_prefix("file://").unwrap_or(name);
    let (package, inside) =
        match name.strip_prefix("package://").and_then(|name| name.split_once('/')) {
            Some((package, inside)) => (Some(package), Path::new(inside)),
            None => (None, Path::new(name)),
        };
    if package.is_none() && inside.is_absolute() {
        return Ok(inside.to_owned());
    }
    // How far below the model, or above it, each part of the path leads.
    let depths = inside.components().scan(0_i64, |depth, part| {
        *depth += match part {
            Component::Normal(_) => 1,
            Component::ParentDir => -1,
            _ => 0,
        };
        Some(*depth)
    });
    if depths.min().is_some_and(|lowest| lowest < -FOLDERS_ABOVE) {
        return Err(format!("more than {FOLDERS_ABOVE} folders above the model"));
    }
    let whole = folder.canonicalize().map_err(|cause| cause.to_string())?;
    let of_package = whole.ancestors().find(|above| {
        above.file_name().zip(package).is_some_and(|(name, package)| name == package)
    });
    let found = of_package.map(|root| root.join(inside)).filter(|path| path.is_file());
    Ok(found.unwrap_or_else(|| whole.join(inside)))
}

/// Names files of meshes as they are seen from the robot's file, and leaves aside those that cannot be read.
fn find_looks(reduced: &mut Reduced, folder: &Path, file: &Path) {
    let beside = folder_of(file);
    let mut unread: Vec<String> = Vec::new();
    for link in &mut reduced.links {
        link.looks.retain_mut(|look| match seen_from(beside, folder, look) {
            Ok(name) => {
                look.file = name;
                true
            }
            Err(cause) => {
                unread.push(format!("{} ({cause})", look.file));
                false
            }
        });
    }
    if let [first, rest @ ..] = unread.as_slice() {
        let more = match rest.len() {
            0 => String::new(),
            more => format!(", and {more} more"),
        };
        reduced.notes.push(format!("pages cannot show {first}{more}: shapes stand for it"));
    }
}

fn seen_from(beside: &Path, folder: &Path, look: &LinkMesh) -> Result<String, String> {
    if !look.scale.is_finite() || look.scale.to_array().contains(&0.0) {
        return Err("its scale makes nothing of it".to_owned());
    }
    let path = mesh_path(folder, &look.file)?;
    let bytes = bytes_of(&path, MESH_BYTES_MAX).map_err(|cause| cause.to_string())?;
    let is_surface = Surface::read(&bytes).is_some_and(|surface| !surface.triangles.is_empty());
    if !is_surface {
        return Err(NO_MESH.to_owned());
    }
    let path = path.canonicalize().map_err(|cause| cause.to_string())?;
    let seen = match beside.canonicalize() {
        Ok(beside) => from(&beside, &path),
        Err(_) => path,
    };
    seen.into_os_string().into_string().map_err(|_| "its path is not UTF-8".to_owned())
}

/// A path as it is seen from a folder; as it is if they have nothing in common.
fn from(folder: &Path, path: &Path) -> PathBuf {
    let common = folder.components().zip(path.components()).take_while(|(a, b)| a == b).count();
    if common < 2 {
        return path.to_owned();
    }
    let up = folder.components().skip(common).map(|_| Component::ParentDir);
    up.chain(path.components().skip(common)).collect()
}
