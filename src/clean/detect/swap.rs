//! Two markers with each other's names: each is where the neighbours of the other one say that one should be. Where
//! that may begin and end is known without them: where each goes on from where the other was, or where one was not
//! seen.

use super::super::artefact::{Artefact, ArtefactKind, Cause};
use super::super::neighbours::Neighbour;
use super::super::trial::Trial;
use super::expectation::{Expectation, median};
use std::ops::Range;

/// Markers around one that it may be taken for.
const AROUND: usize = 8;
/// How much better the other names must fit: a share of how they fit as they are.
const BETTER: f64 = 0.6;
/// How far two must be off together, m, for anybody to tell.
const LEAST_M: f64 = 0.02;
/// Frames of it at least.
const SHORTEST: usize = 3;
/// Where one goes on from the other's place, it does so by this share of how far they are apart.
const NEARER: f64 = 0.5;

/// The markers that a marker may be taken for: those nearest to it at some moments of the trial.
pub(super) fn around(trial: &Trial, marker: usize) -> Vec<usize> {
    let seen: Vec<usize> = (0..trial.frames()).filter(|at| trial.is_seen(marker, *at)).collect();
    let mut nearest: Vec<(f64, usize)> = Vec::new();
    for share in [1, 3, 5, 7] {
        let Some(frame) = seen.get(seen.len() * share / 8) else { continue };
        for other in (0..trial.markers()).filter(|other| *other != marker) {
            if let (Some(a), Some(b)) = (trial.at(marker, *frame), trial.at(other, *frame)) {
                nearest.push((a.distance(b), other));
            }
        }
    }
    nearest.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut found = Vec::new();
    for (_, other) in nearest {
        if found.len() < AROUND && !found.contains(&other) {
            found.push(other);
        }
    }
    found
}

/// A part of a trial in which names do not change.
struct Part {
    frames: Range<usize>,
    /// True if it begins where one of the two was not seen.
    after_gap: bool,
}

/// True if two markers change places at some moment.
pub(super) fn change_places(trial: &Trial, one: usize, other: usize) -> bool {
    parts(trial, one, other).iter().skip(1).any(|part| !part.after_gap)
}

/// Parts between moments in which names may change.
fn parts(trial: &Trial, one: usize, other: usize) -> Vec<Part> {
    let mut parts: Vec<Part> = Vec::new();
    let mut last: Option<usize> = None;
    for frame in 0..trial.frames() {
        let (Some(a), Some(b)) = (trial.at(one, frame), trial.at(other, frame)) else { continue };
        let before = last.and_then(|at| Some((at, trial.at(one, at)?, trial.at(other, at)?)));
        last = Some(frame);
        let begins = match before {
            None => Some(false),
            Some((at, ..)) if at + 1 < frame => Some(true),
            Some((_, was_a, was_b)) => {
                let (stays, changes) =
                    (a.distance(was_a) + b.distance(was_b), a.distance(was_b) + b.distance(was_a));
                (changes < NEARER * stays).then_some(false)
            }
        };
        match (begins, parts.last_mut()) {
            (None, Some(part)) => part.frames.end = frame + 1,
            (begins, _) => {
                let after_gap = begins.unwrap_or(false);
                parts.push(Part { frames: frame..frame + 1, after_gap });
            }
        }
    }
    parts
}

/// Where two markers have each other's names, with how sure that is; `near` are the neighbours of all markers.
pub(super) fn swaps(
    trial: &Trial,
    one: usize,
    other: usize,
    near: &[Vec<Neighbour>],
) -> Vec<Artefact> {
    let parts = parts(trial, one, other);
    if parts.len() < 2 {
        return Vec::new();
    }
    let of = |marker: usize| near.get(marker).map(Vec::as_slice).unwrap_or_default();
    let mut of_one = Expectation::new(trial, one, of(one), Some(other));
    let mut of_other = Expectation::new(trial, other, of(other), Some(one));
    let mut found = Vec::new();
    for (number, part) in parts.iter().enumerate() {
        if part.frames.len() < SHORTEST {
            continue;
        }
        let mut off = |frame: usize| -> Option<(f64, f64)> {
            let (a, b) = (trial.at(one, frame)?, trial.at(other, frame)?);
            let (p, q) = (of_one.at(trial, frame)?, of_other.at(trial, frame)?);
            Some((a.distance(p) + b.distance(q), a.distance(q) + b.distance(p)))
        };
        let seen: Vec<(f64, f64)> = part.frames.clone().filter_map(&mut off).collect();
        let as_named = median(seen.iter().map(|of| of.0)).unwrap_or(0.0);
        let exchanged = median(seen.iter().map(|of| of.1)).unwrap_or(f64::INFINITY);
        if as_named < LEAST_M || exchanged > BETTER * as_named {
            continue;
        }
        let kind = match (number, part.after_gap) {
            (0, _) => ArtefactKind::SwapAtStart,
            (_, true) => ArtefactKind::SwapAfterGap,
            (_, false) => ArtefactKind::SwapInside,
        };
        found.push(Artefact {
            kind,
            marker: one,
            with: Some(other),
            frames: part.frames.clone(),
            cause: Some(Cause::BadReconstruction),
            confidence: 1.0 - exchanged / as_named,
        });
    }
    found
}
