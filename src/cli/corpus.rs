//! `corpus`, as it is typed.

use super::reading::ReadingArgs;
use super::signals::Signals;
use super::terminal::Terminal;
use super::{Deed, Output, Remarks};
use crate::corpus::manifest::FiveChoices;
use crate::error::Error;
use crate::job::corpus::{
    self, AboutTrial, AddOrder, AskOrder, ExportFormat, ExportOrder, GenerateOrder, NewOrder,
    PlanOrder, RemoveOrder,
};
use crate::job::share::Share;
use clap::{Args, Subcommand};
use std::path::PathBuf;

/// Arguments of `corpus`.
#[derive(Debug, Args)]
#[command(after_help = include_str!("help/corpus.txt"))]
pub struct CorpusArgs {
    #[command(subcommand)]
    command: CorpusCommand,
}

#[derive(Debug, Subcommand)]
enum CorpusCommand {
    /// Make an empty corpus
    New(NewArgs),
    /// Add captures, sessions, actions and variations
    Add(Box<AddArgs>),
    /// Say what is still to be recorded of a set, and by whom
    Plan(PlanArgs),
    /// Fill a set with what the body model does: reaches, kicks, steps, ...
    Generate(GenerateArgs),
    /// Find trials, or frames, that answer a question
    Query(QueryArgs),
    /// Pass trials on: as BVH, C3D or axes and angles, as the files they were, as labels of frames, on a robot's joints
    Export(ExportArgs),
    /// Look through all of it: whole, readable, without doubles
    Check(CheckArgs),
    /// Take a person's trials out, or others
    Remove(RemoveArgs),
}

/// Arguments of `corpus new`.
#[derive(Clone, Debug, Args)]
#[command(
    after_help = "Example: gaitway corpus new moves --motions kicks --people \"children of 7 to 12\""
)]
struct NewArgs {
    /// Folder that is empty or does not exist yet
    corpus: PathBuf,
    /// What it is called [default: the folder's name]
    #[arg(long)]
    name: Option<String>,
    /// What is measured or made. This and the next four are kept in corpus.toml and may be written there later
    #[arg(long, value_name = "TEXT", default_value = "")]
    data_type: String,
    /// Which motions
    #[arg(long, value_name = "TEXT", default_value = "")]
    motions: String,
    /// Which people
    #[arg(long, value_name = "TEXT", default_value = "")]
    people: String,
    /// What an action is, and how it is done
    #[arg(long, value_name = "TEXT", default_value = "")]
    execution: String,
    /// What comes out
    #[arg(long, value_name = "TEXT", default_value = "")]
    results: String,
    #[command(flatten)]
    output: Output,
}

/// Arguments of `corpus add`.
#[derive(Clone, Debug, Args)]
#[command(after_help = include_str!("help/corpus-add.txt"))]
struct AddArgs {
    /// Folder of the corpus
    corpus: PathBuf,
    /// Files, folders, or actions
    #[arg(value_name = "SOURCE", required_unless_present_any = ["trials", "subject_file"])]
    sources: Vec<String>,
    /// Set of all trials that no table says it of [default: captures, sessions or generated]
    #[arg(long)]
    set: Option<String>,
    /// What is done in them
    #[arg(long)]
    action: Option<String>,
    /// Who did it: an id, no name
    #[arg(long, value_name = "ID")]
    subject: Option<String>,
    /// Session in which they were recorded
    #[arg(long)]
    session: Option<String>,
    /// Licence, as SPDX names it: CC-BY-4.0; parts NC and ND are obeyed [default: unknown]
    #[arg(long, value_name = "NAME")]
    licence: Option<String>,
    /// Who made them, where they were published
    #[arg(long, value_name = "TEXT")]
    provenance: Option<String>,
    /// keep or retake
    #[arg(long)]
    verdict: Option<String>,
    /// A parameter of all of them: speed_m_s=2.5 (repeatable)
    #[arg(long, value_name = "NAME=VALUE", allow_hyphen_values = true)]
    parameter: Vec<String>,
    /// Table of trials, a row for each file
    #[arg(long, value_name = "FILE.csv")]
    trials: Option<PathBuf>,
    /// File of a person, as `record --session` keeps it (repeatable)
    #[arg(long, value_name = "FILE.toml")]
    subject_file: Vec<PathBuf>,
    /// What the people who are named allowed: given, internal, withdrawn
    #[arg(long, value_name = "WORD")]
    consent: Option<String>,
    /// What is done when: a table, or a folder of labels of frames
    #[arg(long, value_name = "FILE.csv|DIR")]
    labels: Option<PathBuf>,
    /// Who wrote the labels
    #[arg(long, value_name = "NAME", requires = "labels")]
    annotator: Option<String>,
    /// Label as well what is recognised
    #[arg(long)]
    recognise: bool,
    /// Keep rows, labels and hashes, and no frames
    #[arg(long)]
    without_frames: bool,
    #[command(flatten)]
    reading: ReadingArgs,
    #[command(flatten)]
    output: Output,
}

/// Arguments of `corpus plan`.
#[derive(Clone, Debug, Args)]
#[command(after_help = include_str!("help/corpus-plan.txt"))]
struct PlanArgs {
    /// Folder of the corpus
    corpus: PathBuf,
    /// The set: praxicon, cross-validation, generalisation, composition, co-articulation, interaction
    set: String,
    /// Plan of a session that records what is missing
    #[arg(short, long, value_name = "FILE.toml")]
    output_file: Option<PathBuf>,
    /// Picture of who and what is there
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
    #[command(flatten)]
    output: Output,
}

/// Arguments of `corpus generate`.
#[derive(Clone, Debug, Args)]
#[command(after_help = include_str!("help/corpus-generate.txt"))]
struct GenerateArgs {
    /// Folder of the corpus
    corpus: PathBuf,
    /// The set: generalisation, praxicon, cross-validation, composition, co-articulation or interaction
    set: String,
    /// Only a part of it: the third of a hundred
    #[arg(long, value_name = "K/N")]
    part: Option<String>,
    /// 0: the grid itself; else drawn beside it
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Make again what is there, and compare
    #[arg(long)]
    verify: bool,
    #[command(flatten)]
    output: Output,
}

/// Arguments of `corpus query`.
#[derive(Clone, Debug, Args)]
#[command(after_help = include_str!("help/corpus-query.txt"))]
struct QueryArgs {
    /// Folder of the corpus
    corpus: PathBuf,
    /// The question; all trials if it is empty
    #[arg(default_value = "")]
    question: String,
    /// The answer is frames, not whole trials
    #[arg(long)]
    frames: bool,
    /// List at most so many; all are counted
    #[arg(long, value_name = "N", default_value_t = 20)]
    most: u64,
    /// Write a table of all that answer
    #[arg(short, long, value_name = "FILE.csv")]
    output_file: Option<PathBuf>,
    #[command(flatten)]
    output: Output,
}

/// Arguments of `corpus export`.
#[derive(Clone, Debug, Args)]
#[command(after_help = include_str!("help/corpus-export.txt"))]
struct ExportArgs {
    /// Folder of the corpus
    corpus: PathBuf,
    /// Which trials, as `corpus query` takes it; all if it is empty
    #[arg(default_value = "")]
    question: String,
    /// bvh, c3d, axis-angle, source, labels, robot-csv, robot-npz, unitree-csv, or lerobot
    #[arg(long, value_name = "FORMAT")]
    format: String,
    /// The robot of the formats that are of one, by name or file
    #[arg(long, value_name = "ROBOT")]
    robot: Option<String>,
    /// Recordings of what it played of an export: goals and measured angles for lerobot
    #[arg(long, value_name = "DIR")]
    recordings: Option<PathBuf>,
    /// Folder for it
    #[arg(short, long, value_name = "DIR")]
    output_file: PathBuf,
    #[command(flatten)]
    output: Output,
}

/// Arguments of `corpus check`.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Example: gaitway corpus check moves")]
struct CheckArgs {
    /// Folder of the corpus
    corpus: PathBuf,
    #[command(flatten)]
    output: Output,
}

/// Arguments of `corpus remove`.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Example: gaitway corpus remove moves --subject s01 --dry-run")]
struct RemoveArgs {
    /// Folder of the corpus
    corpus: PathBuf,
    /// All of this person: trials, labels, frames, files, and what is said of them
    #[arg(
        long,
        value_name = "ID",
        required_unless_present = "question",
        conflicts_with = "question"
    )]
    subject: Option<String>,
    /// Trials that answer this question, as `corpus query` takes it
    #[arg(long = "where", value_name = "QUESTION", id = "question")]
    question: Option<String>,
    /// Only say what would go
    #[arg(long)]
    dry_run: bool,
    #[command(flatten)]
    output: Output,
}

/// Runs `corpus`.
///
/// # Errors
/// No corpus, one that cannot be read or changed, something that cannot be understood.
pub fn run(args: &CorpusArgs, remarks: Remarks) -> Result<i32, Error> {
    match &args.command {
        CorpusCommand::New(args) => new(args),
        CorpusCommand::Add(args) => add(args, remarks),
        CorpusCommand::Plan(args) => plan(args),
        CorpusCommand::Generate(args) => generate(args, remarks),
        CorpusCommand::Query(args) => query(args),
        CorpusCommand::Export(args) => export(args, remarks),
        CorpusCommand::Check(args) => check(args, remarks),
        CorpusCommand::Remove(args) => remove(args),
    }
}

fn new(args: &NewArgs) -> Result<i32, Error> {
    args.output.check_files(&[])?;
    let choices = FiveChoices {
        data_type: args.data_type.clone(),
        range_of_motion: args.motions.clone(),
        range_of_subjects: args.people.clone(),
        definition_and_execution: args.execution.clone(),
        output: args.results.clone(),
    };
    let (folder, name) = (args.corpus.clone(), args.name.clone());
    let made = corpus::new(&NewOrder { folder, name, choices })?;
    Ok(args.output.conclude(&made, &made.words(), Deed::Work, 0))
}

fn add(args: &AddArgs, remarks: Remarks) -> Result<i32, Error> {
    args.output.check_files(&[])?;
    let parameters = args.parameter.iter().map(|text| corpus::parameter(text));
    let order = AddOrder {
        corpus: args.corpus.clone(),
        sources: args.sources.clone(),
        about: AboutTrial {
            set: args.set.clone(),
            action: args.action.clone(),
            subject: args.subject.clone(),
            session: args.session.clone(),
            licence: args.licence.clone(),
            provenance: args.provenance.clone(),
            verdict: args.verdict.clone(),
            parameters: parameters.collect::<Result<_, Error>>()?,
            ..AboutTrial::default()
        },
        table: args.trials.clone(),
        subjects: args.subject_file.clone(),
        consent: args.consent.as_deref().map(corpus::consent).transpose()?,
        labels: args.labels.clone(),
        annotator: args.annotator.clone(),
        recognise: args.recognise,
        without_frames: args.without_frames,
        mapping: args.reading.mapping.clone(),
        reading: args.reading.options(),
    };
    let signals = Signals::listened()?;
    let added = corpus::add(&order, &Terminal::new(remarks, &signals))?;
    Ok(args.output.conclude(&added, &added.words(), Deed::Work, added.outcome.exit_code()))
}

fn plan(args: &PlanArgs) -> Result<i32, Error> {
    args.output.check_files(&[&args.output_file, &args.plot])?;
    let (file, plot, replace) = (args.output_file.clone(), args.plot.clone(), args.output.force());
    let (corpus, set) = (args.corpus.clone(), args.set.clone());
    let planned = corpus::plan(&PlanOrder { corpus, set, file, plot, replace })?;
    Ok(args.output.conclude(&planned, &planned.words(), Deed::Look, 0))
}

fn generate(args: &GenerateArgs, remarks: Remarks) -> Result<i32, Error> {
    args.output.check_files(&[])?;
    let order = GenerateOrder {
        corpus: args.corpus.clone(),
        set: args.set.clone(),
        part: args.part.as_deref().map_or(Ok(Share::WHOLE), Share::parse)?,
        seed: args.seed,
        verify: args.verify,
    };
    let signals = Signals::listened()?;
    let made = corpus::generate(&order, &Terminal::new(remarks, &signals))?;
    Ok(args.output.conclude(&made, &made.words(), Deed::Work, made.outcome.exit_code()))
}

fn query(args: &QueryArgs) -> Result<i32, Error> {
    args.output.check_files(&[&args.output_file])?;
    let answer = corpus::ask(&AskOrder {
        corpus: args.corpus.clone(),
        question: args.question.clone(),
        by_frame: args.frames,
        most: args.most,
        file: args.output_file.clone(),
        replace: args.output.force(),
    })?;
    Ok(args.output.conclude(&answer, &answer.words(), Deed::Look, 0))
}

fn export(args: &ExportArgs, remarks: Remarks) -> Result<i32, Error> {
    args.output.check_files(&[])?;
    let order = ExportOrder {
        corpus: args.corpus.clone(),
        question: args.question.clone(),
        format: ExportFormat::of(&args.format)?,
        robot: args.robot.clone(),
        recordings: args.recordings.clone(),
        folder: args.output_file.clone(),
    };
    let signals = Signals::listened()?;
    let done = corpus::export(&order, &Terminal::new(remarks, &signals))?;
    Ok(args.output.conclude(&done, &done.words(), Deed::Work, done.outcome.exit_code()))
}

fn check(args: &CheckArgs, remarks: Remarks) -> Result<i32, Error> {
    args.output.check_files(&[])?;
    let signals = Signals::listened()?;
    let found = corpus::check(&args.corpus, &Terminal::new(remarks, &signals))?;
    Ok(args.output.conclude(&found, &found.words(), Deed::Look, found.outcome.exit_code()))
}

fn remove(args: &RemoveArgs) -> Result<i32, Error> {
    args.output.check_files(&[])?;
    let gone = corpus::remove(&RemoveOrder {
        corpus: args.corpus.clone(),
        subject: args.subject.clone(),
        question: args.question.clone(),
        dry_run: args.dry_run,
    })?;
    Ok(args.output.conclude(&gone, &gone.words(), Deed::Work, 0))
}
