//! Marks that whoever records sets at the terminal: Enter or space, or words and Enter.

use crate::cli::keys::{Keys, Typist, may_be_read};
use crate::recording::Marker;
use crate::sensing::{Clock, MonotonicClock};
use std::io::{BufRead, Read};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};

/// What Enter alone says.
const MARK: &str = "mark";

/// Somebody who sets marks.
pub struct Marks {
    /// The marks.
    pub set: Receiver<Marker>,
    /// A terminal waits for no Enter meanwhile.
    _keys: Option<Keys>,
}

/// Listens to standard input from now on; a note that is not ended yet stands in `typed`, or the terminal `echoes` it.
pub fn listen(typed: Arc<Mutex<String>>, echoes: bool) -> Marks {
    let (sender, set) = channel();
    let keys = Keys::hold(echoes);
    // The thread waits for a line until the process ends; nothing depends on it.
    if keys.is_some() {
        std::thread::spawn(move || pressed(&sender, &typed));
    } else if may_be_read() {
        std::thread::spawn(move || lines(&sender));
    }
    Marks { set, _keys: keys }
}

fn lines(marks: &Sender<Marker>) {
    for line in std::io::stdin().lock().split(b'\n').map_while(Result::ok) {
        let (at, line) = (MonotonicClock.now(), String::from_utf8_lossy(&line));
        let text = if line.trim().is_empty() { MARK } else { line.trim() };
        if marks.send(Marker { at, text: text.to_owned() }).is_err() {
            return;
        }
    }
}

fn pressed(marks: &Sender<Marker>, typed: &Mutex<String>) {
    let mut typist = Typist::default();
    let mut bytes = [0_u8; 256];
    while let Ok(count @ 1..) = std::io::stdin().lock().read(&mut bytes) {
        let (now, at) = (std::time::Instant::now(), MonotonicClock.now());
        for key in &bytes[..count] {
            let Some((begun, line)) = typist.press(*key, now) else { continue };
            let text = if line.is_empty() { MARK.to_owned() } else { line };
            let ago_ns = u64::try_from(now.duration_since(begun).as_nanos()).unwrap_or(0);
            let at = crate::time::Instant::from_nanos(at.as_nanos().saturating_sub(ago_ns));
            if marks.send(Marker { at, text }).is_err() {
                return;
            }
        }
        *typed.lock().unwrap_or_else(PoisonError::into_inner) = typist.typed();
    }
}
