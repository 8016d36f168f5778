//! Terminals: keys of `record` count without Enter, what is recorded and who is followed is shown, and the terminal is as it was
//! before on every way out.

mod program;

use gaitway::recording::sensor_series;
use gaitway_sim::imu::{BodyMotion, ImuDoor, ImuErrors, ImuWire, Mount, VirtualImu};
use rustix::fd::OwnedFd;
use rustix::fs::{Mode, OFlags};
use rustix::process::{Pid, Signal, kill_process};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{LocalModes, tcgetattr};
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// Nothing here takes so long, however busy the machine is.
const PATIENCE: Duration = Duration::from_secs(60);

/// A terminal, and ends of it for a program.
fn terminal() -> (OwnedFd, impl Fn() -> OwnedFd) {
    let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).expect("a terminal");
    grantpt(&master).and_then(|()| unlockpt(&master)).expect("a terminal of ours");
    let path = ptsname(&master, Vec::new()).expect("a name");
    let end = move || {
        let flags = OFlags::RDWR | OFlags::NOCTTY;
        rustix::fs::open(path.as_c_str(), flags, Mode::empty()).expect("its end")
    };
    (master, end)
}

/// Keeps what a terminal is told, until nobody is left who could.
fn keep(from: &OwnedFd, to: &Mutex<String>) {
    let mut bytes = [0_u8; 4096];
    while let Ok(count @ 1..) = rustix::io::read(from, &mut bytes) {
        to.lock().expect("whole").push_str(&String::from_utf8_lossy(&bytes[..count]));
    }
}

/// What a command tells a terminal that has colours, until it ends, and its exit code.
fn seen(mut command: Command, environment: &[(&str, &str)]) -> (Option<i32>, String) {
    let (master, end) = terminal();
    command.env_remove("NO_COLOR").env("TERM", "xterm").envs(environment.iter().copied());
    command.stdin(Stdio::null()).stdout(Stdio::from(end())).stderr(Stdio::from(end()));
    let mut child = command.spawn().expect("the command");
    // Whoever else holds an end keeps the reader from its own.
    drop((command, end));
    let said = Mutex::new(String::new());
    keep(&master, &said);
    (child.wait().expect("it ends").code(), said.into_inner().expect("whole"))
}

/// `record` of one sensor at a terminal.
struct Recording {
    child: Child,
    master: Arc<OwnedFd>,
    slave: OwnedFd,
    said: Arc<Mutex<String>>,
    _door: ImuDoor,
}

impl Recording {
    fn start(folder: &Path, more: &[&str]) -> Self {
        let motion = BodyMotion::still(600.0).expect("a motion");
        let errors = ImuErrors { rate_noise_rad_s: 0.001, ..ImuErrors::default() };
        let imu = VirtualImu::new(motion, Mount::default(), errors, ImuWire::Csv, 100.0);
        let door = ImuDoor::open(imu.expect("a sensor"), 115_200, None).expect("a door");
        let (master, end) = terminal();
        let child = crate::program::gaitway()
            .current_dir(folder)
            .args(["record", "-o", "take.mcap"])
            .arg(format!("torso=imu:arduino-csv@{}", door.path().display()))
            .args(more)
            .stdin(Stdio::from(end()))
            .stdout(Stdio::null())
            .stderr(Stdio::from(end()))
            .spawn()
            .expect("the command");
        let (master, said) = (Arc::new(master), Arc::new(Mutex::new(String::new())));
        let (from, to) = (Arc::clone(&master), Arc::clone(&said));
        std::thread::spawn(move || keep(&from, &to));
        Self { child, master, slave: end(), said, _door: door }
    }

    fn until(&self, words: &str) {
        let began = Instant::now();
        while !self.said.lock().expect("whole").contains(words) {
            assert!(began.elapsed() < PATIENCE, "no {words:?}: {:?}", self.said.lock());
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    fn press(&self, keys: &str) {
        assert_eq!(rustix::io::write(&*self.master, keys.as_bytes()), Ok(keys.len()));
    }

    /// True if the terminal waits for Enter and shows what is typed.
    fn is_as_before(&self) -> bool {
        let modes = tcgetattr(&self.slave).expect("a terminal").local_modes;
        modes.contains(LocalModes::ICANON | LocalModes::ECHO)
    }

    fn until_it_is(&self, as_before: bool) {
        let began = Instant::now();
        while self.is_as_before() != as_before {
            assert!(began.elapsed() < PATIENCE, "the terminal stays: {:?}", self.said.lock());
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// Waits until the system has stopped it.
    fn until_it_stands(&self) {
        let stat = format!("/proc/{}/stat", self.child.id());
        let stands = || std::fs::read_to_string(&stat).is_ok_and(|text| text.contains(") T "));
        let began = Instant::now();
        while !stands() {
            assert!(began.elapsed() < PATIENCE, "it goes on: {:?}", self.said.lock());
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    fn signal(&self, signal: Signal) {
        let id = i32::try_from(self.child.id()).ok().and_then(Pid::from_raw).expect("a process");
        kill_process(id, signal).expect("sent");
    }

    fn ends(mut self) -> (Option<i32>, bool) {
        let code = self.child.wait().expect("its end").code();
        (code, self.is_as_before())
    }
}

impl Drop for Recording {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[test]
fn marks_need_no_enter_notes_do_and_the_terminal_shows_how_the_source_is_heard() {
    let folder = crate::program::folder("keys");
    let recording = Recording::start(&folder, &[]);
    recording.until("recording 1 source");
    recording.until_it_is(false);
    recording.until("/s");
    recording.press(" ");
    recording.until("last mark at");
    recording.press("a door");
    recording.until("note: a door");
    recording.press(" banged\n");
    recording.until("a door banged");
    recording.signal(Signal::INT);
    assert_eq!(recording.ends(), (Some(0), true));
    let series = sensor_series(&folder.join("take.mcap")).expect("recorded");
    let marks: Vec<&str> = series.markers.iter().map(|mark| mark.text.as_str()).collect();
    assert_eq!(marks, ["mark", "a door banged"]);
    assert!(series.sensors["torso"].len() > 20);
}

#[test]
fn the_terminal_is_as_it_was_after_the_end_a_termination_and_while_the_program_is_stopped() {
    let folder = crate::program::folder("restored");
    let whole = Recording::start(&folder, &["--for", "1s"]);
    whole.until_it_is(false);
    assert_eq!(whole.ends(), (Some(0), true));

    let terminated = Recording::start(&folder, &["--force"]);
    terminated.until_it_is(false);
    terminated.signal(Signal::TSTP);
    terminated.until_it_stands();
    assert!(terminated.is_as_before());
    terminated.signal(Signal::CONT);
    terminated.until_it_is(false);
    terminated.signal(Signal::TERM);
    assert!(terminated.ends().1);
}

/// A file that cannot be written ends it before anything is recorded.
#[test]
fn the_terminal_is_as_it_was_when_nothing_can_be_recorded() {
    let folder = crate::program::folder("refused");
    std::fs::write(folder.join("take.mcap"), "somebody's").expect("written");
    let refused = Recording::start(&folder, &[]);
    let (code, is_as_before) = refused.ends();
    assert!(is_as_before && code != Some(0), "{code:?}");
}

#[test]
fn while_a_robot_follows_a_line_tells_how_its_sensors_are_heard() {
    let folder = program::folder("followed");
    let mut worn = program::gaitway();
    worn.current_dir(&folder).args(["simulate", "imus", "--pty", "worn", "--wear"]);
    worn.arg("pelvis,torso,right_upper_arm").stdout(Stdio::null()).stderr(Stdio::piped());
    let mut worn = worn.spawn().expect("the command");
    let mut told = BufReader::new(worn.stderr.take().expect("piped")).lines();
    assert!(told.by_ref().map_while(Result::ok).any(|line| line.contains("then:")));
    std::thread::spawn(move || told.map_while(Result::ok).for_each(drop));
    let mut live = program::gaitway();
    live.current_dir(&folder).args(["live", "--wear", "worn/wear.toml", "--robot", "op3"]);
    live.args(["--bus", "sim:pty", "--n-pose-after", "1s", "--moves", "bow", "--for", "2s"]);
    let (code, said) = seen(live, &[]);
    assert_eq!(code, Some(0), "{said}");
    let line = said.split(['\r', '\n']).rfind(|line| line.contains("/s or more"));
    let line = line.unwrap_or_else(|| panic!("no line of status: {said}"));
    let (time, rest) =
        line.trim_start_matches("\x1b[2K").split_once(" s; 3 sensors, ").expect(line);
    assert!((1.0..60.0).contains(&time.parse::<f64>().expect("a time")), "{line}");
    let (rate, rest) = rest.split_once("/s or more, ").expect(line);
    assert!((50.0..150.0).contains(&rate.parse::<f64>().expect("a rate")), "{line}");
    assert!(rest.starts_with("0 missing"), "{line}");
    assert!(said.contains("\x1b[1m\x1b[32mdone\x1b[0m: worn/wear.toml on op3"), "{said}");
    kill_process(Pid::from_child(&worn), Signal::INT).expect("told");
    worn.wait().expect("it ends");
}

#[test]
fn how_it_ended_is_coloured_at_a_terminal_unless_its_user_does_not_want_that() {
    let play = || {
        let mut play = program::gaitway();
        play.args(["play", "bow", "--robot", "op3", "--bus", "sim"]);
        play
    };
    let (code, said) = seen(play(), &[]);
    assert!(code == Some(0) && said.contains("\x1b[1m\x1b[32mdone\x1b[0m: bow on op3"), "{said}");
    for other in [("NO_COLOR", "1"), ("TERM", "dumb")] {
        let (code, said) = seen(play(), &[other]);
        assert!(code == Some(0) && said.contains("done: bow on op3"), "{other:?}: {said}");
        // What takes back a line of progress is no colour.
        for colour in ["\x1b[1m", "\x1b[2m", "\x1b[3"] {
            assert!(!said.contains(colour), "{other:?}: {said}");
        }
    }
    let mut wrong = program::gaitway();
    wrong.args(["info", "/nowhere.bvh"]);
    let (code, said) = seen(wrong, &[]);
    assert!(code == Some(1) && said.starts_with("\x1b[1m\x1b[31mgaitway:\x1b[0m "), "{said}");
}
