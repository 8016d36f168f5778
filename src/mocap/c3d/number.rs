//! Numbers as the three kinds of machines store them that C3D files come from.

/// The kind of machine a file was written for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Processor {
    /// Little-endian, IEEE 754.
    Intel,
    /// Little-endian integers; real numbers of the VAX (`F_floating`: VAX Architecture Handbook, 1981).
    Dec,
    /// Big-endian, IEEE 754.
    Mips,
}

impl Processor {
    /// Of the byte in the head of the parameter section.
    pub const fn of_byte(byte: u8) -> Option<Self> {
        match byte {
            84 => Some(Self::Intel),
            85 => Some(Self::Dec),
            86 => Some(Self::Mips),
            _ => None,
        }
    }

    /// The word for it.
    pub const fn word(self) -> &'static str {
        match self {
            Self::Intel => "Intel",
            Self::Dec => "DEC",
            Self::Mips => "MIPS",
        }
    }

    /// An integer of 16 bits, its sign left to the reader.
    pub const fn word16(self, bytes: [u8; 2]) -> u16 {
        match self {
            Self::Intel | Self::Dec => u16::from_le_bytes(bytes),
            Self::Mips => u16::from_be_bytes(bytes),
        }
    }

    /// A real number of 32 bits.
    pub const fn float(self, bytes: [u8; 4]) -> f32 {
        match self {
            Self::Intel => f32::from_le_bytes(bytes),
            Self::Dec => vax_float(bytes),
            Self::Mips => f32::from_be_bytes(bytes),
        }
    }

    /// The integer at a place, if it is there.
    pub fn word16_at(self, bytes: &[u8], at: usize) -> Option<u16> {
        let bytes = bytes.get(at..)?.first_chunk::<2>()?;
        Some(self.word16(*bytes))
    }

    /// The real number at a place, if it is there.
    pub fn float_at(self, bytes: &[u8], at: usize) -> Option<f32> {
        let bytes = bytes.get(at..)?.first_chunk::<4>()?;
        Some(self.float(*bytes))
    }
}

/// A VAX number: two little-endian words, the upper one first, the mantissa 0.1m instead of 1.m and the
/// exponent in excess of 128 instead of 127. Exponent 0 is zero, or with a sign no number at all.
pub const fn vax_float([a, b, c, d]: [u8; 4]) -> f32 {
    let bits = u32::from_be_bytes([b, a, d, c]);
    match (bits >> 23) & 0xff {
        0 if bits >> 31 == 0 => 0.0,
        0 => f32::NAN,
        1 | 2 => f32::from_bits(bits) * 0.25,
        _ => f32::from_bits(bits - (2 << 23)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Examples of the VAX Architecture Handbook: 1.0 is 0x4080 in the first word, -1.5 is 0xC0C0, and
    /// the largest number 0x7FFF 0xFFFF.
    #[test]
    fn vax_numbers_are_what_the_handbook_says() {
        assert_eq!(vax_float([0x80, 0x40, 0, 0]), 1.0);
        assert_eq!(vax_float([0xC0, 0xC0, 0, 0]), -1.5);
        assert_eq!(vax_float([0, 0, 0, 0]), 0.0);
        // A zero with dirt in its fraction is zero, with a sign it is a reserved operand.
        assert_eq!(vax_float([0x12, 0, 0x34, 0x56]), 0.0);
        assert!(vax_float([0, 0x80, 0, 0]).is_nan());
        let largest = vax_float([0xFF, 0x7F, 0xFF, 0xFF]);
        assert_eq!(f64::from(largest), (1.0 - 2f64.powi(-24)) * 2f64.powi(127));
        // The smallest one is below what a normal IEEE number holds.
        assert_eq!(f64::from(vax_float([0x80, 0, 0, 0])), 2f64.powi(-128));
    }

    #[test]
    fn integers_are_read_in_the_order_of_their_machine() {
        let read = |processor: Processor| processor.word16([0x12, 0x34]);
        assert_eq!([Processor::Intel, Processor::Dec].map(read), [0x3412; 2]);
        assert_eq!(read(Processor::Mips), 0x1234);
    }
}
