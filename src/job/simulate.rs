//! What virtual people do, and the virtual sensors that they wear.

pub mod person;
pub mod worn;
