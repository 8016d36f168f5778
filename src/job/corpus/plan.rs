//! What is still to be recorded of a set, and by whom.

use super::coverage_plot::{self, Square};
use crate::body::anthropometry::Measure;
use crate::corpus::coverage::{KnownPerson, NextPerson, next_people};
use crate::corpus::query::Question;
use crate::corpus::rows::{Consent, TrialEntry};
use crate::corpus::select::Selection;
use crate::corpus::sets::{PlannedSet, PlannedTrial};
use crate::corpus::store::Store;
use crate::draft::Drafts;
use crate::error::{Error, ErrorKind};
use crate::job::report::Outcome;
use crate::session::plan::{Plan, PlannedAction};
use crate::toml_text::to_toml;
use serde::Serialize;
use std::collections::BTreeSet;
use std::path::PathBuf;

/// So many people are named who are to be asked next.
const NEXT: usize = 10;

/// What is to be planned.
#[derive(Clone, Debug)]
pub struct PlanOrder {
    /// The folder of the corpus.
    pub corpus: PathBuf,
    /// The set, by its name.
    pub set: String,
    /// A plan of a session, to be written.
    pub file: Option<PathBuf>,
    /// A picture of who and what is there and what is missing, to be written.
    pub plot: Option<PathBuf>,
    /// They may replace what is there.
    pub replace: bool,
}

/// A trial of a set, and how much of it is there.
#[derive(Clone, Debug, Serialize)]
pub struct PlannedState {
    /// What is asked for.
    #[serde(flatten)]
    pub planned: PlannedTrial,
    /// Actions of which it is made that nobody has done alone yet.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub parts_missing: Vec<&'static str>,
    /// People who did it.
    pub done_by: usize,
    /// Trials that the program made of it.
    pub made: usize,
}

impl PlannedState {
    fn square(&self) -> Square<'_> {
        let Self { planned, done_by, made, .. } = self;
        Square { name: &planned.name, people: planned.people, done_by: *done_by, made: *made }
    }

    /// How many people are still to do it.
    fn left(&self) -> usize {
        (self.planned.people as usize).saturating_sub(self.done_by)
    }
}

/// What is missing.
#[derive(Clone, Debug, Serialize)]
pub struct PlanReport {
    /// `done`.
    pub outcome: Outcome,
    /// The folder of the corpus.
    pub corpus: String,
    /// Its version.
    pub version: String,
    /// The set.
    pub set: &'static str,
    /// Trials it asks for, each by as many people as it is to be done by.
    pub wanted: usize,
    /// Those that people did.
    pub recorded: usize,
    /// Trials of which there is only what the program made.
    pub only_made: usize,
    /// Trials that are missing or not done by enough people.
    pub missing: Vec<PlannedState>,
    /// Trials of the set that it does not ask for.
    pub unasked: usize,
    /// People whose stature and mass are known.
    pub people: usize,
    /// Who is to be asked next, and what for: as unlike those who are there as people are.
    pub next_people: Vec<NextPerson>,
    /// Files that were written.
    pub written: Vec<String>,
}

/// Looks at what there is of a set, and plans the rest.
///
/// # Errors
/// No corpus, a set that is not known, files that cannot be written.
pub fn plan(order: &PlanOrder) -> Result<PlanReport, Error> {
    let set = PlannedSet::of(&order.set).ok_or_else(|| {
        Error::of(ErrorKind::Unknown, "no set is called so").none_of(
            &order.set,
            PlannedSet::ALL.map(PlannedSet::word),
            "take one of these",
        )
    })?;
    for (file, ending) in [(&order.file, "toml"), (&order.plot, "svg")] {
        let other = |file: &&PathBuf| file.extension().is_none_or(|of| of != ending);
        if let Some(file) = file.as_ref().filter(other) {
            return Err(Error::of(ErrorKind::Unknown, "this kind of file cannot be written")
                .at(file.display().to_string())
                .allowed(format!("a file that ends in .{ending}")));
        }
    }
    let store = Store::open(&order.corpus)?;
    let mut there: Vec<TrialEntry> = Vec::new();
    let all = Question::parse("")?;
    Selection::new(&store, &all, false)?.trials(u64::MAX, |entry| {
        if entry.verdict.as_deref() != Some("retake") {
            there.push(entry);
        }
        Ok(())
    })?;
    let own: Vec<&TrialEntry> = there.iter().filter(|entry| entry.set == set.word()).collect();
    let planned = set.trials();
    let unasked =
        own.iter().filter(|of| !planned.iter().any(|one| one.is(&of.action, &of.parameters)));
    let unasked = unasked.count();
    let states: Vec<PlannedState> =
        planned.into_iter().map(|planned| state(planned, &own, &there)).collect();
    let wanted = states.iter().map(|of| of.planned.people as usize).sum();
    let left: usize = states.iter().map(PlannedState::left).sum();
    let people = people(&store, &there)?;
    let mut report = PlanReport {
        outcome: Outcome::Done,
        corpus: super::shown(&order.corpus),
        version: store.version().version.clone(),
        set: set.word(),
        wanted,
        recorded: wanted - left,
        only_made: states.iter().filter(|of| of.done_by == 0 && of.made > 0).count(),
        missing: states.iter().filter(|of| of.left() > 0).cloned().collect(),
        unasked,
        people: people.len(),
        next_people: next_people(&people, NEXT),
        written: Vec::new(),
    };
    let mut made = Drafts::default();
    if let Some(path) = &order.file {
        made.write(path, order.replace, session_plan(&report)?.as_bytes())?;
        report.written.push(path.display().to_string());
    }
    if let Some(path) = &order.plot {
        let squares: Vec<Square<'_>> = states.iter().map(PlannedState::square).collect();
        let plot = coverage_plot::drawn(set, &squares, &people, &report.next_people);
        made.write(path, order.replace, plot.as_bytes())?;
        report.written.push(path.display().to_string());
    }
    made.keep()?;
    Ok(report)
}

fn state(planned: PlannedTrial, own: &[&TrialEntry], there: &[TrialEntry]) -> PlannedState {
    // A trial without a good repetition is none.
    let is_good = |of: &&&TrialEntry| of.repetitions != Some(0);
    let of_it = || own.iter().filter(|of| planned.is(&of.action, &of.parameters)).filter(is_good);
    // Somebody whom nobody named is a person as well.
    let who =
        of_it().filter(|of| !of.synthetic).map(|of| of.subject.as_deref().unwrap_or_default());
    let done_by = who.collect::<BTreeSet<&str>>().len();
    let made = of_it().filter(|of| of.synthetic).count();
    let alone = |part: &&'static str| !there.iter().any(|of| of.action == **part && !of.synthetic);
    let parts_missing = planned.parts().filter(alone).collect();
    PlannedState { parts_missing, done_by, made, planned }
}

/// Who did something in the corpus, as far as stature and mass are known.
fn people(store: &Store, there: &[TrialEntry]) -> Result<Vec<KnownPerson>, Error> {
    let did: BTreeSet<&str> = there.iter().filter_map(|of| of.subject.as_deref()).collect();
    let known = store.subjects()?.into_iter().filter(|of| of.consent != Consent::Withdrawn);
    let known = known.filter(|of| did.contains(of.subject.id.as_str()));
    let person = |of: crate::corpus::rows::SubjectEntry| {
        Some(KnownPerson {
            stature_m: of.measure(Measure::Stature)?,
            mass_kg: of.measure(Measure::Mass)?,
            age_years: of.measure(Measure::Age),
            gender: of.subject.gender,
        })
    };
    Ok(known.filter_map(person).collect())
}

/// The plan of a session that records what is missing, as `record --session` takes it.
fn session_plan(report: &PlanReport) -> Result<String, Error> {
    if report.missing.is_empty() {
        return Err(Error::of(
            ErrorKind::Absent,
            "nothing of this set is missing: there is no plan to write",
        )
        .at(report.corpus.clone())
        .got(format!("{} of {} recorded", report.recorded, report.wanted)));
    }
    let action = |of: &PlannedState| PlannedAction {
        name: of.planned.name.clone(),
        explain: of.planned.explain.clone(),
        repetitions: Some(of.planned.repetitions),
        together: of.planned.together,
        ..PlannedAction::default()
    };
    let actions = report.missing.iter().map(action).collect();
    let remarks = format!(
        "What is missing of the set {} in {}. Take out what one session is not to have; then\n\
         `gaitway record --session DIR --plan THIS`, and `gaitway corpus add {} DIR --set {}`.",
        report.set, report.corpus, report.corpus, report.set
    );
    to_toml(&remarks, &Plan { actions, ..Plan::default() }.checked()?)
}
