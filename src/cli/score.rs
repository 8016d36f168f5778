//! `score`: the program judged on what is known.

use super::{Deed, Output, Remarks};
use crate::error::Error;
use crate::job::recognise::EquationReading;
use crate::job::score::{
    ClassFigures, ClassificationOrder, ClassificationReport, CorruptionFigures, Half,
    classification,
};
use clap::{Args, Subcommand};
use std::fmt::Write;
use std::path::PathBuf;

/// Arguments of `score`.
#[derive(Debug, Args)]
pub struct ScoreArgs {
    #[command(subcommand)]
    command: ScoreCommand,
}

#[derive(Debug, Subcommand)]
enum ScoreCommand {
    /// How well actions are recognised in a folder of labelled clips
    Classification(Box<ClassificationArgs>),
}

/// Arguments of `score classification`.
#[derive(Clone, Debug, Args)]
#[command(after_help = include_str!("help/score.txt"))]
pub struct ClassificationArgs {
    /// Folder of clips
    folder: PathBuf,
    /// The table of labels, or a folder of labels of frames [default: labels.csv in the folder]
    #[arg(long, value_name = "FILE.csv|DIR")]
    labels: Option<PathBuf>,
    /// Folder of models, in place of those that ship with gaitway
    #[arg(long, value_name = "DIR")]
    models: Option<PathBuf>,
    /// Every other clip of each class, the first or the second of two
    #[arg(long, value_name = "first|second", value_parser = half)]
    half: Option<Half>,
    /// Judge corrupted copies as well: noise, another pace, mirrored, 30 frames/s, a heading that drifts, no left hand
    #[arg(long)]
    corruptions: bool,
    /// Read the paper's equations and its state machine as they are printed, for comparison
    #[arg(long)]
    strict: bool,
    #[command(flatten)]
    output: Output,
}

fn half(text: &str) -> Result<Half, String> {
    match text {
        "first" => Ok(Half::First),
        "second" => Ok(Half::Second),
        _ => Err("first or second".to_owned()),
    }
}

/// Runs `score`.
///
/// # Errors
/// A table of labels or models that cannot be read.
pub fn run(args: &ScoreArgs, remarks: Remarks) -> Result<i32, Error> {
    let ScoreCommand::Classification(args) = &args.command;
    args.output.check_files(&[])?;
    let order = ClassificationOrder {
        folder: args.folder.clone(),
        labels: args.labels.clone(),
        models: args.models.clone(),
        equations: if args.strict { EquationReading::Strict } else { EquationReading::Repaired },
        half: args.half,
        corruptions: args.corruptions,
    };
    let report = classification(&order, |index, count, file| {
        if index % 20 == 0 {
            remarks.say(&format!("{index} of {count}: {file}"));
        }
    })?;
    Ok(args.output.conclude(&report, &words(&report), Deed::Look, 0))
}

fn percent(value: Option<f64>) -> String {
    value.map_or_else(|| "-".to_owned(), |value| format!("{:.1}", 100.0 * value))
}

fn line(text: &mut String, of: &ClassFigures) {
    let interval = of.recall_interval.map_or_else(String::new, |[low, high]| {
        format!("  {:.0} to {:.0}", 100.0 * low, 100.0 * high)
    });
    let _ = writeln!(
        text,
        "{:22} {:>7} {:>10} {:>6} {:>11} {:>8}{interval}",
        of.class,
        of.tally.correct,
        of.tally.recognised,
        of.tally.truth,
        percent(of.precision),
        percent(of.recall)
    );
}

fn words(report: &ClassificationReport) -> String {
    let mut text = format!(
        "{:22} {:>7} {:>10} {:>6} {:>11} {:>8}  95 % interval\n",
        "class", "correct", "recognised", "there", "precision %", "recall %"
    );
    for class in &report.per_class {
        line(&mut text, class);
    }
    line(&mut text, &report.global);
    let _ = writeln!(
        text,
        "{:22} {:>37} {:>8}",
        "mean of classes",
        percent(report.mean_precision),
        percent(report.mean_recall)
    );
    text.push_str("\nby style\n");
    for style in &report.per_style {
        line(&mut text, style);
    }
    text.push_str("\nby source\n");
    for source in &report.per_source {
        line(&mut text, source);
    }
    text.push_str("\nwhat was recognised in the clips of each label\n");
    for label in &report.per_label {
        let found: Vec<String> =
            label.recognised.iter().map(|(action, clips)| format!("{action} {clips}")).collect();
        let meaning = label.class.as_deref().unwrap_or("(distractor)");
        let _ = writeln!(
            text,
            "{:22} {:>4} {meaning:14} {}",
            label.label,
            label.clips,
            found.join(", ")
        );
    }
    if !report.per_corruption.is_empty() {
        text.push_str("\ncorrupted copies: what it costs, and how much later an action is known\n");
    }
    for CorruptionFigures { corruption, global, delay_s, .. } in &report.per_corruption {
        let later = delay_s.map_or_else(String::new, |s| format!("  {:+.0} ms", 1e3 * s));
        let mut row = String::new();
        line(&mut row, &ClassFigures { class: (*corruption).to_owned(), ..global.clone() });
        let _ = writeln!(text, "{}{later}", row.trim_end());
    }
    let _ = writeln!(
        text,
        "\nsides     {} of {} recognitions were on the side that the label says",
        report.sides.correct, report.sides.truth
    );
    match &report.segmentation {
        Some(cut) => {
            let _ = writeln!(
                text,
                "cuts      {} compared: mean error {:.1} frames ({:.0} ms), greatest {:.1}",
                cut.cuts, cut.mean_frames, cut.mean_ms, cut.most_frames
            );
        }
        None if report.cut_by_hand > 0 => {
            let _ = writeln!(text, "cuts      none of {} was recognised", report.cut_by_hand);
        }
        None => text.push_str("cuts      no label has times: clips were judged whole\n"),
    }
    for unread in &report.unread {
        let _ = writeln!(text, "unread    {unread}");
    }
    let _ = writeln!(
        text,
        "{} clips, {} frames, {:.0} s",
        report.clips, report.frames, report.duration_s
    );
    text
}
