//! `recognise`: what a body does, named as it happens.

use super::operator::Operator;
use super::output::{Untold, is_unread, print, print_json};
use super::reading::ReadingArgs;
use super::signals::{Signals, heard, is_from_outside};
use super::wearing::WearingArgs;
use super::{Deed, Output, Remarks};
use crate::error::Error;
use crate::job::labels::is_folder_name;
use crate::job::recognise::{EquationReading, RecogniseOrder, RecogniseReport, recognise};
use crate::job::recognise_each::{RecogniseEachReport, recognise_each};
use crate::job::recognise_live::{RecogniseLiveOrder, is_source, recognise_live};
use crate::job::report::Outcome;
use crate::job::{Event, Observer};
use crate::time::{Duration, listening_time};
use clap::Args;
use serde::Serialize;
use std::fmt::Write;
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

/// Arguments of `recognise`.
#[derive(Clone, Debug, Args)]
#[command(after_help = include_str!("help/recognise.txt"))]
pub struct RecogniseArgs {
    /// A capture (.bvh, .amc, .c3d, ...), a recording (.mcap), or actions; of several all events, each with its
    /// source, as if they had begun together. Or a source that is heard live: sensors that somebody wears
    /// ([SEGMENT=]imu:PROFILE@BUS, several), or a robot by its servos (servos:ROBOT@BUS)
    #[arg(required_unless_present = "wear", value_name = "MOTION|SOURCE")]
    motion: Vec<String>,
    /// Listen to a source for this time [default: until Ctrl-C]
    #[arg(long = "for", value_name = "TIME", value_parser = listening_time, allow_negative_numbers = true)]
    time: Option<Duration>,
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
    wearing: WearingArgs,
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
    let is_live = !args.wearing.wear.is_empty() || args.motion.iter().any(|of| is_source(of));
    if is_live {
        return listen(args, order, remarks);
    }
    if args.time.is_some() {
        return Err(Error::new("a motion that is read has its own end")
            .at("--for")
            .remedy("leave it out, or name a source that is heard live"));
    }
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

/// Names what is done while a source is heard.
fn listen(args: &RecogniseArgs, what: RecogniseOrder, remarks: Remarks) -> Result<i32, Error> {
    let signals = Signals::listen().map_err(|e| Error::new(format!("no signals: {e}")))?;
    let order = RecogniseLiveOrder {
        what: RecogniseOrder { motion: args.motion.join(" "), ..what },
        sources: args.motion.clone(),
        wear: args.wearing.wear.clone(),
        plan: args.wearing.plan(),
        body_calibration: args.wearing.calibration_body.clone(),
        recalibrate: args.wearing.recalibrate,
        mode: args.wearing.mode(),
        time: args.time,
    };
    let operator = Operator::listen(signals, remarks);
    let listener = Listener { operator: &operator, args, untold: Mutex::default() };
    let mut report = recognise_live(&order, &listener, &operator)?;
    let ended = heard().filter(|&number| is_from_outside(number) && report.is_ended_by(number));
    let mut text = String::new();
    if !args.json_lines && !remarks.quiet {
        text.push_str(&report.figures());
    }
    let outcome = if report.stop_reason.is_some() { Outcome::Stopped } else { Outcome::Done };
    let code = ended.map_or(outcome.exit_code(), |number| 128 + number);
    let code = args.output.conclude(&report, &text, Deed::Look, code);
    listener.untold.into_inner().unwrap_or_else(PoisonError::into_inner).map_or(Ok(code), Err)
}

/// Prints what is recognised as it happens: lines of JSON, or what is done in words.
struct Listener<'a> {
    operator: &'a Operator,
    args: &'a RecogniseArgs,
    untold: Mutex<Option<Error>>,
}

impl Observer for Listener<'_> {
    fn hear(&self, event: Event<'_>) {
        let Event::Recognised(event) = event else {
            let shown = matches!(event, Event::Note(_) | Event::Sensing(_));
            return if shown {
                self.operator.hear(event)
            };
        };
        let printed = match (self.args.json_lines, event.words_of_done()) {
            (true, _) => told(event),
            (false, Some(words)) if !self.args.output.is_json() => {
                unless_unwanted(print(&(words + "\n")))
            }
            _ => Ok(()),
        };
        if let Err(error) = printed {
            self.untold.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
        }
    }

    /// Also once what is recognised cannot be told, or nobody reads it any more.
    fn wants_to_stop(&self) -> bool {
        let untold = self.untold.lock().unwrap_or_else(PoisonError::into_inner);
        untold.is_some() || is_unread() || Observer::wants_to_stop(self.operator)
    }
}

fn told(event: &impl Serialize) -> Result<(), Error> {
    let line = serde_json::to_string(event)
        .map_err(|cause| Error::new("the event cannot be written").got(cause.to_string()))?;
    unless_unwanted(print_json(&(line + "\n")))
}

fn unless_unwanted(printed: Result<(), Untold>) -> Result<(), Error> {
    match printed {
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
            text.push_str(&one.figures());
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
        text.push_str(&report.figures());
    }
    text
}
