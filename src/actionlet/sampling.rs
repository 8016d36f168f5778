//! Angles of a chain at an even rate, faster than one by one.
//!
//! Each side of a half sine is `y = p + q i + r sin(alpha + beta i)` at sample i. The sine of the
//! next sample follows from that of the last by a rotation; eight samples turn together, and every
//! few hundred the sine is worked out anew so that rounding does not add up.

use core::f64::consts::PI;

use crate::actionlet::{Actionlet, Sequence, Shape};

const LANES: usize = 8;
/// Samples between fresh sines: a multiple of the lanes.
const FRESH: usize = 512;

impl Sequence {
    /// Writes the angles at `index / rate_hz` s, rad, for every index of `out`. Equal to
    /// [`Sequence::at`] to 1e-12 rad for angles of a few rad.
    pub fn sample_into(&self, rate_hz: f64, out: &mut [f64]) {
        let mut done = 0;
        let until = |time_s: f64| (time_s * rate_hz).ceil().max(0.0) as usize;
        let first = until(self.begin_s()).min(out.len());
        out[..first].fill(self.from_rad());
        done += first;
        for piece in self.actionlets() {
            let end = until(piece.end_s()).clamp(done, out.len());
            piece.fill(done, rate_hz, &mut out[done..end]);
            done = end;
        }
        out[done..].fill(self.to_rad());
    }
}

impl Actionlet {
    /// Angles of samples from index `first` on, all of them within the actionlet.
    fn fill(&self, first: usize, rate_hz: f64, out: &mut [f64]) {
        let peak_at = match self.shape() {
            _ if self.is_rest() => {
                out.fill(self.from_rad());
                return;
            }
            Shape::HalfSine(peak_at) => peak_at.value(),
            Shape::MinimumJerk | Shape::Sampled(_) => {
                for (index, value) in out.iter_mut().enumerate() {
                    *value = self.at((first + index) as f64 / rate_hz).position_rad;
                }
                return;
            }
        };
        let peak_s = self.begin_s() + peak_at * self.duration_s();
        let peak = ((peak_s * rate_hz).ceil().max(0.0) as usize).saturating_sub(first);
        let (rising, falling) = out.split_at_mut(peak.min(out.len()));
        let step = 1.0 / (rate_hz * self.duration_s());
        // u = step (first + i) - begin / D; 2 S(u) = u - T/pi sin(pi u / T).
        let u = first as f64 * step - self.begin_s() / self.duration_s();
        let change = self.change_rad();
        let angular = PI / peak_at;
        linear_and_sine(
            rising,
            [self.from_rad() + change * u, change * step],
            -change / angular,
            [angular * u, angular * step],
        );
        // The falling side seen from the end: w = 1 - u.
        let u = u + rising.len() as f64 * step;
        let angular = PI / (1.0 - peak_at);
        linear_and_sine(
            falling,
            [self.to_rad() - change * (1.0 - u), change * step],
            change / angular,
            [angular * (1.0 - u), -angular * step],
        );
    }
}

/// `out[i] = p + q i + r sin(alpha + beta i)`.
fn linear_and_sine(out: &mut [f64], [p, q]: [f64; 2], r: f64, [alpha, beta]: [f64; 2]) {
    let turn = beta.sin_cos();
    let by_lanes = (0..LANES.ilog2()).fold(turn, |by, _| rotated(by, by));
    let along: [f64; LANES] = core::array::from_fn(|lane| q * lane as f64);
    for (block, chunk) in out.chunks_mut(FRESH).enumerate() {
        let start = (block * FRESH) as f64;
        let mut at = (alpha + beta * start).sin_cos();
        let (mut sines, mut cosines) = ([0.0; LANES], [0.0; LANES]);
        for (sine, cosine) in sines.iter_mut().zip(&mut cosines) {
            (*sine, *cosine) = at;
            at = rotated(at, turn);
        }
        let mut base = p + q * start;
        let mut groups = chunk.chunks_exact_mut(LANES);
        for group in &mut groups {
            for lane in 0..LANES {
                group[lane] = base + along[lane] + r * sines[lane];
                let (sine, cosine) = (sines[lane], cosines[lane]);
                sines[lane] = sine * by_lanes.1 + cosine * by_lanes.0;
                cosines[lane] = cosine * by_lanes.1 - sine * by_lanes.0;
            }
            base += q * LANES as f64;
        }
        for (lane, value) in groups.into_remainder().iter_mut().enumerate() {
            *value = base + along[lane] + r * sines[lane];
        }
    }
}

/// Sine and cosine of the sum of two angles.
const fn rotated((s, c): (f64, f64), (ds, dc): (f64, f64)) -> (f64, f64) {
    (s * dc + c * ds, c * dc - s * ds)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn many_at_once_are_the_same_as_one_by_one(
            steps in prop::collection::vec((0.003..2.0, -2.0..2.0, 0.1..0.9, 0..4), 0..12),
            from in -1.0..1.0,
            rate_hz in 10.0..3000.0,
        ) {
            let mut chain = Sequence::starting_at(0.25, from).unwrap();
            for (duration, to, t, kind) in steps {
                chain = match kind {
                    0 => chain.rest(duration),
                    1 => chain.then(duration, to, Shape::MinimumJerk),
                    _ => chain.then(duration, to, Shape::half_sine(t).unwrap()),
                }
                .unwrap();
            }
            let mut out = vec![f64::NAN; ((chain.end_s() + 0.3) * rate_hz) as usize];
            chain.sample_into(rate_hz, &mut out);
            for (index, got) in out.into_iter().enumerate() {
                let expected = chain.at(index as f64 / rate_hz).position_rad;
                prop_assert!((got - expected).abs() < 1e-12, "{index}: {got} {expected}");
            }
        }
    }
}
