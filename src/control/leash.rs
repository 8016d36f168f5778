//! No goal runs away from its joint.
//!
//! A joint that is blocked, or weaker than its load, falls behind the motion. Its goal must not go
//! on without it: whoever frees the joint would set it loose over the whole way, at full speed, with
//! no host. So every goal stays within the tracking bound of where its joint was last read.
//!
//! A goal that comes close to the bound brakes at `BRAKE_SHARE` of the joint's acceleration limit,
//! early enough to come to rest on the bound, and takes up the motion again at the limit itself when
//! the joint follows. Whether the joint moves along is told by its readings: a joint that follows,
//! however late, is not slowed by this. One that is stopped dead at a speed from which its goal
//! cannot brake in time has its goal stopped on the bound at once; that is counted
//! ([`Leash::forced`]).

use crate::motion::{Chase, JointLimits, Setpoint};
use crate::time::Instant;

/// Goals brake at this multiple of the acceleration limit; a stop may use up to twice the limit.
const BRAKE_SHARE: f64 = 1.8;
/// Two readings this near, rad, are of a joint that stands.
const STANDS_RAD: f64 = 0.02;
/// A goal this near to the motion, rad, at a speed this near, rad/s, has taken it up again.
const MET_RAD: f64 = 1e-6;

/// The goals of all joints, held near their joints.
#[derive(Debug)]
pub struct Leash {
    limits: Vec<JointLimits>,
    joints: Vec<Held>,
    bound_rad: f64,
}

/// One joint's goal, and what is known of the joint.
#[derive(Clone, Copy, Debug)]
struct Held {
    goal: Chase,
    /// Where the joint was last read.
    present_rad: f64,
    read_at: Instant,
    /// The goal in effect while it was read.
    goal_then_rad: f64,
    /// How fast it moved between its last two readings, rad/s.
    present_rad_s: f64,
    held: bool,
    forced: bool,
    /// The last question for its position was not answered.
    missed: bool,
    /// The answer was one that cannot be.
    doubted: bool,
    /// Where it was read after a silence, far from its goal.
    waiting_at_rad: Option<f64>,
}

/// What a reading says of a joint's goal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Heard {
    /// Nothing that is not provided for.
    Fine,
    /// The joint may have missed goals: it is told none until it was read once more.
    Waits,
    /// It did, and stands: its goal begins again there.
    BeginsAgain,
}

impl Leash {
    /// Goals for joints that stand at `start_rad`, none to be further than `bound_rad` from its
    /// joint.
    #[must_use]
    pub fn new(start_rad: &[f64], limits: Vec<JointLimits>, bound_rad: f64, at: Instant) -> Self {
        let standing = |&start_rad: &f64| Held {
            goal: Chase { position_rad: start_rad, velocity_rad_s: 0.0 },
            present_rad: start_rad,
            read_at: at,
            goal_then_rad: start_rad,
            present_rad_s: 0.0,
            held: false,
            forced: false,
            missed: false,
            doubted: false,
            waiting_at_rad: None,
        };
        Self { limits, joints: start_rad.iter().map(standing).collect(), bound_rad }
    }

    /// `joint` was read at `present_rad`, by a question asked at `at`.
    ///
    /// A joint that missed readings may have missed goals too: one that is then further from its goal
    /// than the bound is waited for, and if the next reading finds it standing there, its goal begins
    /// again where it stands. (Late answers tell of places where a joint was, not of one where it
    /// stands.)
    pub fn heard(&mut self, joint: usize, present_rad: f64, at: Instant) -> Heard {
        let (Some(held), Some(limits)) = (self.joints.get_mut(joint), self.limits.get(joint))
        else {
            return Heard::Fine;
        };
        let off_rad = (held.goal.position_rad - present_rad).abs();
        let in_question = std::mem::take(&mut held.missed) || held.waiting_at_rad.is_some();
        let stands = |rad: f64| (rad - present_rad).abs() <= STANDS_RAD;
        let heard = match held.waiting_at_rad.take() {
            _ if !(in_question && off_rad > self.bound_rad) => Heard::Fine,
            Some(rad) if stands(rad) => {
                let position_rad = present_rad.clamp(limits.lower_rad(), limits.upper_rad());
                held.goal = Chase { position_rad, velocity_rad_s: 0.0 };
                held.held = true;
                Heard::BeginsAgain
            }
            _ => {
                held.waiting_at_rad = Some(present_rad);
                Heard::Waits
            }
        };
        let since_s = at.seconds_since(held.read_at);
        if since_s > 0.0 {
            held.present_rad_s = (present_rad - held.present_rad) / since_s;
        }
        (held.present_rad, held.read_at) = (present_rad, at);
        held.goal_then_rad = held.goal.position_rad;
        held.doubted = false;
        heard
    }

    /// `joint` was asked and could not be read.
    pub fn missed(&mut self, joint: usize) {
        if let Some(held) = self.joints.get_mut(joint) {
            held.missed = true;
        }
    }

    /// `joint` was read where it cannot be: until it is read again its goal goes nowhere.
    pub fn doubt(&mut self, joint: usize) {
        if let Some(held) = self.joints.get_mut(joint) {
            held.doubted = true;
        }
    }

    /// True if any goal lies short of where the motion wants its joint, or still moves to it.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.joints.iter().any(|joint| joint.held && joint.goal.velocity_rad_s != 0.0)
    }

    /// Joints whose goals were stopped on the bound faster than they may brake, in the last step.
    pub fn forced(&self) -> impl Iterator<Item = usize> {
        self.joints.iter().enumerate().filter(|(_, joint)| joint.forced).map(|(joint, _)| joint)
    }

    /// True if the goal of `joint` lies short of where the motion wants the joint.
    #[must_use]
    pub fn is_held(&self, joint: usize) -> bool {
        self.joints.get(joint).is_some_and(|joint| joint.held)
    }

    /// The goals for where the motion wants its joints at `now`, `dt_s` after the last; exactly
    /// there for every joint that follows. `stopping`: a goal that was held back takes the motion up
    /// no more, it brakes to rest. `is_told` says of a joint whether it is told its goal now; the goal
    /// of one that is not stays where it is.
    pub fn advance(
        &mut self,
        dt_s: f64,
        now: Instant,
        stopping: bool,
        is_told: impl Fn(usize) -> bool,
        wanted: &mut [Setpoint],
    ) {
        let step = Step { dt_s, now, stopping, bound_rad: self.bound_rad };
        let joints = self.joints.iter_mut().zip(&self.limits).zip(wanted).enumerate();
        for (index, ((joint, limits), wanted)) in joints {
            if is_told(index) {
                joint.advance(step, limits, wanted);
            } else {
                joint.stay(wanted);
            }
        }
    }
}

/// What all joints share in one step.
#[derive(Clone, Copy, Debug)]
struct Step {
    dt_s: f64,
    now: Instant,
    stopping: bool,
    bound_rad: f64,
}

impl Held {
    /// Where the joint is now, if it followed its goal since it was read.
    fn supposed_rad(&self) -> f64 {
        self.present_rad + (self.goal.position_rad - self.goal_then_rad)
    }

    /// The goal stays where it is.
    fn stay(&mut self, wanted: &mut Setpoint) {
        (self.held, self.forced) = (true, false);
        self.goal.velocity_rad_s = 0.0;
        *wanted = Setpoint { position_rad: self.goal.position_rad, ..Setpoint::default() };
    }

    fn advance(&mut self, step: Step, limits: &JointLimits, wanted: &mut Setpoint) {
        self.forced = false;
        let target =
            Chase { position_rad: wanted.position_rad, velocity_rad_s: wanted.velocity_rad_s };
        let brake = BRAKE_SHARE * limits.acceleration_rad_s2();
        if !self.held && !self.doubted && self.is_free(target, brake, step) {
            self.goal = target;
            return;
        }
        self.held = true;
        let braked = self.goal.braked(step.dt_s, brake);
        let next = match step.stopping || self.doubted {
            true => braked,
            false => self.goal.toward(target, step.dt_s, limits),
        };
        let next = if self.is_free(next, brake, step) { next } else { braked };
        let next = self.inside(next, step, limits);
        let off_rad = (next.position_rad - target.position_rad).abs();
        let off_rad_s = (next.velocity_rad_s - target.velocity_rad_s).abs();
        self.held = step.stopping || off_rad > MET_RAD || off_rad_s > MET_RAD;
        let gained_rad_s = next.velocity_rad_s - self.goal.velocity_rad_s;
        *wanted = Setpoint {
            position_rad: next.position_rad,
            velocity_rad_s: next.velocity_rad_s,
            acceleration_rad_s2: if step.dt_s > 0.0 { gained_rad_s / step.dt_s } else { 0.0 },
        };
        self.goal = next;
    }

    /// How fast the joint moved along when it was last read, rad/s, and how far that has taken it
    /// since, rad: in the direction `away`, 1 or -1.
    fn along(&self, away: f64, now: Instant) -> (f64, f64) {
        let along_rad_s = (away * self.present_rad_s).max(0.0);
        (along_rad_s, along_rad_s * now.seconds_since(self.read_at).max(0.0))
    }

    /// True if a goal at `next` can still come to rest within the bound, or to the speed at which
    /// the joint moves along.
    fn is_free(&self, next: Chase, brake_rad_s2: f64, step: Step) -> bool {
        let ahead_rad = next.position_rad - self.supposed_rad();
        let away = if ahead_rad < 0.0 { -1.0 } else { 1.0 };
        let (along_rad_s, moved_rad) = self.along(away, step.now);
        let gaining_rad_s = (away * next.velocity_rad_s - along_rad_s).max(0.0);
        let braking_rad = gaining_rad_s * gaining_rad_s / (2.0 * brake_rad_s2);
        // A joint that was pushed away is come back to.
        let comes_back = away * next.velocity_rad_s < 0.0
            && away * next.position_rad <= away * self.goal.position_rad;
        ahead_rad.abs() - moved_rad + braking_rad <= step.bound_rad || comes_back
    }

    /// `next`, no further from the joint than the bound, or than the goal is already.
    fn inside(&mut self, next: Chase, step: Step, limits: &JointLimits) -> Chase {
        let supposed_rad = self.supposed_rad();
        let lower = supposed_rad - step.bound_rad - self.along(-1.0, step.now).1;
        let upper = supposed_rad + step.bound_rad + self.along(1.0, step.now).1;
        let goal_rad = self.goal.position_rad;
        let reach_rad = next
            .position_rad
            .clamp(lower.min(goal_rad), upper.max(goal_rad))
            .clamp(limits.lower_rad(), limits.upper_rad());
        if reach_rad == next.position_rad {
            return next;
        }
        self.forced = true;
        let velocity_rad_s = (reach_rad - goal_rad) / step.dt_s;
        let velocity_rad_s = if step.dt_s > 0.0 { velocity_rad_s } else { 0.0 };
        Chase { position_rad: reach_rad, velocity_rad_s }
    }
}

#[cfg(test)]
mod tests;
