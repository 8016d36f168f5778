//! The models that ship with gaitway. Their actions have the names of the shipped actions.

use super::ActionModel;
use super::file::{self, Bands};
use crate::error::{Error, ErrorKind};

macro_rules! shipped {
    ($($name:literal)*) => {
        &[$(($name, include_str!(concat!("../../../models/", $name, ".toml")))),*]
    };
}

/// Names and files; who mirrors another stands after it.
const SHIPPED: &[(&str, &str)] = shipped! {
    "bow" "box-l" "box-r" "chop-l" "chop-r" "drink-l" "drink-r" "fight" "hop" "hop-l" "hop-r"
    "jump" "jump-low" "jumping-jacks" "kick-l" "kick-r" "knee-kick-l" "knee-kick-r" "run-l" "run-r"
    "run-slow-l" "run-slow-r" "side-kick-l" "side-kick-r" "sit-down" "squat" "stand-up"
    "swing-arms-circular" "swing-arms-sagittal" "swing-arms-transverse" "throw-l" "throw-r"
    "walk-fast-l" "walk-fast-r" "walk-l" "walk-r" "wave-l" "wave-r" "wave-small-l" "wave-small-r"
};

/// Names of the shipped models.
pub fn names() -> impl Iterator<Item = &'static str> {
    SHIPPED.iter().map(|(name, _)| *name)
}

/// The text of a shipped model's file.
#[must_use]
pub fn text(name: &str) -> Option<&'static str> {
    SHIPPED.iter().find(|(shipped, _)| *shipped == name).map(|(_, text)| *text)
}

/// A shipped model.
///
/// # Errors
/// If there is none of that name.
pub fn find(name: &str) -> Result<ActionModel, Error> {
    let text = text(name).ok_or_else(|| absent(name))?;
    file::parse(text, &format!("models/{name}.toml"), &Bands::default(), &|other| {
        let text = self::text(other).ok_or_else(|| absent(other))?;
        file::parse(text, other, &Bands::default(), &file::none_to_mirror)
    })
}

fn absent(name: &str) -> Error {
    Error::of(ErrorKind::Unknown, "no such model ships with gaitway").none_of(
        name,
        names(),
        "take one of these",
    )
}

/// All shipped models.
///
/// # Errors
/// If one of them is wrong.
pub fn all() -> Result<Vec<ActionModel>, Error> {
    names().map(find).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_shipped_model_is_read_under_its_own_name_and_says_where_it_comes_from() {
        for (name, model) in names().zip(all().expect("models")) {
            assert_eq!(model.name, name);
            assert!(!model.note.is_empty() && !model.source.is_empty(), "{name}");
        }
    }
}
