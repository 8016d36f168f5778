//! Xsens MTi: `FA FF MID LEN data SUM`, and the items of MTData2. All big-endian.
//!
//! Source: Xsens, "MT Low Level Communication Protocol Documentation", sections on message
//! structure and MTData2. An item is `id(2) size(1) bytes`; the low nibble of the id says the
//! number format (bits 0 and 1) and the axes of the world (bits 2 and 3). Unknown items are passed
//! over by their size.

use super::{Reading, World, may_begin, same, sum, to_next};
use crate::wire::{Decoded, Reason};

const HEADER: [u8; 2] = [0xFA, 0xFF];
/// Preamble, bus id, message id, length.
const HEAD: usize = 4;
const MTDATA2: u8 = 0x36;
/// Longest data accepted; devices send at most a few hundred bytes.
const MOST: usize = 1024;

pub(super) fn decode(bytes: &[u8]) -> Decoded<Reading> {
    if !may_begin(bytes, &HEADER) {
        return Decoded::Skip(to_next(bytes, &HEADER));
    }
    let Some(&[_, _, message, short]) = bytes.get(..HEAD) else {
        return Decoded::Need(HEAD + 1 - bytes.len());
    };
    let (start, length) = match (short, bytes.get(HEAD..HEAD + 2)) {
        (0xFF, None) => return Decoded::Need(HEAD + 3 - bytes.len()),
        (0xFF, Some(long)) => (HEAD + 2, usize::from(u16::from_be_bytes([long[0], long[1]]))),
        (short, _) => (HEAD, usize::from(short)),
    };
    if length > MOST {
        let reason = Reason::Length { claimed: length, least: 0, most: MOST };
        return Decoded::Bad(reason, to_next(bytes, &HEADER));
    }
    let total = start + length + 1;
    let Some(packet) = bytes.get(..total) else { return Decoded::Need(total - bytes.len()) };
    let read = same(0, u16::from(sum(&packet[1..]))).and_then(|()| match message {
        MTDATA2 => items(&packet[start..start + length]),
        _ => Ok(Reading::default()),
    });
    match read {
        Ok(reading) => Decoded::Packet(reading, total),
        Err(reason) => Decoded::Bad(reason, to_next(bytes, &HEADER)),
    }
}

fn items(mut rest: &[u8]) -> Result<Reading, Reason> {
    let mut reading = Reading::default();
    while let [high, low, size, after @ ..] = rest {
        let body = after.get(..usize::from(*size)).ok_or(Reason::Malformed)?;
        rest = &after[body.len()..];
        let id = u16::from_be_bytes([*high, *low]);
        match id & 0xFFF0 {
            0x1020 => reading.counter = unsigned::<2>(body),
            0x1060 => reading.ticks = unsigned::<4>(body),
            0x2010 => {
                reading.quaternion = numbers(id, body);
                reading.world = Some(world(id));
            }
            0x2030 => {
                reading.euler = numbers(id, body);
                reading.world = Some(world(id));
            }
            0x4020 => reading.acceleration = numbers(id, body),
            0x8020 => reading.angular_rate = numbers(id, body),
            0xC020 => reading.magnetic_field = numbers(id, body),
            0x0810 => reading.temperature = numbers::<1>(id, body).map(|[celsius]| celsius),
            _ => {}
        }
    }
    if rest.is_empty() { Ok(reading) } else { Err(Reason::Malformed) }
}

fn world(id: u16) -> World {
    match id & 0xC {
        0x4 => World::NorthEastDown,
        0x8 => World::NorthWestUp,
        _ => World::EastNorthUp,
    }
}

fn unsigned<const N: usize>(body: &[u8]) -> Option<u64> {
    let bytes: [u8; N] = body.try_into().ok()?;
    Some(bytes.iter().fold(0, |value, &byte| value << 8 | u64::from(byte)))
}

/// N numbers in the format the id names; `None` if the size is another.
fn numbers<const N: usize>(id: u16, body: &[u8]) -> Option<[f64; N]> {
    let width = [4, 4, 6, 8][usize::from(id & 3)];
    if body.len() != N * width {
        return None;
    }
    let mut out = [0.0; N];
    for (out, bytes) in out.iter_mut().zip(body.chunks_exact(width)) {
        *out = number(id, bytes)?;
    }
    Some(out)
}

fn number(id: u16, bytes: &[u8]) -> Option<f64> {
    Some(match (id & 3, bytes) {
        (0, _) => f64::from(f32::from_be_bytes(bytes.try_into().ok()?)),
        (1, _) => f64::from(i32::from_be_bytes(bytes.try_into().ok()?)) / f64::from(1 << 20),
        // 16.32: the fraction comes first, then the whole part.
        (2, [fraction @ .., high, low]) => {
            let fraction = u32::from_be_bytes(fraction.try_into().ok()?);
            f64::from(i16::from_be_bytes([*high, *low])) + f64::from(fraction) / 2_f64.powi(32)
        }
        (3, _) => f64::from_be_bytes(bytes.try_into().ok()?),
        _ => return None,
    })
}
