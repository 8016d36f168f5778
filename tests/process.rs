//! The command as a process among processes: virtual robots behind pseudo-terminals, signals,
//! ports that are busy or vanish. Time is real here because that is the point.

mod aloud;
mod program;
mod simulated;

use aloud::aloud;
use serde_json::Value;
use simulated::{ATTEMPTS, PATIENCE, Simulator, machine_was_late, signal, undisturbed, wait_for};
use std::path::PathBuf;
use std::process::{Child, Command, Output, Stdio};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// One test at a time: these play in real time, and two robots on a small machine are late.
static ALONE: Mutex<()> = Mutex::new(());

fn alone() -> MutexGuard<'static, ()> {
    ALONE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A virtual op3.
fn op3(folder: &std::path::Path) -> Simulator {
    Simulator::start(folder, "op3")
}

impl Simulator {
    fn bus(&self) -> String {
        format!("serial:{}", self.link.display())
    }
}

/// What a process said that ends within the time: read as it comes, since one whose words nobody takes
/// cannot end.
fn output_within(child: Child, limit: Duration) -> Option<Output> {
    let (tell, told) = std::sync::mpsc::channel();
    std::thread::spawn(move || tell.send(child.wait_with_output()));
    told.recv_timeout(limit).ok().map(|output| output.expect("its output"))
}

fn play(bus: &str, more: &[&str]) -> Command {
    let mut command = crate::program::gaitway();
    command.args(["play", "walk", "--robot", "op3", "--json", "--quiet", "--bus", bus]);
    // Half the usual rate: whether a busy machine keeps 100 Hz is not what is tested here.
    // What is outside of this process is taken for a robot that could fall.
    command.args(["--rate", "50", "--hang"]).args(more);
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

fn report(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout).unwrap_or_else(|e| {
        let said = String::from_utf8_lossy(&output.stderr);
        panic!("no report ({e}): {said}")
    })
}

/// The referee of `simulate` saw no goal out of place. (A stall of the machine may have cut short a
/// motion that was begun again.)
fn assert_careful(said: &str) {
    for rule in ["R1", "R2", "R3", "R11"] {
        assert!(!said.contains(&format!(" {rule} at ")), "{said}");
    }
    assert!(said.contains(" goals written"), "{said}");
}

/// What the referee saw.
fn violations(report: &Value) -> Vec<String> {
    let seen = report["referee"]["violations"].as_array().expect("a referee").iter();
    seen.map(|v| v.as_str().expect("words").to_owned()).collect()
}

/// Reads the last moment of a recording.
fn recorded_s(path: &std::path::Path) -> f64 {
    gaitway::recording::summary(path).expect("a readable recording").duration_s
}

#[test]
fn a_robot_in_another_process_is_played_over_a_real_port() {
    let _alone = alone();
    let folder = crate::program::folder("another_process");
    let simulator = op3(&folder);
    let report =
        undisturbed(|| report(&play(&simulator.bus(), &["--to", "1.5"]).output().expect("a run")));
    assert_eq!(report["outcome"], "done", "{report:#}");
    assert!(report["max_end_velocity_rad_s"].as_f64().expect("a number").abs() < 1e-9);
    let worst = report["joints"].as_array().expect("joints").iter();
    let worst =
        worst.map(|j| j["tracking_rms_rad"].as_f64().expect("measured")).fold(0.0, f64::max);
    assert!(worst > 0.0 && worst < 0.1, "tracking {worst} rad");
    assert_careful(&simulator.end());
}

#[test]
fn an_interrupt_slows_the_motion_down_and_holds() {
    let _alone = alone();
    for (name, number, recorded) in
        [("INT", 130, 8_000), ("TERM", 143, 20_000), ("INT", 130, 33_000), ("TERM", 143, 12_000)]
    {
        let folder = crate::program::folder(&format!("signal_{name}_{recorded}"));
        let (child, recording) = under_way("sim:pty", &folder, recorded);
        signal(&child, name);
        // A second signal changes nothing.
        signal(&child, name);
        let output = output_within(child, PATIENCE).expect("it ends");
        let report = report_in(&folder);
        assert_eq!(output.status.code(), Some(number), "{name}");
        assert!(recorded_s(&recording) > 0.2);
        assert_eq!(report["outcome"], "stopped", "{report:#}");
        assert_eq!(report["stop_reason"], "stopped as asked");
        assert_eq!(violations(&report), [""; 0], "{name}");
    }
}

/// A player whose recording in `folder` has grown to `bytes`: it is well under way.
fn under_way(bus: &str, folder: &std::path::Path, bytes: u64) -> (Child, PathBuf) {
    let recording = folder.join("run.mcap");
    let record = recording.to_str().expect("a UTF-8 path");
    for number in 1..=ATTEMPTS {
        // Into a file: a pipe that nobody reads would hold up who has much to report.
        let told = std::fs::File::create(folder.join("report.json")).expect("a file");
        let mut command = play(bus, &["--force", "--record", record]);
        let mut child = command.stdout(told).spawn().expect("a run");
        while child.try_wait().expect("a child").is_none() {
            if std::fs::metadata(&recording).map_or(0, |m| m.len()) >= bytes {
                return (child, recording);
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        let report = report_in(folder);
        assert!(machine_was_late(&report), "it ended before {bytes} bytes: {report:#}");
        aloud!("DISTURBED by the machine {number} times, once more: it ended before {bytes} bytes");
    }
    panic!("this machine stalls too often to play in real time");
}

/// What a player that was under way reported as it ended.
fn report_in(folder: &std::path::Path) -> Value {
    let told = std::fs::read(folder.join("report.json")).expect("a report");
    serde_json::from_slice(&told).expect("JSON")
}

/// Kills a player in the middle of its motion: not one that a stalled machine had stopped already, which
/// takes its watch off the servos as it ends.
fn killed_in_motion(bus: &str, folder: &std::path::Path) {
    /// Three cycles of the robot's 20 ms.
    const STALL: Duration = Duration::from_millis(60);
    for number in 1..=ATTEMPTS {
        let (mut child, recording) = under_way(bus, folder, 20_000);
        child.kill().expect("kill -9");
        child.wait().expect("its end");
        let read = gaitway::recording::read(&recording).expect("a readable recording");
        assert!(!read.cycles.is_empty(), "nothing survived the kill");
        if !read.cycles.windows(2).any(|two| two[1].at.since(two[0].at) > STALL) {
            return;
        }
        aloud!("DISTURBED by the machine {number} times: it had stalled before it was killed");
    }
    panic!("this machine stalls too often to play in real time");
}

#[test]
fn a_killed_player_leaves_the_joints_at_rest_and_a_readable_recording() {
    let _alone = alone();
    let folder = crate::program::folder("killed");
    let simulator = op3(&folder);
    killed_in_motion(&simulator.bus(), &folder);
    // Longer than the servos wait for a word of their host: they have stopped by themselves.
    std::thread::sleep(Duration::from_millis(500));
    let looked = report(&play(&simulator.bus(), &["--dry-run"]).output().expect("a run"));
    let notes = looked["notes"].to_string();
    assert_eq!(notes.matches("the bus watchdog had stopped this servo").count(), 20, "{notes}");
    // The robot holds where it was; the next start takes it over there.
    let report =
        undisturbed(|| report(&play(&simulator.bus(), &["--to", "0.5"]).output().expect("a run")));
    assert_eq!(report["outcome"], "done", "{report:#}");
    let notes = report["notes"].to_string();
    assert!(notes.contains("torque was already on"), "{notes}");
    // And `limp` lets go of it, when told that this is meant.
    let limp = |more: &[&str]| {
        let bus = simulator.bus();
        crate::program::gaitway()
            .args(["limp", "op3", "--bus", &bus])
            .args(more)
            .output()
            .expect("a run")
    };
    let refused = limp(&[]);
    assert_eq!(refused.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&refused.stderr).contains("--yes"));
    assert_eq!(limp(&["--yes"]).status.code(), Some(0));
}

/// Waits until the child holds the port behind `link` open.
fn wait_until_open(child: &Child, link: &std::path::Path) {
    let port = std::fs::read_link(link).expect("the simulator's link");
    let began = Instant::now();
    loop {
        let open = std::fs::read_dir(format!("/proc/{}/fd", child.id())).expect("a child");
        let mut targets = open.filter_map(|fd| std::fs::read_link(fd.ok()?.path()).ok());
        if targets.any(|target| target == port) {
            return;
        }
        assert!(began.elapsed() < Duration::from_secs(20), "the port was never opened");
        std::thread::sleep(Duration::from_millis(1));
    }
}

#[test]
fn a_wish_to_stop_before_torque_is_on_leaves_the_robot_limp() {
    let _alone = alone();
    let folder = crate::program::folder("early_stop");
    let simulator = op3(&folder);
    let mut child = play(&simulator.bus(), &[]).spawn().expect("a run");
    // Once the port is open, preflight still watches the robot stand still for 0.2 s.
    wait_until_open(&child, &simulator.link);
    signal(&child, "INT");
    let status = wait_for(&mut child, PATIENCE).expect("it ends");
    assert_eq!(status.code(), Some(130));
    let output = child.wait_with_output().expect("its output");
    let stopped = report(&output);
    assert_eq!(stopped["outcome"], "stopped");
    assert_eq!(stopped["cycles"], 0, "it moved: {stopped:#}");
    let next = play(&simulator.bus(), &["--dry-run"]).output().expect("a run");
    let notes = report(&next)["notes"].to_string();
    assert!(!notes.contains("torque was already on"), "{notes}");
}

#[test]
fn a_port_in_use_is_refused_by_name() {
    let _alone = alone();
    let folder = crate::program::folder("busy");
    let simulator = op3(&folder);
    let second = (1..=ATTEMPTS).find_map(|number| {
        let (mut first, _) = under_way(&simulator.bus(), &folder, 10_000);
        let output = play(&simulator.bus(), &["--dry-run"]).output().expect("a second run");
        let was_there = first.try_wait().expect("a child").is_none();
        let _ = first.kill();
        let _ = first.wait();
        if !was_there {
            aloud!("DISTURBED by the machine {number} times: the first was over before the second");
        }
        was_there.then(|| report(&output))
    });
    let second = second.expect("this machine is too slow to start a second player");
    assert_eq!(second["outcome"], "refused");
    let reason = second["stop_reason"].as_str().expect("words");
    assert!(reason.contains("in use"), "{reason}");
    assert!(reason.contains(simulator.link.to_str().expect("UTF-8")), "{reason}");
}

#[test]
fn h18_a_port_that_vanishes_ends_the_motion_within_a_second() {
    let _alone = alone();
    let folder = crate::program::folder("vanish");
    let mut simulator = op3(&folder);
    let (child, recording) = under_way(&simulator.bus(), &folder, 10_000);
    simulator.child.kill().expect("the simulator dies");
    simulator.child.wait().expect("its end");
    let output = output_within(child, PATIENCE).expect("the player ends");
    assert_eq!(output.status.code(), Some(4));
    let report = report_in(&folder);
    assert_eq!(report["outcome"], "stopped", "{report:#}");
    let reason = report["stop_reason"].as_str().expect("words");
    assert!(reason.contains("lost") || reason.starts_with("the host"), "{report:#}");
    // By the player's own clock: from the last cycle that was recorded to the end of the loop.
    let lasted_s = report["duration_s"].as_f64().expect("a number");
    let ended_s = lasted_s - recorded_s(&recording);
    assert!(ended_s < 1.0, "it went on for {ended_s} s");
}

#[test]
fn h19_a_port_that_comes_back_is_not_used_by_itself() {
    let _alone = alone();
    let folder = crate::program::folder("comes_back");
    let mut simulator = op3(&folder);
    let (child, _) = under_way(&simulator.bus(), &folder, 10_000);
    simulator.child.kill().expect("unplugged");
    simulator.child.wait().expect("its end");
    let _ = std::fs::remove_file(&simulator.link);
    // The same robot is back at once, under the same link and behind another terminal.
    let back = op3(&folder);
    let output = output_within(child, PATIENCE).expect("the player ends");
    assert_eq!(output.status.code(), Some(4));
    let looked = report(&play(&back.bus(), &["--dry-run"]).output().expect("a run"));
    assert_eq!(looked["outcome"], "done", "{looked:#}");
    let notes = looked["notes"].to_string();
    assert!(!notes.contains("torque was already on"), "it was switched on again: {notes}");
    // The next start finds it by the name it was asked for.
    let next =
        undisturbed(|| report(&play(&back.bus(), &["--to", "0.5"]).output().expect("a run")));
    assert_eq!(next["outcome"], "done", "{next:#}");
    assert_careful(&back.end());
}

/// A pseudo-terminal whose other end is held here, and the path of the end to open.
fn terminal() -> (std::os::fd::OwnedFd, String) {
    use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
    // Not for the children of other tests: a terminal somebody else holds never hangs up.
    let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC;
    let master = openpt(flags).expect("a terminal");
    grantpt(&master).expect("access");
    unlockpt(&master).expect("unlocked");
    let path = ptsname(&master, Vec::new()).expect("a name");
    (master, path.into_string().expect("UTF-8"))
}

#[test]
fn h20_a_write_that_nobody_takes_ends_by_its_deadline_and_a_hang_up_is_gone() {
    use gaitway::port::serial::SerialLine;
    use gaitway::port::{BytePort, Clock, MonotonicClock, PortError};
    let (master, path) = terminal();
    let other = std::fs::File::open(&path).expect("the same port");
    let mut line = SerialLine::open(&path, 1_000_000).expect("a port");
    let soon = || MonotonicClock.now() + Duration::from_millis(200);
    assert_eq!(line.send(&[0x55; 64], soon()), Ok(()));
    // Output is halted, as by an adapter that takes nothing any more.
    rustix::termios::tcflow(&other, rustix::termios::Action::OOff).expect("halted");
    let began = Instant::now();
    assert_eq!(line.send(&[0x55; 64], soon()), Err(PortError::TimedOut));
    // Generous, because the machine may be busy; without a deadline it would be for ever.
    assert!(began.elapsed() < Duration::from_secs(5), "{:?}", began.elapsed());
    rustix::termios::tcflow(&other, rustix::termios::Action::OOn).expect("going on");
    assert_eq!(line.send(&[0x55; 64], soon()), Ok(()));
    drop(other);
    drop(master);
    let mut buffer = [0; 16];
    for _ in 0..3 {
        let received = line.receive(&mut buffer, soon());
        assert!(matches!(received, Err(PortError::Gone(_))), "{received:?}");
        let sent = line.send(&[1, 2, 3], soon());
        assert!(matches!(sent, Err(PortError::Gone(_))), "{sent:?}");
    }
}

#[test]
fn h20_opening_what_would_block_returns() {
    let folder = crate::program::folder("fifo");
    let fifo = folder.join("fifo");
    let made = Command::new("mkfifo").arg(&fifo).status();
    assert!(made.is_ok_and(|status| status.success()), "no FIFO");
    let began = Instant::now();
    let path = fifo.to_str().expect("UTF-8");
    assert!(gaitway::port::serial::SerialLine::open(path, 1_000_000).is_err());
    assert!(began.elapsed() < Duration::from_secs(5), "{:?}", began.elapsed());
}

#[test]
fn ports_that_are_none_are_refused_with_what_to_do() {
    let _alone = alone();
    let folder = crate::program::folder("no_port");
    let file = folder.join("file.txt");
    std::fs::write(&file, "not a port").expect("a file");
    for (path, words) in [
        ("/dev/no-such-port".to_owned(), "no such port"),
        (file.display().to_string(), "cannot be opened as a serial line"),
    ] {
        let output = play(&format!("serial:{path}"), &[]).output().expect("a run");
        let report = report(&output);
        let reason = report["stop_reason"].as_str().expect("words");
        assert!(reason.contains(words) && reason.contains(&path), "{reason}");
        assert_eq!(output.status.code(), Some(1));
    }
}

#[test]
fn a_robot_on_its_own_feet_is_not_sent_into_a_fall() {
    let _alone = alone();
    let folder = crate::program::folder("may_fall");
    let simulator = op3(&folder);
    // A table is played as it is.
    let table = folder.join("kick.csv").display().to_string();
    let mut made = crate::program::gaitway();
    made.args(["retarget", "kick-r", "--robot", "op3", "--allow-fall", "--force", "-o", &table]);
    let made = made.output().expect("a run");
    assert!(made.status.success(), "{}", program::words(&made));
    let played = |more: &[&str]| {
        let mut command = crate::program::gaitway();
        let bus = simulator.bus();
        command.args(["play", &table, "--robot", "op3", "--json", "--quiet", "--bus", &bus]);
        command.args(["--rate", "50"]).args(more).output().expect("a run")
    };
    let refused = played(&[]);
    let told = report(&refused);
    assert_eq!((refused.status.code(), &told["outcome"]), (Some(1), &"refused".into()));
    let reason = told["stop_reason"].as_str().expect("words");
    for word in ["would fall", "--hang", "--allow-fall", "--only", "--speed"] {
        assert!(reason.contains(word), "{word} is not in: {reason}");
    }
    assert!(told["metrics"]["predicted_fall_s"].as_f64().expect("s") > 0.0, "{told:#}");
    assert_eq!(told["cycles"], 0);
    // Who only looks is told, who holds it is believed, and who insists too.
    for more in [&["--dry-run"][..], &["--dry-run", "--hang"], &["--dry-run", "--allow-fall"]] {
        let looked = played(more);
        assert_eq!(looked.status.code(), Some(0), "{more:?}: {}", program::words(&looked));
        let warned = program::words(&looked).contains("would fall");
        assert_eq!(warned, more.len() == 1, "{more:?}");
    }
    let said = simulator.end();
    assert!(said.contains("0 goals written"), "{said}");
}

#[test]
fn h21_a_port_without_permission_is_refused_with_what_to_do() {
    let _alone = alone();
    let (_master, path) = terminal();
    let chmod = Command::new("chmod").args(["000", &path]).status().expect("chmod");
    assert!(chmod.success());
    let mut command = play(&format!("serial:{path}"), &["--dry-run"]);
    if rustix::process::getuid().is_root() {
        // Nothing is forbidden to root: somebody else asks, from where anybody may run programs.
        let folder = std::env::temp_dir().join(format!("gaitway-h21-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder");
        let program = folder.join("gaitway");
        std::fs::copy(crate::program::PATH, &program).expect("a copy");
        command = Command::new("setpriv");
        command.args(["--reuid", "65534", "--regid", "65534", "--clear-groups"]).arg(&program);
        command.args(["play", "walk", "--robot", "op3", "--json", "--quiet", "--dry-run"]);
        command.args(["--bus", &format!("serial:{path}")]);
        let output = command.output();
        let _ = std::fs::remove_dir_all(&folder);
        return assert_denied(&output.expect("setpriv, of util-linux"), &path);
    }
    assert_denied(&command.output().expect("a run"), &path);
}

fn assert_denied(output: &Output, path: &str) {
    let report = report(output);
    assert_eq!(report["outcome"], "refused", "{report:#}");
    let reason = report["stop_reason"].as_str().expect("words");
    for word in ["no permission to open the port", path, "udev"] {
        assert!(reason.contains(word), "{word} is not in:\n{reason}");
    }
    assert_eq!(output.status.code(), Some(1));
}

#[test]
fn the_simulator_does_not_take_a_name_that_is_taken() {
    let _alone = alone();
    let folder = crate::program::folder("taken");
    let link = folder.join("op3");
    std::fs::write(&link, "precious").expect("a file");
    let output = crate::program::gaitway()
        .args(["simulate", "op3", "--pty"])
        .arg(&link)
        .output()
        .expect("a run");
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(std::fs::read_to_string(&link).expect("still there"), "precious");
}
