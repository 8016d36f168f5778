//! Where a marker should be, as its neighbours say, and by how much it is off. What is wrong in less than half of a
//! trial is not learned: frames are taken in which most distances are as usual, and those that are off count less.

use super::super::neighbours::Neighbour;
use super::super::regression::Regression;
use super::super::trial::Trial;
use glam::DVec3;
use std::collections::BTreeMap;

/// Neighbours that are looked at, and those of them that predict.
const NEIGHBOURS: usize = 10;
const DONORS: usize = 6;
const FEWEST: usize = 3;
/// Distances are as usual within so many of their spreads, to which this is added, m.
const SPREADS: f64 = 4.0;
const ALWAYS_M: f64 = 0.0025;
/// Share of the frames that is learned from at least.
const LEAST_TRUSTED: f64 = 0.55;
/// Frames that are learned from, at most.
const LEARNED: usize = 1000;
/// Rounds of weighing.
const ROUNDS: usize = 3;
/// What is further off counts less, m.
const LEAST_DOUBT_M: f64 = 0.005;
/// Sets of donors that are tried, at most: others are missing now and then.
const MOST_SETS: usize = 12;

/// What the neighbours of a marker say.
pub(super) struct Expectation {
    marker: usize,
    /// The neighbours, the most constant first.
    pub(super) near: Vec<Neighbour>,
    trusted: Vec<usize>,
    known: BTreeMap<Vec<usize>, Option<Regression>>,
}

impl Expectation {
    /// Of a marker by its neighbours; `without` is not asked.
    pub(super) fn new(
        trial: &Trial,
        marker: usize,
        near: &[Neighbour],
        without: Option<usize>,
    ) -> Self {
        let mut near = near.to_vec();
        near.retain(|of| Some(of.marker) != without);
        near.truncate(NEIGHBOURS);
        let trusted = trusted(trial, marker, &near);
        Self { marker, near, trusted, known: BTreeMap::new() }
    }

    /// Where the marker should be in a frame, m; `None` if too few neighbours are seen.
    pub(super) fn at(&mut self, trial: &Trial, frame: usize) -> Option<DVec3> {
        let donors = self.donors(trial, frame)?;
        self.by(trial, frame, &donors)
    }

    /// The neighbours that predict in a frame.
    fn donors(&self, trial: &Trial, frame: usize) -> Option<Vec<usize>> {
        let seen = self.near.iter().filter(|of| trial.is_seen(of.marker, frame));
        let donors: Vec<usize> = seen.take(DONORS).map(|of| of.marker).collect();
        (donors.len() >= FEWEST).then_some(donors)
    }

    /// Where these neighbours say that the marker should be, m.
    fn by(&mut self, trial: &Trial, frame: usize, donors: &[usize]) -> Option<DVec3> {
        if !self.known.contains_key(donors) {
            if self.known.len() >= MOST_SETS {
                return None;
            }
            let found = robust(trial, self.marker, donors, &self.trusted);
            self.known.insert(donors.to_vec(), found);
        }
        self.known.get(donors)?.as_ref()?.at(trial, frame)
    }

    /// By how much the marker is off in each frame, m; `None` where it or too few neighbours are seen. Where others
    /// have to predict for a while, what they say is led over from what the usual ones say before and after: that
    /// nobody moves when a neighbour is not seen.
    pub(super) fn off(&mut self, trial: &Trial) -> Vec<Option<DVec3>> {
        let frames = trial.frames();
        let sets: Vec<Option<Vec<usize>>> =
            (0..frames).map(|frame| self.donors(trial, frame)).collect();
        let mut counts: BTreeMap<&Vec<usize>, usize> = BTreeMap::new();
        for set in sets.iter().flatten() {
            *counts.entry(set).or_default() += 1;
        }
        let usual = counts.iter().max_by_key(|(_, count)| **count).map(|(set, _)| (*set).clone());
        let mut off = vec![None; frames];
        let mut first = 0;
        while first < frames {
            let same = sets.iter().skip(first).take_while(|set| **set == sets[first]).count();
            let run = first..first + same;
            first = run.end;
            let (Some(set), Some(usual)) = (&sets[run.start], &usual) else { continue };
            let mut differs = |frame: Option<usize>| -> Option<DVec3> {
                if set == usual {
                    return None;
                }
                let frame = frame.filter(|frame| *frame < frames)?;
                Some(self.by(trial, frame, usual)? - self.by(trial, frame, set)?)
            };
            let ends = (differs(run.start.checked_sub(1)), differs(Some(run.end)));
            let (before, after) = match ends {
                (Some(before), Some(after)) => (before, after),
                (one, other) => {
                    let only = one.or(other).unwrap_or_default();
                    (only, only)
                }
            };
            for frame in run.clone() {
                let share = (frame + 1 - run.start) as f64 / (run.len() + 1) as f64;
                let is_off = trial.at(self.marker, frame).zip(self.by(trial, frame, set));
                if let Some(held) = off.get_mut(frame) {
                    *held = is_off.map(|(is, said)| is - said - before.lerp(after, share));
                }
            }
        }
        off
    }
}

/// Frames in which distances are as usual, all but one.
fn trusted(trial: &Trial, marker: usize, near: &[Neighbour]) -> Vec<usize> {
    let unusual = |frame: usize| -> Option<f64> {
        let own = trial.at(marker, frame)?;
        let off = near.iter().take(DONORS).filter_map(|of| {
            let distance = own.distance(trial.at(of.marker, frame)?);
            Some((distance - of.distance_m).abs() / (of.spread_m + ALWAYS_M))
        });
        let mut off: Vec<f64> = off.collect();
        off.sort_by(f64::total_cmp);
        off.get(off.len().checked_sub(2)?).copied()
    };
    let mut all: Vec<(f64, usize)> =
        (0..trial.frames()).filter_map(|frame| Some((unusual(frame)?, frame))).collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    // Most of a trial is right, also where a person moves as seldom as once.
    let most = (LEAST_TRUSTED * all.len() as f64).ceil() as usize;
    let usual = all.iter().take_while(|(off, _)| *off < SPREADS).count();
    all.truncate(usual.max(most));
    let mut frames: Vec<usize> = all.into_iter().map(|(_, frame)| frame).collect();
    frames.sort_unstable();
    let step = frames.len().div_ceil(LEARNED).max(1);
    frames.into_iter().step_by(step).collect()
}

/// A regression in which what is off counts less, round by round.
fn robust(trial: &Trial, marker: usize, donors: &[usize], frames: &[usize]) -> Option<Regression> {
    let mut found = Regression::over(trial, marker, donors, frames, |_| 1.0)?;
    for _ in 0..ROUNDS {
        let off: Vec<f64> = frames
            .iter()
            .map(|frame| {
                let off = trial.at(marker, *frame).zip(found.at(trial, *frame));
                off.map_or(f64::INFINITY, |(is, should)| is.distance(should))
            })
            .collect();
        let doubt_m =
            (2.0 * median(off.iter().copied().filter(|of| of.is_finite()))?).max(LEAST_DOUBT_M);
        let weight = |at: usize| match off.get(at) {
            Some(off) if off.is_finite() => (1.0 + (off / doubt_m).powi(2)).powi(-2),
            _ => 0.0,
        };
        found = Regression::over(trial, marker, donors, frames, weight)?;
    }
    Some(found)
}

/// The median; `None` of nothing.
pub(super) fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}
