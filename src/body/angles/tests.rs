use core::f64::consts::FRAC_PI_2;

use super::*;
use proptest::prelude::*;

fn axis_of(dof: Dof, degrees: f64, segment: Segment, axis: DVec3) -> DVec3 {
    let mut angles = JointAngles::default();
    angles[dof] = degrees.to_radians();
    angles.to_pose(DVec3::ZERO, DQuat::IDENTITY).orientation[segment.index()] * axis
}

fn along(dof: Dof, segment: Segment) -> DVec3 {
    axis_of(dof, 30.0, segment, segment.long_axis())
}

#[test]
fn positive_angles_move_the_body_in_the_direction_they_are_named_for() {
    use Segment::*;
    for (dof, segment) in [
        (Dof::LeftShoulderFlexion, LeftUpperArm),
        (Dof::RightShoulderFlexion, RightUpperArm),
        (Dof::LeftElbowFlexion, LeftForearm),
        (Dof::RightElbowFlexion, RightForearm),
        (Dof::LeftHipFlexion, LeftThigh),
        (Dof::RightHipFlexion, RightThigh),
        (Dof::TorsoFlexion, Torso),
        (Dof::NeckFlexion, Head),
    ] {
        assert!((along(dof, segment).x - 0.5).abs() < 1e-12, "{}: forward", dof.name());
    }
    for (dof, segment) in [(Dof::LeftKneeFlexion, LeftShank), (Dof::RightKneeFlexion, RightShank)] {
        assert!((along(dof, segment).x - -0.5).abs() < 1e-12, "{}: backward", dof.name());
    }
    for (dof, segment) in
        [(Dof::LeftAnkleDorsiflexion, LeftFoot), (Dof::RightAnkleDorsiflexion, RightFoot)]
    {
        assert!((along(dof, segment).z - 0.5).abs() < 1e-12, "{}: toes up", dof.name());
    }
    for (dof, segment, y) in [
        (Dof::LeftShoulderAbduction, LeftUpperArm, 0.5),
        (Dof::RightShoulderAbduction, RightUpperArm, -0.5),
        (Dof::LeftHipAbduction, LeftThigh, 0.5),
        (Dof::RightHipAbduction, RightThigh, -0.5),
        (Dof::TorsoLateralBend, Torso, 0.5),
    ] {
        assert!((along(dof, segment).y - y).abs() < 1e-12, "{}", dof.name());
    }
    // The front of a limb that rotates inwards turns towards the other side.
    for (dof, segment, y) in [
        (Dof::LeftShoulderRotation, LeftUpperArm, -0.5),
        (Dof::RightShoulderRotation, RightUpperArm, 0.5),
        (Dof::LeftHipRotation, LeftThigh, -0.5),
        (Dof::RightHipRotation, RightThigh, 0.5),
        (Dof::TorsoAxial, Torso, 0.5),
    ] {
        assert!((axis_of(dof, 30.0, segment, DVec3::X).y - y).abs() < 1e-12, "{}", dof.name());
    }
}

#[test]
fn in_n_pose_every_segment_has_the_orientation_of_the_root() {
    let root = DQuat::from_rotation_z(0.7) * DQuat::from_rotation_x(0.2);
    let pose = JointAngles::default().to_pose(DVec3::new(1.0, 2.0, 3.0), root);
    for orientation in pose.orientation {
        assert!(orientation.angle_between(root) < 1e-7);
    }
    assert_eq!(pose.root_m, DVec3::new(1.0, 2.0, 3.0));
    let back = JointAngles::of_pose(&pose);
    assert!(back.angles.0.iter().all(|angle| angle.abs() < 1e-12));
    assert!(back.near_singular.is_empty());
}

#[test]
fn rotations_are_intrinsic_in_the_order_flexion_abduction_rotation() {
    // Flexion of 90 deg points the arm forward; abduction then turns it about its new X, which
    // still points... forward became up, so the arm swings to the left in the horizontal plane.
    let mut angles = JointAngles::default();
    angles[Dof::LeftShoulderFlexion] = FRAC_PI_2;
    angles[Dof::LeftShoulderAbduction] = 30f64.to_radians();
    let pose = angles.to_pose(DVec3::ZERO, DQuat::IDENTITY);
    let arm = pose.orientation[Segment::LeftUpperArm.index()] * DVec3::NEG_Z;
    let expected = DVec3::new(30f64.to_radians().cos(), 0.5, 0.0);
    assert!((arm - expected).length() < 1e-12, "{arm}");
}

#[test]
fn t_pose_is_reported_as_singular_and_still_described() {
    for side in [Dof::LeftShoulderAbduction, Dof::RightShoulderAbduction] {
        let mut angles = JointAngles::default();
        angles[side] = FRAC_PI_2;
        let pose = angles.to_pose(DVec3::ZERO, DQuat::IDENTITY);
        let got = JointAngles::of_pose(&pose);
        assert_eq!(got.near_singular, [side.joint()]);
        for (a, b) in got.angles.0.iter().zip(angles.0) {
            assert!((a - b).abs() < 1e-6, "{got:?}");
        }
    }
}

#[test]
fn in_a_singular_pose_all_turning_counts_as_rotation() {
    for (abduction, rotation) in [
        (Dof::LeftShoulderAbduction, Dof::LeftShoulderRotation),
        (Dof::RightShoulderAbduction, Dof::RightShoulderRotation),
        (Dof::LeftHipAbduction, Dof::LeftHipRotation),
    ] {
        for abducted in [FRAC_PI_2, -FRAC_PI_2] {
            let mut angles = JointAngles::default();
            angles[abduction] = abducted;
            angles[rotation] = 0.4;
            let pose = angles.to_pose(DVec3::ZERO, DQuat::IDENTITY);
            // A neighbour that forbids the other way of saying the same.
            let got = JointAngles::of_pose_after(&pose, &angles).angles;
            for dof in Dof::ALL {
                assert!((got[dof] - angles[dof]).abs() < 1e-6, "{}: {got:?}", dof.name());
            }
        }
    }
}

#[test]
fn a_sideways_raise_past_the_singularity_stays_continuous() {
    let mut before = JointAngles::default();
    for degrees in 0..=150 {
        let mut angles = JointAngles::default();
        angles[Dof::RightShoulderAbduction] = f64::from(degrees).to_radians();
        let pose = angles.to_pose(DVec3::ZERO, DQuat::IDENTITY);
        let got = JointAngles::of_pose_after(&pose, &before).angles;
        for dof in Dof::ALL {
            assert!((got[dof] - angles[dof]).abs() < 1e-6, "{degrees} deg, {}", dof.name());
        }
        let alone = JointAngles::of_pose(&pose).angles;
        assert!(
            (alone[Dof::RightShoulderAbduction] - angles[Dof::RightShoulderAbduction]).abs() < 1e-6
        );
        before = got;
    }
}

#[test]
fn a_turned_forearm_is_reported_as_not_modelled() {
    let mut angles = JointAngles::default();
    angles[Dof::LeftElbowFlexion] = 0.8;
    let mut pose = angles.to_pose(DVec3::ZERO, DQuat::IDENTITY);
    let forearm = Segment::LeftForearm.index();
    pose.orientation[forearm] *= DQuat::from_rotation_z(0.3);
    let got = JointAngles::of_pose(&pose);
    assert!((got.angles[Dof::LeftElbowFlexion] - 0.8).abs() < 1e-12);
    assert!((got.unmodelled_rad[forearm] - 0.3).abs() < 1e-12);
    assert_eq!(got.unmodelled_rad.iter().filter(|left| **left > 1e-7).count(), 1);
}

/// Angles inside the anatomical ranges, abduction short of the singularity.
fn angles() -> impl Strategy<Value = JointAngles> {
    prop::array::uniform22(0.01..0.99).prop_map(|parts| {
        let mut angles = JointAngles::default();
        for dof in Dof::ALL {
            let (lower, upper) = dof.range_rad();
            let upper = upper.min(if dof.name().ends_with("abduction") { 1.4 } else { PI - 0.01 });
            angles[dof] = lower + (upper - lower) * parts[dof.index()];
        }
        angles
    })
}

proptest! {
    #[test]
    fn angles_survive_the_way_through_orientations(angles in angles(), turn in -3.0..3.0) {
        let root = DQuat::from_rotation_z(turn) * DQuat::from_rotation_y(0.3 * turn);
        let pose = angles.to_pose(DVec3::ZERO, root);
        let after = JointAngles::of_pose_after(&pose, &angles);
        for dof in Dof::ALL {
            prop_assert!((after.angles[dof] - angles[dof]).abs() < 1e-9, "{}", dof.name());
        }
        prop_assert!(after.unmodelled_rad.iter().all(|left| left.abs() < 1e-7));
        let alone = JointAngles::of_pose(&pose).angles;
        for dof in Dof::ALL {
            prop_assert!((alone[dof] - angles[dof]).abs() < 1e-9, "{}", dof.name());
        }
    }

    #[test]
    fn any_orientation_of_a_ball_joint_is_described_exactly(
        (x, y, z, w) in (-1.0..1.0, -1.0..1.0, -1.0..1.0, -1.0..1.0f64),
    ) {
        let turned = DQuat::from_xyzw(x, y, z, w);
        prop_assume!(turned.length() > 0.1);
        let mut pose = JointAngles::default().to_pose(DVec3::ZERO, DQuat::IDENTITY);
        pose.orientation[Segment::LeftThigh.index()] = turned.normalize();
        let got = JointAngles::of_pose(&pose).angles;
        let again = got.to_pose(DVec3::ZERO, DQuat::IDENTITY);
        let left = again.orientation[Segment::LeftThigh.index()].inverse() * turned.normalize();
        prop_assert!(left.xyz().length() < 1e-7, "{}", left);
    }
}
