//! A virtual CAN actuator: a motor with a load of fixed inertia, its drive and its watchdog.
//!
//! What the host says is read by the family's codec ([`super::codec`]) and becomes a [`Goal`]. With
//! a timeout set, a drive that hears nothing for so long lets go; a Damiao and an ODrive then have
//! a fault that must be cleared.

use super::CanFrame;
use super::codec;
use gaitway_profiles::{Dialect, Ranges};

/// Step of the integration.
const STEP_NS: u64 = 100_000;
/// Moment of inertia at the output, kg m2: a forearm's.
const INERTIA_KG_M2: f64 = 0.01;
/// Viscous friction at the output, N m s/rad.
const FRICTION_NM_S_RAD: f64 = 0.02;
/// How fast a profile of position closes in on its goal, 1/s.
const APPROACH_PER_S: f64 = 30.0;
/// From a frame to its answer, ns; measured values lie between 50 and 300 us.
const ANSWER_DELAY_NS: u64 = 100_000;

/// Why an actuator cannot be played.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ActuatorError {
    /// No profile has this name, or it is wrong.
    #[error("{0}")]
    Profile(String),
    /// Not an id of the family.
    #[error("id {0} is none of the {1} family")]
    Id(u8, String),
    /// The family is not played yet.
    #[error("{0} actuators are not played")]
    Family(String),
}

/// What the drive was last told to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Goal {
    /// Spring, damper and torque.
    Impedance { position: f64, velocity: f64, kp: f64, kd: f64, torque: f64 },
    /// A position, at no more than a speed.
    Position { position: f64, speed: f64 },
    /// A velocity.
    Velocity(f64),
}

/// One actuator.
#[derive(Clone, Debug)]
pub struct Actuator {
    pub(super) dialect: Dialect,
    pub(super) id: u8,
    pub(super) ranges: Ranges,
    pub(super) registers: codec::Registers,
    pub(super) goal: Option<Goal>,
    pub(super) enabled: bool,
    pub(super) position_rad: f64,
    pub(super) velocity_rad_s: f64,
    pub(super) torque_nm: f64,
    pub(super) celsius: f64,
    /// Let go because the host was silent, and not cleared since.
    pub(super) silenced: bool,
    timeout_ns: Option<u64>,
    heard_ns: u64,
    now_ns: u64,
}

impl Actuator {
    /// An actuator of the profile `model`, at rest at zero, disabled, its timeout off.
    ///
    /// # Errors
    /// No such profile, an id the family does not have, or a family that is not played.
    pub fn new(model: &str, id: u8) -> Result<Actuator, ActuatorError> {
        let profile = gaitway_profiles::actuator(model)
            .map_err(|error| ActuatorError::Profile(error.to_string()))?;
        let family = format!("{:?}", profile.dialect);
        if id > profile.dialect.last_id() {
            return Err(ActuatorError::Id(id, family));
        }
        let ranges = profile.ranges.ok_or(ActuatorError::Family(family))?;
        Ok(Actuator {
            dialect: profile.dialect,
            id,
            registers: codec::Registers::new(id, &ranges),
            ranges,
            goal: None,
            enabled: false,
            position_rad: 0.0,
            velocity_rad_s: 0.0,
            torque_nm: 0.0,
            celsius: 30.0,
            silenced: false,
            timeout_ns: None,
            heard_ns: 0,
            now_ns: 0,
        })
    }

    /// Where it stands, rad.
    #[must_use]
    pub fn position_rad(&self) -> f64 {
        self.position_rad
    }

    /// Whether it drives.
    #[must_use]
    pub fn enabled(&self) -> bool {
        self.enabled
    }

    /// Puts it somewhere, past the line.
    pub fn place(&mut self, position_rad: f64) {
        self.position_rad = position_rad;
        self.velocity_rad_s = 0.0;
    }

    /// Sets the silence it allows, ns, as the maker's tool would; none = any.
    pub fn set_timeout(&mut self, timeout_ns: Option<u64>) {
        self.timeout_ns = timeout_ns;
        self.heard_ns = self.now_ns;
    }

    pub(super) const fn answer_delay_ns(&self) -> u64 {
        ANSWER_DELAY_NS
    }

    /// A frame of the host; what it answers, if it is meant.
    pub(super) fn hear(&mut self, frame: &CanFrame) -> Option<CanFrame> {
        let answer = codec::hear(self, frame)?;
        self.heard_ns = self.now_ns;
        answer
    }

    pub(super) fn enable(&mut self, enabled: bool) {
        self.enabled = enabled && !self.silenced;
        self.goal = None;
    }

    pub(super) fn run_until(&mut self, time_ns: u64) {
        while self.now_ns < time_ns {
            let step_ns = STEP_NS.min(time_ns - self.now_ns);
            self.now_ns += step_ns;
            let silent = self.timeout_ns.is_some_and(|t| self.now_ns - self.heard_ns > t);
            if self.enabled && silent {
                self.enable(false);
                self.silenced = codec::keeps_silence_fault(self.dialect);
            }
            self.advance(step_ns as f64 * 1e-9);
        }
    }

    fn advance(&mut self, dt: f64) {
        let most = self.ranges.torque_nm;
        match self.goal.filter(|_| self.enabled) {
            Some(Goal::Position { position, speed }) => {
                let speed = speed.abs().min(self.ranges.velocity_rad_s);
                let wanted = APPROACH_PER_S * (position - self.position_rad);
                self.velocity_rad_s = wanted.clamp(-speed, speed);
                self.torque_nm = 0.0;
            }
            Some(Goal::Velocity(velocity)) => {
                let most = self.ranges.velocity_rad_s;
                self.velocity_rad_s = velocity.clamp(-most, most);
                self.torque_nm = 0.0;
            }
            Some(Goal::Impedance { position, velocity, kp, kd, torque }) => {
                let spring = kp * (position - self.position_rad);
                let damper = kd * (velocity - self.velocity_rad_s);
                self.torque_nm = (spring + damper + torque).clamp(-most, most);
                self.accelerate(dt);
            }
            None => {
                self.torque_nm = 0.0;
                self.accelerate(dt);
            }
        }
        self.position_rad += self.velocity_rad_s * dt;
    }

    fn accelerate(&mut self, dt: f64) {
        let net = self.torque_nm - FRICTION_NM_S_RAD * self.velocity_rad_s;
        self.velocity_rad_s += net / INERTIA_KG_M2 * dt;
        let most = self.ranges.velocity_rad_s;
        self.velocity_rad_s = self.velocity_rad_s.clamp(-most, most);
    }
}
