//! What the person answers, one line each, read beside the joints.

use crate::cli::output::prompt;
use crate::cli::say;
use crate::cli::signals::Signals;
use crate::error::Error;
use std::io::{BufRead, IsTerminal};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::Duration;

/// What to do with a joint.
pub enum Answer<T> {
    /// It was measured.
    Go(T),
    /// Leave it as it is.
    Skip,
    /// End here; what was measured so far is kept.
    Stop,
}

impl<T> Answer<T> {
    /// Goes on with what was measured; a joint that is skipped, or a stop, stays that.
    ///
    /// # Errors
    /// What `next` fails with.
    pub fn then<U>(
        self,
        next: impl FnOnce(T) -> Result<Answer<U>, Error>,
    ) -> Result<Answer<U>, Error> {
        match self {
            Self::Go(value) => next(value),
            Self::Skip => Ok(Answer::Skip),
            Self::Stop => Ok(Answer::Stop),
        }
    }
}

/// What was said to a question of yes or no.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answered {
    /// Yes.
    Yes,
    /// Anything else, or nobody is there.
    No,
    /// A signal came instead.
    Stop,
}

/// Lines of standard input, and signals, which count as the wish to stop.
pub struct Answers {
    lines: Receiver<String>,
    signals: Signals,
}

/// Time between two looks at a joint while nothing is answered.
const LOOK: Duration = Duration::from_millis(5);

impl Answers {
    /// Reads standard input on a thread of its own.
    ///
    /// # Errors
    /// No thread to be had.
    pub fn listen(signals: Signals) -> Result<Self, Error> {
        let (sender, receiver) = channel();
        let read = move || {
            for line in std::io::stdin().lock().lines().map_while(Result::ok) {
                if sender.send(line).is_err() {
                    break;
                }
            }
        };
        std::thread::Builder::new()
            .name("answers".to_owned())
            .spawn(read)
            .map_err(|e| Error::new(format!("no thread: {e}")))?;
        Ok(Self { lines: receiver, signals })
    }

    /// True if a signal came.
    pub fn are_to_end(&self) -> bool {
        self.signals.first().is_some()
    }

    /// Asks for a plain yes, at a terminal only.
    pub fn consent(&mut self, question: &str) -> Answered {
        if !std::io::stdin().is_terminal() {
            return Answered::No;
        }
        prompt(question);
        loop {
            if self.are_to_end() {
                return Answered::Stop;
            }
            match self.lines.recv_timeout(LOOK) {
                Ok(line) if line.trim() == "yes" => return Answered::Yes,
                Ok(_) | Err(RecvTimeoutError::Disconnected) => return Answered::No,
                Err(RecvTimeoutError::Timeout) => {}
            }
        }
    }

    /// Asks, and calls `look` again and again until there is an answer. No more input is a stop, and
    /// so is a signal.
    ///
    /// # Errors
    /// What `look` fails with.
    pub fn ask(
        &mut self,
        question: &str,
        mut look: impl FnMut() -> Result<(), Error>,
    ) -> Result<Answer<()>, Error> {
        say(question);
        loop {
            if self.are_to_end() {
                return Ok(Answer::Stop);
            }
            look()?;
            let line = match self.lines.recv_timeout(LOOK) {
                Ok(line) => line,
                Err(RecvTimeoutError::Timeout) => continue,
                Err(RecvTimeoutError::Disconnected) => return Ok(Answer::Stop),
            };
            // What happened up to the answer belongs to it.
            look()?;
            match line.trim() {
                "" => return Ok(Answer::Go(())),
                "s" => return Ok(Answer::Skip),
                "q" => return Ok(Answer::Stop),
                other => say(&format!("  {other:?}? Enter goes on, s skips this joint, q stops")),
            }
        }
    }
}
