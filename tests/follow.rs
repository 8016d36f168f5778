//! Goals that a program of the user's own makes: what becomes of a function that is slow, breaks or
//! ends. In virtual time each cycle waits for it, so what is seen here can be repeated.

use gaitway::control::StopCode;
use gaitway::{FollowOptions, LiveReport, Moment, Outcome};

fn followed(source: impl FnMut(&Moment) -> Option<Vec<f64>> + Send + 'static) -> LiveReport {
    let mut rig = gaitway::open("op3", "sim").expect("a virtual robot");
    rig.follow(source, FollowOptions::default()).expect("followed")
}

fn without_a_fault(report: &LiveReport) {
    let referee = report.run.referee.as_ref().expect("a virtual robot has one");
    assert_eq!(referee.violations, Vec::<String>::new());
    assert!(report.run.exceptions.is_empty(), "{:?}", report.run.exceptions);
    assert!(report.run.left.as_ref().is_some_and(|left| left.holding.len() == 20));
}

/// Makes goals wrong.
type Spoil = fn(&mut Vec<f64>);

/// All joints stay where they were found, but one that swings, from rest.
fn swing(joint: usize, until_s: f64) -> impl FnMut(&Moment) -> Option<Vec<f64>> + Send + 'static {
    let mut start_rad = None;
    move |now| {
        let mut goals: Vec<f64> = start_rad.get_or_insert_with(|| now.goal_rad.clone()).clone();
        goals[joint] += 0.15 * (1.0 - (4.0 * now.time_s).cos());
        (now.time_s < until_s).then_some(goals)
    }
}

#[test]
fn the_newest_goal_is_followed_and_the_end_is_at_rest() {
    let report = followed(swing(19, 3.0));
    assert_eq!(report.run.outcome, Outcome::Done, "{:?}", report.run.stop_reason);
    without_a_fault(&report);
    let joint = &report.run.joints[19];
    let [low, high] = joint.range_rad.expect("measured");
    assert!((0.27..0.33).contains(&(high - low)), "{low} to {high}: 0.3 rad were asked for");
    let peak_rad_s = joint.peak_velocity_rad_s;
    assert!((0.58..0.7).contains(&peak_rad_s), "{peak_rad_s}: 0.6 rad/s were asked for");
    assert!((2.9..3.2).contains(&report.following_s), "{}", report.following_s);
    for other in &report.run.joints[..19] {
        assert!(other.peak_velocity_rad_s < 0.01, "{} stays where it is", other.name);
    }
}

#[test]
fn two_runs_in_virtual_time_are_one() {
    let [first, second] = [0, 1].map(|_| serde_json::to_value(followed(swing(3, 1.0))).unwrap());
    // How old poses were is a matter of virtual time too.
    assert_eq!(first, second);
}

#[test]
fn a_panic_of_the_function_is_a_ramp_to_rest_and_a_reason() {
    let mut swing = swing(19, 9.0);
    let report = followed(move |now| {
        assert!(now.time_s < 1.1, "out of ideas");
        swing(now)
    });
    assert_eq!(report.run.outcome, Outcome::Stopped);
    assert_eq!(report.run.stop.as_ref().map(|stop| stop.code), Some(StopCode::SourceBroke));
    let reason = report.run.stop_reason.as_deref().unwrap_or_default();
    assert!(reason.contains("out of ideas"), "{reason}");
    assert!((1.0..1.3).contains(&report.following_s), "{}", report.following_s);
    without_a_fault(&report);
}

#[test]
fn goals_that_are_none_stop_the_robot_and_are_named() {
    let wrong: [(Spoil, &str); 2] = [
        (|goals| goals.truncate(3), "3 goals for 20 joints"),
        (|goals| goals[7] = f64::NAN, "no number"),
    ];
    for (spoil, said) in wrong {
        let mut swing = swing(19, 9.0);
        let report = followed(move |now| {
            let mut goals = swing(now)?;
            if now.time_s > 0.5 {
                spoil(&mut goals);
            }
            Some(goals)
        });
        assert_eq!(report.run.stop.as_ref().map(|stop| stop.code), Some(StopCode::SourceBroke));
        let reason = report.run.stop_reason.as_deref().unwrap_or_default();
        assert!(reason.contains(said), "{reason}");
        without_a_fault(&report);
    }
}

#[test]
fn a_goal_beyond_a_limit_is_followed_as_far_as_the_limit_and_counted() {
    let report = followed(|now| {
        let mut goals = now.goal_rad.clone();
        goals[19] = if now.time_s > 0.1 { 9.0 } else { goals[19] };
        (now.time_s < 4.0).then_some(goals)
    });
    assert_eq!(report.run.outcome, Outcome::Done, "{:?}", report.run.stop_reason);
    without_a_fault(&report);
    assert!(report.limited_samples > 0);
}

/// On a real robot nobody waits: behind a terminal the same function, made slow, is not in the way.
#[test]
fn a_function_that_stands_still_lets_the_robot_come_to_rest_and_keeps_nobody() {
    let mut rig = gaitway::open("op3", "sim:pty").expect("a virtual robot");
    let mut swing = swing(19, 9.0);
    let stuck = move |now: &Moment| {
        if now.time_s > 0.6 {
            // Longer than the whole test.
            std::thread::sleep(std::time::Duration::from_secs(600));
        }
        swing(now)
    };
    let time = Some(gaitway::time::Duration::from_secs(2));
    let report = rig.follow(stuck, FollowOptions { time, ..FollowOptions::default() });
    let report = report.expect("followed");
    assert_eq!(report.run.outcome, Outcome::Done, "{:?}", report.run.stop_reason);
    assert!(report.stale_s > 0.5, "{}", report.stale_s);
    without_a_fault(&report);
}
