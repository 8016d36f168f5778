//! `fit`, as it is typed.

use super::terminal::Terminal;
use super::{Deed, Output, Remarks};
use crate::error::Error;
use crate::job::fit::{
    FitOrder, FitReport, FitSettings, FitSkeleton, HipBy, JointsAt, fit, fit_each, marker_sets,
};
use crate::job::report::counted;
use clap::{Args, ValueEnum};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Diameters of markers, mm.
const DIAMETERS_MM: std::ops::RangeInclusive<f64> = 1.0..=50.0;

/// How the hip joints are placed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Hips {
    /// By the leg length (Davis et al. 1991), as Plug-in Gait does
    PlugInGait,
    /// By the width of the pelvis (Bell et al. 1990)
    Bell,
    /// By width and depth of the pelvis (Harrington et al. 2007)
    Harrington,
}

/// Where joints are taken to be.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Joints {
    /// Moved inwards by the widths of knee, ankle, elbow and wrist
    Centres,
    /// On the markers
    Markers,
    /// Moved inwards in each frame anew, as Plug-in Gait does, whatever that makes of lengths: of virtual markers
    EachFrame,
}

/// Which bones a BVH file has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Bones {
    /// The 13 segments of the body model
    #[value(name = "13")]
    Segments,
    /// The 21 bones of the Human Motion Database: hands, collar bones, hips, a back in two parts
    #[value(name = "21")]
    Bones,
}

/// Arguments of `fit`.
#[derive(Clone, Debug, Args)]
#[command(after_help = include_str!("help/fit.txt"))]
pub struct FitArgs {
    /// Markers in motion (.c3d, .trc, .csm, .csv), several, or a folder of them
    #[arg(required = true)]
    trial: Vec<PathBuf>,
    /// Trial in which the same person stands still [default: the quietest half second of the trial]
    #[arg(long = "static", value_name = "FILE")]
    static_trial: Option<PathBuf>,
    /// File (.bvh, .csv, .mot, .c3d) or folder to write
    #[arg(short, long, value_name = "OUT")]
    output_file: PathBuf,
    /// Marker set, by name or file [default: the one that matches best]
    #[arg(long, value_name = "SET")]
    markers: Option<String>,
    /// Whose markers, where labels name several (`NAME:LASI`)
    #[arg(long, value_name = "NAME")]
    subject: Option<String>,
    /// How the hip joints are placed
    #[arg(long, value_enum, default_value = "plug-in-gait")]
    hips: Hips,
    /// Trial in which a leg swings forwards, sideways and around: its hip joint is what the thigh turns about
    /// (a trial for each leg, or one for both)
    #[arg(long = "hip-motion", value_name = "FILE")]
    hip_trials: Vec<PathBuf>,
    /// Where the other joints are taken to be
    #[arg(long, value_enum, default_value = "centres")]
    joints: Joints,
    /// Bones of a BVH file
    #[arg(long, value_enum, default_value = "13")]
    bones: Bones,
    /// Diameter of the markers, mm
    #[arg(long, value_name = "MM", default_value_t = 14.0, value_parser = diameter,
          allow_negative_numbers = true)]
    marker_diameter: f64,
    /// Frames per second of markers that do not say it
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    rate: Option<f64>,
    #[command(flatten)]
    output: Output,
}

fn diameter(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    let allowed = || format!("{} to {} mm", DIAMETERS_MM.start(), DIAMETERS_MM.end());
    if DIAMETERS_MM.contains(&value) { Ok(value) } else { Err(allowed()) }
}

/// Runs `fit`; exit code 3 if a segment was not seen for a while.
///
/// # Errors
/// No marker set that matches, files that cannot be read or written.
pub fn run(args: &FitArgs, remarks: Remarks) -> Result<i32, Error> {
    let is_file = args.output_file.extension().is_some();
    if args.output.report().is_some_and(|report| is_file && report == args.output_file) {
        return Err(Error::new("two outputs have the same name")
            .at(args.output_file.display().to_string())
            .remedy("give each its own"));
    }
    args.output.check_files(&[])?;
    let set = args.markers.as_deref().filter(|set| set.ends_with(".toml")).map(Path::new);
    let mut inputs: Vec<&Path> = args.trial.iter().map(PathBuf::as_path).collect();
    inputs.extend(args.static_trial.as_deref().into_iter().chain(set));
    inputs.extend(args.hip_trials.iter().map(PathBuf::as_path));
    args.output.check_all_apart(&inputs, &[&args.output_file])?;
    let sets = marker_sets(args.markers.as_deref())?;
    let order = FitOrder {
        trial: args.trial.first().cloned().unwrap_or_default(),
        static_trial: args.static_trial.clone(),
        rate_hz: args.rate,
        settings: FitSettings {
            sets,
            subject: args.subject.clone(),
            hips: match args.hips {
                Hips::PlugInGait => HipBy::PlugInGait,
                Hips::Bell => HipBy::Bell,
                Hips::Harrington => HipBy::Harrington,
            },
            joints: match args.joints {
                Joints::Centres => JointsAt::Centres,
                Joints::Markers => JointsAt::Markers,
                Joints::EachFrame => JointsAt::EachFrame,
            },
            marker_radius_m: args.marker_diameter / 2e3,
            ..FitSettings::default()
        },
        hip_trials: args.hip_trials.clone(),
        skeleton: match args.bones {
            Bones::Segments => FitSkeleton::Segments,
            Bones::Bones => FitSkeleton::Bones,
        },
        output: args.output_file.clone(),
        replace: args.output.force(),
    };
    if args.trial.len() > 1 || order.trial.is_dir() {
        return of_several(args, &order, remarks);
    }
    let report = fit(&order)?;
    let code = report.outcome.exit_code();
    Ok(args.output.conclude(&report, &words(&report, remarks), Deed::Work, code))
}

/// Every trial; exit code 3 also if one could not be fitted.
fn of_several(args: &FitArgs, order: &FitOrder, remarks: Remarks) -> Result<i32, Error> {
    let report = fit_each(order, &args.trial, &Terminal::unheard(remarks))?;
    let mut text = String::new();
    for trial in &report.trials {
        let done = trial.report.as_ref().map(|of| {
            let (word, frames, unseen) = (of.outcome.word(), of.frames, of.unseen.len());
            format!(
                "{word}, {frames}, {unseen} a segment was not seen",
                frames = counted(frames, "frame"),
                unseen = counted(unseen, "time")
            )
        });
        let said = done.or_else(|| trial.error.clone());
        let _ = writeln!(text, "{}: {}", trial.trial, said.unwrap_or_default());
    }
    let code = report.outcome.exit_code();
    Ok(args.output.conclude(&report, &text, Deed::Work, code))
}

fn words(report: &FitReport, remarks: Remarks) -> String {
    let mut text = String::new();
    if !remarks.quiet {
        let of = match report.subject.as_str() {
            "" => String::new(),
            subject => format!(" of {subject}"),
        };
        let (word, frames, hz) = (report.outcome.word(), report.frames, report.rate_hz);
        let (count, set, m) = (report.markers.len(), &report.marker_set, report.stature_m);
        let _ = write!(
            text,
            "{word}: {frames} at {hz} Hz, {count}{of} as {set}",
            count = counted(count, "marker"),
            frames = counted(frames, "frame")
        );
        let _ = writeln!(text, ", stature about {m:.2} m");
        let _ = writeln!(text, "{:16} {:>9} {:>12}", "segment", "length mm", "residual mm");
        for bone in &report.bones {
            let length = bone.length_m.map_or("-".to_owned(), |m| format!("{:.1}", m * 1e3));
            let _ = writeln!(text, "{:16} {length:>9} {:>12.1}", bone.name, bone.residual_m * 1e3);
        }
        for bone in &report.fine_bones {
            let [length, residual] = [bone.length_m, bone.residual_m].map(|of| of * 1e3);
            let (name, unseen) = (&bone.name, bone.unseen_frames);
            let _ = writeln!(text, "{name:16} {length:>9.1} {residual:>12.1} {unseen:>9}");
        }
        let _ =
            writeln!(text, "{:16} {:>9} {:>12} {:>9}", "marker", "rms mm", "worst mm", "missing");
        for marker in &report.markers {
            let [rms, worst] = [marker.residual_m, marker.worst_m].map(|of| of * 1e3);
            let (name, missing) = (&marker.name, marker.missing_frames);
            let _ = writeln!(text, "{name:16} {rms:>9.1} {worst:>12.1} {missing:>9}");
        }
        for gap in &report.unseen {
            let (bone, from_s, to_s) = (&gap.bone, gap.start_s, gap.end_s);
            let _ = writeln!(text, "{bone} is not seen from {from_s:.2} to {to_s:.2} s: filled in");
        }
        for note in &report.notes {
            let _ = writeln!(text, "note      {note}");
        }
    }
    for file in &report.written {
        let _ = writeln!(text, "written   {file}");
    }
    text
}
