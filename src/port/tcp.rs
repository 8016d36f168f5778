//! A serial line reached over TCP: a terminal server, or a virtual robot on another machine.

use super::{BytePort, Clock, MonotonicClock, PortError};
use crate::time::{Duration, Instant};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use std::io::{ErrorKind, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::os::fd::AsFd;

/// Longest wait for the other side to take the connection.
const CONNECT: Duration = Duration::from_secs(3);

/// Bytes thrown away at most in one go.
const MOST_DISCARDED: usize = 64 * 1024;

/// An open connection whose bytes are those of a serial line.
pub struct TcpLine {
    stream: TcpStream,
    place: String,
}

impl TcpLine {
    /// Connects to `place`, written `host:port`.
    ///
    /// # Errors
    /// [`PortError::Gone`] if nobody is there, [`PortError::Io`] for an address that means nothing.
    pub fn open(place: &str) -> Result<Self, PortError> {
        let gone = |e: std::io::Error| PortError::Gone(format!("{place}: {e}"));
        let mut last = PortError::Io(format!("{place}: no such host"));
        for address in place.to_socket_addrs().map_err(gone)? {
            match TcpStream::connect_timeout(&address, CONNECT) {
                Ok(stream) => {
                    // Each instruction is a packet of its own; waiting for more only delays it.
                    stream.set_nodelay(true).map_err(gone)?;
                    stream.set_nonblocking(true).map_err(gone)?;
                    return Ok(Self { stream, place: place.to_owned() });
                }
                Err(error) => last = gone(error),
            }
        }
        Err(last)
    }

    /// Waits until the connection is ready for `what`; false at the deadline.
    fn wait(&self, what: PollFlags, deadline: Instant) -> Result<bool, PortError> {
        loop {
            let left = deadline.since(MonotonicClock.now());
            let time_out = Timespec {
                tv_sec: i64::try_from(left.as_secs()).unwrap_or(i64::MAX),
                tv_nsec: left.subsec_nanos().into(),
            };
            let mut fds = [PollFd::from_borrowed_fd(self.stream.as_fd(), what)];
            match poll(&mut fds, Some(&time_out)) {
                Ok(ready) => return Ok(ready > 0),
                Err(rustix::io::Errno::INTR) => {}
                Err(error) => return Err(PortError::Io(format!("{}: {error}", self.place))),
            }
        }
    }

    fn io_error(&self, error: &std::io::Error) -> PortError {
        PortError::Gone(format!("{}: {error}", self.place))
    }

    fn closed(&self) -> PortError {
        PortError::Gone(format!("{}: the other side closed the connection", self.place))
    }
}

fn is_not_yet(error: &std::io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted)
}

impl BytePort for TcpLine {
    fn send(&mut self, bytes: &[u8], deadline: Instant) -> Result<(), PortError> {
        let mut rest = bytes;
        while !rest.is_empty() {
            match self.stream.write(rest) {
                Ok(0) => return Err(self.closed()),
                Ok(n) => rest = &rest[n..],
                Err(error) if is_not_yet(&error) => {
                    if !self.wait(PollFlags::OUT, deadline)? {
                        return Err(PortError::TimedOut);
                    }
                }
                Err(error) => return Err(self.io_error(&error)),
            }
        }
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], deadline: Instant) -> Result<usize, PortError> {
        loop {
            match self.stream.read(buffer) {
                Ok(0) => return Err(self.closed()),
                Ok(n) => return Ok(n),
                Err(error) if is_not_yet(&error) => {
                    if !self.wait(PollFlags::IN, deadline)? {
                        return Err(PortError::TimedOut);
                    }
                }
                Err(error) => return Err(self.io_error(&error)),
            }
        }
    }

    fn discard_input(&mut self) -> Result<(), PortError> {
        let mut chunk = [0_u8; 1024];
        let mut thrown = 0;
        while thrown < MOST_DISCARDED {
            match self.receive(&mut chunk, Instant::ZERO) {
                Ok(n) => thrown += n,
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
    use std::net::TcpListener;

    fn pair() -> (TcpLine, TcpStream) {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let place = listener.local_addr().expect("its address").to_string();
        let line = TcpLine::open(&place).expect("a connection");
        (line, listener.accept().expect("the other end").0)
    }

    fn soon() -> Instant {
        MonotonicClock.now() + Duration::from_secs(5)
    }

    #[test]
    fn bytes_go_both_ways() {
        let (mut line, mut other) = pair();
        line.send(&[0xFF, 0xFF, 1], soon()).expect("taken");
        let mut heard = [0_u8; 3];
        other.read_exact(&mut heard).expect("three bytes");
        assert_eq!(heard, [0xFF, 0xFF, 1]);
        other.write_all(&[7, 8]).expect("taken");
        let mut buffer = [0_u8; 8];
        let mut got = Vec::new();
        while got.len() < 2 {
            let n = line.receive(&mut buffer, soon()).expect("bytes");
            got.extend_from_slice(&buffer[..n]);
        }
        assert_eq!(got, [7, 8]);
    }

    #[test]
    fn silence_ends_at_the_deadline_and_not_before() {
        let (mut line, _other) = pair();
        let deadline = MonotonicClock.now() + Duration::from_millis(5);
        assert_eq!(line.receive(&mut [0; 4], deadline), Err(PortError::TimedOut));
        assert!(MonotonicClock.now() >= deadline);
    }

    #[test]
    fn a_closed_connection_is_a_port_that_is_gone() {
        let (mut line, other) = pair();
        drop(other);
        assert!(matches!(line.receive(&mut [0; 4], soon()), Err(PortError::Gone(_))));
    }

    #[test]
    fn nobody_listening_is_named() {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let place = listener.local_addr().expect("its address").to_string();
        drop(listener);
        let Err(error) = TcpLine::open(&place) else { panic!("nobody listens") };
        assert!(error.to_string().contains(&place), "{error}");
    }
}
