//! What becomes of a command that cannot tell what it did: its standard output or error full, closed,
//! or read by nobody, or its files not allowed to grow. It never ends by a panic or a signal, what it
//! did is done, and the exit code says that the result was lost.

mod program;

use gaitway::recording::{RecordedSource, Recorder, RunEnd, RunStart, SourceKind, SourceRecord};
use gaitway::time::Instant;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
use std::os::unix::process::ExitStatusExt;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, SystemTime};

/// A recording of one line of text, under this name.
fn recording(path: &Path, source: &str) {
    let began = Instant::from_nanos(1_000_000_000);
    let start = RunStart {
        robot: String::new(),
        motion: "told".into(),
        joints: Vec::new(),
        wall_clock_start: SystemTime::UNIX_EPOCH,
        monotonic_start: began,
        gaitway_version: "0".into(),
        metadata: BTreeMap::new(),
    };
    let recorder = Recorder::create_for_sources(path, false, start).expect("a recording");
    let id = recorder.add_source(RecordedSource {
        name: source.into(),
        metadata: BTreeMap::new(),
        kind: SourceKind::Lines,
    });
    let at = began + Duration::from_millis(10);
    recorder.take_record(id, SourceRecord::Line(at, "a line".into()));
    let end = RunEnd { outcome: "done".into(), stop_reason: None, at, metadata: BTreeMap::new() };
    assert!(recorder.finish(end).is_complete());
}

/// What a command has done by the time it tells it.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Deed {
    Look,
    Work,
    Motion,
}

/// What is wrong with the streams of a process.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Streams {
    Whole,
    OutFull,
    OutClosed,
    OutUnread,
    ErrFull,
    ErrClosed,
    ErrUnread,
    BothFull,
    BothUnread,
}

const STREAMS: [Streams; 9] = [
    Streams::Whole,
    Streams::OutFull,
    Streams::OutClosed,
    Streams::OutUnread,
    Streams::ErrFull,
    Streams::ErrClosed,
    Streams::ErrUnread,
    Streams::BothFull,
    Streams::BothUnread,
];

/// Every write to it fails: no space is left.
fn full() -> Stdio {
    File::options().write(true).open("/dev/full").expect("Linux").into()
}

/// A pipe whose reader has gone.
fn unread() -> Stdio {
    let (reader, writer) = std::io::pipe().expect("a pipe");
    drop(reader);
    writer.into()
}

impl Streams {
    /// Runs the command with these streams.
    fn run(self, arguments: &[String]) -> Output {
        let binary = crate::program::PATH;
        let closed = match self {
            Self::OutClosed => ">&-",
            Self::ErrClosed => "2>&-",
            _ => "",
        };
        let mut command = Command::new("sh");
        command.args(["-c", &format!("exec \"$0\" \"$@\" {closed}"), binary]).args(arguments);
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        match self {
            Self::OutFull => drop(command.stdout(full())),
            Self::OutUnread => drop(command.stdout(unread())),
            Self::ErrFull => drop(command.stderr(full())),
            Self::ErrUnread => drop(command.stderr(unread())),
            Self::BothFull => drop(command.stdout(full()).stderr(full())),
            Self::BothUnread => drop(command.stdout(unread()).stderr(unread())),
            Self::Whole | Self::OutClosed | Self::ErrClosed => {}
        }
        command.output().expect("the command")
    }

    /// How a command that ends with `usual` must end.
    fn expected(self, deed: Deed, usual: i32) -> i32 {
        let is_lost = match self {
            Self::OutFull | Self::BothFull => true,
            // Who has closed it wants to know nothing; who reads no further may have what he wants,
            // but not of a robot that moves.
            Self::OutUnread | Self::BothUnread => deed == Deed::Motion,
            _ => false,
        };
        match (is_lost, usual, deed) {
            (true, 0, Deed::Look) => 1,
            (true, 0, Deed::Work | Deed::Motion) => 3,
            _ => usual,
        }
    }
}

#[test]
fn the_exit_code_says_what_was_done_and_whether_it_could_be_told() {
    let folder = crate::program::folder("table");
    let recorded = folder.join("lines.mcap");
    recording(&recorded, "lines");
    let (recorded, made) = (recorded.display().to_string(), folder.join("made"));
    let markers = folder.join("markers.csv");
    let table = "frame,time_s,C7_x_m,C7_y_m,C7_z_m\n1,0,1,2,3\n2,0.01,1,2,3\n";
    std::fs::write(&markers, table).expect("a file");
    let markers = markers.display().to_string();
    let made = made.display().to_string();
    let corpus = format!("{made}-corpus");
    let new = gaitway_corpus(&["new", &corpus]).success()
        && gaitway_corpus(&["add", &corpus, "bow"]).success();
    assert!(new, "a corpus with a trial");
    let made = |ending: &str| format!("{made}.{ending}");
    let table: [(Deed, i32, Vec<String>); 23] = [
        (Deed::Look, 0, words("--help")),
        (Deed::Look, 2, words("play --no-such-option")),
        (Deed::Look, 0, words("completions bash")),
        (Deed::Look, 0, words("man simulate")),
        (Deed::Look, 0, words("profile list")),
        (Deed::Look, 0, words("profile show op3 --json")),
        (Deed::Look, 0, vec!["info".into(), recorded]),
        (Deed::Look, 1, words("info /no/such/file.mcap")),
        (Deed::Work, 0, [words("clean --force"), vec![markers, "-o".into(), made("trc")]].concat()),
        (Deed::Work, 0, [words("cut bow --force -o"), vec![made("pieces")]].concat()),
        (Deed::Work, 0, [words("corpus add"), vec![corpus.clone(), "bow".into()]].concat()),
        (Deed::Look, 0, [words("corpus query"), vec![corpus]].concat()),
        (Deed::Look, 0, words("model explain bow --model wave-r --json")),
        (Deed::Look, 0, words("scan sim --robot op3")),
        (Deed::Look, 0, words("servo get sim 19 --robot op3")),
        (Deed::Look, 0, words("monitor op3 --bus sim")),
        (Deed::Look, 0, words("play wave-r --robot op3 --bus sim --dry-run")),
        (Deed::Look, 4, words("calibrate so101 --bus sim --dry-run")),
        (Deed::Work, 0, [words("synth bow --force -o"), vec![made("csv")]].concat()),
        (Deed::Motion, 0, words("play bow --robot op3 --bus sim")),
        (Deed::Motion, 1, words("play no-such-motion --robot op3 --bus sim")),
        (Deed::Motion, 0, words("hold op3 --bus sim")),
        (Deed::Motion, 0, words("servo move sim 19 5 --robot op3 --json")),
    ];
    for (deed, usual, arguments) in table {
        for streams in STREAMS {
            let output = streams.run(&arguments);
            let place = format!("{streams:?}: gaitway {}", arguments.join(" "));
            assert_eq!(output.status.signal(), None, "{place}");
            assert_eq!(output.status.code(), Some(streams.expected(deed, usual)), "{place}");
            if streams == Streams::OutFull && usual == 0 {
                let said = String::from_utf8_lossy(&output.stderr);
                assert!(said.contains("No space left"), "{place} says:\n{said}");
            }
        }
    }
}

fn gaitway_corpus(arguments: &[&str]) -> std::process::ExitStatus {
    let mut command = crate::program::gaitway();
    command.arg("corpus").args(arguments).stdout(Stdio::null()).stderr(Stdio::null());
    command.status().expect("the program")
}

fn words(text: &str) -> Vec<String> {
    text.split_whitespace().map(str::to_owned).collect()
}

#[test]
fn a_report_file_that_cannot_be_written_counts_like_a_result_that_cannot_be_told() {
    for (arguments, code) in [
        ("profile list", 1),
        ("play bow --robot op3 --bus sim --dry-run", 1),
        ("play bow --robot op3 --bus sim", 3),
        // It was stopped before; that counts for more.
        ("calibrate so101 --bus sim --dry-run", 4),
    ] {
        let arguments = words(&format!("{arguments} --report /dev/full --force"));
        let output = Streams::Whole.run(&arguments);
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{arguments:?}:\n{said}");
        assert!(said.contains("/dev/full") && said.contains("No space left"), "{said}");
        assert!(!output.stdout.is_empty(), "{arguments:?}: the result is told all the same");
    }
}

/// Runs the command where no file may become larger than so many blocks of 512 bytes.
fn limited(blocks: u32, arguments: &str, out: &str) -> Output {
    let script = format!("ulimit -f {blocks}; exec \"$0\" {arguments} {out}");
    let mut command = Command::new("sh");
    command.args(["-c", &script, crate::program::PATH]);
    command.stdin(Stdio::null()).output().expect("the command")
}

#[test]
fn a_recording_that_may_not_grow_any_more_is_a_loss_and_ends_no_motion() {
    let folder = crate::program::folder("limit");
    for bus in ["sim", "sim:pty"] {
        let file = folder.join(format!("{}.mcap", bus.len()));
        let arguments = format!(
            "play bow --robot op3 --rate 50 --json --bus {bus} --record {}",
            file.display()
        );
        let output = limited(128, &arguments, "");
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.signal(), None, "{bus}: {said}");
        let report: serde_json::Value = serde_json::from_slice(&output.stdout)
            .unwrap_or_else(|e| panic!("{bus}: no report ({e}): {said}"));
        assert!(report["cycles"].as_u64().is_some_and(|cycles| cycles > 0), "{report:#}");
        assert!(report["recording_lost"].as_u64().is_some_and(|lost| lost > 0), "{report:#}");
        let notes = report["notes"].to_string();
        assert!(
            notes.contains("the recording lacks") && notes.contains("File too large"),
            "{notes}"
        );
        // In real time a busy machine may stop the motion; the limit may not.
        if bus == "sim" || report["outcome"] != "stopped" {
            assert_eq!(report["outcome"], "done_with_loss", "{report:#}");
            assert_eq!(output.status.code(), Some(3));
        }
        let kept = gaitway::recording::read(&file).expect("what was stored is readable");
        assert!(!kept.finished);
        // In virtual time all of it comes at once, and is lost at once.
        assert!(bus == "sim" || !kept.cycles.is_empty());
    }
}

#[test]
fn a_result_that_goes_into_a_file_that_may_not_grow_is_said_to_be_lost() {
    let file = crate::program::folder("limit-out").join("list.txt");
    let output = limited(1, "profile list", &format!("> {}", file.display()));
    assert_eq!(output.status.signal(), None);
    assert_eq!(output.status.code(), Some(1));
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.contains("could not be written") && said.contains("File too large"), "{said}");
}

#[test]
fn an_endless_table_ends_when_nobody_reads_it_any_more() {
    let mut child = crate::program::gaitway()
        .args(words("monitor op3 --bus sim:pty --rate 20"))
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .expect("the command");
    let mut out = child.stdout.take().expect("its output");
    let mut begun = [0; 64];
    out.read_exact(&mut begun).expect("a table");
    drop(out);
    assert_eq!(child.wait().expect("it ends").code(), Some(0));
}

#[test]
fn a_terminal_that_goes_away_under_a_progress_bar_ends_nothing() {
    use rustix::fs::{Mode, OFlags};
    use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
    // Not for the child: a terminal that it holds itself never goes away.
    let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC;
    let terminal = openpt(flags).expect("a terminal");
    grantpt(&terminal).and_then(|()| unlockpt(&terminal)).expect("its other end");
    let name = ptsname(&terminal, Vec::new()).expect("its name");
    let flags = OFlags::RDWR | OFlags::NOCTTY;
    let other = rustix::fs::open(name, flags, Mode::empty()).expect("its other end");
    let mut child = crate::program::gaitway()
        .args(words("play bow --robot op3 --bus sim:pty --rate 50 --json"))
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::from(other))
        .spawn()
        .expect("the command");
    // It draws while it plays; then the terminal is closed under it.
    let mut drawn = [0; 64];
    let mut seen = Vec::new();
    while !String::from_utf8_lossy(&seen).contains(" s") {
        let count = rustix::io::read(&terminal, &mut drawn).expect("a bar");
        seen.extend_from_slice(&drawn[..count]);
    }
    drop(terminal);
    let mut out = String::new();
    child.stdout.take().expect("its output").read_to_string(&mut out).expect("a report");
    let status = child.wait().expect("it ends");
    let report: serde_json::Value = serde_json::from_str(&out).expect("a report");
    assert_eq!(status.signal(), None);
    // A busy machine may stop it; the terminal may not.
    let usual = if report["outcome"] == "done" { 0 } else { 4 };
    assert_eq!(status.code(), Some(usual), "{report:#}");
    assert!(report["cycles"].as_u64().is_some_and(|cycles| cycles > 1), "{report:#}");
}

/// What a terminal would obey: a title to be set, the bell, and the same in one byte of Latin 1.
const COMMANDS: &str = "evil\u{1b}]0;gotcha\u{7}\u{9b}2J\u{202e}";
const SHOWN: &str = "evil\\u{1b}]0;gotcha\\u{7}\\u{9b}2J\\u{202e}";

fn assert_harmless(output: &Output, place: &str) -> String {
    let all = [&output.stdout[..], &output.stderr[..]].concat();
    let text = String::from_utf8(all).expect("UTF-8");
    let hidden = |c: char| c != '\n' && (c.is_control() || c == '\u{202e}');
    assert!(!text.contains(hidden), "{place}: {text:?}");
    text
}

#[test]
fn no_text_from_a_file_is_a_command_to_the_terminal() {
    let folder = crate::program::folder("commands");
    let run = |arguments: &[&str]| {
        let arguments: Vec<String> = arguments.iter().map(|&word| word.to_owned()).collect();
        Streams::Whole.run(&arguments)
    };
    // A topic of a recording, as text and as JSON.
    let recorded = folder.join("a.mcap");
    recording(&recorded, COMMANDS);
    let recorded = recorded.display().to_string();
    let said = assert_harmless(&run(&["info", &recorded]), "info");
    assert!(said.contains(&format!("/lines/{SHOWN}")), "{said}");
    let output = run(&["info", &recorded, "--json"]);
    assert_harmless(&output, "info --json");
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(report["sources"][COMMANDS]["records"], 1, "{report:#}");

    // The name of a file, in an error of ours and in one of the arguments.
    let said = assert_harmless(&run(&["info", COMMANDS]), "a file's name");
    assert!(said.contains(SHOWN), "{said}");
    let said = assert_harmless(&run(&["info", &recorded, COMMANDS]), "an argument");
    assert!(said.contains("evil"), "{said}");

    // A joint of a capture, and a robot's name.
    let capture = folder.join("a.bvh");
    std::fs::write(
        &capture,
        format!(
            "HIERARCHY\nROOT Hips\n{{\nOFFSET 0 0 0\nCHANNELS 3 Xrotation Yrotation Zrotation\n\
             JOINT {COMMANDS}\n{{\nOFFSET 0 0 0\nCHANNELS 1 Wrong\n}}\n}}\n"
        ),
    )
    .expect("a capture");
    let robot = folder.join("a.toml");
    let named: String = COMMANDS.chars().map(|c| format!("\\u{:04X}", u32::from(c))).collect();
    let op3 = gaitway_profiles::whole_table("op3").expect("a shipped robot");
    let op3 = toml::to_string(&op3).expect("TOML");
    let renamed = op3.replace("name = \"op3\"", &format!("name = \"{named}\""));
    assert_ne!(renamed, op3);
    std::fs::write(&robot, renamed).expect("a robot");
    let (capture, robot) = (capture.display().to_string(), robot.display().to_string());
    for arguments in [
        &["play", &capture, "--robot", "op3", "--bus", "sim"][..],
        &["profile", "check", &robot],
        &["play", "walk", "--robot", &robot, "--bus", "sim"],
    ] {
        let output = run(arguments);
        assert_eq!(output.status.code(), Some(1), "{arguments:?}");
        let said = assert_harmless(&output, &arguments.join(" "));
        assert!(said.contains("evil"), "{arguments:?} says:\n{said}");
    }
}
