//! Instructions of Protocol 2.0, appended to a buffer: parameters, then stuffing, then length,
//! then CRC. A function that fails leaves the buffer as it was.

use super::{BODY, HEADER, Id, MAX_PACKET, PREFIX, Target, find_pattern};
use super::{merged_status_len, stuffed_status_len};
use crate::wire::checksum::crc16;
use crate::wire::{BROADCAST, EncodeError, Named};

const PING: u8 = 0x01;
const READ: u8 = 0x02;
const WRITE: u8 = 0x03;
const REG_WRITE: u8 = 0x04;
const ACTION: u8 = 0x05;
const FACTORY_RESET: u8 = 0x06;
const REBOOT: u8 = 0x08;
const CLEAR: u8 = 0x10;
const CONTROL_TABLE_BACKUP: u8 = 0x20;
const SYNC_READ: u8 = 0x82;
const SYNC_WRITE: u8 = 0x83;
const FAST_SYNC_READ: u8 = 0x8A;
const BULK_READ: u8 = 0x92;
const BULK_WRITE: u8 = 0x93;
const FAST_BULK_READ: u8 = 0x9A;

/// What a factory reset leaves alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FactoryReset {
    /// Nothing: id becomes 1 and baud rate 57,600.
    Everything,
    /// The id.
    KeepId,
    /// The id and the baud rate.
    KeepIdAndBaud,
}

/// What one device is asked for in a bulk read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BulkRead {
    /// Who.
    pub id: Id,
    /// First address.
    pub address: u16,
    /// Number of bytes.
    pub length: u16,
}

/// Asks who is there. Answered with [`Identity`](super::Identity), also by all.
pub fn ping(out: &mut Vec<u8>, target: impl Into<Target>) {
    fixed(out, target.into().number(), PING, &[]);
}

/// Asks one device for `length` bytes from `address` on.
///
/// # Errors
/// [`EncodeError::AnswerTooLong`] if the answer might not fit a packet.
pub fn read(out: &mut Vec<u8>, id: Id, address: u16, length: u16) -> Result<(), EncodeError> {
    answer_fits(stuffed_status_len(usize::from(length)))?;
    let [address, length] = [address.to_le_bytes(), length.to_le_bytes()];
    fixed(out, id.get(), READ, &[address[0], address[1], length[0], length[1]]);
    Ok(())
}

/// Writes `bytes` from `address` on, at once.
///
/// # Errors
/// [`EncodeError::TooLong`].
pub fn write(
    out: &mut Vec<u8>,
    target: impl Into<Target>,
    address: u16,
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
    address: u16,
    bytes: &[u8],
) -> Result<(), EncodeError> {
    write_as(REG_WRITE, out, target.into(), address, bytes)
}

fn write_as(
    instruction: u8,
    out: &mut Vec<u8>,
    target: Target,
    address: u16,
    bytes: &[u8],
) -> Result<(), EncodeError> {
    packet(out, target.number(), instruction, |params| {
        params.push(&address.to_le_bytes())?;
        params.push(bytes)
    })
}

/// Carries out what [`reg_write`] registered.
pub fn action(out: &mut Vec<u8>, target: impl Into<Target>) {
    fixed(out, target.into().number(), ACTION, &[]);
}

/// Puts the control table of one device back to factory values; it then reboots. The protocol
/// would let this address all devices; here it does not.
pub fn factory_reset(out: &mut Vec<u8>, id: Id, option: FactoryReset) {
    let option = match option {
        FactoryReset::Everything => 0xFF,
        FactoryReset::KeepId => 0x01,
        FactoryReset::KeepIdAndBaud => 0x02,
    };
    fixed(out, id.get(), FACTORY_RESET, &[option]);
}

/// Restarts: torque goes off, RAM items take their initial values. Only this ends a shutdown.
pub fn reboot(out: &mut Vec<u8>, target: impl Into<Target>) {
    fixed(out, target.into().number(), REBOOT, &[]);
}

/// Brings Present Position(132) of a standing device back into one turn.
pub fn clear_multi_turn(out: &mut Vec<u8>, target: impl Into<Target>) {
    fixed(out, target.into().number(), CLEAR, &[0x01, 0x44, 0x58, 0x4C, 0x22]);
}

/// Stores the control table of one device, torque off, as its back-up.
pub fn control_table_backup(out: &mut Vec<u8>, id: Id) {
    fixed(out, id.get(), CONTROL_TABLE_BACKUP, b"\x01CTRL");
}

/// Restores the back-up of one device, torque off; it then reboots.
pub fn control_table_restore(out: &mut Vec<u8>, id: Id) {
    fixed(out, id.get(), CONTROL_TABLE_BACKUP, b"\x02CTRL");
}

/// Asks several devices for the same `length` bytes from `address` on. Each answers with a status
/// of its own, in the order listed.
///
/// # Errors
/// An empty list, an id twice, or an answer that might not fit a packet.
pub fn sync_read(
    out: &mut Vec<u8>,
    address: u16,
    length: u16,
    ids: impl IntoIterator<Item = Id>,
) -> Result<(), EncodeError> {
    answer_fits(stuffed_status_len(usize::from(length)))?;
    sync_read_as(SYNC_READ, out, address, length, ids).map(drop)
}

/// As [`sync_read`], but all answer in one packet; read it with
/// [`decode_merged`](super::decode_merged). Needs recent firmware.
///
/// # Errors
/// An empty list, an id twice, or a merged answer longer than a packet.
pub fn fast_sync_read(
    out: &mut Vec<u8>,
    address: u16,
    length: u16,
    ids: impl IntoIterator<Item = Id>,
) -> Result<(), EncodeError> {
    let start = out.len();
    let devices = sync_read_as(FAST_SYNC_READ, out, address, length, ids)?;
    answer_fits(merged_status_len(devices, devices * usize::from(length)))
        .inspect_err(|_| out.truncate(start))
}

/// Returns the number of devices.
fn sync_read_as(
    instruction: u8,
    out: &mut Vec<u8>,
    address: u16,
    length: u16,
    ids: impl IntoIterator<Item = Id>,
) -> Result<usize, EncodeError> {
    let mut devices = 0;
    packet(out, BROADCAST, instruction, |params| {
        params.push(&address.to_le_bytes())?;
        params.push(&length.to_le_bytes())?;
        for id in ids {
            params.device(id)?;
            devices += 1;
        }
        params.named.not_empty()
    })?;
    Ok(devices)
}

/// Writes `length` bytes to each of several devices, from the same `address` on. Nobody answers.
///
/// ```
/// use gaitway::wire::dynamixel2::{Id, sync_write};
///
/// // Goal Position(116) of devices 1 and 2 to 150 and 170: the example in the manual.
/// let goals = [(1, 150_u32), (2, 170)];
/// let goals = goals.iter().filter_map(|&(id, goal)| Some((Id::new(id)?, goal.to_le_bytes())));
/// let mut out = Vec::new();
/// sync_write(&mut out, 116, 4, goals)?;
/// assert_eq!(out[12..22], [1, 0x96, 0, 0, 0, 2, 0xAA, 0, 0, 0]);
/// # Ok::<(), gaitway::wire::EncodeError>(())
/// ```
///
/// # Errors
/// An empty list, an id twice, a number of bytes other than `length`, or a packet too long.
pub fn sync_write<B: AsRef<[u8]>>(
    out: &mut Vec<u8>,
    address: u16,
    length: u16,
    writes: impl IntoIterator<Item = (Id, B)>,
) -> Result<(), EncodeError> {
    let expected = usize::from(length);
    packet(out, BROADCAST, SYNC_WRITE, |params| {
        params.push(&address.to_le_bytes())?;
        params.push(&length.to_le_bytes())?;
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

/// Asks several devices, each for bytes of its own choice. Each answers with a status of its own,
/// in the order listed.
///
/// # Errors
/// An empty list, an id twice, an instruction too long, or an answer that might not fit a packet.
pub fn bulk_read(
    out: &mut Vec<u8>,
    reads: impl IntoIterator<Item = BulkRead>,
) -> Result<(), EncodeError> {
    bulk_read_as(BULK_READ, out, reads, |read| {
        answer_fits(stuffed_status_len(usize::from(read.length)))
    })
}

/// As [`bulk_read`], but all answer in one packet; read it with
/// [`decode_merged`](super::decode_merged). Needs recent firmware.
///
/// # Errors
/// An empty list, an id twice, an instruction too long, or a merged answer longer than a packet.
pub fn fast_bulk_read(
    out: &mut Vec<u8>,
    reads: impl IntoIterator<Item = BulkRead>,
) -> Result<(), EncodeError> {
    let (mut devices, mut params) = (0, 0);
    bulk_read_as(FAST_BULK_READ, out, reads, |read| {
        devices += 1;
        params += usize::from(read.length);
        answer_fits(merged_status_len(devices, params))
    })
}

fn bulk_read_as(
    instruction: u8,
    out: &mut Vec<u8>,
    reads: impl IntoIterator<Item = BulkRead>,
    mut check: impl FnMut(BulkRead) -> Result<(), EncodeError>,
) -> Result<(), EncodeError> {
    packet(out, BROADCAST, instruction, |params| {
        for read in reads {
            check(read)?;
            params.device(read.id)?;
            params.push(&read.address.to_le_bytes())?;
            params.push(&read.length.to_le_bytes())?;
        }
        params.named.not_empty()
    })
}

/// Writes to several devices, each at an address and in a number of bytes of its own. Items are
/// (id, address, bytes). Nobody answers.
///
/// # Errors
/// An empty list, an id twice, or a packet too long.
pub fn bulk_write<B: AsRef<[u8]>>(
    out: &mut Vec<u8>,
    writes: impl IntoIterator<Item = (Id, u16, B)>,
) -> Result<(), EncodeError> {
    packet(out, BROADCAST, BULK_WRITE, |params| {
        for (id, address, bytes) in writes {
            let bytes = bytes.as_ref();
            // A length beyond sixteen bits is refused by `push` as too long.
            let length = u16::try_from(bytes.len()).unwrap_or(u16::MAX);
            params.device(id)?;
            params.push(&address.to_le_bytes())?;
            params.push(&length.to_le_bytes())?;
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
    /// Appends, unless the packet would be too long even without stuffing. Thus nothing a caller
    /// passes makes the buffer grow beyond one packet.
    fn push(&mut self, bytes: &[u8]) -> Result<(), EncodeError> {
        fits(self.out.len() - self.start + bytes.len() + 2)?;
        self.out.extend_from_slice(bytes);
        Ok(())
    }

    fn device(&mut self, id: Id) -> Result<(), EncodeError> {
        self.named.add(id)?;
        self.push(&[id.get()])
    }
}

fn fits(bytes: usize) -> Result<(), EncodeError> {
    let allowed = MAX_PACKET;
    if bytes <= allowed { Ok(()) } else { Err(EncodeError::TooLong { bytes, allowed }) }
}

fn answer_fits(bytes: usize) -> Result<(), EncodeError> {
    let allowed = MAX_PACKET;
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
    let filled = fill(&mut Params { out, start, named: Named::default() });
    let done = filled.and_then(|()| {
        close(out, start);
        fits(out.len() - start)
    });
    done.inspect_err(|_| out.truncate(start))
}

fn open(out: &mut Vec<u8>, id: u8, instruction: u8) -> usize {
    let start = out.len();
    out.extend_from_slice(&HEADER);
    out.extend_from_slice(&[id, 0, 0, instruction]);
    start
}

fn close(out: &mut Vec<u8>, start: usize) {
    stuff(out, start + BODY);
    // Instruction to CRC. At most 4/3 of MAX_PACKET, so the cast loses nothing.
    let length = (out.len() - start - PREFIX + 2) as u16;
    out[start + 5..start + PREFIX].copy_from_slice(&length.to_le_bytes());
    let crc = crc16(&out[start..]);
    out.extend_from_slice(&crc.to_le_bytes());
}

/// Inserts an `FD` after every `FF FF FD` from `from` on. An inserted byte is never part of
/// another occurrence, since it would have to be its last, behind two `FF`.
fn stuff(out: &mut Vec<u8>, from: usize) {
    let mut at = from;
    while let Some(found) = find_pattern(&out[at..]) {
        at += found + 3;
        out.insert(at, 0xFD);
        at += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stuffed(bytes: &[u8]) -> Vec<u8> {
        let mut out = bytes.to_vec();
        stuff(&mut out, 0);
        out
    }

    #[test]
    fn stuffing_follows_every_pattern_also_when_runs_overlap() {
        assert_eq!(stuffed(&[0xFF, 0xFF, 0xFD, 0xFD]), [0xFF, 0xFF, 0xFD, 0xFD, 0xFD]);
        assert_eq!(
            stuffed(&[0xFF, 0xFF, 0xFD, 0xFF, 0xFF, 0xFD]),
            [0xFF, 0xFF, 0xFD, 0xFD, 0xFF, 0xFF, 0xFD, 0xFD],
        );
        assert_eq!(stuffed(&[0xFF, 0xFF, 0x01, 0xFD]), [0xFF, 0xFF, 0x01, 0xFD]);
        assert_eq!(stuffed(&[0xFF, 0xFF, 0xFF, 0xFD]), [0xFF, 0xFF, 0xFF, 0xFD, 0xFD]);
    }

    #[test]
    fn a_packet_that_cannot_be_built_leaves_the_buffer_as_it_was() {
        let [one, two] = [Id::new(1).unwrap(), Id::new(2).unwrap()];
        let mut out = vec![7, 7];
        let failures = [
            sync_write(&mut out, 116, 4, [(one, &[0_u8; 4][..]), (two, &[0_u8; 3][..])]),
            sync_write(&mut out, 116, 4, [(one, [0_u8; 4]), (one, [0_u8; 4])]),
            sync_read(&mut out, 132, 4, []),
            sync_read(&mut out, 0, 800, [one]),
            fast_sync_read(&mut out, 0, 600, [one, two]),
            write(&mut out, one, 0, &[0; 1013]),
            write(&mut out, one, 0, &[0xFF, 0xFF, 0xFD].repeat(300)),
            bulk_write(&mut out, [(one, 0, vec![0_u8; 100_000])]),
        ];
        let expected = [
            EncodeError::WrongLength { id: 2, expected: 4, actual: 3 },
            EncodeError::RepeatedId(1),
            EncodeError::Empty,
            EncodeError::AnswerTooLong { bytes: 11 + 800 + 266, allowed: 1024 },
            EncodeError::AnswerTooLong { bytes: 8 + 8 + 1200, allowed: 1024 },
            EncodeError::TooLong { bytes: 1025, allowed: 1024 },
            EncodeError::TooLong { bytes: 12 + 1200, allowed: 1024 },
            EncodeError::TooLong { bytes: 10 + 5 + 100_000, allowed: 1024 },
        ];
        assert_eq!(failures, expected.map(Err));
        assert_eq!(out, [7, 7]);
    }

    #[test]
    fn the_longest_write_is_a_whole_packet() {
        let mut out = Vec::new();
        write(&mut out, Target::All, 0, &[0; 1012]).unwrap();
        assert_eq!(out.len(), MAX_PACKET);
        assert_eq!(out[5..7], 1017_u16.to_le_bytes());
    }
}
