//! SI helpers: angle wrapping and the words for degrees where a person reads.

use core::f64::consts::{PI, TAU};

/// Wraps an angle to (-pi, pi].
#[must_use]
pub fn wrap_rad(angle_rad: f64) -> f64 {
    let wrapped = angle_rad.rem_euclid(TAU);
    if wrapped > PI { wrapped - TAU } else { wrapped }
}

/// Bytes of an 8N1 serial line as seconds: ten bit times each.
#[must_use]
pub fn line_time_s(bytes: usize, baud_bps: u32) -> f64 {
    bytes as f64 * 10.0 / f64::from(baud_bps)
}
