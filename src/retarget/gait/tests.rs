use super::*;
use crate::retarget::balance::FloorLoad;
use crate::robot::Robot;

fn op3() -> (Robot, RobotBody) {
    let robot = Robot::load("op3").expect("a robot");
    let body = RobotBody::of(&robot.file).expect("a body").expect("one");
    (robot, body)
}

fn walk(count: usize, ahead_m: f64, turn_rad: f64) -> Vec<Step> {
    let step = |at: usize| Step {
        side: at % 2,
        lifted_s: 0.6 * at as f64 + 0.1,
        planted_s: 0.6 * at as f64 + 0.5,
        ahead_m: if at + 1 == count { 0.0 } else { ahead_m },
        aside_m: 0.2,
        turn_rad,
    };
    (0..count).map(step).collect()
}

/// Poses of a robot that takes these steps at 120 Hz: the gait, where everything is.
fn walked(steps: &[Step], speed: f64) -> (RobotBody, Gait) {
    let (robot, body) = op3();
    let start_rad: Vec<f64> = robot.joints.iter().map(|joint| joint.initial_rad).collect();
    let limits_rad: Vec<(f64, f64)> =
        robot.joints.iter().map(|of| (of.limits.lower_rad(), of.limits.upper_rad())).collect();
    let count = (steps.last().map_or(0.0, |step| step.planted_s + 0.5) * 120.0) as usize;
    let angles_rad: Vec<Vec<f64>> = start_rad.iter().map(|angle| vec![*angle; count]).collect();
    let made = gait(&Walking {
        body: &body,
        start_rad: &start_rad,
        limits_rad: &limits_rad,
        angles_rad: &angles_rad,
        rate_hz: 120.0,
        steps,
        scale: 0.27,
        speed,
        slower: 1.0,
        height: 1.3,
    });
    (body, made.expect("a gait"))
}

/// Where the soles' middles are at each pose of it, with the base that soles tell; and its balance.
fn stood(body: &RobotBody, gait: &Gait, rate_hz: f64) -> (Vec<[DVec3; 2]>, f64, Option<usize>) {
    let soles = StandingSole::all(body);
    let poses: Vec<Vec<f64>> = (0..gait.clock.len())
        .map(|at| gait.angles_rad.iter().map(|series| series[at]).collect())
        .collect();
    let said = crate::retarget::footfall::of_contacts(&gait.stands, rate_hz);
    let held = crate::retarget::base::Held::Standing;
    let path =
        crate::retarget::base::path(body, &soles, held, &poses, rate_hz, |at| Some(said[at]));
    let mut load = FloorLoad::new(body, &soles, rate_hz);
    let mut feet = Vec::new();
    for (pose, place) in poses.iter().zip(&path.places) {
        let placed = body.tree.place(*place, &body.angles(pose));
        load.next(&placed);
        feet.push([0, 1].map(|side| {
            let sole = soles.iter().find(|sole| sole.side == side).expect("a sole");
            let corners = sole.corners_m.iter().map(|corner| placed[sole.link].point(*corner));
            corners.sum::<DVec3>() / sole.corners_m.len() as f64
        }));
    }
    let balance = load.finish().expect("a balance");
    let least_m = balance.margins_m.iter().flatten().copied().fold(f64::INFINITY, f64::min);
    (feet, least_m, balance.falls_at)
}

#[test]
fn a_pendulum_obeys_its_equation_and_rests_at_both_ends() {
    let point_m: Vec<DVec2> = (0..400)
        .map(|at| DVec2::new(0.0, if (150..250).contains(&at) { 0.04 } else { 0.0 }))
        .collect();
    let (step_s, height_m) = (1.0 / 60.0, 0.27);
    let centre_m = pendulum(&point_m, step_s, height_m);
    for at in 1..399 {
        let pull = (centre_m[at + 1] - 2.0 * centre_m[at] + centre_m[at - 1]) / step_s.powi(2);
        let found = centre_m[at] - pull * height_m / GRAVITY_M_S2;
        assert!(found.distance(point_m[at]) < 1e-9, "{at}");
    }
    // It leans before it is pushed, as exp(w t).
    let w = (GRAVITY_M_S2 / height_m).sqrt();
    let ratio = centre_m[120].y / centre_m[108].y;
    assert!((ratio / (w * 0.2).exp() - 1.0).abs() < 0.02, "{ratio}");
    assert!(centre_m[1].length() < 1e-7 && centre_m[398].length() < 1e-7);
    assert!(pendulum(&[], step_s, height_m).is_empty());
}

#[test]
fn a_robot_that_steps_stays_on_its_feet_and_none_that_stands_slides() {
    for (ahead_m, turn_rad, speed) in
        [(0.0, 0.0, 1.0), (0.5, 0.0, 1.0), (0.3, 0.1, 1.0), (0.3, 0.0, 0.5)]
    {
        let (body, gait) = walked(&walk(10, ahead_m, turn_rad), speed);
        let (feet, least_m, falls_at) = stood(&body, &gait, 120.0 * speed);
        assert_eq!(falls_at, None, "{ahead_m} {turn_rad} {speed}: {least_m}");
        assert!(least_m > 0.005, "{ahead_m} {turn_rad}: {least_m}");
        for side in 0..2 {
            let still = (1..feet.len())
                .filter(|at| [*at - 1, *at].iter().all(|at| gait.stands[*at].0[side]));
            let slid_m =
                still.map(|at| feet[at][side].distance(feet[at - 1][side])).fold(0.0, f64::max);
            assert!(slid_m < 1e-3, "{slid_m}");
        }
        let lowest_m = feet.iter().flatten().map(|foot| foot.z).fold(0.0, f64::min);
        assert!(lowest_m > -1e-3, "{lowest_m}");
        let gone_m = (feet[feet.len() - 1][0] - feet[0][0]).truncate().length();
        assert_eq!(gone_m > 0.2, ahead_m > 0.0, "{gone_m}");
        // The whole of the motion it was made of passes, and none of it backwards.
        assert!(gait.clock.windows(2).all(|two| two[0] <= two[1]));
        assert!(gait.clock[0] <= 1.0 && gait.clock[gait.clock.len() - 1] > 120.0 * 5.5);
    }
}

#[test]
fn who_turns_walks_in_a_bow() {
    let (body, gait) = walked(&walk(12, 0.4, 0.15), 1.0);
    let (feet, ..) = stood(&body, &gait, 120.0);
    let last = feet[feet.len() - 1];
    let across = last[0] - last[1];
    let heading = (-across.x).atan2(across.y);
    assert!((heading - 12.0 * 0.15).abs() < 0.05, "{heading}");
}

#[test]
fn who_turns_faster_than_the_robot_may_is_turned_after_in_the_next_steps() {
    // A little more than a quarter, and once around and a bit.
    for (turn_rad, expected) in [(0.7, 1.4), (3.4, 6.8 - std::f64::consts::TAU)] {
        let mut steps = walk(12, 0.4, 0.0);
        for step in &mut steps[2..4] {
            step.turn_rad = turn_rad;
        }
        let (body, gait) = walked(&steps, 1.0);
        let (feet, _, falls_at) = stood(&body, &gait, 120.0);
        assert_eq!(falls_at, None);
        let last = feet[feet.len() - 1];
        let across = last[0] - last[1];
        let heading = (-across.x).atan2(across.y);
        assert!((heading - expected).abs() < 0.05, "{turn_rad}: {heading}, {expected}");
    }
}

#[test]
fn without_steps_or_with_legs_that_lack_an_axis_there_is_no_gait() {
    let (robot, body) = op3();
    let start_rad: Vec<f64> = robot.joints.iter().map(|joint| joint.initial_rad).collect();
    let narrow: Vec<(f64, f64)> = start_rad.iter().map(|at| (at - 1e-3, at + 1e-3)).collect();
    let angles_rad: Vec<Vec<f64>> = start_rad.iter().map(|angle| vec![*angle; 600]).collect();
    let of = Walking {
        body: &body,
        start_rad: &start_rad,
        limits_rad: &narrow,
        angles_rad: &angles_rad,
        rate_hz: 120.0,
        steps: &[],
        scale: 0.27,
        speed: 1.0,
        slower: 1.0,
        height: 1.3,
    };
    assert_eq!(gait(&of), None);
    assert_eq!(gait(&Walking { steps: &walk(4, 0.2, 0.0), ..of }), None, "limits hold");
    let wide = vec![(-3.0, 3.0); start_rad.len()];
    let endless = Walking { steps: &walk(4, 0.2, 0.0), limits_rad: &wide, speed: 1e-3, ..of };
    assert_eq!(gait(&endless), None, "an hour and a half is too long");
    let poppy = Robot::load("poppy-humanoid").expect("a robot");
    let legs = RobotBody::of(&poppy.file).expect("a body").expect("one");
    let start_rad: Vec<f64> = poppy.joints.iter().map(|joint| joint.initial_rad).collect();
    let angles_rad: Vec<Vec<f64>> = start_rad.iter().map(|angle| vec![*angle; 600]).collect();
    let wide = vec![(-3.0, 3.0); start_rad.len()];
    let of = Walking {
        body: &legs,
        start_rad: &start_rad,
        limits_rad: &wide,
        angles_rad: &angles_rad,
        ..of
    };
    assert_eq!(gait(&Walking { steps: &walk(4, 0.2, 0.0), ..of }), None, "no ankle rolls");
}
