//! The last gate. Only [`Guard`] can make a [`Command`], and only a `Command` reaches a goal
//! register.
//!
//! The guard refuses; it never bends a motion. Its checks repeat what a valid
//! [`crate::motion::Trajectory`] promises, from nothing but the limits and the goals it let
//! through before, so that a mistake anywhere above it ends in a refusal and not in a movement.

use crate::motion::JointLimits;
use crate::time::Instant;
use std::fmt;

/// Goal positions of all joints of a robot that passed the guard.
#[derive(Clone, Debug)]
pub struct Command {
    goal_rad: Vec<f64>,
}

impl Command {
    /// Goal position of every joint, rad, in the robot's joint order.
    #[must_use]
    pub fn goal_rad(&self) -> &[f64] {
        &self.goal_rad
    }
}

/// Why the guard said no.
#[derive(Clone, Debug, PartialEq)]
pub struct Refusal {
    /// Index of the joint in the robot's order.
    pub joint: usize,
    /// What is wrong with the goal.
    pub reason: RefusalReason,
}

/// The rule that was broken, with the figures.
#[derive(Clone, Debug, PartialEq)]
pub enum RefusalReason {
    /// Not a number, or infinite.
    NotFinite {
        /// The goal.
        goal_rad: f64,
    },
    /// Outside the joint's range.
    Position {
        /// The goal.
        goal_rad: f64,
        /// Lower limit.
        lower_rad: f64,
        /// Upper limit.
        upper_rad: f64,
    },
    /// Further from the goal before than the joint may go in the time between.
    Step {
        /// Size of the step.
        step_rad: f64,
        /// Largest step allowed.
        allowed_rad: f64,
    },
    /// A command for another number of joints than the robot has.
    Count {
        /// Number of goals.
        got: usize,
        /// Number of joints.
        wanted: usize,
    },
}

impl fmt::Display for RefusalReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotFinite { goal_rad } => write!(f, "goal {goal_rad} is not a finite number"),
            Self::Position { goal_rad, lower_rad, upper_rad } => write!(
                f,
                "goal {:.2} deg is outside {:.2} to {:.2} deg",
                goal_rad.to_degrees(),
                lower_rad.to_degrees(),
                upper_rad.to_degrees()
            ),
            Self::Step { step_rad, allowed_rad } => write!(
                f,
                "step of {:.3} deg, at most {:.3} deg allowed",
                step_rad.to_degrees(),
                allowed_rad.to_degrees()
            ),
            Self::Count { got, wanted } => write!(f, "{got} goals for {wanted} joints"),
        }
    }
}

/// Share by which a step may exceed `velocity x time` for rounding alone.
const STEP_ROUNDING: f64 = 1e-9;

/// Lets goals through one at a time.
#[derive(Debug)]
pub struct Guard {
    limits: Vec<JointLimits>,
    last_rad: Vec<f64>,
    last_at: Instant,
}

impl Guard {
    /// A guard for a robot standing at `present_rad` at `now`, and the command that keeps it
    /// there: the only one allowed before torque is on.
    ///
    /// # Errors
    /// A joint that stands outside its limits, or is not a number.
    pub fn standing_at(
        present_rad: &[f64],
        limits: Vec<JointLimits>,
        now: Instant,
    ) -> Result<(Self, Command), Refusal> {
        let mut guard = Self { limits, last_rad: present_rad.to_vec(), last_at: now };
        let command = guard.admit(present_rad, now)?;
        Ok((guard, command))
    }

    /// Checks goals to be written at `now`.
    ///
    /// # Errors
    /// The first joint whose goal is not finite, outside its limits, or too far from its goal
    /// before. A refused command changes nothing in the guard.
    pub fn admit(&mut self, goal_rad: &[f64], now: Instant) -> Result<Command, Refusal> {
        let wanted = self.limits.len();
        if goal_rad.len() != wanted || self.last_rad.len() != wanted {
            let reason = RefusalReason::Count { got: goal_rad.len(), wanted };
            return Err(Refusal { joint: 0, reason });
        }
        let dt_s = now.since(self.last_at).as_secs_f64();
        for (joint, (&goal, limits)) in goal_rad.iter().zip(&self.limits).enumerate() {
            let refuse = |reason| Err(Refusal { joint, reason });
            if !goal.is_finite() {
                return refuse(RefusalReason::NotFinite { goal_rad: goal });
            }
            if !(goal >= limits.lower_rad() && goal <= limits.upper_rad()) {
                return refuse(RefusalReason::Position {
                    goal_rad: goal,
                    lower_rad: limits.lower_rad(),
                    upper_rad: limits.upper_rad(),
                });
            }
            let step_rad = (goal - self.last_rad[joint]).abs();
            let allowed_rad =
                limits.velocity_rad_s() * dt_s * (1.0 + STEP_ROUNDING) + STEP_ROUNDING;
            if !(step_rad <= allowed_rad) {
                return refuse(RefusalReason::Step { step_rad, allowed_rad });
            }
        }
        self.last_rad.copy_from_slice(goal_rad);
        self.last_at = now;
        Ok(Command { goal_rad: goal_rad.to_vec() })
    }
}
