//! Files of captures, opened: all of them say alike what is wrong with one that cannot be read.

use crate::error::Error;
use std::fs::{File, Metadata};
use std::io;
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
