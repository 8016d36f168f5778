//! The terminal as the observer of a job: a signal ends it, a bar shows how far a motion is.

use super::Remarks;
use super::signals::Signals;
use super::status::StatusLine;
use crate::job::observer::RecordingNow;
use crate::job::{Event, Observer, Progress, cues};
use indicatif::{ProgressBar, ProgressStyle};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// Whoever started the program.
pub struct Terminal<'a> {
    remarks: Remarks,
    signals: Option<&'a Signals>,
    bar: Mutex<Option<ProgressBar>>,
    /// While something is recorded.
    status: StatusLine,
    /// The note that is typed and not ended yet.
    typed: Arc<Mutex<String>>,
}

impl<'a> Terminal<'a> {
    /// A signal is a wish to stop.
    pub fn new(remarks: Remarks, signals: &'a Signals) -> Self {
        let mut terminal = Self::unheard(remarks);
        terminal.signals = Some(signals);
        terminal
    }

    /// A signal ends the process: nothing is touched that could not be left at any time.
    pub fn unheard(remarks: Remarks) -> Self {
        let (bar, typed) = Default::default();
        Self { remarks, signals: None, bar, status: StatusLine::new(remarks), typed }
    }

    /// Where the note is that is typed and not ended yet, to be shown.
    pub fn typed(&self) -> Arc<Mutex<String>> {
        Arc::clone(&self.typed)
    }

    /// Shows nothing more.
    pub fn clear(&self) {
        self.status.clear();
    }

    /// Shows how a recording goes.
    fn show(&self, now: &RecordingNow) {
        let note = self.typed.lock().unwrap_or_else(PoisonError::into_inner).clone();
        self.status.show(&RecordingNow { note, ..now.clone() }.words());
    }

    /// Shows a bar until all steps are done.
    fn step(&self, done: u64, total: u64, what: &str) {
        if !self.remarks.shows_progress() {
            return;
        }
        let mut bar = self.bar.lock().unwrap_or_else(PoisonError::into_inner);
        if done >= total {
            bar.take().iter().for_each(ProgressBar::finish_and_clear);
            return;
        }
        let bar = bar.get_or_insert_with(|| {
            let style = ProgressStyle::with_template("{bar:40} {pos} of {len} {msg}, {eta} left");
            let style = style.unwrap_or_else(|_| ProgressStyle::default_bar());
            ProgressBar::new(total).with_style(style)
        });
        bar.set_position(done);
        bar.set_message(what.to_owned());
    }
}

impl Observer for Terminal<'_> {
    fn hear(&self, event: Event<'_>) {
        match event {
            Event::Note(text) => self.status.say(text),
            Event::Recording(now) => self.show(now),
            Event::Step { done, total, what } => self.step(done, total, what),
            Event::Sensing(event) => self.status.say(&cues::of_event(event)),
            other if self.remarks.since.is_some() => {
                cues::in_full(&other).iter().for_each(|words| self.status.say(words));
            }
            _ => {}
        }
    }

    fn looks(&self) -> bool {
        self.remarks.since.is_some()
    }

    fn wants_to_stop(&self) -> bool {
        self.signals.is_some_and(|signals| signals.first().is_some())
    }

    fn watch(&self, progress: &Progress<'_>) {
        if !self.remarks.shows_progress() {
            return;
        }
        let style = ProgressStyle::with_template("{bar:40} {msg}")
            .unwrap_or_else(|_| ProgressStyle::default_bar());
        let total_s = progress.duration_s();
        let bar = ProgressBar::new((total_s * 1e3) as u64).with_style(style);
        while !progress.is_over() {
            let time_s = progress.time_s();
            bar.set_position((time_s * 1e3) as u64);
            bar.set_message(match total_s.is_finite() {
                true => format!("{time_s:.1} of {total_s:.1} s"),
                false => format!("{time_s:.1} s; Ctrl-C brings it to rest"),
            });
            std::thread::sleep(Duration::from_millis(50));
        }
        bar.finish_and_clear();
    }
}
