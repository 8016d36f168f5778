//! Room on the disk: looked at before a corpus is made, and told when it ends on the way.

use crate::draft::Draft;
use crate::error::{Error, ErrorKind};
use std::io::{self, Write};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

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

/// The words for a disk that was filled on the way, with so many bytes still to come.
pub fn filled(path: &Path, bytes: u64) -> Error {
    no_room(path, with_margin(bytes), "the disk is full, and the corpus not done")
        .remedy("make room, and give the same command again: it goes on with what is there")
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

/// A file that remembers that its disk was full.
pub struct Watched {
    pub draft: Draft,
    pub is_full: Arc<AtomicBool>,
}

impl Watched {
    fn watch<T>(&self, done: io::Result<T>) -> io::Result<T> {
        if let Err(cause) = &done
            && is_full(cause)
        {
            self.is_full.store(true, Ordering::Relaxed);
        }
        done
    }
}

/// Whether a write failed for want of room.
pub fn is_full(cause: &io::Error) -> bool {
    use io::ErrorKind as Io;
    matches!(cause.kind(), Io::StorageFull | Io::QuotaExceeded | Io::FileTooLarge)
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
