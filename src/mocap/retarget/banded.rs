//! Systems of equations in which what is far apart knows nothing of one another: poses of a clip.

/// A symmetric positive definite system whose entries are zero further than its reach from the
/// diagonal.
pub struct Banded {
    reach: usize,
    /// The lower half row by row, `reach + 1` entries each, the last on the diagonal.
    band: Vec<f64>,
    /// The right-hand side.
    pub side: Vec<f64>,
}

impl Banded {
    /// `count` equations of nothing but zeros.
    #[must_use]
    pub fn new(count: usize, reach: usize) -> Self {
        Self { reach, band: vec![0.0; count * (reach + 1)], side: vec![0.0; count] }
    }

    /// Place of the entry in row `i`, column `j`; `j` is at most `i` and at least `i - reach`.
    const fn place(&self, i: usize, j: usize) -> usize {
        (i + 1) * (self.reach + 1) - 1 - (i - j)
    }

    /// The entry in row `i`, column `j`.
    ///
    /// # Panics
    /// If `j` is more than `i` or less than `i - reach`.
    pub fn entry(&mut self, i: usize, j: usize) -> &mut f64 {
        let place = self.place(i, j);
        &mut self.band[place]
    }

    /// Cholesky factors in place, then substitution forwards and backwards; nothing if it is not
    /// positive definite.
    #[must_use]
    pub fn solve(mut self) -> Option<Vec<f64>> {
        let count = self.side.len();
        for i in 0..count {
            let first = i.saturating_sub(self.reach);
            for j in first..i {
                // Row j begins before row i.
                let above = self.place(j, first)..self.place(j, j);
                let left = self.place(i, first)..self.place(i, j);
                let products = self.band[above].iter().zip(&self.band[left]).map(|(a, b)| a * b);
                let rest = self.band[self.place(i, j)] - products.sum::<f64>();
                *self.entry(i, j) = rest / self.band[self.place(j, j)];
            }
            let left = &self.band[self.place(i, first)..self.place(i, i)];
            let (mut square, mut sum) = (self.band[self.place(i, i)], self.side[i]);
            for (entry, solved) in left.iter().zip(&self.side[first..i]) {
                square -= entry * entry;
                sum -= entry * solved;
            }
            if !(square > 0.0) {
                return None;
            }
            *self.entry(i, i) = square.sqrt();
            self.side[i] = sum / square.sqrt();
        }
        for i in (0..count).rev() {
            self.side[i] /= self.band[self.place(i, i)];
            for j in i.saturating_sub(self.reach)..i {
                self.side[j] -= self.band[self.place(i, j)] * self.side[i];
            }
        }
        Some(self.side)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_banded_system_is_solved_as_a_full_one(
            reach in 0usize..5,
            entries in prop::collection::vec(-1.0..1.0, 12 * 6),
            side in prop::collection::vec(-9.0..9.0, 12),
        ) {
            let mut system = Banded::new(12, reach);
            let mut full = DMatrix::zeros(12, 12);
            for i in 0..12usize {
                for j in i.saturating_sub(reach)..=i {
                    // Heavy on the diagonal, and so positive definite.
                    let value = entries[i * 6 + i - j] + if i == j { 12.0 } else { 0.0 };
                    *system.entry(i, j) = value;
                    (full[(i, j)], full[(j, i)]) = (value, value);
                }
            }
            system.side.clone_from(&side);
            let solved = DVector::from_vec(system.solve().unwrap());
            prop_assert!((full * solved - DVector::from_vec(side)).amax() < 1e-12);
        }
    }

    #[test]
    fn a_system_that_is_not_positive_definite_is_not_solved() {
        let mut system = Banded::new(2, 1);
        for (i, j, value) in [(0, 0, 1.0), (1, 0, 2.0), (1, 1, 1.0)] {
            *system.entry(i, j) = value;
        }
        assert!(system.solve().is_none());
    }
}
