//! Where the centre of mass has to go so that the floor can push where soles are.
//!
//! The zero-moment point of a centre of mass at height z is c - z/g c'' (the cart on a table: Kajita et al., "Biped
//! walking pattern generation by using preview control of zero-moment point", ICRA 2003). The way of the centre over
//! the floor is planned for the whole clip at once, as near as can be to where it would go, so that this
//! point lies inside the soles that carry: a convex problem in two unknowns a node. Legs then follow it.

use super::{Adjusting, Banded, Clip, NODES_HZ, Normal, Solver, Stance};
use crate::error::Error;
use crate::motion::{End, Spline};
use crate::retarget::balance::{Balance, FloorLoad, falls_at};
use crate::retarget::base::{self, BasePath, Held, StandingSole};
use crate::retarget::fall::OnFloor;
use crate::retarget::{Footfall, footfall};
use crate::rigid::Placement;
use crate::rigid::ground::{GRAVITY_M_S2, SupportPolygon};
use glam::{DVec2, DVec3};

/// How far inside the point is to be, as part of what a sole reaches from its middle in that direction.
const INSIDE: f64 = 0.75;
/// What is less far inside counts, against a centre that is as far from where it would go.
const MISSING: f64 = 300.0;
/// What a change of the way counts: of its velocity, s.
const VELOCITY_S: f64 = 0.05;
/// So long before the other foot leaves the floor and after it has come down one carries alone, s.
const ALONE_S: f64 = 0.1;
/// Of how many times its acceleration the point is planned: servos give way, and legs are not a point.
const HASTE: f64 = 2.0;
/// Most steps of the plan.
const STEPS: usize = 60;
/// A centre that is not where it was planned to be, 1/m.
const FOLLOWS: f64 = 200.0;

/// A point that is so far less inside asks for more time, m.
const SHORT_M: f64 = 0.004;
/// How often a clip is slowed, and by how much each time, as a logarithm.
const SLOWINGS: usize = 40;
const SLOWING: f64 = 0.2;
/// Nodes before and after one that asks for time over which pace changes.
const AROUND: usize = 9;
/// Most that a clip is slowed anywhere for balance alone.
const SLOWEST: f64 = 10.0;

/// The same of poses that are moved already, and how far inside the support they are to be then, m.
const STEADYINGS: usize = 16;
const STEADY_M: f64 = 0.004;
/// What is made and stays so far inside as it is, as part of a sole's half width, is not moved.
const WELL: f64 = 0.3;
/// How often these are looked at, at least, per second.
const LOOK_HZ: f64 = 50.0;

/// By node, which soles may carry: both if both are planted and stay so for a while.
fn carriers(stands: &[[bool; 2]], steps_s: &[f64]) -> Vec<[bool; 2]> {
    let mut times_s = Vec::with_capacity(stands.len());
    let mut time_s = 0.0;
    for step_s in steps_s {
        times_s.push(time_s);
        time_s += step_s;
    }
    let one = |at: usize| {
        let far = |node: &usize| (times_s[*node] - times_s[at]).abs() > ALONE_S;
        let from = (0..at).rev().find(far).map_or(0, |far| far + 1);
        let to = (at..stands.len()).find(far).unwrap_or(stands.len());
        let around = from..to;
        let off = |side: usize| stands[around.clone()].iter().any(|stands| !stands[side]);
        match (stands[at], off(0), off(1)) {
            ([true, true], true, false) => [false, true],
            ([true, true], false, true) => [true, false],
            (stands, ..) => stands,
        }
    };
    (0..stands.len()).map(one).collect()
}

/// A foot on the floor: where the middle of its sole is, m, and its forward.
#[derive(Clone, Copy)]
struct Foothold {
    at_m: DVec2,
    forward: DVec2,
}

impl Foothold {
    fn out(&self, own_m: DVec2) -> DVec2 {
        self.at_m + self.forward.rotate(own_m)
    }

    fn turned_back(&self, way: DVec2) -> DVec2 {
        DVec2::new(self.forward.x, -self.forward.y).rotate(way)
    }

    fn own(&self, at_m: DVec2) -> DVec2 {
        self.turned_back(at_m - self.at_m)
    }
}

/// Where the centre is to be at a node, as a foot that stands sees it.
#[derive(Clone, Copy)]
pub(super) struct Goal {
    pub(super) side: usize,
    pub(super) at_m: DVec2,
    /// What it counts not to be there, 1/m.
    pub(super) weight: f64,
}

/// A node of the plan.
struct Point {
    side: usize,
    foothold: Foothold,
    /// What its sole reaches forward and aside from its middle, m.
    half_m: DVec2,
    /// Where the centre would go, m.
    comes_m: DVec2,
    height_m: f64,
    /// That height over what accelerates it, in steps squared.
    pull: f64,
    /// Corners of both soles, m.
    soles_m: [Vec<DVec2>; 2],
    support_m: Vec<DVec2>,
}

impl Point {
    fn load(&mut self, carries: [bool; 2], step_s: f64) {
        let soles = self.soles_m.iter().zip(carries).filter(|(_, carries)| *carries);
        let corners: Vec<DVec2> = soles.flat_map(|(sole, _)| sole.iter().copied()).collect();
        self.support_m = SupportPolygon::of(&corners).corners_m().to_vec();
        self.pull = HASTE * self.height_m.max(0.0) / GRAVITY_M_S2 / step_s.powi(2);
    }
}

/// What pace a clip needs so that whoever does it stays on its feet.
#[derive(Clone, Debug, PartialEq)]
pub enum Pace {
    /// As it is.
    Even,
    /// At each of these times of it, in samples, one after the other.
    Slowed(Vec<f64>),
    /// None helps.
    Hopeless,
}

impl Stance {
    /// Plans the way of the centre of mass from where it is in these poses.
    pub(super) fn weigh(&mut self, solver: &Solver<'_>, poses: &[Vec<f64>], step_s: f64) {
        let Some(feet) = solver.feet() else { return };
        self.goals = vec![None; poses.len()];
        let mut runs = self.runs(solver, feet, poses);
        let carries = carriers(&self.stands, &vec![step_s; poses.len()]);
        for (first, points) in &mut runs {
            for (point, carries) in points.iter_mut().zip(&carries[*first..]) {
                point.load(*carries, step_s);
            }
            for (i, to_m) in plan(points).into_iter().enumerate() {
                let Point { side, foothold, .. } = points[i];
                self.goals[*first + i] =
                    Some(Goal { side, at_m: foothold.own(to_m), weight: FOLLOWS });
            }
        }
    }

    /// What pace these poses need, node by node at `step_s`: how many times as long each takes. None if none
    /// helps.
    pub(super) fn pace(
        &self,
        solver: &Solver<'_>,
        poses: &[Vec<f64>],
        step_s: f64,
    ) -> Option<Vec<f64>> {
        let feet = solver.feet()?;
        let mut runs = self.runs(solver, feet, poses);
        let mut pace = vec![0.0_f64; poses.len()];
        for round in 0.. {
            let steps_s: Vec<f64> = pace.iter().map(|pace| step_s * pace.exp()).collect();
            let carries = carriers(&self.stands, &steps_s);
            let mut asks = vec![false; poses.len()];
            for (first, points) in &mut runs {
                for (i, point) in points.iter_mut().enumerate() {
                    point.load(carries[*first + i], steps_s[*first + i]);
                }
                let way_m = plan(points);
                for i in 0..points.len() {
                    let short_m = short_m(points, &way_m, i);
                    asks[*first + i] = short_m > SHORT_M && pace[*first + i] < SLOWEST.ln();
                }
            }
            if round == SLOWINGS || !asks.contains(&true) {
                return self
                    .stays(&runs, &steps_s)
                    .then(|| pace.iter().map(|pace| pace.exp()).collect());
            }
            slow(&mut pace, &asks);
        }
        None
    }

    /// Whether nobody falls who goes as planned.
    fn stays(&self, runs: &[(usize, Vec<Point>)], steps_s: &[f64]) -> bool {
        let finest_s = steps_s.iter().copied().fold(f64::INFINITY, f64::min);
        runs.iter().all(|(first, points)| {
            let way_m = plan(points);
            let mut margins_m = Vec::new();
            for i in 0..points.len() {
                let short_m = short_m(points, &way_m, i);
                let times = (steps_s[first + i] / finest_s).round() as usize;
                let inside_m = INSIDE * points[i].half_m.min_element();
                margins_m.extend(std::iter::repeat_n(Some(inside_m - short_m), times));
            }
            let height_m = points.iter().map(|point| point.height_m).fold(0.0, f64::max);
            falls_at(&margins_m, finest_s, height_m).is_none()
        })
    }

    /// Nodes one after the other in which a foot stands, with the first of them.
    fn runs(
        &self,
        solver: &Solver<'_>,
        feet: [&StandingSole; 2],
        poses: &[Vec<f64>],
    ) -> Vec<(usize, Vec<Point>)> {
        let mut runs: Vec<(usize, Vec<Point>)> = Vec::new();
        for (at, pose) in poses.iter().enumerate() {
            if self.stands[at] == [false; 2] {
                continue;
            }
            let last = runs.last_mut().filter(|(first, points)| first + points.len() == at);
            let before = last.as_ref().and_then(|(_, points)| points.last());
            let point = self.point(solver, feet, at, pose, before);
            match last {
                Some((_, points)) => points.push(point),
                None => runs.push((at, vec![point])),
            }
        }
        runs
    }

    fn point(
        &self,
        solver: &Solver<'_>,
        feet: [&StandingSole; 2],
        at: usize,
        pose: &[f64],
        before: Option<&Point>,
    ) -> Point {
        let placed = solver.place(pose);
        let centre_m = solver.of.body.tree.centre_of_mass_m(&placed);
        let frames = feet.map(Solver::frame);
        let own = |side: usize, at_m: DVec3| {
            let place = placed[frames[side].link];
            let away = at_m - place.point(frames[side].at_m);
            DVec3::from(frames[side].axes.map(|axis| (place.turn * axis).dot(away)))
        };
        let stands = self.stands[at];
        let (side, foothold) = match before {
            None => {
                let side = usize::from(!stands[0]);
                (side, Foothold { at_m: DVec2::ZERO, forward: DVec2::X })
            }
            Some(before) if stands[before.side] => (before.side, before.foothold),
            // The other foot is where it is beside the one that stood until now.
            Some(before) => {
                let side = 1 - before.side;
                let other = placed[frames[side].link];
                let origin_m = other.point(frames[side].at_m);
                let ahead_m = origin_m + other.turn * frames[side].axes[0];
                let [from, to] = [origin_m, ahead_m].map(|at_m| own(before.side, at_m).truncate());
                let forward = (to - from).try_normalize().unwrap_or(DVec2::X);
                let forward = before.foothold.forward.rotate(forward);
                (side, Foothold { at_m: before.foothold.out(from), forward })
            }
        };
        let centre = own(side, centre_m);
        let over_floor = |foot: usize| {
            let corners = feet[foot].corners_m.iter();
            let placed = corners.map(|corner| placed[feet[foot].link].point(*corner));
            placed.map(|corner| foothold.out(own(side, corner).truncate())).collect()
        };
        Point {
            side,
            foothold,
            half_m: half_m(feet[side]),
            comes_m: foothold.out(centre.truncate()),
            height_m: centre.z,
            pull: 0.0,
            soles_m: [over_floor(0), over_floor(1)],
            support_m: Vec::new(),
        }
    }
}

/// Slows a pace, as logarithms, around nodes that ask for it.
fn slow(pace: &mut [f64], asks: &[bool]) {
    let mut slowing = vec![0.0_f64; pace.len()];
    for at in (0..pace.len()).filter(|at| asks[*at]) {
        let around = at.saturating_sub(AROUND)..(at + AROUND + 1).min(pace.len());
        for node in around {
            let part = node.abs_diff(at) as f64 / (AROUND + 1) as f64;
            let share = 0.5 * (1.0 + (std::f64::consts::PI * part).cos());
            slowing[node] = slowing[node].max(SLOWING * share);
        }
    }
    for (pace, slowing) in pace.iter_mut().zip(slowing) {
        *pace += slowing;
    }
}

/// What pace poses that are balanced at rest need so that nothing they do throws them over, as [`Pace`]; of a
/// clip whose feet do `footfalls`.
///
/// # Errors
/// A rate at which nothing can be filtered.
pub fn steady(of: &Adjusting<'_>, angles_rad: &[Vec<f64>]) -> Result<Pace, Error> {
    let (Some(footfalls), Some(slower)) = (of.footfalls, of.slower) else { return Ok(Pace::Even) };
    let count = angles_rad.first().map_or(0, Vec::len);
    if count < 3 {
        return Ok(Pace::Even);
    }
    let stride = ((of.rate_hz / NODES_HZ).round() as usize).max(1);
    let nodes = (count - 1).div_ceil(stride) + 1;
    let look = Look::of(of, footfalls, slower, angles_rad)?;
    let mut pace = vec![0.0; nodes];
    let mut stays: Option<Vec<f64>> = None;
    for round in 0..=STEADYINGS {
        let factors: Vec<f64> = pace.iter().map(|pace: &f64| pace.exp()).collect();
        let (times, balance) = look.at(clock(&factors, stride, count))?;
        match balance.falls_at {
            None => stays = Some(factors),
            // Slower is worse: what is passed through quickly does no harm.
            Some(_) if stays.is_some() => break,
            Some(_) => {}
        }
        let mut asks = vec![false; nodes];
        for (time, margin_m) in times.iter().zip(&balance.margins_m) {
            let node = ((time / stride as f64).round() as usize).min(nodes - 1);
            let is_short = margin_m.is_some_and(|margin_m| margin_m < STEADY_M);
            asks[node] |= is_short && pace[node] < SLOWEST.ln();
        }
        if round == STEADYINGS || !asks.contains(&true) {
            break;
        }
        slow(&mut pace, &asks);
    }
    Ok(match stays {
        None => Pace::Hopeless,
        Some(factors) if factors.iter().all(|factor| *factor == 1.0) => Pace::Even,
        Some(factors) => Pace::Slowed(clock(&factors, stride, count)),
    })
}

/// Whether these poses stay well on their feet as they are, at their own pace.
///
/// # Errors
/// A rate at which nothing can be filtered.
pub fn is_steady(of: &Adjusting<'_>, angles_rad: &[Vec<f64>]) -> Result<bool, Error> {
    let solver = Solver::new(of.robot);
    let (Some(feet), Some(balance)) = (solver.feet(), at_own_pace(of, angles_rad)?) else {
        return Ok(true);
    };
    let well_m = WELL * half_m(feet[0]).min_element();
    let least_m = balance.margins_m.iter().flatten().copied().fold(f64::INFINITY, f64::min);
    Ok(least_m >= well_m)
}

/// Whether these poses keep off a fall as they are, at their own pace.
///
/// # Errors
/// A rate at which nothing can be filtered.
pub fn stays(of: &Adjusting<'_>, angles_rad: &[Vec<f64>]) -> Result<bool, Error> {
    Ok(at_own_pace(of, angles_rad)?.is_none_or(|balance| balance.falls_at.is_none()))
}

/// Who stays up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Survival {
    /// With servos that give way as much as the robot's do.
    pub as_they_are: bool,
    /// With soft ones.
    pub softly: bool,
}

impl Survival {
    /// With either.
    #[must_use]
    pub const fn in_any_case(self) -> bool {
        self.as_they_are && self.softly
    }
}

/// Whether nobody falls in these poses at their own pace; nobody does of whom the file does not say how servos give way.
///
/// # Errors
/// Of a spline.
pub fn survives(of: &Adjusting<'_>, angles_rad: &[Vec<f64>]) -> Result<Survival, Error> {
    let count = angles_rad.first().map_or(0, Vec::len);
    let unknown = Survival { as_they_are: true, softly: true };
    let (Some(footfalls), Some(slower), Some(drives)) =
        (of.footfalls, of.slower, &of.robot.body.drives)
    else {
        return Ok(unknown);
    };
    if count < 3 {
        return Ok(unknown);
    }
    let look = Look::of(of, footfalls, slower, angles_rad)?;
    let Looked { poses, path, .. } = look.looked((0..count).map(|at| at as f64).collect());
    let (body, soles) = (of.robot.body, look.soles.as_slice());
    let (poses, path) = (poses.as_slice(), &path);
    let on = OnFloor { body, soles, drives, stiffness: 1.0, friction: 1.0, poses, path };
    Ok(Survival { as_they_are: on.lost_at().is_none(), softly: on.softly().lost_at().is_none() })
}

/// How a motion does on the floor as it is; nothing of one that does not stand, or of less than three poses.
fn at_own_pace(of: &Adjusting<'_>, angles_rad: &[Vec<f64>]) -> Result<Option<Balance>, Error> {
    let count = angles_rad.first().map_or(0, Vec::len);
    let (Some(footfalls), Some(slower)) = (of.footfalls, of.slower) else { return Ok(None) };
    if count < 3 {
        return Ok(None);
    }
    let look = Look::of(of, footfalls, slower, angles_rad)?;
    Ok(Some(look.at((0..count).map(|at| at as f64).collect())?.1))
}

/// Poses of a motion, at what times of it, and where the base is then.
struct Looked {
    times: Vec<f64>,
    poses: Vec<Vec<f64>>,
    path: BasePath,
}

/// How a motion does on the floor at any pace.
struct Look<'a> {
    of: &'a Adjusting<'a>,
    footfalls: &'a [Footfall],
    slower: f64,
    soles: Vec<StandingSole>,
    splines: Vec<Spline>,
}

impl<'a> Look<'a> {
    fn of(
        of: &'a Adjusting<'a>,
        footfalls: &'a [Footfall],
        slower: f64,
        angles_rad: &[Vec<f64>],
    ) -> Result<Self, Error> {
        let spline = |series: &Vec<f64>| Spline::through(series.clone(), 1.0, End::Free, End::Free);
        let splines = angles_rad.iter().map(spline).collect::<Result<_, _>>()?;
        Ok(Self { of, footfalls, slower, soles: StandingSole::all(of.robot.body), splines })
    }

    /// Some of these times, in samples, one after the other, and what it does then.
    fn looked(&self, times: Vec<f64>) -> Looked {
        let played_hz = self.of.rate_hz / self.slower;
        let skip = (played_hz / LOOK_HZ).floor().max(1.0) as usize;
        let times: Vec<f64> = times.into_iter().step_by(skip).collect();
        let rate_hz = played_hz / skip as f64;
        let pose = |time: &f64| self.splines.iter().map(|spline| spline.sample(*time)[0]).collect();
        let poses: Vec<Vec<f64>> = times.iter().map(pose).collect();
        let said = footfall::at_times(self.footfalls, &times, rate_hz);
        let said = |at: usize| said.get(at).copied();
        let body = self.of.robot.body;
        let path = base::path(body, &self.soles, Held::Standing, &poses, rate_hz, said);
        Looked { times, poses, path }
    }

    /// What becomes of it at these times, in samples, one after the other; the times that were looked at.
    fn at(&self, times: Vec<f64>) -> Result<(Vec<f64>, Balance), Error> {
        let body = self.of.robot.body;
        let Looked { times, poses, path } = self.looked(times);
        let rate_hz = path.rate_hz;
        let mut load = FloorLoad::new(body, &self.soles, rate_hz);
        for (pose, place) in poses.iter().zip(&path.places) {
            load.next(&body.tree.place(*place, &body.angles(pose)));
        }
        Ok((times, load.finish()?))
    }
}

/// The times of a clip, in samples, that follow one another evenly in it at this pace: of nodes `stride` samples
/// apart, how many times as long each takes.
pub(super) fn clock(pace: &[f64], stride: usize, samples: usize) -> Vec<f64> {
    let end = samples.saturating_sub(1) as f64;
    let at = |sample: f64| {
        let along = (sample / stride as f64).clamp(0.0, (pace.len() - 1) as f64);
        let (node, share) = (along as usize, along.fract());
        let next = pace[(node + 1).min(pace.len() - 1)];
        pace[node] + (next - pace[node]) * share
    };
    let mut times = vec![0.0];
    let mut here = 0.0;
    while here < end - 1e-9 {
        // The midpoint rule.
        let half = here + 0.5 / at(here);
        here += 1.0 / at(half);
        times.push(here);
    }
    // The last one is the end.
    let stretch = if here > 0.0 { end / here } else { 1.0 };
    times.iter().map(|time| time * stretch).collect()
}

/// Parts of the zero-moment point of a node by the three nodes around it; without pull the point under the centre.
fn parts(points: &[Point], at: usize, pull: f64) -> [(usize, f64); 3] {
    let last = points.len() - 1;
    // Before the first and after the last it rests.
    let (before, after) = (at.saturating_sub(1), (at + 1).min(last));
    [(before, -pull), (at, 1.0 + 2.0 * pull), (after, -pull)]
}

/// Something that is not far enough inside an edge.
struct Missing {
    inward: DVec2,
    missing_m: f64,
    parts: [(usize, f64); 3],
}

/// What is missing of how far inside each edge the centre of a node and its zero-moment point lie.
fn missing(points: &[Point], way_m: &[DVec2], at: usize) -> Vec<Missing> {
    let hull = &points[at].support_m;
    let count = if hull.len() < 3 { 0 } else { hull.len() };
    let mut found = Vec::new();
    for pull in [0.0, points[at].pull] {
        let parts = parts(points, at, pull);
        let point_m: DVec2 = parts.iter().map(|(node, part)| way_m[*node] * *part).sum();
        for i in 0..count {
            let along = (hull[(i + 1) % count] - hull[i]).try_normalize();
            let Some(inward) = along.map(DVec2::perp) else { continue };
            let own = points[at].foothold.turned_back(inward);
            let inside_m = INSIDE * (own * points[at].half_m).length();
            let missing_m = inside_m - inward.dot(point_m - hull[i]);
            if missing_m > 0.0 {
                found.push(Missing { inward, missing_m, parts });
            }
        }
    }
    found
}

/// The most that is missing at a node, m.
fn short_m(points: &[Point], way_m: &[DVec2], at: usize) -> f64 {
    let found = missing(points, way_m, at);
    found.iter().map(|missing| missing.missing_m).fold(0.0, f64::max)
}

/// The way of the centre, m: Newton's method on a convex cost of squares, with steps halved that do not pay.
fn plan(points: &[Point]) -> Vec<DVec2> {
    let mut way_m: Vec<DVec2> = points.iter().map(|point| point.comes_m).collect();
    if points.len() < 2 {
        return way_m;
    }
    let height = |point: &Point| point.pull.max(1e-9);
    // Steps per second, from the pull of an upright pendulum: its height hardly changes.
    let velocity: Vec<f64> =
        points.iter().map(|point| VELOCITY_S.powi(2) * height(point) * 40.0).collect();
    let added = |way_m: &[DVec2], at: usize| way_m[at] - points[at].comes_m;
    let cost = |way_m: &[DVec2]| -> f64 {
        let node = |at: usize| {
            let short = missing(points, way_m, at);
            let short: f64 = short.iter().map(|missing| missing.missing_m.powi(2)).sum();
            let near = added(way_m, at).length_squared();
            let change =
                if at == 0 { DVec2::ZERO } else { added(way_m, at) - added(way_m, at - 1) };
            near + MISSING * short + velocity[at] * change.length_squared()
        };
        (0..points.len()).map(node).sum()
    };
    let mut here = cost(&way_m);
    for _ in 0..STEPS {
        let mut system = Banded::new(2 * points.len(), 5);
        for (at, velocity) in velocity.iter().copied().enumerate() {
            let near = added(&way_m, at);
            for (axis, near) in [near.x, near.y].into_iter().enumerate() {
                system.side[2 * at + axis] -= near;
                *system.entry(2 * at + axis, 2 * at + axis) += 1.0;
            }
            if at > 0 {
                let change = near - added(&way_m, at - 1);
                for (axis, change) in [change.x, change.y].into_iter().enumerate() {
                    let (i, j) = (2 * at + axis, 2 * at - 2 + axis);
                    system.side[i] -= velocity * change;
                    system.side[j] += velocity * change;
                    *system.entry(i, i) += velocity;
                    *system.entry(j, j) += velocity;
                    *system.entry(i, j) -= velocity;
                }
            }
            for Missing { inward, missing_m, parts } in missing(points, &way_m, at) {
                let mut row = [0.0; 6];
                let first = at.saturating_sub(1);
                for (node, part) in parts {
                    row[2 * (node - first)] -= part * inward.x;
                    row[2 * (node - first) + 1] -= part * inward.y;
                }
                for (i, one) in row.iter().enumerate().filter(|(_, one)| **one != 0.0) {
                    system.side[2 * first + i] -= MISSING * one * missing_m;
                    for (j, other) in row.iter().enumerate().take(i + 1) {
                        if *other != 0.0 {
                            *system.entry(2 * first + i, 2 * first + j) += MISSING * one * other;
                        }
                    }
                }
            }
        }
        let Some(steps) = system.solve() else { break };
        let mut share = 1.0;
        let mut better = None;
        while share > 1e-3 {
            let tried: Vec<DVec2> = way_m
                .iter()
                .zip(steps.chunks(2))
                .map(|(at_m, step)| *at_m + DVec2::new(step[0], step[1]) * share)
                .collect();
            let there = cost(&tried);
            if there < here {
                better = Some((there, tried));
                break;
            }
            share *= 0.5;
        }
        let Some((there, tried)) = better else { break };
        let done = there > here * (1.0 - 1e-6);
        (here, way_m) = (there, tried);
        if done {
            break;
        }
    }
    way_m
}

impl Clip<'_> {
    /// Adds what it costs that the centre is not where it was planned to be.
    pub(super) fn follow(
        &self,
        goal: Goal,
        feet: [&StandingSole; 2],
        placed: &[Placement],
        row: &mut [f64],
        normal: &mut Normal,
    ) {
        let tree = &self.solver.of.body.tree;
        let centre_m = tree.centre_of_mass_m(placed);
        let slopes_m = self.solver.centre_slopes_m(placed);
        let frame = Solver::frame(feet[goal.side]);
        let place = placed[frame.link];
        let away = centre_m - place.point(frame.at_m);
        for (axis, goal_m) in frame.axes.into_iter().zip([goal.at_m.x, goal.at_m.y]) {
            let axis = place.turn * axis;
            for (row, joint) in row.iter_mut().zip(&self.part.joints) {
                *row = axis.dot(slopes_m[*joint]);
            }
            // As carried along by the foot it does not move.
            self.velocity(row, placed, frame.link, centre_m, -axis);
            normal.add(row, axis.dot(away) - goal_m, goal.weight * goal.weight);
        }
    }
}

/// What a sole reaches forward and aside from its middle, m.
pub(super) fn half_m(sole: &StandingSole) -> DVec2 {
    let frame = Solver::frame(sole);
    let reach = |axis: DVec3| {
        let along = sole.corners_m.iter().map(|corner| axis.dot(*corner - frame.at_m).abs());
        along.fold(0.0, f64::max)
    };
    DVec2::new(reach(frame.axes[0]), reach(frame.axes[1]))
}
