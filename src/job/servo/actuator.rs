//! One actuator of a CAN line: who it is, and its numbered settings, never a goal and never torque.

mod change;
mod setting;

pub use change::Restarted;
pub use setting::{SettingChange, SettingOrder, SettingValue};

use super::{RETRIES, Which};
use crate::bus::can::Peer;
use crate::bus::can::scan::{Call, Found, find, overhear};
use crate::bus::{AskError, Miss};
use crate::error::{Error, ErrorKind};
use crate::rig::{CanIdentity, can_ask_error, describe, dialect_name, dialect_of};
use crate::rig::{OpenCanLine, open_can};
use crate::time::Duration;
use crate::wire::can::{cubemars, moteus, robstride};
use gaitway_profiles::{self as profiles, Dialect};

/// Longer than three beats of an ODrive's heart.
const LISTEN: Duration = Duration::from_millis(350);
/// The host's id among moteus, as the maker's programs have it.
const MOTEUS_HOST: u8 = 0;

/// An actuator that was found.
pub struct Actuator {
    /// The line it hangs on.
    pub line: OpenCanLine,
    /// Its place there, and what it said of itself.
    pub identity: CanIdentity,
    /// The profile the user or the robot file names for it.
    pub named: Option<profiles::Actuator>,
    /// The line's address, for words.
    bus: String,
}

impl Actuator {
    /// Opens the line and asks who is there.
    ///
    /// # Errors
    /// Nobody answers, several dialects answer, or a dialect that cannot be asked.
    pub fn open(which: &Which) -> Result<Self, Error> {
        let named = which.model.as_deref().map(profiles::actuator).transpose()?;
        let wanted = which.dialect;
        let mut line = open_can(&which.bus, which.robot.as_deref(), 0)?;
        let named = named.or_else(|| of_robot(&line, which.id));
        let dialect = match (wanted, named.as_ref().map(|of| of.dialect)) {
            (Some(wanted), Some(of)) if wanted != of => {
                return Err(Error::new("the model speaks another protocol")
                    .at("--model")
                    .got(dialect_name(of))
                    .allowed(dialect_name(wanted)));
            }
            (wanted, of) => wanted.or(of),
        };
        let place = format!("ID {} on {} at {}", which.id, which.bus, line.speed_words());
        let found = look_for(&mut line, which.id, dialect)
            .map_err(|e| can_ask_error(&line, place.clone(), &e))?;
        let found = match found[..] {
            [one] => one,
            [] => {
                let silent = AskError::Miss(Miss::Silent);
                let error = can_ask_error(&line, place, &silent);
                return Err(if dialect.is_none() {
                    error.remedy(
                        "check power, cable and ID; recoil and cubemars-mit are only asked if \
                         named with --protocol or --model",
                    )
                } else {
                    error
                });
            }
            ref several => {
                let names = several.iter().map(|of| dialect_name(dialect_of(&of.peer)));
                return Err(Error::new("devices of several protocols have this ID")
                    .at(place)
                    .got(names.collect::<Vec<_>>().join(", "))
                    .remedy("say which is meant with --protocol"));
            }
        };
        let identity = describe(&mut line, &found).map_err(|e| can_ask_error(&line, place, &e))?;
        Ok(Self { line, identity, named, bus: which.bus.to_string() })
    }

    /// Its place on the line.
    #[must_use]
    pub const fn peer(&self) -> Peer {
        self.identity.peer
    }

    /// What it speaks.
    #[must_use]
    pub const fn dialect(&self) -> Dialect {
        dialect_of(&self.identity.peer)
    }

    /// The line's address as the user can type it.
    #[must_use]
    pub fn bus(&self) -> &str {
        &self.bus
    }

    /// Its profile, if it is named or there is only one that it may be of.
    #[must_use]
    pub fn profile(&self) -> Option<&profiles::Actuator> {
        match &self.identity.candidates[..] {
            _ if self.named.is_some() => self.named.as_ref(),
            [one] => Some(one),
            _ => None,
        }
    }

    /// What it is, in words.
    #[must_use]
    pub fn model(&self) -> String {
        let named = self.profile().map(|of| of.model.clone());
        let said = named.or_else(|| self.identity.model());
        said.unwrap_or_else(|| dialect_name(self.dialect()).to_owned())
    }

    /// Where it is, in words.
    #[must_use]
    pub fn place(&self) -> String {
        format!("{}, ID {} on {}", self.model(), self.peer().id(), self.bus)
    }

    /// Words for a question that failed.
    #[must_use]
    pub fn failed(&self, error: &AskError) -> Error {
        can_ask_error(&self.line, self.place(), error)
    }

    /// Refuses while torque is on, as far as the actuator tells.
    ///
    /// # Errors
    /// Torque is on.
    pub fn must_be_limp(&self) -> Result<(), Error> {
        if self.identity.torque_on != Some(true) {
            return Ok(());
        }
        Err(Error::of(
            ErrorKind::NotReady,
            "torque is on; how an actuator is set up is only changed while it is limp",
        )
        .at(self.place())
        .remedy("support the robot, then: gaitway limp ROBOT --bus BUS"))
    }
}

/// The profile of the joint with this id, if a robot was named.
fn of_robot(line: &OpenCanLine, id: u8) -> Option<profiles::Actuator> {
    let (robot, number) = line.robot.as_ref()?;
    let mut on_line = robot.joints.iter().filter(|joint| joint.line == *number);
    Some(on_line.find(|joint| joint.id == id)?.actuator()?.profile().clone())
}

/// Who has this id, asked only in what moves and switches nothing.
fn look_for(
    line: &mut OpenCanLine,
    id: u8,
    dialect: Option<Dialect>,
) -> Result<Vec<Found>, AskError> {
    let mut found = Vec::new();
    if dialect.is_none_or(|of| matches!(of, Dialect::Odrive | Dialect::CubemarsServo)) {
        let until = line.clock.now() + LISTEN;
        let heard = overhear(&mut line.bus, until)?.devices;
        let meant = |of: &Found| dialect.is_none_or(|wanted| dialect_of(&of.peer) == wanted);
        found.extend(heard.into_iter().filter(|of| of.peer.id() == id && meant(of)));
    }
    if dialect == Some(Dialect::CubemarsMit) {
        // It cannot be asked; that it is there is the user's word.
        let peer = cubemars::Id::new(id).map(|id| Peer::CubemarsMit { id });
        let known = |peer| Found { peer, unasked: false, serial: None, contradicts: false };
        found.extend(peer.map(known));
    }
    for call in calls(line, dialect) {
        let budget = line.budget();
        // A damaged first answer is asked for again; who is silent twice is not there.
        line.bus.set_retries(1);
        let answered = find(&mut line.bus, call, id, budget);
        line.bus.set_retries(RETRIES);
        let answered = answered?;
        let known = |of: &Found| found.iter().any(|one: &Found| one.peer == of.peer);
        if let Some(one) = answered.filter(|one| !known(one)) {
            found.retain(|of| dialect_of(&of.peer) != dialect_of(&one.peer));
            found.push(one);
        }
    }
    Ok(found)
}

/// Questions for one dialect, or for all that nobody takes for a command.
fn calls(line: &OpenCanLine, dialect: Option<Dialect>) -> Vec<Call> {
    let robstride = robstride::Id::new(line.host_id()).map(Call::Robstride);
    let moteus = moteus::Id::new(MOTEUS_HOST).filter(|_| line.fd).map(Call::Moteus);
    match dialect {
        None => [Some(Call::Damiao), robstride, moteus].into_iter().flatten().collect(),
        Some(Dialect::Damiao) => vec![Call::Damiao],
        Some(Dialect::Robstride) => robstride.into_iter().collect(),
        Some(Dialect::Odrive) => vec![Call::Odrive],
        Some(Dialect::Moteus) => moteus.into_iter().collect(),
        Some(Dialect::Recoil) => vec![Call::Recoil],
        Some(Dialect::CubemarsMit | Dialect::CubemarsServo) => Vec::new(),
    }
}
