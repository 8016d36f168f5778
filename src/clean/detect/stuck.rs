//! Markers that stay where they are, to the last bit, while others around them move.

use super::super::artefact::{Artefact, ArtefactKind, Cause};
use super::super::trial::{Trial, runs};
use glam::DVec3;

/// Shortest time of it, s, and in frames.
const SHORTEST_S: f64 = 0.04;
const SHORTEST: usize = 4;
/// How far its neighbours must move meanwhile, m: coarse files repeat a marker that rests.
const MOVED_M: f64 = 0.004;

/// A marker that goes this much further in one frame than twice the frame before was put there, m.
const STEP_M: f64 = 0.02;

/// How far a marker goes up to a frame from the one before, m; nothing if it is not seen in both.
fn step_m(trial: &Trial, marker: usize, frame: usize) -> Option<f64> {
    let before = trial.at(marker, frame.checked_sub(1)?)?;
    Some(trial.at(marker, frame)?.distance(before))
}

/// Where a marker sticks; `near` are its neighbours.
pub(super) fn stuck(trial: &Trial, marker: usize, near: &[usize]) -> Vec<Artefact> {
    let is_same = |frame: usize| {
        frame > 0
            && trial.at(marker, frame).is_some()
            && trial.at(marker, frame) == trial.at(marker, frame - 1)
    };
    let least = trial.frames_of(SHORTEST_S).max(SHORTEST) - 1;
    let found = runs(trial.frames(), is_same).into_iter().filter(|run| run.len() >= least);
    let moves = found.filter_map(|run| {
        let (first, last) = (run.start - 1, run.end - 1);
        let travel = |of: &usize| {
            let places: Vec<DVec3> =
                (first..=last).filter_map(|frame| trial.at(*of, frame)).collect();
            let from = *places.first()?;
            places.iter().map(|place| place.distance(from)).max_by(f64::total_cmp)
        };
        let mut travels: Vec<f64> = near.iter().filter_map(travel).collect();
        travels.sort_by(f64::total_cmp);
        let usual = *travels.get(travels.len() / 2)?;
        // Where it came to in one step, it was wrong from there on.
        let stepped = step_m(trial, marker, first);
        let before = first.checked_sub(1).and_then(|before| step_m(trial, marker, before));
        let is_apart =
            stepped.is_some_and(|step_m| step_m > STEP_M + 2.0 * before.unwrap_or_default());
        let begins = if is_apart { first } else { first + 1 };
        (usual > MOVED_M || is_apart).then(|| Artefact {
            kind: ArtefactKind::Stuck,
            marker,
            with: None,
            frames: begins..last + 1,
            cause: Some(Cause::LostTracking),
            confidence: 1.0 - 0.5 * (MOVED_M / usual).min(1.0),
        })
    });
    moves.collect()
}
