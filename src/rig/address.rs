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
    /// A CAN line behind an adapter that speaks slcan on a serial line, with what the user said of its speeds.
    Slcan {
        /// Where the adapter is: a serial port, or what is behind a TCP port.
        adapter: Box<Self>,
        /// Bit rate of the CAN line, bit/s; absent: the robot file's.
        bitrate_bps: Option<u32>,
        /// Bit rate of fast payloads (CAN FD), bit/s; absent: the robot file's.
        data_bitrate_bps: Option<u32>,
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

    /// True for a CAN line: an interface, or an adapter on a serial line.
    #[must_use]
    pub const fn is_can(&self) -> bool {
        matches!(self, Self::Can { .. } | Self::Slcan { .. })
    }

    /// The speed of a serial line that the user gave, bits per second.
    #[must_use]
    pub const fn baud_bps(&self) -> Option<u32> {
        match self {
            Self::Sim | Self::SimPty | Self::Can { .. } | Self::Slcan { .. } => None,
            Self::Serial { baud_bps, .. } | Self::Tcp { baud_bps, .. } => *baud_bps,
        }
    }
}

const ALLOWED: &str = "sim, sim:pty, serial:/dev/ttyUSB0, serial:/dev/ttyUSB0?baud=1000000, \
                       tcp:host:port, can:can0 or can:slcan:/dev/ttyACM0, each with LINE= before it if the robot has several lines";

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
                let slcan = || bus.strip_prefix("can:slcan:").and_then(slcan_bus);
                let can = || bus.strip_prefix("can:").and_then(can_bus);
                serial.or_else(tcp).or_else(slcan).or_else(can).ok_or_else(unknown)?
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
            Self::Slcan { adapter, bitrate_bps, data_bitrate_bps } => {
                write!(f, "can:slcan:")?;
                match &**adapter {
                    Self::Tcp { place, .. } => write!(f, "tcp:{place}"),
                    Self::Serial { path, .. } => f.write_str(path),
                    _ => Ok(()),
                }?;
                let said = [
                    ("bitrate", *bitrate_bps),
                    ("dbitrate", *data_bitrate_bps),
                    ("baud", adapter.baud_bps()),
                ];
                let said = said.iter().filter_map(|(key, bps)| Some((key, (*bps)?)));
                return said
                    .zip(std::iter::once('?').chain(std::iter::repeat('&')))
                    .try_for_each(|((key, bps), before)| write!(f, "{before}{key}={bps}"));
            }
        }?;
        self.baud_bps().map_or(Ok(()), |baud_bps| write!(f, "?baud={baud_bps}"))
    }
}

/// Names of interfaces have at most 15 bytes, no slash, no colon and no blank (the kernel's `dev_valid_name`).
fn can_bus(name: &str) -> Option<BusKind> {
    let fits = (1..=15).contains(&name.len());
    let unusable = |c: char| matches!(c, '/' | '?' | ':') || c.is_whitespace();
    let usable = fits && !name.contains(unusable);
    usable.then(|| BusKind::Can { interface: name.to_owned() })
}

/// `PLACE?bitrate=N&dbitrate=N&baud=N`: PLACE is a path or `tcp:HOST:PORT`, of the rest any or none.
fn slcan_bus(text: &str) -> Option<BusKind> {
    let (place, query) = text.split_once('?').map_or((text, None), |(at, of)| (at, Some(of)));
    let (mut bitrate_bps, mut data_bitrate_bps, mut baud) = (None, None, None);
    for part in query.into_iter().flat_map(|query| query.split('&')) {
        let (key, number) = part.split_once('=')?;
        let number: u32 = number.parse().ok().filter(|&bps| bps > 0)?;
        let known = match key {
            "bitrate" => &mut bitrate_bps,
            "dbitrate" => &mut data_bitrate_bps,
            "baud" => &mut baud,
            _ => return None,
        };
        if known.replace(number).is_some() {
            return None;
        }
    }
    let baud = baud.map_or_else(String::new, |baud| format!("?baud={baud}"));
    let adapter = match place.strip_prefix("tcp:") {
        Some(place) => tcp_bus(&format!("{place}{baud}"))?,
        None => serial_bus(&format!("{}{baud}", place.strip_prefix("serial:").unwrap_or(place)))?,
    };
    Some(BusKind::Slcan { adapter: Box::new(adapter), bitrate_bps, data_bitrate_bps })
}

/// What to do about an address of which one part is wrong.
fn wrong_part(text: &str) -> Option<&'static str> {
    // An interface has no colon in its name: what has one was meant for an adapter.
    let small = text.to_ascii_lowercase();
    let can = small.strip_prefix("can:").is_some_and(|place| place.contains(':'));
    if can || small.contains("slcan:") {
        return Some(
            "write can:slcan:/dev/ttyACM0, behind it if needed ?bitrate=N (bit/s of the CAN line), dbitrate=N (of \
             fast payloads) or baud=N (of the serial line), with & between them",
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

    fn slcan(adapter: BusKind, bitrate: Option<u32>, data_bitrate: Option<u32>) -> BusKind {
        let adapter = Box::new(adapter);
        BusKind::Slcan { adapter, bitrate_bps: bitrate, data_bitrate_bps: data_bitrate }
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
            ("can:slcan", None, BusKind::Can { interface: "slcan".to_owned() }),
            ("can:slcan:/dev/ttyACM0", None, slcan(serial("/dev/ttyACM0", None), None, None)),
            (
                "legs=can:slcan:/dev/a?bitrate=500000&dbitrate=2000000&baud=115200",
                Some("legs"),
                slcan(serial("/dev/a", Some(115_200)), Some(500_000), Some(2_000_000)),
            ),
            (
                "can:slcan:tcp:10.0.0.2:4000?bitrate=250000",
                None,
                slcan(tcp("10.0.0.2:4000", None), Some(250_000), None),
            ),
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
            "can:slcan:",
            "can:slcan:/dev/a?bitrate=0",
            "can:slcan:/dev/a?speed=8",
            "can:slcan:/dev/a?bitrate=1&bitrate=2",
            "can:slcan:tcp:host",
            "slcan:/dev/a",
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

    #[test]
    fn what_is_nearly_an_slcan_adapter_is_told_how_one_is_written() {
        for text in ["can:slcna:/dev/a", "CAN:SLCAN:/dev/a", "slcan:/dev/a", "can:slcan:tcp:host"] {
            let error = text.parse::<Address>().expect_err(text).to_string();
            assert!(error.contains("write can:slcan:/dev/ttyACM0"), "{text}: {error}");
        }
        let error = "can:a/b".parse::<Address>().expect_err("no name").to_string();
        assert!(!error.contains("write can:slcan:"), "{error}");
    }
}
