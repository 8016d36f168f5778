//! What the sensors that somebody wears say.

use super::{Place, Said};
use crate::body::Segment;
use crate::recording::ReplayedSample;
use crate::time::{Duration, Instant};
use glam::{DQuat, DVec3};
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
                    acceleration_m_s2: sample.acceleration_m_s2,
                    anew: sample.anew,
                    stuck: sample.stuck,
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
    stuck: bool,
    /// It is gone, and waited for.
    gone: bool,
    samples: u64,
    history: Vec<(Instant, DQuat)>,
    /// Sum of what was measured since it was asked last, turned into the sensor's world, m/s^2, and of how many samples.
    forces: (DVec3, u32),
}

impl Heard {
    /// One that is stuck is there, and says what it said last.
    fn still(&mut self, stuck: bool, now: Instant) {
        self.stuck = stuck;
        if let Some((_, taken)) = self.newest.as_mut().filter(|_| stuck) {
            *taken = now;
        }
    }
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
    /// By segment: it may be without its sensor.
    spared: [bool; 13],
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
            spared: [false; 13],
        }
    }

    /// From now on these segments, by index, may be without their sensors for a while: one that is gone and waited for ends
    /// nothing.
    pub fn spare(&mut self, segments: [bool; 13]) {
        self.spared = segments;
    }

    /// True of a segment whose sensor is gone, and waited for.
    #[must_use]
    pub fn is_gone(&self, segment: Segment) -> bool {
        let mut both = self.places.iter().zip(&self.heard);
        both.any(|(place, heard)| place.segment == segment && heard.gone)
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
                Said::Sample {
                    sensor, orientation, acceleration_m_s2, anew, stuck, taken, ..
                } => {
                    let Some(&at) = self.by_name.get(&*sensor) else {
                        self.others.insert(sensor);
                        continue;
                    };
                    self.take(at, orientation.filter(|_| !stuck), anew, taken);
                    if let Some((turned, force)) =
                        orientation.zip(acceleration_m_s2).filter(|_| !stuck)
                    {
                        let (sum, count) = &mut self.heard[at].forces;
                        (*sum, *count) = (*sum + turned * force, *count + 1);
                    }
                    self.heard[at].still(stuck, taken);
                }
                Said::Ended { sensor, why } => self.end(&sensor, why),
                Said::Gone { sensor, why } => match self.by_name.get(&*sensor) {
                    Some(&at) if self.spared[self.places[at].segment.index()] => {
                        self.heard[at].gone = true;
                    }
                    _ => self.end(&sensor, why),
                },
                Said::Back { sensor } => {
                    if let Some(&at) = self.by_name.get(&*sensor) {
                        self.heard[at].gone = false;
                    }
                }
            }
        }
    }

    fn end(&mut self, sensor: &str, why: String) {
        if self.by_name.contains_key(sensor) && self.ended.is_none() {
            self.ended = Some((sensor.to_owned(), why));
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

    /// What each worn segment's accelerometer measured on the mean since this was asked last, turned into the sensor's own world, m/s^2;
    /// `None` of one that said nothing of it.
    pub fn take_forces(&mut self) -> Vec<(Segment, Option<DVec3>)> {
        let mean = |(place, heard): (&Place, &mut Heard)| {
            let (sum, count) = std::mem::take(&mut heard.forces);
            (place.segment, (count > 0).then(|| sum / f64::from(count)))
        };
        self.places.iter().zip(&mut self.heard).map(mean).collect()
    }

    /// Segments whose sensor's values stand still.
    #[must_use]
    pub fn stuck(&self) -> [bool; 13] {
        let mut stuck = [false; 13];
        for (place, heard) in self.places.iter().zip(&self.heard) {
            stuck[place.segment.index()] = heard.stuck;
        }
        stuck
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

    /// What was said from one moment to another, by place: `LISTENED_HZ` samples per second, all
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

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc::{Sender, channel};

    fn place(segment: Segment, sensor: &str) -> Place {
        Place { segment, sensor: sensor.to_owned(), forward: None }
    }

    fn at(seconds: f64) -> Instant {
        Instant::from_nanos((seconds * 1e9).round() as u64)
    }

    fn say(sender: &Sender<Said>, sensor: &str, angle: Option<f64>, anew: bool, taken_s: f64) {
        let said = Said::Sample {
            sensor: sensor.into(),
            orientation: angle.map(DQuat::from_rotation_z),
            acceleration_m_s2: Some(DVec3::X),
            anew,
            stuck: false,
            arrival: at(taken_s),
            taken: at(taken_s),
        };
        sender.send(said).expect("heard");
    }

    fn two() -> (Sensors, Sender<Said>) {
        let (sender, receiver) = channel();
        let places = vec![place(Segment::Torso, "a"), place(Segment::Head, "b")];
        (Sensors::new(places, Feed::Live(receiver)), sender)
    }

    #[test]
    fn who_is_silent_who_nobody_wears_and_who_is_gone_is_known() {
        let (mut sensors, sender) = two();
        say(&sender, "a", Some(0.5), false, 1.0);
        say(&sender, "c", Some(0.5), false, 1.0);
        say(&sender, "b", None, false, 1.0);
        sensors.hear(at(1.0));
        let silent: Vec<Segment> = sensors.silent().map(|place| place.segment).collect();
        assert_eq!(silent, [Segment::Head]);
        assert_eq!(sensors.others().collect::<Vec<_>>(), ["c"]);
        assert_eq!(sensors.ended(), None);
        let gone = |sensor: &str| Said::Ended { sensor: sensor.into(), why: "pulled".to_owned() };
        for name in ["c", "b"] {
            sender.send(gone(name)).expect("heard");
        }
        sensors.hear(at(1.0));
        assert_eq!(sensors.ended(), Some(&("b".to_owned(), "pulled".to_owned())));
    }

    #[test]
    fn a_sensor_that_is_gone_and_waited_for_ends_it_unless_its_segment_is_spared() {
        let (mut sensors, sender) = two();
        let gone = |sensor: &str| Said::Gone { sensor: sensor.into(), why: "pulled".to_owned() };
        let mut spared = [false; 13];
        spared[Segment::Head.index()] = true;
        sensors.spare(spared);
        sender.send(gone("b")).expect("heard");
        sensors.hear(at(1.0));
        assert!(sensors.is_gone(Segment::Head) && sensors.ended().is_none());
        sender.send(Said::Back { sensor: "b".into() }).expect("heard");
        sensors.hear(at(1.0));
        assert!(!sensors.is_gone(Segment::Head));
        sender.send(gone("a")).expect("heard");
        sensors.hear(at(1.0));
        assert_eq!(sensors.ended(), Some(&("a".to_owned(), "pulled".to_owned())));
    }

    /// Its filter settles for a second: a hundred samples that say so are one new beginning.
    #[test]
    fn a_sensor_that_begins_anew_says_nothing_until_it_has_settled_and_is_told_once() {
        let (mut sensors, sender) = two();
        say(&sender, "a", None, true, 0.9);
        say(&sender, "a", Some(0.5), false, 1.0);
        sensors.hear(at(1.0));
        assert!(sensors.take_anew().is_empty(), "the first beginning is none anew");
        for n in 0..100 {
            say(&sender, "a", None, true, 2.0 + f64::from(n) / 100.0);
        }
        sensors.hear(at(3.0));
        assert_eq!(sensors.newest()[0], (Segment::Torso, None));
        say(&sender, "a", Some(0.7), false, 3.1);
        sensors.hear(at(3.1));
        assert_eq!(sensors.take_anew(), [Segment::Torso]);
        assert!(sensors.newest()[0].1.is_some_and(|(_, taken)| taken == at(3.1)));
        // A device that was reset and goes on at once.
        say(&sender, "a", Some(0.0), true, 3.2);
        sensors.hear(at(3.2));
        assert_eq!(sensors.take_anew(), [Segment::Torso]);
    }

    /// It is there, and what it said last is what is known: that it is stuck is told beside it.
    #[test]
    fn a_sensor_that_is_stuck_is_not_silent() {
        let (mut sensors, sender) = two();
        say(&sender, "a", Some(0.5), false, 1.0);
        let (arrival, taken) = (at(1.5), at(1.5));
        let (sensor, orientation) = ("a".into(), Some(DQuat::from_rotation_z(2.0)));
        let said = Said::Sample {
            sensor,
            orientation,
            acceleration_m_s2: None,
            anew: false,
            stuck: true,
            arrival,
            taken,
        };
        sender.send(said).expect("heard");
        sensors.hear(at(1.5));
        assert_eq!(sensors.newest()[0].1, Some((DQuat::from_rotation_z(0.5), at(1.5))));
        assert!(sensors.stuck()[Segment::Torso.index()]);
        say(&sender, "a", Some(0.6), false, 1.6);
        sensors.hear(at(1.6));
        assert!(!sensors.stuck()[Segment::Torso.index()]);
    }

    /// 100 and 40 samples per second become 60 of both, at the same moments.
    #[test]
    fn what_was_listened_to_is_the_newest_of_each_sensor_at_even_moments() {
        let (mut sensors, sender) = two();
        sensors.listen();
        for n in 0..200 {
            let time_s = 1.0 + f64::from(n) / 100.0;
            say(&sender, "a", Some(time_s), false, time_s);
        }
        for n in 0..80 {
            let time_s = 1.0 + f64::from(n) / 40.0;
            say(&sender, "b", Some(time_s), false, time_s);
        }
        sensors.hear(at(3.0));
        let said = sensors.listened(at(1.5), at(2.5));
        assert_eq!([said[0].len(), said[1].len()], [61, 61]);
        for (n, (a, b)) in said[0].iter().zip(&said[1]).enumerate() {
            let moment = 1.5 + n as f64 / LISTENED_HZ;
            for (said, period_s) in [(a, 0.01), (b, 0.025)] {
                let behind = moment - 2.0 * said.z.atan2(said.w);
                assert!((-1e-6..period_s + 1e-6).contains(&behind), "{n}: {behind}");
            }
        }
        assert!((sensors.rate_hz(0, at(1.5), at(2.5)) - 100.0).abs() < 2.0);
        assert!((sensors.rate_hz(1, at(1.5), at(2.5)) - 40.0).abs() < 2.0);
        sensors.forget();
        assert!(sensors.listened(at(1.5), at(2.5)).iter().all(Vec::is_empty));
    }

    #[test]
    fn a_recording_speaks_at_its_own_pace_from_when_it_is_first_asked() {
        let sample = |read_ms: u64| ReplayedSample {
            sensor: "a".into(),
            orientation: Some(DQuat::IDENTITY),
            acceleration_m_s2: None,
            anew: false,
            stuck: false,
            read: Duration::from_millis(read_ms),
            age: Duration::from_millis(4),
        };
        let samples = [0, 10, 20, 1000].map(sample);
        let places = vec![place(Segment::Torso, "a")];
        let mut sensors = Sensors::new(places, Feed::replay(samples.into()));
        let mut heard = |now_s: f64| {
            sensors.hear(at(now_s));
            (
                sensors.samples().next().map(|(_, count)| count),
                sensors.newest()[0].1,
                sensors.is_over(),
            )
        };
        assert_eq!(heard(50.0), (Some(1), Some((DQuat::IDENTITY, at(49.996))), false));
        assert_eq!(heard(50.015).0, Some(2));
        assert_eq!(heard(50.9), (Some(3), Some((DQuat::IDENTITY, at(50.016))), false));
        assert_eq!(heard(51.0), (Some(4), Some((DQuat::IDENTITY, at(50.996))), true));
    }
}
