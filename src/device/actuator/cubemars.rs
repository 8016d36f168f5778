//! CubeMars AK, in MIT mode and in servo mode.

use super::{Goal, Language, Order, Placing, Question, Told, coded, decoded, no_such_id, plain};
use crate::bus::can::Shape;
use crate::device::coded::Impedance;
use crate::wire::can::CanFrame;
use crate::wire::can::cubemars::{
    Id, MitCommand, ServoCommand, mit_command, mit_reply, servo_command, servo_feedback,
};
use gaitway_profiles::Ranges;

/// MIT mode: told its gains with every goal. It answers nothing but commands, and does not say
/// whether it drives.
#[derive(Debug)]
pub(super) struct Mit {
    id: Id,
    placing: Placing,
    ranges: Ranges,
}

impl Mit {
    pub fn new(placing: Placing, ranges: Ranges) -> Result<Self, String> {
        let id = Id::new(placing.id).ok_or_else(|| no_such_id(placing.id))?;
        Ok(Self { id, placing, ranges })
    }
}

impl Language for Mit {
    fn told(&self, frame: &CanFrame) -> Option<Told> {
        let (id, feedback) = mit_reply(frame)?;
        (id == self.id).then(|| decoded(&feedback, &self.ranges, 1.0))
    }

    fn ask_state(&self) -> Option<Question> {
        None
    }

    fn tells_enabled(&self) -> bool {
        false
    }

    fn order(&self, order: Order) -> Vec<CanFrame> {
        match order {
            Order::Enable => vec![mit_command(self.id, MitCommand::Enable)],
            Order::LetGo => vec![mit_command(self.id, MitCommand::Disable)],
            Order::ForgetSilence | Order::HeedGoals => Vec::new(),
        }
    }

    fn goal(&self, goal: Goal) -> CanFrame {
        let setpoint = coded::mit_setpoint(Impedance::of(goal, self.placing), &self.ranges);
        mit_command(self.id, MitCommand::Setpoint(setpoint))
    }

    fn beside_goal(&self) -> Vec<Shape> {
        vec![Shape::classic(false, 8)]
    }
}

/// Servo mode: it goes to positions as told and says where it is at a steady rate.
#[derive(Debug)]
pub(super) struct Servo {
    id: Id,
}

/// How often it is reckoned to say where it is, Hz: the most the maker's tool allows.
const FEEDBACK_HZ: f64 = 500.0;
/// Positions travel in 1e-4 degree, and are told in 0.1 degree.
const GOAL_STEP_DEG: f64 = 1e-4;
const TOLD_STEP_DEG: f64 = 0.1;
const TOLD_STEP_A: f64 = 0.01;

impl Servo {
    pub fn new(id: u8) -> Result<Self, String> {
        Ok(Self { id: Id::new(id).ok_or_else(|| no_such_id(id))? })
    }
}

impl Language for Servo {
    /// Speed is left out: it is electrical, and coarse.
    fn told(&self, frame: &CanFrame) -> Option<Told> {
        let (_, feedback) = servo_feedback(frame).filter(|(id, _)| *id == self.id)?;
        Some(Told {
            position_rad: feedback
                .position
                .and_then(plain)
                .map(|steps| (steps * TOLD_STEP_DEG).to_radians()),
            current_a: feedback.torque.and_then(plain).map(|steps| steps * TOLD_STEP_A),
            temperature_c: feedback.temperature.and_then(plain),
            faults: Some(feedback.faults),
            ..Told::default()
        })
    }

    fn ask_state(&self) -> Option<Question> {
        None
    }

    /// No current is what it calls letting go.
    fn tells_enabled(&self) -> bool {
        false
    }

    fn order(&self, order: Order) -> Vec<CanFrame> {
        match order {
            Order::LetGo => vec![servo_command(self.id, ServoCommand::Current(0))],
            Order::Enable | Order::ForgetSilence | Order::HeedGoals => Vec::new(),
        }
    }

    fn goal(&self, goal: Goal) -> CanFrame {
        let steps = (goal.position_rad.to_degrees() / GOAL_STEP_DEG).round() as i32;
        servo_command(self.id, ServoCommand::Position(steps))
    }

    fn beside_goal(&self) -> Vec<Shape> {
        Vec::new()
    }

    fn unasked(&self) -> Vec<(Shape, f64)> {
        vec![(Shape::classic(true, 8), FEEDBACK_HZ)]
    }

    fn answers_goals(&self) -> bool {
        false
    }

    fn goal_enables(&self) -> bool {
        true
    }
}
