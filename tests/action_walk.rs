//! The shipped walk goes like people walk, on feet that stay where they stand.

#[allow(dead_code, reason = "running is compared elsewhere")]
#[path = "gait/measured.rs"]
mod measured;

use gaitway::action::{Motion, vocabulary};
use gaitway::body::contact::foot_skate_m_s;
use gaitway::body::{Dof, End, JointAngles, Proportions, SegmentPose};
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
    assert!((poses[0].root_m.z - height_m).abs() < 1e-9);
    assert!((poses[poses.len() - 1].root_m.z - height_m).abs() < 1e-9);
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
    assert!(all.iter().all(|pose| pose.root_m.y.abs() < 1e-9));
    for pair in all.windows(2) {
        assert!(pace(&pair[0], &pair[1]) > -0.05, "never backwards");
    }
}

#[test]
fn feet_on_the_ground_hardly_slide_and_never_sink_into_it() {
    let all = poses();
    let skate = foot_skate_m_s(&body(), &steady(&all), RATE_HZ, 0.01);
    assert!(skate < 0.015, "{skate} m/s");
    let whole = foot_skate_m_s(&body(), &all, RATE_HZ, 0.01);
    assert!(whole < 0.015, "{whole} m/s");
    for pose in &all {
        let at = body().positions(pose);
        let lowest = End::ALL.map(|end| at.end_m(end).z).into_iter().fold(f64::MAX, f64::min);
        assert!(lowest.abs() < 1e-9);
    }
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
    // In flight no foot touches the ground: some height between 2 and 15 cm is gained.
    let poses = motion.poses(&body(), RATE_HZ).unwrap();
    let lowest = |pose: &SegmentPose| {
        let at = body().positions(pose);
        End::ALL.map(|end| at.end_m(end).z).into_iter().fold(f64::MAX, f64::min)
    };
    let highest = poses.iter().map(lowest).fold(f64::MIN, f64::max);
    assert!((0.01..0.15).contains(&highest), "{highest}");
}

#[test]
fn a_running_foot_stands_still_while_it_stands_and_sinks_at_no_time() {
    let motion = vocabulary::find("run").unwrap().perform().unwrap();
    let poses = motion.poses(&body(), RATE_HZ).unwrap();
    let in_flight = |sample: usize| {
        let time_s = sample as f64 / RATE_HZ;
        let near = |(from_s, to_s): &(f64, f64)| (from_s - 0.01..to_s + 0.01).contains(&time_s);
        motion.flights_s().iter().any(near)
    };
    let (first, last) = motion
        .flights_s()
        .iter()
        .fold((f64::MAX, 0.0f64), |(first, last), f| (first.min(f.0), last.max(f.1)));
    let steady = (first * RATE_HZ) as usize..(last * RATE_HZ) as usize;
    let (mut skate, mut steps) = (0.0f64, 0);
    for sample in steady {
        if !in_flight(sample) && !in_flight(sample + 1) {
            let pair = &poses[sample..=sample + 1];
            skate = skate.max(foot_skate_m_s(&body(), pair, RATE_HZ, 0.002));
            steps += 1;
        }
    }
    println!("at most {skate:.3} m/s over {steps} steps");
    assert!(steps > 100 && skate < 0.05, "{skate} m/s");
    for pose in &poses {
        let at = body().positions(pose);
        let lowest = End::ALL.map(|end| at.end_m(end).z).into_iter().fold(f64::MAX, f64::min);
        assert!(lowest > -0.003, "{lowest} m");
    }
}
