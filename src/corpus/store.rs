//! The folder of a corpus, and how it changes: in whole steps.
//!
//! A step writes its files into `.new/`, then a journal of what is to be done with them, and does it: files get
//! their names, `version.json` is replaced, files that are no more are removed. Whoever opens the folder after a
//! process was killed does what the journal says to its end; without a journal, what lies in `.new/` never was.

use super::manifest::CorpusManifest;
use super::rows::{FramesPlace, LabelEntry, SubjectEntry, TrialEntry, digest};
use super::tables::{
    FRAMES, LABELS, ROWS_IN_GROUP, SUBJECTS, Schemas, TRIALS, TrialFrames, frame_columns,
    labels_of, push_label, push_subject, push_trial, subjects_of, trials_of,
};
use super::version::{Change, ExportNote, FileNote, RowSum, VersionFile};
use crate::clean::sha256::Sha256;
use crate::columnar::{Column, TableFile, TableReader, TableSchema};
use crate::draft::write_file;
use crate::error::{Error, ErrorKind, counted};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File, TryLockError};
use std::io::{self, BufWriter, Read, Write};
use std::ops::Range;
use std::os::unix::fs::MetadataExt;
use std::path::{Component, Path, PathBuf};

/// Version of the layout of a folder.
const SCHEMA: u32 = 1;
const MANIFEST: &str = "corpus.toml";
const VERSION: &str = "version.json";
const STAGE: &str = ".new";
const JOURNAL: &str = "journal.json";
/// Most bytes of `version.json` and of a journal.
const MAX_JSON: u64 = 256 << 20;
/// Frames in a row group, about.
const FRAMES_IN_GROUP: usize = 20_000;
/// So many small tables of a partition are put together to one.
const MOST_SMALL: usize = 8;
/// Fewer rows are small.
const SMALL_ROWS: u64 = 100_000;
/// Longest name of a set or an action, bytes: a folder's name has it in it, and each may take three.
const LONGEST_NAME: usize = 80;

/// A folder that holds a corpus.
pub struct Store {
    root: PathBuf,
    manifest: CorpusManifest,
    version: VersionFile,
    schemas: Schemas,
    /// Locked as long as it is open, if it may be changed.
    lock: Option<File>,
}

/// What is to be done with files of a step.
#[derive(Debug, Serialize, Deserialize)]
struct Journal {
    /// From the folder on: what is where, and where it is to be. In this order.
    moves: Vec<(String, String)>,
    /// What is to go.
    gone: Vec<String>,
}

/// A trial that comes.
#[derive(Clone, Debug)]
pub struct NewTrial {
    /// Its row; where its frames are is filled in.
    pub entry: TrialEntry,
    /// Its frames, if they are to be kept.
    pub frames: Option<TrialFrames>,
    /// What is done in it.
    pub labels: Vec<LabelEntry>,
    /// The file of which a copy is kept.
    pub source: Option<PathBuf>,
}

/// Files of a step that are not yet where they belong.
#[derive(Default)]
struct Step {
    moves: Vec<(String, String)>,
    notes: Vec<FileNote>,
    gone: BTreeSet<String>,
    sum: RowSum,
    trials: u64,
    frames: u64,
}

fn failed(what: &str, path: &Path, cause: &io::Error) -> Error {
    Error::of(cause.into(), what).at(path.display().to_string()).got(cause.to_string())
}

/// The same where something was to be written: a full disk and its like have a remedy.
fn unwritten(what: &str, path: &Path, cause: &io::Error) -> Error {
    Error::unwritten(what, cause).at(path.display().to_string())
}

/// Refuses a file or a folder in the folder of a corpus, also by a link: everything there is the corpus's own.
///
/// # Errors
/// A place in a corpus.
pub fn check_outside(place: &Path) -> Result<(), Error> {
    let there = resolved(place);
    match there.ancestors().find(|folder| Store::is_corpus(folder)) {
        None => Ok(()),
        Some(corpus) => {
            Err(Error::new("what is written into a corpus would be taken for a part of it")
                .at(place.display().to_string())
                .allowed(format!("a place outside {}", corpus.display())))
        }
    }
}

/// Where a path leads, links followed as far as there is something; what is not there yet may be gone through and left
/// again (`new/../there`).
fn resolved(place: &Path) -> PathBuf {
    let mut at = PathBuf::new();
    for part in std::path::absolute(place).unwrap_or_else(|_| place.to_owned()).components() {
        match part {
            Component::ParentDir => {
                at.pop();
            }
            part => {
                at.push(part);
                at = at.canonicalize().unwrap_or(at);
            }
        }
    }
    at
}

fn synced_folder(folder: &Path) {
    // Some file systems cannot synchronise a folder; its files are worth having even so.
    let _ = File::open(folder).and_then(|folder| folder.sync_all());
}

/// A name as a part of the name of a folder: other letters than plain ones as `%XX`, which readers of such folders turn
/// back.
fn escaped(name: &str) -> String {
    let plain = |b: u8| b.is_ascii_alphanumeric() || b"_.-".contains(&b);
    name.bytes()
        .map(|b| if plain(b) { char::from(b).to_string() } else { format!("%{b:02X}") })
        .collect()
}

/// The folder of a partition.
fn partition(table: &str, set: &str, action: &str) -> String {
    format!("{table}/set={}/action={}", escaped(set), escaped(action))
}

/// Fails if a set or an action cannot be called so.
///
/// # Errors
/// A name that is empty, too long, or has letters that are not shown.
pub fn check_name(what: &str, name: &str) -> Result<(), Error> {
    let fits = !name.is_empty()
        && name.len() <= LONGEST_NAME
        && name.trim() == name
        && !name.chars().any(char::is_control)
        && name != "__HIVE_DEFAULT_PARTITION__";
    if fits {
        return Ok(());
    }
    Err(Error::new(format!("not a name of {what}"))
        .got(name.chars().take(100).collect::<String>())
        .allowed(format!("1 to {LONGEST_NAME} bytes, no blanks at its ends")))
}

impl Store {
    /// Makes a new corpus in a folder that is empty or does not exist yet.
    ///
    /// # Errors
    /// A folder with something in it, or that cannot be written.
    pub fn create(root: &Path, manifest: &CorpusManifest) -> Result<Self, Error> {
        if root.join(MANIFEST).exists() {
            return Err(Error::of(ErrorKind::Exists, "there is a corpus in this folder already")
                .at(root.display().to_string())
                .remedy("add to it with `gaitway corpus add`, or choose another folder"));
        }
        fs::create_dir_all(root).map_err(|e| unwritten("cannot make the folder", root, &e))?;
        let lock = locked(root)?;
        let entries = fs::read_dir(root).map_err(|e| failed("cannot read the folder", root, &e))?;
        // What a killed process left of a new corpus.
        let is_left = |name: &str| name == VERSION || name.ends_with(".part");
        for entry in entries.flatten() {
            if !entry.file_name().to_str().is_some_and(is_left) {
                return Err(Error::of(ErrorKind::Exists, "the folder is not empty")
                    .at(root.display().to_string())
                    .got(entry.file_name().display().to_string())
                    .remedy("choose another folder, or a name that does not exist yet"));
            }
        }
        let version = RowSum::default().text();
        let change = Change {
            version: version.clone(),
            deed: "new".to_owned(),
            added: 0,
            removed: 0,
            words: String::new(),
        };
        let version = VersionFile {
            schema: SCHEMA,
            number: 0,
            version,
            trials: 0,
            frames: 0,
            files: Vec::new(),
            changes: vec![change],
            exports: Vec::new(),
        };
        let text = as_json(&version)?;
        write_file(&root.join(VERSION), true, &text)?;
        // With it the folder is a corpus.
        write_file(&root.join(MANIFEST), false, manifest.text()?.as_bytes())?;
        let (root, manifest, schemas) = (root.to_owned(), manifest.clone(), Schemas::new()?);
        Ok(Self { root, manifest, version, schemas, lock: Some(lock) })
    }

    /// Opens a corpus to be read.
    ///
    /// # Errors
    /// A folder that holds none, or one that was changed into something else.
    pub fn open(root: &Path) -> Result<Self, Error> {
        let manifest = manifest(root)?;
        if root.join(STAGE).join(JOURNAL).exists() {
            // A process was killed, or is at it now: what it was about to do is done to its end.
            recover(root, &locked(root)?)?;
        }
        let version = version(root)?;
        Ok(Self { root: root.to_owned(), manifest, version, schemas: Schemas::new()?, lock: None })
    }

    /// Opens a corpus to be changed: nobody else changes it as long as this lives.
    ///
    /// # Errors
    /// As [`Store::open`], and of a corpus that somebody else changes now.
    pub fn open_to_change(root: &Path) -> Result<Self, Error> {
        let manifest = manifest(root)?;
        let lock = locked(root)?;
        recover(root, &lock)?;
        let version = version(root)?;
        let (root, lock) = (root.to_owned(), Some(lock));
        Ok(Self { root, manifest, version, schemas: Schemas::new()?, lock })
    }

    /// Whether a folder is one of a corpus.
    #[must_use]
    pub fn is_corpus(folder: &Path) -> bool {
        let has = |name: &str| folder.join(name).is_file();
        // One of the two may be lost.
        has(MANIFEST) && has(VERSION)
            || (has(MANIFEST) || has(VERSION)) && folder.join(TRIALS).is_dir()
    }

    /// Where it is.
    #[must_use]
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// What it is called, and the five choices.
    #[must_use]
    pub const fn manifest(&self) -> &CorpusManifest {
        &self.manifest
    }

    /// Its version.
    #[must_use]
    pub const fn version(&self) -> &VersionFile {
        &self.version
    }

    /// Its files of a table.
    pub fn files(&self, table: &str) -> impl Iterator<Item = &FileNote> {
        let table = table.to_owned();
        self.version.files.iter().filter(move |note| note.table == table)
    }

    /// Files that are its own, but for those that trials were made of.
    pub fn own_files(&self) -> impl Iterator<Item = PathBuf> {
        let tables = self.version.files.iter().map(|note| note.path.as_str());
        [MANIFEST, VERSION].into_iter().chain(tables).map(|name| self.path(name))
    }

    /// The path of a file in it.
    #[must_use]
    pub fn path(&self, name: &str) -> PathBuf {
        self.root.join(name)
    }

    /// Opens one of its tables.
    ///
    /// # Errors
    /// A file that is not there or is none.
    pub fn table(&self, name: &str) -> Result<TableReader, Error> {
        TableReader::open(&self.path(name)).map_err(|error| match error.kind {
            ErrorKind::Absent => Error::of(ErrorKind::Absent, "a file of the corpus is not there")
                .at(self.path(name).display().to_string())
                .remedy(
                    "`gaitway corpus check` says what else is wrong; take the file out of a copy",
                ),
            _ => error,
        })
    }

    /// The people in it.
    ///
    /// # Errors
    /// A table that cannot be read.
    pub fn subjects(&self) -> Result<Vec<SubjectEntry>, Error> {
        let mut found = Vec::new();
        for note in self.files(SUBJECTS) {
            found.extend(self.rows_in(note, &self.schemas.subjects, subjects_of)?);
        }
        Ok(found)
    }

    fn columns(
        &self,
        table: &TableReader,
        schema: &TableSchema,
        group: usize,
    ) -> Result<Vec<Column>, Error> {
        schema.columns().iter().map(|(name, _)| table.column(group, name, None)).collect()
    }

    /// The trials in a file of the catalogue.
    ///
    /// # Errors
    /// A table that cannot be read.
    pub fn trials_in(&self, note: &FileNote) -> Result<Vec<TrialEntry>, Error> {
        let of = |columns: &[Column]| trials_of(columns, &note.set, &note.action);
        self.rows_in(note, &self.schemas.trials, of)
    }

    /// The labels in a file of labels.
    ///
    /// # Errors
    /// A table that cannot be read.
    pub fn labels_in(&self, note: &FileNote) -> Result<Vec<LabelEntry>, Error> {
        let of = |columns: &[Column]| labels_of(columns, &note.set, &note.action);
        self.rows_in(note, &self.schemas.labels, of)
    }

    fn rows_in<T>(
        &self,
        note: &FileNote,
        schema: &TableSchema,
        of: impl Fn(&[Column]) -> Result<Vec<T>, Error>,
    ) -> Result<Vec<T>, Error> {
        let table = self.table(&note.path)?;
        let mut found = Vec::new();
        for group in 0..table.groups() {
            let rows = self.columns(&table, schema, group).and_then(|columns| of(&columns));
            found.extend(rows.map_err(|error| error.in_file(&self.path(&note.path)))?);
        }
        Ok(found)
    }

    /// The frames of trials whose place is known, in their order.
    ///
    /// # Errors
    /// A file that is not there, cannot be read, or holds other trials there.
    pub fn frames_of(
        &self,
        trials: &[&TrialEntry],
        mut take: impl FnMut(&TrialEntry, TrialFrames) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let place = |trial: &TrialEntry| trial.place.as_ref().map(|p| (p.file.clone(), p.group));
        for together in trials.chunk_by(|a, b| place(a) == place(b)) {
            let Some(FramesPlace { file, group, .. }) = &together[0].place else { continue };
            let wrong = |got: String| {
                Error::of(
                    ErrorKind::Malformed,
                    "the frames of a trial are not where they should be",
                )
                .at(self.path(file).display().to_string())
                .got(got)
            };
            let table = self.table(file)?;
            let group = usize::try_from(*group).map_err(|_| wrong(format!("group {group}")))?;
            // Some of a group, each once and in the order in which they lie there.
            let mut some: Vec<(&TrialEntry, Range<usize>)> = Vec::new();
            for trial in together {
                some.push((trial, rows_of(trial).ok_or_else(|| wrong(trial.trial.clone()))?));
            }
            some.sort_by_key(|(_, rows)| rows.start);
            let rows: Vec<Range<usize>> = some.iter().map(|(_, rows)| rows.clone()).collect();
            if rows.windows(2).any(|pair| pair[0].end > pair[1].start) {
                return Err(wrong("trials that lie in one another".to_owned()));
            }
            let columns = frame_columns()
                .iter()
                .map(|(name, _)| table.column(group, name, Some(&rows)))
                .collect::<Result<Vec<Column>, Error>>()
                .map_err(|error| error.in_file(&self.path(file)))?;
            let mut from = 0;
            for (trial, rows) in some {
                let to = from + rows.len();
                if (from..to).any(|row| columns[0].text(row) != Some(trial.trial.as_str())) {
                    return Err(wrong(format!("other frames than those of {}", trial.trial)));
                }
                let signal = |column: &Column| match column {
                    Column::Single(all) => all[from..to].to_vec(),
                    _ => Vec::new(),
                };
                take(trial, TrialFrames { signals: columns[3..].iter().map(signal).collect() })?;
                from = to;
            }
        }
        Ok(())
    }

    /// Adds trials of one set and action, and people; all of it or nothing.
    ///
    /// # Errors
    /// What the file system says; the corpus is then as it was.
    pub fn add(
        &mut self,
        set: &str,
        action: &str,
        mut trials: Vec<NewTrial>,
        subjects: &[SubjectEntry],
        words: &str,
    ) -> Result<(), Error> {
        let mut step = self.step()?;
        let added = trials.len() as u64;
        let done = self.stage(&mut step, set, action, &mut trials, subjects);
        let done = done.and_then(|()| self.commit(step, "add", added, 0, words));
        if done.is_err() {
            self.clear_stage();
        }
        done
    }

    fn stage(
        &self,
        step: &mut Step,
        set: &str,
        action: &str,
        trials: &mut [NewTrial],
        subjects: &[SubjectEntry],
    ) -> Result<(), Error> {
        for trial in trials.iter() {
            if let (Some(from), Some(to)) = (&trial.source, &trial.entry.source_file)
                && !step.moves.iter().any(|(_, known)| known == to)
                && !self.path(to).exists()
            {
                self.stage_copy(step, from, to, trial.entry.source_sha256.as_deref())?;
            }
        }
        self.stage_frames(step, set, action, trials)?;
        for trial in trials.iter() {
            step.sum.add(&digest(TRIALS, &trial.entry));
            trial.labels.iter().for_each(|label| step.sum.add(&digest(LABELS, label)));
        }
        step.trials += trials.len() as u64;
        let rows: Vec<&TrialEntry> = trials.iter().map(|trial| &trial.entry).collect();
        self.stage_catalogue(step, set, action, &rows, &BTreeSet::new())?;
        let labels: Vec<&LabelEntry> = trials.iter().flat_map(|trial| &trial.labels).collect();
        self.stage_labels(step, set, action, &labels, &BTreeSet::new())?;
        self.stage_subjects(step, subjects, None)
    }

    /// Takes trials out, and the person they belong to if one is named.
    ///
    /// # Errors
    /// What the file system says; the corpus is then as it was.
    pub fn remove(
        &mut self,
        trials: &[TrialEntry],
        subject: Option<&str>,
        words: &str,
    ) -> Result<(), Error> {
        let mut step = self.step()?;
        let done = self.stage_removal(&mut step, trials, subject);
        let done = done.and_then(|()| self.commit(step, "remove", 0, trials.len() as u64, words));
        if done.is_err() {
            self.clear_stage();
        }
        done
    }

    fn stage_removal(
        &self,
        step: &mut Step,
        trials: &[TrialEntry],
        subject: Option<&str>,
    ) -> Result<(), Error> {
        let mut by_partition: BTreeMap<(&str, &str), BTreeSet<&str>> = BTreeMap::new();
        for trial in trials {
            let partition = by_partition.entry((&trial.set, &trial.action)).or_default();
            partition.insert(&trial.trial);
        }
        let going: BTreeSet<&str> = trials.iter().map(|trial| trial.trial.as_str()).collect();
        for ((set, action), gone) in by_partition {
            let mut kept = Vec::new();
            for note in self.files(TRIALS).filter(|note| note.set == set && note.action == action) {
                for entry in self.trials_in(note)? {
                    if gone.contains(entry.trial.as_str()) {
                        step.sum.take(&digest(TRIALS, &entry));
                        step.trials = step.trials.saturating_sub(1);
                    } else {
                        kept.push(entry);
                    }
                }
                step.gone.insert(note.path.clone());
            }
            self.stage_frames_without(step, set, action, &gone, &mut kept)?;
            let rows: Vec<&TrialEntry> = kept.iter().collect();
            self.stage_catalogue(step, set, action, &rows, &gone)?;
            let mut labels = Vec::new();
            for note in self.files(LABELS).filter(|note| note.set == set && note.action == action) {
                for label in self.labels_in(note)? {
                    if gone.contains(label.trial.as_str()) {
                        step.sum.take(&digest(LABELS, &label));
                    } else {
                        labels.push(label);
                    }
                }
                step.gone.insert(note.path.clone());
            }
            self.stage_labels(step, set, action, &labels.iter().collect::<Vec<_>>(), &gone)?;
        }
        // A file may be the source of several trials.
        let mut sources: BTreeSet<String> =
            trials.iter().filter_map(|trial| trial.source_file.clone()).collect();
        if !sources.is_empty() {
            for note in self.files(TRIALS) {
                for entry in self.trials_in(note)? {
                    if let Some(source) = &entry.source_file
                        && !going.contains(entry.trial.as_str())
                    {
                        sources.remove(source);
                    }
                }
            }
        }
        step.gone.extend(sources);
        if subject.is_some() {
            self.stage_subjects(step, &[], subject)?;
        }
        Ok(())
    }

    /// Changes what is said of people; nothing if it is known already.
    ///
    /// # Errors
    /// What the file system says; the corpus is then as it was.
    pub fn tell_of(&mut self, subjects: &[SubjectEntry]) -> Result<(), Error> {
        let mut step = self.step()?;
        let mut done = self.stage_subjects(&mut step, subjects, None);
        if done.is_ok() && !step.moves.is_empty() {
            done = self.commit(step, "subjects", 0, 0, "");
        }
        if done.is_err() {
            self.clear_stage();
        }
        done
    }

    /// Adds labels to trials that are there.
    ///
    /// # Errors
    /// What the file system says; the corpus is then as it was.
    pub fn label(&mut self, labels: &[LabelEntry], words: &str) -> Result<(), Error> {
        let mut step = self.step()?;
        let mut by_partition: BTreeMap<(&str, &str), Vec<&LabelEntry>> = BTreeMap::new();
        for label in labels {
            step.sum.add(&digest(LABELS, label));
            by_partition.entry((&label.set, &label.action)).or_default().push(label);
        }
        let mut done = Ok(());
        for ((set, action), labels) in by_partition {
            done = done.and_then(|()| {
                self.stage_labels(&mut step, set, action, &labels, &BTreeSet::new())
            });
        }
        let done = done.and_then(|()| self.commit(step, "label", 0, 0, words));
        if done.is_err() {
            self.clear_stage();
        }
        done
    }

    /// Notes an export.
    ///
    /// # Errors
    /// What the file system says.
    pub fn note_export(&mut self, note: ExportNote) -> Result<(), Error> {
        let step = self.step()?;
        let mut exports = self.version.exports.clone();
        exports.retain(|known| known.path != note.path);
        exports.push(note);
        let before = std::mem::replace(&mut self.version.exports, exports);
        let done = self.commit(step, "", 0, 0, "");
        if done.is_err() {
            self.version.exports = before;
            self.clear_stage();
        }
        done
    }

    /// A step that changes nothing yet.
    fn step(&self) -> Result<Step, Error> {
        if self.lock.is_none() {
            return Err(Error::of(ErrorKind::Broke, "the corpus was opened to be read"));
        }
        let stage = self.path(STAGE);
        fs::create_dir_all(&stage)
            .map_err(|e| unwritten("cannot write into the corpus", &stage, &e))?;
        let sum = RowSum::of(&self.version.version).ok_or_else(|| {
            Error::of(ErrorKind::Malformed, "the version of the corpus is none")
                .at(self.path(VERSION).display().to_string())
                .got(self.version.version.clone())
        })?;
        Ok(Step {
            sum,
            trials: self.version.trials,
            frames: self.version.frames,
            ..Step::default()
        })
    }

    fn clear_stage(&self) {
        // Without a journal nothing of it counts; whoever comes next clears it otherwise.
        if !self.path(STAGE).join(JOURNAL).exists() {
            let _ = fs::remove_dir_all(self.path(STAGE));
        }
    }

    /// A name for a file of the step that will be in this partition.
    fn named(&self, step: &Step, folder: &str) -> String {
        format!("{folder}/part-{:06}-{}.parquet", self.version.number + 1, step.moves.len())
    }

    fn staged(&self, step: &Step) -> (String, PathBuf) {
        let name = format!("{STAGE}/{}", step.moves.len());
        let path = self.path(&name);
        (name, path)
    }

    fn stage_copy(
        &self,
        step: &mut Step,
        from: &Path,
        to: &str,
        sha256: Option<&str>,
    ) -> Result<(), Error> {
        let (name, path) = self.staged(step);
        let copy = || -> io::Result<String> {
            let (mut input, mut output) = (File::open(from)?, File::create(&path)?);
            let mut hash = Sha256::default();
            let mut buffer = vec![0; 1 << 16];
            loop {
                let count = input.read(&mut buffer)?;
                if count == 0 {
                    break;
                }
                hash.update(&buffer[..count]);
                output.write_all(&buffer[..count])?;
            }
            output.sync_data()?;
            Ok(hash.finish())
        };
        let found =
            copy().map_err(|e| unwritten("cannot copy the file into the corpus", from, &e))?;
        if sha256.is_some_and(|known| known != found) {
            return Err(Error::new("the file changed while it was added")
                .at(from.display().to_string())
                .remedy("add it again once nobody writes it"));
        }
        step.moves.push((name, to.to_owned()));
        Ok(())
    }

    /// Writes a table of a step.
    fn stage_table(
        &self,
        step: &mut Step,
        schema: &TableSchema,
        (table, set, action): (&str, &str, &str),
        fill: impl FnOnce(&mut TableFile<'_, BufWriter<File>>) -> Result<u64, Error>,
    ) -> Result<String, Error> {
        let folder = match table {
            SUBJECTS => String::new(),
            _ => partition(table, set, action),
        };
        // One table of people, of which DuckDB and others need no more than its name.
        let name = match table {
            SUBJECTS => format!("{SUBJECTS}.parquet"),
            _ => self.named(step, &folder),
        };
        let (staged, path) = self.staged(step);
        let unwritable = |e: &io::Error| unwritten("cannot write into the corpus", &self.root, e);
        let file = File::create(&path).map_err(|e| unwritable(&e))?;
        let of_corpus = |error: Error| match error.place {
            None => error.at(self.root.display().to_string()),
            Some(_) => error,
        };
        let written = TableFile::new(schema, BufWriter::new(file), Vec::new());
        let mut table_file = written.map_err(of_corpus)?;
        let rows = fill(&mut table_file).map_err(of_corpus)?;
        let file = table_file.finish().map_err(of_corpus)?;
        let file = file.into_inner().map_err(|e| unwritable(e.error()))?;
        file.sync_data().map_err(|e| unwritable(&e))?;
        drop(file);
        let (sha256, bytes) = hash_of(&path)?;
        step.moves.push((staged, name.clone()));
        step.notes.push(FileNote {
            path: name.clone(),
            table: table.to_owned(),
            set: set.to_owned(),
            action: action.to_owned(),
            rows,
            bytes,
            sha256,
        });
        Ok(name)
    }

    fn stage_frames(
        &self,
        step: &mut Step,
        set: &str,
        action: &str,
        trials: &mut [NewTrial],
    ) -> Result<(), Error> {
        if trials.iter().all(|trial| trial.frames.is_none()) {
            return Ok(());
        }
        let folder = partition(FRAMES, set, action);
        let name = self.named(step, &folder);
        let schema = &self.schemas.frames;
        let mut total = 0;
        self.stage_table(step, schema, (FRAMES, set, action), |table| {
            let mut columns = schema.empty();
            for trial in trials.iter_mut() {
                let Some(frames) = &trial.frames else { continue };
                if columns[0].len() + frames.len() > FRAMES_IN_GROUP && !columns[0].is_empty() {
                    table.write(&columns)?;
                    columns = schema.empty();
                }
                trial.entry.place = Some(FramesPlace {
                    file: name.clone(),
                    group: table.groups() as i64,
                    first_row: columns[0].len() as i64,
                });
                frames.push(&mut columns, &trial.entry.trial, trial.entry.rate_hz);
                total += frames.len() as u64;
            }
            if !columns[0].is_empty() {
                table.write(&columns)?;
            }
            Ok(total)
        })?;
        step.frames += total;
        Ok(())
    }

    /// Writes the files of frames of a partition again without those of some trials.
    fn stage_frames_without(
        &self,
        step: &mut Step,
        set: &str,
        action: &str,
        gone: &BTreeSet<&str>,
        kept: &mut [TrialEntry],
    ) -> Result<(), Error> {
        let mut touched = Vec::new();
        for note in self.files(FRAMES).filter(|note| note.set == set && note.action == action) {
            let table = self.table(&note.path)?;
            let mut has_gone = false;
            for group in 0..table.groups() {
                let ids = table.column(group, "trial", None)?;
                has_gone |=
                    (0..ids.len()).any(|row| ids.text(row).is_some_and(|id| gone.contains(id)));
            }
            if has_gone {
                touched.push(note);
            }
        }
        for note in touched {
            step.gone.insert(note.path.clone());
            step.frames = step.frames.saturating_sub(note.rows);
            let in_file = |entry: &TrialEntry| {
                entry.place.as_ref().is_some_and(|place| place.file == note.path)
            };
            let staying: Vec<TrialEntry> = kept.iter().filter(|e| in_file(e)).cloned().collect();
            let mut again = Vec::new();
            self.frames_of(&staying.iter().collect::<Vec<_>>(), |entry, frames| {
                again.push(NewTrial {
                    entry: entry.clone(),
                    frames: Some(frames),
                    labels: Vec::new(),
                    source: None,
                });
                Ok(())
            })?;
            self.stage_frames(step, set, action, &mut again)?;
            let places: BTreeMap<String, Option<FramesPlace>> =
                again.into_iter().map(|trial| (trial.entry.trial, trial.entry.place)).collect();
            for entry in kept.iter_mut().filter(|entry| in_file(entry)) {
                if let Some(place) = places.get(&entry.trial) {
                    entry.place.clone_from(place);
                }
            }
        }
        Ok(())
    }

    /// The small tables of a partition, if they are so many that they are put together.
    fn small(&self, step: &Step, table: &str, set: &str, action: &str) -> Vec<&FileNote> {
        let is_small = |note: &&FileNote| {
            note.set == set
                && note.action == action
                && note.rows < SMALL_ROWS
                && !step.gone.contains(&note.path)
        };
        let small: Vec<&FileNote> = self.files(table).filter(is_small).collect();
        if small.len() >= MOST_SMALL { small } else { Vec::new() }
    }

    fn stage_catalogue(
        &self,
        step: &mut Step,
        set: &str,
        action: &str,
        trials: &[&TrialEntry],
        without: &BTreeSet<&str>,
    ) -> Result<(), Error> {
        let mut before = Vec::new();
        for note in self.small(step, TRIALS, set, action) {
            before.extend(self.trials_in(note)?);
            step.gone.insert(note.path.clone());
        }
        before.retain(|entry| !without.contains(entry.trial.as_str()));
        let all: Vec<&TrialEntry> = before.iter().chain(trials.iter().copied()).collect();
        let schema = &self.schemas.trials;
        self.stage_rows(step, schema, (TRIALS, set, action), &all, |columns, entry| {
            push_trial(columns, entry);
        })
    }

    fn stage_labels(
        &self,
        step: &mut Step,
        set: &str,
        action: &str,
        labels: &[&LabelEntry],
        without: &BTreeSet<&str>,
    ) -> Result<(), Error> {
        let mut before = Vec::new();
        if !labels.is_empty() {
            for note in self.small(step, LABELS, set, action) {
                before.extend(self.labels_in(note)?);
                step.gone.insert(note.path.clone());
            }
        }
        before.retain(|entry| !without.contains(entry.trial.as_str()));
        let all: Vec<&LabelEntry> = before.iter().chain(labels.iter().copied()).collect();
        let schema = &self.schemas.labels;
        self.stage_rows(step, schema, (LABELS, set, action), &all, |columns, entry| {
            push_label(columns, entry);
        })
    }

    fn stage_rows<T>(
        &self,
        step: &mut Step,
        schema: &TableSchema,
        place: (&str, &str, &str),
        rows: &[&T],
        push: impl Fn(&mut [Column], &T),
    ) -> Result<(), Error> {
        if rows.is_empty() {
            return Ok(());
        }
        self.stage_table(step, schema, place, |table| {
            for group in rows.chunks(ROWS_IN_GROUP) {
                let mut columns = schema.empty();
                group.iter().for_each(|row| push(&mut columns, row));
                table.write(&columns)?;
            }
            Ok(rows.len() as u64)
        })
        .map(drop)
    }

    /// Writes the table of people again, with those who come or changed, and without one.
    fn stage_subjects(
        &self,
        step: &mut Step,
        subjects: &[SubjectEntry],
        without: Option<&str>,
    ) -> Result<(), Error> {
        let known = self.subjects()?;
        let mut all: BTreeMap<String, SubjectEntry> =
            known.iter().map(|of| (of.subject.id.clone(), of.clone())).collect();
        for subject in subjects {
            all.insert(subject.subject.id.clone(), subject.clone());
        }
        if let Some(id) = without {
            all.remove(id);
        }
        let all: Vec<SubjectEntry> = all.into_values().collect();
        if all == known {
            return Ok(());
        }
        known.iter().for_each(|of| step.sum.take(&digest(SUBJECTS, of)));
        all.iter().for_each(|of| step.sum.add(&digest(SUBJECTS, of)));
        let old: Vec<String> = self.files(SUBJECTS).map(|note| note.path.clone()).collect();
        let rows: Vec<&SubjectEntry> = all.iter().collect();
        let schema = &self.schemas.subjects;
        self.stage_rows(step, schema, (SUBJECTS, "", ""), &rows, |columns, entry| {
            push_subject(columns, entry);
        })?;
        // The new one has the old one's name; without people there is none.
        step.gone.extend(old);
        Ok(())
    }

    /// Does what was staged, as a whole.
    fn commit(
        &mut self,
        mut step: Step,
        deed: &str,
        added: u64,
        removed: u64,
        words: &str,
    ) -> Result<(), Error> {
        let mut version = self.version.clone();
        version.number += 1;
        version.version = step.sum.text();
        (version.trials, version.frames) = (step.trials, step.frames);
        version.files.retain(|note| !step.gone.contains(&note.path));
        version.files.append(&mut step.notes);
        version.files.sort_by(|a, b| a.path.cmp(&b.path));
        if !deed.is_empty() {
            let (version_after, words) = (version.version.clone(), words.to_owned());
            let deed = deed.to_owned();
            version.changes.push(Change { version: version_after, deed, added, removed, words });
        }
        let stage = self.path(STAGE);
        let staged = format!("{STAGE}/{VERSION}");
        write_file(&self.path(&staged), true, &as_json(&version)?)?;
        for (_, to) in &step.moves {
            let path = self.path(to);
            let folder = path.parent().unwrap_or(&self.root);
            fs::create_dir_all(folder)
                .map_err(|e| unwritten("cannot write into the corpus", folder, &e))?;
        }
        let kept: BTreeSet<&String> = step.moves.iter().map(|(_, to)| to).collect();
        let gone = step.gone.iter().filter(|path| !kept.contains(path)).cloned().collect();
        let mut moves = step.moves.clone();
        moves.push((staged, VERSION.to_owned()));
        synced_folder(&stage);
        write_file(&stage.join(JOURNAL), true, &as_json(&Journal { moves, gone })?)?;
        let Some(lock) = &self.lock else {
            return Err(Error::of(ErrorKind::Broke, "the corpus was opened to be read"));
        };
        recover(&self.root, lock)?;
        self.version = version;
        Ok(())
    }
}

/// The rows of a trial's frames in its row group.
fn rows_of(trial: &TrialEntry) -> Option<Range<usize>> {
    let first = usize::try_from(trial.place.as_ref()?.first_row).ok()?;
    Some(first..first.checked_add(usize::try_from(trial.frames).ok()?)?)
}

/// SHA-256 and length of a file.
///
/// # Errors
/// A file that cannot be read.
pub fn hash_of(path: &Path) -> Result<(String, u64), Error> {
    let unreadable = |e: io::Error| failed("the file cannot be read", path, &e);
    // A pipe would be waited for, and a folder has no bytes.
    if !path.metadata().map_err(unreadable)?.is_file() {
        return Err(Error::new("it is no file").at(path.display().to_string()));
    }
    let mut file = File::open(path).map_err(unreadable)?;
    let (mut hash, mut length, mut buffer) = (Sha256::default(), 0, vec![0; 1 << 16]);
    loop {
        let count = file.read(&mut buffer).map_err(unreadable)?;
        if count == 0 {
            return Ok((hash.finish(), length));
        }
        hash.update(&buffer[..count]);
        length += count as u64;
    }
}

fn as_json(value: &impl Serialize) -> Result<Vec<u8>, Error> {
    serde_json::to_string_pretty(value)
        .map(|text| (text + "\n").into_bytes())
        .map_err(|e| Error::new("the corpus cannot be described").got(e.to_string()))
}

/// Nobody else changes the corpus as long as this is kept.
fn locked(root: &Path) -> Result<File, Error> {
    let lock = File::open(root).map_err(|e| failed("cannot read the folder", root, &e))?;
    match lock.try_lock() {
        Err(TryLockError::WouldBlock) => {
            let busy = Error::of(ErrorKind::Busy, "another program changes this corpus")
                .at(root.display().to_string())
                .remedy("wait until it has ended");
            Err(match holder(&lock) {
                Some(who) => busy.got(who),
                None => busy,
            })
        }
        // Not every file system has locks.
        Ok(()) | Err(TryLockError::Error(_)) => Ok(lock),
    }
}

/// Who has locked a folder, as far as the system tells.
fn holder(folder: &File) -> Option<String> {
    let own = folder.metadata().ok()?;
    // Another file system may have a folder of the same number.
    let (major, minor) = (rustix::fs::major(own.dev()), rustix::fs::minor(own.dev()));
    let place = format!("{major:02x}:{minor:02x}:{}", own.ino());
    let locks = fs::read_to_string("/proc/locks").ok()?;
    let of = locks.lines().find_map(|line| {
        // "1: FLOCK  ADVISORY  WRITE 1234 fe:00:5678 0 EOF"; those that wait have an arrow there.
        let words: Vec<&str> = line.split_whitespace().collect();
        let is_it = words.get(1) == Some(&"FLOCK") && words.get(5) == Some(&place.as_str());
        is_it.then(|| words[4].to_owned())
    })?;
    let name = fs::read_to_string(format!("/proc/{of}/comm")).unwrap_or_default();
    Some(format!("process {of} ({})", name.trim()))
}

/// Does to its end what a killed process was about to do; without a journal, what it had begun is thrown away.
fn recover(root: &Path, _lock: &File) -> Result<(), Error> {
    let stage = root.join(STAGE);
    let path = stage.join(JOURNAL);
    if path.symlink_metadata().is_err() {
        if stage.exists() {
            fs::remove_dir_all(&stage).map_err(|e| failed("cannot clear", &stage, &e))?;
        }
        return Ok(());
    }
    let journal: Journal = read_json(&path)?;
    let names = journal.moves.iter().flat_map(|(from, to)| [from, to]).chain(&journal.gone);
    if let Some(strange) = names.clone().find(|name| !is_within(name)) {
        return Err(Error::of(
            ErrorKind::Malformed,
            "the journal names a file that is not in the corpus",
        )
        .at(path.display().to_string())
        .got(strange.clone()));
    }
    let mut folders = BTreeSet::new();
    for (from, to) in &journal.moves {
        let (from, to) = (root.join(from), root.join(to));
        if let Some(folder) = to.parent() {
            fs::create_dir_all(folder)
                .map_err(|e| unwritten("cannot make the folder", folder, &e))?;
            folders.insert(folder.to_owned());
        }
        match fs::rename(&from, &to) {
            // It was done before the process was killed.
            Err(e) if e.kind() == io::ErrorKind::NotFound && to.exists() => {}
            Err(e) => return Err(unwritten("cannot give a file of the corpus its name", &to, &e)),
            Ok(()) => {}
        }
    }
    folders.iter().for_each(|folder| synced_folder(folder));
    for gone in &journal.gone {
        let gone = root.join(gone);
        match fs::remove_file(&gone) {
            Err(e) if e.kind() != io::ErrorKind::NotFound => {
                return Err(failed("cannot remove a file of the corpus", &gone, &e));
            }
            _ => {}
        }
        // Folders that are empty now go as well; the others stay.
        let above = gone.ancestors().skip(1).take(2);
        above.take_while(|folder| *folder != root).for_each(|folder| drop(fs::remove_dir(folder)));
    }
    fs::remove_file(&path).map_err(|e| failed("cannot remove the journal", &path, &e))?;
    synced_folder(&stage);
    fs::remove_dir_all(&stage).map_err(|e| failed("cannot clear", &stage, &e))
}

fn is_within(name: &str) -> bool {
    let path = Path::new(name);
    path.components().all(|part| matches!(part, std::path::Component::Normal(_)))
}

fn read_json<T: serde::de::DeserializeOwned>(path: &Path) -> Result<T, Error> {
    let found = path.metadata().map_err(|e| failed("the file cannot be read", path, &e))?;
    if !found.is_file() {
        return Err(Error::new("it is no file").at(path.display().to_string()));
    }
    let length = found.len();
    if length > MAX_JSON {
        return Err(Error::of(ErrorKind::OutsideLimits, "the file is too large")
            .at(path.display().to_string())
            .got(counted(length, "byte")));
    }
    let text = fs::read_to_string(path).map_err(|e| failed("the file cannot be read", path, &e))?;
    serde_json::from_str(&text).map_err(|e| {
        Error::of(ErrorKind::Malformed, "a file of the corpus was changed into something else")
            .at(path.display().to_string())
            .got(e.to_string())
    })
}

fn manifest(root: &Path) -> Result<CorpusManifest, Error> {
    let path = root.join(MANIFEST);
    // A pipe or a device would be waited for.
    if path.metadata().is_ok_and(|found| !found.is_file()) {
        return Err(Error::of(ErrorKind::Malformed, "the manifest of the corpus is no file")
            .at(path.display().to_string())
            .got("a pipe, a device or a folder")
            .allowed("a file on a disk"));
    }
    match fs::read_to_string(&path) {
        Ok(text) => CorpusManifest::parse(&text).map_err(|error| error.in_file(&path)),
        Err(e) if e.kind() == io::ErrorKind::NotFound => {
            Err(Error::of(ErrorKind::Absent, "there is no corpus in this folder")
                .at(root.display().to_string())
                .remedy("`gaitway corpus new DIR` makes one"))
        }
        Err(e) => Err(failed("the manifest cannot be read", &path, &e)),
    }
}

fn version(root: &Path) -> Result<VersionFile, Error> {
    let path = root.join(VERSION);
    let version: VersionFile = read_json(&path)?;
    let is_whole = version.schema == SCHEMA
        && version.files.iter().all(|note| is_within(&note.path))
        && RowSum::of(&version.version).is_some();
    if is_whole {
        return Ok(version);
    }
    Err(Error::of(ErrorKind::Malformed, "a file of the corpus was changed into something else")
        .at(path.display().to_string())
        .allowed(format!("schema {SCHEMA}, files of this folder, a version of 64 digits")))
}

impl Drop for Store {
    fn drop(&mut self) {
        if self.lock.is_some() {
            self.clear_stage();
        }
    }
}
