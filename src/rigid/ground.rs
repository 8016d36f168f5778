//! A body and the floor it stands on, the plane z = 0: what carries it, and how hard it is pushed.

use glam::{DVec2, DVec3};

use crate::rigid::mass::{Momentum, Posed, centre_m};

/// Standard acceleration of free fall, m/s^2 (3rd General Conference on Weights and Measures, 1901).
pub const GRAVITY_M_S2: f64 = 9.806_65;

/// The area between the points that carry a body: their convex hull, seen from above.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SupportPolygon {
    /// Corners, m, counterclockwise; fewer than three if the points lie in a line.
    corners_m: Vec<DVec2>,
}

impl SupportPolygon {
    /// The hull of points on the floor (Andrew, "Another efficient algorithm for convex hulls in two
    /// dimensions", Information Processing Letters 9, 1979).
    #[must_use]
    pub fn of(points_m: &[DVec2]) -> Self {
        let mut points = points_m.to_vec();
        points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
        points.dedup();
        if points.len() < 3 {
            return Self { corners_m: points };
        }
        let mut corners_m = half_hull(points.iter().copied());
        corners_m.extend(half_hull(points.into_iter().rev()));
        Self { corners_m }
    }

    /// Corners, m, counterclockwise.
    #[must_use]
    pub fn corners_m(&self) -> &[DVec2] {
        &self.corners_m
    }

    /// How far inside its edge a point lies, m; how far outside, if negative. None if nothing
    /// carries.
    #[must_use]
    pub fn margin_m(&self, point_m: DVec2) -> Option<f64> {
        let count = self.corners_m.len();
        let edges = (0..count).map(|i| (self.corners_m[i], self.corners_m[(i + 1) % count]));
        let distance_m = |(from, to): (DVec2, DVec2)| {
            let along = to - from;
            let length2 = along.length_squared();
            let share = if length2 > 0.0 { (point_m - from).dot(along) / length2 } else { 0.0 };
            point_m.distance(from + along * share.clamp(0.0, 1.0))
        };
        let nearest_m =
            edges.clone().map(distance_m).fold(None, |least: Option<f64>, distance| {
                Some(least.map_or(distance, |least| least.min(distance)))
            })?;
        let mut sides = edges;
        let inside =
            count >= 3 && sides.all(|(from, to)| (to - from).perp_dot(point_m - from) >= 0.0);
        Some(if inside { nearest_m } else { -nearest_m })
    }
}

/// The lower hull of points in order, without its last.
fn half_hull(points: impl Iterator<Item = DVec2>) -> Vec<DVec2> {
    let mut hull: Vec<DVec2> = Vec::new();
    for point in points {
        while let [.., before, last] = hull[..]
            && (last - before).perp_dot(point - last) <= 0.0
        {
            hull.pop();
        }
        hull.push(point);
    }
    hull.pop();
    hull
}

/// What the floor does to a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GroundReaction {
    /// Force on the body, N.
    pub force_n: DVec3,
    /// Where on the floor the force acts so that it has no moment about level axes, m: the
    /// zero-moment point (Vukobratovic and Borovac, "Zero-moment point: thirty five years of its
    /// life", International Journal of Humanoid Robotics 1, 2004). None while the floor hardly
    /// pushes.
    pub zero_moment_point_m: Option<DVec2>,
}

/// Less than this part of a body's weight gives no zero-moment point.
const HARDLY: f64 = 0.05;

/// What the floor does to bodies at the middle of three instants, `step_s` apart (Newton and Euler
/// for the whole: the force changes the momentum, its moment about the centre of mass the angular
/// one).
#[must_use]
pub fn reaction(instants: [&[Posed]; 3], step_s: f64) -> GroundReaction {
    let [before, now, after] = instants;
    let both = [Momentum::between(before, now, step_s), Momentum::between(now, after, step_s)];
    reaction_of(now, both, step_s)
}

/// The same from the momentum that the bodies have on the way to where they are `now`, and from there on.
#[must_use]
pub fn reaction_of(now: &[Posed], [first, second]: [Momentum; 2], step_s: f64) -> GroundReaction {
    let mass_kg: f64 = now.iter().map(|body| body.mass.mass_kg).sum();
    let weight_n = mass_kg * GRAVITY_M_S2;
    let force_n = (second.linear_kg_m_s - first.linear_kg_m_s) / step_s + DVec3::Z * weight_n;
    let moment_n_m = (second.angular_kg_m2_s - first.angular_kg_m2_s) / step_s;
    // (p - c) x F = dL/dt about level axes, with p on the floor.
    let centre_m = centre_m(now);
    let zero_moment_point_m = (force_n.z > HARDLY * weight_n).then(|| {
        DVec2::new(
            centre_m.x - (centre_m.z * force_n.x + moment_n_m.y) / force_n.z,
            centre_m.y - (centre_m.z * force_n.y - moment_n_m.x) / force_n.z,
        )
    });
    GroundReaction { force_n, zero_moment_point_m }
}

/// What the floor does to bodies at each of some instants, which follow at `rate_hz`. Nothing moves before the
/// first and after the last: of a motion that goes on there, leave those two out.
#[must_use]
pub fn reactions<B: AsRef<[Posed]>>(instants: &[B], rate_hz: f64) -> Vec<GroundReaction> {
    let last = instants.len().saturating_sub(1);
    let three = |at: usize| [at.saturating_sub(1), at, (at + 1).min(last)];
    (0..instants.len())
        .map(|at| reaction(three(at).map(|at| instants[at].as_ref()), 1.0 / rate_hz))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rigid::mass::Mass;
    use glam::DQuat;
    use proptest::prelude::*;

    #[test]
    fn a_square_knows_its_inside_from_its_outside() {
        let square = [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0), (1.0, 1.0), (1.0, 0.0)];
        let polygon = SupportPolygon::of(&square.map(|(x, y)| DVec2::new(x, y)));
        assert_eq!(polygon.corners_m().len(), 4);
        assert!((polygon.margin_m(DVec2::new(0.5, 1.0)).unwrap() - 0.5).abs() < 1e-12);
        assert!((polygon.margin_m(DVec2::new(3.0, 3.0)).unwrap() + 2f64.sqrt()).abs() < 1e-12);
        assert_eq!(SupportPolygon::of(&[]).margin_m(DVec2::ZERO), None);
        let point = SupportPolygon::of(&[DVec2::X; 3]);
        assert_eq!(point.margin_m(DVec2::ZERO), Some(-1.0));
        let line = SupportPolygon::of(&[DVec2::ZERO, DVec2::X, DVec2::X * 2.0]);
        assert_eq!(line.margin_m(DVec2::new(1.0, 1.0)), Some(-1.0));
    }

    proptest! {
        #[test]
        fn every_point_lies_in_its_own_hull(
            points in prop::collection::vec((-1.0..1.0, -1.0..1.0), 1..20),
        ) {
            let points: Vec<DVec2> = points.into_iter().map(DVec2::from).collect();
            let polygon = SupportPolygon::of(&points);
            for point in points {
                prop_assert!(polygon.margin_m(point).unwrap() > -1e-9);
            }
        }
    }

    fn ball(x: f64, z: f64, turned: f64) -> Vec<Posed> {
        vec![Posed {
            mass: Mass::of_radii(10.0, DVec3::ZERO, DVec3::splat(0.2)),
            origin_m: DVec3::new(x, 0.0, z),
            turned: DQuat::from_rotation_y(turned),
        }]
    }

    #[test]
    fn what_rests_presses_with_its_weight_under_its_centre_and_what_falls_not_at_all() {
        let still = ball(0.3, 1.0, 0.0);
        let got = reaction([&still, &still, &still], 0.01);
        assert!((got.force_n - DVec3::Z * 98.0665).length() < 1e-9);
        assert!((got.zero_moment_point_m.unwrap() - DVec2::new(0.3, 0.0)).length() < 1e-12);
        let step_s = 0.01;
        let at = |i: f64| ball(0.0, 1.0 - GRAVITY_M_S2 / 2.0 * (i * step_s).powi(2), 0.0);
        let falling = reaction([&at(0.0), &at(1.0), &at(2.0)], step_s);
        assert!(falling.force_n.length() < 1e-9);
        assert_eq!(falling.zero_moment_point_m, None);
    }

    /// A cart on a table: p = x - z a / g; turning faster forward moves it back by I alpha / m g.
    #[test]
    fn the_zero_moment_point_is_that_of_the_cart_on_a_table() {
        let step_s = 1e-3;
        let (a, alpha) = (2.0, 5.0);
        let at = |i: f64| {
            let t = (i - 1.0) * step_s;
            ball(a * t * t / 2.0, 0.8, alpha * t * t / 2.0)
        };
        let got = reaction([&at(0.0), &at(1.0), &at(2.0)], step_s);
        let expected = -0.8 * a / GRAVITY_M_S2 - 10.0 * 0.04 * alpha / (10.0 * GRAVITY_M_S2);
        assert!((got.zero_moment_point_m.unwrap().x - expected).abs() < 1e-6, "{got:?}");
        assert!((got.force_n.x - 20.0).abs() < 1e-6);
    }
}
