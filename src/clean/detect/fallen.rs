//! Markers that came off: they lie still to the end while their neighbours are elsewhere.

use super::super::artefact::{Artefact, ArtefactKind, Cause};
use super::super::neighbours::{Usual, neighbours_in};
use super::super::trial::Trial;

/// What moves less lies still, m.
const STILL_M: f64 = 0.02;
/// Shortest time of it, s.
const SHORTEST_S: f64 = 0.2;
/// Frames before it by which neighbours are known.
const FEWEST_BEFORE: usize = 24;
/// Neighbours that are asked, and the share of them that must be elsewhere.
const ASKED: usize = 4;
const AGREED: f64 = 0.7;
/// How far off their distances must be in the end, m and in spreads; and how far where it began.
const FAR_M: f64 = 0.15;
const LEFT_M: f64 = 0.02;
const SPREADS: f64 = 6.0;

/// Where a marker fell off, if it did.
pub(super) fn fallen(trial: &Trial, marker: usize) -> Option<Artefact> {
    let runs = trial.seen_runs(marker);
    let (first, end) = (runs.first()?.start, runs.last()?.end);
    let rest = trial.at(marker, end - 1)?;
    let lies =
        |frame: &usize| trial.at(marker, *frame).is_none_or(|place| place.distance(rest) < STILL_M);
    let still = (first..end).rev().take_while(lies).last()?;
    if end - still < trial.frames_of(SHORTEST_S) || still - first < FEWEST_BEFORE {
        return None;
    }
    // Its neighbours are those of the time before, the fall itself left out.
    let known = first..still.saturating_sub(trial.frames_of(SHORTEST_S)).max(first + FEWEST_BEFORE);
    let near = neighbours_in(trial, marker, ASKED, Usual::Shorth, known);
    if near.len() < 3 {
        return None;
    }
    let elsewhere = |frame: usize, least_m: f64| -> Option<f64> {
        let own = trial.at(marker, frame)?;
        let off = near.iter().filter_map(|of| {
            let distance = own.distance(trial.at(of.marker, frame)?);
            Some((distance - of.distance_m).abs() > least_m.max(SPREADS * of.spread_m))
        });
        let off: Vec<bool> = off.collect();
        let count = off.iter().filter(|is_off| **is_off).count();
        (!off.is_empty()).then(|| count as f64 / off.len() as f64)
    };
    // In the end, and in the middle of lying there.
    let agreed = |frame: usize| elsewhere(frame, FAR_M).is_some_and(|share| share >= AGREED);
    if !agreed(end - 1) || !agreed(still + (end - still) / 2) {
        return None;
    }
    let left = |frame: &usize| elsewhere(*frame, LEFT_M).is_none_or(|share| share >= AGREED);
    let begin = (first..still).rev().take_while(left).last().unwrap_or(still);
    Some(Artefact {
        kind: ArtefactKind::Fallen,
        marker,
        with: None,
        frames: begin..end,
        cause: Some(Cause::LooseAttachment),
        confidence: elsewhere(end - 1, FAR_M).unwrap_or(AGREED),
    })
}
