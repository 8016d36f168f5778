//! One CAN actuator in SI units: what it is told, what it tells, how it is asked and set up.
//!
//! Each dialect has a file of its own below; what is above sees [`Actuator`] only. Angles, speeds
//! and torques are those of the actuator's output.

mod cubemars;
mod damiao;
mod moteus;
mod odrive;
mod recoil;
mod robstride;
#[cfg(test)]
mod tests;

use crate::bus::can::Shape;
use crate::wire::can::{CanFrame, Faults, Feedback, Number};
use gaitway_profiles::{self as profiles, CanSpeed, Dialect, Ranges, TimeoutKind};
use std::fmt;
use std::sync::Arc;

use super::coded;

/// What a frame tells of an actuator; absent: not this.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Told {
    /// Angle, rad.
    pub position_rad: Option<f64>,
    /// Speed, rad/s.
    pub velocity_rad_s: Option<f64>,
    /// Torque as a share of the end of its range.
    pub torque_share: Option<f64>,
    /// Current of the motor, A.
    pub current_a: Option<f64>,
    /// The hottest place it tells of, degrees Celsius.
    pub temperature_c: Option<f64>,
    /// Supply voltage, V.
    pub voltage_v: Option<f64>,
    /// Whether it drives.
    pub enabled: Option<bool>,
    /// What is wrong with it.
    pub faults: Option<Faults>,
    /// Bits of the setting that was asked for.
    pub value: Option<u32>,
}

impl Told {
    /// With what is newer laid over it.
    #[must_use]
    pub fn then(self, newer: Self) -> Self {
        Self {
            position_rad: newer.position_rad.or(self.position_rad),
            velocity_rad_s: newer.velocity_rad_s.or(self.velocity_rad_s),
            torque_share: newer.torque_share.or(self.torque_share),
            current_a: newer.current_a.or(self.current_a),
            temperature_c: newer.temperature_c.or(self.temperature_c),
            voltage_v: newer.voltage_v.or(self.voltage_v),
            enabled: newer.enabled.or(self.enabled),
            faults: newer.faults.or(self.faults),
            value: newer.value.or(self.value),
        }
    }
}

/// What an actuator is told besides goals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// Drive from now on.
    Enable,
    /// Let go.
    LetGo,
    /// Forget that the host was silent.
    ForgetSilence,
    /// Heed goals of position as they come.
    HeedGoals,
}

/// What an actuator is asked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Question {
    /// The frame that asks.
    pub frame: CanFrame,
    what: What,
}

impl Question {
    const fn state(frame: CanFrame) -> Self {
        Self { frame, what: What::State }
    }

    const fn setting(number: u16, frame: CanFrame) -> Self {
        Self { frame, what: What::Setting(number) }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum What {
    /// Where it stands and how it is.
    State,
    /// A setting, by its number.
    Setting(u16),
}

/// A setting that must hold for goals to mean what is meant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setting {
    /// Its number.
    pub number: u16,
    /// Its name, for a person.
    pub name: &'static str,
    /// What it must be.
    pub wanted: Wanted,
}

/// What a setting must be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Wanted {
    /// This, which is written if it is not, until power-off.
    Written(u32),
    /// A number near this, which stands in the device's profile; else coded numbers mean something
    /// else, and nothing may be told it.
    Near(f64),
    /// This; it decides where answers come from, and cannot be written over the line safely.
    Exactly(u32),
    /// Anything: it tells who the device is.
    Told,
}

impl Wanted {
    /// True if the setting's `bits` are as wanted.
    #[must_use]
    pub fn holds(self, bits: u32) -> bool {
        /// Ranges travel as `f32`.
        const TOLERANCE: f64 = 1e-4;
        match self {
            Self::Written(wanted) | Self::Exactly(wanted) => bits == wanted,
            Self::Near(wanted) => {
                (f64::from(f32::from_bits(bits)) - wanted).abs() <= TOLERANCE * wanted.abs()
            }
            Self::Told => true,
        }
    }

    /// The setting's `bits` as a person reads them.
    #[must_use]
    pub fn words(self, bits: u32) -> String {
        match self {
            Self::Near(_) => f32::from_bits(bits).to_string(),
            // Makers write what tells who a device is digit by digit.
            Self::Told => format!("0x{bits:X}"),
            _ => bits.to_string(),
        }
    }
}

/// How an actuator learns that its host is gone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum HostWatch {
    /// By a setting, in whole steps; 0 is never.
    Setting {
        /// Number of the setting.
        number: u16,
        /// Length of a step, s.
        step_s: f64,
    },
    /// Each goal says how long it holds.
    InGoals,
    /// It was set with the maker's tool, as the robot file says, s.
    Said(f64),
    /// It may have been set with the maker's tool; nobody says so.
    Unsaid,
    /// It does not.
    Never,
}

/// Goal of one actuator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Goal {
    /// rad
    pub position_rad: f64,
    /// Speed on the way, rad/s. Only those told their gains heed it.
    pub velocity_rad_s: f64,
    /// How long it holds without another, s; none: for good. Only where goals say so.
    pub holds_s: Option<f64>,
}

/// How a robot's actuator hangs on its line, and what the robot file states of it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Placing {
    /// Its id.
    pub id: u8,
    /// Identifier of its answers, where it can be chosen.
    pub answer_id: u16,
    /// Gain on the error of position, N m/rad.
    pub kp_nm_rad: f64,
    /// Gain on the error of velocity, N m s/rad.
    pub kd_nm_s_rad: f64,
    /// The silence after which it lets go, s, as the user set it.
    pub timeout_configured_s: Option<f64>,
}

impl coded::Impedance {
    /// A goal with the gains the robot file states, and no torque added.
    #[must_use]
    pub const fn of(goal: Goal, placing: Placing) -> Self {
        Self {
            position_rad: goal.position_rad,
            velocity_rad_s: goal.velocity_rad_s,
            kp_nm_rad: placing.kp_nm_rad,
            kd_nm_s_rad: placing.kd_nm_s_rad,
            torque_nm: 0.0,
        }
    }
}

/// One dialect's side of an actuator. Frames it returns go out in order.
trait Language: fmt::Debug + Send + Sync {
    /// What `frame` tells, if it is this actuator's own and not the answer to a question for a
    /// setting.
    fn told(&self, frame: &CanFrame) -> Option<Told>;

    /// The question for where it stands that changes nothing, if there is one.
    fn ask_state(&self) -> Option<Question>;

    /// A question whose answer says whether it drives, if answers to commands do not.
    fn ask_enabled(&self) -> Option<Question> {
        None
    }

    /// True if anything it says tells whether it drives.
    fn tells_enabled(&self) -> bool {
        true
    }

    /// Questions for what its state does not tell.
    fn ask_slowly(&self) -> Vec<Question> {
        Vec::new()
    }

    /// The question for a setting.
    fn ask_setting(&self, _number: u16) -> Option<Question> {
        None
    }

    /// What `frame` tells if it is this actuator's answer to the question for setting `number`.
    fn setting(&self, _number: u16, _frame: &CanFrame) -> Option<Told> {
        None
    }

    /// The frame that writes a setting until power-off.
    fn write_setting(&self, _number: u16, _bits: u32) -> Option<CanFrame> {
        None
    }

    /// Settings that must hold.
    fn settings(&self) -> Vec<Setting> {
        Vec::new()
    }

    /// An order; empty if the dialect has none for it.
    fn order(&self, order: Order) -> Vec<CanFrame>;

    /// A goal, as the guard let it through.
    fn goal(&self, goal: Goal) -> CanFrame;

    /// Frames of the cycle besides the goal itself: its answer, questions and their answers.
    fn beside_goal(&self) -> Vec<Shape>;

    /// Frames it says unasked, and how often, Hz.
    fn unasked(&self) -> Vec<(Shape, f64)> {
        Vec::new()
    }

    /// True if it answers a goal with its state.
    fn answers_goals(&self) -> bool {
        true
    }

    /// True if a goal is all it needs to drive.
    fn goal_enables(&self) -> bool {
        false
    }
}

/// One actuator of a robot.
#[derive(Clone, Debug)]
pub struct Actuator {
    profile: Arc<profiles::Actuator>,
    placing: Placing,
    language: Arc<dyn Language>,
    watch: HostWatch,
}

impl Actuator {
    /// An actuator of this profile at its place on a line.
    ///
    /// # Errors
    /// A number that its dialect does not have, in words; a validated robot file has none.
    pub fn new(
        profile: profiles::Actuator,
        placing: Placing,
        line: CanSpeed,
    ) -> Result<Self, String> {
        let ranges = || profile.ranges.clone().ok_or("its profile has no ranges".to_owned());
        let id = placing.id;
        let language: Arc<dyn Language> = match profile.dialect {
            Dialect::CubemarsMit => Arc::new(cubemars::Mit::new(placing, ranges()?)?),
            Dialect::CubemarsServo => Arc::new(cubemars::Servo::new(id)?),
            Dialect::Damiao => Arc::new(damiao::Damiao::new(placing, ranges()?)?),
            Dialect::Robstride => {
                Arc::new(robstride::Robstride::new(placing, ranges()?, line.host_id)?)
            }
            Dialect::Odrive => Arc::new(odrive::Odrive::new(id, &profile)?),
            Dialect::Moteus => Arc::new(moteus::Moteus::new(id)?),
            Dialect::Recoil => Arc::new(recoil::Recoil::new(id)?),
        };
        let watch = host_watch(&profile, placing);
        Ok(Self { profile: Arc::new(profile), placing, language, watch })
    }

    /// Its profile.
    #[must_use]
    pub fn profile(&self) -> &profiles::Actuator {
        &self.profile
    }

    /// Gains it is told with every goal, N m/rad and N m s/rad; none if it keeps its own.
    #[must_use]
    pub fn gains(&self) -> Option<(f64, f64)> {
        let told = self.profile.dialect.codes_numbers();
        told.then_some((self.placing.kp_nm_rad, self.placing.kd_nm_s_rad))
    }

    /// How it learns that its host is gone.
    #[must_use]
    pub const fn watch(&self) -> HostWatch {
        self.watch
    }

    /// What `frame` tells of it, if it is its own.
    #[must_use]
    pub fn told(&self, frame: &CanFrame) -> Option<Told> {
        self.language.told(frame)
    }

    /// The question for where it stands that changes nothing. None if only commands are answered,
    /// or if it tells unasked.
    #[must_use]
    pub fn ask_state(&self) -> Option<Question> {
        self.language.ask_state()
    }

    /// A question whose answer says whether it drives, if answers to commands do not, and it does
    /// not tell unasked.
    #[must_use]
    pub fn ask_enabled(&self) -> Option<Question> {
        self.language.ask_enabled()
    }

    /// True if anything it says tells whether it drives.
    #[must_use]
    pub fn tells_enabled(&self) -> bool {
        self.language.tells_enabled()
    }

    /// Questions for what its state does not tell, such as its supply.
    #[must_use]
    pub fn ask_slowly(&self) -> Vec<Question> {
        self.language.ask_slowly()
    }

    /// The question for a setting; none if the dialect has none.
    #[must_use]
    pub fn ask_setting(&self, number: u16) -> Option<Question> {
        self.language.ask_setting(number)
    }

    /// What `frame` tells if it is the answer to `question`.
    #[must_use]
    pub fn answer(&self, question: &Question, frame: &CanFrame) -> Option<Told> {
        match question.what {
            What::State => self.told(frame),
            What::Setting(number) => self.language.setting(number, frame),
        }
    }

    /// The frame that writes a setting until power-off. A goal is no setting.
    #[must_use]
    pub fn write_setting(&self, number: u16, bits: u32) -> Option<CanFrame> {
        self.language.write_setting(number, bits)
    }

    /// Settings that must hold for goals to mean what is meant.
    #[must_use]
    pub fn settings(&self) -> Vec<Setting> {
        self.language.settings()
    }

    /// The frames of an order; empty if the dialect has none for it.
    #[must_use]
    pub fn order(&self, order: Order) -> Vec<CanFrame> {
        self.language.order(order)
    }

    /// The frame of a goal that the guard let through; only `Link::write_goals` may ask for it
    /// (`tests/architecture.rs`).
    pub(crate) fn goal_frame(&self, goal: Goal) -> CanFrame {
        self.language.goal(goal)
    }

    /// True if it answers a goal with its state.
    #[must_use]
    pub fn answers_goals(&self) -> bool {
        self.language.answers_goals()
    }

    /// True if a goal is all it needs to drive: there is no order to enable it.
    #[must_use]
    pub fn goal_enables(&self) -> bool {
        self.language.goal_enables()
    }

    /// Forms of all frames of a cycle: goal, answer, and what is asked besides.
    #[must_use]
    pub fn cycle_shapes(&self) -> Vec<Shape> {
        let goal = self.goal_frame(Goal { position_rad: 0.0, velocity_rad_s: 0.0, holds_s: None });
        let mut shapes = vec![Shape::of(&goal)];
        shapes.extend(self.language.beside_goal());
        shapes
    }

    /// Forms of the frames it says unasked, and how often, Hz.
    #[must_use]
    pub fn unasked(&self) -> Vec<(Shape, f64)> {
        self.language.unasked()
    }

    /// The angle nearest to `angle_rad` that can be told it, not below it if `up`, not above it
    /// otherwise.
    #[must_use]
    pub fn tellable_rad(&self, angle_rad: f64, up: bool) -> f64 {
        match &self.profile.ranges {
            Some(ranges) => coded::representable(angle_rad, ranges.position_rad, up),
            None => angle_rad,
        }
    }
}

fn host_watch(profile: &profiles::Actuator, placing: Placing) -> HostWatch {
    let timeout = &profile.timeout;
    match (timeout.kind, profile.dialect) {
        (TimeoutKind::None, _) => HostWatch::Never,
        (TimeoutKind::Configured, _) => {
            placing.timeout_configured_s.map_or(HostWatch::Unsaid, HostWatch::Said)
        }
        (TimeoutKind::Register, Dialect::Moteus) => HostWatch::InGoals,
        (TimeoutKind::Register, dialect) => {
            let number = match dialect {
                Dialect::Damiao => Some(damiao::TIMEOUT),
                Dialect::Recoil => Some(recoil::WATCHDOG),
                Dialect::Robstride => Some(robstride::TIMEOUT),
                _ => None,
            };
            match number.zip(timeout.step_s) {
                Some((number, step_s)) => HostWatch::Setting { number, step_s },
                None => HostWatch::Unsaid,
            }
        }
    }
}

/// Coded feedback in SI units; a step of temperature is `step_c` degrees Celsius.
fn decoded(feedback: &Feedback, ranges: &Ranges, step_c: f64) -> Told {
    let on = |number: Option<Number>, end| coded::symmetric(number?, end);
    Told {
        position_rad: on(feedback.position, ranges.position_rad),
        velocity_rad_s: on(feedback.velocity, ranges.velocity_rad_s),
        torque_share: on(feedback.torque, 1.0),
        temperature_c: feedback.temperature.and_then(plain).map(|steps| steps * step_c),
        enabled: feedback.enabled,
        faults: Some(feedback.faults),
        ..Told::default()
    }
}

/// A number that is no code.
fn plain(number: Number) -> Option<f64> {
    match number {
        Number::Code { .. } => None,
        Number::Steps(steps) => Some(steps.into()),
        Number::Value(value) => Some(value.into()),
    }
}

/// What tells nothing but the bits of a setting.
fn value(bits: u32) -> Told {
    Told { value: Some(bits), ..Told::default() }
}

fn no_such_id(id: u8) -> String {
    format!("its dialect has no id {id}")
}
