//! Where a robot's base is, from nothing but its joints and which of its feet carry.
//!
//! Soles that lie on the floor decide how the base is turned: the plane that fits them best, weighted by how
//! much the motion's feet carry and lie flat, is level; where none does, the trunk the base plays tells. The
//! lowest corner of the soles is on the floor. Over the floor the base goes so that what carries slides as little as can be
//! (between two instants, the rigid motion of the plane nearest to none, by least squares: Umeyama,
//! "Least-squares estimation of transformation parameters between two point patterns", IEEE PAMI 13,
//! 1991); whoever flies turns as the person did. Weights come and go smoothly, so nothing jumps; a robot that hangs does not move at all.

use crate::body::root::spread;
use crate::retarget::Footfall;
use crate::rigid::Placement;
use crate::rigid::ground::SupportPolygon;
use crate::robot::RobotBody;
use gaitway_profiles::BaseKind;
use glam::{DMat2, DQuat, DVec2, DVec3};

/// A sole lower than this is on the floor, m.
pub const ON_FLOOR_M: f64 = 0.005;
/// Of corners this much higher than the lowest each carries e times less, m.
const CARRIES_M: f64 = 0.002;
/// What a foot that carries nothing counts for, so that there is always one.
const FAINT: f64 = 0.01;
/// A foot that is so much higher than the other stands e times less, where nobody says which, m.
const STANDS_M: f64 = 0.01;
/// How much a trunk holds where no sole lies flat: as a sole of so many m² would.
const TRUNK_M2: f64 = 0.01;
/// The part of that which is left where a sole lies flat: next to nothing.
const HOLDS: f64 = 1e-3;
/// A trunk that is turned further than this cosine says nothing of a slope.
const UPWARD: f64 = 0.1;
/// Holds the heading where what carries is a point, m².
const HEADING_M2: f64 = 1e-7;
/// The same of what flies, where somebody says where it looks, m².
const FLIES_M2: f64 = 1.0;
/// A weight that is so far outside the soles that carry is not over them at all, m.
const OUTSIDE_M: f64 = 0.02;
/// Whether it is comes and goes over this time, standard deviation, s: a robot tips no faster than it falls.
const TIPS_S: f64 = 0.25;
/// How high a robot hangs above the floor, m.
const HANGS_M: f64 = 0.02;

/// A sole of a robot: the left or the right one.
#[derive(Clone, Debug, PartialEq)]
pub struct StandingSole {
    /// Index of its link.
    pub link: usize,
    /// 0 is left.
    pub side: usize,
    /// Its corners in the link's axes, m.
    pub corners_m: Vec<DVec3>,
    /// Up from it, in the link's axes.
    pub normal: DVec3,
}

impl StandingSole {
    /// All soles of a body; by where they are with all joints at zero, left or right.
    #[must_use]
    pub fn all(body: &RobotBody) -> Vec<Self> {
        let zeros = vec![0.0; body.tree.moving()];
        let placed = body.tree.place(Placement::IDENTITY, &body.tree.coupled(&zeros));
        let sole = |of: &crate::robot::Sole| {
            let corners_m = of.corners_m.clone();
            let middle = corners_m.iter().sum::<DVec3>() / corners_m.len().max(1) as f64;
            let side = usize::from(placed[of.link].point(middle).y < 0.0);
            Self { link: of.link, side, corners_m, normal: of.normal }
        };
        body.soles.iter().map(sole).collect()
    }
}

/// A base that moves, instant by instant.
#[derive(Clone, Debug, PartialEq)]
pub struct BasePath {
    /// Instants per second.
    pub rate_hz: f64,
    /// The robot's first link in the world, the floor at z = 0.
    pub places: Vec<Placement>,
    /// Whether its left and its right foot are meant to stand on the floor.
    pub contacts: Vec<[bool; 2]>,
}

impl BasePath {
    /// Where the base is at a time, s, and what stands; at the ends before and after.
    #[must_use]
    pub fn at(&self, time_s: f64) -> (Placement, [bool; 2]) {
        let last = self.places.len().saturating_sub(1);
        let along = (time_s * self.rate_hz).clamp(0.0, last as f64);
        let (before, share) = (along as usize, along.fract());
        let (Some(from), Some(to)) =
            (self.places.get(before), self.places.get((before + 1).min(last)))
        else {
            return (Placement::IDENTITY, [false; 2]);
        };
        let place = Placement {
            at_m: from.at_m.lerp(to.at_m, share),
            turn: from.turn.slerp(to.turn, share),
        };
        (place, self.contacts[along.round() as usize])
    }
}

/// How a robot is held while it moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Held {
    /// It stands on its soles.
    Standing,
    /// It hangs on a stand, upright, its soles above the floor.
    Hanging,
    /// It is screwed down, or has no soles: the base is where its file has it.
    Fixed,
}

impl Held {
    /// How a body is held; `hangs` if somebody said so.
    #[must_use]
    pub fn of(body: &RobotBody, soles: &[StandingSole], hangs: bool) -> Self {
        match (body.base, soles.is_empty(), hangs) {
            (BaseKind::Fixed, ..) | (_, true, false) => Self::Fixed,
            (_, _, true) => Self::Hanging,
            (BaseKind::Free, false, false) => Self::Standing,
        }
    }
}

/// Where the base is in poses that follow at `rate_hz`: angles of the robot's joints, rad, and what
/// the motion says of its feet then; nothing where it says nothing.
#[must_use]
pub fn path(
    body: &RobotBody,
    soles: &[StandingSole],
    held: Held,
    poses: &[Vec<f64>],
    rate_hz: f64,
    footfall: impl Fn(usize) -> Option<Footfall>,
) -> BasePath {
    let (places, contacts) = match held {
        Held::Fixed => (vec![Placement::IDENTITY; poses.len()], vec![[false; 2]; poses.len()]),
        Held::Hanging => {
            let low_m = poses.iter().map(|pose| lowest_m(body, soles, pose));
            let height_m = HANGS_M - low_m.fold(0.0, f64::min);
            let place = Placement::at(DVec3::Z * height_m);
            (vec![place; poses.len()], vec![[false; 2]; poses.len()])
        }
        Held::Standing => {
            let mut walk = Walk::new(body, soles);
            poses.iter().enumerate().map(|(at, pose)| walk.next(pose, footfall(at))).unzip()
        }
    };
    BasePath { rate_hz, places, contacts }
}

/// What the feet of a robot do in poses that follow at `rate_hz`, of which nobody said more than its joints, rad. Those
/// that are lowest under an upright trunk carry. They lie flat as far as its weight is over them then; as far as it is not, the
/// robot would have fallen, so that it leans otherwise, nobody knows how, and its trunk is taken for upright.
#[must_use]
pub fn resting(
    body: &RobotBody,
    soles: &[StandingSole],
    poses: &[Vec<f64>],
    rate_hz: f64,
) -> Vec<Footfall> {
    let walk = Walk::new(body, soles);
    let (mut footfalls, mut shares): (Vec<Footfall>, Vec<DVec3>) =
        poses.iter().map(|pose| walk.rests(pose)).unzip();
    spread(&mut shares, rate_hz, TIPS_S);
    for (footfall, share) in footfalls.iter_mut().zip(shares) {
        footfall.flat = footfall.carries.map(|carries| carries * share.x);
    }
    footfalls
}

/// Where the base of a robot is of which nobody says more than its joints, as poses come: at once, from nothing but the poses
/// so far. Else as [`path`] has it with what [`resting`] says of the feet.
pub struct ComingBase<'a> {
    walk: Walk<'a>,
    held: Held,
    /// How much the weight is over the soles, averaged over [`TIPS_S`].
    share: Option<f64>,
}

impl<'a> ComingBase<'a> {
    /// Of a robot that has not been seen yet, and that does not hang.
    #[must_use]
    pub fn new(body: &'a RobotBody, soles: &'a [StandingSole]) -> Self {
        Self { walk: Walk::new(body, soles), held: Held::of(body, soles, false), share: None }
    }

    /// The base in the next pose of the joints, rad, so long after the last, s.
    pub fn next(&mut self, pose: &[f64], dt_s: f64) -> Placement {
        if self.held != Held::Standing {
            return Placement::IDENTITY;
        }
        let (mut footfall, share) = self.walk.rests(pose);
        let before = self.share.unwrap_or(share.x);
        let share = before + (1.0 - (-dt_s.max(0.0) / TIPS_S).exp()) * (share.x - before);
        self.share = Some(share);
        footfall.flat = footfall.carries.map(|carries| carries * share);
        self.walk.next(pose, Some(footfall)).0
    }
}

/// Height of the lowest corner of the soles of an upright robot above its base, m.
fn lowest_m(body: &RobotBody, soles: &[StandingSole], pose: &[f64]) -> f64 {
    let placed = body.tree.place(Placement::IDENTITY, &body.angles(pose));
    let corners = soles
        .iter()
        .flat_map(|sole| sole.corners_m.iter().map(|corner| placed[sole.link].point(*corner).z));
    corners.fold(f64::INFINITY, f64::min)
}

/// A robot that goes on from pose to pose.
struct Walk<'a> {
    body: &'a RobotBody,
    soles: &'a [StandingSole],
    /// Corners over the floor, m, what each carried, and the heading of the base, rad.
    before: Option<(Vec<(DVec2, f64)>, f64)>,
    /// Where whoever did it looked, rad.
    looked_rad: Option<f64>,
}

impl<'a> Walk<'a> {
    const fn new(body: &'a RobotBody, soles: &'a [StandingSole]) -> Self {
        Self { body, soles, before: None, looked_rad: None }
    }

    fn next(&mut self, pose: &[f64], footfall: Option<Footfall>) -> (Placement, [bool; 2]) {
        let placed = self.body.tree.place(Placement::IDENTITY, &self.body.angles(pose));
        let corners = |sole: &'a StandingSole| {
            let place = placed[sole.link];
            sole.corners_m.iter().map(move |corner| place.point(*corner))
        };
        let footfall = footfall.unwrap_or_else(|| self.guess(&placed));
        let upright = self.upright(&placed, &footfall);
        let seen: Vec<(DVec3, usize)> = self
            .soles
            .iter()
            .flat_map(|sole| corners(sole).map(|corner| (upright * corner, sole.side)))
            .collect();
        let low_m = seen.iter().map(|(corner, _)| corner.z).fold(f64::INFINITY, f64::min);
        let low = |side: usize| {
            let of = seen.iter().filter(|(_, of)| *of == side);
            of.map(|(corner, _)| corner.z - low_m).fold(f64::INFINITY, f64::min)
        };
        let lows = [low(0), low(1)];
        let weighed: Vec<(DVec2, f64)> = seen
            .iter()
            .map(|(corner, side)| {
                let near = |to_m: f64| (-(corner.z - low_m - to_m) / CARRIES_M).exp();
                // A foot that is meant to stand leads, even if the other scrapes along below it.
                let weight = footfall.carries[*side] * near(lows[*side]) + FAINT * near(0.0);
                (corner.truncate(), weight)
            })
            .collect();
        let (heading, shift) = match &self.before {
            None => (0.0, DVec2::ZERO),
            Some((before, heading)) => {
                let turns = footfall.heading_rad.zip(self.looked_rad);
                let turns_rad = turns.map_or(0.0, |(now_rad, before_rad)| now_rad - before_rad);
                // Nothing holds who flies: it turns as whoever did it.
                let carried = footfall.carries[0].max(footfall.carries[1]).min(1.0);
                let held_m2 =
                    HEADING_M2 + turns.map_or(0.0, |_| (1.0 - carried).powi(4) * FLIES_M2);
                laid_over(&weighed, before, heading + turns_rad, held_m2)
            }
        };
        self.looked_rad = footfall.heading_rad.or(self.looked_rad);
        let turn = DVec2::from_angle(heading);
        let over_floor = weighed.iter().map(|(at, weight)| (turn.rotate(*at) + shift, *weight));
        self.before = Some((over_floor.collect(), heading));
        let down = lows.map(|low_m| low_m < ON_FLOOR_M);
        let stands = match footfall.touches {
            Some(touches) if touches != [false; 2] => touches,
            _ => down,
        };
        let place = Placement {
            at_m: shift.extend(-low_m),
            turn: DQuat::from_rotation_z(heading) * upright,
        };
        (place, stands)
    }

    /// Sets upright what is placed with its base in its own axes: on the plane that fits the soles that
    /// lie flat best, as if they stood on springs, and where none does by the trunk.
    fn upright(&self, placed: &[Placement], footfall: &Footfall) -> DQuat {
        let flattest = footfall.flat[0].max(footfall.flat[1]);
        let level =
            |sole: &StandingSole| placed[sole.link].turn * sole.normal * footfall.flat[sole.side];
        let trunk = footfall.up * (FAINT + (1.0 - flattest).max(0.0));
        let up = trunk + self.soles.iter().map(level).sum::<DVec3>();
        let nearly = DQuat::from_rotation_arc(up.try_normalize().unwrap_or(DVec3::Z), DVec3::Z);
        // The slope of the plane that is left, by least squares; the trunk holds it where soles do not.
        let held_m2 = TRUNK_M2 * (1.0 - flattest).max(HOLDS);
        let trunk = nearly * footfall.up;
        let upward = trunk.z.max(UPWARD);
        let (mut normal, mut side) =
            (DMat2::IDENTITY * held_m2, -trunk.truncate() / upward * held_m2);
        let corners = || {
            self.soles.iter().flat_map(|sole| {
                let (place, weight) = (placed[sole.link], footfall.flat[sole.side]);
                let share = weight / sole.corners_m.len().max(1) as f64;
                sole.corners_m.iter().map(move |corner| (nearly * place.point(*corner), share))
            })
        };
        let total: f64 = corners().map(|(_, share)| share).sum();
        let middle = corners().map(|(corner, share)| corner * share).sum::<DVec3>();
        let middle = if total > 0.0 { middle / total } else { DVec3::ZERO };
        for (corner, share) in corners() {
            let away = corner - middle;
            let level = away.truncate();
            normal += DMat2::from_cols(level * level.x, level * level.y) * share;
            side += level * (away.z * share);
        }
        let slope = normal.inverse() * side;
        let plane = DVec3::new(-slope.x, -slope.y, 1.0).normalize();
        (DQuat::from_rotation_arc(plane, DVec3::Z) * nearly).normalize()
    }

    /// What the feet do in a pose, and along x how much the weight is over them.
    fn rests(&self, pose: &[f64]) -> (Footfall, DVec3) {
        let placed = self.body.tree.place(Placement::IDENTITY, &self.body.angles(pose));
        let guessed = self.guess(&placed);
        let upright = self.upright(&placed, &guessed);
        let corners = self.soles.iter().flat_map(|sole| {
            sole.corners_m.iter().map(|at_m| upright * placed[sole.link].point(*at_m))
        });
        let corners: Vec<DVec3> = corners.collect();
        let low_m = corners.iter().map(|corner| corner.z).fold(f64::INFINITY, f64::min);
        let down = corners.iter().filter(|corner| corner.z - low_m < ON_FLOOR_M);
        let support = SupportPolygon::of(&down.map(|corner| corner.truncate()).collect::<Vec<_>>());
        let weight = (upright * self.body.tree.centre_of_mass_m(&placed)).truncate();
        let inside_m = support.margin_m(weight).unwrap_or(f64::NEG_INFINITY);
        let share = ((inside_m + OUTSIDE_M) / OUTSIDE_M).clamp(0.0, 1.0);
        (guessed, DVec3::X * (share * share * (3.0 - 2.0 * share)))
    }

    /// What the feet do, from where they are under an upright robot.
    fn guess(&self, placed: &[Placement]) -> Footfall {
        let low = |side: usize| {
            let of = self.soles.iter().filter(|sole| sole.side == side);
            let corners = of.flat_map(|sole| {
                sole.corners_m.iter().map(|corner| placed[sole.link].point(*corner).z)
            });
            corners.fold(f64::INFINITY, f64::min)
        };
        let (left, right) = (low(0), low(1));
        let share = |own: f64, other: f64| {
            let higher = (own - other).max(0.0);
            if higher.is_finite() { (-higher / STANDS_M).exp() } else { 0.0 }
        };
        let carries = [share(left, right), share(right, left)];
        Footfall { carries, flat: carries, ..Footfall::STANDING }
    }
}

/// The turn, rad, and the shift, m, that lay points over where they were, each with the weight it had and
/// has; the turn is near `expected` where the points do not say it: held there as by points of so many m².
fn laid_over(
    points: &[(DVec2, f64)],
    were: &[(DVec2, f64)],
    expected: f64,
    held_m2: f64,
) -> (f64, DVec2) {
    let pairs = || {
        let both = points.iter().zip(were);
        both.map(|((now, weight), (then, had))| (*now, *then, (weight * had).sqrt()))
    };
    let total: f64 = pairs().map(|(.., weight)| weight).sum();
    if !(total > 0.0) {
        return (expected, DVec2::ZERO);
    }
    let (mut now_m, mut then_m) = (DVec2::ZERO, DVec2::ZERO);
    for (now, then, weight) in pairs() {
        now_m += now * (weight / total);
        then_m += then * (weight / total);
    }
    let (mut along, mut across) = (held_m2 * expected.cos(), held_m2 * expected.sin());
    for (now, then, weight) in pairs() {
        let (now, then, weight) = (now - now_m, then - then_m, weight / total);
        along += weight * now.dot(then);
        across += weight * now.perp_dot(then);
    }
    let turned = across.atan2(along);
    // Without jumps of a turn.
    let heading = expected + crate::units::wrap_rad(turned - expected);
    (heading, then_m - DVec2::from_angle(heading).rotate(now_m))
}
