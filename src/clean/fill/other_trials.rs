//! A marker after its neighbours, as other trials show it: ridge regression of where it is among them on how they lie,
//! over frames of other trials and of this one. Neighbours are turned over one another first, so that it makes no
//! difference where somebody goes. And a bridge over what the regression misses.

use super::super::aids::marker_called;
use super::super::edge::bridge;
use super::super::neighbours::Neighbour;
use super::super::regression::{LearnedRow, Regression};
use super::super::trial::{Gap, Trial};
use super::{donors, learned};
use crate::mocap::fit::rigid::turn_over;
use glam::{DQuat, DVec3};
use nalgebra::DVector;

/// Neighbours that are followed.
const DONORS: usize = 6;
/// Fewest of them: two leave a turn open.
const FEWEST: usize = 3;
/// Frames that are learned from: of this trial, and of all others together.
const OWN: usize = 400;
const OTHERS: usize = 1200;

pub(super) fn fill(
    trial: &Trial,
    gap: &Gap,
    near: &[Neighbour],
    others: &[Trial],
) -> Option<Vec<DVec3>> {
    let donors = donors(trial, gap, near, DONORS);
    if donors.len() < FEWEST {
        return None;
    }
    let frames = learned(trial, gap, &donors);
    let donors: Vec<usize> = donors.iter().map(|of| of.marker).collect();
    let (reference, ..) = lie(trial, &donors, gap.frames.start - 1)?;
    let mut rows: Vec<LearnedRow> = Vec::new();
    let called = |other: &Trial, marker: &usize| marker_called(other, trial.labels().get(*marker)?);
    for other in others {
        let here = donors.iter().map(|marker| called(other, marker));
        let both = here.collect::<Option<Vec<usize>>>().zip(called(other, &gap.marker));
        let Some((donors, marker)) = both else { continue };
        let step = other.frames().div_ceil(OTHERS / others.len().max(1)).max(1);
        let frames = (0..other.frames()).step_by(step);
        rows.extend(frames.filter_map(|frame| row(other, marker, &donors, frame, &reference)));
    }
    // Nothing of others: that is another way of filling.
    if rows.is_empty() {
        return None;
    }
    let step = frames.len().div_ceil(OWN).max(1);
    let own = frames.into_iter().step_by(step);
    rows.extend(own.filter_map(|frame| row(trial, gap.marker, &donors, frame, &reference)));
    let regression = Regression::of_rows(&donors, &rows)?;
    bridge(trial, gap, |frame| {
        let (lie, middle) = lie(trial, &donors, frame)?;
        let turn = turn_over(&reference, &lie)?;
        Some(middle + turn * regression.from_middle(&turned(&lie, turn)))
    })
}

/// What a frame shows.
fn row(
    trial: &Trial,
    marker: usize,
    donors: &[usize],
    frame: usize,
    reference: &[DVec3],
) -> Option<LearnedRow> {
    let place = trial.at(marker, frame)?;
    let (lie, middle) = lie(trial, donors, frame)?;
    let turn = turn_over(reference, &lie)?;
    Some((turned(&lie, turn), turn.inverse() * (place - middle), 1.0))
}

/// How neighbours lie, turned back.
fn turned(lie: &[DVec3], turn: DQuat) -> DVector<f64> {
    let back = turn.inverse();
    let numbers = lie.iter().flat_map(|place| (back * *place).to_array());
    DVector::from_iterator(3 * lie.len(), numbers)
}

/// How markers lie about their middle, and the middle.
fn lie(trial: &Trial, donors: &[usize], frame: usize) -> Option<(Vec<DVec3>, DVec3)> {
    let places: Vec<DVec3> =
        donors.iter().map(|marker| trial.at(*marker, frame)).collect::<Option<_>>()?;
    let middle = places.iter().sum::<DVec3>() / places.len() as f64;
    Some((places.into_iter().map(|place| place - middle).collect(), middle))
}
