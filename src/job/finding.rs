//! One thing looked at: how it is, and what to do about it if that is not well.

use serde::Serialize;

/// How well a thing is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Level {
    /// As it should be.
    Ok,
    /// Works, but could be better.
    Advice,
    /// Keeps something from working.
    Problem,
}

/// One thing looked at.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// What was looked at.
    pub about: String,
    /// How well it is.
    pub level: Level,
    /// What was found.
    pub found: String,
    /// What to do; absent if there is nothing to do.
    pub remedy: Option<String>,
}

impl Finding {
    /// A thing that is as it should be.
    #[must_use]
    pub fn ok(about: impl Into<String>, found: impl Into<String>) -> Self {
        Self { about: about.into(), level: Level::Ok, found: found.into(), remedy: None }
    }

    /// A thing that works but could be better.
    #[must_use]
    pub fn advice(
        about: impl Into<String>,
        found: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Self {
        let remedy = Some(remedy.into());
        Self { level: Level::Advice, remedy, ..Self::ok(about, found) }
    }

    /// A thing that keeps something from working.
    #[must_use]
    pub fn problem(
        about: impl Into<String>,
        found: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Self {
        Self { level: Level::Problem, ..Self::advice(about, found, remedy) }
    }
}
