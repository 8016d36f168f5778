//! What is wrong with a trial, found.

use super::artefact::{Artefact, ArtefactKind, Cause};
use super::neighbours::{Neighbour, Usual, neighbours};
use super::trial::Trial;
use off::Found;
use std::collections::BTreeMap;

mod expectation;
mod fallen;
mod off;
mod stuck;
mod swap;

/// Neighbours of a marker that are looked at: one more than predict, because one may be taken for it.
const NEIGHBOURS: usize = 11;
/// Neighbours that are asked whether they were seen.
const ASKED: usize = 6;
/// Share of all markers of which the tracking was lost if they are missing together.
const LOST: f64 = 0.8;
/// Rounds of looking for each marker, at most: what is wrong with one hides what is wrong with others.
const ROUNDS: usize = 3;

/// All that is wrong with the markers of a trial, in order of marker and time. `told` hears how many of how many were
/// looked at.
///
/// What sticks is found first, and what fell off, then names that are exchanged, then what is off by the neighbours: the
/// worst marker first, which is taken out before others are looked at again, because it pulls at what its neighbours
/// expect.
#[must_use]
pub fn artefacts(trial: &Trial, mut told: impl FnMut(usize, usize)) -> Vec<Artefact> {
    let count = trial.markers();
    let near: Vec<Vec<Neighbour>> = (0..count)
        .map(|marker| {
            told(marker, 3 * count);
            neighbours(trial, marker, NEIGHBOURS, Usual::Shorth)
        })
        .collect();
    let mut found = dropouts(trial, &near);
    let mut left = trial.clone();
    for (marker, near) in near.iter().enumerate() {
        let near: Vec<usize> = near.iter().map(|of| of.marker).collect();
        let apart = stuck::stuck(trial, marker, &near).into_iter();
        for artefact in apart.chain(fallen::fallen(trial, marker)) {
            left.take_out(marker, artefact.frames.clone());
            found.push(artefact);
        }
    }
    let mut looked: BTreeMap<usize, Found> = BTreeMap::new();
    for (marker, near) in near.iter().enumerate() {
        told(count + marker, 3 * count);
        let at = off::off(&left, marker, near);
        if at.score > 0.0 || at.is_sudden {
            looked.insert(marker, at);
        }
    }
    let has = |marker: usize, of: usize| {
        near.get(marker).is_some_and(|near| near.iter().any(|near| near.marker == of))
    };
    for artefact in swapped(&left, &looked, &near) {
        let Some(other) = artefact.with else { continue };
        left.exchange(artefact.marker, other, artefact.frames.clone());
        for (marker, near) in near.iter().enumerate() {
            let is_touched = |of: usize| marker == of || has(marker, of);
            if is_touched(artefact.marker) || is_touched(other) {
                looked.insert(marker, off::off(&left, marker, near));
            }
        }
        found.push(artefact);
    }
    for round in 0..ROUNDS * count {
        told(2 * count + round / ROUNDS, 3 * count);
        looked.retain(|_, at| at.score > 0.0);
        let worst = looked.iter().max_by(|a, b| a.1.score.total_cmp(&b.1.score));
        let Some(worst) = worst.map(|(marker, _)| *marker) else { break };
        let Some(at) = looked.remove(&worst) else { break };
        for artefact in at.artefacts {
            left.take_out(worst, artefact.frames.clone());
            found.push(artefact);
        }
        let again = looked.keys().copied().filter(|of| has(*of, worst));
        let again: Vec<usize> = again.chain([worst]).collect();
        for marker in again {
            let near = near.get(marker).map(Vec::as_slice).unwrap_or_default();
            looked.insert(marker, off::off(&left, marker, near));
        }
    }
    told(3 * count, 3 * count);
    found.sort_by_key(|of| (of.marker, of.frames.start, of.frames.end));
    found
}

/// All gaps between frames in which a marker is seen.
fn dropouts(trial: &Trial, near: &[Vec<Neighbour>]) -> Vec<Artefact> {
    let markers: Vec<usize> =
        (0..trial.markers()).filter(|marker| !trial.seen_runs(*marker).is_empty()).collect();
    let mut found = Vec::new();
    for (marker, near) in near.iter().enumerate() {
        for gap in trial.gaps(marker) {
            let middle = gap.frames.start + gap.frames.len() / 2;
            let missing =
                |all: &[usize]| all.iter().filter(|of| !trial.is_seen(**of, middle)).count();
            let around: Vec<usize> = near.iter().take(ASKED).map(|of| of.marker).collect();
            let cause = if missing(&markers) as f64 >= LOST * markers.len() as f64 {
                Some(Cause::LostTracking)
            } else {
                (2 * missing(&around) <= around.len()).then_some(Cause::Occlusion)
            };
            found.push(Artefact {
                kind: ArtefactKind::Dropout,
                marker,
                with: None,
                frames: gap.frames,
                cause,
                confidence: 1.0,
            });
        }
    }
    found
}

/// Swaps between markers that change places, or one of which is odd; of several that claim the same frames of a marker
/// the surest.
fn swapped(
    trial: &Trial,
    looked: &BTreeMap<usize, Found>,
    near: &[Vec<Neighbour>],
) -> Vec<Artefact> {
    let mut all = Vec::new();
    let around: Vec<Vec<usize>> =
        (0..trial.markers()).map(|marker| swap::around(trial, marker)).collect();
    for (marker, others) in around.iter().enumerate() {
        for other in others.iter().copied() {
            let is_asked_twice =
                other < marker && around.get(other).is_some_and(|of| of.contains(&marker));
            let is_odd = looked.contains_key(&marker) || looked.contains_key(&other);
            if !is_asked_twice && (is_odd || swap::change_places(trial, marker, other)) {
                all.extend(swap::swaps(trial, marker, other, near));
            }
        }
    }
    all.sort_by(|a, b| b.confidence.total_cmp(&a.confidence));
    let mut kept: Vec<Artefact> = Vec::new();
    for artefact in all {
        let pair = |of: &Artefact| [Some(of.marker), of.with];
        let meets = |of: &Artefact| {
            pair(of).iter().any(|marker| pair(&artefact).contains(marker))
                && of.frames.start < artefact.frames.end
                && artefact.frames.start < of.frames.end
        };
        if !kept.iter().any(meets) {
            kept.push(artefact);
        }
    }
    kept
}
