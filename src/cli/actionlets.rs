//! `actionlets`: a captured motion as the actionlets it is made of.

use super::{Deed, Output, Remarks};
use crate::action::decompose::REFERENCE_HZ;
use crate::error::Error;
use crate::job::decompose::{DecomposeOrder, DecomposedReport, MOVING_DEG, check_name, decompose};
use clap::Args;
use std::fmt::Write;
use std::path::PathBuf;

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

/// Runs `actionlets`.
///
/// # Errors
/// If the motion cannot be read, or the file cannot be written.
pub fn run(args: &ActionletsArgs, remarks: Remarks) -> Result<i32, Error> {
    let order = DecomposeOrder {
        motion: args.motion.clone(),
        mapping: args.mapping.clone(),
        tolerance_deg: args.tolerance,
        file: args.output_file.clone(),
        replace: args.output.force(),
    };
    check_name(&order)?;
    args.output.check_files(&[&Some(order.file.clone())])?;
    let report = decompose(&order)?;
    Ok(args.output.conclude(&report, &words(&report, remarks), Deed::Work, 0))
}

fn words(report: &DecomposedReport, remarks: Remarks) -> String {
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
        REFERENCE_HZ,
        report.written
    );
    text
}
