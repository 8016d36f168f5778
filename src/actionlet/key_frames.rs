//! Key frames: poses a while apart, between which each joint goes as an actionlet.

use super::shape::Shape;
use crate::error::{Error, ErrorKind, counted};

/// Rows of a table that are all further apart than this are key frames, s: what captures and robots tell comes more
/// often.
pub const APART_S: f64 = 0.5;
/// Poses per second that are made of them.
const RATE_HZ: f64 = 100.0;
/// Most angles that are made of them: a small file must not need much memory.
const MOST: f64 = 5e5;

/// An instant between key frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InBetween {
    /// When, s after the first.
    pub time_s: f64,
    /// The key frame before it, or at it.
    pub before: usize,
    /// How much of the way to the next is behind it, from 0 to 1: at rest at both ends (Eq. 1 of the actionlet paper,
    /// peak in the middle).
    pub progress: f64,
}

impl InBetween {
    /// A value that goes from key frame to key frame; nothing without these.
    #[must_use]
    pub fn of(&self, keys: &[f64]) -> Option<f64> {
        let from = *keys.get(self.before)?;
        let to = keys.get(self.before + 1).copied().unwrap_or(from);
        Some(from + (to - from) * self.progress)
    }
}

/// Even instants over rows of a table with these rising times, s, and how many there are a second; nothing unless they
/// are key frames. `width` angles are made for each instant.
///
/// # Errors
/// Key frames over so long a time that too much would be made of them.
pub fn between(times_s: &[f64], width: usize) -> Result<Option<(f64, Vec<InBetween>)>, Error> {
    let ends = times_s.first().zip(times_s.last());
    let are_apart = times_s.windows(2).all(|two| two[1] - two[0] > APART_S);
    let Some((first_s, last_s)) = ends.filter(|_| times_s.len() >= 2 && are_apart) else {
        return Ok(None);
    };
    let duration_s = last_s - first_s;
    let most_s = MOST / width.max(1) as f64 / RATE_HZ;
    if !(duration_s <= most_s) {
        return Err(Error::of(ErrorKind::OutsideLimits, "key frames over too long a time")
            .got(format!("{duration_s} s"))
            .allowed(format!("{most_s:.0} s, for {}", counted(width, "angle")))
            .remedy("cut the table into shorter ones, or give poses more often"));
    }
    let count = (duration_s * RATE_HZ).ceil();
    let step_s = duration_s / count;
    let shape = Shape::default();
    let instant = |index: usize| {
        let time_s = index as f64 * step_s;
        let after = times_s.partition_point(|key_s| key_s - first_s <= time_s);
        let before = after.saturating_sub(1).min(times_s.len() - 2);
        let (from_s, to_s) = (times_s[before] - first_s, times_s[before + 1] - first_s);
        let part = ((time_s - from_s) / (to_s - from_s)).clamp(0.0, 1.0);
        InBetween { time_s, before, progress: shape.progress(part)[0] }
    };
    Ok(Some((1.0 / step_s, (0..=count as usize).map(instant).collect())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn between_key_frames_a_joint_goes_as_equation_1_of_the_paper() {
        let (rate_hz, instants) =
            between(&[3.0, 4.0, 6.0], 22).expect("short").expect("key frames");
        assert_eq!((rate_hz, instants.len()), (100.0, 301));
        for instant in &instants {
            let value = instant.of(&[10.0, 30.0, -10.0]).expect("a value");
            let t = instant.time_s;
            // The angle is a ramp less a sine, so that velocity and acceleration are zero at both ends.
            let ramp = |u: f64| u - (std::f64::consts::TAU * u).sin() / std::f64::consts::TAU;
            let expected = match t {
                t if t <= 1.0 => 10.0 + 20.0 * ramp(t),
                t => 30.0 - 40.0 * ramp((t - 1.0) / 2.0),
            };
            assert!((value - expected).abs() < 1e-9, "{t}: {value}, not {expected}");
        }
    }

    #[test]
    fn rows_that_are_nearer_are_no_key_frames_and_too_long_ones_are_refused() {
        // Half a second is how often a capture may tell.
        for times_s in [&[][..], &[1.0], &[0.0, 0.5, 1.5], &[0.0, f64::NAN, 2.0]] {
            assert_eq!(between(times_s, 22).expect("no key frames"), None, "{times_s:?}");
        }
        for times_s in [[0.0, 1e9], [0.0, 1e300], [0.0, f64::INFINITY], [0.0, 228.0]] {
            let refused = between(&times_s, 22).expect_err("too long").to_string();
            assert!(refused.contains("227 s, for 22 angles"), "{refused}");
        }
        let (_, odd) = between(&[0.0, 0.777_7, 1.9], 1).expect("short").expect("key frames");
        assert_eq!(odd.last().and_then(|last| last.of(&[1.0, 2.0, 5.0])), Some(5.0));
    }
}
