use super::*;
use crate::body::{BodyFigure, Dof, JointAngles, Proportions};
use crate::recognise::contact::Floor;
use glam::DQuat;

const STATURE_M: f64 = 1.8;
const QUARTER: f64 = core::f64::consts::FRAC_PI_2;

fn body() -> Proportions {
    Proportions::of_figure(BodyFigure::DrillisContini, STATURE_M).expect("a body")
}

fn lengths() -> Lengths {
    Lengths::of(&body())
}

/// A pose with its root so high above a ground that is there already.
fn posed(set: &[(Dof, f64)], turn: DQuat, root_m: f64) -> Points {
    let mut angles = JointAngles::default();
    for (dof, degrees) in set {
        angles[*dof] = degrees.to_radians();
    }
    Points::of(&body(), &angles.to_pose(DVec3::new(0.0, 0.0, root_m), turn), &[true; 13])
}

fn contacts(points: &Points) -> Contacts {
    let still = Points([DVec3::ZERO; 13]);
    let mut floor = Floor::new(lengths());
    floor.next(&posed(&[], DQuat::IDENTITY, body().root_height_m()), &still, 0.01);
    let mut found = Contacts::default();
    for _ in 0..2 {
        found = floor.next(points, &still, 0.01);
    }
    found
}

fn seen(points: &Points, reading: EquationReading) -> PostureState {
    posture(points, &Axes::of(points), &lengths(), &contacts(points), reading)
}

fn major(points: &Points) -> Option<MajorPosture> {
    seen(points, EquationReading::Repaired).major
}

const SQUAT: [(Dof, f64); 6] = [
    (Dof::LeftHipFlexion, 115.0),
    (Dof::RightHipFlexion, 115.0),
    (Dof::LeftKneeFlexion, 140.0),
    (Dof::RightKneeFlexion, 140.0),
    (Dof::LeftAnkleDorsiflexion, 35.0),
    (Dof::RightAnkleDorsiflexion, 35.0),
];

#[test]
fn who_stands_upright_stands_and_who_bends_by_more_than_30_degrees_stands_bent() {
    let height_m = body().root_height_m();
    for (degrees, upright) in [(0.0, true), (20.0, true), (50.0, false)] {
        // The chest hangs on a joint above the root, so the line from root to chest leans less.
        let state = seen(
            &posed(&[(Dof::TorsoFlexion, degrees)], DQuat::IDENTITY, height_m),
            EquationReading::Repaired,
        );
        assert_eq!(state.major, Some(MajorPosture::Standing), "{degrees}");
        assert_eq!(state.upright, Some(upright), "{degrees}");
    }
}

#[test]
fn equation_6_read_strictly_lets_nobody_stand_on_the_left_leg_alone() {
    // The right leg is raised level: its inclination is 90 degrees.
    let level = posed(&[(Dof::RightHipFlexion, 90.0)], DQuat::IDENTITY, body().root_height_m());
    assert_eq!(seen(&level, EquationReading::Repaired).major, Some(MajorPosture::Standing));
    assert_ne!(seen(&level, EquationReading::Strict).major, Some(MajorPosture::Standing));
    // Seen in a mirror the strict reading is content.
    let other = posed(&[(Dof::LeftHipFlexion, 90.0)], DQuat::IDENTITY, body().root_height_m());
    assert_eq!(seen(&other, EquationReading::Strict).major, Some(MajorPosture::Standing));
}

#[test]
fn a_knee_bent_by_82_degrees_still_stands_by_equation_6_and_by_84_does_not() {
    // Thigh and shank are nearly alike: the hip is 2 femurs cos(bend / 2) from the foot, which is 1.5
    // at a bend of 82.8 degrees.
    for (bend, stands) in [(80.0_f64, true), (86.0, false)] {
        let half = bend / 2.0;
        let pose = [
            (Dof::LeftHipFlexion, half),
            (Dof::RightHipFlexion, half),
            (Dof::LeftKneeFlexion, bend),
            (Dof::RightKneeFlexion, bend),
            (Dof::LeftAnkleDorsiflexion, half),
            (Dof::RightAnkleDorsiflexion, half),
        ];
        let leg_m: f64 = 2.0 * lengths().femur_m * half.to_radians().cos();
        let points = posed(&pose, DQuat::IDENTITY, leg_m + 0.039 * STATURE_M);
        assert_eq!(major(&points) == Some(MajorPosture::Standing), stands, "{bend}");
    }
}

#[test]
fn who_squats_squats_and_on_a_stage_only_by_the_repaired_reading() {
    let low_m = 0.039 * STATURE_M + 0.2 * lengths().femur_m;
    let squat = posed(&SQUAT, DQuat::IDENTITY, low_m);
    let squats = |points: &Points, floor_m: f64, reading: EquationReading| {
        let contacts = Contacts { floor_m, feet: [Some(true); 2], ..contacts(&squat) };
        let axes = Axes::of(points);
        let lengths = lengths();
        Frame::of(points, &axes, &lengths, &contacts, reading).squatting()
    };
    assert_eq!(squats(&squat, 0.0, EquationReading::Repaired), Some(true));
    assert_eq!(squats(&squat, 0.0, EquationReading::Strict), Some(true));
    assert_eq!(seen(&squat, EquationReading::Repaired).symmetric, Some(true));
    let raised = Points(squat.0.map(|at| at + DVec3::Z));
    assert_eq!(squats(&raised, 1.0, EquationReading::Repaired), Some(true));
    assert_eq!(squats(&raised, 1.0, EquationReading::Strict), Some(false));
}

#[test]
fn who_kneels_on_both_knees_kneels_symmetrically() {
    // The feet are stretched, so that the toes do not hold the knees up.
    let pose = [
        (Dof::LeftKneeFlexion, 90.0),
        (Dof::RightKneeFlexion, 90.0),
        (Dof::LeftAnkleDorsiflexion, -90.0),
        (Dof::RightAnkleDorsiflexion, -90.0),
    ];
    let points = posed(&pose, DQuat::IDENTITY, lengths().femur_m + 0.05);
    let state = seen(&points, EquationReading::Repaired);
    assert_eq!((state.major, state.symmetric), (Some(MajorPosture::Kneeling), Some(true)));
    let one = [
        (Dof::LeftKneeFlexion, 90.0),
        (Dof::LeftAnkleDorsiflexion, -90.0),
        (Dof::RightHipFlexion, 90.0),
        (Dof::RightKneeFlexion, 90.0),
    ];
    let state =
        seen(&posed(&one, DQuat::IDENTITY, lengths().femur_m + 0.05), EquationReading::Repaired);
    assert_eq!((state.major, state.symmetric), (Some(MajorPosture::Kneeling), Some(false)));
}

#[test]
fn who_sits_on_a_chair_has_the_mass_behind_the_feet() {
    let pose = [
        (Dof::LeftHipFlexion, 90.0),
        (Dof::RightHipFlexion, 90.0),
        (Dof::LeftKneeFlexion, 90.0),
        (Dof::RightKneeFlexion, 90.0),
    ];
    let points = posed(&pose, DQuat::IDENTITY, lengths().tibia_m + 0.039 * STATURE_M);
    let state = seen(&points, EquationReading::Repaired);
    assert_eq!((state.major, state.on_floor), (Some(MajorPosture::Sitting), Some(false)));
}

#[test]
fn who_lies_lies_on_the_back_the_belly_or_the_side_and_who_stands_on_hands_does_not() {
    let lies = |turn: DQuat| seen(&posed(&[], turn, 0.1), EquationReading::Repaired);
    let back = lies(DQuat::from_rotation_y(-QUARTER));
    assert_eq!(back.major, Some(MajorPosture::Lying));
    assert_eq!((back.on_back, back.on_belly), (Some(true), Some(false)));
    let belly = lies(DQuat::from_rotation_y(QUARTER));
    assert_eq!((belly.on_back, belly.on_belly), (Some(false), Some(true)));
    let side = lies(DQuat::from_rotation_x(QUARTER));
    assert_eq!((side.major, side.sideways), (Some(MajorPosture::Lying), Some(true)));
    assert_eq!((side.on_back, side.on_belly), (Some(false), Some(false)));

    let hands = posed(&[], DQuat::from_rotation_y(2.0 * QUARTER), 1.6);
    assert_ne!(major(&hands), Some(MajorPosture::Lying));
    let (axes, lengths, contacts) = (Axes::of(&hands), lengths(), contacts(&hands));
    let frame = Frame::of(&hands, &axes, &lengths, &contacts, EquationReading::Strict);
    assert_eq!(frame.lying(), Some(true));
}

#[test]
fn a_front_turned_by_30_degrees_lies_on_the_back_and_strictly_on_nothing() {
    // Rolled by 20 degrees (hips still level by Eq. 13) and pitched by 20: 28 degrees off.
    let turn = DQuat::from_rotation_x(20f64.to_radians())
        * DQuat::from_rotation_y(-70f64.to_radians() - 0.1);
    let points = posed(&[], turn, 0.3);
    assert_eq!(seen(&points, EquationReading::Repaired).on_back, Some(true));
    assert_eq!(seen(&points, EquationReading::Strict).on_back, Some(false));
}

#[test]
fn hands_and_feet_on_the_ground_carry_a_body() {
    let stand = posed(&[], DQuat::IDENTITY, body().root_height_m());
    let mut found = contacts(&stand);
    found.hands = [Some(true), Some(true)];
    let of = |contacts: &Contacts| {
        posture(&stand, &Axes::of(&stand), &lengths(), contacts, EquationReading::Repaired).major
    };
    assert_eq!(of(&found), Some(MajorPosture::FourSupported));
    // With one hand it is Eq. 17, after all others: here somebody stands.
    found.hands[0] = Some(false);
    assert_eq!(of(&found), Some(MajorPosture::Standing));
}

#[test]
fn what_is_not_shown_is_not_guessed() {
    let mut points = posed(&[], DQuat::IDENTITY, body().root_height_m());
    for place in
        [BodyPoint::LeftFoot, BodyPoint::RightFoot, BodyPoint::LeftKnee, BodyPoint::RightKnee]
    {
        points[place] = DVec3::NAN;
    }
    points[BodyPoint::LeftToe] = DVec3::NAN;
    points[BodyPoint::RightToe] = DVec3::NAN;
    let state = seen(&points, EquationReading::Repaired);
    assert_eq!(state.major, None);
    assert_eq!(state.upright, Some(true));
    assert_eq!(state.symmetric, None);
}

#[test]
fn a_point_is_as_far_from_a_square_as_from_its_nearest_edge() {
    let square = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(DVec2::from);
    assert!((outside_hull_m(DVec2::new(0.5, 0.4), &square) + 0.4).abs() < 1e-12);
    assert!((outside_hull_m(DVec2::new(2.0, 2.0), &square) - 2f64.sqrt()).abs() < 1e-12);
    // Two feet in one line, and all in one point.
    let line = [(0.0, 0.0), (1.0, 0.0), (0.5, 0.0), (0.2, 0.0)].map(DVec2::from);
    assert!((outside_hull_m(DVec2::new(0.5, 0.3), &line) - 0.3).abs() < 1e-12);
    assert!((outside_hull_m(DVec2::new(3.0, 4.0), &[DVec2::ZERO; 4]) - 5.0).abs() < 1e-12);
}
