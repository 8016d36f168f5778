//! BNO080/085/086 in UART-RVC mode: `AA AA index yaw pitch roll ax ay az r r r SUM`, 100 Hz.
//!
//! Source: CEVA/Hillcrest BNO080 data sheet 1.3, section 1.3.5.2.

use super::{Reading, fixed, same, sum, words};
use crate::wire::Decoded;

pub(super) fn decode(bytes: &[u8]) -> Decoded<Reading> {
    fixed(bytes, &[0xAA, 0xAA], 19, |packet| {
        same(u16::from(sum(&packet[2..18])), u16::from(packet[18]))?;
        let [yaw, pitch, roll, ax, ay, az] = words(&packet[3..15]);
        Ok(Reading {
            acceleration: Some([ax, ay, az]),
            euler: Some([roll, pitch, yaw]),
            counter: Some(u64::from(packet[2])),
            ..Reading::default()
        })
    })
}
