//! The actions that ship with gaitway, and those that lean on them.

use crate::action::{Action, file};
use crate::error::{Error, ErrorKind};
use std::io::Read;
use std::path::Path;

macro_rules! shipped {
    ($($name:literal)*) => {
        &[$(($name, include_str!(concat!("../../actions/", $name, ".toml")))),*]
    };
}

/// Names and files.
const SHIPPED: &[(&str, &str)] = shipped! {
    "walk" "run" "squat" "jump" "wave-l" "wave-r" "box-l" "box-r" "kick-l" "kick-r"
    "side-kick-l" "side-kick-r" "knee-kick-l" "knee-kick-r" "hop" "hop-l" "hop-r"
    "jumping-jacks" "swing-arms-sagittal" "swing-arms-transverse" "swing-arms-circular"
    "sit-down" "stand-up" "throw-l" "throw-r" "chop-l" "chop-r" "drink-l" "drink-r" "bow"
};

/// Names of the shipped actions.
pub fn names() -> impl Iterator<Item = &'static str> {
    SHIPPED.iter().map(|(name, _)| *name)
}

/// The text of a shipped action's file.
#[must_use]
pub fn text(name: &str) -> Option<&'static str> {
    SHIPPED.iter().find(|(shipped, _)| *shipped == name).map(|(_, text)| *text)
}

/// A shipped action.
///
/// # Errors
/// If there is none of that name.
pub fn find(name: &str) -> Result<Action, Error> {
    let Some(text) = text(name) else {
        let unknown = Error::of(ErrorKind::Unknown, "no such action ships with gaitway");
        return Err(unknown.none_of(name, names(), "take one of these names, or an action file"));
    };
    file::parse(text, &format!("actions/{name}.toml"), &lender)
}

/// Reads an action file; what it leans on is looked up among the shipped actions.
///
/// # Errors
/// If the file cannot be read, is too long, or is not an action file.
pub fn read(path: &Path) -> Result<Action, Error> {
    let place = path.display().to_string();
    let unreadable = |e: std::io::Error| {
        Error::of((&e).into(), "cannot read the action file").at(place.clone()).got(e.to_string())
    };
    // Asked before opening: opening a FIFO would wait for a writer.
    if !std::fs::metadata(path).map_err(unreadable)?.is_file() {
        return Err(Error::of(ErrorKind::Malformed, "this is not a regular file").at(place));
    }
    let mut text = String::new();
    let opened = std::fs::File::open(path).map_err(unreadable)?;
    opened.take(file::MAX_BYTES as u64 + 1).read_to_string(&mut text).map_err(unreadable)?;
    file::parse(&text, &place, &lender)
}

/// A shipped action that leans on no other: what others may lean on.
#[must_use]
pub fn lender(name: &str) -> Option<Action> {
    file::parse(text(name)?, name, &|_| None).ok()
}
