//! Joints about which there is doubt: what they are asked before they are told anything, and who is
//! told nothing any more.

use super::open_line::OpenLine;
use super::{Group, Link};
use crate::bus::{GroupItem, GroupQuestion, GroupRead, Protocol};
use crate::robot::link::serial::groups;
use crate::time::{Duration, Instant};
use gaitway_profiles::Role;

impl Link {
    /// No goal is written to `joint` any more: its servo let go, and a goal might switch it on.
    pub fn mute(&mut self, joint: usize) {
        if let Some(muted) = self.muted.get_mut(joint) {
            *muted = true;
        }
    }

    /// All joints are told their goals again: they were proven anew.
    pub(crate) fn forget_doubts(&mut self) {
        self.muted.fill(false);
        self.held_back.fill(false);
        self.waiting.fill(false);
        self.silent.fill(false);
    }

    /// True if no goal is written to `joint` any more.
    #[must_use]
    pub fn is_muted(&self, joint: usize) -> bool {
        self.muted.get(joint).copied().unwrap_or(true)
    }

    /// True if the next goal of `joint` is sent.
    #[must_use]
    pub fn is_told(&self, joint: usize) -> bool {
        let Some(of) = self.robot.joints.get(joint) else { return false };
        let waits = self.muted[joint] || self.waiting[joint] || self.silent[joint];
        !(waits || self.lost[of.line] || self.held_back[of.line])
    }

    /// Writes no goals to the joints of line number `line` until it is called again without.
    pub fn hold_back(&mut self, line: usize, back: bool) {
        if let Some(held_back) = self.held_back.get_mut(line) {
            *held_back = back;
        }
    }

    /// Writes no goals to `joint` while it `waits`.
    pub fn let_wait(&mut self, joint: usize, waits: bool) {
        if let Some(waiting) = self.waiting.get_mut(joint) {
            *waiting = waits;
        }
    }

    /// Writes no goals to `joint` while it is `silent`. It hears none, so nobody waits until it has
    /// heard its last one.
    pub fn keep_goals_from(&mut self, joint: usize, silent: bool) {
        if let Some(of) = self.silent.get_mut(joint) {
            *of = silent;
        }
    }

    /// True if goals are kept for now from anybody on a line that is still there.
    #[must_use]
    pub fn holds_back(&self) -> bool {
        let joints = self.robot.joints.iter().zip(&self.waiting).zip(&self.muted);
        let waits = joints
            .into_iter()
            .any(|((joint, waits), muted)| *waits && !muted && !self.lost[joint.line]);
        waits || self.held_back.iter().zip(&self.lost).any(|(back, lost)| *back && !lost)
    }

    /// Gives up line number `line`, so that the others go on. Names of the joints on it.
    pub fn give_up(&mut self, line: usize) -> Vec<String> {
        if let Some(lost) = self.lost.get_mut(line) {
            *lost = true;
        }
        let on_line = self.robot.joints.iter().filter(|joint| joint.line == line);
        on_line.map(|joint| joint.name.clone()).collect()
    }

    /// Remembers what the speed register of `joint` was set to when it was armed; a servo that has
    /// restarted since does not know it any more.
    pub(crate) fn remember_speed(&mut self, joint: usize, raw: i64) {
        if let Some(speed) = self.armed_speed.get_mut(joint) {
            *speed = Some(raw);
        }
    }

    /// Whether each of `joints`, all servos, is as it was armed: torque on, and the speed register
    /// as it was left. None of a joint that gave no answer by `budget`.
    pub(crate) fn as_armed(&mut self, joints: &[usize], budget: Instant) -> Vec<Option<bool>> {
        let torque = self.registers(Role::TorqueEnable, joints, budget);
        let mut as_armed: Vec<Option<bool>> =
            torque.into_iter().map(|raw| raw.map(|raw| raw == 1)).collect();
        for role in [Role::ProfileVelocity, Role::GoalVelocity] {
            let asked: Vec<usize> = (0..joints.len())
                .filter(|&k| as_armed[k] == Some(true) && self.speed_role(joints[k]) == Some(role))
                .collect();
            let of: Vec<usize> = asked.iter().map(|&k| joints[k]).collect();
            for (k, raw) in asked.into_iter().zip(self.registers(role, &of, budget)) {
                as_armed[k] = raw.map(|raw| Some(raw) == self.armed_speed[joints[k]]);
            }
        }
        as_armed
    }

    /// The register that limits the speed of position moves, if one was set when it was armed.
    fn speed_role(&self, joint: usize) -> Option<Role> {
        self.armed_speed.get(joint).copied().flatten()?;
        let of = &self.robot.joints[joint];
        [Role::ProfileVelocity, Role::GoalVelocity]
            .into_iter()
            .find(|&role| of.register(role).is_some())
    }

    /// The raw value of the register for `role` of each of `joints`, by one question to each line
    /// where its protocol has one; none of a joint that gave none by `budget`.
    pub(crate) fn registers(
        &mut self,
        role: Role,
        joints: &[usize],
        budget: Instant,
    ) -> Vec<Option<i64>> {
        let mut found = vec![None; joints.len()];
        let mut of_role = groups(&self.robot, |joint| {
            joint.register(role).map(|register| (register.address, u16::from(register.bytes)))
        });
        for group in &mut of_role {
            group.joints.retain(|joint| joints.contains(joint));
            if group.joints.is_empty() || self.lost[group.line] {
                continue;
            }
            for (joint, raw) in self.group_registers(role, group, budget) {
                if let Some(place) = joints.iter().position(|&asked| asked == joint) {
                    found[place] = Some(raw);
                }
            }
        }
        found
    }

    fn group_registers(&mut self, role: Role, group: &Group, budget: Instant) -> Vec<(usize, i64)> {
        let Group { line, protocol, address, length, .. } = *group;
        let grouped = matches!(protocol, Protocol::Dynamixel2 | Protocol::FeetechSts);
        if !grouped || group.joints.len() < 2 {
            return self.single_registers(role, group, budget);
        }
        let item = |&joint: &usize| GroupItem { id: self.robot.joints[joint].id, address, length };
        let items = group.joints.iter().map(item).collect();
        let question = GroupQuestion { protocol, kind: GroupRead::Sync, items };
        let Some(bus) = self.lines.get_mut(line).and_then(OpenLine::serial_mut) else {
            return Vec::new();
        };
        let takes = Duration::from_secs_f64(bus.read_time_s(&question));
        if self.clock.now().max(bus.ready_at()) + takes > budget {
            return Vec::new();
        }
        let asked = bus.begin_group_read(&question, budget);
        let answers = asked.and_then(|()| bus.finish_group_read(budget)).unwrap_or_default();
        let decoded = group.joints.iter().zip(answers).filter_map(|(&joint, answer)| {
            let of = &self.robot.joints[joint];
            let model = of.model().ok()?;
            let raw = model.raw_from_bytes(of.register(role)?, &answer.ok()?.bytes).ok()?;
            Some((joint, raw))
        });
        decoded.collect()
    }

    fn single_registers(
        &mut self,
        role: Role,
        group: &Group,
        budget: Instant,
    ) -> Vec<(usize, i64)> {
        let mut found = Vec::new();
        for &joint in &group.joints {
            let Some(bus) = self.lines.get(group.line).and_then(OpenLine::serial) else { break };
            // A question that is cut off would cost the rest their time. Adapters are seldom as slow as
            // they may be, so their latency is no reason not to ask.
            let takes_s = bus.one_read_time_s(group.protocol, usize::from(group.length));
            let takes = Duration::from_secs_f64(takes_s);
            if self.clock.now().max(bus.ready_at()) + takes > budget {
                break;
            }
            if let Ok(raw) = self.read_raw(joint, role, budget) {
                found.push((joint, raw));
            }
        }
        found
    }
}
