//! `corpus.toml`: what a corpus is, and the five choices that make a motion database. A person may edit it.

use crate::error::{Error, ErrorKind, counted};
use crate::toml_text::{from_toml, plain_words, to_toml};
use serde::{Deserialize, Serialize};

/// Version of the format.
pub const SCHEMA: u32 = 1;
/// Most bytes of it.
pub const MAX_BYTES: usize = 1 << 20;

/// What stands at the head of the file.
const REMARKS: &str = "\
What this corpus is, in the words of whoever made it: the five choices of a motion database.
`gaitway corpus` reads it and writes its name into every export; it changes nothing here.";

/// `corpus.toml`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CorpusManifest {
    /// Version of the format; 1.
    pub schema: u32,
    /// What the corpus is called.
    pub name: String,
    /// The five choices.
    pub choices: FiveChoices,
}

/// The five choices that make a motion database, in words.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FiveChoices {
    /// What is measured or made.
    pub data_type: String,
    /// Which motions.
    pub range_of_motion: String,
    /// Which people.
    pub range_of_subjects: String,
    /// What an action is, and how it is done.
    pub definition_and_execution: String,
    /// What comes out.
    pub output: String,
}

impl CorpusManifest {
    /// Reads one.
    ///
    /// # Errors
    /// A text that is none of this version.
    pub fn parse(text: &str) -> Result<Self, Error> {
        let wrong = |got: String| {
            Error::of(ErrorKind::Malformed, "not the manifest of a corpus")
                .got(got)
                .remedy("compare it with one that `gaitway corpus new` wrote")
        };
        if text.len() > MAX_BYTES {
            return Err(wrong(counted(text.len(), "byte")));
        }
        let manifest: Self =
            from_toml(text).map_err(|cause| wrong(plain_words(cause.message())))?;
        if manifest.schema != SCHEMA {
            return Err(wrong(format!("schema = {}", manifest.schema))
                .allowed(format!("schema = {SCHEMA}")));
        }
        Ok(manifest)
    }

    /// As text.
    ///
    /// # Errors
    /// None that a manifest can have.
    pub fn text(&self) -> Result<String, Error> {
        to_toml(REMARKS, self)
    }
}
