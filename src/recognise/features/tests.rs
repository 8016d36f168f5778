use super::*;
use crate::body::{BodyFigure, Dof, JointAngles, Proportions};
use glam::DQuat;

const RATE_HZ: f64 = 30.0;

fn body() -> Proportions {
    Proportions::of_figure(BodyFigure::DrillisContini, 1.75).expect("a body")
}

fn standing(at: DVec3, heading_rad: f64, set: &[(Dof, f64)]) -> Points {
    let mut angles = JointAngles::default();
    for (dof, degrees) in set {
        angles[*dof] = degrees.to_radians();
    }
    let root_m = at + DVec3::new(0.0, 0.0, body().root_height_m());
    Points::of(&body(), &angles.to_pose(root_m, DQuat::from_rotation_z(heading_rad)), &[true; 13])
}

fn rows(frames: &[Points], reading: EquationReading, noise: Option<Noise>) -> Vec<FeatureRow> {
    let mut extractor = Extractor::new(Lengths::of(&body()), reading, noise);
    frames.iter().map(|frame| extractor.next(frame, 1.0 / RATE_HZ)).collect()
}

fn value(row: &FeatureRow, name: &str) -> f64 {
    row.value(Feature::named(name).expect(name))
}

#[test]
fn every_feature_has_a_name_of_its_own_and_its_mirror_image_mirrors_back() {
    let names: std::collections::BTreeSet<String> = Feature::all().map(Feature::name).collect();
    assert_eq!(names.len(), FEATURES);
    for feature in Feature::all() {
        assert_eq!(Feature::named(&feature.name()), Some(feature));
        let (other, sign) = feature.mirrored();
        assert_eq!(other.mirrored(), (feature, sign), "{}", feature.name());
    }
}

#[test]
fn a_glide_is_forward_left_and_up_whatever_way_the_person_faces() {
    let leg_m = Lengths::of(&body()).leg_m();
    for heading_rad in [0.0, 1.0, 4.0] {
        let turn = DQuat::from_rotation_z(heading_rad);
        // In legs per second: 2 forward, 1 to the left, 0.5 up.
        let per_frame = DVec3::new(2.0, 1.0, 0.5) * leg_m / RATE_HZ;
        let frames: Vec<Points> =
            (0..6).map(|n| standing(turn * (per_frame * f64::from(n)), heading_rad, &[])).collect();
        for reading in [EquationReading::Repaired, EquationReading::Strict] {
            let rows = rows(&frames, reading, None);
            for part in ["root", "torso", "left_foot", "right_foot"] {
                let seen = ["frontal", "vertical", "sagittal"]
                    .map(|axis| value(&rows[5], &format!("{part}_{axis}")));
                for (seen, expected) in seen.into_iter().zip([2.0, 0.5, 1.0]) {
                    assert!((seen - expected).abs() < 1e-9, "{part} {seen} {expected}");
                }
            }
        }
    }
}

#[test]
fn strictly_one_axis_beyond_the_noise_of_one_axis_is_motion() {
    let noise = Noise { axis_m: 0.001, norm_m: 0.001, rate_hz: RATE_HZ };
    for (moved_m, dynamic) in [(0.0009, 0.0), (0.0011, 1.0)] {
        let frames = [standing(DVec3::ZERO, 0.0, &[]), standing(DVec3::X * moved_m, 0.0, &[])];
        let rows = rows(&frames, EquationReading::Strict, Some(noise));
        assert_eq!(value(&rows[1], "dynamic"), dynamic, "{moved_m}");
        assert!(value(&rows[0], "dynamic").is_nan(), "nothing is before the first frame");
    }
}

#[test]
fn noise_is_that_of_the_quietest_half_second_and_a_walk_has_none() {
    let mut frames: Vec<Points> =
        (0..60).map(|n| standing(DVec3::X * 0.05 * f64::from(n), 0.0, &[])).collect();
    let moving = Noise::of_quietest(&frames, RATE_HZ).expect("long enough");
    assert!(!moving.is_still(&Lengths::of(&body())));
    // Then it trembles: 1 mm to and fro along two axes.
    let rest = DVec3::X * 0.05 * 59.0;
    let shake = DVec3::new(0.001, 0.001, 0.0);
    frames.extend((0..30).map(|n| standing(rest + shake * f64::from(n % 2), 0.0, &[])));
    let noise = Noise::of_quietest(&frames, RATE_HZ).expect("long enough");
    assert!((noise.axis_m - 0.001).abs() < 1e-9 && noise.is_still(&Lengths::of(&body())));
    assert!((noise.norm_m - 0.001 * 2f64.sqrt()).abs() < 1e-9, "{noise:?}");
    assert_eq!(Noise::of_quietest(&frames[..3], RATE_HZ), None);
}

/// A body that slides without stepping, in m/s.
fn slide(m_s: f64, frames: u32) -> Vec<Points> {
    (0..frames).map(|n| standing(DVec3::X * m_s / RATE_HZ * f64::from(n), 0.0, &[])).collect()
}

#[test]
fn a_way_longer_than_the_shank_is_locomotion_and_a_shorter_one_is_not() {
    // 1 m/s: the shank of 0.43 m is passed in 13 frames.
    let rows = rows(&slide(1.0, 20), EquationReading::Strict, None);
    let first = rows.iter().position(|row| value(row, "locomotive") == 1.0).expect("a way");
    let tibia_m = Lengths::of(&body()).tibia_m;
    assert_eq!(first, (tibia_m * RATE_HZ).ceil() as usize);
}

#[test]
fn a_root_that_moves_against_its_feet_goes_nowhere() {
    let mut frames = slide(1.0, 30);
    for (n, points) in frames.iter_mut().enumerate() {
        for place in [BodyPoint::LeftFoot, BodyPoint::RightFoot] {
            points[place] -= DVec3::X * 2.0 / RATE_HZ * n as f64;
        }
    }
    for reading in [EquationReading::Repaired, EquationReading::Strict] {
        assert!(rows(&frames, reading, None).iter().all(|row| value(row, "locomotive") != 1.0));
    }
}

#[test]
fn one_fixed_foot_and_one_that_goes_along_is_locomotion_by_equations_4_and_5() {
    for fixed in [BodyPoint::LeftFoot, BodyPoint::RightFoot] {
        let mut frames = slide(1.0, 30);
        let stays = frames[0][fixed];
        for points in &mut frames {
            points[fixed] = stays;
        }
        let rows = rows(&frames, EquationReading::Repaired, None);
        assert_eq!(value(&rows[29], "locomotive"), 1.0);
    }
}

#[test]
fn a_hand_held_level_beside_the_chest_is_measured_in_arms() {
    let raised = standing(DVec3::ZERO, 2.0, &[(Dof::LeftShoulderAbduction, 90.0)]);
    let row = &rows(&[raised], EquationReading::Repaired, None)[0];
    // The shoulder is 0.129 statures beside the chest and as high as it.
    let arm = 1.0 + 0.129 / (0.186 + 0.146);
    assert!((value(row, "left_hand_out") - arm).abs() < 1e-9);
    assert!(value(row, "left_hand_height").abs() < 1e-9);
    assert!((value(row, "right_hand_height") + 1.0).abs() < 1e-9, "it hangs");
    assert!((value(row, "left_leg") - 1.0).abs() < 1e-9);
}

#[test]
fn without_arms_their_features_are_unknown_and_the_others_are_not() {
    let mut points = standing(DVec3::ZERO, 0.0, &[]);
    points[BodyPoint::LeftHand] = DVec3::NAN;
    let rows = rows(&[points, points], EquationReading::Repaired, None);
    for name in ["left_hand_height", "left_hand_frontal", "hands_apart", "left_hand_contact"] {
        assert!(value(&rows[1], name).is_nan(), "{name}");
    }
    for name in ["right_hand_height", "root_frontal", "standing", "dynamic", "locomotive"] {
        assert!(!value(&rows[1], name).is_nan(), "{name}");
    }
}
