//! Takes the keys of one table one by one, and remembers which there could have been.

use super::ScriptError;
use gaitway_profiles::counted;
use toml::{Table, Value};

/// Latest time in a script, s: a thousand days.
const LATEST_S: f64 = 86_400_000.0;
const TIMES: &str = "seconds from 0 to 86400000";
/// Longest name of a joint or a line, and most numbers in a list: each number becomes a fault that
/// holds the name.
const NAME_BYTES: usize = 100;
const MOST_NUMBERS: usize = 1000;

/// `line 7`, of the byte at `offset`.
pub(crate) fn line_of(text: &str, offset: usize) -> String {
    let before = text.bytes().take(offset);
    format!("line {}", 1 + before.filter(|&byte| byte == b'\n').count())
}

/// A value as a person wrote it, or what kind of value it is.
fn said(value: &Value) -> String {
    match value {
        Value::String(text) => format!("{text:?}"),
        Value::Integer(number) => number.to_string(),
        Value::Float(number) => number.to_string(),
        Value::Boolean(truth) => truth.to_string(),
        other => format!("a TOML {}", other.type_str()),
    }
}

pub(crate) struct Keys {
    place: String,
    table: Table,
    known: Vec<&'static str>,
    /// What a moment is that is not given, ns; in a script it must be.
    now_ns: Option<u64>,
}

impl Keys {
    pub fn new(place: String, table: Table) -> Keys {
        Keys { place, table, known: Vec::new(), now_ns: None }
    }

    /// The same, where what has no time begins now.
    pub fn at(self, now_ns: u64) -> Keys {
        Keys { now_ns: Some(now_ns), ..self }
    }

    /// A moment.
    pub fn moment(&mut self, key: &'static str) -> Result<u64, ScriptError> {
        let time = self.time(key)?;
        time.or(self.now_ns).ok_or_else(|| self.missing(key, TIMES))
    }

    pub fn truth(&mut self, key: &'static str) -> Result<Option<bool>, ScriptError> {
        match self.take(key) {
            None => Ok(None),
            Some(Value::Boolean(truth)) => Ok(Some(truth)),
            Some(other) => Err(self.wrong(key, &said(&other), "true or false")),
        }
    }

    /// Whether a key is there, whatever it holds.
    pub fn has(&self, key: &str) -> bool {
        self.table.contains_key(key)
    }

    fn take(&mut self, key: &'static str) -> Option<Value> {
        if !self.known.contains(&key) {
            self.known.push(key);
        }
        self.table.remove(key)
    }

    pub fn wrong(&self, key: &str, got: &str, allowed: &str) -> ScriptError {
        let at = format!("{}, key {key}", self.place);
        ScriptError { at, got: got.to_string(), allowed: allowed.to_string() }
    }

    pub fn missing(&self, key: &str, allowed: &str) -> ScriptError {
        self.wrong(key, "nothing", allowed)
    }

    pub fn text(&mut self, key: &'static str) -> Result<Option<String>, ScriptError> {
        match self.take(key) {
            None => Ok(None),
            Some(Value::String(text)) if !text.is_empty() => Ok(Some(text)),
            Some(other) => Err(self.wrong(key, &said(&other), "a text in quotes")),
        }
    }

    /// The name of a joint or a line.
    pub fn name(&mut self, key: &'static str) -> Result<Option<String>, ScriptError> {
        match self.text(key)? {
            Some(name) if name.len() > NAME_BYTES => {
                let got = counted(name.len(), "byte");
                Err(self.wrong(key, &got, &format!("a name of at most {NAME_BYTES} bytes")))
            }
            name => Ok(name),
        }
    }

    pub fn need_name(&mut self, key: &'static str) -> Result<String, ScriptError> {
        self.name(key)?.ok_or_else(|| self.missing(key, "a text in quotes"))
    }

    pub fn need_text(&mut self, key: &'static str) -> Result<String, ScriptError> {
        self.text(key)?.ok_or_else(|| self.missing(key, "a text in quotes"))
    }

    /// One of these words.
    pub fn choice<T, const N: usize>(
        &mut self,
        key: &'static str,
        words: [(&str, T); N],
    ) -> Result<Option<T>, ScriptError> {
        let Some(word) = self.text(key)? else { return Ok(None) };
        let allowed = words.iter().map(|(word, _)| *word).collect::<Vec<_>>().join(", ");
        let found = words.into_iter().find(|(known, _)| *known == word);
        match found {
            Some((_, meaning)) => Ok(Some(meaning)),
            None => Err(self.wrong(key, &format!("{word:?}"), &allowed)),
        }
    }

    pub fn integer(
        &mut self,
        key: &'static str,
        min: i64,
        max: i64,
    ) -> Result<Option<i64>, ScriptError> {
        match self.take(key) {
            None => Ok(None),
            Some(Value::Integer(value)) if (min..=max).contains(&value) => Ok(Some(value)),
            Some(other) => {
                Err(self.wrong(key, &said(&other), &format!("a whole number {min}..={max}")))
            }
        }
    }

    /// As [`Keys::integer`], but what is no whole number is left where it is.
    pub fn integer_if(
        &mut self,
        key: &'static str,
        min: i64,
        max: i64,
    ) -> Result<Option<i64>, ScriptError> {
        match self.table.get(key) {
            Some(Value::Integer(_)) => self.integer(key, min, max),
            _ => Ok(None),
        }
    }

    pub fn need_integer(
        &mut self,
        key: &'static str,
        min: i64,
        max: i64,
    ) -> Result<i64, ScriptError> {
        let value = self.integer(key, min, max)?;
        value.ok_or_else(|| self.missing(key, &format!("a whole number {min}..={max}")))
    }

    /// One number, or a list of them.
    pub fn numbers(&mut self, key: &'static str) -> Result<Option<Vec<u64>>, ScriptError> {
        const ALLOWED: &str = "a whole number from 0 on, or a list of at most 1000";
        let values = match self.take(key) {
            None => return Ok(None),
            Some(Value::Array(values)) if values.len() <= MOST_NUMBERS => values,
            Some(value) => vec![value],
        };
        let number = |value: Value| {
            let number = value.as_integer().and_then(|value| u64::try_from(value).ok());
            number.ok_or_else(|| self.wrong(key, &said(&value), ALLOWED))
        };
        values.into_iter().map(number).collect::<Result<Vec<u64>, _>>().map(Some)
    }

    pub fn number(
        &mut self,
        key: &'static str,
        min: f64,
        max: f64,
    ) -> Result<Option<f64>, ScriptError> {
        let allowed = format!("a number from {min} to {max}");
        self.ranged(key, min, max, &allowed)
    }

    fn ranged(
        &mut self,
        key: &'static str,
        min: f64,
        max: f64,
        allowed: &str,
    ) -> Result<Option<f64>, ScriptError> {
        let Some(value) = self.take(key) else { return Ok(None) };
        let number = match value {
            Value::Float(number) => Some(number),
            Value::Integer(number) => Some(number as f64),
            _ => None,
        };
        match number.filter(|number| (min..=max).contains(number)) {
            Some(number) => Ok(Some(number)),
            None => Err(self.wrong(key, &said(&value), allowed)),
        }
    }

    /// A time in seconds, as ns.
    pub fn time(&mut self, key: &'static str) -> Result<Option<u64>, ScriptError> {
        let seconds = self.ranged(key, 0.0, LATEST_S, TIMES)?;
        Ok(seconds.map(|seconds| (seconds * 1e9).round() as u64))
    }

    pub fn need_time(&mut self, key: &'static str) -> Result<u64, ScriptError> {
        self.time(key)?.ok_or_else(|| self.missing(key, TIMES))
    }

    /// `from_s` and `until_s`: from the start and for good where they are not given.
    pub fn span(&mut self) -> Result<(u64, u64), ScriptError> {
        let from_ns = self.time("from_s")?.or(self.now_ns).unwrap_or(0);
        let until_ns = self.time("until_s")?.unwrap_or(u64::MAX);
        if until_ns <= from_ns {
            return Err(self.wrong("until_s", "no later time", "later than from_s"));
        }
        Ok((from_ns, until_ns))
    }

    /// A servo as [`crate::Fault`] names it: by `joint`, or by `line` and `id`.
    pub fn servo(&mut self) -> Result<Option<String>, ScriptError> {
        let joint = self.name("joint")?;
        let id = self.integer("id", 0, 253)?;
        match (joint, id) {
            (Some(_), Some(id)) => {
                Err(self.wrong("id", &id.to_string(), "either joint, or line and id"))
            }
            (Some(joint), None) => Ok(Some(joint)),
            (None, Some(id)) => Ok(Some(format!("{}/{id}", self.need_name("line")?))),
            (None, None) => {
                if !self.known.contains(&"line") {
                    self.known.push("line");
                }
                Ok(None)
            }
        }
    }

    /// Nothing may be left.
    pub fn finish(self) -> Result<(), ScriptError> {
        match self.table.keys().next() {
            None => Ok(()),
            Some(key) => {
                Err(self.wrong(key, "a key this kind does not have", &self.known.join(", ")))
            }
        }
    }
}
