//! What one joint may do.

use crate::error::Error;
use crate::motion::spline::{Extreme, Extremes};

/// Rounding that is not a violation: relative to the limit (for positions to the larger of the
/// two).
const ROUNDING: f64 = 1e-12;

/// Position range and the greatest speed and acceleration of one joint. Always finite, ordered and
/// positive: checked when made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointLimits {
    lower_rad: f64,
    upper_rad: f64,
    velocity_rad_s: f64,
    acceleration_rad_s2: f64,
}

impl JointLimits {
    /// Makes limits from a range and the greatest absolute velocity and acceleration.
    ///
    /// # Errors
    /// If a number is not finite, the range is empty, or velocity or acceleration is not a normal
    /// positive number. The error does not know the joint; the caller adds it.
    pub fn new(
        lower_rad: f64,
        upper_rad: f64,
        velocity_rad_s: f64,
        acceleration_rad_s2: f64,
    ) -> Result<Self, Error> {
        if !(lower_rad.is_finite() && upper_rad.is_finite() && lower_rad < upper_rad) {
            return Err(Error::new("a joint's range is empty or not finite")
                .got(format!("{lower_rad} to {upper_rad} rad"))
                .allowed("finite bounds, the lower below the upper"));
        }
        let rates = [("velocity", velocity_rad_s), ("acceleration", acceleration_rad_s2)];
        for (quantity, value) in rates {
            if !(value.is_normal() && value > 0.0) {
                return Err(Error::new(format!("a joint's {quantity} limit is not usable"))
                    .got(value.to_string())
                    .allowed("a finite number above zero"));
            }
        }
        Ok(Self { lower_rad, upper_rad, velocity_rad_s, acceleration_rad_s2 })
    }

    /// The same range at this share of the pace.
    ///
    /// # Errors
    /// As [`JointLimits::new`].
    pub fn paced(&self, share: f64) -> Result<Self, Error> {
        let (velocity, acceleration) = (self.velocity_rad_s, self.acceleration_rad_s2);
        Self::new(self.lower_rad, self.upper_rad, velocity * share, acceleration * share)
    }

    /// Least position, rad.
    #[must_use]
    pub const fn lower_rad(&self) -> f64 {
        self.lower_rad
    }

    /// Greatest position, rad.
    #[must_use]
    pub const fn upper_rad(&self) -> f64 {
        self.upper_rad
    }

    /// Greatest speed, rad/s.
    #[must_use]
    pub const fn velocity_rad_s(&self) -> f64 {
        self.velocity_rad_s
    }

    /// Greatest absolute acceleration, rad/s^2.
    #[must_use]
    pub const fn acceleration_rad_s2(&self) -> f64 {
        self.acceleration_rad_s2
    }

    /// Refuses a position outside the range.
    ///
    /// # Errors
    /// Names the joint, the position, the limit passed and the time.
    pub fn admit_position(&self, joint: &str, position: Extreme) -> Result<(), Error> {
        let slack = ROUNDING * self.lower_rad.abs().max(self.upper_rad.abs());
        if !(position.value >= self.lower_rad - slack) {
            return Err(beyond(joint, "position", "rad", position, "at least", self.lower_rad));
        }
        if !(position.value <= self.upper_rad + slack) {
            return Err(beyond(joint, "position", "rad", position, "at most", self.upper_rad));
        }
        Ok(())
    }

    /// Refuses positions outside the range anywhere on a curve.
    ///
    /// # Errors
    /// As [`Self::admit_position`].
    pub fn admit_positions(&self, joint: &str, of: &Extremes) -> Result<(), Error> {
        self.admit_position(joint, of.position.min)?;
        self.admit_position(joint, of.position.max)
    }

    /// Refuses a curve that is faster or bends harder than allowed anywhere.
    ///
    /// # Errors
    /// Names the joint, the quantity, its value, the limit and the time.
    pub fn admit_rates(&self, joint: &str, of: &Extremes) -> Result<(), Error> {
        let rates = [
            ("velocity", "rad/s", of.velocity.peak(), self.velocity_rad_s),
            ("acceleration", "rad/s^2", of.acceleration.peak(), self.acceleration_rad_s2),
        ];
        for (quantity, unit, peak, limit) in rates {
            if !(peak.value.abs() <= limit * (1.0 + ROUNDING)) {
                return Err(beyond(joint, quantity, unit, peak, "at most", limit));
            }
        }
        Ok(())
    }
}

fn beyond(
    joint: &str,
    quantity: &str,
    unit: &str,
    peak: Extreme,
    bound: &str,
    limit: f64,
) -> Error {
    let degrees =
        |value: f64| format!(" ({:.2} {})", value.to_degrees(), unit.replace("rad", "deg"));
    let beyond_by = peak.value.abs() - limit.abs();
    let digits = |value| digits(value, beyond_by);
    Error::new(format!("{quantity} of joint {joint} is beyond its limit"))
        .at(format!("joint {joint} at {:.3} s", peak.time_s))
        .got(format!("{} {unit}{}", digits(peak.value), degrees(peak.value)))
        .allowed(format!("{bound} {} {unit}{}", digits(limit), degrees(limit)))
}

/// Without trailing zeros; three decimals, or twelve where three would hide a violation of 1e-9.
fn digits(value: f64, beyond_by: f64) -> String {
    let decimals = if beyond_by.abs() > 0.01 { 3 } else { 12 };
    let text = format!("{value:.decimals$}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nonsense_limits_are_refused() {
        for (lower, upper, v, a) in [
            (1.0, 1.0, 1.0, 1.0),
            (1.0, -1.0, 1.0, 1.0),
            (f64::NAN, 1.0, 1.0, 1.0),
            (-1.0, f64::INFINITY, 1.0, 1.0),
            (-1.0, 1.0, 0.0, 1.0),
            (-1.0, 1.0, -1.0, 1.0),
            (-1.0, 1.0, 1.0, f64::NAN),
            (-1.0, 1.0, 1.0, f64::INFINITY),
            (-1.0, 1.0, f64::MIN_POSITIVE / 2.0, 1.0),
        ] {
            assert!(JointLimits::new(lower, upper, v, a).is_err(), "{lower} {upper} {v} {a}");
        }
        assert!(JointLimits::new(-1.0, 1.0, 6.0, 40.0).is_ok());
    }

    #[test]
    fn a_position_past_a_limit_by_a_billionth_is_refused_and_nan_too() {
        let limits = JointLimits::new(-0.5, 2.0, 1.0, 1.0).unwrap();
        let at = |value| Extreme { time_s: 0.25, value };
        for inside in [-0.5, 2.0, 0.0, 2.0 * (1.0 + 1e-13)] {
            assert!(limits.admit_position("knee", at(inside)).is_ok(), "{inside}");
        }
        for outside in [2.0 * (1.0 + 1e-9), -0.5 * (1.0 + 1e-9), 20.0, f64::NAN, f64::INFINITY] {
            let error = limits.admit_position("knee", at(outside)).unwrap_err();
            assert_eq!(error.place.as_deref(), Some("joint knee at 0.250 s"));
        }
        let error = limits.admit_position("knee", at(2.0 * (1.0 + 1e-9))).unwrap_err();
        assert_eq!(error.got.as_deref(), Some("2.000000002 rad (114.59 deg)"));
        assert_eq!(error.allowed.as_deref(), Some("at most 2 rad (114.59 deg)"));
    }
}
