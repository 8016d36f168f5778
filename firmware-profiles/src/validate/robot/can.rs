//! Rules for joints on CAN lines.

use super::{place, positive};
use crate::error::ProfileError;
use crate::files;
use crate::schema::{Actuator, CanSpeed, Dialect, Joint, Line, Robot, TimeoutKind};
use crate::validate::Verdict;

/// Damiao devices are spoken to under their own id plus one of these, one for each mode (Damiao,
/// DM-J4310-2EC user manual V1.0, control modes; the newer ones of its SDK), and under 0x7FF.
const DAMIAO_OFFSETS: std::ops::RangeInclusive<u16> = 0..=6;
const DAMIAO_MANAGEMENT: u16 = 0x7FF;

/// What a joint, its CAN line and its actuator must be to one another.
pub(super) fn joint(file: &str, joint: &Joint, line: &Line, speed: CanSpeed) -> Verdict {
    let actuator = known_actuator(file, joint)?;
    let first_to_last = actuator.line.first_id..=actuator.line.last_id;
    if !first_to_last.contains(&joint.id) {
        return Err(ProfileError::new(file, "the actuator cannot have this id")
            .at(place(joint))
            .got(joint.id)
            .allowed(format!("{}..{}", first_to_last.start(), first_to_last.end())));
    }
    if actuator.dialect == Dialect::Robstride && joint.id == speed.host_id {
        return Err(ProfileError::new(file, "an actuator has the host's own id")
            .at(place(joint))
            .got(joint.id)
            .allowed(format!("another id than the line's host_id, {}", speed.host_id)));
    }
    bit_rates(file, joint, line, speed, &actuator)?;
    answer_id(file, joint, &actuator)?;
    gains(file, joint, &actuator)?;
    timeout(file, joint, &actuator)?;
    let Some(ranges) = &actuator.ranges else { return Ok(()) };
    let fastest = ranges.velocity_rad_s * joint.gear;
    if joint.velocity_rad_s > fastest {
        return Err(ProfileError::new(file, "the joint may turn faster than its actuator can say")
            .at(place(joint))
            .got(format!("velocity_rad_s {}", joint.velocity_rad_s))
            .allowed(format!("at most {fastest}, the range of {}", actuator.model)));
    }
    for (key, angle) in [("lower_rad", joint.lower_rad), ("upper_rad", joint.upper_rad)] {
        let at_actuator = (angle + joint.offset_rad) / joint.gear;
        if !(at_actuator.abs() <= ranges.position_rad) {
            return Err(ProfileError::new(file, "the actuator cannot be told to go to this limit")
                .at(format!("{}, {key}", place(joint)))
                .got(format!("{angle} rad, {at_actuator} rad of the actuator"))
                .allowed(format!("-{0}..{0} rad of the actuator", ranges.position_rad)));
        }
    }
    Ok(())
}

/// A servo has nothing that only an actuator on a CAN line has.
pub(super) fn not_on_serial(file: &str, joint: &Joint) -> Verdict {
    let given = [
        ("answer_id", joint.answer_id.is_some()),
        ("kp_nm_rad", joint.kp_nm_rad.is_some()),
        ("kd_nm_s_rad", joint.kd_nm_s_rad.is_some()),
        ("timeout_configured_s", joint.timeout_configured_s.is_some()),
    ];
    match given.iter().find(|(_, given)| *given) {
        None => Ok(()),
        Some((key, _)) => Err(ProfileError::new(file, "only a joint on a CAN line has this key")
            .at(format!("{}, {key}", place(joint)))
            .remedy("leave it out, or put the joint on a line of kind = \"can\"")),
    }
}

/// What the joints of one CAN line must be to one another.
pub(super) fn line(file: &str, robot: &Robot, line: &Line) -> Verdict {
    let mut joints = Vec::new();
    for joint in robot.joints_on(&line.name) {
        joints.push((joint, known_actuator(file, joint)?.dialect));
    }
    for (index, &(joint, dialect)) in joints.iter().enumerate() {
        for &(other, others) in &joints[..index] {
            if dialect == others && joint.id == other.id {
                return Err(ProfileError::new(file, "two joints on a line have the same ID")
                    .at(place(joint))
                    .got(format!("ID {} on line {:?}", joint.id, joint.line))
                    .allowed("each ID once on a line"));
            }
            if dialect != others && dialect.has_short_ids() == others.has_short_ids() {
                return Err(ProfileError::new(file, "the identifiers of two dialects would mix")
                    .at(place(joint))
                    .got(format!("{dialect:?} beside {others:?} on line {:?}", line.name))
                    .allowed(
                        "one dialect with identifiers of 11 bits on a line, and one with 29",
                    ));
            }
        }
    }
    answers_apart(file, &joints)
}

/// Answers of two Damiao devices are not told apart by their identifier alone unless it is 0 (the
/// answer then names its device), and one that is a command's identifier moves another device.
fn answers_apart(file: &str, joints: &[(&Joint, Dialect)]) -> Verdict {
    let damiao = || joints.iter().filter(|(_, dialect)| *dialect == Dialect::Damiao);
    for (index, (joint, _)) in damiao().enumerate() {
        let answer = joint.answer_id.unwrap_or(0);
        let refuse = |what: &str| {
            Err(ProfileError::new(file, what)
                .at(format!("{}, answer_id", place(joint)))
                .got(format!("0x{answer:03X}"))
                .allowed("an identifier nobody else is called by, e.g. 0x10 + ID; or 0"))
        };
        if answer == 0 {
            continue;
        }
        if damiao().take(index).any(|(other, _)| other.answer_id == joint.answer_id) {
            return refuse("two joints on a line answer alike");
        }
        let is_command = |(other, _): &(&Joint, Dialect)| {
            DAMIAO_OFFSETS.map(|mode| mode << 8 | u16::from(other.id)).any(|id| id == answer)
        };
        if answer == DAMIAO_MANAGEMENT || damiao().any(is_command) {
            return refuse("the answer of one device would be a command to another");
        }
    }
    Ok(())
}

fn bit_rates(
    file: &str,
    joint: &Joint,
    line: &Line,
    speed: CanSpeed,
    actuator: &Actuator,
) -> Verdict {
    let at = format!("line {:?}, {}", line.name, place(joint));
    let list = |rates: &[u32]| rates.iter().map(u32::to_string).collect::<Vec<_>>().join(", ");
    if !actuator.line.bitrates_bps.contains(&speed.bitrate_bps) {
        return Err(ProfileError::new(file, "an actuator on this line cannot run at its speed")
            .at(at)
            .got(format!("bitrate_bps {}", speed.bitrate_bps))
            .allowed(list(&actuator.line.bitrates_bps)));
    }
    let rates = &actuator.line.data_bitrates_bps;
    match speed.data_bitrate_bps {
        Some(fast) if rates.contains(&fast) => Ok(()),
        Some(_) if rates.is_empty() => {
            Err(ProfileError::new(file, "an actuator on this line takes CAN FD frames for errors")
                .at(at)
                .got("data_bitrate_bps")
                .allowed(format!("no data_bitrate_bps: {} knows classic CAN only", actuator.model)))
        }
        Some(fast) => {
            Err(ProfileError::new(file, "an actuator on this line cannot run at its data speed")
                .at(at)
                .got(format!("data_bitrate_bps {fast}"))
                .allowed(list(rates)))
        }
        None if actuator.dialect.is_fd() => {
            Err(ProfileError::new(file, "an actuator on this line needs CAN FD")
                .at(at)
                .got("no data_bitrate_bps")
                .allowed(list(rates)))
        }
        None => Ok(()),
    }
}

fn answer_id(file: &str, joint: &Joint, actuator: &Actuator) -> Verdict {
    match joint.answer_id {
        None => Ok(()),
        Some(_) if actuator.dialect != Dialect::Damiao => {
            Err(ProfileError::new(file, "this actuator's answers have no id to choose")
                .at(format!("{}, answer_id", place(joint)))
                .remedy("leave it out"))
        }
        Some(id) if id > DAMIAO_MANAGEMENT => {
            Err(ProfileError::new(file, "the identifier has more than 11 bits")
                .at(format!("{}, answer_id", place(joint)))
                .got(id)
                .allowed(format!("0..{}", DAMIAO_MANAGEMENT - 1)))
        }
        Some(_) => Ok(()),
    }
}

fn gains(file: &str, joint: &Joint, actuator: &Actuator) -> Verdict {
    let ends = actuator.ranges.as_ref();
    for (key, gain, end) in [
        ("kp_nm_rad", joint.kp_nm_rad, ends.map(|ranges| ranges.kp_nm_rad)),
        ("kd_nm_s_rad", joint.kd_nm_s_rad, ends.map(|ranges| ranges.kd_nm_s_rad)),
    ] {
        let at = format!("{}, {key}", place(joint));
        match (gain, end) {
            (None, None) => {}
            (Some(_), None) => {
                return Err(ProfileError::new(file, "this actuator keeps its own gains")
                    .at(at)
                    .remedy("leave it out; set gains with the maker's tool"));
            }
            (None, Some(end)) => {
                return Err(ProfileError::new(file, "the actuator must be told its gains")
                    .at(at)
                    .allowed(format!("above 0, at most {end}")));
            }
            (Some(gain), Some(end)) => {
                if !(gain > 0.0 && gain <= end) {
                    return Err(ProfileError::new(file, "the actuator cannot have this gain")
                        .at(at)
                        .got(gain)
                        .allowed(format!("above 0, at most {end}")));
                }
            }
        }
    }
    Ok(())
}

fn timeout(file: &str, joint: &Joint, actuator: &Actuator) -> Verdict {
    if let Some(said_s) = joint.timeout_configured_s {
        let at = || format!("{}, timeout_configured_s", place(joint));
        positive(file, at, said_s)?;
        if actuator.timeout.kind != TimeoutKind::Configured {
            return Err(ProfileError::new(
                file,
                "this actuator's timeout is not the user's to say",
            )
            .at(at())
            .got(format!("{:?}", actuator.timeout.kind))
            .remedy("leave it out"));
        }
    }
    if actuator.timeout.kind == TimeoutKind::None && actuator.dialect.codes_numbers() {
        return Err(ProfileError::new(
            file,
            "an actuator driven by gains goes on pulling when the host dies: it has no timeout",
        )
        .at(place(joint))
        .got(format!("{}: {}", actuator.model, actuator.timeout.action))
        .allowed("an actuator with a timeout"));
    }
    Ok(())
}

fn known_actuator(file: &str, joint: &Joint) -> Result<Actuator, ProfileError> {
    files::actuator(&joint.servo).map_err(|error| {
        let refuse = |what: &str| {
            ProfileError::new(file, what).at(place(joint)).got(format!("{:?}", joint.servo))
        };
        if files::servo(&joint.servo).is_ok() {
            return refuse("a servo cannot hang on a CAN line")
                .allowed("a CAN actuator, or a line of kind = \"serial\"");
        }
        let allowed = error.allowed.clone().unwrap_or_else(|| error.to_string().into());
        refuse("there is no valid actuator profile of this name").allowed(allowed)
    })
}
