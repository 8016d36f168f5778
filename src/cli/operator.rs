//! The person at the terminal: what they type, and whether they want to stop.

use super::keys::{Keys, Typist, hand_on_typed};
use super::live::Shown;
use super::signals::Signals;
use super::status::StatusLine;
use super::{Remarks, print, say};
use crate::job::heard::following;
use crate::job::{Event, Observer, cues};
use crate::sensing::{Answer, Cue, Person};
use rustix::stdio::stdin;
use rustix::termios::{QueueSelector, tcflush};
use std::io::IsTerminal;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

/// Whoever started the program. Lines are read by a thread of their own.
pub struct Operator {
    signals: Signals,
    remarks: Remarks,
    shown: Mutex<Shown>,
    /// While a robot follows, and since when.
    status: StatusLine,
    follows: Mutex<Option<Instant>>,
    typed: Arc<Typed>,
    lines: Arc<Mutex<Receiver<String>>>,
    /// While a robot follows, the terminal waits for no Enter.
    keys: Mutex<Option<Keys>>,
    /// True if lines are read elsewhere: their end is a stop.
    is_shared: bool,
    is_at_terminal: bool,
    /// Where it is told what to do: beside the questions.
    tell: fn(&str),
}

/// Says a line on standard output. What cannot be said there, the next question cannot ask either.
fn say_there(text: &str) {
    let _ = print(&format!("{text}\n"));
}

/// What counts whenever it is typed.
#[derive(Default)]
struct Typed {
    quit: AtomicBool,
    reset: AtomicBool,
    agrees: AtomicBool,
    /// True while keys count as they are pressed.
    by_keys: AtomicBool,
}

impl Operator {
    /// Listens to standard input, if that is a terminal.
    #[must_use]
    pub fn listen(signals: Signals, remarks: Remarks) -> Self {
        let (sender, lines) = channel();
        let typed = Arc::new(Typed::default());
        let is_at_terminal = std::io::stdin().is_terminal();
        if is_at_terminal {
            let typed = Arc::clone(&typed);
            // The thread waits for a line until the process ends; nothing depends on it.
            std::thread::spawn(move || {
                let note = Mutex::default();
                hand_on_typed(Typist::of_keys(b"qQrRgG"), &typed.by_keys, &note, |line| {
                    let word = line.trim().to_ascii_lowercase();
                    let flag = match &*word {
                        "q" => &typed.quit,
                        "r" => &typed.reset,
                        "g" => &typed.agrees,
                        // Once nobody is left who would read it, that is the end.
                        _ => return sender.send(word).is_ok(),
                    };
                    flag.store(true, Ordering::Release);
                    true
                });
            });
        }
        let lines = Arc::new(Mutex::new(lines));
        Self {
            signals,
            remarks,
            shown: Mutex::default(),
            status: StatusLine::new(remarks),
            follows: Mutex::default(),
            typed,
            lines,
            keys: Mutex::default(),
            is_shared: false,
            is_at_terminal,
            tell: say,
        }
    }

    /// Somebody whose lines are read elsewhere, and are this one's to answer for now; `is_document`: standard output is kept for
    /// a document.
    #[must_use]
    pub fn sharing(
        signals: Signals,
        lines: Arc<Mutex<Receiver<String>>>,
        is_document: bool,
    ) -> Self {
        Self {
            signals,
            remarks: Remarks::default(),
            shown: Mutex::default(),
            status: StatusLine::default(),
            follows: Mutex::default(),
            typed: Arc::default(),
            lines,
            keys: Mutex::default(),
            is_shared: true,
            is_at_terminal: true,
            tell: if is_document { say } else { say_there },
        }
    }

    /// From now on keys count as they are pressed: whoever sees a robot move should not have to look for Enter.
    fn press_keys(&self) {
        let mut keys = self.keys.lock().unwrap_or_else(PoisonError::into_inner);
        if self.is_at_terminal && !self.is_shared && keys.is_none() {
            // What was typed and not ended before meant nothing that comes now.
            let _ = tcflush(stdin(), QueueSelector::IFlush);
            *keys = Keys::hold(false);
            self.typed.by_keys.store(keys.is_some(), Ordering::Release);
        }
    }

    /// Says something that is not to be written over.
    fn say(&self, text: &str) {
        self.below_the_table();
        self.status.say(text);
    }

    fn below_the_table(&self) {
        self.shown.lock().unwrap_or_else(PoisonError::into_inner).goes_on_below();
    }

    fn is_to_end(&self) -> bool {
        self.signals.first().is_some() || self.typed.quit.load(Ordering::Acquire)
    }

    /// What somebody typed at a terminal before they were asked is no answer.
    fn forget_typed(&self) {
        if std::io::stdin().is_terminal() {
            let lines = self.lines.lock().unwrap_or_else(PoisonError::into_inner);
            while lines.try_recv().is_ok() {}
        }
    }

    /// The next line that was typed, without spaces around it and in small letters.
    fn line(&self) -> Option<String> {
        let line = self.lines.lock().unwrap_or_else(PoisonError::into_inner).try_recv();
        if !self.is_shared {
            return line.ok();
        }
        let word = line.map(|line| line.trim().to_ascii_lowercase());
        if word == Err(TryRecvError::Disconnected) || word.as_deref() == Ok("q") {
            self.typed.quit.store(true, Ordering::Release);
            return None;
        }
        word.ok()
    }
}

impl Person for Operator {
    /// They must know, however quiet the rest is.
    fn tell(&self, cue: Cue<'_>) {
        if matches!(cue, Cue::Ask(_)) {
            self.forget_typed();
        }
        // What comes after this is for whoever looks at a page.
        if !matches!(cue, Cue::Next(_)) {
            self.below_the_table();
            self.status.above(|| (self.tell)(&cues::of(&cue)));
        }
    }

    fn answer(&self) -> Option<Answer> {
        Some(match self.line()?.as_str() {
            "" => Answer::GoOn,
            "s" => Answer::Skip,
            other => Answer::Other(other.to_owned()),
        })
    }

    fn can_answer(&self) -> bool {
        self.is_at_terminal
    }

    fn wants_to_stop(&self) -> bool {
        self.is_to_end()
    }

    fn wants_a_reset(&self) -> bool {
        self.typed.reset.swap(false, Ordering::AcqRel)
    }

    fn agrees(&self) -> bool {
        self.typed.agrees.swap(false, Ordering::AcqRel)
    }
}

impl Observer for Operator {
    fn hear(&self, event: Event<'_>) {
        match event {
            Event::Note(text) => self.say(text),
            Event::Following => {
                *self.follows.lock().unwrap_or_else(PoisonError::into_inner) = Some(Instant::now());
                self.press_keys();
                self.say("following; Ctrl-C or q brings the robot to rest");
            }
            Event::Angles { angles, worn } => {
                self.press_keys();
                let mut shown = self.shown.lock().unwrap_or_else(PoisonError::into_inner);
                shown.show(angles, worn, self.remarks);
            }
            Event::Sensing(event) => self.say(&cues::of_event(event)),
            Event::Recognised(event) => {
                event.words_of_done().iter().for_each(|words| self.say(words));
            }
            Event::Heard(sensors) => {
                let since = *self.follows.lock().unwrap_or_else(PoisonError::into_inner);
                if let Some(since) = since {
                    self.status.show(&following(since.elapsed(), sensors));
                }
            }
            _ => {}
        }
    }

    fn looks(&self) -> bool {
        self.remarks.shows_progress()
    }

    /// A signal, or q.
    fn wants_to_stop(&self) -> bool {
        self.is_to_end()
    }
}
