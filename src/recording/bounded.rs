//! Lists and maps in messages, bounded in number: an entry of two bytes takes a hundred in memory.

use std::collections::BTreeMap;
use std::fmt;
use std::marker::PhantomData;

use serde::de::{Deserialize, Deserializer, Error, MapAccess, SeqAccess, Visitor};

/// Joints are refused beyond this number.
pub(super) const JOINTS: usize = 512;
/// Notes on a run and names of sources are refused beyond this number.
const ENTRIES: usize = 4096;

/// A list with at most [`JOINTS`] entries.
pub(super) fn joints<'de, D, T>(from: D) -> Result<Vec<T>, D::Error>
where
    D: Deserializer<'de>,
    T: Deserialize<'de>,
{
    from.deserialize_seq(Joints(PhantomData))
}

/// A map with at most [`ENTRIES`] entries.
pub(super) fn entries<'de, D, T>(from: D) -> Result<BTreeMap<String, T>, D::Error>
where
    D: Deserializer<'de>,
    T: Deserialize<'de>,
{
    from.deserialize_map(Entries(PhantomData))
}

struct Joints<T>(PhantomData<T>);

impl<'de, T: Deserialize<'de>> Visitor<'de> for Joints<T> {
    type Value = Vec<T>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "a list of at most {JOINTS} joints")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut from: A) -> Result<Self::Value, A::Error> {
        let mut list = Vec::new();
        while let Some(joint) = from.next_element()? {
            if list.len() == JOINTS {
                return Err(A::Error::invalid_length(JOINTS + 1, &self));
            }
            list.push(joint);
        }
        Ok(list)
    }
}

struct Entries<T>(PhantomData<T>);

impl<'de, T: Deserialize<'de>> Visitor<'de> for Entries<T> {
    type Value = BTreeMap<String, T>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "a map of at most {ENTRIES} entries")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut from: A) -> Result<Self::Value, A::Error> {
        let mut map = BTreeMap::new();
        while let Some((name, value)) = from.next_entry()? {
            if map.len() == ENTRIES {
                return Err(A::Error::invalid_length(ENTRIES + 1, &self));
            }
            map.insert(name, value);
        }
        Ok(map)
    }
}
