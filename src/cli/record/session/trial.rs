//! Trials: explained, practised, recorded, judged.

use super::console::Ended;
use super::{Job, subject};
use crate::body::anthropometry::{Measure, Subject};
use crate::body::worn::kept::Kept;
use crate::error::Error;
use crate::recording::{
    Marker, RecordedSource, Recorder, RunEnd, RunStart, SensorSeries, SourceId, SourceKind,
    SourceRecord, sensor_series,
};
use crate::sensing::{Clock, MonotonicClock};
use crate::session::files::{
    BODY_KEY, LEGS_KEY, SCHEMA, STATURE_KEY, TrialFile, TrialRecording, Verdict, trial_name,
    trial_of,
};
use crate::session::tap::taps;
use crate::session::{Plan, PlannedAction};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

/// What marks of repetitions say.
const GOOD: &str = "repetition";
const BAD: &str = "repetition, bad";
/// How often it is looked at the disk and the sensors while nothing is typed.
const LOOK: Duration = Duration::from_millis(50);

/// What the operator wants instead of a trial.
enum Wish {
    Record,
    Devices,
    Subjects,
    GiveUp,
}

/// Leads to one more trial of an action by these subjects.
pub fn trial(job: &mut Job, action: usize, number: u32, subjects: &[String]) -> Result<(), Ended> {
    let plan = job.session()?.plan.clone();
    let planned = &plan.actions[action];
    let place = format!("[{}/{}]", action + 1, plan.actions.len());
    announce(job, &plan, planned, subjects, &place);
    match wish(job, planned, number, subjects)? {
        Wish::Record => {}
        Wish::Devices => return super::device::calibrate(job),
        Wish::Subjects => {
            for id in subjects {
                subject::calibrate(job, id)?;
            }
            return Ok(());
        }
        Wish::GiveUp => {
            let mut session = job.session()?.clone();
            session.skipped.push(planned.name.clone());
            job.folder.replace("session.toml", &session)?;
            return Ok(());
        }
    }
    let mut worn = Vec::new();
    for id in subjects {
        worn.push(facing(job, id)?);
    }
    record(job, planned, number, subjects, &worn)?;
    job.reload()?;
    judge(job, &trial_name(&planned.name, number))
}

fn announce(job: &Job, plan: &Plan, planned: &PlannedAction, subjects: &[String], place: &str) {
    let good = job.progress.good_by(&planned.name, subjects);
    job.console.say(&format!(
        "\n{place} {}, {}: {good} of {} good repetitions",
        planned.name,
        subjects.join(" and "),
        plan.wanted(planned)
    ));
    job.console.say(&format!("  {}", planned.explain));
    if !planned.props.is_empty() {
        job.console.say(&format!("  props: {}", planned.props));
    }
}

/// The first time an action is explained and practised before it is recorded.
fn wish(
    job: &Job,
    planned: &PlannedAction,
    number: u32,
    subjects: &[String],
) -> Result<Wish, Ended> {
    if !job.progress.has_tried(&planned.name, subjects) {
        job.console.choose("Explain it and show it.", &[("y", "it is understood")])?;
        job.console.choose("Let it be practised; nothing is recorded.", &[("y", "it works")])?;
    }
    let choices = [
        ("y", "record"),
        ("d", "device calibration again"),
        ("c", "subject calibration again"),
        ("g", "give this action up"),
    ];
    let asked = format!("Record {}?", trial_name(&planned.name, number));
    Ok(match job.console.choose(&asked, &choices)? {
        "d" => Wish::Devices,
        "c" => Wish::Subjects,
        "g" => Wish::GiveUp,
        _ => Wish::Record,
    })
}

/// N pose, until it is one.
fn facing(job: &mut Job, id: &str) -> Result<Kept, Ended> {
    loop {
        match subject::face_forward(job, id) {
            Err(Ended::Failed(error)) => {
                job.console.say(&format!("! {error}"));
                let choices = [("r", "once more"), ("c", "subject calibration again")];
                if job.console.choose("It did not work.", &choices)? == "c" {
                    subject::calibrate(job, id)?;
                }
            }
            done => return done,
        }
    }
}

/// Records what the subjects do until the operator ends it.
fn record(
    job: &Job,
    planned: &PlannedAction,
    number: u32,
    subjects: &[String],
    worn: &[Kept],
) -> Result<(), Ended> {
    let name = trial_name(&planned.name, number);
    let mut parts = Vec::new();
    for (id, kept) in subjects.iter().zip(worn) {
        let stem = if subjects.len() > 1 { format!("{name}.{id}") } else { name.clone() };
        let path = job.folder.path(&format!("trials/{stem}.mcap"));
        let start = start(job, planned, &name, id, kept)?;
        let recorder = Arc::new(Recorder::create_for_sources(&path, false, start)?);
        let marks = recorder.add_source(RecordedSource {
            name: "marks".to_owned(),
            metadata: BTreeMap::new(),
            kind: SourceKind::Marks,
        });
        parts.push((recorder, marks));
    }
    for (id, (recorder, _)) in subjects.iter().zip(&parts) {
        job.hub.begin_part(job.wearer_of(id), Arc::clone(recorder));
    }
    job.console.say(&format!(
        "RECORDING {name}. Enter: a good repetition is done; x: a bad one; words: a note; a dot: \
         the end"
    ));
    let ended = listen(job, &parts);
    job.hub.end_parts();
    let outcome = if ended.is_ok() { "done" } else { "stopped" };
    let mut whole = true;
    for (recorder, _) in parts {
        // Nobody else holds it any more: the hub has let go of it.
        let Ok(recorder) = Arc::try_unwrap(recorder) else { continue };
        let summary = recorder.finish(RunEnd {
            outcome: outcome.to_owned(),
            stop_reason: None,
            at: MonotonicClock.now(),
            metadata: BTreeMap::new(),
        });
        whole &= summary.is_complete();
    }
    if !whole {
        job.console.say("! the disk could not keep up, or failed: not all of it is recorded");
    }
    ended
}

fn start(
    job: &Job,
    planned: &PlannedAction,
    name: &str,
    id: &str,
    kept: &Kept,
) -> Result<RunStart, Error> {
    let subject = job.progress.subjects.get(id);
    let measures = [
        (STATURE_KEY, subject.and_then(|subject| subject.measure(Measure::Stature))),
        (LEGS_KEY, subject.and_then(Subject::leg_length_m)),
    ];
    let mut metadata = BTreeMap::from([
        ("trial".to_owned(), name.to_owned()),
        ("action".to_owned(), planned.name.clone()),
        ("subject".to_owned(), id.to_owned()),
        ("props".to_owned(), planned.props.clone()),
        (BODY_KEY.to_owned(), kept.text()?),
    ]);
    let known =
        measures.iter().filter_map(|(key, m)| Some(((*key).to_owned(), m.as_ref()?.to_string())));
    metadata.extend(known);
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
fn listen(job: &Job, parts: &[(Arc<Recorder>, SourceId)]) -> Result<(), Ended> {
    let gone = job.hub.gone();
    let (mut good, mut bad) = (0, 0);
    loop {
        let line = job.console.line_within(LOOK)?;
        let at = MonotonicClock.now();
        if let Some(cause) = parts.iter().find_map(|(recorder, _)| recorder.failure()) {
            job.console.say(&format!("! it ends here, the disk fails: {cause}"));
            return Ok(());
        }
        if let Some((name, why)) = job.hub.gone().into_iter().find(|(n, _)| !gone.contains_key(n)) {
            job.console.say(&format!("! it ends here, sensor {name} is gone: {why}"));
            return Ok(());
        }
        let text = match line.as_deref() {
            None => continue,
            Some(".") => return Ok(()),
            Some("q") => return Err(Ended::Stopped),
            Some("") => {
                good += 1;
                GOOD
            }
            Some("x") => {
                bad += 1;
                BAD
            }
            Some(words) => words,
        };
        for (recorder, marks) in parts {
            let marker = Marker { at, text: text.to_owned() };
            recorder.take_record(*marks, SourceRecord::Mark(marker));
        }
        job.console.say(&format!("  {good} good, {bad} bad"));
    }
}

/// Asks what is thought of a trial, and writes it down.
pub fn judge(job: &mut Job, name: &str) -> Result<(), Ended> {
    let files = job.progress.unjudged.get(name).cloned().unwrap_or_default();
    let (action, number) = trial_of(name).unwrap_or((name, 0));
    let mut recordings = Vec::new();
    let mut series = Vec::new();
    for file in files {
        // One that was cut off before its first byte cannot be read, and must not be in the way.
        let read = sensor_series(&job.folder.path(&file)).unwrap_or_else(|error| {
            job.console.say(&format!("! {error}"));
            SensorSeries::default()
        });
        let said = read.start.as_ref().and_then(|start| start.metadata.get("subject").cloned());
        recordings.push(TrialRecording { subject: said.unwrap_or_default(), file });
        series.push(read);
    }
    let Some(first) = series.first() else {
        return Err(Error::new("a trial has no recording").at(name).into());
    };
    let whole = tell(job, name, &series);
    let marked = first.markers.iter().filter(|marker| marker.text == GOOD).count();
    let (keep, retake) = (("k", "keep"), ("r", "retake"));
    let choices = match recordings.iter().all(|recording| !recording.subject.is_empty()) {
        true if whole => vec![keep, retake],
        true => vec![retake, keep],
        false => vec![retake],
    };
    let is_kept = job.console.choose(&format!("Trial {name}: keep it?"), &choices)? == "k";
    let good_repetitions = match is_kept {
        true => repetitions(job, marked)?,
        false => 0,
    };
    let notes = job.console.ask(if is_kept { "notes" } else { "what was wrong" })?;
    let planned = job.session()?.plan.actions.iter().find(|planned| planned.name == action);
    let usual = planned.map_or_else(String::new, |planned| planned.props.clone());
    let said = if usual.is_empty() { "nothing" } else { usual.as_str() };
    let props = match is_kept {
        true => job.console.ask(&format!("props: what was held or used [Enter: {said}]"))?,
        false => String::new(),
    };
    let trial = TrialFile {
        schema: SCHEMA,
        action: action.to_owned(),
        number,
        judged: job.now(),
        verdict: if is_kept { Verdict::Keep } else { Verdict::Retake },
        good_repetitions,
        notes,
        props: if props.is_empty() { usual } else { props },
        closed: series.iter().all(|series| series.whole),
        missed_samples: series.iter().map(|series| series.missed).sum(),
        duration_s: first.duration_s(),
        recordings,
        taps: taps(&all_sensors(&series), first.start_ns()),
    };
    job.folder.write_new(&format!("trials/{name}.toml"), &trial)?;
    Ok(())
}

fn repetitions(job: &Job, marked: usize) -> Result<u32, Ended> {
    let most = 10_000;
    job.console.ask_until(
        &format!("good repetitions in it [Enter: {marked}, as many as were marked]"),
        |answer| {
            let answer = if answer.is_empty() { marked.to_string() } else { answer.to_owned() };
            answer.parse().ok().filter(|count| *count <= most).ok_or_else(|| {
                Error::new("not a number of repetitions")
                    .got(answer)
                    .allowed(format!("0 to {most}"))
            })
        },
    )
}

/// The sensors of all subjects: names differ, and the clock is one.
fn all_sensors(series: &[SensorSeries]) -> BTreeMap<String, Vec<crate::recording::SensorMoment>> {
    series.iter().flat_map(|series| series.sensors.clone()).collect()
}

/// A sensor that says nothing for so long at the end of a trial has fallen silent.
const SILENT_S: f64 = 0.5;

/// Says what is in a trial; false if something is missing in it.
fn tell(job: &Job, name: &str, series: &[SensorSeries]) -> bool {
    let mut wrong = Vec::new();
    for part in series {
        job.console.say(&format!("{name}: {:.1} s", part.duration_s()));
        for (sensor, moments) in &part.sensors {
            job.console.say(&format!("  {sensor:<16} {} samples", moments.len()));
        }
        if !part.whole {
            wrong.push("it was cut off: its last second may be missing".to_owned());
        }
        if part.missed > 0 {
            wrong.push(format!("{} samples are missing", part.missed));
        }
        let worn = part.start.as_ref().and_then(|start| start.metadata.get(BODY_KEY));
        let worn = worn.and_then(|text| Kept::parse(text).ok());
        for sensor in worn.iter().flat_map(|kept| &kept.sensors) {
            let last = part.sensors.get(sensor).and_then(|moments| moments.last());
            let silent_s = last.map_or(part.duration_s(), |last| {
                part.last_ns.saturating_sub(last.taken_ns) as f64 / 1e9
            });
            if last.is_none() || !(silent_s <= SILENT_S) {
                wrong.push(format!("{sensor} is silent for the last {silent_s:.1} s"));
            }
        }
    }
    for words in &wrong {
        job.console.say(&format!("  ! {words}"));
    }
    if let Some(first) = series.first() {
        for tap in taps(&all_sensors(series), first.start_ns()) {
            job.console.say(&format!("  tap {}", tap.words()));
        }
    }
    wrong.is_empty()
}
