//! Which way of filling is best for a gap, found out on the trial itself: gaps as long are cut where the same marker is
//! seen, with the same others hidden that are missing in the gap, filled in every way, and compared with what was there.

use super::fill::{Method, NEIGHBOURS};
use super::neighbours::{Neighbour, Usual, neighbours};
use super::trial::{Gap, Taken, Trial};
use glam::DVec3;
use std::collections::BTreeMap;

/// Gaps that are cut, at most.
const CUTS: usize = 20;
/// Fewer tell nothing.
const FEWEST_CUTS: usize = 5;
/// Cuts that do not overlap, without which the usual way is not left for another.
const FEWEST_APART: f64 = 3.0;
/// Time in which the marker is seen on each side of a cut, s: that much if the trial has it, and a tenth of it at
/// least.
const BESIDE_S: f64 = 0.5;
/// Share of the cuts that a way of filling must have filled to be chosen.
const FILLED: f64 = 0.8;
/// Where nothing can be cut: gaps below this are filled by a quintic spline, longer ones after neighbours, s. That is
/// what trials of walking show in the mean.
const SHORT_S: f64 = 0.15;

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
    /// How far it is expected to miss, m; `None` if the trial is too short to find out.
    pub error_m: Option<f64>,
    /// All ways that were tried, the best first.
    pub tried: Vec<Expected>,
}

/// Chooses for the gaps of one trial. What is found out is kept for other gaps of the same kind.
#[derive(Debug)]
pub struct Chooser<'a> {
    trial: &'a mut Trial,
    neighbours: BTreeMap<usize, Vec<Neighbour>>,
    /// By marker, length and the neighbours that miss.
    known: BTreeMap<(usize, usize, Vec<usize>), Vec<Expected>>,
}

impl<'a> Chooser<'a> {
    /// For a trial from which all that is wrong has been taken out. It is the same in the end.
    #[must_use]
    pub const fn new(trial: &'a mut Trial) -> Self {
        Self { trial, neighbours: BTreeMap::new(), known: BTreeMap::new() }
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
        method.fill(self.trial, gap, &near)
    }

    /// Chooses how to fill a gap.
    pub fn choose(&mut self, gap: &Gap) -> FillChoice {
        let tried = self.expected(gap);
        // The best first; what cannot fill this very gap is passed over.
        for expected in &tried {
            if self.fill(gap, expected.method).is_some() {
                let (method, error_m) = (Some(expected.method), Some(expected.error_m));
                return FillChoice { method, error_m, tried };
            }
        }
        let first = usual(gap.frames.len() as f64 / self.trial.rate_hz());
        let order = [first, Method::Pattern, Method::LowRank, Method::RigidBody, Method::Quintic];
        let able = order.into_iter().chain([Method::Cubic]);
        let method = { able }.find(|method| self.fill(gap, *method).is_some());
        FillChoice { method, error_m: None, tried }
    }

    /// What can be expected of each way for gaps as this one, the best first; empty if the trial is too short.
    fn expected(&mut self, gap: &Gap) -> Vec<Expected> {
        let around = gap.frames.start.saturating_sub(1)..gap.frames.end + 1;
        let near = self.near(gap.marker).to_vec();
        let missing: Vec<usize> = near
            .iter()
            .map(|of| of.marker)
            .filter(|marker| !self.trial.is_seen_throughout(*marker, around.clone()))
            .collect();
        let key = (gap.marker, gap.frames.len(), missing);
        if let Some(known) = self.known.get(&key) {
            return known.clone();
        }
        let length = gap.frames.len();
        let (starts, apart) = cuts(self.trial, gap.marker, length);
        let mut rows: Vec<[Option<f64>; Method::ALL.len()]> = Vec::with_capacity(starts.len());
        for start in &starts {
            let cut = Gap { marker: gap.marker, frames: *start..start + length };
            rows.push(self.cut_and_fill(&cut, &key.2, &near));
        }
        let expected = if rows.len() < FEWEST_CUTS {
            Vec::new()
        } else {
            judged(&rows, apart, usual(length as f64 / self.trial.rate_hz()))
        };
        self.known.insert(key, expected.clone());
        expected
    }

    /// Cuts a gap, with others hidden, and fills it in every way; how far each missed in the mean, m.
    fn cut_and_fill(
        &mut self,
        cut: &Gap,
        hidden: &[usize],
        near: &[Neighbour],
    ) -> [Option<f64>; Method::ALL.len()] {
        let around = cut.frames.start - 1..cut.frames.end + 1;
        let mut taken: Vec<Taken> = Vec::with_capacity(hidden.len() + 1);
        for marker in hidden {
            taken.push(self.trial.take_out(*marker, around.clone()));
        }
        let truth: Vec<Option<DVec3>> =
            cut.frames.clone().map(|frame| self.trial.at(cut.marker, frame)).collect();
        taken.push(self.trial.take_out(cut.marker, cut.frames.clone()));
        let missed = |filled: Vec<DVec3>| {
            let off = filled.iter().zip(&truth).filter_map(|(a, b)| Some(a.distance((*b)?)));
            off.sum::<f64>() / truth.len() as f64
        };
        let errors = Method::ALL.map(|method| {
            method.fill(self.trial, cut, near).map(missed).filter(|error_m| error_m.is_finite())
        });
        taken.iter().rev().for_each(|taken| self.trial.put_back(taken));
        errors
    }
}

/// The way that is usually best for gaps of a length.
const fn usual(length_s: f64) -> Method {
    if length_s <= SHORT_S { Method::Quintic } else { Method::Pattern }
}

/// The ways by what they missed in the cuts, a row for each cut, the best first. Few cuts tell little: the usual way is
/// left for another only if that one is better by more than the standard error of the difference, `apart` of the
/// cuts counting as independent.
fn judged(rows: &[[Option<f64>; Method::ALL.len()]], apart: f64, usual: Method) -> Vec<Expected> {
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
