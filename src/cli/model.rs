//! `model`: the models by which actions are recognised.

use super::{Deed, Output};
use crate::error::Error;
use crate::job::recognise::{ModelReport, check_models, feature_names};
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
    /// List the features that `measure` and `average` can name
    #[command(after_help = "Example: gaitway model features")]
    Features {
        #[command(flatten)]
        output: Output,
    },
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
                    "{name:24} {action:22} {phases} phases, {leading} leading, {} features",
                    needs.len()
                );
            }
            Ok(output.conclude(&reports, &text, Deed::Look, 0))
        }
        ModelCommand::Features { output } => {
            output.check_files(&[])?;
            let names = feature_names();
            Ok(output.conclude(&names, &(names.join("\n") + "\n"), Deed::Look, 0))
        }
    }
}
