//! The cycle: read states, judge, sample the motion at this very moment, let the guard look, write.

use super::health::{Bounds, JointFacts, StopReason, Watch};
use super::plausible::Believed;
use super::{Sample, Sink, Tally, watchdog};
use crate::bus::{AskError, Miss};
use crate::device::Health;
use crate::guard::{Command, Guard};
use crate::motion::{Clock as MotionClock, JointLimits, Setpoint, Trajectory};
use crate::robot::link::States;
use crate::robot::preflight::LINE_SHARE;
use crate::robot::{Link, LinkError};
use crate::time::{Duration, Instant};
use gaitway_profiles::Role;

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

/// What came of a motion.
#[derive(Clone, Debug)]
pub struct Run {
    /// Absent if the motion reached its end.
    pub stop: Option<StopReason>,
    /// Figures over all cycles.
    pub tally: Tally,
    /// Time from the first to the last cycle, s.
    pub duration_s: f64,
    /// Share of the time the busiest line was busy.
    pub bus_load: f64,
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

/// Far below a count of any encoder, far above what arithmetic loses.
const ROUNDING_RAD: f64 = 1e-9;

/// Where goals come from, cycle by cycle. Starts and ends at rest.
pub trait Motion {
    /// Lets `dt_s` pass until `now` and says where the joints shall be then; true once they are at
    /// rest for good.
    fn advance(&mut self, dt_s: f64, now: Instant, setpoints: &mut [Setpoint]) -> bool;

    /// Begins to come to rest. Another stop changes nothing.
    fn stop(&mut self);
}

/// A motion that is known to its end.
struct Planned<'a> {
    trajectory: &'a Trajectory,
    clock: MotionClock,
}

impl Motion for Planned<'_> {
    fn advance(&mut self, dt_s: f64, _now: Instant, setpoints: &mut [Setpoint]) -> bool {
        let motion_s = self.clock.advance(dt_s);
        self.trajectory.sample(motion_s, setpoints);
        self.clock.apply_rate(setpoints);
        self.clock.is_stopped() || motion_s >= self.trajectory.duration_s()
    }

    fn stop(&mut self) {
        self.clock.stop();
    }
}

/// The loop's memory between two cycles.
struct Player<'a> {
    link: &'a mut Link,
    guard: Guard,
    command: Command,
    motion: &'a mut dyn Motion,
    setpoints: Vec<Setpoint>,
    goal_velocity_rad_s: Vec<f64>,
    /// When a goal was last written; none yet: the motion's clock starts with the first.
    written_at: Option<Instant>,
    stop: Option<StopReason>,
    frozen: bool,
    goals_at_rest: u32,
    rest_since: Option<Instant>,
    believed: Believed,
    /// Joints that were slow when their speed was last read.
    resting: Vec<bool>,
    /// True once nobody on any line answers.
    deserted: bool,
}

/// Streams `trajectory` until it is at rest, handing each cycle to `sink`.
///
/// `asked_to_stop` is looked at once per cycle. The guard must be the one that armed the robot:
/// the motion starts where it stands.
pub fn run(
    link: &mut Link,
    armed: (Guard, Command),
    trajectory: &Trajectory,
    settings: Settings,
    sink: &mut dyn Sink,
    asked_to_stop: &dyn Fn() -> bool,
) -> Run {
    let clock = MotionClock::new(&link.robot().limits());
    stream(link, armed, &mut Planned { trajectory, clock }, settings, sink, asked_to_stop)
}

/// Streams whatever motion there is until it is at rest; the rest as [`run`].
pub fn stream(
    link: &mut Link,
    (guard, command): (Guard, Command),
    motion: &mut dyn Motion,
    settings: Settings,
    sink: &mut dyn Sink,
    asked_to_stop: &dyn Fn() -> bool,
) -> Run {
    let mut watch = Watch::new(settings.bounds, joint_facts(link));
    let mut tally = Tally::new(link.robot().joints.len());
    let clock = std::sync::Arc::clone(link.clock());
    let began = clock.now();
    link.set_retries(RETRIES);
    let busy_before_s = link.busy_s();
    // A pause between arming and the first cycle counts as well: servos watch for their host.
    let mut last_cycle = link.spoken_at();
    let mut player = Player::new(link, (guard, command), motion, began);
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
        if let Some(reason) = watch.pace(now.since(last_cycle), late) {
            // After a stall the servos stand at the last goal: going on from there would be a jump.
            player.frozen |= matches!(reason, StopReason::Stalled { .. });
            player.request_stop(reason);
        }
        last_cycle = now;
        if asked_to_stop() && player.goals_at_rest < LAST_GOALS {
            player.request_stop(StopReason::Asked);
        }
        let more = player.cycle(now, settings, &mut watch, &mut tally, sink);
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
    let bus_load = bus_load(player.link, &busy_before_s, duration_s);
    // Servos that came back from nowhere are limp and must not be written to.
    let mut notes = if player.deserted { Vec::new() } else { watchdog::release(player.link) };
    notes.extend(player.link.troubles());
    Run { stop: player.stop, tally, duration_s, bus_load, notes }
}

fn whole_nanos(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}

impl<'a> Player<'a> {
    /// A motion about to begin at `began`, from the command that armed the robot.
    fn new(
        link: &'a mut Link,
        (guard, command): (Guard, Command),
        motion: &'a mut dyn Motion,
        began: Instant,
    ) -> Self {
        let limits = link.robot().limits();
        Self {
            link,
            guard,
            motion,
            setpoints: vec![Setpoint::default(); limits.len()],
            goal_velocity_rad_s: vec![0.0; limits.len()],
            written_at: None,
            stop: None,
            frozen: false,
            goals_at_rest: 0,
            rest_since: None,
            resting: vec![false; limits.len()],
            believed: Believed::new(command.goal_rad(), limits, began),
            command,
            deserted: false,
        }
    }

    /// Starts the deceleration. The first reason counts; a second request changes nothing.
    fn request_stop(&mut self, reason: StopReason) {
        if self.stop.is_none() {
            self.stop = Some(reason);
            self.motion.stop();
        }
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
        let (states, health) = match self.read(tally.cycles, now, budget) {
            Ok(read) => read,
            Err(error) => return self.lose(&error),
        };
        let sample = Sample {
            cycle: tally.cycles,
            at: now,
            goal_rad: self.command.goal_rad(),
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
        let link = &*self.link;
        let reason = watch.judge(&sample, |joint, bits| link.error_words(joint, bits));
        tally.add(&sample);
        sink.take(&sample);
        if let Some(reason) = reason {
            self.deserted =
                matches!(reason, StopReason::Silent { .. }) && self.link.nobody_answers();
            self.request_stop(reason);
            if self.deserted {
                // Nobody is there. Servos that come back are limp and must not be sent a goal.
                return false;
            }
        }
        if self.over(now, settings) {
            return false;
        }
        match self.write(budget) {
            Ok(()) => true,
            Err(error) => self.lose(&error),
        }
    }

    /// A line failed: its joints are left at their last goal and the others led to rest. False if
    /// there are no others.
    fn lose(&mut self, error: &LinkError) -> bool {
        let joints = self.link.write_off(error);
        let name = self.link.robot().lines.get(error.line).map_or("", |line| &line.name);
        let text = format!("line {name}: {}", error.error);
        self.request_stop(StopReason::LineLost { text, joints });
        let lines = 0..self.link.robot().lines.len();
        self.deserted = lines.into_iter().all(|line| self.link.is_lost(line));
        !self.deserted
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
        let still = self.link.robot().joints.iter().zip(&self.resting);
        let still = still.into_iter().all(|(joint, &slow)| slow || self.link.is_lost(joint.line));
        still || now.since(since) >= settings.settle
    }

    /// Samples the motion at the moment of writing and writes what the guard admits.
    fn write(&mut self, budget: Instant) -> Result<(), LinkError> {
        // Goals are for the moment they leave, which after a lost answer is a little later.
        let clock = std::sync::Arc::clone(self.link.clock());
        clock.sleep_until(self.link.ready_at());
        let now = clock.now();
        let since = self.written_at.map_or(Duration::ZERO, |before| now.since(before));
        let over = self.motion.advance(since.as_secs_f64(), now, &mut self.setpoints);
        self.written_at = Some(now);
        if !self.frozen {
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
                    self.frozen = true;
                    let joint = self.link.robot().joints[refusal.joint].name.clone();
                    let reason = refusal.reason.to_string();
                    self.request_stop(StopReason::Refused { joint, reason });
                }
            }
        }
        self.goals_at_rest += u32::from(over || self.frozen);
        self.link.write_goals(&self.command, budget)
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
