//! One servo, one angle, one actionlet, through everything a whole robot goes through: preflight, arming,
//! guard, watch.

mod can;

use super::device::Device;
use super::{DECIDING, Which};
use crate::control::{
    self, FlightCycle, Left, Planned, Sample, Settings, Sink, Stop, StopCode, StopReason, inject,
};
use crate::error::{Error, ErrorKind};
use crate::job::observer::{Event, Observer};
use crate::job::report::{Outcome, PlayReport};
use crate::motion::{Path, PlanOptions, Setpoint, plan};
use crate::rig::patience_words;
use crate::robot::Robot;
use crate::robot::preflight::{Accept, preflight};
use gaitway_profiles::{self as profiles, Mode, Role};
use serde::Serialize;
use std::collections::BTreeMap;

/// Rate of the goals, Hz.
const RATE_HZ: f64 = 50.0;
/// Highest speed of a servo that is to stay where it is, rad/s.
const STANDING_RAD_S: f64 = 0.5;
/// Full speed is reached in this time, s.
const RAMP_S: f64 = 0.25;
/// A transition uses this share of the limits (see [`crate::motion::plan::TRANSITION_SHARE`]); the
/// limits are set so that it becomes the speed asked for.
const SHARE: f64 = crate::motion::plan::TRANSITION_SHARE;

/// Which servo goes where, and how.
#[derive(Clone, Debug)]
pub struct MoveOrder {
    /// The servo.
    pub which: Which,
    /// Its angle, rad; 0 is the middle of its travel. `None`: where it stands, with torque on.
    pub angle_rad: Option<f64>,
    /// Highest speed on the way, rad/s.
    pub speed_rad_s: f64,
    /// Gain on the error of position, N m/rad, for actuators that are told it with every goal.
    pub kp_nm_rad: Option<f64>,
    /// Gain on the error of velocity, N m s/rad, likewise.
    pub kd_nm_s_rad: Option<f64>,
    /// Silence after which a CAN actuator lets go, s, where that is no setting on the line.
    pub timeout_s: Option<f64>,
    /// Torque goes off afterwards.
    pub limp: bool,
    /// Check everything, write nothing.
    pub dry_run: bool,
    /// Move a servo whose firmware the profile was not checked against.
    pub accept_firmware: bool,
}

impl MoveOrder {
    /// Torque on, where the servo stands.
    #[must_use]
    pub const fn stand(which: Which, accept_firmware: bool) -> Self {
        Self {
            which,
            angle_rad: None,
            speed_rad_s: STANDING_RAD_S,
            kp_nm_rad: None,
            kd_nm_s_rad: None,
            timeout_s: None,
            limp: false,
            dry_run: false,
            accept_firmware,
        }
    }
}

/// What came of it.
#[derive(Clone, Debug, Serialize)]
pub struct MoveReport {
    /// How it ended.
    pub outcome: Outcome,
    /// Why, unless done.
    pub stop_reason: Option<String>,
    /// The same as data.
    pub stop: Option<Stop>,
    /// True if nothing was written.
    pub dry_run: bool,
    /// Where it stood, rad.
    pub start_rad: f64,
    /// Where it was to go, rad.
    pub goal_rad: f64,
    /// Where it was seen last, rad; null if it was not moved.
    pub reached_rad: Option<f64>,
    /// Length of the movement, s.
    pub duration_s: f64,
    /// Highest speed of the goals, rad/s.
    pub peak_velocity_rad_s: f64,
    /// How it was left; null if nothing was switched on, or torque is off.
    pub left: Option<Left>,
    /// The last cycles before a stop.
    pub flight: Vec<FlightCycle>,
    /// What a person should know.
    pub notes: Vec<String>,
    /// Where it is, in words.
    #[serde(skip)]
    pub place: String,
    /// True if torque was switched off afterwards.
    #[serde(skip)]
    pub is_limp: bool,
}

/// Moves one servo. Whatever keeps it from being moved is an error; what happens once torque is on is in
/// the report.
///
/// # Errors
/// Anything preflight, planning or arming has against it.
pub fn move_one(order: &MoveOrder, observer: &dyn Observer) -> Result<MoveReport, Error> {
    let (place, mut connection) = match order.which.is_can()? {
        true => can::alone(order)?,
        false => {
            only_on_can(order)?;
            let mut device = Device::open(&order.which)?;
            let robot = alone(&mut device, order)?;
            (device.place(), device.line.into_link(robot)?)
        }
    };
    let patience = connection.patience.clone();
    let link = &mut connection.link;
    let settings = Settings::at_rate(RATE_HZ);
    inject::point("preflight", 0);
    let accept = Accept { firmware: order.accept_firmware, eeprom: false };
    let found = preflight(link, settings.period, accept)?;
    found.notes.iter().for_each(|note| observer.hear(Event::Note(note)));
    let angle_rad = order.angle_rad.unwrap_or(found.start_rad[0]);
    can::refuse_far(link, &place, found.start_rad[0], angle_rad)?;
    let path = Path::new(link.robot().joint_names(), RATE_HZ, vec![vec![angle_rad; 2]])?;
    let planned = plan(&found.start_rad, &path, &link.robot().limits(), PlanOptions::default())
        .map_err(|e| e.at(place.clone()))?;
    let trajectory = &planned.trajectory;
    let mut last = vec![Setpoint::default()];
    trajectory.sample(trajectory.duration_s(), &mut last);
    let mut report = MoveReport {
        outcome: Outcome::Done,
        stop_reason: None,
        stop: None,
        dry_run: order.dry_run,
        start_rad: found.start_rad[0],
        goal_rad: last[0].position_rad,
        reached_rad: None,
        duration_s: trajectory.duration_s(),
        peak_velocity_rad_s: trajectory.peak_velocity_rad_s()[0],
        left: None,
        flight: Vec::new(),
        notes: Vec::new(),
        place,
        is_limp: false,
    };
    if observer.wants_to_stop() {
        report.outcome = Outcome::Stopped;
        report.stop_reason = Some(StopReason::Asked.to_string());
        report.stop = Some(Stop::of(StopCode::Asked));
        return Ok(report);
    }
    if order.dry_run {
        return Ok(report);
    }
    observer.hear(Event::Note(&report.plan_words()));
    let mut seen = LastSeen(report.start_rad);
    let mut motion = Planned::new(trajectory, link.robot())?;
    let performed = control::perform(
        link,
        &found,
        &mut motion,
        settings,
        &mut seen,
        &|| observer.wants_to_stop(),
        &mut |_| {},
    )?;
    let mut told = PlayReport::new("servo move", &report.place, Vec::new());
    let moved = told.describe_performance(&performed);
    told.notes.extend(patience_words(patience.as_ref()));
    // As after `play`: only a motion that came to its end is followed by limp.
    report.is_limp = order.limp && moved && told.outcome == Outcome::Done;
    if report.is_limp {
        control::arm::disarm(link)?;
    } else {
        told.notes.iter().for_each(|note| observer.hear(Event::Note(note)));
        report.left = told.left;
    }
    report.outcome = told.outcome;
    report.stop_reason = told.stop_reason;
    report.stop = told.stop;
    report.flight = told.flight;
    report.notes = told.notes;
    report.reached_rad = moved.then_some(seen.0);
    Ok(report)
}

impl MoveReport {
    /// What is to be done, in words.
    #[must_use]
    pub fn plan_words(&self) -> String {
        format!(
            "{}: {:.1} deg to {:.1} deg in {:.1} s, at most {:.1} deg/s",
            self.place,
            self.start_rad.to_degrees(),
            self.goal_rad.to_degrees(),
            self.duration_s,
            self.peak_velocity_rad_s.to_degrees()
        )
    }
}

/// What is for CAN actuators says nothing on a serial line.
fn only_on_can(order: &MoveOrder) -> Result<(), Error> {
    if order.kp_nm_rad.is_none() && order.kd_nm_s_rad.is_none() && order.timeout_s.is_none() {
        return Ok(());
    }
    Err(Error::new("gains and timeouts are told to CAN actuators only")
        .at("--kp, --kd, --timeout")
        .remedy("gaitway servo set BUS ID 'Position P Gain' N sets those of a serial servo"))
}

/// Remembers where the servo was seen last.
struct LastSeen(f64);

impl Sink for LastSeen {
    fn take(&mut self, sample: &Sample<'_>) {
        if let Some(Ok((state, _))) = sample.states.first() {
            self.0 = state.position_rad;
        }
    }
}

/// A robot of one joint, which is the servo itself: its own angle, its own position limits, and
/// the registers that decide where a goal leads as they are now.
fn alone(device: &mut Device, order: &MoveOrder) -> Result<Robot, Error> {
    in_position_mode(device)?;
    let place = device.place();
    let (lower_rad, upper_rad) = travel(device)?;
    let mut registers = BTreeMap::new();
    let servo = device.model.profile();
    let items = DECIDING.into_iter().filter_map(|role| servo.register(role)?.item(0));
    for item in items {
        registers.insert(item.name(), device.read(&item)?);
    }
    let velocity_rad_s = order.speed_rad_s / SHARE;
    let text = |words: &str| words.to_owned();
    let setup = profiles::Setup {
        servo: servo.name.clone(),
        joints: None,
        firmware: device.firmware,
        registers,
        source: text("asked of the servo"),
    };
    let joint = profiles::Joint {
        velocity_rad_s: velocity_rad_s.min(servo.motor.no_load_speed_rad_s),
        acceleration_rad_s2: velocity_rad_s / RAMP_S,
        lower_rad,
        upper_rad,
        ..bare_joint(device.id, &servo.name)
    };
    let kind = profiles::LineKind::Serial { baud_bps: device.line.baud_bps };
    robot_of(joint, kind, vec![setup]).map_err(|e| e.at(place))
}

/// A joint that is its servo, with nothing said of it yet.
fn bare_joint(id: u8, servo: &str) -> profiles::Joint {
    profiles::Joint {
        name: "servo".to_owned(),
        line: "bus".to_owned(),
        id,
        servo: servo.to_owned(),
        answer_id: None,
        kp_nm_rad: None,
        kd_nm_s_rad: None,
        timeout_configured_s: None,
        direction: 1,
        gear: 1.0,
        offset_rad: 0.0,
        shares_case_with: None,
        lower_rad: 0.0,
        upper_rad: 0.0,
        velocity_rad_s: 0.0,
        acceleration_rad_s2: 0.0,
        initial: None,
        parent: None,
        origin_m: None,
        axis: None,
    }
}

/// A robot of one joint on one line.
fn robot_of(
    joint: profiles::Joint,
    kind: profiles::LineKind,
    setups: Vec<profiles::Setup>,
) -> Result<Robot, Error> {
    let text = |words: &str| words.to_owned();
    Robot::new(profiles::Robot {
        schema: 1,
        name: format!("{}-{}", joint.servo, joint.id),
        description: text("one servo"),
        source: text("asked of the servo"),
        rate_hz: RATE_HZ,
        acceleration_source: text("chosen"),
        lines: vec![profiles::Line { name: text("bus"), kind }],
        setups,
        joints: vec![joint],
        anatomy: None,
        body: None,
        origin: None,
    })
}

/// In which mode goals of this model are angles within its limits: position mode or, where it has none (RH-P12-RN), the one
/// that bounds the current on the way as well.
pub fn goal_mode(modes: &[profiles::OperatingMode]) -> Option<&profiles::OperatingMode> {
    let of = |wanted: Mode| modes.iter().find(move |mode| mode.mode == wanted);
    of(Mode::Position).or_else(|| of(Mode::CurrentBasedPosition))
}

/// A goal is an angle only in some modes.
fn in_position_mode(device: &mut Device) -> Result<(), Error> {
    let Some(raw) = device.read_role(Role::OperatingMode)? else { return Ok(()) };
    let modes = &device.model.profile().operating_modes;
    let mode = modes.iter().find(|mode| i64::from(mode.value) == raw).map(|mode| mode.mode);
    let usual = device.item(Role::OperatingMode).and_then(|item| item.initial());
    let wanted = goal_mode(modes);
    if wanted.is_some_and(|wanted| mode == Some(wanted.mode))
        || (modes.is_empty() && usual == Some(raw))
    {
        return Ok(());
    }
    let refused =
        Error::of(ErrorKind::NotReady, "the servo is not in a mode in which it goes to angles")
            .at(device.place())
            .got(mode.map_or_else(|| raw.to_string(), |mode| format!("{mode:?}")));
    Err(match (wanted, usual.filter(|_| modes.is_empty())) {
        (Some(wanted), _) => {
            in_mode(refused, device.id, &format!("{:?}", wanted.mode), wanted.value.into())
        }
        (None, Some(usual)) => in_mode(refused, device.id, "as it leaves the factory", usual),
        (None, None) => refused.allowed("a model that has such a mode"),
    })
}

fn in_mode(refused: Error, id: u8, mode: &str, value: i64) -> Error {
    let remedy = format!("gaitway servo set BUS {id} 'Operating Mode' {value} --permit-eeprom");
    refused.allowed(mode).remedy(remedy)
}

/// The range the servo itself allows, rad.
fn travel(device: &mut Device) -> Result<(f64, f64), Error> {
    let lower = device.read_si(Role::MinPositionLimit)?;
    let upper = device.read_si(Role::MaxPositionLimit)?;
    match lower.zip(upper) {
        Some((lower, upper)) if lower < upper => Ok((lower, upper)),
        Some(_) => Err(Error::new("the servo turns without end: its position limits are equal")
            .at(device.place())
            .remedy("set its minimum and maximum position first")),
        None => Err(Error::new("the servo has no position limits").at(device.place())),
    }
}
