//! A device's clock on the host's, from nothing but when its samples arrive.
//!
//! Every sample arrives late by a part that is always the same and a part that is not: adapters that
//! collect bytes for up to 16 ms, schedulers, radio. The quickest sample of a few seconds has next to
//! none of the second part, so the line through these quickest ones is the device's clock, offset by
//! the constant part, which one way alone cannot be known (a transport may state it). Averages would
//! carry the mean of the waiting with them.
//!
//! Per block of 2 s the least `arrival - device` is kept, of the last 60 blocks; a line is laid
//! through them by least squares. A block in which every sample waited counts as no later than the
//! median of the blocks around it: a step stays a step, and a busy machine is seen through. Compare
//! L. Zhang, Z. Liu, C. Honghui Xia, "Clock synchronization algorithms for network measurements",
//! INFOCOM 2002 (convex hull of the minima).
//!
//! What cannot be seen: an adapter that hands over every 16 ms by a timer of its own and a sensor that
//! samples every 20 ms meet in four phases only, 4 ms apart. Until the drift of the clocks has carried
//! one of them over the timer's edge (at 20 ppm that takes up to 200 s), every sample arrives exactly
//! as if there were no drift: nothing that came tells one from the other. So the error wanders by up
//! to the distance of the phases (50 Hz: 4 ms, 125 Hz: 8 ms, 100 Hz: 2 ms, 200 Hz: 1 ms); the cure is
//! to set the adapter's latency timer to 1 ms.

use crate::time::{Duration, Instant};
use std::collections::VecDeque;

/// Length of a block on the device's clock, s.
const BLOCK_S: f64 = 2.0;
/// Blocks the line goes through.
const BLOCKS: usize = 60;
/// Before so many blocks a slope would be noise.
const BLOCKS_FOR_SLOPE: usize = 4;
/// No crystal in use is worse.
const MOST_SLOPE: f64 = 500e-6;
/// So many blocks to each side say whether all samples of a block waited: together 26 s.
const AROUND: usize = 6;
/// A silence after which nothing of before is trusted.
const MOST_SILENCE: Duration = Duration::from_secs(5);
/// A sample this far from the line shows that the device's clock was set, s.
const MOST_JUMP_S: f64 = 1.0;
/// Latencies kept for the percentiles.
const KEPT: usize = 1024;

/// How well a device's clock is known.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Quality {
    /// How much faster the host's clock runs than the device's, parts per million.
    pub skew_ppm: f64,
    /// Half of the last samples arrived within this time after the estimate, s.
    pub late_p50_s: f64,
    /// 99 % of them did.
    pub late_p99_s: f64,
    /// How often the fit was begun again: the device was reset, or silent for long.
    pub restarts: u64,
}

/// The quickest sample of a block: the device's clock since the first sample, and `arrival -
/// device` less that of the first sample, s.
#[derive(Clone, Copy, Debug)]
struct Quickest {
    device_s: f64,
    offset_s: f64,
}

/// Fits a device's clock to the host's while samples arrive.
#[derive(Clone, Debug, Default)]
pub struct ClockFit {
    /// First sample since the last restart: device's clock and arrival.
    first: Option<(f64, Instant)>,
    blocks: VecDeque<Quickest>,
    /// Number of the open block and its quickest sample.
    open: Option<(u64, Quickest)>,
    /// Through the quickest samples: slope, and offset at device time zero.
    line: Option<(f64, f64)>,
    last_arrival: Instant,
    last_device_s: f64,
    last_estimate: Instant,
    late_s: VecDeque<f64>,
    restarts: u64,
}

impl ClockFit {
    /// When the sample with `device_s` on the device's own, unwrapped clock was taken, on the host's
    /// clock, given that it arrived at `arrival`. Never later than its arrival, never earlier than
    /// the estimate before.
    pub fn take(&mut self, device_s: f64, arrival: Instant) -> Instant {
        let silent = arrival.since(self.last_arrival) > MOST_SILENCE;
        let back = device_s < self.last_device_s;
        if self.first.is_some() && (silent || back || self.jumped(device_s, arrival)) {
            self.restart();
        }
        let (device_zero_s, host_zero) = *self.first.get_or_insert((device_s, arrival));
        let device_s_since = device_s - device_zero_s;
        let offset_s = arrival.seconds_since(host_zero) - device_s_since;
        self.add(Quickest { device_s: device_s_since, offset_s });
        let late_s = (offset_s - self.offset_at(device_s_since)).max(0.0);
        if self.late_s.len() == KEPT {
            self.late_s.pop_front();
        }
        self.late_s.push_back(late_s);
        let late = Duration::from_secs_f64(late_s.min(MOST_SILENCE.as_secs_f64()));
        let estimate = Instant::from_nanos(
            arrival.as_nanos().saturating_sub(u64::try_from(late.as_nanos()).unwrap_or(u64::MAX)),
        );
        let estimate = estimate.max(self.last_estimate).min(arrival);
        (self.last_arrival, self.last_device_s, self.last_estimate) = (arrival, device_s, estimate);
        estimate
    }

    /// How well the clock is known.
    #[must_use]
    pub fn quality(&self) -> Quality {
        let mut late_s: Vec<f64> = self.late_s.iter().copied().collect();
        late_s.sort_by(f64::total_cmp);
        let at = |share: f64| {
            let index = (share * late_s.len().saturating_sub(1) as f64).round() as usize;
            late_s.get(index).copied().unwrap_or(0.0)
        };
        Quality {
            skew_ppm: self.line.map_or(0.0, |(slope, _)| slope * 1e6),
            late_p50_s: at(0.5),
            late_p99_s: at(0.99),
            restarts: self.restarts,
        }
    }

    /// Forgets everything but that time does not run back: the device was reset.
    pub fn restart(&mut self) {
        if self.first.is_none() {
            return;
        }
        *self = Self {
            restarts: self.restarts + 1,
            last_estimate: self.last_estimate,
            ..Self::default()
        };
    }

    /// How much earlier a sample of this device time would arrive than any is expected to, s.
    pub(super) fn early_s(&self, device_s: f64, arrival: Instant) -> f64 {
        let Some((device_zero_s, host_zero)) = self.first else { return 0.0 };
        let device_s = device_s - device_zero_s;
        device_s + self.offset_at(device_s) - arrival.seconds_since(host_zero)
    }

    /// True if the device's clock has been set: the sample is far from where the line puts it.
    fn jumped(&self, device_s: f64, arrival: Instant) -> bool {
        let Some((device_zero_s, host_zero)) = self.first else { return false };
        let device_s = device_s - device_zero_s;
        let off_s = arrival.seconds_since(host_zero) - device_s - self.offset_at(device_s);
        // Far too late is a queue in between, until it lasts: then the silence or the line tells.
        !(off_s >= -MOST_JUMP_S && off_s <= MOST_SILENCE.as_secs_f64())
    }

    fn add(&mut self, sample: Quickest) {
        let number = (sample.device_s / BLOCK_S) as u64;
        match &mut self.open {
            Some((open, quickest)) if *open == number => {
                if sample.offset_s < quickest.offset_s {
                    *quickest = sample;
                }
            }
            open => {
                if let Some((_, closed)) = open.replace((number, sample)) {
                    if self.blocks.len() == BLOCKS {
                        self.blocks.pop_front();
                    }
                    self.blocks.push_back(closed);
                    self.line = Some(line(&self.blocks));
                }
            }
        }
    }

    /// Least `arrival - device` to be expected at this device time, s.
    fn offset_at(&self, device_s: f64) -> f64 {
        let open = self.open.map(|(_, quickest)| quickest);
        match self.line {
            Some((slope, zero)) if self.blocks.len() >= BLOCKS_FOR_SLOPE => zero + slope * device_s,
            // Too early for a line: the quickest of all.
            _ => self.blocks.iter().chain(&open).map(|q| q.offset_s).fold(f64::INFINITY, f64::min),
        }
    }
}

/// The line through the quickest samples: slope, and offset at zero.
fn line(blocks: &VecDeque<Quickest>) -> (f64, f64) {
    let (slope, _) = least_squares(blocks.iter().copied());
    let level_s = |q: &Quickest| q.offset_s - slope * q.device_s;
    let levels_s: Vec<f64> = blocks.iter().map(level_s).collect();
    let capped = blocks.iter().enumerate().map(|(index, q)| {
        let late_s = (levels_s[index] - median_around(&levels_s, index)).max(0.0);
        Quickest { offset_s: q.offset_s - late_s, ..*q }
    });
    least_squares(capped)
}

/// The median of the levels around one, itself included. Beyond the ends the levels go on as in a
/// mirror.
fn median_around(levels_s: &[f64], index: usize) -> f64 {
    let last = levels_s.len() - 1;
    let reach = AROUND.min(last / 2);
    let mut around: Vec<f64> = (0..=2 * reach)
        .map(|step| {
            let place = (index + step).abs_diff(reach);
            levels_s[if place > last { 2 * last - place } else { place }]
        })
        .collect();
    *around.select_nth_unstable_by(reach, f64::total_cmp).1
}

fn least_squares(points: impl Iterator<Item = Quickest> + Clone) -> (f64, f64) {
    let count = points.clone().count().max(1) as f64;
    let mean_device_s = points.clone().map(|q| q.device_s).sum::<f64>() / count;
    let mean_offset_s = points.clone().map(|q| q.offset_s).sum::<f64>() / count;
    let (mut square, mut product) = (0.0, 0.0);
    for q in points {
        let apart_s = q.device_s - mean_device_s;
        square += apart_s * apart_s;
        product += apart_s * (q.offset_s - mean_offset_s);
    }
    let slope = if square > 0.0 { product / square } else { 0.0 };
    let slope = slope.clamp(-MOST_SLOPE, MOST_SLOPE);
    (slope, mean_offset_s - slope * mean_device_s)
}

#[cfg(test)]
mod tests;
