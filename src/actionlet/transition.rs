//! The actionlet from one angle to another that a joint can follow.

use crate::actionlet::{Actionlet, Shape};
use crate::error::Error;
use crate::motion::JointLimits;

/// Shortest duration in which a shape covers `distance_rad` within limits: `max(2 |delta| / v_max,
/// sqrt(pi |delta| / (a_max m)), cbrt(pi^2 |delta| / (j_max m^2)))` for a half sine, m = min(T, 1 -
/// T). Jerk is limited only if a limit is given. Zero for no distance.
#[must_use]
pub fn shortest_duration_s(
    shape: &Shape,
    distance_rad: f64,
    limits: &JointLimits,
    jerk_rad_s3: Option<f64>,
) -> f64 {
    let [first, second, third] = shape.peaks();
    let distance_rad = distance_rad.abs();
    let by_velocity = first * distance_rad / limits.velocity_rad_s();
    let by_acceleration = (second * distance_rad / limits.acceleration_rad_s2()).sqrt();
    let by_jerk = jerk_rad_s3.map_or(0.0, |jerk| (third * distance_rad / jerk).cbrt());
    by_velocity.max(by_acceleration).max(by_jerk)
}

/// The shortest actionlet from `from_rad` to `to_rad` within limits, none if the angles are equal.
///
/// # Errors
/// If an angle is not finite or a jerk limit is not above zero.
pub fn transition(
    begin_s: f64,
    from_rad: f64,
    to_rad: f64,
    shape: Shape,
    limits: &JointLimits,
    jerk_rad_s3: Option<f64>,
) -> Result<Option<Actionlet>, Error> {
    if let Some(jerk) = jerk_rad_s3
        && !(jerk.is_normal() && jerk > 0.0)
    {
        return Err(Error::new("a jerk limit is not usable")
            .got(format!("{jerk} rad/s^3"))
            .allowed("a finite number above zero"));
    }
    if from_rad == to_rad {
        return Ok(None);
    }
    let duration_s = shortest_duration_s(&shape, to_rad - from_rad, limits, jerk_rad_s3);
    Actionlet::new(begin_s, duration_s, from_rad, to_rad, shape).map(Some)
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::PI;
    use proptest::prelude::*;

    fn limits(velocity: f64, acceleration: f64) -> JointLimits {
        JointLimits::new(-3.0, 3.0, velocity, acceleration).unwrap()
    }

    #[test]
    fn the_tightest_limit_decides() {
        let shape = Shape::half_sine(0.3).unwrap();
        let by = |v, a, j| shortest_duration_s(&shape, -0.8, &limits(v, a), j);
        assert!((by(0.5, 1e6, None) - 3.2).abs() < 1e-12);
        assert!((by(1e6, 2.0, None) - (PI * 0.8 / (2.0 * 0.3)).sqrt()).abs() < 1e-12);
        let jerk = (PI * PI * 0.8 / (5.0 * 0.09)).cbrt();
        assert!((by(1e6, 1e6, Some(5.0)) - jerk).abs() < 1e-12);
    }

    #[test]
    fn equal_angles_give_no_actionlet_and_bad_numbers_an_error() {
        let limits = limits(1.0, 1.0);
        let go = |from, to, jerk| transition(0.0, from, to, Shape::default(), &limits, jerk);
        assert_eq!(go(0.4, 0.4, None).unwrap(), None);
        assert!(go(f64::NAN, 0.4, None).is_err());
        assert!(go(0.4, f64::INFINITY, None).is_err());
        assert!(go(0.4, 0.5, Some(0.0)).is_err());
    }

    proptest! {
        #[test]
        fn a_transition_holds_every_limit_and_touches_one(
            (from, to) in (-3.0..3.0, -3.0..3.0),
            (velocity, acceleration, jerk) in (0.1..10.0, 0.5..80.0, 1.0..2000.0),
            t in 0.1..0.9,
        ) {
            prop_assume!(from != to);
            let shape = Shape::half_sine(t).unwrap();
            let limits = limits(velocity, acceleration);
            let got = transition(0.0, from, to, shape, &limits, Some(jerk)).unwrap().unwrap();
            let peaks = got.peaks();
            let ratios = [
                peaks.velocity_rad_s / velocity,
                peaks.acceleration_rad_s2 / acceleration,
                peaks.jerk_rad_s3 / jerk,
            ];
            let worst = ratios.into_iter().fold(0.0, f64::max);
            prop_assert!((worst - 1.0).abs() < 1e-9, "{:?}", ratios);
        }
    }
}
