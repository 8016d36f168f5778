//! Servo files written as another servo plus what differs.
//!
//! `extends = "xm430-w350"` takes everything of that shipped servo. Then, in this order:
//!
//! - `without = ["key", ...]` takes out optional keys of the base that do not hold here;
//! - every other key of the file replaces the base's, tables and lists as a whole;
//! - a `[[register]]` with the name (and `first`) of one of the base's is laid over it key by key,
//!   `source` included; with `remove = true` it takes it out; any other is added.
//!
//! Who reads a profile sees the whole table only: nothing above this module knows of bases.

use crate::error::ProfileError;
use toml::{Table, Value};

/// Longest chain of bases. Files of this crate use one step.
const MAX_STEPS: usize = 4;

/// Names the base.
pub(crate) const KEY: &str = "extends";

/// True if the file names a base.
pub(crate) fn has_base(table: &Table) -> bool {
    table.contains_key(KEY)
}

/// The whole table of a servo file. `base_text` finds the text of a shipped servo by name.
pub(crate) fn resolve(
    file: &str,
    table: Table,
    base_text: impl Fn(&str) -> Option<&'static str>,
) -> Result<Table, ProfileError> {
    let mut chain = vec![table];
    while let Some(base) = chain.last().and_then(|table| table.get(KEY)) {
        let refuse = |what: &str| ProfileError::new(file, what).at("extends").got(shown(base));
        if chain.len() > MAX_STEPS {
            return Err(refuse("the chain of bases is too long, or a circle")
                .allowed(format!("at most {MAX_STEPS} steps")));
        }
        let Some(text) = base.as_str().and_then(&base_text) else {
            return Err(refuse("there is no shipped servo of this name to extend"));
        };
        let table = text.parse().map_err(|_| refuse("the base is not a profile"))?;
        chain.push(table);
    }
    let mut whole = chain.pop().unwrap_or_default();
    while let Some(changes) = chain.pop() {
        lay_over(file, &mut whole, changes)?;
    }
    Ok(whole)
}

fn lay_over(file: &str, whole: &mut Table, mut changes: Table) -> Result<(), ProfileError> {
    changes.remove("extends");
    if let Some(without) = changes.remove("without") {
        let Some(keys) = without.as_array() else {
            return Err(ProfileError::new(file, "`without` is a list of keys of the base")
                .at("without")
                .got(shown(&without)));
        };
        for key in keys {
            if key.as_str().and_then(|key| whole.remove(key)).is_none() {
                return Err(ProfileError::new(file, "the base has no such key to leave out")
                    .at("without")
                    .got(shown(key)));
            }
        }
    }
    let registers = match changes.remove("register") {
        None => Vec::new(),
        Some(Value::Array(registers)) => registers,
        Some(_) => {
            return Err(
                ProfileError::new(file, "registers are written as [[register]]").at("register")
            );
        }
    };
    whole.extend(changes);
    let Some(Value::Array(base)) = whole.get_mut("register") else {
        return Ok(());
    };
    let mut named = Vec::new();
    for register in registers {
        let Value::Table(register) = register else {
            return Err(ProfileError::new(file, "a register is a table").at("register"));
        };
        let key = identity(&register);
        if named.contains(&key) {
            return Err(
                ProfileError::new(file, "the same register is changed twice").at(place(&key))
            );
        }
        one_register(file, base, register, &key)?;
        named.push(key);
    }
    let address = |value: &Value| value.get("address").and_then(Value::as_integer);
    base.sort_by_key(address);
    Ok(())
}

/// Name and, of repeated registers, number of the first item: two blocks may have one name.
type Identity = (Option<String>, Option<i64>);

fn identity(register: &Table) -> Identity {
    (
        register.get("name").and_then(Value::as_str).map(ToOwned::to_owned),
        register.get("first").and_then(Value::as_integer),
    )
}

fn place((name, first): &Identity) -> String {
    let name = name.as_deref().unwrap_or_default();
    first.map_or_else(|| format!("register {name:?}"), |n| format!("register {name:?} from {n}"))
}

fn shown(value: &Value) -> String {
    value.as_str().map_or_else(|| format!("{value:?}"), |text| format!("{text:?}"))
}

fn one_register(
    file: &str,
    base: &mut Vec<Value>,
    mut changes: Table,
    key: &Identity,
) -> Result<(), ProfileError> {
    let found = base
        .iter()
        .position(|register| register.as_table().is_some_and(|table| identity(table) == *key));
    let remove = changes.remove("remove");
    match (found, remove) {
        (Some(index), Some(Value::Boolean(true))) => {
            base.remove(index);
        }
        (_, Some(remove)) => {
            return Err(ProfileError::new(file, "`remove = true` is for a register of the base")
                .at(place(key))
                .got(format!("remove = {}", shown(&remove))));
        }
        (Some(_), None) if !changes.contains_key("source") => {
            return Err(ProfileError::new(file, "a changed register must say where it is written")
                .at(place(key))
                .remedy("add `source`: the base's speaks of the base"));
        }
        (Some(index), None) => {
            if let Some(Value::Table(register)) = base.get_mut(index) {
                register.extend(changes);
            }
        }
        (None, None) => base.push(Value::Table(changes)),
    }
    Ok(())
}
