//! Recordings on a real disk: a process killed in the middle, names in the way, a full disk.

mod program;

use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant as Clock};

use gaitway::recording::{CycleRecord, Recorder, read, recover, summary};
use gaitway::time::Instant;

#[path = "recording/scene.rs"]
mod scene;

use scene::{MONOTONIC_START, cycle, end, messages, start};

const CHILD_FILE: &str = "GAITWAY_TEST_RECORDING";

#[test]
#[ignore = "only the child of a_process_killed_at_any_moment_loses_at_most_one_second"]
fn the_child_records_in_real_time_until_it_is_killed() {
    let path = std::env::var_os(CHILD_FILE).expect("started by its parent");
    let recorder = Recorder::create(Path::new(&path), false, start()).unwrap();
    let began = Clock::now();
    let mut out = std::io::stdout().lock();
    for n in 0.. {
        let at = MONOTONIC_START + began.elapsed();
        recorder.take(CycleRecord { at, ..cycle(n) });
        writeln!(out, "\ntaken {}", at.as_nanos()).unwrap();
        out.flush().unwrap();
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Starts the child, kills it after so many cycles, and returns when its last cycle was.
fn last_taken_by_a_child_killed_after(cycles: usize, path: &Path) -> Instant {
    let mut child = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "the_child_records_in_real_time_until_it_is_killed"])
        .args(["--ignored", "--nocapture"])
        .env(CHILD_FILE, path)
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut taken = BufReader::new(child.stdout.take().unwrap())
        .lines()
        .map_while(Result::ok)
        .filter_map(|line| line.strip_prefix("taken ").and_then(|nanos| nanos.parse().ok()));
    let before = taken.nth(cycles - 1).expect("the child records until it is killed");
    child.kill().unwrap(); // SIGKILL
    child.wait().unwrap();
    // The rest of the pipe: cycles taken between our last look and the kill. A line cut in its
    // middle has no more digits than a whole one, so the greatest number is a real time.
    Instant::from_nanos(taken.fold(before, u64::max))
}

#[test]
fn a_process_killed_at_any_moment_loses_at_most_one_second() {
    let folder = crate::program::folder("kill");
    let kill_after = [1, 3, 29, 50, 51, 77, 111, 160, 205, 256, 301, 350];
    std::thread::scope(|scope| {
        for cycles in kill_after {
            let path = folder.join(format!("{cycles}.mcap"));
            scope.spawn(move || {
                let last_taken = last_taken_by_a_child_killed_after(cycles, &path);
                let recording = read(&path).unwrap();
                let last_read = recording.cycles.last().map_or(MONOTONIC_START, |last| last.at);
                let lost = last_taken.since(last_read);
                assert!(lost <= Duration::from_secs(1), "{lost:?} lost after {cycles} cycles");
                assert!(!recording.finished);
                for (n, record) in recording.cycles.iter().enumerate() {
                    assert_eq!(*record, CycleRecord { at: record.at, ..cycle(n as u64) });
                }

                let recovered = recover(&path, false).unwrap();
                let whole = read(&recovered.path).unwrap();
                assert!(whole.finished && !recovered.was_finished);
                assert_eq!(whole.cycles, recording.cycles);
                assert_eq!(whole.start, recording.start);
            });
        }
    });
}

#[test]
fn a_recording_is_never_replaced_unless_forced() {
    let path = crate::program::folder("exists").join("trial.mcap");
    fs::write(&path, "precious").unwrap();
    let error = Recorder::create(&path, false, start()).unwrap_err();
    assert!(error.remedy.unwrap().contains("--force"));
    assert_eq!(fs::read(&path).unwrap(), b"precious");

    let recorder = Recorder::create(&path, true, start()).unwrap();
    recorder.take_patiently(cycle(0));
    assert!(recorder.finish(end(1)).is_complete());
    assert_eq!(read(&path).unwrap().cycles, [cycle(0)]);
}

#[test]
fn a_full_disk_is_said_before_the_run_begins() {
    // Linux answers every write to this device with "no space left".
    let error = Recorder::create(Path::new("/dev/full"), true, start()).unwrap_err();
    assert!(error.got.unwrap().contains("No space left"), "says what the system said");
}

#[test]
fn the_summary_counts_messages_gaps_and_seconds() {
    let path = crate::program::folder("summary").join("trial.mcap");
    let recorder = Recorder::create(&path, false, start()).unwrap();
    (0..101).for_each(|n| recorder.take_patiently(cycle(n)));
    let stored = recorder.finish(end(100));
    assert!(stored.is_complete());
    assert_eq!(stored.messages, (0..101).map(messages).sum::<u64>() + 2);

    let overview = summary(&path).unwrap();
    assert_eq!(overview.duration_s, 1.0);
    assert_eq!(overview.channels["/joints/present"], 101);
    assert_eq!(overview.channels.values().sum::<u64>(), stored.messages);
    assert_eq!(overview.missed_reads, 34, "every third of 101 cycles, the first included");
    assert_eq!(
        (overview.robot.as_deref(), overview.motion.as_deref()),
        (Some("op3"), Some("wave-r"))
    );
    assert_eq!(overview.outcome.as_deref(), Some("done"));
    assert!(overview.finished);
    assert_eq!((overview.dropped_cycles, overview.lost_bytes), (0, 0));
}

#[test]
fn recovering_counts_what_it_keeps_and_never_replaces_a_file() {
    let folder = crate::program::folder("recover");
    let path = folder.join("trial.mcap");
    let recorder = Recorder::create(&path, false, start()).unwrap();
    (0..50).for_each(|n| recorder.take_patiently(cycle(n)));
    assert!(recorder.finish(end(50)).is_complete());
    let bytes = fs::read(&path).unwrap();
    fs::write(&path, &bytes[..bytes.len() - 100]).unwrap();

    let recovered = recover(&path, false).unwrap();
    assert_eq!(recovered.path, folder.join("trial.recovered.mcap"));
    assert_eq!(recovered.messages, (0..50).map(messages).sum::<u64>() + 2);
    assert!(!recovered.was_finished && recovered.lost_bytes > 0);
    let whole = fs::read(&recovered.path).unwrap();
    let checked = mcap::read::Options::ValidateChunkCrcs.into();
    let stream = mcap::MessageStream::new_with_options(&whole, checked).unwrap();
    assert_eq!(stream.map(Result::unwrap).count() as u64, recovered.messages);

    assert!(recover(&path, false).is_err(), "the first rescue stands");
    assert_eq!(fs::read(&recovered.path).unwrap(), whole);
}

#[test]
fn a_rescue_that_fails_leaves_no_file_behind() {
    let folder = crate::program::folder("no_rescue");
    let path = folder.join("walk.bvh");
    fs::write(&path, "HIERARCHY").unwrap();
    let error = recover(&path, false).unwrap_err();
    assert!(error.place.unwrap().ends_with("walk.bvh"));
    assert_eq!(fs::read_dir(&folder).unwrap().count(), 1);
}

#[test]
fn a_folder_is_no_recording() {
    let error = read(&crate::program::folder("folder")).unwrap_err();
    assert_eq!(error.got.as_deref(), Some("a folder, not a regular file"));
    assert!(error.remedy.unwrap().contains("a file that is in it"));
}

#[test]
fn of_a_pipe_and_a_device_it_is_said_what_can_be_done_with_them() {
    let pipe = crate::program::folder("pipe").join("line");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    for (path, got, remedy) in [
        (pipe.as_path(), "a pipe", "cat PIPE > FILE"),
        (Path::new("/dev/null"), "a device", "gaitway record"),
    ] {
        let error = summary(path).unwrap_err();
        assert!(error.got.as_deref().unwrap().starts_with(got), "{error}");
        assert!(error.remedy.as_deref().unwrap().contains(remedy), "{error}");
    }
}
