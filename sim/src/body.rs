//! A body that a robot's servos move: what turns with their shafts has weight then.
//!
//! The world asks every servo once a millisecond what it does to its joint, and the body where the
//! joints go. What a body is made of, and whether it can fall, only the body knows.

/// What a servo does to its joint.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Push {
    /// Torque at a joint that stands still, N m.
    pub torque_nm: f64,
    /// How much less it is for each rad/s, N m s/rad: back-EMF, damping and friction.
    pub gives_nm_s_rad: f64,
    /// What turns with the motor, seen from the joint, kg m².
    pub armature_kg_m2: f64,
}

/// How a joint stands.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Turned {
    /// Its angle, rad.
    pub angle_rad: f64,
    /// How fast it turns, rad/s.
    pub rate_rad_s: f64,
}

/// What is done to a body beside its servos and its weight.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outside {
    /// Forces, N, ahead, to the left and up as the robot looked when it was let go, each at the centre of mass of the
    /// link that a joint carries, by its number, or of the first link.
    pub forces: Vec<(Option<usize>, [f64; 3])>,
    /// How much the floor falls ahead and to the left, rad.
    pub slope_rad: [f64; 2],
}

/// What an inertial sensor in a body's first link would feel, in that link's axes: X ahead, Y to the left, Z up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Felt {
    /// How the link turns, rad/s.
    pub spin_rad_s: [f64; 3],
    /// What it is accelerated by, without gravity, g: of a link that lies still, one upwards.
    pub acceleration_g: [f64; 3],
}

impl Felt {
    /// Of a link that stands upright and still.
    pub const STILL: Felt = Felt { spin_rad_s: [0.0; 3], acceleration_g: [0.0, 0.0, 1.0] };
}

/// What servos move. Joints are those of the robot's file, in its order.
pub trait Body: Send {
    /// Somebody has put it up with joints at these angles, rad, and lets go of it: it is at rest.
    /// Torque has been on on its servos since a time of the world.
    fn let_go(&mut self, angles_rad: &[f64], powered_since_ns: u64);

    /// One step on, up to a time of the world: how all joints stand then.
    fn step(
        &mut self,
        pushes: &[Push],
        outside: &Outside,
        step_s: f64,
        time_ns: u64,
    ) -> Vec<Turned>;

    /// What is felt in its first link since the last step.
    fn felt(&self) -> Felt;

    /// If it has fallen since it was let go: which of its links lies where none should, without a name if it only tilted.
    fn fallen(&self) -> Option<String>;
}
