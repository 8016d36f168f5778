//! An operator for tests, who agrees.

use super::happening::Happening;
use super::operator::{
    Answered, Doubt, During, Judged, MeasureAnswer, Mend, Operator, Ready, Repetitions, Unsteady,
    Wish, Words,
};
use super::words::told;
use crate::body::anthropometry::Measure;
use crate::error::Error;
use crate::sensing::{Answer, Cue, Person};
use crate::session::Verdict;
use crate::time::Duration;
use std::sync::Mutex;

/// Says yes to everything, and notes what it hears.
#[derive(Default)]
pub struct Yes(pub Mutex<Vec<String>>);

impl Person for Yes {
    fn tell(&self, _: Cue<'_>) {}

    fn answer(&self) -> Option<Answer> {
        None
    }

    fn can_answer(&self) -> bool {
        true
    }

    fn wants_to_stop(&self) -> bool {
        false
    }
}

impl Operator for Yes {
    fn person(&self) -> &dyn Person {
        self
    }

    fn hear(&self, happening: Happening<'_>) {
        self.0.lock().expect("whole").push(told(&happening));
    }

    fn ready(&self, _: Ready<'_>) -> Answered<()> {
        Ok(())
    }

    fn words(&self, _: Words<'_>) -> Answered<String> {
        Ok(String::new())
    }

    fn actions(&self) -> Answered<Vec<String>> {
        Ok(Vec::new())
    }

    fn needed_measure(&self, _: Measure) -> Answered<f64> {
        Ok(1.7)
    }

    fn measure(&self, _: Measure) -> Answered<MeasureAnswer> {
        Ok(MeasureAnswer::NothingMore)
    }

    fn is_right(&self, _: Doubt<'_>) -> Answered<bool> {
        Ok(true)
    }

    fn unsteady(&self) -> Answered<Unsteady> {
        Ok(Unsteady::Repeat)
    }

    fn mend(&self, _: &Error) -> Answered<Mend> {
        Ok(Mend::Again)
    }

    fn judge(&self, _: Judged<'_>, usual: Verdict) -> Answered<Verdict> {
        Ok(usual)
    }

    fn wish(&self, _: &str) -> Answered<Wish> {
        Ok(Wish::Record)
    }

    fn during_trial(&self, _: Duration) -> Answered<During> {
        Ok(During::End)
    }

    fn repetitions(&self, marked: usize) -> Answered<Repetitions> {
        Ok(Repetitions::try_from(marked).expect("few"))
    }
}
