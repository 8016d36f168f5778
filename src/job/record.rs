//! Sensors, lines of text and hand-guided servos into one recording.

use super::heard::Rates;
use super::observer::RecordingNow;
use super::record_doubts::{DoubtTally, RecordDoubts};
use super::report::counted;
use super::taught::Servos;
use super::{Event, Observer};
use crate::body::segment_name;
use crate::error::Error;
use crate::port::{Clock, MonotonicClock};
use crate::recording::{
    Marker, RecordedSource, Recorder, RunEnd, RunStart, SampleEncoding, SourceId, SourceKind,
    SourceRecord,
};
use crate::rig::BusKind;
use crate::sensing::{Intake, LOOK, Place, SensingEvent, Source, SourceReport, Wear, What};
use crate::session::files::WORN_KEY;
use crate::time::{Duration, Instant};
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, channel};

pub use crate::capture::Mode;

/// What is recorded, and where.
#[derive(Clone, Debug)]
pub struct RecordOrder {
    /// What to record.
    pub sources: Vec<Source>,
    /// Which of the sensors somebody wears, and where; kept in the recording.
    pub worn: Vec<Place>,
    /// The recording.
    pub file: PathBuf,
    /// It may replace one that is there.
    pub replace: bool,
    /// End after this time; `None`: when the observer wants to.
    pub time: Option<Duration>,
    /// Name of the trial.
    pub name: String,
    /// Whether headings are taken from the magnetic field.
    pub mode: Mode,
    /// Readings of servos per second, Hz.
    pub rate_hz: f64,
    /// Switch the servos' torque off first.
    pub limp: bool,
    /// How samples of sensors are written.
    pub samples: SampleEncoding,
}

/// What came of it.
#[derive(Clone, Debug, Serialize)]
pub struct RecordReport {
    /// None if nothing came, and what was to be replaced is as it was.
    pub file: Option<PathBuf>,
    /// `done` or `done_with_loss`.
    pub outcome: &'static str,
    /// Length, s.
    pub duration_s: f64,
    /// What came of each source.
    pub sources: Vec<SourceReport>,
    /// Of sensors that are worn, by name, how often and for how long they said what nobody can do; those alone that did.
    pub doubted: BTreeMap<String, DoubtTally>,
    /// Messages stored.
    pub messages: u64,
    /// Messages that are not stored: refused by the full queue, or lost by a disk that failed.
    pub dropped: u64,
    /// Those refused by the full queue, by topic.
    pub dropped_by_topic: BTreeMap<String, u64>,
    /// Why writing ended early, if it did.
    pub poisoned: Option<String>,
}

impl RecordReport {
    /// True if nothing is missing in the recording.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        self.outcome == DONE
    }
}

/// Whoever ends a recording waits for a slow disk no longer than this and one more piece of the file.
pub(super) const DISK_PATIENCE: Duration = Duration::from_secs(3);

/// How often it is told how the recording goes.
const TOLD: Duration = Duration::from_millis(500);

const DONE: &str = "done";
const WITH_LOSS: &str = "done_with_loss";

/// Fails if two sources were given one name: nobody could tell afterwards which was which.
fn check_names(sources: &[Source]) -> Result<(), Error> {
    for (at, source) in sources.iter().enumerate() {
        let is_same = |other: &&Source| source.name.is_some() && other.name == source.name;
        if let Some(other) = sources[..at].iter().find(is_same) {
            return Err(Error::new("two sources have one name")
                .at(source.text.clone())
                .got(other.text.clone())
                .remedy("give each its own name before the ="));
        }
    }
    Ok(())
}

/// Fails if nothing is recorded, or one port is to be read twice.
fn check_ports(sources: &[Source]) -> Result<(), Error> {
    if sources.is_empty() {
        return Err(Error::new("there is nothing to record")
            .allowed("sources, or a file of --wear with segments that wear sensors"));
    }
    let port = |source: &Source| match &source.what {
        What::Imu { address, .. } | What::Lines { address } => match &address.bus {
            BusKind::Serial { path, .. } => Some(path.clone()),
            _ => None,
        },
        _ => None,
    };
    for (at, source) in sources.iter().enumerate() {
        let is_same = |other: &&Source| port(other).is_some() && port(other) == port(source);
        if let Some(other) = sources[..at].iter().find(is_same) {
            return Err(Error::new("two sources are on one port")
                .at(source.text.clone())
                .got(other.text.clone())
                .remedy("each sensor has a port of its own: `gaitway ports` lists them"));
        }
    }
    Ok(())
}

/// The worn sensors that no source is named like: trackers and bodies, which name themselves.
fn trackers(order: &RecordOrder) -> Result<Vec<String>, Error> {
    let source_of = |place: &Place| {
        order.sources.iter().find(|source| source.name.as_ref() == Some(&place.sensor))
    };
    for source in order.worn.iter().filter_map(source_of) {
        source.check_wearable()?;
    }
    let mut others = order.worn.iter().filter(|place| source_of(place).is_none()).peekable();
    let name_themselves = |source: &Source| matches!(source.what, What::Trackers { .. });
    if let Some(place) = others.peek().filter(|_| !order.sources.iter().any(name_themselves)) {
        return Err(Error::new("no source brings a sensor that is worn")
            .at(segment_name(place.segment))
            .got(place.sensor.clone())
            .allowed("the name of a source (NAME=imu:PROFILE@BUS), or of a tracker that imu:slimevr@udp:0.0.0.0:6969 hears"));
    }
    Ok(others.map(|place| place.sensor.clone()).collect())
}

/// Records until the time is over, the observer wants to stop, all sources are gone or the disk fails. `marks` that come
/// meanwhile are recorded with their own times, those that came before with that of the beginning.
///
/// # Errors
/// A source that cannot be opened, a file that cannot be written.
pub fn record(
    order: &RecordOrder,
    marks: &Receiver<Marker>,
    observer: &dyn Observer,
) -> Result<RecordReport, Error> {
    check_names(&order.sources)?;
    check_ports(&order.sources)?;
    let trackers = trackers(order)?;
    let mut opened = Vec::new();
    let mut joints = None;
    for source in &order.sources {
        match &source.what {
            What::Servos { robot, addresses } => {
                let one = Servos::open(robot, addresses, order.rate_hz, order.limp)?;
                if joints.replace(one).is_some() {
                    return Err(Error::new("one robot at a time").at(source.text.clone()));
                }
            }
            _ => opened.push(source.open(&trackers)?),
        }
    }
    let recorder =
        Recorder::create_for_sources(&order.file, order.replace, start(order, joints.as_ref())?)?;
    recorder.write_samples_as(order.samples);
    let began = MonotonicClock.now();
    observer.hear(Event::Note(&begins(order)));
    let stop = AtomicBool::new(false);
    let tell = |event: SensingEvent<'_>| observer.hear(Event::Sensing(event));
    let (listener, said) = channel();
    let intake = Intake::new(Some(&recorder), &stop, order.mode, &tell).patient();
    // Of what nobody wears nobody knows what it can do.
    let intake = match order.worn.is_empty() {
        true => intake,
        false => intake.heard_by(listener, Arc::new(MonotonicClock)),
    };
    let mut doubts = RecordDoubts::new(&order.worn, said, began);
    let left = AtomicUsize::new(opened.len() + usize::from(joints.is_some()));
    std::thread::scope(|scope| {
        let (intake, left) = (&intake, &left);
        for source in opened {
            scope.spawn(move || {
                source.record(intake);
                left.fetch_sub(1, Ordering::Release);
            });
        }
        if let Some(joints) = joints {
            scope.spawn(move || {
                joints.record(intake, observer);
                left.fetch_sub(1, Ordering::Release);
            });
        }
        let goes_on = |now: Instant| {
            doubts.look(now, observer);
            left.load(Ordering::Acquire) > intake.away()
        };
        wait(order, marks, &recorder, observer, began, intake, goes_on);
        stop.store(true, Ordering::Release);
    });
    let sources = intake.into_reports();
    Ok(finish(order, recorder, sources, doubts.tallies(), began))
}

/// What is said when all sources are open: nothing else tells that it has begun.
fn begins(order: &RecordOrder) -> String {
    let sources = counted(order.sources.len(), "source");
    let by_hand = if order.limp { "; torque is off, the joints can be led by hand" } else { "" };
    match order.time {
        Some(time) => format!("recording {sources} for {:.1} s{by_hand}", time.as_secs_f64()),
        None => format!("recording {sources} until it is stopped{by_hand}"),
    }
}

fn start(order: &RecordOrder, joints: Option<&Servos>) -> Result<RunStart, Error> {
    let mut metadata = BTreeMap::from([("trial".to_owned(), order.name.clone())]);
    if !order.worn.is_empty() {
        metadata.insert(WORN_KEY.to_owned(), Wear::text_of(&order.worn)?);
    }
    Ok(RunStart {
        robot: joints.map_or_else(String::new, |servos| servos.robot_name().to_owned()),
        motion: order.name.clone(),
        joints: joints.map(Servos::recorded_joints).unwrap_or_default(),
        wall_clock_start: std::time::SystemTime::now(),
        monotonic_start: MonotonicClock.now(),
        gaitway_version: env!("CARGO_PKG_VERSION").to_owned(),
        metadata,
    })
}

fn wait(
    order: &RecordOrder,
    marks: &Receiver<Marker>,
    recorder: &Recorder,
    observer: &dyn Observer,
    began: Instant,
    intake: &Intake<'_>,
    mut goes_on: impl FnMut(Instant) -> bool,
) {
    let until = order.time.map(|time| began + time);
    let mut marked = None;
    let mut mark_before = None;
    let mut rates = Rates::default();
    let mut told_at = began;
    loop {
        let now = MonotonicClock.now();
        while let Ok(mark) = marks.try_recv() {
            // One that was set while sources were opened is one of the beginning.
            let mark = Marker { at: mark.at.max(began), ..mark };
            let at_s = mark.at.seconds_since(began);
            observer.hear(Event::Note(&format!("marked at {at_s:.1} s: {}", mark.text)));
            // A recording without marks has no channel for them.
            let source: SourceId = *marked.get_or_insert_with(|| {
                recorder.add_source(RecordedSource {
                    name: "marks".to_owned(),
                    metadata: BTreeMap::new(),
                    kind: SourceKind::Marks,
                })
            });
            mark_before = Some((at_s, mark.text.clone()));
            recorder.take_record(source, SourceRecord::Mark(mark));
        }
        if now >= told_at {
            told_at = now + TOLD;
            observer.hear(Event::Recording(&RecordingNow {
                time_s: now.seconds_since(began),
                of_s: order.time.map(|time| time.as_secs_f64()),
                ended_by: "Ctrl-C",
                sources: rates.of_all(intake.heard(), now),
                mark: mark_before.clone(),
                note: String::new(),
                dropped: recorder.dropped().values().sum(),
            }));
        }
        if let Some(cause) = recorder.failure() {
            // Nothing more can be stored, so whoever performs is told at once and not at the end.
            let words = format!("the recording ends here, the disk fails: {cause}");
            return observer.hear(Event::Note(&words));
        }
        if observer.wants_to_stop() || until.is_some_and(|until| now >= until) {
            return;
        }
        if !goes_on(now) {
            return observer.hear(Event::Note("all sources are gone: the recording ends here"));
        }
        let next = now + LOOK;
        MonotonicClock.sleep_until(until.map_or(next, |until| until.min(next)));
    }
}

fn finish(
    order: &RecordOrder,
    recorder: Recorder,
    sources: Vec<SourceReport>,
    doubted: BTreeMap<String, DoubtTally>,
    began: Instant,
) -> RecordReport {
    let ended = MonotonicClock.now();
    let dropped_by_topic = recorder.dropped();
    let lossless = sources.iter().all(SourceReport::lossless) && !sources.is_empty();
    let lossless = lossless && dropped_by_topic.is_empty();
    let metadata = sources.iter().filter_map(|source| {
        Some((format!("source {}", source.name), serde_json::to_string(source).ok()?))
    });
    let end = RunEnd {
        outcome: if lossless { DONE } else { WITH_LOSS }.to_owned(),
        stop_reason: None,
        at: ended,
        metadata: metadata.collect(),
    };
    let summary = recorder.finish_within(end, DISK_PATIENCE);
    let is_whole = lossless && summary.is_complete();
    RecordReport {
        file: (!summary.kept_old).then(|| order.file.clone()),
        outcome: if is_whole { DONE } else { WITH_LOSS },
        duration_s: ended.seconds_since(began),
        sources,
        doubted,
        messages: summary.messages,
        dropped: summary.dropped.values().sum::<u64>() + summary.lost,
        dropped_by_topic,
        poisoned: summary.poisoned,
    }
}
