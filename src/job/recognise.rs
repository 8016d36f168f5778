//! What a body does, named: events as they happen, and a report at the end.

use super::labels::{RecognisedTrial, is_folder_name, write_recognised};
use super::page;
use super::recognised::{event, recognised};
use super::source::{self, Source};
use crate::body::{BodyFigure, Proportions};
use crate::draft;
use crate::error::{Error, ErrorKind};
use crate::job::report::counted;
use crate::mocap::anatomy::Capture;
use crate::mocap::files::CaptureOptions;
use crate::recognise::features::{Feature, Noise};
use crate::recognise::machine::{ActionEvent, Span};
use crate::recognise::model::file::{self, Bands, MAX_BYTES};
use crate::recognise::model::{ActionModel, BodySide, vocabulary};
use crate::recognise::points::{Lengths, Points};
use crate::recognise::stream::Recogniser;
use crate::sensing::SourceReport;
use crate::table::TableWriter;
use crate::view::ViewPage;
use crate::view::tracks::{SpanKind, ViewSpan};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::io::Read;
use std::path::{Path, PathBuf};

pub use super::recognised::{PhaseTimes, RecognisedAction, RecognitionEvent};
pub use crate::recognise::posture::EquationReading;

/// Most model files of a folder.
const MAX_MODELS: usize = 10_000;

/// How many times slower than a person a source may be.
const SLOWED: core::ops::RangeInclusive<f64> = 0.1..=20.0;

/// What is to be recognised, and by what.
#[derive(Clone, Debug, Default)]
pub struct RecogniseOrder {
    /// A capture (.bvh, .amc), or actions.
    pub motion: String,
    /// File that says which joint of the capture is which body segment.
    pub mapping: Option<PathBuf>,
    /// What the capture does not say itself.
    pub reading: CaptureOptions,
    /// Folder of models in place of the shipped ones.
    pub models: Option<PathBuf>,
    /// How the paper's equations are read.
    pub equations: EquationReading,
    /// Everything takes so many times as long as where a person does it; `None`: as long.
    pub slowed: Option<f64>,
    /// A table of what was found, or a folder for labels of frames ([`super::labels::is_folder_name`]).
    pub labels: Option<PathBuf>,
    /// A page that shows it.
    pub html: Option<PathBuf>,
    /// It may replace one that is there.
    pub replace: bool,
}

/// A model that could not fire, because the source does not show what it needs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BlindModel {
    /// Which.
    pub model: String,
    /// The features that were never there.
    pub missing: Vec<String>,
}

/// What was recognised.
#[derive(Clone, Debug, Serialize)]
pub struct RecogniseReport {
    /// `done`; `stopped` if a source that was heard live was gone before its end, or a signal other than Ctrl-C ended it.
    pub outcome: &'static str,
    /// Why it was.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stop_reason: Option<String>,
    /// What was looked at.
    pub motion: String,
    /// The motion as it came in.
    pub source: Source,
    /// Frames per second.
    pub rate_hz: f64,
    /// Frames.
    pub frames: usize,
    /// Models that looked on.
    pub models: usize,
    /// How far a point moves in a frame in which nothing moves, m: in the quietest half second of the source.
    /// Null where nobody ever stands still.
    pub noise_m: Option<f64>,
    /// What was recognised, in the order in which it was known.
    pub events: Vec<RecognisedAction>,
    /// Models that could not fire.
    pub blind: Vec<BlindModel>,
    /// Page written.
    pub html: Option<String>,
    /// Choices made on the way.
    pub notes: Vec<String>,
    /// What came from each sensor that was heard live.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub sensors: Vec<SourceReport>,
    /// Actions of all models to which the source shows what they need.
    #[serde(skip)]
    looked_for: BTreeSet<String>,
}

impl RecogniseReport {
    /// A source that was heard until a signal came from outside was stopped, unless it had stopped before.
    pub fn is_ended_by(&mut self, signal: i32) -> bool {
        let is_first = self.stop_reason.is_none();
        if is_first {
            self.outcome = "stopped";
            self.stop_reason = Some(format!("asked to end by signal {signal}"));
        }
        is_first
    }
}

/// The models of a folder, or those that ship with gaitway.
///
/// # Errors
/// A folder that cannot be read or has no models, a file that is no model, two models of one name.
pub fn models(folder: Option<&Path>) -> Result<Vec<ActionModel>, Error> {
    let Some(folder) = folder else { return vocabulary::all() };
    let unreadable = |e: std::io::Error| {
        Error::of((&e).into(), "the folder of models cannot be read")
            .at(folder.display().to_string())
            .got(e.to_string())
    };
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(unreadable)? {
        let path = entry.map_err(unreadable)?.path();
        if path.extension().is_some_and(|ending| ending == "toml") {
            files.push(path);
        }
        if files.len() > MAX_MODELS {
            return Err(Error::of(ErrorKind::OutsideLimits, "too many models")
                .at(folder.display().to_string())
                .allowed(MAX_MODELS.to_string()));
        }
    }
    files.sort_unstable();
    if files.is_empty() {
        return Err(Error::of(ErrorKind::Absent, "there are no models in this folder")
            .at(folder.display().to_string())
            .allowed("files that end in .toml"));
    }
    let mut models: Vec<ActionModel> = Vec::new();
    for path in &files {
        let model = read_model(path)?;
        if let Some(other) = models.iter().position(|other| other.name == model.name) {
            return Err(Error::new("two models have one name")
                .at(path.display().to_string())
                .got(format!("{}, also in {}", model.name, files[other].display())));
        }
        models.push(model);
    }
    Ok(models)
}

/// Reads a model file; a model that it mirrors is looked for beside it, then among the shipped ones.
///
/// # Errors
/// A file that cannot be read or is no model.
pub fn read_model(path: &Path) -> Result<ActionModel, Error> {
    let beside = |name: &str| {
        let fits = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
        let is_name = name.chars().all(fits);
        let other = path.with_file_name(format!("{name}.toml"));
        if !is_name || !other.exists() {
            return vocabulary::find(name);
        }
        let place = other.display().to_string();
        file::parse(&model_text(&other)?, &place, &Bands::default(), &file::none_to_mirror)
    };
    file::parse(&model_text(path)?, &path.display().to_string(), &Bands::default(), &beside)
}

fn model_text(path: &Path) -> Result<String, Error> {
    let unreadable = |e: std::io::Error| {
        Error::of((&e).into(), "cannot read the model file")
            .at(path.display().to_string())
            .got(e.to_string())
    };
    // Asked before opening: opening a FIFO would wait for a writer.
    if !std::fs::metadata(path).map_err(unreadable)?.is_file() {
        return Err(Error::of(ErrorKind::Malformed, "this is not a regular file")
            .at(path.display().to_string()));
    }
    let mut text = String::new();
    let opened = std::fs::File::open(path).map_err(unreadable)?;
    opened.take(MAX_BYTES as u64 + 1).read_to_string(&mut text).map_err(unreadable)?;
    Ok(text)
}

/// Recognises what is done in a motion. Events are told to `hear` as they happen.
///
/// # Errors
/// A motion or a model that cannot be read, a table that cannot be written.
pub fn recognise(
    order: &RecogniseOrder,
    mut hear: impl FnMut(&RecognitionEvent),
) -> Result<RecogniseReport, Error> {
    let models = models(order.models.as_deref())?;
    let slowed = slowed_by(order.slowed)?;
    let (mut capture, source) =
        source::body_motion(&order.motion, order.mapping.as_deref(), &order.reading)?;
    // Seen as fast as a person does it, and told by the source's own clock.
    capture.rate_hz *= slowed;
    let own = |time_s: f64| time_s * slowed;
    let mut told = |event: &RecognitionEvent| hear(&event.clone().timed(own));
    let mut found = of_capture(&capture, models, order.equations, &mut told)?;
    found.events = found.events.into_iter().map(|event| event.timed(own)).collect();
    capture.rate_hz /= slowed;
    concluded(order, Some(&capture), found, source)
}

/// Writes down what was found: the report, and what else was ordered. Without a capture there is no page.
///
/// # Errors
/// A page or a table that cannot be written.
pub(super) fn concluded(
    order: &RecogniseOrder,
    capture: Option<&Capture>,
    found: Found,
    source: Source,
) -> Result<RecogniseReport, Error> {
    if let Some((path, capture)) = order.html.as_ref().zip(capture) {
        let title = format!("what is done in {}", order.motion);
        let html = page(&title, capture, &found)?;
        draft::write_file(path, order.replace, html.as_bytes())?;
    }
    let report = RecogniseReport {
        outcome: "done",
        stop_reason: None,
        motion: order.motion.clone(),
        rate_hz: source.rate_hz,
        frames: source.frames,
        models: found.models,
        noise_m: found.noise_m,
        events: found.events,
        blind: found.blind,
        html: order.html.as_ref().map(|path| path.display().to_string()),
        notes: capture.map(|capture| capture.notes.clone()).unwrap_or_default(),
        sensors: Vec::new(),
        source,
        looked_for: found.looked_for,
    };
    match &order.labels {
        Some(path) if is_folder_name(path) => {
            write_recognised(path, order.replace, &[report.labelled()])?;
        }
        Some(path) => draft::write_file(path, order.replace, &labels(&report.events)?)?,
        None => {}
    }
    Ok(report)
}

impl RecogniseReport {
    /// How much was looked at, how often each action was seen, and who could not see: lines for a person.
    #[must_use]
    pub fn figures(&self) -> String {
        let mut text = format!(
            "{} in {} at {} Hz, by {}\n",
            counted(self.events.len(), "event"),
            counted(self.frames, "frame"),
            self.rate_hz,
            counted(self.models, "model")
        );
        for ((action, side), count) in counts(&self.events) {
            let side = side.map_or("", BodySide::word);
            let _ = writeln!(text, "  {count:4} x {action} {side}");
        }
        for BlindModel { model, missing } in &self.blind {
            let missing = missing.join(", ");
            let _ = writeln!(text, "blind     {model}: the source does not show {missing}");
        }
        if let Some(reason) = &self.stop_reason {
            let _ = writeln!(text, "stopped   {reason}");
        }
        text
    }

    /// To be written frame by frame.
    pub(super) fn labelled(&self) -> RecognisedTrial<'_> {
        let span = |event: &RecognisedAction| Span { start_s: event.start_s, end_s: event.end_s };
        RecognisedTrial {
            motion: &self.motion,
            frames: self.frames,
            rate_hz: self.rate_hz,
            looked_for: &self.looked_for,
            found: self.events.iter().map(|event| (event.action.as_str(), span(event))).collect(),
        }
    }
}

/// How many times slower than a person a source is.
///
/// # Errors
/// What is slower or faster than anything that is played.
pub(super) fn slowed_by(asked: Option<f64>) -> Result<f64, Error> {
    let slowed = asked.unwrap_or(1.0);
    if SLOWED.contains(&slowed) {
        return Ok(slowed);
    }
    Err(Error::of(ErrorKind::OutsideLimits, "nothing is slowed like that")
        .at("--slowed")
        .got(slowed.to_string())
        .allowed(format!("{} to {}", SLOWED.start(), SLOWED.end())))
}

/// The person, with all actions and their phases on the time line.
fn page(title: &str, capture: &Capture, found: &Found) -> Result<String, Error> {
    let mut scene = page::body::person(capture)?;
    for event in &found.events {
        let side = event.side.map_or_else(String::new, |side| format!(" {}", side.word()));
        let name = format!("{}{side}", event.action);
        let (start_s, end_s) = (event.start_s, event.end_s);
        scene.spans.push(ViewSpan::new(SpanKind::Event, &name, &name, start_s, end_s));
        let row = format!("{name}: phases");
        scene.spans.extend(event.phases.iter().map(|phase| {
            ViewSpan::new(SpanKind::Phase, &row, &phase.name, phase.start_s, phase.end_s)
        }));
    }
    let models = format!("{} looked on, {} could not see", found.models, found.blind.len());
    let rows = [
        ("events", found.events.len().to_string()),
        ("models", models),
        ("duration", format!("{:.2} s", scene.duration_s)),
    ];
    let blind = found.blind.iter().map(|of| {
        format!("{} is blind: the source does not show {}", of.model, of.missing.join(", "))
    });
    ViewPage {
        title: title.to_owned(),
        summary_rows: rows.into_iter().map(|(name, said)| (name.to_owned(), said)).collect(),
        warnings: Vec::new(),
        notes: capture.notes.iter().cloned().chain(blind).collect(),
        scene,
    }
    .html()
}

/// What was found in a capture.
pub(super) struct Found {
    pub(super) models: usize,
    pub(super) noise_m: Option<f64>,
    pub(super) events: Vec<RecognisedAction>,
    pub(super) blind: Vec<BlindModel>,
    /// Actions of all models to which the source shows what they need.
    pub(super) looked_for: BTreeSet<String>,
}

/// What the recogniser sees of a capture.
pub(super) struct SeenBody {
    pub(super) lengths: Lengths,
    pub(super) frames: Vec<Points>,
    pub(super) noise: Option<Noise>,
}

impl SeenBody {
    pub(super) fn of(capture: &Capture) -> Result<Self, Error> {
        // Thresholds of models are in limbs of this figure.
        let body = Proportions::of_figure(BodyFigure::DrillisContini, capture.stature_m)?;
        let lengths = Lengths::of(&body);
        let points = |pose| Points::of(&body, pose, &capture.tracked);
        let frames: Vec<Points> = capture.poses.iter().map(points).collect();
        let noise = Noise::of_quietest(&frames, capture.rate_hz);
        Ok(Self { lengths, frames, noise: noise.filter(|noise| noise.is_still(&lengths)) })
    }
}

/// Recognises what is done in a capture.
pub(super) fn of_capture(
    capture: &Capture,
    models: Vec<ActionModel>,
    equations: EquationReading,
    hear: &mut impl FnMut(&RecognitionEvent),
) -> Result<Found, Error> {
    Ok(of_body(&SeenBody::of(capture)?, capture.rate_hz, models, equations, hear))
}

/// Recognises what a body does.
pub(super) fn of_body(
    body: &SeenBody,
    rate_hz: f64,
    models: Vec<ActionModel>,
    equations: EquationReading,
    hear: &mut impl FnMut(&RecognitionEvent),
) -> Found {
    let SeenBody { lengths, frames, noise } = body;
    let mut recogniser = Recogniser::new(models, *lengths, equations, *noise);
    let names: Vec<ActionModel> = recogniser.models().to_vec();
    let mut events = Vec::new();
    let mut tell = |index: usize, at_s: f64, what: ActionEvent| {
        let model = &names[index];
        hear(&event(model, at_s, &what));
        if let ActionEvent::Done { span, phases } = what {
            events.push(recognised(model, at_s, span, &phases));
        }
    };
    for points in frames {
        recogniser.next(points, 1.0 / rate_hz, &mut tell);
    }
    recogniser.finish(&mut tell);
    Found::of(&recogniser, noise.map(|noise| noise.norm_m), events)
}

impl Found {
    /// What a recogniser has seen, and what it could not see.
    pub(super) fn of(
        recogniser: &Recogniser,
        noise_m: Option<f64>,
        events: Vec<RecognisedAction>,
    ) -> Self {
        let models = recogniser.models();
        let blind = recogniser.blind();
        let sees = |index: usize| blind.iter().all(|(blind, _)| *blind != index);
        let seeing = models.iter().enumerate().filter(|(index, _)| sees(*index));
        let looked_for = seeing.map(|(_, model)| model.action.clone()).collect();
        let told = |(index, missing): &(usize, Vec<Feature>)| BlindModel {
            model: models[*index].name.clone(),
            missing: missing.iter().map(|feature| feature.name()).collect(),
        };
        let blind = blind.iter().map(told).collect();
        Self { models: models.len(), noise_m, events, blind, looked_for }
    }
}

/// A table of what was recognised.
fn labels(events: &[RecognisedAction]) -> Result<Vec<u8>, Error> {
    let mut out = TableWriter::new(Vec::new());
    out.row(["start_s", "end_s", "class", "side", "person"])?;
    for event in events {
        out.row([
            format!("{:.4}", event.start_s),
            format!("{:.4}", event.end_s),
            event.action.clone(),
            event.side.map_or("", BodySide::word).to_owned(),
            event.person.to_string(),
        ])?;
    }
    out.finish()
}

/// How often each action was recognised, on each side, in the order of their names.
fn counts(events: &[RecognisedAction]) -> BTreeMap<(&str, Option<BodySide>), usize> {
    let mut counts = BTreeMap::new();
    for event in events {
        *counts.entry((event.action.as_str(), event.side)).or_default() += 1;
    }
    counts
}

/// A model that is in order.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ModelReport {
    /// Its name.
    pub name: String,
    /// The action it shows.
    pub action: String,
    /// How many phases it has.
    pub phases: usize,
    /// How many of them are optional.
    pub leading: usize,
    /// The features without which it cannot fire.
    pub needs: Vec<String>,
}

/// Reads models and says what is in them: those of files, of folders, or the shipped ones if none is named.
///
/// # Errors
/// All that is wrong, the first fault with the others behind it.
pub fn check_models(paths: &[PathBuf]) -> Result<Vec<ModelReport>, Error> {
    let mut found = Vec::new();
    let mut faults = Vec::new();
    if paths.is_empty() {
        found = models(None)?;
    }
    for path in paths {
        let read = if path.is_dir() {
            models(Some(path))
        } else {
            read_model(path).map(|model| vec![model])
        };
        match read {
            Ok(more) => found.extend(more),
            Err(fault) => faults.push(fault),
        }
    }
    if !faults.is_empty() {
        let mut first = faults.remove(0);
        first.also = faults.into();
        return Err(first);
    }
    let report = |model: ActionModel| ModelReport {
        phases: model.phases.len(),
        leading: model.leading,
        needs: model.needs().into_iter().map(|feature| feature.name()).collect(),
        name: model.name,
        action: model.action,
    };
    Ok(found.into_iter().map(report).collect())
}

/// The names of all features.
#[must_use]
pub fn feature_names() -> Vec<String> {
    Feature::all().map(Feature::name).collect()
}
