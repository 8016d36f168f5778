//! Virtual robots behind doors, and virtual people who wear virtual sensors.

pub mod imus;
pub mod person;
pub mod robot;
pub mod script;
pub mod worn;
