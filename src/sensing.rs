//! Sensors heard live: what a source is and where, who wears which, what came of each, and a
//! calibration that leads somebody through poses. Knows no terminal: what happens is told as
//! [`SensingEvent`]s and [`Cue`]s, and whoever is led answers as a [`Person`].

mod event;
mod guide;
mod hub;
mod imu;
mod intake;
mod lines;
mod natnet;
mod person;
mod progress;
mod sensors;
mod slimevr;
mod source;
mod wear;

pub use crate::port::{Clock, MonotonicClock};
pub use event::{Said, SensingEvent, Tell};
pub use guide::{Ended, Guide, Guided, Plan, wall_clock};
pub use hub::{HeardSensor, Hub, Still};
pub use intake::{Intake, SourceReport, StopAtEnd};
pub use person::{Answer, Cue, Person, Question, Unseen, Until};
pub use sensors::{Feed, Sensors};
pub use source::{Opened, Source, What};
pub use wear::{Place, Wear};

use crate::time::Duration;

/// How often a silent source looks whether it is to stop.
pub(crate) const LOOK: Duration = Duration::from_millis(50);
/// A source that has said nothing for so long is remarked upon.
const PATIENCE: Duration = Duration::from_secs(3);
/// Bytes of a line that come after its start belong to a packet cut in two; so many are no loss.
const PARTIAL_PACKET: u64 = 600;
