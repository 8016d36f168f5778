//! A virtual person who wears virtual sensors, each of which other programs open, in real time.

use super::person::Person;
use super::worn::{KnownStrap, Strapping, Worn, wire};
use crate::body::{Segment, segment_name, segment_named};
use crate::corpus::store::check_outside;
use crate::error::{Error, ErrorKind};
use crate::job::source::body_motion;
use crate::sensing::{Source, Wear, What};
use gaitway_profiles::Sensor;
use gaitway_sim::DoorError;
use gaitway_sim::imu::{ImuDoor, ImuWire, Stage, VirtualImu};
use std::fmt::Write;
use std::net::{SocketAddr, ToSocketAddrs};
use std::path::{Path, PathBuf};

/// First line of a file of what is worn; one that begins so is ours to write over.
const HEAD: &str = "# Which segment wears which virtual sensor, written by gaitway simulate imus";
/// Of a sensor whose profile names no rate of its line.
const USUAL_BAUD_BPS: u32 = 115_200;

/// Where virtual sensors are reached.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SensorDoors {
    /// A pseudo-terminal each, with a link in this folder that is named for the segment. The folder is
    /// made if it is not there.
    Terminals(PathBuf),
    /// They send to the server of `SlimeVR` trackers at `HOST:PORT`.
    SlimeVr(String),
}

/// Who wears what, and where it is reached.
#[derive(Clone, Debug, PartialEq)]
pub struct ImusOrder {
    /// What the person does after the calibration poses, as [`body_motion`] reads it.
    pub motion: String,
    /// Segments that wear a sensor; one that is named twice wears one.
    pub segments: Vec<Segment>,
    /// How sensors are worn, of those segments of which a file says it.
    pub known: Vec<KnownStrap>,
    /// What the others are: the name of a sensor's profile.
    pub profile: String,
    /// Where they are reached.
    pub doors: SensorDoors,
    /// Where to write which segment wears which sensor; `None`: `wear.toml` in the folder of the
    /// terminals, if there is one.
    pub wear_file: Option<PathBuf>,
    /// How long the person stands in N pose at first, and again before the motion, s.
    pub stand_s: f64,
    /// How the sensors are worn, and how good they are.
    pub strapping: Strapping,
    /// Seed of everything random.
    pub seed: u64,
}

/// One sensor that can be opened.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OpenSensor {
    /// Who wears it.
    pub segment: Segment,
    /// Path of its terminal, or its tracker's name.
    pub place: String,
}

/// Reads names of segments, one of which may be `all`.
///
/// # Errors
/// A name of none.
pub fn segments(typed: &[String]) -> Result<Vec<Segment>, Error> {
    if typed.iter().any(|name| name == "all") {
        return Ok(Segment::ALL.to_vec());
    }
    typed.iter().map(|name| segment_named(name).map_err(|e| e.at("--wear"))).collect()
}

/// Reads names of segments, one of which may be `all`, and files of what is worn (see [`Wear::of`]), whose segments wear sensors as
/// they say.
///
/// # Errors
/// A name of none, a file that does not say what is worn, a segment that two files name.
pub fn put_on(typed: &[String]) -> Result<(Vec<Segment>, Vec<KnownStrap>), Error> {
    let is_file = |text: &&String| text.ends_with(".toml");
    let files: Vec<String> = typed.iter().filter(is_file).cloned().collect();
    let names: Vec<String> = typed.iter().filter(|text| !is_file(text)).cloned().collect();
    let worn = Wear::of(Vec::new(), &files)?;
    let known = worn.places.iter().map(|place| {
        let is_own = |source: &&Source| source.name.as_ref() == Some(&place.sensor);
        let profile = worn.sources.iter().find(is_own).and_then(|source| match &source.what {
            What::Imu { profile, .. } => Some(profile.clone()),
            _ => None,
        });
        let tracker = tracker_address(&place.sensor);
        KnownStrap { segment: place.segment, profile, forward: place.forward, tracker }
    });
    let known: Vec<KnownStrap> = known.collect();
    let mut worn: Vec<Segment> = known.iter().map(|strap| strap.segment).collect();
    worn.extend(segments(&names)?);
    Ok((worn, known))
}

/// The last three bytes of the network address of a tracker with this name (`tracker-00aa01-0`).
fn tracker_address(name: &str) -> Option<[u8; 3]> {
    let digits = name.strip_prefix("tracker-")?.strip_suffix("-0")?;
    let byte = |at: usize| u8::from_str_radix(digits.get(2 * at..2 * at + 2)?, 16).ok();
    (digits.len() == 6).then_some([byte(0)?, byte(1)?, byte(2)?])
}

/// Somebody whose sensors can be opened. Dropping it ends them.
///
/// The performance begins when the first sensor is opened, and starts again once all were closed.
pub struct Wearer {
    person: Person,
    stage: Stage,
    sensors: Vec<OpenSensor>,
    wear_file: Option<PathBuf>,
    _doors: Vec<ImuDoor>,
}

impl Wearer {
    /// Straps the sensors on, opens their doors and writes down what is worn. A file of what is worn
    /// that somebody else wrote is kept: nothing is opened then.
    ///
    /// # Errors
    /// An unknown motion or profile, a profile that does not go with the way it is sent, a file that is
    /// in the way, or a folder, terminal or address that cannot be had.
    pub fn open(order: &ImusOrder) -> Result<Self, Error> {
        let sensor = gaitway_profiles::sensor(&order.profile)?;
        let mut way = Way::of(order, &sensor)?;
        let (capture, _) = body_motion(&order.motion, None, &Default::default())?;
        let person = Person::new(&capture, order.stand_s)?;
        let wear_file = wear_file(order)?;
        let stage = Stage::default();
        let (mut sensors, mut doors): (Vec<OpenSensor>, _) = (Vec::new(), Vec::new());
        let mut worn = Worn::new(&sensor, &order.known, order.strapping, order.seed)?;
        for &segment in &order.segments {
            if sensors.iter().any(|known| known.segment == segment) {
                continue;
            }
            let imu = worn.on(&person, segment).map_err(|e| e.at("--motion"))?;
            let (door, place) = way.open(&stage, segment, imu)?;
            doors.push(door);
            sensors.push(OpenSensor { segment, place });
        }
        write_wear(wear_file.as_deref(), &way)?;
        Ok(Self { person, stage, sensors, wear_file, _doors: doors })
    }

    /// Every sensor, in the order of the segments that were given.
    #[must_use]
    pub fn sensors(&self) -> &[OpenSensor] {
        &self.sensors
    }

    /// Where it was written which segment wears which sensor.
    #[must_use]
    pub fn wear_file(&self) -> Option<&Path> {
        self.wear_file.as_deref()
    }

    /// What the person does now, in a word or two; nothing while nobody listens.
    #[must_use]
    pub fn doing(&self) -> Option<&'static str> {
        self.stage.began().map(|began| self.person.doing(began.elapsed().as_secs_f64()))
    }
}

/// Writes down what is worn.
pub(super) fn write_wear(path: Option<&Path>, way: &Way) -> Result<(), Error> {
    let Some(path) = path else { return Ok(()) };
    check_outside(path)?;
    std::fs::write(path, &way.wear).map_err(|e| {
        Error::of(ErrorKind::Io, "cannot write the file")
            .at(path.display().to_string())
            .got(e.to_string())
    })
}

/// Where it will be written what is worn, if that may be written.
pub(super) fn wear_file(order: &ImusOrder) -> Result<Option<PathBuf>, Error> {
    let usual = || match &order.doors {
        SensorDoors::Terminals(folder) => Some(folder.join("wear.toml")),
        SensorDoors::SlimeVr(_) => None,
    };
    let Some(path) = order.wear_file.clone().or_else(usual) else { return Ok(None) };
    let is_ours = std::fs::read_to_string(&path).is_ok_and(|text| text.starts_with(HEAD));
    if path.exists() && !is_ours {
        return Err(Error::of(ErrorKind::Exists, "the file exists already")
            .at(path.display().to_string())
            .remedy("choose another folder, or another --wear-file"));
    }
    Ok(Some(path))
}

/// How sensors are reached, and what is written of it.
pub(super) struct Way {
    profile: String,
    known: Vec<KnownStrap>,
    to: To,
    wear: String,
}

enum To {
    Terminals { folder: PathBuf, baud_bps: u32 },
    SlimeVr(SocketAddr),
}

impl Way {
    pub(super) fn of(order: &ImusOrder, sensor: &Sensor) -> Result<Self, Error> {
        let misfit = |remedy: &str| {
            Error::new("the profile and the way it is sent do not fit together")
                .at("--profile")
                .got(order.profile.clone())
                .remedy(remedy.to_owned())
        };
        let mut wear = format!("{HEAD}\n");
        let to = match (&order.doors, wire(sensor)?) {
            (SensorDoors::Terminals(_), ImuWire::SlimeVr) => {
                return Err(misfit("SlimeVR trackers send UDP: --udp 127.0.0.1:6969"));
            }
            (SensorDoors::Terminals(folder), _) => {
                check_outside(folder)?;
                std::fs::create_dir_all(folder).map_err(|e| {
                    Error::of(ErrorKind::Io, "the folder cannot be made")
                        .at(folder.display().to_string())
                        .got(e.to_string())
                })?;
                let baud_bps = sensor.baud_bps.unwrap_or(USUAL_BAUD_BPS);
                To::Terminals { folder: folder.clone(), baud_bps }
            }
            (SensorDoors::SlimeVr(text), ImuWire::SlimeVr) => {
                let found = text.to_socket_addrs().ok().and_then(|mut all| all.next());
                let server = found.ok_or_else(|| {
                    Error::new("not an address").at("--udp").got(text.clone()).allowed("HOST:PORT")
                })?;
                let _ = writeln!(wear, "sources = [\"imu:slimevr@udp:{}\"]", server.port());
                To::SlimeVr(server)
            }
            (SensorDoors::SlimeVr(_), _) => {
                return Err(misfit("only SlimeVR trackers send UDP: use --pty DIR"));
            }
        };
        wear.push_str("[segments]\n");
        Ok(Self { profile: order.profile.clone(), known: order.known.clone(), to, wear })
    }

    /// Opens a sensor's door and notes what is worn; also gives where it is reached.
    pub(super) fn open(
        &mut self,
        stage: &Stage,
        segment: Segment,
        imu: VirtualImu,
    ) -> Result<(ImuDoor, String), Error> {
        let door = self.door(stage, segment, imu)?;
        let name = segment_name(segment);
        let known = self.known.iter().find(|strap| strap.segment == segment);
        let entry = |sensor: &str| match known.map(|strap| strap.forward) {
            None => format!("{name} = {sensor:?}\n"),
            Some(None) => format!("{name} = {{ sensor = {sensor:?}, forward = \"none\" }}\n"),
            Some(Some(ahead)) => {
                let [x, y, z] = ahead.to_array();
                format!("{name} = {{ sensor = {sensor:?}, forward = [{x:?}, {y:?}, {z:?}] }}\n")
            }
        };
        let place = match &self.to {
            To::SlimeVr(_) => {
                let [a, b, c] = self.address(segment);
                let tracker = format!("tracker-{a:02x}{b:02x}{c:02x}-0");
                self.wear.push_str(&entry(&tracker));
                tracker
            }
            To::Terminals { folder, .. } => {
                let link = folder.join(name);
                let path = std::path::absolute(&link).unwrap_or(link).display().to_string();
                let profile =
                    known.and_then(|strap| strap.profile.as_ref()).unwrap_or(&self.profile);
                self.wear.push_str(&entry(&format!("imu:{profile}@serial:{path}")));
                path
            }
        };
        Ok((door, place))
    }

    /// The last three bytes of a tracker's network address.
    fn address(&self, segment: Segment) -> [u8; 3] {
        let known = self.known.iter().find(|strap| strap.segment == segment);
        known.and_then(|strap| strap.tracker).unwrap_or([0, 0, number(segment)])
    }

    /// Opens a sensor's door, perhaps once more.
    pub(super) fn door(
        &self,
        stage: &Stage,
        segment: Segment,
        imu: VirtualImu,
    ) -> Result<ImuDoor, Error> {
        match &self.to {
            To::SlimeVr(server) => {
                // The second bit of a network address: given by whoever runs the network.
                let [a, b, c] = self.address(segment);
                let mac = [2, 0, 0, a, b, c];
                ImuDoor::open_slimevr(stage, imu, *server, mac)
                    .map_err(|e| closed(&server.to_string(), &e))
            }
            To::Terminals { folder, baud_bps } => {
                let link = folder.join(segment_name(segment));
                ImuDoor::open_on(stage, imu, *baud_bps, Some(&link))
                    .map_err(|e| closed(&link.display().to_string(), &e))
            }
        }
    }
}

/// The number of a segment's sensor, from 1.
fn number(segment: Segment) -> u8 {
    segment.index() as u8 + 1
}

/// Why a sensor's door stays closed.
fn closed(place: &str, error: &DoorError) -> Error {
    Error::new("a virtual sensor cannot be set up")
        .at(place.to_owned())
        .got(error.to_string())
        .remedy("choose another folder, or another address")
}
