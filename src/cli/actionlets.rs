//! `actionlets`: a captured motion as the actionlets it is made of.

use super::{Deed, Output, Remarks};
use crate::action::decompose::{self, DecomposedMotion, Figure};
use crate::action::{Action, file};
use crate::error::{Error, ErrorKind};
use crate::job::source;
use clap::Args;
use serde::Serialize;
use std::fmt::Write;
use std::path::PathBuf;

/// Degrees of freedom that move less are not counted in the summary, deg.
pub const MOVING_DEG: f64 = 5.0;

/// Arguments of `actionlets`.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Example: gaitway actionlets dance.bvh -o dance.toml\n\
    then: gaitway play dance.toml --robot op3 --bus sim")]
pub struct ActionletsArgs {
    /// A capture (.bvh), or an action
    motion: String,
    /// Action file to write
    #[arg(short, long, value_name = "OUT.toml")]
    output_file: PathBuf,
    /// Root mean square error allowed in every degree of freedom, deg
    #[arg(long, value_name = "DEG", default_value_t = 1.0, value_parser = tolerance,
          allow_negative_numbers = true)]
    tolerance: f64,
    /// File that says which joint of the capture is which body segment (TOML)
    #[arg(long, value_name = "FILE.toml")]
    mapping: Option<PathBuf>,
    #[command(flatten)]
    output: Output,
}

fn tolerance(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    if (0.001..=45.0).contains(&value) { Ok(value) } else { Err("0.001 to 45 deg".to_owned()) }
}

#[derive(Serialize)]
struct DofReport {
    name: &'static str,
    range_deg: f64,
    rms_deg: f64,
    actionlets: usize,
    numbers: usize,
    compression: f64,
}

#[derive(Serialize)]
struct Report {
    outcome: &'static str,
    motion: String,
    duration_s: f64,
    rate_hz: f64,
    tolerance_deg: f64,
    moving: usize,
    median_rms_deg: f64,
    numbers: usize,
    compression: f64,
    dofs: Vec<DofReport>,
    written: String,
}

/// Runs `actionlets`.
///
/// # Errors
/// If the motion cannot be read, or the file cannot be written.
pub fn run(args: &ActionletsArgs, remarks: Remarks) -> Result<i32, Error> {
    if args.output_file.extension().is_none_or(|e| e != "toml") {
        return Err(Error::of(ErrorKind::Unknown, "not a kind of file I can write")
            .at("-o")
            .got(args.output_file.display().to_string())
            .allowed("a name that ends in .toml"));
    }
    args.output.check_files(&[&Some(args.output_file.clone())])?;
    let (capture, _) = source::body_motion(&args.motion, args.mapping.as_deref())?;
    let angles = decompose::angles_of(&capture.poses);
    let found = decompose::motion_of(&angles, capture.rate_hz, args.tolerance.to_radians())?;
    if found.motion.moving().next().is_none() {
        return Err(Error::new("nothing in this motion moves more than the tolerance")
            .at(args.motion.clone())
            .got(format!("{} deg", args.tolerance))
            .remedy("lower --tolerance"));
    }
    let stem = args.output_file.file_stem().and_then(|stem| stem.to_str()).unwrap_or("motion");
    let source = format!("gaitway actionlets {}, {} deg", args.motion, args.tolerance);
    let note = format!("{} poses at {} Hz as actionlets", angles.len(), capture.rate_hz);
    let action = Action::of_motion(&action_name(stem), &note, &source, &found.motion);
    let text = action.to_toml()?;
    // What was written must be what was found.
    file::parse(&text, &args.output_file.display().to_string(), &|_| None)?;
    args.output.write_file(&args.output_file, text.as_bytes())?;
    let report = report(args, capture.rate_hz, &found);
    Ok(args.output.conclude(&report, &words(&report, remarks), Deed::Work, 0))
}

/// A file name as an action's name.
fn action_name(stem: &str) -> String {
    let fits = |c: char| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '-' };
    let name: String = stem.chars().map(fits).collect();
    if name.is_empty() { "motion".to_owned() } else { name }
}

fn report(args: &ActionletsArgs, rate_hz: f64, found: &DecomposedMotion) -> Report {
    let moves = |figure: &&Figure| figure.range_rad.to_degrees() > MOVING_DEG;
    let moving: Vec<&Figure> = found.figures.iter().filter(moves).collect();
    let numbers: usize = moving.iter().map(|figure| figure.numbers).sum();
    let mut rms: Vec<f64> = moving.iter().map(|figure| figure.rms_rad.to_degrees()).collect();
    rms.sort_by(f64::total_cmp);
    let duration_s = found.motion.duration_s();
    let samples = duration_s * decompose::REFERENCE_HZ * moving.len() as f64;
    Report {
        outcome: "done",
        motion: args.motion.clone(),
        duration_s,
        rate_hz,
        tolerance_deg: args.tolerance,
        moving: moving.len(),
        median_rms_deg: rms.get(rms.len() / 2).copied().unwrap_or(0.0),
        numbers,
        compression: samples / numbers.max(1) as f64,
        dofs: found
            .figures
            .iter()
            .map(|figure| DofReport {
                name: figure.dof.name(),
                range_deg: figure.range_rad.to_degrees(),
                rms_deg: figure.rms_rad.to_degrees(),
                actionlets: figure.actionlets,
                numbers: figure.numbers,
                compression: figure.compression,
            })
            .collect(),
        written: args.output_file.display().to_string(),
    }
}

fn words(report: &Report, remarks: Remarks) -> String {
    if remarks.quiet {
        return format!("{}\n", report.written);
    }
    let mut text = format!(
        "done: {} in actionlets, {:.2} s\n{:24} {:>9} {:>8} {:>10} {:>7} {:>11}\n",
        report.motion,
        report.duration_s,
        "degree of freedom",
        "range deg",
        "rms deg",
        "actionlets",
        "numbers",
        "compression"
    );
    for dof in &report.dofs {
        let _ = writeln!(
            text,
            "{:24} {:>9.1} {:>8.3} {:>10} {:>7} {:>10.1}x",
            dof.name, dof.range_deg, dof.rms_deg, dof.actionlets, dof.numbers, dof.compression
        );
    }
    let _ = writeln!(
        text,
        "of {} that move more than {MOVING_DEG} deg: median rms {:.3} deg, {} numbers, {:.1} times \
         fewer than samples at {} Hz\nwritten   {}",
        report.moving,
        report.median_rms_deg,
        report.numbers,
        report.compression,
        decompose::REFERENCE_HZ,
        report.written
    );
    text
}
