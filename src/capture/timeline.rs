//! Which sample is this, what is missing before it, and when was it taken.
//!
//! A sensor tells with a packet counter, with a clock, with both, or with nothing. A counter that
//! goes round is unwrapped; what does not fit is told as a gap, a repetition, a sample out of order
//! or a reset, and counted, never filled in. Where a clock is all there is, what is missing is counted by the device's own
//! rhythm.
//!
//! A jump of what the device tells that its arrival does not share is doubted: such a sample is told and not used, and the next
//! one says what it was. If it goes on from before, one time was misread; if it goes on from the jump, samples were lost (up
//! to a second, forward), or the device began again.

use super::clock_fit::{ClockFit, Quality};
use super::pace::Pace;
use super::rhythm::{Missing, Rhythm, Stride};
use crate::time::{Duration, Instant};
use serde::Serialize;

/// A step back by at most this many samples is one out of order; by more, the device was reset.
const MOST_REORDERED: u64 = 16;
/// A jump that arrival does not share is longer than so many periods, and than this time.
const JUMP_PERIODS: f64 = 3.0;
const JUMP_S: f64 = 0.05;
/// Part by which the period of a sensor without a clock may be off while it is learnt.
const VAGUE: f64 = 0.25;
/// One that stays is a loss up to this, and beyond a device that began again, s.
const MOST_LOST_S: f64 = 1.0;
/// After so many samples in a row that fit nowhere it is begun anew.
const MOST_DOUBTED: u64 = 4;
/// More missing samples than a minute of the fastest sensor are no gap but a reset.
const MOST_MISSING: u64 = 60_000;

/// How a sample stands to the one before.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Order {
    /// The next, or the first.
    Next,
    /// Some samples before it are missing.
    Gap,
    /// The one before once more.
    Duplicate,
    /// An older one.
    Late,
    /// The device began again.
    Reset,
    /// Its time or number jumps and its arrival does not: it is not used, and the next one tells what it was.
    Doubted,
}

/// When and which.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stamp {
    /// When it was read, host's monotonic clock.
    pub arrival: Instant,
    /// When it was taken, as well as that can be told: the same clock.
    pub taken: Instant,
    /// Number of the sample, missing ones counted, from zero.
    pub number: u64,
    /// Time since the sample before, s; zero for the first, after a reset, and for a duplicate or
    /// late one.
    pub step_s: f64,
    /// Samples missing just before this one, or before those of which it was not known yet.
    pub missed: u64,
    /// Samples probably missing just before this one, of a sensor that tells neither number nor time.
    pub estimated: u64,
    /// How it stands to the one before.
    pub order: Order,
}

/// What a timeline has seen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(into = "Told")]
pub struct Counts {
    /// Samples, duplicates and late ones included.
    pub samples: u64,
    /// Gaps.
    pub gaps: u64,
    /// Samples missing in them, as the sensor's own counter or clock tells.
    pub missed: u64,
    /// Of a sensor that tells neither: samples that are probably missing. `missed` is then unknown, and told as null.
    pub estimated: Option<u64>,
    /// Samples sent twice.
    pub duplicates: u64,
    /// Samples out of order.
    pub late: u64,
    /// Resets of the device.
    pub resets: u64,
    /// Samples with a time or number of which the next one showed that it was misread.
    pub misread: u64,
}

/// Counts as they are told.
#[derive(Serialize)]
struct Told {
    samples: u64,
    gaps: u64,
    missed: Option<u64>,
    missed_estimated: Option<u64>,
    duplicates: u64,
    late: u64,
    resets: u64,
    misread: u64,
}

impl From<Counts> for Told {
    fn from(counts: Counts) -> Self {
        let Counts { samples, gaps, missed, estimated, duplicates, late, resets, misread } = counts;
        let missed = estimated.is_none().then_some(missed);
        let missed_estimated = estimated;
        Self { samples, gaps, missed, missed_estimated, duplicates, late, resets, misread }
    }
}

/// What a sensor tells of order and time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Telling {
    /// Width of the packet counter, if it has one.
    pub counter_bits: Option<u32>,
    /// Width and tick length in seconds of the clock, if it has one.
    pub clock: Option<(u32, f64)>,
    /// Time between two samples, s.
    pub period_s: f64,
    /// The part of the way that is always the same.
    pub latency: Duration,
}

/// Unwraps, counts and stamps the samples of one sensor.
#[derive(Clone, Debug)]
pub struct Timeline {
    telling: Telling,
    layout: Layout,
    last: Option<Last>,
    doubted: Option<Last>,
    /// Samples in a row that fit nowhere.
    doubts: u64,
    /// Samples out of order since the last that was used: they may have been the next, misread.
    behind: u64,
    counts: Counts,
}

/// Where times come from.
#[derive(Clone, Debug)]
enum Layout {
    /// The device's clock, and how often it samples by it.
    Clock(ClockFit, Rhythm),
    /// The number of samples.
    Pace(Pace),
}

#[derive(Clone, Copy, Debug)]
struct Last {
    counter: Option<u64>,
    ticks: Option<u64>,
    /// Unwrapped.
    device_s: f64,
    number: u64,
    stamp: Stamp,
}

/// A sample as it comes.
#[derive(Clone, Copy, Debug)]
struct Raw {
    counter: Option<u64>,
    ticks: Option<u64>,
    arrival: Instant,
}

/// How a sample stands to another.
#[derive(Clone, Copy, Debug)]
struct Step {
    /// Samples since that one: 1 is the next.
    samples: i64,
    /// Time since that one as the device tells it, s.
    device_s: f64,
}

impl Timeline {
    /// For a sensor that tells so much.
    #[must_use]
    pub fn new(telling: Telling) -> Self {
        let layout = match telling.clock {
            Some((_, tick_s)) => {
                Layout::Clock(ClockFit::default(), Rhythm::new(telling.period_s, tick_s))
            }
            None => Layout::Pace(Pace::new(telling.period_s)),
        };
        let silent = telling.counter_bits.is_none() && telling.clock.is_none();
        let counts = Counts { estimated: silent.then_some(0), ..Counts::default() };
        Self { telling, layout, last: None, doubted: None, doubts: 0, behind: 0, counts }
    }

    /// What was seen so far.
    #[must_use]
    pub fn counts(&self) -> Counts {
        let pending = match &self.layout {
            Layout::Clock(_, rhythm) if self.telling.counter_bits.is_none() => rhythm.pending(),
            _ => Missing::default(),
        };
        let missed = self.counts.missed + pending.samples;
        Counts { missed, gaps: self.counts.gaps + pending.gaps, ..self.counts }
    }

    /// How well the device's clock is known. Without one there is nothing to know.
    #[must_use]
    pub fn quality(&self) -> Quality {
        match &self.layout {
            Layout::Clock(fit, _) => fit.quality(),
            Layout::Pace(_) => Quality::default(),
        }
    }

    /// Time from sample to sample, s: what its profile says until another is found.
    #[must_use]
    pub const fn period_s(&self) -> f64 {
        match &self.layout {
            Layout::Clock(_, rhythm) => rhythm.period_s(),
            Layout::Pace(pace) => pace.period_s(),
        }
    }

    /// Samples per second as the device's own clock tells, once its samples have agreed on that. Without a clock nobody knows.
    #[must_use]
    pub fn rate_hz(&self) -> Option<f64> {
        match &self.layout {
            Layout::Clock(_, rhythm) => rhythm.rate_hz(),
            Layout::Pace(_) => None,
        }
    }

    /// Takes a sample with the raw `counter` and clock `ticks` it was sent with.
    pub fn take(&mut self, counter: Option<u64>, ticks: Option<u64>, arrival: Instant) -> Stamp {
        let raw = Raw {
            counter: counter.filter(|_| self.telling.counter_bits.is_some()),
            ticks: ticks.filter(|_| self.telling.clock.is_some()),
            arrival,
        };
        self.counts.samples += 1;
        let Some(last) = self.last else {
            return self.accept(raw, self.ticks_s(ticks), 0, Missing::default(), Order::Next);
        };
        let step = self.step(&raw, &last);
        if self.fits(step, &raw, &last) {
            return self.follow(raw, step, &last, false);
        }
        let Some(doubted) = self.doubted.take() else { return self.doubt(raw, &last, step) };
        // Against the one that was doubted: does it go on from there?
        let onward = self.step(&raw, &doubted);
        let goes_on = onward.samples > 0 && !self.jumps(onward, &raw, &doubted);
        if !goes_on && self.doubts < MOST_DOUBTED {
            self.counts.misread += 1;
            return self.doubt(raw, &last, step);
        }
        let is_forward = step.samples > 0 && step.device_s > 0.0;
        let lost = is_forward && step.device_s <= MOST_LOST_S && goes_on;
        match lost {
            true => self.follow(raw, step, &last, true),
            false => self.reset(raw, &doubted),
        }
    }

    fn ticks_s(&self, ticks: Option<u64>) -> f64 {
        ticks.zip(self.telling.clock).map_or(0.0, |(ticks, (_, s))| ticks as f64 * s)
    }

    /// How a sample stands to an earlier one, as the device tells it.
    fn step(&self, raw: &Raw, last: &Last) -> Step {
        let by_counter = self.telling.counter_bits.zip(raw.counter).zip(last.counter);
        let by_clock = self.telling.clock.zip(raw.ticks).zip(last.ticks);
        let counter_step = by_counter.map(|((bits, now), before)| step(now, before, bits));
        let clock_step_s =
            by_clock.map(|(((bits, tick_s), now), before)| step(now, before, bits) as f64 * tick_s);
        let period_s = self.period_s();
        let samples = match (counter_step, clock_step_s) {
            (Some(samples), _) => samples,
            (None, Some(0.0)) => 0,
            (None, Some(step_s)) => match (step_s / period_s).round() {
                samples if samples >= 1.0 => samples as i64,
                _ if step_s > 0.0 => 1,
                samples => (samples as i64).min(-1),
            },
            (None, None) => 1,
        };
        Step { samples, device_s: clock_step_s.unwrap_or(samples as f64 * period_s) }
    }

    /// True if a sample can stand where it says: next, after a gap, again, or a little too late.
    fn fits(&self, step: Step, raw: &Raw, last: &Last) -> bool {
        match step.samples {
            0 => true,
            // A clock that runs back while the counter goes on has been set, or was misread.
            1.. if step.samples as u64 <= MOST_MISSING && step.device_s >= 0.0 => {
                !(self.jumps(step, raw, last) && self.is_early(step, raw, last))
            }
            ..0 => step.samples.unsigned_abs() <= MOST_REORDERED,
            _ => false,
        }
    }

    /// True if the device tells of more time than has passed here.
    fn jumps(&self, step: Step, raw: &Raw, last: &Last) -> bool {
        let passed_s = raw.arrival.seconds_since(last.stamp.arrival);
        let told = raw.counter.is_some() || raw.ticks.is_some();
        // Of one without a clock the period may be known badly.
        let vague_s = if raw.ticks.is_some() { 0.0 } else { VAGUE * passed_s };
        told && !(step.device_s - passed_s <= self.tolerance_s() + vague_s)
    }

    /// True if it would have arrived before it was taken: what was late before may catch up.
    fn is_early(&self, step: Step, raw: &Raw, last: &Last) -> bool {
        let early_s = match &self.layout {
            Layout::Clock(fit, _) => fit.early_s(last.device_s + step.device_s, raw.arrival),
            Layout::Pace(pace) => pace.early_s(step.samples as f64, raw.arrival),
        };
        early_s > self.tolerance_s()
    }

    fn tolerance_s(&self) -> f64 {
        (JUMP_PERIODS * self.period_s()).max(JUMP_S)
    }

    /// Takes a sample that stands where it says. `goes_on` from one that was doubted, which was right then.
    fn follow(&mut self, raw: Raw, step: Step, last: &Last, goes_on: bool) -> Stamp {
        match step.samples {
            0 => self.refuse(Order::Duplicate, last, raw.arrival),
            1.. => {
                let device_s = last.device_s + step.device_s;
                let between = step.samples as u64 - 1;
                // What came in between and was not used is not missing.
                let came = self.doubts.min(between);
                self.counts.misread += u64::from(self.doubted.take().is_some() && !goes_on);
                let behind = self.behind.min(between - came);
                self.counts.misread += behind;
                self.counts.late -= behind;
                let missed = self.missing(&raw, step, last, came + behind, between);
                let order = if missed.samples == 0 { Order::Next } else { Order::Gap };
                let number = last.number + 1 + came + missed.samples;
                self.accept(raw, device_s, number, missed, order)
            }
            ..0 => {
                self.behind += 1;
                self.refuse(Order::Late, last, raw.arrival)
            }
        }
    }

    /// What is missing in a step forward with so many samples in between, of which some came: by the counter, or by the rhythm.
    fn missing(&mut self, raw: &Raw, step: Step, last: &Last, came: u64, between: u64) -> Missing {
        let is_counted = raw.counter.and(last.counter).is_some();
        let counted = is_counted.then_some(between + 1);
        let is_timed = raw.ticks.and(last.ticks).is_some();
        let stride = Stride { step_s: step.device_s, counted, came };
        match &mut self.layout {
            Layout::Clock(_, rhythm) if is_timed => {
                let missing = rhythm.take(stride);
                if !is_counted {
                    return missing;
                }
            }
            _ => {}
        }
        let samples = between - came;
        Missing { samples, gaps: u64::from(samples > 0) }
    }

    /// Keeps a sample that fits nowhere until the next one says what it was.
    fn doubt(&mut self, raw: Raw, last: &Last, step: Step) -> Stamp {
        self.doubts += 1;
        let number = last.number + self.doubts;
        let order = Order::Doubted;
        let (missed, estimated, step_s) = (0, 0, 0.0);
        let stamp =
            Stamp { arrival: raw.arrival, number, step_s, missed, estimated, order, ..last.stamp };
        let device_s = last.device_s + step.device_s;
        let Raw { counter, ticks, .. } = raw;
        self.doubted = Some(Last { counter, ticks, device_s, number, stamp });
        stamp
    }

    fn reset(&mut self, raw: Raw, doubted: &Last) -> Stamp {
        self.counts.resets += 1;
        let untold = match &mut self.layout {
            Layout::Clock(fit, rhythm) => {
                fit.restart();
                rhythm.restart()
            }
            Layout::Pace(pace) => {
                pace.restart();
                Missing::default()
            }
        };
        let is_counted = self.telling.counter_bits.is_some();
        let missed = if is_counted { Missing::default() } else { untold };
        let number = doubted.number + 1 + missed.samples;
        self.accept(raw, self.ticks_s(raw.ticks), number, missed, Order::Reset)
    }

    fn accept(
        &mut self,
        raw: Raw,
        device_s: f64,
        number: u64,
        missed: Missing,
        order: Order,
    ) -> Stamp {
        let arrival = raw.arrival;
        let before = self.last.filter(|_| order != Order::Reset);
        let (fitted, step_s, estimated) = match &mut self.layout {
            Layout::Clock(fit, _) => {
                let step_s = before.map_or(0.0, |before| device_s - before.device_s);
                (fit.take(device_s, arrival), step_s, 0)
            }
            Layout::Pace(pace) => {
                let samples = before.map_or(0, |before| number.saturating_sub(before.number));
                let is_counted = self.telling.counter_bits.is_some();
                let laid = pace.take(samples as f64, is_counted, arrival);
                (laid.taken, laid.step_s, laid.estimated)
            }
        };
        self.counts.gaps += missed.gaps + u64::from(estimated > 0);
        self.counts.missed += missed.samples;
        self.counts.estimated = self.counts.estimated.map(|all| all.saturating_add(estimated));
        let latency_ns = u64::try_from(self.telling.latency.as_nanos()).unwrap_or(0);
        let taken = Instant::from_nanos(fitted.as_nanos().saturating_sub(latency_ns));
        let order = if estimated > 0 { Order::Gap } else { order };
        let missed = missed.samples;
        let stamp = Stamp { arrival, taken, number, step_s, missed, estimated, order };
        let Raw { counter, ticks, .. } = raw;
        self.last = Some(Last { counter, ticks, device_s, number, stamp });
        (self.doubted, self.doubts, self.behind) = (None, 0, 0);
        stamp
    }

    /// A sample that is no step forward: stamped with the one before, which it does not move.
    fn refuse(&mut self, order: Order, last: &Last, arrival: Instant) -> Stamp {
        match order {
            Order::Duplicate => self.counts.duplicates += 1,
            _ => self.counts.late += 1,
        }
        Stamp { arrival, step_s: 0.0, missed: 0, estimated: 0, order, ..last.stamp }
    }
}

/// From `before` to `now` on a counter of so many bits, the short way round.
fn step(now: u64, before: u64, bits: u32) -> i64 {
    let unused = 64_u32.saturating_sub(bits).min(63);
    // Shifted to the top, the sign of the difference is that of the short way.
    ((now.wrapping_sub(before) << unused) as i64) >> unused
}

#[cfg(test)]
mod tests;
