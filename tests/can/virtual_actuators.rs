//! Every dialect with a virtual actuator of its family on the other side of the kernel: it is
//! enabled, follows, tells where it is, and lets go. Where it really is is looked up past the line.

use super::{FAST, frame, open, soon};
use gaitway::device::coded::{Impedance, mit_setpoint, robstride_setpoint, symmetric};
use gaitway::port::can::CanInterface;
use gaitway::port::{Clock as _, FramePort as _, Heard, MonotonicClock};
use gaitway::time::Duration;
use gaitway::wire::can::{CanFrame, CanId, Faults, Feedback, Format, Number};
use gaitway::wire::can::{cubemars, damiao, moteus, odrive, recoil, robstride};
use gaitway_profiles::Ranges;
use gaitway_sim::can::{Actuator, CanFrame as VirtualFrame, CanHeard, CanLine, CanOptions, Kind};
use std::f64::consts::TAU;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{JoinHandle, spawn};

/// Where each of them is sent, rad.
const GOAL_RAD: f64 = 0.5;

/// A virtual line with one actuator, behind an interface of the kernel, in real time.
struct Bench {
    port: CanInterface,
    line: Arc<Mutex<CanLine>>,
    over: Arc<AtomicBool>,
    carrier: Option<JoinHandle<()>>,
}

impl Bench {
    fn new(interface: &str, model: &str, id: u8) -> Bench {
        let actuator = Actuator::new(model, id).expect("an actuator");
        let line = Arc::new(Mutex::new(CanLine::new(CanOptions::default(), vec![actuator])));
        let (port, other_end) = (open(interface), open(interface));
        let over = Arc::new(AtomicBool::new(false));
        let (its_line, its_over) = (Arc::clone(&line), Arc::clone(&over));
        let carrier = Some(spawn(move || carry(other_end, &its_line, &its_over)));
        Bench { port, line, over, carrier }
    }

    fn say(&mut self, frame: CanFrame) {
        self.port.send(&frame, soon()).expect("sent");
    }

    /// What `read` makes of the first frame of which it makes anything.
    fn hear<T>(&mut self, read: impl Fn(&CanFrame) -> Option<T>) -> T {
        loop {
            match self.port.receive(soon()) {
                Ok(Heard::Frame(frame)) => {
                    if let Some(value) = read(&frame) {
                        return value;
                    }
                }
                other => panic!("{other:?}"),
            }
        }
    }

    /// Says `goal` until the actuator tells that it is there, and looks whether it is.
    fn follows(&mut self, goal: CanFrame, position: impl Fn(&CanFrame) -> Option<f64>) {
        let end = soon();
        loop {
            self.say(goal);
            let told = self.hear(&position);
            let there = (told - GOAL_RAD).abs() <= 0.02;
            assert!(there || MonotonicClock.now() < end, "it stands at {told} rad");
            if there {
                break;
            }
        }
        let is = self.past_the_line(Actuator::position_rad);
        assert!((is - GOAL_RAD).abs() <= 0.05, "it is at {is} rad");
    }

    fn past_the_line<T>(&self, look: impl Fn(&Actuator) -> T) -> T {
        look(&self.line.lock().unwrap_or_else(PoisonError::into_inner).actuators()[0])
    }

    fn lets_go(&mut self, order: CanFrame) {
        let end = soon();
        self.say(order);
        while self.past_the_line(Actuator::enabled) {
            assert!(MonotonicClock.now() < end, "it still drives");
            std::thread::yield_now();
        }
    }
}

impl Drop for Bench {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Relaxed);
        let ended = self.carrier.take().map(JoinHandle::join);
        assert!(std::thread::panicking() || matches!(ended, Some(Ok(()))), "the carrier failed");
    }
}

/// Carries frames between the interface and the virtual line, whose time is the clock's.
fn carry(mut port: CanInterface, line: &Mutex<CanLine>, over: &AtomicBool) {
    let start = MonotonicClock.now();
    while !over.load(Ordering::Relaxed) {
        let mut heard = Vec::new();
        {
            let mut line = line.lock().unwrap_or_else(PoisonError::into_inner);
            line.run_until(MonotonicClock.now().since(start).as_nanos() as u64);
            while let Some(CanHeard::Frame(frame)) = line.receive() {
                heard.push(ours(&frame));
            }
        }
        for frame in heard {
            port.send(&frame, soon()).expect("sent");
        }
        let a_moment = MonotonicClock.now() + Duration::from_millis(1);
        if let Ok(Heard::Frame(frame)) = port.receive(a_moment) {
            let mut line = line.lock().unwrap_or_else(PoisonError::into_inner);
            line.send(theirs(&frame)).expect("room");
        }
    }
}

fn ours(theirs: &VirtualFrame) -> CanFrame {
    let id = if theirs.extended { CanId::extended(theirs.id) } else { CanId::standard(theirs.id) };
    let format = match theirs.kind {
        Kind::Classic => Format::Classic,
        Kind::Remote(length) => Format::Remote { length },
        Kind::Fd { fast } => Format::Fd { fast },
    };
    frame(id, format, &theirs.bytes)
}

fn theirs(ours: &CanFrame) -> VirtualFrame {
    let kind = match ours.format() {
        Format::Classic => Kind::Classic,
        Format::Remote { length } => Kind::Remote(length),
        Format::Fd { fast } => Kind::Fd { fast },
    };
    let (id, extended) = (ours.id().number(), ours.id().is_extended());
    VirtualFrame { id, extended, kind, bytes: ours.payload().to_vec() }
}

fn ranges(model: &str) -> Ranges {
    gaitway_profiles::actuator(model).expect("shipped").ranges.expect("coded")
}

/// A spring that is damped well with the inertia of a virtual actuator.
fn wanted() -> Impedance {
    Impedance {
        position_rad: GOAL_RAD,
        velocity_rad_s: 0.0,
        kp_nm_rad: 30.0,
        kd_nm_s_rad: 1.0,
        torque_nm: 0.0,
    }
}

fn coded(feedback: Feedback, ranges: &Ranges) -> Option<f64> {
    symmetric(feedback.position?, ranges.position_rad)
}

/// In so many radians a step or a unit.
fn scaled(feedback: Feedback, rad: f64) -> Option<f64> {
    match feedback.position? {
        Number::Steps(steps) => Some(f64::from(steps) * rad),
        Number::Value(value) => Some(f64::from(value) * rad),
        Number::Code { .. } => None,
    }
}

#[test]
#[ignore = "needs CAN interfaces"]
fn a_cubemars_in_mit_mode_follows() {
    let ranges = ranges("ak80-9");
    let id = cubemars::Id::new(3).expect("an id");
    let mut bench = Bench::new("vcan1", "ak80-9", 3);
    bench.say(cubemars::mit_command(id, cubemars::MitCommand::Enable));
    let goal = cubemars::MitCommand::Setpoint(mit_setpoint(wanted(), &ranges));
    bench.follows(cubemars::mit_command(id, goal), |frame| {
        coded(cubemars::mit_reply(frame).filter(|(whose, _)| *whose == id)?.1, &ranges)
    });
    bench.lets_go(cubemars::mit_command(id, cubemars::MitCommand::Disable));
}

#[test]
#[ignore = "needs CAN interfaces"]
fn a_cubemars_in_servo_mode_follows_and_tells_unasked() {
    let id = cubemars::Id::new(5).expect("an id");
    let mut bench = Bench::new("vcan1", "ak80-9-servo", 5);
    let goal = cubemars::ServoCommand::Position((GOAL_RAD.to_degrees() * 1e4) as i32);
    bench.follows(cubemars::servo_command(id, goal), |frame| {
        let (_, feedback) = cubemars::servo_feedback(frame).filter(|(whose, _)| *whose == id)?;
        scaled(feedback, 0.1_f64.to_radians())
    });
}

#[test]
#[ignore = "needs CAN interfaces"]
fn a_damiao_follows_and_tells_of_a_silent_host() {
    use damiao::{Command, Request, register, register_value, request};
    let ranges = ranges("dm4310");
    let id = damiao::Id::new(1).expect("an id");
    let mut bench = Bench::new("vcan1", "dm4310", 1);
    bench.say(request(id, Request::Read(register::PMAX)));
    let end = bench.hear(|frame| register_value(id, 0, register::PMAX, frame));
    assert_eq!(f64::from(f32::from_bits(end)), ranges.position_rad);
    bench.say(damiao::command(id, Command::Enable));
    let goal = Command::Setpoint(mit_setpoint(wanted(), &ranges));
    bench.follows(damiao::command(id, goal), |frame| {
        coded(damiao::feedback(id, 0, frame).filter(|f| f.enabled == Some(true))?, &ranges)
    });
    // 100 ms of silence; the guest is told of it whenever it looks.
    bench.say(request(id, Request::Write(register::TIMEOUT, 2_000)));
    bench.hear(|frame| register_value(id, 0, register::TIMEOUT, frame));
    let end = soon();
    while bench.past_the_line(Actuator::enabled) {
        assert!(MonotonicClock.now() < end, "it drives without a host");
        std::thread::yield_now();
    }
    bench.say(request(id, Request::Feedback));
    let faults = bench.hear(|frame| damiao::feedback(id, 0, frame)).faults;
    assert!(faults.any(Faults::SILENCE), "{faults}");
}

#[test]
#[ignore = "needs CAN interfaces"]
fn a_robstride_follows_with_a_timeout_set() {
    use robstride::{Command, Message, command, parameter};
    let ranges = ranges("rs02");
    let [host, id] = [0xFD, 0x7F].map(|number| robstride::Id::new(number).expect("an id"));
    let mut bench = Bench::new("vcan1", "rs02", 0x7F);
    bench.say(command(host, id, Command::Write(parameter::CAN_TIMEOUT, 100_000)));
    bench.say(command(host, id, Command::Read(parameter::CAN_TIMEOUT)));
    let set = bench.hear(|frame| match robstride::message(frame)?.1 {
        Message::Parameter(parameter::CAN_TIMEOUT, value) => Some(value),
        _ => None,
    });
    assert_eq!(set, 100_000, "five seconds");
    bench.say(command(host, id, Command::Enable));
    let goal = Command::Setpoint(robstride_setpoint(wanted(), &ranges));
    bench.follows(command(host, id, goal), |frame| match robstride::message(frame)? {
        (whose, Message::Feedback(feedback)) if whose == id => coded(feedback, &ranges),
        _ => None,
    });
    bench.lets_go(command(host, id, Command::Disable { clear_faults: false }));
}

#[test]
#[ignore = "needs CAN interfaces"]
fn an_odrive_follows_and_beats() {
    use odrive::{Command, Message, command};
    let id = odrive::Id::new(7).expect("an id");
    let mut bench = Bench::new("vcan1", "odrive-s1", 7);
    bench.say(command(id, Command::Mode { control: 3, input: 1 }));
    bench.say(command(id, Command::State(odrive::STATE_CLOSED_LOOP)));
    let beat = bench.hear(|frame| match odrive::message(frame)? {
        (whose, Message::Heartbeat { error, state }) if whose == id && state == 8 => Some(error),
        _ => None,
    });
    assert_eq!(beat, 0);
    let position = (GOAL_RAD / TAU) as f32;
    let goal = command(id, Command::Position { position, velocity: 0, torque: 0 });
    bench.follows(goal, |frame| match odrive::message(frame)? {
        (whose, Message::Feedback(feedback)) if whose == id => scaled(feedback, TAU),
        _ => None,
    });
    bench.lets_go(command(id, Command::State(odrive::STATE_IDLE)));
}

#[test]
#[ignore = "needs CAN interfaces"]
fn a_moteus_follows_over_fd() {
    use moteus::{MODE_POSITION, MODE_STOPPED, Message, Resolution, Values, register};
    let [host, id] = [0, 1].map(|number| moteus::Id::new(number).expect("an id"));
    let to = |message: &Message, reply| {
        message.frame(moteus::Route { source: host, destination: id, reply, fast: true })
    };
    let mut bench = Bench::new("vcan0", "moteus-n1", 1);
    let mut go = Message::default();
    go.write(register::MODE, Values::Int8(&[MODE_POSITION])).expect("fits");
    go.write(register::COMMAND, Values::Float(&[(GOAL_RAD / TAU) as f32, 0.0])).expect("fits");
    // Each command feeds the watchdog; the guest may stand still for longer than the factory's 0.1 s.
    go.write(register::WATCHDOG, Values::Float(&[5.0])).expect("fits");
    go.read(Resolution::Float, register::MODE, 4).expect("fits");
    let goal = to(&go, true);
    assert_eq!(goal.format(), FAST);
    bench.follows(goal, |frame| scaled(moteus::feedback(id, frame)?, TAU));
    let mut stop = Message::default();
    stop.write(register::MODE, Values::Int8(&[MODE_STOPPED])).expect("fits");
    bench.lets_go(to(&stop, false));
}

#[test]
#[ignore = "needs CAN interfaces"]
fn a_recoil_follows_and_tells_its_mode() {
    use recoil::{Command, Message, Mode, command, parameter};
    let id = recoil::Id::new(11).expect("an id");
    let mut bench = Bench::new("vcan1", "recoil-5010", 11);
    bench.say(command(id, Command::Mode(Mode::Position)));
    bench.say(command(id, Command::Read(parameter::MODE)));
    let mode = bench.hear(|frame| match recoil::message(frame)? {
        (whose, Message::Parameter(mode)) if whose == id => Some(mode),
        _ => None,
    });
    assert_eq!(mode, Mode::Position as u32);
    let goal = command(id, Command::PositionVelocity(GOAL_RAD as f32, 0.0));
    bench.follows(goal, |frame| match recoil::message(frame)? {
        (whose, Message::Feedback(feedback)) if whose == id => scaled(feedback, 1.0),
        _ => None,
    });
    bench.lets_go(command(id, Command::Mode(Mode::Idle)));
}
