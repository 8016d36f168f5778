//! How far a joint's goal is from where its host last saw it (R11).

use super::When;
use std::collections::VecDeque;

/// How far a goal may be from where the joint was last read, besides what the goal has gone since,
/// rad.
const FOLLOWS_WITHIN_RAD: f64 = 0.35;
/// How long a joint that was moved must be read that near to its goal before it counts as back, ns.
const BACK_FOR_NS: u64 = 500_000_000;
/// Readings remembered that may still be on their way to the host.
const UNDER_WAY: usize = 16;
/// Far below a count of any encoder, far above what arithmetic loses.
const ROUNDING: f64 = 1e-9;

/// A position that a servo told.
#[derive(Clone, Copy, Debug)]
struct Reading {
    measured_ns: u64,
    /// Where the joint was, as far as its host can be held to it: where it read, or where it was
    /// before a hand or a fault moved it, or in between.
    low: f64,
    high: f64,
    /// How far the goal has gone since, to and fro, rad.
    gone: f64,
    /// When the host had it.
    had_ns: Option<u64>,
}

impl Reading {
    fn distance(&self, angle: f64) -> f64 {
        (self.low - angle).max(angle - self.high).max(0.0)
    }
}

/// Readings of one joint, the one its host goes by first.
#[derive(Clone, Debug, Default)]
pub(super) struct Tracking {
    readings: VecDeque<Reading>,
    /// Where the joint was, at least and at most, before a hand or a fault moved it, if one did
    /// and it has not come back to its goal.
    unmoved: Option<(f64, f64)>,
    /// Since when it has been read near its goal.
    near_since_ns: Option<u64>,
}

impl Tracking {
    /// Torque came on with the joint at `angle`.
    pub fn begin(&mut self, at_ns: u64, angle: f64) {
        self.unmoved = None;
        self.readings.clear();
        let (gone, had_ns) = (0.0, Some(at_ns));
        self.readings.push_back(Reading {
            measured_ns: at_ns,
            low: angle,
            high: angle,
            gone,
            had_ns,
        });
    }

    /// A hand or a fault moves the joint away from `angle`.
    pub fn displaced(&mut self, angle: f64) {
        let (low, high) = self.unmoved.unwrap_or((angle, angle));
        self.unmoved = Some((low.min(angle), high.max(angle)));
        self.near_since_ns = None;
    }

    pub fn measured(&mut self, at_ns: u64, angle: f64, goal: Option<f64>) {
        if goal.is_some_and(|goal| (goal - angle).abs() <= FOLLOWS_WITHIN_RAD) {
            let since_ns = *self.near_since_ns.get_or_insert(at_ns);
            self.unmoved = self.unmoved.filter(|_| at_ns.saturating_sub(since_ns) < BACK_FOR_NS);
        } else {
            self.near_since_ns = None;
        }
        let (low, high) = self.unmoved.unwrap_or((angle, angle));
        let (low, high) = (low.min(angle), high.max(angle));
        let reading = Reading { measured_ns: at_ns, low, high, gone: 0.0, had_ns: None };
        self.readings.push_back(reading);
        if self.readings.len() > UNDER_WAY {
            // The oldest that never arrived; the first is the one the host goes by.
            self.readings.remove(1);
        }
    }

    pub fn had(&mut self, measured_ns: u64, now_ns: u64) {
        let mut readings = self.readings.iter_mut();
        if let Some(reading) = readings.find(|reading| reading.measured_ns == measured_ns) {
            reading.had_ns.get_or_insert(now_ns);
        }
    }

    /// The goal goes from one angle to another.
    pub fn goes(&mut self, from: f64, to: f64, before: When, now: When) {
        let way = (to - from).abs();
        let took_ns = now.latest_ns.saturating_sub(before.latest_ns);
        for reading in &mut self.readings {
            let since_ns = now.latest_ns.saturating_sub(reading.measured_ns);
            // Of a step that began before the reading only what came after it counts.
            let share = if now.is_certain() && since_ns < took_ns {
                since_ns as f64 / took_ns as f64
            } else {
                1.0
            };
            reading.gone += way * share;
        }
    }

    /// Whether a goal that was written at `written_ns` or later goes too far from where the host
    /// last saw the joint.
    pub fn judge(
        &mut self,
        from: f64,
        to: f64,
        written_ns: u64,
        resolution: f64,
    ) -> Option<String> {
        let had = |reading: &Reading| reading.had_ns.is_some_and(|had_ns| had_ns <= written_ns);
        if let Some(newest) = self.readings.iter().rposition(had) {
            self.readings.drain(..newest);
        }
        let reading = self.readings.front().filter(|reading| had(reading))?;
        let distance = reading.distance(to);
        let allowed = FOLLOWS_WITHIN_RAD + reading.gone + resolution + ROUNDING;
        // A goal that stays or comes nearer did not make the distance.
        let farther = distance > reading.distance(from) + ROUNDING;
        (farther && distance > allowed).then(|| {
            let ago_ms = written_ns.saturating_sub(reading.measured_ns) as f64 * 1e-6;
            format!(
                "goal went to {distance:.4} rad from where the joint was read {ago_ms:.1} ms ago, \
                 {allowed:.4} rad allowed"
            )
        })
    }
}
