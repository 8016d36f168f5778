//! `convert`: a recording as a table, or as joint angles of the person who wore its sensors; a capture
//! as joint angles of the body model; markers as another kind of file.

use super::report::Outcome;
use super::signals::Signals;
use super::terminal::Terminal;
use super::{Output, Remarks};
use crate::error::Error;
use crate::job::convert::{ConvertOrder, convert};
use crate::job::convert_recording::{RecordingOrder, convert_recording};
use crate::job::labels::{self, LabelsOrder, label_kind};
use crate::job::markers::{self, MarkersOrder};
use crate::job::report::counted;
use crate::job::scene_file::{SceneOrder, write_scene};
use crate::job::sensors::{
    Mode, SensorsOrder, convert as convert_sensors, is_table_of_sensors, span,
};
use crate::job::source::{CaptureOptions, FileKind, file_kind};
use clap::Args;
use std::path::{Path, PathBuf};

/// Poses per second of joint angles, unless another rate is asked for.
const USUAL_HZ: f64 = 100.0;

/// Arguments of `convert`.
#[derive(Debug, Args)]
#[command(after_help = include_str!("help/convert.txt"))]
pub struct ConvertArgs {
    /// Recording, finished or not, a capture (.bvh, .amc, .mot, .sto), markers (.c3d, .trc, .csm, .csv), or labels
    file: PathBuf,
    /// The table, skeleton file, recording, scene or page to write
    out: PathBuf,
    /// How the sensors were worn, in place of what the recording says
    #[arg(long, value_name = "FILE.toml")]
    calibration_body: Option<PathBuf>,
    /// Poses per second of joint angles of a recording [default: 100]; frames per second of an AMC file
    /// [default: what it says, or 120] or of markers that do not say it
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    rate: Option<f64>,
    /// File that says which joint of the capture is which body segment (TOML)
    #[arg(long, value_name = "FILE.toml")]
    mapping: Option<PathBuf>,
    /// Skeleton of an AMC file [default: the .asf file beside it that it is named after]
    #[arg(long, value_name = "FILE.asf")]
    skeleton: Option<PathBuf>,
    /// Trial in which the person stands still, for markers [default: the quietest half second of the motion]
    #[arg(long = "static", value_name = "FILE")]
    static_trial: Option<PathBuf>,
    /// Stature of the person, m [default: what the recording says, or 1.75; as a capture shows it]
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    stature: Option<f64>,
    /// What the columns of a table of sensors are, how their axes lie and where they are worn; axes, scales
    /// and segments of a recording's sensors (TOML)
    #[arg(long, value_name = "FILE.toml")]
    sensors: Option<PathBuf>,
    /// Who wears which sensor and which way, in place of what is recorded or declared: a file as `live --wear` reads it. Needs a time
    /// in N pose
    #[arg(long, value_name = "FILE.toml", conflicts_with = "calibration_body")]
    wear: Option<PathBuf>,
    /// When somebody stands in N pose, s from the first sample, such as 0,4
    #[arg(long, value_name = "FROM,TO", value_parser = span, conflicts_with = "calibration_body")]
    n_pose: Option<[f64; 2]>,
    /// Find orientations anew from raw samples: six-axes, or nine-axes with the magnetic field
    #[arg(long, value_name = "HOW", value_parser = fusing)]
    fuse: Option<Mode>,
    /// Folder of the clips that labels are of [default: that of a table of labels]
    #[arg(long, value_name = "DIR")]
    clips: Option<PathBuf>,
    /// A table of samples, also of worn sensors
    #[arg(long, conflicts_with = "calibration_body")]
    samples: bool,
    /// What a page would show, as messages that Foxglove and rerun draw (OUT.mcap)
    #[arg(long, conflicts_with_all = ["samples", "calibration_body", "mapping", "stature", "sensors", "wear", "n_pose", "fuse", "clips"])]
    scene: bool,
    /// Overwrite the file if it exists
    #[arg(long)]
    force: bool,
}

/// Runs `convert`; exit code 3 if something is missing in the recording.
///
/// # Errors
/// A recording that cannot be read or does not know how its sensors were worn, a file that exists
/// or cannot be written.
pub fn run(args: &ConvertArgs, remarks: Remarks) -> Result<i32, Error> {
    if args.scene {
        return scene(args, remarks);
    }
    if label_kind(&args.file).is_some() {
        return of_labels(args, remarks);
    }
    if args.clips.is_some() {
        return Err(misplaced(
            "--clips",
            "labels: a table with columns file and class, or TRIAL/ACTION.txt",
        ));
    }
    let is_worn = args.wear.is_some() || args.n_pose.is_some();
    let of_sensors = args.sensors.is_some() || args.fuse.is_some() || is_worn;
    if of_sensors || is_table_of_sensors(&args.file) {
        return sensors(args, remarks);
    }
    match file_kind(&args.file) {
        FileKind::Markers if !is_of_body(&args.out) => return of_markers(args, remarks),
        FileKind::Markers => return captured(args, remarks),
        FileKind::Bvh | FileKind::Amc | FileKind::OpenSim | FileKind::Angles => {
            return captured(args, remarks);
        }
        FileKind::Other => {}
    }
    refuse(args, &["--mapping", "--skeleton", "--static"], "a capture (.bvh, .amc)")?;
    apart(args)?;
    let report = convert_recording(&RecordingOrder {
        recording: args.file.clone(),
        calibration: args.calibration_body.clone(),
        stature_m: args.stature,
        rate_hz: args.rate.unwrap_or(USUAL_HZ),
        samples: args.samples,
        file: args.out.clone(),
        replace: args.force,
    })?;
    report.notes.iter().for_each(|note| remarks.say(note));
    Ok(report.outcome.exit_code())
}

/// What a file shows, for others' viewers.
fn scene(args: &ConvertArgs, remarks: Remarks) -> Result<i32, Error> {
    apart(args)?;
    let report = write_scene(&SceneOrder {
        source: args.file.clone(),
        reading: reading(args),
        file: args.out.clone(),
        replace: args.force,
    })?;
    report.notes.iter().for_each(|note| remarks.say(note));
    let (instants, duration_s) = (report.instants, report.duration_s);
    remarks.say(&format!(
        "{instants} of {duration_s:.2} s to {}",
        report.written,
        instants = counted(instants, "instant")
    ));
    Ok(report.outcome.exit_code())
}

/// What a capture does not say itself.
fn reading(args: &ConvertArgs) -> CaptureOptions {
    CaptureOptions {
        skeleton: args.skeleton.clone(),
        rate_hz: args.rate,
        static_trial: args.static_trial.clone(),
    }
}

/// True of a file that holds a body, to which markers are fitted first.
fn is_of_body(out: &Path) -> bool {
    out.extension().is_some_and(|ending| {
        ["bvh", "mot", "x3d", "html"].iter().any(|of_body| ending == *of_body)
    })
}

/// How orientations are found anew.
fn fusing(word: &str) -> Result<Mode, String> {
    match word {
        "six-axes" => Ok(Mode::SixAxes),
        "nine-axes" => Ok(Mode::NineAxes),
        _ => Err("six-axes and nine-axes are known".to_owned()),
    }
}

/// Sensors out of a table, or out of a recording with other settings.
fn sensors(args: &ConvertArgs, remarks: Remarks) -> Result<i32, Error> {
    refuse(args, &["--samples", "--mapping", "--skeleton"], OF_OTHERS)?;
    apart(args)?;
    let report = convert_sensors(&SensorsOrder {
        sensors: args.file.clone(),
        declared: args.sensors.clone(),
        wear: args.wear.clone(),
        n_pose_s: args.n_pose,
        fuse: args.fuse,
        calibration: args.calibration_body.clone(),
        rate_hz: args.rate.unwrap_or(USUAL_HZ),
        stature_m: args.stature,
        file: args.out.clone(),
        replace: args.force,
    })?;
    report.notes.iter().for_each(|note| remarks.say(note));
    if !report.fused.is_empty() {
        remarks.say(&format!("fused from raw samples: {}", report.fused.join(", ")));
    }
    let samples: usize = report.samples.values().sum();
    remarks.say(&match report.poses {
        Some(poses) => format!("{poses} to {}", report.written, poses = counted(poses, "pose")),
        None => {
            format!("{samples} to {}", report.written, samples = counted(samples, "orientation"))
        }
    });
    Ok(report.outcome.exit_code())
}

/// What others need than those that are read now.
const OF_OTHERS: &str = "a recording (.mcap) or a capture (.bvh, .amc)";

/// Fails if one of these options was given.
fn refuse(args: &ConvertArgs, options: &[&str], allowed: &str) -> Result<(), Error> {
    let given = [
        ("--samples", args.samples),
        ("--calibration-body", args.calibration_body.is_some()),
        ("--mapping", args.mapping.is_some()),
        ("--skeleton", args.skeleton.is_some()),
        ("--stature", args.stature.is_some()),
        ("--static", args.static_trial.is_some()),
    ];
    match given.into_iter().find(|(option, given)| *given && options.contains(option)) {
        Some((option, _)) => Err(misplaced(option, allowed)),
        None => Ok(()),
    }
}

/// Fails if the output is there already, or is what is read.
fn apart(args: &ConvertArgs) -> Result<(), Error> {
    let output = Output::forced(args.force);
    output.check_files(&[&Some(args.out.clone())])?;
    output.check_apart(&args.file, &[&args.out])
}

fn misplaced(option: &str, allowed: &str) -> Error {
    Error::new("this option does not go with this file").at(option).allowed(allowed)
}

/// Markers as another kind of file.
fn of_markers(args: &ConvertArgs, remarks: Remarks) -> Result<i32, Error> {
    let of_others =
        ["--samples", "--calibration-body", "--mapping", "--skeleton", "--stature", "--static"];
    refuse(args, &of_others, OF_OTHERS)?;
    apart(args)?;
    let order = MarkersOrder {
        markers: args.file.clone(),
        rate_hz: args.rate,
        file: args.out.clone(),
        replace: args.force,
    };
    let signals = Signals::listened()?;
    let report = markers::convert(&order, &Terminal::new(remarks, &signals))?;
    report.notes.iter().for_each(|note| remarks.say(note));
    let (points, frames) = (report.points, report.frames);
    remarks.say(&format!(
        "{frames} of {points} to {}",
        report.written,
        points = counted(points, "point"),
        frames = counted(frames, "frame")
    ));
    Ok(report.outcome.exit_code())
}

/// Labels of one kind as those of the other.
fn of_labels(args: &ConvertArgs, remarks: Remarks) -> Result<i32, Error> {
    let report = labels::convert(&LabelsOrder {
        labels: args.file.clone(),
        clips: args.clips.clone(),
        rate_hz: args.rate,
        output: args.out.clone(),
        replace: args.force,
    })?;
    report.notes.iter().for_each(|note| remarks.say(note));
    remarks.say(&format!(
        "{} of {} to {}",
        counted(report.cuts, "cut"),
        counted(report.clips, "clip"),
        report.written
    ));
    Ok(Outcome::Done.exit_code())
}

/// A capture on the body model.
fn captured(args: &ConvertArgs, remarks: Remarks) -> Result<i32, Error> {
    if args.rate.is_some() && file_kind(&args.file) != FileKind::Amc {
        return Err(misplaced("--rate", "a recording (.mcap), an AMC file, or markers"));
    }
    refuse(args, &["--samples", "--calibration-body"], "a recording (.mcap)")?;
    apart(args)?;
    let report = convert(&ConvertOrder {
        capture: args.file.clone(),
        reading: reading(args),
        mapping: args.mapping.clone(),
        stature_m: args.stature,
        file: args.out.clone(),
        replace: args.force,
    })?;
    report.notes.iter().for_each(|note| remarks.say(note));
    remarks.say(&format!(
        "the torso leans by up to {:.0} deg against the pelvis, the pelvis by up to {:.0} deg against the \
         vertical",
        report.most_torso_lean_deg, report.most_pelvis_lean_deg
    ));
    let (poses, rate_hz) = (report.poses, report.rate_hz);
    remarks.say(&format!(
        "{poses} at {rate_hz} Hz to {}",
        report.written,
        poses = counted(poses, "pose")
    ));
    Ok(Outcome::Done.exit_code())
}
