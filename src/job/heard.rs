//! How sensors are heard now, for whoever looks on.

use crate::error::counted;
use crate::sensing::HeardSensor;
use crate::time::Instant;
use crate::view::session::SensorRow;
use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

/// A sensor that said nothing for so long is called silent, s.
pub(super) const SILENT_S: f64 = 0.5;
/// So many times that is remembered: told twice a second, rates are those of two seconds.
const REMEMBERED: usize = 5;

/// By name, how each sensor was heard.
pub(super) type AllHeard = BTreeMap<Arc<str>, HeardSensor>;

/// How a sensor is heard now.
#[derive(Clone, Debug, PartialEq)]
pub struct SensorNow {
    /// Its name.
    pub name: String,
    /// Samples per second in the last two seconds.
    pub rate_hz: f64,
    /// Samples per second by its profile; 0: nobody knows.
    pub usual_rate_hz: f64,
    /// Samples per second by its own clock, if that is another rate than its profile's.
    pub own_rate_hz: Option<f64>,
    /// Samples that came since it was opened.
    pub samples: u64,
    /// Samples known to be missing since then.
    pub missed: u64,
    /// For so long it has said nothing, s; `None`: it has never said anything.
    pub silent_s: Option<f64>,
    /// True if its values stand still.
    pub stuck: bool,
    /// Charge of its battery, 0 to 1, if it tells.
    pub battery: Option<f64>,
    /// How strongly it receives its network, dBm, if it tells.
    pub signal_dbm: Option<i8>,
    /// Why there will be no more of it, or is none just now.
    pub gone: Option<String>,
}

/// How sensors were heard a while ago, so that it can be said how often they speak.
#[derive(Default)]
pub(super) struct Rates(VecDeque<(Instant, AllHeard)>);

impl Rates {
    /// How these sensors are heard now: each has a name, and samples per second by its profile.
    pub(super) fn next<'a>(
        &mut self,
        sensors: impl Iterator<Item = (&'a str, f64)>,
        heard: AllHeard,
        now: Instant,
    ) -> Vec<SensorNow> {
        let before = self.0.front();
        let all = sensors.map(|(name, usual_rate_hz)| {
            let sensor = heard.get(name).cloned().unwrap_or_default();
            let rate_hz = before.map_or(0.0, |(then, heard)| {
                let known = heard.get(name).map_or(0, |known| known.samples);
                sensor.samples.saturating_sub(known) as f64 / now.seconds_since(*then)
            });
            SensorNow {
                name: name.to_owned(),
                rate_hz,
                usual_rate_hz,
                own_rate_hz: sensor.own_rate_hz,
                samples: sensor.samples,
                missed: sensor.missed,
                silent_s: sensor.last.map(|last| now.seconds_since(last).max(0.0)),
                stuck: sensor.stuck,
                battery: sensor.battery,
                signal_dbm: sensor.signal_dbm,
                gone: sensor.gone,
            }
        });
        let all = all.collect();
        self.0.push_back((now, heard));
        if self.0.len() >= REMEMBERED {
            self.0.pop_front();
        }
        all
    }

    /// How all sensors are heard now that were heard at any time.
    pub(super) fn of_all(
        &mut self,
        heard: Vec<(Arc<str>, HeardSensor)>,
        now: Instant,
    ) -> Vec<SensorNow> {
        let named: Vec<(Arc<str>, f64)> =
            heard.iter().map(|(name, of)| (Arc::clone(name), of.usual_rate_hz)).collect();
        let heard = heard.into_iter().collect();
        self.next(named.iter().map(|(name, rate_hz)| (&**name, *rate_hz)), heard, now)
    }
}

/// How sensors are heard while a robot has followed them for so long, in a line for a person.
pub fn following(time: std::time::Duration, sensors: &[SensorNow]) -> String {
    let slowest_hz = sensors.iter().map(|of| of.rate_hz).fold(f64::INFINITY, f64::min);
    let missed: u64 = sensors.iter().map(|of| of.missed).sum();
    let mut text = format!("{:.0} s", time.as_secs_f64());
    if !sensors.is_empty() {
        let of = counted(sensors.len(), "sensor");
        text += &format!("; {of}, {slowest_hz:.0}/s or more, {missed} missing");
    }
    for sensor in sensors.iter().map(row).filter(|row| !row.silent.is_empty()) {
        text += &format!("; {}: {}", sensor.name, sensor.silent);
    }
    text
}

/// What a page says of a sensor.
pub(super) fn row(sensor: &SensorNow) -> SensorRow {
    let silent = match (&sensor.gone, sensor.silent_s) {
        (Some(why), _) => format!("gone: {why}"),
        (None, None) => "nothing has come".to_owned(),
        (None, Some(time_s)) if time_s > SILENT_S => format!("silent for {time_s:.0} s"),
        (None, Some(_)) if sensor.stuck => "its values stand still".to_owned(),
        (None, Some(_)) => String::new(),
    };
    SensorRow {
        name: sensor.name.clone(),
        rate_hz: (sensor.rate_hz * 10.0).round() / 10.0,
        usual_rate_hz: sensor.usual_rate_hz,
        samples: sensor.samples,
        missed: sensor.missed,
        silent,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::Duration;

    fn heard(samples: u64, last: Instant) -> Vec<(Arc<str>, HeardSensor)> {
        let (usual_rate_hz, last) = (100.0, Some(last));
        let sensor = HeardSensor { samples, usual_rate_hz, last, ..HeardSensor::default() };
        vec![("head".into(), sensor)]
    }

    #[test]
    fn a_rate_is_that_of_the_last_two_seconds_and_who_says_nothing_is_silent() {
        let at = |half: u32| Instant::ZERO + half * Duration::from_millis(500);
        let mut rates = Rates::default();
        let first = rates.of_all(heard(10, at(0)), at(0));
        assert_eq!((first[0].rate_hz, first[0].samples), (0.0, 10));
        // A hundred a second for two seconds, then half of that.
        let told = (1..=8_u32).map(|half| {
            let samples = 10 + 50 * u64::from(half.min(4)) + 25 * u64::from(half.saturating_sub(4));
            rates.of_all(heard(samples, at(half)), at(half))[0].rate_hz
        });
        let told: Vec<f64> = told.collect();
        assert_eq!(told[3], 100.0);
        assert_eq!(told[7], 50.0);
        let later = rates.of_all(heard(310, at(8)), at(12));
        assert_eq!(row(&later[0]).silent, "silent for 2 s");
        let line = following(std::time::Duration::from_secs(7), &later);
        assert_eq!(line, "7 s; 1 sensor, 21/s or more, 0 missing; head: silent for 2 s");
    }
}
