//! One step of damped least squares (Levenberg, Marquardt): the least damping that helps is taken.

use nalgebra::{Cholesky, DMatrix, DVector};

/// A step that helped.
pub(super) struct Step {
    /// Where it leads.
    pub at: DVector<f64>,
    /// What is off there.
    pub off: DVector<f64>,
    /// The part of the sum of squares that is gone.
    pub gained: f64,
}

/// From `x`, where `now` is off and `answers` says how that changes: a step after which less is off, with the first of
/// these dampings that gives one. What is off somewhere `off` says; nothing where one cannot be.
///
/// # Errors
/// As of `off`.
pub(super) fn step<E>(
    x: &DVector<f64>,
    (now, answers): (&DVector<f64>, &DMatrix<f64>),
    dampings: &[f64],
    mut off: impl FnMut(DVector<f64>) -> Result<Option<(DVector<f64>, DVector<f64>)>, E>,
) -> Result<Option<Step>, E> {
    let turned = answers.transpose();
    let (slope, normal) = (&turned * now, &turned * answers);
    let before = now.norm_squared();
    for damping in dampings {
        let damped = &normal + DMatrix::identity(x.len(), x.len()) * *damping;
        let Some(factors) = Cholesky::new(damped) else { continue };
        if let Some((at, off)) = off(x - factors.solve(&slope))?
            && off.norm_squared() < before
        {
            let gained = 1.0 - off.norm_squared() / before;
            return Ok(Some(Step { at, off, gained }));
        }
    }
    Ok(None)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::convert::Infallible;

    #[test]
    fn what_is_linear_is_met_at_once_and_what_cannot_get_better_takes_no_step() {
        let answers = DMatrix::from_row_slice(2, 2, &[2.0, 0.0, 0.0, 4.0]);
        let off = |x: DVector<f64>| {
            let off = &answers * &x - DVector::from_vec(vec![2.0, 4.0]);
            Ok::<_, Infallible>(Some((x, off)))
        };
        let x = DVector::zeros(2);
        let now = DVector::from_vec(vec![-2.0, -4.0]);
        let Ok(stepped) = step(&x, (&now, &answers), &[1e-9], off);
        let stepped = stepped.expect("a step");
        assert!((stepped.at - DVector::from_vec(vec![1.0, 1.0])).norm() < 1e-6);
        assert!((stepped.gained - 1.0).abs() < 1e-9);
        let worse =
            |x: DVector<f64>| Ok::<_, Infallible>(Some((x, DVector::from_vec(vec![9.0, 9.0]))));
        let Ok(none) = step(&x, (&now, &answers), &[1e-9, 1.0], worse);
        assert!(none.is_none());
    }
}
