//! A gait made for a robot's own legs: the steps that a person takes, as long, as wide and as fast as the robot can take
//! them without falling.
//!
//! The robot is taken for a pendulum of constant height (Kajita et al., "The 3D linear inverted pendulum mode", IROS 2001). One foot
//! comes after the other, each as long in the air as suits that pendulum; its zero-moment point is under the foot that
//! stands, and goes over to the other while both do. The way of the centre of mass follows from it: c - h/g c'' = p, over
//! the whole motion at once, from rest to rest. Legs are then bent so that soles are where they step, the trunk is
//! upright and the centre of mass is on its way. What arms and legs add to the moment is taken off the plan, and legs are
//! bent again (after Kajita et al., "Biped walking pattern generation by using preview control of zero-moment
//! point", ICRA 2003).

use crate::body::root::spread;
use crate::motion::{End, Spline};
use crate::retarget::base::StandingSole;
use crate::retarget::steps::Step;
use crate::rigid::Placement;
use crate::rigid::ground::{GRAVITY_M_S2, reactions};
use crate::rigid::mass::Posed;
use crate::robot::RobotBody;
use glam::{DQuat, DVec2, DVec3};
use nalgebra::{DMatrix, DVector};
use std::f64::consts::TAU;

/// Poses per second that are planned by themselves.
const NODES_HZ: f64 = 60.0;
/// Most of them: half an hour.
const MOST_NODES: f64 = 108_000.0;
/// Shortest time on one foot, on both between two steps, and at rest before the first and after the last, in times that the
/// pendulum takes to fall e times further.
const SINGLE: f64 = 3.0;
const BOTH: f64 = 1.8;
const REST: f64 = 6.0;
/// Arms change their pace over this time, standard deviation, in the same.
const EASED: f64 = 0.6;
/// Longest step, and how high a foot is lifted, as parts of the height of the centre of mass.
const LONGEST: f64 = 0.17;
const LIFT: f64 = 0.1;
/// Feet go apart by at most so many times as far as the robot has them at rest.
const WIDEST: f64 = 1.2;
/// Most that a robot turns in a step, rad.
const TURN_RAD: f64 = 0.2;
/// Of whoever is behind by more than this a whole turn is left out: it is nearer to look there the other way round.
const SPUN_RAD: f64 = 0.75 * TAU;
/// What steps are shortened to until legs reach.
const SHORTER: [f64; 3] = [1.0, 0.7, 0.4];
/// The zero-moment point is so far from the middle of a sole towards the other foot, in half its breadth: servos give way, and who
/// tips inward comes down on the other foot.
const INWARD: f64 = 0.3;
/// How often the plan is mended.
const MENDED: usize = 2;
/// A leg has arrived within this, m and tenths of rad; and in so many steps, none longer, rad.
const ARRIVED: f64 = 1e-5;
const BENT: usize = 40;
const LONGEST_RAD: f64 = 0.3;
/// Off by more it does not reach.
const REACHED: f64 = 5e-4;
/// Curvature that is added where a leg hardly moves its foot.
const DAMPING: f64 = 1e-8;

/// What is made into a gait.
#[derive(Clone, Copy, Debug)]
pub struct Walking<'a> {
    /// The robot.
    pub body: &'a RobotBody,
    /// The pose it starts in by its file, rad.
    pub start_rad: &'a [f64],
    /// Lowest and highest angle of each of its joints, rad.
    pub limits_rad: &'a [(f64, f64)],
    /// What its joints would do, `[joint][pose]`, rad; arms and head do so.
    pub angles_rad: &'a [Vec<f64>],
    /// Poses per second of that.
    pub rate_hz: f64,
    /// The steps of whoever did it.
    pub steps: &'a [Step],
    /// How long the robot's legs are beside theirs.
    pub scale: f64,
    /// How many times as fast it will be played.
    pub speed: f64,
    /// Everything takes so many times as long as it would.
    pub slower: f64,
    /// How many times as high the centre of mass is as in the pose it starts in.
    pub height: f64,
}

/// A gait.
#[derive(Clone, Debug, PartialEq)]
pub struct Gait {
    /// `[joint][pose]`, rad, at the rate of the motion it was made of.
    pub angles_rad: Vec<Vec<f64>>,
    /// Of each pose the time of that motion, in poses.
    pub clock: Vec<f64>,
    /// The joints of its legs.
    pub legs: Vec<usize>,
    /// Which feet stand, and how the base is turned.
    pub stands: Vec<([bool; 2], DQuat)>,
    /// The longest step, m.
    pub longest_m: f64,
    /// Mean time of a step, s.
    pub step_s: f64,
}

/// Makes a gait of steps, if the robot's legs can take them.
#[must_use]
pub fn gait(of: &Walking<'_>) -> Option<Gait> {
    if of.steps.is_empty() {
        return None;
    }
    let robot = Walker::of(of)?;
    if robot.longest_s() * NODES_HZ > MOST_NODES {
        return None;
    }
    SHORTER.iter().find_map(|share| robot.gait(&robot.plan(*share)))
}

/// A leg, and the sole it ends in.
struct Leg {
    link: usize,
    /// Middle of the sole, in the link's axes, m.
    middle_m: DVec3,
    /// How the link is turned while its sole is level and looks where it does at rest.
    level: DQuat,
    joints: Vec<usize>,
}

/// A robot that is to walk.
struct Walker<'a> {
    of: &'a Walking<'a>,
    legs: [Leg; 2],
    /// How far its soles are apart, m.
    width_m: f64,
    /// How far inward of its middle a sole is loaded, m.
    inward_m: f64,
    /// Where the base is at rest over the middle between the soles.
    base: Placement,
    /// Height of the centre of mass, m.
    centre_m: f64,
    /// The time in which such a pendulum falls e times further, s.
    falls_s: f64,
}

/// Where everything is to be at a node.
#[derive(Clone, Copy)]
struct Goal {
    feet: [(DVec3, f64); 2],
    stands: [bool; 2],
    /// Where the zero-moment point is to be, m.
    point_m: DVec2,
    /// Of the motion it is made of, s.
    time_s: f64,
}

struct Footing {
    goals: Vec<Goal>,
    longest_m: f64,
    step_s: f64,
}

impl<'a> Walker<'a> {
    fn of(of: &'a Walking<'a>) -> Option<Self> {
        let tree = &of.body.tree;
        let soles = StandingSole::all(of.body);
        let placed = tree.place(Placement::IDENTITY, &of.body.angles(of.start_rad));
        let foot = |side: usize| {
            let mut found = soles.iter().filter(|sole| sole.side == side);
            found.next().filter(|_| found.next().is_none())
        };
        let feet = [foot(0)?, foot(1)?];
        let up: DVec3 = feet.iter().map(|sole| placed[sole.link].turn * sole.normal).sum();
        let tilt = DQuat::from_rotation_arc(up.try_normalize()?, DVec3::Z);
        let legs = feet.map(|sole| {
            let turned = tilt * placed[sole.link].turn;
            let level = DQuat::from_rotation_arc(turned * sole.normal, DVec3::Z) * turned;
            let middle_m = sole.corners_m.iter().sum::<DVec3>() / sole.corners_m.len() as f64;
            let carriers =
                std::iter::successors(Some(sole.link), |link| tree.links()[*link].parent);
            let joints = carriers.filter_map(|link| tree.coordinate(link)).collect();
            Leg { link: sole.link, middle_m, level, joints }
        });
        let own = of.start_rad.len();
        let coupled: Vec<usize> = tree
            .couplings()
            .iter()
            .flat_map(|of| of.of.iter().map(|(link, _)| *link).chain([of.link]))
            .filter_map(|link| tree.coordinate(link))
            .collect();
        let both = |joint: &usize| legs[1].joints.contains(joint);
        let is_odd = |joint: &usize| *joint >= own || coupled.contains(joint);
        if legs[0].joints.iter().any(both) || legs.iter().any(|leg| leg.joints.iter().any(is_odd)) {
            return None;
        }
        let middles = [0, 1].map(|side: usize| {
            let leg: &Leg = &legs[side];
            tilt * placed[leg.link].point(leg.middle_m)
        });
        let breadths = feet.map(|sole| {
            let aside = sole.corners_m.iter().map(|at| (tilt * placed[sole.link].point(*at)).y);
            let (low, high) = aside.fold((f64::MAX, f64::MIN), |(l, h), y| (l.min(y), h.max(y)));
            high - low
        });
        let inward_m = INWARD * breadths[0].min(breadths[1]) / 2.0;
        let between = (middles[0] + middles[1]) / 2.0;
        let width_m = (middles[0].y - middles[1].y).abs();
        let turned = Placement { at_m: -between, turn: tilt };
        let height_m = |base: Placement| {
            tree.centre_of_mass_m(&tree.place(base, &of.body.angles(of.start_rad))).z
        };
        let rises_m = (of.height - 1.0) * height_m(turned);
        let base = Placement { at_m: turned.at_m + DVec3::Z * rises_m, turn: tilt };
        let centre_m = height_m(base);
        if !(centre_m > 0.0 && width_m > 0.0) {
            return None;
        }
        let falls_s = (centre_m / GRAVITY_M_S2).sqrt();
        Some(Self { of, legs, width_m, inward_m, base, centre_m, falls_s })
    }

    /// No less than the gait will take, s.
    fn longest_s(&self) -> f64 {
        let Walking { steps, speed, slower, rate_hz, angles_rad, .. } = *self.of;
        let poses = angles_rad.first().map_or(0, Vec::len) as f64;
        let least_s = (SINGLE + BOTH) * steps.len() as f64 + 2.0 * REST;
        slower * (poses / rate_hz / speed + least_s * self.falls_s)
    }

    /// Where feet step, and when, if they step so far.
    fn plan(&self, share: f64) -> Footing {
        let Walking { steps, speed, slower, scale, .. } = *self.of;
        let longest_m = LONGEST * self.centre_m * share;
        let lift_m = LIFT * self.centre_m;
        let [single_s, both_s, rest_s] =
            [SINGLE, BOTH, REST].map(|part| part * self.falls_s * slower);
        // Between what swings alike: a step of shorter legs is faster by the root of their length (Froude).
        let faster = scale.sqrt() * slower / speed;
        let half = DVec2::new(0.0, self.width_m / 2.0);
        let mut writer = Writer {
            goals: Vec::new(),
            feet: [(half.extend(0.0), 0.0), ((-half).extend(0.0), 0.0)],
            point_m: DVec2::ZERO,
            inward_m: self.inward_m,
        };
        let (mut time_s, mut heading, mut far_m) = (0.0, 0.0_f64, 0.0_f64);
        let (mut on_steps_s, mut owed_rad) = (0.0, 0.0_f64);
        for (at, step) in steps.iter().enumerate() {
            let stands = 1 - step.side;
            let pause_s = ((step.lifted_s - time_s) * slower / speed).max(0.0);
            if at == 0 {
                writer.rest(rest_s.max(pause_s), [time_s, step.lifted_s]);
                time_s = step.lifted_s;
                writer.shift(stands, both_s, [time_s; 2]);
            } else {
                let from_s = time_s;
                time_s = time_s.max(step.lifted_s);
                writer.shift(stands, both_s.max(pause_s), [from_s, time_s]);
            }
            // What a step does not turn the next ones do.
            let turn_rad = (owed_rad + step.turn_rad).clamp(-TURN_RAD, TURN_RAD);
            owed_rad += step.turn_rad - turn_rad;
            if owed_rad.abs() > SPUN_RAD {
                owed_rad -= TAU.copysign(owed_rad);
            }
            heading += turn_rad;
            let ahead_m = (step.ahead_m * scale).clamp(-longest_m, longest_m);
            let apart_m = (step.aside_m * scale).clamp(self.width_m, WIDEST * self.width_m);
            let outward = if step.side == 0 { apart_m } else { -apart_m };
            let away = DVec2::from_angle(heading).rotate(DVec2::new(ahead_m, outward));
            let to = writer.feet[stands].0.truncate() + away;
            let until_s = time_s.max(step.planted_s);
            let lasts_s = single_s.max((step.planted_s - step.lifted_s) * faster);
            writer.swing(step.side, to, heading, lift_m, lasts_s, [time_s, until_s]);
            time_s = until_s;
            far_m = far_m.max(ahead_m.abs());
            on_steps_s += lasts_s + both_s;
        }
        let end_s = self.of.angles_rad.first().map_or(0.0, |of| of.len().saturating_sub(1) as f64)
            / self.of.rate_hz;
        writer.shift_to_middle(both_s, [time_s; 2]);
        writer.rest(rest_s.max((end_s - time_s) * slower / speed), [time_s, end_s.max(time_s)]);
        writer.smooth_time(EASED * self.falls_s * slower);
        let step_s = on_steps_s / steps.len().max(1) as f64;
        Footing { goals: writer.goals, longest_m: far_m, step_s }
    }

    /// Bends the legs of a plan; nothing if they do not reach.
    fn gait(&self, plan: &Footing) -> Option<Gait> {
        let splines = self.splines()?;
        let mut point_m: Vec<DVec2> = plan.goals.iter().map(|goal| goal.point_m).collect();
        let mut found = self.bent(plan, &point_m, &splines)?;
        for _ in 0..MENDED {
            let posed: Vec<Vec<Posed>> =
                found.iter().map(|(base, pose)| self.posed(*base, pose)).collect();
            let pushed = reactions(&posed, NODES_HZ);
            // At the ends it rests where it is.
            for at in 1..point_m.len().saturating_sub(1) {
                point_m[at] += plan.goals[at].point_m - pushed[at].zero_moment_point_m?;
            }
            found = self.bent(plan, &point_m, &splines)?;
        }
        let is_inside = |pose: &[f64]| {
            self.legs.iter().flat_map(|leg| &leg.joints).all(|joint| {
                let (lower, upper) = self.of.limits_rad[*joint];
                (lower..=upper).contains(&pose[*joint])
            })
        };
        found.iter().all(|(_, pose)| is_inside(pose)).then_some(())?;
        self.sampled(plan, &found)
    }

    /// What joints would do, over time, s.
    fn splines(&self) -> Option<Vec<Spline>> {
        let step_s = 1.0 / self.of.rate_hz;
        let one =
            |series: &Vec<f64>| Spline::through(series.clone(), step_s, End::Free, End::Free).ok();
        self.of.angles_rad.iter().map(one).collect()
    }

    fn posed(&self, base: Placement, pose: &[f64]) -> Vec<Posed> {
        let tree = &self.of.body.tree;
        let placed = tree.place(base, &self.of.body.angles(pose));
        let links = tree.links().iter().zip(placed);
        let weighing = links.filter(|(link, _)| link.mass.mass_kg > 0.0);
        weighing
            .map(|(link, place)| Posed {
                mass: link.mass,
                origin_m: place.at_m,
                turned: place.turn,
            })
            .collect()
    }

    /// Base and joints at each node, if the zero-moment point of a pendulum goes so.
    fn bent(
        &self,
        plan: &Footing,
        point_m: &[DVec2],
        splines: &[Spline],
    ) -> Option<Vec<(Placement, Vec<f64>)>> {
        let centres_m = pendulum(point_m, 1.0 / NODES_HZ, self.centre_m);
        let mut pose = self.of.start_rad.to_vec();
        let mut base = self.base;
        let mut found = Vec::with_capacity(plan.goals.len());
        for (goal, centre_m) in plan.goals.iter().zip(centres_m) {
            for (joint, (angle, spline)) in pose.iter_mut().zip(splines).enumerate() {
                if !self.legs.iter().any(|leg| leg.joints.contains(&joint)) {
                    *angle = spline.sample(goal.time_s)[0];
                }
            }
            let heading = (goal.feet[0].1 + goal.feet[1].1) / 2.0;
            base.turn = DQuat::from_rotation_z(heading) * self.base.turn;
            self.reach(goal, centre_m, &mut base, &mut pose)?;
            found.push((base, pose.clone()));
        }
        Some(found)
    }

    /// Newton's method, leg by leg, while the base goes to where the centre of mass is right.
    fn reach(
        &self,
        goal: &Goal,
        centre_m: DVec2,
        base: &mut Placement,
        pose: &mut [f64],
    ) -> Option<()> {
        let tree = &self.of.body.tree;
        let mut off = f64::INFINITY;
        for _ in 0..BENT {
            let placed = tree.place(*base, &self.of.body.angles(pose));
            let shift_m = (centre_m - tree.centre_of_mass_m(&placed).truncate()).extend(0.0);
            off = shift_m.length();
            for (leg, (at_m, heading)) in self.legs.iter().zip(goal.feet) {
                let is = placed[leg.link];
                let point_m = is.point(leg.middle_m);
                let away_m = at_m - point_m;
                let turn = DQuat::from_rotation_z(heading) * leg.level * is.turn.inverse();
                let turn = (if turn.w < 0.0 { -turn } else { turn }).to_scaled_axis();
                off = off.max(away_m.length()).max(turn.length() / 10.0);
                let away_m = away_m - shift_m;
                let want = [away_m.x, away_m.y, away_m.z, turn.x, turn.y, turn.z];
                let moves = tree.jacobian(&placed, leg.link, point_m);
                let moves =
                    DMatrix::from_fn(6, leg.joints.len(), |row, at| moves[(row, leg.joints[at])]);
                let back = moves.transpose();
                let damped = &back * &moves
                    + DMatrix::identity(leg.joints.len(), leg.joints.len()) * DAMPING;
                let turns = damped.cholesky()?.solve(&(back * DVector::from_row_slice(&want)));
                for (joint, turn) in leg.joints.iter().zip(turns.iter()) {
                    pose[*joint] += turn.clamp(-LONGEST_RAD, LONGEST_RAD);
                }
            }
            base.at_m += shift_m;
            if off < ARRIVED {
                break;
            }
        }
        (off < REACHED).then_some(())
    }

    /// The same at the rate of the motion, as it is played.
    fn sampled(&self, plan: &Footing, found: &[(Placement, Vec<f64>)]) -> Option<Gait> {
        let rate_hz = self.of.rate_hz * self.of.speed;
        let last = found.len().checked_sub(1)?;
        let count = (last as f64 / NODES_HZ * rate_hz).floor() as usize + 1;
        let along = |at: usize| at as f64 / rate_hz * NODES_HZ;
        let of_joint = |joint: usize| {
            let series = found.iter().map(|(_, pose)| pose[joint]).collect();
            let spline = Spline::through(series, 1.0, End::Free, End::Free).ok()?;
            Some((0..count).map(|at| spline.sample(along(at))[0]).collect())
        };
        let angles_rad = (0..self.of.start_rad.len()).map(of_joint).collect::<Option<_>>()?;
        let clock = (0..count).map(|at| {
            let (before, share) = (along(at) as usize, along(at).fract());
            let [from, to] = [before.min(last), (before + 1).min(last)]
                .map(|node| plan.goals[node].time_s * self.of.rate_hz);
            from + (to - from) * share
        });
        let stands = (0..count).map(|at| {
            let node = (along(at).round() as usize).min(last);
            (plan.goals[node].stands, found[node].0.turn)
        });
        Some(Gait {
            angles_rad,
            clock: clock.collect(),
            legs: self.legs.iter().flat_map(|leg| leg.joints.clone()).collect(),
            stands: stands.collect(),
            longest_m: plan.longest_m,
            step_s: plan.step_s,
        })
    }
}

/// Writes a plan, node by node.
struct Writer {
    goals: Vec<Goal>,
    feet: [(DVec3, f64); 2],
    point_m: DVec2,
    inward_m: f64,
}

impl Writer {
    fn nodes(lasts_s: f64) -> usize {
        (lasts_s * NODES_HZ).round().max(1.0) as usize
    }

    /// Both feet stand, and the zero-moment point goes somewhere, while the motion goes on from a time to a time.
    fn stand(&mut self, to_m: DVec2, lasts_s: f64, times_s: [f64; 2]) {
        let from_m = self.point_m;
        let count = Self::nodes(lasts_s);
        for at in 1..=count {
            let share = at as f64 / count as f64;
            self.goals.push(Goal {
                feet: self.feet,
                stands: [true; 2],
                point_m: from_m.lerp(to_m, share),
                time_s: times_s[0] + (times_s[1] - times_s[0]) * share,
            });
        }
        self.point_m = to_m;
    }

    fn rest(&mut self, lasts_s: f64, times_s: [f64; 2]) {
        self.stand(self.point_m, lasts_s, times_s);
    }

    fn shift(&mut self, to_side: usize, lasts_s: f64, times_s: [f64; 2]) {
        let (at_m, heading) = self.feet[to_side];
        let inward_m = if to_side == 0 { -self.inward_m } else { self.inward_m };
        let inward_m = DVec2::from_angle(heading).rotate(DVec2::new(0.0, inward_m));
        self.stand(at_m.truncate() + inward_m, lasts_s, times_s);
    }

    fn shift_to_middle(&mut self, lasts_s: f64, times_s: [f64; 2]) {
        let middle_m = (self.feet[0].0 + self.feet[1].0).truncate() / 2.0;
        self.stand(middle_m, lasts_s, times_s);
    }

    /// Who follows the motion changes pace smoothly.
    fn smooth_time(&mut self, deviation_s: f64) {
        let mut times: Vec<DVec3> =
            self.goals.iter().map(|goal| DVec3::new(goal.time_s, 0.0, 0.0)).collect();
        spread(&mut times, NODES_HZ, deviation_s);
        self.goals.iter_mut().zip(times).for_each(|(goal, time)| goal.time_s = time.x);
    }

    /// A foot goes to where it steps while the other stands.
    fn swing(
        &mut self,
        side: usize,
        to_m: DVec2,
        heading: f64,
        lift_m: f64,
        lasts_s: f64,
        times_s: [f64; 2],
    ) {
        let (from_m, from_heading) = self.feet[side];
        let count = Self::nodes(lasts_s);
        let mut stands = [true; 2];
        stands[side] = false;
        for at in 1..=count {
            let share = at as f64 / count as f64;
            let part = eased(share);
            let height_m = lift_m * eased(2.0 * share.min(1.0 - share));
            let over_m = from_m.truncate().lerp(to_m, part);
            let mut feet = self.feet;
            feet[side] = (over_m.extend(height_m), from_heading + (heading - from_heading) * part);
            self.goals.push(Goal {
                feet,
                stands,
                point_m: self.point_m,
                time_s: times_s[0] + (times_s[1] - times_s[0]) * share,
            });
        }
        self.feet[side] = (to_m.extend(0.0), heading);
    }
}

/// From 0 to 1, at rest and without acceleration at both ends.
fn eased(share: f64) -> f64 {
    share.powi(3) * (10.0 + share * (6.0 * share - 15.0))
}

/// The way of a pendulum's centre whose zero-moment point goes so, at rest before and after: c - h/g c'' = p.
fn pendulum(point_m: &[DVec2], step_s: f64, height_m: f64) -> Vec<DVec2> {
    let pull = height_m / GRAVITY_M_S2 / step_s.powi(2);
    let Some(last) = point_m.len().checked_sub(1) else { return Vec::new() };
    // Thomas' algorithm; the first and the last are where their points are.
    let (mut upper, mut right) = (vec![0.0; last + 1], point_m.to_vec());
    for at in 1..last {
        let pivot = 1.0 + 2.0 * pull + pull * upper[at - 1];
        upper[at] = -pull / pivot;
        right[at] = (point_m[at] + right[at - 1] * pull) / pivot;
    }
    for at in (1..last).rev() {
        let next = right[at + 1];
        right[at] -= next * upper[at];
    }
    right
}

#[cfg(test)]
mod tests;
