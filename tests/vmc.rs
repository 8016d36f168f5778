//! Whoever wears sensors, as programs that draw avatars receive it: bundles of OSC by the Virtual Motion Capture protocol,
//! read here and by python-osc.

mod aloud;
mod program;
#[allow(dead_code)] // the environment of all others is not needed here
mod python;

use aloud::aloud;
use gaitway::body::worn::check::t_pose;
use gaitway::body::{Dof, JointAngles, Proportions};
use gaitway::job::bvh_stream::BvhStream;
use gaitway::job::observer::{Event, Nobody, Observer as _};
use gaitway::job::source::body_motion;
use gaitway::job::vmc::Avatar;
use glam::{DQuat, DVec3};
use std::collections::BTreeMap;
use std::io::{BufRead as _, BufReader};
use std::net::{TcpStream, UdpSocket};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Time in which what must happen has happened, however busy the machine is.
const PATIENCE: Duration = Duration::from_secs(60);

/// What a message says.
#[derive(Clone, Debug, PartialEq)]
enum Said {
    Int(i32),
    Float(f32),
    Text(String),
}

/// A text, and what comes after it and its zeros.
fn text(bytes: &[u8]) -> (String, &[u8]) {
    let end = bytes.iter().position(|&byte| byte == 0).expect("a zero");
    let filled = (end / 4 + 1) * 4;
    assert!(bytes[end..filled].iter().all(|&byte| byte == 0), "filled with zeros");
    (String::from_utf8(bytes[..end].to_vec()).expect("text"), &bytes[filled..])
}

/// The messages of a bundle that is for now (OSC 1.0).
fn messages(packet: &[u8]) -> Vec<(String, Vec<Said>)> {
    let mut rest = packet.strip_prefix(b"#bundle\0\0\0\0\0\0\0\0\x01").expect("a bundle for now");
    let mut all = Vec::new();
    while let Some((length, after)) = rest.split_first_chunk::<4>() {
        let (message, after) = after.split_at(u32::from_be_bytes(*length) as usize);
        let (address, values) = text(message);
        let (tags, mut values) = text(values);
        let mut said = Vec::new();
        for tag in tags.strip_prefix(',').expect("type tags").chars() {
            if tag == 's' {
                let (words, left) = text(values);
                said.push(Said::Text(words));
                values = left;
                continue;
            }
            let (number, left) = values.split_first_chunk::<4>().expect("four bytes");
            said.push(match tag {
                'i' => Said::Int(i32::from_be_bytes(*number)),
                'f' => Said::Float(f32::from_be_bytes(*number)),
                tag => panic!("{tag} is no type that was agreed on"),
            });
            values = left;
        }
        assert!(values.is_empty(), "nothing is left over in {address}");
        all.push((address, said));
        rest = after;
    }
    assert!(rest.is_empty());
    all
}

/// Bones by name: place, and turn as x, y, z, w.
fn bones(packet: &[u8]) -> BTreeMap<String, ([f32; 3], [f32; 4])> {
    let of_bone = |(address, said): (String, Vec<Said>)| {
        if address != "/VMC/Ext/Bone/Pos" {
            return None;
        }
        let [Said::Text(name), numbers @ ..] = &said[..] else { panic!("{said:?}") };
        let number = |at: usize| match numbers[at] {
            Said::Float(number) => number,
            ref other => panic!("{other:?}"),
        };
        assert_eq!(numbers.len(), 7);
        let place = [0, 1, 2].map(number);
        Some((name.clone(), (place, [3, 4, 5, 6].map(number))))
    };
    messages(packet).into_iter().filter_map(of_bone).collect()
}

fn receiver() -> (UdpSocket, String) {
    let socket = UdpSocket::bind("127.0.0.1:0").expect("a port");
    socket.set_read_timeout(Some(PATIENCE)).expect("patience");
    let place = socket.local_addr().expect("an address").to_string();
    (socket, place)
}

fn packet(socket: &UdpSocket) -> Vec<u8> {
    let mut bytes = vec![0; 65536];
    let count = socket.recv(&mut bytes).expect("a packet");
    bytes.truncate(count);
    bytes
}

/// The packet of somebody who stands so, the pelvis turned so.
fn packet_of(angles: &JointAngles, pelvis: DQuat) -> Vec<u8> {
    let (socket, place) = receiver();
    let avatar = Avatar::new(&Nobody, Some(&place)).expect("it can be sent to");
    assert!(avatar.looks());
    let pose = angles.to_pose(DVec3::ZERO, pelvis);
    avatar.hear(Event::Posed { pose: &pose, sensors: &[None; 13], angles, age_s: 0.01 });
    packet(&socket)
}

fn near(found: &[f32], wanted: &[f32]) -> bool {
    found.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-4)
}

const NOT_TURNED: [f32; 4] = [0.0, 0.0, 0.0, 1.0];
const HALF: f32 = std::f32::consts::FRAC_1_SQRT_2;

#[test]
fn a_bundle_begins_with_what_the_protocol_demands() {
    let said = messages(&packet_of(&JointAngles::default(), DQuat::IDENTITY));
    let addresses: Vec<&str> = said.iter().map(|(address, _)| address.as_str()).collect();
    assert_eq!(addresses[..3], ["/VMC/Ext/OK", "/VMC/Ext/T", "/VMC/Ext/Root/Pos"]);
    assert_eq!(said[0].1, [Said::Int(1)]);
    let root: Vec<Said> = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0].map(Said::Float).to_vec();
    assert_eq!(said[2].1, [&[Said::Text("root".to_owned())][..], &root].concat());
    assert!(addresses[3..].iter().all(|address| *address == "/VMC/Ext/Bone/Pos"));
    assert_eq!(addresses.len(), 3 + 13);
}

#[test]
fn in_t_pose_no_bone_is_turned_and_arms_lie_along_unitys_x() {
    let bones = bones(&packet_of(&t_pose(), DQuat::IDENTITY));
    for (name, (_, turn)) in &bones {
        assert!(near(turn, &NOT_TURNED), "{name}: {turn:?}");
    }
    // Unity's X is to the right: the left forearm is on the left of the left upper arm.
    let place = |name: &str| bones[name].0;
    let [left, right] = [place("LeftLowerArm"), place("RightLowerArm")];
    assert!(left[0] < -0.2 && left[1].abs() < 1e-3 && left[2].abs() < 1e-3, "{left:?}");
    assert!(near(&right, &[-left[0], left[1], left[2]]), "{right:?}");
    let shank = place("LeftLowerLeg");
    assert!(shank[1] < -0.3 && shank[0].abs() < 1e-3, "{shank:?}");
    let hips = place("Hips");
    assert!((0.7..1.1).contains(&hips[1]), "so high over the floor: {hips:?}");
}

#[test]
fn arms_that_hang_are_turned_down_about_unitys_z_and_each_to_its_side() {
    let bones = bones(&packet_of(&JointAngles::default(), DQuat::IDENTITY));
    // About Z by 90 degrees -X goes to -Y, and the other way X does.
    assert!(near(&bones["LeftUpperArm"].1, &[0.0, 0.0, HALF, HALF]), "{bones:?}");
    assert!(near(&bones["RightUpperArm"].1, &[0.0, 0.0, -HALF, HALF]), "{bones:?}");
    for name in ["LeftLowerArm", "RightLowerArm", "Spine", "Head", "Hips", "LeftUpperLeg"] {
        assert!(near(&bones[name].1, &NOT_TURNED), "{name}: {bones:?}");
    }
}

#[test]
fn whoever_turns_to_the_left_turns_against_unitys_y_and_bends_forward_about_its_x() {
    let quarter = std::f64::consts::FRAC_PI_2;
    let turned = bones(&packet_of(&t_pose(), DQuat::from_rotation_z(quarter)));
    // Clockwise about Y, seen from above, is positive where Z is forward and X to the right.
    assert!(near(&turned["Hips"].1, &[0.0, -HALF, 0.0, HALF]), "{turned:?}");
    assert!(near(&turned["Spine"].1, &NOT_TURNED), "it turns with the hips");
    let bowed = bones(&packet_of(&t_pose(), DQuat::from_rotation_y(quarter)));
    // About X by 90 degrees Y, up, goes to Z, forward.
    assert!(near(&bowed["Hips"].1, &[HALF, 0.0, 0.0, HALF]), "{bowed:?}");
}

#[test]
fn a_knee_that_bends_moves_the_shank_back_against_its_thigh() {
    let mut angles = t_pose();
    angles[Dof::LeftKneeFlexion] = std::f64::consts::FRAC_PI_2;
    let bones = bones(&packet_of(&angles, DQuat::IDENTITY));
    // About X by 90 degrees down, -Y, goes to -Z, back.
    assert!(near(&bones["LeftLowerLeg"].1, &[HALF, 0.0, 0.0, HALF]), "{bones:?}");
    assert!(near(&bones["LeftFoot"].1, &NOT_TURNED), "it goes with the shank");
    assert!(near(&bones["RightLowerLeg"].1, &NOT_TURNED));
}

#[test]
fn a_bone_is_turned_and_placed_against_the_bone_that_carries_it_however_that_is_turned() {
    let mut angles = t_pose();
    angles[Dof::LeftKneeFlexion] = std::f64::consts::FRAC_PI_2;
    let upright = bones(&packet_of(&angles, DQuat::IDENTITY));
    let pelvis = DQuat::from_rotation_z(1.0) * DQuat::from_rotation_y(0.6);
    let turned = bones(&packet_of(&angles, pelvis));
    for name in upright.keys().filter(|name| *name != "Hips") {
        let [one, other] = [&upright, &turned].map(|bones| bones[name]);
        assert!(near(&one.0, &other.0) && near(&one.1, &other.1), "{name}: {one:?}, {other:?}");
    }
}

#[test]
fn nobody_is_sent_to_without_a_place_and_a_place_that_is_none_is_refused() {
    let silent = Avatar::new(&Nobody, None).expect("nothing to open");
    assert!(!silent.looks());
    for place in ["here", "127.0.0.1", "127.0.0.1:port"] {
        let Err(error) = Avatar::new(&Nobody, Some(place)) else { panic!("{place} is no address") };
        let words = error.to_string();
        assert!(words.contains(place) && words.contains("39539"), "{words}");
    }
}

/// What a program that connects is sent within this time: whole lines.
fn sent(stream: &TcpStream, stops: impl Fn(&str) -> bool) -> String {
    stream.set_read_timeout(Some(PATIENCE)).expect("patience");
    let mut told = String::new();
    let mut reader = BufReader::new(stream);
    while !stops(&told) {
        assert!(reader.read_line(&mut told).expect("a line") > 0, "nothing more is sent: {told}");
    }
    told
}

#[test]
fn whoever_connects_is_sent_a_hierarchy_and_then_a_line_for_each_pose() {
    let stream = BvhStream::new(&Nobody, Some("127.0.0.1:0")).expect("it listens");
    assert!(stream.looks());
    let address = stream.address().expect("an address");
    let elbows: Vec<f64> = (0..20).map(|n| f64::from(n) * 0.05).collect();
    let posed = |elbow_rad: f64| {
        let mut angles = JointAngles::default();
        angles[Dof::LeftElbowFlexion] = elbow_rad;
        let pose = angles.to_pose(DVec3::Z * 7.0, DQuat::IDENTITY);
        stream.hear(Event::Posed {
            pose: &pose,
            sensors: &[None; 13],
            angles: &angles,
            age_s: 0.01,
        });
    };
    posed(0.0);
    let first = TcpStream::connect(address).expect("it is let in");
    elbows.iter().for_each(|elbow_rad| posed(*elbow_rad));
    let second = TcpStream::connect(address).expect("it is let in");
    posed(1.0);
    // Of the file that a program keeps, once it writes down how many poses there are, angles are as they were told.
    let frames =
        |told: &str| told.split("Frame Time").nth(1).map_or(0, |of| of.lines().count() - 1);
    let told = sent(&first, |told| frames(told) == elbows.len() + 1);
    assert!(told.starts_with("HIERARCHY\n") && told.contains("\nFrames: 0\n"), "{told}");
    let text = told.replace("Frames: 0", &format!("Frames: {}", elbows.len() + 1));
    let file = program::folder("kept").join("kept.bvh");
    std::fs::write(&file, &text).expect("written");
    let (capture, _) =
        body_motion(&file.display().to_string(), None, &Default::default()).expect("a person");
    // The pelvis is as high as in somebody who stands, in cm, Y up; soles have a thickness.
    let height_cm = Proportions::of_stature(1.75).expect("a body").root_height_m() * 100.0;
    for line in text.split("Frame Time").nth(1).expect("poses").lines().skip(1) {
        let up: f64 = line.split(' ').nth(1).expect("a place").parse().expect("a number");
        assert!((up - height_cm).abs() < 1.5, "{up} {height_cm}");
    }
    for (pose, elbow_rad) in capture.poses.iter().zip(elbows.iter().chain(&[1.0])) {
        let found = JointAngles::of_pose(pose).angles[Dof::LeftElbowFlexion];
        assert!((found - elbow_rad).abs() < 1e-3, "{found} {elbow_rad}");
    }
    assert_eq!(capture.poses.len(), elbows.len() + 1);
    let told = sent(&second, |told| frames(told) == 1);
    assert_eq!(told.lines().last(), text.lines().last(), "whoever comes later sees what is now");
}

#[test]
fn whoever_reads_nothing_or_goes_away_holds_up_nobody() {
    let stream = BvhStream::new(&Nobody, Some("127.0.0.1:0")).expect("it listens");
    let address = stream.address().expect("an address");
    let posed = || {
        let angles = JointAngles::default();
        let pose = angles.to_pose(DVec3::ZERO, DQuat::IDENTITY);
        stream.hear(Event::Posed {
            pose: &pose,
            sensors: &[None; 13],
            angles: &angles,
            age_s: 0.01,
        });
    };
    let _deaf: Vec<TcpStream> = (0..7).map(|_| TcpStream::connect(address).expect("in")).collect();
    drop(TcpStream::connect(address).expect("it is let in"));
    posed();
    posed();
    // The place of the one who went is free; more than eight are not served.
    let reads = TcpStream::connect(address).expect("it is let in");
    posed();
    let mut refused = TcpStream::connect(address).expect("the system lets it knock");
    posed();
    refused.set_read_timeout(Some(PATIENCE)).expect("patience");
    assert_eq!(std::io::Read::read(&mut refused, &mut [0; 16]).unwrap_or(0), 0);
    // Those who read nothing are let go once too much waits for them; the one who reads has it all.
    let reading = std::thread::spawn(move || {
        let lines = sent(&reads, |told| told.lines().count() > 20_000);
        lines.lines().count()
    });
    while !reading.is_finished() {
        posed();
    }
    assert!(reading.join().expect("it has read") > 20_000);
    let late = TcpStream::connect(address).expect("the system lets it knock");
    late.set_nonblocking(true).expect("looked at");
    let hears = || late.peek(&mut [0; 16]).is_ok_and(|count| count > 0);
    let mut tries = 0;
    while !hears() {
        posed();
        tries += 1;
        assert!(tries < 500_000, "the places of those who read nothing are not given to others");
    }
    let words = BvhStream::new(&Nobody, Some("here")).err().expect("no address").to_string();
    assert!(words.contains("--bvh here") && words.contains("127.0.0.1:7001"), "{words}");
}

const READER: &str = "\
import sys
from pythonosc.osc_bundle import OscBundle
for message in OscBundle(sys.stdin.buffer.read()):
    print(message.address, *message.params)
";

#[test]
fn python_osc_reads_the_same() {
    let environment =
        python::environment("python-osc", &[include_str!("python/osc.txt")], "pythonosc", |made| {
            made.pip("osc.txt", &[])
        });
    let folder = match environment {
        Ok(folder) => folder,
        Err(why) => {
            assert!(std::env::var_os("CI").is_none(), "python-osc cannot be had: {why}");
            aloud!("SKIPPED: python-osc has not read what is sent: {why}");
            return;
        }
    };
    let packet = packet_of(&JointAngles::default(), DQuat::IDENTITY);
    let mut reader = Command::new(folder.join("bin/python"))
        .args(["-c", READER])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("Python starts");
    let mut stdin = reader.stdin.take().expect("piped");
    std::io::Write::write_all(&mut stdin, &packet).expect("read");
    drop(stdin);
    let output = reader.wait_with_output().expect("its end");
    assert!(output.status.success());
    let words = String::from_utf8(output.stdout).expect("text");
    let lines: Vec<&str> = words.lines().collect();
    let ours = messages(&packet);
    assert_eq!(lines.len(), ours.len());
    for (line, (address, said)) in lines.into_iter().zip(ours) {
        let mut parts = line.split(' ');
        assert_eq!(parts.next(), Some(address.as_str()));
        for said in said {
            let part = parts.next().expect("a value");
            match said {
                Said::Text(words) => assert_eq!(part, words),
                Said::Int(number) => assert_eq!(part.parse(), Ok(number)),
                Said::Float(number) => assert_eq!(part.parse(), Ok(number), "{line}"),
            }
        }
    }
}

#[test]
fn live_sends_whoever_wears_sensors_without_a_robot_as_they_move() {
    let folder = program::folder("live");
    let mut simulate = program::gaitway();
    simulate.current_dir(&folder).args(["simulate", "imus", "--pty", "worn"]);
    simulate.args(["--wear", "torso,right_upper_arm,right_forearm", "--motion", "wave-r"]);
    let mut person = simulate.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().expect("runs");
    let mut told = String::new();
    let stdout = person.stdout.as_mut().expect("piped");
    BufReader::new(stdout).read_line(&mut told).expect("its doors are open");
    let (socket, place) = receiver();
    let mut live = program::gaitway();
    live.current_dir(&folder).args(["live", "--wear", "worn/wear.toml", "--dry-run", "--vmc"]);
    live.args([&place, "--n-pose-after", "500ms", "--no-t-pose", "-q"]);
    let mut live = live.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("runs");
    // The person shows T pose: the right arm, which hung, comes up.
    let began = Instant::now();
    let hangs = [0.0, 0.0, -HALF, HALF];
    let close = |turn: &[f32; 4], to: &[f32; 4]| {
        turn.iter().zip(to).map(|(a, b)| a * b).sum::<f32>().abs() > 0.98
    };
    let mut seen = [false; 2];
    while seen != [true; 2] {
        let bones = bones(&packet(&socket));
        let turn = bones["RightUpperArm"].1;
        seen[0] |= close(&turn, &hangs);
        seen[1] |= seen[0] && close(&turn, &NOT_TURNED);
        assert!(began.elapsed() < PATIENCE, "{seen:?}, {turn:?}");
        assert!(near(&bones["LeftUpperLeg"].1, &NOT_TURNED), "what is not worn is at rest");
    }
    for child in [&mut live, &mut person] {
        let id = child.id().to_string();
        assert!(Command::new("kill").args(["-INT", &id]).status().expect("kill").success());
        child.wait().expect("its end");
    }
    let refused = program::gaitway()
        .args(["live", "--from", "file:bow", "--dry-run", "--vmc", "127.0.0.1:1"])
        .output()
        .expect("runs");
    let said = program::words(&refused);
    assert!(!refused.status.success() && said.contains("--vmc"), "{said}");
}
