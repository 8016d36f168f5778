//! What an operator is asked, in words, and how a typed line answers it.

use super::console::Console;
use super::told;
use crate::action::vocabulary;
use crate::body::anthropometry::Measure;
use crate::body::segment_name;
use crate::error::Error;
use crate::job::session::{
    Answered, Doubt, During, Happening, Judged, Mark, MeasureAnswer, Mend, Operator, Ready,
    Repetitions, Stopped, Unsteady, Wish, Words,
};
use crate::sensing::Person;
use crate::session::Verdict;
use crate::time::Duration;

impl Operator for Console {
    fn person(&self) -> &dyn Person {
        &self.person
    }

    fn hear(&self, happening: Happening<'_>) {
        let text = told::of(&happening);
        if matches!(happening, Happening::Recording { .. }) {
            self.forget_typed();
        }
        match happening {
            // Beside the dialogue, and not if the rest is to be quiet.
            Happening::Sensing(_) => self.remarks.say(&text),
            _ => self.say(&text),
        }
    }

    fn ready(&self, what: Ready<'_>) -> Answered<()> {
        let choose = |question: &str, key, words| self.choose(question, &[(key, words, ())]);
        match what {
            Ready::LyingStill { sensors } => {
                self.say(&format!(
                    "\nDevice calibration. Lay all sensors down ({}), for example on a table, and \
                     do not touch it.",
                    sensors.join(", ")
                ));
                choose("Do they lie still?", "y", "measure")
            }
            Ready::Worn { subject, segments } => {
                let worn: Vec<&str> = segments.iter().map(|s| segment_name(*s)).collect();
                self.say(&format!(
                    "\nCalibration of subject {subject}. Put the sensors on: {}; X forward where \
                     nothing else is known. Face the same way throughout.",
                    worn.join(", ")
                ));
                choose("Are they on?", "y", "begin")
            }
            Ready::Again { error } => {
                self.say(&format!("! {error}"));
                choose("It did not work.", "r", "repeat")
            }
            Ready::Explained => choose("Explain it and show it.", "y", "it is understood"),
            Ready::Practised => {
                choose("Let it be practised; nothing is recorded.", "y", "it works")
            }
            Ready::Retake { trial } => choose(&keeps(trial), "r", "retake"),
        }
    }

    fn words(&self, what: Words<'_>) -> Answered<String> {
        self.ask(&match what {
            Words::SessionName { usual } => format!("name of the session [Enter: {usual}]"),
            Words::Leader => "operator (who leads it)".to_owned(),
            Words::Place => "place".to_owned(),
            Words::Remarks => "remarks".to_owned(),
            Words::FirstSubject => id("subject"),
            Words::SecondSubject => id("second subject"),
            Words::Gender => "gender, in the subject's words".to_owned(),
            Words::SubjectRemarks => "remarks: actions that are not possible, injuries".to_owned(),
            Words::WhyAccepted => "why?".to_owned(),
            Words::Notes => "notes".to_owned(),
            Words::WhatWasWrong => "what was wrong".to_owned(),
            Words::Props { usual } => {
                let said = if usual.is_empty() { "nothing" } else { usual };
                format!("props: what was held or used [Enter: {said}]")
            }
        })
    }

    fn actions(&self) -> Answered<Vec<String>> {
        let names = self.ask(&format!(
            "actions to be recorded, with spaces between\n  [{}]",
            vocabulary::names().collect::<Vec<_>>().join(" ")
        ))?;
        Ok(names.split_whitespace().map(str::to_owned).collect())
    }

    fn needed_measure(&self, measure: Measure) -> Answered<f64> {
        self.ask_until(&asked(measure, ", needed"), |answer| measure.read(answer))
    }

    fn measure(&self, measure: Measure) -> Answered<MeasureAnswer> {
        self.ask_until(&asked(measure, ""), |answer| match answer {
            "" => Ok(MeasureAnswer::NotMeasured),
            "." => Ok(MeasureAnswer::NothingMore),
            answer => measure.read(answer).map(MeasureAnswer::Is),
        })
    }

    fn is_right(&self, doubt: Doubt<'_>) -> Answered<bool> {
        let Doubt { measure, value, why } = doubt;
        let question = format!("{value} {}: {why}. Is it right?", measure.unit());
        self.choose(&question, &[("n", "ask again", false), ("y", "it is right", true)])
    }

    fn unsteady(&self) -> Answered<Unsteady> {
        let choices = [
            ("r", "repeat (what was measured is kept)", Unsteady::Repeat),
            ("a", "go on with them all the same", Unsteady::Accept),
        ];
        self.choose("Not every sensor is good.", &choices)
    }

    fn mend(&self, error: &Error) -> Answered<Mend> {
        self.say(&format!("! {error}"));
        let choices =
            [("r", "once more", Mend::Again), ("c", "subject calibration again", Mend::Calibrate)];
        self.choose("It did not work.", &choices)
    }

    fn judge(&self, what: Judged<'_>, usual: Verdict) -> Answered<Verdict> {
        let (question, keep, retake) = match what {
            Judged::Calibration { notes } => {
                notes.iter().for_each(|note| self.say(&format!("  {note}")));
                let question = "Keep this calibration?".to_owned();
                (question, "keep it", "repeat (what was measured is kept)")
            }
            Judged::Trial { trial } => (keeps(trial), "keep", "retake"),
        };
        let mut choices = [("k", keep, Verdict::Keep), ("r", retake, Verdict::Retake)];
        if usual == Verdict::Retake {
            choices.reverse();
        }
        self.choose(&question, &choices)
    }

    fn wish(&self, trial: &str) -> Answered<Wish> {
        let choices = [
            ("y", "record", Wish::Record),
            ("d", "device calibration again", Wish::Devices),
            ("c", "subject calibration again", Wish::Subjects),
            ("g", "give this action up", Wish::GiveUp),
        ];
        self.choose(&format!("Record {trial}?"), &choices)
    }

    fn during_trial(&self, within: Duration) -> Answered<During> {
        Ok(match self.line_within(within)?.as_deref() {
            None => During::Nothing,
            Some(".") => During::End,
            Some("q") => return Err(Stopped),
            Some("") => During::Mark(Mark::Good),
            Some("x") => During::Mark(Mark::Bad),
            Some(words) => During::Mark(Mark::Note(words.to_owned())),
        })
    }

    fn repetitions(&self, marked: usize) -> Answered<Repetitions> {
        let question = format!("good repetitions in it [Enter: {marked}, as many as were marked]");
        self.ask_until(&question, |answer| match answer {
            "" => Repetitions::try_from(marked),
            answer => answer.parse(),
        })
    }
}

fn keeps(trial: &str) -> String {
    format!("Trial {trial}: keep it?")
}

fn id(who: &str) -> String {
    format!("id of the {who}, needed: small letters, digits, - (such as s01; no real name)")
}

fn asked(measure: Measure, needed: &str) -> String {
    format!("{}{needed} [{}]", measure.words(), measure.allowed())
}
