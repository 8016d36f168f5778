//! Files of captures, opened: all of them say alike what is wrong with one that cannot be read.

use crate::error::{Error, ErrorKind};
use std::fs::{File, Metadata};
use std::io::{self, Read};
use std::path::Path;

/// A file and what the system knows of it.
///
/// # Errors
/// If it cannot be opened; the error names it.
pub(super) fn opened(path: &Path) -> Result<(File, Metadata), Error> {
    let told = |cause: io::Error| unreadable(&cause).in_file(path);
    let file = File::open(path).map_err(told)?;
    let known = file.metadata().map_err(told)?;
    Ok((file, known))
}

/// A file that the system does not let be read.
pub(super) fn unreadable(cause: &io::Error) -> Error {
    Error::of(cause.into(), "the file cannot be read")
        .got(cause.to_string())
        .remedy("check the path and the permissions")
}

/// The bytes of a file that has at most so many.
///
/// # Errors
/// If it cannot be read or is larger; the error names it.
pub(super) fn bytes_of(path: &Path, most: u64) -> Result<Vec<u8>, Error> {
    let (file, known) = opened(path)?;
    let length = known.len();
    if length > most {
        return Err(Error::of(ErrorKind::Malformed, "the file is too large")
            .in_file(path)
            .got(format!("{length} bytes"))
            .allowed(format!("at most {most} bytes"))
            .remedy("cut the recording into shorter files"));
    }
    let mut bytes = Vec::with_capacity(length as usize + 1);
    file.take(most).read_to_end(&mut bytes).map_err(|cause| unreadable(&cause).in_file(path))?;
    Ok(bytes)
}
