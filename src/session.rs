//! Recording sessions: what an operator and one or two subjects have done so far, as files, and
//! what comes next. Nothing here waits, asks or reads a sensor.
//!
//! Whatever is on the disk is the state: [`Progress`] reads the folder, [`Progress::next`] says what
//! is to be done. A session that was killed therefore goes on where it was.
//!
//! ```text
//! DIR/session.toml             what the session is: sources, plan, subjects, place, remarks
//! DIR/subjects/ID.toml         a person's measures
//! DIR/calibration/device-NN.toml   how still and how steady each sensor was
//! DIR/calibration/body-ID-NN.toml  how each sensor sits on the body, and -check: how well that
//!                                  is known
//! DIR/trials/NAME-NN.mcap      a recording (NAME-NN.ID.mcap where two people act together)
//! DIR/trials/NAME-NN.toml      what was thought of it: keep or retake, repetitions, notes, props
//! DIR/angles/NAME-NN.csv,.bvh  joint angles of a kept trial
//! DIR/manifest.toml            what the folder holds; written last
//! DIR/now.json                 what is asked for now; only while the session is led
//! ```

pub mod angles;
pub mod doubted;
pub mod files;
pub mod folder;
pub mod manifest;
pub mod now;
pub mod plan;
pub mod steps;
pub mod still;
pub mod tables;
pub mod tap;
pub mod wearers;

pub use files::{BodyCheck, DeviceCheck, SensorCheck, SessionFile, TrialFile, Verdict};
pub use folder::Folder;
pub use plan::{Plan, PlannedAction};
pub use steps::{Progress, Step};
