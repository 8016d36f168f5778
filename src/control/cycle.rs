//! The cycle: read states, judge, sample the motion at this very moment, keep goals near their
//! joints, let the guard look, write.

use super::arm::Armed;
use super::flight::{Flight, FlightCycle};
use super::health::{Bounds, JointFacts, Stop, StopReason, Watch};
use super::leash::{Heard, Leash};
use super::left::{self, Left};
use super::plausible::Believed;
use super::silence::Silence;
use super::{Sample, Sink, Tally, inject, net};
use crate::bus::{AskError, Miss};
use crate::device::{Health, Inertial};
use crate::error::{Error, listed};
use crate::guard::{Command, Guard};
use crate::motion::{Clock as MotionClock, JointLimits, Setpoint, Trajectory};
use crate::robot::link::States;
use crate::robot::preflight::LINE_SHARE;
use crate::robot::{Link, LinkError, Robot};
use crate::time::{Duration, Instant};
use gaitway_profiles::Role;
use std::sync::Arc;

/// How a motion is streamed.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Time between two cycles.
    pub period: Duration,
    /// Bounds of the watch.
    pub bounds: Bounds,
    /// Longest wait for the joints to come to rest after the last goal.
    pub settle: Duration,
}

impl Settings {
    /// The defaults at `rate_hz`.
    #[must_use]
    pub fn at_rate(rate_hz: f64) -> Self {
        Self {
            period: Duration::from_secs_f64(1.0 / rate_hz),
            bounds: Bounds::default(),
            settle: Duration::from_millis(500),
        }
    }
}

/// Where a run could not keep the rule that every goal lies on a path that comes to rest. Each kind
/// is one of the exceptions that ARCHITECTURE.md names.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
#[serde(rename_all = "kebab-case", tag = "kind")]
pub enum Exception {
    /// No word reaches the joints of a line that is lost.
    LineLost {
        /// Line name.
        line: String,
    },
    /// The guard refused a goal: the joints were left at the one before.
    GuardRefused,
    /// The host stalled: the joints stood at their last goal already and were left there.
    Stalled {
        /// For how long, s.
        gap_s: f64,
    },
    /// The host stalled while goals left: they arrived so much later than they were for.
    SentLate {
        /// By how much, s.
        late_s: f64,
    },
    /// No goal was sent on a line for a while, since its servos had been silent and might be limp.
    HeldBack {
        /// Line name.
        line: String,
    },
    /// No goal was sent to a joint while it was silent, since one might have woken it limp.
    JointHeldBack {
        /// Joint name.
        joint: String,
    },
    /// Nobody answered while the motion was run down.
    BlindRamp {
        /// For how long, s.
        blind_s: f64,
        /// The longest that is allowed, s.
        most_s: f64,
        /// True if the ramp came to its end in that time.
        rested: bool,
    },
    /// A joint was stopped dead at a speed from which its goal could not brake in time.
    GoalHeld {
        /// Joint name.
        joint: String,
    },
    /// A joint was silent for some cycles, or for one of the first two: it may have heard none of
    /// their goals.
    MissedGoals {
        /// Joint name.
        joint: String,
    },
    /// A joint gave no answer to the end: whether it heard its last goals is not known.
    NoAnswer {
        /// Joint name.
        joint: String,
    },
    /// A servo heard nothing for so long that its bus watchdog stopped it: it obeyed no goal since.
    StoppedByWatchdog {
        /// Joint name.
        joint: String,
    },
    /// A servo had let go and was told nothing more.
    Limp {
        /// Joint name.
        joint: String,
    },
    /// The program broke wherever goals are made: the joints were left at the last one.
    GoalsBroke,
}

/// What came of a motion.
#[derive(Clone, Debug)]
pub struct Run {
    /// Absent if the motion reached its end.
    pub stop: Option<StopReason>,
    /// The same as data.
    pub stop_data: Option<Stop>,
    /// Figures over all cycles.
    pub tally: Tally,
    /// Time from the first to the last cycle, s.
    pub duration_s: f64,
    /// Share of the time the busiest line was busy.
    pub bus_load: f64,
    /// Where goals could not be led to rest along the checked path.
    pub exceptions: Vec<Exception>,
    /// The last cycles, at most fifty.
    pub flight: Vec<FlightCycle>,
    /// How the robot was left, as far as it said.
    pub left: Left,
    /// Things a person should know of how the robot was left.
    pub notes: Vec<String>,
}

/// A cycle is late if it begins this share of a period after its time: its goals are stale then.
const LATE_SHARE: f64 = 0.5;
/// Retries of one question inside a cycle.
const RETRIES: u32 = 1;
/// A joint is at rest below this speed, rad/s.
const REST_RAD_S: f64 = 0.05;
/// Goals written after the motion ended, so that the last two are equal on every joint.
const LAST_GOALS: u32 = 2;

/// Goals that begin a motion: the first two are equal.
const FIRST_GOALS: u32 = 2;

/// Cycles without any answer after which nobody is waited for any more.
const QUIET_CYCLES: u32 = 5;
/// Times that making goals may break before no more are made.
const MOST_BROKEN_GOALS: u32 = 3;

/// So little do velocity and acceleration differ where a motion goes on at its beginning: a spline forgets what is far
/// before, to rounding.
const SEAM_RAD_S: f64 = 1e-6;
/// The same of acceleration, rad/s².
const SEAM_RAD_S2: f64 = 1e-3;

/// Far below a count of any encoder, far above what arithmetic loses.
const ROUNDING_RAD: f64 = 1e-9;

/// Where goals come from, cycle by cycle. Starts and ends at rest.
pub trait Motion {
    /// Lets `dt_s` pass until `now` and says where the joints shall be then; true once they are at
    /// rest for good.
    fn advance(&mut self, dt_s: f64, now: Instant, setpoints: &mut [Setpoint]) -> bool;

    /// Begins to come to rest. Another stop changes nothing.
    fn stop(&mut self);

    /// True if it wants to know in every cycle what the base feels.
    fn feels(&self) -> bool {
        false
    }

    /// What the base felt in this cycle, or that its sensor did not answer; a reason to stop, if that is one.
    fn feel(&mut self, felt: Option<&Inertial>) -> Option<StopReason> {
        let _ = felt;
        None
    }

    /// How long it takes at most, s, beyond the way to rest that the joints' limits make.
    fn longest_way_back_s(&self) -> f64 {
        0.0
    }
}

/// A motion that is known to its end.
#[derive(Debug)]
pub struct Planned<'a> {
    trajectory: &'a Trajectory,
    clock: MotionClock,
    /// From its second time on, the trajectory goes on at its first one, s.
    again: Option<(f64, f64)>,
}

impl<'a> Planned<'a> {
    /// `trajectory` from its start, to be stopped within what the robot's joints can do.
    ///
    /// # Errors
    /// A trajectory of other joints than the robot's, or of the same in another order.
    pub fn new(trajectory: &'a Trajectory, robot: &Robot) -> Result<Self, Error> {
        let joints = robot.joint_names();
        if trajectory.joints() != joints {
            return Err(Error::new("the trajectory is not of this robot's joints")
                .at(format!("robot {}", robot.name))
                .got(trajectory.joints().join(", "))
                .allowed(format!("in this order: {}", joints.join(", "))));
        }
        Ok(Self { trajectory, clock: MotionClock::new(&robot.limits()), again: None })
    }

    /// The same without end: whenever it comes to `to_s` it goes on at `from_s`, where every joint is as it is at `to_s`.
    ///
    /// # Errors
    /// Times that do not follow one another within the trajectory, or between which a joint would jump.
    pub fn again(self, from_s: f64, to_s: f64) -> Result<Self, Error> {
        let joints = self.trajectory.joints();
        let (mut from, mut to) =
            (vec![Setpoint::default(); joints.len()], vec![Setpoint::default(); joints.len()]);
        self.trajectory.sample(from_s, &mut from);
        self.trajectory.sample(to_s, &mut to);
        if !(0.0 <= from_s && from_s < to_s && to_s <= self.trajectory.duration_s()) {
            return Err(Error::new("a motion cannot be played again between these times")
                .got(format!("{from_s} to {to_s} s"))
                .allowed(format!(
                    "one after the other in 0 to {} s",
                    self.trajectory.duration_s()
                )));
        }
        let differs = |(one, two): (&Setpoint, &Setpoint)| {
            let position = (one.position_rad - two.position_rad).abs() > ROUNDING_RAD;
            let velocity = (one.velocity_rad_s - two.velocity_rad_s).abs() > SEAM_RAD_S;
            let gained = (one.acceleration_rad_s2 - two.acceleration_rad_s2).abs();
            position || velocity || gained > SEAM_RAD_S2
        };
        if let Some(joint) = from.iter().zip(&to).position(differs) {
            return Err(Error::new("the end of the motion does not join its beginning")
                .at(format!("joint {}", joints[joint]))
                .got(format!("{:?} after {:?}", from[joint], to[joint]))
                .allowed("the same position, velocity and acceleration"));
        }
        Ok(Self { again: Some((from_s, to_s)), ..self })
    }
}

impl Motion for Planned<'_> {
    fn advance(&mut self, dt_s: f64, _now: Instant, setpoints: &mut [Setpoint]) -> bool {
        let motion_s = self.clock.advance(dt_s);
        let along_s = match self.again {
            Some((from_s, to_s)) if motion_s >= to_s => {
                from_s + (motion_s - from_s).rem_euclid(to_s - from_s)
            }
            _ => motion_s,
        };
        self.trajectory.sample(along_s, setpoints);
        self.clock.apply_rate(setpoints);
        self.clock.is_stopped() || along_s >= self.trajectory.duration_s()
    }

    fn stop(&mut self) {
        self.clock.stop();
    }
}

/// The longest a stop takes, s: the ramp, and two cycles.
#[must_use]
pub fn longest_stop_s(limits: &[JointLimits], period: Duration) -> f64 {
    let ratio = |limits: &JointLimits| limits.velocity_rad_s() / limits.acceleration_rad_s2();
    1.6 * limits.iter().map(ratio).fold(0.0, f64::max) + 2.0 * period.as_secs_f64()
}

/// The loop's memory between two cycles.
struct Player<'a> {
    link: &'a mut Link,
    guard: Guard,
    command: Command,
    motion: &'a mut dyn Motion,
    setpoints: Vec<Setpoint>,
    goal_velocity_rad_s: Vec<f64>,
    /// Where the motion wanted each joint when the goal in effect was written.
    wanted_rad: Vec<f64>,
    leash: Leash,
    /// When a goal was last written; none yet: the motion's clock starts with the first.
    written_at: Option<Instant>,
    /// True if this cycle got as far as its goals.
    wrote: bool,
    stop: Option<StopReason>,
    /// When the stop began, and in which cycle.
    stopped: Option<(Instant, u64)>,
    frozen: bool,
    /// A goal to stay where the joints stand was told in a cycle.
    stood: bool,
    goals_at_rest: u32,
    rest_since: Option<Instant>,
    believed: Believed,
    /// Joints that were slow when their speed was last read.
    resting: Vec<bool>,
    silence: Silence,
    /// Joints that answered after a silence and have not said yet that they are as they were armed.
    owing: Vec<usize>,
    /// For how many cycles in a row there were any.
    owing_cycles: u32,
    /// Since when nobody answers.
    quiet_since: Option<Instant>,
    /// The longest the motion may be run down unanswered, s.
    longest_stop_s: f64,
    exceptions: Vec<Exception>,
    flight: Flight,
    /// What the loop said when it broke first.
    broke: Option<String>,
    /// How often it broke where goals are made.
    broken_goals: u32,
    /// True while the sink looks at a cycle; still true if it broke.
    in_sink: bool,
    /// True once no line is left to speak on.
    deserted: bool,
}

/// Streams `trajectory` until it is at rest, handing each cycle to `sink`.
///
/// `asked_to_stop` is looked at once per cycle. The robot must have been armed just now: the motion
/// starts where it stands.
///
/// # Errors
/// As [`Planned::new`].
pub fn run(
    link: &mut Link,
    armed: Armed,
    trajectory: &Trajectory,
    settings: Settings,
    sink: &mut dyn Sink,
    asked_to_stop: &dyn Fn() -> bool,
) -> Result<Run, Error> {
    let mut motion = Planned::new(trajectory, link.robot())?;
    Ok(stream(link, armed, &mut motion, settings, sink, asked_to_stop))
}

/// Streams whatever motion there is until it is at rest; the rest as [`run`].
///
/// A panic, of the sink, the motion or the loop itself, is a reason to stop like any other: what is
/// left of the motion is run down along its path.
pub fn stream(
    link: &mut Link,
    armed: Armed,
    motion: &mut dyn Motion,
    settings: Settings,
    sink: &mut dyn Sink,
    asked_to_stop: &dyn Fn() -> bool,
) -> Run {
    let mut watch = Watch::new(settings.bounds, joint_facts(link));
    let mut tally = Tally::new(link.robot().joints.len());
    let clock = Arc::clone(link.clock());
    let began = clock.now();
    link.set_retries(RETRIES);
    let busy_before_s = link.busy_s();
    // A pause between arming and the first cycle counts as well: servos watch for their host.
    let mut last_cycle = link.spoken_at();
    let mut player = Player::new(link, armed, motion, began, settings);
    let period_ns = whole_nanos(settings.period).max(1);
    let mut tick: u64 = 0;
    let mut overrun = false;
    loop {
        let due = began + Duration::from_nanos(tick * period_ns);
        clock.sleep_until(due);
        let now = clock.now();
        let behind = now.since(due);
        // A cycle that took more than its time makes the next one late, even if that begins on a
        // tick: those in between were lost.
        let late = overrun || behind.as_secs_f64() > LATE_SHARE * settings.period.as_secs_f64();
        tally.late_cycles += u64::from(late);
        let cycle = tally.cycles;
        let gap = now.since(last_cycle);
        last_cycle = now;
        player.wrote = false;
        let turn = net::catch(|| {
            if let Some(reason) = watch.pace(gap, late) {
                player.late(reason, cycle);
            }
            if asked_to_stop() && player.goals_at_rest < LAST_GOALS {
                player.request_stop(StopReason::Asked, cycle);
            }
            player.cycle(now, settings, &mut watch, &mut tally, sink)
        });
        let more = turn.unwrap_or_else(|words| player.broke(words, cycle, settings));
        if !more {
            break;
        }
        let elapsed = whole_nanos(clock.now().since(began));
        // Ticks that have gone by are skipped, never made up for in a burst.
        let next = (elapsed / period_ns).max(tick) + 1;
        overrun = next > tick + 1;
        tally.missed_cycles += next - tick - 1;
        tick = next;
    }
    let duration_s = clock.now().since(began).as_secs_f64();
    player.finish(tally, duration_s, &busy_before_s, &settings.bounds)
}

fn whole_nanos(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}

impl<'a> Player<'a> {
    /// A motion about to begin at `began`, from the command that armed the robot.
    fn new(
        link: &'a mut Link,
        armed: Armed,
        motion: &'a mut dyn Motion,
        began: Instant,
        settings: Settings,
    ) -> Self {
        let (guard, command) = armed.into_parts();
        let limits = link.robot().limits();
        let lines = link.robot().joints.iter().map(|joint| joint.line).collect();
        let start_rad = command.goal_rad().to_vec();
        let way_back_s = motion.longest_way_back_s();
        let bound_rad = settings.bounds.tracking_rad;
        Self {
            link,
            guard,
            motion,
            setpoints: vec![Setpoint::default(); limits.len()],
            goal_velocity_rad_s: vec![0.0; limits.len()],
            leash: Leash::new(&start_rad, limits.clone(), bound_rad, began),
            written_at: None,
            wrote: false,
            stop: None,
            stopped: None,
            frozen: false,
            stood: false,
            goals_at_rest: 0,
            rest_since: None,
            resting: vec![false; limits.len()],
            silence: Silence::new(lines),
            owing: Vec::new(),
            owing_cycles: 0,
            quiet_since: None,
            longest_stop_s: longest_stop_s(&limits, settings.period) + way_back_s,
            believed: Believed::new(&start_rad, limits, began),
            wanted_rad: start_rad,
            command,
            exceptions: Vec::new(),
            flight: Flight::default(),
            broke: None,
            broken_goals: 0,
            in_sink: false,
            deserted: false,
        }
    }

    /// Starts the deceleration. The first reason counts; a second request changes nothing.
    fn request_stop(&mut self, reason: StopReason, cycle: u64) {
        if self.stop.is_none() {
            self.stop = Some(reason);
            self.stopped = Some((self.link.clock().now(), cycle));
            self.motion.stop();
        }
    }

    /// The cycle began late.
    fn late(&mut self, reason: StopReason, cycle: u64) {
        if let StopReason::Stalled { gap_s } = reason {
            self.freeze(Exception::Stalled { gap_s });
        }
        self.request_stop(reason, cycle);
    }

    /// Leaves the joints where their last goal is: going on from there would be a jump.
    fn freeze(&mut self, exception: Exception) {
        if !self.frozen && self.goals_at_rest < LAST_GOALS {
            self.exceptions.push(exception);
        }
        self.frozen = true;
    }

    /// One cycle; false when the motion is over.
    fn cycle(
        &mut self,
        now: Instant,
        settings: Settings,
        watch: &mut Watch,
        tally: &mut Tally,
        sink: &mut dyn Sink,
    ) -> bool {
        let budget = now + settings.period.mul_f64(LINE_SHARE);
        let cycle = tally.cycles;
        // Who still owes an answer is asked while there is time for it.
        let owing = std::mem::take(&mut self.owing);
        self.ask_who_was_silent(owing, budget, cycle);
        inject::point("read", cycle);
        let (states, health) = match self.read(cycle, now, budget) {
            Ok(read) => read,
            Err(error) => return self.lose(&error, cycle),
        };
        if self.motion.feels() {
            let felt = self.link.inertial(budget);
            if let Some(reason) = self.motion.feel(felt.as_ref().ok()) {
                self.request_stop(reason, cycle);
            }
        }
        let mut doubted = self.who_was_silent(&states, now);
        doubted.retain(|joint| !self.owing.contains(joint));
        self.ask_who_was_silent(doubted, budget, cycle);
        self.keep_goals_from_who_owes_an_answer(cycle);
        let sample = Sample {
            cycle,
            at: now,
            goal_rad: self.command.goal_rad(),
            wanted_rad: &self.wanted_rad,
            goal_velocity_rad_s: &self.goal_velocity_rad_s,
            states: &states,
            health,
        };
        for (slow, state) in self.resting.iter_mut().zip(&states) {
            match state {
                Ok((state, _)) => {
                    *slow = state.velocity_rad_s.map_or(*slow, |speed| speed.abs() < REST_RAD_S);
                }
                Err(Miss::NotAsked) => {}
                Err(_) => *slow = false,
            }
        }
        inject::point("judge", cycle);
        let link = &*self.link;
        let reason = watch.judge(&sample, |joint, bits| link.error_words(joint, bits));
        tally.add(&sample);
        self.flight.take(&sample);
        if !self.in_sink {
            self.in_sink = true;
            inject::point("sink", cycle);
            sink.take(&sample);
            self.in_sink = false;
        }
        if let Some((joint, Health { torque_on: Some(false), .. })) = sample.health {
            self.leave_limp(joint);
        }
        if let Some(reason) = reason {
            self.request_stop(reason, cycle);
        }
        let overdue = self.blind_for_too_long(now) || self.is_overdue(now, settings);
        if self.deserted || self.over(now, settings) || overdue {
            return false;
        }
        match self.write(budget, settings, cycle) {
            Ok(()) => true,
            Err(error) => self.lose(&error, cycle),
        }
    }

    /// A line failed: its joints are left at their last goal and the others led to rest. False if
    /// there are no others.
    fn lose(&mut self, error: &LinkError, cycle: u64) -> bool {
        let joints = self.link.give_up(error.line);
        let line = self.line_name(error.line);
        self.exceptions.push(Exception::LineLost { line: line.clone() });
        let text = error.error.to_string();
        self.request_stop(StopReason::LineLost { line, text, joints }, cycle);
        self.deserted = self.all_lines_lost();
        !self.deserted
    }

    fn line_name(&self, line: usize) -> String {
        self.link.robot().lines.get(line).map_or_else(String::new, |line| line.name.clone())
    }

    fn all_lines_lost(&self) -> bool {
        (0..self.link.robot().lines.len()).all(|line| self.link.is_lost(line))
    }

    /// A servo let go: it is told nothing more, since a goal might wake it.
    fn leave_limp(&mut self, joint: usize) {
        let of = &self.link.robot().joints[joint];
        if of.servo().is_some() && !self.link.is_muted(joint) {
            self.exceptions.push(Exception::Limp { joint: of.name.clone() });
            self.link.mute(joint);
        }
    }

    /// Servos that were silent and answer again.
    fn who_was_silent(&mut self, states: &States, now: Instant) -> Vec<usize> {
        let mut doubted = self.silence.take(states);
        if self.silence.has_recovered() {
            self.goals_at_rest = 0;
        }
        self.quiet_since = match self.silence.quiet_cycles() {
            0 => None,
            _ => self.quiet_since.or(Some(now)),
        };
        doubted.retain(|&joint| {
            // An actuator on a CAN line that let go obeys no goal, and says so by itself.
            let servo = self.link.robot().joints[joint].servo().is_some();
            if !servo {
                self.silence.trust(joint);
            }
            servo
        });
        doubted
    }

    /// Asks servos for their torque, before any further goal. A line whose servos came back limp is
    /// given up; who does not answer now owes the answer.
    fn ask_who_was_silent(&mut self, doubted: Vec<usize>, budget: Instant, cycle: u64) {
        if doubted.is_empty() {
            return;
        }
        let told = self.link.as_armed(&doubted, budget);
        for (joint, as_armed) in doubted.into_iter().zip(told) {
            let line = self.link.robot().joints[joint].line;
            match as_armed {
                _ if self.link.is_lost(line) || self.link.is_muted(joint) => {}
                Some(true) => self.goes_on_after_silence(joint),
                None => self.owing.push(joint),
                Some(false) if self.silence.is_shared(joint) => self.came_back_limp(line, cycle),
                Some(false) => self.one_came_back_limp(joint, cycle),
            }
        }
    }

    /// No goal goes to a line on which somebody owes an answer; who owes it for too long is silent. Nor
    /// to a joint that is silent for so long that it may have restarted, if a goal would wake it.
    fn keep_goals_from_who_owes_an_answer(&mut self, cycle: u64) {
        self.owing.retain(|&joint| !self.link.is_lost(self.link.robot().joints[joint].line));
        for line in 0..self.link.robot().lines.len() {
            let joints = &self.link.robot().joints;
            let of_line = |joint: &&crate::robot::Joint| joint.line == line;
            // A servo that lost its power and hears again before it is asked would be woken.
            let wakes = joints
                .iter()
                .filter(of_line)
                .any(|joint| joint.model().is_ok_and(|model| model.goal_switches_torque_on()));
            let owes = self.owing.iter().any(|&joint| joints[joint].line == line);
            let back = owes || wakes && self.silence.is_line_quiet(line);
            self.link.hold_back(line, back);
            if back && !self.link.is_lost(line) {
                self.except(Exception::HeldBack { line: self.line_name(line) });
            }
        }
        for joint in 0..self.link.robot().joints.len() {
            let of = &self.link.robot().joints[joint];
            let wakes = of.model().is_ok_and(|model| model.goal_switches_torque_on());
            let silent = wakes && self.silence.is_doubted(joint);
            if silent && self.link.is_told(joint) {
                let joint = of.name.clone();
                self.except(Exception::JointHeldBack { joint });
            }
            self.link.keep_goals_from(joint, silent);
        }
        self.owing_cycles = if self.owing.is_empty() { 0 } else { self.owing_cycles + 1 };
        if let (Some(&joint), QUIET_CYCLES..) = (self.owing.first(), self.owing_cycles) {
            let joint = self.link.robot().joints[joint].name.clone();
            let miss = "it does not say whether its torque is on".to_owned();
            let cycles = self.owing_cycles;
            self.request_stop(StopReason::Silent { joint, cycles, miss }, cycle);
        }
    }

    fn goes_on_after_silence(&mut self, joint: usize) {
        if !self.silence.is_shared(joint) {
            self.missed_goals(joint);
        }
        self.silence.trust(joint);
    }

    fn missed_goals(&mut self, joint: usize) {
        let joint = self.link.robot().joints[joint].name.clone();
        self.except(Exception::MissedGoals { joint });
    }

    fn one_came_back_limp(&mut self, joint: usize, cycle: u64) {
        self.leave_limp(joint);
        self.silence.trust(joint);
        let joint = self.link.robot().joints[joint].name.clone();
        let fault = "the servo came back without torque (did it restart?)".to_owned();
        self.request_stop(StopReason::ServoFault { joint, fault }, cycle);
    }

    fn came_back_limp(&mut self, line: usize, cycle: u64) {
        let joints = self.link.give_up(line);
        let line = self.line_name(line);
        self.exceptions.push(Exception::LineLost { line: line.clone() });
        self.request_stop(StopReason::CameBackLimp { line, joints }, cycle);
        self.deserted = self.all_lines_lost();
    }

    /// States of all joints, as far as they can be believed, and the slow facts of one, in turn.
    fn read(
        &mut self,
        cycle: u64,
        now: Instant,
        budget: Instant,
    ) -> Result<(States, Option<(usize, Health)>), LinkError> {
        let mut states = self.link.states(budget)?;
        self.believed.sift(&mut states, now, self.link.clock().now());
        let mut missed_first = Vec::new();
        for (joint, state) in states.iter().enumerate() {
            match state {
                Ok((state, _)) => {
                    let heard = self.leash.heard(joint, state.position_rad, now);
                    self.link.let_wait(joint, heard == Heard::Waits);
                    if heard == Heard::BeginsAgain {
                        self.guard.stands(joint, state.position_rad);
                    }
                }
                Err(Miss::NotAsked) => {}
                Err(Miss::Implausible) => self.leash.doubt(joint),
                Err(_) => {
                    self.leash.missed(joint);
                    if cycle < u64::from(FIRST_GOALS) {
                        missed_first.push(joint);
                    }
                }
            }
        }
        for joint in missed_first {
            self.missed_goals(joint);
        }
        let joints = states.len();
        let turn = usize::try_from(cycle).unwrap_or(0);
        // Parts change faster than joints: the supply, which all share, is seen every few cycles.
        let most_parts = (0..joints).map(|j| self.link.health_reads(j)).max().unwrap_or(1).max(1);
        // Who told of trouble is heard out first.
        let joint = self.link.suspect().unwrap_or(turn / most_parts % joints);
        let part = turn % most_parts;
        let mut health = None;
        // A joint that is silent now would only cost the others their time; so would a question
        // that cannot be answered within this cycle.
        let silent = states[joint].as_ref().is_err_and(|miss| *miss != Miss::NotAsked);
        if !silent && self.link.health_fits(joint, part, budget) {
            match self.link.health(joint, part, budget) {
                Ok(read) => health = Some((joint, read)),
                Err(error) if matches!(error.error, AskError::Port(_)) => return Err(error),
                Err(_) => {}
            }
        }
        Ok((states, health))
    }

    /// True when the last goals are written and the joints have come to rest (or had their time).
    fn over(&mut self, now: Instant, settings: Settings) -> bool {
        if self.goals_at_rest < LAST_GOALS {
            return false;
        }
        let since = *self.rest_since.get_or_insert(now);
        let still = self.link.robot().joints.iter().zip(&self.resting).enumerate();
        let still = still.into_iter().all(|(index, (joint, &slow))| {
            slow || self.link.is_lost(joint.line) || self.link.is_muted(index)
        });
        // Who does not answer cannot be waited for.
        let nobody = self.silence.quiet_cycles() >= QUIET_CYCLES;
        still || nobody || now.since(since) >= settings.settle
    }

    /// Since when the motion is run down without an answer of anybody.
    fn blind_since(&self) -> Option<Instant> {
        Some(self.quiet_since?.max(self.stopped?.0))
    }

    /// True if the motion was run down unanswered for as long as that may take.
    fn blind_for_too_long(&self, now: Instant) -> bool {
        let blind = self.blind_since().map(|since| now.since(since).as_secs_f64());
        blind.is_some_and(|blind_s| blind_s > self.longest_stop_s)
    }

    /// True if a stop takes longer than it can: somebody never lets a last goal be told.
    fn is_overdue(&self, now: Instant, settings: Settings) -> bool {
        let Some((began, _)) = self.stopped else { return false };
        let most_s = 2.0 * self.longest_stop_s + settings.settle.as_secs_f64();
        now.since(began).as_secs_f64() > most_s
    }

    /// Samples the motion at the moment of writing and writes what the guard admits.
    fn write(&mut self, budget: Instant, settings: Settings, cycle: u64) -> Result<(), LinkError> {
        // A motion begins with two equal goals, and has not begun while none can be told: of a servo
        // that does not hear one of them the next is no step.
        let waits = self.written_at.is_none() && (!self.stood || self.link.holds_back());
        // Goals are for the moment they leave, which after a lost answer is a little later.
        let clock = Arc::clone(self.link.clock());
        clock.sleep_until(self.link.ready_at());
        let now = clock.now();
        let since = self.written_at.map_or(Duration::ZERO, |before| now.since(before));
        inject::point("advance", cycle);
        let path_over = self.motion.advance(since.as_secs_f64(), now, &mut self.setpoints);
        self.wanted_rad.clear();
        self.wanted_rad.extend(self.setpoints.iter().map(|setpoint| setpoint.position_rad));
        let stopping = self.stop.is_some();
        let link = &*self.link;
        let is_told = |joint| link.is_told(joint);
        self.leash.advance(since.as_secs_f64(), now, stopping, is_told, &mut self.setpoints);
        if !waits {
            self.written_at = Some(now);
        }
        self.look_for_a_stall(since, settings, cycle);
        inject::point("admit", cycle);
        if !self.frozen {
            self.admit(now, cycle);
        }
        // Goals that a line does not hear now are no last goals.
        let all_told = !self.link.holds_back();
        let over = path_over && !self.leash.holds();
        inject::point("write", cycle);
        self.link.write_goals(&self.command, budget)?;
        self.wrote = true;
        self.stood |= all_told;
        // A goal that was held may go on when its joint is let go: then the last two are to come.
        let at_rest = all_told && (over || self.frozen);
        self.goals_at_rest = if at_rest { self.goals_at_rest + 1 } else { 0 };
        self.look_whether_goals_left_late(now, settings);
        Ok(())
    }

    /// A host that stalled while its goals left: they were for an earlier moment than that in which
    /// they arrived. The motion goes on from there, so that the next ones are no jump.
    fn look_whether_goals_left_late(&mut self, sampled_at: Instant, settings: Settings) {
        let left_at = self.link.clock().now();
        let late = left_at.since(sampled_at);
        if late.as_secs_f64() > LATE_SHARE * settings.period.as_secs_f64() {
            self.written_at = Some(left_at);
            self.exceptions.push(Exception::SentLate { late_s: late.as_secs_f64() });
        }
    }

    /// Looks, as the last thing before goals are admitted, whether the host stood still since the
    /// last ones: longer than is allowed, or so long that a goal would be a jump.
    fn look_for_a_stall(&mut self, since: Duration, settings: Settings, cycle: u64) {
        let forced: Vec<usize> = self.leash.forced().collect();
        let stalled = since > settings.bounds.gap;
        if stalled || !forced.is_empty() && since > 2 * settings.period {
            let gap_s = since.as_secs_f64();
            self.freeze(Exception::Stalled { gap_s });
            self.request_stop(StopReason::Stalled { gap_s }, cycle);
            return;
        }
        for joint in forced {
            let joint = self.link.robot().joints[joint].name.clone();
            self.except(Exception::GoalHeld { joint });
        }
    }

    /// Notes an exception, once.
    fn except(&mut self, exception: Exception) {
        if !self.exceptions.contains(&exception) {
            self.exceptions.push(exception);
        }
    }

    fn admit(&mut self, now: Instant, cycle: u64) {
        let joints = self.setpoints.iter().zip(&self.link.robot().joints);
        let goal_rad: Vec<f64> =
            joints.map(|(s, joint)| unrounded(s.position_rad, &joint.limits)).collect();
        match self.guard.admit(&goal_rad, now) {
            Ok(command) => {
                self.command = command;
                let speeds = self.setpoints.iter().map(|s| s.velocity_rad_s);
                self.goal_velocity_rad_s = speeds.collect();
            }
            Err(refusal) => {
                // The goal before was good: the joints are left there.
                self.freeze(Exception::GuardRefused);
                let joint = self.link.robot().joints[refusal.joint].name.clone();
                let reason = refusal.reason.to_string();
                self.request_stop(StopReason::Refused { joint, reason }, cycle);
            }
        }
    }

    /// The loop broke in this cycle. What is left of the motion is run down without whatever broke;
    /// false when that has come to its end.
    fn broke(&mut self, words: String, cycle: u64, settings: Settings) -> bool {
        self.broke.get_or_insert_with(|| words.clone());
        if net::catch(|| self.request_stop(StopReason::Broke { words }, cycle)).is_err() {
            self.freeze(Exception::GoalsBroke);
        }
        let now = self.link.clock().now();
        if self.goals_at_rest >= LAST_GOALS || self.deserted || self.is_overdue(now, settings) {
            return false;
        }
        if self.wrote {
            return true;
        }
        let budget = now + settings.period.mul_f64(LINE_SHARE);
        match net::catch(|| self.write(budget, settings, cycle)) {
            Ok(Ok(())) => !self.is_overdue(now, settings),
            Ok(Err(error)) => self.lose(&error, cycle),
            Err(_) => {
                // No goals can be made: the servos are left at their last one, told twice.
                self.freeze(Exception::GoalsBroke);
                let told = net::catch(|| self.link.write_goals(&self.command, budget));
                self.goals_at_rest += u32::from(matches!(told, Ok(Ok(()))));
                self.broken_goals += 1;
                self.broken_goals <= MOST_BROKEN_GOALS
            }
        }
    }

    /// Switches watchdogs off and looks how the robot is left.
    fn finish(
        mut self,
        tally: Tally,
        duration_s: f64,
        busy_before_s: &[f64],
        bounds: &Bounds,
    ) -> Run {
        let rested = self.goals_at_rest >= LAST_GOALS;
        let unrested = self.stopped.filter(|_| !rested).map(|(began, _)| began);
        if let Some(since) = self.blind_since().or(unrested).filter(|_| !self.deserted) {
            let blind_s = self.link.clock().now().since(since).as_secs_f64();
            let most_s = self.longest_stop_s;
            self.exceptions.push(Exception::BlindRamp { blind_s, most_s, rested });
        }
        for (joint, of) in self.link.robot().joints.iter().enumerate() {
            if self.silence.is_silent(joint) && !self.link.is_lost(of.line) {
                self.exceptions.push(Exception::NoAnswer { joint: of.name.clone() });
            }
        }
        let bus_load = bus_load(self.link, busy_before_s, duration_s);
        let (left, mut notes) = left::leave(self.link);
        for joint in &left.stopped_by_watchdog {
            self.exceptions.push(Exception::StoppedByWatchdog { joint: joint.clone() });
        }
        notes.extend(self.exceptions.iter().filter_map(Exception::words));
        notes.extend(unanswered(&self.exceptions));
        // It broke after something else had stopped it already.
        if let (Some(words), false) =
            (&self.broke, matches!(self.stop, Some(StopReason::Broke { .. })))
        {
            notes.push(StopReason::Broke { words: words.clone() }.to_string());
        }
        notes.extend(self.link.troubles());
        let stop_data = self.stop.as_ref().map(|stop| {
            let mut data = stop.as_data(bounds, self.stopped.map(|(_, cycle)| cycle));
            if let Some(joint) = &data.joint {
                data.line = self.link.robot().line_of(joint);
            }
            data
        });
        Run {
            stop: self.stop,
            stop_data,
            tally,
            duration_s,
            bus_load,
            exceptions: self.exceptions,
            flight: self.flight.into_cycles(),
            left,
            notes,
        }
    }
}

/// Joints that gave no answer to the end, in words: of a line that is silent it is all of them.
fn unanswered(exceptions: &[Exception]) -> Option<String> {
    let joints = exceptions.iter().filter_map(|exception| match exception {
        Exception::NoAnswer { joint } => Some(joint.as_str()),
        _ => None,
    });
    let joints: Vec<&str> = joints.collect();
    (!joints.is_empty()).then(|| {
        format!(
            "no answer to the end from {}: whether the last goals were heard there is not known",
            listed(&joints)
        )
    })
}

impl Exception {
    /// What a person should know of it, unless the reason of the stop says it already.
    fn words(&self) -> Option<String> {
        match self {
            Self::BlindRamp { blind_s, most_s, rested } => {
                let end = match *rested {
                    true => "and the goals came to rest: whether the joints did is not known",
                    false => "and the goals did not come to rest",
                };
                Some(format!(
                    "nobody answered for the last {blind_s:.2} s: the motion was run down blindly \
                     (at most {most_s:.2} s), {end}"
                ))
            }
            Self::GoalHeld { joint } => Some(format!(
                "the goal of joint {joint} was held at once, since the joint stood still"
            )),
            Self::Limp { joint } => {
                Some(format!("joint {joint} had let go and was told nothing more"))
            }
            Self::HeldBack { line } => Some(format!(
                "no goal was sent on line {line} for a while: its servos had been silent, and a \
                 goal might have woken one that was limp"
            )),
            Self::JointHeldBack { joint } => Some(format!(
                "no goal was sent to joint {joint} while it was silent: a goal might have woken it limp"
            )),
            Self::MissedGoals { joint } => Some(format!(
                "joint {joint} was silent for a while: it may have missed goals, and went on to the next \
                 that it heard"
            )),
            Self::SentLate { late_s } => Some(format!(
                "goals left {:.0} ms late: the host stalled as they were sent",
                late_s * 1e3
            )),
            Self::GoalsBroke => {
                Some("no goals could be made any more: the joints stand at the last one".to_owned())
            }
            Self::LineLost { .. }
            | Self::GuardRefused
            | Self::NoAnswer { .. }
            | Self::Stalled { .. }
            | Self::StoppedByWatchdog { .. } => None,
        }
    }
}

/// A position that rounding alone carried past a limit, at the limit. (A trajectory keeps its
/// limits; evaluating its spline may be off in the last digits.)
fn unrounded(position_rad: f64, limits: &JointLimits) -> f64 {
    let held = position_rad.clamp(limits.lower_rad(), limits.upper_rad());
    if (held - position_rad).abs() <= ROUNDING_RAD { held } else { position_rad }
}

fn joint_facts(link: &Link) -> Vec<JointFacts> {
    let facts = |joint: &crate::robot::Joint| JointFacts {
        name: joint.name.clone(),
        temperature_limit_c: joint.configured(Role::TemperatureLimit),
        min_voltage_v: joint.configured(Role::MinVoltageLimit),
    };
    link.robot().joints.iter().map(facts).collect()
}

/// Share of the time the busiest line was busy since it had been for `before`.
fn bus_load(link: &Link, before: &[f64], duration_s: f64) -> f64 {
    let busy = link.busy_s().into_iter().zip(before);
    busy.map(|(now_s, before_s)| (now_s - before_s) / duration_s).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests;
