//! What several people do, or one as several sources saw it, named side by side.

use super::labels::{is_folder_name, write_recognised};
use super::recognise::{
    RecogniseOrder, RecogniseReport, RecognisedAction, RecognitionEvent, recognise,
};
use crate::draft;
use crate::error::{Error, ErrorKind};
use crate::recognise::model::BodySide;
use crate::table::TableWriter;
use serde::Serialize;

/// Most sources in one run.
const MOST_SOURCES: usize = 1_000;

/// Something that happens in one of several sources.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SourceEvent<'a> {
    /// Which.
    pub source: &'a str,
    /// What.
    #[serde(flatten)]
    pub event: RecognitionEvent,
}

/// What was recognised in several sources.
#[derive(Clone, Debug, Serialize)]
pub struct RecogniseEachReport {
    /// `done`.
    pub outcome: &'static str,
    /// One by one, in the order in which they were named.
    pub sources: Vec<RecogniseReport>,
}

impl RecogniseEachReport {
    /// All that was recognised, with its source, in the order in which it was known.
    #[must_use]
    pub fn events(&self) -> Vec<(&str, &RecognisedAction)> {
        let mut events = Vec::new();
        for report in &self.sources {
            events.extend(report.events.iter().map(|event| (report.motion.as_str(), event)));
        }
        events.sort_by(|a, b| a.1.recognised_at_s.total_cmp(&b.1.recognised_at_s));
        events
    }
}

/// Recognises what is done in several motions, as if all began at one moment: events are told to `hear` in the order of their
/// times. The order says how; its own motion is not looked at.
///
/// # Errors
/// A motion or a model that cannot be read, a motion that is named twice, a page, a table that cannot be written.
pub fn recognise_each(
    order: &RecogniseOrder,
    motions: &[String],
    mut hear: impl FnMut(&SourceEvent<'_>),
) -> Result<RecogniseEachReport, Error> {
    if motions.len() > MOST_SOURCES {
        return Err(Error::of(ErrorKind::OutsideLimits, "too many sources")
            .got(motions.len().to_string())
            .allowed(MOST_SOURCES.to_string()));
    }
    if order.html.is_some() {
        return Err(Error::new("a page shows one person").at("--html").remedy("name one motion"));
    }
    let (mut sources, mut told) = (Vec::new(), Vec::new());
    for (at, motion) in motions.iter().enumerate() {
        if motions[..at].contains(motion) {
            return Err(Error::new("one motion is named twice").got(motion.clone()));
        }
        let one = RecogniseOrder { motion: motion.clone(), labels: None, ..order.clone() };
        let hear_one = |event: &RecognitionEvent| {
            told.push(SourceEvent { source: motion, event: event.clone() });
        };
        sources.push(recognise(&one, hear_one)?);
    }
    // Of one moment in the order of the sources.
    told.sort_by(|a, b| a.event.at_s.total_cmp(&b.event.at_s));
    told.iter().for_each(&mut hear);
    let report = RecogniseEachReport { outcome: "done", sources };
    match &order.labels {
        Some(path) if is_folder_name(path) => {
            let trials: Vec<_> = report.sources.iter().map(RecogniseReport::labelled).collect();
            write_recognised(path, order.replace, &trials)?;
        }
        Some(path) => draft::write_file(path, order.replace, &labels(&report)?)?,
        None => {}
    }
    Ok(report)
}

/// A table of what was recognised, as `score classification` reads it.
fn labels(report: &RecogniseEachReport) -> Result<Vec<u8>, Error> {
    let mut out = TableWriter::new(Vec::new());
    out.row(["file", "start_s", "end_s", "class", "side"])?;
    for (source, event) in report.events() {
        out.row([
            source.to_owned(),
            format!("{:.4}", event.start_s),
            format!("{:.4}", event.end_s),
            event.action.clone(),
            event.side.map_or("", BodySide::word).to_owned(),
        ])?;
    }
    out.finish()
}
