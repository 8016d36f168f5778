//! The host's end of a virtual robot behind pseudo-terminals of this process, whose time waits for
//! a host that is late. What that time is, is said at [`PatientTime`].

use super::serial::SerialLine;
use super::{BytePort, Clock, MonotonicClock, PortError};
use crate::time::{Duration, Instant};
use gaitway_sim::PatientTime;
use std::sync::Arc;

/// Pause between two looks at a time that stands.
const LOOK: Duration = Duration::from_micros(100);

/// A clock that goes as the system's does, and stands while the host of a virtual robot, or the
/// robot, is late.
#[derive(Clone)]
pub struct PatientClock {
    time: Arc<PatientTime>,
    /// The system's clock when the time began.
    began: Instant,
}

impl PatientClock {
    /// A clock that begins now.
    #[must_use]
    pub fn start() -> Self {
        Self { began: MonotonicClock.now(), time: Arc::default() }
    }

    /// What the doors of the robot share with it.
    #[must_use]
    pub const fn time(&self) -> &Arc<PatientTime> {
        &self.time
    }

    /// By how much it is behind the system's clock.
    #[must_use]
    pub fn waited(&self) -> Duration {
        Duration::from_nanos(self.time.waited_ns())
    }

    /// A moment of this clock on the system's, for what happened just now.
    #[must_use]
    pub fn to_system(&self, at: Instant) -> Instant {
        at + self.waited()
    }

    /// Its own nanoseconds at a moment of it.
    fn nanos(&self, at: Instant) -> u64 {
        at.as_nanos().saturating_sub(self.began.as_nanos())
    }

    fn at(&self, nanos: u64) -> Instant {
        self.began + Duration::from_nanos(nanos)
    }
}

impl Clock for PatientClock {
    fn now(&self) -> Instant {
        self.at(self.time.host_is_here())
    }

    fn sleep_until(&self, at: Instant) {
        let mut before = None;
        loop {
            let now = self.at(self.time.host_sleeps(self.nanos(at)));
            if now >= at {
                self.time.host_is_here();
                return;
            }
            // It may stand, close to the end of the sleep.
            let stands = before.replace(now) == Some(now);
            let left = at.since(now);
            let nap = if stands { left.max(LOOK) } else { left };
            MonotonicClock.sleep_until(MonotonicClock.now() + nap);
        }
    }

    fn of_system(&self, at: Instant) -> Instant {
        let waited = self.time.waited_ns();
        Instant::from_nanos(at.as_nanos().saturating_sub(waited))
    }
}

/// A serial line whose other end is a door that shares the clock.
pub struct PatientLine {
    tty: SerialLine,
    clock: PatientClock,
    line: usize,
}

impl PatientLine {
    /// Opens the terminal of the door of line number `line`.
    ///
    /// # Errors
    /// As [`SerialLine::open`].
    pub fn open(
        path: &str,
        baud_bps: u32,
        line: usize,
        clock: PatientClock,
    ) -> Result<Self, PortError> {
        let tty = SerialLine::open(path, baud_bps)?;
        clock.time.host_opens(line);
        Ok(Self { tty, clock, line })
    }

    /// The deadline by the system's clock, as far as can be said now, and whether bytes are on
    /// their way.
    fn listen(&self, deadline: Instant) -> (Instant, bool) {
        let (now_ns, owed) = self.clock.time.host_listens(self.line, self.clock.nanos(deadline));
        let left = deadline.since(self.clock.at(now_ns));
        // Bytes that left the robot before the deadline are waited for after it.
        let nap = if owed { left.max(LOOK) } else { left };
        (MonotonicClock.now() + nap, owed)
    }
}

impl BytePort for PatientLine {
    fn send(&mut self, bytes: &[u8], deadline: Instant) -> Result<(), PortError> {
        let mut rest = bytes;
        while !rest.is_empty() {
            // A line that takes nothing holds time up, for as long as anybody may.
            let left = deadline.since(self.clock.now());
            match self.tty.send_some(rest, MonotonicClock.now() + left) {
                Ok(count) => {
                    self.clock.time.host_has_written(self.line, count);
                    rest = &rest[count..];
                }
                Err(PortError::TimedOut) if self.clock.now() < deadline => {}
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], deadline: Instant) -> Result<usize, PortError> {
        loop {
            let (by, owed) = self.listen(deadline);
            match self.tty.receive(buffer, by) {
                Ok(count) => {
                    self.clock.time.host_has_read(self.line, count);
                    return Ok(count);
                }
                Err(PortError::TimedOut) if owed || self.clock.now() < deadline => {}
                Err(error) => {
                    self.clock.now();
                    return Err(error);
                }
            }
        }
    }

    /// Reads away what the robot has sent by now, also what is still on its way.
    fn discard_input(&mut self) -> Result<(), PortError> {
        let mut chunk = [0_u8; 1024];
        loop {
            let now = self.clock.now();
            let (_, owed) = self.listen(now);
            if !owed {
                self.clock.now();
                return self.tty.discard_input();
            }
            match self.receive(&mut chunk, now) {
                Ok(_) | Err(PortError::TimedOut) => {}
                Err(error) => return Err(error),
            }
        }
    }
}
