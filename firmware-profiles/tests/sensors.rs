//! Sensor files: what the shipped ones say, and what is refused.

use gaitway_profiles::{ProfileError, Quantity, Sensor, hex_bytes, parse_sensor, sensor};

const PATTERN: &str = include_str!("../sensors/arduino-csv.toml");

fn refused(old: &str, new: &str, said: &str) {
    assert!(PATTERN.contains(old), "{old:?} is not in the file");
    let text = PATTERN.replacen(old, new, 1);
    let error: ProfileError = parse_sensor("arduino-csv.toml", &text).expect_err(new);
    assert!(error.to_string().contains(said), "{error}");
}

#[test]
fn a_file_with_a_mistake_is_refused_by_name() {
    refused("name = \"arduino-csv\"", "name = \"other\"", "name of its file");
    refused("rate_hz = 100.0", "rate_hz = nan", "above zero");
    refused("rate_hz = 100.0", "rate_hz = 100.0\nlatency_s = -0.1", "latency");
    refused("rate_hz = 100.0", "rate_hz = 100.0\naxes = [\"y\", \"x\", \"z\"]", "right-handed");
    refused("rate_hz = 100.0", "rate_hz = 100.0\naxes = [\"x\", \"x\", \"z\"]", "right-handed");
    refused("rate_hz = 100.0", "rate_hz = 100.0\nstart = [\"F\"]", "not a command");
    refused("rate_hz = 100.0", "rate_hz = 100.0\nspeed = 3", "there is no key");
    refused("bits = 32", "bits = 99", "no counter has this width");
    refused("tick_s = 1e-6", "tick_s = 0.0", "above zero");
    refused("\"ax\"", "\"bx\"", "no column");
    refused("\"ax\"", "\"ay\"", "same column twice");
    refused("\"ax\"", "\"ax:f32\"", "no column");
    refused("protocol = \"lines\"", "protocol = \"cobs\"", "no column");
    refused("protocol = \"lines\"", "protocol = \"xsens\"", "do not fit");
    refused("baud_bps = 115200", "baud_bps = 0", "line speed");
    refused("unit = \"m/s2\"", "unit = \"deg/s\"", "another unit");
    refused("scale = 1.0", "scale = 0.0", "scale of zero");
    refused("range = 400.0", "range = -1.0", "above zero");
    refused(
        "quantity = \"angular-rate\"\nunit = \"rad/s\"",
        "quantity = \"acceleration\"\nunit = \"m/s2\"",
        "same quantity twice",
    );
}

#[test]
fn a_sensor_without_a_required_channel_is_refused() {
    let text = PATTERN.replace("scale = 1.0", "scale = 1.0\noptional = true");
    let error = parse_sensor("arduino-csv.toml", &text).expect_err("nothing required");
    assert!(error.to_string().contains("whole"), "{error}");
}

/// WitMotion's manual: full scales 16 g, 2000 deg/s, 180 deg over 32768 counts.
#[test]
fn scales_are_those_of_the_manuals() {
    let channel = |name: &str, quantity| {
        let sensor: Sensor = sensor(name).expect("shipped");
        let channel = sensor.channel(quantity).expect("it has it").clone();
        channel.scale * channel.unit.in_si()
    };
    let near = |found: f64, expected: f64| assert!((found / expected - 1.0).abs() < 1e-12);
    near(channel("witmotion-wt901", Quantity::Acceleration) * 32_768.0, 16.0 * 9.80665);
    near(channel("witmotion-wt901", Quantity::AngularRate) * 32_768.0, 2000_f64.to_radians());
    near(channel("bno08x-rvc", Quantity::Euler), 0.01_f64.to_radians());
    near(channel("mpu6050-teapot", Quantity::Orientation) * 16_384.0, 1.0);
}

#[test]
fn commands_are_hexadecimal() {
    assert_eq!(hex_bytes("FF AA 69"), Some(vec![0xFF, 0xAA, 0x69]));
    assert_eq!(hex_bytes("ffaa"), Some(vec![0xFF, 0xAA]));
    assert_eq!(hex_bytes(""), Some(vec![]));
    assert_eq!(hex_bytes("F"), None);
    assert_eq!(hex_bytes("GG"), None);
}
