//! What a joint in somebody's hand reads, and what was measured of it.

use crate::bus::AskError;
use crate::device::Model;
use crate::error::{Error, ErrorKind};
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
    /// Joint angles that were reached, drawn in by a margin; none if it was not moved.
    pub range_rad: Option<(f64, f64)>,
    /// Lowest and highest reading, counted on through the turns.
    pub counts: (i64, i64),
}

/// What the counts of a joint's drive mean.
#[derive(Clone, Copy, Debug)]
pub enum Scale {
    /// A servo's, by its table.
    Servo(Model, &'static Register),
    /// A CAN actuator tells angles; counts are steps of `ACTUATOR_STEP_RAD` from its zero, up to
    /// this many.
    Actuator(i64),
}

/// Finer than any actuator tells, rad.
const ACTUATOR_STEP_RAD: f64 = 1e-5;
/// Where its dialect sets no end, an actuator counts on for so many turns.
const ACTUATOR_RANGE_RAD: f64 = 100.0 * std::f64::consts::TAU;

impl Scale {
    /// Of this joint.
    ///
    /// # Errors
    /// A servo without position.
    pub fn of(of: &Joint) -> Result<Self, Error> {
        if let Some(actuator) = of.actuator() {
            let ranges = actuator.profile().ranges.as_ref();
            let end_rad = ranges.map_or(ACTUATOR_RANGE_RAD, |ranges| ranges.position_rad);
            return Ok(Self::Actuator(steps(end_rad)));
        }
        let model = of.model()?;
        let position = model.register(Role::PresentPosition);
        Ok(Self::Servo(model, position.map_err(|e| Error::new(e.to_string()))?))
    }

    /// The angle of so many counts, rad.
    #[must_use]
    pub fn angle_rad(self, counts: i64) -> f64 {
        match self {
            Self::Servo(model, register) => model.si_from_raw(register, counts),
            Self::Actuator(_) => counts as f64 * ACTUATOR_STEP_RAD,
        }
    }

    /// One count, rad.
    #[must_use]
    pub fn rad_per_count(self) -> f64 {
        match self {
            Self::Servo(model, _) => model.rad_per_count(),
            Self::Actuator(_) => ACTUATOR_STEP_RAD,
        }
    }

    /// Counts after which the reading begins anew.
    #[must_use]
    pub fn turn_counts(self) -> i64 {
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
            Self::Servo(model, _) => {
                let lowest = i64::from(model.profile().position.lowest_count);
                (lowest, lowest + self.turn_counts() - 1)
            }
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
    Err(Error::of(ErrorKind::Silent, "the joint does not answer")
        .at(format!("joint {}, ID {}", of.name, of.id)))
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
        Err(Error::new("the servo's counts wrap around inside the joint's range")
            .at(format!("joint {}, ID {}", of.name, of.id))
            .got(format!("counts {low} to {high}"))
            .allowed(format!("inside {first} to {last}"))
            .remedy(
                "add --permit-eeprom so that the servo's own offset is set, or mount the horn so \
                 that the middle of the range is the middle of the servo's",
            ))
    }
}
