//! Two markers with each other's names: each is where the neighbours of the other one say that one should be. Where
//! that may begin and end is known without them: where each goes on from where the other was, or where one was not
//! seen.

use super::super::artefact::{Artefact, ArtefactKind, Cause};
use super::super::neighbours::Neighbour;
use super::super::trial::Trial;
use super::expectation::{Expectation, median};
use glam::DVec3;
use std::ops::Range;

/// Markers around one that it may be taken for.
const AROUND: usize = 8;
/// How much better the other names must fit where nothing but the neighbours tells: a share of how they fit as they are.
const BETTER: f64 = 0.6;
/// How far two must be off together, m, for anybody to tell.
const LEAST_M: f64 = 0.02;
/// Frames of it at least.
const SHORTEST: usize = 3;
/// Where one goes on from the other's place, it does so by this share of how far they are apart.
const NEARER: f64 = 0.5;
/// What the names of a part weigh, as the logarithm of how much better the other ones fit: at most, and how it grows with
/// the time of the part up to so many s, because what neighbours miss is slow.
const MOST_EVIDENCE: f64 = 2.0;
const EVIDENCE_S: f64 = 0.3;
const LEAST_SHARE: f64 = 0.3;
/// What it costs that names change without a change of places, by what is between: nothing, or a gap; that they do not
/// change with one; and that they are wrong from the beginning.
const UNSEEN_CHANGE: f64 = 6.0;
const CHANGE_IN_GAP: f64 = 0.3;
const CHANGE_IGNORED: f64 = 1.5;
const WRONG_FROM_START: f64 = 0.2;

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

/// What is at the beginning of a part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Border {
    /// The first frame in which both are seen.
    Start,
    /// Each goes on from where the other was.
    Change,
    /// One of the two was not seen.
    Gap,
}

/// A part of a trial in which names do not change.
struct Part {
    frames: Range<usize>,
    border: Border,
}

/// True if two markers change places at some moment.
pub(super) fn change_places(trial: &Trial, one: usize, other: usize) -> bool {
    parts(trial, one, other).iter().any(|part| part.border == Border::Change)
}

/// Where a marker that goes on as it did will be in the next frame.
fn led_on(trial: &Trial, marker: usize, frame: usize) -> Option<DVec3> {
    let is = trial.at(marker, frame)?;
    let was = frame.checked_sub(1).and_then(|before| trial.at(marker, before));
    Some(was.map_or(is, |was| 2.0 * is - was))
}

/// Parts between moments in which names may change.
fn parts(trial: &Trial, one: usize, other: usize) -> Vec<Part> {
    let mut parts: Vec<Part> = Vec::new();
    let mut last: Option<usize> = None;
    for frame in 0..trial.frames() {
        let (Some(a), Some(b)) = (trial.at(one, frame), trial.at(other, frame)) else { continue };
        let changes_places = |at: usize| -> Option<bool> {
            let nearer = |was_a: DVec3, was_b: DVec3| {
                let stays = a.distance(was_a) + b.distance(was_b);
                a.distance(was_b) + b.distance(was_a) < NEARER * stays
            };
            // By where they were, and by where they were going.
            let held = nearer(trial.at(one, at)?, trial.at(other, at)?);
            Some(held && nearer(led_on(trial, one, at)?, led_on(trial, other, at)?))
        };
        let border = match last.replace(frame) {
            None => Some(Border::Start),
            Some(at) if at + 1 < frame => Some(Border::Gap),
            Some(at) => changes_places(at).unwrap_or(false).then_some(Border::Change),
        };
        match (border, parts.last_mut()) {
            (None, Some(part)) => part.frames.end = frame + 1,
            (border, _) => {
                let border = border.unwrap_or(Border::Start);
                parts.push(Part { frames: frame..frame + 1, border });
            }
        }
    }
    parts
}

/// How two markers fit a part: as they are named, and exchanged, m.
#[derive(Clone, Copy, Debug)]
struct Fit {
    as_named_m: f64,
    exchanged_m: f64,
}

impl Fit {
    /// How much better the other names fit, as a logarithm.
    fn evidence(self, length_s: f64) -> f64 {
        let ratio = (self.as_named_m.max(1e-6) / self.exchanged_m.max(1e-6)).ln();
        ratio.clamp(-MOST_EVIDENCE, MOST_EVIDENCE) * (length_s / EVIDENCE_S).clamp(LEAST_SHARE, 1.0)
    }
}

/// In which parts names are exchanged: the likeliest way through all of them (Viterbi, IEEE Transactions on Information
/// Theory 13, 1967). Where places change, names do; where one was not seen, they may.
fn exchanged(parts: &[Part], evidence: &[f64]) -> Vec<bool> {
    let mut ways: Vec<[(f64, usize); 2]> = Vec::with_capacity(parts.len());
    for (part, evidence) in parts.iter().zip(evidence) {
        let cost = |from: usize, to: usize| match (part.border, from == to) {
            (Border::Change, false) | (Border::Gap, true) => 0.0,
            (Border::Change, true) => CHANGE_IGNORED,
            (Border::Gap, false) => CHANGE_IN_GAP,
            (Border::Start, true) => 0.0,
            (Border::Start, false) => UNSEEN_CHANGE,
        };
        let way = |to: usize| {
            let gain = if to == 1 { *evidence } else { 0.0 };
            match ways.last() {
                None => (gain - if to == 1 { WRONG_FROM_START } else { 0.0 }, 0),
                Some(before) => {
                    let by = |from: usize| before[from].0 - cost(from, to);
                    let from = usize::from(by(1) > by(0));
                    (by(from) + gain, from)
                }
            }
        };
        ways.push([way(0), way(1)]);
    }
    let mut at = usize::from(ways.last().is_some_and(|last| last[1].0 > last[0].0));
    let mut found = Vec::with_capacity(parts.len());
    for way in ways.iter().rev() {
        found.push(at == 1);
        at = way[at].1;
    }
    found.reverse();
    found
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
    let fits: Vec<Option<Fit>> = parts
        .iter()
        .map(|part| {
            let mut off = |frame: usize| -> Option<(f64, f64)> {
                let (a, b) = (trial.at(one, frame)?, trial.at(other, frame)?);
                let (p, q) = (of_one.at(trial, frame)?, of_other.at(trial, frame)?);
                Some((a.distance(p) + b.distance(q), a.distance(q) + b.distance(p)))
            };
            let seen: Vec<(f64, f64)> = part.frames.clone().filter_map(&mut off).collect();
            let as_named_m = median(seen.iter().map(|of| of.0))?;
            Some(Fit { as_named_m, exchanged_m: median(seen.iter().map(|of| of.1))? })
        })
        .collect();
    let length_s = |part: &Part| part.frames.len() as f64 / trial.rate_hz();
    let evidence = parts.iter().zip(&fits);
    let evidence: Vec<f64> =
        evidence.map(|(part, fit)| fit.map_or(0.0, |fit| fit.evidence(length_s(part)))).collect();
    let states = exchanged(&parts, &evidence);
    let mut found = Vec::new();
    for (number, (part, is_exchanged)) in parts.iter().zip(&states).enumerate() {
        let Some(fit) = fits.get(number).copied().flatten().filter(|_| *is_exchanged) else {
            continue;
        };
        if part.frames.len() < SHORTEST {
            continue;
        }
        let border = |number: usize| parts.get(number).map(|part| part.border);
        let is_seen_to_change =
            [border(number), border(number + 1)].contains(&Some(Border::Change));
        let share = fit.exchanged_m / fit.as_named_m.max(1e-6);
        // Without a change of places that is seen, the neighbours must be sure.
        if !is_seen_to_change && (fit.as_named_m < LEAST_M || share > BETTER) {
            continue;
        }
        let kind = match part.border {
            Border::Start => ArtefactKind::SwapAtStart,
            Border::Gap => ArtefactKind::SwapAfterGap,
            Border::Change => ArtefactKind::SwapInside,
        };
        let doubt = if is_seen_to_change { share / 2.0 } else { share };
        found.push(Artefact {
            kind,
            marker: one,
            with: Some(other),
            frames: part.frames.clone(),
            cause: Some(Cause::BadReconstruction),
            confidence: 1.0 - doubt.clamp(0.0, 1.0),
        });
    }
    found
}
