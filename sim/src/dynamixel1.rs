//! DYNAMIXEL Protocol 1.0, the device's side: what AX and MX servos do and say to an instruction.
//!
//! Source: ROBOTIS e-Manual, "DYNAMIXEL Protocol 1.0" (instructions, status, error bits). A status
//! carries a mask of error bits, not a number.
//!
//! What the manual leaves open: a read of or write to something that is not there, or longer than a
//! packet can be, has a range error; a ping to everyone is not answered, as nothing to everyone is
//! but bulk read. Bulk read is obeyed by servos whose profile says so; others stay silent where
//! their turn is.

pub(crate) mod packet;

use crate::exchange::{Answer, Ask, Exchange, Order, hearing, in_turn, with_id};
use crate::family::Family;
use crate::servo::{Refusal, Servo};
use gaitway_profiles::Role;

const BROADCAST: u8 = 0xFE;
const FAMILY: Family = Family::Dynamixel1;

const PING: u8 = 0x01;
const READ: u8 = 0x02;
const WRITE: u8 = 0x03;
const REG_WRITE: u8 = 0x04;
const ACTION: u8 = 0x05;
const FACTORY_RESET: u8 = 0x06;
const SYNC_WRITE: u8 = 0x83;
const BULK_READ: u8 = 0x92;

/// Error bit of a wrong checksum.
const CHECKSUM: u8 = 1 << 4;

/// Lets the servos that hear carry out a packet that ended at `at_ns`.
pub(crate) fn answer(packet: &[u8], servos: &mut [Servo], at_ns: u64) -> Exchange {
    let (id, code, params) = packet::open(packet);
    match (code, id) {
        (SYNC_WRITE, BROADCAST) => sync_write(servos, params, at_ns),
        (BULK_READ, BROADCAST) => bulk_read(servos, params, at_ns),
        (_, BROADCAST) => {
            for (_, servo) in hearing(servos, FAMILY) {
                let _ = act(servo, code, params, at_ns);
            }
            Exchange::nothing()
        }
        _ => unicast(servos, id, code, params, at_ns),
    }
}

/// What a servo says to a packet for it whose checksum is wrong, if it says anything.
pub(crate) fn complain(id: u8, servos: &mut [Servo]) -> Exchange {
    let mut answers = Vec::new();
    for (index, servo) in with_id(servos, FAMILY, id).filter(|(_, servo)| servo.hears) {
        if return_level(servo) >= 2 {
            let bytes = packet::status(id, CHECKSUM | servo.status_error(), &[]);
            answers.push(Answer::given(index, id, bytes, servo.return_delay_ns()));
        }
    }
    Exchange { order: Order::Together, answers }
}

fn return_level(servo: &Servo) -> i64 {
    servo.value(Role::StatusReturnLevel).unwrap_or(2)
}

fn unicast(servos: &mut [Servo], id: u8, code: u8, params: &[u8], at_ns: u64) -> Exchange {
    let mut answers = Vec::new();
    let asked = if code == READ { params.get(1).map_or(0, |&n| usize::from(n)) } else { 0 };
    for (index, servo) in with_id(servos, FAMILY, id) {
        let delay_ns = servo.return_delay_ns();
        if !servo.hears {
            answers.push(Answer::missing(id, packet::STATUS_OVERHEAD + asked, delay_ns));
            continue;
        }
        servo.advance(at_ns);
        let allowed = return_level(servo);
        let (level, result) = match code {
            PING => (0, Ok(Vec::new())),
            READ => (1, read(servo, params)),
            _ => (2, act(servo, code, params, at_ns).map(|()| Vec::new())),
        };
        if level <= allowed {
            answers.push(Answer::given(index, id, status(servo, id, &result), delay_ns));
        }
    }
    Exchange { order: Order::Together, answers }
}

fn status(servo: &Servo, id: u8, result: &Result<Vec<u8>, Refusal>) -> Vec<u8> {
    match result {
        Ok(params) => packet::status(id, servo.status_error(), params),
        Err(refusal) => packet::status(id, servo.status_error() | refusal.status_bit(), &[]),
    }
}

fn read(servo: &mut Servo, params: &[u8]) -> Result<Vec<u8>, Refusal> {
    let &[address, length] = params else { return Err(Refusal::Length) };
    read_table(servo, u16::from(address), usize::from(length))
}

fn read_table(servo: &mut Servo, address: u16, length: usize) -> Result<Vec<u8>, Refusal> {
    if length > packet::MOST_PARAMS {
        return Err(Refusal::Range);
    }
    let mut out = Vec::with_capacity(length);
    servo.read(address, length, &mut out)?;
    Ok(out)
}

fn act(servo: &mut Servo, code: u8, params: &[u8], at_ns: u64) -> Result<(), Refusal> {
    match (code, params) {
        (WRITE, &[address, ref bytes @ ..]) => servo.write(address.into(), bytes, at_ns),
        (REG_WRITE, &[address, ref bytes @ ..]) => servo.register(address.into(), bytes),
        (ACTION, []) => servo.action(at_ns),
        (FACTORY_RESET, []) => {
            servo.factory_reset(at_ns, &[]);
            Ok(())
        }
        _ => Err(Refusal::Instruction),
    }
}

fn sync_write(servos: &mut [Servo], params: &[u8], at_ns: u64) -> Exchange {
    let &[address, length, ref entries @ ..] = params else { return Exchange::nothing() };
    let size = usize::from(length) + 1;
    if entries.len().is_multiple_of(size) {
        for entry in entries.chunks_exact(size) {
            for (_, servo) in with_id(servos, FAMILY, entry[0]).filter(|(_, servo)| servo.hears) {
                let _ = servo.write(address.into(), &entry[1..], at_ns);
            }
        }
    }
    Exchange::nothing()
}

/// `00`, then length, ID and address of each: everyone answers after the one before.
fn bulk_read(servos: &mut [Servo], params: &[u8], at_ns: u64) -> Exchange {
    let Some((0, entries)) = params.split_first() else { return Exchange::nothing() };
    let (entries, []) = entries.as_chunks::<3>() else { return Exchange::nothing() };
    let ask = |&[length, id, address]: &[u8; 3]| Ask {
        id,
        address: u16::from(address),
        length: usize::from(length),
    };
    let asks: Vec<Ask> = entries.iter().map(ask).collect();
    in_turn(servos, FAMILY, &asks, packet::STATUS_OVERHEAD, |servo, ask| {
        if !servo.model.profile.bulk_read || return_level(servo) < 1 {
            return None;
        }
        servo.advance(at_ns);
        let result = read_table(servo, ask.address, ask.length);
        Some(status(servo, ask.id, &result))
    })
}
