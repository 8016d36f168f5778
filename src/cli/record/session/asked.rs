//! What a typed line answers to what an operator is asked.

use super::console::Console;
use crate::body::anthropometry::Measure;
use crate::error::Error;
use crate::job::session::words::{Asking, told};
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
        let text = told(&happening);
        if matches!(happening, Happening::Recording { .. }) {
            self.forget_typed();
        }
        match happening {
            // Beside the dialogue, and not if the rest is to be quiet.
            Happening::Sensing(_) => self.remarks.say(&text),
            _ if text.is_empty() => {}
            _ => self.say(&text),
        }
    }

    fn ready(&self, what: Ready<'_>) -> Answered<()> {
        self.choose(&Asking::ready(&what), &[()])
    }

    fn words(&self, what: Words<'_>) -> Answered<String> {
        self.ask(&Asking::words(&what))
    }

    fn actions(&self) -> Answered<Vec<String>> {
        let names = self.ask(&Asking::actions())?;
        Ok(names.split_whitespace().map(str::to_owned).collect())
    }

    fn needed_measure(&self, measure: Measure) -> Answered<f64> {
        self.ask_until(&Asking::measure(measure), |answer| measure.read(answer))
    }

    fn measure(&self, measure: Measure) -> Answered<MeasureAnswer> {
        self.ask_until(&Asking::measure(measure), |answer| match answer {
            "" => Ok(MeasureAnswer::NotMeasured),
            "." => Ok(MeasureAnswer::NothingMore),
            answer => measure.read(answer).map(MeasureAnswer::Is),
        })
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
        let meant = [Wish::Record, Wish::Devices, Wish::Subjects, Wish::GiveUp];
        self.choose(&Asking::wish(trial), &meant)
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
        self.ask_until(&Asking::repetitions(marked), |answer| match answer {
            "" => Repetitions::try_from(marked),
            answer => answer.parse(),
        })
    }
}
