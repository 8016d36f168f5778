//! What came of a session.

use crate::job::report::Outcome;
use crate::session::{Folder, Progress, Verdict};
use serde::Serialize;
use std::path::PathBuf;

/// What came of a session, or what there is of it so far.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct SessionReport {
    /// Done; or stopped, to be gone on with.
    pub outcome: Outcome,
    /// Its folder.
    pub session: PathBuf,
    /// Ids of the subjects who were measured.
    pub subjects: Vec<String>,
    /// Trials that were judged.
    pub trials: usize,
    /// Of these, those that are kept.
    pub kept: usize,
    /// Good repetitions in those that are kept.
    pub good_repetitions: u32,
    /// What the folder holds; written once nothing is left to be done.
    pub manifest: Option<PathBuf>,
}

impl SessionReport {
    pub(super) fn of(outcome: Outcome, folder: &Folder, progress: &Progress) -> Self {
        let kept = progress.trials.iter().filter(|trial| trial.verdict == Verdict::Keep);
        Self {
            outcome,
            session: folder.root().to_owned(),
            subjects: progress.subjects.keys().cloned().collect(),
            trials: progress.trials.len(),
            kept: kept.count(),
            good_repetitions: progress.trials.iter().map(|trial| trial.counted()).sum(),
            manifest: progress.finished.then(|| folder.path("manifest.toml")),
        }
    }
}
