//! A robot file from what answers on its lines: a draft that a person finishes.

mod words;

use super::observer::Observer;
use super::report::OwnProfile;
use super::scan::can::{self, scan_can};
use super::scan::{Device as Heard, ScanOrder, Speeds, scan_line};
use super::servo::device::Device;
use super::servo::travel::goal_mode;
use super::servo::{DECIDING, Which};
use crate::bus::Protocol;
use crate::error::{Error, ErrorKind};
use crate::rig::{Address, BusKind, USUAL_BAUD_BPS, dialect_name, is_can, open_can};
use gaitway_profiles::{self as profiles, CanSpeed, Mode, Role};
use serde::Serialize;
use std::collections::BTreeMap;

/// Of the speed without load: what a draft lets a joint have.
const SPEED_SHARE: f64 = 0.5;
/// Full speed is reached in this time, s.
const RAMP_S: f64 = 0.2;
/// What an actuator of which no limit is known may turn to either side, rad.
const NARROW_RAD: f64 = 0.5;
/// How fast, rad/s.
const SLOW_RAD_S: f64 = 1.0;

/// What to ask, and where.
#[derive(Clone, Debug, PartialEq)]
pub struct DraftOrder {
    /// What the robot is to be called.
    pub name: String,
    /// Its lines.
    pub buses: Vec<Address>,
    /// The robot that a virtual line belongs to.
    pub robot: Option<String>,
    /// Serial lines are asked in this protocol only; `None`: in all.
    pub protocol: Option<Protocol>,
    /// At which speeds.
    pub speeds: Speeds,
}

/// A robot file, as far as its lines tell.
#[derive(Clone, Debug, Serialize)]
pub struct RobotDraft {
    /// What the robot is called.
    pub name: String,
    /// One for each device that answered and has a profile.
    pub joints: Vec<DraftJoint>,
    /// What a person has to look at.
    pub notes: Vec<String>,
    /// The user's own profiles by which devices were named.
    pub profiles: Vec<OwnProfile>,
    /// What is still wrong with the file, if anything; the first fault in full, with all others.
    pub faults: Option<String>,
    /// The file.
    #[serde(skip)]
    pub text: String,
}

/// A joint of the draft.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DraftJoint {
    /// Made up from its ID.
    pub name: String,
    /// Its line.
    pub line: String,
    /// Its ID there.
    pub id: u8,
    /// Profile of its servo or actuator.
    pub servo: String,
    /// Where it stands, rad; null if it was not asked.
    pub present_rad: Option<f64>,
    /// Lowest angle the servo itself allows, rad.
    pub lower_rad: f64,
    /// Highest.
    pub upper_rad: f64,
    /// How fast it may turn, rad/s.
    pub velocity_rad_s: f64,
    #[serde(skip)]
    answer_id: Option<u16>,
    /// Firmware and deciding registers, raw.
    #[serde(skip)]
    setup: Option<(u16, BTreeMap<String, i64>)>,
}

/// A line of the draft.
#[derive(Debug)]
enum DraftLine {
    Serial { baud_bps: u32 },
    Can(CanSpeed),
}

/// Asks every line who is there, and writes down what is known of them. Nothing is written to a device.
///
/// # Errors
/// A line that cannot be opened or fails, one that is named twice, or nobody who answers.
pub fn robot_draft(order: &DraftOrder, observer: &dyn Observer) -> Result<RobotDraft, Error> {
    let mut draft = RobotDraft {
        name: order.name.clone(),
        joints: Vec::new(),
        notes: Vec::new(),
        profiles: Vec::new(),
        faults: None,
        text: String::new(),
    };
    let mut lines: Vec<(String, DraftLine)> = Vec::new();
    for (at, bus) in order.buses.iter().enumerate() {
        let name = match (&bus.line, order.buses.len()) {
            (Some(name), _) => name.clone(),
            (None, 1) => "bus".to_owned(),
            (None, _) => format!("bus_{}", at + 1),
        };
        if lines.iter().any(|(known, _)| *known == name) {
            return Err(Error::of(ErrorKind::Malformed, "two lines have one name")
                .at("--from")
                .got(name)
                .remedy("give each its own: --from left=serial:/dev/ttyUSB0"));
        }
        // The name is the draft's; only of a virtual robot it also says which of its lines is meant.
        let line = bus.line.clone().filter(|_| bus.bus.is_virtual());
        let bus = Address { line, bus: bus.bus.clone() };
        let line = if is_can(&bus, order.robot.as_deref())? {
            can_line(order, &name, &bus, &mut draft, observer)?
        } else {
            serial_line(order, &name, &bus, &mut draft, observer)?
        };
        lines.push((name, line));
    }
    if draft.joints.is_empty() {
        let silent = Error::of(ErrorKind::Silent, "no servo answers, so there is nothing to draft")
            .at(order.buses.iter().map(ToString::to_string).collect::<Vec<_>>().join(", "))
            .remedy("check power, cables and line speed: gaitway scan BUS --baud all");
        return Err(match draft.notes.as_slice() {
            [] => silent,
            notes => silent.got(notes.join("; ")),
        });
    }
    several_lines_need_names_that_differ(&mut draft, lines.len());
    draft.profiles = OwnProfile::named(draft.joints.iter().map(|joint| joint.servo.as_str()));
    draft.text = words::text(&draft, &lines);
    // What the line does not tell a person adds; until then it is said what is missing.
    let read = profiles::parse_robot(&format!("{}.toml", order.name), &draft.text);
    draft.faults = read.err().map(|error| Error::from(error).to_string());
    Ok(draft)
}

/// Two lines may have servos of one ID.
fn several_lines_need_names_that_differ(draft: &mut RobotDraft, lines: usize) {
    if lines > 1 {
        for joint in &mut draft.joints {
            joint.name = format!("{}_{}", joint.line, joint.id);
        }
    }
}

fn serial_line(
    order: &DraftOrder,
    name: &str,
    bus: &Address,
    draft: &mut RobotDraft,
    observer: &dyn Observer,
) -> Result<DraftLine, Error> {
    let robot = order.robot.as_deref();
    let DraftOrder { protocol, speeds, .. } = *order;
    let found = scan_line(&ScanOrder { bus, robot, protocol, speeds, wait: None }, observer)?;
    if found.stopped {
        draft.notes.push(format!("{bus} was not asked to the end: more may be on it"));
    }
    for collision in &found.collisions {
        draft.notes.push(format!("ID {} on {bus}: {}", collision.id, collision.reason));
    }
    // One line has one speed: that of most who answered.
    let mut speeds: BTreeMap<u32, usize> = BTreeMap::new();
    let bps = |heard: &Heard| heard.baud_bps.unwrap_or(USUAL_BAUD_BPS);
    found.devices.iter().for_each(|of| *speeds.entry(bps(of)).or_default() += 1);
    let usual = found.scanned_baud_bps.first().copied().unwrap_or(USUAL_BAUD_BPS);
    if found.scanned_baud_bps.is_empty() {
        draft.notes.push(format!(
            "the speed of a line behind TCP is not known here: {usual} bit/s stands in the file; correct it"
        ));
    }
    let most = speeds.iter().max_by_key(|&(_, count)| *count);
    let baud_bps = most.map_or(usual, |(bps, _)| *bps);
    for heard in &found.devices {
        let place = format!("ID {} on {bus}", heard.id);
        if bps(heard) != baud_bps {
            draft.notes.push(format!(
                "{place} answers at {} bit/s, the others at {baud_bps}: left out; gaitway servo \
                 set-baud brings it there",
                bps(heard)
            ));
            continue;
        }
        match &heard.profile {
            Some(servo) => {
                let joint = servo_joint(order, name, bus, heard, servo, &mut draft.notes)?;
                draft.joints.push(joint);
            }
            None => draft.notes.push(format!(
                "{place}: no profile for model number {} ({}): left out",
                heard
                    .model_number
                    .map_or_else(|| "unknown".to_owned(), |number| number.to_string()),
                heard.protocol
            )),
        }
    }
    Ok(DraftLine::Serial { baud_bps })
}

/// A joint that is its servo: its angle, its own limits, the registers that decide where a goal leads.
fn servo_joint(
    order: &DraftOrder,
    line: &str,
    bus: &Address,
    heard: &Heard,
    servo: &str,
    notes: &mut Vec<String>,
) -> Result<DraftJoint, Error> {
    let at_speed = match bus.bus.clone() {
        BusKind::Serial { path, .. } => BusKind::Serial { path, baud_bps: heard.baud_bps },
        other => other,
    };
    let mut device = Device::open(&Which {
        bus: Address { line: bus.line.clone(), bus: at_speed },
        id: heard.id,
        robot: order.robot.clone(),
        model: Some(servo.to_owned()),
        protocol: None,
        dialect: None,
    })?;
    let profile = device.model.profile();
    let mut registers = BTreeMap::new();
    for item in DECIDING.into_iter().filter_map(|role| profile.register(role)?.item(0)) {
        registers.insert(item.name(), device.read(&item)?);
    }
    let name = format!("joint_{}", heard.id);
    let raw_mode = device.read_role(Role::OperatingMode)?;
    let mode = profile.operating_modes.iter().find(|of| Some(i64::from(of.value)) == raw_mode);
    let mode = mode.map(|of| of.mode);
    let usual = goal_mode(&profile.operating_modes).map(|of| of.mode);
    if mode != usual && !matches!(mode, None | Some(Mode::ExtendedPosition)) {
        notes.push(format!("{name} is not in position mode: it will not be played until it is"));
    }
    let turns = mode == Some(Mode::ExtendedPosition);
    let own = device.read_si(Role::MinPositionLimit)?.zip(device.read_si(Role::MaxPositionLimit)?);
    let (lower_rad, upper_rad) = match own {
        Some((lower, upper)) if lower < upper && !turns => (lower, upper),
        _ => {
            notes.push(format!(
                "{name} turns without end: its range is chosen, a quarter of a turn to either side"
            ));
            (-std::f64::consts::FRAC_PI_2, std::f64::consts::FRAC_PI_2)
        }
    };
    let whole_turn = (upper_rad - lower_rad) > 0.99 * std::f64::consts::TAU * span(profile);
    if whole_turn && !turns {
        notes.push(format!("{name} allows all its encoder knows: narrow it to what the body can"));
    }
    Ok(DraftJoint {
        name,
        line: line.to_owned(),
        id: heard.id,
        servo: servo.to_owned(),
        present_rad: device.read_si(Role::PresentPosition)?,
        lower_rad,
        upper_rad,
        velocity_rad_s: SPEED_SHARE * profile.motor.no_load_speed_rad_s,
        answer_id: None,
        setup: Some((device.firmware, registers)),
    })
}

/// The encoder's span in turns.
fn span(servo: &profiles::Servo) -> f64 {
    f64::from(servo.position.degrees) / 360.0
}

fn can_line(
    order: &DraftOrder,
    name: &str,
    bus: &Address,
    draft: &mut RobotDraft,
    observer: &dyn Observer,
) -> Result<DraftLine, Error> {
    let robot = order.robot.as_deref();
    let speed = open_can(bus, robot, 0)?.speed;
    let found = scan_can(bus, robot, None, false, observer)?;
    draft.notes.extend(found.notes);
    for collision in &found.collisions {
        draft.notes.push(format!("id {} on {bus}: {}", collision.id, collision.reason));
    }
    for heard in &found.devices {
        draft.joints.push(actuator_joint(name, bus, heard, &mut draft.notes));
    }
    Ok(DraftLine::Can(speed))
}

/// A joint of which the line tells no limit.
fn actuator_joint(
    line: &str,
    bus: &Address,
    heard: &can::Device,
    notes: &mut Vec<String>,
) -> DraftJoint {
    let name = format!("joint_{}", heard.id);
    notes.push(format!("{name}: an actuator tells no limits: they are chosen, narrow and slow"));
    let of_dialect = || {
        let known = profiles::actuator_names().filter_map(|name| profiles::actuator(name).ok());
        known.filter(|of| dialect_name(of.dialect) == heard.protocol).map(|of| of.name)
    };
    let candidates = match heard.profiles.as_slice() {
        [] => of_dialect().collect(),
        told => told.to_vec(),
    };
    if candidates.len() > 1 {
        notes.push(format!(
            "{name}, id {} on {bus}, may be any of: {}; the first is written",
            heard.id,
            candidates.join(", ")
        ));
    }
    DraftJoint {
        name,
        line: line.to_owned(),
        id: heard.id,
        servo: candidates.into_iter().next().unwrap_or_default(),
        present_rad: None,
        lower_rad: -NARROW_RAD,
        upper_rad: NARROW_RAD,
        velocity_rad_s: SLOW_RAD_S,
        answer_id: heard.answer_id,
        setup: None,
    }
}
