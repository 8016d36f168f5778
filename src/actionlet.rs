//! Motion as velocity cycles.
//!
//! An [`Actionlet`] is one cycle of acceleration and deceleration of one degree of freedom, between
//! two successive instants of zero velocity (Zheng et al., "Human Motion Simulation and Action
//! Corpus", 2007, Eqs. 1, 4, 5). A [`Sequence`] is a chain of them: angle and velocity are
//! continuous because each starts where the one before ended, at rest. [`insert()`] pastes a piece of
//! one into another.
//!
//! "Angle" is the position of a degree of freedom, rad.

pub mod decompose;
pub mod insert;
pub mod key_frames;
pub mod sampled;
mod sampling;
pub mod sequence;
pub mod shape;
pub mod transition;

use crate::error::Error;

pub use decompose::{Decomposed, decompose};
pub use insert::{Cut, Pasted, delayed, insert, paste, seam_in};
pub use sampled::Sampled;
pub use sequence::Sequence;
pub use shape::Shape;
pub use transition::{shortest_duration_s, transition};

/// Angle and its first three derivatives at one instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct State {
    /// Angle, rad.
    pub position_rad: f64,
    /// Angular velocity, rad/s.
    pub velocity_rad_s: f64,
    /// Angular acceleration, rad/s^2.
    pub acceleration_rad_s2: f64,
    /// Angular jerk, rad/s^3. Where it steps, the value after the step; at an actionlet's end, the
    /// value before it.
    pub jerk_rad_s3: f64,
}

impl State {
    /// At rest at an angle.
    #[must_use]
    pub fn at_rest(position_rad: f64) -> Self {
        Self { position_rad, ..Self::default() }
    }
}

/// Greatest magnitudes inside an actionlet, in closed form.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Peaks {
    /// Speed, rad/s.
    pub velocity_rad_s: f64,
    /// Acceleration or deceleration, whichever is greater, rad/s^2.
    pub acceleration_rad_s2: f64,
    /// Jerk, rad/s^3.
    pub jerk_rad_s3: f64,
}

/// One velocity cycle of one degree of freedom: from one angle to another, at rest at both and
/// nowhere between. From an angle to itself it is a rest.
#[derive(Clone, Debug, PartialEq)]
pub struct Actionlet {
    begin_s: f64,
    duration_s: f64,
    from_rad: f64,
    to_rad: f64,
    shape: Shape,
}

impl Actionlet {
    /// From `from_rad` at `begin_s` to `to_rad` after `duration_s`.
    ///
    /// # Errors
    /// If a number is not finite or the duration is not above zero.
    pub fn new(
        begin_s: f64,
        duration_s: f64,
        from_rad: f64,
        to_rad: f64,
        shape: Shape,
    ) -> Result<Self, Error> {
        if !(begin_s.is_finite() && from_rad.is_finite() && to_rad.is_finite()) {
            return Err(Error::new("an actionlet's time or angle is not finite")
                .got(format!("{from_rad} to {to_rad} rad at {begin_s} s")));
        }
        if !(duration_s.is_normal() && duration_s > 0.0) {
            return Err(Error::new("an actionlet's duration is not usable")
                .got(format!("{duration_s} s"))
                .allowed("a finite number above zero"));
        }
        Ok(Self { begin_s, duration_s, from_rad, to_rad, shape })
    }

    /// Stays at `angle_rad` for `duration_s`.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn rest(begin_s: f64, duration_s: f64, angle_rad: f64) -> Result<Self, Error> {
        Self::new(begin_s, duration_s, angle_rad, angle_rad, Shape::default())
    }

    /// When it begins, s.
    #[must_use]
    pub const fn begin_s(&self) -> f64 {
        self.begin_s
    }

    /// How long it lasts, s.
    #[must_use]
    pub const fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// When it ends, s.
    #[must_use]
    pub fn end_s(&self) -> f64 {
        self.begin_s + self.duration_s
    }

    /// Angle it starts from, rad.
    #[must_use]
    pub const fn from_rad(&self) -> f64 {
        self.from_rad
    }

    /// Angle it ends at, rad.
    #[must_use]
    pub const fn to_rad(&self) -> f64 {
        self.to_rad
    }

    /// Its velocity function.
    #[must_use]
    pub const fn shape(&self) -> &Shape {
        &self.shape
    }

    /// Angle change, rad.
    #[must_use]
    pub fn change_rad(&self) -> f64 {
        self.to_rad - self.from_rad
    }

    /// Whether nothing moves.
    #[must_use]
    pub fn is_rest(&self) -> bool {
        self.from_rad == self.to_rad
    }

    /// State at `time_s`: `y = a + delta S(u) / S(1)` with `u = (t - begin) / D`, and its exact
    /// derivatives. Before the begin and after the end, at rest at the angle there.
    #[must_use]
    pub fn at(&self, time_s: f64) -> State {
        let elapsed_s = time_s - self.begin_s;
        if !(elapsed_s >= 0.0) {
            return State::at_rest(self.from_rad);
        }
        // Compared as times: the quotient may round to 1 early or late.
        let over = time_s > self.end_s();
        if over || self.is_rest() {
            return State::at_rest(self.to_rad);
        }
        let u = if time_s == self.end_s() { 1.0 } else { (elapsed_s / self.duration_s).min(1.0) };
        let [progress, first, second, third] = self.shape.progress(u);
        let (change_rad, d) = (self.change_rad(), self.duration_s);
        State {
            position_rad: if u == 1.0 {
                self.to_rad
            } else {
                self.from_rad + change_rad * progress
            },
            velocity_rad_s: change_rad / d * first,
            acceleration_rad_s2: change_rad / (d * d) * second,
            jerk_rad_s3: change_rad / (d * d * d) * third,
        }
    }

    /// Greatest speed, acceleration and jerk.
    #[must_use]
    pub fn peaks(&self) -> Peaks {
        let [first, second, third] = self.shape.peaks();
        let (distance_rad, d) = (self.change_rad().abs(), self.duration_s);
        Peaks {
            velocity_rad_s: distance_rad / d * first,
            acceleration_rad_s2: distance_rad / (d * d) * second,
            jerk_rad_s3: distance_rad / (d * d * d) * third,
        }
    }
}

#[cfg(test)]
mod tests;
