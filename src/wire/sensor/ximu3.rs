//! x-io x-IMU3: `T,timestamp,args\r\n` lines, and binary messages of the same content.
//!
//! Source: x-io Technologies, x-IMU3 user manual, chapter on the communication protocol. A binary
//! message is 0x80 + letter, the time in microseconds (u64), then floats, all little-endian, ended
//! by a line feed; a line feed inside is stuffed as in SLIP.

use super::framing::unstuff;
use super::lines::{cells, number};
use super::{MAX_LINE, Reading};
use crate::wire::{Decoded, Reason};

const END: u8 = b'\n';
/// The most arguments a message has that is read here (a quaternion and three more).
const MOST: usize = 9;

pub(super) fn decode(bytes: &[u8]) -> Decoded<Reading> {
    let window = &bytes[..bytes.len().min(MAX_LINE)];
    let Some(end) = window.iter().position(|&byte| byte == END) else {
        return if window.len() < MAX_LINE {
            Decoded::Need(1)
        } else {
            Decoded::Bad(
                Reason::Length { claimed: MAX_LINE + 1, least: 1, most: MAX_LINE },
                MAX_LINE,
            )
        };
    };
    let message = &bytes[..end];
    let read = match message.first() {
        None => return Decoded::Skip(1),
        Some(0x80..) => binary(message),
        Some(_) => ascii(message),
    };
    match read {
        Ok(reading) => Decoded::Packet(reading, end + 1),
        Err(reason) => Decoded::Bad(reason, end + 1),
    }
}

fn binary(message: &[u8]) -> Result<Reading, Reason> {
    let plain = unstuff(message, END).ok_or(Reason::Malformed)?;
    let (letter, rest) = plain.split_first().ok_or(Reason::Malformed)?;
    let letter = letter & 0x7F;
    let (ticks, rest) = rest.split_first_chunk::<8>().ok_or(Reason::Malformed)?;
    let ticks = u64::from_le_bytes(*ticks);
    if arguments(letter).is_none() {
        return other(letter, ticks);
    }
    let (floats, odd) = rest.as_chunks::<4>();
    let mut numbers = [0.0; MOST];
    if !odd.is_empty() || floats.len() > MOST {
        return Err(Reason::Malformed);
    }
    for (number, bytes) in numbers.iter_mut().zip(floats) {
        *number = f64::from(f32::from_le_bytes(*bytes));
    }
    read(letter, ticks, &numbers[..floats.len()])
}

fn ascii(message: &[u8]) -> Result<Reading, Reason> {
    let text = std::str::from_utf8(message).map_err(|_| Reason::Malformed)?.trim_end();
    if text.starts_with('{') {
        return Ok(Reading::default()); // the answer to a command
    }
    let mut cells = cells(text);
    let &[letter] = cells.next().unwrap_or("").as_bytes() else { return Err(Reason::Malformed) };
    let ticks = cells.next().and_then(|cell| cell.parse().ok()).ok_or(Reason::Malformed)?;
    if arguments(letter).is_none() {
        return other(letter, ticks);
    }
    let mut numbers = [0.0; MOST];
    let mut given = 0;
    for cell in cells {
        *numbers.get_mut(given).ok_or(Reason::Malformed)? = number(cell)?;
        given += 1;
    }
    read(letter, ticks, &numbers[..given])
}

/// How many numbers a message of this letter has, if it is one that is read here.
const fn arguments(letter: u8) -> Option<usize> {
    match letter {
        b'I' => Some(6),
        b'M' | b'A' => Some(3),
        b'Q' => Some(4),
        b'L' | b'E' => Some(7),
        b'T' => Some(1),
        _ => None,
    }
}

/// A message of a letter that is not read here: nothing but its time, if it is a letter at all.
fn other(letter: u8, ticks: u64) -> Result<Reading, Reason> {
    if letter.is_ascii_uppercase() {
        Ok(Reading { ticks: Some(ticks), ..Reading::default() })
    } else {
        Err(Reason::Id(letter))
    }
}

fn read(letter: u8, ticks: u64, numbers: &[f64]) -> Result<Reading, Reason> {
    if arguments(letter) != Some(numbers.len()) {
        return Err(Reason::Malformed);
    }
    let mut reading = Reading { ticks: Some(ticks), ..Reading::default() };
    match (letter, numbers) {
        (b'I', &[gx, gy, gz, ax, ay, az]) => {
            reading.angular_rate = Some([gx, gy, gz]);
            reading.acceleration = Some([ax, ay, az]);
        }
        (b'M', &[x, y, z]) => reading.magnetic_field = Some([x, y, z]),
        (b'A', &[roll, pitch, yaw]) => reading.euler = Some([roll, pitch, yaw]),
        // The three numbers after it are acceleration without gravity, which is no specific force.
        (b'Q' | b'L' | b'E', &[w, x, y, z, ..]) => reading.quaternion = Some([w, x, y, z]),
        (b'T', &[celsius]) => reading.temperature = Some(celsius),
        _ => {}
    }
    Ok(reading)
}
