//! `scan`: every device that answers on a line. Reads only.

mod can;

use super::{Deed, Output, Remarks};
use crate::bus::Protocol;
use crate::bus::scan::{Found, scan};
use crate::cli::protocol::{ProtocolName, serial_protocol};
use crate::device::Model;
use crate::error::Error;
use crate::job::servo::register::firmware_words;
use crate::rig::{Address, BusKind};
use crate::rig::{Identity, all_servos, ask_error, identify, profile_of, protocol_name};
use crate::rig::{OpenLine, is_can, open_bus};
use crate::time::Duration;
use clap::Args;
use gaitway_profiles::Role;
use indicatif::ProgressBar;
use serde::Serialize;
use std::collections::BTreeSet;
use std::fmt::Write;

/// Arguments of `scan`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    gaitway scan serial:/dev/ttyUSB0 --baud all\n  \
    gaitway scan serial:/dev/ttyUSB0?baud=57600 --protocol dynamixel-2.0\n  \
    gaitway scan sim --robot op3\n  \
    gaitway scan can:can0\n  \
    gaitway scan can:can0 --protocol cubemars-mit --let-go\n  \
    gaitway scan sim --robot berkeley-humanoid-lite")]
pub struct ScanArgs {
    /// Where the line is: serial:PATH[?baud=N], tcp:HOST:PORT, can:INTERFACE, sim or sim:pty
    bus: Address,
    /// Ask in this protocol only [default: all]
    #[arg(long, value_enum)]
    protocol: Option<ProtocolName>,
    /// Line speed, bits per second, or `all`: every speed of every known servo. Of serial lines: the
    /// speed of a CAN interface is set with `ip link`
    #[arg(long, value_name = "BPS|all", value_parser = baud)]
    baud: Option<Baud>,
    /// Robot whose line this is: says the line speed, and which robot a virtual one is
    #[arg(long, value_name = "ROBOT")]
    robot: Option<String>,
    /// Tell CubeMars actuators in MIT mode to let go: they answer nothing else that moves nothing.
    /// What they hold falls
    #[arg(long)]
    let_go: bool,
    #[command(flatten)]
    output: Output,
}

/// Speeds to scan at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Baud {
    All,
    One(u32),
}

fn baud(text: &str) -> Result<Baud, String> {
    match text.parse() {
        Ok(bps) if bps > 0 => Ok(Baud::One(bps)),
        _ if text == "all" => Ok(Baud::All),
        _ => Err("a number of bits per second, or all".to_owned()),
    }
}

/// A device that answered.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
struct Device {
    id: u8,
    /// Model by its profile.
    model: Option<String>,
    /// Its profile.
    profile: Option<String>,
    model_number: Option<u16>,
    firmware: Option<u16>,
    protocol: &'static str,
    baud_bps: u32,
    /// It reports a hardware error.
    alert: bool,
}

/// An ID where more than one device seems to be.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
struct Collision {
    id: u8,
    protocol: &'static str,
    baud_bps: u32,
    reason: String,
}

/// What `scan` found.
#[derive(Clone, Debug, Default, Serialize)]
struct Report {
    bus: String,
    /// Speeds that were tried.
    scanned_baud_bps: Vec<u32>,
    /// Speeds the port does not know.
    unusable_baud_bps: Vec<u32>,
    devices: Vec<Device>,
    collisions: Vec<Collision>,
}

/// Two devices equal in everything that is read, at every time it is read, cannot be told apart.
const TWINS: &str = "two devices with one ID that always answer the same at the same time look \
                     like one: if a count surprises you, plug them in one by one";

/// More than any scan of one speed takes.
const LONGEST: Duration = Duration::from_secs(600);

const ALL: [Protocol; 4] =
    [Protocol::Dynamixel2, Protocol::Dynamixel1, Protocol::FeetechSts, Protocol::FeetechScs];

/// Runs `scan`; exit code 1 if nobody answers.
///
/// # Errors
/// A line that cannot be opened or fails.
pub fn run(args: &ScanArgs, remarks: Remarks) -> Result<i32, Error> {
    args.output.check_files(&[])?;
    if is_can(&args.bus, args.robot.as_deref())? {
        return can::run(args, remarks);
    }
    let wanted = serial_protocol(args.protocol, &args.bus)?;
    let mut line = open_bus(&args.bus, args.robot.as_deref(), 0)?;
    let protocols: Vec<Protocol> = wanted.map_or_else(|| ALL.to_vec(), |one| vec![one]);
    let speeds = match args.baud {
        None => vec![line.baud_bps],
        Some(Baud::One(bps)) => vec![bps],
        Some(Baud::All) => every_speed(&protocols, line.baud_bps),
    };
    let mut report = Report { bus: args.bus.to_string(), ..Report::default() };
    let bar = remarks.shows_progress().then(|| ProgressBar::new(speeds.len() as u64));
    for &bps in &speeds {
        if let Some(bar) = &bar {
            bar.set_message(format!("{bps} bit/s"));
        }
        if bps != line.baud_bps {
            match line.set_speed(bps) {
                Ok(()) => {}
                // Adapters differ in the speeds they know; the others are still scanned.
                Err(_) if speeds.len() > 1 && !matches!(args.bus.bus, BusKind::Tcp { .. }) => {
                    report.unusable_baud_bps.push(bps);
                    continue;
                }
                Err(error) => return Err(error),
            }
        }
        at_speed(&mut line, &protocols, &mut report)?;
        report.scanned_baud_bps.push(bps);
        if let Some(bar) = &bar {
            bar.inc(1);
        }
    }
    if let Some(bar) = bar {
        bar.finish_and_clear();
    }
    report.devices.sort_by_key(|d| (d.id, d.baud_bps));
    let code = i32::from(report.devices.is_empty() && report.collisions.is_empty());
    let code = args.output.conclude(&report, &report.text(), Deed::Look, code);
    if !report.devices.is_empty() {
        remarks.say(TWINS);
    }
    Ok(code)
}

/// Speeds of the known servos that speak one of `protocols`, the usual one first.
fn every_speed(protocols: &[Protocol], usual_bps: u32) -> Vec<u32> {
    let spoken = all_servos().filter(|servo| protocols.contains(&Model::new(servo).protocol()));
    let speeds: BTreeSet<u32> = spoken.flat_map(|servo| &servo.baud).map(|baud| baud.bps).collect();
    let others = speeds.into_iter().rev().filter(|&bps| bps != usual_bps);
    std::iter::once(usual_bps).chain(others).collect()
}

/// Scans at the line's speed.
fn at_speed(line: &mut OpenLine, protocols: &[Protocol], report: &mut Report) -> Result<(), Error> {
    let baud_bps = line.baud_bps;
    let failed = |e| ask_error(format!("{} at {baud_bps} bit/s", report.bus), &e);
    let budget = line.clock.now() + LONGEST;
    let scanned = scan(&mut line.bus, protocols, telling_apart, budget).map_err(failed)?;
    for found in &scanned.found {
        // Servos that share a packet are told apart by more than the scan has read.
        let identity = identify(line, found.id, Some(found.protocol)).and_then(|own| {
            own.map_or_else(|| identify(line, found.id, None), |own| Ok(Some(own)))
        });
        report.devices.push(device(found, identity.ok().flatten(), baud_bps));
    }
    report.collisions.extend(scanned.collisions.iter().map(|collision| Collision {
        id: collision.id,
        protocol: protocol_name(collision.protocol),
        baud_bps,
        reason: collision.reason.to_string(),
    }));
    Ok(())
}

/// Registers that differ between two servos of one model: where they stand, how long they run.
fn telling_apart(found: &Found) -> Vec<(u16, u16)> {
    let known = found.readings.iter().find_map(|r| profile_of(r.protocol, r.model_number));
    let roles = [Role::PresentPosition, Role::RealtimeTick, Role::PresentVoltage];
    let registers = known.into_iter().flat_map(|servo| roles.map(|role| servo.register(role)));
    registers.flatten().map(|register| (register.address, u16::from(register.bytes))).collect()
}

fn device(found: &Found, identity: Option<Identity>, baud_bps: u32) -> Device {
    let profile = identity.and_then(|identity| identity.profile);
    Device {
        id: found.id,
        model: profile.map(|profile| profile.model.clone()),
        profile: profile.map(|profile| profile.name.clone()),
        model_number: identity.map(|identity| identity.model_number),
        firmware: identity.map(|identity| identity.firmware),
        protocol: protocol_name(identity.map_or(found.protocol, |identity| identity.protocol)),
        baud_bps,
        alert: found.alert,
    }
}

impl Report {
    fn text(&self) -> String {
        let mut out = format!(
            "{:>3}  {:<16} {:>6}  {:<9} {:<14} {:>9}\n",
            "ID", "model", "number", "firmware", "protocol", "bit/s"
        );
        let unknown = || "?".to_owned();
        for device in &self.devices {
            let known = device.profile.as_deref().and_then(|p| gaitway_profiles::servo(p).ok());
            let firmware = device.firmware.map_or_else(unknown, |firmware| {
                known.map_or_else(|| firmware.to_string(), |s| firmware_words(s, firmware))
            });
            let _ = writeln!(
                out,
                "{:>3}  {:<16} {:>6}  {firmware:<9} {:<14} {:>9}{}",
                device.id,
                device.model.as_deref().unwrap_or("unknown"),
                device.model_number.map_or_else(unknown, |number| number.to_string()),
                device.protocol,
                device.baud_bps,
                if device.alert { "  reports an error" } else { "" }
            );
        }
        for collision in &self.collisions {
            let Collision { id, protocol, baud_bps, reason } = collision;
            let _ = writeln!(
                out,
                "{id:>3}  TWO DEVICES WITH THIS ID? ({protocol}, {baud_bps} bit/s): {reason}\n     \
                 unplug all but one and give it another: gaitway servo set-id BUS {id} NEW"
            );
        }
        let speeds = match self.scanned_baud_bps[..] {
            [one] => format!("{one} bit/s"),
            ref several => format!("{} line speeds", several.len()),
        };
        let _ = writeln!(out, "{} device(s) at {speeds} on {}", self.devices.len(), self.bus);
        if self.devices.is_empty() && self.collisions.is_empty() {
            out.push_str("nobody answers: check power and cable");
            let one = self.scanned_baud_bps.len() <= 1;
            out.push_str(if one { ", or look at every speed with --baud all\n" } else { "\n" });
        }
        if !self.unusable_baud_bps.is_empty() {
            let speeds: Vec<String> = self.unusable_baud_bps.iter().map(u32::to_string).collect();
            let _ = writeln!(out, "the port does not know {} bit/s", speeds.join(", "));
        }
        out
    }
}
