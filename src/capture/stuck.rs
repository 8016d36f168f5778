//! A sensor whose values stand still while its number or time goes on.
//!
//! What is measured is never the same to the bit for long: noise sees to that. A sensor that says it turns, and
//! by exactly the same in six samples in a row, has stopped measuring. One that says it lies still may be coarse, or noise may
//! be less than one of its counts: it is given five seconds.
//!
//! One axis alone may die, or be at the end of its range. How often each value is the same as the one before is learnt while the
//! sensor lies still, from where it is so most often; where that is rare enough to show noise, a value that stays the same while the
//! sensor turns, for longer than noise would ever have it, has stopped too. So have all values that do, turning or not.

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

/// So many samples of a sensor at rest tell how often a value stays the same, and so many times that is looked at, before it is known.
const LEARNT: u32 = 100;
const TIMES: u32 = 5;
/// A value that stays the same more often is no finer than its noise (that is then 0.7 of a count), and may do so for long.
const FINE: f64 = 0.4;
/// A value stays the same for so long by chance less often than this; twice as long is waited for, because noise is filtered in
/// sensors, and then each sample is a little like the one before.
const CHANCE: f64 = 1e-12;
const FILTERED: f64 = 2.0;

/// How one value of a sensor changes from sample to sample.
#[derive(Clone, Copy, Debug, Default)]
struct Life {
    /// At rest: samples, and how many of them were like the one before.
    rested: u32,
    rested_same: u32,
    /// The greatest share of them so far, and how many times that was looked at.
    share: f64,
    times: u32,
    /// So many in a row were like the one before.
    same: u32,
    /// It has stopped, seen while the sensor turned.
    stopped: bool,
}

impl Life {
    /// Takes whether it is as it was before; true if it is so for longer than by chance.
    fn take(&mut self, is_same: bool, is_at_rest: bool) -> bool {
        self.same = if is_same { self.same.saturating_add(1) } else { 0 };
        if self.times >= TIMES && self.share <= FINE {
            let most = FILTERED * CHANCE.ln() / self.share.ln();
            if f64::from(self.same) > most {
                self.stopped |= !is_at_rest;
                return true;
            }
        }
        self.stopped = false;
        if is_at_rest {
            self.rested += 1;
            self.rested_same += u32::from(is_same);
        }
        if self.rested >= LEARNT {
            let share = (f64::from(self.rested_same) + 1.0) / (f64::from(self.rested) + 2.0);
            (self.share, self.times) = (self.share.max(share), self.times.saturating_add(1));
            (self.rested, self.rested_same) = (0, 0);
        }
        false
    }
}

/// What a sensor measured.
type Values = [Option<DVec3>; 4];

/// Looks at the samples of one sensor.
#[derive(Clone, Copy, Debug, Default)]
pub struct Stuck {
    last: Option<(Values, Instant)>,
    same: u32,
    /// Of each axis of the angular rate, then of the acceleration.
    axes: [Life; 6],
}

impl Stuck {
    /// True if the sensor, or an axis of it, has stopped measuring, as far as this sample and those before it tell. Only sensors that
    /// tell acceleration and angular rate are judged.
    pub fn take(&mut self, sample: &SensorSample, taken: Instant) -> bool {
        let (Some(rate), Some(acceleration)) =
            (sample.angular_rate_rad_s, sample.acceleration_m_s2)
        else {
            return false;
        };
        let now = [rate, acceleration].map(|of| of.to_array());
        let is_at_rest = rate.length() < TURNS_RAD_S;
        let mut still = 0;
        if let Some(([Some(rate_before), Some(before), ..], _)) = self.last {
            let before = [rate_before, before].map(|of| of.to_array());
            let pairs = now.as_flattened().iter().zip(before.as_flattened());
            for ((value, before), life) in pairs.zip(&mut self.axes) {
                still += usize::from(life.take(value == before, is_at_rest));
            }
        }
        let has_stopped = self.axes.iter().any(|axis| axis.stopped);
        let is_axis_stuck = has_stopped || still == self.axes.len();
        let values = [
            sample.angular_rate_rad_s,
            sample.acceleration_m_s2,
            sample.linear_acceleration_m_s2,
            sample.magnetic_field_t,
        ];
        let Some((last, since)) = self.last.filter(|(last, _)| *last == values) else {
            (self.last, self.same) = (Some((values, taken)), 0);
            return is_axis_stuck;
        };
        self.last = Some((last, since));
        self.same = self.same.saturating_add(1);
        let same_s = taken.seconds_since(since);
        // A virtual sensor without noise that lies still says nothing but its weight.
        let is_ideal = rate == DVec3::ZERO && acceleration != DVec3::ZERO;
        let is_stuck = match rate.length() > TURNS_RAD_S {
            true => self.same >= SAME && same_s >= SAME_S,
            false => self.same >= SAME && same_s >= STILL_S && !is_ideal,
        };
        is_stuck || is_axis_stuck
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
        assert_eq!(seen_after_s(DVec3::ZERO), None, "as an ideal one that lies still");
        let mut stuck = Stuck::default();
        let dead = SensorSample {
            acceleration_m_s2: Some(DVec3::ZERO),
            angular_rate_rad_s: Some(DVec3::ZERO),
            ..SensorSample::default()
        };
        let seen = (0..1000).find(|n| stuck.take(&dead, Instant::from_nanos(n * 10_000_000)));
        assert_eq!(seen, Some(500), "not even its weight");
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

    /// A sensor with noise of so many counts, each sample like the one before by `filtered`, that lies still and then turns about X: the
    /// number of samples that it is called stuck, of an hour at 100 Hz, and from which sample on.
    fn of_an_hour(noise_counts: f64, filtered: f64, spoil: impl Fn(u64, &mut DVec3)) -> (u64, u64) {
        use rand::{RngExt, SeedableRng};
        const COUNT_RAD_S: f64 = 0.001;
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        let mut normal = || (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0;
        let (mut stuck, mut noise) = (Stuck::default(), [DVec3::ZERO; 2]);
        let (mut found, mut first) = (0, u64::MAX);
        for n in 0..360_000_u64 {
            for of in &mut noise {
                let new = DVec3::new(normal(), normal(), normal());
                *of = filtered * *of + (1.0 - filtered * filtered).sqrt() * new;
            }
            let t = n as f64 / 100.0;
            let turns = if t % 20.0 < 10.0 { 0.0 } else { 2000.0 * (5.0 * t).sin() };
            // The bias drifts, so that noise is now between two counts and now on one.
            let bias = DVec3::splat(3.0 * (t / 300.0).sin());
            let said = DVec3::X * turns + bias + noise_counts * noise[0];
            let weight = DVec3::Z * 9800.0 + bias + noise_counts * noise[1];
            let mut rate = said.round() * COUNT_RAD_S;
            spoil(n, &mut rate);
            // Not a number stands for nothing at all, and for the weight that was measured first.
            let is_frozen = rate.is_nan();
            let weight = if is_frozen { DVec3::Z * 9800.0 } else { weight };
            let rate = if is_frozen { DVec3::ZERO } else { rate };
            let said = SensorSample {
                angular_rate_rad_s: Some(rate),
                acceleration_m_s2: Some(weight.round() * COUNT_RAD_S),
                ..SensorSample::default()
            };
            if stuck.take(&said, Instant::from_nanos(n * 10_000_000)) {
                (found, first) = (found + 1, first.min(n));
            }
        }
        (found, first)
    }

    #[test]
    fn an_axis_that_dies_is_seen_within_a_fifth_of_a_second_and_no_coarse_or_filtered_one_is_taken_for_it()
     {
        let dies = |n: u64, rate: &mut DVec3| {
            if n >= 1500 {
                rate.y = 0.0;
            }
        };
        let (found, first) = of_an_hour(30.0, 0.0, dies);
        assert!(found == 360_000 - first && (1500..1520).contains(&first), "{found}, {first}");
        // As it is at the end of its range.
        let clipped = |n: u64, rate: &mut DVec3| {
            if (1500..1600).contains(&n) {
                rate.z = 4.36;
            }
        };
        let (found, first) = of_an_hour(3.0, 0.0, clipped);
        assert!((50..100).contains(&found) && first < 1550, "{found}, {first}");
        for noise_counts in [0.0, 0.3, 0.5, 0.7, 0.8, 1.0, 3.0, 30.0] {
            for filtered in [0.0, 0.5, 0.9] {
                let (found, first) = of_an_hour(noise_counts, filtered, |_, _| ());
                // What lies still without noise says nothing new for five seconds.
                assert!(noise_counts < 0.4 || found == 0, "{noise_counts}: {found}, {first}");
            }
        }
        // All of it, at rest, said to be nothing.
        let frozen = |n: u64, rate: &mut DVec3| {
            if n >= 2500 {
                *rate = DVec3::NAN;
            }
        };
        let (found, first) = of_an_hour(30.0, 0.0, frozen);
        assert!(found == 360_000 - first && (2500..2520).contains(&first), "{found}, {first}");
        // Whoever hears it from its death on never knew it alive.
        let (found, _) = of_an_hour(30.0, 0.0, |_, rate| rate.y = 0.0);
        assert_eq!(found, 0);
    }
}
