//! The way from where the goal generator is to a new goal: a trapezoid in speed.
//!
//! DYNAMIXEL e-Manual, Profile Velocity(112): no velocity gives a step, velocity without
//! acceleration a rectangle, both a trapezoid, or a triangle if the velocity is not reached.
//! Feetech's goal speed and acceleration mean the same.

/// Speed and acceleration a move may use.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Pace {
    /// The goal jumps.
    Step,
    /// Constant speed, rad/s, without ramps.
    Rectangle { speed: f64 },
    /// Highest speed, rad/s, reached at constant acceleration, rad/s².
    Trapezoid { speed: f64, acceleration: f64 },
}

#[derive(Clone, Copy, Debug, Default)]
struct Leg {
    duration_s: f64,
    velocity: f64,
    acceleration: f64,
}

/// A planned move: at most three legs of constant acceleration, then rest at the goal.
#[derive(Clone, Debug)]
pub(crate) struct Ramp {
    start_rad: f64,
    goal_rad: f64,
    legs: [Leg; 3],
}

impl Ramp {
    pub fn rest(at_rad: f64) -> Ramp {
        Ramp { start_rad: at_rad, goal_rad: at_rad, legs: [Leg::default(); 3] }
    }

    /// From `start_rad`, moving at `velocity`, to rest at `goal_rad`.
    pub fn plan(start_rad: f64, velocity: f64, goal_rad: f64, pace: Pace) -> Ramp {
        let mut ramp = Ramp { start_rad, goal_rad, legs: [Leg::default(); 3] };
        match pace {
            Pace::Step => {}
            Pace::Rectangle { speed } => {
                let distance = goal_rad - start_rad;
                ramp.legs[0] = Leg {
                    duration_s: distance.abs() / speed,
                    velocity: speed.copysign(distance),
                    acceleration: 0.0,
                };
            }
            Pace::Trapezoid { speed, acceleration } => {
                ramp.legs = trapezoid(goal_rad - start_rad, velocity, speed, acceleration);
            }
        }
        ramp
    }

    /// Position and velocity `time_s` after the start, rad and rad/s.
    pub fn at(&self, time_s: f64) -> (f64, f64) {
        let mut position = self.start_rad;
        let mut left = time_s;
        for leg in &self.legs {
            let t = left.min(leg.duration_s);
            position += t * (leg.velocity + 0.5 * leg.acceleration * t);
            if left < leg.duration_s {
                return (position, leg.velocity + leg.acceleration * t);
            }
            left -= leg.duration_s;
        }
        (self.goal_rad, 0.0)
    }

    pub fn duration_s(&self) -> f64 {
        self.legs.iter().map(|leg| leg.duration_s).sum()
    }

    pub fn goal_rad(&self) -> f64 {
        self.goal_rad
    }
}

/// Reach a cruising speed, keep it, brake to rest exactly at the distance.
fn trapezoid(distance: f64, velocity: f64, speed: f64, acceleration: f64) -> [Leg; 3] {
    // Where braking at once would end decides which way to go.
    let braked = velocity * velocity.abs() / (2.0 * acceleration);
    let side = if distance >= braked { 1.0 } else { -1.0 };
    let (distance, velocity) = (side * distance, side * velocity);
    let triangle = (acceleration * distance + 0.5 * velocity * velocity).max(0.0).sqrt();
    let peak = speed.min(triangle);
    let change = acceleration.copysign(peak - velocity);
    let reach_s = (peak - velocity) / change;
    let reach = 0.5 * (velocity + peak) * reach_s;
    let brake_s = peak / acceleration;
    let cruise = (distance - reach - 0.5 * peak * brake_s).max(0.0);
    let cruise_s = if peak > 0.0 { cruise / peak } else { 0.0 };
    [
        Leg { duration_s: reach_s, velocity: side * velocity, acceleration: side * change },
        Leg { duration_s: cruise_s, velocity: side * peak, acceleration: 0.0 },
        Leg { duration_s: brake_s, velocity: side * peak, acceleration: -side * acceleration },
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn close(a: f64, b: f64) -> bool {
        (a - b).abs() <= 1e-9 * (1.0 + a.abs() + b.abs())
    }

    #[test]
    fn a_trapezoid_takes_distance_over_speed_plus_speed_over_acceleration() {
        let pace = Pace::Trapezoid { speed: 2.0, acceleration: 4.0 };
        let ramp = Ramp::plan(1.0, 0.0, 4.0, pace);
        assert!(close(ramp.duration_s(), 3.0 / 2.0 + 2.0 / 4.0));
        assert_eq!(ramp.at(0.25).1, 1.0);
        assert_eq!(ramp.at(1.0).1, 2.0);
        assert_eq!(ramp.at(9.0), (4.0, 0.0));
    }

    #[test]
    fn a_short_move_is_a_triangle() {
        let pace = Pace::Trapezoid { speed: 100.0, acceleration: 4.0 };
        // Half the way accelerating: 0.5 = 4 t²/2.
        assert!(close(Ramp::plan(0.0, 0.0, -1.0, pace).duration_s(), 1.0));
        assert!(close(Ramp::plan(0.0, 0.0, -1.0, pace).at(0.5).1, -2.0));
    }

    #[test]
    fn without_acceleration_the_speed_is_there_at_once() {
        let ramp = Ramp::plan(0.0, 0.0, -3.0, Pace::Rectangle { speed: 2.0 });
        assert_eq!(ramp.at(0.0), (0.0, -2.0));
        assert!(close(ramp.duration_s(), 1.5));
    }

    proptest! {
        #[test]
        fn any_ramp_is_continuous_within_its_limits_and_ends_at_the_goal(
            start in -5.0..5.0_f64, velocity in -8.0..8.0_f64, goal in -5.0..5.0_f64,
            speed in 0.01..8.0_f64, acceleration in 0.1..50.0_f64,
        ) {
            let ramp = Ramp::plan(start, velocity, goal, Pace::Trapezoid { speed, acceleration });
            let end = ramp.duration_s();
            let before = ramp.at(end * (1.0 - 1e-12)).0;
            prop_assert!((before - goal).abs() <= 1e-6, "{before} {goal}");
            let step = 1e-4;
            let mut last = ramp.at(0.0);
            prop_assert!(close(last.0, start));
            for k in 1..200 {
                let next = ramp.at(f64::from(k) * step);
                prop_assert!((next.1 - last.1).abs() <= acceleration * step + 1e-6);
                prop_assert!(next.1.abs() <= speed.max(velocity.abs()) + 1e-9);
                last = next;
            }
        }
    }
}
