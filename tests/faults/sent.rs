//! What a host told the servos of the only line of a robot, read off the bytes that left it.

use super::scene::Scene;
use super::wire::{Dialect, Word};
use gaitway::device::JointState;
use gaitway::robot::Joint;
use gaitway_profiles::{Protocol, Role};

/// Every instruction and its time, ns.
pub struct Told {
    words: Vec<(u64, Word)>,
    joints: Vec<Joint>,
    dialect: Dialect,
}

/// A goal that a joint was told: when, where, and how fast it went there from the one before.
#[derive(Clone, Copy, Debug)]
pub struct Goal {
    pub at_ns: u64,
    pub rad: f64,
    pub step_rad: f64,
    pub rad_s: f64,
}

/// The angle of a joint that its servo shows as `raw` in its goal.
pub fn goal_rad(joint: &Joint, raw: i64) -> f64 {
    let register = joint.register(Role::GoalPosition).expect("a goal");
    let position_rad = joint.model().expect("a servo").si_from_raw(register, raw);
    joint.joint_state(JointState { position_rad, ..JointState::default() }).position_rad
}

impl Told {
    /// By the host of a scene, since what it sends is kept.
    pub fn by(scene: &Scene) -> Self {
        let robot = scene.link.robot();
        let joints = robot.joints.clone();
        let of_two = joints[0].model().expect("a servo").profile().protocol == Protocol::Dynamixel2;
        // Protocol 1.0 has the packets that FEETECH took from it.
        let dialect = if of_two { Dialect::Dynamixel } else { Dialect::Feetech };
        let (mut words, mut bytes) = (Vec::new(), Vec::new());
        for (at_ns, sent) in scene.host.sent() {
            bytes.extend(sent);
            words
                .extend(dialect.take_words(&mut bytes, true).into_iter().map(|word| (at_ns, word)));
        }
        assert!(!words.is_empty() && bytes.is_empty(), "{} words, then {bytes:02X?}", words.len());
        Self { words, joints, dialect }
    }

    /// What was written at `address` of a servo, whichever way, and when.
    fn written(&self, id: u8, role: Role, joint: &Joint) -> Vec<(u64, u16, Vec<u8>)> {
        let Some(register) = joint.register(role).map(|register| register.address) else {
            return Vec::new();
        };
        let mut written = Vec::new();
        for (at_ns, word) in &self.words {
            let (address, data) = match word {
                Word::Write { id: of, address, data } if *of == id => (*address, data),
                Word::SyncWrite { address, items } => {
                    match items.iter().find(|(of, _)| *of == id) {
                        Some((_, data)) => (*address, data),
                        None => continue,
                    }
                }
                _ => continue,
            };
            if (address..address + data.len() as u16).contains(&register) {
                written.push((*at_ns, address, data.clone()));
            }
        }
        written
    }

    /// The goals of a joint.
    pub fn goals(&self, joint: usize) -> Vec<Goal> {
        let of = &self.joints[joint];
        let register = of.register(Role::GoalPosition).expect("a goal").address;
        let mut goals: Vec<Goal> = Vec::new();
        for (at_ns, address, data) in self.written(of.id, Role::GoalPosition, of) {
            let raw = self.dialect.counts_at(register, address, &data).expect("a whole goal");
            let rad = goal_rad(of, raw);
            let before = goals.last().map_or((at_ns, rad), |before| (before.at_ns, before.rad));
            let (time_s, step_rad) = ((at_ns - before.0) as f64 * 1e-9, rad - before.1);
            let rad_s = if time_s > 0.0 { step_rad / time_s } else { 0.0 };
            goals.push(Goal { at_ns, rad, step_rad, rad_s });
        }
        goals
    }

    /// How fast the fastest of these joints was told to go, write by write, rad/s: the last six times
    /// that any was, and up to twice that none was.
    pub fn last_speeds(&self, joints: &[usize]) -> Vec<f64> {
        let goals: Vec<Vec<Goal>> = joints.iter().map(|&joint| self.goals(joint)).collect();
        let writes = goals.iter().map(Vec::len).min().unwrap_or(0);
        let fastest = |back: usize| {
            let of = |goals: &Vec<Goal>| goals[goals.len() - back].rad_s.abs();
            goals.iter().map(of).fold(0.0, f64::max)
        };
        let mut speeds: Vec<f64> = (1..=writes).rev().map(fastest).collect();
        let moved = speeds.iter().rposition(|&speed| speed > 0.0).map_or(0, |last| last + 1);
        speeds.truncate(moved + 2);
        speeds.split_off(moved.saturating_sub(6))
    }

    /// How fast the fastest of these joints was told to go in the last write before a moment, rad/s.
    pub fn speed_at(&self, joints: &[usize], until_ns: u64) -> f64 {
        let at = |joint: usize| self.goals(joint).into_iter().rfind(|goal| goal.at_ns < until_ns);
        let goals = joints.iter().filter_map(|&joint| at(joint));
        goals.map(|goal| goal.rad_s.abs()).fold(0.0, f64::max)
    }

    /// How many of the joints have two equal last goals.
    pub fn at_rest(&self, joints: &[usize]) -> usize {
        let rests =
            |joint: usize| self.goals(joint).last().is_some_and(|goal| goal.step_rad == 0.0);
        joints.iter().filter(|&&joint| rests(joint)).count()
    }

    /// The longest way that any goal went in one write, rad.
    pub fn longest_step_rad(&self) -> f64 {
        let joints = 0..self.joints.len();
        let goals = joints.flat_map(|joint| self.goals(joint));
        goals.map(|goal| goal.step_rad.abs()).fold(0.0, f64::max)
    }

    /// Whenever torque was written: when, and whether on, of any joint.
    pub fn torque(&self) -> Vec<(u64, bool)> {
        let on = |(at_ns, value): (u64, i64)| (at_ns, value == 1);
        let of = |joint: usize| self.values(joint, Role::TorqueEnable).into_iter().map(on);
        let mut all: Vec<(u64, bool)> = (0..self.joints.len()).flat_map(of).collect();
        all.sort_unstable();
        all
    }

    /// From the first word that switched torque on to the last that switched it off, ms; none if it
    /// was never switched on, without end if it stayed on.
    pub fn torque_lasted_ms(&self) -> Option<f64> {
        let torque = self.torque();
        let first = torque.iter().position(|(_, on)| *on)?;
        let off_ns = torque[first..].iter().rev().find(|(_, on)| !on).map(|(at_ns, _)| *at_ns);
        let lasted_ns = off_ns.map(|off_ns| (off_ns - torque[first].0) as f64);
        Some(lasted_ns.map_or(f64::INFINITY, |ns| ns * 1e-6))
    }

    /// What was written to a register of a joint's servo, and when.
    pub fn values(&self, joint: usize, role: Role) -> Vec<(u64, i64)> {
        let of = &self.joints[joint];
        let register = of.register(role).expect("a register");
        let value = |(at_ns, address, data): (u64, u16, Vec<u8>)| {
            let from = usize::from(register.address - address);
            let bytes = &data[from..from + usize::from(register.bytes)];
            (at_ns, bytes.iter().rev().fold(0, |sum, &byte| sum << 8 | i64::from(byte)))
        };
        self.written(of.id, role, of).into_iter().map(value).collect()
    }

    /// The next instruction after a moment: when it left, and whether it tells goals to all.
    pub fn next(&self, at_ns: u64) -> Option<(u64, bool)> {
        let goal = self.joints[0].register(Role::GoalPosition).expect("a goal").address;
        let (then_ns, word) = self.words.iter().find(|(then_ns, _)| *then_ns > at_ns)?;
        Some((*then_ns, matches!(word, Word::SyncWrite { address, .. } if *address == goal)))
    }
}
