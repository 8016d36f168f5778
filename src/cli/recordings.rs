//! `info` and `recover`: what a file holds, and what of a broken recording can be saved.

use super::report::Outcome;
use super::{Deed, Output, Remarks};
use crate::error::{Error, either};
use crate::job::info::{FileOverview, info as file_info};
use crate::job::info_folders::no_page;
use crate::job::info_words::words;
use crate::job::page::file::{page as file_page, page_of_two};
use crate::job::report::counted;
use crate::job::sensors::overview as sensors_overview;
use crate::job::source::CaptureOptions;
use crate::job::source_words;
use crate::recording::{self, Compression, Overview, Recovered, SensorSeries, sensor_series};
use crate::session::tap::{Tap, taps};
use clap::Args;
use serde::Serialize;
use std::fmt::Write;
use std::path::PathBuf;

/// Arguments of `info`.
#[derive(Debug, Args)]
#[command(after_help = include_str!("help/recordings.txt"))]
pub struct InfoArgs {
    /// Recording, finished or not; a capture (.bvh, .amc); a table of OpenSim's (.mot, .sto) or of joint angles (.csv);
    /// markers (.c3d, .trc, .csm, .csv); labels (.csv, or a folder); sensors of Xsens' (.txt, or a folder); any
    /// other table (.csv); the folder of a corpus, a session, a LeRobot dataset or BONES-SEED
    file: PathBuf,
    /// Skeleton of an AMC file [default: the .asf file beside it that it is named after]
    #[arg(long, value_name = "FILE.asf")]
    skeleton: Option<PathBuf>,
    /// Frames per second of an AMC file [default: what it says, or 120], or of markers that do not say it
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    rate: Option<f64>,
    /// What the columns of a table of sensors are (TOML, see docs/capture.md)
    #[arg(long, value_name = "FILE.toml", conflicts_with_all = ["skeleton", "rate", "html"])]
    sensors: Option<PathBuf>,
    /// Write a page that shows what is in it: the person, the markers, the robot with its joints
    #[arg(long, value_name = "FILE.html")]
    html: Option<PathBuf>,
    /// Draw another capture, or recording of worn sensors, in the same room on the page: two people
    #[arg(long, value_name = "FILE", requires = "html")]
    beside: Option<PathBuf>,
    #[command(flatten)]
    output: Output,
}

/// Runs `info`.
///
/// # Errors
/// A file that cannot be read, or is of no kind that this program knows.
pub fn info(args: &InfoArgs) -> Result<i32, Error> {
    args.output.check_files(&[&args.html])?;
    let mut inputs = vec![args.file.as_path()];
    inputs.extend(
        args.sensors.iter().chain(&args.skeleton).chain(&args.beside).map(PathBuf::as_path),
    );
    args.output.check_all_apart(&inputs, args.html.as_deref().as_slice())?;
    let options = CaptureOptions {
        skeleton: args.skeleton.clone(),
        rate_hz: args.rate,
        ..CaptureOptions::default()
    };
    let overview = match &args.sensors {
        Some(declared) => {
            let of_table = sensors_overview(&args.file, Some(declared))?;
            Some(FileOverview::Sensors(of_table))
        }
        None => file_info(&args.file, &options)?,
    };
    if let Some(page) = &args.html {
        no_page(&args.file)?;
        let html = match &args.beside {
            Some(other) => page_of_two(&args.file, other, &options)?,
            None => file_page(&args.file, &options)?,
        };
        args.output.write_file(page, html.as_bytes())?;
    }
    if let Some(overview) = overview {
        return Ok(args.output.conclude(&overview, &words(&overview), Deed::Look, 0));
    }
    if options != CaptureOptions::default() {
        return Err(Error::new("a skeleton and a rate are for captures and markers")
            .at(args.file.display().to_string()));
    }
    let overview = recording::summary(&args.file)?;
    let mut text = description(&overview);
    let mut told = Told { overview, markers: Vec::new(), taps: Vec::new() };
    // A recording too large to be looked into is told of all the same.
    if worth_a_look(&told.overview)
        && let Ok(series) = sensor_series(&args.file)
    {
        told.add(&series, &mut text);
    }
    Ok(args.output.conclude(&told, &text, Deed::Look, 0))
}

/// What `info` tells.
#[derive(Serialize)]
struct Told {
    #[serde(flatten)]
    overview: Overview,
    /// What was marked while it was recorded.
    markers: Vec<Marked>,
    /// Taps that several sensors felt: whether their times agree.
    taps: Vec<Tap>,
}

#[derive(Serialize)]
struct Marked {
    at_s: f64,
    text: String,
}

/// True if there may be marks, or several sensors that may have felt a tap.
fn worth_a_look(overview: &Overview) -> bool {
    overview.sources.len() > 1 || overview.channels.contains_key("/marker")
}

impl Told {
    fn add(&mut self, series: &SensorSeries, text: &mut String) {
        let began = series.start.as_ref().map(|start| start.monotonic_start).unwrap_or_default();
        for marker in &series.markers {
            let at_s = marker.at.seconds_since(began);
            let _ = writeln!(text, "marker    at {at_s:.3} s: {}", marker.text);
            self.markers.push(Marked { at_s, text: marker.text.clone() });
        }
        self.taps = taps(&series.sensors, series.start_ns());
        for tap in &self.taps {
            let _ = writeln!(text, "tap       {}", tap.words());
        }
    }
}

fn description(overview: &Overview) -> String {
    let mut text = String::new();
    let words = [
        ("robot  ", &overview.robot),
        ("motion ", &overview.motion),
        ("outcome", &overview.outcome),
    ];
    for (title, word) in words {
        // A recording of sensors has no robot, and says so by an empty name.
        let word = word.as_deref().filter(|word| !word.is_empty()).unwrap_or("not said");
        let _ = writeln!(text, "{title}   {word}");
    }
    let _ = writeln!(text, "duration  {:.2} s", overview.duration_s);
    for (channel, messages) in &overview.channels {
        let _ = writeln!(
            text,
            "channel   {channel}: {messages}",
            messages = counted(*messages, "message")
        );
    }
    for (name, source) in &overview.sources {
        let _ = writeln!(text, "source    {}", source_words::kept(name, source));
    }
    let _ = writeln!(
        text,
        "gaps      {} missed, {} dropped",
        counted(overview.missed_reads, "reading"),
        counted(overview.dropped_cycles, "cycle")
    );
    if overview.missed_samples + overview.dropped_samples > 0 {
        let _ = writeln!(
            text,
            "samples   {} missing, {} dropped",
            overview.missed_samples, overview.dropped_samples
        );
    }
    if overview.damaged_cycles + overview.damaged_samples > 0 {
        let _ = writeln!(
            text,
            "damage    {} and {} cannot be read",
            counted(overview.damaged_cycles, "cycle"),
            counted(overview.damaged_samples, "sample")
        );
    }
    let _ = match (overview.finished, overview.lost_bytes) {
        (true, 0) => writeln!(text, "file      complete"),
        (true, lost) => writeln!(
            text,
            "file      closed, but {lost} {are} damaged",
            lost = counted(lost, "byte"),
            are = either(lost, "is", "are")
        ),
        (false, _) => writeln!(
            text,
            "file      never closed (killed?): `gaitway recover` makes one other tools open"
        ),
    };
    text
}

/// Arguments of `recover`.
#[derive(Debug, Args)]
#[command(after_help = include_str!("help/recordings-2.txt"))]
pub struct RecoverArgs {
    /// Recording that was never closed, or is damaged
    file: PathBuf,
    /// The new file, on another disk perhaps [default: FILE.recovered.mcap beside it]
    #[arg(short, long, value_name = "OUT.mcap")]
    out: Option<PathBuf>,
    /// How the new file is packed: lz4, zstd or none
    #[arg(long, value_name = "HOW", default_value_t)]
    compression: Compression,
    #[command(flatten)]
    output: Output,
}

/// Runs `recover`; exit code 3 if something was lost.
///
/// # Errors
/// A file in which no recording is found; a recovered file that exists already.
pub fn recover(args: &RecoverArgs, remarks: Remarks) -> Result<i32, Error> {
    let (out, force) = (args.out.as_deref(), args.output.force());
    args.output.check_files(&[&args.out])?;
    args.output.check_apart(&args.file, out.as_slice())?;
    let recovered = recording::recover_packed(&args.file, out, force, args.compression)?;
    let whole = recovered.was_finished && recovered.lost_bytes == 0;
    let outcome = if whole { Outcome::Done } else { Outcome::DoneWithLoss };
    let text = format!("{}\n", recovered.path.display());
    let code = args.output.conclude(&recovered, &text, Deed::Work, outcome.exit_code());
    remarks.say(&loss(&recovered));
    Ok(code)
}

/// What was saved and what was not, as far as the file can tell.
fn loss(recovered: &Recovered) -> String {
    let mut text = format!(
        "{} saved, {} could not be used",
        counted(recovered.messages, "message"),
        counted(recovered.lost_bytes, "byte")
    );
    if recovered.damaged > 0 {
        let _ = write!(
            text,
            ", with {} or {} in them",
            counted(recovered.damaged, "sample"),
            either(recovered.damaged, "cycle", "cycles")
        );
    }
    if !recovered.was_finished {
        text += "; the recording was cut off, and what came in its last second may be missing";
    }
    text
}
