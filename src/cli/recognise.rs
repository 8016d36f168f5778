//! `recognise`: what a body does, named as it happens.

use super::output::{Untold, print_json};
use super::reading::ReadingArgs;
use super::{Deed, Output, Remarks};
use crate::error::Error;
use crate::job::labels::is_folder_name;
use crate::job::recognise::{EquationReading, RecogniseOrder, RecogniseReport, counts, recognise};
use crate::job::recognise_each::{RecogniseEachReport, recognise_each};
use clap::Args;
use serde::Serialize;
use std::fmt::Write;
use std::path::PathBuf;

/// Arguments of `recognise`.
#[derive(Clone, Debug, Args)]
#[command(after_help = include_str!("help/recognise.txt"))]
pub struct RecogniseArgs {
    /// A capture (.bvh, .amc, .c3d, ...), a recording (.mcap), or actions; of several all events, each with its
    /// source, as if they had begun together
    #[arg(required = true)]
    motion: Vec<String>,
    /// Folder of models, in place of those that ship with gaitway
    #[arg(long, value_name = "DIR")]
    models: Option<PathBuf>,
    /// Write what was recognised as a table: start_s, end_s, class, side, person; of several motions with the column file
    /// in place of person. A name without ending, or with / behind it, is a folder: OUT/TRIAL/ACTION.txt, a line for
    /// each frame, 1.0 or 0.0
    #[arg(long, value_name = "OUT.csv|OUT/")]
    labels: Option<PathBuf>,
    /// Write a page that shows the person with what was recognised on a time line
    #[arg(long, value_name = "FILE.html")]
    html: Option<PathBuf>,
    /// Print what happens as lines of JSON, as it happens: begun, phase, done, broken_off
    #[arg(long, conflicts_with = "json")]
    json_lines: bool,
    /// Read the paper's equations and its state machine as they are printed, for comparison
    #[arg(long)]
    strict: bool,
    /// Everything takes so many times as long as where a person does it: a robot that was slowed
    /// (`retime_factor` in the report of `play`)
    #[arg(long, value_name = "FACTOR", allow_negative_numbers = true)]
    slowed: Option<f64>,
    #[command(flatten)]
    reading: ReadingArgs,
    #[command(flatten)]
    output: Output,
}

/// Runs `recognise`.
///
/// # Errors
/// If the motion or a model cannot be read, or a file cannot be written.
pub fn run(args: &RecogniseArgs, remarks: Remarks) -> Result<i32, Error> {
    let table = args.labels.clone().filter(|path| !is_folder_name(path));
    args.output.check_files(&[&table, &args.html])?;
    let first = args.motion.first().cloned().unwrap_or_default();
    let order = RecogniseOrder {
        motion: first,
        mapping: args.reading.mapping.clone(),
        reading: args.reading.options(),
        models: args.models.clone(),
        equations: if args.strict { EquationReading::Strict } else { EquationReading::Repaired },
        slowed: args.slowed,
        labels: args.labels.clone(),
        html: args.html.clone(),
        replace: args.output.force(),
    };
    let mut untold = None;
    let mut tell = |event: &dyn Fn() -> Result<(), Error>| {
        if args.json_lines && untold.is_none() {
            untold = event().err();
        }
    };
    if args.motion.len() > 1 {
        let report = recognise_each(&order, &args.motion, |event| tell(&|| told(event)))?;
        untold.map_or(Ok(()), Err)?;
        let text = if args.json_lines { String::new() } else { words_of_each(&report, remarks) };
        return Ok(args.output.conclude(&report, &text, Deed::Look, 0));
    }
    let report = recognise(&order, |event| tell(&|| told(event)))?;
    untold.map_or(Ok(()), Err)?;
    let text = if args.json_lines { String::new() } else { words(&report, remarks) };
    Ok(args.output.conclude(&report, &text, Deed::Look, 0))
}

fn told(event: &impl Serialize) -> Result<(), Error> {
    let line = serde_json::to_string(event)
        .map_err(|cause| Error::new("the event cannot be written").got(cause.to_string()))?;
    match print_json(&(line + "\n")) {
        Err(Untold::Failed(cause)) => Err(Untold::Failed(cause).into()),
        // Whoever reads has had enough.
        Ok(()) | Err(Untold::Unwanted) => Ok(()),
    }
}

/// All that was recognised, with its source, then what else is to be said of each.
fn words_of_each(report: &RecogniseEachReport, remarks: Remarks) -> String {
    let mut text = String::new();
    for (source, event) in report.events() {
        let _ = writeln!(text, "{:40} {source}", event.words());
    }
    if !remarks.quiet {
        for one in &report.sources {
            let _ = writeln!(text, "{}", one.motion);
            figures(&mut text, one);
        }
    }
    text
}

fn words(report: &RecogniseReport, remarks: Remarks) -> String {
    let mut text = String::new();
    for event in &report.events {
        let _ = writeln!(text, "{}", event.words());
    }
    if !remarks.quiet {
        figures(&mut text, report);
    }
    text
}

fn figures(text: &mut String, report: &RecogniseReport) {
    let _ = writeln!(
        text,
        "{} events in {} frames at {} Hz, by {} models",
        report.events.len(),
        report.frames,
        report.rate_hz,
        report.models
    );
    for ((action, side), count) in counts(&report.events) {
        let side = side.map_or("", |side| side.word());
        let _ = writeln!(text, "  {count:4} x {action} {side}");
    }
    for blind in &report.blind {
        let _ = writeln!(
            text,
            "blind     {}: the source does not show {}",
            blind.model,
            blind.missing.join(", ")
        );
    }
}
