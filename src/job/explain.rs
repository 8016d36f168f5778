//! Why models did or did not fire in a motion.

use super::recognise::{EquationReading, SeenBody, models, slowed_by};
use super::source::{CaptureOptions, Source, body_motion};
use crate::error::{Error, ErrorKind};
use crate::mocap::anatomy::Capture;
use crate::recognise::explain::{Attempt, Explainer};
use crate::recognise::features::{Extractor, FEATURES, Feature};
use crate::recognise::machine::Span;
use crate::recognise::model::{ActionModel, Shortfall};
use serde::Serialize;
use std::path::PathBuf;

pub use crate::recognise::explain::Stopped;
pub use crate::recognise::model::{BodySide, Demand};

/// What is to be explained.
#[derive(Clone, Debug, Default)]
pub struct ExplainOrder {
    /// A capture, or actions.
    pub motion: String,
    /// File that says which joint of the capture is which body segment.
    pub mapping: Option<PathBuf>,
    /// What the capture does not say itself.
    pub reading: CaptureOptions,
    /// Folder of models in place of the shipped ones.
    pub models: Option<PathBuf>,
    /// The models to explain, by name; or all models of an action. Empty for all.
    pub only: Vec<String>,
    /// Only what has a frame from here on, s.
    pub from_s: Option<f64>,
    /// Only what has a frame until here, s.
    pub to_s: Option<f64>,
    /// Everything takes so many times as long as where a person does it; `None`: as long. Times that are told are the
    /// source's own, figures those that the models see.
    pub slowed: Option<f64>,
    /// A page that shows it.
    pub html: Option<PathBuf>,
    /// It may replace one that is there.
    pub replace: bool,
}

/// A demand that was not met.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct UnmetDemand {
    /// Of each frame (`frame`, `posture`), or when the phase ends (`amount`, `speed`, `average`, `duration`).
    pub demand: Demand,
    /// Of which feature; null for a duration.
    pub feature: Option<String>,
    /// What there was; null if the source does not show it.
    pub value: Option<f64>,
    /// The least that would do; null for none.
    pub from: Option<f64>,
    /// The most that would do; null for none.
    pub to: Option<f64>,
    /// How far the value is out: above zero beyond `to`, below zero before `from`.
    pub by: Option<f64>,
}

/// The attempt that came furthest.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FurthestAttempt {
    /// Where it began, s.
    pub start_s: f64,
    /// Where it failed, s.
    pub at_s: f64,
    /// The phase that failed, the first is 1.
    pub number: usize,
    /// Its name.
    pub phase: String,
    /// How.
    pub stopped: Stopped,
    /// What was wanting.
    pub wanting: Vec<UnmetDemand>,
    /// What the frame lacked that ended the phase.
    pub ended_by: Vec<UnmetDemand>,
}

/// An action that was recognised.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FiredSpan {
    /// Its first frame, s.
    pub start_s: f64,
    /// Its last frame, s.
    pub end_s: f64,
}

/// One model.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ExplainedModel {
    /// Its name.
    pub model: String,
    /// The action it shows.
    pub action: String,
    /// On which side, where it has one.
    pub side: Option<BodySide>,
    /// How many phases it has.
    pub phases: usize,
    /// Where it fired.
    pub fired: Vec<FiredSpan>,
    /// How often a phase was entered and nothing came of it.
    pub failed_attempts: usize,
    /// The attempt that came furthest of those that came to nothing; null if there was no frame to look at.
    pub furthest: Option<FurthestAttempt>,
    /// Features that it needs and the source never shows.
    pub missing: Vec<String>,
}

/// Why models did or did not fire.
#[derive(Clone, Debug, Serialize)]
pub struct ExplainReport {
    /// `done`.
    pub outcome: &'static str,
    /// What was looked at.
    pub motion: String,
    /// The motion as it came in.
    pub source: Source,
    /// Frames per second.
    pub rate_hz: f64,
    /// Frames.
    pub frames: usize,
    /// By model, in the order of their names.
    pub models: Vec<ExplainedModel>,
    /// Page written.
    pub html: Option<String>,
    /// Choices made on the way.
    pub notes: Vec<String>,
}

/// Why models did or did not fire in a motion, and the body in that motion.
///
/// # Errors
/// A motion or a model that cannot be read, a name that no model has, a span that ends before it begins, a pace that
/// nobody has.
pub(super) fn looked_at(order: &ExplainOrder) -> Result<(ExplainReport, Capture), Error> {
    let slowed = slowed_by(order.slowed)?;
    let within = Span {
        start_s: order.from_s.map_or(f64::NEG_INFINITY, |from_s| from_s / slowed),
        end_s: order.to_s.map_or(f64::INFINITY, |to_s| to_s / slowed),
    };
    if !(within.start_s <= within.end_s) {
        return Err(Error::of(ErrorKind::OutsideLimits, "a span ends before it begins")
            .at("--from, --to")
            .got(format!("{} to {} s", slowed * within.start_s, slowed * within.end_s)));
    }
    let models = chosen(models(order.models.as_deref())?, &order.only)?;
    let (mut capture, source) =
        body_motion(&order.motion, order.mapping.as_deref(), &order.reading)?;
    let rate_hz = capture.rate_hz;
    capture.rate_hz *= slowed;
    let body = SeenBody::of(&capture)?;
    let mut extractor = Extractor::new(body.lengths, EquationReading::Repaired, body.noise);
    let mut explainers: Vec<Explainer> = models.iter().map(|_| Explainer::new(within)).collect();
    let mut seen = [false; FEATURES];
    let dt_s = 1.0 / capture.rate_hz;
    for (n, points) in body.frames.iter().enumerate() {
        let row = extractor.next(points, dt_s);
        for (seen, value) in seen.iter_mut().zip(&row.values) {
            *seen |= !value.is_nan();
        }
        for (model, explainer) in models.iter().zip(&mut explainers) {
            explainer.next(model, &row, n as f64 * dt_s);
        }
    }
    let explained = models.iter().zip(explainers).map(|(model, explainer)| {
        let (fired, failed_attempts, furthest) = explainer.finish(model);
        let missing = model.needs().into_iter().filter(|feature| !seen[feature.index()]);
        let span =
            |span: Span| FiredSpan { start_s: slowed * span.start_s, end_s: slowed * span.end_s };
        ExplainedModel {
            model: model.name.clone(),
            action: model.action.clone(),
            side: model.side,
            phases: model.phases.len(),
            fired: fired.into_iter().map(span).collect(),
            failed_attempts,
            furthest: furthest.map(|attempt| told(model, attempt, slowed)),
            missing: missing.map(Feature::name).collect(),
        }
    });
    let models: Vec<ExplainedModel> = explained.collect();
    capture.rate_hz = rate_hz;
    let report = ExplainReport {
        outcome: "done",
        motion: order.motion.clone(),
        rate_hz,
        frames: capture.poses.len(),
        models,
        html: order.html.as_ref().map(|path| path.display().to_string()),
        notes: capture.notes.clone(),
        source,
    };
    Ok((report, capture))
}

fn chosen(models: Vec<ActionModel>, only: &[String]) -> Result<Vec<ActionModel>, Error> {
    let is_it = |model: &ActionModel, name: &String| model.name == *name || model.action == *name;
    for name in only {
        if !models.iter().any(|model| is_it(model, name)) {
            let known = models.iter().map(|model| &model.name);
            return Err(Error::of(ErrorKind::Unknown, "there is no such model")
                .at("--model")
                .none_of(name, known, "take one of these"));
        }
    }
    let is_asked = |model: &ActionModel| only.is_empty() || only.iter().any(|n| is_it(model, n));
    Ok(models.into_iter().filter(is_asked).collect())
}

fn told(model: &ActionModel, attempt: Attempt, slowed: f64) -> FurthestAttempt {
    FurthestAttempt {
        start_s: slowed * attempt.start_s,
        at_s: slowed * attempt.at_s,
        number: attempt.phase + 1,
        phase: model.phases[attempt.phase].name.clone(),
        stopped: attempt.stopped,
        wanting: attempt.wanting.iter().map(unmet).collect(),
        ended_by: attempt.ended_by.iter().map(unmet).collect(),
    }
}

fn unmet(shortfall: &Shortfall) -> UnmetDemand {
    let number = |value: f64| value.is_finite().then_some(value);
    UnmetDemand {
        demand: shortfall.demand,
        feature: shortfall.feature.map(Feature::name),
        value: number(shortfall.value),
        from: number(shortfall.range.from),
        to: number(shortfall.range.to),
        by: number(shortfall.by()),
    }
}
