//! What turns the shaft: a stated model, not a measured one.
//!
//! Once a millisecond, like the servo's own control loop, with all angles those of the shaft:
//!
//! 1. The goal generator ([`ramp`]) gives the position asked for now.
//! 2. The position loop asks for the speed `K * error`; the motor's duty is that speed as a share
//!    of the speed without load, at most the duty limit. So a motion at constant speed v lags by v
//!    / K. `K` grows with the servo's P gain: raw / 8 per second for DYNAMIXEL (800 gives 100/s),
//!    raw * 3 per second for Feetech (32 gives 96/s). These factors are assumed, chosen so that a
//!    sine of 30 degrees at 1 Hz lags by about 2 degrees at factory gains. I and D gains are not
//!    modelled.
//! 3. Torque, as a share of the stall torque, is `duty * supply - v / v_free`, the line of every
//!    DC motor, less where a goal current limits it. It works on inertia with a mechanical time
//!    constant of 4 ms (assumed) and against a constant load of 2 % of the stall torque that pulls
//!    to negative angles, a stand-in for gravity (assumed).
//! 4. Current is torque's share of the stall current; the supply sags by 6 % at stall; the winding
//!    warms by 60 °C over 25 °C at stall with a time constant of 120 s (all assumed).
//!
//! Without torque the gears' friction holds the shaft where it is.

pub(crate) mod ramp;

use ramp::{Pace, Ramp};

/// Step of the servo's control loop, ns.
pub(crate) const STEP_NS: u64 = 1_000_000;
const STEP_S: f64 = 1e-3;
const MECHANICAL_TIME_CONSTANT_S: f64 = 4e-3;
const LOAD_RATIO: f64 = 0.02;
const SUPPLY_SAG_RATIO: f64 = 0.06;
const AMBIENT_C: f64 = 25.0;
const STALL_WARMING_C: f64 = 60.0;
const THERMAL_TIME_CONSTANT_S: f64 = 120.0;
/// Torque above this share of the stall torque for this long is an overload (assumed; the manuals
/// speak of "persistent load that exceeds maximum output").
const OVERLOAD_RATIO: f64 = 0.8;
const OVERLOAD_STEPS: u32 = 1000;

/// What the servo's firmware asks of the motor.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Drive {
    /// False: no torque.
    pub on: bool,
    /// Speed asked for per radian of error, 1/s.
    pub gain_per_s: f64,
    /// Highest duty, 0..1.
    pub duty_limit: f64,
    /// Highest torque as a share of the stall torque.
    pub torque_limit: f64,
}

/// Why [`Motor::advance`] came back.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Advance {
    /// The time asked for is reached.
    Done,
    /// The motor has been overloaded for too long at this moment; call again to go on.
    Overloaded,
}

/// A motor with gears, seen from its output shaft.
#[derive(Clone, Debug)]
pub(crate) struct Motor {
    free_speed: f64,
    stall_current_a: f64,
    supply_v: f64,
    decay: f64,
    now_ns: u64,
    position: f64,
    velocity: f64,
    drive: Drive,
    ramp: Ramp,
    ramp_start_ns: u64,
    pace: Pace,
    /// A shaft that is blocked does not turn, whatever the torque.
    pub blocked: bool,
    duty: f64,
    torque: f64,
    overload_steps: u32,
    temperature_c: f64,
}

impl Motor {
    pub fn new(facts: &gaitway_profiles::Motor, position_rad: f64) -> Motor {
        Motor {
            free_speed: facts.no_load_speed_rad_s,
            stall_current_a: facts.stall_current_a,
            supply_v: facts.voltage_v,
            decay: (-STEP_S / MECHANICAL_TIME_CONSTANT_S).exp(),
            now_ns: 0,
            position: position_rad,
            velocity: 0.0,
            drive: Drive { on: false, gain_per_s: 0.0, duty_limit: 0.0, torque_limit: 1.0 },
            ramp: Ramp::rest(position_rad),
            ramp_start_ns: 0,
            pace: Pace::Step,
            blocked: false,
            duty: 0.0,
            torque: 0.0,
            overload_steps: 0,
            temperature_c: AMBIENT_C + 5.0,
        }
    }

    /// Moves on to the last whole millisecond at or before `time_ns`.
    pub fn advance(&mut self, time_ns: u64) -> Advance {
        while self.now_ns + STEP_NS <= time_ns {
            if self.rests() {
                let steps = (time_ns - self.now_ns) / STEP_NS;
                self.now_ns += steps * STEP_NS;
                self.warm(steps as f64 * STEP_S);
                break;
            }
            self.now_ns += STEP_NS;
            self.step();
            if self.overload_steps >= OVERLOAD_STEPS {
                self.overload_steps = 0;
                return Advance::Overloaded;
            }
        }
        Advance::Done
    }

    /// True if nothing but the temperature can change by itself.
    fn rests(&self) -> bool {
        let still = self.velocity.abs() < 1e-9;
        if !self.drive.on {
            return still && self.torque == 0.0;
        }
        still
            && self.ramp_time_s() >= self.ramp.duration_s()
            && (self.torque - LOAD_RATIO).abs() < 1e-9
            && !self.blocked
    }

    fn step(&mut self) {
        let (target, _) = self.ramp.at(self.ramp_time_s());
        let load = if self.drive.on { LOAD_RATIO } else { 0.0 };
        self.duty = if self.drive.on {
            let limit = self.drive.duty_limit;
            (self.drive.gain_per_s / self.free_speed * (target - self.position))
                .clamp(-limit, limit)
        } else {
            0.0
        };
        let push = self.duty * self.supply_ratio();
        let limit = self.drive.torque_limit;
        let torque = push - self.velocity / self.free_speed;
        if self.blocked {
            self.velocity = 0.0;
            self.torque = push.clamp(-limit, limit);
        } else if torque.abs() > limit {
            self.torque = limit.copysign(torque);
            self.velocity +=
                (self.torque - load) * self.free_speed * STEP_S / MECHANICAL_TIME_CONSTANT_S;
            self.position += self.velocity * STEP_S;
        } else {
            let steady = self.free_speed * (push - load);
            let excess = self.velocity - steady;
            self.velocity = steady + excess * self.decay;
            self.position +=
                steady * STEP_S + excess * MECHANICAL_TIME_CONSTANT_S * (1.0 - self.decay);
            self.torque = if self.drive.on { push - self.velocity / self.free_speed } else { 0.0 };
        }
        let heavy = self.torque.abs() > OVERLOAD_RATIO;
        self.overload_steps = if heavy { self.overload_steps + 1 } else { 0 };
        self.warm(STEP_S);
    }

    fn warm(&mut self, seconds: f64) {
        let settled = AMBIENT_C + STALL_WARMING_C * self.torque * self.torque;
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

    /// A new goal, or the old one again, at the pace set.
    pub fn go_to(&mut self, goal_rad: f64, pace: Pace) {
        if goal_rad == self.ramp.goal_rad() && pace == self.pace {
            return;
        }
        let (from, velocity) = self.trajectory();
        self.ramp = Ramp::plan(from, velocity, goal_rad, pace);
        self.ramp_start_ns = self.now_ns;
        self.pace = pace;
    }

    /// The goal generator starts anew at rest where the shaft is.
    pub fn hold_here(&mut self) {
        self.ramp = Ramp::rest(self.position);
        self.ramp_start_ns = self.now_ns;
        self.pace = Pace::Step;
    }

    pub fn set_drive(&mut self, drive: Drive) {
        if !drive.on {
            self.torque = 0.0;
            self.duty = 0.0;
            self.overload_steps = 0;
        }
        self.drive = drive;
    }

    /// Position and velocity the goal generator asks for now, rad and rad/s.
    pub fn trajectory(&self) -> (f64, f64) {
        self.ramp.at(self.ramp_time_s())
    }

    /// True while the goal generator is on its way.
    pub fn under_way(&self) -> bool {
        self.ramp_time_s() < self.ramp.duration_s()
    }

    pub fn pace(&self) -> Pace {
        self.pace
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
        self.torque
    }

    pub fn current_a(&self) -> f64 {
        self.torque * self.stall_current_a
    }

    pub fn stall_current_a(&self) -> f64 {
        self.stall_current_a
    }

    fn supply_ratio(&self) -> f64 {
        1.0 - SUPPLY_SAG_RATIO * self.torque.abs()
    }

    pub fn voltage_v(&self) -> f64 {
        self.supply_v * self.supply_ratio()
    }

    pub fn temperature_c(&self) -> f64 {
        self.temperature_c
    }

    /// Time of the state, ns.
    pub fn now_ns(&self) -> u64 {
        self.now_ns
    }

    /// Turns the shaft by hand.
    pub fn place(&mut self, position_rad: f64) {
        self.position = position_rad;
        self.velocity = 0.0;
        self.hold_here();
    }

    pub fn set_temperature_c(&mut self, temperature_c: f64) {
        self.temperature_c = temperature_c;
    }

    pub fn set_supply_v(&mut self, supply_v: f64) {
        self.supply_v = supply_v;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    fn motor(gain_per_s: f64) -> Motor {
        let facts = gaitway_profiles::Motor {
            no_load_speed_rad_s: 8.0,
            stall_torque_nm: 3.0,
            stall_current_a: 2.3,
            voltage_v: 12.0,
            source: "test".into(),
        };
        let mut motor = Motor::new(&facts, 0.0);
        motor.set_drive(Drive { on: true, gain_per_s, duty_limit: 1.0, torque_limit: 1.0 });
        motor
    }

    const MS: u64 = STEP_NS;

    #[test]
    fn a_sine_of_30_degrees_at_1_hz_lags_by_one_to_three_degrees() {
        let mut motor = motor(100.0);
        let mut worst = 0.0_f64;
        for cycle in 0..200_u64 {
            let t = cycle as f64 * 0.01;
            let goal = 30_f64.to_radians() * (TAU * t).sin();
            motor.advance(cycle * 10 * MS);
            worst = worst.max((goal - motor.position_rad()).abs());
            motor.go_to(goal, Pace::Step);
        }
        let worst = worst.to_degrees();
        // 2 pi * 30 deg/s / 100 per s = 1.9 deg, plus up to one cycle of 10 ms at that speed.
        assert!((1.0..=4.0).contains(&worst), "{worst}");
    }

    #[test]
    fn a_step_settles_within_the_droop_the_load_makes_without_overshooting_much() {
        let mut motor = motor(100.0);
        motor.go_to(0.5, Pace::Step);
        let mut highest = 0.0_f64;
        for ms in 1..1000 {
            motor.advance(ms * MS);
            highest = highest.max(motor.position_rad());
        }
        assert!(highest <= 0.5 * 1.05, "{highest}");
        let droop = 0.5 - motor.position_rad();
        assert!((droop - 0.02 * 8.0 / 100.0).abs() <= 1e-4, "{droop}");
    }

    #[test]
    fn the_shaft_never_turns_faster_than_without_load() {
        let mut motor = motor(100.0);
        motor.go_to(20.0, Pace::Step);
        for ms in 1..3000 {
            motor.advance(ms * MS);
            assert!(motor.velocity_rad_s() <= 8.0);
        }
    }

    #[test]
    fn one_long_advance_equals_many_short_ones() {
        let (mut long, mut short) = (motor(100.0), motor(100.0));
        for motor in [&mut long, &mut short] {
            motor.go_to(1.0, Pace::Trapezoid { speed: 2.0, acceleration: 10.0 });
        }
        long.advance(5_000 * MS);
        for k in 0..=50_000 {
            short.advance(k * MS / 10);
        }
        assert_eq!(long.position_rad(), short.position_rad());
        assert!((long.temperature_c() - short.temperature_c()).abs() <= 1e-6);
    }

    #[test]
    fn a_blocked_shaft_stalls_and_trips_after_a_second() {
        let mut motor = motor(100.0);
        motor.advance(10 * MS);
        motor.blocked = true;
        motor.go_to(1.0, Pace::Step);
        assert_eq!(motor.advance(900 * MS), Advance::Done);
        assert!((motor.current_a() - 2.3).abs() < 0.2);
        assert_eq!(motor.advance(1_100 * MS), Advance::Overloaded);
        assert!(motor.temperature_c() > 30.0);
        assert!(motor.voltage_v() < 11.5);
    }

    #[test]
    fn without_torque_the_shaft_coasts_to_rest_and_stays() {
        let mut motor = motor(100.0);
        motor.go_to(5.0, Pace::Step);
        motor.advance(100 * MS);
        motor.set_drive(Drive { on: false, gain_per_s: 0.0, duty_limit: 0.0, torque_limit: 1.0 });
        motor.advance(400 * MS);
        let rest = motor.position_rad();
        motor.advance(10_000 * MS);
        assert_eq!(motor.position_rad(), rest);
        assert_eq!(motor.current_a(), 0.0);
    }
}
