//! FEETECH's protocols STS (with SMS) and SCS, the device's side.
//!
//! Source: the maker's SDK as public in adityakamath/SCServo_Linux (`INST.h`, `SCS.cpp`) and
//! LeRobot's `motors/feetech` tables and notes. The bytes are those of DYNAMIXEL Protocol 1.0
//! ([`crate::dynamixel1::packet`]). SCS differs in its words, which are big-endian (a matter of
//! the control table), and in that it knows neither sync read nor a ping to everyone.
//!
//! Bad packets and unknown instructions are ignored; the status's error byte holds the state bits
//! of the Status register.

use crate::dynamixel1::packet;
use crate::exchange::{Answer, Ask, Exchange, Order, hearing, in_turn, with_id};
use crate::family::Family;
use crate::servo::{Refusal, Servo};
use gaitway_profiles::{Protocol, Role};

const BROADCAST: u8 = 0xFE;
const FAMILY: Family = Family::Feetech;
/// The maker's SDK has room for 255 bytes in all.
const MOST_ASKED: u8 = 249;

const PING: u8 = 0x01;
const READ: u8 = 0x02;
const WRITE: u8 = 0x03;
const REG_WRITE: u8 = 0x04;
const ACTION: u8 = 0x05;
const RESET: u8 = 0x06;
const SYNC_READ: u8 = 0x82;
const SYNC_WRITE: u8 = 0x83;

/// Lets the servos that hear carry out a packet that ended at `at_ns`.
pub(crate) fn answer(packet: &[u8], servos: &mut [Servo], at_ns: u64) -> Exchange {
    let (id, code, params) = packet::open(packet);
    match (code, id) {
        (SYNC_READ, BROADCAST) => sync_read(servos, params, at_ns),
        (SYNC_WRITE, BROADCAST) => sync_write(servos, params, at_ns),
        (PING, BROADCAST) => broadcast_ping(servos, at_ns),
        (WRITE | REG_WRITE | ACTION | RESET, BROADCAST) => {
            for (_, servo) in hearing(servos, FAMILY) {
                let _ = act(servo, code, params, at_ns);
            }
            Exchange::nothing()
        }
        (PING | READ | WRITE | REG_WRITE | ACTION | RESET, _) => {
            unicast(servos, id, code, params, at_ns)
        }
        _ => Exchange::nothing(),
    }
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
        let level = servo.value(Role::StatusReturnLevel).unwrap_or(1);
        let mut out = Vec::new();
        let said = match code {
            PING => true,
            READ => match *params {
                [address, length] if length <= MOST_ASKED => {
                    servo.read(address.into(), length.into(), &mut out).is_ok()
                }
                _ => false,
            },
            _ => act(servo, code, params, at_ns).is_ok() && level >= 1,
        };
        if said {
            let bytes = packet::status(id, servo.status_error(), &out);
            answers.push(Answer::given(index, id, bytes, delay_ns));
        }
    }
    Exchange { order: Order::Together, answers }
}

fn act(servo: &mut Servo, code: u8, params: &[u8], at_ns: u64) -> Result<(), Refusal> {
    match (code, params) {
        (WRITE, &[address, ref bytes @ ..]) => servo.write(address.into(), bytes, at_ns),
        (REG_WRITE, &[address, ref bytes @ ..]) => servo.register(address.into(), bytes),
        (ACTION, []) => servo.action(at_ns),
        (RESET, []) => {
            servo.factory_reset(at_ns, &[Role::Id]);
            Ok(())
        }
        _ => Err(Refusal::Length),
    }
}

fn sync_read(servos: &mut [Servo], params: &[u8], at_ns: u64) -> Exchange {
    let &[address, length, ref ids @ ..] = params else { return Exchange::nothing() };
    let ids = if length <= MOST_ASKED { ids } else { &[] };
    let ask = |&id: &u8| Ask { id, address: u16::from(address), length: usize::from(length) };
    let asks: Vec<Ask> = ids.iter().map(ask).collect();
    in_turn(servos, FAMILY, &asks, packet::STATUS_OVERHEAD, |servo, ask| {
        if !knows_groups(servo) {
            return None;
        }
        servo.advance(at_ns);
        let mut out = Vec::with_capacity(ask.length);
        servo.read(ask.address, ask.length, &mut out).ok()?;
        Some(packet::status(ask.id, servo.status_error(), &out))
    })
}

fn knows_groups(servo: &Servo) -> bool {
    servo.model.protocol == Protocol::FeetechSts
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

fn broadcast_ping(servos: &mut [Servo], at_ns: u64) -> Exchange {
    let mut answers = Vec::new();
    for (index, servo) in hearing(servos, FAMILY).filter(|(_, servo)| knows_groups(servo)) {
        servo.advance(at_ns);
        let bytes = packet::status(servo.id(), servo.status_error(), &[]);
        answers.push(Answer::given(index, servo.id(), bytes, servo.return_delay_ns()));
    }
    answers.sort_by_key(|answer| answer.id);
    Exchange { order: Order::Slots, answers }
}
