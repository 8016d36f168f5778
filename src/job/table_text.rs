//! The text of a table that is read whole.

use crate::error::{Error, ErrorKind, counted};
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Largest table read, bytes.
const MAX_FILE_BYTES: u64 = 256 << 20;

/// The text of a table, of bounded length.
///
/// # Errors
/// A file that cannot be read, is none, is too large, or is no UTF-8.
pub fn text_of(path: &Path) -> Result<String, Error> {
    text_up_to(path, MAX_FILE_BYTES)
}

/// The same of at most so many bytes.
///
/// # Errors
/// As [`text_of`].
pub fn text_up_to(path: &Path, most_bytes: u64) -> Result<String, Error> {
    let unreadable = |cause: std::io::Error| {
        Error::of((&cause).into(), "the table cannot be read").in_file(path).got(cause.to_string())
    };
    // Opening a pipe would wait for whoever writes into it.
    let known = std::fs::metadata(path).map_err(unreadable)?;
    if !known.is_file() {
        return Err(Error::of(ErrorKind::Malformed, "the table is no file")
            .in_file(path)
            .allowed("a file whose end is known"));
    }
    let bytes = known.len();
    let file = File::open(path).map_err(unreadable)?;
    if bytes > most_bytes {
        return Err(Error::of(ErrorKind::OutsideLimits, "the table is too large")
            .in_file(path)
            .got(counted(bytes, "byte"))
            .allowed(format!("at most {most_bytes}", most_bytes = counted(most_bytes, "byte"))));
    }
    let mut text = String::new();
    file.take(most_bytes).read_to_string(&mut text).map_err(unreadable)?;
    Ok(text)
}
