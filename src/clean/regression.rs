//! Where a marker is among its neighbours: ridge regression (Hoerl and Kennard, Technometrics 12, 1970) on how they lie.

use super::trial::Trial;
use glam::DVec3;
use nalgebra::{DMatrix, DVector};

/// Weight of the ridge, against the mean variance of what is regressed on.
const RIDGE: f64 = 1e-3;

/// How neighbours lie about their middle, where the marker is from there, m, and how much that counts.
pub type LearnedRow = (DVector<f64>, DVec3, f64);

/// Where a marker is among its neighbours.
#[derive(Clone, Debug)]
pub struct Regression {
    donors: Vec<usize>,
    mean_lie: DVector<f64>,
    mean_place: DVec3,
    /// A column for each axis.
    factors: DMatrix<f64>,
}

impl Regression {
    /// Learned over frames, each with its weight by its index among them; those in which the marker or one of its
    /// donors is not seen count for nothing. `None` of too few.
    #[must_use]
    pub fn over(
        trial: &Trial,
        marker: usize,
        donors: &[usize],
        frames: &[usize],
        weight: impl Fn(usize) -> f64,
    ) -> Option<Self> {
        let rows: Vec<LearnedRow> = frames
            .iter()
            .enumerate()
            .filter_map(|(at, frame)| {
                let (lie, middle) = lie(trial, donors, *frame)?;
                Some((lie, trial.at(marker, *frame)? - middle, weight(at)))
            })
            .collect();
        Self::of_rows(donors, &rows)
    }

    /// Learned from rows; `None` of too few.
    #[must_use]
    pub fn of_rows(donors: &[usize], rows: &[LearnedRow]) -> Option<Self> {
        let size = 3 * donors.len();
        // As many frames as factors would fit anything.
        if rows.len() < 2 * size {
            return None;
        }
        let all: f64 = rows.iter().map(|(.., weight)| weight).sum();
        let (mut mean_lie, mut mean_place) = (DVector::zeros(size), DVec3::ZERO);
        for (lie, place, weight) in rows {
            mean_lie.axpy(weight / all, lie, 1.0);
            mean_place += *place * (weight / all);
        }
        let (mut squares, mut products) = (DMatrix::zeros(size, size), DMatrix::zeros(size, 3));
        for (lie, place, weight) in rows {
            let (lie, place) = (lie - &mean_lie, *place - mean_place);
            squares.ger(*weight, &lie, &lie, 1.0);
            for axis in 0..3 {
                products.column_mut(axis).axpy(weight * place[axis], &lie, 1.0);
            }
        }
        // What does not move at all has no factors.
        let ridge = (RIDGE * squares.trace() / size as f64).max(1e-12);
        for at in 0..size {
            squares[(at, at)] += ridge;
        }
        let factors = squares.cholesky()?.solve(&products);
        Some(Self { donors: donors.to_vec(), mean_lie, mean_place, factors })
    }

    /// Where the marker should be in a frame, m; `None` if a neighbour is not seen in it.
    #[must_use]
    pub fn at(&self, trial: &Trial, frame: usize) -> Option<DVec3> {
        let (lie, middle) = lie(trial, &self.donors, frame)?;
        Some(middle + self.from_middle(&lie))
    }

    /// Where the marker should be, from the middle of its neighbours that lie so, m.
    #[must_use]
    pub fn from_middle(&self, lie: &DVector<f64>) -> DVec3 {
        let off = self.factors.tr_mul(&(lie - &self.mean_lie));
        self.mean_place + DVec3::new(off[0], off[1], off[2])
    }
}

/// How markers lie about their middle, and the middle.
fn lie(trial: &Trial, donors: &[usize], frame: usize) -> Option<(DVector<f64>, DVec3)> {
    let places: Vec<DVec3> =
        donors.iter().map(|marker| trial.at(*marker, frame)).collect::<Option<_>>()?;
    let middle = places.iter().sum::<DVec3>() / places.len() as f64;
    let numbers = places.iter().flat_map(|place| (*place - middle).to_array());
    Some((DVector::from_iterator(3 * places.len(), numbers), middle))
}
