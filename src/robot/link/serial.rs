//! The serial lines of a link: servos by their registers.

use super::open_line::OpenLine;
use super::{Group, Link, LinkError, States, joint_error};
use crate::bus::{AskError, Bus, GroupItem, Miss, Reply};
use crate::device::{Inertial, JointState, Model};
use crate::robot::reading::{Method, Reading};
use crate::robot::{BaseSensor, Joint, Robot};
use crate::time::Instant;
use gaitway_profiles::{Register, Role};

fn sensor_error(sensor: &BaseSensor, error: AskError) -> LinkError {
    let place = format!("{} in the base, ID {}", sensor.name, sensor.id);
    LinkError { line: sensor.line, place, error }
}

impl Link {
    /// Carries out the readings of each serial line.
    pub(super) fn read_serial(
        &mut self,
        mut readings: Vec<Vec<Reading>>,
        states: &mut States,
        budget: Instant,
    ) -> Result<(), LinkError> {
        while readings.iter().any(|of_line| !of_line.is_empty()) {
            let mut failed = None;
            // All lines are asked before any is waited for, so that they answer side by side.
            let mut asked = Vec::with_capacity(readings.len());
            for (line, of_line) in readings.iter_mut().enumerate() {
                if of_line.is_empty() {
                    continue;
                }
                let mut reading = of_line.remove(0);
                if self.lost[line] {
                    continue;
                }
                reading.joints.sort_by_key(|&(joint, _)| self.missed_in_a_row[joint]);
                if let Method::Group(kind) = reading.method {
                    let question = reading.question(kind);
                    let begun = self.serial(line);
                    if let Err(e) = begun.and_then(|bus| bus.begin_group_read(&question, budget)) {
                        failed = Some(self.line_error(line, e));
                        continue;
                    }
                }
                asked.push((line, reading));
            }
            // A line that fails does not keep the others from being heard to the end.
            for (line, reading) in asked {
                if let Err(e) = self.hear(line, &reading, states, budget) {
                    failed = Some(self.line_error(line, e));
                }
            }
            if let Some(failed) = failed {
                return Err(failed);
            }
        }
        Ok(())
    }

    /// Waits for the answers to `reading`; single reads are asked only here.
    fn hear(
        &mut self,
        line: usize,
        reading: &Reading,
        states: &mut States,
        budget: Instant,
    ) -> Result<(), AskError> {
        if reading.method != Method::Single {
            let answers = self.serial(line)?.finish_group_read(budget)?;
            for (&(joint, item), answer) in reading.joints.iter().zip(answers) {
                let state = answer.and_then(|reply| self.decode(joint, item, &reply));
                self.put(joint, state, states);
            }
            return Ok(());
        }
        for &(joint, item) in &reading.joints {
            let GroupItem { id, address, length } = item;
            let bus = self.serial(line)?;
            let answer = match bus.read(reading.protocol, id, address, length, budget) {
                Ok(reply) => self.decode(joint, item, &reply),
                Err(AskError::Miss(miss)) => Err(miss),
                Err(error) => return Err(error),
            };
            self.put(joint, answer, states);
        }
        Ok(())
    }

    /// What a servo said, in its own terms.
    fn decode(
        &self,
        joint: usize,
        asked: GroupItem,
        reply: &Reply,
    ) -> Result<(JointState, bool), Miss> {
        let servo = self.robot.joints[joint].servo().ok_or(Miss::NotAsked)?;
        let whole =
            asked.address == servo.feedback.address() && asked.length == servo.feedback.length();
        let block = if whole { &servo.feedback } else { &servo.position };
        let state = block.decode(&reply.bytes).map_err(|_| Miss::Garbled)?;
        Ok((state, reply.alert))
    }

    /// Writes one register of every joint that has it, from an SI value in servo terms.
    pub(super) fn write_all(
        &mut self,
        role: Role,
        budget: Instant,
        value: impl Fn(&Joint, usize) -> f64,
    ) -> Result<(), LinkError> {
        let groups = if role == Role::GoalPosition {
            self.writes.clone()
        } else {
            groups(&self.robot, |joint| {
                joint.register(role).map(|r| (r.address, u16::from(r.bytes)))
            })
        };
        for group in &groups {
            let goals = role == Role::GoalPosition;
            if self.lost[group.line] || goals && self.held_back[group.line] {
                continue;
            }
            let mut payload = std::mem::take(&mut self.payload);
            payload.clear();
            let mut ids = Vec::with_capacity(group.joints.len());
            for &index in &group.joints {
                let joint = &self.robot.joints[index];
                let Some(servo) = joint.servo() else { continue };
                if goals && !self.is_told(index) {
                    continue;
                }
                ids.push(joint.id);
                let written = servo.model.register(role).and_then(|register| {
                    servo.model.append_si(register, value(joint, index), &mut payload)
                });
                written.map_err(|e| self.joint_error(index, AskError::Unsayable(e.to_string())))?;
            }
            if ids.is_empty() {
                self.payload = payload;
                continue;
            }
            let size = usize::from(group.length);
            let items: Vec<(u8, &[u8])> =
                ids.into_iter().zip(payload.chunks_exact(size.max(1))).collect();
            let bus = self.serial(group.line);
            bus.and_then(|bus| bus.sync_write(group.protocol, group.address, &items, budget))
                .map_err(|e| self.line_error(group.line, e))?;
            self.payload = payload;
        }
        Ok(())
    }

    /// The joint's servo, and its line.
    fn asked_servo(&mut self, joint: usize) -> Result<(&mut Bus, u8, Model), LinkError> {
        let Joint { line, id, .. } = self.robot.joints[joint];
        let Some(model) = self.robot.joints[joint].servo().map(|servo| servo.model) else {
            let text = "an actuator on a CAN line has no registers".to_owned();
            return Err(self.joint_error(joint, AskError::Unsayable(text)));
        };
        if let Some(bus) = self.lines.get_mut(line).and_then(OpenLine::serial_mut) {
            return Ok((bus, id, model));
        }
        let text = "this is no serial line".to_owned();
        Err(joint_error(&self.robot, joint, AskError::Unsayable(text)))
    }

    /// What the base feels now.
    ///
    /// # Errors
    /// [`LinkError`]; [`AskError::Unsayable`] if the robot has no sensor in its base.
    pub fn inertial(&mut self, budget: Instant) -> Result<Inertial, LinkError> {
        let sensor = self.base_sensor()?;
        let (address, length) = sensor.board.block();
        let bytes = self.read_sensor(&sensor, address, length, budget)?;
        sensor.board.decode(&bytes).ok_or_else(|| sensor_error(&sensor, Miss::Garbled.into()))
    }

    /// Asks whether the sensor in the base is there; model number and firmware.
    ///
    /// # Errors
    /// As [`Link::inertial`].
    pub fn sensor_identity(&mut self, budget: Instant) -> Result<(u16, u16), LinkError> {
        let sensor = self.base_sensor()?;
        let failed = |error| sensor_error(&sensor, error);
        let bus = self.serial(sensor.line).map_err(failed)?;
        let reply = bus.ping(sensor.board.protocol, sensor.id, budget).map_err(failed)?;
        match *reply.bytes.as_slice() {
            [low, high, firmware] => Ok((u16::from_le_bytes([low, high]), firmware.into())),
            _ => Err(failed(Miss::Garbled.into())),
        }
    }

    fn base_sensor(&self) -> Result<BaseSensor, LinkError> {
        self.robot.base_sensor.clone().ok_or_else(|| LinkError {
            line: 0,
            place: "base".to_owned(),
            error: AskError::Unsayable("the robot has no sensor in its base".to_owned()),
        })
    }

    fn read_sensor(
        &mut self,
        sensor: &BaseSensor,
        address: u16,
        length: u16,
        budget: Instant,
    ) -> Result<Vec<u8>, LinkError> {
        let failed = |error| sensor_error(sensor, error);
        if self.lost[sensor.line] {
            return Err(failed(Miss::Silent.into()));
        }
        let bus = self.serial(sensor.line).map_err(failed)?;
        let reply = bus.read(sensor.board.protocol, sensor.id, address, length, budget);
        reply.map(|reply| reply.bytes).map_err(failed)
    }

    /// Asks whether the servo of `joint` is there.
    ///
    /// # Errors
    /// [`LinkError`].
    pub fn ping(&mut self, joint: usize, budget: Instant) -> Result<(), LinkError> {
        let (bus, id, model) = self.asked_servo(joint)?;
        let asked = bus.ping(model.protocol(), id, budget);
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
        let (_, _, model) = self.asked_servo(joint)?;
        let register = model.register(role);
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
        let (bus, id, model) = self.asked_servo(joint)?;
        let length = u16::from(register.bytes);
        let reply = bus.read(model.protocol(), id, register.address, length, budget);
        let reply = reply.map_err(|e| self.joint_error(joint, e))?;
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
        let (bus, id, model) = self.asked_servo(joint)?;
        let mut bytes = Vec::with_capacity(4);
        let fits = model.append_raw(register, raw, &mut bytes);
        let written = match fits {
            Ok(()) => bus.write(model.protocol(), id, register.address, &bytes, budget),
            Err(e) => Err(AskError::Unsayable(e.to_string())),
        };
        written.map(|_| ()).map_err(|e| self.joint_error(joint, e))
    }
}

/// Servos by line, protocol and the block that is to be read or written, of those that have it.
pub(super) fn groups(robot: &Robot, block: impl Fn(&Joint) -> Option<(u16, u16)>) -> Vec<Group> {
    let mut groups: Vec<Group> = Vec::new();
    for (index, joint) in robot.joints.iter().enumerate() {
        let Some((servo, (address, length))) = joint.servo().zip(block(joint)) else { continue };
        let protocol = servo.model.protocol();
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
