//! The one smooth step of this module: the half-sine actionlet with its peak in the middle.
//!
//! Zheng et al., "Human Motion Simulation and Action Corpus", 2007, Eq. 1 with T = 1/2: the
//! velocity `v(u) = (1 - cos(2 pi u)) / 2` rises from zero and returns to it, and its integral,
//! scaled to reach 1, is the step below. Its first half is also how a clock starts (rate 0 to 1)
//! and its second half how a clock stops.

use core::f64::consts::{PI, TAU};

/// Peak of the step's first derivative, at u = 1/2.
pub const PEAK_RATE: f64 = 2.0;
/// Peak of the step's second derivative, at u = 1/4 (and its negative at 3/4).
pub const PEAK_SECOND: f64 = TAU;

/// Goes from 0 to 1 while `u` goes from 0 to 1; first and second derivative vanish at both ends.
#[must_use]
pub fn step(u: f64) -> f64 {
    let u = u.clamp(0.0, 1.0);
    if u <= 0.5 { rise(u) } else { 1.0 - rise(1.0 - u) }
}

fn rise(u: f64) -> f64 {
    u - (TAU * u).sin() / TAU
}

/// The step at `0, 1, ..., knots` knots, with an acceleration that follows the step's at the knots
/// and is linear between them. A cubic spline through these values is then that very curve, rising
/// from rest to rest without the slightest overshoot; through values of [`step`] it would overshoot
/// by some billionths, enough to leave a range whose bound is the target.
///
/// Its peak acceleration is larger than the step's by about `(2 pi / knots)^2 / 12`. `knots` is at
/// least 3; no knots give one value.
#[must_use]
pub fn knotted_step(knots: usize) -> Vec<f64> {
    let acceleration = |knot: usize| (TAU * knot as f64 / knots as f64).sin();
    let (mut position, mut velocity) = (0.0, 0.0);
    let mut positions = Vec::with_capacity(knots + 1);
    positions.push(position);
    for knot in 0..knots {
        let (from, to) = (acceleration(knot), acceleration(knot + 1));
        position += velocity + (2.0 * from + to) / 6.0;
        velocity += (from + to) / 2.0;
        positions.push(position);
    }
    for value in positions.iter_mut().skip(1) {
        *value /= position;
    }
    positions
}

/// Clock time shown after `elapsed_s` when a clock's rate climbs from 0 to 1 over `ease_s`; after
/// that the clock runs at rate 1. A clock started this way is `ease_s / 2` behind.
#[must_use]
pub fn eased_time_s(elapsed_s: f64, ease_s: f64) -> f64 {
    if !(elapsed_s < ease_s) {
        return elapsed_s - ease_s / 2.0;
    }
    ease_s * step(elapsed_s / ease_s / 2.0)
}

/// Rate of the clock of [`eased_time_s`]: `(1 - cos(pi tau / D)) / 2`.
#[must_use]
pub fn eased_rate(elapsed_s: f64, ease_s: f64) -> f64 {
    if !(elapsed_s < ease_s) {
        return 1.0;
    }
    (PI * elapsed_s / ease_s / 2.0).sin().powi(2)
}

/// Derivative of [`eased_rate`], 1/s.
#[must_use]
pub fn eased_rate_derivative(elapsed_s: f64, ease_s: f64) -> f64 {
    if !(elapsed_s < ease_s) {
        return 0.0;
    }
    PI / (2.0 * ease_s) * (PI * elapsed_s / ease_s).sin()
}

/// Shortest duration in which a joint can go `distance_rad` by one [`step`] and hold both limits.
#[must_use]
pub fn shortest_step_s(distance_rad: f64, velocity_rad_s: f64, acceleration_rad_s2: f64) -> f64 {
    let distance_rad = distance_rad.abs();
    let by_velocity = PEAK_RATE * distance_rad / velocity_rad_s;
    let by_acceleration = (PEAK_SECOND * distance_rad / acceleration_rad_s2).sqrt();
    by_velocity.max(by_acceleration)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_step_passes_through_its_fixed_points() {
        assert_eq!(step(0.0), 0.0);
        assert_eq!(step(1.0), 1.0);
        assert!((step(0.5) - 0.5).abs() < 1e-15);
        // u - sin(2 pi u) / (2 pi) at 1/4.
        assert!((step(0.25) - (0.25 - 1.0 / TAU)).abs() < 1e-15);
        assert_eq!(step(-3.0), 0.0);
        assert_eq!(step(7.0), 1.0);
    }

    #[test]
    fn an_eased_clock_is_half_its_ease_behind_and_its_rate_is_its_derivative() {
        let ease_s = 0.8;
        assert_eq!(eased_time_s(0.0, ease_s), 0.0);
        assert!((eased_time_s(0.8, ease_s) - 0.4).abs() < 1e-15);
        assert!((eased_time_s(2.0, ease_s) - 1.6).abs() < 1e-15);
        for i in 1..80 {
            let t = 0.01 * f64::from(i);
            let d = 1e-6;
            let slope = (eased_time_s(t + d, ease_s) - eased_time_s(t - d, ease_s)) / (2.0 * d);
            assert!((slope - eased_rate(t, ease_s)).abs() < 1e-8, "{t}");
            let bend = (eased_rate(t + d, ease_s) - eased_rate(t - d, ease_s)) / (2.0 * d);
            let at = t.min(ease_s - 2.0 * d);
            assert!((bend - eased_rate_derivative(at, ease_s)).abs() < 1e-4, "{t}");
        }
    }

    #[test]
    fn the_knotted_step_follows_the_step_and_its_spline_never_overshoots() {
        use crate::motion::spline::{End, Spline};
        for knots in [10, 33, 100, 1000] {
            let values = knotted_step(knots);
            let n = knots as f64;
            assert_eq!((values.len(), values[0], values[knots]), (knots + 1, 0.0, 1.0));
            for (knot, value) in values.iter().enumerate() {
                assert!((value - step(knot as f64 / n)).abs() < 1.0 / (n * n), "{knots}");
            }
            let rest = End::Velocity(0.0);
            let extremes = Spline::through(values, 1.0 / n, rest, rest).unwrap().extremes();
            assert!(extremes.position.min.value > -1e-15);
            assert!(extremes.position.max.value < 1.0 + 1e-15);
            let more = extremes.acceleration.peak().value.abs() / PEAK_SECOND - 1.0;
            assert!(more < 1.1 * (TAU / n).powi(2) / 12.0, "{knots}: {more}");
        }
    }

    #[test]
    fn a_clock_without_ease_simply_runs() {
        assert_eq!(eased_time_s(0.3, 0.0), 0.3);
        assert_eq!(eased_rate(0.0, 0.0), 1.0);
        assert_eq!(eased_rate_derivative(0.0, 0.0), 0.0);
    }
}
