//! Room on the disk: looked at before a corpus is made, and told when it ends on the way.

use crate::draft::Draft;
use crate::error::{Error, ErrorKind};
use std::io::{self, Write};
use std::path::Path;
use std::sync::{Arc, OnceLock};

/// What estimates may be short by: a tenth, and a mebibyte for folders and ends of files.
const fn with_margin(bytes: u64) -> u64 {
    bytes.saturating_add(bytes / 10).saturating_add(1 << 20)
}

/// Fails if there is no room for so many bytes where `path` is to be.
pub fn check(path: &Path, bytes: u64) -> Result<(), Error> {
    let needed = with_margin(bytes);
    match free_bytes(path) {
        Some(free) if free < needed => {
            Err(no_room(path, needed, "there is no room for the corpus"))
        }
        // What a file system does not tell shows when it is written.
        _ => Ok(()),
    }
}

/// The words for a place in which no more could be written on the way, with so many bytes still to come.
pub fn filled(path: &Path, bytes: u64, why: io::ErrorKind) -> Error {
    let again = "and give the same command again: it goes on with what is there";
    let needed = with_margin(bytes);
    match why {
        io::ErrorKind::FileTooLarge => {
            Error::of(ErrorKind::Io, "a file may not grow any more, and the corpus is not done")
                .at(path.display().to_string())
                .got(format!(
                    "the limit on the size of a file (`ulimit -f`, or that of the file system), and about {} to come",
                    megabytes(needed)
                ))
                .remedy(format!("raise the limit or make fewer variations, {again}"))
        }
        io::ErrorKind::QuotaExceeded => {
            no_room(path, needed, "the quota of this user is used up, and the corpus is not done")
                .remedy(format!("make room within the quota, {again}"))
        }
        _ => no_room(path, needed, "the disk is full, and the corpus not done")
            .remedy(format!("make room, {again}")),
    }
}

fn no_room(path: &Path, needed: u64, what: &str) -> Error {
    let free = free_bytes(path).map_or("unknown".to_owned(), megabytes);
    Error::of(ErrorKind::Io, what)
        .at(path.display().to_string())
        .got(format!("{free} of room"))
        .allowed(format!("about {} or more", megabytes(needed)))
        .remedy("make room, name a place on another disk, or make fewer variations or no points")
}

fn megabytes(bytes: u64) -> String {
    format!("{:.1} MB", bytes as f64 / 1e6)
}

/// Room for this user on the file system where `path` is or will be.
fn free_bytes(path: &Path) -> Option<u64> {
    let absolute = std::path::absolute(path).ok()?;
    let there = absolute.ancestors().find(|folder| folder.exists())?;
    let of = rustix::fs::statvfs(there).ok()?;
    of.f_bavail.checked_mul(of.f_frsize)
}

/// A file that remembers why no more could be written.
pub struct Watched {
    pub draft: Draft,
    pub why: Arc<OnceLock<io::ErrorKind>>,
}

impl Watched {
    fn watch<T>(&self, done: io::Result<T>) -> io::Result<T> {
        if let Err(cause) = &done {
            remember(&self.why, cause);
        }
        done
    }
}

/// Keeps the first reason for which a write failed, if it is want of room.
pub fn remember(why: &OnceLock<io::ErrorKind>, cause: &io::Error) {
    use io::ErrorKind as Io;
    if matches!(cause.kind(), Io::StorageFull | Io::QuotaExceeded | Io::FileTooLarge) {
        why.get_or_init(|| cause.kind());
    }
}

impl Write for Watched {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let done = self.draft.write(bytes);
        self.watch(done)
    }

    fn flush(&mut self) -> io::Result<()> {
        let done = self.draft.flush();
        self.watch(done)
    }
}
