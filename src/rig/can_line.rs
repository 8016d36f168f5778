//! One CAN line, opened for questions to single devices: no robot file is needed.

use super::address::{Address, BusKind};
use super::connect::Connection;
use super::serial_line::{PATIENCE, RETRIES, line_of};
use super::slcan::{frames_at, not_can, speed_at};
use super::virtual_robot::{live_line, world};
use super::wire::{UNKNOWN_LATENCY, wrong_kind};
use crate::bus::can::{CanBus, CanTiming};
use crate::error::Error;
use crate::port::can;
use crate::port::patient::PatientClock;
use crate::port::sim::{SharedWorld, VirtualCanLine, VirtualClock};
use crate::port::{Clock, FramePort, MonotonicClock};
use crate::robot::{Link, Robot};
use crate::time::{Duration, Instant};
use gaitway_profiles::{CanSpeed, LineKind};
use std::sync::Arc;

/// Bit rate where neither the interface nor a robot says one, bit/s.
const USUAL_BITRATE_BPS: u32 = 1_000_000;
/// Bit rate of fast payloads likewise, bit/s.
const USUAL_DATA_BITRATE_BPS: u32 = 5_000_000;
/// The host's own id, for the dialect that has one, as the maker's tools have it.
const USUAL_HOST: u8 = 0xFD;

/// An open CAN line.
pub struct OpenCanLine {
    /// The line.
    pub bus: CanBus,
    /// Its clock.
    pub clock: Arc<dyn Clock>,
    /// Its speeds; of a virtual interface, which has none, the usual ones.
    pub speed: CanSpeed,
    /// It carries CAN FD.
    pub fd: bool,
    /// The robot it belongs to, and which of its lines it is, if one was named.
    pub robot: Option<(Robot, usize)>,
    /// The virtual robot of this process, if it is one.
    pub world: Option<SharedWorld>,
    patience: Option<PatientClock>,
    /// Where it can be opened again, if it is a real one.
    place: Option<BusKind>,
}

/// True if the line at `address` is a CAN line: an interface, or that of a virtual robot.
///
/// # Errors
/// An unknown robot, or one with several lines of which none is named.
pub fn is_can(address: &Address, robot: Option<&str>) -> Result<bool, Error> {
    match (&address.bus, robot) {
        (bus, _) if bus.is_can() => Ok(true),
        (BusKind::Sim | BusKind::SimPty, Some(name)) => {
            let robot = Robot::load(name)?;
            let line = line_of(&robot, address)?;
            Ok(matches!(robot.lines[line].kind, LineKind::Can(_)))
        }
        _ => Ok(false),
    }
}

/// Opens the CAN line at `address`. `robot` names the robot whose line it is: required for a virtual
/// one, else it says the speeds the interface must have, and who should be there.
///
/// # Errors
/// An interface that is not there, down, or of another speed; a line of the robot that is no CAN
/// line; a virtual line behind a terminal.
pub fn open_can(address: &Address, robot: Option<&str>, seed: u64) -> Result<OpenCanLine, Error> {
    let robot = robot.map(Robot::load).transpose()?;
    let line = robot.as_ref().map(|robot| line_of(robot, address)).transpose()?;
    let robot = robot.zip(line);
    let said = match &robot {
        Some((robot, line)) => match robot.lines[*line].kind {
            LineKind::Can(speed) => Some(speed),
            kind @ LineKind::Serial { .. } => {
                return Err(wrong_kind(&robot.lines[*line].name, kind, &address.bus));
            }
        },
        None => None,
    };
    match (&address.bus, &robot, said) {
        (BusKind::Sim | BusKind::SimPty, Some((of, line)), Some(speed)) => {
            let world = world(of, seed)?;
            let patience = (address.bus == BusKind::SimPty).then(PatientClock::start);
            let clock: Arc<dyn Clock> = match &patience {
                Some(patient) => Arc::new(patient.clone()),
                None => Arc::new(VirtualClock(world.clone())),
            };
            let (port, latency) = virtual_port(&world, *line, patience.as_ref())?;
            Ok(OpenCanLine {
                bus: bus_of(port, &clock, speed, latency),
                clock,
                speed,
                fd: speed.data_bitrate_bps.is_some(),
                robot,
                world: Some(world),
                patience,
                place: None,
            })
        }
        (bus, _, said) if bus.is_can() => {
            let known = said.unwrap_or_else(|| usual_speed(bus));
            let speed = speed_at(bus, known);
            let fd = match bus {
                BusKind::Can { interface } => can::state(interface).is_ok_and(|found| found.fd),
                _ => speed.data_bitrate_bps.is_some(),
            };
            let clock: Arc<dyn Clock> = Arc::new(MonotonicClock);
            let (port, latency) = frames_at(bus, speed)?;
            let bus = bus_of(port, &clock, speed, latency);
            let place = Some(address.bus.clone());
            Ok(OpenCanLine { bus, clock, speed, fd, robot, world: None, patience: None, place })
        }
        _ => Err(not_can(&address.bus)),
    }
}

/// The speeds that an interface of the system has; of those that have none, and of adapters, the usual ones.
fn usual_speed(bus: &BusKind) -> CanSpeed {
    let usual =
        CanSpeed { bitrate_bps: USUAL_BITRATE_BPS, data_bitrate_bps: None, host_id: USUAL_HOST };
    let BusKind::Can { interface } = bus else { return usual };
    let Ok(found) = can::state(interface) else { return usual };
    let data_bps = found.data_bitrate_bps.unwrap_or(USUAL_DATA_BITRATE_BPS);
    CanSpeed {
        bitrate_bps: found.bitrate_bps.unwrap_or(USUAL_BITRATE_BPS),
        data_bitrate_bps: found.fd.then_some(data_bps),
        ..usual
    }
}

/// The host's end of a virtual CAN line, whose time passes by itself if there is a clock for that; and
/// the time frames may be held back.
fn virtual_port(
    world: &SharedWorld,
    line: usize,
    patience: Option<&PatientClock>,
) -> Result<(Box<dyn FramePort>, Duration), Error> {
    Ok(match patience {
        Some(clock) => (Box::new(live_line(world, line, clock)?), UNKNOWN_LATENCY),
        None => (Box::new(VirtualCanLine::new(world.clone(), line)), Duration::ZERO),
    })
}

fn bus_of(
    port: Box<dyn FramePort>,
    clock: &Arc<dyn Clock>,
    speed: CanSpeed,
    latency: Duration,
) -> CanBus {
    let timing = CanTiming {
        bitrate_bps: speed.bitrate_bps,
        data_bitrate_bps: speed.data_bitrate_bps.unwrap_or(speed.bitrate_bps),
        latency,
    };
    let mut bus = CanBus::new(port, Arc::clone(clock), timing);
    bus.set_retries(RETRIES);
    bus
}

impl OpenCanLine {
    /// By when a question asked now must be answered, retries included.
    #[must_use]
    pub fn budget(&self) -> Instant {
        self.clock.now() + PATIENCE
    }

    /// The host's own id, for dialects that have one.
    #[must_use]
    pub const fn host_id(&self) -> u8 {
        self.speed.host_id
    }

    /// How fast the line is, in words.
    #[must_use]
    pub fn speed_words(&self) -> String {
        match self.speed.data_bitrate_bps {
            Some(fast) => format!("{} bit/s, CAN FD at {fast} bit/s", self.speed.bitrate_bps),
            None => format!("{} bit/s", self.speed.bitrate_bps),
        }
    }

    /// The same line as the only one of `robot`, to be moved.
    ///
    /// # Errors
    /// An interface that cannot be opened again.
    pub fn into_link(self, robot: Robot) -> Result<Connection, Error> {
        let Self { bus, clock, speed, robot: whole, world, patience, place, .. } = self;
        drop(bus);
        let line = whole.map(|(_, line)| line);
        let (port, latency) = match (place, &world, line) {
            (Some(place), _, _) => frames_at(&place, speed)?,
            (None, Some(world), Some(line)) => virtual_port(world, line, patience.as_ref())?,
            _ => return Err(Error::new("the line cannot be opened again")),
        };
        let real_time = world.is_none() || patience.is_some();
        let link = Link::new(robot, vec![(port, latency)], clock);
        Ok(Connection { link, world, real_time, patience, _doors: Vec::new() })
    }
}
