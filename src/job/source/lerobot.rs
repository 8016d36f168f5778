//! An episode of a LeRobot dataset (version 3) as a motion of a robot's joints: `FOLDER#3`.
//!
//! What its numbers are stands in the names of its columns if Gaitway wrote it (`JOINT_rad`). LeRobot does not say it in
//! its files, so whoever names the episode has to: `FOLDER#3:deg`, or `FOLDER#3:range` where -100 to 100 is the range of a
//! joint. Its grippers are 0 to 100 of their range in both.

use super::joints::JointMotion;
use crate::columnar::TableReader;
use crate::error::{Error, ErrorKind, counted};
use crate::job::table_text::text_up_to;
use crate::robot::{Joint, Robot};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// The file by which such a folder is known.
pub const INFO: &str = "meta/info.json";
/// Where its frames are, as LeRobot names it.
pub const DATA_PATH: &str = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet";
/// Largest description read, bytes.
const MAX_INFO_BYTES: u64 = 16 << 20;
/// Most joints.
const MAX_JOINTS: usize = 256;
/// Most frames of an episode that is played: an hour at 100 of them a second.
const MAX_FRAMES: u64 = 360_000;
/// Most frames a second.
const MAX_FPS: f64 = 1000.0;
/// Most files of episodes that are looked through.
const MAX_FILES: usize = 10_000;

/// What numbers of joints are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Unit {
    Rad,
    Deg,
    Range,
}

impl Unit {
    const ALL: [(Self, &str); 3] = [(Self::Rad, "rad"), (Self::Deg, "deg"), (Self::Range, "range")];

    /// The angle that a number of a joint is, rad.
    fn angle_rad(self, value: f64, joint: &Joint) -> f64 {
        let (lower, upper) = (joint.limits.lower_rad(), joint.limits.upper_rad());
        let share = match self {
            Self::Rad => return value,
            _ if joint.name == "gripper" => value / 100.0,
            Self::Deg => return value.to_radians(),
            Self::Range => (value + 100.0) / 200.0,
        };
        lower + share * (upper - lower)
    }
}

/// The folder, the episode and the unit that a motion names, if it is an episode.
struct Named<'a> {
    folder: &'a Path,
    episode: Option<&'a str>,
}

fn named(motion: &str) -> Option<Named<'_>> {
    let is_dataset = |folder: &str| Path::new(folder).join(INFO).is_file();
    if is_dataset(motion) {
        return Some(Named { folder: Path::new(motion), episode: None });
    }
    let (folder, episode) = motion.rsplit_once('#')?;
    let named = Named { folder: Path::new(folder), episode: Some(episode) };
    is_dataset(folder).then_some(named)
}

/// True of a motion that is an episode of a dataset, or should be.
#[must_use]
pub fn is_named(motion: &str) -> bool {
    named(motion).is_some()
}

/// Reads an episode; none if `motion` names no dataset.
///
/// # Errors
/// No such episode, a dataset that is damaged, of another version or of other joints, a unit that nobody said.
pub fn read(motion: &str, robot: &Robot) -> Result<Option<JointMotion>, Error> {
    let Some(Named { folder, episode }) = named(motion) else { return Ok(None) };
    let info = Info::read(folder)?;
    let (number, unit) = chosen(motion, folder, episode, &info)?;
    let unit = match (unit, info.is_in_rad()) {
        (None, true) => Unit::Rad,
        (Some(unit), false) => unit,
        (Some(Unit::Rad), true) => Unit::Rad,
        (Some(_), true) => {
            return Err(Error::new("the columns of this dataset say that they are in rad")
                .at(motion)
                .allowed(format!("{}#{number}", folder.display())));
        }
        (None, false) => {
            return Err(Error::new("what the numbers of this dataset are is not said in it")
                .at(motion)
                .got(info.names.join(", "))
                .allowed(format!(
                    "{0}#{number}:deg (degrees from the middle of a joint's range, the gripper 0 to 100 of its range), \
                     {0}#{number}:range (-100 to 100 of the range), {0}#{number}:rad",
                    folder.display()
                ))
                .remedy("`use_degrees` of whoever recorded it with LeRobot tells which: true is deg, false is range"));
        }
    };
    let joints = info.joints(robot)?;
    let mut rows = info.rows(folder, number)?;
    for row in &mut rows {
        for (value, joint) in row.iter_mut().zip(&joints) {
            *value = unit.angle_rad(*value, joint);
        }
    }
    let names: Vec<String> = joints.iter().map(|joint| joint.name.clone()).collect();
    // What LeRobot recorded was led by somebody's hand.
    let motion = JointMotion::even("lerobot", &names, &rows, info.fps, !info.is_in_rad());
    Ok(Some(motion))
}

/// Which episode is meant, and in which unit it is, if that is said.
fn chosen(
    motion: &str,
    folder: &Path,
    episode: Option<&str>,
    info: &Info,
) -> Result<(u64, Option<Unit>), Error> {
    let shown = folder.display();
    let last = info.episodes.saturating_sub(1);
    let allowed = format!("{shown}#0 to {shown}#{last}");
    let none = |error: Error| error.at(motion).allowed(allowed.clone());
    if info.episodes == 0 {
        return Err(Error::of(ErrorKind::Absent, "the dataset holds no episode").at(motion));
    }
    let Some(text) = episode else {
        return Err(none(Error::new("which episode is meant is not said")));
    };
    let (number, unit) = match text.split_once(':') {
        None => (text, None),
        Some((number, word)) => {
            let known = Unit::ALL.into_iter().find(|(_, of)| *of == word);
            let (unit, _) = known.ok_or_else(|| {
                Error::of(ErrorKind::Unknown, "there is no such unit")
                    .at(motion)
                    .got(word)
                    .allowed("rad, deg or range")
            })?;
            (number, Some(unit))
        }
    };
    let number: u64 = number
        .parse()
        .map_err(|_| none(Error::of(ErrorKind::Malformed, "not an episode's number").got(text)))?;
    if number > last {
        return Err(none(
            Error::of(ErrorKind::Absent, "there is no such episode").got(number.to_string()),
        ));
    }
    Ok((number, unit))
}

/// What a dataset says of itself, for a person.
///
/// # Errors
/// A dataset that is damaged, or of another version.
pub fn overview(folder: &Path) -> Result<Vec<(&'static str, String)>, Error> {
    let info = Info::read(folder)?;
    let unit = if info.is_in_rad() { "rad" } else { "not said: deg or range" };
    Ok(vec![
        ("robot", info.robot),
        ("episodes", info.episodes.to_string()),
        ("frames", format!("{}, {} a second", info.frames, info.fps)),
        ("tasks", info.tasks.to_string()),
        ("joints", info.names.join(", ")),
        ("of", info.column.to_owned()),
        ("unit", unit.to_owned()),
    ])
}

/// What a dataset says of itself.
struct Info {
    robot: String,
    frames: u64,
    tasks: u64,
    fps: f64,
    episodes: u64,
    /// `action`, or what was measured where nobody commanded.
    column: &'static str,
    names: Vec<String>,
}

impl Info {
    fn read(folder: &Path) -> Result<Self, Error> {
        let path = folder.join(INFO);
        let wrong = |what: &str| {
            Error::of(ErrorKind::Malformed, what.to_owned()).at(path.display().to_string())
        };
        let text = text_up_to(&path, MAX_INFO_BYTES)?;
        let info: Value = serde_json::from_str(&text)
            .map_err(|e| wrong("the dataset cannot be understood").got(e.to_string()))?;
        let version = info["codebase_version"].as_str().unwrap_or_default();
        if !version.starts_with("v3.") {
            return Err(wrong("a dataset of another version")
                .got(if version.is_empty() { "no codebase_version" } else { version })
                .allowed("v3.0")
                .remedy("LeRobot converts its older ones: `python -m lerobot.datasets.v30.convert_dataset_v21_to_v30`"));
        }
        let fps = info["fps"].as_f64().unwrap_or_default();
        if !(fps > 0.0 && fps <= MAX_FPS) {
            return Err(wrong("no frames a second that can be played")
                .got(info["fps"].to_string())
                .allowed(format!("fps above 0 and at most {MAX_FPS}")));
        }
        if info["data_path"].as_str().is_some_and(|path| path != DATA_PATH) {
            return Err(wrong("its frames are not where LeRobot puts them")
                .got(info["data_path"].to_string())
                .allowed(DATA_PATH));
        }
        let features = &info["features"];
        let column =
            ["action", "observation.state"].into_iter().find(|of| features[of].is_object());
        let column = column.ok_or_else(|| {
            wrong("a dataset without joints").allowed("a feature action, or observation.state")
        })?;
        let names = names(&features[column]["names"]);
        let width = features[column]["shape"].as_array().filter(|of| of.len() == 1);
        let width = width.and_then(|of| of[0].as_u64()).unwrap_or(0);
        if width == 0 || width > MAX_JOINTS as u64 || names.len() as u64 != width {
            return Err(wrong("it does not name each of its joints")
                .got(format!(
                    "{column}: shape {}, {}",
                    features[column]["shape"],
                    counted(names.len(), "name")
                ))
                .allowed(format!("shape [N] and N names, at most {MAX_JOINTS}")));
        }
        let count = |name: &str| info[name].as_u64().unwrap_or(0);
        Ok(Self {
            robot: info["robot_type"].as_str().unwrap_or("not said").to_owned(),
            frames: count("total_frames"),
            tasks: count("total_tasks"),
            fps,
            episodes: count("total_episodes"),
            column,
            names,
        })
    }

    /// True if the columns say that they are angles in rad.
    fn is_in_rad(&self) -> bool {
        self.names.iter().all(|name| name.ends_with("_rad"))
    }

    /// The robot's joints, column by column.
    fn joints<'a>(&self, robot: &'a Robot) -> Result<Vec<&'a Joint>, Error> {
        let mut joints: Vec<&Joint> = Vec::with_capacity(self.names.len());
        for name in &self.names {
            let plain = name.strip_suffix("_rad").or_else(|| name.strip_suffix(".pos"));
            let plain = plain.unwrap_or(name);
            let joint = robot.joints.iter().find(|joint| joint.name == plain).ok_or_else(|| {
                Error::of(
                    ErrorKind::Unknown,
                    "the dataset names a joint that the robot does not have",
                )
                .at(format!("robot {}", robot.name))
                .got(name.clone())
                .allowed(robot.joint_names().join(", "))
            })?;
            if joints.iter().any(|known| known.name == joint.name) {
                return Err(Error::of(ErrorKind::Malformed, "a joint is named twice")
                    .at(INFO)
                    .got(name.clone())
                    .allowed("each joint once"));
            }
            joints.push(joint);
        }
        Ok(joints)
    }

    /// The numbers of an episode, frame by frame.
    fn rows(&self, folder: &Path, episode: u64) -> Result<Vec<Vec<f64>>, Error> {
        let Place { file, length } = place(folder, episode)?;
        let path = folder.join(&file);
        let wrong = |what: &str, got: String| {
            Error::of(ErrorKind::Malformed, what.to_owned())
                .at(format!("{}, episode {episode}", path.display()))
                .got(got)
        };
        let table = TableReader::open(&path)?;
        let mut rows = Vec::new();
        for group in 0..table.groups() {
            let at = |error: Error| error.in_file(&path);
            let of = table.column(group, "episode_index", None).map_err(at)?;
            let numbered = |row: &usize| of.whole(*row) == i64::try_from(episode).ok();
            let Some(first) = (0..of.len()).find(numbered) else { continue };
            let end = (first..of.len()).find(|row| !numbered(row)).unwrap_or(of.len());
            if (rows.len() + end - first) as u64 > length {
                break;
            }
            let numbers =
                table.lists(group, self.column, first..end, self.names.len()).map_err(at)?;
            rows.extend(numbers);
        }
        if rows.len() as u64 != length {
            let got = format!("{}, {length} told", counted(rows.len(), "frame"));
            return Err(wrong("an episode has more or fewer frames than its dataset tells", got));
        }
        if let Some(frame) = rows.iter().position(|row| row.iter().any(|value| !value.is_finite()))
        {
            return Err(wrong("a joint's number is none", format!("frame {frame}")));
        }
        if rows.len() < 2 {
            return Err(wrong("an episode needs two frames at least", format!("{length}")));
        }
        Ok(rows)
    }
}

/// Names of columns: a list, a list in a list, or a list under a heading (`motors`).
fn names(of: &Value) -> Vec<String> {
    let inner = match of {
        Value::Array(all) if all.len() == 1 && all[0].is_array() => &all[0],
        Value::Object(all) if all.len() == 1 => all.values().next().unwrap_or(of),
        _ => of,
    };
    let all = inner.as_array().map(Vec::as_slice).unwrap_or_default();
    all.iter().filter_map(Value::as_str).map(str::to_owned).collect()
}

/// Where the frames of an episode are, and how many it has.
struct Place {
    file: PathBuf,
    length: u64,
}

fn place(folder: &Path, episode: u64) -> Result<Place, Error> {
    let within = folder.join("meta/episodes");
    let missing = || {
        Error::of(ErrorKind::Absent, "the dataset does not say where an episode is")
            .at(within.display().to_string())
            .got(format!("episode {episode}"))
            .allowed("a row for each in chunk-000/file-000.parquet and those after it")
    };
    for path in tables(&within)? {
        let table = TableReader::open(&path)?;
        for group in 0..table.groups() {
            let column =
                |name: &str| table.column(group, name, None).map_err(|error| error.in_file(&path));
            let all = column("episode_index")?;
            let Some(row) =
                (0..all.len()).find(|row| all.whole(*row) == i64::try_from(episode).ok())
            else {
                continue;
            };
            let number = |name: &str| -> Result<u64, Error> {
                let told = column(name)?.whole(row).and_then(|of| u64::try_from(of).ok());
                told.ok_or_else(|| {
                    Error::of(ErrorKind::Malformed, "the dataset does not say where an episode is")
                        .in_file(&path)
                        .got(format!("episode {episode}: no {name}"))
                })
            };
            let length = number("length")?;
            if length > MAX_FRAMES {
                return Err(Error::of(ErrorKind::OutsideLimits, "an episode is too long")
                    .in_file(&path)
                    .got(format!("episode {episode}: {length}", length = counted(length, "frame")))
                    .allowed(format!("at most {MAX_FRAMES}")));
            }
            let (chunk, file) = (number("data/chunk_index")?, number("data/file_index")?);
            let file = PathBuf::from(format!("data/chunk-{chunk:03}/file-{file:03}.parquet"));
            return Ok(Place { file, length });
        }
    }
    Err(missing())
}

/// The tables of a folder of folders, in order.
fn tables(folder: &Path) -> Result<Vec<PathBuf>, Error> {
    let listed = |path: &Path| -> Result<Vec<PathBuf>, Error> {
        let unreadable = |e: std::io::Error| {
            Error::of((&e).into(), "the dataset cannot be read")
                .at(path.display().to_string())
                .got(e.to_string())
        };
        let entries = std::fs::read_dir(path).map_err(unreadable)?;
        let mut paths: Vec<PathBuf> =
            entries.flatten().take(MAX_FILES).map(|entry| entry.path()).collect();
        paths.sort();
        Ok(paths)
    };
    let mut found = Vec::new();
    for chunk in listed(folder)?.iter().filter(|path| path.is_dir()) {
        let all = listed(chunk)?;
        found.extend(
            all.into_iter().filter(|path| path.extension().is_some_and(|of| of == "parquet")),
        );
        found.truncate(MAX_FILES);
    }
    Ok(found)
}
