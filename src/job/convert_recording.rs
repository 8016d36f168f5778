//! A recording as a table of what it holds, or as joint angles of the person who wore its sensors.

use super::report::Outcome;
use crate::body::Proportions;
use crate::body::worn::kept::Kept;
use crate::draft::write_file;
use crate::error::{Error, ErrorKind, either};
use crate::job::report::counted;
use crate::mocap::marker_files;
use crate::recording;
use crate::session::angles::{WornMotion, body_of};
use crate::session::doubted;
use crate::session::files::BODY_KEY;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Which recording becomes which file.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordingOrder {
    /// A recording.
    pub recording: PathBuf,
    /// How its sensors were worn, where it does not say so itself.
    pub calibration: Option<PathBuf>,
    /// Stature of the body, m; `None`: as the recording says.
    pub stature_m: Option<f64>,
    /// Poses per second of joint angles.
    pub rate_hz: f64,
    /// Rows of samples, also where joint angles are to be had.
    pub samples: bool,
    /// The file (.csv, .bvh, .mcap).
    pub file: PathBuf,
    /// It may replace one that is there.
    pub replace: bool,
}

/// What came of it.
#[derive(Clone, Debug, Serialize)]
pub struct RecordingReport {
    /// `done`, or `done_with_loss` if something is missing in the recording.
    pub outcome: Outcome,
    /// How much was written, and what is missing.
    pub notes: Vec<String>,
    /// Where.
    pub written: String,
}

/// Writes what a recording holds.
///
/// # Errors
/// A recording that cannot be read or does not know how its sensors were worn, an ending that nobody writes, a file that
/// exists or cannot be written.
pub fn convert_recording(order: &RecordingOrder) -> Result<RecordingReport, Error> {
    let kind = order.file.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
    if !["csv", "bvh", "mcap"].contains(&kind) || (order.samples && kind != "csv") {
        return Err(Error::of(ErrorKind::Unknown, "this kind of file cannot be written")
            .at(order.file.display().to_string())
            .allowed("a file that ends in .csv, .bvh or .mcap; with --samples .csv"));
    }
    marker_files::check_commas(&order.recording)?;
    let (outcome, notes) = if order.samples {
        samples(order)?
    } else {
        let start = recording::run_start(&order.recording)?;
        let metadata = start.as_ref().map(|start| start.metadata.clone()).unwrap_or_default();
        let is_of_robot = start.as_ref().is_some_and(|start| !start.joints.is_empty());
        // With a robot a table has what was recorded; the person whom it followed is in files of bodies.
        let is_table = kind == "csv" && is_of_robot;
        match worn(order, is_table)? {
            Some(kept) => angles(order, kind, &kept, metadata)?,
            None if kind == "csv" => samples(order)?,
            None if is_of_robot => {
                return Err(Error::new("this is a recording of a robot, and of no body")
                    .at(order.recording.display().to_string())
                    .allowed("OUT.csv: goals and measured angles, a row for each cycle")
                    .remedy(
                        "for a BVH of its joints: gaitway retarget FILE.mcap --robot ROBOT -o OUT.bvh",
                    ));
            }
            None => {
                return Err(Error::new("the recording does not know how its sensors were worn")
                    .at(order.recording.display().to_string())
                    .remedy(
                        "record it in a session (`gaitway record --session`), or name a calibration: \
                         --calibration-body FILE.toml",
                    ));
            }
        }
    };
    Ok(RecordingReport { outcome, notes, written: order.file.display().to_string() })
}

/// How the sensors were worn, if that is known.
fn worn(order: &RecordingOrder, is_table: bool) -> Result<Option<Kept>, Error> {
    let (text, place): (String, &Path) = match &order.calibration {
        Some(path) => (gaitway_profiles::read_text(path)?, path),
        None if is_table => return Ok(None),
        None => match recording::told_of_run(&order.recording, BODY_KEY)? {
            Some(text) => (text, &order.recording),
            None => return Ok(None),
        },
    };
    Kept::parse(&text).map(Some).map_err(|e| e.at(place.display().to_string()))
}

fn angles(
    order: &RecordingOrder,
    kind: &str,
    kept: &Kept,
    mut metadata: BTreeMap<String, String>,
) -> Result<(Outcome, Vec<String>), Error> {
    let from = order.recording.display().to_string();
    let series = recording::sensor_series(&order.recording)?;
    let body = match order.stature_m {
        Some(stature_m) => Proportions::of_stature(stature_m)?,
        None => body_of(&metadata)?,
    };
    let motion = WornMotion::of(&series, kept, body, order.rate_hz)
        .map_err(|e| if e.place.is_none() { e.at(from.clone()) } else { e })?;
    metadata.remove(BODY_KEY);
    metadata.insert("from".to_owned(), from);
    metadata.insert("subject".to_owned(), kept.subject.clone());
    match kind {
        "csv" => write_file(&order.file, order.replace, &motion.csv()?)?,
        "bvh" => write_file(&order.file, order.replace, motion.bvh().as_bytes())?,
        _ => motion.write_mcap(&order.file, order.replace, metadata)?,
    }
    let (count, silent) = (motion.angles.len(), motion.silent_samples());
    let mut notes = vec![format!(
        "{count} at {} Hz to {}",
        motion.rate_hz,
        order.file.display(),
        count = counted(count, "pose")
    )];
    let not_worn = motion.not_worn();
    if !not_worn.is_empty() {
        notes.push(format!("not worn, and therefore at rest: {}", not_worn.join(", ")));
    }
    notes.extend(doubted::told(&series, kept)?);
    if silent + series.missed > 0 {
        notes.push(format!(
            "{} {are} missing in the recording; sensors were silent in {silent}",
            counted(series.missed, "sample"),
            silent = counted(silent, "moment"),
            are = either(series.missed, "is", "are")
        ));
    }
    let is_whole = series.whole && silent + series.missed == 0;
    Ok((if is_whole { Outcome::Done } else { Outcome::DoneWithLoss }, notes))
}

/// One row per sample of a sensor, or per cycle of a robot.
fn samples(order: &RecordingOrder) -> Result<(Outcome, Vec<String>), Error> {
    let mut bytes = Vec::new();
    let rows = recording::write_csv(&order.recording, &mut bytes)?;
    write_file(&order.file, order.replace, &bytes)?;
    let mut notes = vec![format!("{} to {}", counted(rows.rows, "row"), order.file.display())];
    if rows.missing > 0 {
        notes.push(format!(
            "{} or {} missing in the recording",
            counted(rows.missing, "sample"),
            either(rows.missing, "reading is", "readings are")
        ));
    }
    if !rows.whole {
        notes.push(
            "the recording was cut off or is damaged: its last second may be missing".to_owned(),
        );
    }
    let is_whole = rows.whole && rows.missing == 0;
    Ok((if is_whole { Outcome::Done } else { Outcome::DoneWithLoss }, notes))
}
