//! One joint by hand: zero, direction, range.

use super::person::{Answer, JointTask, Person, Seen};
use super::reading::{Measured, Scale, reading};
use crate::calibration::Unwrapped;
use crate::control::inject;
use crate::error::Error;
use crate::robot::{Joint, Link};

/// Motions stay this far from where the hand found an end.
pub const MARGIN_RAD: f64 = 0.02;
/// A direction, or a range, is one from here on.
const LEAST_RAD: f64 = 0.0873;
/// The range is said again when it has grown by this.
const SAID_RAD: f64 = 0.0873;

/// A joint in somebody's hand.
struct Hand<'a> {
    link: &'a mut Link,
    joint: usize,
    of: Joint,
    scale: Scale,
    person: &'a mut dyn Person,
    at: Unwrapped,
}

/// Measures `joint`, asking for each step.
///
/// # Errors
/// A joint that does not answer, or that moved too fast to be followed.
pub fn measure(
    link: &mut Link,
    joint: usize,
    person: &mut dyn Person,
) -> Result<Answer<Measured>, Error> {
    inject::point("hand", 0);
    let of = link.robot().joints[joint].clone();
    let scale = Scale::of(&of)?;
    let gear = link.robot().file.joint(&of.name).map_or(1.0, |joint| joint.gear);
    let at = Unwrapped::from(reading(link, joint)?, scale.turn_counts());
    let mut hand = Hand { link, joint, of, scale, person, at };
    hand.zero()?.then(|zero| {
        let zero_servo_rad = scale.angle_rad(zero);
        hand.person.tell(Seen::ZeroAt(zero_servo_rad));
        hand.direction(zero)?.then(|direction| {
            hand.person.tell(Seen::TurnsWithServo(direction > 0));
            let sign = f64::from(direction) * gear;
            hand.range(zero, sign)?.then(|range_rad| {
                let (offset_rad, counts) = (sign * zero_servo_rad, hand.at.range());
                let measured =
                    Measured { zero, zero_servo_rad, direction, offset_rad, range_rad, counts };
                Ok(Answer::Go(measured))
            })
        })
    })
}

impl Hand<'_> {
    /// Asks, and follows the joint meanwhile.
    fn follow(
        &mut self,
        task: JointTask<'_>,
        mut seen: impl FnMut(&mut Unwrapped, i64) -> Option<Seen>,
    ) -> Result<Answer<()>, Error> {
        let Self { link, joint, person, at, .. } = self;
        person.ask(task, &mut || Ok(seen(at, reading(link, *joint)?)))
    }

    /// The reading where the person says that zero is.
    fn zero(&mut self) -> Result<Answer<i64>, Error> {
        let counts = self.scale.turn_counts();
        let name = self.of.name.clone();
        let task = JointTask::Zero { joint: &name, id: self.of.id };
        let answer = self.follow(task, |at, raw| {
            *at = Unwrapped::from(raw, counts);
            None
        })?;
        answer.then(|()| Ok(Answer::Go(self.at.now())))
    }

    /// +1 if the servo counts up where the person says that positive is.
    fn direction(&mut self, zero: i64) -> Result<Answer<i8>, Error> {
        loop {
            let answer = self.follow(JointTask::Positive, |at, raw| {
                at.follow(raw);
                None
            })?;
            match answer {
                Answer::Go(()) => {}
                Answer::Skip => return Ok(Answer::Skip),
                Answer::Stop => return Ok(Answer::Stop),
            }
            let turned_rad = (self.at.now() - zero) as f64 * self.scale.rad_per_count();
            if turned_rad.abs() >= LEAST_RAD {
                return Ok(Answer::Go(if turned_rad > 0.0 { 1 } else { -1 }));
            }
            self.person.tell(Seen::TooLittle(turned_rad));
        }
    }

    /// The joint angles that are reached, drawn in; none if it was hardly moved. `sign` is the
    /// joint's turn for one of its servo.
    fn range(&mut self, zero: i64, sign: f64) -> Result<Answer<Option<(f64, f64)>>, Error> {
        let rad_per_count = self.scale.rad_per_count();
        let angles = |(low, high): (i64, i64)| {
            let ends = [low, high].map(|at| sign * (at - zero) as f64 * rad_per_count);
            (ends[0].min(ends[1]), ends[0].max(ends[1]))
        };
        let (mut said_rad, mut said_at) = (0.0, None);
        let answer = self.follow(JointTask::Range, |at, raw| {
            at.follow(raw);
            let (lower_rad, upper_rad) = angles(at.range());
            let (now_rad, _) = angles((at.now(), at.now()));
            let has_grown = upper_rad - lower_rad >= said_rad + SAID_RAD;
            if has_grown {
                said_rad = upper_rad - lower_rad;
            }
            let has_moved = said_at.replace(at.now()) != Some(at.now());
            has_moved.then_some(Seen::Range { lower_rad, upper_rad, now_rad, has_grown })
        })?;
        answer.then(|()| {
            if self.at.doubtful() {
                return Err(Error::new("the joint was moved too fast to be followed")
                    .at(format!("joint {}", self.of.name))
                    .remedy("go on with --resume, and move it more slowly"));
            }
            let (lower, upper) = angles(self.at.range());
            let moved = upper - lower > 2.0 * LEAST_RAD;
            Ok(Answer::Go(moved.then_some((lower + MARGIN_RAD, upper - MARGIN_RAD))))
        })
    }
}
