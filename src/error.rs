//! The one shape of every message a person reads when something is wrong:
//! what, where, got, allowed, what to do.

use std::fmt;

/// A refusal or a failure, in words for the person who has to mend it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Error {
    /// What is wrong, one sentence without a full stop.
    pub what: String,
    /// Where: file and line, joint, register, port.
    pub place: Option<String>,
    /// What was found there.
    pub got: Option<String>,
    /// What would have been accepted.
    pub allowed: Option<String>,
    /// What to do about it.
    pub remedy: Option<String>,
}

impl Error {
    /// Starts an error from what is wrong.
    #[must_use]
    pub fn new(what: impl Into<String>) -> Self {
        Self { what: what.into(), place: None, got: None, allowed: None, remedy: None }
    }

    /// Says where.
    #[must_use]
    pub fn at(mut self, place: impl Into<String>) -> Self {
        self.place = Some(place.into());
        self
    }

    /// Says what was found.
    #[must_use]
    pub fn got(mut self, got: impl Into<String>) -> Self {
        self.got = Some(got.into());
        self
    }

    /// Says what would have been accepted.
    #[must_use]
    pub fn allowed(mut self, allowed: impl Into<String>) -> Self {
        self.allowed = Some(allowed.into());
        self
    }

    /// Says what to do.
    #[must_use]
    pub fn remedy(mut self, remedy: impl Into<String>) -> Self {
        self.remedy = Some(remedy.into());
        self
    }
}

/// A profile's error in the same rows.
impl From<gaitway_profiles::ProfileError> for Error {
    fn from(error: gaitway_profiles::ProfileError) -> Self {
        let text = |words: Option<Box<str>>| words.map(String::from);
        let place = match error.place {
            Some(place) => format!("{}, {place}", error.file),
            None => error.file.into(),
        };
        Self {
            what: error.what.into(),
            place: Some(place),
            got: text(error.got),
            allowed: text(error.allowed),
            remedy: text(error.remedy),
        }
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.what)?;
        let rows = [
            ("where", &self.place),
            ("got", &self.got),
            ("allowed", &self.allowed),
            ("to do", &self.remedy),
        ];
        for (label, text) in rows {
            if let Some(text) = text {
                write!(f, "\n  {label:<8} {text}")?;
            }
        }
        Ok(())
    }
}

impl std::error::Error for Error {}
