//! What a typed line answers to what an operator is asked.

use super::console::Console;
use crate::body::anthropometry::Measure;
use crate::error::Error;
use crate::job::session::words::{Asking, told};
use crate::job::session::{
    Answered, Doubt, During, Happening, Instead, Judged, Mark, MeasureAnswer, Mend, Operator,
    Ready, Repetitions, Unsteady, Wish, Words,
};
use crate::sensing::Person;
use crate::session::Verdict;
use crate::time::Duration;

/// What goes to the question before.
const BACK: &str = "back";

/// What was typed, unless that is the way back.
fn unless_back(said: String) -> Answered<String> {
    if said == BACK { Err(Instead::Back) } else { Ok(said) }
}

impl Operator for Console {
    fn person(&self) -> &dyn Person {
        &self.person
    }

    fn hear(&self, happening: Happening<'_>) {
        let text = told(&happening);
        match happening {
            Happening::Recording { .. } => self.begin_trial(),
            Happening::Marked { time_s, .. } => {
                // Its time stands before it already.
                let words = text.split_once(": ").map_or(&*text, |(_, words)| words);
                self.marked(time_s, words);
            }
            Happening::CutShort(_) => self.cut_trial_short(),
            _ => {}
        }
        match happening {
            // Beside the dialogue, and not if the rest is to be quiet.
            Happening::Sensing(_) | Happening::NotShown(_) => self.remark(&text),
            Happening::Heard(sensors) => self.show(sensors),
            _ if text.is_empty() => {}
            _ => self.say(&text),
        }
    }

    fn looks(&self) -> bool {
        self.shows()
    }

    fn ready(&self, what: Ready<'_>) -> Answered<()> {
        self.choose(&Asking::ready(&what), &[()])
    }

    fn words(&self, what: Words<'_>) -> Answered<String> {
        let said = self.ask(&Asking::words(&what))?;
        if what.is_of_several() { unless_back(said) } else { Ok(said) }
    }

    fn actions(&self) -> Answered<Vec<String>> {
        let names = unless_back(self.ask(&Asking::actions())?)?;
        Ok(names.split_whitespace().map(str::to_owned).collect())
    }

    fn needed_measure(&self, measure: Measure) -> Answered<f64> {
        self.ask_until(&Asking::measure(measure), |answer| match answer {
            BACK => Ok(None),
            answer => measure.read(answer).map(Some),
        })?
        .ok_or(Instead::Back)
    }

    fn measure(&self, measure: Measure) -> Answered<MeasureAnswer> {
        self.ask_until(&Asking::measure(measure), |answer| match answer {
            "" => Ok(Some(MeasureAnswer::NotMeasured)),
            "-" => Ok(Some(MeasureAnswer::TakenAway)),
            "." => Ok(Some(MeasureAnswer::NothingMore)),
            BACK => Ok(None),
            answer => measure.read(answer).map(|value| Some(MeasureAnswer::Is(value))),
        })?
        .ok_or(Instead::Back)
    }

    fn is_right(&self, doubt: Doubt<'_>) -> Answered<bool> {
        self.choose(&Asking::is_right(&doubt), &[false, true])
    }

    fn unsteady(&self) -> Answered<Unsteady> {
        self.choose(&Asking::unsteady(), &[Unsteady::Repeat, Unsteady::Accept])
    }

    fn mend(&self, error: &Error) -> Answered<Mend> {
        self.choose(&Asking::mend(error), &[Mend::Again, Mend::Calibrate])
    }

    fn judge(&self, what: Judged<'_>, usual: Verdict) -> Answered<Verdict> {
        let other = if usual == Verdict::Keep { Verdict::Retake } else { Verdict::Keep };
        self.choose(&Asking::judge(&what, usual), &[usual, other])
    }

    fn wish(&self, trial: &str) -> Answered<Wish> {
        let meant = [Wish::Record, Wish::Devices, Wish::Subjects, Wish::GiveUp, Wish::Edit];
        self.choose(&Asking::wish(trial), &meant)
    }

    fn during_trial(&self, within: Duration) -> Answered<During> {
        let ended = || {
            self.end_trial();
            self.press_keys(false);
        };
        let said = self.line_within(within).inspect_err(|_| ended())?;
        Ok(match said.as_deref() {
            None => During::Nothing,
            Some(".") => {
                self.end_trial();
                During::End
            }
            Some("q") => {
                ended();
                return Err(Instead::Stop);
            }
            Some("") => During::Mark(Mark::Good),
            Some("x") => During::Mark(Mark::Bad),
            Some(words) => During::Mark(Mark::Note(words.to_owned())),
        })
    }

    fn repetitions(&self, marked: usize) -> Answered<Repetitions> {
        self.ask_until(&Asking::repetitions(marked), |answer| match answer {
            "" => Repetitions::try_from(marked),
            answer => answer.parse(),
        })
    }
}
