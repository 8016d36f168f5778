//! `robot new`: a robot file from what answers on a line. `robot import`: one from a public model.
//! `robot export`: its body as URDF. `robot info`: what a robot weighs, takes up and stands on.

use super::protocol::{ProtocolName, serial_protocol};
use super::scan::baud;
use super::terminal::Terminal;
use super::{Deed, Output, Remarks};
use crate::draft;
use crate::error::{Error, ErrorKind};
use crate::job::report::counted;
use crate::job::robot_draft::{DraftOrder, RobotDraft, robot_draft};
use crate::job::robot_info::{RobotInfo, robot_info};
use crate::job::robot_model::{ImportOrder, Imported, import};
use crate::job::scan::Speeds;
use crate::job::scene_file::write_model;
use crate::rig::Address;
use clap::{Args, Subcommand};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Arguments of `robot`.
#[derive(Debug, Args)]
#[command(after_help = "Example: gaitway robot info op3")]
pub struct RobotArgs {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Write a draft of a robot file: a joint for every servo that answers
    New(NewArgs),
    /// Write a robot file, or the body of one, from a public model (URDF or MJCF)
    Import(ImportArgs),
    /// Write a robot's body as URDF, for simulators and viewers
    #[command(after_help = "Example: gaitway robot export op3 -o op3.urdf")]
    Export {
        /// Name of a robot, or path of its file
        robot: String,
        /// File to write
        #[arg(short, long, value_name = "FILE.urdf")]
        output_file: PathBuf,
        /// Overwrite the file if it exists
        #[arg(long)]
        force: bool,
    },
    /// What a robot weighs, takes up and stands on
    #[command(after_help = "Example: gaitway robot info op3")]
    Info {
        /// Name of a robot, or path of its file
        robot: String,
        #[command(flatten)]
        output: Output,
    },
}

/// Arguments of `robot import`.
#[derive(Debug, Args)]
#[command(after_help = include_str!("help/robot.txt"))]
pub struct ImportArgs {
    /// The model: URDF, or MJCF in one piece
    #[arg(value_name = "FILE")]
    model: PathBuf,
    /// File to write; its name without .toml is the robot's
    #[arg(short, long, value_name = "ROBOT.toml")]
    output_file: PathBuf,
    /// Robot whose file gets this body in place of its own
    #[arg(long, value_name = "ROBOT", conflicts_with = "servo")]
    robot: Option<String>,
    /// Joints of the model that are not at zero where the robot's are, with their angles there, degrees
    #[arg(long, value_name = "JOINT=DEG", value_delimiter = ',', value_parser = named_angle)]
    zero: Vec<(String, f64)>,
    /// Profile of the servos, as far as it is the same for all joints
    #[arg(long, value_name = "PROFILE")]
    servo: Option<String>,
    /// Where the model is from, for the file [default: its name]
    #[arg(long, value_name = "TEXT")]
    source: Option<String>,
    /// Its licence, for the file
    #[arg(long, value_name = "SPDX")]
    licence: Option<String>,
    /// Leave the model's own shapes aside: capsules and boxes from lengths and masses alone
    #[arg(long)]
    plain_shapes: bool,
    #[command(flatten)]
    output: Output,
}

/// Arguments of `robot new`.
#[derive(Debug, Args)]
#[command(after_help = include_str!("help/robot-2.txt"))]
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
        Action::Import(args) => imported(args),
        Action::Export { robot, output_file, force } => {
            write_model(robot, output_file, *force)?;
            remarks.say(&format!("{robot} to {}", output_file.display()));
            Ok(0)
        }
        Action::Info { robot, output } => {
            let info = robot_info(robot)?;
            Ok(output.conclude(&info, &info_text(&info), Deed::Look, 0))
        }
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

fn imported(args: &ImportArgs) -> Result<i32, Error> {
    let file = &args.output_file;
    args.output.check_files(&[&Some(file.clone())])?;
    args.output.check_apart(&args.model, &[file.as_path()])?;
    let found = import(&ImportOrder {
        model: args.model.clone(),
        file: file.clone(),
        name: robot_name(file)?,
        robot: args.robot.clone(),
        zero: args.zero.clone(),
        servo: args.servo.clone(),
        source: args.source.clone(),
        licence: args.licence.clone(),
        plain_shapes: args.plain_shapes,
    })?;
    draft::write_file(file, args.output.force(), found.text.as_bytes())?;
    Ok(args.output.conclude(&found, &import_text(&found, file), Deed::Work, 0))
}

/// `JOINT=DEG` as a name and an angle, rad.
fn named_angle(text: &str) -> Result<(String, f64), String> {
    let (name, degrees) = text.split_once('=').ok_or("JOINT=DEG is asked for")?;
    let degrees: f64 = degrees.parse().map_err(|_| "DEG is a number of degrees")?;
    if !degrees.is_finite() || name.is_empty() {
        return Err("JOINT=DEG is asked for".to_owned());
    }
    Ok((name.to_owned(), degrees.to_radians()))
}

fn import_text(found: &Imported, file: &Path) -> String {
    let mut out = format!(
        "{}: {} model, base {}, {:.3} kg in {}, {}, {}, {}\n",
        found.name,
        found.format,
        found.base,
        found.mass_kg,
        counted(found.links, "link"),
        counted(found.joints.len() + found.coupled.len(), "joint"),
        counted(found.shapes, "shape"),
        counted(found.meshes, "mesh")
    );
    for (what, names) in [
        ("stands on", &found.soles),
        ("coupled", &found.coupled),
        ("no limits", &found.without_limits),
    ] {
        if !names.is_empty() {
            let _ = writeln!(out, "{what:<9} {}", names.join(", "));
        }
    }
    if !found.anatomy.is_empty() {
        let parts = found.anatomy.iter().map(|(part, joint)| format!("{joint} moves {part}"));
        let parts: Vec<String> = parts.collect();
        let when = if found.faults.is_some() { "once the file is whole, " } else { "" };
        let _ = writeln!(
            out,
            "anatomy   guessed from where joints are: {}\n          {when}look at it: gaitway retarget walk --robot {:?} --hang -o look.csv --html look.html",
            parts.join(", "),
            file.display().to_string()
        );
    }
    for note in &found.notes {
        let _ = writeln!(out, "note      {note}");
    }
    if let Some(faults) = &found.faults {
        let _ = writeln!(out, "not whole {}", faults.replace('\n', "\n          "));
    }
    let _ = writeln!(out, "written   {}", file.display());
    out
}

fn info_text(info: &RobotInfo) -> String {
    let mut out = format!("{}: {}\n", info.name, info.description);
    let Some(body) = &info.body else {
        let _ = writeln!(
            out,
            "joints    {}\nbody      its file has none: gaitway robot import MODEL --robot {} -o FILE.toml",
            info.joints.len(),
            info.name
        );
        return out;
    };
    let metres = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.3} m"));
    let _ = writeln!(
        out,
        "base      {}\nmass      {:.3} kg in {}\nheight    {}, centre of mass at {} (start pose)",
        body.base,
        body.mass_kg,
        counted(body.links.len(), "link"),
        metres(body.height_m),
        metres(body.centre_height_m)
    );
    for sole in &body.soles {
        let _ = writeln!(
            out,
            "sole      {}: {:.0} x {:.0} mm",
            sole.link,
            sole.length_m * 1000.0,
            sole.width_m * 1000.0
        );
    }
    for (one, two, depth_m) in &body.touching {
        let _ = writeln!(out, "touching  {one} and {two}, {:.1} mm deep", depth_m * 1000.0);
    }
    let _ = writeln!(
        out,
        "source    {}\nlicence   {}\nshapes    {}\n\n{:<20} {:>8} {:>6}",
        body.source, body.licence, body.shape_source, "link", "kg", "shapes"
    );
    for link in &body.links {
        let _ = writeln!(out, "{:<20} {:>8.4} {:>6}", link.name, link.mass_kg, link.shapes);
    }
    out
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
