//! WitMotion: `55 TYPE d0..d7 SUM`, four little-endian words; one sample comes as several packets.
//!
//! Source: WitMotion, "WIT Standard Protocol" and the HWT905 protocol page. (The formula given
//! there for the sum of the time packet omits a byte; the sum is of all bytes before it.)

use super::{Reading, fixed, same, sum, words};
use crate::wire::{Decoded, Reason};

const HEADER: u8 = 0x55;
/// Time, acceleration, ... up to the answer to a register read.
const TYPES: std::ops::RangeInclusive<u8> = 0x50..=0x5F;

pub(super) fn decode(bytes: &[u8]) -> Decoded<Reading> {
    fixed(bytes, &[HEADER], 11, |packet| {
        same(u16::from(sum(&packet[..10])), u16::from(packet[10]))?;
        if !TYPES.contains(&packet[1]) {
            return Err(Reason::Id(packet[1]));
        }
        Ok(read(packet[1], &packet[2..10]))
    })
}

fn read(kind: u8, payload: &[u8]) -> Reading {
    let [x, y, z, fourth] = words(payload);
    let (three, empty) = (Some([x, y, z]), Reading::default());
    match kind {
        0x50 => Reading { ticks: Some(milliseconds(payload)), ..empty },
        0x51 => Reading { acceleration: three, temperature: Some(fourth), ..empty },
        // Some models send a voltage in the place of the temperature here.
        0x52 => Reading { angular_rate: three, ..empty },
        0x53 => Reading { euler: three, ..empty },
        0x54 => Reading { magnetic_field: three, ..empty },
        0x59 => Reading { quaternion: Some([x, y, z, fourth]), ..empty },
        _ => empty,
    }
}

/// `YY MM DD hh mm ss msL msH` as milliseconds since the year 2000. Every month counts 31 days: what
/// matters is that time rises, and a sample at midnight on the last of a month may wait.
fn milliseconds(payload: &[u8]) -> u64 {
    let at = |index: usize| u64::from(payload.get(index).copied().unwrap_or(0));
    let days = (at(0) * 12 + at(1)) * 31 + at(2);
    let seconds = ((days * 24 + at(3)) * 60 + at(4)) * 60 + at(5);
    seconds * 1000 + at(6) + 256 * at(7)
}

/// The packet of the Bluetooth models: no sum, and a sample is whole. `55 71` answers a register
/// read: 0x3A is the magnetic field, 0x51 the quaternion, 0x40 the temperature.
pub(super) fn decode_ble(bytes: &[u8]) -> Decoded<Reading> {
    fixed(bytes, &[HEADER], 20, |packet| {
        let payload = &packet[2..];
        match packet[1] {
            0x61 => {
                let [ax, ay, az, gx, gy, gz, roll, pitch, yaw] = words(payload);
                Ok(Reading {
                    acceleration: Some([ax, ay, az]),
                    angular_rate: Some([gx, gy, gz]),
                    euler: Some([roll, pitch, yaw]),
                    ..Reading::default()
                })
            }
            0x71 => {
                let register = payload[0];
                let values = words::<4>(&payload[2..]);
                let [x, y, z, _] = values;
                let empty = Reading::default();
                Ok(match register {
                    0x3A => Reading { magnetic_field: Some([x, y, z]), ..empty },
                    0x40 => Reading { temperature: Some(x), ..empty },
                    0x51 => Reading { quaternion: Some(values), ..empty },
                    _ => empty,
                })
            }
            other => Err(Reason::Id(other)),
        }
    })
}
