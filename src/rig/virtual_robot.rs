//! A virtual robot of this process: in virtual time, or behind pseudo-terminals.

use super::wire::{port_error, spoken};
use crate::error::Error;
use crate::port::patient::{PatientClock, PatientLine};
use crate::port::sim::{LiveCanLine, SharedWorld, VirtualCanLine, VirtualLine};
use crate::port::{BytePort, FramePort};
use crate::robot::{LinePort, Robot};
use gaitway_profiles::LineKind;
use gaitway_sim::{Door, Options, World};

pub(super) fn world(robot: &Robot, seed: u64) -> Result<SharedWorld, Error> {
    let options = Options { seed, ..Options::default() };
    let world = World::new(&robot.file, options)
        .map_err(|e| Error::new(e.to_string()).at(format!("virtual robot {}", robot.name)))?;
    Ok(SharedWorld::new(world))
}

/// The host's end of a virtual line.
pub(super) fn virtual_port(world: &SharedWorld, line: usize, kind: LineKind) -> LinePort {
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

/// A line of a virtual robot of this process behind a pseudo-terminal.
pub(super) struct VirtualTerminal {
    pub door: Door,
    line: usize,
    pub clock: PatientClock,
}

impl VirtualTerminal {
    pub fn open(world: &SharedWorld, line: usize, clock: &PatientClock) -> Result<Self, Error> {
        let door = Door::open_patient(world.inner(), line, clock.time())
            .map_err(|e| Error::new("cannot open a pseudo-terminal").got(e.to_string()))?;
        Ok(Self { door, line, clock: clock.clone() })
    }

    pub fn port(&self, baud_bps: u32) -> Result<Box<dyn BytePort>, Error> {
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
