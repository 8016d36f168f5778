//! Virtual robots behind doors, what virtual people do, and the virtual sensors that they wear.

pub mod person;
pub mod robot;
pub mod worn;
