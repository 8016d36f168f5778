//! A hand that moves a joint: a spring and a damper between the shaft and a place that travels.
//!
//! A hand is as stiff as an arm that holds on firmly (200 rad/s with the inertia of shaft and load,
//! critically damped; assumed), but never gives more than its force. What the motor gives is added to
//! that: a shaft without torque follows, one that is held resists, and gives way to a force that is
//! more than its own.

/// Natural frequency of shaft and hand, rad/s.
const FREQUENCY_RAD_S: f64 = 200.0;
/// The hand has arrived when the shaft is so near, rad: friction and weight keep a fast one that far.
const NEAR_RAD: f64 = 2e-2;

/// How a joint is taken by hand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hand {
    /// Where the joint is taken to, rad.
    pub to_rad: f64,
    /// How fast, rad/s; above zero.
    pub speed_rad_s: f64,
    /// The most it pushes with, N m at the joint.
    pub torque_nm: f64,
    /// Holds on when it has arrived; else it lets go then.
    pub holds_on: bool,
}

/// A hand at a shaft: angles are the shaft's, the force is in the unit of whoever asks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Grip {
    at_rad: f64,
    to_rad: f64,
    speed_rad_s: f64,
    most: f64,
    holds_on: bool,
}

impl Grip {
    /// Takes the shaft where it is.
    pub fn new(at_rad: f64, to_rad: f64, speed_rad_s: f64, most: f64, holds_on: bool) -> Grip {
        Grip { at_rad, to_rad, speed_rad_s, most, holds_on }
    }

    /// The hand's end travels for `seconds`; then what it gives to a shaft with so much inertia (force
    /// per rad/s²).
    pub fn force(&mut self, seconds: f64, shaft: (f64, f64), inertia: f64) -> f64 {
        let (position_rad, velocity_rad_s) = shaft;
        let step_rad = self.speed_rad_s * seconds;
        self.at_rad += (self.to_rad - self.at_rad).clamp(-step_rad, step_rad);
        let spring = FREQUENCY_RAD_S * FREQUENCY_RAD_S * (self.at_rad - position_rad);
        let damper = -2.0 * FREQUENCY_RAD_S * velocity_rad_s;
        (inertia * (spring + damper)).clamp(-self.most, self.most)
    }

    /// It has brought the shaft there and does not hold on.
    pub fn is_done(&self, position_rad: f64) -> bool {
        !self.holds_on
            && self.at_rad == self.to_rad
            && (position_rad - self.to_rad).abs() <= NEAR_RAD
    }
}
