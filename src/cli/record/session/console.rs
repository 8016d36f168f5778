//! The terminal of a session: questions on standard output, answers on standard input, a line each.

use crate::cli::keys::{Keys, Typist};
use crate::cli::operator::Operator;
use crate::cli::signals::Signals;
use crate::cli::{Remarks, print};
use crate::error::Error;
use crate::job::session::words::Asking;
use crate::job::session::{Answered, Instead};
use rustix::stdio::stdin;
use rustix::termios::{QueueSelector, tcflush};
use std::io::{IsTerminal, Read};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Time between two looks at signals while nothing is answered.
const LOOK: Duration = Duration::from_millis(20);

/// Whoever answers.
pub struct Console {
    /// Shared with the guide through calibrations, one after the other.
    lines: Arc<Mutex<Receiver<String>>>,
    signals: Signals,
    /// The same person, for the guide.
    pub(super) person: Operator,
    /// Where it is said what happens to sensors.
    pub(super) remarks: Remarks,
    /// True while keys count as they are pressed.
    pressed: Arc<AtomicBool>,
    keys: Mutex<Option<Keys>>,
    /// The question that waits for its answer.
    asked: Mutex<Option<String>>,
}

/// Hands on what is typed, line by line, or key by key while that is wanted.
fn typed(lines: &Sender<String>, by_keys: &AtomicBool) {
    let mut typist = Typist::new(b"x.");
    let mut line = Vec::new();
    let mut bytes = [0_u8; 256];
    while let Ok(count @ 1..) = std::io::stdin().lock().read(&mut bytes) {
        let now = Instant::now();
        let is_pressed = by_keys.load(Ordering::Acquire);
        if !is_pressed {
            typist = Typist::new(b"x.");
        }
        for byte in &bytes[..count] {
            let whole = match (is_pressed, byte) {
                (true, key) => typist.press(*key, now).map(|(_, line)| line),
                (false, b'\n') => {
                    Some(String::from_utf8_lossy(&std::mem::take(&mut line)).into_owned())
                }
                (false, byte) => {
                    line.push(*byte);
                    None
                }
            };
            if whole.is_some_and(|whole| lines.send(whole).is_err()) {
                return;
            }
        }
    }
    // As a line that its end ends.
    if !line.is_empty() {
        let _ = lines.send(String::from_utf8_lossy(&line).into_owned());
    }
}

impl Console {
    /// Reads standard input on a thread of its own.
    ///
    /// # Errors
    /// No thread to be had.
    pub fn listen(signals: Signals, remarks: Remarks) -> Result<Self, Error> {
        let (sender, lines) = channel();
        let pressed = Arc::new(AtomicBool::new(false));
        let by_keys = Arc::clone(&pressed);
        // The thread waits for a line until the process ends; nothing depends on it.
        let read = move || typed(&sender, &by_keys);
        std::thread::Builder::new()
            .name("answers".to_owned())
            .spawn(read)
            .map_err(|e| Error::new(format!("no thread: {e}")))?;
        let lines = Arc::new(Mutex::new(lines));
        let person = Operator::sharing(signals.clone(), Arc::clone(&lines));
        let (keys, asked) = Default::default();
        Ok(Self { lines, signals, person, remarks, pressed, keys, asked })
    }

    /// Says something. What cannot be said here, the report at the end cannot say either, and that
    /// counts.
    pub fn say(&self, text: &str) {
        let _ = print(&format!("{text}\n"));
    }

    /// Says something that has nothing to do with what is asked. At a terminal that is asked once more then: the answer would stand
    /// behind what was said.
    pub fn remark(&self, text: &str) {
        let asked = self.asked.lock().unwrap_or_else(PoisonError::into_inner);
        match &*asked {
            Some(question) if !self.remarks.quiet && std::io::stdin().is_terminal() => {
                self.say("");
                self.remarks.say(text);
                // What is typed and not ended yet would be unseen from here on, and yet be part of the answer.
                let _ = tcflush(stdin(), QueueSelector::IFlush);
                let _ = print(question);
            }
            _ => self.remarks.say(text),
        }
    }

    /// From now on keys count as they are pressed, or not any more.
    pub fn press_keys(&self, wanted: bool) {
        let mut keys = self.keys.lock().unwrap_or_else(PoisonError::into_inner);
        if wanted == keys.is_some() {
            return;
        }
        *keys = if wanted { Keys::hold(true) } else { None };
        self.pressed.store(keys.is_some(), Ordering::Release);
    }

    /// What somebody typed at a terminal before they were asked answers nothing that comes after it, nor does what is typed
    /// and not ended yet. Lines out of a file or a pipe were written for their turn.
    pub fn forget_typed(&self) {
        if std::io::stdin().is_terminal() {
            // Where the terminal does not forget, the lines that were read are forgotten all the same.
            let _ = tcflush(stdin(), QueueSelector::IFlush);
            let lines = self.lines.lock().unwrap_or_else(PoisonError::into_inner);
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
        let lines = self.lines.lock().unwrap_or_else(PoisonError::into_inner);
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
    /// A signal, the end of the input, or `q`.
    pub fn ask(&self, asking: &Asking) -> Answered<String> {
        self.press_keys(false);
        self.forget_typed();
        if !asking.before.is_empty() {
            self.say(&asking.before);
        }
        self.line(asking)
    }

    fn line(&self, asking: &Asking) -> Answered<String> {
        let question = format!("{}\n> ", asking.text());
        let put = |asked: Option<String>| {
            let mut place = self.asked.lock().unwrap_or_else(PoisonError::into_inner);
            let _ = print(asked.as_deref().unwrap_or_default());
            *place = asked;
        };
        put(Some(question));
        let said = loop {
            match self.line_within(LOOK) {
                Ok(None) => {}
                Ok(Some(line)) if line == "q" => break Err(Instead::Stop),
                Ok(Some(line)) => break Ok(line),
                Err(instead) => break Err(instead),
            }
        };
        put(None);
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
