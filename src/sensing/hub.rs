//! Where all sensors of a session are heard, from its beginning to its end: what runs now, a look at
//! sensors that lie still, somebody who is led through poses, or trials, takes of it what it needs.

use super::event::Said;
use crate::capture::Captured;
use crate::port::MonotonicClock;
use crate::recording::{RecordedSource, Recorder, SourceId, SourceKind, SourceRecord};
use crate::session::still::StillSample;
use crate::session::wearers::wearer;
use crate::time::Instant;
use glam::DQuat;
use std::collections::BTreeMap;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Samples of a sensor that lies still, and how many were lost in between.
pub type Still = (Vec<StillSample>, u64);

/// How a sensor was heard so far.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct HeardSensor {
    /// Samples per second by its profile; 0: nobody knows.
    pub usual_rate_hz: f64,
    /// Samples per second by its own clock, if that is another rate than its profile's.
    pub own_rate_hz: Option<f64>,
    /// Samples that came.
    pub samples: u64,
    /// Samples known to be missing since the first.
    pub missed: u64,
    /// True if its values stand still.
    pub stuck: bool,
    /// When the last one came.
    pub last: Option<Instant>,
    /// How it is turned in its own world, once that is known.
    pub turned: Option<DQuat>,
    /// How often its own world began anew.
    pub anew: u64,
    /// Charge of its battery, 0 to 1, if it tells.
    pub battery: Option<f64>,
    /// How strongly it receives its network, dBm, if it tells.
    pub signal_dbm: Option<i8>,
    /// Why there will be no more of it, or is none just now.
    pub gone: Option<String>,
}

/// Hears all sensors.
pub struct Hub {
    /// Names that sensors go by, by the names they are heard under.
    names: BTreeMap<String, Arc<str>>,
    inner: Mutex<Inner>,
}

#[derive(Default)]
struct Inner {
    listener: Option<Sender<Said>>,
    still: Option<BTreeMap<String, Still>>,
    parts: Vec<Part>,
    heard: BTreeMap<Arc<str>, HeardSensor>,
    ended: BTreeMap<String, String>,
}

/// One subject's recording of a trial that runs now.
struct Part {
    subject: usize,
    recorder: Arc<Recorder>,
    /// Each with the number of its first sample here: a recording counts from zero.
    sources: BTreeMap<String, (SourceId, u64)>,
}

impl Part {
    fn record(&mut self, sensor: &str, mut captured: Captured) {
        let (id, first) = match self.sources.get(sensor) {
            Some(known) => *known,
            None => {
                let (name, metadata) = (sensor.to_owned(), BTreeMap::new());
                let source = RecordedSource { name, metadata, kind: SourceKind::Imu };
                let added = (self.recorder.add_source(source), captured.stamp.number);
                self.sources.insert(sensor.to_owned(), added);
                // What was lost before is no loss of this recording.
                (captured.stamp.missed, captured.stamp.estimated) = (0, 0);
                added
            }
        };
        captured.stamp.number = captured.stamp.number.saturating_sub(first);
        self.recorder.take_record(id, SourceRecord::Sample(Box::new(captured)));
    }
}

impl HeardSensor {
    pub(super) fn take(&mut self, said: &Said, missed: u64) {
        let Said::Sample { orientation, anew, stuck, arrival, .. } = said else { return };
        // What came before is not missing.
        self.missed += if self.samples == 0 { 0 } else { missed };
        self.anew += u64::from(*anew && self.turned.take().is_some());
        self.samples += 1;
        (self.stuck, self.last) = (*stuck, Some(*arrival));
        self.turned = orientation.filter(|turned| turned.is_finite()).or(self.turned);
    }
}

impl HeardSensor {
    pub(super) fn take_line(&mut self, at: Instant) {
        self.samples += 1;
        self.last = Some(at);
    }
}

impl Hub {
    /// Hears these sensors, heard name and name, and no others.
    pub fn of(names: impl Iterator<Item = (String, String)>) -> Self {
        let names = names.map(|(heard, name)| (heard, name.into())).collect();
        Self { names, inner: Mutex::default() }
    }

    fn inner(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes a sample; never waits for a disk.
    pub fn hear(&self, heard: &str, captured: &Captured) {
        let Some(sensor) = self.names.get(heard) else { return };
        let mut inner = self.inner();
        let said = Said::of(sensor, captured, &MonotonicClock);
        inner.heard.entry(Arc::clone(sensor)).or_default().take(&said, captured.stamp.missed);
        if let Some(listener) = &inner.listener {
            // Whoever listened may have heard enough.
            let _ = listener.send(said);
        }
        if let Some(still) = &mut inner.still {
            let (samples, missed) = still.entry(sensor.to_string()).or_default();
            // What came before is not missing.
            *missed += if samples.is_empty() { 0 } else { captured.stamp.missed };
            samples.push(StillSample {
                taken: captured.stamp.taken,
                rate_rad_s: captured.sample.angular_rate_rad_s,
                acceleration_m_s2: captured.sample.acceleration_m_s2,
                orientation: captured
                    .fused
                    .map(|fused| fused.orientation)
                    .or(captured.sample.orientation),
            });
        }
        let by = wearer(sensor).map_or(0, |(by, _)| by);
        if let Some(part) = inner.parts.iter_mut().find(|part| part.subject == by) {
            part.record(sensor, *captured);
        }
    }

    /// Takes what a sensor tells of itself.
    pub fn note(&self, heard: &str, note: impl FnOnce(&mut HeardSensor)) {
        if let Some(sensor) = self.names.get(heard) {
            note(self.inner().heard.entry(Arc::clone(sensor)).or_default());
        }
    }

    /// Takes that there is no more of a sensor, and why.
    pub fn ended(&self, heard: &str, why: &str) {
        let Some(sensor) = self.names.get(heard) else { return };
        let mut inner = self.inner();
        if let Some(listener) = &inner.listener {
            let (sensor, why) = (Arc::clone(sensor), why.to_owned());
            let _ = listener.send(Said::Ended { sensor, why });
        }
        inner.ended.insert(sensor.to_string(), why.to_owned());
    }

    /// Takes that a sensor of which there was to be no more is there again.
    pub fn back(&self, heard: &str) {
        let Some(sensor) = self.names.get(heard) else { return };
        self.inner().ended.remove(&**sensor);
    }

    /// Sensors of which there is no more for now, and why.
    pub fn gone(&self) -> BTreeMap<String, String> {
        self.inner().ended.clone()
    }

    /// How each sensor was heard so far, by name; those that said nothing as well.
    pub fn heard(&self) -> BTreeMap<Arc<str>, HeardSensor> {
        let inner = self.inner();
        let of = |name: &Arc<str>| {
            let heard = inner.heard.get(name).cloned().unwrap_or_default();
            HeardSensor { gone: inner.ended.get(&**name).cloned(), ..heard }
        };
        self.names.values().map(|name| (Arc::clone(name), of(name))).collect()
    }

    /// What is said from now on; whoever listened before hears nothing more.
    pub fn listen(&self) -> Receiver<Said> {
        let (sender, receiver) = channel();
        self.inner().listener = Some(sender);
        receiver
    }

    /// Nobody listens any more.
    pub fn forget(&self) {
        self.inner().listener = None;
    }

    /// Keeps what sensors say that lie still, from now on.
    pub fn begin_still(&self) {
        self.inner().still = Some(BTreeMap::new());
    }

    /// What they said, by name.
    pub fn end_still(&self) -> BTreeMap<String, Still> {
        self.inner().still.take().unwrap_or_default()
    }

    /// Records what this subject's sensors say, from now on.
    pub fn begin_part(&self, subject: usize, recorder: Arc<Recorder>) {
        self.inner().parts.push(Part { subject, recorder, sources: BTreeMap::new() });
    }

    /// Records nothing any more: the recorders are free to be finished.
    pub fn end_parts(&self) {
        self.inner().parts.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::capture::{Order, Stamp};
    use crate::device::sensor::SensorSample;
    use crate::recording::{RunEnd, RunStart, sensor_series, summary};
    use crate::time::Instant;

    fn same<'a>(names: &'a [&str]) -> impl Iterator<Item = (String, String)> + 'a {
        names.iter().map(|name| ((*name).to_owned(), (*name).to_owned()))
    }

    fn captured(n: u64, missed: u64) -> Captured {
        let at = Instant::from_nanos(n * 10_000_000);
        let order = Order::Next;
        let (arrival, taken, estimated) = (at, at, 0);
        let stamp = Stamp { arrival, taken, number: n, step_s: 0.01, missed, estimated, order };
        Captured { stamp, sample: SensorSample::default(), fused: None, stuck: false }
    }

    #[test]
    fn each_of_two_subjects_has_a_recording_of_what_that_subject_wears() {
        let hub = Hub::of(same(&["torso", "2-torso"]));
        let folder = std::env::temp_dir().join(format!("gaitway-hub-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder");
        let recorder = |subject: usize| {
            let start = RunStart {
                robot: String::new(),
                motion: String::new(),
                joints: Vec::new(),
                wall_clock_start: std::time::UNIX_EPOCH,
                monotonic_start: Instant::ZERO,
                gaitway_version: String::new(),
                metadata: BTreeMap::new(),
            };
            let path = folder.join(format!("{subject}.mcap"));
            let recorder = Recorder::create_for_sources(&path, true, start).expect("a file");
            (path, Arc::new(recorder))
        };
        hub.hear("torso", &captured(0, 0));
        let parts = [recorder(0), recorder(1)];
        for (subject, (_, recorder)) in parts.iter().enumerate() {
            hub.begin_part(subject, Arc::clone(recorder));
        }
        for n in 1..=30 {
            hub.hear("torso", &captured(n, 0));
            hub.hear("a neighbour's", &captured(n, 0));
            if n % 3 == 0 {
                hub.hear("2-torso", &captured(100 + n / 3, if n == 3 { 7 } else { 0 }));
            }
        }
        hub.end_parts();
        hub.hear("torso", &captured(31, 0));
        let end = RunEnd {
            outcome: "done".into(),
            stop_reason: None,
            at: Instant::ZERO,
            metadata: BTreeMap::new(),
        };
        for ((path, recorder), (name, count)) in
            parts.into_iter().zip([("torso", 30), ("2-torso", 10)])
        {
            let recorder = Arc::try_unwrap(recorder).expect("the hub has let go");
            assert!(recorder.finish(end.clone()).is_complete());
            let series = sensor_series(&path).expect("read");
            let counts: Vec<_> =
                series.sensors.iter().map(|(n, m)| (n.as_str(), m.len())).collect();
            assert_eq!(counts, [(name, count)]);
            // Numbers begin with the recording, so that nothing seems to be missing before.
            let told = summary(&path).expect("read");
            assert_eq!((told.missed_samples, told.damaged_samples), (0, 0), "{name}");
        }
        let _ = std::fs::remove_dir_all(folder);
    }

    #[test]
    fn what_was_lost_before_sensors_lay_still_is_not_held_against_them() {
        let names = [("tracker-000001-0".to_owned(), "torso".to_owned())];
        let hub = Hub::of(names.into_iter());
        hub.hear("tracker-000001-0", &captured(0, 0));
        hub.begin_still();
        for (n, missed) in [(9, 8), (10, 0), (13, 2)] {
            hub.hear("tracker-000001-0", &captured(n, missed));
        }
        let still = hub.end_still();
        hub.hear("tracker-000001-0", &captured(14, 0));
        assert_eq!((still["torso"].0.len(), still["torso"].1), (3, 2));
        assert!(hub.end_still().is_empty());
    }
}
