//! A base that tilts, as formulas have it, and what an OP3's joints do about it.

use super::*;

const PERIOD_S: f64 = 0.01;
const ROOM_RAD: f64 = 1.0;

fn op3() -> Robot {
    Robot::load("op3").expect("a robot")
}

fn balancer(robot: &Robot) -> Balancer {
    Balancer::new(robot, PERIOD_S, |_| ROOM_RAD).expect("a robot that balances")
}

fn standing(robot: &Robot) -> Vec<f64> {
    robot.joints.iter().map(|joint| joint.initial_rad).collect()
}

fn setpoints(pose: &[f64]) -> Vec<Setpoint> {
    let at = |position_rad: &f64| Setpoint { position_rad: *position_rad, ..Setpoint::default() };
    pose.iter().map(at).collect()
}

/// A base that stands still, tilted by so much to the right and ahead, one of them zero: what it feels of gravity.
fn tilted(roll_rad: f64, pitch_rad: f64) -> Inertial {
    let up = DVec3::new(-pitch_rad.sin(), roll_rad.sin(), roll_rad.cos() * pitch_rad.cos());
    Inertial { rate_rad_s: DVec3::ZERO, acceleration_m_s2: up * STANDARD_GRAVITY_M_S2 }
}

/// Feels the same for so many seconds; by how much each joint is elsewhere than the motion wants then, and the fastest and the
/// hardest that any goal went on the way.
fn answered(
    balancer: &mut Balancer,
    felt: &Inertial,
    pose: &[f64],
    seconds: f64,
) -> (Vec<f64>, f64, f64) {
    let (mut before, mut speed_before) = (None::<Vec<f64>>, vec![0.0; pose.len()]);
    let (mut fastest, mut hardest) = (0.0_f64, 0.0_f64);
    let mut added = vec![0.0; pose.len()];
    for _ in 0..(seconds / PERIOD_S).round() as usize {
        balancer.feel(Some(felt));
        let mut goals = setpoints(pose);
        balancer.answer(PERIOD_S, false, &mut goals);
        let now: Vec<f64> = goals.iter().map(|goal| goal.position_rad).collect();
        if let Some(before) = &before {
            for ((now, before), speed_before) in now.iter().zip(before).zip(&mut speed_before) {
                let speed = (now - before) / PERIOD_S;
                fastest = fastest.max(speed.abs());
                hardest = hardest.max((speed - *speed_before).abs() / PERIOD_S);
                *speed_before = speed;
            }
        }
        added = now.iter().zip(pose).map(|(now, pose)| now - pose).collect();
        before = Some(now);
    }
    (added, fastest, hardest)
}

fn joint(robot: &Robot, name: &str) -> usize {
    robot.joints.iter().position(|joint| joint.name == name).expect("a joint")
}

fn file(robot: &Robot) -> &profiles::BodyBalance {
    balance_of(robot).expect("a balance")
}

#[test]
fn a_base_that_leans_ahead_is_brought_back_by_the_ankles_and_one_that_leans_aside_as_well() {
    let robot = op3();
    let pose = standing(&robot);
    let body = RobotBody::of(&robot.file).expect("sound").expect("a body");
    for (felt, axis) in [(tilted(0.0, 0.1), 1), (tilted(0.1, 0.0), 0)] {
        let (added, ..) = answered(&mut balancer(&robot), &felt, &pose, 10.0);
        let moved: Vec<f64> = pose.iter().zip(&added).map(|(pose, added)| pose + added).collect();
        // Where the base would stand on flat soles with these joints: the other way round from where it leans.
        let up = body.up(&moved).expect("soles");
        let leans = up.cross(DVec3::Z).to_array();
        assert!(leans[axis] < -0.01, "{axis}: {leans:?}");
        // The file rounds the angles in which it stands.
        assert!(leans[1 - axis].abs() < 1e-4, "{leans:?}");
        let answers = |name: &str| file(&robot).joints.iter().any(|of| of.joint == name);
        for (of, added) in robot.joints.iter().zip(&added) {
            assert!(*added == 0.0 || answers(&of.name), "{}: {added}", of.name);
        }
    }
}

#[test]
fn a_tilt_that_lasts_is_answered_by_its_gain_and_no_further_than_the_file_allows() {
    let robot = op3();
    let pose = standing(&robot);
    let gains =
        file(&robot).joints.iter().find(|of| of.joint == "r_ank_pitch").expect("it answers");
    let at = joint(&robot, "r_ank_pitch");
    let (small, ..) = answered(&mut balancer(&robot), &tilted(0.0, 0.1), &pose, 20.0);
    assert!((small[at] - gains.pitch * 0.1_f64.sin()).abs() < 1e-3, "{}", small[at]);
    let (great, fastest, hardest) = answered(&mut balancer(&robot), &tilted(0.0, 1.0), &pose, 20.0);
    let most_rad = file(&robot).most_rad;
    assert!(
        (great[at].abs() - most_rad).abs() < 1e-6 || great[at].abs() < most_rad,
        "{}",
        great[at]
    );
    let (share, limits) = (file(&robot).limit_share, robot.joints[at].limits);
    assert!(fastest <= share * limits.velocity_rad_s() * 1.001, "{fastest}");
    // From one mean speed to the next it may brake and speed up again.
    assert!(hardest <= 2.0 * share * limits.acceleration_rad_s2() * 1.001, "{hardest}");
}

#[test]
fn a_base_that_leans_as_its_legs_have_it_is_left_alone() {
    let robot = op3();
    let mut pose = standing(&robot);
    // Both legs swing back against the trunk by 0.2 rad: on flat soles the trunk leans ahead by as much.
    pose[joint(&robot, "r_hip_pitch")] += 0.2;
    pose[joint(&robot, "l_hip_pitch")] -= 0.2;
    let (added, ..) = answered(&mut balancer(&robot), &tilted(0.0, 0.2), &pose, 10.0);
    assert!(added.iter().all(|added| added.abs() < 1e-4), "{added:?}");
    // The other way it would not be.
    let (added, ..) = answered(&mut balancer(&robot), &tilted(0.0, -0.2), &pose, 10.0);
    assert!(added.iter().any(|added| added.abs() > 0.01), "{added:?}");
}

#[test]
fn a_base_that_turns_is_braked_by_the_rate_alone_before_it_is_tilted() {
    let robot = op3();
    let pose = standing(&robot);
    let mut balancer = balancer(&robot);
    answered(&mut balancer, &tilted(0.0, 0.0), &pose, 1.0);
    let turning = Inertial { rate_rad_s: DVec3::Y * 0.5, ..tilted(0.0, 0.0) };
    let (added, ..) = answered(&mut balancer, &turning, &pose, 0.03);
    let at = joint(&robot, "r_ank_pitch");
    assert!(added[at] > 1e-3, "{}", added[at]);
    assert!((added[at] + added[joint(&robot, "l_ank_pitch")]).abs() < 1e-12, "both alike");
}

#[test]
fn when_the_motion_is_over_the_answer_goes_back_to_nothing_in_the_time_it_says() {
    let robot = op3();
    let pose = standing(&robot);
    let mut balancer = balancer(&robot);
    answered(&mut balancer, &tilted(0.0, 0.8), &pose, 20.0);
    assert!(!balancer.is_at_rest());
    let most_s = balancer.longest_way_back_s();
    let mut took_s = 0.0;
    while !balancer.is_at_rest() {
        balancer.answer(PERIOD_S, true, &mut setpoints(&pose));
        took_s += PERIOD_S;
        assert!(took_s <= most_s + 2.0 * PERIOD_S, "{took_s} of {most_s} s");
    }
}

#[test]
fn a_tilt_of_more_than_60_deg_is_a_fall_and_five_silent_cycles_are_blindness() {
    let robot = op3();
    let pose = standing(&robot);
    let mut fallen = balancer(&robot);
    answered(&mut fallen, &tilted(0.0, 59_f64.to_radians()), &pose, 3.0);
    assert_eq!(fallen.verdict(), None);
    answered(&mut fallen, &tilted(0.0, 62_f64.to_radians()), &pose, 60.0);
    assert!(matches!(fallen.verdict(), Some(StopReason::Fell { .. })), "{:?}", fallen.verdict());
    let mut blind = balancer(&robot);
    for _ in 0..4 {
        blind.feel(None);
        assert_eq!(blind.verdict(), None);
    }
    blind.feel(None);
    assert_eq!(blind.verdict(), Some(StopReason::FeelsNothing { cycles: 5 }));
    blind.feel(Some(&tilted(0.0, 0.0)));
    assert_eq!(blind.verdict(), None, "it feels again");
    assert_eq!((blind.figures().felt_cycles, blind.figures().missed_cycles), (1, 5));
}

#[test]
fn a_joint_goes_no_further_than_the_motion_leaves_room() {
    let robot = op3();
    let pose = standing(&robot);
    let tight = joint(&robot, "r_ank_pitch");
    let room = |of: usize| if of == tight { 0.01 } else { ROOM_RAD };
    let mut balancer = Balancer::new(&robot, PERIOD_S, room).expect("a robot that balances");
    let (added, ..) = answered(&mut balancer, &tilted(0.0, 0.8), &pose, 20.0);
    assert!((added[tight] - 0.01).abs() < 1e-9, "{}", added[tight]);
    assert!(added[joint(&robot, "l_ank_pitch")] < -0.02, "the other goes on");
    let none = |of: usize| if of == tight { -0.001 } else { ROOM_RAD };
    let mut balancer = Balancer::new(&robot, PERIOD_S, none).expect("a robot that balances");
    assert_eq!(answered(&mut balancer, &tilted(0.0, 0.8), &pose, 1.0).0[tight], 0.0);
}

#[test]
fn a_robot_that_moves_or_feels_otherwise_than_its_legs_stand_is_refused_before_it_moves() {
    let robot = op3();
    let (balancer, pose) = (balancer(&robot), standing(&robot));
    balancer.look(&tilted(0.0, 0.1), &pose).expect("it stands");
    let said = balancer.look(&tilted(0.0, 0.5), &pose).expect_err("it leans").to_string();
    assert!(said.contains("29 deg"), "{said}");
    let upside_down = Inertial { acceleration_m_s2: DVec3::NEG_Z * 9.8, ..tilted(0.0, 0.0) };
    assert!(balancer.look(&upside_down, &pose).is_err());
    let turning = Inertial { rate_rad_s: DVec3::X, ..tilted(0.0, 0.0) };
    assert!(balancer.look(&turning, &pose).is_err());
    let falling = Inertial { acceleration_m_s2: DVec3::Z * 2.0, ..tilted(0.0, 0.0) };
    assert!(balancer.look(&falling, &pose).is_err());
}

#[test]
fn a_motion_is_laid_within_what_balance_leaves() {
    let robot = op3();
    let left = leaves(&robot).expect("it balances");
    let share = file(&robot).limit_share;
    for (whole, left) in robot.joints.iter().zip(&left.joints) {
        let answers = file(&robot).joints.iter().any(|of| of.joint == whole.name);
        let part = if answers { 1.0 - share } else { 1.0 };
        let is = left.limits.velocity_rad_s() / whole.limits.velocity_rad_s();
        assert!((is - part).abs() < 1e-9, "{}: {is}", whole.name);
        let is = left.limits.acceleration_rad_s2() / whole.limits.acceleration_rad_s2();
        assert!((is - part).abs() < 1e-9, "{}: {is}", whole.name);
    }
    let other = leaves(&Robot::load("toddlerbot").expect("a robot")).expect_err("no sensor");
    assert!(other.to_string().contains("[body.balance]"), "{other}");
}

#[test]
fn where_nobody_knows_the_motion_a_joint_that_answers_keeps_room_for_it_at_both_ends() {
    let robot = op3();
    let (near, other) = (joint(&robot, "l_ank_roll"), joint(&robot, "r_ank_roll"));
    // One stands close to the upper end of its range.
    let mut start_rad = standing(&robot);
    start_rad[near] = robot.joints[near].limits.upper_rad() - 0.02;
    let (left, rooms_rad) = leaves_room(&robot, &start_rad).expect("it balances");
    let is_about = |joint: usize, room_rad: f64| {
        let off_rad = rooms_rad[joint] - room_rad;
        assert!(off_rad.abs() < 0.002, "{}: {}", robot.joints[joint].name, rooms_rad[joint]);
    };
    is_about(near, 0.02 - ROUNDING_RAD);
    is_about(other, file(&robot).most_rad);
    assert_eq!(rooms_rad[joint(&robot, "head_pan")], 0.0, "who does not answer keeps none");
    let starts = start_rad.iter().zip(&left.joints);
    for ((start_rad, left), whole) in starts.zip(&robot.joints) {
        let answers = file(&robot).joints.iter().any(|of| of.joint == left.name);
        let range = left.limits.lower_rad()..=left.limits.upper_rad();
        assert!(!answers || range.contains(start_rad), "{}: {range:?}", left.name);
        assert!(range.end() <= &whole.limits.upper_rad(), "{}", left.name);
    }
    // Wherever the motion is inside what is left, both together stay inside the range.
    let mut balancer = Balancer::new(&robot, PERIOD_S, |joint| rooms_rad[joint]).expect("balances");
    let at_its_end: Vec<f64> = left.joints.iter().map(|joint| joint.limits.upper_rad()).collect();
    for felt in [tilted(0.8, 0.0), tilted(-0.8, 0.0)] {
        let (added, ..) = answered(&mut balancer, &felt, &at_its_end, 10.0);
        for ((joint, at_rad), added) in robot.joints.iter().zip(&at_its_end).zip(&added) {
            assert!(at_rad + added <= joint.limits.upper_rad() + 1e-9, "{}", joint.name);
        }
    }
}
