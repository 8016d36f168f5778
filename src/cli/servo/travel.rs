//! `servo move`: one servo, one angle, one actionlet, through everything a whole robot goes
//! through: preflight, arming, guard, watch.

mod can;

use super::Target;
use super::device::Device;
use crate::cli::signals::Signals;
use crate::cli::{Deed, Remarks};
use crate::control::{self, Planned, Sample, Settings, Sink, Stop, StopCode, StopReason, inject};
use crate::error::Error;
use crate::job::report::{Outcome, PlayReport};
use crate::motion::{Path, PlanOptions, Setpoint, plan};
use crate::rig::patience_words;
use crate::robot::Robot;
use crate::robot::preflight::{Accept, preflight};
use clap::Args;
use gaitway_profiles::{self as profiles, Mode, Role};
use serde_json::json;
use std::collections::BTreeMap;

/// Arguments of `servo move`.
#[derive(Debug, Args)]
pub struct MoveArgs {
    #[command(flatten)]
    target: Target,
    /// Angle of the servo, degrees; 0 is the middle of its travel
    #[arg(allow_hyphen_values = true, value_parser = angle_deg)]
    angle_deg: f64,
    /// Highest speed on the way, degrees per second
    #[arg(long, value_name = "DEG_S", default_value_t = 30.0, value_parser = speed_deg_s)]
    speed: f64,
    /// Gain on the error of position, N m/rad: required for actuators that are told their gains with
    /// every goal (damiao, robstride, cubemars-mit)
    #[arg(long, value_name = "NM_RAD", value_parser = gain)]
    kp: Option<f64>,
    /// Gain on the error of velocity, N m s/rad, likewise
    #[arg(long, value_name = "NM_S_RAD", value_parser = gain)]
    kd: Option<f64>,
    /// Silence after which a CAN actuator lets go, seconds, as set with the maker's tool; only for
    /// those whose timeout is no setting on the line
    #[arg(long, value_name = "S", value_parser = gain)]
    timeout: Option<f64>,
    /// Switch torque off afterwards
    #[arg(long)]
    limp: bool,
    /// Check everything, write nothing
    #[arg(long)]
    dry_run: bool,
    /// Move a servo whose firmware the profile was not checked against
    #[arg(long)]
    accept_firmware: bool,
}

/// Rate of the goals, Hz.
const RATE_HZ: f64 = 50.0;
/// Full speed is reached in this time, s.
const RAMP_S: f64 = 0.25;
/// A transition uses this share of the limits (see [`crate::motion::plan::TRANSITION_SHARE`]); the
/// limits are set so that it becomes the speed asked for.
const SHARE: f64 = crate::motion::plan::TRANSITION_SHARE;

fn speed_deg_s(text: &str) -> Result<f64, String> {
    let speed: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    if (1.0..=180.0).contains(&speed) {
        Ok(speed)
    } else {
        Err("allowed: 1 to 180 deg/s".to_owned())
    }
}

fn gain(text: &str) -> Result<f64, String> {
    let gain: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    if gain.is_finite() && gain >= 0.0 { Ok(gain) } else { Err("0 or more".to_owned()) }
}

fn angle_deg(text: &str) -> Result<f64, String> {
    let angle: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    if angle.is_finite() { Ok(angle) } else { Err("a finite number of degrees".to_owned()) }
}

/// Runs `servo move`.
///
/// # Errors
/// Anything preflight, planning or arming has against it.
pub fn run(args: &MoveArgs, remarks: Remarks) -> Result<i32, Error> {
    args.target.output.check_files(&[])?;
    let signals = Signals::listen().map_err(|e| Error::new(format!("no signals: {e}")))?;
    let (place, mut connection) = match args.target.is_can()? {
        true => can::alone(args)?,
        false => {
            only_on_can(args)?;
            let mut device = Device::open(&args.target)?;
            let robot = alone(&mut device, args)?;
            (device.place(), device.line.into_link(robot)?)
        }
    };
    let patience = connection.patience.clone();
    let link = &mut connection.link;
    let settings = Settings::at_rate(RATE_HZ);
    inject::point("preflight", 0);
    let found =
        preflight(link, settings.period, Accept { firmware: args.accept_firmware, eeprom: false })?;
    found.notes.iter().for_each(|note| remarks.say(note));
    let goal_rad = args.angle_deg.to_radians();
    can::refuse_far(link, &place, found.start_rad[0], goal_rad)?;
    let path = Path::new(link.robot().joint_names(), RATE_HZ, vec![vec![goal_rad; 2]])?;
    let planned = plan(&found.start_rad, &path, &link.robot().limits(), PlanOptions::default())
        .map_err(|e| e.at(place.clone()))?;
    let trajectory = &planned.trajectory;
    let mut last = vec![Setpoint::default()];
    trajectory.sample(trajectory.duration_s(), &mut last);
    let start_rad = found.start_rad[0];
    let peak_rad_s = trajectory.peak_velocity_rad_s()[0];
    let mut report = json!({
        "outcome": "done", "stop_reason": null, "dry_run": args.dry_run,
        "start_rad": start_rad, "goal_rad": last[0].position_rad, "reached_rad": null,
        "duration_s": trajectory.duration_s(), "peak_velocity_rad_s": peak_rad_s,
    });
    let plan_words = format!(
        "{place}: {:.1} deg to {:.1} deg in {:.1} s, at most {:.1} deg/s",
        start_rad.to_degrees(),
        last[0].position_rad.to_degrees(),
        trajectory.duration_s(),
        peak_rad_s.to_degrees()
    );
    if args.dry_run || signals.first().is_some() {
        if signals.first().is_some() {
            report["outcome"] = json!(Outcome::Stopped);
            report["stop_reason"] = json!(StopReason::Asked.to_string());
            report["stop"] = json!(Stop::of(StopCode::Asked));
        }
        let text = format!("{plan_words}; nothing was written\n");
        let code = signals.first().map_or(0, |number| 128 + number);
        return Ok(args.target.output.conclude(&report, &text, Deed::Look, code));
    }
    remarks.say(&plan_words);
    let mut seen = LastSeen(start_rad);
    let limits = link.robot().limits();
    let performed = control::perform(
        link,
        &found,
        &mut Planned::new(trajectory, &limits),
        settings,
        &mut seen,
        &|| signals.first().is_some(),
        &mut |_| {},
    )?;
    let mut tell = PlayReport::new("servo move", &place, Vec::new());
    let moved = tell.describe_performance(&performed);
    tell.notes.extend(patience_words(patience.as_ref()));
    // As after `play`: only a motion that came to its end is followed by limp.
    let limp = args.limp && moved && tell.outcome == Outcome::Done;
    if limp {
        control::arm::disarm(link)?;
    }
    tell.notes.iter().filter(|_| !limp).for_each(|note| remarks.say(note));
    report["outcome"] = json!(tell.outcome);
    report["stop_reason"] = json!(tell.stop_reason);
    report["stop"] = json!(tell.stop);
    report["left"] = json!(tell.left.as_ref().filter(|_| !limp));
    report["flight"] = json!(tell.flight);
    report["notes"] = json!(tell.notes);
    report["reached_rad"] = json!(moved.then_some(seen.0));
    let torque = match (&tell.left, limp) {
        (_, true) => "torque is off".to_owned(),
        (Some(left), _) => left.words(),
        (None, _) => "nothing was switched on".to_owned(),
    };
    let why = tell.stop_reason.as_ref().map_or_else(String::new, |stop| format!(" ({stop})"));
    let text = format!("{place} stands at {:.1} deg; {torque}{why}\n", seen.0.to_degrees());
    let code = tell.exit_code(signals.first());
    Ok(args.target.output.conclude(&report, &text, Deed::Motion, code))
}

/// What is for CAN actuators says nothing on a serial line.
fn only_on_can(args: &MoveArgs) -> Result<(), Error> {
    if args.kp.is_none() && args.kd.is_none() && args.timeout.is_none() {
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
fn alone(device: &mut Device, args: &MoveArgs) -> Result<Robot, Error> {
    in_position_mode(device)?;
    let place = device.place();
    let (lower_rad, upper_rad) = travel(device)?;
    let mut registers = BTreeMap::new();
    let kept = [
        Role::DriveMode,
        Role::HomingOffset,
        Role::OperatingMode,
        Role::MinPositionLimit,
        Role::MaxPositionLimit,
        Role::ReturnDelay,
        Role::TemperatureLimit,
        Role::MinVoltageLimit,
    ];
    let servo = device.model.profile();
    let items = kept.into_iter().filter_map(|role| servo.register(role)?.item(0));
    for item in items {
        registers.insert(item.name(), device.read(&item)?);
    }
    let velocity_rad_s = args.speed.to_radians() / SHARE;
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
        initial_rad: 0.0_f64.clamp(lower_rad, upper_rad),
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
        initial_rad: 0.0,
        parent: None,
        origin_m: [0.0; 3],
        axis: [0.0, 0.0, 1.0],
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
        anatomy: profiles::Anatomy {
            base: Vec::new(),
            n_pose_rad: BTreeMap::new(),
            segments: Vec::new(),
            source: text("none"),
        },
    })
}

/// A goal is an angle only in position mode.
fn in_position_mode(device: &mut Device) -> Result<(), Error> {
    let Some(raw) = device.read_role(Role::OperatingMode)? else { return Ok(()) };
    let modes = &device.model.profile().operating_modes;
    let mode = modes.iter().find(|mode| i64::from(mode.value) == raw).map(|mode| mode.mode);
    let usual = device.item(Role::OperatingMode).and_then(|item| item.initial());
    if mode == Some(Mode::Position) || (modes.is_empty() && usual == Some(raw)) {
        return Ok(());
    }
    Err(Error::new("the servo is not in position mode")
        .at(device.place())
        .got(mode.map_or_else(|| raw.to_string(), |mode| format!("{mode:?}")))
        .allowed("Position")
        .remedy("gaitway servo set BUS ID 'Operating Mode' N --permit-eeprom"))
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
