//! `recognise` while somebody who wears sensors moves, or a robot's servos are read: by the command, behind pseudo-terminals and
//! UDP. Time is real here: what a busy machine does to it is not judged. What a robot shows is held in virtual time
//! (`src/job/recognise_live/tests.rs`).

mod program;

use gaitway_sim::imu::{BodyMotion, ImuDoor, ImuErrors, ImuWire, Mount, Stage, VirtualImu};
use program::folder;
use serde_json::Value;
use std::io::{BufRead, BufReader, Read};
use std::net::{Ipv4Addr, UdpSocket};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Real time for one at a time.
static REAL_TIME: Mutex<()> = Mutex::new(());

fn alone() -> MutexGuard<'static, ()> {
    REAL_TIME.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Nothing here takes so long, however busy the machine is.
const PATIENCE: Duration = Duration::from_secs(120);

fn gaitway(folder: &Path, arguments: &str) -> Command {
    let mut command = program::gaitway();
    command.current_dir(folder).args(arguments.split_whitespace());
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

fn signal(child: &Child, name: &str) {
    let _ = Command::new("kill").args(["-s", name, &child.id().to_string()]).status();
}

/// A program that runs, and the lines it says on standard error.
struct Running {
    child: Child,
    said: Receiver<String>,
    heard: String,
}

impl Running {
    fn start(mut command: Command) -> Self {
        let mut child = command.spawn().expect("runs");
        let lines = BufReader::new(child.stderr.take().expect("piped")).lines();
        let (sender, said) = channel();
        std::thread::spawn(move || {
            lines.map_while(Result::ok).try_for_each(|line| sender.send(line))
        });
        Self { child, said, heard: String::new() }
    }

    /// Waits until it says something.
    fn until(&mut self, words: &str) {
        let began = Instant::now();
        while !self.heard.contains(words) {
            let Ok(line) = self.said.recv_timeout(PATIENCE.saturating_sub(began.elapsed())) else {
                signal(&self.child, "KILL");
                panic!("never said {words:?}:\n{}", self.heard);
            };
            self.heard += &format!("{line}\n");
        }
    }

    /// What it printed, and its exit code.
    fn end(mut self) -> (String, Option<i32>) {
        let mut text = String::new();
        let mut stdout = self.child.stdout.take().expect("piped");
        stdout.read_to_string(&mut text).expect("text");
        (text, self.child.wait().expect("ends").code())
    }
}

/// A body that stands for ten minutes: a sensor behind a terminal for each of these segments.
fn standing(segments: &[&str]) -> Vec<(String, ImuDoor)> {
    let stage = Stage::default();
    let door = |name: &&str| {
        let motion = BodyMotion::still(600.0).expect("a motion");
        let errors = ImuErrors { rate_noise_rad_s: 0.001, seed: 7, ..ImuErrors::default() };
        let imu = VirtualImu::new(motion, Mount::default(), errors, ImuWire::Csv, 100.0);
        let door = ImuDoor::open_on(&stage, imu.expect("a sensor"), 115_200, None).expect("a door");
        (format!("{name}=imu:arduino-csv@{}", door.path().display()), door)
    };
    segments.iter().map(door).collect()
}

fn listening(folder: &Path, doors: &[(String, ImuDoor)], arguments: &str) -> Running {
    let mut command = gaitway(folder, "recognise --no-t-pose --n-pose-after 200ms");
    command.args(arguments.split_whitespace());
    command.args(doors.iter().map(|(source, _)| source));
    Running::start(command)
}

#[test]
fn what_who_wears_trackers_does_is_told_as_it_happens_and_written_down_at_the_end() {
    let _alone = alone();
    let folder = folder("recognise-worn");
    let port = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).and_then(|socket| socket.local_addr());
    let wearer = format!(
        "simulate imus --motion wave-r --stand 6s --profile slimevr --udp 127.0.0.1:{} --wear-file w.toml",
        port.expect("a port").port()
    );
    let mut wearer = Running::start(gaitway(&folder, &wearer));
    wearer.until("then:");
    let arguments = "recognise --wear w.toml --n-pose-after 500ms --json-lines --labels found.csv \
                     --html found.html --report report.json";
    let mut listening = Running::start(gaitway(&folder, arguments));
    // Told while it goes on: nobody has ended it yet.
    let mut told = BufReader::new(listening.child.stdout.take().expect("piped")).lines();
    let (began, mut text) = (Instant::now(), String::new());
    let is_done = |line: &str| line.contains(r#""kind":"done""#) && line.contains("wave-r");
    while !text.lines().any(is_done) {
        let line = told.next().and_then(Result::ok).unwrap_or_else(|| panic!("it ended: {text}"));
        text += &format!("{line}\n");
        assert!(began.elapsed() < PATIENCE, "{text}");
    }
    signal(&listening.child, "INT");
    text.extend(told.map_while(Result::ok).map(|line| line + "\n"));
    let code = listening.child.wait().expect("ends").code();
    signal(&wearer.child, "INT");
    wearer.end();
    assert_eq!(code, Some(0), "{text}");
    let lines: Vec<Value> =
        text.lines().map(|line| serde_json::from_str(line).expect("a line of JSON")).collect();
    let of_wave = lines.iter().filter(|line| line["model"] == "wave-r");
    let kinds: Vec<&str> = of_wave.filter_map(|line| line["kind"].as_str()).collect();
    assert!(kinds.first() == Some(&"begun") && kinds.contains(&"done"), "{text}");
    let table = std::fs::read_to_string(folder.join("found.csv")).expect("a table");
    assert!(table.contains(",wave,right,0"), "{table}");
    let report = std::fs::read_to_string(folder.join("report.json")).expect("a report");
    let report: Value = serde_json::from_str(&report).expect("JSON");
    assert_eq!((&report["outcome"], &report["source"]["format"]), (&"done".into(), &"worn".into()));
    assert_eq!(report["sensors"].as_array().map(Vec::len), Some(13));
    let done = lines.iter().filter(|line| line["kind"] == "done").count();
    assert_eq!(report["events"].as_array().map(Vec::len), Some(done));
    let page = std::fs::read_to_string(folder.join("found.html")).expect("a page");
    assert!(page.contains("wave right"), "{}", page.len());
}

#[test]
fn a_sensor_that_is_pulled_out_ends_it_and_what_was_found_so_far_is_written() {
    let _alone = alone();
    let folder = folder("recognise-pulled");
    let mut doors = standing(&["left_upper_arm", "left_forearm"]);
    let arguments = "--json --labels found.csv --html found.html";
    let mut listening = listening(&folder, &doors, arguments);
    listening.until("good");
    std::thread::sleep(Duration::from_secs(1));
    doors.pop();
    let (text, code) = listening.end();
    let report: Value = serde_json::from_str(&text).unwrap_or_else(|e| panic!("{e}: {text}"));
    assert_eq!((&report["outcome"], code), (&"stopped".into(), Some(4)), "{report}");
    let reason = report["stop_reason"].as_str().expect("a reason");
    assert!(reason.contains("left_forearm is gone"), "{reason}");
    let table = std::fs::read_to_string(folder.join("found.csv")).expect("a table");
    assert_eq!(table, "start_s,end_s,class,side,person\n");
    assert!(folder.join("found.html").exists());
    // Who wears nothing on the legs shows no walk.
    let blind = report["blind"].as_array().expect("blind models");
    let walk = blind.iter().find(|of| of["model"] == "walk-l").expect("it cannot fire");
    assert!(walk["missing"].as_array().is_some_and(|missing| !missing.is_empty()), "{walk}");
    assert!(report["notes"].to_string().contains("not worn"), "{report}");
}

#[test]
fn ctrl_c_ends_it_with_everything_written_and_before_the_calibration_with_nothing() {
    let _alone = alone();
    let folder = folder("recognise-ended");
    let doors = standing(&["right_upper_arm", "right_forearm"]);
    let mut early = listening(&folder, &doors, "--labels early.csv");
    early.until("old still");
    signal(&early.child, "INT");
    let (text, code) = early.end();
    assert_eq!((text.as_str(), code), ("", Some(130)));
    assert!(!folder.join("early.csv").exists());
    let mut late = listening(&folder, &doors, "--labels late/ --json");
    late.until("good");
    std::thread::sleep(Duration::from_secs(1));
    signal(&late.child, "INT");
    let (text, code) = late.end();
    let report: Value = serde_json::from_str(&text).unwrap_or_else(|e| panic!("{e}: {text}"));
    assert_eq!((&report["outcome"], code), (&"done".into(), Some(0)), "{report}");
    assert!(std::fs::read_dir(folder.join("late")).expect("a folder").count() > 0);
}

#[test]
fn a_robot_is_listened_to_until_ctrl_c_or_its_line_is_gone() {
    let _alone = alone();
    let folder = folder("recognise-servos");
    let link = folder.join("op3");
    let simulate = format!("simulate op3 --pty {}", link.display());
    let mut robot = Running::start(gaitway(&folder, &simulate));
    robot.until(""); // The link is there once the first line is.
    while !link.exists() {
        std::thread::sleep(Duration::from_millis(20));
    }
    let arguments = format!("recognise servos:op3@serial:{} --json", link.display());
    let listening = Running::start(gaitway(&folder, &arguments));
    std::thread::sleep(Duration::from_secs(2));
    signal(&listening.child, "INT");
    let (text, code) = listening.end();
    let report: Value = serde_json::from_str(&text).unwrap_or_else(|e| panic!("{e}: {text}"));
    assert_eq!((&report["outcome"], code), (&"done".into(), Some(0)), "{report}");
    assert_eq!(report["source"]["format"], "servos");
    assert!(report["frames"].as_u64() > Some(10), "{report}");
    let mut listening = Running::start(gaitway(&folder, &arguments));
    std::thread::sleep(Duration::from_secs(1));
    signal(&robot.child, "INT");
    robot.end();
    listening.until("");
    let (text, code) = listening.end();
    let report: Value = serde_json::from_str(&text).unwrap_or_else(|e| panic!("{e}: {text}"));
    assert_eq!((&report["outcome"], code), (&"stopped".into(), Some(4)), "{report}");
    assert!(report["stop_reason"].as_str().is_some_and(|why| why.contains("gone")), "{report}");
}

/// A virtual robot, or a bench, behind a link, ended with the test.
fn simulated(folder: &Path, what: &str) -> (Running, std::path::PathBuf) {
    let link = folder.join("robot");
    let mut robot = Running::start(gaitway(folder, &format!("simulate {what} --pty robot")));
    robot.until("Ctrl-C ends it");
    (robot, link)
}

#[test]
fn servos_that_are_others_than_the_robots_are_named_by_who_reads_them() {
    let _alone = alone();
    let folder = folder("recognise-others");
    let (robot, link) = simulated(&folder, "--servo xl430-w250:1-20 --baud 2000000");
    let place = format!("serial:{}", link.display());
    for arguments in [
        format!("recognise servos:op3@{place} --for 1s"),
        format!("monitor op3 --bus {place} --for 0s"),
        format!("play bow --robot op3 --bus {place} --dry-run"),
    ] {
        let output = gaitway(&folder, &arguments).output().expect("runs");
        let said = [output.stdout, output.stderr].concat();
        let said = String::from_utf8_lossy(&said);
        assert_eq!(output.status.code(), Some(1), "{arguments}: {said}");
        // Their numbers by the maker's tables.
        for word in ["r_sho_pitch, ID 1", "1060", "1020", "XM430-W350"] {
            assert!(said.contains(word), "{arguments}: {said}");
        }
    }
    signal(&robot.child, "INT");
    robot.end();
}

#[test]
fn who_is_listened_to_by_nobody_any_more_or_is_ended_from_outside_says_so_by_its_exit_code() {
    let _alone = alone();
    let folder = folder("recognise-unread");
    let (robot, link) = simulated(&folder, "op3");
    let robot_at = format!("serial:{}", link.display());
    // Nothing moves: not a line is written in which a lost reader would show.
    let arguments = format!("recognise servos:op3@{robot_at} --json-lines");
    let mut unread = Running::start(gaitway(&folder, &arguments));
    std::thread::sleep(Duration::from_secs(1));
    drop(unread.child.stdout.take());
    let began = Instant::now();
    let code = loop {
        if let Some(status) = unread.child.try_wait().expect("a child") {
            break status.code();
        }
        if began.elapsed() > PATIENCE {
            signal(&unread.child, "KILL");
            panic!("it goes on although nobody reads");
        }
        std::thread::sleep(Duration::from_millis(20));
    };
    assert_eq!(code, Some(0));
    for (arguments, name, code) in [
        (format!("recognise servos:op3@{robot_at} --labels term.csv"), "TERM", 143),
        (format!("monitor op3 --bus {robot_at}"), "TERM", 143),
        (format!("monitor op3 --bus {robot_at}"), "INT", 0),
    ] {
        let listening = Running::start(gaitway(&folder, &arguments));
        std::thread::sleep(Duration::from_secs(2));
        signal(&listening.child, name);
        assert_eq!(listening.end().1, Some(code), "{arguments}, {name}");
    }
    assert!(folder.join("term.csv").exists(), "what was found is written all the same");
    signal(&robot.child, "INT");
    robot.end();
}

#[test]
fn sources_that_cannot_be_heard_are_refused_with_what_is_wrong() {
    let folder = folder("recognise-refused");
    for (arguments, said) in [
        ("walk imu:bno08x-rvc@/dev/no-such-port", "not a source"),
        ("imu:bno08x-rvc@/dev/no-such-port", "which segment wears this sensor"),
        ("head=imu:bno08x-rvc@/dev/no-such-port", "no such port"),
        ("head=imu:nobody@/dev/no-such-port", "nobody"),
        ("nose=imu:bno08x-rvc@/dev/no-such-port", "no such segment"),
        ("servos:nobody@serial:/dev/x", "nobody"),
        ("servos:op3@serial:/dev/no-such-port", "no such port"),
        ("servos:op3@sim", "virtual time"),
        ("servos:op3@sim:pty servos:op3@sim:pty", "one body at a time"),
        ("servos:so101@sim:pty", "so101"),
        ("imu:", "not a source"),
        ("lines@/dev/null", "cannot be worn"),
        ("walk --for 3s", "has its own end"),
        ("head=imu:bno08x-rvc@/dev/no-such-port --models nowhere", "folder of models"),
        ("servos:op3@sim:pty --slowed nan", "nothing is slowed like that"),
    ] {
        let output = gaitway(&folder, &format!("recognise {arguments}")).output().expect("runs");
        let words = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{arguments}: {words}");
        assert!(words.contains(said), "{arguments}: {words}");
    }
}
