//! Goals whose times are known within bounds only.

use super::*;

const MS: u64 = 1_000_000;
/// 4.796 rad/s in 10 ms are 31.27 counts of 4096 to a turn.
const STEP: i64 = 31;

/// A joint of 4.796 rad/s and 23.981 rad/s2 under torque at 2048 counts at time zero.
fn referee() -> Referee {
    let mut robot = gaitway_profiles::robot("op3").expect("shipped");
    let joint = &mut robot.joints[0];
    (joint.lower_rad, joint.upper_rad) = (-1.5, 1.5);
    let mut referee = Referee::new(1, false);
    referee.add(joint, 0, gaitway_profiles::servo("xm430-w350").expect("shipped"));
    let on = Event::TorqueOn { goal: 2048, present: 2048, error_rad: 0.0 };
    referee.event(0, When::at(0), on);
    referee
}

/// Goals away from 2048, each written between two times, ms: how often each rule was broken.
fn broken(goals: &[(u64, u64, i64)], rules: [Rule; 2]) -> [u64; 2] {
    let mut referee = referee();
    for &(earliest_ms, latest_ms, away) in goals {
        let when = When { earliest_ns: earliest_ms * MS, latest_ns: latest_ms * MS };
        referee.instruction(0, when);
        let raw = 2048 + away;
        // Never where the joint stands.
        let event = Event::Goal { raw, accepted: true, off_rad: 1.0, speed_rad_s: 1.0 };
        referee.event(0, when, event);
    }
    let verdict = referee.verdict(0);
    rules.map(|rule| verdict.count(rule))
}

fn steps(goals: &[(u64, u64, i64)]) -> u64 {
    broken(goals, [Rule::GoalStep, Rule::SpeedChange])[0]
}

#[test]
fn a_step_is_too_far_only_if_it_is_for_all_times_the_goals_can_have_had() {
    // Read together after 10 ms: they may have been written 10 ms apart, or at once.
    assert_eq!(steps(&[(0, 10, 0), (0, 10, STEP)]), 0);
    assert_eq!(steps(&[(0, 10, 0), (0, 10, STEP + 2)]), 1);
    // At known times it is the same as ever.
    assert_eq!(steps(&[(10, 10, 0), (20, 20, STEP + 1)]), 0);
    assert_eq!(steps(&[(10, 10, 0), (20, 20, STEP + 2)]), 1);
}

#[test]
fn times_that_make_one_step_legal_are_not_given_to_another_as_well() {
    // Three goals within 10 ms: each step alone may have had them, both together not.
    assert_eq!(steps(&[(0, 10, 0), (0, 10, STEP), (0, 10, 2 * STEP + 2)]), 1);
    assert_eq!(steps(&[(0, 20, 0), (0, 20, STEP), (0, 20, 2 * STEP + 2)]), 0);
    // A door that looked once in 10 ms: a steady motion at full speed, for as long as one likes.
    let full: Vec<_> = (1..100).map(|k| (10 * k, 10 * k + 10, STEP * k as i64)).collect();
    assert_eq!(steps(&full), 0);
    // A tenth more speed is found out once the first 10 ms, and a count for each step, are used up.
    let faster: Vec<_> = (1..100).map(|k| (10 * k, 10 * k + 10, 36 * k as i64)).collect();
    assert!(steps(&faster) > 0);
}

#[test]
fn a_jump_of_2_3_rad_is_one_whatever_the_door_did_within_a_quarter_of_a_second() {
    let jump = 1_499;
    assert_eq!(steps(&[(0, 10, 0), (10, 20, jump)]), 1);
    assert_eq!(steps(&[(0, 10, 0), (10, 250, jump)]), 1);
    assert_eq!(steps(&[(0, 10, 0), (10, 600, jump)]), 0, "nobody can know");
}

#[test]
fn a_pause_is_one_only_if_it_is_for_all_times() {
    // 200 ms of silence for sure, of which 100 count; or perhaps none at all.
    assert_eq!(steps(&[(0, 10, 0), (210, 210, 9 * STEP)]), 0);
    assert_eq!(steps(&[(0, 10, 0), (210, 210, 12 * STEP)]), 1);
    assert_eq!(steps(&[(0, 10, 0), (10, 210, 12 * STEP)]), 0);
}

#[test]
fn a_change_of_speed_is_too_great_only_if_it_is_for_all_times() {
    let changes = |goals: &[(u64, u64, i64)]| {
        let mut goals = goals.to_vec();
        // At rest at the end.
        let (_, last_ms, away) = goals[goals.len() - 1];
        goals.extend([(last_ms + 500, last_ms + 500, away); 2]);
        broken(&goals, [Rule::GoalStep, Rule::SpeedChange])[1]
    };
    // 30 counts in 10 ms, 4.6 rad/s, after rest: 47.96 rad/s2 want 96 ms for it.
    let sharp = [(10, 10, 0), (20, 20, 0), (30, 30, 30), (130, 130, 30)];
    assert_eq!(changes(&sharp), 2);
    // The same goals by a door that was asleep until 130 ms.
    assert_eq!(changes(&[(10, 10, 0), (10, 130, 0), (10, 130, 30), (10, 130, 30)]), 0);
    // By one that looked just after each.
    assert_eq!(changes(&[(9, 10, 0), (19, 20, 0), (29, 30, 30), (129, 130, 30)]), 2);
}
