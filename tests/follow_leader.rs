//! `follow` by the command: a leader behind a pseudo-terminal, and a follower in real time. What is followed, and how, is held in
//! virtual time (`src/job/leader/tests.rs`).

mod program;

use program::folder;
use serde_json::Value;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

/// Nothing here takes so long, however busy the machine is.
const PATIENCE: Duration = Duration::from_secs(120);

fn signal(child: &Child, name: &str) {
    let _ = Command::new("kill").args(["-s", name, &child.id().to_string()]).status();
}

/// A virtual leader that other programs open, ended with the test.
struct Leader(Child);

impl Leader {
    fn start(link: &Path) -> Self {
        let mut command = program::gaitway();
        command.args(["simulate", "so101-leader", "--pty"]).arg(link).stdin(Stdio::null());
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().expect("runs");
        // Its first line names the path.
        let mut lines = BufReader::new(child.stdout.take().expect("piped")).lines();
        assert!(lines.next().is_some_and(|line| line.is_ok()), "the leader did not come");
        std::thread::spawn(move || lines.map_while(Result::ok).for_each(drop));
        Self(child)
    }

    fn end(&mut self) {
        signal(&self.0, "INT");
        let _ = self.0.wait();
    }
}

impl Drop for Leader {
    fn drop(&mut self) {
        self.end();
    }
}

fn json(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|e| panic!("no report ({e}): {}", String::from_utf8_lossy(&output.stderr)))
}

fn follow(link: &Path, more: &str) -> Command {
    let mut command = program::gaitway();
    command.arg("follow").arg(format!("servos:so101-leader@serial:{}", link.display()));
    command.args("--robot so101 --bus sim:pty --json --accept-firmware".split_whitespace());
    command.args(more.split_whitespace()).stdin(Stdio::null());
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

#[test]
fn a_follower_comes_to_rest_for_good_when_its_leader_is_gone_or_somebody_stops_it() {
    let folder = folder("follow-leader");
    let link = folder.join("leader");
    let mut leader = Leader::start(&link);
    let recording = folder.join("followed.mcap");
    let record = format!("--record {}", recording.display());
    let under_way = |child: &Child| {
        let began = Instant::now();
        while std::fs::metadata(&recording).map_or(0, |file| file.len()) < 20_000 {
            assert!(began.elapsed() < PATIENCE, "{} never moved", child.id());
            std::thread::sleep(Duration::from_millis(20));
        }
    };
    let child = follow(&link, &record).spawn().expect("runs");
    under_way(&child);
    signal(&child, "INT");
    let output = child.wait_with_output().expect("ends");
    let report = json(&output);
    assert_eq!((&report["outcome"], output.status.code()), (&"stopped".into(), Some(130)));
    assert_eq!(report["referee"]["violations"], serde_json::json!([]));
    assert!(report["sensors"][0]["counts"]["samples"].as_u64() > Some(10), "{report}");
    std::fs::remove_file(&recording).expect("recorded");
    let child = follow(&link, &record).spawn().expect("runs");
    under_way(&child);
    leader.end();
    let output = child.wait_with_output().expect("ends");
    let report = json(&output);
    assert_eq!(
        (&report["outcome"], output.status.code()),
        (&"stopped".into(), Some(4)),
        "{report}"
    );
    assert_eq!(report["stop"]["code"], "sensor-lost");
    let reason = report["stop_reason"].as_str().expect("a reason");
    assert!(reason.contains("the leader so101-leader is gone"), "{reason}");
    assert_eq!(report["referee"]["violations"], serde_json::json!([]));
    for joint in report["joints"].as_array().expect("joints") {
        assert_eq!(joint["end_velocity_rad_s"], 0.0);
    }
}

#[test]
fn who_cannot_lead_or_follow_is_refused_and_nothing_moves() {
    let robot = "--robot so101 --bus sim --json";
    for (arguments, said) in [
        ("servos:nobody@sim", "nobody"),
        ("servos:op3@sim", "no joint of one robot"),
        ("imu:bno08x-rvc@/dev/x", "only a robot leads another"),
        ("so101-leader", "not a source"),
        ("servos:so101-leader@sim:pty", "virtual time"),
        ("servos:so101-leader@serial:/dev/no-such-port", "no such port"),
        ("servos:so101-leader@sim --pace 0", "0.05 to 1"),
        ("servos:so101-leader@sim --pace nan", "0.05 to 1"),
        ("servos:so101-leader@sim --by-range nose", "not a joint that both robots have"),
    ] {
        let output = program::gaitway()
            .arg("follow")
            .args(arguments.split_whitespace())
            .args(robot.split_whitespace())
            .output()
            .expect("runs");
        let report = json(&output);
        assert_eq!((&report["outcome"], output.status.code()), (&"refused".into(), Some(1)));
        let reason = report["stop_reason"].as_str().unwrap_or_default();
        assert!(reason.contains(said), "{arguments}: {reason}");
        assert_eq!(report["cycles"], 0);
    }
}

#[test]
fn a_leader_that_rests_in_virtual_time_is_followed_for_the_time_that_was_said() {
    let output = program::gaitway()
        .args("follow servos:so101-leader@sim --robot so101 --bus sim --for 2s --json".split(' '))
        .arg("--accept-firmware")
        .output()
        .expect("runs");
    let report = json(&output);
    assert_eq!((&report["outcome"], output.status.code()), (&"done".into(), Some(0)), "{report}");
    assert!((report["following_s"].as_f64().expect("a time") - 2.0).abs() < 0.1, "{report}");
}
