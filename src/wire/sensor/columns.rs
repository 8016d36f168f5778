//! Records whose columns the user declares, as text or as little-endian numbers.

use super::Reading;
use crate::wire::Reason;

/// The names a column may have, in the order of the slots below.
const NAMES: [&str; 19] = [
    "ax",
    "ay",
    "az",
    "gx",
    "gy",
    "gz",
    "mx",
    "my",
    "mz",
    "qw",
    "qx",
    "qy",
    "qz",
    "roll",
    "pitch",
    "yaw",
    "temperature",
    "counter",
    "ticks",
];

/// One column: what it is, and how it is stored in binary records.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Column {
    /// Index into [`NAMES`]; `None` is a column that is passed over.
    slot: Option<usize>,
    number: Number,
}

/// Number formats of binary records, little-endian.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Number {
    /// Unsigned, one byte.
    U8,
    /// Unsigned, two bytes.
    U16,
    /// Unsigned, four bytes.
    U32,
    /// Unsigned, eight bytes; exact up to 2^53.
    U64,
    /// Signed, two bytes.
    I16,
    /// Signed, four bytes.
    I32,
    /// IEEE 754, four bytes.
    #[default]
    F32,
    /// IEEE 754, eight bytes.
    F64,
}

/// A column that is none.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0:?} is no column, allowed are {names} and - to pass over, each with :u8 :u16 :u32 :u64 :i16 :i32 :f32 or :f64 after it in binary records", names = NAMES.join(" "))]
pub struct ColumnError(pub String);

impl std::str::FromStr for Column {
    type Err = ColumnError;

    /// `ax`, `ticks:u32`, `-:u8`.
    fn from_str(text: &str) -> Result<Self, ColumnError> {
        let wrong = || ColumnError(text.to_owned());
        let (name, number) = text.split_once(':').unwrap_or((text, "f32"));
        let slot = match name {
            "-" => None,
            _ => Some(NAMES.iter().position(|&known| known == name).ok_or_else(wrong)?),
        };
        let number = match number {
            "u8" => Number::U8,
            "u16" => Number::U16,
            "u32" => Number::U32,
            "u64" => Number::U64,
            "i16" => Number::I16,
            "i32" => Number::I32,
            "f32" => Number::F32,
            "f64" => Number::F64,
            _ => return Err(wrong()),
        };
        Ok(Self { slot, number })
    }
}

impl Number {
    const fn bytes(self) -> usize {
        match self {
            Self::U8 => 1,
            Self::U16 | Self::I16 => 2,
            Self::U32 | Self::I32 | Self::F32 => 4,
            Self::U64 | Self::F64 => 8,
        }
    }

    fn read(self, bytes: &[u8]) -> Option<f64> {
        Some(match self {
            Self::U8 => f64::from(*bytes.first()?),
            Self::U16 => f64::from(u16::from_le_bytes(bytes.try_into().ok()?)),
            Self::I16 => f64::from(i16::from_le_bytes(bytes.try_into().ok()?)),
            Self::U32 => f64::from(u32::from_le_bytes(bytes.try_into().ok()?)),
            Self::I32 => f64::from(i32::from_le_bytes(bytes.try_into().ok()?)),
            Self::F32 => f64::from(f32::from_le_bytes(bytes.try_into().ok()?)),
            Self::U64 => u64::from_le_bytes(bytes.try_into().ok()?) as f64,
            Self::F64 => f64::from_le_bytes(bytes.try_into().ok()?),
        })
    }
}

/// A record of exactly these columns, little-endian, without padding between them. Zeros may follow, for who sends all records in
/// one length.
pub(super) fn record(columns: &[Column], mut bytes: &[u8]) -> Result<Reading, Reason> {
    let length = columns.iter().map(|column| column.number.bytes()).sum();
    if bytes.len() < length || bytes[length..].iter().any(|&byte| byte != 0) {
        return Err(Reason::Length { claimed: bytes.len(), least: length, most: length });
    }
    reading(columns, |column| {
        let (number, rest) = bytes.split_at(column.number.bytes());
        bytes = rest;
        column.number.read(number).ok_or(Reason::Malformed)
    })
}

/// A reading from the value of each column. What is not a finite number, and what lacks one of its
/// columns, is absent.
pub(super) fn reading(
    columns: &[Column],
    mut value: impl FnMut(&Column) -> Result<f64, Reason>,
) -> Result<Reading, Reason> {
    let mut slots = [f64::NAN; NAMES.len()];
    for column in columns {
        let value = value(column)?;
        if let Some(slot) = column.slot {
            slots[slot] = value;
        }
    }
    let [ax, ay, az, gx, gy, gz, mx, my, mz, qw, qx, qy, qz, roll, pitch, yaw, rest @ ..] = slots;
    let [celsius, counter, ticks] = rest;
    Ok(Reading {
        acceleration: finite([ax, ay, az]),
        linear_acceleration: None,
        angular_rate: finite([gx, gy, gz]),
        magnetic_field: finite([mx, my, mz]),
        quaternion: finite([qw, qx, qy, qz]),
        euler: finite([roll, pitch, yaw]),
        temperature: finite([celsius]).map(|[celsius]| celsius),
        counter: whole(counter),
        ticks: whole(ticks),
        world: None,
    })
}

fn finite<const N: usize>(values: [f64; N]) -> Option<[f64; N]> {
    values.iter().all(|value| value.is_finite()).then_some(values)
}

fn whole(value: f64) -> Option<u64> {
    (value >= 0.0 && value < 2_f64.powi(53)).then_some(value as u64)
}
