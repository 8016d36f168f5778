//! `servo info`, `servo get` and `servo set` for an actuator of a CAN line.

use crate::bus::AskError;
use crate::cli::servo::Target;
use crate::cli::servo::registers::{GetArgs, SetArgs};
use crate::cli::{Deed, Remarks};
use crate::device::parameter::{Access, Parameter, parameters};
use crate::error::{Error, ErrorKind};
use crate::job::servo::actuator::Actuator;
use crate::job::servo::register::plain;
use crate::job::servo::value::rounded;
use crate::rig::dialect_name;
use crate::time::Duration;
use crate::wire::can::CanFrame;
use gaitway_profiles::Dialect;
use serde_json::{Map, Value, json};
use std::fmt::Write;

/// Settings with their bits.
type Read = Vec<(Parameter, u32)>;

/// Time an actuator gets to put its settings into its memory.
const SAVING: Duration = Duration::from_millis(100);

/// Runs `servo info`.
///
/// # Errors
/// An actuator that does not answer.
pub fn info(target: &Target) -> Result<i32, Error> {
    let mut actuator = Actuator::open(&target.which()?)?;
    let read = read_all(&mut actuator)?;
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
    if parameters(actuator.dialect()).is_empty() {
        let _ = writeln!(text, "{}", no_settings(actuator.dialect()));
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
        "registers": read.iter().map(|(of, bits)| setting_json(of, *bits)).collect::<Vec<_>>(),
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
        let read = read_all(&mut actuator)?;
        let text = format!("{}\n{}", actuator.place(), table(&read));
        let list: Vec<_> = read.iter().map(|(of, bits)| setting_json(of, *bits)).collect();
        return Ok(output.conclude(&list, &text, Deed::Look, 0));
    };
    let parameter = find(&actuator, name)?;
    let bits = read(&mut actuator, &parameter)?;
    let text = format!("{}: {}\n", parameter.name, words(&parameter, bits));
    Ok(output.conclude(&setting_json(&parameter, bits), &text, Deed::Look, 0))
}

/// Runs `servo set`.
///
/// # Errors
/// What is refused here (what only tells, goals, torque, ids), torque that is on, what does not fit,
/// and a value the actuator did not keep.
pub fn set(args: &SetArgs, remarks: Remarks) -> Result<i32, Error> {
    let mut actuator = Actuator::open(&args.target.which()?)?;
    let parameter = find(&actuator, &args.register)?;
    may_set(&actuator, &parameter)?;
    let bits = parse(&parameter, &args.value, args.raw)?;
    let place = || format!("{}, {}", actuator.place(), parameter.name);
    let frame = parameter
        .write(&actuator.peer(), bits)
        .ok_or_else(|| Error::new("this cannot be written over the line").at(place()))?;
    let save = if args.permit_eeprom { Some(saving(&actuator)?) } else { None };
    actuator.must_be_limp()?;
    let old = read(&mut actuator, &parameter)?;
    let changed = old != bits && !args.dry_run;
    if changed {
        write(&mut actuator, &parameter, bits, &frame)?;
    }
    if let Some(save) = save.filter(|_| !args.dry_run) {
        let budget = actuator.line.budget();
        actuator.line.bus.send(&save, budget).map_err(|e| actuator.failed(&e))?;
        actuator.line.clock.sleep_until(actuator.line.clock.now() + SAVING);
        remarks.say("kept at power-off, and so is all else that was set since the last time");
    }
    let verb = match (args.dry_run, old == bits) {
        (_, true) => "is already",
        (true, false) => "would become",
        (false, false) => "is now",
    };
    let mut text = format!("{} {verb} {}\n", parameter.name, words(&parameter, bits));
    if old != bits {
        let _ = writeln!(text, "  before: {}", words(&parameter, old));
    }
    let undo = undo(&actuator, &parameter, old, args);
    if changed {
        remarks.say(&format!("to undo: {undo}"));
    }
    if changed && !args.permit_eeprom {
        remarks.say("the actuator forgets this at power-off; --permit-eeprom makes it keep it");
    }
    let mut report = setting_json(&parameter, bits);
    report.insert("raw_before".into(), parameter.raw_from_bits(old).into());
    report.insert("dry_run".into(), args.dry_run.into());
    report.insert("kept".into(), (args.permit_eeprom && !args.dry_run).into());
    report.insert("undo".into(), if changed { undo.into() } else { Value::Null });
    let deed = if changed { Deed::Work } else { Deed::Look };
    Ok(args.target.output.conclude(&report, &text, deed, 0))
}

/// Writes a setting and reads it back.
fn write(
    actuator: &mut Actuator,
    parameter: &Parameter,
    bits: u32,
    frame: &CanFrame,
) -> Result<(), Error> {
    let budget = actuator.line.budget();
    actuator.line.bus.send(frame, budget).map_err(|e| actuator.failed(&e))?;
    let new = read(actuator, parameter)?;
    if new == bits {
        return Ok(());
    }
    Err(Error::new("the actuator did not keep what was written")
        .at(format!("{}, {}", actuator.place(), parameter.name))
        .got(words(parameter, new))
        .allowed(words(parameter, bits)))
}

/// The command that restores what was before.
fn undo(actuator: &Actuator, parameter: &Parameter, old: u32, args: &SetArgs) -> String {
    let permit = if args.permit_eeprom { " --permit-eeprom" } else { "" };
    let again = args.target.again();
    let protocol = dialect_name(actuator.dialect());
    format!(
        "gaitway servo set {} {} {} --raw --protocol {protocol}{permit}{again} -- {}",
        actuator.bus(),
        actuator.peer().id(),
        parameter.name.replace(' ', "_"),
        parameter.raw_from_bits(old),
    )
}

/// The frame that makes the actuator keep what was set.
fn saving(actuator: &Actuator) -> Result<CanFrame, Error> {
    actuator.peer().save().ok_or_else(|| {
        Error::new("this dialect cannot be told over the line to keep settings")
            .at(actuator.place())
            .got("--permit-eeprom")
            .remedy("use the maker's tool for what shall stay after power-off")
    })
}

fn may_set(actuator: &Actuator, parameter: &Parameter) -> Result<(), Error> {
    let place = format!("{}, {}", actuator.place(), parameter.name);
    let refuse = |what: &str, remedy: &str| Err(Error::new(what).at(place.clone()).remedy(remedy));
    match parameter.access {
        Access::Set => Ok(()),
        Access::Tells => Err(Error::new("this setting can only be read").at(place)),
        Access::Goal => refuse(
            "this setting is not written here: it moves the actuator",
            "goals go through the guard: gaitway servo move BUS ID ANGLE_DEG, or play",
        ),
        Access::Torque => refuse(
            "this setting is not written here: it switches the actuator on and off",
            "torque: gaitway hold ROBOT --bus BUS, gaitway limp ROBOT --bus BUS",
        ),
        Access::Identity => refuse(
            "this setting is not written here: the actuator would be found elsewhere",
            "gaitway servo set-id BUS ID NEW for its id; the maker's tool for the rest",
        ),
        Access::LineSpeed => refuse(
            "this setting is not written here: the actuator would leave the line",
            "the maker's tool, and then: ip link set can0 up type can bitrate ...",
        ),
    }
}

fn no_settings(dialect: Dialect) -> String {
    let tool = match dialect {
        Dialect::CubemarsMit | Dialect::CubemarsServo => {
            "the maker's tool (R-Link) over the actuator's serial port"
        }
        _ => "the maker's tool",
    };
    format!("{} has no settings on the line; use {tool}", dialect_name(dialect))
}

/// The setting that `name` means: by name, or by number.
fn find(actuator: &Actuator, name: &str) -> Result<Parameter, Error> {
    let all = parameters(actuator.dialect());
    if all.is_empty() {
        return Err(Error::new("this dialect has no settings on the line")
            .at(actuator.place())
            .got(name)
            .remedy(no_settings(actuator.dialect())));
    }
    let hex = name.strip_prefix("0x").map(|digits| u16::from_str_radix(digits, 16).ok());
    let number = hex.unwrap_or_else(|| name.parse().ok());
    let wanted = plain(name);
    let meant = |of: &&Parameter| plain(of.name) == wanted || number == Some(of.number);
    all.iter().find(meant).copied().ok_or_else(|| {
        let alike = |of: &&Parameter| !wanted.is_empty() && plain(of.name).contains(&wanted);
        let mut near: Vec<&str> = all.iter().filter(alike).map(|of| of.name).collect();
        if near.is_empty() {
            near = all.iter().map(|of| of.name).collect();
        }
        let error = Error::of(ErrorKind::Unknown, "the actuator has no such setting")
            .at(actuator.place())
            .got(name)
            .allowed(near.join(", "));
        match actuator.dialect() {
            Dialect::Odrive => error.remedy(
                "CAN Simple has no question for gains and limits: odrivetool over USB reads and \
                 sets them",
            ),
            Dialect::Moteus => error.remedy("moteus_tool reads and sets what it is configured to"),
            _ => error,
        }
    })
}

fn read(actuator: &mut Actuator, parameter: &Parameter) -> Result<u32, Error> {
    let (peer, budget) = (actuator.peer(), actuator.line.budget());
    let asked = actuator.line.bus.read_setting(&peer, parameter.number, parameter.form, budget);
    asked.map_err(|e| {
        let error = actuator.failed(&e);
        error.at(format!("{}, {}", actuator.place(), parameter.name))
    })
}

/// All settings the actuator has; those it has not, and says so, are left out.
fn read_all(actuator: &mut Actuator) -> Result<Read, Error> {
    let mut found = Vec::new();
    for parameter in parameters(actuator.dialect()) {
        let (peer, budget) = (actuator.peer(), actuator.line.budget());
        let asked = actuator.line.bus.read_setting(&peer, parameter.number, parameter.form, budget);
        match asked {
            Ok(bits) => found.push((*parameter, bits)),
            Err(AskError::Unsayable(_)) => {}
            // Older firmware is silent on what it does not know.
            Err(AskError::Miss(_)) if !found.is_empty() => {}
            Err(error) => return Err(actuator.failed(&error)),
        }
    }
    Ok(found)
}

/// A value for a person.
fn words(parameter: &Parameter, bits: u32) -> String {
    let si = parameter.si_from_bits(bits);
    let raw = parameter.raw_from_bits(bits);
    if si.is_nan() {
        return "no number".to_owned();
    }
    match parameter.unit {
        "" if bits > 0xFFFF && parameter.raw_from_bits(bits) == f64::from(bits) => {
            format!("{bits} (0x{bits:X})")
        }
        "" => rounded(si),
        unit @ ("rad" | "rad/s" | "rad/s2") => {
            let degrees = unit.replace("rad", "deg");
            format!("{} {unit} ({:.2} {degrees})", rounded(si), si.to_degrees())
        }
        unit if (si - raw).abs() > 0.0 => format!("{} {unit} (raw {raw})", rounded(si)),
        unit => format!("{} {unit}", rounded(si)),
    }
}

/// A setting and its value for a report: `value_rad` and the like in SI, `raw` always.
fn setting_json(parameter: &Parameter, bits: u32) -> Map<String, Value> {
    let mut map = Map::new();
    map.insert("register".into(), parameter.name.into());
    map.insert("number".into(), parameter.number.into());
    let number =
        |x: f64| if x.fract() == 0.0 && x.abs() < 1e15 { json!(x as i64) } else { json!(x) };
    map.insert("raw".into(), number(parameter.raw_from_bits(bits)));
    if !parameter.unit.is_empty() {
        let unit = parameter.unit.to_lowercase().replace("degc", "c");
        let key: String = unit.chars().filter(|c| !matches!(c, '(' | ')')).collect::<String>();
        let key = key.replace(['/', ' '], "_");
        map.insert(format!("value_{key}"), json!(parameter.si_from_bits(bits)));
    }
    map
}

/// The bits of what was typed: SI, degrees where `deg` is written behind; with `as_raw` the number as
/// the actuator counts it.
fn parse(parameter: &Parameter, text: &str, as_raw: bool) -> Result<u32, Error> {
    let allowed = match (parameter.unit, as_raw) {
        ("rad", false) => "a number in rad, or in degrees with deg behind it".to_owned(),
        ("", _) | (_, true) => "a number".to_owned(),
        (unit, false) => format!("a number in {unit}"),
    };
    let wrong = |what: &str| {
        Error::new(what).at(format!("setting {}", parameter.name)).got(text).allowed(&allowed)
    };
    let in_degrees = text.strip_suffix("deg").filter(|_| parameter.unit == "rad" && !as_raw);
    let number = in_degrees.or_else(|| text.strip_suffix(parameter.unit)).unwrap_or(text).trim();
    let hex = number.strip_prefix("0x").map(|digits| u32::from_str_radix(digits, 16).ok());
    let number = hex.map_or_else(|| number.parse().ok(), |whole| whole.map(f64::from));
    let number = number.ok_or_else(|| wrong("not a value"))?;
    let number = if in_degrees.is_some() { number.to_radians() } else { number };
    let bits = match as_raw {
        true => parameter.bits_from_raw(number),
        false => parameter.bits_from_si(number),
    };
    bits.ok_or_else(|| wrong("outside what the setting takes"))
}

fn table(read: &Read) -> String {
    let mut out = String::new();
    for (parameter, bits) in read {
        let number = match parameter.number {
            small @ ..256 => small.to_string(),
            large => format!("0x{large:04X}"),
        };
        let _ = writeln!(out, "  {number:>6}  {:<28} {}", parameter.name, words(parameter, *bits));
    }
    out
}
