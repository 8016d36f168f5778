//! mjbots moteus: CAN FD frames of subframes that write and read registers.
//!
//! ```text
//! identifier    0 | reply wanted 1 | source 7 | 0 | destination 7
//! subframe      operation, type and count | (count) | first register | values
//! ```
//!
//! A register is written and read as a float or as an integer of 8, 16 or 32 bits, each with a step
//! of its own; the smallest integer means "no number". Positions are in revolutions, velocities in
//! rev/s, torques in N m.
//!
//! Source: mjbots/moteus 00d474b0, `docs/reference.md` (sections A and B of the protocol); newer
//! faults and modes from its `fw/error.h` and from `protocol.py` of moteus 1.1.1.

use super::{CanFrame, CanId, Faults, Feedback, Format, MAX_PAYLOAD, Number, fd_length};

/// A device or host id, 0 to 127.
pub type Id = crate::wire::Id<127>;

/// How a number travels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Resolution {
    /// One byte.
    Int8 = 0,
    /// Two bytes.
    Int16 = 1,
    /// Four bytes.
    Int32 = 2,
    /// Four bytes, IEEE 754.
    Float = 3,
}

impl Resolution {
    const fn of(bits: u8) -> Self {
        match bits & 3 {
            0 => Self::Int8,
            1 => Self::Int16,
            2 => Self::Int32,
            _ => Self::Float,
        }
    }

    const fn bytes(self) -> usize {
        match self {
            Self::Int8 => 1,
            Self::Int16 => 2,
            Self::Int32 | Self::Float => 4,
        }
    }
}

/// Values of neighbouring registers to be written.
#[derive(Clone, Copy, Debug)]
pub enum Values<'a> {
    /// In steps of one byte.
    Int8(&'a [i8]),
    /// In steps of two bytes.
    Int16(&'a [i16]),
    /// In steps of four bytes.
    Int32(&'a [i32]),
    /// As floats; not-a-number stands for "leave it to the device".
    Float(&'a [f32]),
}

const WRITE: u8 = 0x00;
const READ: u8 = 0x10;
const REPLY: u8 = 0x20;
const WRITE_ERROR: u32 = 0x30;
const READ_ERROR: u32 = 0x31;
const STREAM_TO_DEVICE: u8 = 0x40;
const STREAM_TO_HOST: u32 = 0x41;
const STREAM_POLL: u8 = 0x42;
const NOTHING: u8 = 0x50;

/// The subframe does not fit into the frame any more. The message is left as it was.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("no more than {MAX_PAYLOAD} bytes go into a frame, and no subframe without a register")]
pub struct DoesNotFit;

/// Between whom a message goes, and how.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Route {
    /// The host's id.
    pub source: Id,
    /// The device's id.
    pub destination: Id,
    /// Whether the device shall answer; reads need it.
    pub reply: bool,
    /// Whether the payload goes at the fast bit rate.
    pub fast: bool,
}

/// Subframes for one device, under construction.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Message {
    bytes: Vec<u8>,
}

impl Message {
    /// Writes registers from `start` on.
    ///
    /// # Errors
    /// No values, or more than go into a frame.
    pub fn write(&mut self, start: u16, values: Values<'_>) -> Result<(), DoesNotFit> {
        let mut sent = Vec::new();
        let resolution = match values {
            Values::Int8(values) => {
                sent.extend(values.iter().map(|x| x.cast_unsigned()));
                Resolution::Int8
            }
            Values::Int16(values) => {
                sent.extend(values.iter().flat_map(|x| x.to_le_bytes()));
                Resolution::Int16
            }
            Values::Int32(values) => {
                sent.extend(values.iter().flat_map(|x| x.to_le_bytes()));
                Resolution::Int32
            }
            Values::Float(values) => {
                sent.extend(values.iter().flat_map(|x| x.to_le_bytes()));
                Resolution::Float
            }
        };
        let count = sent.len() / resolution.bytes();
        self.subframe(WRITE, resolution, start, count, &sent)
    }

    /// Asks for `count` registers from `start` on.
    ///
    /// # Errors
    /// None asked for, or an answer or a question longer than a frame.
    pub fn read(
        &mut self,
        resolution: Resolution,
        start: u16,
        count: usize,
    ) -> Result<(), DoesNotFit> {
        if count > MAX_PAYLOAD / resolution.bytes() {
            return Err(DoesNotFit);
        }
        self.subframe(READ, resolution, start, count, &[])
    }

    /// Sends text to the device's console (channel 1), or bytes to another channel.
    ///
    /// # Errors
    /// More than goes into a frame.
    pub fn stream(&mut self, channel: u8, text: &[u8]) -> Result<(), DoesNotFit> {
        let length = u8::try_from(text.len()).map_err(|_| DoesNotFit)?;
        self.append(&[&[STREAM_TO_DEVICE, channel & 0x7F, length & 0x7F], text].concat())
    }

    /// Asks for at most `length` bytes of the device's console.
    ///
    /// # Errors
    /// The message is full.
    pub fn poll_stream(&mut self, channel: u8, length: u8) -> Result<(), DoesNotFit> {
        self.append(&[STREAM_POLL, channel & 0x7F, length.min(61)])
    }

    fn subframe(
        &mut self,
        operation: u8,
        resolution: Resolution,
        start: u16,
        count: usize,
        values: &[u8],
    ) -> Result<(), DoesNotFit> {
        let code = operation | (resolution as u8) << 2;
        let mut bytes = match u8::try_from(count).map_err(|_| DoesNotFit)? {
            0 => return Err(DoesNotFit),
            few @ 1..=3 => vec![code | few],
            many => vec![code, many],
        };
        put_varuint(&mut bytes, start);
        bytes.extend_from_slice(values);
        self.append(&bytes)
    }

    fn append(&mut self, bytes: &[u8]) -> Result<(), DoesNotFit> {
        if self.bytes.len() + bytes.len() > MAX_PAYLOAD {
            return Err(DoesNotFit);
        }
        self.bytes.extend_from_slice(bytes);
        Ok(())
    }

    /// The message as a frame, filled up with "nothing" to a length CAN FD has.
    #[must_use]
    pub fn frame(&self, route: Route) -> CanFrame {
        let asked = if route.reply { 0x80 } else { 0 };
        let number =
            u32::from(asked | route.source.get()) << 8 | u32::from(route.destination.get());
        let id = CanId::standard(number).unwrap_or(CanId::extended_of(number));
        let length = fd_length(self.bytes.len()).unwrap_or(MAX_PAYLOAD);
        let mut bytes = [NOTHING; MAX_PAYLOAD];
        bytes[..self.bytes.len()].copy_from_slice(&self.bytes);
        bytes[length..].fill(0);
        let format = Format::Fd { fast: route.fast };
        CanFrame { id, format, bytes, length: length as u8 }
    }
}

/// Seven bits a byte, lowest first.
fn put_varuint(out: &mut Vec<u8>, number: u16) {
    let mut left = number;
    while left > 0x7F {
        out.push(left as u8 | 0x80);
        left >>= 7;
    }
    out.push(left as u8);
}

/// One thing a device says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Part<'a> {
    /// The value of a register; none if the device has no number for it.
    Value(u32, Option<Number>),
    /// A register could not be read or written; the device's code for why.
    Refused(u32, u32),
    /// Bytes of a console.
    Stream(u32, &'a [u8]),
    /// What follows cannot be read.
    Malformed,
}

/// From whom to whom a frame goes, if it may be one of this dialect.
#[must_use]
pub fn ends(frame: &CanFrame) -> Option<(Id, Id)> {
    let number = frame.id().number();
    if number >> 16 != 0 || matches!(frame.format(), Format::Remote { .. }) {
        return None;
    }
    Some((Id::new((number >> 8) as u8 & 0x7F)?, Id::new(number as u8)?))
}

/// What a device says in the payload of a frame, in order.
pub fn parts(payload: &[u8]) -> impl Iterator<Item = Part<'_>> {
    let mut reader = Reader { left: payload, values: None };
    std::iter::from_fn(move || reader.next())
}

/// Feedback out of a reply of `id`: whatever of mode, position, velocity, torque, temperature and
/// fault it tells. Integers are in steps of the resolution that was asked for.
#[must_use]
pub fn feedback(id: Id, frame: &CanFrame) -> Option<Feedback> {
    let (source, _) = ends(frame)?;
    let asked_by_a_host = frame.id().number() & 0x8000 != 0;
    if source != id || asked_by_a_host {
        return None;
    }
    let mut feedback = Feedback::default();
    for part in parts(frame.payload()) {
        let Part::Value(register, number) = part else { continue };
        match u16::try_from(register).unwrap_or(u16::MAX) {
            register::MODE => {
                feedback.enabled =
                    number.and_then(whole).map(|mode| matches!(mode, 5..=10 | 12..=15));
            }
            register::POSITION => feedback.position = number,
            register::VELOCITY => feedback.velocity = number,
            register::TORQUE => feedback.torque = number,
            register::TEMPERATURE => feedback.temperature = number,
            register::FAULT => {
                let told = number.and_then(whole).map_or(Faults::NONE, faults);
                feedback.faults = feedback.faults.and(told);
            }
            _ => {}
        }
        if register == u32::from(register::MODE) && number.and_then(whole) == Some(MODE_TIMEOUT) {
            feedback.faults = feedback.faults.and(Faults::SILENCE);
        }
    }
    Some(feedback)
}

const MODE_TIMEOUT: i32 = 11;

fn whole(number: Number) -> Option<i32> {
    match number {
        Number::Steps(steps) => Some(steps),
        Number::Value(value) => Some(value as i32),
        Number::Code { .. } => None,
    }
}

/// From 96 to 105 it names the limit it is at, and goes on.
const fn faults(code: i32) -> Faults {
    match code {
        0 | 96..=105 => Faults::NONE,
        32 | 36 | 41 => Faults::NOT_CALIBRATED,
        33 | 44 => Faults::DRIVER,
        34 => Faults::OVER_VOLTAGE,
        35 | 42 | 43 => Faults::ENCODER,
        38 => Faults::HOT,
        39 | 48 => Faults::OUT_OF_RANGE,
        40 => Faults::UNDER_VOLTAGE,
        _ => Faults::OTHER,
    }
}

/// Values of one subframe that were not yet handed out.
#[derive(Clone, Copy)]
struct Run {
    resolution: Resolution,
    register: u32,
    count: u32,
}

struct Reader<'a> {
    left: &'a [u8],
    values: Option<Run>,
}

impl<'a> Reader<'a> {
    fn next(&mut self) -> Option<Part<'a>> {
        loop {
            if let Some(run) = self.values.filter(|run| run.count > 0) {
                return Some(self.value(run).unwrap_or_else(|| self.malformed()));
            }
            while let [NOTHING, rest @ ..] = self.left {
                self.left = rest;
            }
            if self.left.is_empty() {
                return None;
            }
            match self.subframe() {
                Some(Some(part)) => return Some(part),
                Some(None) => {}
                None => return Some(self.malformed()),
            }
        }
    }

    fn malformed(&mut self) -> Part<'a> {
        self.left = &[];
        self.values = None;
        Part::Malformed
    }

    fn byte(&mut self) -> Option<u8> {
        let (first, rest) = self.left.split_first()?;
        self.left = rest;
        Some(*first)
    }

    fn varuint(&mut self) -> Option<u32> {
        let mut number = 0;
        for k in 0..5 {
            let byte = self.byte()?;
            number |= u32::from(byte & 0x7F).checked_shl(7 * k).unwrap_or(0);
            if byte & 0x80 == 0 {
                return Some(number);
            }
        }
        None
    }

    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.left.split_at_checked(count)?;
        self.left = rest;
        Some(taken)
    }

    /// One subframe; nothing of it yet to hand out if it is the head of a run of values.
    fn subframe(&mut self) -> Option<Option<Part<'a>>> {
        let code = self.varuint()?;
        match code {
            WRITE_ERROR | READ_ERROR => {
                let register = self.varuint()?;
                Some(Some(Part::Refused(register, self.varuint()?)))
            }
            STREAM_TO_HOST => {
                let channel = self.varuint()?;
                let length = self.varuint()? as usize;
                Some(Some(Part::Stream(channel, self.take(length)?)))
            }
            _ if code & !0x0F == u32::from(REPLY) => {
                let resolution = Resolution::of((code >> 2) as u8);
                let count = if code & 3 == 0 { self.varuint()? } else { code & 3 };
                let register = self.varuint()?;
                self.values = Some(Run { resolution, register, count });
                Some(None)
            }
            _ => None,
        }
    }

    fn value(&mut self, run: Run) -> Option<Part<'a>> {
        let Run { resolution, register, count } = run;
        let bytes = self.take(resolution.bytes())?;
        let number = match (resolution, bytes) {
            (Resolution::Int8, &[a]) => integer(a.cast_signed().into(), i8::MIN.into()),
            (Resolution::Int16, &[a, b]) => {
                integer(i16::from_le_bytes([a, b]).into(), i16::MIN.into())
            }
            (Resolution::Int32, &[a, b, c, d]) => {
                integer(i32::from_le_bytes([a, b, c, d]), i32::MIN)
            }
            (Resolution::Float, &[a, b, c, d]) => {
                let value = f32::from_le_bytes([a, b, c, d]);
                (!value.is_nan()).then_some(Number::Value(value))
            }
            _ => return None,
        };
        let next = Run { resolution, register: register.wrapping_add(1), count: count - 1 };
        self.values = Some(next);
        Some(Part::Value(register, number))
    }
}

fn integer(steps: i32, none: i32) -> Option<Number> {
    (steps != none).then_some(Number::Steps(steps))
}

/// Numbers of the registers used here.
pub mod register {
    /// 0 stopped, 1 fault, 10 position, 11 timeout.
    pub const MODE: u16 = 0x000;
    /// Position.
    pub const POSITION: u16 = 0x001;
    /// Velocity.
    pub const VELOCITY: u16 = 0x002;
    /// Torque.
    pub const TORQUE: u16 = 0x003;
    /// Temperature of the board.
    pub const TEMPERATURE: u16 = 0x00E;
    /// Code of the fault in mode 1.
    pub const FAULT: u16 = 0x00F;
    /// First of the eight of a position command: position, velocity, torque, scales of kp and kd,
    /// largest torque, position to stop at, watchdog in seconds.
    pub const COMMAND: u16 = 0x020;
    /// Seconds of silence after which it goes to mode 11.
    pub const WATCHDOG: u16 = 0x027;
}

/// Mode: stopped, lets go.
pub const MODE_STOPPED: i8 = 0;
/// Mode: obeys position commands.
pub const MODE_POSITION: i8 = 10;

#[cfg(test)]
mod tests {
    use super::*;

    fn id(number: u8) -> Id {
        Id::new(number).expect("an id")
    }

    // The worked example of `reference.md`: to 0x8001, and what came back under 0x100.
    #[test]
    fn the_example_of_the_reference_is_encoded_byte_by_byte() {
        let mut message = Message::default();
        message.write(register::MODE, Values::Int8(&[10])).expect("fits");
        let half_turn = Values::Int16(&[0x0060, 0x0120, -176]);
        message.write(register::COMMAND, half_turn).expect("fits");
        message.read(Resolution::Int16, register::MODE, 4).expect("fits");
        message.read(Resolution::Int8, 0x00D, 3).expect("fits");
        let route = Route { source: id(0), destination: id(1), reply: true, fast: true };
        let frame = message.frame(route);
        assert_eq!(Some(frame.id()), CanId::extended(0x8001));
        let expected = [
            0x01, 0x00, 0x0A, 0x07, 0x20, 0x60, 0x00, 0x20, 0x01, 0x50, 0xFF, 0x14, 0x04, 0x00,
            0x13, 0x0D,
        ];
        assert_eq!(frame.payload(), expected);
        assert_eq!(frame.format(), Format::Fd { fast: true });
    }

    #[test]
    fn the_example_reply_is_decoded_register_by_register() {
        let bytes = [
            0x24, 0x04, 0x00, 0x0A, 0x00, 0x50, 0x00, 0x00, 0x01, 0x70, 0xFF, 0x23, 0x0D, 0x18,
            0x14, 0x00,
        ];
        let id_100 = CanId::standard(0x100).expect("fits");
        let frame = CanFrame::new(id_100, Format::Fd { fast: true }, &bytes).expect("fits");
        assert_eq!(ends(&frame), Some((id(1), id(0))));
        let values: Vec<_> = parts(frame.payload()).collect();
        let value = |register, steps| Part::Value(register, Some(Number::Steps(steps)));
        let expected = [
            value(0, 10),
            value(1, 0x50),
            value(2, 0x100),
            value(3, -144),
            value(0x0D, 24),
            value(0x0E, 20),
            value(0x0F, 0),
        ];
        assert_eq!(values, expected);
        let feedback = feedback(id(1), &frame).expect("his");
        assert_eq!(feedback.enabled, Some(true));
        assert_eq!(feedback.position, Some(Number::Steps(0x50)));
        assert_eq!(feedback.temperature, Some(Number::Steps(20)));
        assert_eq!(super::feedback(id(2), &frame), None);
    }

    #[test]
    fn a_message_is_filled_up_to_a_length_can_fd_has() {
        let mut message = Message::default();
        message.write(register::COMMAND, Values::Float(&[0.5, 0.0])).expect("fits");
        let route = Route { source: id(0), destination: id(1), reply: false, fast: false };
        let frame = message.frame(route);
        assert_eq!(frame.id(), CanId::standard(1).expect("fits"));
        assert_eq!(frame.payload(), [0x0E, 0x20, 0, 0, 0, 0x3F, 0, 0, 0, 0, 0x50, 0x50]);
    }

    #[test]
    fn what_does_not_fit_leaves_the_message_as_it_was() {
        let mut message = Message::default();
        message.write(register::COMMAND, Values::Float(&[0.0; 15])).expect("63 bytes");
        let before = message.clone();
        assert_eq!(message.read(Resolution::Int8, 0, 1), Err(DoesNotFit));
        assert_eq!(message.write(0, Values::Int8(&[])), Err(DoesNotFit));
        assert_eq!(message.read(Resolution::Float, 0, 17), Err(DoesNotFit));
        assert_eq!(message, before);
    }

    #[test]
    fn the_smallest_integer_is_no_number() {
        let values: Vec<_> = parts(&[0x21, 0x01, 0x80, 0x25, 0x01, 0x00, 0x80]).collect();
        assert_eq!(values, [Part::Value(1, None), Part::Value(1, None)]);
    }

    #[test]
    fn a_reply_cut_short_gives_what_is_there() {
        let values: Vec<_> = parts(&[0x26, 0x01, 0x10, 0x00, 0x20]).collect();
        assert_eq!(values, [Part::Value(1, Some(Number::Steps(0x10))), Part::Malformed]);
    }

    #[test]
    fn refusals_and_console_are_told_apart() {
        let values: Vec<_> =
            parts(&[0x31, 0xA0, 0x02, 0x01, 0x41, 0x01, 0x02, b'O', b'K']).collect();
        assert_eq!(values, [Part::Refused(0x120, 1), Part::Stream(1, b"OK")]);
        let mut message = Message::default();
        message.stream(1, b"d stop\n").expect("fits");
        message.poll_stream(1, 48).expect("fits");
        let route = Route { source: id(0), destination: id(1), reply: true, fast: true };
        assert_eq!(message.frame(route).payload()[..13], *b"\x40\x01\x07d stop\n\x42\x01\x30");
    }

    #[test]
    fn a_limit_it_is_at_is_no_fault() {
        let at = |code: u8| {
            let bytes = [0x21, 0x0F, code];
            let id_100 = CanId::standard(0x100).expect("fits");
            let frame = CanFrame::new(id_100, Format::Fd { fast: false }, &bytes).expect("fits");
            feedback(id(1), &frame).expect("his").faults
        };
        assert_eq!([at(0), at(96), at(103), at(105)], [Faults::NONE; 4]);
        assert_eq!((at(40), at(43)), (Faults::UNDER_VOLTAGE, Faults::ENCODER));
        assert_eq!((at(95), at(106)), (Faults::OTHER, Faults::OTHER));
    }

    #[test]
    fn the_watchdog_mode_is_a_silent_host() {
        let id_100 = CanId::standard(0x100).expect("fits");
        // Register 0x00F, no fault, is told behind the mode.
        for bytes in [&[0x21, 0x00, 0x0B][..], &[0x21, 0x00, 0x0B, 0x21, 0x0F, 0x00]] {
            let frame = CanFrame::new(id_100, Format::Fd { fast: false }, bytes).expect("fits");
            let feedback = feedback(id(1), &frame).expect("his");
            assert!(feedback.faults.any(Faults::SILENCE), "{bytes:02X?}");
        }
    }
}
