//! Sensors to samples that are true in time and orientation. Mathematics only: bytes come from
//! [`wire`](crate::wire), units from [`device`](crate::device), moments from whoever reads.
//!
//! - [`Chain`]: all of it for one sensor, readings in, captured samples out.
//! - [`Timeline`]: which sample is this, what is missing before it, and when was it taken.
//! - [`ClockFit`]: a device's clock on the host's.
//! - [`Orientation`]: angular rate and acceleration to orientation.

mod chain;
mod clock_fit;
mod orientation;
mod pace;
mod rhythm;
mod stuck;
mod timeline;

pub use chain::{Captured, Chain, is_another};
pub use clock_fit::{ClockFit, Quality};
pub use orientation::{Fused, Mode, Orientation};
pub use stuck::Stuck;
pub use timeline::{Counts, Order, Stamp, Telling, Timeline};
