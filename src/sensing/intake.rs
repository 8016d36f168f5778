//! Where the samples of all sources go, and what came of each source.

use super::event::{Said, SensingEvent, Tell};
use super::hub::{HeardSensor, Hub};
use crate::capture::{Captured, Chain, Counts, Mode, Quality, is_another};
use crate::port::{Clock, MonotonicClock};
use crate::recording::{CycleRecord, RecordedSource, Recorder, SourceId, SourceKind, SourceRecord};
use crate::time::Instant;
use serde::Serialize;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::Sender;
use std::sync::{Arc, Mutex, PoisonError};

/// What became of one source.
#[derive(Clone, Debug, Default, Serialize)]
pub struct SourceReport {
    /// Name of the sensor.
    pub name: String,
    /// What its timeline has seen.
    pub counts: Counts,
    /// Samples per second, as the device's own clock tells; `None` where it has none, or its samples agree on no rate.
    pub rate_hz: Option<f64>,
    /// Samples per second by its profile; `None` where no clock has told another, or the same.
    pub profile_rate_hz: Option<f64>,
    /// Samples that lacked a required part.
    pub incomplete: u64,
    /// Samples in which the values stood still while number or time went on.
    pub stuck: u64,
    /// Bytes that belonged to no packet.
    pub stray_bytes: u64,
    /// Beginnings of packets that were none.
    pub bad_packets: u64,
    /// Drift of the device's clock against the host's, parts per million.
    pub skew_ppm: f64,
    /// 99 % of the samples were read within this time after they were taken, less the constant part.
    pub late_p99_s: f64,
    /// Trackers that called and were not heard, told once for all of a socket.
    pub refused: u64,
    /// How often it was gone and came back.
    pub gone: u64,
    /// For how long, s.
    pub gone_s: f64,
    /// Why it ended early.
    pub ended: Option<String>,
}

impl SourceReport {
    /// What the chain of a sensor has seen.
    pub fn of(name: &str, chain: &Chain) -> Self {
        let Quality { skew_ppm, late_p99_s, .. } = chain.timeline().quality();
        Self {
            name: name.to_owned(),
            counts: chain.timeline().counts(),
            rate_hz: chain.rate_hz(),
            profile_rate_hz: chain.rate_hz().map(|_| chain.profile_rate_hz()),
            incomplete: chain.incomplete(),
            stuck: chain.stuck_samples(),
            skew_ppm,
            late_p99_s,
            ..Self::default()
        }
    }

    /// True if nothing is known to be missing. What is only estimated is not known.
    pub fn lossless(&self) -> bool {
        let counts = self.counts;
        let lost = counts.missed + counts.late + counts.resets + self.incomplete + self.stuck;
        lost == 0 && self.gone == 0 && self.ended.is_none() && counts.samples > 0
    }
}

/// A source that was given a name.
#[derive(Clone, Debug)]
pub struct Named {
    pub name: Arc<str>,
    id: Option<SourceId>,
    /// Which of all sources it is.
    at: usize,
}

/// Ends the readers however their owner ends.
pub struct StopAtEnd<'a>(pub &'a AtomicBool);

impl Drop for StopAtEnd<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Release);
    }
}

/// What every source's thread shares.
pub struct Intake<'a> {
    recorder: Option<&'a Recorder>,
    listener: Option<(Sender<Said>, Arc<dyn Clock>)>,
    hub: Option<&'a Hub>,
    stop: &'a AtomicBool,
    pub(super) mode: Mode,
    pub(super) tell: Tell<'a>,
    names: Mutex<BTreeMap<String, u32>>,
    heard: Mutex<Vec<(Arc<str>, HeardSensor)>>,
    reports: Mutex<Vec<SourceReport>>,
    /// Sources that are gone are waited for.
    patient: bool,
    away: AtomicUsize,
}

impl<'a> Intake<'a> {
    /// Samples go to a recorder, if there is one, until `stop`; `tell` hears what happens.
    pub fn new(
        recorder: Option<&'a Recorder>,
        stop: &'a AtomicBool,
        mode: Mode,
        tell: Tell<'a>,
    ) -> Self {
        let (names, heard, reports) = Default::default();
        let (patient, away) = Default::default();
        let (listener, hub) = (None, None);
        Self { recorder, listener, hub, stop, mode, tell, names, heard, reports, patient, away }
    }

    /// Waits for sources that are gone, and takes them up again when they are back.
    #[must_use]
    pub fn patient(mut self) -> Self {
        self.patient = true;
        self
    }

    /// True if sources that are gone are waited for.
    pub fn is_patient(&self) -> bool {
        self.patient && !self.stopped()
    }

    /// How each source is heard so far, in the order in which they were added.
    pub fn heard(&self) -> Vec<(Arc<str>, HeardSensor)> {
        self.heard.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn note(&self, source: &Named, note: impl FnOnce(&mut HeardSensor)) {
        let mut heard = self.heard.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, now)) = heard.get_mut(source.at) {
            note(now);
        }
    }

    /// Notes it for a session as well.
    fn note_all(&self, source: &Named, note: impl Fn(&mut HeardSensor)) {
        self.note(source, &note);
        if let Some(hub) = self.hub {
            hub.note(&source.name, &note);
        }
    }

    /// A source speaks so many times a second by its profile; 0: nobody knows.
    pub fn expects(&self, source: &Named, usual_rate_hz: f64) {
        self.note(source, |now| now.usual_rate_hz = usual_rate_hz);
    }

    /// Takes how often a source samples by its own clock, and says so if that is another rate than what was known.
    pub fn samples_at(&self, source: &Named, chain: &Chain, told_hz: &mut f64) {
        let Some(rate_hz) = chain.rate_hz().filter(|rate_hz| is_another(*rate_hz, *told_hz)) else {
            return;
        };
        *told_hz = rate_hz;
        let profile_rate_hz = chain.profile_rate_hz();
        let is_other = is_another(rate_hz, profile_rate_hz);
        self.note(source, |now| now.own_rate_hz = is_other.then_some(rate_hz));
        let sensor = &*source.name;
        (self.tell)(SensingEvent::Rate { sensor, rate_hz, profile_rate_hz });
    }

    /// Takes how full the battery of a source is, 0 to 1.
    pub fn battery(&self, source: &Named, level: f64) {
        self.note_all(source, |now| now.battery = Some(level));
    }

    /// Takes how strongly a source receives its network, dBm.
    pub fn signal(&self, source: &Named, dbm: i8) {
        self.note_all(source, |now| now.signal_dbm = Some(dbm));
    }

    /// How many sources are gone now, and waited for.
    pub fn away(&self) -> usize {
        self.away.load(Ordering::Acquire)
    }

    /// Says at once that a source is gone; it is waited for.
    pub fn gone(&self, source: &Named, why: &str) {
        self.away.fetch_add(1, Ordering::Release);
        self.note(source, |now| now.gone = Some(why.to_owned()));
        (self.tell)(SensingEvent::Gone { sensor: &source.name, why });
        if let Some(hub) = self.hub {
            hub.ended(&source.name, why);
        }
        if let Some((listener, _)) = &self.listener {
            let (sensor, why) = (Arc::clone(&source.name), why.to_owned());
            // Nobody listens any more: the end is near, and `stopped` says so.
            let _ = listener.send(Said::Gone { sensor, why });
        }
    }

    /// Says that it is back after so many seconds; `None`: nobody waits any more.
    pub fn back(&self, source: &Named, gone_s: Option<f64>) {
        self.away.fetch_sub(1, Ordering::Release);
        let Some(gone_s) = gone_s else { return };
        self.note(source, |now| now.gone = None);
        (self.tell)(SensingEvent::Back { sensor: &source.name, gone_s });
        if let Some(hub) = self.hub {
            hub.back(&source.name);
        }
        if let Some((listener, _)) = &self.listener {
            // As above.
            let _ = listener.send(Said::Back { sensor: Arc::clone(&source.name) });
        }
    }

    /// Lets somebody listen as well, whose clock this is: what it hears has moments of that.
    #[must_use]
    pub fn heard_by(mut self, listener: Sender<Said>, clock: Arc<dyn Clock>) -> Self {
        self.listener = Some((listener, clock));
        self
    }

    /// Lets a session hear all of every sample.
    #[must_use]
    pub fn heard_by_hub(mut self, hub: &'a Hub) -> Self {
        self.hub = Some(hub);
        self
    }

    /// True once sources are to end.
    pub fn stopped(&self) -> bool {
        self.stop.load(Ordering::Acquire)
    }

    /// Adds a source under a name that no other has.
    pub fn add(&self, wanted: &str, kind: SourceKind, metadata: &[(&str, &str)]) -> Named {
        let mut names = self.names.lock().unwrap_or_else(PoisonError::into_inner);
        let count = names.entry(wanted.to_owned()).or_insert(0);
        *count += 1;
        let name = match *count {
            1 => wanted.to_owned(),
            n => format!("{wanted}-{n}"),
        };
        let metadata =
            metadata.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect();
        let source = RecordedSource { name: name.clone(), metadata, kind };
        let id = self.recorder.map(|recorder| recorder.add_source(source));
        let name: Arc<str> = name.into();
        let mut heard = self.heard.lock().unwrap_or_else(PoisonError::into_inner);
        heard.push((Arc::clone(&name), HeardSensor::default()));
        Named { name, id, at: heard.len() - 1 }
    }

    /// Takes a sample of a sensor; never waits.
    pub fn take(&self, source: &Named, captured: Captured) {
        let said = Said::of(&source.name, &captured, &MonotonicClock);
        self.note(source, |now| now.take(&said, captured.stamp.missed));
        if let Some(hub) = self.hub {
            hub.hear(&source.name, &captured);
        }
        if let Some((listener, clock)) = &self.listener {
            // Nobody listens any more: the end is near, and `stopped` says so.
            let _ = listener.send(Said::of(&source.name, &captured, &**clock));
        }
        if let (Some(recorder), Some(id)) = (self.recorder, source.id) {
            recorder.take_record(id, SourceRecord::Sample(Box::new(captured)));
        }
    }

    /// Takes a line of text; never waits.
    pub fn take_line(&self, source: &Named, at: Instant, text: String) {
        self.note(source, |now| now.take_line(at));
        if let (Some(recorder), Some(id)) = (self.recorder, source.id) {
            recorder.take_record(id, SourceRecord::Line(at, text));
        }
    }

    /// Takes a cycle of a robot; never waits.
    pub fn take_cycle(&self, record: CycleRecord) {
        if let Some(recorder) = self.recorder {
            recorder.take(record);
        }
    }

    /// Says at once that a robot's joints are not read any more.
    pub fn ended_early(&self, name: &str, why: &str) {
        (self.tell)(SensingEvent::Gone { sensor: name, why });
    }

    /// Says at once that a source has ended early.
    pub fn ended(&self, source: &Named, why: &str) {
        self.note(source, |now| now.gone = Some(why.to_owned()));
        (self.tell)(SensingEvent::Gone { sensor: &source.name, why });
        if let Some(hub) = self.hub {
            hub.ended(&source.name, why);
        }
        if let Some((listener, _)) = &self.listener {
            let (sensor, why) = (Arc::clone(&source.name), why.to_owned());
            let _ = listener.send(Said::Ended { sensor, why });
        }
    }

    /// Takes what became of a source.
    pub fn report(&self, report: SourceReport) {
        self.reports.lock().unwrap_or_else(PoisonError::into_inner).push(report);
    }

    /// What became of all sources, in the order in which they ended.
    pub fn into_reports(self) -> Vec<SourceReport> {
        self.reports.into_inner().unwrap_or_else(PoisonError::into_inner)
    }
}
