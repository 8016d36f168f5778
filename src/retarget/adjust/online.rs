//! Poses that are moved one by one, as they come, so that a robot is not in itself and its weight is over its feet.
//!
//! What comes next is unknown here. So a foot is lifted only once the weight is over the other one, however early the
//! person lifts it, and stays where it is if the person has put it down again by then. The weight goes where it is to be as a
//! critically damped spring takes it, slowly enough that what its haste adds to the zero-moment point (the cart on a
//! table: Kajita et al., ICRA 2003) stays well inside the soles. Joints follow such springs, too. Goals are as far beyond
//! poses as servos give way under the weight: who is let down by his hip comes down too early, and is thrown over by
//! the foot that lands.

use super::weight::Goal;
use super::{
    Adjustable, Clip, ENOUGH, LONGEST_STEP_RAD, Normal, Part, RAMP_S, ROOM_WEIGHT,
    SHORTEST_STEP_RAD, Solver, Stance,
};
use crate::motion::follow::APPROACH_SHARE;
use crate::retarget::base::StandingSole;
use crate::rigid::Placement;
use crate::rigid::ground::{GRAVITY_M_S2, SupportPolygon};
use glam::{DVec2, DVec3};
use nalgebra::Cholesky;
use serde::Serialize;

/// A foot that is so much higher than the other, as part of the height of the centre of mass, is lifted, and with so
/// much it is down again.
const LIFTED: f64 = 0.06;
const DOWN: f64 = 0.03;
/// How far inside the soles that carry the centre of mass is to be, as part of what they reach from their middle.
const INSIDE: f64 = 0.8;
/// One foot carries alone once the centre is so far inside it, as the same part, and slower than this, m/s.
const OVER: f64 = 0.6;
const SLOW_M_S: f64 = 0.03;
/// How fast springs draw, 1/s: the centre of mass, legs, all other joints, and up.
const WEIGHT_PER_S: f64 = 5.0;
const LEGS_PER_S: f64 = 5.0;
const ARMS_PER_S: f64 = 10.0;
const UP_PER_S: f64 = 3.0;
/// How far the zero-moment point goes from under the centre at most, as part of half a sole's breadth.
const HASTE: f64 = 0.3;
/// A foot goes up in this time, s, and so high, as part of the height of the centre of mass; it comes down and takes weight over
/// that time, s.
const LIFTS_S: f64 = 0.2;
const CLEARS: f64 = 0.05;
const LANDS_S: f64 = 0.6;
/// A sole that is less far from where it is to be stands there, m.
const STANDS_M: f64 = 0.003;
/// What planted soles count, against a whole clip's, whose feet do what legs do, and a centre that is not where it is to be,
/// 1/m.
const HOLD: f64 = 8.0;
const FOLLOWS: f64 = 800.0;
/// What a change of what is added counts, s: velocity; of what stands, and of what only makes way.
const CHANGE_S: [f64; 2] = [0.1, 0.05];
/// Springs are asked about no longer time at once, s.
const LONGEST_S: f64 = 0.05;
/// Legs that are further from where they should be are late, rad.
const LATE_RAD: f64 = 0.05;
/// Less that is added is nothing, rad.
const FAINT_RAD: f64 = 1e-5;
/// The part of a joint's limit of velocity that poses use, of legs and of all others: servos lag behind their goals the
/// further the faster these go, and one that is too far away stops it all.
const LEG_PACE: f64 = 0.5;
const REST_PACE: f64 = 0.7;
/// How fast goals go beyond poses as weight goes from foot to foot, 1/s.
const GIVES_WAY_PER_S: f64 = 10.0;
/// And how far at most, rad: a servo that gives way further holds no robot, or its file is wrong.
const MOST_BEYOND_RAD: f64 = 0.15;
/// How much of the room counts in so many steps: of the first pose, and of one that follows.
const FIRST: [(f64, usize); 3] = [(0.15, 6), (0.5, 6), (1.0, 12)];
const NEXT: [(f64, usize); 1] = [(1.0, 6)];

/// What a robot's feet do while it follows.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Step {
    /// Both stand.
    Stands,
    /// Both stand, and weight goes over to one side.
    Shifts { to: usize },
    /// One carries; the other goes straight up, for so long, s.
    Lifts { on: usize, for_s: f64 },
    /// One carries; the other goes where the person has it, for so long, s.
    Swings { on: usize, for_s: f64 },
    /// The other comes down, for so long, s.
    Lands { on: usize, for_s: f64 },
}

/// How often feet were lifted, or would have been.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Lifts {
    /// Feet that were lifted.
    pub lifted: u64,
    /// Feet that the person had put down again before the weight was over the other.
    pub kept_down: u64,
}

/// A robot on its own feet, from pose to pose.
#[derive(Clone, Debug)]
struct Feet {
    step: Step,
    /// Where the corners of the right sole are over the left one, m, while both stand.
    apart_m: Vec<[f64; 2]>,
    /// Where the centre of mass is to be, as the foot of this side sees it, m and m/s.
    side: usize,
    centre_m: DVec2,
    velocity_m_s: DVec2,
    lifts: Lifts,
    /// How high the centre of mass is, m.
    height_m: f64,
}

/// Moves poses one by one.
pub struct Adjuster<'a> {
    solver: Solver<'a>,
    legs: Part,
    rest: Part,
    /// Most that joints turn, rad/s.
    velocity_rad_s: &'a [f64],
    stands: bool,
    may_lift: bool,
    feet: Option<Feet>,
    /// The pose before, as it came and as it went.
    before: Option<[Vec<f64>; 2]>,
    is_late: bool,
    /// Its joints are on their way to the first pose: nothing is lifted, and all are slow.
    is_arriving: bool,
    /// How fast springs draw joints, rad/s.
    pace_rad_s: Vec<f64>,
    /// Up in the axes of the base, and how fast it goes, of a robot that stands.
    up: Option<(DVec3, DVec3)>,
    /// How far goals are beyond poses, rad.
    beyond_rad: Vec<f64>,
}

impl<'a> Adjuster<'a> {
    /// Of a robot that stands on its own feet or does not, whose joints turn by so much at most, rad/s, and are at `here_rad`
    /// now.
    #[must_use]
    pub fn new(
        of: Adjustable<'a>,
        velocity_rad_s: &'a [f64],
        here_rad: &[f64],
        stands: bool,
    ) -> Self {
        let solver = Solver::new(of);
        let (legs, rest) = solver.parts();
        // A robot of which one leg is not moved stands as it stands.
        let moves = |sole: &StandingSole| {
            solver.movers[sole.link].iter().all(|mover| legs.rows[mover.joint].is_some())
        };
        let stands =
            stands && solver.feet().is_some_and(|feet| feet.iter().all(|sole| moves(sole)));
        let up = solver
            .feet()
            .filter(|_| stands)
            .map(|_| (solver.of.body.up(here_rad).unwrap_or(DVec3::Z), DVec3::ZERO));
        // Who stands gets up from where it is; who does not may be anywhere at once.
        let before = stands.then(|| [here_rad.to_vec(), here_rad.to_vec()]);
        Self {
            solver,
            legs,
            rest,
            velocity_rad_s,
            stands,
            may_lift: true,
            feet: None,
            before,
            is_late: false,
            is_arriving: stands,
            pace_rad_s: vec![0.0; here_rad.len()],
            up,
            beyond_rad: vec![0.0; here_rad.len()],
        }
    }

    /// One that keeps both feet on the floor.
    pub(super) const fn kept_down(mut self) -> Self {
        self.may_lift = false;
        self
    }

    /// How often feet were lifted so far; none of a robot that need not stand.
    #[must_use]
    pub fn lifts(&self) -> Option<Lifts> {
        self.stands.then(|| self.feet.as_ref().map_or(Lifts::default(), |feet| feet.lifts))
    }

    /// True while it does not stand on both feet.
    #[must_use]
    pub fn is_stepping(&self) -> bool {
        self.feet.as_ref().is_some_and(|feet| feet.step != Step::Stands)
    }

    /// True while weight goes over to one foot, and while the other one leaves the floor or comes down.
    pub(super) fn hands_over(&self) -> bool {
        let step = self.feet.as_ref().map(|feet| feet.step);
        !matches!(step, None | Some(Step::Stands | Step::Swings { .. }))
    }

    /// Which feet stand, and where up is for them: `up` if it is not known yet.
    pub(super) fn feet(&self, up: DVec3) -> ([bool; 2], DVec3) {
        let stands = match self.feet.as_ref().map(|feet| feet.step) {
            Some(Step::Lifts { on, .. } | Step::Swings { on, .. } | Step::Lands { on, .. }) => {
                [on == 0, on == 1]
            }
            _ => [true; 2],
        };
        (stands, self.up.map_or(up, |(up, _)| up))
    }

    /// True while joints are on their way to the first pose.
    #[must_use]
    pub const fn is_arriving(&self) -> bool {
        self.is_arriving
    }

    /// True while legs are not where they should be already.
    #[must_use]
    pub const fn is_late(&self) -> bool {
        self.is_late
    }

    /// The pose `dt_s` after the one before, rad, in place of `pose`; `up` is up in the axes of the robot's base. Who is
    /// `approaching` goes slowly until all joints are there.
    pub fn next(&mut self, pose: &[f64], up: DVec3, dt_s: f64, approaching: bool) -> Vec<f64> {
        let mut here = self.place(pose, up, dt_s, approaching);
        self.go_beyond(&mut here, dt_s.clamp(0.0, LONGEST_S));
        here
    }

    /// The same pose, where joints are to be and not where their goals have to be for it.
    pub(super) fn place(
        &mut self,
        pose: &[f64],
        up: DVec3,
        dt_s: f64,
        approaching: bool,
    ) -> Vec<f64> {
        // Who was silent for longer is taken up from where he was.
        let dt_s = dt_s.clamp(0.0, LONGEST_S);
        self.is_arriving |= approaching && self.stands;
        let came = self.paced(pose, dt_s);
        let up = self.tilted(up, dt_s);
        let stance = self.stance(&came, up, dt_s);
        let mut here = came.clone();
        for (part, stance) in [(&self.legs, stance.as_ref()), (&self.rest, None)] {
            if part.joints.is_empty() {
                continue;
            }
            let poses = std::slice::from_ref(&here);
            let rate_hz = if dt_s > 0.0 { 1.0 / dt_s } else { 1.0 };
            let clip = Clip { solver: &self.solver, part, rate_hz, poses, stance };
            here = clip.next(self.before.as_ref(), dt_s);
        }
        for (angle, (lower_rad, upper_rad)) in here.iter_mut().zip(self.solver.of.limits_rad) {
            *angle = angle.clamp(*lower_rad, *upper_rad);
        }
        self.before = Some([came, here.clone()]);
        here
    }

    /// From where joints are to be to where their goals have to be for that, under the weight of a robot that stands.
    fn go_beyond(&mut self, pose: &mut [f64], dt_s: f64) {
        let Self { solver, feet: Some(feet), .. } = self else { return };
        let Some(soles) = solver.feet() else { return };
        let placed = solver.place(pose);
        let shares = feet.shares(solver, soles, &placed);
        let Some(beyond_rad) = solver.beyond_rad(&placed, soles, shares) else { return };
        let part = 1.0 - (-dt_s * GIVES_WAY_PER_S).exp();
        for joint in self.legs.joints.iter().chain(&self.rest.joints) {
            let here_rad = &mut self.beyond_rad[*joint];
            let beyond_rad = beyond_rad[*joint].clamp(-MOST_BEYOND_RAD, MOST_BEYOND_RAD);
            *here_rad += (beyond_rad - *here_rad) * part;
            let (lower_rad, upper_rad) = solver.of.limits_rad[*joint];
            pose[*joint] = (pose[*joint] + *here_rad).clamp(lower_rad, upper_rad);
        }
    }

    /// The pose, with joints that critically damped springs draw there, within what they can, those of legs and all others in the
    /// same proportion each: what stands on both does not stand if some are late, and what starts with a jerk falls.
    fn paced(&mut self, pose: &[f64], dt_s: f64) -> Vec<f64> {
        let mut came = pose.to_vec();
        let Some([before, _]) = self.before.as_ref().filter(|_| self.stands) else { return came };
        let share = if self.is_arriving { APPROACH_SHARE } else { 1.0 };
        let mut off_rad = [0.0_f64; 2];
        let parts = [(&self.legs, LEGS_PER_S, LEG_PACE), (&self.rest, ARMS_PER_S, REST_PACE)];
        for ((part, draws_per_s, pace), off_rad) in parts.into_iter().zip(&mut off_rad) {
            let mut most: f64 = 1.0;
            for joint in &part.joints {
                let velocity = &mut self.pace_rad_s[*joint];
                let away_rad = pose[*joint] - before[*joint];
                *velocity +=
                    (away_rad * draws_per_s.powi(2) - *velocity * 2.0 * draws_per_s) * dt_s;
                most = most.max(velocity.abs() / (pace * share * self.velocity_rad_s[*joint]));
            }
            for joint in &part.joints {
                let velocity = &mut self.pace_rad_s[*joint];
                *velocity /= most;
                came[*joint] = before[*joint] + *velocity * dt_s;
                *off_rad = off_rad.max((pose[*joint] - came[*joint]).abs());
            }
        }
        self.is_late = off_rad[0] > LATE_RAD;
        self.is_arriving &= off_rad.iter().any(|off_rad| *off_rad > LATE_RAD);
        came
    }

    /// Where up is, for soles that go no faster than legs.
    fn tilted(&mut self, up: DVec3, dt_s: f64) -> DVec3 {
        let Some((here, rate)) = &mut self.up else { return up };
        *rate += ((up - *here) * UP_PER_S.powi(2) - *rate * 2.0 * UP_PER_S) * dt_s;
        *here = (*here + *rate * dt_s).try_normalize().unwrap_or(up);
        *here
    }

    /// What both feet are to do now.
    fn stance(&mut self, came: &[f64], up: DVec3, dt_s: f64) -> Option<Stance> {
        let solver = &self.solver;
        let soles = solver.feet().filter(|_| self.stands)?;
        let placed = solver.place(came);
        let on_floor = Floor::of(solver, soles, &placed, up);
        let went = self.before.as_ref().map(|[_, went]| solver.place(went));
        let feet = self.feet.get_or_insert_with(|| Feet::standing(&on_floor));
        let is_now = went.as_ref().map(|went| Floor::of(solver, soles, went, up));
        feet.step(
            &on_floor,
            is_now.as_ref().unwrap_or(&on_floor),
            dt_s,
            self.may_lift && !self.is_arriving,
        );
        Some(feet.stance(up))
    }
}

/// A robot over the plane its soles stand on.
pub(super) struct Floor {
    /// How high the lowest corner of each sole is over the lower sole's, m.
    pub(super) height_m: [f64; 2],
    /// Corners of the right sole in the left one's frame, m.
    across_m: Vec<DVec3>,
    /// The centre of mass as either sole sees it, level, m: over its middle, and how high.
    pub(super) centre_m: [DVec3; 2],
    /// Corners of both soles as either sees them, m.
    pub(super) soles_m: [[Vec<DVec2>; 2]; 2],
    /// What a sole reaches from its middle, m.
    half_m: DVec2,
}

impl Floor {
    pub(super) fn of(
        solver: &Solver<'_>,
        soles: [&StandingSole; 2],
        placed: &[Placement],
        up: DVec3,
    ) -> Self {
        let frames = soles.map(Solver::frame);
        let corners = soles.map(|sole| {
            let corner = |corner: &DVec3| placed[sole.link].point(*corner);
            sole.corners_m.iter().map(corner).collect::<Vec<_>>()
        });
        let low = corners.each_ref().map(|corners| {
            corners.iter().map(|corner| up.dot(*corner)).fold(f64::INFINITY, f64::min)
        });
        let floor_m = low[0].min(low[1]);
        let centre_m = solver.of.body.tree.centre_of_mass_m(placed);
        // Level, forward as the sole's: what is not flat yet will be.
        let axes = frames.map(|frame| {
            let forward = placed[frame.link].turn * frame.axes[0];
            let forward = (forward - up * up.dot(forward)).try_normalize();
            let forward = forward.unwrap_or_else(|| up.any_orthonormal_vector());
            [forward, up.cross(forward), up]
        });
        let seen = |by: usize, at_m: DVec3| {
            let away = at_m - placed[frames[by].link].point(frames[by].at_m);
            DVec3::from(axes[by].map(|axis| axis.dot(away)))
        };
        let half_m = super::weight::half_m(soles[0]);
        let over = |by: usize| {
            corners.each_ref().map(|corners| {
                corners.iter().map(|corner| seen(by, *corner).truncate()).collect::<Vec<_>>()
            })
        };
        Self {
            height_m: low.map(|low| low - floor_m),
            across_m: Solver::across(placed, &frames[0], soles[1]),
            centre_m: [0, 1].map(|by| seen(by, centre_m)),
            soles_m: [over(0), over(1)],
            half_m,
        }
    }

    /// The middle of both soles, as a foot sees it, m.
    fn middle_m(&self, by: usize) -> DVec2 {
        let [left, right] = self.soles_m[by]
            .each_ref()
            .map(|corners| corners.iter().sum::<DVec2>() / corners.len().max(1) as f64);
        left.midpoint(right)
    }

    /// Where the centre may be while these carry, as a foot sees it: the nearest place far enough inside.
    fn inside(&self, by: usize, carries: [bool; 2], part: f64, at_m: DVec2) -> DVec2 {
        let soles = self.soles_m[by].iter().zip(carries).filter(|(_, carries)| *carries);
        let corners: Vec<DVec2> = soles.flat_map(|(sole, _)| sole.iter().copied()).collect();
        let support = SupportPolygon::of(&corners);
        let hull = support.corners_m();
        let mut at_m = at_m;
        // Each edge in turn, some times over: the nearest place or one near it.
        for _ in 0..4 {
            for (i, from) in hull.iter().enumerate().filter(|_| hull.len() >= 3) {
                let along = hull[(i + 1) % hull.len()] - *from;
                let Some(inward) = along.try_normalize().map(DVec2::perp) else { continue };
                let missing_m = part * (inward * self.half_m).length() - inward.dot(at_m - *from);
                if missing_m > 0.0 {
                    at_m += inward * missing_m;
                }
            }
        }
        at_m
    }
}

impl Feet {
    /// At first, on both feet where they are.
    fn standing(came: &Floor) -> Self {
        let apart_m = came.across_m.iter().map(|corner| [corner.x, corner.y]).collect();
        Self {
            step: Step::Stands,
            apart_m,
            side: 0,
            centre_m: came.centre_m[0].truncate(),
            velocity_m_s: DVec2::ZERO,
            lifts: Lifts::default(),
            height_m: came.centre_m[0].z,
        }
    }

    /// Goes on by `dt_s`: `came` is what the person does with the feet, `is` what the robot did last.
    fn step(&mut self, came: &Floor, is: &Floor, dt_s: f64, may_lift: bool) {
        let height_m = came.centre_m[0].z.max(came.centre_m[1].z);
        self.height_m = is.centre_m[self.side].z;
        let lifts = |side: usize| came.height_m[side] > LIFTED * height_m;
        let is_down = |side: usize| came.height_m[side] < DOWN * height_m;
        self.step = match self.step {
            Step::Stands if may_lift && lifts(0) => Step::Shifts { to: 1 },
            Step::Stands if may_lift && lifts(1) => Step::Shifts { to: 0 },
            Step::Shifts { to } if is_down(1 - to) => {
                self.lifts.kept_down += 1;
                Step::Stands
            }
            Step::Shifts { to } if self.is_over(is, to) => {
                self.lifts.lifted += 1;
                Step::Lifts { on: to, for_s: 0.0 }
            }
            Step::Lifts { on, for_s } if for_s >= LIFTS_S => Step::Swings { on, for_s: 0.0 },
            Step::Lifts { on, for_s } => Step::Lifts { on, for_s: for_s + dt_s },
            Step::Swings { on, for_s } if for_s >= RAMP_S && is_down(1 - on) => {
                Step::Lands { on, for_s: 0.0 }
            }
            Step::Swings { on, for_s } => Step::Swings { on, for_s: for_s + dt_s },
            Step::Lands { for_s, .. } if for_s >= LANDS_S && self.has_landed(is) => Step::Stands,
            Step::Lands { on, for_s } => Step::Lands { on, for_s: for_s + dt_s },
            as_before => as_before,
        };
        if let Step::Swings { .. } = self.step {
            // It comes down below where it is.
            self.apart_m = is.across_m.iter().map(|corner| [corner.x, corner.y]).collect();
        }
        self.draw(came, is, dt_s);
    }

    /// Whether the weight is over one foot, and stays there.
    fn is_over(&self, is: &Floor, on: usize) -> bool {
        let at_m = is.centre_m[on].truncate();
        let inside_m = is.inside(on, [on == 0, on == 1], OVER, at_m);
        at_m.distance(inside_m) < STANDS_M && self.velocity_m_s.length() < SLOW_M_S
    }

    /// What of the weight is on either sole.
    fn shares(
        &self,
        solver: &Solver<'_>,
        soles: [&StandingSole; 2],
        placed: &[Placement],
    ) -> [f64; 2] {
        if let Step::Lifts { on, .. } | Step::Swings { on, .. } = self.step {
            return [0, 1].map(|side| if side == on { 1.0 } else { 0.0 });
        }
        let [left_m, right_m] = soles.map(|sole| placed[sole.link].point(Solver::frame(sole).at_m));
        let across_m = left_m - right_m;
        let centre_m = solver.of.body.tree.centre_of_mass_m(placed) - right_m;
        let left = (centre_m.dot(across_m) / across_m.length_squared()).clamp(0.0, 1.0);
        [left, 1.0 - left]
    }

    fn has_landed(&self, is: &Floor) -> bool {
        is.across_m.iter().all(|corner| corner.z.abs() < STANDS_M)
    }

    /// Takes the centre nearer to where it is to be.
    fn draw(&mut self, came: &Floor, is: &Floor, dt_s: f64) {
        let (on, carries) = match self.step {
            Step::Stands => (self.side, [true; 2]),
            Step::Shifts { to: on }
            | Step::Lifts { on, .. }
            | Step::Swings { on, .. }
            | Step::Lands { on, .. } => (on, [on == 0, on == 1]),
        };
        if on != self.side {
            // The same place and way, seen by the other foot.
            let turned = |way: DVec2| {
                let two = |by: usize| {
                    let sole = &is.soles_m[by][0];
                    sole.first().zip(sole.last()).map_or(DVec2::X, |(a, b)| *b - *a)
                };
                let (old, new) = (two(self.side), two(on));
                DVec2::from_angle(old.angle_to(new)).rotate(way)
            };
            let off = turned(self.centre_m - is.centre_m[self.side].truncate());
            self.velocity_m_s = turned(self.velocity_m_s);
            self.centre_m = is.centre_m[on].truncate() + off;
            self.side = on;
        }
        // Where the person would have it, with the feet where the robot has them.
        let wanted_m = match self.step {
            Step::Stands => is.middle_m(on) + came.centre_m[on].truncate() - came.middle_m(on),
            _ => came.centre_m[on].truncate(),
        };
        let goal_m = is.inside(on, carries, INSIDE, wanted_m);
        let height_m = is.centre_m[on].z.max(0.01);
        let most_m_s2 = HASTE * is.half_m.min_element() * GRAVITY_M_S2 / height_m;
        let drawn = (goal_m - self.centre_m) * WEIGHT_PER_S.powi(2)
            - self.velocity_m_s * 2.0 * WEIGHT_PER_S;
        self.velocity_m_s += drawn.clamp_length_max(most_m_s2) * dt_s;
        self.centre_m += self.velocity_m_s * dt_s;
    }

    /// The same as the solver reads it, of the one pose it has.
    fn stance(&self, up: DVec3) -> Stance {
        let part = |for_s: f64, over_s: f64| {
            let part = (for_s / over_s).clamp(0.0, 1.0);
            part * part * (3.0 - 2.0 * part)
        };
        let (on, share, lift) = match self.step {
            Step::Stands => (self.side, 1.0, 0.0),
            Step::Shifts { to } => (to, 1.0, 0.0),
            Step::Lifts { on, for_s } => (on, 1.0, part(for_s, LIFTS_S)),
            Step::Swings { on, for_s } => (on, 1.0 - part(for_s, RAMP_S), 1.0),
            Step::Lands { on, for_s } => (on, part(for_s, RAMP_S), 1.0 - part(for_s, LANDS_S)),
        };
        let planted = [0, 1].map(|side| HOLD * if side == on { 1.0 } else { share });
        Stance {
            planted: vec![planted],
            up: vec![up],
            both: vec![(0..1, self.apart_m.clone())],
            held: vec![(share > 0.0).then_some((0, HOLD * share))],
            lift_m: [0, 1].map(|side| if side == on { 0.0 } else { lift * CLEARS * self.height_m }),
            stands: vec![planted.map(|planted| planted > 0.5)],
            goals: vec![Some(Goal { side: self.side, at_m: self.centre_m, weight: FOLLOWS })],
        }
    }
}

impl Clip<'_> {
    /// The one pose there is, moved from where what was added before leaves it.
    fn next(&self, before: Option<&[Vec<f64>; 2]>, dt_s: f64) -> Vec<f64> {
        let [came] = self.poses else { return Vec::new() };
        let joints = &self.part.joints;
        let added: Vec<f64> = match before {
            Some([came, went]) => joints.iter().map(|joint| went[*joint] - came[*joint]).collect(),
            None => vec![0.0; joints.len()],
        };
        let mut pose = came.clone();
        for (joint, added) in joints.iter().zip(&added) {
            pose[*joint] += added;
        }
        let is_free = self.stance.is_none() && added.iter().all(|added| *added == 0.0);
        if is_free && !self.is_crowded(&pose) {
            return pose;
        }
        let change = before.map_or(0.0, |_| {
            (CHANGE_S[usize::from(self.stance.is_none())] / dt_s.max(1e-3)).powi(2)
        });
        let near = self.nearness(came);
        let mut normal = Normal::new(joints.len());
        let mut row = vec![0.0; joints.len()];
        let mut fit = |pose: &[f64], normal: &mut Normal, room: f64| {
            normal.reset(&near);
            self.add_up(0, pose, room, &mut row, normal);
            for (at, joint) in joints.iter().enumerate() {
                let residual = pose[*joint] - came[*joint] - added[at];
                normal.cost += change * residual * residual;
                normal.gradient[at] += change * residual;
                normal.hessian[(at, at)] += change + super::DAMPING;
            }
            normal.cost
        };
        let phases: &[(f64, usize)] = if before.is_some() { &NEXT } else { &FIRST };
        for &(part, steps) in phases {
            let room = (ROOM_WEIGHT * part).powi(2);
            let mut here = fit(&pose, &mut normal, room);
            let mut best = (here, pose.clone());
            let mut calmer = 1.0;
            for _ in 0..steps {
                let Some(factor) = Cholesky::new(normal.hessian.clone()) else { break };
                let way = factor.solve(&normal.gradient);
                let longest_rad = way.amax();
                for (joint, way) in joints.iter().zip(way.iter()) {
                    pose[*joint] -= calmer * way.clamp(-LONGEST_STEP_RAD, LONGEST_STEP_RAD);
                }
                let there = fit(&pose, &mut normal, room);
                calmer = if there > here { calmer * 0.5 } else { (calmer * 1.3_f64).min(1.0) };
                let is_better = there < best.0;
                let is_enough = is_better && there > best.0 * (1.0 - ENOUGH);
                if is_better {
                    best = (there, pose.clone());
                }
                here = there;
                if is_enough || longest_rad < SHORTEST_STEP_RAD {
                    break;
                }
            }
            pose = best.1;
        }
        // What is left of an addition that nothing asks for any more.
        let is_gone = |joint: &usize| (pose[*joint] - came[*joint]).abs() < FAINT_RAD;
        if self.stance.is_none() && joints.iter().all(is_gone) {
            return came.clone();
        }
        pose
    }

    fn is_crowded(&self, pose: &[f64]) -> bool {
        let mut any = false;
        self.near(&self.solver.place(pose), |_, _| any = true);
        any
    }
}

#[cfg(test)]
mod tests;
