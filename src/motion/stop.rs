//! The clock of a motion while it plays, and how it stops.
//!
//! A stop slows the motion's clock to zero as half an actionlet: rate (1 + cos(pi tau / Ds)) / 2,
//! so the joints stay on their checked path. With Ds = pi/2 max(v_max / a_max) the slowing alone
//! asks no more than a_max of any joint; together with what the path asks, at most 2 a_max.

use core::f64::consts::FRAC_PI_2;

use crate::motion::ease::{eased_rate, eased_rate_derivative, eased_time_s};
use crate::motion::limits::JointLimits;
use crate::motion::trajectory::Setpoint;

/// Length of the stop ramp: from speed v the half form travels `v Ds / 2`.
#[must_use]
pub fn stop_duration_s(limits: &[JointLimits]) -> f64 {
    let ratio = |limits: &JointLimits| limits.velocity_rad_s() / limits.acceleration_rad_s2();
    FRAC_PI_2 * limits.iter().map(ratio).fold(0.0, f64::max)
}

/// Time along a motion while it plays: runs at rate 1 until it is told to stop.
#[derive(Clone, Debug, PartialEq)]
pub struct Clock {
    motion_s: f64,
    stop_duration_s: f64,
    stopping: Option<Stopping>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Stopping {
    from_s: f64,
    elapsed_s: f64,
}

impl Clock {
    /// A clock at the start of a motion, to be stopped within what `limits` allow.
    #[must_use]
    pub fn new(limits: &[JointLimits]) -> Self {
        Self { motion_s: 0.0, stop_duration_s: stop_duration_s(limits), stopping: None }
    }

    /// Begins to stop. A clock that is stopping or has stopped is not changed by another stop.
    pub fn stop(&mut self) {
        if self.stopping.is_none() {
            self.stopping = Some(Stopping { from_s: self.motion_s, elapsed_s: 0.0 });
        }
    }

    /// Lets `dt_s` of real time pass and returns the new time along the motion, s. Time does not
    /// run backwards: a negative step, or one that is not a number, counts as none.
    pub fn advance(&mut self, dt_s: f64) -> f64 {
        let dt_s = dt_s.max(0.0);
        match &mut self.stopping {
            None => self.motion_s += dt_s,
            Some(stopping) => {
                let ramp_s = self.stop_duration_s;
                stopping.elapsed_s = (stopping.elapsed_s + dt_s).min(ramp_s);
                // A stop is a start backwards: what is left to travel is what an easing clock has
                // travelled in the time that is left.
                let left_s = eased_time_s(ramp_s - stopping.elapsed_s, ramp_s);
                self.motion_s = stopping.from_s + (ramp_s / 2.0 - left_s);
            }
        }
        self.motion_s
    }

    /// Time along the motion, s.
    #[must_use]
    pub const fn motion_s(&self) -> f64 {
        self.motion_s
    }

    /// How fast time along the motion runs: 1, falling to 0 during a stop.
    #[must_use]
    pub fn rate(&self) -> f64 {
        match self.stopping {
            None => 1.0,
            Some(_) if self.is_stopped() => 0.0,
            Some(stopping) => {
                eased_rate(self.stop_duration_s - stopping.elapsed_s, self.stop_duration_s)
            }
        }
    }

    /// Whether a stop has come to its end.
    #[must_use]
    pub fn is_stopped(&self) -> bool {
        self.stopping.is_some_and(|stopping| stopping.elapsed_s >= self.stop_duration_s)
    }

    /// Turns setpoints along the motion into setpoints in real time: velocity times the rate,
    /// acceleration `q'' r^2 + q' r'`.
    pub fn apply_rate(&self, setpoints: &mut [Setpoint]) {
        let Some(stopping) = self.stopping else { return };
        let rate = self.rate();
        let left_s = self.stop_duration_s - stopping.elapsed_s;
        let slowing = -eased_rate_derivative(left_s, self.stop_duration_s);
        for setpoint in setpoints {
            setpoint.acceleration_rad_s2 =
                setpoint.acceleration_rad_s2 * rate * rate + setpoint.velocity_rad_s * slowing;
            setpoint.velocity_rad_s *= rate;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn limits(velocity: f64, acceleration: f64) -> JointLimits {
        JointLimits::new(-3.0, 3.0, velocity, acceleration).unwrap()
    }

    #[test]
    fn a_stop_from_1_2_rad_s_at_8_rad_s2_travels_0_141372_rad_in_0_235619_s() {
        let limits = [limits(1.2, 8.0)];
        let ramp_s = stop_duration_s(&limits);
        assert!((ramp_s - 0.235_619).abs() < 5e-7);
        let mut clock = Clock::new(&limits);
        clock.advance(1.0);
        clock.stop();
        clock.advance(ramp_s);
        assert!(clock.is_stopped());
        assert!((1.2 * (clock.motion_s() - 1.0) - 0.141_372).abs() < 5e-7);
        // Peak deceleration of the half form: pi v / (2 Ds).
        assert!((FRAC_PI_2 * 1.2 / ramp_s - 8.0).abs() < 1e-12);
    }

    #[test]
    fn the_slowest_joint_to_brake_sets_the_ramp() {
        let both = [limits(1.0, 20.0), limits(2.0, 10.0), limits(9.0, 100.0)];
        assert!((stop_duration_s(&both) - FRAC_PI_2 * 0.2).abs() < 1e-15);
    }

    #[test]
    fn a_second_stop_changes_nothing() {
        let mut once = Clock::new(&[limits(2.0, 10.0)]);
        let mut twice = once.clone();
        for clock in [&mut once, &mut twice] {
            clock.advance(0.7);
            clock.stop();
        }
        for i in 0..100 {
            if i % 3 == 0 {
                twice.stop();
            }
            assert_eq!(once.advance(0.01), twice.advance(0.01));
        }
        twice.stop();
        assert_eq!(once, twice);
        assert_eq!(once.rate(), 0.0);
    }

    #[test]
    fn time_never_runs_backwards() {
        let mut clock = Clock::new(&[limits(2.0, 10.0)]);
        assert_eq!(clock.advance(0.5), 0.5);
        assert_eq!(clock.advance(-1.0), 0.5);
        assert_eq!(clock.advance(f64::NAN), 0.5);
        clock.stop();
        assert_eq!(clock.advance(-1.0), 0.5);
        assert_eq!(clock.rate(), 1.0);
    }

    proptest! {
        #[test]
        fn stopping_is_smooth_whatever_the_cycle_and_ends_after_half_the_ramp(
            dt in 0.001..0.05,
            velocity in 0.5..10.0,
            acceleration in 2.0..80.0,
        ) {
            let limits = [limits(velocity, acceleration)];
            let ramp_s = stop_duration_s(&limits);
            let mut clock = Clock::new(&limits);
            clock.advance(2.0);
            clock.stop();
            let (mut before, mut rate_before) = (clock.motion_s(), clock.rate());
            // The cycles that the ramp begins, and one more for rounding.
            let cycles = f64::ceil(ramp_s / dt) as usize + 1;
            for _ in 0..cycles {
                let now = clock.advance(dt);
                prop_assert!(now >= before && now - before <= dt * (1.0 + 1e-9));
                prop_assert!(clock.rate() <= rate_before);
                let fall = rate_before - clock.rate();
                prop_assert!(fall * velocity <= acceleration * dt * (1.0 + 1e-9));
                (before, rate_before) = (now, clock.rate());
            }
            prop_assert!(clock.is_stopped());
            prop_assert!((clock.motion_s() - 2.0 - ramp_s / 2.0).abs() < 1e-12);
            let mut at_limit = [Setpoint {
                position_rad: 0.0,
                velocity_rad_s: velocity,
                acceleration_rad_s2: acceleration,
            }];
            clock.apply_rate(&mut at_limit);
            prop_assert_eq!(at_limit[0].velocity_rad_s, 0.0);
        }

        #[test]
        fn a_joint_at_both_limits_never_sees_more_than_twice_its_acceleration_limit(
            elapsed in 0.0..1.0,
            sign in prop::sample::select(vec![-1.0, 1.0]),
        ) {
            let limits = [limits(3.0, 20.0)];
            let mut clock = Clock::new(&limits);
            clock.stop();
            clock.advance(elapsed * stop_duration_s(&limits));
            let mut setpoint = [Setpoint {
                position_rad: 0.0,
                velocity_rad_s: 3.0,
                acceleration_rad_s2: 20.0 * sign,
            }];
            clock.apply_rate(&mut setpoint);
            prop_assert!(setpoint[0].acceleration_rad_s2.abs() <= 40.0);
            prop_assert!(setpoint[0].velocity_rad_s <= 3.0);
        }
    }
}
