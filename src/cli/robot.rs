//! `robot new`: a robot file from what answers on a line.

use super::protocol::{ProtocolName, serial_protocol};
use super::scan::baud;
use super::terminal::Terminal;
use super::{Deed, Output, Remarks};
use crate::draft;
use crate::error::{Error, ErrorKind};
use crate::job::robot_draft::{DraftOrder, RobotDraft, robot_draft};
use crate::job::scan::Speeds;
use crate::rig::Address;
use clap::{Args, Subcommand};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Arguments of `robot`.
#[derive(Debug, Args)]
#[command(after_help = "Example: gaitway robot new --from serial:/dev/ttyUSB0 -o my-arm.toml")]
pub struct RobotArgs {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Write a draft of a robot file: a joint for every servo that answers
    New(NewArgs),
}

/// Arguments of `robot new`.
#[derive(Debug, Args)]
#[command(after_help = "\
What a line cannot tell (names, directions, ranges of the body) is marked in the file for you to fill in. \
Nothing is written to any device.

Examples:
  gaitway robot new --from serial:/dev/ttyUSB0 --baud all -o my-arm.toml
  gaitway robot new --from left=serial:/dev/ttyUSB0 --from right=serial:/dev/ttyUSB1 -o twins.toml
  gaitway robot new --from can:can0 -o legs.toml")]
pub struct NewArgs {
    /// Where a line is: serial:PATH[?baud=N], tcp:HOST:PORT, can:INTERFACE; NAME=BUS gives it a name;
    /// once for each line
    #[arg(long, value_name = "BUS", required = true)]
    from: Vec<Address>,
    /// File to write; its name without .toml is the robot's
    #[arg(short, long, value_name = "ROBOT.toml")]
    output_file: PathBuf,
    /// Ask in this protocol only [default: all]
    #[arg(long, value_enum)]
    protocol: Option<ProtocolName>,
    /// Line speed, bits per second, or `all`: every speed of every known servo
    #[arg(long, value_name = "BPS|all", value_parser = baud)]
    baud: Option<Speeds>,
    /// Robot that a virtual line (sim, sim:pty) belongs to
    #[arg(long, value_name = "ROBOT")]
    robot: Option<String>,
    #[command(flatten)]
    output: Output,
}

/// Runs `robot`.
///
/// # Errors
/// A line that cannot be opened or fails, nobody who answers, a file that exists.
pub fn run(args: &RobotArgs, remarks: Remarks) -> Result<i32, Error> {
    match &args.action {
        Action::New(args) => new(args, remarks),
    }
}

fn new(args: &NewArgs, remarks: Remarks) -> Result<i32, Error> {
    let file = &args.output_file;
    args.output.check_files(&[&Some(file.clone())])?;
    let name = robot_name(file)?;
    let protocols = args.from.iter().map(|bus| serial_protocol(args.protocol, bus));
    let protocol = protocols.collect::<Result<Vec<_>, Error>>()?.into_iter().flatten().next();
    let terminal = Terminal::unheard(remarks);
    let draft = robot_draft(
        &DraftOrder {
            name,
            buses: args.from.clone(),
            robot: args.robot.clone(),
            protocol,
            speeds: args.baud.unwrap_or_default(),
        },
        &terminal,
    )?;
    draft::write_file(file, args.output.force(), draft.text.as_bytes())?;
    Ok(args.output.conclude(&draft, &text(&draft, file), Deed::Work, 0))
}

/// What the file is called, which is what the robot is called.
fn robot_name(file: &Path) -> Result<String, Error> {
    let stem = file.file_stem().unwrap_or_default().to_string_lossy().to_lowercase();
    let is_name = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
    let name = stem.replace(['_', ' ', '.'], "-");
    let is_toml = file.extension().is_some_and(|ending| ending == "toml");
    if is_toml && !name.is_empty() && name.chars().all(is_name) {
        return Ok(name);
    }
    Err(Error::of(ErrorKind::Malformed, "not a usable name for a robot file")
        .at("--output-file")
        .got(file.display().to_string())
        .allowed("letters a-z, digits and -, and the ending .toml: my-arm.toml"))
}

fn text(draft: &RobotDraft, file: &Path) -> String {
    let mut out = format!(
        "{:<14} {:>4} {:<18} {:>10} {:>20} {:>8}\n",
        "joint", "ID", "servo", "now, deg", "allowed, deg", "deg/s"
    );
    for joint in &draft.joints {
        let now = joint.present_rad.map(|at| format!("{:.1}", at.to_degrees()));
        let range =
            format!("{:.1} to {:.1}", joint.lower_rad.to_degrees(), joint.upper_rad.to_degrees());
        let _ = writeln!(
            out,
            "{:<14} {:>4} {:<18} {:>10} {range:>20} {:>8.0}",
            joint.name,
            joint.id,
            joint.servo,
            now.unwrap_or_default(),
            joint.velocity_rad_s.to_degrees()
        );
    }
    for note in &draft.notes {
        let _ = writeln!(out, "note      {note}");
    }
    if let Some(faults) = &draft.faults {
        let _ = writeln!(out, "not whole {}", faults.replace('\n', "\n          "));
    }
    let _ = writeln!(
        out,
        "written   {0}\nnext      read its first lines and name the joints, then: gaitway profile check {0}",
        file.display()
    );
    out
}
