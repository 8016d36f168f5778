//! Trials: explained, practised, recorded, judged.

use super::Job;
use super::happening::{CutShort, Happening};
use super::judge::{BAD, GOOD, judge};
use super::operator::{Answered, During, Mark, Mend, Ready, Wish};
use super::{device, setup, subject};
use crate::body::anthropometry::{Measure, Subject};
use crate::body::worn::kept::Kept;
use crate::error::Error;
use crate::job::record::DISK_PATIENCE;
use crate::recording::{
    Marker, RecordedSource, Recorder, RunEnd, RunStart, SourceId, SourceKind, SourceRecord,
};
use crate::sensing::{Clock, Ended, HeardSensor, MonotonicClock};
use crate::session::PlannedAction;
use crate::session::files::{BODY_KEY, LEGS_KEY, STATURE_KEY, trial_name};
use crate::session::wearers::wearer;
use crate::time::{Duration, Instant};
use std::collections::BTreeMap;
use std::sync::Arc;

/// How often it is looked at the disk and the sensors while nothing is said.
const LOOK: Duration = Duration::from_millis(50);

/// A sensor that said nothing for so long is gone: of a tracker without a wire nothing else tells.
const MOST_SILENT: Duration = Duration::from_secs(3);

/// How sensors have been silent, while somebody looked.
#[derive(Default)]
struct Silences(BTreeMap<Arc<str>, Silence>);

/// How a sensor has been silent; for no time unless it has spoken since somebody looked first.
struct Silence {
    last: Option<Instant>,
    silent: Option<Duration>,
}

impl Silences {
    /// A look, so long after the one before; who has said nothing for [`MOST_SILENT`].
    fn look(
        &mut self,
        heard: impl Iterator<Item = (Arc<str>, HeardSensor)>,
        after: Duration,
    ) -> Option<Arc<str>> {
        // While the host stood, nobody could hear anybody.
        let after = after.min(2 * LOOK);
        let mut gone = None;
        for (name, sensor) in heard {
            let begun = Silence { last: sensor.last, silent: None };
            let of = self.0.entry(Arc::clone(&name)).or_insert(begun);
            of.silent = match of.last == sensor.last {
                true => of.silent.map(|silent| silent + after),
                false => Some(Duration::ZERO),
            };
            of.last = sensor.last;
            if of.silent.is_some_and(|silent| silent >= MOST_SILENT) {
                gone.get_or_insert(name);
            }
        }
        gone
    }
}

/// One subject's recording, and where its marks go.
type Part = (Arc<Recorder>, SourceId);

/// Leads to one more trial of an action by these subjects.
pub(super) fn trial(
    job: &mut Job,
    action: usize,
    number: u32,
    subjects: &[String],
) -> Result<(), Ended> {
    let plan = &job.session()?.plan;
    let planned = plan.actions[action].clone();
    job.operator.hear(Happening::NextTrial {
        number: action + 1,
        total: plan.actions.len(),
        action: &planned,
        subjects,
        good: job.progress.good_by(&planned.name, subjects),
        wanted: plan.wanted(&planned),
    });
    let name = trial_name(&planned.name, number);
    match wish(job, &planned, &name, subjects)? {
        Wish::Record => {}
        Wish::Devices => return device::calibrate(job),
        Wish::Subjects => {
            for id in subjects {
                subject::calibrate(job, id)?;
            }
            return Ok(());
        }
        Wish::Edit => return setup::edit(job, subjects),
        Wish::GiveUp => {
            let mut session = job.session()?.clone();
            session.skipped.push(planned.name);
            job.folder.replace("session.toml", &session)?;
            return Ok(());
        }
    }
    let mut worn = Vec::new();
    for id in subjects {
        worn.push(facing(job, id)?);
    }
    record(job, &planned, &name, subjects, &worn)?;
    job.reload()?;
    judge(job, &name)
}

/// The first time an action is explained and practised before it is recorded.
fn wish(job: &Job, planned: &PlannedAction, trial: &str, subjects: &[String]) -> Answered<Wish> {
    if !job.progress.has_tried(&planned.name, subjects) {
        job.operator.ready(Ready::Explained)?;
        job.operator.ready(Ready::Practised)?;
    }
    job.operator.wish(trial)
}

/// N pose, until it is one.
fn facing(job: &mut Job, id: &str) -> Result<Kept, Ended> {
    loop {
        match subject::face_forward(job, id) {
            Err(Ended::Failed(error)) => match job.operator.mend(&error)? {
                Mend::Again => {}
                Mend::Calibrate => subject::calibrate(job, id)?,
            },
            done => return done,
        }
    }
}

/// Records what the subjects do until the operator ends it.
fn record(
    job: &Job,
    planned: &PlannedAction,
    name: &str,
    subjects: &[String],
    worn: &[Kept],
) -> Result<(), Ended> {
    let mut parts: Vec<Part> = Vec::new();
    for (id, kept) in subjects.iter().zip(worn) {
        let stem = if subjects.len() > 1 { format!("{name}.{id}") } else { name.to_owned() };
        let path = job.folder.path(&format!("trials/{stem}.mcap"));
        let start = start(job, planned, name, id, kept)?;
        let recorder = Arc::new(Recorder::create_for_sources(&path, false, start)?);
        recorder.write_samples_as(job.samples);
        let marks = recorder.add_source(RecordedSource {
            name: "marks".to_owned(),
            metadata: BTreeMap::new(),
            kind: SourceKind::Marks,
        });
        parts.push((recorder, marks));
    }
    let by: Vec<usize> = subjects.iter().map(|id| job.number_of(id)).collect();
    for (by, (recorder, _)) in by.iter().zip(&parts) {
        job.hub.begin_part(*by, Arc::clone(recorder));
    }
    job.operator.hear(Happening::Recording { trial: name });
    let ended = listen(job, &parts, &by);
    job.hub.end_parts();
    let outcome = if ended.is_ok() { "done" } else { "stopped" };
    let mut whole = true;
    for (recorder, _) in parts {
        // Nobody else holds it any more: the hub has let go of it.
        let Ok(recorder) = Arc::try_unwrap(recorder) else { continue };
        let end = RunEnd {
            outcome: outcome.to_owned(),
            stop_reason: None,
            at: MonotonicClock.now(),
            metadata: BTreeMap::new(),
        };
        let summary = recorder.finish_within(end, DISK_PATIENCE);
        whole &= summary.is_complete();
    }
    if !whole {
        job.operator.hear(Happening::NotAllRecorded);
    }
    ended.map_err(Ended::from)
}

/// What a recording tells of the measures of a subject.
pub(super) fn measures(job: &Job, id: &str) -> impl Iterator<Item = (String, String)> {
    let subject = job.progress.subjects.get(id);
    let measures = [
        (STATURE_KEY, subject.and_then(|subject| subject.measure(Measure::Stature))),
        (LEGS_KEY, subject.and_then(Subject::leg_length_m)),
    ];
    measures.into_iter().filter_map(|(key, m)| Some((key.to_owned(), m?.to_string())))
}

fn start(
    job: &Job,
    planned: &PlannedAction,
    name: &str,
    id: &str,
    kept: &Kept,
) -> Result<RunStart, Error> {
    let mut metadata = BTreeMap::from([
        ("trial".to_owned(), name.to_owned()),
        ("action".to_owned(), planned.name.clone()),
        ("subject".to_owned(), id.to_owned()),
        ("props".to_owned(), planned.props.clone()),
        (BODY_KEY.to_owned(), kept.text()?),
    ]);
    metadata.extend(measures(job, id));
    Ok(RunStart {
        robot: String::new(),
        motion: name.to_owned(),
        joints: Vec::new(),
        wall_clock_start: std::time::SystemTime::now(),
        monotonic_start: MonotonicClock.now(),
        gaitway_version: env!("CARGO_PKG_VERSION").to_owned(),
        metadata,
    })
}

/// Takes marks until the end; `by`: who does it, by number.
fn listen(job: &Job, parts: &[Part], by: &[usize]) -> Answered<()> {
    let operator = job.operator;
    let gone = job.hub.gone();
    let (mut good, mut bad) = (0, 0);
    let began = MonotonicClock.now();
    let (mut silences, mut looked) = (Silences::default(), began);
    loop {
        let said = operator.during_trial(LOOK)?;
        let at = MonotonicClock.now();
        if let Some(cause) = parts.iter().find_map(|(recorder, _)| recorder.failure()) {
            operator.hear(Happening::CutShort(CutShort::Disk { cause }));
            return Ok(());
        }
        if let Some((name, why)) = job.hub.gone().iter().find(|(n, _)| !gone.contains_key(*n)) {
            operator.hear(Happening::CutShort(CutShort::Sensor { name, why }));
            return Ok(());
        }
        // Whoever does something else just now may have switched off theirs.
        let here = job.hub.heard().into_iter();
        let here = here.filter(|(name, _)| by.contains(&wearer(name).map_or(0, |(by, _)| by)));
        let silent = silences.look(here, at.since(looked));
        looked = at;
        if let Some(name) = silent {
            let why = format!("it has said nothing for {} s", MOST_SILENT.as_secs());
            operator.hear(Happening::CutShort(CutShort::Sensor { name: &name, why: &why }));
            return Ok(());
        }
        let mut note = None;
        let text = match said {
            During::Nothing => continue,
            During::End => return Ok(()),
            During::Mark(Mark::Good) => {
                good += 1;
                GOOD.to_owned()
            }
            During::Mark(Mark::Bad) => {
                bad += 1;
                BAD.to_owned()
            }
            During::Mark(Mark::Note(words)) => note.insert(words).clone(),
        };
        for (recorder, marks) in parts {
            let marker = Marker { at, text: text.clone() };
            recorder.take_record(*marks, SourceRecord::Mark(marker));
        }
        let time_s = at.seconds_since(began);
        operator.hear(Happening::Marked { note: note.as_deref(), good, bad, time_s });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_says_nothing_for_three_seconds_is_gone_and_nobody_is_while_the_host_stands() {
        let at = |tenths: u64| Instant::from_nanos((1 + tenths) * 100_000_000);
        let heard = |head: u64, torso: u64| {
            let of = |name: &str, last: u64| {
                (name.into(), HeardSensor { last: Some(at(last)), ..HeardSensor::default() })
            };
            // One of whom nothing was heard before is missed by nobody.
            [of("head", head), of("torso", torso), of("pelvis", 0)].into_iter()
        };
        let tenth = Duration::from_millis(100);
        let mut silences = Silences::default();
        assert_eq!(silences.look(heard(0, 0), tenth), None);
        assert_eq!(silences.look(heard(1, 1), tenth), None);
        // A computer that slept for a minute finds all as it left them.
        assert_eq!(silences.look(heard(1, 1), 600 * tenth), None);
        for now in 2..=29 {
            assert_eq!(silences.look(heard(now, 1), tenth), None, "{now}");
        }
        assert_eq!(silences.look(heard(30, 1), tenth).as_deref(), Some("torso"));
    }
}
