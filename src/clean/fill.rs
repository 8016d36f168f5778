//! Gaps filled. Each way of it gives the places of the frames that miss, m; none of them uses what another one filled,
//! so that every fill stands for itself and can be undone by itself. Two ways need more than the trial alone ([`Aids`]).

use super::aids::Aids;
use super::neighbours::Neighbour;
use super::trial::{Gap, Trial};
use glam::DVec3;
use serde::{Deserialize, Serialize};

mod low_rank;
mod other_trials;
mod pattern;
mod rigid_body;
mod skeleton;
mod spline;

/// Neighbours of a marker that fills look at.
pub const NEIGHBOURS: usize = 24;
/// Frames of the trial that a prediction is learned from, at most.
const LEARNED: usize = 1500;

/// How a gap is filled.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Cubic spline through the frames around the gap.
    Cubic,
    /// Quintic smoothing spline (Woltring), its smoothness by generalised cross-validation.
    Quintic,
    /// As part of a body of markers whose distances hardly change.
    RigidBody,
    /// After its neighbours, by regression over all frames in which they are seen together.
    Pattern,
    /// After all markers around it, in the few ways in which they move together.
    LowRank,
    /// As part of the person's skeleton.
    Skeleton,
    /// After its neighbours, by regression over frames of other trials as well.
    OtherTrials,
}

impl Method {
    /// All of them, the simplest first.
    pub const ALL: [Self; 7] = [
        Self::Cubic,
        Self::Quintic,
        Self::RigidBody,
        Self::Pattern,
        Self::LowRank,
        Self::Skeleton,
        Self::OtherTrials,
    ];

    /// The word for it, as in files.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Cubic => "cubic",
            Self::Quintic => "quintic",
            Self::RigidBody => "rigid_body",
            Self::Pattern => "pattern",
            Self::LowRank => "low_rank",
            Self::Skeleton => "skeleton",
            Self::OtherTrials => "other_trials",
        }
    }

    /// Fills a gap; `near` are the neighbours of its marker. `None` where this way cannot: too few frames or
    /// neighbours, or a gap too long for it, nobody's body, no other trials.
    #[must_use]
    pub fn fill(
        self,
        trial: &Trial,
        gap: &Gap,
        near: &[Neighbour],
        aids: &Aids,
    ) -> Option<Vec<DVec3>> {
        // There is a frame before and one after.
        let is_between = gap.frames.start > 0
            && gap.frames.start < gap.frames.end
            && trial.is_seen(gap.marker, gap.frames.start - 1)
            && trial.is_seen(gap.marker, gap.frames.end);
        if !is_between {
            return None;
        }
        match self {
            Self::Cubic => spline::cubic(trial, gap),
            Self::Quintic => spline::quintic(trial, gap),
            Self::RigidBody => rigid_body::fill(trial, gap, near),
            Self::Pattern => pattern::fill(trial, gap, near),
            Self::LowRank => low_rank::fill(trial, gap, near),
            Self::Skeleton => skeleton::fill(trial, gap, aids.body.as_ref()?),
            Self::OtherTrials => other_trials::fill(trial, gap, near, &aids.others),
        }
    }
}

/// The neighbours that are seen all through a gap and in the frames beside it.
fn donors(trial: &Trial, gap: &Gap, near: &[Neighbour], most: usize) -> Vec<Neighbour> {
    let frames = gap.frames.start.saturating_sub(1)..gap.frames.end + 1;
    let is_there = |of: &&Neighbour| trial.is_seen_throughout(of.marker, frames.clone());
    near.iter().filter(is_there).take(most).copied().collect()
}

/// Frames in which a marker and all its donors are seen, those nearest to the gap first, at most [`LEARNED`].
fn learned(trial: &Trial, gap: &Gap, donors: &[Neighbour]) -> Vec<usize> {
    let is_whole = |frame: &usize| {
        trial.is_seen(gap.marker, *frame)
            && donors.iter().all(|of| trial.is_seen(of.marker, *frame))
    };
    let mut found: Vec<usize> = Vec::new();
    let (before, after) = (gap.frames.start, gap.frames.end);
    for step in 0..trial.frames() {
        found.extend(before.checked_sub(step + 1).filter(is_whole));
        found.extend(Some(after + step).filter(is_whole));
        if found.len() >= LEARNED {
            break;
        }
    }
    found.truncate(LEARNED);
    found
}
