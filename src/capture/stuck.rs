//! A sensor whose values stand still while its number or time goes on.
//!
//! What is measured is never the same to the bit for long: noise sees to that. A sensor that says it turns, and
//! by exactly the same in six samples in a row, has stopped measuring. One that says it lies still may be coarse, or noise may
//! be less than one of its counts: it is given five seconds.

use crate::device::sensor::SensorSample;
use crate::time::Instant;
use glam::DVec3;

/// So many samples like the one before, over this time, s, of a sensor that says it turns.
const SAME: u32 = 5;
const SAME_S: f64 = 0.03;
/// Slower is not said to turn, rad/s.
const TURNS_RAD_S: f64 = 0.2;
/// One that says it lies still.
const STILL_S: f64 = 5.0;

/// What a sensor measured.
type Values = [Option<DVec3>; 4];

/// Looks at the samples of one sensor.
#[derive(Clone, Copy, Debug, Default)]
pub struct Stuck {
    last: Option<(Values, Instant)>,
    same: u32,
}

impl Stuck {
    /// True if the sensor has stopped measuring, as far as this sample and those before it tell. Only sensors that tell acceleration
    /// and angular rate are judged.
    pub fn take(&mut self, sample: &SensorSample, taken: Instant) -> bool {
        let (Some(rate), Some(_)) = (sample.angular_rate_rad_s, sample.acceleration_m_s2) else {
            return false;
        };
        let values = [
            sample.angular_rate_rad_s,
            sample.acceleration_m_s2,
            sample.linear_acceleration_m_s2,
            sample.magnetic_field_t,
        ];
        let Some((last, since)) = self.last.filter(|(last, _)| *last == values) else {
            (self.last, self.same) = (Some((values, taken)), 0);
            return false;
        };
        self.last = Some((last, since));
        self.same = self.same.saturating_add(1);
        let same_s = taken.seconds_since(since);
        // A virtual sensor without noise that lies still says just nothing.
        let is_nothing = rate == DVec3::ZERO;
        match rate.length() > TURNS_RAD_S {
            true => self.same >= SAME && same_s >= SAME_S,
            false => self.same >= SAME && same_s >= STILL_S && !is_nothing,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(rate: DVec3) -> SensorSample {
        let acceleration_m_s2 = Some(DVec3::new(0.1, 0.2, 9.8));
        let angular_rate_rad_s = Some(rate);
        SensorSample { acceleration_m_s2, angular_rate_rad_s, ..SensorSample::default() }
    }

    /// Time after which it is seen that all samples are the same, at 100 Hz, s.
    fn seen_after_s(rate: DVec3) -> Option<f64> {
        let mut stuck = Stuck::default();
        let at = |n: u64| Instant::from_nanos(n * 10_000_000);
        (0..1000).find(|n| stuck.take(&sample(rate), at(*n))).map(|n| n as f64 / 100.0)
    }

    #[test]
    fn who_turns_evenly_to_the_bit_has_stopped_measuring() {
        assert_eq!(seen_after_s(DVec3::new(0.0, 3.0, 0.0)), Some(0.05));
        assert_eq!(seen_after_s(DVec3::new(0.01, 0.0, 0.0)), Some(5.0));
        assert_eq!(seen_after_s(DVec3::ZERO), None);
    }

    #[test]
    fn one_bit_of_noise_is_life_and_who_measures_again_is_heard_at_once() {
        let mut stuck = Stuck::default();
        let at = |n: u64| Instant::from_nanos(n * 10_000_000);
        for n in 0..200 {
            let noise = if n % 4 == 0 { 0.001 } else { 0.0 };
            assert!(!stuck.take(&sample(DVec3::X * (3.0 + noise)), at(n)), "{n}");
        }
        assert!((200..210).any(|n| stuck.take(&sample(DVec3::Y), at(n))));
        assert!(!stuck.take(&sample(DVec3::Z), at(210)));
    }
}
