//! Trials looked at and ranked by doubt: which are worth a person's time. Nothing is written.

use super::observer::{Event, Observer};
use super::report::Outcome;
use crate::clean::artefact::ArtefactKind;
use crate::clean::detect;
use crate::clean::joints;
use crate::clean::source::source;
use crate::clean::thresholds::{FILE_NAME, Thresholds};
use crate::error::{Error, ErrorKind, counted, either};
use crate::mocap::anatomy;
use crate::mocap::clip::Clip;
use crate::mocap::files::{self, CaptureFormat, CaptureOptions};
use crate::mocap::marker_files;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Most doubt where nobody says it.
const USUAL_DOUBT: f64 = 0.01;
/// Most files of a folder.
const MOST_FILES: usize = 100_000;
/// Deepest folder in a folder.
const DEEPEST: usize = 16;

/// Which trials are looked at.
#[derive(Clone, Debug, PartialEq)]
pub struct CheckOrder {
    /// A file of markers or of a skeleton in motion, or a folder of them.
    pub markers: PathBuf,
    /// Frames per second, where a file does not say them.
    pub rate_hz: Option<f64>,
    /// More doubt than this fails; by the folder's own thresholds unless it is said here, else more than 1 %.
    pub most_doubt: Option<f64>,
}

/// What was found.
#[derive(Clone, Debug, Serialize)]
pub struct CheckReport {
    /// `done`, or `done_with_loss` if a trial has more wrong with it than allowed, is cut off or cannot be read.
    pub outcome: Outcome,
    /// More doubt than this fails.
    pub most_doubt: f64,
    /// More artefacts of a kind than this fail, in one trial; kinds without a limit are not named.
    pub most: BTreeMap<ArtefactKind, usize>,
    /// The file of thresholds; null if the folder has none.
    pub thresholds: Option<String>,
    /// All trials: what cannot be read first, then those with most doubt.
    pub trials: Vec<TrialFigures>,
}

/// One trial.
#[derive(Clone, Debug, Serialize)]
pub struct TrialFigures {
    /// The file.
    pub markers: String,
    /// Share of all samples of labelled markers that are part of an artefact, from the first to the last frame of each
    /// marker; of a skeleton, of its joints; null if the trial cannot be read.
    pub doubt: Option<f64>,
    /// Artefacts of each kind.
    pub artefacts: BTreeMap<ArtefactKind, usize>,
    /// Labelled markers.
    pub marker_count: usize,
    /// Joints that were looked at, of a skeleton.
    pub joint_count: usize,
    /// From the first frame to the last, s.
    pub duration_s: f64,
    /// Frames that the file claims and does not hold: it is cut off.
    pub lost_frames: u64,
    /// What is above its threshold: `doubt`, or a kind of artefact.
    pub above: Vec<String>,
    /// Why it cannot be read.
    pub error: Option<String>,
}

/// That a trial is cut off, behind its row of a table; nothing if it is not.
#[must_use]
pub fn cut_off_remark(lost_frames: u64) -> String {
    cut_off(lost_frames).map_or_else(String::new, |said| format!(" ({said})"))
}

/// Looks at trials.
///
/// # Errors
/// A folder that cannot be read, or without files of markers; thresholds that are none. A file among others that cannot
/// be read is part of the report.
pub fn check(order: &CheckOrder, observer: &dyn Observer) -> Result<CheckReport, Error> {
    let allowed = Allowed::of(&order.markers, order.most_doubt)?;
    let trials_of = if order.markers.is_dir() {
        let mut found = Vec::new();
        trials_in(&order.markers, 0, &mut found)?;
        found.sort();
        found
    } else {
        // Alone, a file that cannot be read is an error.
        if files::format_of(&order.markers).is_none() {
            marker_files::open(&order.markers)?;
        }
        vec![order.markers.clone()]
    };
    if trials_of.is_empty() {
        return Err(Error::of(ErrorKind::Absent, "the folder has no trials")
            .at(order.markers.display().to_string())
            .allowed(
                "files that end in .c3d, .trc, .csm, .bvh or .amc, or tables (.csv) of markers",
            ));
    }
    let total = trials_of.len() as u64;
    let mut trials = Vec::new();
    for (done, file) in trials_of.iter().enumerate() {
        observer.hear(Event::Step { done: done as u64, total, what: "trials" });
        trials.push(looked_at(file, order.rate_hz));
    }
    observer.hear(Event::Step { done: total, total, what: "trials" });
    let doubt = |of: &TrialFigures| of.doubt.unwrap_or(f64::INFINITY);
    trials.sort_by(|a, b| doubt(b).total_cmp(&doubt(a)).then(a.markers.cmp(&b.markers)));
    for trial in &mut trials {
        trial.above = allowed.above(trial);
    }
    let is_good = trials.iter().all(|of| of.above.is_empty() && of.lost_frames == 0);
    let outcome = if is_good { Outcome::Done } else { Outcome::DoneWithLoss };
    let thresholds = allowed.file.map(|file| file.display().to_string());
    let Allowed { most_doubt, most, .. } = allowed;
    Ok(CheckReport { outcome, most_doubt, most, thresholds, trials })
}

/// Says that a file is cut off.
pub(super) fn cut_off(lost_frames: u64) -> Option<String> {
    (lost_frames > 0).then(|| {
        format!(
            "the file is cut off: {lost_frames} that it claims {are} not there",
            lost_frames = counted(lost_frames, "frame"),
            are = either(lost_frames, "is", "are")
        )
    })
}

/// What a trial may have wrong with it.
pub(super) struct Allowed {
    pub(super) most_doubt: f64,
    pub(super) most: BTreeMap<ArtefactKind, usize>,
    /// The file of thresholds.
    pub(super) file: Option<PathBuf>,
}

impl Allowed {
    /// By the folder's own thresholds, unless more or less doubt is asked for.
    ///
    /// # Errors
    /// Thresholds that are none.
    pub(super) fn of(folder: &Path, most_doubt: Option<f64>) -> Result<Self, Error> {
        let (file, own) = thresholds(folder)?.unzip();
        let own_doubt = own.as_ref().and_then(|of| of.most_doubt_percent);
        let most_doubt = most_doubt.or(own_doubt.map(|percent| percent / 100.0));
        let most = own.map(|of| of.most).unwrap_or_default();
        Ok(Self { most_doubt: most_doubt.unwrap_or(USUAL_DOUBT), most, file })
    }

    /// What of a trial is above: `doubt`, or a kind of artefact.
    pub(super) fn above(&self, trial: &TrialFigures) -> Vec<String> {
        let is_doubtful = trial.doubt.is_none_or(|doubt| doubt > self.most_doubt);
        let has = |kind| trial.artefacts.get(kind).copied().unwrap_or(0);
        let kinds = self.most.iter().filter(|(kind, most)| has(kind) > **most);
        let doubt = is_doubtful.then(|| "doubt".to_owned());
        doubt.into_iter().chain(kinds.map(|(kind, _)| kind.word().to_owned())).collect()
    }
}

/// The thresholds that lie in a folder, if they do.
fn thresholds(folder: &Path) -> Result<Option<(PathBuf, Thresholds)>, Error> {
    let file = folder.join(FILE_NAME);
    if !folder.is_dir() || !file.exists() {
        return Ok(None);
    }
    let text = gaitway_profiles::read_text(&file)?;
    let read = Thresholds::parse(&text).map_err(|error| error.in_file(&file))?;
    Ok(Some((file, read)))
}

fn trials_in(folder: &Path, depth: usize, found: &mut Vec<PathBuf>) -> Result<(), Error> {
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
            trials_in(&path, depth + 1, found)?;
        } else if !kind.is_dir() && is_trial(&path) {
            if found.len() >= MOST_FILES {
                return Err(Error::of(ErrorKind::OutsideLimits, "the folder has too many files")
                    .at(folder.display().to_string())
                    .allowed(format!("at most {MOST_FILES}"))
                    .remedy("look at its folders one by one"));
            }
            found.push(path);
        }
    }
    Ok(())
}

/// Adds the files of markers of a folder, by name.
///
/// # Errors
/// A folder that cannot be read.
pub(super) fn marker_files_in(folder: &Path, found: &mut Vec<PathBuf>) -> Result<(), Error> {
    let mut all = Vec::new();
    trials_in(folder, 0, &mut all)?;
    all.retain(|path| marker_files::format_of(path).is_some());
    all.sort();
    found.extend(all);
    Ok(())
}

fn is_trial(path: &Path) -> bool {
    // Pipes and devices are none; what leads nowhere is told of.
    let is_other = std::fs::metadata(path).is_ok_and(|found| !found.is_file());
    if is_other {
        return false;
    }
    marker_files::format_of(path).is_some() || files::format_of(path).is_some()
}

/// A skeleton in motion: its joints.
fn joints_of(file: &Path, rate_hz: Option<f64>, figures: &mut TrialFigures) -> Result<(), Error> {
    // A BVH file has its rate in it.
    let is_told = files::format_of(file) == Some(CaptureFormat::Bvh);
    let options =
        CaptureOptions { rate_hz: rate_hz.filter(|_| !is_told), ..CaptureOptions::default() };
    let capture = anatomy::capture(&Clip::new(files::read(file, &options)?.bvh, None)?)?;
    let found = joints::artefacts(&capture.poses, &capture.tracked, capture.rate_hz);
    figures.joint_count = joints::jointed(&capture.tracked).count();
    figures.duration_s = capture.poses.len().saturating_sub(1) as f64 / capture.rate_hz;
    let samples = figures.joint_count * capture.poses.len();
    let wrong: usize = found.iter().map(|artefact| artefact.frames.len()).sum();
    figures.doubt = Some((wrong as f64 / samples.max(1) as f64).min(1.0));
    for artefact in &found {
        *figures.artefacts.entry(artefact.kind).or_default() += 1;
    }
    Ok(())
}

pub(super) fn looked_at(file: &Path, rate_hz: Option<f64>) -> TrialFigures {
    let mut figures = TrialFigures {
        markers: file.display().to_string(),
        doubt: None,
        artefacts: BTreeMap::new(),
        marker_count: 0,
        joint_count: 0,
        duration_s: 0.0,
        lost_frames: 0,
        above: Vec::new(),
        error: None,
    };
    if files::format_of(file).is_some() {
        figures.error =
            joints_of(file, rate_hz, &mut figures).err().map(|error| error.in_one_line());
        return figures;
    }
    let read = marker_files::read(file, rate_hz);
    let read = read.and_then(|markers| Ok((source(&markers)?, markers.head().lost_frames)));
    let trial = match read {
        Ok((source, lost_frames)) => {
            figures.lost_frames = lost_frames;
            source.trial
        }
        Err(error) => {
            figures.error = Some(error.in_one_line());
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
