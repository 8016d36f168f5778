//! Rigid bodies: where they are, what they weigh, which forces move them, how far apart they are, and the
//! floor they stand on. Mathematics only: nobody here knows what a robot or a person is.

pub mod forward;
pub mod ground;
pub mod mass;
pub mod shape;
pub mod tree;

pub use forward::{Drive, LinkContact, Moving, Pull};
pub use mass::Mass;
pub use shape::{Capsule, Cuboid, Volume, WayOut};
pub use tree::{Coupling, Efforts, JointKind, Placement, Tree, TreeLink, TreeMotion};
