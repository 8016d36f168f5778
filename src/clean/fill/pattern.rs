//! A marker after its neighbours: ridge regression (Hoerl and Kennard 1970) of where it is among them on how they lie,
//! over all frames in which they are seen together, and a bridge over what the regression misses.

use super::super::edge::bridge;
use super::super::neighbours::Neighbour;
use super::super::regression::Regression;
use super::super::trial::{Gap, Trial};
use super::{donors, learned};
use glam::DVec3;

/// Neighbours that are followed.
const DONORS: usize = 6;
/// Fewest of them.
const FEWEST: usize = 2;

pub(super) fn fill(trial: &Trial, gap: &Gap, near: &[Neighbour]) -> Option<Vec<DVec3>> {
    let donors = donors(trial, gap, near, DONORS);
    if donors.len() < FEWEST {
        return None;
    }
    let frames = learned(trial, gap, &donors);
    let donors: Vec<usize> = donors.iter().map(|of| of.marker).collect();
    let regression = Regression::over(trial, gap.marker, &donors, &frames, |_| 1.0)?;
    bridge(trial, gap, |frame| regression.at(trial, frame))
}
