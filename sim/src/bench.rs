//! A bench: servos on a table, without a robot around them. It is a robot whose joints are its
//! servos, as they left the factory but for their IDs and the speed of their line.

use crate::profiles::{
    self, Actuator, CanSpeed, Dialect, Joint, Line, LineKind, Robot, Role, Servo,
};
use std::collections::BTreeSet;
use std::f64::consts::PI;

/// Full speed is reached in this time, s (assumed); only the referee looks at it.
const RAMP_S: f64 = 0.2;
/// What an actuator of which no range is known may turn, rad/s.
const UNKNOWN_RAD_S: f64 = 60.0;
/// IDs in one list.
const MOST_IDS: usize = 256;

/// Servos of one model.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BenchServos {
    /// Name of a servo's or CAN actuator's profile; capitals and underscores are taken as lower case and
    /// hyphens.
    pub model: String,
    /// Their IDs.
    pub ids: Vec<u8>,
}

/// Why a bench cannot be set up.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum BenchError {
    /// There is nothing on it.
    #[error("there is no servo on the bench")]
    Empty,
    /// The text is not MODEL:IDS.
    #[error("{got:?} is not MODEL:IDS; {allowed}")]
    Text {
        /// What it is.
        got: String,
        /// What could be.
        allowed: &'static str,
    },
    /// No servo or actuator has this name.
    #[error("no servo or CAN actuator is named {got:?}; {advice}")]
    UnknownModel {
        /// The name.
        got: String,
        /// What to do.
        advice: String,
        /// All names there are.
        allowed: String,
    },
    /// The model cannot have this ID.
    #[error("{model} cannot have the ID {id}: {first}..{last} are allowed")]
    Id {
        /// The profile.
        model: String,
        /// The ID.
        id: u8,
        /// The first that it can have.
        first: u8,
        /// The last.
        last: u8,
    },
    /// Two have one ID on one line.
    #[error("two devices on one line have the ID {0}")]
    SameId(u8),
    /// The servos have no speed in common, or not this one.
    #[error("{model} cannot run at {got} bit/s; allowed: {allowed}")]
    Speed {
        /// The profile.
        model: String,
        /// The speed.
        got: u32,
        /// What it can run at.
        allowed: String,
    },
    /// The servos leave the factory with speeds that differ, and none is given.
    #[error("the servos leave the factory with speeds that differ: {0}; say which the line has")]
    WhichSpeed(String),
    /// Identifiers of two families would mix on one CAN line, or classic frames with those of FD.
    #[error("{0} and {1} cannot share a CAN line")]
    Apart(String, String),
}

const IDS: &str = "a model, a colon, and IDs with commas or ranges: xm430-w350:1,2,5-8";

impl std::str::FromStr for BenchServos {
    type Err = BenchError;

    /// `xm430-w350:1,2,5-8`
    fn from_str(text: &str) -> Result<Self, BenchError> {
        let wrong = || BenchError::Text { got: text.to_string(), allowed: IDS };
        let (model, list) = text.split_once(':').ok_or_else(wrong)?;
        let mut ids = Vec::new();
        for part in list.split(',') {
            let (first, last) = part.split_once('-').unwrap_or((part, part));
            let number = |text: &str| text.trim().parse::<u8>().map_err(|_| wrong());
            let (first, last) = (number(first)?, number(last)?);
            if first > last || ids.len() + usize::from(last - first) >= MOST_IDS {
                return Err(wrong());
            }
            ids.extend(first..=last);
        }
        if model.is_empty() {
            return Err(wrong());
        }
        Ok(Self { model: model.to_string(), ids })
    }
}

/// A model that was found.
enum Kind {
    Servo(&'static Servo),
    Actuator(Box<Actuator>),
}

/// A name as profiles have it: `XM430_W350` is `xm430-w350`.
#[must_use]
fn profile_name(text: &str) -> String {
    text.to_ascii_lowercase().replace('_', "-")
}

fn find(model: &str) -> Result<Kind, BenchError> {
    let name = profile_name(model);
    if let Ok(servo) = profiles::servo(&name) {
        return Ok(Kind::Servo(servo));
    }
    profiles::actuator(&name).map(|actuator| Kind::Actuator(Box::new(actuator))).map_err(|_| {
        let names: Vec<&str> = profiles::servo_names().chain(profiles::actuator_names()).collect();
        BenchError::UnknownModel {
            got: model.to_string(),
            advice: profiles::advice(&name, &names, "take one of these names"),
            allowed: names.join(", "),
        }
    })
}

/// The bench as a robot named `bench`. Servos hang on a serial line `bus`, CAN actuators on a CAN line
/// `can`; a joint is called `joint_ID`, or `bus_ID` and `can_ID` where there are both lines. Each may
/// go wherever its encoder, its factory limits or its coding lets it. Without `baud_bps` the serial
/// line has the speed that the servos leave the factory with.
///
/// # Errors
/// No servo, an unknown model, an ID that a model cannot have or two have, a speed that one does not
/// know, or actuators that cannot share a line.
pub fn bench(servos: &[BenchServos], baud_bps: Option<u32>) -> Result<Robot, BenchError> {
    let (mut on_serial, mut on_can) = (Vec::new(), Vec::new());
    for BenchServos { model, ids } in servos {
        match find(model)? {
            Kind::Servo(servo) => on_serial.extend(ids.iter().map(|&id| (servo, id))),
            Kind::Actuator(actuator) => {
                on_can.extend(ids.iter().map(|&id| ((*actuator).clone(), id)));
            }
        }
    }
    let both = !on_serial.is_empty() && !on_can.is_empty();
    let name = |line: &str, id: u8| match both {
        true => format!("{line}_{id}"),
        false => format!("joint_{id}"),
    };
    let (mut lines, mut joints) = (Vec::new(), Vec::new());
    if !on_serial.is_empty() {
        let baud_bps = serial_speed(&on_serial, baud_bps)?;
        lines.push(Line { name: "bus".to_string(), kind: LineKind::Serial { baud_bps } });
        let ids = on_serial
            .iter()
            .map(|(servo, id)| (*id, servo.name.as_str(), 0, servo.protocol.highest_id()));
        check_ids(ids)?;
        joints
            .extend(on_serial.iter().map(|(servo, id)| servo_joint(name("bus", *id), *id, servo)));
    }
    if !on_can.is_empty() {
        lines.push(Line { name: "can".to_string(), kind: LineKind::Can(can_speed(&on_can)?) });
        let ids = on_can.iter().map(|(actuator, id)| {
            (*id, actuator.name.as_str(), actuator.line.first_id, actuator.line.last_id)
        });
        check_ids(ids)?;
        joints.extend(on_can.iter().map(|(of, id)| actuator_joint(name("can", *id), *id, of)));
    }
    if joints.is_empty() {
        return Err(BenchError::Empty);
    }
    Ok(Robot {
        schema: 1,
        name: "bench".to_string(),
        description: "servos on a bench".to_string(),
        source: "unconfirmed: a bench is nobody's robot".to_string(),
        rate_hz: 50.0,
        acceleration_source: format!("assumed: full speed reached in {RAMP_S} s"),
        lines,
        setups: Vec::new(),
        joints,
        anatomy: None,
        body: None,
        origin: None,
    })
}

fn check_ids<'a>(all: impl Iterator<Item = (u8, &'a str, u8, u8)>) -> Result<(), BenchError> {
    let mut seen = BTreeSet::new();
    for (id, model, first, last) in all {
        if !(first..=last).contains(&id) {
            return Err(BenchError::Id { model: model.to_string(), id, first, last });
        }
        if !seen.insert(id) {
            return Err(BenchError::SameId(id));
        }
    }
    Ok(())
}

/// The speed given, or the one they all leave the factory with.
fn serial_speed(servos: &[(&Servo, u8)], given: Option<u32>) -> Result<u32, BenchError> {
    let factory = |servo: &Servo| {
        let index = servo.register(Role::BaudRate).and_then(|register| register.initial);
        let line = servo.baud.iter().find(|line| Some(i64::from(line.index)) == index);
        line.map_or(1_000_000, |line| line.bps)
    };
    let speeds: BTreeSet<u32> = servos.iter().map(|(servo, _)| factory(servo)).collect();
    let baud_bps = match (given, speeds.first()) {
        (Some(bps), _) => bps,
        (None, Some(&bps)) if speeds.len() == 1 => bps,
        (None, _) => {
            let each: BTreeSet<String> = servos
                .iter()
                .map(|(servo, _)| format!("{} at {} bit/s", servo.name, factory(servo)))
                .collect();
            let each: Vec<String> = each.into_iter().collect();
            return Err(BenchError::WhichSpeed(each.join(", ")));
        }
    };
    for (servo, _) in servos {
        if servo.baud_index(baud_bps).is_none() {
            let known: Vec<String> = servo.baud.iter().map(|line| line.bps.to_string()).collect();
            return Err(BenchError::Speed {
                model: servo.name.clone(),
                got: baud_bps,
                allowed: known.join(", "),
            });
        }
    }
    Ok(baud_bps)
}

/// A speed that all of them know; each leaves the factory with the first it names.
fn can_speed(actuators: &[(Actuator, u8)]) -> Result<CanSpeed, BenchError> {
    let Some(((first, _), others)) = actuators.split_first() else { return Err(BenchError::Empty) };
    for (other, _) in others {
        let mixes = other.dialect != first.dialect
            && other.dialect.has_short_ids() == first.dialect.has_short_ids();
        if mixes || other.dialect.is_fd() != first.dialect.is_fd() {
            return Err(BenchError::Apart(first.name.clone(), other.name.clone()));
        }
    }
    let known = |bps: &u32| others.iter().all(|(other, _)| other.line.bitrates_bps.contains(bps));
    let rates = &first.line.bitrates_bps;
    let bitrate_bps = rates.iter().copied().find(known).ok_or_else(|| {
        let other = others
            .iter()
            .find(|(other, _)| !other.line.bitrates_bps.iter().any(|bps| rates.contains(bps)));
        let other = other.or(others.first()).map_or(first, |(other, _)| other);
        BenchError::Apart(first.name.clone(), other.name.clone())
    })?;
    let data_bitrate_bps = match first.dialect {
        Dialect::Moteus => first.line.data_bitrates_bps.first().copied(),
        _ => None,
    };
    Ok(CanSpeed { bitrate_bps, data_bitrate_bps, host_id: 0xFD })
}

fn joint(name: String, line: &str, id: u8, servo: &str, range_rad: (f64, f64), fast: f64) -> Joint {
    Joint {
        name,
        line: line.to_string(),
        id,
        servo: servo.to_string(),
        answer_id: None,
        kp_nm_rad: None,
        kd_nm_s_rad: None,
        timeout_configured_s: None,
        direction: 1,
        gear: 1.0,
        offset_rad: 0.0,
        shares_case_with: None,
        lower_rad: range_rad.0,
        upper_rad: range_rad.1,
        velocity_rad_s: fast,
        acceleration_rad_s2: fast / RAMP_S,
        initial: None,
        parent: None,
        origin_m: None,
        axis: None,
    }
}

fn servo_joint(name: String, id: u8, servo: &Servo) -> Joint {
    let factory = |role| servo.register(role).and_then(|register| register.initial);
    let whole = (0, i64::from(servo.position.counts) - 1);
    let (low, high) = match factory(Role::MinPositionLimit).zip(factory(Role::MaxPositionLimit)) {
        // Equal limits are those of a wheel.
        Some((low, high)) if low < high => (low, high),
        _ => whole,
    };
    let zero = f64::from(servo.position.zero_count);
    let angle = |count: i64| (count as f64 - zero) * servo.radians_per_count();
    let fast = servo.motor.no_load_speed_rad_s;
    joint(name, "bus", id, &servo.name, (angle(low), angle(high)), fast)
}

fn actuator_joint(name: String, id: u8, actuator: &Actuator) -> Joint {
    let ranges = actuator.ranges.as_ref();
    let reach = ranges.map_or(PI, |ranges| ranges.position_rad);
    let fast = ranges.map_or(UNKNOWN_RAD_S, |ranges| ranges.velocity_rad_s);
    let mut joint = joint(name, "can", id, &actuator.name, (-reach, reach), fast);
    joint.kp_nm_rad = ranges.map(|ranges| 0.1 * ranges.kp_nm_rad);
    joint.kd_nm_s_rad = ranges.map(|ranges| 0.1 * ranges.kd_nm_s_rad);
    joint
}
