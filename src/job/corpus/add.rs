//! Trials into a corpus: captures, recorded sessions, actions, and folders of variations.

use super::about::{AboutTrial, TrialTable, merged, subject_file};
use super::bones_seed;
use super::inside::inside;
use super::labels::{KnownLabels, recognised, throughout};
use super::variations::{self, Variation};
use crate::action::{phrase, vocabulary};
use crate::body::anthropometry::check_id;
use crate::body::{Segment, segment_name};
use crate::corpus::licence::{Licence, UNKNOWN};
use crate::corpus::query::Question;
use crate::corpus::rows::{Consent, LabelEntry, SubjectEntry, TrialEntry, TrialKind};
use crate::corpus::select::Selection;
use crate::corpus::sets::PlannedSet;
use crate::corpus::store::{NewTrial, Store, check_name, hash_of};
use crate::corpus::tables::{LABELS, TRIALS, TrialFrames};
use crate::error::{Error, ErrorKind};
use crate::job::labels::read_text;
use crate::job::pending::go_on;
use crate::job::report::Outcome;
use crate::job::report::counted;
use crate::job::source::{CaptureOptions, FileKind, body_motion, file_kind};
use crate::job::{Event, Observer};
use crate::mocap::anatomy::Capture;
use crate::recognise::machine::Span;
use crate::session::files::SCHEMA;
use crate::session::manifest::Manifest;
use crate::toml_text::{from_toml, plain_words};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};
use std::path::{Path, PathBuf};

/// So many frames, or trials, are added in one step: what a kill loses is less than that.
const FRAMES_IN_STEP: usize = 400_000;
/// As [`FRAMES_IN_STEP`].
const TRIALS_IN_STEP: usize = 10_000;
/// Deepest folder in a folder that is looked into.
const DEEPEST: usize = 16;

/// What is to be added.
#[derive(Clone, Debug, Default)]
pub struct AddOrder {
    /// The folder of the corpus.
    pub corpus: PathBuf,
    /// Files, folders of files, of sessions and of variations, or actions.
    pub sources: Vec<String>,
    /// What is said of all of them.
    pub about: AboutTrial,
    /// A table that says more of each.
    pub table: Option<PathBuf>,
    /// Files of people.
    pub subjects: Vec<PathBuf>,
    /// What all people that are named allowed.
    pub consent: Option<Consent>,
    /// Labels: a table, or a folder of labels of frames.
    pub labels: Option<PathBuf>,
    /// Who wrote them.
    pub annotator: Option<String>,
    /// Label what the program recognises.
    pub recognise: bool,
    /// Keep rows and hashes, and no frames.
    pub without_frames: bool,
    /// Which joint of a capture is which body segment.
    pub mapping: Option<PathBuf>,
    /// What captures do not say themselves.
    pub reading: CaptureOptions,
}

/// What was added.
#[derive(Clone, Debug, Serialize)]
pub struct AddReport {
    /// `done`, or `done_with_loss` if something could not be read.
    pub outcome: Outcome,
    /// The folder of the corpus.
    pub corpus: String,
    /// Its version now.
    pub version: String,
    /// Trials that came.
    pub added: u64,
    /// Their frames.
    pub frames: u64,
    /// Trials that were there already, by their content; their labels may be new.
    pub found: Vec<FoundTrial>,
    /// Labels that came.
    pub labels: u64,
    /// What could not be read, and why.
    pub unread: Vec<String>,
    /// What a person should know.
    pub notes: Vec<String>,
    /// Trials there are now.
    pub trials: u64,
}

/// Something that was there already.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FoundTrial {
    /// What was to be added.
    pub source: String,
    /// The trial that it is.
    pub trial: String,
    /// What is the same: `file` or `frames`.
    pub by: &'static str,
}

/// One thing to be added.
enum Piece {
    /// A file, or an action.
    Motion(String),
    /// A trial of a session.
    OfSession(PathBuf),
    /// A set of files of variations.
    Variations(PathBuf),
}

impl Piece {
    /// The file that labels may name.
    fn file(&self) -> Option<PathBuf> {
        match self {
            Self::Motion(source) => Some(PathBuf::from(source)),
            Self::OfSession(path) => Some(path.clone()),
            Self::Variations(_) => None,
        }
    }
}

/// Labels that name nothing of what is added are told: a folder may be another one than was meant.
fn unused_note(unused: &BTreeSet<&str>) -> Option<String> {
    let first = unused.first()?;
    Some(format!(
        "labels of {} name nothing that is added here, such as {first}",
        counted(unused.len(), "clip")
    ))
}

struct Planned {
    piece: Piece,
    about: AboutTrial,
}

/// Adds trials.
///
/// # Errors
/// No corpus, one that somebody else changes, nothing to add, something that is said wrong; a single file that cannot
/// be read. Among several that is told in the report.
pub fn add(order: &AddOrder, observer: &dyn Observer) -> Result<AddReport, Error> {
    order.about.check()?;
    let store = Store::open_to_change(&order.corpus)?;
    let mut planning = Planning::of(order, observer)?;
    for source in &order.sources {
        planning.take(source)?;
    }
    if order.sources.is_empty() {
        let files: Vec<PathBuf> =
            planning.table.trials.iter().map(|(file, _)| file.clone()).collect();
        for file in &files {
            go_on(observer)?;
            planning.file(&file.display().to_string(), file);
        }
    }
    if planning.planned.is_empty() && planning.subjects.is_empty() {
        if let Some(first) = planning.unread.iter().chain(planning.notes.last()).next() {
            return Err(Error::of(ErrorKind::Absent, "there is nothing to add").got(first));
        }
        return Err(Error::of(ErrorKind::Absent, "there is nothing to add")
            .got(order.sources.join(", "))
            .allowed("captures (.bvh, .amc, .c3d, .trc, .csm, .mot, .sto, .mcap), folders of them, of sessions and of variations, actions, or a table of trials"));
    }
    // What somebody allowed counts before anything of theirs is added, whatever else is known of them.
    if order.consent.is_some() {
        let named = planning.planned.iter().filter_map(|of| of.about.subject.clone());
        for id in named.collect::<BTreeSet<String>>() {
            let mut person = SubjectEntry::default();
            person.subject.id = id;
            planning.person(person)?;
        }
    }
    let Planning { mut planned, subjects, labels, unread, notes, .. } = planning;
    // Trials of one partition go into one file.
    planned.sort_by(|a, b| (&a.about.set, &a.about.action).cmp(&(&b.about.set, &b.about.action)));
    let files: Vec<PathBuf> = planned.iter().filter_map(|of| of.piece.file()).collect();
    let unused = unused_note(&labels.unused(&files));
    let mut adding = Adding::of(order, store, subjects, labels)?;
    if order.consent.is_some() {
        adding.tell_of_people()?;
    }
    adding.report.notes.extend(unused);
    adding.report.unread.extend(unread);
    adding.report.notes.extend(notes);
    let single = planned.len() == 1;
    let total = planned.len() as u64;
    for (done, one) in planned.iter().enumerate() {
        observer.hear(Event::Step { done: done as u64, total, what: "files" });
        if observer.wants_to_stop() {
            adding.report.outcome = Outcome::Stopped;
            break;
        }
        match adding.piece(one, observer) {
            Ok(()) => {}
            Err(Stumble::Fatal(error)) => return Err(error),
            Err(Stumble::Unread(error)) if single => return Err(error),
            Err(Stumble::Unread(error)) => adding.report.unread.push(error.to_string()),
        }
    }
    observer.hear(Event::Step { done: total, total, what: "files" });
    adding.finish()
}

/// Why a piece was not added.
enum Stumble {
    /// It cannot be read; others may.
    Unread(Error),
    /// Nothing more can be added.
    Fatal(Error),
}

/// What is to be added, in the making.
struct Planning<'a> {
    order: &'a AddOrder,
    /// Whoever may want to stop: a folder may be large.
    observer: &'a dyn Observer,
    table: TrialTable,
    labels: KnownLabels,
    subjects: BTreeMap<String, SubjectEntry>,
    planned: Vec<Planned>,
    /// Trials of sessions that have nothing to be added, and why.
    unread: Vec<String>,
    /// What a person should know.
    notes: Vec<String>,
}

impl<'a> Planning<'a> {
    fn of(order: &'a AddOrder, observer: &'a dyn Observer) -> Result<Self, Error> {
        let table = order.table.as_deref().map(TrialTable::read).transpose()?.unwrap_or_default();
        let folder = order.sources.first().map(Path::new).filter(|path| path.is_dir());
        let labels = order.labels.as_deref().map(|path| KnownLabels::read(path, folder));
        let labels = labels.transpose()?.unwrap_or_default();
        let mut planning = Self {
            order,
            observer,
            table,
            labels,
            subjects: BTreeMap::new(),
            planned: Vec::new(),
            unread: Vec::new(),
            notes: Vec::new(),
        };
        for path in &order.subjects {
            planning
                .person(SubjectEntry { subject: subject_file(path)?, ..SubjectEntry::default() })?;
        }
        let told = std::mem::take(&mut planning.table.subjects);
        told.into_iter().try_for_each(|person| planning.person(person))?;
        Ok(planning)
    }

    fn person(&mut self, mut person: SubjectEntry) -> Result<(), Error> {
        if let Some(consent) = self.order.consent {
            person.consent = consent;
        }
        let id = person.subject.id.clone();
        let person = match self.subjects.get(&id) {
            None => person,
            Some(known) => merged(known, &person)?,
        };
        self.subjects.insert(id, person);
        Ok(())
    }

    fn take(&mut self, source: &str) -> Result<(), Error> {
        let path = Path::new(source);
        if path.is_dir() {
            return self.folder(path, 0);
        }
        if phrase::is_phrase(source) {
            let about = self.said(None);
            let about = about.or(&AboutTrial {
                set: Some("generated".to_owned()),
                action: Some(phrase::class(&phrase::load(source)?)),
                licence: Some(OWN.to_owned()),
                ..AboutTrial::default()
            });
            self.planned.push(Planned { piece: Piece::Motion(source.to_owned()), about });
            return Ok(());
        }
        if path.extension().is_some_and(|ending| ending == "parquet") {
            self.variations(path);
            return Ok(());
        }
        if path.symlink_metadata().is_err() {
            return Err(Error::of(ErrorKind::Absent, "there is no such file, folder or action")
                .none_of(source, vocabulary::names(), "check the path"));
        }
        self.file(source, path);
        Ok(())
    }

    /// What is said of a file on the command line and in the table.
    fn said(&self, path: Option<&Path>) -> AboutTrial {
        let of_table = path.and_then(|path| self.table.about(path)).cloned();
        of_table.unwrap_or_default().or(&self.order.about)
    }

    fn file(&mut self, source: &str, path: &Path) {
        let labelled = self.labels.action(path);
        let about = self.said(Some(path)).or(&AboutTrial {
            set: Some("captures".to_owned()),
            action: labelled,
            ..AboutTrial::default()
        });
        self.planned.push(Planned { piece: Piece::Motion(source.to_owned()), about });
    }

    fn variations(&mut self, path: &Path) {
        let about = self.said(Some(path)).or(&AboutTrial {
            set: Some("generated".to_owned()),
            licence: Some(OWN.to_owned()),
            ..AboutTrial::default()
        });
        self.planned.push(Planned { piece: Piece::Variations(path.to_owned()), about });
    }

    fn folder(&mut self, folder: &Path, depth: usize) -> Result<(), Error> {
        let unreadable = |e: std::io::Error| {
            Error::of((&e).into(), "the folder cannot be read")
                .at(folder.display().to_string())
                .got(e.to_string())
        };
        if folder.join("session.toml").is_file() {
            return self.session(folder);
        }
        if let Some(metadata) = bones_seed::metadata(folder) {
            return self.bones_seed(folder, &metadata);
        }
        let mut entries = Vec::new();
        for entry in std::fs::read_dir(folder).map_err(unreadable)? {
            go_on(self.observer)?;
            entries.push(entry.map_err(unreadable)?.path());
        }
        entries.sort();
        for path in entries {
            go_on(self.observer)?;
            let is_variations =
                |name: &str| name.starts_with("poses-") && name.ends_with(".parquet");
            let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
            // Links are followed to files and not to folders, which may go round.
            let is_folder = path.symlink_metadata().is_ok_and(|of| of.is_dir());
            if is_folder && depth < DEEPEST && !name.starts_with('.') {
                self.folder(&path, depth + 1)?;
            } else if path.is_file() && is_variations(name) {
                self.variations(&path);
            } else if path.is_file() && is_motion(&path) {
                self.file(&path.display().to_string(), &path);
            }
        }
        Ok(())
    }

    fn bones_seed(&mut self, folder: &Path, metadata: &Path) -> Result<(), Error> {
        let found = bones_seed::read(folder, metadata)?;
        for person in found.people {
            self.person(person)?;
        }
        for motion in found.motions {
            go_on(self.observer)?;
            for event in motion.events {
                let span = Span { start_s: event.start_s, end_s: event.end_s };
                self.labels.add(&motion.file, event.description, span);
            }
            let about = self.said(Some(&motion.file)).or(&motion.about);
            let source = motion.file.display().to_string();
            self.planned.push(Planned { piece: Piece::Motion(source), about });
        }
        if !self.planned.is_empty() {
            self.notes.push(
                "BONES-SEED has a licence of its own (LICENSE.md there): read it before anything is passed on".to_owned(),
            );
        }
        if let Some(first) = found.unnamed.first() {
            self.notes.push(format!(
                "what is done when is told of {} that the table does not have, such as {first}",
                counted(found.unnamed.len(), "motion")
            ));
        }
        if found.absent > 0 {
            self.notes.push(format!(
                "{} of {} not in the folder: unpack soma_proportional or soma_uniform there",
                counted(found.absent, "motion"),
                metadata.display()
            ));
        }
        Ok(())
    }

    fn session(&mut self, folder: &Path) -> Result<(), Error> {
        let path = folder.join("manifest.toml");
        if !path.exists() {
            return Err(Error::of(ErrorKind::NotReady, "the session is not finished")
                .at(folder.display().to_string())
                .remedy("finish it: `gaitway record --session DIR`; it then has a manifest.toml and joint angles"));
        }
        let manifest: Manifest = from_toml(&read_text(&path, "the manifest of a session")?)
            .map_err(|cause| {
                Error::of(ErrorKind::Malformed, "not the manifest of a session")
                    .at(path.display().to_string())
                    .got(plain_words(cause.message()))
            })?;
        if manifest.schema != SCHEMA {
            return Err(Error::of(
                ErrorKind::Unknown,
                "a session of another version of this program",
            )
            .at(path.display().to_string())
            .got(format!("schema {}", manifest.schema))
            .allowed(format!("schema {SCHEMA}")));
        }
        for file in &manifest.subjects {
            let subject = subject_file(&inside(folder, file, &path)?)?;
            self.person(SubjectEntry { subject, ..SubjectEntry::default() })?;
        }
        for trial in &manifest.trials {
            go_on(self.observer)?;
            let verdict = match trial.verdict {
                crate::session::files::Verdict::Keep => "keep",
                crate::session::files::Verdict::Retake => "retake",
            };
            let poses = trial.angles.iter().filter(|file| file.ends_with(".bvh"));
            let poses: Vec<&String> = poses.collect();
            // One that is to be retaken has none, and none is missed.
            if verdict == "keep" && poses.len() != trial.subjects.len() {
                self.unread.push(format!(
                    "trial {} of the session in {}: {} of motion of {}{}",
                    trial.name,
                    folder.display(),
                    counted(poses.len(), "file"),
                    counted(trial.subjects.len(), "person"),
                    trial.no_angles.iter().map(|why| format!(": {why}")).collect::<String>(),
                ));
            }
            for (file, subject) in poses.into_iter().zip(&trial.subjects) {
                // Somebody may have edited it, and ids become names of files. Of a trial that broke off at its begin nobody
                // knows whose it is.
                check_id(subject).map_err(|error| error.in_file(&path))?;
                let path = inside(folder, file, &path)?;
                let said = self.said(Some(&path));
                // A trial that was planned for a set is called as it is there.
                let planned = said.set.as_deref().and_then(PlannedSet::of).and_then(|set| {
                    set.trials().into_iter().find(|planned| planned.name == trial.action)
                });
                let parameters = planned.iter().flat_map(|of| &of.parameters);
                let action = planned.as_ref().map_or(trial.action.as_str(), |of| of.action);
                let about = said.or(&AboutTrial {
                    name: Some(trial.name.clone()),
                    set: Some("sessions".to_owned()),
                    action: Some(action.to_owned()),
                    parameters: parameters.map(|(name, of)| ((*name).to_owned(), *of)).collect(),
                    subject: Some(subject.clone()),
                    session: Some(manifest.session.clone()),
                    verdict: Some(verdict.to_owned()),
                    repetitions: Some(i64::from(trial.good_repetitions)),
                    provenance: Some(format!(
                        "recorded by {}, {}",
                        manifest.operator, manifest.place
                    )),
                    ..AboutTrial::default()
                });
                self.planned.push(Planned { piece: Piece::OfSession(path), about });
            }
        }
        Ok(())
    }
}

/// The licence of what the program made itself: that of the project's own actions.
pub(super) const OWN: &str = "MIT OR Apache-2.0";

fn is_motion(path: &Path) -> bool {
    let ends = |ending: &str| path.extension().is_some_and(|e| e.eq_ignore_ascii_case(ending));
    // Of tables only those named by somebody: labels are tables too.
    let is_table = ends("csv") || ends("txt");
    !is_table && (file_kind(path) != FileKind::Other || ends("mcap"))
}

/// Trials on their way.
struct Adding<'a> {
    order: &'a AddOrder,
    store: Store,
    labels: KnownLabels,
    subjects: BTreeMap<String, SubjectEntry>,
    /// By the beginning of the hash of a file: which trial it is.
    by_source: HashMap<u64, u64>,
    /// Ids that there are.
    ids: HashSet<u64>,
    waiting: Vec<NewTrial>,
    waiting_frames: usize,
    partition: (String, String),
    /// Trials that were there already, and the files by which they may be labelled.
    again: Vec<(String, PathBuf)>,
    report: AddReport,
}

/// The first 16 digits of a hash, as a number.
fn short(hash: &str) -> u64 {
    hash.get(..16).and_then(|digits| u64::from_str_radix(digits, 16).ok()).unwrap_or(0)
}

fn id_of(frames_sha256: &str) -> String {
    frames_sha256.chars().take(16).collect()
}

impl<'a> Adding<'a> {
    fn of(
        order: &'a AddOrder,
        store: Store,
        subjects: BTreeMap<String, SubjectEntry>,
        labels: KnownLabels,
    ) -> Result<Self, Error> {
        let mut known: BTreeMap<String, SubjectEntry> =
            store.subjects()?.into_iter().map(|of| (of.subject.id.clone(), of)).collect();
        for (id, person) in subjects {
            let both = match known.get(&id) {
                Some(known) => merged(known, &person)?,
                None => person,
            };
            known.insert(id, both);
        }
        let (mut by_source, mut ids) = (HashMap::new(), HashSet::new());
        for note in store.files(TRIALS) {
            let table = store.table(&note.path)?;
            for group in 0..table.groups() {
                let trials = table.column(group, "trial", None)?;
                let sources = table.column(group, "source_sha256", None)?;
                for row in 0..trials.len() {
                    let id = short(trials.text(row).unwrap_or_default());
                    ids.insert(id);
                    if let Some(source) = sources.text(row) {
                        by_source.insert(short(source), id);
                    }
                }
            }
        }
        let report = AddReport {
            outcome: Outcome::Done,
            corpus: super::shown(&order.corpus),
            version: String::new(),
            added: 0,
            frames: 0,
            found: Vec::new(),
            labels: 0,
            unread: Vec::new(),
            notes: Vec::new(),
            trials: 0,
        };
        Ok(Self {
            order,
            store,
            labels,
            subjects: known,
            by_source,
            ids,
            waiting: Vec::new(),
            waiting_frames: 0,
            partition: (String::new(), String::new()),
            again: Vec::new(),
            report,
        })
    }

    fn piece(&mut self, planned: &Planned, observer: &dyn Observer) -> Result<(), Stumble> {
        match &planned.piece {
            Piece::Motion(source) if phrase::is_phrase(source) => {
                self.motion(source, TrialKind::Generated, &planned.about)
            }
            Piece::Motion(source) => self.motion(source, TrialKind::Capture, &planned.about),
            Piece::OfSession(path) => {
                self.motion(&path.display().to_string(), TrialKind::Session, &planned.about)
            }
            Piece::Variations(path) => self.variations(path, &planned.about, observer),
        }
    }

    /// A capture, a trial of a session or an action.
    fn motion(&mut self, source: &str, kind: TrialKind, about: &AboutTrial) -> Result<(), Stumble> {
        let path = Path::new(source);
        let hash = match kind {
            TrialKind::Generated => None,
            TrialKind::Capture | TrialKind::Session => {
                Some(hash_of(path).map_err(Stumble::Unread)?.0)
            }
        };
        if let Some(id) = hash.as_ref().and_then(|hash| self.by_source.get(&short(hash))) {
            let trial = format!("{id:016x}");
            self.found(source, trial, "file");
            return Ok(());
        }
        let read = body_motion(source, self.order.mapping.as_deref(), &self.order.reading);
        let (capture, read) = read.map_err(Stumble::Unread)?;
        let frames = TrialFrames::of(&capture.poses);
        if frames.is_empty() || !frames.is_finite() {
            let error = Error::of(
                ErrorKind::Malformed,
                "the motion has no frames, or some that are no numbers",
            );
            return Err(Stumble::Unread(error.at(source)));
        }
        let entry = self.entry(source, kind, about, &capture, &read.format, &frames);
        let mut entry = entry.map_err(Stumble::Unread)?;
        let labels = self.labels_of(path, &entry, &capture).map_err(Stumble::Unread)?;
        if let Some(hash) = hash {
            let ending = path.extension().and_then(|e| e.to_str()).unwrap_or("bin");
            let folder = hash.get(..2).unwrap_or("00");
            entry.source_file =
                Some(format!("sources/{folder}/{hash}.{}", ending.to_ascii_lowercase()));
            self.by_source.insert(short(&hash), short(&entry.trial));
            entry.source_sha256 = Some(hash);
        }
        let copied = entry.source_file.is_some().then(|| path.to_owned());
        self.wait(NewTrial { entry, frames: Some(frames), labels, source: copied }, source)
    }

    fn entry(
        &self,
        source: &str,
        kind: TrialKind,
        about: &AboutTrial,
        capture: &Capture,
        format: &str,
        frames: &TrialFrames,
    ) -> Result<TrialEntry, Error> {
        let stem = Path::new(source).file_stem().and_then(|stem| stem.to_str());
        let name = match kind {
            TrialKind::Generated => Some(source),
            TrialKind::Capture | TrialKind::Session => stem,
        };
        let untracked: Vec<&str> = Segment::ALL
            .into_iter()
            .filter(|segment| !capture.tracked[segment.index()])
            .map(segment_name)
            .collect();
        let sha256 = frames.sha256(capture.rate_hz);
        let entry = TrialEntry {
            trial: id_of(&sha256),
            name: about.name.clone().or(name.map(str::to_owned)).unwrap_or_default(),
            kind,
            synthetic: kind == TrialKind::Generated,
            source: source.to_owned(),
            format: format.to_owned(),
            untracked: (!untracked.is_empty()).then(|| untracked.join(" ")),
            body_stature_m: capture.stature_m,
            frames: frames.len() as i64,
            rate_hz: capture.rate_hz,
            duration_s: frames.len().saturating_sub(1) as f64 / capture.rate_hz,
            frames_sha256: sha256,
            ..self.said(about, source)?
        };
        Ok(entry)
    }

    /// A row of which only what somebody said is filled in.
    fn said(&self, about: &AboutTrial, source: &str) -> Result<TrialEntry, Error> {
        let action = about.action.clone().ok_or_else(|| {
            Error::new("nobody says what is done in it").at(source).remedy(
                "--action NAME for all, a column action in a table of trials (--trials), or a class in a table of labels (--labels)",
            )
        })?;
        let set = about.set.clone().unwrap_or_else(|| "captures".to_owned());
        check_name("a set", &set)
            .and_then(|()| check_name("an action", &action))
            .map_err(|e| e.at(source))?;
        about.check_lengths().map_err(|error| error.in_file(Path::new(source)))?;
        if let Some(id) = &about.subject {
            let person = self.subjects.get(id);
            if person.is_some_and(|of| of.consent == Consent::Withdrawn) {
                return Err(Error::of(
                    ErrorKind::NotPermitted,
                    "this person withdrew their consent",
                )
                .at(source)
                .got(id.clone()));
            }
        }
        let licence = about.licence.clone().unwrap_or_else(|| UNKNOWN.to_owned());
        let edits = about.edits.as_deref().map(hash_of).transpose()?;
        Ok(TrialEntry {
            trial: String::new(),
            name: String::new(),
            set,
            action,
            kind: TrialKind::Capture,
            synthetic: false,
            subject: about.subject.clone(),
            session: about.session.clone(),
            source: source.to_owned(),
            format: String::new(),
            source_sha256: None,
            source_file: None,
            provenance: about.provenance.clone(),
            noncommercial: Licence::of(&licence).noncommercial,
            licence,
            verdict: about.verdict.clone(),
            repetitions: about.repetitions,
            edits_sha256: edits.map(|(hash, _)| hash),
            untracked: None,
            part_of: about.part_of.clone(),
            body_stature_m: 0.0,
            frames: 0,
            rate_hz: 0.0,
            duration_s: 0.0,
            frames_sha256: String::new(),
            parameters: about.parameters.clone(),
            place: None,
        })
    }

    fn labels_of(
        &self,
        path: &Path,
        entry: &TrialEntry,
        capture: &Capture,
    ) -> Result<Vec<LabelEntry>, Error> {
        let frames = usize::try_from(entry.frames).unwrap_or(0);
        let mut labels = match entry.kind {
            // What it is was said when it was made.
            TrialKind::Generated => vec![throughout(&entry.action, frames, GENERATOR)],
            TrialKind::Capture | TrialKind::Session => {
                self.labels.entries(path, self.annotator(), frames, entry.rate_hz)?
            }
        };
        if self.order.recognise {
            labels.extend(recognised(capture)?);
        }
        labels.iter_mut().for_each(|label| placed(label, entry));
        Ok(labels)
    }

    fn annotator(&self) -> &str {
        self.order.annotator.as_deref().unwrap_or("unknown")
    }

    fn found(&mut self, source: &str, trial: String, by: &'static str) {
        self.again.push((trial.clone(), PathBuf::from(source)));
        self.report.found.push(FoundTrial { source: source.to_owned(), trial, by });
    }

    fn wait(&mut self, mut trial: NewTrial, source: &str) -> Result<(), Stumble> {
        let id = trial.entry.trial.clone();
        if !self.ids.insert(short(&id)) {
            self.found(source, id, "frames");
            return Ok(());
        }
        if self.order.without_frames {
            trial.frames = None;
        }
        let partition = (trial.entry.set.clone(), trial.entry.action.clone());
        if partition != self.partition {
            self.step().map_err(Stumble::Fatal)?;
            self.partition = partition;
        }
        self.waiting_frames += trial.frames.as_ref().map_or(0, TrialFrames::len);
        self.waiting.push(trial);
        if self.waiting_frames >= FRAMES_IN_STEP || self.waiting.len() >= TRIALS_IN_STEP {
            self.step().map_err(Stumble::Fatal)?;
        }
        Ok(())
    }

    /// Adds what waits.
    fn step(&mut self) -> Result<(), Error> {
        let waiting = std::mem::take(&mut self.waiting);
        self.waiting_frames = 0;
        if waiting.is_empty() {
            return Ok(());
        }
        let named = |trial: &NewTrial| trial.entry.subject.clone();
        let mut people = Vec::new();
        for id in waiting.iter().filter_map(named) {
            // Somebody of whom nothing is known is somebody as well.
            let person = self.subjects.entry(id.clone()).or_insert_with(|| {
                let mut person = SubjectEntry::default();
                person.subject.id = id;
                person.consent = self.order.consent.unwrap_or_default();
                person
            });
            people.push(person.clone());
        }
        let counted = |of: fn(&NewTrial) -> u64| waiting.iter().map(of).sum::<u64>();
        let frames = counted(|trial| trial.frames.as_ref().map_or(0, TrialFrames::len) as u64);
        let labels = counted(|trial| trial.labels.len() as u64);
        let trials = waiting.len() as u64;
        let (set, action) = self.partition.clone();
        self.store.add(&set, &action, waiting, &people, &format!("{set}, {action}"))?;
        self.report.added += trials;
        self.report.frames += frames;
        self.report.labels += labels;
        Ok(())
    }

    fn variations(
        &mut self,
        path: &Path,
        about: &AboutTrial,
        observer: &dyn Observer,
    ) -> Result<(), Stumble> {
        let source = path.display().to_string();
        let mut stumbled = None;
        let read = variations::read(path, |variation: Variation| {
            let done = self.variation(&source, about, variation);
            if observer.wants_to_stop() {
                return Err(Error::of(ErrorKind::Stopped, "stopped"));
            }
            match done {
                Ok(()) => Ok(()),
                Err(Stumble::Unread(error)) => Err(error),
                Err(Stumble::Fatal(error)) => {
                    stumbled = Some(error.clone());
                    Err(error)
                }
            }
        });
        match (read, stumbled) {
            (_, Some(error)) => Err(Stumble::Fatal(error)),
            (Err(error), None) if error.kind == ErrorKind::Stopped => Err(Stumble::Fatal(error)),
            (Err(error), None) => Err(Stumble::Unread(error)),
            (Ok(()), None) => Ok(()),
        }
    }

    fn variation(
        &mut self,
        source: &str,
        about: &AboutTrial,
        variation: Variation,
    ) -> Result<(), Stumble> {
        let Variation { label, class, seed, number, holds, stature_m, rate_hz, frames } = variation;
        let own = AboutTrial {
            action: Some(label.clone()),
            verdict: Some(if holds { "keep" } else { "retake" }.to_owned()),
            provenance: Some(format!("variation of {class}")),
            parameters: BTreeMap::from([
                ("seed".to_owned(), seed as f64),
                ("variation".to_owned(), number as f64),
            ]),
            ..AboutTrial::default()
        };
        let said = self.said(&about.clone().or(&own), source).map_err(Stumble::Fatal)?;
        let sha256 = frames.sha256(rate_hz);
        let entry = TrialEntry {
            trial: id_of(&sha256),
            name: format!("{label}-{number:06}"),
            kind: TrialKind::Generated,
            synthetic: true,
            format: "parquet".to_owned(),
            body_stature_m: stature_m,
            frames: frames.len() as i64,
            rate_hz,
            duration_s: frames.len().saturating_sub(1) as f64 / rate_hz,
            frames_sha256: sha256,
            ..said
        };
        let mut label = throughout(&label, frames.len(), GENERATOR);
        placed(&mut label, &entry);
        self.wait(
            NewTrial { entry, frames: Some(frames), labels: vec![label], source: None },
            source,
        )
    }

    /// New labels of trials that were there.
    fn label_again(&mut self) -> Result<(), Error> {
        if self.order.labels.is_none() || self.again.is_empty() {
            return Ok(());
        }
        let ids: Vec<&str> = self.again.iter().map(|(id, _)| id.as_str()).collect();
        let question = Question::parse(&format!("trial in ({})", ids.join(",")))?;
        let mut entries = Vec::new();
        Selection::new(&self.store, &question, false)?.trials(u64::MAX, |entry| {
            entries.push(entry);
            Ok(())
        })?;
        let mut known: HashMap<String, Vec<LabelEntry>> =
            ids.iter().map(|id| ((*id).to_owned(), Vec::new())).collect();
        for note in self.store.files(LABELS) {
            for label in self.store.labels_in(note)? {
                if let Some(of_trial) = known.get_mut(&label.trial) {
                    of_trial.push(label);
                }
            }
        }
        let mut more = Vec::new();
        for entry in &entries {
            let frames = usize::try_from(entry.frames).unwrap_or(0);
            for (_, file) in self.again.iter().filter(|(id, _)| *id == entry.trial) {
                let labels = self.labels.entries(file, self.annotator(), frames, entry.rate_hz)?;
                for mut label in labels {
                    placed(&mut label, entry);
                    let of_trial = known.entry(entry.trial.clone()).or_default();
                    if !of_trial.contains(&label) {
                        of_trial.push(label.clone());
                        more.push(label);
                    }
                }
            }
        }
        if !more.is_empty() {
            self.store.label(&more, &counted(more.len(), "label"))?;
            self.report.labels += more.len() as u64;
        }
        Ok(())
    }

    fn tell_of_people(&mut self) -> Result<(), Error> {
        let people: Vec<SubjectEntry> = self.subjects.values().cloned().collect();
        self.store.tell_of(&people)
    }

    fn finish(mut self) -> Result<AddReport, Error> {
        self.step()?;
        self.label_again()?;
        self.tell_of_people()?;
        let mut report = self.report;
        if !report.unread.is_empty() && report.outcome == Outcome::Done {
            report.outcome = Outcome::DoneWithLoss;
        }
        report.version.clone_from(&self.store.version().version);
        report.trials = self.store.version().trials;
        Ok(report)
    }
}

/// Who says what a generated trial is.
const GENERATOR: &str = "generator";

fn placed(label: &mut LabelEntry, entry: &TrialEntry) {
    label.trial.clone_from(&entry.trial);
    label.set.clone_from(&entry.set);
    label.action.clone_from(&entry.action);
}
