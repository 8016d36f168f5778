//! A robot's motions as a `LeRobotDataset` of version 3 (huggingface/lerobot, `src/lerobot/datasets`): tables of frames, a row
//! group for each episode, and tables that say where each is. Angles are in rad, and the names of the columns say so.

use super::super::source::lerobot::{DATA_PATH, INFO};
use crate::columnar::{Column, ColumnKind, ColumnSpec, TableFile, TableSchema, Word};
use crate::draft::write_file;
use crate::error::{Error, ErrorKind};
use serde_json::{Map, Value, json};
use std::path::{Path, PathBuf};

/// Files of a folder, and the size of each: LeRobot's own.
const FILES_IN_CHUNK: usize = 1000;
const FILE_BYTES: usize = 100 << 20;
/// Bytes of a frame beside its joints.
const FRAME_BYTES: usize = 36;
/// Shares of values of which the greatest is told, as LeRobot names them.
const QUANTILES: [(&str, f64); 5] =
    [("q01", 0.01), ("q10", 0.1), ("q50", 0.5), ("q90", 0.9), ("q99", 0.99)];
const ACTION: &str = "action";
const STATE: &str = "observation.state";
/// Columns of whole numbers, of one each.
const COUNTS: [&str; 4] = ["frame_index", "episode_index", "index", "task_index"];

/// What one episode is made of.
pub struct Episode<'a> {
    /// What is done in it.
    pub task: &'a str,
    /// Where the joints were told to be, frame by frame, rad.
    pub action_rad: &'a [Vec<f64>],
    /// Where they were, rad.
    pub state_rad: &'a [Vec<f64>],
}

/// Statistics of a feature: a number for each of its joints.
#[derive(Clone)]
struct Figures {
    least: Vec<f64>,
    most: Vec<f64>,
    mean: Vec<f64>,
    deviation: Vec<f64>,
    quantiles: [Vec<f64>; 5],
    count: i64,
}

/// What is known of an episode that is written.
struct Written {
    task: String,
    length: i64,
    first: i64,
    chunk: i64,
    file: i64,
    figures: Vec<(String, Figures)>,
}

/// A dataset in the making.
pub struct Dataset<'a> {
    folder: &'a Path,
    robot: String,
    joints: Vec<String>,
    rate_hz: f64,
    frames: TableSchema,
    /// Row groups of the file that is being filled.
    groups: Vec<Vec<Column>>,
    bytes: usize,
    files: usize,
    episodes: Vec<Written>,
    tasks: Vec<String>,
    next: i64,
}

impl<'a> Dataset<'a> {
    /// An empty one in a folder, of a robot with these joints.
    ///
    /// # Errors
    /// Columns that the format cannot hold.
    pub fn new(
        folder: &'a Path,
        robot: &str,
        joints: Vec<String>,
        rate_hz: f64,
    ) -> Result<Self, Error> {
        let mut columns: Vec<ColumnSpec> = vec![
            (ACTION.to_owned(), ColumnKind::Singles),
            (STATE.to_owned(), ColumnKind::Singles),
            ("timestamp".to_owned(), ColumnKind::Single),
        ];
        columns.extend(COUNTS.map(|name| (name.to_owned(), ColumnKind::Whole)));
        Ok(Self {
            folder,
            robot: robot.to_owned(),
            joints,
            rate_hz,
            frames: TableSchema::new("schema", columns, &[])?,
            groups: Vec::new(),
            bytes: 0,
            files: 0,
            episodes: Vec::new(),
            tasks: Vec::new(),
            next: 0,
        })
    }

    /// Adds an episode, and gives its number.
    ///
    /// # Errors
    /// As the file system says.
    pub fn add(&mut self, of: &Episode<'_>) -> Result<u64, Error> {
        let count = of.action_rad.len();
        let number = self.episodes.len() as i64;
        let task = match self.tasks.iter().position(|known| known == of.task) {
            Some(task) => task,
            None => {
                self.tasks.push(of.task.to_owned());
                self.tasks.len() - 1
            }
        };
        let frames = 0..count as i64;
        let singles = |rows: &[Vec<f64>]| -> Vec<Vec<f32>> {
            rows.iter().map(|row| row.iter().map(|value| *value as f32).collect()).collect()
        };
        let (action, state) = (singles(of.action_rad), singles(of.state_rad));
        let time = |frame: i64| (frame as f64 / self.rate_hz) as f32;
        let times: Vec<f32> = frames.clone().map(time).collect();
        let counts: [Vec<i64>; 4] = [
            frames.clone().collect(),
            vec![number; count],
            frames.map(|frame| self.next + frame).collect(),
            vec![task as i64; count],
        ];
        let mut figures = vec![
            (ACTION.to_owned(), Figures::of(&action)),
            (STATE.to_owned(), Figures::of(&state)),
            (
                "timestamp".to_owned(),
                Figures::of(&times.iter().map(|t| vec![*t]).collect::<Vec<_>>()),
            ),
        ];
        figures.extend(COUNTS.iter().zip(&counts).map(|(name, values)| {
            let rows: Vec<Vec<f64>> = values.iter().map(|value| vec![*value as f64]).collect();
            ((*name).to_owned(), Figures::of(&rows))
        }));
        let bytes = count * (8 * self.joints.len() + FRAME_BYTES);
        if self.bytes > 0 && self.bytes + bytes > FILE_BYTES {
            self.flush()?;
        }
        let file = self.files;
        let mut group =
            vec![Column::Singles(action), Column::Singles(state), Column::Single(times)];
        group.extend(counts.map(|values| Column::Whole(values.into_iter().map(Some).collect())));
        self.groups.push(group);
        self.bytes += bytes;
        self.episodes.push(Written {
            task: of.task.to_owned(),
            length: count as i64,
            first: self.next,
            chunk: (file / FILES_IN_CHUNK) as i64,
            file: (file % FILES_IN_CHUNK) as i64,
            figures,
        });
        self.next += count as i64;
        Ok(number as u64)
    }

    /// Writes the file that is being filled.
    fn flush(&mut self) -> Result<(), Error> {
        let groups = std::mem::take(&mut self.groups);
        let (chunk, file) = (self.files / FILES_IN_CHUNK, self.files % FILES_IN_CHUNK);
        let name = format!("data/chunk-{chunk:03}/file-{file:03}.parquet");
        self.table(&name, &self.frames, &groups, Vec::new())?;
        self.files += 1;
        self.bytes = 0;
        Ok(())
    }

    fn table(
        &self,
        name: &str,
        schema: &TableSchema,
        groups: &[Vec<Column>],
        notes: Vec<(String, String)>,
    ) -> Result<(), Error> {
        let mut table = TableFile::new(schema, Vec::new(), notes)?;
        groups.iter().try_for_each(|group| table.write(group))?;
        self.write(name, &table.finish()?)
    }

    fn write(&self, name: &str, bytes: &[u8]) -> Result<(), Error> {
        let path: PathBuf = self.folder.join(name);
        let within = path.parent().unwrap_or(self.folder);
        std::fs::create_dir_all(within).map_err(|e| {
            Error::unwritten("the dataset cannot be written", &e).at(within.display().to_string())
        })?;
        // A run that did not get to its end may have left the same there.
        write_file(&path, true, bytes)
    }

    /// Writes what is left, and what says where all of it is.
    ///
    /// # Errors
    /// No episode; as the file system says.
    pub fn finish(mut self) -> Result<(), Error> {
        if self.episodes.is_empty() {
            return Err(Error::of(ErrorKind::Absent, "there is no episode to write"));
        }
        self.flush()?;
        self.write_tasks()?;
        self.write_episodes()?;
        let all = self.episodes.iter().map(|of| &of.figures);
        let of_feature = |at: usize| Figures::together(all.clone().map(|of| &of[at].1));
        let stats: Map<String, Value> = (0..self.episodes[0].figures.len())
            .map(|at| (self.episodes[0].figures[at].0.clone(), of_feature(at).told()))
            .collect();
        self.write_json("meta/stats.json", &Value::Object(stats))?;
        // Last: with it a folder is a dataset.
        self.write_json(INFO, &self.info())
    }

    fn write_json(&self, name: &str, value: &Value) -> Result<(), Error> {
        let text = serde_json::to_string_pretty(value)
            .map_err(|e| Error::new("the dataset cannot be described").got(e.to_string()))?;
        self.write(name, (text + "\n").as_bytes())
    }

    fn info(&self) -> Value {
        let names: Vec<String> = self.joints.iter().map(|joint| format!("{joint}_rad")).collect();
        let of_joints = json!({"dtype": "float32", "shape": [names.len()], "names": names});
        let one = |kind: &str| json!({"dtype": kind, "shape": [1], "names": null});
        let mut features = Map::new();
        features.insert(ACTION.to_owned(), of_joints.clone());
        features.insert(STATE.to_owned(), of_joints);
        features.insert("timestamp".to_owned(), one("float32"));
        features.extend(COUNTS.map(|name| (name.to_owned(), one("int64"))));
        let episodes = self.episodes.len();
        json!({
            "codebase_version": "v3.0",
            "robot_type": self.robot,
            "total_episodes": episodes,
            "total_frames": self.next,
            "total_tasks": self.tasks.len(),
            "chunks_size": FILES_IN_CHUNK,
            "data_files_size_in_mb": FILE_BYTES >> 20,
            "video_files_size_in_mb": 200,
            "fps": self.rate_hz.round() as i64,
            "splits": {"train": format!("0:{episodes}")},
            "data_path": DATA_PATH,
            "video_path": null,
            "features": features,
        })
    }

    /// Tasks, as pandas keeps a table whose rows are called by a text.
    fn write_tasks(&self) -> Result<(), Error> {
        let columns = [("task_index", ColumnKind::Whole), ("task", ColumnKind::Text)];
        let columns = columns.map(|(name, kind)| (name.to_owned(), kind)).to_vec();
        let schema = TableSchema::new("schema", columns, &[])?;
        let group = vec![
            Column::Whole((0..self.tasks.len() as i64).map(Some).collect()),
            Column::Text(self.tasks.iter().map(|task| Some(Word::from(task.as_str()))).collect()),
        ];
        let of = |name: &str, pandas: &str, numpy: &str| json!({"name": name, "field_name": name, "pandas_type": pandas, "numpy_type": numpy, "metadata": null});
        let about = json!({
            "index_columns": ["task"],
            "column_indexes": [{
                "name": null, "field_name": null, "pandas_type": "unicode", "numpy_type": "object",
                "metadata": {"encoding": "UTF-8"},
            }],
            "columns": [of("task_index", "int64", "int64"), of("task", "unicode", "object")],
            "creator": {"library": "gaitway", "version": env!("CARGO_PKG_VERSION")},
            "pandas_version": "2.0.0",
        });
        let notes = vec![("pandas".to_owned(), about.to_string())];
        self.table("meta/tasks.parquet", &schema, &[group], notes)
    }

    fn write_episodes(&self) -> Result<(), Error> {
        let all = &self.episodes;
        let whole = |of: &dyn Fn(&Written) -> i64| {
            Column::Whole(all.iter().map(|episode| Some(of(episode))).collect())
        };
        let tasks = all.iter().map(|of| vec![Word::from(of.task.as_str())]).collect();
        let numbers = (0..all.len() as i64).map(Some).collect();
        let mut columns = vec![
            ("episode_index".to_owned(), Column::Whole(numbers)),
            ("tasks".to_owned(), Column::Texts(tasks)),
            ("length".to_owned(), whole(&|of| of.length)),
            ("data/chunk_index".to_owned(), whole(&|of| of.chunk)),
            ("data/file_index".to_owned(), whole(&|of| of.file)),
            ("dataset_from_index".to_owned(), whole(&|of| of.first)),
            ("dataset_to_index".to_owned(), whole(&|of| of.first + of.length)),
            ("meta/episodes/chunk_index".to_owned(), whole(&|_| 0)),
            ("meta/episodes/file_index".to_owned(), whole(&|_| 0)),
        ];
        for (at, (feature, _)) in all[0].figures.iter().enumerate() {
            let reals = |of: &dyn Fn(&Figures) -> Vec<f64>| {
                Column::Reals(all.iter().map(|episode| of(&episode.figures[at].1)).collect())
            };
            let mut stat =
                |name: &str, column| columns.push((format!("stats/{feature}/{name}"), column));
            stat("min", reals(&|of| of.least.clone()));
            stat("max", reals(&|of| of.most.clone()));
            stat("mean", reals(&|of| of.mean.clone()));
            stat("std", reals(&|of| of.deviation.clone()));
            let counts = all.iter().map(|episode| vec![episode.figures[at].1.count]);
            stat("count", Column::Wholes(counts.collect()));
            for (quantile, (name, _)) in QUANTILES.iter().enumerate() {
                stat(name, reals(&|of| of.quantiles[quantile].clone()));
            }
        }
        let kind = |column: &Column| match column {
            Column::Whole(_) => ColumnKind::Whole,
            Column::Texts(_) => ColumnKind::Texts,
            Column::Wholes(_) => ColumnKind::Wholes,
            _ => ColumnKind::Reals,
        };
        let specs = columns.iter().map(|(name, column)| (name.clone(), kind(column))).collect();
        let schema = TableSchema::new("schema", specs, &[])?;
        let group: Vec<Column> = columns.into_iter().map(|(_, column)| column).collect();
        self.table("meta/episodes/chunk-000/file-000.parquet", &schema, &[group], Vec::new())
    }
}

impl Figures {
    /// Of rows of as many numbers each.
    fn of<T: Copy + Into<f64>>(rows: &[Vec<T>]) -> Self {
        let width = rows.first().map_or(0, Vec::len);
        let mut figures = Self {
            least: Vec::new(),
            most: Vec::new(),
            mean: Vec::new(),
            deviation: Vec::new(),
            quantiles: Default::default(),
            count: rows.len() as i64,
        };
        for at in 0..width {
            let mut values: Vec<f64> = rows.iter().map(|row| row[at].into()).collect();
            values.sort_by(f64::total_cmp);
            let count = values.len() as f64;
            let mean = values.iter().sum::<f64>() / count;
            let square = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / count;
            figures.least.push(values[0]);
            figures.most.push(values[values.len() - 1]);
            figures.mean.push(mean);
            figures.deviation.push(square.sqrt());
            for ((_, share), of) in QUANTILES.iter().zip(&mut figures.quantiles) {
                // On the straight line between the values around it.
                let place = share * (count - 1.0);
                let (below, above) = (place.floor() as usize, place.ceil() as usize);
                of.push(values[below] + (values[above] - values[below]) * place.fract());
            }
        }
        figures
    }

    /// Of several episodes, as LeRobot puts them together: quantiles as the mean of theirs.
    fn together<'a>(all: impl Iterator<Item = &'a Self> + Clone) -> Self {
        let count: i64 = all.clone().map(|of| of.count).sum();
        let weighed = |of: &dyn Fn(&Self, usize) -> f64, at: usize| {
            all.clone().map(|figures| of(figures, at) * figures.count as f64).sum::<f64>()
                / count as f64
        };
        let width = all.clone().next().map_or(0, |of| of.mean.len());
        let each = |of: &dyn Fn(usize) -> f64| (0..width).map(of).collect::<Vec<f64>>();
        let mean = each(&|at| weighed(&|of, at| of.mean[at], at));
        let square = |at: usize| {
            weighed(&|of, at| of.deviation[at].powi(2) + (of.mean[at] - mean[at]).powi(2), at)
        };
        Self {
            least: each(&|at| all.clone().map(|of| of.least[at]).fold(f64::INFINITY, f64::min)),
            most: each(&|at| all.clone().map(|of| of.most[at]).fold(f64::NEG_INFINITY, f64::max)),
            deviation: each(&|at| square(at).sqrt()),
            quantiles: std::array::from_fn(|quantile| {
                each(&|at| weighed(&|of, at| of.quantiles[quantile][at], at))
            }),
            mean,
            count,
        }
    }

    fn told(&self) -> Value {
        let mut told = json!({
            "min": self.least, "max": self.most, "mean": self.mean, "std": self.deviation,
            "count": [self.count],
        });
        for ((name, _), values) in QUANTILES.iter().zip(&self.quantiles) {
            told[*name] = json!(values);
        }
        told
    }
}
