//! One joint's position as a cubic spline on evenly spaced knots, twice continuously
//! differentiable, with its exact extremes.
//!
//! De Boor, "A Practical Guide to Splines", 1978, ch. IV: the slopes m at the knots y solve
//! `m[i-1] + 4 m[i] + m[i+1] = 3 (y[i+1] - y[i-1]) / h`. Values and slopes are kept (Hermite form),
//! so a prescribed end velocity is met exactly and not to within rounding.

use crate::error::Error;

/// Condition at one end of a spline.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum End {
    /// Natural: no acceleration there, the velocity follows from the knots.
    Free,
    /// Clamped: this velocity, rad/s.
    Velocity(f64),
}

/// A value and the time it occurs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extreme {
    /// Time from the first knot, s.
    pub time_s: f64,
    /// The value, in the unit of its quantity.
    pub value: f64,
}

/// Least and greatest value over a span. Not a number wins over any number, so that a check of the
/// range sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Where the quantity is least.
    pub min: Extreme,
    /// Where it is greatest.
    pub max: Extreme,
}

impl Range {
    fn of(first: Extreme) -> Self {
        Self { min: first, max: first }
    }

    fn include(&mut self, time_s: f64, value: f64) {
        if value < self.min.value || value.is_nan() {
            self.min = Extreme { time_s, value };
        }
        if value > self.max.value || value.is_nan() {
            self.max = Extreme { time_s, value };
        }
    }

    /// The extreme of greater magnitude, with its sign.
    #[must_use]
    pub fn peak(&self) -> Extreme {
        if self.max.value.abs() >= self.min.value.abs() || self.max.value.is_nan() {
            self.max
        } else {
            self.min
        }
    }
}

/// Exact ranges of a spline and its derivatives over its whole span.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extremes {
    /// Position, rad.
    pub position: Range,
    /// Velocity, rad/s.
    pub velocity: Range,
    /// Acceleration, rad/s^2.
    pub acceleration: Range,
    /// Jerk, rad/s^3; constant within a piece, it steps at the knots.
    pub jerk: Range,
}

/// A cubic spline through evenly spaced knots; outside its span it keeps its end values.
#[derive(Clone, Debug, PartialEq)]
pub struct Spline {
    step_s: f64,
    values: Vec<f64>,
    slopes: Vec<f64>,
}

/// One cubic piece over `u` in [0, 1].
#[derive(Clone, Copy)]
struct Piece {
    step_s: f64,
    from: f64,
    to: f64,
    slope_from: f64,
    slope_to: f64,
}

impl Piece {
    fn chord(self) -> f64 {
        (self.to - self.from) / self.step_s
    }

    fn position(self, u: f64) -> f64 {
        let v = 1.0 - u;
        (1.0 + 2.0 * u) * v * v * self.from
            + u * u * (3.0 - 2.0 * u) * self.to
            + self.step_s * (u * v * v * self.slope_from - u * u * v * self.slope_to)
    }

    fn velocity(self, u: f64) -> f64 {
        let v = 1.0 - u;
        6.0 * u * v * self.chord()
            + v * (1.0 - 3.0 * u) * self.slope_from
            + u * (3.0 * u - 2.0) * self.slope_to
    }

    fn acceleration(self, u: f64) -> f64 {
        (6.0 * (1.0 - 2.0 * u) * self.chord()
            + (6.0 * u - 4.0) * self.slope_from
            + (6.0 * u - 2.0) * self.slope_to)
            / self.step_s
    }

    fn jerk(self) -> f64 {
        6.0 * (self.slope_from + self.slope_to - 2.0 * self.chord()) / (self.step_s * self.step_s)
    }

    /// Velocity as `a u^2 + b u + c`.
    fn velocity_polynomial(self) -> (f64, f64, f64) {
        let chord = self.chord();
        (
            3.0 * (self.slope_from + self.slope_to - 2.0 * chord),
            2.0 * (3.0 * chord - 2.0 * self.slope_from - self.slope_to),
            self.slope_from,
        )
    }

    /// Where the velocity vanishes; only roots inside the piece count.
    fn turning_points(self) -> [f64; 2] {
        let (a, b, c) = self.velocity_polynomial();
        // The textbook formula loses the small root to cancellation; this one does not.
        let q = -0.5 * (b + (b * b - 4.0 * a * c).sqrt().copysign(b));
        [q / a, c / q]
    }

    /// Where the acceleration vanishes.
    fn inflection(self) -> f64 {
        let (a, b, _) = self.velocity_polynomial();
        -b / (2.0 * a)
    }
}

fn inside(u: f64) -> bool {
    u > 0.0 && u < 1.0
}

impl Spline {
    /// The spline through `values`, `step_s` apart.
    ///
    /// # Errors
    /// With fewer than two values, a step that is not positive, or an end velocity that is not
    /// finite. Values are not judged here: a value that is not finite shows in the extremes.
    pub fn through(values: Vec<f64>, step_s: f64, start: End, end: End) -> Result<Self, Error> {
        if values.len() < 2 {
            return Err(Error::new("a curve needs at least two points")
                .got(values.len().to_string())
                .allowed("two or more"));
        }
        if !(step_s.is_normal() && step_s > 0.0) {
            return Err(Error::new("the time between two points is not usable")
                .got(format!("{step_s} s"))
                .allowed("a finite number above zero"));
        }
        for condition in [start, end] {
            if let End::Velocity(velocity) = condition
                && !velocity.is_finite()
            {
                return Err(Error::new("an end velocity is not finite").got(velocity.to_string()));
            }
        }
        let slopes = slopes(&values, step_s, start, end);
        Ok(Self { step_s, values, slopes })
    }

    /// The same curve, `factor` times as long in time. `factor` is finite and positive.
    #[must_use]
    pub fn stretched(&self, factor: f64) -> Self {
        Self {
            step_s: self.step_s * factor,
            values: self.values.clone(),
            slopes: self.slopes.iter().map(|slope| slope / factor).collect(),
        }
    }

    /// Time between knots, s.
    #[must_use]
    pub const fn step_s(&self) -> f64 {
        self.step_s
    }

    /// Values at the knots.
    #[must_use]
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// Time from the first knot to the last, s.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.pieces() as f64 * self.step_s
    }

    /// Position, velocity and acceleration at `time_s`. Before the first and after the last knot,
    /// and for a time that is not a number, those of the nearest end (the first).
    #[must_use]
    pub fn sample(&self, time_s: f64) -> [f64; 3] {
        let knots = time_s / self.step_s;
        // The end is compared as a time, so that asking for the duration gives exactly the end.
        let (index, u) = if !(knots > 0.0) {
            (0, 0.0)
        } else if time_s >= self.duration_s() || knots >= self.pieces() as f64 {
            (self.pieces() - 1, 1.0)
        } else {
            (knots as usize, knots.fract())
        };
        let piece = self.piece(index);
        [piece.position(u), piece.velocity(u), piece.acceleration(u)]
    }

    /// Exact extremes over the whole span: each piece is a cubic, so position turns where a
    /// quadratic vanishes, velocity where a line does, and acceleration only at knots.
    #[must_use]
    pub fn extremes(&self) -> Extremes {
        let first = self.piece(0);
        let at_start = |value| Range::of(Extreme { time_s: 0.0, value });
        let mut all = Extremes {
            position: at_start(first.position(0.0)),
            velocity: at_start(first.velocity(0.0)),
            acceleration: at_start(first.acceleration(0.0)),
            jerk: at_start(first.jerk()),
        };
        for index in 0..self.pieces() {
            let piece = self.piece(index);
            let time_s = |u: f64| (index as f64 + u) * self.step_s;
            for u in piece.turning_points().into_iter().filter(|u| inside(*u)) {
                all.position.include(time_s(u), piece.position(u));
            }
            let u = piece.inflection();
            if inside(u) {
                all.velocity.include(time_s(u), piece.velocity(u));
            }
            for u in [0.0, 1.0] {
                all.position.include(time_s(u), piece.position(u));
                all.velocity.include(time_s(u), piece.velocity(u));
                all.acceleration.include(time_s(u), piece.acceleration(u));
            }
            all.jerk.include(time_s(0.0), piece.jerk());
        }
        all
    }

    fn pieces(&self) -> usize {
        self.values.len() - 1
    }

    fn piece(&self, index: usize) -> Piece {
        Piece {
            step_s: self.step_s,
            from: self.values[index],
            to: self.values[index + 1],
            slope_from: self.slopes[index],
            slope_to: self.slopes[index + 1],
        }
    }
}

/// Solves the tridiagonal system of the module's header by elimination (Thomas).
fn slopes(values: &[f64], step_s: f64, start: End, end: End) -> Vec<f64> {
    let last = values.len() - 1;
    // Row: left * m[i-1] + middle * m[i] + right * m[i+1] = known.
    let row = |i: usize| -> [f64; 4] {
        if i == 0 {
            match start {
                End::Free => [0.0, 2.0, 1.0, 3.0 * (values[1] - values[0]) / step_s],
                End::Velocity(velocity) => [0.0, 1.0, 0.0, velocity],
            }
        } else if i == last {
            match end {
                End::Free => [1.0, 2.0, 0.0, 3.0 * (values[i] - values[i - 1]) / step_s],
                End::Velocity(velocity) => [0.0, 1.0, 0.0, velocity],
            }
        } else {
            [1.0, 4.0, 1.0, 3.0 * (values[i + 1] - values[i - 1]) / step_s]
        }
    };
    let mut ratio = Vec::with_capacity(values.len());
    let mut slope = Vec::with_capacity(values.len());
    let (mut ratio_before, mut slope_before) = (0.0, 0.0);
    for i in 0..=last {
        let [left, middle, right, known] = row(i);
        let pivot = middle - left * ratio_before;
        ratio_before = right / pivot;
        slope_before = (known - left * slope_before) / pivot;
        ratio.push(ratio_before);
        slope.push(slope_before);
    }
    for i in (0..last).rev() {
        slope[i] -= ratio[i] * slope[i + 1];
    }
    slope
}

#[cfg(test)]
mod tests;
