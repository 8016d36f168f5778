//! Trials of a set that shipped actions are: what the vocabulary has a word for, as variations of the action.

use crate::action::corpus::{Corpus, Variations, Varied};
use crate::action::database::Database;
use crate::action::mutate::Spread;
use crate::action::{Fits, Join, phrase, vocabulary};
use crate::corpus::sets::{PlannedSet, PlannedTrial};
use crate::error::Error;
use std::collections::BTreeMap;

/// How much taller or shorter those are who do the same.
const STATURES: f64 = 0.1;

/// A trial, and the action that it is a variation of.
#[derive(Clone, Debug)]
pub struct ShippedTrial {
    /// As the set has it; of several people, each with a name of their own.
    pub planned: PlannedTrial,
    /// As [`phrase`] has it.
    pub phrase: String,
    /// Which of its variations.
    pub variation: u32,
}

/// What a set asks for and a shipped action does, in its order; and what none does.
#[must_use]
pub fn trials(set: PlannedSet) -> (Vec<ShippedTrial>, Vec<String>) {
    let (mut found, mut left_out) = (Vec::new(), Vec::new());
    for planned in set.trials() {
        let Some(phrase) = phrase_of(planned.action) else {
            left_out.push(planned.name);
            continue;
        };
        for variation in 0..planned.people {
            let mut planned = planned.clone();
            if planned.people > 1 {
                planned.name = format!("{}-{:02}", planned.name, variation + 1);
            }
            found.push(ShippedTrial { planned, phrase: phrase.clone(), variation });
        }
    }
    (found, left_out)
}

/// The shipped actions that are an action of a set: itself or with the right side, and one after the other. Nobody does two
/// at once.
fn phrase_of(action: &str) -> Option<String> {
    let shipped = |name: &str| {
        let sided = format!("{name}-r");
        [name.to_owned(), sided].into_iter().find(|name| vocabulary::text(name).is_some())
    };
    let parts: Option<Vec<String>> = action.split('>').map(shipped).collect();
    Some(parts?.join(","))
}

/// Actions and their variations, each looked at once.
pub struct Shipped {
    rate_hz: f64,
    seen: BTreeMap<String, Variations>,
}

impl Shipped {
    /// At so many frames a second.
    #[must_use]
    pub const fn at(rate_hz: f64) -> Self {
        Self { rate_hz, seen: BTreeMap::new() }
    }

    /// A variation.
    ///
    /// # Errors
    /// As [`Variations::variation`].
    pub fn make(&mut self, of: &ShippedTrial, seed: u64) -> Result<Varied, Error> {
        if !self.seen.contains_key(&of.phrase) {
            let variations = variations(of, seed, self.rate_hz)?;
            self.seen.insert(of.phrase.clone(), variations);
        }
        self.seen[&of.phrase].variation(of.variation)
    }
}

fn variations(of: &ShippedTrial, seed: u64, rate_hz: f64) -> Result<Variations, Error> {
    let mut fits = Fits::usual()?;
    let mut parts = phrase::load(&of.phrase)?;
    for part in &mut parts {
        part.action = fits.fit(&part.action)?;
    }
    let stature = if of.planned.people > 1 { STATURES } else { 0.0 };
    Variations::of(Corpus {
        label: of.planned.action.to_owned(),
        parts,
        join: Join::default(),
        spread: Spread { stature, ..Spread::default() },
        database: Database::shipped()?,
        seed,
        rate_hz,
        body: *fits.body(),
        has_points: false,
    })
}
