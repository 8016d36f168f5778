//! `list`, as it is typed.

use super::{Deed, Output};
use crate::error::Error;
use crate::job::names::KnownNames;
use clap::Args;

/// Arguments of `list`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  gaitway list\n  gaitway list actions")]
pub struct ListArgs {
    /// Only these, each with what it stands for: actions, models, robots, servos, actuators, sensors, adapters,
    /// boards, marker-sets, corpus-sets, export-formats
    kind: Option<String>,
    #[command(flatten)]
    output: Output,
}

/// Runs `list`.
///
/// # Errors
/// No such kind.
pub fn run(args: &ListArgs) -> Result<i32, Error> {
    args.output.check_files(&[])?;
    let names = KnownNames::of(args.kind.as_deref())?;
    Ok(args.output.conclude(&names, &names.words(), Deed::Look, 0))
}
