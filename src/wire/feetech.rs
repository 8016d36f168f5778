//! FEETECH STS, SMS and SCS servos, the host's side.
//!
//! ```text
//! FF FF | id | length | instruction | parameters | sum
//! FF FF | id | length | error       | parameters | sum
//! ```
//!
//! The packet is that of DYNAMIXEL Protocol 1.0. SCS servos differ in two things: they know no
//! sync read and answer no ping of all, and words in their registers are big-endian (little-endian
//! on STS and SMS). Both are for the caller: no word occurs outside the registers.
//!
//! Source: vendor's SDK, `INST.h` and `SCS.cpp` (in adityakamath/SCServo_Linux da2ed3ac); ROBOTIS
//! e-Manual, "DYNAMIXEL Protocol 1.0" for the packet; huggingface/lerobot 7427f318,
//! `motors/feetech`, for sync read and number formats.
//!
//! Two weaknesses are the protocol's and cannot be mended here:
//! - Nothing tells an instruction from a status but the id of all devices. On an adapter that
//!   echoes, the echo of an instruction to one device looks like a status of that device (a ping
//!   `FF FF 01 02 01 FB` is also "voltage error of device 1"): the reader must take away the bytes
//!   it sent before decoding.
//! - The sum is one byte, so one damaged packet in 256 passes, and headers may occur in parameters.
//!   One flipped bit is always noticed, but in the length: that may leave a shorter packet whose
//!   sum fits. So [`decode`] is told the longest answer there can be, the reader must refuse an
//!   answer of another length than it asked for, and implausible values are still to be expected.
//!
//! Not done: deadlines, matching, registers (as in [`dynamixel2`](super::dynamixel2)).
//!
//! A read of present position (56) of device 1, and its answer, 1304:
//!
//! ```
//! use gaitway::wire::{Decoded, feetech};
//!
//! let id = feetech::Id::new(1).ok_or("1 is an id")?;
//! let mut out = Vec::new();
//! feetech::read(&mut out, id, 56, 2)?;
//! assert_eq!(out, [0xFF, 0xFF, 0x01, 0x04, 0x02, 0x38, 0x02, 0xBE]);
//!
//! let answer = [0xFF, 0xFF, 0x01, 0x04, 0x00, 0x18, 0x05, 0xDD];
//! let Decoded::Packet(status, 8) = feetech::decode(&answer, 2) else {
//!     return Err("a whole status".into());
//! };
//! assert!(status.error.is_ok());
//! assert_eq!(status.params, 1304_u16.to_le_bytes());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use super::packet1;
use super::{BROADCAST, Decoded, EncodeError};

pub use super::packet1::{
    Id, MAX_PACKET, Target, abandon, action, factory_reset, instruction_len, ping, read, reg_write,
    status_len, sync_write, sync_write_len, write,
};

const SYNC_READ: u8 = 0x82;

/// One device's answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Status<'a> {
    /// Who answers.
    pub id: Id,
    /// What is wrong with the device.
    pub error: StatusError,
    /// What was read; empty for an answer to anything but a read.
    pub params: &'a [u8],
}

/// The error byte of a status, one bit per condition: the same bits as in the status register
/// (65). It tells about the device, not about the instruction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StatusError(pub u8);

impl StatusError {
    /// Supply voltage out of limits.
    pub const VOLTAGE: u8 = 1;
    /// Magnetic encoder.
    pub const SENSOR: u8 = 1 << 1;
    /// Too hot.
    pub const TEMPERATURE: u8 = 1 << 2;
    /// Too much current.
    pub const CURRENT: u8 = 1 << 3;
    /// Angle out of limits (older models only).
    pub const ANGLE: u8 = 1 << 4;
    /// Too much load for too long.
    pub const OVERLOAD: u8 = 1 << 5;

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
}

/// Bytes of a sync read of `devices`.
#[must_use]
pub const fn sync_read_len(devices: usize) -> usize {
    instruction_len(2 + devices)
}

/// Asks several devices for the same `length` bytes from `address` on. Each answers with a status
/// of its own, in the order listed. Not on SCS.
///
/// # Errors
/// An empty list, an id twice, a packet or an answer too long.
pub fn sync_read(
    out: &mut Vec<u8>,
    address: u8,
    length: u8,
    ids: impl IntoIterator<Item = Id>,
) -> Result<(), EncodeError> {
    packet1::answer_fits(length)?;
    packet1::packet(out, BROADCAST, SYNC_READ, |params| {
        params.push(&[address, length])?;
        for id in ids {
            params.named.add(id)?;
            params.push(&[id.get()])?;
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

/// Which bit of a register says the number is negative. The bits below it are the magnitude.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SignBit {
    /// Load, and the duty in mode 2.
    Bit10 = 10,
    /// Position offset.
    Bit11 = 11,
    /// Positions, speeds, current.
    Bit15 = 15,
}

impl SignBit {
    const fn mask(self) -> u16 {
        1 << self as u16
    }
}

/// A number too large for its register.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{value} does not fit, allowed are -{most} to {most}")]
pub struct OutOfRange {
    /// The number.
    pub value: i32,
    /// Largest magnitude the register holds.
    pub most: u16,
}

/// Sign and magnitude as these servos store numbers; never two's complement.
///
/// ```
/// use gaitway::wire::feetech::{SignBit, sign_magnitude_decode, sign_magnitude_encode};
///
/// assert_eq!(sign_magnitude_encode(-1000, SignBit::Bit15)?, 0x83E8);
/// assert_eq!(sign_magnitude_encode(-100, SignBit::Bit11)?, 0x0864);
/// assert_eq!(sign_magnitude_decode(0x8064, SignBit::Bit15), -100);
/// # Ok::<(), gaitway::wire::feetech::OutOfRange>(())
/// ```
///
/// # Errors
/// [`OutOfRange`] if the magnitude does not fit below the sign bit.
pub fn sign_magnitude_encode(value: i32, sign_bit: SignBit) -> Result<u16, OutOfRange> {
    let sign = sign_bit.mask();
    let most = sign - 1;
    match u16::try_from(value.unsigned_abs()) {
        Ok(magnitude) if magnitude <= most => {
            Ok(if value < 0 { sign | magnitude } else { magnitude })
        }
        _ => Err(OutOfRange { value, most }),
    }
}

/// The number in a register. Bits above the sign bit are not part of it; both zeros are 0.
#[must_use]
pub const fn sign_magnitude_decode(raw: u16, sign_bit: SignBit) -> i32 {
    let sign = sign_bit.mask();
    let magnitude = (raw & (sign - 1)) as i32;
    if raw & sign != 0 { -magnitude } else { magnitude }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sync_read_that_cannot_be_built_leaves_the_buffer_as_it_was() {
        let id = |number| Id::new(number).unwrap();
        let mut out = vec![7, 7];
        let failures = [
            sync_read(&mut out, 56, 4, [id(1), id(1)]),
            sync_read(&mut out, 56, 4, []),
            sync_read(&mut out, 0, 245, [id(1)]),
        ];
        let expected = [
            EncodeError::RepeatedId(1),
            EncodeError::Empty,
            EncodeError::AnswerTooLong { bytes: 251, allowed: 250 },
        ];
        assert_eq!(failures, expected.map(Err));
        assert_eq!(out, [7, 7]);
    }

    #[test]
    fn error_bits_are_conditions_of_the_device() {
        let error = StatusError(0x25);
        assert!(error.any(StatusError::VOLTAGE) && error.any(StatusError::OVERLOAD));
        assert!(error.any(StatusError::TEMPERATURE) && !error.any(StatusError::CURRENT));
        assert!(!error.is_ok() && StatusError(0).is_ok());
    }

    #[test]
    #[cfg_attr(miri, ignore = "too many tries for an interpreter")]
    fn sign_magnitude_survives_the_round_trip_and_refuses_what_does_not_fit() {
        for sign_bit in [SignBit::Bit10, SignBit::Bit11, SignBit::Bit15] {
            let most = (1 << sign_bit as i32) - 1;
            for value in -most..=most {
                let raw = sign_magnitude_encode(value, sign_bit).unwrap();
                assert_eq!(sign_magnitude_decode(raw, sign_bit), value);
            }
            for value in [most + 1, -most - 1, i32::MIN, i32::MAX] {
                assert!(sign_magnitude_encode(value, sign_bit).is_err());
            }
            let negative_zero = 1 << sign_bit as u16;
            assert_eq!(sign_magnitude_decode(negative_zero, sign_bit), 0);
        }
    }
}
