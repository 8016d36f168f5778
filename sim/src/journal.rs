//! What has happened in a world, in order and with times: who was asked what, what was answered, what
//! struck. Kept only if somebody wants it, and never more than so much of it.

use crate::can::CanFrame;
use crate::dynamixel2::packet;
use crate::family::Family;
use crate::fault::Struck;
use std::collections::VecDeque;

/// Entries that are kept, and bytes of packets in them; older ones go.
const MOST_ENTRIES: usize = 16_384;
const MOST_BYTES: usize = 2 << 20;

/// What has happened at one moment.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// Its number, from 0 at the start or the last reset; every entry has one more than that before.
    pub number: u64,
    /// World time, ns: of packets, when their last byte is on the line.
    pub at_ns: u64,
    /// What.
    pub what: Happening,
}

/// What can happen.
#[derive(Clone, Debug, PartialEq)]
pub enum Happening {
    /// Servos of a line understood an instruction, right or with a wrong checksum.
    Asked(Asked),
    /// A servo answered; what reaches the host, with all damage.
    Answered {
        /// Number of the line.
        line: usize,
        /// The servo's ID as it has it.
        id: u8,
        /// The bytes.
        bytes: Vec<u8>,
    },
    /// A frame has passed on a CAN line.
    Frame {
        /// Number of the line.
        line: usize,
        /// The host's own.
        from_host: bool,
        /// The frame.
        frame: CanFrame,
    },
    /// A fault struck.
    Struck(Struck),
    /// A joint's torque came on or went.
    Torque {
        /// Number of the joint.
        joint: usize,
        /// It came on.
        on: bool,
    },
    /// The adapter of a line was plugged in or pulled out.
    Adapter {
        /// Number of the line.
        line: usize,
        /// It is plugged in now.
        plugged: bool,
    },
    /// A robot with weight has fallen.
    Fell {
        /// The link that lies where none should; empty if it only tilted.
        on: String,
    },
    /// All is as it was at the start, and time is zero.
    Reset,
}

/// An instruction as it was understood.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Asked {
    /// Number of the line.
    pub line: usize,
    /// ID it is for; 254 is all of them.
    pub id: u8,
    /// Its number in the makers' tables.
    pub code: u8,
    /// First address it is about, where it has one.
    pub address: Option<u16>,
    /// IDs of those it asks or tells something in one packet (sync and bulk).
    pub ids: Vec<u8>,
    /// Its parameters, without stuffing.
    pub params: Vec<u8>,
    /// The whole packet as it was on the line.
    pub bytes: Vec<u8>,
}

/// Names of instructions by their numbers, as all three families have them.
const INSTRUCTIONS: [(u8, &str); 18] = [
    (0x01, "ping"),
    (0x02, "read"),
    (0x03, "write"),
    (0x04, "reg-write"),
    (0x05, "action"),
    (0x06, "factory-reset"),
    (0x08, "reboot"),
    (0x0A, "parameter-reset"),
    (0x0B, "calibrate"),
    (0x10, "clear"),
    (0x20, "backup"),
    (0x82, "sync-read"),
    (0x83, "sync-write"),
    (0x8A, "fast-sync-read"),
    (0x92, "bulk-read"),
    (0x93, "bulk-write"),
    (0x9A, "fast-bulk-read"),
    (0x55, "status"),
];

impl Asked {
    /// What the instruction is called: `ping`, `read`, `sync-write`, ...; of one that nobody knows its
    /// number.
    #[must_use]
    pub fn instruction(&self) -> String {
        let known = INSTRUCTIONS.iter().find(|(code, _)| *code == self.code);
        known.map_or_else(|| format!("0x{:02x}", self.code), |(_, name)| (*name).to_string())
    }

    /// It is for this ID alone, for all, or for this one among others.
    #[must_use]
    pub fn concerns(&self, id: u8) -> bool {
        if self.ids.is_empty() { self.id == id || self.id == 254 } else { self.ids.contains(&id) }
    }

    /// Takes a packet apart that servos of this family understood.
    pub(crate) fn of(line: usize, family: Family, bytes: &[u8]) -> Asked {
        let (id, code, params) = match (family, bytes) {
            (Family::Dynamixel2, bytes) if bytes.len() >= 10 => {
                let (id, code, body) = packet::open(bytes);
                (id, code, body.into_owned())
            }
            (_, [_, _, id, _, code, params @ .., _]) => (*id, *code, params.to_vec()),
            _ => (0, 0, Vec::new()),
        };
        let wide = family == Family::Dynamixel2;
        let mut asked = Asked { line, id, code, params, bytes: bytes.to_vec(), ..Asked::default() };
        asked.read_params(wide);
        asked
    }

    fn read_params(&mut self, wide: bool) {
        let number = |bytes: &[u8]| match (wide, bytes) {
            (true, &[low, high, ..]) => Some(u16::from_le_bytes([low, high])),
            (false, &[byte, ..]) => Some(u16::from(byte)),
            _ => None,
        };
        let size = if wide { 2 } else { 1 };
        let after = |count: usize| self.params.get(count * size..).unwrap_or_default();
        match self.code {
            0x02..=0x04 => self.address = number(&self.params),
            0x82 | 0x8A => (self.address, self.ids) = (number(&self.params), after(2).to_vec()),
            0x83 => {
                let each = number(after(1)).map_or(1, |length| usize::from(length) + 1);
                let ids = after(2).chunks(each).filter_map(|part| part.first().copied()).collect();
                (self.address, self.ids) = (number(&self.params), ids);
            }
            // ID, address and length each; Protocol 1.0 begins with a zero and has the length first.
            0x92 | 0x9A => {
                let parts = if wide { self.params.chunks(5) } else { after(1).chunks(3) };
                let id = |part: &[u8]| part.get(usize::from(!wide)).copied();
                self.ids = parts.filter_map(id).collect();
            }
            0x93 => {
                let mut rest = self.params.as_slice();
                while let [id, _, _, low, high, data @ ..] = rest {
                    self.ids.push(*id);
                    let length = usize::from(u16::from_le_bytes([*low, *high]));
                    rest = data.get(length..).unwrap_or_default();
                }
            }
            _ => {}
        }
    }
}

/// The entries that are kept.
#[derive(Clone, Debug, Default)]
pub struct Journal {
    is_kept: bool,
    entries: VecDeque<Entry>,
    bytes: usize,
    next: u64,
}

impl Journal {
    /// The entries there are, from this number on.
    pub fn since(&self, number: u64) -> impl Iterator<Item = &Entry> {
        let gone = self.next - self.entries.len() as u64;
        let skip = usize::try_from(number.saturating_sub(gone)).unwrap_or(usize::MAX);
        self.entries.iter().skip(skip)
    }

    /// How many of the entries from this number on are gone.
    #[must_use]
    pub fn lost_since(&self, number: u64) -> u64 {
        (self.next - self.entries.len() as u64).saturating_sub(number)
    }

    /// The number of the next entry.
    #[must_use]
    pub fn next(&self) -> u64 {
        self.next
    }

    /// Keeps entries from now on, or none.
    pub(crate) fn keep(&mut self, is_kept: bool) {
        self.is_kept = is_kept;
    }

    /// Begins anew with number 0.
    pub(crate) fn reset(&mut self) {
        *self = Journal { is_kept: self.is_kept, ..Journal::default() };
        self.note(0, || Happening::Reset);
    }

    pub(crate) fn note(&mut self, at_ns: u64, what: impl FnOnce() -> Happening) {
        if !self.is_kept {
            return;
        }
        let entry = Entry { number: self.next, at_ns, what: what() };
        self.next += 1;
        self.bytes += entry.bytes();
        self.entries.push_back(entry);
        while self.entries.len() > MOST_ENTRIES || self.bytes > MOST_BYTES {
            let Some(oldest) = self.entries.pop_front() else { break };
            self.bytes -= oldest.bytes();
        }
    }
}

impl Entry {
    fn bytes(&self) -> usize {
        match &self.what {
            Happening::Asked(asked) => asked.bytes.len() + asked.params.len() + asked.ids.len(),
            Happening::Answered { bytes, .. } => bytes.len(),
            Happening::Frame { frame, .. } => frame.bytes.len(),
            Happening::Struck(struck) => struck.place.len(),
            Happening::Fell { on } => on.len(),
            Happening::Torque { .. } | Happening::Adapter { .. } | Happening::Reset => 0,
        }
    }
}
