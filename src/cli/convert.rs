//! `convert`: a recording as a table.

use super::report::Outcome;
use super::{Output, Remarks};
use crate::error::Error;
use crate::recording;
use clap::Args;
use std::path::PathBuf;

/// Arguments of `convert`.
#[derive(Debug, Args)]
#[command(after_help = "Example: gaitway convert wave.mcap wave.csv")]
pub struct ConvertArgs {
    /// Recording, finished or not
    file: PathBuf,
    /// The table: one row per sample of a sensor, or per cycle of a robot
    table: PathBuf,
    /// Overwrite the table if it exists
    #[arg(long)]
    force: bool,
}

/// Runs `convert`; exit code 3 if something is missing in the recording.
///
/// # Errors
/// A recording that cannot be read, a table that exists or cannot be written.
pub fn run(args: &ConvertArgs, remarks: Remarks) -> Result<i32, Error> {
    if !args.table.extension().is_some_and(|extension| extension == "csv") {
        return Err(Error::new("not a table I can write")
            .at(args.table.display().to_string())
            .allowed("a file that ends in .csv"));
    }
    let mut bytes = Vec::new();
    let rows = recording::write_csv(&args.file, &mut bytes)?;
    Output::forced(args.force).write_file(&args.table, &bytes)?;
    remarks.say(&format!("{} rows to {}", rows.rows, args.table.display()));
    let whole = rows.whole && rows.missing == 0;
    if !whole {
        remarks.say(&format!("{} samples or readings are missing in the recording", rows.missing));
    }
    let outcome = if whole { Outcome::Done } else { Outcome::DoneWithLoss };
    Ok(outcome.exit_code())
}
