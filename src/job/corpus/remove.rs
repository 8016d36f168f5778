//! Trials taken out of a corpus: those of a person, or those that answer a question.

use crate::columnar::ColumnKind;
use crate::corpus::query::{Comparison, FieldTest, Literal, QueryField, Question, Test};
use crate::corpus::select::Selection;
use crate::corpus::store::Store;
use crate::corpus::version::ExportNote;
use crate::error::{Error, ErrorKind};
use crate::job::report::Outcome;
use serde::Serialize;
use std::path::PathBuf;

/// What is to be taken out.
#[derive(Clone, Debug, Default)]
pub struct RemoveOrder {
    /// The folder of the corpus.
    pub corpus: PathBuf,
    /// All of this person, and what is said of them.
    pub subject: Option<String>,
    /// Trials that answer this question.
    pub question: Option<String>,
    /// Only tell what would go.
    pub dry_run: bool,
}

/// What was taken out.
#[derive(Clone, Debug, Serialize)]
pub struct RemoveReport {
    /// `done`.
    pub outcome: Outcome,
    /// The folder of the corpus.
    pub corpus: String,
    /// Its version now.
    pub version: String,
    /// Trials that went, or would go.
    pub removed: u64,
    /// Ids of them, the first thousand.
    pub trials: Vec<String>,
    /// True if nothing was taken out.
    pub dry_run: bool,
    /// Exports in which that person, or a person of these trials, is: they are files of their own, and stay.
    pub exports: Vec<ExportNote>,
    /// Trials there are now.
    pub left: u64,
}

/// Most ids that are told.
const MOST_TOLD: usize = 1000;

/// Takes trials out: their rows, labels and frames, and the files they were made of.
///
/// # Errors
/// No corpus, one that somebody else changes, nobody of that name, a question that cannot be understood.
pub fn remove(order: &RemoveOrder) -> Result<RemoveReport, Error> {
    let mut store = Store::open_to_change(&order.corpus)?;
    let question = match (&order.subject, &order.question) {
        (Some(id), None) => Question::One(FieldTest {
            field: QueryField::Trial("subject".to_owned(), ColumnKind::Text),
            test: Test::Compare(Comparison::Equal, Literal::Text(id.clone())),
            nowhere: false,
        }),
        (None, Some(question)) if !question.trim().is_empty() => Question::parse(question)?,
        _ => {
            return Err(Error::new("nothing is named that is to go")
                .allowed("--subject ID, or --where QUESTION"));
        }
    };
    let mut going = Vec::new();
    Selection::new(&store, &question, false)?.trials(u64::MAX, |entry| {
        going.push(entry);
        Ok(())
    })?;
    let known = store.subjects()?;
    if let Some(id) = &order.subject
        && !known.iter().any(|of| of.subject.id == *id)
        && going.is_empty()
    {
        let names: Vec<&str> = known.iter().map(|of| of.subject.id.as_str()).collect();
        return Err(Error::of(ErrorKind::Unknown, "there is nobody of this id in the corpus")
            .at("--subject")
            .none_of(id, names, "take one of these"));
    }
    let people: Vec<String> = order
        .subject
        .iter()
        .cloned()
        .chain(going.iter().filter_map(|of| of.subject.clone()))
        .collect();
    let exports = store.version().exports.iter();
    let exports = exports.filter(|note| note.subjects.iter().any(|id| people.contains(id)));
    let exports: Vec<ExportNote> = exports.cloned().collect();
    if !order.dry_run {
        // Of a person no word stays, not even the id.
        let words = if order.subject.is_some() { "a person" } else { "trials" };
        store.remove(&going, order.subject.as_deref(), words)?;
    }
    Ok(RemoveReport {
        outcome: Outcome::Done,
        corpus: super::shown(store.root()),
        version: store.version().version.clone(),
        removed: going.len() as u64,
        trials: going.iter().take(MOST_TOLD).map(|of| of.trial.clone()).collect(),
        dry_run: order.dry_run,
        exports,
        left: store.version().trials,
    })
}
