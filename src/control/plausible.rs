//! A position is believed only if the joint can have got there since the last one that was.
//!
//! A checksum of one byte lets some damage through, and a sound packet may carry a wrong reading.

use crate::bus::Miss;
use crate::motion::JointLimits;
use crate::robot::link::States;
use crate::time::Instant;

/// How far beyond `highest speed x time` a reading may be: noise, and a joint that is pushed.
const SLACK_RAD: f64 = 0.05;

/// What was last believed of each joint.
#[derive(Debug)]
pub struct Believed {
    joints: Vec<Trail>,
    limits: Vec<JointLimits>,
}

/// Where a joint was seen, and when it may have been measured at the earliest.
#[derive(Clone, Copy, Debug)]
struct Trail {
    last: (f64, Instant),
    /// The reading before, if it was not believed.
    wrong: Option<(f64, Instant)>,
}

impl Believed {
    /// Joints known to have been at `start_rad` at `at`.
    #[must_use]
    pub fn new(start_rad: &[f64], limits: Vec<JointLimits>, at: Instant) -> Self {
        let trail = |&rad: &f64| Trail { last: (rad, at), wrong: None };
        Self { joints: start_rad.iter().map(trail).collect(), limits }
    }

    /// Turns states that cannot be into misses. They were measured between `asked_at` and
    /// `read_at`.
    pub fn sift(&mut self, states: &mut States, asked_at: Instant, read_at: Instant) {
        for ((state, trail), limits) in states.iter_mut().zip(&mut self.joints).zip(&self.limits) {
            let Ok((measured, _)) = state else { continue };
            let rad = measured.position_rad;
            // The one before may have been measured when it was asked for, this one when it came.
            let reach_rad =
                |at: Instant| limits.velocity_rad_s() * read_at.since(at).as_secs_f64() + SLACK_RAD;
            let off_rad = (rad - trail.last.0).abs();
            // Once an encoder has jumped, its servo turns the joint back, to where it might have been
            // all the while. A truth after a lie does not go on from the lie.
            let goes_on_from_wrong = trail.wrong.is_some_and(|(wrong_rad, wrong_at)| {
                let step_rad = reach_rad(wrong_at);
                (rad - wrong_rad).abs() <= step_rad && !(off_rad <= step_rad)
            });
            if off_rad <= reach_rad(trail.last.1) && !goes_on_from_wrong {
                *trail = Trail { last: (rad, asked_at), wrong: None };
            } else {
                trail.wrong = Some((rad, asked_at));
                *state = Err(Miss::Implausible);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::JointState;
    use crate::time::Duration;

    const T: Duration = Duration::from_millis(10);

    /// One joint of 5 rad/s, read every 10 ms in 2 ms: which of the positions are believed.
    fn believed(positions_rad: &[f64]) -> Vec<bool> {
        let limits = JointLimits::new(-3.0, 3.0, 5.0, 20.0).expect("limits");
        let mut believed = Believed::new(&[0.0], vec![limits], Instant::ZERO);
        let mut at = Instant::ZERO;
        let read = |&position_rad: &f64| {
            at = at + T;
            let state = JointState { position_rad, ..JointState::default() };
            let mut states = vec![Ok((state, false))];
            believed.sift(&mut states, at, at + Duration::from_millis(2));
            states[0].is_ok()
        };
        positions_rad.iter().map(read).collect()
    }

    #[test]
    fn a_joint_may_move_as_fast_as_it_can_and_no_faster() {
        // 5 rad/s for 12 ms and the slack are 0.11 rad.
        assert_eq!(believed(&[0.109, 0.218, 0.109, 0.0]), [true; 4]);
        assert_eq!(believed(&[0.111]), [false]);
        assert_eq!(believed(&[-0.111]), [false]);
        assert_eq!(believed(&[f64::NAN, 0.0]), [false, true]);
    }

    #[test]
    fn after_a_lie_the_truth_is_believed_again() {
        assert_eq!(believed(&[0.05, 1.2, 0.1, 0.15]), [true, false, true, true]);
    }

    #[test]
    fn a_joint_that_comes_back_from_where_it_cannot_have_been_is_not_believed_on_its_way() {
        // Read every 10 ms, at 5 rad/s: 0.06 rad a step may be seen as 0.11.
        let away: Vec<f64> = (0..8).map(|k| 0.5 - 0.05 * f64::from(k)).collect();
        assert_eq!(believed(&away), [false; 8], "in reach since 0.4, but it came from 0.5");
        // A truth after lies is believed, wherever it is that the joint can have got to.
        assert_eq!(believed(&[0.5, 0.5, 0.2]), [false, false, true]);
    }

    #[test]
    fn a_reading_that_stays_away_is_not_believed_for_five_cycles() {
        // A jump of 0.5 rad: beyond what 62 ms at 5 rad/s can do.
        assert_eq!(believed(&[0.5; 5]), [false; 5]);
    }
}
