//! Somebody looks on: how sensors are heard, and what whoever wears them does, is told all the time.

use super::happening::{Happening, SensorNow};
use super::operator::Operator;
use super::order::Worn;
use crate::body::Proportions;
use crate::body::worn::Wearing;
use crate::body::worn::kept::Kept;
use crate::motion::follow::STALE_S;
use crate::sensing::{Clock, HeardSensor, Hub, MonotonicClock};
use crate::session::wearers::wearer;
use crate::time::{Duration, Instant};
use std::collections::{BTreeMap, VecDeque};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// Time between two poses.
const POSES: Duration = Duration::from_millis(50);
/// So many poses are told before it is said again how sensors are heard.
const EVERY: u64 = 10;
/// So many times that is remembered: rates are those of two seconds.
const REMEMBERED: usize = 5;

/// By name, how each sensor was heard.
type AllHeard = BTreeMap<Arc<str>, HeardSensor>;

/// Somebody who wears sensors that are calibrated.
struct Wearer {
    wearing: Wearing,
    body: Proportions,
    /// Which of two subjects it is.
    subject: usize,
    before: Instant,
    /// How often the world of each sensor had begun anew by then.
    anew: BTreeMap<Arc<str>, u64>,
}

/// Who is looked at.
#[derive(Default)]
pub(super) struct Looking(Mutex<Option<Wearer>>);

impl Looking {
    /// From now on it is known how these sensors sit on this body, and where they face.
    pub(super) fn wears(&self, kept: &Kept, body: Option<Proportions>) {
        let subject = kept.sensors.first().and_then(|name| wearer(name)).map_or(0, |(by, _)| by);
        let wearer = body.map(|body| Wearer {
            wearing: Wearing::new(&kept.calibration),
            body,
            subject,
            before: MonotonicClock.now(),
            anew: BTreeMap::new(),
        });
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = wearer;
    }

    /// Nobody knows any more how they sit.
    pub(super) fn forget(&self) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }

    /// Tells it all until the end.
    pub(super) fn look(
        &self,
        hub: &Hub,
        worn: &[Worn],
        operator: &dyn Operator,
        stop: &AtomicBool,
    ) {
        let mut before: VecDeque<(Instant, AllHeard)> = VecDeque::new();
        let mut number = 0_u64;
        while !stop.load(Ordering::Acquire) {
            let (now, heard) = (MonotonicClock.now(), hub.heard());
            self.tell_pose(&heard, now, operator);
            if number.is_multiple_of(EVERY) {
                let sensors: Vec<SensorNow> =
                    worn.iter().map(|worn| sensor_now(worn, &heard, before.front(), now)).collect();
                operator.hear(Happening::Heard(&sensors));
                before.push_back((now, heard));
                if before.len() >= REMEMBERED {
                    before.pop_front();
                }
            }
            number += 1;
            MonotonicClock.sleep_until(now + POSES);
        }
    }

    /// What the sensors say that somebody does, if it is known how they sit.
    fn tell_pose(&self, heard: &AllHeard, now: Instant, operator: &dyn Operator) {
        let mut wearer = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(worn) = wearer.as_mut() else { return };
        let mut said = [None; 13];
        for (name, sensor) in heard {
            let Some((_, segment)) = self::wearer(name).filter(|(by, _)| *by == worn.subject)
            else {
                continue;
            };
            let known = worn.anew.insert(Arc::clone(name), sensor.anew);
            if known.is_some_and(|known| known != sensor.anew) {
                worn.wearing.heading_lost(segment);
            }
            let is_fresh = |last: Instant| now.seconds_since(last) <= STALE_S;
            said[segment.index()] = sensor.turned.filter(|_| sensor.last.is_some_and(is_fresh));
        }
        let pose = worn.wearing.pose(&said, now.seconds_since(worn.before)).pose;
        worn.before = now;
        let body = worn.body;
        // Whoever hears it may take their time; nobody waits for that.
        drop(wearer);
        operator.hear(Happening::Posed { pose: &pose, body: &body });
    }
}

/// How a sensor is heard now, beside how it was heard a while before.
fn sensor_now(
    worn: &Worn,
    heard: &AllHeard,
    before: Option<&(Instant, AllHeard)>,
    now: Instant,
) -> SensorNow {
    let sensor = heard.get(worn.name.as_str()).cloned().unwrap_or_default();
    let rate_hz = before.map_or(0.0, |(then, heard)| {
        let known = heard.get(worn.name.as_str()).map_or(0, |known| known.samples);
        sensor.samples.saturating_sub(known) as f64 / now.seconds_since(*then)
    });
    SensorNow {
        name: worn.name.clone(),
        rate_hz,
        usual_rate_hz: worn.rate_hz,
        samples: sensor.samples,
        missed: sensor.missed,
        silent_s: sensor.last.map(|last| now.seconds_since(last).max(0.0)),
        stuck: sensor.stuck,
        gone: sensor.gone,
    }
}
