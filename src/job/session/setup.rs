//! What the session is, and whom it records.

use super::Job;
use super::happening::Happening;
use super::operator::{
    Answered, Ask, Asked, Doubt, MeasureAnswer, Operator, Words, ask_all, ask_until,
};
use crate::action::vocabulary;
use crate::body::anthropometry::{Measure, Subject, check_id};
use crate::body::worn::strap::StrapDirection;
use crate::error::Error;
use crate::sensing::{Ended, wall_clock};
use crate::session::files::SCHEMA;
use crate::session::wearers::wearer;
use crate::session::{Plan, PlannedAction, SessionFile};
use std::collections::BTreeMap;

/// What the session itself is called where it is asked what is to be changed.
const SESSION: &str = "session";

/// What takes away what was answered before.
const NOTHING: &str = "-";

/// What is known of a new session before anybody is asked.
pub(super) struct Given {
    /// Sources as they are typed.
    pub(super) sources: Vec<String>,
    /// Trackers that name themselves, each with the name it goes by here.
    pub(super) wear: BTreeMap<String, String>,
    /// What of a sensor points forward, where that is not X.
    pub(super) forward: BTreeMap<String, StrapDirection>,
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
    // Whoever wears sources of the second subject is there.
    let names = job.names();
    let worn_by_second = names.iter().filter_map(|name| wearer(name)).any(|(by, _)| by == 1);
    let mut answers = SessionWords { plan: given.plan, ..SessionWords::default() };
    let is_planned = answers.plan.is_some();
    let questions: Vec<Ask<'_, SessionWords>> = vec![
        Box::new(|of| {
            let usual = if of.name.is_empty() { usual.to_owned() } else { of.name.clone() };
            let answer = operator.words(Words::SessionName { usual: &usual })?;
            of.name = if answer.is_empty() { usual } else { answer };
            Ok(Asked::Answered)
        }),
        words(operator, Words::Leader, false, |of: &mut SessionWords| &mut of.leader),
        words(operator, Words::Place, false, |of: &mut SessionWords| &mut of.place),
        words(operator, Words::Remarks, false, |of: &mut SessionWords| &mut of.remarks),
        Box::new(|of| {
            if is_planned {
                return Ok(Asked::Left);
            }
            of.plan = Some(plan(operator)?);
            Ok(Asked::Answered)
        }),
        Box::new(|of| {
            of.subjects = vec![subject_id(operator, Words::FirstSubject, &[])?];
            Ok(Asked::Answered)
        }),
        Box::new(|of| {
            if !worn_by_second {
                return Ok(Asked::Left);
            }
            of.subjects.truncate(1);
            let second = subject_id(operator, Words::SecondSubject, &of.subjects)?;
            of.subjects.push(second);
            Ok(Asked::Answered)
        }),
    ];
    ask_all(&mut answers, &questions)?;
    drop(questions);
    let SessionWords { name, leader, place, remarks, plan, subjects } = answers;
    let plan = plan.ok_or_else(|| Error::new("there is no plan"))?;
    let session = SessionFile {
        schema: SCHEMA,
        name,
        begun,
        operator: leader,
        place,
        remarks,
        sources: given.sources,
        wear: given.wear,
        forward: given.forward,
        magnetometer: given.magnetometer,
        subjects,
        skipped: Vec::new(),
        plan,
        gaitway_version: env!("CARGO_PKG_VERSION").to_owned(),
    };
    job.folder.write_new("session.toml", &session)?;
    Ok(())
}

/// What is recorded; what is done in an action of one's own is asked for.
fn plan(operator: &dyn Operator) -> Answered<Plan> {
    loop {
        let mut actions = Vec::new();
        for name in operator.actions()? {
            let is_own = PlannedAction::is_name(&name) && vocabulary::find(&name).is_err();
            let explain = match is_own {
                true => operator.words(Words::Explanation { action: &name })?,
                false => String::new(),
            };
            actions.push(PlannedAction { name, explain, ..PlannedAction::default() });
        }
        match Plan::of_actions(actions) {
            Ok(plan) => return Ok(plan),
            Err(error) => operator.hear(Happening::Refused(&error)),
        }
    }
}

fn subject_id(operator: &dyn Operator, who: Words<'_>, others: &[String]) -> Answered<String> {
    ask_until(
        operator,
        || operator.words(who),
        |id| {
            check_id(&id)?;
            if id == SESSION {
                return Err(Error::new("the session itself is called so").got(id));
            }
            if others.contains(&id) {
                return Err(Error::new("two subjects need two ids").got(id));
            }
            Ok(id)
        },
    )
}

/// Writes a subject's measures down: those of another session, if they were given, or what is answered.
pub(super) fn subject(job: &Job, id: &str) -> Result<(), Ended> {
    let operator = job.operator;
    let file = format!("subjects/{id}.toml");
    if let Some(known) = job.known.iter().find(|known| known.id == id) {
        operator.hear(Happening::KnownSubject { subject: id });
        job.folder.write_new(&file, known)?;
        return Ok(());
    }
    operator.hear(Happening::Measures { subject: id });
    let new = Subject { id: id.to_owned(), ..Subject::default() };
    job.folder.write_new(&file, &measured(operator, new, false)?)?;
    Ok(())
}

/// Asks what is to be changed of all that was answered, and changes it.
pub(super) fn edit(job: &Job, subjects: &[String]) -> Result<(), Ended> {
    let operator = job.operator;
    let mut choices = vec![SESSION];
    choices.extend(subjects.iter().map(String::as_str));
    let known = |what: String| match what.is_empty() || choices.contains(&what.as_str()) {
        true => Ok(what),
        false => Err(Error::new("not one of these").got(what).allowed(choices.join(", "))),
    };
    let what = ask_until(operator, || operator.words(Words::Changed { choices: &choices }), known)?;
    if what.is_empty() {
        return Ok(());
    }
    operator.hear(Happening::Editing { what: &what });
    if what == SESSION {
        let mut session = job.session()?.clone();
        let questions: Vec<Ask<'_, SessionFile>> = vec![
            words(operator, Words::Leader, true, |of: &mut SessionFile| &mut of.operator),
            words(operator, Words::Place, true, |of: &mut SessionFile| &mut of.place),
            words(operator, Words::Remarks, true, |of: &mut SessionFile| &mut of.remarks),
        ];
        ask_all(&mut session, &questions)?;
        job.folder.replace("session.toml", &session)?;
        return Ok(());
    }
    let known = job.progress.subjects.get(&what).cloned();
    let known = known.unwrap_or_else(|| Subject { id: what.clone(), ..Subject::default() });
    let file = format!("subjects/{what}.toml");
    job.folder.replace(&file, &measured(operator, known, true)?)?;
    Ok(())
}

/// What is known of a new session.
#[derive(Default)]
struct SessionWords {
    name: String,
    leader: String,
    place: String,
    remarks: String,
    plan: Option<Plan>,
    subjects: Vec<String>,
}

/// Words. Those that were answered before are told; an empty answer leaves them as they are, and a dash takes them away.
fn words<'a, S: 'a>(
    operator: &'a dyn Operator,
    what: Words<'a>,
    is_edited: bool,
    place: impl Fn(&mut S) -> &mut String + 'a,
) -> Ask<'a, S> {
    Box::new(move |of| {
        let said = place(of);
        let is_told = is_edited || !said.is_empty();
        if is_told {
            operator.hear(Happening::AsItIs { words: said });
        }
        match operator.words(what)?.as_str() {
            "" => {}
            NOTHING if is_told => said.clear(),
            answer => answer.clone_into(said),
        }
        Ok(Asked::Answered)
    })
}

/// A subject who is asked about.
struct Person {
    subject: Subject,
    /// The measure at which it was said that nothing more is measured.
    enough: Option<Measure>,
}

/// Asks for all that is known of a subject; of one who is `known`, each with how it is.
fn measured(operator: &dyn Operator, subject: Subject, known: bool) -> Answered<Subject> {
    let mut person = Person { subject, enough: None };
    let gender: fn(&mut Person) -> &mut String = |of| &mut of.subject.gender;
    let mut questions: Vec<Ask<'_, Person>> = vec![Box::new(move |of| {
        loop {
            let before = of.subject.gender.clone();
            words(operator, Words::Gender, known, gender)(of)?;
            let said = &of.subject.gender;
            // The age, for example, or the next answer, typed too early.
            if !is_number(said) {
                return Ok(Asked::Answered);
            }
            let error = Error::new("not a gender")
                .got(said.clone())
                .allowed("any word, or Enter to leave it out");
            of.subject.gender = before;
            operator.hear(Happening::Refused(&error));
        }
    })];
    for measure in Measure::ALL {
        questions.push(Box::new(move |of: &mut Person| {
            if of.enough.is_some_and(|last| last < measure) && !measure.is_required() {
                return Ok(Asked::Left);
            }
            // Whoever came back may measure more after all.
            of.enough = of.enough.filter(|last| *last < measure);
            if self::measure(operator, &mut of.subject, measure, known)? {
                of.enough = Some(measure);
            }
            Ok(Asked::Answered)
        }));
    }
    let remarks: fn(&mut Person) -> &mut String = |of| &mut of.subject.remarks;
    questions.push(words(operator, Words::SubjectRemarks, known, remarks));
    ask_all(&mut person, &questions)?;
    drop(questions);
    Ok(person.subject)
}

/// True of a number in any script, with a decimal comma or point, or as programs write one.
fn is_number(text: &str) -> bool {
    let is_word = text.chars().any(char::is_alphabetic);
    text.parse::<f64>().is_ok() || (!is_word && text.chars().any(char::is_numeric))
}

/// Asks for one measure until it is plausible, or the operator says that it is right; true if
/// nothing more is measured. One that was answered before is told; an empty answer leaves it as it is.
fn measure(
    operator: &dyn Operator,
    subject: &mut Subject,
    measure: Measure,
    known: bool,
) -> Answered<bool> {
    let before = subject.measure(measure);
    if known || before.is_some() {
        let words = before.map_or_else(String::new, |value| measure.said(value));
        operator.hear(Happening::AsItIs { words: &words });
    }
    let is_needed = measure.is_required() && before.is_none();
    loop {
        let value = match answer(operator, measure, is_needed)? {
            MeasureAnswer::Is(value) => value,
            MeasureAnswer::NotMeasured => return Ok(false),
            MeasureAnswer::TakenAway if measure.is_required() => {
                let error = Error::new("this measure is needed").at(measure.words());
                operator.hear(Happening::Refused(&error));
                continue;
            }
            MeasureAnswer::TakenAway => {
                subject.measures.remove(&measure);
                return Ok(false);
            }
            MeasureAnswer::NothingMore => return Ok(true),
        };
        subject.measures.insert(measure, value);
        let Some(why) = subject.doubt(measure) else { return Ok(false) };
        match operator.is_right(Doubt { measure, value, why: &why }) {
            Ok(true) => return Ok(false),
            Ok(false) => {}
            Err(instead) => {
                put_back(subject, measure, before);
                return Err(instead);
            }
        }
        put_back(subject, measure, before);
    }
}

fn put_back(subject: &mut Subject, measure: Measure, before: Option<f64>) {
    match before {
        Some(value) => drop(subject.measures.insert(measure, value)),
        None => drop(subject.measures.remove(&measure)),
    }
}

/// What is said of a measure; if it is a number, one that a person may have.
fn answer(operator: &dyn Operator, measure: Measure, is_needed: bool) -> Answered<MeasureAnswer> {
    let ask = || match is_needed {
        true => operator.needed_measure(measure).map(MeasureAnswer::Is),
        false => operator.measure(measure),
    };
    ask_until(operator, ask, |answer| match answer {
        MeasureAnswer::Is(value) => measure.read(&value.to_string()).map(MeasureAnswer::Is),
        left_out => Ok(left_out),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_is_told_from_words_in_any_script() {
        for number in ["34", "3,4", "-5", "1e3", "\u{0663}\u{0664}", "34."] {
            assert!(is_number(number), "{number}");
        }
        for word in ["", "f", "non-binary", "\u{2640}", "m34", "34 years", "-"] {
            assert!(!is_number(word), "{word}");
        }
    }
}
