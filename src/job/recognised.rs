//! An action that was recognised, and what is told of it while a source runs.

use crate::recognise::machine::{ActionEvent, Span};
use crate::recognise::model::{ActionModel, BodySide};
use serde::Serialize;

/// A phase of an action that was recognised.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PhaseTimes {
    /// Its name in the model.
    pub name: String,
    /// Its first frame, s.
    pub start_s: f64,
    /// Its last frame, s.
    pub end_s: f64,
}

/// An action that was recognised.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RecognisedAction {
    /// Which.
    pub action: String,
    /// On which side, where it has one.
    pub side: Option<BodySide>,
    /// The model that recognised it.
    pub model: String,
    /// Its first frame, s.
    pub start_s: f64,
    /// Its last frame, s.
    pub end_s: f64,
    /// When that was known, s.
    pub recognised_at_s: f64,
    /// Whose.
    pub person: usize,
    /// Its phases, in their order.
    pub phases: Vec<PhaseTimes>,
}

/// Something that happens while a source runs: a line of JSON.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RecognitionEvent {
    /// `begun`, `phase`, `done`, `broken_off`.
    pub kind: &'static str,
    /// When it is told, s.
    pub at_s: f64,
    /// Which action.
    pub action: String,
    /// On which side, where it has one.
    pub side: Option<BodySide>,
    /// The model that says so.
    pub model: String,
    /// Whose.
    pub person: usize,
    /// The phase that is over or was broken off, the first is 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub phase: Option<usize>,
    /// Of so many.
    pub phases: usize,
    /// Where it began, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub start_s: Option<f64>,
    /// Where it ended, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub end_s: Option<f64>,
}

impl RecognisedAction {
    /// The same, with its times by another clock.
    #[must_use]
    pub(super) fn timed(mut self, time_s: impl Fn(f64) -> f64) -> Self {
        let phases = self.phases.iter_mut().flat_map(|of| [&mut of.start_s, &mut of.end_s]);
        let own = [&mut self.start_s, &mut self.end_s, &mut self.recognised_at_s];
        own.into_iter().chain(phases).for_each(|at_s| *at_s = time_s(*at_s));
        self
    }

    /// In one line: from when to when, which, on which side.
    #[must_use]
    pub fn words(&self) -> String {
        words((self.start_s, self.end_s), &self.action, self.side)
    }
}

fn words((start_s, end_s): (f64, f64), action: &str, side: Option<BodySide>) -> String {
    let side = side.map_or("", BodySide::word);
    let line = format!("{start_s:8.2} to {end_s:7.2} s  {action:22} {side}");
    line.trim_end().to_owned()
}

impl RecognitionEvent {
    /// An action that is done, in one line; nothing of what is not yet.
    #[must_use]
    pub fn words_of_done(&self) -> Option<String> {
        let span = self.start_s.zip(self.end_s).filter(|_| self.kind == "done")?;
        Some(words(span, &self.action, self.side))
    }

    /// The same, with its times by another clock.
    #[must_use]
    pub(super) fn timed(mut self, time_s: impl Fn(f64) -> f64) -> Self {
        let times = [Some(&mut self.at_s), self.start_s.as_mut(), self.end_s.as_mut()];
        times.into_iter().flatten().for_each(|at_s| *at_s = time_s(*at_s));
        self
    }
}

/// What a model says at this moment, as it is told.
pub(super) fn event(model: &ActionModel, at_s: f64, what: &ActionEvent) -> RecognitionEvent {
    let (kind, phase, start_s, end_s) = match what {
        ActionEvent::Begun { start_s } => ("begun", None, Some(*start_s), None),
        ActionEvent::Phase { number, span } => {
            ("phase", Some(*number), Some(span.start_s), Some(span.end_s))
        }
        ActionEvent::Done { span, .. } => ("done", None, Some(span.start_s), Some(span.end_s)),
        ActionEvent::BrokenOff { number } => ("broken_off", Some(*number), None, None),
    };
    RecognitionEvent {
        kind,
        at_s,
        action: model.action.clone(),
        side: model.side,
        model: model.name.clone(),
        person: 0,
        phase,
        phases: model.phases.len(),
        start_s,
        end_s,
    }
}

/// An action that a model has seen whole.
pub(super) fn recognised(
    model: &ActionModel,
    at_s: f64,
    span: Span,
    phases: &[(usize, Span)],
) -> RecognisedAction {
    let times = |(index, span): &(usize, Span)| PhaseTimes {
        name: model.phases[*index].name.clone(),
        start_s: span.start_s,
        end_s: span.end_s,
    };
    RecognisedAction {
        action: model.action.clone(),
        side: model.side,
        model: model.name.clone(),
        start_s: span.start_s,
        end_s: span.end_s,
        recognised_at_s: at_s,
        person: 0,
        phases: phases.iter().map(times).collect(),
    }
}
