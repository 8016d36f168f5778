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

/// Filters evenly sampled values. The ends keep their values and a straight line is left as it is:
/// the series is continued beyond each end by its point reflection, as often as needed, so any
/// length works.
///
/// # Errors
/// If the cutoff is not between a ten-thousandth and a half of the rate.
pub fn low_pass(values: &[f64], rate_hz: f64, cutoff_hz: f64) -> Result<Vec<f64>, Error> {
    let ratio = cutoff_hz / rate_hz;
    if !(rate_hz.is_finite() && rate_hz > 0.0 && (MIN_RATIO..0.5 - MIN_RATIO).contains(&ratio)) {
        return Err(Error::new("the cutoff of a low-pass filter does not fit the rate")
            .got(format!("{cutoff_hz} Hz at {rate_hz} Hz"))
            .allowed("more than a ten-thousandth and less than half the rate"));
    }
    let [first, .., last] = values else { return Ok(values.to_vec()) };
    let line = |i: f64| first + (last - first) * i / (values.len() - 1) as f64;
    // Without the line through its ends the continued series is periodic, odd about each end.
    let detrended: Vec<f64> =
        values.iter().enumerate().map(|(i, value)| value - line(i as f64)).collect();
    // After this many samples the filter has forgotten its start (to 1e-7); near half the rate it
    // rings as long as it lags near zero.
    let padding = (4.0 / ratio.min(0.5 - ratio)).ceil() as usize;
    let mut padded: Vec<f64> = (0..values.len() + 2 * padding)
        .map(|i| reflected(&detrended, i as i64 - padding as i64))
        .collect();
    let filter = Biquad::low_pass(ratio);
    filter.run(padded.iter_mut());
    filter.run(padded.iter_mut().rev());
    Ok((0..values.len()).map(|i| padded[padding + i] + line(i as f64)).collect())
}

/// The odd periodic continuation of a series that is zero at both ends.
fn reflected(series: &[f64], index: i64) -> f64 {
    let last = series.len() as i64 - 1;
    let phase = index.rem_euclid(2 * last);
    if phase <= last { series[phase as usize] } else { -series[(2 * last - phase) as usize] }
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
