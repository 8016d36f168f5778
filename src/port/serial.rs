//! A serial port of the operating system, real or pseudo-terminal.
//!
//! The `serialport` crate opens it (exclusively: `TIOCEXCL` and `flock`), sets it up and waits
//! with `ppoll`, whose time-outs are nanoseconds. Every wait is bounded by a deadline.

use super::{BytePort, Clock, MonotonicClock, PortError};
use crate::time::Instant;
use serialport::{ClearBuffer, SerialPort, TTYPort};
use std::io::{ErrorKind, Read, Write};
use std::path::Path;

/// Chunks of 1 KiB thrown away at most in one go.
const MOST_DISCARDED: usize = 64;

/// An open serial line.
pub struct SerialLine {
    tty: TTYPort,
    path: String,
}

impl SerialLine {
    /// Opens `path` at `baud_bps`, 8N1, no flow control, for this process alone.
    ///
    /// # Errors
    /// [`PortError::Gone`] if there is no such port, [`PortError::Denied`] without permission,
    /// [`PortError::Busy`] if another program holds it, [`PortError::Io`] if it is not a
    /// terminal or cannot do that speed.
    pub fn open(path: &str, baud_bps: u32) -> Result<Self, PortError> {
        // `serialport` reports a lock held elsewhere and a missing device alike; tell them apart.
        if !Path::new(path).exists() {
            return Err(PortError::Gone(format!("{path} does not exist")));
        }
        let tty =
            TTYPort::open(&serialport::new(path, baud_bps)).map_err(|e| open_error(path, &e))?;
        let line = Self { tty, path: path.to_owned() };
        line.tty.clear(ClearBuffer::All).map_err(|e| open_error(path, &e))?;
        Ok(line)
    }

    /// Worst time a USB adapter holds received bytes back, if its driver says so (FTDI), s.
    #[must_use]
    pub fn latency_timer_s(path: &str) -> Option<f64> {
        let real = std::fs::canonicalize(path).ok()?;
        let name = real.file_name()?.to_str()?;
        let file = format!("/sys/class/tty/{name}/device/latency_timer");
        let millis: f64 = std::fs::read_to_string(file).ok()?.trim().parse().ok()?;
        Some(millis / 1000.0)
    }

    fn set_time_out(&mut self, deadline: Instant) -> Result<(), PortError> {
        let left = deadline.since(MonotonicClock.now());
        // A zero time-out still polls once, so bytes already here are seen.
        self.tty.set_timeout(left).map_err(|e| PortError::Io(e.to_string()))
    }

    /// Hands at least one byte to the line, or fails by `deadline`; how many there were.
    pub(super) fn send_some(
        &mut self,
        bytes: &[u8],
        deadline: Instant,
    ) -> Result<usize, PortError> {
        loop {
            self.set_time_out(deadline)?;
            match self.tty.write(bytes) {
                Ok(0) => return Err(PortError::Gone(self.path.clone())),
                Ok(count) => return Ok(count),
                Err(e) if e.kind() == ErrorKind::Interrupted => {}
                Err(e) => return Err(self.io_error(&e)),
            }
        }
    }

    fn waiting(&self) -> Result<u32, PortError> {
        self.tty.bytes_to_read().map_err(|e| match e.kind() {
            serialport::ErrorKind::NoDevice => PortError::Gone(self.path.clone()),
            _ => PortError::Io(format!("{}: {}", self.path, e.description)),
        })
    }

    fn io_error(&self, error: &std::io::Error) -> PortError {
        match error.kind() {
            ErrorKind::TimedOut => PortError::TimedOut,
            ErrorKind::BrokenPipe | ErrorKind::NotConnected => PortError::Gone(self.path.clone()),
            // EIO and ENXIO are what an unplugged adapter and a closed pseudo-terminal give.
            _ if matches!(error.raw_os_error(), Some(5 | 6 | 19)) => {
                PortError::Gone(self.path.clone())
            }
            _ => PortError::Io(format!("{}: {error}", self.path)),
        }
    }
}

fn open_error(path: &str, error: &serialport::Error) -> PortError {
    use serialport::ErrorKind as Kind;
    match error.kind() {
        Kind::Io(ErrorKind::PermissionDenied) => PortError::Denied(path.to_owned()),
        Kind::Io(ErrorKind::NotFound) => PortError::Gone(path.to_owned()),
        Kind::NoDevice | Kind::Io(ErrorKind::WouldBlock | ErrorKind::ResourceBusy) => {
            PortError::Busy(format!("{path} ({})", error.description))
        }
        _ => PortError::Io(format!("{path}: {}", error.description)),
    }
}

impl BytePort for SerialLine {
    fn send(&mut self, bytes: &[u8], deadline: Instant) -> Result<(), PortError> {
        let mut rest = bytes;
        while !rest.is_empty() {
            let count = self.send_some(rest, deadline)?;
            rest = &rest[count..];
        }
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], deadline: Instant) -> Result<usize, PortError> {
        loop {
            self.set_time_out(deadline)?;
            match self.tty.read(buffer) {
                // A line that is "readable" but gives nothing has been hung up.
                Ok(0) => return Err(PortError::Gone(self.path.clone())),
                Ok(n) => return Ok(n),
                Err(e) if e.kind() == ErrorKind::Interrupted => {}
                Err(e) => return Err(self.io_error(&e)),
            }
        }
    }

    /// Reads away what is there. Asking first is cheaper than `tcflush`, which on a
    /// pseudo-terminal waits for the kernel's worker.
    fn discard_input(&mut self) -> Result<(), PortError> {
        let mut chunk = [0_u8; 1024];
        // A line that babbles without end must not hold anyone here.
        for _ in 0..MOST_DISCARDED {
            if self.waiting()? == 0 {
                break;
            }
            match self.receive(&mut chunk, Instant::ZERO) {
                Ok(_) => {}
                Err(PortError::TimedOut) => break,
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::Duration;
    use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};

    #[test]
    fn a_host_that_wakes_too_late_still_hears_what_came_meanwhile() {
        let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC;
        let device = openpt(flags).expect("a terminal");
        grantpt(&device).and_then(|()| unlockpt(&device)).expect("its other end");
        let path = ptsname(&device, Vec::new()).expect("a name").into_string().expect("UTF-8");
        let mut line = SerialLine::open(&path, 1_000_000).expect("a line");
        let mut buffer = [0; 16];
        let past = Instant::ZERO;
        assert_eq!(line.receive(&mut buffer, past), Err(PortError::TimedOut), "nothing is there");
        rustix::io::write(&device, &[1, 2, 3]).expect("said");
        // The kernel hands bytes over when it likes: now they are here, and stay until they are read.
        let soon = MonotonicClock.now() + Duration::from_secs(60);
        while line.waiting().expect("a line") < 3 && MonotonicClock.now() < soon {
            std::thread::yield_now();
        }
        assert_eq!(line.receive(&mut buffer, past), Ok(3), "a deadline in the past");
        assert_eq!(buffer[..3], [1, 2, 3]);
    }
}
