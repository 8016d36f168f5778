//! From sampled poses of a segment to what a sensor on it undergoes at any moment.
//!
//! The sensor's position and the elements of the orientation are each a natural cubic spline through
//! the samples (C. de Boor, "A Practical Guide to Splines", 1978, chapter IV), so that velocity,
//! acceleration and angular rate are derivatives of one smooth motion and agree with each other.

use super::{GRAVITY_M_S2, ImuError, Mount, turn};

/// Poses of a segment, evenly spaced in time.
#[derive(Clone, Debug, PartialEq)]
pub struct BodyMotion {
    rate_hz: f64,
    /// Of the segment's origin, m.
    position_m: [Spline; 3],
    /// Of the orientation, w, x, y, z, not of unit length between the samples.
    orientation: [Spline; 4],
    samples: usize,
}

/// What a sensor undergoes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kinematics {
    /// Where it is in the world, m.
    pub position_m: [f64; 3],
    /// Turns vectors of the sensor into the world's.
    pub orientation: [f64; 4],
    /// Angular rate in its own axes, rad/s.
    pub rate_rad_s: [f64; 3],
    /// Acceleration less gravity in its own axes, m/s^2: at rest one g upwards.
    pub specific_force_m_s2: [f64; 3],
}

impl BodyMotion {
    /// From positions of the segment's origin, m, and orientations of the segment, `rate_hz` of both
    /// in a second.
    ///
    /// # Errors
    /// Fewer than two poses, not as many of one as of the other, numbers that are not finite.
    pub fn new(
        rate_hz: f64,
        positions_m: &[[f64; 3]],
        orientations: &[[f64; 4]],
    ) -> Result<Self, ImuError> {
        let samples = positions_m.len();
        if samples < 2 || orientations.len() != samples {
            return Err(ImuError::Poses { positions: samples, orientations: orientations.len() });
        }
        if !(rate_hz.is_finite() && rate_hz > 0.0) {
            return Err(ImuError::Number("the rate of the poses"));
        }
        let finite = positions_m.iter().flatten().chain(orientations.iter().flatten());
        if !finite.clone().all(|value| value.is_finite()) {
            return Err(ImuError::Number("a pose"));
        }
        Ok(Self::through(rate_hz, positions_m, orientations))
    }

    /// Through at least two poses, as many of one as of the other, at a rate above zero.
    pub(super) fn through(
        rate_hz: f64,
        positions_m: &[[f64; 3]],
        orientations: &[[f64; 4]],
    ) -> Self {
        // Of the two quaternions of an orientation the one nearer to the one before.
        let mut last = orientations[0];
        let smooth: Vec<[f64; 4]> = orientations
            .iter()
            .map(|&next| {
                let next = turn::normalised(next);
                let along: f64 = last.iter().zip(next).map(|(a, b)| a * b).sum();
                last = if along < 0.0 { next.map(|c| -c) } else { next };
                last
            })
            .collect();
        let of = |values: Vec<f64>| Spline::new(values, 1.0 / rate_hz);
        Self {
            rate_hz,
            position_m: std::array::from_fn(|axis| {
                of(positions_m.iter().map(|p| p[axis]).collect())
            }),
            orientation: std::array::from_fn(|axis| of(smooth.iter().map(|q| q[axis]).collect())),
            samples: positions_m.len(),
        }
    }

    /// A segment that stays where it is for so long, X east and Z up.
    ///
    /// # Errors
    /// A time that is not finite and above zero.
    pub fn still(duration_s: f64) -> Result<Self, ImuError> {
        if !(duration_s.is_finite() && duration_s > 0.0) {
            return Err(ImuError::Number("the time"));
        }
        Self::new(1.0 / duration_s, &[[0.0; 3]; 2], &[[1.0, 0.0, 0.0, 0.0]; 2])
    }

    /// Time from the first pose to the last, s.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        (self.samples - 1) as f64 / self.rate_hz
    }

    /// What a sensor mounted so undergoes at `time_s` since the first pose.
    #[must_use]
    pub fn at(&self, time_s: f64, mount: &Mount) -> Kinematics {
        let [q, dq, ddq] = derivatives(&self.orientation, time_s);
        let length_2: f64 = q.iter().map(|c| c * c).sum();
        let segment = turn::normalised(q);
        // Rate of the segment in its own axes: the vector part of 2 q* dq, over the squared length.
        // The part of dq along q changes the length alone and falls out.
        let vector = |q: [f64; 4]| [q[1], q[2], q[3]];
        let scaled = |v: [f64; 3], by: f64| v.map(|c| c * by);
        let back = turn::inverse(q);
        let rate = scaled(vector(turn::times(back, dq)), 2.0 / length_2);
        // Its derivative, d(2 q* dq / |q|^2): q* ddq (dq* dq has no vector part) less the change of
        // length.
        let along: f64 = q.iter().zip(dq).map(|(a, b)| a * b).sum();
        let change = scaled(vector(turn::times(back, ddq)), 2.0 / length_2);
        let rate_change: [f64; 3] =
            std::array::from_fn(|axis| change[axis] - 2.0 * along / length_2 * rate[axis]);
        let [position, _, acceleration] = derivatives(&self.position_m, time_s);
        // A point off the origin is carried by the turning: w' x r + w x (w x r).
        let r = mount.offset_m;
        let carried = plus(cross(rate_change, r), cross(rate, cross(rate, r)));
        let at_rest = [0.0, 0.0, GRAVITY_M_S2];
        let force = plus(turn::back(segment, plus(acceleration, at_rest)), carried);
        Kinematics {
            position_m: plus(position, turn::forth(segment, r)),
            orientation: turn::normalised(turn::times(segment, mount.orientation)),
            rate_rad_s: turn::back(mount.orientation, rate),
            specific_force_m_s2: turn::back(mount.orientation, force),
        }
    }
}

fn plus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|axis| a[axis] + b[axis])
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Values, first and second derivatives.
fn derivatives<const N: usize>(splines: &[Spline; N], time_s: f64) -> [[f64; N]; 3] {
    let at = splines.each_ref().map(|spline| spline.at(time_s));
    std::array::from_fn(|order| std::array::from_fn(|axis| at[axis][order]))
}

/// A natural cubic spline over evenly spaced knots.
#[derive(Clone, Debug, PartialEq)]
struct Spline {
    step_s: f64,
    values: Vec<f64>,
    /// Second derivatives at the knots, zero at both ends.
    curvatures: Vec<f64>,
}

impl Spline {
    fn new(values: Vec<f64>, step_s: f64) -> Self {
        // m[i-1] + 4 m[i] + m[i+1] = 6 (v[i-1] - 2 v[i] + v[i+1]) / h^2, by elimination.
        let knots = values.len();
        let mut curvatures = vec![0.0; knots];
        let mut factors = vec![0.0; knots];
        for i in 1..knots - 1 {
            let bend = 6.0 * (values[i - 1] - 2.0 * values[i] + values[i + 1]) / (step_s * step_s);
            let pivot = 4.0 - factors[i - 1];
            factors[i] = 1.0 / pivot;
            curvatures[i] = (bend - curvatures[i - 1]) / pivot;
        }
        for i in (1..knots - 1).rev() {
            curvatures[i] -= factors[i] * curvatures[i + 1];
        }
        Self { step_s, values, curvatures }
    }

    /// Value, first and second derivative.
    fn at(&self, time_s: f64) -> [f64; 3] {
        let h = self.step_s;
        let last = self.values.len() - 2;
        let i = ((time_s / h).floor().max(0.0) as usize).min(last);
        let t = (time_s - i as f64 * h).clamp(0.0, h);
        let (v0, v1) = (self.values[i], self.values[i + 1]);
        let (m0, m1) = (self.curvatures[i], self.curvatures[i + 1]);
        let slope = (v1 - v0) / h - h * (2.0 * m0 + m1) / 6.0;
        let bend = (m1 - m0) / h;
        [
            v0 + t * (slope + t * (m0 / 2.0 + t * bend / 6.0)),
            slope + t * (m0 + t * bend / 2.0),
            m0 + t * bend,
        ]
    }
}
