//! A person with sensors drives a robot by the command: virtual sensors behind pseudo-terminals and
//! UDP, `gaitway live` as a process of its own, a virtual OP3. Time is real here unless a recording
//! is played: what a busy machine does to it is printed, not judged.

mod page;
mod program;

use gaitway::body::worn::Wearing;
use gaitway::body::worn::kept::Kept;
use gaitway::body::{Dof, Joint, JointAngles, Segment, SegmentPose};
use gaitway::job::model::robot_model;
use gaitway::job::simulate::person::{Person, RATE_HZ};
use gaitway::job::source::body_motion;
use gaitway::mocap::retarget::{Online, Settings};
use gaitway::recording::{self, read_orientations};
use gaitway::robot::Robot;
use gaitway_sim::imu::{BodyMotion, ImuDoor, ImuErrors, ImuWire, Mount, Stage, VirtualImu};
use glam::{DQuat, DVec3};
use serde_json::Value;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{Ipv4Addr, UdpSocket};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Real time for one person with many sensors at a time: together they would keep the processors from each other. One with a few may be beside.
static REAL_TIME: Mutex<()> = Mutex::new(());

fn alone() -> MutexGuard<'static, ()> {
    REAL_TIME.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Nothing here takes so long, however busy the machine is.
const PATIENCE: Duration = Duration::from_secs(120);

fn gaitway(folder: &Path) -> Command {
    let mut command = crate::program::gaitway();
    command.current_dir(folder).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

fn json(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|e| panic!("no report ({e}): {}", String::from_utf8_lossy(&output.stderr)))
}

fn words(text: &str) -> Vec<&str> {
    text.split_whitespace().collect()
}

/// A virtual person, ended with the test.
struct Wearer(Child);

impl Wearer {
    fn start(folder: &Path, arguments: &str) -> Self {
        let mut child = gaitway(folder)
            .args(["simulate", "imus"])
            .args(words(arguments))
            .spawn()
            .expect("runs");
        // The file of what is worn is complete once it says how to go on.
        let mut lines = BufReader::new(child.stderr.take().expect("piped")).lines();
        let ready = lines.by_ref().map_while(Result::ok).any(|line| line.contains("then:"));
        assert!(ready, "the virtual person did not come");
        std::thread::spawn(move || lines.map_while(Result::ok).for_each(drop));
        Self(child)
    }
}

impl Drop for Wearer {
    fn drop(&mut self) {
        signal(&self.0, "INT");
        let _ = self.0.wait();
    }
}

fn signal(child: &Child, name: &str) {
    let pid = child.id().to_string();
    let _ = Command::new("kill").args(["-s", name, &pid]).status();
}

/// What the person truly did.
struct Truth {
    poses: Vec<SegmentPose>,
    motion_at_s: f64,
}

impl Truth {
    fn of(motion: &str, stand_s: f64) -> Self {
        let (capture, _) = body_motion(motion, None, &Default::default()).expect("shipped");
        let person = Person::new(&capture, stand_s).expect("performed");
        Self { poses: person.poses().to_vec(), motion_at_s: person.motion_at_s() }
    }
}

fn rms_deg(squares: f64, count: usize) -> f64 {
    (squares / count.max(1) as f64).sqrt().to_degrees()
}

/// Joint angles from the recorded orientations and the kept calibration against the truth, from the
/// beginning of the motion on, deg: as the times say, and at the delay that fits best, for on a busy machine the first sample is
/// read some time after the person began.
fn body_errors_deg(recording: &Path, calibration: &Path, truth: &Truth) -> [f64; 2] {
    let text = std::fs::read_to_string(calibration).expect("kept");
    let kept = Kept::parse(&text).expect("a calibration");
    let mut wearing = Wearing::new(&kept.calibration);
    let segments: Vec<(String, Segment)> = kept
        .sensors
        .iter()
        .zip(&kept.calibration.mounts)
        .map(|(sensor, mount)| (sensor.clone(), mount.segment))
        .collect();
    let mut said = [None; 13];
    let (mut found, mut before_s) = (Vec::new(), 0.0);
    for sample in read_orientations(recording).expect("recorded") {
        let Some((_, segment)) = segments.iter().find(|(name, _)| **name == *sample.sensor) else {
            continue;
        };
        said[segment.index()] = sample.orientation;
        // The pelvis stands for a moment of all: one sample of each in ten milliseconds.
        if *segment != Segment::Pelvis || said.iter().any(Option::is_none) {
            continue;
        }
        let taken_s = (sample.read.as_secs_f64() - sample.age.as_secs_f64()).max(0.0);
        let moment = wearing.pose(&said, taken_s - before_s);
        before_s = taken_s;
        if taken_s < truth.motion_at_s {
            continue;
        }
        found.push((taken_s, moment.measured.angles));
    }
    assert!(found.len() > 100, "{}", found.len());
    let wanted: Vec<JointAngles> =
        truth.poses.iter().map(|pose| JointAngles::of_pose(pose).angles).collect();
    let error = |late_s: f64| {
        let mut squares = 0.0;
        for (taken_s, angles) in &found {
            let at = (((taken_s + late_s) * RATE_HZ).round() as usize).min(wanted.len() - 1);
            squares +=
                Dof::ALL.map(|dof| (angles[dof] - wanted[at][dof]).powi(2)).iter().sum::<f64>();
        }
        rms_deg(squares, found.len() * Dof::ALL.len())
    };
    [error(0.0), (0..50).map(|n| error(f64::from(n) * 0.01)).fold(f64::INFINITY, f64::min)]
}

/// What the robot did during the motion against what it was to do, at the delay that fits best, deg.
fn robot_error_deg(recording: &Path, truth: &Truth) -> f64 {
    let robot = Robot::load("op3").expect("shipped");
    let model = robot_model(&robot).expect("an anatomy");
    let start: Vec<f64> = robot.joints.iter().map(|joint| joint.initial_rad).collect();
    let mut online = Online::new(&model, &[true; 13], &start, &Settings::default()).expect("fits");
    let wanted: Vec<Vec<f64>> =
        truth.poses.iter().map(|pose| online.pose(pose, 1.0 / RATE_HZ).to_vec()).collect();
    let cycles = recording::read(recording).expect("recorded").cycles;
    let last = cycles.last().expect("cycles").at;
    // The last cycles belong to the pose at the end; how long before that the motion began is known.
    let length_s = truth.poses.len() as f64 / RATE_HZ - truth.motion_at_s;
    let error = |ended_s: f64| {
        let (mut squares, mut count) = (0.0, 0);
        for cycle in &cycles {
            let time_s = ended_s - last.seconds_since(cycle.at);
            if !(truth.motion_at_s..truth.motion_at_s + length_s).contains(&time_s) {
                continue;
            }
            let wanted = &wanted[((time_s * RATE_HZ) as usize).min(wanted.len() - 1)];
            for (joint, wanted) in cycle.joints.iter().zip(wanted) {
                let Some(present) = joint.present_position_rad else { continue };
                squares += (present - wanted).powi(2);
                count += 1;
            }
        }
        // Too little of the motion is no comparison.
        if count > 2000 { rms_deg(squares, count) } else { f64::INFINITY }
    };
    let candidates = (0..1500).map(|n| truth.motion_at_s + f64::from(n) * 0.02);
    candidates.map(error).fold(f64::INFINITY, f64::min)
}

/// One performance for all: recorded while a robot follows it in real time, and played again in
/// virtual time.
#[test]
fn a_person_with_13_sensors_walks_and_a_virtual_op3_walks_along_now_and_from_the_recording() {
    let _alone = alone();
    let folder = crate::program::folder("live-walk");
    let stand_s = 7.0;
    let wearer = Wearer::start(&folder, "--motion walk:6s --stand 7s --pty body --seed 3");
    let output = gaitway(&folder)
        .args(words(
            "live --wear body/wear.toml --robot op3 --hang --bus sim:pty --n-pose-after 500ms",
        ))
        .args(words("--moves bow --for 18s --record live.mcap --calibration-body body.toml"))
        .args(words("--subject p1 --rate 50 --html live.html --json"))
        .output()
        .expect("runs");
    let report = json(&output);
    drop(wearer);
    assert_eq!(report["outcome"], "done", "{report}");
    assert_eq!(report["referee"]["violations"], serde_json::json!([]));
    assert_eq!(report["sensors"].as_array().map(Vec::len), Some(13));
    assert!(report["worn"].as_object().expect("segments").values().all(|worn| worn == true));
    assert_eq!(report["html"], "live.html");
    for sensor in report["body"]["sensors"].as_array().expect("sensors") {
        let segment = sensor["segment"].as_str().expect("a name");
        let by = match segment {
            "pelvis" | "torso" | "head" => "movement",
            arm if arm.contains("arm") => "t_pose",
            _ => "strapping",
        };
        assert_eq!(sensor["heading_by"], by, "{segment}");
        assert!(sensor["off_t_pose_rad"].as_f64() < Some(0.1), "{sensor}");
    }
    let truth = Truth::of("walk:6s", stand_s);
    let (recorded, kept) = (folder.join("live.mcap"), folder.join("body.toml"));
    let figure = |name: &str| report["latency"][name].as_f64().unwrap_or(f64::NAN) * 1e3;
    println!(
        "now: motion to goal median {:.1} ms, p99 {:.1} ms; following {} s, stale {} s; robot against \
         truth {:.2} deg RMSE",
        figure("median_s"),
        figure("p99_s"),
        report["following_s"],
        report["stale_s"],
        robot_error_deg(&recorded, &truth)
    );

    let output = replaying(&folder)
        .args(words("--moves bow --record again.mcap --calibration-body again.toml --json"))
        .arg("--recognise")
        .output()
        .expect("runs");
    let again = json(&output);
    assert_eq!((&again["outcome"], output.status.code()), (&"done".into(), Some(0)), "{again}");
    assert_eq!(again["referee"]["violations"].as_array().map(Vec::len), Some(0));
    let [body_deg, fitted_deg] = body_errors_deg(&recorded, &folder.join("again.toml"), &truth);
    let robot_deg = robot_error_deg(&folder.join("again.mcap"), &truth);
    println!(
        "again: joints of the body {body_deg:.2} deg RMSE ({fitted_deg:.2} at best), robot {robot_deg:.2} deg RMSE"
    );
    strides_are_named(&again, &folder.join("again.mcap"));
    assert!(kept.exists());
    assert!(body_deg < 6.0 && fitted_deg < 3.0, "{body_deg} {fitted_deg}");
    assert!(robot_deg < 8.0, "{robot_deg}");

    swapped_legs_end_it_unless_that_is_insisted_on(&folder);
    take_up_what_was_kept(&folder);
    whom_it_followed_stands_beside_it(&folder);
    the_recording_knows_its_wearer(&folder);
}

/// A virtual OP3 on a stand that follows once more who was recorded.
fn replaying(folder: &Path) -> Command {
    let mut command = gaitway(folder);
    let from = "live --from replay:live.mcap --robot op3 --hang --bus sim --n-pose-after 500ms";
    command.args(words(from));
    command
}

/// Of the same walk it is said that each shank wears the other's sensor: N and T pose cannot tell, the walk does.
fn swapped_legs_end_it_unless_that_is_insisted_on(folder: &Path) {
    let again = |more: &str| {
        let output = replaying(folder)
            .args(words("--wear left_shank=right_shank right_shank=left_shank --json"))
            .args(words(more))
            .output()
            .expect("runs");
        (json(&output), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let (report, said) = again("");
    assert_eq!(report["stop"]["code"], "sensors-swapped", "{report}");
    assert_eq!(report["outcome"], "stopped");
    assert_eq!(report["referee"]["violations"], serde_json::json!([]));
    let named = "the sensors of the two shanks seem to be swapped";
    for told in [&report["stop_reason"], &report["body"]["doubts"][0]] {
        assert!(told.as_str().is_some_and(|told| told.contains(named)), "{report}");
    }
    assert!(said.contains(named), "{said}");
    let (report, said) = again("--despite-swaps");
    assert_eq!(report["outcome"], "done", "{report}");
    assert!(said.contains(named) && report["body"]["doubts"][0].is_string(), "{said}");
}

/// The page of the recording has the robot and, in its time, whoever wore the sensors: the knee of the page bends when the
/// sensors said so.
fn whom_it_followed_stands_beside_it(folder: &Path) {
    let html = std::fs::read_to_string(folder.join("live.html")).expect("written");
    let data = crate::page::data(&html);
    let links = data["robot"]["links"].as_array().map_or(0, Vec::len);
    assert!(links > 20, "{links}");
    let person = &data["person"];
    let [hip, knee, ankle] = [Joint::RightHip, Joint::RightKnee, Joint::RightAnkle]
        .map(|joint| crate::page::rows::<3>(&person["points"][joint.index()]));
    let bend = |at: usize| {
        let [hip, knee, ankle] = [&hip, &knee, &ankle].map(|of| DVec3::from(of[at]));
        std::f64::consts::PI - (hip - knee).angle_between(ankle - knee)
    };
    let clock = &person["clock"];
    let time_s: Vec<f64> = match clock["rate_hz"].as_f64() {
        Some(rate_hz) => (0..hip.len()).map(|n| n as f64 / rate_hz).collect(),
        None => crate::page::series(&clock["times_s"]),
    };
    assert!(time_s[time_s.len() - 1] > 10.0, "{clock}");

    let file = folder.join("live.mcap");
    let recording = recording::read(&file).expect("recorded");
    let start = recording.start.as_ref().expect("a start");
    let began_ns = start.wall_nanos(recording.cycles[0].at);
    let text = std::fs::read_to_string(folder.join("body.toml")).expect("kept");
    let kept = Kept::parse(&text).expect("a calibration");
    let series = recording::sensor_series(&file).expect("recorded");
    // The bend of the knee as two sensors say it, by the moments of the shank's.
    let turned = |segment: Segment| {
        let at = kept.calibration.mounts.iter().position(|mount| mount.segment == segment).unwrap();
        let mount = &kept.calibration.mounts[at];
        let moments = series.sensors[&kept.sensors[at]].iter();
        let told = moments.filter_map(|moment| Some((moment.taken_ns, moment.orientation?)));
        told.map(|(at_ns, q)| (at_ns, q * mount.sensor_from_segment)).collect::<Vec<_>>()
    };
    let (thigh, shank) = (turned(Segment::RightThigh), turned(Segment::RightShank));
    let said = |at_s: f64| {
        let at_ns = began_ns as f64 + at_s * 1e9;
        let of = |told: &[(u64, DQuat)]| {
            told.get(told.partition_point(|told| (told.0 as f64) < at_ns)).map(|told| told.1)
        };
        let vertical = |turn: DQuat| turn * DVec3::Z;
        Some(vertical(of(&thigh)?).angle_between(vertical(of(&shank)?)))
    };
    let apart = |lag_s: f64| {
        let pairs =
            time_s.iter().enumerate().filter_map(|(n, at_s)| Some((bend(n), said(at_s + lag_s)?)));
        let squares: Vec<f64> = pairs.map(|(drawn, said)| (drawn - said).powi(2)).collect();
        rms_deg(squares.iter().sum(), squares.len())
    };
    let lags = (-50..=50).map(|n| f64::from(n) * 0.01);
    let best_s = lags.min_by(|a, b| apart(*a).total_cmp(&apart(*b))).expect("lags");
    let (here, elsewhere) = (apart(0.0), apart(0.3));
    println!("the page: knee {here:.2} deg from what sensors said, {elsewhere:.2} deg 0.3 s later");
    assert!(best_s.abs() <= 0.02, "{best_s}");
    assert!(elsewhere > 2.0 * here, "{here} {elsewhere}");
}

/// A recording of `live` becomes a body's file without a calibration beside it; as a table it is what sensors said.
fn the_recording_knows_its_wearer(folder: &Path) {
    for (file, holds) in [("wearer.bvh", "HIERARCHY"), ("said.csv", "sensor,number,")] {
        let output = gaitway(folder).args(["convert", "live.mcap", file]).output().expect("runs");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let text = std::fs::read_to_string(folder.join(file)).expect("written");
        assert!(text.contains(holds), "{}", &text[..200.min(text.len())]);
    }
    // What was replayed is not recorded once more: there, the robot is alone.
    let output = gaitway(folder)
        .args(["info", "again.mcap", "--html", "again.html"])
        .output()
        .expect("runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let html = std::fs::read_to_string(folder.join("again.html")).expect("written");
    let data = crate::page::data(&html);
    assert!(data["robot"].is_object() && data["person"].is_null());
}

/// What the person does is named, in the report and in the recording: strides, and nothing else.
fn strides_are_named(report: &serde_json::Value, recording: &Path) {
    let events = report["events"].as_array().expect("events");
    let strides: Vec<&str> = events
        .iter()
        .filter(|of| of["action"] == "walk")
        .filter_map(|of| of["side"].as_str())
        .collect();
    assert!(!strides.is_empty(), "{events:?}");
    let false_names = events.iter().filter(|of| of["action"] != "walk").count();
    assert_eq!(false_names, 0, "{events:?}");
    let channels = recording::summary(recording).expect("recorded").channels;
    let told = channels.get("/lines/actions").copied();
    // Each stride has begun, has phases and is done.
    assert!(told >= Some(3 * strides.len() as u64), "{channels:?}");
}

/// The calibration that was kept is taken up in N pose alone; another body's is not.
fn take_up_what_was_kept(folder: &Path) {
    let again = |extra: &str| {
        let output = replaying(folder)
            .args(words("--calibration-body again.toml --for 3s --json"))
            .args(words(extra))
            .output()
            .expect("runs");
        (json(&output), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let (report, said) = again("");
    assert_eq!(report["outcome"], "done", "{report}");
    assert!(!said.contains("T pose"), "{said}");
    assert_eq!(report["body"]["sensors"][0]["heading_by"], "movement");
    let (report, _) = again("--wear right_foot=left_foot left_foot=right_foot");
    assert_eq!(report["outcome"], "refused");
    let reason = report["stop_reason"].as_str().expect("a reason");
    assert!(reason.contains("not in the calibration") && reason.contains("--recalibrate"));
    // Whose sensors are swapped is named, and followed only if that is insisted on.
    let before = std::fs::read(folder.join("again.toml")).expect("kept");
    let swapped = "--recalibrate --wear right_forearm=left_forearm left_forearm=right_forearm";
    let (report, said) = again(swapped);
    assert!(said.contains("forearm") && said.contains("swapped"), "{said}\n{report}");
    assert_eq!((&report["outcome"], &report["cycles"]), (&"refused".into(), &0.into()));
    let reason = report["stop_reason"].as_str().unwrap_or_default();
    assert!(reason.contains("swapped") && reason.contains("--despite-swaps"), "{reason}");
    assert_eq!(std::fs::read(folder.join("again.toml")).expect("kept"), before);
    let (report, _) = again(&format!("{swapped} --despite-swaps"));
    assert_eq!(report["outcome"], "done", "{report}");
    // A torso whose sensor was strapped on anyhow: only a movement tells its heading.
    let torso = "[segments]\ntorso = { sensor = \"torso\", forward = \"none\" }\n";
    std::fs::write(folder.join("torso.toml"), torso).expect("written");
    let (report, _) = again("--recalibrate --wear torso.toml");
    let reason = report["stop_reason"].as_str().unwrap_or_default();
    assert!(reason.contains("which way a sensor faces") && reason.contains("torso"), "{report}");
    let (report, _) = again("--recalibrate --wear torso.toml --moves bow");
    assert_eq!(report["outcome"], "done", "{report}");
    // A name that nothing was recorded under.
    let (report, _) = again("--recalibrate --wear left_foot=nobody");
    let reason = report["stop_reason"].as_str().unwrap_or_default();
    assert!(
        reason.contains("left_foot (nobody)") && reason.contains("others are heard"),
        "{reason}"
    );
}

/// Waves are recorded as somebody does them, and played again in virtual time: so the answers are the same on any machine.
#[test]
fn a_wave_is_answered_by_a_bow_and_what_comes_meanwhile_is_counted_and_not_answered() {
    let _alone = alone();
    let folder = crate::program::folder("live-answers");
    let wearer = Wearer::start(
        &folder,
        "--motion wave-r,wave-r,wave-r,wave-r --stand 7s --pty body --seed 3",
    );
    let output = gaitway(&folder)
        .args(words("live --wear body/wear.toml --robot op3 --bus sim:pty --n-pose-after 500ms"))
        .args(words("--moves bow --for 24s --record waves.mcap --rate 50 --json"))
        .output()
        .expect("runs");
    drop(wearer);
    assert_eq!(json(&output)["outcome"], "done", "{}", json(&output));
    let again = |extra: &str| {
        let output = gaitway(&folder)
            .args(words("live --from replay:waves.mcap --robot op3 --bus sim --n-pose-after 500ms"))
            .args(words("--moves bow --json"))
            .args(words(extra))
            .output()
            .expect("runs");
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        (serde_json::from_slice::<Value>(&output.stdout).unwrap_or_default(), said)
    };
    let (report, said) = again("--recognise --when wave-r=play:bow,bow --record answered.mcap");
    assert_eq!(report["outcome"], "done", "{report}\n{said}");
    let answers = &report["answers"];
    assert_eq!(answers["checked"][0]["motion"], "bow,bow");
    let given = answers["given"].as_array().expect("answers");
    assert!(!given.is_empty() && answers["ignored"].as_u64() >= Some(1), "{answers}");
    let waves = report["events"].as_array().expect("events").iter();
    let waves = waves.filter(|of| of["action"] == "wave" && of["side"] == "right").count();
    assert_eq!(given.len() as u64 + answers["ignored"].as_u64().expect("a count"), waves as u64);
    for answer in given {
        assert_eq!((&answer["outcome"], &answer["motion"]), (&"done".into(), &"bow,bow".into()));
        assert!(answer["duration_s"].as_f64() > Some(2.0), "{answer}");
    }
    assert!(said.contains("wave right: the robot comes to rest and plays bow"), "{said}");
    assert!(said.contains("is not answered") && said.contains("follows again"), "{said}");
    // Never a goal that the virtual robot's referee minds, and one recording of all of it.
    assert_eq!(report["referee"]["violations"], serde_json::json!([]));
    assert_eq!(report["exceptions"], serde_json::json!([]));
    let cycles = recording::read(&folder.join("answered.mcap")).expect("recorded").cycles;
    assert_eq!(report["cycles"].as_u64(), Some(cycles.len() as u64));
    assert!(cycles.iter().enumerate().all(|(at, of)| of.cycle == at as u64));
    the_robot_bows(&cycles);
    answers_are_balanced(&again);
    answers_are_refused(&folder, &again);
}

/// On its own feet, with weight, a robot feels every cycle, those of answers as well.
fn answers_are_balanced(again: &dyn Fn(&str) -> (Value, String)) {
    let (report, said) = again("--recognise --when wave-r=play:bow --physics --balance");
    assert_eq!(report["outcome"], "done", "{report}\n{said}");
    assert!(report["fell_at_s"].is_null(), "{}", report["notes"]);
    assert!(!report["answers"]["given"].as_array().expect("answers").is_empty(), "{said}");
    assert_eq!(report["balance"]["felt_cycles"], report["cycles"], "{}", report["balance"]);
    assert_eq!(report["referee"]["violations"], serde_json::json!([]));
    assert_eq!(said.matches("taken to stand on its feet").count(), 1, "{said}");
}

/// The hips bend as they do in a bow, and nobody who waves bends them.
fn the_robot_bows(cycles: &[recording::CycleRecord]) {
    let robot = Robot::load("op3").expect("shipped");
    let hip = robot.joints.iter().position(|joint| joint.name == "l_hip_pitch").expect("a hip");
    let goals = cycles.iter().filter_map(|cycle| cycle.joints[hip].goal_rad);
    let (low, high) =
        goals.fold((f64::MAX, f64::MIN), |(low, high), at| (low.min(at), high.max(at)));
    assert!(high - low > 0.3, "{low} {high}");
}

/// What cannot be answered is refused before anything moves.
fn answers_are_refused(folder: &Path, again: &dyn Fn(&str) -> (Value, String)) {
    std::fs::write(folder.join("far.csv"), "time_s,head_pan_rad\n0,0\n0.4,3\n0.8,9\n")
        .expect("written");
    for (when, reason) in [
        ("somersault=play:bow", "no model names this action"),
        ("wave=play:somersault", "somersault"),
        ("wave=play:far.csv", "head_pan"),
    ] {
        let (report, said) = again(&format!("--recognise --when {when}"));
        assert_eq!((&report["outcome"], &report["cycles"]), (&"refused".into(), &0.into()));
        let told = report["stop_reason"].as_str().unwrap_or_default();
        assert!(told.contains(reason) && told.contains("--when"), "{when}: {told}\n{said}");
    }
    let (report, _) = again("--recognise --when wave=play:bow --dry-run --for 1s");
    assert_eq!((&report["outcome"], &report["cycles"]), (&"done".into(), &0.into()), "{report}");
    assert_eq!(report["answers"]["checked"][0]["action"], "wave");
    let notes = report["notes"].to_string();
    assert!(notes.contains("wave is answered by bow"), "{notes}");
    for wrong in ["--recognise --when wave", "--when wave=play:bow"] {
        let (_, said) = again(wrong);
        assert!(said.contains("--when"), "{said}");
    }
}

/// A port of the loopback interface that was free a moment ago.
fn free_port() -> u16 {
    let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).expect("a port");
    socket.local_addr().expect("an address").port()
}

#[test]
fn slimevr_trackers_are_worn_by_name_and_the_angles_shown_without_a_robot() {
    let folder = crate::program::folder("live-slimevr");
    let port = free_port();
    let _wearer = Wearer::start(
        &folder,
        &format!(
            "--motion wave-r --stand 6s --profile slimevr --udp 127.0.0.1:{port} --wear-file w.toml \
             --wear torso,left_upper_arm,left_forearm,right_upper_arm,right_forearm"
        ),
    );
    // A file of somebody else is not written over.
    std::fs::create_dir(folder.join("mine")).expect("a folder");
    std::fs::write(folder.join("mine/wear.toml"), "[segments]\n").expect("written");
    let output = gaitway(&folder)
        .args(words("simulate imus --pty mine --wear torso"))
        .output()
        .expect("runs");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code() == Some(1) && said.contains("exists already"), "{said}");
    let output = gaitway(&folder)
        .args(words("live --wear w.toml --dry-run --n-pose-after 500ms --for 2s --json"))
        .args(words("--record shown.mcap --recognise"))
        .output()
        .expect("runs");
    let report = json(&output);
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(report["outcome"], "done", "{report}\n{said}");
    // What is only shown is recorded as well, whole.
    assert_eq!(report["recording"], "shown.mcap");
    let recorded = recording::summary(&folder.join("shown.mcap")).expect("recorded").channels;
    let samples = recorded.iter().filter(|(topic, _)| topic.ends_with("/sample"));
    let counts: Vec<u64> = samples.map(|(_, count)| *count).collect();
    assert!(counts.len() == 5 && counts.iter().all(|count| *count > 50), "{recorded:?}");
    let worn: Vec<&str> = report["worn"]
        .as_object()
        .expect("segments")
        .iter()
        .filter_map(|(name, worn)| (worn == true).then_some(name.as_str()))
        .collect();
    assert_eq!(worn.len(), 5, "{worn:?}");
    assert_eq!(report["angles_rad"].as_object().map(serde_json::Map::len), Some(22));
    // What is not worn is at rest.
    assert_eq!(report["angles_rad"]["left_knee_flexion"], 0.0);
    assert!(said.contains("T pose") && said.contains("left_forearm"), "{said}");
    // Without a map, whoever is heard is named.
    let output = gaitway(&folder)
        .args([
            "live",
            "--from",
            &format!("imu:slimevr@udp:127.0.0.1:{port}"),
            "--dry-run",
            "--json",
        ])
        .output()
        .expect("runs");
    let reason = json(&output)["stop_reason"].as_str().expect("a reason").to_owned();
    assert!(reason.contains("tracker-000005-0") && reason.contains("--wear"), "{reason}");
}

/// A body that stands for so long: sensors behind terminals, by segment.
fn standing(segments: &[(&str, f64)]) -> Vec<(String, ImuDoor)> {
    let stage = Stage::default();
    let door = |(name, seconds): &(&str, f64)| {
        let motion = BodyMotion::still(*seconds).expect("a motion");
        let errors = ImuErrors { rate_noise_rad_s: 0.001, seed: 7, ..ImuErrors::default() };
        let imu = VirtualImu::new(motion, Mount::default(), errors, ImuWire::Csv, 100.0);
        let door = ImuDoor::open_on(&stage, imu.expect("a sensor"), 115_200, None).expect("a door");
        (format!("{name}=imu:arduino-csv@{}", door.path().display()), door)
    };
    segments.iter().map(door).collect()
}

/// `live` that follows a body, and the lines it says beside its report.
struct Following {
    child: Child,
    said: std::sync::mpsc::Receiver<String>,
    heard: String,
}

impl Following {
    fn start(mut command: Command, doors: &[(String, ImuDoor)], arguments: &str) -> Self {
        let sources = doors.iter().map(|(source, _)| source);
        command.args(["live", "--json", "--from"]).args(sources).args(words(arguments));
        let mut child = command.spawn().expect("runs");
        let lines = BufReader::new(child.stderr.take().expect("piped")).lines();
        let (sender, said) = std::sync::mpsc::channel();
        std::thread::spawn(move || {
            lines.map_while(Result::ok).try_for_each(|line| sender.send(line))
        });
        Self { child, said, heard: String::new() }
    }

    /// Waits until it says something; what it said until then.
    fn until(&mut self, words: &str) -> String {
        let began = Instant::now();
        while !self.heard.contains(words) {
            let Ok(line) = self.said.recv_timeout(PATIENCE.saturating_sub(began.elapsed())) else {
                signal(&self.child, "KILL");
                let mut report = String::new();
                let _ = self.child.stdout.take().map(|mut out| out.read_to_string(&mut report));
                panic!("never said {words:?}:\n{}\n{report}", self.heard);
            };
            self.heard += &format!("{line}\n");
        }
        std::mem::take(&mut self.heard)
    }

    /// Its report and exit code.
    fn end(mut self) -> (Value, Option<i32>) {
        let mut text = String::new();
        let mut stdout = self.child.stdout.take().expect("piped");
        stdout.read_to_string(&mut text).expect("text");
        let code = self.child.wait().expect("ends").code();
        (serde_json::from_str(&text).unwrap_or_else(|e| panic!("{e}: {text}")), code)
    }
}

const ROBOT: &str = "--robot op3 --bus sim:pty --rate 20 --no-t-pose --n-pose-after 200ms";

#[test]
fn a_sensor_that_is_pulled_out_brings_the_robot_to_rest_and_is_named() {
    let mut doors = standing(&[("left_upper_arm", 600.0), ("left_forearm", 600.0)]);
    let mut live = Following::start(gaitway(&crate::program::folder("live-pulled")), &doors, ROBOT);
    live.until("following");
    doors.pop();
    let (report, code) = live.end();
    assert_eq!((&report["outcome"], code), (&"stopped".into(), Some(4)), "{report}");
    let reason = report["stop_reason"].as_str().expect("a reason");
    assert!(reason.contains("left_forearm is gone"), "{reason}");
    stands(&report);
}

/// At rest, on every joint.
fn stands(report: &Value) {
    for joint in report["joints"].as_array().expect("joints") {
        assert_eq!(joint["end_velocity_rad_s"], 0.0);
    }
}

/// A sensor of a body that stands, behind a terminal that is called `link`.
fn plugged(link: &Path) -> ImuDoor {
    let motion = BodyMotion::still(600.0).expect("a motion");
    let errors = ImuErrors { rate_noise_rad_s: 0.001, seed: 7, ..ImuErrors::default() };
    let imu = VirtualImu::new(motion, Mount::default(), errors, ImuWire::Csv, 100.0);
    let door = ImuDoor::open_on(&Stage::default(), imu.expect("a sensor"), 115_200, Some(link));
    door.expect("a door")
}

#[test]
fn an_arm_that_is_pulled_out_rests_is_plugged_in_mended_and_agreed_to_and_the_trunk_ends_it() {
    let _alone = alone();
    let folder = crate::program::folder("live-plugged");
    let mut doors = standing(&[("left_upper_arm", 600.0), ("torso", 600.0)]);
    let link = folder.join("forearm");
    let forearm = plugged(&link);
    let source = format!("left_forearm=imu:arduino-csv@{}", link.display());
    doors.insert(0, (source, forearm));
    let (mut keys, stdin) = terminal();
    let mut command = gaitway(&folder);
    command.stdin(stdin);
    let arguments = format!("{ROBOT} --keep-going --record kept.mcap");
    let mut live = Following::start(command, &doors, &arguments);
    live.until("following");
    drop(doors.remove(0));
    live.until("the left arm goes to rest");
    keys.write_all(b"g\n").expect("typed");
    live.until("still rests: not all its sensors speak");
    let _forearm = plugged(&link);
    live.until("left_forearm is back after");
    live.until("all sensors of the left arm speak again");
    keys.write_all(b"g\n").expect("typed");
    live.until("still rests: first stand in N pose");
    keys.write_all(b"r\n").expect("typed");
    live.until("the left arm can be followed again");
    keys.write_all(b"g\n").expect("typed");
    live.until("the left arm is followed again");
    doors.pop();
    let (report, code) = live.end();
    assert_eq!((&report["outcome"], code), (&"stopped".into(), Some(4)), "{report}");
    let reason = report["stop_reason"].as_str().expect("a reason");
    assert!(reason.contains("torso is gone"), "{reason}");
    stands(&report);
    let of = |list: &Value, key: &str, name: &str| -> Value {
        let list = list.as_array().expect("a list");
        list.iter().find(|of| of[key] == name).expect("it").clone()
    };
    let mount = of(&report["body"]["sensors"], "segment", "left_forearm");
    assert_eq!((&mount["lost"], mount["lost_s"].as_f64() > Some(0.1)), (&1.into(), true));
    assert_eq!(of(&report["sensors"], "name", "left_forearm")["gone"], 1);
    let marks = recording::sensor_series(&folder.join("kept.mcap")).expect("recorded").markers;
    let marks: Vec<&str> = marks.iter().map(|mark| mark.text.as_str()).collect();
    assert_eq!(marks.len(), 6, "{marks:#?}");
    assert!(marks[0].contains("goes to rest") && marks[5].contains("followed again"), "{marks:?}");
}

#[test]
fn a_sensor_that_falls_silent_is_said_and_the_robot_stands_until_it_is_stopped() {
    let doors = standing(&[("left_upper_arm", 600.0), ("left_forearm", 12.0)]);
    let mut live = Following::start(gaitway(&crate::program::folder("live-silent")), &doors, ROBOT);
    live.until("silent: left_forearm");
    // What is asked for below is time of the virtual robot, which may wait for this machine.
    std::thread::sleep(Duration::from_secs(2));
    signal(&live.child, "INT");
    let (report, code) = live.end();
    assert_eq!((&report["outcome"], code), (&"stopped".into(), Some(130)), "{report}");
    assert!(report["stale_s"].as_f64() > Some(0.3), "{report}");
    let sensors = report["body"]["sensors"].as_array().expect("sensors");
    let stale = |at: usize| sensors[at]["stale_s"].as_f64().expect("seconds");
    assert!(stale(1) > 0.3 && stale(1) > stale(0), "{sensors:?}");
}

#[test]
fn whoever_stops_during_the_calibration_has_moved_nothing_and_left_no_recording() {
    let folder = crate::program::folder("live-stopped");
    let doors = standing(&[("left_upper_arm", 600.0)]);
    let arguments = format!("{ROBOT} --record no.mcap");
    let mut live = Following::start(gaitway(&folder), &doors, &arguments);
    live.until("hold still");
    signal(&live.child, "INT");
    let (report, code) = live.end();
    assert_eq!((&report["outcome"], code), (&"stopped".into(), Some(130)), "{report}");
    assert_eq!(report["cycles"], 0);
    assert!(!folder.join("no.mcap").exists());
}

#[test]
fn whoever_stops_during_the_calibration_without_a_robot_keeps_what_sensors_said() {
    let folder = crate::program::folder("live-stopped-alone");
    let doors = standing(&[("left_upper_arm", 600.0)]);
    let arguments = "--dry-run --no-t-pose --n-pose-after 200ms --record kept.mcap";
    let mut live = Following::start(gaitway(&folder), &doors, arguments);
    live.until("hold still");
    signal(&live.child, "INT");
    let (report, code) = live.end();
    assert_eq!((&report["outcome"], code), (&"stopped".into(), Some(130)), "{report}");
    assert_eq!(report["recording"], "kept.mcap");
    assert!(recording::summary(&folder.join("kept.mcap")).expect("recorded").finished);
}

/// A terminal whose other end the test types at.
fn terminal() -> (std::fs::File, Stdio) {
    use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
    let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).expect("a terminal");
    grantpt(&master).and_then(|()| unlockpt(&master)).expect("granted");
    let name = ptsname(&master, Vec::new()).expect("a name").into_string().expect("text");
    let slave = std::fs::OpenOptions::new().read(true).write(true).open(name).expect("opens");
    (std::fs::File::from(master), Stdio::from(slave))
}

#[test]
fn at_a_terminal_enter_goes_on_s_skips_and_then_r_mends_headings_and_q_ends_without_enter() {
    let doors = standing(&[("right_upper_arm", 600.0), ("right_forearm", 600.0)]);
    let (mut keys, stdin) = terminal();
    let mut command = gaitway(&crate::program::folder("live-terminal"));
    command.stdin(stdin);
    let mut live = Following::start(command, &doors, "--dry-run --moves raise");
    live.until("Enter when you stand so");
    keys.write_all(b"what\n").expect("typed");
    live.until("Enter goes on");
    keys.write_all(b"\n").expect("typed");
    live.until("T pose");
    keys.write_all(b"s\n").expect("typed");
    live.until("raise both");
    keys.write_all(b"s\n").expect("typed");
    live.until("deg");
    // From now on nobody has to look for Enter; other keys, an arrow among them, are in no key's way.
    keys.write_all(b"oh\x1b[Ar").expect("typed");
    live.until("headings are mended");
    keys.write_all(b"q").expect("typed");
    let (report, code) = live.end();
    assert_eq!((&report["outcome"], code), (&"done".into(), Some(0)), "{report}");
    assert_eq!(report["body"]["heading_resets"], 1);
}

/// Somebody stands still for nine seconds, and then waves with a forearm.
fn waving() -> BodyMotion {
    const RATE_HZ: f64 = 100.0;
    let turned = |n: u32| {
        let time_s = (f64::from(n) / RATE_HZ - 9.0).max(0.0);
        let q = DQuat::from_rotation_y(-0.6 * (6.0 * time_s).sin());
        [q.w, q.x, q.y, q.z]
    };
    let turns: Vec<[f64; 4]> = (0..12_000).map(turned).collect();
    BodyMotion::new(RATE_HZ, &vec![[0.0; 3]; turns.len()], &turns).expect("a motion")
}

#[test]
fn headings_are_mended_of_who_stands_still_and_not_of_who_moves() {
    let mut doors = standing(&[("right_upper_arm", 600.0)]);
    let errors = ImuErrors { rate_noise_rad_s: 0.001, seed: 8, ..ImuErrors::default() };
    let imu = VirtualImu::new(waving(), Mount::default(), errors, ImuWire::Csv, 100.0);
    let door = ImuDoor::open_on(&Stage::default(), imu.expect("a sensor"), 115_200, None);
    let door = door.expect("a door");
    doors.push((format!("right_forearm=imu:arduino-csv@{}", door.path().display()), door));
    let (mut keys, stdin) = terminal();
    let mut command = gaitway(&crate::program::folder("live-waves"));
    command.stdin(stdin);
    let mut live = Following::start(command, &doors, "--dry-run --no-t-pose --n-pose-after 200ms");
    live.until("deg");
    let mut mended = 0;
    let refused = (0..100).any(|_| {
        std::thread::sleep(Duration::from_millis(200));
        keys.write_all(b"r\n").expect("typed");
        let said = live.until("headings are");
        let is_refused =
            said.contains("not mended: the right forearm moves; stand still in N pose");
        mended += u64::from(!is_refused);
        is_refused
    });
    assert!(refused && mended > 0, "{mended}");
    keys.write_all(b"q\n").expect("typed");
    let (report, code) = live.end();
    assert_eq!((&report["outcome"], code), (&"done".into(), Some(0)), "{report}");
    assert_eq!(report["body"]["heading_resets"], mended);
}

#[test]
fn a_map_that_cannot_be_is_refused_before_anything_is_opened() {
    let folder = crate::program::folder("live-refused");
    std::fs::write(folder.join("nose.toml"), "[segments]\nnose = \"t\"\n").expect("written");
    let imu = "imu:bno08x-rvc@/dev/no-such-port";
    for (arguments, said) in [
        (format!("--from nose={imu}"), "no such segment"),
        (format!("--from head={imu} head={imu}2"), "two sensors are worn on one segment"),
        (format!("--from {imu}"), "which segment wears this sensor"),
        ("--wear head=t torso=t".to_owned(), "one sensor is worn on two segments"),
        ("--wear nose.toml".to_owned(), "no such segment"),
        ("--from lines@/dev/null".to_owned(), "cannot be worn"),
        (format!("--from replay:x.mcap head={imu}"), "cannot be followed together"),
        ("--from replay:no-such.mcap".to_owned(), "cannot be opened"),
        (format!("--from head={imu} --bus sim --robot op3"), "real time"),
        (format!("--from head={imu}"), "no such port"),
    ] {
        let output =
            gaitway(&folder).args(["live", "--dry-run", "--json"]).args(words(&arguments)).output();
        let report = json(&output.expect("runs"));
        let reason = report["stop_reason"].as_str().unwrap_or_default();
        assert_eq!(report["outcome"], "refused");
        assert!(reason.contains(said), "{arguments}: {reason}");
    }
}
