//! An operator, and whoever looks at the page of the session besides: what is asked and said is told to both, in the same
//! words.

use super::demonstration::Demonstration;
use super::happening::{Happening, Settled};
use super::operator::{
    Answered, Doubt, During, Judged, MeasureAnswer, Mend, Operator, Ready, Repetitions, Unsteady,
    Wish, Words,
};
use super::words::{Asking, of_settled, of_step, told};
use crate::body::anthropometry::Measure;
use crate::error::Error;
use crate::job::cues;
use crate::job::heard::row;
use crate::job::report::counted;
use crate::sensing::{Answer, Clock, Cue, MonotonicClock, Person, StopAtEnd};
use crate::session::Verdict;
use crate::time::{Duration, Instant};
use crate::view::live::LiveView;
use crate::view::session::{
    HoldTime, PersonNow, SessionFrame, SessionPanel, SettledWords, TrialPlace,
};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// So many of the steps that come are told.
const STEPS: usize = 3;
/// So many subjects are drawn.
const MOST_SUBJECTS: usize = 2;
/// Time between two poses of a figure that shows how something is done.
const FIGURE: Duration = Duration::from_millis(40);

/// An operator whose session is shown on a page. The page answers nothing and stops nothing.
pub struct OnPage<'a> {
    operator: &'a dyn Operator,
    view: &'a LiveView,
    began: Instant,
    told: Mutex<Told>,
}

/// What is on the page.
#[derive(Default)]
struct Told {
    panel: SessionPanel,
    /// By subject, as they are now.
    persons: Vec<PersonNow>,
    /// The motion that shows how the action is done, if there is one.
    shown_by: Option<String>,
    /// A figure that does it, in place of the first subject.
    figure: Option<PersonNow>,
    /// What the guide asks for after what it asks for now.
    after: Option<String>,
    announced: Option<String>,
    /// Steps of the session after this one.
    steps: Vec<String>,
    /// Until when something lasts, and how long in all.
    holds: Option<(Instant, Duration)>,
    /// Since when a trial is recorded.
    recording: Option<Instant>,
}

impl Told {
    fn instruct(&mut self, text: &str) {
        text.trim().clone_into(&mut self.panel.instruction);
        self.panel.remark.clear();
        self.holds = None;
        self.recording = None;
    }

    fn remark(&mut self, text: &str) {
        text.trim().clone_into(&mut self.panel.remark);
    }

    fn ask(&mut self, asking: &Asking) {
        if !asking.before.is_empty() {
            self.instruct(&asking.before);
        }
        self.panel.asked = asking.text();
    }

    fn hear(&mut self, happening: &Happening<'_>, now: Instant) {
        let text = told(happening);
        match *happening {
            Happening::Ahead { session, steps } => {
                let later = steps.iter().skip(1).take(STEPS);
                self.steps = later.map(|step| of_step(step, session)).collect();
                (self.after, self.announced) = (None, None);
                self.panel.trial = None;
            }
            Happening::Heard(sensors) => self.panel.sensors = sensors.iter().map(row).collect(),
            Happening::Posed { subject, pose, sensors, body } if subject < MOST_SUBJECTS => {
                let known = self.persons.len().max(subject + 1);
                self.persons.resize(known, PersonNow::default());
                self.persons[subject] = PersonNow::of(body, pose, sensors);
            }
            Happening::Posed { .. } => {}
            Happening::Settled(settled) => {
                let kept = match settled {
                    Settled::Devices(check) => check.is_usable(),
                    Settled::Body(check) => check.passed,
                    Settled::Trial(trial) => trial.verdict == Verdict::Keep,
                };
                self.panel.verdict = Some(SettledWords { kept, words: of_settled(&settled) });
            }
            Happening::MeasuringStill { seconds } => {
                self.instruct(&text);
                self.hold(Duration::try_from_secs_f64(seconds).unwrap_or_default(), now);
            }
            Happening::NextTrial { number, total, action, subjects, good, wanted } => {
                self.instruct(&text);
                self.shown_by = action.shown_by().map(str::to_owned);
                let (action, subjects) = (action.name.clone(), subjects.join(" and "));
                let (marked_good, marked_bad) = (0, 0);
                if wanted > good + 1 {
                    self.steps.insert(
                        0,
                        format!("{action} again, up to {}", counted(wanted, "good repetition")),
                    );
                    self.steps.truncate(STEPS);
                }
                self.panel.trial = Some(TrialPlace {
                    action,
                    subjects,
                    number,
                    total,
                    good,
                    wanted,
                    marked_good,
                    marked_bad,
                });
            }
            Happening::Recording { .. } => {
                self.instruct(&text);
                self.recording = Some(now);
            }
            Happening::Marked { good, bad, .. } => {
                self.remark(&text);
                if let Some(trial) = &mut self.panel.trial {
                    (trial.marked_good, trial.marked_bad) = (good, bad);
                }
            }
            // One line for each sensor, for those that did not pass with the reason.
            Happening::SensorChecked(_) => {
                let before = std::mem::take(&mut self.panel.remark);
                self.remark(&format!("{before}\n{text}"));
            }
            Happening::NewSession
            | Happening::Measures { .. }
            | Happening::Unjudged { .. }
            | Happening::Recorded(_)
            | Happening::Finishing => self.instruct(&text),
            _ => self.remark(&text),
        }
    }

    fn cue(&mut self, cue: &Cue<'_>, now: Instant) {
        let text = cues::of(cue);
        match *cue {
            Cue::Next(_) => {
                self.announced = Some(text);
                return;
            }
            Cue::Ask(_) => {
                text.trim().clone_into(&mut self.panel.asked);
                return;
            }
            Cue::NPose => self.instruct(&text),
            Cue::TPose | Cue::Move(_) => {
                self.instruct(&text);
                self.after = None;
            }
            Cue::In(time) | Cue::HoldStill(time) => {
                self.remark(&text);
                self.hold(time, now);
            }
            Cue::Good | Cue::Moved { .. } => {
                self.remark(&text);
                self.holds = None;
            }
            _ => self.remark(&text),
        }
        if matches!(cue, Cue::NPose | Cue::TPose | Cue::Move(_)) {
            self.after = self.announced.take().or(self.after.take());
        }
        if !matches!(cue, Cue::Unknown(_)) {
            self.panel.asked.clear();
        }
    }

    fn hold(&mut self, time: Duration, now: Instant) {
        self.holds = Some((now + time, time));
    }

    /// What a page is told at this moment.
    fn frame(&mut self, time_s: f64, now: Instant) -> SessionFrame {
        let panel = &mut self.panel;
        panel.holds = self.holds.map(|(until, lasts)| HoldTime {
            lasts_s: lasts.as_secs_f64(),
            left_s: until.seconds_since(now).max(0.0),
        });
        panel.recorded_s = self.recording.map(|since| now.seconds_since(since));
        panel.next = self.after.iter().chain(&self.steps).cloned().collect();
        let others = self.persons.iter().skip(usize::from(self.figure.is_some()));
        let persons = self.figure.iter().chain(others).cloned().collect();
        SessionFrame { time_s, session: panel.clone(), persons }
    }
}

impl<'a> OnPage<'a> {
    /// An operator, and a page that is served.
    #[must_use]
    pub fn new(operator: &'a dyn Operator, view: &'a LiveView) -> Self {
        Self { operator, view, began: MonotonicClock.now(), told: Mutex::default() }
    }

    fn told(&self) -> MutexGuard<'_, Told> {
        self.told.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Changes what is on the page.
    fn change(&self, change: impl FnOnce(&mut Told, Instant)) {
        let now = MonotonicClock.now();
        let mut told = self.told();
        change(&mut told, now);
        self.view.tell(&told.frame(now.seconds_since(self.began), now));
    }

    /// Shows a question until it is answered.
    fn asked<T>(&self, asking: &Asking, answer: impl FnOnce() -> Answered<T>) -> Answered<T> {
        self.change(|told, _| told.ask(asking));
        let answered = answer();
        self.change(|told, _| told.panel.asked.clear());
        answered
    }
}

impl OnPage<'_> {
    /// A figure does the action over and over until it is answered.
    fn shown<T>(&self, answer: impl FnOnce() -> T) -> T {
        let Some(motion) = self.told().shown_by.clone() else { return answer() };
        let answered = AtomicBool::new(false);
        std::thread::scope(|scope| {
            let _answered = StopAtEnd(&answered);
            scope.spawn(|| self.show(&motion, &answered));
            answer()
        })
    }

    fn show(&self, motion: &str, answered: &AtomicBool) {
        let figure = match Demonstration::of(motion) {
            Ok(figure) => figure,
            Err(error) => return self.hear(Happening::NotShown(&error)),
        };
        let words =
            format!("The figure shows how it is done: {motion}, {:.1} s.", figure.lasts_s());
        self.change(|told, _| told.remark(&words));
        let began = MonotonicClock.now();
        while !answered.load(Ordering::Acquire) {
            let now = MonotonicClock.now();
            let at = figure.at(now.seconds_since(began));
            self.change(|told, _| told.figure = Some(at));
            MonotonicClock.sleep_until(now + FIGURE);
        }
        self.change(|told, _| {
            told.figure = None;
            told.panel.remark.clear();
        });
    }
}

impl Person for OnPage<'_> {
    fn tell(&self, cue: Cue<'_>) {
        self.change(|told, now| told.cue(&cue, now));
        self.operator.person().tell(cue);
    }

    fn answer(&self) -> Option<Answer> {
        self.operator.person().answer()
    }

    fn can_answer(&self) -> bool {
        self.operator.person().can_answer()
    }

    fn wants_to_stop(&self) -> bool {
        self.operator.person().wants_to_stop()
    }

    fn wants_a_reset(&self) -> bool {
        self.operator.person().wants_a_reset()
    }
}

impl Operator for OnPage<'_> {
    fn person(&self) -> &dyn Person {
        self
    }

    fn hear(&self, happening: Happening<'_>) {
        self.change(|told, now| told.hear(&happening, now));
        self.operator.hear(happening);
    }

    fn looks(&self) -> bool {
        true
    }

    fn ready(&self, what: Ready<'_>) -> Answered<()> {
        let answer = || self.operator.ready(what);
        self.asked(&Asking::ready(&what), || match what {
            Ready::Explained | Ready::Practised => self.shown(answer),
            _ => answer(),
        })
    }

    fn words(&self, what: Words<'_>) -> Answered<String> {
        self.asked(&Asking::words(&what), || self.operator.words(what))
    }

    fn actions(&self) -> Answered<Vec<String>> {
        self.asked(&Asking::actions(), || self.operator.actions())
    }

    fn needed_measure(&self, measure: Measure) -> Answered<f64> {
        self.asked(&Asking::measure(measure), || self.operator.needed_measure(measure))
    }

    fn measure(&self, measure: Measure) -> Answered<MeasureAnswer> {
        self.asked(&Asking::measure(measure), || self.operator.measure(measure))
    }

    fn is_right(&self, doubt: Doubt<'_>) -> Answered<bool> {
        self.asked(&Asking::is_right(&doubt), || self.operator.is_right(doubt))
    }

    fn unsteady(&self) -> Answered<Unsteady> {
        self.asked(&Asking::unsteady(), || self.operator.unsteady())
    }

    fn mend(&self, error: &Error) -> Answered<Mend> {
        self.asked(&Asking::mend(error), || self.operator.mend(error))
    }

    fn judge(&self, what: Judged<'_>, usual: Verdict) -> Answered<Verdict> {
        self.asked(&Asking::judge(&what, usual), || self.operator.judge(what, usual))
    }

    fn wish(&self, trial: &str) -> Answered<Wish> {
        self.asked(&Asking::wish(trial), || self.operator.wish(trial))
    }

    fn during_trial(&self, within: Duration) -> Answered<During> {
        self.operator.during_trial(within)
    }

    fn repetitions(&self, marked: usize) -> Answered<Repetitions> {
        self.asked(&Asking::repetitions(marked), || self.operator.repetitions(marked))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::session::obliging::Yes;

    /// A session that goes on later may find it gone.
    #[test]
    fn a_motion_that_cannot_be_shown_is_told_to_the_operator_as_well() {
        let view = LiveView::serving(String::new(), 0).expect("served");
        let operator = Yes::default();
        let on_page = OnPage::new(&operator, &view);
        on_page.told().shown_by = Some("/nowhere/lift.bvh".to_owned());
        assert_eq!(on_page.shown(|| 7), 7);
        let said = on_page.told().panel.remark.clone();
        let begins = "Nothing shows how it is done: the file cannot be read";
        assert!(said.starts_with(begins) && said.contains("/nowhere/lift.bvh"), "{said}");
        assert_eq!(operator.0.into_inner().expect("whole"), [said]);
    }
}
