//! `completions` and `man`: what a shell and a reader of manuals need, made of the words of the
//! command line itself.

use super::output::{self, Untold};
use super::{Cli, Outcome};
use crate::error::{Error, ErrorKind};
use clap::{Args, CommandFactory as _};
use clap_complete::Shell;

/// Arguments of `completions`.
#[derive(Debug, Args)]
#[command(
    after_help = "Example: gaitway completions bash > ~/.local/share/bash-completion/completions/gaitway"
)]
pub struct CompletionsArgs {
    /// The shell
    shell: Shell,
}

/// Arguments of `man`.
#[derive(Debug, Args)]
#[command(
    after_help = "Example: gaitway man simulate > gaitway-simulate.1; man ./gaitway-simulate.1"
)]
pub struct ManArgs {
    /// The page of this command, of two words perhaps [default: that of gaitway itself]
    command: Vec<String>,
}

/// Prints what completes the command line in a shell.
///
/// # Errors
/// It cannot be written.
pub fn completions(args: &CompletionsArgs) -> Result<i32, Error> {
    let mut text = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "gaitway", &mut text);
    tell(&text)
}

/// Prints a page of the manual, as `man` reads it.
///
/// # Errors
/// There is no such command, or the page cannot be written.
pub fn man(args: &ManArgs) -> Result<i32, Error> {
    let mut command = Cli::command();
    command.build();
    let mut name = "gaitway".to_owned();
    for word in &args.command {
        let names: Vec<&str> = command.get_subcommands().map(clap::Command::get_name).collect();
        let found = command.find_subcommand(word).cloned();
        command = found.ok_or_else(|| {
            Error::of(ErrorKind::Unknown, format!("{name} has no such command")).none_of(
                word,
                names,
                "take one of these",
            )
        })?;
        name = format!("{name}-{word}");
    }
    let mut text = Vec::new();
    clap_mangen::Man::new(command)
        .render(&mut text)
        .map_err(|e| Error::of(ErrorKind::Io, "the page cannot be made").got(e.to_string()))?;
    tell(&text)
}

fn tell(text: &[u8]) -> Result<i32, Error> {
    match output::print(&String::from_utf8_lossy(text)) {
        Ok(()) => Ok(Outcome::Done.exit_code()),
        Err(Untold::Unwanted) => Ok(Outcome::Done.exit_code()),
        Err(failed) => Err(failed.into()),
    }
}
