//! Where a robot is reached: the value of `--bus`.

use crate::error::Error;
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
}

const ALLOWED: &str = "sim, sim:pty, serial:/dev/ttyUSB0 or serial:/dev/ttyUSB0?baud=1000000, \
                       each with LINE= before it if the robot has several lines";

impl FromStr for Address {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let unknown = || Error::new("not a bus I know").at("--bus").got(text).allowed(ALLOWED);
        let (line, bus) = match text.split_once('=') {
            // An `=` after `?` belongs to the bus, not to a line name.
            Some((name, bus)) if !name.contains(['?', '/', ':']) => (Some(name.to_owned()), bus),
            _ => (None, text),
        };
        let bus = match bus {
            "sim" => BusKind::Sim,
            "sim:pty" => BusKind::SimPty,
            _ => {
                let serial = bus.strip_prefix("serial:");
                let bare = (bus.contains('/') && !bus.contains(':')).then_some(bus);
                serial_bus(serial.or(bare).ok_or_else(unknown)?).ok_or_else(unknown)?
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
        match &self.bus {
            BusKind::Sim => f.write_str("sim"),
            BusKind::SimPty => f.write_str("sim:pty"),
            BusKind::Serial { path, baud_bps: None } => write!(f, "serial:{path}"),
            BusKind::Serial { path, baud_bps: Some(baud) } => {
                write!(f, "serial:{path}?baud={baud}")
            }
        }
    }
}

fn serial_bus(text: &str) -> Option<BusKind> {
    let (path, query) = match text.split_once('?') {
        Some((path, query)) => (path, Some(query)),
        None => (text, None),
    };
    if path.is_empty() {
        return None;
    }
    let baud_bps = match query {
        Some(query) => {
            let baud = query.strip_prefix("baud=")?.parse().ok().filter(|&baud| baud > 0)?;
            Some(baud)
        }
        None => None,
    };
    Some(BusKind::Serial { path: path.to_owned(), baud_bps })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn serial(path: &str, baud_bps: Option<u32>) -> BusKind {
        BusKind::Serial { path: path.to_owned(), baud_bps }
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
        ] {
            let address: Address = text.parse().unwrap_or_else(|e| panic!("{text}: {e}"));
            assert_eq!((address.line.as_deref(), address.bus), (line, bus), "{text}");
        }
    }

    #[test]
    fn anything_else_is_refused_with_the_allowed_forms() {
        for text in ["", "simm", "serial:", "serial:/a?baud=0", "serial:/a?x=1", "=sim", "usb:1"] {
            let error = text.parse::<Address>().expect_err(text);
            assert!(error.to_string().contains("serial:/dev/ttyUSB0"), "{error}");
        }
    }
}
