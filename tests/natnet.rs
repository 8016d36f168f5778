//! NatNet: published packets, any bytes, and the command beside a stand-in for Motive. Time is real there.

mod program;

use gaitway::wire::natnet::{self, Body, Data, Frame, Message, Model, Part, Server, Version};
use proptest::prelude::*;
use serde_json::Value;
use std::collections::BTreeMap;
use std::net::{Ipv4Addr, SocketAddr, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

const fn version(major: u8, minor: u8) -> Version {
    Version { major, minor }
}

/// Packets by name; where they are from stands in the file.
fn packets() -> BTreeMap<String, Vec<u8>> {
    let mut found: BTreeMap<String, Vec<u8>> = BTreeMap::new();
    let mut name = String::new();
    for line in include_str!("natnet/packets.hex").lines().filter(|line| !line.starts_with('#')) {
        match line.strip_prefix("  ") {
            None => line.clone_into(&mut name),
            Some(digits) => {
                let byte = |at: usize| u8::from_str_radix(&digits[at..at + 2], 16).expect("hex");
                let bytes = (0..digits.len()).step_by(2).map(byte);
                found.entry(name.clone()).or_default().extend(bytes);
            }
        }
    }
    found
}

fn frame(packets: &BTreeMap<String, Vec<u8>>, name: &str, version: Version) -> Frame {
    match natnet::decode(&packets[name], Some(version)) {
        Ok(Message::Frame(frame)) => frame,
        other => panic!("{name}: {other:?}"),
    }
}

fn models(packets: &BTreeMap<String, Vec<u8>>, name: &str, version: Version) -> Vec<Model> {
    match natnet::decode(&packets[name], Some(version)) {
        Ok(Message::Models(models)) => models,
        other => panic!("{name}: {other:?}"),
    }
}

fn length(body: &Body) -> f64 {
    body.quaternion.iter().map(|part| part * part).sum::<f64>().sqrt()
}

/// What natnet-decode's own tests hold of them: one rigid body, tracked. Motive sent 120 frames a second.
#[test]
fn frames_that_motive_sent_are_read() {
    let packets = packets();
    for (name, minor, number, id) in [("frame-2.7", 7, 411_213, 1), ("frame-2.9", 9, 11_823_217, 2)]
    {
        let first = frame(&packets, name, version(2, minor));
        let next = frame(&packets, &format!("{name}-next"), version(2, minor));
        assert_eq!(first.number, number, "{name}");
        let [body] = &first.bodies[..] else { panic!("{name}: {first:?}") };
        assert_eq!((body.part, body.is_tracked), (Part::Body(id), true), "{name}");
        assert!((length(body) - 1.0).abs() < 1e-6, "{name}: {body:?}");
        let frames = f64::from(next.number - first.number);
        let period_s = (next.time_s - first.time_s) / frames;
        assert!((period_s * 120.0 - 1.0).abs() < 1e-3, "{name}: {period_s} s");
    }
    // w is the last of the four on the wire, and the first here: this body lies nearly as it was made.
    let lying = frame(&packets, "frame-2.7", version(2, 7)).bodies[0];
    assert!(lying.quaternion[0] > 0.999, "{lying:?}");
}

#[test]
fn servers_say_what_they_speak_and_where_they_stream_to() {
    let packets = packets();
    let old = Server { version: version(2, 9), ticks_per_s: 0, data: None };
    let data = Some(Data { port: 1511, group: Some([239, 255, 42, 99]) });
    let new = Server { version: version(4, 1), ticks_per_s: 10_000_000, data };
    for (name, expected) in [("server-2.9", old), ("server-4.1", new)] {
        // Whoever does not know the version asks for it by this very message.
        assert_eq!(natnet::decode(&packets[name], None), Ok(Message::Server(expected)), "{name}");
    }
    assert_eq!(natnet::decode(&packets["frame-4.1"], None), Ok(Message::Other(7)));
}

#[test]
fn a_frame_is_read_in_every_version_with_its_bones_and_around_what_is_not_read() {
    let packets = packets();
    let half = f64::from(0.5_f32.sqrt());
    for (major, minor) in [(3, 0), (3, 1), (4, 0), (4, 1)] {
        let name = format!("frame-{major}.{minor}");
        let found = frame(&packets, &name, version(major, minor));
        let body = |part, quaternion, is_tracked| Body { part, quaternion, is_tracked };
        let mut bodies = vec![
            body(Part::Body(7), [0.5, 0.5, -0.5, 0.5], true),
            body(Part::Body(8), [1.0, 0.0, 0.0, 0.0], false),
            body(Part::Bone(3, 1), [1.0, 0.0, 0.0, 0.0], true),
            body(Part::Bone(3, 2), [half, half, 0.0, 0.0], true),
        ];
        if (major, minor) == (4, 1) {
            bodies.push(body(Part::OfAsset(9, 1), [half, 0.0, half, 0.0], true));
        }
        let expected = Frame {
            number: 4711,
            bodies,
            time_s: 12.25,
            exposed_ticks: 122_500_000,
            models_changed: true,
        };
        assert_eq!(found, expected, "{name}");
    }
}

#[test]
fn names_of_bodies_and_bones_are_read_in_every_version() {
    let packets = packets();
    for (major, minor) in [(3, 0), (3, 1), (4, 0), (4, 1)] {
        let name = format!("models-{major}.{minor}");
        let found = models(&packets, &name, version(major, minor));
        let model = |part, owner: Option<&str>, name: &str| {
            let owner = owner.map(str::to_owned);
            Model { part, owner, name: name.to_owned() }
        };
        let mut expected = vec![
            model(Part::Body(7), None, "left thigh"),
            model(Part::Bone(3, 1), Some("Ann"), "Ann_Hip"),
            model(Part::Bone(3, 2), Some("Ann"), "Ab"),
        ];
        if (major, minor) == (4, 1) {
            expected.push(model(Part::OfAsset(9, 1), Some("hand"), "palm"));
        }
        // Behind a force plate, a device and a camera.
        expected.push(model(Part::Body(8), None, "right thigh"));
        assert_eq!(found, expected, "{name}");
    }
    let quad = models(&packets, "models-3.0-received", version(3, 0));
    assert_eq!(quad, [Model { part: Part::Body(2), owner: None, name: "RaceQuad".to_owned() }]);
}

/// 4.2 tells of each body how it is turned on its parent: four numbers between its place and its markers.
#[test]
fn descriptions_that_tell_how_a_body_is_turned_are_read() {
    let text = |name: &str| [name.as_bytes(), &[0]].concat();
    let described = |name: &str, id: i32| {
        let turned = [0.0_f32, 0.6, 0.0, 0.8].map(f32::to_le_bytes).concat();
        // Its parent and its place; one marker, whose label and name follow.
        let marker = [&int(1)[..], &[0; 12 + 4], &text("m1")].concat();
        [text(name), id.to_le_bytes().to_vec(), vec![0; 4 + 12], turned, marker].concat()
    };
    let kind =
        |kind: usize, inside: Vec<u8>| [&int(kind)[..], &int(inside.len()), &inside].concat();
    let bones = [described("Ann_Hip", 1), described("Ab", 2)].concat();
    let skeleton = [text("Ann"), int(3).to_vec(), int(2).to_vec(), bones].concat();
    let all = [int(2).to_vec(), kind(1, described("wand", 7)), kind(2, skeleton)].concat();
    let read = natnet::decode(&datagram(5, &all), Some(version(4, 2)));
    let Ok(Message::Models(models)) = read else { panic!("{read:?}") };
    let told: Vec<_> = models.iter().map(|of| (of.part, of.name.as_str())).collect();
    let expected =
        [(Part::Body(7), "wand"), (Part::Bone(3, 1), "Ann_Hip"), (Part::Bone(3, 2), "Ab")];
    assert_eq!(told, expected);
}

/// The number of entries says nothing of their length; the size of a section does.
#[test]
fn what_a_newer_version_puts_behind_the_entries_of_a_section_is_passed_over() {
    let packets = packets();
    let whole = &packets["frame-4.1"];
    let number = |at: usize| i32::from_le_bytes(whole[at..at + 4].try_into().expect("four"));
    // Header, number, then counts and sizes of two sections of markers.
    let mut at = 4 + 4;
    for _ in 0..2 {
        at += 8 + number(at + 4) as usize;
    }
    let size = number(at + 4);
    let end = at + 8 + size as usize;
    let mut longer = whole.clone();
    longer[at + 4..at + 8].copy_from_slice(&(size + 6).to_le_bytes());
    longer.splice(end..end, [0xAA; 6]);
    let read = natnet::decode(&longer, Some(version(4, 3)));
    assert_eq!(read, natnet::decode(whole, Some(version(4, 1))));
}

#[test]
fn a_packet_that_is_cut_short_is_refused_wherever_it_is_cut() {
    for (name, packet) in packets() {
        let (_, of) = name.split_once('-').expect("a version");
        let mut numbers = of.split(['.', '-']).map(|number| number.parse().expect("a number"));
        let read_as = version(numbers.next().expect("major"), numbers.next().unwrap_or(0));
        assert!(natnet::decode(&packet, Some(read_as)).is_ok(), "{name}");
        // What ends a frame, four zeros, tells nothing.
        let needed = packet.len() - if name.starts_with("frame") { 4 } else { 0 };
        for end in 0..needed {
            assert!(natnet::decode(&packet[..end], Some(read_as)).is_err(), "{name} at {end}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// Packets with some bytes replaced, as any version: counts that are too large, or below zero, end.
    #[test]
    fn no_bytes_break_the_reader(
        which in 0..100_usize,
        damage in proptest::collection::vec((0..2000_usize, any::<u8>()), 0..8),
        cut in 0..3000_usize,
        major in 0..6_u8,
        minor in 0..12_u8,
    ) {
        let packets = packets();
        let mut packet = packets.values().nth(which % packets.len()).expect("one").clone();
        for (at, byte) in damage {
            let at = at % packet.len();
            packet[at] = byte;
        }
        packet.truncate(cut.max(4));
        if let Ok(Message::Frame(frame)) = natnet::decode(&packet, Some(version(major, minor))) {
            prop_assert!(frame.bodies.len() * 38 <= packet.len());
        }
    }
}

/// A stand-in for Motive, written from its documentation: it says who it is, what it streams, and streams from the first question
/// on, 100 frames a second.
struct Motive {
    port: u16,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

/// Orientation of a body at a time, x, y, z, w with Y up; `None`: it is not tracked.
type Pose = fn(&str, f64) -> Option<[f64; 4]>;

impl Motive {
    /// `group`: frames go there, and not to whoever asked. Every 50th frame is not sent.
    fn start(names: &'static [&'static str], pose: Pose, group: Option<SocketAddr>) -> Self {
        let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).expect("a port");
        let port = socket.local_addr().expect("an address").port();
        socket.set_nonblocking(true).expect("a socket");
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = Arc::clone(&stop);
        let thread = std::thread::spawn(move || {
            let mut client: Option<(SocketAddr, Instant)> = None;
            let mut number = 0_u32;
            while !stopped.load(Ordering::Acquire) {
                let mut question = [0; 512];
                while let Ok((count, from)) = socket.recv_from(&mut question) {
                    match question[..count] {
                        [0, 0, ..] => {
                            client.get_or_insert((from, Instant::now()));
                            let _ = socket.send_to(&server_info(group), from);
                        }
                        [4, 0, ..] => drop(socket.send_to(&model_def(names), from)),
                        [10, 0, ..] => {}
                        [9, 0, ..] => client = None,
                        ref other => panic!("no question: {other:?}"),
                    }
                }
                let Some((to, since)) = client else {
                    std::thread::sleep(Duration::from_millis(2));
                    continue;
                };
                let due = since + Duration::from_millis(10) * number;
                std::thread::sleep(due.saturating_duration_since(Instant::now()));
                if number % 50 != 49 {
                    let frame = frame_of_data(number, names, pose);
                    let _ = socket.send_to(&frame, group.unwrap_or(to));
                }
                number += 1;
            }
        });
        Self { port, stop, thread: Some(thread) }
    }
}

impl Drop for Motive {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            assert!(thread.join().is_ok() || std::thread::panicking(), "the stand-in broke");
        }
    }
}

fn datagram(id: u16, payload: &[u8]) -> Vec<u8> {
    [&id.to_le_bytes()[..], &(payload.len() as u16).to_le_bytes(), payload].concat()
}

fn int(value: usize) -> [u8; 4] {
    (value as u32).to_le_bytes()
}

/// Motive 3.1 with NatNet 4.1, whose clock ticks 10,000,000 times a second.
fn server_info(group: Option<SocketAddr>) -> Vec<u8> {
    let mut payload = vec![0; 256];
    payload[..6].copy_from_slice(b"Motive");
    payload.extend([3, 1, 0, 0, 4, 1, 0, 0]);
    payload.extend(10_000_000_u64.to_le_bytes());
    payload.extend(group.map_or(1511, |group| group.port()).to_le_bytes());
    payload.push(u8::from(group.is_some()));
    match group {
        Some(SocketAddr::V4(group)) => payload.extend(group.ip().octets()),
        _ => payload.extend([0; 4]),
    }
    datagram(1, &payload)
}

fn model_def(names: &[&str]) -> Vec<u8> {
    let mut payload = int(names.len()).to_vec();
    for (id, name) in names.iter().enumerate() {
        let mut body = [name.as_bytes(), &[0], &int(id + 1), &[0xFF; 4], &[0; 12]].concat();
        // One marker: where it is, its label, its name.
        body.extend([&int(1)[..], &[0; 12 + 4], b"Marker1\0"].concat());
        payload.extend([&int(1)[..], &int(body.len()), &body].concat());
    }
    datagram(5, &payload)
}

fn frame_of_data(number: u32, names: &[&str], pose: Pose) -> Vec<u8> {
    let time_s = f64::from(number) / 100.0;
    let mut bodies = Vec::new();
    for (id, name) in names.iter().enumerate() {
        bodies.extend(int(id + 1));
        let told = pose(name, time_s);
        let [x, y, z, w] = told.unwrap_or([0.0, 0.0, 0.0, 1.0]);
        for value in [0.1, 1.0, 0.2, x, y, z, w, 0.0004] {
            bodies.extend((value as f32).to_le_bytes());
        }
        bodies.extend(u16::from(told.is_some()).to_le_bytes());
    }
    let none = [0; 8];
    let mut payload = number.to_le_bytes().to_vec();
    payload.extend([none, none].concat());
    payload.extend([&int(names.len())[..], &int(bodies.len()), &bodies].concat());
    // Skeletons, assets, labelled markers, force plates, devices; time code.
    payload.extend([none; 5].concat());
    payload.extend(none);
    payload.extend(time_s.to_le_bytes());
    for delay_s in [0.0, 0.003, 0.004] {
        payload.extend((((1000.0 + time_s + delay_s) * 1e7) as u64).to_le_bytes());
    }
    payload.extend([0; 8 + 2 + 4]);
    datagram(7, &payload)
}

fn about([x, y, z]: [f64; 3], angle: f64) -> [f64; 4] {
    let (sin, cos) = (angle / 2.0).sin_cos();
    [x * sin, y * sin, z * sin, cos]
}

fn json(output: &std::process::Output) -> Value {
    serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|e| panic!("no report ({e}): {}", String::from_utf8_lossy(&output.stderr)))
}

/// Turns to the left by 1 rad/s; the second is not seen from 0.5 to 0.8 s.
fn turning(name: &str, time_s: f64) -> Option<[f64; 4]> {
    let is_hidden = name == "hidden" && (0.5..0.8).contains(&time_s);
    (!is_hidden).then(|| about([0.0, 1.0, 0.0], time_s))
}

fn record(group: Option<SocketAddr>, test: &str) {
    let folder = program::folder(test);
    let motive = Motive::start(&["left thigh", "hidden"], turning, group);
    let output = program::gaitway()
        .current_dir(&folder)
        .args(["record", "-o", "take.mcap", "--json", "--for", "3s"])
        .arg(format!("imu:natnet@udp:127.0.0.1:{}", motive.port))
        .output()
        .expect("the command");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(3), "{said}");
    assert!(said.contains("NatNet 4.1 of 127.0.0.1 is heard"), "{said}");
    let report = json(&output);
    let sources = report["sources"].as_array().expect("sources");
    let names: Vec<&str> = sources.iter().filter_map(|source| source["name"].as_str()).collect();
    assert_eq!(names, ["left_thigh", "hidden"], "{report}");
    for (source, hidden) in sources.iter().zip([0, 30]) {
        let count = |key: &str| source["counts"][key].as_u64().expect("a number");
        let samples = count("samples");
        assert!(samples > 150 - hidden, "{source}");
        // Every 50th frame was not sent, and all others came.
        let frames = samples + hidden;
        assert!(count("missed").abs_diff(frames / 49) <= 1, "{source}");
        assert_eq!((&source["incomplete"], count("resets")), (&hidden.into(), 0), "{source}");
        assert!(source["skew_ppm"].as_f64().expect("a number").abs() < 5000.0, "{source}");
    }
    let convert = ["convert", "take.mcap", "take.csv"];
    let table = program::gaitway().current_dir(&folder).args(convert).output().expect("runs");
    assert!(matches!(table.status.code(), Some(0 | 3)), "{table:?}");
    let text = std::fs::read_to_string(folder.join("take.csv")).expect("a table");
    let mut lines = text.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let titles = lines.next().expect("titles");
    let column = |title: &str| titles.iter().position(|&other| other == title).expect("a column");
    let [sensor, taken, w, x, y, z, fused] =
        ["sensor", "taken_s", "device_w", "device_x", "device_y", "device_z", "fused_w"]
            .map(column);
    let turned: Vec<(f64, f64)> = lines
        .filter(|row| row[sensor] == "left_thigh")
        .map(|row| {
            let number = |at: usize| row[at].parse::<f64>().expect("a number");
            // Up is Z here, and nothing is tilted: what Motive turned about Y is turned about Z.
            assert!(number(x).abs() < 1e-6 && number(y).abs() < 1e-6, "{row:?}");
            assert!(row[fused].is_empty(), "{row:?}");
            (number(taken), 2.0 * number(z).atan2(number(w)))
        })
        .collect();
    let ((first_s, first), (last_s, last)) = (turned[0], turned[turned.len() - 1]);
    let off = (last - first).rem_euclid(std::f64::consts::TAU) - (last_s - first_s);
    assert!(off.abs() < 0.01, "{off} rad in {} s", last_s - first_s);
}

#[test]
fn bodies_that_are_streamed_to_this_host_are_recorded_with_what_is_lost() {
    record(None, "natnet-unicast");
}

#[test]
fn bodies_that_are_streamed_to_a_group_are_recorded_with_what_is_lost() {
    let free = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).and_then(|socket| socket.local_addr());
    let port = free.expect("a port").port();
    record(Some(SocketAddr::from(([239, 255, 42, 99], port))), "natnet-group");
}

/// Stands in N pose, trembling as people do, and bends the right elbow by 60 degrees from 6.5 to 7.5 s on.
fn bending(name: &str, time_s: f64) -> Option<[f64; 4]> {
    let tremble = 0.002 * (time_s * 37.0).sin();
    // Faces Z; X is to the left. What hangs down comes forward by turning against X.
    let bent = if name == "R Forearm" { (time_s - 6.5).clamp(0.0, 1.0) * 60_f64 } else { 0.0 };
    Some(about([1.0, 0.0, 0.0], tremble - bent.to_radians()))
}

#[test]
fn whoever_wears_markers_is_followed_by_the_names_of_rigid_bodies() {
    let folder = program::folder("natnet-live");
    let motive = Motive::start(&["Chest", "R UpperArm", "R Forearm", "ball"], bending, None);
    let output = program::gaitway()
        .current_dir(&folder)
        .args("live --dry-run --json --n-pose-after 500ms --no-t-pose --for 6s".split(' '))
        .args(["--from", &format!("imu:natnet@udp:127.0.0.1:{}", motive.port)])
        .args("--wear torso=Chest --wear right_upper_arm=R_UpperArm".split(' '))
        .args(["--wear", "right_forearm=R_Forearm"])
        .output()
        .expect("the command");
    let report = json(&output);
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(report["outcome"], "done", "{report}\n{said}");
    let angle_deg = |joint: &str| report["angles_rad"][joint].as_f64().expect(joint).to_degrees();
    assert!((angle_deg("right_elbow_flexion") - 60.0).abs() < 2.0, "{report}");
    assert!(angle_deg("right_shoulder_flexion").abs() < 2.0, "{report}");
    assert!(!said.contains("ball"), "{said}");
}

#[test]
fn a_server_that_does_not_answer_is_looked_for_and_told() {
    let folder = program::folder("natnet-silent");
    let silent = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).expect("a port");
    let address = silent.local_addr().expect("an address");
    let output = program::gaitway()
        .current_dir(&folder)
        .args(["record", "-o", "take.mcap", "--json", "--for", "4s"])
        .arg(format!("imu:natnet@udp:{address}"))
        .output()
        .expect("the command");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.contains("no server answers") && said.contains(&address.to_string()), "{said}");
    let ended = &json(&output)["sources"][0]["ended"];
    assert_eq!(ended, "no server has answered");
    // It was asked by what Motive's documentation has: 270 bytes of a sender and its wishes.
    let mut question = [0; 512];
    let (count, _) = silent.recv_from(&mut question).expect("a question");
    assert_eq!((count, &question[..4]), (274, &[0, 0, 0x0E, 0x01][..]));
}
