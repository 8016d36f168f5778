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
use crate::sensing::{Clock, Ended, MonotonicClock};
use crate::session::PlannedAction;
use crate::session::files::{BODY_KEY, LEGS_KEY, STATURE_KEY, trial_name};
use crate::time::Duration;
use std::collections::BTreeMap;
use std::sync::Arc;

/// How often it is looked at the disk and the sensors while nothing is said.
const LOOK: Duration = Duration::from_millis(50);

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
    for (id, (recorder, _)) in subjects.iter().zip(&parts) {
        job.hub.begin_part(job.number_of(id), Arc::clone(recorder));
    }
    job.operator.hear(Happening::Recording { trial: name });
    let ended = listen(job, &parts);
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

/// Takes marks until the end.
fn listen(job: &Job, parts: &[Part]) -> Answered<()> {
    let operator = job.operator;
    let gone = job.hub.gone();
    let (mut good, mut bad) = (0, 0);
    let began = MonotonicClock.now();
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
            During::Mark(Mark::Note(words)) => words,
        };
        for (recorder, marks) in parts {
            let marker = Marker { at, text: text.clone() };
            recorder.take_record(*marks, SourceRecord::Mark(marker));
        }
        let time_s = at.seconds_since(began);
        operator.hear(Happening::Marked { good, bad, time_s });
    }
}
