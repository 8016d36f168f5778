//! What the sensors that somebody wears say.

use super::Place;
use crate::body::Segment;
use crate::cli::record::intake::Said;
use crate::recording::ReplayedSample;
use crate::time::{Duration, Instant};
use glam::DQuat;
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;
use std::sync::mpsc::Receiver;

/// Samples per second of what was listened to: evenly spaced and the same for all sensors.
pub const LISTENED_HZ: f64 = 60.0;

/// Where samples come from.
pub enum Feed {
    /// From threads that read sensors now.
    Live(Receiver<Said>),
    /// From a recording, as if it happened now: it begins when it is first asked.
    Replay {
        /// Samples in the order in which they were read; times since the first.
        samples: VecDeque<ReplayedSample>,
        /// When it began.
        began: Option<Instant>,
    },
}

impl Feed {
    /// A recording played as if now.
    #[must_use]
    pub fn replay(samples: VecDeque<ReplayedSample>) -> Self {
        Self::Replay { samples, began: None }
    }

    /// The next sample that has come by now.
    fn next(&mut self, now: Instant) -> Option<Said> {
        match self {
            Self::Live(receiver) => receiver.try_recv().ok(),
            Self::Replay { samples, began } => {
                let began = *began.get_or_insert(now);
                let arrival = began + samples.front()?.read;
                if arrival > now {
                    return None;
                }
                let sample = samples.pop_front()?;
                Some(Said::Sample {
                    sensor: sample.sensor,
                    orientation: sample.orientation,
                    anew: sample.anew,
                    arrival,
                    taken: Instant::from_nanos(
                        arrival.as_nanos().saturating_sub(nanos(sample.age)),
                    ),
                })
            }
        }
    }

    /// True if nothing more can come.
    fn is_over(&self) -> bool {
        match self {
            Self::Live(_) => false,
            Self::Replay { samples, .. } => samples.is_empty(),
        }
    }
}

fn nanos(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}

/// What one worn sensor said.
#[derive(Clone, Debug, Default)]
struct Heard {
    newest: Option<(DQuat, Instant)>,
    samples: u64,
    history: Vec<(Instant, DQuat)>,
}

/// Sensors on a body, as they are heard.
pub struct Sensors {
    feed: Feed,
    places: Vec<Place>,
    heard: Vec<Heard>,
    by_name: BTreeMap<String, usize>,
    /// Sensors that nobody wears.
    others: BTreeSet<Arc<str>>,
    ended: Option<(String, String)>,
    anew: Vec<Segment>,
    listens: bool,
}

impl Sensors {
    /// Sensors at these places.
    #[must_use]
    pub fn new(places: Vec<Place>, feed: Feed) -> Self {
        let by_name = places.iter().enumerate().map(|(at, place)| (place.sensor.clone(), at));
        Self {
            by_name: by_name.collect(),
            heard: vec![Heard::default(); places.len()],
            places,
            feed,
            others: BTreeSet::new(),
            ended: None,
            anew: Vec::new(),
            listens: false,
        }
    }

    /// Where sensors are worn.
    #[must_use]
    pub fn places(&self) -> &[Place] {
        &self.places
    }

    /// Takes everything that has been said by now.
    pub fn hear(&mut self, now: Instant) {
        while let Some(said) = self.feed.next(now) {
            match said {
                Said::Sample { sensor, orientation, anew, taken, .. } => {
                    let Some(&at) = self.by_name.get(&*sensor) else {
                        self.others.insert(sensor);
                        continue;
                    };
                    self.take(at, orientation, anew, taken);
                }
                Said::Ended { sensor, why } => {
                    if self.by_name.contains_key(&*sensor) && self.ended.is_none() {
                        self.ended = Some((sensor.to_string(), why));
                    }
                }
            }
        }
    }

    fn take(&mut self, at: usize, orientation: Option<DQuat>, anew: bool, taken: Instant) {
        let heard = &mut self.heard[at];
        heard.samples += 1;
        if anew {
            let segment = self.places[at].segment;
            if heard.newest.take().is_some() {
                self.anew.push(segment);
            }
        }
        let Some(orientation) = orientation.filter(|q| q.is_finite()) else { return };
        heard.newest = Some((orientation, taken));
        if self.listens {
            heard.history.push((taken, orientation));
        }
    }

    /// Sensors that nobody wears, by name.
    pub fn others(&self) -> impl Iterator<Item = &str> {
        self.others.iter().map(|name| &**name)
    }

    /// Places whose sensor has said nothing that could be used.
    pub fn silent(&self) -> impl Iterator<Item = &Place> {
        let silent = |(_, heard): &(&Place, &Heard)| heard.newest.is_none();
        self.places.iter().zip(&self.heard).filter(silent).map(|(place, _)| place)
    }

    /// The sensor that ended for good, and why.
    #[must_use]
    pub fn ended(&self) -> Option<&(String, String)> {
        self.ended.as_ref()
    }

    /// True if nothing more can come.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.feed.is_over()
    }

    /// Segments whose sensors began anew since this was asked last: their headings are lost.
    pub fn take_anew(&mut self) -> Vec<Segment> {
        std::mem::take(&mut self.anew)
    }

    /// Newest orientation of each worn segment and when it was taken; `None` for one that says
    /// nothing that can be used.
    #[must_use]
    pub fn newest(&self) -> Vec<(Segment, Option<(DQuat, Instant)>)> {
        let both = self.places.iter().zip(&self.heard);
        both.map(|(place, heard)| (place.segment, heard.newest)).collect()
    }

    /// Names of the worn sensors and how many samples each has sent.
    pub fn samples(&self) -> impl Iterator<Item = (&str, u64)> {
        let both = self.places.iter().zip(&self.heard);
        both.map(|(place, heard)| (place.sensor.as_str(), heard.samples))
    }

    /// Newest orientation by place.
    #[must_use]
    pub fn now(&self) -> Vec<Option<DQuat>> {
        self.heard.iter().map(|heard| heard.newest.map(|(orientation, _)| orientation)).collect()
    }

    /// Begins to keep what is said, and forgets what was kept before.
    pub fn listen(&mut self) {
        self.listens = true;
        for heard in &mut self.heard {
            heard.history.clear();
        }
    }

    /// Keeps nothing more.
    pub fn forget(&mut self) {
        self.listen();
        self.listens = false;
    }

    /// What was said from one moment to another, by place: [`LISTENED_HZ`] samples per second, all
    /// sensors at the same moments. Empty for one that said nothing.
    #[must_use]
    pub fn listened(&self, from: Instant, to: Instant) -> Vec<Vec<DQuat>> {
        let count = (to.seconds_since(from) * LISTENED_HZ).floor().max(0.0) as u32;
        let series = |heard: &Heard| {
            let first = heard.history.partition_point(|(taken, _)| *taken < from);
            let last = heard.history.partition_point(|(taken, _)| *taken <= to);
            let said = heard.history.get(first..last).unwrap_or(&[]);
            if said.is_empty() {
                return Vec::new();
            }
            let at = |n: u32| {
                let moment = from + Duration::from_secs_f64(f64::from(n) / LISTENED_HZ);
                let before = said.partition_point(|(taken, _)| *taken <= moment);
                said[before.saturating_sub(1)].1
            };
            (0..=count).map(at).collect()
        };
        self.heard.iter().map(series).collect()
    }

    /// Samples of a place that were kept between two moments, per second.
    #[must_use]
    pub fn rate_hz(&self, place: usize, from: Instant, to: Instant) -> f64 {
        let history = self.heard.get(place).map_or(&[][..], |heard| &heard.history);
        let within = history.iter().filter(|(taken, _)| (from..=to).contains(taken)).count();
        within as f64 / to.seconds_since(from).max(1e-9)
    }
}
