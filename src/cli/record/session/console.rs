//! The terminal of a session: questions on standard output, answers on standard input, a line each.

use crate::cli::operator::Operator;
use crate::cli::signals::Signals;
use crate::cli::{Remarks, print};
use crate::error::Error;
use crate::job::session::words::Asking;
use crate::job::session::{Answered, Stopped};
use std::io::{BufRead, IsTerminal};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

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
}

impl Console {
    /// Reads standard input on a thread of its own.
    ///
    /// # Errors
    /// No thread to be had.
    pub fn listen(signals: Signals, remarks: Remarks) -> Result<Self, Error> {
        let (sender, lines) = channel();
        // The thread waits for a line until the process ends; nothing depends on it.
        let read = move || {
            for line in std::io::stdin().lock().lines().map_while(Result::ok) {
                if sender.send(line).is_err() {
                    return;
                }
            }
        };
        std::thread::Builder::new()
            .name("answers".to_owned())
            .spawn(read)
            .map_err(|e| Error::new(format!("no thread: {e}")))?;
        let lines = Arc::new(Mutex::new(lines));
        let person = Operator::sharing(signals.clone(), Arc::clone(&lines));
        Ok(Self { lines, signals, person, remarks })
    }

    /// Says something. What cannot be said here, the report at the end cannot say either, and that
    /// counts.
    pub fn say(&self, text: &str) {
        let _ = print(&format!("{text}\n"));
    }

    /// What somebody typed at a terminal before they were asked answers nothing that comes after it. Lines out of a file or a
    /// pipe were written for their turn.
    pub fn forget_typed(&self) {
        if std::io::stdin().is_terminal() {
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
            return Err(Stopped);
        }
        let lines = self.lines.lock().unwrap_or_else(PoisonError::into_inner);
        match lines.recv_timeout(time) {
            Ok(line) => Ok(Some(line.trim().to_owned())),
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => Err(Stopped),
        }
    }

    /// Asks for a line. `q` stops the session wherever it is asked.
    ///
    /// # Errors
    /// A signal, the end of the input, or `q`.
    pub fn ask(&self, asking: &Asking) -> Answered<String> {
        if !asking.before.is_empty() {
            self.say(&asking.before);
        }
        self.line(asking)
    }

    fn line(&self, asking: &Asking) -> Answered<String> {
        let _ = print(&format!("{}\n> ", asking.text()));
        loop {
            if let Some(line) = self.line_within(LOOK)? {
                return if line == "q" { Err(Stopped) } else { Ok(line) };
            }
        }
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
