//! The last gate. Only [`Guard`] can make a [`Command`], and only a `Command` reaches a goal
//! register.
//!
//! The guard refuses; it never bends a motion. Its checks repeat what a valid
//! [`crate::motion::Trajectory`] promises, from nothing but the limits and the goals it let
//! through before, so that a mistake anywhere above it ends in a refusal and not in a movement.

use crate::motion::JointLimits;
use crate::time::{Duration, Instant};
use std::fmt;

/// Goal positions of all joints of a robot that passed the guard. Nobody else can make one:
///
/// ```compile_fail,E0451
/// let unchecked = gaitway::guard::Command { goal_rad: vec![9.0; 20] };
/// ```
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
            Self::Count { got, wanted } => write!(f, "goals {got}, joints {wanted}"),
        }
    }
}

/// Share by which a step may exceed `velocity x time` for rounding alone.
const STEP_ROUNDING: f64 = 1e-9;

/// However long nothing was written, a step counts at most this much time: a pause must not buy a
/// jump.
const LONGEST_STEP: Duration = Duration::from_millis(100);

/// A joint stands at a goal that is this near, rad.
const STANDS_RAD: f64 = 0.02;

/// Lets goals through one at a time.
#[derive(Debug)]
pub struct Guard {
    limits: Vec<JointLimits>,
    /// As many as limits: the first command, which stands here, passed the same check.
    last_rad: Vec<f64>,
    last_at: Instant,
    /// Where joints stand that missed their last goals; for the next goal only.
    stands_rad: Vec<Option<f64>>,
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
        let stands_rad = vec![None; limits.len()];
        let mut guard = Self { limits, last_rad: present_rad.to_vec(), last_at: now, stands_rad };
        let command = guard.admit(present_rad, now)?;
        Ok((guard, command))
    }

    /// `joint` missed its last goals and stands at `present_rad`: its next goal may be there, however
    /// far that is from the last. A goal at which a joint stands moves nothing.
    pub fn stands(&mut self, joint: usize, present_rad: f64) {
        if let Some(stands) = self.stands_rad.get_mut(joint) {
            *stands = Some(present_rad);
        }
    }

    /// Checks goals to be written at `now`.
    ///
    /// # Errors
    /// The first joint whose goal is not finite, outside its limits, or too far from its goal
    /// before. A refused command changes nothing in the guard.
    pub fn admit(&mut self, goal_rad: &[f64], now: Instant) -> Result<Command, Refusal> {
        let wanted = self.limits.len();
        if goal_rad.len() != wanted {
            let reason = RefusalReason::Count { got: goal_rad.len(), wanted };
            return Err(Refusal { joint: 0, reason });
        }
        let dt_s = now.since(self.last_at).min(LONGEST_STEP).as_secs_f64();
        let joints = goal_rad.iter().zip(&self.last_rad).zip(&self.stands_rad).zip(&self.limits);
        for (joint, (((&goal, &last), stands), limits)) in joints.enumerate() {
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
            let stands_there = stands.is_some_and(|rad| (goal - rad).abs() <= STANDS_RAD);
            let step_rad = if stands_there { 0.0 } else { (goal - last).abs() };
            let allowed_rad =
                limits.velocity_rad_s() * dt_s * (1.0 + STEP_ROUNDING) + STEP_ROUNDING;
            if !(step_rad <= allowed_rad) {
                return refuse(RefusalReason::Step { step_rad, allowed_rad });
            }
        }
        self.last_rad.copy_from_slice(goal_rad);
        self.last_at = now;
        self.stands_rad.fill(None);
        Ok(Command { goal_rad: goal_rad.to_vec() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::{Follower, Setpoint, Target};
    use proptest::prelude::*;

    const T: Duration = Duration::from_millis(10);

    fn limits() -> Vec<JointLimits> {
        let of = |lower, upper, velocity| JointLimits::new(lower, upper, velocity, 20.0).unwrap();
        vec![of(-1.0, 2.0, 4.0), of(-0.5, 0.5, 2.0)]
    }

    fn standing(rad: f64) -> Guard {
        Guard::standing_at(&[rad, 0.0], limits(), Instant::ZERO).expect("inside").0
    }

    #[test]
    fn the_first_command_keeps_the_robot_where_it_stands() {
        let (_, command) = Guard::standing_at(&[1.5, -0.2], limits(), Instant::ZERO).unwrap();
        assert_eq!(command.goal_rad(), [1.5, -0.2]);
    }

    #[test]
    fn a_robot_outside_its_limits_gets_no_guard() {
        for rad in [2.0001, -1.0001, f64::NAN, f64::INFINITY] {
            assert!(Guard::standing_at(&[rad, 0.0], limits(), Instant::ZERO).is_err(), "{rad}");
        }
    }

    #[test]
    fn a_pose_of_another_number_of_joints_gets_no_guard() {
        for pose in [&[][..], &[0.0], &[0.0; 3]] {
            let refusal = Guard::standing_at(pose, limits(), Instant::ZERO).unwrap_err();
            assert!(matches!(refusal.reason, RefusalReason::Count { .. }), "{pose:?}");
        }
    }

    #[test]
    fn position_limits_hold_to_the_last_bit_over_a_sweep_around_them() {
        // Close enough to either limit that the step rule never decides.
        for k in -1500..=1500 {
            let goal = 2.0 * f64::from(k) / 1000.0;
            let mut guard = standing(goal.clamp(-1.0, 2.0));
            let admitted = guard.admit(&[goal, 0.0], Instant::ZERO + T);
            assert_eq!(admitted.is_ok(), (-1.0..=2.0).contains(&goal), "{goal}");
        }
        let mut guard = standing(2.0);
        let beyond = f64::from_bits(2.0_f64.to_bits() + 1);
        let refusal = guard.admit(&[beyond, 0.0], Instant::ZERO + T).unwrap_err();
        assert!(matches!(refusal.reason, RefusalReason::Position { .. }), "{refusal:?}");
    }

    #[test]
    fn steps_hold_the_joint_speed_over_a_sweep_around_it() {
        // 4 rad/s in 10 ms are 0.04 rad.
        for k in -150_i32..=150 {
            let step = 0.04 * f64::from(k) / 100.0;
            let admitted = standing(0.0).admit(&[step, 0.0], Instant::ZERO + T);
            assert_eq!(admitted.is_ok(), k.abs() <= 100, "{step}");
        }
        let refusal = standing(0.0).admit(&[0.0, 0.021], Instant::ZERO + T).unwrap_err();
        assert_eq!(refusal.joint, 1);
    }

    #[test]
    fn a_step_may_be_longer_by_rounding_and_by_no_more() {
        // A billionth of 4 rad/s x 100 ms, and a billionth of a radian.
        let (now, rounding) = (Instant::ZERO + LONGEST_STEP, 0.4e-9 + 1e-9);
        assert!(standing(0.0).admit(&[0.4 + 0.99 * rounding, 0.0], now).is_ok());
        assert!(standing(0.0).admit(&[0.4 + 1.01 * rounding, 0.0], now).is_err());
    }

    #[test]
    fn a_refusal_says_its_figures() {
        let said = |goals: &[f64]| {
            let refusal = standing(0.0).admit(goals, Instant::ZERO + T).unwrap_err();
            refusal.reason.to_string()
        };
        assert_eq!(said(&[f64::NAN, 0.0]), "goal NaN is not a finite number");
        assert_eq!(said(&[2.5, 0.0]), "goal 143.24 deg is outside -57.30 to 114.59 deg");
        assert_eq!(said(&[0.5, 0.0]), "step of 28.648 deg, at most 2.292 deg allowed");
        assert_eq!(said(&[0.5]), "goals 1, joints 2");
    }

    #[test]
    fn no_time_allows_no_step_and_the_past_none_either() {
        let mut guard = standing(0.0);
        let now = Instant::ZERO + T;
        assert!(guard.admit(&[0.01, 0.0], now).is_ok());
        assert!(guard.admit(&[0.02, 0.0], now).is_err());
        assert!(guard.admit(&[0.02, 0.0], Instant::ZERO).is_err());
    }

    #[test]
    fn a_long_pause_buys_no_long_step() {
        // 100 ms at 4 rad/s are 0.4 rad, however long the pause was.
        let later = Instant::ZERO + Duration::from_secs(60);
        assert!(standing(0.0).admit(&[0.39, 0.0], later).is_ok());
        assert!(standing(0.0).admit(&[0.41, 0.0], later).is_err());
    }

    #[test]
    fn what_is_no_number_is_refused_at_every_place() {
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            for joint in 0..2 {
                let mut goal = [0.0; 2];
                goal[joint] = bad;
                let refusal = standing(0.0).admit(&goal, Instant::ZERO + T).unwrap_err();
                assert_eq!(refusal.joint, joint);
                assert!(matches!(refusal.reason, RefusalReason::NotFinite { .. }));
            }
        }
    }

    #[test]
    fn a_goal_at_which_a_joint_stands_may_be_far_from_the_last_but_once_and_there_only() {
        let now = Instant::ZERO + T;
        for (goal, admitted) in [(1.0, true), (1.019, true), (0.981, true), (1.021, false)] {
            let mut guard = standing(0.0);
            guard.stands(0, 1.0);
            assert_eq!(guard.admit(&[goal, 0.0], now).is_ok(), admitted, "{goal}");
        }
        let mut guard = standing(0.0);
        guard.stands(0, 0.5);
        assert!(guard.admit(&[0.0, 0.0], now).is_ok());
        assert!(guard.admit(&[0.5, 0.0], now + T).is_err(), "it was for one goal");
        let mut guard = standing(0.0);
        guard.stands(1, 0.4);
        assert!(guard.admit(&[0.4, 0.0], now).is_err(), "it was for the other joint");
        let mut guard = standing(0.0);
        guard.stands(0, 9.0);
        assert!(guard.admit(&[9.0, 0.0], now).is_err(), "limits hold wherever a joint stands");
    }

    #[test]
    fn goals_for_another_number_of_joints_are_refused() {
        for goal in [&[][..], &[0.0], &[0.0; 3]] {
            let refusal = standing(0.0).admit(goal, Instant::ZERO + T).unwrap_err();
            assert!(matches!(refusal.reason, RefusalReason::Count { .. }), "{goal:?}");
        }
    }

    #[test]
    fn a_refused_goal_leaves_the_last_good_one_in_force() {
        let mut guard = standing(0.0);
        assert!(guard.admit(&[0.5, 0.0], Instant::ZERO + T).is_err());
        // Were the refused goal remembered, this one would now be near enough.
        assert!(guard.admit(&[0.49, 0.0], Instant::ZERO + T).is_err());
        assert!(guard.admit(&[0.04, 0.0], Instant::ZERO + T).is_ok());
    }

    proptest! {
        #[test]
        fn whatever_is_asked_no_admitted_goal_breaks_a_rule(
            asked in prop::collection::vec((any::<f64>(), -3.0..3.0, 0_u64..50), 1..60)
        ) {
            let mut guard = standing(0.0);
            let (mut last, mut now) = (0.0_f64, Instant::ZERO);
            for (wild, near, millis) in asked {
                let dt = Duration::from_millis(millis);
                let at = now + dt;
                for goal in [wild, near, last + near / 100.0] {
                    let Ok(command) = guard.admit(&[goal, 0.0], at) else { continue };
                    let goal = command.goal_rad()[0];
                    prop_assert!((-1.0..=2.0).contains(&goal));
                    let since = at.since(now).as_secs_f64();
                    prop_assert!((goal - last).abs() <= 4.0 * since * (1.0 + 1e-6) + 1e-8);
                    (last, now) = (goal, at);
                }
            }
        }

        #[test]
        fn what_a_follower_lets_out_is_never_refused(
            asked in prop::collection::vec(
                (-3.0..3.0_f64, -9.0..9.0_f64, 0.0..0.12_f64, 0_u64..130), 1..80,
            )
        ) {
            let mut now = Instant::ZERO;
            let mut follower = Follower::standing_at(&[0.3, 0.0], limits());
            let (mut guard, _) = Guard::standing_at(&[0.3, 0.0], limits(), now).unwrap();
            let mut setpoints = [Setpoint::default(); 2];
            for (position, velocity, age_s, millis) in asked {
                let dt = Duration::from_millis(millis);
                now = now + dt;
                let target = Target {
                    position_rad: vec![position, -position],
                    velocity_rad_s: vec![velocity, velocity],
                    age_s,
                    careful: Vec::new(),
                };
                follower.advance(dt.as_secs_f64(), Some(&target), &mut setpoints);
                let goals = setpoints.map(|setpoint| setpoint.position_rad);
                prop_assert!(guard.admit(&goals, now).is_ok(), "{goals:?}");
            }
        }
    }
}
