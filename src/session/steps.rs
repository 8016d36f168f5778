//! What comes next, from what is on the disk.

use super::files::{BodyCheck, DeviceCheck, SessionFile, TrialFile, trial_of};
use super::folder::Folder;
use crate::body::anthropometry::{Subject, check_id};
use crate::body::worn::kept::Kept;
use crate::error::Error;
use crate::time::Utc;
use std::collections::{BTreeMap, BTreeSet};

/// All that is known of a session.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Progress {
    /// What the session is, once that is known.
    pub session: Option<SessionFile>,
    /// Subjects by id.
    pub subjects: BTreeMap<String, Subject>,
    /// The last device calibration that may be used.
    pub device: Option<DeviceCheck>,
    /// The last calibration of each subject that may be used.
    pub bodies: BTreeMap<String, Body>,
    /// Device calibrations and calibrations of subjects that were made, good or not, by name of
    /// file without ending.
    pub attempts: BTreeSet<String>,
    /// Trials that were judged, by name.
    pub trials: Vec<TrialFile>,
    /// Trials that were recorded and not judged, and their recordings.
    pub unjudged: BTreeMap<String, Vec<String>>,
    /// True once the manifest is written.
    pub finished: bool,
}

/// A subject's calibration.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    /// How well it is known.
    pub check: BodyCheck,
    /// How sensors sit.
    pub kept: Kept,
}

/// What is to be done.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Step {
    /// Ask what the session is.
    SetUp,
    /// Measure this subject.
    Subject(String),
    /// Lay all sensors down and look whether they are steady.
    Device,
    /// Put the sensors on this subject and find out how they sit.
    Body(String),
    /// Say what is thought of this trial.
    Judge(String),
    /// Record this trial: index of the action in the plan, number of the trial, subjects.
    Trial(usize, u32, Vec<String>),
    /// Everything is there: export angles, write the manifest.
    Finish,
    /// Nothing.
    Finished,
}

/// What the session is, if it was begun. Ids become names of files, and somebody may have edited it.
fn session(folder: &Folder) -> Result<Option<SessionFile>, Error> {
    let session: Option<SessionFile> = folder.read("session.toml")?;
    for id in session.iter().flat_map(|session| &session.subjects) {
        check_id(id).map_err(|error| error.at("session.toml"))?;
    }
    Ok(session)
}

impl Progress {
    /// Reads what is there.
    ///
    /// # Errors
    /// A file that cannot be read or was changed into something else.
    pub fn read(folder: &Folder) -> Result<Self, Error> {
        let mut progress = Self {
            session: session(folder)?,
            finished: folder.has("manifest.toml"),
            ..Self::default()
        };
        for name in folder.names("subjects", ".toml") {
            let file = format!("subjects/{name}.toml");
            if let Some(subject) = folder.read::<Subject>(&file)? {
                subject.check().map_err(|e| e.at(file))?;
                progress.subjects.insert(name, subject);
            }
        }
        // The last one that is good counts.
        for name in folder.names("calibration", ".toml") {
            let file = format!("calibration/{name}.toml");
            if name.starts_with("device-") {
                let check: Option<DeviceCheck> = folder.read(&file)?;
                let newer = |check: &DeviceCheck| {
                    progress.device.as_ref().is_none_or(|known| known.made <= check.made)
                };
                if let Some(check) = check.filter(|c| c.is_usable() && newer(c)) {
                    progress.device = Some(check);
                }
            } else if let Some(kept) = name.strip_suffix("-check") {
                let check: Option<BodyCheck> = folder.read(&file)?;
                let newer = |check: &BodyCheck| {
                    let known = progress.bodies.get(&check.subject);
                    known.is_none_or(|known| known.check.made <= check.made)
                };
                if let Some(check) = check.filter(|check| check.passed && newer(check)) {
                    let file = format!("calibration/{kept}.toml");
                    let kept = folder.text(&file)?.map(|text| Kept::parse(&text));
                    if let Some(kept) = kept.transpose().map_err(|e| e.at(file))? {
                        progress.bodies.insert(check.subject.clone(), Body { check, kept });
                    }
                }
            }
            progress.attempts.insert(name);
        }
        for name in folder.names("trials", ".toml") {
            progress.trials.extend(folder.read::<TrialFile>(&format!("trials/{name}.toml"))?);
        }
        for stem in folder.names("trials", ".mcap") {
            // NAME-NN, or NAME-NN.SUBJECT; a recovered file stands beside its original.
            let name = stem.split('.').next().unwrap_or(&stem).to_owned();
            let judged = progress.trials.iter().any(|trial| trial.name() == name);
            if !judged && trial_of(&name).is_some() && !stem.ends_with(".recovered") {
                let files = progress.unjudged.entry(name).or_default();
                files.push(format!("trials/{stem}.mcap"));
            }
        }
        Ok(progress)
    }

    /// What comes next at this moment.
    #[must_use]
    pub fn next(&self, now: Utc) -> Step {
        self.ahead(now).into_iter().next().unwrap_or(Step::Finished)
    }

    /// All that is to be done, in its order, as far as it is known at this moment: what comes next is the first. An action
    /// of which several repetitions are missing stands there once for each that does it.
    #[must_use]
    pub fn ahead(&self, now: Utc) -> Vec<Step> {
        let Some(session) = &self.session else { return vec![Step::SetUp] };
        if self.finished {
            return vec![Step::Finished];
        }
        let unknown = session.subjects.iter().filter(|id| !self.subjects.contains_key(*id));
        let mut steps: Vec<Step> = unknown.cloned().map(Step::Subject).collect();
        steps.extend(self.unjudged.keys().cloned().map(Step::Judge));
        let open = self.open(session);
        if !open.is_empty() {
            if self.device.as_ref().is_none_or(|check| check.expires <= now) {
                steps.push(Step::Device);
            }
            let stale =
                |id: &&String| self.bodies.get(*id).is_none_or(|body| body.check.expires <= now);
            steps.extend(session.subjects.iter().filter(stale).cloned().map(Step::Body));
        }
        steps.extend(open.into_iter().map(|(action, subjects)| {
            Step::Trial(action, self.next_number(&session.plan.actions[action].name), subjects)
        }));
        steps.push(Step::Finish);
        steps
    }

    /// Good repetitions of an action so far.
    #[must_use]
    pub fn good(&self, action: &str) -> u32 {
        self.trials.iter().filter(|trial| trial.action == action).map(TrialFile::counted).sum()
    }

    /// Good repetitions of an action by exactly these subjects so far.
    #[must_use]
    pub fn good_by(&self, action: &str, subjects: &[String]) -> u32 {
        self.trials_by(action, subjects).map(TrialFile::counted).sum()
    }

    /// True if there is a trial of this action by exactly these subjects, good or not.
    #[must_use]
    pub fn has_tried(&self, action: &str, subjects: &[String]) -> bool {
        self.trials_by(action, subjects).next().is_some()
    }

    fn trials_by(&self, action: &str, subjects: &[String]) -> impl Iterator<Item = &TrialFile> {
        self.trials.iter().filter(move |trial| {
            trial.action == action
                && trial.recordings.len() == subjects.len()
                && trial.recordings.iter().all(|r| subjects.contains(&r.subject))
        })
    }

    /// The number a new trial of an action gets: no number is used twice.
    #[must_use]
    pub fn next_number(&self, action: &str) -> u32 {
        let judged = self.trials.iter().map(TrialFile::name);
        let names = judged.chain(self.unjudged.keys().cloned());
        let of_action = |name: String| trial_of(&name).filter(|(of, _)| *of == action).map(|n| n.1);
        1 + names.filter_map(of_action).max().unwrap_or(0)
    }

    /// Name of the next calibration file of this kind, without ending: `device` or `body-ID`.
    #[must_use]
    pub fn next_attempt(&self, kind: &str) -> String {
        let number =
            |name: &String| name.strip_prefix(kind)?.strip_prefix('-')?.parse::<u32>().ok();
        let last = self.attempts.iter().filter_map(number).max().unwrap_or(0);
        format!("{kind}-{:02}", last + 1)
    }

    /// The actions of which repetitions are missing, and whose.
    fn open(&self, session: &SessionFile) -> Vec<(usize, Vec<String>)> {
        let plan = &session.plan;
        let mut all = Vec::new();
        for (index, action) in plan.actions.iter().enumerate() {
            if session.skipped.contains(&action.name) {
                continue;
            }
            // Who is to do it: all at once, or one after the other.
            let size = if action.together { session.subjects.len().max(1) } else { 1 };
            let parties = session.subjects.chunks(size);
            let open = |ids: &&[String]| self.good_by(&action.name, ids) < plan.wanted(action);
            all.extend(parties.filter(open).map(|subjects| (index, subjects.to_vec())));
        }
        all
    }
}

impl DeviceCheck {
    /// True if every sensor passed, or somebody said why it is used all the same.
    #[must_use]
    pub fn is_usable(&self) -> bool {
        self.passed || !self.accepted_because.is_empty()
    }
}
