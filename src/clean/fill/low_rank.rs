//! A marker in the few ways in which all markers around it move together: principal components of the frames in which
//! all are seen, with those that are seen in the gap, weighted by how near they are (after Gløersen and Federolf,
//! "Predicting missing marker trajectories in human motion data using marker intercorrelations", PLOS ONE 11, 2016),
//! and a bridge over what they miss.

use super::super::edge::bridge;
use super::super::neighbours::Neighbour;
use super::super::trial::{Gap, Trial};
use super::{NEIGHBOURS, donors, learned};
use glam::DVec3;
use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// Fewest markers that must be seen.
const FEWEST: usize = 3;
/// Share of the variance that is kept.
const KEPT: f64 = 0.9999;
/// Distance over which a marker's weight falls, m, and the weight that is left.
const REACH_M: f64 = 0.4;
const LEAST_WEIGHT: f64 = 0.05;
/// Rounds that the decomposition may take for each dimension.
const ROUNDS: usize = 64;

pub(super) fn fill(trial: &Trial, gap: &Gap, near: &[Neighbour]) -> Option<Vec<DVec3>> {
    let donors = donors(trial, gap, near, NEIGHBOURS);
    let frames = learned(trial, gap, &donors);
    if donors.len() < FEWEST || frames.len() < 3 * (donors.len() + 1) {
        return None;
    }
    let space = Space::of(trial, gap.marker, &donors, &frames)?;
    bridge(trial, gap, |frame| space.at(trial, frame))
}

/// The ways in which markers move together.
struct Space {
    donors: Vec<usize>,
    weights: Vec<f64>,
    mean: DVector<f64>,
    /// From how the donors lie to where the marker is.
    from_seen: DMatrix<f64>,
}

impl Space {
    fn of(trial: &Trial, marker: usize, near: &[Neighbour], frames: &[usize]) -> Option<Self> {
        let donors: Vec<usize> = near.iter().map(|of| of.marker).collect();
        let weight =
            |of: &Neighbour| LEAST_WEIGHT + (-0.5 * (of.distance_m / REACH_M).powi(2)).exp();
        let weights: Vec<f64> = near.iter().map(weight).collect();
        let (seen, size) = (3 * donors.len(), 3 * donors.len() + 3);
        let rows: Vec<DVector<f64>> = frames
            .iter()
            .filter_map(|frame| {
                let (lie, middle) = lie(trial, &donors, &weights, *frame)?;
                let own = (trial.at(marker, *frame)? - middle).to_array();
                Some(DVector::from_iterator(size, lie.iter().copied().chain(own)))
            })
            .collect();
        let count = rows.len() as f64;
        let mean = rows.iter().fold(DVector::zeros(size), |sum, row| sum + row) / count;
        let mut covariance = DMatrix::zeros(size, size);
        for row in &rows {
            let row = row - &mean;
            covariance.ger(1.0 / count, &row, &row, 1.0);
        }
        if !covariance.iter().all(|number| number.is_finite()) {
            return None;
        }
        let eigen = SymmetricEigen::try_new(covariance, 1e-14, ROUNDS * size)?;
        let mut order: Vec<usize> = (0..size).collect();
        order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
        let variance = |at: &usize| eigen.eigenvalues[*at].max(0.0);
        let all: f64 = order.iter().map(variance).sum();
        let mut sum = 0.0;
        let kept = order.iter().take_while(|at| {
            let is_needed = sum < KEPT * all;
            sum += variance(at);
            is_needed
        });
        let kept: Vec<usize> = kept.copied().collect();
        let rest = (size - kept.len()).max(1) as f64;
        let left: f64 = order.iter().skip(kept.len()).map(variance).sum();
        let noise = (left / rest).max(1e-12);
        // The likeliest place in that space given what is seen (Bishop, "Pattern Recognition and Machine
        // Learning", 12.2.4), each way with its own variance.
        let basis =
            DMatrix::from_fn(seen, kept.len(), |row, at| eigen.eigenvectors[(row, kept[at])]);
        let own =
            DMatrix::from_fn(3, kept.len(), |axis, at| eigen.eigenvectors[(seen + axis, kept[at])]);
        let mut inner = basis.tr_mul(&basis);
        for (at, way) in kept.iter().enumerate() {
            inner[(at, at)] += noise / variance(way).max(1e-12);
        }
        let from_seen = own * inner.cholesky()?.solve(&basis.transpose());
        Some(Self { donors, weights, mean, from_seen })
    }

    /// Where the marker should be in a frame, m; `None` if one of the others is not seen in it.
    fn at(&self, trial: &Trial, frame: usize) -> Option<DVec3> {
        let (lie, middle) = lie(trial, &self.donors, &self.weights, frame)?;
        let seen = lie.len();
        let off = &self.from_seen * (lie - self.mean.rows(0, seen));
        let own = |axis: usize| self.mean[seen + axis] + off[axis];
        Some(middle + DVec3::new(own(0), own(1), own(2)))
    }
}

/// How markers lie about their middle, weighted, and the middle.
fn lie(
    trial: &Trial,
    donors: &[usize],
    weights: &[f64],
    frame: usize,
) -> Option<(DVector<f64>, DVec3)> {
    let places: Vec<DVec3> =
        donors.iter().map(|marker| trial.at(*marker, frame)).collect::<Option<_>>()?;
    let middle = places.iter().sum::<DVec3>() / places.len() as f64;
    let weighted = places.iter().zip(weights);
    let numbers = weighted.flat_map(|(place, weight)| ((*place - middle) * *weight).to_array());
    Some((DVector::from_iterator(3 * places.len(), numbers), middle))
}
