//! From `--bus` values to a robot whose lines are open.

use super::address::{Address, BusKind};
use crate::error::Error;
use crate::port::serial::SerialLine;
use crate::port::sim::{SharedWorld, VirtualClock, VirtualLine};
use crate::port::tcp::TcpLine;
use crate::port::{BytePort, Clock, MonotonicClock, PortError};
use crate::robot::{Link, Robot};
use crate::time::Duration;
use gaitway_sim::{Door, Options, World};
use std::sync::Arc;

/// A link and what must stay alive beside it.
pub struct Connection {
    /// The robot with its lines open.
    pub link: Link,
    /// The virtual robot of this process, if it is one.
    pub world: Option<SharedWorld>,
    /// True if the clock is the system's.
    pub real_time: bool,
    _doors: Vec<Door>,
}

/// Held back by a USB adapter that says nothing of itself, or by a pseudo-terminal's scheduling.
const UNKNOWN_LATENCY: Duration = Duration::from_millis(5);
/// There and back on a local network that is not idle.
const NETWORK_LATENCY: Duration = Duration::from_millis(20);

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
        BusKind::Serial { .. } | BusKind::Tcp { .. } => over_wires(robot, &by_line),
    }
}

fn assign(robot: &Robot, addresses: &[Address]) -> Result<Vec<BusKind>, Error> {
    let names: Vec<&str> = robot.lines.iter().map(|line| line.name.as_str()).collect();
    for address in addresses {
        let known = address.line.as_deref().is_none_or(|name| names.contains(&name));
        if !known {
            return Err(Error::new("the robot has no such line")
                .at("--bus")
                .got(address.line.clone().unwrap_or_default())
                .allowed(names.join(", ")));
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
                    .remedy(format!("add --bus {name}=serial:/dev/..."))
            })
        })
        .collect()
}

fn world(robot: &Robot, seed: u64) -> Result<SharedWorld, Error> {
    let options = Options { seed, ..Options::default() };
    let world = World::new(&robot.file, options)
        .map_err(|e| Error::new(e.to_string()).at(format!("virtual robot {}", robot.name)))?;
    Ok(SharedWorld::new(world))
}

fn in_virtual_time(robot: Robot, seed: u64) -> Result<Connection, Error> {
    let world = world(&robot, seed)?;
    let clock: Arc<dyn Clock> = Arc::new(VirtualClock(world.clone()));
    let ports = robot
        .lines
        .iter()
        .enumerate()
        .map(|(line, facts)| {
            let port = VirtualLine::new(world.clone(), line, facts.baud_bps);
            (Box::new(port) as Box<dyn BytePort>, Duration::ZERO)
        })
        .collect();
    let link = Link::new(robot, ports, clock);
    Ok(Connection { link, world: Some(world), real_time: false, _doors: Vec::new() })
}

fn behind_terminals(robot: Robot, seed: u64) -> Result<Connection, Error> {
    let world = world(&robot, seed)?;
    let mut doors = Vec::new();
    let mut ports: Vec<(Box<dyn BytePort>, Duration)> = Vec::new();
    for (line, facts) in robot.lines.iter().enumerate() {
        let door = Door::open(world.inner(), line, None)
            .map_err(|e| Error::new("cannot open a pseudo-terminal").got(e.to_string()))?;
        let path = door.path().display().to_string();
        let port = SerialLine::open(&path, facts.baud_bps).map_err(|e| port_error(&path, &e))?;
        ports.push((Box::new(port), UNKNOWN_LATENCY));
        doors.push(door);
    }
    let link = Link::new(robot, ports, Arc::new(MonotonicClock));
    Ok(Connection { link, world: Some(world), real_time: true, _doors: doors })
}

fn over_wires(mut robot: Robot, by_line: &[BusKind]) -> Result<Connection, Error> {
    let mut ports: Vec<(Box<dyn BytePort>, Duration)> = Vec::new();
    for (line, bus) in robot.lines.iter_mut().zip(by_line) {
        line.baud_bps = bus.baud_bps().unwrap_or(line.baud_bps);
        ports.push(wire(bus, line.baud_bps)?);
    }
    let link = Link::new(robot, ports, Arc::new(MonotonicClock));
    Ok(Connection { link, world: None, real_time: true, _doors: Vec::new() })
}

/// A real line at `baud_bps`, and the time its adapter may hold bytes back.
fn wire(bus: &BusKind, baud_bps: u32) -> Result<(Box<dyn BytePort>, Duration), Error> {
    match bus {
        BusKind::Tcp { place, .. } => {
            let port = TcpLine::open(place).map_err(|e| {
                Error::new("nobody takes the connection")
                    .at(format!("tcp:{place}"))
                    .got(e.to_string())
                    .remedy("start the program at the other end first, e.g. gaitway simulate")
            })?;
            Ok((Box::new(port), NETWORK_LATENCY))
        }
        BusKind::Serial { path, .. } => {
            let port = SerialLine::open(path, baud_bps).map_err(|e| port_error(path, &e))?;
            let latency = SerialLine::latency_timer_s(path).filter(|s| (0.0..1.0).contains(s));
            Ok((Box::new(port), latency.map_or(UNKNOWN_LATENCY, Duration::from_secs_f64)))
        }
        BusKind::Sim | BusKind::SimPty => Err(Error::new("a virtual robot is no wire")),
    }
}

fn port_error(path: &str, error: &PortError) -> Error {
    let place = format!("port {path}");
    match error {
        PortError::Gone(text) => Error::new("there is no such port")
            .at(place)
            .got(text.clone())
            .remedy("plug the adapter in; see /dev/serial/by-id for ports that are there"),
        PortError::Denied(_) => Error::new("no permission to open the port")
            .at(place)
            .remedy("install the rules in udev/, or add yourself to the group dialout"),
        PortError::Busy(text) => Error::new("the port is in use by another program")
            .at(place)
            .got(text.clone())
            .remedy("end the other program; `fuser -v PORT` names it"),
        other => Error::new("the port cannot be opened as a serial line")
            .at(place)
            .got(other.to_string()),
    }
}
