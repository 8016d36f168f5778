//! Whoever leads a session: what is asked, and what may be answered.

use super::happening::Happening;
use crate::body::Segment;
use crate::body::anthropometry::Measure;
use crate::error::Error;
use crate::sensing::{Ended, Person};
use crate::session::Verdict;
use crate::time::Duration;
use std::str::FromStr;

/// What an operator may want instead of answering.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Instead {
    /// The session ends here, to go on later.
    Stop,
    /// The question before is asked once more: of words and measures, which are asked one after the other. Anywhere else
    /// there is none, and the session ends.
    Back,
}

impl From<Instead> for Ended {
    fn from(instead: Instead) -> Self {
        match instead {
            Instead::Stop => Self::Stopped,
            Instead::Back => Self::Failed(Error::new("there is no question before this one")),
        }
    }
}

/// An answer, or what is wanted instead of one.
pub type Answered<T> = Result<T, Instead>;

/// What the operator sees to, and says once it is so.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Ready<'a> {
    /// All sensors lie still, and nobody touches what they lie on.
    LyingStill {
        /// Names of the sensors.
        sensors: &'a [String],
    },
    /// A subject wears the sensors.
    Worn {
        /// Id of the subject.
        subject: &'a str,
        /// Where they are worn.
        segments: &'a [Segment],
    },
    /// The calibration of a subject did not work, and can be done once more.
    Again {
        /// Why.
        error: &'a Error,
    },
    /// The action was explained and shown.
    Explained,
    /// It was practised; nothing of that is recorded.
    Practised,
    /// Nobody can know who is in a trial that was cut off, or nothing is in it: it is done once more.
    Retake {
        /// Name of the trial.
        trial: &'a str,
    },
}

/// Words that are asked for. An empty answer leaves out what is not needed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Words<'a> {
    /// Name of the session.
    SessionName {
        /// Its name if the answer is empty.
        usual: &'a str,
    },
    /// Who leads it.
    Leader,
    /// Where it is.
    Place,
    /// Anything else about it.
    Remarks,
    /// What is done in an action that the vocabulary does not have; empty: its name was mistyped.
    Explanation {
        /// Its name.
        action: &'a str,
    },
    /// Id of the subject, needed: 1 to 32 small letters, digits and `-`.
    FirstSubject,
    /// Id of the second subject, needed: another one.
    SecondSubject,
    /// Gender, in the subject's words.
    Gender,
    /// Actions that are not possible for a subject, injuries.
    SubjectRemarks,
    /// Why sensors are used that did not pass, needed.
    WhyAccepted,
    /// What happened in a trial.
    Notes,
    /// What was wrong with a trial that is to be done once more.
    WhatWasWrong,
    /// What was held or used.
    Props {
        /// What was if the answer is empty: what the plan says; empty: nothing.
        usual: &'a str,
    },
    /// What is to be changed, of all that was answered; empty: nothing.
    Changed {
        /// What there is: `session`, and the ids of those who are recorded.
        choices: &'a [&'a str],
    },
}

impl Words<'_> {
    /// True of a question that is one of several: from it there is a way back to the one before.
    #[must_use]
    pub const fn is_of_several(&self) -> bool {
        matches!(
            self,
            Self::SessionName { .. }
                | Self::Leader
                | Self::Place
                | Self::Remarks
                | Self::Explanation { .. }
                | Self::FirstSubject
                | Self::SecondSubject
                | Self::Gender
                | Self::SubjectRemarks
        )
    }
}

/// What is said of a measure that may be left out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MeasureAnswer {
    /// It is so much, in [`Measure::unit`].
    Is(f64),
    /// It was not measured, or is as it was answered before.
    NotMeasured,
    /// It was answered before, and is not measured.
    TakenAway,
    /// Neither it nor any after it that may be left out.
    NothingMore,
}

/// A measure that is plausible alone, and doubtful beside the others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Doubt<'a> {
    /// Which.
    pub measure: Measure,
    /// What was answered, in [`Measure::unit`].
    pub value: f64,
    /// What makes it doubtful, in words.
    pub why: &'a str,
}

/// What becomes of sensors of which one did not pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unsteady {
    /// They are measured once more.
    Repeat,
    /// They are used all the same.
    Accept,
}

/// What is done about a subject whose headings could not be found before a trial.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mend {
    /// N pose once more.
    Again,
    /// The subject is calibrated anew first.
    Calibrate,
}

/// What is kept, or done once more.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Judged<'a> {
    /// A calibration of a subject.
    Calibration {
        /// What a person should know of it.
        notes: &'a [String],
    },
    /// A trial; what is in it was told.
    Trial {
        /// Its name.
        trial: &'a str,
    },
}

/// What the operator wants next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wish {
    /// The trial is recorded.
    Record,
    /// First the device calibration once more.
    Devices,
    /// First the calibration of the subjects once more.
    Subjects,
    /// The action is given up: what is there of it is all there will be.
    GiveUp,
    /// First something that was answered is changed.
    Edit,
}

/// What is marked in a trial.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Mark {
    /// A good repetition is done.
    Good,
    /// A bad one.
    Bad,
    /// Something else, in words.
    Note(String),
}

/// What is said while a trial is recorded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum During {
    /// Nothing so far.
    Nothing,
    /// This moment is marked.
    Mark(Mark),
    /// The trial ends here.
    End,
}

/// Good repetitions in a trial.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Repetitions(u32);

impl Repetitions {
    /// Most of them.
    pub const MOST: u32 = 10_000;

    /// How many.
    #[must_use]
    pub const fn count(self) -> u32 {
        self.0
    }

    fn refused(got: &str) -> Error {
        let allowed = format!("0 to {}", Self::MOST);
        Error::new("not a number of repetitions").got(got).allowed(allowed)
    }
}

impl TryFrom<usize> for Repetitions {
    type Error = Error;

    fn try_from(count: usize) -> Result<Self, Error> {
        let fits = u32::try_from(count).ok().filter(|count| *count <= Self::MOST);
        fits.map(Self).ok_or_else(|| Self::refused(&count.to_string()))
    }
}

impl FromStr for Repetitions {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let count: usize = text.parse().map_err(|_| Self::refused(text))?;
        count.try_into()
    }
}

/// Leads a session: a person at a terminal, or a program. A question waits for its answer. Every one
/// may be answered by [`Instead::Stop`]: the session ends there, and can be gone on with.
pub trait Operator: Sync {
    /// Whoever is led through poses, and may want at any time that the session ends here.
    fn person(&self) -> &dyn Person;

    /// Hears what happens. What happens to sensors comes from their threads.
    fn hear(&self, happening: Happening<'_>);

    /// True if it is to be told all the time how sensors are heard and what they say.
    fn looks(&self) -> bool {
        false
    }

    /// Sees to something, and answers once it is so.
    ///
    /// # Errors
    /// A stop.
    fn ready(&self, what: Ready<'_>) -> Answered<()>;

    /// Says something in words. Words that cannot be used are asked for once more.
    ///
    /// # Errors
    /// A stop.
    fn words(&self, what: Words<'_>) -> Answered<String>;

    /// Says which actions are recorded, by their names in the vocabulary. Of others it is asked what is done in them
    /// ([`Words::Explanation`]).
    ///
    /// # Errors
    /// A stop.
    fn actions(&self) -> Answered<Vec<String>>;

    /// Says a measure that a session cannot do without, in its unit. One that no person has is asked
    /// for once more.
    ///
    /// # Errors
    /// A stop.
    fn needed_measure(&self, measure: Measure) -> Answered<f64>;

    /// Says any other measure, or that it is left out. One that no person has is asked for once more.
    ///
    /// # Errors
    /// A stop.
    fn measure(&self, measure: Measure) -> Answered<MeasureAnswer>;

    /// True if a doubtful measure is right all the same; else it is asked for once more.
    ///
    /// # Errors
    /// A stop.
    fn is_right(&self, doubt: Doubt<'_>) -> Answered<bool>;

    /// Says what becomes of sensors of which one did not pass.
    ///
    /// # Errors
    /// A stop.
    fn unsteady(&self) -> Answered<Unsteady>;

    /// Says what is done about a subject whose headings could not be found for this reason.
    ///
    /// # Errors
    /// A stop.
    fn mend(&self, error: &Error) -> Answered<Mend>;

    /// Says what is kept; `usual` is what its faults speak for.
    ///
    /// # Errors
    /// A stop.
    fn judge(&self, what: Judged<'_>, usual: Verdict) -> Answered<Verdict>;

    /// Says what comes next: this trial, or something else first.
    ///
    /// # Errors
    /// A stop.
    fn wish(&self, trial: &str) -> Answered<Wish>;

    /// What is said while a trial is recorded: waits no longer than this time.
    ///
    /// # Errors
    /// A stop.
    fn during_trial(&self, within: Duration) -> Answered<During>;

    /// Says how many repetitions in a trial that is kept are good; so many were marked.
    ///
    /// # Errors
    /// A stop.
    fn repetitions(&self, marked: usize) -> Answered<Repetitions>;
}

/// What came of a question of several.
pub(super) enum Asked {
    /// It was answered.
    Answered,
    /// It was not to be asked.
    Left,
}

/// A question of several, which keeps its answer itself.
pub(super) type Ask<'a, S> = Box<dyn Fn(&mut S) -> Answered<Asked> + 'a>;

/// Asks one after the other, and goes back to the one before as often as that is wanted.
pub(super) fn ask_all<S>(answers: &mut S, questions: &[Ask<'_, S>]) -> Answered<()> {
    let (mut at, mut goes_back) = (0_usize, false);
    while let Some(ask) = questions.get(at) {
        match ask(answers) {
            Ok(Asked::Left) if goes_back && at > 0 => at -= 1,
            Ok(_) => (at, goes_back) = (at + 1, false),
            Err(Instead::Back) => (at, goes_back) = (at.saturating_sub(1), true),
            Err(Instead::Stop) => return Err(Instead::Stop),
        }
    }
    Ok(())
}

/// Asks until the answer is one that can be used; what is wrong with the others is told.
pub(super) fn ask_until<T, U>(
    operator: &dyn Operator,
    ask: impl Fn() -> Answered<T>,
    read: impl Fn(T) -> Result<U, Error>,
) -> Answered<U> {
    loop {
        match read(ask()?) {
            Ok(answer) => return Ok(answer),
            Err(error) => operator.hear(Happening::Refused(&error)),
        }
    }
}
