//! Recoil in position mode; it keeps its own gains.

use super::{Goal, Language, Order, Question, Setting, Told, Wanted, no_such_id, plain, value};
use crate::bus::can::Shape;
use crate::wire::can::CanFrame;
use crate::wire::can::recoil::{
    Command, Id, Message, Mode, command, drives, faults, message, parameter,
};

/// Number of the setting that says how long the host may be silent.
pub(super) const WATCHDOG: u16 = parameter::WATCHDOG;

#[derive(Debug)]
pub(super) struct Recoil {
    id: Id,
}

impl Recoil {
    pub fn new(id: u8) -> Result<Self, String> {
        Ok(Self { id: Id::new(id).ok_or_else(|| no_such_id(id))? })
    }

    fn read(&self, number: u16) -> Question {
        Question::setting(number, command(self.id, Command::Read(number)))
    }
}

impl Language for Recoil {
    fn told(&self, frame: &CanFrame) -> Option<Told> {
        let (_, message) = message(frame).filter(|(id, _)| *id == self.id)?;
        let Message::Feedback(feedback) = message else { return Some(Told::default()) };
        Some(Told {
            position_rad: feedback.position.and_then(plain),
            velocity_rad_s: feedback.velocity.and_then(plain),
            ..Told::default()
        })
    }

    fn ask_state(&self) -> Option<Question> {
        Some(self.read(parameter::POSITION))
    }

    fn ask_enabled(&self) -> Option<Question> {
        Some(self.read(parameter::MODE))
    }

    /// The answers to goals tell neither.
    fn ask_slowly(&self) -> Vec<Question> {
        [parameter::MODE, parameter::ERROR, parameter::BUS_VOLTAGE]
            .map(|number| self.read(number))
            .to_vec()
    }

    fn ask_setting(&self, number: u16) -> Option<Question> {
        Some(self.read(number))
    }

    fn setting(&self, number: u16, frame: &CanFrame) -> Option<Told> {
        let (_, message) = message(frame).filter(|(id, _)| *id == self.id)?;
        let Message::Parameter(bits) = message else { return None };
        let float = Some(f64::from(f32::from_bits(bits)));
        let told = value(bits);
        Some(match number {
            parameter::POSITION => Told { position_rad: float, ..told },
            parameter::VELOCITY => Told { velocity_rad_s: float, ..told },
            parameter::BUS_VOLTAGE => Told { voltage_v: float, ..told },
            parameter::MODE => Told { enabled: Some(drives(bits)), ..told },
            parameter::ERROR => Told { faults: Some(faults(bits)), ..told },
            _ => told,
        })
    }

    /// Its whole memory can be written. Behind the limits lie what it measures and its goals, before
    /// them its mode.
    fn write_setting(&self, number: u16, bits: u32) -> Option<CanFrame> {
        let kept = [parameter::WATCHDOG, parameter::UNASKED_RATE].contains(&number)
            || (parameter::KP..=parameter::UPPER_LIMIT).contains(&number);
        kept.then(|| command(self.id, Command::Write(number, bits)))
    }

    fn settings(&self) -> Vec<Setting> {
        let id = Wanted::Exactly(self.id.get().into());
        vec![
            Setting { number: parameter::DEVICE_ID, name: "device_id", wanted: id },
            Setting { number: parameter::FIRMWARE, name: "firmware", wanted: Wanted::Told },
        ]
    }

    fn order(&self, order: Order) -> Vec<CanFrame> {
        let mode = |mode| command(self.id, Command::Mode(mode));
        match order {
            // A disabled device must be idle first.
            Order::Enable => vec![mode(Mode::Idle), mode(Mode::Position)],
            Order::LetGo => vec![mode(Mode::Idle)],
            Order::ForgetSilence => {
                vec![mode(Mode::Idle), command(self.id, Command::Write(parameter::ERROR, 0))]
            }
            Order::HeedGoals => Vec::new(),
        }
    }

    fn goal(&self, goal: Goal) -> CanFrame {
        let [position, velocity] = [goal.position_rad, goal.velocity_rad_s].map(|x| x as f32);
        command(self.id, Command::PositionVelocity(position, velocity))
    }

    fn beside_goal(&self) -> Vec<Shape> {
        vec![Shape::classic(false, 8)]
    }
}
