//! What is done with a motion database: made, added to, filled, asked, checked, passed on, taken from.

mod about;
mod add;
mod ask;
mod check;
mod coverage_plot;
mod export;
pub(in crate::job) mod generate;
mod labels;
mod lerobot;
mod npz;
mod plan;
mod remove;
mod trial;
mod variations;
mod words;

pub use about::{AboutTrial, consent, parameter};
pub use add::{AddOrder, AddReport, FoundTrial, add};
pub use ask::{Answer, AskOrder, AskReport, ask};
pub use check::{CheckReport, Fault as CorpusFault, check};
pub use export::{ExportFormat, ExportOrder, ExportReport, ExportedTrial, Withheld, export};
pub use generate::{GenerateOrder, GenerateReport, GeneratedTrial, generate};
pub use plan::{PlanOrder, PlanReport, PlannedState, plan};
pub use remove::{RemoveOrder, RemoveReport, remove};
pub(in crate::job) use trial::capture_of;

use crate::corpus::manifest::{CorpusManifest, FiveChoices, SCHEMA};
use crate::corpus::store::Store;
use crate::error::Error;
use crate::job::report::Outcome;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// What a new corpus is to be.
#[derive(Clone, Debug, Default)]
pub struct NewOrder {
    /// Its folder.
    pub folder: PathBuf,
    /// What it is called; the folder's name if nobody says.
    pub name: Option<String>,
    /// The five choices, as far as somebody says them.
    pub choices: FiveChoices,
}

/// What was made.
#[derive(Clone, Debug, Serialize)]
pub struct NewReport {
    /// `done`.
    pub outcome: Outcome,
    /// The folder.
    pub corpus: String,
    /// What it is called.
    pub name: String,
    /// Its version.
    pub version: String,
    /// The file in which the five choices stand.
    pub manifest: String,
    /// Choices that nobody said yet.
    pub unsaid: Vec<&'static str>,
}

/// Makes a new corpus.
///
/// # Errors
/// A folder that holds something, or cannot be written.
pub fn new(order: &NewOrder) -> Result<NewReport, Error> {
    let own = || order.folder.file_name().map(|name| name.to_string_lossy().into_owned());
    let name = order.name.clone().or_else(own).unwrap_or_else(|| "corpus".to_owned());
    let manifest =
        CorpusManifest { schema: SCHEMA, name: name.clone(), choices: order.choices.clone() };
    let store = Store::create(&order.folder, &manifest)?;
    let FiveChoices {
        data_type,
        range_of_motion,
        range_of_subjects,
        definition_and_execution,
        output,
    } = &order.choices;
    let said = [
        ("data_type", data_type),
        ("range_of_motion", range_of_motion),
        ("range_of_subjects", range_of_subjects),
        ("definition_and_execution", definition_and_execution),
        ("output", output),
    ];
    Ok(NewReport {
        outcome: Outcome::Done,
        corpus: shown(&order.folder),
        name,
        version: store.version().version.clone(),
        manifest: shown(&order.folder.join("corpus.toml")),
        unsaid: said.iter().filter(|(_, text)| text.is_empty()).map(|(name, _)| *name).collect(),
    })
}

/// Refuses a file in the folder of a corpus: everything there is the corpus's own.
fn check_outside(corpus: &Path, file: &Path) -> Result<(), Error> {
    // A file without a folder lies where one is; a link is where it leads to.
    let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty());
    let folder = folder.unwrap_or_else(|| Path::new("."));
    let is_inside =
        match (corpus.canonicalize(), file.canonicalize().or_else(|_| folder.canonicalize())) {
            (Ok(corpus), Ok(folder)) => folder.starts_with(corpus),
            // What is not there is said by whoever opens it.
            _ => false,
        };
    if is_inside {
        return Err(Error::new("a file in a corpus would be taken for a part of it")
            .at(shown(file))
            .allowed(format!("a place outside {}", shown(corpus))));
    }
    Ok(())
}

fn shown(path: &Path) -> String {
    path.display().to_string()
}
