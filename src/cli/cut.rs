//! `cut`: the named pieces of a capture as trials of their own.

use super::reading::ReadingArgs;
use super::{Deed, Output, Remarks};
use crate::error::{Error, counted};
use crate::job::cut::{CutOrder, CutReport, cut};
use clap::Args;
use std::fmt::Write;
use std::path::PathBuf;

/// Arguments of `cut`.
#[derive(Clone, Debug, Args)]
#[command(after_help = include_str!("help/cut.txt"))]
pub struct CutArgs {
    /// A capture (.bvh, .amc), markers, or actions
    motion: String,
    /// Folder for the pieces
    #[arg(short, long, value_name = "DIR")]
    output_file: PathBuf,
    /// A table of what is where (class, start_s, end_s, and if known side, file), in place of recognising it
    #[arg(long, value_name = "FILE.csv")]
    labels: Option<PathBuf>,
    /// Cut this action alone (repeatable) [default: all]
    #[arg(long, value_name = "ACTION")]
    only: Vec<String>,
    /// So much is left before and after each piece, s
    #[arg(long, value_name = "S", default_value_t = 0.5, allow_negative_numbers = true)]
    margin: f64,
    /// Events of one action that are no further apart are one piece, s
    #[arg(long, value_name = "S", default_value_t = 0.5, allow_negative_numbers = true)]
    join: f64,
    /// Folder of models, in place of those that ship with gaitway
    #[arg(long, value_name = "DIR")]
    models: Option<PathBuf>,
    #[command(flatten)]
    reading: ReadingArgs,
    #[command(flatten)]
    output: Output,
}

/// Runs `cut`.
///
/// # Errors
/// If the motion, a model or the table cannot be read, or a file cannot be written.
pub fn run(args: &CutArgs, remarks: Remarks) -> Result<i32, Error> {
    args.output.check_files(&[])?;
    let report = cut(&CutOrder {
        motion: args.motion.clone(),
        mapping: args.reading.mapping.clone(),
        reading: args.reading.options(),
        models: args.models.clone(),
        labels: args.labels.clone(),
        only: args.only.clone(),
        margin_s: args.margin,
        join_s: args.join,
        folder: args.output_file.clone(),
        replace: args.output.force(),
    })?;
    Ok(args.output.conclude(&report, &words(&report, remarks), Deed::Work, 0))
}

fn words(report: &CutReport, remarks: Remarks) -> String {
    let mut text = String::new();
    for piece in &report.pieces {
        let _ = writeln!(
            text,
            "{:8.2} to {:7.2} s  {:22} {:>10}  {}",
            piece.start_s,
            piece.end_s,
            piece.action,
            counted(piece.events, "event"),
            piece.file
        );
    }
    if remarks.quiet {
        return text;
    }
    match &report.labels {
        None => text.push_str("nothing to cut: nothing was named\n"),
        Some(labels) => {
            let of = if report.as_it_stands { "the file as it stands" } else { "the body model" };
            let _ =
                writeln!(text, "{} of {of}, and {labels}", counted(report.pieces.len(), "piece"));
        }
    }
    text
}
