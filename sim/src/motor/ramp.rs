//! The way from where the goal generator is to a new goal: legs of constant acceleration.
//!
//! DYNAMIXEL e-Manual, Profile Velocity(112): no velocity gives a step, velocity without
//! acceleration a rectangle, both a trapezoid, or a triangle if the velocity is not reached. With V
//! and A raw and the distance D in pulses, from rest, t1 = 64 V / A ms, t2 = 64 D / V ms and the
//! whole takes t3 = t1 + t2. A time-based profile is given t3 and t1 (at most half of t3) instead.
//! A move that begins in motion goes on from that speed ("velocity override"); how a time-based one
//! does is not told: here it keeps t1 and t3 and finds the cruising speed that fits. Feetech's goal
//! speed and acceleration mean the same as a trapezoid's.

/// Speed and acceleration a move may use.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Pace {
    /// The goal jumps.
    Step,
    /// Constant speed, rad/s, without ramps.
    Rectangle { speed: f64 },
    /// Highest speed, rad/s, reached at constant acceleration, rad/s².
    Trapezoid { speed: f64, acceleration: f64 },
    /// The whole time and that of each of the two ramps, s.
    Timed { total_s: f64, ramp_s: f64 },
}

impl Pace {
    /// The pace with these limits; endless acceleration means no ramp, no speed no limit at all.
    pub fn within(speed: f64, acceleration: f64) -> Pace {
        match (speed > 0.0, acceleration.is_finite()) {
            (false, _) => Pace::Step,
            (true, true) => Pace::Trapezoid { speed, acceleration },
            (true, false) => Pace::Rectangle { speed },
        }
    }
}

/// What a move turned out to be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Shape {
    Step,
    Rectangle,
    Triangle,
    Trapezoid,
}

/// What the goal generator asks for at one moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Target {
    /// rad
    pub position: f64,
    /// rad/s
    pub velocity: f64,
    /// rad/s²
    pub acceleration: f64,
}

#[derive(Clone, Copy, Debug, Default)]
struct Leg {
    duration_s: f64,
    velocity: f64,
    acceleration: f64,
}

/// A planned move: at most three legs of constant acceleration, then rest at the goal, or constant
/// speed for good.
#[derive(Clone, Debug)]
pub(crate) struct Ramp {
    start_rad: f64,
    legs: [Leg; 3],
    duration_s: f64,
    end_rad: f64,
    end_velocity: f64,
    shape: Shape,
}

impl Ramp {
    pub fn rest(at_rad: f64) -> Ramp {
        Ramp {
            start_rad: at_rad,
            legs: [Leg::default(); 3],
            duration_s: 0.0,
            end_rad: at_rad,
            end_velocity: 0.0,
            shape: Shape::Step,
        }
    }

    /// From `start_rad`, moving at `velocity`, to rest at `goal_rad`.
    pub fn to_position(start_rad: f64, velocity: f64, goal_rad: f64, pace: Pace) -> Ramp {
        let distance = goal_rad - start_rad;
        let (legs, shape) = match pace {
            Pace::Step => ([Leg::default(); 3], Shape::Step),
            Pace::Rectangle { speed } => {
                (timed(distance, 0.0, distance.abs() / speed, 0.0), Shape::Rectangle)
            }
            Pace::Trapezoid { speed, acceleration } => {
                trapezoid(distance, velocity, speed, acceleration)
            }
            Pace::Timed { total_s, ramp_s } => {
                (timed(distance, velocity, total_s, ramp_s), timed_shape(total_s, ramp_s))
            }
        };
        let duration_s = legs.iter().map(|leg| leg.duration_s).sum();
        Ramp { start_rad, legs, duration_s, end_rad: goal_rad, end_velocity: 0.0, shape }
    }

    /// From `start_rad`, moving at `velocity`, to the speed `end_velocity` at this acceleration.
    pub fn to_velocity(start_rad: f64, velocity: f64, end_velocity: f64, pace: Pace) -> Ramp {
        let change = end_velocity - velocity;
        let duration_s = match pace {
            Pace::Trapezoid { acceleration, .. } => change.abs() / acceleration,
            Pace::Timed { ramp_s, .. } => ramp_s,
            Pace::Step | Pace::Rectangle { .. } => 0.0,
        };
        let mut ramp = Ramp::rest(start_rad);
        ramp.end_velocity = end_velocity;
        if duration_s > 0.0 {
            let acceleration = change / duration_s;
            ramp.legs[0] = Leg { duration_s, velocity, acceleration };
            ramp.duration_s = duration_s;
            ramp.end_rad += 0.5 * (velocity + end_velocity) * duration_s;
            ramp.shape = Shape::Trapezoid;
        }
        ramp
    }

    /// What is asked for `time_s` after the start.
    pub fn at(&self, time_s: f64) -> Target {
        if time_s >= self.duration_s {
            return Target {
                position: self.end_rad + (time_s - self.duration_s) * self.end_velocity,
                velocity: self.end_velocity,
                acceleration: 0.0,
            };
        }
        let mut position = self.start_rad;
        let mut left = time_s;
        for leg in &self.legs {
            let t = left.min(leg.duration_s);
            position += t * (leg.velocity + 0.5 * leg.acceleration * t);
            if left < leg.duration_s {
                let velocity = leg.velocity + leg.acceleration * t;
                return Target { position, velocity, acceleration: leg.acceleration };
            }
            left -= leg.duration_s;
        }
        Target { position: self.end_rad, velocity: self.end_velocity, acceleration: 0.0 }
    }

    pub fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// Where it ends, if it ends at rest.
    pub fn goal_rad(&self) -> f64 {
        self.end_rad
    }

    pub fn end_velocity(&self) -> f64 {
        self.end_velocity
    }

    pub fn shape(&self) -> Shape {
        self.shape
    }
}

/// Ramp, cruise and ramp of given times; the cruising speed follows from the distance.
fn timed(distance: f64, velocity: f64, total_s: f64, ramp_s: f64) -> [Leg; 3] {
    if !(total_s > 0.0) {
        return [Leg::default(); 3];
    }
    let peak = (distance - 0.5 * velocity * ramp_s) / (total_s - ramp_s);
    let (up, down) =
        if ramp_s > 0.0 { ((peak - velocity) / ramp_s, -peak / ramp_s) } else { (0.0, 0.0) };
    [
        Leg { duration_s: ramp_s, velocity, acceleration: up },
        Leg { duration_s: total_s - 2.0 * ramp_s, velocity: peak, acceleration: 0.0 },
        Leg { duration_s: ramp_s, velocity: peak, acceleration: down },
    ]
}

fn timed_shape(total_s: f64, ramp_s: f64) -> Shape {
    if !(ramp_s > 0.0) {
        Shape::Rectangle
    } else if 2.0 * ramp_s < total_s {
        Shape::Trapezoid
    } else {
        Shape::Triangle
    }
}

/// Reach a cruising speed, keep it, brake to rest exactly at the distance.
fn trapezoid(distance: f64, velocity: f64, speed: f64, acceleration: f64) -> ([Leg; 3], Shape) {
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
    let legs = [
        Leg { duration_s: reach_s, velocity: side * velocity, acceleration: side * change },
        Leg { duration_s: cruise_s, velocity: side * peak, acceleration: 0.0 },
        Leg { duration_s: brake_s, velocity: side * peak, acceleration: -side * acceleration },
    ];
    (legs, if speed <= triangle { Shape::Trapezoid } else { Shape::Triangle })
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
        let ramp = Ramp::to_position(1.0, 0.0, 4.0, pace);
        assert!(close(ramp.duration_s(), 3.0 / 2.0 + 2.0 / 4.0));
        assert_eq!(ramp.at(0.25).velocity, 1.0);
        assert_eq!(ramp.at(1.0).velocity, 2.0);
        assert_eq!(ramp.shape(), Shape::Trapezoid);
        assert_eq!((ramp.at(9.0).position, ramp.at(9.0).velocity), (4.0, 0.0));
    }

    #[test]
    fn a_short_move_is_a_triangle() {
        let pace = Pace::Trapezoid { speed: 100.0, acceleration: 4.0 };
        // Half the way accelerating: 0.5 = 4 t²/2.
        assert!(close(Ramp::to_position(0.0, 0.0, -1.0, pace).duration_s(), 1.0));
        assert!(close(Ramp::to_position(0.0, 0.0, -1.0, pace).at(0.5).velocity, -2.0));
        assert_eq!(Ramp::to_position(0.0, 0.0, -1.0, pace).shape(), Shape::Triangle);
    }

    #[test]
    fn without_acceleration_the_speed_is_there_at_once() {
        let ramp = Ramp::to_position(0.0, 0.0, -3.0, Pace::Rectangle { speed: 2.0 });
        assert_eq!((ramp.at(0.0).position, ramp.at(0.0).velocity), (0.0, -2.0));
        assert!(close(ramp.duration_s(), 1.5));
    }

    #[test]
    fn a_time_based_move_keeps_its_times_whatever_the_speed_it_begins_with() {
        // Manual: t1 = 0.3 s, t3 = 1 s; from rest the area of the trapezoid is peak * (t3 - t1).
        let pace = Pace::Timed { total_s: 1.0, ramp_s: 0.3 };
        let ramp = Ramp::to_position(0.0, 0.0, 1.4, pace);
        assert!(close(ramp.duration_s(), 1.0));
        assert!(close(ramp.at(0.5).velocity, 1.4 / 0.7));
        let ramp = Ramp::to_position(0.0, -1.5, 1.4, pace);
        assert!(close(ramp.duration_s(), 1.0));
        assert!((ramp.at(1.0 - 1e-9).position - 1.4).abs() < 1e-6);
    }

    #[test]
    fn a_change_of_speed_takes_the_change_over_the_acceleration_and_lasts() {
        let pace = Pace::Trapezoid { speed: 0.0, acceleration: 4.0 };
        let ramp = Ramp::to_velocity(1.0, -1.0, 3.0, pace);
        assert!(close(ramp.duration_s(), 1.0));
        assert!(close(ramp.at(0.25).velocity, 0.0));
        // One second from -1 to 3 rad/s: 1 rad on; then one more second at 3 rad/s.
        assert!(close(ramp.at(2.0).position, 1.0 + 1.0 + 3.0));
        assert_eq!(Ramp::to_velocity(0.0, 0.0, 3.0, Pace::Step).at(0.0).velocity, 3.0);
    }

    proptest! {
        #[test]
        fn any_ramp_is_continuous_within_its_limits_and_ends_at_the_goal(
            start in -5.0..5.0_f64, velocity in -8.0..8.0_f64, goal in -5.0..5.0_f64,
            speed in 0.01..8.0_f64, acceleration in 0.1..50.0_f64,
        ) {
            let pace = Pace::Trapezoid { speed, acceleration };
            let ramp = Ramp::to_position(start, velocity, goal, pace);
            let end = ramp.duration_s();
            let before = ramp.at(end * (1.0 - 1e-12)).position;
            prop_assert!((before - goal).abs() <= 1e-6, "{before} {goal}");
            let step = 1e-4;
            let mut last = ramp.at(0.0);
            prop_assert!(close(last.position, start));
            for k in 1..200 {
                let next = ramp.at(f64::from(k) * step);
                prop_assert!((next.velocity - last.velocity).abs() <= acceleration * step + 1e-6);
                prop_assert!(next.velocity.abs() <= speed.max(velocity.abs()) + 1e-9);
                last = next;
            }
        }
    }
}
