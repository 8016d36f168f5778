//! Which markers go with which: those whose distance hardly changes.

use super::trial::Trial;
use std::ops::Range;

/// Distances that are looked at for all markers together, about.
const MOST_LOOKS: usize = 1 << 26;
/// Frames that are looked at, at least and at most.
const FEWEST_FRAMES: usize = 8;
const MOST_FRAMES: usize = 240;
/// Frames in which both must be seen.
const FEWEST_COMMON: usize = 6;

/// Another marker as one of them sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Neighbour {
    /// Its index.
    pub marker: usize,
    /// The usual distance, m: the median.
    pub distance_m: f64,
    /// How much the distance varies, m.
    pub spread_m: f64,
}

/// What is taken for the usual distance of two markers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Usual {
    /// The median, and the 10th to 90th percentile over 2.56, which is the standard deviation of what varies normally.
    Median,
    /// The middle and the width of the shortest range that holds half of all (the shorth of Andrews et al. 1972), the
    /// width over 1.35: what is wrong in less than half of a trial hardly changes it.
    Shorth,
}

/// The markers whose distance to one of them varies least, at most `most` of them, the most constant first. Looked
/// at in frames all over the trial; those hardly ever seen together are left out.
#[must_use]
pub fn neighbours(trial: &Trial, marker: usize, most: usize, usual: Usual) -> Vec<Neighbour> {
    neighbours_in(trial, marker, most, usual, 0..trial.frames())
}

/// The same by some frames alone.
#[must_use]
pub fn neighbours_in(
    trial: &Trial,
    marker: usize,
    most: usize,
    usual: Usual,
    frames: Range<usize>,
) -> Vec<Neighbour> {
    let seen: Vec<usize> = frames.filter(|at| trial.is_seen(marker, *at)).collect();
    let pairs = trial.markers().saturating_mul(trial.markers()).max(1);
    let looks = (MOST_LOOKS / pairs).clamp(FEWEST_FRAMES, MOST_FRAMES);
    let step = seen.len().div_ceil(looks).max(1);
    let mut frames: Vec<usize> = seen.into_iter().step_by(step).collect();
    frames.truncate(looks);
    let mut found = Vec::new();
    let mut distances = Vec::with_capacity(frames.len());
    for other in (0..trial.markers()).filter(|other| *other != marker) {
        distances.clear();
        distances.extend(frames.iter().filter_map(|frame| {
            Some(trial.at(marker, *frame)?.distance(trial.at(other, *frame)?))
        }));
        if distances.len() < FEWEST_COMMON.max(frames.len() / 4) {
            continue;
        }
        distances.sort_by(f64::total_cmp);
        let (distance_m, spread_m) = match usual {
            Usual::Median => {
                let share = |share: f64| {
                    let at = (share * (distances.len() - 1) as f64).round() as usize;
                    distances.get(at).copied().unwrap_or(f64::INFINITY)
                };
                (share(0.5), (share(0.9) - share(0.1)) / 2.56)
            }
            Usual::Shorth => {
                let half = distances.len() / 2;
                let ranges = distances.iter().zip(distances.iter().skip(half));
                let width = |of: &(&f64, &f64)| of.1 - of.0;
                let Some(shortest) = ranges.min_by(|a, b| width(a).total_cmp(&width(b))) else {
                    continue;
                };
                ((shortest.0 + shortest.1) / 2.0, width(&shortest) / 1.35)
            }
        };
        found.push(Neighbour { marker: other, distance_m, spread_m });
    }
    let order = |a: &Neighbour, b: &Neighbour| {
        a.spread_m.total_cmp(&b.spread_m).then(a.marker.cmp(&b.marker))
    };
    if found.len() > most {
        found.select_nth_unstable_by(most, order);
        found.truncate(most);
    }
    found.sort_by(order);
    found
}
