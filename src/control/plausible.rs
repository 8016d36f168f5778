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
    joints: Vec<(f64, Instant)>,
    limits: Vec<JointLimits>,
}

impl Believed {
    /// Joints known to have been at `start_rad` at `at`.
    #[must_use]
    pub fn new(start_rad: &[f64], limits: Vec<JointLimits>, at: Instant) -> Self {
        Self { joints: start_rad.iter().map(|&rad| (rad, at)).collect(), limits }
    }

    /// Turns states that cannot be into misses. They were measured between `asked_at` and
    /// `read_at`.
    pub fn sift(&mut self, states: &mut States, asked_at: Instant, read_at: Instant) {
        for ((state, believed), limits) in states.iter_mut().zip(&mut self.joints).zip(&self.limits)
        {
            let Ok((measured, _)) = state else { continue };
            let (last_rad, last_at) = *believed;
            // The last may have been measured when it was asked for, this one when it came.
            let since_s = read_at.since(last_at).as_secs_f64();
            let reach_rad = limits.velocity_rad_s() * since_s + SLACK_RAD;
            if (measured.position_rad - last_rad).abs() <= reach_rad {
                *believed = (measured.position_rad, asked_at);
            } else {
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
    fn a_reading_that_stays_away_is_not_believed_for_five_cycles() {
        // A jump of 0.5 rad: beyond what 62 ms at 5 rad/s can do.
        assert_eq!(believed(&[0.5; 5]), [false; 5]);
    }
}
