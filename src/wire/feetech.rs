//! Feetech STS and SMS servos (SCS too, as far as bytes go), the host's side.
//!
//! ```text
//! FF FF | id | length | instruction | parameters | sum
//! FF FF | id | length | error       | parameters | sum
//! ```
//!
//! The framing is that of DYNAMIXEL Protocol 1.0: the length counts what follows it, the sum is
//! [`sum8`] from id to last parameter. Words in registers are little-endian on STS and SMS,
//! big-endian on SCS; that is for the caller, since no word occurs outside the registers.
//!
//! Source: vendor's SDK, `INST.h` and `SCS.cpp` (in adityakamath/SCServo_Linux da2ed3ac); ROBOTIS
//! e-Manual, "DYNAMIXEL Protocol 1.0" for framing; huggingface/lerobot 7427f318,
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

use super::checksum::sum8;
use super::{BROADCAST, Decoded, EncodeError, Named, Reason};

/// A device: 0 to 253.
pub type Id = super::Id<253>;

/// One device or all.
pub type Target = super::Target<253>;

/// Longest packet sent or accepted, in bytes: the buffer of the vendor's SDK.
pub const MAX_PACKET: usize = 255;

const HEADER: [u8; 2] = [0xFF, 0xFF];

/// Bytes before those the length field counts.
const PREFIX: usize = 4;

const PING: u8 = 0x01;
const READ: u8 = 0x02;
const WRITE: u8 = 0x03;
const REG_WRITE: u8 = 0x04;
const ACTION: u8 = 0x05;
const RESET: u8 = 0x06;
const SYNC_READ: u8 = 0x82;
const SYNC_WRITE: u8 = 0x83;

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

/// Bytes of an instruction with `params` parameter bytes.
#[must_use]
pub const fn instruction_len(params: usize) -> usize {
    PREFIX + 2 + params
}

/// Bytes of a status with `params` parameter bytes.
#[must_use]
pub const fn status_len(params: usize) -> usize {
    PREFIX + 2 + params
}

/// Bytes of a sync read of `devices`.
#[must_use]
pub const fn sync_read_len(devices: usize) -> usize {
    instruction_len(2 + devices)
}

/// Bytes of a sync write of `length` bytes to each of `devices`.
#[must_use]
pub const fn sync_write_len(devices: usize, length: usize) -> usize {
    instruction_len(2 + devices * (1 + length))
}

/// Asks who is there. Answered by one device, and on STS and SMS also by all in turn.
pub fn ping(out: &mut Vec<u8>, target: impl Into<Target>) {
    fixed(out, target.into().number(), PING, &[]);
}

/// Asks one device for `length` bytes from `address` on.
///
/// # Errors
/// [`EncodeError::AnswerTooLong`].
pub fn read(out: &mut Vec<u8>, id: Id, address: u8, length: u8) -> Result<(), EncodeError> {
    answer_fits(length)?;
    fixed(out, id.get(), READ, &[address, length]);
    Ok(())
}

/// Writes `bytes` from `address` on, at once.
///
/// # Errors
/// [`EncodeError::TooLong`].
pub fn write(
    out: &mut Vec<u8>,
    target: impl Into<Target>,
    address: u8,
    bytes: &[u8],
) -> Result<(), EncodeError> {
    write_as(WRITE, out, target.into(), address, bytes)
}

/// Registers a write of `bytes` from `address` on, carried out at the next [`action`].
///
/// # Errors
/// [`EncodeError::TooLong`].
pub fn reg_write(
    out: &mut Vec<u8>,
    target: impl Into<Target>,
    address: u8,
    bytes: &[u8],
) -> Result<(), EncodeError> {
    write_as(REG_WRITE, out, target.into(), address, bytes)
}

fn write_as(
    instruction: u8,
    out: &mut Vec<u8>,
    target: Target,
    address: u8,
    bytes: &[u8],
) -> Result<(), EncodeError> {
    packet(out, target.number(), instruction, |params| {
        params.push(&[address])?;
        params.push(bytes)
    })
}

/// Carries out what [`reg_write`] registered.
pub fn action(out: &mut Vec<u8>, target: impl Into<Target>) {
    fixed(out, target.into().number(), ACTION, &[]);
}

/// Puts one device back to factory values.
pub fn reset(out: &mut Vec<u8>, id: Id) {
    fixed(out, id.get(), RESET, &[]);
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
    answer_fits(length)?;
    packet(out, BROADCAST, SYNC_READ, |params| {
        params.push(&[address, length])?;
        for id in ids {
            params.device(id)?;
        }
        params.named.not_empty()
    })
}

/// Writes `length` bytes to each of several devices, from the same `address` on. Nobody answers.
///
/// # Errors
/// An empty list, an id twice, a number of bytes other than `length`, or a packet too long.
pub fn sync_write<B: AsRef<[u8]>>(
    out: &mut Vec<u8>,
    address: u8,
    length: u8,
    writes: impl IntoIterator<Item = (Id, B)>,
) -> Result<(), EncodeError> {
    let expected = usize::from(length);
    packet(out, BROADCAST, SYNC_WRITE, |params| {
        params.push(&[address, length])?;
        for (id, bytes) in writes {
            let bytes = bytes.as_ref();
            if bytes.len() != expected {
                let (id, actual) = (id.get(), bytes.len());
                return Err(EncodeError::WrongLength { id, expected, actual });
            }
            params.device(id)?;
            params.push(bytes)?;
        }
        params.named.not_empty()
    })
}

/// Parameters under construction.
struct Params<'a> {
    out: &'a mut Vec<u8>,
    start: usize,
    named: Named,
}

impl Params<'_> {
    /// Appends, unless the packet would be too long with it.
    fn push(&mut self, bytes: &[u8]) -> Result<(), EncodeError> {
        let (bytes_then, allowed) = (self.out.len() - self.start + bytes.len() + 1, MAX_PACKET);
        if bytes_then > allowed {
            return Err(EncodeError::TooLong { bytes: bytes_then, allowed });
        }
        self.out.extend_from_slice(bytes);
        Ok(())
    }

    fn device(&mut self, id: Id) -> Result<(), EncodeError> {
        self.named.add(id)?;
        self.push(&[id.get()])
    }
}

fn answer_fits(length: u8) -> Result<(), EncodeError> {
    let (bytes, allowed) = (status_len(usize::from(length)), MAX_PACKET);
    if bytes <= allowed { Ok(()) } else { Err(EncodeError::AnswerTooLong { bytes, allowed }) }
}

/// A packet of a few parameters that are known to fit.
fn fixed(out: &mut Vec<u8>, id: u8, instruction: u8, params: &[u8]) {
    let start = open(out, id, instruction);
    out.extend_from_slice(params);
    close(out, start);
}

/// A packet whose parameters `fill` appends.
fn packet(
    out: &mut Vec<u8>,
    id: u8,
    instruction: u8,
    fill: impl FnOnce(&mut Params<'_>) -> Result<(), EncodeError>,
) -> Result<(), EncodeError> {
    let start = open(out, id, instruction);
    fill(&mut Params { out, start, named: Named::default() })
        .inspect_err(|_| out.truncate(start))?;
    close(out, start);
    Ok(())
}

fn open(out: &mut Vec<u8>, id: u8, instruction: u8) -> usize {
    let start = out.len();
    out.extend_from_slice(&[HEADER[0], HEADER[1], id, 0, instruction]);
    start
}

fn close(out: &mut Vec<u8>, start: usize) {
    // Instruction to sum; the packet is no longer than MAX_PACKET, so the cast loses nothing.
    out[start + 3] = (out.len() - start - PREFIX + 1) as u8;
    let sum = sum8(&out[start + HEADER.len()..]);
    out.push(sum);
}

/// Tells what lies at the front of `bytes`, received after a question whose answers have at most
/// `longest` parameter bytes each. A status that claims more is bad, and not awaited.
///
/// How it finds its feet again: a bad packet is dropped up to the next `FF FF`, which may lie
/// inside the bytes it laid claim to. Which of two overlapping packets is the real one cannot be
/// known before the first is complete or the line falls silent; see [`abandon`].
#[must_use]
pub fn decode(bytes: &[u8], longest: usize) -> Decoded<Status<'_>> {
    match find_header(bytes) {
        0 => {}
        garbage => return Decoded::Skip(garbage),
    }
    let &[_, _, number, claimed, ..] = bytes else {
        return Decoded::Need(status_len(0) - bytes.len());
    };
    let id = Id::new(number); // 0xFF does not follow a header, so the rest is to all devices
    let claimed = usize::from(claimed);
    let most = MAX_PACKET - PREFIX;
    let most = if id.is_some() { most.min(longest.saturating_add(2)) } else { most };
    if !(2..=most).contains(&claimed) {
        let reason = Reason::Length { claimed, least: 2, most };
        return Decoded::Bad(reason, abandon(bytes));
    }
    let total = PREFIX + claimed;
    let Some(packet) = bytes.get(..total) else {
        return Decoded::Need(total - bytes.len());
    };
    let (expected, actual) = (sum8(&packet[2..total - 1]), packet[total - 1]);
    if expected != actual {
        let (expected, actual) = (u16::from(expected), u16::from(actual));
        return Decoded::Bad(Reason::Checksum { expected, actual }, abandon(bytes));
    }
    match id {
        None => Decoded::Echo(total),
        Some(id) => {
            let error = StatusError(packet[PREFIX]);
            Decoded::Packet(Status { id, error, params: &packet[5..total - 1] }, total)
        }
    }
}

/// Bytes to take from the front when [`decode`] asks for more and none will come: up to the next
/// place where a packet may begin. Then decode again; a whole packet may lie behind a cut one.
#[must_use]
pub fn abandon(bytes: &[u8]) -> usize {
    match bytes {
        [] => 0,
        [_, rest @ ..] => 1 + find_header(rest),
    }
}

/// First place where a packet may begin: two `FF` with anything else behind, or what may become
/// that. The length of `bytes` if there is none.
fn find_header(bytes: &[u8]) -> usize {
    let begins = |rest: &[u8]| match rest {
        [0xFF] | [0xFF, 0xFF] => true,
        [0xFF, 0xFF, id, ..] => *id != 0xFF,
        _ => false,
    };
    (0..bytes.len()).find(|&at| begins(&bytes[at..])).unwrap_or(bytes.len())
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

    const POSITION: [u8; 8] = [0xFF, 0xFF, 0x01, 0x04, 0x00, 0x18, 0x05, 0xDD];

    fn id(number: u8) -> Id {
        Id::new(number).unwrap()
    }

    #[test]
    fn a_truncated_packet_asks_for_more_bytes() {
        for (length, need) in [(0, 6), (1, 5), (3, 3), (4, 4), (7, 1)] {
            assert_eq!(decode(&POSITION[..length], 2), Decoded::Need(need), "{length} bytes");
        }
    }

    #[test]
    fn garbage_is_skipped_up_to_what_may_be_a_header() {
        assert_eq!(decode(&[0x00, 0x12], 2), Decoded::Skip(2));
        assert_eq!(decode(&[0x00, 0xFF], 2), Decoded::Skip(1));
        assert_eq!(decode(&[0xFF, 0xFF, 0xFF, 0x01], 2), Decoded::Skip(1));
        assert_eq!(decode(&[0xFF, 0xFF, 0xFF, 0xFF], 2), Decoded::Skip(2));
    }

    #[test]
    fn a_length_no_answer_can_have_is_refused_and_not_awaited() {
        for claimed in [0_u8, 1, 5, 0xFE] {
            let claims = usize::from(claimed);
            let reason = Reason::Length { claimed: claims, least: 2, most: 4 };
            assert_eq!(decode(&[0xFF, 0xFF, 0x01, claimed], 2), Decoded::Bad(reason, 4));
        }
    }

    #[test]
    fn a_wrong_sum_drops_up_to_the_next_header_inside_the_packet() {
        let bytes = [&POSITION[..5], &POSITION].concat();
        let reason = Reason::Checksum { expected: 0xFC, actual: 0x01 };
        assert_eq!(decode(&bytes, 2), Decoded::Bad(reason, 5));
        let status = Status { id: id(1), error: StatusError(0), params: &[0x18, 0x05] };
        assert_eq!(decode(&bytes[5..], 2), Decoded::Packet(status, 8));
    }

    #[test]
    fn a_whole_packet_behind_a_cut_one_is_found_once_the_line_is_silent() {
        let ping_answer = [0xFF, 0xFF, 0x02, 0x02, 0x00, 0xFB];
        let cut = [0xFF, 0xFF, 0x01, 0x11, 0x00];
        let bytes = [&cut[..], &ping_answer].concat();
        assert_eq!(decode(&bytes, 15), Decoded::Need(10));
        let rest = &bytes[abandon(&bytes)..];
        let status = Status { id: id(2), error: StatusError(0), params: &[] };
        assert_eq!(decode(rest, 15), Decoded::Packet(status, 6));
    }

    #[test]
    fn an_instruction_to_all_is_an_echo() {
        let mut out = Vec::new();
        sync_read(&mut out, 56, 4, [id(1), id(2)]).unwrap();
        assert_eq!(decode(&out, 4), Decoded::Echo(10));
    }

    #[test]
    fn a_packet_that_cannot_be_built_leaves_the_buffer_as_it_was() {
        let mut out = vec![7, 7];
        let failures = [
            sync_write(&mut out, 42, 2, [(id(1), &[0_u8; 2][..]), (id(2), &[0_u8; 3][..])]),
            sync_read(&mut out, 56, 4, [id(1), id(1)]),
            sync_read(&mut out, 56, 4, []),
            read(&mut out, id(1), 0, 250),
            write(&mut out, Target::All, 0, &[0; 249]),
        ];
        let expected = [
            EncodeError::WrongLength { id: 2, expected: 2, actual: 3 },
            EncodeError::RepeatedId(1),
            EncodeError::Empty,
            EncodeError::AnswerTooLong { bytes: 256, allowed: 255 },
            EncodeError::TooLong { bytes: 256, allowed: 255 },
        ];
        assert_eq!(failures, expected.map(Err));
        assert_eq!(out, [7, 7]);
        write(&mut out, Target::All, 0, &[0; 248]).unwrap();
        assert_eq!(out.len(), 2 + MAX_PACKET);
    }

    #[test]
    fn error_bits_are_conditions_of_the_device() {
        let error = StatusError(0x25);
        assert!(error.any(StatusError::VOLTAGE) && error.any(StatusError::OVERLOAD));
        assert!(error.any(StatusError::TEMPERATURE) && !error.any(StatusError::CURRENT));
        assert!(!error.is_ok() && StatusError(0).is_ok());
    }

    #[test]
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
