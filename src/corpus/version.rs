//! The version of a corpus: a hash of its rows, and the list of what changed from one to the next.

use serde::{Deserialize, Serialize};

/// A hash of rows that does not depend on their order, and from which rows can be taken again: the sum of their
/// SHA-256 as numbers, modulo 2^256. It tells two corpora apart; it does not resist whoever makes rows on purpose to
/// have a given sum.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RowSum([u8; 32]);

impl RowSum {
    /// By its 64 hexadecimal digits.
    #[must_use]
    pub fn of(text: &str) -> Option<Self> {
        let mut sum = [0; 32];
        if text.len() != 64 || !text.bytes().all(|b| b.is_ascii_hexdigit()) {
            return None;
        }
        for (byte, digits) in sum.iter_mut().zip(text.as_bytes().chunks(2)) {
            *byte = u8::from_str_radix(std::str::from_utf8(digits).ok()?, 16).ok()?;
        }
        Some(Self(sum))
    }

    /// With a row.
    pub fn add(&mut self, digest: &[u8; 32]) {
        let mut carry = 0;
        for (byte, more) in self.0.iter_mut().zip(digest).rev() {
            let sum = u16::from(*byte) + u16::from(*more) + carry;
            *byte = (sum & 0xff) as u8;
            carry = sum >> 8;
        }
    }

    /// Without a row.
    pub fn take(&mut self, digest: &[u8; 32]) {
        // Its negative: all bits turned, and one.
        let mut negative = Self(digest.map(|byte| !byte));
        let mut one = [0; 32];
        one[31] = 1;
        negative.add(&one);
        self.add(&negative.0);
    }

    /// As hexadecimal digits.
    #[must_use]
    pub fn text(&self) -> String {
        self.0.iter().map(|byte| format!("{byte:02x}")).collect()
    }
}

/// `version.json`: which files a corpus is made of now, and how it came to that.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VersionFile {
    /// Version of the format; 1.
    pub schema: u32,
    /// How many times the corpus changed.
    pub number: u64,
    /// Hash of all rows.
    pub version: String,
    /// Trials there are.
    pub trials: u64,
    /// Frames that are kept.
    pub frames: u64,
    /// Tables, each a file.
    pub files: Vec<FileNote>,
    /// What changed, the newest last.
    pub changes: Vec<Change>,
    /// Where trials went.
    #[serde(default)]
    pub exports: Vec<ExportNote>,
}

/// A table.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FileNote {
    /// From the folder of the corpus on.
    pub path: String,
    /// `trials`, `labels`, `frames` or `subjects`.
    pub table: String,
    /// The set; empty of the table of subjects.
    pub set: String,
    /// The action.
    pub action: String,
    /// Rows in it.
    pub rows: u64,
    /// Its length.
    pub bytes: u64,
    /// Its hash.
    pub sha256: String,
}

/// A step from one version to the next.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Change {
    /// The version after it.
    pub version: String,
    /// What was done: `new`, `add`, `remove`, `label`, ...
    pub deed: String,
    /// Trials that came.
    pub added: u64,
    /// Trials that went.
    pub removed: u64,
    /// A few words.
    #[serde(default)]
    pub words: String,
}

/// An export: what was passed on.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExportNote {
    /// Where it was written.
    pub path: String,
    /// In which format.
    pub format: String,
    /// Of which version.
    pub version: String,
    /// How many trials.
    pub trials: u64,
    /// Whose motions are in it.
    pub subjects: Vec<String>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn rows_may_come_in_any_order_and_go_again(
            rows in prop::collection::vec(any::<[u8; 32]>(), 0..20), extra in any::<[u8; 32]>(),
        ) {
            let (mut one, mut other) = (RowSum::default(), RowSum::default());
            rows.iter().for_each(|row| one.add(row));
            rows.iter().rev().for_each(|row| other.add(row));
            prop_assert_eq!(one, other);
            other.add(&extra);
            prop_assert!(extra == [0; 32] || one != other);
            other.take(&extra);
            prop_assert_eq!(one, other);
            rows.iter().for_each(|row| other.take(row));
            prop_assert_eq!(other, RowSum::default());
            prop_assert_eq!(RowSum::of(&one.text()), Some(one));
        }
    }
}
