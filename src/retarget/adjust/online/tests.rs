use super::super::tests::{Op3, op3};
use super::*;
use crate::retarget::collision::TOUCHES_M;

const STEP_S: f64 = 0.01;

/// What became of an OP3 that followed, pose by pose, without what its servos give way.
struct Went {
    poses: Vec<Vec<f64>>,
    /// Its goals, which are beyond those.
    goals: Vec<Vec<f64>>,
    /// How high the left and the right sole are over the lower one, m.
    height_m: Vec<[f64; 2]>,
    /// How far inside the soles that are on the floor the centre of mass is, m.
    inside_m: Vec<f64>,
    lifts: Option<Lifts>,
}

/// Follows a pose of all joints that changes with time, s, from where the robot stands at first.
fn followed(op3: &Op3, stands: bool, seconds: f64, pose: impl Fn(f64) -> Vec<f64>) -> Went {
    let free = vec![true; op3.start_rad.len()];
    let of = op3.adjustable(&free);
    let velocity_rad_s = vec![4.8; free.len()];
    let mut adjuster = Adjuster::new(of, &velocity_rad_s, &op3.start_rad, stands);
    let mut went = Went {
        poses: Vec::new(),
        goals: Vec::new(),
        height_m: Vec::new(),
        inside_m: Vec::new(),
        lifts: None,
    };
    let solver = Solver::new(of);
    let soles = solver.feet().expect("two feet");
    for at in 0..(seconds / STEP_S) as usize {
        went.goals.push(adjuster.next(&pose(at as f64 * STEP_S), DVec3::Z, STEP_S, false));
        let [_, here] = adjuster.before.clone().expect("it went somewhere");
        // As the floor sees it: up is the normal of the sole that is lower.
        let placed = solver.place(&here);
        let floor = Floor::of(&solver, soles, &placed, DVec3::Z);
        let stands = floor.height_m.map(|height_m| height_m < 0.001);
        let by = usize::from(!stands[0]);
        let on = floor.soles_m[by].iter().zip(stands).filter(|(_, stands)| *stands);
        let corners: Vec<DVec2> = on.flat_map(|(sole, _)| sole.iter().copied()).collect();
        let centre_m = floor.centre_m[by].truncate();
        went.inside_m.push(SupportPolygon::of(&corners).margin_m(centre_m).expect("a sole"));
        went.height_m.push(floor.height_m);
        went.poses.push(here);
    }
    went.lifts = adjuster.lifts();
    went
}

/// The pose an OP3 starts in, with one leg drawn up by so much of its knee, rad.
fn drawn_up(op3: &Op3, side: &str, knee_rad: f64) -> Vec<f64> {
    let mut pose = op3.start_rad.clone();
    let way = if side == "l" { 1.0 } else { -1.0 };
    for (name, share) in [("hip_pitch", -0.5), ("knee", 1.0), ("ank_pitch", 0.5)] {
        pose[op3.joint(&format!("{side}_{name}"))] += way * share * knee_rad;
    }
    pose
}

/// From 0 at one time to 1 at the other, s.
fn between(time_s: f64, from_s: f64, to_s: f64) -> f64 {
    ((time_s - from_s) / (to_s - from_s)).clamp(0.0, 1.0)
}

#[test]
fn a_foot_is_lifted_once_the_weight_is_over_the_other_and_on_either_side_alike() {
    let op3 = op3();
    for side in ["l", "r"] {
        let went = followed(&op3, true, 6.0, |time_s| {
            let up = between(time_s, 1.0, 1.2) - between(time_s, 3.5, 3.7);
            drawn_up(&op3, side, 0.5 * up)
        });
        assert_eq!(went.lifts, Some(Lifts { lifted: 1, kept_down: 0 }), "{side}");
        let swings = usize::from(side == "r");
        let height = |at: usize| went.height_m[at][swings];
        // The person's foot is up at 1.2 s; the robot's only after its weight went over.
        assert!((0..140).all(|at| height(at) < 0.001), "{side}");
        assert!(height(300) > 0.01, "{side}: {}", height(300));
        assert!(height(599) < 0.003, "{side}: {}", height(599));
        for (at, inside_m) in went.inside_m.iter().enumerate() {
            assert!(*inside_m > 0.01, "{side}, {at}: {inside_m}");
        }
        // And what stands lies flat, side by side, before and after.
        assert!((550..599).all(|at| went.height_m[at] == went.height_m[at].map(|h| h.min(0.003))));
    }
}

#[test]
fn on_one_leg_goals_are_beyond_poses_by_what_its_hip_gives_way_and_who_hangs_gives_none() {
    let op3 = op3();
    let drawn = |time_s: f64| drawn_up(&op3, "r", 0.5 * between(time_s, 1.0, 1.2));
    let went = followed(&op3, true, 5.0, drawn);
    let beyond_rad = |at: usize, name: &str| {
        let joint = op3.joint(name);
        went.goals[at][joint] - went.poses[at][joint]
    };
    // 2.5 kg hang 3 to 5 cm aside of the left hip, which holds them with 21.1 N m/rad.
    let hip_rad = beyond_rad(450, "l_hip_roll").abs();
    assert!(hip_rad > 0.025 && hip_rad < 0.075, "{hip_rad}");
    // On both feet neither hip holds more than half of that.
    let stands_rad = beyond_rad(90, "l_hip_roll").abs();
    assert!(stands_rad < hip_rad / 2.0, "{stands_rad}");
    // It goes there without a leap.
    for at in 1..went.goals.len() {
        for (joint, (now, before)) in went.goals[at].iter().zip(&went.goals[at - 1]).enumerate() {
            assert!((now - before).abs() <= 4.8 * STEP_S, "{joint} at {at}: {before} to {now}");
        }
    }
    let hangs = followed(&op3, false, 5.0, drawn);
    assert_eq!(hangs.goals, hangs.poses);
}

#[test]
fn a_foot_that_is_down_again_before_the_weight_could_go_over_stays_on_the_floor() {
    let op3 = op3();
    let went = followed(&op3, true, 3.0, |time_s| {
        let up = between(time_s, 1.0, 1.15) - between(time_s, 1.15, 1.3);
        drawn_up(&op3, "l", 0.6 * up)
    });
    assert_eq!(went.lifts, Some(Lifts { lifted: 0, kept_down: 1 }));
    assert!(went.height_m.iter().all(|height_m| height_m.iter().all(|h| *h < 0.002)));
}

#[test]
fn both_feet_in_the_air_are_no_flight_and_knees_that_snap_are_drawn_out_slowly() {
    let op3 = op3();
    let went = followed(&op3, true, 3.0, |time_s| {
        // A jump: both legs stretch within a tenth of a second, and bend again.
        let out = between(time_s, 1.0, 1.1) - between(time_s, 1.4, 1.5);
        let mut pose = op3.start_rad.clone();
        for name in ["hip_pitch", "knee", "ank_pitch"] {
            for side in ["l", "r"] {
                let joint = op3.joint(&format!("{side}_{name}"));
                pose[joint] *= 1.0 - 0.6 * out;
            }
        }
        pose
    });
    assert_eq!(went.lifts, Some(Lifts::default()));
    assert!(went.height_m.iter().all(|height_m| height_m.iter().all(|h| *h < 0.002)));
    let knee = op3.joint("l_knee");
    let most = |at: usize| (went.poses[at + 1][knee] - went.poses[at][knee]).abs() / STEP_S;
    let fastest_rad_s = (0..298).map(most).fold(0.0, f64::max);
    assert!(fastest_rad_s > 0.3 && fastest_rad_s < LEG_PACE * 4.8 + 0.2, "{fastest_rad_s}");
}

#[test]
fn an_arm_that_is_led_into_the_trunk_stays_outside_and_comes_back_to_what_it_is_told() {
    let op3 = op3();
    let told = |time_s: f64| {
        let inward = between(time_s, 0.5, 1.0) - between(time_s, 1.5, 2.0);
        let mut pose = vec![0.0; op3.start_rad.len()];
        pose[op3.joint("r_sho_roll")] = -1.3;
        pose[op3.joint("l_sho_roll")] = 1.3;
        pose[op3.joint("r_el")] = 1.3 * inward;
        pose[op3.joint("r_sho_pitch")] = 0.2 * inward;
        pose
    };
    let mirrored = |time_s: f64| {
        let mut pose = told(time_s);
        pose[op3.joint("r_el")] *= -1.0;
        pose[op3.joint("r_sho_pitch")] *= -1.0;
        pose
    };
    let deepest = |poses: &[Vec<f64>]| {
        let series: Vec<Vec<f64>> = (0..op3.start_rad.len())
            .map(|joint| poses.iter().map(|pose| pose[joint]).collect())
            .collect();
        op3.depths_m(&series).into_iter().fold(0.0, f64::max)
    };
    let given = |way: &dyn Fn(f64) -> Vec<f64>| {
        (0..400).map(|at| way(at as f64 * STEP_S)).collect::<Vec<_>>()
    };
    let ways: [&dyn Fn(f64) -> Vec<f64>; 2] = [&told, &mirrored];
    let inward = ways.into_iter().max_by(|a, b| deepest(&given(a)).total_cmp(&deepest(&given(b))));
    let inward = inward.expect("one of them");
    assert!(deepest(&given(inward)) > 0.005);
    let went = followed(&op3, false, 4.0, inward);
    assert!(deepest(&went.poses) < TOUCHES_M, "{}", deepest(&went.poses));
    assert_eq!(went.lifts, None);
    let given = given(inward);
    // Until something is near, and again some time after, nothing is changed.
    assert_eq!(went.poses[..50], given[..50]);
    let off = went.poses[399].iter().zip(&given[399]).map(|(a, b)| (a - b).abs());
    assert!(off.fold(0.0, f64::max) < 1e-3);
}

#[test]
fn it_comes_to_the_first_pose_slowly_with_all_joints_and_only_then_lifts_a_foot() {
    let op3 = op3();
    let arm = op3.joint("r_el");
    let went = followed(&op3, true, 5.0, |_| {
        let mut pose = drawn_up(&op3, "l", 0.8);
        pose[arm] -= 1.2;
        pose
    });
    let fastest_rad_s = |joint: usize, until: usize| {
        let step = |at: usize| (went.poses[at + 1][joint] - went.poses[at][joint]).abs() / STEP_S;
        (0..until).map(step).fold(0.0, f64::max)
    };
    let there = (0..499).find(|at| (went.poses[*at][arm] - op3.start_rad[arm] + 1.2).abs() < 0.05);
    let there = there.expect("it comes there");
    assert!(there > 80, "{there}");
    assert!(fastest_rad_s(arm, there) < APPROACH_SHARE * 4.8 + 0.01);
    assert!((0..there).all(|at| went.height_m[at].iter().all(|height_m| *height_m < 0.002)));
    assert_eq!(went.lifts, Some(Lifts { lifted: 1, kept_down: 0 }));
}

#[test]
fn a_pause_in_which_nobody_spoke_is_no_leap() {
    let op3 = op3();
    let free = vec![true; op3.start_rad.len()];
    let of = op3.adjustable(&free);
    let velocity_rad_s = vec![4.8; free.len()];
    let mut adjuster = Adjuster::new(of, &velocity_rad_s, &op3.start_rad, true);
    let mut before = op3.start_rad.clone();
    for step in 0..200 {
        let dt_s = if step % 20 == 19 { 2.0 } else { STEP_S };
        let pose = drawn_up(&op3, "r", if step < 100 { 0.0 } else { 0.8 });
        let here = adjuster.next(&pose, DVec3::Z, dt_s, false);
        for (now, before) in here.iter().zip(&before) {
            assert!(now.is_finite() && (now - before).abs() < 4.8 * LONGEST_S, "{now} {before}");
        }
        before = here;
    }
}
