//! One joint by hand: zero, direction, range.

use super::answers::{Answer, Answers};
use crate::calibration::Unwrapped;
use crate::error::Error;
use crate::robot::Link;
use crate::robot::preflight::{budget, exchange_error};
use gaitway_profiles::Role;

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

/// Measures `joint`, asking for each step.
///
/// # Errors
/// A joint that does not answer, or that moved too fast to be followed.
pub fn measure(
    link: &mut Link,
    joint: usize,
    answers: &mut Answers,
) -> Result<Answer<Measured>, Error> {
    let of = link.robot().joints[joint].clone();
    let model = of.model;
    let turn = turn_counts(&of);
    let rad = |counts: i64| counts as f64 * model.rad_per_count();
    let register = model.register(Role::PresentPosition).map_err(|e| Error::new(e.to_string()))?;
    let gear = link.robot().file.joint(&of.name).map_or(1.0, |joint| joint.gear);

    let mut at = Unwrapped::from(reading(link, joint)?, turn);
    let question = format!(
        "{} (ID {}): hold it at its zero, then Enter (s skips it, q stops)",
        of.name, of.id
    );
    match answers.ask(&question, || Ok(at = Unwrapped::from(reading(link, joint)?, turn)))? {
        Answer::Go(()) => {}
        Answer::Skip => return Ok(Answer::Skip),
        Answer::Stop => return Ok(Answer::Stop),
    }
    let zero = at.range().0;
    let zero_servo_rad = model.si_from_raw(register, zero);
    eprintln!("  zero where the servo stands at {:.1} deg", zero_servo_rad.to_degrees());

    let direction = loop {
        let question = "  turn it in its positive direction and hold it there, then Enter";
        let follow = || Ok(at.follow(reading(link, joint)?));
        match answers.ask(question, follow)? {
            Answer::Go(()) => {}
            Answer::Skip => return Ok(Answer::Skip),
            Answer::Stop => return Ok(Answer::Stop),
        }
        let turned_rad = rad(at.now() - zero);
        if turned_rad.abs() >= LEAST_RAD {
            break if turned_rad > 0.0 { 1 } else { -1 };
        }
        eprintln!("  that was only {:.1} deg: further, please", turned_rad.to_degrees());
    };
    let sign = f64::from(direction) * gear;
    eprintln!("  it turns {} its servo", if direction > 0 { "with" } else { "against" });

    let angles = |(low, high): (i64, i64)| {
        let ends = [sign * rad(low - zero), sign * rad(high - zero)];
        (ends[0].min(ends[1]), ends[0].max(ends[1]))
    };
    let mut said = 0.0;
    let question = "  move it slowly through its whole range, both ends, then Enter";
    let answer = answers.ask(question, || {
        at.follow(reading(link, joint)?);
        let (lower, upper) = angles(at.range());
        if upper - lower >= said + SAID_RAD {
            said = upper - lower;
            eprintln!("  {:.1} to {:.1} deg", lower.to_degrees(), upper.to_degrees());
        }
        Ok(())
    })?;
    match answer {
        Answer::Go(()) => {}
        Answer::Skip => return Ok(Answer::Skip),
        Answer::Stop => return Ok(Answer::Stop),
    }
    if at.doubtful() {
        return Err(Error::new("the joint was moved too fast to be followed")
            .at(format!("joint {}", of.name))
            .remedy("go on with --resume, and move it more slowly"));
    }
    let (lower, upper) = angles(at.range());
    let moved = upper - lower > 2.0 * LEAST_RAD;
    let range_rad = moved.then_some((lower + MARGIN_RAD, upper - MARGIN_RAD));
    Ok(Answer::Go(Measured {
        zero,
        zero_servo_rad,
        direction,
        offset_rad: sign * zero_servo_rad,
        range_rad,
        counts: at.range(),
    }))
}

/// Counts after which the encoder's reading begins anew.
fn turn_counts(joint: &crate::robot::Joint) -> i64 {
    let position = &joint.model.profile().position;
    // A servo with less than a turn has nothing to begin anew; its scale still says a full one.
    i64::from(position.counts) * 360 / i64::from(position.degrees).max(1)
}

/// The present position of a joint, raw.
pub fn reading(link: &mut Link, joint: usize) -> Result<i64, Error> {
    let limit = budget(link);
    let raw = link.read_raw(joint, Role::PresentPosition, limit);
    raw.map_err(|e| exchange_error(link, Some(joint), &e))
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
        let turn = turn_counts(of);
        if low >= 0 && high < turn {
            return Ok(());
        }
        Err(Error::new("the servo's counts begin anew inside the joint's range")
            .at(format!("joint {}, ID {}", of.name, of.id))
            .got(format!("counts {low} to {high}"))
            .allowed(format!("inside 0 to {}", turn - 1))
            .remedy(
                "add --permit-eeprom so that the servo's own offset is set, or mount the horn so \
                 that the middle of the range is the middle of the servo's",
            ))
    }
}
