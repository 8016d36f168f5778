//! `record`: sensors, lines of text and hand-guided servos into one recording.

mod imu;
mod lines;
mod servos;
mod slimevr;
mod source;

use super::report::Outcome;
use super::signals::Signals;
use super::{Output, Remarks};
use crate::capture::{Chain, Counts, Mode, Quality};
use crate::error::Error;
use crate::port::{Clock, MonotonicClock};
use crate::recording::{RecordedSource, Recorder, RunEnd, RunStart, SourceId, SourceKind};
use crate::time::{Duration, Instant};
use clap::Args;
use serde::Serialize;
use source::{Source, What};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

/// Arguments of `record`.
#[derive(Debug, Args)]
#[command(after_help = "\
SOURCE is [NAME=]KIND@BUS:
  imu:PROFILE@serial:/dev/ttyUSB0    an inertial sensor; `gaitway profile list` names profiles
  imu:my-sensor.toml@/dev/ttyACM0    the same with a profile of your own
  imu:slimevr@udp:6969               every SlimeVR tracker that looks for a server
  lines@/dev/ttyACM0?baud=115200     lines of text, kept as they are
  servos:ROBOT@serial:/dev/ttyUSB1   joint angles of a robot, read only

Example: gaitway record left=imu:bno08x-rvc@/dev/ttyUSB0 -o wave.mcap --for 10s --name wave")]
pub struct RecordArgs {
    /// What to record
    #[arg(required = true, value_name = "SOURCE")]
    sources: Vec<Source>,
    /// The recording
    #[arg(short, long, value_name = "FILE.mcap")]
    out: PathBuf,
    /// How long, e.g. 10s or 2.5s; without it until Ctrl-C
    #[arg(long = "for", value_name = "TIME", value_parser = source::duration)]
    time: Option<Duration>,
    /// Name of the trial, kept in the recording
    #[arg(long, value_name = "TRIAL", default_value = "")]
    name: String,
    /// Tell headings from the magnetic field where there is one (indoors rather not)
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

/// What became of one source.
#[derive(Clone, Debug, Default, Serialize)]
struct SourceReport {
    name: String,
    counts: Counts,
    /// Samples that lacked a required part.
    incomplete: u64,
    /// Bytes that belonged to no packet.
    stray_bytes: u64,
    /// Beginnings of packets that were none.
    bad_packets: u64,
    /// Drift of the device's clock against the host's, parts per million.
    skew_ppm: f64,
    /// 99 % of the samples were read within this time after they were taken, less the constant part.
    late_p99_s: f64,
    /// Why it ended early.
    ended: Option<String>,
}

impl SourceReport {
    fn of(name: &str, chain: &Chain) -> Self {
        let Quality { skew_ppm, late_p99_s, .. } = chain.timeline().quality();
        Self {
            name: name.to_owned(),
            counts: chain.timeline().counts(),
            incomplete: chain.incomplete(),
            skew_ppm,
            late_p99_s,
            ..Self::default()
        }
    }

    fn lossless(&self) -> bool {
        let counts = self.counts;
        let lost = counts.missed + counts.late + counts.resets + self.incomplete;
        lost == 0 && self.ended.is_none() && counts.samples > 0
    }
}

#[derive(Debug, Serialize)]
struct Report {
    file: PathBuf,
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

/// What every source's thread shares.
struct Session<'a> {
    recorder: &'a Recorder,
    stop: &'a AtomicBool,
    mode: Mode,
    names: Mutex<BTreeMap<String, u32>>,
    reports: Mutex<Vec<SourceReport>>,
    remarks: Remarks,
}

/// How often a silent source looks whether it is to stop.
const LOOK: Duration = Duration::from_millis(50);
/// A source that has said nothing for so long is remarked upon.
const PATIENCE: Duration = Duration::from_secs(3);
/// Bytes of a line that come after its start belong to a packet cut in two; so many are no loss.
const PARTIAL_PACKET: u64 = 600;

impl Session<'_> {
    fn stopped(&self) -> bool {
        self.stop.load(Ordering::Acquire)
    }

    /// Adds a source under a name that no other has.
    fn add(&self, wanted: &str, kind: SourceKind, metadata: &[(&str, &str)]) -> (String, SourceId) {
        let mut names = self.names.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let count = names.entry(wanted.to_owned()).or_insert(0);
        *count += 1;
        let name = match *count {
            1 => wanted.to_owned(),
            n => format!("{wanted}-{n}"),
        };
        let metadata =
            metadata.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect();
        let source = RecordedSource { name: name.clone(), metadata, kind };
        (name, self.recorder.add_source(source))
    }

    fn report(&self, report: SourceReport) {
        self.reports.lock().unwrap_or_else(std::sync::PoisonError::into_inner).push(report);
    }
}

/// Runs `record`; exit code 3 if something is missing in the recording.
///
/// # Errors
/// A source that cannot be opened, a file that cannot be written.
pub fn run(args: &RecordArgs, remarks: Remarks) -> Result<i32, Error> {
    let signals = Signals::listen().map_err(|e| Error::new(format!("no signals: {e}")))?;
    args.output.check_files(&[&Some(args.out.clone())])?;
    let mut opened = Vec::new();
    let mut joints = None;
    for source in &args.sources {
        match &source.what {
            What::Servos { robot, addresses } => {
                let one = servos::Servos::open(robot, addresses, args.rate, args.limp)?;
                if joints.replace(one).is_some() {
                    return Err(Error::new("one robot at a time").at(source.text.clone()));
                }
            }
            _ => opened.push(source.open()?),
        }
    }
    let start = RunStart {
        robot: joints.as_ref().map_or_else(String::new, |s| s.robot_name().to_owned()),
        motion: args.name.clone(),
        joints: joints.as_ref().map(servos::Servos::recorded_joints).unwrap_or_default(),
        wall_clock_start: std::time::SystemTime::now(),
        monotonic_start: MonotonicClock.now(),
        gaitway_version: env!("CARGO_PKG_VERSION").to_owned(),
        metadata: BTreeMap::from([("trial".to_owned(), args.name.clone())]),
    };
    let recorder = Recorder::create_for_sources(&args.out, args.output.force(), start)?;
    let began = MonotonicClock.now();
    let stop = AtomicBool::new(false);
    let session = Session {
        recorder: &recorder,
        stop: &stop,
        mode: if args.magnetometer { Mode::NineAxes } else { Mode::SixAxes },
        names: Mutex::default(),
        reports: Mutex::default(),
        remarks,
    };
    std::thread::scope(|scope| {
        for source in opened {
            let session = &session;
            scope.spawn(move || source.record(session));
        }
        if let Some(joints) = joints {
            let session = &session;
            scope.spawn(move || joints.record(session));
        }
        wait(args, &signals, &recorder, remarks, began);
        stop.store(true, Ordering::Release);
    });
    let sources = session.reports.into_inner().unwrap_or_default();
    finish(args, recorder, sources, began)
}

fn wait(
    args: &RecordArgs,
    signals: &Signals,
    recorder: &Recorder,
    remarks: Remarks,
    began: Instant,
) {
    let until = args.time.map(|time| began + time);
    loop {
        let now = MonotonicClock.now();
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
        file: args.out.clone(),
        outcome: if whole { "done" } else { "done_with_loss" },
        duration_s: ended.seconds_since(began),
        sources,
        messages: summary.messages,
        dropped: summary.dropped.values().sum::<u64>() + summary.lost,
        dropped_by_topic,
        poisoned: summary.poisoned,
    };
    args.output.report(&report, &text(&report))?;
    Ok(outcome.exit_code())
}

fn text(report: &Report) -> String {
    let mut out = format!("recorded {:.2} s to {}\n", report.duration_s, report.file.display());
    for source in &report.sources {
        let counts = source.counts;
        let _ = write!(out, "  {:<16} {} samples", source.name, counts.samples);
        let told = [
            (counts.missed, "missing"),
            (counts.duplicates, "twice"),
            (counts.late, "out of order"),
            (counts.resets, "resets"),
            (source.incomplete, "incomplete"),
            (source.bad_packets, "bad packets"),
        ];
        for (count, word) in told {
            if count > 0 {
                let _ = write!(out, ", {count} {word}");
            }
        }
        if source.skew_ppm != 0.0 {
            let _ = write!(out, ", clock {:+.1} ppm", source.skew_ppm);
        }
        if let Some(ended) = &source.ended {
            let _ = write!(out, "; ended early: {ended}");
        }
        out.push('\n');
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
