//! TOML as text: the one way it is read, in memory that stays in proportion, and the one way it is
//! written. Here also for the rooms that know no profiles.

use crate::error::Error;
use serde::Serialize;

pub use gaitway_profiles::{advice, from_toml, plain_words, toml_bytes};

/// The text of a file: what a person should know of it, as comments, and the value.
///
/// # Errors
/// A value that has no form in TOML.
pub fn to_toml(remarks: &str, value: &impl Serialize) -> Result<String, Error> {
    let unwritable = |cause: toml::ser::Error| {
        Error::new("this cannot be written as TOML").got(cause.to_string())
    };
    let remarks: String = remarks.lines().map(|line| format!("# {line}\n")).collect();
    Ok(remarks + &toml::to_string(value).map_err(unwritable)?)
}
