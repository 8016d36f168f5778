//! `score`: the program judged on what is known.

use super::signals::Signals;
use super::terminal::Terminal;
use super::{Deed, Output, Remarks};
use crate::error::Error;
use crate::job::Observer;
use crate::job::recognise::EquationReading;
use crate::job::score::agreement::agreement;
use crate::job::score::motions::{MotionScore, MotionScoreOrder, generalisation, identification};
use crate::job::score::retargeting::retargeting;
use crate::job::score::splicing::splicing;
use crate::job::score::transitioning::transitioning;
use crate::job::score::{ClassificationOrder, Half, classification};
use clap::{Args, Subcommand};
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
    /// How much of what people do is left on a robot
    Retargeting(RetargetingArgs),
    /// How well a motion to a new target is made of those to others
    Generalisation(MotionArgs),
    /// How well a gap between one motion and the next is filled
    Transitioning(MotionArgs),
    /// How well an action is put on another, as somebody does both at once
    Splicing(MotionArgs),
    /// How well it is told who moves
    Identification(MotionArgs),
    /// How far those who wrote labels agree, frame by frame
    Agreement(MotionArgs),
}

/// Arguments of the scores of motions.
#[derive(Clone, Debug, Args)]
#[command(after_help = include_str!("help/score-motions.txt"))]
struct MotionArgs {
    /// Folder of a corpus
    corpus: PathBuf,
    /// Which trials, as `corpus query` takes it; all if it is empty
    #[arg(default_value = "")]
    question: String,
    /// Of what is drawn
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Judge a fifth of the people, by what the others did
    #[arg(long)]
    by_subject: bool,
    #[command(flatten)]
    output: Output,
}

/// Arguments of `score retargeting`.
#[derive(Clone, Debug, Args)]
struct RetargetingArgs {
    /// The robot, by name or file
    #[arg(long)]
    robot: String,
    #[command(flatten)]
    motion: MotionArgs,
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
    let args = match &args.command {
        ScoreCommand::Classification(args) => args,
        ScoreCommand::Retargeting(RetargetingArgs { robot, motion: args }) => {
            return motion(args, remarks, |order, observer| retargeting(order, robot, observer));
        }
        ScoreCommand::Generalisation(args) => return motion(args, remarks, generalisation),
        ScoreCommand::Transitioning(args) => return motion(args, remarks, transitioning),
        ScoreCommand::Splicing(args) => return motion(args, remarks, splicing),
        ScoreCommand::Identification(args) => return motion(args, remarks, identification),
        ScoreCommand::Agreement(args) => return motion(args, remarks, |of, _| agreement(of)),
    };
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
    Ok(args.output.conclude(&report, &report.words(), Deed::Look, 0))
}

fn motion(
    args: &MotionArgs,
    remarks: Remarks,
    score: impl Fn(&MotionScoreOrder, &dyn Observer) -> Result<MotionScore, Error>,
) -> Result<i32, Error> {
    args.output.check_files(&[])?;
    let (corpus, question) = (args.corpus.clone(), args.question.clone());
    let signals = Signals::listened()?;
    let by_subject = args.by_subject;
    let order = MotionScoreOrder { corpus, question, seed: args.seed, by_subject };
    let found = score(&order, &Terminal::new(remarks, &signals))?;
    Ok(args.output.conclude(&found, &found.words(), Deed::Look, 0))
}
