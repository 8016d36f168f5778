//! Profiles of the user's own: files that are found by name after those that ship.
//!
//! A file becomes known with the folder that holds it ([`add_folder`]), or with a robot file beside it
//! that names it. It is read when it is first asked for, and kept for as long as the process lives.
//! Nothing of a user's has a shipped name: two machines would mean different servos by one word.

use crate::error::ProfileError;
use crate::files::{self, parse_servo, read_text};
use crate::schema::{Adapter, Servo};
use std::path::{Path, PathBuf};
use std::sync::{OnceLock, PoisonError, RwLock};

/// A file that is known.
#[derive(Debug)]
pub struct OwnFile {
    name: String,
    path: PathBuf,
    text: OnceLock<Result<String, ProfileError>>,
    servo: OnceLock<Result<Servo, ProfileError>>,
    adapter: OnceLock<Result<Adapter, ProfileError>>,
}

static KNOWN: RwLock<Vec<&'static OwnFile>> = RwLock::new(Vec::new());

impl OwnFile {
    /// The name by which it is found: that of the file, without `.toml`.
    #[must_use]
    pub fn name(&'static self) -> &'static str {
        &self.name
    }

    /// Where it is.
    #[must_use]
    pub fn path(&'static self) -> &'static Path {
        &self.path
    }

    /// What stands in it.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn text(&'static self) -> Result<&'static str, ProfileError> {
        let read = self.text.get_or_init(|| read_text(&self.path));
        read.as_deref().map_err(ProfileError::clone)
    }

    pub(crate) fn servo(&'static self) -> Result<&'static Servo, ProfileError> {
        let parsed =
            self.servo.get_or_init(|| parse_servo(&self.path.display().to_string(), self.text()?));
        parsed.as_ref().map_err(ProfileError::clone)
    }

    pub(crate) fn adapter(&'static self) -> Result<&'static Adapter, ProfileError> {
        let parsed = self
            .adapter
            .get_or_init(|| files::parse_adapter(&self.path.display().to_string(), self.text()?));
        parsed.as_ref().map_err(ProfileError::clone)
    }

    /// True if the file has this key at its top, and can be read.
    pub(crate) fn has_key(&'static self, key: &str) -> bool {
        let table = self.text().ok().and_then(|text| crate::from_toml::<toml::Table>(text).ok());
        table.is_some_and(|table| table.contains_key(key))
    }
}

/// Every file that is known, in the order in which it became so.
#[must_use]
pub fn own_files() -> Vec<&'static OwnFile> {
    KNOWN.read().unwrap_or_else(PoisonError::into_inner).clone()
}

/// The file of this name.
#[must_use]
pub fn own_file(name: &str) -> Option<&'static OwnFile> {
    own_files().into_iter().find(|own| own.name == name)
}

/// Makes the profiles of a folder known: every file in it that ends in `.toml`. How many there are.
///
/// # Errors
/// A folder that cannot be read; a file with the name of a shipped profile, or of another that is
/// known.
pub fn add_folder(folder: &Path) -> Result<usize, ProfileError> {
    let place = folder.display().to_string();
    let unreadable = |cause: std::io::Error| {
        ProfileError::new(&place, "the folder of profiles cannot be read").got(cause)
    };
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(unreadable)? {
        let path = entry.map_err(unreadable)?.path();
        if path.extension().is_some_and(|ending| ending == "toml") {
            paths.push(path);
        }
    }
    paths.sort();
    paths.iter().try_for_each(|path| add_file(path))?;
    Ok(paths.len())
}

/// Makes one file known.
pub(crate) fn add_file(path: &Path) -> Result<(), ProfileError> {
    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let file = path.display().to_string();
    if files::is_shipped(&name) {
        return Err(ProfileError::new(
            &file,
            "a profile of one's own has the name of a shipped one",
        )
        .got(&name)
        .remedy("give the file, and its `name`, another name"));
    }
    let path = std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    let mut known = KNOWN.write().unwrap_or_else(PoisonError::into_inner);
    match known.iter().find(|own| own.name == name) {
        Some(own) if own.path == path => Ok(()),
        Some(own) => Err(ProfileError::new(&file, "two profiles have one name")
            .got(own.path.display())
            .remedy("give one of them another name")),
        None => {
            let (text, servo, adapter) = (OnceLock::new(), OnceLock::new(), OnceLock::new());
            // As many as a user has files, once each: what is read of them is handed out for good.
            known.push(Box::leak(Box::new(OwnFile { name, path, text, servo, adapter })));
            Ok(())
        }
    }
}

/// Makes known what a robot file names and has beside it.
pub(crate) fn add_beside(robot_file: &Path, robot: &toml::Table) -> Result<(), ProfileError> {
    let folder = robot_file.parent().unwrap_or(Path::new("."));
    let lists = ["joint", "setup"].into_iter().filter_map(|key| robot.get(key)?.as_array());
    let names = lists.flatten().filter_map(|entry| entry.get("servo")?.as_str());
    for name in names.filter(|name| !files::is_shipped(name) && own_file(name).is_none()) {
        let is_name = |c: char| c.is_ascii_alphanumeric() || c == '-';
        let path = folder.join(format!("{name}.toml"));
        if name.chars().all(is_name) && path.is_file() {
            add_file(&path)?;
        }
    }
    Ok(())
}
