//! Where a robot is reached: the value of `--bus`.

use crate::error::{Error, ErrorKind};
use std::fmt;
use std::str::FromStr;

/// One `--bus [NAME=]BUS`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Address {
    /// Line of the robot file; absent: its only line.
    pub line: Option<String>,
    /// What is behind it.
    pub bus: BusKind,
}

/// Kinds of buses.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum BusKind {
    /// A virtual robot inside this process, in virtual time.
    Sim,
    /// A virtual robot of this process behind a pseudo-terminal, in real time.
    SimPty,
    /// A serial port, with a line speed of its own if the user gave one.
    Serial {
        /// Device path.
        path: String,
        /// Bits per second; absent: the robot file's.
        baud_bps: Option<u32>,
    },
    /// A CAN interface of the system, set up with its speeds beforehand.
    Can {
        /// Its name, e.g. `can0`.
        interface: String,
    },
    /// A serial line behind a TCP port.
    Tcp {
        /// `host:port`.
        place: String,
        /// Speed of the line at the other end, bits per second; absent: the robot file's.
        baud_bps: Option<u32>,
    },
}

impl BusKind {
    /// True for a virtual robot of this process.
    #[must_use]
    pub const fn is_virtual(&self) -> bool {
        matches!(self, Self::Sim | Self::SimPty)
    }

    /// True for a CAN interface.
    #[must_use]
    pub const fn is_can(&self) -> bool {
        matches!(self, Self::Can { .. })
    }

    /// The line speed the user gave, bits per second.
    #[must_use]
    pub const fn baud_bps(&self) -> Option<u32> {
        match self {
            Self::Sim | Self::SimPty | Self::Can { .. } => None,
            Self::Serial { baud_bps, .. } | Self::Tcp { baud_bps, .. } => *baud_bps,
        }
    }
}

const ALLOWED: &str = "sim, sim:pty, serial:/dev/ttyUSB0, serial:/dev/ttyUSB0?baud=1000000, \
                       tcp:host:port or can:can0, each with LINE= before it if the robot has several lines";

impl FromStr for Address {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let unknown = || {
            let unknown = Error::of(ErrorKind::Unknown, "not the address of a bus");
            let unknown = unknown.at("the bus").got(text).allowed(ALLOWED);
            match wrong_part(text) {
                Some(remedy) => unknown.remedy(remedy),
                None => unknown,
            }
        };
        let (line, bus) = match text.split_once('=') {
            // An `=` after `?` belongs to the bus, not to a line name.
            Some((name, bus)) if !name.contains(['?', '/', ':']) => (Some(name.to_owned()), bus),
            _ => (None, text),
        };
        let bus = match bus {
            "sim" => BusKind::Sim,
            "sim:pty" => BusKind::SimPty,
            _ => {
                let bare = bus.starts_with(['/', '.']).then_some(bus);
                let serial = bus.strip_prefix("serial:").or(bare).and_then(serial_bus);
                let tcp = || bus.strip_prefix("tcp:").and_then(tcp_bus);
                let can = || bus.strip_prefix("can:").and_then(can_bus);
                serial.or_else(tcp).or_else(can).ok_or_else(unknown)?
            }
        };
        if line.as_deref() == Some("") {
            return Err(unknown());
        }
        Ok(Self { line, bus })
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(line) = &self.line {
            write!(f, "{line}=")?;
        }
        self.bus.fmt(f)
    }
}

impl fmt::Display for BusKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Sim => f.write_str("sim"),
            Self::SimPty => f.write_str("sim:pty"),
            Self::Serial { path, .. } => write!(f, "serial:{path}"),
            Self::Can { interface } => write!(f, "can:{interface}"),
            Self::Tcp { place, .. } => write!(f, "tcp:{place}"),
        }?;
        self.baud_bps().map_or(Ok(()), |baud_bps| write!(f, "?baud={baud_bps}"))
    }
}

/// Names of interfaces have at most 15 bytes, no slash and no blank (`netdevice(7)`).
fn can_bus(name: &str) -> Option<BusKind> {
    let fits = (1..=15).contains(&name.len());
    let usable = fits && !name.contains(|c: char| c == '/' || c == '?' || c.is_whitespace());
    usable.then(|| BusKind::Can { interface: name.to_owned() })
}

/// What to do about an address of which one part is wrong.
fn wrong_part(text: &str) -> Option<&'static str> {
    if text.contains("slcan:") {
        return Some(
            "slcand makes a CAN interface of an slcan adapter: sudo slcand -o -s8 /dev/ttyACM0 can0, sudo ip link \
             set can0 up, then can:can0",
        );
    }
    let (place, query) = text.split_once('?').map_or((text, None), |(at, of)| (at, Some(of)));
    if query.is_some_and(|query| with_speed(&format!("?{query}")).is_none()) {
        return Some(
            "write ?baud=N, N a whole number of bits per second, and nothing else behind ?",
        );
    }
    let is_tcp = place.starts_with("tcp:") || place.contains("=tcp:");
    is_tcp.then_some("write tcp:HOST:PORT, PORT from 1 to 65535")
}

fn serial_bus(text: &str) -> Option<BusKind> {
    let (path, baud_bps) = with_speed(text)?;
    Some(BusKind::Serial { path, baud_bps })
}

fn tcp_bus(text: &str) -> Option<BusKind> {
    let (place, baud_bps) = with_speed(text)?;
    let (host, port) = place.rsplit_once(':')?;
    let usable = !host.is_empty() && port.parse::<u16>().is_ok_and(|port| port > 0);
    usable.then_some(BusKind::Tcp { place, baud_bps })
}

/// What stands before `?baud=N`, and N.
fn with_speed(text: &str) -> Option<(String, Option<u32>)> {
    let (place, query) = match text.split_once('?') {
        Some((place, query)) => (place, Some(query)),
        None => (text, None),
    };
    let baud_bps = match query {
        Some(query) => {
            Some(query.strip_prefix("baud=")?.parse().ok().filter(|&baud: &u32| baud > 0)?)
        }
        None => None,
    };
    (!place.is_empty()).then(|| (place.to_owned(), baud_bps))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn serial(path: &str, baud_bps: Option<u32>) -> BusKind {
        BusKind::Serial { path: path.to_owned(), baud_bps }
    }

    fn tcp(place: &str, baud_bps: Option<u32>) -> BusKind {
        BusKind::Tcp { place: place.to_owned(), baud_bps }
    }

    #[test]
    fn every_form_of_the_manual_is_read() {
        for (text, line, bus) in [
            ("sim", None, BusKind::Sim),
            ("sim:pty", None, BusKind::SimPty),
            ("serial:/dev/ttyUSB0", None, serial("/dev/ttyUSB0", None)),
            ("/dev/ttyACM0", None, serial("/dev/ttyACM0", None)),
            ("serial:/tmp/op3?baud=1000000", None, serial("/tmp/op3", Some(1_000_000))),
            ("legs=serial:/dev/a?baud=9600", Some("legs"), serial("/dev/a", Some(9600))),
            ("arms=sim", Some("arms"), BusKind::Sim),
            (
                "/dev/serial/by-path/pci-0000:00:14.0",
                None,
                serial("/dev/serial/by-path/pci-0000:00:14.0", None),
            ),
            ("tcp:robot.local:4000", None, tcp("robot.local:4000", None)),
            ("tcp:[::1]:4000?baud=57600", None, tcp("[::1]:4000", Some(57_600))),
            ("legs=tcp:10.0.0.2:4000", Some("legs"), tcp("10.0.0.2:4000", None)),
            ("can:can0", None, BusKind::Can { interface: "can0".to_owned() }),
            ("legs=can:vcan1", Some("legs"), BusKind::Can { interface: "vcan1".to_owned() }),
        ] {
            let address: Address = text.parse().unwrap_or_else(|e| panic!("{text}: {e}"));
            let again: Address = address.to_string().parse().expect("what it prints is read");
            assert_eq!(again, address);
            assert_eq!((address.line.as_deref(), address.bus), (line, bus), "{text}");
        }
    }

    #[test]
    fn anything_else_is_refused_with_the_allowed_forms() {
        for text in [
            "",
            "simm",
            "serial:",
            "serial:/a?baud=0",
            "serial:/a?x=1",
            "=sim",
            "usb:1",
            "tcp:4000",
            "tcp::1",
            "tcp:a:b",
            "can:",
            "can:a/b",
            "can:can0?baud=1",
            "can:sixteen-letters-",
        ] {
            let error = text.parse::<Address>().expect_err(text);
            assert!(error.to_string().contains("serial:/dev/ttyUSB0"), "{error}");
        }
    }
}
