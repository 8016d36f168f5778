//! What turns the shaft: a stated model, not a measured one.
//!
//! All angles are those of the output shaft; currents and torques are shares of those at stall. The
//! profile gives the facts of one supply voltage: speed without load w0, stall current, stall
//! torque. With duty u in -1..1, supply ratio s = voltage / nominal voltage, speed w and friction
//! f:
//!
//! ```text
//! current   i = s u - w / wi          wi = w0 / (1 - f): back-EMF; friction makes wi into w0
//! speed     T dw/dt = wi (i - load - f sign(w))            T = 4 ms: rotor, gears and load
//! heat      120 s dC/dt = 25 °C + 60 °C i² - C             winding, as the sensor sees it
//! supply    s = supply / nominal * (1 - 0.06 i u)          cable and battery sag by 6 % at stall
//! ```
//!
//! f = 3 %, and a constant load of 2 % pulls to negative angles, a stand-in for gravity; both, and
//! the figures above, are assumed. A shaft at rest stays while |s u - load| <= f, so one without
//! power stays where it is. A hand ([`crate::Hand`]) is taken from the load. Where a body
//! ([`crate::Body`]) turns the shaft, that has the weight: no load of 2 %, T is that of rotor and gears
//! alone, and friction is viscous below 2 mrad/s. Limits: |u| by the duty limit; |i| by the current limit.
//!
//! The firmware's side runs once a millisecond: the goal generator ([`ramp`]) gives position, speed
//! and acceleration asked for (p, v, a), and the law in force the duty:
//!
//! ```text
//! position  u = (k e + ki ∫e dt + kd (v - w) + ff1 v + ff2 a) / w0,  e = p - present
//! speed     u = (kp (v - w) + ki ∫(v - w) dt) / w0
//! current   the duty that makes i the current asked for, as far as the duty limit allows
//! duty      u as asked for;  brake: u = 0;  free: i = 0
//! ```
//!
//! Inside a dead zone e counts as 0, outside it is counted from the zone's edge and a least duty
//! ("punch") is added. The integral stands still while the duty is at its limit and while the error
//! is less than half an encoder count. The speed w inside the laws is continuous: each millisecond
//! is solved in closed form as an exponential, so that any damping is stable. A shaft at rest under
//! a constant goal costs nothing but the warming, which has a closed form over any time.

pub(crate) mod ramp;

use crate::hand::Grip;
use ramp::{Pace, Ramp, Shape, Target};

/// Step of the servo's control loop, ns.
pub(crate) const STEP_NS: u64 = 1_000_000;
const STEP_S: f64 = 1e-3;
const MECHANICAL_TIME_CONSTANT_S: f64 = 4e-3;
const FRICTION_RATIO: f64 = 0.03;
const LOAD_RATIO: f64 = 0.02;
const SUPPLY_SAG_RATIO: f64 = 0.06;
/// A hand lets go of a shaft that is slower, rad/s.
const STILL_RAD_S: f64 = 1e-3;
/// Friction of a shaft that a body carries is viscous below this speed, rad/s: it holds what it can hold
/// but for a tenth of a degree a second.
const CREEP_RAD_S: f64 = 2e-3;
/// What a blocked shaft of a body gives way, s/rad: next to nothing.
const BLOCKED_S_RAD: f64 = 1e6;
const AMBIENT_C: f64 = 25.0;
const STALL_WARMING_C: f64 = 60.0;
const THERMAL_TIME_CONSTANT_S: f64 = 120.0;

/// A load that must not last.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bound {
    /// Share of the stall torque, which is also that of the stall current.
    pub ratio: f64,
    /// How long it may be exceeded, s.
    pub time_s: f64,
}

/// How the firmware turns errors into duty; see the module.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Regulator {
    /// `k`, 1/s: where the goal lies at a lower angle than the shaft, and at a higher.
    pub position_p: [f64; 2],
    /// `ki`, 1/s².
    pub position_i: f64,
    /// `kd`.
    pub position_d: f64,
    /// `ff1`.
    pub feedforward_speed: f64,
    /// `ff2`, s.
    pub feedforward_acceleration_s: f64,
    /// Half widths of the dead zone, rad, in the order of `position_p`.
    pub dead_zone_rad: [f64; 2],
    /// Least duty outside the dead zone.
    pub punch: f64,
    /// `kp` of the speed law.
    pub speed_p: f64,
    /// `ki` of the speed law, 1/s.
    pub speed_i: f64,
    /// Highest duty, 0..1.
    pub duty_limit: f64,
    /// Highest current as a share of the stall current.
    pub current_limit: f64,
    pub overload: Bound,
    pub overcurrent: Bound,
}

impl Regulator {
    /// Nothing is regulated, nothing limited.
    pub const NONE: Regulator = Regulator {
        position_p: [0.0; 2],
        position_i: 0.0,
        position_d: 0.0,
        feedforward_speed: 0.0,
        feedforward_acceleration_s: 0.0,
        dead_zone_rad: [0.0; 2],
        punch: 0.0,
        speed_p: 0.0,
        speed_i: 0.0,
        duty_limit: 1.0,
        current_limit: f64::INFINITY,
        overload: Bound { ratio: f64::INFINITY, time_s: f64::INFINITY },
        overcurrent: Bound { ratio: f64::INFINITY, time_s: f64::INFINITY },
    };
}

/// The law in force.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Law {
    Free,
    Brake,
    Position,
    Speed,
    /// Share of the stall current.
    Current(f64),
    Duty(f64),
}

/// What a motor that a body carries does to its shaft.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Pushed {
    /// Share of the stall torque while the shaft stands still.
    pub torque_ratio: f64,
    /// How much less that is for each rad/s, s/rad.
    pub gives_s_rad: f64,
    /// The part of it that is the motor's own current.
    current_gives_s_rad: f64,
}

/// Why [`Motor::advance`] came back.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Advance {
    /// The time asked for is reached.
    Done,
    /// A bound of the regulator has been exceeded for too long at this moment; call again to go on.
    Overloaded,
    Overcurrent,
}

/// A motor with gears, seen from its output shaft.
#[derive(Clone, Debug)]
pub(crate) struct Motor {
    free_speed: f64,
    /// `wi`: speed at which back-EMF meets the nominal voltage.
    ideal_speed: f64,
    stall_current_a: f64,
    nominal_v: f64,
    supply_v: f64,
    /// Half an encoder count, rad.
    half_count_rad: f64,
    now_ns: u64,
    position: f64,
    velocity: f64,
    law: Law,
    regulator: Regulator,
    ramp: Ramp,
    ramp_start_ns: u64,
    pace: Pace,
    /// What the integral adds to the speed asked for, rad/s.
    integral: f64,
    /// A shaft that is blocked does not turn, whatever the torque.
    blocked: bool,
    /// Somebody has it in hand.
    grip: Option<Grip>,
    /// What the hand gives, as a share of the stall torque.
    by_hand: f64,
    duty: f64,
    current: f64,
    overload_s: f64,
    overcurrent_s: f64,
    temperature_c: f64,
    /// Nothing but the temperature changes until something is asked for.
    settled: bool,
    /// `exp(-step / time constant)` for the damping it was worked out for.
    decay: (f64, f64),
    /// A body turns the shaft: time passes only step by step with it.
    carried: Option<Pushed>,
}

impl Motor {
    pub fn new(facts: &gaitway_profiles::Motor, radians_per_count: f64) -> Motor {
        Motor {
            free_speed: facts.no_load_speed_rad_s,
            ideal_speed: facts.no_load_speed_rad_s / (1.0 - FRICTION_RATIO),
            stall_current_a: facts.stall_current_a,
            nominal_v: facts.voltage_v,
            supply_v: facts.voltage_v,
            half_count_rad: 0.5 * radians_per_count,
            now_ns: 0,
            position: 0.0,
            velocity: 0.0,
            law: Law::Free,
            regulator: Regulator::NONE,
            ramp: Ramp::rest(0.0),
            ramp_start_ns: 0,
            pace: Pace::Step,
            integral: 0.0,
            blocked: false,
            grip: None,
            by_hand: 0.0,
            duty: 0.0,
            current: 0.0,
            overload_s: 0.0,
            overcurrent_s: 0.0,
            temperature_c: AMBIENT_C + 5.0,
            settled: false,
            decay: (f64::NAN, 0.0),
            carried: None,
        }
    }

    /// Moves on to the last whole millisecond at or before `time_ns`.
    pub fn advance(&mut self, time_ns: u64) -> Advance {
        while self.carried.is_none() && self.now_ns + STEP_NS <= time_ns {
            if self.settled {
                let steps = (time_ns - self.now_ns) / STEP_NS;
                self.now_ns += steps * STEP_NS;
                self.warm(steps as f64 * STEP_S);
                break;
            }
            self.now_ns += STEP_NS;
            self.step();
            let exceeded = self.exceeded();
            if exceeded != Advance::Done {
                return exceeded;
            }
        }
        Advance::Done
    }

    fn exceeded(&mut self) -> Advance {
        if self.overload_s >= self.regulator.overload.time_s {
            self.overload_s = 0.0;
            return Advance::Overloaded;
        }
        if self.overcurrent_s >= self.regulator.overcurrent.time_s {
            self.overcurrent_s = 0.0;
            return Advance::Overcurrent;
        }
        Advance::Done
    }

    /// From here on a body turns the shaft; friction and load of its own it has no more.
    pub fn carry(&mut self) {
        self.carried = Some(Pushed::default());
        self.settled = false;
    }

    /// The shaft turns by itself again.
    pub fn put_down(&mut self) {
        self.carried = None;
    }

    /// The next step of a shaft that a body turns: what the motor does to it, and whether a bound was
    /// exceeded for too long. Where the shaft goes, [`Motor::carry_to`] says.
    pub fn push_body(&mut self) -> (Pushed, Advance) {
        self.now_ns += STEP_NS;
        self.step();
        let exceeded = self.exceeded();
        (self.carried.unwrap_or_default(), exceeded)
    }

    /// Where a body has turned the shaft in the step.
    pub fn carry_to(&mut self, position_rad: f64, velocity_rad_s: f64) {
        let gives = self.carried.map_or(0.0, |pushed| pushed.current_gives_s_rad);
        self.current -= gives * (velocity_rad_s - self.velocity);
        (self.position, self.velocity) = (position_rad, velocity_rad_s);
    }

    /// What turns with the motor, as the share of the stall torque for each rad/s².
    pub fn inertia_ratio_s2_rad(&self) -> f64 {
        MECHANICAL_TIME_CONSTANT_S / self.ideal_speed
    }

    /// What the motor gives a shaft at rest, and how much less for each rad/s, goes to the body.
    fn give(&mut self, torque_ratio: f64, gives_s_rad: f64) {
        let pushed = if self.blocked {
            Pushed { torque_ratio: 0.0, gives_s_rad: BLOCKED_S_RAD, current_gives_s_rad: 0.0 }
        } else {
            let friction = FRICTION_RATIO / self.velocity.abs().max(CREEP_RAD_S);
            Pushed {
                torque_ratio: torque_ratio + self.by_hand,
                gives_s_rad: gives_s_rad + friction,
                current_gives_s_rad: gives_s_rad,
            }
        };
        self.carried = Some(pushed);
    }

    fn step(&mut self) {
        self.feel_the_hand();
        let target = self.trajectory();
        let (open_duty, damping) = self.duty_asked(&target);
        let limit = self.regulator.duty_limit;
        let duty = open_duty - damping * self.velocity;
        let saturated = duty.abs() > limit;
        let (open_duty, damping) =
            if saturated { (limit.copysign(duty), 0.0) } else { (open_duty, damping) };
        let supply = self.supply_ratio();
        let current = supply * (open_duty - damping * self.velocity) - self.back_emf();
        let before = (self.velocity, self.integral);
        match self.law {
            Law::Free => self.turn_by_torque(0.0),
            Law::Current(asked) if asked.abs() < current * 1_f64.copysign(asked) => {
                self.turn_by_torque(asked);
            }
            _ if current.abs() > self.regulator.current_limit => {
                self.turn_by_torque(self.regulator.current_limit.copysign(current));
            }
            _ => self.turn_by_duty(supply, open_duty, damping),
        }
        self.duty = match self.law {
            Law::Free | Law::Brake => 0.0,
            // What the current's controller gives.
            _ => ((self.current + self.back_emf()) / supply).clamp(-limit, limit),
        };
        if !saturated {
            self.integrate(&target);
        }
        let over_s = |seconds: f64, bound: Bound| {
            if self.current.abs() > bound.ratio { seconds + STEP_S } else { 0.0 }
        };
        let over = (
            over_s(self.overload_s, self.regulator.overload),
            over_s(self.overcurrent_s, self.regulator.overcurrent),
        );
        (self.overload_s, self.overcurrent_s) = over;
        self.settled = before == (0.0, self.integral)
            && self.grip.is_none()
            && self.carried.is_none()
            && self.velocity == 0.0
            && over == (0.0, 0.0)
            && !self.under_way()
            && self.ramp.end_velocity() == 0.0;
        self.warm(STEP_S);
    }

    /// The duty the law asks for at rest, and how much less per rad/s of speed.
    fn duty_asked(&self, target: &Target) -> (f64, f64) {
        let law = &self.regulator;
        match self.law {
            Law::Free | Law::Brake => (0.0, 0.0),
            // As much as it takes: the current decides.
            Law::Current(asked) => (law.duty_limit.copysign(asked), 0.0),
            Law::Duty(duty) => (duty, 0.0),
            Law::Speed => {
                let asked = law.speed_p * target.velocity + self.integral;
                (asked / self.free_speed, law.speed_p / self.free_speed)
            }
            Law::Position => {
                let error = target.position - self.position;
                let side = usize::from(error > 0.0);
                let beyond = (error.abs() - law.dead_zone_rad[side]).max(0.0);
                let punch = if beyond > 0.0 { law.punch.copysign(error) } else { 0.0 };
                let asked = law.position_p[side] * beyond.copysign(error)
                    + self.integral
                    + (law.position_d + law.feedforward_speed) * target.velocity
                    + law.feedforward_acceleration_s * target.acceleration;
                (asked / self.free_speed + punch, law.position_d / self.free_speed)
            }
        }
    }

    fn integrate(&mut self, target: &Target) {
        match self.law {
            Law::Speed => {
                self.integral +=
                    self.regulator.speed_i * (target.velocity - self.velocity) * STEP_S;
            }
            Law::Position => {
                let error = target.position - self.position;
                if error.abs() > self.half_count_rad {
                    self.integral += self.regulator.position_i * error * STEP_S;
                }
            }
            _ => {}
        }
    }

    fn back_emf(&self) -> f64 {
        self.velocity / self.ideal_speed
    }

    /// Load, friction and hand against a push from the motor; none if the shaft stays at rest.
    fn resistance(&self, push: f64) -> Option<f64> {
        let push = push + self.by_hand - LOAD_RATIO;
        let way = if self.velocity == 0.0 { push } else { self.velocity };
        let stays = self.velocity == 0.0 && way.abs() <= FRICTION_RATIO;
        let held_back = LOAD_RATIO - self.by_hand + FRICTION_RATIO.copysign(way);
        (!stays && !self.blocked).then_some(held_back)
    }

    /// One step under a constant current.
    fn turn_by_torque(&mut self, current: f64) {
        self.current = current;
        if self.carried.is_some() {
            self.give(current, 0.0);
            return;
        }
        let Some(resistance) = self.resistance(current) else {
            self.velocity = 0.0;
            return;
        };
        let was = self.velocity;
        let change = (current - resistance) * self.ideal_speed * STEP_S;
        self.velocity += change / MECHANICAL_TIME_CONSTANT_S;
        self.move_on(was, 0.5 * (was + self.velocity) * STEP_S);
    }

    /// One step under a duty that falls with the speed by `damping`.
    fn turn_by_duty(&mut self, supply: f64, open_duty: f64, damping: f64) {
        let push = supply * open_duty;
        if self.carried.is_some() {
            self.give(push, supply * damping + 1.0 / self.ideal_speed);
        } else if let Some(resistance) = self.resistance(push) {
            let stiffness = 1.0 + self.ideal_speed * damping;
            if self.decay.0 != stiffness {
                let exponent = -STEP_S * stiffness / MECHANICAL_TIME_CONSTANT_S;
                self.decay = (stiffness, exponent.exp());
            }
            let was = self.velocity;
            let steady = self.ideal_speed * (push - resistance) / stiffness;
            let excess = was - steady;
            let decay = self.decay.1;
            self.velocity = steady + excess * decay;
            let lost = excess * MECHANICAL_TIME_CONSTANT_S / stiffness * (1.0 - decay);
            self.move_on(was, steady * STEP_S + lost);
        } else {
            self.velocity = 0.0;
        }
        self.current = supply * (open_duty - damping * self.velocity) - self.back_emf();
    }

    /// Ends a step that began at speed `was`. Friction never turns a shaft back: one that comes to
    /// rest within the step is at rest until the next.
    fn move_on(&mut self, was: f64, way_rad: f64) {
        if was * self.velocity < 0.0 {
            self.velocity = 0.0;
        }
        self.position += way_rad;
    }

    fn warm(&mut self, seconds: f64) {
        let settled = AMBIENT_C + STALL_WARMING_C * self.current * self.current;
        let excess = self.temperature_c - settled;
        // One millisecond is short enough for the tangent.
        self.temperature_c = if seconds <= STEP_S {
            self.temperature_c - excess * seconds / THERMAL_TIME_CONSTANT_S
        } else {
            settled + excess * (-seconds / THERMAL_TIME_CONSTANT_S).exp()
        };
    }

    fn ramp_time_s(&self) -> f64 {
        (self.now_ns - self.ramp_start_ns) as f64 * 1e-9
    }

    fn begin(&mut self, law: Law, ramp: Ramp, pace: Pace) {
        if std::mem::discriminant(&law) != std::mem::discriminant(&self.law) {
            self.integral = 0.0;
        }
        self.law = law;
        self.ramp = ramp;
        self.ramp_start_ns = self.now_ns;
        self.pace = pace;
        self.settled = false;
    }

    /// Where a new ramp starts: the goal generator if it is in force, else the shaft.
    fn generator(&self, law: Law) -> Target {
        if self.law == law {
            return self.trajectory();
        }
        Target { position: self.position, velocity: self.velocity, acceleration: 0.0 }
    }

    /// A new goal, or the old one again, at this pace.
    pub fn go_to(&mut self, goal_rad: f64, pace: Pace) {
        let same = goal_rad == self.ramp.goal_rad() && pace == self.pace;
        if same && self.law == Law::Position {
            return;
        }
        let from = self.generator(Law::Position);
        let ramp = Ramp::to_position(from.position, from.velocity, goal_rad, pace);
        self.begin(Law::Position, ramp, pace);
    }

    /// Turns at this speed, rad/s; of the pace only the ramp counts.
    pub fn spin(&mut self, velocity_rad_s: f64, pace: Pace) {
        let same = velocity_rad_s == self.ramp.end_velocity() && pace == self.pace;
        if same && self.law == Law::Speed {
            return;
        }
        let from = self.generator(Law::Speed);
        let ramp = Ramp::to_velocity(from.position, from.velocity, velocity_rad_s, pace);
        self.begin(Law::Speed, ramp, pace);
    }

    /// Gives this current, A.
    pub fn push(&mut self, current_a: f64) {
        let law = Law::Current(current_a / self.stall_current_a);
        self.begin(law, Ramp::rest(self.position), Pace::Step);
    }

    /// Gives this duty, -1..1.
    pub fn apply(&mut self, duty: f64) {
        self.begin(Law::Duty(duty), Ramp::rest(self.position), Pace::Step);
    }

    /// The goal generator starts anew at rest where the shaft is, and the shaft is held there.
    pub fn hold_here(&mut self) {
        self.integral = 0.0;
        self.begin(Law::Position, Ramp::rest(self.position), Pace::Step);
    }

    /// No torque.
    pub fn release(&mut self) {
        self.let_go(Law::Free);
    }

    /// The terminals are shorted: the shaft resists being turned.
    pub fn brake(&mut self) {
        self.let_go(Law::Brake);
    }

    fn let_go(&mut self, law: Law) {
        if self.law != law {
            self.begin(law, Ramp::rest(self.position), Pace::Step);
            (self.duty, self.current) = (0.0, 0.0);
            (self.overload_s, self.overcurrent_s) = (0.0, 0.0);
        }
    }

    pub fn set_regulator(&mut self, regulator: Regulator) {
        if regulator != self.regulator {
            self.regulator = regulator;
            self.settled = false;
        }
    }

    pub fn set_blocked(&mut self, blocked: bool) {
        self.blocked = blocked;
        self.settled = false;
    }

    /// What the goal generator asks for now.
    pub fn trajectory(&self) -> Target {
        match self.law {
            Law::Position | Law::Speed => self.ramp.at(self.ramp_time_s()),
            _ => Target { position: self.position, velocity: 0.0, acceleration: 0.0 },
        }
    }

    /// True while the goal generator is on its way.
    pub fn under_way(&self) -> bool {
        self.ramp_time_s() < self.ramp.duration_s()
    }

    /// Where the goal generator is or will come to rest, rad.
    pub fn goal_rad(&self) -> f64 {
        if self.law == Law::Position { self.ramp.goal_rad() } else { self.position }
    }

    pub fn shape(&self) -> Shape {
        self.ramp.shape()
    }

    pub fn position_rad(&self) -> f64 {
        self.position
    }

    pub fn velocity_rad_s(&self) -> f64 {
        self.velocity
    }

    pub fn free_speed_rad_s(&self) -> f64 {
        self.free_speed
    }

    /// Share of the full duty the bridge gives, -1..1.
    pub fn duty(&self) -> f64 {
        self.duty
    }

    /// Share of the stall torque, -1..1.
    pub fn torque_ratio(&self) -> f64 {
        self.current
    }

    pub fn current_a(&self) -> f64 {
        self.current * self.stall_current_a
    }

    pub fn stall_current_a(&self) -> f64 {
        self.stall_current_a
    }

    fn supply_ratio(&self) -> f64 {
        self.voltage_v() / self.nominal_v
    }

    pub fn voltage_v(&self) -> f64 {
        self.supply_v * (1.0 - SUPPLY_SAG_RATIO * (self.current * self.duty).clamp(0.0, 1.0))
    }

    pub fn temperature_c(&self) -> f64 {
        self.temperature_c
    }

    /// Time of the state, ns.
    pub fn now_ns(&self) -> u64 {
        self.now_ns
    }

    /// Turns the shaft by hand; under torque it is held where it was put.
    pub fn place(&mut self, position_rad: f64) {
        self.position = position_rad;
        self.velocity = 0.0;
        self.begin(self.law, Ramp::rest(position_rad), Pace::Step);
    }

    /// Somebody takes the shaft and brings it to `to_rad`, with at most `most` of the stall torque.
    pub fn grip(&mut self, to_rad: f64, speed_rad_s: f64, most: f64, holds_on: bool) {
        self.grip = Some(Grip::new(self.position, to_rad, speed_rad_s, most, holds_on));
        self.settled = false;
    }

    /// Nobody has the shaft in hand any more.
    pub fn let_go_of(&mut self) {
        (self.grip, self.by_hand) = (None, 0.0);
        self.settled = false;
    }

    pub fn is_in_hand(&self) -> bool {
        self.grip.is_some()
    }

    fn feel_the_hand(&mut self) {
        let Some(grip) = &mut self.grip else { return };
        // Speed per second for each share of the stall torque.
        let inertia = MECHANICAL_TIME_CONSTANT_S / self.ideal_speed;
        self.by_hand = grip.force(STEP_S, (self.position, self.velocity), inertia);
        if self.velocity.abs() < STILL_RAD_S && grip.is_done(self.position) {
            self.let_go_of();
        }
    }

    pub fn set_temperature_c(&mut self, temperature_c: f64) {
        self.temperature_c = temperature_c;
    }

    pub fn set_supply_v(&mut self, supply_v: f64) {
        self.supply_v = supply_v;
        self.settled = false;
    }
}

#[cfg(test)]
mod tests;
