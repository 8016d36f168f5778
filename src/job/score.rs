//! How good the recogniser is on labelled clips.
//!
//! A clip's label is a row of a table (`labels.csv` in the folder, or a file that is named): `file`, `class`,
//! and if known `side`, `style`, `source`, `start_s` and `end_s`. Rows with times are judged as Salamah and
//! Brunnett do: the same class, and an overlap of more than half of what was cut by hand. A row without
//! times says what somebody does in the whole clip, and no more: the class counts as recognised there if it was recognised at
//! least once, and as false if it was and is not the label. Labels that no model means are distractors:
//! whatever is recognised in them is false. Labels of single frames are cuts as well.

use super::labels::{self, Cut, Label};
use super::recognise::{EquationReading, RecognisedAction, SeenBody, models, of_body};
use super::source::{CaptureOptions, body_motion};
use crate::error::{Error, ErrorKind};
use crate::job::report::counted;
use crate::recognise::machine::Span;
use crate::recognise::model::ActionModel;
use crate::recognise::score::{ClassTally, interval, is_same, segmentation_error};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use corruption::Corruption;
use nearest::{ClassBaseline, Example, baselines};

pub mod agreement;
mod corruption;
pub mod motions;
pub mod nearest;
mod people;
pub mod retargeting;
pub mod splicing;
pub mod transitioning;
mod words;

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
    /// The table of labels, or a folder of labels of frames; `labels.csv` in the folder if none is named.
    pub labels: Option<PathBuf>,
    /// Folder of models in place of the shipped ones.
    pub models: Option<PathBuf>,
    /// How the paper's equations are read.
    pub equations: EquationReading,
    /// All clips, or one half of them.
    pub half: Option<Half>,
    /// Judge it on corrupted copies of the clips as well.
    pub corruptions: bool,
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

/// What a corruption of all clips costs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CorruptionFigures {
    /// What was done to the clips.
    pub corruption: &'static str,
    /// Of all classes together; what needs a joint that is not seen is not asked for.
    pub global: ClassFigures,
    /// By class.
    pub per_class: Vec<ClassFigures>,
    /// How much later an action is known than in the clip as it stands, s of it, mean over what is right in both.
    pub delay_s: Option<f64>,
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
    /// What plain ways reach that are told from when to when something is done.
    pub baselines: Vec<ClassBaseline>,
    /// What could not be better.
    pub bound: (&'static str, f64),
    /// Of all together.
    pub global: ClassFigures,
    /// Mean of the classes' precisions.
    pub mean_precision: Option<f64>,
    /// Mean of the classes' recalls.
    pub mean_recall: Option<f64>,
    /// By class.
    pub per_class: Vec<ClassFigures>,
    /// By style, with what is false in clips of no model.
    pub per_style: Vec<ClassFigures>,
    /// By source, likewise: the column `source` of the table, or the folder in which the clip lies.
    pub per_source: Vec<ClassFigures>,
    /// By label: the confusion table.
    pub per_label: Vec<LabelFigures>,
    /// Of those with a side: how many of the right recognitions had it.
    pub sides: ClassTally,
    /// Of what was cut by hand; null without.
    pub segmentation: Option<CutFigures>,
    /// By corruption, if they were asked for.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub per_corruption: Vec<CorruptionFigures>,
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
    let labels = labels::read(&table, Some(&order.folder))?;
    let by_file = clips(&labels.list, order.half);
    if by_file.is_empty() {
        return Err(Error::of(ErrorKind::Absent, "no clip has a label")
            .at(table.display().to_string())
            .remedy("write a row for each clip, and judge all of them where a half has none"));
    }
    let mut score = Score::new(&models);
    let count = by_file.len();
    let tried = if order.corruptions { &corruption::TRIED[..] } else { &[] };
    let mut examples = Vec::new();
    let mut corrupted: Vec<(Score<'_>, Vec<f64>)> =
        tried.iter().map(|_| (Score::new(&models), Vec::new())).collect();
    for (index, (file, of_file)) in by_file.iter().enumerate() {
        hear(index, count, file);
        let motion = order.folder.join(file).display().to_string();
        let clip =
            body_motion(&motion, None, &CaptureOptions::default()).and_then(|(capture, _)| {
                let body = SeenBody::of(&capture)?;
                let (rate_hz, equations) = (capture.rate_hz, order.equations);
                let found = of_body(&body, rate_hz, models.clone(), equations, &mut |_| ());
                Ok((rate_hz, body, found.events))
            });
        match clip {
            Ok((rate_hz, body, events)) => {
                let frames = body.frames.len();
                if let Some(of) = labels.frames.get(*file).filter(|of| **of != frames) {
                    score.unread.push(format!(
                        "{file}: {frames}, and labels of {of}",
                        frames = counted(frames, "frame")
                    ));
                    continue;
                }
                score.frames += frames;
                score.duration_s += frames as f64 / rate_hz;
                let (of_file, beyond): (Vec<&Label>, Vec<&Label>) =
                    of_file.iter().partition(|label| label.is_inside(frames, rate_hz));
                score.unread.extend(beyond.iter().map(|label| {
                    format!(
                        "{file}: a label of {} begins before or after its {frames}",
                        label.class,
                        frames = counted(frames, "frame")
                    )
                }));
                for label in &of_file {
                    let class = meant(&label.class, &models);
                    let told = (*file, label.subject.as_deref());
                    let frames = label.within(&body.frames, rate_hz);
                    examples.push(Example::of(class, told, frames, body.lengths.leg_m()));
                }
                let unclear = labels.unclear.get(*file).map_or(&[][..], Vec::as_slice);
                let clip = LabelledClip { body: &body, rate_hz, labels: &of_file, unclear };
                let events = score.clear(events, unclear, rate_hz);
                if of_file.is_empty() {
                    continue;
                }
                score.judge(&of_file, &events, rate_hz);
                for ((_, done), (score, delays)) in tried.iter().zip(&mut corrupted) {
                    clip.judge(*done, index as u64, order.equations, &events, score, delays);
                }
            }
            Err(error) => score.unread.push(error.to_string()),
        }
    }
    let mut report = score.report(count);
    report.baselines = baselines(&examples);
    let figures = tried.iter().zip(corrupted).map(|((name, _), (score, delays))| {
        let all = delays.len() as f64;
        let report = score.report(count);
        CorruptionFigures {
            corruption: name,
            global: report.global,
            per_class: report.per_class,
            delay_s: (all > 0.0).then(|| delays.iter().sum::<f64>() / all),
        }
    });
    report.per_corruption = figures.collect();
    Ok(report)
}

/// A clip with what is known of it.
struct LabelledClip<'a> {
    body: &'a SeenBody,
    rate_hz: f64,
    labels: &'a [&'a Label],
    unclear: &'a [(String, Cut)],
}

impl LabelledClip<'_> {
    /// Judges what is recognised in the clip after something was done to it, against what was in it as it stands. All times
    /// are told as of that.
    fn judge(
        &self,
        done: Corruption,
        number: u64,
        equations: EquationReading,
        before: &[RecognisedAction],
        score: &mut Score<'_>,
        delays: &mut Vec<f64>,
    ) {
        let (body, rate_hz) = done.of(self.body, self.rate_hz, number);
        let models = score.models;
        let found = of_body(&body, rate_hz, models.to_vec(), equations, &mut |_| ());
        let is_blind = |model: &ActionModel| found.blind.iter().any(|of| of.model == model.name);
        let is_seen = |label: &Label| {
            let Some(class) = meant(&label.class, models) else { return true };
            let side = label.side.map(|side| done.side(side));
            let of_it = |model: &&ActionModel| {
                model.action == class && (side.is_none() || model.side == side)
            };
            let mut of_class = models.iter().filter(of_it).peekable();
            of_class.peek().is_none() || of_class.any(|model| !is_blind(model))
        };
        let labels: Vec<&Label> =
            self.labels.iter().copied().filter(|label| is_seen(label)).collect();
        let pace = done.pace();
        let events = found.events.into_iter().map(|event| event.timed(|time_s| time_s * pace));
        let events = score.clear(events.collect(), self.unclear, self.rate_hz);
        let mirrored = |event: RecognisedAction| RecognisedAction {
            side: event.side.map(|side| done.side(side)),
            ..event
        };
        let events: Vec<RecognisedAction> = events.into_iter().map(mirrored).collect();
        for label in labels.iter().filter(|label| label.cut.is_some()) {
            let known_s = |events: &[RecognisedAction]| {
                let class = meant(&label.class, models)?;
                let span = label.cut?.span(self.rate_hz);
                let is_it =
                    |event: &&RecognisedAction| event.action == class && is_same(&of(event), &span);
                events.iter().find(is_it).map(|event| event.recognised_at_s)
            };
            delays.extend(known_s(&events).zip(known_s(before)).map(|(now, then)| now - then));
        }
        if !labels.is_empty() {
            score.judge(&labels, &events, self.rate_hz);
        }
    }
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
    sources: BTreeMap<String, ClassTally>,
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
            sources: BTreeMap::new(),
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
            labels.iter().partition(|label| label.cut.is_some());
        if cut.is_empty() {
            for label in &whole {
                self.judge_clip(label, events);
            }
        } else {
            self.cut_by_hand += cut.len();
            self.judge_cuts(&cut, events, rate_hz);
        }
    }

    /// Without what was recognised where nobody can say whether it is done: more than half of it lies there.
    fn clear(
        &self,
        events: Vec<RecognisedAction>,
        unclear: &[(String, Cut)],
        rate_hz: f64,
    ) -> Vec<RecognisedAction> {
        let is_unclear = |event: &RecognisedAction| {
            unclear.iter().any(|(class, cut)| {
                meant(class, self.models) == Some(event.action.as_str())
                    && is_same(&cut.span(rate_hz), &of(event))
            })
        };
        events.into_iter().filter(|event| !is_unclear(event)).collect()
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

    /// Counts by style and source what was counted of a clip.
    fn split(&mut self, label: &Label, one: ClassTally) {
        let style = self.styles.entry(label.style.clone().unwrap_or_default()).or_default();
        *style = style.plus(one);
        let source = self.sources.entry(label.source().to_owned()).or_default();
        *source = source.plus(one);
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
        let mut one = ClassTally { recognised: found.len(), ..ClassTally::default() };
        if let Some(class) = class {
            let is_right = found.contains(class);
            (one.truth, one.correct) = (1, usize::from(is_right));
            let tally = self.classes.entry(class.to_owned()).or_default();
            tally.truth += 1;
            tally.correct += usize::from(is_right);
        }
        self.split(label, one);
        let Some(class) = class else { return };
        // A walk to the left is one of both feet.
        let is_of_limb = label.class == class || label.class.ends_with("-hand");
        let Some(right) = label.side.filter(|_| is_of_limb) else { return };
        for event in events.iter().filter(|event| event.action == class) {
            let Some(side) = event.side else { continue };
            self.sides.recognised += 1;
            self.sides.truth += 1;
            self.sides.correct += usize::from(side == right);
        }
    }

    /// Labels of one clip that were cut by hand. What is recognised in it has the style and the source of the first.
    fn judge_cuts(&mut self, cuts: &[&Label], events: &[RecognisedAction], rate_hz: f64) {
        let mut taken = vec![false; events.len()];
        for event in events {
            self.classes.entry(event.action.clone()).or_default().recognised += 1;
        }
        if let Some(first) = cuts.first() {
            self.split(first, ClassTally { recognised: events.len(), ..ClassTally::default() });
        }
        for label in cuts {
            let Some(span) = label.cut.map(|cut| cut.span(rate_hz)) else { continue };
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
            let correct = usize::from(found.is_some());
            tally.correct += correct;
            if let Some((event, taken)) = found {
                *taken = true;
                for (found_s, cut_s) in [(event.start_s, span.start_s), (event.end_s, span.end_s)] {
                    let frames = segmentation_error(found_s * rate_hz, &[cut_s * rate_hz]);
                    self.errors_frames.push((frames, 1e3 * frames / rate_hz));
                }
            }
            self.split(label, ClassTally { correct, recognised: 0, truth: 1 });
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
            baselines: Vec::new(),
            bound: ("all of them", 1.0),
            mean_precision: mean(there().filter_map(ClassTally::precision).collect()),
            mean_recall: mean(there().filter_map(ClassTally::recall).collect()),
            global: figures("all", global),
            per_class: self.classes.iter().map(|(class, tally)| figures(class, *tally)).collect(),
            per_style: self.styles.iter().map(|(style, tally)| figures(style, *tally)).collect(),
            per_source: self
                .sources
                .iter()
                .map(|(source, tally)| figures(source, *tally))
                .collect(),
            per_label: self.labels.into_values().collect(),
            sides: self.sides,
            segmentation,
            per_corruption: Vec::new(),
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
    use crate::recognise::model::BodySide;
    use crate::recognise::model::vocabulary;

    fn label(class: &str, span: Option<(f64, f64)>) -> Label {
        Label {
            cut: span.map(|(start_s, end_s)| Cut::Seconds(Span { start_s, end_s })),
            ..Label::of("a.bvh", class, None)
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
    fn a_label_is_of_a_clip_in_which_it_begins() {
        let inside = |span| label("bow", span).is_inside(60, 30.0);
        assert!(inside(None) && inside(Some((0.0, 9.0))) && inside(Some((1.9, 2.5))));
        assert!(!inside(Some((2.0, 3.0))) && !inside(Some((-1.0, 0.5))));
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
    fn figures_are_split_by_the_source_that_the_table_says_or_else_by_folder() {
        let models = vocabulary::all().expect("models");
        let mut score = Score::new(&models);
        let of = |file: &str, source: Option<&str>, span| Label {
            file: file.to_owned(),
            source: source.map(str::to_owned),
            ..label("bow", span)
        };
        score.judge(&[&of("cmu/02.bvh", None, None)], &[event("bow", 0.0, 1.0)], 30.0);
        score.judge(&[&of("cmu/03.bvh", None, None)], &[], 30.0);
        let cuts = [
            of("x/a.bvh", Some("suit"), Some((0.0, 2.0))),
            of("x/a.bvh", Some("suit"), Some((4.0, 6.0))),
        ];
        let found = [event("bow", 0.0, 2.0), event("walk", 4.0, 6.0)];
        score.judge(&cuts.each_ref(), &found, 30.0);
        let report = score.report(3);
        let tallies: Vec<(&str, ClassTally)> =
            report.per_source.iter().map(|of| (of.class.as_str(), of.tally)).collect();
        let tally = |correct, recognised, truth| ClassTally { correct, recognised, truth };
        assert_eq!(tallies, [("cmu", tally(1, 1, 2)), ("suit", tally(1, 2, 2))]);
        let all = tallies.iter().fold(ClassTally::default(), |all, of| all.plus(of.1));
        assert_eq!(all, report.global.tally);
    }

    #[test]
    fn the_side_of_a_wave_is_that_of_a_hand_and_that_of_a_turn_is_none() {
        let models = vocabulary::all().expect("models");
        let mut score = Score::new(&models);
        let of = |action: &str| RecognisedAction {
            side: Some(BodySide::Left),
            ..event(action, 0.0, 1.0)
        };
        let to_the_right =
            |class: &str| Label { side: Some(BodySide::Right), ..label(class, None) };
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
    fn what_is_recognised_where_nobody_can_say_is_neither_right_nor_false() {
        let models = vocabulary::all().expect("models");
        let score = Score::new(&models);
        let unclear = [("bow".to_owned(), Cut::Frames { first: 30, last: 90 })];
        let events =
            || vec![event("bow", 1.5, 2.5), event("bow", 2.8, 4.0), event("walk", 1.5, 2.5)];
        let left = score.clear(events(), &unclear, 30.0);
        let left: Vec<(&str, f64)> =
            left.iter().map(|of| (of.action.as_str(), of.start_s)).collect();
        assert_eq!(left, [("bow", 2.8), ("walk", 1.5)]);
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
}
