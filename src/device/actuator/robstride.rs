//! CyberGear and RobStride in the makers' own protocol, run mode 0.

use super::{
    Goal, Language, Order, Placing, Question, Setting, Told, Wanted, coded, decoded, no_such_id,
    value,
};
use crate::bus::can::Shape;
use crate::device::coded::Impedance;
use crate::wire::can::CanFrame;
use crate::wire::can::robstride::{self, Command, Id, Message, command, message, parameter};
use gaitway_profiles::Ranges;

/// Number of the setting that says how long the host may be silent.
pub(super) const TIMEOUT: u16 = parameter::CAN_TIMEOUT;
/// Not a parameter: stands for the number of the device's processor.
const IDENTITY: u16 = 0;
/// Goal of run mode 3, A (manual, section 4.1.12).
const CURRENT_GOAL: u16 = 0x7006;
/// Value of the run mode in which it takes motion commands.
const MOTION: u32 = 0;
const STEP_C: f64 = 0.1;

#[derive(Debug)]
pub(super) struct Robstride {
    id: Id,
    host: Id,
    placing: Placing,
    ranges: Ranges,
}

impl Robstride {
    pub fn new(placing: Placing, ranges: Ranges, host_id: u8) -> Result<Self, String> {
        let id = Id::new(placing.id).ok_or_else(|| no_such_id(placing.id))?;
        let host = Id::new(host_id).ok_or_else(|| no_such_id(host_id))?;
        Ok(Self { id, host, placing, ranges })
    }

    fn said(&self, frame: &CanFrame) -> Option<Message> {
        let (id, message) = message(frame)?;
        (id == self.id).then_some(message)
    }

    fn command(&self, what: Command) -> CanFrame {
        command(self.host, self.id, what)
    }

    fn read(&self, number: u16) -> Question {
        Question::setting(number, self.command(Command::Read(number)))
    }
}

impl Language for Robstride {
    fn told(&self, frame: &CanFrame) -> Option<Told> {
        Some(match self.said(frame)? {
            Message::Feedback(feedback) => decoded(&feedback, &self.ranges, STEP_C),
            Message::Fault { faults, .. } => {
                Told { faults: Some(robstride::faults(faults)), ..Told::default() }
            }
            // Answers to questions that were given up.
            _ => Told::default(),
        })
    }

    /// Whether it drives, and what is wrong with it, is told with the answers to commands only.
    fn ask_state(&self) -> Option<Question> {
        Some(self.read(parameter::POSITION))
    }

    fn ask_slowly(&self) -> Vec<Question> {
        vec![self.read(parameter::BUS_VOLTAGE)]
    }

    fn ask_setting(&self, number: u16) -> Option<Question> {
        if number == IDENTITY {
            return Some(Question::setting(IDENTITY, self.command(Command::Identify)));
        }
        Some(self.read(number))
    }

    fn setting(&self, number: u16, frame: &CanFrame) -> Option<Told> {
        let told = match self.said(frame)? {
            Message::Identity([.., b0, b1, b2, b3]) if number == IDENTITY => {
                value(u32::from_be_bytes([b0, b1, b2, b3]))
            }
            Message::Parameter(index, bits) if index == number => value(bits),
            _ => return None,
        };
        let float = || told.value.map(|bits| f64::from(f32::from_bits(bits)));
        Some(match number {
            parameter::POSITION => Told { position_rad: float(), ..told },
            parameter::BUS_VOLTAGE => Told { voltage_v: float(), ..told },
            _ => told,
        })
    }

    fn write_setting(&self, number: u16, bits: u32) -> Option<CanFrame> {
        let goals = [parameter::POSITION_GOAL, parameter::SPEED_GOAL, CURRENT_GOAL];
        (!goals.contains(&number)).then(|| self.command(Command::Write(number, bits)))
    }

    fn settings(&self) -> Vec<Setting> {
        vec![
            Setting { number: IDENTITY, name: "processor number", wanted: Wanted::Told },
            Setting {
                number: parameter::RUN_MODE,
                name: "run_mode",
                wanted: Wanted::Written(MOTION),
            },
        ]
    }

    fn order(&self, order: Order) -> Vec<CanFrame> {
        match order {
            Order::Enable => vec![self.command(Command::Enable)],
            Order::LetGo => vec![self.command(Command::Disable { clear_faults: false })],
            Order::ForgetSilence => vec![self.command(Command::Disable { clear_faults: true })],
            Order::HeedGoals => Vec::new(),
        }
    }

    fn goal(&self, goal: Goal) -> CanFrame {
        let setpoint = coded::robstride_setpoint(Impedance::of(goal, self.placing), &self.ranges);
        self.command(Command::Setpoint(setpoint))
    }

    fn beside_goal(&self) -> Vec<Shape> {
        vec![Shape::classic(true, 8)]
    }
}
