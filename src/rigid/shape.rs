//! Capsules and boxes, and how far they are apart.
//!
//! Two boxes, or a box and a line, that do not touch are nearest at two of their edges or at a corner
//! and a face; those that do are told apart by the direction in which they overlap least (the separating
//! axes: their faces' normals and the cross products of their edges). So no iteration is needed and the
//! distance is exact. C. Ericson, Real-Time Collision Detection, 2005, 4.4 and 5.1.

use super::tree::Placement;
use glam::{DQuat, DVec3};

/// What two lines that are shorter, or two directions nearer, are taken for: a point, the same, m².
const TINY: f64 = 1e-18;
/// A step in which a distance is looked at from both sides, m.
const LOOK_M: f64 = 1e-5;
/// How often it is projected at most to find where two meet, and how near is near enough, m.
const PROJECTIONS: usize = 50;
const NEAR_M: f64 = 1e-6;

/// All points within a radius of a line between two points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capsule {
    /// One end of the line, m.
    pub from_m: DVec3,
    /// The other; a ball if it is the same.
    pub to_m: DVec3,
    /// The radius, m.
    pub radius_m: f64,
}

/// A box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cuboid {
    /// Its middle, m.
    pub centre_m: DVec3,
    /// From its own axes to those it is placed in.
    pub turn: DQuat,
    /// From its middle to its faces, m.
    pub half_m: DVec3,
}

/// What a link takes up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Volume {
    /// A line with a radius.
    Capsule(Capsule),
    /// A box.
    Cuboid(Cuboid),
}

impl Volume {
    /// The same in the axes its link is placed in.
    #[must_use]
    pub fn placed(&self, placement: Placement) -> Self {
        match self {
            Self::Capsule(of) => Self::Capsule(Capsule {
                from_m: placement.point(of.from_m),
                to_m: placement.point(of.to_m),
                radius_m: of.radius_m,
            }),
            Self::Cuboid(of) => Self::Cuboid(Cuboid {
                centre_m: placement.point(of.centre_m),
                turn: placement.turn * of.turn,
                half_m: of.half_m,
            }),
        }
    }

    /// How far it reaches in a direction of unit length, from the origin, m.
    #[must_use]
    pub fn reach_m(&self, direction: DVec3) -> f64 {
        let core = Core::of(self);
        let along = core.corners().into_iter().map(|corner| corner.dot(direction));
        along.fold(f64::NEG_INFINITY, f64::max) + core.radius_m
    }

    /// The corners of a box; of a capsule the two points that reach furthest in a direction of unit
    /// length.
    #[must_use]
    pub fn corners_m(&self, direction: DVec3) -> Vec<DVec3> {
        let core = Core::of(self);
        core.corners().into_iter().map(|corner| corner + direction * core.radius_m).collect()
    }

    /// How far two are apart, m; negative: how deep they are in one another, the least way out.
    #[must_use]
    pub fn distance_m(&self, other: &Self) -> f64 {
        let (one, two) = (Core::of(self), Core::of(other));
        core_distance_m(&one, &two) - one.radius_m - two.radius_m
    }

    /// How deep two are in one another, m, the least way out: 0 of those that are apart, found
    /// sooner than [`Self::distance_m`].
    #[must_use]
    pub fn depth_m(&self, other: &Self) -> f64 {
        let (one, two) = (Core::of(self), Core::of(other));
        let radii_m = one.radius_m + two.radius_m;
        // A gap in one direction is one that a distance has at least.
        if one.count + two.count > 2 {
            let gap_m = least_overlap_m(&one, &two);
            if gap_m <= 0.0 || gap_m >= radii_m {
                return (radii_m - gap_m).max(0.0);
            }
        }
        (radii_m - core_distance_m(&one, &two)).max(0.0)
    }

    /// The same, larger by so much on every side, m.
    #[must_use]
    pub fn grown(&self, by_m: f64) -> Self {
        match *self {
            Self::Capsule(of) => Self::Capsule(Capsule { radius_m: of.radius_m + by_m, ..of }),
            Self::Cuboid(of) => {
                Self::Cuboid(Cuboid { half_m: of.half_m + DVec3::splat(by_m), ..of })
            }
        }
    }

    /// The least way out of one another of two that overlap; nothing if they do not.
    #[must_use]
    pub fn way_out(&self, other: &Self) -> Option<WayOut> {
        let (one, two) = (Core::of(self), Core::of(other));
        let radii_m = one.radius_m + two.radius_m;
        let facing = (one.count + two.count > 2).then(|| least_overlap(&one, &two));
        let (depth_m, normal) = match facing {
            Some((gap_m, _)) if gap_m >= radii_m => return None,
            Some((gap_m, normal)) if gap_m <= 0.0 => (radii_m - gap_m, normal),
            _ => {
                let depth_m = radii_m - core_distance_m(&one, &two);
                if depth_m <= 0.0 {
                    return None;
                }
                // Where the other has to go for the distance to grow.
                let deeper = |axis: DVec3| {
                    let moved =
                        |by_m: f64| self.distance_m(&other.placed(Placement::at(axis * by_m)));
                    moved(LOOK_M) - moved(-LOOK_M)
                };
                let slope = DVec3::new(deeper(DVec3::X), deeper(DVec3::Y), deeper(DVec3::Z));
                (depth_m, slope.try_normalize().or(facing.map(|(_, normal)| normal))?)
            }
        };
        let on_one = one.nearest(two.centre);
        let at_m = on_one.midpoint(two.nearest(on_one));
        Some(WayOut { depth_m, normal, at_m })
    }

    /// Where two that touch meet, m: between the points of their lines or boxes that are nearest to one another, or in both
    /// boxes, found by projecting back and forth (Cheney and Goldstein, Proc. Amer. Math. Soc. 10, 1959).
    #[must_use]
    pub fn meeting_m(&self, other: &Self) -> DVec3 {
        let (one, two) = (Core::of(self), Core::of(other));
        let mut on_two = two.centre;
        let mut on_one = one.nearest(on_two);
        for _ in 0..PROJECTIONS {
            on_two = two.nearest(on_one);
            let next = one.nearest(on_two);
            let moved_m = next.distance(on_one);
            on_one = next;
            if moved_m < NEAR_M {
                break;
            }
        }
        on_one.midpoint(on_two)
    }

    /// A ball that holds it: its middle and its radius, m.
    #[must_use]
    pub fn ball_m(&self) -> (DVec3, f64) {
        match self {
            Self::Capsule(of) => {
                let half_m = of.from_m.distance(of.to_m) / 2.0;
                (of.from_m.midpoint(of.to_m), half_m + of.radius_m)
            }
            Self::Cuboid(of) => (of.centre_m, of.half_m.length()),
        }
    }
}

/// How two that overlap part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WayOut {
    /// How deep they are in one another, m.
    pub depth_m: f64,
    /// Moving the second this way parts them soonest; of unit length.
    pub normal: DVec3,
    /// About where they meet, m: it goes evenly with them ([`Volume::meeting_m`] does not, where they lie along one another).
    pub at_m: DVec3,
}

/// A line or a box, without the radius around it.
struct Core {
    centre: DVec3,
    /// Half edges, `count` of them; those of no length are left out.
    halves: [DVec3; 3],
    count: usize,
    radius_m: f64,
}

impl Core {
    fn of(volume: &Volume) -> Self {
        let (centre, all, radius_m) = match volume {
            Volume::Capsule(of) => {
                let half = (of.to_m - of.from_m) / 2.0;
                ((of.from_m + of.to_m) / 2.0, [half, DVec3::ZERO, DVec3::ZERO], of.radius_m)
            }
            Volume::Cuboid(of) => {
                let half = |axis: DVec3, half: f64| of.turn * axis * half;
                let halves = [
                    half(DVec3::X, of.half_m.x),
                    half(DVec3::Y, of.half_m.y),
                    half(DVec3::Z, of.half_m.z),
                ];
                (of.centre_m, halves, 0.0)
            }
        };
        let (mut halves, mut count) = ([DVec3::ZERO; 3], 0);
        for half in all.into_iter().filter(|half| half.length_squared() > TINY) {
            halves[count] = half;
            count += 1;
        }
        Self { centre, halves, count, radius_m }
    }

    fn halves(&self) -> &[DVec3] {
        &self.halves[..self.count]
    }

    fn corners(&self) -> Vec<DVec3> {
        self.halves().iter().fold(vec![self.centre], |corners, &half| {
            corners.iter().flat_map(|&corner| [corner - half, corner + half]).collect()
        })
    }

    /// Both ends of every edge; of a point, the point twice.
    fn edges(&self) -> Vec<[DVec3; 2]> {
        if self.halves().is_empty() {
            return vec![[self.centre; 2]];
        }
        let mut edges = Vec::with_capacity(12);
        for (along, &half) in self.halves().iter().enumerate() {
            let others = self.halves().iter().enumerate().filter(|&(index, _)| index != along);
            let middles = others.fold(vec![self.centre], |middles, (_, &other)| {
                middles.iter().flat_map(|&middle| [middle - other, middle + other]).collect()
            });
            edges.extend(middles.into_iter().map(|middle| [middle - half, middle + half]));
        }
        edges
    }

    /// Half its extent along a direction.
    fn extent(&self, direction: DVec3) -> f64 {
        self.halves().iter().map(|half| half.dot(direction).abs()).sum()
    }

    /// Directions its faces look in, of unit length: none of a point, all that are across of a line.
    fn normals(&self) -> ([DVec3; 3], usize) {
        match self.halves() {
            [one, two] => ([*one, *two, one.cross(*two)].map(DVec3::normalize), 3),
            [one, two, three] => ([*one, *two, *three].map(DVec3::normalize), 3),
            _ => ([DVec3::ZERO; 3], 0),
        }
    }

    /// The nearest point of it.
    fn nearest(&self, point: DVec3) -> DVec3 {
        let away = point - self.centre;
        self.halves().iter().fold(self.centre, |found, &half| {
            found + half * (away.dot(half) / half.length_squared()).clamp(-1.0, 1.0)
        })
    }
}

fn core_distance_m(one: &Core, two: &Core) -> f64 {
    // Lines and points have no inside: two of them do not overlap.
    if one.count > 1 || two.count > 1 {
        let apart = least_overlap_m(one, two);
        if apart <= 0.0 {
            return apart;
        }
    }
    let edges = two.edges();
    let between = one
        .edges()
        .into_iter()
        .flat_map(|edge| edges.iter().map(move |&other| segments_distance_m(edge, other)));
    let corners = one.corners().into_iter().map(|corner| corner.distance(two.nearest(corner)));
    let others = two.corners().into_iter().map(|corner| corner.distance(one.nearest(corner)));
    between.chain(corners).chain(others).fold(f64::INFINITY, f64::min)
}

/// The largest gap in any direction that can part the two; negative: they overlap by this.
fn least_overlap_m(one: &Core, two: &Core) -> f64 {
    least_overlap(one, two).0
}

/// The same with the direction, of unit length, from the first to the second.
fn least_overlap(one: &Core, two: &Core) -> (f64, DVec3) {
    let away = two.centre - one.centre;
    let mut most = (f64::NEG_INFINITY, DVec3::Z);
    let mut look = |direction: DVec3| {
        let along = away.dot(direction);
        let gap_m = along.abs() - one.extent(direction) - two.extent(direction);
        if gap_m > most.0 {
            most = (gap_m, if along < 0.0 { -direction } else { direction });
        }
    };
    for (normals, count) in [one.normals(), two.normals()] {
        for normal in &normals[..count] {
            look(*normal);
        }
    }
    for edge in one.halves() {
        for of in two.halves() {
            if let Some(across) = edge.cross(*of).try_normalize() {
                look(across);
            }
        }
    }
    most
}

/// How far two lines between points are apart (Ericson 5.1.9).
fn segments_distance_m([p, p_end]: [DVec3; 2], [q, q_end]: [DVec3; 2]) -> f64 {
    let (d1, d2, r) = (p_end - p, q_end - q, p - q);
    let (a, e, f) = (d1.length_squared(), d2.length_squared(), d2.dot(r));
    if a <= TINY && e <= TINY {
        return r.length();
    }
    let (s, t) = if a <= TINY {
        (0.0, (f / e).clamp(0.0, 1.0))
    } else {
        let c = d1.dot(r);
        if e <= TINY {
            ((-c / a).clamp(0.0, 1.0), 0.0)
        } else {
            let b = d1.dot(d2);
            let across = a * e - b * b;
            let s = if across > TINY * a * e {
                ((b * f - c * e) / across).clamp(0.0, 1.0)
            } else {
                0.0
            };
            match (b * s + f) / e {
                t if t < 0.0 => ((-c / a).clamp(0.0, 1.0), 0.0),
                t if t > 1.0 => (((b - c) / a).clamp(0.0, 1.0), 1.0),
                t => (s, t),
            }
        }
    };
    (p + d1 * s).distance(q + d2 * t)
}

#[cfg(test)]
mod tests;
