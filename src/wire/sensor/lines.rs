//! Lines of text: numbers in declared columns, with or without a check.
//!
//! What Arduino sketches print: numbers separated by comma, semicolon or white space, each with or
//! without a label (`ax:0.12` or `ax=0.12`). With a check the line is that of NMEA 0183:
//! `$...*HH`, where HH is the exclusive or of the characters between.

use super::columns::{Column, reading};
use super::{MAX_LINE, Reading};
use crate::wire::{Decoded, Reason};

/// What a line looks like.
#[derive(Clone, Debug, PartialEq)]
pub struct Lines {
    /// The first cell of a line, `$` included; lines without it are passed over. Empty: every line
    /// is one of ours, but for empty ones and comments (`#`).
    pub prefix: String,
    /// True if each line ends in `*HH`.
    pub check: bool,
    /// What the cells are, after the prefix.
    pub columns: Vec<Column>,
}

impl Lines {
    pub(super) fn decode(&self, bytes: &[u8]) -> Decoded<Reading> {
        line(bytes, |text| self.read(text))
    }

    fn read(&self, text: &str) -> Result<Option<Reading>, Reason> {
        let ours = if self.prefix.is_empty() { !text.starts_with('#') } else { true };
        let Some(begin) = text.find(&self.prefix).filter(|_| ours) else { return Ok(None) };
        let text = &text[begin..];
        let body = if self.check { checked(text)? } else { text };
        // `checked` has taken the dollar sign away.
        let prefix = self.prefix.strip_prefix('$').filter(|_| self.check).unwrap_or(&self.prefix);
        let body = body.strip_prefix(prefix).ok_or(Reason::Malformed)?;
        let body = if prefix.is_empty() { body } else { body.trim_start_matches(separator) };
        let mut cells = cells(body);
        let read = reading(&self.columns, |_| {
            cells.next().ok_or(Reason::Malformed).and_then(|cell| number(unlabelled(cell)))
        })?;
        if cells.next().is_some() { Err(Reason::Malformed) } else { Ok(Some(read)) }
    }
}

/// One line of text, without its end, handed to `read`; `None` from it is a line to pass over.
pub(super) fn line(
    bytes: &[u8],
    read: impl FnOnce(&str) -> Result<Option<Reading>, Reason>,
) -> Decoded<Reading> {
    let window = &bytes[..bytes.len().min(MAX_LINE)];
    let Some(end) = window.iter().position(|&byte| byte == b'\n') else {
        if window.len() < MAX_LINE {
            return Decoded::Need(1);
        }
        let reason = Reason::Length { claimed: MAX_LINE + 1, least: 1, most: MAX_LINE };
        return Decoded::Bad(reason, MAX_LINE);
    };
    let taken = end + 1;
    let Ok(text) = std::str::from_utf8(&bytes[..end]) else {
        return Decoded::Bad(Reason::Malformed, taken);
    };
    let text = text.trim();
    if text.is_empty() {
        return Decoded::Skip(taken);
    }
    match read(text) {
        Ok(Some(reading)) => Decoded::Packet(reading, taken),
        Ok(None) => Decoded::Skip(taken),
        Err(reason) => Decoded::Bad(reason, taken),
    }
}

/// What stands between `$` and `*`, if the check after it fits: two hexadecimal digits are the
/// exclusive or of those characters, four the CRC.
pub(super) fn checked(text: &str) -> Result<&str, Reason> {
    let (body, digits) =
        text.strip_prefix('$').and_then(|text| text.rsplit_once('*')).ok_or(Reason::Malformed)?;
    let plain = digits.bytes().all(|digit| digit.is_ascii_hexdigit());
    let actual = u16::from_str_radix(digits, 16).map_err(|_| Reason::Malformed)?;
    let expected = match digits.len() {
        2 if plain => u16::from(body.bytes().fold(0, |check, byte| check ^ byte)),
        4 if plain => crc(body.as_bytes()),
        _ => return Err(Reason::Malformed),
    };
    super::same(expected, actual)?;
    Ok(body)
}

/// CRC-16/XMODEM: polynomial 0x1021, initial value 0, not reflected.
pub(super) fn crc(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0, |crc, &byte| {
        (0..8).fold(crc ^ u16::from(byte) << 8, |crc, _| {
            if crc & 0x8000 == 0 { crc << 1 } else { crc << 1 ^ 0x1021 }
        })
    })
}

fn separator(letter: char) -> bool {
    matches!(letter, ',' | ';' | '\t' | ' ')
}

/// The cells of a line. A comma or semicolon with nothing before the next is an empty cell; white
/// space around cells does not count.
pub(super) fn cells(text: &str) -> impl Iterator<Item = &str> {
    let by_mark = text.contains([',', ';']);
    text.split(move |letter| if by_mark { matches!(letter, ',' | ';') } else { separator(letter) })
        .map(str::trim)
        .filter(move |cell| by_mark || !cell.is_empty())
}

/// A number as it is printed; not-a-number and infinities are read as what they say.
pub(super) fn number(cell: &str) -> Result<f64, Reason> {
    cell.parse().map_err(|_| Reason::Malformed)
}

/// The cell after its label.
fn unlabelled(cell: &str) -> &str {
    cell.rsplit([':', '=']).next().unwrap_or(cell).trim()
}
