//! `gaitway record` on three sensors, killed at a hundred random moments: the file holds every sample
//! that was sent up to a second before, exactly as it was sent, and what is missing is counted.
//!
//! The sensors are played by this test itself, so that it knows to the moment what was sent when.
//! Time is real; what is compared with the second is each sample's own time of sending, so a machine
//! that stands still while it plays makes nothing fail.

mod aloud;
mod program;

use aloud::aloud;
use gaitway::port::{Clock, MonotonicClock};
use gaitway::time::{Duration, Instant};
use gaitway_sim::imu::{BodyMotion, ImuErrors, ImuWire, Mount, Sent, VirtualImu};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;
use std::collections::BTreeMap;
use std::io::Write;
use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::Stdio;

const KILLS: usize = 100;
/// So many recordings run side by side.
const AT_ONCE: usize = 20;
/// Kills are spread over so long: more than two synchronisations, ten chunks.
const LONGEST: Duration = Duration::from_millis(2500);
/// What may be lost.
const LOSS: Duration = Duration::from_secs(1);
const RATE_HZ: f64 = 100.0;
/// Name in the recording, profile, what it speaks, seconds per tick of its clock.
const SENSORS: [(&str, &str, ImuWire, f64); 3] = [
    ("left", "xsens-mti", ImuWire::Xsens, 1e-4),
    ("middle", "cobs-imu", ImuWire::Cobs, 1e-6),
    ("right", "arduino-csv", ImuWire::Csv, 1e-6),
];

fn folder() -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("recording-killed-sensors");
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).expect("a temporary folder");
    folder
}

/// A sensor's end of a line, once the program has come to the other.
///
/// Over TCP: a kernel that is busy hands what is written to a pseudo-terminal on when it comes to it, on
/// some machines after more than a second, and what had not reached the program when it was killed is no
/// loss of the recording.
struct Line {
    listener: TcpListener,
    address: String,
}

fn line() -> Line {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).expect("a port");
    let address = format!("tcp:{}", listener.local_addr().expect("its address"));
    Line { listener, address }
}

impl Line {
    fn accept(&self) -> TcpStream {
        let (stream, _) = self.listener.accept().expect("the program");
        stream.set_nodelay(true).expect("an option");
        stream
    }
}

/// What a sensor sends: a swing about two axes, another for each sensor.
fn sensor(index: usize) -> VirtualImu {
    let seconds = 30.0;
    let angle = |n: u32| 0.4 * (f64::from(n) / 50.0 * (2.0 + index as f64)).sin();
    let turns: Vec<_> = (0..(seconds * 50.0) as u32)
        .map(|n| [(angle(n) / 2.0).cos(), (angle(n) / 2.0).sin(), 0.0, 0.0])
        .collect();
    let motion = BodyMotion::new(50.0, &vec![[0.0; 3]; turns.len()], &turns).expect("a motion");
    VirtualImu::new(motion, Mount::default(), ImuErrors::default(), SENSORS[index].2, RATE_HZ)
        .expect("a sensor")
}

/// A sample that went out, and the moment just before it did.
type Out = (Sent, Instant);

/// Records in a child process, plays the sensors to it and kills it after `time`: what was sent by
/// sensor, and the moment of the kill.
fn record_and_kill(path: &Path, time: Duration) -> (Vec<Vec<Out>>, Instant) {
    let lines: Vec<Line> = SENSORS.iter().map(|_| line()).collect();
    let sources = SENSORS
        .iter()
        .zip(&lines)
        .map(|((name, profile, ..), line)| format!("{name}=imu:{profile}@{}", line.address));
    let mut child = crate::program::gaitway()
        .args(["record", "--quiet", "-o"])
        .arg(path)
        .args(sources)
        .stdout(Stdio::null())
        .spawn()
        .expect("the command");
    let mut lines: Vec<TcpStream> = lines.iter().map(Line::accept).collect();
    // All lines are open before the file is made.
    let patience = MonotonicClock.now() + Duration::from_secs(30);
    while !path.exists() {
        assert!(MonotonicClock.now() < patience, "no recording was begun");
        assert!(child.try_wait().expect("its state").is_none(), "it ended");
        std::thread::sleep(Duration::from_millis(1));
    }
    let began = MonotonicClock.now();
    let mut sensors: Vec<_> = (0..SENSORS.len()).map(|index| sensor(index).peekable()).collect();
    let mut sent = vec![Vec::new(); SENSORS.len()];
    while MonotonicClock.now() < began + time {
        for ((sensor, line), sent) in sensors.iter_mut().zip(&mut lines).zip(&mut sent) {
            let due = |sample: &Sent| began + Duration::from_secs_f64(sample.due_s);
            while let Some(sample) = sensor.next_if(|s| due(s) <= MonotonicClock.now()) {
                let at = MonotonicClock.now();
                line.write_all(&sample.bytes).expect("a line");
                sent.push((sample, at));
            }
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    child.kill().expect("killed"); // SIGKILL
    let killed = MonotonicClock.now();
    let _ = child.wait();
    (sent, killed)
}

/// Messages by topic, as the MCAP library reads them, checksums and all.
fn messages(path: &Path, finished: bool) -> BTreeMap<String, Vec<Value>> {
    let bytes = std::fs::read(path).expect("a file");
    if bytes.is_empty() {
        return BTreeMap::new(); // killed between making the file and writing its start
    }
    let checked = mcap::read::Options::ValidateChunkCrcs;
    let options =
        if finished { checked.into() } else { checked | mcap::read::Options::IgnoreEndMagic };
    let stream = mcap::MessageStream::new_with_options(&bytes, options).expect("a recording");
    let mut found: BTreeMap<String, Vec<Value>> = BTreeMap::new();
    for message in stream.map_while(Result::ok) {
        let json = serde_json::from_slice(&message.data).expect("JSON");
        found.entry(message.channel.topic.clone()).or_default().push(json);
    }
    found
}

fn vector(sample: &Value, key: &str) -> [f64; 3] {
    ["x", "y", "z"].map(|axis| sample[key][axis].as_f64().unwrap_or(f64::NAN))
}

/// Holds the samples of a sensor against what it sent.
fn compare(index: usize, samples: &[Value], sent: &[Out], killed: Instant) {
    let (name, _, _, tick_s) = SENSORS[index];
    for (number, sample) in samples.iter().enumerate() {
        let (out, at) = &sent[number];
        let ticks = sample["device_ticks"].as_f64().expect("a clock");
        assert_eq!((ticks * tick_s * RATE_HZ).round(), number as f64, "{name}: all, in order");
        assert_eq!(sample["number"], number);
        assert!(sample["host_monotonic_ns"].as_u64() >= Some(at.as_nanos()), "{name}: read before");
        // The counts of the coarsest of the three, single precision.
        for (key, truth, most) in [
            ("linear_acceleration", out.truth.specific_force_m_s2, 1e-4),
            ("angular_velocity", out.truth.rate_rad_s, 1e-5),
        ] {
            for (found, truth) in vector(sample, key).into_iter().zip(truth) {
                assert!((found - truth).abs() < most, "{name} {number} {key}: {found}, {truth}");
            }
        }
    }
    if let Some((_, at)) = sent.get(samples.len()) {
        let lost = killed.since(*at);
        assert!(lost <= LOSS, "{name}: lost from {lost:?} before the kill on");
    }
}

/// Kills one recording, and holds its file and what `recover` makes of it against what was sent.
/// How long before the kill the first lost sample was sent.
fn trial(path: &Path, time: Duration) -> Duration {
    let (sent, killed) = record_and_kill(path, time);
    let found = messages(path, false);
    let mut lost = Duration::ZERO;
    for (index, (name, ..)) in SENSORS.iter().enumerate() {
        let samples = found.get(&format!("/imu/{name}/sample")).map_or(&[][..], Vec::as_slice);
        compare(index, samples, &sent[index], killed);
        let first_lost = sent[index].get(samples.len()).map_or(killed, |(_, at)| *at);
        lost = lost.max(killed.since(first_lost));
        let orientations = found.get(&format!("/imu/{name}/orientation")).map_or(0, Vec::len);
        assert_eq!(
            orientations,
            samples.len(),
            "{name}: a sample and its orientation stay together"
        );
    }
    if !found.is_empty() {
        recovered(path, &found);
    }
    lost
}

/// `recover` keeps every message, says what it kept of each sensor and that the file was cut off.
fn recovered(path: &Path, found: &BTreeMap<String, Vec<Value>>) {
    let output = crate::program::gaitway()
        .args(["recover", "--json"])
        .arg(path)
        .output()
        .expect("the command");
    assert_eq!(output.status.code(), Some(3), "{output:?}");
    let report: Value = serde_json::from_slice(&output.stdout).expect("a report");
    assert_eq!(report["was_finished"], false);
    assert_eq!(report["damaged"], 0, "nothing is missing in the middle");
    assert_eq!(report["messages"], found.values().map(Vec::len).sum::<usize>());
    for (name, ..) in SENSORS {
        let samples = found.get(&format!("/imu/{name}/sample")).map_or(0, Vec::len);
        let source = &report["sources"][name];
        assert_eq!(source["records"].as_u64().unwrap_or(0), samples as u64, "{name}");
        assert_eq!(source["gaps"].as_u64().unwrap_or(0), 0, "{name}");
    }
    let whole = PathBuf::from(report["path"].as_str().expect("a path"));
    assert_eq!(&messages(&whole, true), found);
}

#[test]
fn recordings_of_sensors_killed_at_a_hundred_random_moments_lose_at_most_a_second() {
    let folder = folder();
    let seed = 20_261_121;
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let times: Vec<Duration> =
        (0..KILLS).map(|_| LONGEST.mul_f64(random.random::<f64>())).collect();
    let mut lost = Vec::new();
    for (round, times) in times.chunks(AT_ONCE).enumerate() {
        let files = times
            .iter()
            .enumerate()
            .map(|(n, time)| (folder.join(format!("{round}-{n}.mcap")), *time));
        let trials: Vec<_> =
            files.map(|(path, time)| std::thread::spawn(move || trial(&path, time))).collect();
        for one in trials {
            lost.push(one.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
        }
    }
    lost.sort();
    let at = |share: usize| lost[(lost.len() - 1) * share / 100];
    aloud!("{KILLS} kills: median {:?}, 99 % {:?}, worst {:?} lost", at(50), at(99), at(100));
}
