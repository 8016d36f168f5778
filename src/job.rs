//! What is done with a robot, one file a job. A job takes an order, tells an [`Observer`] what happens,
//! and ends in a typed report. It prints nothing, reads no keys and knows no command line.

pub mod follow;
pub mod live;
pub mod model;
pub mod observer;
pub mod open;
pub mod play;
pub mod recorder;
pub mod report;
pub mod scan;
pub mod servo;
pub mod source;

pub use observer::{Event, Nobody, Observer, Progress};
