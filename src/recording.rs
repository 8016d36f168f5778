//! Recordings: what a motion asked for and what the joints did, in one crash-safe MCAP file.
//!
//! [`Recorder`] takes one [`CycleRecord`] per control cycle without ever waiting for the disk; a
//! thread of its own writes them. [`read`], [`summary`] and [`recover`] take any recording,
//! finished or cut off at any byte.
//!
//! # What is promised
//! - A killed process loses at most 1.0 s: chunks are cut by time (0.25 s), never by size alone,
//!   and each reaches the operating system in one append. A power cut loses at most 2.0 s:
//!   the file is synchronised every second.
//! - The file only grows. A failed write leaves everything before it readable, ends the writing
//!   (the writer is *poisoned*) and is counted.
//! - Nothing is invented. A missed read is a gap with a reason, never the last value again.
//!
//! # Channels
//! All messages are JSON with a JSON schema inside the file, so that a person can read them and
//! no tool needs our code. Samples of sensors may be protobuf instead ([`SampleEncoding`]), with its description inside.
//!
//! | topic | schema | holds |
//! |---|---|---|
//! | `/joints/goal` | `foxglove.JointStates` | goals written in this cycle |
//! | `/joints/present` | `foxglove.JointStates` | position, velocity, current, load, device clock |
//! | `/cycle` | `gaitway.Cycle` | joints missed and why, cycles dropped before this one; of a planned motion the base and the feet that stand |
//! | `/health` | `gaitway.Health` | temperature and voltage, in the cycles that read them |
//! | `/run` | `gaitway.Run` | the start and the end of the run |
//! | `/imu/NAME/sample` | `gaitway.Imu` | what a sensor measured, its raw clock and counter, gaps |
//! | `/imu/NAME/orientation` | `foxglove.FrameTransform` | the fused orientation |
//! | `/lines/NAME` | `gaitway.Line` | lines of text as they were read |
//! | `/marker` | `foxglove.Log` | what somebody marked while it was recorded |
//!
//! `foxglove.JointStates` (<https://docs.foxglove.dev/docs/sdk/schemas/joint-states>) was chosen
//! over three parallel arrays because a value may be left out for one joint alone: Foxglove then
//! draws a gap, and its 3D panel moves a URDF model by it with no conversion. PlotJuggler names
//! series by array index, so every message lists every joint in the same order: `joints[3]` is
//! the same joint in the whole file. `position` is in radians, `velocity` in rad/s; current is
//! not torque, so it stands under `current_a` and the schema's own torque field stays empty.
//!
//! # Time
//! `log_time` is the wall clock read once at the start plus monotonic time since, so a jump of
//! the wall clock changes nothing. Each message also carries the raw `host_monotonic_ns`.
//! Of a cycle `publish_time` equals `log_time`: all its values share one instant. Of a sensor's
//! sample `log_time` is when it was read and `publish_time` when it was taken, as well as that can be
//! told; `sequence` is its number, missing samples counted.

mod bounded;
mod crc;
mod disk;
mod imu_message;
mod log;
mod marker;
mod mcap_file;
mod message;
mod messages;
mod overview;
mod packed;
mod packing;
mod reader;
mod record;
mod replay;
mod sample;
mod scan;
mod sensor;
mod series;
mod table;
mod writer;

pub use crc::crc32;
pub use disk::{Disk, Syncer};
pub use imu_message::SampleEncoding;
pub use log::{Pace, Summary};
pub use marker::Marker;
pub use messages::{MessageFile, Schema};
pub use overview::{Overview, SourceOverview, summary};
pub use packing::Compression;
pub use reader::{GoalSeries, Recording, Recovered, joint_series, read, recover, recover_packed};
pub use replay::{ReplayedSample, read_orientations};
pub use sample::{BaseRecord, CycleRecord, JointRecord, RecordedJoint, RunEnd, RunStart};
pub use sensor::{RecordedSource, SourceId, SourceKind, SourceRecord};
pub use series::{SensorMoment, SensorSeries, run_start, sensor_series, told_of_run};
pub use table::{Rows, write_csv};
pub use writer::Recorder;
