//! `servo set-id` and `servo set-baud`: after either the servo is found under other terms, and is
//! looked for there before anything is said.

use super::{Target, actuator};
use crate::cli::calibrate::Answers;
use crate::cli::output::prompt;
use crate::cli::signals::Signals;
use crate::cli::terminal::Terminal;
use crate::cli::{Deed, Output, Remarks};
use crate::error::{Error, ErrorKind};
use crate::job::report::Outcome;
use crate::job::servo::change::{change_baud, change_id, needed, permitted, refuse_taken};
use crate::job::servo::device::Device;
use crate::job::servo::set_up::{
    SetUpAnswer, SetUpOrder, SetUpTask, set_up, set_up_answered, set_up_question,
};
use crate::rig::Address;
use clap::Args;
use gaitway_profiles::Role;
use serde_json::json;

/// Arguments of `servo set-id`.
#[derive(Debug, Args)]
pub struct SetIdArgs {
    #[command(flatten)]
    pub(super) target: Target,
    /// The ID it gets
    pub(super) new_id: u8,
    /// Allow writing what the servo keeps at power-off
    #[arg(long)]
    pub(super) permit_eeprom: bool,
}

/// Arguments of `servo set-baud`.
#[derive(Debug, Args)]
pub struct SetBaudArgs {
    #[command(flatten)]
    target: Target,
    /// The line speed it gets, bits per second
    baud_bps: u32,
    /// Allow writing what the servo keeps at power-off
    #[arg(long)]
    permit_eeprom: bool,
}

/// Arguments of `servo set-up`.
#[derive(Debug, Args)]
pub struct SetUpArgs {
    /// Where the line is: serial:PATH, tcp:HOST:PORT; LINE=BUS of a robot with several
    bus: Address,
    /// Robot whose line this is
    #[arg(long)]
    robot: String,
    /// Only this joint, again for others
    #[arg(long)]
    joint: Vec<String>,
    /// Allow writing what servos keep at power-off
    #[arg(long)]
    permit_eeprom: bool,
    /// Look who is there, write nothing
    #[arg(long)]
    dry_run: bool,
    #[command(flatten)]
    output: Output,
}

/// Runs `servo set-up`.
///
/// # Errors
/// As [`set_up`].
pub fn set_up_all(args: &SetUpArgs, remarks: Remarks) -> Result<i32, Error> {
    args.output.check_files(&[])?;
    let signals = Signals::listened()?;
    let order = SetUpOrder {
        bus: args.bus.clone(),
        robot: args.robot.clone(),
        joints: args.joint.clone(),
        permit_eeprom: args.permit_eeprom,
        dry_run: args.dry_run,
    };
    let mut answers = Answers::listen(signals.clone())?;
    let mut ask = |task: SetUpTask<'_>| loop {
        let _ = prompt(&set_up_question(task));
        match answers.line().map(|line| set_up_answered(&line)) {
            Some(Some(answer)) => return answer,
            Some(None) => {}
            None => return SetUpAnswer::Stop,
        }
    };
    let report = set_up(&order, &Terminal::new(remarks, &signals), &mut ask)?;
    let code = match (signals.first(), report.outcome) {
        (Some(number), Outcome::Stopped) => 128 + number,
        (_, outcome) => outcome.exit_code(),
    };
    Ok(args.output.conclude(&report, &report.text(), Deed::Work, code))
}

/// Runs `servo set-id`.
///
/// # Errors
/// The new ID is taken or not one of the protocol's, no permit, torque on; or the servo is not
/// found under its new ID.
pub fn set_id(args: &SetIdArgs, remarks: Remarks) -> Result<i32, Error> {
    args.target.output.check_files(&[])?;
    if args.target.is_can()? {
        return actuator::set_id(args, remarks);
    }
    Signals::defer()?;
    let mut device = Device::open(&args.target.which()?)?;
    let (old, new) = (device.id, args.new_id);
    let item = needed(&device, Role::Id)?;
    let highest = device.model.profile().protocol.highest_id();
    if new > highest {
        return Err(Error::new("not an ID of this protocol")
            .at(device.place())
            .got(new.to_string())
            .allowed(format!("0 to {highest}")));
    }
    if new != old {
        permitted(&device, args.permit_eeprom, &format!("ID {old} would become {new}"))?;
        refuse_taken(&mut device, new)?;
        device.must_be_limp()?;
        change_id(&mut device, &item, new)?;
    }
    let bus = device.bus();
    let robot = args.target.again();
    let undo = (new != old)
        .then(|| format!("gaitway servo set-id {bus} {new} {old} --permit-eeprom{robot}"));
    let text = format!("{} now has ID {new} (before: {old})\n", device.model.profile().model);
    if let Some(undo) = &undo {
        remarks.say(&format!("to undo: {undo}"));
    }
    let report = json!({ "id_before": old, "id": new, "bus": bus, "undo": undo });
    Ok(args.target.output.conclude(&report, &text, Deed::Work, 0))
}

/// Runs `servo set-baud`.
///
/// # Errors
/// A speed the servo does not know, no permit, torque on; or the servo is not found at the new
/// speed.
pub fn set_baud(args: &SetBaudArgs, remarks: Remarks) -> Result<i32, Error> {
    args.target.output.check_files(&[])?;
    if args.target.is_can()? {
        let remedy = "set it with the maker's tool on every actuator of the line, then: \
                      ip link set can0 down; ip link set can0 up type can bitrate ...";
        return actuator::refuse("giving an actuator another speed", &args.target.bus, remedy);
    }
    Signals::defer()?;
    let mut device = Device::open(&args.target.which()?)?;
    let item = needed(&device, Role::BaudRate)?;
    let known = &device.model.profile().baud;
    let Some(speed) = known.iter().find(|baud| baud.bps == args.baud_bps) else {
        let speeds: Vec<String> = known.iter().map(|baud| baud.bps.to_string()).collect();
        return Err(Error::of(ErrorKind::Unknown, "the servo does not know this line speed")
            .at(device.place())
            .got(format!("{} bit/s", args.baud_bps))
            .allowed(format!("{} bit/s", speeds.join(", "))));
    };
    let old_bps = device.line.baud_bps;
    if args.baud_bps != old_bps {
        let what = format!("{old_bps} bit/s would become {} bit/s", args.baud_bps);
        permitted(&device, args.permit_eeprom, &what)?;
        device.must_be_limp()?;
        change_baud(&mut device, &item, speed)?;
    }
    let plain = device.bus().split('?').next().unwrap_or_default().to_owned();
    let new_bps = args.baud_bps;
    // A virtual servo of this process is gone when the command ends.
    let undo = (new_bps != old_bps && device.line.world.is_none()).then(|| {
        let id = device.id;
        format!("gaitway servo set-baud {plain}?baud={new_bps} {id} {old_bps} --permit-eeprom")
    });
    let model = &device.model.profile().model;
    let text =
        format!("{model}, ID {}, now speaks at {new_bps} bit/s (before: {old_bps})\n", device.id);
    if let Some(undo) = &undo {
        remarks.say(&format!("to undo: {undo}"));
    }
    let report = json!({
        "id": device.id, "baud_bps_before": old_bps, "baud_bps": new_bps, "bus": plain, "undo": undo
    });
    Ok(args.target.output.conclude(&report, &text, Deed::Work, 0))
}
