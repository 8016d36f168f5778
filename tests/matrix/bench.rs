//! One cell of the matrix: the real command, a virtual robot, a fault at a moment.

use crate::tap::{Deed, Moment, Seen, Tap};
use crate::wire::Dialect;
use gaitway_sim::Violation;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::process::{Pid, Resource, Rlimit, Signal, kill_process, prlimit};
use serde_json::Value;
use std::fs::File;
use std::io::{Read, Write};
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdout, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// The robots, and what is played on them.
#[derive(Clone, Copy, Debug)]
pub struct Robot {
    pub name: &'static str,
    pub dialect: Dialect,
    /// Cycles per second: half the usual rate, since whether a busy machine keeps that is not what is
    /// tested here.
    pub rate_hz: u32,
    /// The joint of `servo move` and `calibrate`, and its ID.
    pub joint: (&'static str, u8),
    /// One that is still to come when `calibrate` is disturbed at the first.
    pub next_joint: &'static str,
}

pub const DUCK: Robot = Robot {
    name: "open-duck-mini-v2",
    dialect: Dialect::Feetech,
    rate_hz: 25,
    joint: ("left_knee", 23),
    next_joint: "left_ankle",
};
pub const OP3: Robot = Robot {
    name: "op3",
    dialect: Dialect::Dynamixel,
    rate_hz: 25,
    joint: ("head_pan", 19),
    next_joint: "head_tilt",
};

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Job {
    Play,
    Live,
    Move,
    Hold,
    Calibrate,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    Signal(i32),
    FileSize,
    Pipe,
    OutClosed,
    ErrClosed,
    Full,
    /// The step it is put in.
    Panic(&'static str),
    Kill,
    /// None: the twin.
    Nothing,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    Before,
    Arming,
    Torque,
    Approach,
    Motion,
    Ramp,
    /// Nothing but the fault, or nowhere in particular: the end.
    Alone,
}

impl Fault {
    /// True if it is there from the start; an interrupt then comes at the phase.
    pub const fn is_lasting(self) -> bool {
        matches!(self, Self::OutClosed | Self::ErrClosed | Self::Full)
    }
}

/// What came of a run.
pub struct Ran {
    pub code: Option<i32>,
    pub signal: Option<i32>,
    /// The JSON report, from standard output or from its file.
    pub report: Option<Value>,
    pub said: String,
    pub seen: Seen,
    /// Joint names, and whether torque is on in the end.
    pub torque: Vec<(String, bool)>,
    pub locks_open: usize,
    pub watchdogs: usize,
    pub folder: PathBuf,
    /// What the simulator's own referee has against the goals.
    pub violations: Vec<Violation>,
    /// How many deeds were left undone: the moment never came.
    pub undone: usize,
}

/// Time in which a process that ends has ended, however busy the machine is.
const PATIENCE: Duration = Duration::from_secs(60);
/// Where `walk` is fastest, after its approach.
const INTO_THE_WALK: Duration = Duration::from_millis(2800);
/// The same in cycles.
const MOTION_CYCLE: u32 = 70;
/// In the middle of `servo move`.
const INTO_THE_MOVE: Duration = Duration::from_millis(1200);
const APPROACH_CYCLE: u32 = 9;

fn words(text: &str) -> Vec<String> {
    text.split_whitespace().map(str::to_owned).collect()
}

fn arguments(job: Job, robot: Robot, port: &str, folder: &Path) -> Vec<String> {
    let Robot { name, rate_hz, joint, .. } = robot;
    let file = |file: &str| folder.join(file).display().to_string();
    let line = match job {
        Job::Play => format!(
            "play walk --hang --to 2.8 --robot {name} --bus {port} --rate {rate_hz} --record {}",
            file("run.mcap")
        ),
        Job::Live => format!(
            "live --from file:walk --for 4 --robot {name} --bus {port} --rate {rate_hz} \
             --record {}",
            file("run.mcap")
        ),
        Job::Move => {
            format!("servo move {port} {} -60 --speed 30 --robot {name}", joint.1)
        }
        Job::Hold => format!("hold {name} --bus {port}"),
        Job::Calibrate => format!(
            "calibrate {name} --bus {port} --only {},{} --yes --permit-eeprom --calibration {}",
            joint.0,
            robot.next_joint,
            file("calibrated.toml")
        ),
    };
    words(&format!("{line} --json --quiet --report {}", file("report.json")))
}

/// The process under test, as its faults see it.
#[derive(Clone, Default)]
struct Victim {
    pid: Arc<Mutex<Option<Pid>>>,
    /// True once nobody reads its standard output any more.
    is_unread: Arc<AtomicBool>,
}

impl Victim {
    fn pid(&self) -> Pid {
        // It speaks on the line before whoever started it has learnt its number.
        loop {
            if let Some(pid) = *self.pid.lock().expect("its number") {
                return pid;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    fn signal(&self, number: i32) {
        let signal = Signal::from_named_raw(number).expect("a signal");
        let _ = kill_process(self.pid(), signal);
    }
}

/// When the phase is there, for this command.
fn moment(job: Job, phase: Phase) -> Option<Moment> {
    match (job, phase) {
        (_, Phase::Before) => Some(Moment::First),
        (Job::Calibrate, Phase::Torque) => Some(Moment::Torque),
        (Job::Calibrate, Phase::Approach) => Some(Moment::Looks(20)),
        (Job::Calibrate, Phase::Motion) => Some(Moment::Unlocked),
        (Job::Hold, Phase::Arming) => Some(Moment::Arming),
        (Job::Hold, Phase::Torque) => Some(Moment::Torque),
        (Job::Hold | Job::Calibrate, _) => None,
        (_, Phase::Arming) => Some(Moment::Arming),
        (_, Phase::Torque) => Some(Moment::Torque),
        (Job::Move, Phase::Approach) => None,
        (_, Phase::Approach) => Some(Moment::Moving(APPROACH_CYCLE as usize)),
        (Job::Move, Phase::Motion | Phase::Ramp) => Some(Moment::After(INTO_THE_MOVE)),
        (_, Phase::Motion | Phase::Ramp) => Some(Moment::After(INTO_THE_WALK)),
        (_, Phase::Alone) => None,
    }
}

/// What is to be done when; nothing if there is no such cell.
fn deeds(
    job: Job,
    fault: Fault,
    phase: Phase,
    victim: &Victim,
    folder: &Path,
) -> Vec<(Moment, Deed)> {
    let interrupt = |victim: &Victim| -> Deed {
        let victim = victim.clone();
        Box::new(move || victim.signal(2))
    };
    let Some(moment) = moment(job, phase) else { return Vec::new() };
    let own = victim.clone();
    let recording = folder.join("run.mcap");
    let deed: Option<Deed> = match fault {
        Fault::Signal(number) => Some(Box::new(move || own.signal(number))),
        Fault::Kill => Some(Box::new(move || own.signal(9))),
        Fault::Pipe => Some(Box::new(move || own.is_unread.store(true, Ordering::Release))),
        Fault::FileSize => Some(Box::new(move || {
            // What is there may stay; not a byte more.
            let size = std::fs::metadata(&recording).map_or(0, |file| file.len());
            let limit = Rlimit { current: Some(size), maximum: None };
            prlimit(Some(own.pid()), Resource::Fsize, limit).expect("a limit");
        })),
        Fault::OutClosed | Fault::ErrClosed | Fault::Full => Some(interrupt(victim)),
        Fault::Panic(_) | Fault::Nothing => None,
    };
    match (phase, deed) {
        (Phase::Ramp, deed) => {
            let first = match fault {
                // The ramp must be under way in the very cycle that breaks.
                Fault::Panic(_) => Moment::Goals(MOTION_CYCLE as usize),
                _ => moment,
            };
            let then = deed.map(|deed| (Moment::Goals(2), deed));
            std::iter::once((first, interrupt(victim))).chain(then).collect()
        }
        (_, deed) => deed.map(|deed| (moment, deed)).into_iter().collect(),
    }
}

/// The cycle in which a panic is put in.
fn panics_at(job: Job, phase: Phase, step: &str) -> String {
    let cycle = match phase {
        _ if job == Job::Calibrate => 0,
        Phase::Approach => APPROACH_CYCLE,
        Phase::Motion => MOTION_CYCLE,
        Phase::Ramp => MOTION_CYCLE + 2,
        _ => 0,
    };
    // A step that ends in + breaks whenever the program comes to it.
    format!("{}:{cycle}{}", step.trim_end_matches('+'), if step.ends_with('+') { "+" } else { "" })
}

fn command(
    job: Job,
    fault: Fault,
    phase: Phase,
    robot: Robot,
    port: &str,
    folder: &Path,
) -> Command {
    let closed = match fault {
        Fault::OutClosed => ">&-",
        Fault::ErrClosed => "2>&-",
        Fault::Full => ">/dev/full 2>/dev/full",
        _ => "",
    };
    let mut command = Command::new("sh");
    let script = format!("exec \"$0\" \"$@\" {closed}");
    command.args(["-c", &script, crate::program::PATH]);
    command.args(arguments(job, robot, port, folder));
    command.stdin(if job == Job::Calibrate { Stdio::piped() } else { Stdio::null() });
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    if let (Fault::FileSize, Job::Move | Job::Hold | Job::Calibrate) = (fault, job) {
        command.stdout(File::create(folder.join("out.json")).expect("a file"));
    }
    if let Fault::Panic(step) = fault {
        command.env("GAITWAY_PANIC", panics_at(job, phase, step));
    }
    command
}

/// Runs one cell.
pub fn run(job: Job, fault: Fault, phase: Phase, robot: Robot) -> Ran {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(
        format!("matrix-{job:?}-{fault:?}-{phase:?}-{}", robot.name).replace(['(', ')', '"'], ""),
    );
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).expect("a temporary folder");
    let victim = Victim::default();
    let deeds = deeds(job, fault, phase, &victim, &folder);
    let planned = deeds.len();
    let mut tap = Tap::open(robot.name, robot.dialect, deeds);
    let names = tap.world().joint_names();
    if job == Job::Calibrate {
        // It is held, so that there is torque to be switched off.
        for name in &names {
            let mut world = tap.world();
            let at = world.register(name, "Present Position").expect("a servo");
            world.set_register(name, "Goal Position", at);
            world.set_register(name, "Torque Enable", 1);
        }
    }
    let mut child = command(job, fault, phase, robot, tap.port(), &folder).spawn().expect("a run");
    *victim.pid.lock().expect("its number") = Some(Pid::from_child(&child));
    let said = read_aside(child.stderr.take());
    let told = read_until(child.stdout.take(), Arc::clone(&victim.is_unread));
    if job == Job::Calibrate {
        guide(&mut child, &tap, robot);
    }
    let status = wait(&mut child);
    tap.close();
    let told = told.join().expect("text");
    let report = serde_json::from_str(&told).ok();
    let filed = |name: &str| std::fs::read(folder.join(name)).ok();
    let report = report.or_else(|| serde_json::from_slice(&filed("report.json")?).ok());
    let report = report.or_else(|| serde_json::from_slice(&filed("out.json")?).ok());
    let seen = std::mem::take(&mut *tap.seen());
    let world = tap.world();
    let raw = |name: &String, register: &str| world.register(name, register);
    let is_set = |name: &&String, register: &str, value: i64| raw(name, register) == Some(value);
    Ran {
        code: status.code(),
        signal: status.signal(),
        report,
        said: said.join().expect("text"),
        undone: planned - seen.put_in.len(),
        torque: names.iter().map(|n| (n.clone(), raw(n, "Torque Enable") == Some(1))).collect(),
        locks_open: names.iter().filter(|name| is_set(name, "Lock", 0)).count(),
        watchdogs: names
            .iter()
            .filter(|name| raw(name, "Bus Watchdog").is_some_and(|raw| raw != 0))
            .count(),
        violations: world.verdict().violations,
        seen,
        folder,
    }
}

/// Reads a stream to its end on a thread of its own.
fn read_aside(stream: Option<impl Read + Send + 'static>) -> JoinHandle<String> {
    std::thread::spawn(move || {
        let mut bytes = Vec::new();
        if let Some(mut stream) = stream {
            let _ = stream.read_to_end(&mut bytes);
        }
        String::from_utf8_lossy(&bytes).into_owned()
    })
}

/// Reads a pipe until it ends, or nobody wants to read it any more: then it is closed.
fn read_until(pipe: Option<ChildStdout>, is_unread: Arc<AtomicBool>) -> JoinHandle<String> {
    std::thread::spawn(move || {
        let mut bytes = Vec::new();
        let mut chunk = [0; 4096];
        let Some(mut pipe) = pipe else { return String::new() };
        while !is_unread.load(Ordering::Acquire) {
            let patience = Timespec { tv_sec: 0, tv_nsec: 10_000_000 };
            if poll(&mut [PollFd::new(&pipe, PollFlags::IN)], Some(&patience)) == Ok(0) {
                continue;
            }
            match pipe.read(&mut chunk) {
                Ok(0) | Err(_) => break,
                Ok(count) => bytes.extend_from_slice(&chunk[..count]),
            }
        }
        String::from_utf8_lossy(&bytes).into_owned()
    })
}

fn wait(child: &mut Child) -> std::process::ExitStatus {
    let began = Instant::now();
    while began.elapsed() < PATIENCE {
        if let Some(status) = child.try_wait().expect("a child") {
            return status;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    let _ = child.kill();
    let _ = child.wait();
    panic!("it did not end within {PATIENCE:?}");
}

/// The person of `calibrate`: zero where the joint is, positive there, so far it goes. Ends with the
/// command.
fn guide(child: &mut Child, tap: &Tap, robot: Robot) {
    let mut stdin = child.stdin.take().expect("its input");
    let (joint, _) = robot.joint;
    // Somebody looks at the joint again and again once torque is off; a few looks after each turn
    // of the hand all of it has been seen.
    let looked_at = |child: &mut Child, looks: u64| -> bool {
        let statuses = || tap.world().statuses(joint).unwrap_or(0);
        let (enough, began) = (statuses() + looks, Instant::now());
        while statuses() < enough && began.elapsed() < PATIENCE {
            if child.try_wait().expect("a child").is_some() {
                return false;
            }
            std::thread::sleep(Duration::from_millis(2));
        }
        true
    };
    if !looked_at(child, 60) {
        return;
    }
    let from_rad = tap.world().joint_position_rad(joint).expect("a joint");
    let mut at_rad = from_rad;
    for turned_rad in [0.0, 0.3, -0.3] {
        while (at_rad - from_rad - turned_rad).abs() > 1e-9 {
            at_rad += (from_rad + turned_rad - at_rad).clamp(-0.1, 0.1);
            tap.world().place_joint(joint, at_rad);
            if !looked_at(child, 3) {
                return;
            }
        }
        let _ = writeln!(stdin);
        if !looked_at(child, 10) {
            return;
        }
    }
    // The other one stays as it is.
    let _ = writeln!(stdin, "s");
}
