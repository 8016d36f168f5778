//! What stands under all that is said at a terminal, and tells how something goes.

use super::Remarks;
use super::output::visible;
use indicatif::{ProgressBar, ProgressStyle};
use std::sync::{Mutex, PoisonError};

/// Lines that are written over and over, until they are cleared.
#[derive(Default)]
pub struct StatusLine {
    remarks: Remarks,
    bar: Mutex<Option<ProgressBar>>,
}

impl StatusLine {
    /// Of a terminal, unless its user wants quiet.
    pub fn new(remarks: Remarks) -> Self {
        Self { remarks, bar: Mutex::default() }
    }

    /// Says something above what is shown.
    pub fn say(&self, text: &str) {
        self.above(|| self.remarks.say(text));
    }

    /// Does something that writes above what is shown.
    pub fn above(&self, writes: impl FnOnce()) {
        match &*self.bar.lock().unwrap_or_else(PoisonError::into_inner) {
            Some(bar) => bar.suspend(writes),
            None => writes(),
        }
    }

    /// Shows how it goes now.
    pub fn show(&self, text: &str) {
        if !self.remarks.shows_progress() {
            return;
        }
        let mut bar = self.bar.lock().unwrap_or_else(PoisonError::into_inner);
        let bar = bar.get_or_insert_with(|| {
            let style = ProgressStyle::with_template("{msg}");
            let style = style.unwrap_or_else(|_| ProgressStyle::default_bar());
            ProgressBar::new_spinner().with_style(style)
        });
        bar.set_message(visible(text).into_owned());
        bar.tick();
    }

    /// Shows nothing more.
    pub fn clear(&self) {
        let bar = self.bar.lock().unwrap_or_else(PoisonError::into_inner).take();
        bar.iter().for_each(ProgressBar::finish_and_clear);
    }
}

impl Drop for StatusLine {
    fn drop(&mut self) {
        self.clear();
    }
}
