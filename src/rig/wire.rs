//! Real lines: serial ports, TCP connections, CAN interfaces, and what is known of the adapter.

use super::address::{Address, BusKind};
use crate::error::{Error, ErrorKind};
use crate::port::can::{self, CanInterface, Controller};
use crate::port::inventory::Machine;
use crate::port::serial::SerialLine;
use crate::port::tcp::TcpLine;
use crate::port::{BytePort, FramePort, PortError};
use crate::time::Duration;
use gaitway_profiles::{CanSpeed, LineKind};

/// Held back by a USB adapter that says nothing of itself, or by a pseudo-terminal's scheduling.
pub(super) const UNKNOWN_LATENCY: Duration = Duration::from_millis(5);
/// Held back by a USB-CAN adapter: two frames of USB.
pub(super) const CAN_LATENCY: Duration = Duration::from_millis(2);
/// There and back on a local network that is not idle.
const NETWORK_LATENCY: Duration = Duration::from_millis(20);

pub(super) fn wrong_kind(line: &str, kind: LineKind, bus: &BusKind) -> Error {
    let allowed = match kind {
        LineKind::Can(_) => "a CAN line, e.g. can:can0 or can:slcan:/dev/ttyACM0",
        LineKind::Serial { .. } => "a serial line, e.g. serial:/dev/ttyUSB0 or tcp:host:port",
    };
    Error::new("the line is of another kind than the bus")
        .at(format!("--bus for line {line}"))
        .got(bus.to_string())
        .allowed(allowed)
}

/// A CAN interface that is up and runs at the line's speeds, as far as the kernel tells.
pub(super) fn interface_at(interface: &str, speed: CanSpeed) -> Result<Box<dyn FramePort>, Error> {
    let place = || format!("can:{interface}");
    let setup = match speed.data_bitrate_bps {
        Some(fast) => {
            format!("type can bitrate {} dbitrate {fast} fd on", speed.bitrate_bps)
        }
        None => format!("type can bitrate {}", speed.bitrate_bps),
    };
    let remedy =
        || format!("ip link set {interface} down; ip link set {interface} up {setup} (as root)");
    let found = can::state(interface).map_err(|e| {
        Error::of(ErrorKind::Absent, "there is no such CAN interface")
            .at(place())
            .got(spoken(&e))
            .remedy("plug the adapter in; `ip link` and `gaitway ports` list what is there")
    })?;
    let refuse = |what: &str, got: String, allowed: String| {
        Err(Error::new(what).at(place()).got(got).allowed(allowed).remedy(remedy()))
    };
    if !found.up {
        return refuse("the CAN interface is down", "down".into(), "up".into());
    }
    if found.controller == Some(Controller::BusOff) {
        return refuse("the CAN controller has left the line", "bus off".into(), "active".into());
    }
    // A virtual interface has no speed.
    if let Some(bps) = found.bitrate_bps.filter(|&bps| bps != speed.bitrate_bps) {
        let allowed = format!("{} bit/s", speed.bitrate_bps);
        return refuse("the CAN interface runs at another speed", format!("{bps} bit/s"), allowed);
    }
    if let Some(fast) = speed.data_bitrate_bps {
        if !found.fd {
            return refuse("the CAN interface carries no CAN FD", "classic".into(), "fd on".into());
        }
        if let Some(bps) = found.data_bitrate_bps.filter(|&bps| bps != fast) {
            let got = format!("dbitrate {bps}");
            return refuse("the CAN interface has another data speed", got, fast.to_string());
        }
    }
    let mut port = CanInterface::open(interface).map_err(|e| {
        Error::of(ErrorKind::Io, "the CAN interface cannot be opened").at(place()).got(spoken(&e))
    })?;
    port.claim().map_err(|e| match e {
        PortError::Busy(_) => {
            Error::of(ErrorKind::Busy, "the CAN interface is in use by another gaitway")
                .at(place())
                .remedy("end the other command first: two hosts would fight over the actuators")
        }
        e => Error::of(ErrorKind::Io, "the CAN interface cannot be claimed")
            .at(place())
            .got(spoken(&e)),
    })?;
    Ok(Box::new(port))
}

/// True if the adapter behind a serial port is known to let the host hear its own bytes.
pub(super) fn echoes(bus: &BusKind) -> Result<bool, Error> {
    let BusKind::Serial { path, .. } = bus else { return Ok(false) };
    let port = Machine::default().serial_port_at(path);
    let Some((vendor, product)) = port.and_then(|port| port.usb?.ids()) else {
        return Ok(false);
    };
    Ok(gaitway_profiles::adapter_for_usb(vendor, product)?.is_some_and(|adapter| adapter.echo))
}

/// A real line at `baud_bps`, and the time its adapter may hold bytes back.
pub(super) fn wire(bus: &BusKind, baud_bps: u32) -> Result<(Box<dyn BytePort>, Duration), Error> {
    match bus {
        BusKind::Tcp { place, .. } => {
            let port = TcpLine::open(place).map_err(|e| {
                Error::of(ErrorKind::Absent,"the connection is not accepted")
                    .at(format!("tcp:{place}"))
                    .got(spoken(&e))
                    .remedy("check host and port; the other end must run already, e.g. gaitway simulate")
            })?;
            Ok((Box::new(port), NETWORK_LATENCY))
        }
        BusKind::Serial { path, .. } => {
            let port = SerialLine::open(path, baud_bps).map_err(|e| port_error(path, &e))?;
            let latency = SerialLine::latency_timer_s(path).filter(|s| (0.0..1.0).contains(s));
            Ok((Box::new(port), latency.map_or(UNKNOWN_LATENCY, Duration::from_secs_f64)))
        }
        BusKind::Can { .. } | BusKind::Slcan { .. } => {
            Err(Error::new("a CAN line is not a serial line")
                .at(bus.to_string())
                .allowed("serial:/dev/ttyUSB0 or tcp:host:port"))
        }
        BusKind::Sim | BusKind::SimPty => Err(Error::new("a virtual robot has no real line")),
    }
}

/// A serial line that is only listened to, at `baud_bps` unless the address says another speed.
///
/// # Errors
/// A virtual robot, which is no stream; a port that cannot be opened.
pub fn open_stream(address: &Address, baud_bps: u32) -> Result<Box<dyn BytePort>, Error> {
    if address.bus.is_virtual() {
        return Err(Error::new("a virtual robot sends no stream")
            .at(address.to_string())
            .allowed("serial:/dev/ttyUSB0 or tcp:host:port"));
    }
    Ok(wire(&address.bus, address.bus.baud_bps().unwrap_or(baud_bps))?.0)
}

pub(super) fn port_error(path: &str, error: &PortError) -> Error {
    let place = format!("port {path}");
    match error {
        PortError::Gone(text) => Error::of(ErrorKind::Absent, "there is no such port")
            .at(place)
            .got(text.clone())
            .remedy("plug the adapter in; `gaitway ports` lists what is there"),
        PortError::Denied(_) => Error::of(ErrorKind::NoAccess, "no permission to open the port")
            .at(place)
            .remedy("install the udev rules: `gaitway doctor` says how, and what else is missing"),
        PortError::Busy(text) => {
            Error::of(ErrorKind::Busy, "the port is in use by another program")
                .at(place)
                .got(text.clone())
                .remedy("end the other program; `fuser -v PORT` names it")
        }
        other => Error::of(ErrorKind::Io, "the port cannot be opened as a serial line")
            .at(place)
            .got(spoken(other).replace("Not a typewriter", "it is no terminal"))
            .allowed("a serial port, e.g. /dev/ttyUSB0, or the terminal of gaitway simulate")
            .remedy("`gaitway ports` lists what is there"),
    }
}

/// What the operating system said, without a word before it.
pub(super) fn spoken(error: &PortError) -> String {
    match error {
        PortError::Gone(text)
        | PortError::Denied(text)
        | PortError::Busy(text)
        | PortError::Io(text) => text.clone(),
        PortError::TimedOut => error.to_string(),
    }
}
