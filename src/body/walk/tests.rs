use super::*;
use crate::body::contact::foot_skate_m_s;
use crate::body::{End, Joint};

fn body() -> Proportions {
    Proportions::of_stature(1.75).unwrap()
}

fn walk() -> Vec<BodySample> {
    Walk::default().synthesise(&body()).unwrap()
}

/// Poses of whole strides in the middle, away from start and end.
fn steady() -> Vec<BodySample> {
    walk()[144..=432].to_vec()
}

fn range_deg(samples: &[BodySample], dof: Dof) -> (f64, f64) {
    let angles = samples.iter().map(|sample| sample.angles[dof].to_degrees());
    angles.fold((f64::MAX, f64::MIN), |(low, high), angle| (low.min(angle), high.max(angle)))
}

#[test]
fn a_walk_begins_and_ends_at_rest_in_n_pose() {
    let walk = walk();
    let n_pose = JointAngles::default();
    assert_eq!(walk[0].angles, n_pose);
    assert_eq!(walk[walk.len() - 1].angles, n_pose);
    // An actionlet leaves rest with no acceleration, so two poses differ by the cube of the step.
    for (one, other) in [(0, 1), (walk.len() - 2, walk.len() - 1)] {
        for dof in Dof::ALL {
            let change = walk[one].angles[dof] - walk[other].angles[dof];
            assert!(change.abs() < 5e-4, "{}: {change}", dof.name());
        }
    }
    let height_m = body().root_height_m();
    assert!((walk[0].root_m.z - height_m).abs() < 1e-9);
    assert!((walk[walk.len() - 1].root_m.z - height_m).abs() < 1e-9);
}

#[test]
fn joints_move_through_the_ranges_of_normal_walking() {
    let steady = steady();
    for (dof, low, high) in [
        (Dof::LeftHipFlexion, -20.0..-8.0, 25.0..35.0),
        (Dof::RightHipFlexion, -20.0..-8.0, 25.0..35.0),
        (Dof::LeftKneeFlexion, 0.0..12.0, 52.0..68.0),
        (Dof::RightKneeFlexion, 0.0..12.0, 52.0..68.0),
        (Dof::LeftAnkleDorsiflexion, -25.0..-8.0, 6.0..15.0),
        (Dof::RightAnkleDorsiflexion, -25.0..-8.0, 6.0..15.0),
    ] {
        let (least, greatest) = range_deg(&steady, dof);
        assert!(low.contains(&least), "{}: {least}", dof.name());
        assert!(high.contains(&greatest), "{}: {greatest}", dof.name());
    }
    for sample in walk() {
        for dof in Dof::ALL {
            let (lower, upper) = dof.range_rad();
            assert!((lower..=upper).contains(&sample.angles[dof]), "{}", dof.name());
        }
    }
}

#[test]
fn the_body_goes_forward_at_a_steady_walking_pace() {
    let steady = steady();
    let pace = |a: &BodySample, b: &BodySample| (b.root_m.x - a.root_m.x) * 120.0;
    let mean = pace(&steady[0], &steady[steady.len() - 1]) / (steady.len() - 1) as f64;
    assert!((1.2..1.8).contains(&mean), "{mean} m/s");
    for pair in steady.windows(2) {
        let now = pace(&pair[0], &pair[1]);
        assert!((now - mean).abs() < 0.15 * mean, "{now} m/s");
    }
    let heights = steady.iter().map(|sample| sample.root_m.z);
    let (low, high) = heights.fold((f64::MAX, f64::MIN), |(a, b), z| (a.min(z), b.max(z)));
    assert!(high - low < 0.08, "{}", high - low);
    let walk = walk();
    assert!(walk.iter().all(|sample| sample.root_m.y.abs() < 1e-9));
    for pair in walk.windows(2) {
        assert!(pace(&pair[0], &pair[1]) > -0.05, "never backwards");
    }
}

#[test]
fn feet_on_the_ground_hardly_slide_and_never_sink_into_it() {
    let poses: Vec<_> = walk().iter().map(BodySample::to_pose).collect();
    let steady: Vec<_> = steady().iter().map(BodySample::to_pose).collect();
    let skate = foot_skate_m_s(&body(), &steady, 120.0, 0.01);
    assert!(skate < 0.02, "{skate} m/s");
    let whole = foot_skate_m_s(&body(), &poses, 120.0, 0.01);
    assert!(whole < 0.03, "{whole} m/s");
    for pose in &poses {
        let at = body().positions(pose);
        let lowest = End::ALL.map(|end| at.end_m(end).z).into_iter().fold(f64::MAX, f64::min);
        assert!(lowest.abs() < 1e-9);
    }
}

#[test]
fn left_and_right_are_half_a_stride_apart() {
    let walk = walk();
    for (left, right) in [
        (Dof::LeftHipFlexion, Dof::RightHipFlexion),
        (Dof::LeftKneeFlexion, Dof::RightKneeFlexion),
        (Dof::LeftElbowFlexion, Dof::RightElbowFlexion),
    ] {
        for sample in 144..360 {
            let (now, later) = (walk[sample].angles[left], walk[sample + 72].angles[right]);
            assert!((now - later).abs() < 1e-9, "{} at {sample}", left.name());
        }
    }
    assert_eq!(Dof::LeftKneeFlexion.joint(), Joint::LeftKnee);
}

#[test]
fn options_out_of_range_are_refused() {
    for walk in [
        Walk { stride_s: 0.4, ..Walk::default() },
        Walk { stride_s: f64::NAN, ..Walk::default() },
        Walk { strides: 0, ..Walk::default() },
        Walk { strides: 1001, ..Walk::default() },
        Walk { rate_hz: 0.0, ..Walk::default() },
        Walk { rate_hz: f64::INFINITY, ..Walk::default() },
    ] {
        assert!(walk.synthesise(&body()).is_err(), "{walk:?}");
    }
    assert!(Walk { strides: 1, ..Walk::default() }.synthesise(&body()).is_ok());
}
