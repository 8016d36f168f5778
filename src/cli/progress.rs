//! A progress bar for a running motion, on a terminal only.

use super::Remarks;
use indicatif::{ProgressBar, ProgressStyle};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// Time played so far, written by the loop and shown by another thread.
#[derive(Clone, Debug, Default)]
pub struct Meter(Arc<AtomicU64>);

impl Meter {
    /// Says how far the motion is, s.
    pub fn set(&self, seconds: f64) {
        // Non-negative and far below the range of u64.
        self.0.store((seconds * 1e3) as u64, Ordering::Relaxed);
    }
}

/// The bar.
pub struct Progress {
    meter: Meter,
    bar: Option<ProgressBar>,
}

impl Progress {
    /// A bar over `duration_s`, hidden unless remarks are wanted.
    #[must_use]
    pub fn over(duration_s: f64, remarks: Remarks) -> Self {
        let bar = remarks.shows_progress().then(|| {
            let style = ProgressStyle::with_template("{bar:40} {msg}")
                .unwrap_or_else(|_| ProgressStyle::default_bar());
            ProgressBar::new((duration_s * 1e3) as u64).with_style(style)
        });
        Self { meter: Meter::default(), bar }
    }

    /// What the loop writes to.
    #[must_use]
    pub fn meter(&self) -> Meter {
        self.meter.clone()
    }

    /// Shows progress until `done`.
    pub fn show_until(&self, done: impl Fn() -> bool) {
        let Some(bar) = &self.bar else { return };
        let total_s = bar.length().unwrap_or(0) as f64 / 1e3;
        while !done() {
            let at = self.meter.0.load(Ordering::Relaxed);
            bar.set_position(at);
            bar.set_message(format!("{:.1} of {total_s:.1} s", at as f64 / 1e3));
            std::thread::sleep(Duration::from_millis(50));
        }
        bar.finish_and_clear();
    }
}
