//! VectorNav: `FA groups fields payload CRC`, and `$VN...,...*HH` lines.
//!
//! Source: VectorNav VN-100 user manual (UM001), "User Configurable Binary Output Messages" and
//! "Asynchronous Output Messages". Field lengths of the groups Common, IMU and Attitude are those
//! printed there; a message with another group is refused, since its length is not known here.
//! Quaternions come scalar last.

use super::lines::{cells, checked, crc, line, number};
use super::{Reading, to_next};
use crate::wire::{Decoded, Reason};

const SYNC: u8 = 0xFA;
/// Bit of a group byte or field word that says another follows: none of ours.
const MORE_GROUPS: u8 = 0x80;
const MORE_FIELDS: u16 = 0x8000;
/// The groups Common, IMU and Attitude as bits of the group byte.
const KNOWN: u8 = 1 | 1 << 2 | 1 << 4;

const COMMON: [usize; 15] = [8, 8, 8, 12, 16, 12, 24, 12, 12, 24, 20, 28, 2, 4, 8];
const IMU: [usize; 13] = [2, 12, 12, 12, 4, 4, 16, 12, 12, 12, 12, 2, 40];
const ATTITUDE: [usize; 12] = [2, 12, 16, 36, 12, 12, 12, 12, 12, 12, 28, 24];

const fn lengths(group: u32) -> &'static [usize] {
    match group {
        0 => &COMMON,
        2 => &IMU,
        4 => &ATTITUDE,
        _ => &[],
    }
}

pub(super) fn decode_binary(bytes: &[u8]) -> Decoded<Reading> {
    if bytes[0] != SYNC {
        return Decoded::Skip(to_next(bytes, &[SYNC]));
    }
    let bad = |reason| Decoded::Bad(reason, to_next(bytes, &[SYNC]));
    let Some(&groups) = bytes.get(1) else { return Decoded::Need(6) };
    if groups == 0 || groups & (!KNOWN | MORE_GROUPS) != 0 {
        return bad(Reason::Id(groups));
    }
    let start = 2 + 2 * groups.count_ones() as usize;
    let Some(words) = bytes.get(2..start) else {
        return Decoded::Need(start + 3 - bytes.len());
    };
    let mut fields = [(0, 0); 3];
    let mut length = 0;
    let of_groups = (0..7).filter(|group| groups & 1 << group != 0);
    for ((slot, group), word) in fields.iter_mut().zip(of_groups).zip(words.chunks_exact(2)) {
        let word = u16::from_le_bytes([word[0], word[1]]);
        let known = lengths(group);
        if word & MORE_FIELDS != 0 || word == 0 || word >> known.len() != 0 {
            return bad(Reason::Malformed);
        }
        length += selected(word, known).map(|(_, length)| length).sum::<usize>();
        *slot = (group, word);
    }
    let total = start + length + 2;
    let Some(packet) = bytes.get(..total) else { return Decoded::Need(total - bytes.len()) };
    let (expected, check) = (crc(&packet[1..total - 2]), &packet[total - 2..]);
    let actual = u16::from_be_bytes([check[0], check[1]]);
    if expected != actual {
        return bad(Reason::Checksum { expected, actual });
    }
    let mut reading = Reading::default();
    let mut payload = &packet[start..total - 2];
    for (group, word) in fields.into_iter().filter(|&(_, word)| word != 0) {
        for (field, length) in selected(word, lengths(group)) {
            let (body, rest) = payload.split_at(length);
            payload = rest;
            take(&mut reading, group, field, body);
        }
    }
    Decoded::Packet(reading, total)
}

/// The fields a word selects, with their lengths.
fn selected(word: u16, lengths: &[usize]) -> impl Iterator<Item = (usize, usize)> {
    lengths.iter().copied().enumerate().filter(move |(field, _)| word & 1 << field != 0)
}

fn take(reading: &mut Reading, group: u32, field: usize, body: &[u8]) {
    match (group, field) {
        (0, 0) => reading.ticks = body.try_into().ok().map(u64::from_le_bytes),
        (0, 3) | (4, 1) => reading.euler = Some(floats(body)).map(|[y, p, r]| [r, p, y]),
        (0, 4) | (4, 2) => reading.quaternion = Some(floats(body)).map(|[x, y, z, w]| [w, x, y, z]),
        (0, 5) | (2, 10) => reading.angular_rate = Some(floats(body)),
        (0, 8) | (2, 9) => reading.acceleration = Some(floats(body)),
        // Uncompensated, which is better than none.
        (0, 9) => {
            let [ax, ay, az, gx, gy, gz] = floats(body);
            reading.acceleration.get_or_insert([ax, ay, az]);
            reading.angular_rate.get_or_insert([gx, gy, gz]);
        }
        (0, 10) => {
            let [mx, my, mz, celsius, _] = floats(body);
            reading.magnetic_field = Some([mx, my, mz]);
            reading.temperature = Some(celsius);
        }
        (2, 8) => reading.magnetic_field = Some(floats(body)),
        (2, 4) => reading.temperature = Some(floats(body)).map(|[celsius]| celsius),
        _ => {}
    }
}

fn floats<const N: usize>(body: &[u8]) -> [f64; N] {
    let (numbers, _) = body.as_chunks::<4>();
    let mut out = [f64::NAN; N];
    out.iter_mut().zip(numbers).for_each(|(out, bytes)| *out = f32::from_le_bytes(*bytes).into());
    out
}

pub(super) fn decode_ascii(bytes: &[u8]) -> Decoded<Reading> {
    line(bytes, |text| {
        let Some(begin) = text.find("$VN") else { return Ok(None) };
        let body = checked(&text[begin..])?;
        let (name, values) = body.split_once(',').unwrap_or((body, ""));
        read_ascii(name, values).map(Some)
    })
}

fn read_ascii(name: &str, values: &str) -> Result<Reading, Reason> {
    let columns: &[usize] = match name {
        "VNYPR" => &[3],
        "VNQTN" => &[4],
        "VNMAG" | "VNACC" | "VNGYR" => &[3],
        "VNMAR" => &[3, 3, 3],
        "VNQMR" => &[4, 3, 3, 3],
        "VNYMR" => &[3, 3, 3, 3],
        "VNIMU" => &[3, 3, 3, 1, 1],
        // Another message, an answer or an error: whole, but nothing for us.
        _ => return Ok(Reading::default()),
    };
    let mut numbers = [0.0; 16];
    let mut given = 0;
    for cell in cells(values) {
        *numbers.get_mut(given).ok_or(Reason::Malformed)? = number(cell)?;
        given += 1;
    }
    if given != columns.iter().sum::<usize>() {
        return Err(Reason::Malformed);
    }
    let three = |at: usize| Some([numbers[at], numbers[at + 1], numbers[at + 2]]);
    let euler = three(0).map(|[yaw, pitch, roll]| [roll, pitch, yaw]);
    let quaternion = Some([numbers[3], numbers[0], numbers[1], numbers[2]]);
    let mut reading = Reading::default();
    match name {
        "VNYPR" => reading.euler = euler,
        "VNQTN" => reading.quaternion = quaternion,
        "VNMAG" => reading.magnetic_field = three(0),
        "VNACC" => reading.acceleration = three(0),
        "VNGYR" => reading.angular_rate = three(0),
        _ => {
            let sensors = match name {
                "VNQMR" => 4,
                "VNYMR" => 3,
                _ => 0,
            };
            reading.magnetic_field = three(sensors);
            reading.acceleration = three(sensors + 3);
            reading.angular_rate = three(sensors + 6);
            reading.quaternion = quaternion.filter(|_| name == "VNQMR");
            reading.euler = euler.filter(|_| name == "VNYMR");
            reading.temperature = Some(numbers[9]).filter(|_| name == "VNIMU");
        }
    }
    Ok(reading)
}
