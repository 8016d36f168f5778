//! An actuator's own ID, and its restart.

use super::{Actuator, calls};
use crate::bus::can::Peer;
use crate::bus::can::scan::{find, overhear};
use crate::device::parameter::{Access, Parameter, parameters};
use crate::error::{Error, ErrorKind};
use crate::job::{Event, Observer};
use crate::rig::dialect_name;
use crate::time::Duration;
use crate::wire::can::{CanFrame, damiao, odrive, recoil, robstride};
use gaitway_profiles::Dialect;

/// Time an actuator gets to change its own terms.
const CHANGING: Duration = Duration::from_millis(100);
/// A restart takes a fraction of this.
const RESTART: Duration = Duration::from_secs(5);
/// Longer than two beats of a heart.
const BEATS: Duration = Duration::from_millis(350);

/// How an actuator came back from a restart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Restarted {
    /// True if it drives its motor; `None`: it does not say.
    pub torque_on: Option<bool>,
    /// True if it reports an error again.
    pub faulty: bool,
}

impl Actuator {
    /// Gives the actuator another ID, for good; nothing is written if it has it already.
    ///
    /// # Errors
    /// A dialect without it, an id that is taken or none of the dialect's, no permit, torque on; or the
    /// actuator is not found under its new id.
    pub fn set_id(&mut self, new: u8, permit_eeprom: bool) -> Result<(), Error> {
        let old = self.peer().id();
        let first = u8::from(self.dialect() != Dialect::Robstride);
        let last = self.dialect().last_id();
        if !(first..=last).contains(&new) {
            return Err(Error::new("not an ID of this protocol")
                .at(self.place())
                .got(new.to_string())
                .allowed(format!("{first} to {last}")));
        }
        let frames = id_frames(self, new)?;
        if new == old {
            return Ok(());
        }
        if !permit_eeprom {
            return Err(Error::of(
                ErrorKind::NotPermitted,
                "this is kept at power-off; nothing was written",
            )
            .at(self.place())
            .got(format!("ID {old} would become {new}"))
            .remedy("add --permit-eeprom if that is meant"));
        }
        refuse_taken(self, new)?;
        self.must_be_limp()?;
        for frame in frames {
            self.tell(&frame)?;
        }
        if !answers(self, new)? {
            return Err(Error::of(
                ErrorKind::Silent,
                "the actuator does not answer under its new ID",
            )
            .at(self.place())
            .got("nothing")
            .remedy(format!("gaitway scan {} says where it is", self.bus())));
        }
        // The new id is in force; now it is kept as well.
        match renamed(self.peer(), new).and_then(|peer| peer.save()) {
            Some(save) => self.tell(&save),
            None => Ok(()),
        }
    }

    /// Sends what takes the actuator a while.
    fn tell(&mut self, frame: &CanFrame) -> Result<(), Error> {
        let budget = self.line.budget();
        self.line.bus.send(frame, budget).map_err(|e| self.failed(&e))?;
        self.line.clock.sleep_until(self.line.clock.now() + CHANGING);
        Ok(())
    }

    /// Restarts the actuator; `supported`: it may let go of what it carries.
    ///
    /// # Errors
    /// A dialect without it, torque that is on, an actuator that does not come back.
    pub fn reboot(&mut self, supported: bool, observer: &dyn Observer) -> Result<Restarted, Error> {
        let Peer::Odrive { id } = self.peer() else {
            return Err(Error::new("this dialect has no command to restart an actuator")
                .at(self.place())
                .got(dialect_name(self.dialect()))
                .remedy("switch its power off and on"));
        };
        if self.identity.torque_on != Some(false) && !supported {
            return Err(Error::of(
                ErrorKind::NotPermitted,
                "the actuator may hold something: restarting lets it go",
            )
            .at(self.place())
            .remedy("support what it carries, then add --yes"));
        }
        let budget = self.line.budget();
        let restart = odrive::command(id, odrive::Command::Reboot);
        self.line.bus.send(&restart, budget).map_err(|e| self.failed(&e))?;
        observer.hear(Event::Note("restarting ..."));
        let give_up = self.line.clock.now() + RESTART;
        loop {
            let until = self.line.clock.now() + BEATS;
            let heard = overhear(&mut self.line.bus, until).map_err(|e| self.failed(&e))?;
            if heard.devices.iter().any(|of| of.peer == (Peer::Odrive { id })) {
                break;
            }
            if self.line.clock.now() >= give_up {
                return Err(Error::of(ErrorKind::Silent, "the actuator has not come back")
                    .at(self.place())
                    .remedy("gaitway scan BUS"));
            }
        }
        let told = self.line.bus.state_of(&Peer::Odrive { id }, BEATS);
        let told = told.map_err(|e| self.failed(&e))?;
        Ok(Restarted {
            torque_on: told.map(|(on, _)| on),
            faulty: told.is_some_and(|(_, faults)| !faults.is_none()),
        })
    }
}

/// What gives the actuator its new id.
fn id_frames(actuator: &Actuator, new: u8) -> Result<Vec<CanFrame>, Error> {
    let own_id = |of: &&Parameter| of.access == Access::Identity && of.name != "MST_ID";
    let frame = match actuator.peer() {
        Peer::Robstride { id, host } => robstride::Id::new(new)
            .map(|new| robstride::command(host, id, robstride::Command::SetId(new))),
        peer @ (Peer::Damiao { .. } | Peer::Recoil { .. }) => parameters(actuator.dialect())
            .iter()
            .find(own_id)
            .and_then(|parameter| parameter.write(&peer, new.into())),
        _ => None,
    };
    let tool = match actuator.dialect() {
        Dialect::Odrive => "odrivetool: odrv0.axis0.config.can.node_id",
        Dialect::Moteus => "moteus_tool: conf set id.id",
        _ => "the maker's tool",
    };
    frame.map(|frame| vec![frame]).ok_or_else(|| {
        Error::new("this dialect keeps no ID that is set over the line")
            .at(actuator.place())
            .remedy(tool)
    })
}

/// The same device under another id.
fn renamed(peer: Peer, new: u8) -> Option<Peer> {
    Some(match peer {
        Peer::Damiao { answer_id, .. } => Peer::Damiao { id: damiao::Id::new(new)?, answer_id },
        Peer::Recoil { .. } => Peer::Recoil { id: recoil::Id::new(new)? },
        // What it is told is kept at once.
        _ => return None,
    })
}

fn answers(actuator: &mut Actuator, id: u8) -> Result<bool, Error> {
    for call in calls(&actuator.line, Some(actuator.dialect())) {
        let budget = actuator.line.budget();
        let found = find(&mut actuator.line.bus, call, id, budget);
        if found.map_err(|e| actuator.failed(&e))?.is_some() {
            return Ok(true);
        }
    }
    Ok(false)
}

/// Two devices with one id cannot be told apart any more by anyone.
fn refuse_taken(actuator: &mut Actuator, id: u8) -> Result<(), Error> {
    if !answers(actuator, id)? {
        return Ok(());
    }
    Err(Error::of(ErrorKind::Busy, "the new ID is taken")
        .at(format!("ID {id} on {}", actuator.bus()))
        .got("somebody answers there")
        .allowed("an ID that no device has")
        .remedy("`gaitway scan BUS` lists those in use"))
}
