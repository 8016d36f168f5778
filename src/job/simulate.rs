//! Virtual robots behind doors, and virtual people who wear virtual sensors.

pub mod acting;
pub mod imus;
pub mod mishaps;
pub mod participant;
pub mod person;
pub mod robot;
pub mod script;
pub mod virtual_person;
pub mod worn;
