use super::*;
use crate::body::Segment;
use glam::DVec3;
use proptest::prelude::*;

const RATE_HZ: f64 = 100.0;

fn poses(angles: &[JointAngles]) -> Vec<SegmentPose> {
    angles.iter().map(|angles| angles.to_pose(DVec3::ZERO, DQuat::IDENTITY)).collect()
}

/// So many poses, in which these degrees of freedom are at these angles, deg.
fn moving(count: usize, said: impl Fn(f64) -> Vec<(Dof, f64)>) -> Vec<JointAngles> {
    let angles = (0..count).map(|at| {
        let mut angles = JointAngles::default();
        for (dof, angle_deg) in said(at as f64 / RATE_HZ) {
            angles[dof] = angle_deg.to_radians();
        }
        angles
    });
    angles.collect()
}

fn worst_deg(got: &[JointAngles], expected: &[JointAngles]) -> f64 {
    let pairs =
        got.iter().zip(expected).flat_map(|(got, expected)| got.0.into_iter().zip(expected.0));
    pairs.map(|(got, expected)| (got - expected).abs().to_degrees()).fold(0.0, f64::max)
}

fn range_deg(series: &[JointAngles], dof: Dof) -> f64 {
    let angles = || series.iter().map(|angles| angles[dof]);
    (angles().fold(f64::MIN, f64::max) - angles().fold(f64::MAX, f64::min)).to_degrees()
}

/// From T pose the arms are lowered, and swing as in walking.
fn walked() -> Vec<JointAngles> {
    moving(800, |time_s| {
        let abduction = if time_s < 1.0 { 90.0 } else { (90.0 - 45.0 * (time_s - 1.0)).max(8.0) };
        let swing = 20.0 * (TAU * time_s).sin();
        vec![
            (Dof::LeftShoulderFlexion, swing),
            (Dof::LeftShoulderAbduction, abduction),
            (Dof::LeftShoulderRotation, 30.0 + 0.3 * swing),
            (Dof::RightShoulderFlexion, -swing),
            (Dof::RightShoulderAbduction, abduction),
            (Dof::RightShoulderRotation, 25.0 - 0.3 * swing),
        ]
    })
}

#[test]
fn arms_of_a_walk_are_inside_their_ranges_wherever_the_clip_is_cut() {
    let truth = walked();
    let poses = poses(&truth);
    let whole = JointAngles::of_clip(&poses, RATE_HZ).angles;
    // Arms are down to 80 degrees of abduction after 1.3 s.
    assert!(worst_deg(&whole[130..], &truth[130..]) < 1e-6);
    for (from, to) in [(0, 400), (20, 200), (160, 480), (300, 800), (500, 510)] {
        let cut = JointAngles::of_clip(&poses[from..to], RATE_HZ).angles;
        let first = from.max(130);
        let off_deg = worst_deg(&cut[first - from..], &whole[first..to]);
        assert!(off_deg < 1e-6, "{from} to {to}: {off_deg} deg");
    }
}

#[test]
fn a_raise_through_the_singularity_goes_on_beyond_it_at_every_rate() {
    // A sample every 4 degrees of the arm, to every 52.
    for pace in [5.0, 10.0, 45.0, 70.0] {
        let truth = moving(60, |time_s| {
            let abduction = 75.0 - 75.0 * (pace * time_s).cos();
            vec![
                (Dof::LeftShoulderFlexion, 10.0),
                (Dof::LeftShoulderAbduction, abduction),
                (Dof::LeftShoulderRotation, -15.0),
                (Dof::RightShoulderFlexion, 40.0),
                (Dof::RightShoulderAbduction, abduction),
                (Dof::RightShoulderRotation, 35.0),
            ]
        });
        let got = JointAngles::of_clip(&poses(&truth), RATE_HZ);
        let off_deg = worst_deg(&got.angles, &truth);
        assert!(off_deg < 1e-6, "{pace}: {off_deg} deg");
    }
}

/// Up to T pose, eight small circles of the hand there, and down again.
fn circled(radius: f64) -> AngleSeries {
    let raise = |time_s: f64| DQuat::from_rotation_x((90.0 * time_s.clamp(0.0, 1.0)).to_radians());
    let turned = |time_s: f64| {
        let inside =
            if (1.0..5.0).contains(&time_s) { (PI * (time_s - 1.0) / 4.0).sin() } else { 0.0 };
        let at = 2.0 * TAU * time_s;
        let circle = DQuat::from_scaled_axis(DVec3::new(at.cos(), 0.0, at.sin()) * radius * inside);
        circle * raise(time_s.min(6.0 - time_s))
    };
    let poses: Vec<SegmentPose> = (0..=600)
        .map(|at| {
            let mut pose = JointAngles::default().to_pose(DVec3::ZERO, DQuat::IDENTITY);
            for segment in [Segment::LeftUpperArm, Segment::LeftForearm] {
                pose.orientation[segment.index()] = turned(f64::from(at) / RATE_HZ);
            }
            pose
        })
        .collect();
    JointAngles::of_clip(&poses, RATE_HZ)
}

#[test]
fn an_arm_that_circles_about_t_pose_does_not_wind() {
    for radius in [3f64.to_radians(), 12f64.to_radians()] {
        let got = circled(radius);
        for dof in [Dof::LeftShoulderFlexion, Dof::LeftShoulderRotation] {
            let range_deg = range_deg(&got.angles, dof);
            assert!(range_deg < 45.0, "{}: {range_deg} deg", dof.name());
        }
        let is_left = |near: &&NearSingular| near.joint == Joint::LeftShoulder;
        let left = got.near_singular.iter().find(is_left).unwrap();
        assert!(left.off_rad > 0.9 * radius && left.off_rad < 1.1 * radius, "{left:?}");
        let others: Vec<_> = got.near_singular.iter().filter(|near| !is_left(near)).collect();
        assert!(others.len() == 4 && others.iter().all(|near| near.share == 0.0), "{others:?}");
    }
    let left = circled(3f64.to_radians()).near_singular[1];
    assert!(left.joint == Joint::LeftShoulder && (0.6..0.8).contains(&left.share), "{left:?}");
}

#[test]
fn a_clip_that_is_singular_throughout_is_still_described() {
    let truth = moving(50, |_| vec![(Dof::RightShoulderAbduction, 90.0)]);
    let got = JointAngles::of_clip(&poses(&truth), RATE_HZ);
    assert!(worst_deg(&got.angles, &truth) < 1e-5);
    assert!(JointAngles::of_clip(&[], RATE_HZ).angles.is_empty());
}

#[test]
fn a_capture_that_leaps_finds_back_into_the_range() {
    // For a tenth of a second the arm is turned half round about a skew axis.
    let mut poses = poses(&walked()[200..]);
    let wrong = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 0.5).normalize(), 3.0);
    for pose in &mut poses[100..110] {
        pose.orientation[Segment::LeftUpperArm.index()] *= wrong;
        pose.orientation[Segment::LeftForearm.index()] *= wrong;
    }
    let got = JointAngles::of_clip(&poses, RATE_HZ).angles;
    let truth = &walked()[200..];
    assert!(worst_deg(&got[..100], &truth[..100]) < 1e-6);
    assert!(worst_deg(&got[110..], &truth[110..]) < 1e-6);
}

/// A smooth motion of all joints: each angle a sum of two waves.
fn waves() -> impl Strategy<Value = Vec<[f64; 4]>> {
    let wave = prop::array::uniform4(-1.0..1.0);
    prop::collection::vec(wave, 22..=22)
}

fn waved(waves: &[[f64; 4]], of: impl Fn(Dof, f64) -> f64) -> Vec<JointAngles> {
    moving(300, |time_s| {
        let angle = |dof: Dof| {
            let [a, b, c, d] = waves[dof.index()];
            let part = 0.6 * (TAU * (0.3 * time_s + a)).sin() * b;
            part + 0.4 * (TAU * (0.9 * time_s + c)).sin() * d
        };
        Dof::ALL.into_iter().map(|dof| (dof, of(dof, angle(dof)))).collect()
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn a_motion_inside_its_ranges_comes_back_as_it_was(waves in waves()) {
        let truth = waved(&waves, |dof, part| {
            let (lower, upper) = dof.range_rad();
            let upper = if dof.name().ends_with("abduction") { upper.min(1.4) } else { upper };
            let (lower, upper) = (lower.to_degrees(), upper.to_degrees());
            f64::midpoint(lower, upper) + 0.49 * (upper - lower) * part
        });
        let got = JointAngles::of_clip(&poses(&truth), RATE_HZ);
        prop_assert!(got.near_singular.iter().all(|near| near.share == 0.0));
        prop_assert!(worst_deg(&got.angles, &truth) < 1e-6);
    }

    #[test]
    fn any_motion_is_described_exactly_away_from_the_singularity(waves in waves()) {
        let truth = waved(&waves, |_, part| 170.0 * part);
        let given = poses(&truth);
        let got = JointAngles::of_clip(&given, RATE_HZ);
        for (ball, near) in BALLS.iter().zip(&got.near_singular) {
            for (angles, pose) in got.angles.iter().zip(&given) {
                let captured = relative(pose, ball.segment);
                let left = angles.against_parent(ball.segment).inverse() * captured;
                let off_rad = 2.0 * left.xyz().length().atan2(left.w.abs());
                let is_near = turns(captured, 0.0).1 < DRAWN_WITHIN_RAD.sin();
                let most = if is_near { near.off_rad + 1e-6 } else { 1e-6 };
                prop_assert!(off_rad <= most, "{:?}: {} rad", near, off_rad);
            }
        }
    }

    #[test]
    fn no_angle_jumps_where_the_pose_does_not(waves in waves()) {
        // Short of the singularity: near it flexion may turn fast.
        let truth = waved(&waves, |dof, part| {
            if dof.name().ends_with("abduction") { 70.0 * part } else { 170.0 * part }
        });
        let got = JointAngles::of_clip(&poses(&truth), RATE_HZ).angles;
        for (now, next) in got.iter().zip(&got[1..]) {
            for ball in &BALLS[1..] {
                for dof in ball.dofs {
                    prop_assert!((next[dof] - now[dof]).abs() < 0.5, "{}", dof.name());
                }
            }
        }
    }
}
