//! Trials passed on: as files of their own, with what they are and what may be done with them.

use super::super::retarget::{LearnerFile, RobotClip, robot_clip};
use super::super::source::joints;
use super::lerobot::{Dataset, Episode};
use super::trial::capture_of;
use crate::body::Proportions;
use crate::corpus::licence::Licence;
use crate::corpus::query::Question;
use crate::corpus::rows::{Consent, TrialEntry};
use crate::corpus::select::Selection;
use crate::corpus::store::{Store, check_outside};
use crate::corpus::tables::TrialFrames;
use crate::corpus::version::ExportNote;
use crate::draft::write_file;
use crate::error::{Error, ErrorKind};
use crate::job::npz;
use crate::job::pending::go_on;
use crate::job::report::Outcome;
use crate::job::{Event, Observer};
use crate::mocap::markers::FramesOf;
use crate::mocap::{bvh, c3d, export};
use crate::recording;
use crate::robot::Robot;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// In which form trials are passed on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExportFormat {
    /// The body model in motion, a BVH file for each.
    Bvh,
    /// Markers on joints and ends of the body model, a C3D file for each.
    C3d,
    /// Turns of the body model's segments as axes and angles, a `.npz` for each with the keys of AMASS.
    AxisAngle,
    /// The files that were added, byte for byte: C3D where it was markers.
    Source,
    /// Labels of frames, a line for each: 1.0, 0.5 or 0.0, in `TRIAL/LABEL.txt`.
    Labels,
    /// On a robot's joints, as learners read it.
    Robot(LearnerFile),
    /// A `LeRobotDataset` of version 3: an episode for each, 30 frames a second.
    Lerobot,
}

impl ExportFormat {
    /// All of them.
    pub const ALL: [Self; 9] = [
        Self::Bvh,
        Self::C3d,
        Self::AxisAngle,
        Self::Source,
        Self::Labels,
        Self::Robot(LearnerFile::RobotCsv),
        Self::Robot(LearnerFile::RobotNpz),
        Self::Robot(LearnerFile::UnitreeCsv),
        Self::Lerobot,
    ];

    /// As a word.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Bvh => "bvh",
            Self::C3d => "c3d",
            Self::AxisAngle => "axis-angle",
            Self::Source => "source",
            Self::Labels => "labels",
            Self::Robot(file) => file.word(),
            Self::Lerobot => "lerobot",
        }
    }

    /// By its word.
    ///
    /// # Errors
    /// Another word.
    pub fn of(word: &str) -> Result<Self, Error> {
        Self::ALL.into_iter().find(|format| format.word() == word).ok_or_else(|| {
            Error::of(ErrorKind::Unknown, "there is no such format").at("--format").none_of(
                word,
                Self::ALL.map(Self::word),
                "take one of these",
            )
        })
    }

    /// Rows a second of what is written of a robot; nothing if it is not of one.
    const fn robot_hz(self) -> Option<f64> {
        match self {
            Self::Robot(file) => Some(file.rate_hz()),
            Self::Lerobot => Some(30.0),
            _ => None,
        }
    }

    /// True if what is written is made of the motion, and is not the motion as it was added.
    const fn is_derived(self) -> bool {
        !matches!(self, Self::Source)
    }
}

/// What tells of an export, in its folder.
const ABOUT: &str = "export.json";
/// What is being written there, until it is whole.
const BEGUN: &str = ".export-begun.json";

/// What is to be passed on.
#[derive(Clone, Debug)]
pub struct ExportOrder {
    /// The folder of the corpus.
    pub corpus: PathBuf,
    /// Which trials; all if it is empty.
    pub question: String,
    /// In which form.
    pub format: ExportFormat,
    /// The robot, by name or file, where it is one.
    pub robot: Option<String>,
    /// A folder of recordings of trials that were played, for `lerobot`.
    pub recordings: Option<PathBuf>,
    /// The folder, which is empty, does not exist yet, or holds a part of the same export.
    pub folder: PathBuf,
}

/// What was passed on: the report, and `export.json` in the folder.
#[derive(Clone, Debug, Serialize)]
pub struct ExportReport {
    /// `done`, or `done_with_loss` if something could not be passed on.
    pub outcome: Outcome,
    /// What the corpus is called.
    pub corpus: String,
    /// Its version.
    pub version: String,
    /// Which trials.
    pub question: String,
    /// In which form.
    pub format: &'static str,
    /// The robot.
    pub robot: Option<String>,
    /// Its joints, in the order of the columns.
    pub joints: Vec<String>,
    /// Rows a second, where that is one for all.
    pub rate_hz: Option<f64>,
    /// True if one of them is not for what earns money: then none of it is.
    pub noncommercial: bool,
    /// How many are under which licence.
    pub licences: BTreeMap<String, u64>,
    /// How many have no licence that anybody said: ask before you pass them on.
    pub unlicensed: u64,
    /// What is there.
    pub trials: Vec<ExportedTrial>,
    /// What was not passed on, and why.
    pub withheld: Vec<Withheld>,
    /// The folder.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub written: String,
}

/// A trial that was passed on.
#[derive(Clone, Debug, Serialize)]
pub struct ExportedTrial {
    /// Its files, from the folder on.
    pub files: Vec<String>,
    /// How much slower than the person the robot does it, at most.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub retime_factor: Option<f64>,
    /// When the robot would fall, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub predicted_fall_s: Option<f64>,
    /// Its episodes in the dataset.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub episodes: Vec<u64>,
    /// The recordings that these are, where it was played.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub recordings: Vec<String>,
    /// What it is.
    #[serde(flatten)]
    pub entry: TrialEntry,
}

impl ExportedTrial {
    fn of(entry: &TrialEntry) -> Self {
        Self {
            files: Vec::new(),
            retime_factor: None,
            predicted_fall_s: None,
            episodes: Vec::new(),
            recordings: Vec::new(),
            entry: entry.clone(),
        }
    }
}

/// A trial that was not passed on.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Withheld {
    /// Its id.
    pub trial: String,
    /// What it is called.
    pub name: String,
    /// Why.
    pub why: String,
}

/// Which export it is: the same is gone on with.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Begun {
    version: String,
    question: String,
    format: String,
    robot: Option<String>,
    #[serde(default)]
    recordings: Option<PathBuf>,
}

/// Passes trials on.
///
/// # Errors
/// No corpus, one that somebody else changes, a question that cannot be understood, a folder that holds something else, no
/// trial that may be passed on; a wish to stop: given again, it goes on.
pub fn export(order: &ExportOrder, observer: &dyn Observer) -> Result<ExportReport, Error> {
    check_outside(&order.folder)?;
    let question = Question::parse(&order.question)?;
    let robot = robot_of(order)?;
    let joints = match (&robot, order.format) {
        (Some(robot), ExportFormat::Robot(file)) => file.joints(robot)?,
        (Some(robot), _) => robot.joint_names(),
        (None, _) => Vec::new(),
    };
    let played = match (&robot, &order.recordings) {
        (Some(robot), Some(folder)) => recordings(folder, robot)?,
        _ => Recordings::new(),
    };
    let mut store = Store::open_to_change(&order.corpus)?;
    let (may, withheld) = chosen(order, &store, &question)?;
    if may.is_empty() {
        let why = withheld.first().map_or("no trial answers the question", |of| &of.why);
        return Err(Error::of(ErrorKind::Absent, "there is nothing to pass on").got(why));
    }
    begin(order, &store)?;
    // Noted before the first file is there: it stays known that something went there, whatever happens.
    let subjects: BTreeSet<String> = may.iter().filter_map(|of| of.subject.clone()).collect();
    store.note_export(ExportNote {
        path: super::shown(
            &std::path::absolute(&order.folder).unwrap_or_else(|_| order.folder.clone()),
        ),
        format: order.format.word().to_owned(),
        version: store.version().version.clone(),
        trials: may.len() as u64,
        subjects: subjects.into_iter().collect(),
    })?;
    let mut licences = BTreeMap::new();
    may.iter().for_each(|of| *licences.entry(of.licence.clone()).or_default() += 1);
    let mut report = ExportReport {
        outcome: Outcome::Done,
        corpus: store.manifest().name.clone(),
        version: store.version().version.clone(),
        question: order.question.clone(),
        format: order.format.word(),
        robot: robot.as_ref().map(|robot| robot.name.clone()),
        joints,
        rate_hz: order.format.robot_hz(),
        noncommercial: may.iter().any(|of| of.noncommercial),
        licences,
        unlicensed: may.iter().filter(|of| Licence::of(&of.licence).unknown).count() as u64,
        trials: Vec::new(),
        withheld,
        written: String::new(),
    };
    let mut dataset = match (&robot, order.format) {
        (Some(robot), ExportFormat::Lerobot) => {
            let rate_hz = order.format.robot_hz().unwrap_or_default();
            Some(Dataset::new(&order.folder, &robot.name, robot.joint_names(), rate_hz)?)
        }
        _ => None,
    };
    let mut writing =
        Writing { order, store: &store, robot: robot.as_ref(), played, report: &mut report };
    writing.all(&may, &mut dataset, observer)?;
    if let Some(dataset) = dataset {
        dataset.finish()?;
    }
    if !report.withheld.is_empty() {
        report.outcome = Outcome::DoneWithLoss;
    }
    let text = serde_json::to_string_pretty(&report)
        .map_err(|e| Error::new("the export cannot be described").got(e.to_string()))?;
    write_file(&order.folder.join(ABOUT), true, (text + "\n").as_bytes())?;
    fs::remove_file(order.folder.join(BEGUN)).map_err(|e| unwritable(&order.folder, &e))?;
    report.written = super::shown(&order.folder);
    Ok(report)
}

/// The robot of those formats that know one.
fn robot_of(order: &ExportOrder) -> Result<Option<Robot>, Error> {
    if let Some(folder) =
        order.recordings.as_ref().filter(|_| order.format != ExportFormat::Lerobot)
    {
        return Err(Error::new("this format knows no recordings")
            .at("--recordings")
            .got(folder.display().to_string())
            .allowed("--format lerobot"));
    }
    match (order.format.robot_hz(), &order.robot) {
        (Some(_), Some(name)) => Robot::load(name).map(Some),
        (Some(_), None) => Err(Error::new("no robot is named").remedy("--robot NAME")),
        (None, Some(name)) => Err(Error::new("this format knows no robot")
            .at("--robot")
            .got(name.clone())
            .allowed("--format robot-csv, robot-npz, unitree-csv or lerobot")),
        (None, None) => Ok(None),
    }
}

/// By the id of a trial: recordings of a robot that played it.
type Recordings = BTreeMap<String, Vec<PathBuf>>;

/// The recordings of a folder in which this robot played what was exported: `NAME-TRIAL.csv`.
fn recordings(folder: &Path, robot: &Robot) -> Result<Recordings, Error> {
    let unreadable = |e: std::io::Error| {
        Error::of((&e).into(), "the recordings cannot be read")
            .at(folder.display().to_string())
            .got(e.to_string())
    };
    let entries = fs::read_dir(folder).map_err(unreadable)?;
    let mut paths: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    paths.sort();
    let mut found = Recordings::new();
    for path in paths.into_iter().filter(|path| path.extension().is_some_and(|of| of == "mcap")) {
        let Some(start) = recording::run_start(&path)? else { continue };
        let stem = Path::new(&start.motion).file_stem().and_then(|stem| stem.to_str());
        let id = stem.and_then(|stem| stem.rsplit('-').next()).unwrap_or_default();
        if start.robot == robot.name && !id.is_empty() {
            found.entry(id.to_owned()).or_default().push(path);
        }
    }
    if found.is_empty() {
        return Err(Error::of(ErrorKind::Absent, "no recording of this robot is there")
            .at(folder.display().to_string())
            .allowed(format!(
                "recordings (.mcap) of {} while it played files of an export: \
                 `gaitway play kicks/set/action/NAME-TRIAL.csv --robot {} --record a.mcap`",
                robot.name, robot.name
            )));
    }
    Ok(found)
}

/// Trials that may be passed on, and those that may not.
fn chosen(
    order: &ExportOrder,
    store: &Store,
    question: &Question,
) -> Result<(Vec<TrialEntry>, Vec<Withheld>), Error> {
    let people: BTreeMap<String, Consent> =
        store.subjects()?.into_iter().map(|of| (of.subject.id, of.consent)).collect();
    let (mut may, mut withheld) = (Vec::new(), Vec::new());
    Selection::new(store, question, false)?.trials(u64::MAX, |entry| {
        let consent = entry.subject.as_ref().and_then(|id| people.get(id));
        let why = if matches!(consent, Some(Consent::Internal | Consent::Withdrawn)) {
            Some("the person did not allow it to be passed on")
        } else if order.format.is_derived() && Licence::of(&entry.licence).no_derivatives {
            Some("its licence forbids to pass on what is made of it: --format source passes on the file itself")
        } else if order.format == ExportFormat::Source && entry.source_file.is_none() {
            Some("it was made of no file")
        } else if (order.format == ExportFormat::Bvh || order.format.robot_hz().is_some())
            && entry.place.is_none() {
            Some("its frames are not kept")
        } else {
            None
        };
        match why {
            None => may.push(entry),
            Some(why) => {
                withheld.push(Withheld { trial: entry.trial, name: entry.name, why: why.to_owned() });
            }
        }
        Ok(())
    })?;
    Ok((may, withheld))
}

fn unwritable(path: &Path, cause: &std::io::Error) -> Error {
    Error::unwritten("the export cannot be written", cause).at(path.display().to_string())
}

/// What a finished export says of itself.
#[derive(Deserialize)]
struct Finished {
    version: String,
    question: String,
    format: String,
    robot: Option<String>,
}

/// A folder for it: empty, or with a part of the same.
fn begin(order: &ExportOrder, store: &Store) -> Result<(), Error> {
    let folder = &order.folder;
    if folder.exists() && !folder.is_dir() {
        return Err(Error::of(ErrorKind::Exists, "there is a file where a folder is to be")
            .at(folder.display().to_string())
            .remedy("choose another folder, or a name that does not exist yet"));
    }
    fs::create_dir_all(folder).map_err(|e| unwritable(folder, &e))?;
    let begun = Begun {
        version: store.version().version.clone(),
        question: order.question.clone(),
        format: order.format.word().to_owned(),
        robot: order.robot.clone(),
        recordings: order.recordings.clone(),
    };
    let path = folder.join(BEGUN);
    let known = fs::read_to_string(&path).ok().and_then(|text| serde_json::from_str(&text).ok());
    if known.is_some_and(|known: Begun| known == begun) {
        return Ok(());
    }
    let about = fs::read_to_string(folder.join(ABOUT)).unwrap_or_default();
    if let Ok(done) = serde_json::from_str::<Finished>(&about)
        && done.version == begun.version
        && done.question == begun.question
        && done.format == begun.format
        && done.robot.is_some() == begun.robot.is_some()
    {
        return Err(Error::of(ErrorKind::Exists, "this export is there already, and whole")
            .at(folder.display().to_string())
            .got(format!("{} of version {}", done.format, done.version))
            .remedy(
                "nothing is to be done; to make it again, choose another folder or remove this one",
            ));
    }
    let is_left = |name: &str| name.starts_with(BEGUN) && name.ends_with(".part");
    let entries = fs::read_dir(folder).map_err(|e| unwritable(folder, &e))?;
    if let Some(entry) = entries.flatten().find(|e| !e.file_name().to_str().is_some_and(is_left)) {
        return Err(Error::of(
            ErrorKind::Exists,
            "the folder is not empty, and holds no part of this export",
        )
        .at(folder.display().to_string())
        .got(entry.file_name().display().to_string())
        .remedy("choose another folder, or a name that does not exist yet"));
    }
    let text = serde_json::to_vec_pretty(&begun)
        .map_err(|e| Error::new("the export cannot be described").got(e.to_string()))?;
    write_file(&path, true, &text)
}

/// By the id of a trial: label, first and last frame, value.
type Marked = BTreeMap<String, Vec<(String, [usize; 2], f64)>>;

struct Writing<'a> {
    order: &'a ExportOrder,
    store: &'a Store,
    robot: Option<&'a Robot>,
    played: Recordings,
    report: &'a mut ExportReport,
}

/// A name as a part of a file's.
/// The file of a trial, from the folder on and without its ending.
pub fn stem_of(entry: &TrialEntry) -> String {
    let [set, action, name] = [&entry.set, &entry.action, &entry.name].map(|of| plain(of));
    format!("{set}/{action}/{name}-{}", entry.trial)
}

fn plain(name: &str) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() || "-_.".contains(c) { c } else { '_' };
    let plain: String = name.chars().take(60).map(plain).collect();
    plain.trim_start_matches('.').to_owned()
}

impl Writing<'_> {
    fn all(
        &mut self,
        trials: &[TrialEntry],
        dataset: &mut Option<Dataset<'_>>,
        observer: &dyn Observer,
    ) -> Result<(), Error> {
        let total = trials.len() as u64;
        let labels = match self.order.format {
            ExportFormat::Labels => self.labels()?,
            _ => Marked::new(),
        };
        for (done, entry) in trials.iter().enumerate() {
            observer.hear(Event::Step { done: done as u64, total, what: "trials" });
            go_on(observer)?;
            let one = match dataset {
                Some(dataset) => self.episodes(entry, dataset),
                None => self.one(entry, &labels),
            };
            match one {
                Ok(exported) => self.report.trials.push(exported),
                // What a robot cannot do is told; what cannot be written ends it.
                Err(error) if self.robot.is_some() && error.kind != ErrorKind::Io => {
                    let (trial, name) = (entry.trial.clone(), entry.name.clone());
                    self.report.withheld.push(Withheld { trial, name, why: error.to_string() });
                }
                Err(error) => return Err(error),
            }
        }
        observer.hear(Event::Step { done: total, total, what: "trials" });
        Ok(())
    }

    fn labels(&self) -> Result<Marked, Error> {
        let mut found = Marked::new();
        for note in self.store.files(crate::corpus::tables::LABELS) {
            for of in self.store.labels_in(note)? {
                let frame = |frame: i64| usize::try_from(frame).unwrap_or(0);
                let frames = [frame(of.first_frame), frame(of.last_frame)];
                found.entry(of.trial).or_default().push((of.label, frames, of.value));
            }
        }
        Ok(found)
    }

    fn write(
        &self,
        name: &str,
        bytes: impl FnOnce() -> Result<Vec<u8>, Error>,
    ) -> Result<(), Error> {
        let path = self.order.folder.join(name);
        // Files appear whole: one that is there was written by a run that did not get further.
        if path.exists() {
            return Ok(());
        }
        let folder = path.parent().unwrap_or(&self.order.folder);
        fs::create_dir_all(folder).map_err(|e| unwritable(folder, &e))?;
        write_file(&path, false, &bytes()?)
    }

    fn frames(&self, entry: &TrialEntry) -> Result<TrialFrames, Error> {
        let mut found = TrialFrames::default();
        self.store.frames_of(&[entry], |_, frames| {
            found = frames;
            Ok(())
        })?;
        Ok(found)
    }

    fn one(&self, entry: &TrialEntry, labels: &Marked) -> Result<ExportedTrial, Error> {
        let stem = stem_of(entry);
        let mut exported = ExportedTrial::of(entry);
        match self.order.format {
            ExportFormat::Bvh => {
                let name = format!("{stem}.bvh");
                self.write(&name, || {
                    let body = Proportions::of_stature(entry.body_stature_m)?;
                    let poses = self.frames(entry)?.poses();
                    Ok(bvh::write(&export::bvh_of(&poses, &body, entry.rate_hz)).into_bytes())
                })?;
                exported.files.push(name);
            }
            ExportFormat::C3d => {
                let name = format!("{stem}.c3d");
                self.write(&name, || {
                    let body = Proportions::of_stature(entry.body_stature_m)?;
                    let poses = self.frames(entry)?.poses();
                    let markers = export::markers_of(&poses, &body, entry.rate_hz)?;
                    let mut bytes = Vec::new();
                    c3d::write::write(&mut bytes, &mut FramesOf::new(&markers))?;
                    Ok(bytes)
                })?;
                exported.files.push(name);
            }
            ExportFormat::AxisAngle => {
                let name = format!("{stem}.npz");
                self.write(&name, || {
                    let poses = self.frames(entry)?.poses();
                    Ok(npz::of_person(&poses, entry.rate_hz, entry.body_stature_m))
                })?;
                exported.files.push(name);
            }
            ExportFormat::Source => {
                let source = entry.source_file.as_deref().unwrap_or_default();
                let ending = source.rsplit('.').next().unwrap_or("bin");
                let name = format!("{stem}.{ending}");
                self.write(&name, || {
                    let path = self.store.path(source);
                    fs::read(&path).map_err(|e| {
                        Error::of((&e).into(), "the file of a trial cannot be read")
                            .at(path.display().to_string())
                            .got(e.to_string())
                    })
                })?;
                exported.files.push(name);
            }
            ExportFormat::Labels => {
                let frames = usize::try_from(entry.frames).unwrap_or(0);
                let own = labels.get(&entry.trial).map(Vec::as_slice).unwrap_or_default();
                let names: BTreeSet<&str> = own.iter().map(|(name, ..)| name.as_str()).collect();
                let mut taken: BTreeMap<String, usize> = BTreeMap::new();
                for label in names {
                    let mut marks = vec![0.0_f64; frames];
                    for (_, [first, last], value) in own.iter().filter(|(name, ..)| name == label) {
                        let end = last.saturating_add(1).min(frames);
                        let range = *first.min(&end)..end;
                        marks[range].iter_mut().for_each(|mark| *mark = mark.max(*value));
                    }
                    let text: String = marks.iter().map(|mark| format!("{mark:.1}\n")).collect();
                    // Sentences may begin alike.
                    let plain = plain(label);
                    let again = taken.entry(plain.clone()).or_default();
                    *again += 1;
                    let number = match (*again, plain.is_empty()) {
                        (1, false) => String::new(),
                        (number, _) => format!("~{number}"),
                    };
                    let name = format!("{stem}/{plain}{number}.txt");
                    self.write(&name, || Ok(text.into_bytes()))?;
                    exported.files.push(name);
                }
            }
            ExportFormat::Robot(file) => {
                if let Some(robot) = self.robot {
                    self.on_robot(robot, entry, file, &stem, &mut exported)?;
                }
            }
            // A dataset is one thing, whatever is in it.
            ExportFormat::Lerobot => {}
        }
        Ok(exported)
    }

    /// The episodes of a trial: what was played of it if there are recordings, else what the robot would be told.
    fn episodes(
        &mut self,
        entry: &TrialEntry,
        dataset: &mut Dataset<'_>,
    ) -> Result<ExportedTrial, Error> {
        let mut exported = ExportedTrial::of(entry);
        let (Some(robot), Some(rate_hz)) = (self.robot, self.order.format.robot_hz()) else {
            return Ok(exported);
        };
        let task = entry.action.as_str();
        let Some(paths) = self.played.get(&entry.trial) else {
            let clip = self.clip(robot, entry, rate_hz)?;
            let rows: Vec<Vec<f64>> = clip.rows.into_iter().map(|(_, angles)| angles).collect();
            exported.retime_factor = Some(clip.retime_factor);
            exported.predicted_fall_s = clip.falls_s;
            exported.episodes.push(dataset.add(&Episode {
                task,
                action_rad: &rows,
                state_rad: &rows,
            })?);
            return Ok(exported);
        };
        for path in paths {
            match joints::played(path, robot, rate_hz) {
                Ok(of) => {
                    let (action_rad, state_rad) = (&of.goal_rad, &of.present_rad);
                    exported.episodes.push(dataset.add(&Episode {
                        task,
                        action_rad,
                        state_rad,
                    })?);
                    exported.recordings.push(path.display().to_string());
                }
                Err(error) => self.report.withheld.push(Withheld {
                    trial: entry.trial.clone(),
                    name: path.display().to_string(),
                    why: error.to_string(),
                }),
            }
        }
        if exported.episodes.is_empty() {
            return Err(Error::new("none of its recordings can be used"));
        }
        Ok(exported)
    }

    fn clip(&self, robot: &Robot, entry: &TrialEntry, rate_hz: f64) -> Result<RobotClip, Error> {
        let capture = capture_of(entry, self.frames(entry)?.poses());
        robot_clip(robot, &entry.name, capture, rate_hz)
    }

    fn on_robot(
        &self,
        robot: &Robot,
        entry: &TrialEntry,
        file: LearnerFile,
        stem: &str,
        exported: &mut ExportedTrial,
    ) -> Result<(), Error> {
        let rate_hz = file.rate_hz();
        let clip = self.clip(robot, entry, rate_hz)?;
        let name = format!("{stem}.{}", file.ending());
        self.write(&name, || file.bytes(robot, &clip, rate_hz))?;
        exported.files.push(name);
        exported.retime_factor = Some(clip.retime_factor);
        exported.predicted_fall_s = clip.falls_s;
        Ok(())
    }
}
