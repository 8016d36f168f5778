//! Files of captures, opened: all of them say alike what is wrong with one that cannot be read.

use crate::error::{Error, ErrorKind, counted};
use std::fs::{File, Metadata};
use std::io::{self, Read};
use std::path::Path;

/// A file and what the system knows of it.
///
/// # Errors
/// If it cannot be opened; the error names it.
pub(super) fn opened(path: &Path) -> Result<(File, Metadata), Error> {
    let told = |cause: io::Error| unreadable(&cause).in_file(path);
    // Asked before opening: opening a FIFO would wait for a writer.
    let known = std::fs::metadata(path).map_err(told)?;
    if !known.is_file() {
        return Err(Error::of(ErrorKind::Malformed, "this is not a regular file")
            .in_file(path)
            .got(if known.is_dir() { "a folder" } else { "a pipe or a device" })
            .remedy("name a file that is stored on a disk"));
    }
    let file = File::open(path).map_err(told)?;
    let known = file.metadata().map_err(told)?;
    Ok((file, known))
}

/// Says so of a number that would be one with a point in place of its comma.
pub(super) fn with_a_point(error: Error, text: &str) -> Error {
    let pointed = text.replace(',', ".");
    match pointed.parse::<f64>() {
        Ok(number) if number.is_finite() && pointed != text => error
            .remedy(format!("numbers have a point and no comma: {pointed}; export the file so")),
        _ => error,
    }
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
            .got(counted(length, "byte"))
            .allowed(format!("at most {most}", most = counted(most, "byte")))
            .remedy("cut the recording into shorter files"));
    }
    let mut bytes = Vec::with_capacity(length as usize + 1);
    file.take(most).read_to_end(&mut bytes).map_err(|cause| unreadable(&cause).in_file(path))?;
    Ok(bytes)
}

/// The bytes of a text in UTF-8 with lines that end in `\n`, whatever its editor made of it: UTF-16 with its mark, single bytes as
/// in Western Europe, lines that end in `\r` alone. What is no text stays as it is.
pub(super) fn as_utf8(bytes: Vec<u8>) -> Vec<u8> {
    let pairs = |of: fn([u8; 2]) -> u16| {
        let units = bytes.get(2..).unwrap_or_default().chunks_exact(2);
        let units = units.map(|pair| of([pair[0], pair[1]]));
        char::decode_utf16(units).map(|c| c.unwrap_or('\u{fffd}')).collect::<String>().into_bytes()
    };
    let mut text = match bytes.as_slice() {
        [0xff, 0xfe, ..] => pairs(u16::from_le_bytes),
        [0xfe, 0xff, ..] => pairs(u16::from_be_bytes),
        all if str::from_utf8(all).is_err() && !all.contains(&0) => {
            all.iter().map(|byte| char::from(*byte)).collect::<String>().into_bytes()
        }
        _ => bytes,
    };
    if !text.contains(&b'\n') {
        text.iter_mut().filter(|byte| **byte == b'\r').for_each(|byte| *byte = b'\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_of_other_encodings_and_line_ends_are_the_same_text() {
        let plain = "J\u{fc}rgen\n1\n";
        let little: Vec<u8> = [0xff, 0xfe]
            .into_iter()
            .chain(plain.encode_utf16().flat_map(u16::to_le_bytes))
            .collect();
        let big: Vec<u8> = [0xfe, 0xff]
            .into_iter()
            .chain(plain.encode_utf16().flat_map(u16::to_be_bytes))
            .collect();
        for text in
            [little, big, b"J\xfcrgen\n1\n".to_vec(), "J\u{fc}rgen\r1\r".into(), plain.into()]
        {
            assert_eq!(as_utf8(text), plain.as_bytes());
        }
        // Neither does what is no text become one.
        assert_eq!(as_utf8(vec![0xfc, 0, 0xff]), [0xfc, 0, 0xff]);
    }
}
