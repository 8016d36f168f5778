//! The folder of a session: files appear whole or not at all, and are never written over.

use super::now::NOW_FILE;
use crate::error::{Error, ErrorKind, counted};
use crate::toml_text::{from_toml, plain_words, to_toml};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Most bytes of a file of a session that is read.
const MOST_BYTES: u64 = 4 << 20;
const ROOMS: [&str; 4] = ["subjects", "calibration", "trials", "angles"];

/// The folder of a session. While it lives, no other program runs a session there.
#[derive(Debug)]
pub struct Folder {
    root: PathBuf,
    /// Locked as long as it is open.
    _lock: File,
}

impl Folder {
    /// Opens the folder, or makes it.
    ///
    /// # Errors
    /// A folder that cannot be made, holds other things, or in which a session runs now.
    pub fn open(root: &Path) -> Result<Self, Error> {
        let begun = root.join("session.toml").exists();
        if !begun && fs::read_dir(root).is_ok_and(has_strangers) {
            return Err(Error::of(
                ErrorKind::Exists,
                "the folder holds something else, not a session",
            )
            .at(shown(root))
            .remedy("choose a folder that is empty or does not exist yet"));
        }
        for room in ROOMS {
            let room = root.join(room);
            fs::create_dir_all(&room).map_err(|cause| unwritable(&room, &cause))?;
        }
        let path = root.join(LOCK);
        let lock = File::create(&path).map_err(|cause| unwritable(&path, &cause))?;
        // Where the file system knows no locks, there is none; two operators would see each other.
        if matches!(lock.try_lock(), Err(fs::TryLockError::WouldBlock)) {
            return Err(Error::of(ErrorKind::Busy, "a session is already running in this folder")
                .at(shown(root))
                .remedy("end it there, or choose another folder"));
        }
        Ok(Self { root: root.to_owned(), _lock: lock })
    }

    /// Takes away again what [`Self::open`] made in a folder in which no session was begun, and these folders, which were not
    /// there before: its own, and those above it.
    pub fn take_away_unused(&self, made: &[PathBuf]) {
        let root = &self.root;
        if root.join("session.toml").symlink_metadata().is_ok() {
            return;
        }
        // What has something in it stays.
        for room in ROOMS {
            let _ = fs::remove_dir(root.join(room));
        }
        let _ = fs::remove_file(root.join(LOCK));
        for folder in made {
            let _ = fs::remove_dir(folder);
        }
    }

    /// Where it is.
    #[must_use]
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// The path of a file in it.
    #[must_use]
    pub fn path(&self, name: &str) -> PathBuf {
        self.root.join(name)
    }

    /// True if there is such a file.
    #[must_use]
    pub fn has(&self, name: &str) -> bool {
        self.path(name).symlink_metadata().is_ok()
    }

    /// Reads a TOML file; `None` if it is not there.
    ///
    /// # Errors
    /// A file that cannot be read or says something else than it should.
    pub fn read<T: DeserializeOwned>(&self, name: &str) -> Result<Option<T>, Error> {
        let Some(text) = self.text(name)? else { return Ok(None) };
        let value = from_toml(&text).map_err(|e| {
            Error::new("the file of a session was changed into something else")
                .at(shown(&self.path(name)))
                .got(plain_words(e.message()).replace('\n', "; "))
        })?;
        Ok(Some(value))
    }

    /// Reads the text of a file; `None` if it is not there.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn text(&self, name: &str) -> Result<Option<String>, Error> {
        let path = self.path(name);
        if !self.has(name) {
            return Ok(None);
        }
        let found = fs::metadata(&path).ok();
        // A pipe or a device would be waited for.
        if found.as_ref().is_some_and(|found| !found.is_file()) {
            return Err(Error::new("a file of the session is no file")
                .at(shown(&path))
                .got("a pipe, a device or a folder")
                .allowed("a file on a disk"));
        }
        let size = found.map_or(0, |found| found.len());
        if size > MOST_BYTES {
            return Err(Error::new("the file is too large to be one of a session")
                .at(shown(&path))
                .got(counted(size, "byte")));
        }
        let text = fs::read_to_string(&path).map_err(|cause| {
            Error::of((&cause).into(), "the file cannot be read")
                .at(shown(&path))
                .got(cause.to_string())
        })?;
        Ok(Some(text))
    }

    /// Writes a new TOML file.
    ///
    /// # Errors
    /// A file that is there already or cannot be written.
    pub fn write_new(&self, name: &str, value: &impl Serialize) -> Result<(), Error> {
        self.write_new_bytes(name, to_toml("", value)?.as_bytes())
    }

    /// Writes a new file of any kind.
    ///
    /// # Errors
    /// A file that is there already or cannot be written.
    pub fn write_new_bytes(&self, name: &str, bytes: &[u8]) -> Result<(), Error> {
        if self.has(name) {
            return Err(
                Error::of(ErrorKind::Exists, "the file exists already").at(shown(&self.path(name)))
            );
        }
        self.replace_bytes(name, bytes)
    }

    /// Writes a TOML file in place of what was there: old or new, never half of it.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn replace(&self, name: &str, value: &impl Serialize) -> Result<(), Error> {
        self.replace_bytes(name, to_toml("", value)?.as_bytes())
    }

    fn replace_bytes(&self, name: &str, bytes: &[u8]) -> Result<(), Error> {
        let path = self.path(name);
        let beside = self.path(&format!("{name}.new"));
        let write = || -> io::Result<()> {
            let mut file = File::create(&beside)?;
            file.write_all(bytes)?;
            file.sync_all()?;
            fs::rename(&beside, &path)?;
            // The name too survives a power cut, where the file system can say so.
            let _ = path.parent().map(|folder| File::open(folder).and_then(|f| f.sync_all()));
            Ok(())
        };
        write().map_err(|cause| unwritable(&path, &cause))
    }

    /// Puts a file up that is no part of the session and may be lost with the power: old or new, never half of it.
    ///
    /// # Errors
    /// A file that cannot be written. What was there before, and says something else, is taken away then.
    pub fn put_up(&self, name: &str, bytes: &[u8]) -> Result<(), Error> {
        let path = self.path(name);
        let beside = self.path(&format!("{name}.new"));
        let write = || -> io::Result<()> {
            // What was left there is not written into: it may be a link to somewhere else.
            let _ = fs::remove_file(&beside);
            File::create_new(&beside)?.write_all(bytes)?;
            fs::rename(&beside, &path)
        };
        write().map_err(|cause| {
            let _ = fs::remove_file(&beside);
            self.take_down(name);
            Error::unwritten("the file cannot be written", &cause).at(shown(&path))
        })
    }

    /// Takes away a file that was put up, if it can.
    pub fn take_down(&self, name: &str) {
        let _ = fs::remove_file(self.path(name));
    }

    /// Names of the files in a room that end so, without the ending, sorted.
    #[must_use]
    pub fn names(&self, room: &str, ending: &str) -> Vec<String> {
        let entries = fs::read_dir(self.path(room)).into_iter().flatten().flatten();
        let stem = |entry: fs::DirEntry| {
            Some(entry.file_name().to_str()?.strip_suffix(ending)?.to_owned())
        };
        let mut names: Vec<String> = entries.filter_map(stem).collect();
        names.sort();
        names
    }
}

const LOCK: &str = ".lock";
/// What a session leaves behind that was killed before its first question was answered.
const LEFT: [&str; 4] = [LOCK, "session.toml.new", NOW_FILE, "now.json.new"];

/// True if a folder holds something that a session just begun and killed does not.
fn has_strangers(mut entries: fs::ReadDir) -> bool {
    entries.any(|entry| {
        let name = entry.map(|entry| entry.file_name()).unwrap_or_default();
        name.to_str().is_none_or(|name| !LEFT.contains(&name) && !ROOMS.contains(&name))
    })
}

fn shown(path: &Path) -> String {
    path.display().to_string()
}

fn unwritable(path: &Path, cause: &io::Error) -> Error {
    Error::of(ErrorKind::Io, "the session cannot be written").at(shown(path)).got(cause.to_string())
}
