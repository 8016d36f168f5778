//! Following a pose that moves while it is followed: from what a person does now to what the
//! joints may do.
//!
//! Every joint is a double integrator. A target is a position and a velocity; the joint intercepts
//! it in the shortest time that its acceleration and velocity limits allow: full acceleration,
//! cruise, full deceleration, all in coordinates that move with the target (Bryson and Ho, "Applied
//! Optimal Control", sec. 3.9, for the switching law; the cruise is the usual extension for bounded
//! velocity). The law is in continuous time: what is sampled lies on a curve whose acceleration and
//! velocity are inside the limits everywhere, however long the steps are.
//!
//! Position limits: at acceleration `a`, a joint of velocity `v` stops at the *stop point*
//! `q + v |v| / 2a`. While it moves towards a limit no acceleration can draw the stop point back,
//! so a piece of motion after which it lies inside had it inside throughout. A piece that would
//! carry it past a limit is not begun; the joint brakes instead, which leaves the stop point where
//! it is. A joint can therefore always come to rest inside its limits, whatever targets come next.
//!
//! A stop that is asked for ends without a step of acceleration: each joint comes to rest as by the
//! second half of a half-sine actionlet ([`crate::motion::ease`]). Its deceleration peaks at the
//! limit. That takes pi/2 times the way of a brake at the limit; where the range ends before, the
//! form is shortened to end there, which its peak pays for with at most pi/2 times the limit.

use core::f64::consts::FRAC_PI_2;

use crate::motion::ease::{eased_rate, eased_time_s};
use crate::motion::limits::JointLimits;
use crate::motion::trajectory::Setpoint;

/// Input older than this is not followed any more, s.
pub const STALE_S: f64 = 0.1;
/// Time of one step at most, s: a pause must not buy a jump.
const LONGEST_STEP_S: f64 = 0.1;
/// Share of the velocity and acceleration limits used until all joints have reached their target:
/// whoever stands by should see the robot coming.
pub const APPROACH_SHARE: f64 = 0.3;
/// Share of the velocity limit up to which a target's own velocity is taken; the rest is for
/// catching up.
const TARGET_VELOCITY_SHARE: f64 = 0.9;
/// A joint within this of its target has reached it, rad: as with `clipped_samples`.
pub const REACHED_RAD: f64 = 0.01;
/// During the approach a person stands, which is not to stand still, rad.
const NEAR_RAD: f64 = 0.05;

/// What is to be followed, for one robot at one moment.
#[derive(Clone, Debug, PartialEq)]
pub struct Target {
    /// Angle of each joint, rad; one that is not finite is not followed.
    pub position_rad: Vec<f64>,
    /// Its velocity, rad/s.
    pub velocity_rad_s: Vec<f64>,
    /// How long ago the person was in this pose, at the end of the step it is used for, s.
    pub age_s: f64,
    /// Joints that are to be moved with care; empty: none.
    pub careful: Vec<bool>,
}

/// Follows targets inside limits. Starts and ends at rest.
#[derive(Clone, Debug)]
pub struct Follower {
    limits: Vec<JointLimits>,
    states: Vec<State>,
    /// Joints that use no more than [`APPROACH_SHARE`] of their limits: from when they are to be moved with care, and have braked
    /// so far that they could stop inside their range so, until they are no longer to be and have reached their target.
    careful: Vec<bool>,
    approaching: bool,
    stopping: Option<Stopping>,
    tally: FollowTally,
}

/// Joints that move no faster than this, root of the mean square, rad/s, say nothing of a delay.
const CREEP_RAD_S: f64 = 1e-3;

/// What following came to.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FollowTally {
    /// Samples, by joint, in which limits kept the joint more than [`REACHED_RAD`] from its target.
    pub limited_samples: Vec<u64>,
    /// Samples with a fresh target.
    pub followed_samples: u64,
    /// Samples in which there was no fresh target, so that the joints braked or stood.
    pub stale_samples: u64,
    /// Samples of approaches.
    pub approach_samples: u64,
    moved_behind: f64,
    moved: f64,
}

impl FollowTally {
    /// How far the joints ran behind their targets, s: the delay that explains the distances best
    /// (least squares over all joints while followed). `None` if nothing moved.
    #[must_use]
    pub fn lag_s(&self) -> Option<f64> {
        let least = self.followed_samples as f64 * CREEP_RAD_S * CREEP_RAD_S;
        (self.moved > least).then(|| self.moved_behind / self.moved)
    }
}

/// Position and velocity of a joint.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct State {
    q: f64,
    v: f64,
}

/// One goal that chases another by the law of this module.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Chase {
    /// Where the goal is, rad.
    pub position_rad: f64,
    /// How fast it moves, rad/s.
    pub velocity_rad_s: f64,
}

impl Chase {
    /// Where the goal is `dt_s` later, on the shortest way inside `limits` to `target`, which is
    /// where and how fast the other goal is then. It could come to rest inside the limits from
    /// there.
    #[must_use]
    pub fn toward(self, target: Self, dt_s: f64, limits: &JointLimits) -> Self {
        let bounds = Bounds::of(limits, 1.0);
        let before = State {
            q: target.position_rad - target.velocity_rad_s * dt_s,
            v: target.velocity_rad_s,
        };
        let mut state = State::from(self);
        state.intercept(before, dt_s, bounds);
        state.into()
    }

    /// Where the goal is `dt_s` later if it brakes at `rate_rad_s2`.
    #[must_use]
    pub fn braked(self, dt_s: f64, rate_rad_s2: f64) -> Self {
        let mut state = State::from(self);
        state.brake(dt_s, rate_rad_s2);
        state.into()
    }
}

impl From<Chase> for State {
    fn from(chase: Chase) -> Self {
        Self { q: chase.position_rad, v: chase.velocity_rad_s }
    }
}

impl From<State> for Chase {
    fn from(state: State) -> Self {
        Self { position_rad: state.q, velocity_rad_s: state.v }
    }
}

/// What a joint may do at the moment.
#[derive(Clone, Copy, Debug)]
struct Bounds {
    lower: f64,
    upper: f64,
    v: f64,
    a: f64,
}

/// A stop that was asked for.
#[derive(Clone, Debug)]
struct Stopping {
    elapsed_s: f64,
    /// By joint.
    ramps: Vec<Ramp>,
}

/// A joint's way to rest: speed `v (1 + cos(pi t / D)) / 2`, which goes `v D / 2` and whose
/// deceleration is `pi v / (2 D)` at most, and none at either end.
#[derive(Clone, Copy, Debug)]
struct Ramp {
    from: State,
    lasts_s: f64,
}

impl Ramp {
    /// The ramp of a joint that could brake at `bounds.a` inside its range.
    fn of(from: State, bounds: Bounds) -> Self {
        let speed = from.v.abs();
        if speed == 0.0 {
            return Self { from, lasts_s: 0.0 };
        }
        let room = if from.v > 0.0 { bounds.upper - from.q } else { from.q - bounds.lower };
        let braking_s = speed / bounds.a;
        // As far as a brake at the limit there is room, but for rounding.
        Self { from, lasts_s: (FRAC_PI_2 * braking_s).min(2.0 * room / speed).max(braking_s) }
    }

    fn at(&self, elapsed_s: f64) -> State {
        let left_s = self.lasts_s - elapsed_s;
        if !(left_s > 0.0) {
            return State { q: self.from.q + self.from.v * self.lasts_s / 2.0, v: 0.0 };
        }
        // As an easing clock backwards.
        let gone_s = self.lasts_s / 2.0 - eased_time_s(left_s, self.lasts_s);
        State {
            q: self.from.q + self.from.v * gone_s,
            v: self.from.v * eased_rate(left_s, self.lasts_s),
        }
    }
}

impl Follower {
    /// A follower for joints at rest at `present_rad`, which must be inside `limits`. Its first
    /// motion is an approach at [`APPROACH_SHARE`] of the limits.
    #[must_use]
    pub fn standing_at(present_rad: &[f64], limits: Vec<JointLimits>) -> Self {
        let states = present_rad.iter().zip(&limits).map(|(q, limits)| State {
            q: q.clamp(limits.lower_rad(), limits.upper_rad()),
            v: 0.0,
        });
        let states: Vec<State> = states.collect();
        let tally = FollowTally { limited_samples: vec![0; states.len()], ..Default::default() };
        let careful = vec![false; states.len()];
        Self { limits, states, careful, approaching: true, stopping: None, tally }
    }

    /// Begins to come to rest for good. Another stop changes nothing.
    pub fn stop(&mut self) {
        if self.stopping.is_none() {
            let joints = self.states.iter().zip(&self.limits).zip(&self.careful);
            let ramps = joints.map(|((state, limits), careful)| {
                Ramp::of(*state, Bounds::of(limits, self.share(*careful)))
            });
            let ramps = ramps.collect();
            self.stopping = Some(Stopping { elapsed_s: 0.0, ramps });
        }
    }

    /// True once it was told to come to rest for good.
    #[must_use]
    pub const fn is_stopping(&self) -> bool {
        self.stopping.is_some()
    }

    /// True if no joint moves.
    #[must_use]
    pub fn is_at_rest(&self) -> bool {
        self.states.iter().all(|state| state.v == 0.0)
    }

    /// True while the joints use a share of their limits only, to reach a target from rest.
    #[must_use]
    pub const fn is_approaching(&self) -> bool {
        self.approaching
    }

    /// Figures so far.
    #[must_use]
    pub const fn tally(&self) -> &FollowTally {
        &self.tally
    }

    /// Lets `dt_s` pass, at most 0.1 s, towards `target` if there is a fresh one, and says where
    /// the joints are then. A step that is negative or not a number counts as none.
    pub fn advance(&mut self, dt_s: f64, target: Option<&Target>, setpoints: &mut [Setpoint]) {
        let dt_s = dt_s.clamp(0.0, LONGEST_STEP_S);
        let dt_s = if dt_s.is_nan() { 0.0 } else { dt_s };
        let target = target.filter(|target| {
            target.age_s.abs() <= STALE_S
                && target.position_rad.len() == self.states.len()
                && target.velocity_rad_s.len() == self.states.len()
        });
        let target = target.filter(|_| !self.is_stopping());
        if target.is_none() {
            self.tally.stale_samples += u64::from(!self.is_stopping());
        }
        if let Some(stopping) = &mut self.stopping {
            stopping.elapsed_s += dt_s;
        }
        // Only a robot at rest is slowed down: a moving one might not be able to stop any more.
        self.approaching |= self.is_at_rest() && target.is_none();
        let (mut furthest, mut reached) = (0.0_f64, vec![None; self.states.len()]);
        for (joint, reached) in reached.iter_mut().enumerate() {
            let with_care = target.is_some_and(|of| of.careful.get(joint) == Some(&true));
            if with_care {
                self.begin_to_care(joint);
            }
            let bounds = Bounds::of(&self.limits[joint], self.share(self.careful[joint]));
            let state = &mut self.states[joint];
            let wanted = target.and_then(|target| bounds.wanted(target, joint, dt_s));
            let before = *state;
            match (&self.stopping, wanted) {
                (Some(stopping), _) => *state = stopping.ramps[joint].at(stopping.elapsed_s),
                // Until it can go on with care it brakes.
                (None, Some(_)) if with_care && !self.careful[joint] => {
                    state.brake(dt_s, bounds.a);
                }
                (None, Some(wanted)) => state.intercept(wanted, dt_s, bounds),
                (None, None) => state.brake(dt_s, bounds.a),
            }
            state.q = state.q.clamp(bounds.lower, bounds.upper);
            if let Some(wanted) = wanted {
                let now = State { q: bounds.held(wanted.q + wanted.v * dt_s), ..wanted };
                let off_rad = (now.q - state.q).abs();
                furthest = furthest.max(off_rad);
                *reached = Some(now);
                self.careful[joint] &= with_care || off_rad > NEAR_RAD;
            }
            if let Some(setpoint) = setpoints.get_mut(joint) {
                *setpoint = Setpoint {
                    position_rad: state.q,
                    velocity_rad_s: state.v,
                    acceleration_rad_s2: if dt_s > 0.0 { (state.v - before.v) / dt_s } else { 0.0 },
                };
            }
        }
        if target.is_some() {
            self.count(&reached);
            self.approaching &= furthest > NEAR_RAD;
        }
    }

    /// Share of the velocity and acceleration limits in use for a joint that is moved with care, or not.
    const fn share(&self, careful: bool) -> f64 {
        if self.approaching || careful { APPROACH_SHARE } else { 1.0 }
    }

    /// Moves a joint with care from now on if it could stop so.
    fn begin_to_care(&mut self, joint: usize) {
        let bounds = Bounds::of(&self.limits[joint], APPROACH_SHARE);
        self.careful[joint] |= self.states[joint].could_stop(bounds);
    }

    fn count(&mut self, wanted: &[Option<State>]) {
        if self.approaching {
            self.tally.approach_samples += 1;
            return;
        }
        self.tally.followed_samples += 1;
        for (joint, (wanted, state)) in wanted.iter().zip(&self.states).enumerate() {
            let Some(wanted) = wanted else { continue };
            let behind = wanted.q - state.q;
            self.tally.limited_samples[joint] += u64::from(!(behind.abs() <= REACHED_RAD));
            self.tally.moved_behind += behind * wanted.v;
            self.tally.moved += wanted.v * wanted.v;
        }
    }
}

impl Bounds {
    /// A share of a joint's limits, and its whole range.
    const fn of(limits: &JointLimits, share: f64) -> Self {
        Self {
            lower: limits.lower_rad(),
            upper: limits.upper_rad(),
            v: share * limits.velocity_rad_s(),
            a: share * limits.acceleration_rad_s2(),
        }
    }

    /// Where one joint is to be at the start of a step and how it is to move; none if that is no
    /// number.
    fn wanted(&self, target: &Target, joint: usize, dt_s: f64) -> Option<State> {
        let fastest = TARGET_VELOCITY_SHARE * self.v;
        let v = target.velocity_rad_s[joint].clamp(-fastest, fastest);
        let q = target.position_rad[joint] + v * (target.age_s - dt_s);
        if !(q.is_finite() && v.is_finite()) {
            return None;
        }
        let held = self.held(q);
        // A target beyond a limit waits there.
        Some(State { q: held, v: if held == q { v } else { 0.0 } })
    }

    fn held(&self, q: f64) -> f64 {
        q.clamp(self.lower, self.upper)
    }
}

impl State {
    /// True if it is no faster than the limits, and could come to rest inside the range at their acceleration.
    fn could_stop(&self, bounds: Bounds) -> bool {
        let stop = self.q + self.v * self.v.abs() / (2.0 * bounds.a);
        self.v.abs() <= bounds.v && stop <= bounds.upper && stop >= bounds.lower
    }

    /// Lets time pass on the way to meet a target that moves evenly.
    fn intercept(&mut self, target: Self, dt_s: f64, bounds: Bounds) {
        let (d, w) = (target.q - self.q, self.v - target.v);
        // Which way to accelerate first: where the joint would come to rest, as the target sees it.
        let short = d - w * w.abs() / (2.0 * bounds.a);
        let sign = if short >= 0.0 { 1.0 } else { -1.0 };
        let (d, w) = (sign * d, sign * w);
        let fastest = (bounds.v - sign * target.v).max(w);
        let peak = (bounds.a * d + w * w / 2.0).max(0.0).sqrt().max(w).min(fastest);
        let ramps = (2.0 * peak * peak - w * w) / (2.0 * bounds.a);
        let cruise_s = if peak > 0.0 { ((d - ramps) / peak).max(0.0) } else { 0.0 };
        let pieces = [
            (sign * bounds.a, (peak - w) / bounds.a),
            (0.0, cruise_s),
            (-sign * bounds.a, peak.max(0.0) / bounds.a),
        ];
        let mut left_s = dt_s;
        for (a, lasts_s) in pieces {
            let lasts_s = lasts_s.clamp(0.0, left_s);
            if !self.go(a, lasts_s, bounds) {
                return self.brake(left_s, bounds.a);
            }
            left_s -= lasts_s;
        }
        if left_s > 0.0 {
            // Met: from here on the joint is where the target is.
            self.v = target.v;
            if !self.go(0.0, left_s, bounds) {
                self.brake(left_s, bounds.a);
            }
        }
    }

    /// Lets `t_s` pass at acceleration `a`; false, and nothing changed, if the joint could not stop
    /// inside its limits any more then.
    fn go(&mut self, a: f64, t_s: f64, bounds: Bounds) -> bool {
        let v = self.v + a * t_s;
        let next = Self { q: self.q + (self.v + v) / 2.0 * t_s, v };
        let stop = next.q + v * v.abs() / (2.0 * bounds.a);
        let inside = stop <= bounds.upper && stop >= bounds.lower;
        if inside {
            *self = next;
        }
        inside
    }

    /// Lets time pass at deceleration `a`, to rest.
    fn brake(&mut self, dt_s: f64, a: f64) {
        let rest_s = self.v.abs() / a;
        if rest_s <= dt_s {
            self.q += self.v * rest_s / 2.0;
            self.v = 0.0;
        } else {
            let v = self.v - self.v.signum() * a * dt_s;
            self.q += (self.v + v) / 2.0 * dt_s;
            self.v = v;
        }
    }
}

#[cfg(test)]
mod tests;
