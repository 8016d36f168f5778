//! `simulate`: the virtual robot as a device that other programs open.

pub mod imus;

use super::Remarks;
use super::output::Untold;
use super::signals::Signals;
use super::viewing::ViewArg;
use crate::error::Error;
use crate::job::page::live::Shows;
use crate::job::report::counted;
use crate::job::simulate::robot::{Rule, SimulateOrder, Verdict, VirtualRobot};
use crate::view::live::{LiveFrame, LiveView};
use clap::Args;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Violations listed at the end.
const MOST_SHOWN: usize = 20;
/// How often struck faults and doors that moved are looked for.
const LOOK: Duration = Duration::from_millis(50);
/// The same, where a program that has it in hand may be waiting.
const SHORT_LOOK: Duration = Duration::from_millis(2);
/// Struck faults told at one look.
const MOST_TOLD: usize = 100;

/// Arguments of `simulate`.
#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
#[command(after_help = include_str!("help/simulate.txt"))]
pub struct SimulateArgs {
    #[command(subcommand)]
    other: Option<Other>,
    /// Robot by name or path of its file
    #[arg(required_unless_present = "servo", conflicts_with = "servo")]
    robot: Option<String>,
    /// Put these servos or CAN actuators on a bench instead of a robot: a profile and IDs (again for
    /// other models)
    #[arg(long, value_name = "MODEL:IDS")]
    servo: Vec<String>,
    /// Speed of the bench's serial line [default: that of its servos as they leave the factory]
    #[arg(long, value_name = "N", requires = "servo", conflicts_with = "robot")]
    baud: Option<u32>,
    /// Make this link to the pseudo-terminal (for several lines: LINK-NAME)
    #[arg(long, value_name = "LINK")]
    pty: Option<PathBuf>,
    /// Listen on this TCP port of the loopback interface instead (for several lines: PORT, PORT+1,
    /// ...; 0: the system chooses)
    #[arg(long, value_name = "PORT", conflicts_with = "pty")]
    tcp: Option<u16>,
    /// Put a CAN line on this interface of the system (of several CAN lines: NAME=INTERFACE, again
    /// for each); `ip link add vcan0 type vcan` makes one
    #[arg(long, value_name = "INTERFACE")]
    can: Vec<String>,
    /// Let programs of this user reach past the lines, with lines of JSON (see sim/README.md): through a
    /// Unix socket at PATH, or over standard input and output, whose end then ends the simulator
    #[arg(long, value_name = "PATH|stdin")]
    control: Option<PathBuf>,
    /// Seed of everything random [default: that of the script, or 0]
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Inject the faults of this script, which also sets behaviour that the manuals leave open; its keys
    /// are in sim/README.md
    #[arg(long, value_name = "FILE.toml")]
    faults: Option<PathBuf>,
    /// Put the lines behind this USB adapter (see `gaitway profile list`)
    #[arg(long, value_name = "NAME")]
    adapter: Option<String>,
    /// Set the adapter's latency timer, as root may for a real one [default: as it is plugged in, 16 ms
    /// of one by FTDI]
    #[arg(long, value_name = "MS", requires = "adapter")]
    latency_timer: Option<f64>,
    /// Bytes take no time on the line
    #[arg(long)]
    no_line_timing: bool,
    /// It has weight: its servos move the body of its file, on a floor if it is none that is screwed down. It is let go
    /// when torque has been on for 0.2 s
    #[arg(long)]
    physics: bool,
    /// With --physics: it hangs on a stand
    #[arg(long, requires = "physics")]
    hang: bool,
    /// Do not report clients that write EEPROM registers
    #[arg(long)]
    permit_eeprom: bool,
    /// Do not report at the end what the referee saw
    #[arg(long)]
    no_referee: bool,
    #[command(flatten)]
    view: ViewArg,
}

/// What else than a robot can be simulated.
#[derive(Debug, clap::Subcommand)]
enum Other {
    /// A person who wears virtual inertial sensors
    Imus(Box<imus::ImusArgs>),
}

/// Runs `simulate` until a signal comes.
///
/// # Errors
/// As [`VirtualRobot::open`].
pub fn run(args: &SimulateArgs, remarks: Remarks) -> Result<i32, Error> {
    if let Some(Other::Imus(args)) = &args.other {
        return imus::run(args, remarks);
    }
    let signals = Signals::listen().map_err(|e| Error::new(format!("no signals: {e}")))?;
    let mut robot = VirtualRobot::open(&SimulateOrder {
        robot: args.robot.clone(),
        servos: args.servo.clone(),
        baud_bps: args.baud,
        link: args.pty.clone(),
        tcp_port: args.tcp,
        can: args.can.clone(),
        seed: args.seed,
        faults: args.faults.clone(),
        adapter: args.adapter.clone(),
        latency_timer_s: args.latency_timer.map(|ms| ms * 1e-3),
        no_line_timing: args.no_line_timing,
        permit_eeprom: args.permit_eeprom,
        physics: args.physics,
        hangs: args.hang,
    })?;
    let over_stdin = args.control.as_deref() == Some(Path::new("stdin"));
    // Where the lines are says that all is there, a socket too; replies come after it.
    if let Some(path) = args.control.as_deref().filter(|_| !over_stdin) {
        robot.control_at(path)?;
    }
    let is_one = robot.lines().count() == 1;
    for (name, place) in robot.lines() {
        let place = place.unwrap_or_default();
        tell(&if is_one { format!("{place}\n") } else { format!("{place} {name}\n") })?;
    }
    let reached = args.pty.as_ref().map_or_else(String::new, |l| format!(" at {}", l.display()));
    remarks.say(&format!(
        "virtual {} with {}{reached}; Ctrl-C ends it",
        robot.robot().name,
        counted(robot.robot().joints.len(), "servo")
    ));
    robot.clock_words().into_iter().for_each(|words| remarks.say(words));
    if over_stdin {
        robot.control_over(std::io::stdin(), |text| super::output::print_json(text).is_ok())?;
    }
    // Of a file the path, of a name the spelling that is usual.
    let named = args.robot.as_deref().map(|named| match named.ends_with(".toml") {
        true => named.to_owned(),
        false => robot.robot().name.clone(),
    });
    let view = args.view.open(named.as_deref(), &[], "simulated", Shows::default())?;
    let look = if args.control.is_some() { SHORT_LOOK } else { LOOK };
    let is_over = |robot: &VirtualRobot| {
        let wants_to_stop = view.as_ref().is_some_and(LiveView::wants_to_stop);
        signals.first().is_some() || robot.control_has_ended() || wants_to_stop
    };
    while !is_over(&robot) {
        std::thread::sleep(look);
        if let Some(view) = &view {
            let (time_s, joints_rad) = robot.joints();
            let each = joints_rad.into_iter().map(|present_rad| [f64::NAN, present_rad]);
            view.tell(&LiveFrame::of(time_s, each));
        }
        tell_struck(&mut robot, remarks);
        for (name, place) in robot.moved() {
            remarks.say(&match place {
                Some(place) => format!("line {name} is at {place} now"),
                None => format!("line {name} is gone"),
            });
        }
    }
    robot.close();
    tell_struck(&mut robot, remarks);
    if robot.struck_count() > 0 {
        remarks.say(&format!("faults: {} struck", robot.struck_count()));
    }
    if !args.no_referee {
        tell_verdict(&robot.verdict(), remarks);
    }
    Ok(0)
}

/// What the referee saw. A foreign client owes it nothing: this is said, and is no failure.
fn tell_verdict(verdict: &Verdict, remarks: Remarks) {
    for violation in verdict.violations.iter().take(MOST_SHOWN) {
        remarks.say(&match violation.rule.of_a_careful_host() {
            Some(habit) => format!("a careful host {habit}: {violation}"),
            None => format!("referee: {violation}"),
        });
    }
    for &rule in &Rule::ALL {
        if verdict.count(rule) > 0 && rule.of_a_careful_host().is_none() {
            remarks.say(&format!("{}: {}", rule.code(), rule.words()));
        }
    }
    let careless = Rule::ALL.iter().filter(|rule| rule.of_a_careful_host().is_some());
    let careless: u64 = careless.map(|&rule| verdict.count(rule)).sum();
    let rules = match (verdict.violation_count - careless, careless) {
        (0, 0) => "no rule broken".to_owned(),
        (0, careless) => format!(
            "{careless} not as a careful host does it",
            careless = counted(careless, "time")
        ),
        (broken, 0) => format!("{} broken", counted(broken, "rule")),
        (broken, careless) => {
            format!(
                "{} broken, {careless} not as a careful host does it",
                counted(broken, "rule"),
                careless = counted(careless, "time")
            )
        }
    };
    remarks.say(&format!("referee: {rules}; {} written", counted(verdict.goals, "goal")));
}

/// Tells where something is to be reached: all that this command has to tell.
fn tell(place: &str) -> Result<(), Error> {
    match super::print(place) {
        Ok(()) | Err(Untold::Unwanted) => Ok(()),
        Err(failed) => Err(failed.into()),
    }
}

fn tell_struck(robot: &mut VirtualRobot, remarks: Remarks) {
    robot.fallen().iter().for_each(|fall| remarks.say(&format!("fell at {fall}")));
    let struck = robot.struck();
    for fault in struck.iter().take(MOST_TOLD) {
        remarks.say(&format!("fault at {fault}"));
    }
    if struck.len() > MOST_TOLD {
        remarks.say(&format!("and {} more", counted(struck.len() - MOST_TOLD, "fault")));
    }
}
