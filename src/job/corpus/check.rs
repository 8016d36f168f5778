//! A corpus looked through: whole, readable, without doubles, with licences and consent.

use crate::corpus::licence::Licence;
use crate::corpus::rows::{Consent, TrialEntry, digest};
use crate::corpus::store::{Store, hash_of};
use crate::corpus::tables::{FRAMES, LABELS, SUBJECTS, TRIALS};
use crate::corpus::version::RowSum;
use crate::error::{Error, either};
use crate::job::report::Outcome;
use crate::job::report::counted;
use crate::job::{Event, Observer};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};
use std::path::{Path, PathBuf};

/// What was found.
#[derive(Clone, Debug, Serialize)]
pub struct CheckReport {
    /// `done`, or `failed` if something is wrong.
    pub outcome: Outcome,
    /// The folder of the corpus.
    pub corpus: String,
    /// Its version, as it says.
    pub version: String,
    /// Trials, labels, people and frames that were read.
    pub trials: u64,
    /// As `trials`.
    pub labels: u64,
    /// As `trials`.
    pub subjects: u64,
    /// As `trials`.
    pub frames: u64,
    /// Files that were read.
    pub files: u64,
    /// What is wrong.
    pub faults: Vec<Fault>,
    /// What a person should know and is no fault: licences that nobody said, consent that nobody noted.
    pub remarks: Vec<String>,
}

/// Something that is wrong.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Fault {
    /// `missing`, `changed`, `unreadable`, `stray`, `double`, `rows`, `frames`, `label`, `subject`, `version`.
    pub kind: &'static str,
    /// The file, or the trial.
    pub at: String,
    /// What.
    pub what: String,
}

/// Most faults that are told.
const MOST_TOLD: usize = 1000;
/// Most files and folders beside the corpus that are named.
const MOST_STRAYS: usize = 100;

/// Looks through a corpus: every byte of every file.
///
/// # Errors
/// No corpus, or one whose list of files cannot be read.
pub fn check(corpus: &Path, observer: &dyn Observer) -> Result<CheckReport, Error> {
    let store = Store::open(corpus)?;
    let report = CheckReport {
        outcome: Outcome::Done,
        corpus: super::shown(corpus),
        version: store.version().version.clone(),
        trials: 0,
        labels: 0,
        subjects: 0,
        frames: 0,
        files: 0,
        faults: Vec::new(),
        remarks: Vec::new(),
    };
    let mut looking = Looking {
        store,
        report,
        sources: HashSet::new(),
        sum: RowSum::default(),
        trials: HashMap::new(),
    };
    looking.files(observer)?;
    looking.rows(observer)?;
    looking.frames(observer)?;
    looking.sums();
    looking.strays();
    let mut report = looking.report;
    if !report.faults.is_empty() {
        report.outcome = Outcome::Failed;
        report.faults.truncate(MOST_TOLD);
    }
    Ok(report)
}

struct Looking {
    store: Store,
    report: CheckReport,
    /// Files that trials were made of.
    sources: HashSet<PathBuf>,
    sum: RowSum,
    /// How many frames each has, by its id.
    trials: HashMap<String, i64>,
}

impl Looking {
    fn fault(&mut self, kind: &'static str, at: impl Into<String>, what: impl Into<String>) {
        self.report.faults.push(Fault { kind, at: at.into(), what: what.into() });
    }

    fn files(&mut self, observer: &dyn Observer) -> Result<(), Error> {
        let notes = self.store.version().files.clone();
        let total = notes.len() as u64;
        for (done, note) in notes.iter().enumerate() {
            observer.hear(Event::Step { done: done as u64, total, what: "files" });
            crate::job::pending::go_on(observer)?;
            self.report.files += 1;
            match hash_of(&self.store.path(&note.path)) {
                Err(error) if error.kind == crate::error::ErrorKind::Absent => {
                    self.fault("missing", note.path.clone(), "the file is not there");
                }
                Err(error) => self.fault("unreadable", note.path.clone(), error.what),
                Ok((sha256, _)) if sha256 != note.sha256 => {
                    self.fault(
                        "changed",
                        note.path.clone(),
                        "its bytes are not those that were written",
                    );
                }
                Ok(_) => match self.store.table(&note.path) {
                    Err(error) => self.fault("unreadable", note.path.clone(), error.what),
                    Ok(table) if table.rows() != note.rows => {
                        let what = format!(
                            "{}, and {} {} noted",
                            counted(table.rows(), "row"),
                            note.rows,
                            either(note.rows, "is", "are")
                        );
                        self.fault("rows", note.path.clone(), what);
                    }
                    Ok(_) => {}
                },
            }
        }
        Ok(())
    }

    fn rows(&mut self, observer: &dyn Observer) -> Result<(), Error> {
        let (mut doubles, mut licences) =
            (HashMap::<String, String>::new(), BTreeMap::<String, u64>::new());
        let mut sources: BTreeMap<String, String> = BTreeMap::new();
        let mut named = BTreeSet::new();
        let notes: Vec<_> = self.store.files(TRIALS).cloned().collect();
        for note in notes {
            crate::job::pending::go_on(observer)?;
            let Ok(entries) = self.store.trials_in(&note) else {
                self.fault("unreadable", note.path.clone(), "its trials cannot be read");
                continue;
            };
            for entry in entries {
                self.report.trials += 1;
                self.sum.add(&digest(TRIALS, &entry));
                *licences.entry(entry.licence.clone()).or_default() += 1;
                named.extend(entry.subject.clone());
                if let Some(other) =
                    doubles.insert(entry.frames_sha256.clone(), entry.trial.clone())
                {
                    self.fault(
                        "double",
                        entry.trial.clone(),
                        format!("the same frames as {other}"),
                    );
                }
                if !entry.frames_sha256.starts_with(&entry.trial) || entry.trial.len() != 16 {
                    self.fault("rows", entry.trial.clone(), "its id is not that of its frames");
                }
                if let (Some(file), Some(hash)) = (&entry.source_file, &entry.source_sha256) {
                    sources.insert(file.clone(), hash.clone());
                }
                self.trials.insert(entry.trial.clone(), entry.frames);
            }
        }
        for (file, hash) in sources {
            self.report.files += 1;
            self.sources.insert(self.store.path(&file));
            match hash_of(&self.store.path(&file)) {
                Ok((found, _)) if found == hash => {}
                Ok(_) => self.fault("changed", file, "its bytes are not those that were added"),
                Err(_) => self.fault("missing", file, "the file a trial was made of is not there"),
            }
        }
        let unknown: u64 =
            licences.iter().filter(|(name, _)| Licence::of(name).unknown).map(|(_, n)| n).sum();
        if unknown > 0 {
            self.report.remarks.push(format!(
                "{unknown} {have} no licence: exports say so",
                unknown = counted(unknown, "trial"),
                have = either(unknown, "has", "have")
            ));
        }
        let noncommercial: u64 = licences
            .iter()
            .filter(|(name, _)| Licence::of(name).noncommercial)
            .map(|(_, n)| n)
            .sum();
        if noncommercial > 0 {
            let said = format!(
                "{noncommercial} {are} not for what earns money: exports say so",
                noncommercial = counted(noncommercial, "trial"),
                are = either(noncommercial, "is", "are")
            );
            self.report.remarks.push(said);
        }
        self.labels()?;
        self.people(&named)
    }

    fn labels(&mut self) -> Result<(), Error> {
        let notes: Vec<_> = self.store.files(LABELS).cloned().collect();
        for note in notes {
            let Ok(entries) = self.store.labels_in(&note) else {
                self.fault("unreadable", note.path.clone(), "its labels cannot be read");
                continue;
            };
            for label in entries {
                self.report.labels += 1;
                self.sum.add(&digest(LABELS, &label));
                let is_within = match self.trials.get(&label.trial) {
                    None => {
                        self.fault(
                            "label",
                            label.trial.clone(),
                            "a label of a trial that is not there",
                        );
                        continue;
                    }
                    Some(frames) => {
                        0 <= label.first_frame
                            && label.first_frame <= label.last_frame
                            && label.last_frame < *frames
                    }
                };
                if !is_within || ![0.5, 1.0].contains(&label.value) {
                    let what = format!(
                        "{} from frame {} to {}",
                        label.label, label.first_frame, label.last_frame
                    );
                    self.fault("label", label.trial, what);
                }
            }
        }
        Ok(())
    }

    fn people(&mut self, named: &BTreeSet<String>) -> Result<(), Error> {
        let people = match self.store.subjects() {
            Ok(people) => people,
            Err(error) => {
                self.fault("unreadable", "subjects.parquet", error.what);
                return Ok(());
            }
        };
        for person in &people {
            self.report.subjects += 1;
            self.sum.add(&digest(SUBJECTS, person));
            let id = person.subject.id.clone();
            if person.consent == Consent::Withdrawn && named.contains(&id) {
                let what = "consent was withdrawn, and there are trials: `corpus remove --subject`";
                self.fault("subject", id, what);
            } else if person.consent == Consent::Unknown && named.contains(&id) {
                self.report.remarks.push(format!("nobody noted what {id} allowed"));
            }
        }
        let known: HashSet<&String> = people.iter().map(|of| &of.subject.id).collect();
        for id in named.iter().filter(|id| !known.contains(id)) {
            self.fault("subject", id.clone(), "nothing is known of this person");
        }
        Ok(())
    }

    /// Reads all frames, and holds them against their hashes.
    fn frames(&mut self, observer: &dyn Observer) -> Result<(), Error> {
        let notes: Vec<_> = self.store.files(TRIALS).cloned().collect();
        let broken: HashSet<String> =
            self.report.faults.iter().map(|fault| fault.at.clone()).collect();
        for note in notes {
            crate::job::pending::go_on(observer)?;
            let Ok(mut entries) = self.store.trials_in(&note) else { continue };
            entries.retain(|of| of.place.as_ref().is_some_and(|p| !broken.contains(&p.file)));
            let key = |of: &TrialEntry| of.place.as_ref().map(|p| (p.file.clone(), p.group));
            entries.sort_by_key(key);
            for together in entries.chunk_by(|a, b| key(a) == key(b)) {
                let mut found = Vec::new();
                let read =
                    self.store.frames_of(&together.iter().collect::<Vec<_>>(), |of, frames| {
                        let is_same = frames.sha256(of.rate_hz) == of.frames_sha256;
                        found.push((of.trial.clone(), frames.len() as u64, is_same));
                        Ok(())
                    });
                if let Err(error) = read {
                    let at = together.first().map_or_else(String::new, |of| of.trial.clone());
                    self.fault("frames", at, error.to_string().replace('\n', ";"));
                }
                for (trial, frames, is_same) in found {
                    self.report.frames += frames;
                    if !is_same {
                        self.fault("frames", trial, "its frames are not those that were added");
                    }
                }
            }
        }
        Ok(())
    }

    fn sums(&mut self) {
        let version = self.store.version().clone();
        if self.report.faults.is_empty() && self.sum.text() != version.version {
            self.fault(
                "version",
                "version.json",
                format!("the rows are of version {}", self.sum.text()),
            );
        }
        let frames: u64 = self.store.files(FRAMES).map(|note| note.rows).sum();
        for (what, told, found) in
            [("trial", version.trials, self.report.trials), ("frame", version.frames, frames)]
        {
            if told != found {
                self.fault(
                    "version",
                    "version.json",
                    format!(
                        "{} {} noted, {found} {} there",
                        counted(told, what),
                        either(told, "is", "are"),
                        either(found, "is", "are")
                    ),
                );
            }
        }
    }

    /// What is no part of the corpus. Tables among its tables are faults: whoever reads the folder as it is would read them
    /// as well. Of what lies beside them it is only said that it is there.
    fn strays(&mut self) {
        let mut known: HashSet<PathBuf> = std::mem::take(&mut self.sources);
        known.extend(self.store.own_files());
        let parts: HashSet<PathBuf> =
            known.iter().flat_map(|file| file.ancestors().skip(1)).map(Path::to_owned).collect();
        let tables = [TRIALS, LABELS, FRAMES].map(|table| self.store.path(table));
        let (mut folders, mut among, mut beside) =
            (vec![self.store.root().to_owned()], Vec::new(), Vec::new());
        while let Some(folder) = folders.pop() {
            for entry in std::fs::read_dir(&folder).into_iter().flatten().flatten() {
                let path = entry.path();
                let is_folder = entry.file_type().is_ok_and(|kind| kind.is_dir());
                if is_folder
                    && (parts.contains(&path) || tables.iter().any(|of| path.starts_with(of)))
                {
                    let is_empty = std::fs::read_dir(&path).is_ok_and(|mut of| of.next().is_none());
                    if is_empty && !tables.contains(&path) {
                        beside.push(path);
                    } else {
                        folders.push(path);
                    }
                } else if is_folder || !known.contains(&path) {
                    let is_among = tables.iter().any(|of| path.starts_with(of));
                    if is_among { among.push(path) } else { beside.push(path) }
                }
            }
        }
        among.sort();
        for path in among {
            self.fault("stray", path.display().to_string(), "a file that is no part of the corpus");
        }
        beside.sort();
        let more = beside.len().saturating_sub(MOST_STRAYS);
        for path in beside.into_iter().take(MOST_STRAYS) {
            let remark = format!("no part of the corpus: {}", path.display());
            self.report.remarks.push(remark);
        }
        if more > 0 {
            self.report.remarks.push(format!("no part of the corpus: {more} more"));
        }
    }
}
