//! moteus in position mode: each command says how long it holds and asks for the state.

use super::{Goal, Language, Order, Question, Setting, Told, Wanted, no_such_id, plain, value};
use crate::bus::can::Shape;
use crate::wire::can::moteus::{
    self, Id, MODE_POSITION, MODE_STOPPED, Message, Part, Resolution, Route, Values, register,
};
use crate::wire::can::{CanFrame, Format, Number};
use std::f64::consts::TAU;

/// The host's id, as the maker's programs have it.
const HOST: u8 = 0;
/// Supply voltage, in steps of 0.5 V of one byte.
const VOLTAGE: u16 = 0x00D;
const STEP_V: f64 = 0.5;
/// The kind of board, and the version of its firmware.
const MODEL: u16 = 0x100;
const FIRMWARE: u16 = 0x101;
/// Bytes of an answer with mode, position, velocity, torque, voltage, temperature and fault: 22.
const ANSWER_BYTES: usize = 24;
/// Largest id whose answers have an identifier of 11 bits.
const LAST_SHORT: u8 = 7;

#[derive(Debug)]
pub(super) struct Moteus {
    id: Id,
    host: Id,
}

impl Moteus {
    pub fn new(id: u8) -> Result<Self, String> {
        let host = Id::new(HOST).ok_or_else(|| no_such_id(HOST))?;
        Ok(Self { id: Id::new(id).ok_or_else(|| no_such_id(id))?, host })
    }

    /// A frame of these writes that asks for the state as well.
    fn frame(&self, writes: &[(u16, Values<'_>)]) -> CanFrame {
        let mut message = Message::default();
        let mut whole = Ok(());
        for (start, values) in writes {
            whole = whole.and(message.write(*start, *values));
        }
        let reads = [
            (Resolution::Int8, register::MODE, 1),
            (Resolution::Float, register::POSITION, 3),
            (Resolution::Int8, VOLTAGE, 3),
        ];
        for (resolution, start, count) in reads {
            whole = whole.and(message.read(resolution, start, count));
        }
        debug_assert!(whole.is_ok(), "25 of 64 bytes at most");
        message.frame(self.route())
    }

    fn route(&self) -> Route {
        Route { source: self.host, destination: self.id, reply: true, fast: true }
    }

    /// The number of register `number` in a frame of this device.
    fn number(&self, number: u16, frame: &CanFrame) -> Option<Number> {
        let (source, destination) = moteus::ends(frame)?;
        if (source, destination) != (self.id, self.host) {
            return None;
        }
        moteus::parts(frame.payload()).find_map(|part| match part {
            Part::Value(register, value) if register == u32::from(number) => value,
            _ => None,
        })
    }
}

impl Language for Moteus {
    fn told(&self, frame: &CanFrame) -> Option<Told> {
        let feedback = moteus::feedback(self.id, frame)?;
        let radians = |number: Option<Number>| Some(plain(number?)? * TAU);
        let says_mode = feedback.enabled.is_some();
        Some(Told {
            position_rad: radians(feedback.position),
            velocity_rad_s: radians(feedback.velocity),
            temperature_c: feedback.temperature.and_then(plain),
            voltage_v: self.number(VOLTAGE, frame).and_then(plain).map(|steps| steps * STEP_V),
            enabled: feedback.enabled,
            faults: says_mode.then_some(feedback.faults),
            ..Told::default()
        })
    }

    fn ask_state(&self) -> Option<Question> {
        Some(Question::state(self.frame(&[])))
    }

    fn ask_enabled(&self) -> Option<Question> {
        self.ask_state()
    }

    fn ask_setting(&self, number: u16) -> Option<Question> {
        let mut message = Message::default();
        message.read(Resolution::Int32, number, 1).ok()?;
        Some(Question::setting(number, message.frame(self.route())))
    }

    fn setting(&self, number: u16, frame: &CanFrame) -> Option<Told> {
        match self.number(number, frame)? {
            Number::Steps(steps) => Some(value(steps.cast_unsigned())),
            Number::Code { .. } | Number::Value(_) => None,
        }
    }

    fn settings(&self) -> Vec<Setting> {
        vec![
            Setting { number: MODEL, name: "model", wanted: Wanted::Told },
            Setting { number: FIRMWARE, name: "firmware", wanted: Wanted::Told },
        ]
    }

    fn order(&self, order: Order) -> Vec<CanFrame> {
        match order {
            // Letting go is also how it forgets.
            Order::LetGo | Order::ForgetSilence => {
                vec![self.frame(&[(register::MODE, Values::Int8(&[MODE_STOPPED]))])]
            }
            Order::Enable | Order::HeedGoals => Vec::new(),
        }
    }

    /// Without a speed: it would go on at that speed when its host falls silent.
    fn goal(&self, goal: Goal) -> CanFrame {
        let position = (goal.position_rad / TAU) as f32;
        // Not-a-number is for good.
        let holds_s = goal.holds_s.map_or(f32::NAN, |holds_s| holds_s as f32);
        self.frame(&[
            (register::MODE, Values::Int8(&[MODE_POSITION])),
            (register::COMMAND, Values::Float(&[position, 0.0])),
            (register::WATCHDOG, Values::Float(&[holds_s])),
        ])
    }

    fn beside_goal(&self) -> Vec<Shape> {
        let extended = self.id.get() > LAST_SHORT;
        vec![Shape { extended, format: Format::Fd { fast: true }, bytes: ANSWER_BYTES }]
    }

    fn goal_enables(&self) -> bool {
        true
    }
}
