//! `corpus.json`: what a folder of variations was made from. It may grow; what does not fit is refused
//! in words.

use crate::action::corpus::Corpus;
use crate::corpus::store::check_outside;
use crate::draft::Draft;
use crate::error::{Error, ErrorKind, counted};
use crate::job::share::Share;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt::{self, Write as _};
use std::fs::{self, File, TryLockError};
use std::path::Path;
use std::thread;
use std::time::Duration;

const NAME: &str = "corpus.json";
/// Who makes a part waits so often, and so long each time, for who writes the catalogue.
const WAITS: u32 = 600;
const WAIT: Duration = Duration::from_millis(50);
/// No catalogue is longer, bytes.
const MAX_BYTES: u64 = 16 << 20;

/// What is made, as it is written into the files and beside them: equal figures make equal files.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Catalogue {
    pub generator: String,
    pub seed: u64,
    pub rate_hz: f64,
    pub set: Vec<String>,
    pub database: Vec<String>,
    pub points: bool,
    pub subject: String,
    pub stature_m: f64,
    /// In the order of their labels.
    pub classes: Vec<ClassNote>,
}

/// One class of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ClassNote {
    pub label: String,
    pub class: String,
    pub action: String,
    /// How many there are to be. Files of a folder do not say it: they stay as they are when others
    /// come.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub variations: Option<u32>,
    /// Of everything the variations come from: files may have been edited since.
    pub fingerprint: String,
}

/// FNV-1a, 64 bits (Fowler, Noll and Vo), of what is written to it.
struct Fingerprint(u64);

impl fmt::Write for Fingerprint {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for byte in text.bytes() {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
        Ok(())
    }
}

/// The fingerprint of what a value says of itself.
fn fingerprint(of: &impl fmt::Debug) -> String {
    let mut all = Fingerprint(0xcbf2_9ce4_8422_2325);
    let _ = write!(all, "{of:?}");
    format!("{:016x}", all.0)
}

/// What the body of a corpus is called: bodies of the same measures have the same name.
pub fn subject(corpus: &Corpus) -> String {
    format!("body-{}", &fingerprint(&corpus.body)[..8])
}

/// A label as a part of a file name. What is no short plain word of small letters ends in a tilde and a fingerprint, which
/// no plain word has, so that no two labels share a name, nor do they where capitals do not count.
pub fn stem(label: &str) -> String {
    let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_' || c == '-';
    if label.len() <= 40 && label.chars().all(plain) {
        return label.to_owned();
    }
    let simple = |c: char| {
        let c = c.to_ascii_lowercase();
        if plain(c) { c } else { '-' }
    };
    let simple: String = label.chars().take(40).map(simple).collect();
    format!("{simple}~{}", fingerprint(&label))
}

impl ClassNote {
    pub fn of(corpus: &Corpus, action: &str, variations: Option<u32>) -> Self {
        Self {
            label: corpus.label.clone(),
            class: corpus.class(),
            action: action.to_owned(),
            variations,
            fingerprint: fingerprint(corpus),
        }
    }
}

impl Catalogue {
    /// As text.
    pub fn text(&self) -> Result<String, Error> {
        serde_json::to_string_pretty(self)
            .map(|text| text + "\n")
            .map_err(|e| Error::new("the corpus cannot be described").got(e.to_string()))
    }

    /// Fails if the files of two classes would have the same names.
    pub fn check_stems(&self) -> Result<(), Error> {
        let mut taken = BTreeMap::new();
        for ClassNote { label, .. } in &self.classes {
            if let Some(other) = taken.insert(stem(label), label) {
                return Err(Error::new("the files of two classes would have the same names")
                    .got(format!("{other:?} and {label:?}"))
                    .remedy("choose another label for one of them"));
            }
        }
        Ok(())
    }

    /// What of `asked` this corpus cannot hold, in words.
    fn unlike(&self, asked: &Self) -> Vec<String> {
        let mut unlike = Vec::new();
        let mut compare = |what: &str, found: String, asked: String| {
            if found != asked {
                unlike.push(format!("{what} {found} (asked for: {asked})"));
            }
        };
        let shown = |list: &[String]| format!("[{}]", list.join(" "));
        compare("made by", self.generator.clone(), asked.generator.clone());
        compare("--seed", self.seed.to_string(), asked.seed.to_string());
        compare("--rate", self.rate_hz.to_string(), asked.rate_hz.to_string());
        compare("--set", shown(&self.set), shown(&asked.set));
        compare("--database", shown(&self.database), shown(&asked.database));
        compare("points", self.points.to_string(), asked.points.to_string());
        compare("body", self.subject.clone(), asked.subject.clone());
        for class in &asked.classes {
            let Some(found) = self.classes.iter().find(|found| found.label == class.label) else {
                continue;
            };
            let of = |what: &str| format!("{what} of {}", class.label);
            compare(&of("action"), found.action.clone(), class.action.clone());
            compare(&of("fingerprint"), found.fingerprint.clone(), class.fingerprint.clone());
            let (there, now) = (found.variations.unwrap_or(0), class.variations.unwrap_or(0));
            if there > now {
                compare(&of("variations"), there.to_string(), format!("{now}, fewer"));
            }
        }
        unlike
    }

    /// The corpus with what is asked for: classes that have grown, and new ones.
    fn with(&self, asked: &Self) -> Self {
        let notes = self.classes.iter().chain(&asked.classes);
        let by_label: BTreeMap<&str, &ClassNote> =
            notes.map(|note| (note.label.as_str(), note)).collect();
        Self { classes: by_label.into_values().cloned().collect(), ..asked.clone() }
    }
}

/// A folder that is new, or holds a part of the same corpus. As long as this is kept, nobody else writes into it, or only
/// those who make other parts.
pub fn open_folder(
    folder: &Path,
    asked: &Catalogue,
    force: bool,
    part: Share,
) -> Result<File, Error> {
    let failed = |what: &str, e: &std::io::Error| {
        Error::of(e.into(), what).at(folder.display().to_string()).got(e.to_string())
    };
    check_outside(folder)?;
    let note = folder.join(NAME);
    if folder.exists() && !folder.is_dir() {
        return Err(Error::new("this is a file, not a folder")
            .at(folder.display().to_string())
            .allowed("a folder, or a name that ends in .parquet"));
    }
    fs::create_dir_all(folder).map_err(|e| failed("cannot make the folder", &e))?;
    let lock = File::open(folder).map_err(|e| failed("cannot read the folder", &e))?;
    let busy = || {
        Error::of(ErrorKind::Busy, "another program makes a corpus in this folder")
            .at(folder.display().to_string())
            .remedy("wait until it has ended, or choose another folder")
    };
    // Of parts, who comes first writes the catalogue, which the others find there.
    let waits = if part == Share::WHOLE { 1 } else { WAITS };
    for wait in 0..waits {
        if wait > 0 {
            thread::park_timeout(WAIT);
        }
        if part != Share::WHOLE && lock.try_lock_shared().is_ok() {
            if grown(folder, asked, force)?.is_none() {
                return Ok(lock);
            }
            lock.unlock().map_err(|e| failed("cannot read the folder", &e))?;
        }
        let is_alone = match lock.try_lock() {
            Ok(()) => true,
            Err(TryLockError::WouldBlock) => continue,
            // A file system that knows no locks keeps nobody out.
            Err(TryLockError::Error(_)) => false,
        };
        if let Some(grown) = grown(folder, asked, force)? {
            Draft::write_whole(&note, true, grown.text()?.as_bytes())
                .map_err(|e| failed("cannot write into the folder", &e))?;
        }
        if part == Share::WHOLE || !is_alone {
            return Ok(lock);
        }
        lock.unlock().map_err(|e| failed("cannot read the folder", &e))?;
    }
    Err(busy())
}

/// The catalogue that is to be there with what is asked for; none if it is there already.
///
/// # Errors
/// A folder that holds something else.
fn grown(folder: &Path, asked: &Catalogue, force: bool) -> Result<Option<Catalogue>, Error> {
    let note = folder.join(NAME);
    if let Some(found) = found(&note)? {
        let unlike = found.unlike(asked);
        if !unlike.is_empty() {
            return Err(Error::of(ErrorKind::Exists, "the folder holds another corpus")
                .at(note.display().to_string())
                .got(unlike.join("; "))
                .allowed("the same figures, the same actions, as many variations or more")
                .remedy("choose another folder, or repeat the command that began this one"));
        }
        let grown = found.with(asked);
        grown.check_stems()?;
        return Ok((grown != found).then_some(grown));
    }
    let mut entries = fs::read_dir(folder).map_err(|e| {
        Error::of((&e).into(), "cannot read the folder")
            .at(folder.display().to_string())
            .got(e.to_string())
    })?;
    if !force && entries.next().is_some() {
        return Err(Error::of(ErrorKind::Exists, "the folder is not empty and holds no corpus")
            .at(folder.display().to_string())
            .remedy("choose another folder, or add --force"));
    }
    Ok(Some(asked.clone()))
}

/// The catalogue that is there; none if there is none.
fn found(note: &Path) -> Result<Option<Catalogue>, Error> {
    let wrong = |got: String| {
        Error::of(ErrorKind::Malformed, "this is not the catalogue of a corpus")
            .at(note.display().to_string())
            .got(got)
            .remedy("choose another folder")
    };
    let length = match note.metadata() {
        Ok(of) if of.is_file() => of.len(),
        // A pipe would be waited for.
        Ok(_) => return Err(wrong("it is no file".to_owned())),
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        Err(e) => return Err(wrong(e.to_string())),
    };
    if length > MAX_BYTES {
        return Err(wrong(counted(length, "byte")));
    }
    let text = fs::read_to_string(note).map_err(|e| wrong(e.to_string()))?;
    serde_json::from_str(&text).map(Some).map_err(|e| wrong(e.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn no_two_labels_have_one_stem_and_every_stem_is_a_name() {
        let long = "a".repeat(41);
        let labels =
            ["a b", "a-b", "a/b", "a.b", "A-b", "a_b", "", "-", "..", "a\u{e9}b", "a\u{301}b"];
        let mut labels: BTreeSet<String> = labels.map(str::to_owned).into();
        labels.extend([long.clone() + "b", long]);
        // Those who know how the others are written.
        let stems: Vec<String> = labels.iter().map(|label| stem(label)).collect();
        labels.extend(stems);
        let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || "_-~".contains(c);
        let stems: BTreeSet<String> = labels.iter().map(|label| stem(label)).collect();
        assert_eq!(stems.len(), labels.len(), "{stems:?}");
        assert!(stems.iter().all(|stem| stem.len() < 64 && stem.chars().all(plain)), "{stems:?}");
    }
}
