//! The shipped walk goes like people walk, on feet that stay where they stand.

use crate::measured::WALKING;
use gaitway::action::{Motion, vocabulary};
use gaitway::body::contact::Footing;
use gaitway::body::{Dof, PelvisAngles, Proportions, Segment, SegmentPose};

const RATE_HZ: f64 = 120.0;

fn body() -> Proportions {
    Proportions::of_stature(1.75).unwrap()
}

fn walk() -> Motion {
    vocabulary::find("walk").unwrap().perform().unwrap()
}

fn poses() -> Vec<SegmentPose> {
    walk().poses(&body(), RATE_HZ).unwrap()
}

fn steady<T: Clone>(all: &[T]) -> Vec<T> {
    // Two strides in the middle of four.
    let stride = (vocabulary::find("walk").unwrap().duration_s * RATE_HZ).round() as usize;
    all[5 * stride / 4..=13 * stride / 4].to_vec()
}

#[test]
fn a_walk_begins_and_ends_at_rest_in_n_pose() {
    let walk = walk();
    for dof in Dof::ALL {
        for at_s in [0.0, walk.duration_s()] {
            let state = walk.at(dof, at_s);
            let is_n_pose = state.position_rad.abs() < 1e-12 && state.velocity_rad_s.abs() < 1e-12;
            assert!(is_n_pose, "{} at {at_s} s", dof.name());
        }
    }
    let (poses, height_m) = (poses(), body().root_height_m());
    // The soles' first and last millimetres are spread over hundredths of a second.
    assert!((poses[0].root_m.z - height_m).abs() < 1e-4);
    assert!((poses[poses.len() - 1].root_m.z - height_m).abs() < 1e-4);
}

/// Extremes of the mean of measured people, within five degrees; but the ankle pushes off less than
/// theirs, since the foot of the body has no toe joint.
#[test]
fn joints_move_through_the_ranges_of_normal_walking() {
    let steady = steady(&walk().sampled(RATE_HZ).unwrap());
    let hip = WALKING.hip_deg.map(|hip| hip - WALKING.pelvis_deg);
    for (dof, measured, least_off, most_off) in [
        (Dof::LeftHipFlexion, hip, 5.0, 5.0),
        (Dof::RightHipFlexion, hip, 5.0, 5.0),
        (Dof::LeftKneeFlexion, WALKING.knee_deg, 5.0, 5.0),
        (Dof::RightKneeFlexion, WALKING.knee_deg, 5.0, 5.0),
        (Dof::LeftAnkleDorsiflexion, WALKING.ankle_deg, 7.0, 5.0),
        (Dof::RightAnkleDorsiflexion, WALKING.ankle_deg, 7.0, 5.0),
    ] {
        let extremes = |angles: &mut dyn Iterator<Item = f64>| {
            angles.fold((f64::MAX, f64::MIN), |(a, b), x| (a.min(x), b.max(x)))
        };
        let (least, most) = extremes(&mut steady.iter().map(|angles| angles[dof].to_degrees()));
        let (low, high) = extremes(&mut measured.into_iter());
        assert!((least - low).abs() <= least_off, "{}: {least}, measured {low}", dof.name());
        assert!((most - high).abs() <= most_off, "{}: {most}, measured {high}", dof.name());
    }
}

#[test]
fn the_body_goes_forward_at_a_steady_walking_pace() {
    let all = poses();
    let steady = steady(&all);
    let pace = |a: &SegmentPose, b: &SegmentPose| (b.root_m.x - a.root_m.x) * RATE_HZ;
    let mean = pace(&steady[0], &steady[steady.len() - 1]) / (steady.len() - 1) as f64;
    assert!((1.2..1.8).contains(&mean), "{mean} m/s");
    for pair in steady.windows(2) {
        let now = pace(&pair[0], &pair[1]);
        assert!((now - mean).abs() < 0.15 * mean, "{now} m/s");
    }
    let heights = steady.iter().map(|pose| pose.root_m.z);
    let (low, high) = heights.fold((f64::MAX, f64::MIN), |(a, b), z| (a.min(z), b.max(z)));
    assert!(high - low < 0.08, "{}", high - low);
    for pair in all.windows(2) {
        assert!(pace(&pair[0], &pair[1]) > -0.05, "never backwards");
    }
    let last = &all[all.len() - 1];
    assert!(last.root_m.y.abs() < 0.05, "straight ahead: {}", last.root_m);
}

/// People at this pace stand on both feet for a fifth to a quarter of a stride (Murray, Drought, Kory, "Walking
/// patterns of normal men", Journal of Bone and Joint Surgery 46-A, 1964: 22 %), and the floor pushes with 0.7 to
/// 1.2 times their weight (Nilsson and Thorstensson, Acta Physiologica Scandinavica 136, 1989).
#[test]
fn both_feet_stand_for_a_fifth_of_a_stride_and_the_floor_pushes_as_under_people() {
    let (action, rate_hz) = (vocabulary::find("walk").unwrap(), 250.0);
    let poses = action.perform().unwrap().poses(&body(), rate_hz).unwrap();
    let footing = Footing::of(&body(), &poses, rate_hz).unwrap();
    let stride = (action.duration_s * rate_hz).round() as usize;
    let steady = 3 * stride / 2..5 * stride / 2;
    let both = footing.both_feet(steady.clone());
    println!("both feet stand for {:.1} % of a stride", both * 1e2);
    assert!((0.18..0.26).contains(&both), "{both}");
    assert_eq!(footing.flying(0..poses.len()), 0.0, "a foot is always down");
    let (least, most) = (footing.force_quantile(0.01), footing.force_quantile(0.99));
    assert!(least > 0.6 && most < 1.3, "{least} to {most} body weights");
    let travelled_m = poses[steady.end].root_m.x - poses[steady.start].root_m.x;
    let pace_m_s = travelled_m / action.duration_s;
    assert!((1.2..1.4).contains(&pace_m_s), "{pace_m_s} m/s");
}

/// Saunders, Inman, Eberhart, "The major determinants in normal and pathological gait", Journal of Bone and Joint
/// Surgery 35-A, 1953: the pelvis turns by 4 deg to either side and lists by 5, and sways by some 5 cm in all.
#[test]
fn the_pelvis_turns_lists_and_sways_as_in_people() {
    let all = poses();
    let stride = (vocabulary::find("walk").unwrap().duration_s * RATE_HZ).round() as usize;
    // The left foot comes down half a stride after the start.
    let left_heel = 3 * stride / 2;
    let steady = &all[left_heel..=left_heel + stride];
    let range = |figure: &dyn Fn(&SegmentPose) -> f64| {
        let figures = steady.iter().map(figure);
        let (low, high) = figures.fold((f64::MAX, f64::MIN), |(a, b), x| (a.min(x), b.max(x)));
        high - low
    };
    let pelvis = |pose: &SegmentPose| PelvisAngles::of(pose.orientation[Segment::Pelvis.index()]);
    let turns_deg = range(&|pose| pelvis(pose).rotation_rad).to_degrees();
    let lists_deg = range(&|pose| pelvis(pose).obliquity_rad).to_degrees();
    let sways_m = range(&|pose| pose.root_m.y);
    println!("turns by {turns_deg:.1}, lists by {lists_deg:.1} deg, sways by {sways_m:.3} m");
    assert!((5.0..14.0).contains(&turns_deg), "{turns_deg}");
    assert!((6.0..12.5).contains(&lists_deg), "{lists_deg}");
    assert!((0.02..0.065).contains(&sways_m), "{sways_m}");
    // The left side is forward as the left heel comes down, and up as the left leg stands.
    assert!(pelvis(&all[left_heel]).rotation_rad < 0.0);
    assert!(pelvis(&all[left_heel + stride / 4]).obliquity_rad > 0.0);
}

#[test]
fn left_and_right_are_half_a_stride_apart() {
    let (walk, period_s) = (walk(), vocabulary::find("walk").unwrap().duration_s);
    for (left, right) in [
        (Dof::LeftHipFlexion, Dof::RightHipFlexion),
        (Dof::LeftKneeFlexion, Dof::RightKneeFlexion),
        (Dof::LeftElbowFlexion, Dof::RightElbowFlexion),
    ] {
        for sample in 0..216 {
            let at_s = 1.25 * period_s + f64::from(sample) / RATE_HZ;
            let position_rad = |dof, time_s| walk.at(dof, time_s).position_rad;
            let (now, later) =
                (position_rad(left, at_s), position_rad(right, at_s + period_s / 2.0));
            assert!((now - later).abs() < 1e-9, "{} at {at_s}", left.name());
        }
    }
}

/// The knee in stance of level running: foot strike 20.9 deg, peak 36.2 deg ("Three-Dimensional
/// Kinematic Analysis During Level and Downhill Treadmill Running", The Sport Journal).
#[test]
fn the_run_bends_its_knee_in_stance_as_published() {
    let run = vocabulary::find("run").unwrap();
    let motion = run.perform().unwrap();
    let period_s = run.duration_s;
    let knee = |part: f64| {
        let time_s = (2.5 + part) * period_s;
        motion.at(Dof::LeftKneeFlexion, time_s).position_rad.to_degrees()
    };
    let peak = (0..=30).map(|i| knee(f64::from(i) / 100.0)).fold(0.0, f64::max);
    println!("foot strike {:.1}, peak {peak:.1}", knee(0.0));
    assert!((knee(0.0) - 20.9).abs() < 3.0, "{}", knee(0.0));
    assert!((peak - 36.2).abs() < 3.0, "{peak}");
    // In flight no foot touches the ground, for some 15 to 40 % of a stride.
    let rate_hz = 480.0;
    let poses = motion.poses(&body(), rate_hz).unwrap();
    let footing = Footing::of(&body(), &poses, rate_hz).unwrap();
    let stride = (period_s * rate_hz).round() as usize;
    let flying = footing.flying(2 * stride..3 * stride);
    println!("{:.0} % of a stride in the air", flying * 1e2);
    assert!((0.13..0.4).contains(&flying), "{flying}");
    assert_eq!(footing.both_feet(2 * stride..3 * stride), 0.0);
}
