//! Least squares over seam times, seam angles and peak places of a whole chain at once.
//!
//! A sample depends on the two seams around it and the peak between: with three unknowns per seam
//! (time, angle, peak of what follows) the normal matrix has five bands, and a step costs as much
//! as looking at every sample once (Levenberg and Marquardt's damping).

use core::f64::consts::PI;

/// Unknowns of a seam: its time, its angle, the peak place of the actionlet that follows.
const PER_SEAM: usize = 3;
/// A row of the lower half of the normal matrix: the five before the diagonal, and it.
const BANDS: usize = 6;
/// Half sines have their peak here, see [`crate::actionlet::shape::PEAK_AT`].
const PEAKS: (f64, f64) = (0.1, 0.9);

/// Seams of a chain of half sines.
#[derive(Clone, Debug)]
pub struct Knots {
    /// Seam times, s; the first is 0.
    pub times_s: Vec<f64>,
    /// Angles at the seams.
    pub angles_rad: Vec<f64>,
    /// Peak places between the seams.
    pub peaks: Vec<f64>,
    /// Between these the last seam may move, s.
    pub end_s: (f64, f64),
}

impl Knots {
    /// Seams at given times, first and last included, with the angles of the series there and the
    /// peaks where it is fastest.
    pub fn through(samples_rad: &[f64], rate_hz: f64, times_s: &[f64]) -> Self {
        let last = samples_rad.len() - 1;
        let angle = |time_s: f64| {
            let place = time_s * rate_hz;
            let index = (place as usize).min(last - 1);
            let part = place - index as f64;
            samples_rad[index] * (1.0 - part) + samples_rad[index + 1] * part
        };
        let peak = |pair: &[f64]| {
            let index = |time_s: f64| ((time_s * rate_hz).round() as usize).min(last);
            let (from, to) = (index(pair[0]), index(pair[1]));
            let speed = |i: usize| (samples_rad[i + 1] - samples_rad[i]).abs();
            let fastest = (from..to).max_by(|a, b| speed(*a).total_cmp(&speed(*b)));
            let at_s = (fastest.unwrap_or(from) as f64 + 0.5) / rate_hz;
            ((at_s - pair[0]) / (pair[1] - pair[0])).clamp(0.2, 0.8)
        };
        Self {
            times_s: times_s.to_vec(),
            angles_rad: times_s.iter().map(|time_s| angle(*time_s)).collect(),
            peaks: times_s.windows(2).map(peak).collect(),
            end_s: (last as f64 / rate_hz, last as f64 / rate_hz),
        }
    }

    /// The last seam may lie up to a sample's time before or after the last sample.
    pub fn with_free_end(mut self, rate_hz: f64) -> Self {
        self.end_s = (self.end_s.0 - 1.0 / rate_hz, self.end_s.1 + 1.0 / rate_hz);
        self
    }

    fn has_free_end(&self) -> bool {
        self.end_s.0 < self.end_s.1
    }

    /// Improves the fit in at most `rounds` steps; the ends stay where they are in time, but for a last
    /// one that is free.
    pub fn refine(&mut self, samples_rad: &[f64], rate_hz: f64, rounds: usize) {
        let mut damping = 1e-3;
        let mut normal = Normal::of(self, samples_rad, rate_hz);
        for _ in 0..rounds {
            let mut improved = false;
            for _ in 0..6 {
                let stepped = normal.step(damping).and_then(|step| self.moved(&step, rate_hz));
                if let Some(stepped) = stepped {
                    let next = Normal::of(&stepped, samples_rad, rate_hz);
                    if next.squares < normal.squares {
                        improved = next.squares < normal.squares * (1.0 - 1e-9);
                        (*self, normal) = (stepped, next);
                        damping = (damping * 0.2).max(1e-12);
                        break;
                    }
                }
                damping *= 8.0;
            }
            if !improved {
                return;
            }
        }
    }

    /// The knots after a step; none if seams would pass one another.
    fn moved(&self, step: &[f64], rate_hz: f64) -> Option<Self> {
        let mut moved = self.clone();
        let seams = self.times_s.len();
        for seam in 0..seams {
            let [time, angle, peak] = [0, 1, 2].map(|part| step[seam * PER_SEAM + part]);
            moved.angles_rad[seam] += angle;
            if seam > 0 && seam + 1 < seams {
                moved.times_s[seam] += time;
            } else if seam > 0 && self.has_free_end() {
                moved.times_s[seam] =
                    (moved.times_s[seam] + time).clamp(self.end_s.0, self.end_s.1);
            }
            if let Some(place) = moved.peaks.get_mut(seam) {
                *place = (*place + peak).clamp(PEAKS.0, PEAKS.1);
            }
        }
        let apart = |pair: &[f64]| pair[1] - pair[0] > 1.5 / rate_hz;
        moved.times_s.windows(2).all(apart).then_some(moved)
    }
}

/// The normal equations at some knots.
struct Normal {
    rows: Vec<[f64; BANDS]>,
    gradient: Vec<f64>,
    squares: f64,
}

impl Normal {
    fn of(knots: &Knots, samples_rad: &[f64], rate_hz: f64) -> Self {
        let seams = knots.times_s.len();
        let unknowns = seams * PER_SEAM;
        let mut normal = Self {
            rows: vec![[0.0; BANDS]; unknowns],
            gradient: vec![0.0; unknowns],
            squares: 0.0,
        };
        let mut seam = 0;
        for (index, given_rad) in samples_rad.iter().enumerate() {
            let time_s = index as f64 / rate_hz;
            while seam + 2 < seams && time_s >= knots.times_s[seam + 1] {
                seam += 1;
            }
            let (begin_s, end_s) = (knots.times_s[seam], knots.times_s[seam + 1]);
            let (a, b) = (knots.angles_rad[seam], knots.angles_rad[seam + 1]);
            let duration_s = end_s - begin_s;
            let u = ((time_s - begin_s) / duration_s).clamp(0.0, 1.0);
            let (progress, slope, by_peak) = half_sine(u, knots.peaks[seam]);
            let change = b - a;
            let miss = a + change * progress - given_rad;
            normal.squares += miss * miss;
            let by_begin = if seam > 0 { change * slope * (u - 1.0) / duration_s } else { 0.0 };
            let inner = seam + 2 < seams || knots.has_free_end();
            let by_end = if inner { -change * slope * u / duration_s } else { 0.0 };
            let first = seam * PER_SEAM;
            let by = [by_begin, 1.0 - progress, change * by_peak, by_end, progress];
            for (i, bi) in by.iter().enumerate() {
                normal.gradient[first + i] += bi * miss;
                for (j, bj) in by[..=i].iter().enumerate() {
                    normal.rows[first + i][BANDS - 1 - (i - j)] += bi * bj;
                }
            }
        }
        normal
    }

    /// Solves for the damped step by banded Cholesky; none if the matrix is not positive.
    fn step(&self, damping: f64) -> Option<Vec<f64>> {
        let count = self.gradient.len();
        let mut rows = self.rows.clone();
        for row in &mut rows {
            // What no sample depends on stays where it is.
            row[BANDS - 1] += damping * row[BANDS - 1] + 1e-12;
        }
        let mut x: Vec<f64> = self.gradient.iter().map(|g| -g).collect();
        for i in 0..count {
            let low = i.saturating_sub(BANDS - 1);
            for j in low..=i {
                let mut sum = rows[i][BANDS - 1 - (i - j)];
                for k in low.max(j.saturating_sub(BANDS - 1))..j {
                    sum -= rows[i][BANDS - 1 - (i - k)] * rows[j][BANDS - 1 - (j - k)];
                }
                if j < i {
                    rows[i][BANDS - 1 - (i - j)] = sum / rows[j][BANDS - 1];
                } else if sum > 0.0 {
                    rows[i][BANDS - 1] = sum.sqrt();
                } else {
                    return None;
                }
            }
            for k in low..i {
                x[i] -= rows[i][BANDS - 1 - (i - k)] * x[k];
            }
            x[i] /= rows[i][BANDS - 1];
        }
        for i in (0..count).rev() {
            x[i] /= rows[i][BANDS - 1];
            for k in i.saturating_sub(BANDS - 1)..i {
                x[k] -= rows[i][BANDS - 1 - (i - k)] * x[i];
            }
        }
        x.iter().all(|value| value.is_finite()).then_some(x)
    }
}

/// `2 S(u)`, its derivative to u, and its derivative to T.
pub fn half_sine(u: f64, t: f64) -> (f64, f64, f64) {
    if u < t {
        rising(u, t)
    } else {
        let (progress, slope, by_peak) = rising(1.0 - u, 1.0 - t);
        (1.0 - progress, slope, by_peak)
    }
}

fn rising(u: f64, t: f64) -> (f64, f64, f64) {
    let (sine, cosine) = (PI * u / t).sin_cos();
    (u - t / PI * sine, 1.0 - cosine, u / t * cosine - sine / PI)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::actionlet::Shape;

    #[test]
    fn derivatives_to_time_and_peak_are_those_of_the_shape() {
        for t in [0.15, 0.4, 0.7] {
            for u in [0.05, 0.3, 0.55, 0.9] {
                let (progress, slope, by_peak) = half_sine(u, t);
                let [expected, rate, _, _] = Shape::half_sine(t).unwrap().progress(u);
                assert!((progress - expected).abs() < 1e-14 && (slope - rate).abs() < 1e-12);
                let d = 1e-6;
                let difference = (half_sine(u, t + d).0 - half_sine(u, t - d).0) / (2.0 * d);
                assert!((by_peak - difference).abs() < 1e-8, "T {t}, u {u}");
            }
        }
    }

    #[test]
    fn an_exact_chain_is_found_from_seams_that_are_off() {
        let exact = Knots {
            times_s: vec![0.0, 0.52, 1.13, 2.0],
            angles_rad: vec![0.1, 0.9, 0.2, 0.6],
            peaks: vec![0.3, 0.6, 0.45],
            end_s: (2.0, 2.0),
        };
        let rate_hz = 100.0;
        let value = |time_s: f64| {
            let seam = exact.times_s[1..3].iter().filter(|seam| time_s >= **seam).count();
            let begin_s = exact.times_s[seam];
            let u = (time_s - begin_s) / (exact.times_s[seam + 1] - begin_s);
            let change = exact.angles_rad[seam + 1] - exact.angles_rad[seam];
            exact.angles_rad[seam] + change * half_sine(u, exact.peaks[seam]).0
        };
        let samples: Vec<f64> = (0..=200).map(|i| value(f64::from(i) / rate_hz)).collect();
        let mut knots = Knots::through(&samples, rate_hz, &[0.0, 0.55, 1.1, 2.0]);
        knots.refine(&samples, rate_hz, 60);
        for (got, expected) in knots.times_s.iter().zip(&exact.times_s) {
            assert!((got - expected).abs() < 1e-6, "{knots:?}");
        }
        for (got, expected) in knots.peaks.iter().zip(&exact.peaks) {
            assert!((got - expected).abs() < 1e-6, "{knots:?}");
        }
    }
}
