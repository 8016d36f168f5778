//! Actions: what a body does, made of actionlets.
//!
//! An [`Action`] is a definition as a person writes it (a TOML file, see `docs/actions.md`): for
//! each degree of freedom that moves, the angles at which it comes to rest and when. Degrees of
//! freedom are gathered in groups: a joint action, a limb action or any group (Zheng et al. 2007,
//! Sec. 4), each with its own phase and rate (Eq. 7). [`Action::perform`] makes a [`Motion`] of it:
//! 22 chains of actionlets over one time scope (Eqs. 2, 3), which can be sampled at any rate,
//! joined with others, changed ([`mutate()`]) and drawn.
//!
//! ```text
//! file / vocabulary / database -> Action -> (mutate) -> Motion -> (join, insert) -> poses, CSV, ...
//!                               cyclic ones -> (change) -'
//! capture -> decompose -> Motion -> Action file
//! ```

pub mod at_once;
pub mod change;
pub mod corpus;
pub mod database;
pub mod decompose;
pub mod feet;
pub mod file;
pub mod fit;
pub mod foothold;
pub mod frames;
pub mod insert;
pub mod join;
pub mod motion;
pub mod mutate;
pub mod parametric;
pub mod parquet;
pub mod perform;
pub mod phrase;
pub mod scope;
pub mod table;
pub mod vocabulary;
pub mod write;

use crate::actionlet::Shape;
use crate::body::{Dof, JointAngles};

pub use change::{Crossing, GaitChange};
pub use database::Database;
pub use feet::{FootingBounds, Missed};
pub use fit::Fits;
pub use foothold::Foothold;
pub use insert::{Insert, Inserted, Inserts, Meanwhile, NoSeam, PastedTrack};
pub use join::Join;
pub use motion::Motion;
pub use mutate::{Spread, mutate};
pub use scope::Kind;

/// A turning point: where an actionlet ends, at rest.
#[derive(Clone, Debug, PartialEq)]
pub struct Turn {
    /// When, as a part of the action's duration or, in a cyclic action, of its period.
    pub at: f64,
    /// Angle there, rad.
    pub angle_rad: f64,
    /// Velocity function of the actionlet that ends here.
    pub shape: Shape,
}

/// A degree of freedom and the waveform it plays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Track {
    /// What moves.
    pub dof: Dof,
    /// Index into [`Action::waveforms`]; the two sides of a body may share one.
    pub waveform: usize,
}

/// Degrees of freedom that belong together, and how they are synchronised with the action: the
/// group's waveforms are played at the phase `rate * t + phase`, t in periods (Zheng et al. 2007,
/// Eq. 7: its phi and s_h).
#[derive(Clone, Debug, PartialEq)]
pub struct Group {
    /// Name within the action.
    pub name: String,
    /// What it claims to be.
    pub kind: Kind,
    /// Its degrees of freedom.
    pub tracks: Vec<Track>,
    /// Phase ahead of the action, in periods of its waveforms, in [0, 1).
    pub phase: f64,
    /// Rounds of the group in rounds of the action: a fraction, so that a common cycle exists.
    pub rate: (u32, u32),
}

/// How a cyclic action is led in, from its pose, and out, back to it. All in periods.
#[derive(Clone, Debug, PartialEq)]
pub struct Ends {
    /// Phase of the cycle at which the action starts.
    pub phase: f64,
    /// Every degree of freedom joins its cycle at its first turning point from here on ...
    pub after: f64,
    /// ... and leaves it at its last one up to here before the end.
    pub before: f64,
    /// Turning points on the way in, `at` counted from the start.
    pub lead_in: Vec<(Dof, Turn)>,
    /// Turning points on the way out, `at` counted from the end: zero or negative.
    pub lead_out: Vec<(Dof, Turn)>,
}

/// A named instant of an action.
#[derive(Clone, Debug, PartialEq)]
pub struct Phase {
    /// When, as in [`Turn::at`].
    pub at: f64,
    /// What happens.
    pub name: String,
}

/// A definition of what a body does.
#[derive(Clone, Debug, PartialEq)]
pub struct Action {
    /// Name: `[a-z0-9-]+`.
    pub name: String,
    /// What it shows, a sentence.
    pub note: String,
    /// Where it comes from.
    pub source: String,
    /// True if it comes from a capture: its angles may leave the anatomical ranges.
    pub captured: bool,
    /// What it claims to be: a joint action, limb action, group action or an action of the body.
    pub kind: Kind,
    /// None for an action that is done once; else how it begins and ends.
    pub cyclic: Option<Ends>,
    /// Duration or, of a cyclic action, period, s.
    pub duration_s: f64,
    /// Rounds of a cyclic action when nothing else is asked for.
    pub rounds: u32,
    /// Angles at the start, and of what is not driven; a cyclic action ends there too. rad.
    pub pose: JointAngles,
    /// What moves.
    pub groups: Vec<Group>,
    /// Turning points in order of time. In a cyclic action the last leads on to the first.
    pub waveforms: Vec<Vec<Turn>>,
    /// Waveforms of rounds that are not quite alike, as a person's steps are not: two to a round, one for
    /// groups whose phase is less than half a round, one for the others; after the last from the first
    /// again. None if all rounds are [`Self::waveforms`].
    pub strides: Vec<Vec<Vec<Turn>>>,
    /// Parts of the duration (or period) in which no foot touches the ground: from, to; `to` may
    /// pass 1 in a cyclic action.
    pub flights: Vec<(f64, f64)>,
    /// Notes of its phases.
    pub phases: Vec<Phase>,
}
