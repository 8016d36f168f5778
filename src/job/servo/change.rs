//! What a serial servo is changed in that it is found by, its ID and its line speed, and how it is set
//! back: afterwards it is looked for before anything is said.

use super::device::{Device, is_lost};
use crate::bus::{AskError, FactoryReset, Miss, Protocol};
use crate::error::{Error, ErrorKind};
use crate::job::{Event, Observer};
use crate::rig::{Identity, identify};
use crate::time::Duration;
use gaitway_profiles::{Baud, RegisterItem, Role};

/// Time a servo gets to change its own terms.
const CHANGING: Duration = Duration::from_millis(50);

/// A restart takes a fraction of this.
const RESTART: Duration = Duration::from_secs(5);
/// Time between two questions whether the servo is back.
const AGAIN: Duration = Duration::from_millis(100);

/// Writes the ID through the lock and finds the servo again.
pub fn change_id(device: &mut Device, item: &RegisterItem<'_>, new: u8) -> Result<(), Error> {
    let old = device.id;
    device.may_be_found_at(new, device.line.baud_bps);
    device.unlocked(|device| {
        // It may answer under either ID: whether it worked is seen by looking for it.
        match device.write(item, i64::from(new)) {
            Err(error) if !is_lost(&error) => return Err(device.failed(&error)),
            _ => {}
        }
        device.line.clock.sleep_until(device.line.clock.now() + CHANGING);
        device.id = new;
        let lost = match device.read(item) {
            Ok(kept) if kept == i64::from(new) => return Ok(()),
            Ok(kept) => return Err(not_kept(device, kept, i64::from(new))),
            Err(error) => error.remedy(look_everywhere(device)),
        };
        // If it did not hear of its new ID it still has the old one.
        device.id = old;
        match device.read(item) {
            Ok(kept) => Err(not_kept(device, kept, i64::from(new))),
            Err(_) => Err(lost),
        }
    })
}

/// Two devices with one ID cannot be told apart any more by anyone.
pub fn refuse_taken(device: &mut Device, id: u8) -> Result<(), Error> {
    let place = format!("ID {id} on {}", device.bus());
    let refused = |got: String| {
        Err(Error::of(ErrorKind::Busy, "the new ID is taken")
            .at(place.clone())
            .got(got)
            .allowed("an ID that no device has")
            .remedy("`gaitway scan BUS` lists those in use"))
    };
    match identify(&mut device.line, id, None) {
        Ok(None) => Ok(()),
        Ok(Some(other)) => refused(format!("model number {} answers there", other.model_number)),
        Err(AskError::Miss(miss)) if !matches!(miss, Miss::HostLate { .. }) => {
            refused(miss.to_string())
        }
        Err(error) => Err(device.failed(&error)),
    }
}

/// Writes the speed through the lock and finds the servo again.
pub fn change_baud(
    device: &mut Device,
    item: &RegisterItem<'_>,
    speed: &Baud,
) -> Result<(), Error> {
    let (old_bps, wanted) = (device.line.baud_bps, i64::from(speed.index));
    device.may_be_found_at(device.id, speed.bps);
    device.unlocked(|device| {
        match device.write(item, wanted) {
            Err(error) if !is_lost(&error) => return Err(device.failed(&error)),
            _ => {}
        }
        device.line.clock.sleep_until(device.line.clock.now() + CHANGING);
        device.line.set_speed(speed.bps)?;
        let lost = match device.read(item) {
            Ok(kept) if kept == wanted => return Ok(()),
            Ok(kept) => return Err(not_kept(device, kept, wanted)),
            Err(error) => error.remedy(look_everywhere(device)),
        };
        // If it did not hear of its new speed it still has the old one.
        device.line.set_speed(old_bps)?;
        match device.read(item) {
            Ok(kept) => Err(not_kept(device, kept, wanted)),
            Err(_) => Err(lost),
        }
    })
}

/// The register for `role`, which the servo must have.
///
/// # Errors
/// It has none.
pub fn needed(device: &Device, role: Role) -> Result<RegisterItem<'static>, Error> {
    device.item(role).ok_or_else(|| {
        Error::new(format!("the servo has no register for {role:?}")).at(device.place())
    })
}

/// Refuses to change what is kept at power-off without a permit.
///
/// # Errors
/// No permit.
pub fn permitted(device: &Device, permit_eeprom: bool, what: &str) -> Result<(), Error> {
    if permit_eeprom {
        return Ok(());
    }
    Err(Error::of(ErrorKind::NotPermitted, "this is kept at power-off; nothing was written")
        .at(device.place())
        .got(what)
        .remedy("add --permit-eeprom if that is meant"))
}

fn not_kept(device: &Device, got: i64, wanted: i64) -> Error {
    Error::new("the servo did not keep what was written")
        .at(device.place())
        .got(format!("{got} (raw)"))
        .allowed(format!("{wanted} (raw)"))
}

fn look_everywhere(device: &Device) -> String {
    let bus = device.bus().split('?').next().unwrap_or_default();
    format!(
        "it was written, but the servo is not where it should be: gaitway scan {bus} --baud all"
    )
}

/// How a servo came back from a restart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rebooted {
    /// Its firmware.
    pub firmware: u16,
    /// True if it drives its motor.
    pub torque_on: bool,
    /// The errors that it reported before, raw, where it has a register for them.
    pub errors_before: Option<i64>,
    /// Those that it reports now.
    pub errors: Option<i64>,
}

/// Restarts a servo; `supported`: it may let go of what it carries.
///
/// # Errors
/// A servo that cannot, that holds something, or that does not come back.
pub fn reboot(
    device: &mut Device,
    supported: bool,
    observer: &dyn Observer,
) -> Result<Rebooted, Error> {
    let protocol = device.model.protocol();
    if protocol != Protocol::Dynamixel2 {
        return Err(Error::new("this protocol has no instruction to restart a servo")
            .at(device.place())
            .got(protocol.to_string())
            .remedy("switch its power off and on"));
    }
    if device.torque_on()? && !supported {
        return Err(Error::of(
            ErrorKind::NotPermitted,
            "the servo holds something: restarting lets it go",
        )
        .at(device.place())
        .remedy("support what it carries, then add --yes"));
    }
    let errors_before = device.read_role(Role::HardwareError)?;
    let (id, budget) = (device.id, device.line.budget());
    let told = device.line.bus.reboot(protocol, id, budget);
    obeyed(told).map_err(|e| device.failed(&e))?;
    observer.hear(Event::Note("restarting ..."));
    let firmware = wait_for(device, id)?.firmware;
    let errors = device.read_role(Role::HardwareError)?;
    let torque_on = device.torque_on()?;
    Ok(Rebooted { firmware, torque_on, errors_before, errors })
}

/// What a servo that was set back was found by before, and is now.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FactoryState {
    /// Its ID before.
    pub id_before: u8,
    /// Its ID.
    pub id: u8,
    /// Its line's speed before, bit/s.
    pub baud_bps_before: u32,
    /// Its line's speed, bit/s.
    pub baud_bps: u32,
    /// Its firmware.
    pub firmware: u16,
}

/// Sets every register to what the servo left the factory with; with `everything` its ID and line speed
/// too.
///
/// # Errors
/// No permit, torque on, a servo that cannot keep its ID while asked to, or that does not come back.
pub fn factory_reset(
    device: &mut Device,
    everything: bool,
    permit_eeprom: bool,
    observer: &dyn Observer,
) -> Result<FactoryState, Error> {
    let protocol = device.model.protocol();
    let (id_before, baud_bps_before) = (device.id, device.line.baud_bps);
    if protocol != Protocol::Dynamixel2 && !everything {
        return Err(Error::new("this servo can only be reset with its ID and line speed")
            .at(device.place())
            .got(protocol.to_string())
            .remedy("unplug every other servo first, then add --everything"));
    }
    let (id, baud_bps) =
        if everything { factory_terms(device)? } else { (id_before, baud_bps_before) };
    let what = format!(
        "every register of {} becomes what it left the factory with; afterwards it has ID {id} at \
         {baud_bps} bit/s",
        device.place()
    );
    if !permit_eeprom {
        return Err(Error::of(
            ErrorKind::NotPermitted,
            "nothing was written: this is kept at power-off",
        )
        .at(device.place())
        .got(what)
        .remedy(
            "save what you need (`gaitway servo get BUS ID --json`), then add --permit-eeprom",
        ));
    }
    observer.hear(Event::Note(&what));
    device.must_be_limp()?;
    if id != id_before {
        refuse_taken_by_reset(device, id)?;
    }
    let keep = if everything { FactoryReset::Everything } else { FactoryReset::KeepIdAndBaud };
    let firmware = set_back(device, keep, id, baud_bps)?.firmware;
    Ok(FactoryState { id_before, id, baud_bps_before, baud_bps, firmware })
}

/// Sets a servo back through its lock and finds it again as `id` at `bps` bits per second.
pub(super) fn set_back(
    device: &mut Device,
    keep: FactoryReset,
    id: u8,
    bps: u32,
) -> Result<Identity, Error> {
    device.may_be_found_at(id, bps);
    device.unlocked(|device| {
        let (protocol, budget) = (device.model.protocol(), device.line.budget());
        let told = device.line.bus.factory_reset(protocol, device.id, keep, budget);
        obeyed(told).map_err(|e| device.failed(&e))?;
        device.line.clock.sleep_until(device.line.clock.now() + AGAIN);
        if bps != device.line.baud_bps {
            device.line.set_speed(bps)?;
        }
        wait_for(device, id)
    })
}

/// ID and line speed of the model when it leaves the factory.
fn factory_terms(device: &Device) -> Result<(u8, u32), Error> {
    let initial = |role| device.item(role).and_then(|item| item.initial());
    let id = initial(Role::Id).and_then(|id| u8::try_from(id).ok());
    let index = initial(Role::BaudRate);
    let speeds = &device.model.profile().baud;
    let bps = speeds.iter().find(|b| index == Some(b.index.into())).map(|b| b.bps);
    id.zip(bps).ok_or_else(|| {
        Error::new("the servo's profile does not say its ID and speed from the factory")
            .at(device.place())
    })
}

/// Refuses a reset after which two servos would have one ID.
///
/// # Errors
/// Somebody else answers under it.
fn refuse_taken_by_reset(device: &mut Device, id: u8) -> Result<(), Error> {
    match identify(&mut device.line, id, None) {
        Ok(None) => Ok(()),
        Err(error @ (AskError::Port(_) | AskError::Miss(Miss::HostLate { .. }))) => {
            Err(device.failed(&error))
        }
        _ => Err(Error::of(ErrorKind::Busy, "another servo has the ID that this one would get")
            .at(device.place())
            .got(format!("ID {id} answers"))
            .remedy("unplug the other one first")),
    }
}

/// A lost answer is no refusal: whether it obeyed is seen when it is back.
fn obeyed(told: Result<crate::bus::Reply, AskError>) -> Result<(), AskError> {
    match told {
        Err(error) if !is_lost(&error) => Err(error),
        _ => Ok(()),
    }
}

/// Asks until the servo answers as `id`.
fn wait_for(device: &mut Device, id: u8) -> Result<Identity, Error> {
    device.id = id;
    let clock = std::sync::Arc::clone(&device.line.clock);
    let until = clock.now() + RESTART;
    let protocol = Some(device.model.protocol());
    loop {
        clock.sleep_until(clock.now() + AGAIN);
        match identify(&mut device.line, id, protocol) {
            Ok(Some(identity)) => return Ok(identity),
            Err(AskError::Port(error)) => return Err(device.failed(&AskError::Port(error))),
            _ if clock.now() < until => {}
            _ => {
                return Err(Error::of(ErrorKind::Silent, "the servo has not come back")
                    .at(device.place())
                    .remedy("gaitway scan BUS --baud all"));
            }
        }
    }
}
