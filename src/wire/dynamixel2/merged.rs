//! The merged status of a fast sync read or fast bulk read.
//!
//! ```text
//! FF FF FD 00 FE | length | 55 | error 1, id 1, params 1, crc 1 | error 2, id 2, .. crc 2 | ..
//! ```
//!
//! The first device sends the header and its answer, each next one appends its own. Every CRC is
//! over all bytes from the first `FF` on, earlier CRCs included. Nothing is stuffed, so a header
//! may occur in the parameters. Source: e-Manual, "DYNAMIXEL Protocol 2.0", Fast Sync Read and
//! Fast Bulk Read; the last CRC alone would do for the whole (and is all DynamixelSDK could
//! check), but checking each keeps the answers before a damaged one.
//!
//! What the devices behind a missing one do is not documented. Should they answer in its place,
//! they are recognised by their id.
//!
//! Not done: making use of an answer behind a damaged one, although its CRC could be checked
//! under a guess of what was damaged.

use super::{BODY, Id, MAX_PACKET, PREFIX, STATUS, Status, StatusError, merged_status_len};
use crate::wire::BROADCAST;
use crate::wire::checksum::Crc16;

/// Why a device's answer is not to be had from a merged status.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoAnswer {
    /// Its bytes are not there (yet), or a later device answered in its place.
    #[error("no answer")]
    Missing,
    /// A device nobody asked answered in its place.
    #[error("id {actual} answered in place of {expected}")]
    WrongId {
        /// Who was asked.
        expected: Id,
        /// The id byte received.
        actual: u8,
    },
    /// The CRC after its answer does not fit.
    #[error("checksum {actual:#06x}, computed {expected:#06x}")]
    Checksum {
        /// Computed over the received bytes.
        expected: u16,
        /// Received.
        actual: u16,
    },
    /// An earlier answer is damaged, which leaves this one unproven.
    #[error("behind a damaged answer")]
    Behind,
}

/// The merged status in some received bytes, as far as it is there.
#[derive(Clone, Copy, Debug)]
pub struct Merged<'a> {
    /// From the header on; empty if there is none.
    bytes: &'a [u8],
    asked: &'a [(Id, usize)],
    need: usize,
}

/// Finds the merged status that answers a fast read, in any bytes received since the question:
/// garbage and the echo of the question are passed over, and of several the last is taken, unless
/// it is damaged from the start. `asked` are the devices in the order of
/// the question with the number of bytes each was asked for.
///
/// ```
/// use gaitway::wire::dynamixel2::{Id, decode_merged};
///
/// // The manual's example: Present Position(132) of devices 3, 7 and 4 is 166, 2079 and 1023.
/// let received = [
///     0xFF, 0xFF, 0xFD, 0x00, 0xFE, 0x19, 0x00, 0x55, //
///     0x00, 0x03, 0xA6, 0x00, 0x00, 0x00, 0x84, 0x08, //
///     0x00, 0x07, 0x1F, 0x08, 0x00, 0x00, 0x16, 0xCA, //
///     0x00, 0x04, 0xFF, 0x03, 0x00, 0x00, 0xD1, 0x9E,
/// ];
/// let asked: Vec<_> = [3, 7, 4].into_iter().filter_map(|id| Some((Id::new(id)?, 4))).collect();
/// let merged = decode_merged(&received, &asked);
/// assert_eq!(merged.need(), 0);
/// let positions: Vec<_> = merged.answers().map(|(_, answer)| answer.unwrap().params).collect();
/// assert_eq!(positions, [[0xA6, 0, 0, 0], [0x1F, 0x08, 0, 0], [0xFF, 0x03, 0, 0]]);
/// ```
#[must_use]
pub fn decode_merged<'a>(bytes: &'a [u8], asked: &'a [(Id, usize)]) -> Merged<'a> {
    let params = asked.iter().fold(0_usize, |sum, &(_, length)| sum.saturating_add(length));
    let total = merged_status_len(asked.len(), params.min(MAX_PACKET));
    if asked.is_empty() || total > MAX_PACKET {
        return Merged { bytes: &[], asked, need: 0 }; // cannot have been asked
    }
    let [low, high] = ((total - PREFIX) as u16).to_le_bytes();
    let header = [0xFF, 0xFF, 0xFD, 0x00, BROADCAST, low, high, STATUS];

    // The last header that an intact answer follows, or else the last one.
    let (mut found, mut intact) = (None, false);
    for at in headers(bytes, header) {
        let rest = &bytes[at..];
        let merged = Merged { bytes: rest, asked, need: total.saturating_sub(rest.len()) };
        let answered = matches!(merged.answers().next(), Some((_, Ok(_))));
        if answered || !intact {
            found = Some(merged);
            intact = answered;
        }
    }
    found.unwrap_or_else(|| {
        let begun = (1..header.len()).rev().find(|&n| bytes.ends_with(&header[..n])).unwrap_or(0);
        Merged { bytes: &[], asked, need: total - begun }
    })
}

fn headers(bytes: &[u8], header: [u8; BODY]) -> impl Iterator<Item = usize> {
    let places = bytes.windows(BODY).enumerate();
    places.filter_map(move |(at, window)| (window == header).then_some(at))
}

impl<'a> Merged<'a> {
    /// Bytes still to come if every device answers; 0 if all are there.
    #[must_use]
    pub fn need(&self) -> usize {
        self.need
    }

    /// The answer of each device, in the order asked. Meaningful also while bytes are missing: the
    /// answers before the gap are whole, and those behind it [`NoAnswer::Missing`].
    #[must_use]
    pub fn answers(&self) -> Answers<'a> {
        let mut crc = Crc16::new();
        let header = &self.bytes[..self.bytes.len().min(BODY)];
        crc.update(header);
        Answers { rest: &self.bytes[header.len()..], asked: self.asked, crc, ended: None }
    }
}

/// The answers in a merged status: see [`Merged::answers`].
#[derive(Clone, Debug)]
pub struct Answers<'a> {
    rest: &'a [u8],
    asked: &'a [(Id, usize)],
    /// Over everything before `rest`.
    crc: Crc16,
    /// What to say of all further devices.
    ended: Option<NoAnswer>,
}

impl<'a> Answers<'a> {
    fn answer(&mut self, id: Id, length: usize) -> Result<Status<'a>, NoAnswer> {
        if let Some(reason) = self.ended {
            return Err(reason);
        }
        match self.rest.get(1) {
            Some(&there) if there == id.get() => {}
            Some(&there) if self.asked.iter().any(|(later, _)| later.get() == there) => {
                return Err(NoAnswer::Missing);
            }
            Some(&actual) => {
                self.ended = Some(NoAnswer::Behind);
                return Err(NoAnswer::WrongId { expected: id, actual });
            }
            None => return Err(NoAnswer::Missing),
        }
        let end = 2 + length;
        let Some(&[low, high]) = self.rest.get(end..end + 2) else {
            self.ended = Some(NoAnswer::Missing);
            return Err(NoAnswer::Missing);
        };
        self.crc.update(&self.rest[..end]);
        let (expected, actual) = (self.crc.value(), u16::from_le_bytes([low, high]));
        if expected != actual {
            self.ended = Some(NoAnswer::Behind);
            return Err(NoAnswer::Checksum { expected, actual });
        }
        self.crc.update(&[low, high]);
        let (answer, rest) = self.rest.split_at(end + 2);
        self.rest = rest;
        let error = StatusError::from_byte(answer[0]);
        Ok(Status { id, error, params: &answer[2..end] })
    }
}

impl<'a> Iterator for Answers<'a> {
    type Item = (Id, Result<Status<'a>, NoAnswer>);

    fn next(&mut self) -> Option<Self::Item> {
        let (&(id, length), asked) = self.asked.split_first()?;
        self.asked = asked;
        Some((id, self.answer(id, length)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::checksum::crc16;

    const EXAMPLE: [u8; 32] = [
        0xFF, 0xFF, 0xFD, 0x00, 0xFE, 0x19, 0x00, 0x55, //
        0x00, 0x03, 0xA6, 0x00, 0x00, 0x00, 0x84, 0x08, //
        0x00, 0x07, 0x1F, 0x08, 0x00, 0x00, 0x16, 0xCA, //
        0x00, 0x04, 0xFF, 0x03, 0x00, 0x00, 0xD1, 0x9E,
    ];
    const VALUES: [u32; 3] = [166, 2079, 1023];

    fn asked() -> [(Id, usize); 3] {
        [3, 7, 4].map(|id| (Id::new(id).unwrap(), 4))
    }

    fn answers(bytes: &[u8]) -> Vec<Result<u32, NoAnswer>> {
        let asked = asked();
        let answers = decode_merged(bytes, &asked).answers();
        let values = answers.map(|(_, answer)| {
            answer.map(|status| u32::from_le_bytes(status.params.try_into().unwrap()))
        });
        values.collect()
    }

    /// Puts right all CRCs, for devices that answer in blocks of eight bytes.
    fn sealed(mut bytes: Vec<u8>) -> Vec<u8> {
        for at in (14..bytes.len()).step_by(8) {
            let crc = crc16(&bytes[..at]).to_le_bytes();
            bytes[at..at + 2].copy_from_slice(&crc);
        }
        bytes
    }

    #[test]
    fn answers_before_the_missing_tail_are_usable() {
        for length in 0..=EXAMPLE.len() {
            let whole = length.saturating_sub(BODY) / 8;
            let expected: Vec<_> = (0..3)
                .map(|k| if k < whole { Ok(VALUES[k]) } else { Err(NoAnswer::Missing) })
                .collect();
            let bytes = &EXAMPLE[..length];
            assert_eq!(answers(bytes), expected, "{length} bytes");
            assert_eq!(decode_merged(bytes, &asked()).need(), EXAMPLE.len() - length);
        }
    }

    #[test]
    fn answers_before_a_damaged_one_are_usable_and_those_behind_are_not() {
        let mut bytes = EXAMPLE;
        bytes[18] ^= 0x10;
        let expected = crc16(&bytes[..22]);
        let damaged = NoAnswer::Checksum { expected, actual: 0xCA16 };
        assert_eq!(answers(&bytes), [Ok(166), Err(damaged), Err(NoAnswer::Behind)]);
    }

    #[test]
    fn each_device_has_an_error_byte_of_its_own() {
        let mut bytes = EXAMPLE.to_vec();
        bytes[16] = 0x80;
        let bytes = sealed(bytes);
        let asked = asked();
        let answers = decode_merged(&bytes, &asked).answers();
        let alerts: Vec<_> = answers.map(|(_, answer)| answer.unwrap().error.alert).collect();
        assert_eq!(alerts, [false, true, false]);
    }

    #[test]
    fn a_device_that_answers_in_a_missing_ones_place_is_recognised_by_its_id() {
        let bytes = sealed([&EXAMPLE[..16], &EXAMPLE[24..]].concat());
        assert_eq!(answers(&bytes), [Ok(166), Err(NoAnswer::Missing), Ok(1023)]);
    }

    #[test]
    fn a_device_nobody_asked_is_no_answer() {
        let mut bytes = EXAMPLE.to_vec();
        bytes[17] = 9;
        let wrong = NoAnswer::WrongId { expected: Id::new(7).unwrap(), actual: 9 };
        assert_eq!(answers(&sealed(bytes)), [Ok(166), Err(wrong), Err(NoAnswer::Behind)]);
    }

    #[test]
    fn garbage_an_echo_and_a_damaged_twin_are_passed_over() {
        let echo = [
            0xFF, 0xFF, 0xFD, 0x00, 0xFE, 0x0A, 0x00, 0x8A, 0x84, 0x00, 0x04, 0x00, 0x03, 0x07,
            0x04, 0x20, 0xF2,
        ];
        let bytes = [&[0x00, 0xFF][..], &echo, &EXAMPLE[..19], &EXAMPLE].concat();
        assert_eq!(answers(&bytes), VALUES.map(Ok));
        let damaged_first = [&EXAMPLE[..11], &EXAMPLE].concat();
        assert_eq!(answers(&damaged_first), VALUES.map(Ok));
    }

    #[test]
    fn parameters_may_contain_a_header() {
        let mut bytes = EXAMPLE.to_vec();
        bytes[18..22].copy_from_slice(&HEADER_AS_POSITION.to_le_bytes());
        assert_eq!(answers(&sealed(bytes)), [Ok(166), Ok(HEADER_AS_POSITION), Ok(1023)]);
    }

    const HEADER_AS_POSITION: u32 = 0x00FD_FFFF;

    #[test]
    fn a_question_that_has_no_answer_is_never_awaited() {
        assert_eq!(decode_merged(&EXAMPLE, &[]).need(), 0);
        let huge = [(Id::new(1).unwrap(), usize::MAX), (Id::new(2).unwrap(), 2)];
        let merged = decode_merged(&EXAMPLE, &huge);
        assert_eq!(merged.need(), 0);
        assert!(merged.answers().all(|(_, answer)| answer == Err(NoAnswer::Missing)));
    }
}
