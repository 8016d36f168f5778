//! What is done with a motion database: made, added to, filled, asked, checked, passed on, taken from.

mod about;
mod add;
mod ask;
mod bones_seed;
mod check;
mod coverage_plot;
mod export;
pub(in crate::job) mod generate;
mod inside;
mod labels;
mod lerobot;
mod plan;
mod remove;
mod shipped;
mod trial;
mod variations;
mod words;

pub use about::{AboutTrial, consent, parameter};
pub use add::{AddOrder, AddReport, FoundTrial, add};
pub use ask::{Answer, AskOrder, AskReport, ask};
pub use bones_seed::metadata as bones_seed_metadata;
pub use check::{CheckReport, Fault as CorpusFault, check};
pub(super) use export::stem_of;
pub use export::{ExportFormat, ExportOrder, ExportReport, ExportedTrial, Withheld, export};
pub use generate::{GenerateOrder, GenerateReport, GeneratedTrial, generate};
pub use plan::{PlanOrder, PlanReport, PlannedState, plan};
pub use remove::{RemoveOrder, RemoveReport, remove};
pub(in crate::job) use trial::capture_of;

use crate::corpus::manifest::{CorpusManifest, FiveChoices, SCHEMA};
use crate::corpus::store::{Store, check_outside};
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
    // In its own folder, the corpus that is there already is named.
    order.folder.parent().map_or(Ok(()), check_outside)?;
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

fn shown(path: &Path) -> String {
    path.display().to_string()
}
