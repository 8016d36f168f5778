//! A machine that has more to do than the virtual robot and its host: what the documents show ends as it
//! does on an idle one, and what cannot be known to be virtual is stopped, as on a real line.
//!
//! Beside each test run processes that never rest: two for each core, or with `GAITWAY_LONG` ten.

mod aloud;
mod program;
mod python;

use aloud::aloud;
use serde_json::Value;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// One test at a time: each brings its own load.
static ALONE: Mutex<()> = Mutex::new(());

fn alone() -> MutexGuard<'static, ()> {
    ALONE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Processes that never rest; they end with the test.
struct Busy(Vec<Child>);

impl Busy {
    fn machine() -> Self {
        let cores = std::thread::available_parallelism().map_or(2, usize::from);
        let each = if std::env::var_os("GAITWAY_LONG").is_some() { 10 } else { 2 };
        let spin = || Command::new("sh").args(["-c", "while :; do :; done"]).spawn();
        Self((0..cores * each).map(|_| spin().expect("a shell")).collect())
    }
}

impl Drop for Busy {
    fn drop(&mut self) {
        for child in &mut self.0 {
            let _ = child.kill().and_then(|()| child.wait());
        }
    }
}

/// A process that serves until the test ends.
struct Served(Child);

impl Served {
    /// Begins it and waits for its first line, which says that it is there.
    fn start(folder: &Path, line: &str) -> Self {
        let mut child = gaitway(folder, line).stdout(Stdio::piped()).spawn().expect("a process");
        let mut told = String::new();
        BufReader::new(child.stdout.as_mut().expect("piped")).read_line(&mut told).expect("text");
        assert!(told.starts_with('/'), "{told:?}");
        Self(child)
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        signal(&self.0, "INT");
        let _ = self.0.wait();
    }
}

fn gaitway(folder: &Path, line: &str) -> Command {
    let mut command = crate::program::gaitway();
    command.args(line.split(' ')).current_dir(folder);
    command
}

fn signal(child: &Child, name: &str) {
    let _ = Command::new("kill").args(["-s", name, &child.id().to_string()]).status();
}

fn report(output: &Output) -> Value {
    let said = String::from_utf8_lossy(&output.stderr);
    serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("no report ({e}): {said}"))
}

/// For how long the virtual robot waited, as the report says it.
fn waited_s(report: &Value) -> f64 {
    let notes = report["notes"].as_array().expect("notes").iter().filter_map(Value::as_str);
    let mut told = notes.filter_map(|note| note.split_once("waits for this machine, so far "));
    let (_, rest) = told.next().unwrap_or_else(|| panic!("it is not said: {report:#}"));
    rest.split(' ').next().and_then(|s| s.parse().ok()).expect("seconds")
}

/// Plays, and lets the player stand three times for a third of a second once its recording has begun
/// to grow.
fn played_with_stalls(folder: &Path, bus: &str) -> Value {
    let line = "play walk --hang --robot op3 --json --rate 50 --record run.mcap --bus";
    let mut player = gaitway(folder, line);
    // Into a file: a pipe that nobody reads would hold up who has much to report.
    let told = folder.join("report.json");
    let into = std::fs::File::create(&told).expect("a file");
    let mut player = player.arg(bus).stdout(into).spawn().expect("a player");
    for bytes in [8_000, 20_000, 33_000] {
        let grown = || std::fs::metadata(folder.join("run.mcap")).map_or(0, |file| file.len());
        while grown() < bytes && player.try_wait().expect("a child").is_none() {
            std::thread::sleep(Duration::from_millis(5));
        }
        signal(&player, "STOP");
        std::thread::sleep(Duration::from_millis(333));
        signal(&player, "CONT");
    }
    player.wait().expect("an end");
    let report = std::fs::read(told).expect("a report");
    serde_json::from_slice(&report).unwrap_or_else(|e| panic!("no report: {e}"))
}

#[test]
fn a_host_that_stands_is_waited_for_by_its_own_virtual_robot_and_by_no_other() {
    let _alone = alone();
    let report = played_with_stalls(&crate::program::folder("own"), "sim:pty");
    assert_eq!(report["outcome"], "done", "{report:#}");
    assert_eq!(report["referee"]["violations"], serde_json::json!([]));
    assert_eq!((&report["late_cycles"], &report["missed_cycles"]), (&0.into(), &0.into()));
    assert!(waited_s(&report) > 0.9, "{} s of 1 s", waited_s(&report));

    let folder = crate::program::folder("other");
    let _robot = Served::start(&folder, "simulate op3 --quiet --pty op3");
    let report = played_with_stalls(&folder, "serial:./op3");
    assert_eq!(report["outcome"], "stopped", "{report:#}");
    assert_eq!(report["stop"]["code"], "stalled", "{report:#}");
}

#[test]
fn motions_and_moves_end_beside_busy_processes() {
    let _alone = alone();
    let _busy = Busy::machine();
    let folder = crate::program::folder("moves");
    for line in [
        "play walk --robot op3 --bus sim:pty --json",
        "play bow --robot poppy-humanoid --bus sim:pty --json",
        "play wave-r --loop 2 --robot op3 --bus sim:pty --json",
        "servo move sim:pty 19 20 --robot op3 --json",
        "live --from file:wave-r --robot op3 --bus sim:pty --for 5s --json",
    ] {
        let report = report(&gaitway(&folder, line).output().expect("a run"));
        assert_eq!(report["outcome"], "done", "{line}: {report:#}");
        println!("{line}: waited {:.3} s", waited_s(&report));
    }
}

#[test]
fn directions_are_asked_for_to_the_end_beside_busy_processes() {
    let _alone = alone();
    let _busy = Busy::machine();
    let folder = crate::program::folder("directions");
    let answers = folder.join("answers");
    std::fs::write(&answers, "y\ny\n").expect("a file");
    let line = "doctor --directions --robot so101 --bus sim:pty --joint shoulder_pan --joint gripper --json";
    let answers = std::fs::File::open(answers).expect("a file");
    let report = report(&gaitway(&folder, line).stdin(answers).output().expect("a run"));
    assert_eq!(report["outcome"], "done", "{report:#}");
    assert_eq!(report["joints"].as_array().expect("joints").len(), 2, "{report:#}");
}

#[test]
fn the_live_demonstration_of_the_readme_ends_beside_busy_processes() {
    let _alone = alone();
    let readme = include_str!("../README.md");
    let demo = |begin: &str| {
        let mut lines = readme.lines().filter_map(|line| line.strip_prefix("gaitway "));
        let line = lines.find(|line| line.starts_with(begin)).expect("a demonstration");
        line.replace("/tmp/body", "body")
    };
    let _busy = Busy::machine();
    let folder = crate::program::folder("live");
    let _body = Served::start(&folder, &demo("simulate imus").replace("walk:30s", "walk:6s"));
    // Written when all sensors are there.
    while !folder.join("body/wear.toml").exists() {
        std::thread::sleep(Duration::from_millis(50));
    }
    let line = format!("{} --for 12s --json", demo("live"));
    let report = report(&gaitway(&folder, &line).output().expect("a run"));
    assert_eq!(report["outcome"], "done", "{report:#}");
    assert_eq!(report["referee"]["violations"], serde_json::json!([]));
    assert_eq!((&report["late_cycles"], &report["missed_cycles"]), (&0.into(), &0.into()));
    println!("waited {:.3} s, sensors silent {} s", waited_s(&report), report["stale_s"]);
}

/// What other people's programs are shown to do with the virtual robot. Python blocks of its README
/// that contain `word`.
fn shown(word: &str) -> Vec<&'static str> {
    let readme = include_str!("../sim/README.md");
    let blocks = readme.split("```python\n").skip(1).filter_map(|text| text.split_once("```"));
    blocks.map(|(code, _)| code).filter(|code| code.contains(word)).collect()
}

fn environment() -> Option<python::Python> {
    python::python()
        .inspect_err(|why| aloud!("SKIPPED: the README's Python examples were not tried: {why}"))
        .ok()
}

#[test]
fn the_pytest_fixture_of_the_readme_passes_beside_busy_processes() {
    let _alone = alone();
    let Some(python) = environment() else { return };
    let [fixture, tests] = shown("import pytest").try_into().expect("a fixture and tests");
    let folder = crate::program::folder("pytest");
    std::fs::write(folder.join("conftest.py"), fixture).expect("a file");
    std::fs::write(folder.join("test_op3.py"), tests).expect("a file");
    let _busy = Busy::machine();
    let output = Command::new(python.program)
        .args(["-m", "pytest", "-q", "-p", "no:cacheprovider"])
        .env("GAITWAY", crate::program::PATH)
        .current_dir(&folder)
        .output()
        .expect("Python starts");
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success() && said.contains("3 passed"), "{said}");
}

#[test]
fn the_lerobot_and_pypot_examples_of_the_readme_read_every_joint_beside_busy_processes() {
    let _alone = alone();
    let Some(python) = environment() else { return };
    let absent = include_str!("clients/lerobot_alone.py");
    let _busy = Busy::machine();
    let folder = crate::program::folder("clients");
    for (word, robot, path, prelude, values) in [
        ("from lerobot", "so101 --permit-eeprom", "/tmp/so101", absent, 6),
        ("from pypot", "op2", "/tmp/op2", "", 2),
    ] {
        let [example] = shown(word).try_into().expect("one example");
        let link = folder.join(Path::new(path).file_name().expect("a name"));
        let name = link.file_name().and_then(|name| name.to_str()).expect("a name");
        let _robot = Served::start(&folder, &format!("simulate {robot} --quiet --pty {name}"));
        let link = link.display().to_string();
        let output = Command::new(&python.program)
            .args(["-B", "-c", &format!("{prelude}\n{}", example.replace(path, &link))])
            .env("GAITWAY_BESIDE", &python.beside)
            .output()
            .expect("Python starts");
        let said = String::from_utf8_lossy(&output.stdout);
        let numbers = said.matches(',').count() + 1;
        let error = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success() && numbers == values, "{word}: {said}{error}");
    }
}
