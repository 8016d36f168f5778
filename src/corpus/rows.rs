//! What a corpus says of a trial, of a subject and of a stretch of frames.

use crate::body::anthropometry::{Measure, Subject};
use crate::clean::sha256::Sha256;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Where a trial comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TrialKind {
    /// A file of markers or of a skeleton in motion.
    Capture,
    /// A trial of a recording session with worn sensors.
    Session,
    /// An action that was performed by the body model.
    Generated,
}

impl TrialKind {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Capture, Self::Session, Self::Generated];

    /// As a word.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Capture => "capture",
            Self::Session => "session",
            Self::Generated => "generated",
        }
    }
}

/// Parameters that a trial may have: where to, which way, how fast, how heavy. All are in SI, angles from straight
/// ahead to the right (0 forward, pi/4 front right).
pub const PARAMETERS: [&str; 10] = [
    "target_x_m",
    "target_y_m",
    "target_z_m",
    "direction_rad",
    "length_m",
    "height_m",
    "speed_m_s",
    "load_kg",
    "seed",
    "variation",
];

/// A trial: a row of the catalogue.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TrialEntry {
    /// Its id: 16 hexadecimal digits of the hash of its frames.
    pub trial: String,
    /// What it is called by people: the file's name without ending.
    pub name: String,
    /// The set it belongs to.
    pub set: String,
    /// What is done in it.
    pub action: String,
    /// Where it comes from.
    pub kind: TrialKind,
    /// True if nobody did it.
    pub synthetic: bool,
    /// Id of who did it.
    pub subject: Option<String>,
    /// The session in which it was recorded.
    pub session: Option<String>,
    /// The file, or the action, as it was named when it was added.
    pub source: String,
    /// What kind of file it was.
    pub format: String,
    /// SHA-256 of the file; nothing of what was generated.
    pub source_sha256: Option<String>,
    /// Where the corpus keeps the file, from its folder on.
    pub source_file: Option<String>,
    /// Who made it, where it was published.
    pub provenance: Option<String>,
    /// Its licence; `unknown` if nobody said.
    pub licence: String,
    /// True if it must not be used for what earns money.
    pub noncommercial: bool,
    /// What was thought of it: keep or retake.
    pub verdict: Option<String>,
    /// Good repetitions in it.
    pub repetitions: Option<i64>,
    /// SHA-256 of the edit list by which it was cleaned.
    pub edits_sha256: Option<String>,
    /// Segments that were not measured, with a blank between them.
    pub untracked: Option<String>,
    /// Trials that it is put together from, with a blank between them.
    pub part_of: Option<String>,
    /// Stature of the body it was put on, m.
    pub body_stature_m: f64,
    /// How many frames.
    pub frames: i64,
    /// Frames per second.
    pub rate_hz: f64,
    /// How long it is, s.
    pub duration_s: f64,
    /// SHA-256 of its frames.
    pub frames_sha256: String,
    /// Its parameters, of [`PARAMETERS`].
    pub parameters: BTreeMap<String, f64>,
    /// Where its frames are; nothing if they are not kept.
    #[serde(skip)]
    pub place: Option<FramesPlace>,
}

/// Where the frames of a trial are.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FramesPlace {
    /// The file, from the folder of the corpus on.
    pub file: String,
    /// The row group.
    pub group: i64,
    /// The first row in it.
    pub first_row: i64,
}

/// Frames of a trial in which something is done.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LabelEntry {
    /// Id of the trial.
    pub trial: String,
    /// The set it belongs to.
    #[serde(skip)]
    pub set: String,
    /// What the trial is called.
    #[serde(skip)]
    pub action: String,
    /// What is done.
    pub label: String,
    /// The first frame, from 0.
    pub first_frame: i64,
    /// The last frame.
    pub last_frame: i64,
    /// 1 if it is done, 0.5 if nobody can say.
    pub value: f64,
    /// Who said so.
    pub annotator: String,
}

/// What a subject allowed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Consent {
    /// Nobody noted it.
    #[default]
    Unknown,
    /// Their motions may be kept and passed on.
    Given,
    /// They may be kept, and not passed on.
    Internal,
    /// They asked for their motions to be taken out.
    Withdrawn,
}

impl Consent {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Unknown, Self::Given, Self::Internal, Self::Withdrawn];

    /// As a word.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Unknown => "unknown",
            Self::Given => "given",
            Self::Internal => "internal",
            Self::Withdrawn => "withdrawn",
        }
    }

    /// By its word.
    #[must_use]
    pub fn of(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|consent| consent.word() == word)
    }
}

/// A person: a row of `subjects.parquet`. The id is a pseudonym: nothing else tells who it is.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct SubjectEntry {
    /// Id, gender, remarks and measures.
    #[serde(flatten)]
    pub subject: Subject,
    /// What they allowed.
    pub consent: Consent,
}

impl SubjectEntry {
    /// A measure, in SI; age in years.
    #[must_use]
    pub fn measure(&self, measure: Measure) -> Option<f64> {
        self.subject.measure(measure)
    }
}

/// The hash of a row, for the version of a corpus.
#[must_use]
pub fn digest(table: &str, row: &impl Serialize) -> [u8; 32] {
    let mut hash = Sha256::default();
    hash.update(table.as_bytes());
    hash.update(b"\n");
    // Rows hold words and numbers only: nothing of them cannot be said.
    hash.update(&serde_json::to_vec(row).unwrap_or_default());
    let text = hash.finish();
    let mut bytes = [0; 32];
    for (byte, digits) in bytes.iter_mut().zip(text.as_bytes().chunks(2)) {
        let digits = std::str::from_utf8(digits).unwrap_or("0");
        *byte = u8::from_str_radix(digits, 16).unwrap_or(0);
    }
    bytes
}
