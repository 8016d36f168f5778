//! A few Damiao actuators on the CAN line of a robot: registers, a state, and where they stand.

use super::{ANSWERS_NS, Robot, Shared};
use crate::port::{FramePort, Heard, PortError};
use crate::time::Instant;
use crate::wire::can::{CanFrame, CanId, Format};

/// A frame of eight bytes at 1 Mbit/s, with the most stuff bits there can be.
const FRAME_NS: u64 = 135_000;

/// Where all are asked how they are and for registers.
pub(crate) const REGISTERS: u32 = 0x7FF;
pub(crate) const TIMEOUT: u8 = 9;
pub(crate) const CTRL_MODE: u8 = 10;
pub(crate) const PMAX: u8 = 21;

pub(crate) const HOW_IT_IS: u8 = 0xCC;
pub(crate) const READ: u8 = 0x33;

pub(crate) const ENABLE: u8 = 0xFC;

/// One actuator: what it holds and what ails it.
#[derive(Clone, Debug)]
pub(crate) struct Damiao {
    pub id: u8,
    pub registers: [u32; 64],
    /// 0: it does not drive; 1: it does; else a fault, and it does not drive.
    pub state: u8,
    /// Where it stands, a step of its range.
    pub position: u16,
    /// It neither hears nor answers.
    pub silent: bool,
    /// It answers a write of these registers with what it was told and keeps what it has.
    pub forgets: Vec<u8>,
    /// It does not switch on, whoever tells it to.
    pub stays_off: bool,
    /// Its answers to goals and orders are lost until it was asked how it is.
    pub unheard_until_asked: bool,
}

impl Damiao {
    /// As it leaves the factory, in the mode that goals need.
    pub fn new(id: u8) -> Self {
        let mut registers = [0; 64];
        registers[usize::from(CTRL_MODE)] = 1;
        for (number, end) in (PMAX..).zip([12.5_f32, 30.0, 10.0]) {
            registers[usize::from(number)] = end.to_bits();
        }
        Self {
            id,
            registers,
            state: 0,
            position: 0x7FFF,
            silent: false,
            forgets: Vec::new(),
            stays_off: false,
            unheard_until_asked: false,
        }
    }

    pub fn register(&self, number: u8) -> u32 {
        self.registers[usize::from(number)]
    }

    fn says(&self, payload: &[u8]) -> Option<CanFrame> {
        CanFrame::new(CanId::standard(0x10 + u32::from(self.id))?, Format::Classic, payload)
    }

    fn feedback(&self) -> Option<CanFrame> {
        let [high, low] = self.position.to_be_bytes();
        // It stands still, without load, at 30 degrees.
        self.says(&[self.id | self.state << 4, high, low, 0x7F, 0xF7, 0xFF, 30, 30])
    }

    /// Its answer to `frame`, if that is for it.
    fn hear(&mut self, frame: &CanFrame) -> Option<CanFrame> {
        let &[b0, b1, what, number, b4, b5, b6, b7] = frame.payload() else { return None };
        let to = frame.id().number();
        if self.silent || to != REGISTERS && to != u32::from(self.id) {
            return None;
        }
        if to == REGISTERS {
            let register = self.registers.get_mut(usize::from(number))?;
            let mut value = u32::from_le_bytes([b4, b5, b6, b7]);
            match what {
                _ if b0 != self.id => return None,
                HOW_IT_IS => {
                    self.unheard_until_asked = false;
                    return self.feedback();
                }
                READ => value = *register,
                0x55 if self.forgets.contains(&number) => {}
                0x55 => *register = value,
                _ => panic!("nothing an actuator of these tests knows: {frame:?}"),
            }
            let [v0, v1, v2, v3] = value.to_le_bytes();
            return self.says(&[self.id, 0, what, number, v0, v1, v2, v3]);
        }
        match (frame.payload(), b7) {
            ([0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, _], ENABLE) => {
                self.state = if self.stays_off { self.state } else { 1 };
            }
            // It lets go, or forgets what was wrong.
            ([0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, _], 0xFD) if self.state > 1 => {}
            ([0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, _], 0xFB | 0xFD) => self.state = 0,
            _ if self.state == 1 => self.position = u16::from_be_bytes([b0, b1]),
            _ => {}
        }
        if self.unheard_until_asked { None } else { self.feedback() }
    }
}

/// The host's end of the CAN line.
pub(super) struct CanPort(pub Shared);

impl FramePort for CanPort {
    fn send(&mut self, frame: &CanFrame, _deadline: Instant) -> Result<(), PortError> {
        let world = &mut *self.0.lock();
        if let Some((kind, takes)) = world.slow
            && frame.id().number() == REGISTERS
            && frame.payload().get(2) == Some(&kind)
        {
            world.stall(takes);
        }
        world.frames.push((Instant::from_nanos(world.now_ns), *frame));
        let mut at_ns = world.now_ns + FRAME_NS + ANSWERS_NS;
        for actuator in &mut world.actuators {
            if let Some(answer) = actuator.hear(frame) {
                at_ns += FRAME_NS;
                world.answers.push_back((at_ns, answer));
            }
        }
        Ok(())
    }

    fn receive(&mut self, deadline: Instant) -> Result<Heard, PortError> {
        let world = &mut *self.0.lock();
        let first = world.answers.front().map(|&(at_ns, frame)| (at_ns.max(world.now_ns), frame));
        let Some((at_ns, frame)) = first.filter(|&(at_ns, _)| at_ns <= deadline.as_nanos()) else {
            world.wait_until(deadline);
            return Err(PortError::TimedOut);
        };
        world.answers.pop_front();
        world.now_ns = at_ns;
        Ok(Heard::Frame(frame))
    }

    fn full_queue_count(&self) -> u64 {
        0
    }
}

/// The same robot with so many actuators more, on a CAN line of their own: the first has ID 1.
pub(crate) fn with_actuators(robot: Robot, count: u8) -> Robot {
    with_others(robot, count, "dm4310", None)
}

/// The same with others, which let go after this silence; there is nobody behind them who speaks
/// their language.
pub(crate) fn with_others(
    robot: Robot,
    count: u8,
    actuator: &str,
    timeout_s: Option<f64>,
) -> Robot {
    let mut file = robot.file;
    let on_can = Robot::load("berkeley-humanoid-lite").expect("shipped").file;
    let mut line = on_can.lines[0].clone();
    line.name = "can".to_owned();
    file.lines.push(line);
    for id in 1..=count {
        let mut joint = on_can.joints[0].clone();
        (joint.name, joint.line) = (format!("joint{}", file.joints.len()), "can".to_owned());
        (joint.servo, joint.id) = (actuator.to_owned(), id);
        (joint.parent, joint.timeout_configured_s) = (None, timeout_s);
        joint.answer_id = Some(0x10 + u16::from(id));
        (joint.kp_nm_rad, joint.kd_nm_s_rad) = (Some(40.0), Some(1.5));
        file.joints.push(joint);
    }
    Robot::new(file).expect("a robot")
}
