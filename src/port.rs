//! Moves bytes or CAN frames and owns waiting. This is the only room that reads a clock.
//!
//! Three separate traits, so that several lines, serial or CAN, real or virtual, share one clock:
//! [`Clock`], [`BytePort`] and [`FramePort`]. Production code above this room never learns
//! whether time is real.

pub mod can;
pub mod can_bridge;
pub mod inventory;
pub mod patient;
pub mod serial;
pub mod sim;
pub mod slcan;
pub mod tcp;

use crate::time::Instant;
use crate::wire::can::CanFrame;
use crate::wire::can::error_frame::ErrorFrame;
use std::fmt;

/// A monotonic clock that can be waited on.
pub trait Clock: Send + Sync {
    /// The present moment.
    fn now(&self) -> Instant;

    /// Returns at `at` or as soon after it as the system allows; at once if it is past.
    fn sleep_until(&self, at: Instant);

    /// A moment of the system's clock on this one, for what happened just now; a clock that never
    /// stands has the same moments.
    fn of_system(&self, at: Instant) -> Instant {
        at
    }
}

/// One end of a serial line.
pub trait BytePort: Send {
    /// Hands all bytes to the line, or fails by `deadline`.
    ///
    /// # Errors
    /// [`PortError::TimedOut`] if the line did not take them, [`PortError::Gone`] if it is not
    /// there any more.
    fn send(&mut self, bytes: &[u8], deadline: Instant) -> Result<(), PortError>;

    /// Waits for at least one byte and returns how many were put into `buffer`.
    ///
    /// # Errors
    /// [`PortError::TimedOut`] when nothing came by `deadline`, [`PortError::Gone`] if the port
    /// vanished. Never `Ok(0)` for a non-empty buffer.
    fn receive(&mut self, buffer: &mut [u8], deadline: Instant) -> Result<usize, PortError>;

    /// Throws away everything received so far.
    ///
    /// # Errors
    /// As [`BytePort::receive`], without the time-out.
    fn discard_input(&mut self) -> Result<(), PortError>;
}

/// A port that was closed, and not opened again.
pub struct Closed;

impl Closed {
    fn gone<T>() -> Result<T, PortError> {
        Err(PortError::Gone("it was closed".to_owned()))
    }
}

impl BytePort for Closed {
    fn send(&mut self, _bytes: &[u8], _deadline: Instant) -> Result<(), PortError> {
        Self::gone()
    }

    fn receive(&mut self, _buffer: &mut [u8], _deadline: Instant) -> Result<usize, PortError> {
        Self::gone()
    }

    fn discard_input(&mut self) -> Result<(), PortError> {
        Self::gone()
    }
}

/// One end of a CAN line. Frames are values; the line arbitrates.
pub trait FramePort: Send {
    /// Hands a frame to the line's send queue, waiting for room in it until `deadline`. That it was
    /// taken does not mean that it was sent.
    ///
    /// # Errors
    /// [`PortError::TimedOut`] when the queue stayed full, [`PortError::Gone`] when the interface
    /// is down or vanished, [`PortError::Io`] for a frame the line cannot carry.
    fn send(&mut self, frame: &CanFrame, deadline: Instant) -> Result<(), PortError>;

    /// What is heard next, waiting until `deadline`.
    ///
    /// # Errors
    /// [`PortError::TimedOut`], [`PortError::Gone`].
    fn receive(&mut self, deadline: Instant) -> Result<Heard, PortError>;

    /// How often the send queue was found full. Each time the port waited and tried again.
    fn full_queue_count(&self) -> u64;

    /// Lines of text of an adapter that meant nothing: bytes were lost on the way. Where frames do not travel as
    /// text there are none.
    fn garbled_count(&self) -> u64 {
        0
    }
}

/// What comes from a CAN line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Heard {
    /// A frame of someone else.
    Frame(CanFrame),
    /// The line itself reports.
    Report(ErrorFrame),
}

/// What can go wrong between here and the wire.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum PortError {
    /// Nothing happened by the deadline.
    TimedOut,
    /// The port does not exist (any more): unplugged, hung up.
    Gone(String),
    /// The user may not open it.
    Denied(String),
    /// Something else holds it.
    Busy(String),
    /// Any other answer of the operating system.
    Io(String),
}

impl fmt::Display for PortError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TimedOut => f.write_str("nothing came by the deadline"),
            Self::Gone(text) => write!(f, "the port is gone: {text}"),
            Self::Denied(text) => write!(f, "no permission: {text}"),
            Self::Busy(text) => write!(f, "the port is in use: {text}"),
            Self::Io(text) => write!(f, "input/output error: {text}"),
        }
    }
}

impl std::error::Error for PortError {}

/// The system's monotonic clock. All real ports share it, so their instants compare.
///
/// It goes on while the machine is suspended (`CLOCK_BOOTTIME`): a lid closed in the middle of a
/// motion is a gap that is noticed, not a moment that never was. Setting the wall clock does not
/// move it.
#[derive(Clone, Copy, Debug, Default)]
pub struct MonotonicClock;

impl Clock for MonotonicClock {
    fn now(&self) -> Instant {
        let t = rustix::time::clock_gettime(rustix::time::ClockId::Boottime);
        let seconds = u64::try_from(t.tv_sec).unwrap_or(0);
        let nanos = u64::try_from(t.tv_nsec).unwrap_or(0);
        Instant::from_nanos(seconds * 1_000_000_000 + nanos)
    }

    /// Sleeps to the absolute time in the kernel, so that a late wake-up never adds up.
    fn sleep_until(&self, at: Instant) {
        if self.now() >= at {
            return; // a system call less in every exchange
        }
        let request = rustix::time::Timespec {
            tv_sec: i64::try_from(at.as_nanos() / 1_000_000_000).unwrap_or(i64::MAX),
            tv_nsec: (at.as_nanos() % 1_000_000_000) as _,
        };
        let clock = rustix::thread::ClockId::Boottime;
        while rustix::thread::clock_nanosleep_absolute(clock, &request)
            == Err(rustix::io::Errno::INTR)
        {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::Duration;

    #[test]
    fn the_monotonic_clock_never_wakes_before_the_asked_moment() {
        let clock = MonotonicClock;
        let at = clock.now() + Duration::from_millis(3);
        clock.sleep_until(at);
        assert!(clock.now() >= at);
    }

    #[test]
    fn the_monotonic_clock_counts_the_time_the_machine_was_suspended() {
        // The kernel's uptime counts it too; it is printed to a hundredth of a second.
        let before = MonotonicClock.now();
        let uptime = std::fs::read_to_string("/proc/uptime").expect("Linux");
        let after = MonotonicClock.now();
        let seconds: f64 = uptime.split(' ').next().and_then(|s| s.parse().ok()).expect("seconds");
        let uptime = Instant::ZERO + Duration::from_secs_f64(seconds);
        assert!(uptime + Duration::from_millis(10) >= before && uptime <= after, "{uptime:?}");
    }

    #[test]
    fn sleeping_to_a_past_moment_returns() {
        MonotonicClock.sleep_until(Instant::ZERO);
    }
}
