//! What a profile says without being sure of it.

use crate::schema::{Actuator, Adapter, Board, Robot, Sensor, Servo};

/// The word that marks a source; `unconfirmed: why`, by itself or after what is known.
const WORD: &str = "unconfirmed";

/// A profile of any kind.
#[derive(Clone, Debug)]
pub enum Profile {
    /// A servo model.
    Servo(Box<Servo>),
    /// A CAN actuator model.
    Actuator(Box<Actuator>),
    /// A robot.
    Robot(Box<Robot>),
    /// A USB serial adapter.
    Adapter(Box<Adapter>),
    /// An inertial sensor.
    Sensor(Box<Sensor>),
    /// A board among servos.
    Board(Box<Board>),
}

/// A fact of a profile whose source says that it is not confirmed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unconfirmed<'a> {
    /// Which fact: `register NAME(ADDRESS)`, `motor`, `setup of SERVO`, ...
    pub place: String,
    /// The source as it is written, `unconfirmed: why` in it.
    pub source: &'a str,
}

impl Profile {
    /// Every fact whose source says that it is not confirmed. Of a robot: its own facts, not those
    /// of its servos.
    #[must_use]
    pub fn unconfirmed(&self) -> Vec<Unconfirmed<'_>> {
        match self {
            Self::Servo(servo) => servo.unconfirmed(),
            Self::Actuator(actuator) => actuator.unconfirmed(),
            Self::Robot(robot) => robot.unconfirmed(),
            Self::Adapter(adapter) => adapter.unconfirmed(),
            Self::Sensor(sensor) => sensor.unconfirmed(),
            Self::Board(board) => board.unconfirmed(),
        }
    }
}

impl Servo {
    /// Every fact whose source says that it is not confirmed, registers in order of address.
    #[must_use]
    pub fn unconfirmed(&self) -> Vec<Unconfirmed<'_>> {
        let registers = self.registers.iter().map(|register| {
            (format!("register {}({})", register.name, register.address), &register.source)
        });
        let facts = [
            ("position".to_owned(), &self.position.source),
            ("motor".to_owned(), &self.motor.source),
        ];
        marked(facts.into_iter().chain(registers))
    }
}

impl Board {
    /// Every fact whose source says that it is not confirmed, registers in order of address.
    #[must_use]
    pub fn unconfirmed(&self) -> Vec<Unconfirmed<'_>> {
        let registers = self.registers.iter().map(|register| {
            (format!("register {}({})", register.name, register.address), &register.source)
        });
        marked(std::iter::once(("imu".to_owned(), &self.imu.source)).chain(registers))
    }
}

impl Actuator {
    /// Every fact whose source says that it is not confirmed.
    #[must_use]
    pub fn unconfirmed(&self) -> Vec<Unconfirmed<'_>> {
        let facts = [
            ("source".to_owned(), Some(&self.source)),
            ("ranges".to_owned(), self.ranges.as_ref().map(|ranges| &ranges.source)),
            ("timeout".to_owned(), Some(&self.timeout.source)),
            ("gear".to_owned(), self.gear.as_ref().map(|gear| &gear.source)),
        ];
        marked(facts.into_iter().filter_map(|(place, source)| Some((place, source?))))
    }
}

impl Robot {
    /// Every fact of the file whose source says that it is not confirmed.
    #[must_use]
    pub fn unconfirmed(&self) -> Vec<Unconfirmed<'_>> {
        let setups =
            self.setups.iter().map(|setup| (format!("setup of {}", setup.servo), &setup.source));
        let facts = [
            ("source".to_owned(), &self.source),
            ("acceleration".to_owned(), &self.acceleration_source),
        ];
        let anatomy = self.anatomy.iter().map(|anatomy| ("anatomy".to_owned(), &anatomy.source));
        let body = self.body.iter().flat_map(|body| {
            [
                ("body".to_owned(), &body.source),
                ("shapes of the body".to_owned(), &body.shape_source),
            ]
            .into_iter()
            .chain(body.servos.iter().map(|of| ("servos of the body".to_owned(), &of.source)))
        });
        marked(facts.into_iter().chain(anatomy).chain(body).chain(setups))
    }
}

impl Adapter {
    /// Its source, if that says that something is not confirmed.
    #[must_use]
    pub fn unconfirmed(&self) -> Vec<Unconfirmed<'_>> {
        marked([("source".to_owned(), &self.source)])
    }
}

impl Sensor {
    /// Every fact whose source says that it is not confirmed.
    #[must_use]
    pub fn unconfirmed(&self) -> Vec<Unconfirmed<'_>> {
        let channels = self
            .channels
            .iter()
            .map(|channel| (format!("channel {:?}", channel.quantity), &channel.source));
        marked([("source".to_owned(), &self.source)].into_iter().chain(channels))
    }
}

fn marked<'a>(facts: impl IntoIterator<Item = (String, &'a String)>) -> Vec<Unconfirmed<'a>> {
    facts
        .into_iter()
        .filter(|(_, source)| source.contains(WORD))
        .map(|(place, source)| Unconfirmed { place, source })
        .collect()
}
