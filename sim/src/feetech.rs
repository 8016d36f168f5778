//! FEETECH STS/SMS protocol, the device's side.
//!
//! Source: the maker's SDK as public in adityakamath/SCServo_Linux (`INST.h`, `SCS.cpp`) and
//! LeRobot's `motors/feetech` tables. The frame is that of DYNAMIXEL Protocol 1.0:
//! `FF FF ID LEN INST params CHK`. Example: `FF FF 01 02 01 FB` pings ID 1, which answers
//! `FF FF 01 02 00 FC`. Servos with big-endian words (SCS) are not done.
//!
//! Bad packets and unknown instructions are ignored; the status's error byte holds the state bits
//! of the Status register.

use crate::exchange::{Answer, Exchange, Order, Scan};
use crate::servo::{Refusal, Servo};
use gaitway_profiles::Role;

const BROADCAST: u8 = 0xFE;
const STATUS_OVERHEAD: usize = 6;

const PING: u8 = 0x01;
const READ: u8 = 0x02;
const WRITE: u8 = 0x03;
const REG_WRITE: u8 = 0x04;
const ACTION: u8 = 0x05;
const RESET: u8 = 0x06;
const SYNC_READ: u8 = 0x82;
const SYNC_WRITE: u8 = 0x83;

/// What stands at the start of `bytes`.
pub(crate) fn scan(bytes: &[u8]) -> Scan {
    let common = bytes.iter().take(2).take_while(|&&byte| byte == 0xFF).count();
    if common < 2 && common < bytes.len() {
        let next = bytes.iter().skip(1).position(|&byte| byte == 0xFF);
        return Scan::Skip(next.map_or(bytes.len(), |at| at + 1));
    }
    let &[_, _, id, length, ..] = bytes else {
        // A third FF belongs to a header that begins one byte later.
        return if bytes.get(2) == Some(&0xFF) { Scan::Skip(1) } else { Scan::Incomplete };
    };
    if id == 0xFF || length < 2 {
        return Scan::Skip(1);
    }
    let total = usize::from(length) + 4;
    match bytes.get(..total) {
        None => Scan::Incomplete,
        Some(packet) if checksum(&packet[2..total - 1]) == packet[total - 1] => Scan::Packet(total),
        Some(_) => Scan::Skip(1),
    }
}

fn checksum(bytes: &[u8]) -> u8 {
    !bytes.iter().fold(0_u8, |sum, &byte| sum.wrapping_add(byte))
}

fn status(id: u8, error: u8, params: &[u8]) -> Vec<u8> {
    let mut packet = vec![0xFF, 0xFF, id, (params.len() + 2) as u8, error];
    packet.extend_from_slice(params);
    packet.push(checksum(&packet[2..]));
    packet
}

/// Makes the checksum of a status good again after its bytes were changed.
pub(crate) fn reseal(packet: &mut [u8]) {
    if let [_, _, body @ .., sum] = packet {
        *sum = checksum(body);
    }
}

/// Lets the servos that hear carry out a packet that ended at `at_ns`.
pub(crate) fn answer(packet: &[u8], servos: &mut [Servo], at_ns: u64) -> Exchange {
    let (id, code) = (packet[2], packet[4]);
    let params = &packet[5..packet.len() - 1];
    match (code, id) {
        (SYNC_READ, BROADCAST) => sync_read(servos, params, at_ns),
        (SYNC_WRITE, BROADCAST) => sync_write(servos, params, at_ns),
        (PING, BROADCAST) => broadcast_ping(servos, at_ns),
        (WRITE | REG_WRITE | ACTION | RESET, BROADCAST) => {
            for servo in servos.iter_mut().filter(|servo| servo.hears) {
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

fn error(servo: &Servo) -> u8 {
    servo.hardware_error() as u8
}

fn unicast(servos: &mut [Servo], id: u8, code: u8, params: &[u8], at_ns: u64) -> Exchange {
    let mut answers = Vec::new();
    let asked = if code == READ { params.get(1).map_or(0, |&n| usize::from(n)) } else { 0 };
    for (index, servo) in servos.iter_mut().enumerate() {
        if !servo.attached || servo.id() != id {
            continue;
        }
        let delay_ns = servo.return_delay_ns();
        if !servo.hears {
            answers.push(Answer::missing(id, STATUS_OVERHEAD + asked, delay_ns));
            continue;
        }
        servo.advance(at_ns);
        let level = servo.value(Role::StatusReturnLevel).unwrap_or(1);
        let mut out = Vec::new();
        let said = match code {
            PING => true,
            READ => match *params {
                [address, length] if length <= 249 => {
                    servo.read(address.into(), length.into(), &mut out).is_ok()
                }
                _ => false,
            },
            _ => act(servo, code, params, at_ns).is_ok() && level >= 1,
        };
        if said {
            let bytes = status(id, error(servo), &out);
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
    let wire_length = STATUS_OVERHEAD + usize::from(length);
    let mut answers = Vec::with_capacity(ids.len());
    // The length byte of a status cannot say more.
    let ids = if length <= 249 { ids } else { &[] };
    for &id in ids {
        let mut delay_ns = 0;
        let mut given = false;
        for (index, servo) in servos.iter_mut().enumerate() {
            if !servo.attached || servo.id() != id {
                continue;
            }
            delay_ns = servo.return_delay_ns();
            if !servo.hears {
                continue;
            }
            servo.advance(at_ns);
            let mut out = Vec::with_capacity(length.into());
            if servo.read(address.into(), length.into(), &mut out).is_ok() {
                let bytes = status(id, error(servo), &out);
                answers.push(Answer { twin: given, ..Answer::given(index, id, bytes, delay_ns) });
                given = true;
            }
        }
        if !given {
            answers.push(Answer::missing(id, wire_length, delay_ns));
        }
    }
    Exchange { order: Order::Chained, answers }
}

fn sync_write(servos: &mut [Servo], params: &[u8], at_ns: u64) -> Exchange {
    let &[address, length, ref entries @ ..] = params else { return Exchange::nothing() };
    let size = usize::from(length) + 1;
    if entries.len().is_multiple_of(size) {
        for entry in entries.chunks_exact(size) {
            for servo in servos.iter_mut().filter(|servo| servo.hears && servo.id() == entry[0]) {
                let _ = servo.write(address.into(), &entry[1..], at_ns);
            }
        }
    }
    Exchange::nothing()
}

fn broadcast_ping(servos: &mut [Servo], at_ns: u64) -> Exchange {
    let mut answers = Vec::new();
    for (index, servo) in servos.iter_mut().enumerate().filter(|(_, servo)| servo.hears) {
        servo.advance(at_ns);
        let bytes = status(servo.id(), error(servo), &[]);
        answers.push(Answer::given(index, servo.id(), bytes, servo.return_delay_ns()));
    }
    answers.sort_by_key(|answer| answer.id);
    Exchange { order: Order::Slots, answers }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_status_of_position_2048_and_speed_minus_100_is_sign_and_magnitude() {
        // Computed by the frame's rules; -100 is 100 with bit 15 set.
        let expected = [0xFF, 0xFF, 0x01, 0x06, 0x00, 0x00, 0x08, 0x64, 0x80, 0x0C];
        assert_eq!(status(1, 0, &[0x00, 0x08, 0x64, 0x80]), expected);
    }

    #[test]
    fn a_third_ff_before_the_id_is_skipped() {
        assert_eq!(scan(&[0xFF, 0xFF, 0xFF, 0x01, 0x02, 0x01, 0xFB]), Scan::Skip(1));
        assert_eq!(scan(&[0xFF, 0xFF, 0x01, 0x02, 0x01, 0xFB]), Scan::Packet(6));
        assert_eq!(scan(&[0xFF, 0xFF, 0x01, 0x02, 0x01, 0xFA]), Scan::Skip(1));
        assert_eq!(scan(&[0xFF, 0xFF, 0x01]), Scan::Incomplete);
    }

    proptest! {
        #[test]
        fn any_bytes_are_scanned_to_an_end(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
            let mut rest = &bytes[..];
            while let Scan::Skip(n) | Scan::Packet(n) = scan(rest) {
                prop_assert!(n > 0 && n <= rest.len());
                rest = &rest[n..];
            }
        }
    }
}
