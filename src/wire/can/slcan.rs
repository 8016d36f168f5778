//! The text in which a USB-CAN adapter on a serial line takes commands and tells frames (slcan).
//!
//! Sources: Lawicel, "CANUSB manual" 1.0D and "CAN232 manual" V3 (commands, answers, status flags, time stamps);
//! Linux, `drivers/net/can/slcan/slcan-core.c` (`s`, the controller's state, and `e`, errors of the line); the
//! README of CANable 2.0's firmware for CAN FD (`d`, `D`, `b`, `B`, `Y`).
//!
//! Every line ends with a carriage return, a refusal is a bell. There is no check sum: what has not exactly the
//! length that it tells of itself is not believed, and counted.

use super::error_frame::{self as bits, ErrorFrame};
use super::{CanFrame, CanId, Format};

/// Ends whatever was begun: three of them, as the manual has it.
pub const GREETING: &[u8] = b"\r\r\r";
/// Closes the channel; the adapter leaves the line.
pub const CLOSE: &[u8] = b"C\r";
/// Opens the channel.
pub const OPEN: &[u8] = b"O\r";
/// Frames are told without time stamps.
pub const WITHOUT_STAMPS: &[u8] = b"Z0\r";
/// Asks for the firmware's version.
pub const ASK_VERSION: &[u8] = b"V\r";
/// Asks for the status flags, which are cleared by that.
pub const ASK_STATUS: &[u8] = b"F\r";

/// Bit rates that an adapter can be told, bit/s, by the digit after `S`.
pub const RATES_BPS: [u32; 9] =
    [10_000, 20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 800_000, 1_000_000];
/// Bit rates of fast payloads (CANable 2.0), bit/s, with the digit after `Y`.
const DATA_RATES_BPS: [(u32, u8); 4] =
    [(1_000_000, b'1'), (2_000_000, b'2'), (4_000_000, b'4'), (5_000_000, b'5')];
/// Payload lengths above eight bytes, from length code 9 on.
const FD_LENGTHS: [usize; 7] = [12, 16, 20, 24, 32, 48, 64];
/// The longest line that means anything: an extended frame of CAN FD with a time stamp, with room for words.
const LONGEST: usize = 256;
/// Digits of a time stamp (`Z1`): milliseconds of a minute.
const STAMP: usize = 4;

/// The command that sets the line's bit rate; none if adapters know no such rate.
#[must_use]
pub fn rate_command(bitrate_bps: u32) -> Option<[u8; 3]> {
    let digit = (b'0'..).zip(RATES_BPS).find(|&(_, bps)| bps == bitrate_bps)?.0;
    Some([b'S', digit, b'\r'])
}

/// The command that sets the bit rate of fast payloads; none if adapters know no such rate.
#[must_use]
pub fn data_rate_command(bitrate_bps: u32) -> Option<[u8; 3]> {
    let digit = DATA_RATES_BPS.iter().find(|&&(bps, _)| bps == bitrate_bps)?.1;
    Some([b'Y', digit, b'\r'])
}

/// Appends the command that sends `frame`.
pub fn write_frame(frame: &CanFrame, out: &mut Vec<u8>) {
    let (letter, length) = match frame.format() {
        Format::Classic => (b't', frame.payload().len()),
        Format::Remote { length } => (b'r', length.into()),
        Format::Fd { fast: false } => (b'd', length_code(frame.payload().len())),
        Format::Fd { fast: true } => (b'b', length_code(frame.payload().len())),
    };
    let extended = frame.id().is_extended();
    out.push(if extended { letter.to_ascii_uppercase() } else { letter });
    let digits = if extended { 8 } else { 3 };
    out.extend((0..digits).rev().map(|place| digit(frame.id().number() >> (4 * place))));
    out.push(digit(length as u32));
    for &byte in frame.payload() {
        out.extend([digit(u32::from(byte >> 4)), digit(u32::from(byte))]);
    }
    out.push(b'\r');
}

/// The lowest four bits as a digit.
const fn digit(number: u32) -> u8 {
    let low = (number & 0xF) as u8;
    if low < 10 { b'0' + low } else { b'A' + low - 10 }
}

/// How a payload's length is written; a frame has no other lengths.
fn length_code(bytes: usize) -> usize {
    FD_LENGTHS.iter().position(|&length| length == bytes).map_or(bytes, |place| 9 + place)
}

/// What an adapter says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SlcanSaid {
    /// A frame of the line.
    Frame(CanFrame),
    /// A command was taken.
    Taken,
    /// A frame was taken, to be sent.
    Sent,
    /// A command or a frame was refused.
    Refused,
    /// Its status, in answer to `F`; none if all is well.
    Status(Option<ErrorFrame>),
    /// The controller's state changed, or the line had errors.
    Report(ErrorFrame),
    /// Its version, in answer to `V`.
    Version,
}

/// Makes what an adapter says of its bytes, as they come.
#[derive(Clone, Debug, Default)]
pub struct SlcanReader {
    line: Vec<u8>,
    is_too_long: bool,
    garbled: u64,
}

impl SlcanReader {
    /// Takes a byte; what ended with it, if that means anything.
    pub fn next(&mut self, byte: u8) -> Option<SlcanSaid> {
        match byte {
            b'\r' | 0x07 => {
                let line = std::mem::take(&mut self.line);
                let is_whole = !std::mem::take(&mut self.is_too_long);
                if byte == 0x07 {
                    // A bell stands by itself: what was before it was cut off.
                    self.garbled += u64::from(!line.is_empty());
                    return Some(SlcanSaid::Refused);
                }
                let said = if is_whole { understood(&line) } else { None };
                self.garbled += u64::from(said.is_none());
                said
            }
            // Some adapters end their lines as on a typewriter.
            b'\n' => None,
            _ => {
                self.is_too_long |= self.line.len() >= LONGEST;
                if !self.is_too_long {
                    self.line.push(byte);
                }
                None
            }
        }
    }

    /// Lines that meant nothing, so far: bytes were lost on the way, or nobody knows this answer.
    #[must_use]
    pub const fn garbled(&self) -> u64 {
        self.garbled
    }
}

fn understood(line: &[u8]) -> Option<SlcanSaid> {
    match line {
        [] => Some(SlcanSaid::Taken),
        [b'z' | b'Z'] => Some(SlcanSaid::Sent),
        [b't' | b'T' | b'r' | b'R' | b'd' | b'D' | b'b' | b'B', ..] => {
            frame(line).map(SlcanSaid::Frame)
        }
        [b'F', flags @ ..] if flags.len() == 2 => Some(SlcanSaid::Status(status(hex(flags)?))),
        [b's', state, counters @ ..] => state_report(*state, counters).map(SlcanSaid::Report),
        [b'e', count, errors @ ..] => error_report(*count, errors).map(SlcanSaid::Report),
        _ => is_version(line).then_some(SlcanSaid::Version),
    }
}

/// Lawicel's adapters answer `V1013`, CANables with the name of their firmware.
fn is_version(line: &[u8]) -> bool {
    let words = line.to_ascii_lowercase();
    let names = |name: &[u8]| words.windows(name.len()).any(|part| part == name);
    // A line that only echoes says V as well.
    let has_number = words.iter().any(u8::is_ascii_digit);
    line.is_ascii() && (words[0] == b'v' && has_number || names(b"canable") || names(b"slcan"))
}

fn frame(line: &[u8]) -> Option<CanFrame> {
    let (&letter, rest) = line.split_first()?;
    let extended = letter.is_ascii_uppercase();
    let (number, rest) = rest.split_at_checked(if extended { 8 } else { 3 })?;
    let number = hex(number)?;
    let id = if extended { CanId::extended(number) } else { CanId::standard(number) }?;
    let (length, digits) = rest.split_at_checked(1)?;
    let code = hex(length)? as usize;
    let format = match letter.to_ascii_lowercase() {
        b't' => Format::Classic,
        b'r' => Format::Remote { length: u8::try_from(code).ok()? },
        letter => Format::Fd { fast: letter == b'b' },
    };
    let count = match format {
        Format::Remote { .. } => 0,
        Format::Classic => code,
        Format::Fd { .. } => code.checked_sub(9).map_or(code, |place| FD_LENGTHS[place]),
    };
    let (digits, stamp) = digits.split_at_checked(2 * count)?;
    if !(stamp.is_empty() || stamp.len() == STAMP && hex(stamp).is_some()) {
        return None;
    }
    let bytes = digits.chunks(2).map(|pair| hex(pair).map(|byte| byte as u8));
    let payload: Vec<u8> = bytes.collect::<Option<_>>()?;
    CanFrame::new(id, format, &payload)
}

/// At most eight digits as a number.
fn hex(digits: &[u8]) -> Option<u32> {
    digits
        .iter()
        .try_fold(0_u32, |number, &digit| Some(number << 4 | char::from(digit).to_digit(16)?))
}

/// What the flags of `F` say: queues full (bits 0 and 1), many errors, overrun, error passive (bit 5), arbitration
/// lost, bus error. Bit 4 means nothing.
fn status(flags: u32) -> Option<ErrorFrame> {
    let is_set = |bit: u32| flags >> bit & 1 != 0;
    let mut controller = 0;
    for (bit, meaning) in [
        (0, bits::RECEIVE_OVERFLOW),
        (1, bits::SEND_OVERFLOW),
        (2, bits::WARNING),
        (3, bits::RECEIVE_OVERFLOW),
        (5, bits::PASSIVE),
    ] {
        controller |= if is_set(bit) { meaning } else { 0 };
    }
    let mut classes = if controller == 0 { 0 } else { bits::CONTROLLER };
    for (bit, meaning) in [(6, bits::LOST_ARBITRATION), (7, bits::BUS_ERROR)] {
        classes |= if is_set(bit) { meaning } else { 0 };
    }
    (classes != 0).then(|| ErrorFrame::decode(classes, &[0, controller]))
}

/// That a frame was refused by the adapter, which has no room for it, or says no more.
#[must_use]
pub fn refusal() -> ErrorFrame {
    ErrorFrame::decode(bits::CONTROLLER, &[0, bits::SEND_OVERFLOW])
}

/// The controller's state, with its counters of errors in receiving and in sending.
fn state_report(state: u8, counters: &[u8]) -> Option<ErrorFrame> {
    let (receiving, sending) = counters.split_at_checked(3)?;
    let count = |digits: &[u8]| -> Option<u8> {
        let number: u16 = std::str::from_utf8(digits).ok()?.parse().ok()?;
        Some(u8::try_from(number).unwrap_or(u8::MAX))
    };
    let counters = [count(sending).filter(|_| sending.len() == 3)?, count(receiving)?];
    let (class, controller) = match state {
        b'a' => (bits::CONTROLLER, bits::ACTIVE),
        b'w' => (bits::CONTROLLER, bits::WARNING),
        b'p' => (bits::CONTROLLER, bits::PASSIVE),
        b'b' => (bits::BUS_OFF, 0),
        _ => return None,
    };
    let payload = [0, controller, 0, 0, 0, 0, counters[0], counters[1]];
    Some(ErrorFrame::decode(class | bits::COUNTERS, &payload))
}

/// Errors of the line, a letter each: not acknowledged, bits, check sum, form, stuffing; frames lost either way.
fn error_report(count: u8, errors: &[u8]) -> Option<ErrorFrame> {
    if usize::from(count.wrapping_sub(b'0')) != errors.len() || errors.is_empty() {
        return None;
    }
    let (mut classes, mut controller) = (bits::BUS_ERROR, 0);
    for error in errors {
        match error {
            b'a' => classes |= bits::NO_ACK,
            b'b' | b'B' | b'c' | b'f' | b's' => classes |= bits::PROTOCOL,
            b'o' => controller |= bits::RECEIVE_OVERFLOW,
            b'O' => controller |= bits::SEND_OVERFLOW,
            _ => return None,
        }
    }
    classes |= if controller == 0 { 0 } else { bits::CONTROLLER };
    Some(ErrorFrame::decode(classes, &[0, controller]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn heard(bytes: &[u8]) -> (Vec<SlcanSaid>, u64) {
        let mut reader = SlcanReader::default();
        let said = bytes.iter().filter_map(|&byte| reader.next(byte)).collect();
        (said, reader.garbled())
    }

    fn classic(number: u32, extended: bool, payload: &[u8]) -> CanFrame {
        let id = if extended { CanId::extended(number) } else { CanId::standard(number) };
        CanFrame::new(id.expect("fits"), Format::Classic, payload).expect("fits")
    }

    fn written(frame: &CanFrame) -> String {
        let mut out = Vec::new();
        write_frame(frame, &mut out);
        String::from_utf8(out).expect("text")
    }

    // Lawicel's manual: t10021133, T0000010021133, r1002, R000001002. Linux: t4563112233, T12ABCDEF2AA55.
    #[test]
    fn frames_are_those_of_the_manual() {
        let remote = |id: Option<CanId>| {
            CanFrame::new(id.expect("fits"), Format::Remote { length: 2 }, &[]).expect("fits")
        };
        for (text, frame) in [
            ("t10021133\r", classic(0x100, false, &[0x11, 0x33])),
            ("T0000010021133\r", classic(0x100, true, &[0x11, 0x33])),
            ("r1002\r", remote(CanId::standard(0x100))),
            ("R000001002\r", remote(CanId::extended(0x100))),
            ("t1230\r", classic(0x123, false, &[])),
            ("t4563112233\r", classic(0x456, false, &[0x11, 0x22, 0x33])),
            ("T12ABCDEF2AA55\r", classic(0x12AB_CDEF, true, &[0xAA, 0x55])),
        ] {
            assert_eq!(written(&frame), text);
            assert_eq!(heard(text.as_bytes()), (vec![SlcanSaid::Frame(frame)], 0), "{text}");
        }
    }

    #[test]
    fn frames_with_a_time_stamp_or_small_letters_are_the_same_frames() {
        let frame = SlcanSaid::Frame(classic(0x0FE, false, &[0xAB]));
        for text in ["t0FE1AB\r", "t0FE1AB03E9\r", "t0fe1ab03e9\r", "t0FE1AB\r\n"] {
            assert_eq!(heard(text.as_bytes()), (vec![frame], 0), "{text}");
        }
    }

    #[test]
    fn what_lacks_a_digit_or_has_one_too_many_is_no_frame() {
        let whole = "t100811223344556677FE";
        for left_out in 1..whole.len() {
            let text = format!("{}{}\r", &whole[..left_out], &whole[left_out + 1..]);
            assert_eq!(heard(text.as_bytes()), (vec![], 1), "{text}");
        }
        for text in [
            "t",
            "t1",
            "t100",
            "t1009",
            "t8000",
            "T200000000",
            "t1001G0",
            "t1000FF",
            "r1009",
            "d100G",
        ] {
            assert_eq!(heard(format!("{text}\r").as_bytes()), (vec![], 1), "{text}");
        }
        // The return between two was lost: neither is believed.
        assert_eq!(heard(b"t1001AAt1001BB\r"), (vec![], 1));
    }

    #[test]
    fn answers_are_told_apart() {
        use SlcanSaid::{Refused, Report, Sent, Taken, Version};
        let (said, garbled) = heard(b"\rz\rZ\r\x07V1013\rF00\r");
        assert_eq!(said, [Taken, Sent, Sent, Refused, Version, SlcanSaid::Status(None)]);
        assert_eq!(garbled, 0);
        // What only echoes is no adapter.
        assert_eq!(heard(b"V\r").0, []);
        assert_eq!(heard(b"CANable-b158aa7 github.com/normaldotcom/canable-fw.git\r").0, [Version]);
        assert_eq!(heard(b"t1001A\x07"), (vec![Refused], 1), "cut off by a bell");
        assert_eq!(heard(b"hello\rF0G\r$GPGGA,1,2\r"), (vec![], 3));
        let Some(Report(off)) = heard(b"sb000255\r").0.pop() else { panic!("no report") };
        assert!(off.bus_off());
        assert_eq!(off.counters(), Some([255, 0]), "sending, receiving");
        let Some(Report(active)) = heard(b"sa057033\r").0.pop() else { panic!("no report") };
        assert!(active.recovered() && active.counters() == Some([33, 57]));
        assert_eq!(heard(b"sx000000\rsa00000\rsa0000000\r"), (vec![], 3));
    }

    #[test]
    fn status_flags_and_errors_say_what_is_wrong() {
        for (text, words) in [
            ("F01\r", "frames lost in the controller"),
            ("F02\r", "frames lost in the controller"),
            ("F08\r", "frames lost in the controller"),
            ("F04\r", "many errors"),
            ("F20\r", "error passive"),
            ("F40\r", "arbitration lost"),
            ("FA4\r", "error passive, many errors, bus error"),
        ] {
            let Some(SlcanSaid::Status(Some(report))) = heard(text.as_bytes()).0.pop() else {
                panic!("{text} is no status")
            };
            assert_eq!(report.to_string(), words, "{text}");
        }
        // Linux: e1a, no acknowledgement; e3bcO, bit 0, check sum, overrun in sending.
        for (text, words) in [
            ("e1a\r", "no acknowledgement, bus error"),
            ("e3bcO\r", "frames lost in the controller, protocol violated, bus error"),
        ] {
            let Some(SlcanSaid::Report(report)) = heard(text.as_bytes()).0.pop() else {
                panic!("{text} is no report")
            };
            assert_eq!(report.to_string(), words, "{text}");
        }
        assert_eq!(heard(b"e2a\re0\re1x\r"), (vec![], 3));
        assert!(refusal().overflow());
    }

    #[test]
    fn only_the_bit_rates_of_the_manual_can_be_said() {
        assert_eq!(rate_command(1_000_000).as_ref(), Some(b"S8\r"));
        assert_eq!(rate_command(500_000).as_ref(), Some(b"S6\r"));
        assert_eq!(rate_command(10_000).as_ref(), Some(b"S0\r"));
        assert_eq!(
            rate_command(750_000),
            None,
            "S7, to some adapters; to others that is 800 kbit/s"
        );
        assert_eq!(data_rate_command(5_000_000).as_ref(), Some(b"Y5\r"));
        assert_eq!(data_rate_command(3_000_000), None);
    }

    #[test]
    fn a_line_without_end_is_passed_over_and_takes_no_memory() {
        let mut reader = SlcanReader::default();
        for _ in 0..1_000_000 {
            assert_eq!(reader.next(b't'), None);
        }
        assert!(reader.line.capacity() <= 2 * LONGEST);
        assert_eq!(reader.next(b'\r'), None);
        assert_eq!(reader.garbled(), 1);
        assert_eq!(reader.next(b'z').or_else(|| reader.next(b'\r')), Some(SlcanSaid::Sent));
    }

    proptest! {
        #[test]
        fn every_frame_is_heard_as_it_was_written(
            number in 0_u32..0x2000_0000,
            extended in any::<bool>(),
            kind in 0..4,
            bytes in proptest::collection::vec(any::<u8>(), 64),
            length in 0_usize..16,
        ) {
            let id = if extended { CanId::extended(number) } else { CanId::standard(number & 0x7FF) };
            let (format, length) = match kind {
                0 => (Format::Classic, length % 9),
                1 => (Format::Remote { length: (length % 9) as u8 }, 0),
                kind => (
                    Format::Fd { fast: kind == 3 },
                    length.checked_sub(9).map_or(length, |place| FD_LENGTHS[place]),
                ),
            };
            let frame = CanFrame::new(id.expect("fits"), format, &bytes[..length]).expect("fits");
            let said = heard(written(&frame).as_bytes());
            prop_assert_eq!(said, (vec![SlcanSaid::Frame(frame)], 0));
        }

        #[test]
        fn any_bytes_give_something_and_a_frame_is_understood_after_them(
            bytes in proptest::collection::vec(any::<u8>(), 0..600),
        ) {
            let mut reader = SlcanReader::default();
            for &byte in &bytes {
                let _ = reader.next(byte);
            }
            let said: Vec<_> = b"\rt1001AA\r".iter().filter_map(|&b| reader.next(b)).collect();
            prop_assert_eq!(said.last(), Some(&SlcanSaid::Frame(classic(0x100, false, &[0xAA]))));
        }
    }
}
