//! DYNAMIXEL Protocol 1.0 (AX, RX, EX, MX), the host's side.
//!
//! ```text
//! FF FF | id | length | instruction | parameters | sum
//! FF FF | id | length | error       | parameters | sum
//! ```
//!
//! Words in registers are little-endian. There is no sync read and no reboot; only MX servos know
//! the bulk read. The weaknesses named in [`feetech`](super::feetech) are this packet's, and hold
//! here too.
//!
//! Source: ROBOTIS e-Manual, "DYNAMIXEL Protocol 1.0"
//! (<https://emanual.robotis.com/docs/en/dxl/protocol1/>; text in ROBOTIS-GIT/emanual 097301c2,
//! `docs/en/dxl/protocol1.md`); DynamixelSDK 2ded684d, `protocol1_packet_handler.cpp`.
//!
//! Not done: deadlines, matching, registers (as in [`dynamixel2`](super::dynamixel2)).
//!
//! The manual's example of a bulk read, Goal Position(30) of device 1 and Present Position(36) of
//! device 2, and the first answer:
//!
//! ```
//! use gaitway::wire::dynamixel1::{BulkRead, Id, bulk_read, decode};
//! use gaitway::wire::Decoded;
//!
//! let [one, two] = [Id::new(1), Id::new(2)].map(|id| id.ok_or("an id"));
//! let (one, two) = (one?, two?);
//! let mut out = Vec::new();
//! let goal = BulkRead { id: one, address: 30, length: 2 };
//! bulk_read(&mut out, [goal, BulkRead { id: two, address: 36, length: 2 }])?;
//! assert_eq!(
//!     out,
//!     [0xFF, 0xFF, 0xFE, 0x09, 0x92, 0x00, 0x02, 0x01, 0x1E, 0x02, 0x02, 0x24, 0x1D],
//! );
//!
//! let answer = [0xFF, 0xFF, 0x01, 0x04, 0x00, 0x00, 0x80, 0x7A];
//! let Decoded::Packet(status, 8) = decode(&answer, 2) else {
//!     return Err("a whole status".into());
//! };
//! assert!(status.id == one && status.error.is_ok());
//! assert_eq!(status.params, [0x00, 0x80]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use super::packet1;
use super::{BROADCAST, Decoded, EncodeError};

pub use super::packet1::{
    Id, MAX_PACKET, Target, abandon, action, factory_reset, instruction_len, ping, read, reg_write,
    status_len, sync_write, sync_write_len, write,
};

const BULK_READ: u8 = 0x92;

/// One device's answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Status<'a> {
    /// Who answers.
    pub id: Id,
    /// What is wrong with the device or with what it was told.
    pub error: StatusError,
    /// What was read; empty for an answer to anything but a read.
    pub params: &'a [u8],
}

/// The error byte of a status, one bit per condition (unlike Protocol 2.0). The alarm registers,
/// Alarm LED(17) and Shutdown(18), use the same bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StatusError(pub u8);

impl StatusError {
    /// Supply voltage out of limits.
    pub const INPUT_VOLTAGE: u8 = 1;
    /// The goal is outside CW to CCW Angle Limit.
    pub const ANGLE_LIMIT: u8 = 1 << 1;
    /// Too hot.
    pub const OVERHEATING: u8 = 1 << 2;
    /// The instruction is outside the range of use.
    pub const RANGE: u8 = 1 << 3;
    /// The device received the instruction damaged.
    pub const CHECKSUM: u8 = 1 << 4;
    /// Too much load for the torque allowed.
    pub const OVERLOAD: u8 = 1 << 5;
    /// Unknown instruction, or an action with nothing registered.
    pub const INSTRUCTION: u8 = 1 << 6;

    /// No bit set.
    #[must_use]
    pub const fn is_ok(self) -> bool {
        self.0 == 0
    }

    /// Any of the conditions in `mask`.
    #[must_use]
    pub const fn any(self, mask: u8) -> bool {
        self.0 & mask != 0
    }

    /// Something is wrong with the device itself; it may have carried out the instruction.
    #[must_use]
    pub const fn alert(self) -> bool {
        self.any(Self::INPUT_VOLTAGE | Self::OVERHEATING | Self::OVERLOAD)
    }

    /// The device did not carry out the instruction.
    #[must_use]
    pub const fn refused(self) -> bool {
        self.any(Self::ANGLE_LIMIT | Self::RANGE | Self::CHECKSUM | Self::INSTRUCTION)
    }
}

/// The manual's names of the bits that are set.
impl std::fmt::Display for StatusError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        const NAMES: [&str; 8] = [
            "input voltage error",
            "angle limit error",
            "overheating error",
            "range error",
            "checksum error",
            "overload error",
            "instruction error",
            "bit 7 (unknown)",
        ];
        let set: Vec<&str> =
            (0..8).filter(|bit| self.0 >> bit & 1 == 1).map(|b| NAMES[b]).collect();
        f.write_str(if set.is_empty() { "no error".to_owned() } else { set.join(", ") }.as_str())
    }
}

/// What one device is asked for in a bulk read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BulkRead {
    /// Who.
    pub id: Id,
    /// First address.
    pub address: u8,
    /// Number of bytes.
    pub length: u8,
}

/// Bytes of a bulk read of `devices`.
#[must_use]
pub const fn bulk_read_len(devices: usize) -> usize {
    instruction_len(1 + 3 * devices)
}

/// Asks several devices, each for bytes of its own choice. Each answers with a status of its own
/// once it has heard the one before. MX servos only.
///
/// # Errors
/// An empty list, an id twice, an instruction or an answer too long.
pub fn bulk_read(
    out: &mut Vec<u8>,
    reads: impl IntoIterator<Item = BulkRead>,
) -> Result<(), EncodeError> {
    packet1::packet(out, BROADCAST, BULK_READ, |params| {
        params.push(&[0])?;
        for BulkRead { id, address, length } in reads {
            packet1::answer_fits(length)?;
            params.named.add(id)?;
            params.push(&[length, id.get(), address])?;
        }
        params.named.not_empty()
    })
}

/// Tells what lies at the front of `bytes`, received after a question whose answers have at most
/// `longest` parameter bytes each. A status that claims more is bad, and not awaited.
///
/// How it finds its feet again: a bad packet is dropped up to the next `FF FF`, which may lie
/// inside the bytes it laid claim to. Which of two overlapping packets is the real one cannot be
/// known before the first is complete or the line falls silent; see [`abandon`].
#[must_use]
pub fn decode(bytes: &[u8], longest: usize) -> Decoded<Status<'_>> {
    packet1::decode(bytes, longest).map(|status| Status {
        id: status.id,
        error: StatusError(status.error),
        params: status.params,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn id(number: u8) -> Id {
        Id::new(number).unwrap()
    }

    #[test]
    fn error_bits_tell_the_device_from_the_instruction() {
        let hot = StatusError(StatusError::OVERLOAD | StatusError::OVERHEATING);
        assert_eq!(hot, StatusError(0x24), "the manual's example");
        assert!(hot.alert() && !hot.refused() && !hot.is_ok());
        assert_eq!(hot.to_string(), "overheating error, overload error");
        let unknown = StatusError(0x40);
        assert!(unknown.refused() && !unknown.alert());
        assert_eq!(unknown.to_string(), "instruction error");
        assert!(StatusError(0).is_ok());
        assert_eq!(StatusError(0).to_string(), "no error");
    }

    #[test]
    fn a_bulk_read_that_cannot_be_built_leaves_the_buffer_as_it_was() {
        let ask = |number, length| BulkRead { id: id(number), address: 36, length };
        let mut out = vec![7, 7];
        let failures = [
            bulk_read(&mut out, []),
            bulk_read(&mut out, [ask(1, 2), ask(1, 2)]),
            bulk_read(&mut out, [ask(1, 245)]),
            bulk_read(&mut out, (0..100).map(|number| ask(number, 2))),
        ];
        let expected = [
            EncodeError::Empty,
            EncodeError::RepeatedId(1),
            EncodeError::AnswerTooLong { bytes: 251, allowed: 250 },
            EncodeError::TooLong { bytes: 253, allowed: 250 },
        ];
        assert_eq!(failures, expected.map(Err));
        assert_eq!(out, [7, 7]);
    }
}
