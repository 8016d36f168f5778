//! The terminal of a session: questions on standard output, answers on standard input, a line each.

use crate::cli::operator::Operator;
use crate::cli::signals::Signals;
use crate::cli::{Remarks, print};
use crate::error::Error;
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

/// A choice: what is typed, what is said of it, and what it means.
pub type Choice<T> = (&'static str, &'static str, T);

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
    pub fn ask(&self, question: &str) -> Answered<String> {
        let _ = print(&format!("{question}\n> "));
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
        question: &str,
        mut read: impl FnMut(&str) -> Result<T, Error>,
    ) -> Answered<T> {
        loop {
            match read(&self.ask(question)?) {
                Ok(answer) => return Ok(answer),
                Err(error) => self.say(&format!("! {error}")),
            }
        }
    }

    /// Asks which of these it is; the first is meant by Enter alone.
    ///
    /// # Errors
    /// As [`Self::ask`].
    pub fn choose<T: Copy>(&self, question: &str, choices: &[Choice<T>]) -> Answered<T> {
        let named: Vec<String> = choices
            .iter()
            .enumerate()
            .map(|(at, (key, words, _))| match at {
                0 => format!("Enter or {key}: {words}"),
                _ => format!("{key}: {words}"),
            })
            .collect();
        let asked = format!("{question}\n  [{}; q: stop, to go on later]", named.join("; "));
        self.ask_until(&asked, |answer| {
            let known = choices.iter().find(|(key, ..)| key.eq_ignore_ascii_case(answer));
            match known.or(choices.first().filter(|_| answer.is_empty())) {
                Some((_, _, meant)) => Ok(*meant),
                None => Err(Error::new("not one of the answers")
                    .got(answer)
                    .allowed(choices.iter().map(|(key, ..)| *key).collect::<Vec<_>>().join(", "))),
            }
        })
    }
}
