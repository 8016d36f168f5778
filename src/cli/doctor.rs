//! `doctor`: what on this machine stands between a robot and a smooth cycle. Looks, says, and
//! changes nothing.

use super::output::Untold;
use super::{Deed, Output, Remarks};
use crate::error::Error;
use crate::job::doctor::{User, findings, measured};
use crate::job::finding::Level;
use crate::job::ports::{self, Machine};
use crate::rig::Address;
use clap::Args;
use std::path::PathBuf;

/// Arguments of `doctor`.
#[derive(Debug, Args)]
#[command(after_help = include_str!("help/doctor.txt"))]
pub struct DoctorArgs {
    /// Print the udev rules and nothing else
    #[arg(long)]
    rules: bool,
    /// End with exit code 1 if something is not as it should be
    #[arg(long)]
    strict: bool,
    /// Measure how long answers take on this line: serial:PATH[?baud=N], tcp:HOST:PORT
    #[arg(long, value_name = "BUS")]
    bus: Option<Address>,
    /// Robot whose line --bus is: says the line speed, and which robot a virtual one is
    #[arg(long, value_name = "ROBOT")]
    robot: Option<String>,
    /// Look below this folder instead of /
    #[arg(long, value_name = "DIR", hide = true, default_value = "/")]
    root: PathBuf,
    #[command(flatten)]
    output: Output,
}

/// Runs `doctor`.
///
/// # Errors
/// A report file that exists or cannot be written.
pub fn run(args: &DoctorArgs, _remarks: Remarks) -> Result<i32, Error> {
    if args.rules {
        return match super::print(ports::RULES) {
            Ok(()) | Err(Untold::Unwanted) => Ok(0),
            Err(failed) => Err(failed.into()),
        };
    }
    args.output.check_files(&[])?;
    let machine = Machine::at(&args.root);
    let mut found = ports::survey(&machine);
    found.findings.extend(findings(&machine, &User::current(&machine)));
    if let Some(address) = &args.bus {
        found.findings.push(measured(address, args.robot.as_deref()));
    }
    let unwell = found.findings.iter().any(|finding| finding.level > Level::Ok);
    let code = i32::from(args.strict && unwell);
    Ok(args.output.conclude(&found, &found.text(), Deed::Look, code))
}
