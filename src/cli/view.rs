//! `view`: something in a browser. Of what moves it is the command itself, with `--view`.

use super::signals::Signals;
use super::{Cli, Remarks, Typed, say};
use crate::error::{Error, ErrorKind};
use crate::job::page;
use crate::job::source::CaptureOptions;
use crate::view::live::LiveView;
use clap::Args;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Commands that have something to see while they run.
const COMMANDS: [&str; 3] = ["play", "live", "monitor"];
/// How often it is looked whether somebody wants to end.
const LOOK: Duration = Duration::from_millis(100);

/// Arguments of `view`.
#[derive(Debug, Args)]
#[command(after_help = include_str!("help/view.txt"))]
pub struct ViewArgs {
    /// Serve at this port of this machine [default: a free one]
    #[arg(long, value_name = "PORT", default_value_t = 0, hide_default_value = true)]
    port: u16,
    /// What to look at (see below)
    #[arg(value_name = "WHAT", required = true, num_args = 1.., trailing_var_arg = true,
          allow_hyphen_values = true)]
    what: Vec<String>,
}

/// What is looked at.
pub enum Viewed {
    /// What a command does.
    Command(Box<Typed>),
    /// A file.
    File(PathBuf),
    /// A robot as its file has it, for key frames of it to be made.
    Robot(String),
}

/// Why nothing is.
pub enum NotViewed {
    /// The command was typed wrongly.
    Usage(clap::Error),
    /// Anything else.
    Error(Error),
}

/// What is to be looked at.
///
/// # Errors
/// A command that cannot be read, a file with options.
pub fn seen(args: &ViewArgs, cli: &Cli) -> Result<Viewed, NotViewed> {
    let first = args.what.first().map_or("", String::as_str);
    let is_command = COMMANDS.contains(&first);
    if !is_command && Path::new(first).is_file() && !first.ends_with(".toml") {
        if let Some(option) = args.what.get(1) {
            let error = Error::new("a file is shown as it is").at(first).got(option.clone());
            return Err(NotViewed::Error(
                error.remedy(format!("options go with `gaitway info {first} --html FILE.html`")),
            ));
        }
        return Ok(Viewed::File(PathBuf::from(first)));
    }
    let is_named_as_file = first.contains('/') || Path::new(first).extension().is_some();
    if !is_command && is_named_as_file && !Path::new(first).exists() {
        let error = Error::of(ErrorKind::Absent, "there is no such file").at(first);
        return Err(NotViewed::Error(error.remedy("check the path; a robot goes with --bus")));
    }
    if !is_command && args.what.len() == 1 {
        return Ok(Viewed::Robot(first.to_owned()));
    }
    let profiles = cli.profiles.iter().map(|folder| format!("--profiles={}", folder.display()));
    let typed = ["gaitway".to_owned()]
        .into_iter()
        .chain(cli.quiet.then(|| "--quiet".to_owned()))
        .chain(cli.verbose.then(|| "--verbose".to_owned()))
        .chain(profiles)
        .chain((!is_command).then(|| "monitor".to_owned()))
        .chain(args.what.iter().cloned())
        .chain([format!("--view={}", args.port)]);
    Typed::of(typed).map(|typed| Viewed::Command(Box::new(typed))).map_err(NotViewed::Usage)
}

/// Serves the page of a file until a signal comes.
///
/// # Errors
/// A file that cannot be read or shows nothing, a port that is taken.
pub fn file(path: &Path, args: &ViewArgs, remarks: Remarks) -> Result<i32, Error> {
    until_a_signal(page::file::page(path, &CaptureOptions::default())?, args, remarks)
}

/// Serves a page on which key frames of a robot are made until a signal comes.
///
/// # Errors
/// A robot that is not known, a port that is taken.
pub fn robot(name: &str, args: &ViewArgs, remarks: Remarks) -> Result<i32, Error> {
    until_a_signal(page::live::editor(name)?.html()?, args, remarks)
}

fn until_a_signal(html: String, args: &ViewArgs, remarks: Remarks) -> Result<i32, Error> {
    let signals = Signals::listen().map_err(|e| Error::new(format!("no signals: {e}")))?;
    let view = LiveView::serving(html, args.port)?;
    say(&format!("view      {}", view.url()));
    remarks.say("until Ctrl-C");
    while signals.first().is_none() {
        std::thread::sleep(LOOK);
    }
    Ok(0)
}
