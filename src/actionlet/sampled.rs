//! A velocity function given by samples.

use crate::error::{Error, counted};

/// Most samples of a velocity function.
pub const MAX_SAMPLES: usize = 1000;

/// A velocity function through even samples, zero at both ends and positive between: piecewise
/// cubic, with a continuous derivative that is zero at both ends, and monotone between samples
/// (Fritsch and Carlson, "Monotone piecewise cubic interpolation", 1980), so that it is positive
/// not only at the samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Sampled {
    /// Velocities, scaled so that the whole integral is 1.
    velocity: Vec<f64>,
    /// Slopes at the samples.
    slope: Vec<f64>,
    /// Integral up to each sample.
    integral: Vec<f64>,
    peaks: [f64; 3],
}

impl Sampled {
    /// A velocity function through `samples`, evenly spread over the duration; their scale does not
    /// matter.
    ///
    /// # Errors
    /// If there are fewer than 3 or more than [`MAX_SAMPLES`], if the first or last is not zero, or
    /// one between is not above zero.
    pub fn through(samples: &[f64]) -> Result<Self, Error> {
        if !(3..=MAX_SAMPLES).contains(&samples.len()) {
            return Err(Error::new("a sampled velocity function has too few or too many samples")
                .got(counted(samples.len(), "sample"))
                .allowed(format!("3 to {MAX_SAMPLES}")));
        }
        let last = samples.len() - 1;
        for (index, value) in samples.iter().enumerate() {
            let at_end = index == 0 || index == last;
            let fits = if at_end { *value == 0.0 } else { *value > 0.0 && value.is_finite() };
            if !fits {
                return Err(Error::new("a sampled velocity function must rest only at its ends")
                    .at(format!("sample {} of {}", index + 1, samples.len()))
                    .got(value.to_string())
                    .allowed("0 at both ends, a finite number above 0 between"));
            }
        }
        let greatest = samples.iter().fold(0.0, |a: f64, b| a.max(*b));
        let mut velocity: Vec<f64> = samples.iter().map(|value| value / greatest).collect();
        let mut slope = slopes(&velocity);
        let whole: f64 = integrals(&velocity, &slope).last().copied().unwrap_or(1.0);
        for value in velocity.iter_mut().chain(&mut slope) {
            *value /= whole;
        }
        let mut integral = integrals(&velocity, &slope);
        integral[last] = 1.0;
        let mut shape = Self { velocity, slope, integral, peaks: [0.0; 3] };
        shape.peaks = shape.greatest();
        Ok(shape)
    }

    /// Greatest magnitudes of velocity and its first two derivatives.
    #[must_use]
    pub const fn peaks(&self) -> [f64; 3] {
        self.peaks
    }

    /// The samples, scaled to an integral of 1.
    #[must_use]
    pub fn velocities(&self) -> &[f64] {
        &self.velocity
    }

    /// Integral, velocity and its first two derivatives at u in [0, 1].
    #[must_use]
    pub fn raw(&self, u: f64) -> [f64; 4] {
        let pieces = self.velocity.len() - 1;
        let place = u * pieces as f64;
        let piece = (place as usize).min(pieces - 1);
        let [s, v, first, second] = self.in_piece(piece, place - piece as f64);
        if u >= 1.0 { [1.0, 0.0, first, second] } else { [s, v, first, second] }
    }

    /// The cubic of a piece, c0 + c1 w + c2 w^2 + c3 w^3 for w in [0, 1]; velocity per unit of u.
    fn cubic(&self, piece: usize) -> [f64; 4] {
        let step = 1.0 / (self.velocity.len() - 1) as f64;
        let (v0, v1) = (self.velocity[piece], self.velocity[piece + 1]);
        let (m0, m1) = (self.slope[piece] * step, self.slope[piece + 1] * step);
        [v0, m0, 3.0 * (v1 - v0) - 2.0 * m0 - m1, 2.0 * (v0 - v1) + m0 + m1]
    }

    fn in_piece(&self, piece: usize, w: f64) -> [f64; 4] {
        let pieces = (self.velocity.len() - 1) as f64;
        let [c0, c1, c2, c3] = self.cubic(piece);
        let area = w * (c0 + w * (c1 / 2.0 + w * (c2 / 3.0 + w * c3 / 4.0)));
        [
            self.integral[piece] + area / pieces,
            (c0 + w * (c1 + w * (c2 + w * c3))).max(0.0),
            (c1 + w * (2.0 * c2 + w * 3.0 * c3)) * pieces,
            (2.0 * c2 + 6.0 * w * c3) * pieces * pieces,
        ]
    }

    fn greatest(&self) -> [f64; 3] {
        let mut peaks = [0f64; 3];
        for piece in 0..self.velocity.len() - 1 {
            let [_, _, c2, c3] = self.cubic(piece);
            // v' of a piece is a parabola, v'' a line; v is monotone.
            let vertex = if c3 == 0.0 { 0.0 } else { (-c2 / (3.0 * c3)).clamp(0.0, 1.0) };
            for w in [0.0, vertex, 1.0] {
                let got = self.in_piece(piece, w);
                for (peak, value) in peaks.iter_mut().zip(&got[1..]) {
                    *peak = peak.max(value.abs());
                }
            }
        }
        peaks
    }
}

/// Slopes of Fritsch and Carlson at even samples: zero at extremes and at both ends, else the
/// harmonic mean of the slopes on either side, which never overshoots.
fn slopes(velocity: &[f64]) -> Vec<f64> {
    let pieces = (velocity.len() - 1) as f64;
    let mut slope = vec![0.0; velocity.len()];
    for index in 1..velocity.len() - 1 {
        let before = (velocity[index] - velocity[index - 1]) * pieces;
        let after = (velocity[index + 1] - velocity[index]) * pieces;
        if before * after > 0.0 {
            slope[index] = 2.0 * before * after / (before + after);
        }
    }
    slope
}

fn integrals(velocity: &[f64], slope: &[f64]) -> Vec<f64> {
    let step = 1.0 / (velocity.len() - 1) as f64;
    let mut sum = 0.0;
    let mut out = vec![0.0];
    for (v, m) in velocity.windows(2).zip(slope.windows(2)) {
        sum += step * ((v[0] + v[1]) / 2.0 + step * (m[0] - m[1]) / 12.0);
        out.push(sum);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_that_rest_inside_or_move_at_an_end_are_refused_by_number() {
        for (samples, word) in [
            (vec![0.0, 1.0, 0.0, 1.0, 0.0], "sample 3 of 5"),
            (vec![0.1, 1.0, 0.0], "sample 1 of 3"),
            (vec![0.0, 1.0, f64::NAN], "sample 3 of 3"),
            (vec![0.0, -1.0, 0.0], "sample 2 of 3"),
            (vec![0.0, f64::INFINITY, 0.0], "sample 2 of 3"),
        ] {
            let error = Sampled::through(&samples).unwrap_err().to_string();
            assert!(error.contains(word), "{error}");
        }
        assert!(Sampled::through(&[0.0, 0.0]).is_err());
        assert!(Sampled::through(&vec![0.0; MAX_SAMPLES + 1]).is_err());
    }

    #[test]
    fn it_goes_through_its_samples_in_their_proportions() {
        let given = [0.0, 1.0, 4.0, 2.0, 0.0];
        let shape = Sampled::through(&given).unwrap();
        let scale = shape.raw(0.5)[1] / 4.0;
        for (index, value) in given.into_iter().enumerate() {
            let got = shape.raw(index as f64 / 4.0)[1];
            assert!((got - value * scale).abs() < 1e-12, "{got} is not {value}");
        }
        assert_eq!(shape.raw(1.0)[..2], [1.0, 0.0]);
        // The greatest sample is the greatest velocity.
        assert!((shape.peaks()[0] - 4.0 * scale).abs() < 1e-12);
    }
}
