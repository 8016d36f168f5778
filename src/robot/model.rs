//! Public models of robots, as other programs have them: URDF and MJCF, from their text to a tree of
//! links with what they weigh and take up. What cannot be told from a model is said, never made up.

mod anatomy;
pub mod mesh;
pub mod mjcf;
mod onto;
pub mod surface;
pub mod urdf;
mod written;
mod xml;

pub use onto::{OwnJoint, Reduced, ReducedLink};
pub use written::{DraftServo, Provenance};

use crate::error::{Error, ErrorKind};
use crate::rigid::{Capsule, Cuboid, JointKind, Mass, Placement, Tree, Volume};
use gaitway_profiles::{Anatomy, BaseKind, Yielding};
use glam::{DQuat, DVec3};

/// Limits as wide as this are what an exporter writes when nobody told it any, rad.
const WIDE_RAD: f64 = std::f64::consts::PI - 2e-3;

/// What a model says of a robot.
#[derive(Clone, Debug)]
pub struct PublicModel {
    /// What it calls itself.
    pub name: String,
    /// `URDF` or `MJCF`.
    pub format: &'static str,
    /// Links and joints, all at the model's own zero.
    pub tree: Tree,
    /// Whether it stands free or is held.
    pub base: BaseKind,
    /// Every joint that moves, in the order of links.
    pub joints: Vec<MovingJoint>,
    /// What each link takes up, in its own axes.
    pub volumes: Vec<Vec<Volume>>,
    /// What each link looks like, in its own axes.
    pub looks: Vec<Vec<LinkMesh>>,
    /// Closed chains: what a tree cannot say, and was left open.
    pub loops: Vec<String>,
    /// What a person should know of how it was read.
    pub notes: Vec<String>,
}

/// A joint that moves.
#[derive(Clone, Debug, PartialEq)]
pub struct MovingJoint {
    /// Its name.
    pub name: String,
    /// Index of the link that hangs on it.
    pub link: usize,
    /// Its range, rad or m, if the model has one that is more than a placeholder.
    pub range: Option<(f64, f64)>,
    /// How fast it may turn, rad/s, if the model says.
    pub velocity_rad_s: Option<f64>,
    /// Something drives it.
    pub driven: bool,
    /// How that holds it, if the model says so: a spring and a damper between goal and joint.
    pub holds: Option<Yielding>,
}

/// A mesh that a link looks like.
#[derive(Clone, Debug, PartialEq)]
pub struct LinkMesh {
    /// Its file, as the model calls it.
    pub file: String,
    /// What lengths in it are multiplied by, along its own axes.
    pub scale: DVec3,
    /// Where it is, in the axes of its link.
    pub at: Placement,
}

/// Where meshes come from: the bytes of the file of this name, as the model calls it.
pub type Meshes<'a> = dyn FnMut(&str) -> Result<Vec<u8>, String> + 'a;

/// Reads a model, told by its first element which of the two it is.
///
/// # Errors
/// Text that is neither, is too large, or says what no robot can be.
pub fn read(text: &str, meshes: &mut Meshes<'_>) -> Result<PublicModel, Error> {
    let document = xml::parse(text)?;
    match document.root_element().tag_name().name() {
        "robot" => urdf::read(&document, meshes),
        "mujoco" => mjcf::read(&document, meshes),
        other => Err(Error::of(ErrorKind::Malformed, "this is no model of a robot")
            .at("first element")
            .got(format!("<{}>", shown(other)))
            .allowed("<robot> (URDF) or <mujoco> (MJCF)")),
    }
}

impl PublicModel {
    /// The `[body]` part of a robot file.
    #[must_use]
    pub fn body_text(&self, reduced: &Reduced, words: &Provenance) -> String {
        written::body(self, reduced, words)
    }

    /// A draft of a whole robot file, in which everything is marked that a model cannot say.
    #[must_use]
    pub fn draft_text(
        &self,
        reduced: &Reduced,
        words: &Provenance,
        name: &str,
        servo: &DraftServo,
    ) -> String {
        written::draft(self, reduced, words, name, servo)
    }

    /// Which joint moves which part of a body, guessed from where joints are.
    ///
    /// # Errors
    /// Why it is not guessed of what is no humanoid, or of one that looks elsewhere.
    pub fn anatomy(&self, reduced: &Reduced) -> Result<Anatomy, &'static str> {
        anatomy::guessed(self, reduced)
    }

    /// The joint of this name.
    #[must_use]
    pub fn joint(&self, name: &str) -> Option<&MovingJoint> {
        self.joints.iter().find(|joint| joint.name == name)
    }

    /// Gives every link that takes up no room a capsule along its length, or a box with its moments of
    /// inertia: how many got one. With `all` the model's own volumes are put aside.
    pub fn fill(&mut self, all: bool) -> usize {
        let mut filled = 0;
        let zeros = vec![0.0; self.tree.moving()];
        let placed = self.tree.place(Placement::IDENTITY, &zeros);
        for (index, link) in self.tree.links().iter().enumerate() {
            if !(all || self.volumes[index].is_empty()) {
                continue;
            }
            let back = placed[index].inverse();
            let children =
                self.tree.links().iter().enumerate().filter(|(_, child)| {
                    child.parent == Some(index) && child.kind != JointKind::Fixed
                });
            let ends: Vec<DVec3> =
                children.map(|(child, of)| back.point(placed[child].point(of.anchor_m))).collect();
            let found = of_mass(&link.mass, back.turn, link.anchor_m, &ends);
            self.volumes[index] = found.into_iter().collect();
            filled += self.volumes[index].len();
        }
        filled
    }
}

/// Links lighter than this, kg, are frames and markers, not bodies.
const FRAME_KG: f64 = 0.02;
/// No box is thinner than twice this, m.
const THIN_M: f64 = 0.005;
/// Shorter links are hubs, m.
const LONG_M: f64 = 0.04;

/// A capsule from a link's joint to the only joint it carries, as thick as its mass lies around that
/// line; of other links a box. `upright` turns the base's axes, with all joints at zero, into the link's.
fn of_mass(mass: &Mass, upright: DQuat, joint_m: DVec3, ends: &[DVec3]) -> Option<Volume> {
    if mass.mass_kg < FRAME_KG {
        return None;
    }
    let half_m = inertia_box(mass, upright);
    if let [end] = ends
        && joint_m.distance(*end) >= LONG_M
    {
        let mut halves = half_m.to_array();
        halves.sort_by(f64::total_cmp);
        let radius_m = (halves[0] * halves[1]).sqrt().clamp(0.01, joint_m.distance(*end) / 3.0);
        let capsule = Capsule { from_m: joint_m, to_m: *end, radius_m };
        return Some(Volume::Capsule(capsule));
    }
    let half_m = half_m.max(DVec3::splat(THIN_M));
    Some(Volume::Cuboid(Cuboid { centre_m: mass.centre_m, turn: upright, half_m }))
}

/// Half sides of the box of even density with this mass and these moments of inertia about upright
/// axes: upright, so that a foot's lies flat.
fn inertia_box(mass: &Mass, upright: DQuat) -> DVec3 {
    let back = Placement { at_m: DVec3::ZERO, turn: upright.inverse() };
    let inertia = mass.placed(back).inertia_kg_m2;
    let [a, b, c] = [inertia.x_axis.x, inertia.y_axis.y, inertia.z_axis.z];
    // Of a box with half sides h: moment about x = m (hy² + hz²) / 3.
    let half =
        |one: f64, two: f64, own: f64| (1.5 * (one + two - own) / mass.mass_kg).max(0.0).sqrt();
    DVec3::new(half(b, c, a), half(a, c, b), half(a, b, c))
}

/// A robot file's text with this body in place of its own; nothing if its own is not at its end.
#[must_use]
pub fn with_body(text: &str, body: &str) -> Option<String> {
    written::instead(text, body)
}

/// A range that somebody meant: finite, in order, not all that an exporter writes by itself.
fn meant(lower: f64, upper: f64, kind: JointKind) -> Option<(f64, f64)> {
    let finite = lower.is_finite() && upper.is_finite() && lower < upper;
    let wide = kind == JointKind::Hinge && lower <= -WIDE_RAD && upper >= WIDE_RAD;
    (finite && !wide).then_some((lower, upper))
}

/// A word of a stranger's, as far as a message should repeat it.
fn shown(text: &str) -> String {
    text.chars().filter(|c| !c.is_control()).take(60).collect()
}

/// Some of many names, and how many more there are.
fn some(names: &[String]) -> String {
    const FEW: usize = 6;
    let shown = names.iter().take(FEW).map(String::as_str).collect::<Vec<_>>().join(", ");
    match names.len().saturating_sub(FEW) {
        0 => shown,
        more => format!("{shown} and {more} more"),
    }
}
