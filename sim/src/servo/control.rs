//! Between the control table and the motor: what goals and gains ask of it, what it reports.
//!
//! Gains, as the laws of [`crate::motor`] want them. The manuals give ratios and no output unit;
//! one factor for each family is assumed, such that factory P gains turn an error of 1 rad into
//! about 100 rad/s of speed asked for (a sine of 30 degrees at 1 Hz then lags by about 2 degrees).
//!
//! - DYNAMIXEL 2.0 (e-Manual, Position PID Gain): P / 128, I / 65,536, D / 16, feed-forward / 4
//!   each, worked out every millisecond on pulses. With 16 /s for 1 of P / 128: k = P / 8, ki = I
//!   16,000 / 65,536, kd = D / 1000, ff1 = FF1 / 250, ff2 = FF2 4e-6 s. Speed law: P / 128 and I /
//!   65,536 in Goal PWM's unit (885 is all) on 0.229 rev/min. Current-based position mode gives
//!   what position mode gives, with the current limited to Goal Current; Goal PWM limits the duty
//!   in both.
//! - DYNAMIXEL P, PRO and Y: their manuals give no ratios; their factory gains make what those of the X
//!   series make (assumed).
//! - MX with protocol 1.0, and XL-320: P / 8, I 1000 / 2048, D 4 / 1000, with 24 /s for 1 of P / 8.
//!   AX: P = 1024 / slope by MX's table of slope and P, the margin is a dead zone, Punch / 1023 the
//!   least duty.
//! - FEETECH: k = 3 P, kd = 0.003 D, ki = 3 I; speed law kp = P / 20, ki = I / 20 (all assumed).
//!
//! Decisions where the manuals are silent:
//! - After a change of mode Goal PWM and Goal Current hold their limits (e-Manual, Operating
//!   Mode(11)); in PWM and current mode the motor gives nothing before a goal was written.
//! - A profile register counts from the next goal on (DYNAMIXEL 2.0). Speed, acceleration and time
//!   of the others count at once.
//! - Profile Velocity counts in current-based position mode too; the manual names it in one list
//!   and leaves it out in another.
//! - AX: writing a goal brings the torque on (told by users, not by the manual).
//! - FEETECH goal speed 0 is stop in speed mode. In position and step mode it is no limit, for
//!   hosts that never write a speed expect to move, or what bit 3 of Phase(18) says: [`ZeroSpeed`].
//!   Step mode counts from where the last step ends. SCS's running time, if it is not 0, goes
//!   before the speed.
//! - FEETECH torque is off at power-up and waits for its register, or what
//!   [`crate::TorqueSwitch`] says.
//!
//! - Goals may be written while the torque is off, and stand when it comes on.
//!
//! Not modelled: dual joints (Drive Mode(10), bit 1), PWM Slope, Feetech's Phase but for bits 3 and
//! 4, the current of XC330 at the supply's side (it is the motor's here). Protocol Type(13) is a
//! register only: the servo goes on in protocol 2.0.

use super::{Event, Servo};
use crate::motor::Regulator;
use crate::motor::ramp::{Pace, Shape};
use crate::world::ZeroSpeed;
use gaitway_profiles::{Encoding, Mode, Protocol, Role};

/// Speed asked for by an error of 1 rad at most; the loop runs at 1 kHz and a stiffer one swings.
const MAX_GAIN_PER_S: f64 = 400.0;
const DYNAMIXEL2_GAIN_PER_S: f64 = 16.0;
/// Steps of the servo's control loop in a second.
const STEPS_PER_S: f64 = 1000.0;
const DYNAMIXEL1_GAIN_PER_S: f64 = 24.0;
const FEETECH_GAIN_PER_S: f64 = 3.0;
/// Speed law of servos that have no gains for it (MX with protocol 1.0).
const SPEED_GAINS: (f64, f64) = (1.0, 10.0);
/// Goal PWM's full scale and Goal Velocity's unit, rad/s.
const PWM_COUNTS: f64 = 885.0;
const SPEED_UNIT_RAD_S: f64 = 0.229 * std::f64::consts::TAU / 60.0;
/// Counts of a turn of X and MX servos.
const X_COUNTS: u32 = 4096;
/// Error within which Moving Status says "in position" (assumed), rad.
const IN_POSITION_RAD: f64 = 0.01;
/// Error from which it says "following error" (assumed), rad.
const FOLLOWING_ERROR_RAD: f64 = 0.1;
/// Speed from which a servo without a threshold of its own counts as moving (assumed), rad/s.
const MOVING_RAD_S: f64 = 0.02;
pub(super) const TIME_BASED: i64 = 0x04;

/// Phase(18) of FEETECH: 1 = goal speed 0 is as fast as it can, 0 = stop.
const PHASE_ZERO_IS_FULL: i64 = 1 << 3;

/// Which goals were written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Fresh {
    /// Goal Position.
    pub position: bool,
    /// Goal Velocity, Current, PWM or Time.
    pub other: bool,
    /// Something that says how fast to go.
    pub pace: bool,
}

impl Servo {
    pub fn torque_on(&self) -> bool {
        self.value(Role::TorqueEnable).is_some_and(|raw| raw != 0)
    }

    pub(super) fn follows_positions(&self) -> bool {
        match self.mode() {
            Mode::Position | Mode::ExtendedPosition | Mode::CurrentBasedPosition | Mode::Step => {
                true
            }
            Mode::Velocity | Mode::Current | Mode::Pwm => false,
        }
    }

    /// A change of mode brings gains and profile back to their defaults and goals to their limits
    /// (DYNAMIXEL 2.0).
    pub(super) fn mode_defaults(&mut self) {
        for role in [
            Role::PositionPGain,
            Role::PositionIGain,
            Role::PositionDGain,
            Role::VelocityPGain,
            Role::VelocityIGain,
            Role::Feedforward1stGain,
            Role::Feedforward2ndGain,
            Role::ProfileAcceleration,
            Role::ProfileVelocity,
        ] {
            if let Some(item) = self.model.role(role) {
                let initial = item.initial;
                self.put(role, initial);
            }
        }
        self.goals_to_limits();
    }

    pub(super) fn goals_to_limits(&mut self) {
        for (role, limit) in [
            (Role::GoalPwm, Role::PwmLimit),
            (Role::GoalCurrent, Role::CurrentLimit),
            (Role::TorqueLimit, Role::MaxTorque),
        ] {
            if let Some(raw) = self.value(limit) {
                self.put(role, raw);
            }
        }
    }

    /// Gains and limits as the table has them now.
    pub(super) fn update_regulator(&mut self) {
        let mut regulator = match self.model.protocol {
            Protocol::Dynamixel2 if self.has_profile() => self.dynamixel2_gains(),
            Protocol::Dynamixel1 if self.has_compliance() => self.compliance(),
            Protocol::Dynamixel1 | Protocol::Dynamixel2 => self.dynamixel1_gains(),
            Protocol::FeetechSts | Protocol::FeetechScs => self.feetech_gains(),
        };
        for gain in &mut regulator.position_p {
            *gain = gain.min(MAX_GAIN_PER_S);
        }
        let mode = self.mode();
        let duty = match mode {
            Mode::Pwm if self.has_profile() => self.si(Role::PwmLimit),
            _ if self.has_profile() => self.si(Role::GoalPwm).map(f64::abs),
            _ => self.si(Role::TorqueLimit),
        };
        let spared = self.protective_limit().unwrap_or(1.0);
        regulator.duty_limit = duty.unwrap_or(1.0).min(spared).min(1.0);
        if mode == Mode::CurrentBasedPosition {
            let stall_a = self.motor.stall_current_a();
            let goal_a = self.si(Role::GoalCurrent).map_or(stall_a, f64::abs);
            regulator.current_limit = goal_a / stall_a;
        }
        regulator.overload = self.overload_bound();
        regulator.overcurrent = self.overcurrent_bound();
        self.motor.set_regulator(regulator);
    }

    fn gain(&self, role: Role) -> f64 {
        self.value(role).unwrap_or(0) as f64
    }

    /// Gains of another family than X and MX (P, PRO, Y) have units of their own: the factory's make its
    /// servos as stiff as the X series' factory gain does.
    fn gain_like_x(&self, role: Role, of: Role, factory_of_x: f64) -> f64 {
        let profile = &self.model.profile;
        let factory = profile.register(of).and_then(|register| register.initial);
        match factory.filter(|&factory| factory > 0 && profile.position.counts != X_COUNTS) {
            Some(factory) => self.gain(role) * factory_of_x / factory as f64,
            None => self.gain(role),
        }
    }

    fn dynamixel2_gains(&self) -> Regulator {
        let unit = DYNAMIXEL2_GAIN_PER_S;
        let per_speed = self.motor.free_speed_rad_s() / SPEED_UNIT_RAD_S / PWM_COUNTS;
        let position = |role| self.gain_like_x(role, Role::PositionPGain, 800.0);
        let speed_p = self.gain_like_x(Role::VelocityPGain, Role::VelocityPGain, 100.0);
        let speed_i = self.gain_like_x(Role::VelocityIGain, Role::VelocityIGain, 1920.0);
        Regulator {
            position_p: [unit * position(Role::PositionPGain) / 128.0; 2],
            position_i: unit * STEPS_PER_S * position(Role::PositionIGain) / 65_536.0,
            position_d: unit / STEPS_PER_S * position(Role::PositionDGain) / 16.0,
            feedforward_speed: unit / STEPS_PER_S * position(Role::Feedforward1stGain) / 4.0,
            feedforward_acceleration_s: unit / STEPS_PER_S / STEPS_PER_S
                * position(Role::Feedforward2ndGain)
                / 4.0,
            speed_p: per_speed * speed_p / 128.0,
            speed_i: per_speed * STEPS_PER_S * speed_i / 65_536.0,
            ..Regulator::NONE
        }
    }

    fn dynamixel1_gains(&self) -> Regulator {
        let unit = DYNAMIXEL1_GAIN_PER_S;
        Regulator {
            position_p: [unit * self.gain(Role::PositionPGain) / 8.0; 2],
            position_i: unit * self.gain(Role::PositionIGain) * 1000.0 / 2048.0,
            position_d: unit * self.gain(Role::PositionDGain) * 4.0 / 1000.0,
            punch: self.gain(Role::Punch) / 1023.0,
            speed_p: SPEED_GAINS.0,
            speed_i: SPEED_GAINS.1,
            ..Regulator::NONE
        }
    }

    /// The side of a slope or margin is that on which the shaft stands, seen from the goal.
    fn compliance(&self) -> Regulator {
        let slope = |role| {
            // What counts is the highest power of two in the value, 2 to 128.
            let slope = (self.value(role).unwrap_or(32).clamp(2, 255) as u64).ilog2().min(7);
            DYNAMIXEL1_GAIN_PER_S / 8.0 * 1024.0 / f64::from(1_u32 << slope)
        };
        let margin = |role| self.si(role).unwrap_or(0.0);
        Regulator {
            position_p: [slope(Role::CcwComplianceSlope), slope(Role::CwComplianceSlope)],
            dead_zone_rad: [margin(Role::CcwComplianceMargin), margin(Role::CwComplianceMargin)],
            punch: self.gain(Role::Punch) / 1023.0,
            ..Regulator::NONE
        }
    }

    fn feetech_gains(&self) -> Regulator {
        let unit = FEETECH_GAIN_PER_S;
        let zone = |role| self.si(role).unwrap_or(0.0);
        Regulator {
            position_p: [unit * self.gain(Role::PositionPGain); 2],
            position_i: unit * self.gain(Role::PositionIGain),
            position_d: unit / STEPS_PER_S * self.gain(Role::PositionDGain),
            dead_zone_rad: [zone(Role::CcwDeadZone), zone(Role::CwDeadZone)],
            punch: self.si(Role::MinStartupForce).unwrap_or(0.0),
            speed_p: self.gain(Role::VelocityPGain) / 20.0,
            speed_i: self.gain(Role::VelocityIGain) / 20.0,
            ..Regulator::NONE
        }
    }

    /// Torque has come on.
    pub(super) fn engage(&mut self) {
        if self.model.protocol == Protocol::Dynamixel2 && self.mode() == Mode::Position {
            self.forget_turns();
        }
        self.note_turn();
        let present = self.present_position();
        let mut error_rad = 0.0;
        if self.follows_positions() && self.mode() != Mode::Step {
            error_rad = self.goal_rad() - self.shaft_rad(present);
        }
        let goal = self.value(Role::GoalPosition).unwrap_or(present);
        self.events.push(Event::TorqueOn { goal, present, error_rad });
        self.stand_still();
        let step = self.mode() == Mode::Step;
        self.pursue(Fresh { position: !step, other: true, pace: false });
    }

    /// Tells the referee of a goal that was written, or refused.
    pub(super) fn note_goal(&mut self, raw: i64, accepted: bool) {
        let off_rad = self.goal_rad() - self.shaft_rad(self.present_position());
        let speed_rad_s = self.motor.velocity_rad_s();
        self.events.push(Event::Goal { raw, accepted, off_rad, speed_rad_s });
    }

    /// The motor stops where it is, in the way of the mode.
    pub(super) fn stand_still(&mut self) {
        match self.mode() {
            Mode::Current => self.motor.push(0.0),
            Mode::Pwm => self.motor.apply(0.0),
            Mode::Velocity => self.motor.spin(0.0, Pace::Step),
            _ => self.motor.hold_here(),
        }
    }

    /// Makes the motor follow goals that were written.
    pub(super) fn pursue(&mut self, fresh: Fresh) {
        if !self.engaged || self.watchdog_latched {
            return;
        }
        let side = self.side();
        let old_school = !self.has_profile();
        if self.zero_speed_stops() {
            self.motor.go_to(self.motor.trajectory().position, Pace::Step);
            return;
        }
        match self.mode() {
            Mode::Position | Mode::ExtendedPosition | Mode::CurrentBasedPosition => {
                if fresh.position || old_school && fresh.pace {
                    let goal_rad = self.goal_rad();
                    self.motor.go_to(goal_rad, self.pace_to(goal_rad));
                }
            }
            Mode::Step => {
                let raw = self.value(Role::GoalPosition).unwrap_or(0);
                let way = side * raw as f64 * self.model.radians_per_count;
                let goal_rad = self.motor.goal_rad() + if fresh.position { way } else { 0.0 };
                self.motor.go_to(goal_rad, self.pace_to(goal_rad));
            }
            Mode::Velocity if fresh.other || old_school && fresh.pace => {
                let speed = side * self.si(Role::GoalVelocity).unwrap_or(0.0);
                self.motor.spin(speed, self.ramp_of_speed(speed));
            }
            Mode::Current if fresh.other => {
                let counts = self.goal_written || old_school;
                self.motor.push(if counts { side * self.goal_current_a() } else { 0.0 });
            }
            Mode::Pwm if fresh.other || old_school && fresh.pace => {
                let counts = self.goal_written || old_school;
                self.motor.apply(if counts { side * self.goal_duty() } else { 0.0 });
            }
            Mode::Velocity | Mode::Current | Mode::Pwm => {}
        }
    }

    /// Where the goal register sends the shaft, rad.
    fn goal_rad(&self) -> f64 {
        let raw = self.value(Role::GoalPosition).unwrap_or(0);
        let (min, max) = self.limits();
        let limited = match self.model.protocol {
            Protocol::Dynamixel1 | Protocol::Dynamixel2 => raw,
            // Feetech does not refuse a goal beyond its angle limits, it stops at the limit; both
            // limits zero mean none.
            Protocol::FeetechSts | Protocol::FeetechScs if min < max => raw.clamp(min, max),
            Protocol::FeetechSts | Protocol::FeetechScs => raw,
        };
        self.shaft_rad(limited)
    }

    fn goal_current_a(&self) -> f64 {
        let goal_a = self.si(Role::GoalCurrent).unwrap_or(0.0);
        // MX: "Goal Torque cannot be bigger than Torque Limit"; both count to 1023.
        match (self.model.protocol, self.si(Role::TorqueLimit), self.model.role(Role::GoalCurrent))
        {
            (Protocol::Dynamixel1, Some(limit), Some(item)) => {
                let limit_a = limit * self.model.si(item, 1000);
                goal_a.clamp(-limit_a, limit_a)
            }
            _ => goal_a,
        }
    }

    /// -1..1: Goal PWM; AX and XL-320: Moving Speed, 1023 is all; FEETECH: the register of the goal
    /// time, in 0.1 % with the sign in bit 10 (the maker's SDK; LeRobot's comment has bit 11).
    fn goal_duty(&self) -> f64 {
        match self.model.protocol {
            Protocol::Dynamixel2 if self.has_profile() => self.si(Role::GoalPwm).unwrap_or(0.0),
            Protocol::Dynamixel1 | Protocol::Dynamixel2 => {
                self.value(Role::GoalVelocity).unwrap_or(0) as f64 / 1023.0
            }
            Protocol::FeetechSts | Protocol::FeetechScs => {
                let raw = self.value(Role::GoalTime).unwrap_or(0);
                let signed = match self.model.role(Role::GoalTime).map(|item| item.encoding) {
                    Some(Encoding::U16) if raw & 0x400 != 0 => -(raw & 0x3FF),
                    Some(Encoding::U16) => raw & 0x3FF,
                    _ => raw,
                };
                signed as f64 / 1000.0
            }
        }
    }

    /// How a move to `goal_rad` is to go.
    fn pace_to(&self, goal_rad: f64) -> Pace {
        match self.model.protocol {
            Protocol::Dynamixel2 if self.has_profile() => self.profile(),
            Protocol::FeetechScs if self.value(Role::GoalTime).is_some_and(|ms| ms > 0) => {
                let total_s = self.si(Role::GoalTime).unwrap_or(0.0);
                let same = goal_rad == self.motor.goal_rad();
                if same { self.speed_limits() } else { Pace::Timed { total_s, ramp_s: 0.0 } }
            }
            _ => self.speed_limits(),
        }
    }

    /// DYNAMIXEL 2.0's profile registers.
    fn profile(&self) -> Pace {
        let raw = |role| self.value(role).unwrap_or(0).max(0);
        let (velocity, acceleration) = (raw(Role::ProfileVelocity), raw(Role::ProfileAcceleration));
        if velocity == 0 {
            return Pace::Step;
        }
        if self.drive_mode() & TIME_BASED != 0 {
            // The whole time and the ramp's, in ms.
            let total_s = velocity as f64 * 1e-3;
            return Pace::Timed {
                total_s,
                ramp_s: (acceleration as f64 * 1e-3).min(0.5 * total_s),
            };
        }
        let speed = self.si(Role::ProfileVelocity).unwrap_or(0.0);
        Pace::within(speed, self.acceleration_limit())
    }

    fn acceleration_limit(&self) -> f64 {
        let acceleration = self.si(Role::ProfileAcceleration).unwrap_or(0.0);
        if acceleration > 0.0 { acceleration } else { f64::INFINITY }
    }

    /// FEETECH under [`ZeroSpeed::AsPhaseSays`]: moves to positions stand still.
    fn zero_speed_stops(&self) -> bool {
        let as_phase_says = self.zero_speed == ZeroSpeed::AsPhaseSays && self.follows_positions();
        let timed = self.model.protocol == Protocol::FeetechScs
            && self.value(Role::GoalTime).is_some_and(|ms| ms > 0);
        as_phase_says
            && !timed
            && self.value(Role::Phase).is_some_and(|phase| phase & PHASE_ZERO_IS_FULL == 0)
            && self.value(Role::GoalVelocity) == Some(0)
    }

    /// The others' speed and acceleration, 0 = as fast as it can.
    fn speed_limits(&self) -> Pace {
        let speed = self.si(Role::ProfileVelocity).or(self.si(Role::GoalVelocity));
        let asked = speed.unwrap_or(0.0).abs();
        let top = self.si(Role::MaxSpeed).filter(|&top| top > 0.0).unwrap_or(f64::INFINITY);
        let acceleration = self.acceleration_limit();
        if asked > 0.0 || top.is_finite() {
            let asked = if asked > 0.0 { asked } else { f64::INFINITY };
            Pace::within(asked.min(top), acceleration)
        } else if acceleration.is_finite() {
            Pace::within(self.motor.free_speed_rad_s(), acceleration)
        } else {
            Pace::Step
        }
    }

    /// How the speed changes to another.
    fn ramp_of_speed(&self, speed: f64) -> Pace {
        let raw = self.value(Role::ProfileAcceleration).unwrap_or(0);
        let timed = self.has_profile() && self.drive_mode() & TIME_BASED != 0;
        if timed && raw > 0 {
            return Pace::Timed { total_s: 0.0, ramp_s: raw as f64 * 1e-3 };
        }
        let acceleration = self.acceleration_limit();
        if !acceleration.is_finite() {
            return Pace::Step;
        }
        Pace::Trapezoid { speed: speed.abs(), acceleration }
    }

    pub(super) fn is_moving(&self) -> bool {
        let threshold = match self.model.protocol {
            Protocol::Dynamixel2 => self.si(Role::MovingThreshold),
            // Not told, or a factory value nobody tells.
            _ => None,
        };
        self.motor.velocity_rad_s().abs() > threshold.unwrap_or(MOVING_RAD_S)
    }

    /// Brings the registers that report something up to date.
    pub(super) fn refresh(&mut self) {
        let side = self.side();
        let target = self.motor.trajectory();
        let position = self.frozen.unwrap_or_else(|| self.present_position());
        self.put_held(Role::PresentPosition, position);
        self.put_si(Role::PresentVelocity, side * self.motor.velocity_rad_s());
        self.put_si(Role::PresentCurrent, side * self.motor.current_a());
        self.put_si(Role::PresentPwm, side * self.motor.duty());
        let load = match self.model.protocol {
            Protocol::Dynamixel1 | Protocol::Dynamixel2 => self.motor.torque_ratio(),
            // Present load(60) is the duty.
            Protocol::FeetechSts | Protocol::FeetechScs => self.motor.duty(),
        };
        self.put_si(Role::PresentLoad, side * load);
        self.put_si(Role::PresentVoltage, self.motor.voltage_v());
        self.put_si(Role::PresentTemperature, self.motor.temperature_c());
        self.put(Role::Moving, i64::from(self.is_moving()));
        self.put(Role::MovingStatus, self.moving_status());
        self.put_held(Role::PositionTrajectory, self.reading(target.position));
        self.put_si(Role::VelocityTrajectory, side * target.velocity);
        self.put(Role::BackupReady, i64::from(self.backup.is_some()));
        let up_ms = self.motor.now_ns().saturating_sub(self.booted_ns) / 1_000_000;
        self.put(Role::RealtimeTick, (up_ms % 32_768) as i64);
    }

    /// Moving Status(123): profile in bits 5..4, following error in bit 3, under way in bit 1, in
    /// position in bit 0.
    fn moving_status(&self) -> i64 {
        let error = (self.motor.trajectory().position - self.motor.position_rad()).abs();
        let mut bits = 0;
        if self.motor.under_way() {
            bits |= match self.motor.shape() {
                Shape::Step => 0x00,
                Shape::Rectangle => 0x12,
                Shape::Triangle => 0x22,
                Shape::Trapezoid => 0x32,
            };
        } else if self.follows_positions() && error <= IN_POSITION_RAD {
            bits |= 0x01;
        }
        if self.follows_positions() && error > FOLLOWING_ERROR_RAD {
            bits |= 0x08;
        }
        bits
    }
}
