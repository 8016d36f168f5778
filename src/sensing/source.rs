//! `[NAME=]KIND@BUS`: what a source is and where.

use super::imu::SerialImu;
use super::intake::Intake;
use super::lines::TextLines;
use super::natnet::Bodies;
use super::slimevr::Trackers;
use crate::error::{Error, ErrorKind};
use crate::rig::{Address, SameDevice, open_stream};
use gaitway_profiles::{Sensor, SensorProtocol};
use std::net::{Ipv4Addr, SocketAddr};
use std::str::FromStr;

/// A source as it was typed.
#[derive(Clone, Debug)]
pub struct Source {
    /// All of it.
    pub text: String,
    /// Its name, if it was given one.
    pub name: Option<String>,
    /// What it is, and where.
    pub what: What,
}

/// Kinds of sources.
#[derive(Clone, Debug)]
pub enum What {
    /// An inertial sensor on a stream of bytes.
    Imu {
        /// Its profile, by name or path.
        profile: String,
        /// Where it is.
        address: Address,
    },
    /// Trackers that send datagrams, or bodies that a server streams.
    Trackers {
        /// Their profile.
        profile: String,
        /// Where they are listened for; of a server, where that is or the multicast group that it streams to.
        listen: SocketAddr,
    },
    /// Lines of text.
    Lines {
        /// Where they come from.
        address: Address,
    },
    /// A robot's joints.
    Servos {
        /// The robot, by name or path of its file.
        robot: String,
        /// Where its lines are.
        addresses: Vec<Address>,
    },
}

const ALLOWED: &str = "imu:PROFILE@serial:/dev/ttyUSB0, imu:slimevr@udp:0.0.0.0:6969, \
                       imu:natnet@udp:192.168.1.10:1510, lines@/dev/ttyACM0?baud=115200 or servos:ROBOT@BUS, each with NAME= before it";

impl FromStr for Source {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let unknown =
            || Error::of(ErrorKind::Unknown, "not a source of samples").got(text).allowed(ALLOWED);
        let (name, rest) = match text.split_once('=') {
            Some((name, rest)) if is_name(name) => (Some(name.to_owned()), rest),
            _ => (None, text),
        };
        let (kind, bus) = rest.split_once('@').ok_or_else(unknown)?;
        let (kind, which) = kind.split_once(':').unwrap_or((kind, ""));
        let what = match (kind, which.is_empty()) {
            ("imu", false) => match bus.strip_prefix("udp:") {
                Some(listen) => What::Trackers {
                    profile: which.to_owned(),
                    listen: socket(listen).ok_or_else(unknown)?,
                },
                None => What::Imu { profile: which.to_owned(), address: bus.parse()? },
            },
            ("lines", true) => What::Lines { address: bus.parse()? },
            ("servos", false) => {
                let addresses = bus.split(',').map(str::parse).collect::<Result<_, _>>()?;
                What::Servos { robot: which.to_owned(), addresses }
            }
            _ => return Err(unknown()),
        };
        Ok(Self { text: text.to_owned(), name, what })
    }
}

fn is_name(name: &str) -> bool {
    let fits = |byte: u8| byte.is_ascii_alphanumeric() || matches!(byte, b'-' | b'_');
    !name.is_empty() && name.bytes().all(fits)
}

/// A port of this machine alone, or an address: `0.0.0.0:PORT` is open to the network.
fn socket(text: &str) -> Option<SocketAddr> {
    let port = text.strip_prefix("localhost:").unwrap_or(text).parse::<u16>();
    let own = port.map(|port| SocketAddr::from((Ipv4Addr::LOCALHOST, port)));
    own.or_else(|_| text.parse()).ok()
}

/// A source that is open.
pub enum Opened {
    /// An inertial sensor.
    Imu(Box<SerialImu>),
    /// Trackers.
    Trackers(Box<Trackers>),
    /// Bodies that a server streams.
    Bodies(Box<Bodies>),
    /// Lines of text.
    Lines(Box<TextLines>),
}

impl Opened {
    /// Records until it is to stop.
    pub fn record(self, intake: &Intake) {
        match self {
            Self::Imu(imu) => imu.record(intake),
            Self::Trackers(trackers) => trackers.record(intake),
            Self::Bodies(bodies) => bodies.record(intake),
            Self::Lines(lines) => lines.record(intake),
        }
    }
}

/// Line speed of text if the address says none.
const TEXT_BAUD_BPS: u32 = 115_200;

impl Source {
    /// Fails if nobody can wear what it is.
    ///
    /// # Errors
    /// Lines of text, servos.
    pub fn check_wearable(&self) -> Result<(), Error> {
        match self.what {
            What::Imu { .. } | What::Trackers { .. } => Ok(()),
            What::Lines { .. } | What::Servos { .. } => {
                Err(Error::new("this source cannot be worn")
                    .got(self.text.clone())
                    .allowed("imu:PROFILE@BUS, e.g. left_thigh=imu:bno08x-rvc@/dev/ttyUSB0"))
            }
        }
    }

    /// Opens a source that is no robot. `worn` are the names of all sensors that are worn, as far as
    /// that was said.
    ///
    /// # Errors
    /// An unknown profile, one that does not fit the bus, a port that cannot be opened.
    pub fn open(&self, worn: &[String]) -> Result<Opened, Error> {
        let mismatch = |remedy: &str| {
            Error::new("the profile and the bus do not fit together")
                .at(self.text.clone())
                .remedy(remedy)
        };
        match &self.what {
            What::Imu { profile, address } => {
                let sensor = load(profile)?;
                let Some(baud_bps) = sensor.baud_bps else {
                    return Err(mismatch(match sensor.protocol {
                        SensorProtocol::Natnet => {
                            "Motive streams UDP: imu:natnet@udp:192.168.1.10:1510, its address"
                        }
                        _ => "SlimeVR trackers send UDP: imu:slimevr@udp:0.0.0.0:6969",
                    }));
                };
                let port = open_stream(address, baud_bps)?;
                let name = self.name.clone().unwrap_or_else(|| sensor.name.clone());
                let device = SameDevice::at(address, baud_bps);
                let again = Box::new(move || device.open());
                let imu = SerialImu::new(name, &self.text, sensor, port, again);
                imu.map(|imu| Opened::Imu(Box::new(imu)))
            }
            What::Trackers { profile, listen } => {
                let sensor = load(profile)?;
                let name = self.name.clone();
                match sensor.protocol {
                    SensorProtocol::Slimevr => {
                        let name = name.unwrap_or_else(|| "tracker".to_owned());
                        let trackers = Trackers::open(name, sensor, *listen, worn)?;
                        Ok(Opened::Trackers(Box::new(trackers)))
                    }
                    SensorProtocol::Natnet => {
                        let bodies = Bodies::open(name, sensor, *listen, worn)?;
                        Ok(Opened::Bodies(Box::new(bodies)))
                    }
                    _ => Err(mismatch("only SlimeVR trackers and Motive (natnet) send UDP")),
                }
            }
            What::Lines { address } => {
                let port = open_stream(address, TEXT_BAUD_BPS)?;
                let name = self.name.clone().unwrap_or_else(|| "lines".to_owned());
                Ok(Opened::Lines(Box::new(TextLines::new(name, &self.text, port))))
            }
            What::Servos { .. } => {
                Err(Error::new("a robot is not a stream of samples").at(self.text.clone()))
            }
        }
    }
}

fn load(profile: &str) -> Result<Sensor, Error> {
    gaitway_profiles::sensor(profile).map_err(|error| Error::new(error.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sources_are_read_and_others_refused_with_the_allowed_forms() {
        let source = |text: &str| text.parse::<Source>().unwrap_or_else(|e| panic!("{text}: {e}"));
        let imu = source("left=imu:bno08x-rvc@/dev/ttyUSB0");
        assert_eq!(imu.name.as_deref(), Some("left"));
        assert!(matches!(imu.what, What::Imu { profile, .. } if profile == "bno08x-rvc"));
        let own = source("imu:./mine.toml@serial:/dev/ttyACM0?baud=9600");
        assert!(matches!(own.what, What::Imu { profile, address }
            if profile == "./mine.toml" && address.bus.baud_bps() == Some(9600)));
        let trackers = source("imu:slimevr@udp:6969");
        assert!(matches!(trackers.what, What::Trackers { listen, .. } if listen.port() == 6969));
        for (text, listens) in [
            ("6969", "127.0.0.1:6969"),
            ("localhost:6969", "127.0.0.1:6969"),
            ("0.0.0.0:6969", "0.0.0.0:6969"),
            ("192.168.1.5:7000", "192.168.1.5:7000"),
            ("[::1]:6969", "[::1]:6969"),
        ] {
            let listens: SocketAddr = listens.parse().expect("an address");
            assert_eq!(socket(text), Some(listens), "{text}");
        }
        assert!(matches!(source("lines@/dev/ttyACM0").what, What::Lines { .. }));
        assert!(matches!(source("servos:op3@sim:pty").what, What::Servos { .. }));
        for text in ["", "imu@/dev/x", "imu:a", "lines:x@/dev/x", "servos@sim", "imu:a@udp:x"] {
            assert!(text.parse::<Source>().is_err(), "{text}");
        }
    }
}
