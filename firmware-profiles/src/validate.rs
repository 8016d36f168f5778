//! What the numbers of a profile must be to one another. Of a robot and of a servo every rule that is
//! broken is reported, of the others the first.
//!
//! Every comparison is written so that NaN, which TOML can spell, fails it.

mod actuator;
mod board;
mod robot;
mod sensor;
mod servo;

pub(crate) use actuator::actuator;
pub(crate) use board::board;
pub(crate) use robot::robot;
pub(crate) use sensor::sensor;
pub(crate) use servo::servo;

use crate::error::ProfileError;
use crate::schema::Adapter;
use std::collections::BTreeSet;
use std::path::Path;

type Verdict = Result<(), ProfileError>;

const SCHEMA: u32 = 1;

pub(crate) fn adapter(file: &str, adapter: &Adapter) -> Verdict {
    header(file, adapter.schema, &adapter.name)?;
    not_empty(file, "model", &adapter.model)?;
    not_empty(file, "source", &adapter.source)?;
    if let Some(text) = &adapter.ambiguous {
        not_empty(file, "ambiguous", text)?;
    }
    if adapter.usb_ids.is_empty() {
        return Err(ProfileError::new(file, "an adapter needs a USB id").at("usb_ids"));
    }
    for id in &adapter.usb_ids {
        if !is_usb_id(id) {
            return Err(ProfileError::new(file, "this is not a USB id")
                .at("usb_ids")
                .got(format!("{id:?}"))
                .allowed("vvvv:pppp in lower-case hex, e.g. 0403:6014"));
        }
    }
    unique(file, "USB id", "usb_ids", adapter.usb_ids.iter())?;
    if let Some(timer_s) = adapter.latency_timer_s
        && !(timer_s.is_finite() && timer_s > 0.0)
    {
        return Err(ProfileError::new(file, "no timer is set like this")
            .at("latency_timer_s")
            .got(timer_s)
            .allowed("above 0, or no such key"));
    }
    if !(adapter.latency_s.is_finite() && adapter.latency_s >= 0.0) {
        return Err(ProfileError::new(file, "the latency is not a time")
            .at("latency_s")
            .got(adapter.latency_s)
            .allowed("a finite number of seconds, 0 or more"));
    }
    Ok(())
}

fn is_usb_id(id: &str) -> bool {
    let is_hex = |part: &str| {
        part.len() == 4 && part.bytes().all(|b| matches!(b, b'0'..=b'9' | b'a'..=b'f'))
    };
    id.split_once(':').is_some_and(|(vendor, product)| is_hex(vendor) && is_hex(product))
}

/// The format version, and the name that must be the file's own: by it other files name the profile.
fn header(file: &str, schema: u32, name: &str) -> Verdict {
    version_and_name(file, schema, name)?;
    let stem = Path::new(file).file_stem().unwrap_or_default().to_string_lossy();
    if stem != name {
        return Err(ProfileError::new(file, "the profile must have the name of its file")
            .at("name")
            .got(format!("{name:?}"))
            .allowed(format!("{stem:?}"))
            .remedy("rename one of the two"));
    }
    Ok(())
}

fn version_and_name(file: &str, schema: u32, name: &str) -> Verdict {
    if schema != SCHEMA {
        return Err(ProfileError::new(file, "unknown version of the profile format")
            .at("schema")
            .got(schema)
            .allowed(SCHEMA));
    }
    if !is_name(name, b'-') {
        return Err(ProfileError::new(file, "this cannot be the name of a profile")
            .at("name")
            .got(format!("{name:?}"))
            .allowed("[a-z0-9-]+"));
    }
    Ok(())
}

/// True for one or more of a-z, 0-9 and `joiner`.
fn is_name(name: &str, joiner: u8) -> bool {
    !name.is_empty()
        && name.bytes().all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b == joiner)
}

fn not_empty(file: &str, place: &str, text: &str) -> Verdict {
    if text.trim().is_empty() {
        return Err(ProfileError::new(file, "this text must not be empty").at(place));
    }
    Ok(())
}

fn positive(file: &str, place: impl Fn() -> String, value: f64) -> Verdict {
    if !(value.is_finite() && value > 0.0) {
        return Err(ProfileError::new(file, "this number must be above zero")
            .at(place())
            .got(value)
            .allowed("a finite number above 0"));
    }
    Ok(())
}

fn finite(file: &str, place: impl Fn() -> String, value: f64) -> Verdict {
    if !value.is_finite() {
        return Err(ProfileError::new(file, "this is not a number")
            .at(place())
            .got(value)
            .allowed("a finite number"));
    }
    Ok(())
}

fn unique<T: Ord + std::fmt::Display>(
    file: &str,
    what: &str,
    place: &str,
    values: impl IntoIterator<Item = T>,
) -> Verdict {
    let mut seen = BTreeSet::new();
    for value in values {
        if let Some(same) = seen.replace(value) {
            return Err(ProfileError::new(file, format!("the same {what} twice"))
                .at(place)
                .got(same)
                .allowed(format!("each {what} once")));
        }
    }
    Ok(())
}
