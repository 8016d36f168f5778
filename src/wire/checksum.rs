//! The two check sums of the serial servo protocols.
//!
//! - [`crc16`]: CRC-16/UMTS (also called BUYPASS): polynomial 0x8005, initial value 0, not
//!   reflected, no final exclusive or. Used by DYNAMIXEL Protocol 2.0 over every byte from the
//!   first header byte to the last parameter, and sent low byte first. Source: ROBOTIS e-Manual,
//!   "CRC Calculation for DYNAMIXEL Protocol 2.0"; check value 0xFEE8 over "123456789" as in the
//!   catalogue of parametrised CRC algorithms.
//! - [`sum8`]: bitwise complement of the low byte of the sum. Used by DYNAMIXEL Protocol 1.0 and
//!   by Feetech servos over id, length, instruction or error, and parameters. Source: ROBOTIS
//!   e-Manual, "DYNAMIXEL Protocol 1.0", section Checksum.
//!
//! Not done: any other CRC; nothing else on these lines uses one.
//!
//! The ping of device 1 in the manual is `FF FF FD 00 01 03 00 01 19 4E`:
//!
//! ```
//! use gaitway::wire::checksum::{crc16, sum8};
//!
//! let ping = [0xFF, 0xFF, 0xFD, 0x00, 0x01, 0x03, 0x00, 0x01];
//! assert_eq!(crc16(&ping).to_le_bytes(), [0x19, 0x4E]);
//! // and in Protocol 1.0 FF FF 01 02 01 FB, header not counted:
//! assert_eq!(sum8(&[0x01, 0x02, 0x01]), 0xFB);
//! ```

const POLYNOMIAL: u16 = 0x8005;

/// Bytes taken per step of the fast loop.
const STRIDE: usize = 4;

/// `TABLES[k][b]`: the CRC of the byte `b` followed by `k` zero bytes. Since a CRC is linear over
/// exclusive or, four bytes are taken at once by adding the contributions of each, which breaks
/// the chain of one dependent table access per byte ("slicing", Kounavis and Berry 2005).
const TABLES: [[u16; 256]; STRIDE] = tables();

const fn tables() -> [[u16; 256]; STRIDE] {
    let mut tables = [[0; 256]; STRIDE];
    let mut byte = 0;
    while byte < 256 {
        let mut crc = (byte as u16) << 8;
        let mut bit = 0;
        while bit < 8 {
            crc = if crc & 0x8000 != 0 { (crc << 1) ^ POLYNOMIAL } else { crc << 1 };
            bit += 1;
        }
        tables[0][byte] = crc;
        byte += 1;
    }
    let mut zeros = 1;
    while zeros < STRIDE {
        let mut byte = 0;
        while byte < 256 {
            let crc = tables[zeros - 1][byte];
            tables[zeros][byte] = (crc << 8) ^ tables[0][(crc >> 8) as usize];
            byte += 1;
        }
        zeros += 1;
    }
    tables
}

/// A CRC-16/UMTS that can be read between any two bytes, as the merged status of a fast read
/// needs: each device there appends the CRC of everything before it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Crc16(u16);

impl Crc16 {
    /// Over no bytes yet.
    #[must_use]
    pub const fn new() -> Self {
        Self(0)
    }

    /// Takes more bytes in.
    pub fn update(&mut self, bytes: &[u8]) {
        let (strides, rest) = bytes.as_chunks::<STRIDE>();
        for &[a, b, c, d] in strides {
            let [high, low] = self.0.to_be_bytes();
            self.0 = TABLES[3][usize::from(high ^ a)]
                ^ TABLES[2][usize::from(low ^ b)]
                ^ TABLES[1][usize::from(c)]
                ^ TABLES[0][usize::from(d)];
        }
        for &byte in rest {
            let [high, low] = self.0.to_be_bytes();
            self.0 = (u16::from(low) << 8) ^ TABLES[0][usize::from(high ^ byte)];
        }
    }

    /// The CRC of all bytes taken in.
    #[must_use]
    pub const fn value(self) -> u16 {
        self.0
    }
}

/// CRC-16/UMTS of `bytes`.
#[must_use]
pub fn crc16(bytes: &[u8]) -> u16 {
    let mut crc = Crc16::new();
    crc.update(bytes);
    crc.value()
}

/// Complement of the sum of `bytes`, low byte.
#[must_use]
pub fn sum8(bytes: &[u8]) -> u8 {
    !bytes.iter().fold(0, |sum: u8, &byte| sum.wrapping_add(byte))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_crc_has_the_published_check_value() {
        assert_eq!(crc16(b"123456789"), 0xFEE8);
        assert_eq!(crc16(&[]), 0);
    }

    #[test]
    fn the_table_has_the_entries_printed_in_the_manual() {
        let printed = [0x0000, 0x8005, 0x800F, 0x000A, 0x801B, 0x001E, 0x0014, 0x8011];
        assert_eq!(TABLES[0][..8], printed);
        assert_eq!(TABLES[0][255], 0x0202);
    }

    #[test]
    fn a_crc_taken_in_pieces_equals_the_crc_of_the_whole() {
        let last = if cfg!(miri) { 20 } else { 255 };
        let bytes: Vec<u8> = (0..=last).map(|n: u8| n.wrapping_mul(37) ^ 0x5A).collect();
        for cut in 0..=bytes.len() {
            let mut crc = Crc16::new();
            crc.update(&bytes[..cut]);
            crc.update(&bytes[cut..]);
            assert_eq!(crc.value(), crc16(&bytes), "cut at {cut}");
        }
    }

    #[test]
    fn the_sum_wraps_and_is_inverted() {
        assert_eq!(sum8(&[]), 0xFF);
        assert_eq!(sum8(&[0xFF, 0x02]), 0xFE);
    }
}
