//! What is done with a robot, one file a job. A job takes an order, tells an [`Observer`] what happens,
//! and ends in a typed report. It prints nothing, reads no keys and knows no command line.

mod bodily;
pub mod calibrate;
pub mod clean;
pub mod clean_check;
pub mod composition;
pub mod convert;
pub mod decompose;
pub mod doctor;
pub mod explain;
pub mod finding;
pub mod fit;
pub mod follow;
pub mod hold;
pub mod info;
pub mod limp;
pub mod live;
pub mod markers;
pub mod model;
pub mod monitor;
pub mod observer;
pub mod open;
pub mod page;
pub mod play;
pub mod ports;
pub mod profile;
pub mod recognise;
pub mod record;
pub mod recorder;
pub mod report;
pub mod retarget;
pub mod robot_draft;
pub mod robot_info;
pub mod robot_model;
pub mod scan;
pub mod score;
pub mod sensors;
pub mod servo;
pub mod session;
pub mod simulate;
pub mod source;
pub mod synth;
pub mod taught;

pub use crate::control::net;
pub use observer::{Event, Nobody, Observer, Progress};
