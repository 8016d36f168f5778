//! The shipped walk goes like people walk, on feet that stay where they stand.

#[allow(dead_code, reason = "running is compared elsewhere")]
#[path = "gait/measured.rs"]
mod measured;

use gaitway::action::{Motion, vocabulary};
use gaitway::body::contact::Footing;
use gaitway::body::{Dof, JointAngles, Proportions, SegmentPose};
use measured::WALKING;

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
    all[144..=432].to_vec()
}

#[test]
fn a_walk_begins_and_ends_at_rest_in_n_pose() {
    let angles = walk().sampled(RATE_HZ).unwrap();
    let n_pose = JointAngles::default();
    assert_eq!(angles[0], n_pose);
    let last = angles[angles.len() - 1];
    assert!(Dof::ALL.iter().all(|dof| last[*dof].abs() < 1e-12));
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

#[test]
fn left_and_right_are_half_a_stride_apart() {
    let walk = walk().sampled(RATE_HZ).unwrap();
    for (left, right) in [
        (Dof::LeftHipFlexion, Dof::RightHipFlexion),
        (Dof::LeftKneeFlexion, Dof::RightKneeFlexion),
        (Dof::LeftElbowFlexion, Dof::RightElbowFlexion),
    ] {
        for sample in 144..360 {
            let (now, later) = (walk[sample][left], walk[sample + 72][right]);
            assert!((now - later).abs() < 1e-9, "{} at {sample}", left.name());
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
