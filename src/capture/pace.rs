//! When samples of a sensor were taken that has no clock, from their number and when they arrived.
//!
//! Such a sensor samples evenly, by a crystal or worse, and at a rate that somebody may have set otherwise than its
//! profile says. An adapter collects bytes for up to 16 ms, a busy host reads what came meanwhile all at once: what arrives together was
//! not taken together. So the samples are laid out evenly, by the nominal period until what arrives contradicts it, and then by the
//! running one: the slope through the quickest samples of the last ten seconds (the median of the slopes between any two of them: Theil
//! 1950, Sen 1968), which a stall of the host does not move.
//!
//! If the sensor counts its samples, what is missing is known. If it does not, a silence is either the host's, and then all that was
//! sent comes at once when it wakes, or the sensor's, and then it does not: what has not come by a quarter of a second after the silence
//! is lost, and how much that is, is an estimate.

use crate::time::{Duration, Instant};
use std::collections::VecDeque;

/// Length of a block, of which the quickest sample is kept, s.
const BLOCK_S: f64 = 0.5;
/// Blocks that the slope goes through.
const BLOCKS: usize = 20;
/// Fewer say nothing.
const BLOCKS_FOR_SLOPE: usize = 3;
/// So far off a quickest sample may be: an adapter's 16 ms and a little. What is nearer to the nominal period than that over the blocks
/// that there are does not contradict it.
const OFF_S: f64 = 0.02;
/// No sensor's rate is this many times off its profile's: a WT901 is shipped at 10 Hz and can be set to 200.
const MOST_FACTOR: f64 = 50.0;
/// A period that differs by more than this part is another one, and not the same better known.
const ANOTHER: f64 = 0.02;
/// A silence of so many periods, and this time more, may be a loss.
const SILENT_PERIODS: f64 = 5.0;
const SILENT_S: f64 = 0.1;
/// By so long after a silence all has come that will.
const CATCH_UP: Duration = Duration::from_millis(250);
/// A host that stands still for longer does not keep what is sent: it is the sensor's silence at once.
const MOST_STALL_S: f64 = 5.0;
/// The least lateness of so long is no lateness, s: twice this time is looked at.
const LEVEL_S: f64 = 1.0;

/// Where a sample is laid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Laid {
    /// When it was taken, less what is the same for all; never after its arrival.
    pub(super) taken: Instant,
    /// Time since the sample before, s.
    pub(super) step_s: f64,
    /// How many samples were probably lost before it, where only silence tells.
    pub(super) estimated: u64,
}

/// The quickest sample of a block: how many samples came before it, and its arrival, s.
#[derive(Clone, Copy, Debug)]
struct Quickest {
    count: f64,
    arrival_s: f64,
}

/// A silence that was either the host's or the sensor's: nobody knows yet.
#[derive(Clone, Copy, Debug)]
struct Silence {
    /// The end of the last one.
    ended: Instant,
    /// Least time since then by which samples are later than before, s.
    least_s: f64,
}

/// Lays samples out in time.
#[derive(Clone, Debug)]
pub(super) struct Pace {
    nominal_s: f64,
    period_s: f64,
    zero: Option<Instant>,
    last_arrival: Instant,
    last_taken: Instant,
    /// Samples since the first, and the time they were laid out over, s.
    count: f64,
    laid_s: f64,
    blocks: VecDeque<Quickest>,
    /// Beginning and quickest sample of the open block.
    open: Option<(f64, Quickest)>,
    /// `arrival - laid`: beginning of this stretch, least of the one before and of this one, s.
    level: (f64, f64, f64),
    silence: Option<Silence>,
}

impl Pace {
    /// For samples that should come every `nominal_s`.
    pub(super) fn new(nominal_s: f64) -> Self {
        let usable = nominal_s.is_finite() && nominal_s > 0.0;
        let nominal_s = if usable { nominal_s } else { 0.01 };
        Self {
            nominal_s,
            period_s: nominal_s,
            zero: None,
            last_arrival: Instant::ZERO,
            last_taken: Instant::ZERO,
            count: 0.0,
            laid_s: 0.0,
            blocks: VecDeque::new(),
            open: None,
            level: (0.0, f64::INFINITY, f64::INFINITY),
            silence: None,
        }
    }

    /// The running period, s.
    pub(super) const fn period_s(&self) -> f64 {
        self.period_s
    }

    /// How much earlier a sample so many after the last would arrive than any is expected to, s.
    pub(super) fn early_s(&self, samples: f64, arrival: Instant) -> f64 {
        let Some(zero) = self.zero else { return 0.0 };
        let laid_s = self.laid_s + samples * self.period_s;
        laid_s + self.level.1.min(self.level.2) - arrival.seconds_since(zero)
    }

    /// Takes a sample that is `samples` after the one before. Where that is not counted it is 1, and whoever calls says so.
    pub(super) fn take(&mut self, samples: f64, is_counted: bool, arrival: Instant) -> Laid {
        let Some(zero) = self.zero else {
            self.begin(arrival);
            return Laid { taken: self.last_taken, step_s: 0.0, estimated: 0 };
        };
        let arrival_s = arrival.seconds_since(zero);
        let silent_s = arrival.seconds_since(self.last_arrival);
        self.last_arrival = arrival;
        let mut step_s = samples * self.period_s;
        let mut estimated = 0;
        if !is_counted {
            let lost_s = self.lost_s(silent_s, arrival_s, arrival, step_s);
            let lost = (lost_s / self.period_s).round().clamp(0.0, 1e9);
            if lost >= 1.0 {
                (estimated, step_s) = (lost as u64, step_s + lost_s);
                self.count += lost;
            }
        }
        self.count += samples;
        self.laid_s += step_s;
        let late_s = arrival_s - self.laid_s;
        if estimated > 0 {
            // What is late now is on time from here on.
            self.level = (arrival_s, late_s, late_s);
        }
        if self.keep(arrival_s) {
            // What was laid out by another period says nothing of what is on time.
            self.level = (arrival_s, late_s, late_s);
        }
        let level_s = self.level_s(arrival_s, late_s);
        let late = Duration::from_secs_f64((late_s - level_s).clamp(0.0, MOST_STALL_S));
        let late_ns = u64::try_from(late.as_nanos()).unwrap_or(u64::MAX);
        let taken = Instant::from_nanos(arrival.as_nanos().saturating_sub(late_ns));
        self.last_taken = taken.max(self.last_taken).min(arrival);
        Laid { taken: self.last_taken, step_s, estimated }
    }

    /// The device began again: the period is what it was, time and count are not.
    pub(super) fn restart(&mut self) {
        let fresh = Self::new(self.nominal_s);
        *self = Self { period_s: self.period_s, last_taken: self.last_taken, ..fresh };
    }

    fn begin(&mut self, arrival: Instant) {
        (self.zero, self.last_arrival) = (Some(arrival), arrival);
        self.last_taken = arrival.max(self.last_taken);
        self.level = (0.0, 0.0, 0.0);
        self.keep(0.0);
    }

    /// Time that was certainly not the host's silence, told at the sample that shows it, s.
    fn lost_s(&mut self, silent_s: f64, arrival_s: f64, arrival: Instant, step_s: f64) -> f64 {
        let later_s = arrival_s - self.laid_s - step_s - self.level.1.min(self.level.2);
        if silent_s > MOST_STALL_S {
            self.silence = None;
            return later_s.max(0.0);
        }
        let bound_s = SILENT_PERIODS * self.period_s + SILENT_S;
        if silent_s > bound_s {
            self.silence = Some(Silence { ended: arrival, least_s: f64::INFINITY });
        }
        let Some(silence) = &mut self.silence else { return 0.0 };
        silence.least_s = silence.least_s.min(later_s);
        let (least_s, ended) = (silence.least_s, silence.ended);
        if least_s <= SILENT_S / 2.0 {
            self.silence = None;
            return 0.0;
        }
        if arrival.since(ended) < CATCH_UP {
            return 0.0;
        }
        self.silence = None;
        least_s
    }

    /// How late samples are that are not late, s.
    fn level_s(&mut self, arrival_s: f64, late_s: f64) -> f64 {
        let (began_s, before_s, now_s) = self.level;
        // As long as nobody knows whether a silence was a loss, late samples say nothing of what is on time.
        if arrival_s - began_s >= LEVEL_S && self.silence.is_none() {
            self.level = (arrival_s, now_s, late_s);
        } else {
            self.level = (began_s, before_s, now_s.min(late_s));
        }
        self.level.1.min(self.level.2)
    }

    /// Keeps the quickest samples, and learns from them. True if the period is another one now.
    fn keep(&mut self, arrival_s: f64) -> bool {
        let sample = Quickest { count: self.count, arrival_s };
        let Some((began_s, quickest)) = &mut self.open else {
            self.open = Some((arrival_s, sample));
            return false;
        };
        if arrival_s - *began_s < BLOCK_S {
            let level_s = |of: &Quickest| of.arrival_s - of.count * self.period_s;
            if level_s(&sample) < level_s(quickest) {
                *quickest = sample;
            }
            return false;
        }
        let closed = *quickest;
        self.open = Some((arrival_s, sample));
        if self.blocks.len() == BLOCKS {
            self.blocks.pop_front();
        }
        self.blocks.push_back(closed);
        let before_s = self.period_s;
        self.learn();
        (self.period_s / before_s - 1.0).abs() > ANOTHER
    }

    fn learn(&mut self) {
        let (Some(first), Some(last)) = (self.blocks.front(), self.blocks.back()) else { return };
        let span_s = last.arrival_s - first.arrival_s;
        if self.blocks.len() < BLOCKS_FOR_SLOPE || !(span_s > 0.0) {
            return;
        }
        let pairs = self.blocks.iter().enumerate().flat_map(|(at, a)| {
            let later = self.blocks.iter().skip(at + 1);
            later.map(move |b| (b.arrival_s - a.arrival_s) / (b.count - a.count).max(1.0))
        });
        let mut slopes: Vec<f64> = pairs.collect();
        let middle = slopes.len() / 2;
        let period_s = *slopes.select_nth_unstable_by(middle, f64::total_cmp).1;
        let off = (period_s / self.nominal_s - 1.0).abs();
        let bounds = self.nominal_s / MOST_FACTOR..=self.nominal_s * MOST_FACTOR;
        self.period_s = match off * span_s <= OFF_S {
            true => self.nominal_s,
            false if bounds.contains(&period_s) => period_s,
            false => self.period_s,
        };
    }
}

#[cfg(test)]
mod tests;
