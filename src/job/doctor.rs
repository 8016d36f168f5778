//! What on this machine stands between a robot and a smooth cycle. Looks, and changes nothing.

mod host;
mod round_trip;

pub use host::{User, findings};
pub use round_trip::measured;
