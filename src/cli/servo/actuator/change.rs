//! `servo set-id` and `servo reboot` for an actuator of a CAN line, and what cannot be done there.

use crate::bus::can::Peer;
use crate::bus::can::scan::{find, overhear};
use crate::cli::servo::identity::SetIdArgs;
use crate::cli::servo::reset::RebootArgs;
use crate::cli::{Deed, Remarks};
use crate::device::parameter::{Access, Parameter, parameters};
use crate::error::{Error, ErrorKind};
use crate::job::servo::actuator::{Actuator, calls};
use crate::rig::dialect_name;
use crate::time::Duration;
use crate::wire::can::{CanFrame, odrive, robstride};
use gaitway_profiles::Dialect;
use serde_json::json;

/// Time an actuator gets to change its own terms.
const CHANGING: Duration = Duration::from_millis(100);
/// A restart takes a fraction of this.
const RESTART: Duration = Duration::from_secs(5);
/// Longer than two beats of a heart.
const BEATS: Duration = Duration::from_millis(350);

/// Refuses a command of serial servos, in words.
///
/// # Errors
/// Always.
pub fn refuse(what: &str, bus: &dyn std::fmt::Display, remedy: &str) -> Result<i32, Error> {
    Err(Error::new(format!("{what} is not available on CAN lines"))
        .at(bus.to_string())
        .remedy(remedy))
}

/// Runs `servo set-id`.
///
/// # Errors
/// A dialect without it, an id that is taken or none of the dialect's, no permit, torque on; or the
/// actuator is not found under its new id.
pub fn set_id(args: &SetIdArgs, remarks: Remarks) -> Result<i32, Error> {
    let mut actuator = Actuator::open(&args.target.which()?)?;
    let (old, new) = (actuator.peer().id(), args.new_id);
    let last = actuator.dialect().last_id();
    if new > last || (new == 0 && actuator.dialect() != Dialect::Robstride) {
        let first = u8::from(actuator.dialect() != Dialect::Robstride);
        return Err(Error::new("not an ID of this protocol")
            .at(actuator.place())
            .got(new.to_string())
            .allowed(format!("{first} to {last}")));
    }
    let frames = id_frames(&actuator, new)?;
    if new != old {
        if !args.permit_eeprom {
            return Err(Error::of(
                ErrorKind::NotPermitted,
                "this is kept at power-off; nothing was written",
            )
            .at(actuator.place())
            .got(format!("ID {old} would become {new}"))
            .remedy("add --permit-eeprom if that is meant"));
        }
        refuse_taken(&mut actuator, new)?;
        actuator.must_be_limp()?;
        for frame in frames {
            let budget = actuator.line.budget();
            actuator.line.bus.send(&frame, budget).map_err(|e| actuator.failed(&e))?;
            actuator.line.clock.sleep_until(actuator.line.clock.now() + CHANGING);
        }
        if !answers(&mut actuator, new)? {
            return Err(Error::of(
                ErrorKind::Silent,
                "the actuator does not answer under its new ID",
            )
            .at(actuator.place())
            .got("nothing")
            .remedy(format!("gaitway scan {} says where it is", actuator.bus())));
        }
        // The new id is in force; now it is kept as well.
        if let Some(save) = renamed(actuator.peer(), new).and_then(|peer| peer.save()) {
            let budget = actuator.line.budget();
            actuator.line.bus.send(&save, budget).map_err(|e| actuator.failed(&e))?;
            actuator.line.clock.sleep_until(actuator.line.clock.now() + CHANGING);
        }
    }
    let protocol = dialect_name(actuator.dialect());
    let undo = (new != old).then(|| {
        let (bus, again) = (actuator.bus(), args.target.again());
        format!(
            "gaitway servo set-id {bus} {new} {old} --protocol {protocol} --permit-eeprom{again}"
        )
    });
    if let Some(undo) = &undo {
        remarks.say(&format!("to undo: {undo}"));
    }
    let text = format!("{} now has ID {new} (before: {old})\n", actuator.model());
    let report = json!({
        "id_before": old, "id": new, "bus": actuator.bus(), "protocol": protocol, "undo": undo
    });
    Ok(args.target.output.conclude(&report, &text, Deed::Work, 0))
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
    use crate::wire::can::{damiao, recoil};
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

/// Runs `servo reboot`.
///
/// # Errors
/// A dialect without it, torque that is on, an actuator that does not come back.
pub fn reboot(args: &RebootArgs, remarks: Remarks) -> Result<i32, Error> {
    let mut actuator = Actuator::open(&args.target.which()?)?;
    let Peer::Odrive { id } = actuator.peer() else {
        return Err(Error::new("this dialect has no command to restart an actuator")
            .at(actuator.place())
            .got(dialect_name(actuator.dialect()))
            .remedy("switch its power off and on"));
    };
    if actuator.identity.torque_on != Some(false) && !args.yes {
        return Err(Error::of(
            ErrorKind::NotPermitted,
            "the actuator may hold something: restarting lets it go",
        )
        .at(actuator.place())
        .remedy("support what it carries, then add --yes"));
    }
    let budget = actuator.line.budget();
    let restart = odrive::command(id, odrive::Command::Reboot);
    actuator.line.bus.send(&restart, budget).map_err(|e| actuator.failed(&e))?;
    remarks.say("restarting ...");
    let give_up = actuator.line.clock.now() + RESTART;
    loop {
        let until = actuator.line.clock.now() + BEATS;
        let heard = overhear(&mut actuator.line.bus, until).map_err(|e| actuator.failed(&e))?;
        if heard.devices.iter().any(|of| of.peer == (Peer::Odrive { id })) {
            break;
        }
        if actuator.line.clock.now() >= give_up {
            return Err(Error::of(ErrorKind::Silent, "the actuator has not come back")
                .at(actuator.place())
                .remedy("gaitway scan BUS"));
        }
    }
    let told = actuator.line.bus.state_of(&Peer::Odrive { id }, BEATS);
    let told = told.map_err(|e| actuator.failed(&e))?;
    let torque_on = told.map(|(on, _)| on);
    let faulty = told.is_some_and(|(_, faults)| !faults.is_none());
    let text = format!("{} is back\n", actuator.place());
    let report = json!({ "id": id.get(), "torque_on": torque_on, "faulty": faulty });
    let code = args.target.output.conclude(&report, &text, Deed::Work, 0);
    if faulty {
        return Err(Error::new("an error came back at once").at(actuator.place()));
    }
    Ok(code)
}
