//! What a person types: one file per subcommand, results on stdout, everything else on stderr.

pub mod address;
pub mod connect;
pub mod play;
pub mod plots;
pub mod profile;
pub mod progress;
pub mod report;
pub mod retarget;
pub mod signals;
pub mod simulate;
pub mod source;

pub use report::Outcome;

use crate::error::Error;
use clap::{Parser, Subcommand};
use std::fs::OpenOptions;
use std::io::Write;
use std::path::{Path, PathBuf};

/// The command line.
#[derive(Debug, Parser)]
#[command(name = "gaitway", version, about, long_about = LONG_ABOUT, max_term_width = 100)]
pub struct Cli {
    #[command(flatten)]
    output: Output,
    #[command(subcommand)]
    command: Command,
}

const LONG_ABOUT: &str = "\
Plays human motion on small humanoid robots, safely, and on a virtual robot when there is none.

A motion capture (BVH) is read, transferred to the robot's joints, slowed until the robot can do \
it, checked, and streamed to the servos with feedback. Nothing moves before every servo's \
identity, configuration and start pose are proven; every motion starts and ends at rest.

Start here:
  gaitway play walk --robot op3 --bus sim --html walk.html
  gaitway profile list
  gaitway simulate op3 --pty /tmp/op3";

/// Where results and diagnostics go.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct Output {
    /// Print one JSON document instead of text
    #[arg(long, global = true)]
    json: bool,
    /// Write the JSON document to this file as well
    #[arg(long, global = true, value_name = "FILE.json")]
    report: Option<PathBuf>,
    /// Overwrite files that exist
    #[arg(long, global = true)]
    force: bool,
    /// No progress and no remarks
    #[arg(short, long, global = true)]
    quiet: bool,
}

impl Output {
    /// Prints a result.
    pub fn result(&self, text: &str) {
        let mut out = std::io::stdout().lock();
        // A reader that has had enough (`| head`) is no error.
        let _ = out.write_all(text.as_bytes()).and_then(|()| out.flush());
    }

    /// Prints a remark for the person at the terminal.
    pub fn diagnostic(&self, text: &str) {
        if !self.quiet {
            eprintln!("{text}");
        }
    }

    /// True if results are to be JSON.
    #[must_use]
    pub const fn json(&self) -> bool {
        self.json
    }

    /// True if files may be overwritten.
    #[must_use]
    pub const fn force(&self) -> bool {
        self.force
    }

    /// True if a progress bar may be shown.
    #[must_use]
    pub fn shows_progress(&self) -> bool {
        !self.quiet && !self.json && rustix::termios::isatty(rustix::stdio::stderr())
    }

    /// Prints a report as text or JSON and writes it to `--report`.
    ///
    /// # Errors
    /// A report file that exists or cannot be written.
    pub fn report(&self, report: &impl serde::Serialize, text: &str) -> Result<(), Error> {
        let json = serde_json::to_string_pretty(report)
            .map_err(|e| Error::new(format!("the report cannot be written as JSON: {e}")))?;
        if self.json {
            self.result(&format!("{json}\n"));
        } else {
            self.result(text);
        }
        if let Some(path) = &self.report {
            self.write_file(path, format!("{json}\n").as_bytes())?;
        }
        Ok(())
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
            self.check_free(path)?;
            let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
            if let Some(folder) = folder.filter(|folder| !folder.is_dir()) {
                return Err(Error::new("there is no such folder")
                    .at(folder.display().to_string())
                    .remedy("make it first, or choose another place"));
            }
        }
        Ok(())
    }

    /// Fails if `path` exists and may not be overwritten.
    fn check_free(&self, path: &Path) -> Result<(), Error> {
        if path.is_dir() {
            return Err(Error::new("this is a folder, not a file").at(path.display().to_string()));
        }
        // A dangling link counts as taken: writing through it would write elsewhere.
        if self.force || path.symlink_metadata().is_err() {
            return Ok(());
        }
        Err(Error::new("the file exists already")
            .at(path.display().to_string())
            .remedy("choose another name, or add --force to overwrite it"))
    }

    /// Writes a whole file, never over an existing one without `--force`.
    ///
    /// # Errors
    /// The file exists, or cannot be written.
    pub fn write_file(&self, path: &Path, bytes: &[u8]) -> Result<(), Error> {
        self.check_free(path)?;
        let mut options = OpenOptions::new();
        options.write(true);
        if self.force {
            options.create(true).truncate(true);
        } else {
            options.create_new(true);
        }
        let written = options.open(path).and_then(|mut file| file.write_all(bytes));
        written.map_err(|e| {
            Error::new("cannot write the file").at(path.display().to_string()).got(e.to_string())
        })
    }
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Play a motion on a robot, real or virtual
    Play(Box<play::PlayArgs>),
    /// Transfer a motion to a robot's joints and write the trajectory
    Retarget(Box<retarget::RetargetArgs>),
    /// Run a virtual robot that other programs can open as a serial port
    Simulate(simulate::SimulateArgs),
    /// Look at servo and robot profiles
    Profile(profile::ProfileArgs),
}

/// Runs the command line; the exit code.
#[must_use]
pub fn main() -> i32 {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => {
            let _ = error.print();
            return error.exit_code();
        }
    };
    let output = &cli.output;
    let done = match &cli.command {
        Command::Play(args) => play::run(args, output),
        Command::Retarget(args) => retarget::run(args, output),
        Command::Simulate(args) => simulate::run(args, output),
        Command::Profile(args) => profile::run(args, output),
    };
    done.unwrap_or_else(|error| {
        eprintln!("gaitway: {error}");
        Outcome::Refused.exit_code()
    })
}
