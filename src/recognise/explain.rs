//! Why a model did not fire: how far each attempt came, and what was wanting.
//!
//! An attempt begins where a frame fits a phase that the model may begin with, and ends where the machine
//! gives it up. What then was wanting is one of three: the phase it was in was not as far, as fast or as long as it must
//! be when a frame no longer fitted it; it lasted too long; or it was over and no frame fitted the next one in time. Where
//! no frame fitted any first phase, it is the frame that was nearest.

use super::features::FeatureRow;
use super::machine::{ActionEvent, ModelMachine, Span, Underway};
use super::model::{ActionModel, Demand, FeatureRange, ModelPhase, Shortfall};
use super::posture::EquationReading;

/// How an attempt came to its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Stopped {
    /// No frame fitted a phase that the model may begin with.
    NotEntered,
    /// The phase ended before it was what it must be.
    NotEnough,
    /// The phase lasted too long.
    TooLong,
    /// The phase was over, and the next one did not begin within the model's gap.
    NoNext,
}

/// An attempt that came to nothing.
#[derive(Clone, Debug, PartialEq)]
pub struct Attempt {
    /// The first frame of its first phase; where it was not entered the frame that was nearest, s.
    pub start_s: f64,
    /// When what was wanting was wanting: the last frame of the phase, or the frame that was nearest to the next, s.
    pub at_s: f64,
    /// The phase that was not there, the first is 0.
    pub phase: usize,
    /// How it ended.
    pub stopped: Stopped,
    /// What was wanting when the phase ended, or of the frame that was nearest to it.
    pub wanting: Vec<Shortfall>,
    /// What the frame lacked that no longer fitted the phase; empty where a phase was not entered.
    pub ended_by: Vec<Shortfall>,
}

impl Attempt {
    /// How far it came: whole phases, and how little was wanting.
    fn reach(&self) -> (usize, bool, f64) {
        (self.phase, self.stopped != Stopped::NotEntered, -misfit(&self.wanting))
    }
}

/// How much is wanting, to compare frames and attempts with each other: each shortfall as a part of its bound, and one
/// more for being there at all.
fn misfit(wanting: &[Shortfall]) -> f64 {
    let of = |shortfall: &Shortfall| {
        let FeatureRange { from, to } = shortfall.range;
        let bound = if shortfall.value < from { from } else { to };
        let by = shortfall.by().abs();
        // Not shown at all is further off than anything shown.
        if by.is_nan() { 3.0 } else { 1.0 + by / (by + bound.abs().max(0.1)) }
    };
    wanting.iter().map(of).sum()
}

/// What a frame lacks for a phase, and when.
#[derive(Clone, Debug)]
struct Nearest {
    at_s: f64,
    wanting: Vec<Shortfall>,
}

impl Nearest {
    fn take(held: &mut Option<Self>, phase: &ModelPhase, row: &FeatureRow, at_s: f64) {
        let wanting = phase.misfits(row);
        if held.as_ref().is_none_or(|held| misfit(&wanting) < misfit(&held.wanting)) {
            *held = Some(Self { at_s, wanting });
        }
    }
}

/// Follows one model over a stream and keeps the attempt that came furthest. Memory does not grow but by
/// what fired.
#[derive(Clone, Debug)]
pub struct Explainer {
    machine: ModelMachine,
    within: Span,
    entry: Option<Nearest>,
    next: Option<Nearest>,
    fired: Vec<Span>,
    attempts: usize,
    furthest: Option<Attempt>,
}

impl Explainer {
    /// Looks at attempts that have a frame within a span, and at recognitions that do.
    #[must_use]
    pub const fn new(within: Span) -> Self {
        Self {
            machine: ModelMachine::new(EquationReading::Repaired),
            within,
            entry: None,
            next: None,
            fired: Vec::new(),
            attempts: 0,
            furthest: None,
        }
    }

    /// The next frame, at its time, s.
    pub fn next(&mut self, model: &ActionModel, row: &FeatureRow, time_s: f64) {
        let before = self.machine.underway(model);
        let mut done = None;
        self.machine.next(model, row, time_s, &mut |what| {
            if let ActionEvent::Done { span, .. } = what {
                done = Some(span);
            }
        });
        let after = self.machine.underway(model);
        if let Some(before) = &before {
            let next = model.phases.get(before.phase + 1);
            if let Some(next) = next.filter(|_| before.is_over || before.wanting.is_empty()) {
                Nearest::take(&mut self.next, next, row, time_s);
            }
            let goes_on = after.as_ref().is_some_and(|after| after.start_s == before.start_s);
            if let Some(span) = done {
                self.fired(span);
            } else if !goes_on {
                self.given_up(model, before, Some(row), time_s);
            }
            let same = after.as_ref().is_some_and(|after| after.phase == before.phase);
            if !(goes_on && same) {
                self.next = None;
            }
        } else if let Some(span) = done {
            self.fired(span);
        }
        if before.is_none() && after.is_none() && self.covers(time_s, time_s) {
            let first = &model.phases[model.leading];
            Nearest::take(&mut self.entry, first, row, time_s);
        }
    }

    /// The stream is over: what fired, how many attempts did not, and the one of them that came furthest.
    #[must_use]
    pub fn finish(mut self, model: &ActionModel) -> (Vec<Span>, usize, Option<Attempt>) {
        let before = self.machine.underway(model);
        let mut done = None;
        self.machine.finish(model, &mut |what| {
            if let ActionEvent::Done { span, .. } = what {
                done = Some(span);
            }
        });
        if let Some(span) = done {
            self.fired(span);
        } else if let Some(before) = &before {
            self.given_up(model, before, None, before.end_s);
        }
        let entry = self.entry.map(|nearest| Attempt {
            start_s: nearest.at_s,
            at_s: nearest.at_s,
            phase: model.leading,
            stopped: Stopped::NotEntered,
            wanting: nearest.wanting,
            ended_by: Vec::new(),
        });
        (self.fired, self.attempts, self.furthest.or(entry))
    }

    fn covers(&self, start_s: f64, end_s: f64) -> bool {
        start_s <= self.within.end_s && end_s >= self.within.start_s
    }

    fn fired(&mut self, span: Span) {
        if self.covers(span.start_s, span.end_s) {
            self.fired.push(span);
        }
    }

    /// `row`: the frame with which it was; none at the end of the stream.
    fn given_up(
        &mut self,
        model: &ActionModel,
        was: &Underway,
        row: Option<&FeatureRow>,
        time_s: f64,
    ) {
        if !self.covers(was.start_s, time_s) {
            return;
        }
        self.attempts += 1;
        let phase = &model.phases[was.phase];
        let attempt = |phase, stopped, at_s, wanting, ended_by| Attempt {
            start_s: was.start_s,
            at_s,
            phase,
            stopped,
            wanting,
            ended_by,
        };
        let attempt = if self.machine.overlong() == Some(was.phase) {
            let wanting = vec![Shortfall {
                demand: Demand::Duration,
                feature: None,
                value: time_s - was.end_s + phase.longest_s,
                range: FeatureRange { from: phase.shortest_s, to: phase.longest_s },
            }];
            attempt(was.phase, Stopped::TooLong, time_s, wanting, Vec::new())
        } else if let Some(next) = self.next.take().filter(|_| was.wanting.is_empty()) {
            attempt(was.phase + 1, Stopped::NoNext, next.at_s, next.wanting, Vec::new())
        } else {
            let ended_by = row.map_or_else(Vec::new, |row| phase.misfits(row));
            let wanting = was.wanting.clone();
            attempt(was.phase, Stopped::NotEnough, was.end_s, wanting, ended_by)
        };
        if self.furthest.as_ref().is_none_or(|held| attempt.reach() > held.reach()) {
            self.furthest = Some(attempt);
        }
    }
}
