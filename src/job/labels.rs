//! What is done when, as somebody labelled it: a table, or a folder of labels frame by frame; one becomes the other.
//!
//! A table has `file` and `class`, and if known `side`, `style`, `source`, `subject`, `start_s`, `end_s` and `mark`: 1.0 or nothing where
//! it is done, 0.5 where nobody can say, 0.0 where it was looked for in a clip and is not there. A folder is as the ICS
//! Action Database has them: `TRIAL/ACTION.txt`, a line for each frame.

mod of_frames;

use super::source::{CaptureOptions, body_motion};
use crate::draft;
use crate::error::{Error, ErrorKind, counted};
use crate::recognise::machine::Span;
use crate::recognise::model::BodySide;
use crate::table::{TableWriter, rows};
use of_frames::{ActionMarks, Mark};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// The label of a clip in which nothing is labelled.
pub(super) const NOTHING: &str = "nothing";

/// Most bytes of a table of labels.
const MAX_BYTES: u64 = 16 << 20;
/// Bytes of a table that are looked at to see what its columns are.
const TITLES_BYTES: u64 = 1 << 16;
/// Most frames that may be labelled at once: all actions of a trial.
const MAX_MARKS: usize = 100_000_000;
/// Frames per second that a clip may have.
const RATES_HZ: core::ops::RangeInclusive<f64> = 0.01..=100_000.0;
/// A cut that ends this far behind the last frame, frames, is rounded.
const BEYOND_FRAMES: f64 = 1.0;

/// A label.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Label {
    pub(super) file: String,
    pub(super) class: String,
    pub(super) side: Option<BodySide>,
    pub(super) style: Option<String>,
    pub(super) source: Option<String>,
    /// Who does it.
    pub(super) subject: Option<String>,
    pub(super) cut: Option<Cut>,
}

/// From when to when, as it was labelled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Cut {
    Seconds(Span),
    /// The first frame of a clip is 0.
    Frames {
        first: usize,
        last: usize,
    },
}

impl Cut {
    /// In s, of a clip with so many frames a second.
    pub(super) fn span(self, rate_hz: f64) -> Span {
        match self {
            Self::Seconds(span) => span,
            Self::Frames { first, last } => {
                Span { start_s: first as f64 / rate_hz, end_s: last as f64 / rate_hz }
            }
        }
    }

    /// The first and the last frame.
    fn frames(self, rate_hz: f64) -> (f64, f64) {
        match self {
            Self::Seconds(span) => {
                ((span.start_s * rate_hz).round(), (span.end_s * rate_hz).round())
            }
            Self::Frames { first, last } => (first as f64, last as f64),
        }
    }
}

/// All labels.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Labels {
    pub(super) list: Vec<Label>,
    /// By clip, where nobody can say whether an action is done.
    pub(super) unclear: BTreeMap<String, Vec<(String, Cut)>>,
    /// By clip, actions that were looked for, whether or not they are there; nothing of clips of which that is not said.
    looked_for: BTreeMap<String, BTreeSet<String>>,
    /// By clip, how many frames have labels; nothing of clips whose labels are times.
    pub(super) frames: BTreeMap<String, usize>,
}

impl Label {
    /// Of which no more is known.
    pub(super) fn of(file: &str, class: &str, cut: Option<Cut>) -> Self {
        Self {
            file: file.to_owned(),
            class: class.to_owned(),
            side: None,
            style: None,
            source: None,
            subject: None,
            cut,
        }
    }

    /// Whether it begins in a clip of so many frames.
    pub(super) fn is_inside(&self, frames: usize, rate_hz: f64) -> bool {
        self.cut.is_none_or(|cut| (0.0..frames as f64).contains(&cut.frames(rate_hz).0))
    }

    /// The frames in which it is done: all of them without times.
    pub(super) fn within<'a, T>(&self, frames: &'a [T], rate_hz: f64) -> &'a [T] {
        let Some(cut) = self.cut else { return frames };
        let (first, last) = cut.frames(rate_hz);
        let end = (last as usize).saturating_add(1).min(frames.len());
        frames.get(first as usize..end).unwrap_or(&[])
    }

    /// Where the clip comes from: as the table says, or the folder in which it lies.
    pub(super) fn source(&self) -> &str {
        let folder = || self.file.rsplit_once('/').map_or("", |(folder, _)| folder);
        self.source.as_deref().unwrap_or_else(folder)
    }
}

impl Labels {
    /// Clips of which nothing is said but what is not done in them, or unclear, have nothing in them: whatever is named there
    /// is false.
    fn with_empty_clips(mut self) -> Self {
        let files = self.looked_for.keys().chain(self.unclear.keys());
        let empty: BTreeSet<String> = files
            .filter(|file| !self.list.iter().any(|label| label.file == **file))
            .cloned()
            .collect();
        self.list.extend(empty.iter().map(|file| Label::of(file, NOTHING, None)));
        self
    }

    /// All clips, by name.
    fn files(&self) -> BTreeSet<&str> {
        self.list.iter().map(|label| label.file.as_str()).collect()
    }
}

/// How labels lie there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LabelKind {
    /// A table (.csv).
    Table,
    /// A folder of trials, a file for each action, a line for each frame.
    Folder,
}

/// The kind of labels that lie somewhere; `None` if none do.
#[must_use]
pub fn label_kind(path: &Path) -> Option<LabelKind> {
    if path.is_dir() {
        return of_frames::is_folder(path).then_some(LabelKind::Folder);
    }
    let ending = path.extension()?;
    // A pipe is read once only.
    if !ending.eq_ignore_ascii_case("csv") || !std::fs::metadata(path).is_ok_and(|f| f.is_file()) {
        return None;
    }
    let mut start = Vec::new();
    File::open(path).ok()?.take(TITLES_BYTES).read_to_end(&mut start).ok()?;
    let start = String::from_utf8_lossy(&start);
    let titles: Vec<&str> =
        start.lines().next()?.trim_start_matches('\u{feff}').split(',').collect();
    let has = |name: &str| titles.iter().any(|title| title.trim().trim_matches('"') == name);
    (has("file") && has("class")).then_some(LabelKind::Table)
}

/// True of a name under which labels are written frame by frame: it ends in `/`, is a folder, or has no ending.
#[must_use]
pub fn is_folder_name(path: &Path) -> bool {
    path.as_os_str().as_encoded_bytes().ends_with(b"/")
        || path.extension().is_none()
        || path.is_dir()
}

/// Reads a table, or a folder of labels of frames; `clips` is where the clips of a folder of labels lie, if they are to be
/// named like their files.
pub(super) fn read(path: &Path, clips: Option<&Path>) -> Result<Labels, Error> {
    if path.is_dir() {
        return of_frames::read(path, clips);
    }
    parse(&label_text(path)?).map_err(|error| error.in_file(path))
}

/// The text of a table of labels.
///
/// # Errors
/// A file that cannot be read, is not a regular one, or is larger than any table of labels.
pub(super) fn label_text(path: &Path) -> Result<String, Error> {
    read_text(path, "the labels").map_err(|error| {
        error.remedy("name a table with columns file and class, or a folder with TRIAL/ACTION.txt")
    })
}

/// The text of a file that says something of motions, which is told as `what`.
///
/// # Errors
/// A file that cannot be read, is not a regular one, or is larger than any such table.
pub(super) fn read_text(path: &Path, what: &str) -> Result<String, Error> {
    let unreadable = |e: std::io::Error| {
        Error::of((&e).into(), format!("cannot read {what}"))
            .at(path.display().to_string())
            .got(e.to_string())
    };
    let found = std::fs::metadata(path).map_err(unreadable)?;
    if !found.is_file() {
        return Err(Error::of(ErrorKind::Malformed, "this is not a regular file")
            .at(path.display().to_string()));
    }
    let mut text = String::new();
    let opened = File::open(path).map_err(unreadable)?;
    opened.take(MAX_BYTES + 1).read_to_string(&mut text).map_err(unreadable)?;
    if text.len() as u64 > MAX_BYTES {
        return Err(Error::of(ErrorKind::Malformed, format!("{what}: the file is too long"))
            .at(path.display().to_string())
            .got(counted(found.len(), "byte"))
            .allowed(format!("at most {MAX_BYTES} bytes")));
    }
    // Editors of Windows put a mark before the text.
    Ok(text.strip_prefix('\u{feff}').map(str::to_owned).unwrap_or(text))
}

fn parse(text: &str) -> Result<Labels, Error> {
    let mut rows = rows(text);
    let titles = rows
        .next()
        .ok_or_else(|| Error::of(ErrorKind::Malformed, "the table of labels is empty"))??;
    let column = |name: &str| titles.cells().position(|title| title == name);
    let (Some(file), Some(class)) = (column("file"), column("class")) else {
        return Err(Error::of(ErrorKind::Malformed, "a table of labels has other columns")
            .at("line 1")
            .got(titles.cells().collect::<Vec<_>>().join(", "))
            .allowed(
                "file, class, and if known side, style, source, subject, start_s, end_s, mark",
            ));
    };
    let [side, style, source, subject, start, end, mark] =
        ["side", "style", "source", "subject", "start_s", "end_s", "mark"].map(column);
    let mut labels = Labels::default();
    for row in rows {
        let row = row?;
        let cell = |at: Option<usize>| {
            at.and_then(|at| row.cells().nth(at)).filter(|cell| !cell.is_empty())
        };
        let place = format!("line {}", row.line);
        let number = |at: Option<usize>| {
            let read = |text: &str| match text.parse::<f64>() {
                Ok(value) if value.is_finite() => Ok(value),
                _ => Err(Error::of(ErrorKind::Malformed, "a time is no number")
                    .at(place.clone())
                    .got(text)),
            };
            cell(at).map(read).transpose()
        };
        let span = match (number(start)?, number(end)?) {
            (Some(start_s), Some(end_s)) if start_s <= end_s => Some(Span { start_s, end_s }),
            (None, None) => None,
            _ => {
                return Err(Error::of(
                    ErrorKind::Malformed,
                    "a cut has a beginning and an end that is not before it",
                )
                .at(place));
            }
        };
        let (Some(file), Some(class)) = (cell(Some(file)), cell(Some(class))) else {
            return Err(Error::of(ErrorKind::Malformed, "a label has a file and a class").at(place));
        };
        let side = match cell(side) {
            Some("L" | "left") => Some(BodySide::Left),
            Some("R" | "right") => Some(BodySide::Right),
            Some("LR") | None => None,
            Some(other) => {
                return Err(Error::of(ErrorKind::Unknown, "no such side")
                    .at(place)
                    .got(other)
                    .allowed("L, R, LR, left, right, or nothing"));
            }
        };
        let mark =
            cell(mark).map_or(Ok(Mark::Part), Mark::read).map_err(|error| error.at(&*place))?;
        let cut = span.map(Cut::Seconds);
        match (mark, cut) {
            (Mark::Part, cut) => labels.list.push(Label {
                side,
                style: cell(style).map(str::to_owned),
                source: cell(source).map(str::to_owned),
                subject: cell(subject).map(str::to_owned),
                ..Label::of(file, class, cut)
            }),
            (Mark::Unclear, Some(cut)) => {
                labels.unclear.entry(file.to_owned()).or_default().push((class.to_owned(), cut));
            }
            (Mark::Unclear, None) => {
                return Err(
                    Error::of(ErrorKind::Malformed, "what is unclear has no times").at(place)
                );
            }
            (Mark::Not, _) => {
                labels.looked_for.entry(file.to_owned()).or_default().insert(class.to_owned());
            }
        }
    }
    Ok(labels.with_empty_clips())
}

/// Which labels become which.
#[derive(Clone, Debug, PartialEq)]
pub struct LabelsOrder {
    /// A table or a folder.
    pub labels: PathBuf,
    /// Folder of the clips; `None`: that of a table.
    pub clips: Option<PathBuf>,
    /// Frames per second of all clips, in place of what they say themselves.
    pub rate_hz: Option<f64>,
    /// A table (.csv), or the name of a folder.
    pub output: PathBuf,
    /// Files may replace those that are there.
    pub replace: bool,
}

/// What came of it.
#[derive(Clone, Debug, Serialize)]
pub struct LabelsReport {
    /// `done`.
    pub outcome: &'static str,
    /// Clips.
    pub clips: usize,
    /// Cuts, those that are unclear among them.
    pub cuts: usize,
    /// What is lost on the way.
    pub notes: Vec<String>,
    /// Where.
    pub written: String,
}

/// Frames a second, and how many, of a clip.
#[derive(Clone, Copy, Debug)]
struct Timed {
    rate_hz: f64,
    frames: Option<usize>,
}

/// Writes a folder of labels of frames as a table, or a table as such a folder. Which frames a time is, the clips say.
///
/// # Errors
/// Labels that cannot be read, clips that are not there or have another number of frames, a cut behind the end of its
/// clip, files that exist or cannot be written.
pub fn convert(order: &LabelsOrder) -> Result<LabelsReport, Error> {
    let is_table = order.output.extension().is_some_and(|ending| ending == "csv");
    if !is_table && !is_folder_name(&order.output) {
        return Err(Error::of(ErrorKind::Unknown, "this kind of file cannot be written")
            .at(order.output.display().to_string())
            .allowed("of labels, a table (.csv), or a folder for labels of frames"));
    }
    if is_table {
        draft::check_free(&order.output, order.replace)?;
    }
    if let Some(rate_hz) = order.rate_hz.filter(|rate_hz| !RATES_HZ.contains(rate_hz)) {
        return Err(Error::of(ErrorKind::OutsideLimits, "no clip has such a rate")
            .at("--rate")
            .got(rate_hz.to_string())
            .allowed(format!("{} to {} Hz", RATES_HZ.start(), RATES_HZ.end())));
    }
    let beside = || order.labels.parent().filter(|_| !order.labels.is_dir()).map(Path::to_owned);
    let clips = order.clips.clone().or_else(beside);
    let labels = read(&order.labels, order.clips.as_deref())?;
    let timed = |file: &str| -> Result<Timed, Error> {
        let known = labels.frames.get(file).copied();
        // All is known without the clip.
        if let Some((rate_hz, frames)) =
            order.rate_hz.filter(|_| is_table || known.is_some()).map(|hz| (hz, known))
        {
            return Ok(Timed { rate_hz, frames });
        }
        let Some(folder) = &clips else {
            return Err(Error::of(ErrorKind::Absent, "nobody says how many frames a second has")
                .at(order.labels.display().to_string())
                .remedy("name the folder of the clips (--clips DIR), or --rate HZ"));
        };
        let clip = folder.join(file);
        let (capture, _) =
            body_motion(&clip.display().to_string(), None, &CaptureOptions::default())
                .map_err(|error| error.remedy("name the folder of the clips: --clips DIR"))?;
        let frames = capture.poses.len();
        match known.filter(|known| *known != frames) {
            None => Ok(Timed { rate_hz: capture.rate_hz, frames: Some(frames) }),
            Some(known) => {
                Err(Error::of(ErrorKind::Malformed, "the clip has another number of frames")
                    .at(clip.display().to_string())
                    .got(frames.to_string())
                    .allowed(format!("{known}, as many as have labels")))
            }
        }
    };
    let files = labels.files();
    if files.is_empty() {
        return Err(Error::of(ErrorKind::Absent, "there are no labels in this table")
            .at(order.labels.display().to_string())
            .allowed("a row for each cut: file, class, start_s, end_s"));
    }
    let timed: Result<BTreeMap<&str, Timed>, Error> =
        files.iter().map(|file| Ok((*file, timed(file)?))).collect();
    let (timed, mut notes) = (timed?, Vec::new());
    let cut =
        labels.list.iter().filter(|label| label.class != NOTHING || label.cut.is_some()).count();
    if is_table {
        draft::write_file(&order.output, order.replace, &as_table(&labels, &timed)?)?;
    } else {
        let with_more = |label: &&Label| {
            label.side.is_some() || label.style.is_some() || label.source.is_some()
        };
        if labels.list.iter().any(|label| with_more(&label)) {
            notes.push(
                "labels of frames do not say a side, a style or a source: left out".to_owned(),
            );
        }
        let mut trials = BTreeMap::new();
        for file in &files {
            let trial = of_frames::trial_of(file);
            if let Some(other) =
                trials.insert(trial.clone(), (*file, marks_of(&labels, file, timed[file])?))
            {
                return Err(Error::new("two clips would be one trial")
                    .at(order.labels.display().to_string())
                    .got(format!("{} and {file}", other.0)));
            }
        }
        let trials: Vec<(String, Vec<ActionMarks>)> =
            trials.into_iter().map(|(trial, (_, actions))| (trial, actions)).collect();
        of_frames::write(&order.output, order.replace, &trials)?;
    }
    Ok(LabelsReport {
        outcome: "done",
        clips: files.len(),
        cuts: cut + labels.unclear.values().map(Vec::len).sum::<usize>(),
        notes,
        written: order.output.display().to_string(),
    })
}

/// A row for each cut, and one for each action that was looked for and is not there.
fn as_table(labels: &Labels, timed: &BTreeMap<&str, Timed>) -> Result<Vec<u8>, Error> {
    let mut out = TableWriter::new(Vec::new());
    out.row(["file", "class", "side", "start_s", "end_s", "mark"])?;
    let times = |file: &str, cut: Option<Cut>| match cut {
        None => Default::default(),
        Some(cut) => {
            let span = cut.span(timed[file].rate_hz);
            [span.start_s, span.end_s].map(|time_s| format!("{time_s:.6}"))
        }
    };
    for file in labels.files() {
        for label in labels.list.iter().filter(|label| label.file == file) {
            let is_only_word = label.class == NOTHING && labels.looked_for.contains_key(file);
            if is_only_word {
                continue;
            }
            let [start, end] = times(file, label.cut);
            let side = label.side.map_or("", BodySide::word);
            out.row([file, &label.class, side, &start, &end, Mark::Part.word()])?;
        }
        for (class, cut) in labels.unclear.get(file).into_iter().flatten() {
            let [start, end] = times(file, Some(*cut));
            out.row([file, class, "", &start, &end, Mark::Unclear.word()])?;
        }
        for class in labels.looked_for.get(file).into_iter().flatten() {
            let is_it = |label: &Label| label.file == file && label.class == *class;
            let unclear = labels.unclear.get(file).into_iter().flatten();
            if !labels.list.iter().any(is_it) && !unclear.into_iter().any(|(of, _)| of == class) {
                out.row([file, class, "", "", "", Mark::Not.word()])?;
            }
        }
    }
    out.finish()
}

/// What is marked in each frame of a clip, for each action.
fn marks_of(labels: &Labels, file: &str, timed: Timed) -> Result<Vec<ActionMarks>, Error> {
    let Timed { rate_hz, frames } = timed;
    let frames = frames.unwrap_or_default();
    let mut actions: BTreeMap<&str, Vec<Mark>> = BTreeMap::new();
    let unclear = labels.unclear.get(file).into_iter().flatten();
    let unclear = unclear.map(|(class, cut)| (class.as_str(), Some(*cut), Mark::Unclear));
    let sure = labels.list.iter().filter(|label| label.file == file);
    let sure = sure.map(|label| (label.class.as_str(), label.cut, Mark::Part));
    let sure = sure.filter(|(class, cut, _)| *class != NOTHING || cut.is_some());
    for class in labels.looked_for.get(file).into_iter().flatten() {
        actions.entry(class).or_insert_with(|| vec![Mark::Not; frames]);
    }
    // What somebody is sure of counts more.
    for (class, cut, mark) in unclear.chain(sure) {
        if actions.len().saturating_add(1).saturating_mul(frames) > MAX_MARKS {
            return Err(Error::of(ErrorKind::OutsideLimits, "too many frames have labels")
                .at(file.to_owned())
                .allowed(format!("at most {MAX_MARKS} of all actions of a clip")));
        }
        let marks = actions.entry(class).or_insert_with(|| vec![Mark::Not; frames]);
        let (first, last) = cut.map_or((0.0, frames as f64), |cut| cut.frames(rate_hz));
        if !(0.0..frames as f64).contains(&first) || last > frames as f64 + BEYOND_FRAMES {
            return Err(Error::of(ErrorKind::OutsideLimits, "a cut is not within its clip")
                .at(file.to_owned())
                .got(format!("{class}, frames {first} to {last}"))
                .allowed(format!("0 to {}", frames.saturating_sub(1))));
        }
        let last = (last as usize).min(frames.saturating_sub(1));
        if let Some(run) = marks.get_mut(first as usize..=last) {
            run.fill(mark);
        }
    }
    let of = |(action, marks): (&str, Vec<Mark>)| ActionMarks { action: action.to_owned(), marks };
    Ok(actions.into_iter().map(of).collect())
}

/// What was recognised in one motion, to be written frame by frame.
pub(super) struct RecognisedTrial<'a> {
    /// The motion as it was named.
    pub(super) motion: &'a str,
    /// Frames, and how many a second has.
    pub(super) frames: usize,
    pub(super) rate_hz: f64,
    /// Actions that were looked for.
    pub(super) looked_for: &'a BTreeSet<String>,
    /// What was found.
    pub(super) found: Vec<(&'a str, Span)>,
}

/// Writes what was recognised in motions frame by frame: `FOLDER/TRIAL/ACTION.txt`, for each action that was looked for.
///
/// # Errors
/// Two motions of one name, files that exist or cannot be written.
pub(super) fn write_recognised(
    folder: &Path,
    replace: bool,
    trials: &[RecognisedTrial<'_>],
) -> Result<(), Error> {
    let mut written: Vec<(String, Vec<ActionMarks>)> = Vec::new();
    for trial in trials {
        let name = of_frames::trial_of(trial.motion);
        if written.iter().any(|(other, _)| *other == name) {
            return Err(Error::new("two motions would be one trial")
                .at(folder.display().to_string())
                .got(trial.motion.to_owned())
                .remedy("give their files other names, or write a table: --labels OUT.csv"));
        }
        let mut labels = Labels::default();
        labels.looked_for.insert(name.clone(), trial.looked_for.clone());
        let cut = |(class, span): &(&str, Span)| Label::of(&name, class, Some(Cut::Seconds(*span)));
        labels.list = trial.found.iter().map(cut).collect();
        let timed = Timed { rate_hz: trial.rate_hz, frames: Some(trial.frames) };
        let actions = marks_of(&labels, &name, timed)?;
        written.push((name, actions));
    }
    of_frames::write(folder, replace, &written)
}

/// What is labelled in a table or a folder.
#[derive(Clone, Debug, Serialize)]
pub struct LabelsOverview {
    /// `labels`.
    pub format: &'static str,
    /// `table` or `frames`.
    pub kind: &'static str,
    /// Clips.
    pub clips: usize,
    /// Frames that have labels; null of a table.
    pub frames: Option<usize>,
    /// By action.
    pub actions: BTreeMap<String, LabelledAction>,
}

/// One action in labels.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct LabelledAction {
    /// Clips in which it is done.
    pub clips: usize,
    /// Times that it is done, clips as a whole among them.
    pub cuts: usize,
    /// Frames in which it is done; null of a table.
    pub frames: Option<usize>,
    /// Times of which nobody can say.
    pub unclear: usize,
    /// Clips in which it was looked for and is not.
    pub absent_in: usize,
}

/// Looks into labels.
///
/// # Errors
/// Labels that cannot be read.
pub fn overview(path: &Path) -> Result<LabelsOverview, Error> {
    let labels = read(path, None)?;
    let is_folder = path.is_dir();
    let mut actions: BTreeMap<String, LabelledAction> = BTreeMap::new();
    let mut done_in: BTreeSet<(&str, &str)> = BTreeSet::new();
    for label in labels.list.iter().filter(|label| label.class != NOTHING || label.cut.is_some()) {
        let action = actions.entry(label.class.clone()).or_default();
        action.cuts += 1;
        action.clips += usize::from(done_in.insert((&label.class, &label.file)));
        if let Some(Cut::Frames { first, last }) = label.cut {
            *action.frames.get_or_insert(0) += last + 1 - first;
        }
    }
    for (file, unclear) in &labels.unclear {
        for (class, _) in unclear {
            actions.entry(class.clone()).or_default().unclear += 1;
            done_in.insert((class, file));
        }
    }
    for (file, classes) in &labels.looked_for {
        for class in classes.iter().filter(|class| !done_in.contains(&(class.as_str(), file))) {
            actions.entry(class.clone()).or_default().absent_in += 1;
        }
    }
    Ok(LabelsOverview {
        format: "labels",
        kind: if is_folder { "frames" } else { "table" },
        clips: labels.files().len(),
        frames: is_folder.then(|| labels.frames.values().sum()),
        actions,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_without_classes_or_with_half_a_cut_is_refused_by_line() {
        assert!(parse("file,kind\na,b").expect_err("no class").to_string().contains("line 1"));
        let half = parse("file,class,start_s,end_s\na,b,1,").expect_err("no end");
        assert!(half.to_string().contains("line 2"), "{half}");
        let labels = parse("file,class,start_s,end_s\na,b,1,2\nc,d,,").expect("labels").list;
        assert_eq!(labels[0].cut, Some(Cut::Seconds(Span { start_s: 1.0, end_s: 2.0 })));
        assert_eq!(labels[1].cut, None);
    }

    #[test]
    fn a_side_is_left_or_right_or_both_and_any_other_is_refused_by_line() {
        let labels = parse("file,class,side\na,b,L\nc,d,LR\ne,f,\ng,h,right").expect("labels");
        let sides: Vec<Option<BodySide>> = labels.list.iter().map(|label| label.side).collect();
        assert_eq!(sides, [Some(BodySide::Left), None, None, Some(BodySide::Right)]);
        let wrong = parse("file,class,side\na,b,L\nc,d,Q").expect_err("no side");
        assert!(wrong.to_string().contains("line 3"), "{wrong}");
    }

    #[test]
    fn a_mark_says_that_an_action_is_unclear_or_not_there() {
        let table = "file,class,start_s,end_s,mark\na,bow,0,1,1.0\na,bow,2,3,0.5\na,walk,,,0.0\nb,walk,,,0\n";
        let labels = parse(table).expect("labels");
        let named: Vec<(&str, &str)> =
            labels.list.iter().map(|of| (of.file.as_str(), of.class.as_str())).collect();
        assert_eq!(named, [("a", "bow"), ("b", NOTHING)]);
        assert_eq!(labels.unclear["a"].len(), 1);
        for wrong in ["a,bow,2,3,0.7", "a,bow,,,0.5"] {
            let error = parse(&format!("file,class,start_s,end_s,mark\n{wrong}")).expect_err(wrong);
            assert!(error.to_string().contains("line 2"), "{wrong}: {error}");
        }
    }

    #[test]
    fn frames_are_marked_from_the_first_to_the_last_and_cuts_outside_the_clip_are_refused() {
        let timed = Timed { rate_hz: 10.0, frames: Some(6) };
        let table =
            "file,class,start_s,end_s,mark\na,bow,0.1,0.3,1.0\na,bow,0.3,0.49,0.5\na,walk,,,0\n";
        let marks = marks_of(&parse(table).expect("labels"), "a", timed).expect("marks");
        use Mark::{Not, Part, Unclear};
        assert_eq!(marks[0].marks, [Not, Part, Part, Part, Unclear, Unclear]);
        assert_eq!((marks[1].action.as_str(), &marks[1].marks[..]), ("walk", &[Not; 6][..]));
        for wrong in ["a,bow,0.6,0.7", "a,bow,0,0.8", "a,bow,-1,0.2"] {
            let labels = parse(&format!("file,class,start_s,end_s\n{wrong}")).expect(wrong);
            assert!(marks_of(&labels, "a", timed).is_err(), "{wrong}");
        }
    }
}
