//! Low-pass filtering without delay, for captures whose noise would become acceleration.
//!
//! Second-order Butterworth, run forwards and backwards (Winter, "Biomechanics and Motor Control of
//! Human Movement", 4th ed., 2009, sec. 3.4.4.2). Two passes would put -6 dB at a pass's own
//! cutoff; each pass is therefore set wider by (sqrt(2) - 1)^(-1/4) in the bilinear (warped)
//! frequency, so that `cutoff_hz` is where the result is down by 3 dB.

use core::f64::consts::{PI, SQRT_2};

use crate::error::Error;

/// Least distance of the cutoff, as a part of the rate, from zero and from half the rate; nearer
/// ones would need more padding than they are worth.
const MIN_RATIO: f64 = 1e-4;

/// At which ends a series is at rest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Rests {
    /// At its first sample.
    pub start: bool,
    /// At its last sample.
    pub end: bool,
}

/// Filters evenly sampled values that may be moving at both ends: [`low_pass_between`] no rests.
///
/// # Errors
/// As [`low_pass_between`].
pub fn low_pass(values: &[f64], rate_hz: f64, cutoff_hz: f64) -> Result<Vec<f64>, Error> {
    low_pass_between(values, rate_hz, cutoff_hz, Rests::default())
}

/// Filters evenly sampled values; any length works. Beyond an end that moves the series is continued
/// by its point reflection: the end keeps its value, and a straight line stays one. Beyond an end at
/// rest it is continued by its mirror image: the end stays at rest.
///
/// # Errors
/// If the cutoff is not between a ten-thousandth and a half of the rate.
pub fn low_pass_between(
    values: &[f64],
    rate_hz: f64,
    cutoff_hz: f64,
    rests: Rests,
) -> Result<Vec<f64>, Error> {
    let ratio = cutoff_hz / rate_hz;
    if !(rate_hz.is_finite() && rate_hz > 0.0 && (MIN_RATIO..0.5 - MIN_RATIO).contains(&ratio)) {
        return Err(Error::new("the cutoff of a low-pass filter does not fit the rate")
            .got(format!("{cutoff_hz} Hz at {rate_hz} Hz"))
            .allowed("more than a ten-thousandth and less than half the rate"));
    }
    let [first, .., last] = values else { return Ok(values.to_vec()) };
    // Through the ends that move: without it the continued series is odd about these, and periodic.
    let line = |i: f64| match (rests.start, rests.end) {
        (false, false) => first + (last - first) * i / (values.len() - 1) as f64,
        (true, false) => *last,
        (_, true) => *first,
    };
    let detrended: Vec<f64> =
        values.iter().enumerate().map(|(i, value)| value - line(i as f64)).collect();
    // After this many samples the filter has forgotten its start (to 1e-7); near half the rate it
    // rings as long as it lags near zero.
    let padding = (4.0 / ratio.min(0.5 - ratio)).ceil() as usize;
    let mut padded: Vec<f64> = (0..values.len() + 2 * padding)
        .map(|i| reflected(&detrended, i as i64 - padding as i64, rests))
        .collect();
    let filter = Biquad::low_pass(ratio);
    filter.run(padded.iter_mut());
    filter.run(padded.iter_mut().rev());
    Ok((0..values.len()).map(|i| padded[padding + i] + line(i as f64)).collect())
}

/// The continuation of a series beyond its ends: even about those at rest, odd about the others,
/// where the series is zero.
fn reflected(series: &[f64], index: i64, rests: Rests) -> f64 {
    let sign = |rests: bool| if rests { 1.0 } else { -1.0 };
    let (start, end) = (sign(rests.start), sign(rests.end));
    let last = series.len() as i64 - 1;
    let phase = index.rem_euclid(2 * last);
    let round = if index.div_euclid(2 * last) % 2 == 0 { 1.0 } else { start * end };
    let value = if phase <= last {
        series[phase as usize]
    } else {
        end * series[(2 * last - phase) as usize]
    };
    round * value
}

/// A second-order section with unit gain at zero frequency.
struct Biquad {
    gain: f64,
    feedback: [f64; 2],
}

impl Biquad {
    fn low_pass(ratio: f64) -> Self {
        let warped = (PI * ratio).tan() / (SQRT_2 - 1.0).powf(0.25);
        let scale = 1.0 + SQRT_2 * warped + warped * warped;
        Self {
            gain: warped * warped / scale,
            feedback: [
                2.0 * (warped * warped - 1.0) / scale,
                (1.0 - SQRT_2 * warped + warped * warped) / scale,
            ],
        }
    }

    /// Filters in place, starting as if the first value had lasted for ever.
    fn run<'a>(&self, values: impl Iterator<Item = &'a mut f64>) {
        let mut state: Option<[f64; 4]> = None;
        for value in values {
            let x = *value;
            let [x1, x2, y1, y2] = state.unwrap_or([x; 4]);
            let y = self.gain * (x + 2.0 * x1 + x2) - self.feedback[0] * y1 - self.feedback[1] * y2;
            *value = y;
            state = Some([x, x1, y, y1]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::TAU;
    use proptest::prelude::*;

    /// Amplitude ratio and delay-free check of a sine in the middle of a long series.
    fn gain_at(hz: f64, cutoff_hz: f64) -> f64 {
        let rate_hz = 120.0;
        let wave = |i: usize| (TAU * hz * i as f64 / rate_hz).sin();
        let filtered = low_pass(&(0..2400).map(wave).collect::<Vec<_>>(), rate_hz, cutoff_hz);
        let filtered = filtered.unwrap();
        let (mut along, mut power) = (0.0, 0.0);
        for (i, value) in filtered.iter().enumerate().take(1800).skip(600) {
            along += value * wave(i);
            power += wave(i) * wave(i);
        }
        along / power
    }

    #[test]
    fn the_cutoff_is_where_two_passes_together_lose_three_decibels() {
        for cutoff_hz in [3.0, 6.0, 12.0, 30.0] {
            let gain = gain_at(cutoff_hz, cutoff_hz);
            assert!((gain - 0.5f64.sqrt()).abs() < 1e-3, "{cutoff_hz} Hz: {gain}");
        }
        assert!(gain_at(1.0, 6.0) > 0.999);
        assert!(gain_at(24.0, 6.0).abs() < 0.01);
    }

    #[test]
    fn series_of_any_length_work_and_a_line_is_left_alone() {
        for len in 0..40 {
            let line: Vec<f64> = (0..len).map(|i| 3.0 - 0.25 * f64::from(i)).collect();
            let filtered = low_pass(&line, 100.0, 6.0).unwrap();
            assert_eq!(filtered.len(), line.len());
            for (a, b) in filtered.iter().zip(&line) {
                assert!((a - b).abs() < 1e-12, "{len}: {a} {b}");
            }
        }
    }

    #[test]
    fn cutoffs_that_do_not_fit_the_rate_are_refused() {
        for (rate_hz, cutoff_hz) in
            [(100.0, 50.0), (100.0, 0.0), (100.0, -1.0), (100.0, f64::NAN), (0.0, 1.0)]
        {
            assert!(low_pass(&[0.0; 9], rate_hz, cutoff_hz).is_err(), "{cutoff_hz}");
        }
        assert!(low_pass(&[0.0; 9], f64::INFINITY, 6.0).is_err());
    }

    proptest! {
        #[test]
        fn the_ends_stay_where_they_are(
            values in prop::collection::vec(-2.0..2.0, 2..200),
            cutoff_hz in 1.0..40.0,
        ) {
            let filtered = low_pass(&values, 100.0, cutoff_hz).unwrap();
            prop_assert!((filtered[0] - values[0]).abs() < 1e-5);
            prop_assert!((filtered[values.len() - 1] - values[values.len() - 1]).abs() < 1e-5);
        }

        #[test]
        fn an_end_at_rest_stays_at_rest_and_the_other_keeps_its_value(
            steps in prop::collection::vec(-0.1..0.1, 20..200),
            cutoff_hz in 2.0..12.0,
        ) {
            // Twice a sum: starts with rest, ends anyhow.
            let (mut velocity, mut at) = (0.0, 0.0);
            let mut values = vec![0.0; 3];
            for step in &steps {
                velocity += step;
                at += velocity;
                values.push(at);
            }
            let rests = Rests { start: true, end: false };
            let filtered = low_pass_between(&values, 100.0, cutoff_hz, rests).unwrap();
            // As much as a mirrored series, whose middle is even by symmetry.
            let mirrored: Vec<f64> =
                values[1..].iter().rev().chain(&values).copied().collect();
            let whole = low_pass(&mirrored, 100.0, cutoff_hz).unwrap();
            let scale = values.iter().fold(1.0, |most: f64, value| most.max(value.abs()));
            for (a, b) in filtered.iter().zip(&whole[values.len() - 1..]) {
                prop_assert!((a - b).abs() < 1e-5 * scale);
            }
            let end = values.len() - 1;
            prop_assert!((filtered[end] - values[end]).abs() < 1e-5 * scale);
        }

        #[test]
        fn filtering_backwards_in_time_gives_the_same_curve_backwards(
            mut values in prop::collection::vec(-2.0..2.0, 3..100),
        ) {
            let mut there = low_pass(&values, 100.0, 8.0).unwrap();
            values.reverse();
            let back = low_pass(&values, 100.0, 8.0).unwrap();
            there.reverse();
            for (a, b) in there.iter().zip(&back) {
                prop_assert!((a - b).abs() < 1e-5);
            }
        }
    }
}
