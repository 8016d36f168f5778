use super::*;
use glam::EulerRot;

fn capsule(from_m: DVec3, to_m: DVec3, radius_m: f64) -> Volume {
    Volume::Capsule(Capsule { from_m, to_m, radius_m })
}

fn cuboid(centre_m: DVec3, turn: DQuat, half_m: DVec3) -> Volume {
    Volume::Cuboid(Cuboid { centre_m, turn, half_m })
}

/// Numbers that are always the same and look like none: Knuth's linear congruence.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self, low: f64, high: f64) -> f64 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * ((self.0 >> 11) as f64 / (1_u64 << 53) as f64)
    }

    fn point(&mut self, reach: f64) -> DVec3 {
        DVec3::new(self.next(-reach, reach), self.next(-reach, reach), self.next(-reach, reach))
    }

    fn volume(&mut self) -> Volume {
        if self.next(0.0, 1.0) < 0.5 {
            let (from_m, to_m) = (self.point(0.6), self.point(0.6));
            return capsule(from_m, to_m, self.next(0.0, 0.2));
        }
        let (x, y, z) = (self.next(-3.0, 3.0), self.next(-3.0, 3.0), self.next(-3.0, 3.0));
        let turn = DQuat::from_euler(EulerRot::XYZ, x, y, z);
        cuboid(self.point(0.6), turn, self.point(0.5).abs() + DVec3::splat(0.01))
    }
}

#[test]
fn distances_that_can_be_worked_out_by_hand() {
    let unit = cuboid(DVec3::ZERO, DQuat::IDENTITY, DVec3::ONE);
    let turned = DQuat::from_rotation_z(std::f64::consts::FRAC_PI_4);
    let root = std::f64::consts::SQRT_2;
    for (one, two, distance_m, what) in [
        (
            capsule(-DVec3::X, DVec3::X, 0.1),
            capsule(DVec3::new(0.0, -1.0, 0.5), DVec3::new(0.0, 1.0, 0.5), 0.15),
            0.25,
            "crossed lines",
        ),
        (
            capsule(-DVec3::X, DVec3::X, 0.1),
            capsule(DVec3::new(-1.0, 0.1, 0.0), DVec3::new(1.0, 0.1, 0.0), 0.1),
            -0.1,
            "parallel lines, overlapping",
        ),
        (
            capsule(DVec3::ZERO, DVec3::ZERO, 0.5),
            capsule(DVec3::new(3.0, 4.0, 0.0), DVec3::new(3.0, 4.0, 0.0), 0.5),
            4.0,
            "balls",
        ),
        (unit, cuboid(DVec3::X * 3.0, DQuat::IDENTITY, DVec3::ONE), 1.0, "face to face"),
        (unit, cuboid(DVec3::X * 4.0, turned, DVec3::ONE), 3.0 - root, "edge to face"),
        (unit, cuboid(DVec3::X * 1.9, DQuat::IDENTITY, DVec3::ONE), -0.1, "in one another"),
        (
            unit,
            cuboid(DVec3::splat(4.0), DQuat::IDENTITY, DVec3::ONE),
            2.0 * 3.0_f64.sqrt(),
            "corner to corner",
        ),
        (
            unit,
            capsule(DVec3::new(2.0, 0.0, 5.0), DVec3::new(2.0, 0.0, -5.0), 0.25),
            0.75,
            "line along a face",
        ),
        (
            unit,
            capsule(DVec3::new(0.9, 0.0, 5.0), DVec3::new(0.9, 0.0, -5.0), 0.25),
            -0.35,
            "line through a box",
        ),
        (unit, capsule(DVec3::Z * 0.5, DVec3::Z * 0.5, 0.1), -0.6, "ball inside a box"),
    ] {
        assert!(
            (one.distance_m(&two) - distance_m).abs() < 1e-12,
            "{what}: {}",
            one.distance_m(&two)
        );
        assert!((two.distance_m(&one) - distance_m).abs() < 1e-12, "{what}, the other way");
    }
}

/// The distance of two convex bodies by another way: projecting on one after the other (Dykstra and
/// von Neumann's alternating projections) ends at the nearest pair of points.
fn by_projection_m(one: &Volume, two: &Volume) -> f64 {
    let (a, b) = (Core::of(one), Core::of(two));
    let mut point = a.centre;
    let mut on_b = b.nearest(point);
    for _ in 0..20_000 {
        point = a.nearest(on_b);
        on_b = b.nearest(point);
    }
    point.distance(on_b) - a.radius_m - b.radius_m
}

#[test]
fn distances_are_those_found_by_projecting_back_and_forth() {
    let mut numbers = Numbers(7);
    let (mut apart, mut inside) = (0, 0);
    for _ in 0..400 {
        let (one, two) = (numbers.volume(), numbers.volume());
        let found_m = one.distance_m(&two);
        let cores_m = core_distance_m(&Core::of(&one), &Core::of(&two));
        if cores_m > 1e-3 {
            apart += 1;
            let expected_m = by_projection_m(&one, &two);
            assert!((found_m - expected_m).abs() < 1e-6, "{found_m} {expected_m} {one:?} {two:?}");
        } else if cores_m < -1e-3 {
            inside += 1;
            assert!(by_projection_m(&one, &two) < 1e-3, "{one:?} {two:?}");
        }
    }
    assert!(apart > 100 && inside > 30, "{apart} apart, {inside} inside");
}

#[test]
fn moved_apart_by_its_depth_a_pair_just_touches() {
    let mut numbers = Numbers(11);
    let mut looked_at = 0;
    while looked_at < 60 {
        let (one, two) = (numbers.volume(), numbers.volume());
        let depth_m = -one.distance_m(&two);
        if !(depth_m > 0.01) {
            continue;
        }
        looked_at += 1;
        // No direction parts them by less: a thousand are tried.
        for _ in 0..1000 {
            let Some(way) = numbers.point(1.0).try_normalize() else { continue };
            let moved = two.placed(Placement::at(way * (depth_m * 0.99)));
            assert!(one.distance_m(&moved) < 1e-9, "{way} parts {one:?} {two:?}");
        }
    }
}

#[test]
fn the_depth_is_that_of_the_distance_and_a_ball_holds_all_of_a_volume() {
    let mut numbers = Numbers(23);
    let mut deep = 0;
    for _ in 0..2000 {
        let (one, two) = (numbers.volume(), numbers.volume());
        let expected_m = (-one.distance_m(&two)).max(0.0);
        deep += usize::from(expected_m > 0.0);
        assert!((one.depth_m(&two) - expected_m).abs() < 1e-12, "{one:?} {two:?}");
        let (middle, radius_m) = one.ball_m();
        let Some(way) = numbers.point(1.0).try_normalize() else { continue };
        assert!(one.reach_m(way) <= middle.dot(way) + radius_m + 1e-12, "{one:?}");
    }
    assert!((200..1800).contains(&deep), "{deep}");
}

#[test]
fn two_bodies_moved_and_turned_together_stay_as_far_apart() {
    let mut numbers = Numbers(3);
    for _ in 0..100 {
        let (one, two) = (numbers.volume(), numbers.volume());
        let turn = DQuat::from_euler(EulerRot::ZYX, numbers.next(-3.0, 3.0), 0.4, -1.1);
        let away = Placement { at_m: numbers.point(2.0), turn };
        let (here, there) = (one.distance_m(&two), one.placed(away).distance_m(&two.placed(away)));
        assert!((here - there).abs() < 1e-9, "{here} {there}");
        let up = -one.reach_m(DVec3::Z);
        assert!(one.placed(Placement::at(DVec3::Z * up)).reach_m(DVec3::Z).abs() < 1e-12);
    }
}

#[test]
fn the_way_out_is_as_long_as_the_depth_and_parts_the_two() {
    let mut numbers = Numbers(41);
    let mut out = 0;
    for _ in 0..2000 {
        let (one, two) = (numbers.volume(), numbers.volume());
        let depth_m = one.depth_m(&two);
        let Some(way) = one.way_out(&two) else {
            assert_eq!(depth_m, 0.0, "{one:?} {two:?}");
            continue;
        };
        out += 1;
        assert!((way.depth_m - depth_m).abs() < 1e-12, "{way:?} {depth_m}");
        assert!((way.normal.length() - 1.0).abs() < 1e-9);
        let moved = |part: f64| two.placed(Placement::at(way.normal * (depth_m * part)));
        assert!(one.depth_m(&moved(1.0)) < 0.02 * depth_m, "{way:?}: {one:?} {two:?}");
        assert!(one.depth_m(&moved(0.9)) > 0.0, "{way:?}: {one:?} {two:?}");
    }
    assert!(out > 200, "{out}");
}

#[test]
fn a_volume_that_is_grown_is_as_much_nearer_to_all_others() {
    let mut numbers = Numbers(5);
    for _ in 0..500 {
        let one = numbers.volume();
        let ball = capsule(numbers.point(3.0), DVec3::ZERO, 0.1);
        let way = numbers.point(1.0).normalize_or(DVec3::X);
        let (near, far) = (one.grown(0.2).reach_m(way), one.reach_m(way));
        assert!(near - far > 0.2 - 1e-12, "{one:?}");
        let nearer_m = ball.distance_m(&one) - ball.distance_m(&one.grown(0.2));
        assert!(nearer_m > -1e-9, "{one:?} {ball:?} {nearer_m}");
    }
}
