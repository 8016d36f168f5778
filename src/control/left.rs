//! How a robot is left when nobody commands it any more: said only where it was read back.

use super::inject;
use super::watchdog::{self, Released};
use crate::robot::Link;
use crate::robot::preflight::{QUESTION, budget};
use gaitway_profiles::Role;

/// Joints by what their drives said of their torque after the last goal.
#[derive(Clone, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Left {
    /// They hold, torque on.
    pub holding: Vec<String>,
    /// They are limp.
    pub limp: Vec<String>,
    /// They did not say.
    pub unknown: Vec<String>,
    /// Their bus watchdog has stopped them: they obeyed no goal since.
    pub stopped_by_watchdog: Vec<String>,
}

impl Left {
    /// What a person should know of it.
    #[must_use]
    pub fn words(&self) -> String {
        if self.limp.is_empty() && self.unknown.is_empty() {
            return "torque stays on: the joints hold where they are".to_owned();
        }
        let mut parts = Vec::new();
        let said = [
            ("torque is on, read back", &self.holding),
            ("torque is off", &self.limp),
            ("whether torque is on was not to be learnt", &self.unknown),
        ];
        for (what, joints) in said.into_iter().filter(|(_, joints)| !joints.is_empty()) {
            parts.push(format!("{what}: {}", joints.join(", ")));
        }
        parts.join("; ")
    }
}

/// Switches the watchdogs off, asks every drive for its torque, and says so.
pub fn leave(link: &mut Link) -> (Left, Vec<String>) {
    inject::point("leave", 0);
    let released = watchdog::release(link);
    let mut left = look(link, &released);
    left.stopped_by_watchdog.clone_from(&released.bitten);
    let mut notes = released.words(link);
    notes.push(left.words());
    (left, notes)
}

/// Asks every drive whether its torque is on; not those that said nothing just now.
fn look(link: &mut Link, released: &Released) -> Left {
    let joints = link.robot().joints.len();
    let mut told: Vec<Option<bool>> = vec![None; joints];
    let there = |link: &Link, joint: usize| !link.is_lost(link.robot().joints[joint].line);
    let servos: Vec<usize> = (0..joints)
        .filter(|&joint| there(link, joint) && link.robot().joints[joint].servo().is_some())
        .filter(|&joint| !released.unsure.contains(&link.robot().joints[joint].name))
        .collect();
    let limit = budget(link) + QUESTION;
    let raw = link.registers(Role::TorqueEnable, &servos, limit);
    for (&joint, raw) in servos.iter().zip(raw) {
        told[joint] = raw.map(|raw| raw != 0);
    }
    for (joint, told) in told.iter_mut().enumerate() {
        let unsure = released.unsure.contains(&link.robot().joints[joint].name);
        if told.is_some() || unsure || !there(link, joint) {
            continue;
        }
        *told = match link.robot().joints[joint].servo() {
            Some(_) => {
                let limit = budget(link);
                link.read_raw(joint, Role::TorqueEnable, limit).ok().map(|raw| raw != 0)
            }
            None => link.torque_is(joint, true).ok(),
        };
    }
    let mut left = Left::default();
    for (joint, told) in told.into_iter().enumerate() {
        let name = link.robot().joints[joint].name.clone();
        match told {
            Some(true) => left.holding.push(name),
            Some(false) => left.limp.push(name),
            None => left.unknown.push(name),
        }
    }
    left
}

#[cfg(test)]
mod tests;
