//! Stretching a path in time until velocity and acceleration limits hold.
//!
//! Slowing a motion by the factor k divides velocities by k and accelerations by k^2 and leaves
//! the path alone, so positions are never mended here.

use crate::error::{Error, ErrorKind};
use crate::motion::limits::JointLimits;
use crate::motion::path::Path;

/// How much further than necessary a path is stretched: room for easing in and out and for what
/// laying a new spline changes.
pub const HEADROOM: f64 = 0.01;
/// Beyond this a motion is refused instead: a limit or a file is wrong.
pub const MAX_FACTOR: f64 = 1000.0;

/// Which limit asked for the stretch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Because {
    /// None: the motion holds its limits as it is.
    Nothing,
    /// A velocity limit.
    Velocity,
    /// An acceleration limit.
    Acceleration,
}

/// What was done to a motion's time.
#[derive(Clone, Debug, PartialEq)]
pub struct Retimed {
    /// The motion takes this many times as long; at least 1.
    pub factor: f64,
    /// Index and name of the joint nearest its limit, or furthest beyond.
    pub joint: (usize, String),
    /// The limit that decided, if any did.
    pub because: Because,
}

/// Finds the least stretch, plus [`HEADROOM`], with which every joint of `path` holds its velocity
/// and acceleration limits, from exact extremes. A path inside its limits keeps its time.
///
/// # Errors
/// If the path would have to be stretched by more than [`MAX_FACTOR`].
pub fn retime(path: &Path, limits: &[JointLimits]) -> Result<Retimed, Error> {
    let mut worst = (0.0, 0, Because::Nothing);
    for (index, (spline, limits)) in path.splines().iter().zip(limits).enumerate() {
        let found = spline.extremes();
        let velocity = found.velocity.peak().value.abs() / limits.velocity_rad_s();
        let acceleration = found.acceleration.peak().value.abs() / limits.acceleration_rad_s2();
        let asks = [(velocity, Because::Velocity), (acceleration.sqrt(), Because::Acceleration)];
        for (factor, because) in asks {
            // Written so that not-a-number wins and is refused below.
            if !(factor <= worst.0) {
                worst = (factor, index, because);
            }
        }
    }
    let (factor, index, because) = worst;
    let joint = (index, path.joints()[index].clone());
    if factor <= 1.0 {
        return Ok(Retimed { factor: 1.0, joint, because: Because::Nothing });
    }
    if !(factor <= MAX_FACTOR) {
        return Err(Error::of(
            ErrorKind::OutsideLimits,
            "the motion would have to be slowed down too far",
        )
        .at(format!("joint {}", joint.1))
        .got(format!("a factor of {factor:.1}"))
        .allowed(format!("at most {MAX_FACTOR}"))
        .remedy("check the units of the motion and of the limits"));
    }
    Ok(Retimed { factor: factor * (1.0 + HEADROOM), joint, because })
}

/// By sample of a path, how many times as long it would have to take there, by itself, and the joint that
/// asks for it; less than 1 where it could be faster.
#[must_use]
pub fn needs(path: &Path, limits: &[JointLimits]) -> Vec<(f64, usize)> {
    let at = |sample: usize| {
        let time_s = sample as f64 * path.step_s();
        let asks =
            path.splines().iter().zip(limits).enumerate().map(|(joint, (spline, limits))| {
                let [_, velocity, acceleration] = spline.sample(time_s);
                let by_velocity = velocity.abs() / limits.velocity_rad_s();
                let by_acceleration = (acceleration.abs() / limits.acceleration_rad_s2()).sqrt();
                (by_velocity.max(by_acceleration), joint)
            });
        asks.fold((0.0, 0), |most: (f64, usize), ask| if ask.0 > most.0 { ask } else { most })
    };
    (0..path.samples()).map(at).collect()
}

/// The same without the joints.
#[must_use]
pub fn factors(path: &Path, limits: &[JointLimits]) -> Vec<f64> {
    needs(path, limits).into_iter().map(|(factor, _)| factor).collect()
}

/// Refuses a path that is faster or bends harder than its limits anywhere, instead of stretching.
///
/// # Errors
/// Names joint, quantity, value, limit and time.
pub fn refuse_beyond(path: &Path, limits: &[JointLimits]) -> Result<(), Error> {
    for ((joint, spline), limits) in path.joints().iter().zip(path.splines()).zip(limits) {
        limits.admit_rates(joint, &spline.extremes()).map_err(|error| {
            error.remedy("let the whole motion be slowed down, by how much is said: --retime, or without --no-retime")
        })?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::TAU;
    use proptest::prelude::*;

    /// One period of `size_rad * sin` at 1 Hz: peaks `size * tau` rad/s and `size * tau^2` rad/s^2.
    fn sine(size_rad: f64) -> Vec<f64> {
        (0..=1000).map(|i| size_rad * (TAU * f64::from(i) / 1000.0).sin()).collect()
    }

    fn path(sizes: &[f64]) -> Path {
        let names = (0..sizes.len()).map(|i| format!("j{i}")).collect();
        Path::new(names, 1000.0, sizes.iter().map(|size| sine(*size)).collect()).unwrap()
    }

    fn limits(velocity: f64, acceleration: f64) -> JointLimits {
        JointLimits::new(-9.0, 9.0, velocity, acceleration).unwrap()
    }

    #[test]
    fn a_motion_inside_its_limits_keeps_its_time() {
        let got = retime(&path(&[0.5, 1.0]), &[limits(6.5, 40.0); 2]).unwrap();
        assert_eq!((got.factor, got.because), (1.0, Because::Nothing));
    }

    #[test]
    fn twice_too_fast_takes_twice_as_long_and_names_the_joint_and_the_limit() {
        let wide = limits(99.0, 999.0);
        let slow = limits(TAU / 2.0, 999.0);
        let got = retime(&path(&[0.5, 1.0]), &[wide, slow]).unwrap();
        assert!((got.factor - 2.0 * (1.0 + HEADROOM)).abs() < 1e-4, "{}", got.factor);
        assert_eq!((got.joint.0, got.joint.1.as_str(), got.because), (1, "j1", Because::Velocity));
        let soft = limits(99.0, 0.5 * TAU * TAU / 9.0);
        let got = retime(&path(&[0.5, 1.0]), &[soft, wide]).unwrap();
        assert!((got.factor - 3.0 * (1.0 + HEADROOM)).abs() < 1e-3, "{}", got.factor);
        assert_eq!((got.joint.0, got.because), (0, Because::Acceleration));
    }

    #[test]
    fn each_instant_says_what_it_needs_by_itself() {
        let needs = needs(&path(&[0.5, 1.0]), &[limits(99.0, 999.0), limits(TAU / 2.0, 999.0)]);
        // A sine is fastest where it passes zero, and rests at its peak.
        assert!((needs[0].0 - 2.0).abs() < 1e-4, "{:?}", needs[0]);
        assert_eq!(needs[0].1, 1);
        assert!(needs[250].0 < 0.3, "{:?}", needs[250]);
    }

    #[test]
    fn absurd_stretches_are_refused() {
        assert!(retime(&path(&[1.0]), &[limits(1e-6, 999.0)]).is_err());
        assert!(retime(&path(&[1.0]), &[limits(1e-300, 1e-300)]).is_err());
    }

    #[test]
    fn with_retiming_forbidden_the_error_names_joint_quantity_and_time() {
        let tight = [limits(99.0, 999.0), limits(6.0, 999.0)];
        let error = refuse_beyond(&path(&[0.5, 1.0]), &tight).unwrap_err();
        assert_eq!(error.what, "velocity of joint j1 is beyond its limit");
        assert!(error.place.unwrap().starts_with("joint j1 at"));
        assert!(error.remedy.is_some());
        assert!(refuse_beyond(&path(&[0.5, 1.0]), &[limits(6.5, 40.0); 2]).is_ok());
    }

    proptest! {
        #[test]
        fn a_stretched_path_holds_every_limit(
            size in 0.01..3.0,
            velocity in 0.5..20.0,
            acceleration in 1.0..200.0,
        ) {
            let path = path(&[size]);
            let limits = [limits(velocity, acceleration)];
            let got = retime(&path, &limits).unwrap();
            prop_assert!(got.factor >= 1.0);
            prop_assert!(refuse_beyond(&path.stretched(got.factor), &limits).is_ok());
        }
    }
}
