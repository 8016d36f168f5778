//! All that is wrong with the form of a file at once: keys that are missing, unknown or of another kind.
//!
//! A reader stops at the first. Here the first is noted, mended in a copy with a value that is made up,
//! and the copy read again, until it has the form or cannot be mended. What was made up is never used.

use crate::error::{Faults, ProfileError};
use crate::from_toml::{from_toml, toml_bytes};
use crate::plain::plain_words;
use serde::de::DeserializeOwned;
use serde_path_to_error::{Path, Segment};
use toml::de::{DeTable, DeValue};
use toml::{Table, Value};

/// Of a file that takes more than this the first fault is enough, bytes: copies of it are read.
const SMALL_BYTES: usize = 2 << 20;
/// Times a copy is read.
const ROUNDS: usize = 60;

/// Everything that keeps `text` from being a `T`, line by line; nothing if it cannot be told.
pub(crate) fn faults<T: DeserializeOwned>(file: &str, text: &str) -> Result<(), ProfileError> {
    let mut found = Vec::new();
    let Some(mut table) = small(text) else { return Ok(()) };
    let Ok(lines) = DeTable::parse(text) else { return Ok(()) };
    let mut made_up: Vec<Vec<Step>> = Vec::new();
    for _ in 0..ROUNDS {
        let Some(fault) = first_fault::<T>(&table) else { break };
        // What stands below a value that was made up is nobody's fault.
        if !made_up.iter().any(|path| fault.path.starts_with(path)) {
            let (line, place) = place(text, lines.get_ref(), &table, &fault);
            found.push((line, malformed(file, &fault.message).at(place)));
        }
        let Some(path) = mend::<T>(&mut table, &fault) else { break };
        made_up.extend(path);
    }
    found.sort_by_key(|(line, _)| *line);
    let mut faults = Faults::default();
    let last = found.len().saturating_sub(1);
    for (index, (_, fault)) in found.into_iter().enumerate() {
        let then = "correct this and check again: values are looked at once the form is right";
        faults.note(Err(if index == last { fault.remedy(then) } else { fault }));
    }
    faults.verdict()
}

/// A file without the form of a profile.
pub(crate) fn malformed(file: &str, message: &str) -> ProfileError {
    ProfileError::new(file, "the file does not have the form of a profile")
        .got(plain_words(message).replace('\n', "; "))
}

fn small(text: &str) -> Option<Table> {
    (toml_bytes(text) <= SMALL_BYTES).then(|| from_toml(text).ok()).flatten()
}

/// One step from a table or a list to what it holds.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Step {
    Key(String),
    Index(usize),
}

/// What a reader has against a table.
struct Fault {
    message: String,
    /// Of what is wrong; a key that is missing is the last step.
    path: Vec<Step>,
    kind: FaultKind,
}

#[derive(PartialEq, Eq)]
enum FaultKind {
    Missing,
    Unknown,
    Value,
}

fn first_fault<T: DeserializeOwned>(table: &Table) -> Option<Fault> {
    let read = serde_path_to_error::deserialize::<_, T>(Value::Table(table.clone()));
    let error = read.err()?;
    let message = error.inner().message().to_owned();
    let mut path = steps(error.path());
    let named = |before: &str| message.strip_prefix(before)?.split('`').next().map(str::to_owned);
    let (kind, key) = match (named("missing field `"), named("unknown field `")) {
        (Some(key), _) => (FaultKind::Missing, Some(key)),
        (None, Some(key)) => (FaultKind::Unknown, Some(key)),
        (None, None) => (FaultKind::Value, None),
    };
    if let Some(key) = key.map(Step::Key).filter(|key| path.last() != Some(key)) {
        path.push(key);
    }
    Some(Fault { message, path, kind })
}

fn steps(path: &Path) -> Vec<Step> {
    let step = |segment: &Segment| match segment {
        Segment::Seq { index } => Some(Step::Index(*index)),
        Segment::Map { key } => Some(Step::Key(key.clone())),
        Segment::Enum { .. } | Segment::Unknown => None,
    };
    path.iter().filter_map(step).collect()
}

/// Changes the table so that the fault is gone. Where a value was made up; nothing if it cannot be done.
fn mend<T: DeserializeOwned>(table: &mut Table, fault: &Fault) -> Option<Option<Vec<Step>>> {
    let (last, above) = fault.path.split_last()?;
    if fault.kind == FaultKind::Unknown {
        let Step::Key(key) = last else { return None };
        return inside(table, above)?.table()?.remove(key).map(|_| None);
    }
    for value in made_up_values(&fault.message) {
        let mut mended = table.clone();
        put(&mut mended, above, last, value)?;
        let next = first_fault::<T>(&mended);
        if next.is_none_or(|next| next.path != fault.path) {
            *table = mended;
            return Some(Some(fault.path.clone()));
        }
    }
    // A whole entry of a list that cannot be mended is left out.
    let at = fault.path.iter().rposition(|step| matches!(step, Step::Index(_)))?;
    let Step::Index(index) = fault.path[at] else { return None };
    let list = inside(table, &fault.path[..at])?.array()?;
    (index < list.len()).then(|| drop(list.remove(index)))?;
    Some(None)
}

/// One of each kind, first a word that the message itself would have accepted.
fn made_up_values(message: &str) -> Vec<Value> {
    let accepted = message.split("expected").nth(1).and_then(|words| words.split('`').nth(1));
    let numbers = Value::Array(vec![Value::Float(0.0), Value::Float(0.0), Value::Float(1.0)]);
    let mut values: Vec<Value> =
        accepted.map(|word| Value::String(word.to_owned())).into_iter().collect();
    values.extend([
        Value::Float(1.0),
        Value::Integer(1),
        Value::String("x".to_owned()),
        Value::Boolean(false),
        numbers,
        Value::Array(Vec::new()),
        Value::Table(Table::new()),
    ]);
    values
}

/// What the steps lead to.
fn inside<'a>(table: &'a mut Table, path: &[Step]) -> Option<Entry<'a>> {
    let mut found = Entry::Top(table);
    for step in path {
        let value = match (found, step) {
            (Entry::Top(table), Step::Key(key)) => table.get_mut(key)?,
            (Entry::In(value), Step::Key(key)) => value.get_mut(key)?,
            (Entry::In(value), Step::Index(index)) => value.get_mut(*index)?,
            (Entry::Top(_), Step::Index(_)) => return None,
        };
        found = Entry::In(value);
    }
    Some(found)
}

/// The file's own table, or a value in it.
enum Entry<'a> {
    Top(&'a mut Table),
    In(&'a mut Value),
}

impl<'a> Entry<'a> {
    fn table(self) -> Option<&'a mut Table> {
        match self {
            Self::Top(table) => Some(table),
            Self::In(value) => value.as_table_mut(),
        }
    }

    fn array(self) -> Option<&'a mut Vec<Value>> {
        match self {
            Self::Top(_) => None,
            Self::In(value) => value.as_array_mut(),
        }
    }
}

fn put(table: &mut Table, above: &[Step], last: &Step, value: Value) -> Option<()> {
    match (inside(table, above)?, last) {
        (of, Step::Key(key)) => drop(of.table()?.insert(key.clone(), value)),
        (of, Step::Index(index)) => *of.array()?.get_mut(*index)? = value,
    }
    Some(())
}

/// Line in the file; in words, with the name of the entry, where it has one.
fn place(text: &str, lines: &DeTable<'_>, table: &Table, fault: &Fault) -> (usize, String) {
    let before = text.as_bytes().iter().take(offset(lines, &fault.path));
    let line = 1 + before.filter(|&&byte| byte == b'\n').count();
    let mut words = vec![format!("line {line}")];
    let mut value: Option<&Value> = None;
    for (at, step) in fault.path.iter().enumerate() {
        value = match (step, value) {
            (Step::Key(key), None) if at == 0 => table.get(key),
            (Step::Key(key), Some(value)) => value.get(key),
            (Step::Index(index), Some(value)) => value.get(*index),
            _ => None,
        };
        let name = value.and_then(|value| value.get("name")).and_then(Value::as_str);
        if let (Some(name), Step::Index(_), Some(Step::Key(list))) =
            (name, step, at.checked_sub(1).and_then(|before| fault.path.get(before)))
        {
            words.push(format!("{list} {name:?}"));
        }
    }
    (line, words.join(", "))
}

/// Where the deepest thing on the path that the file has begins.
fn offset(lines: &DeTable<'_>, path: &[Step]) -> usize {
    let mut steps = path.iter();
    let Some(Step::Key(first)) = steps.next() else { return 0 };
    let Some((key, value)) = lines.get_key_value(first.as_str()) else { return 0 };
    let (mut offset, mut value) = (key.span().start, value);
    for step in steps {
        let next = match (step, value.get_ref()) {
            (Step::Key(key), DeValue::Table(table)) => {
                table.get_key_value(key.as_str()).map(|(key, value)| (key.span().start, value))
            }
            (Step::Index(index), DeValue::Array(list)) => {
                list.get(*index).map(|value| (value.span().start, value))
            }
            _ => None,
        };
        let Some(next) = next else { break };
        (offset, value) = next;
    }
    offset
}
