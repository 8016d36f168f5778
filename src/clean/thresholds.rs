//! What a corpus of trials allows itself: one file that lies in its folder and goes where it goes.
//!
//! ```toml
//! schema = 1
//! most_doubt_percent = 2      # of a trial's samples that are part of an artefact
//! [most]                      # artefacts of a kind in one trial
//! swap_inside = 0
//! dropout = 20
//! ```

use super::artefact::ArtefactKind;
use crate::error::{Error, ErrorKind};
use crate::toml_text::{from_toml, plain_words};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Its name in the folder.
pub const FILE_NAME: &str = "clean.toml";
/// Version of the format.
pub const SCHEMA: u32 = 1;

/// What a trial may have wrong with it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Thresholds {
    /// Version of the format; 1.
    pub schema: u32,
    /// Most samples that are part of an artefact, %.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub most_doubt_percent: Option<f64>,
    /// Most artefacts of a kind; kinds that are not named have no limit of their own.
    #[serde(default)]
    pub most: BTreeMap<ArtefactKind, usize>,
}

impl Thresholds {
    /// Reads the file.
    ///
    /// # Errors
    /// A text that is none, of another version, or with a share that is none.
    pub fn parse(text: &str) -> Result<Self, Error> {
        let read: Self = from_toml(text).map_err(|cause| {
            let error = Error::of(ErrorKind::Malformed, "not a file of thresholds")
                .got(plain_words(cause.message()))
                .allowed("schema = 1, most_doubt_percent, and [most] with kinds of artefacts");
            match cause.span() {
                Some(span) => {
                    let line = 1 + text.get(..span.start).unwrap_or_default().matches('\n').count();
                    error.at(format!("line {line}"))
                }
                None => error,
            }
        })?;
        if read.schema != SCHEMA {
            return Err(Error::of(ErrorKind::Malformed, "another version of thresholds")
                .got(read.schema.to_string())
                .allowed(SCHEMA.to_string()));
        }
        match read.most_doubt_percent {
            Some(percent) if !(0.0..=100.0).contains(&percent) => {
                Err(Error::of(ErrorKind::OutsideLimits, "no share of a trial")
                    .at("most_doubt_percent")
                    .got(percent.to_string())
                    .allowed("0 to 100 %"))
            }
            _ => Ok(read),
        }
    }
}
