//! What a session is to record.

use crate::action::vocabulary;
use crate::error::{Error, ErrorKind};
use crate::toml_text::{from_toml, plain_words};
use serde::{Deserialize, Serialize};

/// Good repetitions of an action that make a set.
pub const REPETITIONS: u32 = 10;
/// Most actions of a session.
const MOST_ACTIONS: usize = 500;

/// A session's plan, as its TOML file says it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Plan {
    /// Good repetitions wanted of every action that says nothing else.
    pub repetitions: u32,
    /// How long sensors lie still in the device calibration, s.
    pub still_s: f64,
    /// How long a device calibration is trusted, h.
    pub device_hours: f64,
    /// How long a subject's calibration is trusted, h.
    pub body_hours: f64,
    /// Poses per second of exported joint angles.
    pub rate_hz: f64,
    /// The actions, in the order in which they are done.
    #[serde(rename = "action")]
    pub actions: Vec<PlannedAction>,
}

impl Default for Plan {
    fn default() -> Self {
        Self {
            repetitions: REPETITIONS,
            still_s: 5.0,
            device_hours: 24.0,
            body_hours: 4.0,
            rate_hz: 100.0,
            actions: Vec::new(),
        }
    }
}

/// An action to be recorded.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlannedAction {
    /// Its name: of an action that ships with gaitway, or of one explained here.
    pub name: String,
    /// What the subject is told.
    #[serde(default)]
    pub explain: String,
    /// Good repetitions wanted.
    #[serde(default)]
    pub repetitions: Option<u32>,
    /// What is held or used.
    #[serde(default)]
    pub props: String,
    /// The motion that a figure shows while it is explained and practised: actions, or a file; empty: the action itself, if it ships
    /// with gaitway.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub demonstration: String,
    /// True if two subjects do it together.
    #[serde(default)]
    pub together: bool,
}

impl Plan {
    /// Reads a plan.
    ///
    /// # Errors
    /// What is not a plan, and says where.
    pub fn parse(text: &str, file: &str) -> Result<Self, Error> {
        let plan: Self = from_toml(text).map_err(|e| {
            let line = e.span().map_or(1, |span| 1 + text[..span.start].matches('\n').count());
            Error::of(ErrorKind::Malformed, "not a session plan")
                .at(format!("{file}, line {line}"))
                .got(plain_words(e.message()).replace('\n', "; "))
        })?;
        plan.checked().map_err(|e| {
            let place = e.place.as_ref().map_or_else(String::new, |place| format!(", {place}"));
            e.at(format!("{file}{place}"))
        })
    }

    /// The plan of actions that ship with gaitway.
    ///
    /// # Errors
    /// No action, or one that is not known.
    pub fn of_names(names: &[&str]) -> Result<Self, Error> {
        let actions = names
            .iter()
            .map(|name| PlannedAction { name: (*name).to_owned(), ..PlannedAction::default() });
        Self::of_actions(actions.collect())
    }

    /// The plan of these actions; those that do not ship with gaitway are explained.
    ///
    /// # Errors
    /// No action, or one that is neither known nor explained.
    pub fn of_actions(actions: Vec<PlannedAction>) -> Result<Self, Error> {
        Self { actions, ..Self::default() }.checked()
    }

    /// Fills in what shipped actions say of themselves, and refuses what is no plan.
    pub(crate) fn checked(mut self) -> Result<Self, Error> {
        let number = |what: &str, value: f64, range: std::ops::RangeInclusive<f64>| {
            if range.contains(&value) {
                return Ok(());
            }
            Err(Error::new("a number of the plan is out of range")
                .at(what.to_owned())
                .got(value.to_string())
                .allowed(format!("{} to {}", range.start(), range.end())))
        };
        number("still_s", self.still_s, 1.0..=600.0)?;
        number("device_hours", self.device_hours, 0.1..=1000.0)?;
        number("body_hours", self.body_hours, 0.1..=100.0)?;
        number("rate_hz", self.rate_hz, 10.0..=1000.0)?;
        if self.actions.is_empty() || self.actions.len() > MOST_ACTIONS {
            return Err(Error::new("a plan must name the actions to record")
                .got(format!("{} of them", self.actions.len()))
                .allowed(format!("1 to {MOST_ACTIONS}")));
        }
        number("repetitions", f64::from(self.repetitions), 1.0..=1000.0)?;
        for at in 0..self.actions.len() {
            let (before, rest) = self.actions.split_at_mut(at);
            let action = &mut rest[0];
            action.complete()?;
            number("repetitions", f64::from(action.repetitions.unwrap_or(1)), 1.0..=1000.0)?;
            if before.iter().any(|other| other.name == action.name) {
                return Err(Error::new("an action is in the plan twice").got(action.name.clone()));
            }
        }
        Ok(self)
    }

    /// Good repetitions wanted of an action.
    #[must_use]
    pub fn wanted(&self, action: &PlannedAction) -> u32 {
        action.repetitions.unwrap_or(self.repetitions)
    }
}

impl PlannedAction {
    /// Whether an action can be called so.
    #[must_use]
    pub fn is_name(name: &str) -> bool {
        let fits = |b: u8| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'-';
        (1..=64).contains(&name.len()) && name.bytes().all(fits) && !name.starts_with('-')
    }

    /// The motion that shows how it is done, if there is one.
    #[must_use]
    pub fn shown_by(&self) -> Option<&str> {
        let is_shipped = || vocabulary::find(&self.name).is_ok();
        match self.demonstration.as_str() {
            "" => is_shipped().then_some(self.name.as_str()),
            motion => Some(motion),
        }
    }

    fn complete(&mut self) -> Result<(), Error> {
        let name = self.name.as_str();
        if !Self::is_name(name) {
            return Err(Error::new("not a name of an action")
                .got(name)
                .allowed("1 to 64 of a-z, 0-9 and -"));
        }
        if !self.explain.is_empty() {
            return Ok(());
        }
        self.explain = vocabulary::find(name)
            .map_err(|_| {
                Error::of(ErrorKind::Unknown, "the vocabulary has no such action").none_of(
                    name,
                    vocabulary::names(),
                    "choose one of these, or say in a plan file what it is: explain = \"...\"",
                )
            })?
            .note;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shipped_actions_explain_themselves_and_others_must_be_explained() {
        let plan = Plan::parse("[[action]]\nname = \"bow\"\nrepetitions = 12", "p.toml").unwrap();
        assert_eq!((plan.wanted(&plan.actions[0]), plan.repetitions), (12, 10));
        assert!(!plan.actions[0].explain.is_empty());
        let own = "[[action]]\nname = \"lift-box\"\nexplain = \"Lift it.\"\nprops = \"a box\"";
        assert_eq!(Plan::parse(own, "p.toml").unwrap().actions[0].props, "a box");
        let error = Plan::of_names(&["lift-box"]).unwrap_err();
        assert!(error.allowed.unwrap().contains("wave-r"));
    }

    #[test]
    fn what_is_no_plan_is_refused_and_says_where() {
        for (text, said) in [
            ("", "must name the actions"),
            ("repetitions = 10\n\nwhat = 1", "line 3"),
            ("still_s = nan\n[[action]]\nname = \"bow\"", "still_s"),
            ("[[action]]\nname = \"bow\"\n[[action]]\nname = \"bow\"", "twice"),
            ("[[action]]\nname = \"../bow\"", "not a name"),
            ("[[action]]\nname = \"bow\"\nrepetitions = 0", "repetitions"),
        ] {
            let error = Plan::parse(text, "plan.toml").unwrap_err().to_string();
            assert!(error.contains(said) && error.contains("plan.toml"), "{text}: {error}");
        }
    }
}
