//! Between the control table and the motor: what goals and gains ask of it, what it reports.

use super::{Event, OVERLOAD_BIT, Servo};
use crate::motor::Drive;
use crate::motor::ramp::Pace;
use gaitway_profiles::{Protocol, Role};

/// Speed asked for per radian of error and count of P gain, 1/s: see [`crate::motor`].
const DYNAMIXEL_GAIN_PER_S: f64 = 1.0 / 8.0;
const FEETECH_GAIN_PER_S: f64 = 3.0;
/// The loop runs at 1 kHz; a stiffer one would not be stable.
const MAX_GAIN_PER_S: f64 = 400.0;
/// Error within which Moving Status says "in position" (assumed), rad.
const IN_POSITION_RAD: f64 = 0.01;

impl Servo {
    pub fn torque_on(&self) -> bool {
        self.value(Role::TorqueEnable).is_some_and(|raw| raw != 0)
    }

    pub(super) fn drive_mode(&self) -> i64 {
        match self.model.protocol {
            Protocol::Dynamixel1 | Protocol::Dynamixel2 => self.value(Role::DriveMode).unwrap_or(0),
            Protocol::FeetechSts | Protocol::FeetechScs => 0,
        }
    }

    /// -1 if Drive Mode(10) bit 0 reverses the servo, else 1.
    pub(super) fn side(&self) -> f64 {
        if self.drive_mode() & 1 != 0 { -1.0 } else { 1.0 }
    }

    /// Position modes move; the others answer, but their motor is not modelled.
    fn follows_positions(&self) -> bool {
        let mode = self.value(Role::OperatingMode);
        match self.model.protocol {
            Protocol::Dynamixel1 | Protocol::Dynamixel2 => {
                mode.is_none_or(|mode| matches!(mode, 3..=5))
            }
            Protocol::FeetechSts | Protocol::FeetechScs => mode.is_none_or(|mode| mode == 0),
        }
    }

    /// Counts added to the encoder's reading.
    fn offset_counts(&self) -> i64 {
        let raw = self.value(Role::HomingOffset).unwrap_or(0);
        self.reading_offset
            + match self.model.protocol {
                // Homing Offset(20): in position mode only a quarter turn either way counts.
                Protocol::Dynamixel2
                    if self.value(Role::OperatingMode) == Some(3) && raw.abs() > 1024 =>
                {
                    0
                }
                Protocol::Dynamixel1 | Protocol::Dynamixel2 => raw,
                // Position offset(31) is subtracted.
                Protocol::FeetechSts | Protocol::FeetechScs => -raw,
            }
    }

    /// The reading at the shaft's angle.
    pub fn present_position(&self) -> i64 {
        self.reading(self.motor.position_rad())
    }

    fn reading(&self, shaft_rad: f64) -> i64 {
        let position = &self.model.profile.position;
        let counts = (self.side() * shaft_rad / self.model.radians_per_count).round() as i64;
        let reading = i64::from(position.zero_count) + counts + self.offset_counts();
        match self.model.protocol {
            Protocol::Dynamixel1 | Protocol::Dynamixel2 => reading,
            Protocol::FeetechSts | Protocol::FeetechScs => {
                reading.rem_euclid(i64::from(position.counts))
            }
        }
    }

    /// The shaft angle that reads `raw`.
    pub(super) fn shaft_rad(&self, raw: i64) -> f64 {
        let counts = raw - i64::from(self.model.profile.position.zero_count) - self.offset_counts();
        self.side() * counts as f64 * self.model.radians_per_count
    }

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
        for (role, limit) in
            [(Role::GoalPwm, Role::PwmLimit), (Role::GoalCurrent, Role::CurrentLimit)]
        {
            if let Some(raw) = self.value(limit) {
                self.put(role, raw);
            }
        }
    }

    /// Gains, limits and torque as the table has them now.
    pub(super) fn update_drive(&mut self) {
        let gain = self.value(Role::PositionPGain).unwrap_or(0) as f64;
        let (factor, duty, torque) = match self.model.protocol {
            Protocol::Dynamixel1 | Protocol::Dynamixel2 => {
                let current = match self.value(Role::OperatingMode) {
                    Some(5) => self.si(Role::GoalCurrent).map(f64::abs),
                    _ => None,
                };
                let stall = self.motor.stall_current_a();
                let torque = current.map_or(1.0, |current| current / stall);
                (DYNAMIXEL_GAIN_PER_S, self.si(Role::GoalPwm).map(f64::abs), torque)
            }
            Protocol::FeetechSts | Protocol::FeetechScs => {
                (FEETECH_GAIN_PER_S, self.si(Role::TorqueLimit), 1.0)
            }
        };
        self.motor.set_drive(Drive {
            // 2 is Feetech's damping: no position is held.
            on: self.value(Role::TorqueEnable) == Some(1) && self.follows_positions(),
            gain_per_s: (gain * factor).min(MAX_GAIN_PER_S),
            duty_limit: duty.unwrap_or(1.0).min(1.0),
            torque_limit: torque.min(1.0),
        });
    }

    pub(super) fn switch_torque(&mut self, was: bool, is: bool) {
        if self.model.protocol == Protocol::FeetechSts {
            // Writing the switch forgets an overload (assumed).
            self.put(Role::HardwareError, self.hardware_error() & !OVERLOAD_BIT);
        }
        self.update_drive();
        if !was && is {
            let goal = self.value(Role::GoalPosition).unwrap_or(0);
            let error = self.shaft_rad(goal) - self.shaft_rad(self.present_position());
            self.events.push(Event::TorqueOn { error_rad: error });
            self.motor.hold_here();
            self.pursue_goal();
        } else if was && !is {
            self.events.push(Event::TorqueOff);
        }
    }

    /// Sends the motor to the goal register's position, as fast as the profile registers say.
    pub(super) fn pursue_goal(&mut self) {
        let Some(raw) = self.value(Role::GoalPosition) else { return };
        let limited = match self.model.protocol {
            Protocol::Dynamixel1 | Protocol::Dynamixel2 => raw,
            // Feetech does not refuse a goal beyond its angle limits, it stops at the limit; both
            // limits zero mean none.
            Protocol::FeetechSts | Protocol::FeetechScs => {
                let min = self.value(Role::MinPositionLimit).unwrap_or(0);
                let max = self.value(Role::MaxPositionLimit).unwrap_or(0);
                if min < max { raw.clamp(min, max) } else { raw }
            }
        };
        let goal_rad = self.shaft_rad(limited);
        let pace = match self.model.protocol {
            Protocol::Dynamixel1 | Protocol::Dynamixel2 => self.dynamixel_pace(goal_rad),
            Protocol::FeetechSts | Protocol::FeetechScs => self.feetech_pace(),
        };
        self.motor.go_to(goal_rad, pace);
    }

    fn dynamixel_pace(&self, goal_rad: f64) -> Pace {
        let raw = |role| self.value(role).unwrap_or(0).max(0);
        let (velocity, acceleration) = (raw(Role::ProfileVelocity), raw(Role::ProfileAcceleration));
        if velocity == 0 {
            return Pace::Step;
        }
        if self.drive_mode() & 0x04 != 0 {
            // Time-based profile: the registers are the whole time and the ramp's, in ms.
            let (from, _) = self.motor.trajectory();
            let total_s = velocity as f64 * 1e-3;
            let ramp_s = (acceleration as f64 * 1e-3).min(0.5 * total_s);
            let speed = (goal_rad - from).abs() / (total_s - ramp_s);
            return pace(speed, speed / ramp_s);
        }
        pace(
            self.si(Role::ProfileVelocity).unwrap_or(0.0),
            if acceleration == 0 {
                f64::INFINITY
            } else {
                self.si(Role::ProfileAcceleration).unwrap_or(f64::INFINITY)
            },
        )
    }

    fn feetech_pace(&self) -> Pace {
        let speed = self.si(Role::ProfileVelocity).or(self.si(Role::GoalVelocity));
        let speed = speed.unwrap_or(0.0).abs();
        let acceleration = self.si(Role::ProfileAcceleration).unwrap_or(0.0);
        // Goal speed 0 means as fast as it can, acceleration 0 likewise.
        match (speed > 0.0, acceleration > 0.0) {
            (false, false) => Pace::Step,
            (false, true) => pace(self.motor.free_speed_rad_s(), acceleration),
            (true, false) => pace(speed, f64::INFINITY),
            (true, true) => pace(speed, acceleration),
        }
    }

    pub(super) fn is_moving(&self) -> bool {
        let threshold = match self.model.protocol {
            Protocol::Dynamixel1 | Protocol::Dynamixel2 => self.si(Role::MovingThreshold),
            Protocol::FeetechSts | Protocol::FeetechScs => None,
        };
        self.motor.velocity_rad_s().abs() > threshold.unwrap_or(0.02)
    }

    /// Brings the registers that report something up to date.
    pub(super) fn refresh(&mut self) {
        let side = self.side();
        let (trajectory, trajectory_speed) = self.motor.trajectory();
        self.put(Role::PresentPosition, self.present_position());
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
        self.put(Role::PositionTrajectory, self.reading(trajectory));
        self.put_si(Role::VelocityTrajectory, side * trajectory_speed);
        let up_ms = self.motor.now_ns().saturating_sub(self.booted_ns) / 1_000_000;
        self.put(Role::BackupReady, i64::from(self.backup.is_some()));
        self.put(Role::RealtimeTick, (up_ms % 32_768) as i64);
    }

    /// Moving Status(123): profile in bits 5..4, under way in bit 1, in position in bit 0.
    fn moving_status(&self) -> i64 {
        let (trajectory, _) = self.motor.trajectory();
        let in_position = (trajectory - self.motor.position_rad()).abs() <= IN_POSITION_RAD;
        if !self.motor.under_way() {
            return i64::from(in_position);
        }
        match self.motor.pace() {
            Pace::Step => i64::from(in_position),
            Pace::Rectangle { .. } => 0x12,
            Pace::Trapezoid { .. } => 0x32,
        }
    }
}

/// The pace with these limits; endless acceleration means no ramp, no speed means no motion.
fn pace(speed: f64, acceleration: f64) -> Pace {
    match (speed > 0.0, acceleration.is_finite()) {
        (false, _) => Pace::Step,
        (true, true) => Pace::Trapezoid { speed, acceleration },
        (true, false) => Pace::Rectangle { speed },
    }
}
