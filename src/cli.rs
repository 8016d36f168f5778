//! What a person types: one file per subcommand, results on stdout, everything else on stderr.

pub mod actionlets;
pub mod calibrate;
pub mod calibrated;
pub mod clean;
pub mod convert;
pub mod corpus;
pub mod cut;
pub mod doctor;
pub mod finding;
pub mod fit;
pub mod follow;
pub mod hold;
pub mod inserts;
mod keys;
pub mod limp;
pub mod live;
pub mod manual;
pub mod model;
pub mod monitor;
pub mod names;
pub mod operator;
pub mod output;
pub mod play;
pub mod ports;
pub mod profile;
pub mod protocol;
pub mod reading;
pub mod recognise;
pub mod record;
pub mod recordings;
pub mod report;
pub mod retarget;
pub mod robot;
pub mod scan;
pub mod score;
pub mod servo;
pub mod signals;
pub mod simulate;
pub mod source;
pub mod status;
pub mod synth;
pub mod terminal;
pub mod view;
pub mod viewing;
pub mod wearing;

pub use output::{Deed, Output, Remarks, print, say};
pub use report::Outcome;

use crate::error::{Error, ErrorKind};
use crate::job::net;
use crate::rig::own_profiles;
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use std::ffi::OsString;

/// The command line.
#[derive(Debug, Parser)]
#[command(name = "gaitway", version, about, long_about = LONG_ABOUT, max_term_width = 100)]
pub struct Cli {
    /// No progress and no remarks, only results and errors
    #[arg(short, long, global = true)]
    quiet: bool,
    /// Say when each remark was made, and what is planned and foreseen of a motion
    #[arg(short, long, global = true, conflicts_with = "quiet")]
    verbose: bool,
    /// Folder with profiles of your own (servos, actuators, sensors, adapters, robots), found by name;
    /// may be given several times [always searched: ~/.config/gaitway/profiles, and the folder of the
    /// robot file]
    #[arg(long, global = true, value_name = "DIR")]
    profiles: Vec<std::path::PathBuf>,
    #[command(subcommand)]
    command: Command,
}

const LONG_ABOUT: &str = include_str!("cli/help/gaitway.txt");

#[derive(Debug, Subcommand)]
enum Command {
    /// Play a motion on a robot, real or virtual
    Play(Box<play::PlayArgs>),
    /// Mirror a person on a robot, in real time
    Live(Box<live::LiveArgs>),
    /// Let a robot follow another one that is led by hand
    Follow(Box<follow::FollowArgs>),
    /// Transfer a motion to a robot's joints and write the trajectory
    Retarget(Box<retarget::RetargetArgs>),
    /// Make a motion of actionlets and write it to a file
    Synth(Box<synth::SynthArgs>),
    /// Find and mend what is wrong with markers
    Clean(Box<clean::CleanArgs>),
    /// Fit a body to markers: bones, joint angles, residuals
    Fit(Box<fit::FitArgs>),
    /// Break a captured motion down into actionlets
    Actionlets(Box<actionlets::ActionletsArgs>),
    /// Name what a body does in a capture or an action
    Recognise(Box<recognise::RecogniseArgs>),
    /// Cut what somebody does out of a capture, as trials of their own
    Cut(Box<cut::CutArgs>),
    /// Models by which actions are recognised
    Model(model::ModelArgs),
    /// A motion database: make it, add to it, ask it, check it, take from it
    Corpus(corpus::CorpusArgs),
    /// Judge the program on labelled clips, and on a corpus
    Score(score::ScoreArgs),
    /// Switch torque on where the robot stands: it holds
    Hold(hold::HoldArgs),
    /// Switch torque off: the robot goes limp (and falls, so it asks)
    Limp(limp::LimpArgs),
    /// Run a virtual robot that other programs open as a serial port or over TCP
    Simulate(simulate::SimulateArgs),
    /// Record sensors, lines of text and hand-guided servos
    Record(Box<record::RecordArgs>),
    /// Turn a recording, a capture or markers into another kind of file
    Convert(convert::ConvertArgs),
    /// Look into a recording, a capture or markers
    Info(recordings::InfoArgs),
    /// Rescue a recording that was never closed
    Recover(recordings::RecoverArgs),
    /// List every name that is known: actions, models, robots, servos, sets, formats
    List(names::ListArgs),
    /// Look at servo and robot profiles
    Profile(profile::ProfileArgs),
    /// Write a file for a robot of your own
    Robot(robot::RobotArgs),
    /// List serial ports and CAN interfaces
    Ports(ports::PortsArgs),
    /// Check this machine for a real robot: what is wrong, and how to fix it
    Doctor(doctor::DoctorArgs),
    /// Find each joint's zero, direction and range by hand
    Calibrate(calibrate::CalibrateArgs),
    /// Watch every joint: goal, position, load, temperature, supply, errors
    Monitor(monitor::MonitorArgs),
    /// See it in a browser: a robot, a file, or what a command does
    View(view::ViewArgs),
    /// Find every device that answers on a line
    Scan(scan::ScanArgs),
    /// One servo: its registers, its ID, its line speed, one movement
    Servo(Box<servo::ServoArgs>),
    /// Print what completes this command line in a shell
    Completions(manual::CompletionsArgs),
    /// Print a page of the manual, as `man` reads it
    Man(manual::ManArgs),
}

/// Runs the command line; the exit code.
#[must_use]
pub fn main() -> i32 {
    net::print_no_caught_panics();
    if let Err(cause) = signals::outlive_size_limits() {
        output::complain(&Error::new(format!("no signals: {cause}")));
        return Outcome::Failed.exit_code();
    }
    let typed = match Typed::of(std::env::args_os()) {
        Ok(typed) => typed,
        Err(error) => return output::tell_usage(&error),
    };
    net::catch(|| run(&typed)).unwrap_or_else(|words| {
        let broke = Error::of(ErrorKind::Broke, "the program broke");
        typed.output.fail(&broke.got(words).remedy("please report this"))
    })
}

/// A command line as it was typed.
pub struct Typed {
    cli: Cli,
    /// Where its report goes, whatever the command.
    output: Output,
}

impl Typed {
    /// Reads a command line.
    ///
    /// # Errors
    /// One that cannot be understood, or asks for help.
    pub fn of(
        words: impl IntoIterator<Item = impl Into<OsString> + Clone>,
    ) -> Result<Self, clap::Error> {
        let words: Vec<OsString> = words.into_iter().map(Into::into).collect();
        let parsed = Cli::command().try_get_matches_from(&words);
        let matches =
            parsed.map_err(|error| match words.iter().find(|word| word.to_str().is_none()) {
                Some(word) if error.kind() == clap::error::ErrorKind::InvalidUtf8 => Cli::command()
                    .error(
                        error.kind(),
                        format!("{word:?} is no text in UTF-8; rename the file, or link to it"),
                    ),
                _ => error,
            })?;
        let cli = Cli::from_arg_matches(&matches).map_err(|e| e.format(&mut Cli::command()))?;
        Ok(Self { cli, output: Output::of(&matches) })
    }
}

/// Runs a command; its exit code.
fn run(typed: &Typed) -> i32 {
    let cli = &typed.cli;
    let since = cli.verbose.then(std::time::Instant::now);
    let remarks = Remarks { quiet: cli.quiet, since };
    if let Err(error) = own_profiles(&cli.profiles) {
        return typed.output.fail(&error);
    }
    let done = match &cli.command {
        Command::Play(args) => play::run(args, remarks),
        Command::Live(args) => live::run(args, remarks),
        Command::Follow(args) => follow::run(args, remarks),
        Command::Retarget(args) => retarget::run(args, remarks),
        Command::Synth(args) => synth::run(args, remarks),
        Command::Clean(args) => clean::run(args, remarks),
        Command::Fit(args) => fit::run(args, remarks),
        Command::Actionlets(args) => actionlets::run(args, remarks),
        Command::Recognise(args) => recognise::run(args, remarks),
        Command::Cut(args) => cut::run(args, remarks),
        Command::Model(args) => model::run(args),
        Command::Corpus(args) => corpus::run(args, remarks),
        Command::Score(args) => score::run(args, remarks),
        Command::Hold(args) => hold::run(args, remarks),
        Command::Limp(args) => limp::run(args),
        Command::Simulate(args) => simulate::run(args, remarks),
        Command::Record(args) => record::run(args, remarks),
        Command::Convert(args) => convert::run(args, remarks),
        Command::Info(args) => recordings::info(args),
        Command::Recover(args) => recordings::recover(args, remarks),
        Command::List(args) => names::run(args),
        Command::Profile(args) => profile::run(args),
        Command::Robot(args) => robot::run(args, remarks),
        Command::Ports(args) => ports::run(args, remarks),
        Command::Doctor(args) => doctor::run(args, remarks),
        Command::Calibrate(args) => calibrate::run(args, remarks),
        Command::Monitor(args) => monitor::run(args, remarks),
        Command::View(args) => match view::seen(args, cli) {
            Ok(view::Viewed::Command(command)) => return run(&command),
            Ok(view::Viewed::File(path)) => view::file(&path, args, remarks),
            Ok(view::Viewed::Robot(name)) => view::robot(&name, args, remarks),
            Err(view::NotViewed::Usage(error)) => return output::tell_usage(&error),
            Err(view::NotViewed::Error(error)) => Err(error),
        },
        Command::Scan(args) => scan::run(args, remarks),
        Command::Servo(args) => servo::run(args, remarks),
        Command::Completions(args) => manual::completions(args),
        Command::Man(args) => manual::man(args),
    };
    done.unwrap_or_else(|error| typed.output.fail(&error))
}
