//! Whose trials are judged, and of whose trials what is judged is made: a fifth of the people, and the others, as 10 and
//! 40 of the 50 who did the cross-validation set of the Human Motion Database.

use crate::corpus::rows::TrialEntry;
use crate::error::{Error, ErrorKind, counted};
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeSet;

/// One of so many people is judged.
const ONE_OF: usize = 5;

/// Who is judged.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) enum Split {
    /// Everybody, each trial by all others.
    #[default]
    Everybody,
    /// Some people, by what the others did.
    People {
        /// Those who are judged.
        judged: BTreeSet<String>,
        /// How many others there are.
        others: usize,
    },
}

impl Split {
    /// A fifth of those who did these trials, at least one.
    ///
    /// # Errors
    /// Fewer than two people.
    pub(super) fn drawn(trials: &[TrialEntry], seed: u64) -> Result<Self, Error> {
        let people: BTreeSet<&str> = trials.iter().filter_map(|of| of.subject.as_deref()).collect();
        if people.len() < 2 {
            return Err(Error::of(
                ErrorKind::Absent,
                "there are not enough people to judge some by the others",
            )
            .at("--by-subject")
            .got(format!(
                "{} in the trials that answer the question",
                counted(people.len(), "person")
            ))
            .allowed("2 or more")
            .remedy("without it, each trial is judged by all others"));
        }
        let mut people: Vec<&str> = people.into_iter().collect();
        people.shuffle(&mut ChaCha8Rng::seed_from_u64(seed));
        let count = people.len().div_ceil(ONE_OF);
        let judged = people[..count].iter().map(|who| (*who).to_owned()).collect();
        Ok(Self::People { judged, others: people.len() - count })
    }

    /// Whether a trial is judged.
    pub(super) fn judges(&self, trial: &TrialEntry) -> bool {
        match self {
            Self::Everybody => true,
            Self::People { judged, .. } => {
                trial.subject.as_ref().is_some_and(|who| judged.contains(who))
            }
        }
    }

    /// Whether others may be made of a trial.
    pub(super) fn lends(&self, trial: &TrialEntry) -> bool {
        *self == Self::Everybody || !self.judges(trial)
    }

    /// How many are judged, and how many others there are.
    pub(super) fn people(&self) -> Option<[usize; 2]> {
        match self {
            Self::Everybody => None,
            Self::People { judged, others } => Some([judged.len(), *others]),
        }
    }
}
