//! Live: the joints follow what somebody does now.

use super::cycle::Motion;
use crate::motion::{FollowTally, Follower, JointLimits, Setpoint, Target};
use crate::time::Instant;

/// What a source of poses says when it is asked.
#[derive(Clone, Debug, PartialEq)]
pub enum Input {
    /// The newest pose, as angles of the robot's joints.
    Pose(Target),
    /// No pose yet, or none that can be trusted.
    Nothing,
    /// There will be no more.
    End,
}

/// Asked once per cycle for the newest pose at a moment, and told whether the robot is still on its
/// way to the first one. Must not wait.
pub type Source<'a> = dyn FnMut(Instant, bool) -> Input + Send + 'a;

/// Ages of poses kept for the report: more than eleven hours at 100 Hz is nobody's session.
const MOST_AGES: usize = 4_000_000;

/// A motion that follows a source of poses.
pub struct Mirror<'a> {
    source: &'a mut Source<'a>,
    follower: Follower,
    ages_s: Vec<f32>,
    peak_velocity_rad_s: Vec<f64>,
    peak_acceleration_rad_s2: Vec<f64>,
}

/// Time from a motion to the goal it led to, s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Latency {
    /// Half of all goals are faster.
    pub median_s: f64,
    /// One of a hundred is slower.
    pub p99_s: f64,
}

impl<'a> Mirror<'a> {
    /// Follows `source` with joints at rest at `start_rad`, inside `limits`.
    pub fn new(source: &'a mut Source<'a>, start_rad: &[f64], limits: Vec<JointLimits>) -> Self {
        Self {
            source,
            peak_velocity_rad_s: vec![0.0; limits.len()],
            peak_acceleration_rad_s2: vec![0.0; limits.len()],
            follower: Follower::standing_at(start_rad, limits),
            ages_s: Vec::new(),
        }
    }

    /// Figures of the follower.
    #[must_use]
    pub const fn tally(&self) -> &FollowTally {
        self.follower.tally()
    }

    /// Greatest speeds and accelerations of the goals, by joint, rad/s and rad/s²; accelerations
    /// as means over cycles.
    #[must_use]
    pub fn peaks(&self) -> (&[f64], &[f64]) {
        (&self.peak_velocity_rad_s, &self.peak_acceleration_rad_s2)
    }

    /// How old poses were when the goals they led to were written; `None` before the first.
    #[must_use]
    pub fn latency(&self) -> Option<Latency> {
        let mut ages = self.ages_s.clone();
        ages.sort_by(f32::total_cmp);
        let at = |share: f64| {
            let last = ages.len().checked_sub(1)?;
            ages.get((share * last as f64).round() as usize).map(|age| f64::from(*age))
        };
        Some(Latency { median_s: at(0.5)?, p99_s: at(0.99)? })
    }
}

impl Motion for Mirror<'_> {
    fn advance(&mut self, dt_s: f64, now: Instant, setpoints: &mut [Setpoint]) -> bool {
        // Once it brakes, nobody is asked any more: the source may be what broke.
        let input = match self.follower.is_stopping() {
            true => Input::Nothing,
            false => (self.source)(now, self.follower.is_approaching()),
        };
        let target = match input {
            Input::Pose(target) => Some(target),
            Input::Nothing => None,
            Input::End => {
                self.follower.stop();
                None
            }
        };
        let followed = self.follower.tally().followed_samples;
        self.follower.advance(dt_s, target.as_ref(), setpoints);
        if let Some(target) = target
            && self.follower.tally().followed_samples > followed
            && self.ages_s.len() < MOST_AGES
        {
            self.ages_s.push(target.age_s as f32);
        }
        let peaks = self.peak_velocity_rad_s.iter_mut().zip(&mut self.peak_acceleration_rad_s2);
        for ((velocity, acceleration), setpoint) in peaks.zip(setpoints.iter()) {
            *velocity = velocity.max(setpoint.velocity_rad_s.abs());
            *acceleration = acceleration.max(setpoint.acceleration_rad_s2.abs());
        }
        self.follower.is_stopping() && self.follower.is_at_rest()
    }

    fn stop(&mut self) {
        self.follower.stop();
    }
}
