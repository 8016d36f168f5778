//! CAN frames as values, and the dialects CAN actuators speak: commands to frames, frames to
//! feedback.
//!
//! | module | actuators |
//! |---|---|
//! | [`mit`] | the packed frame of the MIT Mini Cheetah, which several makers took over |
//! | [`cubemars`] | CubeMars (T-Motor) AK, MIT mode and servo mode |
//! | [`damiao`] | Damiao DM |
//! | [`robstride`] | Xiaomi CyberGear and RobStride, the makers' own protocol |
//! | [`odrive`] | ODrive, CAN Simple |
//! | [`moteus`] | mjbots moteus, CAN FD |
//! | [`recoil`] | Recoil, of Berkeley Humanoid Lite |
//! | [`error_frame`] | what the line itself reports through Linux |
//! | [`slcan`] | none: frames as text, to and from an adapter on a serial line |
//!
//! Encoders cannot fail where types can see to it. Decoders are total: any frame gives a value or
//! `None`, which means that the frame is another device's, another message, or too short to be
//! one. Numbers stay as the device writes them ([`Number`]); which angle a count stands for is
//! told by the actuator's profile, and known in `device` only.
//!
//! ```
//! use gaitway::wire::can::{CanFrame, CanId, Format, Number, damiao};
//!
//! let id = damiao::Id::new(1).ok_or("1 is an id")?;
//! let frame = damiao::command(id, damiao::Command::Enable);
//! assert_eq!(frame.payload(), [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFC]);
//!
//! let answer = [0x11, 0x8A, 0x3C, 0x7F, 0xF7, 0xFF, 0x23, 0x1E];
//! let master = CanId::standard(0x11).ok_or("11 bits")?;
//! let answer = CanFrame::new(master, Format::Classic, &answer).ok_or("8 bytes")?;
//! let feedback = damiao::feedback(id, 0x11, &answer).ok_or("feedback of device 1")?;
//! assert_eq!(feedback.position, Some(Number::Code { code: 0x8A3C, bits: 16 }));
//! assert_eq!(feedback.enabled, Some(true));
//! # Ok::<(), &'static str>(())
//! ```

pub mod cubemars;
pub mod damiao;
pub mod error_frame;
pub mod mit;
pub mod moteus;
pub mod odrive;
#[cfg(test)]
mod properties;
pub mod recoil;
pub mod robstride;
pub mod slcan;

use std::fmt;

/// Most bytes a CAN FD frame carries.
pub const MAX_PAYLOAD: usize = 64;
/// Most bytes a classic frame carries.
pub const MAX_CLASSIC_PAYLOAD: usize = 8;
/// Largest identifier of a standard frame (11 bits).
pub const MAX_STANDARD: u32 = 0x7FF;
/// Largest identifier of an extended frame (29 bits).
pub const MAX_EXTENDED: u32 = 0x1FFF_FFFF;

/// The identifier of a frame. A lower one wins the line; of equal first 11 bits the standard one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct CanId {
    number: u32,
    extended: bool,
}

impl CanId {
    /// An 11-bit identifier, if `number` fits.
    #[must_use]
    pub const fn standard(number: u32) -> Option<Self> {
        if number <= MAX_STANDARD { Some(Self::standard_of(number)) } else { None }
    }

    /// A 29-bit identifier, if `number` fits.
    #[must_use]
    pub const fn extended(number: u32) -> Option<Self> {
        if number <= MAX_EXTENDED { Some(Self::extended_of(number)) } else { None }
    }

    /// For numbers that fit by their making; what does not fit is cut off.
    const fn standard_of(number: u32) -> Self {
        Self { number: number & MAX_STANDARD, extended: false }
    }

    const fn extended_of(number: u32) -> Self {
        Self { number: number & MAX_EXTENDED, extended: true }
    }

    /// The number, without the mark that tells the two kinds apart.
    #[must_use]
    pub const fn number(self) -> u32 {
        self.number
    }

    /// True for a 29-bit identifier.
    #[must_use]
    pub const fn is_extended(self) -> bool {
        self.extended
    }

    const fn is_standard(self, number: u32) -> bool {
        !self.extended && self.number == number
    }
}

impl fmt::Display for CanId {
    /// As `candump` prints it: three digits or eight.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.extended {
            write!(f, "{:08X}", self.number)
        } else {
            write!(f, "{:03X}", self.number)
        }
    }
}

/// What kind of frame it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Format {
    /// CAN 2.0, 0 to 8 bytes.
    Classic,
    /// CAN 2.0 remote request: it asks for a frame of this length and carries no bytes itself.
    Remote {
        /// Bytes asked for, 0 to 8.
        length: u8,
    },
    /// CAN FD: 0 to 8, 12, 16, 20, 24, 32, 48 or 64 bytes.
    Fd {
        /// The payload goes at the line's faster bit rate (BRS).
        fast: bool,
    },
}

/// A frame as it goes over the line.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct CanFrame {
    id: CanId,
    format: Format,
    bytes: [u8; MAX_PAYLOAD],
    length: u8,
}

impl CanFrame {
    /// A frame; none if a frame of this format cannot carry exactly these bytes.
    #[must_use]
    pub fn new(id: CanId, format: Format, payload: &[u8]) -> Option<Self> {
        let fits = match format {
            Format::Classic => payload.len() <= MAX_CLASSIC_PAYLOAD,
            Format::Remote { length } => payload.is_empty() && length <= 8,
            Format::Fd { .. } => fd_length(payload.len()) == Some(payload.len()),
        };
        let mut bytes = [0; MAX_PAYLOAD];
        bytes.get_mut(..payload.len())?.copy_from_slice(payload);
        let length = u8::try_from(payload.len()).ok()?;
        fits.then_some(Self { id, format, bytes, length })
    }

    /// A classic frame whose length the compiler checks.
    const fn classic<const N: usize>(id: CanId, payload: [u8; N]) -> Self {
        const { assert!(N <= MAX_CLASSIC_PAYLOAD) };
        let mut bytes = [0; MAX_PAYLOAD];
        bytes.split_at_mut(N).0.copy_from_slice(&payload);
        Self { id, format: Format::Classic, bytes, length: N as u8 }
    }

    /// Who sends it or is meant by it, and how urgent it is.
    #[must_use]
    pub const fn id(&self) -> CanId {
        self.id
    }

    /// Classic, remote or FD.
    #[must_use]
    pub const fn format(&self) -> Format {
        self.format
    }

    /// The bytes carried.
    #[must_use]
    pub fn payload(&self) -> &[u8] {
        &self.bytes[..usize::from(self.length).min(MAX_PAYLOAD)]
    }

    /// The first `N` bytes of a classic frame with data; none if there are fewer.
    fn classic_bytes<const N: usize>(&self) -> Option<[u8; N]> {
        if self.format != Format::Classic {
            return None;
        }
        self.payload().first_chunk::<N>().copied()
    }
}

impl fmt::Debug for CanFrame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {:?} {:02X?}", self.id, self.format, self.payload())
    }
}

/// The length of the smallest CAN FD frame that carries `bytes`; none above 64.
#[must_use]
pub fn fd_length(bytes: usize) -> Option<usize> {
    (0..=8).chain([12, 16, 20, 24, 32, 48, 64]).find(|&length| length >= bytes)
}

/// A number as a device writes it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Number {
    /// A step on a range divided evenly: 0 is its lower end, the largest number of `bits` bits its
    /// upper end. The range belongs to the actuator, not to the protocol.
    Code {
        /// The step.
        code: u16,
        /// How many bits the device has for it.
        bits: u8,
    },
    /// So many of the steps the dialect names.
    Steps(i32),
    /// In the unit the dialect names.
    Value(f32),
}

/// What an actuator says of itself. What the message does not tell is `None`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Feedback {
    /// Where the output stands.
    pub position: Option<Number>,
    /// How fast it turns.
    pub velocity: Option<Number>,
    /// Its torque, or the motor's current where the dialect's module says so.
    pub torque: Option<Number>,
    /// The hottest place it tells of, most often its power stage.
    pub temperature: Option<Number>,
    /// Whether it drives.
    pub enabled: Option<bool>,
    /// What is wrong with it.
    pub faults: Faults,
}

/// What is wrong with an actuator, in words all dialects share.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Faults(u16);

impl Faults {
    /// Nothing is wrong.
    pub const NONE: Self = Self(0);
    /// The power stage is too hot, or the device does not say what is.
    pub const HOT: Self = Self(1);
    /// The motor is too hot.
    pub const MOTOR_HOT: Self = Self(1 << 1);
    /// Too much current.
    pub const CURRENT: Self = Self(1 << 2);
    /// Supply voltage too high.
    pub const OVER_VOLTAGE: Self = Self(1 << 3);
    /// Supply voltage too low.
    pub const UNDER_VOLTAGE: Self = Self(1 << 4);
    /// The encoder fails or cannot be read.
    pub const ENCODER: Self = Self(1 << 5);
    /// The power stage or its gate driver fails.
    pub const DRIVER: Self = Self(1 << 6);
    /// Too much load for too long, or blocked.
    pub const OVERLOAD: Self = Self(1 << 7);
    /// The host was silent for too long.
    pub const SILENCE: Self = Self(1 << 8);
    /// It must be calibrated or configured first.
    pub const NOT_CALIBRATED: Self = Self(1 << 9);
    /// It is outside the range it is allowed to be in.
    pub const OUT_OF_RANGE: Self = Self(1 << 10);
    /// Something the dialect has no word for here.
    pub const OTHER: Self = Self(1 << 15);

    const NAMES: [(Self, &'static str); 12] = [
        (Self::HOT, "too hot"),
        (Self::MOTOR_HOT, "motor too hot"),
        (Self::CURRENT, "too much current"),
        (Self::OVER_VOLTAGE, "voltage too high"),
        (Self::UNDER_VOLTAGE, "voltage too low"),
        (Self::ENCODER, "encoder"),
        (Self::DRIVER, "power stage"),
        (Self::OVERLOAD, "overload"),
        (Self::SILENCE, "host was silent"),
        (Self::NOT_CALIBRATED, "not calibrated"),
        (Self::OUT_OF_RANGE, "out of range"),
        (Self::OTHER, "unknown fault"),
    ];

    /// True if nothing is wrong.
    #[must_use]
    pub const fn is_none(self) -> bool {
        self.0 == 0
    }

    /// True if any of `others` is among these.
    #[must_use]
    pub const fn any(self, others: Self) -> bool {
        self.0 & others.0 != 0
    }

    /// Both.
    #[must_use]
    pub const fn and(self, others: Self) -> Self {
        Self(self.0 | others.0)
    }

    /// All of them as bits.
    #[must_use]
    pub const fn bits(self) -> u16 {
        self.0
    }

    /// Those whose [`Faults::bits`] are these.
    #[must_use]
    pub const fn from_bits(bits: u16) -> Self {
        Self(bits)
    }

    /// The faults whose bit is set in `bits`.
    fn of_bits(bits: u32, table: &[(u32, Self)]) -> Self {
        table
            .iter()
            .filter(|(bit, _)| bits >> bit & 1 != 0)
            .fold(Self::NONE, |faults, &(_, fault)| faults.and(fault))
    }
}

impl fmt::Display for Faults {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let named = Self::NAMES.iter().filter(|(fault, _)| self.any(*fault));
        let names: Vec<_> = named.map(|(_, name)| *name).collect();
        f.write_str(if names.is_empty() { "none" } else { "" })?;
        f.write_str(&names.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_id_that_does_not_fit_cannot_be_built() {
        assert_eq!(CanId::standard(0x800), None);
        assert_eq!(CanId::extended(0x2000_0000), None);
        assert_eq!(CanId::standard(0x7FF).map(|id| id.to_string()), Some("7FF".to_owned()));
        assert_eq!(CanId::extended(0x7F).map(|id| id.to_string()), Some("0000007F".to_owned()));
        assert_ne!(CanId::extended(1), CanId::standard(1));
    }

    #[test]
    fn a_frame_carries_only_what_its_format_can() {
        let id = CanId::standard(1).expect("fits");
        let fd = Format::Fd { fast: true };
        for (format, bytes, fits) in [
            (Format::Classic, 8, true),
            (Format::Classic, 9, false),
            (Format::Remote { length: 8 }, 0, true),
            (Format::Remote { length: 9 }, 0, false),
            (Format::Remote { length: 8 }, 1, false),
            (fd, 12, true),
            (fd, 13, false),
            (fd, 64, true),
            (fd, 65, false),
        ] {
            let frame = CanFrame::new(id, format, &vec![0x55; bytes]);
            assert_eq!(frame.is_some(), fits, "{format:?} {bytes}");
            assert_eq!(frame.map_or(0, |f| f.payload().len()), if fits { bytes } else { 0 });
        }
    }

    #[test]
    fn fd_lengths_are_those_of_iso_11898() {
        assert_eq!([0, 8, 9, 13, 25, 33, 49].map(fd_length), [0, 8, 12, 16, 32, 48, 64].map(Some));
        assert_eq!(fd_length(65), None);
    }

    #[test]
    fn faults_have_words() {
        assert_eq!(Faults::NONE.to_string(), "none");
        assert_eq!(Faults::HOT.and(Faults::ENCODER).to_string(), "too hot, encoder");
    }
}
