//! Marks that whoever records sets at the terminal: Enter, or words and Enter.

use crate::port::{Clock, MonotonicClock};
use crate::recording::{Marker, RecordedSource, Recorder, SourceId, SourceKind, SourceRecord};
use rustix::process::getpgrp;
use rustix::stdio::stdin;
use rustix::termios::{isatty, tcgetpgrp};
use std::collections::BTreeMap;
use std::io::BufRead;
use std::sync::mpsc::{Receiver, channel};

/// What Enter alone says.
const MARK: &str = "mark";

/// Marks of one recording.
pub struct Marks {
    lines: Receiver<Marker>,
    source: Option<SourceId>,
}

impl Marks {
    /// Listens to standard input from now on.
    pub fn listen() -> Self {
        let (sender, lines) = channel();
        if may_be_read() {
            // The thread waits for a line until the process ends; nothing depends on it.
            std::thread::spawn(move || {
                for line in std::io::stdin().lock().lines().map_while(Result::ok) {
                    let at = MonotonicClock.now();
                    let text = if line.trim().is_empty() { MARK } else { line.trim() };
                    if sender.send(Marker { at, text: text.to_owned() }).is_err() {
                        return;
                    }
                }
            });
        }
        Self { lines, source: None }
    }

    /// Records what was marked since.
    pub fn record(&mut self, recorder: &Recorder) {
        while let Ok(marker) = self.lines.try_recv() {
            // A recording without marks has no channel for them.
            let source = *self.source.get_or_insert_with(|| {
                recorder.add_source(RecordedSource {
                    name: "marks".to_owned(),
                    metadata: BTreeMap::new(),
                    kind: SourceKind::Marks,
                })
            });
            recorder.take_record(source, SourceRecord::Mark(marker));
        }
    }
}

/// True unless the terminal belongs to another job: reading it would stop this one.
fn may_be_read() -> bool {
    !isatty(stdin()) || tcgetpgrp(stdin()).is_ok_and(|foreground| foreground == getpgrp())
}
