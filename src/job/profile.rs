//! Which profiles there are, and whether one can be used for what it is there for: more than that its file has the
//! form of one.

pub mod words;

use crate::device::sensor::stream_format;
use crate::error::Error;
use crate::job::report::{Outcome, counted};
use crate::robot::Robot;
use gaitway_profiles::{self as profiles, Dialect, Profile, Protocol};
use serde::Serialize;

/// Asks for what playing needs of a robot's servos, and recording of a sensor.
///
/// # Errors
/// What is missing.
pub fn check_use(profile: &Profile) -> Result<(), Error> {
    match profile {
        Profile::Robot(robot) => Robot::new(robot.as_ref().clone()).map(drop),
        Profile::Sensor(sensor) => stream_format(sensor).map(drop),
        Profile::Servo(_) | Profile::Actuator(_) | Profile::Adapter(_) | Profile::Board(_) => {
            Ok(())
        }
    }
}

/// A file in which nothing is wrong.
#[derive(Debug, Serialize)]
pub struct CheckedProfile {
    /// Always `done`.
    pub outcome: Outcome,
    /// Of the profile.
    pub name: String,
    /// What it is of, in words.
    pub kind: &'static str,
    /// What is in it, in words.
    #[serde(skip)]
    pub holds: String,
    /// What nobody could confirm.
    pub unconfirmed: Vec<UnconfirmedFact>,
}

/// A fact nobody could confirm.
#[derive(Debug, Serialize)]
pub struct UnconfirmedFact {
    /// Where in the file.
    pub place: String,
    /// What is said of where it comes from.
    pub source: String,
}

/// Looks through a profile that can be read.
///
/// # Errors
/// As [`check_use`].
pub fn check(profile: &Profile) -> Result<CheckedProfile, Error> {
    check_use(profile)?;
    let (name, kind, holds) = match profile {
        Profile::Servo(servo) => (&servo.name, "servo", counted(servo.items().count(), "register")),
        Profile::Actuator(actuator) => {
            (&actuator.name, "CAN actuator", dialect(actuator.dialect).to_owned())
        }
        Profile::Robot(robot) => {
            let (joints, lines) = (robot.joints.len(), robot.lines.len());
            let bodiless = "; follows no body: tables, recordings and a hand move it";
            let bodiless = if robot.anatomy.is_none() { bodiless } else { "" };
            let (joints, lines) = (counted(joints, "joint"), counted(lines, "line"));
            (&robot.name, "robot", format!("{joints} on {lines}{bodiless}"))
        }
        Profile::Adapter(adapter) => {
            (&adapter.name, "adapter", format!("USB {}", adapter.usb_ids.join(", ")))
        }
        Profile::Sensor(sensor) => {
            (&sensor.name, "sensor", counted(sensor.channels.len(), "channel"))
        }
        Profile::Board(board) => (&board.name, "board", counted(board.registers.len(), "register")),
    };
    let unconfirmed = profile
        .unconfirmed()
        .into_iter()
        .map(|fact| UnconfirmedFact { place: fact.place, source: fact.source.to_owned() });
    Ok(CheckedProfile {
        outcome: Outcome::Done,
        name: name.clone(),
        kind,
        holds,
        unconfirmed: unconfirmed.collect(),
    })
}

/// All shipped profiles.
#[derive(Debug, Serialize)]
pub struct ProfileList {
    /// Servos.
    pub servos: Vec<ListedProfile>,
    /// CAN actuators.
    pub actuators: Vec<ListedProfile>,
    /// Sensors.
    pub sensors: Vec<ListedProfile>,
    /// Robots.
    pub robots: Vec<ListedProfile>,
    /// Adapters between USB and a line.
    pub adapters: Vec<ListedProfile>,
    /// Boards with an inertial sensor among servos.
    pub boards: Vec<ListedProfile>,
}

/// One of them. A robot has no maker and a sensor no protocol that sets it apart.
#[derive(Debug, Default, Serialize)]
pub struct ListedProfile {
    /// By which it is called.
    pub name: String,
    /// Who makes it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub maker: Option<String>,
    /// Model, or description of a robot.
    pub model: String,
    /// What it speaks, in words.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub protocol: Option<&'static str>,
    /// Of an adapter, VENDOR:PRODUCT.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub usb_ids: Vec<String>,
}

impl ProfileList {
    /// Reads all that come with gaitway.
    ///
    /// # Errors
    /// A profile that cannot be read.
    pub fn of_all() -> Result<Self, Error> {
        let mut list = Self {
            servos: Vec::new(),
            actuators: Vec::new(),
            sensors: Vec::new(),
            robots: Vec::new(),
            adapters: Vec::new(),
            boards: Vec::new(),
        };
        for name in profiles::servo_names() {
            let servo = profiles::servo(name)?;
            list.servos.push(ListedProfile {
                name: name.to_owned(),
                maker: Some(servo.maker.clone()),
                model: servo.model.clone(),
                protocol: Some(protocol(servo.protocol)),
                usb_ids: Vec::new(),
            });
        }
        for name in profiles::actuator_names() {
            let actuator = profiles::actuator(name)?;
            list.actuators.push(ListedProfile {
                name: name.to_owned(),
                maker: Some(actuator.maker.clone()),
                model: actuator.model.clone(),
                protocol: Some(dialect(actuator.dialect)),
                usb_ids: Vec::new(),
            });
        }
        for name in profiles::sensor_names() {
            let sensor = profiles::sensor(name)?;
            let (maker, model) = (Some(sensor.maker), sensor.model);
            list.sensors.push(ListedProfile {
                name: name.to_owned(),
                maker,
                model,
                ..ListedProfile::default()
            });
        }
        for name in profiles::robot_names() {
            let model = profiles::robot(name)?.description;
            list.robots.push(ListedProfile {
                name: name.to_owned(),
                model,
                ..ListedProfile::default()
            });
        }
        for adapter in profiles::adapters()? {
            let (name, model) = (adapter.name.clone(), adapter.model.clone());
            let usb_ids = adapter.usb_ids.clone();
            list.adapters.push(ListedProfile { name, model, usb_ids, ..ListedProfile::default() });
        }
        for name in profiles::board_names() {
            let board = profiles::board(name)?;
            list.boards.push(ListedProfile {
                name: name.to_owned(),
                maker: Some(board.maker),
                model: board.model,
                ..ListedProfile::default()
            });
        }
        Ok(list)
    }
}

/// A dialect of CAN, in words.
#[must_use]
pub const fn dialect(dialect: Dialect) -> &'static str {
    match dialect {
        Dialect::CubemarsMit => "MIT mode",
        Dialect::CubemarsServo => "CubeMars servo mode",
        Dialect::Damiao => "Damiao",
        Dialect::Robstride => "CyberGear and RobStride",
        Dialect::Odrive => "CAN Simple",
        Dialect::Moteus => "moteus, CAN FD",
        Dialect::Recoil => "Recoil",
    }
}

/// A protocol, in words.
#[must_use]
pub const fn protocol(protocol: Protocol) -> &'static str {
    match protocol {
        Protocol::Dynamixel1 => "DYNAMIXEL Protocol 1.0",
        Protocol::Dynamixel2 => "DYNAMIXEL Protocol 2.0",
        Protocol::FeetechSts => "FEETECH STS and SMS",
        Protocol::FeetechScs => "FEETECH SCS",
    }
}
