//! Where a series may be cut, and where cutting pays.

use super::refine::half_sine;
use crate::error::Error;
use crate::motion::low_pass;

/// A touch: speed falls below this part of the smaller peak beside it.
const TOUCH: f64 = 0.15;
/// Speed below this part of the greatest is rest, in a series without noise.
const AT_REST: f64 = 1e-7;
/// What moves faster than this is noise to candidates, Hz: gross human motion ends near 6 Hz
/// (Winter), sharp turns in time need a little more.
const CANDIDATES_BELOW_HZ: f64 = 10.0;
/// Of a series with noise that matters, what is faster than this is left out, Hz.
const ROUGH_BELOW_HZ: f64 = 6.0;
/// Candidates between two others that are far apart: at most this many, this far apart, s.
const BETWEEN: usize = 3;
const BETWEEN_S: f64 = 0.08;
/// An actionlet spans at most this many candidates.
const REACH: usize = 24;
/// Samples an actionlet is judged by.
const JUDGED: usize = 32;
/// Peak places tried.
const PEAKS: [f64; 5] = [0.2, 0.35, 0.5, 0.65, 0.8];

/// Seam times of a series without noise: zero crossings and touches of its velocity, begins and
/// ends of its rests, and both ends, s. None if it is nowhere near being made of actionlets: more
/// seams than every fourth sample.
pub fn instants_of_rest(samples_rad: &[f64], rate_hz: f64) -> Option<Vec<f64>> {
    let step: Vec<f64> = samples_rad.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let greatest = step.iter().fold(0.0, |a: f64, b| a.max(b.abs()));
    let resting = |index: usize| step[index].abs() <= AT_REST * greatest;
    // Places are in samples; step i lies at i + 1/2.
    let mut places = vec![0.0];
    for index in 1..step.len() {
        let (before, after) = (step[index - 1], step[index]);
        if resting(index - 1) != resting(index) {
            places.push(index as f64);
        } else if before * after < 0.0 {
            places.push(index as f64 - 0.5 + before / (before - after));
        } else if index + 1 < step.len() && is_touch(&step, index) && !resting(index) {
            // The parabola through three speeds has its vertex here.
            let (a, b, c) = (before.abs(), after.abs(), step[index + 1].abs());
            let bend = a - 2.0 * b + c;
            let off = if bend > 0.0 { (0.5 * (a - c) / bend).clamp(-0.5, 0.5) } else { 0.0 };
            places.push(index as f64 + 0.5 + off);
        }
    }
    places.push((samples_rad.len() - 1) as f64);
    // The run-up to a rest is so slow that it seems to end early or late: keep seams apart.
    places.dedup_by(|later, earlier| *later - *earlier < 2.0);
    let last = places.len() - 1;
    if places[last] != (samples_rad.len() - 1) as f64 {
        places[last] = (samples_rad.len() - 1) as f64;
    }
    (places.len() >= 2 && places.len() * 4 <= samples_rad.len())
        .then(|| places.into_iter().map(|place| place / rate_hz).collect())
}

/// Whether speed has a minimum at `index` far below the peaks on either side.
fn is_touch(step: &[f64], index: usize) -> bool {
    let speed = |i: usize| step[i].abs();
    let here = speed(index);
    if !(here < speed(index - 1) && here <= speed(index + 1)) {
        return false;
    }
    let before = (0..index).rev().take_while(|i| speed(*i) >= speed(*i + 1));
    let peak_before = before.map(speed).fold(0.0, f64::max);
    let after = (index + 1..step.len()).take_while(|i| speed(*i) >= speed(*i - 1));
    let peak_after = after.map(speed).fold(0.0, f64::max);
    here < TOUCH * peak_before.min(peak_after)
}

/// The motion below the noise of a series, as far as cuts are looked for in it.
pub fn smoothed(samples_rad: &[f64], rate_hz: f64) -> Result<Vec<f64>, Error> {
    if rate_hz > 3.0 * ROUGH_BELOW_HZ {
        low_pass(samples_rad, rate_hz, ROUGH_BELOW_HZ)
    } else {
        Ok(samples_rad.to_vec())
    }
}

/// Sample indices at which it may pay to cut: extremes and slow places of the smoothed series, some
/// between them where they are far apart, and both ends.
pub fn candidates(samples_rad: &[f64], rate_hz: f64) -> Result<Vec<usize>, Error> {
    let smooth = if rate_hz > 4.0 * CANDIDATES_BELOW_HZ {
        low_pass(samples_rad, rate_hz, CANDIDATES_BELOW_HZ)?
    } else {
        samples_rad.to_vec()
    };
    let step: Vec<f64> = smooth.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let last = samples_rad.len() - 1;
    let mut marked = vec![0];
    for index in 1..step.len() {
        let turns = step[index - 1] * step[index] <= 0.0;
        let slow = index + 1 < step.len()
            && step[index].abs() < step[index - 1].abs()
            && step[index].abs() <= step[index + 1].abs();
        if turns || slow {
            marked.push(index);
        }
    }
    marked.push(last);
    let apart = ((0.5 * BETWEEN_S * rate_hz) as usize).max(2);
    let mut found: Vec<usize> = vec![0];
    for index in marked {
        let before = found[found.len() - 1];
        if index - before < apart {
            continue;
        }
        let gap_s = (index - before) as f64 / rate_hz;
        let between = ((gap_s / BETWEEN_S) as usize).saturating_sub(1).min(BETWEEN);
        for part in 1..=between {
            found.push(before + (index - before) * part / (between + 1));
        }
        found.push(index);
    }
    let end = found.len() - 1;
    if found[end] != last {
        // The last candidate gives way to the end if it is too near.
        if end > 0 && last - found[end] < apart { found[end] = last } else { found.push(last) }
    }
    Ok(found)
}

/// Squared errors of the best actionlet between any two near candidates.
pub struct Costs {
    candidates: Vec<usize>,
    /// By later candidate: the error from each earlier one in reach, nearest first.
    before: Vec<Vec<f64>>,
}

impl Costs {
    pub fn between(samples_rad: &[f64], candidates: &[usize]) -> Self {
        let tables = PEAKS.map(|t| {
            core::array::from_fn::<f64, JUDGED, _>(|i| {
                half_sine((i as f64 + 0.5) / JUDGED as f64, t).0
            })
        });
        let before = candidates.iter().enumerate().map(|(at, to)| {
            let reach = at.saturating_sub(REACH)..at;
            reach.rev().map(|from| cost(samples_rad, &tables, candidates[from], *to)).collect()
        });
        Self { candidates: candidates.to_vec(), before: before.collect() }
    }

    /// The cut with the least error plus `price` per actionlet, as sample indices.
    pub fn cheapest(&self, price: f64) -> Vec<usize> {
        let count = self.candidates.len();
        let mut least = vec![(0.0, 0); count];
        for at in 1..count {
            let ways = self.before[at].iter().enumerate().map(|(back, error)| {
                let from = at - 1 - back;
                (least[from].0 + error + price, from)
            });
            least[at] = ways.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((0.0, at - 1));
        }
        let mut cut = vec![self.candidates[count - 1]];
        let mut at = count - 1;
        while at > 0 {
            at = least[at].1;
            cut.push(self.candidates[at]);
        }
        cut.reverse();
        cut
    }
}

/// Squared error of the best actionlet from one sample to another.
fn cost(samples_rad: &[f64], tables: &[[f64; JUDGED]; PEAKS.len()], from: usize, to: usize) -> f64 {
    let (a, b) = (samples_rad[from], samples_rad[to]);
    let length = to - from;
    let mut given = [0.0; JUDGED];
    for (i, value) in given.iter_mut().enumerate() {
        let place = from as f64 + (i as f64 + 0.5) / JUDGED as f64 * length as f64;
        let index = (place as usize).min(samples_rad.len() - 2);
        let part = place - index as f64;
        *value = samples_rad[index] * (1.0 - part) + samples_rad[index + 1] * part;
    }
    let scale = length as f64 / JUDGED as f64;
    let error = |table: &[f64; JUDGED]| -> f64 {
        let misses = table.iter().zip(&given).map(|(p, value)| a + (b - a) * p - value);
        scale * misses.map(|miss| miss * miss).sum::<f64>()
    };
    tables.iter().map(error).fold(f64::MAX, f64::min)
}
