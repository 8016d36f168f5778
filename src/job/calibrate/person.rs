//! Whoever turns the joints by hand: is told what to do, and says when it is done.

use crate::error::Error;

/// What to do with a joint, or with a robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answer<T> {
    /// It was done.
    Go(T),
    /// Leave the joint as it is.
    Skip,
    /// End here; what was measured so far is kept.
    Stop,
}

impl<T> Answer<T> {
    /// Goes on with what was measured; a joint that is skipped, or a stop, stays that.
    ///
    /// # Errors
    /// What `next` fails with.
    pub fn then<U>(
        self,
        next: impl FnOnce(T) -> Result<Answer<U>, Error>,
    ) -> Result<Answer<U>, Error> {
        match self {
            Self::Go(value) => next(value),
            Self::Skip => Ok(Answer::Skip),
            Self::Stop => Ok(Answer::Stop),
        }
    }
}

/// What was said to a question of yes or no.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Consent {
    /// Yes.
    Yes,
    /// Anything else, or nobody is there.
    No,
    /// A wish to stop came instead.
    Stop,
}

/// What is to be done with a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JointTask<'a> {
    /// Hold it at its zero.
    Zero {
        /// Its name.
        joint: &'a str,
        /// Its ID.
        id: u8,
    },
    /// Turn it in its positive direction and hold it there.
    Positive,
    /// Move it slowly through its whole range.
    Range,
}

/// What was seen meanwhile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Seen {
    /// The next joint's turn.
    Joint {
        /// Which, from 1.
        number: usize,
        /// Of how many.
        total: usize,
    },
    /// Where the servo stands at the joint's zero, rad.
    ZeroAt(f64),
    /// Which way the joint turns: true with its servo.
    TurnsWithServo(bool),
    /// It was turned too little for a direction, rad.
    TooLittle(f64),
    /// How far it goes so far, rad: said whenever it has moved.
    Range {
        /// Lowest.
        lower_rad: f64,
        /// Highest.
        upper_rad: f64,
        /// Where it is.
        now_rad: f64,
        /// The range has grown by five degrees since that was so last.
        has_grown: bool,
    },
}

/// Somebody at the robot.
pub trait Person {
    /// Asks for a turn, and calls `look` again and again until it is done: what was seen is told.
    ///
    /// # Errors
    /// What `look` fails with.
    fn ask(
        &mut self,
        task: JointTask<'_>,
        look: &mut dyn FnMut() -> Result<Option<Seen>, Error>,
    ) -> Result<Answer<()>, Error>;

    /// Tells what was seen.
    fn tell(&mut self, seen: Seen);

    /// May the robot go limp, and fall unless something holds it?
    fn consent(&mut self, robot: &str) -> Consent;

    /// True once it is to end.
    fn wants_to_stop(&self) -> bool;
}
