//! How much of a series is noise.

use core::ops::RangeInclusive;

/// Orders of differences.
const ORDERS: RangeInclusive<usize> = 2..=10;
/// Noise is white if the next order of differences finds as much of it, to this part.
const AS_MUCH: f64 = 0.9;
/// Fewer differences say nothing about noise.
const FEWEST: usize = 16;
/// A standard deviation in medians of the magnitude, for a normal distribution.
const BY_MEDIAN: f64 = 1.4826;
/// Differences beyond so many standard deviations are motion: seams, steps, impacts.
const WITHIN: f64 = 3.0;
/// Standard deviation of what a normal distribution has within [`WITHIN`], in its own.
const OF_WITHIN: f64 = 0.986_58;

/// Standard deviation of the white noise in evenly sampled values, in their unit. Differences of a
/// higher order leave less of a motion and, by their own measure, as much of noise: it is found where
/// the next order finds as much. Noise that was smoothed away at half the rate is not seen.
pub fn noise(samples: &[f64]) -> f64 {
    let mut left = samples.to_vec();
    let mut before = f64::MAX;
    for order in 1..=*ORDERS.end() {
        for index in 1..left.len() {
            left[index - 1] = left[index] - left[index - 1];
        }
        left.pop();
        if left.len() < FEWEST {
            return 0.0;
        }
        let found = spread(&left) / of_white(order);
        if order > *ORDERS.start() && found >= AS_MUCH * before {
            return found;
        }
        before = found;
    }
    0.0
}

/// Standard deviation of normally distributed values around zero of which some few are others: a
/// first one by the median, and of what is within three of it the second.
fn spread(values: &[f64]) -> f64 {
    let mut sizes: Vec<f64> = values.iter().map(|value| value.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let most = WITHIN * BY_MEDIAN * sizes[sizes.len() / 2];
    let within = &sizes[..sizes.partition_point(|size| *size <= most)];
    let squares: f64 = within.iter().map(|size| size * size).sum();
    (squares / within.len() as f64).sqrt() / OF_WITHIN
}

/// Standard deviation of differences of an order of white noise of 1: the root of the sum of squared
/// binomial coefficients, which is C(2 order, order).
fn of_white(order: usize) -> f64 {
    let squared = (1..=order).map(|k| (order + k) as f64 / k as f64).product::<f64>();
    squared.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::TAU;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Normally distributed with a standard deviation of 1 (Box and Muller).
    fn normal(random: &mut ChaCha8Rng) -> f64 {
        let (one, other): (f64, f64) = (random.random(), random.random());
        (-2.0 * (1.0 - one).ln()).sqrt() * (TAU * other).cos()
    }

    #[test]
    fn differences_of_white_noise_are_as_large_as_their_coefficients() {
        // 1 -2 1 and 1 -4 6 -4 1.
        assert!((of_white(2) - 6f64.sqrt()).abs() < 1e-12);
        assert!((of_white(4) - 70f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn noise_on_a_fast_motion_is_found_to_a_tenth_at_every_usual_rate() {
        for (seed, rate_hz) in [30.0, 60.0, 120.0, 240.0f64].into_iter().enumerate() {
            let mut random = ChaCha8Rng::seed_from_u64(seed as u64);
            let clean = |i: i32| {
                let time_s = f64::from(i) / rate_hz;
                0.6 * (TAU * time_s).sin() + 0.2 * (TAU * 3.0 * time_s).sin()
            };
            for size in [0.01, 0.035] {
                let samples: Vec<f64> =
                    (0..3000).map(|i| clean(i) + size * normal(&mut random)).collect();
                let found = noise(&samples);
                assert!((found / size - 1.0).abs() < 0.1, "{rate_hz} Hz: {found} of {size}");
            }
            let samples: Vec<f64> = (0..3000).map(clean).collect();
            let found = noise(&samples);
            assert!(found < 0.002, "{rate_hz} Hz: {found} without noise");
        }
    }

    #[test]
    fn seams_and_rests_are_no_noise_and_a_few_samples_say_nothing() {
        let mut samples = vec![0.0; 400];
        for (index, value) in samples.iter_mut().enumerate().skip(150) {
            *value = if index < 250 { (index as f64 - 150.0) * 0.01 } else { 1.0 };
        }
        assert_eq!(noise(&samples), 0.0);
        assert_eq!(noise(&[0.0, 1.0, 0.0, 1.0, 0.0, 1.0]), 0.0);
    }
}
