//! What the session is, and whom it records.

use super::Job;
use super::happening::Happening;
use super::operator::{Answered, Doubt, MeasureAnswer, Operator, Words, ask_until};
use crate::body::anthropometry::{Measure, Subject, check_id};
use crate::error::Error;
use crate::sensing::{Ended, wall_clock};
use crate::session::files::SCHEMA;
use crate::session::wearers::wearer;
use crate::session::{Plan, SessionFile};
use std::collections::BTreeMap;

/// What is known of a new session before anybody is asked.
pub(super) struct Given {
    /// Sources as they are typed.
    pub(super) sources: Vec<String>,
    /// Trackers that name themselves, each with the name it goes by here.
    pub(super) wear: BTreeMap<String, String>,
    /// The plan, if there is one.
    pub(super) plan: Option<Plan>,
    /// Headings from the magnetic field.
    pub(super) magnetometer: bool,
}

/// Asks what the session is, and writes it down.
pub(super) fn session(job: &Job, given: Given) -> Result<(), Ended> {
    let (operator, begun) = (job.operator, wall_clock());
    let folder_name = job.folder.root().file_name().and_then(|name| name.to_str());
    let usual = folder_name.unwrap_or("session");
    operator.hear(Happening::NewSession);
    let name = operator.words(Words::SessionName { usual })?;
    let leader = operator.words(Words::Leader)?;
    let place = operator.words(Words::Place)?;
    let remarks = operator.words(Words::Remarks)?;
    let plan = match given.plan {
        Some(plan) => plan,
        None => ask_until(
            operator,
            || operator.actions(),
            |names| Plan::of_names(&names.iter().map(String::as_str).collect::<Vec<_>>()),
        )?,
    };
    let mut subjects = vec![subject_id(operator, Words::FirstSubject, &[])?];
    // Whoever wears sources of the second subject is there.
    let names = job.names();
    let worn_by_second = names.iter().filter_map(|name| wearer(name)).any(|(by, _)| by == 1);
    if worn_by_second {
        subjects.push(subject_id(operator, Words::SecondSubject, &subjects)?);
    }
    let session = SessionFile {
        schema: SCHEMA,
        name: if name.is_empty() { usual.to_owned() } else { name },
        begun,
        operator: leader,
        place,
        remarks,
        sources: given.sources,
        wear: given.wear,
        magnetometer: given.magnetometer,
        subjects,
        skipped: Vec::new(),
        plan,
        gaitway_version: env!("CARGO_PKG_VERSION").to_owned(),
    };
    job.folder.write_new("session.toml", &session)?;
    Ok(())
}

fn subject_id(operator: &dyn Operator, who: Words<'_>, others: &[String]) -> Answered<String> {
    ask_until(
        operator,
        || operator.words(who),
        |id| {
            check_id(&id)?;
            if others.contains(&id) {
                return Err(Error::new("two subjects need two ids").got(id));
            }
            Ok(id)
        },
    )
}

/// Asks for a subject's measures, and writes them down.
pub(super) fn subject(job: &Job, id: &str) -> Result<(), Ended> {
    let operator = job.operator;
    operator.hear(Happening::Measures { subject: id });
    let mut subject = Subject { id: id.to_owned(), ..Subject::default() };
    subject.gender = operator.words(Words::Gender)?;
    let mut enough = false;
    for measure in Measure::ALL {
        if !enough || measure.is_required() {
            enough |= self::measure(operator, &mut subject, measure)?;
        }
    }
    subject.remarks = operator.words(Words::SubjectRemarks)?;
    job.folder.write_new(&format!("subjects/{id}.toml"), &subject)?;
    Ok(())
}

/// Asks for one measure until it is plausible, or the operator says that it is right; true if
/// nothing more is measured.
fn measure(operator: &dyn Operator, subject: &mut Subject, measure: Measure) -> Answered<bool> {
    loop {
        let value = match answer(operator, measure)? {
            MeasureAnswer::Is(value) => value,
            MeasureAnswer::NotMeasured => return Ok(false),
            MeasureAnswer::NothingMore => return Ok(true),
        };
        subject.measures.insert(measure, value);
        let Some(why) = subject.doubt(measure) else { return Ok(false) };
        if operator.is_right(Doubt { measure, value, why: &why })? {
            return Ok(false);
        }
        subject.measures.remove(&measure);
    }
}

/// What is said of a measure; if it is a number, one that a person may have.
fn answer(operator: &dyn Operator, measure: Measure) -> Answered<MeasureAnswer> {
    let ask = || match measure.is_required() {
        true => operator.needed_measure(measure).map(MeasureAnswer::Is),
        false => operator.measure(measure),
    };
    ask_until(operator, ask, |answer| match answer {
        MeasureAnswer::Is(value) => measure.read(&value.to_string()).map(MeasureAnswer::Is),
        left_out => Ok(left_out),
    })
}
