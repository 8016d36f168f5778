//! Gaitway: from human motion to small humanoid robots.
//!
//! The map: [`wire`] turns bytes into packets and knows no clock; [`port`] moves bytes and is the only
//! place that waits; [`bus`] asks one question at a time on a shared line; [`device`] speaks SI units
//! to one device; [`robot`] names joints on devices; [`rig`] opens robots and lines wherever they are.
//! [`motion`], [`actionlet`], [`body`], [`action`] and [`mocap`] are mathematics and know no hardware;
//! [`clean`] mends markers, [`rigid`] is bodies that hang on one another, [`recognise`] names what a body
//! does, [`retarget`] tells what a motion does to all of a robot; [`guard`] and [`control`] are the last gate and the
//! loop. [`capture`] and [`session`] make samples and trials of what sensors say, [`calibration`] is
//! what was measured on one robot, [`recording`] and [`view`] are the files a run leaves. [`job`] is
//! what is done with all of it, from an order to a typed report; [`cli`] is what a person types.
//!
//! Most programs need only what stands at the top of this page:
//!
//! ```
//! use gaitway::{Options, Outcome};
//!
//! let mut rig = gaitway::open("op3", "sim")?; // or "serial:/dev/ttyUSB0"
//! let motion = rig.motion("walk:3s,bow")?; // or a capture: "dance.bvh"
//! let report = rig.play(&motion, Options::default())?;
//! assert_eq!(report.outcome, Outcome::Done);
//! # Ok::<(), gaitway::Error>(())
//! ```
//!
//! More of that is in `examples/`: goals of one's own making, stops, recordings, a virtual robot for
//! tests.

#![deny(missing_docs)]

pub mod action;
pub mod actionlet;
pub mod body;
pub mod bus;
pub mod calibration;
pub mod capture;
pub mod clean;
pub mod cli;
pub mod columnar;
pub mod control;
pub mod corpus;
pub mod device;
pub mod draft;
pub mod error;
pub mod guard;
pub mod job;
pub mod mocap;
pub mod motion;
pub mod port;
pub mod recognise;
pub mod recording;
pub mod retarget;
pub mod rig;
pub mod rigid;
pub mod robot;
pub mod sensing;
pub mod session;
pub mod table;
pub mod time;
pub mod toml_text;
pub mod units;
pub mod view;
pub mod wire;

pub use error::{Error, ErrorKind};
pub use job::follow::{FollowOptions, Moment};
pub use job::live::LiveReport;
pub use job::open::{Rig, open};
pub use job::play::{EndState, Options, Played};
pub use job::report::{Outcome, PlayReport};
pub use job::source::{MotionOrder, RobotMotion};
pub use job::{Event, Nobody, Observer, Progress, Snapshot};
