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

/// The host's end of one virtual line.
pub struct VirtualLine {
    world: SharedWorld,
    line: usize,
    baud_bps: u32,
}

impl VirtualLine {
    /// The host's end of line number `line`, sending at `baud_bps`.
    #[must_use]
    pub fn new(world: SharedWorld, line: usize, baud_bps: u32) -> Self {
        Self { world, line, baud_bps }
    }
}

impl BytePort for VirtualLine {
    fn send(&mut self, bytes: &[u8], _deadline: Instant) -> Result<(), PortError> {
        self.world.lock().transmit(self.line, bytes, self.baud_bps);
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], deadline: Instant) -> Result<usize, PortError> {
        match self.world.lock().receive(self.line, buffer, deadline.as_nanos()) {
            0 => Err(PortError::TimedOut),
            n => Ok(n),
        }
    }

    fn discard_input(&mut self) -> Result<(), PortError> {
        self.world.lock().discard_input(self.line);
        Ok(())
    }
}
