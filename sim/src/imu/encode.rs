//! The device side of the stream formats, written from the makers' manuals.
//!
//! Sources: WitMotion "WIT Standard Protocol"; BNO080 data sheet 1.3, section 1.3.5.2; Xsens "MT Low
//! Level Communication Protocol"; VectorNav VN-100 user manual (UM001); x-io x-IMU3 user manual;
//! i2cdevlib MPU6050_DMP6; SlimeVR-Server at 5549763, udp/*.kt; Movella DOT BLE Services Specification, XD0506P rev. C.

use super::turn;
use std::f64::consts::FRAC_1_SQRT_2;

const G: f64 = 9.806_65;

/// What a virtual sensor speaks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImuWire {
    /// WitMotion: acceleration, angular rate and angle, a packet each.
    WitMotion,
    /// WitMotion over Bluetooth.
    WitMotionBle,
    /// BNO08x UART-RVC.
    Bno08xRvc,
    /// Xsens MTData2: counter, time, quaternion, acceleration, rate of turn.
    Xsens,
    /// VectorNav binary: time, quaternion, angular rate, acceleration.
    VectorNavBinary,
    /// VectorNav `VNQMR` lines.
    VectorNavAscii,
    /// x-IMU3 binary: a magnetic, then an inertial message.
    XImu3,
    /// The MPU-6050 packet.
    Teapot,
    /// Lines: microseconds, acceleration m/s^2, angular rate rad/s.
    Csv,
    /// The same as `$IMU,...*HH`.
    Nmea,
    /// The same as a record of u32 and six f32 in a COBS frame.
    Cobs,
    /// The same in a SLIP frame.
    Slip,
    /// SlimeVR datagrams of rotation and acceleration, sensor 0.
    SlimeVr,
    /// Notifications of a Movella DOT, each in a SLIP frame.
    MovellaDot(DotPayload),
}

/// Payload modes of a Movella DOT.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DotPayload {
    /// Time, quaternion, free acceleration, status, counts of clipping.
    ExtendedQuaternion,
    /// Time, quaternion, free acceleration.
    CompleteQuaternion,
    /// Time, quaternion.
    OrientationQuaternion,
    /// Time, acceleration, angular velocity.
    RateQuantities,
    /// Time, Euler angles, free acceleration, angular velocity.
    CustomMode1,
    /// Time, quaternion, acceleration, angular velocity.
    CustomMode5,
}

/// What a sensor measured, SI units, own axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// Angular rate, rad/s.
    pub rate_rad_s: [f64; 3],
    /// Specific force, m/s^2.
    pub specific_force_m_s2: [f64; 3],
    /// Acceleration without gravity, m/s^2.
    pub linear_acceleration_m_s2: [f64; 3],
    /// Magnetic field, T.
    pub field_t: [f64; 3],
    /// Orientation, w, x, y, z.
    pub orientation: [f64; 4],
    /// Number of the sample.
    pub number: u64,
    /// The sensor's own clock, s.
    pub device_s: f64,
}

impl ImuWire {
    /// The bytes of one sample.
    #[must_use]
    pub fn encode(self, measured: &Measured) -> Vec<u8> {
        match self {
            Self::WitMotion => witmotion(measured),
            Self::WitMotionBle => witmotion_ble(measured),
            Self::Bno08xRvc => rvc(measured),
            Self::Xsens => xsens(measured),
            Self::VectorNavBinary => vectornav(measured),
            Self::VectorNavAscii => vectornav_line(measured),
            Self::XImu3 => ximu3(measured),
            Self::Teapot => teapot(measured),
            Self::Csv => format!("{}\r\n", line(measured)).into_bytes(),
            Self::Nmea => sealed(&format!("IMU,{}", line(measured))),
            Self::Cobs => cobs(&record(measured)),
            Self::Slip => stuffed(&record(measured), 0xC0),
            Self::SlimeVr => slimevr(measured),
            Self::MovellaDot(payload) => stuffed(&notification(payload, measured), 0xC0),
        }
    }
}

/// The nearest count, kept inside a signed word.
fn count(value: f64, per_unit: f64) -> i16 {
    (value * per_unit).round().clamp(f64::from(i16::MIN), f64::from(i16::MAX)) as i16
}

fn sum(bytes: &[u8]) -> u8 {
    (bytes.iter().map(|byte| u32::from(*byte)).sum::<u32>() & 0xFF) as u8
}

fn microseconds(measured: &Measured) -> u64 {
    (measured.device_s * 1e6).round() as u64
}

/// Counts of acceleration, angular rate and angle: full scale 16 g, 2000 deg/s, 180 deg.
fn wit_counts(measured: &Measured) -> [[i16; 3]; 3] {
    let full = 32_768.0;
    [
        measured.specific_force_m_s2.map(|a| count(a / G, full / 16.0)),
        measured.rate_rad_s.map(|w| count(w.to_degrees(), full / 2000.0)),
        turn::to_euler(measured.orientation).map(|angle| count(angle.to_degrees(), full / 180.0)),
    ]
}

fn witmotion(measured: &Measured) -> Vec<u8> {
    let mut out = Vec::new();
    for (kind, counts) in (0x51_u8..).zip(wit_counts(measured)) {
        let start = out.len();
        out.extend([0x55, kind]);
        // The fourth word of all three: 25.00 degrees Celsius.
        for word in counts.into_iter().chain([2500]) {
            out.extend(word.to_le_bytes());
        }
        out.push(sum(&out[start..]));
    }
    out
}

fn witmotion_ble(measured: &Measured) -> Vec<u8> {
    let words = wit_counts(measured);
    let bytes = words.iter().flatten().flat_map(|word| word.to_le_bytes());
    [0x55, 0x61].into_iter().chain(bytes).collect()
}

fn rvc(measured: &Measured) -> Vec<u8> {
    let [roll, pitch, yaw] =
        turn::to_euler(measured.orientation).map(|angle| count(angle.to_degrees(), 100.0));
    let milli_g = measured.specific_force_m_s2.map(|a| count(a / G, 1000.0));
    let mut out = vec![0xAA, 0xAA, (measured.number & 0xFF) as u8];
    for word in [yaw, pitch, roll].into_iter().chain(milli_g) {
        out.extend(word.to_le_bytes());
    }
    out.extend([0, 0, 0]);
    out.push(sum(&out[2..]));
    out
}

fn floats_be(values: &[f64]) -> impl Iterator<Item = u8> {
    values.iter().flat_map(|value| (*value as f32).to_be_bytes())
}

fn floats_le(values: &[f64]) -> impl Iterator<Item = u8> {
    values.iter().flat_map(|value| (*value as f32).to_le_bytes())
}

fn xsens(measured: &Measured) -> Vec<u8> {
    let mut items = vec![0x10, 0x20, 2];
    items.extend(((measured.number & 0xFFFF) as u16).to_be_bytes());
    items.extend([0x10, 0x60, 4]);
    items.extend((((measured.device_s * 1e4).round() as u64 & 0xFFFF_FFFF) as u32).to_be_bytes());
    items.extend([0x20, 0x10, 16]);
    items.extend(floats_be(&measured.orientation));
    items.extend([0x40, 0x20, 12]);
    items.extend(floats_be(&measured.specific_force_m_s2));
    items.extend([0x80, 0x20, 12]);
    items.extend(floats_be(&measured.rate_rad_s));
    let mut out = vec![0xFA, 0xFF, 0x36, items.len() as u8];
    out.extend(items);
    // All bytes after the preamble add up to zero.
    out.push(sum(&out[1..]).wrapping_neg());
    out
}

/// Orientation as VectorNav tells it: body X forward, Y right, Z down; world north, east, down.
fn north_east_down(q: [f64; 4]) -> [f64; 4] {
    let world = [0.0, FRAC_1_SQRT_2, FRAC_1_SQRT_2, 0.0];
    let body = [0.0, 1.0, 0.0, 0.0];
    turn::times(turn::times(turn::inverse(world), q), body)
}

fn right_down([x, y, z]: [f64; 3]) -> [f64; 3] {
    [x, -y, -z]
}

fn vectornav(measured: &Measured) -> Vec<u8> {
    let [w, x, y, z] = north_east_down(measured.orientation);
    // Group Common: TimeStartup (0), Quaternion (4), AngularRate (5), Accel (8).
    let mut out = vec![0xFA, 0x01];
    out.extend((1_u16 | 1 << 4 | 1 << 5 | 1 << 8).to_le_bytes());
    out.extend(((measured.device_s * 1e9).round() as u64).to_le_bytes());
    out.extend(floats_le(&[x, y, z, w]));
    out.extend(floats_le(&right_down(measured.rate_rad_s)));
    out.extend(floats_le(&right_down(measured.specific_force_m_s2)));
    let mut crc = 0_u16;
    for byte in &out[1..] {
        // As printed in the manual, "16-bit CRC".
        crc = crc.rotate_left(8);
        crc ^= u16::from(*byte);
        crc ^= (crc & 0xFF) >> 4;
        crc ^= crc << 12;
        crc ^= (crc & 0x00FF) << 5;
    }
    out.extend(crc.to_be_bytes());
    out
}

fn vectornav_line(measured: &Measured) -> Vec<u8> {
    let [w, x, y, z] = north_east_down(measured.orientation);
    let field = right_down(measured.field_t).map(|tesla| tesla * 1e4);
    let force = right_down(measured.specific_force_m_s2);
    let rate = right_down(measured.rate_rad_s);
    let cells = |values: &[f64], digits: usize| {
        values.iter().map(|value| format!(",{value:+.digits$}")).collect::<String>()
    };
    let mut body = "VNQMR".to_owned();
    body += &cells(&[x, y, z, w], 6);
    body += &cells(&field, 4);
    body += &cells(&force, 3);
    body += &cells(&rate, 6);
    sealed(&body)
}

/// `$...*HH`.
fn sealed(body: &str) -> Vec<u8> {
    let check = body.bytes().fold(0, |check, byte| check ^ byte);
    format!("${body}*{check:02X}\r\n").into_bytes()
}

fn ximu3(measured: &Measured) -> Vec<u8> {
    let message = |letter: u8, values: &[f64]| {
        let mut plain = vec![0x80 | letter];
        plain.extend(microseconds(measured).to_le_bytes());
        plain.extend(floats_le(values));
        stuffed(&plain, b'\n')
    };
    let rate = measured.rate_rad_s.map(f64::to_degrees);
    let force = measured.specific_force_m_s2.map(|a| a / G);
    let mut out = message(b'M', &measured.field_t.map(|tesla| tesla * 1e4));
    out.extend(message(b'I', &[rate, force].concat()));
    out
}

/// SLIP with another end byte.
fn stuffed(plain: &[u8], end: u8) -> Vec<u8> {
    let escaped = plain.iter().flat_map(|&byte| match byte {
        0xDB => vec![0xDB, 0xDD],
        _ if byte == end => vec![0xDB, 0xDC],
        _ => vec![byte],
    });
    escaped.chain([end]).collect()
}

fn teapot(measured: &Measured) -> Vec<u8> {
    let mut out = vec![0x24, 0x02];
    for element in measured.orientation {
        out.extend(count(element, 16_384.0).to_be_bytes());
    }
    out.extend([0, (measured.number & 0xFF) as u8, b'\r', b'\n']);
    out
}

fn line(measured: &Measured) -> String {
    let [ax, ay, az] = measured.specific_force_m_s2;
    let [gx, gy, gz] = measured.rate_rad_s;
    let time = microseconds(measured) & 0xFFFF_FFFF;
    format!("{time},{ax:.4},{ay:.4},{az:.4},{gx:.6},{gy:.6},{gz:.6}")
}

fn record(measured: &Measured) -> Vec<u8> {
    let time = (microseconds(measured) & 0xFFFF_FFFF) as u32;
    let values = [measured.specific_force_m_s2, measured.rate_rad_s].concat();
    time.to_le_bytes().into_iter().chain(floats_le(&values)).collect()
}

/// A record is shorter than 254 bytes here: each block says how far it is to the next zero.
fn cobs(plain: &[u8]) -> Vec<u8> {
    let mut out = vec![0];
    let mut code_at = 0;
    for &byte in plain {
        if byte == 0 {
            out[code_at] = (out.len() - code_at) as u8;
            code_at = out.len();
            out.push(0);
        } else {
            out.push(byte);
        }
    }
    out[code_at] = (out.len() - code_at) as u8;
    out.push(0);
    out
}

fn slimevr(measured: &Measured) -> Vec<u8> {
    let [w, x, y, z] = measured.orientation;
    let mut out = vec![0, 0, 0, 23];
    out.extend(measured.number.to_be_bytes());
    out.push(0);
    for element in [x, y, z, w] {
        out.extend(count(element, 32_768.0).to_be_bytes());
    }
    for acceleration in measured.linear_acceleration_m_s2 {
        out.extend(count(acceleration, 128.0).to_be_bytes());
    }
    out
}

/// Filled up with zeros to the length of its characteristic: 20, 40 or 63 bytes.
fn notification(payload: DotPayload, measured: &Measured) -> Vec<u8> {
    let quaternion = || measured.orientation.to_vec();
    let euler = || turn::to_euler(measured.orientation).map(f64::to_degrees).to_vec();
    let force = || measured.specific_force_m_s2.to_vec();
    let rate = || measured.rate_rad_s.map(f64::to_degrees).to_vec();
    // In the world: the sensor's own, turned.
    let free = || {
        let [x, y, z] = measured.linear_acceleration_m_s2;
        let back = turn::inverse(measured.orientation);
        turn::times(turn::times(measured.orientation, [0.0, x, y, z]), back)[1..].to_vec()
    };
    let (values, length) = match payload {
        DotPayload::ExtendedQuaternion | DotPayload::CompleteQuaternion => {
            ([quaternion(), free()].concat(), 40)
        }
        DotPayload::OrientationQuaternion => (quaternion(), 20),
        DotPayload::RateQuantities => ([force(), rate()].concat(), 40),
        DotPayload::CustomMode1 => ([euler(), free(), rate()].concat(), 40),
        DotPayload::CustomMode5 => ([quaternion(), force(), rate()].concat(), 63),
    };
    let mut out = ((microseconds(measured) & 0xFFFF_FFFF) as u32).to_le_bytes().to_vec();
    out.extend(floats_le(&values));
    if payload == DotPayload::ExtendedQuaternion {
        // The magnetic field is new; nothing is clipped.
        out.extend([0x00, 0x02, 0, 0]);
    }
    out.resize(length, 0);
    out
}
