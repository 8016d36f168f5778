//! A motion a robot may be asked to make.

use crate::error::{Error, counted};
use crate::motion::limits::JointLimits;
use crate::motion::path::{MAX_DURATION_S, MAX_VALUES, check_names};
use crate::motion::spline::{End, Extreme, Extremes, Spline};

/// What one joint is meant to do at one instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Setpoint {
    /// Position, rad.
    pub position_rad: f64,
    /// Velocity, rad/s.
    pub velocity_rad_s: f64,
    /// Acceleration, rad/s^2.
    pub acceleration_rad_s2: f64,
}

/// Joint motion that was checked when it was made: finite, inside position, velocity and
/// acceleration limits at every instant, twice continuously differentiable, with zero velocity at
/// both ends on every joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory {
    joints: Vec<String>,
    splines: Vec<Spline>,
    extremes: Vec<Extremes>,
}

impl Trajectory {
    /// Lays a spline with zero end velocities through `positions_rad[joint][knot]`, `step_s` apart,
    /// and checks it against one entry of `limits` per joint, by its exact extremes.
    ///
    /// # Errors
    /// If names, rows and limits do not fit together, a position is not finite, or a limit is
    /// passed by more than rounding (1e-12, relative); joint, quantity, value, limit and time are
    /// named.
    pub fn new(
        joints: Vec<String>,
        step_s: f64,
        positions_rad: Vec<Vec<f64>>,
        limits: &[JointLimits],
    ) -> Result<Self, Error> {
        check_names(&joints, positions_rad.len())?;
        check_limits(&joints, limits)?;
        let knots = positions_rad[0].len();
        let values: usize = positions_rad.iter().map(Vec::len).sum();
        if values > MAX_VALUES || !(knots as f64 * step_s <= MAX_DURATION_S) {
            return Err(Error::new("a trajectory is too long")
                .got(format!("{values}, {step_s} s apart", values = counted(values, "position")))
                .allowed(format!("{MAX_VALUES} positions, {MAX_DURATION_S} s")));
        }
        let mut splines = Vec::with_capacity(joints.len());
        let mut extremes = Vec::with_capacity(joints.len());
        for ((joint, row), limits) in joints.iter().zip(positions_rad).zip(limits) {
            if row.len() != knots {
                return Err(Error::new("joints have different numbers of positions")
                    .at(format!("joint {joint}"))
                    .got(row.len().to_string())
                    .allowed(format!("{knots}, as the first joint")));
            }
            for (index, value) in row.iter().enumerate() {
                let time_s = index as f64 * step_s;
                limits.admit_position(joint, Extreme { time_s, value: *value })?;
            }
            let rest = End::Velocity(0.0);
            let spline = Spline::through(row, step_s, rest, rest)?;
            let found = spline.extremes();
            limits.admit_positions(joint, &found)?;
            limits.admit_rates(joint, &found)?;
            splines.push(spline);
            extremes.push(found);
        }
        Ok(Self { joints, splines, extremes })
    }

    /// Joint names, in the order of all per-joint values.
    #[must_use]
    pub fn joints(&self) -> &[String] {
        &self.joints
    }

    /// Time from start to end, s.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.splines[0].duration_s()
    }

    /// Writes what each joint does at `time_s`, held to the trajectory's span; a time that is not a
    /// number counts as the start. `out` has one place per joint, in joint order; places beyond
    /// the last joint are left as they are.
    pub fn sample(&self, time_s: f64, out: &mut [Setpoint]) {
        for (setpoint, spline) in out.iter_mut().zip(&self.splines) {
            let [position_rad, velocity_rad_s, acceleration_rad_s2] = spline.sample(time_s);
            *setpoint = Setpoint { position_rad, velocity_rad_s, acceleration_rad_s2 };
        }
    }

    /// Positions at the start, rad.
    #[must_use]
    pub fn start_rad(&self) -> Vec<f64> {
        self.splines.iter().map(|spline| spline.values()[0]).collect()
    }

    /// Positions at the end, rad.
    #[must_use]
    pub fn end_rad(&self) -> Vec<f64> {
        self.splines.iter().map(|spline| spline.values()[spline.values().len() - 1]).collect()
    }

    /// Exact extremes of each joint.
    #[must_use]
    pub fn extremes(&self) -> &[Extremes] {
        &self.extremes
    }

    /// Greatest speed of each joint, rad/s.
    #[must_use]
    pub fn peak_velocity_rad_s(&self) -> Vec<f64> {
        self.extremes.iter().map(|found| found.velocity.peak().value.abs()).collect()
    }

    /// Greatest absolute acceleration of each joint, rad/s^2.
    #[must_use]
    pub fn peak_acceleration_rad_s2(&self) -> Vec<f64> {
        self.extremes.iter().map(|found| found.acceleration.peak().value.abs()).collect()
    }

    /// Greatest absolute jerk of each joint, rad/s^3. Reported, not limited.
    #[must_use]
    pub fn peak_jerk_rad_s3(&self) -> Vec<f64> {
        self.extremes.iter().map(|found| found.jerk.peak().value.abs()).collect()
    }
}

pub(crate) fn check_limits(joints: &[String], limits: &[JointLimits]) -> Result<(), Error> {
    if joints.len() == limits.len() {
        return Ok(());
    }
    Err(Error::new("joints and limits differ in number")
        .got(counted(limits.len(), "limit"))
        .allowed(format!("one for each of {}", counted(joints.len(), "joint"))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::ease::step;
    use proptest::prelude::*;

    fn names(count: usize) -> Vec<String> {
        (0..count).map(|i| format!("j{i}")).collect()
    }

    fn swing(size_rad: f64) -> Vec<f64> {
        (0..=20).map(|i| size_rad * step(f64::from(i) / 20.0)).collect()
    }

    fn limits(range: f64, velocity: f64, acceleration: f64) -> Vec<JointLimits> {
        vec![JointLimits::new(-range, range, velocity, acceleration).unwrap()]
    }

    #[test]
    fn a_trajectory_starts_and_ends_with_exactly_no_velocity() {
        let made = Trajectory::new(names(1), 0.05, vec![swing(1.0)], &limits(2.0, 9.0, 99.0));
        let made = made.unwrap();
        let mut out = [Setpoint::default(); 1];
        for time_s in [-1.0, 0.0, f64::NAN] {
            made.sample(time_s, &mut out);
            assert_eq!((out[0].position_rad, out[0].velocity_rad_s), (0.0, 0.0));
        }
        for time_s in [made.duration_s(), 2.0, f64::INFINITY] {
            made.sample(time_s, &mut out);
            assert_eq!((out[0].position_rad, out[0].velocity_rad_s), (1.0, 0.0));
        }
        assert_eq!((made.start_rad(), made.end_rad()), (vec![0.0], vec![1.0]));
        made.sample(0.5, &mut [Setpoint::default(); 5]);
        made.sample(0.5, &mut []);
    }

    #[test]
    fn a_limit_passed_by_a_billionth_is_refused_with_joint_quantity_value_limit_and_time() {
        let row = swing(1.0);
        let wide = limits(2.0, 9.0, 99.0);
        let made = Trajectory::new(names(1), 0.05, vec![row.clone()], &wide).unwrap();
        let velocity = made.peak_velocity_rad_s()[0];
        let acceleration = made.peak_acceleration_rad_s2()[0];
        let with =
            |v: f64, a: f64| Trajectory::new(names(1), 0.05, vec![row.clone()], &limits(2.0, v, a));
        assert!(with(velocity, acceleration).is_ok());
        let error = with(velocity / (1.0 + 1e-9), 99.0).unwrap_err();
        assert_eq!(error.what, "velocity of joint j0 is beyond its limit");
        assert_eq!(error.place.as_deref(), Some("joint j0 at 0.500 s"));
        let error = with(9.0, acceleration / (1.0 + 1e-9)).unwrap_err();
        assert_eq!(error.what, "acceleration of joint j0 is beyond its limit");
        assert!(error.got.is_some() && error.allowed.is_some());
        let tight = limits(1.0 / (1.0 + 1e-9), 9.0, 99.0);
        let error = Trajectory::new(names(1), 0.05, vec![row.clone()], &tight).unwrap_err();
        assert_eq!(error.what, "position of joint j0 is beyond its limit");
    }

    #[test]
    fn an_overshoot_between_knots_is_seen() {
        // Knots stay within 1 rad, the curve between the two middle ones does not.
        let row = vec![0.0, 0.2, 1.0, 1.0, 0.2, 0.0];
        let made = Trajectory::new(names(1), 0.1, vec![row.clone()], &limits(1.0, 99.0, 999.0));
        let error = made.unwrap_err();
        assert_eq!(error.what, "position of joint j0 is beyond its limit");
        assert_eq!(error.place.as_deref(), Some("joint j0 at 0.250 s"));
        assert!(Trajectory::new(names(1), 0.1, vec![row], &limits(1.3, 99.0, 999.0)).is_ok());
    }

    #[test]
    fn values_that_are_not_finite_never_become_a_trajectory() {
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            for index in 0..21 {
                let mut row = swing(1.0);
                row[index] = bad;
                let made = Trajectory::new(names(1), 0.05, vec![row], &limits(2.0, 9.0, 99.0));
                assert!(made.is_err(), "{bad} at {index}");
            }
        }
        for step_s in [f64::NAN, 0.0, -0.1, f64::INFINITY, 1e9] {
            let made = Trajectory::new(names(1), step_s, vec![swing(1.0)], &limits(2.0, 9.0, 9.0));
            assert!(made.is_err(), "{step_s}");
        }
    }

    #[test]
    fn shapes_that_do_not_fit_are_refused() {
        let one = limits(2.0, 9.0, 99.0);
        assert!(Trajectory::new(vec![], 0.1, vec![], &[]).is_err());
        assert!(Trajectory::new(names(1), 0.1, vec![vec![]], &one).is_err());
        assert!(Trajectory::new(names(1), 0.1, vec![vec![0.0]], &one).is_err());
        assert!(Trajectory::new(names(1), 0.1, vec![swing(1.0)], &[]).is_err());
        let two = [one[0], one[0]];
        assert!(Trajectory::new(names(2), 0.1, vec![swing(1.0), vec![0.0; 3]], &two).is_err());
    }

    proptest! {
        #[test]
        fn no_instant_of_a_trajectory_is_beyond_a_limit(
            row in prop::collection::vec(-1.0..1.0, 2..20),
            velocity in 1.0..60.0,
            acceleration in 10.0..3000.0,
        ) {
            let limits = limits(1.2, velocity, acceleration);
            if let Ok(made) = Trajectory::new(names(1), 0.1, vec![row], &limits) {
                let mut out = [Setpoint::default(); 1];
                for i in 0..=2000 {
                    made.sample(made.duration_s() * f64::from(i) / 2000.0, &mut out);
                    prop_assert!(out[0].position_rad.abs() <= 1.2 + 1e-9);
                    prop_assert!(out[0].velocity_rad_s.abs() <= velocity + 1e-9);
                    prop_assert!(out[0].acceleration_rad_s2.abs() <= acceleration + 1e-6);
                }
            }
        }
    }
}
