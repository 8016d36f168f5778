//! Lines for tests of the bus: one that answers by script, and virtual robots.
#![allow(dead_code, missing_docs)]

use gaitway::bus::{Bus, Timing};
use gaitway::port::sim::{SharedWorld, VirtualClock, VirtualLine};
use gaitway::port::{BytePort, Clock, PortError};
use gaitway::time::{Duration, Instant};
use gaitway_profiles::{Robot, Setup};
use gaitway_sim::{Options, World};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex};

const BAUD_BPS: u32 = 1_000_000;

/// Bytes written as in a manual.
pub fn hex(text: &str) -> Vec<u8> {
    text.split_whitespace().map(|byte| u8::from_str_radix(byte, 16).expect("a byte")).collect()
}

/// What is said to one question: how long after it each answer begins, and its bytes.
type Answers = Vec<(Duration, Vec<u8>)>;

/// A line in virtual time on which each known question has its answers, those of the first
/// time it is asked, of the second, and so on.
#[derive(Default)]
struct Scripted {
    now_ns: u64,
    echo: bool,
    script: Vec<(Vec<u8>, VecDeque<Answers>)>,
    coming: VecDeque<(u64, Vec<u8>)>,
    sending_until_ns: u64,
    asked: Vec<Vec<u8>>,
}

#[derive(Clone, Default)]
pub struct ScriptedLine(Arc<Mutex<Scripted>>);

impl ScriptedLine {
    /// Answers `question` with `answers`, all to the same question, when it is asked next (and
    /// with what is said in further calls when it is asked again).
    pub fn on(&self, question: &str, answers: &[(Duration, &str)]) -> &Self {
        let question = hex(question);
        let answers = answers.iter().map(|(after, bytes)| (*after, hex(bytes))).collect();
        let mut line = self.0.lock().expect("one thread");
        match line.script.iter_mut().find(|(known, _)| *known == question) {
            Some((_, rounds)) => rounds.push_back(answers),
            None => line.script.push((question, VecDeque::from([answers]))),
        }
        self
    }

    pub fn echoing(&self) -> &Self {
        self.0.lock().expect("one thread").echo = true;
        self
    }

    /// Everything that was asked.
    pub fn asked(&self) -> Vec<Vec<u8>> {
        self.0.lock().expect("one thread").asked.clone()
    }

    pub fn bus(&self) -> Bus {
        let timing = Timing {
            baud_bps: BAUD_BPS,
            return_delay: Duration::from_micros(500),
            latency: Duration::ZERO,
        };
        Bus::new(Box::new(self.clone()), Arc::new(self.clone()), timing)
    }
}

impl Clock for ScriptedLine {
    fn now(&self) -> Instant {
        Instant::from_nanos(self.0.lock().expect("one thread").now_ns)
    }

    fn sleep_until(&self, at: Instant) {
        let mut line = self.0.lock().expect("one thread");
        line.now_ns = line.now_ns.max(at.as_nanos());
    }
}

impl BytePort for ScriptedLine {
    fn send(&mut self, bytes: &[u8], _deadline: Instant) -> Result<(), PortError> {
        let mut line = self.0.lock().expect("one thread");
        let line = &mut *line;
        let wire_ns = |bytes: &[u8]| bytes.len() as u64 * 10_000_000_000 / u64::from(BAUD_BPS);
        let end_ns = line.now_ns.max(line.sending_until_ns) + wire_ns(bytes);
        line.sending_until_ns = end_ns;
        line.asked.push(bytes.to_vec());
        if line.echo {
            line.coming.push_back((end_ns, bytes.to_vec()));
        }
        let known = line.script.iter_mut().find(|(question, _)| question == bytes);
        for (after, answer) in known.and_then(|(_, rounds)| rounds.pop_front()).unwrap_or_default()
        {
            let ready_ns = end_ns + after.as_nanos() as u64 + wire_ns(&answer);
            line.coming.push_back((ready_ns, answer));
        }
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], deadline: Instant) -> Result<usize, PortError> {
        let mut line = self.0.lock().expect("one thread");
        match line.coming.pop_front() {
            Some((ready_ns, bytes)) if ready_ns <= deadline.as_nanos() => {
                line.now_ns = line.now_ns.max(ready_ns);
                buffer[..bytes.len()].copy_from_slice(&bytes);
                Ok(bytes.len())
            }
            later => {
                line.coming.extend(later);
                line.coming.make_contiguous().sort_by_key(|&(ready_ns, _)| ready_ns);
                line.now_ns = line.now_ns.max(deadline.as_nanos());
                Err(PortError::TimedOut)
            }
        }
    }

    fn discard_input(&mut self) -> Result<(), PortError> {
        let mut line = self.0.lock().expect("one thread");
        let now_ns = line.now_ns;
        line.coming.retain(|&(ready_ns, _)| ready_ns > now_ns);
        Ok(())
    }
}

/// OP3's file: 20 servos on one line.
pub fn op3() -> Robot {
    // Servos alone: the board in its base is another device on the line.
    Robot { body: None, ..gaitway_profiles::robot("op3").expect("a shipped robot") }
}

/// OP3 with STS3215 servos on a line of 1 Mbit/s.
pub fn sts_robot() -> Robot {
    let mut robot = op3();
    for joint in &mut robot.joints {
        joint.servo = "sts3215".to_owned();
    }
    robot.lines[0].kind = gaitway_profiles::LineKind::Serial { baud_bps: BAUD_BPS };
    robot.setups = vec![Setup {
        servo: "sts3215".to_owned(),
        joints: None,
        firmware: 0x0309,
        registers: [("Baud Rate".to_owned(), 0)].into(),
        source: "a test".to_owned(),
    }];
    robot
}

/// OP3 with servos of four families in turn, one per protocol, on one line of 1 Mbit/s.
pub fn mixed_robot() -> Robot {
    let mut robot = op3();
    robot.lines[0].kind = gaitway_profiles::LineKind::Serial { baud_bps: BAUD_BPS };
    robot.setups.clear();
    for (servo, firmware) in
        [("ax-12a", 24), ("sts3215", 0x0309), ("scs0009", 0x0102), ("xm430-w350", 45)]
    {
        robot.setups.push(Setup {
            servo: servo.to_owned(),
            joints: None,
            firmware,
            registers: [].into(),
            source: "a test".to_owned(),
        });
    }
    for (k, joint) in robot.joints.iter_mut().enumerate() {
        joint.servo.clone_from(&robot.setups[k % 4].servo);
    }
    robot
}

/// The virtual robot and the bus on its first line.
pub fn virtual_bus(robot: &Robot, options: Options) -> (SharedWorld, Bus) {
    let latency = Duration::from_nanos(options.adapter_latency_ns);
    let world = SharedWorld::new(World::new(robot, options).expect("a virtual robot"));
    let baud_bps = robot.lines[0].baud_bps().expect("a serial line");
    let timing = Timing { baud_bps, return_delay: Duration::from_micros(508), latency };
    let port = VirtualLine::new(world.clone(), 0, baud_bps);
    let bus = Bus::new(Box::new(port), Arc::new(VirtualClock(world.clone())), timing);
    (world, bus)
}

/// So long after the start of the world's clock.
pub fn at_s(seconds: f64) -> Instant {
    Instant::ZERO + Duration::from_secs_f64(seconds)
}

/// So long from now on the world's clock.
pub fn in_s(world: &SharedWorld, seconds: f64) -> Instant {
    Instant::from_nanos(world.lock().now_ns()) + Duration::from_secs_f64(seconds)
}
