//! From `--bus` values to a robot whose lines are open.

use super::address::{Address, BusKind};
use crate::bus::{Bus, Timing};
use crate::error::Error;
use crate::port::can::{self, CanInterface, Controller};
use crate::port::inventory::Machine;
use crate::port::patient::{PatientClock, PatientLine};
use crate::port::serial::SerialLine;
use crate::port::sim::{LiveCanLine, SharedWorld, VirtualCanLine, VirtualClock, VirtualLine};
use crate::port::tcp::TcpLine;
use crate::port::{BytePort, Clock, FramePort, MonotonicClock, PortError};
use crate::robot::{Line, LinePort, Link, Robot};
use crate::time::{Duration, Instant};
use gaitway_profiles::{CanSpeed, LineKind};
use gaitway_sim::{Door, Options, World};
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

/// Held back by a USB adapter that says nothing of itself, or by a pseudo-terminal's scheduling.
pub(super) const UNKNOWN_LATENCY: Duration = Duration::from_millis(5);
/// Held back by a USB-CAN adapter: two frames of USB.
pub(super) const CAN_LATENCY: Duration = Duration::from_millis(2);
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
        BusKind::Serial { .. } | BusKind::Tcp { .. } | BusKind::Can { .. } => {
            over_wires(robot, &by_line)
        }
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
                    .remedy(format!("add --bus {name}={}", usual(name)))
            })
        })
        .collect()
}

pub(super) fn world(robot: &Robot, seed: u64) -> Result<SharedWorld, Error> {
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

/// The host's end of a virtual line.
fn virtual_port(world: &SharedWorld, line: usize, kind: LineKind) -> LinePort {
    match kind {
        LineKind::Serial { baud_bps } => {
            let port: Box<dyn BytePort> = Box::new(VirtualLine::new(world.clone(), line, baud_bps));
            port.into()
        }
        LineKind::Can(_) => {
            let port: Box<dyn FramePort> = Box::new(VirtualCanLine::new(world.clone(), line));
            port.into()
        }
    }
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

/// A line of a virtual robot of this process behind a pseudo-terminal.
struct VirtualTerminal {
    door: Door,
    line: usize,
    clock: PatientClock,
}

impl VirtualTerminal {
    fn open(world: &SharedWorld, line: usize, clock: &PatientClock) -> Result<Self, Error> {
        let door = Door::open_patient(world.inner(), line, clock.time())
            .map_err(|e| Error::new("cannot open a pseudo-terminal").got(e.to_string()))?;
        Ok(Self { door, line, clock: clock.clone() })
    }

    fn port(&self, baud_bps: u32) -> Result<Box<dyn BytePort>, Error> {
        let path = self.door.path().display().to_string();
        let port = PatientLine::open(&path, baud_bps, self.line, self.clock.clone());
        Ok(Box::new(port.map_err(|e| port_error(&path, &e))?))
    }
}

pub(super) fn live_line(
    world: &SharedWorld,
    line: usize,
    clock: &PatientClock,
) -> Result<LiveCanLine, Error> {
    LiveCanLine::new(world, line, clock)
        .map_err(|e| Error::new("the virtual line cannot be opened").got(spoken(&e)))
}

fn over_wires(mut robot: Robot, by_line: &[BusKind]) -> Result<Connection, Error> {
    let mut ports: Vec<(LinePort, Duration)> = Vec::new();
    for (line, bus) in robot.lines.iter_mut().zip(by_line) {
        ports.push(match (&mut line.kind, bus) {
            (LineKind::Can(speed), BusKind::Can { interface }) => {
                (interface_at(interface, *speed)?.into(), CAN_LATENCY)
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

pub(super) fn wrong_kind(line: &str, kind: LineKind, bus: &BusKind) -> Error {
    let allowed = match kind {
        LineKind::Can(_) => "a CAN interface, e.g. can:can0",
        LineKind::Serial { .. } => "a serial line, e.g. serial:/dev/ttyUSB0 or tcp:host:port",
    };
    Error::new("the line is of another kind than the bus")
        .at(format!("--bus for line {line}"))
        .got(bus.to_string())
        .allowed(allowed)
}

/// A CAN interface that is up and runs at the line's speeds, as far as the kernel tells.
pub(super) fn interface_at(interface: &str, speed: CanSpeed) -> Result<Box<dyn FramePort>, Error> {
    let place = || format!("can:{interface}");
    let setup = match speed.data_bitrate_bps {
        Some(fast) => {
            format!("type can bitrate {} dbitrate {fast} fd on", speed.bitrate_bps)
        }
        None => format!("type can bitrate {}", speed.bitrate_bps),
    };
    let remedy =
        || format!("ip link set {interface} down; ip link set {interface} up {setup} (as root)");
    let found = can::state(interface).map_err(|e| {
        Error::new("there is no such CAN interface")
            .at(place())
            .got(spoken(&e))
            .remedy("plug the adapter in; `ip link` and `gaitway ports` list what is there")
    })?;
    let refuse = |what: &str, got: String, allowed: String| {
        Err(Error::new(what).at(place()).got(got).allowed(allowed).remedy(remedy()))
    };
    if !found.up {
        return refuse("the CAN interface is down", "down".into(), "up".into());
    }
    if found.controller == Some(Controller::BusOff) {
        return refuse("the CAN controller has left the line", "bus off".into(), "active".into());
    }
    // A virtual interface has no speed.
    if let Some(bps) = found.bitrate_bps.filter(|&bps| bps != speed.bitrate_bps) {
        let allowed = format!("{} bit/s", speed.bitrate_bps);
        return refuse("the CAN interface runs at another speed", format!("{bps} bit/s"), allowed);
    }
    if let Some(fast) = speed.data_bitrate_bps {
        if !found.fd {
            return refuse("the CAN interface carries no CAN FD", "classic".into(), "fd on".into());
        }
        if let Some(bps) = found.data_bitrate_bps.filter(|&bps| bps != fast) {
            let got = format!("dbitrate {bps}");
            return refuse("the CAN interface has another data speed", got, fast.to_string());
        }
    }
    let mut port = CanInterface::open(interface).map_err(|e| {
        Error::new("the CAN interface cannot be opened").at(place()).got(spoken(&e))
    })?;
    port.claim().map_err(|e| match e {
        PortError::Busy(_) => Error::new("the CAN interface is in use by another gaitway")
            .at(place())
            .remedy("end the other command first: two hosts would fight over the actuators"),
        e => Error::new("the CAN interface cannot be claimed").at(place()).got(spoken(&e)),
    })?;
    Ok(Box::new(port))
}

/// True if the adapter behind a serial port is known to let the host hear its own bytes.
fn echoes(bus: &BusKind) -> Result<bool, Error> {
    let BusKind::Serial { path, .. } = bus else { return Ok(false) };
    let node = std::fs::canonicalize(path).unwrap_or_else(|_| path.into());
    let ports = Machine::default().serial_ports();
    let port = ports.iter().find(|port| node == std::path::Path::new(&port.path));
    let Some((vendor, product)) = port.and_then(|port| port.usb.as_ref()?.ids()) else {
        return Ok(false);
    };
    Ok(gaitway_profiles::adapter_for_usb(vendor, product)?.is_some_and(|adapter| adapter.echo))
}

/// A real line at `baud_bps`, and the time its adapter may hold bytes back.
fn wire(bus: &BusKind, baud_bps: u32) -> Result<(Box<dyn BytePort>, Duration), Error> {
    match bus {
        BusKind::Tcp { place, .. } => {
            let port = TcpLine::open(place).map_err(|e| {
                Error::new("nobody takes the connection")
                    .at(format!("tcp:{place}"))
                    .got(spoken(&e))
                    .remedy("check host and port; the other end must run already, e.g. gaitway simulate")
            })?;
            Ok((Box::new(port), NETWORK_LATENCY))
        }
        BusKind::Serial { path, .. } => {
            let port = SerialLine::open(path, baud_bps).map_err(|e| port_error(path, &e))?;
            let latency = SerialLine::latency_timer_s(path).filter(|s| (0.0..1.0).contains(s));
            Ok((Box::new(port), latency.map_or(UNKNOWN_LATENCY, Duration::from_secs_f64)))
        }
        BusKind::Can { interface } => Err(Error::new("a CAN interface is no serial line")
            .at(format!("can:{interface}"))
            .allowed("serial:/dev/ttyUSB0 or tcp:host:port")),
        BusKind::Sim | BusKind::SimPty => Err(Error::new("a virtual robot is no wire")),
    }
}

/// A serial line that is only listened to, at `baud_bps` unless the address says another speed.
///
/// # Errors
/// A virtual robot, which is no stream; a port that cannot be opened.
pub fn open_stream(address: &Address, baud_bps: u32) -> Result<Box<dyn BytePort>, Error> {
    if address.bus.is_virtual() {
        return Err(Error::new("a virtual robot sends no stream")
            .at(address.to_string())
            .allowed("serial:/dev/ttyUSB0 or tcp:host:port"));
    }
    Ok(wire(&address.bus, address.bus.baud_bps().unwrap_or(baud_bps))?.0)
}

/// One line, opened for questions to single devices: no robot file is needed.
pub struct OpenLine {
    /// The line.
    pub bus: Bus,
    /// Its clock.
    pub clock: Arc<dyn Clock>,
    /// Its speed, bits per second.
    pub baud_bps: u32,
    /// The virtual robot of this process, if it is one.
    pub world: Option<SharedWorld>,
    place: Place,
}

/// Where a line can be opened again.
enum Place {
    Virtual { world: SharedWorld, line: usize },
    Terminal(VirtualTerminal),
    Wire(BusKind),
}

/// Line speed if neither the address nor a robot says one, bits per second.
const USUAL_BAUD_BPS: u32 = 1_000_000;
/// Where nothing moves, a lost answer costs nothing but time.
pub(super) const RETRIES: u32 = 5;
/// Time for a question and its retries: more than a host stalls.
pub(super) const PATIENCE: Duration = Duration::from_millis(500);
/// The longest return delay a servo's register holds: 254 of 2 us.
const LONGEST_RETURN_DELAY: Duration = Duration::from_micros(508);

/// Opens the line at `address` for questions to single devices. `robot` names the robot whose line
/// it is: required for a virtual one, else it only says the line's speed.
///
/// # Errors
/// No robot for a virtual line, several lines and none named, a port that cannot be opened.
pub fn open_bus(address: &Address, robot: Option<&str>, seed: u64) -> Result<OpenLine, Error> {
    let robot = robot.map(Robot::load).transpose()?;
    let line = robot.as_ref().map(|robot| line_of(robot, address)).transpose()?;
    let of_robot = robot.as_ref().zip(line).map(|(robot, line)| robot.lines[line].bits_per_s());
    let baud_bps = address.bus.baud_bps().or(of_robot).unwrap_or(USUAL_BAUD_BPS);
    let place = match (&address.bus, robot.as_ref().zip(line)) {
        (BusKind::Sim, Some((robot, line))) => Place::Virtual { world: world(robot, seed)?, line },
        (BusKind::SimPty, Some((robot, line))) => {
            let world = world(robot, seed)?;
            Place::Terminal(VirtualTerminal::open(&world, line, &PatientClock::start())?)
        }
        (BusKind::Sim | BusKind::SimPty, None) => {
            return Err(Error::new("which robot is the virtual one?")
                .at(address.to_string())
                .remedy("add --robot NAME, e.g. --robot op3"));
        }
        (wire, _) => Place::Wire(wire.clone()),
    };
    open_at(place, baud_bps)
}

pub(super) fn line_of(robot: &Robot, address: &Address) -> Result<usize, Error> {
    let names: Vec<&str> = robot.lines.iter().map(|line| line.name.as_str()).collect();
    match &address.line {
        None if names.len() == 1 => Ok(0),
        Some(name) if names.contains(&name.as_str()) => {
            Ok(names.iter().position(|known| known == name).unwrap_or(0))
        }
        named => Err(Error::new("which line of the robot?")
            .at(address.to_string())
            .got(named.clone().unwrap_or_else(|| "no line".to_owned()))
            .allowed(names.iter().map(|n| format!("{n}=BUS")).collect::<Vec<_>>().join(", "))),
    }
}

fn open_at(place: Place, baud_bps: u32) -> Result<OpenLine, Error> {
    let clock: Arc<dyn Clock> = match &place {
        Place::Virtual { world, .. } => Arc::new(VirtualClock(world.clone())),
        Place::Terminal(terminal) => Arc::new(terminal.clock.clone()),
        Place::Wire(_) => Arc::new(MonotonicClock),
    };
    let (port, latency) = port_at(&place, baud_bps)?;
    let world = match &place {
        Place::Virtual { world, .. } => Some(world.clone()),
        Place::Terminal(_) | Place::Wire(_) => None,
    };
    let timing = Timing { baud_bps, return_delay: LONGEST_RETURN_DELAY, latency };
    let mut bus = Bus::new(port, Arc::clone(&clock), timing);
    bus.set_retries(RETRIES);
    if let Place::Wire(kind) = &place {
        bus.set_echo(echoes(kind)?);
    }
    Ok(OpenLine { bus, clock, baud_bps, world, place })
}

fn port_at(place: &Place, baud_bps: u32) -> Result<(Box<dyn BytePort>, Duration), Error> {
    match place {
        Place::Virtual { world, line } => {
            Ok((Box::new(VirtualLine::new(world.clone(), *line, baud_bps)), Duration::ZERO))
        }
        Place::Terminal(terminal) => Ok((terminal.port(baud_bps)?, UNKNOWN_LATENCY)),
        Place::Wire(kind) => wire(kind, baud_bps),
    }
}

impl OpenLine {
    /// Speaks at another speed from now on.
    ///
    /// # Errors
    /// A line behind TCP, whose speed the other end decides. A port that does not know the speed or
    /// cannot be opened again: the line is closed then, until it is given another speed.
    pub fn set_speed(&mut self, baud_bps: u32) -> Result<(), Error> {
        if let Place::Wire(BusKind::Tcp { place, .. }) = &self.place {
            return Err(Error::new("the other end of a TCP connection decides the line speed")
                .at(format!("tcp:{place}"))
                .remedy("do this at the machine that has the serial port"));
        }
        let Self { bus, place, .. } = self;
        bus.reopen(baud_bps, || port_at(place, baud_bps).map(|(port, _)| port))?;
        self.baud_bps = baud_bps;
        Ok(())
    }

    /// The same line as the only one of `robot`, to be moved.
    ///
    /// # Errors
    /// A port that cannot be opened again.
    pub fn into_link(self, robot: Robot) -> Result<Connection, Error> {
        let Self { bus, clock, baud_bps, world, place } = self;
        drop(bus);
        let port = port_at(&place, baud_bps)?;
        let (real_time, terminal) = match place {
            Place::Virtual { .. } => (false, None),
            Place::Terminal(terminal) => (true, Some(terminal)),
            Place::Wire(_) => (true, None),
        };
        let link = Link::new(robot, vec![port], clock);
        let patience = terminal.as_ref().map(|terminal| terminal.clock.clone());
        let doors = terminal.into_iter().map(|terminal| terminal.door).collect();
        Ok(Connection { link, world, real_time, patience, _doors: doors })
    }

    /// By when a question asked now must be answered, retries included.
    #[must_use]
    pub fn budget(&self) -> Instant {
        self.clock.now() + PATIENCE
    }
}

fn port_error(path: &str, error: &PortError) -> Error {
    let place = format!("port {path}");
    match error {
        PortError::Gone(text) => Error::new("there is no such port")
            .at(place)
            .got(text.clone())
            .remedy("plug the adapter in; `gaitway ports` lists what is there"),
        PortError::Denied(_) => Error::new("no permission to open the port")
            .at(place)
            .remedy("install the udev rules: `gaitway doctor` says how, and what else is missing"),
        PortError::Busy(text) => Error::new("the port is in use by another program")
            .at(place)
            .got(text.clone())
            .remedy("end the other program; `fuser -v PORT` names it"),
        other => Error::new("the port cannot be opened as a serial line")
            .at(place)
            .got(spoken(other))
            .allowed("a serial port, e.g. /dev/ttyUSB0, or the terminal of gaitway simulate")
            .remedy("`gaitway ports` lists what is there"),
    }
}

/// What the operating system said, without a word before it.
fn spoken(error: &PortError) -> String {
    match error {
        PortError::Gone(text)
        | PortError::Denied(text)
        | PortError::Busy(text)
        | PortError::Io(text) => text.clone(),
        PortError::TimedOut => error.to_string(),
    }
}
