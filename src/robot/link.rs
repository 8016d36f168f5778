//! A robot with its lines open: state in, command out, for all joints at once.

use super::reading::{LinePlan, LineReads, Method, Reading, plan};
use super::{Joint, Robot};
use crate::bus::{AskError, Bus, GroupItem, Miss, Protocol, Reply, Timing};
use crate::device::{Health, JointState};
use crate::guard::Command;
use crate::port::{BytePort, Clock};
use crate::time::{Duration, Instant};
use gaitway_profiles::{Register, Role};
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

/// A robot whose lines are open.
pub struct Link {
    robot: Robot,
    buses: Vec<Bus>,
    clock: Arc<dyn Clock>,
    reads: Vec<LineReads>,
    /// Number of the cycle, which decides what is read in it.
    turn: usize,
    writes: Vec<Group>,
    missed_in_a_row: Vec<u32>,
    /// Lines that failed in the middle of a motion; nothing is said on them any more.
    lost: Vec<bool>,
    payload: Vec<u8>,
}

impl Link {
    /// A link over `ports`, one per line of the robot in its order, with the worst time each
    /// line's adapter holds bytes back.
    #[must_use]
    pub fn new(
        robot: Robot,
        ports: Vec<(Box<dyn BytePort>, Duration)>,
        clock: Arc<dyn Clock>,
    ) -> Self {
        let buses = ports
            .into_iter()
            .enumerate()
            .zip(&robot.lines)
            .map(|((index, (port, latency)), line)| {
                let timing = Timing {
                    baud_bps: line.baud_bps,
                    return_delay: return_delay(&robot, index),
                    latency,
                };
                Bus::new(port, Arc::clone(&clock), timing)
            })
            .collect();
        let writes = groups(&robot, |joint| {
            let goal = joint.model.register(Role::GoalPosition);
            goal.map_or((0, 0), |goal| (goal.address, u16::from(goal.bytes)))
        });
        let missed_in_a_row = vec![0; robot.joints.len()];
        let lost = vec![false; robot.lines.len()];
        let mut link = Self {
            robot,
            buses,
            clock,
            reads: Vec::new(),
            turn: 0,
            writes,
            missed_in_a_row,
            lost,
            payload: Vec::new(),
        };
        link.plan_reads(&[], Duration::from_secs(1));
        link
    }

    /// Chooses how every line is read in cycles of `period`, knowing the `firmware` of each joint's
    /// servo; what came of it, line by line.
    pub fn plan_reads(&mut self, firmware: &[u16], period: Duration) -> Vec<LinePlan> {
        let lines = self.buses.iter().enumerate();
        let plans = lines.map(|(line, bus)| plan(&self.robot, line, bus, firmware, period));
        let plans: (Vec<LineReads>, Vec<LinePlan>) = plans.unzip();
        self.reads = plans.0;
        self.turn = 0;
        plans.1
    }

    /// The longest that servos on line number `line` wait before they answer.
    pub fn set_return_delay(&mut self, line: usize, return_delay: Duration) {
        if let Some(bus) = self.buses.get_mut(line) {
            bus.set_return_delay(return_delay);
        }
    }

    /// True if nothing is said on line number `line` any more.
    #[must_use]
    pub fn is_lost(&self, line: usize) -> bool {
        self.lost.get(line).copied().unwrap_or(true)
    }

    /// Gives up the line that failed, so that the others go on. Names of the joints on it.
    pub fn write_off(&mut self, failed: &LinkError) -> Vec<String> {
        if let Some(lost) = self.lost.get_mut(failed.line) {
            *lost = true;
        }
        let on_line = self.robot.joints.iter().filter(|joint| joint.line == failed.line);
        on_line.map(|joint| joint.name.clone()).collect()
    }

    /// The moment up to which something was said on every line.
    #[must_use]
    pub fn spoken_at(&self) -> Instant {
        self.buses.iter().map(Bus::spoken_at).min().unwrap_or(Instant::ZERO)
    }

    /// Asks a servo on every line that has been silent for `longest` whether it is there. The
    /// answer does not matter: servos with a watchdog must hear that their host is.
    pub(crate) fn break_silence(&mut self, longest: Duration) {
        for line in 0..self.buses.len() {
            let now = self.clock.now();
            let quiet = now.since(self.buses[line].spoken_at()) >= longest;
            let first = self.robot.joints.iter().find(|joint| joint.line == line);
            if let Some(joint) = first.filter(|_| quiet && !self.lost[line]) {
                let _ = self.buses[line].ping(joint.model.protocol(), joint.id, now + longest);
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

    /// The lines.
    #[must_use]
    pub fn buses(&self) -> &[Bus] {
        &self.buses
    }

    /// The adapter of this line lets the host hear its own bytes.
    pub fn set_echo(&mut self, line: usize, echo: bool) {
        if let Some(bus) = self.buses.get_mut(line) {
            bus.set_echo(echo);
        }
    }

    /// How often a lost answer of one servo is asked for again.
    pub fn set_retries(&mut self, retries: u32) {
        for bus in &mut self.buses {
            bus.set_retries(retries);
        }
    }

    fn line_error(&self, line: usize, error: AskError) -> LinkError {
        LinkError { line, place: format!("line {}", self.robot.lines[line].name), error }
    }

    fn joint_error(&self, joint: usize, error: AskError) -> LinkError {
        let Joint { line, id, name, .. } = &self.robot.joints[joint];
        LinkError { line: *line, place: format!("joint {name} (ID {id})"), error }
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
        self.read_all(readings, budget)
    }

    /// The state of every joint, however long that takes within `budget`.
    ///
    /// # Errors
    /// As [`Link::states`].
    pub fn whole_states(&mut self, budget: Instant) -> Result<States, LinkError> {
        let readings = self.reads.iter().map(|reads| reads.whole.clone()).collect();
        self.read_all(readings, budget)
    }

    /// Carries out the readings of each line.
    fn read_all(
        &mut self,
        mut readings: Vec<Vec<Reading>>,
        budget: Instant,
    ) -> Result<States, LinkError> {
        let mut states: States = vec![Err(Miss::NotAsked); self.robot.joints.len()];
        while readings.iter().any(|of_line| !of_line.is_empty()) {
            let mut failed = None;
            // All lines are asked before any is waited for, so that they answer side by side.
            let mut asked = Vec::with_capacity(readings.len());
            for (line, of_line) in readings.iter_mut().enumerate() {
                if of_line.is_empty() {
                    continue;
                }
                let mut reading = of_line.remove(0);
                reading.joints.sort_by_key(|&(joint, _)| self.missed_in_a_row[joint]);
                if self.lost[line] {
                    reading.joints.iter().for_each(|&(joint, _)| states[joint] = Err(Miss::Silent));
                    continue;
                }
                if let Method::Group(kind) = reading.method
                    && let Err(e) =
                        self.buses[line].begin_group_read(&reading.question(kind), budget)
                {
                    failed = Some(self.line_error(line, e));
                    continue;
                }
                asked.push((line, reading));
            }
            // A line that fails does not keep the others from being heard to the end.
            for (line, reading) in asked {
                if let Err(e) = self.hear(line, &reading, &mut states, budget) {
                    failed = Some(self.line_error(line, e));
                }
            }
            if let Some(failed) = failed {
                return Err(failed);
            }
        }
        Ok(states)
    }

    /// Waits for the answers to `reading`; single reads are asked only here.
    fn hear(
        &mut self,
        line: usize,
        reading: &Reading,
        states: &mut States,
        budget: Instant,
    ) -> Result<(), AskError> {
        let mut put = |link: &mut Self, (joint, item): (usize, GroupItem), answer| {
            let state = Result::and_then(answer, |reply| link.decode(joint, item, &reply));
            let missed = &mut link.missed_in_a_row[joint];
            *missed = if state.is_err() { *missed + 1 } else { 0 };
            states[joint] = state;
        };
        if reading.method != Method::Single {
            let answers = self.buses[line].finish_group_read(budget)?;
            for (&asked, answer) in reading.joints.iter().zip(answers) {
                put(self, asked, answer);
            }
            return Ok(());
        }
        for &(joint, item) in &reading.joints {
            let GroupItem { id, address, length } = item;
            let answer = match self.buses[line].read(reading.protocol, id, address, length, budget)
            {
                Ok(reply) => Ok(reply),
                Err(AskError::Miss(miss)) => Err(miss),
                Err(error) => return Err(error),
            };
            put(self, (joint, item), answer);
        }
        Ok(())
    }

    /// True if no joint answered when it was last asked for its state.
    #[must_use]
    pub fn nobody_answers(&self) -> bool {
        let joints = self.robot.joints.iter().zip(&self.missed_in_a_row);
        joints.into_iter().all(|(joint, &missed)| missed > 0 || self.is_lost(joint.line))
    }

    /// When every line may be spoken to again.
    #[must_use]
    pub fn ready_at(&self) -> Instant {
        self.buses.iter().map(Bus::ready_at).max().unwrap_or(Instant::ZERO)
    }

    fn decode(
        &self,
        joint: usize,
        asked: GroupItem,
        reply: &Reply,
    ) -> Result<(JointState, bool), Miss> {
        let joint = &self.robot.joints[joint];
        let whole =
            asked.address == joint.feedback.address() && asked.length == joint.feedback.length();
        let block = if whole { &joint.feedback } else { &joint.position };
        let servo = block.decode(&reply.bytes).map_err(|_| Miss::Garbled)?;
        Ok((joint.joint_state(servo), reply.alert))
    }

    /// Number of reads that make up the slow facts of `joint`.
    #[must_use]
    pub fn health_reads(&self, joint: usize) -> usize {
        self.robot.joints[joint].health.reads().len()
    }

    /// True if part `part` of the slow facts of `joint` can be read by `budget`.
    #[must_use]
    pub fn health_fits(&self, joint: usize, part: usize, budget: Instant) -> bool {
        let Joint { line, model, health, .. } = &self.robot.joints[joint];
        let length = health.reads().get(part).map_or(0, |&(_, length)| length);
        self.buses[*line].fits(model.protocol(), usize::from(length), budget)
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
        let Joint { line, id, model, health, .. } = &self.robot.joints[joint];
        let Some(&(address, length)) = health.reads().get(part) else {
            return Ok(Health::default());
        };
        let reply = self.buses[*line]
            .read(model.protocol(), *id, address, length, budget)
            .map_err(|e| self.joint_error(joint, e))?;
        let joint_of = &self.robot.joints[joint];
        joint_of
            .health
            .decode(part, &reply.bytes)
            .map_err(|_| self.joint_error(joint, Miss::Garbled.into()))
    }

    /// Writes the goal of every joint.
    ///
    /// # Errors
    /// A line that failed, or a goal that does not fit its register.
    pub fn write_goals(&mut self, command: &Command, budget: Instant) -> Result<(), LinkError> {
        self.write_all(Role::GoalPosition, budget, |joint, index| {
            joint.servo_rad(command.goal_rad()[index])
        })
    }

    /// Switches torque on or off on every joint; nobody answers.
    pub(crate) fn write_torque(&mut self, on: bool, budget: Instant) -> Result<(), LinkError> {
        let value = f64::from(u8::from(on));
        self.write_all(Role::TorqueEnable, budget, |_, _| value)
    }

    /// Writes one register of every joint that has it, from an SI value in servo terms.
    fn write_all(
        &mut self,
        role: Role,
        budget: Instant,
        value: impl Fn(&Joint, usize) -> f64,
    ) -> Result<(), LinkError> {
        let groups = if role == Role::GoalPosition {
            self.writes.clone()
        } else {
            groups(&self.robot, |joint| {
                joint.model.register(role).map_or((0, 0), |r| (r.address, u16::from(r.bytes)))
            })
        };
        for group in groups.iter().filter(|group| group.length > 0 && !self.lost[group.line]) {
            let mut payload = std::mem::take(&mut self.payload);
            payload.clear();
            for &index in &group.joints {
                let joint = &self.robot.joints[index];
                let written = joint.model.register(role).and_then(|register| {
                    joint.model.append_si(register, value(joint, index), &mut payload)
                });
                written.map_err(|e| self.joint_error(index, AskError::Unsayable(e.to_string())))?;
            }
            let size = usize::from(group.length);
            let items: Vec<(u8, &[u8])> = group
                .joints
                .iter()
                .zip(payload.chunks_exact(size))
                .map(|(&index, bytes)| (self.robot.joints[index].id, bytes))
                .collect();
            self.buses[group.line]
                .sync_write(group.protocol, group.address, &items, budget)
                .map_err(|e| self.line_error(group.line, e))?;
            self.payload = payload;
        }
        Ok(())
    }

    /// Asks whether the servo of `joint` is there.
    ///
    /// # Errors
    /// [`LinkError`].
    pub fn ping(&mut self, joint: usize, budget: Instant) -> Result<(), LinkError> {
        let Joint { line, id, model, .. } = self.robot.joints[joint];
        let asked = self.buses[line].ping(model.protocol(), id, budget);
        asked.map(|_| ()).map_err(|e| self.joint_error(joint, e))
    }

    /// Asks whether the servo of `joint` is there; model number and firmware.
    ///
    /// # Errors
    /// [`LinkError`].
    pub fn identity(&mut self, joint: usize, budget: Instant) -> Result<(u16, u16), LinkError> {
        self.ping(joint, budget)?;
        let model = self.read_raw(joint, Role::ModelNumber, budget)?;
        let major = self.read_raw(joint, Role::FirmwareVersion, budget)?;
        let firmware = match self.read_raw(joint, Role::FirmwareVersionMinor, budget) {
            Ok(minor) => major * 256 + minor,
            Err(LinkError { error: AskError::Unsayable(_), .. }) => major,
            Err(error) => return Err(error),
        };
        let fit = |raw: i64| u16::try_from(raw).unwrap_or(u16::MAX);
        Ok((fit(model), fit(firmware)))
    }

    /// Raw value of the register for `role`.
    ///
    /// # Errors
    /// [`LinkError`]; [`AskError::Unsayable`] if the model has no such register.
    pub fn read_raw(
        &mut self,
        joint: usize,
        role: Role,
        budget: Instant,
    ) -> Result<i64, LinkError> {
        let register = self.robot.joints[joint].model.register(role);
        let register =
            register.map_err(|e| self.joint_error(joint, AskError::Unsayable(e.to_string())))?;
        self.read_register(joint, register, budget)
    }

    /// Raw value of `register`.
    ///
    /// # Errors
    /// [`LinkError`].
    pub fn read_register(
        &mut self,
        joint: usize,
        register: &Register,
        budget: Instant,
    ) -> Result<i64, LinkError> {
        let Joint { line, id, model, .. } = self.robot.joints[joint];
        let reply = self.buses[line]
            .read(model.protocol(), id, register.address, u16::from(register.bytes), budget)
            .map_err(|e| self.joint_error(joint, e))?;
        model
            .raw_from_bytes(register, &reply.bytes)
            .map_err(|_| self.joint_error(joint, Miss::Garbled.into()))
    }

    /// Writes a raw value to a RAM register and waits for the servo's yes.
    pub(crate) fn write_raw(
        &mut self,
        joint: usize,
        register: &Register,
        raw: i64,
        budget: Instant,
    ) -> Result<(), LinkError> {
        if register.role == Some(Role::GoalPosition) {
            let text = "a goal is written as a command, never raw".to_owned();
            return Err(self.joint_error(joint, AskError::Unsayable(text)));
        }
        let Joint { line, id, model, .. } = self.robot.joints[joint];
        let mut bytes = Vec::with_capacity(4);
        model
            .append_raw(register, raw, &mut bytes)
            .map_err(|e| self.joint_error(joint, AskError::Unsayable(e.to_string())))?;
        self.buses[line]
            .write(model.protocol(), id, register.address, &bytes, budget)
            .map_err(|e| self.joint_error(joint, e))?;
        Ok(())
    }
}

/// Joints by line, protocol and the block that is to be read or written.
fn groups(robot: &Robot, block: impl Fn(&Joint) -> (u16, u16)) -> Vec<Group> {
    let mut groups: Vec<Group> = Vec::new();
    for (index, joint) in robot.joints.iter().enumerate() {
        let (address, length) = block(joint);
        let protocol = joint.model.protocol();
        let same = |g: &&mut Group| {
            (g.line, g.protocol, g.address, g.length) == (joint.line, protocol, address, length)
        };
        match groups.iter_mut().find(same) {
            Some(group) => group.joints.push(index),
            None => groups.push(Group {
                line: joint.line,
                protocol,
                address,
                length,
                joints: vec![index],
            }),
        }
    }
    groups
}

/// Longest return delay among the servos of line number `line`, as the robot file sets it.
fn return_delay(robot: &Robot, line: usize) -> Duration {
    let on_line = robot.joints.iter().filter(|joint| joint.line == line);
    Duration::from_secs_f64(
        on_line
            .filter_map(|joint| joint.configured(Role::ReturnDelay))
            .fold(0.0, f64::max)
            .clamp(0.0, 1.0),
    )
}
