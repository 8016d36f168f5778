//! Links that meet: two legs that are turned towards one another.

use super::*;
use crate::rigid::{Capsule, Mass, TreeLink, Volume};

/// Half of how far the hips are apart, how long legs are and how thick, m.
const HIP_M: f64 = 0.1;
const LEG_M: f64 = 0.3;
const RADIUS_M: f64 = 0.02;
/// What each weighs, in its middle, kg.
const LEG_KG: f64 = 0.4;
/// Torque that closes them, N m.
const CLOSES_NM: f64 = 1.2;
const GRAVITY_M_S2: f64 = 9.8;

fn legs() -> Tree {
    let leg = |name: &str, side: f64| TreeLink {
        name: name.to_owned(),
        parent: Some(0),
        origin: Placement::at(DVec3::Y * (side * HIP_M)),
        anchor_m: DVec3::ZERO,
        axis: DVec3::X,
        kind: JointKind::Hinge,
        mass: Mass::of_radii(LEG_KG, DVec3::NEG_Z * LEG_M / 2.0, DVec3::new(0.09, 0.09, 0.01)),
    };
    let base = TreeLink {
        name: "base".to_owned(),
        parent: None,
        origin: Placement::IDENTITY,
        anchor_m: DVec3::ZERO,
        axis: DVec3::X,
        kind: JointKind::Fixed,
        mass: Mass::of_radii(2.0, DVec3::ZERO, DVec3::splat(0.05)),
    };
    Tree::new(vec![base, leg("left", 1.0), leg("right", -1.0)], Vec::new()).expect("a tree")
}

/// How the legs part, where they are in one another.
fn way_out(placed: &[Placement]) -> Option<((usize, usize), WayOut)> {
    let leg = |link: usize| {
        let (from_m, to_m) = (DVec3::ZERO, DVec3::NEG_Z * LEG_M);
        Volume::Capsule(Capsule { from_m, to_m, radius_m: RADIUS_M }).placed(placed[link])
    };
    let (left, right) = (leg(1), leg(2));
    let at_m = left.meeting_m(&right);
    left.way_out(&right).map(|way| ((1, 2), WayOut { at_m, ..way }))
}

/// A second and a half of closing.
fn closed(mut moving: Moving, meet: bool) -> Moving {
    // The left leg closes to the right, against the turn about X.
    let pull = |torque_nm: f64| Pull { torque_nm, gives_nm_s_rad: 0.05, armature_kg_m2: 0.001 };
    for _ in 0..1_500 {
        if meet {
            moving.meet(way_out(&moving.placed()));
        }
        assert!(moving.step(&[pull(-CLOSES_NM), pull(CLOSES_NM)], 1e-3));
    }
    moving
}

fn in_the_air() -> Moving {
    Moving::at_rest(&legs(), 1.0, GRAVITY_M_S2, [], Placement::IDENTITY, &[0.0, 0.0])
}

#[test]
fn legs_that_close_stop_where_they_meet_and_press_as_their_torque_asks() {
    let moving = closed(in_the_air().fixed(), true);
    let ((_, _), way) = way_out(&moving.placed()).expect("they touch");
    assert!(way.depth_m < 1e-3, "{} m", way.depth_m);
    // Ends of two capsules that touch are two radii apart.
    let turned_rad = ((HIP_M - RADIUS_M) / LEG_M).asin();
    for (angle_rad, side) in moving.angles().iter().zip([-1.0, 1.0]) {
        assert!((angle_rad - side * turned_rad).abs() < 5e-3, "{angle_rad} {turned_rad}");
    }
    let pressed: Vec<&LinkContact> = moving.pressed().collect();
    assert_eq!((pressed.len(), pressed[0].links), (1, (1, 2)));
    let lifts_nm = LEG_KG * GRAVITY_M_S2 * LEG_M / 2.0 * turned_rad.sin();
    let asked_n = (CLOSES_NM - lifts_nm) / (LEG_M * turned_rad.cos());
    let force_n = pressed[0].force_n;
    assert!((force_n / asked_n - 1.0).abs() < 0.02, "{force_n} N for {asked_n} N");
}

#[test]
fn legs_that_do_not_meet_go_through_one_another() {
    let moving = closed(in_the_air().fixed(), false);
    assert!(moving.angles()[0] < -1.0, "{:?}", moving.angles());
    assert_eq!(moving.pressed().count(), 0);
}

#[test]
fn legs_that_knock_together_fall_no_faster_for_it_and_do_not_turn() {
    let tree = legs();
    let moving = closed(in_the_air(), true);
    let centre_m = |moving: &Moving| tree.centre_of_mass_m(&moving.placed());
    let fallen_m = DVec3::NEG_Z * (0.5 * GRAVITY_M_S2 * 1.5 * 1.5);
    let off_m = (centre_m(&moving) - centre_m(&in_the_air()) - fallen_m).length();
    // Of 11 m that is what steps of a millisecond leave; 4 N that no other answers are a metre.
    assert!(off_m < 0.02, "the centre of mass is off by {off_m} m");
    assert!(moving.spin_rad_s().length() < 1e-6, "{}", moving.spin_rad_s());
}
