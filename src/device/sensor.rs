//! Inertial sensors in SI units: what a profile makes of the numbers in a stream.
//!
//! Axes: X, Y, Z of the sensor as the profile maps them (forward, left, up on its label). World: X
//! east, Y north, Z up, or, where a sensor knows no north, a heading that starts anywhere.

use crate::error::Error;
use crate::wire::sensor::{Column, Format, Lines, Reading, World};
use gaitway_profiles::{Channel, Quantity, Sensor, SensorProtocol, SignedAxis, WorldAxes};
use glam::{DMat3, DQuat, DVec3};
use std::f64::consts::FRAC_1_SQRT_2;

/// A quaternion whose length differs from one by more than this is no orientation.
const LENGTH_TOLERANCE: f64 = 0.05;
/// Values beyond the stated range by this share are still rounding.
const RANGE_SLACK: f64 = 1.01;

/// One sample of a sensor. Absent: not sent, not finite, or beyond the range of the sensor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SensorSample {
    /// Specific force, m/s^2, in the sensor's axes; at rest one g upwards.
    pub acceleration_m_s2: Option<DVec3>,
    /// Acceleration without gravity, m/s^2, in the sensor's axes.
    pub linear_acceleration_m_s2: Option<DVec3>,
    /// Angular rate, rad/s, in the sensor's axes.
    pub angular_rate_rad_s: Option<DVec3>,
    /// Magnetic field, T, in the sensor's axes.
    pub magnetic_field_t: Option<DVec3>,
    /// Orientation as the sensor computed it: turns vectors of the sensor into the world's.
    pub orientation: Option<DQuat>,
    /// Temperature, degrees Celsius.
    pub temperature_c: Option<f64>,
    /// Raw packet counter.
    pub counter: Option<u64>,
    /// Raw clock of the device, ticks.
    pub ticks: Option<u64>,
    /// True if something was sent that is no measurement: not finite or beyond the range.
    pub implausible: bool,
}

/// The stream format of a sensor on a serial line; `None` for one that sends datagrams, which have
/// ends of their own (`wire::sensor::slimevr`, `wire::natnet`).
///
/// # Errors
/// A column that does not exist.
pub fn stream_format(sensor: &Sensor) -> Result<Option<Format>, Error> {
    let columns = || -> Result<Vec<Column>, Error> {
        let columns = sensor.columns.iter().map(|column| column.parse::<Column>());
        columns
            .collect::<Result<_, _>>()
            .map_err(|wrong| Error::new(wrong.to_string()).at(format!("sensor {}", sensor.name)))
    };
    Ok(Some(match sensor.protocol {
        SensorProtocol::Witmotion => Format::WitMotion,
        SensorProtocol::WitmotionBle => Format::WitMotionBle,
        SensorProtocol::Bno08xRvc => Format::Bno08xRvc,
        SensorProtocol::Xsens => Format::Xsens,
        SensorProtocol::VectornavBinary => Format::VectorNavBinary,
        SensorProtocol::VectornavAscii => Format::VectorNavAscii,
        SensorProtocol::XImu3 => Format::XImu3,
        SensorProtocol::MpuTeapot => Format::Teapot,
        SensorProtocol::Lines => {
            let line = sensor.line.clone().unwrap_or_default();
            Format::Lines(Lines { prefix: line.prefix, check: line.check, columns: columns()? })
        }
        SensorProtocol::Cobs => Format::Cobs(columns()?),
        SensorProtocol::Slip => Format::Slip(columns()?),
        SensorProtocol::Slimevr | SensorProtocol::Natnet => return Ok(None),
    }))
}

/// One number of a channel in SI units.
#[derive(Clone, Copy, Debug)]
struct Scale {
    si_per_count: f64,
    most_si: f64,
    required: bool,
}

impl Scale {
    fn of(channel: &Channel) -> Self {
        let unit = channel.unit.in_si();
        let most_si = channel.range.map_or(f64::INFINITY, |range| range * unit * RANGE_SLACK);
        Self { si_per_count: channel.scale * unit, most_si, required: !channel.optional }
    }

    /// `None` if one of the values is no measurement.
    fn apply<const N: usize>(self, raw: [f64; N]) -> Option<[f64; N]> {
        let values = raw.map(|value| value * self.si_per_count);
        let plausible = |value: &f64| value.is_finite() && value.abs() <= self.most_si;
        values.iter().all(plausible).then_some(values)
    }
}

/// Quantities in the order of [`Assembler::scales`].
const QUANTITIES: [Quantity; 7] = [
    Quantity::Acceleration,
    Quantity::LinearAcceleration,
    Quantity::AngularRate,
    Quantity::MagneticField,
    Quantity::Orientation,
    Quantity::Euler,
    Quantity::Temperature,
];

/// Puts the readings of one sensor together into whole samples.
///
/// A sample is whole once every channel that is not optional has been sent. If one is sent again
/// before, the sample is handed over as it is: something in between was lost. Optional quantities
/// come with the sample that follows them.
#[derive(Clone, Debug)]
pub struct Assembler {
    scales: [Option<Scale>; QUANTITIES.len()],
    axes: DMat3,
    /// The sensor's axes seen from ours, as a rotation.
    turn: DQuat,
    world: World,
    sample: SensorSample,
    /// Required quantities the sample has, as bits.
    have: u8,
    required: u8,
    incomplete: u64,
}

impl Assembler {
    /// For a sensor of this profile.
    #[must_use]
    pub fn new(sensor: &Sensor) -> Self {
        let scales = QUANTITIES.map(|quantity| sensor.channel(quantity).map(Scale::of));
        let required = scales.iter().enumerate().fold(0, |bits, (index, scale)| {
            bits | u8::from(scale.is_some_and(|scale| scale.required)) << index
        });
        let axes = DMat3::from_cols_array_2d(&sensor.axes.map(SignedAxis::unit)).transpose();
        let world = match sensor.world {
            WorldAxes::EastNorthUp => World::EastNorthUp,
            WorldAxes::NorthEastDown => World::NorthEastDown,
            WorldAxes::NorthWestUp => World::NorthWestUp,
            WorldAxes::LeftUpForward => World::LeftUpForward,
        };
        Self {
            scales,
            axes,
            turn: DQuat::from_mat3(&axes),
            world,
            sample: SensorSample::default(),
            have: 0,
            required,
            incomplete: 0,
        }
    }

    /// Samples handed over that lacked something: it did not come, or was beyond what the sensor measures.
    #[must_use]
    pub const fn incomplete(&self) -> u64 {
        self.incomplete
    }

    /// Takes a reading: the sample that it shows to be incomplete, and the one that it completes. Both, if a sensor that sends
    /// all at once left something out of one reading.
    pub fn take(&mut self, reading: &Reading) -> [Option<SensorSample>; 2] {
        let sent = [
            reading.acceleration.is_some(),
            reading.linear_acceleration.is_some(),
            reading.angular_rate.is_some(),
            reading.magnetic_field.is_some(),
            reading.quaternion.is_some(),
            reading.euler.is_some(),
            reading.temperature.is_some(),
        ];
        let sent = sent.iter().enumerate().fold(0, |bits, (at, &sent)| bits | u8::from(sent) << at);
        let cut_short = (self.have & sent & self.required != 0).then(|| self.hand_over());
        self.add(reading, sent & self.required != 0);
        self.have |= sent & self.required;
        let whole = (self.have == self.required).then(|| self.hand_over());
        let lacks = whole.as_ref().is_some_and(|sample| sample.implausible);
        self.incomplete += u64::from(cut_short.is_some()) + u64::from(lacks);
        [cut_short, whole]
    }

    fn hand_over(&mut self) -> SensorSample {
        self.have = 0;
        std::mem::take(&mut self.sample)
    }

    fn add(&mut self, reading: &Reading, decisive: bool) {
        self.sample.counter = reading.counter.or(self.sample.counter);
        let measures = reading.acceleration.is_some()
            || reading.linear_acceleration.is_some()
            || reading.angular_rate.is_some()
            || reading.magnetic_field.is_some()
            || reading.quaternion.is_some()
            || reading.euler.is_some()
            || reading.temperature.is_some();
        // The time of a packet that brings optional quantities only is not that of the sample.
        if decisive || !measures {
            self.sample.ticks = reading.ticks.or(self.sample.ticks);
        }
        let vector = |raw: [f64; 3]| self.axes * DVec3::from_array(raw);
        if let Some(value) = self.scaled(Quantity::Acceleration, reading.acceleration) {
            self.sample.acceleration_m_s2 = value.map(vector);
            self.sample.implausible |= value.is_none();
        }
        if let Some(value) = self.scaled(Quantity::LinearAcceleration, reading.linear_acceleration)
        {
            self.sample.linear_acceleration_m_s2 = value.map(vector);
            self.sample.implausible |= value.is_none();
        }
        if let Some(value) = self.scaled(Quantity::AngularRate, reading.angular_rate) {
            self.sample.angular_rate_rad_s = value.map(vector);
            self.sample.implausible |= value.is_none();
        }
        if let Some(value) = self.scaled(Quantity::MagneticField, reading.magnetic_field) {
            self.sample.magnetic_field_t = value.map(vector);
            self.sample.implausible |= value.is_none();
        }
        if let Some(value) = self.scaled(Quantity::Temperature, reading.temperature.map(|t| [t])) {
            self.sample.temperature_c = value.map(|[celsius]| celsius);
            self.sample.implausible |= value.is_none();
        }
        self.add_orientation(reading);
    }

    fn add_orientation(&mut self, reading: &Reading) {
        let world = reading.world.unwrap_or(self.world);
        let quaternion = self.scaled(Quantity::Orientation, reading.quaternion);
        let euler = self.scaled(Quantity::Euler, reading.euler);
        let told = match (quaternion, euler) {
            (Some(quaternion), _) => quaternion.and_then(unit),
            (None, Some(euler)) => euler.map(of_euler),
            (None, None) => return,
        };
        self.sample.implausible |= told.is_none();
        self.sample.orientation =
            told.map(|told| (to_east_north_up(world) * told * self.turn.inverse()).normalize());
    }

    /// The outer `None`: not sent, or not of this sensor. The inner one: no measurement.
    fn scaled<const N: usize>(
        &self,
        quantity: Quantity,
        raw: Option<[f64; N]>,
    ) -> Option<Option<[f64; N]>> {
        let index = QUANTITIES.iter().position(|&known| known == quantity)?;
        Some(self.scales[index]?.apply(raw?))
    }
}

/// A quaternion w, x, y, z as a rotation, if it is one.
#[must_use]
pub fn unit([w, x, y, z]: [f64; 4]) -> Option<DQuat> {
    let quaternion = DQuat::from_xyzw(x, y, z, w);
    let off = (quaternion.length() - 1.0).abs();
    (off <= LENGTH_TOLERANCE).then(|| quaternion.normalize())
}

/// Yaw about Z, then pitch about the new Y, then roll about the new X.
fn of_euler([roll, pitch, yaw]: [f64; 3]) -> DQuat {
    DQuat::from_rotation_z(yaw) * DQuat::from_rotation_y(pitch) * DQuat::from_rotation_x(roll)
}

/// Turns vectors of a world into one of X east, Y north, Z up.
fn to_east_north_up(world: World) -> DQuat {
    match world {
        World::EastNorthUp => DQuat::IDENTITY,
        // Half a turn about the line between north and east.
        World::NorthEastDown => DQuat::from_xyzw(FRAC_1_SQRT_2, FRAC_1_SQRT_2, 0.0, 0.0),
        World::NorthWestUp => DQuat::from_xyzw(0.0, 0.0, FRAC_1_SQRT_2, FRAC_1_SQRT_2),
        // A third of a turn about the line between all three: forward, which was Z, is X.
        World::LeftUpForward => DQuat::from_xyzw(0.5, 0.5, 0.5, 0.5),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The one sample that comes of a reading.
    fn taken(assembler: &mut Assembler, reading: &Reading) -> Option<SensorSample> {
        let [cut_short, whole] = assembler.take(reading);
        assert!(cut_short.is_none() || whole.is_none(), "{cut_short:?} {whole:?}");
        cut_short.or(whole)
    }
    use crate::wire::sensor::Stream;
    use std::f64::consts::FRAC_PI_2;

    fn profile(name: &str) -> Sensor {
        gaitway_profiles::sensor(name).expect("a shipped sensor")
    }

    fn close(found: Option<DVec3>, expected: [f64; 3]) {
        let found = found.expect("it is there");
        let off = (found - DVec3::from_array(expected)).length();
        assert!(off <= 1e-6, "{found} is not {expected:?}");
    }

    #[test]
    fn every_shipped_sensor_but_those_on_the_network_has_a_stream() {
        for name in gaitway_profiles::sensor_names() {
            let format = stream_format(&profile(name)).expect("its columns exist");
            let is_on_network = name == "slimevr" || name.starts_with("natnet");
            assert_eq!(format.is_none(), is_on_network, "{name}");
        }
    }

    #[test]
    fn the_columns_of_the_profiles_are_those_of_the_decoder() {
        for name in Sensor::COLUMNS {
            assert!(name.parse::<Column>().is_ok(), "{name}");
            for number in Sensor::NUMBERS {
                assert!(format!("{name}:{number}").parse::<Column>().is_ok(), "{name}:{number}");
            }
        }
    }

    /// WitMotion sends a sample as three packets; the manual's full scales are 16 g and 2000 deg/s.
    #[test]
    fn a_sample_of_several_packets_is_put_together_and_a_torn_one_is_told() {
        let mut assembler = Assembler::new(&profile("witmotion-wt901"));
        let acceleration = Reading { acceleration: Some([0.0, 0.0, 2048.0]), ..Reading::default() };
        let rate = Reading { angular_rate: Some([16_384.0, 0.0, 0.0]), ..Reading::default() };
        let euler = Reading { euler: Some([0.0, 0.0, 16_384.0]), ..Reading::default() };
        assert_eq!(taken(&mut assembler, &acceleration), None);
        assert_eq!(taken(&mut assembler, &rate), None);
        let whole = taken(&mut assembler, &euler).expect("whole");
        close(whole.acceleration_m_s2, [0.0, 0.0, 9.80665]);
        close(whole.angular_rate_rad_s, [1000_f64.to_radians(), 0.0, 0.0]);
        // A yaw of 90 degrees turns forward into left.
        close(whole.orientation.map(|q| q * DVec3::X), [0.0, 1.0, 0.0]);

        taken(&mut assembler, &acceleration);
        taken(&mut assembler, &rate);
        let torn = taken(&mut assembler, &acceleration).expect("the next sample has begun");
        assert!(torn.orientation.is_none() && torn.acceleration_m_s2.is_some());
        assert_eq!(assembler.incomplete(), 1);
        taken(&mut assembler, &rate);
        assert!(taken(&mut assembler, &euler).expect("whole").orientation.is_some());
    }

    #[test]
    fn a_sensor_that_sends_all_at_once_and_once_left_something_out_is_not_late_from_then_on() {
        let mut assembler = Assembler::new(&profile("arduino-csv"));
        let reading = |x: f64| Reading {
            acceleration: Some([x, 0.0, 9.8]),
            angular_rate: Some([0.0; 3]),
            ..Reading::default()
        };
        assert!(taken(&mut assembler, &reading(1.0)).is_some());
        let torn = Reading { angular_rate: None, ..reading(2.0) };
        assert_eq!(taken(&mut assembler, &torn), None);
        let [cut_short, whole] = assembler.take(&reading(3.0)).map(|sample| sample.expect("both"));
        assert!(cut_short.angular_rate_rad_s.is_none());
        close(cut_short.acceleration_m_s2, [2.0, 0.0, 9.8]);
        close(whole.acceleration_m_s2, [3.0, 0.0, 9.8]);
        let next = taken(&mut assembler, &reading(4.0)).expect("at once");
        close(next.acceleration_m_s2, [4.0, 0.0, 9.8]);
        assert_eq!(assembler.incomplete(), 1);
    }

    #[test]
    fn what_is_beyond_the_range_is_no_measurement() {
        let mut assembler = Assembler::new(&profile("arduino-csv"));
        let reading = |x: f64| Reading {
            acceleration: Some([x, 0.0, 9.8]),
            angular_rate: Some([0.0; 3]),
            ..Reading::default()
        };
        let good = taken(&mut assembler, &reading(1.0)).expect("whole");
        assert!(good.acceleration_m_s2.is_some() && !good.implausible);
        for x in [1e6, f64::NAN, f64::INFINITY] {
            let bad = taken(&mut assembler, &reading(x)).expect("whole");
            assert!(bad.acceleration_m_s2.is_none() && bad.implausible, "{x}");
            assert!(bad.angular_rate_rad_s.is_some());
        }
    }

    /// A VectorNav at rest, level: Z down, so that it reads -1 g on its own Z; roll right is
    /// positive there, which is a turn about forward here too; a heading of 90 degrees is east.
    #[test]
    fn north_east_down_becomes_east_north_up() {
        let mut assembler = Assembler::new(&profile("vectornav-vn100"));
        let sample = taken(
            &mut assembler,
            &Reading {
                acceleration: Some([0.0, 0.0, -9.80665]),
                angular_rate: Some([0.0, 0.0, 1.0]),
                euler: Some([0.0, 0.0, 90.0]),
                ..Reading::default()
            },
        )
        .expect("whole");
        close(sample.acceleration_m_s2, [0.0, 0.0, 9.80665]);
        close(sample.angular_rate_rad_s, [0.0, 0.0, -1.0]);
        let orientation = sample.orientation.expect("told");
        close(Some(orientation * DVec3::X), [1.0, 0.0, 0.0]);
        close(Some(orientation * DVec3::Z), [0.0, 0.0, 1.0]);
        // And heading north, nose up by 30 degrees.
        let sample = taken(
            &mut assembler,
            &Reading {
                acceleration: Some([0.0; 3]),
                angular_rate: Some([0.0; 3]),
                euler: Some([0.0, 30.0, 0.0]),
                ..Reading::default()
            },
        );
        let nose = sample.and_then(|sample| sample.orientation).expect("told") * DVec3::X;
        close(Some(nose), [0.0, 30_f64.to_radians().cos(), 0.5]);
    }

    #[test]
    fn north_west_up_is_a_quarter_turn_from_east_north_up() {
        close(Some(to_east_north_up(World::NorthWestUp) * DVec3::X), [0.0, 1.0, 0.0]);
        close(Some(to_east_north_up(World::NorthEastDown) * DVec3::X), [0.0, 1.0, 0.0]);
        close(Some(to_east_north_up(World::NorthEastDown) * DVec3::Z), [0.0, 0.0, -1.0]);
        let angle = to_east_north_up(World::NorthWestUp).to_axis_angle().1;
        assert!((angle - FRAC_PI_2).abs() < 1e-12);
    }

    /// Motive: a body that was made while its wearer faced Z (Y up), or -Y (Z up), has the room's axes then; here it faces X.
    #[test]
    fn a_body_of_motive_that_faces_forward_faces_forward_here_whichever_axis_is_up() {
        let told = |name: &str, quaternion: [f64; 4]| {
            let reading = Reading { quaternion: Some(quaternion), ..Reading::default() };
            let sample = taken(&mut Assembler::new(&profile(name)), &reading).expect("whole");
            sample.orientation.expect("told")
        };
        let half = FRAC_1_SQRT_2;
        for (name, turned_left, bowed) in [
            ("natnet", [half, 0.0, half, 0.0], [half, half, 0.0, 0.0]),
            ("natnet-z-up", [half, 0.0, 0.0, half], [half, half, 0.0, 0.0]),
        ] {
            let forward = told(name, [1.0, 0.0, 0.0, 0.0]);
            close(Some(forward * DVec3::X), [1.0, 0.0, 0.0]);
            close(Some(forward * DVec3::Z), [0.0, 0.0, 1.0]);
            close(Some(told(name, turned_left) * DVec3::X), [0.0, 1.0, 0.0]);
            // A bow turns about what is to the left: what faced forward faces down.
            close(Some(told(name, bowed) * DVec3::X), [0.0, 0.0, -1.0]);
        }
    }

    #[test]
    fn a_stream_and_its_profile_make_si_units() {
        // BNO080 data sheet, 1.3.5.2: -371, -20, 977 mg.
        let bytes = [
            0xAA, 0xAA, 0xDE, 0x01, 0x00, 0x92, 0xFF, 0x25, 0x08, 0x8D, 0xFE, 0xEC, 0xFF, 0xD1,
            0x03, 0x00, 0x00, 0x00, 0xE7,
        ];
        let profile = profile("bno08x-rvc");
        let mut stream = Stream::new(stream_format(&profile).expect("columns").expect("a stream"));
        let mut assembler = Assembler::new(&profile);
        let mut sample = None;
        stream.push(&bytes, |reading| sample = taken(&mut assembler, &reading));
        let sample = sample.expect("whole");
        close(sample.acceleration_m_s2, [-0.371, -0.020, 0.977].map(|g| g * 9.80665));
        assert_eq!(sample.counter, Some(222));
    }
}
