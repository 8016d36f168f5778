//! `servo info`, `servo get`, `servo set`.

use super::{Target, actuator};
use crate::cli::signals::Signals;
use crate::cli::{Deed, Remarks};
use crate::error::Error;
use crate::job::report::OwnProfile;
use crate::job::servo::device::{Change, Device};
use crate::job::servo::register::{find, firmware_words, is_indirect};
use crate::job::servo::value;
use crate::rig::protocol_name;
use clap::Args;
use gaitway_profiles::{Region, RegisterItem, Role};
use serde_json::{Map, Value, json};
use std::fmt::Write;

/// Arguments of `servo get`.
#[derive(Debug, Args)]
pub struct GetArgs {
    #[command(flatten)]
    pub(super) target: Target,
    /// Register by the maker's name; case, spaces and underscores do not matter [default: all]
    pub(super) register: Option<String>,
}

/// Arguments of `servo set`.
#[derive(Debug, Args)]
pub struct SetArgs {
    #[command(flatten)]
    pub(super) target: Target,
    /// Register by the maker's name; case, spaces and underscores do not matter
    pub(super) register: String,
    /// SI value (angles in rad, or in degrees with deg behind), or a whole number
    #[arg(allow_hyphen_values = true)]
    pub(super) value: String,
    /// VALUE is the number that goes into the register
    #[arg(long)]
    pub(super) raw: bool,
    /// Allow writing what the servo keeps at power-off; on CAN lines: make the actuator keep what is
    /// set
    #[arg(long)]
    pub(super) permit_eeprom: bool,
    /// Check and say what would be written, and write nothing
    #[arg(long)]
    pub(super) dry_run: bool,
}

/// The facts of `servo info`, in this order.
const INFO: [Role; 22] = [
    Role::BaudRate,
    Role::ReturnDelay,
    Role::StatusReturnLevel,
    Role::OperatingMode,
    Role::DriveMode,
    Role::Phase,
    Role::HomingOffset,
    Role::MinPositionLimit,
    Role::MaxPositionLimit,
    Role::TemperatureLimit,
    Role::MinVoltageLimit,
    Role::MaxVoltageLimit,
    Role::TorqueEnable,
    Role::GoalPosition,
    Role::PresentPosition,
    Role::PresentVelocity,
    Role::PresentCurrent,
    Role::PresentLoad,
    Role::PresentVoltage,
    Role::PresentTemperature,
    Role::HardwareError,
    Role::BusWatchdog,
];

/// Runs `servo info`.
///
/// # Errors
/// A servo that does not answer.
pub fn info(target: &Target) -> Result<i32, Error> {
    target.output.check_files(&[])?;
    if target.is_can()? {
        return actuator::info(target);
    }
    let mut device = Device::open(&target.which()?)?;
    let items: Vec<_> = INFO.iter().filter_map(|&role| device.item(role)).collect();
    let read = read_all(&mut device, &items)?;
    let profile = device.model.profile();
    let firmware = firmware_words(profile, device.firmware);
    let mut text = format!(
        "{} {}, ID {} on {} at {} bit/s\nmodel number {}, {}, firmware {firmware}\n",
        profile.maker,
        profile.model,
        device.id,
        device.bus(),
        device.line.baud_bps,
        device.model_number,
        protocol_name(device.model.protocol()),
    );
    text.push_str(&table(&device, &read));
    let own = OwnProfile::named([profile.name.as_str()]);
    own.iter().for_each(|own| text.push_str(&format!("profile {own}\n")));
    let report = json!({
        "id": device.id,
        "bus": device.bus(),
        "profiles": own,
        "baud_bps": device.line.baud_bps,
        "protocol": protocol_name(device.model.protocol()),
        "model": profile.model,
        "profile": profile.name,
        "model_number": device.model_number,
        "firmware": device.firmware,
        "registers": registers_json(&device, &read),
    });
    Ok(target.output.conclude(&report, &text, Deed::Look, 0))
}

type Read = Vec<(RegisterItem<'static>, i64)>;

fn read_all(device: &mut Device, items: &[RegisterItem<'static>]) -> Result<Read, Error> {
    items.iter().map(|item| Ok((*item, device.read(item)?))).collect()
}

fn table(device: &Device, read: &Read) -> String {
    let mut out = String::new();
    for (item, raw) in read {
        let words = value::words(&device.model, item, *raw);
        let _ = writeln!(out, "  {:>4}  {:<28} {words}", item.address, item.name());
    }
    out
}

fn registers_json(device: &Device, read: &Read) -> Vec<Map<String, Value>> {
    read.iter().map(|(item, raw)| value::json(&device.model, item, *raw)).collect()
}

/// Runs `servo get`.
///
/// # Errors
/// A servo that does not answer, a register it does not have.
pub fn get(args: &GetArgs) -> Result<i32, Error> {
    args.target.output.check_files(&[])?;
    if args.target.is_can()? {
        return actuator::get(args);
    }
    let mut device = Device::open(&args.target.which()?)?;
    let profile = device.model.profile();
    let Some(name) = &args.register else {
        let items: Vec<_> = profile.items().filter(|item| !is_indirect(item)).collect();
        let read = read_all(&mut device, &items)?;
        let text = format!("{}\n{}", device.place(), table(&device, &read));
        let report = registers_json(&device, &read);
        return Ok(args.target.output.conclude(&report, &text, Deed::Look, 0));
    };
    let item = find(profile, name)?;
    let raw = device.read(&item)?;
    let text = format!("{}: {}\n", item.name(), value::words(&device.model, &item, raw));
    let report = value::json(&device.model, &item, raw);
    Ok(args.target.output.conclude(&report, &text, Deed::Look, 0))
}

/// Runs `servo set`.
///
/// # Errors
/// What [`Device::set`] refuses or finds.
pub fn set(args: &SetArgs, remarks: Remarks) -> Result<i32, Error> {
    args.target.output.check_files(&[])?;
    if args.target.is_can()? {
        return actuator::set(args, remarks);
    }
    Signals::defer()?;
    let mut device = Device::open(&args.target.which()?)?;
    let item = find(device.model.profile(), &args.register)?;
    let raw = value::parse(&device.model, &item, &args.value, args.raw)?;
    device.may_set(&item, raw, args.permit_eeprom || args.dry_run)?;
    let change = if args.dry_run {
        let old = device.read(&item)?;
        Change { old, new: raw }
    } else {
        device.set(&item, raw, args.permit_eeprom)?
    };
    let words = |raw| value::words(&device.model, &item, raw);
    let verb = match (args.dry_run, change.old == change.new) {
        (_, true) => "is already",
        (true, false) => "would become",
        (false, false) => "is now",
    };
    let mut text = format!("{} {verb} {}\n", item.name(), words(change.new));
    if change.old != change.new {
        let _ = writeln!(text, "  before: {}", words(change.old));
    }
    let undo = undo(&device, &item, change.old, args);
    let changed = change.old != change.new && !args.dry_run;
    if changed {
        remarks.say(&format!("to undo: {undo}"));
    }
    if changed && item.register.region == Region::Ram {
        remarks.say("the servo forgets this at power-off");
    }
    let mut report = value::json(&device.model, &item, change.new);
    report.insert("raw_before".into(), change.old.into());
    report.insert("dry_run".into(), args.dry_run.into());
    report.insert("undo".into(), if changed { undo.into() } else { Value::Null });
    let deed = if changed { Deed::Work } else { Deed::Look };
    Ok(args.target.output.conclude(&report, &text, deed, 0))
}

fn undo(device: &Device, item: &RegisterItem<'_>, old: i64, args: &SetArgs) -> String {
    let permit = if item.register.region == Region::Eeprom { " --permit-eeprom" } else { "" };
    let name = item.name();
    let robot = args.target.again();
    let bus = device.bus();
    format!("gaitway servo set {bus} {} '{name}' --raw{permit}{robot} -- {old}", device.id)
}
