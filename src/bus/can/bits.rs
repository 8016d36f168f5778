//! How long a frame occupies a CAN line, at most.
//!
//! Source: Bosch, "CAN Specification" 2.0 (1991); Davis, Burns, Bril and Lukkien, "Controller Area
//! Network (CAN) schedulability analysis: refuted, revisited and revised" (2007), equation 1, for
//! the most stuff bits a classic frame can have; ISO 11898-1:2015 for CAN FD.

use crate::wire::can::{CanFrame, Format};

/// The form of a frame: what decides how long it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shape {
    /// Its identifier has 29 bits.
    pub extended: bool,
    /// Classic, remote or FD.
    pub format: Format,
    /// Bytes carried.
    pub bytes: usize,
}

impl Shape {
    /// A classic frame of eight bytes.
    #[must_use]
    pub const fn classic(extended: bool, bytes: usize) -> Self {
        Self { extended, format: Format::Classic, bytes }
    }

    /// The form of `frame`.
    #[must_use]
    pub fn of(frame: &CanFrame) -> Self {
        let extended = frame.id().is_extended();
        Self { extended, format: frame.format(), bytes: frame.payload().len() }
    }

    /// The longest it may take, pause to the next frame included, s: with the most stuff bits its
    /// bits can need.
    #[must_use]
    pub fn longest_s(self, bitrate_bps: u32, data_bitrate_bps: u32) -> f64 {
        let slow = f64::from(bitrate_bps.max(1));
        match self.format {
            Format::Classic => f64::from(classic_bits(self.extended, self.bytes)) / slow,
            Format::Remote { .. } => f64::from(classic_bits(self.extended, 0)) / slow,
            Format::Fd { fast } => {
                let [outside, inside] = fd_bits(self.extended, self.bytes);
                let rate = if fast { f64::from(data_bitrate_bps.max(1)) } else { slow };
                f64::from(outside) / slow + f64::from(inside) / rate
            }
        }
    }
}

/// Bits of a small count.
fn count(bytes: usize) -> u32 {
    u32::try_from(bytes).unwrap_or(u32::MAX / 64)
}

/// Bits before the CRC delimiter are stuffed, one more for each four in the worst case; 13 follow:
/// delimiter, acknowledgement, end of frame and pause.
fn classic_bits(extended: bool, bytes: usize) -> u32 {
    let stuffed = if extended { 54 } else { 34 } + 8 * count(bytes);
    stuffed + (stuffed - 1) / 4 + 13
}

/// Bits at the slow rate, and between the switches of rate. Before the CRC one stuff bit for each
/// four bits in the worst case; in the CRC field their places are fixed, one before each four bits.
fn fd_bits(extended: bool, bytes: usize) -> [u32; 2] {
    // Start, identifier, RRS (or SRR, IDE, 18 bits and RRS), IDE, FDF, res, BRS.
    let head = if extended { 36 } else { 17 };
    // ESI and length, then the bytes.
    let body = 5 + 8 * count(bytes);
    let crc = if bytes > 16 { 21 } else { 17 };
    // The count of stuff bits takes four.
    let check = 4 + crc;
    let fixed = check / 4 + 1;
    // Acknowledgement and its delimiter, end of frame 7, pause 3.
    let tail = 12;
    // The delimiter of the CRC counts in the payload's part, where it begins.
    [head + head / 4 + tail, body + body / 4 + 1 + check + fixed + 1]
}

#[cfg(test)]
mod tests {
    use super::*;

    // Davis et al., section 3: 135 bits for 8 bytes behind 11 bits of identifier, 55 for none;
    // 160 and 80 behind 29.
    #[test]
    fn classic_frames_are_as_long_as_the_literature_says() {
        for (extended, bytes, bits) in
            [(false, 8, 135), (false, 0, 55), (true, 8, 160), (true, 0, 80)]
        {
            let longest_s = Shape::classic(extended, bytes).longest_s(1_000_000, 0);
            assert!((longest_s - f64::from(bits) * 1e-6).abs() < 1e-12, "{longest_s}");
        }
        let remote = Shape { format: Format::Remote { length: 8 }, ..Shape::classic(false, 0) };
        assert!((remote.longest_s(500_000, 0) - 110e-6).abs() < 1e-12);
    }

    #[test]
    fn the_payload_of_a_fast_frame_goes_at_the_fast_rate() {
        let fd = |fast, bytes| Shape { extended: true, format: Format::Fd { fast }, bytes };
        let slow_s = fd(false, 24).longest_s(1_000_000, 5_000_000);
        let fast_s = fd(true, 24).longest_s(1_000_000, 5_000_000);
        // Head 36 with 9 stuff bits and tail 12 at 1 Mbit/s; 197 bits with 50 stuff bits, a check
        // of 25 with 7 and its delimiter at five.
        assert!((slow_s - 337e-6).abs() < 1e-12, "{slow_s}");
        assert!((fast_s - (57e-6 + 280e-6 / 5.0)).abs() < 1e-12, "{fast_s}");
    }
}
