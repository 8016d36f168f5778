//! `actionlets`: a captured motion as the actionlets it is made of.

use super::reading::ReadingArgs;
use super::signals::Signals;
use super::terminal::Terminal;
use super::{Deed, Output, Remarks};
use crate::action::decompose::REFERENCE_HZ;
use crate::error::{Error, counted};
use crate::job::decompose::{
    DecomposeOrder, DecomposedReport, DofFigures, MOVING_DEG, check_name, decompose,
};
use clap::Args;
use std::fmt::Write;
use std::path::PathBuf;

/// A lean of the pelvis that is lost is said from here on, deg.
const NOTED_LEAN_DEG: f64 = 5.0;

/// Arguments of `actionlets`.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Example: gaitway actionlets dance.bvh -o dance.toml\n\
    then: gaitway play dance.toml --robot op3 --bus sim")]
pub struct ActionletsArgs {
    /// A capture (.bvh, .amc), markers (.c3d, .trc, .csv), or an action
    motion: String,
    /// Action file to write
    #[arg(short, long, value_name = "OUT.toml")]
    output_file: PathBuf,
    /// Root mean square error allowed in every degree of freedom, deg
    #[arg(long, value_name = "DEG", default_value_t = 1.0, value_parser = tolerance,
          allow_negative_numbers = true)]
    tolerance: f64,
    #[command(flatten)]
    reading: ReadingArgs,
    #[command(flatten)]
    output: Output,
}

fn tolerance(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    if (0.001..=45.0).contains(&value) { Ok(value) } else { Err("0.001 to 45 deg".to_owned()) }
}

/// Runs `actionlets`; exit code 3 if a degree of freedom misses the tolerance.
///
/// # Errors
/// If the motion cannot be read, or the file cannot be written.
pub fn run(args: &ActionletsArgs, remarks: Remarks) -> Result<i32, Error> {
    let order = DecomposeOrder {
        motion: args.motion.clone(),
        mapping: args.reading.mapping.clone(),
        reading: args.reading.options(),
        tolerance_deg: args.tolerance,
        file: args.output_file.clone(),
        replace: args.output.force(),
    };
    check_name(&order)?;
    args.output.check_files(&[&Some(order.file.clone())])?;
    let signals = Signals::listened()?;
    let report = decompose(&order, &Terminal::new(remarks, &signals))?;
    Ok(args.output.conclude(
        &report,
        &words(&report, remarks),
        Deed::Work,
        report.outcome.exit_code(),
    ))
}

fn words(report: &DecomposedReport, remarks: Remarks) -> String {
    if remarks.quiet {
        return format!("{}\n", report.written);
    }
    let mut text = format!(
        "{}: {} in actionlets, {:.2} s\n{:24} {:>9} {:>8} {:>9} {:>10} {:>7} {:>11}\n",
        report.outcome.word(),
        report.motion,
        report.duration_s,
        "degree of freedom",
        "range deg",
        "rms deg",
        "noise deg",
        "actionlets",
        "numbers",
        "compression"
    );
    for dof in &report.dofs {
        let _ = writeln!(
            text,
            "{:24} {:>9.1} {:>8.3} {:>9.2} {:>10} {:>7} {:>10.1}x{}",
            dof.name,
            dof.range_deg,
            dof.rms_deg,
            dof.noise_deg,
            dof.actionlets,
            dof.numbers,
            dof.compression,
            if dof.misses_tolerance { "  misses the tolerance" } else { "" }
        );
    }
    for near in &report.near_singular {
        let _ = writeln!(
            text,
            "{} is near its singularity for {:.1} % of the time: flexion and rotation are drawn \
             smoothly, up to {:.1} deg beside the pose",
            near.joint,
            near.share * 100.0,
            near.off_deg
        );
    }
    text.push_str(&missed(report));
    let _ = writeln!(
        text,
        "of {} that move more than {MOVING_DEG} deg: median rms {:.3} deg, {}, {:.1} times \
         fewer than samples at {} Hz\nwritten   {}",
        report.moving,
        report.median_rms_deg,
        counted(report.numbers, "number"),
        report.compression,
        REFERENCE_HZ,
        report.written
    );
    if report.pelvis_lean_lost_deg >= NOTED_LEAN_DEG {
        let _ = writeln!(
            text,
            "note      the pelvis leans by up to {:.0} deg in the capture; an action does not hold that: its \
             pelvis is upright",
            report.pelvis_lean_lost_deg
        );
    }
    text
}

/// What is to be said of degrees of freedom that miss the tolerance.
fn missed(report: &DecomposedReport) -> String {
    let missing: Vec<&DofFigures> = report.dofs.iter().filter(|dof| dof.misses_tolerance).collect();
    let Some(worst) = missing.iter().max_by(|a, b| a.rms_deg.total_cmp(&b.rms_deg)) else {
        return String::new();
    };
    let noisy = missing.iter().filter(|dof| dof.noise_deg > 0.0).count();
    let because = match noisy {
        0 => String::new(),
        _ => format!("; noise, which is not fitted, is a part of it for {noisy} of them"),
    };
    format!(
        "the tolerance of {} deg is missed by {} of {}, most by {}: {:.2} deg\
         {because}\n",
        report.tolerance_deg,
        missing.len(),
        counted(report.dofs.len(), "degree of freedom"),
        worst.name,
        worst.rms_deg
    )
}
