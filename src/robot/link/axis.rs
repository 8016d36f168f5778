//! One actuator on a CAN line: what it was told, and what it told.

use crate::device::actuator::{Goal, HostWatch, Question, Told};
use crate::device::{Actuator, JointState};
use crate::time::Instant;
use crate::wire::can::CanFrame;

/// One actuator of the line.
pub(super) struct Axis {
    /// Index in [`Robot::joints`].
    pub joint: usize,
    pub actuator: Actuator,
    /// All it told, the newest of each.
    pub told: Told,
    /// It told its position since states were last taken.
    pub fresh: bool,
    /// When it told its position.
    pub heard_at: Instant,
    /// When it was last told or asked something that it answers with its state.
    pub asked_at: Instant,
    /// When it was last told a goal, which is what every dialect's watch over the host heeds.
    pub fed_at: Instant,
    /// The question whose answer is waited for.
    pub open: Option<Question>,
    /// The last goal the guard let through, and when it was written.
    pub goal: Option<(Goal, Instant)>,
    /// It was switched on by this host.
    pub driven: bool,
    /// It may be watching its host already, although it does not drive yet.
    pub watching: bool,
    /// How long a goal holds, where goals say so.
    pub holds_s: Option<f64>,
    /// The host's watch as it was found, to be restored.
    pub found_watch: Option<u32>,
}

impl Axis {
    /// Nothing was told yet.
    pub fn new(joint: usize, actuator: Actuator) -> Self {
        Self {
            joint,
            actuator,
            told: Told::default(),
            fresh: false,
            heard_at: Instant::ZERO,
            asked_at: Instant::ZERO,
            fed_at: Instant::ZERO,
            open: None,
            goal: None,
            driven: false,
            watching: false,
            holds_s: None,
            found_watch: None,
        }
    }

    /// Takes what `frame`, which was heard by `now`, tells of it; true if it does.
    pub fn hear(&mut self, frame: &CanFrame, now: Instant) -> bool {
        let answer = self.open.and_then(|asked| self.actuator.answer(&asked, frame));
        let Some(told) = answer.or_else(|| self.actuator.told(frame)) else { return false };
        if told.position_rad.is_some() {
            (self.fresh, self.heard_at) = (true, now);
        }
        self.told = self.told.then(told);
        true
    }

    /// True if it only answers commands, and has let go of itself if nobody spoke to it for a while:
    /// then the command that changes nothing is to let go.
    pub fn is_asked_by_letting_go(&self) -> bool {
        let Self { actuator, driven, .. } = self;
        let only_answers = actuator.answers_goals() && actuator.ask_state().is_none();
        only_answers && !driven && matches!(actuator.watch(), HostWatch::Said(_))
    }

    pub fn state(&self) -> Option<JointState> {
        let position_rad = self.told.position_rad.filter(|rad| rad.is_finite())?;
        Some(JointState {
            position_rad,
            velocity_rad_s: self.told.velocity_rad_s,
            current_a: self.told.current_a,
            load_ratio: self.told.torque_share,
            voltage_v: self.told.voltage_v,
            temperature_c: self.told.temperature_c,
        })
    }
}
