//! Which sample is this, what is missing before it, and when was it taken.
//!
//! A sensor tells with a packet counter, with a clock, with both, or with nothing. A counter that
//! goes round is unwrapped; what does not fit is told as a gap, a repetition, a sample out of order
//! or a reset, and counted, never filled in.

use super::clock_fit::{ClockFit, Quality};
use crate::time::{Duration, Instant};
use serde::Serialize;

/// A step back by at most this many samples is one out of order; by more, the device was reset.
const MOST_REORDERED: u64 = 16;
/// Without counter and clock, only a silence shows a loss: so many periods, and this time more.
const SILENT_PERIODS: f64 = 5.0;
const SILENT_S: f64 = 0.1;
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
    /// Samples missing just before this one.
    pub missed: u64,
    /// How it stands to the one before.
    pub order: Order,
}

/// What a timeline has seen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// Samples, duplicates and late ones included.
    pub samples: u64,
    /// Gaps.
    pub gaps: u64,
    /// Samples missing in them.
    pub missed: u64,
    /// Samples sent twice.
    pub duplicates: u64,
    /// Samples out of order.
    pub late: u64,
    /// Resets of the device.
    pub resets: u64,
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
    fit: ClockFit,
    last: Option<Last>,
    counts: Counts,
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

impl Timeline {
    /// For a sensor that tells so much.
    #[must_use]
    pub fn new(telling: Telling) -> Self {
        Self { telling, fit: ClockFit::default(), last: None, counts: Counts::default() }
    }

    /// What was seen so far.
    #[must_use]
    pub const fn counts(&self) -> Counts {
        self.counts
    }

    /// How well the device's clock is known. Without counter and clock there is nothing to know.
    #[must_use]
    pub fn quality(&self) -> Quality {
        self.fit.quality()
    }

    /// Takes a sample with the raw `counter` and clock `ticks` it was sent with.
    pub fn take(&mut self, counter: Option<u64>, ticks: Option<u64>, arrival: Instant) -> Stamp {
        let counter = counter.filter(|_| self.telling.counter_bits.is_some());
        let ticks = ticks.filter(|_| self.telling.clock.is_some());
        self.counts.samples += 1;
        let Some(last) = self.last else {
            let device_s =
                ticks.zip(self.telling.clock).map_or(0.0, |(ticks, (_, s))| ticks as f64 * s);
            return self.accept(counter, ticks, device_s, 0, 0, Order::Next, arrival);
        };
        let by_counter = self.telling.counter_bits.zip(counter).zip(last.counter);
        let by_clock = self.telling.clock.zip(ticks).zip(last.ticks);
        let counter_step = by_counter.map(|((bits, now), before)| step(now, before, bits));
        let clock_step_s =
            by_clock.map(|(((bits, tick_s), now), before)| step(now, before, bits) as f64 * tick_s);
        let period_s = self.telling.period_s;
        // Samples since the last one: 1 is the next.
        let samples = match (counter_step, clock_step_s) {
            (Some(samples), _) => samples,
            (None, Some(step_s)) if step_s == 0.0 => 0,
            (None, Some(step_s)) => match (step_s / period_s).round() {
                samples if samples >= 1.0 => samples as i64,
                _ if step_s > 0.0 => 1,
                samples => (samples as i64).min(-1),
            },
            (None, None) => {
                let silent_s = arrival.seconds_since(last.stamp.arrival);
                let lost = silent_s > SILENT_PERIODS * period_s + SILENT_S;
                if lost { (silent_s / period_s).round().max(1.0) as i64 } else { 1 }
            }
        };
        match samples {
            0 => self.refuse(Order::Duplicate, &last, arrival),
            1.. if samples as u64 <= MOST_MISSING => {
                let device_s = last.device_s + clock_step_s.unwrap_or(samples as f64 * period_s);
                // A clock that runs back while the counter goes on has been set.
                if device_s < last.device_s {
                    return self.reset(counter, ticks, &last, arrival);
                }
                let missed = samples as u64 - 1;
                let order = if missed == 0 { Order::Next } else { Order::Gap };
                let number = last.number + samples as u64;
                self.accept(counter, ticks, device_s, number, missed, order, arrival)
            }
            ..0 if samples.unsigned_abs() <= MOST_REORDERED => {
                self.refuse(Order::Late, &last, arrival)
            }
            _ => self.reset(counter, ticks, &last, arrival),
        }
    }

    fn reset(
        &mut self,
        counter: Option<u64>,
        ticks: Option<u64>,
        last: &Last,
        arrival: Instant,
    ) -> Stamp {
        self.counts.resets += 1;
        let device_s =
            ticks.zip(self.telling.clock).map_or(0.0, |(ticks, (_, s))| ticks as f64 * s);
        self.fit.restart();
        self.accept(counter, ticks, device_s, last.number + 1, 0, Order::Reset, arrival)
    }

    #[expect(clippy::too_many_arguments, reason = "one sample, told apart")]
    fn accept(
        &mut self,
        counter: Option<u64>,
        ticks: Option<u64>,
        device_s: f64,
        number: u64,
        missed: u64,
        order: Order,
        arrival: Instant,
    ) -> Stamp {
        if missed > 0 {
            self.counts.gaps += 1;
            self.counts.missed += missed;
        }
        let told = self.telling.counter_bits.is_some() || self.telling.clock.is_some();
        let fitted = if told { self.fit.take(device_s, arrival) } else { arrival };
        let latency_ns = u64::try_from(self.telling.latency.as_nanos()).unwrap_or(0);
        let taken = Instant::from_nanos(fitted.as_nanos().saturating_sub(latency_ns));
        let before = self.last.filter(|_| order != Order::Reset);
        let step_s = match before {
            Some(before) if told => device_s - before.device_s,
            Some(before) => taken.seconds_since(before.stamp.taken),
            None => 0.0,
        };
        let stamp = Stamp { arrival, taken, number, step_s, missed, order };
        self.last = Some(Last { counter, ticks, device_s, number, stamp });
        stamp
    }

    /// A sample that is no step forward: stamped with the one before, which it does not move.
    fn refuse(&mut self, order: Order, last: &Last, arrival: Instant) -> Stamp {
        match order {
            Order::Duplicate => self.counts.duplicates += 1,
            _ => self.counts.late += 1,
        }
        Stamp { arrival, step_s: 0.0, missed: 0, order, ..last.stamp }
    }
}

/// From `before` to `now` on a counter of so many bits, the short way round.
fn step(now: u64, before: u64, bits: u32) -> i64 {
    let unused = 64_u32.saturating_sub(bits).min(63);
    // Shifted to the top, the sign of the difference is that of the short way.
    ((now.wrapping_sub(before) << unused) as i64) >> unused
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn at(seconds: f64) -> Instant {
        Instant::from_nanos((seconds * 1e9) as u64)
    }

    fn counting(bits: u32) -> Timeline {
        Timeline::new(Telling {
            counter_bits: Some(bits),
            clock: None,
            period_s: 0.01,
            latency: Duration::ZERO,
        })
    }

    #[test]
    fn a_counter_that_goes_round_is_no_gap() {
        let mut timeline = counting(8);
        let stamps: Vec<Stamp> = (0..1000_u64)
            .map(|n| timeline.take(Some(n & 0xFF), None, at(1.0 + n as f64 * 0.01)))
            .collect();
        assert!(stamps.iter().all(|stamp| stamp.order == Order::Next));
        assert_eq!(stamps[999].number, 999);
        assert_eq!(timeline.counts(), Counts { samples: 1000, ..Counts::default() });
    }

    #[test]
    fn gaps_repetitions_and_disorder_are_told_apart_and_counted() {
        let mut timeline = counting(8);
        let orders: Vec<(Order, u64)> = [250, 251, 251, 255, 2, 1, 3, 103]
            .into_iter()
            .enumerate()
            .map(|(n, counter)| timeline.take(Some(counter), None, at(1.0 + n as f64 * 0.01)))
            .map(|stamp| (stamp.order, stamp.missed))
            .collect();
        assert_eq!(
            orders,
            [
                (Order::Next, 0),
                (Order::Next, 0),
                (Order::Duplicate, 0),
                (Order::Gap, 3),
                (Order::Gap, 2),
                (Order::Late, 0),
                (Order::Next, 0),
                (Order::Gap, 99),
            ]
        );
        let expected =
            Counts { samples: 8, gaps: 3, missed: 104, duplicates: 1, late: 1, resets: 0 };
        assert_eq!(timeline.counts(), expected);
    }

    #[test]
    fn a_clock_alone_shows_gaps_and_resets() {
        let mut timeline = Timeline::new(Telling {
            counter_bits: None,
            clock: Some((32, 1e-6)),
            period_s: 0.01,
            latency: Duration::from_millis(2),
        });
        let start = u64::from(u32::MAX) - 15_000;
        let mut take =
            |ticks: u64, s: f64| timeline.take(Some(9), Some(ticks & 0xFFFF_FFFF), at(s));
        take(start, 1.0);
        let next = take(start + 10_100, 1.01);
        assert_eq!(next.order, Order::Next);
        assert!((next.step_s - 0.0101).abs() < 1e-9);
        // Over the end of the 32 bits, two samples missing.
        let gap = take(start + 40_000, 1.04);
        assert_eq!((gap.order, gap.missed), (Order::Gap, 2));
        assert_eq!(take(start + 40_000, 1.041).order, Order::Duplicate);
        // A jump back by two seconds is a reset; the latency stays taken off.
        let reset = take(start - 2_000_000, 2.0);
        assert_eq!((reset.order, reset.step_s), (Order::Reset, 0.0));
        assert_eq!(reset.taken, at(1.998));
    }

    #[test]
    fn without_counter_and_clock_only_a_silence_shows_a_loss() {
        let mut timeline = Timeline::new(Telling {
            counter_bits: None,
            clock: None,
            period_s: 0.01,
            latency: Duration::ZERO,
        });
        timeline.take(None, None, at(1.0));
        assert_eq!(timeline.take(None, None, at(1.05)).missed, 0);
        assert_eq!(timeline.take(None, None, at(2.05)).missed, 99);
    }

    proptest! {
        /// Losses in any pattern shorter than half a turn of the counter are counted exactly.
        #[test]
        fn what_is_lost_is_counted(lost in prop::collection::vec(0_u64..100, 1..200)) {
            let mut timeline = counting(8);
            let mut counter = 7_u64;
            timeline.take(Some(counter), None, at(1.0));
            for gap in &lost {
                counter += gap + 1;
                timeline.take(Some(counter & 0xFF), None, at(1.0 + counter as f64 * 0.01));
            }
            prop_assert_eq!(timeline.counts().missed, lost.iter().sum::<u64>());
        }

        #[test]
        fn any_counters_and_clocks_are_taken(
            samples in prop::collection::vec((any::<u64>(), any::<u64>(), any::<u32>()), 0..100),
            bits in 4_u32..=64,
        ) {
            let mut timeline = Timeline::new(Telling {
                counter_bits: Some(bits),
                clock: Some((bits, 1e-9)),
                period_s: 0.01,
                latency: Duration::ZERO,
            });
            let (mut now, mut last) = (0, Instant::ZERO);
            for (counter, ticks, wait) in samples {
                now += u64::from(wait);
                let stamp = timeline.take(Some(counter), Some(ticks), Instant::from_nanos(now));
                prop_assert!(stamp.taken >= last && stamp.taken <= stamp.arrival);
                prop_assert!(stamp.step_s >= 0.0);
                last = stamp.taken;
            }
        }
    }
}
