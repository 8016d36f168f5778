//! A motion on a robot that stands on its own feet: moved, and slowed where it must be, until it keeps its balance.

use super::Placed;
use crate::body::root::spread;
use crate::body::{Proportions, Segment};
use crate::error::{Error, counted, either};
use crate::job::model::robot_model;
use crate::mocap::anatomy::Capture;
use crate::mocap::retarget::Retargeted;
use crate::motion::retime::{factors, retime};
use crate::motion::tempo;
use crate::motion::{End, JointLimits, Path, Spline};
use crate::retarget::Footfall;
use crate::retarget::adjust::{
    Adjustable, Adjusting, FeetMay, Lifts, Pace, Survival, Waited, adjust, drawn_in, is_steady,
    pace, stays, steady, survives, touches_itself, waited,
};
use crate::retarget::effort;
use crate::retarget::footfall;
use crate::retarget::gait::{Gait, Walking, gait};
use crate::retarget::limbs::RobotLimbs;
use crate::retarget::steps::{self, Step};
use crate::retarget::toe::Toe;
use crate::robot::{Joint, Robot, RobotBody};
use glam::{DQuat, DVec3};
use std::fmt::Write as _;

/// How often the plan is made again because legs that go elsewhere need another tempo.
const ROUNDS: usize = 5;
/// A tempo that differs by less is the same.
const SAME: f64 = 0.1;
/// How many times as high as in the pose it starts in the weight of a robot may be that walks, and on how many steps that is
/// tried.
const HEIGHTS: [f64; 8] = [0.85, 0.9, 0.95, 1.0, 1.1, 1.2, 1.3, 1.4];
const TRIED: usize = 6;
/// Of heights at which it would have to be at most so many times slower than at the best the highest is taken: legs are like a
/// person's then.
const HASTE: f64 = 1.25;
/// An arm makes way for a leg over this time, standard deviation, s.
const WAY_S: f64 = 0.06;
/// Whoever is off the floor for longer flies, s.
const FLIES_S: f64 = 0.05;
/// A gait that was too fast is made anew so much slower than it had to be.
const SPARE: f64 = 1.02;
/// A gait that servos would let fall is made so many times slower, and how often that is tried.
const CALMER: f64 = 1.25;
const CALMINGS: usize = 2;

/// A robot that waits for its feet is in itself if it is so for more than this part of the time.
const TOUCHES: f64 = 0.02;

/// How it is to be done.
pub(super) struct Asked {
    /// How fast it will be played.
    pub speed: f64,
    /// Rather a fall than a person who waits for the robot's feet.
    pub may_fall: bool,
}

/// A motion that keeps its balance.
pub(super) struct Standing {
    /// What its feet do, pose by pose.
    pub footfalls: Vec<Footfall>,
    /// Of each pose the time of the motion as it came in, in poses; empty if it has its own pace.
    pub clock: Vec<f64>,
    /// What was done.
    pub note: String,
}

/// Moves and slows what can be done without a fall; nothing is changed if it cannot be, or need not be: `exact`
/// motions that stay well on their feet, and out of themselves, as they are.
///
/// # Errors
/// As of a path that is planned.
pub(super) fn balanced(
    robot: &Robot,
    placed: &Placed<'_>,
    capture: &Capture,
    footfalls: &[Footfall],
    Asked { speed, may_fall }: Asked,
    retargeted: &mut Retargeted,
) -> Result<Option<Standing>, Error> {
    let rate_hz = retargeted.rate_hz;
    let lengths = Proportions::of_stature(capture.stature_m)?;
    let toes = Toe::both(&capture.poses, rate_hz, &lengths);
    let mut said = footfalls.to_vec();
    footfall::plant(&mut said, &toes, rate_hz);
    footfall::hand_over(&mut said, rate_hz);
    let on = OnItsFeet { robot, placed, said: &said, speed, rate_hz };
    let slower = on.tempo(&retargeted.positions_rad)?;
    let of = on.adjusting(slower);
    let given = &retargeted.positions_rad;
    let is_apart = || !touches_itself(&of, given);
    if placed.exact && is_apart() && is_steady(&of, given)? && survives(&of, given)?.in_any_case() {
        return Ok(None);
    }
    let carries: Vec<[bool; 2]> =
        footfalls.iter().map(|of| of.touches.unwrap_or([true; 2])).collect();
    let flies_s = longest_flight(&carries) as f64 / rate_hz;
    let shifted = on.shifted(slower, given)?;
    let mut found = None;
    if let Some(moved) = shifted {
        if on.survival(&moved)?.as_they_are {
            return Ok(Some(moved.onto(retargeted)));
        }
        found = Some(moved);
    } else {
        let pelvis: Vec<DQuat> =
            capture.poses.iter().map(|pose| pose.orientation[Segment::Pelvis.index()]).collect();
        let leg_m = lengths.root_height_m();
        if let Some(steps) = steps::of_person(&toes, &carries, &pelvis, leg_m, rate_hz)
            && let Some(moved) = on.walked(&steps, leg_m, given)?
        {
            let moved = moved.without_flights(flies_s);
            if on.survival(&moved)?.as_they_are {
                return Ok(Some(moved.onto(retargeted)));
            }
            found = Some(moved);
        }
    }
    // As it came it is nearest to the person.
    if upright(&of, given)?.as_they_are {
        return Ok(None);
    }
    if may_fall {
        return Ok(found.map(|moved| moved.onto(retargeted)));
    }
    // One that is not in itself first, and then one that soft servos bear, too. Where nobody knows how servos give way, nobody
    // knows whether one leg bears it.
    let ways: &[FeetMay] = match placed.body.drives {
        Some(_) => &[FeetMay::Step, FeetMay::Stay],
        None => &[FeetMay::Stay],
    };
    let mut best: Option<([bool; 2], Moved)> = None;
    for feet_may in ways {
        let Some((moved, is_apart)) = on.waited(given, *feet_may)? else { break };
        let survival = on.survival(&moved)?;
        let good = [is_apart, survival.softly];
        if survival.as_they_are && best.as_ref().is_none_or(|(before, _)| good > *before) {
            best = Some((good, moved.without_flights(flies_s)));
        }
        if survival.as_they_are && good == [true; 2] {
            break;
        }
    }
    let holding = best.map(|(_, moved)| moved);
    Ok(holding.or(found).map(|moved| moved.onto(retargeted)))
}

/// Who stays up, by the pendulum and by trying.
fn upright(of: &Adjusting<'_>, angles_rad: &[Vec<f64>]) -> Result<Survival, Error> {
    match stays(of, angles_rad)? {
        true => survives(of, angles_rad),
        false => Ok(Survival { as_they_are: false, softly: false }),
    }
}

/// A motion that was moved.
struct Moved {
    /// `[joint][pose]`, rad.
    angles_rad: Vec<Vec<f64>>,
    standing: Standing,
}

impl Moved {
    fn onto(self, retargeted: &mut Retargeted) -> Standing {
        retargeted.positions_rad = self.angles_rad;
        self.standing
    }

    /// Says so, if the person was off the floor for so long.
    fn without_flights(mut self, flies_s: f64) -> Self {
        if flies_s > FLIES_S {
            let _ = write!(
                self.standing.note,
                "; it does not leave the floor, as the person does for {flies_s:.2} s"
            );
        }
        self
    }
}

/// For how many poses nothing carried, at most.
fn longest_flight(carries: &[[bool; 2]]) -> usize {
    carries.split(|carries| *carries != [false; 2]).map(<[_]>::len).max().unwrap_or(0)
}

/// Angles by joint, what the feet do, and a clock as that of [`Standing`].
type Shifted = (Vec<Vec<f64>>, Vec<Footfall>, Vec<f64>);

/// A robot on its own feet, and a motion that it is to do.
struct OnItsFeet<'a> {
    robot: &'a Robot,
    placed: &'a Placed<'a>,
    /// What the motion says of its feet.
    said: &'a [Footfall],
    speed: f64,
    rate_hz: f64,
}

impl<'a> OnItsFeet<'a> {
    /// How many times as long it takes when it is played.
    fn tempo(&self, angles_rad: &[Vec<f64>]) -> Result<f64, Error> {
        let path = Path::new(self.robot.joint_names(), self.rate_hz, angles_rad.to_vec())?;
        Ok(retime(&path.stretched(1.0 / self.speed), &self.robot.limits())?.factor / self.speed)
    }

    fn adjusting(&self, slower: f64) -> Adjusting<'a> {
        Adjusting {
            footfalls: Some(self.said),
            ..self.placed.adjusting(self.rate_hz, Some(slower))
        }
    }

    /// Weight is led over the feet that stand, slowly enough.
    fn shifted(&self, mut slower: f64, given: &[Vec<f64>]) -> Result<Option<Moved>, Error> {
        let rate_hz = self.rate_hz;
        let mut found = None;
        for _ in 0..ROUNDS {
            let mut angles_rad = given.to_vec();
            let mut times: Vec<f64> = Vec::new();
            let mut here = self.said.to_vec();
            let of = self.adjusting(slower);
            match pace(&of, &angles_rad) {
                Pace::Hopeless => return Ok(None),
                Pace::Even => {}
                Pace::Slowed(asked) => {
                    angles_rad = at_times(angles_rad, &asked)?;
                    here = footfall::at_times(self.said, &asked, rate_hz);
                    times = asked;
                }
            }
            let of = Adjusting { footfalls: Some(&here), ..of };
            let told = adjust(&of, &mut angles_rad)?;
            match steady(&of, &angles_rad)? {
                Pace::Hopeless => return Ok(None),
                Pace::Even => {}
                Pace::Slowed(asked) => {
                    angles_rad = at_times(angles_rad, &asked)?;
                    here = footfall::at_times(&here, &asked, rate_hz);
                    times = if times.is_empty() { asked } else { through(&times, &asked) };
                }
            }
            drawn_in(&self.placed.limits_rad, &mut angles_rad)?;
            let needed = self.tempo(&angles_rad)?;
            let is_same = (needed / slower - 1.0).abs() < SAME;
            slower = needed;
            found = Some((angles_rad, here, times, told));
            if is_same {
                break;
            }
        }
        let Some((angles_rad, footfalls, clock, told)) = found else { return Ok(None) };
        let (angles_rad, footfalls, clock) = self.hastened((angles_rad, footfalls, clock))?;
        let furthest = told.moved_rad.iter().zip(&self.robot.joints);
        let furthest = furthest.max_by(|a, b| a.0.total_cmp(b.0));
        let moved = furthest.map_or_else(String::new, |(moved_rad, joint)| {
            format!("{} by up to {:.0} deg", joint.name, moved_rad.to_degrees())
        });
        let longer = clock.len() as f64 / given[0].len().max(1) as f64;
        let note = format!(
            "moved so that the robot stands and keeps its balance: {moved}{}",
            if clock.is_empty() {
                String::new()
            } else {
                format!("; slower in parts, {longer:.2} times as long")
            }
        );
        Ok(Some(Moved { angles_rad, standing: Standing { footfalls, clock, note } }))
    }

    /// Whether it stays on its feet.
    fn survival(&self, moved: &Moved) -> Result<Survival, Error> {
        let Moved { angles_rad, standing } = moved;
        let slower = self.tempo(angles_rad)?;
        upright(
            &Adjusting { footfalls: Some(&standing.footfalls), ..self.adjusting(slower) },
            angles_rad,
        )
    }

    /// Weight is led over one foot before the other leaves the floor, and the person waits for that.
    /// And whether links keep out of one another, but for moments.
    fn waited(
        &self,
        given: &[Vec<f64>],
        feet_may: FeetMay,
    ) -> Result<Option<(Moved, bool)>, Error> {
        let (placed, rate_hz) = (self.placed, self.rate_hz);
        let limits = self.robot.limits();
        let velocity_rad_s: Vec<f64> = limits.iter().map(JointLimits::velocity_rad_s).collect();
        let of = placed.adjusting(rate_hz, None).robot;
        let rates = [rate_hz, self.speed];
        let Some(waited) = waited(of, &velocity_rad_s, given, self.said, rates, feet_may)? else {
            return Ok(None);
        };
        let Waited { mut angles_rad, footfalls, clock, lifts, touching_share } = waited;
        drawn_in(&placed.limits_rad, &mut angles_rad)?;
        let (angles_rad, footfalls, clock) = self.hastened((angles_rad, footfalls, clock))?;
        let Lifts { lifted, kept_down } = lifts;
        let longer = clock.len() as f64 / given[0].len().max(1) as f64;
        let mut note = "moved so that the robot stands and keeps its balance: ".to_owned();
        note += match lifted {
            0 => "both feet stay on the floor",
            _ => "a foot goes straight up once the weight is over the other one, and straight down",
        };
        if lifted + kept_down > 0 {
            let _ = write!(
                note,
                "; feet lifted: {lifted}, kept down since no weight came over the other one: {kept_down}"
            );
        }
        let _ = write!(note, "; {longer:.2} times as long");
        let moved = Moved { angles_rad, standing: Standing { footfalls, clock, note } };
        Ok(Some((moved, touching_share < TOUCHES)))
    }

    /// Slows a motion in parts for its joints' limits, and not all of it, if it stays well on its feet then.
    fn hastened(&self, (angles_rad, footfalls, clock): Shifted) -> Result<Shifted, Error> {
        let path = Path::new(self.robot.joint_names(), self.rate_hz, angles_rad.clone())?;
        let path = path.stretched(1.0 / self.speed);
        if let Some(times) = tempo::in_parts(&path, |path| factors(path, &self.robot.limits()))? {
            let mut slowed = at_times(angles_rad.clone(), &times)?;
            drawn_in(&self.placed.limits_rad, &mut slowed)?;
            let here = footfall::at_times(&footfalls, &times, self.rate_hz);
            let of = Adjusting { footfalls: Some(&here), ..self.adjusting(self.tempo(&slowed)?) };
            if steady(&of, &slowed)? == Pace::Even && survives(&of, &slowed)?.in_any_case() {
                let clock = if clock.is_empty() { times } else { through(&clock, &times) };
                return Ok((slowed, here, clock));
            }
        }
        Ok((angles_rad, footfalls, clock))
    }

    /// How high the base is best: legs that are nearly straight have to hasten.
    fn height(&self, steps: &[Step], scale: f64, given: &[Vec<f64>]) -> Result<Option<f64>, Error> {
        let few = &steps[..steps.len().min(TRIED)];
        let until_s = few.last().map_or(0.0, |step| step.planted_s);
        let count = (until_s * self.rate_hz) as usize + 2;
        let begins = |series: &Vec<f64>| series[..series.len().min(count)].to_vec();
        let angles_rad: Vec<Vec<f64>> = given.iter().map(begins).collect();
        let mut tried: Vec<(f64, f64)> = Vec::new();
        for height in HEIGHTS {
            if let Some(made) = self.gait(few, [scale, 1.0, height], &angles_rad)? {
                let needed = self.tempo(&made.angles_rad)?;
                tried.push((needed, height));
            }
        }
        let least = tried.iter().map(|(needed, _)| *needed).fold(f64::INFINITY, f64::min);
        Ok(tried.iter().rev().find(|(needed, _)| *needed <= HASTE * least).map(|of| of.1))
    }

    /// A gait, whose arms make way for its legs: with legs so long beside a person's, so much slower than it could be,
    /// on a base so high.
    fn gait(
        &self,
        steps: &[Step],
        [scale, slower, height]: [f64; 3],
        angles_rad: &[Vec<f64>],
    ) -> Result<Option<Gait>, Error> {
        let (placed, rate_hz, speed) = (self.placed, self.rate_hz, self.speed);
        let made = gait(&Walking {
            body: placed.body,
            start_rad: &placed.start_rad,
            limits_rad: &placed.limits_rad,
            angles_rad,
            rate_hz,
            steps,
            scale,
            speed,
            slower,
            height,
        });
        let Some(mut made) = made else { return Ok(None) };
        let mut arms = placed.free.clone();
        made.legs.iter().for_each(|joint| arms[*joint] = false);
        let of = placed.adjusting(rate_hz, None);
        let of = Adjusting { robot: Adjustable { free: &arms, ..of.robot }, ..of };
        let mut apart_rad = made.angles_rad.clone();
        adjust(&of, &mut apart_rad)?;
        for (series, apart_rad) in made.angles_rad.iter_mut().zip(&apart_rad) {
            let mut added: Vec<DVec3> =
                series.iter().zip(apart_rad).map(|(is, to)| DVec3::X * (to - is)).collect();
            spread(&mut added, rate_hz * speed, WAY_S);
            series.iter_mut().zip(added).for_each(|(angle, added)| *angle += added.x);
        }
        drawn_in(&placed.limits_rad, &mut made.angles_rad)?;
        Ok(Some(made))
    }

    /// Steps of a person whose legs are so long are made into a gait for the robot's own legs.
    fn walked(
        &self,
        steps: &[Step],
        leg_m: f64,
        given: &[Vec<f64>],
    ) -> Result<Option<Moved>, Error> {
        let rate_hz = self.rate_hz;
        let limbs = RobotLimbs::of(&robot_model(self.robot)?, self.placed.body);
        let Some(own_m) = limbs.leg_m() else { return Ok(None) };
        let scale = own_m / leg_m;
        let Some(height) = self.height(steps, scale, given)? else { return Ok(None) };
        let (mut slower, mut calmings) = (1.0, 0);
        let mut found: Option<Moved> = None;
        for _ in 0..ROUNDS + CALMINGS {
            let made = self.gait(steps, [scale, slower, height], given)?;
            let Some(made) = made else { break };
            let needed = self.tempo(&made.angles_rad)? * self.speed;
            if needed > 1.0 {
                slower *= needed * SPARE;
                continue;
            }
            let footfalls = footfall::of_contacts(&made.stands, rate_hz);
            let of = Adjusting { footfalls: Some(&footfalls), ..self.adjusting(1.0 / self.speed) };
            if !stays(&of, &made.angles_rad)? {
                break;
            }
            let note = format!(
                "{} {} made for the robot's own legs, upright: {:.1} cm long at most, {:.2} s each; stay near, soft servos may \
                 still let it fall",
                counted(steps.len(), "step"),
                either(steps.len(), "is", "are"),
                made.longest_m * 100.0,
                made.step_s
            );
            let holds = survives(&of, &made.angles_rad)?.in_any_case();
            let standing = Standing { footfalls, clock: made.clock, note };
            let moved = Moved { angles_rad: made.angles_rad, standing };
            if holds {
                found = Some(moved);
                break;
            }
            // If none holds, the first: at that pace nobody falls whose servos are stiff.
            found = found.or(Some(moved));
            if calmings == CALMINGS {
                break;
            }
            (calmings, slower) = (calmings + 1, slower * CALMER);
        }
        Ok(found)
    }
}

/// Slows a motion of a robot whose base is held in parts, for the limits of its joints and for what its motors can do, at this
/// playing speed: the times of it that follow one another then, in samples.
///
/// # Errors
/// As of a path that is planned.
pub(super) fn in_parts(
    robot: &Robot,
    speed: f64,
    retargeted: &mut Retargeted,
) -> Result<Option<Vec<f64>>, Error> {
    let limits = robot.limits();
    let series = retargeted.positions_rad.clone();
    let path = Path::new(robot.joint_names(), retargeted.rate_hz, series)?;
    let path = path.stretched(1.0 / speed);
    let body = RobotBody::of(&robot.file)?.filter(|body| body.tree.mass_kg() > 0.0);
    let motors: Vec<_> = robot.joints.iter().map(Joint::motor_curve).collect();
    let needs = |path: &Path| {
        let mut needs = factors(path, &limits);
        if let Some(body) = &body {
            let motors = effort::held_factors(body, path, &motors);
            needs.iter_mut().zip(motors).for_each(|(need, motor)| *need = need.max(motor));
        }
        needs
    };
    let Some(times) = tempo::in_parts(&path, needs)? else { return Ok(None) };
    let before = path.samples().max(1) as f64;
    let mut slowed = at_times(std::mem::take(&mut retargeted.positions_rad), &times)?;
    let limits_rad: Vec<(f64, f64)> =
        limits.iter().map(|limits| (limits.lower_rad(), limits.upper_rad())).collect();
    drawn_in(&limits_rad, &mut slowed)?;
    retargeted.positions_rad = slowed;
    retargeted.notes.push(format!(
        "slower in parts, where joints have to hasten: {:.2} times as long (all of it would take {:.2} times as long)",
        times.len() as f64 / before,
        retime(&path, &limits)?.factor
    ));
    Ok(Some(times))
}

/// Series at other times, in samples.
fn at_times(series: Vec<Vec<f64>>, times: &[f64]) -> Result<Vec<Vec<f64>>, Error> {
    let one = |series: Vec<f64>| {
        let spline = Spline::through(series, 1.0, End::Free, End::Free)?;
        Ok(times.iter().map(|time| spline.sample(*time)[0]).collect())
    };
    series.into_iter().map(one).collect()
}

/// What a clock says at other times of its own, in samples.
pub(super) fn through(clock: &[f64], times: &[f64]) -> Vec<f64> {
    let Some(last) = clock.len().checked_sub(1) else { return times.to_vec() };
    let at = |time: &f64| {
        let along = time.clamp(0.0, last as f64);
        let before = along as usize;
        let next = clock[(before + 1).min(last)];
        clock[before] + (next - clock[before]) * along.fract()
    };
    times.iter().map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flight_lasts_as_long_as_nothing_carries() {
        let (off, left, both) = ([false; 2], [true, false], [true; 2]);
        assert_eq!(longest_flight(&[left, off, left, off, off, both]), 2);
        assert_eq!((longest_flight(&[both, left]), longest_flight(&[])), (0, 0));
    }

    #[test]
    fn a_clock_of_a_clock_tells_the_time_of_the_first() {
        let first = [0.0, 0.5, 1.0, 2.0, 3.0];
        assert_eq!(through(&first, &[0.0, 1.0, 2.5, 4.0]), [0.0, 0.5, 1.5, 3.0]);
    }
}
