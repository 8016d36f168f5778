use super::*;
use proptest::prelude::*;

const V: f64 = 4.0;
const A: f64 = 20.0;
const LOWER: f64 = -0.5;
const UPPER: f64 = 1.0;
const DT: f64 = 0.01;

fn limits() -> Vec<JointLimits> {
    vec![JointLimits::new(LOWER, UPPER, V, A).unwrap()]
}

fn at(position_rad: f64, velocity_rad_s: f64) -> Target {
    Target {
        position_rad: vec![position_rad],
        velocity_rad_s: vec![velocity_rad_s],
        age_s: 0.0,
        careful: Vec::new(),
    }
}

/// A follower that has reached `q` and may use all of its limits.
fn following(q: f64) -> Follower {
    let mut follower = Follower::standing_at(&[q], limits());
    step(&mut follower, DT, Some(&at(q, 0.0)));
    assert!(!follower.is_approaching());
    follower
}

fn step(follower: &mut Follower, dt_s: f64, target: Option<&Target>) -> Setpoint {
    let mut setpoints = [Setpoint::default()];
    follower.advance(dt_s, target, &mut setpoints);
    setpoints[0]
}

#[test]
fn a_step_of_the_target_takes_the_shortest_time_there_is() {
    // 0.5 rad at 20 rad/s^2 without reaching 4 rad/s: 2 sqrt(0.5 / 20) = 0.3162 s.
    let mut follower = following(0.0);
    let shortest_s = 2.0 * (0.5_f64 / A).sqrt();
    let before = (shortest_s / DT).floor() as usize;
    for _ in 0..before {
        assert!(step(&mut follower, DT, Some(&at(0.5, 0.0))).position_rad < 0.5 - 1e-6);
    }
    let last = step(&mut follower, DT, Some(&at(0.5, 0.0)));
    assert!((last.position_rad - 0.5).abs() < 1e-12 && last.velocity_rad_s == 0.0, "{last:?}");
    assert!(follower.is_at_rest());
}

#[test]
fn a_long_way_is_cruised_at_the_velocity_limit() {
    // 0.8 rad up to 4 rad/s and down again, and 0.7 rad between: 0.4 s + 0.175 s.
    let mut follower = following(LOWER);
    let mut fastest = 0.0_f64;
    for _ in 0..57 {
        fastest = fastest.max(step(&mut follower, DT, Some(&at(UPPER, 0.0))).velocity_rad_s);
    }
    assert!((fastest - V).abs() < 1e-9 && !follower.is_at_rest());
    let last = step(&mut follower, DT, Some(&at(UPPER, 0.0)));
    assert!((last.position_rad - UPPER).abs() < 1e-9 && follower.is_at_rest());
}

#[test]
fn an_even_motion_is_met_and_then_followed_without_distance() {
    let mut follower = following(0.0);
    // Up to 0.85 rad: from further on 1.5 rad/s could not be stopped in time.
    for cycle in 1..50 {
        let wanted = 0.1 + 1.5 * DT * f64::from(cycle);
        let got = step(&mut follower, DT, Some(&at(wanted, 1.5)));
        if cycle > 30 {
            assert!((got.position_rad - wanted).abs() < 1e-9, "{cycle}");
            assert!((got.velocity_rad_s - 1.5).abs() < 1e-9);
        }
    }
}

#[test]
fn an_old_pose_of_a_moving_person_is_carried_forward_to_now() {
    let mut follower = following(0.0);
    for cycle in 0..60 {
        let now = 1.5 * DT * f64::from(cycle);
        let target = Target { age_s: 0.04, ..at(now - 1.5 * 0.04, 1.5) };
        let got = step(&mut follower, DT, Some(&target));
        assert!(cycle < 30 || (got.position_rad - now).abs() < 1e-9, "{cycle}");
    }
}

#[test]
fn the_lag_of_what_cannot_be_followed_is_estimated_and_its_samples_are_counted() {
    let mut follower = following(0.0);
    // A slow swing is followed without lag.
    for cycle in 0..300 {
        let t = f64::from(cycle) * DT;
        step(&mut follower, DT, Some(&at(0.3 * (2.0 * t).sin(), 0.6 * (2.0 * t).cos())));
    }
    assert!(follower.tally().lag_s().unwrap().abs() < 0.005);
    let few = follower.tally().limited_samples[0];
    assert!(few < 20, "{few}");
    // 15 rad/s at 0.45 rad asks for 101 rad/s^2: more than the joint has.
    for cycle in 0..300 {
        let t = f64::from(cycle) * DT;
        step(&mut follower, DT, Some(&at(0.45 * (15.0 * t).sin(), 6.75 * (15.0 * t).cos())));
    }
    let tally = follower.tally();
    assert!(tally.limited_samples[0] > few + 150, "{tally:?}");
    assert!(tally.lag_s().unwrap() > 0.01, "{:?}", tally.lag_s());
}

#[test]
fn the_first_way_is_taken_at_a_share_of_the_limits() {
    let mut follower = Follower::standing_at(&[LOWER], limits());
    let mut fastest = 0.0_f64;
    for _ in 0..400 {
        fastest = fastest.max(step(&mut follower, DT, Some(&at(UPPER, 0.0))).velocity_rad_s);
    }
    assert!((fastest - APPROACH_SHARE * V).abs() < 1e-9);
    assert!(!follower.is_approaching());
    // From 0.05 rad on it is the joint's own matter.
    assert!(follower.tally().limited_samples[0] <= 3);
}

/// A joint that moves fast when care is asked for brakes at its limits until it could go on with care.
#[test]
fn a_joint_that_is_moved_with_care_uses_a_share_of_its_limits_until_it_is_where_it_is_wanted() {
    let careful = |position_rad| Target { careful: vec![true], ..at(position_rad, 0.0) };
    let mut follower = following(LOWER);
    let mut before = 0.0;
    for _ in 0..20 {
        before = step(&mut follower, DT, Some(&at(UPPER, 0.0))).velocity_rad_s;
    }
    let fast = APPROACH_SHARE * V;
    assert!(before > 2.0 * fast, "{before}");
    let mut steps = 0;
    while before > fast {
        let got = step(&mut follower, DT, Some(&careful(UPPER)));
        assert!((before - got.velocity_rad_s - A * DT).abs() < 1e-9, "{got:?}");
        (before, steps) = (got.velocity_rad_s, steps + 1);
    }
    assert!(steps > 3, "{steps}");
    for _ in 0..400 {
        let got = step(&mut follower, DT, Some(&careful(UPPER)));
        let most = APPROACH_SHARE * A * DT * (1.0 + 1e-9);
        assert!((got.velocity_rad_s - before).abs() <= most, "{got:?}");
        assert!(got.velocity_rad_s <= fast * (1.0 + 1e-9), "{got:?}");
        before = got.velocity_rad_s;
    }
    let end = step(&mut follower, DT, Some(&careful(UPPER)));
    assert!((end.position_rad - UPPER).abs() < 1e-9, "it arrives: {end:?}");
    // Nobody asks for care any more, but it is not where it is wanted yet.
    let mut fast = 0;
    for cycle in 0..400 {
        let got = step(&mut follower, DT, Some(&at(LOWER, 0.0)));
        let is_near = (got.position_rad - LOWER).abs() <= NEAR_RAD;
        assert!(is_near || -got.velocity_rad_s <= APPROACH_SHARE * V + 1e-9, "{cycle}: {got:?}");
    }
    for _ in 0..100 {
        let got = step(&mut follower, DT, Some(&at(0.9, 0.0)));
        fast += usize::from(got.velocity_rad_s > 2.0 * APPROACH_SHARE * V);
    }
    assert!(fast > 5, "{fast}");
}

#[test]
fn input_older_than_100_ms_is_braked_from_and_approached_again() {
    let mut follower = following(0.0);
    for _ in 0..10 {
        step(&mut follower, DT, Some(&at(0.9, 0.0)));
    }
    let moving = step(&mut follower, DT, Some(&at(0.9, 0.0)));
    let old = Target { age_s: 0.101, ..at(0.9, 0.0) };
    let after = step(&mut follower, DT, Some(&old));
    assert!((moving.velocity_rad_s - after.velocity_rad_s - A * DT).abs() < 1e-9);
    for _ in 0..30 {
        step(&mut follower, DT, Some(&old));
    }
    assert!(follower.is_at_rest());
    let again = step(&mut follower, DT, Some(&at(0.9, 0.0)));
    assert!((again.velocity_rad_s - APPROACH_SHARE * A * DT).abs() < 1e-9);
}

#[test]
fn what_is_no_number_or_of_another_robot_is_not_followed() {
    let wide = Target { position_rad: vec![0.5; 2], velocity_rad_s: vec![0.0; 2], ..at(0.0, 0.0) };
    let aged = Target { age_s: f64::NAN, ..at(0.5, 0.0) };
    for bad in [at(f64::NAN, 0.0), at(f64::INFINITY, 0.0), at(0.5, f64::NAN), wide, aged] {
        let mut follower = following(0.2);
        let got = step(&mut follower, DT, Some(&bad));
        let infinite = bad.position_rad[0] == f64::INFINITY;
        assert!(got.position_rad == 0.2 || infinite, "{bad:?}");
        assert!(got.position_rad.is_finite() && got.velocity_rad_s.is_finite());
    }
}

#[test]
fn a_stop_comes_to_rest_whatever_is_asked() {
    let mut follower = following(0.0);
    for _ in 0..12 {
        step(&mut follower, DT, Some(&at(0.9, 0.0)));
    }
    follower.stop();
    let mut before = step(&mut follower, 0.0, None);
    let mut cycles = 0;
    while !follower.is_at_rest() {
        let after = step(&mut follower, DT, Some(&at(0.9, 2.0)));
        assert!(after.velocity_rad_s < before.velocity_rad_s);
        before = after;
        cycles += 1;
    }
    // pi/2 times 2.4 rad/s at 20 rad/s^2: 0.1885 s.
    assert_eq!(cycles, 19);
    assert_eq!(step(&mut follower, DT, Some(&at(0.9, 0.0))), before.at_rest());
}

/// The printed half form: speed `v (1 + cos(pi t / D)) / 2`, its integral and its derivative.
fn half_form(q: f64, v: f64, lasts_s: f64, t_s: f64) -> [f64; 3] {
    let turn = core::f64::consts::PI / lasts_s;
    let t_s = t_s.min(lasts_s);
    let angle = turn * t_s;
    [
        q + v * (t_s / 2.0 + angle.sin() / (2.0 * turn)),
        v * (1.0 + angle.cos()) / 2.0,
        -v * turn * angle.sin() / 2.0,
    ]
}

#[test]
fn a_stop_is_the_second_half_of_an_actionlet_that_peaks_at_the_limit() {
    for (sign, cycles) in [(1.0, 12), (-1.0, 12), (1.0, 3)] {
        let mut follower = following(0.25);
        let mut before = Setpoint::default();
        for _ in 0..cycles {
            before = step(&mut follower, DT, Some(&at(0.25 + sign * 0.7, 0.0)));
        }
        let (q, v) = (before.position_rad, before.velocity_rad_s);
        assert!((v - sign * A * DT * f64::from(cycles)).abs() < 1e-9);
        let lasts_s = core::f64::consts::FRAC_PI_2 * v.abs() / A;
        follower.stop();
        let mut t_s = 0.0;
        for dt_s in [0.0, 0.01, 0.004, 0.017, 0.01, 0.03, 0.01, 0.05, 0.02, 0.01, 0.09] {
            t_s += dt_s;
            let got = step(&mut follower, dt_s, None);
            let [position, velocity, _] = half_form(q, v, lasts_s, t_s);
            assert!((got.position_rad - position).abs() < 1e-12, "{t_s}: {got:?} {position}");
            assert!((got.velocity_rad_s - velocity).abs() < 1e-12, "{t_s}: {got:?} {velocity}");
        }
        assert!(follower.is_at_rest());
        let at = |part: i32| half_form(q, v, lasts_s, lasts_s * f64::from(part) / 100.0)[2].abs();
        assert!(((0..=100).map(at).fold(0.0, f64::max) - A).abs() < 1e-9);
    }
}

#[test]
fn near_the_end_of_the_range_a_stop_is_shortened_to_end_there() {
    // At full speed, a step before the place from which a brake at the limit just holds it.
    let mut follower = following(LOWER);
    let mut last = Setpoint::default();
    while last.position_rad + V * DT < UPPER - V * V / (2.0 * A) {
        last = step(&mut follower, DT, Some(&at(UPPER, 0.0)));
    }
    let (q, v) = (last.position_rad, last.velocity_rad_s);
    let lasts_s = 2.0 * (UPPER - q) / v;
    assert!((v - V).abs() < 1e-9 && lasts_s < 1.5 * V / A, "{last:?}: room for the whole form");
    follower.stop();
    for quarter in 1..=8 {
        last = step(&mut follower, lasts_s / 4.0, None);
        let t_s = lasts_s / 4.0 * f64::from(quarter);
        let [position, velocity, _] = half_form(q, v, lasts_s, t_s);
        assert!((last.position_rad - position).abs() < 1e-9, "{quarter}: {last:?} {position}");
        assert!((last.velocity_rad_s - velocity).abs() < 1e-9, "{quarter}: {last:?} {velocity}");
    }
    assert!(follower.is_at_rest() && (last.position_rad - UPPER).abs() < 1e-9, "{last:?}");
}

impl Setpoint {
    fn at_rest(self) -> Self {
        Self { velocity_rad_s: 0.0, acceleration_rad_s2: 0.0, ..self }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    /// Wild targets, steps from 0 to 150 ms, dropouts, approaches: the goals written are a motion
    /// within the limits, and it can always be stopped inside them.
    #[test]
    fn whatever_is_asked_the_limits_hold_and_rest_is_always_in_reach(
        start in LOWER..UPPER,
        asked in prop::collection::vec(
            (
                -3.0..3.0_f64, -9.0..9.0_f64, 0.0..0.12_f64, 0.0..0.15_f64, any::<bool>(),
                any::<bool>(),
            ),
            1..80,
        ),
    ) {
        let mut follower = Follower::standing_at(&[start], limits());
        let (mut q, mut v) = (start, 0.0_f64);
        for (position, velocity, age_s, dt_s, calm, careful) in asked {
            let dt_s = if calm { 0.008 + dt_s / 50.0 } else { dt_s };
            let target = Target { age_s, careful: vec![careful], ..at(position, velocity) };
            let got = step(&mut follower, dt_s, Some(&target));
            let t = dt_s.min(LONGEST_STEP_S);
            prop_assert!((LOWER..=UPPER).contains(&got.position_rad));
            prop_assert!(got.velocity_rad_s.abs() <= V * (1.0 + 1e-12));
            prop_assert!((got.velocity_rad_s - v).abs() <= A * t * (1.0 + 1e-9) + 1e-12);
            prop_assert!((got.position_rad - q).abs() <= V * t * (1.0 + 1e-9) + 1e-12);
            // Between samples no acceleration beyond A can hide: from (q, v) the joint can have
            // gone neither further nor less far than full acceleration either way allows.
            let middle = q + v * t;
            prop_assert!((got.position_rad - middle).abs() <= A * t * t / 2.0 + 1e-9);
            let mut stopped = follower.clone();
            stopped.stop();
            let most = core::f64::consts::FRAC_PI_2 * A * 0.007 * (1.0 + 1e-9);
            let mut before = got.velocity_rad_s;
            // 45 of these are longer than pi/2 V / A.
            for _ in 0..45 {
                let rest = step(&mut stopped, 0.007, None);
                prop_assert!((LOWER..=UPPER).contains(&rest.position_rad));
                let lost = (before - rest.velocity_rad_s) * before.signum();
                prop_assert!((0.0..=most).contains(&lost), "{lost}");
                before = rest.velocity_rad_s;
            }
            prop_assert!(stopped.is_at_rest());
            (q, v) = (got.position_rad, got.velocity_rad_s);
        }
    }

    /// The law is in continuous time: how it is cut into steps does not matter.
    #[test]
    fn two_short_steps_are_one_long_step(
        first in -0.4..0.9_f64, goal in LOWER..UPPER, dt_s in 0.0..0.1_f64, cut in 0.0..1.0_f64,
    ) {
        let mut one = following(0.0);
        for _ in 0..7 {
            step(&mut one, DT, Some(&at(first, 0.0)));
        }
        let mut two = one.clone();
        let whole = step(&mut one, dt_s, Some(&at(goal, 0.0)));
        step(&mut two, dt_s * cut, Some(&at(goal, 0.0)));
        let rest = step(&mut two, dt_s * (1.0 - cut), Some(&at(goal, 0.0)));
        prop_assert!((whole.position_rad - rest.position_rad).abs() < 1e-7);
        prop_assert!((whole.velocity_rad_s - rest.velocity_rad_s).abs() < 1e-5);
    }

    #[test]
    fn a_target_that_rests_is_reached_from_any_motion(
        way in prop::collection::vec((-1.0..2.0_f64, -4.0..4.0_f64), 0..20),
        goal in LOWER..UPPER,
    ) {
        let mut follower = following(0.0);
        for (position, velocity) in way {
            step(&mut follower, DT, Some(&at(position, velocity)));
        }
        for _ in 0..150 {
            step(&mut follower, DT, Some(&at(goal, 0.0)));
        }
        let got = step(&mut follower, DT, Some(&at(goal, 0.0)));
        prop_assert!((got.position_rad - goal).abs() < 1e-9);
        prop_assert!(got.velocity_rad_s.abs() < 1e-9);
    }
}

#[test]
fn what_it_is_doing_and_how_often_is_told_exactly() {
    let mut follower = Follower::standing_at(&[0.0], limits());
    assert!(follower.is_approaching() && !follower.is_stopping());
    step(&mut follower, DT, Some(&at(0.5, 0.0)));
    step(&mut follower, DT, Some(&at(0.5, 0.0)));
    assert!(follower.is_approaching());
    let mut follower = following(0.0);
    for _ in 0..3 {
        step(&mut follower, DT, Some(&at(0.0, 0.0)));
    }
    assert_eq!(follower.tally().lag_s(), None, "nothing has moved");
    for _ in 0..4 {
        step(&mut follower, DT, None);
    }
    let tally = follower.tally().clone();
    // The step that ended the approach was one of it.
    assert_eq!((tally.approach_samples, tally.followed_samples, tally.stale_samples), (1, 3, 4));
    follower.stop();
    assert!(follower.is_stopping());
    step(&mut follower, DT, None);
    step(&mut follower, DT, Some(&at(0.5, 0.0)));
    assert_eq!(follower.tally(), &tally, "whoever stops misses nothing");
}

#[test]
fn the_lag_is_the_slope_of_distance_over_velocity() {
    let mut follower = following(0.0);
    let (mut behind, mut moved) = (0.0, 0.0);
    for cycle in 1..=200 {
        let t = f64::from(cycle) * DT;
        let (wanted, velocity) = (0.45 * (9.0 * t).sin(), 0.45 * 9.0 * (9.0 * t).cos());
        // The follower carries a target on at no more than it lets itself move.
        let carried = velocity.clamp(-TARGET_VELOCITY_SHARE * V, TARGET_VELOCITY_SHARE * V);
        let got = step(&mut follower, DT, Some(&at(wanted, velocity)));
        behind += (wanted - got.position_rad) * carried;
        moved += carried * carried;
    }
    let lag_s = follower.tally().lag_s().unwrap();
    assert!(lag_s > 1e-3 && (lag_s - behind / moved).abs() < 1e-9, "{lag_s}");
}

#[test]
fn a_target_that_is_no_number_leaves_the_figures_alone() {
    let mut follower = following(0.0);
    step(&mut follower, DT, Some(&at(0.01, 1.0)));
    let before = follower.tally().clone();
    step(&mut follower, DT, Some(&at(f64::NAN, 1.0)));
    step(&mut follower, DT, Some(&at(0.0, f64::NAN)));
    let after = follower.tally();
    assert_eq!(after.limited_samples, before.limited_samples);
    assert_eq!(after.lag_s(), before.lag_s());
}

#[test]
fn the_acceleration_told_is_the_change_of_velocity_in_the_step() {
    let mut follower = following(0.0);
    let first = step(&mut follower, DT, Some(&at(0.5, 0.0)));
    assert!((first.acceleration_rad_s2 - A).abs() < 1e-9, "{first:?}");
    let second = step(&mut follower, 2.0 * DT, Some(&at(0.5, 0.0)));
    let change = second.velocity_rad_s - first.velocity_rad_s;
    assert!((second.acceleration_rad_s2 - change / (2.0 * DT)).abs() < 1e-9 && change > 0.1);
    let standing = step(&mut follower, 0.0, Some(&at(0.5, 0.0)));
    assert_eq!(standing.acceleration_rad_s2, 0.0, "no time, no change");
}

#[test]
fn as_near_as_an_approach_must_come_is_near() {
    let mut follower = Follower::standing_at(&[0.0], limits());
    step(&mut follower, 0.0, Some(&at(NEAR_RAD * 1.001, 0.0)));
    assert!(follower.is_approaching());
    step(&mut follower, 0.0, Some(&at(NEAR_RAD, 0.0)));
    assert!(!follower.is_approaching());
}

/// The whole way of a joint that is cruised in one step: 25 ms up to 0.5 rad/s, 35 ms, 25 ms down.
#[test]
fn one_long_step_goes_through_all_of_its_parts() {
    let bounds = Bounds { lower: -9.0, upper: 9.0, v: 0.5, a: 20.0 };
    for (t_s, q, v) in [
        (0.010, 0.001, 0.2),
        (0.025, 0.006_25, 0.5),
        (0.050, 0.018_75, 0.5),
        (0.060, 0.023_75, 0.5),
        (0.075, 0.029, 0.2),
        (0.085, 0.03, 0.0),
        (0.100, 0.03, 0.0),
    ] {
        let mut state = State { q: 0.0, v: 0.0 };
        state.intercept(State { q: 0.03, v: 0.0 }, t_s, bounds);
        assert!((state.q - q).abs() < 1e-12 && (state.v - v).abs() < 1e-12, "{t_s}: {state:?}");
    }
}

proptest! {
    /// The quickest way to meet a target is still the quickest when it is asked for again half-way.
    #[test]
    fn a_step_is_the_same_in_one_or_in_two(
        d in -0.3..0.3_f64,
        v in -0.9..0.9_f64,
        target_v in -0.8..0.8_f64,
        t_s in 0.001..0.1_f64,
        share in 0.0..1.0_f64,
    ) {
        let bounds = Bounds { lower: -9.0, upper: 9.0, v: 1.0, a: 20.0 };
        let (mut once, mut twice) = (State { q: 0.0, v }, State { q: 0.0, v });
        let target = State { q: d, v: target_v };
        once.intercept(target, t_s, bounds);
        let first_s = share * t_s;
        twice.intercept(target, first_s, bounds);
        let later = State { q: d + target_v * first_s, ..target };
        twice.intercept(later, t_s - first_s, bounds);
        // Rounding can decide anew which way to go where it makes no difference: up to a sample.
        prop_assert!((once.q - twice.q).abs() < 1e-6 && (once.v - twice.v).abs() < 1e-4,
            "{once:?} {twice:?}");
    }
}

#[test]
fn a_goal_that_brakes_rests_half_as_far_as_its_speed_would_have_taken_it() {
    // From 1 rad/s at 2 rad/s2: at rest after 0.5 s and 0.25 rad, and then no more.
    for sign in [1.0, -1.0] {
        let goal = Chase { position_rad: 0.5, velocity_rad_s: sign };
        let after = |dt_s: f64| {
            let Chase { position_rad, velocity_rad_s } = goal.braked(dt_s, 2.0);
            (position_rad - 0.5, velocity_rad_s)
        };
        assert_eq!(after(0.25), (sign * 0.1875, sign * 0.5));
        assert_eq!([0.5, 1.0, 60.0].map(after), [(sign * 0.25, 0.0); 3]);
    }
}

#[test]
fn noise_of_an_encoder_says_nothing_of_a_delay() {
    let mut follower = following(0.0);
    // 1e-9 rad off at 1e-12 rad/s would be 1,000 s behind.
    for _ in 0..3 {
        let _ = step(&mut follower, DT, Some(&at(1e-9, 1e-12)));
    }
    assert_eq!(follower.tally().lag_s(), None);
}
