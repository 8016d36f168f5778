//! A marker alone, over time: splines through the frames around a gap.

use super::super::trial::{Gap, Trial};
use glam::DVec3;

/// Longest gap that a spline bridges, s and frames: a curve knows nothing of what a person does in between.
const LONGEST_S: f64 = 2.0;
const LONGEST: usize = 400;
/// Frames on each side beside half the gap.
const BESIDE: usize = 5;
/// Fewest on each side.
const FEWEST: usize = 3;

/// The frames around a gap in which its marker is seen.
fn around(trial: &Trial, gap: &Gap) -> Option<Vec<(usize, DVec3)>> {
    let length = gap.frames.len();
    if length > LONGEST || length as f64 > LONGEST_S * trial.rate_hz() {
        return None;
    }
    let side = length / 2 + BESIDE;
    let place = |frame: usize| Some((frame, trial.at(gap.marker, frame)?));
    // Another gap right beside is looked over, but not for ever.
    let mut seen: Vec<(usize, DVec3)> =
        (0..gap.frames.start).rev().take(3 * side).filter_map(place).take(side).collect();
    let before = seen.len();
    seen.reverse();
    seen.extend((gap.frames.end..trial.frames()).take(3 * side).filter_map(place).take(side));
    (before >= FEWEST && seen.len() - before >= FEWEST).then_some(seen)
}

/// The natural cubic spline through all of them.
pub(super) fn cubic(trial: &Trial, gap: &Gap) -> Option<Vec<DVec3>> {
    let knots = around(trial, gap)?;
    let step = |at: usize| (knots[at + 1].0 - knots[at].0) as f64;
    let slope = |at: usize| (knots[at + 1].1 - knots[at].1) / step(at);
    // Second derivatives: three diagonals, solved by elimination (Thomas).
    let inner = knots.len() - 2;
    let (mut above, mut right) = (vec![0.0; inner], vec![DVec3::ZERO; inner]);
    for at in 0..inner {
        let (h, next) = (step(at), step(at + 1));
        let (before, right_before) =
            if at == 0 { (0.0, DVec3::ZERO) } else { (above[at - 1], right[at - 1]) };
        let pivot = 2.0 * (h + next) - h * before;
        above[at] = next / pivot;
        right[at] = (6.0 * (slope(at + 1) - slope(at)) - h * right_before) / pivot;
    }
    let mut bends = vec![DVec3::ZERO; knots.len()];
    for at in (0..inner).rev() {
        bends[at + 1] = right[at] - above[at] * bends[at + 2];
    }
    let left = knots.iter().position(|(frame, _)| *frame + 1 == gap.frames.start)?;
    let h = step(left);
    let (from, to) = (knots[left], knots[left + 1]);
    let place = |frame: usize| {
        let (a, b) = ((to.0 - frame) as f64 / h, (frame - from.0) as f64 / h);
        a * from.1
            + b * to.1
            + ((a * a * a - a) * bends[left] + (b * b * b - b) * bends[left + 1]) * (h * h / 6.0)
    };
    Some(gap.frames.clone().map(place).collect())
}

/// Logarithms of the weights of smoothness that are tried.
const SMOOTHEST: i32 = 4;
const ROUGHEST: i32 = -3;

/// The quintic smoothing spline, in its form for equal steps: the curve that is near what is seen and has small third
/// differences (Whittaker 1923; Eilers, "A perfect smoother", Analytical Chemistry 75, 2003), which is Woltring's
/// (Advances in Engineering Software 8, 1986) but for the steps. How smooth, generalised cross-validation says
/// (Craven and Wahba 1979). What it misses at the edges is led away over the gap.
pub(super) fn quintic(trial: &Trial, gap: &Gap) -> Option<Vec<DVec3>> {
    let seen = around(trial, gap)?;
    let (first, last) = (seen.first()?.0, seen.last()?.0);
    let size = last - first + 1;
    let mut weights = vec![0.0; size];
    let mut targets = vec![DVec3::ZERO; size];
    for (frame, place) in &seen {
        weights[frame - first] = 1.0;
        targets[frame - first] = *place;
    }
    let count = seen.len() as f64;
    let mut best: Option<(f64, Vec<DVec3>)> = None;
    for power in ROUGHEST..=SMOOTHEST {
        let Some(factor) = Banded::smoothing(&weights, 10.0_f64.powi(power)) else { continue };
        let curve = factor.solve(&targets);
        let missed: f64 = seen
            .iter()
            .map(|(frame, place)| (curve[frame - first] - *place).length_squared())
            .sum();
        let inverse = factor.inverse_diagonal();
        let fitted: f64 = weights.iter().zip(&inverse).map(|(weight, of)| weight * of).sum();
        let score = missed / (count - fitted).max(1e-9).powi(2);
        if best.as_ref().is_none_or(|(least, _)| score < *least) {
            best = Some((score, curve));
        }
    }
    let (_, curve) = best?;
    let missed = |frame: usize| Some(trial.at(gap.marker, frame)? - curve[frame - first]);
    let (start, end) = (missed(gap.frames.start - 1)?, missed(gap.frames.end)?);
    let span = (gap.frames.len() + 1) as f64;
    let place = |frame: usize| {
        let share = (frame + 1 - gap.frames.start) as f64 / span;
        curve[frame - first] + start.lerp(end, share)
    };
    let filled: Vec<DVec3> = gap.frames.clone().map(place).collect();
    filled.iter().all(|place| place.is_finite()).then_some(filled)
}

/// Diagonals beside the main one.
const BAND: usize = 3;

/// A symmetric matrix with seven diagonals as L D L'.
struct Banded {
    pivots: Vec<f64>,
    /// L below its diagonal: of each row the entries one, two and three columns before.
    below: Vec<[f64; BAND]>,
}

impl Banded {
    /// W + l D'D, D taking third differences.
    fn smoothing(weights: &[f64], smoothness: f64) -> Option<Self> {
        let size = weights.len();
        let mut main = weights.to_vec();
        let mut sides = vec![[0.0; BAND]; size];
        const DIFFERENCE: [f64; BAND + 1] = [-1.0, 3.0, -3.0, 1.0];
        for first in 0..size.saturating_sub(BAND) {
            for (row, of_row) in DIFFERENCE.iter().enumerate() {
                main[first + row] += smoothness * of_row * of_row;
                for (column, of_column) in DIFFERENCE.iter().enumerate().take(row) {
                    sides[first + row][row - column - 1] += smoothness * of_row * of_column;
                }
            }
        }
        let (mut pivots, mut below) = (vec![0.0; size], vec![[0.0; BAND]; size]);
        for row in 0..size {
            for back in (1..=BAND.min(row)).rev() {
                let column = row - back;
                let mut sum = sides[row][back - 1];
                for further in back + 1..=BAND.min(row) {
                    let at: usize = row - further;
                    sum -= below[row][further - 1] * pivots[at] * below[column][column - at - 1];
                }
                below[row][back - 1] = sum / pivots[column];
            }
            let mut pivot = main[row];
            for back in 1..=BAND.min(row) {
                pivot -= below[row][back - 1].powi(2) * pivots[row - back];
            }
            if !(pivot > 0.0) {
                return None;
            }
            pivots[row] = pivot;
        }
        Some(Self { pivots, below })
    }

    fn solve(&self, right: &[DVec3]) -> Vec<DVec3> {
        let size = self.pivots.len();
        let mut x = right.to_vec();
        for row in 0..size {
            for back in 1..=BAND.min(row) {
                let known = x[row - back];
                x[row] -= self.below[row][back - 1] * known;
            }
        }
        for (x, pivot) in x.iter_mut().zip(&self.pivots) {
            *x /= *pivot;
        }
        for row in (0..size).rev() {
            for ahead in 1..=BAND.min(size - 1 - row) {
                let known = x[row + ahead];
                x[row] -= self.below[row + ahead][ahead - 1] * known;
            }
        }
        x
    }

    /// The diagonal of the inverse, from its last entries to the first (Hutchinson and de Hoog, "Smoothing noisy
    /// data with spline functions", Numerische Mathematik 47, 1985).
    fn inverse_diagonal(&self) -> Vec<f64> {
        let size = self.pivots.len();
        // Of each row: its entry on the diagonal, and one, two, three columns after.
        let mut inverse = vec![[0.0; BAND + 1]; size];
        for row in (0..size).rev() {
            let reach = BAND.min(size - 1 - row);
            let entry = |inverse: &[[f64; BAND + 1]], one: usize, other: usize| {
                let (low, high) = (one.min(other), one.max(other));
                inverse[low][high - low]
            };
            for column in (1..=reach).rev() {
                let sum: f64 = (1..=reach)
                    .map(|of| {
                        self.below[row + of][of - 1] * entry(&inverse, row + of, row + column)
                    })
                    .sum();
                inverse[row][column] = -sum;
            }
            let sum: f64 =
                (1..=reach).map(|of| self.below[row + of][of - 1] * inverse[row][of]).sum();
            inverse[row][0] = 1.0 / self.pivots[row] - sum;
        }
        inverse.into_iter().map(|row| row[0]).collect()
    }
}
