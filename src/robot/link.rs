//! A robot with its lines open: state in, command out, for all joints at once.

mod axis;
mod can;
mod doubt;
mod open_line;
mod orders;
mod serial;

use super::reading::{LinePlan, LineReads, Reading};
use super::{Joint, Robot};
use crate::bus::can::CanStats;
use crate::bus::{AskError, Bus, Miss, Protocol};
use crate::device::{Health, JointState};
use crate::guard::Command;
use crate::port::{BytePort, Clock, FramePort};
use crate::time::{Duration, Instant};
use crate::wire::can::Faults;
use can::CanLine;
use gaitway_profiles::Role;
use open_line::OpenLine;
use serial::groups;
use std::fmt;
use std::sync::Arc;

/// Joints on one line whose servos are written by one instruction.
#[derive(Clone, Debug)]
struct Group {
    line: usize,
    protocol: Protocol,
    address: u16,
    length: u16,
    joints: Vec<usize>,
}

/// A line that failed, and where.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LinkError {
    /// Index of the line in [`Robot::lines`].
    pub line: usize,
    /// Joint or line.
    pub place: String,
    /// What the bus said.
    pub error: AskError,
}

impl fmt::Display for LinkError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.place, self.error)
    }
}

impl std::error::Error for LinkError {}

/// What one read of all joints gave: the state of each, or why there is none.
pub type States = Vec<Result<(JointState, bool), Miss>>;

/// The host's end of a line, serial or CAN.
pub enum LinePort {
    /// A serial line.
    Bytes(Box<dyn BytePort>),
    /// A CAN line.
    Frames(Box<dyn FramePort>),
}

impl From<Box<dyn BytePort>> for LinePort {
    fn from(port: Box<dyn BytePort>) -> Self {
        Self::Bytes(port)
    }
}

impl From<Box<dyn FramePort>> for LinePort {
    fn from(port: Box<dyn FramePort>) -> Self {
        Self::Frames(port)
    }
}

/// A robot whose lines are open.
pub struct Link {
    robot: Robot,
    lines: Vec<OpenLine>,
    clock: Arc<dyn Clock>,
    reads: Vec<LineReads>,
    /// Number of the cycle, which decides what is read in it.
    turn: usize,
    writes: Vec<Group>,
    missed_in_a_row: Vec<u32>,
    /// Lines that failed in the middle of a motion; nothing is said on them any more.
    lost: Vec<bool>,
    /// Joints that are told no goal any more.
    muted: Vec<bool>,
    /// Lines whose joints are told no goal for now.
    held_back: Vec<bool>,
    /// Joints that are told no goal for now.
    waiting: Vec<bool>,
    /// Joints that are told no goal while they are silent.
    silent: Vec<bool>,
    /// What each joint's speed register was set to when it was armed.
    armed_speed: Vec<Option<i64>>,
    payload: Vec<u8>,
}

impl Link {
    /// A link over `ports`, one per line of the robot in its order and of its kind, with the worst
    /// time each line's adapter holds back what it received. A joint whose line has a port of the
    /// other kind is never asked, and so never passes preflight.
    #[must_use]
    pub fn new<P: Into<LinePort>>(
        robot: Robot,
        ports: Vec<(P, Duration)>,
        clock: Arc<dyn Clock>,
    ) -> Self {
        let open = |(line, (port, latency)): (usize, (P, Duration))| {
            OpenLine::new(&robot, line, port.into(), &clock, latency)
        };
        let count = robot.lines.len();
        let lines = ports.into_iter().take(count).enumerate().map(open).collect();
        let writes = groups(&robot, |joint| {
            let goal = joint.register(Role::GoalPosition);
            goal.map(|goal| (goal.address, u16::from(goal.bytes)))
        });
        let missed_in_a_row = vec![0; robot.joints.len()];
        let (lines_count, joints_count) = (robot.lines.len(), robot.joints.len());
        let mut link = Self {
            robot,
            lines,
            clock,
            reads: Vec::new(),
            turn: 0,
            writes,
            missed_in_a_row,
            lost: vec![false; lines_count],
            muted: vec![false; joints_count],
            held_back: vec![false; lines_count],
            waiting: vec![false; joints_count],
            silent: vec![false; joints_count],
            armed_speed: vec![None; joints_count],
            payload: Vec::new(),
        };
        link.plan_reads(&[], Duration::from_secs(1));
        link
    }

    /// Chooses how every line is read in cycles of `period`, knowing the `firmware` of each joint's
    /// servo; what came of it, line by line.
    pub fn plan_reads(&mut self, firmware: &[u16], period: Duration) -> Vec<LinePlan> {
        let plans = self.lines.iter().enumerate();
        let plans = plans.map(|(line, open)| open.plan(&self.robot, line, firmware, period));
        let plans: (Vec<LineReads>, Vec<LinePlan>) = plans.unzip();
        self.reads = plans.0;
        self.turn = 0;
        plans.1
    }

    /// The serial line number `line`.
    fn serial(&mut self, line: usize) -> Result<&mut Bus, AskError> {
        let open = self.lines.get_mut(line).and_then(OpenLine::serial_mut);
        open.ok_or_else(|| AskError::Unsayable("this is no serial line".to_owned()))
    }

    /// The CAN line of `joint`.
    fn can(&mut self, joint: usize) -> Result<&mut CanLine, LinkError> {
        let line = self.robot.joints[joint].line;
        let unsayable = || AskError::Unsayable("the joint hangs on no CAN line".to_owned());
        let open = self.lines.get_mut(line).and_then(OpenLine::can_mut);
        open.ok_or_else(|| joint_error(&self.robot, joint, unsayable()))
    }

    /// The longest that servos on line number `line` wait before they answer.
    pub fn set_return_delay(&mut self, line: usize, return_delay: Duration) {
        if let Ok(bus) = self.serial(line) {
            bus.set_return_delay(return_delay);
        }
    }

    /// The longest that servos wait before they answer, line by line; zero on a CAN line.
    #[must_use]
    pub fn return_delays(&self) -> Vec<Duration> {
        self.lines.iter().map(OpenLine::return_delay).collect()
    }

    /// Time each line was occupied so far, s; of a CAN line with the most stuff bits there can be.
    #[must_use]
    pub fn busy_s(&self) -> Vec<f64> {
        self.lines.iter().map(OpenLine::busy_s).collect()
    }

    /// What happened on line number `line`, if it is a CAN line.
    #[must_use]
    pub fn can_stats(&self, line: usize) -> Option<CanStats> {
        self.lines.get(line)?.can_stats()
    }

    /// What lines reported of themselves, in words for a person.
    #[must_use]
    pub fn troubles(&self) -> Vec<String> {
        let named = self.lines.iter().zip(&self.robot.lines);
        let said = named
            .filter_map(|(open, line)| Some(format!("line {}: {}", line.name, open.troubles()?)));
        said.collect()
    }

    /// True if nothing is said on line number `line` any more.
    #[must_use]
    pub fn is_lost(&self, line: usize) -> bool {
        self.lost.get(line).copied().unwrap_or(true)
    }

    /// The moment up to which something was said on every line.
    #[must_use]
    pub fn spoken_at(&self) -> Instant {
        self.lines.iter().map(OpenLine::spoken_at).min().unwrap_or(Instant::ZERO)
    }

    /// Speaks to whoever heard nothing for `longest`: asks a servo of a serial line whether it is
    /// there, and tells actuators of a CAN line their goal once more. The answer does not matter:
    /// drives with a watchdog must hear that their host is.
    pub(crate) fn break_silence(&mut self, longest: Duration) {
        for (line, open) in self.lines.iter_mut().enumerate() {
            if !self.lost[line] {
                open.break_silence(&self.robot, line, self.clock.now(), longest);
            }
        }
    }

    /// The robot.
    #[must_use]
    pub const fn robot(&self) -> &Robot {
        &self.robot
    }

    /// The clock all lines share.
    #[must_use]
    pub fn clock(&self) -> &Arc<dyn Clock> {
        &self.clock
    }

    /// The adapter of this line lets the host hear its own bytes.
    pub fn set_echo(&mut self, line: usize, echo: bool) {
        if let Ok(bus) = self.serial(line) {
            bus.set_echo(echo);
        }
    }

    /// How late this host was so far in hearing its lines, in all (see [`Bus::host_late`]).
    #[must_use]
    pub fn host_late(&self) -> Duration {
        self.lines.iter().map(OpenLine::host_late).sum()
    }

    /// How often a lost answer is asked for again: once in a cycle, more often when nothing moves
    /// (see [`Bus::set_retries`]).
    pub fn set_retries(&mut self, retries: u32) {
        self.lines.iter_mut().for_each(|line| line.set_retries(retries));
    }

    fn line_error(&self, line: usize, error: AskError) -> LinkError {
        LinkError { line, place: format!("line {}", self.robot.lines[line].name), error }
    }

    fn joint_error(&self, joint: usize, error: AskError) -> LinkError {
        joint_error(&self.robot, joint, error)
    }

    /// What this cycle reads of the joints, in joint terms, with the device's alert flag.
    ///
    /// Joints that were silent before are asked last, so that they cannot silence others.
    ///
    /// # Errors
    /// A line that failed. A joint that does not answer is a [`Miss`] of its own, and so is one
    /// whose turn it is not ([`Miss::NotAsked`]).
    pub fn states(&mut self, budget: Instant) -> Result<States, LinkError> {
        let turn = self.turn;
        self.turn = turn.wrapping_add(1);
        let of_line = |reads: &LineReads| reads.turns[turn % reads.turns.len()].clone();
        let readings = self.reads.iter().map(of_line).collect();
        self.read_all(readings, false, budget)
    }

    /// The state of every joint, however long that takes within `budget`.
    ///
    /// # Errors
    /// As [`Link::states`].
    pub fn whole_states(&mut self, budget: Instant) -> Result<States, LinkError> {
        let readings = self.reads.iter().map(|reads| reads.whole.clone()).collect();
        self.read_all(readings, true, budget)
    }

    /// Carries out the readings of each serial line, and takes the states of each CAN line; `anew`:
    /// those that came by themselves do not count. A line that fails does not keep the others from
    /// being heard to the end.
    fn read_all(
        &mut self,
        readings: Vec<Vec<Reading>>,
        anew: bool,
        budget: Instant,
    ) -> Result<States, LinkError> {
        let mut states: States = vec![Err(Miss::NotAsked); self.robot.joints.len()];
        let begun = self.each_can(|can| can.begin_states(anew, budget));
        let serial = self.read_serial(readings, &mut states, budget);
        let heard = self.each_can(|can| can.finish_states(budget));
        begun.into_iter().collect::<Result<Vec<()>, _>>()?;
        for (joint, state) in
            heard.into_iter().collect::<Result<Vec<_>, _>>()?.into_iter().flatten()
        {
            self.put(joint, state.map(|state| (state, false)), &mut states);
        }
        serial?;
        for (joint, state) in self.robot.joints.iter().zip(&mut states) {
            if self.lost[joint.line] {
                *state = Err(Miss::Silent);
            }
        }
        Ok(states)
    }

    /// Does something on each CAN line that is still there.
    fn each_can<T>(
        &mut self,
        mut each: impl FnMut(&mut CanLine) -> Result<T, AskError>,
    ) -> Vec<Result<T, LinkError>> {
        let mut done = Vec::new();
        for line in 0..self.lines.len() {
            if let Some(can) = self.lines[line].can_mut().filter(|_| !self.lost[line]) {
                let result = each(can);
                done.push(result.map_err(|error| self.line_error(line, error)));
            }
        }
        done
    }

    /// Keeps what a drive said of its joint, or why it said nothing.
    fn put(&mut self, joint: usize, drive: Result<(JointState, bool), Miss>, states: &mut States) {
        let missed = &mut self.missed_in_a_row[joint];
        *missed = if drive.is_err() { *missed + 1 } else { 0 };
        let of = &self.robot.joints[joint];
        states[joint] = drive.map(|(state, alert)| (of.joint_state(state), alert));
    }

    /// When every line may be spoken to again. A CAN line always may: its frames name their device.
    #[must_use]
    pub fn ready_at(&self) -> Instant {
        self.lines.iter().map(OpenLine::ready_at).max().unwrap_or(Instant::ZERO)
    }

    /// Number of reads that make up the slow facts of `joint`.
    #[must_use]
    pub fn health_reads(&self, joint: usize) -> usize {
        let of = &self.robot.joints[joint];
        match (of.servo(), self.lines.get(of.line).and_then(OpenLine::can)) {
            (Some(servo), _) => servo.health.reads().len(),
            (None, Some(can)) => can.slow_parts(joint),
            (None, None) => 1,
        }
    }

    /// True if part `part` of the slow facts of `joint` can be read by `budget`.
    #[must_use]
    pub fn health_fits(&self, joint: usize, part: usize, budget: Instant) -> bool {
        let of = &self.robot.joints[joint];
        self.lines.get(of.line).is_some_and(|line| line.health_fits(of, part, budget))
    }

    /// Part `part` of the slow facts of `joint`.
    ///
    /// # Errors
    /// [`LinkError`].
    pub fn health(
        &mut self,
        joint: usize,
        part: usize,
        budget: Instant,
    ) -> Result<Health, LinkError> {
        let Joint { line, id, .. } = self.robot.joints[joint];
        let Some(servo) = self.robot.joints[joint].servo() else {
            let read = self.can(joint)?.health(joint, part, budget);
            return read.map_err(|e| self.joint_error(joint, e));
        };
        let Some(&(address, length)) = servo.health.reads().get(part) else {
            return Ok(Health::default());
        };
        let protocol = servo.model.protocol();
        let bus = self.serial(line);
        let reply = bus.and_then(|bus| bus.read(protocol, id, address, length, budget));
        let reply = reply.map_err(|e| self.joint_error(joint, e))?;
        let decoded = self.robot.joints[joint]
            .servo()
            .map(|servo| servo.health.decode(part, &reply.bytes))
            .transpose();
        let garbled = |_| self.joint_error(joint, Miss::Garbled.into());
        Ok(decoded.map_err(garbled)?.unwrap_or_default())
    }

    /// A joint whose drive told of a fault together with its state, or that it let go.
    #[must_use]
    pub fn suspect(&self) -> Option<usize> {
        let lines = self.lines.iter().zip(&self.lost).filter(|(_, lost)| !**lost);
        lines.into_iter().find_map(|(line, _)| line.suspect())
    }

    /// The names of the error bits a joint's drive reports.
    #[must_use]
    pub fn error_words(&self, joint: usize, bits: u16) -> String {
        let Some(servo) = self.robot.joints[joint].servo() else {
            return Faults::from_bits(bits).to_string();
        };
        let words: Vec<&str> = servo.model.profile().error_words(bits.into()).collect();
        if words.is_empty() { format!("error bits 0x{bits:02X}") } else { words.join(", ") }
    }

    /// Writes the goal of every joint that is told any, on all lines before any answer is waited
    /// for. The way from outside leads through preflight and arming alone:
    ///
    /// ```compile_fail,E0624
    /// # use gaitway::{guard::Command, robot::Link, time::Instant};
    /// fn drive(link: &mut Link, command: &Command, until: Instant) {
    ///     let _ = link.write_goals(command, until);
    /// }
    /// ```
    ///
    /// # Errors
    /// A line that failed, or a goal that does not fit its register.
    pub(crate) fn write_goals(
        &mut self,
        command: &Command,
        budget: Instant,
    ) -> Result<(), LinkError> {
        self.write_all(Role::GoalPosition, budget, |joint, index| {
            joint.servo_rad(command.goal_rad()[index])
        })?;
        let joints: Vec<(f64, f64)> = self
            .robot
            .joints
            .iter()
            .zip(command.goal_rad())
            .map(|(joint, &goal_rad)| {
                let most_rad_s = joint.servo_speed_rad_s(joint.limits.velocity_rad_s());
                (joint.servo_rad(goal_rad), most_rad_s)
            })
            .collect();
        let written = self.each_can(|can| can.write_goals(|joint| joints[joint], budget));
        written.into_iter().collect()
    }

    /// Switches torque on on every joint; nobody answers.
    pub(crate) fn switch_on(&mut self, budget: Instant) -> Result<(), LinkError> {
        self.write_all(Role::TorqueEnable, budget, |_, _| 1.0)?;
        self.each_can(|can| can.switch_on(budget)).into_iter().collect()
    }

    /// Tells every CAN actuator to let go before anybody is waited for. Whether they did is asked
    /// afterwards ([`Link::limp`]), so what fails here is of no matter.
    pub(crate) fn let_go(&mut self) {
        let _ = self.each_can(CanLine::let_go_all);
    }
}

fn joint_error(robot: &Robot, joint: usize, error: AskError) -> LinkError {
    let Joint { line, id, name, .. } = &robot.joints[joint];
    LinkError { line: *line, place: format!("joint {name} (ID {id})"), error }
}
