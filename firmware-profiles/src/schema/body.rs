//! What a robot weighs and takes up.

use super::SignedAxis;
use serde::Deserialize;

/// Links of a robot: what they weigh, what they take up, what they stand on. A link is called by the
/// joint it hangs on; its axes are those of its joint's `origin_m`, parallel to the base's with every
/// joint at zero.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Body {
    /// Whether it stands free or is held.
    pub base: BaseKind,
    /// Where the masses come from.
    pub source: String,
    /// Licence of that source, as an SPDX expression; `none` if it has none.
    pub licence: String,
    /// Where capsules and boxes come from.
    pub shape_source: String,
    /// Links, each once. One without `joint` is the base.
    #[serde(rename = "link")]
    pub links: Vec<BodyLink>,
    /// Joints that no servo turns, but that others move.
    #[serde(default, rename = "coupled")]
    pub coupled: Vec<CoupledJoint>,
    /// How its servos give way; absent: they are taken for stiff.
    #[serde(default)]
    pub servos: Option<BodyServos>,
    /// The inertial sensor in its base; absent: it has none that answers on its lines.
    #[serde(default)]
    pub imu: Option<BodyImu>,
    /// How its joints answer a tilt that no motion asked for; absent: nobody has tried.
    #[serde(default)]
    pub balance: Option<BodyBalance>,
    /// What its joints do once it lies; absent = they hold.
    #[serde(default)]
    pub when_fallen: WhenFallen,
}

/// What joints do once a robot has fallen, after they have come to rest.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "snake_case")]
pub enum WhenFallen {
    /// Torque stays on.
    #[default]
    Hold,
    /// Torque goes off, so that no servo pushes against the floor.
    Limp,
}

/// A board with an inertial sensor, screwed to the base.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BodyImu {
    /// Line it hangs on, a serial one.
    pub line: String,
    /// Bus ID.
    pub id: u8,
    /// Board profile by name.
    pub board: String,
    /// The base's X, Y and Z as axes of the sensor; absent: the same.
    #[serde(default = "own_axes")]
    pub axes: [SignedAxis; 3],
    /// Where it is written.
    pub source: String,
}

const fn own_axes() -> [SignedAxis; 3] {
    [SignedAxis::PlusX, SignedAxis::PlusY, SignedAxis::PlusZ]
}

/// How joints answer a base that is tilted, or turns, otherwise than the motion wants.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BodyBalance {
    /// Furthest that any joint is moved for it, rad.
    pub most_rad: f64,
    /// Share of each joint's limits of velocity and acceleration that is kept for it; the motion has the rest.
    pub limit_share: f64,
    /// How long a tilt must last until most of it is answered, s: legs that give way swing if they are answered at once.
    pub tilt_time_s: f64,
    /// Joints that answer.
    #[serde(rename = "joint")]
    pub joints: Vec<BalanceJoint>,
    /// Where the gains come from.
    pub source: String,
}

/// How far one joint is moved. Roll is a tilt to the right, pitch one ahead.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BalanceJoint {
    /// Its name.
    pub joint: String,
    /// For each rad of roll, rad.
    #[serde(default)]
    pub roll: f64,
    /// For each rad/s of roll, rad.
    #[serde(default)]
    pub roll_s: f64,
    /// For each rad of pitch, rad.
    #[serde(default)]
    pub pitch: f64,
    /// For each rad/s of pitch, rad.
    #[serde(default)]
    pub pitch_s: f64,
}

/// How servos hold joints: as springs with dampers between goal and joint.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BodyServos {
    /// Those of all joints that no `other` names.
    #[serde(flatten)]
    pub usual: Yielding,
    /// Joints of other servos, or behind gears.
    #[serde(default, rename = "other")]
    pub others: Vec<OtherServos>,
    /// Where these numbers come from.
    pub source: String,
}

/// Servos that hold some joints otherwise than all the rest.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OtherServos {
    /// Names of these joints.
    pub joints: Vec<String>,
    /// How each is held.
    #[serde(flatten)]
    pub each: Yielding,
}

/// How one servo holds its joint.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
pub struct Yielding {
    /// Torque for a radian between goal and joint, N m/rad.
    pub stiffness_nm_rad: f64,
    /// Torque against a speed of a radian a second, N m s/rad.
    pub damping_nm_s_rad: f64,
    /// What turns with the motor, seen from the joint, kg m².
    pub armature_kg_m2: f64,
    /// Torque against any motion, however slow, N m; absent: none.
    #[serde(default)]
    pub friction_nm: f64,
    /// Most torque, N m.
    pub torque_nm: f64,
}

impl BodyServos {
    /// How the servo of a joint holds it.
    #[must_use]
    pub fn of(&self, joint: &str) -> Yielding {
        let other = self.others.iter().find(|of| of.joints.iter().any(|name| name == joint));
        other.map_or(self.usual, |of| of.each)
    }
}

/// How the base is held.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "snake_case")]
pub enum BaseKind {
    /// It stands on its own feet, or falls.
    Free,
    /// It is screwed to something.
    Fixed,
}

/// What moves with a joint up to the next.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BodyLink {
    /// The joint it hangs on; absent: the base.
    #[serde(default)]
    pub joint: Option<String>,
    /// Mass, kg.
    pub mass_kg: f64,
    /// Centre of mass, m.
    pub centre_m: [f64; 3],
    /// Inertia about that centre, kg m²: xx, yy, zz, xy, xz, yz.
    pub inertia_kg_m2: [f64; 6],
    /// What it takes up, with [`BodyLink::boxes`].
    #[serde(default)]
    pub capsules: Vec<BodyCapsule>,
    /// Boxes.
    #[serde(default)]
    pub boxes: Vec<BodyBox>,
    /// What it looks like, for pages alone.
    #[serde(default)]
    pub meshes: Vec<BodyMesh>,
    /// Corners of what it stands on, m; absent: it does not stand on it.
    #[serde(default)]
    pub sole_m: Option<Vec<[f64; 3]>>,
    /// Where this link's numbers come from, if not from the body's source.
    #[serde(default)]
    pub source: Option<String>,
}

/// All points within a radius of a line.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BodyCapsule {
    /// One end of the line, m.
    pub from_m: [f64; 3],
    /// The other, m.
    pub to_m: [f64; 3],
    /// The radius, m.
    pub radius_m: f64,
}

/// A box.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BodyBox {
    /// Its middle, m.
    pub centre_m: [f64; 3],
    /// From its middle to its faces, m.
    pub half_m: [f64; 3],
    /// How it is turned, quaternion w, x, y, z; absent: not at all.
    #[serde(default = "unturned")]
    pub turn: [f64; 4],
}

/// A surface of triangles in a file of its own (STL or OBJ).
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BodyMesh {
    /// Path of the file, from the folder of the robot file unless it begins at the root.
    pub file: String,
    /// What lengths in it are multiplied by, along its own axes, to be m; absent = 1.
    #[serde(default = "as_large")]
    pub scale: [f64; 3],
    /// Where its origin is, m; absent: the link's.
    #[serde(default)]
    pub at_m: [f64; 3],
    /// How it is turned, quaternion w, x, y, z; absent: not at all.
    #[serde(default = "unturned")]
    pub turn: [f64; 4],
}

const fn as_large() -> [f64; 3] {
    [1.0; 3]
}

const fn unturned() -> [f64; 4] {
    [1.0, 0.0, 0.0, 0.0]
}

/// A joint that follows others: its angle is the sum of theirs, each times its ratio, and the offset.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CoupledJoint {
    /// `[a-z0-9_]+`, and no joint's.
    pub name: String,
    /// The joints it follows.
    pub of: Vec<CoupledTo>,
    /// Its angle with those at zero, rad; absent = 0.
    #[serde(default)]
    pub offset_rad: f64,
    /// Joint whose link carries it; absent: the base.
    #[serde(default)]
    pub parent: Option<String>,
    /// Where it sits, as [`super::Joint::origin_m`].
    pub origin_m: [f64; 3],
    /// What it turns about, as [`super::Joint::axis`].
    pub axis: [f64; 3],
}

/// One joint that another follows.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CoupledTo {
    /// Its name.
    pub joint: String,
    /// Turns of the follower for one of it.
    pub ratio: f64,
}
