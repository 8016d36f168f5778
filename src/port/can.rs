//! A CAN interface of the operating system through SocketCAN.

use super::{CanFrame, Clock, FramePort, MonotonicClock, PortError};
use crate::time::Instant;
use socketcan::{CanSocket, EmbeddedFrame, ExtendedId, Frame, Id, Socket, StandardId};
use std::io::ErrorKind;

/// An open CAN interface, classic frames.
pub struct CanInterface {
    socket: CanSocket,
    name: String,
}

impl CanInterface {
    /// Opens the interface `name`, e.g. `can0`.
    ///
    /// # Errors
    /// [`PortError::Gone`] if the kernel has no such interface or no CAN at all,
    /// [`PortError::Denied`] without permission.
    pub fn open(name: &str) -> Result<Self, PortError> {
        let socket = CanSocket::open(name).map_err(|e| match e.raw_os_error() {
            Some(97) => PortError::Gone(format!("{name}: this kernel was built without CAN")),
            Some(19) => PortError::Gone(format!("{name}: no such CAN interface")),
            _ if e.kind() == ErrorKind::PermissionDenied => PortError::Denied(name.to_owned()),
            _ => PortError::Io(format!("{name}: {e}")),
        })?;
        Ok(Self { socket, name: name.to_owned() })
    }

    fn io_error(&self, error: &std::io::Error) -> PortError {
        match (error.kind(), error.raw_os_error()) {
            (ErrorKind::TimedOut | ErrorKind::WouldBlock, _) => PortError::TimedOut,
            (_, Some(105)) => PortError::Busy(format!("{}: send queue full", self.name)),
            (_, Some(19 | 100)) => PortError::Gone(self.name.clone()),
            _ => PortError::Io(format!("{}: {error}", self.name)),
        }
    }
}

impl FramePort for CanInterface {
    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
        let bad = || PortError::Io(format!("not a CAN frame: {frame:?}"));
        let id = if frame.extended {
            ExtendedId::new(frame.id).map(Id::Extended)
        } else {
            u16::try_from(frame.id).ok().and_then(StandardId::new).map(Id::Standard)
        };
        let wire = socketcan::CanFrame::new(id.ok_or_else(bad)?, &frame.payload).ok_or_else(bad)?;
        self.socket.write_frame(&wire).map_err(|e| self.io_error(&e))
    }

    fn receive(&mut self, deadline: Instant) -> Result<CanFrame, PortError> {
        loop {
            let left = deadline.since(MonotonicClock.now());
            let got = self.socket.read_frame_timeout(left).map_err(|e| self.io_error(&e))?;
            // Error and remote frames say something about the line, not about a device.
            if let socketcan::CanFrame::Data(frame) = got {
                return Ok(CanFrame {
                    id: frame.raw_id(),
                    extended: frame.is_extended(),
                    payload: frame.data().to_vec(),
                });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_interface_is_named_in_the_error() {
        let Err(error) = CanInterface::open("nocan7") else { panic!("there is no nocan7") };
        assert!(error.to_string().contains("nocan7"), "{error}");
    }
}
