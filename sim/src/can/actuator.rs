//! A virtual CAN actuator: a motor with its drive, and the language of its family.

use super::cubemars::{Mit, ServoMode};
use super::damiao::Damiao;
use super::drive::{Drive, Trouble};
use super::moteus::Moteus;
use super::odrive::Odrive;
use super::recoil::Recoil;
use super::robstride::Robstride;
use super::{CanFrame, Kind};
use crate::hand::Grip;
use crate::servo::Event;
use gaitway_profiles::{Actuator as Profile, Dialect};
use std::ops::Range;

/// From a frame to its answer, ns; measured values lie between 50 and 300 us.
const ANSWER_DELAY_NS: u64 = 100_000;
/// From power-up until a drive listens, ns (assumed).
pub(crate) const BOOT_NS: u64 = 300_000_000;

/// Why an actuator cannot be played.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ActuatorError {
    /// No profile has this name, or it is wrong.
    #[error("{0}")]
    Profile(String),
    /// Not an id of the family.
    #[error("id {0} is none of the {1} family")]
    Id(u8, String),
    /// The family codes its numbers on ranges, and the profile has none.
    #[error("its profile has no ranges")]
    NoRanges,
}

fn known(model: &str) -> Result<Profile, ActuatorError> {
    gaitway_profiles::actuator(model).map_err(|error| ActuatorError::Profile(error.to_string()))
}

/// What each family remembers, and how it speaks.
#[derive(Clone, Debug)]
enum Family {
    Mit(Mit),
    ServoMode(ServoMode),
    Damiao(Damiao),
    Robstride(Robstride),
    Odrive(Odrive),
    Moteus(Moteus),
    Recoil(Recoil),
}

/// One actuator.
#[derive(Clone, Debug)]
pub struct Actuator {
    model: String,
    drive: Drive,
    family: Family,
    /// Spans in which it neither hears nor answers, ns.
    silent: Vec<Range<u64>>,
    plugged: bool,
    /// Frames it has said so far.
    pub(crate) said: u64,
    now_ns: u64,
}

impl Actuator {
    /// An actuator of the profile `model`, at rest at zero, disabled, its timeout as the factory
    /// sets it.
    ///
    /// # Errors
    /// No such profile, or an id the family does not have.
    pub fn new(model: &str, id: u8) -> Result<Actuator, ActuatorError> {
        Actuator::with(&known(model)?, id)
    }

    /// As [`Actuator::new`], with a profile that need not be shipped.
    ///
    /// # Errors
    /// As [`Actuator::new`].
    pub fn with(profile: &Profile, id: u8) -> Result<Actuator, ActuatorError> {
        if id > profile.dialect.last_id() {
            return Err(ActuatorError::Id(id, format!("{:?}", profile.dialect)));
        }
        let ranges = || profile.ranges.clone().ok_or(ActuatorError::NoRanges);
        let family = match profile.dialect {
            Dialect::CubemarsMit => Family::Mit(Mit::new(id, ranges()?)),
            Dialect::CubemarsServo => {
                let gear = profile.gear.as_ref();
                let pole_pairs = gear.and_then(|gear| gear.pole_pairs).unwrap_or(1);
                let turns = gear.map_or(1.0, |gear| gear.ratio) * f64::from(pole_pairs);
                Family::ServoMode(ServoMode::new(id, turns))
            }
            Dialect::Damiao => Family::Damiao(Damiao::new(id, ranges()?)),
            Dialect::Robstride => Family::Robstride(Robstride::new(id, &profile.name, ranges()?)),
            Dialect::Odrive => Family::Odrive(Odrive::new(id, profile)),
            Dialect::Moteus => Family::Moteus(Moteus::new(id)),
            Dialect::Recoil => Family::Recoil(Recoil::new(id)),
        };
        let factory_ns = profile.timeout.factory_s.map(|seconds| (seconds * 1e9) as u64);
        let mut drive = Drive::new(profile);
        drive.set_timeout(factory_ns);
        let model = profile.name.clone();
        Ok(Actuator { model, drive, family, silent: Vec::new(), plugged: true, said: 0, now_ns: 0 })
    }

    /// Where the shaft is, rad.
    #[must_use]
    pub fn position_rad(&self) -> f64 {
        self.drive.shaft_rad()
    }

    /// How fast it turns, rad/s.
    #[must_use]
    pub fn velocity_rad_s(&self) -> f64 {
        self.drive.velocity_rad_s
    }

    /// Whether it drives.
    #[must_use]
    pub fn enabled(&self) -> bool {
        self.drive.enabled
    }

    /// The fault it remembers.
    #[must_use]
    pub fn trouble(&self) -> Option<Trouble> {
        self.drive.latched
    }

    /// Puts the shaft somewhere, past the line.
    pub fn place(&mut self, position_rad: f64) {
        self.drive.place(position_rad);
    }

    /// Sets the silence it allows, ns, as the maker's tool would; none = any.
    pub fn set_timeout(&mut self, timeout_ns: Option<u64>) {
        self.drive.set_timeout(timeout_ns);
        match &mut self.family {
            Family::Moteus(moteus) => moteus.default_timeout_ns = timeout_ns,
            Family::Recoil(recoil) => recoil.set_timeout(timeout_ns),
            _ => {}
        }
    }

    /// Sets how often a CubeMars in servo mode tells of itself, Hz, as the maker's tool would;
    /// nothing happens to the others.
    pub fn set_feedback_rate(&mut self, feedback_hz: u32) {
        if let Family::ServoMode(family) = &mut self.family {
            family.set_rate(feedback_hz.min(500), self.now_ns);
        }
    }

    /// Sets the identifier of a Damiao's answers (MST_ID), as the maker's tool would; nothing
    /// happens to the others.
    pub fn set_answer_id(&mut self, id: u16) {
        if let Family::Damiao(damiao) = &mut self.family {
            damiao.set_answer_id(id);
        }
    }

    /// Something is wrong from now on, or not any more. What it makes the drive remember must be
    /// cleared all the same.
    pub fn set_trouble(&mut self, trouble: Option<Trouble>) {
        self.drive.set_cause(trouble);
    }

    /// The overload protection trips; nothing stands in the way of clearing it.
    pub fn overload(&mut self) {
        self.drive.trip(Trouble::Overload);
    }

    /// Blocks the shaft, or lets it go.
    pub fn set_stuck(&mut self, stuck: bool) {
        self.drive.stuck = stuck;
    }

    /// The encoder reports one position for good, or the truth again.
    pub fn set_frozen(&mut self, frozen: bool) {
        self.drive.frozen_rad = frozen.then_some(self.drive.shaft_rad());
    }

    /// It neither hears nor answers for a while. Its motor goes on, and its timeout runs.
    pub fn be_silent(&mut self, span_ns: Range<u64>) {
        self.silent.push(span_ns);
    }

    /// Ends the silence that would last until `until_ns`.
    pub(crate) fn speak_again(&mut self, until_ns: u64) {
        self.silent.retain(|span| span.end != until_ns);
    }

    /// Its plug is drawn: it loses its power, and neither hears nor answers.
    pub(crate) fn unplug(&mut self) {
        self.restart(self.now_ns);
        self.plugged = false;
    }

    /// It is plugged in, and boots.
    pub(crate) fn plug(&mut self) {
        self.plugged = true;
        self.restart(self.now_ns + BOOT_NS);
    }

    pub(crate) const fn is_plugged(&self) -> bool {
        self.plugged
    }

    /// Power that was to come back later comes back now.
    pub(crate) fn power_back(&mut self, until_ns: u64) {
        let was_silent = self.silent.len();
        self.speak_again(until_ns);
        if self.silent.len() < was_silent && until_ns > self.now_ns {
            self.be_silent(self.now_ns..until_ns.min(self.now_ns + BOOT_NS));
        }
    }

    /// Somebody takes the shaft to `to_rad`, with at most this torque.
    pub(crate) fn grip(&mut self, to_rad: f64, speed_rad_s: f64, torque_nm: f64, holds_on: bool) {
        let at_rad = self.drive.shaft_rad();
        self.drive.grip = Some(Grip::new(at_rad, to_rad, speed_rad_s, torque_nm, holds_on));
    }

    /// Nobody has the shaft in hand any more.
    pub(crate) fn let_go_of(&mut self) {
        self.drive.grip = None;
    }

    /// Its profile.
    pub(crate) fn model(&self) -> &str {
        &self.model
    }

    pub(crate) const fn torque_max_nm(&self) -> f64 {
        self.drive.torque_max_nm
    }

    pub(crate) fn is_in_hand(&self) -> bool {
        self.drive.grip.is_some()
    }

    /// Power goes, and it listens again at `until_ns`, with what it has kept.
    pub fn restart(&mut self, until_ns: u64) {
        self.drive.restart();
        self.silent.push(self.now_ns..until_ns);
        match &mut self.family {
            Family::Damiao(damiao) => damiao.restart(),
            Family::Robstride(robstride) => robstride.restart(),
            Family::Odrive(odrive) => odrive.restart(),
            Family::Moteus(moteus) => moteus.restart(),
            Family::Recoil(recoil) => recoil.restart(&mut self.drive),
            Family::Mit(_) | Family::ServoMode(_) => {}
        }
    }

    fn is_silent(&self) -> bool {
        !self.plugged || self.silent.iter().any(|span| span.contains(&self.now_ns))
    }

    pub(super) const fn answer_delay_ns(&self) -> u64 {
        ANSWER_DELAY_NS
    }

    /// What it answers to a frame of the host, who queued it at `asked_ns`.
    pub(super) fn hear(&mut self, frame: &CanFrame, asked_ns: u64) -> Vec<CanFrame> {
        self.silent.retain(|span| span.end > self.now_ns);
        if self.is_silent() {
            return Vec::new();
        }
        let drive = &mut self.drive;
        let _ = drive.take_told();
        drive.asked(asked_ns);
        let classic = frame.kind == Kind::Classic;
        match &mut self.family {
            Family::Mit(family) if classic => family.hear(drive, frame),
            Family::ServoMode(family) if classic => family.hear(drive, frame),
            Family::Damiao(family) if classic => family.hear(drive, frame),
            Family::Robstride(family) if classic => family.hear(drive, frame),
            Family::Recoil(family) if classic => family.hear(drive, frame),
            Family::Odrive(family) => family.hear(drive, frame),
            Family::Moteus(family) => family.hear(drive, frame),
            _ => Vec::new(),
        }
    }

    /// When it speaks without being asked next.
    pub(super) fn due_ns(&self) -> Option<u64> {
        match &self.family {
            Family::ServoMode(family) => family.due_ns(),
            Family::Odrive(family) => family.due_ns(),
            Family::Robstride(family) => family.due_ns(&self.drive, self.now_ns),
            Family::Recoil(family) => family.due_ns(),
            Family::Mit(_) | Family::Damiao(_) | Family::Moteus(_) => None,
        }
    }

    /// What it says without being asked, now that it is due.
    pub(super) fn speak(&mut self) -> Vec<CanFrame> {
        let _ = self.drive.take_told();
        let said = match &mut self.family {
            Family::ServoMode(family) => family.speak(&self.drive),
            Family::Odrive(family) => family.speak(&self.drive, self.now_ns),
            Family::Robstride(family) => family.speak(&self.drive, self.now_ns),
            Family::Recoil(family) => family.speak(&self.drive, self.now_ns),
            Family::Mit(_) | Family::Damiao(_) | Family::Moteus(_) => Vec::new(),
        };
        if self.is_silent() { Vec::new() } else { said }
    }

    pub(super) fn run_until(&mut self, time_ns: u64) {
        self.drive.run_until(time_ns);
        self.now_ns = self.now_ns.max(time_ns);
    }

    /// The position, microradians, that is in what it has just said, if it is.
    pub(super) fn take_told(&self) -> Option<i64> {
        self.drive.take_told()
    }

    /// What the referee judges, with the time of each.
    pub(crate) fn take_events(&mut self) -> Vec<(u64, Event)> {
        std::mem::take(&mut self.drive.events)
    }
}
