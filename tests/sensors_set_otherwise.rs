//! Sensors with a clock that are set to another rate than their profile's are counted by that clock: what they send is written here
//! from their makers' manuals, and shares nothing with the simulator. All of it is recorded, in virtual time.

mod program;

use gaitway::capture::{Captured, Chain, Mode};
use gaitway::device::sensor::stream_format;
use gaitway::job::source_words;
use gaitway::recording::{
    Overview, RecordedSource, Recorder, RunEnd, RunStart, SourceKind, SourceRecord, summary,
};
use gaitway::sensing::SourceReport;
use gaitway::time::Instant;
use gaitway::wire::sensor::Stream;
use glam::DVec3;
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// Turns to both sides of where it began, about the vertical, by so much, deg, so often a second.
const SWING_DEG: f64 = 60.0;
const SWINGS_HZ: f64 = 0.5;
const SECONDS: f64 = 15.0;

/// Rate of turn, deg/s.
fn rate_deg_s(t: f64) -> f64 {
    SWING_DEG * TAU * SWINGS_HZ * (TAU * SWINGS_HZ * t).cos()
}

/// A line of a sketch: microseconds, m/s^2, rad/s. The sketch's clock goes round after 71 minutes: it does here, after eight seconds.
fn sketch(_: u32, t: f64) -> Vec<u8> {
    let us = u32::MAX.wrapping_sub(8_000_000).wrapping_add((t * 1e6) as u32);
    format!("{us},0,0,9.80665,0,0,{:.5}\r\n", rate_deg_s(t).to_radians()).into_bytes()
}

/// The same, of a sketch that counts milliseconds: `millis() * 1000`.
fn coarse_sketch(_: u32, t: f64) -> Vec<u8> {
    let ms = (t * 1e3 + 1e-6) as u32;
    format!("{},0,0,9.80665,0,0,{:.5}\r\n", ms * 1000, rate_deg_s(t).to_radians()).into_bytes()
}

/// x-IMU3 user manual, inertial message: microseconds, gyroscope in deg/s, accelerometer in g.
fn x_imu3(_: u32, t: f64) -> Vec<u8> {
    let us = (t * 1e6).round() as u64;
    format!("I,{us},0.0000,0.0000,{:.4},0.0000,0.0000,1.0000\r\n", rate_deg_s(t)).into_bytes()
}

/// VN-100 user manual, binary output: the group Common with TimeStartup (ns), AngularRate (rad/s) and Accel (m/s^2); the CRC is sent high
/// byte first. Z points down.
fn vectornav(_: u32, t: f64) -> Vec<u8> {
    let mut packet = vec![0xFA, 0x01, 0x21, 0x01];
    packet.extend(((t * 1e9).round() as u64).to_le_bytes());
    let floats = [0.0, 0.0, rate_deg_s(t).to_radians(), 0.0, 0.0, -9.807];
    floats.iter().for_each(|float| packet.extend((*float as f32).to_le_bytes()));
    let mut crc: u16 = 0;
    for byte in &packet[1..] {
        crc = crc.rotate_right(8) ^ u16::from(*byte);
        crc ^= (crc & 0xFF) >> 4;
        crc ^= crc << 12;
        crc ^= (crc & 0x00FF) << 5;
    }
    packet.extend(crc.to_be_bytes());
    packet
}

/// Movella DOT, rate quantities (XD0506P, table 15) in a SLIP frame (RFC 1055): microseconds, m/s^2, deg/s.
fn movella_dot(_: u32, t: f64) -> Vec<u8> {
    let mut record = ((t * 1e6).round() as u32).to_le_bytes().to_vec();
    let floats = [0.0, 0.0, 9.80665, 0.0, 0.0, rate_deg_s(t)];
    floats.iter().for_each(|float| record.extend((*float as f32).to_le_bytes()));
    let mut frame = Vec::new();
    for byte in record {
        match byte {
            0xC0 => frame.extend([0xDB, 0xDC]),
            0xDB => frame.extend([0xDB, 0xDD]),
            _ => frame.push(byte),
        }
    }
    frame.push(0xC0);
    frame
}

/// MTData2: packet counter, sample time in 0.1 ms, acceleration, rate of turn. All bytes after the first add up to nothing.
fn xsens(n: u32, t: f64) -> Vec<u8> {
    let mut data = vec![0x10, 0x20, 2];
    data.extend((n as u16).to_be_bytes());
    data.extend([0x10, 0x60, 4]);
    data.extend(((t * 1e4 + 1e-6) as u32).to_be_bytes());
    for (id, z) in [(0x4020_u16, 9.80665), (0x8020, rate_deg_s(t).to_radians())] {
        data.extend(id.to_be_bytes());
        data.push(12);
        [0.0, 0.0, z].iter().for_each(|float| data.extend((*float as f32).to_be_bytes()));
    }
    let mut packet = vec![0xFA, 0xFF, 0x36, data.len() as u8];
    packet.extend(data);
    let sum = packet[1..].iter().fold(0_u8, |sum, byte| sum.wrapping_add(*byte));
    packet.push(sum.wrapping_neg());
    packet
}

/// Of a sample with this number that is taken at this time, s.
type Emitter = fn(u32, f64) -> Vec<u8>;

/// The profile, what is sent, and whether it is counted.
const EMITTERS: [(&str, Emitter, bool); 6] = [
    ("arduino-csv", sketch, false),
    ("arduino-csv", coarse_sketch, false),
    ("x-imu3", x_imu3, false),
    ("vectornav-vn100", vectornav, false),
    ("movella-dot-rate", movella_dot, false),
    ("xsens-mti", xsens, true),
];

/// What became of a sensor that was recorded.
struct Recorded {
    captured: Vec<Captured>,
    report: SourceReport,
    kept: Overview,
    words: String,
}

/// Records samples that are taken at these times, s, of which some are lost, and that are read every 4 ms.
fn recorded(
    name: &str,
    (profile, emit, _): (&str, Emitter, bool),
    taken_s: impl Iterator<Item = f64>,
    is_lost: impl Fn(u32) -> bool,
) -> Recorded {
    let start = RunStart {
        robot: String::new(),
        motion: String::new(),
        joints: Vec::new(),
        wall_clock_start: std::time::UNIX_EPOCH,
        monotonic_start: Instant::from_nanos(1_000_000_000),
        gaitway_version: String::new(),
        metadata: BTreeMap::new(),
    };
    let file = program::folder(name).join("take.mcap");
    let recorder = Recorder::create_for_sources(&file, true, start).expect("a file");
    let metadata = BTreeMap::new();
    let source = RecordedSource { name: "torso".to_owned(), metadata, kind: SourceKind::Imu };
    let id = recorder.add_source(source);
    let sensor = gaitway_profiles::sensor(profile).expect("shipped");
    let mut stream = Stream::new(stream_format(&sensor).expect("columns").expect("a stream"));
    let mut chain = Chain::new(&sensor, Mode::SixAxes);
    let mut all = Vec::new();
    for (n, taken_s) in (0..).zip(taken_s).filter(|(n, _)| !is_lost(*n)) {
        let read_s = (taken_s / 0.004).ceil() * 0.004;
        let arrival = Instant::from_nanos(((1.0 + read_s) * 1e9) as u64);
        stream.push(&emit(n, taken_s), |reading| {
            for captured in chain.take(&reading, arrival).into_iter().flatten() {
                recorder.take_record(id, SourceRecord::Sample(Box::new(captured)));
                all.push(captured);
            }
        });
    }
    assert_eq!(stream.counts().bad, 0, "{name}");
    let end = RunEnd {
        outcome: "done".to_owned(),
        stop_reason: None,
        at: Instant::from_nanos(60_000_000_000),
        metadata: BTreeMap::new(),
    };
    assert!(recorder.finish(end).is_complete(), "{name}");
    let report = SourceReport::of("torso", &chain);
    let mut words = String::new();
    source_words::heard(&report, &mut words);
    Recorded { captured: all, report, kept: summary(&file).expect("the recording"), words }
}

fn evenly(rate_hz: f64) -> impl Iterator<Item = f64> {
    (0..(SECONDS * rate_hz) as u32).map(move |n| f64::from(n) / rate_hz)
}

/// Half of the way from the furthest to one side to the furthest to the other, deg.
fn amplitude_deg(found: &[Captured]) -> f64 {
    let yaw_deg = |captured: &Captured| {
        let forward = captured.fused?.orientation * DVec3::X;
        Some(forward.y.atan2(forward.x).to_degrees())
    };
    let headings = found.iter().filter_map(yaw_deg);
    let (least, most) = headings.fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), yaw| {
        (least.min(yaw), most.max(yaw))
    });
    (most - least) / 2.0
}

#[test]
fn nothing_is_missing_of_who_is_set_to_another_rate_and_that_rate_is_told_beside_the_profiles() {
    for (at, emitter) in EMITTERS.into_iter().enumerate() {
        let profile_hz = gaitway_profiles::sensor(emitter.0).expect("shipped").rate_hz;
        for rate_hz in [40.0, 50.0, 100.0, 200.0] {
            let name = format!("whole-{at}-{rate_hz}");
            let Recorded { captured, report, kept, words } =
                recorded(&name, emitter, evenly(rate_hz), |_| false);
            assert_eq!(captured.len() as f64, SECONDS * rate_hz, "{name}");
            assert!(report.lossless(), "{name}: {report:?}");
            let torso = &kept.sources["torso"];
            assert_eq!((torso.gaps, torso.missed, torso.damaged), (0, 0, 0), "{name}");
            let told = format!("sends {rate_hz:.1} Hz where its profile says {profile_hz}");
            let is_told = words.contains(&told);
            assert_eq!(is_told, (rate_hz - profile_hz).abs() > 1.0, "{name}: {words}");
            let amplitude = amplitude_deg(&captured);
            assert!((amplitude / SWING_DEG - 1.0).abs() < 0.01, "{name}: {amplitude}");
        }
    }
}

/// One in ten, without a pattern, among the first as well, and once twenty in a row: of each kind as many as were, however often it samples.
#[test]
fn what_is_lost_is_counted_by_the_rate_of_the_device_in_the_report_and_in_the_recording() {
    for (at, emitter) in EMITTERS.into_iter().enumerate() {
        for rate_hz in [50.0, 80.0, 100.0, 200.0] {
            let name = format!("lossy-{at}-{rate_hz}");
            // The golden ratio spreads them evenly and without a pattern.
            let is_lost =
                |n: u32| (f64::from(n) * 0.618_034).fract() > 0.9 || (400..420).contains(&n);
            let Recorded { captured, report, kept, words } =
                recorded(&name, emitter, evenly(rate_hz), is_lost);
            let sent = (SECONDS * rate_hz) as u32;
            // After the last that came nobody knows of more.
            let last = (0..sent).rev().find(|n| !is_lost(*n)).expect("one that came");
            let lost = (0..last).filter(|n| is_lost(*n)).count() as u64;
            assert!(is_lost(8) && lost > 60, "{name}: {lost}");
            assert_eq!(report.counts.missed, lost, "{name}: {words}");
            assert!(!report.lossless(), "{name}");
            let torso = &kept.sources["torso"];
            assert_eq!((torso.missed, torso.damaged), (lost, 0), "{name}");
            let newest = captured.last().expect("samples").stamp.number;
            assert_eq!(newest, u64::from(last), "{name}: numbers count what is missing");
        }
    }
}

/// Who counts lost every second sample; who does not looks like one of half the rate.
#[test]
fn who_counts_and_loses_every_second_sample_is_not_said_to_send_half_as_often() {
    let Recorded { report, words, .. } =
        recorded("half", EMITTERS[5], evenly(100.0), |n| n % 2 == 1);
    assert_eq!(report.counts.missed, 749, "{words}");
    assert!(words.contains("749 missing") && !words.contains("profile"), "{words}");
}

#[test]
fn a_rate_that_is_changed_amid_a_recording_is_followed() {
    for (at, emitter) in EMITTERS.into_iter().enumerate() {
        // From the sixth second on it is half of what it was.
        let taken_s = (0..600).map(|n| f64::from(n) * 0.01);
        let taken_s = taken_s.chain((0..450).map(|n| 6.0 + f64::from(n) * 0.02));
        let is_lost = |n: u32| (900..903).contains(&n);
        let name = format!("changed-{at}");
        let Recorded { captured, report, kept, words } = recorded(&name, emitter, taken_s, is_lost);
        // Those three; and by the clock alone, the first long step may well be a loss at the rate before.
        let missed = 3 + u64::from(!emitter.2);
        assert_eq!(report.counts.missed, missed, "{name}: {words}");
        assert_eq!(kept.sources["torso"].missed, missed, "{name}");
        let rate_hz = report.rate_hz.expect("known");
        assert!((rate_hz - 50.0).abs() < 0.1, "{name}: {rate_hz}");
        let amplitude = amplitude_deg(&captured);
        assert!((amplitude / SWING_DEG - 1.0).abs() < 0.03, "{name}: {amplitude}");
    }
}
