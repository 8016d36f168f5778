//! Folders in the layout of BONES-SEED: motions as BVH, a table of what and who they are, and what is done when.
//!
//! ```text
//! metadata/seed_metadata_v004.parquet                 or .csv: a row a motion
//! metadata/seed_metadata_v002_temporal_labels.jsonl   a line a motion: from when to when what is done
//! soma_proportional/bvh/DATE/MOTION.bvh               by a body of the actor's size
//! soma_uniform/bvh/DATE/MOTION.bvh                    by one body for all
//! ```
//!
//! Names of folders, files, columns and keys are those of the dataset card of `bones-studio/seed` (Hugging Face), of its
//! viewer (github.com/bones-studio/seed-viewer) and of programs that read it; the dataset itself is gated and was not
//! read: unconfirmed.

use super::about::AboutTrial;
use super::inside::inside;
use crate::body::anthropometry::{Measure, Subject, check_id};
use crate::columnar::TableReader;
use crate::corpus::rows::SubjectEntry;
use crate::error::{Error, ErrorKind, counted};
use crate::table::rows;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

/// Most bytes of a table that is text, and of all that is done when.
const MAX_BYTES: u64 = 1 << 30;
/// Most bytes of what is done when in one motion.
const MAX_LINE: u64 = 1 << 20;
/// Columns that say where a motion is.
const PLACES: [&str; 2] = ["move_soma_proportional_path", "move_soma_uniform_path"];
/// Columns that are read.
const COLUMNS: [&str; 14] = [
    "filename",
    "move_name",
    "package",
    "category",
    "is_mirror",
    "content_type_of_movement",
    "take_actor",
    "actor_uid",
    "actor_gender",
    "actor_age_yr",
    "actor_height_cm",
    "actor_weight_kg",
    "move_soma_proportional_path",
    "move_soma_uniform_path",
];

/// What is done in a motion, and when.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct TimedWords {
    /// From when, s.
    #[serde(rename = "start_time")]
    pub start_s: f64,
    /// Until when, s.
    #[serde(rename = "end_time")]
    pub end_s: f64,
    /// What, in a sentence.
    pub description: String,
}

#[derive(Deserialize)]
struct Line {
    filename: String,
    events: Vec<TimedWords>,
}

/// A motion of it.
#[derive(Clone, Debug, PartialEq)]
pub struct SeedMotion {
    /// Its file.
    pub file: PathBuf,
    /// What is said of it.
    pub about: AboutTrial,
    /// What is done in it.
    pub events: Vec<TimedWords>,
}

/// What a folder holds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SeedFolder {
    /// Motions whose files are there.
    pub motions: Vec<SeedMotion>,
    /// Those who did them.
    pub people: Vec<SubjectEntry>,
    /// How many motions the table has whose files are not there.
    pub absent: usize,
    /// Motions of which it is said what is done when, and which the table does not have.
    pub unnamed: Vec<String>,
}

/// A file in the folder of metadata whose name begins and ends so; the last by its number.
fn newest(folder: &Path, begins: &str, ends: &str) -> Option<PathBuf> {
    let entries = std::fs::read_dir(folder.join("metadata")).ok()?.flatten();
    let names = entries.filter_map(|entry| entry.file_name().into_string().ok());
    let fitting = names.filter(|name| name.starts_with(begins) && name.ends_with(ends));
    // v10 is newer than v9.
    let newest = fitting.max_by_key(|name| (name.len(), name.clone()))?;
    Some(folder.join("metadata").join(newest))
}

/// The table of motions of a folder in this layout.
#[must_use]
pub fn metadata(folder: &Path) -> Option<PathBuf> {
    let table = |ending: &str| newest(folder, "seed_metadata", ending);
    table(".parquet").or_else(|| table(".csv"))
}

/// Reads a folder in this layout, whose table of motions is `metadata`.
///
/// # Errors
/// A table or a line that cannot be read, one that leads out of the folder.
pub fn read(folder: &Path, metadata: &Path) -> Result<SeedFolder, Error> {
    let is_parquet = metadata.extension().is_some_and(|ending| ending == "parquet");
    let table = if is_parquet {
        of_parquet(metadata)
    } else {
        of_text(metadata).map_err(|error| error.in_file(metadata))
    }?;
    let mut events = newest(folder, "seed_metadata", "temporal_labels.jsonl")
        .map(|file| timeline(&file).map_err(|error| error.in_file(&file)))
        .transpose()?
        .unwrap_or_default();
    let mut found = SeedFolder::default();
    let mut people: BTreeMap<String, SubjectEntry> = BTreeMap::new();
    for row in table {
        let named = row.get("filename").and_then(|name| events.remove(name)).unwrap_or_default();
        let files = PLACES.iter().filter_map(|column| row.get(column));
        let files: Vec<PathBuf> =
            files.map(|file| inside(folder, file, metadata)).collect::<Result<_, _>>()?;
        let Some(file) = files.into_iter().find(|file| file.is_file()) else {
            found.absent += 1;
            continue;
        };
        let subject = person(&row);
        let about = about(&row, subject.as_ref().map(|of| of.subject.id.clone()));
        if let Some(person) = subject {
            people.entry(person.subject.id.clone()).or_insert(person);
        }
        found.motions.push(SeedMotion { file, about, events: named });
    }
    found.unnamed = events.into_keys().collect();
    found.people = people.into_values().collect();
    Ok(found)
}

/// A row, by column; nothing of what is empty.
type Cells = BTreeMap<&'static str, String>;

fn of_parquet(path: &Path) -> Result<Vec<Cells>, Error> {
    let table = TableReader::open(path)?;
    says_where(|name| table.has(name)).map_err(|error| error.in_file(path))?;
    let mut found = Vec::new();
    for group in 0..table.groups() {
        let mut rows: Vec<Cells> = vec![Cells::new(); table.rows_in(group)];
        for name in COLUMNS.into_iter().filter(|name| table.has(name)) {
            let column = table.column(group, name, None).map_err(|error| error.in_file(path))?;
            for (at, row) in rows.iter_mut().enumerate() {
                let number = || column.real(at).map(|value| value.to_string());
                let flag = || column.flag(at).map(|is| is.to_string());
                let cell = column.text(at).map(str::to_owned).or_else(number).or_else(flag);
                row.extend(cell.filter(|cell| !cell.is_empty()).map(|cell| (name, cell)));
            }
        }
        found.extend(rows);
    }
    Ok(found)
}

/// Fails if a table has none of the columns that say where motions are.
fn says_where(has: impl Fn(&'static str) -> bool) -> Result<(), Error> {
    if PLACES.into_iter().any(&has) {
        return Ok(());
    }
    let known: Vec<&str> = COLUMNS.into_iter().filter(|name| has(name)).collect();
    let known = if known.is_empty() { "none that is known".to_owned() } else { known.join(", ") };
    Err(Error::of(ErrorKind::Malformed, "the table of motions does not say where they are")
        .got(format!("columns: {known}"))
        .allowed(format!("a column {}", PLACES.join(" or "))))
}

/// Opens a file of the folder for reading; a pipe would be waited for.
fn opened(path: &Path) -> Result<io::Take<File>, Error> {
    let open = || {
        if !path.metadata()?.is_file() {
            return Err(io::Error::new(io::ErrorKind::InvalidInput, "it is no file"));
        }
        File::open(path)
    };
    open().map(|file| file.take(MAX_BYTES)).map_err(unreadable)
}

fn unreadable(cause: io::Error) -> Error {
    Error::of((&cause).into(), "a table of the folder cannot be read").got(cause.to_string())
}

fn of_text(path: &Path) -> Result<Vec<Cells>, Error> {
    let mut text = String::new();
    opened(path)?.read_to_string(&mut text).map_err(unreadable)?;
    let mut rows = rows(&text);
    let titles = rows
        .next()
        .ok_or_else(|| Error::of(ErrorKind::Malformed, "the table of motions is empty"))??;
    let places: Vec<Option<&'static str>> =
        titles.cells().map(|title| COLUMNS.into_iter().find(|column| *column == title)).collect();
    says_where(|name| places.contains(&Some(name)))?;
    rows.map(|row| {
        let row = row?;
        if row.width() != titles.width() {
            return Err(Error::of(ErrorKind::Malformed, "a row has not one cell per column")
                .at(format!("line {}", row.line))
                .got(counted(row.width(), "cell"))
                .allowed(format!("{}, as there are titles", counted(titles.width(), "cell")))
                .remedy("the file may be cut off or edited: fetch it again"));
        }
        let cells = places.iter().zip(row.cells());
        let known = cells.filter_map(|(name, cell)| Some(((*name)?, cell)));
        Ok(known.filter(|(_, cell)| !cell.is_empty()).map(|(n, c)| (n, c.to_owned())).collect())
    })
    .collect()
}

/// What is done when, by the name of the motion.
fn timeline(path: &Path) -> Result<BTreeMap<String, Vec<TimedWords>>, Error> {
    let mut input = BufReader::new(opened(path)?);
    let mut found: BTreeMap<String, Vec<TimedWords>> = BTreeMap::new();
    let mut line = Vec::new();
    for number in 1.. {
        line.clear();
        let read =
            (&mut input).take(MAX_LINE + 1).read_until(b'\n', &mut line).map_err(unreadable)?;
        if read == 0 {
            break;
        }
        if line.len() as u64 > MAX_LINE && line.last() != Some(&b'\n') {
            return Err(Error::of(
                ErrorKind::OutsideLimits,
                "a line of what is done when is too long",
            )
            .at(format!("line {number}"))
            .got(format!("more than {MAX_LINE} bytes"))
            .allowed(format!("{MAX_LINE} bytes for one motion")));
        }
        if line.iter().all(u8::is_ascii_whitespace) {
            continue;
        }
        let Line { filename, events } = serde_json::from_slice(&line).map_err(|cause| {
            Error::of(ErrorKind::Malformed, "not a line of what is done when")
                .at(format!("line {number}"))
                .got(cause.to_string())
                .allowed("{\"filename\": \"...\", \"events\": [{\"start_time\": 0.0, \"end_time\": 1.5, \"description\": \"...\"}]}")
        })?;
        let says_nothing = |of: &&TimedWords| {
            of.description.trim().is_empty() || of.description.chars().any(char::is_control)
        };
        if events.iter().any(|of| says_nothing(&of)) {
            return Err(Error::of(ErrorKind::Malformed, "what is done is not said in plain words")
                .at(format!("line {number}"))
                .got(filename)
                .allowed("a description, in letters that are seen"));
        }
        let is_wrong = |of: &&TimedWords| !(0.0 <= of.start_s && of.start_s <= of.end_s);
        if let Some(wrong) = events.iter().find(is_wrong) {
            return Err(Error::of(ErrorKind::Malformed, "something ends before it begins")
                .at(format!("line {number}"))
                .got(format!("{} s to {} s", wrong.start_s, wrong.end_s))
                .allowed("0 <= start_time <= end_time"));
        }
        // Of a motion that has two lines, both count.
        found.entry(filename).or_default().extend(events);
    }
    Ok(found)
}

fn person(row: &Cells) -> Option<SubjectEntry> {
    let told = row.get("actor_uid").or_else(|| row.get("take_actor"))?;
    let id = format!("bones-{}", told.to_ascii_lowercase());
    check_id(&id).ok()?;
    let number =
        |column: &str, unit: f64| row.get(column)?.parse().ok().map(|value: f64| value * unit);
    // What no person has is nobody's measure.
    let is_possible = |of: &Measure, value: f64| of.read(&value.to_string()).is_ok();
    let measures = [
        (Measure::Stature, number("actor_height_cm", 0.01)),
        (Measure::Mass, number("actor_weight_kg", 1.0)),
        (Measure::Age, number("actor_age_yr", 1.0)),
    ];
    let subject = Subject {
        id,
        gender: row.get("actor_gender").cloned().unwrap_or_default(),
        measures: measures
            .into_iter()
            .filter_map(|(of, value)| Some((of, value.filter(|value| is_possible(&of, *value))?)))
            .collect(),
        ..Subject::default()
    };
    Some(SubjectEntry { subject, ..SubjectEntry::default() })
}

fn about(row: &Cells, subject: Option<String>) -> AboutTrial {
    let of = |name: &str| row.get(name).cloned();
    let action = of("content_type_of_movement").or_else(|| of("category"));
    let told =
        ["package", "category"].map(|name| of(name).map(|value| format!(", {name} {value}")));
    let is_mirrored = of("is_mirror").is_some_and(|is| ["true", "True", "1"].contains(&&*is));
    let mirrored = is_mirrored.then(|| ", mirrored".to_owned());
    let rest: String = told.into_iter().flatten().chain(mirrored).collect();
    AboutTrial {
        name: of("move_name").or_else(|| of("filename")),
        set: Some("bones-seed".to_owned()),
        action: Some(action.unwrap_or_else(|| "unknown".to_owned()).to_lowercase()),
        subject,
        licence: Some("LicenseRef-BONES-SEED".to_owned()),
        provenance: Some(format!("BONES-SEED{rest}")),
        ..AboutTrial::default()
    }
}
