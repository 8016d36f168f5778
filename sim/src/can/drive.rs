//! What virtual CAN actuators have in common: a motor with a load of fixed inertia, and a drive
//! that pursues a goal, has faults and lets go when the host is silent for too long.

use crate::hand::Grip;
use crate::servo::Event;
use gaitway_profiles::{Actuator as Profile, Dialect};
use std::cell::Cell;

/// The drive's own control runs at 10 kHz; nothing changes in between, so that how often somebody
/// looks changes nothing.
const STEP_NS: u64 = 100_000;
/// Moment of inertia at the output for each N m the actuator can give, kg m2 (assumed: a DM4310
/// carries a forearm).
const INERTIA_KG_M2_PER_NM: f64 = 1e-3;
/// Viscous friction at the output for each N m the actuator can give, N m s/rad (assumed).
const FRICTION_S_RAD: f64 = 2e-3;
/// A hand lets go of a shaft that is slower, rad/s: what is left of its speed is friction's.
const STILL_RAD_S: f64 = 1e-2;
/// Supply voltage, V.
const SUPPLY_V: f64 = 24.0;
/// Supply voltage with [`Trouble::UnderVoltage`], V.
const LOW_V: f64 = 9.0;
/// Supply voltage with [`Trouble::OverVoltage`], V.
const HIGH_V: f64 = 60.0;
/// Temperatures as a rule and with [`Trouble::OverTemperature`], degrees Celsius.
const USUAL_CELSIUS: f64 = 30.0;
const HOT_CELSIUS: f64 = 105.0;
/// What dialects without coded numbers can do, where their files say nothing: rad/s, N m
/// (assumed: a hobby humanoid's actuator).
const VELOCITY_RAD_S: f64 = 60.0;
const TORQUE_NM: f64 = 10.0;

/// What makes a drive let go.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trouble {
    /// The power stage is too hot.
    OverTemperature,
    /// The supply is too low.
    UnderVoltage,
    /// The supply is too high.
    OverVoltage,
    /// The motor draws too much.
    OverCurrent,
    /// The encoder cannot be read.
    Encoder,
    /// A phase of the motor is not connected.
    LostPhase,
    /// It has given too much for too long.
    Overload,
    /// The host was silent for longer than it may.
    Silence,
    /// The host asked for an emergency stop.
    Stopped,
}

impl Trouble {
    /// Names in a fault script of those that have a cause out there; the others come about.
    pub const NAMES: [(&str, Trouble); 6] = [
        ("over-temperature", Trouble::OverTemperature),
        ("under-voltage", Trouble::UnderVoltage),
        ("over-voltage", Trouble::OverVoltage),
        ("over-current", Trouble::OverCurrent),
        ("encoder", Trouble::Encoder),
        ("lost-phase", Trouble::LostPhase),
    ];
}

/// What the drive was last told to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Goal {
    /// Spring, damper and torque. With `travels`, the spring's other end moves at `velocity`, until
    /// it is at `stop`.
    Impedance {
        position: f64,
        velocity: f64,
        kp: f64,
        kd: f64,
        torque: f64,
        torque_limit: f64,
        travels: bool,
        stop: f64,
    },
    /// A position: closed in on with `gain` (1/s) beyond a velocity, at no more than a speed.
    Position { position: f64, velocity: f64, gain: f64, speed: f64 },
    /// A velocity.
    Velocity(f64),
    /// A torque.
    Torque(f64),
    /// The motor's phases joined, or zero velocity: whatever takes energy out.
    Brake,
}

impl Goal {
    /// Spring, damper and torque as one frame says them.
    pub fn impedance(position: f64, velocity: f64, kp: f64, kd: f64, torque: f64) -> Goal {
        let (torque_limit, travels, stop) = (f64::INFINITY, false, f64::NAN);
        Goal::Impedance { position, velocity, kp, kd, torque, torque_limit, travels, stop }
    }

    /// True if all its numbers are some; where it stops, and its limits, may be none.
    fn is_sound(&self) -> bool {
        match *self {
            Goal::Impedance { position, velocity, kp, kd, torque, torque_limit, .. } => {
                let numbers = [position, velocity, kp, kd, torque];
                numbers.iter().all(|number| number.is_finite()) && !torque_limit.is_nan()
            }
            Goal::Position { position, velocity, gain, speed } => {
                [position, velocity, gain].iter().all(|number| number.is_finite())
                    && !speed.is_nan()
            }
            Goal::Velocity(number) | Goal::Torque(number) => number.is_finite(),
            Goal::Brake => true,
        }
    }

    /// The position that the shaft is pulled to, if it is.
    fn pulls_to(&self) -> Option<f64> {
        match *self {
            Goal::Impedance { position, kp, .. } => (kp > 0.0).then_some(position),
            Goal::Position { position, .. } => Some(position),
            Goal::Velocity(_) | Goal::Torque(_) | Goal::Brake => None,
        }
    }
}

/// What positions are told the referee in.
pub(super) fn microradians(position_rad: f64) -> i64 {
    (position_rad * 1e6).round() as i64
}

/// What a drive does when the host has been silent for too long.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum OnSilence {
    /// Lets go.
    LetGo,
    /// Lets go, and remembers it as a fault that must be cleared.
    Fault,
    /// Brakes until it is stopped.
    Brake,
}

/// A motor and its drive.
#[derive(Clone, Debug)]
pub(super) struct Drive {
    /// Largest speed, rad/s.
    pub velocity_max_rad_s: f64,
    /// Largest torque, N m.
    pub torque_max_nm: f64,
    pub goal: Option<Goal>,
    pub enabled: bool,
    pub velocity_rad_s: f64,
    pub torque_nm: f64,
    /// The fault it remembers.
    pub latched: Option<Trouble>,
    /// The silence it allows, ns.
    pub timeout_ns: Option<u64>,
    pub on_silence_brakes: bool,
    on_silence: OnSilence,
    position_rad: f64,
    cause: Option<Trouble>,
    heard_ns: u64,
    now_ns: u64,
    /// When the host queued the frame that is being heard.
    asked_ns: u64,
    /// Held under torque by a goal of position.
    pulling: bool,
    pub stuck: bool,
    /// Somebody has the shaft in hand.
    pub grip: Option<Grip>,
    /// What it reports instead of where it is.
    pub frozen_rad: Option<f64>,
    pub events: Vec<(u64, Event)>,
    /// Its position has been told in what it says now.
    told: Cell<bool>,
}

impl Drive {
    pub fn new(profile: &Profile) -> Drive {
        let ranges = profile.ranges.as_ref();
        let on_silence = match profile.dialect {
            Dialect::Damiao | Dialect::Odrive => OnSilence::Fault,
            Dialect::Moteus | Dialect::Recoil => OnSilence::Brake,
            _ => OnSilence::LetGo,
        };
        Drive {
            velocity_max_rad_s: ranges.map_or(VELOCITY_RAD_S, |ranges| ranges.velocity_rad_s),
            torque_max_nm: ranges.map_or(TORQUE_NM, |ranges| ranges.torque_nm),
            goal: None,
            enabled: false,
            velocity_rad_s: 0.0,
            torque_nm: 0.0,
            latched: None,
            timeout_ns: None,
            on_silence_brakes: false,
            on_silence,
            position_rad: 0.0,
            cause: None,
            heard_ns: 0,
            now_ns: 0,
            asked_ns: 0,
            pulling: false,
            stuck: false,
            grip: None,
            frozen_rad: None,
            events: Vec::new(),
            told: Cell::new(false),
        }
    }

    /// Where the shaft is, rad.
    pub fn shaft_rad(&self) -> f64 {
        self.position_rad
    }

    /// Where its encoder says the shaft is, rad.
    pub fn position_rad(&self) -> f64 {
        self.frozen_rad.unwrap_or(self.position_rad)
    }

    /// The same, to be told the host.
    pub fn tell_rad(&self) -> f64 {
        self.told.set(true);
        self.position_rad()
    }

    /// The position, microradians, if it was told since this was asked last.
    pub fn take_told(&self) -> Option<i64> {
        self.told.take().then(|| microradians(self.position_rad()))
    }

    pub fn now_ns(&self) -> u64 {
        self.now_ns
    }

    pub fn celsius(&self) -> f64 {
        if self.cause == Some(Trouble::OverTemperature) { HOT_CELSIUS } else { USUAL_CELSIUS }
    }

    pub fn supply_v(&self) -> f64 {
        match self.cause {
            Some(Trouble::UnderVoltage) => LOW_V,
            Some(Trouble::OverVoltage) => HIGH_V,
            _ => SUPPLY_V,
        }
    }

    /// Another goal must come before it gives torque.
    pub fn drop_goal(&mut self) {
        self.goal = None;
        self.release();
    }

    /// Puts the shaft somewhere.
    pub fn place(&mut self, position_rad: f64) {
        self.position_rad = position_rad;
        self.velocity_rad_s = 0.0;
    }

    /// A frame for this drive is being heard that the host queued at `asked_ns`.
    pub fn asked(&mut self, asked_ns: u64) {
        self.asked_ns = asked_ns;
    }

    /// The host has shown that it lives.
    pub fn feed(&mut self) {
        self.heard_ns = self.now_ns;
    }

    /// Another silence is allowed from now on; none = any.
    pub fn set_timeout(&mut self, timeout_ns: Option<u64>) {
        self.timeout_ns = timeout_ns;
        self.feed();
    }

    /// Drives from now on, unless there is a fault; the goal stays.
    pub fn enable(&mut self) {
        if self.latched.is_none() && !self.enabled {
            self.enabled = true;
            self.feed();
            self.pull();
        }
    }

    /// Drives from now on, but gives no torque before the next goal.
    pub fn enable_without_goal(&mut self) {
        if !self.enabled {
            self.goal = None;
            self.enable();
        }
    }

    /// Lets go, and forgets its goal.
    pub fn disable(&mut self) {
        self.enabled = false;
        self.goal = None;
        self.on_silence_brakes = false;
        self.release();
    }

    /// Another goal, if there is any sense in it.
    pub fn aim(&mut self, goal: Goal) {
        if !goal.is_sound() {
            return;
        }
        if let Some(position) = goal.pulls_to() {
            let raw = microradians(position);
            let (off_rad, speed_rad_s) = (position - self.position_rad(), self.velocity_rad_s);
            self.note(Event::Goal { raw, accepted: true, off_rad, speed_rad_s });
        }
        self.goal = Some(goal);
        self.pull();
    }

    /// A goal the drive sets itself.
    pub fn hold(&mut self, goal: Goal) {
        self.goal = Some(goal);
        self.pull();
    }

    /// Something the referee judges has happened.
    pub fn note(&mut self, event: Event) {
        self.events.push((self.asked_ns, event));
    }

    /// Tells of torque that comes or goes with the goal.
    fn pull(&mut self) {
        let end = self.goal.filter(|_| self.enabled).and_then(|goal| goal.pulls_to());
        match end {
            Some(end) if !self.pulling => {
                self.pulling = true;
                let error_rad = end - self.position_rad;
                let (goal, present) = (microradians(end), microradians(self.position_rad()));
                self.note(Event::TorqueOn { goal, present, error_rad });
            }
            Some(_) => {}
            None => self.release(),
        }
    }

    fn release(&mut self) {
        if std::mem::take(&mut self.pulling) {
            self.events.push((self.now_ns, Event::TorqueOff));
        }
    }

    /// Something is wrong from now on, or not any more. The fault is remembered until it is
    /// cleared.
    pub fn set_cause(&mut self, cause: Option<Trouble>) {
        self.cause = cause;
        if let Some(trouble) = cause {
            self.trip(trouble);
        }
    }

    /// Lets go because of a fault.
    pub fn trip(&mut self, trouble: Trouble) {
        self.latched = Some(trouble);
        self.disable();
    }

    /// Forgets the fault, unless its cause is still there.
    pub fn clear(&mut self) {
        self.latched = self.cause;
    }

    /// Power was gone for a moment.
    pub fn restart(&mut self) {
        self.disable();
        self.latched = self.cause;
        self.torque_nm = 0.0;
        self.feed();
    }

    /// Time passes, in whole steps.
    pub fn run_until(&mut self, time_ns: u64) {
        while self.now_ns + STEP_NS <= time_ns {
            self.now_ns += STEP_NS;
            let silent = self.timeout_ns.is_some_and(|t| self.now_ns - self.heard_ns > t);
            if self.enabled && silent && !self.on_silence_brakes {
                self.fall_silent();
            }
            self.advance(STEP_NS as f64 * 1e-9);
        }
    }

    fn fall_silent(&mut self) {
        self.events.push((self.now_ns, Event::HostSilent));
        match self.on_silence {
            OnSilence::LetGo => self.disable(),
            OnSilence::Fault => self.trip(Trouble::Silence),
            OnSilence::Brake => {
                self.goal = Some(Goal::Brake);
                self.on_silence_brakes = true;
                self.release();
            }
        }
    }

    fn advance(&mut self, dt: f64) {
        let most = self.velocity_max_rad_s;
        let goal = if self.enabled { self.goal } else { None };
        match goal {
            Some(Goal::Position { position, velocity, gain, speed }) => {
                let speed = speed.abs().min(most);
                let wanted = velocity + gain * (position - self.position_rad);
                self.turn_at(wanted.clamp(-speed, speed));
            }
            Some(Goal::Velocity(velocity)) => self.turn_at(velocity.clamp(-most, most)),
            Some(Goal::Brake) => self.turn_at(0.0),
            Some(Goal::Impedance { position, velocity, kp, kd, torque, torque_limit, .. }) => {
                let spring = kp * (position - self.position_rad);
                let damper = kd * (velocity - self.velocity_rad_s);
                let limit = torque_limit.min(self.torque_max_nm);
                self.give((spring + damper + torque).clamp(-limit, limit), dt);
                self.travel(dt);
            }
            Some(Goal::Torque(torque)) => {
                self.give(torque.clamp(-self.torque_max_nm, self.torque_max_nm), dt);
            }
            None => self.give(0.0, dt),
        }
        if self.stuck {
            self.velocity_rad_s = 0.0;
        }
        self.position_rad += self.velocity_rad_s * dt;
        let slow = self.velocity_rad_s.abs() < STILL_RAD_S;
        if slow && self.grip.is_some_and(|grip| grip.is_done(self.position_rad)) {
            self.grip = None;
        }
    }

    /// The drive's own loop is taken for perfect.
    fn turn_at(&mut self, velocity_rad_s: f64) {
        self.velocity_rad_s = velocity_rad_s;
        self.torque_nm = 0.0;
    }

    fn give(&mut self, torque_nm: f64, dt: f64) {
        self.torque_nm = torque_nm;
        let size = self.torque_max_nm;
        let inertia = INERTIA_KG_M2_PER_NM * size;
        let shaft = (self.position_rad, self.velocity_rad_s);
        let by_hand = self.grip.as_mut().map_or(0.0, |grip| grip.force(dt, shaft, inertia));
        let net = torque_nm + by_hand - FRICTION_S_RAD * size * self.velocity_rad_s;
        self.velocity_rad_s += net / inertia * dt;
        let most = self.velocity_max_rad_s;
        self.velocity_rad_s = self.velocity_rad_s.clamp(-most, most);
    }

    /// Moves the other end of a spring that travels.
    fn travel(&mut self, dt: f64) {
        if let Some(Goal::Impedance { position, velocity, travels: true, stop, .. }) =
            &mut self.goal
        {
            let next = *position + *velocity * dt;
            let passed = (*stop - *position) * (*stop - next) <= 0.0;
            if passed {
                (*position, *velocity) = (*stop, 0.0);
            } else {
                *position = next;
            }
        }
    }
}
