//! The terminal as the observer of a job: a signal ends it, a bar shows how far a motion is.

use super::signals::Signals;
use super::{Remarks, cues};
use crate::job::{Event, Observer, Progress};
use indicatif::{ProgressBar, ProgressStyle};
use std::time::Duration;

/// Whoever started the program.
pub struct Terminal<'a> {
    /// What is said beside the result.
    pub remarks: Remarks,
    /// What was heard of wishes to stop.
    pub signals: &'a Signals,
}

impl Observer for Terminal<'_> {
    fn hear(&self, event: Event<'_>) {
        match event {
            Event::Note(text) => self.remarks.say(text),
            Event::Sensing(event) => self.remarks.say(&cues::of_event(event)),
            Event::Planned { .. } | Event::Following | Event::Angles { .. } => {}
        }
    }

    fn wants_to_stop(&self) -> bool {
        self.signals.first().is_some()
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
            bar.set_message(format!("{time_s:.1} of {total_s:.1} s"));
            std::thread::sleep(Duration::from_millis(50));
        }
        bar.finish_and_clear();
    }
}
