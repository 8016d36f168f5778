//! A session in words: what happens, what is asked, and what may be answered. A terminal says them and a page shows them.

use super::happening::{CutShort, Happening, RecordedTrial, Settled, TrialFault};
use super::operator::{Doubt, Judged, Ready, Words};
use crate::action::vocabulary;
use crate::body::anthropometry::Measure;
use crate::body::segment_name;
use crate::body::worn::check::T_POSE_FAIL_RAD;
use crate::error::{Error, either};
use crate::job::cues;
use crate::job::report::counted;
use crate::session::{SensorCheck, SessionFile, Step, Verdict};
use std::fmt::Write;

/// A question as it is put.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Asking {
    /// What is said before it; may be empty.
    pub before: String,
    /// What is asked.
    pub question: String,
    /// What may be typed, and what that means; empty: words or a number. The first is meant by Enter alone.
    pub choices: Vec<(&'static str, &'static str)>,
}

/// What may be typed, and what that means.
type Choices<'a> = &'a [(&'static str, &'static str)];

impl Asking {
    fn of(question: impl Into<String>, choices: Choices<'_>) -> Self {
        Self { before: String::new(), question: question.into(), choices: choices.to_vec() }
    }

    fn after(self, before: String) -> Self {
        Self { before, ..self }
    }

    /// The question and, under it, what may be answered, if that is a choice.
    #[must_use]
    pub fn text(&self) -> String {
        let named = self.choices.iter().enumerate().map(|(at, (key, words))| match at {
            0 => format!("Enter or {key}: {words}"),
            _ => format!("{key}: {words}"),
        });
        let named: Vec<String> = named.collect();
        match named.is_empty() {
            true => self.question.clone(),
            false => {
                format!("{}\n  [{}; q: stop, to go on later]", self.question, named.join("; "))
            }
        }
    }

    /// What is to be seen to.
    #[must_use]
    pub fn ready(what: &Ready<'_>) -> Self {
        match what {
            Ready::LyingStill { sensors } => {
                Self::of("Do they lie still?", &[("y", "measure")]).after(format!(
                    "\nDevice calibration. Lay all sensors down ({}), for example on a table, and do not touch it.",
                    sensors.join(", ")
                ))
            }
            Ready::Worn { subject, segments } => {
                let worn: Vec<&str> = segments.iter().map(|s| segment_name(*s)).collect();
                Self::of("Are they on?", &[("y", "begin")]).after(format!(
                    "\nCalibration of subject {subject}. Put the sensors on: {}; X forward where nothing else is known. Face the \
                     same way throughout.",
                    worn.join(", ")
                ))
            }
            Ready::Again { error } => {
                Self::of("It did not work.", &[("r", "repeat")]).after(format!("! {error}"))
            }
            Ready::Explained => {
                Self::of("Explain it and show it.", &[("y", "it is understood")])
            }
            Ready::Practised => {
                Self::of("Let it be practised; nothing is recorded.", &[("y", "it works")])
            }
            Ready::Retake { trial } => Self::of(keeps(trial), &[("r", "retake")]),
        }
    }

    /// Words that are asked for.
    #[must_use]
    pub fn words(what: &Words<'_>) -> Self {
        let id = |who| {
            format!("id of the {who}, needed: small letters, digits, - (such as s01; no real name)")
        };
        let question = match what {
            Words::SessionName { usual } => format!("name of the session [Enter: {usual}]"),
            Words::Leader => "operator (who leads it)".to_owned(),
            Words::Place => "place".to_owned(),
            Words::Remarks => "remarks".to_owned(),
            Words::Explanation { action } => {
                format!(
                    "{action} is not in the vocabulary. What is done, in a sentence? [Enter: it was mistyped]"
                )
            }
            Words::FirstSubject => id("subject"),
            Words::SecondSubject => id("second subject"),
            Words::Gender => "gender, in the subject's words".to_owned(),
            Words::SubjectRemarks => "remarks: actions that are not possible, injuries".to_owned(),
            Words::WhyAccepted => "why?".to_owned(),
            Words::Notes => "notes".to_owned(),
            Words::WhatWasWrong => "what was wrong".to_owned(),
            Words::Changed { choices } => {
                format!("what is to be changed? [{}; Enter: nothing]", choices.join(", "))
            }
            Words::Props { usual } => {
                let said = if usual.is_empty() { "nothing" } else { usual };
                format!("props: what was held or used [Enter: {said}]")
            }
        };
        Self::of(question, &[])
    }

    /// Which actions are recorded.
    #[must_use]
    pub fn actions() -> Self {
        let names = vocabulary::names().collect::<Vec<_>>().join(" ");
        Self::of(
            format!(
                "actions to be recorded, with spaces between; of one of your own it is asked what is done\n  [{names}]"
            ),
            &[],
        )
    }

    /// A measure.
    #[must_use]
    pub fn measure(measure: Measure) -> Self {
        let needed = if measure.is_required() { ", needed" } else { "" };
        Self::of(format!("{}{needed} [{}]", measure.words(), measure.allowed()), &[])
    }

    /// Whether a measure is right.
    #[must_use]
    pub fn is_right(doubt: &Doubt<'_>) -> Self {
        let Doubt { measure, value, why } = doubt;
        let question = format!("{value} {}: {why}. Is it right?", measure.unit());
        Self::of(question, &[("n", "ask again"), ("y", "it is right")])
    }

    /// What becomes of sensors of which one did not pass.
    #[must_use]
    pub fn unsteady() -> Self {
        let choices =
            [("r", "repeat (what was measured is kept)"), ("a", "go on with them all the same")];
        Self::of("Not every sensor is good.", &choices)
    }

    /// What is done about headings that were not found.
    #[must_use]
    pub fn mend(error: &Error) -> Self {
        let choices = [("r", "once more"), ("c", "subject calibration again")];
        Self::of("It did not work.", &choices).after(format!("! {error}"))
    }

    /// What is kept; the usual first.
    #[must_use]
    pub fn judge(what: &Judged<'_>, usual: Verdict) -> Self {
        let (question, before, keep, retake) = match what {
            Judged::Calibration { notes } => {
                let notes: Vec<String> = notes.iter().map(|note| format!("  {note}")).collect();
                let question = "Keep this calibration?".to_owned();
                (question, notes.join("\n"), "keep it", "repeat (what was measured is kept)")
            }
            Judged::Trial { trial } => (keeps(trial), String::new(), "keep", "retake"),
        };
        let mut choices = [("k", keep), ("r", retake)];
        if usual == Verdict::Retake {
            choices.reverse();
        }
        Self::of(question, &choices).after(before)
    }

    /// What comes next.
    #[must_use]
    pub fn wish(trial: &str) -> Self {
        let choices = [
            ("y", "record"),
            ("d", "device calibration again"),
            ("c", "subject calibration again"),
            ("g", "give this action up"),
            ("e", "change what was answered"),
        ];
        Self::of(format!("Record {trial}?"), &choices)
    }

    /// How many repetitions are good.
    #[must_use]
    pub fn repetitions(marked: usize) -> Self {
        let question = format!("good repetitions in it [Enter: {marked}, as many as were marked]");
        Self::of(question, &[])
    }
}

fn keeps(trial: &str) -> String {
    format!("Trial {trial}: keep it?")
}

/// A step that is to be done.
#[must_use]
pub fn of_step(step: &Step, session: Option<&SessionFile>) -> String {
    let action = |at: usize| session.and_then(|session| session.plan.actions.get(at));
    match step {
        Step::SetUp => "what the session is".to_owned(),
        Step::Subject(id) => format!("measures of subject {id}"),
        Step::Device => "device calibration".to_owned(),
        Step::Body(id) => format!("calibration of subject {id}"),
        Step::Judge(trial) => format!("trial {trial} is judged"),
        Step::Trial(at, _, subjects) => {
            let name = action(*at).map_or("a trial", |action| action.name.as_str());
            format!("{name}, {}", subjects.join(" and "))
        }
        Step::Finish => "joint angles and the manifest".to_owned(),
        Step::Finished => "nothing".to_owned(),
    }
}

/// What became of something, and why, in a line.
#[must_use]
pub fn of_settled(settled: &Settled<'_>) -> String {
    let with = |text: String, why: &str| match why.is_empty() {
        true => text,
        false => format!("{text} ({why})"),
    };
    match settled {
        Settled::Devices(check) => {
            let bad = check.sensors.iter().filter(|sensor| !sensor.passed);
            let why: Vec<String> =
                bad.map(|sensor| format!("{}: {}", sensor.name, sensor.why.join("; "))).collect();
            match (check.passed, check.accepted_because.as_str()) {
                (true, _) => "device calibration: kept".to_owned(),
                (false, "") => {
                    with("device calibration: to be repeated".to_owned(), &why.join(", "))
                }
                (false, because) => {
                    with("device calibration: kept all the same".to_owned(), because)
                }
            }
        }
        Settled::Body(check) => {
            let verdict = if check.passed { "kept" } else { "to be repeated" };
            let text = format!("calibration of subject {}: {verdict}", check.subject);
            with(text, &check.notes.join("; "))
        }
        Settled::Trial(trial) => with(
            match trial.verdict {
                Verdict::Keep => {
                    let good = counted(trial.good_repetitions, "good repetition");
                    format!("trial {}: kept, {good}", trial.name())
                }
                Verdict::Retake => format!("trial {}: to be retaken", trial.name()),
            },
            &trial.notes,
        ),
    }
}

/// What is said of what happens; nothing of what only a page shows.
#[must_use]
pub fn told(happening: &Happening<'_>) -> String {
    match *happening {
        Happening::Ahead { .. } | Happening::Heard(_) | Happening::Posed { .. } => String::new(),
        Happening::Settled(settled) => of_settled(&settled),
        Happening::GoingOn(session) => {
            format!("Session {}, begun {}: going on where it was.", session.name, session.begun)
        }
        Happening::NewSession => {
            "Session. Enter alone leaves out what is not needed; back goes to the question before; q stops at any \
             question."
                .to_owned()
        }
        Happening::Refused(error) | Happening::Unreadable(error) => format!("! {error}"),
        Happening::NotShown(error) => format!("Nothing shows how it is done: {error}"),
        Happening::Measures { subject } => format!(
            "\nSubject {subject}. Measures; Enter alone: not measured; a dot: nothing more is \
             measured; back: the question before. Only the stature is needed."
        ),
        Happening::KnownSubject { subject } => {
            format!("\nSubject {subject}: measured in another session, and not asked again.")
        }
        Happening::Editing { what } => format!(
            "\nWhat was answered of {what}. Enter: as it is; back: the question before."
        ),
        Happening::AsItIs { words } => match words.is_empty() {
            true => "now: nothing".to_owned(),
            false => format!("now: {words} [Enter: as it is; -: nothing]"),
        },
        Happening::MeasuringStill { seconds } => format!("measuring for {seconds} s"),
        Happening::SensorChecked(check) => of_sensor(check),
        Happening::Written { file, holds_until } => {
            format!("written: {file}; it holds until {holds_until}")
        }
        Happening::InTPose { worst_rad } => format!(
            "measured error in T pose: at most {:.1} deg ({:.0} allowed)",
            worst_rad.to_degrees(),
            T_POSE_FAIL_RAD.to_degrees()
        ),
        Happening::FacingForward { subject } => format!("subject {subject}:"),
        Happening::NextTrial { number, total, action, subjects, good, wanted } => {
            let mut text = format!(
                "\n[{number}/{total}] {}, {}: {good} of {wanted}\n  {}",
                action.name,
                subjects.join(" and "),
                action.explain,
                wanted = counted(wanted, "good repetition")
            );
            if !action.props.is_empty() {
                let _ = write!(text, "\n  props: {}", action.props);
            }
            text
        }
        Happening::Recording { trial } => format!(
            "RECORDING {trial}. Enter or space: a good repetition is done; x: a bad one; a dot: the end; other words and \
             Enter: a note"
        ),
        Happening::Marked { note, good, bad, time_s } => {
            let note = note.map_or_else(String::new, |note| format!("; note: {note}"));
            format!("  {time_s:.1} s: {good} good, {bad} bad{note}")
        }
        Happening::CutShort(CutShort::Disk { cause }) => {
            format!("! it ends here, the disk fails: {cause}")
        }
        Happening::CutShort(CutShort::Sensor { name, why }) => {
            format!("! it ends here, sensor {name} is gone: {why}")
        }
        Happening::NotAllRecorded => {
            "! the disk could not keep up, or failed: not all of it is recorded".to_owned()
        }
        Happening::Unjudged { trial } => {
            format!("\nTrial {trial} was recorded and not judged.")
        }
        Happening::Recorded(trial) => of_trial(trial),
        Happening::Finishing => "\nAll actions are recorded. Joint angles:".to_owned(),
        Happening::Angles { files } => format!("  {}", files.join(", ")),
        Happening::NoAngles { recording, error } => format!("  ! {recording}: {error}"),
        Happening::NotAnnounced(error) => {
            format!("! others cannot read what is asked for now; the session goes on: {error}")
        }
        Happening::Sensing(event) => cues::of_event(event),
    }
}

fn of_sensor(sensor: &SensorCheck) -> String {
    let SensorCheck { name, samples, rate_hz, .. } = sensor;
    let mut line = format!(
        "  {name:<16} {}  {samples}, {rate_hz:.1} per second",
        if sensor.passed { "pass  " } else { "REPEAT" },
        samples = counted(*samples, "sample")
    );
    let deg = |rad: f64| rad.to_degrees();
    if let (Some(noise), Some(bias)) = (sensor.noise_rad_s, sensor.bias_rad_s) {
        line += &format!(", noise {:.2} deg/s, bias {:.2} deg/s", deg(noise), deg(bias));
    }
    if let Some(drift) = sensor.heading_drift_rad_s {
        line += &format!(", drift {:+.1} deg/min", deg(drift) * 60.0);
    }
    for why in &sensor.why {
        line += &format!("\n    {why}");
    }
    line
}

/// Each recording with its sensors, then what is wrong, then what tells whether times agree.
fn of_trial(recorded: &RecordedTrial) -> String {
    let mut lines = Vec::new();
    for part in &recorded.parts {
        lines.push(format!("{}: {:.1} s", recorded.trial, part.duration_s));
        let said = part.samples.iter();
        lines.extend(said.map(|(sensor, samples)| {
            format!("  {sensor:<16} {samples}", samples = counted(*samples, "sample"))
        }));
    }
    lines.extend(recorded.faults.iter().map(|fault| format!("  ! {}", of_fault(fault))));
    lines.extend(recorded.taps.iter().map(|tap| format!("  tap {}", tap.words())));
    lines.join("\n")
}

fn of_fault(fault: &TrialFault) -> String {
    match fault {
        TrialFault::CutOff => "it was cut off: its last second may be missing".to_owned(),
        TrialFault::Missing { samples } => format!(
            "{samples} {are} missing",
            samples = counted(samples, "sample"),
            are = either(samples, "is", "are")
        ),
        TrialFault::Hole { sensor, from_s, seconds } => {
            format!("{sensor} says nothing from {from_s:.1} s on, for {seconds:.1} s")
        }
        TrialFault::Swapped { what } => what.clone(),
        TrialFault::Doubted { what, .. } => what.join("; "),
        TrialFault::Unheard { sensor } => format!("{sensor} said nothing in it"),
        TrialFault::Silent { sensor, seconds } => {
            format!("{sensor} is silent for the last {seconds:.1} s")
        }
    }
}
