use super::*;
use crate::retarget::base::ON_FLOOR_M;
use crate::rigid::Volume;
use core::f64::consts::TAU;

const RATE_HZ: f64 = 100.0;

struct Op3 {
    body: RobotBody,
    names: Vec<String>,
}

fn op3() -> Op3 {
    let file = gaitway_profiles::robot("op3").expect("shipped");
    let body = RobotBody::of(&file).expect("a body").expect("it has one");
    Op3 { body, names: file.joints.iter().map(|joint| joint.name.clone()).collect() }
}

impl Op3 {
    /// Standing straight, with some joints elsewhere, rad.
    fn pose(&self, turned: &[(&str, f64)]) -> Vec<f64> {
        let mut pose = vec![0.0; self.names.len()];
        for (name, angle) in turned {
            let at = self.names.iter().position(|known| known == name).expect("a joint");
            pose[at] = *angle;
        }
        pose
    }

    fn look(
        &self,
        poses: &[Vec<f64>],
        said: Option<&[Footfall]>,
        hangs: bool,
    ) -> (BasePath, BodyFigures) {
        let path_times_s: Vec<f64> = (0..poses.len()).map(|at| at as f64 / RATE_HZ).collect();
        let performed = BodyMotion {
            body: &self.body,
            start_rad: &vec![0.0; self.names.len()],
            poses,
            rate_hz: RATE_HZ,
            path_times_s: &path_times_s,
            source_times_s: &path_times_s,
            clip: &(0..poses.len()),
            footfalls: said.map(|said| (said, RATE_HZ)),
            original: None,
            hangs,
            motors: &vec![None; self.names.len()],
        };
        figures(&performed).expect("figures")
    }

    /// Corners of a side's sole in the world.
    fn sole_m(&self, path: &BasePath, poses: &[Vec<f64>], at: usize, side: usize) -> Vec<DVec3> {
        let placed = self.body.tree.place(path.places[at], &self.body.angles(&poses[at]));
        let soles = StandingSole::all(&self.body);
        let sole = soles.iter().find(|sole| sole.side == side).expect("a sole");
        sole.corners_m.iter().map(|corner| placed[sole.link].point(*corner)).collect()
    }
}

const ON_THE_RIGHT: Footfall = Footfall {
    carries: [0.0, 1.0],
    flat: [0.0, 1.0],
    touches: Some([false, true]),
    ..Footfall::STANDING
};

/// The chest leans by `size` and back, by both ankles.
fn ankles(robot: &Op3, size: f64) -> Vec<Vec<f64>> {
    let angle = |at: usize| size * (1.0 - (TAU * at as f64 / 400.0).cos()) / 2.0;
    let turned = |angle: f64| robot.pose(&[("l_ank_pitch", angle), ("r_ank_pitch", -angle)]);
    (0..=400).map(|at| turned(angle(at))).collect()
}

#[test]
fn who_stands_straight_stands_on_both_soles_and_does_nothing_else() {
    let robot = op3();
    let poses = vec![robot.pose(&[]); 50];
    let (path, figures) = robot.look(&poses, None, false);
    assert!(path.places.iter().all(|place| *place == path.places[0]));
    assert!(path.contacts.iter().all(|contacts| *contacts == [true; 2]));
    for side in 0..2 {
        assert!(robot.sole_m(&path, &poses, 20, side).iter().all(|corner| corner.z.abs() < 1e-5));
    }
    assert_eq!(figures.slip_m_s, Some(0.0));
    assert_eq!(figures.penetration_share, Some(0.0));
    assert!(figures.sole_tilt_p95_rad.unwrap() < 1e-4 && figures.float_p95_m.unwrap() < 1e-5);
    assert_eq!((figures.predicted_fall_s, figures.unbalanced_share), (None, Some(0.0)));
    // The centre of mass over the rectangle around both soles, whose sides are those of the boxes.
    let placed = robot.body.tree.place(path.places[0], &robot.body.angles(&poses[0]));
    let centre_m = robot.body.tree.centre_of_mass_m(&placed);
    let corners: Vec<DVec3> =
        (0..2).flat_map(|side| robot.sole_m(&path, &poses, 0, side)).collect();
    let least = |along: DVec3| {
        let edge = corners.iter().map(|corner| corner.dot(along)).fold(f64::MIN, f64::max);
        edge - centre_m.dot(along)
    };
    let sides = [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y];
    let expected_m = sides.map(least).into_iter().fold(f64::MAX, f64::min);
    assert!((figures.balance_margin_m.unwrap() - expected_m).abs() < 1e-6, "{figures:?}");
}

#[test]
fn a_robot_that_leans_too_far_falls_and_one_that_leans_a_little_does_not() {
    let robot = op3();
    for (size, falls) in [(0.05, false), (0.6, true), (-0.6, true)] {
        let (_, figures) = robot.look(&ankles(&robot, size), None, false);
        assert_eq!(figures.predicted_fall_s.is_some(), falls, "{size}: {figures:?}");
        assert_eq!(!figures.unbalanced.is_empty(), falls);
        if let (Some(fall_s), Some([from_s, _])) =
            (figures.predicted_fall_s, figures.unbalanced.first())
        {
            assert!((*from_s..from_s + 1.0).contains(&fall_s), "{size}: {from_s} {fall_s}");
        }
        let (path, hanging) = robot.look(&ankles(&robot, size), None, true);
        assert!(path.places.iter().all(|place| *place == path.places[0]));
        assert_eq!((hanging.predicted_fall_s, hanging.balance_margin_m), (None, None));
        assert!(!hanging.missing.is_empty());
    }
}

/// From joints alone: with its ankles bent a robot leans with its trunk as far, or has fallen, and then the ankles were bent
/// in the air.
#[test]
fn a_robot_of_which_only_joints_are_known_leans_while_its_weight_is_over_its_soles() {
    let robot = op3();
    let soles = StandingSole::all(&robot.body);
    let lean_rad = |size: f64| {
        let poses = ankles(&robot, size);
        let resting = base::resting(&robot.body, &soles, &poses, RATE_HZ);
        let said = |at: usize| resting.get(at).copied();
        let path = base::path(&robot.body, &soles, Held::Standing, &poses, RATE_HZ, said);
        (path.places[200].turn * DVec3::Z).angle_between(DVec3::Z)
    };
    let at_rest = lean_rad(0.0);
    assert!(at_rest < 0.01, "{at_rest}");
    for size in [0.05, -0.05] {
        assert!((lean_rad(size) - 0.05).abs() < 0.01, "{size}: {}", lean_rad(size));
    }
    for size in [0.6, -0.6] {
        assert!(lean_rad(size) < 0.05, "{size}: {}", lean_rad(size));
    }
}

#[test]
fn the_base_moves_over_the_sole_that_carries() {
    let robot = op3();
    let poses: Vec<Vec<f64>> = (0..200)
        .map(|at| {
            let t = at as f64 / RATE_HZ;
            robot.pose(&[
                ("r_hip_pitch", 0.3 * t.sin()),
                ("r_hip_yaw", 0.2 * t),
                ("r_ank_roll", 0.1 * (2.0 * t).sin()),
                ("l_knee", 1.2),
                ("l_hip_pitch", -0.4 * t),
            ])
        })
        .collect();
    let said = vec![ON_THE_RIGHT; poses.len()];
    let (path, figures) = robot.look(&poses, Some(&said), false);
    let first = robot.sole_m(&path, &poses, 0, 1);
    for at in 0..poses.len() {
        for (corner, began) in robot.sole_m(&path, &poses, at, 1).iter().zip(&first) {
            assert!(corner.distance(*began) < 1e-3, "{at}: {corner} {began}");
        }
    }
    assert!(path.places[199].at_m.distance(path.places[0].at_m) > 0.02);
    assert!(figures.slip_m_s.unwrap() < 2e-3 && figures.sole_tilt_p95_rad.unwrap() < 0.01);
    assert!(path.contacts.iter().all(|contacts| *contacts == [false, true]));
}

/// Where the base goes while both feet come and go, at so many instants a second.
fn stepping(robot: &Op3, rate_hz: f64) -> (BasePath, Vec<Vec<f64>>) {
    let swing = |at: usize, phase: f64| (TAU * at as f64 / rate_hz / 1.2 + phase).sin();
    let count = (6.0 * rate_hz) as usize;
    let pose = |at: usize| {
        robot.pose(&[
            ("l_hip_pitch", 0.4 * swing(at, 0.0)),
            ("r_hip_pitch", 0.4 * swing(at, 1.0)),
            ("l_knee", 0.4 + 0.4 * swing(at, 2.0)),
            ("r_knee", -0.4 + 0.4 * swing(at, 0.5)),
            ("l_ank_roll", 0.2 * swing(at, 3.0)),
            ("r_hip_yaw", 0.3 * swing(at, 1.5)),
        ])
    };
    let poses: Vec<Vec<f64>> = (0..count).map(pose).collect();
    let stands = |at: usize, later_s: f64| (at as f64 / rate_hz + later_s) % 0.9 < 0.6;
    let said: Vec<([bool; 2], glam::DQuat)> =
        (0..count).map(|at| ([stands(at, 0.0), stands(at, 0.45)], glam::DQuat::IDENTITY)).collect();
    let said = crate::retarget::footfall::of_contacts(&said, rate_hz);
    let soles = StandingSole::all(&robot.body);
    let footfall = |at: usize| Some(said[at]);
    (base::path(&robot.body, &soles, Held::Standing, &poses, rate_hz, footfall), poses)
}

#[test]
fn nothing_jumps_where_another_foot_begins_to_carry_nor_goes_below_the_floor() {
    let robot = op3();
    let steps = |rate_hz: f64| {
        let (path, _) = stepping(&robot, rate_hz);
        let pairs = path.places.windows(2);
        pairs.fold((0.0_f64, 0.0_f64), |(far_m, turned), two| {
            (
                far_m.max(two[0].at_m.distance(two[1].at_m)),
                turned.max(two[0].turn.angle_between(two[1].turn)),
            )
        })
    };
    // A jump stays as large, however often one looks.
    let (coarse, fine) = (steps(RATE_HZ), steps(8.0 * RATE_HZ));
    assert!(fine.0 < 0.2 * coarse.0 && fine.1 < 0.2 * coarse.1, "{coarse:?} {fine:?}");
    let (path, poses) = stepping(&robot, RATE_HZ);
    for at in 0..poses.len() {
        let corners = (0..2).flat_map(|side| robot.sole_m(&path, &poses, at, side));
        let low_m = corners.map(|corner| corner.z).fold(f64::MAX, f64::min);
        assert!(low_m.abs() < 1e-9, "{at}: {low_m}");
    }
}

/// The feet are boxes with upright sides: turned inwards at the hips only, the boxes' inner corners meet.
#[test]
fn legs_that_cross_are_in_one_another_as_deep_as_the_boxes_of_their_feet() {
    let robot = op3();
    let apart = robot.look(&[robot.pose(&[])], None, true).1;
    assert_eq!((apart.self_collision_share, apart.self_collision_depth_m), (Some(0.0), Some(0.0)));
    assert!(apart.colliding.is_empty() && apart.self_collision_links.is_none());
    let mut crossed = vec![robot.pose(&[]); 30];
    crossed.extend(vec![robot.pose(&[("l_hip_roll", 0.15), ("r_hip_roll", -0.15)]); 30]);
    let figures = robot.look(&crossed, None, true).1;
    let (share, depth_m) =
        (figures.self_collision_share.unwrap(), figures.self_collision_depth_m.unwrap());
    // One way or the other it is half of the poses, or the legs are spread.
    let mirrored: Vec<Vec<f64>> =
        crossed.iter().map(|pose| pose.iter().map(|angle| -angle).collect()).collect();
    let other = robot.look(&mirrored, None, true).1;
    let (share, depth_m, poses) = if share > 0.0 {
        (share, depth_m, &crossed)
    } else {
        (other.self_collision_share.unwrap(), other.self_collision_depth_m.unwrap(), &mirrored)
    };
    assert!((share - 0.5).abs() < 1e-12, "{share}");
    // By trying all pairs, neighbours apart, with the exact distance.
    let placed = robot.body.tree.place(Placement::IDENTITY, &robot.body.angles(&poses[45]));
    let all: Vec<(usize, Volume)> = robot
        .body
        .volumes
        .iter()
        .enumerate()
        .flat_map(|(link, volumes)| {
            let place = placed[link];
            volumes.iter().map(move |volume| (link, volume.placed(place)))
        })
        .collect();
    let mut deepest_m = 0.0_f64;
    for (one, a) in &all {
        for (two, b) in &all {
            if !robot.body.are_neighbours(*one, *two) {
                deepest_m = deepest_m.max(-a.distance_m(b));
            }
        }
    }
    assert!(deepest_m > 0.005 && (depth_m - deepest_m).abs() < 1e-9, "{depth_m} {deepest_m}");
}

#[test]
fn who_flies_turns_as_the_person_and_who_stands_as_the_feet_do() {
    let robot = op3();
    let poses = vec![robot.pose(&[]); 60];
    for (carries, turned_rad) in [(0.0, 1.2), (1.0, 0.0)] {
        // From 2.6 rad on, so that it passes half a turn.
        let said = |at: usize| Footfall {
            carries: [carries; 2],
            flat: [carries; 2],
            touches: Some([carries > 0.0; 2]),
            heading_rad: Some(2.6 + 1.2 * at as f64 / 59.0),
            ..Footfall::STANDING
        };
        let said: Vec<Footfall> = (0..60).map(said).collect();
        let (path, figures) = robot.look(&poses, Some(&said), false);
        let found_rad = figures.turned_rad.unwrap();
        assert!((found_rad - turned_rad).abs() < 0.01, "{carries}: {found_rad}");
        let moved_m = path.places[59].at_m.distance(path.places[0].at_m);
        // About the middle of its soles, which is not quite below its base.
        assert!(moved_m < 0.03, "{carries}: {moved_m}");
    }
}

#[test]
fn a_bent_knee_below_the_floor_is_penetration_and_a_foot_in_the_air_floats() {
    let robot = op3();
    // On the right foot; the left is said to stand, and is 4 cm up.
    let lifted = robot.pose(&[("l_hip_pitch", -0.7), ("l_knee", 1.4), ("l_ank_pitch", 0.7)]);
    let said = Footfall { touches: Some([true; 2]), ..ON_THE_RIGHT };
    let poses = vec![lifted; 20];
    let (path, figures) = robot.look(&poses, Some(&[said; 20]), false);
    let low_m = robot.sole_m(&path, &poses, 10, 0).iter().map(|c| c.z).fold(f64::MAX, f64::min);
    assert!(low_m > 4.0 * ON_FLOOR_M, "{low_m}");
    assert!((figures.float_p95_m.unwrap() - low_m).abs() < 1e-9);
    assert_eq!(figures.penetration_share, Some(0.0));
    // On its head nothing of the soles is below, and the head is.
    let upside =
        Footfall { carries: [0.0; 2], flat: [0.0; 2], up: DVec3::NEG_Z, ..Footfall::STANDING };
    let (_, figures) = robot.look(&vec![robot.pose(&[]); 20], Some(&[upside; 20]), false);
    assert_eq!(figures.penetration_share, Some(1.0));
}

#[test]
fn spans_of_time_that_are_near_are_one() {
    let mut is_so = vec![false; 100];
    for at in [10, 11, 12, 18, 60, 61] {
        is_so[at] = true;
    }
    let found = spans(&is_so, 0.01);
    let expected = [[0.10, 0.18], [0.60, 0.61]];
    assert_eq!(found.len(), 2);
    for (found, expected) in found.iter().flatten().zip(expected.iter().flatten()) {
        assert!((found - expected).abs() < 1e-12);
    }
    let often: Vec<bool> = (0..10_000).map(|at| at % 40 == 0).collect();
    assert_eq!(spans(&often, 0.01).len(), SPANS);
    assert_eq!(quantile(vec![3.0, 1.0, 2.0], 0.5), Some(2.0));
    assert_eq!(quantile(Vec::new(), 0.5), None);
}
