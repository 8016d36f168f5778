//! A tap that several sensors feel at once: whether their times agree.
//!
//! Sensors that lie on one table, or sit on one body, feel a sharp tap at the same moment. Where
//! each says it was shows how far their time bases are apart. A step in running shakes a body as
//! well, so a tap counts only after a moment of stillness.

use crate::error::counted;
use crate::recording::SensorMoment;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Acceleration that changes by so much from one sample to the next is a blow, m/s^2.
const BLOW_M_S2: f64 = 15.0;
/// It is still where acceleration changes by less, root mean square, m/s^2.
const STILL_M_S2: f64 = 1.0;
/// So long it is still before a tap, s.
const STILL_S: f64 = 0.4;
/// A tap rings for at most so long, s.
const RING_S: f64 = 0.1;
/// Blows of several sensors nearer than this are one tap, s. Time bases that are further apart
/// are not told from two taps.
const TOGETHER_S: f64 = 0.25;

/// A tap that at least two sensors felt.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tap {
    /// When, since the beginning of the recording: the median of the sensors, s.
    pub at_s: f64,
    /// By sensor, how much later than the median it says the tap was, s.
    pub offset_s: BTreeMap<String, f64>,
    /// Half a period of the slowest sensor: offsets below this mean nothing, s.
    pub resolution_s: f64,
}

impl Tap {
    /// True if the sensors agree as well as their rates let them.
    #[must_use]
    pub fn agrees(&self) -> bool {
        self.spread_s() <= 2.0 * self.resolution_s
    }

    /// In a line, for a person.
    #[must_use]
    pub fn words(&self) -> String {
        let ms = |s: f64| s * 1e3;
        let offsets = self.offset_s.iter().map(|(name, s)| format!("{name} {:+.1} ms", ms(*s)));
        let verdict = if self.agrees() {
            "one time base"
        } else {
            "their times differ, unless it was a step"
        };
        format!(
            "at {:.3} s, felt by {}, {:.1} ms apart: {verdict} ({}; each within {:.1} ms)",
            self.at_s,
            counted(self.offset_s.len(), "sensor"),
            ms(self.spread_s()),
            offsets.collect::<Vec<_>>().join(", "),
            ms(self.resolution_s)
        )
    }

    /// The largest distance between two sensors, s.
    #[must_use]
    pub fn spread_s(&self) -> f64 {
        let least = self.offset_s.values().copied().fold(f64::INFINITY, f64::min);
        let most = self.offset_s.values().copied().fold(f64::NEG_INFINITY, f64::max);
        if most >= least { most - least } else { 0.0 }
    }
}

/// A blow that one sensor felt.
struct Blow<'a> {
    sensor: &'a str,
    at_s: f64,
    period_s: f64,
}

/// The taps in what the sensors of a recording felt; times count from `start_ns`.
#[must_use]
pub fn taps(sensors: &BTreeMap<String, Vec<SensorMoment>>, start_ns: u64) -> Vec<Tap> {
    let mut blows: Vec<Blow> = Vec::new();
    for (sensor, moments) in sensors {
        blows.extend(blows_of(sensor, moments, start_ns));
    }
    blows.sort_by(|a, b| a.at_s.total_cmp(&b.at_s));
    let mut found = Vec::new();
    let mut rest = blows.as_slice();
    while let Some(first) = rest.first() {
        let together = rest.iter().take_while(|b| b.at_s - first.at_s <= TOGETHER_S).count();
        let (group, after) = rest.split_at(together);
        found.extend(tap_of(group));
        rest = after;
    }
    found
}

fn tap_of(group: &[Blow]) -> Option<Tap> {
    // A sensor that bounces: its first blow counts.
    let mut first: BTreeMap<&str, f64> = BTreeMap::new();
    for blow in group {
        first.entry(blow.sensor).or_insert(blow.at_s);
    }
    if first.len() < 2 {
        return None;
    }
    let mut times: Vec<f64> = first.values().copied().collect();
    times.sort_by(f64::total_cmp);
    let middle = times.len() / 2;
    let at_s = if times.len() % 2 == 1 {
        times[middle]
    } else {
        (times[middle - 1] + times[middle]) / 2.0
    };
    let offset = |(sensor, time): (&str, f64)| (sensor.to_owned(), time - at_s);
    let resolution_s = group.iter().map(|blow| blow.period_s / 2.0).fold(0.0, f64::max);
    Some(Tap { at_s, offset_s: first.into_iter().map(offset).collect(), resolution_s })
}

fn blows_of<'a>(sensor: &'a str, moments: &[SensorMoment], start_ns: u64) -> Vec<Blow<'a>> {
    let felt: Vec<(f64, glam::DVec3)> = moments
        .iter()
        .filter_map(|moment| {
            let time_s = (i128::from(moment.taken_ns) - i128::from(start_ns)) as f64 / 1e9;
            Some((time_s, moment.acceleration_m_s2.filter(|a| a.is_finite())?))
        })
        .collect();
    let mut blows = Vec::new();
    // Changes, each with the time in the middle of its two samples.
    let changes: Vec<(f64, f64)> = felt
        .windows(2)
        .map(|pair| ((pair[0].0 + pair[1].0) / 2.0, (pair[1].1 - pair[0].1).length()))
        .collect();
    let Some((first_s, last_s)) = felt.first().zip(felt.last()).map(|(a, b)| (a.0, b.0)) else {
        return blows;
    };
    let period_s = (last_s - first_s) / (felt.len().max(2) - 1) as f64;
    let mut at = 0;
    while at < changes.len() {
        let (time_s, change) = changes[at];
        if !(change >= BLOW_M_S2) || !was_still(&changes[..at], time_s) {
            at += 1;
            continue;
        }
        let ring = changes[at..].iter().take_while(|(t, _)| t - time_s <= RING_S);
        // The centre of what it felt is known better than any one sample.
        let (mut weight, mut sum, mut count) = (0.0, 0.0, 0);
        for (t, change) in ring {
            weight += change * change;
            sum += change * change * t;
            count += 1;
        }
        blows.push(Blow { sensor, at_s: sum / weight, period_s });
        at += count;
    }
    blows
}

/// True if nothing moved in the last [`STILL_S`] and that is known.
fn was_still(before: &[(f64, f64)], time_s: f64) -> bool {
    // The change just before may be the foot of the blow.
    let before = &before[..before.len().saturating_sub(1)];
    let recent = before.iter().rev().take_while(|(t, _)| time_s - t <= STILL_S);
    let (mut squares, mut count) = (0.0, 0_u32);
    for (_, change) in recent {
        squares += change * change;
        count += 1;
    }
    let long = before.first().is_some_and(|(t, _)| time_s - t >= STILL_S);
    long && count > 2 && (squares / f64::from(count)).sqrt() <= STILL_M_S2
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    /// A bell of 20 ms and 100 m/s^2 at `taps_s`, sampled at `rate_hz`, by a clock that is late by
    /// `late_s`; and a slow swing.
    fn felt(rate_hz: f64, late_s: f64, taps_s: &[f64], swing_m_s2: f64) -> Vec<SensorMoment> {
        let moment = |n: u64| {
            let t = n as f64 / rate_hz;
            let bell = |tap: &f64| {
                let x = (t - tap) / 0.01;
                if x.abs() < 1.0 { 50.0 * (1.0 + (std::f64::consts::PI * x).cos()) } else { 0.0 }
            };
            let force = 9.81 + taps_s.iter().map(bell).sum::<f64>() + swing_m_s2 * (20.0 * t).sin();
            SensorMoment {
                taken_ns: 1_000_000_000 + ((t + late_s) * 1e9) as u64,
                rate_rad_s: None,
                acceleration_m_s2: Some(DVec3::Z * force),
                field_t: None,
                orientation: None,
            }
        };
        (0..(4.0 * rate_hz) as u64).map(moment).collect()
    }

    fn found(sensors: &[(&str, Vec<SensorMoment>)]) -> Vec<Tap> {
        let sensors = sensors.iter().map(|(name, moments)| ((*name).to_owned(), moments.clone()));
        taps(&sensors.collect(), 1_000_000_000)
    }

    #[test]
    fn a_tap_tells_how_far_clocks_are_apart() {
        let at = [1.5, 2.8037];
        for (late_s, rate_hz) in [(0.0, 200.0), (0.02, 200.0), (-0.1, 200.0), (0.03, 400.0)] {
            let taps = found(&[
                ("a", felt(200.0, 0.0, &at, 0.0)),
                ("b", felt(200.0, 0.0, &at, 0.0)),
                ("c", felt(rate_hz, late_s, &at, 0.0)),
            ]);
            assert_eq!(taps.len(), 2, "{taps:?}");
            for (tap, at_s) in taps.iter().zip(at) {
                assert!((tap.at_s - at_s).abs() <= 0.0025, "{tap:?}");
                let off = tap.offset_s["c"] - tap.offset_s["a"];
                assert!((off - late_s).abs() <= tap.resolution_s, "{late_s}: {off}");
                assert!((tap.resolution_s - 0.0025).abs() < 1e-4, "{tap:?}");
                assert!((tap.spread_s() - late_s.abs()).abs() <= tap.resolution_s);
                assert_eq!(tap.agrees(), late_s == 0.0, "{}", tap.words());
            }
        }
    }

    #[test]
    fn what_one_sensor_feels_and_what_comes_amid_movement_is_no_tap() {
        let alone =
            found(&[("a", felt(200.0, 0.0, &[2.0], 0.0)), ("b", felt(200.0, 0.0, &[], 0.0))]);
        assert_eq!(alone, []);
        let amid = felt(200.0, 0.0, &[2.0], 15.0);
        assert_eq!(found(&[("a", amid.clone()), ("b", amid)]), []);
        assert_eq!(found(&[("a", Vec::new())]), []);
    }
}
