//! Balance while a motion is played: joints answer a base that is tilted, or turns, otherwise than the motion wants.
//!
//! What the motion wants of the base follows from the joints: a robot that stands flat on its soles is tilted as its legs have
//! it ([`RobotBody::up`]). What the base does, a gyroscope and an accelerometer tell (VQF; D. Laidig and T. Seel, Information
//! Fusion 91, 2023). Of the difference each joint that the robot's file names takes its share, as walking robots
//! of this size do: a gain on the angle and one on its rate.
//!
//! The answer is a small motion of its own beside the other: bounded in angle, in velocity and in acceleration
//! ([`Chase`]), from rest to rest. The motion is laid within what it leaves of the joints' limits, so that both together keep
//! them. When the motion is over, or comes to its stop, the answer goes back to nothing.

use super::cycle::Motion;
use super::health::{BLIND_CYCLES, FALLEN_RAD, StopReason};
use crate::device::Inertial;
use crate::device::inertial::STANDARD_GRAVITY_M_S2;
use crate::error::{Error, ErrorKind, counted};
use crate::motion::follow::Chase;
use crate::motion::{JointLimits, Setpoint};
use crate::robot::{Joint, Robot, RobotBody};
use crate::time::Instant;
use gaitway_profiles as profiles;
use glam::{DQuat, DVec3};
use vqf_rs::VQF;

/// A robot that stands is accelerated by gravity alone, but for so much, as a part of it.
const STILL_SHARE: f64 = 0.2;
/// And turns no faster, rad/s.
const STILL_RAD_S: f64 = 0.3;
/// And is no further from how its legs have it, rad: 15 deg. A sensor that is screwed on otherwise is further.
const UPRIGHT_RAD: f64 = std::f64::consts::PI / 12.0;
/// Ends of ranges are rounded inward to counts, of which none is larger, rad.
const ROUNDING_RAD: f64 = 0.006;
/// An answer this slow and this small is none any more, rad/s and rad.
const REST: f64 = 1e-9;

/// What balancing came to.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct BalanceFigures {
    /// Cycles in which the sensor answered.
    pub felt_cycles: u64,
    /// Cycles in which it did not.
    pub missed_cycles: u64,
    /// Most that the base was tilted otherwise than the motion wants, rad.
    pub peak_tilt_rad: f64,
    /// Most that any joint was moved for it, rad.
    pub peak_correction_rad: f64,
}

impl BalanceFigures {
    /// Takes what another stretch of balancing came to as its continuation.
    pub fn take_up(&mut self, later: &Self) {
        self.felt_cycles += later.felt_cycles;
        self.missed_cycles += later.missed_cycles;
        self.peak_tilt_rad = self.peak_tilt_rad.max(later.peak_tilt_rad);
        self.peak_correction_rad = self.peak_correction_rad.max(later.peak_correction_rad);
    }

    /// As a person reads it.
    #[must_use]
    pub fn words(&self) -> String {
        let missed = match self.missed_cycles {
            0 => String::new(),
            missed => format!("; the sensor was silent for {}", counted(missed, "cycle")),
        };
        format!(
            "balance: the base tilted by {:.1} deg at most otherwise than the motion wants, joints answered by {:.1} deg at \
             most{missed}",
            self.peak_tilt_rad.to_degrees(),
            self.peak_correction_rad.to_degrees()
        )
    }
}

/// One joint that answers.
#[derive(Clone, Debug)]
struct Answer {
    joint: usize,
    gains: profiles::BalanceJoint,
    /// Furthest it goes, rad, and how fast.
    limits: JointLimits,
    now: Chase,
}

/// Keeps a robot upright while it moves.
pub struct Balancer {
    body: RobotBody,
    filter: VQF,
    period_s: f64,
    answers: Vec<Answer>,
    /// Where the motion alone wants the joints, when goals were made last; none yet.
    planned_rad: Option<Vec<f64>>,
    /// Up as the motion wants it, in the base's axes, when it was felt last.
    wanted: Option<DVec3>,
    /// How the base is tilted, and turns, otherwise than wanted, about its own axes; the tilt as it lasts.
    tilt_rad: DVec3,
    rate_rad_s: DVec3,
    /// The part of a new tilt that counts in a cycle.
    share: f64,
    silent_cycles: u32,
    fallen_rad: Option<f64>,
    figures: BalanceFigures,
}

/// A motion on a robot that may keep its balance meanwhile.
pub struct Balanced<'a> {
    /// The motion.
    pub motion: &'a mut (dyn Motion + Send),
    /// What is added to it; nothing on a robot that does not feel how it stands.
    pub balancer: Option<&'a mut Balancer>,
}

impl Motion for Balanced<'_> {
    fn advance(&mut self, dt_s: f64, now: Instant, setpoints: &mut [Setpoint]) -> bool {
        let is_over = self.motion.advance(dt_s, now, setpoints);
        let Some(balancer) = &mut self.balancer else { return is_over };
        balancer.answer(dt_s, is_over, setpoints);
        is_over && balancer.is_at_rest()
    }

    fn stop(&mut self) {
        self.motion.stop();
    }

    fn feels(&self) -> bool {
        self.balancer.is_some()
    }

    fn feel(&mut self, felt: Option<&Inertial>) -> Option<StopReason> {
        let balancer = self.balancer.as_mut()?;
        balancer.feel(felt);
        balancer.verdict()
    }

    fn longest_way_back_s(&self) -> f64 {
        self.balancer.as_ref().map_or(0.0, |balancer| balancer.longest_way_back_s())
    }
}

/// The robot with what balance leaves of its joints' limits: motions are laid for it.
///
/// # Errors
/// A robot whose file does not say how it balances.
pub fn leaves(robot: &Robot) -> Result<Robot, Error> {
    let balance = balance_of(robot)?;
    let mut file = robot.file.clone();
    for joint in &mut file.joints {
        if balance.joints.iter().any(|of| of.joint == joint.name) {
            joint.velocity_rad_s *= 1.0 - balance.limit_share;
            joint.acceleration_rad_s2 *= 1.0 - balance.limit_share;
        }
    }
    Robot::new(file)
}

/// The same where nobody knows the motion beforehand: each joint that answers keeps room for its answer at both ends of its
/// range as well. How much that is, by joint, rad; less of a joint that stands, or is to stand at first, nearer to an end.
///
/// # Errors
/// As [`leaves`].
pub fn leaves_room(robot: &Robot, start_rad: &[f64]) -> Result<(Robot, Vec<f64>), Error> {
    let balance = balance_of(robot)?;
    let mut file = leaves(robot)?.file;
    let all = file.joints.iter_mut().zip(&robot.joints).zip(start_rad);
    for ((joint, known), start_rad) in all {
        if !balance.joints.iter().any(|of| of.joint == joint.name) {
            continue;
        }
        let room_rad = [*start_rad, known.initial_rad]
            .map(|at_rad| room_rad(known, at_rad) - ROUNDING_RAD)
            .into_iter()
            .fold(balance.most_rad, f64::min)
            // Who stands outside is told so elsewhere.
            .max(0.0);
        joint.lower_rad += room_rad;
        joint.upper_rad -= room_rad;
    }
    let leaves = Robot::new(file)?;
    let rooms_rad = leaves.joints.iter().zip(&robot.joints).map(|(leaves, whole)| {
        let [lower_rad, upper_rad] = [leaves.limits.lower_rad(), leaves.limits.upper_rad()];
        room_rad(whole, lower_rad).min(room_rad(whole, upper_rad))
    });
    let rooms_rad = rooms_rad.collect();
    Ok((leaves, rooms_rad))
}

/// How far a joint at this angle is from the nearer end of its range, rad.
fn room_rad(joint: &Joint, at_rad: f64) -> f64 {
    (at_rad - joint.limits.lower_rad()).min(joint.limits.upper_rad() - at_rad)
}

fn balance_of(robot: &Robot) -> Result<&profiles::BodyBalance, Error> {
    let missing = |what: &str| {
        Error::of(ErrorKind::Malformed, "the robot's file does not say how it balances")
            .at(format!("robot {}", robot.name))
            .got(format!("no {what}"))
            .allowed("[body.imu] and [body.balance], as in `gaitway profile show op3`")
            .remedy("leave out --balance")
    };
    let body = robot.file.body.as_ref().ok_or_else(|| missing("[body]"))?;
    let balance = body.balance.as_ref().ok_or_else(|| missing("[body.balance]"))?;
    robot.base_sensor.as_ref().map(|_| balance).ok_or_else(|| missing("[body.imu]"))
}

impl Balancer {
    /// For a robot in cycles of `period_s` whose joints have so much room between the motion and the nearer end of their
    /// range, rad.
    ///
    /// # Errors
    /// As [`leaves`].
    pub fn new(
        robot: &Robot,
        period_s: f64,
        room_rad: impl Fn(usize) -> f64,
    ) -> Result<Self, Error> {
        let balance = balance_of(robot)?;
        let body = RobotBody::of(&robot.file)?.ok_or_else(|| {
            Error::new("a robot without a body does not balance")
                .at(format!("robot {}", robot.name))
        })?;
        let mut answers = Vec::with_capacity(balance.joints.len());
        for gains in &balance.joints {
            let Some(joint) = robot.joints.iter().position(|of| of.name == gains.joint) else {
                continue;
            };
            let most_rad = balance.most_rad.min(room_rad(joint));
            let limits = robot.joints[joint].limits;
            // Who has no room does not answer.
            let limits = JointLimits::new(
                -most_rad,
                most_rad,
                balance.limit_share * limits.velocity_rad_s(),
                balance.limit_share * limits.acceleration_rad_s2(),
            );
            if let Ok(limits) = limits {
                answers.push(Answer { joint, gains: gains.clone(), limits, now: Chase::default() });
            }
        }
        Ok(Self {
            body,
            filter: VQF::new(period_s, None, None, None),
            period_s,
            answers,
            planned_rad: None,
            wanted: None,
            tilt_rad: DVec3::ZERO,
            share: 1.0 - (-period_s / balance.tilt_time_s).exp(),
            rate_rad_s: DVec3::ZERO,
            silent_cycles: 0,
            fallen_rad: None,
            figures: BalanceFigures::default(),
        })
    }

    /// Looks whether a robot that stands with its joints at `present_rad` feels so.
    ///
    /// # Errors
    /// A robot that moves, or whose sensor says that it stands otherwise than its legs do.
    pub fn look(&self, felt: &Inertial, present_rad: &[f64]) -> Result<(), Error> {
        let refuse =
            |what: &str| Error::of(ErrorKind::OutsideLimits, what).at("sensor in the base");
        let pull = felt.acceleration_m_s2.length() / STANDARD_GRAVITY_M_S2;
        let turns_rad_s = felt.rate_rad_s.length();
        if (pull - 1.0).abs() > STILL_SHARE || turns_rad_s > STILL_RAD_S {
            return Err(refuse("a robot that balances stands still at first")
                .got(format!("{pull:.2} g, {:.0} deg/s", turns_rad_s.to_degrees()))
                .allowed(format!(
                    "1 g within {STILL_SHARE}, at most {:.0} deg/s",
                    STILL_RAD_S.to_degrees()
                ))
                .remedy("put it on both feet and let go; if it stands still, see the scales of its board"));
        }
        let Some(up) = self.body.up(present_rad) else { return Ok(()) };
        let off_rad = up.angle_between(felt.acceleration_m_s2);
        if off_rad > UPRIGHT_RAD {
            return Err(refuse("the sensor says that the robot stands otherwise than its legs do")
                .got(format!("{:.0} deg between the two", off_rad.to_degrees()))
                .allowed(format!("at most {:.0} deg", UPRIGHT_RAD.to_degrees()))
                .remedy("put it on a level floor on both feet; else see `axes` of [body.imu]"));
        }
        Ok(())
    }

    /// What the base felt in this cycle; nothing if its sensor did not answer.
    pub fn feel(&mut self, felt: Option<&Inertial>) {
        let Some(Inertial { rate_rad_s, acceleration_m_s2 }) = felt else {
            self.silent_cycles += 1;
            self.figures.missed_cycles += 1;
            return;
        };
        self.silent_cycles = 0;
        self.figures.felt_cycles += 1;
        self.filter.update(rate_rad_s.to_array(), acceleration_m_s2.to_array(), None);
        let turned = self.filter.quat_6d();
        let turned = DQuat::from_xyzw(turned.1, turned.2, turned.3, turned.0).normalize();
        let up = turned.inverse() * DVec3::Z;
        let tilted_rad = up.angle_between(DVec3::Z);
        if tilted_rad > FALLEN_RAD {
            self.fallen_rad.get_or_insert(tilted_rad);
        }
        let wanted = self.planned_rad.as_ref().and_then(|planned| self.body.up(planned));
        let Some(wanted) = wanted else { return };
        // What turns the wanted up into the one that is: seen from the base the world turns the other way.
        let tilt_rad = up.cross(wanted);
        self.tilt_rad += (tilt_rad - self.tilt_rad) * self.share;
        let before = self.wanted.replace(wanted).unwrap_or(wanted);
        let wanted_rate = wanted.cross(before) / self.period_s;
        self.rate_rad_s = *rate_rad_s - wanted_rate;
        self.figures.peak_tilt_rad = self.figures.peak_tilt_rad.max(up.angle_between(wanted));
    }

    /// Why the motion must end, if it must.
    #[must_use]
    pub fn verdict(&self) -> Option<StopReason> {
        if let Some(tilt_rad) = self.fallen_rad {
            return Some(StopReason::Fell { tilt_rad });
        }
        let cycles = self.silent_cycles;
        (cycles >= BLIND_CYCLES).then_some(StopReason::FeelsNothing { cycles })
    }

    /// Adds to where the motion wants the joints what keeps the robot upright, `dt_s` after the last goals; nothing more than
    /// the way back once the motion is over, or nobody feels anything.
    pub fn answer(&mut self, dt_s: f64, is_over: bool, setpoints: &mut [Setpoint]) {
        let planned = setpoints.iter().map(|setpoint| setpoint.position_rad);
        let kept = self.planned_rad.get_or_insert_default();
        kept.clear();
        kept.extend(planned);
        let asks = !is_over && self.verdict().is_none() && self.wanted.is_some();
        for answer in &mut self.answers {
            let profiles::BalanceJoint { roll, roll_s, pitch, pitch_s, .. } = answer.gains;
            let wanted_rad = roll * self.tilt_rad.x
                + roll_s * self.rate_rad_s.x
                + pitch * self.tilt_rad.y
                + pitch_s * self.rate_rad_s.y;
            let wanted_rad = if asks { wanted_rad } else { 0.0 };
            let (lower, upper) = (answer.limits.lower_rad(), answer.limits.upper_rad());
            let target =
                Chase { position_rad: wanted_rad.clamp(lower, upper), velocity_rad_s: 0.0 };
            answer.now = answer.now.toward(target, dt_s, &answer.limits);
            if let Some(setpoint) = setpoints.get_mut(answer.joint) {
                setpoint.position_rad += answer.now.position_rad;
                setpoint.velocity_rad_s += answer.now.velocity_rad_s;
            }
            let moved_rad = answer.now.position_rad.abs();
            self.figures.peak_correction_rad = self.figures.peak_correction_rad.max(moved_rad);
        }
    }

    /// True if no joint is anywhere else than the motion wants it.
    #[must_use]
    pub fn is_at_rest(&self) -> bool {
        self.answers.iter().all(|answer| {
            answer.now.position_rad.abs() < REST && answer.now.velocity_rad_s.abs() < REST
        })
    }

    /// The longest that the way back takes, s.
    #[must_use]
    pub fn longest_way_back_s(&self) -> f64 {
        let way_back_s = |answer: &Answer| {
            let (most_rad, limits) = (answer.limits.upper_rad(), &answer.limits);
            let (speed, gain) = (limits.velocity_rad_s(), limits.acceleration_rad_s2());
            // A brake first, then from end to end: with a cruise, and full acceleration before and after it.
            2.0 * most_rad / speed + 2.0 * speed / gain
        };
        self.answers.iter().map(way_back_s).fold(0.0, f64::max)
    }

    /// What it came to.
    #[must_use]
    pub fn figures(&self) -> &BalanceFigures {
        &self.figures
    }
}

#[cfg(test)]
mod tests;
