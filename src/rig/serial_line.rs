//! One serial line, opened for questions to single devices: no robot file is needed.

use super::address::{Address, BusKind};
use super::connect::Connection;
use super::virtual_robot::{VirtualTerminal, world};
use super::wire::{UNKNOWN_LATENCY, echoes, wire};
use crate::bus::{Bus, Timing};
use crate::error::Error;
use crate::port::patient::PatientClock;
use crate::port::sim::{SharedWorld, VirtualClock, VirtualLine};
use crate::port::{BytePort, Clock, MonotonicClock};
use crate::robot::{Link, Robot};
use crate::time::{Duration, Instant};
use std::sync::Arc;

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
pub const USUAL_BAUD_BPS: u32 = 1_000_000;
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
