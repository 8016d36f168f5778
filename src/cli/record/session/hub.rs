//! Where all sensors of a session are heard, from its beginning to its end: what runs now, a look at
//! sensors that lie still, somebody who is led through poses, or trials, takes of it what it needs.

use crate::capture::Captured;
use crate::cli::record::intake::Said;
use crate::recording::{RecordedSource, Recorder, SourceId, SourceKind, SourceRecord};
use crate::session::still::StillSample;
use crate::session::wearers::wearer;
use std::collections::BTreeMap;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Samples of a sensor that lies still, and how many were lost in between.
pub type Still = (Vec<StillSample>, u64);

/// Hears all sensors.
#[derive(Default)]
pub struct Hub(Mutex<Inner>);

#[derive(Default)]
struct Inner {
    listener: Option<Sender<Said>>,
    still: Option<BTreeMap<String, Still>>,
    parts: Vec<Part>,
    ended: BTreeMap<String, String>,
}

/// One subject's recording of a trial that runs now.
struct Part {
    subject: usize,
    recorder: Arc<Recorder>,
    sources: BTreeMap<String, SourceId>,
}

impl Hub {
    fn inner(&self) -> MutexGuard<'_, Inner> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes a sample; never waits for a disk.
    pub fn hear(&self, sensor: &Arc<str>, captured: &Captured) {
        let mut inner = self.inner();
        if let Some(listener) = &inner.listener {
            // Whoever listened may have heard enough.
            let _ = listener.send(Said::of(sensor, captured));
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
            let name: &str = sensor;
            let id = match part.sources.get(name) {
                Some(id) => *id,
                None => {
                    let source = RecordedSource {
                        name: name.to_owned(),
                        metadata: BTreeMap::new(),
                        kind: SourceKind::Imu,
                    };
                    let id = part.recorder.add_source(source);
                    part.sources.insert(name.to_owned(), id);
                    id
                }
            };
            part.recorder.take_record(id, SourceRecord::Sample(Box::new(*captured)));
        }
    }

    /// Takes that there will be no more of a sensor, and why.
    pub fn ended(&self, sensor: &Arc<str>, why: &str) {
        let mut inner = self.inner();
        if let Some(listener) = &inner.listener {
            let (sensor, why) = (Arc::clone(sensor), why.to_owned());
            let _ = listener.send(Said::Ended { sensor, why });
        }
        inner.ended.insert(sensor.to_string(), why.to_owned());
    }

    /// Sensors of which there will be no more, and why.
    pub fn gone(&self) -> BTreeMap<String, String> {
        self.inner().ended.clone()
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
