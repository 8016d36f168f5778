//! Rules of an actuator's file.

use super::{Verdict, header, not_empty, positive, unique};
use crate::error::ProfileError;
use crate::schema::{Actuator, CanLine, TimeoutKind};

pub(crate) fn actuator(file: &str, actuator: &Actuator) -> Verdict {
    header(file, actuator.schema, &actuator.name)?;
    not_empty(file, "model", &actuator.model)?;
    not_empty(file, "maker", &actuator.maker)?;
    not_empty(file, "source", &actuator.source)?;
    not_empty(file, "timeout.action", &actuator.timeout.action)?;
    not_empty(file, "timeout.source", &actuator.timeout.source)?;
    line(file, actuator)?;
    ranges(file, actuator)?;
    timeout(file, actuator)?;
    gear(file, actuator)
}

fn gear(file: &str, actuator: &Actuator) -> Verdict {
    if let Some(gear) = &actuator.gear {
        not_empty(file, "gear.source", &gear.source)?;
        positive(file, || "gear.ratio".to_owned(), gear.ratio)?;
    }
    let pole_pairs = actuator.gear.as_ref().and_then(|gear| gear.pole_pairs);
    match (actuator.dialect.electrical_speed(), pole_pairs) {
        (true, Some(1..)) | (false, None) => Ok(()),
        (true, pole_pairs) => {
            Err(ProfileError::new(file, "without pole pairs its speeds mean nothing")
                .at("gear.pole_pairs")
                .got(pole_pairs.map_or("none".to_owned(), |pairs| pairs.to_string()))
                .allowed("1 to 255 for a dialect that tells electrical speeds"))
        }
        (false, Some(_)) => Err(ProfileError::new(file, "this dialect tells no electrical speeds")
            .at("gear.pole_pairs")
            .allowed("no pole_pairs")),
    }
}

fn line(file: &str, actuator: &Actuator) -> Verdict {
    let CanLine { bitrates_bps, data_bitrates_bps, first_id, last_id, factory_id } = &actuator.line;
    if bitrates_bps.is_empty() {
        return Err(ProfileError::new(file, "an actuator needs a bit rate").at("line.bitrates_bps"));
    }
    unique(file, "bit rate", "line.bitrates_bps", bitrates_bps)?;
    unique(file, "bit rate", "line.data_bitrates_bps", data_bitrates_bps)?;
    for (place, rates, most) in [
        ("line.bitrates_bps", bitrates_bps, 1_000_000),
        ("line.data_bitrates_bps", data_bitrates_bps, 8_000_000),
    ] {
        if let Some(rate) = rates.iter().find(|&&rate| !(10_000..=most).contains(&rate)) {
            return Err(ProfileError::new(file, "no CAN line has this bit rate")
                .at(place)
                .got(rate)
                .allowed(format!("10000 to {most} bit/s")));
        }
    }
    let room = actuator.dialect.last_id();
    if !(first_id <= last_id && *last_id <= room) {
        return Err(ProfileError::new(file, "the ids do not fit the dialect")
            .at("line.first_id, line.last_id")
            .got(format!("{first_id} to {last_id}"))
            .allowed(format!("ascending, 0 to {room}")));
    }
    match factory_id {
        Some(id) if !(first_id..=last_id).contains(&id) => {
            Err(ProfileError::new(file, "the factory's id is none that may be given")
                .at("line.factory_id")
                .got(id)
                .allowed(format!("{first_id} to {last_id}")))
        }
        _ => Ok(()),
    }
}

fn ranges(file: &str, actuator: &Actuator) -> Verdict {
    let Some(ranges) = &actuator.ranges else {
        if actuator.dialect.codes_numbers() {
            return Err(ProfileError::new(file, "without ranges its numbers mean nothing")
                .at("ranges")
                .allowed("[ranges] for a dialect that codes numbers"));
        }
        return Ok(());
    };
    if !actuator.dialect.codes_numbers() {
        return Err(ProfileError::new(file, "this dialect has units of its own and no ranges")
            .at("ranges")
            .allowed("no [ranges]"));
    }
    not_empty(file, "ranges.source", &ranges.source)?;
    for (key, value) in [
        ("position_rad", ranges.position_rad),
        ("velocity_rad_s", ranges.velocity_rad_s),
        ("torque_nm", ranges.torque_nm),
        ("kp_nm_rad", ranges.kp_nm_rad),
        ("kd_nm_s_rad", ranges.kd_nm_s_rad),
    ] {
        positive(file, || format!("ranges.{key}"), value)?;
    }
    Ok(())
}

fn timeout(file: &str, actuator: &Actuator) -> Verdict {
    let timeout = &actuator.timeout;
    for (key, value) in [("step_s", timeout.step_s), ("factory_s", timeout.factory_s)] {
        if let Some(value) = value {
            positive(file, || format!("timeout.{key}"), value)?;
        }
    }
    if timeout.kind == TimeoutKind::None && (timeout.step_s, timeout.factory_s) != (None, None) {
        return Err(ProfileError::new(file, "a timeout that does not exist has no length")
            .at("timeout")
            .allowed("neither step_s nor factory_s with kind = \"none\""));
    }
    Ok(())
}
