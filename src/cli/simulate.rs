//! `simulate`: the virtual robot as a device that other programs open.

pub mod imus;

use super::Remarks;
use super::output::Untold;
use super::signals::Signals;
use crate::error::{Error, ErrorKind};
use crate::port::can_bridge::CanBridge;
use clap::Args;
use gaitway_profiles::Robot;
use gaitway_sim::{Door, Options, Rule, Script, ScriptError, SimError, Verdict, World};
use std::collections::BTreeMap;
use std::net::{Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// Violations listed at the end.
const MOST_SHOWN: usize = 20;
/// How often struck faults and doors that moved are looked for.
const LOOK: Duration = Duration::from_millis(50);
/// Struck faults told at one look.
const MOST_TOLD: usize = 100;

/// Arguments of `simulate`.
#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
#[command(after_help = "Each line of the robot is a terminal or port of its own. Standard output \
    begins with one line for each: its path, tcp:ADDRESS or can:INTERFACE, and the line's name if \
    there are several. A CAN line is behind a USB-CAN adapter that speaks slcan (Lawicel), unless \
    --can puts it on an interface of the system.\n\n\
    Example: gaitway simulate op3 --pty /tmp/op3\n\
    then, in another terminal: gaitway play walk --robot op3 --bus serial:/tmp/op3\n\n\
    Time is real. A motion is stopped if this machine is too busy for it, as on a real line; the time of\n\
    play --bus sim:pty waits for this machine instead.")]
pub struct SimulateArgs {
    #[command(subcommand)]
    other: Option<Other>,
    /// Robot by name or path of its file
    #[arg(required = true)]
    robot: Option<String>,
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
    /// Bytes take no time on the line
    #[arg(long)]
    no_line_timing: bool,
    /// Do not report clients that write EEPROM registers
    #[arg(long)]
    permit_eeprom: bool,
    /// Do not report at the end what the referee saw
    #[arg(long)]
    no_referee: bool,
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
/// An unknown robot or adapter, a fault script that says something wrong, or a terminal or port
/// that cannot be had.
pub fn run(args: &SimulateArgs, remarks: Remarks) -> Result<i32, Error> {
    if let Some(Other::Imus(args)) = &args.other {
        return imus::run(args, remarks);
    }
    let signals = Signals::listen().map_err(|e| Error::new(format!("no signals: {e}")))?;
    // Any robot file: the virtual servos speak more protocols than the driver needs to.
    let robot = gaitway_profiles::robot(args.robot.as_deref().unwrap_or_default())?;
    let world = World::new(&robot, options(args)?).map_err(|e| unfit(&robot, &e))?;
    let world = Arc::new(Mutex::new(world));
    let mut doors = open_doors(args, &robot, &world)?;
    let reached = args.pty.as_ref().map_or_else(String::new, |l| format!(" at {}", l.display()));
    remarks.say(&format!(
        "virtual {} with {} servos{reached}; Ctrl-C ends it",
        robot.name,
        robot.joints.len()
    ));
    while signals.first().is_none() {
        std::thread::sleep(LOOK);
        tell_struck(&world, remarks);
        for (name, entrance, place) in &mut doors {
            let now = entrance.place();
            if now != *place {
                remarks.say(&match &now {
                    Some(place) => format!("line {name} is at {place} now"),
                    None => format!("line {name} is gone"),
                });
                *place = now;
            }
        }
    }
    drop(doors);
    tell_struck(&world, remarks);
    let world = world.lock().unwrap_or_else(PoisonError::into_inner);
    if world.struck_count() > 0 {
        remarks.say(&format!("faults: {} struck", world.struck_count()));
    }
    if !args.no_referee {
        tell_verdict(&world.verdict(), remarks);
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
    let careless = Rule::ALL.iter().filter(|rule| rule.of_a_careful_host().is_some());
    let careless: u64 = careless.map(|&rule| verdict.count(rule)).sum();
    let rules = match (verdict.violation_count - careless, careless) {
        (0, 0) => "no rule broken".to_owned(),
        (0, careless) => format!("{careless} times not as a careful host does it"),
        (broken, 0) => format!("{broken} rules broken"),
        (broken, careless) => {
            format!("{broken} rules broken, {careless} times not as a careful host does it")
        }
    };
    remarks.say(&format!("referee: {rules}; {} goals written", verdict.goals));
}

/// Why a robot file and a fault script make no world.
fn unfit(robot: &Robot, error: &SimError) -> Error {
    let said = Error::new(error.to_string()).at(format!("robot {}", robot.name));
    let names = |names: Vec<&str>| names.join(", ");
    match error {
        SimError::UnknownJoint(_) => {
            said.allowed(names(robot.joints.iter().map(|joint| joint.name.as_str()).collect()))
        }
        SimError::UnknownLine(_) => {
            said.allowed(names(robot.lines.iter().map(|line| line.name.as_str()).collect()))
        }
        _ => said,
    }
}

fn options(args: &SimulateArgs) -> Result<Options, Error> {
    let script = match &args.faults {
        Some(path) => read_script(path)?,
        None => Script::default(),
    };
    let mut options = script.apply(Options {
        line_timing: !args.no_line_timing,
        permit_eeprom: args.permit_eeprom,
        ..Options::default()
    });
    options.seed = args.seed.unwrap_or(options.seed);
    match &args.adapter {
        Some(name) => {
            let known: Vec<&str> = gaitway_profiles::adapter_names().collect();
            let known = known.join(", ");
            let unknown = |e: SimError| Error::new(e.to_string()).at("--adapter").allowed(known);
            options.behind(name).map_err(unknown)
        }
        None => Ok(options),
    }
}

fn read_script(path: &Path) -> Result<Script, Error> {
    let file = path.display().to_string();
    let text = gaitway_profiles::read_text(path)?;
    Script::parse(&text).map_err(|ScriptError { at, got, allowed }| {
        Error::new("the fault script has errors")
            .at(format!("{file}, {at}"))
            .got(got)
            .allowed(allowed)
    })
}

/// A way in to a line.
enum Entrance {
    Door(Door),
    Can(CanBridge),
}

impl Entrance {
    /// What programs can open now; nothing while the adapter is pulled out.
    fn place(&self) -> Option<String> {
        match self {
            Entrance::Door(door) => door.current_path().map(|path| path.display().to_string()),
            Entrance::Can(bridge) => {
                bridge.lost().is_none().then(|| format!("can:{}", bridge.name()))
            }
        }
    }
}

/// Each line's name, the way in, and where that was seen last.
type Doors = Vec<(String, Entrance, Option<String>)>;

fn open_doors(
    args: &SimulateArgs,
    robot: &Robot,
    world: &Arc<Mutex<World>>,
) -> Result<Doors, Error> {
    let interfaces = interfaces(&args.can, robot)?;
    let several = robot.lines.len() > 1;
    let mut doors = Vec::new();
    for (line, facts) in robot.lines.iter().enumerate() {
        let entrance = match (interfaces.get(&line), args.tcp) {
            (Some(interface), _) => {
                Entrance::Can(CanBridge::open(Arc::clone(world), line, interface).map_err(|e| {
                    Error::new("cannot put the line on this interface")
                        .at(format!("--can, line {}", facts.name))
                        .got(e.to_string())
                        .remedy("ip link add vcan0 type vcan && ip link set vcan0 mtu 72 up")
                })?)
            }
            (None, Some(port)) => Entrance::Door(open_tcp(port, line, world)?),
            (None, None) => Entrance::Door(open_pty(args, several, line, &facts.name, world)?),
        };
        let place = entrance.place();
        let path = place.as_deref().unwrap_or_default();
        tell(&match several {
            false => format!("{path}\n"),
            true => format!("{path} {}\n", facts.name),
        })?;
        doors.push((facts.name.clone(), entrance, place));
    }
    Ok(doors)
}

/// Tells where something is to be reached: all that this command has to tell.
fn tell(place: &str) -> Result<(), Error> {
    match super::print(place) {
        Ok(()) | Err(Untold::Unwanted) => Ok(()),
        Err(failed) => Err(failed.into()),
    }
}

/// Which interface each CAN line goes to, by its number.
fn interfaces(given: &[String], robot: &Robot) -> Result<BTreeMap<usize, String>, Error> {
    let lines = robot.lines.iter().enumerate().filter(|(_, line)| line.can().is_some());
    let lines: Vec<_> = lines.map(|(k, line)| (k, line.name.as_str())).collect();
    let refuse = |what: &str, got: &str| {
        let names: Vec<_> = lines.iter().map(|(_, name)| *name).collect();
        Error::new(what).at("--can").got(got.to_string()).allowed(match names.as_slice() {
            [] => "a robot with a CAN line".to_string(),
            names => format!("NAME=INTERFACE with one of {}", names.join(", ")),
        })
    };
    let mut interfaces = BTreeMap::new();
    for text in given {
        let (line, interface) = match (text.split_once('='), lines.as_slice()) {
            (None, &[(line, _)]) => (line, text.as_str()),
            (None, _) => return Err(refuse("which CAN line is meant?", text)),
            (Some((name, interface)), _) => {
                let known = lines.iter().find(|(_, known)| *known == name);
                let (line, _) = known.ok_or_else(|| refuse("there is no such CAN line", name))?;
                (*line, interface)
            }
        };
        if interfaces.insert(line, interface.to_string()).is_some() {
            return Err(refuse("a CAN line goes to one interface", text));
        }
    }
    Ok(interfaces)
}

fn open_pty(
    args: &SimulateArgs,
    several: bool,
    line: usize,
    name: &str,
    world: &Arc<Mutex<World>>,
) -> Result<Door, Error> {
    let link = args.pty.as_ref().map(|link| match several {
        false => link.clone(),
        true => PathBuf::from(format!("{}-{name}", link.display())),
    });
    Door::open(Arc::clone(world), line, link.as_deref()).map_err(|e| {
        Error::new("cannot open the pseudo-terminal")
            .at(link.map_or(name.to_string(), |link| link.display().to_string()))
            .got(e.to_string())
            .remedy("choose another name for the link, in a folder you may write to")
    })
}

fn open_tcp(first: u16, line: usize, world: &Arc<Mutex<World>>) -> Result<Door, Error> {
    let port = match first {
        0 => Some(0),
        first => u16::try_from(line).ok().and_then(|line| first.checked_add(line)),
    };
    let port = port.ok_or_else(|| {
        Error::new("there are not as many ports as the robot has lines")
            .at("--tcp")
            .got(first.to_string())
    })?;
    let address = SocketAddr::from((Ipv4Addr::LOCALHOST, port));
    Door::open_tcp(Arc::clone(world), line, address).map_err(|e| {
        Error::of(ErrorKind::Io, "cannot listen")
            .at("--tcp")
            .got(e.to_string())
            .remedy("take another port, or 0: then the system chooses a free one")
    })
}

fn tell_struck(world: &Mutex<World>, remarks: Remarks) {
    let struck = world.lock().unwrap_or_else(PoisonError::into_inner).take_struck();
    for fault in struck.iter().take(MOST_TOLD) {
        remarks.say(&format!("fault at {fault}"));
    }
    if struck.len() > MOST_TOLD {
        remarks.say(&format!("and {} faults more", struck.len() - MOST_TOLD));
    }
}
