//! `servo move`, as it is typed.

use super::{Target, actuator};
use crate::cli::signals::Signals;
use crate::cli::terminal::Terminal;
use crate::cli::{Deed, Remarks};
use crate::error::Error;
use crate::job::report::{Stop, StopCode};
use crate::job::servo::device::Device;
use crate::job::servo::travel::{MoveOrder, MoveReport, move_one};
use clap::Args;
use serde_json::json;

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
    let order = MoveOrder {
        which: args.target.which()?,
        angle_rad: Some(args.angle_deg.to_radians()),
        speed_rad_s: args.speed.to_radians(),
        kp_nm_rad: args.kp,
        kd_nm_s_rad: args.kd,
        timeout_s: args.timeout,
        limp: args.limp,
        dry_run: args.dry_run,
        accept_firmware: args.accept_firmware,
    };
    go(&args.target, &order, remarks)
}

fn go(target: &Target, order: &MoveOrder, remarks: Remarks) -> Result<i32, Error> {
    let signals = Signals::listen().map_err(|e| Error::new(format!("no signals: {e}")))?;
    let report = move_one(order, &Terminal::new(remarks, &signals))?;
    let code = match (signals.first(), &report.stop) {
        (Some(number), Some(Stop { code: StopCode::Asked, .. })) => 128 + number,
        _ => report.outcome.exit_code(),
    };
    let (text, deed) = text(&report);
    Ok(target.output.conclude(&report, &text, deed, code))
}

/// Arguments of `servo torque`.
#[derive(Debug, Args)]
pub struct TorqueArgs {
    #[command(flatten)]
    target: Target,
    /// On: it holds where it stands. Off: whatever it carries falls
    #[arg(value_parser = ["on", "off"])]
    state: String,
    /// Switch torque on in a servo whose firmware the profile was not checked against
    #[arg(long)]
    accept_firmware: bool,
}

/// Runs `servo torque`.
///
/// # Errors
/// As [`run`]; a servo that does not confirm.
pub fn torque(args: &TorqueArgs, remarks: Remarks) -> Result<i32, Error> {
    let target = &args.target;
    target.output.check_files(&[])?;
    if target.is_can()? {
        let remedy = "gaitway servo move BUS ID ANGLE_DEG, with --limp to let go afterwards";
        return actuator::refuse("torque by itself", &target.bus, remedy);
    }
    let which = target.which()?;
    if args.state == "on" {
        return go(target, &MoveOrder::stand(which, args.accept_firmware), remarks);
    }
    let mut device = Device::open(&which)?;
    device.let_go()?;
    let (text, id) = (format!("{}: torque is off\n", device.place()), device.id);
    Ok(target.output.conclude(&json!({"id": id, "torque_on": false}), &text, Deed::Work, 0))
}

/// What came of it, in words.
fn text(report: &MoveReport) -> (String, Deed) {
    let Some(reached_rad) = report.reached_rad else {
        return (format!("{}; nothing was written\n", report.plan_words()), Deed::Look);
    };
    let torque = match &report.left {
        _ if report.is_limp => "torque is off".to_owned(),
        Some(left) => left.words(),
        None => "nothing was switched on".to_owned(),
    };
    let why = report.stop_reason.as_ref().map_or_else(String::new, |stop| format!(" ({stop})"));
    let (place, degrees) = (&report.place, reached_rad.to_degrees());
    (format!("{place} stands at {degrees:.1} deg; {torque}{why}\n"), Deed::Motion)
}
