//! The packet of the MPU-6050 sketch: `24 02 qw qx qy qz 00 COUNT 0D 0A`, big-endian words.
//!
//! Source: Jeff Rowberg, i2cdevlib, `MPU6050_DMP6.ino`, `OUTPUT_TEAPOT`. There is no check sum, and
//! `0D 0A` may occur inside; the fixed bytes at both ends are all there is to hold on to.

use super::{Reading, fixed};
use crate::wire::{Decoded, Reason};

pub(super) fn decode(bytes: &[u8]) -> Decoded<Reading> {
    fixed(bytes, &[0x24, 0x02], 14, |packet| {
        if packet[10] != 0 || packet[12..] != [0x0D, 0x0A] {
            return Err(Reason::Malformed);
        }
        let word = |at: usize| f64::from(i16::from_be_bytes([packet[at], packet[at + 1]]));
        Ok(Reading {
            quaternion: Some([word(2), word(4), word(6), word(8)]),
            counter: Some(u64::from(packet[11])),
            ..Reading::default()
        })
    })
}
