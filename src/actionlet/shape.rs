//! Velocity functions of an actionlet over its own time `u` in [0, 1].
//!
//! A shape is a velocity `v(u)` that is zero at 0 and 1 and positive between, with its integral
//! `S(u)`. The angle follows as `y = a + delta S(u) / S(1)`.

use core::f64::consts::PI;
use std::sync::Arc;

use crate::actionlet::sampled::Sampled;
use crate::error::Error;

/// Earliest and latest place of the speed peak: nearer the ends, acceleration and jerk explode.
pub const PEAK_AT: core::ops::RangeInclusive<f64> = 0.1..=0.9;

/// A velocity function.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// Two half sines that meet at the peak (Zheng et al. 2007, Eq. 1).
    HalfSine(PeakAt),
    /// `S = 10 u^3 - 15 u^4 + 6 u^5` (Flash and Hogan, "The coordination of arm movements", 1985).
    MinimumJerk,
    /// Through given samples.
    Sampled(Arc<Sampled>),
}

/// Where a half-sine shape has its speed peak, T in the paper: in [`PEAK_AT`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PeakAt(f64);

impl PeakAt {
    /// The place of the peak as a part of the duration.
    #[must_use]
    pub const fn value(self) -> f64 {
        self.0
    }
}

impl Default for Shape {
    /// The half sine with its peak in the middle.
    fn default() -> Self {
        Self::HalfSine(PeakAt(0.5))
    }
}

impl Shape {
    /// The half-sine shape with its peak at `peak_at` of the duration.
    ///
    /// # Errors
    /// If the peak is not in [`PEAK_AT`].
    pub fn half_sine(peak_at: f64) -> Result<Self, Error> {
        if !PEAK_AT.contains(&peak_at) {
            return Err(Error::new("the speed peak of an actionlet is too near an end")
                .got(peak_at.to_string())
                .allowed(format!("{} to {} of its duration", PEAK_AT.start(), PEAK_AT.end())));
        }
        Ok(Self::HalfSine(PeakAt(peak_at)))
    }

    /// `S(u)`, `v(u)`, `v'(u)` and `v''(u)`, for u in [0, 1]. Where v'' steps (at T), the value
    /// after the step.
    #[must_use]
    pub fn raw(&self, u: f64) -> [f64; 4] {
        let u = u.clamp(0.0, 1.0);
        match *self {
            Self::HalfSine(PeakAt(t)) if u < t => rising(u, t),
            Self::HalfSine(PeakAt(t)) => {
                // The falling side is the rising side of T' = 1 - T seen from the end.
                let [s, v, first, second] = rising(1.0 - u, 1.0 - t);
                [0.5 - s, v, -first, second]
            }
            Self::MinimumJerk => {
                let w = 1.0 - u;
                [
                    u * u * u * (10.0 - 15.0 * u + 6.0 * u * u),
                    30.0 * u * u * w * w,
                    60.0 * u * w * (1.0 - 2.0 * u),
                    60.0 * (1.0 - 6.0 * u + 6.0 * u * u),
                ]
            }
            Self::Sampled(ref sampled) => sampled.raw(u),
        }
    }

    /// `S(1)`: 1/2 for every half sine.
    #[must_use]
    pub const fn total(&self) -> f64 {
        match self {
            Self::HalfSine(_) => 0.5,
            Self::MinimumJerk | Self::Sampled(_) => 1.0,
        }
    }

    /// `S(u) / S(1)`, rising from 0 to 1, and its first three derivatives.
    #[must_use]
    pub fn progress(&self, u: f64) -> [f64; 4] {
        self.raw(u).map(|value| value / self.total())
    }

    /// Greatest magnitudes of the three derivatives of [`Self::progress`].
    #[must_use]
    pub fn peaks(&self) -> [f64; 3] {
        match self {
            Self::HalfSine(PeakAt(t)) => {
                let shorter = t.min(1.0 - *t);
                [2.0, PI / shorter, PI * PI / (shorter * shorter)]
            }
            // v' peaks where v'' vanishes, u = (3 - sqrt 3) / 6; v'' peaks at the ends.
            Self::MinimumJerk => [1.875, 10.0 / 3f64.sqrt(), 60.0],
            Self::Sampled(sampled) => sampled.peaks(),
        }
    }
}

/// The half sine up to its peak at `t`: S = u/2 - T/(2 pi) sin(pi u/T), v = (1 - cos(pi u/T))/2 and
/// its derivatives. The square of a sine is zero exactly where it should be.
fn rising(u: f64, t: f64) -> [f64; 4] {
    let angle = PI * u / t;
    [
        u / 2.0 - t / (2.0 * PI) * angle.sin(),
        (angle / 2.0).sin().powi(2),
        PI / (2.0 * t) * angle.sin(),
        PI * PI / (2.0 * t * t) * angle.cos(),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::ease;
    use proptest::prelude::*;

    fn shapes() -> impl Strategy<Value = Shape> {
        let half_sines = (0.1..0.9).prop_map(|t| Shape::half_sine(t).unwrap());
        let sampled = prop::collection::vec(0.05..1.0, 1..12).prop_map(|inside| {
            let samples: Vec<f64> = [0.0].into_iter().chain(inside).chain([0.0]).collect();
            Shape::Sampled(Arc::new(Sampled::through(&samples).unwrap()))
        });
        prop_oneof![half_sines, Just(Shape::MinimumJerk), sampled]
    }

    /// Where v'' steps, and both ends.
    fn kinks(shape: &Shape) -> Vec<f64> {
        match shape {
            Shape::HalfSine(t) => vec![0.0, t.value(), 1.0],
            Shape::MinimumJerk => vec![0.0, 1.0],
            Shape::Sampled(sampled) => {
                let last = sampled.velocities().len() - 1;
                (0..=last).map(|index| index as f64 / last as f64).collect()
            }
        }
    }

    /// Gauss-Legendre with five points on each of `pieces` pieces (Abramowitz and Stegun, 25.4.30).
    fn integral(from: f64, to: f64, pieces: i32, f: impl Fn(f64) -> f64) -> f64 {
        let a = (5.0 - 2.0 * (10f64 / 7.0).sqrt()).sqrt() / 3.0;
        let b = (5.0 + 2.0 * (10f64 / 7.0).sqrt()).sqrt() / 3.0;
        let (wa, wb) =
            ((322.0 + 13.0 * 70f64.sqrt()) / 900.0, (322.0 - 13.0 * 70f64.sqrt()) / 900.0);
        let half = (to - from) / f64::from(pieces) / 2.0;
        (0..pieces)
            .map(|i| {
                let mid = from + half * f64::from(2 * i + 1);
                let at = |x: f64| f(mid + half * x) + f(mid - half * x);
                half * (128.0 / 225.0 * f(mid) + wa * at(a) + wb * at(b))
            })
            .sum()
    }

    #[test]
    fn the_printed_form_of_the_velocity_agrees() {
        // Eq. 1: (1 + sin(pi/T (u - T/2)))/2 and (1 + sin(pi/(1-T) (u - (T - (1-T)/2))))/2.
        for t in [0.1, 0.3, 0.5, 0.77, 0.9] {
            let shape = Shape::half_sine(t).unwrap();
            for i in 0..=100 {
                let u = f64::from(i) / 100.0;
                let v = if u <= t {
                    (1.0 + (PI / t * (u - t / 2.0)).sin()) / 2.0
                } else {
                    (1.0 + (PI / (1.0 - t) * (u - (t - (1.0 - t) / 2.0))).sin()) / 2.0
                };
                assert!((shape.raw(u)[1] - v).abs() < 1e-14, "T {t}, u {u}");
            }
        }
    }

    #[test]
    fn the_integral_is_half_of_t_at_the_peak_and_a_half_at_the_end() {
        for t in [0.1, 0.3, 0.5, 0.77, 0.9] {
            let shape = Shape::half_sine(t).unwrap();
            assert!((shape.raw(t)[0] - t / 2.0).abs() < 1e-15);
            assert_eq!(shape.raw(t)[1], 1.0);
            assert_eq!(shape.raw(1.0)[0], 0.5);
        }
        assert_eq!(Shape::MinimumJerk.raw(1.0)[0], 1.0);
    }

    #[test]
    fn the_middle_peak_is_the_step_that_motion_uses() {
        for i in 0..=100 {
            let u = f64::from(i) / 100.0;
            assert!((Shape::default().progress(u)[0] - ease::step(u)).abs() < 1e-15);
        }
        assert_eq!(Shape::default().peaks()[..2], [ease::PEAK_RATE, ease::PEAK_SECOND]);
    }

    #[test]
    fn a_peak_too_near_an_end_is_refused() {
        for t in [0.0, 0.099, 0.901, 1.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(Shape::half_sine(t).is_err(), "{t}");
        }
        assert!(Shape::half_sine(0.1).is_ok() && Shape::half_sine(0.9).is_ok());
    }

    proptest! {
        #[test]
        fn velocity_vanishes_exactly_at_both_ends_and_nowhere_between(
            shape in shapes(),
            u in 1e-6..0.999_999,
        ) {
            prop_assert_eq!(shape.raw(0.0)[1], 0.0);
            prop_assert_eq!(shape.raw(1.0)[1], 0.0);
            prop_assert!(shape.raw(u)[1] > 0.0);
        }

        #[test]
        fn the_integral_in_closed_form_is_the_integral(shape in shapes(), u in 0.0..1.0) {
            // A kink in v'' would spoil a rule that steps over it.
            let kinks = kinks(&shape);
            let v = |u: f64| shape.raw(u)[1];
            let numeric: f64 = kinks
                .windows(2)
                .map(|piece| integral(piece[0].min(u), piece[1].min(u), 24, v))
                .sum();
            prop_assert!((shape.raw(u)[0] - numeric).abs() < 1e-12);
        }

        #[test]
        fn each_derivative_is_the_derivative_of_the_one_before(
            shape in shapes(),
            u in 0.01..0.99f64,
        ) {
            let d = 1e-5;
            prop_assume!(kinks(&shape).iter().all(|kink| (u - kink).abs() > 2.0 * d));
            let (before, after) = (shape.raw(u - d), shape.raw(u + d));
            for order in 0..3 {
                let slope = (after[order] - before[order]) / (2.0 * d);
                let scale = 1.0 + shape.peaks()[order.min(2)];
                prop_assert!((slope - shape.raw(u)[order + 1]).abs() < 1e-3 * scale, "{}", order);
            }
        }

        #[test]
        fn peaks_are_reached_and_never_passed(shape in shapes()) {
            let mut seen = [0f64; 3];
            for i in 0..=20_000 {
                let got = shape.progress(f64::from(i) / 20_000.0);
                for order in 0..3 {
                    seen[order] = seen[order].max(got[order + 1].abs());
                }
            }
            for (seen, peak) in seen.iter().zip(shape.peaks()) {
                prop_assert!(*seen <= peak * (1.0 + 1e-12) && *seen > peak * 0.995);
            }
        }
    }
}
