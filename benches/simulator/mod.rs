//! A virtual OP3 in a process of its own, whose time waits for nobody.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};

/// The simulator, once its pseudo-terminal is at `link`.
pub fn op3(link: &Path) -> Child {
    let mut simulator = Command::new(env!("CARGO_BIN_EXE_gaitway"))
        .args(["simulate", "op3", "--quiet", "--pty"])
        .arg(link)
        .stdout(Stdio::piped())
        .spawn()
        .expect("the gaitway command");
    let mut told = String::new();
    // The first line says that the terminal is there.
    BufReader::new(simulator.stdout.take().expect("piped")).read_line(&mut told).expect("a line");
    simulator
}
