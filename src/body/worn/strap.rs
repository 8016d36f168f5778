//! Which way a sensor was strapped on, as files say it.

use crate::error::Error;
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// What of a sensor was to point forward in N pose: an axis of it (`"-y"`), any direction in its axes (`[0.86, 0.5, 0]`), a
/// direction between two axes (`"30 deg from x to y"`), or nobody knows what (`"none"`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "no direction of a sensor: x, -x, y, -y, z, -z, [x, y, z], 30 deg from x to y, or none"
)]
pub enum StrapDirection {
    /// In words.
    Words(String),
    /// A direction, of any length.
    Along([f64; 3]),
}

/// What may be said.
const ALLOWED: &str = "x, -x, y, -y, z, -z, [x, y, z], 30 deg from x to y, or none";

impl StrapDirection {
    /// The direction in the sensor's axes, of length one; `None` if it was strapped on anyhow.
    ///
    /// # Errors
    /// Words that say no direction, numbers that have none.
    pub fn forward(&self) -> Result<Option<DVec3>, Error> {
        let wrong = |got: String| Error::new("no direction of a sensor").got(got).allowed(ALLOWED);
        match self {
            Self::Words(words) if words == "none" => Ok(None),
            Self::Words(words) => between(words).map(Some).ok_or_else(|| wrong(words.clone())),
            Self::Along(parts) => {
                let direction = DVec3::from(*parts).try_normalize();
                direction.map(Some).ok_or_else(|| wrong(format!("{parts:?}")))
            }
        }
    }

    /// True of a direction that somebody measured, and not an axis that was to point forward.
    #[must_use]
    pub fn is_measured(&self) -> bool {
        match self {
            Self::Words(words) => words.split_whitespace().nth(1).is_some(),
            Self::Along(parts) => parts.iter().filter(|part| **part != 0.0).count() > 1,
        }
    }
}

/// An axis, or what is so many degrees from one to another.
fn between(words: &str) -> Option<DVec3> {
    let parts: Vec<&str> = words.split_whitespace().collect();
    match parts[..] {
        [one] => axis(one),
        [angle, "deg", "from", from, "to", to] => {
            let angle: f64 = angle.parse().ok()?;
            let (from, to) = (axis(from)?, axis(to)?);
            let is_turn = (-180.0..=180.0).contains(&angle) && from.dot(to) == 0.0;
            let (sin, cos) = angle.to_radians().sin_cos();
            is_turn.then(|| from * cos + to * sin)
        }
        _ => None,
    }
}

fn axis(word: &str) -> Option<DVec3> {
    let (sign, letter) = match word.strip_prefix('-') {
        Some(letter) => (-1.0, letter),
        None => (1.0, word.strip_prefix('+').unwrap_or(word)),
    };
    let axis = match letter {
        "x" => DVec3::X,
        "y" => DVec3::Y,
        "z" => DVec3::Z,
        _ => return None,
    };
    Some(axis * sign)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(text: &str) -> Result<Option<DVec3>, Error> {
        StrapDirection::Words(text.to_owned()).forward()
    }

    #[test]
    fn a_direction_is_an_axis_numbers_or_between_two_axes() {
        assert_eq!(words("-y").expect("an axis"), Some(DVec3::NEG_Y));
        assert_eq!(words("+z").expect("an axis"), Some(DVec3::Z));
        assert_eq!(words("none").expect("a word"), None);
        let along = StrapDirection::Along([0.0, -3.0, 4.0]).forward().expect("a direction");
        let wanted = DVec3::new(0.0, -0.6, 0.8);
        assert!(along.is_some_and(|along| (along - wanted).length() < 1e-12), "{along:?}");
        let turned = words("30 deg from x to -z").expect("a direction").expect("known");
        assert!((turned - DVec3::new(0.75_f64.sqrt(), 0.0, -0.5)).length() < 1e-12, "{turned}");
    }

    #[test]
    fn what_is_no_direction_is_refused_with_what_may_be_said() {
        for text in [
            "",
            "w",
            "--x",
            "30",
            "30 deg",
            "30 deg from x to x",
            "30 deg from x to -x",
            "200 deg from x to y",
            "nan deg from x to y",
            "30 degrees from x to y",
        ] {
            let error = words(text).expect_err(text).to_string();
            assert!(error.contains("30 deg from x to y, or none"), "{error}");
        }
        for parts in [[0.0; 3], [f64::NAN, 0.0, 1.0], [f64::INFINITY, 0.0, 0.0]] {
            assert!(StrapDirection::Along(parts).forward().is_err(), "{parts:?}");
        }
    }
}
