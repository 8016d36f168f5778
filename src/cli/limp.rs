//! `limp`: torque off. The robot falls if nothing holds it, so the command asks.

use super::output::prompt;
use super::{Deed, Output};
use crate::error::Error;
use crate::job::limp::limp;
use crate::rig::Address;
use clap::Args;
use std::io::{BufRead, IsTerminal};

/// Arguments of `limp`.
#[derive(Debug, Args)]
#[command(after_help = "Example: gaitway limp op3 --bus serial:/dev/ttyUSB0")]
pub struct LimpArgs {
    /// Robot by name or path of its file
    robot: String,
    /// Where the robot is: sim, sim:pty, serial:PATH[?baud=N], tcp:HOST:PORT, can:INTERFACE; LINE=BUS
    /// for each line of a robot with several
    #[arg(long, value_name = "BUS", required = true)]
    bus: Vec<Address>,
    /// Do not ask: the robot is supported
    #[arg(long)]
    yes: bool,
    #[command(flatten)]
    output: Output,
}

/// Runs `limp`.
///
/// # Errors
/// No consent, a bus that cannot be opened, joints that do not confirm.
pub fn run(args: &LimpArgs) -> Result<i32, Error> {
    args.output.check_files(&[])?;
    let report = limp(&args.robot, &args.bus, |robot| args.yes || consents(robot))?;
    let text = "torque is off on every joint\n";
    Ok(args.output.conclude(&report, text, Deed::Motion, 0))
}

/// The question whether `robot` may go limp.
pub(super) fn question(robot: &str) -> String {
    format!("{robot} will go limp and fall unless something holds it. Type yes: ")
}

/// Asks it.
fn consents(robot: &str) -> bool {
    let stdin = std::io::stdin();
    if !stdin.is_terminal() {
        return false;
    }
    let _ = prompt(&question(robot));
    let mut answer = String::new();
    stdin.lock().read_line(&mut answer).is_ok() && answer.trim() == "yes"
}
