//! The least change of a motion after which a robot is not in itself and its feet stand.
//!
//! Directions of limbs are found limb by limb ([`crate::mocap::retarget`]), blind to what else is there. Here
//! all poses of a clip are moved together, by least squares over the whole of it (Gauss-Newton, banded):
//!
//! * nearness: links stay where they were, each by its own length, and soles as they were turned,
//! * pace: what is added changes slowly, in velocity and in acceleration,
//! * room: links that come nearer to one another than 4 mm are pushed apart,
//! * range: no joint is pushed over its limits,
//! * stance, of a robot on its own feet: while both feet are planted, one sole stays where it is beside the
//!   other and in one plane with it; a planted sole is level under the trunk of the person; a foot in the air
//!   is not below the one that stands,
//! * weight, of such a robot: where the floor has to push lies well inside the soles that carry (`weight`).
//!
//! Legs first, from hip to sole, and then all else: an arm makes way for a leg, never a leg for an arm. Where
//! nothing is near and nothing stands, nothing is changed.

use crate::error::Error;
use crate::mocap::retarget::banded::Banded;
use crate::motion::{End, Spline, saturate};
use crate::retarget::Footfall;
use crate::retarget::base::StandingSole;
use crate::retarget::collision::{SelfContact, TOUCHES_M};
use crate::rigid::{Placement, WayOut};
use crate::robot::RobotBody;
use glam::DVec3;
use nalgebra::{DMatrix, DVector};
use std::ops::Range;

mod online;
mod sag;
mod waiting;
mod weight;

pub use online::{Adjuster, Lifts};
pub use waiting::{FeetMay, Waited, waited};
pub use weight::{Pace, Survival, is_steady, stays, steady, survives};

/// How far apart links are kept, m.
const ROOM_M: f64 = 0.004;
/// What is nearer than that counts, 1/m; 1 is as much as a link that is turned by a radian.
const ROOM_WEIGHT: f64 = 300.0;
/// The same for a joint beyond its range.
const RANGE_WEIGHT: f64 = 10.0;
/// Distance from a limit at which that begins, rad, and in which angles are bent in the end.
const RANGE_MARGIN_RAD: f64 = 0.05;
/// What moving a joint counts by itself, and turning a sole.
const JOINT_WEIGHT: f64 = 0.2;
const SOLE_WEIGHT: f64 = 1.0;
/// What a change of pace counts: velocity, s, and acceleration, s².
const VELOCITY_WEIGHT_S: f64 = 0.03;
const ACCELERATION_WEIGHT_S2: f64 = 0.004;
/// Corners of a sole that are not where they were beside the other, or below it, 1/m.
const STANCE_WEIGHT: f64 = 60.0;
/// A planted sole that is not level.
const LEVEL_WEIGHT: f64 = 3.0;
/// Before and after a foot is planted that comes and goes over this time, s.
const RAMP_S: f64 = 0.1;
/// A foot that leaves the floor for a shorter time does not, s.
const BLINK_S: f64 = 0.1;
/// Most poses per second that are moved by themselves; those in between follow on a spline.
const NODES_HZ: f64 = 60.0;
/// Around poses in which links are too near so many are moved with them, s.
const AROUND_S: f64 = 0.4;
/// How often limits are drawn in for curves that go over them between poses.
const OVERSHOOTS: usize = 3;
/// How often a range is gone over if links are still in one another.
const ROUNDS: usize = 2;
/// How much of [`ROOM_WEIGHT`] counts in so many steps.
const PHASES: [(f64, usize); 3] = [(0.15, 5), (0.5, 5), (1.0, 10)];
/// The same while soles are only laid flat.
const FLAT: [(f64, usize); 2] = [(0.15, 4), (1.0, 4)];
/// Steps that save less than this part of the cost are the last, if so many more in a row do.
const ENOUGH: f64 = 3e-3;
const IDLE: usize = 3;
/// Curvature that is added, for rows that nothing holds.
const DAMPING: f64 = 1e-6;
/// No joint is turned further in one step, rad.
const LONGEST_STEP_RAD: f64 = 0.15;
/// A shorter one ends the search, rad.
const SHORTEST_STEP_RAD: f64 = 2e-3;

/// What gave way.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Adjusted {
    /// Share of the poses in which links were in one another.
    pub before_share: f64,
    /// The same afterwards.
    pub after_share: f64,
    /// By joint, how far it was moved at most, rad.
    pub moved_rad: Vec<f64>,
}

/// A robot whose joints are moved.
#[derive(Clone, Copy, Debug)]
pub struct Adjustable<'a> {
    /// The robot.
    pub body: &'a RobotBody,
    /// The pose it starts in by its file, rad.
    pub start_rad: &'a [f64],
    /// Lowest and highest angle of each of its joints, rad.
    pub limits_rad: &'a [(f64, f64)],
    /// Which of them may be moved.
    pub free: &'a [bool],
}

/// What is adjusted of a whole clip.
#[derive(Clone, Copy, Debug)]
pub struct Adjusting<'a> {
    /// Whose clip it is.
    pub robot: Adjustable<'a>,
    /// Poses per second.
    pub rate_hz: f64,
    /// What its feet do, pose by pose; nothing if it need not stand.
    pub footfalls: Option<&'a [Footfall]>,
    /// How many times as long it takes when it is played, if it is to keep its balance then.
    pub slower: Option<f64>,
}

/// What pace `angles_rad[joint][pose]` need so that a robot on its own feet does not fall, if any helps.
#[must_use]
pub fn pace(of: &Adjusting<'_>, angles_rad: &[Vec<f64>]) -> Pace {
    let count = angles_rad.first().map_or(0, Vec::len);
    let (Some(footfalls), Some(slower)) = (of.footfalls, of.slower) else { return Pace::Even };
    let solver = Solver::new(of.robot);
    let (legs, _) = solver.parts();
    if count < 3 || angles_rad.len() != of.robot.free.len() || legs.joints.is_empty() {
        return Pace::Even;
    }
    let Nodes { stride, nodes, rate_hz, poses } = Nodes::of(of, angles_rad);
    let stance = solver.stance(footfalls, &nodes, of.rate_hz);
    let clip = Clip { solver: &solver, part: &legs, rate_hz, poses: &poses, stance: Some(&stance) };
    let flat = clip.settled(poses.clone(), 0..nodes.len(), &FLAT);
    match stance.pace(&solver, &flat, slower / rate_hz) {
        None => Pace::Hopeless,
        Some(pace) if pace.iter().all(|pace| *pace == 1.0) => Pace::Even,
        Some(pace) => Pace::Slowed(weight::clock(&pace, stride, count)),
    }
}

/// Poses that are moved by themselves.
struct Nodes {
    stride: usize,
    nodes: Vec<usize>,
    rate_hz: f64,
    poses: Vec<Vec<f64>>,
}

impl Nodes {
    fn of(of: &Adjusting<'_>, angles_rad: &[Vec<f64>]) -> Self {
        let last = angles_rad.first().map_or(0, Vec::len).saturating_sub(1);
        let stride = ((of.rate_hz / NODES_HZ).round() as usize).max(1);
        let nodes: Vec<usize> =
            (0..=last.div_ceil(stride)).map(|node| (node * stride).min(last)).collect();
        let pose = |at: &usize| angles_rad.iter().map(|series| series[*at]).collect();
        let poses = nodes.iter().map(pose).collect();
        Self { stride, rate_hz: of.rate_hz / stride as f64, nodes, poses }
    }
}

/// Whether links are in one another in any pose of `angles_rad[joint][pose]`, looked at as often as [`adjust`] does.
#[must_use]
pub fn touches_itself(of: &Adjusting<'_>, angles_rad: &[Vec<f64>]) -> bool {
    let solver = Solver::new(of.robot);
    Nodes::of(of, angles_rad).poses.iter().any(|pose| solver.touches(pose))
}

/// Moves `angles_rad[joint][pose]`.
///
/// # Errors
/// None that is known: of a spline through what is added.
pub fn adjust(of: &Adjusting<'_>, angles_rad: &mut [Vec<f64>]) -> Result<Adjusted, Error> {
    let count = angles_rad.first().map_or(0, Vec::len);
    if count < 3 || angles_rad.len() != of.robot.free.len() {
        return Ok(Adjusted { moved_rad: vec![0.0; angles_rad.len()], ..Adjusted::default() });
    }
    let given = angles_rad.to_vec();
    let solver = Solver::new(of.robot);
    let Nodes { stride, nodes, rate_hz, mut poses } = Nodes::of(of, &given);
    let stance = of.footfalls.map(|footfalls| solver.stance(footfalls, &nodes, of.rate_hz));
    let touching = |poses: &[Vec<f64>]| poses.iter().filter(|pose| solver.touches(pose)).count();
    let before = touching(&poses);
    let (legs, rest) = solver.parts();
    if !legs.joints.is_empty() {
        let clip = Clip { solver: &solver, part: &legs, rate_hz, poses: &poses, stance: None };
        poses = if let Some(mut stance) = stance {
            // Flat first: where a foot stands beside one that lies flat is then seen.
            let whole = 0..nodes.len();
            let flat =
                Clip { stance: Some(&stance), ..clip }.settled(poses.clone(), whole.clone(), &FLAT);
            stance.put(&solver, &flat);
            if let Some(slower) = of.slower {
                stance.weigh(&solver, &flat, slower / rate_hz);
            }
            Clip { stance: Some(&stance), ..clip }.refined(flat, whole)
        } else {
            clip.solved()
        };
    }
    if !rest.joints.is_empty() {
        let clip = Clip { solver: &solver, part: &rest, rate_hz, poses: &poses, stance: None };
        poses = clip.solved();
    }
    let share = |found: usize| found as f64 / nodes.len() as f64;
    let mut told = Adjusted {
        before_share: share(before),
        after_share: share(touching(&poses)),
        moved_rad: Vec::with_capacity(angles_rad.len()),
    };
    for (joint, (series, given)) in angles_rad.iter_mut().zip(&given).enumerate() {
        let added: Vec<f64> =
            nodes.iter().zip(&poses).map(|(at, pose)| pose[joint] - given[*at]).collect();
        let mut moved_rad = 0.0_f64;
        if added.iter().any(|added| *added != 0.0) {
            let is_moved: Vec<bool> = added.iter().map(|added| *added != 0.0).collect();
            let spline = Spline::through(added, stride as f64, End::Free, End::Free)?;
            for (at, angle) in series.iter_mut().enumerate() {
                // A spline goes on swinging a little where nothing is added.
                if is_moved[at / stride] || is_moved[at.div_ceil(stride)] {
                    *angle += spline.sample(at as f64)[0];
                }
            }
            hold(series, given, of.robot.limits_rad[joint])?;
            let apart_rad = series.iter().zip(given).map(|(angle, given)| (angle - given).abs());
            moved_rad = apart_rad.fold(0.0, f64::max);
        }
        told.moved_rad.push(moved_rad);
    }
    Ok(told)
}

/// Draws curves that go over the limits between poses in; all others stay as they are.
///
/// # Errors
/// None that is known: of a spline.
pub fn drawn_in(limits_rad: &[(f64, f64)], angles_rad: &mut [Vec<f64>]) -> Result<(), Error> {
    for (series, limits_rad) in angles_rad.iter_mut().zip(limits_rad) {
        let reach = Spline::through(series.clone(), 1.0, End::Free, End::Free)?.extremes().position;
        if reach.max.value > limits_rad.1 || reach.min.value < limits_rad.0 {
            let given = vec![f64::NAN; series.len()];
            hold(series, &given, *limits_rad)?;
        }
    }
    Ok(())
}

/// Bends angles that are not as given into the limits, so far that a curve through them stays inside, too.
fn hold(
    series: &mut [f64],
    given: &[f64],
    (lower_rad, upper_rad): (f64, f64),
) -> Result<(), Error> {
    let wanted = series.to_vec();
    let mut over_rad = 0.0;
    for _ in 0..OVERSHOOTS {
        for ((angle, wanted), given) in series.iter_mut().zip(&wanted).zip(given) {
            if wanted != given {
                let (lower_rad, upper_rad) = (lower_rad + over_rad, upper_rad - over_rad);
                *angle = saturate(*wanted, lower_rad, upper_rad, RANGE_MARGIN_RAD);
            }
        }
        let curve = Spline::through(series.to_vec(), 1.0, End::Free, End::Free)?;
        let reach = curve.extremes().position;
        let beyond_rad = (reach.max.value - upper_rad).max(lower_rad - reach.min.value);
        if !(beyond_rad > 0.0) {
            break;
        }
        over_rad += 1.5 * beyond_rad;
    }
    Ok(())
}

/// A joint that moves a link, about what axis, and by how much of its own angle.
#[derive(Clone, Copy, Debug)]
struct Mover {
    joint: usize,
    link: usize,
    ratio: f64,
}

/// The frame of a sole in its link's axes: a point, forward, left, up.
#[derive(Clone, Copy, Debug)]
struct SoleFrame {
    link: usize,
    at_m: DVec3,
    axes: [DVec3; 3],
}

/// What is the same for all poses.
struct Solver<'a> {
    of: Adjustable<'a>,
    inside: SelfContact,
    soles: Vec<StandingSole>,
    /// Of each link, what moves it.
    movers: Vec<Vec<Mover>>,
    /// Of each link a point that tells where it points, and how far that is from its joint, m.
    tips: Vec<Option<(DVec3, f64)>>,
}

/// Joints that are moved together.
struct Part {
    joints: Vec<usize>,
    /// Of each joint of the robot its place among them.
    rows: Vec<Option<usize>>,
    /// Whether two links are kept apart.
    looked_at: Vec<Vec<bool>>,
}

/// Which feet stand, node by node.
struct Stance {
    /// How much of the left and the right foot is planted, 0 to 1.
    planted: Vec<[f64; 2]>,
    /// Up in the axes of the base.
    up: Vec<DVec3>,
    /// While both feet stand: from when to when, and where then the corners of the second sole are over the first, m.
    both: Vec<(Range<usize>, Vec<[f64; 2]>)>,
    /// Index of `both` that is nearest, and how much it counts.
    held: Vec<Option<(usize, f64)>>,
    /// Which feet are planted.
    stands: Vec<[bool; 2]>,
    /// Where the centre of mass is to be.
    goals: Vec<Option<weight::Goal>>,
    /// How high the left and the right foot are over one that stands, or are at least in the air, m.
    lift_m: [f64; 2],
}

/// Normal equations of one pose.
struct Normal {
    hessian: DMatrix<f64>,
    gradient: DVector<f64>,
    cost: f64,
}

impl Normal {
    fn new(size: usize) -> Self {
        Self { hessian: DMatrix::zeros(size, size), gradient: DVector::zeros(size), cost: 0.0 }
    }

    /// Of nothing but a pull of this curvature, both halves of which are there.
    fn reset(&mut self, pull: &DMatrix<f64>) {
        self.hessian.copy_from(pull);
        self.gradient.fill(0.0);
        self.cost = 0.0;
    }

    /// Adds what the pull costs of who went so far away; before all else.
    fn pull_back(&mut self, away: &[f64]) {
        for (i, one) in away.iter().enumerate() {
            let row = self.hessian.row(i);
            let pulled: f64 = away.iter().zip(row.iter()).map(|(away, pull)| away * pull).sum();
            self.gradient[i] += pulled;
            self.cost += one * pulled;
        }
    }

    /// Lays it on a system of many poses, from this row on.
    fn lay_on(&self, system: &mut Banded, first: usize) {
        for row in 0..self.gradient.len() {
            system.side[first + row] -= self.gradient[row];
            for other in 0..=row {
                *system.entry(first + row, first + other) += self.hessian[(row, other)];
            }
            *system.entry(first + row, first + row) += DAMPING;
        }
    }

    /// Adds the square of a residual that grows with the joints as `row` says.
    fn add(&mut self, row: &[f64], residual: f64, weight: f64) {
        self.cost += weight * residual * residual;
        for (i, one) in row.iter().enumerate().filter(|(_, one)| **one != 0.0) {
            self.gradient[i] += weight * one * residual;
            for (j, other) in row.iter().enumerate().take(i + 1) {
                self.hessian[(i, j)] += weight * one * other;
            }
        }
    }
}

impl<'a> Solver<'a> {
    fn new(of: Adjustable<'a>) -> Self {
        let links = of.body.tree.links();
        let joints = of.free.len();
        let own = |link: usize| -> Vec<Mover> {
            if (1..=joints).contains(&link) {
                return vec![Mover { joint: link - 1, link, ratio: 1.0 }];
            }
            let coupled = of.body.tree.couplings().iter().filter(|coupling| coupling.link == link);
            let of_joints = coupled.flat_map(|coupling| coupling.of.iter());
            of_joints.map(|&(to, ratio)| Mover { joint: to - 1, link, ratio }).collect()
        };
        let mut movers: Vec<Vec<Mover>> = Vec::with_capacity(links.len());
        for (at, link) in links.iter().enumerate() {
            let mut all = link.parent.map_or_else(Vec::new, |parent| movers[parent].clone());
            all.extend(own(at));
            movers.push(all);
        }
        let tip = |link: usize| {
            let (middle_m, _) = of.body.volumes[link].first()?.ball_m();
            let reach_m = middle_m.length();
            (reach_m > 1e-3).then_some((middle_m, reach_m))
        };
        Self {
            of,
            inside: SelfContact::of(of.body, of.start_rad),
            soles: StandingSole::all(of.body),
            movers,
            tips: (0..links.len()).map(tip).collect(),
        }
    }

    /// Joints that may be moved: those between base and soles, and all others. Of the former only links are
    /// looked at that nothing else moves.
    fn parts(&self) -> (Part, Part) {
        let joints = self.of.free.len();
        let is_leg = |joint: usize| {
            self.soles.iter().any(|s| self.movers[s.link].iter().any(|mover| mover.joint == joint))
        };
        let free = (0..joints).filter(|joint| self.of.free[*joint]);
        let (legs, rest): (Vec<usize>, Vec<usize>) = free.partition(|joint| is_leg(*joint));
        let part = |own: Vec<usize>, is_legs: bool| {
            let row = |joint: usize| own.iter().position(|one| *one == joint);
            let rows: Vec<Option<usize>> = (0..joints).map(row).collect();
            let moved =
                |link: usize| self.movers[link].iter().any(|mover| rows[mover.joint].is_some());
            let waits =
                |link: usize| is_legs && self.movers[link].iter().any(|mover| !is_leg(mover.joint));
            let links = self.movers.len();
            let looks =
                |one: usize, two: usize| (moved(one) || moved(two)) && !waits(one) && !waits(two);
            let looked_at =
                (0..links).map(|one| (0..links).map(|two| looks(one, two)).collect()).collect();
            Part { joints: own, rows, looked_at }
        };
        (part(legs, true), part(rest, false))
    }

    fn place(&self, pose: &[f64]) -> Vec<Placement> {
        self.of.body.tree.place(Placement::IDENTITY, &self.of.body.angles(pose))
    }

    fn touches(&self, pose: &[f64]) -> bool {
        self.inside.deepest(&self.place(pose)).is_some_and(|of| of.depth_m > TOUCHES_M)
    }

    /// Left and right sole, if it has one each.
    fn feet(&self) -> Option<[&StandingSole; 2]> {
        let foot = |side: usize| {
            let mut of_side = self.soles.iter().filter(move |sole| sole.side == side);
            of_side.next().filter(|_| of_side.next().is_none())
        };
        Some([foot(0)?, foot(1)?])
    }

    fn frame(sole: &StandingSole) -> SoleFrame {
        let count = sole.corners_m.len().max(1) as f64;
        let at_m = sole.corners_m.iter().sum::<DVec3>() / count;
        let forward = (DVec3::X - sole.normal * sole.normal.x)
            .try_normalize()
            .unwrap_or_else(|| sole.normal.any_orthonormal_vector());
        let axes = [forward, sole.normal.cross(forward), sole.normal];
        SoleFrame { link: sole.link, at_m, axes }
    }

    /// What both feet do at the nodes.
    fn stance(&self, footfalls: &[Footfall], nodes: &[usize], rate_hz: f64) -> Stance {
        let blink = (BLINK_S * rate_hz).round() as usize;
        let planted = [0, 1].map(|side| {
            let stands = |of: &Footfall| of.touches.map_or(of.carries[side] > 0.5, |t| t[side]);
            let mut on: Vec<bool> = footfalls.iter().map(stands).collect();
            bridge(&mut on, blink);
            on
        });
        let reach = RAMP_S * rate_hz;
        let weights = planted.each_ref().map(|on| ramps(on, reach));
        let both: Vec<bool> = planted[0].iter().zip(&planted[1]).map(|(l, r)| *l && *r).collect();
        let held = ramps(&both, reach);
        let mut runs: Vec<(Range<usize>, Vec<[f64; 2]>)> = Vec::new();
        for (node, at) in nodes.iter().enumerate().filter(|(_, at)| both.get(**at) == Some(&true)) {
            // Between two nodes a foot may have left.
            let unbroken = |last: &Range<usize>| {
                last.end == node && both[nodes[last.end - 1]..*at].iter().all(|both| *both)
            };
            match runs.last_mut() {
                Some((last, _)) if unbroken(last) => last.end = node + 1,
                _ => runs.push((node..node + 1, Vec::new())),
            }
        }
        let nearest = |node: usize| {
            let away = |run: &Range<usize>| {
                run.start.saturating_sub(node).max((node + 1).saturating_sub(run.end))
            };
            let weight = held[nodes[node]];
            let run = (0..runs.len()).min_by_key(|run| away(&runs[*run].0))?;
            (weight > 0.0).then_some((run, weight))
        };
        Stance {
            stands: nodes.iter().map(|at| [planted[0][*at], planted[1][*at]]).collect(),
            goals: Vec::new(),
            lift_m: [0.0; 2],
            planted: nodes.iter().map(|at| [weights[0][*at], weights[1][*at]]).collect(),
            up: nodes.iter().map(|at| footfalls[*at].up).collect(),
            held: (0..nodes.len()).map(nearest).collect(),
            both: runs,
        }
    }

    /// Corners of the second sole in the frame of the first, m.
    fn across(placed: &[Placement], frame: &SoleFrame, other: &StandingSole) -> Vec<DVec3> {
        let place = placed[frame.link];
        let (at_m, axes) = (place.point(frame.at_m), frame.axes.map(|axis| place.turn * axis));
        let own = |corner: &DVec3| {
            let away = placed[other.link].point(*corner) - at_m;
            DVec3::from(axes.map(|axis| axis.dot(away)))
        };
        other.corners_m.iter().map(own).collect()
    }
}

/// Takes gaps between what is so out if they are no longer than so many.
fn bridge(is_so: &mut [bool], longest: usize) {
    let mut last: Option<usize> = None;
    for at in 0..is_so.len() {
        if is_so[at] {
            if let Some(last) = last.filter(|last| at - last - 1 <= longest) {
                is_so[last..at].fill(true);
            }
            last = Some(at);
        }
    }
}

/// One where it is so, falling to zero within `reach` samples to both sides.
fn ramps(is_so: &[bool], reach: f64) -> Vec<f64> {
    let mut away = vec![f64::INFINITY; is_so.len()];
    let mut last = f64::INFINITY;
    for (at, away) in away.iter_mut().enumerate() {
        last = if is_so[at] { 0.0 } else { last + 1.0 };
        *away = last;
    }
    last = f64::INFINITY;
    for (at, away) in away.iter_mut().enumerate().rev() {
        last = if is_so[at] { 0.0 } else { last + 1.0 };
        *away = away.min(last);
    }
    away.iter()
        .map(|away| {
            let part = (1.0 - away / (reach + 1.0)).max(0.0);
            part * part * (3.0 - 2.0 * part)
        })
        .collect()
}

impl Stance {
    /// Where the second foot stands beside the first while both do: where it is on average.
    fn put(&mut self, solver: &Solver<'_>, poses: &[Vec<f64>]) {
        let Some([left, right]) = solver.feet() else { return };
        let frame = Solver::frame(left);
        for (run, places) in &mut self.both {
            let mut sums = vec![[0.0; 2]; right.corners_m.len()];
            for node in run.clone() {
                let placed = solver.place(&poses[node]);
                for (sum, at) in sums.iter_mut().zip(Solver::across(&placed, &frame, right)) {
                    (sum[0], sum[1]) = (sum[0] + at.x, sum[1] + at.y);
                }
            }
            let count = run.len().max(1) as f64;
            *places = sums.into_iter().map(|sum| sum.map(|sum| sum / count)).collect();
        }
    }
}

/// Some joints over a clip.
#[derive(Clone, Copy)]
struct Clip<'a> {
    solver: &'a Solver<'a>,
    part: &'a Part,
    rate_hz: f64,
    /// As they came.
    poses: &'a [Vec<f64>],
    stance: Option<&'a Stance>,
}

impl Clip<'_> {
    /// Hands over how links leave one another that are nearer than [`ROOM_M`] and that these joints move.
    fn near(&self, placed: &[Placement], found: impl FnMut((usize, usize), WayOut)) {
        let looked_at = |one: usize, two: usize| self.part.looked_at[one][two];
        self.solver.inside.nearer_than(placed, ROOM_M, looked_at, found);
    }

    /// All poses with their links apart; those far from any that are too near stay as they are.
    fn solved(&self) -> Vec<Vec<f64>> {
        let crowded = |node: usize| {
            let mut any = false;
            self.near(&self.solver.place(&self.poses[node]), |_, _| any = true);
            any
        };
        let spans = self.around(crowded, &(0..self.poses.len())).into_iter();
        spans.fold(self.poses.to_vec(), |poses, span| self.refined(poses, span))
    }

    /// Adds to a row how fast a point of a link goes in a direction, by joint.
    fn velocity(&self, row: &mut [f64], placed: &[Placement], link: usize, at: DVec3, way: DVec3) {
        let links = self.solver.of.body.tree.links();
        for mover in &self.solver.movers[link] {
            let Some(place) = self.part.rows[mover.joint] else { continue };
            let joint = placed[mover.link];
            let axis = joint.turn * links[mover.link].axis;
            row[place] += mover.ratio * way.dot(axis.cross(at - joint.at_m));
        }
    }

    /// The same of a link's spin.
    fn spin(&self, row: &mut [f64], placed: &[Placement], link: usize, way: DVec3) {
        let links = self.solver.of.body.tree.links();
        for mover in &self.solver.movers[link] {
            let Some(place) = self.part.rows[mover.joint] else { continue };
            row[place] += mover.ratio * way.dot(placed[mover.link].turn * links[mover.link].axis);
        }
    }

    /// What moving away from the pose as it came counts.
    fn nearness(&self, pose: &[f64]) -> DMatrix<f64> {
        let size = self.part.joints.len();
        let placed = self.solver.place(pose);
        let mut all = Normal::new(size);
        all.hessian.fill_diagonal(JOINT_WEIGHT.powi(2));
        let axes = [DVec3::X, DVec3::Y, DVec3::Z];
        let mut row = vec![0.0; size];
        for (link, tip) in self.solver.tips.iter().enumerate() {
            let Some((tip_m, reach_m)) = tip else { continue };
            for axis in axes {
                // As seen from its own joint: how it points.
                row.fill(0.0);
                self.velocity(&mut row, &placed, link, placed[link].point(*tip_m), axis);
                self.velocity(&mut row, &placed, link, placed[link].at_m, -axis);
                all.add(&row, 0.0, (1.0 / reach_m).powi(2));
            }
        }
        for sole in &self.solver.soles {
            for axis in axes {
                row.fill(0.0);
                self.spin(&mut row, &placed, sole.link, axis);
                all.add(&row, 0.0, SOLE_WEIGHT.powi(2));
            }
        }
        all.hessian.fill_upper_triangle_with_lower_triangle();
        all.hessian
    }

    /// Adds up the cost of a pose, with its derivatives; `room` is the weight of links that are too near.
    fn add_up(&self, node: usize, pose: &[f64], room: f64, row: &mut [f64], normal: &mut Normal) {
        let joints = self.part.joints.iter();
        let away: Vec<f64> = joints.map(|joint| pose[*joint] - self.poses[node][*joint]).collect();
        normal.pull_back(&away);
        let placed = self.solver.place(pose);
        self.near(&placed, |(one, two), way| {
            row.fill(0.0);
            self.velocity(row, &placed, two, way.at_m, -way.normal);
            self.velocity(row, &placed, one, way.at_m, way.normal);
            normal.add(row, way.depth_m, room);
        });
        for (at, joint) in self.part.joints.iter().enumerate() {
            let (lower_rad, upper_rad) = self.solver.of.limits_rad[*joint];
            let margin_rad = RANGE_MARGIN_RAD.min((upper_rad - lower_rad) / 2.0);
            // Who came beyond is held where he was.
            let came_rad = self.poses[node][*joint];
            let range =
                (lower_rad + margin_rad).min(came_rad)..=(upper_rad - margin_rad).max(came_rad);
            let beyond_rad = pose[*joint] - pose[*joint].clamp(*range.start(), *range.end());
            if beyond_rad != 0.0 {
                row.fill(0.0);
                row[at] = 1.0;
                normal.add(row, beyond_rad, RANGE_WEIGHT.powi(2));
            }
        }
        if let (Some(stance), Some(feet)) = (self.stance, self.solver.feet()) {
            self.stand(stance, feet, node, &placed, row, normal);
            if let Some(goal) = stance.goals.get(node).copied().flatten() {
                self.follow(goal, feet, &placed, row, normal);
            }
        }
    }

    fn stand(
        &self,
        stance: &Stance,
        feet: [&StandingSole; 2],
        node: usize,
        placed: &[Placement],
        row: &mut [f64],
        normal: &mut Normal,
    ) {
        let planted = stance.planted[node];
        for (sole, planted) in feet.iter().zip(planted) {
            if planted <= 0.0 {
                continue;
            }
            let up = placed[sole.link].turn * sole.normal;
            let off = up - stance.up[node];
            for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
                row.fill(0.0);
                self.spin(row, placed, sole.link, up.cross(axis));
                normal.add(row, off.dot(axis), (LEVEL_WEIGHT * planted).powi(2));
            }
        }
        let held = stance.held[node];
        // Where both stand, the second in the first's frame; else the one in the air over the one that stands.
        let (first, second) = if planted[0] >= planted[1] { (0, 1) } else { (1, 0) };
        let (first, second) = if held.is_some() { (0, 1) } else { (first, second) };
        let frame = Solver::frame(feet[first]);
        let axes = frame.axes.map(|axis| placed[frame.link].turn * axis);
        let found = Solver::across(placed, &frame, feet[second]);
        for (at, (found, corner)) in found.iter().zip(&feet[second].corners_m).enumerate() {
            let corner_m = placed[feet[second].link].point(*corner);
            let mut pull = |axis: DVec3, residual: f64, weight: f64| {
                row.fill(0.0);
                self.velocity(row, placed, feet[second].link, corner_m, axis);
                self.velocity(row, placed, frame.link, corner_m, -axis);
                normal.add(row, residual, weight);
            };
            if let Some((run, share)) = held {
                let weight = (STANCE_WEIGHT * share).powi(2);
                pull(axes[2], found.z - (stance.lift_m[1] - stance.lift_m[0]), weight);
                if let Some(place) = stance.both[run].1.get(at) {
                    pull(axes[0], found.x - place[0], weight);
                    pull(axes[1], found.y - place[1], weight);
                }
            } else if found.z < stance.lift_m[second] && planted[first] > 0.0 {
                pull(
                    axes[2],
                    found.z - stance.lift_m[second],
                    (STANCE_WEIGHT * planted[first]).powi(2),
                );
            }
        }
    }

    /// Moves the poses of a range, from where they are; what then still touches once more by itself.
    fn refined(&self, poses: Vec<Vec<f64>>, range: Range<usize>) -> Vec<Vec<f64>> {
        let mut poses = self.settled(poses, range.clone(), &PHASES);
        for _ in 0..ROUNDS {
            let ranges = self.around(|node| self.touches(&poses[node]), &range);
            for near in &ranges {
                poses = self.settled(poses, near.clone(), &PHASES);
            }
            if ranges.is_empty() {
                break;
            }
        }
        poses
    }

    /// Spans of a range around nodes of which something is so.
    fn around(&self, is_so: impl Fn(usize) -> bool, range: &Range<usize>) -> Vec<Range<usize>> {
        let reach = (AROUND_S * self.rate_hz).ceil() as usize;
        let mut spans: Vec<Range<usize>> = Vec::new();
        for node in range.clone().filter(|node| is_so(*node)) {
            let end = (node + reach + 1).min(range.end);
            let start = node.saturating_sub(reach).max(range.start);
            match spans.last_mut() {
                Some(last) if start <= last.end => last.end = end,
                _ => spans.push(start..end),
            }
        }
        spans
    }

    /// The least cost that steps from these poses lead to, in phases.
    fn settled(
        &self,
        mut poses: Vec<Vec<f64>>,
        range: Range<usize>,
        phases: &[(f64, usize)],
    ) -> Vec<Vec<f64>> {
        let size = self.part.joints.len();
        let nearness = |node: usize| self.nearness(&self.poses[node]);
        let near: Vec<DMatrix<f64>> = range.clone().map(nearness).collect();
        let mut normals: Vec<Normal> = range.clone().map(|_| Normal::new(size)).collect();
        let mut row = vec![0.0; size];
        let mut fit = |poses: &[Vec<f64>], normals: &mut [Normal], room: f64| {
            for ((node, normal), near) in range.clone().zip(normals.iter_mut()).zip(&near) {
                normal.reset(near);
                self.add_up(node, &poses[node], room, &mut row, normal);
            }
            let own: f64 = normals.iter().map(|normal| normal.cost).sum();
            own + self.changes(poses, &range).map(|change| change.cost()).sum::<f64>()
        };
        // What is deep in something is led out gently first.
        for &(part, steps) in phases {
            let room = (ROOM_WEIGHT * part).powi(2);
            let mut here = fit(&poses, &mut normals, room);
            let mut best = (here, poses[range.clone()].to_vec());
            let (mut calmer, mut idle) = (1.0, 0);
            for _ in 0..steps {
                let mut system = Banded::new(range.len() * size, 2 * size);
                for (at, normal) in normals.iter().enumerate() {
                    normal.lay_on(&mut system, at * size);
                }
                for change in self.changes(&poses, &range) {
                    change.lay_on(&mut system, &range, size);
                }
                let Some(steps) = system.solve() else { break };
                let longest_rad = steps.iter().fold(0.0_f64, |most, step| most.max(step.abs()));
                for (pose, steps) in poses[range.clone()].iter_mut().zip(steps.chunks(size)) {
                    for (joint, step) in self.part.joints.iter().zip(steps) {
                        pose[*joint] += calmer * step.clamp(-LONGEST_STEP_RAD, LONGEST_STEP_RAD);
                    }
                }
                // Faces that meet change: it may become worse for a step.
                let there = fit(&poses, &mut normals, room);
                calmer = if there > here { calmer * 0.5 } else { (calmer * 1.3_f64).min(1.0) };
                idle = if there < best.0 * (1.0 - ENOUGH) { 0 } else { idle + 1 };
                if there < best.0 {
                    best = (there, poses[range.clone()].to_vec());
                }
                here = there;
                if idle > IDLE || longest_rad < SHORTEST_STEP_RAD {
                    break;
                }
            }
            poses[range.clone()].clone_from_slice(&best.1);
        }
        poses
    }

    /// Whether links are in one another that these joints could part.
    fn touches(&self, pose: &[f64]) -> bool {
        let mut touches = false;
        self.near(&self.solver.place(pose), |_, way| {
            touches |= way.depth_m > ROOM_M + TOUCHES_M / 2.0;
        });
        touches
    }

    /// All penalties on how fast what is added changes; beyond the range nothing is.
    fn changes<'b>(
        &'b self,
        poses: &'b [Vec<f64>],
        range: &'b Range<usize>,
    ) -> impl Iterator<Item = Change> + 'b {
        const VELOCITY: &[f64] = &[-1.0, 1.0];
        const ACCELERATION: &[f64] = &[1.0, -2.0, 1.0];
        let kinds = [
            (VELOCITY, VELOCITY_WEIGHT_S * self.rate_hz),
            (ACCELERATION, ACCELERATION_WEIGHT_S2 * self.rate_hz.powi(2)),
        ];
        kinds.into_iter().flat_map(move |(parts, weight)| {
            let first = range.start.saturating_sub(parts.len() - 1);
            let last = range.end.min((poses.len() + 1).saturating_sub(parts.len()));
            (first..last).flat_map(move |at| {
                self.part.joints.iter().enumerate().map(move |(row, joint)| {
                    let added = |at: usize| poses[at][*joint] - self.poses[at][*joint];
                    let value =
                        parts.iter().enumerate().map(|(i, part)| part * added(at + i)).sum();
                    Change { at, row, parts, value, weight: weight * weight }
                })
            })
        })
    }
}

/// A penalty on how one joint moves.
struct Change {
    at: usize,
    row: usize,
    parts: &'static [f64],
    value: f64,
    weight: f64,
}

impl Change {
    fn cost(&self) -> f64 {
        self.weight * self.value * self.value
    }

    fn lay_on(&self, system: &mut Banded, range: &Range<usize>, size: usize) {
        let place =
            |node: usize| range.contains(&node).then(|| (node - range.start) * size + self.row);
        for (later, part) in self.parts.iter().enumerate() {
            let Some(i) = place(self.at + later) else { continue };
            system.side[i] -= self.weight * part * self.value;
            for (sooner, other) in self.parts.iter().enumerate().take(later + 1) {
                if let Some(j) = place(self.at + sooner) {
                    *system.entry(i, j) += self.weight * part * other;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests;
