//! The state machine of one model: Fig. 3 of the paper, in two readings.
//!
//! Strict is what is printed. Repaired:
//!
//! 1. A phase of one frame has an end: the frame it begins with.
//! 2. The frame that ends a phase is offered to the next phase at once, and the next may begin up to the
//!    model's gap later. Until then the phase that ended may go on. (Printed, exactly one frame is lost between phases.)
//! 3. After a recognition or a reset the same frame is offered to the first phase.
//! 4. What may end when the stream ends is recognised.
//! 5. Leading phases are optional: a machine that is idle enters any of them.
//! 6. A frame is matched by posture and direction; amounts, speeds and means are looked at when the phase ends.
//! 7. A frame that fits the present phase and the next one stays in the present one.
//!
//! Two more are ours. A phase that was begun and came to nothing may begin again while the gap behind the one before it lasts: a
//! twitch is not yet the stroke. And a phase may say that it is over as soon as it may be: then the next one has such a frame, and the last one is the
//! end of the action. Read strictly, it is over when a frame no longer fits it, like all others.
//!
//! A phase may also be interrupted for the model's slack, which is ours and zero by default.

use super::features::FeatureRow;
use super::model::{ActionModel, Demand, FeatureRange, ModelPhase, Shortfall};
use super::posture::EquationReading;

/// Rounding of times, s.
const ROUNDED_S: f64 = 1e-9;

/// A span of time, s: from the first frame that belongs to it to the last, both at their own time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    /// Of its first frame.
    pub start_s: f64,
    /// Of its last frame.
    pub end_s: f64,
}

/// What a machine says of the action it waits for.
#[derive(Clone, Debug, PartialEq)]
pub enum ActionEvent {
    /// It is under way: its first phase has been as large and as fast as it must be.
    Begun {
        /// When it began, s.
        start_s: f64,
    },
    /// Phase k of n is over.
    Phase {
        /// Its place, the first is 1; leading phases count.
        number: usize,
        /// From where to where.
        span: Span,
    },
    /// All of it is over.
    Done {
        /// From the first frame of the first phase to the last of the last.
        span: Span,
        /// Its phases: their places in the model, and from where to where.
        phases: Vec<(usize, Span)>,
    },
    /// It was under way and went on as something else.
    BrokenOff {
        /// The phase in which, the first is 1.
        number: usize,
    },
}

/// A phase under way; what its frames have added up to is in [`Sums`].
#[derive(Clone, Copy, Debug, PartialEq)]
struct Active {
    phase: usize,
    span: Span,
    /// Strictly, a phase has an end only from its second frame on.
    has_end: bool,
    /// Time of its frames, s.
    time_s: f64,
    /// For how long no frame has fitted, s; zero while frames fit.
    out_s: f64,
}

/// Of the phase under way: how far parts have moved, then features times time, for their means.
#[derive(Clone, Debug, Default)]
struct Sums(Vec<f64>);

#[derive(Clone, Copy, Debug, Default, PartialEq)]
enum State {
    #[default]
    Idle,
    In(Active),
    /// The phase is over and may go on, or the next may begin.
    After {
        ended: Active,
        waited_s: f64,
    },
    /// A phase is waited for: strictly one frame only, else what is left of the gap, because it was begun and came to nothing.
    Awaits(usize),
    /// A phase lasted too long; nothing begins while it lasts.
    Overlong(usize),
    /// All is done, as soon as it might be; nothing begins while the last phase lasts.
    Done,
}

/// Where a machine is in its model.
#[derive(Clone, Debug, PartialEq)]
pub struct Underway {
    /// The first frame of the first phase, s.
    pub start_s: f64,
    /// The phase that is under way, or over and followed by none so far; the first is 0.
    pub phase: usize,
    /// It is over.
    pub is_over: bool,
    /// Its last frame so far, s.
    pub end_s: f64,
    /// What is wanting for the phase to end here.
    pub wanting: Vec<Shortfall>,
}

/// The machine of one model for one stream of frames. It holds one phase and the ends of those before:
/// memory does not grow.
#[derive(Clone, Debug)]
pub struct ModelMachine {
    reading: EquationReading,
    state: State,
    sums: Sums,
    done: Vec<(usize, Span)>,
    has_begun: bool,
}

impl ModelMachine {
    /// A machine that has seen nothing.
    #[must_use]
    pub const fn new(reading: EquationReading) -> Self {
        Self {
            reading,
            state: State::Idle,
            sums: Sums(Vec::new()),
            done: Vec::new(),
            has_begun: false,
        }
    }

    /// True while no phase is under way.
    #[must_use]
    pub const fn is_idle(&self) -> bool {
        matches!(self.state, State::Idle)
    }

    /// Where it is; none if no phase is under way, or one that lasts too long.
    #[must_use]
    pub fn underway(&self, model: &ActionModel) -> Option<Underway> {
        let (active, is_over) = match &self.state {
            State::In(active) => (active, false),
            State::After { ended, .. } => (ended, true),
            State::Idle | State::Awaits(_) | State::Overlong(_) | State::Done => return None,
        };
        Some(Underway {
            start_s: self.done.first().map_or(active.span.start_s, |(_, span)| span.start_s),
            phase: active.phase,
            is_over,
            end_s: active.span.end_s,
            wanting: self.sums.wanting(active, &model.phases[active.phase]).collect(),
        })
    }

    /// The phase that lasts too long, while it does; the first is 0.
    #[must_use]
    pub const fn overlong(&self) -> Option<usize> {
        match self.state {
            State::Overlong(phase) => Some(phase),
            _ => None,
        }
    }

    /// The next frame, at its time, s. What happens is told to `tell`.
    pub fn next(
        &mut self,
        model: &ActionModel,
        row: &FeatureRow,
        time_s: f64,
        tell: &mut impl FnMut(ActionEvent),
    ) {
        match self.reading {
            EquationReading::Repaired => self.next_repaired(model, row, time_s, tell),
            EquationReading::Strict => self.next_strict(model, row, time_s, tell),
        }
    }

    /// The stream is over.
    pub fn finish(&mut self, model: &ActionModel, tell: &mut impl FnMut(ActionEvent)) {
        if self.reading == EquationReading::Strict {
            return;
        }
        match core::mem::take(&mut self.state) {
            State::In(active)
                if active.phase + 1 == model.phases.len()
                    && self.sums.may_end(&active, &model.phases[active.phase]) =>
            {
                self.recognised(&active, tell);
            }
            State::In(active) => self.reset(active.phase, tell),
            State::After { ended, .. } => self.reset(ended.phase + 1, tell),
            State::Awaits(index) => self.reset(index, tell),
            State::Idle | State::Overlong(_) | State::Done => {}
        }
    }

    /// Fig. 3 as it is printed. Leading phases have no place in it and are left out.
    fn next_strict(
        &mut self,
        model: &ActionModel,
        row: &FeatureRow,
        time_s: f64,
        tell: &mut impl FnMut(ActionEvent),
    ) {
        let (mut active, index) = match core::mem::take(&mut self.state) {
            State::In(active) => {
                let index = active.phase;
                (Some(active), index)
            }
            State::Awaits(index) => (None, index),
            _ => (None, model.leading),
        };
        let phase = &model.phases[index];
        if phase.fits(row) {
            match &mut active {
                Some(active) => active.take(&mut self.sums, phase, row, time_s),
                None => active = Some(Active::new(&mut self.sums, index, phase, row, time_s)),
            }
            self.state = active.map_or(State::Idle, State::In);
            return;
        }
        match active.filter(|active| active.has_end && self.sums.may_end(active, phase)) {
            Some(active) if index + 1 == model.phases.len() => self.recognised(&active, tell),
            Some(active) => {
                self.over(&active, tell);
                self.state = State::Awaits(index + 1);
            }
            None => self.reset(index, tell),
        }
    }

    fn next_repaired(
        &mut self,
        model: &ActionModel,
        row: &FeatureRow,
        time_s: f64,
        tell: &mut impl FnMut(ActionEvent),
    ) {
        match core::mem::take(&mut self.state) {
            State::Idle => self.enter_any(model, row, time_s),
            State::Overlong(index) if model.phases[index].fits(row) => {
                self.state = State::Overlong(index);
            }
            State::Done if model.phases.last().is_some_and(|last| last.fits(row)) => {
                self.state = State::Done;
            }
            State::Overlong(_) | State::Done => self.enter_any(model, row, time_s),
            State::Awaits(index) => self.wait(index, model, row, time_s, tell),
            State::In(active) => self.go_on(active, model, row, time_s, tell),
            State::After { ended, waited_s } => {
                let waited_s = waited_s + row.dt_s;
                if self.enter_next(&ended, model, row, time_s, tell) {
                    return;
                }
                if model.phases[ended.phase].fits(row) {
                    // It was only interrupted.
                    self.go_on(ended, model, row, time_s, tell);
                } else if waited_s <= model.gap_s + ROUNDED_S {
                    self.state = State::After { ended, waited_s };
                } else {
                    self.reset(ended.phase + 1, tell);
                    self.enter_any(model, row, time_s);
                }
            }
        }
        // A phase of one frame may be enough.
        self.say_begun(model, tell);
        self.end_soon(model, tell);
    }

    /// Says that all is done where the last phase need not be waited out.
    fn end_soon(&mut self, model: &ActionModel, tell: &mut impl FnMut(ActionEvent)) {
        let State::In(active) = self.state else { return };
        let phase = &model.phases[active.phase];
        if phase.ends_soon
            && active.phase + 1 == model.phases.len()
            && active.out_s == 0.0
            && self.sums.may_end(&active, phase)
        {
            self.recognised(&active, tell);
            self.state = State::Done;
        }
    }

    /// A frame in a phase that is under way.
    fn go_on(
        &mut self,
        mut active: Active,
        model: &ActionModel,
        row: &FeatureRow,
        time_s: f64,
        tell: &mut impl FnMut(ActionEvent),
    ) {
        let phase = &model.phases[active.phase];
        let is_last = active.phase + 1 == model.phases.len();
        if phase.ends_soon
            && !is_last
            && active.out_s == 0.0
            && self.sums.may_end(&active, phase)
            && self.enter_next(&active, model, row, time_s, tell)
        {
            return;
        }
        if phase.fits(row) {
            active.take(&mut self.sums, phase, row, time_s);
            if active.time_s > phase.longest_s + ROUNDED_S {
                let index = active.phase;
                self.reset(index, tell);
                self.state = State::Overlong(index);
                return;
            }
            self.state = State::In(active);
            return;
        }
        if active.out_s == 0.0 && !is_last && self.sums.may_end(&active, phase) {
            if !self.enter_next(&active, model, row, time_s, tell) {
                let waited_s = row.dt_s;
                if waited_s <= model.gap_s + ROUNDED_S {
                    self.state = State::After { ended: active, waited_s };
                } else {
                    self.reset(active.phase + 1, tell);
                    self.enter_any(model, row, time_s);
                }
            }
            return;
        }
        active.out_s += row.dt_s;
        if active.out_s <= model.slack_s + ROUNDED_S {
            self.state = State::In(active);
            return;
        }
        if is_last && self.sums.may_end(&active, phase) {
            self.recognised(&active, tell);
            self.enter_any(model, row, time_s);
        } else {
            self.wait(active.phase, model, row, time_s, tell);
        }
    }

    /// A frame while a phase is waited for that was begun and came to nothing: it may begin again within the gap.
    fn wait(
        &mut self,
        index: usize,
        model: &ActionModel,
        row: &FeatureRow,
        time_s: f64,
        tell: &mut impl FnMut(ActionEvent),
    ) {
        let ended_s = self.done.last().map_or(f64::NEG_INFINITY, |(_, span)| span.end_s);
        let waited_s = time_s - ended_s;
        let phase = &model.phases[index];
        // The frame that follows the gap is still in time.
        if waited_s - row.dt_s <= model.gap_s + ROUNDED_S && phase.fits(row) {
            self.state = State::In(Active::new(&mut self.sums, index, phase, row, time_s));
        } else if waited_s <= model.gap_s + ROUNDED_S {
            self.state = State::Awaits(index);
        } else {
            self.reset(index, tell);
            self.enter_any(model, row, time_s);
        }
    }

    /// Enters the first phase that fits of those a model may begin with.
    fn enter_any(&mut self, model: &ActionModel, row: &FeatureRow, time_s: f64) {
        self.state = State::Idle;
        let mut first = model.phases.iter().enumerate().take(model.leading + 1);
        if let Some((index, phase)) = first.find(|(_, phase)| phase.fits(row)) {
            self.state = State::In(Active::new(&mut self.sums, index, phase, row, time_s));
        }
    }

    /// Enters the phase after one that is over, if the frame fits it.
    fn enter_next(
        &mut self,
        ended: &Active,
        model: &ActionModel,
        row: &FeatureRow,
        time_s: f64,
        tell: &mut impl FnMut(ActionEvent),
    ) -> bool {
        let index = ended.phase + 1;
        let Some(phase) = model.phases.get(index).filter(|phase| phase.fits(row)) else {
            return false;
        };
        self.say_begun_of(ended, tell);
        self.over(ended, tell);
        self.state = State::In(Active::new(&mut self.sums, index, phase, row, time_s));
        true
    }

    /// Says that an action has begun once its first phase may end.
    fn say_begun(&mut self, model: &ActionModel, tell: &mut impl FnMut(ActionEvent)) {
        let State::In(active) = &self.state else { return };
        if self.has_begun
            || active.out_s > 0.0
            || !self.sums.may_end(active, &model.phases[active.phase])
        {
            return;
        }
        self.has_begun = true;
        tell(ActionEvent::Begun { start_s: active.span.start_s });
    }

    fn say_begun_of(&mut self, ended: &Active, tell: &mut impl FnMut(ActionEvent)) {
        if !self.has_begun {
            self.has_begun = true;
            tell(ActionEvent::Begun { start_s: ended.span.start_s });
        }
    }

    fn over(&mut self, ended: &Active, tell: &mut impl FnMut(ActionEvent)) {
        self.done.push((ended.phase, ended.span));
        tell(ActionEvent::Phase { number: ended.phase + 1, span: ended.span });
    }

    fn recognised(&mut self, last: &Active, tell: &mut impl FnMut(ActionEvent)) {
        self.say_begun_of(last, tell);
        self.over(last, tell);
        let phases = core::mem::take(&mut self.done);
        let start_s = phases.first().map_or(last.span.start_s, |(_, span)| span.start_s);
        self.has_begun = false;
        tell(ActionEvent::Done { span: Span { start_s, end_s: last.span.end_s }, phases });
    }

    fn reset(&mut self, phase: usize, tell: &mut impl FnMut(ActionEvent)) {
        self.done.clear();
        self.state = State::Idle;
        if core::mem::take(&mut self.has_begun) {
            tell(ActionEvent::BrokenOff { number: phase + 1 });
        }
    }
}

impl Active {
    fn new(
        sums: &mut Sums,
        index: usize,
        phase: &ModelPhase,
        row: &FeatureRow,
        time_s: f64,
    ) -> Self {
        let span = Span { start_s: time_s, end_s: time_s };
        sums.0.clear();
        sums.0.resize(phase.travels.len() + phase.means.len(), 0.0);
        sums.add(phase, row);
        Self { phase: index, span, has_end: false, time_s: row.dt_s, out_s: 0.0 }
    }

    /// One more frame.
    fn take(&mut self, sums: &mut Sums, phase: &ModelPhase, row: &FeatureRow, time_s: f64) {
        self.span.end_s = time_s;
        self.has_end = true;
        self.out_s = 0.0;
        self.time_s += row.dt_s;
        sums.add(phase, row);
    }
}

impl Sums {
    fn add(&mut self, phase: &ModelPhase, row: &FeatureRow) {
        let travels = phase.travels.iter().map(|travel| travel.feature);
        let features = travels.chain(phase.means.iter().map(|mean| mean.feature));
        for (sum, feature) in self.0.iter_mut().zip(features) {
            *sum += row.value(feature) * row.dt_s;
        }
    }

    /// Whether amounts, speeds, means and duration are what they must be.
    fn may_end(&self, active: &Active, phase: &ModelPhase) -> bool {
        self.wanting(active, phase).next().is_none()
    }

    /// What of them is not.
    fn wanting(&self, active: &Active, phase: &ModelPhase) -> impl Iterator<Item = Shortfall> {
        let time_s = active.time_s;
        let (travelled, summed) = self.0.split_at(phase.travels.len().min(self.0.len()));
        let duration = Shortfall {
            demand: Demand::Duration,
            feature: None,
            value: time_s,
            range: FeatureRange { from: phase.shortest_s, to: phase.longest_s },
        };
        let is_short = time_s < phase.shortest_s - ROUNDED_S;
        let travels = phase.travels.iter().zip(travelled).flat_map(move |(travel, sum)| {
            let (amount, speed) = (sum * travel.sign, sum * travel.sign / time_s);
            let of = |demand, value, range: FeatureRange| Shortfall {
                demand,
                feature: Some(travel.feature),
                value,
                range,
            };
            [of(Demand::Amount, amount, travel.amount), of(Demand::Speed, speed, travel.speed)]
        });
        let means = phase.means.iter().zip(summed).map(move |(mean, sum)| Shortfall {
            demand: Demand::Average,
            feature: Some(mean.feature),
            value: sum / time_s,
            range: mean.range,
        });
        let ends = travels.chain(means).filter(|of| !of.range.holds(of.value));
        is_short.then_some(duration).into_iter().chain(ends)
    }
}

#[cfg(test)]
mod tests;
