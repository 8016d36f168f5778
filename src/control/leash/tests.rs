//! Goals near their joints: exact figures at the bound, and long ways with joints that follow, are
//! blocked, freed, pushed and heard of late.

use super::*;
use crate::time::Duration;
use proptest::prelude::*;

const BOUND_RAD: f64 = 0.35;
/// Rounding of a hundred additions, far below a count of any encoder.
const TINY: f64 = 1e-9;

fn limits(velocity_rad_s: f64, acceleration_rad_s2: f64) -> JointLimits {
    JointLimits::new(-3.0, 3.0, velocity_rad_s, acceleration_rad_s2).expect("limits")
}

fn at(seconds: f64) -> Instant {
    Instant::ZERO + Duration::from_secs_f64(seconds)
}

fn goal(position_rad: f64, velocity_rad_s: f64) -> Setpoint {
    Setpoint { position_rad, velocity_rad_s, acceleration_rad_s2: 0.0 }
}

/// A joint of 5 rad/s and 10 rad/s², so that its goals brake at 18 rad/s²; it stands at 0, was read
/// at 0 s, and everything is seen in a mirror if `sign` is -1. Another one before it never moves.
struct One {
    leash: Leash,
    sign: f64,
}

impl One {
    fn new(sign: f64) -> Self {
        let two = vec![limits(5.0, 10.0); 2];
        Self { leash: Leash::new(&[0.0, 0.0], two, BOUND_RAD, at(0.0)), sign }
    }

    fn heard(&mut self, present_rad: f64, at_s: f64) {
        self.leash.heard(1, self.sign * present_rad, at(at_s));
    }

    /// The goal for a motion that is at this position and speed, `dt_s` after the last, and whether
    /// it was let through as it is.
    fn step(&mut self, dt_s: f64, now_s: f64, position: f64, velocity: f64) -> (Setpoint, bool) {
        self.advance(dt_s, now_s, position, velocity, false)
    }

    fn advance(
        &mut self,
        dt_s: f64,
        now_s: f64,
        position_rad: f64,
        velocity_rad_s: f64,
        stopping: bool,
    ) -> (Setpoint, bool) {
        let wanted = goal(self.sign * position_rad, self.sign * velocity_rad_s);
        let mut goals = [Setpoint::default(), wanted];
        self.leash.advance(dt_s, at(now_s), stopping, |_| true, &mut goals);
        let [still, goal] = goals;
        assert_eq!((still, self.leash.is_held(0)), (Setpoint::default(), false));
        let free = goal == wanted && !self.leash.is_held(1);
        let mirrored = Setpoint {
            position_rad: self.sign * goal.position_rad,
            velocity_rad_s: self.sign * goal.velocity_rad_s,
            acceleration_rad_s2: self.sign * goal.acceleration_rad_s2,
        };
        (mirrored, free)
    }
}

/// Whether a first goal at this position and speed is free.
fn first_is_free(sign: f64, position_rad: f64, velocity_rad_s: f64) -> bool {
    One::new(sign).step(0.01, 0.01, position_rad, velocity_rad_s).1
}

#[test]
fn a_goal_is_free_if_it_can_still_brake_to_rest_within_the_bound() {
    for sign in [1.0, -1.0] {
        // At rest it may lie on the bound itself.
        assert!(first_is_free(sign, 0.35, 0.0));
        assert!(!first_is_free(sign, 0.35 + TINY, 0.0));
        // From 3 rad/s it brakes in 3² / (2 x 18) = 0.25 rad, from 2 rad/s in 1/9 rad.
        assert!(first_is_free(sign, 0.1 - TINY, 3.0));
        assert!(!first_is_free(sign, 0.1 + TINY, 3.0));
        assert!(first_is_free(sign, 0.35 - 1.0 / 9.0 - TINY, 2.0));
        assert!(!first_is_free(sign, 0.35 - 1.0 / 9.0 + TINY, 2.0));
        // One that comes nearer needs no way to brake.
        assert!(first_is_free(sign, 0.35, -5.0));
    }
    // From 4 rad/s it brakes in 16/36 rad, wherever it is.
    assert!(!first_is_free(1.0, 0.0, 4.0));
}

/// A joint that was read at 0 rad at 0 s and at 0.01 rad at 10 ms, so that it moves along at 1 rad/s,
/// and whether a goal written 20 ms later is free.
fn is_free_beside_a_moving_joint(sign: f64, position_rad: f64, velocity_rad_s: f64) -> bool {
    let mut one = One::new(sign);
    one.heard(0.01, 0.01);
    one.step(0.01, 0.03, position_rad, velocity_rad_s).1
}

#[test]
fn a_joint_that_moves_along_lets_its_goal_be_further_ahead() {
    for sign in [1.0, -1.0] {
        // Since it was read it has moved by 0.02 rad. At its own speed the goal gains nothing on it.
        assert!(is_free_beside_a_moving_joint(sign, 0.38 - TINY, 1.0));
        assert!(!is_free_beside_a_moving_joint(sign, 0.38 + TINY, 1.0));
        // At 4 rad/s it gains 3 rad/s, which take 0.25 rad to brake.
        assert!(is_free_beside_a_moving_joint(sign, 0.13 - TINY, 4.0));
        assert!(!is_free_beside_a_moving_joint(sign, 0.13 + TINY, 4.0));
        // Behind it, the joint moves away and helps nobody.
        assert!(is_free_beside_a_moving_joint(sign, -0.34 + TINY, 0.0));
        assert!(!is_free_beside_a_moving_joint(sign, -0.34 - TINY, 0.0));
        assert!(is_free_beside_a_moving_joint(sign, -0.09 + TINY, -3.0));
        assert!(!is_free_beside_a_moving_joint(sign, -0.09 - TINY, -3.0));
    }
}

#[test]
fn a_joint_is_supposed_to_follow_its_goal_until_it_is_read_again() {
    /// A goal that went on at 2 rad/s for eight cycles in which nobody read the joint.
    fn unread(sign: f64) -> One {
        let mut one = One::new(sign);
        for k in 1..=8 {
            let now_s = 0.02 * f64::from(k);
            assert!(one.step(0.02, now_s, 0.1 * f64::from(k), 2.0).1, "{k}");
        }
        one
    }
    for sign in [1.0, -1.0] {
        // It follows, 0.3 rad behind: 0.5 rad in 0.16 s, and 0.0625 rad more since.
        let mut one = unread(sign);
        one.heard(0.5, 0.16);
        assert!(one.step(0.02, 0.18, 0.9125 - TINY, 0.0).1);
        let mut one = unread(sign);
        one.heard(0.5, 0.16);
        assert!(!one.step(0.02, 0.18, 0.9125 + TINY, 0.0).1);
        // It never moved.
        let mut one = unread(sign);
        one.heard(0.0, 0.16);
        assert!(!one.step(0.02, 0.18, 0.8, 0.0).1);
    }
}

#[test]
fn two_readings_of_one_moment_tell_no_speed() {
    let mut one = One::new(1.0);
    one.heard(0.3, 0.0);
    // Supposed at 0.3 rad and at rest: 0.65 rad is the furthest.
    assert!(one.step(0.01, 0.01, 0.65 - TINY, 0.0).1);
    let mut one = One::new(1.0);
    one.heard(0.3, 0.0);
    assert!(!one.step(0.01, 0.01, 0.65 + TINY, 0.0).1);
}

#[test]
fn a_goal_that_is_held_brakes_at_1_8_times_the_acceleration_limit() {
    for sign in [1.0, -1.0] {
        let mut one = One::new(sign);
        assert!(one.step(0.01, 0.01, 0.03, 3.0).1);
        one.heard(0.0, 0.01);
        // 0.06 + 0.25 rad are free, 0.11 + 0.25 are not: braked from 3 rad/s at 18 rad/s² for 10 ms.
        assert!(one.step(0.01, 0.02, 0.06, 3.0).1);
        one.heard(0.0, 0.02);
        let (goal, free) = one.step(0.01, 0.03, 0.11, 3.0);
        assert!(!free && one.leash.is_held(1) && one.leash.holds());
        assert!((goal.velocity_rad_s - 2.82).abs() < TINY, "{goal:?}");
        assert!((goal.position_rad - (0.06 + 0.03 - 0.0009)).abs() < TINY, "{goal:?}");
        assert!((goal.acceleration_rad_s2 + 18.0).abs() < 1e-6, "{goal:?}");
        assert_eq!(one.leash.forced().next(), None);
    }
}

#[test]
fn a_goal_that_cannot_brake_in_time_stops_on_the_bound_at_once() {
    for sign in [1.0, -1.0] {
        let mut one = One::new(sign);
        // The joint follows up to 5 rad/s, from which no goal can brake within the bound.
        assert!(one.step(0.02, 0.02, 0.06, 3.0).1);
        one.heard(0.06, 0.02);
        assert!(one.step(0.02, 0.04, 0.12, 4.0).1);
        one.heard(0.12, 0.04);
        let (mut last, free) = one.step(0.02, 0.06, 0.2, 5.0);
        assert!(free);
        // Now it creeps on at 0.5 rad/s only, 0.005 rad in the 10 ms from its reading to the goal.
        let mut forced = None;
        for k in 0..6 {
            let (now_s, joint_rad) = (0.07 + 0.02 * f64::from(k), 0.13 + 0.01 * f64::from(k));
            one.heard(joint_rad, now_s - 0.01);
            let (goal, free) = one.step(0.02, now_s, 0.3 + 0.1 * f64::from(k), 5.0);
            assert!(!free && one.leash.is_held(1));
            if one.leash.forced().next().is_some() {
                assert_eq!(one.leash.forced().next(), Some(1));
                assert!((goal.position_rad - (joint_rad + 0.355)).abs() < TINY, "{goal:?}");
                let speed_rad_s = (goal.position_rad - last.position_rad) / 0.02;
                assert!((goal.velocity_rad_s - speed_rad_s).abs() < 1e-6, "{goal:?}");
                let gained = (speed_rad_s - last.velocity_rad_s) / 0.02;
                assert!((goal.acceleration_rad_s2 - gained).abs() < 1e-4, "{goal:?}");
                forced = forced.or(Some(k));
            } else if forced.is_none() {
                let braked_rad_s = last.velocity_rad_s - 0.36;
                assert!((goal.velocity_rad_s - braked_rad_s).abs() < TINY, "{goal:?}");
            }
            last = goal;
        }
        // 0.2964, 0.3856, 0.4676 rad; then 0.5424 rad would be beyond 0.515.
        assert_eq!(forced, Some(3));
        // It stands: the goal goes no further, and is not forced any more.
        let stood_rad = last.position_rad;
        for k in 0..50 {
            let now_s = 0.2 + 0.02 * f64::from(k);
            one.heard(0.18, now_s - 0.01);
            last = one.step(0.02, now_s, 1.0 + 0.1 * f64::from(k), 5.0).0;
            assert!(last.position_rad <= stood_rad + TINY, "{last:?}");
        }
        assert!(last.velocity_rad_s.abs() < TINY, "{last:?}");
        assert_eq!(one.leash.forced().next(), None);
        assert!(!one.leash.holds(), "it rests");
        assert!(one.leash.is_held(1), "short of the motion");
    }
}

#[test]
fn a_joint_that_does_not_exist_is_neither_heard_nor_held() {
    let mut one = One::new(1.0);
    one.leash.heard(2, 0.0, at(0.03));
    assert!(!one.leash.is_held(2));
}

#[test]
fn no_time_is_no_speed() {
    let mut one = One::new(1.0);
    let (goal, free) = one.step(0.0, 0.0, 0.5, 5.0);
    assert!(!free);
    assert_eq!((goal.velocity_rad_s, goal.acceleration_rad_s2), (0.0, 0.0));
    let mut one = One::new(1.0);
    assert!(one.step(0.02, 0.02, 0.34, 0.0).1);
    one.heard(-0.5, 0.02);
    let (goal, _) = one.step(0.0, 0.02, 0.5, 5.0);
    assert_eq!((goal.velocity_rad_s, goal.acceleration_rad_s2), (0.0, 0.0));
}

#[test]
fn a_goal_keeps_to_the_limits_of_its_joint() {
    // A joint stands 0.05 rad inside its upper limit, and the motion wants it beyond.
    let of = vec![limits(5.0, 10.0)];
    let mut leash = Leash::new(&[2.95], of, BOUND_RAD, at(0.0));
    for k in 1..=100 {
        let now_s = 0.01 * f64::from(k);
        // Away first, so that it is held; then the motion goes beyond the limit.
        let mut goals = [goal(3.4, 3.0)];
        leash.advance(0.01, at(now_s), false, |_| true, &mut goals);
        assert!(goals[0].position_rad <= 3.0, "{goals:?}");
        leash.heard(0, goals[0].position_rad, at(now_s));
    }
}

#[test]
fn a_joint_that_is_pushed_away_does_not_take_its_goal_along() {
    for sign in [1.0, -1.0] {
        for pushed_rad in [-1.0, 1.0] {
            let mut one = One::new(sign);
            for k in 1..=20 {
                let now_s = 0.01 * f64::from(k);
                one.heard(pushed_rad, now_s - 0.005);
                let (goal, _) = one.step(0.01, now_s, 0.0, 0.0);
                assert_eq!(goal.position_rad, 0.0);
                assert_eq!(goal.velocity_rad_s, 0.0);
                assert_eq!(one.leash.forced().next(), None);
            }
            assert!(!one.leash.holds());
        }
    }
}

#[test]
fn a_motion_that_comes_back_to_a_joint_that_was_pushed_away_is_followed() {
    for sign in [1.0, -1.0] {
        let mut one = One::new(sign);
        one.heard(-1.0, 0.0);
        // Back towards it, at any speed; away from it, not at all; and not from further away.
        assert!(one.step(0.01, 0.01, -0.05, -5.0).1);
        assert!(one.step(0.01, 0.02, -0.05, -5.0).1, "no nearer is near enough");
        let mut away = One::new(sign);
        away.heard(-1.0, 0.0);
        assert!(!away.step(0.01, 0.01, 0.01, -5.0).1);
        let mut away = One::new(sign);
        away.heard(-1.0, 0.0);
        assert!(!away.step(0.01, 0.01, -0.01, 0.0).1);
    }
}

#[test]
fn a_goal_that_was_held_has_taken_the_motion_up_again_once_it_is_there_at_its_speed() {
    let mut one = One::new(1.0);
    assert!(!one.step(0.01, 0.01, 0.5, 0.0).1);
    // Freed at once, and the motion waits at 0.3 rad: it is met and let go.
    let mut freed = None;
    let mut last = goal(0.0, 0.0);
    for k in 2..=100 {
        let now_s = 0.01 * f64::from(k);
        one.heard(last.position_rad, now_s - 0.005);
        let (goal, free) = one.step(0.01, now_s, 0.3, 0.0);
        last = goal;
        if free {
            freed = freed.or(Some(k));
        } else {
            assert_eq!(freed, None, "let go once, it is held no more");
            let speed = goal.velocity_rad_s;
            assert_eq!(one.leash.holds(), one.leash.is_held(1) && speed != 0.0);
        }
    }
    assert!(freed.is_some_and(|k| k < 60), "0.3 rad at 10 rad/s² take 0.35 s: {freed:?}");
}

#[test]
fn a_motion_is_taken_up_while_it_moves() {
    for sign in [1.0, -1.0] {
        let mut one = One::new(sign);
        // Held by a joint that stood still for a moment; the motion goes on at 1 rad/s.
        assert!(!one.step(0.01, 0.01, 0.35, 1.0).1);
        let (mut last_rad, mut freed) = (0.0, None);
        for k in 2..=150 {
            let now_s = 0.01 * f64::from(k);
            one.heard(last_rad, now_s - 0.005);
            let (goal, free) = one.step(0.01, now_s, 0.34 + now_s, 1.0);
            last_rad = goal.position_rad;
            freed = freed.or(free.then_some(k));
            assert_eq!(free, freed.is_some(), "{k}");
        }
        assert!(freed.is_some_and(|k| k < 100), "{freed:?}");
    }
}

#[test]
fn a_goal_that_rests_on_the_bound_short_of_a_motion_that_rests_has_not_taken_it_up() {
    let mut one = One::new(1.0);
    for k in 1..=200 {
        let now_s = 0.01 * f64::from(k);
        one.heard(0.0, now_s - 0.005);
        let (goal, free) = one.step(0.01, now_s, 0.5, 0.0);
        assert!(!free && one.leash.is_held(1));
        assert!(goal.position_rad <= 0.35 + TINY, "{goal:?}");
        assert!(k < 150 || goal.velocity_rad_s == 0.0, "{goal:?}");
    }
}

#[test]
fn a_goal_that_meets_the_motion_at_another_speed_has_not_taken_it_up() {
    let mut one = One::new(1.0);
    // At 10 rad/s² for 10 ms: 0.1 rad/s and 0.0005 rad.
    let (goal, _) = one.step(0.01, 0.01, 0.5, 0.0);
    assert!((goal.position_rad - 0.0005).abs() < TINY && (goal.velocity_rad_s - 0.1).abs() < TINY);
    // The motion rushes by, just where the goal comes to rest.
    let (goal, _) = one.step(0.01, 0.02, 0.001, -3.0);
    assert!((goal.position_rad - 0.001).abs() < TINY && goal.velocity_rad_s.abs() < TINY);
    assert!(one.leash.is_held(1));
}

#[test]
fn a_stop_lets_a_held_goal_brake_and_never_chase() {
    let mut one = One::new(1.0);
    for k in 1..=6 {
        let now_s = 0.01 * f64::from(k);
        one.heard(0.0, now_s - 0.005);
        one.step(0.01, now_s, 0.04 * f64::from(k), 4.0);
    }
    assert!(one.leash.is_held(1) && one.leash.holds());
    let (mut last, _) = one.step(0.01, 0.07, 0.28, 4.0);
    assert!(last.velocity_rad_s > 0.0);
    for k in 8..=60 {
        let now_s = 0.01 * f64::from(k);
        // The joint is free again and the motion far ahead: it is not run after.
        one.heard(last.position_rad, now_s - 0.005);
        let (goal, free) = one.advance(0.01, now_s, 1.0, 0.0, true);
        assert!(!free && one.leash.is_held(1));
        let braked_rad_s = (last.velocity_rad_s - 0.18).max(0.0);
        assert!((goal.velocity_rad_s - braked_rad_s).abs() < 1e-6, "{k}: {goal:?}");
        last = goal;
    }
    assert_eq!(last.velocity_rad_s, 0.0);
    assert!(!one.leash.holds(), "at rest");
    // Not even where the motion happens to be.
    let (goal, _) = one.advance(0.01, 0.61, last.position_rad, 0.0, true);
    assert_eq!((goal.position_rad, one.leash.is_held(1)), (last.position_rad, true));
}

#[test]
fn a_stop_leaves_a_joint_that_follows_on_its_path() {
    let mut one = One::new(1.0);
    for k in 1..=100 {
        let now_s = 0.01 * f64::from(k);
        one.heard(0.02 * f64::from(k - 1), now_s - 0.005);
        assert!(one.advance(0.01, now_s, 0.02 * f64::from(k), 2.0, true).1, "{k}");
    }
}

/// A motion with rests, as sines: where it is and how fast, at a time.
#[derive(Clone, Debug)]
struct Path {
    /// Amplitude, rad, and angular frequency, rad/s.
    waves: Vec<(f64, f64)>,
    /// When it comes to rest.
    ends_s: f64,
}

impl Path {
    fn sample(&self, t_s: f64) -> Setpoint {
        let mut sum = Setpoint::default();
        let (rests, t_s) = (t_s >= self.ends_s, t_s.min(self.ends_s));
        for &(amplitude_rad, w) in &self.waves {
            // From rest at 0: 1 - cos.
            sum.position_rad += amplitude_rad * (1.0 - (w * t_s).cos());
            sum.velocity_rad_s += amplitude_rad * w * (w * t_s).sin();
            sum.acceleration_rad_s2 += amplitude_rad * w * w * (w * t_s).cos();
        }
        if rests { goal(sum.position_rad, 0.0) } else { sum }
    }

    /// The most its speed (1) or acceleration (2) can be.
    fn peak(&self, derivative: i32) -> f64 {
        self.waves.iter().map(|(a, w)| a.abs() * w.powi(derivative)).sum()
    }

    /// The least limits it keeps.
    fn limits(&self) -> JointLimits {
        limits(self.peak(1) * 1.000_001, self.peak(2) * 1.000_001)
    }
}

fn path() -> impl Strategy<Value = Path> {
    let wave = (-0.5..0.5_f64, 0.5..8.0_f64);
    prop::collection::vec(wave, 1..4)
        .prop_map(|waves| Path { waves, ends_s: f64::INFINITY })
        .prop_filter("it moves", |path| path.peak(1) > 0.05)
}

/// One wave that comes to rest on either end of it, not before ten seconds are over.
fn path_to_rest() -> impl Strategy<Value = Path> {
    let wave = (0.1..1.0_f64, 0.5..8.0_f64, any::<bool>(), any::<bool>());
    wave.prop_map(|(amplitude_rad, w, far, upwards)| {
        let halves = 2.0 * (10.0 * w / std::f64::consts::TAU).ceil() + f64::from(u8::from(far));
        let ends_s = halves * std::f64::consts::PI / w;
        Path { waves: vec![(if upwards { amplitude_rad } else { -amplitude_rad }, w)], ends_s }
    })
}

/// A joint on its leash, cycle by cycle.
struct Rig {
    leash: Leash,
    limits: JointLimits,
    path: Path,
    period_s: f64,
    /// From the reading to the goal.
    delay_s: f64,
    joint_rad: f64,
    goal: Setpoint,
    cycle: u32,
    read_at_s: f64,
    goal_when_read_rad: f64,
}

/// What one cycle of a [`Rig`] came to.
struct Step {
    goal: Setpoint,
    wanted: Setpoint,
    before: Setpoint,
    forced: bool,
    held: bool,
}

impl Rig {
    fn new(path: Path, rate_hz: f64, delay: f64) -> Self {
        let limits = path.limits();
        Self {
            leash: Leash::new(&[0.0], vec![limits], BOUND_RAD, at(0.0)),
            limits,
            path,
            period_s: 1.0 / rate_hz,
            delay_s: delay / rate_hz,
            joint_rad: 0.0,
            goal: Setpoint::default(),
            cycle: 0,
            read_at_s: 0.0,
            goal_when_read_rad: 0.0,
        }
    }

    /// The joint goes as fast as it may to where `reach` lets it, is read unless `missed`, and gets a
    /// goal.
    fn step(&mut self, reach: impl Fn(f64) -> f64, missed: bool, stopping: bool) -> Step {
        self.cycle += 1;
        let now_s = f64::from(self.cycle) * self.period_s;
        self.joint_rad = reach(self.goal.position_rad);
        if !missed {
            self.leash.heard(0, self.joint_rad, at(now_s));
            (self.read_at_s, self.goal_when_read_rad) = (now_s, self.goal.position_rad);
        }
        let wanted = self.path.sample(now_s + self.delay_s);
        let mut goals = [wanted];
        let now = at(now_s + self.delay_s);
        self.leash.advance(self.period_s, now, stopping, |_| true, &mut goals);
        let before = std::mem::replace(&mut self.goal, goals[0]);
        let forced = self.leash.forced().next().is_some();
        Step { goal: goals[0], wanted, before, forced, held: self.leash.is_held(0) }
    }
}

/// Cycles whose readings are lost: never more than four in a row.
fn lost() -> impl Strategy<Value = Vec<bool>> {
    let run = (1_usize..12, 0_usize..=4);
    prop::collection::vec(run, 40..60).prop_map(|runs| {
        let runs = runs.into_iter();
        runs.flat_map(|(heard, lost)| [vec![false; heard], vec![true; lost]].concat()).collect()
    })
}

proptest! {
    #[test]
    fn a_joint_that_follows_gets_the_motion_bit_for_bit(
        path in path(), rate_hz in 20.0..200.0_f64, delay in 0.0..0.8_f64, lost in lost(),
    ) {
        let mut rig = Rig::new(path, rate_hz, delay);
        // However fast: what a goal gains in a cycle must fit into the bound besides its braking.
        let limits = rig.limits;
        let gains_rad = limits.velocity_rad_s() * rig.period_s * 1.8;
        let gained_rad_s = limits.acceleration_rad_s2() * rig.period_s * 6.0;
        let brakes_rad = gained_rad_s.powi(2) / (2.0 * 1.8 * limits.acceleration_rad_s2());
        prop_assume!(gains_rad + brakes_rad < BOUND_RAD);
        for missed in lost {
            let step = rig.step(|goal_rad| goal_rad, missed, false);
            prop_assert_eq!(step.goal, step.wanted);
            prop_assert!(!step.held && !step.forced);
        }
    }

    #[test]
    fn the_goal_of_a_blocked_joint_comes_to_rest_near_it_and_takes_the_motion_up_when_it_is_freed(
        path in path_to_rest(), rate_hz in 20.0..200.0_f64, delay in 0.0..0.8_f64, lost in lost(),
        blocked_at in 0.05..0.6_f64, upwards: bool,
    ) {
        let mut rig = Rig::new(path, rate_hz, delay);
        let (v, a) = (rig.limits.velocity_rad_s(), rig.limits.acceleration_rad_s2());
        let wall = |goal_rad: f64| match upwards {
            true => goal_rad.min(blocked_at),
            false => goal_rad.max(-blocked_at),
        };
        let mut longest_age_s = 0.0_f64;
        for missed in lost {
            let step = rig.step(wall, missed, false);
            let now_s = f64::from(rig.cycle) * rig.period_s + rig.delay_s;
            longest_age_s = longest_age_s.max(now_s - rig.read_at_s);
            // What it was supposed to move by since it was read, and its goal meanwhile.
            let off_rad = (step.goal.position_rad - rig.joint_rad).abs();
            let supposed_rad = 2.0 * v * longest_age_s;
            prop_assert!(off_rad <= BOUND_RAD + supposed_rad + TINY, "{off_rad} rad away");
            if !step.forced {
                let gained_rad_s = (step.goal.velocity_rad_s - step.before.velocity_rad_s).abs();
                prop_assert!(gained_rad_s <= 2.0 * a * rig.period_s + 1e-5, "{gained_rad_s}");
            }
            prop_assert!(step.goal.velocity_rad_s.abs() <= v * (1.0 + 1e-6) || step.forced);
        }
        // Freed: it goes to its goal, and the goal after the motion, within its limits.
        let mut met = false;
        let reach_rad = v * rig.period_s;
        let blocked_s = f64::from(rig.cycle) * rig.period_s;
        let takes_s = rig.path.ends_s.max(blocked_s) + 4.0 * BOUND_RAD / v + 8.0 * v / a + 1.0;
        while f64::from(rig.cycle) * rig.period_s < takes_s {
            let joint_rad = rig.joint_rad;
            let free = |goal_rad: f64| goal_rad.clamp(joint_rad - reach_rad, joint_rad + reach_rad);
            let step = rig.step(free, false, false);
            let gained_rad_s = (step.goal.velocity_rad_s - step.before.velocity_rad_s).abs();
            let gentle = gained_rad_s <= 2.0 * a * rig.period_s + 1e-5;
            prop_assert!(gentle || step.forced, "{gained_rad_s}");
            prop_assert!(step.goal.velocity_rad_s.abs() <= v * (1.0 + 1e-6));
            if met {
                prop_assert_eq!(step.goal, step.wanted);
            }
            met |= !step.held;
        }
        prop_assert!(met, "the motion is not taken up: {:?} for {:?}", rig.goal, rig.path.sample(1e9));
    }

    #[test]
    fn a_blocked_joints_goal_comes_to_rest_and_stays(
        speed_rad_s in 0.1..5.0_f64, rate_hz in 20.0..200.0_f64, delay in 0.0..0.8_f64,
        wall_rad in 0.0..0.5_f64, mirror: bool,
    ) {
        let sign = if mirror { -1.0 } else { 1.0 };
        let mut one = One::new(sign);
        let (period_s, mut goal_rad, mut rested) = (1.0 / rate_hz, 0.0_f64, 0);
        for k in 1..=(3.0 * rate_hz) as u32 {
            let now_s = f64::from(k) * period_s;
            one.heard(goal_rad.min(wall_rad), now_s);
            // From rest to that speed at 10 rad/s², up to 2.9 rad.
            let ramp_s = now_s.min(speed_rad_s / 10.0);
            let wanted_rad = 5.0 * ramp_s * ramp_s + (now_s - ramp_s) * speed_rad_s;
            let (wanted_rad, speed) = match wanted_rad < 2.9 {
                true => (wanted_rad, ramp_s * 10.0),
                false => (2.9, 0.0),
            };
            let (goal, _) = one.step(period_s, now_s + delay * period_s, wanted_rad, speed);
            goal_rad = goal.position_rad;
            rested = if goal.velocity_rad_s == 0.0 { rested + 1 } else { 0 };
        }
        // Where the motion got far enough to leave it behind.
        if speed_rad_s * 2.5 > wall_rad + BOUND_RAD + 0.3 {
            prop_assert!(rested > 10, "it creeps");
            prop_assert!(goal_rad <= wall_rad + BOUND_RAD + 5.0 * period_s, "{goal_rad}");
            prop_assert!(goal_rad >= wall_rad + 0.2, "it pulls as hard as it may: {goal_rad}");
        }
    }
}
