//! Any sensor stream in every format: no panic, progress at every step, and the same readings
//! whether the bytes arrive at once or a few at a time; samples of them are numbered in order and have
//! orientations that are some. SlimeVR and NatNet datagrams besides.

use gaitway::capture::{Chain, Mode};
use gaitway::time::{Duration, Instant};
use gaitway::wire::Decoded;
use gaitway::wire::natnet::{self, Message, Version};
use gaitway::wire::sensor::{Column, Format, Lines, Stream, decode, slimevr};
use gaitway_profiles::{Sensor, sensor};
use std::sync::LazyLock;

/// Shipped sensors, by number of format.
const SENSORS: [&str; 11] = [
    "witmotion-wt901",
    "witmotion-wt901ble",
    "bno08x-rvc",
    "xsens-mti",
    "vectornav-vn100",
    "vectornav-vn100-ascii",
    "x-imu3",
    "mpu6050-teapot",
    "cobs-imu",
    "slip-imu",
    "arduino-csv",
];

fn format(number: u8) -> Format {
    let columns = |text: &str| -> Vec<Column> {
        text.split(' ').filter_map(|name| name.parse().ok()).collect()
    };
    match number % 11 {
        0 => Format::WitMotion,
        1 => Format::WitMotionBle,
        2 => Format::Bno08xRvc,
        3 => Format::Xsens,
        4 => Format::VectorNavBinary,
        5 => Format::VectorNavAscii,
        6 => Format::XImu3,
        7 => Format::Teapot,
        8 => Format::Cobs(columns("counter:u8 ax:i16 -:u8 ticks:u64 gx:f64")),
        9 => Format::Slip(columns("ax:f32 ay:f32 az:f32")),
        _ => Format::Lines(Lines {
            prefix: if number < 128 { "$IMU".to_owned() } else { String::new() },
            check: number < 128,
            columns: columns("ticks ax ay az"),
        }),
    }
}

static PROFILES: LazyLock<Vec<Sensor>> =
    LazyLock::new(|| SENSORS.iter().map(|name| sensor(name).expect("a shipped sensor")).collect());

/// The readings as text: a reading may hold not-a-number, which equals nothing.
fn readings(format: &Format, line: &[u8], portion: usize) -> String {
    let mut stream = Stream::new(format.clone());
    let mut seen = String::new();
    for bytes in line.chunks(portion) {
        stream.push(bytes, |reading| seen += &format!("{reading:?}"));
    }
    seen
}

/// What becomes of the readings, and of those in a datagram.
fn samples(number: u8, line: &[u8]) {
    let profile = &PROFILES[usize::from(number) % SENSORS.len()];
    let mut chain = Chain::new(profile, Mode::NineAxes);
    let (mut now, mut last) = (Instant::ZERO, None);
    Stream::new(format(number)).push(line, |reading| {
        now = now + Duration::from_millis(u64::from(number));
        for captured in chain.take(&reading, now).into_iter().flatten() {
            if let Some(fused) = captured.fused {
                let length = fused.orientation.length();
                assert!((length - 1.0).abs() < 1e-6, "{captured:?}");
                assert!(last.is_none_or(|last| captured.stamp.number > last), "{captured:?}");
                last = Some(captured.stamp.number);
            }
        }
    });
    let mut messages = 0;
    let _ = slimevr::decode(line, |_| messages += 1);
    assert!(messages <= line.len());
    let version = Version { major: number % 8, minor: number / 8 };
    if let Ok(Message::Frame(frame)) = natnet::decode(line, Some(version)) {
        assert!(frame.bodies.len() <= line.len() / 38);
    }
}

// The first two bytes are the format and the portion in which the line arrives.
pub fn fuzz(input: &[u8]) {
    let [number, portion, line @ ..] = input else { return };
    samples(*number, line);
    let format = format(*number);
    let mut rest = line;
    loop {
        let taken = match decode(&format, rest) {
            Decoded::Need(more) => {
                assert!(more > 0 && rest.len() + more <= 1100);
                break;
            }
            Decoded::Packet(_, n) | Decoded::Bad(_, n) | Decoded::Skip(n) | Decoded::Echo(n) => n,
        };
        assert!(taken > 0 && taken <= rest.len());
        rest = &rest[taken..];
    }
    let portion = usize::from(*portion).max(1);
    assert_eq!(readings(&format, line, portion), readings(&format, line, line.len().max(1)));
}
