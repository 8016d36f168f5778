//! The dialogue with the operator: questions on standard output, answers on standard input, a line
//! each.

use crate::cli::operator::Operator;
use crate::cli::print;
use crate::cli::signals::Signals;
use crate::error::Error;
use std::io::BufRead;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// Time between two looks at signals while nothing is answered.
const LOOK: Duration = Duration::from_millis(20);

/// Why a dialogue is over before its end.
#[derive(Debug)]
pub enum Ended {
    /// The operator stops here, to go on later; or there is nobody to answer any more.
    Stopped,
    /// A signal, by number.
    Signal(i32),
    /// Something that asking again does not mend.
    Failed(Error),
}

impl From<Error> for Ended {
    fn from(error: Error) -> Self {
        Self::Failed(error)
    }
}

/// Whoever answers.
pub struct Console {
    /// Shared with the guide through calibrations, one after the other.
    lines: Arc<Mutex<Receiver<String>>>,
    signals: Signals,
}

/// A choice: what is typed, and what it means.
pub type Choice = (&'static str, &'static str);

impl Console {
    /// Reads standard input on a thread of its own.
    ///
    /// # Errors
    /// No thread to be had.
    pub fn listen(signals: Signals) -> Result<Self, Error> {
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
        Ok(Self { lines: Arc::new(Mutex::new(lines)), signals })
    }

    /// The same person, for the guide through calibrations.
    pub fn operator(&self) -> Operator {
        Operator::sharing(self.signals.clone(), Arc::clone(&self.lines))
    }

    /// Says something. What cannot be said here, the report at the end cannot say either, and that
    /// counts.
    pub fn say(&self, text: &str) {
        let _ = print(&format!("{text}\n"));
    }

    /// Fails once somebody wants it to end.
    ///
    /// # Errors
    /// A signal that came.
    pub fn check(&self) -> Result<(), Ended> {
        self.signals.first().map_or(Ok(()), |number| Err(Ended::Signal(number)))
    }

    /// The line that was typed within this time, if one was.
    ///
    /// # Errors
    /// A signal, or the end of the input.
    pub fn line_within(&self, time: Duration) -> Result<Option<String>, Ended> {
        self.check()?;
        let lines = self.lines.lock().unwrap_or_else(PoisonError::into_inner);
        match lines.recv_timeout(time) {
            Ok(line) => Ok(Some(line.trim().to_owned())),
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => {
                // Input that ends with the terminal comes with a signal; that tells more.
                self.check()?;
                Err(Ended::Stopped)
            }
        }
    }

    /// Asks for a line. `q` stops the session wherever it is asked.
    ///
    /// # Errors
    /// A signal, the end of the input, or `q`.
    pub fn ask(&self, question: &str) -> Result<String, Ended> {
        let _ = print(&format!("{question}\n> "));
        loop {
            if let Some(line) = self.line_within(LOOK)? {
                return if line == "q" { Err(Ended::Stopped) } else { Ok(line) };
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
    ) -> Result<T, Ended> {
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
    pub fn choose(&self, question: &str, choices: &[Choice]) -> Result<&'static str, Ended> {
        let named: Vec<String> = choices
            .iter()
            .enumerate()
            .map(|(at, (key, words))| match at {
                0 => format!("Enter or {key}: {words}"),
                _ => format!("{key}: {words}"),
            })
            .collect();
        let asked = format!("{question}\n  [{}; q: stop, to go on later]", named.join("; "));
        self.ask_until(&asked, |answer| {
            let known = choices.iter().find(|(key, _)| key.eq_ignore_ascii_case(answer));
            match known.or(choices.first().filter(|_| answer.is_empty())) {
                Some((key, _)) => Ok(*key),
                None => Err(Error::new("not one of the answers")
                    .got(answer)
                    .allowed(choices.iter().map(|(key, _)| *key).collect::<Vec<_>>().join(", "))),
            }
        })
    }
}
