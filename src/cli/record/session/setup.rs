//! What the session is, and whom it records.

use super::console::{Console, Ended};
use crate::action::vocabulary;
use crate::body::anthropometry::{Measure, Subject, check_id};
use crate::error::Error;
use crate::session::files::SCHEMA;
use crate::session::wearers::wearer;
use crate::session::{Folder, Plan, SessionFile};
use crate::time::Utc;
use std::collections::BTreeMap;

/// What is known from the command line.
pub struct Given {
    /// Sources as they were typed.
    pub sources: Vec<String>,
    /// Trackers that name themselves, each with the name it goes by here.
    pub wear: BTreeMap<String, String>,
    /// Names of all sensors.
    pub names: Vec<String>,
    /// The plan, if a file was named.
    pub plan: Option<Plan>,
    /// Headings from the magnetic field.
    pub magnetometer: bool,
}

/// Asks what the session is, and writes it down.
pub fn session(
    console: &Console,
    folder: &Folder,
    given: Given,
    now: Utc,
) -> Result<SessionFile, Ended> {
    let folder_name = folder.root().file_name().and_then(|name| name.to_str());
    let usual = folder_name.unwrap_or("session").to_owned();
    console.say("Session. Enter alone leaves out what is not needed; q stops at any question.");
    let name = console.ask(&format!("name of the session [Enter: {usual}]"))?;
    let operator = console.ask("operator (who leads it)")?;
    let place = console.ask("place")?;
    let remarks = console.ask("remarks")?;
    let plan = match given.plan {
        Some(plan) => plan,
        None => console.ask_until(
            &format!(
                "actions to be recorded, with spaces between\n  [{}]",
                vocabulary::names().collect::<Vec<_>>().join(" ")
            ),
            |answer| Plan::of_names(&answer.split_whitespace().collect::<Vec<_>>()),
        )?,
    };
    let mut subjects = vec![subject_id(console, "subject", &[])?];
    // Whoever wears sources of the second subject is there.
    let worn_by_second = given.names.iter().filter_map(|name| wearer(name)).any(|(by, _)| by == 1);
    if worn_by_second {
        subjects.push(subject_id(console, "second subject", &subjects)?);
    }
    let session = SessionFile {
        schema: SCHEMA,
        name: if name.is_empty() { usual } else { name },
        begun: now,
        operator,
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
    folder.write_new("session.toml", &session)?;
    Ok(session)
}

fn subject_id(console: &Console, who: &str, others: &[String]) -> Result<String, Ended> {
    console.ask_until(
        &format!("id of the {who}, needed: small letters, digits, - (such as s01; no real name)"),
        |answer| {
            check_id(answer)?;
            if others.iter().any(|other| other == answer) {
                return Err(Error::new("two subjects need two ids").got(answer));
            }
            Ok(answer.to_owned())
        },
    )
}

/// Asks for a subject's measures, and writes them down.
pub fn subject(console: &Console, folder: &Folder, id: &str) -> Result<(), Ended> {
    console.say(&format!(
        "\nSubject {id}. Measures; Enter alone: not measured; a dot: nothing more is measured. Only \
         the stature is needed."
    ));
    let mut subject = Subject { id: id.to_owned(), ..Subject::default() };
    subject.gender = console.ask("gender, in the subject's words")?;
    let mut enough = false;
    for measure in Measure::ALL {
        if !enough || measure.is_required() {
            enough |= self::measure(console, &mut subject, measure)?;
        }
    }
    subject.remarks = console.ask("remarks: actions that are not possible, injuries")?;
    folder.write_new(&format!("subjects/{id}.toml"), &subject)?;
    Ok(())
}

/// Asks for one measure until it is plausible, or the operator says that it is right; true if
/// nothing more is measured.
fn measure(console: &Console, subject: &mut Subject, measure: Measure) -> Result<bool, Ended> {
    let needed = if measure.is_required() { ", needed" } else { "" };
    let question = format!("{}{needed} [{}]", measure.words(), measure.allowed());
    loop {
        let answer = console.ask_until(&question, |answer| match answer {
            "" | "." if !measure.is_required() => Ok(Err(answer == ".")),
            answer => measure.read(answer).map(Ok),
        })?;
        let value = match answer {
            Ok(value) => value,
            Err(enough) => return Ok(enough),
        };
        subject.measures.insert(measure, value);
        let Some(doubt) = subject.doubt(measure) else { return Ok(false) };
        let question = format!("{value} {}: {doubt}. Is it right?", measure.unit());
        if console.choose(&question, &[("n", "ask again"), ("y", "it is right")])? == "y" {
            return Ok(false);
        }
        subject.measures.remove(&measure);
    }
}
