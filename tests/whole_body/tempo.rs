//! A motion that hastens in its middle.

use core::f64::consts::TAU;
use gaitway::motion::retime::factors;
use gaitway::motion::tempo::in_parts;
use gaitway::motion::{End, JointLimits, Path, Spline};

fn limits() -> Vec<JointLimits> {
    vec![JointLimits::new(-9.0, 9.0, 2.0, 20.0).expect("limits")]
}

/// 8 s at 100 Hz of a slow sine, in the middle of which one comes that is `faster` times as fast.
fn path(faster: f64) -> Path {
    let mut phase = 0.0_f64;
    let series = (0..800).map(|at| {
        let burst = (-((f64::from(at) - 400.0) / 60.0).powi(4)).exp();
        phase += TAU * 0.2 * (1.0 + (faster - 1.0) * burst) / 100.0;
        0.8 * phase.sin()
    });
    Path::new(vec!["j".to_owned()], 100.0, vec![series.collect()]).expect("a path")
}

#[test]
fn what_is_slow_keeps_its_pace_beside_what_is_not() {
    let times =
        in_parts(&path(6.0), |path| factors(path, &limits())).expect("a spline").expect("a clock");
    assert_eq!((times[0], times[times.len() - 1]), (0.0, 799.0));
    assert!(times.windows(2).all(|two| two[1] > two[0]), "time goes on");
    let step = |at: f64| {
        let next = times.iter().position(|time| *time > at).expect("inside");
        times[next] - times[next - 1]
    };
    assert!((step(150.0) - 1.0).abs() < 0.01 && (step(650.0) - 1.0).abs() < 0.01);
    assert!(step(400.0) < 0.5, "{}", step(400.0));
    let spline = Spline::through(
        times.iter().map(|time| path(6.0).splines()[0].sample(time * 0.01)[0]).collect(),
        0.01,
        End::Free,
        End::Free,
    );
    let peak = spline.expect("a spline").extremes().velocity.peak().value.abs();
    assert!(peak < 2.0 * 1.05, "{peak}");
}

#[test]
fn what_is_slow_enough_has_no_other_pace() {
    assert_eq!(in_parts(&path(1.0), |path| factors(path, &limits())).expect("a spline"), None);
}
