//! The virtual robot behind the port traits: waiting *is* running the virtual world, so the code
//! above runs unmodified, in one thread and in virtual time. All lines of a world share its clock.

use super::{BytePort, Clock, PortError};
use crate::time::Instant;
use gaitway_sim::World;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A virtual world shared by its clock and its lines.
#[derive(Clone)]
pub struct SharedWorld(Arc<Mutex<World>>);

impl SharedWorld {
    /// Shares `world`.
    #[must_use]
    pub fn new(world: World) -> Self {
        Self(Arc::new(Mutex::new(world)))
    }

    /// Looks at or changes the world between two bus exchanges.
    ///
    /// A panic of another holder leaves registers, not invariants, half written: the world stays
    /// usable for the stop that follows.
    pub fn lock(&self) -> MutexGuard<'_, World> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The mutex itself, for a real-time door.
    #[must_use]
    pub fn inner(&self) -> Arc<Mutex<World>> {
        Arc::clone(&self.0)
    }
}

/// The world's own clock.
pub struct VirtualClock(pub SharedWorld);

impl Clock for VirtualClock {
    fn now(&self) -> Instant {
        Instant::from_nanos(self.0.lock().now_ns())
    }

    fn sleep_until(&self, at: Instant) {
        self.0.lock().run_until(at.as_nanos());
    }
}

/// The host's end of one virtual line. If the line hangs up it stays gone, as a port does whose
/// adapter was pulled out, even if the adapter comes back.
pub struct VirtualLine {
    world: SharedWorld,
    line: usize,
    baud_bps: u32,
    /// Which connection to the line this is.
    connection: Option<u32>,
}

impl VirtualLine {
    /// The host's end of line number `line`, sending at `baud_bps`.
    #[must_use]
    pub fn new(world: SharedWorld, line: usize, baud_bps: u32) -> Self {
        let connection = world.lock().connection(line);
        Self { world, line, baud_bps, connection }
    }

    /// The world, if the line is still the one that was opened.
    fn connected(&self) -> Result<MutexGuard<'_, World>, PortError> {
        let world = self.world.lock();
        if self.connection.is_some() && world.connection(self.line) == self.connection {
            Ok(world)
        } else {
            Err(PortError::Gone(format!("virtual line {} hung up", self.line)))
        }
    }
}

impl BytePort for VirtualLine {
    fn send(&mut self, bytes: &[u8], deadline: Instant) -> Result<(), PortError> {
        let mut rest = bytes;
        loop {
            let mut world = self.connected()?;
            let taken = world.transmit(self.line, rest, self.baud_bps);
            rest = &rest[taken..];
            match world.blocked_until_ns(self.line) {
                Some(until_ns) if !rest.is_empty() => {
                    world.run_until(until_ns.min(deadline.as_nanos()));
                    if until_ns > deadline.as_nanos() {
                        return Err(PortError::TimedOut);
                    }
                }
                _ => return Ok(()),
            }
        }
    }

    fn receive(&mut self, buffer: &mut [u8], deadline: Instant) -> Result<usize, PortError> {
        let count = self.connected()?.receive(self.line, buffer, deadline.as_nanos());
        match count {
            0 => self.connected().and(Err(PortError::TimedOut)),
            n => Ok(n),
        }
    }

    fn discard_input(&mut self) -> Result<(), PortError> {
        self.connected()?.discard_input(self.line);
        Ok(())
    }
}
