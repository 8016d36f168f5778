//! The numbered settings of an actuator: read, changed and read back, kept.

use super::Actuator;
use crate::bus::AskError;
use crate::device::parameter::{Access, Parameter, parameters};
use crate::error::{Error, ErrorKind};
use crate::job::servo::register::plain;
use crate::job::servo::value::rounded;
use crate::rig::dialect_name;
use crate::time::Duration;
use crate::wire::can::CanFrame;
use gaitway_profiles::Dialect;
use serde_json::{Map, Value, json};

/// Time an actuator gets to put its settings into its memory.
const SAVING: Duration = Duration::from_millis(100);

/// A setting and its value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SettingValue {
    parameter: Parameter,
    bits: u32,
}

/// Which setting gets which value.
#[derive(Clone, Debug, PartialEq)]
pub struct SettingOrder {
    /// The setting, by the maker's name or by its number.
    pub name: String,
    /// The value: SI, or in degrees with `deg` behind it.
    pub value: String,
    /// The value is the number as the actuator counts it.
    pub raw: bool,
    /// It is to be kept at power-off.
    pub keep: bool,
    /// Nothing is written.
    pub dry_run: bool,
}

/// What came of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SettingChange {
    /// As it was.
    pub old: SettingValue,
    /// As it is now, or would be.
    pub new: SettingValue,
    /// True if it was written and has another value now.
    pub changed: bool,
    /// True if the actuator was told to keep it, and all else that was set since the last time.
    pub kept: bool,
}

impl SettingValue {
    /// The maker's name.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        self.parameter.name
    }

    /// Its number.
    #[must_use]
    pub const fn number(&self) -> u16 {
        self.parameter.number
    }

    /// The value as the actuator counts it.
    #[must_use]
    pub fn raw(&self) -> f64 {
        self.parameter.raw_from_bits(self.bits)
    }

    /// The value for a person.
    #[must_use]
    pub fn words(&self) -> String {
        let Self { parameter, bits } = *self;
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

    /// As a report has it: `value_rad` and the like in SI, `raw` always.
    #[must_use]
    pub fn json(&self) -> Map<String, Value> {
        let Self { parameter, bits } = *self;
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
}

impl Actuator {
    /// A setting.
    ///
    /// # Errors
    /// One that it does not have, or no answer.
    pub fn setting(&mut self, name: &str) -> Result<SettingValue, Error> {
        let parameter = find(self, name)?;
        let bits = read(self, &parameter)?;
        Ok(SettingValue { parameter, bits })
    }

    /// All settings it has; those it has not, and says so, are left out.
    ///
    /// # Errors
    /// No answer.
    pub fn settings(&mut self) -> Result<Vec<SettingValue>, Error> {
        read_all(self)
    }

    /// Why there are none, if its dialect has none on the line.
    #[must_use]
    pub fn has_no_settings(&self) -> Option<String> {
        parameters(self.dialect()).is_empty().then(|| no_settings(self.dialect()))
    }

    /// Changes a setting and reads it back.
    ///
    /// # Errors
    /// What is refused here (what only tells, goals, torque, ids), torque that is on, what does not fit,
    /// and a value the actuator did not keep.
    pub fn change_setting(&mut self, order: &SettingOrder) -> Result<SettingChange, Error> {
        let parameter = find(self, &order.name)?;
        may_set(self, &parameter)?;
        let bits = parse(&parameter, &order.value, order.raw)?;
        let place = || format!("{}, {}", self.place(), parameter.name);
        let frame = parameter
            .write(&self.peer(), bits)
            .ok_or_else(|| Error::new("this cannot be written over the line").at(place()))?;
        let save = if order.keep { Some(saving(self)?) } else { None };
        self.must_be_limp()?;
        let old = read(self, &parameter)?;
        let changed = old != bits && !order.dry_run;
        if changed {
            write(self, &parameter, bits, &frame)?;
        }
        let save = save.filter(|_| !order.dry_run);
        if let Some(save) = &save {
            let budget = self.line.budget();
            self.line.bus.send(save, budget).map_err(|e| self.failed(&e))?;
            self.line.clock.sleep_until(self.line.clock.now() + SAVING);
        }
        let of = |bits| SettingValue { parameter, bits };
        Ok(SettingChange { old: of(old), new: of(bits), changed, kept: save.is_some() })
    }
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
        .got(SettingValue { parameter: *parameter, bits: new }.words())
        .allowed(SettingValue { parameter: *parameter, bits }.words()))
}

/// The command that restores what was before.
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

fn read_all(actuator: &mut Actuator) -> Result<Vec<SettingValue>, Error> {
    let mut found = Vec::new();
    for parameter in parameters(actuator.dialect()) {
        let (peer, budget) = (actuator.peer(), actuator.line.budget());
        let asked = actuator.line.bus.read_setting(&peer, parameter.number, parameter.form, budget);
        match asked {
            Ok(bits) => found.push(SettingValue { parameter: *parameter, bits }),
            Err(AskError::Unsayable(_)) => {}
            // Older firmware is silent on what it does not know.
            Err(AskError::Miss(_)) if !found.is_empty() => {}
            Err(error) => return Err(actuator.failed(&error)),
        }
    }
    Ok(found)
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
