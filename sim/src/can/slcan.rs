//! A USB-CAN adapter that speaks the text protocol of Lawicel's CANUSB (slcan).
//!
//! Source: Lawicel, "CANUSB manual" 1.0D (commands, answers, status flags, time stamps); Linux,
//! `drivers/net/can/slcan/slcan-core.c` (state messages `s`); CANable 2.0's firmware for what it
//! added for CAN FD: frames `d`, `D`, `b`, `B`, and `Y` for the payload's rate.
//!
//! With a bit rate that is not the line's nothing gets through either way, and the status flags
//! tell of bus errors. Acceptance filters (`M`, `m`, `W`) are taken and not applied; every frame is
//! handed over. An empty command is taken for a greeting, as `slcand` sends it.

use super::{CanFrame, CanHeard, CanOptions, Kind};

const OK: &[u8] = b"\r";
const BELL: &[u8] = b"\x07";
/// Longer than any command; what grows beyond is no command.
const LONGEST: usize = 256;
/// Bit rates by the digit after `S`, bit/s.
const RATES_BPS: [u32; 9] =
    [10_000, 20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 800_000, 1_000_000];
/// Payload lengths by length code.
const LENGTHS: [usize; 16] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64];
/// Status flags: the send queue was full, many errors, error passive, bus error.
const SEND_QUEUE_FULL: u8 = 1 << 1;
const WARNING: u8 = 1 << 2;
const PASSIVE: u8 = 1 << 5;
const BUS_ERROR: u8 = 1 << 7;

/// Whether the channel is open.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Channel {
    Closed,
    Open,
    Listening,
}

/// An adapter on a line, without the terminal it is usually behind.
#[derive(Clone, Debug)]
pub struct Adapter {
    /// Of the line it is on.
    line: CanOptions,
    channel: Channel,
    /// None before one was chosen.
    rate_bps: Option<u32>,
    stamped: bool,
    flags: u8,
    bus_off: bool,
    heard: Vec<u8>,
}

impl Adapter {
    /// An adapter that was just plugged in, on such a line: its channel is closed.
    #[must_use]
    pub fn new(line: CanOptions) -> Adapter {
        Adapter {
            line,
            channel: Channel::Closed,
            rate_bps: None,
            stamped: false,
            flags: 0,
            bus_off: false,
            heard: Vec::new(),
        }
    }

    /// It was pulled out and plugged in again.
    pub fn restart(&mut self) {
        *self = Adapter::new(self.line);
    }

    /// Bytes of the program: what the adapter answers. Frames go to `send`, which says whether
    /// there was room for one.
    pub fn hear(&mut self, bytes: &[u8], mut send: impl FnMut(CanFrame) -> bool) -> Vec<u8> {
        let mut said = Vec::new();
        for &byte in bytes {
            match byte {
                b'\r' => {
                    let command = std::mem::take(&mut self.heard);
                    said.extend(self.obey(&command, &mut send));
                }
                // Some programs end their lines as on a typewriter.
                b'\n' => {}
                _ if self.heard.len() < LONGEST => self.heard.push(byte),
                _ => {}
            }
        }
        said
    }

    fn obey(&mut self, command: &[u8], send: &mut impl FnMut(CanFrame) -> bool) -> Vec<u8> {
        let open = self.channel != Channel::Closed;
        let said = |good: bool| if good { OK.to_vec() } else { BELL.to_vec() };
        match *command {
            [] | [b'U' | b'Q' | b'W' | b'X' | b'Y', _] => OK.to_vec(),
            [b'S', digit] => said(!open && self.set_rate(digit)),
            // The registers of a controller at 8 MHz; whoever sets them knows the line.
            [b's', _, _, _, _] => {
                if !open {
                    self.rate_bps = Some(self.line.bitrate_bps);
                }
                said(!open)
            }
            [b'O'] => said(self.open(Channel::Open)),
            [b'L'] => said(self.open(Channel::Listening)),
            [b'C'] => {
                self.channel = Channel::Closed;
                said(open)
            }
            [b'V'] => b"V1013\r".to_vec(),
            [b'v'] => b"v0100\r".to_vec(),
            [b'N'] => b"NGWAY\r".to_vec(),
            [b'F'] if open => {
                let flags = std::mem::take(&mut self.flags);
                format!("F{flags:02X}\r").into_bytes()
            }
            [b'Z', on @ (b'0' | b'1')] if !open => {
                self.stamped = on == b'1';
                OK.to_vec()
            }
            [b'M' | b'm', _, _, _, _, _, _, _, _] => said(!open),
            [kind @ (b't' | b'T' | b'r' | b'R' | b'd' | b'D' | b'b' | b'B'), ..] => {
                let frame = read(command).filter(|_| self.channel == Channel::Open);
                let taken = frame.is_some_and(|frame| self.carry(frame, send));
                match taken {
                    // Upper case for extended identifiers.
                    true if kind.is_ascii_uppercase() => b"Z\r".to_vec(),
                    true => b"z\r".to_vec(),
                    false => BELL.to_vec(),
                }
            }
            _ => BELL.to_vec(),
        }
    }

    fn set_rate(&mut self, digit: u8) -> bool {
        let rate = match digit {
            b'9' => Some(83_333), // CANable and its kin
            _ => RATES_BPS.get(usize::from(digit.wrapping_sub(b'0'))).copied(),
        };
        self.rate_bps = rate.or(self.rate_bps);
        rate.is_some()
    }

    fn open(&mut self, channel: Channel) -> bool {
        let opens = self.channel == Channel::Closed && self.rate_bps.is_some();
        if opens {
            self.channel = channel;
            self.flags = 0;
        }
        opens
    }

    fn at_the_lines_rate(&self) -> bool {
        self.rate_bps == Some(self.line.bitrate_bps)
    }

    fn carry(&mut self, frame: CanFrame, send: &mut impl FnMut(CanFrame) -> bool) -> bool {
        if self.bus_off || !self.at_the_lines_rate() {
            self.flags |= WARNING | PASSIVE | BUS_ERROR;
            return !self.bus_off;
        }
        let taken = send(frame);
        if !taken {
            self.flags |= SEND_QUEUE_FULL;
        }
        taken
    }

    /// What the program reads of what the adapter has heard at `now_ns`.
    pub fn tell(&mut self, heard: &CanHeard, now_ns: u64) -> Vec<u8> {
        let said = match heard {
            CanHeard::Frame(frame) => {
                if !self.at_the_lines_rate() {
                    self.flags |= WARNING | BUS_ERROR;
                    return Vec::new();
                }
                let mut text = written(frame);
                if self.stamped {
                    text.push_str(&format!("{:04X}", now_ns / 1_000_000 % 60_000));
                }
                text
            }
            // Error counters of receiving and of sending.
            CanHeard::BusOff => {
                self.bus_off = true;
                self.flags |= WARNING | PASSIVE | BUS_ERROR;
                "sb000255".to_string()
            }
            CanHeard::Restarted => {
                self.bus_off = false;
                "sa000000".to_string()
            }
        };
        if self.channel == Channel::Closed {
            return Vec::new();
        }
        (said + "\r").into_bytes()
    }
}

fn hexadecimal(digits: &[u8]) -> Option<u32> {
    digits
        .iter()
        .try_fold(0_u32, |number, &digit| Some(number << 4 | char::from(digit).to_digit(16)?))
}

/// A frame as a program writes it.
fn read(command: &[u8]) -> Option<CanFrame> {
    let (&kind, rest) = command.split_first()?;
    let extended = kind.is_ascii_uppercase();
    let (id, rest) = rest.split_at_checked(if extended { 8 } else { 3 })?;
    let id = hexadecimal(id)?;
    let (&length, digits) = rest.split_first()?;
    let code = hexadecimal(&[length])? as usize;
    let fd = matches!(kind, b'd' | b'D' | b'b' | b'B');
    let remote = matches!(kind, b'r' | b'R');
    let largest = if extended { 0x1FFF_FFFF } else { 0x7FF };
    if id > largest || (!fd && code > 8) {
        return None;
    }
    let length = if remote { 0 } else { LENGTHS[code] };
    if digits.len() != 2 * length {
        return None;
    }
    let bytes = digits.chunks(2).map(|pair| hexadecimal(pair).map(|byte| byte as u8));
    let bytes: Vec<u8> = bytes.collect::<Option<_>>()?;
    let kind = match kind {
        b'r' | b'R' => Kind::Remote(code as u8),
        b'd' | b'D' => Kind::Fd { fast: false },
        b'b' | b'B' => Kind::Fd { fast: true },
        _ => Kind::Classic,
    };
    Some(CanFrame { id, extended, kind, bytes })
}

/// A frame as a program reads it, without the end of the line.
fn written(frame: &CanFrame) -> String {
    let letter = match (frame.kind, frame.extended) {
        (Kind::Classic, false) => 't',
        (Kind::Classic, true) => 'T',
        (Kind::Remote(_), false) => 'r',
        (Kind::Remote(_), true) => 'R',
        (Kind::Fd { fast: false }, false) => 'd',
        (Kind::Fd { fast: false }, true) => 'D',
        (Kind::Fd { fast: true }, false) => 'b',
        (Kind::Fd { fast: true }, true) => 'B',
    };
    let id = if frame.extended { format!("{:08X}", frame.id) } else { format!("{:03X}", frame.id) };
    let length = match frame.kind {
        Kind::Remote(length) => length.into(),
        _ => LENGTHS.iter().position(|&length| length >= frame.bytes.len()).unwrap_or(15),
    };
    let mut bytes = frame.bytes.clone();
    if !matches!(frame.kind, Kind::Remote(_)) {
        bytes.resize(LENGTHS[length], 0);
    }
    let bytes: String = bytes.iter().map(|byte| format!("{byte:02X}")).collect();
    format!("{letter}{id}{length:X}{bytes}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Says one command; the answer and the frame that went out.
    fn say(adapter: &mut Adapter, command: &str) -> (String, Option<CanFrame>) {
        let mut sent = None;
        let said = adapter.hear(format!("{command}\r").as_bytes(), |frame| {
            sent = Some(frame);
            true
        });
        (String::from_utf8(said).expect("text"), sent)
    }

    fn open() -> Adapter {
        let mut adapter = Adapter::new(CanOptions::default());
        for command in ["S8", "O"] {
            assert_eq!(say(&mut adapter, command).0, "\r", "{command}");
        }
        adapter
    }

    // The examples of Lawicel's manual: t10021133, T0000010021133, r1002, R000001002.
    #[test]
    fn frames_are_written_as_in_the_manual() {
        for (text, id, extended, kind, bytes) in [
            ("t10021133", 0x100, false, Kind::Classic, &[0x11, 0x33][..]),
            ("T0000010021133", 0x100, true, Kind::Classic, &[0x11, 0x33]),
            ("r1002", 0x100, false, Kind::Remote(2), &[]),
            ("R000001002", 0x100, true, Kind::Remote(2), &[]),
        ] {
            let frame = CanFrame { id, extended, kind, bytes: bytes.to_vec() };
            let (said, sent) = say(&mut open(), text);
            assert_eq!(said, if extended { "Z\r" } else { "z\r" });
            assert_eq!(sent.as_ref(), Some(&frame));
            let told = open().tell(&CanHeard::Frame(frame), 0);
            assert_eq!(String::from_utf8(told).expect("text"), format!("{text}\r"));
        }
    }

    #[test]
    fn what_is_no_frame_rings_the_bell() {
        for text in ["t", "t1", "t1003", "t100211", "t8000", "T200000000", "t1009", "x", "t10G0"] {
            assert_eq!(say(&mut open(), text), ("\x07".to_string(), None), "{text}");
        }
    }

    #[test]
    fn a_channel_opens_with_a_bit_rate_and_carries_frames_only_while_open() {
        let mut adapter = Adapter::new(CanOptions::default());
        assert_eq!(say(&mut adapter, "O").0, "\x07", "no bit rate yet");
        assert_eq!(say(&mut adapter, "t1000").0, "\x07");
        assert_eq!(say(&mut adapter, "S8").0, "\r");
        assert_eq!(say(&mut adapter, "O").0, "\r");
        assert_eq!(say(&mut adapter, "S6").0, "\x07", "not while open");
        assert_eq!(say(&mut adapter, "O").0, "\x07");
        assert_eq!(say(&mut adapter, "C").0, "\r");
        assert_eq!(say(&mut adapter, "L").0, "\r");
        assert_eq!(say(&mut adapter, "t1000"), ("\x07".to_string(), None), "it only listens");
    }

    #[test]
    fn at_a_wrong_bit_rate_nothing_gets_through_and_the_flags_say_so() {
        let mut adapter = Adapter::new(CanOptions::default());
        say(&mut adapter, "S6");
        say(&mut adapter, "O");
        assert_eq!(say(&mut adapter, "t1000").1, None);
        let frame = CanHeard::Frame(CanFrame::classic(1, false, &[]));
        assert_eq!(adapter.tell(&frame, 0), b"");
        assert_eq!(say(&mut adapter, "F").0, "FA4\r");
        assert_eq!(say(&mut adapter, "F").0, "F00\r", "reading clears them");
    }

    #[test]
    fn bus_off_is_a_state_message_and_refuses_frames_until_it_is_over() {
        let mut adapter = open();
        assert_eq!(adapter.tell(&CanHeard::BusOff, 0), b"sb000255\r");
        assert_eq!(say(&mut adapter, "t1000"), ("\x07".to_string(), None));
        assert_eq!(say(&mut adapter, "F").0, "FA4\r");
        assert_eq!(adapter.tell(&CanHeard::Restarted, 0), b"sa000000\r");
        assert_eq!(say(&mut adapter, "t1000").0, "z\r");
    }

    #[test]
    fn a_full_queue_rings_the_bell_and_sets_its_flag() {
        let mut adapter = open();
        assert_eq!(adapter.hear(b"t1000\r", |_| false), b"\x07");
        assert_eq!(say(&mut adapter, "F").0, "F02\r");
    }

    #[test]
    fn time_stamps_count_milliseconds_of_a_minute() {
        let mut adapter = Adapter::new(CanOptions::default());
        for command in ["Z1", "S8", "O"] {
            assert_eq!(say(&mut adapter, command).0, "\r", "{command}");
        }
        let frame = CanHeard::Frame(CanFrame::classic(1, false, &[0xAB]));
        assert_eq!(adapter.tell(&frame, 61_001_000_000), b"t0011AB03E9\r");
    }

    #[test]
    fn commands_may_come_in_pieces() {
        let mut adapter = open();
        let mut frames = 0;
        let mut said = Vec::new();
        for byte in b"t1000\rT000001000\rV\r\r" {
            said.extend(adapter.hear(&[*byte], |_| {
                frames += 1;
                true
            }));
        }
        assert_eq!((frames, said.as_slice()), (2, &b"z\rZ\rV1013\r\r"[..]));
    }

    proptest! {
        #[test]
        fn every_frame_is_read_as_it_was_written(
            id in 0_u32..0x2000_0000,
            extended in any::<bool>(),
            format in 0..4,
            code in 0_usize..16,
            seed in any::<u8>(),
        ) {
            let id = if extended { id } else { id & 0x7FF };
            let code = if format < 2 { code % 9 } else { code };
            let bytes = vec![seed; LENGTHS[code]];
            let (kind, bytes) = match format {
                0 => (Kind::Classic, bytes),
                1 => (Kind::Remote(code as u8), Vec::new()),
                2 => (Kind::Fd { fast: false }, bytes),
                _ => (Kind::Fd { fast: true }, bytes),
            };
            let frame = CanFrame { id, extended, kind, bytes };
            prop_assert_eq!(read(written(&frame).as_bytes()), Some(frame));
        }

        #[test]
        fn any_bytes_are_answered(bytes in proptest::collection::vec(any::<u8>(), 0..600)) {
            let mut adapter = open();
            adapter.hear(&bytes, |_| true);
            adapter.hear(b"\rS8\rO\r", |_| true);
            prop_assert_eq!(say(&mut adapter, "V").0, "V1013\r");
        }
    }
}
