//! The one shape of every message a person reads when something is wrong:
//! what, where, got, allowed, what to do.

pub use gaitway_profiles::{counted, either};
use serde::Serialize;
use std::fmt;
use std::path::Path;

/// What kind of no an [`Error`] is: what a program compares, where a person reads the rows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum ErrorKind {
    /// What was asked for cannot be done, or not so: none of the others.
    #[default]
    Refused,
    /// A name that nothing here has: a robot, a joint, an action, a register.
    Unknown,
    /// A port, an interface, a folder or a file that is not there, or not any more.
    Absent,
    /// A device that does not answer.
    Silent,
    /// Answers that are damaged, or none to what was asked; a line that failed.
    Damaged,
    /// Somebody else has it: a port, an ID, a folder.
    Busy,
    /// The system does not let this user.
    NoAccess,
    /// A file that is there and is to stay.
    Exists,
    /// A file or a text that is not what it should be.
    Malformed,
    /// A goal, an angle or a number beyond what is allowed.
    OutsideLimits,
    /// The robot is not as it must be: hot, without supply, in another mode, another model.
    NotReady,
    /// The line cannot carry what the rate asks for.
    TooSlow,
    /// This computer did not keep its own time.
    HostLate,
    /// What is kept at power-off, or lets something fall, was not permitted.
    NotPermitted,
    /// Somebody asked to stop.
    Stopped,
    /// A file that the system does not read or write.
    Io,
    /// The program itself broke.
    Broke,
}

impl From<&std::io::Error> for ErrorKind {
    fn from(cause: &std::io::Error) -> Self {
        use std::io::ErrorKind as Io;
        match cause.kind() {
            Io::NotFound => Self::Absent,
            Io::PermissionDenied => Self::NoAccess,
            Io::AlreadyExists => Self::Exists,
            Io::ResourceBusy => Self::Busy,
            _ => Self::Io,
        }
    }
}

/// A refusal or a failure, in words for the person who has to mend it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Error {
    /// What kind of no it is.
    pub kind: ErrorKind,
    /// What is wrong, one sentence without a full stop.
    pub what: String,
    /// Where: file and line, joint, register, port.
    pub place: Option<Box<str>>,
    /// What was found there.
    pub got: Option<Box<str>>,
    /// What would have been accepted.
    pub allowed: Option<Box<str>>,
    /// What to do about it.
    pub remedy: Option<Box<str>>,
    /// What else is wrong in the same place: a file's other faults.
    pub also: Box<[Error]>,
}

impl Error {
    /// Starts an error from what is wrong: a refusal of no kind in particular.
    #[must_use]
    pub fn new(what: impl Into<String>) -> Self {
        Self::of(ErrorKind::Refused, what)
    }

    /// Starts an error of this kind from what is wrong.
    #[must_use]
    pub fn of(kind: ErrorKind, what: impl Into<String>) -> Self {
        let (place, got, allowed, remedy) = (None, None, None, None);
        Self { kind, what: what.into(), place, got, allowed, remedy, also: Box::default() }
    }

    /// Starts an error from what the system said when something was to be written: a full disk and a file that may not grow
    /// have a remedy.
    #[must_use]
    pub fn unwritten(what: impl Into<String>, cause: &std::io::Error) -> Self {
        use std::io::ErrorKind as Io;
        let error = Self::of(cause.into(), what).got(cause.to_string());
        match cause.kind() {
            Io::StorageFull => error.remedy("make room on this disk, or write to another"),
            Io::QuotaExceeded => error.remedy("make room within your quota, or write elsewhere"),
            Io::FileTooLarge => error
                .remedy("write to a disk that takes larger files, or raise the limit (ulimit -f)"),
            Io::ReadOnlyFilesystem => error.remedy("write to another disk"),
            Io::PermissionDenied => error.remedy("choose a folder in which you may write"),
            _ => error,
        }
    }

    /// All of it in one line.
    #[must_use]
    pub fn in_one_line(&self) -> String {
        let lines = self.to_string();
        let words = |line: &str| line.split_whitespace().collect::<Vec<_>>().join(" ");
        lines.lines().map(words).collect::<Vec<_>>().join("; ")
    }

    /// Says where.
    #[must_use]
    pub fn at(mut self, place: impl Into<String>) -> Self {
        self.place = Some(place.into().into_boxed_str());
        self
    }

    /// Says in which file, before where in it.
    #[must_use]
    pub fn in_file(self, path: &Path) -> Self {
        let place = match &self.place {
            Some(place) => format!("{}, {place}", path.display()),
            None => path.display().to_string(),
        };
        self.at(place)
    }

    /// Says what was found; of what is very long, its beginning.
    #[must_use]
    pub fn got(mut self, got: impl Into<String>) -> Self {
        self.got = Some(shortened(&got.into()).into_boxed_str());
        self
    }

    /// Says that a name is none of these, and which of them was meant if it is near to one; what to do `otherwise`.
    #[must_use]
    pub fn none_of(
        self,
        name: &str,
        names: impl IntoIterator<Item = impl AsRef<str>>,
        otherwise: &str,
    ) -> Self {
        let names: Vec<_> = names.into_iter().collect();
        let names: Vec<&str> = names.iter().map(AsRef::as_ref).collect();
        let found = self.got(name);
        if names.is_empty() {
            return found.allowed("none: there is nobody and nothing of this kind");
        }
        let remedy = gaitway_profiles::advice(name, &names, otherwise);
        found.allowed(names.join(", ")).remedy(remedy)
    }

    /// Says what would have been accepted.
    #[must_use]
    pub fn allowed(mut self, allowed: impl Into<String>) -> Self {
        self.allowed = Some(allowed.into().into_boxed_str());
        self
    }

    /// Says what to do.
    #[must_use]
    pub fn remedy(mut self, remedy: impl Into<String>) -> Self {
        self.remedy = Some(remedy.into().into_boxed_str());
        self
    }
}

/// So many names are read one by one; the first of more.
const MOST_NAMES: usize = 8;
const FIRST_NAMES: usize = 3;

/// Names as a person reads them: all, or of many the first few and how many more.
#[must_use]
pub fn listed<T: AsRef<str>>(names: &[T]) -> String {
    let told = if names.len() > MOST_NAMES { FIRST_NAMES } else { names.len() };
    let text = names[..told].iter().map(AsRef::as_ref).collect::<Vec<_>>().join(", ");
    if told == names.len() { text } else { format!("{text} and {} more", names.len() - told) }
}

/// What is longer is no number that a person reads.
const MOST_DIGITS: usize = 24;
/// How much is told of what was found.
const MOST_LETTERS: usize = 600;

/// A text that a person can read: of numbers with hundreds of digits the first ones, and not more than so many letters.
fn shortened(text: &str) -> String {
    let mut out = String::new();
    let mut rest = text;
    while let Some(start) = rest.find(|c: char| c.is_ascii_digit()) {
        let (before, digits) = rest.split_at(start);
        let end = digits.find(|c: char| !c.is_ascii_digit()).unwrap_or(digits.len());
        let (digits, after) = digits.split_at(end);
        out.push_str(before);
        match digits.get(..MOST_DIGITS / 3).filter(|_| digits.len() > MOST_DIGITS) {
            Some(first) => {
                out.push_str(&format!("{first}... ({})", counted(digits.len(), "digit")))
            }
            None => out.push_str(digits),
        }
        rest = after;
    }
    out.push_str(rest);
    match out.char_indices().nth(MOST_LETTERS) {
        Some((at, _)) => format!("{}... ({})", &out[..at], counted(text.chars().count(), "letter")),
        None => out,
    }
}

/// A profile's error in the same rows.
impl From<gaitway_profiles::ProfileError> for Error {
    fn from(error: gaitway_profiles::ProfileError) -> Self {
        let place = match error.place {
            Some(place) => format!("{}, {place}", error.file),
            None => error.file.into(),
        };
        // A name that no file has, a file that cannot be had, or one with something wrong in it.
        let kind = match &*error.what {
            what if what.starts_with("there is no") => ErrorKind::Unknown,
            "the file cannot be read" => ErrorKind::Io,
            _ => ErrorKind::Malformed,
        };
        Self {
            kind,
            what: error.what.into(),
            place: Some(place.into_boxed_str()),
            got: error.got.map(|got| shortened(&got).into_boxed_str()),
            allowed: error.allowed,
            remedy: error.remedy,
            also: error.also.into_iter().map(Self::from).collect(),
        }
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.what)?;
        let rows = [
            ("where", self.place.as_deref()),
            ("got", self.got.as_deref()),
            ("allowed", self.allowed.as_deref()),
            ("to do", self.remedy.as_deref()),
        ];
        for (label, text) in rows {
            match text.map(str::trim) {
                None => {}
                // A row without words says nothing; that nothing was found says something.
                Some("") if label == "got" => write!(f, "\n  {label:<8} nothing")?,
                Some("") => {}
                Some(_) => write!(f, "\n  {label:<8} {}", text.unwrap_or_default())?,
            }
        }
        self.also.iter().try_for_each(|other| write!(f, "\n{other}"))
    }
}

impl std::error::Error for Error {}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io;

    #[test]
    fn a_full_disk_says_what_to_do_and_all_of_an_error_fits_in_one_line() {
        let full = io::Error::from(io::ErrorKind::StorageFull);
        let error = Error::unwritten("the file cannot be written", &full).at("a.c3d");
        assert!(error.remedy.is_some(), "{error}");
        let line = error.in_one_line();
        assert!(!line.contains('\n') && !line.contains("  "), "{line}");
        assert!(line.starts_with("the file cannot be written; where a.c3d; got "), "{line}");
        assert!(line.contains("; to do make room"), "{line}");
    }

    #[test]
    fn no_row_of_an_error_is_blank() {
        let error = Error::new("no name").at("").got(" ").allowed("a name").remedy("");
        assert_eq!(error.to_string(), "no name\n  got      nothing\n  allowed  a name");
    }

    #[test]
    fn of_many_names_the_first_are_told_and_how_many_more() {
        let names: Vec<String> = (1..=9).map(|n| format!("j{n}")).collect();
        assert_eq!(listed(&names[..8]), "j1, j2, j3, j4, j5, j6, j7, j8");
        assert_eq!(listed(&names), "j1, j2, j3 and 6 more");
        assert_eq!(listed::<&str>(&[]), "");
    }

    #[test]
    fn what_was_found_is_told_in_a_length_that_can_be_read() {
        let said = |got: String| Error::new("too large").got(got).got.unwrap_or_default();
        assert_eq!(&*said(format!("{} rad", 1e300)), "10000000... (301 digits) rad");
        assert_eq!(&*said("123456789012345678901234.5".to_owned()), "123456789012345678901234.5");
        assert_eq!(&*said("ä1".repeat(400)), "ä1".repeat(300) + "... (800 letters)");
        assert_eq!(&*said("ä1".repeat(300)), "ä1".repeat(300));
    }

    #[test]
    fn a_name_that_is_none_of_those_there_are_is_told_which_one_was_meant() {
        let error = Error::new("no such action").none_of("WLAK", ["walk", "run"], "take one");
        assert_eq!(error.got.as_deref(), Some("WLAK"));
        assert_eq!(error.allowed.as_deref(), Some("walk, run"));
        assert_eq!(error.remedy.as_deref(), Some("did you mean walk? If not, take one"));
    }
}
