//! The packet of DYNAMIXEL Protocol 1.0, which FEETECH's servos speak too, and the instructions
//! both makers number alike. What differs is in [`dynamixel1`](super::dynamixel1) and
//! [`feetech`](super::feetech), which show this to the outside.
//!
//! ```text
//! FF FF | id | length | instruction | parameters | sum
//! FF FF | id | length | error       | parameters | sum
//! ```
//!
//! The length counts what follows it, the sum is [`sum8`] from id to last parameter. Addresses and
//! lengths are one byte; nothing is stuffed, so a header may occur in the parameters.
//!
//! Source: ROBOTIS e-Manual, "DYNAMIXEL Protocol 1.0"; FEETECH's SDK, `INST.h` and `SCS.cpp` (in
//! adityakamath/SCServo_Linux da2ed3ac).

use super::checksum::sum8;
use super::{BROADCAST, Decoded, EncodeError, Named, Reason};

/// A device: 0 to 253.
pub type Id = super::Id<253>;

/// One device or all.
pub type Target = super::Target<253>;

/// Longest packet sent or accepted, in bytes: the buffer of DynamixelSDK for this protocol.
/// FEETECH's SDK has five bytes more.
pub const MAX_PACKET: usize = 250;

const HEADER: [u8; 2] = [0xFF, 0xFF];

/// Bytes before those the length field counts.
const PREFIX: usize = 4;

const PING: u8 = 0x01;
const READ: u8 = 0x02;
const WRITE: u8 = 0x03;
const REG_WRITE: u8 = 0x04;
const ACTION: u8 = 0x05;
const FACTORY_RESET: u8 = 0x06;
const SYNC_WRITE: u8 = 0x83;

/// One device's answer, before the maker's meaning of the error byte.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct RawStatus<'a> {
    pub id: Id,
    pub error: u8,
    pub params: &'a [u8],
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

/// Bytes of a sync write of `length` bytes to each of `devices`.
#[must_use]
pub const fn sync_write_len(devices: usize, length: usize) -> usize {
    instruction_len(2 + devices * (1 + length))
}

/// Asks who is there. Every device answers a ping of its own id; to a ping of all, those of
/// FEETECH's STS and SMS series answer in turn.
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

/// Puts one device back to factory values. A Dynamixel then has id 1 and its first line speed.
pub fn factory_reset(out: &mut Vec<u8>, id: Id) {
    fixed(out, id.get(), FACTORY_RESET, &[]);
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
            params.named.add(id)?;
            params.push(&[id.get()])?;
            params.push(bytes)?;
        }
        params.named.not_empty()
    })
}

/// Parameters under construction.
pub(super) struct Params<'a> {
    out: &'a mut Vec<u8>,
    start: usize,
    pub named: Named,
}

impl Params<'_> {
    /// Appends, unless the packet would be too long with it.
    pub fn push(&mut self, bytes: &[u8]) -> Result<(), EncodeError> {
        let (bytes_then, allowed) = (self.out.len() - self.start + bytes.len() + 1, MAX_PACKET);
        if bytes_then > allowed {
            return Err(EncodeError::TooLong { bytes: bytes_then, allowed });
        }
        self.out.extend_from_slice(bytes);
        Ok(())
    }
}

/// Refuses to ask for more bytes than a status can carry.
pub(super) fn answer_fits(length: u8) -> Result<(), EncodeError> {
    let (bytes, allowed) = (status_len(usize::from(length)), MAX_PACKET);
    if bytes <= allowed { Ok(()) } else { Err(EncodeError::AnswerTooLong { bytes, allowed }) }
}

/// A packet of a few parameters that are known to fit.
fn fixed(out: &mut Vec<u8>, id: u8, instruction: u8, params: &[u8]) {
    let start = open(out, id, instruction);
    out.extend_from_slice(params);
    close(out, start);
}

/// A packet whose parameters `fill` appends. If that fails, the buffer is left as it was.
pub(super) fn packet(
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
pub(super) fn decode(bytes: &[u8], longest: usize) -> Decoded<RawStatus<'_>> {
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
            let (error, params) = (packet[PREFIX], &packet[PREFIX + 1..total - 1]);
            Decoded::Packet(RawStatus { id, error, params }, total)
        }
    }
}

/// Bytes to take from the front when a decoder asks for more and none will come: up to the next
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
        let status = RawStatus { id: id(1), error: 0, params: &[0x18, 0x05] };
        assert_eq!(decode(&bytes[5..], 2), Decoded::Packet(status, 8));
    }

    #[test]
    fn a_whole_packet_behind_a_cut_one_is_found_once_the_line_is_silent() {
        let ping_answer = [0xFF, 0xFF, 0x02, 0x02, 0x00, 0xFB];
        let cut = [0xFF, 0xFF, 0x01, 0x11, 0x00];
        let bytes = [&cut[..], &ping_answer].concat();
        assert_eq!(decode(&bytes, 15), Decoded::Need(10));
        let rest = &bytes[abandon(&bytes)..];
        let status = RawStatus { id: id(2), error: 0, params: &[] };
        assert_eq!(decode(rest, 15), Decoded::Packet(status, 6));
    }

    #[test]
    fn an_instruction_to_all_is_an_echo() {
        let mut out = Vec::new();
        write(&mut out, Target::All, 24, &[0]).unwrap();
        assert_eq!(decode(&out, 4), Decoded::Echo(8));
    }

    #[test]
    fn a_packet_that_cannot_be_built_leaves_the_buffer_as_it_was() {
        let mut out = vec![7, 7];
        let failures = [
            sync_write(&mut out, 42, 2, [(id(1), &[0_u8; 2][..]), (id(2), &[0_u8; 3][..])]),
            sync_write(&mut out, 42, 2, [(id(1), [0_u8; 2]), (id(1), [0_u8; 2])]),
            sync_write(&mut out, 42, 2, [] as [(Id, [u8; 2]); 0]),
            read(&mut out, id(1), 0, 245),
            write(&mut out, Target::All, 0, &[0; 244]),
        ];
        let expected = [
            EncodeError::WrongLength { id: 2, expected: 2, actual: 3 },
            EncodeError::RepeatedId(1),
            EncodeError::Empty,
            EncodeError::AnswerTooLong { bytes: 251, allowed: 250 },
            EncodeError::TooLong { bytes: 251, allowed: 250 },
        ];
        assert_eq!(failures, expected.map(Err));
        assert_eq!(out, [7, 7]);
        write(&mut out, Target::All, 0, &[0; 243]).unwrap();
        assert_eq!(out.len(), 2 + MAX_PACKET);
    }
}
