//! Inertial sensors offline: out of tables and recordings, fused again if somebody wants that, as joint angles of
//! whoever wore them, or as a table of orientations.

pub use crate::capture::Mode;

use super::report::Outcome;
use super::table_text::text_of;
use crate::body::worn::kept::Kept;
use crate::body::worn::{HeadingBy, Mount};
use crate::body::{Proportions, segment_name};
use crate::draft;
use crate::error::{Error, ErrorKind, counted, either};
use crate::mocap::opensim;
use crate::recording::{self, SensorMoment, SensorSeries};
use crate::sensing::Wear;
use crate::session::angles::{WornMotion, body_of};
use crate::session::doubted;
use crate::session::files::{BODY_KEY, WORN_KEY};
use crate::session::tables::{self, DeclaredSensors};
use crate::table::TableWriter;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Bytes of a file that are looked at to see what it is.
const HEAD_BYTES: u64 = 1 << 16;
/// Most files of a folder of Xsens' texts.
const MAX_FILES: usize = 64;

/// Which sensors become which file.
#[derive(Clone, Debug, PartialEq)]
pub struct SensorsOrder {
    /// A recording, a table (.csv), Xsens' text (.txt) or a folder of them, OpenSim's orientations (.sto).
    pub sensors: PathBuf,
    /// What the columns are, how axes lie, how sensors were worn (TOML).
    pub declared: Option<PathBuf>,
    /// Who wears which sensor, in place of what is declared: a file, as `live --wear` reads it.
    pub wear: Option<PathBuf>,
    /// Somebody stands in N pose from one time to another, s since the first sample, in place of what is declared.
    pub n_pose_s: Option<[f64; 2]>,
    /// Orientations are found anew from raw samples.
    pub fuse: Option<Mode>,
    /// How the sensors were worn, in place of what is declared or recorded.
    pub calibration: Option<PathBuf>,
    /// Poses per second of joint angles.
    pub rate_hz: f64,
    /// Stature of the person, m; `None`: as the recording says, or 1.75.
    pub stature_m: Option<f64>,
    /// The file, whose ending says what is written.
    pub file: PathBuf,
    /// It may replace one that is there.
    pub replace: bool,
}

/// Reads when somebody stands in N pose: `FROM,TO`, s.
///
/// # Errors
/// Anything else.
pub fn span(text: &str) -> Result<[f64; 2], Error> {
    let (from, to) = text.split_once(',').unwrap_or_default();
    let second =
        |text: &str| text.trim().parse::<f64>().ok().filter(|s| s.is_finite() && *s >= 0.0);
    let span = second(from).zip(second(to)).filter(|(from_s, to_s)| from_s < to_s);
    let (from_s, to_s) = span.ok_or_else(|| {
        Error::of(ErrorKind::Malformed, "not a stretch of time")
            .got(text)
            .allowed("FROM,TO in seconds, such as 0,4")
    })?;
    Ok([from_s, to_s])
}

/// What came of it.
#[derive(Clone, Debug, Serialize)]
pub struct SensorsReport {
    /// `done`, or `done_with_loss` if something is missing.
    pub outcome: Outcome,
    /// Samples of each sensor.
    pub samples: BTreeMap<String, usize>,
    /// Sensors whose orientation was found from raw samples.
    pub fused: Vec<String>,
    /// Poses of joint angles written; null if orientations were.
    pub poses: Option<usize>,
    /// What a person should know.
    pub notes: Vec<String>,
    /// Where.
    pub written: String,
}

/// True if a file holds sensors and is no recording: Xsens' text or a folder, or OpenSim's orientations.
#[must_use]
pub fn is_table_of_sensors(path: &Path) -> bool {
    let is = |ending: &str| path.extension().is_some_and(|e| e.eq_ignore_ascii_case(ending));
    if is("sto") {
        let mut head = Vec::new();
        let read = std::fs::metadata(path).is_ok_and(|known| known.is_file())
            && File::open(path)
                .and_then(|file| file.take(HEAD_BYTES).read_to_end(&mut head))
                .is_ok();
        let head = String::from_utf8_lossy(&head).to_ascii_lowercase();
        return read && head.lines().any(|line| line.trim() == "datatype=quaternion");
    }
    is("txt") || path.is_dir()
}

/// Writes what sensors say.
///
/// # Errors
/// A file that cannot be read or whose columns nobody declared, sensors that cannot be fused, a calibration that
/// does not fit, another ending of the file, one that exists or cannot be written.
pub fn convert(order: &SensorsOrder) -> Result<SensorsReport, Error> {
    let kind = order.file.extension().and_then(|e| e.to_str()).unwrap_or_default();
    if !["csv", "bvh", "mcap"].contains(&kind) {
        return Err(Error::of(ErrorKind::Unknown, "this kind of file cannot be written")
            .at(order.file.display().to_string())
            .allowed("a file that ends in .csv, .bvh or .mcap"));
    }
    let in_file = |error: Error| error.in_file(&order.sensors);
    let mut declared = declaration(order.declared.as_deref())?;
    let (mut series, metadata) = read(order, &declared)?;
    let mut notes = Vec::new();
    // What was said when it was recorded.
    let recorded =
        metadata.get(WORN_KEY).map(|text| Wear::parse(text)).transpose().map_err(in_file)?;
    let wear = match &order.wear {
        Some(path) => {
            let wear = Wear::of(Vec::new(), &[path.display().to_string()])?;
            notes.extend(recorded.and_then(|recorded| otherwise(&recorded, &wear)));
            Some(wear)
        }
        None => recorded.filter(|_| order.n_pose_s.is_some() && !declared.is_worn()),
    };
    if order.n_pose_s.is_some() && wear.is_none() && !declared.is_worn() {
        let error = Error::new("nobody says who wears which sensor in that N pose");
        return Err(in_file(match metadata.contains_key(BODY_KEY) {
            true => error.remedy(
                "leave out --n-pose: the recording holds a calibration; or add --wear FILE to make another",
            ),
            false => error.remedy("add --wear FILE, or segments in the file of --sensors"),
        }));
    }
    if let Some(wear) = wear {
        let names = wear.places.iter().map(|place| place.sensor.as_str());
        declared.wear(names.zip(wear.worn()));
    }
    order.n_pose_s.into_iter().for_each(|from_to_s| declared.stands_in_n_pose(from_to_s));
    tables::check_worn(&series, &declared).map_err(in_file)?;
    let fused = tables::fuse(&mut series, &declared, order.fuse).map_err(in_file)?;
    let samples = series.sensors.iter().map(|(name, said)| (name.clone(), said.len())).collect();
    let kept = kept(order, &series, &declared, &metadata)?;
    let (bytes, poses, silent) = match (kept, kind) {
        (Some(kept), _) => {
            let body = match order.stature_m {
                Some(stature_m) => Proportions::of_stature(stature_m)?,
                None => body_of(&metadata)?,
            };
            notes.extend(kept.calibration.notes.iter().cloned());
            notes.push(facing(&kept));
            let motion = WornMotion::of(&series, &kept, body, order.rate_hz).map_err(in_file)?;
            let not_worn = motion.not_worn();
            if !not_worn.is_empty() {
                notes.push(format!("not worn, and therefore at rest: {}", not_worn.join(", ")));
            }
            notes.extend(doubted::told(&series, &kept).map_err(in_file)?);
            let bytes = match kind {
                "csv" => Some(motion.csv()?),
                "bvh" => Some(motion.bvh().into_bytes()),
                _ => {
                    let from = ("from".to_owned(), order.sensors.display().to_string());
                    motion.write_mcap(&order.file, order.replace, BTreeMap::from([from]))?;
                    None
                }
            };
            (bytes, Some(motion.angles.len()), motion.silent_samples())
        }
        (None, "csv") => (Some(orientations(&series)?), None, 0),
        (None, _) => {
            return Err(Error::new("nobody says how the sensors were worn")
                .in_file(&order.sensors)
                .remedy("name a calibration (--calibration-body FILE.toml), or declare segments and n_pose_s (--sensors FILE.toml)"));
        }
    };
    if let Some(bytes) = bytes {
        draft::write_file(&order.file, order.replace, &bytes)?;
    }
    if series.missed + silent > 0 {
        let missed = series.missed;
        notes.push(format!(
            "{missed} {are} missing; sensors were silent in {silent}",
            silent = counted(silent, "moment"),
            missed = counted(missed, "sample"),
            are = either(missed, "is", "are")
        ));
    }
    let is_whole = series.whole && series.missed + silent == 0;
    Ok(SensorsReport {
        outcome: if is_whole { Outcome::Done } else { Outcome::DoneWithLoss },
        samples,
        fused,
        poses,
        notes,
        written: order.file.display().to_string(),
    })
}

/// What a person should know who says that sensors were worn otherwise than the recording does.
fn otherwise(recorded: &Wear, wear: &Wear) -> Option<String> {
    let mut words: Vec<String> = recorded
        .places
        .iter()
        .filter(|place| !wear.places.contains(place))
        .map(|place| format!("{} on the {}", place.sensor, segment_name(place.segment)))
        .collect();
    words.sort();
    (!words.is_empty()).then(|| {
        format!(
            "the recording says that sensors were worn otherwise; --wear counts: {}",
            words.join(", ")
        )
    })
}

/// What is in a table of sensors.
#[derive(Clone, Debug, Serialize)]
pub struct SensorsOverview {
    /// `sensors`.
    pub format: &'static str,
    /// By name.
    pub sensors: BTreeMap<String, SensorFigures>,
    /// Samples that are missing, by their counters.
    pub missed: u64,
}

/// Whether a sample has a quantity.
type IsThere = fn(&SensorMoment) -> bool;

/// One sensor.
#[derive(Clone, Debug, Serialize)]
pub struct SensorFigures {
    /// Samples.
    pub samples: usize,
    /// Samples per second on average; null of fewer than two.
    pub rate_hz: Option<f64>,
    /// From the first to the last, s.
    pub duration_s: f64,
    /// What is measured: `rate`, `acceleration`, `field`, `orientation`.
    pub quantities: Vec<&'static str>,
    /// Of these, what some samples do not have.
    pub without: BTreeMap<&'static str, Without>,
}

/// Samples that lack what others have: a cell that is empty or no number.
#[derive(Clone, Debug, Serialize)]
pub struct Without {
    /// How many.
    pub samples: usize,
    /// When the first was taken, s after the sensor's first.
    pub first_s: f64,
}

/// Looks into a table of sensors, a text of Xsens' or a folder of them.
///
/// # Errors
/// A file that cannot be read, or is no such text; columns that are not as they are declared.
pub fn overview(path: &Path, declared: Option<&Path>) -> Result<SensorsOverview, Error> {
    let series = match ending_of(path).as_str() {
        "mcap" => recording::sensor_series(path)?,
        _ => table_of(path, &declaration(declared)?, declared.is_some())?,
    };
    let figures = |said: &Vec<SensorMoment>| {
        let span_ns = said.first().zip(said.last());
        let span_ns =
            span_ns.map_or(0, |(first, last)| last.taken_ns.saturating_sub(first.taken_ns));
        let duration_s = span_ns as f64 / 1e9;
        let rate_hz = said.len().saturating_sub(1) as f64 / duration_s;
        let is_there: [(&str, IsThere); 4] = [
            ("rate", |of| of.rate_rad_s.is_some()),
            ("acceleration", |of| of.acceleration_m_s2.is_some()),
            ("field", |of| of.field_t.is_some()),
            ("orientation", |of| of.orientation.is_some()),
        ];
        let there = is_there.into_iter().filter(|(_, is_there)| said.iter().any(is_there));
        let lacks = |(name, is_there): (&'static str, IsThere)| {
            let mut lacking = said.iter().filter(|of| !is_there(of));
            let first_ns = lacking.next()?.taken_ns.saturating_sub(said.first()?.taken_ns);
            let samples = 1 + lacking.count();
            Some((name, Without { samples, first_s: first_ns as f64 / 1e9 }))
        };
        let without = there.clone().filter_map(lacks).collect();
        SensorFigures {
            samples: said.len(),
            rate_hz: Some(rate_hz).filter(|rate_hz| rate_hz.is_finite() && *rate_hz > 0.0),
            duration_s,
            quantities: there.map(|(name, _)| name).collect(),
            without,
        }
    };
    let sensors = series.sensors.iter().map(|(name, said)| (name.clone(), figures(said))).collect();
    Ok(SensorsOverview { format: "sensors", sensors, missed: series.missed })
}

/// What a file declares of sensors; nothing without one.
fn declaration(path: Option<&Path>) -> Result<DeclaredSensors, Error> {
    let Some(path) = path else { return Ok(DeclaredSensors::default()) };
    let text = gaitway_profiles::read_text(path)?;
    DeclaredSensors::parse(&text).map_err(|error| error.in_file(path))
}

/// What the sensors said, and what a recording says beside that.
fn read(
    order: &SensorsOrder,
    declared: &DeclaredSensors,
) -> Result<(SensorSeries, BTreeMap<String, String>), Error> {
    let path = &order.sensors;
    if ending_of(path) == "mcap" {
        let series = recording::sensor_series(path)?;
        let metadata = series.start.as_ref().map(|start| start.metadata.clone());
        return Ok((series, metadata.unwrap_or_default()));
    }
    Ok((table_of(path, declared, order.declared.is_some())?, BTreeMap::new()))
}

/// What the sensors of a table said.
fn table_of(
    path: &Path,
    declared: &DeclaredSensors,
    is_declared: bool,
) -> Result<SensorSeries, Error> {
    let in_file = |error: Error| error.in_file(path);
    match ending_of(path).as_str() {
        "sto" | "mot" => tables::of_opensim(&opensim::read(path)?).map_err(in_file),
        "csv" if is_declared => tables::of_table(&text_of(path)?, declared).map_err(in_file),
        "csv" => Err(Error::new("what the columns of the table are is not declared")
            .in_file(path)
            .remedy("declare it in a file: --sensors FILE.toml (docs/capture.md)")),
        _ if path.is_dir() => of_folder(path),
        _ => one(path),
    }
}

fn ending_of(path: &Path) -> String {
    path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase()
}

/// The texts of a folder, a sensor each.
fn of_folder(path: &Path) -> Result<SensorSeries, Error> {
    let unreadable = |cause: std::io::Error| {
        Error::of((&cause).into(), "the folder cannot be read").in_file(path).got(cause.to_string())
    };
    let mut files = Vec::new();
    for entry in std::fs::read_dir(path).map_err(unreadable)? {
        let file = entry.map_err(unreadable)?.path();
        if file.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("txt")) {
            files.push(file);
        }
    }
    if files.is_empty() || files.len() > MAX_FILES {
        return Err(Error::of(ErrorKind::Absent, "no folder of Xsens' texts")
            .in_file(path)
            .got(format!("{} .txt files", files.len()))
            .allowed(format!("1 to {MAX_FILES}, one for each sensor")));
    }
    files.sort_unstable();
    let mut all = SensorSeries { whole: true, ..SensorSeries::default() };
    for file in &files {
        let found = one(file)?;
        all.missed = all.missed.saturating_add(found.missed);
        all.last_ns = all.last_ns.max(found.last_ns);
        all.sensors.extend(found.sensors);
    }
    Ok(all)
}

/// One text of Xsens', named by its file: what stands behind the last underscore is the device.
fn one(path: &Path) -> Result<SensorSeries, Error> {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let name = stem.rsplit('_').next().unwrap_or_default();
    tables::of_xsens(&text_of(path)?, name).map_err(|error| error.in_file(path))
}

/// What told which way each sensor faces, and how far its strap was off.
fn facing(kept: &Kept) -> String {
    let one = |mount: &Mount| {
        let off = mount.strapped_off_rad.filter(|_| mount.heading_by != HeadingBy::Strapping);
        let off = off.map(|rad| format!(", strap {:.0} deg off", rad.to_degrees().abs()));
        let (segment, by) = (segment_name(mount.segment), mount.heading_by.word());
        format!("{segment} ({by}{})", off.unwrap_or_default())
    };
    let all: Vec<String> = kept.calibration.mounts.iter().map(one).collect();
    format!("told which way a sensor faces: {}", all.join(", "))
}

/// How the sensors were worn: as asked for, as declared, as recorded.
fn kept(
    order: &SensorsOrder,
    series: &SensorSeries,
    declared: &DeclaredSensors,
    metadata: &BTreeMap<String, String>,
) -> Result<Option<Kept>, Error> {
    if let Some(path) = &order.calibration {
        let text = gaitway_profiles::read_text(path)?;
        return Kept::parse(&text).map(Some).map_err(|error| error.in_file(path));
    }
    let told =
        tables::calibrated(series, declared).map_err(|error| error.in_file(&order.sensors))?;
    if let Some(kept) = told {
        return Ok(Some(kept));
    }
    let recorded = metadata.get(BODY_KEY).map(|text| Kept::parse(text));
    recorded.transpose().map_err(|error| error.in_file(&order.sensors))
}

/// A row per sample: of which sensor, when, and how it was turned.
fn orientations(series: &SensorSeries) -> Result<Vec<u8>, Error> {
    let mut out = TableWriter::new(Vec::new());
    out.row([
        "sensor",
        "taken_s",
        "orientation_w",
        "orientation_x",
        "orientation_y",
        "orientation_z",
    ])?;
    let start_ns = series.start_ns();
    for (name, moments) in &series.sensors {
        for moment in moments {
            let taken_s = moment.taken_ns.saturating_sub(start_ns) as f64 / 1e9;
            let said = moment.orientation.map(|q| [q.w, q.x, q.y, q.z]);
            let said = said.map_or([const { String::new() }; 4], |q| q.map(|n| format!("{n:.9}")));
            let [w, x, y, z] = said;
            out.row([name.clone(), format!("{taken_s:.6}"), w, x, y, z])?;
        }
    }
    out.finish()
}
