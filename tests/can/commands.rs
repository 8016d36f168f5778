//! The command as a user types it, against virtual actuators behind an interface of this kernel:
//! `simulate` in one program, every other command in another.

use super::robots::{self, DAMIAO, MOTEUS, few};
use serde_json::{Value, json};
use std::io::{BufRead as _, BufReader};
use std::path::PathBuf;
use std::process::{Child, Command, Output, Stdio};

/// A virtual robot on an interface, until it is dropped.
struct Simulated {
    robot: String,
    process: Child,
}

impl Simulated {
    fn on(interface: &str, name: &str, text: &str) -> Self {
        let robot = in_folder(&format!("{name}.toml"));
        std::fs::write(&robot, text).expect("a file");
        let mut process = gaitway(&["simulate", &robot, "--can", interface, "-q"])
            .stdout(Stdio::piped())
            .spawn()
            .expect("the command");
        let out = process.stdout.take().expect("a pipe");
        let mut first = String::new();
        BufReader::new(out).read_line(&mut first).expect("a line");
        assert_eq!(first.trim(), format!("can:{interface}"));
        Self { robot, process }
    }

    /// The report of a command that is told which robot this is.
    fn report(&self, arguments: &[&str]) -> Value {
        report(&[arguments, &["--robot", &self.robot]].concat())
    }
}

impl Drop for Simulated {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

fn in_folder(name: &str) -> String {
    let folder: PathBuf = std::env::temp_dir().join("gaitway-can-commands");
    std::fs::create_dir_all(&folder).expect("a folder");
    folder.join(name).display().to_string()
}

fn gaitway(arguments: &[&str]) -> Command {
    let mut command = crate::program::gaitway();
    command.args(arguments);
    command
}

fn words(output: &Output) -> String {
    let [out, err] = [&output.stdout, &output.stderr].map(|text| String::from_utf8_lossy(text));
    format!("{out}{err}({})", output.status)
}

/// Runs it with a report file; how it went, and what the file says if there is one.
fn reported(arguments: &[&str]) -> (Output, Option<Value>) {
    let file = in_folder("report.json");
    let _ = std::fs::remove_file(&file); // nobody reads the one before
    let whole = [arguments, &["--report", &file, "-q"]].concat();
    let output = gaitway(&whole).output().expect("the command");
    let text = std::fs::read(&file).ok();
    let report = text.map(|text| serde_json::from_slice(&text).expect("a whole document"));
    (output, report)
}

/// The report of a command that succeeds.
fn report(arguments: &[&str]) -> Value {
    let (output, report) = reported(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", words(&output));
    report.expect("a report file")
}

fn joint<'a>(report: &'a Value, name: &str) -> &'a Value {
    let joints = report["joints"].as_array().expect("joints");
    joints.iter().find(|joint| joint["name"] == name).expect("that joint")
}

#[test]
#[ignore = "needs CAN interfaces"]
fn ports_tell_of_every_interface_how_it_stands() {
    let survey = report(&["ports"]);
    assert_eq!(survey["kernel_speaks_can"], true);
    let listed = survey["can"].as_array().expect("interfaces");
    let made = [("vcan0", "up", true), ("vcan1", "up", false), ("vcan2", "down", true)];
    for (name, state, fd) in made {
        let port = listed.iter().find(|port| port["name"] == name).expect("listed");
        let told = [&port["kind"], &port["state"], &port["fd"], &port["bitrate_bps"]];
        assert_eq!(told, [&json!("virtual"), &json!(state), &json!(fd), &Value::Null], "{name}");
    }
    assert!(survey["findings"].to_string().contains("sudo ip link set vcan2 up"), "{survey:#}");
    // On standard output it is the same document.
    let output = gaitway(&["ports", "--json"]).output().expect("the command");
    let printed: Value = serde_json::from_slice(&output.stdout).expect("a document");
    assert_eq!(printed["can"], survey["can"]);
    let (down, _) = reported(&["scan", "can:vcan2"]);
    assert_eq!(down.status.code(), Some(1));
    assert!(words(&down).contains("the CAN interface is down"), "{}", words(&down));
}

#[test]
#[ignore = "needs CAN interfaces"]
fn a_scan_of_an_interface_finds_who_is_behind_it() {
    // Nothing says who should be there.
    for (kind, interface, protocol) in [(DAMIAO, "vcan1", "damiao"), (MOTEUS, "vcan0", "moteus")] {
        let robot = Simulated::on(interface, "few", &few(kind, 3, 50.0));
        let address = format!("can:{interface}");
        let found = report(&["scan", &address]);
        let devices = found["devices"].as_array().expect("devices");
        let told: Vec<_> =
            devices.iter().map(|of| (of["id"].as_u64(), of["protocol"].as_str())).collect();
        assert_eq!(told, [1, 2, 3].map(|id| (Some(id), Some(protocol))), "{found:#}");
        assert_eq!(found["collisions"], json!([]));
        drop(robot);
        let (nobody, _) = reported(&["scan", &address, "--protocol", protocol]);
        assert_eq!(nobody.status.code(), Some(1), "{}", words(&nobody));
    }
}

#[test]
#[ignore = "needs CAN interfaces"]
fn one_actuator_is_asked_and_set_over_an_interface() {
    let robot = Simulated::on("vcan0", "few", &few(DAMIAO, 3, 50.0));
    let who = robot.report(&["servo", "info", "can:vcan0", "2"]);
    assert_eq!((&who["id"], &who["model"]), (&json!(2), &json!("DM-J4310-2EC")), "{who:#}");
    assert_eq!((&who["torque_on"], &who["faults"]), (&json!(false), &json!("none")));
    let get = |id, name| robot.report(&["servo", "get", "can:vcan0", id, name]);
    assert_eq!(get("2", "PMAX")["value_rad"], 12.5);
    let set = robot.report(&["servo", "set", "can:vcan0", "2", "TIMEOUT", "0.02"]);
    // Steps of 50 us.
    assert_eq!((&set["raw"], &set["kept"]), (&json!(400), &json!(false)), "{set:#}");
    // Another program reads it, and from no other actuator.
    assert_eq!(get("2", "TIMEOUT")["value_s"], 0.02);
    assert_eq!(get("1", "TIMEOUT")["value_s"], 0.0);
    let (nobody, _) = reported(&["servo", "info", "can:vcan0", "9", "--robot", &robot.robot]);
    assert_eq!(nobody.status.code(), Some(1), "{}", words(&nobody));
}

#[test]
#[ignore = "needs CAN interfaces"]
fn a_squat_is_played_over_an_interface_and_the_robot_let_go() {
    let arguments = ["play", "squat", "--bus", "can:vcan1", "--rate", "20", "--force"];
    // At 20 Hz, since the guest counts time in ticks of 10 ms. A machine that stalls stops motions
    // that run in real time, and is right to; what that leaves in the actuators (an error that one
    // keeps until it is cleared) is no business of the next try, which has a robot of its own.
    let mut said = String::new();
    let played = (0..5).find_map(|_| {
        let robot = Simulated::on("vcan1", "berkeley-legs", &robots::berkeley_legs());
        let (output, report) = reported(&[&arguments[..], &["--robot", &robot.robot]].concat());
        said = words(&output);
        let report = report.filter(|_| output.status.success());
        if report.is_none() {
            eprintln!("played again: {said}");
        }
        report.map(|report| (robot, report))
    });
    let (robot, played) = played.unwrap_or_else(|| panic!("never to its end: {said}"));
    assert_eq!((&played["outcome"], &played["bus"]), (&json!("done"), &json!(["can:vcan1"])));
    assert!(played["referee"].is_null(), "nobody sees past an interface: {played:#}");
    for knee in ["left_knee_pitch", "right_knee_pitch"] {
        let range = &joint(&played, knee)["range_rad"];
        let moved = range[1].as_f64().zip(range[0].as_f64()).map(|(high, low)| high - low);
        assert!(moved.is_some_and(|moved| moved > 1.0), "a squat bends the knees: {range}");
    }
    let torque = || robot.report(&["servo", "info", "can:vcan1", "1"])["torque_on"].clone();
    assert_eq!(torque(), true, "it holds where the motion ended");
    let limp = report(&["limp", &robot.robot, "--bus", "can:vcan1", "--yes"]);
    assert_eq!(limp["outcome"], "done");
    assert_eq!(torque(), false);
}

#[test]
#[ignore = "needs CAN interfaces"]
fn limp_actuators_are_recorded_over_an_interface() {
    let robot = Simulated::on("vcan1", "few", &few(DAMIAO, 3, 50.0));
    let (source, file) = (format!("servos:{}@can:vcan1", robot.robot), in_folder("limp.mcap"));
    let arguments = ["record", &source, "-o", &file, "--for", "500ms", "--force"];
    let (output, recorded) = reported(&arguments);
    let recorded = recorded.unwrap_or_else(|| panic!("no report: {}", words(&output)));
    let counts = &recorded["sources"][0]["counts"];
    // Another process answers, in real time: what a busy machine makes it miss is said.
    let (outcome, code) = match counts["missed"].as_u64() {
        Some(0) => ("done", 0),
        _ => ("done_with_loss", 3),
    };
    assert_eq!((&recorded["outcome"], output.status.code()), (&json!(outcome), Some(code)));
    let samples = &counts["samples"];
    assert!(samples.as_u64().is_some_and(|count| count > 0), "{recorded:#}");
    let info = report(&["info", &file]);
    assert_eq!((&info["robot"], &info["finished"]), (&json!("few"), &json!(true)), "{info:#}");
    assert_eq!(&info["channels"]["/joints/present"], samples, "each is in the file: {info:#}");
}
