//! What a test does to a world past its lines while it runs: registers, hands, plugs, faults, time. The
//! control channel ([`crate::control`]) has the same verbs.

use super::{Placed, Start, World};
use crate::SimError;
use crate::fault::Fault;
use crate::fault::plan::{Place, Strike};
use crate::hand::Hand;
use crate::journal::Journal;
use crate::referee::When;
use crate::servo::Servo;
use gaitway_profiles::Role;
use std::sync::Weak;

/// Of the stall torque: what a hand gives.
const USUAL_HAND: f64 = 0.25;

/// How a joint really is, whatever its registers say.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointState {
    /// Where it is, rad.
    pub position_rad: f64,
    /// How fast it turns, rad/s.
    pub velocity_rad_s: f64,
    /// Its servo gives torque, or its actuator is enabled.
    pub torque: bool,
    /// Its servo is plugged in; actuators are plugged in unless [`World::unplug`] drew the plug.
    pub plugged: bool,
    /// A hand has it.
    pub in_hand: bool,
    /// Statuses its servo has given so far, or frames its actuator.
    pub statuses: u64,
}

/// `present_position` is `Present Position`, and `Present-Position` too.
fn plain(name: &str) -> String {
    name.chars().filter(|c| c.is_ascii_alphanumeric()).collect::<String>().to_ascii_lowercase()
}

impl World {
    fn place_of(&self, servo: &str) -> Result<Place, SimError> {
        self.shared.faults.names().servo(servo)
    }

    pub(crate) fn line_of(&self, line: &str) -> Result<usize, SimError> {
        let place = self.lines.iter().position(|known| known.name == line);
        place.ok_or_else(|| SimError::UnknownLine(line.to_string()))
    }

    /// The servo there, moved on to now, unless an actuator is there.
    fn servo_at(&mut self, name: &str, place: Place) -> Result<&mut Servo, SimError> {
        if self.can.contains_key(&place.line) {
            return Err(SimError::NoRegisters(name.to_string()));
        }
        Ok(self.at(place))
    }

    /// The name of a register as the profile has it, however it is written; a number is its address.
    fn register_named(&mut self, name: &str, place: Place, text: &str) -> Result<String, SimError> {
        let servo = self.servo_at(name, place)?;
        let (wanted, address) = (plain(text), text.parse::<u16>().ok());
        let names = || servo.model.profile.items().map(|item| (item.name(), item.address));
        let found = names().find(|(known, at)| plain(known) == wanted || Some(*at) == address);
        found.map(|(name, _)| name).ok_or_else(|| SimError::UnknownRegister {
            servo: servo.model.profile.name.clone(),
            register: text.to_string(),
            known: names().map(|(name, _)| name).collect::<Vec<_>>().join(", "),
        })
    }

    /// Raw value of a servo's register. The servo is named by its joint or as `LINE/ID` with the ID it
    /// had at first; the register as in the profile, in any spelling of its words, or by its address.
    ///
    /// # Errors
    /// No such servo or register, or a CAN actuator.
    pub fn read_register(&mut self, servo: &str, register: &str) -> Result<i64, SimError> {
        let place = self.place_of(servo)?;
        let name = self.register_named(servo, place, register)?;
        let unknown = || SimError::UnknownJoint(servo.to_string());
        self.servo_at(servo, place)?.named(&name).ok_or_else(unknown)
    }

    /// All registers of a servo with their raw values, in the order of the profile.
    ///
    /// # Errors
    /// As [`World::read_register`].
    pub fn registers(&mut self, servo: &str) -> Result<Vec<(String, i64)>, SimError> {
        let place = self.place_of(servo)?;
        let servo = self.servo_at(servo, place)?;
        let names: Vec<String> = servo.model.profile.items().map(|item| item.name()).collect();
        Ok(names.into_iter().filter_map(|name| Some((name.clone(), servo.named(&name)?))).collect())
    }

    /// Presets a register past all rules, as [`World::set_register`]; names as for
    /// [`World::read_register`].
    ///
    /// # Errors
    /// No such servo or register, a CAN actuator, or a value that does not fit.
    pub fn preset(&mut self, servo: &str, register: &str, raw: i64) -> Result<(), SimError> {
        let place = self.place_of(servo)?;
        let name = self.register_named(servo, place, register)?;
        if self.displace(place, |servo| servo.force(&name, raw)) {
            self.tell_lines();
            return Ok(());
        }
        let (low, high) = self.at(place).model.named(&name).map_or((0, 0), |i| i.representable());
        Err(SimError::Value { register: name, raw, low, high })
    }

    /// True if this register says where the shaft is, and torque holds it there.
    pub(crate) fn is_place_under_torque(
        &mut self,
        servo: &str,
        register: &str,
    ) -> Result<bool, SimError> {
        let place = self.place_of(servo)?;
        let name = self.register_named(servo, place, register)?;
        let servo = self.servo_at(servo, place)?;
        let is_place =
            servo.model.named(&name).is_some_and(|item| item.role == Some(Role::PresentPosition));
        Ok(is_place && servo.torque_on())
    }

    /// How a joint really is.
    ///
    /// # Errors
    /// No joint has this name.
    pub fn joint_state(&mut self, joint: &str) -> Result<JointState, SimError> {
        let unknown = || SimError::UnknownJoint(joint.to_string());
        let Placed { place, .. } = self.placed(joint)?;
        let (torque, plugged, in_hand) = match self.actuator(joint) {
            Some(actuator) => (actuator.enabled(), actuator.is_plugged(), actuator.is_in_hand()),
            None => {
                let servo = self.at(place);
                (servo.torque_on(), servo.attached, servo.motor.is_in_hand())
            }
        };
        Ok(JointState {
            position_rad: self.joint_position_rad(joint).ok_or_else(unknown)?,
            velocity_rad_s: self.joint_velocity_rad_s(joint).ok_or_else(unknown)?,
            torque,
            plugged,
            in_hand,
            statuses: self.statuses(joint).ok_or_else(unknown)?,
        })
    }

    fn placed(&self, joint: &str) -> Result<Placed, SimError> {
        let index = self.by_name.get(joint).and_then(|&index| self.joints.get(index));
        index.copied().ok_or_else(|| SimError::UnknownJoint(joint.to_string()))
    }

    /// Takes a joint by hand. Without torque it follows; one that is held resists with what it has.
    ///
    /// # Errors
    /// No joint has this name, or a number of the hand is none, or not above zero.
    pub fn take_by_hand(&mut self, joint: &str, hand: Hand) -> Result<(), SimError> {
        let Hand { to_rad, speed_rad_s, torque_nm, holds_on } = hand;
        let sound = to_rad.abs() <= 1e6 && speed_rad_s > 0.0 && torque_nm > 0.0;
        if !(sound && speed_rad_s <= 1e6 && torque_nm <= 1e6) {
            return Err(SimError::NoHand);
        }
        let Placed { place, initial_rad, offset_rad, ratio } = self.placed(joint)?;
        let (speed, torque_nm) = (speed_rad_s / ratio.abs(), torque_nm * ratio.abs());
        let index = self.by_name.get(joint).copied();
        if let Some(actuator) = self.actuator_mut(joint) {
            let before = (actuator.position_rad() * 1e6).round() as i64;
            actuator.grip((to_rad + offset_rad) / ratio, speed, torque_nm, holds_on);
            index.into_iter().for_each(|joint| self.shared.referee.displaced(joint, before));
            return Ok(());
        }
        let servo = self.at(place);
        let before = servo.present_position();
        let most = torque_nm / servo.model.profile.motor.stall_torque_nm;
        servo.grip((to_rad - initial_rad) / ratio, speed, most, holds_on);
        index.into_iter().for_each(|joint| self.shared.referee.displaced(joint, before));
        Ok(())
    }

    /// The hand lets go of a joint, if one has it.
    ///
    /// # Errors
    /// No joint has this name.
    pub fn let_go(&mut self, joint: &str) -> Result<(), SimError> {
        let Placed { place, .. } = self.placed(joint)?;
        match self.actuator_mut(joint) {
            Some(actuator) => actuator.let_go_of(),
            None => self.at(place).motor.let_go_of(),
        }
        Ok(())
    }

    /// Draws the plug of a servo or actuator: it loses its power, and neither hears nor answers. Named
    /// by its joint, or as `LINE/ID`.
    ///
    /// # Errors
    /// No such servo.
    pub fn unplug(&mut self, servo: &str) -> Result<(), SimError> {
        self.replug(servo, false)
    }

    /// Plugs a servo or actuator in again: it boots, without torque.
    ///
    /// # Errors
    /// No such servo.
    pub fn plug(&mut self, servo: &str) -> Result<(), SimError> {
        self.replug(servo, true)
    }

    fn replug(&mut self, servo: &str, plugged: bool) -> Result<(), SimError> {
        let place = self.place_of(servo)?;
        let now_ns = self.now_ns;
        if let Some(can) = self.can.get_mut(&place.line) {
            if let Some(actuator) = can.actuators_mut().get_mut(place.servo)
                && actuator.is_plugged() != plugged
            {
                if plugged { actuator.plug() } else { actuator.unplug() }
            }
            return Ok(());
        }
        let servo = self.at(place);
        if servo.attached != plugged {
            if plugged { servo.plug(now_ns) } else { servo.unplug(now_ns) }
        }
        self.tell_lines();
        Ok(())
    }

    /// Pulls the adapter of a line out: see [`World::connection`].
    ///
    /// # Errors
    /// No such line.
    pub fn pull_out(&mut self, line: &str) -> Result<(), SimError> {
        let line = self.line_of(line)?;
        if self.connection(line).is_some() {
            self.strike(Strike::HangUp { line });
        }
        Ok(())
    }

    /// Plugs the adapter of a line in again.
    ///
    /// # Errors
    /// No such line.
    pub fn plug_in(&mut self, line: &str) -> Result<(), SimError> {
        let line = self.line_of(line)?;
        if self.connection(line).is_none() {
            self.strike(Strike::PlugIn { line, link: None });
        }
        Ok(())
    }

    /// Adds faults that belong together while the world runs; what is to begin in the past begins now.
    /// Their number, by which [`World::end`] ends them. Those of [`crate::Options`] have the numbers
    /// from 0 on in their order.
    ///
    /// # Errors
    /// A joint, line or register that is not there, or too many faults in force.
    pub fn begin(&mut self, faults: &[Fault]) -> Result<u64, SimError> {
        let names = self.shared.faults.names().clone();
        for fault in faults {
            self.check_register(fault, &names)?;
            self.check_actuator(fault, &names)?;
            self.check_weight(fault)?;
        }
        let crate::line::Shared { faults: plan, rng, .. } = &mut self.shared;
        let number = plan.begin(faults, rng)?;
        self.run_until(self.now_ns);
        Ok(number)
    }

    /// Ends a fault, whenever it was to end: what it holds is let go, an encoder that jumped reads true
    /// again, a register has the value it had. An overload or a reboot is not undone.
    ///
    /// # Errors
    /// No fault has this number, or nothing is left of it.
    pub fn end(&mut self, number: u64) -> Result<(), SimError> {
        let strikes = self.shared.faults.end(number).ok_or(SimError::NoSuchFault(number))?;
        for strike in strikes {
            self.strike(strike);
        }
        Ok(())
    }

    /// Everything is as it was when the world was made, and its time is zero: registers, places, faults,
    /// chance, the journal, what the referee saw. Doors stay open, and what is on its way in them is
    /// lost; an adapter that was pulled out is plugged in. Frozen time stays frozen.
    ///
    /// # Errors
    /// Its time goes with a host in this process ([`crate::PatientTime`]).
    pub fn reset(&mut self) -> Result<(), SimError> {
        if self.pace.as_ref().is_some_and(|pace| !pace.set(0)) {
            return Err(SimError::OthersTime);
        }
        let Start { lines, can, mut shared } = (*self.start).clone();
        shared.real_time = self.shared.real_time;
        std::mem::swap(&mut shared.journal, &mut self.shared.journal);
        shared.journal.reset();
        let before = std::mem::replace(&mut self.lines, lines);
        for (line, before) in self.lines.iter_mut().zip(before) {
            line.plugged = before.plugged;
            if !line.plugged.now {
                line.plugged.now = true;
                line.plugged.times += 1;
            }
        }
        let before = std::mem::replace(&mut self.can, can);
        for (line, before) in self.can.values_mut().zip(before.values()) {
            line.set_queue(before.options().queue_frames);
        }
        self.shared = shared;
        self.now_ns = 0;
        if let Some(weight) = &mut self.weight {
            weight.hold_again();
        }
        self.resets += 1;
        Ok(())
    }

    /// How often [`World::reset`] was called.
    pub fn resets(&self) -> u64 {
        self.resets
    }

    /// Time stands still from now on, where it went with real time; where it passes only when asked, it
    /// does anyway.
    ///
    /// # Errors
    /// Its time goes with a host in this process ([`crate::PatientTime`]).
    pub fn freeze(&mut self) -> Result<(), SimError> {
        self.catch_up();
        match &self.pace {
            Some(pace) if !pace.freeze() => Err(SimError::OthersTime),
            _ => Ok(()),
        }
    }

    /// Time goes with real time again, if a door is open.
    pub fn unfreeze(&mut self) {
        if let Some(pace) = &self.pace {
            pace.run();
        }
    }

    /// True while time passes only when asked.
    pub fn is_frozen(&self) -> bool {
        self.pace.as_ref().is_none_or(crate::door::Pace::is_frozen)
    }

    /// Lets so much time pass at once.
    ///
    /// # Errors
    /// Time runs by itself.
    pub fn step(&mut self, time_ns: u64) -> Result<(), SimError> {
        if !self.is_frozen() {
            return Err(SimError::TimeRuns);
        }
        let until_ns = self.now_ns.saturating_add(time_ns);
        self.run_until(until_ns);
        self.keep_up();
        if let Some(pace) = &self.pace {
            pace.set(until_ns);
        }
        Ok(())
    }

    /// Moves the world on to the present of real time, if it goes with that.
    pub(crate) fn catch_up(&mut self) {
        if let Some(pace) = &self.pace {
            self.run_until(pace.now_ns());
        }
    }

    /// Keeps a journal from now on, or none.
    pub fn keep_journal(&mut self, keep: bool) {
        self.shared.journal.keep(keep);
    }

    /// What has happened, if that is kept.
    pub fn journal(&self) -> &Journal {
        &self.shared.journal
    }

    /// Wakes the doors: something may be due earlier than they think.
    pub(crate) fn ring(&mut self) {
        self.bells.retain(|bell| bell.upgrade().is_some());
        self.bells.iter().filter_map(Weak::upgrade).for_each(|bell| bell.ring());
    }

    /// The most that a hand gives a joint unless it is told otherwise, N m: a quarter of what its drive
    /// gives when stalled, so that one that is held stays.
    ///
    /// # Errors
    /// No joint has this name.
    pub fn usual_hand_nm(&mut self, joint: &str) -> Result<f64, SimError> {
        let Placed { place, ratio, .. } = self.placed(joint)?;
        let stall_nm = match self.actuator(joint) {
            Some(actuator) => actuator.torque_max_nm(),
            None => self.at(place).model.profile.motor.stall_torque_nm,
        };
        Ok(USUAL_HAND * stall_nm / ratio.abs())
    }

    /// The line of a servo, and the ID it has now.
    pub(crate) fn line_and_id(&mut self, servo: &str) -> Result<(usize, Option<u8>), SimError> {
        let place = self.place_of(servo)?;
        let id = (!self.can.contains_key(&place.line)).then(|| self.at(place).id());
        Ok((place.line, id))
    }

    /// Name, line, ID at first and profile of every joint.
    pub(crate) fn joints_told(&self) -> Vec<(String, usize, u8, String)> {
        let servos = self.shared.faults.names().servos.iter();
        let told = servos.map(|(name, id, place)| {
            let servo = self.lines.get(place.line).and_then(|line| line.servos.get(place.servo));
            let model = servo.map(|servo| servo.model.profile.name.clone());
            let actuator = self.actuator(name).map(|actuator| actuator.model().to_string());
            (name.clone(), place.line, *id, model.or(actuator).unwrap_or_default())
        });
        told.collect()
    }

    /// What the register at an address of a servo is called.
    pub(crate) fn register_name(&self, line: usize, id: u8, address: u16) -> Option<String> {
        let servo = self.lines.get(line)?.servos.iter().find(|servo| servo.id() == id)?;
        let mut items = servo.model.profile.items();
        items.find(|item| item.address == address).map(|item| item.name())
    }

    fn tell_lines(&mut self) {
        let when = When::at(self.now_ns);
        for line in &mut self.lines {
            line.report(when, &mut self.shared);
        }
    }
}
