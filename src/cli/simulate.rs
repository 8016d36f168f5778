//! `simulate`: the virtual robot as a device that other programs open.

use super::Remarks;
use super::signals::Signals;
use crate::error::Error;
use crate::robot::Robot;
use clap::Args;
use gaitway_sim::{Door, Options, World};
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// Violations listed at the end.
const MOST_SHOWN: usize = 20;

/// Arguments of `simulate`.
#[derive(Debug, Args)]
#[command(after_help = "Example: gaitway simulate op3 --pty /tmp/op3\n\
    then, in another terminal: gaitway play walk --robot op3 --bus serial:/tmp/op3")]
pub struct SimulateArgs {
    /// Robot by name or path of its file
    robot: String,
    /// Make this link to the pseudo-terminal (for several lines: LINK-NAME)
    #[arg(long, value_name = "LINK")]
    pty: Option<PathBuf>,
    /// Seed of everything random
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Let bytes take no time on the line
    #[arg(long)]
    no_line_timing: bool,
    /// Let clients write EEPROM registers without being reported
    #[arg(long)]
    permit_eeprom: bool,
}

/// Runs `simulate` until a signal comes.
///
/// # Errors
/// An unknown robot, or a pseudo-terminal that cannot be made.
pub fn run(args: &SimulateArgs, remarks: Remarks) -> Result<i32, Error> {
    let signals = Signals::listen().map_err(|e| Error::new(format!("no signals: {e}")))?;
    let robot = Robot::load(&args.robot)?;
    let options = Options {
        seed: args.seed,
        line_timing: !args.no_line_timing,
        permit_eeprom: args.permit_eeprom,
        ..Options::default()
    };
    let world = World::new(&robot.file, options)
        .map_err(|e| Error::new(e.to_string()).at(format!("robot {}", robot.name)))?;
    let world = Arc::new(Mutex::new(world));
    let mut doors = Vec::new();
    for (line, facts) in robot.lines.iter().enumerate() {
        let link = args.pty.as_ref().map(|link| match robot.lines.len() {
            1 => link.clone(),
            _ => PathBuf::from(format!("{}-{}", link.display(), facts.name)),
        });
        let door = Door::open(Arc::clone(&world), line, link.as_deref()).map_err(|e| {
            Error::new("cannot open the pseudo-terminal")
                .at(link.map_or_else(|| facts.name.clone(), |link| link.display().to_string()))
                .got(e.to_string())
        })?;
        super::print(&format!("{}\n", door.path().display()));
        doors.push(door);
    }
    let reached = args.pty.as_ref().map_or_else(String::new, |l| format!(" at {}", l.display()));
    remarks.say(&format!(
        "virtual {} with {} servos{reached}; Ctrl-C ends it",
        robot.name,
        robot.joints.len()
    ));
    while signals.first().is_none() {
        std::thread::sleep(Duration::from_millis(50));
    }
    drop(doors);
    let verdict = world.lock().unwrap_or_else(PoisonError::into_inner).verdict();
    // A foreign client owes the referee nothing: what it saw is said, and is no failure.
    for violation in verdict.violations.iter().take(MOST_SHOWN) {
        remarks.say(&format!("referee: {violation}"));
    }
    remarks.say(&match verdict.violation_count {
        0 => format!("referee: no rule broken; {} goals written", verdict.goals),
        n => format!("referee: {n} rules broken in all; {} goals written", verdict.goals),
    });
    Ok(0)
}
