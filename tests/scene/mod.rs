//! A virtual robot with the production driver on it, for tests. The referee always watches.
#![allow(dead_code, missing_docs)]

use gaitway::control::{self, Armed, Exception, Run, Sample, Settings, Sink};
use gaitway::device::JointState;
use gaitway::error::Error;
use gaitway::motion::{Path, PlanOptions, Trajectory, plan};
use gaitway::port::sim::{SharedWorld, VirtualCanLine, VirtualClock, VirtualLine};
use gaitway::port::{BytePort, Clock, FramePort, Heard, PortError};
use gaitway::robot::preflight::{Accept, Preflight, preflight};
use gaitway::robot::{LinePort, Link, Robot};
use gaitway::time::{Duration, Instant};
use gaitway::wire::can::CanFrame;
use gaitway_profiles::LineKind;
use gaitway_sim::{Options, Rule, Verdict, Violation, World};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

/// The machine the driver runs on: it may stand still at any step, and not a word of it be heard any
/// more. A step is whatever it does with a port or its clock.
pub struct Host {
    world: SharedWorld,
    steps: AtomicU64,
    /// Set, it cuts every line.
    pub cut: AtomicBool,
    /// Before which steps it stands still, for how long, and which joint somebody turns meanwhile.
    stalls: Mutex<Vec<Stall>>,
    /// Further times in which it stands still, by the number of the step.
    plan: Mutex<Option<StallPlan>>,
    stalled: AtomicU64,
    /// Of all bytes that went through its ports, and when.
    trace: AtomicU64,
    /// What left it and when, once somebody wants to know.
    sent: Mutex<Option<Vec<Sent>>>,
}

/// World time, ns, and the bytes that left a host then.
pub type Sent = (u64, Vec<u8>);

/// One time in which the host stands still.
#[derive(Clone, Debug)]
pub struct Stall {
    pub step: u64,
    pub lasts_ns: u64,
    pub turned: Option<(String, f64)>,
}

/// Where in a step the host stands still.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Side {
    Before,
    After,
}

/// Says for each step, by number, how long the host stands still in it.
pub type StallPlan = Box<dyn Fn(u64) -> Option<(Side, Duration)> + Send>;

impl Host {
    pub fn new(world: &SharedWorld) -> Arc<Self> {
        Arc::new(Self {
            world: world.clone(),
            steps: AtomicU64::new(0),
            cut: AtomicBool::new(false),
            stalls: Mutex::default(),
            plan: Mutex::default(),
            stalled: AtomicU64::new(0),
            trace: AtomicU64::new(0xCBF2_9CE4_8422_2325),
            sent: Mutex::default(),
        })
    }

    /// Steps done so far.
    pub fn steps(&self) -> u64 {
        self.steps.load(Ordering::Relaxed)
    }

    /// How often it has stood still.
    pub fn stalled(&self) -> u64 {
        self.stalled.load(Ordering::Relaxed)
    }

    /// A number that differs if a byte, its way or its time does (FNV-1a).
    pub fn trace(&self) -> u64 {
        self.trace.load(Ordering::Relaxed)
    }

    /// From now on what leaves it is kept.
    pub fn keep_sent(&self) {
        *self.sent.lock().expect("what was sent") = Some(Vec::new());
    }

    /// What left it since then, on whatever line.
    pub fn sent(&self) -> Vec<Sent> {
        self.sent.lock().expect("what was sent").clone().unwrap_or_default()
    }

    fn went_by(&self, way: u8, bytes: &[u8]) {
        let now_ns = self.world.lock().now_ns();
        if let (0, Some(sent)) = (way, &mut *self.sent.lock().expect("what was sent")) {
            sent.push((now_ns, bytes.to_vec()));
        }
        let all = [way].into_iter().chain(now_ns.to_le_bytes()).chain(bytes.iter().copied());
        let before = self.trace();
        let after =
            all.fold(before, |sum, byte| (sum ^ u64::from(byte)).wrapping_mul(0x0100_0000_01B3));
        self.trace.store(after, Ordering::Relaxed);
    }

    /// It will stand still then.
    pub fn stall(&self, stall: Stall) {
        self.stalls.lock().expect("stalls").push(stall);
    }

    /// It will stand still whenever the plan says so.
    pub fn stall_by(&self, plan: StallPlan) {
        *self.plan.lock().expect("a plan") = Some(plan);
    }

    /// One step: `call`, and the times in which the host stands still before and after it.
    fn during<T>(&self, call: impl FnOnce() -> T) -> T {
        let step = self.steps.fetch_add(1, Ordering::Relaxed);
        let planned = self.plan.lock().expect("a plan").as_ref().and_then(|plan| plan(step));
        let planned = |side| planned.filter(|(when, _)| *when == side).map(|(_, time)| time);
        let stalls = self.stalls.lock().expect("stalls");
        let now: Vec<_> = stalls.iter().filter(|stall| stall.step == step).cloned().collect();
        drop(stalls);
        for Stall { lasts_ns, turned, .. } in now {
            self.stand_still(lasts_ns, turned);
        }
        if let Some(time) = planned(Side::Before) {
            self.stand_still(time.as_nanos() as u64, None);
        }
        let result = call();
        if let Some(time) = planned(Side::After) {
            self.stand_still(time.as_nanos() as u64, None);
        }
        result
    }

    fn stand_still(&self, lasts_ns: u64, turned: Option<(String, f64)>) {
        self.stalled.fetch_add(1, Ordering::Relaxed);
        let mut world = self.world.lock();
        let until_ns = world.now_ns() + lasts_ns;
        world.run_until(until_ns - lasts_ns / 2);
        if let Some((joint, by_rad)) = turned {
            let at_rad = world.joint_position_rad(&joint).expect("a joint");
            assert!(world.place_joint(&joint, at_rad + by_rad));
        }
        world.run_until(until_ns);
    }
}

/// The host's clock.
struct HostClock {
    world: VirtualClock,
    host: Arc<Host>,
}

impl Clock for HostClock {
    fn now(&self) -> Instant {
        self.world.now()
    }

    fn sleep_until(&self, at: Instant) {
        self.host.during(|| self.world.sleep_until(at));
    }
}

/// A line whose adapter is unplugged at some moment, or with the host's others.
struct CutLine {
    line: VirtualLine,
    clock: Arc<dyn Clock>,
    cut_at: Instant,
    host: Arc<Host>,
}

impl CutLine {
    fn there(&self) -> Result<(), PortError> {
        if self.clock.now() < self.cut_at && !self.host.cut.load(Ordering::Relaxed) {
            return Ok(());
        }
        Err(PortError::Gone("unplugged".into()))
    }
}

/// A CAN line that is cut with the host's others.
struct CutCanLine {
    line: VirtualCanLine,
    host: Arc<Host>,
}

impl CutCanLine {
    fn there(&self) -> Result<(), PortError> {
        match self.host.cut.load(Ordering::Relaxed) {
            false => Ok(()),
            true => Err(PortError::Gone("unplugged".into())),
        }
    }
}

impl FramePort for CutCanLine {
    fn send(&mut self, frame: &CanFrame, deadline: Instant) -> Result<(), PortError> {
        self.there()?;
        self.line.send(frame, deadline)
    }

    fn receive(&mut self, deadline: Instant) -> Result<Heard, PortError> {
        self.there()?;
        self.line.receive(deadline)
    }

    fn full_queue_count(&self) -> u64 {
        self.line.full_queue_count()
    }
}

impl BytePort for CutLine {
    fn send(&mut self, bytes: &[u8], deadline: Instant) -> Result<(), PortError> {
        let host = Arc::clone(&self.host);
        host.during(|| {
            self.there()?;
            self.host.went_by(0, bytes);
            self.line.send(bytes, deadline)
        })
    }

    fn receive(&mut self, buffer: &mut [u8], deadline: Instant) -> Result<usize, PortError> {
        let host = Arc::clone(&self.host);
        host.during(|| {
            self.there()?;
            let received = self.line.receive(buffer, deadline.min(self.cut_at));
            self.there()?;
            if let Ok(count) = received {
                self.host.went_by(1, &buffer[..count]);
            }
            received
        })
    }

    fn discard_input(&mut self) -> Result<(), PortError> {
        let host = Arc::clone(&self.host);
        host.during(|| {
            self.there()?;
            self.line.discard_input()
        })
    }
}

/// The lines of a robot as a host has them, one of which, by number, is unplugged at some time.
fn lines(
    robot: &Robot,
    world: &SharedWorld,
    host: &Arc<Host>,
    cut: Option<(usize, u64)>,
    latency: Duration,
) -> (Vec<(LinePort, Duration)>, Arc<dyn Clock>) {
    let clock = HostClock { world: VirtualClock(world.clone()), host: Arc::clone(host) };
    let clock: Arc<dyn Clock> = Arc::new(clock);
    let ports = robot.lines.iter().enumerate().map(|(line, facts)| {
        let LineKind::Serial { baud_bps } = facts.kind else {
            let line = VirtualCanLine::new(world.clone(), line);
            let port = CutCanLine { line, host: Arc::clone(host) };
            return (LinePort::Frames(Box::new(port)), latency);
        };
        let port = VirtualLine::new(world.clone(), line, baud_bps);
        let at_ns = cut.filter(|&(number, _)| number == line).map_or(u64::MAX, |(_, at)| at);
        let cut_at = Instant::from_nanos(at_ns);
        let (clock, host) = (Arc::clone(&clock), Arc::clone(host));
        let port = CutLine { line: port, clock, cut_at, host };
        (LinePort::Bytes(Box::new(port)), latency)
    });
    (ports.collect(), clock)
}

pub const STRICT: Accept = Accept { firmware: false, eeprom: false };

pub struct Scene {
    pub world: SharedWorld,
    pub link: Link,
    pub settings: Settings,
    pub host: Arc<Host>,
}

/// What came of a played scene.
pub struct Played {
    pub run: Run,
    pub trajectory: Trajectory,
    pub samples: Samples,
    pub verdict: Verdict,
}

/// Measured position of every joint in every cycle; `None` where the read was missed.
#[derive(Default)]
pub struct Samples(pub Vec<Vec<Option<f64>>>);

impl Sink for Samples {
    fn take(&mut self, sample: &Sample<'_>) {
        let positions = sample.states.iter().map(|state| match state {
            Ok((state, _)) => Some(state.position_rad),
            Err(_) => None,
        });
        self.0.push(positions.collect());
    }
}

/// What every joint told of itself in every cycle, and the goals in effect then.
#[derive(Default)]
pub struct Readings {
    pub states: Vec<Vec<Option<JointState>>>,
    pub goals_rad: Vec<Vec<f64>>,
    pub at: Vec<Instant>,
}

impl Sink for Readings {
    fn take(&mut self, sample: &Sample<'_>) {
        let state = |state: &Result<(JointState, bool), _>| state.as_ref().ok().map(|read| read.0);
        self.states.push(sample.states.iter().map(state).collect());
        self.goals_rad.push(sample.goal_rad.to_vec());
        self.at.push(sample.at);
    }
}

/// Torque on, nobody asking to stop.
pub fn arm(link: &mut Link, found: &Preflight) -> Result<Armed, Error> {
    control::arm::arm(link, found, &|| false)?.done()
}

impl Scene {
    /// A shipped robot, or one of the fixtures.
    pub fn of(robot: &str, options: Options) -> Self {
        let robot = match robot {
            "protocol-1" => protocol1_robot(),
            "mixed" => mixed_robot(),
            _ => Robot::load(robot).expect("a shipped robot"),
        };
        Self::with_robot(robot, options)
    }

    pub fn with_robot(robot: Robot, options: Options) -> Self {
        Self::with_cut(robot, options, None)
    }

    /// A robot one of whose lines, by number, is unplugged at some time.
    pub fn with_cut(robot: Robot, options: Options, cut: Option<(usize, u64)>) -> Self {
        let latency = Duration::from_nanos(options.adapter_latency_ns);
        let world = World::new(&robot.file, options).expect("a virtual robot");
        let world = SharedWorld::new(world);
        let host = Host::new(&world);
        let (ports, clock) = lines(&robot, &world, &host, cut, latency);
        let settings = Settings::at_rate(robot.file.rate_hz);
        Self { world, link: Link::new(robot, ports, clock), settings, host }
    }

    /// The same robot, whose lines another host opens.
    pub fn reopen(&mut self) {
        let robot = self.link.robot().clone();
        self.host = Host::new(&self.world);
        let (ports, clock) = lines(&robot, &self.world, &self.host, None, Duration::ZERO);
        self.link = Link::new(robot, ports, clock);
    }

    pub fn last_joint(&self) -> String {
        self.link.robot().joints.last().expect("a joint").name.clone()
    }

    pub fn op3() -> Self {
        Self::of("op3", Options::default())
    }

    pub fn with_faults(robot: &str, faults: Vec<gaitway_sim::Fault>) -> Self {
        Self::of(robot, Options { faults, ..Options::default() })
    }

    pub fn preflight(&mut self) -> Result<Preflight, Error> {
        preflight(&mut self.link, self.settings.period, STRICT)
    }

    /// Every joint swings by `swing_rad` to and fro around where it stands, for `rounds` seconds.
    pub fn swing(&self, start_rad: &[f64], swing_rad: f64, rounds: usize) -> Trajectory {
        self.swing_but(start_rad, swing_rad, rounds, usize::MAX)
    }

    /// The swing, with joint number `still` staying where it is.
    pub fn swing_but(
        &self,
        start_rad: &[f64],
        swing_rad: f64,
        rounds: usize,
        still: usize,
    ) -> Trajectory {
        let rate_hz = 50.0;
        let limits = self.link.robot().limits();
        let rows = start_rad.iter().zip(&limits).enumerate().map(|(index, (&start, limits))| {
            let swing_rad = if index == still { 0.0 } else { swing_rad };
            let (up, down) = (limits.upper_rad() - start, start - limits.lower_rad());
            let towards =
                if up > down { swing_rad.min(0.9 * up) } else { -swing_rad.min(0.9 * down) };
            let turn = |i: usize| (1.0 - (std::f64::consts::TAU * i as f64 / rate_hz).cos()) / 2.0;
            (0..=50 * rounds).map(|i| start + towards * turn(i)).collect()
        });
        let path = Path::new(self.link.robot().joint_names(), rate_hz, rows.collect());
        let path = path.expect("a path");
        plan(start_rad, &path, &limits, PlanOptions::default()).expect("a plan").trajectory
    }

    /// Preflight, torque, the swing, and what the referee says.
    pub fn play(mut self, swing_rad: f64, rounds: usize) -> Played {
        self.play_until(swing_rad, rounds, &|| false)
    }

    pub fn play_until(
        &mut self,
        swing_rad: f64,
        rounds: usize,
        asked_to_stop: &dyn Fn() -> bool,
    ) -> Played {
        let found = self.preflight().expect("a robot that is ready");
        let trajectory = self.swing(&found.start_rad, swing_rad, rounds);
        let armed = arm(&mut self.link, &found).expect("torque");
        let mut samples = Samples::default();
        let settings = self.settings;
        let run =
            control::run(&mut self.link, armed, &trajectory, settings, &mut samples, asked_to_stop)
                .expect("its own joints");
        let verdict = self.world.lock().verdict();
        Played { run, trajectory, samples, verdict }
    }
}

/// OP3 with its legs on a line of their own, the second.
pub fn op3_on_two_lines() -> Robot {
    let mut file = gaitway_profiles::robot("op3").expect("a shipped robot");
    let mut legs = file.lines[0].clone();
    legs.name = "legs".into();
    file.lines.push(legs);
    for joint in file.joints.iter_mut().filter(|joint| (7..=18).contains(&joint.id)) {
        joint.line = "legs".into();
    }
    Robot::new(file).expect("a robot")
}

/// How one model of servo is set up in a fixture.
fn setup(servo: &str, firmware: u16, registers: &[(&str, i64)]) -> gaitway_profiles::Setup {
    gaitway_profiles::Setup {
        servo: servo.into(),
        joints: None,
        firmware,
        registers: registers.iter().map(|&(name, raw)| (name.to_owned(), raw)).collect(),
        source: "a fixture".into(),
    }
}

/// OP3's joints with Protocol 1.0 servos at 1 Mbps: MX-28, and AX-12A in the head, whose servos
/// must be asked one by one.
pub fn protocol1_robot() -> Robot {
    let mut file = gaitway_profiles::robot("op3").expect("a shipped robot");
    file.name = "protocol-1".into();
    file.rate_hz = 50.0;
    file.lines[0].kind = LineKind::Serial { baud_bps: 1_000_000 };
    for joint in &mut file.joints {
        let head = joint.name.starts_with("head");
        joint.servo = if head { "ax-12a" } else { "mx-28" }.into();
    }
    let registers = [("Baud Rate", 1), ("Return Delay Time", 0)];
    file.setups = vec![setup("mx-28", 40, &registers), setup("ax-12a", 24, &registers)];
    Robot::new(file).expect("a robot")
}

/// Three families on one line at 1 Mbps: XM430 legs, STS3215 arms and an SCS0009 head.
pub fn mixed_robot() -> Robot {
    let mut file = gaitway_profiles::robot("op3").expect("a shipped robot");
    file.name = "mixed".into();
    file.rate_hz = 50.0;
    file.lines[0].kind = LineKind::Serial { baud_bps: 1_000_000 };
    for joint in &mut file.joints {
        if joint.id <= 6 {
            joint.servo = "sts3215".into();
        } else if joint.name.starts_with("head") {
            joint.servo = "scs0009".into();
        }
    }
    let setups = std::mem::take(&mut file.setups);
    file.setups = setups.into_iter().filter(|setup| setup.joints.is_none()).collect();
    file.setups[0].registers.insert("Baud Rate".into(), 3);
    file.setups.push(setup("sts3215", 3 * 256 + 10, &[("Baud Rate", 0)]));
    file.setups.push(setup("scs0009", 3 * 256, &[("Baud Rate", 0)]));
    Robot::new(file).expect("a robot")
}

/// Takes samples and lets the host stall: after every cycle in `stalls`, for that long.
pub struct SlowHost {
    pub world: SharedWorld,
    pub stall: Box<dyn Fn(u64) -> Duration>,
    pub goals_rad: Vec<Vec<f64>>,
}

impl Sink for SlowHost {
    fn take(&mut self, sample: &Sample<'_>) {
        self.goals_rad.push(sample.goal_rad.to_vec());
        let mut world = self.world.lock();
        let until = world.now_ns() + (self.stall)(sample.cycle).as_nanos() as u64;
        world.run_until(until);
    }
}

/// The referee saw nothing wrong but what the run itself says it could not help: the ends of joints
/// that no word reached or that had let go, and of all joints where the motion could not be run down
/// to rest. How many violations were excused so.
pub fn assert_excused(played: &Played, link: &Link) -> usize {
    let (kept, excused): (Vec<_>, Vec<_>) =
        played.verdict.violations.iter().partition(|v| !is_excused(v, &played.run, link));
    let seen: Vec<String> = kept.iter().map(ToString::to_string).collect();
    assert!(seen.is_empty(), "the referee saw:\n{}", seen.join("\n"));
    excused.len()
}

/// Whether one of the exceptions of a run explains why a joint did not come to rest.
pub fn is_excused(violation: &Violation, run: &Run, link: &Link) -> bool {
    let line_of = |name: &String| link.robot().line_of(name);
    let named = |of: &String| violation.joint.as_ref() == Some(of);
    matches!(violation.rule, Rule::RestAtEnds | Rule::SpeedChange)
        && run.exceptions.iter().any(|exception| match exception {
            Exception::LineLost { line } => {
                violation.joint.as_ref().and_then(line_of).as_ref() == Some(line)
            }
            Exception::Limp { joint }
            | Exception::GoalHeld { joint }
            | Exception::JointHeldBack { joint }
            | Exception::NoAnswer { joint }
            | Exception::StoppedByWatchdog { joint } => named(joint),
            Exception::BlindRamp { .. }
            | Exception::GuardRefused
            | Exception::Stalled { .. }
            | Exception::GoalsBroke => true,
            // The first goals, or the last, may not have been heard.
            Exception::MissedGoals { joint } => named(joint) && violation.rule == Rule::RestAtEnds,
            Exception::SentLate { .. } => violation.rule == Rule::SpeedChange,
            Exception::HeldBack { line } => {
                violation.rule == Rule::SpeedChange
                    && violation.joint.as_ref().and_then(line_of).as_ref() == Some(line)
            }
        })
}

/// The referee saw nothing wrong.
pub fn assert_clean(verdict: &Verdict) {
    let seen: Vec<String> = verdict.violations.iter().map(ToString::to_string).collect();
    assert!(verdict.is_clean(), "the referee saw:\n{}", seen.join("\n"));
    assert!(verdict.goals > 0, "the referee saw no goal at all");
}

/// Takes out of the verdict that these joints did not come to rest: no goal reached them any more.
/// How often, R2b and R12.
pub fn excuse_unreached(verdict: &mut Verdict, joints: &[String]) -> [u64; 2] {
    let before = [Rule::RestAtEnds, Rule::SpeedChange].map(|rule| verdict.count(rule));
    verdict.excuse(|violation| {
        let unreached = violation.joint.as_ref().is_some_and(|name| joints.contains(name));
        unreached && matches!(violation.rule, Rule::RestAtEnds | Rule::SpeedChange)
    });
    let after = [Rule::RestAtEnds, Rule::SpeedChange].map(|rule| verdict.count(rule));
    [before[0] - after[0], before[1] - after[1]]
}
