//! A virtual robot that other programs open: each of its lines behind a terminal, a port or a CAN
//! interface of its own, in real time.

use super::script;
use crate::corpus::store::check_outside;
use crate::error::{Error, ErrorKind};
use crate::job::weight::{self, Fall, Witness};
use crate::port::can_bridge::CanBridge;
use gaitway_profiles::Robot;
use gaitway_sim::control::{ControlPipe, ControlSocket, Places, SocketError, Surroundings};
use gaitway_sim::{BenchError, BenchServos, Door, Fault, Options, Script, SimError, World};
pub use gaitway_sim::{Rule, Verdict};
use std::collections::BTreeMap;
use std::io::Read;
use std::net::{Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Which robot, and where it is reached.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SimulateOrder {
    /// Robot by name, or path of its file; of a name underscores are taken for hyphens. Without one
    /// there is a bench of `servos`.
    pub robot: Option<String>,
    /// Servos of a bench, each `MODEL:IDS`.
    pub servos: Vec<String>,
    /// Speed of a bench's serial line; `None`: that of its servos as they leave the factory.
    pub baud_bps: Option<u32>,
    /// Make this link to the pseudo-terminal; for several lines `LINK-NAME`.
    pub link: Option<PathBuf>,
    /// Listen on this TCP port of the loopback interface instead of a pseudo-terminal; for several
    /// lines on those behind it. 0: the system chooses.
    pub tcp_port: Option<u16>,
    /// Interfaces of the system for CAN lines: `INTERFACE`, or `NAME=INTERFACE` of several.
    pub can: Vec<String>,
    /// Seed of everything random; `None`: that of the script, or 0.
    pub seed: Option<u64>,
    /// A script of faults, which also sets behaviour that the manuals leave open.
    pub faults: Option<PathBuf>,
    /// The USB adapter that the lines are behind.
    pub adapter: Option<String>,
    /// What its latency timer is set to, s; `None`: as it is plugged in.
    pub latency_timer_s: Option<f64>,
    /// Bytes take no time on the line.
    pub no_line_timing: bool,
    /// Clients may write EEPROM registers: the referee says nothing.
    pub permit_eeprom: bool,
    /// It has weight, and may fall.
    pub physics: bool,
    /// With weight: it hangs on a stand.
    pub hangs: bool,
}

/// A virtual robot whose lines are open.
pub struct VirtualRobot {
    robot: Robot,
    world: Arc<Mutex<World>>,
    doors: Vec<Way>,
    places: Places,
    sockets: Vec<ControlSocket>,
    pipe: Option<ControlPipe>,
    /// Of one with weight: what became of it, and the fall that was told.
    weight: Option<(Witness, Option<Fall>)>,
    /// It has a script of faults.
    tells_of_faults: bool,
}

/// The way in to a line.
struct Way {
    line: String,
    entrance: Entrance,
    /// Where it was seen last.
    place: Option<String>,
}

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

impl VirtualRobot {
    /// Opens every line.
    ///
    /// # Errors
    /// An unknown robot, servo or adapter, servos that cannot share a line, a fault script with errors,
    /// or a terminal, port or interface that cannot be had.
    pub fn open(order: &SimulateOrder) -> Result<Self, Error> {
        // Any robot file: the virtual servos speak more protocols than the driver needs to.
        let robot = robot_of(order)?;
        let mut world = World::new(&robot, options(order)?).map_err(|e| unfit(&robot, &e))?;
        let witness = order.physics.then(|| weight::give(&mut world, &robot, order.hangs));
        let witness = witness.transpose()?;
        let world = Arc::new(Mutex::new(world));
        let doors = open_doors(order, &robot, &world)?;
        let mut opened = Self {
            robot,
            world,
            doors,
            places: Places::default(),
            sockets: Vec::new(),
            pipe: None,
            weight: witness.map(|witness| (witness, None)),
            tells_of_faults: order.faults.is_some(),
        };
        opened.tell_places();
        Ok(opened)
    }

    /// What it is.
    #[must_use]
    pub const fn robot(&self) -> &Robot {
        &self.robot
    }

    /// Each line's name, and where it was reached when it was last looked at: a path, `tcp:ADDRESS`
    /// or `can:INTERFACE`; nothing while its adapter is pulled out.
    pub fn lines(&self) -> impl Iterator<Item = (&str, Option<&str>)> {
        self.doors.iter().map(|way| (way.line.as_str(), way.place.as_deref()))
    }

    /// Lines that are elsewhere since it was last looked: as [`Self::lines`].
    pub fn moved(&mut self) -> Vec<(String, Option<String>)> {
        let mut moved = Vec::new();
        for way in &mut self.doors {
            let now = way.entrance.place();
            if now != way.place {
                moved.push((way.line.clone(), now.clone()));
                way.place = now;
            }
        }
        if !moved.is_empty() {
            self.tell_places();
        }
        moved
    }

    fn tell_places(&mut self) {
        self.places.set(self.doors.iter().map(|way| way.place.clone()).collect());
    }

    fn surroundings(&self) -> Surroundings {
        Surroundings { robot: self.robot.name.clone(), places: self.places.clone() }
    }

    /// Opens a control channel: a Unix socket at `path` that is this user's alone. What is said there
    /// reaches this virtual robot, and nothing else.
    ///
    /// # Errors
    /// Something is there already, or the system gives no socket.
    pub fn control_at(&mut self, path: &Path) -> Result<(), Error> {
        let world = Arc::clone(&self.world);
        let socket = ControlSocket::listen(world, self.surroundings(), path).map_err(|e| {
            let said = Error::of(ErrorKind::Io, "cannot open the control channel")
                .at(format!("--control {}", path.display()))
                .got(e.to_string());
            match e {
                SocketError::Taken(_) => {
                    said.remedy("choose another path, or remove what is there")
                }
                SocketError::TooLong(_) => said.remedy("choose a shorter path"),
                SocketError::System { .. } => said.remedy("choose a folder you may write to"),
            }
        })?;
        self.sockets.push(socket);
        Ok(())
    }

    /// Opens a control channel over two streams. `tell` takes whole lines, and says whether anybody
    /// takes them still.
    ///
    /// # Errors
    /// The system gives no thread.
    pub fn control_over(
        &mut self,
        input: impl Read + Send + 'static,
        tell: impl FnMut(&str) -> bool + Send + 'static,
    ) -> Result<(), Error> {
        let pipe = ControlPipe::open(Arc::clone(&self.world), self.surroundings(), input, tell);
        self.pipe = Some(pipe.map_err(|e| {
            Error::of(ErrorKind::Io, "cannot open the control channel").got(e.to_string())
        })?);
        Ok(())
    }

    /// True once the streams of [`Self::control_over`] have ended and all that was asked is done.
    #[must_use]
    pub fn control_has_ended(&self) -> bool {
        self.pipe.as_ref().is_some_and(ControlPipe::has_ended)
    }

    /// Faults that struck since the last look, in words.
    #[must_use]
    pub fn struck(&self) -> Vec<String> {
        self.world().take_struck().iter().map(ToString::to_string).collect()
    }

    /// Of which clock the times are that are told of faults and falls, in words; nothing where none can be told.
    #[must_use]
    pub fn clock_words(&self) -> Option<&'static str> {
        let tells = self.weight.is_some() || self.tells_of_faults;
        tells.then_some(
            "times of faults and falls are seconds of the virtual robot's clock: it began when its \
             first line was opened",
        )
    }

    /// How it fell, if it did since the last look, and when by the virtual robot's clock, in words.
    pub fn fallen(&mut self) -> Option<String> {
        let (witness, told) = self.weight.as_mut()?;
        let fall = witness.fall();
        let is_new = fall.is_some() && fall != *told;
        told.clone_from(&fall);
        fall.filter(|_| is_new).map(|fall| fall.world_words())
    }

    /// What time it is there, s, and where its joints really are, whatever their registers say, rad, in the order of its
    /// file; not a number where nobody knows.
    #[must_use]
    pub fn joints(&self) -> (f64, Vec<f64>) {
        let world = self.world();
        let joints = self.robot.joints.iter();
        let at_rad = joints.map(|joint| world.joint_position_rad(&joint.name).unwrap_or(f64::NAN));
        (world.now_ns() as f64 * 1e-9, at_rad.collect())
    }

    /// How many faults struck so far.
    #[must_use]
    pub fn struck_count(&self) -> u64 {
        self.world().struck_count()
    }

    /// What the referee saw so far.
    #[must_use]
    pub fn verdict(&self) -> Verdict {
        self.world().verdict()
    }

    /// Closes every line; the robot can still be asked what happened.
    pub fn close(&mut self) {
        self.sockets.clear();
        self.doors.clear();
    }

    fn world(&self) -> MutexGuard<'_, World> {
        self.world.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The robot that is meant, or the bench.
fn robot_of(order: &SimulateOrder) -> Result<Robot, Error> {
    let Some(name) = &order.robot else { return bench_of(order) };
    Ok(gaitway_profiles::robot(name)?)
}

fn bench_of(order: &SimulateOrder) -> Result<Robot, Error> {
    let refused = |error: BenchError| {
        let said = Error::new(error.to_string()).at("--servo");
        match error {
            BenchError::Empty => Error::new("there is neither a robot nor a servo")
                .remedy("name a robot, or give --servo MODEL:IDS"),
            BenchError::UnknownModel { got, advice, allowed } => {
                Error::of(ErrorKind::Unknown, "there is no servo or CAN actuator of this name")
                    .at("--servo")
                    .got(got)
                    .allowed(allowed)
                    .remedy(advice)
            }
            BenchError::Text { got, allowed } => {
                Error::of(ErrorKind::Malformed, "this names no servos")
                    .at("--servo")
                    .got(got)
                    .allowed(allowed)
            }
            BenchError::Speed { model, got, allowed } => {
                Error::new(format!("{model} cannot run at this speed"))
                    .at("--baud")
                    .got(got.to_string())
                    .allowed(allowed)
            }
            BenchError::WhichSpeed(each) => {
                Error::new("the servos leave the factory with speeds that differ")
                    .at("--servo")
                    .got(each)
                    .remedy("say which speed the line has: --baud N")
            }
            BenchError::Id { .. } | BenchError::SameId(_) | BenchError::Apart(..) => said,
        }
    };
    let servos = order.servos.iter().map(|text| text.parse::<BenchServos>());
    let servos = servos.collect::<Result<Vec<_>, _>>().map_err(refused)?;
    gaitway_sim::bench(&servos, order.baud_bps).map_err(refused)
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

fn options(order: &SimulateOrder) -> Result<Options, Error> {
    let script = match &order.faults {
        Some(path) => script::read(path)?,
        None => Script::default(),
    };
    let of_weight = script.faults.iter().find_map(Fault::of_weight);
    if let Some(fault) = of_weight.filter(|_| !order.physics) {
        return Err(Error::new(format!("a {fault} needs a robot with weight"))
            .at(order.faults.as_ref().map_or_else(String::new, |path| path.display().to_string()))
            .remedy("add --physics, or take the fault out of the script"));
    }
    let mut options = script.apply(Options {
        line_timing: !order.no_line_timing,
        permit_eeprom: order.permit_eeprom,
        ..Options::default()
    });
    options.seed = order.seed.unwrap_or(options.seed);
    match &order.adapter {
        Some(name) => {
            let known: Vec<&str> = gaitway_profiles::adapter_names().collect();
            let known = known.join(", ");
            let refused = |e: SimError| match e {
                SimError::LatencyTimer { .. } => Error::new(e.to_string()).at("--latency-timer"),
                _ => Error::new(e.to_string()).at("--adapter").allowed(known),
            };
            options.behind(name, order.latency_timer_s).map_err(refused)
        }
        None => Ok(options),
    }
}

fn open_doors(
    order: &SimulateOrder,
    robot: &Robot,
    world: &Arc<Mutex<World>>,
) -> Result<Vec<Way>, Error> {
    let interfaces = interfaces(&order.can, robot)?;
    let several = robot.lines.len() > 1;
    let mut doors = Vec::new();
    for (line, facts) in robot.lines.iter().enumerate() {
        let entrance = match (interfaces.get(&line), order.tcp_port) {
            (Some(interface), _) => {
                Entrance::Can(CanBridge::open(Arc::clone(world), line, interface).map_err(|e| {
                    Error::new("cannot put the line on this interface")
                        .at(format!("--can, line {}", facts.name))
                        .got(e.to_string())
                        .remedy("ip link add vcan0 type vcan && ip link set vcan0 mtu 72 up")
                })?)
            }
            (None, Some(port)) => Entrance::Door(open_tcp(port, line, world)?),
            (None, None) => {
                let link = order.link.as_ref().map(|link| match several {
                    false => link.clone(),
                    true => PathBuf::from(format!("{}-{}", link.display(), facts.name)),
                });
                link.as_deref().map_or(Ok(()), check_outside)?;
                Entrance::Door(open_pty(link.as_deref(), line, &facts.name, world)?)
            }
        };
        let place = entrance.place();
        doors.push(Way { line: facts.name.clone(), entrance, place });
    }
    Ok(doors)
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
    link: Option<&Path>,
    line: usize,
    name: &str,
    world: &Arc<Mutex<World>>,
) -> Result<Door, Error> {
    Door::open(Arc::clone(world), line, link).map_err(|e| {
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
