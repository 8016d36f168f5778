//! From where the robot stands through a path to rest, as one trajectory.
//!
//! A plan is: a transition actionlet from the measured pose to the path's first pose, all joints
//! together; the path; rest at its last pose. A path that starts at rest and without acceleration,
//! as an actionlet does, begins by its own clock. Where it starts in motion, or accelerated, that
//! clock is run up from rate 0 to 1 as half an actionlet, and where it ends so it is run down; so
//! velocity and acceleration are zero at both ends, and no part of the path is lost. Everything is
//! laid on one even grid of knots that contains the path's own: away from eased ends the path is
//! kept exactly.

use crate::error::{Error, ErrorKind, counted};
use crate::motion::ease::{
    eased_rate, eased_rate_derivative, eased_time_s, knotted_step, shortest_step_s,
};
use crate::motion::limits::JointLimits;
use crate::motion::path::{MAX_VALUES, Path};
use crate::motion::retime::{Because, HEADROOM, Retimed, refuse_beyond, retime};
use crate::motion::spline::Extreme;
use crate::motion::trajectory::{Setpoint, Trajectory, check_limits};

/// Furthest start from the first pose when no approach is allowed.
pub const NEAR_RAD: f64 = 0.05;
/// From here on the approach has no least duration: the robot is there already.
pub const THERE_RAD: f64 = 1e-3;
/// Least duration of an approach.
pub const APPROACH_MIN_S: f64 = 0.5;
/// Share of the velocity and acceleration limits a transition uses: it is not part of what was
/// asked for, and whoever stands by should see it coming. Slower playing slows it further.
pub const TRANSITION_SHARE: f64 = 0.3;
/// Least duration of easing in or out, and of closing a gap below [`THERE_RAD`].
pub const EASE_MIN_S: f64 = 0.05;
/// An end of a path counts as free of acceleration up to this share of each joint's limit.
pub const UNACCELERATED_SHARE: f64 = 0.01;
/// Slowest and fastest playing speed.
pub const SPEEDS: core::ops::RangeInclusive<f64> = 0.01..=100.0;

const KNOT_STEP_MAX_S: f64 = 0.005;
/// Each further attempt leaves twice the room to the limits: 1 %, 2 %, ... 20 times.
const ATTEMPTS: i32 = 12;
/// Candidate ease durations grow by this part.
const EASE_GROWTH: f64 = 1.02;

/// How to play a path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanOptions {
    /// Playing speed; 2 is twice as fast as recorded.
    pub speed: f64,
    /// Whether the motion may be slowed down until velocity and acceleration limits hold.
    pub retime: bool,
    /// Whether the robot may be moved to a first pose further than [`NEAR_RAD`] from its own.
    pub approach: bool,
    /// How often the path is played; between rounds a transition leads back to its first pose.
    pub rounds: u32,
    /// Transitions take so many times as long as joints need; 1 or more.
    pub calm: f64,
}

impl Default for PlanOptions {
    fn default() -> Self {
        Self { speed: 1.0, retime: true, approach: true, rounds: 1, calm: 1.0 }
    }
}

/// A trajectory and how it came about.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// What to play.
    pub trajectory: Trajectory,
    /// What was done to the path's time, after the playing speed. Where easing in and out would not
    /// fit into the path, it is slowed further and acceleration named as the reason.
    pub retimed: Retimed,
    /// Duration of the transition from the start pose to the path's first pose.
    pub approach_s: f64,
    /// Time in the trajectory at which the path begins (the first time).
    pub clip_start_s: f64,
    /// How long the path takes, easing included (each time).
    pub clip_s: f64,
    /// Time in which the path's clock gains its speed; 0 for a path that starts at rest and without
    /// acceleration.
    pub ease_in_s: f64,
    /// Time in which the path's clock loses its speed; 0 for a path that ends at rest and without
    /// acceleration.
    pub ease_out_s: f64,
    /// How many times as long the path takes as it was given, easing apart: speed and retiming.
    pub stretch: f64,
}

impl Plan {
    /// Times in s and angles in rad, in the order of the trajectory's joints. The last row is the end
    /// itself, wherever it falls on the grid.
    pub fn rows(&self, rate_hz: f64) -> impl Iterator<Item = (f64, Vec<f64>)> {
        let trajectory = &self.trajectory;
        let last = (trajectory.duration_s() * rate_hz).ceil() as usize;
        let mut setpoints = vec![Setpoint::default(); trajectory.joints().len()];
        (0..=last).map(move |row| {
            let time_s = (row as f64 / rate_hz).min(trajectory.duration_s());
            trajectory.sample(time_s, &mut setpoints);
            (time_s, setpoints.iter().map(|setpoint| setpoint.position_rad).collect())
        })
    }

    /// The time of the path as it was given, s, that is played at a time of the trajectory, the first time
    /// it is played: its beginning before, its end after.
    #[must_use]
    pub fn path_time_s(&self, time_s: f64) -> f64 {
        let elapsed_s = (time_s - self.clip_start_s).clamp(0.0, self.clip_s);
        let left_s = self.clip_s - elapsed_s;
        let along_s = if left_s < self.ease_out_s {
            let path_s = self.clip_s - self.ease_in_s / 2.0 - self.ease_out_s / 2.0;
            path_s - eased_time_s(left_s, self.ease_out_s)
        } else {
            eased_time_s(elapsed_s, self.ease_in_s)
        };
        along_s / self.stretch
    }
}

/// Plans how to play `path` from `start_rad`, one position and one entry of `limits` per joint of
/// the path.
///
/// # Errors
/// If numbers do not fit together, the start pose or the path leaves its joint ranges, the start is
/// too far and no approach is allowed, or limits cannot be held with the options given. Joint,
/// quantity, value, limit and time are named; times count from the start of the path, or from the
/// start of the trajectory where the transition is meant.
pub fn plan(
    start_rad: &[f64],
    path: &Path,
    limits: &[JointLimits],
    options: PlanOptions,
) -> Result<Plan, Error> {
    check_limits(path.joints(), limits)?;
    check_options(options)?;
    check_start(start_rad, path, limits, options)?;
    for ((joint, spline), limits) in path.joints().iter().zip(path.splines()).zip(limits) {
        limits.admit_positions(joint, &spline.extremes())?;
    }
    let path = path.stretched(1.0 / options.speed);
    if !options.retime {
        refuse_beyond(&path, limits)?;
    }
    let retimed = if options.retime {
        retime(&path, limits)?
    } else {
        Retimed { factor: 1.0, joint: (0, path.joints()[0].clone()), because: Because::Nothing }
    };
    let mut refusal = None;
    for attempt in 0..ATTEMPTS {
        let room = HEADROOM * 2f64.powi(attempt);
        let mut retimed = retimed.clone();
        if attempt > 0 && options.retime {
            retimed.factor *= 1.0 + room;
            if retimed.because == Because::Nothing {
                retimed.because = Because::Acceleration;
            }
        }
        let layout = Layout {
            path: path.stretched(retimed.factor),
            limits,
            room: 1.0 + room / 2.0,
            pace: options.speed.min(1.0) / options.calm.max(1.0),
        };
        match layout.plan(start_rad, options, retimed) {
            Ok(plan) => return Ok(plan),
            Err(error) => refusal = Some(error),
        }
    }
    Err(refusal
        .unwrap_or_else(|| Error::of(ErrorKind::OutsideLimits, "the motion could not be planned")))
}

fn check_options(options: PlanOptions) -> Result<(), Error> {
    if !SPEEDS.contains(&options.speed) {
        return Err(Error::of(ErrorKind::OutsideLimits, "the playing speed is out of range")
            .got(options.speed.to_string())
            .allowed(format!("{} to {}", SPEEDS.start(), SPEEDS.end())));
    }
    if options.rounds == 0 {
        return Err(Error::new("a motion must be played at least once").got("0 rounds"));
    }
    Ok(())
}

fn check_start(
    start_rad: &[f64],
    path: &Path,
    limits: &[JointLimits],
    options: PlanOptions,
) -> Result<(), Error> {
    if start_rad.len() != limits.len() {
        return Err(Error::new("start pose and joints differ in number")
            .got(counted(start_rad.len(), "position"))
            .allowed(format!("one for each of {}", counted(limits.len(), "joint"))));
    }
    for (joint, (start, limits)) in path.joints().iter().zip(start_rad.iter().zip(limits)) {
        let position = Extreme { time_s: 0.0, value: *start };
        limits.admit_position(joint, position).map_err(|mut error| {
            error.what = format!("joint {joint} stands outside its range");
            error.remedy("move the joint inside its range by hand, or correct its calibration")
        })?;
    }
    if options.approach {
        return Ok(());
    }
    for ((joint, start), first) in path.joints().iter().zip(start_rad).zip(path.first_rad()) {
        if !((start - first).abs() <= NEAR_RAD) {
            return Err(Error::new(format!(
                "joint {joint} stands far from where the motion starts"
            ))
            .at(format!("joint {joint}"))
            .got(format!("{start:.4} rad ({:.1} deg)", start.to_degrees()))
            .allowed(format!(
                "within {NEAR_RAD} rad of {first:.4} rad ({:.1} deg)",
                first.to_degrees()
            ))
            .remedy("leave out --no-approach, or bring the robot to the first pose"));
        }
    }
    Ok(())
}

/// A path in its final timing, to be laid on knots with a certain room to the limits.
struct Layout<'a> {
    path: Path,
    limits: &'a [JointLimits],
    /// What easing asks of a joint is at most its limit divided by this.
    room: f64,
    /// Speed of transitions, at most 1: they are never played faster, but slower with the rest.
    pace: f64,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum PathEnd {
    First,
    Last,
}

impl Layout<'_> {
    fn plan(
        &self,
        start_rad: &[f64],
        options: PlanOptions,
        retimed: Retimed,
    ) -> Result<Plan, Error> {
        let knot_s = self.path.step_s() / self.knots_per_step() as f64;
        let ease_in = self.ease_knots(PathEnd::First)?;
        let ease_out = self.ease_knots(PathEnd::Last)?;
        let first_rad = self.path.first_rad();
        let approach = self.transition_knots(start_rad, &first_rad);
        let back = self.transition_knots(&self.path.last_rad(), &first_rad);
        let clip = self.clip_knots() + ease_in / 2 + ease_out / 2;
        let again = (options.rounds as usize - 1).saturating_mul(clip.saturating_add(back));
        let knots = clip.saturating_add(approach).saturating_add(again).saturating_add(1);
        if knots.saturating_mul(self.limits.len()) > MAX_VALUES {
            return Err(Error::new("the planned motion is too long")
                .got(format!("{:.0} s", knots as f64 * knot_s))
                .allowed(format!(
                    "{:.0} s of {}, at {:.0} positions a second",
                    (MAX_VALUES / self.limits.len()) as f64 * knot_s,
                    counted(self.limits.len(), "joint"),
                    1.0 / knot_s
                ))
                .remedy("play a shorter section, or fewer rounds"));
        }
        let clip_times_s = self.clip_times_s(ease_in, ease_out);
        let approach_s = approach as f64 * knot_s;
        let (approach, back) = (knotted_step(approach), knotted_step(back));
        let mut rows = Vec::with_capacity(self.limits.len());
        for ((spline, first), start) in self.path.splines().iter().zip(&first_rad).zip(start_rad) {
            let mut row = Vec::with_capacity(knots);
            row.push(*start);
            for round in 0..options.rounds {
                push_transition(&mut row, *first, if round == 0 { &approach } else { &back });
                row.extend(clip_times_s[1..].iter().map(|time_s| spline.sample(*time_s)[0]));
            }
            rows.push(row);
        }
        let trajectory = Trajectory::new(self.path.joints().to_vec(), knot_s, rows, self.limits)?;
        let stretch = retimed.factor / options.speed;
        Ok(Plan {
            trajectory,
            retimed,
            stretch,
            approach_s,
            clip_start_s: approach_s,
            clip_s: clip as f64 * knot_s,
            ease_in_s: ease_in as f64 * knot_s,
            ease_out_s: ease_out as f64 * knot_s,
        })
    }

    fn knots_per_step(&self) -> usize {
        (self.path.step_s() / KNOT_STEP_MAX_S).ceil().max(1.0) as usize
    }

    fn clip_knots(&self) -> usize {
        (self.path.samples() - 1).saturating_mul(self.knots_per_step())
    }

    fn knots_in(&self, duration_s: f64) -> usize {
        let knot_s = self.path.step_s() / self.knots_per_step() as f64;
        (duration_s / knot_s).ceil() as usize
    }

    /// Knots of a transition actionlet that moves all joints together within limits.
    fn transition_knots(&self, from_rad: &[f64], to_rad: &[f64]) -> usize {
        let mut furthest_rad = 0f64;
        let mut duration_s = 0f64;
        for ((from, to), limits) in from_rad.iter().zip(to_rad).zip(self.limits) {
            let velocity = limits.velocity_rad_s() * TRANSITION_SHARE;
            let acceleration = limits.acceleration_rad_s2() * TRANSITION_SHARE;
            furthest_rad = furthest_rad.max((to - from).abs());
            duration_s = duration_s.max(shortest_step_s(to - from, velocity, acceleration));
        }
        if furthest_rad == 0.0 {
            return 0;
        }
        let least_s = if furthest_rad > THERE_RAD { APPROACH_MIN_S } else { EASE_MIN_S };
        self.knots_in(duration_s.max(least_s) / self.pace)
    }

    /// True if the path itself is at an end as an actionlet is: no joint moves, none is
    /// accelerated.
    fn is_at_rest(&self, end: PathEnd) -> bool {
        let (moving, time_s) = match end {
            PathEnd::First => (self.path.starts_moving(), 0.0),
            PathEnd::Last => (self.path.ends_moving(), self.path.duration_s()),
        };
        !moving
            && self.path.splines().iter().zip(self.limits).all(|(spline, limits)| {
                let [_, _, acceleration] = spline.sample(time_s);
                acceleration.abs() <= UNACCELERATED_SHARE * limits.acceleration_rad_s2()
            })
    }

    /// Knots of the shortest easing at one end that holds the acceleration limits; 0 where the path
    /// needs none. Even, so that the path time it covers, half its duration, ends on a knot.
    fn ease_knots(&self, end: PathEnd) -> Result<usize, Error> {
        if self.is_at_rest(end) {
            return Ok(0);
        }
        let other = match end {
            PathEnd::First => PathEnd::Last,
            PathEnd::Last => PathEnd::First,
        };
        let most = match self.is_at_rest(other) {
            true => self.clip_knots().saturating_mul(2),
            false => self.clip_knots(),
        };
        let mut knots = self.knots_in(EASE_MIN_S).next_multiple_of(2);
        while knots <= most {
            if self.eases_within_limits(end, knots) {
                return Ok(knots);
            }
            knots = ((knots as f64 * EASE_GROWTH) as usize).max(knots + 2).next_multiple_of(2);
        }
        let word = if end == PathEnd::First { "in at its start" } else { "out at its end" };
        Err(Error::new(format!("the motion cannot be eased {word} within its limits"))
            .got(format!("a path of {:.3} s that moves or bends there", self.path.duration_s()))
            .allowed("acceleration limits hold while the path's clock gains or loses its speed")
            .remedy("allow retiming, play slower, or cut the motion where it rests"))
    }

    /// Judges `q'' s'^2 + q' s''` at every knot; a trajectory's acceleration is linear between.
    fn eases_within_limits(&self, end: PathEnd, knots: usize) -> bool {
        let knot_s = self.path.step_s() / self.knots_per_step() as f64;
        let ease_s = knots as f64 * knot_s;
        let duration_s = self.path.duration_s();
        (0..=knots).all(|knot| {
            let elapsed_s = knot as f64 * knot_s;
            let rate = eased_rate(elapsed_s, ease_s);
            let rate_derivative = eased_rate_derivative(elapsed_s, ease_s);
            let along_s = eased_time_s(elapsed_s, ease_s);
            // Easing out is easing in seen backwards: velocities change sign.
            let (time_s, rate_derivative) = match end {
                PathEnd::First => (along_s, rate_derivative),
                PathEnd::Last => (duration_s - along_s, -rate_derivative),
            };
            self.path.splines().iter().zip(self.limits).all(|(spline, limits)| {
                let [_, velocity, acceleration] = spline.sample(time_s);
                let asked = acceleration * rate * rate + velocity * rate_derivative;
                asked.abs() <= limits.acceleration_rad_s2() / self.room
            })
        })
    }

    /// Path time at each knot of the eased path, from 0 to the path's duration.
    fn clip_times_s(&self, ease_in: usize, ease_out: usize) -> Vec<f64> {
        let knot_s = self.path.step_s() / self.knots_per_step() as f64;
        let eased = |knot: usize, of: usize| {
            if knot == 0 { 0.0 } else { eased_time_s(knot as f64 * knot_s, of as f64 * knot_s) }
        };
        let (from, to) = (ease_in / 2, self.clip_knots() - ease_out / 2);
        let first = (0..ease_in).map(|knot| eased(knot, ease_in));
        let middle = (from..to).map(|knot| knot as f64 * knot_s);
        let end_s = self.path.duration_s();
        let last = (0..=ease_out).rev().map(|knot| end_s - eased(knot, ease_out));
        first.chain(middle).chain(last).collect()
    }
}

/// Continues a row to `to` along a transition's knots.
fn push_transition(row: &mut Vec<f64>, to: f64, parts: &[f64]) {
    let Some(&from) = row.last() else { return };
    row.extend(parts.iter().skip(1).map(|part| from + (to - from) * part));
    // The path goes on from exactly here.
    if let (Some(last), true) = (row.last_mut(), parts.len() > 1) {
        *last = to;
    }
}

#[cfg(test)]
mod tests;
