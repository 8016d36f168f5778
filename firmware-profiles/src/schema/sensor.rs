//! Sensors: what an inertial sensor sends, in which numbers, units and axes, and how often.

use serde::Deserialize;

/// One sensor model (or one way of setting it up): its stream, and what the numbers in it mean.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sensor {
    /// Version of this file format; 1.
    pub schema: u32,
    /// The file's own name, `[a-z0-9-]+`.
    pub name: String,
    /// The name on the label.
    pub model: String,
    /// Who makes it.
    pub maker: String,
    /// What its packets look like.
    pub protocol: SensorProtocol,
    /// Where packets, rate and axes are written.
    pub source: String,
    /// Line speed; absent where there is no serial line (UDP).
    #[serde(default)]
    pub baud_bps: Option<u32>,
    /// Samples per second it is set up to send.
    pub rate_hz: f64,
    /// The part of the way to the host that is always the same, s; taken off every estimate of when
    /// a sample was taken.
    #[serde(default)]
    pub latency_s: f64,
    /// Which of the sensor's axes is X, Y and Z here: forward, left and up on the sensor's label.
    #[serde(default = "own_axes")]
    pub axes: [SignedAxis; 3],
    /// The world its orientations are told in, where the packets do not say so themselves.
    #[serde(default)]
    pub world: WorldAxes,
    /// What is sent to it before its stream is read, each in hexadecimal.
    #[serde(default)]
    pub start: Vec<String>,
    /// What is sent to it afterwards.
    #[serde(default)]
    pub stop: Vec<String>,
    /// Its packet counter, if it has one.
    #[serde(default)]
    pub counter: Option<Counter>,
    /// Its clock, if it has one.
    #[serde(default)]
    pub clock: Option<DeviceClock>,
    /// Lines of text only: what begins one, and whether it ends in a check.
    #[serde(default)]
    pub line: Option<LineLayout>,
    /// Lines and framed records only: what their columns are, in order.
    #[serde(default)]
    pub columns: Vec<String>,
    /// What it measures.
    #[serde(rename = "channel")]
    pub channels: Vec<Channel>,
}

const fn own_axes() -> [SignedAxis; 3] {
    [SignedAxis::PlusX, SignedAxis::PlusY, SignedAxis::PlusZ]
}

/// Stream formats.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Hash)]
#[serde(rename_all = "kebab-case")]
pub enum SensorProtocol {
    /// WitMotion, `55 TYPE`, 11 bytes.
    Witmotion,
    /// WitMotion over Bluetooth, `55 61`, 20 bytes.
    WitmotionBle,
    /// BNO080/085/086 in UART-RVC mode.
    Bno08xRvc,
    /// Xsens MTData2.
    Xsens,
    /// VectorNav binary messages.
    VectornavBinary,
    /// VectorNav lines.
    VectornavAscii,
    /// x-io x-IMU3, text and binary.
    XImu3,
    /// MPU-6050 packets of the i2cdevlib sketch.
    MpuTeapot,
    /// Lines of text with declared columns.
    Lines,
    /// COBS frames with declared columns.
    Cobs,
    /// SLIP frames with declared columns.
    Slip,
    /// SlimeVR trackers over UDP.
    Slimevr,
    /// Motive's rigid bodies and bones over UDP.
    Natnet,
}

/// An axis and its sense.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
pub enum SignedAxis {
    /// X.
    #[serde(rename = "x")]
    PlusX,
    /// Y.
    #[serde(rename = "y")]
    PlusY,
    /// Z.
    #[serde(rename = "z")]
    PlusZ,
    /// Against X.
    #[serde(rename = "-x")]
    MinusX,
    /// Against Y.
    #[serde(rename = "-y")]
    MinusY,
    /// Against Z.
    #[serde(rename = "-z")]
    MinusZ,
}

impl SignedAxis {
    /// The axis as a unit vector of the sensor.
    #[must_use]
    pub const fn unit(self) -> [f64; 3] {
        match self {
            Self::PlusX => [1.0, 0.0, 0.0],
            Self::PlusY => [0.0, 1.0, 0.0],
            Self::PlusZ => [0.0, 0.0, 1.0],
            Self::MinusX => [-1.0, 0.0, 0.0],
            Self::MinusY => [0.0, -1.0, 0.0],
            Self::MinusZ => [0.0, 0.0, -1.0],
        }
    }
}

/// Axes of a world.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub enum WorldAxes {
    /// X east, Y north, Z up; also for a heading that starts anywhere.
    #[default]
    EastNorthUp,
    /// X north, Y east, Z down.
    NorthEastDown,
    /// X north, Y west, Z up.
    NorthWestUp,
    /// X left, Y up, Z forward, of a room that knows no north.
    LeftUpForward,
}

/// A packet counter.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(deny_unknown_fields)]
pub struct Counter {
    /// Width; it goes round after 2^bits samples.
    pub bits: u32,
}

/// The clock of a device.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct DeviceClock {
    /// Width; it goes round after 2^bits ticks.
    pub bits: u32,
    /// Length of a tick, s.
    pub tick_s: f64,
}

/// What a line of text looks like.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Eq)]
#[serde(deny_unknown_fields)]
pub struct LineLayout {
    /// First cell of a line, `$` included; empty: every line is one of ours.
    #[serde(default)]
    pub prefix: String,
    /// True if a line ends in `*HH`, the exclusive or of the characters between `$` and `*`.
    #[serde(default)]
    pub check: bool,
}

/// One thing a sensor measures.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Channel {
    /// What it is.
    pub quantity: Quantity,
    /// Unit of `scale`, `range` and `noise`.
    pub unit: SensorUnit,
    /// What one raw number is worth in `unit`.
    pub scale: f64,
    /// Largest magnitude it can tell, in `unit`; what is beyond is no measurement.
    #[serde(default)]
    pub range: Option<f64>,
    /// Noise of one sample, standard deviation, in `unit`.
    #[serde(default)]
    pub noise: Option<f64>,
    /// True if a sample is whole without it.
    #[serde(default)]
    pub optional: bool,
    /// Where scale, range and noise are written.
    pub source: String,
}

/// What a sensor measures.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[serde(rename_all = "kebab-case")]
pub enum Quantity {
    /// Specific force: at rest one g upwards.
    Acceleration,
    /// Acceleration without gravity.
    LinearAcceleration,
    /// Angular rate.
    AngularRate,
    /// Magnetic field.
    MagneticField,
    /// Orientation in the world, as a quaternion.
    Orientation,
    /// The same as roll, pitch and yaw.
    Euler,
    /// Temperature.
    Temperature,
}

/// Units of sensors.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
pub enum SensorUnit {
    /// Metres per second squared.
    #[serde(rename = "m/s2")]
    MetrePerSecond2,
    /// Standard gravity, 9.80665 m/s2.
    #[serde(rename = "g")]
    Gravity,
    /// Radians per second.
    #[serde(rename = "rad/s")]
    RadianPerSecond,
    /// Degrees per second.
    #[serde(rename = "deg/s")]
    DegreePerSecond,
    /// Tesla.
    #[serde(rename = "T")]
    Tesla,
    /// Microtesla.
    #[serde(rename = "uT")]
    Microtesla,
    /// Gauss, 1e-4 T.
    #[serde(rename = "gauss")]
    Gauss,
    /// Radians.
    #[serde(rename = "rad")]
    Radian,
    /// Degrees.
    #[serde(rename = "deg")]
    Degree,
    /// Degrees Celsius.
    #[serde(rename = "degC")]
    Celsius,
    /// None: the elements of a quaternion.
    #[serde(rename = "1")]
    One,
}

impl SensorUnit {
    /// What one of this unit is in SI units (degrees Celsius stay what they are).
    #[must_use]
    pub const fn in_si(self) -> f64 {
        match self {
            Self::Gravity => 9.806_65,
            Self::DegreePerSecond | Self::Degree => std::f64::consts::PI / 180.0,
            Self::Microtesla => 1e-6,
            Self::Gauss => 1e-4,
            Self::MetrePerSecond2
            | Self::RadianPerSecond
            | Self::Tesla
            | Self::Radian
            | Self::Celsius
            | Self::One => 1.0,
        }
    }

    /// How it is written in a file.
    #[must_use]
    pub const fn symbol(self) -> &'static str {
        match self {
            Self::MetrePerSecond2 => "m/s2",
            Self::Gravity => "g",
            Self::RadianPerSecond => "rad/s",
            Self::DegreePerSecond => "deg/s",
            Self::Tesla => "T",
            Self::Microtesla => "uT",
            Self::Gauss => "gauss",
            Self::Radian => "rad",
            Self::Degree => "deg",
            Self::Celsius => "degC",
            Self::One => "1",
        }
    }

    /// True if `quantity` may be given in this unit.
    #[must_use]
    pub const fn fits(self, quantity: Quantity) -> bool {
        match quantity {
            Quantity::Acceleration | Quantity::LinearAcceleration => {
                matches!(self, Self::MetrePerSecond2 | Self::Gravity)
            }
            Quantity::AngularRate => {
                matches!(self, Self::RadianPerSecond | Self::DegreePerSecond)
            }
            Quantity::MagneticField => {
                matches!(self, Self::Tesla | Self::Microtesla | Self::Gauss)
            }
            Quantity::Orientation => matches!(self, Self::One),
            Quantity::Euler => matches!(self, Self::Radian | Self::Degree),
            Quantity::Temperature => matches!(self, Self::Celsius),
        }
    }
}

impl Sensor {
    /// The channel of a quantity.
    #[must_use]
    pub fn channel(&self, quantity: Quantity) -> Option<&Channel> {
        self.channels.iter().find(|channel| channel.quantity == quantity)
    }

    /// Names of columns, in the order in which messages list them.
    pub const COLUMNS: [&'static str; 20] = [
        "ax",
        "ay",
        "az",
        "gx",
        "gy",
        "gz",
        "mx",
        "my",
        "mz",
        "qw",
        "qx",
        "qy",
        "qz",
        "roll",
        "pitch",
        "yaw",
        "temperature",
        "counter",
        "ticks",
        "-",
    ];
    /// Number formats of columns in framed records.
    pub const NUMBERS: [&'static str; 8] = ["u8", "u16", "u32", "u64", "i16", "i32", "f32", "f64"];
}

/// The bytes a hexadecimal text stands for, if it is one.
#[must_use]
pub fn hex_bytes(text: &str) -> Option<Vec<u8>> {
    let digits: Vec<char> = text.chars().filter(|letter| *letter != ' ').collect();
    let pairs = digits.chunks(2).map(|pair| match pair {
        [high, low] => Some((high.to_digit(16)? * 16 + low.to_digit(16)?) as u8),
        _ => None,
    });
    pairs.collect()
}
