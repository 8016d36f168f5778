//! Trials looked at and ranked by doubt: which are worth a person's time. Nothing is written.

use super::observer::{Event, Observer};
use super::report::Outcome;
use crate::clean::artefact::ArtefactKind;
use crate::clean::detect;
use crate::clean::source::source;
use crate::error::{Error, ErrorKind};
use crate::mocap::marker_files;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Most files of a folder.
const MOST_FILES: usize = 100_000;
/// Deepest folder in a folder.
const DEEPEST: usize = 16;

/// Which trials are looked at.
#[derive(Clone, Debug, PartialEq)]
pub struct CheckOrder {
    /// A file of markers, or a folder of them.
    pub markers: PathBuf,
    /// Frames per second, where a file does not say them.
    pub rate_hz: Option<f64>,
    /// More doubt than this fails.
    pub most_doubt: f64,
}

/// What was found.
#[derive(Clone, Debug, Serialize)]
pub struct CheckReport {
    /// `done`, or `done_with_loss` if a trial has more doubt than allowed or cannot be read.
    pub outcome: Outcome,
    /// More doubt than this fails.
    pub most_doubt: f64,
    /// All trials: what cannot be read first, then those with most doubt.
    pub trials: Vec<TrialFigures>,
}

/// One trial.
#[derive(Clone, Debug, Serialize)]
pub struct TrialFigures {
    /// The file.
    pub markers: String,
    /// Share of all samples of labelled markers that are part of an artefact, from the first to the last frame of each
    /// marker; null if the trial cannot be read.
    pub doubt: Option<f64>,
    /// Artefacts of each kind.
    pub artefacts: BTreeMap<ArtefactKind, usize>,
    /// Labelled markers.
    pub marker_count: usize,
    /// From the first frame to the last, s.
    pub duration_s: f64,
    /// Why it cannot be read.
    pub error: Option<String>,
}

/// Looks at trials.
///
/// # Errors
/// A folder that cannot be read, or without files of markers. A file among others that cannot be read is part of the
/// report.
pub fn check(order: &CheckOrder, observer: &dyn Observer) -> Result<CheckReport, Error> {
    let files = if order.markers.is_dir() {
        let mut files = Vec::new();
        marker_files_in(&order.markers, 0, &mut files)?;
        files.sort();
        files
    } else {
        // Alone, a file that cannot be read is an error.
        marker_files::open(&order.markers)?;
        vec![order.markers.clone()]
    };
    if files.is_empty() {
        return Err(Error::of(ErrorKind::Absent, "the folder has no files of markers")
            .at(order.markers.display().to_string())
            .allowed("files that end in .c3d, .trc or .csm, or tables (.csv) of markers"));
    }
    let total = files.len() as u64;
    let mut trials = Vec::new();
    for (done, file) in files.iter().enumerate() {
        observer.hear(Event::Step { done: done as u64, total, what: "trials" });
        trials.push(looked_at(file, order.rate_hz));
    }
    observer.hear(Event::Step { done: total, total, what: "trials" });
    let doubt = |of: &TrialFigures| of.doubt.unwrap_or(f64::INFINITY);
    trials.sort_by(|a, b| doubt(b).total_cmp(&doubt(a)).then(a.markers.cmp(&b.markers)));
    let is_good = trials.iter().all(|of| doubt(of) <= order.most_doubt);
    let outcome = if is_good { Outcome::Done } else { Outcome::DoneWithLoss };
    Ok(CheckReport { outcome, most_doubt: order.most_doubt, trials })
}

fn marker_files_in(folder: &Path, depth: usize, files: &mut Vec<PathBuf>) -> Result<(), Error> {
    let unreadable = |cause: std::io::Error| {
        Error::of((&cause).into(), "the folder cannot be read")
            .at(folder.display().to_string())
            .got(cause.to_string())
    };
    for entry in std::fs::read_dir(folder).map_err(unreadable)? {
        let entry = entry.map_err(unreadable)?;
        let path = entry.path();
        // A link may lead back to where it is.
        let kind = entry.file_type().map_err(unreadable)?;
        if kind.is_dir() && depth < DEEPEST {
            marker_files_in(&path, depth + 1, files)?;
        } else if !kind.is_dir() && marker_files::format_of(&path).is_some() {
            if files.len() >= MOST_FILES {
                return Err(Error::of(ErrorKind::OutsideLimits, "the folder has too many files")
                    .at(folder.display().to_string())
                    .allowed(format!("at most {MOST_FILES}"))
                    .remedy("look at its folders one by one"));
            }
            files.push(path);
        }
    }
    Ok(())
}

fn looked_at(file: &Path, rate_hz: Option<f64>) -> TrialFigures {
    let mut figures = TrialFigures {
        markers: file.display().to_string(),
        doubt: None,
        artefacts: BTreeMap::new(),
        marker_count: 0,
        duration_s: 0.0,
        error: None,
    };
    let trial = match marker_files::read(file, rate_hz).and_then(|markers| source(&markers)) {
        Ok(source) => source.trial,
        Err(error) => {
            figures.error = Some(error.what);
            return figures;
        }
    };
    let found = detect::artefacts(&trial, |_, _| {});
    let samples: usize = (0..trial.markers())
        .filter_map(|marker| {
            let runs = trial.seen_runs(marker);
            Some(runs.last()?.end - runs.first()?.start)
        })
        .sum();
    let mut wrong = 0;
    for artefact in &found {
        *figures.artefacts.entry(artefact.kind).or_default() += 1;
        wrong += artefact.frames.len() * if artefact.with.is_some() { 2 } else { 1 };
    }
    figures.doubt = Some((wrong as f64 / samples.max(1) as f64).min(1.0));
    figures.marker_count = trial.markers();
    figures.duration_s = trial.frames().saturating_sub(1) as f64 / trial.rate_hz();
    figures
}
