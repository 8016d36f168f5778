//! From `--bus` values to a robot whose lines are open.

use super::address::{Address, BusKind};
use super::slcan::{frames_at, speed_at};
use super::virtual_robot::{VirtualTerminal, live_line, virtual_port, world};
use super::wire::{UNKNOWN_LATENCY, echoes, wire, wrong_kind};
use crate::error::{Error, ErrorKind};
use crate::port::patient::PatientClock;
use crate::port::sim::{SharedWorld, VirtualClock};
use crate::port::{Clock, FramePort, MonotonicClock};
use crate::robot::{Line, LinePort, Link, Robot};
use crate::time::Duration;
use gaitway_profiles::LineKind;
use gaitway_sim::Door;
use std::sync::Arc;

/// A link and what must stay alive beside it.
pub struct Connection {
    /// The robot with its lines open.
    pub link: Link,
    /// The virtual robot of this process, if it is one.
    pub world: Option<SharedWorld>,
    /// True if time passes by itself.
    pub real_time: bool,
    /// Its clock, if that waits for this machine.
    pub patience: Option<PatientClock>,
    pub(super) _doors: Vec<Door>,
}

/// That the time of a virtual robot waits for this machine, and how long it has.
#[must_use]
pub fn patience_words(patience: Option<&PatientClock>) -> Option<String> {
    let waited_s = patience?.waited().as_secs_f64();
    Some(format!(
        "the time of the virtual robot waits for this machine, so far {waited_s:.3} s; a real robot \
         does not wait"
    ))
}

/// Opens every line of `robot`.
///
/// # Errors
/// An address that names no line, a line without address, a port that cannot be opened.
pub fn connect(robot: Robot, addresses: &[Address], seed: u64) -> Result<Connection, Error> {
    let by_line = assign(&robot, addresses)?;
    let sims = by_line.iter().filter(|bus| bus.is_virtual()).count();
    if sims > 0 && by_line.iter().any(|bus| *bus != by_line[0]) {
        return Err(Error::new("a virtual robot has all its lines in one place")
            .at("--bus")
            .allowed("the same kind of virtual bus for every line, or real lines only"));
    }
    match &by_line[0] {
        BusKind::Sim => in_virtual_time(robot, seed),
        BusKind::SimPty => behind_terminals(robot, seed),
        BusKind::Serial { .. }
        | BusKind::Tcp { .. }
        | BusKind::Can { .. }
        | BusKind::Slcan { .. } => over_wires(robot, &by_line),
    }
}

fn assign(robot: &Robot, addresses: &[Address]) -> Result<Vec<BusKind>, Error> {
    let names: Vec<&str> = robot.lines.iter().map(|line| line.name.as_str()).collect();
    let usual = |name: &str| match robot.lines.iter().find(|line| line.name == name) {
        Some(Line { kind: LineKind::Can(_), .. }) => "can:can0",
        _ => "serial:/dev/...",
    };
    for address in addresses {
        let known = address.line.as_deref().is_none_or(|name| names.contains(&name));
        if !known {
            return Err(Error::of(ErrorKind::Unknown, "the robot has no such line")
                .at("--bus")
                .none_of(address.line.as_deref().unwrap_or_default(), names, "take one of these"));
        }
    }
    for (index, address) in addresses.iter().enumerate() {
        let twin = addresses[..index].iter().any(|other| other.line == address.line);
        if twin || (address.line.is_none() && addresses.len() > 1) {
            return Err(Error::new("more buses than the robot has lines for")
                .at("--bus")
                .got(address.to_string())
                .allowed(format!("one for each line: {}", names.join(", "))));
        }
    }
    names
        .iter()
        .map(|&name| {
            let own = addresses.iter().find(|a| a.line.as_deref() == Some(name));
            // Without a name: the robot's only line, or a virtual robot as a whole.
            let any = addresses
                .iter()
                .find(|a| a.line.is_none() && (names.len() == 1 || a.bus.is_virtual()));
            own.or(any).map(|address| address.bus.clone()).ok_or_else(|| {
                Error::new("a line of the robot has no bus")
                    .at(format!("robot {}, line {name}", robot.name))
                    .remedy(format!("add --bus {name}={}", usual(name)))
            })
        })
        .collect()
}

/// A virtual robot of virtual time that is `mounted` otherwise than who opens it believes.
///
/// # Errors
/// As [`connect`].
#[cfg(test)]
pub fn mounted_otherwise(robot: Robot, mounted: &Robot) -> Result<Connection, Error> {
    on_world(robot, world(mounted, 0)?)
}

fn in_virtual_time(robot: Robot, seed: u64) -> Result<Connection, Error> {
    let world = world(&robot, seed)?;
    on_world(robot, world)
}

fn on_world(robot: Robot, world: SharedWorld) -> Result<Connection, Error> {
    let clock: Arc<dyn Clock> = Arc::new(VirtualClock(world.clone()));
    let ports = robot
        .lines
        .iter()
        .enumerate()
        .map(|(line, facts)| (virtual_port(&world, line, facts.kind), Duration::ZERO))
        .collect();
    let link = Link::new(robot, ports, clock);
    Ok(Connection {
        link,
        world: Some(world),
        real_time: false,
        patience: None,
        _doors: Vec::new(),
    })
}

fn behind_terminals(robot: Robot, seed: u64) -> Result<Connection, Error> {
    let world = world(&robot, seed)?;
    let clock = PatientClock::start();
    let mut doors = Vec::new();
    let mut ports: Vec<(LinePort, Duration)> = Vec::new();
    for (line, facts) in robot.lines.iter().enumerate() {
        if let LineKind::Can(_) = facts.kind {
            // Frames have no terminal; they keep time all the same.
            let port: Box<dyn FramePort> = Box::new(live_line(&world, line, &clock)?);
            ports.push((port.into(), UNKNOWN_LATENCY));
            continue;
        }
        let terminal = VirtualTerminal::open(&world, line, &clock)?;
        ports.push((terminal.port(facts.bits_per_s())?.into(), UNKNOWN_LATENCY));
        doors.push(terminal.door);
    }
    let link = Link::new(robot, ports, Arc::new(clock.clone()));
    let patience = Some(clock);
    Ok(Connection { link, world: Some(world), real_time: true, patience, _doors: doors })
}

fn over_wires(mut robot: Robot, by_line: &[BusKind]) -> Result<Connection, Error> {
    let mut ports: Vec<(LinePort, Duration)> = Vec::new();
    for (line, bus) in robot.lines.iter_mut().zip(by_line) {
        ports.push(match (&mut line.kind, bus) {
            (LineKind::Can(speed), bus) if bus.is_can() => {
                *speed = speed_at(bus, *speed);
                let (port, latency) = frames_at(bus, *speed)?;
                (port.into(), latency)
            }
            (LineKind::Serial { baud_bps }, bus) if !bus.is_can() => {
                *baud_bps = bus.baud_bps().unwrap_or(*baud_bps);
                let (port, latency) = wire(bus, *baud_bps)?;
                (port.into(), latency)
            }
            (kind, bus) => return Err(wrong_kind(&line.name, *kind, bus)),
        });
    }
    let mut link = Link::new(robot, ports, Arc::new(MonotonicClock));
    for (line, bus) in by_line.iter().enumerate() {
        link.set_echo(line, echoes(bus)?);
    }
    Ok(Connection { link, world: None, real_time: true, patience: None, _doors: Vec::new() })
}
