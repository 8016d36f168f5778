use super::*;
use std::f64::consts::FRAC_PI_2;

const GRAVITY: DVec3 = DVec3::new(0.0, 0.0, -9.81);

fn link(parent: Option<usize>, kind: JointKind, at_m: DVec3, axis: DVec3) -> TreeLink {
    TreeLink {
        name: "of a test".to_owned(),
        parent,
        kind,
        origin: Placement::at(at_m),
        axis,
        anchor_m: DVec3::ZERO,
        mass: Mass::NONE,
    }
}

fn weighing(mass_kg: f64, centre_m: DVec3, moments: DVec3) -> Mass {
    Mass { mass_kg, centre_m, inertia_kg_m2: DMat3::from_diagonal(moments) }
}

/// Two rods without weight in the XZ plane, a point of mass at the end of each; at zero they lie along
/// X, and turn upwards.
fn double_pendulum(lengths_m: [f64; 2], masses_kg: [f64; 2]) -> Tree {
    let mut first = link(Some(0), JointKind::Hinge, DVec3::ZERO, -DVec3::Y);
    first.mass = weighing(masses_kg[0], DVec3::X * lengths_m[0], DVec3::ZERO);
    let mut second = link(Some(1), JointKind::Hinge, DVec3::X * lengths_m[0], -DVec3::Y);
    second.mass = weighing(masses_kg[1], DVec3::X * lengths_m[1], DVec3::ZERO);
    let base = link(None, JointKind::Fixed, DVec3::ZERO, DVec3::ZERO);
    Tree::new(vec![base, first, second], Vec::new()).expect("a tree")
}

/// A chain in space with a turned link, an axis beside its link's origin, a slide and weights of
/// every kind.
fn chain() -> Tree {
    let mut base = link(None, JointKind::Fixed, DVec3::ZERO, DVec3::ZERO);
    base.mass = weighing(2.0, DVec3::new(0.01, 0.02, 0.1), DVec3::new(0.02, 0.03, 0.015));
    let mut arm = link(Some(0), JointKind::Hinge, DVec3::new(0.1, 0.0, 0.2), DVec3::Y);
    arm.origin.turn = DQuat::from_rotation_x(0.4) * DQuat::from_rotation_z(-0.9);
    arm.anchor_m = DVec3::new(0.02, 0.0, -0.01);
    arm.mass = weighing(0.7, DVec3::new(0.05, -0.01, 0.02), DVec3::new(2e-3, 3e-3, 4e-3));
    let slide_axis = DVec3::new(1.0, 2.0, -0.5).normalize();
    let mut slide = link(Some(1), JointKind::Slide, DVec3::new(0.0, 0.1, 0.05), slide_axis);
    slide.mass = weighing(0.3, DVec3::new(0.0, 0.03, 0.0), DVec3::new(1e-3, 5e-4, 1e-3));
    let hand_axis = DVec3::new(0.3, -0.2, 0.9).normalize();
    let mut hand = link(Some(2), JointKind::Hinge, DVec3::new(0.05, 0.0, 0.1), hand_axis);
    hand.mass = weighing(0.4, DVec3::new(-0.02, 0.04, 0.06), DVec3::new(1e-3, 2e-3, 1.5e-3));
    let mut leg = link(Some(0), JointKind::Hinge, DVec3::new(0.0, -0.1, -0.1), DVec3::X);
    leg.mass = weighing(0.9, DVec3::new(0.0, 0.0, -0.15), DVec3::new(4e-3, 4e-3, 5e-4));
    Tree::new(vec![base, arm, slide, hand, leg], Vec::new()).expect("a tree")
}

/// J. J. Craig, Introduction to Robotics, 3rd edition, equation 6.58: both masses at the ends.
#[test]
fn the_double_pendulum_of_a_textbook_takes_the_torques_of_that_textbook() {
    let ([l1, l2], [m1, m2], g) = ([0.4, 0.3], [1.5, 0.8], 9.81);
    let tree = double_pendulum([l1, l2], [m1, m2]);
    for (angles, rates, accelerations) in [
        ([0.0, 0.0], [0.0, 0.0], [0.0, 0.0]),
        ([0.3, -0.7], [1.1, -2.3], [0.5, 4.0]),
        ([-2.0, 1.4], [-3.0, 0.4], [-6.0, 2.5]),
    ] {
        let ([q1, q2], [v1, v2], [a1, a2]) = (angles, rates, accelerations);
        let (s2, c2) = f64::sin_cos(q2);
        let (c1, c12) = (f64::cos(q1), f64::cos(q1 + q2));
        let first = m2 * l2 * l2 * (a1 + a2)
            + m2 * l1 * l2 * c2 * (2.0 * a1 + a2)
            + (m1 + m2) * l1 * l1 * a1
            - m2 * l1 * l2 * s2 * v2 * v2
            - 2.0 * m2 * l1 * l2 * s2 * v1 * v2
            + m2 * l2 * g * c12
            + (m1 + m2) * l1 * g * c1;
        let second = m2 * l1 * l2 * c2 * a1
            + m2 * l1 * l2 * s2 * v1 * v1
            + m2 * l2 * g * c12
            + m2 * l2 * l2 * (a1 + a2);
        let motion = TreeMotion {
            rates: rates.to_vec(),
            accelerations: accelerations.to_vec(),
            ..TreeMotion::at_rest(Placement::IDENTITY, angles.to_vec())
        };
        let found = tree.inverse_dynamics(&motion, GRAVITY).joints;
        assert!((found[0] - first).abs() < 1e-12 && (found[1] - second).abs() < 1e-12, "{found:?}");
    }
}

#[test]
fn what_stands_still_is_carried_by_its_base_with_its_weight_through_its_centre() {
    let tree = chain();
    let base = Placement {
        at_m: DVec3::new(0.3, -0.2, 0.5),
        turn: DQuat::from_euler(glam::EulerRot::XYZ, 0.2, -0.4, 1.1),
    };
    let motion = TreeMotion::at_rest(base, vec![0.5, 0.04, -0.8, 0.3]);
    let found = tree.inverse_dynamics(&motion, GRAVITY);
    let up = DVec3::Z * 9.81 * 4.3;
    let centre = tree.centre_of_mass_m(&tree.place(base, &motion.angles));
    assert!(found.base_force_n.abs_diff_eq(up, 1e-12), "{}", found.base_force_n);
    assert!(found.base_torque_nm.abs_diff_eq((centre - base.at_m).cross(up), 1e-12));
}

#[test]
fn what_falls_freely_takes_no_forces_at_all() {
    let mut motion = TreeMotion::at_rest(Placement::IDENTITY, vec![0.5, 0.04, -0.8, 0.3]);
    motion.acceleration_m_s2 = GRAVITY;
    let found = chain().inverse_dynamics(&motion, GRAVITY);
    let largest = found.joints.iter().fold(0.0, |a: f64, b| a.max(b.abs()));
    assert!(largest < 1e-12 && found.base_force_n.length() < 1e-12, "{found:?}");
}

#[test]
fn the_jacobian_is_how_points_move_when_a_joint_does() {
    let tree = chain();
    let base = Placement { at_m: DVec3::ONE, turn: DQuat::from_rotation_y(0.3) };
    let angles = [0.5, 0.04, -0.8, 0.3];
    let placed = tree.place(base, &angles);
    let own = DVec3::new(0.03, -0.02, 0.07);
    let step = 1e-6;
    for link in 0..5 {
        let jacobian = tree.jacobian(&placed, link, placed[link].point(own));
        for joint in 0..4 {
            let moved = |by: f64| {
                let mut angles = angles;
                angles[joint] += by;
                tree.place(base, &angles)[link]
            };
            let (ahead, behind) = (moved(step), moved(-step));
            let velocity = (ahead.point(own) - behind.point(own)) / (2.0 * step);
            let spin = (ahead.turn * behind.turn.inverse()).to_scaled_axis() / (2.0 * step);
            let column = jacobian.column(joint);
            let told = [velocity.x, velocity.y, velocity.z, spin.x, spin.y, spin.z];
            for (row, expected) in told.iter().enumerate() {
                assert!((column[row] - expected).abs() < 1e-8, "{link} {joint} {row}");
            }
        }
    }
}

/// Accelerations of a fixed tree that is left alone: the mass matrix, column by column, from inverse
/// dynamics.
fn left_alone(tree: &Tree, angles: &[f64], rates: &[f64]) -> Vec<f64> {
    let count = angles.len();
    let efforts = |rates: &[f64], accelerations: Vec<f64>, gravity: DVec3| {
        let motion = TreeMotion {
            rates: rates.to_vec(),
            accelerations,
            ..TreeMotion::at_rest(Placement::IDENTITY, angles.to_vec())
        };
        tree.inverse_dynamics(&motion, gravity).joints
    };
    let bias = nalgebra::DVector::from_vec(efforts(rates, vec![0.0; count], GRAVITY));
    let columns: Vec<f64> = (0..count)
        .flat_map(|joint| {
            let unit = (0..count).map(|at| f64::from(u8::from(at == joint))).collect();
            efforts(&vec![0.0; count], unit, DVec3::ZERO)
        })
        .collect();
    let mass = nalgebra::DMatrix::from_vec(count, count, columns);
    let found = mass.cholesky().expect("a mass matrix is positive definite").solve(&-bias);
    found.iter().copied().collect()
}

fn energy_j(tree: &Tree, angles: &[f64], rates: &[f64]) -> f64 {
    let placed = tree.place(Placement::IDENTITY, angles);
    let rates = nalgebra::DVector::from_column_slice(rates);
    let of = |index: usize, link: &TreeLink| {
        let seen = link.mass.placed(placed[index]);
        let moves = tree.jacobian(&placed, index, seen.centre_m) * &rates;
        let velocity = DVec3::new(moves[0], moves[1], moves[2]);
        let spin = DVec3::new(moves[3], moves[4], moves[5]);
        let kinetic =
            seen.mass_kg * velocity.length_squared() + spin.dot(seen.inertia_kg_m2 * spin);
        kinetic / 2.0 - seen.mass_kg * GRAVITY.dot(seen.centre_m)
    };
    tree.links().iter().enumerate().map(|(index, link)| of(index, link)).sum()
}

#[test]
fn what_swings_without_friction_keeps_its_energy() {
    for (tree, start) in [
        (double_pendulum([0.4, 0.3], [1.5, 0.8]), vec![0.4, FRAC_PI_2]),
        (chain(), vec![0.5, 0.04, -0.8, 0.3]),
    ] {
        let count = start.len();
        let (mut angles, mut rates) = (start, vec![0.1; count]);
        let before_j = energy_j(&tree, &angles, &rates);
        let ahead = |of: &[f64], by: &[f64], step_s: f64| -> Vec<f64> {
            of.iter().zip(by).map(|(value, rate)| value + step_s * rate).collect()
        };
        let (step_s, mut fastest) = (5e-4, 0.0_f64);
        for _ in 0..2000 {
            // Runge-Kutta of the fourth order.
            let mut slopes: Vec<(f64, Vec<f64>, Vec<f64>)> = Vec::new();
            for (share, weight) in [(0.0, 1.0), (0.5, 2.0), (0.5, 2.0), (1.0, 1.0)] {
                let (at, going) = match slopes.last() {
                    Some((_, slope, change)) => (
                        ahead(&angles, slope, share * step_s),
                        ahead(&rates, change, share * step_s),
                    ),
                    None => (angles.clone(), rates.clone()),
                };
                let change = left_alone(&tree, &at, &going);
                slopes.push((weight, going, change));
            }
            for (weight, slope, change) in &slopes {
                angles = ahead(&angles, slope, weight * step_s / 6.0);
                rates = ahead(&rates, change, weight * step_s / 6.0);
            }
            fastest = rates.iter().fold(fastest, |a, b| a.max(b.abs()));
        }
        let after_j = energy_j(&tree, &angles, &rates);
        assert!(fastest > 3.0, "it swings, at up to {fastest} rad/s");
        assert!((after_j - before_j).abs() < 1e-6, "{before_j} J, then {after_j} J");
    }
}

#[test]
fn coupled_joints_follow_theirs_and_hand_their_torques_on() {
    let tree = chain();
    let links = tree.links().to_vec();
    let coupling = Coupling { link: 4, of: vec![(1, -0.5), (3, 2.0)], offset: 0.1 };
    let tree = Tree::new(links, vec![coupling]).expect("a tree");
    let angles = tree.coupled(&[0.2, 0.0, 0.3, 9.0]);
    assert!((angles[3] - 0.6).abs() < 1e-15, "0.1 - 0.5 x 0.2 + 2 x 0.3: {angles:?}");
    let (rates, efforts) = (tree.coupled_rates(&[1.0, 0.5, -0.25, 0.0]), [3.0, 5.0, 7.0, 11.0]);
    let power = |efforts: &[f64]| efforts.iter().zip(&rates).map(|(a, b)| a * b).sum::<f64>();
    let gathered = tree.gathered(&efforts);
    assert!((power(&efforts) - power(&gathered)).abs() < 1e-12);
    assert!(gathered[3] == 0.0 && (gathered[0] - (3.0 - 5.5)).abs() < 1e-12, "{gathered:?}");
}

#[test]
fn two_bodies_joined_weigh_what_one_of_that_form_does() {
    // Two cubes of side 1 and 1 kg side by side are a box of 2 x 1 x 1.
    let cube = |x: f64| weighing(1.0, DVec3::X * x, DVec3::splat(1.0 / 6.0));
    let both = cube(0.5).with(&cube(-0.5));
    let expected = DVec3::new(2.0 / 12.0 * 2.0, 2.0 / 12.0 * 5.0, 2.0 / 12.0 * 5.0);
    assert!(both.centre_m.length() < 1e-15 && both.mass_kg == 2.0);
    assert!(both.inertia_kg_m2.abs_diff_eq(DMat3::from_diagonal(expected), 1e-15));
}

#[test]
fn what_is_no_tree_of_bodies_is_refused() {
    let base = || link(None, JointKind::Fixed, DVec3::ZERO, DVec3::ZERO);
    let hinge = |parent: usize| link(Some(parent), JointKind::Hinge, DVec3::ZERO, DVec3::X);
    let with = |change: &dyn Fn(&mut TreeLink)| {
        let mut changed = hinge(0);
        change(&mut changed);
        Tree::new(vec![base(), changed], Vec::new())
    };
    assert!(with(&|_| ()).is_ok());
    let heavy = weighing(1.0, DVec3::ZERO, DVec3::ONE);
    let refused = [
        Tree::new(Vec::new(), Vec::new()),
        Tree::new(vec![base(); 2], Vec::new()),
        Tree::new(vec![base(), hinge(1)], Vec::new()),
        Tree::new(vec![hinge(0)], Vec::new()),
        Tree::new([vec![base()], vec![hinge(0); LINKS_MAX]].concat(), Vec::new()),
        with(&|link| link.axis = DVec3::ZERO),
        with(&|link| link.axis.x = f64::NAN),
        with(&|link| link.origin.turn = DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0)),
        with(&|link| link.mass.mass_kg = -1.0),
        with(&|link| link.mass.mass_kg = f64::INFINITY),
        with(&|link| link.mass = weighing(1.0, DVec3::ZERO, DVec3::new(1.0, -1e-3, 1.0))),
        with(&|link| link.mass = weighing(0.0, DVec3::ZERO, DVec3::ONE)),
        with(&|link| {
            link.mass = heavy;
            link.mass.inertia_kg_m2.x_axis.y = 0.5;
        }),
        Tree::new(
            vec![base(), hinge(0)],
            vec![Coupling { link: 1, of: vec![(0, 1.0)], offset: 0.0 }],
        ),
        Tree::new(
            vec![base(), hinge(0), hinge(0)],
            vec![
                Coupling { link: 1, of: vec![(2, 1.0)], offset: 0.0 },
                Coupling { link: 2, of: vec![(1, 1.0)], offset: 0.0 },
            ],
        ),
    ];
    for (index, found) in refused.iter().enumerate() {
        assert!(found.is_err(), "case {index}");
    }
}
