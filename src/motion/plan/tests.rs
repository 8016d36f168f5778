use core::f64::consts::TAU;

use super::*;
use crate::motion::ease::step;
use crate::motion::trajectory::Setpoint;
use proptest::prelude::*;

const RATE_HZ: f64 = 120.0;

fn names(count: usize) -> Vec<String> {
    (0..count).map(|i| format!("j{i}")).collect()
}

/// `count` joints on sines of different phase: they start and end moving.
fn waves(count: usize, size_rad: f64, hz: f64, seconds: f64) -> Path {
    let samples = (seconds * RATE_HZ) as usize + 1;
    let row = |joint: usize| {
        let phase = joint as f64;
        (0..samples).map(|i| size_rad * (TAU * hz * i as f64 / RATE_HZ + phase).sin()).collect()
    };
    Path::new(names(count), RATE_HZ, (0..count).map(row).collect()).unwrap()
}

/// One joint, from 0 to `size_rad` and at rest at both ends.
fn swing(size_rad: f64, seconds: f64) -> Path {
    let samples = (seconds * RATE_HZ) as usize;
    let row = (0..=samples).map(|i| size_rad * step(i as f64 / samples as f64)).collect();
    Path::new(names(1), RATE_HZ, vec![row]).unwrap()
}

fn limits(count: usize) -> Vec<JointLimits> {
    vec![JointLimits::new(-2.0, 2.0, 6.0, 40.0).unwrap(); count]
}

fn options() -> PlanOptions {
    PlanOptions::default()
}

fn at(plan: &Plan, time_s: f64) -> Vec<Setpoint> {
    let mut out = vec![Setpoint::default(); plan.trajectory.joints().len()];
    plan.trajectory.sample(time_s, &mut out);
    out
}

#[test]
fn a_path_at_rest_at_both_ends_is_played_as_it_is() {
    let path = swing(1.0, 1.0);
    let plan = plan(&[0.0], &path, &limits(1), options()).unwrap();
    assert_eq!((plan.approach_s, plan.ease_in_s, plan.ease_out_s), (0.0, 0.0, 0.0));
    assert_eq!((plan.retimed.factor, plan.retimed.because), (1.0, Because::Nothing));
    assert!((plan.trajectory.duration_s() - 1.0).abs() < 1e-9);
    for i in 0..=100 {
        let t = f64::from(i) / 100.0;
        let [position, velocity, acceleration] = path.splines()[0].sample(t);
        let got = at(&plan, t)[0];
        assert!((got.position_rad - position).abs() < 1e-9);
        assert!((got.velocity_rad_s - velocity).abs() < 1e-7);
        assert!((got.acceleration_rad_s2 - acceleration).abs() < 1e-4);
    }
}

#[test]
fn the_approach_starts_at_the_measured_pose_and_moves_all_joints_together() {
    let path = waves(3, 0.5, 1.0, 2.0);
    let start = [1.5, -1.0, 0.2];
    let plan = plan(&start, &path, &limits(3), options()).unwrap();
    assert_eq!(plan.trajectory.start_rad(), start);
    assert!(plan.approach_s >= APPROACH_MIN_S);
    assert_eq!(plan.clip_start_s, plan.approach_s);
    let (half, arrived) = (at(&plan, plan.approach_s / 2.0), at(&plan, plan.clip_start_s));
    for (joint, first) in path.first_rad().into_iter().enumerate() {
        assert!((half[joint].position_rad - (start[joint] + first) / 2.0).abs() < 0.02);
        assert!((arrived[joint].position_rad - first).abs() < 1e-9);
        assert!(arrived[joint].velocity_rad_s.abs() < 1e-3);
    }
    let last = path.last_rad();
    for (end, last) in plan.trajectory.end_rad().iter().zip(last) {
        assert!((end - last).abs() < 1e-9);
    }
}

#[test]
fn a_long_way_is_gone_gently_and_more_so_in_slow_playing() {
    let slow = [JointLimits::new(-2.0, 2.0, 0.5, 40.0).unwrap()];
    for (speed, pace) in [(1.0, 1.0), (0.5, 0.5), (2.0, 1.0)] {
        let options = PlanOptions { speed, ..options() };
        let plan = plan(&[-1.5], &swing(0.1, 1.0), &slow, options).unwrap();
        // 2 |delta| / v_max = 6 s at full speed.
        let expected_s = 6.0 / TRANSITION_SHARE / pace;
        assert!((plan.approach_s - expected_s).abs() < 0.01, "{speed}: {}", plan.approach_s);
    }
}

#[test]
fn away_from_its_eased_ends_the_path_is_kept_exactly() {
    let path = waves(2, 0.5, 1.0, 4.0);
    let plan = plan(&path.first_rad(), &path, &limits(2), options()).unwrap();
    assert_eq!(plan.retimed.factor, 1.0);
    assert!(plan.ease_in_s > 0.0 && plan.ease_out_s > 0.0);
    // 0.5 rad at 1 Hz: pi rad/s against 40 rad/s^2; the half form alone asks pi v / (2 a).
    assert!(plan.ease_in_s < 3.0 * core::f64::consts::FRAC_PI_2 * (TAU * 0.5 / 40.0));
    let behind_s = plan.clip_start_s + plan.ease_in_s / 2.0;
    for i in 0..=200 {
        let t = 1.0 + f64::from(i) * 0.01;
        for (spline, got) in path.splines().iter().zip(at(&plan, t + behind_s)) {
            let [position, velocity, acceleration] = spline.sample(t);
            assert!((got.position_rad - position).abs() < 1e-9);
            assert!((got.velocity_rad_s - velocity).abs() < 1e-7);
            assert!((got.acceleration_rad_s2 - acceleration).abs() < 1e-5);
        }
    }
}

#[test]
fn eased_ends_stay_on_the_path() {
    // Two joints that trace a circle: easing changes when, not where.
    let turn = |phase: f64| (0..480).map(move |i| 0.5 * (TAU * f64::from(i) / 240.0 + phase).sin());
    let rows = vec![turn(0.0).collect(), turn(TAU / 4.0).collect()];
    let path = Path::new(names(2), RATE_HZ, rows).unwrap();
    let plan = plan(&path.first_rad(), &path, &limits(2), options()).unwrap();
    for i in 0..=1000 {
        let got = at(&plan, plan.trajectory.duration_s() * f64::from(i) / 1000.0);
        let radius = got[0].position_rad.hypot(got[1].position_rad);
        // The path's own natural ends cut the corner by some 1e-5.
        assert!((radius - 0.5).abs() < 3e-5, "{radius}");
    }
}

#[test]
fn each_time_of_a_plan_knows_the_time_of_the_path_it_plays() {
    let path = waves(2, 0.8, 1.5, 2.0);
    let options = PlanOptions { speed: 0.8, rounds: 2, ..options() };
    let plan = plan(&[0.3, 0.1], &path, &limits(2), options).unwrap();
    assert!(plan.ease_in_s > 0.0 && plan.ease_out_s > 0.0 && plan.retimed.factor > 1.0);
    for i in 0..=200 {
        let time_s = plan.clip_start_s + plan.clip_s * f64::from(i) / 200.0;
        let path_s = plan.path_time_s(time_s);
        for (spline, got) in path.splines().iter().zip(at(&plan, time_s)) {
            assert!((spline.sample(path_s)[0] - got.position_rad).abs() < 1e-4, "{i}");
        }
    }
    assert_eq!(plan.path_time_s(0.0), 0.0);
    assert!((plan.path_time_s(plan.trajectory.duration_s()) - path.duration_s()).abs() < 1e-9);
}

#[test]
fn an_end_at_rest_that_is_accelerated_is_eased_to_neither_speed_nor_acceleration() {
    // 0.3 (1 - cos 5 t) for a whole turn: at rest at both ends, and accelerated most just there.
    let samples = (RATE_HZ * TAU / 5.0).round();
    let row: Vec<f64> =
        (0..=samples as usize).map(|i| 0.3 * (1.0 - (TAU * i as f64 / samples).cos())).collect();
    let path = Path::new(names(1), RATE_HZ, vec![row]).unwrap();
    assert!(!path.starts_moving() && !path.ends_moving());
    let bends = path.splines()[0].sample(0.0)[2];
    assert!((bends - 7.5).abs() < 0.1, "{bends}");
    let got = plan(&[0.0], &path, &limits(1), options()).unwrap();
    let ease_s = got.ease_in_s;
    assert!(ease_s == got.ease_out_s && (0.99 * EASE_MIN_S..1.3 * EASE_MIN_S).contains(&ease_s));
    let [first, last] = [0.0, got.trajectory.duration_s()].map(|time_s| at(&got, time_s)[0]);
    for end in [first, last] {
        assert_eq!(end.velocity_rad_s, 0.0);
        assert!(end.acceleration_rad_s2.abs() < 0.01 * bends, "{end:?}");
    }
    assert!(last.position_rad.abs() < 1e-9, "no part of the path is lost");
    // Half an actionlet of the clock: v = (1 - cos(pi t / D)) / 2, so far along the path.
    for i in 0..=10 {
        let t = ease_s * f64::from(i) / 10.0;
        let turn = core::f64::consts::PI / ease_s;
        let along_s = t / 2.0 - (turn * t).sin() / (2.0 * turn);
        let [position, ..] = path.splines()[0].sample(along_s);
        assert!((at(&got, t)[0].position_rad - position).abs() < 1e-5, "{t}");
    }
}

#[test]
fn a_path_backwards_is_eased_like_the_path() {
    // It starts gently and stops while slowing down, so its two ends need different easing.
    let turn = |i: usize| 0.8 * (TAU * 0.7 * i as f64 / RATE_HZ + 0.9).sin();
    let row: Vec<f64> = (0..300).map(turn).collect();
    let limits = [JointLimits::new(-2.0, 2.0, 6.0, 20.0).unwrap()];
    let there = Path::new(names(1), RATE_HZ, vec![row.clone()]).unwrap();
    let back = Path::new(names(1), RATE_HZ, vec![row.into_iter().rev().collect()]).unwrap();
    let there = plan(&there.first_rad(), &there, &limits, options()).unwrap();
    let back = plan(&back.first_rad(), &back, &limits, options()).unwrap();
    assert!(there.ease_in_s != there.ease_out_s);
    assert_eq!((there.ease_in_s, there.ease_out_s), (back.ease_out_s, back.ease_in_s));
}

#[test]
fn a_motion_beyond_its_limits_is_slowed_down_or_refused_by_name() {
    let path = waves(2, 1.0, 2.0, 3.0);
    let got = plan(&[0.0; 2], &path, &limits(2), options()).unwrap();
    // Acceleration decides: (4 pi)^2 = 157.9 against 40.
    let least = TAU * 2.0 / 40f64.sqrt();
    let factor = got.retimed.factor;
    assert!(factor > least && factor < least * 1.1, "{factor} {least}");
    assert_eq!(got.retimed.because, Because::Acceleration);
    let strict = PlanOptions { retime: false, ..options() };
    let error = plan(&[0.0; 2], &path, &limits(2), strict).unwrap_err();
    assert!(error.what.contains("beyond its limit"), "{error}");
    let half_speed = PlanOptions { speed: 0.45, ..strict };
    assert!(plan(&[0.0; 2], &path, &limits(2), half_speed).is_ok());
}

#[test]
fn speed_multiplies_before_retiming() {
    let path = swing(0.5, 2.0);
    let double = plan(&[0.0], &path, &limits(1), PlanOptions { speed: 2.0, ..options() }).unwrap();
    assert_eq!(double.retimed.factor, 1.0);
    assert!((double.clip_s - 1.0).abs() < 1e-9);
    let absurd =
        plan(&[0.0], &path, &limits(1), PlanOptions { speed: 100.0, ..options() }).unwrap();
    let shortest = shortest_step_s(0.5, 6.0, 40.0);
    assert!((absurd.clip_s / shortest - 1.0).abs() < 0.1, "{} {shortest}", absurd.clip_s);
    for speed in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e3] {
        assert!(plan(&[0.0], &path, &limits(1), PlanOptions { speed, ..options() }).is_err());
    }
}

#[test]
fn positions_are_never_mended() {
    let path = waves(1, 2.1, 0.2, 5.0);
    let error = plan(&[0.0], &path, &limits(1), options()).unwrap_err();
    assert_eq!(error.what, "position of joint j0 is beyond its limit");
}

#[test]
fn a_start_outside_the_range_or_far_away_is_refused_by_joint() {
    let path = waves(2, 0.5, 1.0, 2.0);
    for bad in [2.000_001, -2.1, f64::NAN, f64::INFINITY] {
        let error = plan(&[0.0, bad], &path, &limits(2), options()).unwrap_err();
        assert_eq!(error.what, "joint j1 stands outside its range");
    }
    let strict = PlanOptions { approach: false, ..options() };
    let mut start = path.first_rad();
    start[1] += 0.049;
    let near = plan(&start, &path, &limits(2), strict).unwrap();
    assert!(near.approach_s >= APPROACH_MIN_S);
    start[1] += 0.002;
    let error = plan(&start, &path, &limits(2), strict).unwrap_err();
    assert_eq!(error.place.as_deref(), Some("joint j1"));
    assert!(plan(&[0.0], &path, &limits(2), options()).is_err());
    assert!(plan(&[0.0; 2], &path, &limits(1), options()).is_err());
}

#[test]
fn a_gap_below_a_milliradian_is_closed_quickly_but_smoothly() {
    let path = swing(0.5, 1.0);
    let plan = plan(&[5e-4], &path, &limits(1), options()).unwrap();
    assert!(plan.approach_s > 0.0 && plan.approach_s < 0.1);
    assert_eq!(plan.trajectory.start_rad(), [5e-4]);
}

#[test]
fn rounds_return_to_the_first_pose_between_them() {
    let path = waves(2, 0.5, 0.7, 1.0);
    let options = PlanOptions { rounds: 3, ..options() };
    let got = plan(&path.first_rad(), &path, &limits(2), options).unwrap();
    let back_s = (got.trajectory.duration_s() - 3.0 * got.clip_s) / 2.0;
    assert!(back_s >= APPROACH_MIN_S);
    for round in 0..3 {
        let begin_s = f64::from(round) * (got.clip_s + back_s);
        for (setpoint, first) in at(&got, begin_s).iter().zip(path.first_rad()) {
            assert!((setpoint.position_rad - first).abs() < 1e-6);
        }
    }
    assert!(plan(&[0.0; 2], &path, &limits(2), PlanOptions { rounds: 0, ..options }).is_err());
    let endless = PlanOptions { rounds: u32::MAX, ..options };
    assert!(plan(&[0.0; 2], &path, &limits(2), endless).is_err());
}

#[test]
fn a_start_and_a_first_pose_exactly_at_a_limit_are_accepted() {
    let edge = [JointLimits::new(0.0, 2.0, 6.0, 40.0).unwrap()];
    for start in [0.0, 1e-4, 0.5, 2.0] {
        let got = plan(&[start], &swing(1.0, 1.0), &edge, options());
        assert!(got.is_ok(), "{start}: {}", got.unwrap_err());
    }
}

#[test]
fn two_samples_in_full_flight_are_slowed_until_they_can_be_eased() {
    let path = Path::new(names(1), RATE_HZ, vec![vec![0.0, 0.04]]).unwrap();
    let got = plan(&[0.0], &path, &limits(1), options()).unwrap();
    assert!(got.retimed.factor > 1.0);
    assert_eq!(got.trajectory.end_rad(), [0.04]);
}

#[test]
fn noise_at_full_rate_is_slowed_down_rather_than_refused() {
    let noisy = |i: usize| if (i * 7919) % 13 < 6 { 0.02 } else { -0.02 };
    let row = (0..240).map(|i| 0.5 * (TAU * i as f64 / 120.0).sin() + noisy(i)).collect();
    let path = Path::new(names(1), RATE_HZ, vec![row]).unwrap();
    let got = plan(&[0.0], &path, &limits(1), options()).unwrap();
    assert!(got.retimed.factor > 2.0);
}

#[test]
fn calm_transitions_take_so_many_times_as_long_and_the_path_takes_what_it_took() {
    let path = Path::new(names(1), 10.0, vec![vec![0.5, 0.6, 0.5, 0.5]]).unwrap();
    let played = |calm: f64| {
        let options = PlanOptions { calm, rounds: 2, ..options() };
        plan(&[0.0], &path, &limits(1), options).unwrap()
    };
    let (usual, calm) = (played(1.0), played(3.0));
    assert_eq!(calm.clip_s, usual.clip_s);
    assert!((calm.approach_s / usual.approach_s - 3.0).abs() < 0.02, "{}", calm.approach_s);
    // Two transitions, and the path twice.
    let transitions_s = |of: &Plan| of.trajectory.duration_s() - 2.0 * of.clip_s;
    assert!((transitions_s(&calm) / transitions_s(&usual) - 3.0).abs() < 0.02);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn every_plan_starts_where_the_robot_stands_and_rests_at_both_ends(
        rows in prop::collection::vec(prop::collection::vec(-1.0..1.0, 2..30), 1..4),
        start in -1.9..1.9,
        rate_hz in 2.0..200.0,
        speed in 0.1..5.0,
        rounds in 1u32..3,
    ) {
        let samples = rows.iter().map(Vec::len).min().unwrap_or(2);
        let rows: Vec<Vec<f64>> = rows.into_iter().map(|row| row[..samples].to_vec()).collect();
        let joints = rows.len();
        let path = Path::new(names(joints), rate_hz, rows).unwrap();
        let start = vec![start; joints];
        let options = PlanOptions { speed, rounds, ..options() };
        let limits = vec![JointLimits::new(-4.0, 4.0, 6.0, 40.0).unwrap(); joints];
        let got = plan(&start, &path, &limits, options).unwrap();
        prop_assert_eq!(got.trajectory.start_rad(), start);
        let end = at(&got, f64::INFINITY);
        for (setpoint, last) in end.iter().zip(path.last_rad()) {
            prop_assert_eq!(setpoint.velocity_rad_s, 0.0);
            prop_assert!((setpoint.position_rad - last).abs() < 1e-12);
        }
        for peak in got.trajectory.peak_acceleration_rad_s2() {
            prop_assert!(peak <= 40.0 * (1.0 + 1e-12));
        }
    }
}
