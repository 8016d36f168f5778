//! A few servos on lines, for the tests of this room: as little of a Feetech STS servo as arming and
//! the cycle see, as bytes in registers. Time moves only by sleeping and by waiting for bytes.

pub(super) mod damiao;
mod lines;
mod modes;
mod preflight;

use crate::bus::Protocol;
use crate::control::Motion;
use crate::device::Model;
use crate::motion::Setpoint;
use crate::port::{BytePort, Clock, PortError};
use crate::robot::preflight::{Accept, Preflight, preflight};
use crate::robot::{Drive, LinePort, Link, Robot, ServoDrive};
use crate::time::{Duration, Instant};
use crate::wire::can::CanFrame;
use damiao::{CanPort, Damiao};
use gaitway_profiles::{LineKind, Role, Unit};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

pub(super) const TORQUE: u8 = 40;
pub(super) const GOAL: u8 = 42;
pub(super) const SPEED: u8 = 46;
pub(super) const PRESENT: u8 = 56;
pub(super) const STATUS: u8 = 65;
/// A register that no STS servo has: a watch over the host, which counts in 20 ms, as a Dynamixel X
/// has it.
pub(super) const WATCHDOG: u8 = 98;

pub(super) const PING: u8 = 1;
pub(super) const READ: u8 = 2;
pub(super) const WRITE: u8 = 3;
pub(super) const SYNC_READ: u8 = 0x82;
pub(super) const SYNC_WRITE: u8 = 0x83;

/// Time between two cycles.
pub(super) const T: Duration = Duration::from_millis(20);
/// A servo answers so long after it was asked.
const ANSWERS_NS: u64 = 50_000;
/// Ten bits at 1 Mbps.
const BYTE_NS: u64 = 10_000;
/// No test takes so long in the world of its servos: something never ends.
const LONGEST_NS: u64 = 60_000_000_000;
/// A servo stands at its goal so long after it was told.
const FOLLOWS_NS: u64 = 10_000_000;

/// One instruction on a line.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Said {
    /// When its last byte had left.
    pub at: Instant,
    pub line: usize,
    pub id: u8,
    pub instruction: u8,
    pub params: Vec<u8>,
}

impl Said {
    /// True if it is this instruction, about registers from `address` on.
    pub fn is(&self, instruction: u8, address: u8) -> bool {
        self.instruction == instruction && self.params.first() == Some(&address)
    }

    pub fn is_goals(&self) -> bool {
        self.is(SYNC_WRITE, GOAL)
    }

    /// True if it switches torque on, or off.
    pub fn is_torque(&self, on: bool) -> bool {
        let raw = match self.instruction {
            WRITE => self.params.get(1),
            SYNC_WRITE => self.params.get(3),
            _ => None,
        };
        self.params.first() == Some(&TORQUE) && raw == Some(&u8::from(on))
    }

    /// The goals in it, by ID, in counts.
    pub fn goals(&self) -> Vec<(u8, i64)> {
        let each = self.params[2..].chunks_exact(3);
        each.map(|of| (of[0], i64::from(u16::from_le_bytes([of[1], of[2]])))).collect()
    }
}

/// One servo: its registers and what ails it.
#[derive(Clone, Debug)]
pub(super) struct Servo {
    pub line: usize,
    pub id: u8,
    pub registers: [u8; 128],
    /// It neither hears nor answers.
    pub silent: bool,
    /// It answers nothing that is asked of these registers.
    pub mute_about: Vec<u8>,
    /// It says yes to a write of these registers and keeps what it has.
    pub forgets: Vec<u8>,
    /// It stays where it is, whatever its goal.
    pub stuck: bool,
    /// The error byte of its answers.
    pub alert: u8,
    /// Where it stands from when on, ns and counts.
    under_way: Option<(u64, i64)>,
}

impl Servo {
    pub fn get(&self, address: u8) -> u8 {
        self.registers[usize::from(address)]
    }

    pub fn set(&mut self, address: u8, value: u8) {
        self.registers[usize::from(address)] = value;
    }

    pub fn word(&self, address: u8) -> i64 {
        i64::from(u16::from_le_bytes([self.get(address), self.get(address + 1)]))
    }

    pub fn set_word(&mut self, address: u8, value: i64) {
        let [low, high] = u16::try_from(value).expect("a word").to_le_bytes();
        self.set(address, low);
        self.set(address + 1, high);
    }

    /// Everything in RAM is as after its power came back.
    pub fn restart(&mut self) {
        self.set(TORQUE, 0);
        self.set_word(SPEED, 0);
        self.under_way = None;
    }

    /// It stands there, wherever it was under way to.
    pub fn put_at(&mut self, counts: i64) {
        self.under_way = None;
        self.set_word(PRESENT, counts);
    }

    fn settle(&mut self, now_ns: u64) {
        if let Some((_, counts)) = self.under_way.filter(|&(at_ns, _)| at_ns <= now_ns) {
            self.set_word(PRESENT, counts);
            self.under_way = None;
        }
    }

    fn write(&mut self, now_ns: u64, address: u8, bytes: &[u8]) {
        if self.forgets.contains(&address) {
            return;
        }
        for (k, byte) in (0_u8..).zip(bytes) {
            self.set(address + k, *byte);
        }
        if (address == GOAL || address == TORQUE) && self.get(TORQUE) == 1 && !self.stuck {
            self.under_way = Some((now_ns + FOLLOWS_NS, self.word(GOAL)));
        }
    }
}

/// What happens to the world as an instruction is heard.
type Hook = Box<dyn FnMut(&mut World, &Said) + Send>;

#[derive(Default)]
struct FakeLine {
    gone: bool,
    busy_until_ns: u64,
    inbox: VecDeque<(u64, u8)>,
}

/// All servos, lines, and the one clock.
#[derive(Default)]
pub(super) struct World {
    pub now_ns: u64,
    /// In the robot's order.
    pub servos: Vec<Servo>,
    pub log: Vec<Said>,
    /// Questions to several servos are answered so much later than others.
    pub answers_later: Duration,
    /// The host that sleeps until this moment wakes up so late.
    pub oversleeps: Option<(Instant, Duration)>,
    lines: Vec<FakeLine>,
    hook: Option<Hook>,
    /// In the robot's order, after the servos.
    pub actuators: Vec<Damiao>,
    /// What was said on the CAN line, and when.
    pub frames: Vec<(Instant, CanFrame)>,
    answers: VecDeque<(u64, CanFrame)>,
    /// How long the host stands still before each question of this kind to an actuator leaves.
    pub slow: Option<(u8, Duration)>,
}

impl World {
    /// The host does not run for a while.
    pub fn stall(&mut self, lasts: Duration) {
        self.now_ns += u64::try_from(lasts.as_nanos()).expect("short");
    }

    /// Nothing happens until then.
    fn wait_until(&mut self, at: Instant) {
        self.now_ns = self.now_ns.max(at.as_nanos());
        assert!(self.now_ns < LONGEST_NS, "it never ends");
    }

    /// The adapter of a line is pulled out.
    pub fn unplug(&mut self, line: usize) {
        self.lines[line].gone = true;
    }

    fn hear(&mut self, line: usize, packet: &[u8]) {
        let begins_ns = self.lines[line].busy_until_ns.max(self.now_ns);
        let mut end_ns = begins_ns + BYTE_NS * packet.len() as u64;
        self.lines[line].busy_until_ns = end_ns;
        let [0xFF, 0xFF, id, length, instruction, rest @ ..] = packet else {
            panic!("no packet: {packet:02X?}");
        };
        assert_eq!(usize::from(*length), rest.len() + 1, "{packet:02X?}");
        assert_eq!(sum(&packet[2..packet.len() - 1]), packet[packet.len() - 1], "{packet:02X?}");
        let said = Said {
            at: Instant::from_nanos(end_ns),
            line,
            id: *id,
            instruction: *instruction,
            params: rest[..rest.len() - 1].to_vec(),
        };
        self.log.push(said.clone());
        if let Some(mut hook) = self.hook.take() {
            hook(self, &said);
            self.hook = self.hook.take().or(Some(hook));
        }
        self.servos.iter_mut().for_each(|servo| servo.settle(end_ns));
        let params = &said.params;
        match said.instruction {
            PING => self.answer(line, *id, None, &mut end_ns),
            READ => self.answer(line, *id, Some((params[0], params[1])), &mut end_ns),
            WRITE => {
                let of = self.servos.iter_mut().filter(|s| s.line == line && !s.silent);
                of.filter(|servo| servo.id == *id).for_each(|servo| {
                    servo.write(end_ns, params[0], &params[1..]);
                });
                self.answer(line, *id, None, &mut end_ns);
            }
            SYNC_READ => {
                end_ns += u64::try_from(self.answers_later.as_nanos()).expect("short");
                for &id in &params[2..] {
                    self.answer(line, id, Some((params[0], params[1])), &mut end_ns);
                }
            }
            SYNC_WRITE => {
                for item in params[2..].chunks_exact(usize::from(params[1]) + 1) {
                    let of = self.servos.iter_mut().filter(|s| s.line == line && !s.silent);
                    of.filter(|servo| servo.id == item[0])
                        .for_each(|servo| servo.write(end_ns, params[0], &item[1..]));
                }
            }
            _ => panic!("an instruction no servo of these tests knows: {said:?}"),
        }
    }

    fn answer(&mut self, line: usize, id: u8, asked: Option<(u8, u8)>, end_ns: &mut u64) {
        let of = |servo: &&Servo| servo.line == line && servo.id == id && !servo.silent;
        let Some(servo) = self.servos.iter().find(of) else { return };
        if asked.is_some_and(|(address, _)| servo.mute_about.contains(&address)) {
            return;
        }
        let bytes = asked.map_or(&[][..], |(address, length)| {
            &servo.registers[usize::from(address)..usize::from(address + length)]
        });
        let length = u8::try_from(bytes.len() + 2).expect("short");
        let mut status = vec![0xFF, 0xFF, id, length, servo.alert];
        status.extend(bytes);
        status.push(sum(&status[2..]));
        *end_ns += ANSWERS_NS;
        for byte in status {
            *end_ns += BYTE_NS;
            self.lines[line].inbox.push_back((*end_ns, byte));
        }
        self.lines[line].busy_until_ns = *end_ns;
    }
}

/// The last byte of a packet.
fn sum(bytes: &[u8]) -> u8 {
    !bytes.iter().fold(0_u8, |sum, byte| sum.wrapping_add(*byte))
}

/// The world as its clock, its ports and a test share it.
#[derive(Clone, Default)]
pub(super) struct Shared(Arc<Mutex<World>>);

impl Shared {
    pub fn lock(&self) -> MutexGuard<'_, World> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// From now on this happens at each instruction, before it is carried out.
    pub fn at_each(&self, hook: impl FnMut(&mut World, &Said) + Send + 'static) {
        self.lock().hook = Some(Box::new(hook));
    }
}

impl Clock for Shared {
    fn now(&self) -> Instant {
        Instant::from_nanos(self.lock().now_ns)
    }

    fn sleep_until(&self, at: Instant) {
        let mut world = self.lock();
        world.wait_until(at);
        if let Some((_, late)) = world.oversleeps.take_if(|(until, _)| *until == at) {
            world.stall(late);
        }
    }
}

struct Port {
    world: Shared,
    line: usize,
}

impl BytePort for Port {
    fn send(&mut self, bytes: &[u8], _deadline: Instant) -> Result<(), PortError> {
        let mut world = self.world.lock();
        if world.lines[self.line].gone {
            return Err(PortError::Gone("pulled out".to_owned()));
        }
        world.hear(self.line, bytes);
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], deadline: Instant) -> Result<usize, PortError> {
        let mut world = self.world.lock();
        let now_ns = world.now_ns;
        let line = &mut world.lines[self.line];
        if line.gone {
            return Err(PortError::Gone("pulled out".to_owned()));
        }
        let comes_ns = line.inbox.front().map(|&(at_ns, _)| at_ns.max(now_ns));
        let Some(comes_ns) = comes_ns.filter(|&at_ns| at_ns <= deadline.as_nanos()) else {
            world.wait_until(deadline);
            return Err(PortError::TimedOut);
        };
        let mut count = 0;
        while let Some(&(at_ns, byte)) = line.inbox.front()
            && at_ns <= comes_ns
            && count < buffer.len()
        {
            buffer[count] = byte;
            count += 1;
            line.inbox.pop_front();
        }
        world.now_ns = comes_ns;
        Ok(count)
    }

    fn discard_input(&mut self) -> Result<(), PortError> {
        let mut world = self.world.lock();
        let now_ns = world.now_ns;
        world.lines[self.line].inbox.retain(|&(at_ns, _)| at_ns > now_ns);
        Ok(())
    }
}

/// A robot with its lines open, and the world behind them.
pub(super) struct Bench {
    pub link: Link,
    pub world: Shared,
}

/// A robot of as many joints as there are entries in `line_of`, each on that line:
/// `joint0` with ID 20 and so on.
pub(super) fn robot(line_of: &[usize]) -> Robot {
    let mut file = Robot::load("open-duck-mini-v2").expect("shipped").file;
    let line = file.lines[0].clone();
    let lines = line_of.iter().max().map_or(0, |last| last + 1);
    file.lines = vec![line; lines];
    for (k, line) in file.lines.iter_mut().enumerate() {
        line.name = format!("line{k}");
    }
    file.joints.truncate(line_of.len());
    for (k, (joint, &line)) in file.joints.iter_mut().zip(line_of).enumerate() {
        joint.line = format!("line{line}");
        joint.id = 20 + u8::try_from(k).expect("a few");
        (joint.name, joint.parent) = (format!("joint{k}"), None);
    }
    Robot::new(file).expect("a robot")
}

/// Changes the profile of a joint's servo.
pub(super) fn with_profile(
    robot: &mut Robot,
    joint: usize,
    change: impl FnOnce(&mut gaitway_profiles::Servo),
) {
    let drive = drive(robot, joint);
    let mut profile = drive.model.profile().clone();
    change(&mut profile);
    // Profiles live as long as the program, here as everywhere.
    drive.model = Model::new(Box::leak(Box::new(profile)));
}

/// The servo of a joint, to be changed.
pub(super) fn drive(robot: &mut Robot, joint: usize) -> &mut ServoDrive {
    match &mut robot.joints[joint].drive {
        Drive::Servo(drive) => drive,
        Drive::Actuator(_) => panic!("a servo"),
    }
}

/// The same robot with a watchdog in the servos of these joints: steps of 20 ms, 127 at most, and 255
/// once it has bitten.
pub(super) fn watched(mut robot: Robot, joints: &[usize]) -> Robot {
    for &joint in joints {
        with_profile(&mut robot, joint, |profile| {
            let torque = profile.registers.iter().find(|r| r.role == Some(Role::TorqueEnable));
            let mut watchdog = torque.expect("there").clone();
            watchdog.name = "Bus Watchdog".to_owned();
            watchdog.role = Some(Role::BusWatchdog);
            watchdog.address = u16::from(WATCHDOG);
            watchdog.unit = Unit::Second;
            watchdog.scale = Some(0.02);
            (watchdog.min, watchdog.max, watchdog.initial) = (Some(0), Some(127), Some(0));
            profile.registers.push(watchdog);
        });
    }
    robot
}

/// A robot of two actuators of this kind, which hang on a CAN line that nobody opened: whatever they are
/// asked fails. `timeouts_s`: after what silence they let go, as the robot file says.
pub(super) fn out_of_reach(actuator: &str, timeouts_s: [Option<f64>; 2]) -> Link {
    let mut file = Robot::load("berkeley-humanoid-lite").expect("shipped").file;
    file.joints.truncate(2);
    for (k, (joint, timeout_s)) in file.joints.iter_mut().zip(timeouts_s).enumerate() {
        (joint.name, joint.servo) = (format!("joint{k}"), actuator.to_owned());
        (joint.parent, joint.timeout_configured_s) = (None, timeout_s);
        joint.answer_id = joint.answer_id.or(Some(0x70 + u16::try_from(k).expect("a few")));
        (joint.kp_nm_rad, joint.kd_nm_s_rad) = (Some(40.0), Some(1.5));
    }
    let robot = Robot::new(file).expect("a robot");
    Link::new(robot, Vec::<(LinePort, Duration)>::new(), Arc::new(Shared::default()))
}

impl Bench {
    /// Servos as their robot file wants them, torque off, at 0 rad.
    pub fn new(line_of: &[usize]) -> Self {
        Self::of(robot(line_of))
    }

    pub fn of(robot: Robot) -> Self {
        Self::behind(robot, Duration::from_millis(1))
    }

    /// The same behind adapters that hold bytes back for so long at most.
    pub fn behind(robot: Robot, latency: Duration) -> Self {
        let world = Shared::default();
        for joint in &robot.joints {
            let Some(drive) = joint.servo() else {
                world.lock().actuators.push(Damiao::new(joint.id));
                continue;
            };
            assert_eq!(drive.model.protocol(), Protocol::FeetechSts);
            let mut servo = Servo {
                line: joint.line,
                id: joint.id,
                registers: [0; 128],
                silent: false,
                mute_about: Vec::new(),
                forgets: Vec::new(),
                stuck: false,
                alert: 0,
                under_way: None,
            };
            for register in &drive.model.profile().registers {
                let raw = drive.setup.get(&register.name).copied().or(register.initial);
                let address = u8::try_from(register.address).expect("a byte");
                match register.bytes {
                    1 => servo.set(address, u8::try_from(raw.unwrap_or(0)).expect("a byte")),
                    _ => servo.set_word(address, raw.unwrap_or(0)),
                }
            }
            // Firmware 3.10; 7.4 V; 30 degrees; in the middle.
            [(0, 3), (1, 10), (5, joint.id), (62, 74), (63, 30)]
                .into_iter()
                .for_each(|(address, value)| servo.set(address, value));
            servo.set_word(GOAL, 1000);
            servo.set_word(PRESENT, 2048);
            world.lock().servos.push(servo);
        }
        world.lock().lines = robot.lines.iter().map(|_| FakeLine::default()).collect();
        let port = |line: usize| {
            let world = world.clone();
            let port = match robot.lines[line].kind {
                LineKind::Can(_) => LinePort::Frames(Box::new(CanPort(world))),
                LineKind::Serial { .. } => LinePort::Bytes(Box::new(Port { world, line })),
            };
            (port, latency)
        };
        let ports = (0..robot.lines.len()).map(port).collect();
        Self { link: Link::new(robot, ports, Arc::new(world.clone())), world }
    }

    /// All checks before torque.
    pub fn checked(&mut self) -> Preflight {
        preflight(&mut self.link, T, Accept { firmware: false, eeprom: false }).expect("all well")
    }

    /// What was said from here on is all that is looked at.
    pub fn forget_log(&self) {
        self.world.lock().log.clear();
    }

    pub fn log(&self) -> Vec<Said> {
        self.world.lock().log.clone()
    }

    /// Torque of each servo, in the robot's order.
    pub fn torque(&self) -> Vec<u8> {
        self.world.lock().servos.iter().map(|servo| servo.get(TORQUE)).collect()
    }

    pub fn change(&self, joint: usize, change: impl FnOnce(&mut Servo)) {
        change(&mut self.world.lock().servos[joint]);
    }
}

/// A motion that stands at 0 and is over at once.
pub(super) struct Standing;

impl Motion for Standing {
    fn advance(&mut self, _dt_s: f64, _now: Instant, setpoints: &mut [Setpoint]) -> bool {
        setpoints.fill(Setpoint::default());
        true
    }

    fn stop(&mut self) {}
}
