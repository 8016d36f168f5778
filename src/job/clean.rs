//! Markers cleaned: what is wrong with a trial is found and mended, and what was done is a list that can be changed and
//! applied again.

use super::clean_aids::{AidFiles, NamedAids, found};
use super::clean_check::{cut_off, marker_files_in};
use super::markers::written;
use super::observer::{Event, Observer};
use super::page;
use super::report::Outcome;
use crate::clean::artefact::{Artefact, ArtefactKind, Cause};
use crate::clean::choice::{Chooser, ExpectedFrom};
use crate::clean::detect;
use crate::clean::edits::{
    Change, Edit, EditList, EditStep, Filled, MAX_BYTES, SCHEMA, fill, prepare,
};
use crate::clean::fill::Method;
use crate::clean::source::{
    Cleaned, CroppedFrames, Digest, NamedSamples, SourceMarkers, digest, source_and,
};
use crate::clean::trial::{Gap, Trial};
use crate::draft::{Drafts, check_free};
use crate::error::{Error, ErrorKind};
use crate::job::report::counted;
use crate::mocap::marker_files;
use crate::mocap::markers::{FramesOf, Head, Markers};
use crate::view::ViewPage;
use crate::view::scene::ViewScene;
use crate::view::tracks::{SpanKind, ViewSpan};
use serde::Serialize;
use std::collections::{BTreeMap, HashSet};
use std::ops::Range;
use std::path::{Path, PathBuf};

pub use crate::clean::edits::Remedy;

/// Markers that a note names.
const NAMED: usize = 8;

/// Ending of an edit list beside what it made.
const EDITS_ENDING: &str = "edits.toml";

/// Which trial is cleaned into which file.
#[derive(Clone, Debug, PartialEq)]
pub struct CleanOrder {
    /// A file of markers.
    pub markers: PathBuf,
    /// Frames per second, where the file does not say them.
    pub rate_hz: Option<f64>,
    /// The file, whose ending says what is written.
    pub file: PathBuf,
    /// The edit list: applied if it is there, else written. `None`: written beside `file`.
    pub edits: Option<PathBuf>,
    /// Gaps whose fill is expected to miss by more are left, m.
    pub tolerance_m: f64,
    /// Markers of the same person who stands still, for fills by the skeleton; without it the trial shows the body itself.
    pub static_trial: Option<PathBuf>,
    /// Other trials from which fills may be learned, files or folders of them.
    pub others: Vec<PathBuf>,
    /// A page that shows it.
    pub html: Option<PathBuf>,
    /// Files may replace those that are there.
    pub replace: bool,
}

impl CleanOrder {
    /// Where the edit list is, or is to be.
    #[must_use]
    pub fn edit_list(&self) -> PathBuf {
        self.edits.clone().unwrap_or_else(|| self.file.with_extension(EDITS_ENDING))
    }
}

/// What came of it.
#[derive(Clone, Debug, Serialize)]
pub struct CleanReport {
    /// `done`, or `done_with_loss` if something was found and not mended.
    pub outcome: Outcome,
    /// The file.
    pub markers: String,
    /// Labelled markers.
    pub marker_count: usize,
    /// Frames.
    pub frames: usize,
    /// Frames per second.
    pub rate_hz: f64,
    /// What is wrong; by an edit list, what it says was wrong.
    pub artefacts: Vec<ArtefactFigures>,
    /// All samples that no edit names: the same before and after.
    pub untouched_sha256: UntouchedFigures,
    /// Frames at both ends that are left out.
    pub cropped_frames: usize,
    /// Samples that were filled in.
    pub filled_samples: usize,
    /// Samples that were taken out.
    pub removed_samples: usize,
    /// What was found out, taken for granted or left.
    pub notes: Vec<String>,
    /// Page written.
    pub html: Option<String>,
    /// Minutes that a person spent on the edit list, as it says itself.
    pub person_minutes: Option<f64>,
    /// The edit list.
    pub edits: String,
    /// Where.
    pub written: String,
}

/// One thing that is wrong.
#[derive(Clone, Debug, Serialize)]
pub struct ArtefactFigures {
    /// What.
    pub kind: ArtefactKind,
    /// Name of the marker.
    pub marker: String,
    /// Of a swap, the other marker.
    pub with: Option<String>,
    /// Its first frame, s since the first of the file.
    pub start_s: f64,
    /// The end of its last frame, s.
    pub end_s: f64,
    /// Why, where that can be told.
    pub cause: Option<Cause>,
    /// How sure that is, 0 to 1; null of what an edit list says.
    pub confidence: Option<f64>,
    /// What is done.
    pub remedy: Remedy,
    /// How the gap is filled.
    pub fill: Option<Method>,
    /// How far the fill is expected to miss, m: the mean over as long gaps that were cut elsewhere; null where nothing was
    /// filled, or nobody knows.
    pub expected_error_m: Option<f64>,
    /// Where they were cut: `this_trial`, `other_trials`, or those of which figures are `stored`.
    pub expected_from: Option<ExpectedFrom>,
}

/// The samples that no edit names.
#[derive(Clone, Debug, Serialize)]
pub struct UntouchedFigures {
    /// How many.
    pub samples: u64,
    /// SHA-256 of them in the file that was read.
    pub before: String,
    /// SHA-256 of them in what was written.
    pub after: String,
}

/// What is to be done, and why.
struct Plan {
    edits: Vec<Edit>,
    artefacts: Vec<ArtefactFigures>,
    notes: Vec<String>,
}

/// Cleans a trial.
///
/// # Errors
/// A file that cannot be read or holds no labelled markers, an ending that nobody writes, an edit list of another file,
/// files that exist or cannot be written.
pub fn clean(order: &CleanOrder, observer: &dyn Observer) -> Result<CleanReport, Error> {
    clean_with(order, None, observer)
}

/// The same, where what helps to fill gaps may have been read before.
pub(super) fn clean_with(
    order: &CleanOrder,
    aids: Option<AidFiles>,
    observer: &dyn Observer,
) -> Result<CleanReport, Error> {
    let Some(kind) = marker_files::written_as(&order.file) else {
        return Err(Error::of(ErrorKind::Unknown, "this kind of file cannot be written")
            .at(order.file.display().to_string())
            .allowed("of markers, a file that ends in .c3d, .trc, .csm or .csv"));
    };
    check_free(&order.file, order.replace)?;
    order.html.as_ref().map_or(Ok(()), |page| check_free(page, order.replace))?;
    let list_file = order.edit_list();
    let is_given = order.edits.as_ref().is_some_and(|file| file.exists());
    if !is_given {
        check_free(&list_file, order.replace)?;
    }
    let in_file = |error: Error| match error.place {
        None => error.at(order.markers.display().to_string()),
        Some(_) => error,
    };
    let markers = marker_files::read(&order.markers, order.rate_hz)?;
    let list = is_given.then(|| read_list(&list_file)).transpose()?;
    let named = list.as_ref().map(EditList::names).unwrap_or_default();
    let source = source_and(&markers, &named).map_err(in_file)?;
    let all = digest(&mut FramesOf::new(&markers), |_, _| true)?;
    let head = markers.head();
    let mut keep = 0..head.frames;
    let files = match aids {
        Some(aids) => aids,
        None => read_aids(order, list.as_ref()).map_err(|error| match is_given {
            true => error.in_file(&list_file),
            false => error,
        })?,
    };
    let person_minutes = list.as_ref().and_then(|list| list.minutes);
    let mut plan = match list {
        Some(list) => {
            check_aids(&files, &list).map_err(|error| error.in_file(&list_file))?;
            let kept = list.kept(head.first_frame, head.frames);
            keep = kept.map_err(|error| error.in_file(&list_file))?;
            applied(&list_file, list, &source.trial, head.first_frame, &all)?
        }
        None => planned(order, head, &source, &files, observer)?,
    };
    let steps = plan
        .edits
        .iter()
        .filter_map(|edit| EditStep::of(edit, &source.trial, head.first_frame).transpose())
        .collect::<Result<Vec<EditStep>, Error>>()
        .map_err(|error| match is_given {
            true => error.in_file(&list_file),
            false => error,
        })?;
    let mut trial = source.trial.clone();
    prepare(&mut trial, &steps);
    let mut aids = files.aids(head, &source, &trial, &mut Vec::new())?;
    let mut filled = fill(&mut Chooser::new(&mut trial, &mut aids), &steps, |done, total| {
        observer.hear(Event::Step { done: done as u64, total: total as u64, what: "gaps" });
    });
    filled.retain(|of| keep.contains(&of.frame));
    let mut unfilled = 0;
    if is_given {
        unfilled = tell_unfilled(&mut plan, &source.trial, head.first_frame, &keep, &filled)?;
    }
    let mut cleaned =
        CroppedFrames::new(Cleaned::new(&markers, &source, &steps, &filled), keep.clone());
    let mut made = Drafts::default();
    let left_out = written(&mut made, &order.file, order.replace, kind, &mut cleaned, observer)?;
    let named = NamedSamples::by(&steps, &source, head);
    let is_good = |point: usize, frame: usize| {
        keep.contains(&frame) && markers.sample(frame, point).is_some() && !named.has(point, frame)
    };
    let before = digest(&mut FramesOf::new(&markers), is_good)?;
    let after = digest(&mut Cleaned::new(&markers, &source, &steps, &filled), is_good)?;
    if let Some(path) = &order.html {
        let mut scene = page::body::markers(
            &mut FramesOf::new(&markers),
            Some(&mut Cleaned::new(&markers, &source, &steps, &filled)),
        )?;
        scene.spans.extend(plan.artefacts.iter().map(ArtefactFigures::span));
        let page = html(order, &plan, head.lost_frames, scene)?;
        made.write(path, order.replace, page.as_bytes())?;
    }
    if !is_given {
        let mut list = EditList {
            schema: SCHEMA,
            source: order.markers.display().to_string(),
            source_sha256: Some(all.sha256),
            keep_frames: None,
            minutes: None,
            static_trial: None,
            other_trials: Vec::new(),
            aids_sha256: None,
            edits: plan.edits,
        };
        let named = used(&files, &list)?;
        (list.static_trial, list.other_trials) = (named.static_trial, named.others);
        list.aids_sha256 = named.sha256;
        made.write(&list_file, order.replace, list.to_text()?.as_bytes())?;
    }
    made.keep()?;
    let told =
        cut_off(head.lost_frames).into_iter().chain(late_clock(head, source.trial.rate_hz()));
    let told: Vec<String> = told.collect();
    let notes = told.iter().chain(&head.notes).chain(&source.notes).chain(&plan.notes);
    let notes = notes.chain(&left_out);
    let is_whole = plan.artefacts.iter().all(ArtefactFigures::is_mended)
        && head.lost_frames == 0
        && unfilled == 0;
    Ok(CleanReport {
        outcome: if is_whole { Outcome::Done } else { Outcome::DoneWithLoss },
        markers: order.markers.display().to_string(),
        marker_count: source.trial.markers(),
        frames: source.trial.frames(),
        rate_hz: source.trial.rate_hz(),
        untouched_sha256: UntouchedFigures {
            samples: before.samples,
            before: before.sha256,
            after: after.sha256,
        },
        cropped_frames: head.frames - keep.len(),
        filled_samples: filled.len(),
        removed_samples: removed(&markers, &source, &steps),
        notes: notes.cloned().collect(),
        artefacts: plan.artefacts,
        html: order.html.as_ref().map(|path| path.display().to_string()),
        person_minutes,
        edits: list_file.display().to_string(),
        written: order.file.display().to_string(),
    })
}

/// Says that times here begin later than those of events.
fn late_clock(head: &Head, rate_hz: f64) -> Option<String> {
    let before_s = head.first_frame.saturating_sub(1) as f64 / rate_hz;
    (before_s > 0.0).then(|| {
        format!(
            "times count from the first frame here, frame {} of the capture: events count {before_s:.3} s more",
            head.first_frame
        )
    })
}

/// Says which fills of an edit list could not be made, all or in part: how many samples are taken out and not filled.
fn tell_unfilled(
    plan: &mut Plan,
    trial: &Trial,
    first_frame: u64,
    keep: &Range<usize>,
    filled: &[Filled],
) -> Result<usize, Error> {
    let made: HashSet<(usize, usize)> = filled.iter().map(|of| (of.marker, of.frame)).collect();
    let mut all = 0;
    for (artefact, edit) in plan.artefacts.iter_mut().zip(&plan.edits) {
        let step = EditStep::of(edit, trial, first_frame)?;
        let Some(EditStep { marker, frames, change: Change::Fill(method) }) = step else {
            continue;
        };
        let wanted = frames.filter(|frame| keep.contains(frame));
        let lacking = wanted.filter(|frame| !made.contains(&(marker, *frame))).count();
        if lacking > 0 {
            all += lacking;
            (artefact.remedy, artefact.fill) = (Remedy::Remove, None);
            plan.notes.push(format!(
                "{} from frame {}: {} cannot fill {lacking}, which are taken out and not filled",
                edit.marker,
                edit.first_frame,
                method.word(),
                lacking = counted(lacking, "frame")
            ));
        }
    }
    Ok(all)
}

/// The page: markers as they are now, and as they were, with everything that is wrong on the time line.
fn html(
    order: &CleanOrder,
    plan: &Plan,
    lost_frames: u64,
    scene: ViewScene,
) -> Result<String, Error> {
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for artefact in &plan.artefacts {
        *counts.entry(artefact.kind.word()).or_default() += 1;
    }
    let rows = counts.iter().map(|(kind, count)| ((*kind).to_owned(), count.to_string()));
    let duration = ("duration".to_owned(), format!("{:.2} s", scene.duration_s));
    let is_left = |of: &&ArtefactFigures| matches!(of.remedy, Remedy::Leave | Remedy::Remove);
    let left = plan.artefacts.iter().filter(is_left).count();
    ViewPage {
        title: format!("{} cleaned to {}", order.markers.display(), order.file.display()),
        summary_rows: rows.chain([duration]).collect(),
        warnings: (left > 0)
            .then(|| format!("{left} found and not mended"))
            .into_iter()
            .chain(cut_off(lost_frames))
            .collect(),
        notes: plan.notes.clone(),
        scene,
    }
    .html()
}

impl ArtefactFigures {
    /// True if nothing is left to do about it. What a person took out was meant to be out.
    #[must_use]
    pub fn is_mended(&self) -> bool {
        matches!(self.remedy, Remedy::Fill | Remedy::Exchange) || self.kind == ArtefactKind::ByHand
    }

    /// Where it stands on the time line.
    fn span(&self) -> ViewSpan {
        let (kind, done) = match self.remedy {
            Remedy::Fill => (SpanKind::Mended, "filled"),
            Remedy::Exchange => (SpanKind::Mended, "exchanged"),
            Remedy::Remove => (SpanKind::Wrong, "taken out, not filled"),
            Remedy::Leave => (SpanKind::Wrong, "left"),
        };
        let with = self.with.as_ref().map_or_else(String::new, |with| format!(" and {with}"));
        let label = format!("{}{with}: {done}", self.marker);
        ViewSpan::new(kind, self.kind.word(), &label, self.start_s, self.end_s)
    }
}

/// Samples that were seen and are taken out, filled again or not.
fn removed(markers: &Markers, source: &SourceMarkers, steps: &[EditStep]) -> usize {
    let taken: Vec<EditStep> =
        steps.iter().filter(|step| !matches!(step.change, Change::Exchange(_))).cloned().collect();
    let named = NamedSamples::by(&taken, source, markers.head());
    let seen = |point: &usize, frame: &usize| {
        named.has(*point, *frame) && markers.sample(*frame, *point).is_some()
    };
    let frames = || 0..markers.head().frames;
    source.points.iter().map(|point| frames().filter(|frame| seen(point, frame)).count()).sum()
}

/// Reads an edit list.
fn read_list(path: &Path) -> Result<EditList, Error> {
    let read = |cause: std::io::Error| {
        Error::of((&cause).into(), "the edit list cannot be read")
            .at(path.display().to_string())
            .got(cause.to_string())
    };
    let found = std::fs::metadata(path).map_err(read)?;
    if !found.is_file() {
        return Err(Error::new("an edit list is a file")
            .at(path.display().to_string())
            .got("a folder, a pipe or a device")
            .remedy("name a file that `gaitway clean` wrote, or one that is to be written"));
    }
    let length = found.len();
    if length > MAX_BYTES as u64 {
        return Err(Error::of(ErrorKind::OutsideLimits, "the edit list is too large")
            .at(path.display().to_string())
            .got(counted(length, "byte"))
            .allowed(format!("at most {MAX_BYTES} bytes")));
    }
    let text = std::fs::read_to_string(path).map_err(read)?;
    EditList::parse(&text).map_err(|error| error.in_file(path))
}

/// Reads the trials that help to fill gaps: those that were named, else those of an edit list.
fn read_aids(order: &CleanOrder, list: Option<&EditList>) -> Result<AidFiles, Error> {
    let own = &order.markers;
    let listed = list.and_then(|list| list.static_trial.as_ref());
    let listed = listed.filter(|_| order.static_trial.is_none());
    let listed = listed.map(|named| found(named, own)).transpose()?;
    let static_trial = order.static_trial.clone().or(listed);
    let mut others = Vec::new();
    for named in &order.others {
        match named.is_dir() {
            true => marker_files_in(named, &mut others)?,
            false => others.push(named.clone()),
        }
    }
    if let Some(list) = list.filter(|_| order.others.is_empty()) {
        for named in &list.other_trials {
            others.push(found(named, own)?);
        }
    }
    AidFiles::read(static_trial.as_deref(), &others, own, order.rate_hz)
}

/// What an edit list says of the trials that its fills make use of.
fn used(files: &AidFiles, list: &EditList) -> Result<NamedAids, Error> {
    files.named(list.fills_by(Method::Skeleton), list.fills_by(Method::OtherTrials))
}

/// Fails if they are others than those that the list was made with.
fn check_aids(files: &AidFiles, list: &EditList) -> Result<(), Error> {
    let sha256 = used(files, list)?.sha256;
    if list.aids_sha256.is_none() || list.aids_sha256 == sha256 {
        return Ok(());
    }
    Err(Error::new("the trials that fills make use of are not those the list was made with")
        .at("aids_sha256")
        .remedy("give those, or delete this line to take the ones that are there"))
}

/// What an edit list says.
fn applied(
    path: &Path,
    list: EditList,
    trial: &Trial,
    first_frame: u64,
    all: &Digest,
) -> Result<Plan, Error> {
    if list.source_sha256.as_ref().is_some_and(|of| *of != all.sha256) {
        return Err(Error::new("the edit list belongs to other markers")
            .at(path.display().to_string())
            .got(format!("edits for {}", list.source))
            .remedy(
                "apply it to the file it was made for, or delete its line source_sha256 to take \
                 it for this one",
            ));
    }
    let rate_hz = trial.rate_hz();
    let time_s = |frame: u64| frame.saturating_sub(first_frame) as f64 / rate_hz;
    let artefacts = list.edits.iter().map(|edit| ArtefactFigures {
        kind: edit.kind,
        marker: edit.marker.clone(),
        with: edit.with.clone(),
        start_s: time_s(edit.first_frame),
        end_s: time_s(edit.last_frame.saturating_add(1)),
        cause: None,
        confidence: None,
        remedy: edit.remedy,
        fill: edit.method.filter(|_| edit.remedy == Remedy::Fill),
        expected_error_m: None,
        expected_from: None,
    });
    Ok(Plan { artefacts: artefacts.collect(), edits: list.edits, notes: Vec::new() })
}

/// Finds what is wrong, and chooses what is done about it.
fn planned(
    order: &CleanOrder,
    head: &Head,
    source: &SourceMarkers,
    files: &AidFiles,
    observer: &dyn Observer,
) -> Result<Plan, Error> {
    let first_frame = head.first_frame;
    let found = detect::artefacts(&source.trial, |done, total| {
        observer.hear(Event::Step { done: done as u64, total: total as u64, what: "markers" });
    });
    let mut trial = source.trial.clone();
    let steps: Vec<EditStep> = found.iter().map(EditStep::unfilled).collect();
    prepare(&mut trial, &steps);
    let gaps: BTreeMap<usize, Vec<Gap>> =
        (0..trial.markers()).map(|marker| (marker, trial.gaps(marker))).collect();
    let mut body_notes = Vec::new();
    let mut aids = files.aids(head, source, &trial, &mut body_notes)?;
    let mut chooser = Chooser::new(&mut trial, &mut aids);
    let (mut edits, mut artefacts, mut notes) = (Vec::new(), Vec::new(), Vec::new());
    let rate_hz = source.trial.rate_hz();
    let name = |marker: usize| source.trial.labels().get(marker).cloned().unwrap_or_default();
    for (done, artefact) in found.iter().enumerate() {
        let (done, total) = (done as u64, found.len() as u64);
        observer.hear(Event::Step { done, total, what: "gaps" });
        let gaps = gaps.get(&artefact.marker).map(Vec::as_slice).unwrap_or_default();
        let mended = mended(&mut chooser, artefact, gaps, order.tolerance_m);
        let frame = |index: usize| first_frame.saturating_add(index as u64);
        edits.push(Edit {
            kind: artefact.kind,
            marker: name(artefact.marker),
            first_frame: frame(artefact.frames.start),
            last_frame: frame(artefact.frames.end.saturating_sub(1)),
            remedy: mended.remedy,
            method: mended.method,
            with: artefact.with.map(name),
        });
        artefacts.push(ArtefactFigures {
            kind: artefact.kind,
            marker: name(artefact.marker),
            with: artefact.with.map(name),
            start_s: artefact.frames.start as f64 / rate_hz,
            end_s: artefact.frames.end as f64 / rate_hz,
            cause: artefact.cause,
            confidence: Some(artefact.confidence),
            remedy: mended.remedy,
            fill: mended.method,
            expected_error_m: mended.error_m,
            expected_from: mended.from,
        });
    }
    let total = found.len() as u64;
    observer.hear(Event::Step { done: total, total, what: "gaps" });
    notes.extend(unseen_edges(&source.trial));
    let filled = |from| {
        let is_so = |of: &&ArtefactFigures| of.remedy == Remedy::Fill && of.expected_from == from;
        artefacts.iter().filter(is_so).count()
    };
    for (from, by) in [
        (Some(ExpectedFrom::OtherTrials), "what is expected of them was tried on other trials"),
        (
            Some(ExpectedFrom::Stored),
            "what is expected of them are stored figures of a walk and of stairs",
        ),
        (None, "nobody knows how well"),
    ] {
        let count = filled(from);
        if count > 0 {
            notes.push(format!(
                "{count} could not be tried on this trial, which is too short to cut gaps as long: {by}"
            , count = counted(count, "gap")));
        }
    }
    let is_by_skeleton = |of: &ArtefactFigures| of.fill == Some(Method::Skeleton);
    if artefacts.iter().any(is_by_skeleton) {
        notes.extend(body_notes.into_iter().map(|note| format!("skeleton: {note}")));
    }
    Ok(Plan { edits, artefacts, notes })
}

/// Markers that come late or leave early: nothing is known there to fill in between.
fn unseen_edges(trial: &Trial) -> Option<String> {
    let edges = |marker: &usize| {
        let seen = trial.seen_runs(*marker);
        let (first, last) = (seen.first()?.start, seen.last()?.end);
        (first > 0 || last < trial.frames()).then_some(*marker)
    };
    let names: Vec<&str> = (0..trial.markers())
        .filter_map(|marker| trial.labels().get(edges(&marker)?).map(String::as_str))
        .collect();
    if names.is_empty() {
        return None;
    }
    let shown = names.iter().take(NAMED).copied().collect::<Vec<_>>().join(", ");
    let more = names.len().saturating_sub(NAMED);
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    Some(format!("not seen from the first frame on or up to the last, and left so: {shown}{more}"))
}

/// What is done about one thing that is wrong.
struct Mended {
    remedy: Remedy,
    method: Option<Method>,
    error_m: Option<f64>,
    from: Option<ExpectedFrom>,
}

fn mended(
    chooser: &mut Chooser<'_>,
    artefact: &Artefact,
    gaps: &[Gap],
    tolerance_m: f64,
) -> Mended {
    let done = |remedy| Mended { remedy, method: None, error_m: None, from: None };
    if artefact.kind.is_swap() {
        return done(Remedy::Exchange);
    }
    let unfilled = match artefact.kind {
        ArtefactKind::Dropout => Remedy::Leave,
        _ => Remedy::Remove,
    };
    let start = artefact.frames.start;
    let at = gaps.partition_point(|gap| gap.frames.end <= start);
    let Some(gap) = gaps.get(at).filter(|gap| gap.frames.start <= start) else {
        return done(unfilled);
    };
    let choice = chooser.choose(gap);
    let Some(method) = choice.method else { return done(unfilled) };
    if choice.error_m.is_some_and(|error_m| error_m > tolerance_m) {
        return Mended { error_m: choice.error_m, from: choice.from, ..done(unfilled) };
    }
    let (error_m, from) = (choice.error_m, choice.from);
    Mended { remedy: Remedy::Fill, method: Some(method), error_m, from }
}
