//! Somebody looks on: how sensors are heard, and what whoever wears them does, is told all the time.

use super::happening::Happening;
use super::operator::Operator;
use super::order::Worn;
use crate::body::Proportions;
use crate::body::worn::Wearing;
use crate::body::worn::kept::Kept;
use crate::job::heard::{AllHeard, Rates};
use crate::motion::follow::STALE_S;
use crate::sensing::{Clock, Hub, MonotonicClock};
use crate::session::wearers::wearer;
use crate::time::{Duration, Instant};
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// Time between two poses.
const POSES: Duration = Duration::from_millis(50);
/// So many poses are told before it is said again how sensors are heard.
const EVERY: u64 = 10;

/// Somebody who wears sensors that are calibrated.
struct Wearer {
    wearing: Wearing,
    body: Proportions,
    before: Instant,
    /// How often the world of each sensor had begun anew by then.
    anew: BTreeMap<Arc<str>, u64>,
}

/// Who is looked at, by number.
#[derive(Default)]
pub(super) struct Looking(Mutex<BTreeMap<usize, Wearer>>);

impl Looking {
    /// From now on it is known how these sensors sit on this body, and where they face.
    pub(super) fn wears(&self, kept: &Kept, body: Option<Proportions>) {
        let subject = kept.sensors.first().and_then(|name| wearer(name)).map_or(0, |(by, _)| by);
        let mut wearers = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        match body {
            Some(body) => {
                let (wearing, anew) = (Wearing::new(&kept.calibration), BTreeMap::new());
                let before = MonotonicClock.now();
                wearers.insert(subject, Wearer { wearing, body, before, anew });
            }
            None => drop(wearers.remove(&subject)),
        }
    }

    /// Nobody knows any more how those of a subject sit.
    pub(super) fn forget(&self, subject: usize) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).remove(&subject);
    }

    /// Tells it all until the end.
    pub(super) fn look(
        &self,
        hub: &Hub,
        worn: &[Worn],
        operator: &dyn Operator,
        stop: &AtomicBool,
    ) {
        let mut rates = Rates::default();
        let mut number = 0_u64;
        while !stop.load(Ordering::Acquire) {
            let (now, heard) = (MonotonicClock.now(), hub.heard());
            self.tell_poses(&heard, now, operator);
            if number.is_multiple_of(EVERY) {
                let named = worn.iter().map(|worn| (worn.name.as_str(), worn.rate_hz));
                operator.hear(Happening::Heard(&rates.next(named, heard, now)));
            }
            number += 1;
            MonotonicClock.sleep_until(now + POSES);
        }
    }

    /// What the sensors say that everybody does of whom it is known how they sit.
    fn tell_poses(&self, heard: &AllHeard, now: Instant, operator: &dyn Operator) {
        let mut poses = Vec::new();
        for (&subject, worn) in self.0.lock().unwrap_or_else(PoisonError::into_inner).iter_mut() {
            let mut said = [None; 13];
            for (name, sensor) in heard {
                let Some((_, segment)) = wearer(name).filter(|(by, _)| *by == subject) else {
                    continue;
                };
                let known = worn.anew.insert(Arc::clone(name), sensor.anew);
                if known.is_some_and(|known| known != sensor.anew) {
                    worn.wearing.heading_lost(segment);
                }
                let is_fresh = |last: Instant| now.seconds_since(last) <= STALE_S;
                said[segment.index()] = sensor.turned.filter(|_| sensor.last.is_some_and(is_fresh));
            }
            let moment = worn.wearing.pose(&said, now.seconds_since(worn.before));
            worn.before = now;
            let sensors = worn.wearing.sensors(&moment);
            poses.push((subject, moment.pose, sensors, worn.body));
        }
        // Whoever hears it may take their time; nobody waits for that.
        for (subject, pose, sensors, body) in &poses {
            operator.hear(Happening::Posed { subject: *subject, pose, sensors, body });
        }
    }
}
