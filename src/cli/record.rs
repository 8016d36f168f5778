//! `record`: sensors, lines of text and hand-guided servos into one recording.

mod marks;
mod session;

use super::cues;
use super::duration::duration;
use super::report::Outcome;
use super::signals::Signals;
use super::{Deed, Output, Remarks};
use crate::capture::Mode;
use crate::error::Error;
use crate::job::taught::Servos;
use crate::port::{Clock, MonotonicClock};
use crate::recording::{Recorder, RunEnd, RunStart};
use crate::sensing::{Intake, LOOK, SensingEvent, Source, SourceReport, What};
use crate::time::{Duration, Instant};
use clap::Args;
use marks::Marks;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

/// Arguments of `record`.
#[derive(Debug, Args)]
#[command(after_help = "\
SOURCE is [NAME=]KIND@BUS:
  imu:PROFILE@serial:/dev/ttyUSB0    an inertial sensor; `gaitway profile list` names profiles
  imu:my-sensor.toml@/dev/ttyACM0    the same with a profile of your own
  imu:slimevr@udp:0.0.0.0:6969       every SlimeVR tracker that looks for a server (without an
                                     address: of this machine alone)
  lines@/dev/ttyACM0?baud=115200     lines of text, kept as they are
  servos:ROBOT@serial:/dev/ttyUSB1   joint angles of a robot, read only

While it records, Enter sets a mark; text and Enter set a mark with a note.

--session leads through a whole session: metadata, calibration of sensors and subjects, trials. Each
sensor is then named like the segment that wears it. The same command resumes an interrupted session.

Examples:
  gaitway record left=imu:bno08x-rvc@/dev/ttyUSB0 -o wave.mcap --for 10s --name wave
  gaitway record --session lab --plan plan.toml torso=imu:x-imu3@/dev/ttyACM0 \\
          right_forearm=imu:x-imu3@/dev/ttyACM1")]
pub struct RecordArgs {
    /// What to record
    #[arg(required_unless_present = "session", value_name = "SOURCE")]
    sources: Vec<Source>,
    /// The recording
    #[arg(short, long, value_name = "FILE.mcap", required_unless_present = "session")]
    out: Option<PathBuf>,
    /// Lead through a recording session in this folder, or resume one
    #[arg(long, value_name = "DIR", conflicts_with_all = ["out", "time", "name", "limp", "force"])]
    session: Option<PathBuf>,
    /// Which segment wears which SlimeVR tracker, in a session: left_thigh=tracker-00aa01-0
    #[arg(long, value_name = "SEGMENT=TRACKER", conflicts_with = "out")]
    wear: Vec<String>,
    /// What the session should record (see docs/capture.md); without it, you are asked
    #[arg(long, value_name = "FILE.toml", conflicts_with = "out")]
    plan: Option<PathBuf>,
    /// How long, e.g. 10s or 2.5s; without it until Ctrl-C
    #[arg(long = "for", value_name = "TIME", value_parser = duration)]
    time: Option<Duration>,
    /// Name of the trial, kept in the recording
    #[arg(long, value_name = "TRIAL", default_value = "", hide_default_value = true)]
    name: String,
    /// Take headings from the magnetic field (not recommended indoors)
    #[arg(long)]
    magnetometer: bool,
    /// Readings of servos per second
    #[arg(long, default_value_t = 50.0, value_name = "HZ")]
    rate: f64,
    /// Switch the servos' torque off first, to guide the robot by hand: it falls unless supported
    #[arg(long)]
    limp: bool,
    #[command(flatten)]
    output: Output,
}

#[derive(Debug, Serialize)]
struct Report {
    /// None if nothing came, and what was to be replaced is as it was.
    file: Option<PathBuf>,
    outcome: &'static str,
    duration_s: f64,
    sources: Vec<SourceReport>,
    messages: u64,
    /// Messages that are not stored: refused by the full queue, or lost by a disk that failed.
    dropped: u64,
    /// Those refused by the full queue, by topic.
    dropped_by_topic: BTreeMap<String, u64>,
    /// Why writing ended early, if it did.
    poisoned: Option<String>,
}

/// Fails if two sources were given one name: nobody could tell afterwards which was which.
fn check_names(sources: &[Source]) -> Result<(), Error> {
    for (at, source) in sources.iter().enumerate() {
        let is_same = |other: &&Source| source.name.is_some() && other.name == source.name;
        if let Some(other) = sources[..at].iter().find(is_same) {
            return Err(Error::new("two sources have one name")
                .at(source.text.clone())
                .got(other.text.clone())
                .remedy("give each its own name before the ="));
        }
    }
    Ok(())
}

/// Runs `record`; exit code 3 if something is missing in the recording.
///
/// # Errors
/// A source that cannot be opened, a file that cannot be written.
pub fn run(args: &RecordArgs, remarks: Remarks) -> Result<i32, Error> {
    let signals = Signals::listen().map_err(|e| Error::new(format!("no signals: {e}")))?;
    if let Some(root) = &args.session {
        return session::run(args, root, signals, remarks);
    }
    let out = args.out.as_deref().ok_or_else(|| Error::new("no file to record to"))?;
    args.output.check_files(&[&args.out])?;
    check_names(&args.sources)?;
    let mut opened = Vec::new();
    let mut joints = None;
    for source in &args.sources {
        match &source.what {
            What::Servos { robot, addresses } => {
                let one = Servos::open(robot, addresses, args.rate, args.limp)?;
                if joints.replace(one).is_some() {
                    return Err(Error::new("one robot at a time").at(source.text.clone()));
                }
            }
            _ => opened.push(source.open(&[])?),
        }
    }
    let start = RunStart {
        robot: joints.as_ref().map_or_else(String::new, |s| s.robot_name().to_owned()),
        motion: args.name.clone(),
        joints: joints.as_ref().map(Servos::recorded_joints).unwrap_or_default(),
        wall_clock_start: std::time::SystemTime::now(),
        monotonic_start: MonotonicClock.now(),
        gaitway_version: env!("CARGO_PKG_VERSION").to_owned(),
        metadata: BTreeMap::from([("trial".to_owned(), args.name.clone())]),
    };
    let recorder = Recorder::create_for_sources(out, args.output.force(), start)?;
    let began = MonotonicClock.now();
    let stop = AtomicBool::new(false);
    let tell = |event: SensingEvent<'_>| remarks.say(&cues::of_event(event));
    let mode = if args.magnetometer { Mode::NineAxes } else { Mode::SixAxes };
    let intake = Intake::new(Some(&recorder), &stop, mode, &tell);
    std::thread::scope(|scope| {
        for source in opened {
            let intake = &intake;
            scope.spawn(move || source.record(intake));
        }
        if let Some(joints) = joints {
            let intake = &intake;
            scope.spawn(move || joints.record(intake));
        }
        wait(args, &signals, &recorder, remarks, began);
        stop.store(true, Ordering::Release);
    });
    let sources = intake.into_reports();
    finish(args, out, recorder, sources, began)
}

fn wait(
    args: &RecordArgs,
    signals: &Signals,
    recorder: &Recorder,
    remarks: Remarks,
    began: Instant,
) {
    let until = args.time.map(|time| began + time);
    let mut marks = Marks::listen();
    loop {
        let now = MonotonicClock.now();
        marks.record(recorder);
        if let Some(cause) = recorder.failure() {
            // Nothing more can be stored, so whoever performs is told at once and not at the end.
            return remarks.say(&format!("the recording ends here, the disk fails: {cause}"));
        }
        if signals.first().is_some() || until.is_some_and(|until| now >= until) {
            return;
        }
        let next = now + LOOK;
        MonotonicClock.sleep_until(until.map_or(next, |until| until.min(next)));
    }
}

fn finish(
    args: &RecordArgs,
    out: &Path,
    recorder: Recorder,
    sources: Vec<SourceReport>,
    began: Instant,
) -> Result<i32, Error> {
    let ended = MonotonicClock.now();
    let dropped_by_topic = recorder.dropped();
    let lossless = sources.iter().all(SourceReport::lossless) && !sources.is_empty();
    let lossless = lossless && dropped_by_topic.is_empty();
    let outcome = if lossless { Outcome::Done } else { Outcome::DoneWithLoss };
    let metadata = sources.iter().filter_map(|source| {
        Some((format!("source {}", source.name), serde_json::to_string(source).ok()?))
    });
    let summary = recorder.finish(RunEnd {
        outcome: if lossless { "done" } else { "done_with_loss" }.to_owned(),
        stop_reason: None,
        at: ended,
        metadata: metadata.collect(),
    });
    let outcome = if summary.is_complete() { outcome } else { Outcome::DoneWithLoss };
    let whole = matches!(outcome, Outcome::Done);
    let report = Report {
        file: (!summary.kept_old).then(|| out.to_owned()),
        outcome: if whole { "done" } else { "done_with_loss" },
        duration_s: ended.seconds_since(began),
        sources,
        messages: summary.messages,
        dropped: summary.dropped.values().sum::<u64>() + summary.lost,
        dropped_by_topic,
        poisoned: summary.poisoned,
    };
    Ok(args.output.conclude(&report, &text(&report, out), Deed::Work, outcome.exit_code()))
}

fn text(report: &Report, file: &Path) -> String {
    let mut out = match report.file {
        Some(_) => format!("recorded {:.2} s to {}\n", report.duration_s, file.display()),
        None => format!("nothing was recorded; {} is as it was\n", file.display()),
    };
    for source in &report.sources {
        cues::of_source(source, &mut out);
    }
    let refused: u64 = report.dropped_by_topic.values().sum();
    if refused > 0 {
        let _ = writeln!(out, "  the disk could not keep up: {refused} messages lost");
    }
    if let Some(poisoned) = &report.poisoned {
        let lost = report.dropped - refused;
        let _ = writeln!(out, "  the recording ended early: {poisoned}; {lost} messages lost");
    }
    out
}
