//! Whoever is led through a calibration: what they are told, and what they answer.

use crate::body::Segment;
use crate::body::worn::Movement;
use crate::error::Error;
use crate::time::Duration;

/// Something that is said to whoever is led.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub enum Cue<'a> {
    /// Sensors are heard that nobody wears, and not used.
    Unused(&'a [&'a str]),
    /// What the calibration made of it.
    Note(&'a str),
    /// A sensor seems to be on another segment than was said.
    Doubt(&'a str),
    /// The calibration that was kept is older than it holds.
    Old {
        /// Its age.
        hours: u64,
        /// Age up to which it holds.
        held_hours: u64,
    },
    /// That did not do, and is asked for once more.
    Again(&'a Error),
    /// Stand in N pose.
    NPose,
    /// It begins after this time.
    In(Duration),
    /// Hold still for this time.
    HoldStill(Duration),
    /// That did.
    Good,
    /// Somebody moved where stillness was wanted, rad; NaN if the sensor said nothing.
    Moved {
        /// The segment.
        segment: Segment,
        /// How far.
        rad: f64,
    },
    /// Stand in T pose.
    TPose,
    /// How far a segment is from where it belongs in T pose, rad.
    OffTPose {
        /// The segment.
        segment: Segment,
        /// How far.
        rad: f64,
    },
    /// Move like this, and come back.
    Move(Movement),
    /// This is asked for after what is asked for now; a pose or a movement.
    Next(&'a Cue<'a>),
    /// What is waited for does not come because of these segments: how far each is from N pose, rad.
    Waiting {
        /// What is waited for.
        until: Until,
        /// Segments in the way.
        segments: &'a [(Segment, f64)],
    },
    /// What was asked for was not seen, and is left out.
    Unseen(Unseen),
    /// A question that [`Person::answer`] answers.
    Ask(Question),
    /// An answer that is none, to the question before.
    Unknown(&'a str),
}

/// What is waited for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Until {
    /// Arms in the air.
    Up,
    /// Every segment where it was in N pose.
    Back,
    /// A movement that was asked for.
    Begun,
}

/// What was not seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unseen {
    /// T pose: the arms' headings are not checked.
    TPose,
    /// A movement.
    Movement,
}

/// What is asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Question {
    /// Do you stand in N pose?
    Stands,
    /// T pose once more, or go on with what was seen?
    TPoseAgain,
}

/// What somebody answers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Answer {
    /// Go on.
    GoOn,
    /// Leave out what is waited for.
    Skip,
    /// Something else.
    Other(String),
}

/// Whoever is led. Nothing of it may wait.
pub trait Person: Sync {
    /// Hears something.
    fn tell(&self, cue: Cue<'_>);

    /// What was answered since this was asked last, if anything.
    fn answer(&self) -> Option<Answer>;

    /// True if there is somebody who can answer; without, everything goes by time.
    fn can_answer(&self) -> bool;

    /// True once it is to end.
    fn wants_to_stop(&self) -> bool;

    /// True once after they asked that headings be found anew; they stand in N pose.
    fn wants_a_reset(&self) -> bool {
        false
    }

    /// True once after they agreed that what rests, because its sensors were lost, is followed again.
    fn agrees(&self) -> bool {
        false
    }
}
