//! `--force` replaces a file once the new one is worth it: a recording with its first cycle or sample,
//! everything else when it is whole. Until then what was there stays, whatever happens.

mod program;

use gaitway::control::arm::arm;
use gaitway::job::recorder::RunRecorder;
use gaitway::recording::{
    CycleRecord, JointRecord, RecordedJoint, RecordedSource, Recorder, RunEnd, RunStart,
    SourceKind, SourceRecord, read,
};
use gaitway::rig::Address;
use gaitway::rig::connect;
use gaitway::robot::Robot;
use gaitway::robot::preflight::{Accept, preflight};
use gaitway::time::Instant;
use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, SystemTime};

const OLD: &[u8] = b"precious";

/// A folder with an old file in it.
fn with_old(name: &str) -> (PathBuf, PathBuf) {
    let folder = crate::program::folder(name);
    let path = folder.join("take.mcap");
    std::fs::write(&path, OLD).expect("an old file");
    (folder, path)
}

fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("one"));
    let mut names: Vec<String> =
        entries.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

fn is_as_it_was(path: &Path) -> bool {
    std::fs::read(path).expect("a file") == OLD
}

fn start(joints: &[&str]) -> RunStart {
    let joint = |name: &&str| RecordedJoint { name: (*name).into(), ..RecordedJoint::default() };
    RunStart {
        robot: String::new(),
        motion: String::new(),
        joints: joints.iter().map(joint).collect(),
        wall_clock_start: SystemTime::UNIX_EPOCH,
        monotonic_start: Instant::from_nanos(1_000),
        gaitway_version: "0".into(),
        metadata: BTreeMap::new(),
    }
}

fn cycle() -> CycleRecord {
    let joints = vec![JointRecord { goal_rad: Some(0.5), ..JointRecord::default() }];
    CycleRecord { cycle: 0, at: Instant::from_nanos(2_000), joints, base: None }
}

fn end() -> RunEnd {
    let at = Instant::from_nanos(3_000);
    RunEnd { outcome: "done".into(), stop_reason: None, at, metadata: BTreeMap::new() }
}

/// Says something as a source of text.
fn say(recorder: &Recorder) {
    let (name, metadata) = ("lines".into(), BTreeMap::new());
    let id = recorder.add_source(RecordedSource { name, metadata, kind: SourceKind::Lines });
    recorder.take_record(id, SourceRecord::Line(Instant::from_nanos(2_000), "text".into()));
}

/// Waits for what another thread or process does; the test's own patience, not a promise.
fn until(what: &str, mut is_so: impl FnMut() -> bool) {
    for _ in 0..12_000 {
        if is_so() {
            return;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    panic!("{what}: not within a minute");
}

#[test]
fn a_recording_takes_the_place_of_another_with_its_first_cycle() {
    let (folder, path) = with_old("cycle");
    let recorder = Recorder::create(&path, true, start(&["a"])).expect("a recording");
    assert!(is_as_it_was(&path));
    assert_eq!(names(&folder), ["take.mcap", "take.mcap.part"]);
    // What sensors say before the robot moves is worth no other recording.
    say(&recorder);
    recorder.take_patiently(cycle());
    until("the name", || names(&folder) == ["take.mcap"]);
    assert!(!is_as_it_was(&path));
    let stored = recorder.finish(end());
    assert!(stored.is_complete() && !stored.kept_old);
    assert_eq!(read(&path).expect("a recording").cycles, [cycle()]);
}

#[test]
fn a_recording_of_sensors_takes_the_place_of_another_with_its_first_sample() {
    let (folder, path) = with_old("sample");
    let recorder = Recorder::create_for_sources(&path, true, start(&[])).expect("a recording");
    assert!(is_as_it_was(&path));
    say(&recorder);
    until("the name", || names(&folder) == ["take.mcap"]);
    assert!(!is_as_it_was(&path));
    assert!(!recorder.finish(end()).kept_old);
}

#[test]
fn a_recording_that_nothing_came_of_leaves_what_was_there_and_no_litter() {
    type Last = fn(Recorder) -> Option<bool>;
    let ways: [(&str, Last); 4] = [
        ("dropped", |recorder| {
            drop(recorder);
            None
        }),
        ("discarded", |recorder| {
            say(&recorder);
            recorder.discard();
            drop(recorder);
            None
        }),
        ("finished", |recorder| Some(recorder.finish(end()).kept_old)),
        // It ended before the robot was moved, but what was recorded was wanted.
        ("finished with samples", |recorder| {
            say(&recorder);
            Some(recorder.finish(end()).kept_old)
        }),
    ];
    for (way, last) in ways {
        let (folder, path) = with_old("nothing");
        let recorder = Recorder::create_for_sources(&path, true, start(&["a"])).expect(way);
        let kept_old = last(recorder);
        assert_eq!(names(&folder), ["take.mcap"], "{way}");
        let expected = way != "finished with samples";
        assert_eq!(is_as_it_was(&path), expected, "{way}");
        assert!(kept_old.is_none_or(|kept| kept == expected), "{way}");
    }
}

#[test]
fn a_start_that_is_refused_while_arming_leaves_the_recording_that_was_there() {
    let (folder, path) = with_old("arming");
    let robot = Robot::load("op3").expect("a robot");
    let bus: [Address; 1] = ["sim".parse().expect("an address")];
    let mut connection = connect(robot, &bus, 0).expect("a virtual robot");
    let period = Duration::from_millis(10);
    let accept = Accept { firmware: false, eeprom: false };
    let found = preflight(&mut connection.link, period, accept).expect("a healthy robot");
    let recorder = RunRecorder::begin(Some(&path), true, false, &connection, "bow");
    let recorder = recorder.expect("a recording");
    connection.world.as_ref().expect("a virtual one").lock().unplug("head_tilt").expect("a joint");
    assert!(arm(&mut connection.link, &found, &|| false).is_err(), "a servo is gone");
    recorder.discard();
    assert_eq!(names(&folder), ["take.mcap"]);
    assert!(is_as_it_was(&path));
}

/// A line that says what it is told, and its address.
fn line() -> (std::fs::File, String) {
    use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
    let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC;
    let host = openpt(flags).expect("a terminal");
    grantpt(&host).and_then(|()| unlockpt(&host)).expect("its other end");
    let path = ptsname(&host, Vec::new()).expect("a name").into_string().expect("UTF-8");
    (host.into(), format!("lines@{path}"))
}

fn record(source: &str, path: &Path) -> Child {
    crate::program::gaitway()
        .args(["record", source, "--json", "--force", "-o"])
        .arg(path)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the command")
}

/// Ends it as Ctrl-C does.
fn interrupted(child: Child) -> (Option<i32>, serde_json::Value, String) {
    let pid = child.id().to_string();
    let sent = Command::new("kill").args(["-s", "INT", &pid]).status();
    assert!(sent.is_ok_and(|status| status.success()), "no signal sent");
    let output = child.wait_with_output().expect("its end");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    let report = serde_json::from_slice(&output.stdout);
    (output.status.code(), report.unwrap_or_else(|e| panic!("no report ({e}): {said}")), said)
}

#[test]
fn a_killed_recording_that_had_not_begun_leaves_what_was_there_and_the_next_one_replaces_it() {
    let (folder, path) = with_old("killed");
    let (mut speaker, source) = line();
    let mut child = record(&source, &path);
    until("a start", || names(&folder).len() == 2);
    // Who else would write there is refused by name.
    let second = record(&source.replace("lines@", "other=lines@"), &path);
    let second = second.wait_with_output().expect("a refusal");
    assert_eq!(second.status.code(), Some(1));
    let said = String::from_utf8_lossy(&second.stderr);
    assert!(said.contains("take.mcap") || said.contains("in use"), "{said}");
    child.kill().expect("killed");
    child.wait().expect("its end");
    assert!(is_as_it_was(&path));
    assert_eq!(names(&folder), ["take.mcap", "take.mcap.part"]);

    let child = record(&source, &path);
    until("the next", || {
        speaker.write_all(b"text\n").expect("said");
        names(&folder) == ["take.mcap"]
    });
    let (_, report, _) = interrupted(child);
    assert_eq!(report["file"], path.display().to_string());
    assert!(!is_as_it_was(&path));
}

#[test]
fn a_recording_in_which_nothing_was_said_is_told_and_replaces_nothing() {
    let (folder, path) = with_old("silent");
    let (_speaker, source) = line();
    let child = record(&source, &path);
    until("a start", || names(&folder).len() == 2);
    let (code, report, said) = interrupted(child);
    assert_eq!(code, Some(3), "{report:#}{said}");
    assert_eq!(report["file"], serde_json::Value::Null);
    assert!(is_as_it_was(&path));
    assert_eq!(names(&folder), ["take.mcap"]);
}

/// Runs the command where no file may become larger than 512 bytes.
fn limited(arguments: &[&str]) -> Output {
    let mut command = Command::new("sh");
    let script = "ulimit -f 1; exec \"$0\" \"$@\"";
    command.args(["-c", script, crate::program::PATH]).args(arguments);
    command.stdin(Stdio::null()).output().expect("the command")
}

#[test]
fn a_file_that_cannot_be_written_whole_is_not_replaced() {
    let (folder, take) = with_old("whole");
    let broken = folder.join("broken.mcap");
    {
        let recorder = Recorder::create(&broken, false, start(&["a"])).expect("a recording");
        recorder.take_patiently(cycle());
    }
    std::fs::write(folder.join("broken.recovered.mcap"), OLD).expect("an old file");
    for name in ["made.csv", "made.bvh", "made.mcap"] {
        std::fs::write(folder.join(name), OLD).expect("an old file");
    }
    let path = |name: &str| folder.join(name).display().to_string();
    let before = names(&folder);
    let (csv, bvh, mcap, broken) =
        (path("made.csv"), path("made.bvh"), path("made.mcap"), path("broken.mcap"));
    for (file, arguments) in [
        (&csv, vec!["synth", "bow", "-o", &csv]),
        (&bvh, vec!["retarget", "bow", "--robot", "op3", "-o", &bvh]),
        (&mcap, vec!["retarget", "bow", "--robot", "op3", "-o", &mcap]),
        (&path("broken.recovered.mcap"), vec!["recover", &broken]),
    ] {
        let output = limited(&[arguments, vec!["--force", "--quiet"]].concat());
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{file}: {said}");
        assert!(said.contains("File too large"), "{file}: {said}");
        assert!(is_as_it_was(Path::new(file)), "{file}");
        assert_eq!(names(&folder), before, "{file}");
    }
    // A report is lost; the one before it is not.
    let take = take.display().to_string();
    let output = limited(&["profile", "list", "--json", "--force", "--report", &take]);
    assert_eq!(output.status.code(), Some(1));
    assert!(is_as_it_was(Path::new(&take)));
    assert_eq!(names(&folder), before);
}
