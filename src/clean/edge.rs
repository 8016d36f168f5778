//! A bridge over what a prediction misses. Markers around a gap say where a marker should be; by how much they are
//! wrong is known in the frames before and after, and is led over the gap: as a Gaussian process (Rasmussen and
//! Williams, "Gaussian Processes for Machine Learning", 2006) with the kernel of Matérn 5/2, whose length is the
//! likeliest for those frames. What is slow is carried far into the gap, what is quick fades at its edges.

use super::trial::{Gap, Trial};
use glam::DVec3;
use nalgebra::{DMatrix, DVector};

/// Frames on each side by which the kernel's length is judged.
pub const JUDGED: usize = 48;
/// Frames on each side that lead over the gap.
const LEADING: usize = 12;
/// Lengths that are tried, in frames.
const LENGTHS: [f64; 6] = [4.0, 8.0, 16.0, 32.0, 64.0, 128.0];
/// Share of what is seen that is noise.
const NOISE: f64 = 1e-4;

/// Fills a gap by a prediction of where the marker is in a frame, m. The frames beside the gap are met. `None` if
/// too little is predicted.
pub fn bridge(
    trial: &Trial,
    gap: &Gap,
    predicted: impl Fn(usize) -> Option<DVec3>,
) -> Option<Vec<DVec3>> {
    let missed = |frame: usize| Some((frame, trial.at(gap.marker, frame)? - predicted(frame)?));
    let before: Vec<(usize, DVec3)> =
        (0..gap.frames.start).rev().take(4 * JUDGED).filter_map(missed).take(JUDGED).collect();
    let after: Vec<(usize, DVec3)> =
        (gap.frames.end..trial.frames()).take(4 * JUDGED).filter_map(missed).take(JUDGED).collect();
    // The frames at the very edges must be among them, or the bridge would not meet them.
    let meets = |side: &[(usize, DVec3)], frame: usize| {
        side.first().is_some_and(|(first, _)| *first == frame)
    };
    let (last, next) = (gap.frames.start.checked_sub(1)?, gap.frames.end);
    if !meets(&before, last) || !meets(&after, next) {
        return None;
    }
    let likelihoods = LENGTHS.map(|length| {
        likelihood(&before, length).unwrap_or(0.0) + likelihood(&after, length).unwrap_or(0.0)
    });
    let length = LENGTHS
        .into_iter()
        .zip(likelihoods)
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .map(|(length, _)| length)?;
    let leading: Vec<(usize, DVec3)> =
        before.iter().take(LEADING).chain(after.iter().take(LEADING)).copied().collect();
    let covariance = covariance(&leading, length).cholesky()?;
    let solved = axes(&leading).map(|axis| covariance.solve(&axis));
    let fill = |frame: usize| {
        let mut led = DVec3::ZERO;
        for (at, (seen, _)) in leading.iter().enumerate() {
            let share = matern(frame, *seen, length);
            led += share * DVec3::new(solved[0][at], solved[1][at], solved[2][at]);
        }
        Some(predicted(frame)? + led)
    };
    let filled: Vec<DVec3> = gap.frames.clone().map(fill).collect::<Option<_>>()?;
    filled.iter().all(|place| place.is_finite()).then_some(filled)
}

/// The kernel of Matérn 5/2 between two frames.
fn matern(one: usize, other: usize, length: f64) -> f64 {
    let r = 5.0_f64.sqrt() * one.abs_diff(other) as f64 / length;
    (1.0 + r + r * r / 3.0) * (-r).exp()
}

fn covariance(seen: &[(usize, DVec3)], length: f64) -> DMatrix<f64> {
    DMatrix::from_fn(seen.len(), seen.len(), |row, column| {
        let noise = if row == column { NOISE } else { 0.0 };
        matern(seen[row].0, seen[column].0, length) + noise
    })
}

fn axes(seen: &[(usize, DVec3)]) -> [DVector<f64>; 3] {
    [0, 1, 2].map(|axis| DVector::from_iterator(seen.len(), seen.iter().map(|(_, v)| v[axis])))
}

/// Logarithm of the likelihood of what is missed, its size left open; `None` of too few frames.
fn likelihood(seen: &[(usize, DVec3)], length: f64) -> Option<f64> {
    if seen.len() < 6 {
        return None;
    }
    let factor = covariance(seen, length).cholesky()?;
    let squares: f64 = axes(seen).iter().map(|axis| axis.dot(&factor.solve(axis))).sum();
    let numbers = 3.0 * seen.len() as f64;
    let size = (squares / numbers).max(1e-20);
    let determinant: f64 = factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum();
    Some(-0.5 * numbers * size.ln() - 3.0 * determinant)
}
