//! What is wrong with a profile, in words for the person who has to mend it.

use std::fmt;

/// A file with more faults than these is not the file that was meant.
const MOST: usize = 50;
/// Nor is one whose faults take more words, bytes.
const MOST_BYTES: usize = 64 * 1024;

/// So many places of the same fault are named.
const PLACES: usize = 8;

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
    /// What else is wrong with the same file.
    pub also: Box<[ProfileError]>,
}

/// Everything that is wrong with a file, as it is found. Faults that differ in where they are alone are one.
#[derive(Debug, Default)]
pub(crate) struct Faults {
    kept: Vec<Fault>,
    bytes: usize,
    count: usize,
}

/// A fault without its place, its first places, and how many more there are.
#[derive(Debug)]
struct Fault {
    error: ProfileError,
    places: Vec<Box<str>>,
    more: usize,
}

impl Faults {
    /// Keeps what a check has against the file; true if that is nothing.
    pub(crate) fn note(&mut self, verdict: Result<(), ProfileError>) -> bool {
        let Err(mut error) = verdict else { return true };
        self.count += 1;
        let bytes = error.bytes();
        let place = error.place.take();
        let same = self.kept.iter_mut().find(|of| of.error == error && !of.places.is_empty());
        if let (Some(same), Some(place)) = (same, &place) {
            if same.places.len() < PLACES && self.bytes + place.len() <= MOST_BYTES {
                self.bytes += place.len();
                same.places.push(place.clone());
            } else {
                same.more += 1;
            }
            return false;
        }
        self.bytes += bytes;
        // The first is kept in any case: without it the file would be right.
        if self.kept.is_empty() || (self.kept.len() < MOST && self.bytes <= MOST_BYTES) {
            self.kept.push(Fault { error, places: place.into_iter().collect(), more: 0 });
        }
        false
    }

    /// How many faults there are.
    pub(crate) const fn count(&self) -> usize {
        self.count
    }

    /// The first fault, with all others beside it.
    pub(crate) fn verdict(self) -> Result<(), ProfileError> {
        let mut faults = self.kept.into_iter().map(|Fault { error, places, more }| {
            let mut place = places.join("; ");
            if more > 0 {
                place += &format!("; and {more} more");
            }
            let place = (!places.is_empty()).then(|| place.into());
            ProfileError { place, ..error }
        });
        let Some(first) = faults.next() else { return Ok(()) };
        Err(ProfileError { also: faults.collect(), ..first })
    }
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
            also: Box::default(),
        }
    }

    /// Length of its words.
    fn bytes(&self) -> usize {
        let rows = [&self.place, &self.got, &self.allowed, &self.remedy];
        let rows = rows.into_iter().flatten().chain([&self.file, &self.what]);
        rows.map(|words| words.len()).sum()
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
        self.also.iter().try_for_each(|other| write!(f, "\n{other}"))
    }
}

impl std::error::Error for ProfileError {}
