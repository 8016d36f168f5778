//! The command as a user types it, against virtual actuators behind an interface of this kernel.

#[path = "../can_robot/robots.rs"]
#[allow(dead_code)]
mod robots;

use robots::{DAMIAO, Kind, MOTEUS};
use std::io::{BufRead as _, BufReader};
use std::path::PathBuf;
use std::process::{Child, Command, Output, Stdio};

/// A robot of three actuators on an interface, until it is dropped.
struct Simulated {
    robot: String,
    process: Child,
}

impl Simulated {
    fn on(interface: &str, kind: Kind) -> Self {
        let folder = std::env::temp_dir().join(kind.servo);
        std::fs::create_dir_all(&folder).expect("a folder");
        let path: PathBuf = folder.join("few.toml");
        std::fs::write(&path, robots::few(kind, 3, 50.0)).expect("a file");
        let robot = path.display().to_string();
        let mut process = gaitway(&["simulate", &robot, "--can", interface])
            .stdout(Stdio::piped())
            .spawn()
            .expect("the command");
        let out = process.stdout.take().expect("a pipe");
        let mut first = String::new();
        BufReader::new(out).read_line(&mut first).expect("a line");
        assert_eq!(first.trim(), format!("can:{interface}"));
        Self { robot, process }
    }

    fn run(&self, arguments: &[&str]) -> Output {
        gaitway(&[arguments, &["--robot", &self.robot]].concat()).output().expect("the command")
    }
}

impl Drop for Simulated {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

fn gaitway(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_gaitway"));
    command.args(arguments);
    command
}

fn text(output: &Output) -> String {
    let [out, err] = [&output.stdout, &output.stderr].map(|text| String::from_utf8_lossy(text));
    format!("{out}{err}({})", output.status)
}

#[test]
#[ignore = "needs CAN interfaces"]
fn ports_tell_of_every_interface_how_it_stands() {
    let output = gaitway(&["ports"]).output().expect("the command");
    let said = text(&output);
    for words in [
        "vcan0           up, virtual, no speed, CAN FD",
        "vcan1           up, virtual, no speed, classic",
        "vcan2           down, virtual",
        "sudo ip link set vcan2 up",
    ] {
        assert!(said.contains(words), "{words} is missing in\n{said}");
    }
    let down = gaitway(&["scan", "can:vcan2"]).output().expect("the command");
    assert!(text(&down).contains("the CAN interface is down"), "{}", text(&down));
}

#[test]
#[ignore = "needs CAN interfaces"]
fn a_scan_of_an_interface_finds_who_is_behind_it() {
    let robot = Simulated::on("vcan1", DAMIAO);
    // Nothing says who should be there.
    let output = gaitway(&["scan", "can:vcan1", "-q"]).output().expect("the command");
    let said = text(&output);
    assert!(said.contains("3 device(s)") && said.contains("DM-J4310-2EC"), "{said}");
    let output = robot.run(&["servo", "get", "can:vcan1", "2", "PMAX"]);
    assert!(text(&output).contains("12.5 rad"), "{}", text(&output));
    drop(robot);

    let _robot = Simulated::on("vcan0", MOTEUS);
    let output = gaitway(&["scan", "can:vcan0", "-q"]).output().expect("the command");
    let said = text(&output);
    assert!(said.contains("3 device(s)") && said.contains("model 4"), "{said}");
}

#[test]
#[ignore = "needs CAN interfaces"]
fn a_motion_is_played_and_the_robot_let_go_over_an_interface() {
    let robot = Simulated::on("vcan1", DAMIAO);
    // A machine that stalls stops motions that run in real time, and is right to.
    let mut said = String::new();
    let played = (0..10).any(|_| {
        let output = robot.run(&["play", "walk:1s", "--bus", "can:vcan1", "--rate", "50"]);
        said = text(&output);
        output.status.success()
    });
    assert!(played, "{said}");
    let limp = ["limp", &robot.robot, "--bus", "can:vcan1", "--yes"];
    let output = gaitway(&limp).output().expect("the command");
    assert!(output.status.success(), "{}", text(&output));
    let output = robot.run(&["servo", "info", "can:vcan1", "1"]);
    assert!(text(&output).contains("torque off"), "{}", text(&output));
}
