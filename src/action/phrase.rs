//! Several actions in a row, as typed: `walk:6s,wave-r,bow`, and without a stop `walk:6s+run:5s`.

use crate::action::change::{GaitChange, without_a_stop};
use crate::action::fit::made_for;
use crate::action::{Action, Join, Motion, file, vocabulary};
use crate::body::Proportions;
use crate::error::Error;
use std::path::Path;

/// Most actions in a row.
pub const MAX_ITEMS: usize = 1000;
/// Slowest and fastest pace of an action.
pub const PACES: core::ops::RangeInclusive<f64> = 0.1..=10.0;

/// How long an action of a phrase lasts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Length {
    /// As its file says.
    Given,
    /// So many seconds; a cyclic action in the nearest number of whole rounds.
    Seconds(f64),
    /// So many rounds.
    Rounds(u32),
}

/// How an action follows the one before.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Follows {
    /// After everything has come to rest: a comma.
    #[default]
    AtRest,
    /// Out of the motion, without a stop: a plus sign.
    InMotion,
}

/// An action of a phrase.
#[derive(Clone, Debug, PartialEq)]
pub struct Item {
    /// A shipped action or the path of an action file.
    pub name: String,
    /// How long.
    pub length: Length,
    /// How fast; 2 is twice as fast as its file says.
    pub pace: f64,
    /// How it follows the one before; of the first it says nothing.
    pub follows: Follows,
}

/// Whether a motion as typed means actions: a shipped name, an action file, or several in a row.
#[must_use]
pub fn is_phrase(text: &str) -> bool {
    let means_action = |item: &str| {
        let name = item.split([':', '@']).next().unwrap_or(item);
        vocabulary::text(name).is_some() || is_file(name) || is_file(item)
    };
    // A capture may be called walk+run.bvh.
    let marks: &[char] = if Path::new(text).exists() { &[','] } else { &[',', '+'] };
    is_file(text) || text.split(marks).any(means_action)
}

/// The actions as they are called, without how long they last: `walk,wave-r`.
#[must_use]
pub fn class(parts: &[Part]) -> String {
    let mut class = String::new();
    for part in parts {
        if !class.is_empty() {
            class.push(if part.item.follows == Follows::AtRest { ',' } else { '+' });
        }
        class += &part.action.name;
    }
    class
}

fn is_file(name: &str) -> bool {
    Path::new(name).extension().is_some_and(|e| e.eq_ignore_ascii_case("toml"))
}

/// Reads `NAME[:6s|:x3][@PACE]`, with commas between several, or plus signs where one gait goes over
/// into another without a stop.
///
/// # Errors
/// If an item is not written so.
pub fn parse(text: &str) -> Result<Vec<Item>, Error> {
    // A path may contain any of the marks.
    if is_file(text) && Path::new(text).exists() {
        let name = text.to_owned();
        let follows = Follows::AtRest;
        return Ok(vec![Item { name, length: Length::Given, pace: 1.0, follows }]);
    }
    if text.split([',', '+']).count() > MAX_ITEMS {
        return Err(Error::new("too many actions in a row").allowed(MAX_ITEMS.to_string()));
    }
    let mut items = Vec::new();
    for row in text.split(',').map(str::trim) {
        if let Ok(whole) = item(row, Follows::AtRest)
            && is_file(&whole.name)
            && Path::new(&whole.name).exists()
        {
            items.push(whole);
            continue;
        }
        for (index, gait) in row.split('+').enumerate() {
            let follows = if index == 0 { Follows::AtRest } else { Follows::InMotion };
            items.push(item(gait.trim(), follows)?);
        }
    }
    Ok(items)
}

fn item(text: &str, follows: Follows) -> Result<Item, Error> {
    let wrong = |what: &str, got: &str| {
        let (at, got) = if text.is_empty() { ("the motion", "nothing") } else { (text, got) };
        Error::new(what).at(at).got(got).allowed("NAME, NAME:6s, NAME:x3, NAME@0.5 or NAME:x3@0.5")
    };
    let (rest, pace) = match text.rsplit_once('@') {
        None => (text, 1.0),
        Some((rest, pace)) => match pace.parse::<f64>() {
            Ok(value) if PACES.contains(&value) => (rest, value),
            _ => return Err(wrong("a pace is a number from 0.1 to 10", pace)),
        },
    };
    let (name, length) = match rest.rsplit_once(':') {
        None => (rest, Length::Given),
        Some((name, length)) => (
            name,
            self::length(length).ok_or_else(|| {
                wrong("a length is seconds (more than 0, at most 86400) or rounds", length)
            })?,
        ),
    };
    if name.is_empty() {
        return Err(wrong("an action is missing", rest));
    }
    Ok(Item { name: name.to_owned(), length, pace, follows })
}

fn length(text: &str) -> Option<Length> {
    if let Some(rounds) = text.strip_prefix('x') {
        return rounds.parse().ok().filter(|rounds| *rounds > 0).map(Length::Rounds);
    }
    let seconds: f64 = text.strip_suffix('s')?.parse().ok()?;
    (seconds > 0.0 && seconds <= file::MAX_DURATION_S).then_some(Length::Seconds(seconds))
}

impl Item {
    /// The action's definition.
    ///
    /// # Errors
    /// If there is no such action or its file is wrong.
    pub fn action(&self) -> Result<Action, Error> {
        if is_file(&self.name) {
            return vocabulary::read(Path::new(&self.name));
        }
        vocabulary::find(&self.name).map_err(|mut e| {
            e.what = "not an action".to_owned();
            let shipped = e.allowed.unwrap_or_default();
            e.allowed = Some(format!("a .toml file, or a shipped action: {shipped}").into());
            e
        })
    }

    /// The action at its pace, and how many rounds of it.
    #[must_use]
    pub fn timed(&self, action: &Action) -> (Action, u32) {
        let mut action = action.clone();
        action.duration_s /= self.pace;
        let rounds = match self.length {
            Length::Given => action.rounds,
            Length::Rounds(rounds) => rounds,
            Length::Seconds(seconds) if action.cyclic.is_some() => action.rounds_in(seconds),
            Length::Seconds(seconds) => {
                action.duration_s = seconds;
                1
            }
        };
        (action, rounds)
    }

    /// The action as long and as fast as asked for.
    ///
    /// # Errors
    /// If it cannot be performed.
    pub fn perform(&self, action: &Action) -> Result<Motion, Error> {
        let (action, rounds) = self.timed(action);
        action.perform_rounds(rounds)
    }
}

/// An item and its definition.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// How long and how fast.
    pub item: Item,
    /// What.
    pub action: Action,
}

/// Reads a phrase and the actions it names.
///
/// # Errors
/// As [`parse`], or if an item is no action.
pub fn load(text: &str) -> Result<Vec<Part>, Error> {
    let items = parse(text)?.into_iter();
    items.map(|item| Ok(Part { action: item.action()?, item })).collect()
}

/// A phrase as one motion, and how it went over from one gait into another.
#[derive(Clone, Debug, PartialEq)]
pub struct Performed {
    /// The motion.
    pub motion: Motion,
    /// Changes of gait without a stop, in order of time.
    pub changes: Vec<GaitChange>,
}

/// The whole phrase as one motion: everything that moves comes to rest between its actions, but for
/// gaits that go over into one another.
///
/// # Errors
/// If an action cannot be performed or joined with the one before, or there is none.
pub fn perform(parts: &[Part], join: Join) -> Result<Motion, Error> {
    Ok(performed(parts, join)?.motion)
}

/// As [`perform`], with how it went over from one gait into another.
///
/// # Errors
/// As [`perform`].
pub fn performed(parts: &[Part], join: Join) -> Result<Performed, Error> {
    performed_by(parts, join, &made_for()?)
}

/// As [`performed`], of actions that are fitted to this body: what moves the legs goes over so that its feet hold.
///
/// # Errors
/// As [`perform`].
pub fn performed_by(parts: &[Part], join: Join, body: &Proportions) -> Result<Performed, Error> {
    let mut whole: Option<Performed> = None;
    for row in parts.chunk_by(|_, next| next.item.follows == Follows::InMotion) {
        let (next, crossed) = match row {
            [part] => (part.item.perform(&part.action)?, Vec::new()),
            gaits => {
                let timed = gaits.iter().map(|part| part.item.timed(&part.action));
                without_a_stop(&timed.collect::<Vec<_>>(), body)?
            }
        };
        let length_s = next.duration_s();
        let (motion, mut changes) = match whole {
            None => (next, Vec::new()),
            Some(before) => (before.motion.followed_by(next, join)?, before.changes),
        };
        let begin_s = motion.duration_s() - length_s;
        changes.extend(crossed.into_iter().map(|change| change.later(begin_s)));
        whole = Some(Performed { motion, changes });
    }
    whole.ok_or_else(|| Error::new("no action was named"))
}
