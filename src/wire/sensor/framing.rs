//! COBS and SLIP: ways to cut a stream of bytes into records.
//!
//! Sources: S. Cheshire and M. Baker, "Consistent Overhead Byte Stuffing", IEEE/ACM Transactions on
//! Networking 7(2), 1999; RFC 1055 (SLIP).
//!
//! ```
//! use gaitway::wire::sensor::framing::{cobs, slip};
//!
//! let mut out = Vec::new();
//! cobs(&mut out, &[0x11, 0x22, 0x00, 0x33]);
//! assert_eq!(out, [0x03, 0x11, 0x22, 0x02, 0x33, 0x00]);
//! out.clear();
//! slip(&mut out, &[0x01, 0xC0, 0x02, 0xDB, 0x03]);
//! assert_eq!(out, [0x01, 0xDB, 0xDC, 0x02, 0xDB, 0xDD, 0x03, 0xC0]);
//! ```

use super::columns::{Column, record};
use super::{MAX_LINE, Reading};
use crate::wire::{Decoded, Reason};

const ESC: u8 = 0xDB;
const ESC_END: u8 = 0xDC;
const ESC_ESC: u8 = 0xDD;
/// The byte that ends a SLIP frame.
const SLIP_END: u8 = 0xC0;
/// The byte that ends a COBS frame.
const COBS_END: u8 = 0x00;

/// Appends `record` as a COBS frame, its zero included.
pub fn cobs(out: &mut Vec<u8>, record: &[u8]) {
    let mut blocks = record.split(|&byte| byte == 0).peekable();
    while let Some(mut block) = blocks.next() {
        // A block of 254 bytes stands without a zero after it.
        while block.len() >= 254 {
            out.push(0xFF);
            out.extend_from_slice(&block[..254]);
            block = &block[254..];
            if block.is_empty() && blocks.peek().is_none() {
                out.push(COBS_END);
                return;
            }
        }
        out.push(block.len() as u8 + 1);
        out.extend_from_slice(block);
    }
    out.push(COBS_END);
}

/// Undoes COBS stuffing; `frame` is what lies between two zeros. `None` if it is no such frame.
#[must_use]
pub fn uncobs(frame: &[u8]) -> Option<Vec<u8>> {
    let mut out = Vec::with_capacity(frame.len());
    let mut rest = frame;
    while let [code, after @ ..] = rest {
        let length = usize::from(*code).checked_sub(1)?;
        let block = after.get(..length)?;
        if block.contains(&0) {
            return None;
        }
        out.extend_from_slice(block);
        rest = &after[length..];
        if *code != 0xFF && !rest.is_empty() {
            out.push(0);
        }
    }
    Some(out)
}

/// Appends `record` as a SLIP frame, its end byte included.
pub fn slip(out: &mut Vec<u8>, record: &[u8]) {
    for &byte in record {
        match byte {
            SLIP_END => out.extend_from_slice(&[ESC, ESC_END]),
            ESC => out.extend_from_slice(&[ESC, ESC_ESC]),
            _ => out.push(byte),
        }
    }
    out.push(SLIP_END);
}

/// Undoes SLIP stuffing of a frame without its end byte, which was `end`. `None` if an escape is
/// followed by something else.
#[must_use]
pub fn unstuff(frame: &[u8], end: u8) -> Option<Vec<u8>> {
    let mut out = Vec::with_capacity(frame.len());
    let mut bytes = frame.iter();
    while let Some(&byte) = bytes.next() {
        out.push(match byte {
            ESC => match *bytes.next()? {
                ESC_END => end,
                ESC_ESC => ESC,
                _ => return None,
            },
            _ => byte,
        });
    }
    Some(out)
}

pub(super) fn decode_cobs_record(bytes: &[u8], columns: &[Column]) -> Decoded<Reading> {
    framed(bytes, COBS_END, columns, uncobs)
}

pub(super) fn decode_slip_record(bytes: &[u8], columns: &[Column]) -> Decoded<Reading> {
    framed(bytes, SLIP_END, columns, |frame| unstuff(frame, SLIP_END))
}

fn framed(
    bytes: &[u8],
    end: u8,
    columns: &[Column],
    plain: impl FnOnce(&[u8]) -> Option<Vec<u8>>,
) -> Decoded<Reading> {
    let window = &bytes[..bytes.len().min(MAX_LINE)];
    match window.iter().position(|&byte| byte == end) {
        None if window.len() < MAX_LINE => Decoded::Need(1),
        None => {
            let reason = Reason::Length { claimed: MAX_LINE + 1, least: 1, most: MAX_LINE };
            Decoded::Bad(reason, MAX_LINE)
        }
        // Senders may put the end byte before a frame too.
        Some(0) => Decoded::Skip(1),
        Some(length) => {
            let read = plain(&bytes[..length]).ok_or(Reason::Malformed);
            match read.and_then(|plain| record(columns, &plain)) {
                Ok(reading) => Decoded::Packet(reading, length + 1),
                Err(reason) => Decoded::Bad(reason, length + 1),
            }
        }
    }
}
