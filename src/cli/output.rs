//! Results on stdout, remarks on stderr, files that are never overwritten unasked. Nothing else in
//! the program writes to either stream: here no failure to write ends a motion, no text from outside
//! reaches a terminal as a command, and what could not be told shows in the exit code.

use super::signals::heard;
use crate::corpus::store::check_outside;
use crate::draft;
use crate::error::{Error, ErrorKind};
use crate::job::report::{CameToNothing, Outcome};
use clap::FromArgMatches;
use clap::builder::styling::{AnsiColor, Style};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::termios::isatty;
use std::borrow::Cow;
use std::io::{self, Write};
use std::os::fd::AsFd;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Why a text did not reach standard output.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Untold {
    /// Whoever read it has had enough (`| head`).
    Unwanted,
    /// It could not be written: a full disk, a terminal that is gone.
    Failed(String),
}

impl From<Untold> for Error {
    fn from(untold: Untold) -> Self {
        let got = match untold {
            Untold::Unwanted => "nobody reads it any more".to_owned(),
            Untold::Failed(cause) => cause,
        };
        Self::new("the result could not be written").at("standard output").got(got)
    }
}

/// What a command has done by the time it tells its result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Deed {
    /// It looked: its result is all there is of it.
    Look,
    /// It wrote a file, or a register.
    Work,
    /// A robot was moved, held or let go.
    Motion,
}

/// Prints a result.
///
/// # Errors
/// Nobody reads it, or it cannot be written.
pub fn print(text: &str) -> Result<(), Untold> {
    put(&painted(visible(text), std::io::stdout()))
}

/// Prints a table over the last `lines` lines of standard output, a terminal.
///
/// # Errors
/// As [`print()`].
pub fn print_over(lines: usize, text: &str) -> Result<(), Untold> {
    put(&(up(lines) + &visible(text)))
}

/// Prints lines of JSON.
///
/// # Errors
/// As [`print()`].
pub fn print_json(text: &str) -> Result<(), Untold> {
    put(&visible_json(text))
}

/// True once whoever read standard output is gone (`| head`), also if nothing is told to it meanwhile.
#[must_use]
pub fn is_unread() -> bool {
    let stdout = std::io::stdout();
    let mut reader = [PollFd::new(&stdout, PollFlags::empty())];
    poll(&mut reader, Some(&Timespec::default())).is_ok_and(|_| {
        let said = reader[0].revents();
        said.contains(PollFlags::ERR)
    })
}

fn put(text: &str) -> Result<(), Untold> {
    to(&mut std::io::stdout().lock(), text)
}

fn to(out: &mut impl Write, text: &str) -> Result<(), Untold> {
    out.write_all(text.as_bytes()).and_then(|()| out.flush()).map_err(|cause| match cause.kind() {
        io::ErrorKind::BrokenPipe => Untold::Unwanted,
        _ => Untold::Failed(cause.to_string()),
    })
}

/// Says a line to the person at the terminal. If nobody can be told, nothing depends on it.
pub fn say(text: &str) {
    let text = painted(visible(text), std::io::stderr());
    let _ = std::io::stderr().lock().write_all(format!("{text}\n").as_bytes());
}

/// Asks on standard error, the answer to stand on the same line.
///
/// # Errors
/// As [`print()`].
pub fn prompt(question: &str) -> Result<(), Untold> {
    to(&mut std::io::stderr().lock(), &visible(question))
}

/// Says a table over the last `lines` lines of standard error, a terminal.
pub fn say_over(lines: usize, text: &str) {
    let _ = std::io::stderr().lock().write_all((up(lines) + &visible(text)).as_bytes());
}

/// Says that a command failed.
pub fn complain(error: &Error) {
    say(&format!("gaitway: {error}"));
}

/// Prints help, or says what is wrong with the arguments; the exit code.
#[must_use]
pub fn tell_usage(error: &clap::Error) -> i32 {
    if error.use_stderr() {
        // It repeats what was typed, names of files among it.
        say(error.render().to_string().trim_end());
        return error.exit_code();
    }
    let mut out = std::io::stdout().lock();
    match error.print().and_then(|()| out.flush()) {
        Err(cause) if cause.kind() != io::ErrorKind::BrokenPipe => {
            complain(&Untold::Failed(cause.to_string()).into());
            1
        }
        _ => error.exit_code(),
    }
}

/// What stands at the beginning of a line, and how a terminal shows it: how something ended, and what to do.
const PAINTED: [(&str, Style); 9] = [
    ("gaitway:", AnsiColor::Red.on_default().bold()),
    ("refused", AnsiColor::Red.on_default().bold()),
    ("failed", AnsiColor::Red.on_default().bold()),
    ("stopped", AnsiColor::Yellow.on_default().bold()),
    ("done, with loss", AnsiColor::Yellow.on_default().bold()),
    ("done", AnsiColor::Green.on_default().bold()),
    ("  to do", Style::new().bold()),
    ("note", Style::new().dimmed()),
    ("not whole", AnsiColor::Yellow.on_default()),
];

/// A text in the colours of whoever reads it: none unless that is a terminal that has them, and its user did not set
/// `NO_COLOR` (<https://no-color.org>).
fn painted(text: Cow<'_, str>, to: impl AsFd) -> Cow<'_, str> {
    let no_colour = std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty());
    if no_colour || !knows_commands() || !isatty(to) { text } else { Cow::Owned(in_colours(&text)) }
}

/// True unless nobody knows what kind of terminal it is, or it is one that shows only what it is told.
pub fn knows_commands() -> bool {
    std::env::var_os("TERM").is_some_and(|of| !of.is_empty() && of != "dumb")
}

fn in_colours(text: &str) -> String {
    let mut out = String::new();
    for line in text.split_inclusive('\n') {
        // A longer word that begins alike is another.
        let is_whole = |rest: &str| !rest.starts_with(|c: char| c.is_alphanumeric());
        let found = PAINTED.iter().find_map(|(words, style)| {
            line.strip_prefix(words).filter(|rest| is_whole(rest)).map(|rest| (words, style, rest))
        });
        match found {
            Some((words, style, rest)) => {
                out += &format!("{style}{words}{style:#}{rest}");
            }
            None => out += line,
        }
    }
    out
}

/// To the beginning of the line so many lines above, everything from there on cleared.
fn up(lines: usize) -> String {
    if lines == 0 { String::new() } else { format!("\x1b[{lines}A\x1b[J") }
}

/// True for what a terminal obeys instead of showing it, or shows in another order than it stands.
fn is_command(c: char) -> bool {
    c.is_control() || matches!(c, '\u{202A}'..='\u{202E}' | '\u{2066}'..='\u{2069}')
}

/// The text as a terminal may have it. Names come out of files, devices and the network, and a
/// terminal obeys what is written to it: only line ends stay what they are.
pub fn visible(text: &str) -> Cow<'_, str> {
    escaped(text, |c| c.escape_unicode().to_string())
}

/// The same for JSON, whose strings have another escape.
fn visible_json(text: &str) -> Cow<'_, str> {
    escaped(text, |c| format!("\\u{:04x}", u32::from(c)))
}

fn escaped(text: &str, escape: impl Fn(char) -> String) -> Cow<'_, str> {
    let is_hidden = |c: char| c != '\n' && is_command(c);
    if !text.contains(is_hidden) {
        return Cow::Borrowed(text);
    }
    let shown = |c: char| if is_hidden(c) { escape(c) } else { c.to_string() };
    Cow::Owned(text.chars().map(shown).collect())
}

/// Fails if no file can be written at `path`, as far as that can be known before.
fn check_place(path: &Path) -> Result<(), Error> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    let folder = folder.unwrap_or(Path::new("."));
    if !folder.is_dir() {
        return Err(Error::of(ErrorKind::Absent, "there is no such folder")
            .at(folder.display().to_string())
            .remedy("make it first, or choose another place"));
    }
    // A file is replaced by one that is written beside it, but not one that is protected.
    let itself = path.exists().then(|| path.to_owned());
    for place in itself.into_iter().chain(draft::grows_in(path)) {
        rustix::fs::access(&place, rustix::fs::Access::WRITE_OK).map_err(|e| {
            Error::of(ErrorKind::NoAccess, "you may not write here")
                .at(place.display().to_string())
                .got(e.to_string())
                .remedy("choose another place")
        })?;
    }
    Ok(())
}

/// What is said beside the result, unless the user wants quiet.
#[derive(Clone, Copy, Debug, Default)]
pub struct Remarks {
    /// True if only results and errors are wanted.
    pub quiet: bool,
    /// Since when it is told at which time something is said, and more is said.
    pub since: Option<Instant>,
}

impl Remarks {
    /// Says something to the person at the terminal.
    pub fn say(self, text: &str) {
        match self.since {
            _ if self.quiet => {}
            Some(since) => say(&format!("{:8.3} s  {text}", since.elapsed().as_secs_f64())),
            None => say(text),
        }
    }

    /// True if a progress bar may be shown.
    #[must_use]
    pub fn shows_progress(self) -> bool {
        !self.quiet && isatty(rustix::stdio::stderr()) && knows_commands()
    }
}

/// Where a report goes.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct Output {
    /// Print one JSON document instead of text
    #[arg(long)]
    json: bool,
    /// Write the JSON document to this file as well
    #[arg(long, value_name = "FILE.json")]
    report: Option<PathBuf>,
    /// Overwrite files that exist; it forces nothing else
    #[arg(long)]
    force: bool,
}

impl Output {
    /// What was asked for on a command line; nothing of a command that has no report.
    #[must_use]
    pub fn of(matches: &clap::ArgMatches) -> Self {
        let mut command = matches;
        while let Some((_, inner)) = command.subcommand() {
            command = inner;
        }
        let has_report = ["json", "report", "force"];
        match has_report.iter().all(|name| command.try_contains_id(name).is_ok()) {
            true => Self::from_arg_matches(command).unwrap_or_default(),
            false => Self::default(),
        }
    }

    /// Tells that a command came to nothing, and why: on standard error, and where a report was asked for there
    /// as well; the exit code.
    #[must_use]
    pub fn fail(&self, error: &Error) -> i32 {
        complain(error);
        let report = CameToNothing::of(error);
        let code = match (report.outcome, heard()) {
            (Outcome::Stopped, Some(signal)) => 128 + signal,
            (outcome, _) => outcome.exit_code(),
        };
        // Never over a file that is there, whatever was allowed: it may be the one that is read.
        let absent = self.report.clone().filter(|path| path.symlink_metadata().is_err());
        Self { report: absent, ..self.clone() }
            .tell(&report, "", Deed::Look)
            .iter()
            .for_each(complain);
        code
    }

    /// True if the report is printed as JSON instead of text.
    #[must_use]
    pub const fn is_json(&self) -> bool {
        self.json
    }

    /// True if files may be overwritten.
    #[must_use]
    pub const fn force(&self) -> bool {
        self.force
    }

    /// Where the report goes, if into a file.
    #[must_use]
    pub fn report(&self) -> Option<&Path> {
        self.report.as_deref()
    }

    /// No report, and files that exist are overwritten if `force`.
    #[must_use]
    pub fn forced(force: bool) -> Self {
        Self { force, ..Self::default() }
    }

    /// Tells the result of a command that ends with `code`, as text or JSON and in the file of
    /// `--report`; the exit code.
    ///
    /// What cannot be told is said on standard error. A command that would have ended well then
    /// ends with 1 if its result was all there is of it, else as done with loss; whatever else it
    /// ended with, a stop above all, counts for more. That nobody reads standard output any more
    /// (`| head`) is a loss only if something was moved.
    #[must_use]
    pub fn conclude(
        &self,
        report: &impl serde::Serialize,
        text: &str,
        deed: Deed,
        code: i32,
    ) -> i32 {
        let lost = self.tell(report, text, deed);
        lost.iter().for_each(complain);
        match (lost.is_empty(), code, deed) {
            (false, 0, Deed::Look) => Outcome::Failed.exit_code(),
            (false, 0, Deed::Work | Deed::Motion) => Outcome::DoneWithLoss.exit_code(),
            _ => code,
        }
    }

    /// Tells the result; what of it was lost.
    fn tell(&self, report: &impl serde::Serialize, text: &str, deed: Deed) -> Vec<Error> {
        let json = match serde_json::to_string_pretty(report) {
            Ok(json) => json + "\n",
            Err(e) => {
                return vec![Error::new(format!("the report cannot be written as JSON: {e}"))];
            }
        };
        let printed = if self.json { print_json(&json) } else { print(text) };
        let printed = printed.err().filter(|untold| match untold {
            Untold::Unwanted => deed == Deed::Motion,
            Untold::Failed(_) => true,
        });
        let filed = self.report.as_ref().map(|path| self.write_file(path, json.as_bytes()));
        printed.map(Error::from).into_iter().chain(filed.and_then(Result::err)).collect()
    }

    /// Fails early if one of the files to be written exists, cannot be made, or is named twice:
    /// before anything moves.
    ///
    /// # Errors
    /// The file exists and `--force` was not given; its folder does not exist; the same path twice.
    pub fn check_files(&self, wanted: &[&Option<PathBuf>]) -> Result<(), Error> {
        let paths: Vec<&Path> =
            wanted.iter().copied().chain([&self.report]).filter_map(|p| p.as_deref()).collect();
        for (index, path) in paths.iter().enumerate() {
            if paths[..index].contains(path) {
                return Err(Error::new("two outputs have the same name")
                    .at(path.display().to_string())
                    .remedy("give each its own"));
            }
            check_outside(path)?;
            draft::check_free(path, self.force)?;
            check_place(path)?;
        }
        Ok(())
    }

    /// Fails if an output is the very file that is read, whatever its name: `--force` permits to
    /// replace results, not to lose what they are made of.
    ///
    /// # Errors
    /// An output, or the report, that is `input`.
    pub fn check_apart(&self, input: &Path, wanted: &[&Path]) -> Result<(), Error> {
        self.check_all_apart(&[input], wanted)
    }

    /// The same of several files and folders that are read.
    ///
    /// # Errors
    /// An output, or the report, that is one of them, or in one.
    pub fn check_all_apart(&self, inputs: &[&Path], wanted: &[&Path]) -> Result<(), Error> {
        let written = wanted.iter().copied().chain(self.report.as_deref());
        draft::check_apart(inputs.iter().copied(), written)
    }

    /// Writes a whole file, never over an existing one without `--force`, and with it only once the
    /// new one is whole.
    ///
    /// # Errors
    /// The file exists, or cannot be written.
    pub fn write_file(&self, path: &Path, bytes: &[u8]) -> Result<(), Error> {
        check_outside(path)?;
        draft::write_file(path, self.force, bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn how_it_ended_is_coloured_at_the_beginning_of_a_line_and_nowhere_else() {
        let of = |text: &str| in_colours(text).replace('\u{1b}', "^");
        assert_eq!(of("done: bow on op3\n"), "^[1m^[32mdone^[0m: bow on op3\n");
        assert_eq!(of("done, with loss: 1\n"), "^[1m^[33mdone, with loss^[0m: 1\n");
        assert_eq!(
            of("gaitway: no\n  to do    go\n"),
            "^[1m^[31mgaitway:^[0m no\n^[1m  to do^[0m    go\n"
        );
        for plain in ["it is done: bow\n", "donee\n", "notes\n", "joint      goal\n", ""] {
            assert_eq!(of(plain), plain);
        }
    }
}
