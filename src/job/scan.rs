//! Every device that answers on a line. Reads only.

pub mod can;

use super::observer::{Event, Observer};
use super::report::OwnProfile;
use crate::bus::Protocol;
use crate::bus::scan::{Found, scan_while};
use crate::device::Model;
use crate::error::Error;
use crate::rig::{Address, BusKind};
use crate::rig::{Identity, all_servos, ask_error, board_of, identify, profile_of, protocol_name};
use crate::rig::{OpenLine, open_bus};
use crate::time::Duration;
use gaitway_profiles::Role;
use serde::Serialize;
use std::collections::BTreeSet;

/// A device that answered.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Device {
    /// Its ID.
    pub id: u8,
    /// Model by its profile.
    pub model: Option<String>,
    /// Its profile.
    pub profile: Option<String>,
    /// What it calls its model.
    pub model_number: Option<u16>,
    /// Its firmware.
    pub firmware: Option<u16>,
    /// What it speaks.
    pub protocol: &'static str,
    /// At which line speed, bit/s; nothing behind TCP, if the address does not say it.
    pub baud_bps: Option<u32>,
    /// It reports a hardware error.
    pub alert: bool,
}

/// An ID where more than one device seems to be.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Collision {
    /// The ID.
    pub id: u8,
    /// What was spoken.
    pub protocol: &'static str,
    /// At which line speed, bit/s, as of a device.
    pub baud_bps: Option<u32>,
    /// Why it seems so.
    pub reason: String,
}

/// Who answers on a serial line.
#[derive(Clone, Debug, Default, Serialize)]
pub struct ScanReport {
    /// The line.
    pub bus: String,
    /// Speeds that were tried; none behind TCP, if the address says none.
    pub scanned_baud_bps: Vec<u32>,
    /// Speeds the port does not know.
    pub unusable_baud_bps: Vec<u32>,
    /// It was stopped before all was asked.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub stopped: bool,
    /// Who answered.
    pub devices: Vec<Device>,
    /// IDs of more than one.
    pub collisions: Vec<Collision>,
    /// The user's own profiles by which devices were named.
    pub profiles: Vec<OwnProfile>,
}

/// Line speeds to scan at.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Speeds {
    /// The one that the robot or the address says.
    #[default]
    Usual,
    /// This one, bit/s.
    One(u32),
    /// Every speed of every known servo.
    All,
}

/// Which line is scanned, and how.
#[derive(Clone, Copy, Debug)]
pub struct ScanOrder<'a> {
    /// The line.
    pub bus: &'a Address,
    /// Whose it is.
    pub robot: Option<&'a str>,
    /// In this protocol only.
    pub protocol: Option<Protocol>,
    /// At which speeds.
    pub speeds: Speeds,
    /// So long at least is waited for an answer.
    pub wait: Option<Duration>,
}

/// More than any scan of one speed takes.
const LONGEST: Duration = Duration::from_secs(600);

const ALL: [Protocol; 4] =
    [Protocol::Dynamixel2, Protocol::Dynamixel1, Protocol::FeetechSts, Protocol::FeetechScs];

/// Scans a serial line, in one protocol or in all, until the observer wants to stop.
///
/// # Errors
/// A line that cannot be opened or fails.
pub fn scan_line(order: &ScanOrder<'_>, observer: &dyn Observer) -> Result<ScanReport, Error> {
    let ScanOrder { bus, robot, protocol, speeds, wait } = *order;
    let mut line = open_bus(bus, robot, 0)?;
    let protocols: Vec<Protocol> = protocol.map_or_else(|| ALL.to_vec(), |one| vec![one]);
    let speeds = match speeds {
        Speeds::Usual => vec![line.baud_bps],
        Speeds::One(bps) => vec![bps],
        Speeds::All => every_speed(&protocols, line.baud_bps),
    };
    let mut report = ScanReport { bus: bus.to_string(), ..ScanReport::default() };
    let total = speeds.len() as u64;
    for (done, &bps) in (0..).zip(&speeds) {
        observer.hear(Event::Step { done, total, what: &format!("{bps} bit/s") });
        if bps != line.baud_bps {
            match line.set_speed(bps) {
                Ok(()) => {}
                // Adapters differ in the speeds they know; the others are still scanned.
                Err(_) if speeds.len() > 1 && !matches!(bus.bus, BusKind::Tcp { .. }) => {
                    report.unusable_baud_bps.push(bps);
                    continue;
                }
                Err(error) => return Err(error),
            }
        }
        let wait = line.bus.timing().return_delay.max(wait.unwrap_or_default());
        line.bus.set_return_delay(wait);
        let is_known = speeds.len() > 1 || !matches!(bus.bus, BusKind::Tcp { baud_bps: None, .. });
        let baud_bps = is_known.then_some(bps);
        at_speed(&mut line, &protocols, baud_bps, &mut report, observer)?;
        report.scanned_baud_bps.extend(baud_bps);
        if report.stopped {
            break;
        }
    }
    observer.hear(Event::Step { done: total, total, what: "" });
    report.devices.sort_by_key(|d| (d.id, d.baud_bps));
    report.profiles = OwnProfile::named(report.devices.iter().filter_map(|d| d.profile.as_deref()));
    Ok(report)
}

/// Speeds of the known servos that speak one of `protocols`, the usual one first.
fn every_speed(protocols: &[Protocol], usual_bps: u32) -> Vec<u32> {
    let spoken = all_servos().filter(|servo| protocols.contains(&Model::new(servo).protocol()));
    let speeds: BTreeSet<u32> = spoken.flat_map(|servo| &servo.baud).map(|baud| baud.bps).collect();
    let others = speeds.into_iter().rev().filter(|&bps| bps != usual_bps);
    std::iter::once(usual_bps).chain(others).collect()
}

/// Scans at the line's speed.
fn at_speed(
    line: &mut OpenLine,
    protocols: &[Protocol],
    baud_bps: Option<u32>,
    report: &mut ScanReport,
    observer: &dyn Observer,
) -> Result<(), Error> {
    let failed = |e| ask_error(format!("{} at {} bit/s", report.bus, line.baud_bps), &e);
    let budget = line.clock.now() + LONGEST;
    let goes_on = || !observer.wants_to_stop();
    let scanned =
        scan_while(&mut line.bus, protocols, telling_apart, budget, &goes_on).map_err(failed)?;
    report.stopped = !scanned.complete && !goes_on();
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

fn device(found: &Found, identity: Option<Identity>, baud_bps: Option<u32>) -> Device {
    let profile = identity.and_then(|identity| identity.profile);
    let board = || {
        let identity = identity.filter(|_| profile.is_none())?;
        board_of(identity.protocol, identity.model_number).map(|board| board.model)
    };
    Device {
        id: found.id,
        model: profile.map(|profile| profile.model.clone()).or_else(board),
        profile: profile.map(|profile| profile.name.clone()),
        model_number: identity.map(|identity| identity.model_number),
        firmware: identity.map(|identity| identity.firmware),
        protocol: protocol_name(identity.map_or(found.protocol, |identity| identity.protocol)),
        baud_bps,
        alert: found.alert,
    }
}
