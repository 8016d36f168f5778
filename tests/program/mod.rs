//! The program as a user runs it who has no profiles and no calibrations of their own, whoever runs the
//! tests.

#![allow(dead_code)] // no test needs all of it

use serde_json::Value;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

/// Where the program is.
pub const PATH: &str = env!("CARGO_BIN_EXE_gaitway");

/// The program, to be given arguments.
pub fn gaitway() -> Command {
    let mut command = Command::new(PATH);
    command.env("XDG_CONFIG_HOME", Path::new(env!("CARGO_TARGET_TMPDIR")).join("nobody"));
    command.env("NO_COLOR", "1");
    command
}

/// An empty folder of this test's own: no other test of the same file has one of this name.
#[track_caller]
pub fn folder(name: &str) -> PathBuf {
    let file = Path::new(std::panic::Location::caller().file());
    let file = file.file_stem().expect("a file of tests");
    let mut folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(env!("CARGO_CRATE_NAME"));
    if file != env!("CARGO_CRATE_NAME") {
        folder.push(file);
    }
    folder.push(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).expect("a folder");
    folder
}

/// All that a run of it said.
pub fn words(output: &Output) -> String {
    String::from_utf8_lossy(&[&output.stdout[..], &output.stderr].concat()).into_owned()
}

/// The report of a run that was asked for one.
pub fn json(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{e}: {}", words(output)))
}

/// Runs what the README begins with, as somebody does who has just installed the program: the first motion, with its page,
/// and the first virtual device. `installed` makes a command of the installed program, which is given `folder`, by the name that
/// it has there, for its files.
pub fn does_what_the_readme_begins_with(installed: impl Fn() -> Command, folder: &str) {
    let readme = include_str!("../../README.md");
    let mut lines = readme.lines().filter_map(|line| line.strip_prefix("gaitway "));
    let (play, simulate) = (lines.next().expect("a first"), lines.next().expect("a second"));
    assert!(play.starts_with("play walk ") && simulate.starts_with("simulate imus "), "{play}");
    let play = play.replace("walk.html", &format!("{folder}/walk.html"));
    let played = installed().args(play.split(' ')).arg("--json").output().expect("a program");
    assert_eq!(json(&played)["outcome"], "done", "{}", words(&played));

    let simulate = simulate.replace("/tmp/body", &format!("{folder}/body"));
    let mut simulate_command = installed();
    simulate_command.args(simulate.split(' ')).stdout(Stdio::piped());
    let mut simulator = simulate_command.spawn().expect("a program");
    let mut told = String::new();
    let mut stdout = BufReader::new(simulator.stdout.take().expect("piped"));
    stdout.read_line(&mut told).expect("text");
    let interrupt = ["-INT", &simulator.id().to_string()];
    let _ = Command::new("kill").args(interrupt).status();
    let ended = simulator.wait().expect("an end");
    assert!(told.starts_with(&format!("{folder}/body")) && ended.success(), "{told:?} {ended}");
}
