//! Values as TOML text. The `toml` crate is built here for reading only.

use crate::error::Error;
use serde::Serialize;
use serde_json::{Map, Value};

/// The TOML document of a value; `None` is left out. Keys keep the order of the fields, but plain
/// values come before tables, as TOML wants it.
///
/// # Errors
/// A value that is no table.
pub fn to_text(value: &impl Serialize) -> Result<String, Error> {
    let unwritable = |why: &str| Error::new("this cannot be written as TOML").got(why);
    match serde_json::to_value(value).map_err(|e| unwritable(&e.to_string()))? {
        Value::Object(table) => {
            let mut out = String::new();
            write_table(&mut out, "", &table);
            Ok(out)
        }
        _ => Err(unwritable("no table")),
    }
}

fn write_table(out: &mut String, path: &str, table: &Map<String, Value>) {
    for (name, value) in table.iter().filter(|(_, value)| !is_table(value)) {
        if !value.is_null() {
            out.push_str(&format!("{} = {}\n", key(name), inline(value)));
        }
    }
    for (name, value) in table {
        let path = if path.is_empty() { key(name) } else { format!("{path}.{}", key(name)) };
        match value {
            Value::Object(inner) => {
                out.push_str(&format!("\n[{path}]\n"));
                write_table(out, &path, inner);
            }
            Value::Array(rows) if is_table(value) => {
                for row in rows.iter().filter_map(Value::as_object) {
                    out.push_str(&format!("\n[[{path}]]\n"));
                    write_table(out, &path, row);
                }
            }
            _ => {}
        }
    }
}

/// True for what TOML writes under a heading of its own.
fn is_table(value: &Value) -> bool {
    match value {
        Value::Object(_) => true,
        Value::Array(rows) => !rows.is_empty() && rows.iter().all(Value::is_object),
        _ => false,
    }
}

fn key(name: &str) -> String {
    let bare = |b: u8| b.is_ascii_alphanumeric() || b == b'-' || b == b'_';
    if !name.is_empty() && name.bytes().all(bare) { name.to_owned() } else { text(name) }
}

/// JSON's strings are TOML's, but for one letter that JSON leaves as it is.
fn text(text: &str) -> String {
    Value::from(text).to_string().replace('\u{7f}', "\\u007F")
}

fn inline(value: &Value) -> String {
    match value {
        Value::String(words) => text(words),
        Value::Array(items) => {
            format!("[{}]", items.iter().map(inline).collect::<Vec<_>>().join(", "))
        }
        Value::Object(table) => {
            let fields =
                table.iter().map(|(name, value)| format!("{} = {}", key(name), inline(value)));
            format!("{{ {} }}", fields.collect::<Vec<_>>().join(", "))
        }
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use serde::Deserialize;
    use std::collections::BTreeMap;

    #[derive(Debug, PartialEq, Serialize, Deserialize)]
    struct Inner {
        name: String,
        numbers: Vec<f64>,
        none: Option<f64>,
        deeper: BTreeMap<String, i64>,
    }

    #[derive(Debug, PartialEq, Serialize, Deserialize)]
    struct Outer {
        rows: Vec<Inner>,
        yes: bool,
        inner: Inner,
        pairs: Vec<[f64; 2]>,
    }

    fn inner() -> impl Strategy<Value = Inner> {
        let number = prop_oneof![-1e300..1e300_f64, Just(0.0), Just(1e-12), Just(3.0)];
        let numbers = prop::collection::vec(number, 0..4);
        let deeper = prop::collection::btree_map(any::<String>(), any::<i64>(), 0..4);
        (any::<String>(), numbers, prop::option::of(-1.0..1.0), deeper)
            .prop_map(|(name, numbers, none, deeper)| Inner { name, numbers, none, deeper })
    }

    proptest! {
        #[test]
        fn what_is_written_is_read_as_it_was(
            rows in prop::collection::vec(inner(), 0..4), inner in inner(), yes: bool,
        ) {
            let value = Outer { rows, yes, inner, pairs: vec![[1.0, -0.5]; 2] };
            let text = to_text(&value).unwrap();
            let read: Outer = toml::from_str(&text).unwrap_or_else(|e| panic!("{e}\n{text}"));
            prop_assert_eq!(read, value);
        }
    }

    #[test]
    fn a_number_alone_is_no_document() {
        assert!(to_text(&3.0).is_err());
    }
}
