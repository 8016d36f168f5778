//! A virtual robot in a process of its own, in real time, and motions on it that the machine may disturb.

use crate::aloud::aloud;
use crate::program;
use serde_json::Value;
use std::io::{BufRead as _, BufReader, Read as _};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

/// How often a motion is begun again that the machine disturbed: it may be busy for a while.
pub const ATTEMPTS: u32 = 20;
/// Time in which a process that ends has ended, however busy the machine is.
pub const PATIENCE: Duration = Duration::from_secs(60);

/// The robot behind a pseudo-terminal; it ends with the test.
pub struct Simulator {
    pub child: Child,
    pub link: PathBuf,
}

impl Simulator {
    /// A robot, by name or path of its file, behind a link in `folder`.
    pub fn start(folder: &Path, robot: &str) -> Self {
        let link = folder.join("line");
        let mut child = program::gaitway()
            .args(["simulate", robot, "--pty"])
            .arg(&link)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the simulator");
        // Its first line of output says that the port is there.
        let mut line = String::new();
        let stdout = child.stdout.as_mut().expect("its output");
        BufReader::new(stdout).read_line(&mut line).expect("a line");
        assert!(line.starts_with("/dev/"), "{line:?}");
        Self { child, link }
    }

    /// Ends it and returns what its referee said.
    pub fn end(mut self) -> String {
        signal(&self.child, "INT");
        let output = wait_for(&mut self.child, PATIENCE);
        assert!(output.is_some(), "the simulator did not end");
        let mut said = String::new();
        let mut stderr = self.child.stderr.take().expect("its diagnostics");
        stderr.read_to_string(&mut said).expect("text");
        said
    }
}

impl Drop for Simulator {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

pub fn signal(child: &Child, name: &str) {
    let sent = Command::new("kill").args(["-s", name, &child.id().to_string()]).status();
    assert!(sent.is_ok_and(|s| s.success()), "no signal sent");
}

pub fn wait_for(child: &mut Child, limit: Duration) -> Option<ExitStatus> {
    let began = Instant::now();
    while began.elapsed() < limit {
        if let Some(status) = child.try_wait().expect("a child") {
            return Some(status);
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    None
}

/// True if a run ended because this machine was late.
pub fn machine_was_late(report: &Value) -> bool {
    let code = report["stop"]["code"].as_str().unwrap_or_default();
    let reason = report["stop_reason"].as_str().unwrap_or_default();
    matches!(code, "late" | "stalled")
        || ["this host is too late", "the host stalled"].iter().any(|words| reason.contains(words))
}

/// Plays until the machine itself did not get in the way. A host that stalls for 100 ms, as virtual
/// machines now and then do, is rightly stopped; that is tested in virtual time, not here.
pub fn undisturbed(mut attempt: impl FnMut() -> Value) -> Value {
    for number in 1..=ATTEMPTS {
        let report = attempt();
        if !machine_was_late(&report) {
            return report;
        }
        let reason = &report["stop_reason"];
        aloud!("DISTURBED by the machine {number} times, once more: {reason}");
    }
    panic!("this machine stalls too often to play in real time");
}
