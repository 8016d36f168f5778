//! From a captured or sampled body to a motion of actionlets.

use crate::action::Motion;
use crate::actionlet::{Sequence, decompose};
use crate::body::{Dof, JointAngles};
use crate::error::Error;

/// Rate to which compression refers, samples per second.
pub const REFERENCE_HZ: f64 = 120.0;

/// How well a degree of freedom is reproduced, and at what price.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Figure {
    /// Which.
    pub dof: Dof,
    /// Greatest minus least angle of the series, rad.
    pub range_rad: f64,
    /// Root mean square of the error, rad.
    pub rms_rad: f64,
    /// Noise of the series that was not to be fitted, rad: see
    /// [`crate::actionlet::Decomposed::noise_rad`].
    pub noise_rad: f64,
    /// Actionlets, rests included.
    pub actionlets: usize,
    /// Numbers that say the chain.
    pub numbers: usize,
    /// Samples of the series at [`REFERENCE_HZ`] for each number.
    pub compression: f64,
}

/// A motion of actionlets and how near it comes to what it was made from.
#[derive(Clone, Debug, PartialEq)]
pub struct DecomposedMotion {
    /// The motion. Angles are those of the series, also outside anatomical ranges.
    pub motion: Motion,
    /// In the order of [`Dof::ALL`].
    pub figures: Vec<Figure>,
}

/// Decomposes angles sampled at `rate_hz` with a root mean square error of `tolerance_rad` in every
/// degree of freedom.
///
/// # Errors
/// As [`crate::actionlet::decompose()`].
pub fn motion_of(
    angles: &[JointAngles],
    rate_hz: f64,
    tolerance_rad: f64,
) -> Result<DecomposedMotion, Error> {
    let mut figures = Vec::new();
    let mut tracks: Vec<Sequence> = Vec::new();
    for dof in Dof::ALL {
        let series: Vec<f64> = angles.iter().map(|pose| pose[dof]).collect();
        let found = decompose(&series, rate_hz, tolerance_rad).map_err(|e| e.at(dof.name()))?;
        let low = series.iter().copied().fold(f64::MAX, f64::min);
        let high = series.iter().copied().fold(f64::MIN, f64::max);
        let samples = (series.len() - 1) as f64 / rate_hz * REFERENCE_HZ;
        figures.push(Figure {
            dof,
            range_rad: high - low,
            rms_rad: found.rms_rad,
            noise_rad: found.noise_rad,
            actionlets: found.chain.actionlets().len(),
            numbers: found.numbers(),
            compression: samples / found.numbers() as f64,
        });
        tracks.push(found.chain);
    }
    Ok(DecomposedMotion { motion: Motion::new(tracks)?, figures })
}
