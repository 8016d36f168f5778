//! ODrive in position control, CAN Simple.

use super::{Goal, Language, Order, Question, Told, no_such_id, plain};
use crate::bus::can::Shape;
use crate::wire::can::odrive::{
    Command, Firmware, Id, Message, Request, STATE_CLOSED_LOOP, STATE_IDLE, command, faults,
    message, request,
};
use crate::wire::can::{CanFrame, Format};
use gaitway_profiles as profiles;
use std::f64::consts::TAU;

/// Control mode 3, position; input mode 1, as it comes (`ODrive.Controller`).
const AS_IT_COMES: Command = Command::Mode { control: 3, input: 1 };
/// How often it tells of itself unless set otherwise, Hz: heartbeat and estimates.
const HEARTBEAT_HZ: f64 = 10.0;
const ESTIMATES_HZ: f64 = 100.0;

#[derive(Debug)]
pub(super) struct Odrive {
    id: Id,
    firmware: Firmware,
}

impl Odrive {
    pub fn new(id: u8, profile: &profiles::Actuator) -> Result<Self, String> {
        // Two numberings of errors; the label of the profile says which firmware it is for.
        let old = profile.model.contains("firmware 0.5");
        let firmware = if old { Firmware::V05 } else { Firmware::V06 };
        Ok(Self { id: Id::new(id).ok_or_else(|| no_such_id(id))?, firmware })
    }
}

impl Language for Odrive {
    fn told(&self, frame: &CanFrame) -> Option<Told> {
        let (_, message) = message(frame).filter(|(id, _)| *id == self.id)?;
        Some(match message {
            Message::Heartbeat { error, state } => Told {
                enabled: Some(u32::from(state) == STATE_CLOSED_LOOP),
                faults: Some(faults(error, self.firmware)),
                ..Told::default()
            },
            Message::Feedback(feedback) => {
                let radians = |number: Option<_>| Some(plain(number?)? * TAU);
                Told {
                    position_rad: radians(feedback.position),
                    velocity_rad_s: radians(feedback.velocity),
                    current_a: feedback.torque.and_then(plain),
                    ..Told::default()
                }
            }
            Message::Supply(volt, _) => Told { voltage_v: Some(volt.into()), ..Told::default() },
        })
    }

    fn ask_state(&self) -> Option<Question> {
        Some(Question::state(request(self.id, Request::Estimates)))
    }

    fn ask_slowly(&self) -> Vec<Question> {
        vec![Question::state(request(self.id, Request::Supply))]
    }

    fn order(&self, order: Order) -> Vec<CanFrame> {
        let order = match order {
            Order::Enable => Command::State(STATE_CLOSED_LOOP),
            Order::LetGo => Command::State(STATE_IDLE),
            Order::ForgetSilence => Command::ClearErrors,
            Order::HeedGoals => AS_IT_COMES,
        };
        vec![command(self.id, order)]
    }

    fn goal(&self, goal: Goal) -> CanFrame {
        let position = (goal.position_rad / TAU) as f32;
        command(self.id, Command::Position { position, velocity: 0, torque: 0 })
    }

    fn beside_goal(&self) -> Vec<Shape> {
        let request = Shape { format: Format::Remote { length: 8 }, ..Shape::classic(false, 0) };
        vec![request, Shape::classic(false, 8)]
    }

    fn unasked(&self) -> Vec<(Shape, f64)> {
        let shape = Shape::classic(false, 8);
        vec![(shape, HEARTBEAT_HZ), (shape, ESTIMATES_HZ)]
    }

    fn answers_goals(&self) -> bool {
        false
    }
}
