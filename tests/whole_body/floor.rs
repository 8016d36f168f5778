//! A foot with a rod on it, on a floor.

use gaitway::rigid::{Drive, JointKind, Mass, Moving, Placement, Tree, TreeLink};
use glam::DVec3;

const GRAVITY: f64 = 9.81;
const SLACK: Drive = Drive {
    stiffness_nm_rad: 0.0,
    damping_nm_s_rad: 0.0,
    armature_kg_m2: 0.0,
    friction_nm: 0.0,
    torque_nm: 1.0,
};

fn link(name: &str, parent: Option<usize>, kind: JointKind, at_m: DVec3, mass: Mass) -> TreeLink {
    TreeLink {
        name: name.to_owned(),
        parent,
        kind,
        origin: Placement::at(at_m),
        axis: if kind == JointKind::Fixed { DVec3::ZERO } else { DVec3::Y },
        anchor_m: DVec3::ZERO,
        mass,
    }
}

/// A foot of 10 cm with a rod on it that turns about its y axis.
fn standing() -> Tree {
    let foot = Mass::of_radii(0.5, DVec3::Z * 0.01, DVec3::splat(0.03));
    let rod = Mass::of_radii(1.0, DVec3::Z * 0.2, DVec3::splat(0.05));
    Tree::new(
        vec![
            link("foot", None, JointKind::Fixed, DVec3::ZERO, foot),
            link("rod", Some(0), JointKind::Hinge, DVec3::Z * 0.02, rod),
        ],
        Vec::new(),
    )
    .expect("a tree")
}

fn corners() -> Vec<(usize, DVec3)> {
    let signs = [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)];
    signs.map(|(x, y)| (0, DVec3::new(0.05 * x, 0.04 * y, 0.0))).to_vec()
}

#[test]
fn who_has_no_floor_falls_as_fast_as_all_do() {
    let tree = standing();
    let base = Placement::at(DVec3::Z * 10.0);
    let mut moving = Moving::at_rest(&tree, 1.0, GRAVITY, corners(), base, &[0.4]);
    for _ in 0..500 {
        assert!(moving.drive(&[SLACK], &[0.0], 0.001));
    }
    // A step too long by half of one.
    let fallen_m = 10.0 - moving.base().at_m.z;
    assert!((fallen_m - GRAVITY / 2.0 * 0.25).abs() < GRAVITY * 0.5 * 0.001, "{fallen_m}");
    assert!((moving.angles()[0] - 0.4).abs() < 1e-9);
}

#[test]
fn a_rod_on_a_spring_sags_to_where_its_weight_is_held() {
    let tree = standing();
    let drive = Drive { stiffness_nm_rad: 6.0, damping_nm_s_rad: 0.5, ..SLACK };
    let goal = 0.1;
    let mut moving = Moving::at_rest(&tree, 1.0, GRAVITY, corners(), Placement::IDENTITY, &[goal]);
    for _ in 0..3000 {
        assert!(moving.drive(&[drive], &[goal], 0.002));
    }
    let angle = moving.angles()[0];
    let held_nm = 6.0 * (angle - goal);
    let weight_nm = GRAVITY * 0.2 * angle.sin();
    assert!((held_nm - weight_nm).abs() < 0.01 * weight_nm, "{held_nm} {weight_nm}");
    assert!(moving.base().at_m.z > -2e-3, "{:?}", moving.base());
}

#[test]
fn a_stiff_rod_tips_about_the_edge_that_its_weight_is_over_and_no_sooner() {
    let tree = standing();
    let drive = Drive { stiffness_nm_rad: 500.0, damping_nm_s_rad: 5.0, torque_nm: 9.0, ..SLACK };
    let tilted = |goal: f64| {
        let mut moving =
            Moving::at_rest(&tree, 1.0, GRAVITY, corners(), Placement::IDENTITY, &[goal]);
        for _ in 0..1000 {
            assert!(moving.drive(&[drive], &[goal], 0.002));
        }
        (moving.base().turn * DVec3::Z).angle_between(DVec3::Z)
    };
    // Its weight, 1 of 1.5 kg at 0.2 m, is over the edge at 0.05 m from here on:
    let edge = (0.05_f64 * 1.5 / 0.2).asin();
    assert!(tilted(edge - 0.04) < 0.05, "{}", tilted(edge - 0.04));
    assert!(tilted(edge + 0.04) > 0.5, "{}", tilted(edge + 0.04));
}

#[test]
fn a_rod_with_friction_stays_while_that_holds_its_weight_and_falls_beyond() {
    let tree = standing();
    let tilted = |friction_nm: f64| {
        let drive = Drive { friction_nm, ..SLACK };
        let mut moving =
            Moving::at_rest(&tree, 1.0, GRAVITY, corners(), Placement::IDENTITY, &[0.2]);
        for _ in 0..500 {
            assert!(moving.drive(&[drive], &[0.0], 0.002));
        }
        moving.angles()[0] - 0.2
    };
    // 1 kg at 0.2 m, tilted by 0.2 rad. What holds creeps by 2 mrad/s at most.
    let weight_nm = GRAVITY * 0.2 * 0.2_f64.sin();
    assert!(tilted(1.1 * weight_nm) < 0.003, "{}", tilted(1.1 * weight_nm));
    assert!(tilted(0.9 * weight_nm) > 0.2, "{}", tilted(0.9 * weight_nm));
    assert!(tilted(0.0) > tilted(0.9 * weight_nm));
}

#[test]
fn a_rod_on_a_spring_with_friction_comes_to_rest_short_of_its_goal_by_no_more_than_that_holds() {
    let tree = standing();
    let drive = Drive { stiffness_nm_rad: 50.0, friction_nm: 0.5, torque_nm: 30.0, ..SLACK };
    let mut moving = Moving::at_rest(&tree, 1.0, 0.0, corners(), Placement::IDENTITY, &[0.0]);
    for _ in 0..1500 {
        assert!(moving.drive(&[drive], &[0.1], 0.002));
    }
    let off_rad = (moving.angles()[0] - 0.1).abs();
    assert!(off_rad < 0.5 / 50.0 + 1e-3, "{off_rad}");
    assert!(off_rad > 1e-4, "{off_rad}");
}

#[test]
fn a_swung_rod_drives_its_foot_back_on_ice_and_not_on_a_rough_floor() {
    let tree = standing();
    let drive = Drive { stiffness_nm_rad: 3.0, damping_nm_s_rad: 0.1, torque_nm: 9.0, ..SLACK };
    let swung = |friction: f64| {
        let mut moving =
            Moving::at_rest(&tree, friction, GRAVITY, corners(), Placement::IDENTITY, &[0.0]);
        let centre = |of: &Moving| tree.centre_of_mass_m(&of.placed()).x;
        for _ in 0..60 {
            assert!(moving.drive(&[drive], &[0.15], 0.001));
        }
        (moving.base().at_m.x, centre(&moving))
    };
    let (foot_m, centre_m) = swung(0.0);
    // Nothing pushes along: the centre of mass stays where it is.
    assert!(foot_m < -1e-3 && centre_m.abs() < 0.05 * foot_m.abs(), "{foot_m} {centre_m}");
    let (foot_m, centre_m) = swung(1.0);
    assert!(foot_m.abs() < 2e-4 && centre_m > 1e-3, "{foot_m} {centre_m}");
}

#[test]
fn a_push_gives_a_body_its_impulse_and_no_more() {
    let tree = standing();
    let base = Placement::at(DVec3::Z * 10.0);
    let mut moving = Moving::at_rest(&tree, 1.0, 0.0, corners(), base, &[0.4]);
    let force_n = DVec3::new(3.0, -1.0, 0.5);
    let centre_m = |moving: &Moving| tree.centre_of_mass_m(&moving.placed());
    moving.disturb(vec![(1, force_n)], [0.0; 2]);
    for _ in 0..200 {
        assert!(moving.drive(&[SLACK], &[0.0], 0.001));
    }
    moving.disturb(Vec::new(), [0.0; 2]);
    let before_m = centre_m(&moving);
    for _ in 0..100 {
        assert!(moving.drive(&[SLACK], &[0.0], 0.001));
    }
    // 0.2 s on 1.5 kg, wherever it was pushed.
    let velocity = (centre_m(&moving) - before_m) / 0.1;
    let wanted = force_n * 0.2 / 1.5;
    assert!(velocity.distance(wanted) < 0.02 * wanted.length(), "{velocity} {wanted}");
}

#[test]
fn on_a_slope_a_body_stands_while_friction_holds_it_and_slides_as_a_block_beyond() {
    let tree = standing();
    let drive = Drive { stiffness_nm_rad: 500.0, damping_nm_s_rad: 5.0, ..SLACK };
    let drive = Drive { torque_nm: 9.0, ..drive };
    let friction = 0.1;
    let slid = |slope_rad: [f64; 2]| {
        let mut moving =
            Moving::at_rest(&tree, friction, GRAVITY, corners(), Placement::IDENTITY, &[0.0]);
        moving.disturb(Vec::new(), slope_rad);
        for _ in 0..1000 {
            assert!(moving.drive(&[drive], &[0.0], 0.0005));
        }
        moving.base().at_m
    };
    assert!(slid([0.08, 0.0]).length() < 1e-3, "tan 0.08 is below 0.1");
    for (way, slope_rad) in [(DVec3::X, [0.14, 0.0]), (DVec3::NEG_Y, [0.0, -0.14])] {
        // Half a second downhill, by g (sin - friction cos).
        let wanted_m = GRAVITY * (0.14_f64.sin() - friction * 0.14_f64.cos()) * 0.125;
        let along_m = slid(slope_rad).dot(way);
        assert!((along_m - wanted_m).abs() < 0.05 * wanted_m, "{along_m} {wanted_m}");
    }
}
