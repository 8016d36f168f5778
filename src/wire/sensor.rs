//! Sensor streams: what an inertial sensor sends unasked, in the sensor's own numbers.
//!
//! A [`Reading`] holds the numbers as they were sent: counts, or the floats of a protocol that
//! sends floats. Units, scales and axes are facts of the device and are applied above this room.
//! Which bytes are a packet is told by a [`Format`]; a [`Stream`] keeps what arrived so far:
//!
//! ```
//! use gaitway::wire::sensor::{Format, Stream};
//!
//! // WitMotion: acceleration 0, 0, 2048 counts and 25.00 degrees Celsius, in two portions.
//! let bytes = [0x55, 0x51, 0x00, 0x00, 0x00, 0x00, 0x00, 0x08, 0xC4, 0x09, 0x7B];
//! let mut stream = Stream::new(Format::WitMotion);
//! let mut readings = Vec::new();
//! for portion in bytes.chunks(7) {
//!     stream.push(portion, |reading| readings.push(reading));
//! }
//! assert_eq!(readings[0].acceleration, Some([0.0, 0.0, 2048.0]));
//! assert_eq!(readings[0].temperature, Some(2500.0));
//! ```
//!
//! How all of them find their feet again: a packet whose check fails is dropped up to the next
//! place where a packet may begin, be it inside it. Formats without a check (the Bluetooth packet
//! of WitMotion, the MPU packet, plain lines) can take a damaged packet for a whole one; whoever
//! uses them must expect an implausible value now and then.
//!
//! Not done: pressure, position and satellite fields, which are passed over by their length.

mod bno08x;
mod columns;
pub mod framing;
mod lines;
pub mod slimevr;
mod teapot;
#[cfg(test)]
mod tests;
mod vectornav;
mod witmotion;
mod ximu3;
mod xsens;

pub use columns::{Column, ColumnError, Number};
pub use lines::Lines;

use super::{Decoded, Reason};

/// Longest line of text or framed record, bytes.
pub const MAX_LINE: usize = 512;

/// One packet of a sensor in its own numbers; what it does not carry is absent. A packet may hold
/// a part of a sample only (WitMotion), or nothing that is known here.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reading {
    /// Specific force, x, y, z.
    pub acceleration: Option<[f64; 3]>,
    /// Acceleration without gravity, x, y, z.
    pub linear_acceleration: Option<[f64; 3]>,
    /// Angular rate, x, y, z.
    pub angular_rate: Option<[f64; 3]>,
    /// Magnetic field, x, y, z.
    pub magnetic_field: Option<[f64; 3]>,
    /// Orientation of the sensor in its world, w, x, y, z.
    pub quaternion: Option<[f64; 4]>,
    /// The same as roll, pitch, yaw: turns about x, y, z, yaw applied first.
    pub euler: Option<[f64; 3]>,
    /// Temperature.
    pub temperature: Option<f64>,
    /// Packet counter.
    pub counter: Option<u64>,
    /// The device's clock.
    pub ticks: Option<u64>,
    /// Axes of the world the orientation is told in, where the packet says so.
    pub world: Option<World>,
}

/// Axes of the world an orientation is told in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum World {
    /// X east, Y north, Z up.
    EastNorthUp,
    /// X north, Y east, Z down.
    NorthEastDown,
    /// X north, Y west, Z up.
    NorthWestUp,
    /// X left, Y up, Z forward.
    LeftUpForward,
}

/// How the bytes of a stream are laid out.
#[derive(Clone, Debug, PartialEq)]
pub enum Format {
    /// `55 TYPE`, 11 bytes, sum. WitMotion, "Standard Protocol" (WIT-MOTION gitbook).
    WitMotion,
    /// `55 61`, 20 bytes, no sum: acceleration, angular rate, angle. WitMotion, BLE 5.0 protocol.
    WitMotionBle,
    /// `AA AA`, 19 bytes, sum. BNO080 data sheet 1.3, section 1.3.5.2.
    Bno08xRvc,
    /// `FA FF`, MTData2. Xsens, "MT Low Level Communication Protocol".
    Xsens,
    /// `FA GROUPS`, CRC. VectorNav VN-100 user manual (UM001), "Binary Output Messages".
    VectorNavBinary,
    /// `$VN...*HH`. The same manual, "Asynchronous Output Messages".
    VectorNavAscii,
    /// Lines of text and stuffed binary messages. x-IMU3 user manual, section "Data messages".
    XImu3,
    /// `24 02`, 14 bytes. Jeff Rowberg's i2cdevlib, sketch MPU6050_DMP6, "teapot" output.
    Teapot,
    /// Lines of text in declared columns.
    Lines(Lines),
    /// COBS frames, each a record of little-endian numbers in declared columns.
    Cobs(Vec<Column>),
    /// SLIP frames (RFC 1055), likewise.
    Slip(Vec<Column>),
}

/// Tells what lies at the front of `bytes`, received from a stream of this format.
#[must_use]
pub fn decode(format: &Format, bytes: &[u8]) -> Decoded<Reading> {
    if bytes.is_empty() {
        return Decoded::Need(1);
    }
    match format {
        Format::WitMotion => witmotion::decode(bytes),
        Format::WitMotionBle => witmotion::decode_ble(bytes),
        Format::Bno08xRvc => bno08x::decode(bytes),
        Format::Xsens => xsens::decode(bytes),
        Format::VectorNavBinary => vectornav::decode_binary(bytes),
        Format::VectorNavAscii => vectornav::decode_ascii(bytes),
        Format::XImu3 => ximu3::decode(bytes),
        Format::Teapot => teapot::decode(bytes),
        Format::Lines(lines) => lines.decode(bytes),
        Format::Cobs(columns) => framing::decode_cobs_record(bytes, columns),
        Format::Slip(columns) => framing::decode_slip_record(bytes, columns),
    }
}

/// What a stream has seen so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Whole packets.
    pub packets: u64,
    /// Beginnings of packets that were none.
    pub bad: u64,
    /// Bytes that belong to no whole packet.
    pub stray_bytes: u64,
}

/// A stream of one format: bytes in, readings out.
#[derive(Clone, Debug)]
pub struct Stream {
    format: Format,
    received: Vec<u8>,
    counts: Counts,
}

impl Stream {
    /// A stream from which nothing was received yet.
    #[must_use]
    pub const fn new(format: Format) -> Self {
        Self { format, received: Vec::new(), counts: Counts { packets: 0, bad: 0, stray_bytes: 0 } }
    }

    /// Takes more bytes and hands over every reading they complete, in order. Keeps no more than
    /// the beginning of one packet.
    pub fn push(&mut self, bytes: &[u8], mut found: impl FnMut(Reading)) {
        self.received.extend_from_slice(bytes);
        let mut start = 0;
        loop {
            match decode(&self.format, &self.received[start..]) {
                Decoded::Need(_) => break,
                Decoded::Packet(reading, taken) => {
                    self.counts.packets += 1;
                    start += taken;
                    found(reading);
                }
                Decoded::Bad(_, taken) => {
                    self.counts.bad += 1;
                    self.counts.stray_bytes += taken as u64;
                    start += taken;
                }
                Decoded::Skip(taken) | Decoded::Echo(taken) => {
                    self.counts.stray_bytes += taken as u64;
                    start += taken;
                }
            }
        }
        self.received.drain(..start);
    }

    /// The line was gone: the beginning of a packet that was received has no end any more.
    pub fn forget(&mut self) {
        self.received.clear();
    }

    /// What was seen so far.
    #[must_use]
    pub const fn counts(&self) -> Counts {
        self.counts
    }
}

/// Bytes from the front to the next place where `header` may begin, at least one.
fn to_next(bytes: &[u8], header: &[u8]) -> usize {
    (1..bytes.len()).find(|&at| may_begin(&bytes[at..], header)).unwrap_or(bytes.len())
}

/// True if `bytes` begin with `header`, as far as they go.
fn may_begin(bytes: &[u8], header: &[u8]) -> bool {
    let known = bytes.len().min(header.len());
    bytes[..known] == header[..known]
}

/// A packet of `total` bytes that begins with `header`; `read` is given all of them.
fn fixed(
    bytes: &[u8],
    header: &[u8],
    total: usize,
    read: impl FnOnce(&[u8]) -> Result<Reading, Reason>,
) -> Decoded<Reading> {
    if !may_begin(bytes, header) {
        return Decoded::Skip(to_next(bytes, header));
    }
    let Some(packet) = bytes.get(..total) else { return Decoded::Need(total - bytes.len()) };
    match read(packet) {
        Ok(reading) => Decoded::Packet(reading, total),
        Err(reason) => Decoded::Bad(reason, to_next(bytes, header)),
    }
}

/// Low byte of the sum.
fn sum(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0, |sum: u8, &byte| sum.wrapping_add(byte))
}

fn same(expected: u16, actual: u16) -> Result<(), Reason> {
    if expected == actual { Ok(()) } else { Err(Reason::Checksum { expected, actual }) }
}

/// Little-endian signed words.
fn words<const N: usize>(bytes: &[u8]) -> [f64; N] {
    let (words, _) = bytes.as_chunks::<2>();
    let mut out = [f64::NAN; N];
    out.iter_mut().zip(words).for_each(|(out, word)| *out = f64::from(i16::from_le_bytes(*word)));
    out
}
