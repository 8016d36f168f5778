//! What a finished folder holds, and the five choices that make a motion database: type of data,
//! range of motion, range of subjects, definition and execution of actions, output.

use super::angles::WornMotion;
use super::files::{SCHEMA, SessionFile, TrialFile, Verdict};
use super::plan::{Plan, PlannedAction};
use super::steps::Progress;
use crate::body::anthropometry::{Measure, Subject};
use crate::error::counted;
use crate::time::Utc;
use serde::{Deserialize, Serialize};

/// `manifest.toml`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// Version of the format; 1.
    pub schema: u32,
    /// Name of the session.
    pub session: String,
    /// When it was begun.
    pub begun: Utc,
    /// When it was finished.
    pub finished: Utc,
    /// Who led it.
    pub operator: String,
    /// Where it was.
    pub place: String,
    /// Version of the program that finished it.
    pub gaitway_version: String,
    /// The five choices.
    pub choices: Choices,
    /// Files of the subjects.
    pub subjects: Vec<String>,
    /// Action by action.
    #[serde(rename = "action")]
    pub actions: Vec<ActionRow>,
    /// Trial by trial, those to be retaken included.
    #[serde(rename = "trial")]
    pub trials: Vec<TrialRow>,
}

/// The five choices, in words.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Choices {
    /// What was measured.
    pub data_type: String,
    /// Which motions.
    pub range_of_motion: String,
    /// Which people.
    pub range_of_subjects: String,
    /// What an action is, and how it was done.
    pub definition_and_execution: String,
    /// What comes out.
    pub output: String,
}

/// What there is of an action.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ActionRow {
    /// Its name.
    pub name: String,
    /// What subjects were told.
    pub explained: String,
    /// Good repetitions wanted of each subject.
    pub wanted_repetitions: u32,
    /// Good repetitions there are.
    pub good_repetitions: u32,
    /// True if the operator gave it up.
    pub skipped: bool,
}

/// A trial and its files.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrialRow {
    /// Name of the trial.
    pub name: String,
    /// Name of the action.
    pub action: String,
    /// Keep or retake.
    pub verdict: Verdict,
    /// Good repetitions that count.
    pub good_repetitions: u32,
    /// Who did it.
    pub subjects: Vec<String>,
    /// Recordings of its sensors.
    pub recordings: Vec<String>,
    /// Joint angles, of a trial that is kept.
    pub angles: Vec<String>,
    /// Segments without a sensor: they are at rest in the angles.
    pub not_worn: Vec<String>,
    /// Moments in which a worn sensor was silent, all sensors together.
    pub silent_samples: u64,
    /// Why there are no angles.
    pub no_angles: Option<String>,
    /// How long it is, s.
    pub duration_s: f64,
    /// What was held or used.
    pub props: String,
    /// What happened.
    pub notes: String,
}

impl TrialRow {
    /// A trial without its angles.
    #[must_use]
    pub fn of(trial: &TrialFile) -> Self {
        Self {
            name: trial.name(),
            action: trial.action.clone(),
            verdict: trial.verdict,
            good_repetitions: trial.counted(),
            subjects: trial.recordings.iter().map(|r| r.subject.clone()).collect(),
            recordings: trial.recordings.iter().map(|r| r.file.clone()).collect(),
            angles: Vec::new(),
            not_worn: Vec::new(),
            silent_samples: 0,
            no_angles: None,
            duration_s: trial.duration_s,
            props: trial.props.clone(),
            notes: trial.notes.clone(),
        }
    }

    /// Says where the angles are that were made of a motion.
    pub fn add_angles(&mut self, motion: &WornMotion, files: Vec<String>) {
        self.angles.extend(files);
        self.not_worn = motion.not_worn().into_iter().map(str::to_owned).collect();
        self.silent_samples += motion.silent_samples();
    }
}

impl Manifest {
    /// The manifest of a session in which `trials` were recorded.
    #[must_use]
    pub fn of(
        session: &SessionFile,
        progress: &Progress,
        trials: Vec<TrialRow>,
        finished: Utc,
    ) -> Self {
        let action = |action: &PlannedAction| ActionRow {
            name: action.name.clone(),
            explained: action.explain.clone(),
            wanted_repetitions: session.plan.wanted(action),
            good_repetitions: progress.good(&action.name),
            skipped: session.skipped.contains(&action.name),
        };
        Self {
            schema: SCHEMA,
            session: session.name.clone(),
            begun: session.begun,
            finished,
            operator: session.operator.clone(),
            place: session.place.clone(),
            gaitway_version: env!("CARGO_PKG_VERSION").to_owned(),
            choices: choices(session, progress),
            subjects: session.subjects.iter().map(|id| format!("subjects/{id}.toml")).collect(),
            actions: session.plan.actions.iter().map(action).collect(),
            trials,
        }
    }
}

fn choices(session: &SessionFile, progress: &Progress) -> Choices {
    let names: Vec<&str> = session.plan.actions.iter().map(|a| a.name.as_str()).collect();
    let kept = progress.trials.iter().filter(|trial| trial.verdict == Verdict::Keep).count();
    let subjects: Vec<String> = progress.subjects.values().map(described).collect();
    Choices {
        data_type: format!(
            "angular rate, acceleration and fused orientation of {}, on one clock",
            counted(session.sources.len(), "worn sensor")
        ),
        range_of_motion: format!(
            "{}, each by itself: {}",
            counted(names.len(), "action"),
            names.join(", ")
        ),
        range_of_subjects: subjects.join("; "),
        definition_and_execution: format!(
            "names of a controlled vocabulary; explained, practised, then recorded in {}, \
             {kept} of them kept; {} wanted of each action and subject; keep or \
             retake by the operator",
            counted(progress.trials.len(), "trial"),
            counted(wanted(&session.plan), "good repetition")
        ),
        output: format!(
            "MCAP with raw samples and orientation; joint angles of a 22-DOF body at {} Hz as CSV \
             and BVH",
            session.plan.rate_hz
        ),
    }
}

/// `10`, or `2 to 10`.
fn wanted(plan: &Plan) -> String {
    let wanted = || plan.actions.iter().map(|action| plan.wanted(action));
    match (wanted().min(), wanted().max()) {
        (Some(least), Some(most)) if least < most => format!("{least} to {most}"),
        (Some(all), _) => all.to_string(),
        _ => String::new(),
    }
}

fn described(subject: &Subject) -> String {
    let mut words = subject.id.clone();
    if !subject.gender.is_empty() {
        words += &format!(", {}", subject.gender);
    }
    for measure in [Measure::Age, Measure::Stature, Measure::Mass] {
        if let Some(value) = subject.measure(measure) {
            words += &format!(", {value} {}", measure.unit());
        }
    }
    words
}
