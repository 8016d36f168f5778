//! A virtual robot on the desk: its lines behind pseudo-terminals, its registers and joints in the
//! hands of the test. The command under test is a process of its own.

#![allow(dead_code)]

use crate::aloud::aloud;
use crate::priority::run_before_others;
use gaitway_sim::{BenchServos, Door, Fault, Options, World, bench};
use serde_json::Value;
use std::process::{Command, Output};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// World time at which the power fails, far beyond any test, ns.
const POWER_OFF_NS: u64 = 600_000_000_000;

/// One desk at a time: time is real here, and two robots on a small machine are late.
static ALONE: Mutex<()> = Mutex::new(());

/// The robot and its door.
pub struct Desk {
    world: Arc<Mutex<World>>,
    door: Door,
    _alone: MutexGuard<'static, ()>,
}

impl Desk {
    /// `robot`, whose referee minds EEPROM writes.
    pub fn with(robot: &str) -> Self {
        Self::new(robot, false)
    }

    /// `robot`, whose EEPROM may be written.
    pub fn permitting(robot: &str) -> Self {
        Self::new(robot, true)
    }

    /// One servo of this model, with ID 1 at 57,600 bit/s, and the name of its joint.
    pub fn of_servo(model: &str) -> (Self, String) {
        let servo = BenchServos { model: model.to_owned(), ids: vec![1] };
        let file = bench(&[servo], Some(57_600)).expect("a bench");
        let joint = file.joints[0].name.clone();
        (Self::of(&file, true), joint)
    }

    fn new(robot: &str, permit_eeprom: bool) -> Self {
        let file = gaitway_profiles::robot(robot).expect("a shipped robot");
        Self::of(&file, permit_eeprom)
    }

    fn of(file: &gaitway_profiles::Robot, permit_eeprom: bool) -> Self {
        let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
        run_before_others();
        let faults =
            vec![Fault::Brownout { from_ns: POWER_OFF_NS, until_ns: POWER_OFF_NS + 1_000_000_000 }];
        let options = Options { permit_eeprom, faults, ..Options::default() };
        let world = Arc::new(Mutex::new(World::new(file, options).expect("a virtual robot")));
        let door = Door::open(Arc::clone(&world), 0, None).expect("a pseudo-terminal");
        Self { world, door, _alone }
    }

    /// The line's address.
    pub fn bus(&self) -> String {
        format!("serial:{}", self.door.path().display())
    }

    /// The same line behind a TCP port of this machine, as long as the door lives.
    pub fn over_tcp(&self) -> (String, Door) {
        let local = std::net::SocketAddr::from(([127, 0, 0, 1], 0));
        let door = Door::open_tcp(Arc::clone(&self.world), 0, local).expect("a TCP port");
        (door.path().display().to_string(), door)
    }

    /// The robot itself.
    pub fn world(&self) -> MutexGuard<'_, World> {
        self.world.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Every register that is set and not measured.
    pub fn registers(&self, joint: &str) -> Vec<(String, Option<i64>)> {
        let world = self.world();
        let names = ["ID", "Baud Rate", "Torque Enable", "Goal Position", "Operating Mode"];
        names.iter().map(|name| ((*name).to_owned(), world.register(joint, name))).collect()
    }

    /// Takes the robot off its power and puts it back. World time then runs ahead of real time: no
    /// command can be run any more.
    pub fn power_cycle(&self) {
        self.world().run_until(POWER_OFF_NS + 2_000_000_000);
    }

    /// What the referee has against the commands so far.
    pub fn violations(&self) -> Vec<String> {
        self.world().verdict().violations.iter().map(ToString::to_string).collect()
    }
}

/// Runs `gaitway` with arguments.
pub fn run(arguments: &[&str]) -> Output {
    crate::program::gaitway().args(arguments).output().expect("the command")
}

/// Runs a line as it was printed for the user, quotes and all.
pub fn run_line(line: &str) {
    let folder = std::path::Path::new(crate::program::PATH).parent().expect("a folder");
    let path = std::env::var("PATH").unwrap_or_default();
    let done = Command::new("sh")
        .args(["-c", line])
        .env("PATH", format!("{}:{path}", folder.display()))
        .output()
        .expect("a shell");
    assert!(done.status.success(), "{line}\n{}", String::from_utf8_lossy(&done.stderr));
}

/// What was printed.
pub fn text(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// What was printed as JSON.
pub fn json(output: &Output) -> Value {
    let said = String::from_utf8_lossy(&output.stderr);
    serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{e}: {said}"))
}

/// How often a command is run again that the machine disturbed, at most.
const ATTEMPTS: u32 = 20;

/// True if a command ended otherwise than it should because this machine was late: by the reason to
/// stop in its report, or in its words.
fn machine_was_late(output: &Output) -> bool {
    let report: Value = serde_json::from_slice(&output.stdout).unwrap_or_default();
    let code = report["stop"]["code"].as_str().unwrap_or_default();
    let said = String::from_utf8_lossy(&output.stderr);
    let words = ["this host is too late", "this host was", "the host stalled"];
    let is_said = |text: &str| words.iter().any(|word| text.contains(word));
    matches!(code, "late" | "stalled") || is_said(&said) || is_said(&text(output))
}

/// Runs until `done` likes what came out, again only where the machine itself was late: one that
/// stalls stops motions that run in real time, and is right to.
pub fn run_until_done(arguments: &[&str], done: impl Fn(&Output) -> bool) -> Output {
    for attempt in 1..=ATTEMPTS {
        let output = run(arguments);
        if done(&output) || !machine_was_late(&output) {
            return output;
        }
        aloud!("DISTURBED by the machine {attempt} times: {}", arguments.join(" "));
    }
    panic!("this machine stalls too often: {}", arguments.join(" "));
}

/// The words of a refusal.
pub fn refusal(output: &Output) -> String {
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{said}{}", text(output));
    said
}
