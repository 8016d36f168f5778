//! A CAN interface of the operating system through SocketCAN, classic and FD.
//!
//! Interfaces are set up beforehand, by the system or by hand, with bit rates and all:
//! `ip link set can0 up type can bitrate 1000000 dbitrate 5000000 fd on`.

use super::{Clock, FramePort, Heard, MonotonicClock, PortError};
use crate::time::{Duration, Instant};
use crate::wire::can::error_frame::ErrorFrame;
use crate::wire::can::{CanFrame, CanId, Format};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;
use serde::Serialize;
use socketcan::id::FdFlags;
use socketcan::nl::CanState;
use socketcan::{
    CanAnyFrame, CanDataFrame, CanFdFrame, CanFdSocket, CanFilter, CanRemoteFrame, EmbeddedFrame,
    ExtendedId, Frame, Id, Socket, SocketOptions, StandardId,
};
use std::fs;
use std::io::ErrorKind;
use std::os::fd::AsFd;
use std::os::linux::net::SocketAddrExt;
use std::os::unix::net::{SocketAddr, UnixListener};

/// Pause before a full send queue is tried again: about one frame of eight bytes at 1 Mbit/s.
const QUEUE_PAUSE: Duration = Duration::from_micros(150);
/// The flag that marks an extended identifier in a filter (`linux/can.h`).
const EXTENDED_FLAG: u32 = 0x8000_0000;

/// An open CAN interface.
pub struct CanInterface {
    socket: CanFdSocket,
    name: String,
    full_queue_count: u64,
    /// While it lives no other command of ours speaks here.
    claim: Option<UnixListener>,
}

/// Which frames are let through: those of the same kind whose identifier has the bits of `id` where
/// `mask` has ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Filter {
    /// Wanted bits.
    pub id: CanId,
    /// Bits that matter.
    pub mask: u32,
}

/// How an interface stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InterfaceState {
    /// It is switched on.
    pub up: bool,
    /// It carries CAN FD.
    pub fd: bool,
    /// Bit rate in bit/s; virtual interfaces have none.
    pub bitrate_bps: Option<u32>,
    /// Bit rate of the payload of fast FD frames, bit/s.
    pub data_bitrate_bps: Option<u32>,
    /// Health of the controller; virtual interfaces have none.
    pub controller: Option<Controller>,
}

/// Health of a CAN controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Controller {
    /// All is well.
    Active,
    /// Many errors.
    Warning,
    /// So many errors that it may not speak up any more.
    Passive,
    /// It has left the line.
    BusOff,
    /// Not started.
    Stopped,
}

/// Names of the CAN interfaces the system has, in alphabetical order.
#[must_use]
pub fn interfaces() -> Vec<String> {
    const ARPHRD_CAN: &str = "280";
    let entries = fs::read_dir("/sys/class/net").into_iter().flatten().flatten();
    let is_can = |entry: &fs::DirEntry| {
        fs::read_to_string(entry.path().join("type")).is_ok_and(|text| text.trim() == ARPHRD_CAN)
    };
    let mut names: Vec<_> = entries
        .filter(is_can)
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

/// `EAFNOSUPPORT` (`asm-generic/errno.h`): the kernel has no such protocol, nor a module for it.
const NO_SUCH_FAMILY: i32 = 97;

/// True if the kernel knows CAN, whether or not it has an interface.
#[must_use]
pub fn is_supported() -> bool {
    // No CAN interface has this name: only the reason why it cannot be opened matters.
    let opened = CanFdSocket::open("lo");
    !opened.is_err_and(|error| error.raw_os_error() == Some(NO_SUCH_FAMILY))
}

/// How the interface `name` stands.
///
/// # Errors
/// [`PortError::Gone`] if there is none, [`PortError::Io`] if the kernel does not say.
pub fn state(name: &str) -> Result<InterfaceState, PortError> {
    let missing = || PortError::Gone(format!("{name}: no such CAN interface"));
    let interface = socketcan::CanInterface::open(name).map_err(|_| missing())?;
    let details = interface.details().map_err(|error| PortError::Io(format!("{name}: {error}")))?;
    let controller = details.can.state.map(|state| match state {
        CanState::ErrorActive => Controller::Active,
        CanState::ErrorWarning => Controller::Warning,
        CanState::ErrorPassive => Controller::Passive,
        CanState::BusOff => Controller::BusOff,
        CanState::Stopped | CanState::Sleeping => Controller::Stopped,
    });
    Ok(InterfaceState {
        up: details.is_up,
        fd: details.mtu == Some(socketcan::nl::Mtu::Fd),
        bitrate_bps: details.can.bit_timing.map(|timing| timing.bitrate),
        data_bitrate_bps: details.can.data_bit_timing.map(|timing| timing.bitrate),
        controller,
    })
}

impl CanInterface {
    /// Opens the interface `name`, e.g. `can0`. Reports of the line are heard too.
    ///
    /// # Errors
    /// [`PortError::Gone`] if the kernel has no such interface or no CAN at all,
    /// [`PortError::Denied`] without permission.
    pub fn open(name: &str) -> Result<Self, PortError> {
        let socket = CanFdSocket::open(name).map_err(|e| match e.raw_os_error() {
            Some(NO_SUCH_FAMILY) => {
                PortError::Gone(format!("{name}: this kernel was built without CAN"))
            }
            Some(19) => PortError::Gone(format!("{name}: no such CAN interface")),
            _ if e.kind() == ErrorKind::PermissionDenied => PortError::Denied(name.to_owned()),
            _ => PortError::Io(format!("{name}: {e}")),
        })?;
        let port = Self { socket, name: name.to_owned(), full_queue_count: 0, claim: None };
        let ready = port.socket.set_error_filter_accept_all();
        ready.and_then(|()| port.socket.set_nonblocking(true)).map_err(|e| port.io_error(&e))?;
        Ok(port)
    }

    /// Claims the interface, which the kernel itself gives to everybody: two hosts that tell the
    /// same actuators their goals would fight. Ends with this value, or with the process.
    ///
    /// # Errors
    /// [`PortError::Busy`] if another command holds it.
    pub fn claim(&mut self) -> Result<(), PortError> {
        self.claim = Some(claim(&self.name)?);
        Ok(())
    }

    /// From now on lets through only frames that pass one of the filters, and reports of the line.
    ///
    /// # Errors
    /// [`PortError::Io`] if the kernel refuses.
    pub fn listen_to(&mut self, filters: &[Filter]) -> Result<(), PortError> {
        let filters: Vec<CanFilter> = filters
            .iter()
            .map(|filter| {
                let kind = if filter.id.is_extended() { EXTENDED_FLAG } else { 0 };
                CanFilter::new(filter.id.number() | kind, filter.mask | EXTENDED_FLAG)
            })
            .collect();
        self.socket.set_filters(&filters).map_err(|e| self.io_error(&e))
    }

    fn io_error(&self, error: &std::io::Error) -> PortError {
        match error.raw_os_error() {
            Some(19) => PortError::Gone(format!("{}: no such CAN interface", self.name)),
            Some(100) => PortError::Gone(format!("{}: the interface is down", self.name)),
            _ => PortError::Io(format!("{}: {error}", self.name)),
        }
    }

    /// Waits until the socket is ready for `what`, or fails by `deadline`.
    fn wait_for(&self, what: PollFlags, deadline: Instant) -> Result<(), PortError> {
        loop {
            let left = deadline.since(MonotonicClock.now());
            let timeout = Timespec {
                tv_sec: i64::try_from(left.as_secs()).unwrap_or(i64::MAX),
                tv_nsec: left.subsec_nanos().into(),
            };
            let mut sockets = [PollFd::from_borrowed_fd(self.socket.as_fd(), what)];
            match poll(&mut sockets, Some(&timeout)) {
                // Errors of the socket are told by the call that follows.
                Ok(ready) if ready > 0 => return Ok(()),
                Ok(_) => return Err(PortError::TimedOut),
                Err(Errno::INTR) => {}
                Err(errno) => return Err(self.io_error(&errno.into())),
            }
        }
    }
}

/// A name in the kernel that one process holds at a time, in the network namespace of the interface.
fn claim(interface: &str) -> Result<UnixListener, PortError> {
    let unclaimable = |e: std::io::Error| match e.kind() {
        ErrorKind::AddrInUse => PortError::Busy(interface.to_owned()),
        _ => PortError::Io(format!("{interface}: it cannot be claimed: {e}")),
    };
    let name = SocketAddr::from_abstract_name(format!("gaitway-can-{interface}"));
    name.and_then(|name| UnixListener::bind_addr(&name)).map_err(unclaimable)
}

impl FramePort for CanInterface {
    fn full_queue_count(&self) -> u64 {
        self.full_queue_count
    }

    fn send(&mut self, frame: &CanFrame, deadline: Instant) -> Result<(), PortError> {
        const NO_BUFFERS: i32 = 105;
        const INVALID: i32 = 22;
        let unfit = || PortError::Io(format!("{}: cannot carry {frame:?}", self.name));
        let wire = to_socket(frame).ok_or_else(unfit)?;
        loop {
            let Err(error) = self.socket.write_frame(&wire) else { return Ok(()) };
            match (error.kind(), error.raw_os_error()) {
                (ErrorKind::Interrupted, _) => {}
                (ErrorKind::WouldBlock, _) => {
                    self.full_queue_count += 1;
                    self.wait_for(PollFlags::OUT, deadline)?;
                }
                // The queue of the interface; the kernel tells nobody when it has room again.
                (_, Some(NO_BUFFERS)) => {
                    self.full_queue_count += 1;
                    let again = MonotonicClock.now() + QUEUE_PAUSE;
                    if again > deadline {
                        return Err(PortError::TimedOut);
                    }
                    MonotonicClock.sleep_until(again);
                }
                (_, Some(INVALID)) => return Err(unfit()),
                _ => return Err(self.io_error(&error)),
            }
        }
    }

    fn receive(&mut self, deadline: Instant) -> Result<Heard, PortError> {
        loop {
            match self.socket.read_frame() {
                Ok(frame) => {
                    if let Some(heard) = from_socket(&frame) {
                        return Ok(heard);
                    }
                }
                Err(error) => match error.kind() {
                    ErrorKind::WouldBlock => self.wait_for(PollFlags::IN, deadline)?,
                    ErrorKind::Interrupted => {}
                    _ => return Err(self.io_error(&error)),
                },
            }
        }
    }
}

fn to_socket(frame: &CanFrame) -> Option<CanAnyFrame> {
    let number = frame.id().number();
    let id = if frame.id().is_extended() {
        ExtendedId::new(number).map(Id::Extended)?
    } else {
        u16::try_from(number).ok().and_then(StandardId::new).map(Id::Standard)?
    };
    Some(match frame.format() {
        Format::Classic => CanDataFrame::new(id, frame.payload())?.into(),
        Format::Remote { length } => CanRemoteFrame::new_remote(id, length.into())?.into(),
        Format::Fd { fast } => {
            let flags = if fast { FdFlags::BRS } else { FdFlags::empty() };
            CanFdFrame::with_flags(id, frame.payload(), flags)?.into()
        }
    })
}

/// None for what no CAN line carries.
fn from_socket(frame: &CanAnyFrame) -> Option<Heard> {
    let (format, payload) = match frame {
        CanAnyFrame::Error(report) => {
            return Some(Heard::Report(ErrorFrame::decode(report.error_bits(), report.data())));
        }
        CanAnyFrame::Normal(frame) => (Format::Classic, frame.data()),
        CanAnyFrame::Remote(frame) => {
            (Format::Remote { length: u8::try_from(frame.dlc()).ok()? }, &[][..])
        }
        CanAnyFrame::Fd(frame) => (Format::Fd { fast: frame.is_brs() }, frame.data()),
    };
    let number = frame.raw_id();
    let id = if frame.is_extended() { CanId::extended(number) } else { CanId::standard(number) };
    CanFrame::new(id?, format, payload).map(Heard::Frame)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interface_is_claimed_by_one_at_a_time() {
        let first = claim("nocan8").expect("nobody holds it");
        assert_eq!(claim("nocan8").err(), Some(PortError::Busy("nocan8".to_owned())));
        claim("nocan9").expect("another");
        drop(first);
        claim("nocan8").expect("free again");
    }

    #[test]
    fn a_missing_interface_is_named_in_the_error() {
        let Err(error) = CanInterface::open("nocan7") else { panic!("there is no nocan7") };
        assert!(error.to_string().contains("nocan7"), "{error}");
        let Err(error) = state("nocan7") else { panic!("there is no nocan7") };
        assert!(error.to_string().contains("nocan7"), "{error}");
    }

    #[test]
    fn frames_of_every_format_pass_the_sockets_types_unchanged() {
        let standard = CanId::standard(0x7FF).expect("fits");
        let extended = CanId::extended(0x1F).expect("fits");
        for (id, format, payload) in [
            (standard, Format::Classic, &[1, 2, 3][..]),
            (extended, Format::Classic, &[]),
            (standard, Format::Remote { length: 8 }, &[]),
            (standard, Format::Fd { fast: false }, &[7; 12]),
            (extended, Format::Fd { fast: true }, &[9; 64]),
        ] {
            let frame = CanFrame::new(id, format, payload).expect("fits");
            let socket = to_socket(&frame).expect("fits there too");
            assert_eq!(from_socket(&socket), Some(Heard::Frame(frame)));
        }
    }
}
