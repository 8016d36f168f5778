//! The actuators of one CAN line: goals out, states in.
//!
//! Most dialects tell their state in answer to a goal. So the goal of one cycle is the question for
//! the state of the next: it goes out at the end of a cycle, and its answer has come long before
//! the next begins. Who did not answer is told its goal once more, or asked if it can be.

use super::axis::Axis;
use crate::bus::can::{CanBus, CanStats, Shape};
use crate::bus::{AskError, Miss};
use crate::device::actuator::{Goal, HostWatch, Order, Question, Told};
use crate::device::{Health, JointState};
use crate::error::counted;
use crate::port::{Clock, FramePort};
use crate::robot::Robot;
use crate::robot::reading::LinePlan;
use crate::time::{Duration, Instant};
use crate::wire::can::{CanFrame, Faults};
use std::sync::Arc;

#[cfg(test)]
mod tests;

/// A state that was asked for longer ago is no state any more.
const OLDEST: Duration = Duration::from_millis(50);
/// Speeds on the way are taken between goals at most this far apart.
const LONGEST_CYCLE: Duration = Duration::from_millis(60);
/// How long another host is listened for before actuators that only answer commands are told to
/// let go, where nobody says how long they hold without one.
const LISTEN: Duration = Duration::from_millis(200);
/// Longest wait for what an actuator tells ten times a second without being asked.
const TELLS_ITSELF: Duration = Duration::from_millis(300);
/// Pause between two questions while something is waited for.
const ASK_AGAIN: Duration = Duration::from_millis(20);

/// A CAN line with its actuators.
pub(super) struct CanLine {
    bus: CanBus,
    clock: Arc<dyn Clock>,
    axes: Vec<Axis>,
    /// When what was heard was last taken in.
    drained_at: Instant,
    /// No other host was heard, so that who only answers commands may be told to let go.
    alone: bool,
}

/// The state of each joint of a line, by its index, or why there is none.
type LineStates = Vec<(usize, Result<JointState, Miss>)>;

/// Speed between two goals that are `apart`, at most `most_rad_s`; none if they lie too far apart in
/// time to tell one.
fn speed(step_rad: f64, apart: Duration, most_rad_s: f64) -> f64 {
    if apart.is_zero() || apart > LONGEST_CYCLE {
        return 0.0;
    }
    (step_rad / apart.as_secs_f64()).clamp(-most_rad_s.abs(), most_rad_s.abs())
}

/// Hands `frame` to whomever it is of; true if it is of anybody.
fn dispatch(axes: &mut [Axis], frame: &CanFrame, now: Instant) -> bool {
    // Damiao devices may share the identifier of their answers, but each knows its own.
    axes.iter_mut().any(|axis| axis.hear(frame, now))
}

impl CanLine {
    pub fn new(
        robot: &Robot,
        line: usize,
        port: Box<dyn FramePort>,
        clock: Arc<dyn Clock>,
        timing: crate::bus::can::CanTiming,
    ) -> Self {
        let on_line = robot.joints.iter().enumerate().filter(|(_, joint)| joint.line == line);
        let axes = on_line
            .filter_map(|(joint, of)| Some(Axis::new(joint, of.actuator()?.clone())))
            .collect();
        let bus = CanBus::new(port, Arc::clone(&clock), timing);
        Self { bus, clock, axes, drained_at: Instant::ZERO, alone: false }
    }

    pub const fn bus(&self) -> &CanBus {
        &self.bus
    }

    pub const fn bus_mut(&mut self) -> &mut CanBus {
        &mut self.bus
    }

    pub fn stats(&self) -> CanStats {
        self.bus.stats()
    }

    fn index(&self, joint: usize) -> Result<usize, AskError> {
        let found = self.axes.iter().position(|axis| axis.joint == joint);
        found.ok_or_else(|| AskError::Unsayable("the joint is not on this line".into()))
    }

    fn axis(&self, joint: usize) -> Result<&Axis, AskError> {
        Ok(&self.axes[self.index(joint)?])
    }

    /// Takes in what was heard up to now.
    fn drain(&mut self) -> Result<(), AskError> {
        let (axes, clock) = (&mut self.axes, &self.clock);
        self.drained_at = clock.now();
        self.bus.drain(&mut |frame| dispatch(axes, frame, clock.now()))
    }

    /// The goal frame of one actuator. Only the guard's command gets here: through
    /// [`CanLine::write_goals`], and again from what that left.
    fn send_goal(&mut self, index: usize, budget: Instant) -> Result<(), AskError> {
        let axis = &mut self.axes[index];
        let Some((goal, _)) = axis.goal else { return Ok(()) };
        let goal = Goal { holds_s: axis.holds_s, ..goal };
        self.bus.send(&axis.actuator.goal_frame(goal), budget)?;
        (axis.asked_at, axis.fed_at) = (self.clock.now(), self.clock.now());
        Ok(())
    }

    /// Line time of all goals, questions and answers of a cycle, s.
    fn exchange_s(&self) -> f64 {
        let shapes = self.axes.iter().flat_map(|axis| axis.actuator.cycle_shapes());
        shapes.map(|shape| self.bus.frame_time_s(shape)).sum()
    }

    /// Line time of the longest question for a slow fact, with its answer, s: there must be room for
    /// one in a cycle.
    fn slow_s(&self) -> f64 {
        let questions = self.axes.iter().flat_map(|axis| axis.actuator.ask_slowly());
        let time = |question: Question| {
            let shape = Shape::of(&question.frame);
            let answer = Shape::classic(shape.extended, 8);
            self.bus.frame_time_s(shape) + self.bus.frame_time_s(answer)
        };
        questions.map(time).fold(0.0, f64::max)
    }

    /// What the line carries in cycles of `period`.
    pub fn plan(&self, name: &str, period: Duration) -> LinePlan {
        let period_s = period.as_secs_f64();
        let unasked = self.axes.iter().flat_map(|axis| axis.actuator.unasked());
        let share: f64 = unasked
            .map(|(shape, rate_hz): (Shape, f64)| self.bus.frame_time_s(shape) * rate_hz)
            .sum();
        let own_s = self.exchange_s() + self.slow_s();
        let answering = self.axes.iter().filter(|axis| axis.actuator.answers_goals()).count();
        let silent = self.axes.len() - answering;
        let mut method = format!("answers to the goals of {}", counted(answering, "actuator"));
        if answering == 0 {
            method = format!("reports of {}", counted(silent, "actuator"));
        } else if silent > 0 {
            method.push_str(&format!(" and reports of {silent}"));
        }
        method.push_str(", frames with the most stuff bits");
        LinePlan::of(name, method, own_s, share, period_s)
    }

    /// Asks for the state of every actuator whose answer has not come by itself. `anew`: what came
    /// before does not count.
    pub fn begin_states(&mut self, anew: bool, budget: Instant) -> Result<(), AskError> {
        // After a pause nobody knows how old what was heard in it is.
        let anew = anew || self.clock.now().since(self.drained_at) > OLDEST;
        self.drain()?;
        if !self.alone && self.axes.iter().any(Axis::is_asked_by_letting_go) {
            self.listen_for_others()?;
        }
        let now = self.clock.now();
        let window = self.bus.answer_time(self.exchange_s());
        for index in 0..self.axes.len() {
            let axis = &mut self.axes[index];
            let since = now.since(axis.asked_at);
            let answers = axis.driven && axis.actuator.answers_goals();
            // Who can only be listened to tells in a time of his own.
            let listened_to = axis.actuator.ask_state().is_none() && !axis.actuator.answers_goals();
            let recent = now.since(axis.heard_at) <= OLDEST && (!answers || since <= OLDEST);
            axis.fresh = !anew && recent && (axis.fresh || listened_to);
            axis.open = None;
            // An answer that is still on its way is waited for.
            if axis.fresh || answers && !anew && since < window {
                continue;
            }
            self.ask_one(index, budget)?;
        }
        Ok(())
    }

    /// Asks one actuator for its state, in the way it can be asked.
    fn ask_one(&mut self, index: usize, budget: Instant) -> Result<(), AskError> {
        let axis = &mut self.axes[index];
        if axis.driven && axis.actuator.answers_goals() {
            return self.send_goal(index, budget);
        }
        axis.open = axis.actuator.ask_state();
        axis.asked_at = self.clock.now();
        match axis.open {
            Some(question) => self.bus.send(&question.frame, budget),
            None if self.alone && axis.is_asked_by_letting_go() => {
                self.order(index, Order::LetGo, budget)
            }
            None => Ok(()),
        }
    }

    fn order(&mut self, index: usize, order: Order, budget: Instant) -> Result<(), AskError> {
        for frame in self.axes[index].actuator.order(order) {
            self.bus.send(&frame, budget)?;
        }
        self.axes[index].asked_at = self.clock.now();
        Ok(())
    }

    /// Waits for the answers, asking again who does not give one; the state of each joint.
    pub fn finish_states(&mut self, budget: Instant) -> Result<LineStates, AskError> {
        let window = self.bus.answer_time(self.exchange_s());
        for attempt in 0..=self.bus.retries() {
            if attempt > 0 {
                let silent: Vec<usize> =
                    (0..self.axes.len()).filter(|&index| !self.axes[index].fresh).collect();
                silent.into_iter().try_for_each(|index| self.ask_one(index, budget))?;
            }
            let asked_at = self.axes.iter().map(|axis| axis.asked_at).max();
            let until = budget.min(asked_at.unwrap_or(Instant::ZERO) + window);
            let (axes, clock) = (&mut self.axes, &self.clock);
            if axes.iter().any(|axis| !axis.fresh) {
                self.bus.listen(until, &mut |frame| {
                    let known = dispatch(axes, frame, clock.now());
                    (known, axes.iter().any(|axis| !axis.fresh))
                })?;
            }
            if self.axes.iter().all(|axis| axis.fresh) || self.clock.now() + window > budget {
                break;
            }
        }
        let states = self.axes.iter_mut().map(|axis| {
            let fresh = std::mem::take(&mut axis.fresh);
            let state = axis.state().filter(|_| fresh);
            (axis.joint, state.ok_or(Miss::Silent))
        });
        Ok(states.collect())
    }

    /// Writes goals, angles of the drives in rad by joint. `most_rad_s` is the fastest each may go.
    pub fn write_goals(
        &mut self,
        goal: impl Fn(usize) -> (f64, f64),
        budget: Instant,
    ) -> Result<(), AskError> {
        // What was heard up to now answers what went before.
        self.drain()?;
        let now = self.clock.now();
        for index in 0..self.axes.len() {
            let axis = &mut self.axes[index];
            let (position_rad, most_rad_s) = goal(axis.joint);
            let velocity_rad_s = axis.goal.map_or(0.0, |(before, at)| {
                speed(position_rad - before.position_rad, now.since(at), most_rad_s)
            });
            axis.goal = Some((Goal { position_rad, velocity_rad_s, holds_s: None }, now));
            // Where a goal is all it takes to drive, it waits until the drive is switched on.
            if axis.driven || !axis.actuator.goal_enables() {
                self.send_goal(index, budget)?;
            }
        }
        Ok(())
    }

    /// Tells the goal once more to every driven actuator that heard nothing for `longest`, or for
    /// a quarter of the silence it is known to allow: it must hear that its host is there. Who is
    /// about to be switched on is asked how it is; no maker says whether it watches meanwhile.
    pub fn break_silence(&mut self, longest: Duration) -> Result<(), AskError> {
        let now = self.clock.now();
        for index in 0..self.axes.len() {
            let axis = &self.axes[index];
            let allowed = match axis.actuator.watch() {
                HostWatch::Said(said_s) => Duration::from_secs_f64((said_s / 4.0).min(60.0)),
                _ => longest,
            };
            let by_setting = matches!(axis.actuator.watch(), HostWatch::Setting { .. });
            let meanwhile = axis.watching && !axis.driven && by_setting;
            let question = axis.actuator.ask_state().filter(|_| meanwhile);
            if let Some(question) = question
                && now.since(axis.asked_at) >= allowed.min(longest)
            {
                self.bus.send(&question.frame, now + longest)?;
                self.axes[index].asked_at = now;
                continue;
            }
            if axis.driven && now.since(axis.fed_at) >= allowed.min(longest) {
                // The speed of a goal is that of the moment it was for.
                if let Some((goal, _)) = &mut self.axes[index].goal {
                    goal.velocity_rad_s = 0.0;
                }
                self.send_goal(index, now + longest)?;
            }
        }
        self.drain()
    }

    /// When the actuator that heard nothing for longest was spoken to.
    pub fn spoken_at(&self) -> Instant {
        self.axes.iter().map(|axis| axis.asked_at).min().unwrap_or(Instant::ZERO)
    }

    /// Asks for a setting and waits for its bits.
    pub fn read(&mut self, joint: usize, number: u16, budget: Instant) -> Result<u32, AskError> {
        let index = self.index(joint)?;
        let no_such = || AskError::Unsayable(format!("its dialect has no setting {number}"));
        let question = self.axes[index].actuator.ask_setting(number).ok_or_else(no_such)?;
        let told = self.ask(index, &question, budget)?;
        told.value.ok_or(AskError::Miss(Miss::Garbled))
    }

    fn ask(
        &mut self,
        index: usize,
        question: &Question,
        budget: Instant,
    ) -> Result<Told, AskError> {
        let actuator = self.axes[index].actuator.clone();
        let (axes, clock) = (&mut self.axes, &self.clock);
        let told = self.bus.ask(
            &question.frame,
            |frame| actuator.answer(question, frame),
            |frame| dispatch(axes, frame, clock.now()),
            budget,
        )?;
        let axis = &mut self.axes[index];
        axis.told = axis.told.then(told);
        Ok(told)
    }

    /// Writes a setting until power-off, and reads it back.
    pub fn write(
        &mut self,
        joint: usize,
        number: u16,
        bits: u32,
        budget: Instant,
    ) -> Result<u32, AskError> {
        let index = self.index(joint)?;
        let no_such = || AskError::Unsayable(format!("setting {number} is not for writing"));
        let frame = self.axes[index].actuator.write_setting(number, bits).ok_or_else(no_such)?;
        self.bus.send(&frame, budget)?;
        // Some answer with what they were told; only what they read is what they kept.
        self.settle()?;
        self.read(joint, number, budget)
    }

    /// Waits until everything that was said is answered: what is heard from then on answers what is
    /// said from then on.
    fn settle(&mut self) -> Result<(), AskError> {
        let until = self.clock.now() + self.bus.answer_time(self.exchange_s());
        let (axes, clock) = (&mut self.axes, &self.clock);
        self.bus.listen(until, &mut |frame| (dispatch(axes, frame, clock.now()), true))
    }

    /// Everything an actuator tells besides where it stands, as far as it has told it.
    pub fn facts(&self, joint: usize) -> Health {
        let Ok(axis) = self.axis(joint) else { return Health::default() };
        let Told { enabled, faults, voltage_v, temperature_c, .. } = axis.told;
        let error_bits = faults.map(Faults::bits);
        Health { torque_on: enabled, error_bits, voltage_v, temperature_c }
    }

    /// Number of questions for what the state does not tell, at least one.
    pub fn slow_parts(&self, joint: usize) -> usize {
        self.axis(joint).map_or(1, |axis| axis.actuator.ask_slowly().len().max(1))
    }

    /// True if one more question is answered by `budget`.
    pub fn fits(&self, budget: Instant) -> bool {
        let question_s = 2.0 * self.bus.frame_time_s(Shape::classic(true, 8));
        self.clock.now() + self.bus.answer_time(question_s) <= budget
    }

    /// The slow facts of an actuator, after asking part `part` of them.
    pub fn health(
        &mut self,
        joint: usize,
        part: usize,
        budget: Instant,
    ) -> Result<Health, AskError> {
        let index = self.index(joint)?;
        let questions = self.axes[index].actuator.ask_slowly();
        if let Some(question) = questions.get(part) {
            self.ask(index, question, budget)?;
        }
        // Who let go without being told to is heard out at once.
        let Axis { driven, told, .. } = &self.axes[index];
        if *driven && told.enabled == Some(false) && told.faults.is_none_or(Faults::is_none) {
            for question in &questions {
                self.ask(index, question, budget)?;
            }
        }
        Ok(self.facts(joint))
    }

    /// A driven joint whose actuator reports a fault, or that it let go.
    pub fn suspect(&self) -> Option<usize> {
        let wrong = |axis: &&Axis| {
            let faulty = axis.told.faults.is_some_and(|faults| !faults.is_none());
            axis.driven && (faulty || axis.told.enabled == Some(false))
        };
        self.axes.iter().find(wrong).map(|axis| axis.joint)
    }

    /// Prepares an actuator for its first goal: forgets that an earlier host fell silent, and sets
    /// how goals are heeded. Nothing moves by it.
    pub fn prepare(&mut self, joint: usize, budget: Instant) -> Result<(), AskError> {
        let index = self.index(joint)?;
        self.axes[index].watching = true;
        let silence = |faults: Faults| faults.any(Faults::SILENCE);
        if self.axes[index].told.faults.is_some_and(silence) {
            self.order(index, Order::ForgetSilence, budget)?;
            // What was told of it is over; what is not will be told again.
            self.axes[index].told.faults = None;
        }
        self.order(index, Order::HeedGoals, budget)
    }

    /// Switches all actuators on, each at its last goal. Nothing is waited for.
    pub fn switch_on(&mut self, budget: Instant) -> Result<(), AskError> {
        self.settle()?;
        for index in 0..self.axes.len() {
            self.order(index, Order::Enable, budget)?;
            let axis = &mut self.axes[index];
            (axis.driven, axis.told.enabled, axis.fresh) = (true, None, false);
            self.send_goal(index, budget)?;
        }
        Ok(())
    }

    /// Tells all actuators to let go, one whatever became of the others. Nothing is waited for.
    pub fn let_go_all(&mut self) -> Result<(), AskError> {
        let budget = self.clock.now() + ASK_AGAIN;
        let told = (0..self.axes.len()).map(|index| self.let_go(index, budget));
        told.fold(Ok(()), Result::and)
    }

    fn let_go(&mut self, index: usize, budget: Instant) -> Result<(), AskError> {
        let axis = &mut self.axes[index];
        (axis.driven, axis.told.enabled, axis.fresh) = (false, None, false);
        axis.watching = false;
        self.order(index, Order::LetGo, budget)
    }

    /// Switches one actuator off and waits for it to say so. An order that is lost is given again.
    pub fn limp(&mut self, joint: usize) -> Result<(), AskError> {
        let index = self.index(joint)?;
        self.settle()?;
        let give_up = self.clock.now() + TELLS_ITSELF;
        while self.clock.now() < give_up {
            self.let_go(index, give_up)?;
            let until = give_up.min(self.clock.now() + ASK_AGAIN);
            if self.confirm(index, false, until)? {
                return Ok(());
            }
        }
        Err(Miss::Silent.into())
    }

    /// True if an actuator says that it drives, or that it does not, as `wanted`. Where its dialect
    /// has no word for it, that it answers counts.
    pub fn torque(&mut self, joint: usize, wanted: bool) -> Result<bool, AskError> {
        let index = self.index(joint)?;
        let give_up = self.clock.now() + TELLS_ITSELF;
        self.confirm(index, wanted, give_up)
    }

    fn confirm(&mut self, index: usize, wanted: bool, give_up: Instant) -> Result<bool, AskError> {
        let agrees = |axis: &Axis| match axis.actuator.tells_enabled() {
            true => axis.told.enabled == Some(wanted),
            false => axis.fresh,
        };
        while !agrees(&self.axes[index]) && self.clock.now() < give_up {
            self.ask_torque(index, give_up)?;
            let until = give_up.min(self.clock.now() + ASK_AGAIN);
            let (axes, clock) = (&mut self.axes, &self.clock);
            self.bus.listen(until, &mut |frame| {
                let known = dispatch(axes, frame, clock.now());
                (known, !agrees(&axes[index]))
            })?;
            // The others must not think that their host is gone.
            self.break_silence(ASK_AGAIN)?;
        }
        Ok(agrees(&self.axes[index]))
    }

    /// Asks for something in answer to which an actuator says whether it drives.
    fn ask_torque(&mut self, index: usize, budget: Instant) -> Result<(), AskError> {
        let axis = &mut self.axes[index];
        if let Some(question) = axis.actuator.ask_enabled() {
            axis.open = Some(question);
            return self.bus.send(&question.frame, budget);
        }
        match (axis.actuator.answers_goals(), axis.driven) {
            (true, true) => self.send_goal(index, budget),
            (true, false) => self.order(index, Order::LetGo, budget),
            // It tells unasked.
            (false, _) => Ok(()),
        }
    }

    /// Sets how long the host of an actuator may be silent, where that can be set, and reads it
    /// back; none restores what was found.
    pub fn watch_host(
        &mut self,
        joint: usize,
        silence: Option<Duration>,
        budget: Instant,
    ) -> Result<(), AskError> {
        let index = self.index(joint)?;
        self.axes[index].watching = silence.is_some();
        match self.axes[index].actuator.watch() {
            HostWatch::InGoals => {
                let axis = &mut self.axes[index];
                axis.holds_s = silence.map(|silence| silence.as_secs_f64());
                // The last goal was good for a moment; now it is good for as long as nobody speaks.
                if axis.driven && silence.is_none() {
                    self.send_goal(index, budget)
                } else {
                    Ok(())
                }
            }
            HostWatch::Setting { number, step_s } => {
                let ours = |silence: Duration| (silence.as_secs_f64() / step_s).round() as u32;
                let bits = match silence {
                    Some(silence) => {
                        let found = self.read(joint, number, budget)?;
                        // Left on by a host that died.
                        let found = if found == ours(silence) { 0 } else { found };
                        self.axes[index].found_watch.get_or_insert(found);
                        ours(silence)
                    }
                    None => match self.axes[index].found_watch.take() {
                        Some(found) => found,
                        None => return Ok(()),
                    },
                };
                let kept = self.write(joint, number, bits, budget)?;
                if kept == bits {
                    return Ok(());
                }
                let text =
                    format!("its timeout (setting {number}) is {kept}, not {bits} as written");
                Err(AskError::Unsayable(text))
            }
            HostWatch::Said(_) | HostWatch::Unsaid | HostWatch::Never => Ok(()),
        }
    }

    /// Listens whether another program speaks to these actuators, for as long as they would hold
    /// without one: who then only answers commands has let go.
    fn listen_for_others(&mut self) -> Result<(), AskError> {
        let said = self.axes.iter().filter_map(|axis| match axis.actuator.watch() {
            HostWatch::Said(said_s) => Some(Duration::from_secs_f64(said_s.clamp(0.0, 60.0))),
            _ => None,
        });
        let until = self.clock.now() + said.max().unwrap_or_default() + LISTEN;
        let (axes, clock) = (&mut self.axes, &self.clock);
        let mut spoken_to = None;
        self.bus.listen(until, &mut |frame| {
            for axis in axes.iter_mut() {
                if axis.hear(frame, clock.now()) && axis.actuator.answers_goals() {
                    spoken_to.get_or_insert(axis.joint);
                }
            }
            (true, spoken_to.is_none())
        })?;
        self.alone = spoken_to.is_none();
        match spoken_to {
            None => Ok(()),
            Some(_) => {
                let text = "another program speaks to the actuators of this line".to_owned();
                Err(AskError::Unsayable(text))
            }
        }
    }
}
