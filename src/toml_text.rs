//! TOML, read in memory that stays in proportion to the text: the one way it is read everywhere.
//! Here for the rooms that know no profiles, which share it.

pub use gaitway_profiles::{from_toml, toml_bytes};
