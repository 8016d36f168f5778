//! Trials of a set that shipped actions are: what the vocabulary has a word for, as variations of the action; several in
//! turn, two at once, and what two people do together.

use crate::action::at_once::{at_once, moves};
use crate::action::corpus::{Corpus, VariationStatus, Variations, Varied};
use crate::action::database::Database;
use crate::action::motion::resting_until;
use crate::action::mutate::Spread;
use crate::action::{Fits, Join, Motion, phrase, vocabulary};
use crate::body::Dof;
use crate::corpus::sets::{PlannedSet, PlannedTrial};
use crate::error::Error;
use glam::DVec3;
use std::collections::BTreeMap;
use std::f64::consts::PI;

/// How much taller or shorter those are who do the same.
const STATURES: f64 = 0.1;

/// What shipped actions make of a trial.
#[derive(Clone, Debug)]
enum Done {
    /// An action, or several in turn, each from rest to rest.
    InTurn(Vec<String>),
    /// Legs of the first, and above them what the second moves.
    AtOnce([String; 2]),
    /// One of two people who do something together.
    ByTwo(&'static Together, usize),
}

/// Where somebody stands at first, m, and which way they face, rad to the left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stand {
    /// The point of the floor below the centre of mass.
    pub at_m: DVec3,
    /// Which way.
    pub faces_rad: f64,
}

/// Where nobody else is.
const ALONE: Stand = Stand { at_m: DVec3::ZERO, faces_rad: 0.0 };

/// What two people do by one clock: the action of a set, what each does, and where the second stands; the first stands where
/// one does alone.
#[derive(Debug)]
struct Together {
    action: &'static str,
    each: [&'static str; 2],
    second: Stand,
    /// Which variation the first does, the second the next: one that nobody does alone, so that no two trials are the same.
    variation: u32,
}

const TOGETHER: [Together; 5] = [
    together("follow", "walk", behind(1.2), 1000),
    together("pass-by", "walk", opposite(3.0, 0.9), 1002),
    together("mirror", "swing-arms-transverse", opposite(2.0, 0.0), 1004),
    together("wave-to-one-another", "wave-r", opposite(2.0, 0.0), 1006),
    together("bow-to-one-another", "bow", opposite(2.0, 0.0), 1008),
];

/// Both do the same, each in their own way.
const fn together(
    action: &'static str,
    does: &'static str,
    second: Stand,
    variation: u32,
) -> Together {
    Together { action, each: [does, does], second, variation }
}

/// So far ahead and to the left, face to face, m.
const fn opposite(ahead_m: f64, left_m: f64) -> Stand {
    Stand { at_m: DVec3::new(ahead_m, left_m, 0.0), faces_rad: PI }
}

const fn behind(away_m: f64) -> Stand {
    Stand { at_m: DVec3::new(-away_m, 0.0, 0.0), faces_rad: 0.0 }
}

/// A trial, and what it is made of.
#[derive(Clone, Debug)]
pub struct ShippedTrial {
    /// As the set has it; of several people, each with a name of their own.
    pub planned: PlannedTrial,
    done: Done,
    /// Which of its variations.
    pub variation: u32,
}

/// What a set asks for and a shipped action does, in its order; and what none does.
#[must_use]
pub fn trials(set: PlannedSet) -> (Vec<ShippedTrial>, Vec<String>) {
    let (mut found, mut left_out) = (Vec::new(), Vec::new());
    for planned in set.trials() {
        let each = done(planned.action);
        if each.is_empty() {
            left_out.push(planned.name);
            continue;
        }
        let count = planned.people * each.len() as u32;
        for (variation, done) in (0..count).zip(each.iter().cycle()) {
            let (mut planned, done) = (planned.clone(), done.clone());
            if count > 1 {
                planned.name = format!("{}-{:02}", planned.name, variation + 1);
            }
            found.push(ShippedTrial { planned, done, variation });
        }
    }
    (found, left_out)
}

/// What shipped actions make of an action of a set: of each who does it; nothing if they do not. An action is itself, or with
/// the right side.
fn done(action: &str) -> Vec<Done> {
    if let Some(both) = TOGETHER.iter().find(|of| of.action == action) {
        return vec![Done::ByTwo(both, 0), Done::ByTwo(both, 1)];
    }
    let shipped = |name: &str| {
        let sided = format!("{name}-r");
        [name.to_owned(), sided].into_iter().find(|name| vocabulary::text(name).is_some())
    };
    let at_once = action.split_once('+').map(|(one, other)| {
        shipped(one).zip(shipped(other)).map(|(one, other)| Done::AtOnce([one, other]))
    });
    let in_turn = || {
        let parts: Option<Vec<String>> = action.split('>').map(shipped).collect();
        parts.map(Done::InTurn)
    };
    at_once.unwrap_or_else(in_turn).into_iter().collect()
}

/// What came of a trial.
pub struct ShippedMotion {
    /// What is done, and by whom.
    pub varied: Varied,
    /// Where whoever does it stands at first.
    pub stand: Stand,
    /// From when to when each of the actions that it is made of is done, s, in the order of its name.
    pub parts_s: Vec<(f64, f64)>,
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

    /// Does what is asked.
    ///
    /// # Errors
    /// As [`Variations::variation`]; actions that cannot be joined.
    pub fn make(&mut self, of: &ShippedTrial, seed: u64) -> Result<ShippedMotion, Error> {
        match &of.done {
            Done::InTurn(each) => {
                let mut whole: Option<ShippedMotion> = None;
                for phrase in each {
                    let next = self.varied(of, phrase, of.variation, seed)?;
                    let length_s = next.motion.duration_s();
                    whole = Some(match whole {
                        None => ShippedMotion {
                            varied: next,
                            stand: ALONE,
                            parts_s: vec![(0.0, length_s)],
                        },
                        Some(before) => before.followed_by(next, length_s)?,
                    });
                }
                whole.ok_or_else(|| Error::new("a trial is made of nothing").at(&of.planned.name))
            }
            Done::AtOnce([one, other]) => {
                let mut varied = self.varied(of, one, of.variation, seed)?;
                let above = self.varied(of, other, of.variation, seed)?.motion;
                let ends_s = [varied.motion.duration_s(), above.duration_s()];
                let is_others = |dof: Dof| moves(&above, dof);
                varied.motion = at_once((&varied.motion, 0.0), (&above, 0.0), is_others)?;
                let parts_s = ends_s.map(|end_s| (0.0, end_s)).to_vec();
                Ok(ShippedMotion { varied, stand: ALONE, parts_s })
            }
            Done::ByTwo(both, who) => {
                let mut each = Vec::with_capacity(both.each.len());
                for (variation, phrase) in (both.variation..).zip(both.each) {
                    each.push(self.varied(of, phrase, variation, seed)?);
                }
                // By one clock: who is done waits for the other.
                let until_s = each.iter().map(|of| of.motion.duration_s()).fold(0.0, f64::max);
                let stand = if *who == 0 { ALONE } else { both.second };
                let mut own = each.swap_remove(*who);
                let flights_s = own.motion.flights_s().to_vec();
                let tracks = own.motion.into_tracks().into_iter();
                let tracks = tracks.map(|track| resting_until(track, until_s));
                let motion = Motion::new(tracks.collect::<Result<_, _>>()?)?;
                own.motion = motion.in_flight(flights_s)?.facing(stand.faces_rad);
                Ok(ShippedMotion { varied: own, stand, parts_s: vec![(0.0, until_s)] })
            }
        }
    }

    fn varied(
        &mut self,
        of: &ShippedTrial,
        phrase: &str,
        variation: u32,
        seed: u64,
    ) -> Result<Varied, Error> {
        if !self.seen.contains_key(phrase) {
            let variations = variations(of, phrase, seed, self.rate_hz)?;
            self.seen.insert(phrase.to_owned(), variations);
        }
        self.seen[phrase].variation(variation)
    }
}

impl ShippedMotion {
    /// And then another action, which lasts so long.
    fn followed_by(mut self, next: Varied, length_s: f64) -> Result<Self, Error> {
        let Varied { motion, status, rejected, .. } = next;
        self.varied.motion = self.varied.motion.followed_by(motion, Join::default())?;
        // As bad as the worst of them.
        if status == VariationStatus::Implausible {
            self.varied.status = status;
        }
        self.varied.rejected += rejected;
        let end_s = self.varied.motion.duration_s();
        self.parts_s.push((end_s - length_s, end_s));
        Ok(self)
    }
}

fn variations(
    of: &ShippedTrial,
    phrase: &str,
    seed: u64,
    rate_hz: f64,
) -> Result<Variations, Error> {
    let mut fits = Fits::usual()?;
    let mut parts = phrase::load(phrase)?;
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
