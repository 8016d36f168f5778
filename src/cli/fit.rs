//! `fit`, as it is typed.

use super::{Deed, Output, Remarks};
use crate::error::Error;
use crate::job::fit::{FitOrder, FitReport, FitSettings, HipBy, JointsAt, MarkerSet, fit};
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
}

/// Arguments of `fit`.
#[derive(Clone, Debug, Args)]
#[command(after_help = "\
A body of 13 segments is laid over the markers of every frame. A static trial, in which the person stands
upright and still, shows where markers sit, how long bones are, and what is zero of every joint. Without
one the trial calibrates itself from its quietest half second.

OUT.bvh   the skeleton in motion, with the bones of the person
OUT.csv   the 22 joint angles, where the pelvis is and how it is turned
OUT.mot   the joint angles by the names of OpenSim's models
DIR       all of it: TRIAL.bvh, .csv, .mot, and TRIAL.segments.csv with the orientation of each segment

Marker sets: plug-in-gait, plug-in-gait-lower, cmu-41, baseline (OptiTrack), or a file of your own (TOML:
schema = 1, name, title, needs, has, and [aliases] of places, by the names of Plug-in Gait). Widths are read from the file (KneeWidth,
AnkleWidth, ...) or else estimated, which is said.

Example: gaitway fit walk.c3d --static static.c3d -o walk.bvh
then:    gaitway play walk.bvh --robot op3 --bus sim")]
pub struct FitArgs {
    /// Markers in motion (.c3d, .trc, .csv)
    trial: PathBuf,
    /// Trial in which the same person stands still [default: the quietest half second of the trial]
    #[arg(long = "static", value_name = "FILE")]
    static_trial: Option<PathBuf>,
    /// File (.bvh, .csv, .mot) or folder to write
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
    args.output.check_files(&[])?;
    args.output.check_apart(&args.trial, &[&args.output_file])?;
    let sets = match &args.markers {
        Some(name) if name.ends_with(".toml") => {
            let text = gaitway_profiles::read_text(Path::new(name))?;
            vec![MarkerSet::parse(&text).map_err(|error| error.at(name.clone()))?]
        }
        Some(name) => vec![MarkerSet::named(name).map_err(|error| error.at("--markers"))?],
        None => MarkerSet::shipped(),
    };
    let report = fit(&FitOrder {
        trial: args.trial.clone(),
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
            },
            marker_radius_m: args.marker_diameter / 2e3,
            ..FitSettings::default()
        },
        hip_trials: args.hip_trials.clone(),
        output: args.output_file.clone(),
        replace: args.output.force(),
    })?;
    let code = report.outcome.exit_code();
    Ok(args.output.conclude(&report, &words(&report, remarks), Deed::Work, code))
}

fn words(report: &FitReport, remarks: Remarks) -> String {
    let mut text = String::new();
    if !remarks.quiet {
        let of = match report.subject.as_str() {
            "" => String::new(),
            subject => format!(" of {subject}"),
        };
        let _ = writeln!(
            text,
            "{}: {} frames at {} Hz, {} markers{of} as {}, stature about {:.2} m\n{:16} {:>9} {:>12}",
            report.outcome.word(),
            report.frames,
            report.rate_hz,
            report.markers.len(),
            report.marker_set,
            report.stature_m,
            "segment",
            "length mm",
            "residual mm"
        );
        for bone in &report.bones {
            let length = bone.length_m.map_or("-".to_owned(), |m| format!("{:.1}", m * 1e3));
            let _ = writeln!(text, "{:16} {length:>9} {:>12.1}", bone.name, bone.residual_m * 1e3);
        }
        let _ =
            writeln!(text, "{:16} {:>9} {:>12} {:>9}", "marker", "rms mm", "worst mm", "missing");
        for marker in &report.markers {
            let _ = writeln!(
                text,
                "{:16} {:>9.1} {:>12.1} {:>9}",
                marker.name,
                marker.residual_m * 1e3,
                marker.worst_m * 1e3,
                marker.missing_frames
            );
        }
        for gap in &report.unseen {
            let _ = writeln!(
                text,
                "{} is not seen from {:.2} to {:.2} s: filled in",
                gap.bone, gap.start_s, gap.end_s
            );
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
