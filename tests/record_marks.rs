//! Marks that are set while a recording runs, and a tap that all sensors feel.

mod program;

use gaitway_sim::imu::{BodyMotion, ImuDoor, ImuErrors, ImuWire, Mount, Stage, VirtualImu};
use serde_json::Value;
use std::io::Write;
use std::process::Stdio;
use std::time::{Duration, Instant};

const TAP_S: f64 = 1.5;

/// A sensor that lies still, and is tapped: 2 mm up and down in 20 ms, 100 m/s^2.
fn sensor(wire: ImuWire, rate_hz: f64, late_s: f64) -> VirtualImu {
    let height = |n: u32| {
        let x = (f64::from(n) / 500.0 - TAP_S - late_s) / 0.01;
        let z = if x.abs() < 1.0 { 0.001 * (1.0 + (std::f64::consts::PI * x).cos()) } else { 0.0 };
        [0.0, 0.0, z]
    };
    let positions: Vec<[f64; 3]> = (0..30_000).map(height).collect();
    let turns = vec![[1.0, 0.0, 0.0, 0.0]; positions.len()];
    let motion = BodyMotion::new(500.0, &positions, &turns).expect("a motion");
    let errors = ImuErrors {
        acceleration_noise_m_s2: 0.03,
        clock_skew: 20e-6,
        latency_s: 0.002,
        jitter_s: 0.001,
        seed: 3,
        ..ImuErrors::default()
    };
    VirtualImu::new(motion, Mount::default(), errors, wire, rate_hz).expect("a sensor")
}

/// Records two sensors, the second of which is tapped so much later, and what `info` says of it.
fn recorded(name: &str, late_s: f64) -> (Value, String) {
    let folder = crate::program::folder(name);
    let stage = Stage::default();
    let open = |imu| ImuDoor::open_on(&stage, imu, 115_200, None).expect("a terminal");
    let left = open(sensor(ImuWire::Xsens, 100.0, 0.0));
    let right = open(sensor(ImuWire::Csv, 100.0, late_s));
    let mut child = crate::program::gaitway()
        .current_dir(&folder)
        .args(["record", "-o", "take.mcap", "--quiet", "--for", "3s"])
        .arg(format!("left=imu:xsens-mti@{}", left.path().display()))
        .arg(format!("right=imu:arduino-csv@{}", right.path().display()))
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .spawn()
        .expect("the command");
    let began = Instant::now();
    while !folder.join("take.mcap").exists() && began.elapsed() < Duration::from_secs(20) {
        std::thread::sleep(Duration::from_millis(10));
    }
    let mut operator = child.stdin.take().expect("its input");
    operator.write_all(b"\n").expect("typed");
    // A line has the moment at which it was read, and a busy machine may read the first one late.
    while rustix::io::ioctl_fionread(&operator).expect("a pipe") > 0
        && began.elapsed() < Duration::from_secs(20)
    {
        std::thread::sleep(Duration::from_millis(10));
    }
    std::thread::sleep(Duration::from_millis(600));
    operator.write_all(b"  the door opened \n").expect("typed");
    assert!(child.wait().expect("its end").code().is_some_and(|code| code == 0 || code == 3));
    let info = |arguments: &[&str]| {
        let output =
            crate::program::gaitway().current_dir(&folder).args(arguments).output().expect("info");
        String::from_utf8_lossy(&output.stdout).into_owned()
    };
    let json = info(&["info", "take.mcap", "--json"]);
    (serde_json::from_str(&json).expect("JSON"), info(&["info", "take.mcap"]))
}

#[test]
fn marks_are_in_the_recording_and_a_tap_shows_one_time_base() {
    let (told, text) = recorded("marks", 0.0);
    let markers = told["markers"].as_array().expect("markers");
    let texts: Vec<&str> = markers.iter().filter_map(|m| m["text"].as_str()).collect();
    assert_eq!(texts, ["mark", "the door opened"], "{text}");
    let between = markers[1]["at_s"].as_f64().unwrap() - markers[0]["at_s"].as_f64().unwrap();
    assert!((0.45..2.0).contains(&between), "{between}");
    assert_eq!(told["channels"]["/marker"], 2);
    let taps = told["taps"].as_array().expect("taps");
    assert_eq!(taps.len(), 1, "{text}");
    let offset = |name: &str| taps[0]["offset_s"][name].as_f64().expect("an offset");
    // Half a period each, and what a clock is off that was fitted for two seconds only.
    assert!((offset("left") - offset("right")).abs() < 0.015, "{text}");
    assert!(text.contains("marker    at") && text.contains("felt by 2 sensors"), "{text}");
}

#[test]
fn a_sensor_whose_time_differs_is_told() {
    let (told, text) = recorded("marks-late", 0.1);
    let tap = &told["taps"][0];
    let offset = |name: &str| tap["offset_s"][name].as_f64().expect("an offset");
    assert!((offset("right") - offset("left") - 0.1).abs() < 0.015, "{text}");
    assert!(text.contains("their times differ"), "{text}");
}
