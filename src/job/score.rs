//! How good the recogniser is on labelled clips.
//!
//! A clip's label is a row of a table (`labels.csv` in the folder, or a file that is named): `file`, `class`,
//! and if known `side`, `style`, `start_s` and `end_s`. Rows with times are judged as Salamah and
//! Brunnett do: the same class, and an overlap of more than half of what was cut by hand. A row without
//! times says what somebody does in the whole clip, and no more: the class counts as recognised there if it was recognised at
//! least once, and as false if it was and is not the label. Labels that no model means are distractors:
//! whatever is recognised in them is false.

use super::recognise::{EquationReading, RecognisedAction, models, of_capture};
use super::source::{CaptureOptions, body_motion};
use crate::error::{Error, ErrorKind};
use crate::recognise::machine::Span;
use crate::recognise::model::{ActionModel, BodySide};
use crate::recognise::score::{ClassTally, interval, is_same, segmentation_error};
use crate::table::rows;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::io::Read;
use std::path::{Path, PathBuf};

/// Most bytes of a table of labels.
const MAX_BYTES: u64 = 16 << 20;

/// Which half of the clips is judged: the odd or the even ones of each class, in the order of their names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Half {
    /// The first, third, ... of each class.
    First,
    /// The others.
    Second,
}

/// What is to be judged.
#[derive(Clone, Debug)]
pub struct ClassificationOrder {
    /// Folder of clips.
    pub folder: PathBuf,
    /// The table of labels; `labels.csv` in the folder if none is named.
    pub labels: Option<PathBuf>,
    /// Folder of models in place of the shipped ones.
    pub models: Option<PathBuf>,
    /// How the paper's equations are read.
    pub equations: EquationReading,
    /// All clips, or one half of them.
    pub half: Option<Half>,
}

/// A label.
#[derive(Clone, Debug, PartialEq)]
struct Label {
    file: String,
    class: String,
    side: Option<String>,
    style: Option<String>,
    span: Option<Span>,
}

/// One class or label.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ClassFigures {
    /// Its name.
    pub class: String,
    /// Counts.
    #[serde(flatten)]
    pub tally: ClassTally,
    /// Correct of recognised.
    pub precision: Option<f64>,
    /// Its 95 % interval.
    pub precision_interval: Option<[f64; 2]>,
    /// Correct of what is there.
    pub recall: Option<f64>,
    /// Its 95 % interval.
    pub recall_interval: Option<[f64; 2]>,
}

/// Segmentation error beyond the paper's tolerance, of beginnings and ends that were cut by hand.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct CutFigures {
    /// Cuts compared.
    pub cuts: usize,
    /// Mean, frames.
    pub mean_frames: f64,
    /// Greatest, frames.
    pub most_frames: f64,
    /// Mean, ms.
    pub mean_ms: f64,
}

/// One label with what was recognised in its clips.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LabelFigures {
    /// As the table says it.
    pub label: String,
    /// The class that it is, if a model means it.
    pub class: Option<String>,
    /// Clips (or cuts) of it.
    pub clips: usize,
    /// In how many what was recognised; a clip counts once for a class.
    pub recognised: BTreeMap<String, usize>,
}

/// How good it is.
#[derive(Clone, Debug, Serialize)]
pub struct ClassificationReport {
    /// `done`.
    pub outcome: &'static str,
    /// Clips that were looked at.
    pub clips: usize,
    /// Clips that could not be read, and why.
    pub unread: Vec<String>,
    /// Labels with times, which are judged by overlap; the others are judged by clip.
    pub cut_by_hand: usize,
    /// Share of what there is that was recognised.
    pub value: Option<f64>,
    /// Its 95 % interval.
    pub interval: Option<[f64; 2]>,
    /// Of all together.
    pub global: ClassFigures,
    /// Mean of the classes' precisions.
    pub mean_precision: Option<f64>,
    /// Mean of the classes' recalls.
    pub mean_recall: Option<f64>,
    /// By class.
    pub per_class: Vec<ClassFigures>,
    /// By style, of the labels that a model means.
    pub per_style: Vec<ClassFigures>,
    /// By label: the confusion table.
    pub per_label: Vec<LabelFigures>,
    /// Of those with a side: how many of the right recognitions had it.
    pub sides: ClassTally,
    /// Of what was cut by hand; null without.
    pub segmentation: Option<CutFigures>,
    /// Frames that were looked at, and s.
    pub frames: usize,
    /// How long the clips are, s.
    pub duration_s: f64,
}

/// Judges the recogniser on a folder of labelled clips. `hear` is told of each clip before it is read: which of
/// how many.
///
/// # Errors
/// No table of labels, one that is wrong, models that cannot be read. A clip that cannot be read is
/// counted and named.
pub fn classification(
    order: &ClassificationOrder,
    mut hear: impl FnMut(usize, usize, &str),
) -> Result<ClassificationReport, Error> {
    let models = models(order.models.as_deref())?;
    let table = order.labels.clone().unwrap_or_else(|| order.folder.join("labels.csv"));
    let labels = read_labels(&table)?;
    let by_file = clips(&labels, order.half);
    let mut score = Score::new(&models);
    let count = by_file.len();
    for (index, (file, labels)) in by_file.iter().enumerate() {
        hear(index, count, file);
        let motion = order.folder.join(file).display().to_string();
        let clip =
            body_motion(&motion, None, &CaptureOptions::default()).and_then(|(capture, _)| {
                let found = of_capture(&capture, models.clone(), order.equations, &mut |_| ())?;
                Ok((capture.rate_hz, capture.poses.len(), found.events))
            });
        match clip {
            Ok((rate_hz, frames, events)) => {
                score.frames += frames;
                score.duration_s += frames as f64 / rate_hz;
                score.judge(labels, &events, rate_hz);
            }
            Err(error) => score.unread.push(error.to_string()),
        }
    }
    Ok(score.report(count))
}

/// Labels by file, of the half that is asked for.
fn clips(labels: &[Label], half: Option<Half>) -> BTreeMap<&str, Vec<&Label>> {
    let mut by_class: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for label in labels {
        by_class.entry(&label.class).or_default().insert(&label.file);
    }
    let is_asked = |label: &Label| {
        let place = by_class[label.class.as_str()].iter().position(|file| *file == label.file);
        match half {
            None => true,
            Some(Half::First) => place.is_some_and(|place| place % 2 == 0),
            Some(Half::Second) => place.is_some_and(|place| place % 2 == 1),
        }
    };
    let mut by_file: BTreeMap<&str, Vec<&Label>> = BTreeMap::new();
    for label in labels.iter().filter(|label| is_asked(label)) {
        by_file.entry(&label.file).or_default().push(label);
    }
    by_file
}

/// The text of a table of labels.
///
/// # Errors
/// A file that cannot be read, is not a regular one, or is larger than any table of labels.
pub(super) fn label_text(path: &Path) -> Result<String, Error> {
    let unreadable = |e: std::io::Error| {
        Error::of((&e).into(), "cannot read the table of labels")
            .at(path.display().to_string())
            .got(e.to_string())
            .remedy("name one: --labels FILE.csv, with a column class")
    };
    let found = std::fs::metadata(path).map_err(unreadable)?;
    if !found.is_file() {
        return Err(Error::of(ErrorKind::Malformed, "this is not a regular file")
            .at(path.display().to_string()));
    }
    let mut text = String::new();
    let opened = std::fs::File::open(path).map_err(unreadable)?;
    opened.take(MAX_BYTES + 1).read_to_string(&mut text).map_err(unreadable)?;
    if text.len() as u64 > MAX_BYTES {
        return Err(Error::of(ErrorKind::Malformed, "the table of labels is too long")
            .at(path.display().to_string())
            .got(format!("{} bytes", found.len()))
            .allowed(format!("at most {MAX_BYTES} bytes")));
    }
    Ok(text)
}

fn read_labels(path: &Path) -> Result<Vec<Label>, Error> {
    parse_labels(&label_text(path)?).map_err(|error| error.in_file(path))
}

fn parse_labels(text: &str) -> Result<Vec<Label>, Error> {
    let mut rows = rows(text);
    let titles = rows
        .next()
        .ok_or_else(|| Error::of(ErrorKind::Malformed, "the table of labels is empty"))??;
    let column = |name: &str| titles.cells().position(|title| title == name);
    let (Some(file), Some(class)) = (column("file"), column("class")) else {
        return Err(Error::of(ErrorKind::Malformed, "a table of labels has other columns")
            .at("line 1")
            .got(titles.cells().collect::<Vec<_>>().join(", "))
            .allowed("file, class, and if known side, style, start_s, end_s"));
    };
    let [side, style, start, end] = ["side", "style", "start_s", "end_s"].map(column);
    let mut labels = Vec::new();
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
            (Some(start_s), Some(end_s)) if start_s < end_s => Some(Span { start_s, end_s }),
            (None, None) => None,
            _ => {
                return Err(Error::of(
                    ErrorKind::Malformed,
                    "a cut has a beginning and an end after it",
                )
                .at(place));
            }
        };
        let (Some(file), Some(class)) = (cell(Some(file)), cell(Some(class))) else {
            return Err(Error::of(ErrorKind::Malformed, "a label has a file and a class").at(place));
        };
        labels.push(Label {
            file: file.to_owned(),
            class: class.to_owned(),
            side: cell(side).map(str::to_owned),
            style: cell(style).map(str::to_owned),
            span,
        });
    }
    Ok(labels)
}

/// The action that a label means: its own name, a word that a model has for it, or the longest name of an
/// action that it begins with and goes on with a side (`wave-left-hand`).
fn meant<'a>(label: &str, models: &'a [ActionModel]) -> Option<&'a str> {
    const SIDES: [&str; 3] = ["left", "right", "both"];
    let is_it = |model: &&ActionModel| {
        model.action == label
            || model.also.iter().any(|word| word == label)
            || label
                .strip_prefix(&model.action)
                .and_then(|rest| rest.strip_prefix('-'))
                .is_some_and(|rest| {
                    let mut words = rest.split('-');
                    words.next().is_some_and(|word| SIDES.contains(&word))
                        && words.next().is_some_and(|word| word == "hand" || word == "hands")
                })
    };
    models.iter().find(is_it).map(|model| model.action.as_str())
}

struct Score<'a> {
    models: &'a [ActionModel],
    classes: BTreeMap<String, ClassTally>,
    styles: BTreeMap<String, ClassTally>,
    labels: BTreeMap<String, LabelFigures>,
    sides: ClassTally,
    errors_frames: Vec<(f64, f64)>,
    unread: Vec<String>,
    cut_by_hand: usize,
    frames: usize,
    duration_s: f64,
}

impl<'a> Score<'a> {
    fn new(models: &'a [ActionModel]) -> Self {
        Self {
            models,
            classes: BTreeMap::new(),
            styles: BTreeMap::new(),
            labels: BTreeMap::new(),
            sides: ClassTally::default(),
            errors_frames: Vec::new(),
            unread: Vec::new(),
            cut_by_hand: 0,
            frames: 0,
            duration_s: 0.0,
        }
    }

    fn judge(&mut self, labels: &[&Label], events: &[RecognisedAction], rate_hz: f64) {
        let (cut, whole): (Vec<&Label>, Vec<&Label>) =
            labels.iter().partition(|label| label.span.is_some());
        if cut.is_empty() {
            for label in &whole {
                self.judge_clip(label, events);
            }
        } else {
            self.cut_by_hand += cut.len();
            self.judge_cuts(&cut, events, rate_hz);
        }
    }

    fn noted(&mut self, label: &Label) -> &mut LabelFigures {
        let class = meant(&label.class, self.models).map(str::to_owned);
        let figures = self.labels.entry(label.class.clone()).or_insert_with(|| LabelFigures {
            label: label.class.clone(),
            class,
            clips: 0,
            recognised: BTreeMap::new(),
        });
        figures.clips += 1;
        figures
    }

    /// A label of a whole clip.
    fn judge_clip(&mut self, label: &Label, events: &[RecognisedAction]) {
        let class = meant(&label.class, self.models);
        let found: BTreeSet<&str> = events.iter().map(|event| event.action.as_str()).collect();
        let figures = self.noted(label);
        for action in &found {
            *figures.recognised.entry((*action).to_owned()).or_default() += 1;
        }
        for action in &found {
            self.classes.entry((*action).to_owned()).or_default().recognised += 1;
        }
        let style = self.styles.entry(label.style.clone().unwrap_or_default()).or_default();
        style.recognised += found.len();
        let Some(class) = class else { return };
        style.truth += 1;
        let tally = self.classes.entry(class.to_owned()).or_default();
        tally.truth += 1;
        if found.contains(class) {
            tally.correct += 1;
            style.correct += 1;
        }
        // A walk to the left is one of both feet.
        let is_of_limb = label.class == class || label.class.ends_with("-hand");
        let side = label.side.as_deref().filter(|side| is_of_limb && ["L", "R"].contains(side));
        let Some(side) = side else { return };
        let right = if side == "L" { BodySide::Left } else { BodySide::Right };
        for event in events.iter().filter(|event| event.action == class) {
            let Some(side) = event.side else { continue };
            self.sides.recognised += 1;
            self.sides.truth += 1;
            self.sides.correct += usize::from(side == right);
        }
    }

    /// Labels that were cut by hand.
    fn judge_cuts(&mut self, cuts: &[&Label], events: &[RecognisedAction], rate_hz: f64) {
        let mut taken = vec![false; events.len()];
        for event in events {
            self.classes.entry(event.action.clone()).or_default().recognised += 1;
        }
        for label in cuts {
            let Some(span) = label.span else { continue };
            let class = meant(&label.class, self.models).map(str::to_owned);
            let inside = |event: &&RecognisedAction| is_same(&of(event), &span);
            let names: BTreeSet<String> =
                events.iter().filter(inside).map(|event| event.action.clone()).collect();
            let figures = self.noted(label);
            for name in names {
                *figures.recognised.entry(name).or_default() += 1;
            }
            let Some(class) = class else { continue };
            let tally = self.classes.entry(class.clone()).or_default();
            tally.truth += 1;
            let found = events.iter().zip(&mut taken).find(|(event, taken)| {
                !**taken && event.action == class && is_same(&of(event), &span)
            });
            if let Some((event, taken)) = found {
                *taken = true;
                tally.correct += 1;
                for (found_s, cut_s) in [(event.start_s, span.start_s), (event.end_s, span.end_s)] {
                    let frames = segmentation_error(found_s * rate_hz, &[cut_s * rate_hz]);
                    self.errors_frames.push((frames, 1e3 * frames / rate_hz));
                }
            }
        }
    }

    fn report(self, clips: usize) -> ClassificationReport {
        let global =
            self.classes.values().fold(ClassTally::default(), |all, tally| all.plus(*tally));
        let mean = |values: Vec<f64>| {
            (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
        };
        let there = || self.classes.values().filter(|tally| tally.truth > 0);
        let errors = &self.errors_frames;
        let segmentation = (!errors.is_empty()).then(|| CutFigures {
            cuts: errors.len(),
            mean_frames: errors.iter().map(|error| error.0).sum::<f64>() / errors.len() as f64,
            most_frames: errors.iter().map(|error| error.0).fold(0.0, f64::max),
            mean_ms: errors.iter().map(|error| error.1).sum::<f64>() / errors.len() as f64,
        });
        ClassificationReport {
            outcome: "done",
            clips,
            cut_by_hand: self.cut_by_hand,
            value: global.recall(),
            interval: interval(global.correct, global.truth),
            mean_precision: mean(there().filter_map(ClassTally::precision).collect()),
            mean_recall: mean(there().filter_map(ClassTally::recall).collect()),
            global: figures("all", global),
            per_class: self.classes.iter().map(|(class, tally)| figures(class, *tally)).collect(),
            per_style: self.styles.iter().map(|(style, tally)| figures(style, *tally)).collect(),
            per_label: self.labels.into_values().collect(),
            sides: self.sides,
            segmentation,
            frames: self.frames,
            duration_s: self.duration_s,
            unread: self.unread,
        }
    }
}

fn of(event: &RecognisedAction) -> Span {
    Span { start_s: event.start_s, end_s: event.end_s }
}

fn figures(class: &str, tally: ClassTally) -> ClassFigures {
    ClassFigures {
        class: class.to_owned(),
        tally,
        precision: tally.precision(),
        precision_interval: interval(tally.correct, tally.recognised),
        recall: tally.recall(),
        recall_interval: interval(tally.correct, tally.truth),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recognise::model::vocabulary;

    fn label(class: &str, span: Option<(f64, f64)>) -> Label {
        Label {
            file: "a.bvh".to_owned(),
            class: class.to_owned(),
            side: None,
            style: None,
            span: span.map(|(start_s, end_s)| Span { start_s, end_s }),
        }
    }

    fn event(action: &str, start_s: f64, end_s: f64) -> RecognisedAction {
        RecognisedAction {
            action: action.to_owned(),
            side: None,
            model: action.to_owned(),
            start_s,
            end_s,
            recognised_at_s: end_s,
            person: 0,
            phases: Vec::new(),
        }
    }

    #[test]
    fn labels_mean_actions_by_their_name_their_side_or_what_a_model_says() {
        let models = vocabulary::all().expect("models");
        for (label, action) in [
            ("walk", Some("walk")),
            ("wave-left-hand", Some("wave")),
            ("wave-both-hands", Some("wave")),
            ("byebye", Some("wave")),
            ("walk-back", None),
            ("walk-left", Some("walk")),
            ("raise-up-left-hand", None),
            ("guide", None),
        ] {
            assert_eq!(meant(label, &models), action, "{label}");
        }
    }

    #[test]
    fn a_clip_counts_once_for_a_class_and_a_distractor_makes_all_false() {
        let models = vocabulary::all().expect("models");
        let mut score = Score::new(&models);
        let events = [event("walk", 0.0, 1.0), event("walk", 1.0, 2.0), event("bow", 0.5, 0.8)];
        score.judge(&[&label("walk", None)], &events, 30.0);
        score.judge(&[&label("guide", None)], &events[..1], 30.0);
        let report = score.report(2);
        let walk = report.per_class.iter().find(|class| class.class == "walk").expect("walk");
        assert_eq!(walk.tally, ClassTally { correct: 1, recognised: 2, truth: 1 });
        assert_eq!(report.global.tally, ClassTally { correct: 1, recognised: 3, truth: 1 });
        assert_eq!(report.segmentation, None);
    }

    #[test]
    fn the_side_of_a_wave_is_that_of_a_hand_and_that_of_a_turn_is_none() {
        let models = vocabulary::all().expect("models");
        let mut score = Score::new(&models);
        let of = |action: &str| RecognisedAction {
            side: Some(BodySide::Left),
            ..event(action, 0.0, 1.0)
        };
        let to_the_right = |class: &str| Label { side: Some("R".to_owned()), ..label(class, None) };
        score.judge(&[&to_the_right("walk-turn-right")], &[of("walk")], 30.0);
        assert_eq!(score.sides.truth, 0);
        score.judge(&[&to_the_right("wave-right-hand")], &[of("wave")], 30.0);
        assert_eq!((score.sides.truth, score.sides.correct), (1, 0));
    }

    #[test]
    fn what_was_cut_by_hand_is_judged_by_overlap_and_an_event_is_one_cut_at_most() {
        let models = vocabulary::all().expect("models");
        let mut score = Score::new(&models);
        let cuts = [label("bow", Some((0.0, 2.0))), label("bow", Some((1.0, 3.0)))];
        score.judge(&cuts.each_ref(), &[event("bow", 0.0, 3.0)], 30.0);
        let report = score.report(1);
        assert_eq!(report.global.tally, ClassTally { correct: 1, recognised: 1, truth: 2 });
        // The end is 1 s off, 30 frames, of which 10 are tolerated.
        let cut = report.segmentation.expect("cuts");
        assert!((cut.most_frames - 20.0).abs() < 1e-9 && cut.cuts == 2, "{cut:?}");
    }

    #[test]
    fn halves_have_every_other_clip_of_a_class_and_together_all() {
        let of = |file: &str, class: &str| Label { file: file.to_owned(), ..label(class, None) };
        let labels = [of("a", "x"), of("b", "x"), of("c", "y"), of("d", "x")];
        let files = |half| clips(&labels, half).into_keys().collect::<Vec<_>>();
        assert_eq!(files(Some(Half::First)), ["a", "c", "d"]);
        assert_eq!(files(Some(Half::Second)), ["b"]);
        assert_eq!(files(None).len(), 4);
    }

    #[test]
    fn a_table_without_classes_or_with_half_a_cut_is_refused_by_line() {
        assert!(
            parse_labels("file,kind\na,b").expect_err("no class").to_string().contains("line 1")
        );
        let half = parse_labels("file,class,start_s,end_s\na,b,1,").expect_err("no end");
        assert!(half.to_string().contains("line 2"), "{half}");
        let labels = parse_labels("file,class,start_s,end_s\na,b,1,2\nc,d,,").expect("labels");
        assert_eq!(labels[0].span, Some(Span { start_s: 1.0, end_s: 2.0 }));
        assert_eq!(labels[1].span, None);
    }
}
