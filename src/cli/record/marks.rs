//! Marks that whoever records sets at the terminal: Enter, or words and Enter.

use crate::recording::Marker;
use crate::sensing::{Clock, MonotonicClock};
use rustix::process::getpgrp;
use rustix::stdio::stdin;
use rustix::termios::{isatty, tcgetpgrp};
use std::io::BufRead;
use std::sync::mpsc::{Receiver, channel};

/// What Enter alone says.
const MARK: &str = "mark";

/// Listens to standard input from now on.
pub fn listen() -> Receiver<Marker> {
    let (sender, marks) = channel();
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
    marks
}

/// True unless the terminal belongs to another job: reading it would stop this one.
fn may_be_read() -> bool {
    !isatty(stdin()) || tcgetpgrp(stdin()).is_ok_and(|foreground| foreground == getpgrp())
}
