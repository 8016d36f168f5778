//! Register values as a person reads and types them: SI, with degrees beside radians.

use crate::device::Model;
use crate::error::{Error, ErrorKind};
use gaitway_profiles::{RegisterItem, Role, Unit};
use serde_json::{Map, Value};

/// SI unit of a register, as a person writes it and as the end of a JSON key.
fn si_unit(unit: Unit) -> Option<(&'static str, &'static str)> {
    Some(match unit {
        Unit::None => return None,
        Unit::Turn | Unit::TurnRelative => ("rad", "rad"),
        Unit::Rpm | Unit::CountPerSecond => ("rad/s", "rad_s"),
        Unit::Rpm2 | Unit::CountPerSecond2 => ("rad/s2", "rad_s2"),
        Unit::Ampere => ("A", "a"),
        Unit::Volt => ("V", "v"),
        Unit::Celsius => ("degC", "c"),
        Unit::Second => ("s", "s"),
        Unit::Ratio => ("ratio", "ratio"),
    })
}

/// A raw value in words: SI and, for angles, degrees; or what the number stands for.
#[must_use]
pub fn words(model: &Model, item: &RegisterItem<'_>, raw: i64) -> String {
    let Some((unit, _)) = si_unit(item.register.unit) else {
        return match meaning(model, item, raw) {
            Some(meaning) => format!("{raw} ({meaning})"),
            None => raw.to_string(),
        };
    };
    let si = model.si_from_raw(item.register, raw);
    let also = match unit {
        "rad" => format!("{:.2} deg, ", si.to_degrees()),
        "rad/s" => format!("{:.1} deg/s, ", si.to_degrees()),
        "rad/s2" => format!("{:.0} deg/s2, ", si.to_degrees()),
        "ratio" => format!("{:.1} %, ", si * 100.0),
        _ => String::new(),
    };
    format!("{} {unit} ({also}raw {raw})", rounded(si))
}

/// As many digits as mean something: six at most, no zeros at the end.
pub fn rounded(si: f64) -> String {
    let text = format!("{si:.6}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// What a plain number stands for.
fn meaning(model: &Model, item: &RegisterItem<'_>, raw: i64) -> Option<String> {
    let profile = model.profile();
    match item.register.role? {
        Role::BaudRate => {
            let line = profile.baud.iter().find(|baud| i64::from(baud.index) == raw)?;
            Some(format!("{} bit/s", line.bps))
        }
        Role::OperatingMode => {
            let mode = profile.operating_modes.iter().find(|m| i64::from(m.value) == raw)?;
            Some(format!("{:?}", mode.mode))
        }
        Role::TorqueEnable => Some(if raw == 0 { "off" } else { "on" }.to_owned()),
        Role::HardwareError if raw == 0 => Some("no error".to_owned()),
        Role::HardwareError => Some(profile.error_words(raw).collect::<Vec<_>>().join(", ")),
        _ => None,
    }
}

/// A register and its value for a report: `value_rad` and the like in SI, `raw` always.
#[must_use]
pub fn json(model: &Model, item: &RegisterItem<'_>, raw: i64) -> Map<String, Value> {
    let mut map = Map::new();
    map.insert("register".into(), item.name().into());
    map.insert("address".into(), item.address.into());
    map.insert("raw".into(), raw.into());
    if let Some((_, key)) = si_unit(item.register.unit) {
        let si = model.si_from_raw(item.register, raw);
        map.insert(format!("value_{key}"), si.into());
    } else if let Some(meaning) = meaning(model, item, raw) {
        map.insert("meaning".into(), meaning.into());
    }
    map
}

/// The raw value of what was typed: SI, degrees where `deg` is written behind, a whole number for
/// registers without unit; with `as_raw` always the raw number.
///
/// # Errors
/// Not a number, a unit that does not belong to the register, a value that does not fit.
pub fn parse(
    model: &Model,
    item: &RegisterItem<'_>,
    text: &str,
    as_raw: bool,
) -> Result<i64, Error> {
    let unit = si_unit(item.register.unit).map(|(unit, _)| unit).filter(|_| !as_raw);
    let place = || format!("register {}", item.name());
    let allowed = match unit {
        None => format!("a whole number, {}", range_words(model, item)),
        Some("rad") => "a number in rad, or in degrees with deg behind it, e.g. 30deg".to_owned(),
        Some(unit) => format!("a number in {unit}, {}", range_words(model, item)),
    };
    let wrong = || Error::new("not a value").at(place()).got(text).allowed(allowed.clone());
    let Some(unit) = unit else {
        let hex = text.strip_prefix("0x").map(|digits| i64::from_str_radix(digits, 16));
        return hex.unwrap_or_else(|| text.parse()).map_err(|_| wrong());
    };
    let in_degrees = text.strip_suffix("deg").filter(|_| unit == "rad");
    let number = in_degrees.unwrap_or_else(|| text.strip_suffix(unit).unwrap_or(text));
    let number: f64 = number.trim().parse().map_err(|_| wrong())?;
    let si = if in_degrees.is_some() { number.to_radians() } else { number };
    model.raw_from_si(item.register, si).map_err(|_| {
        let outside =
            Error::of(ErrorKind::OutsideLimits, "outside the register's range").at(place());
        outside.got(text).allowed(range_words(model, item))
    })
}

/// What a register takes, in words.
#[must_use]
pub fn range_words(model: &Model, item: &RegisterItem<'_>) -> String {
    let (lowest, highest) = item.register.range();
    format!("{} to {}", words(model, item, lowest), words(model, item, highest))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn item(name: &str) -> (Model, RegisterItem<'static>) {
        let servo = gaitway_profiles::servo("xm430-w350").expect("a shipped servo");
        (Model::new(servo), servo.register_named(name).expect("a register"))
    }

    #[test]
    fn si_degrees_and_raw_numbers_lead_to_the_same_register() {
        let (model, offset) = item("Homing Offset");
        // A quarter turn is 1024 counts.
        for text in ["1.5707963", "1.5707963rad", "90deg", "90 deg"] {
            assert_eq!(parse(&model, &offset, text, false).expect(text), 1024, "{text}");
        }
        assert_eq!(parse(&model, &offset, "1024", true).expect("raw"), 1024);
        let (model, limit) = item("Temperature Limit");
        assert_eq!(parse(&model, &limit, "70", false).expect("degC"), 70);
        let (model, mode) = item("Operating Mode");
        assert_eq!(parse(&model, &mode, "0x10", false).expect("hex"), 16);
    }

    #[test]
    fn what_is_no_value_is_refused_with_the_unit() {
        let (model, offset) = item("Homing Offset");
        for text in ["", "NaN", "inf", "ninety", "1e300", "90degC", "3V"] {
            let error = parse(&model, &offset, text, false).expect_err(text);
            assert!(error.to_string().contains("Homing Offset"), "{error}");
        }
        let (model, mode) = item("Operating Mode");
        assert!(parse(&model, &mode, "3.5", false).is_err());
    }

    #[test]
    fn values_are_said_with_unit_degrees_and_raw() {
        let (model, position) = item("Present Position");
        assert_eq!(words(&model, &position, 3072), "1.570796 rad (90.00 deg, raw 3072)");
        let (model, voltage) = item("Present Input Voltage");
        assert_eq!(words(&model, &voltage, 121), "12.1 V (raw 121)");
        let (model, baud) = item("Baud Rate");
        assert_eq!(words(&model, &baud, 3), "3 (1000000 bit/s)");
    }
}
