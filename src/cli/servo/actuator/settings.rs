//! `servo info`, `servo get` and `servo set` for an actuator of a CAN line.

use crate::cli::servo::Target;
use crate::cli::servo::registers::{GetArgs, SetArgs};
use crate::cli::{Deed, Remarks};
use crate::error::Error;
use crate::job::servo::actuator::{Actuator, SettingChange, SettingOrder, SettingValue};
use crate::rig::dialect_name;
use serde_json::{Value, json};
use std::fmt::Write;

/// Runs `servo info`.
///
/// # Errors
/// An actuator that does not answer.
pub fn info(target: &Target) -> Result<i32, Error> {
    let mut actuator = Actuator::open(&target.which()?)?;
    let read = actuator.settings()?;
    let identity = &actuator.identity;
    let known = |fact: &Option<String>| fact.clone().unwrap_or_else(|| "not told".to_owned());
    let torque = identity.torque_on.map_or("not told", |on| if on { "on" } else { "off" });
    let faults = identity.faults.map_or_else(|| "not told".to_owned(), |f| f.to_string());
    let mut text = format!(
        "{}, ID {} on {} at {}\n{}, hardware {}, firmware {}, serial number {}\ntorque {torque}, \
         faults: {faults}\n",
        actuator.model(),
        actuator.peer().id(),
        actuator.bus(),
        actuator.line.speed_words(),
        dialect_name(actuator.dialect()),
        known(&identity.hardware),
        known(&identity.firmware),
        known(&identity.serial),
    );
    if let Some(why) = actuator.has_no_settings() {
        let _ = writeln!(text, "{why}");
    }
    text.push_str(&table(&read));
    let report = json!({
        "id": actuator.peer().id(),
        "bus": actuator.bus(),
        "bitrate_bps": actuator.line.speed.bitrate_bps,
        "data_bitrate_bps": actuator.line.speed.data_bitrate_bps,
        "protocol": dialect_name(actuator.dialect()),
        "model": actuator.model(),
        "profile": actuator.profile().map(|of| of.name.clone()),
        "hardware": identity.hardware,
        "firmware": identity.firmware,
        "serial": identity.serial,
        "torque_on": identity.torque_on,
        "faults": identity.faults.map(|faults| faults.to_string()),
        "registers": read.iter().map(SettingValue::json).collect::<Vec<_>>(),
    });
    Ok(target.output.conclude(&report, &text, Deed::Look, 0))
}

/// Runs `servo get`.
///
/// # Errors
/// An actuator that does not answer, a setting it does not have.
pub fn get(args: &GetArgs) -> Result<i32, Error> {
    let mut actuator = Actuator::open(&args.target.which()?)?;
    let output = &args.target.output;
    let Some(name) = &args.register else {
        let read = actuator.settings()?;
        let text = format!("{}\n{}", actuator.place(), table(&read));
        let list: Vec<_> = read.iter().map(SettingValue::json).collect();
        return Ok(output.conclude(&list, &text, Deed::Look, 0));
    };
    let setting = actuator.setting(name)?;
    let text = format!("{}: {}\n", setting.name(), setting.words());
    Ok(output.conclude(&setting.json(), &text, Deed::Look, 0))
}

/// Runs `servo set`.
///
/// # Errors
/// As [`Actuator::change_setting`].
pub fn set(args: &SetArgs, remarks: Remarks) -> Result<i32, Error> {
    let mut actuator = Actuator::open(&args.target.which()?)?;
    let SettingChange { old, new, changed, kept } = actuator.change_setting(&SettingOrder {
        name: args.register.clone(),
        value: args.value.clone(),
        raw: args.raw,
        keep: args.permit_eeprom,
        dry_run: args.dry_run,
    })?;
    if kept {
        remarks.say("kept at power-off, and so is all else that was set since the last time");
    }
    let is_same = old == new;
    let verb = match (args.dry_run, is_same) {
        (_, true) => "is already",
        (true, false) => "would become",
        (false, false) => "is now",
    };
    let mut text = format!("{} {verb} {}\n", new.name(), new.words());
    if !is_same {
        let _ = writeln!(text, "  before: {}", old.words());
    }
    let undo = undo(&actuator, &old, args);
    if changed {
        remarks.say(&format!("to undo: {undo}"));
    }
    if changed && !args.permit_eeprom {
        remarks.say("the actuator forgets this at power-off; --permit-eeprom makes it keep it");
    }
    let mut report = new.json();
    report.insert("raw_before".into(), old.raw().into());
    report.insert("dry_run".into(), args.dry_run.into());
    report.insert("kept".into(), kept.into());
    report.insert("undo".into(), if changed { undo.into() } else { Value::Null });
    let deed = if changed { Deed::Work } else { Deed::Look };
    Ok(args.target.output.conclude(&report, &text, deed, 0))
}

fn undo(actuator: &Actuator, old: &SettingValue, args: &SetArgs) -> String {
    let permit = if args.permit_eeprom { " --permit-eeprom" } else { "" };
    let again = args.target.again();
    let protocol = dialect_name(actuator.dialect());
    format!(
        "gaitway servo set {} {} {} --raw --protocol {protocol}{permit}{again} -- {}",
        actuator.bus(),
        actuator.peer().id(),
        old.name().replace(' ', "_"),
        old.raw(),
    )
}

fn table(read: &[SettingValue]) -> String {
    let mut out = String::new();
    for setting in read {
        let number = match setting.number() {
            small @ ..256 => small.to_string(),
            large => format!("0x{large:04X}"),
        };
        let _ = writeln!(out, "  {number:>6}  {:<28} {}", setting.name(), setting.words());
    }
    out
}
