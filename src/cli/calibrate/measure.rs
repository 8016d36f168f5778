//! One joint by hand: zero, direction, range.

use super::answers::{Answer, Answers};
use crate::bus::AskError;
use crate::calibration::Unwrapped;
use crate::cli::say;
use crate::control::inject;
use crate::device::Model;
use crate::error::Error;
use crate::robot::preflight::{budget, exchange_error};
use crate::robot::{Joint, Link, LinkError};
use gaitway_profiles::{Register, Role};

/// A position is asked for this often again before the servo counts as silent.
const ATTEMPTS: u32 = 5;

/// What was measured of a joint.
#[derive(Clone, Copy, Debug)]
pub struct Measured {
    /// Reading at the joint's zero, raw.
    pub zero: i64,
    /// The same as the servo's angle, rad.
    pub zero_servo_rad: f64,
    /// +1 if the joint turns with its servo, -1 if against it.
    pub direction: i8,
    /// Offset that makes the joint's angle zero there, rad.
    pub offset_rad: f64,
    /// Joint angles that were reached, drawn in by [`MARGIN_RAD`]; none if it was not moved.
    pub range_rad: Option<(f64, f64)>,
    /// Lowest and highest reading, counted on through the turns.
    pub counts: (i64, i64),
}

/// Motions stay this far from where the hand found an end.
const MARGIN_RAD: f64 = 0.02;
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
    answers: &'a mut Answers,
    at: Unwrapped,
}

/// Measures `joint`, asking for each step.
///
/// # Errors
/// A joint that does not answer, or that moved too fast to be followed.
pub fn measure(
    link: &mut Link,
    joint: usize,
    answers: &mut Answers,
) -> Result<Answer<Measured>, Error> {
    inject::point("hand", 0);
    let of = link.robot().joints[joint].clone();
    let scale = Scale::of(&of)?;
    let gear = link.robot().file.joint(&of.name).map_or(1.0, |joint| joint.gear);
    let at = Unwrapped::from(reading(link, joint)?, scale.turn_counts());
    let mut hand = Hand { link, joint, of, scale, answers, at };
    hand.zero()?.then(|zero| {
        let zero_servo_rad = scale.angle_rad(zero);
        say(&format!("  zero where the servo stands at {:.1} deg", zero_servo_rad.to_degrees()));
        hand.direction(zero)?.then(|direction| {
            let turns = if direction > 0 { "with" } else { "against" };
            say(&format!("  it turns {turns} its servo"));
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
        question: &str,
        mut seen: impl FnMut(&mut Unwrapped, i64),
    ) -> Result<Answer<()>, Error> {
        let Self { link, joint, answers, at, .. } = self;
        answers.ask(question, || {
            seen(at, reading(link, *joint)?);
            Ok(())
        })
    }

    /// The reading where the person says that zero is.
    fn zero(&mut self) -> Result<Answer<i64>, Error> {
        let turn = self.scale.turn_counts();
        let question = format!(
            "{} (ID {}): hold it at its zero, then Enter (s skips it, q stops)",
            self.of.name, self.of.id
        );
        let answer = self.follow(&question, |at, raw| *at = Unwrapped::from(raw, turn))?;
        answer.then(|()| Ok(Answer::Go(self.at.now())))
    }

    /// +1 if the servo counts up where the person says that positive is.
    fn direction(&mut self, zero: i64) -> Result<Answer<i8>, Error> {
        loop {
            let question = "  turn it in its positive direction and hold it there, then Enter";
            match self.follow(question, Unwrapped::follow)? {
                Answer::Go(()) => {}
                Answer::Skip => return Ok(Answer::Skip),
                Answer::Stop => return Ok(Answer::Stop),
            }
            let turned_rad = (self.at.now() - zero) as f64 * self.scale.rad_per_count();
            if turned_rad.abs() >= LEAST_RAD {
                return Ok(Answer::Go(if turned_rad > 0.0 { 1 } else { -1 }));
            }
            say(&format!("  that was only {:.1} deg: further, please", turned_rad.to_degrees()));
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
        let mut said_rad = 0.0;
        let question = "  move it slowly through its whole range, both ends, then Enter";
        let answer = self.follow(question, |at, raw| {
            at.follow(raw);
            let (lower, upper) = angles(at.range());
            if upper - lower >= said_rad + SAID_RAD {
                said_rad = upper - lower;
                say(&format!("  {:.1} to {:.1} deg", lower.to_degrees(), upper.to_degrees()));
            }
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

/// What the counts of a joint's drive mean.
#[derive(Clone, Copy)]
enum Scale {
    /// A servo's, by its table.
    Servo(Model, &'static Register),
    /// A CAN actuator tells angles; counts are steps of [`ACTUATOR_STEP_RAD`] from its zero, up to
    /// this many.
    Actuator(i64),
}

/// Finer than any actuator tells, rad.
const ACTUATOR_STEP_RAD: f64 = 1e-5;
/// Where its dialect sets no end, an actuator counts on for so many turns.
const ACTUATOR_RANGE_RAD: f64 = 100.0 * std::f64::consts::TAU;

impl Scale {
    fn of(of: &Joint) -> Result<Self, Error> {
        if let Some(actuator) = of.actuator() {
            let ranges = actuator.profile().ranges.as_ref();
            let end_rad = ranges.map_or(ACTUATOR_RANGE_RAD, |ranges| ranges.position_rad);
            return Ok(Self::Actuator(steps(end_rad)));
        }
        let model = of.model()?;
        let position = model.register(Role::PresentPosition);
        Ok(Self::Servo(model, position.map_err(|e| Error::new(e.to_string()))?))
    }

    fn angle_rad(self, counts: i64) -> f64 {
        match self {
            Self::Servo(model, register) => model.si_from_raw(register, counts),
            Self::Actuator(_) => counts as f64 * ACTUATOR_STEP_RAD,
        }
    }

    fn rad_per_count(self) -> f64 {
        match self {
            Self::Servo(model, _) => model.rad_per_count(),
            Self::Actuator(_) => ACTUATOR_STEP_RAD,
        }
    }

    /// Counts after which the reading begins anew.
    fn turn_counts(self) -> i64 {
        match self {
            Self::Servo(model, _) => {
                let position = &model.profile().position;
                // A servo with less than a turn has nothing to begin anew; its scale still says a
                // full one.
                i64::from(position.counts) * 360 / i64::from(position.degrees).max(1)
            }
            Self::Actuator(end) => 2 * end,
        }
    }

    /// The first and the last count before that.
    fn ends(self) -> (i64, i64) {
        match self {
            Self::Servo(..) => (0, self.turn_counts() - 1),
            Self::Actuator(end) => (-end, end - 1),
        }
    }
}

fn steps(angle_rad: f64) -> i64 {
    (angle_rad / ACTUATOR_STEP_RAD).round() as i64
}

/// The present position of a joint, in the counts of its [`Scale`]. A host that stalls is no silent
/// servo.
///
/// # Errors
/// A joint that does not answer.
pub fn reading(link: &mut Link, joint: usize) -> Result<i64, Error> {
    if link.robot().joints[joint].actuator().is_some() {
        return actuator_reading(link, joint);
    }
    let mut attempts_left = ATTEMPTS;
    loop {
        let limit = budget(link);
        match link.read_raw(joint, Role::PresentPosition, limit) {
            Ok(raw) => return Ok(raw),
            Err(LinkError { error: AskError::Miss(_), .. }) if attempts_left > 0 => {
                attempts_left -= 1;
            }
            Err(error) => return Err(exchange_error(link, Some(joint), &error)),
        }
    }
}

/// What an actuator tells with its state.
fn actuator_reading(link: &mut Link, joint: usize) -> Result<i64, Error> {
    for _ in 0..=ATTEMPTS {
        let limit = budget(link);
        let states = link.whole_states(limit).map_err(|e| exchange_error(link, None, &e))?;
        if let Some(Ok((state, _))) = states.into_iter().nth(joint) {
            return Ok(steps(link.robot().joints[joint].servo_rad(state.position_rad)));
        }
    }
    let of = &link.robot().joints[joint];
    Err(Error::new("the joint does not answer").at(format!("joint {}, ID {}", of.name, of.id)))
}

impl Measured {
    /// Refuses a range that goals cannot lead through, because the servo's counts begin anew in
    /// it, after the servo's reading was shifted by `shift`.
    ///
    /// # Errors
    /// Such a range.
    pub fn refuse_crossing(&self, link: &Link, joint: usize, shift: i64) -> Result<(), Error> {
        let of = &link.robot().joints[joint];
        let (low, high) = (self.counts.0 + shift, self.counts.1 + shift);
        let (first, last) = Scale::of(of)?.ends();
        if low >= first && high <= last {
            return Ok(());
        }
        Err(Error::new("the servo's counts begin anew inside the joint's range")
            .at(format!("joint {}, ID {}", of.name, of.id))
            .got(format!("counts {low} to {high}"))
            .allowed(format!("inside {first} to {last}"))
            .remedy(
                "add --permit-eeprom so that the servo's own offset is set, or mount the horn so \
                 that the middle of the range is the middle of the servo's",
            ))
    }
}
