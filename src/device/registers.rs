//! Raw counts to SI and back, by a servo's profile. The only place that knows scale factors.

use core::f64::consts::{PI, TAU};
use gaitway_profiles::{Encoding, Register, Role, Servo, Unit};
use std::fmt;

/// A servo model: its profile seen through SI units.
#[derive(Clone, Copy, Debug)]
pub struct Model {
    servo: &'static Servo,
}

/// A value that does not fit its register, or a register the model does not have.
#[derive(Clone, Debug, PartialEq)]
pub enum RegisterError {
    /// No register of this model plays that role.
    NoSuchRole {
        /// Servo profile.
        servo: String,
        /// What was looked for.
        role: Role,
    },
    /// The value cannot be written in the register's bytes.
    OutOfRange {
        /// The vendor's name of the register.
        register: String,
        /// Raw value.
        raw: f64,
        /// Lowest raw value.
        min: i64,
        /// Highest raw value.
        max: i64,
    },
    /// Fewer bytes than the register has.
    Short {
        /// The vendor's name of the register.
        register: String,
        /// Bytes given.
        got: usize,
        /// Bytes wanted.
        wanted: usize,
    },
}

impl fmt::Display for RegisterError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoSuchRole { servo, role } => write!(f, "{servo} has no register for {role:?}"),
            Self::OutOfRange { register, raw, min, max } => {
                write!(f, "{register}: raw value {raw} is outside {min} to {max}")
            }
            Self::Short { register, got, wanted } => {
                write!(f, "{register}: {got} bytes, {wanted} wanted")
            }
        }
    }
}

impl std::error::Error for RegisterError {}

impl Model {
    /// The model described by `servo`.
    #[must_use]
    pub const fn new(servo: &'static Servo) -> Self {
        Self { servo }
    }

    /// The profile.
    #[must_use]
    pub const fn profile(&self) -> &'static Servo {
        self.servo
    }

    /// The register for `role`.
    ///
    /// # Errors
    /// [`RegisterError::NoSuchRole`].
    pub fn register(&self, role: Role) -> Result<&'static Register, RegisterError> {
        self.servo
            .register(role)
            .ok_or_else(|| RegisterError::NoSuchRole { servo: self.servo.name.clone(), role })
    }

    /// Angle of one count of a position register, rad.
    #[must_use]
    pub fn rad_per_count(&self) -> f64 {
        let position = &self.servo.position;
        f64::from(position.degrees) / f64::from(position.counts) * PI / 180.0
    }

    /// SI value of one raw count of `register`, without any zero.
    fn scale(&self, register: &Register) -> f64 {
        let per_count = register.scale.unwrap_or(1.0);
        match register.unit {
            Unit::Turn | Unit::TurnRelative | Unit::CountPerSecond | Unit::CountPerSecond2 => {
                per_count * self.rad_per_count()
            }
            Unit::Rpm => per_count * TAU / 60.0,
            Unit::Rpm2 => per_count * TAU / 3600.0,
            Unit::None | Unit::Ampere | Unit::Volt | Unit::Celsius | Unit::Second | Unit::Ratio => {
                per_count
            }
        }
    }

    /// Raw count that stands for zero in `register`.
    fn zero(&self, register: &Register) -> f64 {
        match register.unit {
            Unit::Turn => f64::from(self.servo.position.zero_count),
            _ => 0.0,
        }
    }

    /// SI value of a raw count.
    #[must_use]
    pub fn si_from_raw(&self, register: &Register, raw: i64) -> f64 {
        (raw as f64 - self.zero(register)) * self.scale(register)
    }

    /// Nearest raw count of an SI value.
    ///
    /// # Errors
    /// [`RegisterError::OutOfRange`] if it does not fit the register's bytes, NaN included.
    pub fn raw_from_si(&self, register: &Register, si: f64) -> Result<i64, RegisterError> {
        let raw = (si / self.scale(register) + self.zero(register)).round();
        let (min, max) = raw_range(register.encoding);
        if raw >= min as f64 && raw <= max as f64 {
            Ok(raw as i64)
        } else {
            Err(RegisterError::OutOfRange { register: register.name.clone(), raw, min, max })
        }
    }

    /// The register's bytes as an SI value.
    ///
    /// # Errors
    /// [`RegisterError::Short`].
    pub fn si_from_bytes(&self, register: &Register, bytes: &[u8]) -> Result<f64, RegisterError> {
        Ok(self.si_from_raw(register, raw_from_bytes(register, bytes)?))
    }

    /// An SI value as the register's bytes, appended to `out`.
    ///
    /// # Errors
    /// As [`Model::raw_from_si`].
    pub fn append_si(
        &self,
        register: &Register,
        si: f64,
        out: &mut Vec<u8>,
    ) -> Result<(), RegisterError> {
        append_raw(register, self.raw_from_si(register, si)?, out)
    }
}

/// Lowest and highest number an encoding holds.
fn raw_range(encoding: Encoding) -> (i64, i64) {
    match encoding {
        Encoding::U8 => (0, 0xFF),
        Encoding::U16 => (0, 0xFFFF),
        Encoding::U32 => (0, 0xFFFF_FFFF),
        Encoding::I8 => (-0x80, 0x7F),
        Encoding::I16 => (-0x8000, 0x7FFF),
        Encoding::I32 => (-0x8000_0000, 0x7FFF_FFFF),
        Encoding::SignMagnitude10 => (-0x3FF, 0x3FF),
        Encoding::SignMagnitude11 => (-0x7FF, 0x7FF),
        Encoding::SignMagnitude15 => (-0x7FFF, 0x7FFF),
    }
}

fn sign_bit(encoding: Encoding) -> Option<u32> {
    match encoding {
        Encoding::SignMagnitude10 => Some(10),
        Encoding::SignMagnitude11 => Some(11),
        Encoding::SignMagnitude15 => Some(15),
        _ => None,
    }
}

/// The number the first bytes of `bytes` hold.
///
/// # Errors
/// [`RegisterError::Short`].
pub fn raw_from_bytes(register: &Register, bytes: &[u8]) -> Result<i64, RegisterError> {
    let wanted = usize::from(register.bytes);
    let Some(own) = bytes.get(..wanted) else {
        let got = bytes.len();
        return Err(RegisterError::Short { register: register.name.clone(), got, wanted });
    };
    let word = own.iter().rev().fold(0_i64, |word, &byte| (word << 8) | i64::from(byte));
    Ok(match register.encoding {
        Encoding::U8 | Encoding::U16 | Encoding::U32 => word,
        Encoding::I8 => i64::from(word as u8 as i8),
        Encoding::I16 => i64::from(word as u16 as i16),
        Encoding::I32 => i64::from(word as u32 as i32),
        encoding => {
            let bit = sign_bit(encoding).unwrap_or(15);
            let magnitude = word & ((1 << bit) - 1);
            if word >> bit & 1 == 1 { -magnitude } else { magnitude }
        }
    })
}

/// `raw` as the register's bytes, appended to `out`.
///
/// # Errors
/// [`RegisterError::OutOfRange`].
pub fn append_raw(register: &Register, raw: i64, out: &mut Vec<u8>) -> Result<(), RegisterError> {
    let (min, max) = raw_range(register.encoding);
    if !(min..=max).contains(&raw) {
        let raw = raw as f64;
        return Err(RegisterError::OutOfRange { register: register.name.clone(), raw, min, max });
    }
    let word = match sign_bit(register.encoding) {
        Some(bit) if raw < 0 => (1 << bit) | -raw,
        _ => raw,
    };
    out.extend_from_slice(&word.to_le_bytes()[..usize::from(register.bytes)]);
    Ok(())
}
