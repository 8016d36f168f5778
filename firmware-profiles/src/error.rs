//! What is wrong with a profile, in words for the person who has to mend it.

use std::fmt;

/// A profile that was refused, or not found.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ProfileError {
    /// The file, as a path inside this crate or as the user gave it; or the name asked for.
    pub file: Box<str>,
    /// What is wrong, one sentence without a full stop.
    pub what: Box<str>,
    /// Where in the file: register, joint, key or line.
    pub place: Option<Box<str>>,
    /// What was found there.
    pub got: Option<Box<str>>,
    /// What would have been accepted.
    pub allowed: Option<Box<str>>,
    /// What to do about it.
    pub remedy: Option<Box<str>>,
}

impl ProfileError {
    pub(crate) fn new(file: &str, what: impl Into<Box<str>>) -> Self {
        Self {
            file: file.into(),
            what: what.into(),
            place: None,
            got: None,
            allowed: None,
            remedy: None,
        }
    }

    pub(crate) fn at(mut self, place: impl fmt::Display) -> Self {
        self.place = Some(place.to_string().into());
        self
    }

    pub(crate) fn got(mut self, got: impl fmt::Display) -> Self {
        self.got = Some(got.to_string().into());
        self
    }

    pub(crate) fn allowed(mut self, allowed: impl fmt::Display) -> Self {
        self.allowed = Some(allowed.to_string().into());
        self
    }

    pub(crate) fn remedy(mut self, remedy: impl fmt::Display) -> Self {
        self.remedy = Some(remedy.to_string().into());
        self
    }
}

impl fmt::Display for ProfileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}\n  {:<8} {}", self.what, "file", self.file)?;
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

impl std::error::Error for ProfileError {}
