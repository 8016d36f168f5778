//! Which way of filling is best for a gap, found out on the trial itself: gaps as long are cut where the same marker is
//! seen, with the same others hidden that are missing in the gap, filled in every way, and compared with what was there.
//! A trial that is too short for that is told of by other trials, else by what was measured once and is stored.

use super::aids::{Aids, marker_called};
use super::fill::{Method, NEIGHBOURS};
use super::neighbours::{Neighbour, Usual, neighbours};
use super::trial::{Gap, Taken, Trial};
use glam::DVec3;
use serde::Serialize;
use std::collections::BTreeMap;
use std::ops::Range;

/// Gaps that are cut, at most.
const CUTS: usize = 20;
/// Fewer tell nothing.
const FEWEST_CUTS: usize = 5;
/// Cuts that do not overlap, without which the usual way is not left for another.
const FEWEST_APART: f64 = 3.0;
/// Time in which the marker is seen on each side of a cut, s: that much if the trial has it, and a tenth of it at
/// least.
const BESIDE_S: f64 = 0.5;
/// How much rates of trials may differ that are taken for the same.
const SAME_RATE: f64 = 0.01;
/// Share of the cuts that a way of filling must have filled to be chosen.
const FILLED: f64 = 0.8;
/// Where nothing can be cut: gaps below this are filled by a quintic spline, longer ones after neighbours, s. That is
/// what trials of walking show in the mean.
const SHORT_S: f64 = 0.15;
/// The same where most of its nearest neighbours are missing too: they tell least of what moves least like the others.
const SHORT_ALONE_S: f64 = 0.3;
/// The neighbours whose distance to a marker changes least, most of which it needs not to be alone.
const NEAREST: usize = 3;
/// Lengths of gaps, s, and what ways of filling missed there in the mean of a walk and of stairs, 500 gaps of each, mm
/// (docs/cleaning.md). Nothing is stored of other trials: it is theirs to tell.
const STORED_S: [f64; 4] = [0.1, 0.25, 0.5, 1.0];
const STORED_MM: [(Method, [f64; 4]); 6] = [
    (Method::Cubic, [0.52, 4.74, 25.2, 77.3]),
    (Method::Quintic, [0.24, 2.40, 15.4, 74.9]),
    (Method::RigidBody, [0.41, 2.65, 7.18, 10.5]),
    (Method::Pattern, [0.32, 1.74, 3.43, 4.57]),
    (Method::LowRank, [0.38, 2.19, 4.29, 6.11]),
    (Method::Skeleton, [0.68, 3.21, 8.32, 14.3]),
];

/// Where it is known from how well a gap is filled.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ExpectedFrom {
    /// Gaps as long, cut elsewhere in the trial.
    ThisTrial,
    /// Gaps as long of the same marker, cut in other trials.
    OtherTrials,
    /// Gaps about as long in a walk and on stairs, which have nothing to do with this trial.
    Stored,
}

/// How good a way of filling is expected to be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Expected {
    /// The way.
    pub method: Method,
    /// Mean distance from what was cut, m.
    pub error_m: f64,
    /// Gaps that were cut and filled.
    pub cuts: usize,
}

/// A gap with what is known of how to fill it.
#[derive(Clone, Debug, PartialEq)]
pub struct FillChoice {
    /// The way that is taken; `None` if none can fill the gap.
    pub method: Option<Method>,
    /// How far it is expected to miss, m; `None` if nobody knows.
    pub error_m: Option<f64>,
    /// Where that is known from.
    pub from: Option<ExpectedFrom>,
    /// All ways that were tried, the best first.
    pub tried: Vec<Expected>,
}

/// Chooses for the gaps of one trial. What is found out is kept for other gaps of the same kind.
#[derive(Debug)]
pub struct Chooser<'a> {
    trial: &'a mut Trial,
    aids: &'a mut Aids,
    neighbours: BTreeMap<usize, Vec<Neighbour>>,
    /// By marker, length and the neighbours that miss.
    known: BTreeMap<(usize, usize, Vec<usize>), Known>,
}

/// What is expected, the best first, and from where that is known.
type Known = (Vec<Expected>, ExpectedFrom);
/// How far each way missed a gap that was cut, m.
type Cut = [Option<f64>; Method::ALL.len()];

impl<'a> Chooser<'a> {
    /// For a trial from which all that is wrong has been taken out, and what there is beside it. Both are the same in
    /// the end.
    #[must_use]
    pub const fn new(trial: &'a mut Trial, aids: &'a mut Aids) -> Self {
        Self { trial, aids, neighbours: BTreeMap::new(), known: BTreeMap::new() }
    }

    /// The trial.
    #[must_use]
    pub const fn trial(&self) -> &Trial {
        self.trial
    }

    /// The neighbours of a marker.
    pub fn near(&mut self, marker: usize) -> &[Neighbour] {
        let trial = &*self.trial;
        self.neighbours
            .entry(marker)
            .or_insert_with(|| neighbours(trial, marker, NEIGHBOURS, Usual::Median))
    }

    /// Fills a gap in one way.
    pub fn fill(&mut self, gap: &Gap, method: Method) -> Option<Vec<DVec3>> {
        let near = self.near(gap.marker).to_vec();
        method.fill(self.trial, gap, &near, self.aids)
    }

    /// Chooses how to fill a gap.
    pub fn choose(&mut self, gap: &Gap) -> FillChoice {
        let near = self.near(gap.marker).to_vec();
        let is_alone = is_alone(&near, &self.missing_of(gap, &near));
        let (tried, from) = self.expected(gap);
        // The best first; what cannot fill this very gap is passed over.
        for expected in &tried {
            if self.fill(gap, expected.method).is_some() {
                let (method, error_m) = (Some(expected.method), Some(expected.error_m));
                return FillChoice { method, error_m, from: Some(from), tried };
            }
        }
        let length_s = gap.frames.len() as f64 / self.trial.rate_hz();
        let order = [usual(length_s, is_alone), Method::Pattern, Method::LowRank, Method::Skeleton];
        let able = order.into_iter().chain([Method::RigidBody, Method::Quintic, Method::Cubic]);
        let method = { able }.find(|method| self.fill(gap, *method).is_some());
        let error_m = method.and_then(|method| stored_m(method, length_s));
        FillChoice { method, error_m, from: error_m.map(|_| ExpectedFrom::Stored), tried }
    }

    /// What can be expected of each way for gaps as this one, the best first; empty if no trial is long enough.
    fn expected(&mut self, gap: &Gap) -> Known {
        let near = self.near(gap.marker).to_vec();
        let key = (gap.marker, gap.frames.len(), self.missing_of(gap, &near));
        if let Some(known) = self.known.get(&key) {
            return known.clone();
        }
        let length = gap.frames.len();
        let (mut rows, mut apart) = tried(self.trial, self.aids, gap.marker, length, &key.2, &near);
        let mut from = ExpectedFrom::ThisTrial;
        if rows.len() < FEWEST_CUTS {
            (rows, apart) = self.tried_elsewhere(gap, &key.2);
            from = ExpectedFrom::OtherTrials;
        }
        let usual = usual(length as f64 / self.trial.rate_hz(), is_alone(&near, &key.2));
        let enough = rows.len() >= FEWEST_CUTS;
        let expected = if enough { judged(&rows, apart, usual) } else { Vec::new() };
        self.known.insert(key, (expected.clone(), from));
        (expected, from)
    }

    /// The neighbours that are not seen all through a gap and beside it.
    fn missing_of(&self, gap: &Gap, near: &[Neighbour]) -> Vec<usize> {
        let around = gap.frames.start.saturating_sub(1)..gap.frames.end + 1;
        let all = near.iter().map(|of| of.marker);
        all.filter(|marker| !self.trial.is_seen_throughout(*marker, around.clone())).collect()
    }

    /// The same gap cut in pieces of the other trials that are as long as this one, with the marker and the others
    /// hidden as here, and filled in every way; and how many of the cuts do not overlap. Each trial has the others of
    /// them for others.
    fn tried_elsewhere(&mut self, gap: &Gap, hidden: &[usize]) -> (Vec<Cut>, f64) {
        let mut others = std::mem::take(&mut self.aids.others);
        let most = CUTS.div_ceil(others.len().max(1)).max(FEWEST_CUTS);
        let (mut rows, mut apart) = (Vec::new(), 0.0);
        // Each is taken from the front and put back at the end: in the end they stand as before.
        for _ in 0..others.len() {
            let one = others.remove(0);
            let body = self.aids.body.as_ref().map(|body| body.on(self.trial, &one));
            let mut aids = Aids { body, others };
            for start in self.pieces(&one, most) {
                let piece = start..start + self.trial.frames();
                rows.extend(self.tried_in_piece(gap, hidden, &one, piece, &aids));
            }
            let room = (one.frames() + 1).saturating_sub(self.trial.frames());
            apart += room.div_ceil(gap.frames.len().max(1)) as f64;
            others = std::mem::take(&mut aids.others);
            others.push(one);
        }
        self.aids.others = others;
        (rows, apart)
    }

    /// Where pieces of another trial begin that are as long as this one, evenly over it.
    fn pieces(&self, other: &Trial, most: usize) -> impl Iterator<Item = usize> + use<> {
        // Frames of another rate are other frames.
        let is_alike = (other.rate_hz() / self.trial.rate_hz() - 1.0).abs() < SAME_RATE;
        let all = (other.frames() + 1).saturating_sub(self.trial.frames());
        let all = if is_alike { all } else { 0 };
        let step = all.div_ceil(most.max(1)).max(1);
        (step / 2..all).step_by(step)
    }

    /// The gap cut in a piece of another trial; `None` if the marker is not seen there.
    fn tried_in_piece(
        &self,
        gap: &Gap,
        hidden: &[usize],
        other: &Trial,
        piece: Range<usize>,
        aids: &Aids,
    ) -> Option<Cut> {
        let called = |of: &usize| marker_called(other, self.trial.labels().get(*of)?.as_str());
        let marker = called(&gap.marker)?;
        let hidden: Vec<usize> = hidden.iter().filter_map(called).collect();
        let mut piece = other.part(piece)?;
        for frame in 0..self.trial.frames() {
            if !gap.frames.contains(&frame) && !self.trial.is_seen(gap.marker, frame) {
                piece.put(marker, frame, None);
            }
        }
        if !piece.is_seen_throughout(marker, gap.frames.start - 1..gap.frames.end + 1) {
            return None;
        }
        let near = neighbours(&piece, marker, NEIGHBOURS, Usual::Median);
        let cut = Gap { marker, frames: gap.frames.clone() };
        Some(cut_and_fill(&mut piece, aids, &cut, &hidden, &near))
    }
}

/// Gaps of a length cut where a marker is seen, with others hidden, and filled in every way; and how many of them do not
/// overlap.
fn tried(
    trial: &mut Trial,
    aids: &Aids,
    marker: usize,
    length: usize,
    hidden: &[usize],
    near: &[Neighbour],
) -> (Vec<Cut>, f64) {
    let (starts, apart) = cuts(trial, marker, length);
    let cut = |start: usize| Gap { marker, frames: start..start + length };
    let gaps: Vec<Gap> = starts.into_iter().map(cut).collect();
    (gaps.iter().map(|gap| cut_and_fill(trial, aids, gap, hidden, near)).collect(), apart)
}

/// Cuts a gap, with others hidden, and fills it in every way; how far each missed in the mean, m.
fn cut_and_fill(
    trial: &mut Trial,
    aids: &Aids,
    cut: &Gap,
    hidden: &[usize],
    near: &[Neighbour],
) -> Cut {
    let around = cut.frames.start - 1..cut.frames.end + 1;
    let mut taken: Vec<Taken> = Vec::with_capacity(hidden.len() + 1);
    for marker in hidden {
        taken.push(trial.take_out(*marker, around.clone()));
    }
    let truth: Vec<Option<DVec3>> =
        cut.frames.clone().map(|frame| trial.at(cut.marker, frame)).collect();
    taken.push(trial.take_out(cut.marker, cut.frames.clone()));
    let missed = |filled: Vec<DVec3>| {
        let off = filled.iter().zip(&truth).filter_map(|(a, b)| Some(a.distance((*b)?)));
        off.sum::<f64>() / truth.len() as f64
    };
    let errors = Method::ALL.map(|method| {
        method.fill(trial, cut, near, aids).map(missed).filter(|error_m| error_m.is_finite())
    });
    taken.iter().rev().for_each(|taken| trial.put_back(taken));
    errors
}

/// What is stored of a way for gaps of a length, m; nothing of those that are longer than any that was measured.
fn stored_m(method: Method, length_s: f64) -> Option<f64> {
    let (_, errors) = STORED_MM.iter().find(|(of, _)| *of == method)?;
    let at = STORED_S.iter().position(|of| length_s <= of + 1e-9)?;
    let (after_s, after) = (STORED_S[at], errors[at]);
    let Some(before) = at.checked_sub(1) else { return Some(after / 1e3) };
    let share = (length_s - STORED_S[before]) / (after_s - STORED_S[before]);
    Some((errors[before] + share * (after - errors[before])) / 1e3)
}

/// The way that is usually best for gaps of a length, of a marker that is alone or not.
const fn usual(length_s: f64, is_alone: bool) -> Method {
    let short_s = if is_alone { SHORT_ALONE_S } else { SHORT_S };
    if length_s <= short_s { Method::Quintic } else { Method::Pattern }
}

/// True if most of the nearest neighbours of a marker are missing.
fn is_alone(near: &[Neighbour], missing: &[usize]) -> bool {
    let nearest = near.iter().take(NEAREST);
    2 * nearest.filter(|of| missing.contains(&of.marker)).count() > NEAREST
}

/// The ways by what they missed in the cuts, a row for each cut, the best first. Few cuts tell little: the usual way is
/// left for another only if that one is better by more than the standard error of the difference, `apart` of the
/// cuts counting as independent.
fn judged(rows: &[Cut], apart: f64, usual: Method) -> Vec<Expected> {
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let of = |at: usize| -> Vec<f64> { rows.iter().filter_map(|row| row[at]).collect() };
    let mut expected: Vec<Expected> = Method::ALL
        .iter()
        .enumerate()
        .map(|(at, method)| (*method, of(at)))
        .filter(|(_, errors)| errors.len() as f64 >= FILLED * rows.len() as f64)
        .map(|(method, errors)| Expected { method, error_m: mean(&errors), cuts: errors.len() })
        .collect();
    expected.sort_by(|a, b| a.error_m.total_cmp(&b.error_m));
    let index = |method| Method::ALL.iter().position(|of| *of == method);
    let usual_at = expected.iter().position(|of| of.method == usual);
    let (Some(at), Some(column)) = (usual_at, index(usual)) else { return expected };
    let is_better = |other: &Expected| {
        let Some(by) = index(other.method) else { return false };
        let gains: Vec<f64> = rows.iter().filter_map(|row| Some(row[column]? - row[by]?)).collect();
        let gain = mean(&gains);
        let variance =
            gains.iter().map(|of| (of - gain).powi(2)).sum::<f64>() / (gains.len() as f64 - 1.0);
        let independent = (gains.len() as f64).min(apart);
        independent >= FEWEST_APART && gain > (variance / independent).sqrt()
    };
    // Those that are better by chance only come after it.
    let kept = expected.remove(at);
    let (better, others): (Vec<Expected>, Vec<Expected>) =
        expected.iter().copied().partition(|of| of.error_m < kept.error_m && is_better(of));
    better.into_iter().chain([kept]).chain(others).collect()
}

/// Where gaps of a length can be cut, evenly over the trial, and how many of them do not overlap.
fn cuts(trial: &Trial, marker: usize, length: usize) -> (Vec<usize>, f64) {
    let runs = trial.seen_runs(marker);
    let beside = trial.frames_of(BESIDE_S);
    for beside in [beside, (beside / 10).max(3)] {
        let starts = |run: &std::ops::Range<usize>| {
            run.start + beside..(run.end + 1).saturating_sub(length + beside)
        };
        let all: usize = runs.iter().map(|run| starts(run).len()).sum();
        if all >= FEWEST_CUTS {
            let step = all.div_ceil(CUTS).max(1);
            let apart = runs.iter().map(|run| starts(run).len().div_ceil(length)).sum::<usize>();
            let starts = runs.iter().flat_map(starts).skip(step / 2).step_by(step);
            return (starts.collect(), apart as f64);
        }
    }
    (Vec::new(), 0.0)
}
