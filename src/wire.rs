//! Bytes to packets and back. No input or output, no clock, no device profile.
//!
//! Encoders append one packet to a buffer. Decoders are total: any bytes give a [`Decoded`] value
//! that says what lies at the front of the buffer and how many bytes to take from it; they never
//! panic, and they never wait for more than a stated maximum. A reader is this loop:
//!
//! ```
//! use gaitway::wire::{Decoded, dynamixel2};
//!
//! // Noise, then the status of device 1 with present position 166, as it arrived so far.
//! let mut received = vec![
//!     0x00, 0xFF, 0xFF, 0xFD, 0x00, 0x01, 0x08, 0x00, 0x55, 0x00, 0xA6, 0x00, 0x00, 0x00, 0x8C,
//!     0xC0,
//! ];
//! let mut scratch = Vec::new();
//! let mut positions = Vec::new();
//! loop {
//!     let taken = match dynamixel2::decode(&received, &mut scratch) {
//!         Decoded::Packet(status, taken) => {
//!             positions.push(status.params.to_vec());
//!             taken
//!         }
//!         Decoded::Skip(taken) | Decoded::Echo(taken) | Decoded::Bad(_, taken) => taken,
//!         Decoded::Need(_) => break, // read more, or see `dynamixel2::abandon`
//!     };
//!     received.drain(..taken);
//! }
//! assert_eq!(positions, [[0xA6, 0x00, 0x00, 0x00]]);
//! ```

pub mod can;
pub mod checksum;
pub mod dynamixel1;
pub mod dynamixel2;
pub mod feetech;
pub mod natnet;
pub mod osc;
mod packet1;
#[cfg(test)]
mod properties;
pub mod sensor;

/// A device number on a bus, 0 to `LAST`. Numbers a protocol reserves cannot be built.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Id<const LAST: u8>(u8);

impl<const LAST: u8> Id<LAST> {
    /// The id `number`, if the protocol allows it for one device.
    #[must_use]
    pub const fn new(number: u8) -> Option<Self> {
        if number <= LAST { Some(Self(number)) } else { None }
    }

    /// The number on the wire.
    #[must_use]
    pub const fn get(self) -> u8 {
        self.0
    }

    /// Every id there can be, ascending.
    pub fn every() -> impl Iterator<Item = Self> {
        (0..=LAST).map(Self)
    }
}

impl<const LAST: u8> std::fmt::Display for Id<LAST> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.fmt(f)
    }
}

/// Whom an instruction addresses, where the protocol lets it address all devices at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target<const LAST: u8> {
    /// One device, which answers.
    One(Id<LAST>),
    /// Every device on the line (0xFE). None of them answers, but to a ping.
    All,
}

/// The number every device listens to, in all the serial protocols here.
const BROADCAST: u8 = 0xFE;

impl<const LAST: u8> Target<LAST> {
    const fn number(self) -> u8 {
        match self {
            Self::One(id) => id.0,
            Self::All => BROADCAST,
        }
    }
}

impl<const LAST: u8> From<Id<LAST>> for Target<LAST> {
    fn from(id: Id<LAST>) -> Self {
        Self::One(id)
    }
}

/// What lies at the front of the received bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Decoded<Status> {
    /// The beginning of a packet: at least this many more bytes are needed to tell. Take nothing.
    ///
    /// It is a lower bound for a packet that is intact; a damaged one may be told earlier, so read
    /// whatever has arrived rather than exactly this many.
    Need(usize),
    /// This many bytes before anything that could begin a packet. Take them.
    Skip(usize),
    /// Something that began like a packet and is none. Take this many bytes: up to the next
    /// place where a packet may begin, be it inside the bytes the bad one laid claim to.
    Bad(Reason, usize),
    /// A status of a device, and the length in bytes of its packet. Take them.
    Packet(Status, usize),
    /// An instruction of this many bytes: our own, heard back, or that of another host. Take them.
    Echo(usize),
}

impl<Status> Decoded<Status> {
    /// The same with another kind of status.
    pub fn map<Other>(self, status: impl FnOnce(Status) -> Other) -> Decoded<Other> {
        match self {
            Self::Need(n) => Decoded::Need(n),
            Self::Skip(n) => Decoded::Skip(n),
            Self::Bad(reason, n) => Decoded::Bad(reason, n),
            Self::Packet(found, n) => Decoded::Packet(status(found), n),
            Self::Echo(n) => Decoded::Echo(n),
        }
    }
}

/// Why bytes that began like a packet are none.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Reason {
    /// The id byte is one that no packet may carry.
    #[error("id {0:#04x} is reserved")]
    Id(u8),
    /// The length field is shorter than the smallest or longer than the longest packet.
    #[error("length field says {claimed}, allowed are {least} to {most}")]
    Length {
        /// What the length field says.
        claimed: usize,
        /// Smallest length field of such a packet.
        least: usize,
        /// Largest length field accepted.
        most: usize,
    },
    /// The check bytes do not fit the bytes before them.
    #[error("checksum {actual:#06x}, computed {expected:#06x}")]
    Checksum {
        /// Computed over the received bytes.
        expected: u16,
        /// Received.
        actual: u16,
    },
    /// Another packet begins before this one ends: bytes were lost or the length is false.
    #[error("packet of {claimed} bytes cut off after {available}")]
    Interrupted {
        /// Length of the whole packet by its length field, in bytes.
        claimed: usize,
        /// Bytes before the next header.
        available: usize,
    },
    /// The merged status of a fast read; [`dynamixel2::decode_merged`] reads those.
    #[error("merged status where none was asked for")]
    Merged,
    /// What stands inside is not what such a packet holds.
    #[error("contents that make no sense")]
    Malformed,
}

/// Why a packet cannot be built. The buffer is left as it was.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum EncodeError {
    /// The instruction would be longer than a packet may be.
    #[error("instruction of {bytes} bytes, allowed are {allowed}")]
    TooLong {
        /// Length it would have, or had reached when it became too long.
        bytes: usize,
        /// Longest packet.
        allowed: usize,
    },
    /// The answer might be longer than a packet may be, and would be refused by the decoder.
    #[error("answer of {bytes} bytes, allowed are {allowed}")]
    AnswerTooLong {
        /// Length the answer may have.
        bytes: usize,
        /// Longest packet.
        allowed: usize,
    },
    /// In a sync write each device is given the same number of bytes.
    #[error("bytes for id {id}: {actual}, expected {expected}")]
    WrongLength {
        /// Whose.
        id: u8,
        /// Bytes per device in this packet.
        expected: usize,
        /// Bytes given.
        actual: usize,
    },
    /// A device is named twice in one packet.
    #[error("id {0} twice in one packet")]
    RepeatedId(u8),
    /// No device is named at all.
    #[error("no device named")]
    Empty,
}

/// The ids already named in a packet under construction.
#[derive(Default)]
struct Named([u64; 4]);

impl Named {
    fn add<const LAST: u8>(&mut self, id: Id<LAST>) -> Result<(), EncodeError> {
        let word = &mut self.0[usize::from(id.0 / 64)];
        let bit = 1 << (id.0 % 64);
        if *word & bit != 0 {
            return Err(EncodeError::RepeatedId(id.0));
        }
        *word |= bit;
        Ok(())
    }

    fn not_empty(&self) -> Result<(), EncodeError> {
        if self.0 == [0; 4] { Err(EncodeError::Empty) } else { Ok(()) }
    }
}
