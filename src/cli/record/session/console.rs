//! The terminal of a session: questions on standard output, or on standard error where that is kept for a document; answers on
//! standard input, a line each.

use crate::cli::keys::{Keys, Typist, hand_on_typed};
use crate::cli::operator::Operator;
use crate::cli::output::{Untold, complain, prompt};
use crate::cli::signals::Signals;
use crate::cli::status::StatusLine;
use crate::cli::{Remarks, print};
use crate::error::Error;
use crate::job::heard::SensorNow;
use crate::job::observer::RecordingNow;
use crate::job::session::words::Asking;
use crate::job::session::{Answered, Instead};
use rustix::stdio::stdin;
use rustix::termios::{QueueSelector, tcflush};
use std::collections::BTreeMap;
use std::io::IsTerminal;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Whoever counted repetitions in a trial that was cut short presses Enter on for a while: so long after the last time, it answers nothing.
const CUT_SHORT: Duration = Duration::from_secs(1);

/// Time between two looks at signals while nothing is answered.
const LOOK: Duration = Duration::from_millis(20);

/// Whoever answers.
pub struct Console {
    /// Shared with the guide through calibrations, one after the other.
    lines: Arc<Mutex<Receiver<String>>>,
    signals: Signals,
    /// The same person, for the guide.
    pub(super) person: Operator,
    remarks: Remarks,
    /// Where it is said what happens to sensors, above how a trial goes.
    status: StatusLine,
    /// True if standard output is kept for a document.
    is_document: bool,
    trial: Mutex<Option<TrialNow>>,
    /// When a trial was cut short, or Enter pressed for it afterwards.
    cut_short: Mutex<Option<Instant>>,
    /// The note that is typed and not ended yet.
    note: Arc<Mutex<String>>,
    /// True while keys count as they are pressed.
    pressed: Arc<AtomicBool>,
    keys: Mutex<Option<Keys>>,
    /// The question that waits for its answer.
    asked: Mutex<Option<String>>,
}

/// A trial that is recorded.
struct TrialNow {
    began: Instant,
    /// When the last mark was set, s, and what was said to it.
    mark: Option<(f64, String)>,
    /// By sensor, how many samples were missing when it was shown first.
    missed_before: Option<BTreeMap<String, u64>>,
}

fn locked<T>(of: &Mutex<T>) -> MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Console {
    /// Reads standard input on a thread of its own; `is_document`: standard output is kept for a document.
    ///
    /// # Errors
    /// No thread to be had.
    pub fn listen(signals: Signals, remarks: Remarks, is_document: bool) -> Result<Self, Error> {
        let (sender, lines) = channel();
        let pressed = Arc::new(AtomicBool::new(false));
        let by_keys = Arc::clone(&pressed);
        // The thread waits for a line until the process ends; nothing depends on it.
        let note = Arc::<Mutex<String>>::default();
        let typing = Arc::clone(&note);
        let read = move || {
            hand_on_typed(Typist::new(b"x."), &by_keys, &typing, |line| sender.send(line).is_ok());
        };
        std::thread::Builder::new()
            .name("answers".to_owned())
            .spawn(read)
            .map_err(|e| Error::new(format!("no thread: {e}")))?;
        let lines = Arc::new(Mutex::new(lines));
        let person = Operator::sharing(signals.clone(), Arc::clone(&lines), is_document);
        let (keys, asked, trial, cut_short) = Default::default();
        let status = StatusLine::new(remarks);
        Ok(Self {
            lines,
            signals,
            person,
            remarks,
            status,
            is_document,
            trial,
            cut_short,
            note,
            pressed,
            keys,
            asked,
        })
    }

    fn put(&self, text: &str) -> Result<(), Untold> {
        if self.is_document { prompt(text) } else { print(text) }
    }

    /// Says something. What cannot be said here, the next question cannot ask either, and that counts.
    pub fn say(&self, text: &str) {
        self.status.above(|| {
            let _ = self.put(&format!("{text}\n"));
        });
    }

    /// True if it is shown how a trial goes.
    pub fn shows(&self) -> bool {
        self.remarks.shows_progress()
    }

    /// A trial is recorded from now on: keys count as they are pressed, and it is shown how it goes.
    pub fn begin_trial(&self) {
        self.press_keys(true);
        self.forget_typed();
        *locked(&self.trial) =
            Some(TrialNow { began: Instant::now(), mark: None, missed_before: None });
    }

    /// A mark was taken, and this was said to it.
    pub fn marked(&self, time_s: f64, words: &str) {
        if let Some(trial) = &mut *locked(&self.trial) {
            trial.mark = Some((time_s, words.to_owned()));
        }
    }

    /// Shows how the trial goes that is recorded, if one is.
    pub fn show(&self, sensors: &[SensorNow]) {
        let mut trial = locked(&self.trial);
        let Some(trial) = &mut *trial else { return };
        let mut sources = sensors.to_vec();
        // What was lost before is no loss of this trial.
        let missed = || sensors.iter().map(|of| (of.name.clone(), of.missed)).collect();
        let before = trial.missed_before.get_or_insert_with(missed);
        for source in &mut sources {
            let before = before.get(&source.name).copied().unwrap_or(0);
            source.missed = source.missed.saturating_sub(before);
        }
        let now = RecordingNow {
            time_s: trial.began.elapsed().as_secs_f64(),
            of_s: None,
            ended_by: "a dot",
            sources,
            dropped: 0,
            mark: trial.mark.clone(),
            note: locked(&self.note).clone(),
        };
        self.status.show(&now.words());
    }

    /// The trial ended before anybody said so.
    pub fn cut_trial_short(&self) {
        self.end_trial();
        *locked(&self.cut_short) = Some(Instant::now());
    }

    /// True of Enter that was meant for a trial.
    fn comes_too_late(&self, line: &str) -> bool {
        let mut cut_short = locked(&self.cut_short);
        let is_late = line.is_empty() && cut_short.is_some_and(|at| at.elapsed() < CUT_SHORT);
        *cut_short = is_late.then(Instant::now);
        is_late
    }

    /// Nothing is recorded any more.
    pub fn end_trial(&self) {
        let mut trial = locked(&self.trial);
        *trial = None;
        self.status.clear();
        drop(trial);
    }

    /// Says something that has nothing to do with what is asked. At a terminal that is asked once more then: the answer would stand
    /// behind what was said.
    pub fn remark(&self, text: &str) {
        let asked = locked(&self.asked);
        match &*asked {
            Some(question) if !self.remarks.quiet && std::io::stdin().is_terminal() => {
                self.say("");
                self.remarks.say(text);
                // What is typed and not ended yet would be unseen from here on, and yet be part of the answer.
                let _ = tcflush(stdin(), QueueSelector::IFlush);
                let _ = self.put(question);
            }
            _ => self.status.say(text),
        }
    }

    /// From now on keys count as they are pressed, or not any more. Where it is shown how a trial goes, what is typed is shown
    /// there.
    pub fn press_keys(&self, wanted: bool) {
        let mut keys = locked(&self.keys);
        if wanted == keys.is_some() {
            return;
        }
        *keys = if wanted { Keys::hold(!self.shows()) } else { None };
        self.pressed.store(keys.is_some(), Ordering::Release);
    }

    /// What somebody typed at a terminal before they were asked answers nothing that comes after it, nor does what is typed
    /// and not ended yet. Lines out of a file or a pipe were written for their turn.
    pub fn forget_typed(&self) {
        if std::io::stdin().is_terminal() {
            // Where the terminal does not forget, the lines that were read are forgotten all the same.
            let _ = tcflush(stdin(), QueueSelector::IFlush);
            let lines = locked(&self.lines);
            while lines.try_recv().is_ok() {}
        }
    }

    /// The line that was typed within this time, if one was.
    ///
    /// # Errors
    /// A signal, or the end of the input.
    pub fn line_within(&self, time: Duration) -> Answered<Option<String>> {
        if self.signals.first().is_some() {
            return Err(Instead::Stop);
        }
        let lines = locked(&self.lines);
        match lines.recv_timeout(time) {
            // Arrow keys and the like are no words.
            Ok(line) => Ok(Some(line.replace(char::is_control, "").trim().to_owned())),
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => Err(Instead::Stop),
        }
    }

    /// Asks for a line. `q` stops the session wherever it is asked.
    ///
    /// # Errors
    /// A signal, the end of the input, `q`, or a question that nobody can be asked: that is said.
    pub fn ask(&self, asking: &Asking) -> Answered<String> {
        self.end_trial();
        self.press_keys(false);
        self.forget_typed();
        if !asking.before.is_empty() {
            self.say(&asking.before);
        }
        self.line(asking)
    }

    fn line(&self, asking: &Asking) -> Answered<String> {
        let question = format!("{}\n> ", asking.text());
        // Whoever does not see what is asked answers something else.
        let unseen = |untold: Untold| {
            let words =
                "a question could not be asked: the session ends here, what was done is kept";
            complain(&Error { what: words.into(), ..untold.into() });
            Instead::Stop
        };
        {
            let mut place = locked(&self.asked);
            self.put(&question).map_err(unseen)?;
            *place = Some(question);
        }
        let said = loop {
            match self.line_within(LOOK) {
                Ok(None) => {}
                Ok(Some(line)) if self.comes_too_late(&line) => {}
                Ok(Some(line)) if line == "q" => break Err(Instead::Stop),
                Ok(Some(line)) => break Ok(line),
                Err(instead) => break Err(instead),
            }
        };
        *locked(&self.asked) = None;
        said
    }

    /// Asks until the answer can be read.
    ///
    /// # Errors
    /// As [`Self::ask`].
    pub fn ask_until<T>(
        &self,
        asking: &Asking,
        mut read: impl FnMut(&str) -> Result<T, Error>,
    ) -> Answered<T> {
        let mut line = self.ask(asking)?;
        loop {
            match read(&line) {
                Ok(answer) => return Ok(answer),
                Err(error) => self.say(&format!("! {error}")),
            }
            line = self.line(asking)?;
        }
    }

    /// Asks which it is; these are what the choices mean, in their order.
    ///
    /// # Errors
    /// As [`Self::ask`].
    pub fn choose<T: Copy>(&self, asking: &Asking, meant: &[T]) -> Answered<T> {
        let keys: Vec<&str> = asking.choices.iter().map(|(key, _)| *key).collect();
        self.ask_until(asking, |answer| {
            let known = keys.iter().position(|key| key.eq_ignore_ascii_case(answer));
            let at = known.or(answer.is_empty().then_some(0));
            at.and_then(|at| meant.get(at)).copied().ok_or_else(|| {
                Error::new("not one of the answers").got(answer).allowed(keys.join(", "))
            })
        })
    }
}
