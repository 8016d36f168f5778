//! `model`: the models by which actions are recognised.

use super::reading::ReadingArgs;
use super::{Deed, Output};
use crate::error::{Error, counted};
use crate::job::draft_model::{DraftModelOrder, ModelExample, draft_model};
use crate::job::explain::{BodySide, ExplainOrder};
use crate::job::explained::{explain, explained};
use crate::job::recognise::{ModelReport, check_models, feature_names};
use crate::job::source::CaptureOptions;
use clap::{Args, Subcommand};
use std::fmt::Write;
use std::path::PathBuf;

/// Arguments of `model`.
#[derive(Debug, Args)]
pub struct ModelArgs {
    #[command(subcommand)]
    command: ModelCommand,
}

#[derive(Debug, Subcommand)]
enum ModelCommand {
    /// Check model files: unknown features, phases that cannot happen, circles in `lead`
    #[command(after_help = "Example: gaitway model check mine/wave-r.toml\n         \
                            gaitway model check mine")]
    Check {
        /// Model files, or folders of them [default: the models that ship with gaitway]
        paths: Vec<PathBuf>,
        #[command(flatten)]
        output: Output,
    },
    /// Draft a model from examples: what all of them share
    New(Box<NewArgs>),
    /// Why models did or did not fire in a motion: what was wanting, by how much, and when
    Explain(Box<ExplainArgs>),
    /// List the features that `measure` and `average` can name
    #[command(after_help = "Example: gaitway model features")]
    Features {
        #[command(flatten)]
        output: Output,
    },
}

/// Arguments of `model new`.
#[derive(Clone, Debug, Args)]
#[command(after_help = include_str!("help/model.txt"))]
pub struct NewArgs {
    /// Name of the model: small letters, digits, hyphens
    name: String,
    /// A capture or action with one example, or a part of it in s: CLIP@FROM..TO (repeatable)
    #[arg(long = "from", value_name = "CLIP", required = true)]
    examples: Vec<String>,
    /// The model file
    #[arg(short, long, value_name = "FILE.toml")]
    output_file: PathBuf,
    /// The action that it shows [default: the name]
    #[arg(long, value_name = "ACTION")]
    action: Option<String>,
    /// The side on which
    #[arg(long, value_name = "left|right", value_parser = side)]
    side: Option<BodySide>,
    #[command(flatten)]
    output: Output,
}

fn side(text: &str) -> Result<BodySide, String> {
    match text {
        "left" => Ok(BodySide::Left),
        "right" => Ok(BodySide::Right),
        _ => Err("left or right".to_owned()),
    }
}

/// Arguments of `model explain`.
#[derive(Clone, Debug, Args)]
#[command(after_help = include_str!("help/model-2.txt"))]
pub struct ExplainArgs {
    /// A capture (.bvh, .amc), or actions
    motion: String,
    /// A model by name, or all models of an action (repeatable) [default: all]
    #[arg(long = "model", value_name = "NAME")]
    only: Vec<String>,
    /// Folder of models, in place of those that ship with gaitway
    #[arg(long, value_name = "DIR")]
    models: Option<PathBuf>,
    /// Look only at what has a frame from here on, s
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    from: Option<f64>,
    /// Look only at what has a frame until here, s
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    to: Option<f64>,
    /// Everything takes so many times as long as where a person does it, as for `recognise`
    #[arg(long, value_name = "FACTOR", allow_negative_numbers = true)]
    slowed: Option<f64>,
    /// Write a page that shows the person, with what fired and what was wanting on a time line
    #[arg(long, value_name = "FILE.html")]
    html: Option<PathBuf>,
    #[command(flatten)]
    reading: ReadingArgs,
    #[command(flatten)]
    output: Output,
}

/// Runs `model`.
///
/// # Errors
/// A file that is no model, with all that is wrong with it and the others.
pub fn run(args: &ModelArgs) -> Result<i32, Error> {
    match &args.command {
        ModelCommand::Check { paths, output } => {
            output.check_files(&[])?;
            let reports = check_models(paths)?;
            let mut text = String::new();
            for ModelReport { name, action, phases, leading, needs } in &reports {
                let _ = writeln!(
                    text,
                    "{name:24} {action:22} {phases}, {leading} leading, {}",
                    counted(needs.len(), "feature"),
                    phases = counted(phases, "phase")
                );
            }
            Ok(output.conclude(&reports, &text, Deed::Look, 0))
        }
        ModelCommand::New(args) => {
            args.output.check_files(&[&Some(args.output_file.clone())])?;
            let report = draft_model(&DraftModelOrder {
                name: args.name.clone(),
                action: args.action.clone(),
                side: args.side,
                examples: args.examples.clone(),
                reading: CaptureOptions::default(),
                file: args.output_file.clone(),
                replace: args.output.force(),
            })?;
            let mut text = format!("{}: {}\n", report.written, report.phases.join(", "));
            for ModelExample { motion, start_s, end_s, fired } in &report.examples {
                let _ = writeln!(
                    text,
                    "  fires {fired} in {motion}, {start_s:.2} to {end_s:.2} s",
                    fired = counted(fired, "time")
                );
            }
            Ok(args.output.conclude(&report, &text, Deed::Work, 0))
        }
        ModelCommand::Explain(args) => {
            args.output.check_files(&[&args.html])?;
            let read = [std::path::Path::new(&args.motion)];
            args.output.check_all_apart(
                &read,
                &args.html.iter().map(PathBuf::as_path).collect::<Vec<_>>(),
            )?;
            let report = explain(&ExplainOrder {
                motion: args.motion.clone(),
                mapping: args.reading.mapping.clone(),
                reading: args.reading.options(),
                models: args.models.clone(),
                only: args.only.clone(),
                from_s: args.from,
                to_s: args.to,
                slowed: args.slowed,
                html: args.html.clone(),
                replace: args.output.force(),
            })?;
            Ok(args.output.conclude(&report, &explained(&report), Deed::Look, 0))
        }
        ModelCommand::Features { output } => {
            output.check_files(&[])?;
            let names = feature_names();
            Ok(output.conclude(&names, &(names.join("\n") + "\n"), Deed::Look, 0))
        }
    }
}
