//! DYNAMIXEL Protocol 2.0, the device's side: what servos do and say to an instruction.
//!
//! Source: ROBOTIS e-Manual, "DYNAMIXEL Protocol 2.0" (instructions, status, fast sync read).
//!
//! What the manual leaves open: an instruction that came with a later firmware or is not known to
//! the model (Clear) is an undefined one, and a fast read is not answered by servos that do not
//! know it.

pub(crate) mod packet;

use crate::exchange::{Answer, Ask, Exchange, Order, hearing, in_turn, with_id};
use crate::family::Family;
use crate::servo::{BOOT_NS, Refusal, Servo};
use gaitway_profiles::Role;

const BROADCAST: u8 = 0xFE;
const ALERT: u8 = 0x80;
const STATUS_OVERHEAD: usize = 11;
const FAMILY: Family = Family::Dynamixel2;
/// From this firmware on a factory reset of everything is not obeyed if it is to everyone.
const NO_BROADCAST_RESET_FROM: u16 = 42;
/// Number of the error "CRC".
const CRC_ERROR: u8 = 3;

const PING: u8 = 0x01;
const READ: u8 = 0x02;
const WRITE: u8 = 0x03;
const REG_WRITE: u8 = 0x04;
const ACTION: u8 = 0x05;
const FACTORY_RESET: u8 = 0x06;
const REBOOT: u8 = 0x08;
const CLEAR: u8 = 0x10;
const BACKUP: u8 = 0x20;
const STATUS: u8 = 0x55;
const SYNC_READ: u8 = 0x82;
const SYNC_WRITE: u8 = 0x83;
const FAST_SYNC_READ: u8 = 0x8A;
const BULK_READ: u8 = 0x92;
const BULK_WRITE: u8 = 0x93;
const FAST_BULK_READ: u8 = 0x9A;

/// Lowest Status Return Level(68) at which an instruction is answered.
#[derive(Clone, Copy, PartialEq, PartialOrd)]
enum Level {
    Always = 0,
    Reads = 1,
    All = 2,
}

/// Lets the servos that hear carry out a packet that ended at `at_ns`.
pub(crate) fn answer(packet: &[u8], servos: &mut [Servo], at_ns: u64) -> Exchange {
    let (id, code, params) = packet::open(packet);
    match (code, id) {
        (STATUS, _) => Exchange::nothing(),
        (SYNC_READ, BROADCAST) => read_many(servos, &sync_asks(&params), at_ns),
        (BULK_READ, BROADCAST) => read_many(servos, &bulk_asks(&params), at_ns),
        (FAST_SYNC_READ, BROADCAST) => read_merged(servos, &sync_asks(&params), at_ns),
        (FAST_BULK_READ, BROADCAST) => read_merged(servos, &bulk_asks(&params), at_ns),
        (SYNC_WRITE, BROADCAST) => sync_write(servos, &params, at_ns),
        (BULK_WRITE, BROADCAST) => bulk_write(servos, &params, at_ns),
        (PING, BROADCAST) => broadcast_ping(servos, at_ns),
        (_, BROADCAST) => {
            // A broadcast read is not carried out; nothing else broadcast is answered.
            for (_, servo) in hearing(servos, FAMILY).filter(|_| code != READ) {
                let _ = execute(servo, code, &params, true, at_ns);
            }
            Exchange::nothing()
        }
        _ => unicast(servos, id, code, &params, at_ns),
    }
}

/// What a servo says to a packet for it whose CRC is wrong, if it says anything.
pub(crate) fn complain(id: u8, servos: &mut [Servo]) -> Exchange {
    let mut answers = Vec::new();
    for (index, servo) in with_id(servos, FAMILY, id).filter(|(_, servo)| servo.hears) {
        if return_level(servo) >= Level::All as i64 {
            let bytes = packet::status(id, CRC_ERROR | alert(servo), &[]);
            answers.push(Answer::given(index, id, bytes, servo.return_delay_ns()));
        }
    }
    Exchange { order: Order::Together, answers }
}

fn unicast(servos: &mut [Servo], id: u8, code: u8, params: &[u8], at_ns: u64) -> Exchange {
    let mut answers = Vec::new();
    for (index, servo) in with_id(servos, FAMILY, id) {
        let delay_ns = servo.return_delay_ns();
        if !servo.hears {
            let length = STATUS_OVERHEAD + if code == READ { asked_length(params) } else { 0 };
            answers.push(Answer::missing(id, length, delay_ns));
            continue;
        }
        // A board's firmware knows no other instruction, and says nothing to one.
        if !servo.model.has_shaft && !matches!(code, PING | READ | WRITE) {
            continue;
        }
        let allowed = return_level(servo);
        let (level, result) = execute(servo, code, params, false, at_ns);
        if level as i64 <= allowed {
            let (error, params) = match &result {
                Ok(params) => (0, &params[..]),
                Err(refusal) => (*refusal as u8, &[][..]),
            };
            let bytes = packet::status(id, error | alert(servo), params);
            answers.push(Answer::given(index, id, bytes, delay_ns));
        }
    }
    for (_, servo) in hearing(servos, FAMILY).filter(|(_, servo)| in_group(servo, id)) {
        let _ = servo.as_one_of_group(|servo| execute(servo, code, params, true, at_ns));
    }
    Exchange { order: Order::Together, answers }
}

/// True if `id` is the servo's Secondary ID only: it obeys and says nothing.
fn in_group(servo: &Servo, id: u8) -> bool {
    servo.id() != id && servo.obeys(id)
}

fn return_level(servo: &Servo) -> i64 {
    servo.value(Role::StatusReturnLevel).unwrap_or(2)
}

fn alert(servo: &Servo) -> u8 {
    if servo.hardware_error() != 0 { ALERT } else { 0 }
}

/// What a ping's status carries: model number, then firmware version.
fn identity(servo: &Servo) -> Vec<u8> {
    let model = servo.value(Role::ModelNumber).unwrap_or(0) as u16;
    let [low, high] = model.to_le_bytes();
    vec![low, high, servo.firmware() as u8]
}

/// One instruction for one servo: the parameters of its status, or why not.
fn execute(
    servo: &mut Servo,
    code: u8,
    params: &[u8],
    broadcast: bool,
    at_ns: u64,
) -> (Level, Result<Vec<u8>, Refusal>) {
    servo.advance(at_ns);
    match code {
        PING => (Level::Always, Ok(identity(servo))),
        READ => (Level::Reads, read(servo, params)),
        _ => (Level::All, act(servo, code, params, broadcast, at_ns).map(|()| Vec::new())),
    }
}

fn read(servo: &mut Servo, params: &[u8]) -> Result<Vec<u8>, Refusal> {
    let [low, high, ..] = *params else { return Err(Refusal::Length) };
    if params.len() != 4 {
        return Err(Refusal::Length);
    }
    let mut out = Vec::new();
    servo.read(u16::from_le_bytes([low, high]), asked_length(params), &mut out)?;
    Ok(out)
}

/// The length field of a read's parameters.
fn asked_length(params: &[u8]) -> usize {
    match *params {
        [_, _, low, high, ..] => usize::from(u16::from_le_bytes([low, high])),
        _ => 0,
    }
}

/// The instructions that only report whether they were carried out.
fn act(
    servo: &mut Servo,
    code: u8,
    params: &[u8],
    broadcast: bool,
    at_ns: u64,
) -> Result<(), Refusal> {
    match (code, params) {
        (WRITE, &[low, high, ref bytes @ ..]) => {
            servo.write(u16::from_le_bytes([low, high]), bytes, at_ns)
        }
        (REG_WRITE, &[low, high, ref bytes @ ..]) => {
            servo.register(u16::from_le_bytes([low, high]), bytes)
        }
        (ACTION, []) => servo.action(at_ns),
        (REBOOT, []) => {
            servo.restart(at_ns, at_ns + BOOT_NS);
            Ok(())
        }
        (FACTORY_RESET, &[what]) => {
            match what {
                0xFF if broadcast && servo.firmware() >= NO_BROADCAST_RESET_FROM => {
                    return Err(Refusal::Failed);
                }
                0xFF => servo.factory_reset(at_ns, &[]),
                0x01 => servo.factory_reset(at_ns, &[Role::Id]),
                0x02 => servo.factory_reset(at_ns, &[Role::Id, Role::BaudRate]),
                _ => return Err(Refusal::Range),
            }
            Ok(())
        }
        (CLEAR, _) if !since(servo, servo.model.profile.clear_from_firmware) => {
            Err(Refusal::Instruction)
        }
        (CLEAR, &[0x01, 0x44, 0x58, 0x4C, 0x22]) => servo.clear_turns(),
        (BACKUP, &[0x01, 0x43, 0x54, 0x52, 0x4C]) => servo.backup_store(at_ns),
        (BACKUP, &[0x02, 0x43, 0x54, 0x52, 0x4C]) => servo.backup_restore(at_ns),
        (CLEAR | BACKUP, _) => Err(Refusal::Range),
        (WRITE | REG_WRITE | ACTION | REBOOT | FACTORY_RESET, _) => Err(Refusal::Length),
        _ => Err(Refusal::Instruction),
    }
}

fn sync_asks(params: &[u8]) -> Vec<Ask> {
    let [low, high, _, _, ref ids @ ..] = *params else { return Vec::new() };
    let address = u16::from_le_bytes([low, high]);
    let length = asked_length(params);
    ids.iter().map(|&id| Ask { id, address, length }).collect()
}

fn bulk_asks(params: &[u8]) -> Vec<Ask> {
    let (entries, rest) = params.as_chunks::<5>();
    if !rest.is_empty() {
        return Vec::new();
    }
    let ask = |entry: &[u8; 5]| Ask {
        id: entry[0],
        address: u16::from_le_bytes([entry[1], entry[2]]),
        length: usize::from(u16::from_le_bytes([entry[3], entry[4]])),
    };
    entries.iter().map(ask).collect()
}

/// Sync and bulk reads: one status each in the order asked.
fn read_many(servos: &mut [Servo], asks: &[Ask], at_ns: u64) -> Exchange {
    in_turn(servos, FAMILY, asks, STATUS_OVERHEAD, |servo, ask| {
        // One that answers pings only is silent.
        if return_level(servo) < Level::Reads as i64 {
            return None;
        }
        servo.advance(at_ns);
        let (error, out) = read_for(servo, ask);
        Some(packet::status(ask.id, error, &out))
    })
}

/// Fast sync and bulk reads: one status from all of them.
fn read_merged(servos: &mut [Servo], asks: &[Ask], at_ns: u64) -> Exchange {
    let total: usize = asks.iter().map(|ask| ask.length + 4).sum();
    let Ok(total) = u16::try_from(total + 1) else { return Exchange::nothing() };
    let mut head = packet::merged_head(total);
    let mut crc = 0;
    let mut whole = true;
    let mut exchange = Exchange { order: Order::Merged, answers: Vec::new() };
    for ask in asks {
        let overhead = head.len() + 4;
        let one = std::slice::from_ref(ask);
        let mut crc_after = None;
        let block = in_turn(servos, FAMILY, one, overhead, |servo, ask| {
            // A merged status cannot go on after a gap.
            if !whole || return_level(servo) < Level::Reads as i64 || !knows_fast_reads(servo) {
                return None;
            }
            servo.advance(at_ns);
            let (error, out) = read_for(servo, ask);
            let bytes = merged_block(&head, error, ask, out, crc);
            crc_after.get_or_insert(packet::crc_after(crc, &bytes));
            Some(bytes)
        });
        exchange.answers.extend(block.answers);
        whole &= crc_after.is_some();
        crc = crc_after.unwrap_or(crc);
        head.clear();
    }
    exchange
}

/// Error byte and parameters of a status to a read of many.
fn read_for(servo: &mut Servo, ask: &Ask) -> (u8, Vec<u8>) {
    let mut out = Vec::with_capacity(ask.length);
    let error = servo.read(ask.address, ask.length, &mut out).err().map_or(0, |e| e as u8);
    (error | alert(servo), out)
}

/// One servo's part of a merged status: error, ID, bytes, and a CRC over all that went before,
/// the earlier CRCs included.
fn merged_block(head: &[u8], error: u8, ask: &Ask, mut out: Vec<u8>, crc: u16) -> Vec<u8> {
    // The place of the next servo is fixed, so a refused read is filled with zeros.
    out.resize(ask.length, 0);
    let mut block = Vec::with_capacity(head.len() + ask.length + 4);
    block.extend_from_slice(head);
    block.extend_from_slice(&[error, ask.id]);
    block.extend_from_slice(&out);
    let crc = packet::crc_after(crc, &block);
    block.extend_from_slice(&crc.to_le_bytes());
    block
}

fn knows_fast_reads(servo: &Servo) -> bool {
    since(servo, servo.model.profile.fast_sync_read_from_firmware)
}

/// True if something exists that came with a firmware, and the servo's is not older.
fn since(servo: &Servo, firmware: Option<u16>) -> bool {
    firmware.is_some_and(|firmware| servo.firmware() >= firmware)
}

fn sync_write(servos: &mut [Servo], params: &[u8], at_ns: u64) -> Exchange {
    let &[low, high, _, _, ref entries @ ..] = params else { return Exchange::nothing() };
    let address = u16::from_le_bytes([low, high]);
    let size = asked_length(params) + 1;
    if entries.len().is_multiple_of(size) {
        for entry in entries.chunks_exact(size) {
            write_one(servos, entry[0], address, &entry[1..], at_ns);
        }
    }
    Exchange::nothing()
}

fn bulk_write(servos: &mut [Servo], params: &[u8], at_ns: u64) -> Exchange {
    let mut rest = params;
    while let &[id, low, high, size_low, size_high, ref after @ ..] = rest {
        let size = usize::from(u16::from_le_bytes([size_low, size_high]));
        let Some((bytes, after)) = after.split_at_checked(size) else { break };
        write_one(servos, id, u16::from_le_bytes([low, high]), bytes, at_ns);
        rest = after;
    }
    Exchange::nothing()
}

fn write_one(servos: &mut [Servo], id: u8, address: u16, bytes: &[u8], at_ns: u64) {
    for (_, servo) in hearing(servos, FAMILY).filter(|(_, servo)| servo.obeys(id)) {
        // Nobody is told of a refused write that was not addressed to one servo.
        let _ = if in_group(servo, id) {
            servo.as_one_of_group(|servo| servo.write(address, bytes, at_ns))
        } else {
            servo.write(address, bytes, at_ns)
        };
    }
}

fn broadcast_ping(servos: &mut [Servo], at_ns: u64) -> Exchange {
    let mut answers = Vec::new();
    for (index, servo) in hearing(servos, FAMILY) {
        servo.advance(at_ns);
        let id = servo.id();
        let bytes = packet::status(id, alert(servo), &identity(servo));
        answers.push(Answer::given(index, id, bytes, servo.return_delay_ns()));
    }
    answers.sort_by_key(|answer| answer.id);
    Exchange { order: Order::Slots, answers }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_merged_status_is_the_manuals_byte_for_byte() {
        // e-Manual, Protocol 2.0, Fast Bulk Read: ID 3 (132, 4), ID 7 (124, 2), ID 4 (146, 1).
        let parts: [(u8, &[u8]); 3] = [(3, &[0xA6, 0, 0, 0]), (7, &[0xA5, 0x01]), (4, &[0x1F])];
        let mut merged = Vec::new();
        for (k, (id, out)) in parts.into_iter().enumerate() {
            let head = if k == 0 { packet::merged_head(0x14) } else { Vec::new() };
            let ask = Ask { id, address: 0, length: out.len() };
            let crc = packet::crc_after(0, &merged);
            merged.extend(merged_block(&head, 0, &ask, out.to_vec(), crc));
        }
        let expected = [
            0xFF, 0xFF, 0xFD, 0x00, 0xFE, 0x14, 0x00, 0x55, 0x00, 0x03, 0xA6, 0x00, 0x00, 0x00,
            0x67, 0xA4, 0x00, 0x07, 0xA5, 0x01, 0x24, 0x74, 0x00, 0x04, 0x1F, 0xD9, 0xC1,
        ];
        assert_eq!(merged, expected);
    }
}
