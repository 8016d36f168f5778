//! A model drafted from clips: what all of them share.

use super::recognise::{EquationReading, SeenBody};
use super::source::{CaptureOptions, body_motion};
use crate::draft;
use crate::error::{Error, ErrorKind};
use crate::recognise::example::{DraftName, drafted};
use crate::recognise::features::{Extractor, FeatureRow};
use crate::recognise::machine::{ActionEvent, ModelMachine, Span};
use crate::recognise::model::file::{self, Bands};
use crate::recognise::model::{ActionModel, BodySide};
use serde::Serialize;
use std::path::PathBuf;

/// What is to be drafted.
#[derive(Clone, Debug)]
pub struct DraftModelOrder {
    /// Name of the model.
    pub name: String,
    /// The action it shows; its name if none is given.
    pub action: Option<String>,
    /// The side, if it has one.
    pub side: Option<BodySide>,
    /// Captures or actions, each of them with one example: all of it, or `CLIP@FROM..TO` in s.
    pub examples: Vec<String>,
    /// What AMC files and markers do not say themselves.
    pub reading: CaptureOptions,
    /// The model file.
    pub file: PathBuf,
    /// It may replace one that is there.
    pub replace: bool,
}

/// One example.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ModelExample {
    /// The capture or action.
    pub motion: String,
    /// From where, s.
    pub start_s: f64,
    /// To where, s.
    pub end_s: f64,
    /// How often the draft fires in it; once is right.
    pub fired: usize,
}

/// What came of it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DraftModelReport {
    /// `done`.
    pub outcome: &'static str,
    /// Name of the model.
    pub name: String,
    /// Its phases.
    pub phases: Vec<String>,
    /// The examples, and whether the draft sees them.
    pub examples: Vec<ModelExample>,
    /// Where.
    pub written: String,
}

/// Drafts a model from examples, and tries it on them.
///
/// # Errors
/// An example that cannot be read, or is cut where nothing is; examples that share no motion; a name that is none; a
/// file that cannot be written.
pub fn draft_model(order: &DraftModelOrder) -> Result<DraftModelReport, Error> {
    draft::check_free(&order.file, order.replace)?;
    if order.examples.is_empty() {
        return Err(Error::new("a model is drafted from examples")
            .at("--from")
            .allowed("a capture, or a part of one: CLIP@FROM..TO, in s"));
    }
    let mut examples = Vec::new();
    let mut rows = Vec::new();
    for example in &order.examples {
        let (example, of) = seen(example, &order.reading)?;
        examples.push(example);
        rows.push(of);
    }
    let name = DraftName { name: &order.name, action: order.action.as_deref(), side: order.side };
    let text = drafted(&name, &rows).ok_or_else(|| {
        Error::of(ErrorKind::Unknown, "the examples share no motion")
            .at("--from")
            .got(order.examples.join(", "))
            .allowed("clips in which one part of the body goes to and fro in the same order")
            .remedy("cut the clips to the action alone: CLIP@FROM..TO, in s")
    })?;
    let place = order.file.display().to_string();
    let model = file::parse(&text, &place, &Bands::default(), &file::none_to_mirror)?;
    for (example, rows) in examples.iter_mut().zip(&rows) {
        example.fired = fired(&model, rows);
    }
    draft::write_file(&order.file, order.replace, text.as_bytes())?;
    Ok(DraftModelReport {
        outcome: "done",
        name: model.name,
        phases: model.phases.into_iter().map(|phase| phase.name).collect(),
        examples,
        written: place,
    })
}

/// An example and its features.
fn seen(example: &str, reading: &CaptureOptions) -> Result<(ModelExample, Vec<FeatureRow>), Error> {
    let (motion, part) = span(example)?;
    let (capture, _) = body_motion(motion, None, reading)?;
    let body = SeenBody::of(&capture)?;
    let mut extractor = Extractor::new(body.lengths, EquationReading::Repaired, body.noise);
    let dt_s = 1.0 / capture.rate_hz;
    let length_s = (body.frames.len().max(1) - 1) as f64 * dt_s;
    let Span { start_s, end_s } = part.unwrap_or(Span { start_s: 0.0, end_s: length_s });
    let outside = |what: &str| {
        Error::of(ErrorKind::OutsideLimits, what)
            .at(motion)
            .got(format!("{start_s} to {end_s} s"))
            .allowed(format!("0 to {length_s:.2} s"))
    };
    // A capture is a frame longer than its last frame is late.
    if end_s > length_s + dt_s && start_s < length_s {
        return Err(outside("this part goes beyond the end of the capture"));
    }
    // All of the capture is looked at: contacts and floor need what was before.
    let rows: Vec<FeatureRow> = body
        .frames
        .iter()
        .enumerate()
        .map(|(n, points)| (n as f64 * dt_s, extractor.next(points, dt_s)))
        .filter(|(at_s, _)| (start_s..=end_s).contains(at_s))
        .map(|(_, row)| row)
        .collect();
    if rows.len() < 2 {
        return Err(outside("there is nothing in this part of the capture"));
    }
    Ok((ModelExample { motion: motion.to_owned(), start_s, end_s, fired: 0 }, rows))
}

/// `CLIP@FROM..TO`. A file may have the sign in its name.
fn span(example: &str) -> Result<(&str, Option<Span>), Error> {
    let Some((motion, times)) = example.rsplit_once('@') else { return Ok((example, None)) };
    let Some((from, to)) = times.split_once("..") else { return Ok((example, None)) };
    let seconds = |text: &str| text.strip_suffix('s').unwrap_or(text).parse::<f64>();
    match (seconds(from), seconds(to)) {
        (Ok(start_s), Ok(end_s)) if start_s >= 0.0 && start_s < end_s && end_s.is_finite() => {
            Ok((motion, Some(Span { start_s, end_s })))
        }
        (Ok(_), Ok(_)) => {
            Err(Error::of(ErrorKind::OutsideLimits, "a part of a capture ends after it begins")
                .at("--from")
                .got(example)
                .allowed("CLIP@FROM..TO, in s"))
        }
        _ => Ok((example, None)),
    }
}

fn fired(model: &ActionModel, rows: &[FeatureRow]) -> usize {
    let mut machine = ModelMachine::new(EquationReading::Repaired);
    let mut fired = 0;
    let mut tell = |what| fired += usize::from(matches!(what, ActionEvent::Done { .. }));
    let mut time_s = 0.0;
    for row in rows {
        machine.next(model, row, time_s, &mut tell);
        time_s += row.dt_s;
    }
    machine.finish(model, &mut tell);
    fired
}
