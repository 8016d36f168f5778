//! `servo set-id` and `servo set-baud`: after either the servo is found under other terms, and is
//! looked for there before anything is said.

use super::device::{Device, is_lost};
use super::{Target, actuator};
use crate::bus::{AskError, Miss};
use crate::cli::signals::Signals;
use crate::cli::{Deed, Remarks};
use crate::error::Error;
use crate::rig::identify;
use crate::time::Duration;
use clap::Args;
use gaitway_profiles::{Baud, RegisterItem, Role};
use serde_json::json;

/// Arguments of `servo set-id`.
#[derive(Debug, Args)]
pub struct SetIdArgs {
    #[command(flatten)]
    pub(super) target: Target,
    /// The ID it gets
    pub(super) new_id: u8,
    /// Allow writing what the servo keeps at power-off
    #[arg(long)]
    pub(super) permit_eeprom: bool,
}

/// Arguments of `servo set-baud`.
#[derive(Debug, Args)]
pub struct SetBaudArgs {
    #[command(flatten)]
    target: Target,
    /// The line speed it gets, bits per second
    baud_bps: u32,
    /// Allow writing what the servo keeps at power-off
    #[arg(long)]
    permit_eeprom: bool,
}

/// Time a servo gets to change its own terms.
const CHANGING: Duration = Duration::from_millis(50);

/// Runs `servo set-id`.
///
/// # Errors
/// The new ID is taken or not one of the protocol's, no permit, torque on; or the servo is not
/// found under its new ID.
pub fn set_id(args: &SetIdArgs, remarks: Remarks) -> Result<i32, Error> {
    args.target.output.check_files(&[])?;
    if args.target.is_can()? {
        return actuator::set_id(args, remarks);
    }
    Signals::defer()?;
    let mut device = Device::open(&args.target)?;
    let (old, new) = (device.id, args.new_id);
    let item = needed(&device, Role::Id)?;
    let highest = device.model.profile().protocol.highest_id();
    if new > highest {
        return Err(Error::new("not an ID of this protocol")
            .at(device.place())
            .got(new.to_string())
            .allowed(format!("0 to {highest}")));
    }
    if new != old {
        permitted(&device, args.permit_eeprom, &format!("ID {old} would become {new}"))?;
        refuse_taken(&mut device, new)?;
        device.must_be_limp()?;
        change_id(&mut device, &item, new)?;
    }
    let bus = device.bus();
    let robot = args.target.again();
    let undo = (new != old)
        .then(|| format!("gaitway servo set-id {bus} {new} {old} --permit-eeprom{robot}"));
    let text = format!("{} now has ID {new} (before: {old})\n", device.model.profile().model);
    if let Some(undo) = &undo {
        remarks.say(&format!("to undo: {undo}"));
    }
    let report = json!({ "id_before": old, "id": new, "bus": bus, "undo": undo });
    Ok(args.target.output.conclude(&report, &text, Deed::Work, 0))
}

/// Writes the ID through the lock and finds the servo again.
pub(super) fn change_id(
    device: &mut Device,
    item: &RegisterItem<'_>,
    new: u8,
) -> Result<(), Error> {
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
fn refuse_taken(device: &mut Device, id: u8) -> Result<(), Error> {
    let place = format!("ID {id} on {}", device.bus());
    let refused = |got: String| {
        Err(Error::new("the new ID is taken")
            .at(place.clone())
            .got(got)
            .allowed("an ID where nobody answers")
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

/// Runs `servo set-baud`.
///
/// # Errors
/// A speed the servo does not know, no permit, torque on; or the servo is not found at the new
/// speed.
pub fn set_baud(args: &SetBaudArgs, remarks: Remarks) -> Result<i32, Error> {
    args.target.output.check_files(&[])?;
    if args.target.is_can()? {
        let remedy = "set it with the maker's tool on every actuator of the line, then: \
                      ip link set can0 down; ip link set can0 up type can bitrate ...";
        return actuator::refuse("giving an actuator another speed", &args.target.bus, remedy);
    }
    Signals::defer()?;
    let mut device = Device::open(&args.target)?;
    let item = needed(&device, Role::BaudRate)?;
    let known = &device.model.profile().baud;
    let Some(speed) = known.iter().find(|baud| baud.bps == args.baud_bps) else {
        let speeds: Vec<String> = known.iter().map(|baud| baud.bps.to_string()).collect();
        return Err(Error::new("the servo does not know this line speed")
            .at(device.place())
            .got(format!("{} bit/s", args.baud_bps))
            .allowed(format!("{} bit/s", speeds.join(", "))));
    };
    let old_bps = device.line.baud_bps;
    if args.baud_bps != old_bps {
        let what = format!("{old_bps} bit/s would become {} bit/s", args.baud_bps);
        permitted(&device, args.permit_eeprom, &what)?;
        device.must_be_limp()?;
        change_baud(&mut device, &item, speed)?;
    }
    let plain = device.bus().split('?').next().unwrap_or_default().to_owned();
    let new_bps = args.baud_bps;
    // A virtual servo of this process is gone when the command ends.
    let undo = (new_bps != old_bps && device.line.world.is_none()).then(|| {
        let id = device.id;
        format!("gaitway servo set-baud {plain}?baud={new_bps} {id} {old_bps} --permit-eeprom")
    });
    let model = &device.model.profile().model;
    let text =
        format!("{model}, ID {}, now speaks at {new_bps} bit/s (before: {old_bps})\n", device.id);
    if let Some(undo) = &undo {
        remarks.say(&format!("to undo: {undo}"));
    }
    let report = json!({
        "id": device.id, "baud_bps_before": old_bps, "baud_bps": new_bps, "bus": plain, "undo": undo
    });
    Ok(args.target.output.conclude(&report, &text, Deed::Work, 0))
}

/// Writes the speed through the lock and finds the servo again.
pub(super) fn change_baud(
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

fn needed(device: &Device, role: Role) -> Result<RegisterItem<'static>, Error> {
    device.item(role).ok_or_else(|| {
        Error::new(format!("the servo has no register for {role:?}")).at(device.place())
    })
}

fn permitted(device: &Device, permit_eeprom: bool, what: &str) -> Result<(), Error> {
    if permit_eeprom {
        return Ok(());
    }
    Err(Error::new("this is kept at power-off; nothing was written")
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
