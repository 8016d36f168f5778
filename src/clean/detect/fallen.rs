//! Markers that came off: they lie still to the end while their neighbours are elsewhere.

use super::super::artefact::{Artefact, ArtefactKind, Cause};
use super::super::neighbours::{Neighbour, Usual, neighbours_in};
use super::super::trial::Trial;
use super::expectation::median;

/// What moves less lies still, m.
const STILL_M: f64 = 0.015;
/// Shortest time of it, s.
const SHORTEST_S: f64 = 0.2;
/// Frames before it by which neighbours are known.
const FEWEST_BEFORE: usize = 24;
/// Neighbours that are asked, and the share of them that must be elsewhere; in so many of the frames.
const KNOWN: usize = 12;
const ASKED: usize = 4;
const APART: f64 = 0.05;
const RIGID_M: f64 = 0.02;
const AGREED: f64 = 0.9;
const FRAMES: f64 = 0.5;
/// How far off their distances must be, m and in spreads, and at some time, m: skin on skin moves less.
const LEFT_M: f64 = 0.02;
const SPREADS: f64 = 6.0;
const FAR_M: f64 = 0.04;

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
    let mut near = neighbours_in(trial, marker, KNOWN, Usual::Shorth, known);
    // Of a person who stood still before, all distances are constant: what is near is on the same limb.
    let doubt_m = |of: &Neighbour| of.spread_m + APART * of.distance_m;
    near.sort_by(|a, b| doubt_m(a).total_cmp(&doubt_m(b)));
    near.truncate(ASKED);
    if near.len() < 3 {
        return None;
    }
    // Those across a joint say less; but somebody must say something.
    if near.iter().filter(|of| of.spread_m < RIGID_M).count() >= 2 {
        near.retain(|of| of.spread_m < RIGID_M);
    }
    let off_m = |frame: usize, of: &Neighbour| -> Option<f64> {
        let distance_m = trial.at(marker, frame)?.distance(trial.at(of.marker, frame)?);
        Some((distance_m - of.distance_m).abs())
    };
    // The share of the neighbours that are elsewhere.
    let elsewhere = |frame: usize| -> Option<f64> {
        let off = near
            .iter()
            .filter_map(|of| Some(off_m(frame, of)? > LEFT_M.max(SPREADS * of.spread_m)));
        let off: Vec<bool> = off.collect();
        let count = off.iter().filter(|is_off| **is_off).count();
        (!off.is_empty()).then(|| count as f64 / off.len() as f64)
    };
    let shares: Vec<f64> = (still..end).filter_map(elsewhere).collect();
    let agreed = shares.iter().filter(|share| **share >= AGREED).count();
    let is_far = |of: &Neighbour| {
        median((still..end).filter_map(|frame| off_m(frame, of))).is_some_and(|off| off > FAR_M)
    };
    if (agreed as f64) < FRAMES * shares.len() as f64 || !near.iter().any(is_far) {
        return None;
    }
    let left = |frame: &usize| elsewhere(*frame).is_none_or(|share| share >= AGREED);
    let begin = (first..still).rev().take_while(left).last().unwrap_or(still);
    Some(Artefact {
        kind: ArtefactKind::Fallen,
        marker,
        with: None,
        frames: begin..end,
        cause: Some(Cause::LooseAttachment),
        confidence: agreed as f64 / shares.len() as f64,
    })
}
