//! Damiao DM in its MIT mode.

use super::{
    Goal, Language, Order, Placing, Question, Setting, Told, Wanted, coded, decoded, no_such_id,
    value,
};
use crate::bus::can::Shape;
use crate::device::coded::Impedance;
use crate::wire::can::damiao::{
    Command, Id, Request, command, feedback, register, register_value, request,
};
use crate::wire::can::{CanFrame, CanId};
use gaitway_profiles::Ranges;

/// Number of the setting that says how long the host may be silent.
pub(super) const TIMEOUT: u16 = register::TIMEOUT as u16;
/// Value of the control mode in which it takes the packed command.
const MIT_MODE: u32 = 1;
/// What a frame about registers says in its third byte.
const READ_OR_WRITTEN: [u8; 2] = [0x33, 0x55];

#[derive(Debug)]
pub(super) struct Damiao {
    id: Id,
    answers_under: CanId,
    placing: Placing,
    ranges: Ranges,
}

impl Damiao {
    pub fn new(placing: Placing, ranges: Ranges) -> Result<Self, String> {
        let id = Id::new(placing.id).ok_or_else(|| no_such_id(placing.id))?;
        let answers_under = CanId::standard(placing.answer_id.into());
        let answers_under = answers_under.ok_or("the id of its answers has 11 bits")?;
        Ok(Self { id, answers_under, placing, ranges })
    }
}

impl Language for Damiao {
    fn told(&self, frame: &CanFrame) -> Option<Told> {
        // A late answer about a register has the form of feedback, from the end of the range.
        let from_it = frame.id() == self.answers_under;
        if let [low, 0, what, ..] = frame.payload()
            && *low == self.id.get()
            && READ_OR_WRITTEN.contains(what)
        {
            return from_it.then(Told::default);
        }
        let feedback = feedback(self.id, self.placing.answer_id, frame)?;
        Some(decoded(&feedback, &self.ranges, 1.0))
    }

    fn ask_state(&self) -> Option<Question> {
        Some(Question::state(request(self.id, Request::Feedback)))
    }

    fn ask_enabled(&self) -> Option<Question> {
        self.ask_state()
    }

    fn ask_setting(&self, number: u16) -> Option<Question> {
        let register = u8::try_from(number).ok()?;
        Some(Question::setting(number, request(self.id, Request::Read(register))))
    }

    fn setting(&self, number: u16, frame: &CanFrame) -> Option<Told> {
        let register = u8::try_from(number).ok()?;
        register_value(self.id, self.placing.answer_id, register, frame).map(value)
    }

    fn write_setting(&self, number: u16, bits: u32) -> Option<CanFrame> {
        let register = u8::try_from(number).ok()?;
        Some(request(self.id, Request::Write(register, bits)))
    }

    fn settings(&self) -> Vec<Setting> {
        let of = |register: u8, name, wanted| Setting { number: register.into(), name, wanted };
        let mut settings = vec![of(register::CTRL_MODE, "CTRL_MODE", Wanted::Written(MIT_MODE))];
        if self.ranges.readable {
            let Ranges { position_rad, velocity_rad_s, torque_nm, .. } = self.ranges;
            settings.extend([
                of(register::PMAX, "PMAX", Wanted::Near(position_rad)),
                of(register::VMAX, "VMAX", Wanted::Near(velocity_rad_s)),
                of(register::TMAX, "TMAX", Wanted::Near(torque_nm)),
            ]);
        }
        settings
    }

    fn order(&self, order: Order) -> Vec<CanFrame> {
        match order {
            Order::Enable => vec![command(self.id, Command::Enable)],
            Order::LetGo => vec![command(self.id, Command::Disable)],
            Order::ForgetSilence => vec![command(self.id, Command::ClearFaults)],
            Order::HeedGoals => Vec::new(),
        }
    }

    fn goal(&self, goal: Goal) -> CanFrame {
        let setpoint = coded::mit_setpoint(Impedance::of(goal, self.placing), &self.ranges);
        command(self.id, Command::Setpoint(setpoint))
    }

    fn beside_goal(&self) -> Vec<Shape> {
        vec![Shape::classic(false, 8)]
    }
}
