//! What a recording needs of a disk, and the bytes on their way there.

use std::fs::File;
use std::io::{self, Write};
use std::os::unix::fs::FileTypeExt;
use std::path::Path;

use crate::draft::Draft;
use crate::error::{Error, ErrorKind};

/// Returns once everything that was appended when it was called would survive a power cut. After an
/// error what was appended since the last success may be lost.
pub type Syncer = Box<dyn FnMut() -> io::Result<()> + Send>;

/// What a recording needs of a disk.
pub trait Disk: Send + 'static {
    /// Puts all of `bytes` at the end of the file.
    ///
    /// # Errors
    /// As the file system says; some of the bytes may have been written.
    fn append(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// What synchronises the file, on a thread of its own: a disk may take seconds for it, in which
    /// what comes is appended.
    ///
    /// # Errors
    /// A file that cannot be had twice.
    fn syncer(&self) -> io::Result<Syncer>;

    /// There is something worth keeping: the file may take the place of one it replaces. One that is
    /// dropped before leaves what was there.
    ///
    /// # Errors
    /// As the file system says; what was there stays then.
    fn keep(&mut self) -> io::Result<()> {
        Ok(())
    }

    /// True if another file is still in its place.
    fn replaces(&self) -> bool {
        false
    }
}

impl Disk for Draft {
    fn append(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.write_all(bytes)
    }

    fn syncer(&self) -> io::Result<Syncer> {
        Ok(Box::new(Self::syncer(self)?))
    }

    fn keep(&mut self) -> io::Result<()> {
        Self::keep(self)
    }

    fn replaces(&self) -> bool {
        Self::replaces(self)
    }
}

pub(super) fn shown(path: &Path) -> String {
    path.display().to_string()
}

/// Begins the file at `path`. If it is to be whole, it has its name at its end.
pub(super) fn create_file(path: &Path, force: bool, is_whole: bool) -> Result<Draft, Error> {
    let begun = if is_whole { Draft::whole(path, force) } else { Draft::create(path, force) };
    begun.map_err(|cause| {
        let error = Error::of((&cause).into(), "the file cannot be created")
            .at(shown(path))
            .got(cause.to_string());
        match cause.kind() {
            io::ErrorKind::AlreadyExists => {
                error.remedy("choose another name, or add --force to replace it")
            }
            io::ErrorKind::ResourceBusy => error.remedy("choose another name"),
            _ => error,
        }
    })
}

/// Opens a recording.
pub(super) fn open(path: &Path) -> Result<File, Error> {
    let unreadable = |cause: String| {
        Error::of(ErrorKind::Io, "the recording cannot be opened")
            .at(path.display().to_string())
            .got(cause)
    };
    // Asked before opening: a named pipe would make the open itself wait for ever.
    let kind = std::fs::metadata(path).map_err(|cause| unreadable(cause.to_string()))?;
    if !kind.is_file() {
        let (got, remedy) = told_apart(kind.file_type());
        let error = unreadable(format!("{got}, not a regular file"));
        return Err(error.allowed("a file on a disk").remedy(remedy));
    }
    File::open(path).map_err(|cause| unreadable(cause.to_string()))
}

/// What stands where a file should, and what can be done with it.
fn told_apart(kind: std::fs::FileType) -> (&'static str, &'static str) {
    if kind.is_dir() {
        ("a folder", "name a file that is in it")
    } else if kind.is_fifo() {
        ("a pipe", "keep what comes out of it in a file first: cat PIPE > FILE")
    } else if kind.is_char_device() {
        (
            "a device",
            "`gaitway scan` asks who is on a line, `gaitway record` records what a device says",
        )
    } else {
        ("neither a file nor a device that sends bytes", "name the file that it stands for")
    }
}
